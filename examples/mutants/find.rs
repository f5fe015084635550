//! Where a source can be changed, and into what: all mutants of one file.
//!
//! A mutant is a span of bytes and a text that may stand there instead. Left
//! out is what is no behaviour of the library or no place for a switch: tests,
//! `Debug`, `Display` and `Error`, patterns, types, constants, `const fn`, and
//! the arguments of macros, which are no syntax tree.

use std::ops::Range;

use serde::{Deserialize, Serialize};
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, ExprRange, Lit, Pat, RangeLimits, ReturnType, Stmt, Type, UnOp};

/// How a switch is put around the changed span.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Form {
    /// The span is an expression.
    Expression,
    /// The span is a whole statement.
    Statement,
    /// The span is empty: where a function begins.
    Entry,
}

/// One change of one file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Mutant {
    /// The bytes that are replaced.
    pub span: Range<usize>,
    /// How a switch is put around them.
    pub form: Form,
    /// What stands there instead.
    pub text: String,
    /// Line and column of the span, from 1, and the function it is in.
    pub place: String,
    /// The change in words.
    pub change: String,
}

/// All mutants of a file, in the order of its lines.
///
/// # Errors
/// When the text is not Rust.
pub fn mutants(source: &str) -> syn::Result<Vec<Mutant>> {
    let mut finder = Finder {
        source,
        names: Vec::new(),
        found: Vec::new(),
    };
    finder.visit_file(&syn::parse_file(source)?);
    finder.found.sort_by_key(|m| (m.span.start, m.span.end));
    Ok(finder.found)
}

struct Finder<'a> {
    source: &'a str,
    names: Vec<String>,
    found: Vec<Mutant>,
}

impl Finder<'_> {
    fn text(&self, node: &impl Spanned) -> &str {
        &self.source[node.span().byte_range()]
    }

    fn add(&mut self, node: &impl Spanned, form: Form, text: String) {
        let to = match form {
            Form::Statement => "nothing",
            _ => &text,
        };
        let change = format!("{} → {}", short(self.text(node)), short(to));
        self.push(node.span().byte_range(), form, text, change);
    }

    fn push(&mut self, span: Range<usize>, form: Form, text: String, change: String) {
        let before = &self.source[..span.start];
        let line = before.matches('\n').count() + 1;
        let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
        self.found.push(Mutant {
            place: format!("{line}:{column} {}", self.names.join("::")),
            span,
            form,
            text,
            change,
        });
    }

    fn expression(&mut self, node: &impl Spanned, text: String) {
        self.add(node, Form::Expression, text);
    }

    /// A condition that always or never holds; one that binds names cannot.
    fn condition(&mut self, condition: &Expr, values: &[&str]) {
        if !binds(condition) {
            for value in values {
                self.expression(condition, value.to_string());
            }
        }
    }

    /// A function that returns at once.
    fn entry(&mut self, output: &ReturnType, body: &syn::Block) {
        if body.stmts.is_empty() {
            return;
        }
        let values = match output {
            ReturnType::Default => vec![String::new()],
            ReturnType::Type(_, kind) => plain_values(self.text(kind)),
        };
        let open = body.brace_token.span.open().byte_range().end;
        let close = body.brace_token.span.close().byte_range().start;
        for value in values {
            if self.source[open..close].trim() != value {
                let text = format!("{};", format!("return {value}").trim_end());
                let change = format!("the body → {text}");
                self.push(open..open, Form::Entry, text, change);
            }
        }
    }

    fn function(&mut self, attributes: &[syn::Attribute], of: &syn::Signature, body: &syn::Block) {
        if of.constness.is_some() || is_test(attributes) {
            return;
        }
        self.names.push(of.ident.to_string());
        self.entry(&of.output, body);
        self.visit_block(body);
        self.names.pop();
    }
}

impl<'ast> Visit<'ast> for Finder<'_> {
    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.attrs, &item.sig, &item.block);
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.function(&item.attrs, &item.sig, &item.block);
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        if let Some(body) = &item.default {
            self.function(&item.attrs, &item.sig, body);
        }
    }

    fn visit_item_mod(&mut self, item: &'ast syn::ItemMod) {
        if !is_test(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'ast syn::ItemImpl) {
        let of = item.trait_.as_ref().and_then(|(_, path, _)| last(path));
        let face = matches!(of.as_deref(), Some("Debug" | "Display" | "Error"));
        if face || is_test(&item.attrs) {
            return;
        }
        let name = match &*item.self_ty {
            Type::Path(path) => last(&path.path).unwrap_or_default(),
            other => short(self.text(other)),
        };
        self.names.push(name);
        visit::visit_item_impl(self, item);
        self.names.pop();
    }

    fn visit_item_trait(&mut self, item: &'ast syn::ItemTrait) {
        self.names.push(item.ident.to_string());
        visit::visit_item_trait(self, item);
        self.names.pop();
    }

    fn visit_stmt(&mut self, statement: &'ast Stmt) {
        // A binary expression that is a statement is an assignment.
        if let Stmt::Expr(it, Some(_)) = statement
            && let Expr::MethodCall(_) | Expr::Call(_) | Expr::Assign(_) | Expr::Binary(_) = it
        {
            self.add(statement, Form::Statement, String::new());
        }
        visit::visit_stmt(self, statement);
    }

    fn visit_expr_binary(&mut self, it: &'ast syn::ExprBinary) {
        let chain = matches!(it.op, BinOp::And(_)) && (binds(&it.left) || binds(&it.right));
        if !chain {
            for operator in others(self.text(&it.op)) {
                let (left, right) = (self.text(&it.left), self.text(&it.right));
                // `x as usize < y` would be read as generics.
                let text = match &*it.left {
                    Expr::Cast(_) => format!("({left}) {operator} {right}"),
                    _ => format!("{left} {operator} {right}"),
                };
                self.expression(it, text);
            }
        }
        visit::visit_expr_binary(self, it);
    }

    fn visit_expr_unary(&mut self, it: &'ast syn::ExprUnary) {
        if matches!(it.op, UnOp::Not(_) | UnOp::Neg(_)) {
            self.expression(it, self.text(&it.expr).to_string());
        }
        visit::visit_expr_unary(self, it);
    }

    fn visit_expr_lit(&mut self, it: &'ast syn::ExprLit) {
        if let Some(text) = other_literal(&it.lit) {
            self.expression(it, text);
        }
    }

    fn visit_expr_if(&mut self, it: &'ast syn::ExprIf) {
        self.condition(&it.cond, &["true", "false"]);
        visit::visit_expr_if(self, it);
    }

    /// `while true` would only hang.
    fn visit_expr_while(&mut self, it: &'ast syn::ExprWhile) {
        self.condition(&it.cond, &["false"]);
        visit::visit_expr_while(self, it);
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        if let Some((_, guard)) = &arm.guard {
            self.condition(guard, &["true", "false"]);
        }
        visit::visit_arm(self, arm);
    }

    fn visit_expr_method_call(&mut self, it: &'ast syn::ExprMethodCall) {
        if let Some(other) = other_extreme(&it.method.to_string())
            && it.args.len() == 1
        {
            let at = it.method.span().byte_range();
            let text = self.replaced(it, at, other);
            self.expression(it, text);
        }
        visit::visit_expr_method_call(self, it);
    }

    fn visit_expr_call(&mut self, it: &'ast syn::ExprCall) {
        if let Expr::Path(path) = &*it.func
            && let Some(segment) = path.path.segments.last()
        {
            if segment.ident == "Some" {
                self.expression(it, "None".to_string());
            } else if let Some(other) = other_extreme(&segment.ident.to_string())
                && path.path.segments.len() > 1
            {
                let text = self.replaced(it, segment.ident.span().byte_range(), other);
                self.expression(it, text);
            }
        }
        visit::visit_expr_call(self, it);
    }

    /// `a..b` and `a..=b` are different types, so it is b that changes.
    fn visit_expr_range(&mut self, it: &'ast ExprRange) {
        if let Some(end) = &it.end {
            let text = match it.limits {
                RangeLimits::HalfOpen(_) => format!("({}) + 1", self.text(end)),
                RangeLimits::Closed(_) => format!("({}).saturating_sub(1)", self.text(end)),
            };
            let change = format!("{} → {}", short(self.text(it)), other_limits(it));
            let span = end.span().byte_range();
            self.push(span, Form::Expression, text, change);
        }
        visit::visit_expr_range(self, it);
    }

    fn visit_expr_repeat(&mut self, it: &'ast syn::ExprRepeat) {
        self.visit_expr(&it.expr);
    }

    // No place for a switch.
    fn visit_attribute(&mut self, _: &'ast syn::Attribute) {}
    fn visit_pat(&mut self, _: &'ast Pat) {}
    fn visit_type(&mut self, _: &'ast Type) {}
    fn visit_variant(&mut self, _: &'ast syn::Variant) {}
    fn visit_generics(&mut self, _: &'ast syn::Generics) {}
    fn visit_generic_argument(&mut self, _: &'ast syn::GenericArgument) {}
    fn visit_item_const(&mut self, _: &'ast syn::ItemConst) {}
    fn visit_item_static(&mut self, _: &'ast syn::ItemStatic) {}
    fn visit_impl_item_const(&mut self, _: &'ast syn::ImplItemConst) {}
    fn visit_trait_item_const(&mut self, _: &'ast syn::TraitItemConst) {}
    fn visit_expr_const(&mut self, _: &'ast syn::ExprConst) {}
}

impl Finder<'_> {
    /// The text of a node in which one part is written otherwise.
    fn replaced(&self, node: &impl Spanned, part: Range<usize>, by: &str) -> String {
        let whole = node.span().byte_range();
        let (before, after) = (whole.start..part.start, part.end..whole.end);
        format!("{}{by}{}", &self.source[before], &self.source[after])
    }
}

/// Whether a condition contains `let`.
fn binds(condition: &Expr) -> bool {
    match condition {
        Expr::Let(_) => true,
        Expr::Binary(it) if matches!(it.op, BinOp::And(_)) => binds(&it.left) || binds(&it.right),
        _ => false,
    }
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| match &attribute.meta {
        syn::Meta::Path(path) => path.is_ident("test"),
        syn::Meta::List(list) => {
            list.path.is_ident("cfg") && list.tokens.to_string().contains("test")
        }
        syn::Meta::NameValue(_) => false,
    })
}

fn last(path: &syn::Path) -> Option<String> {
    path.segments.last().map(|it| it.ident.to_string())
}

/// What may stand instead of a binary operator.
fn others(operator: &str) -> &'static [&'static str] {
    match operator {
        "+" => &["-"],
        "-" => &["+"],
        "*" => &["/"],
        "/" | "%" => &["*"],
        "<" => &["<=", ">"],
        "<=" => &["<", ">="],
        ">" => &[">=", "<"],
        ">=" => &[">", "<="],
        "==" => &["!="],
        "!=" => &["=="],
        "&&" => &["||"],
        "||" => &["&&"],
        "+=" => &["-="],
        "-=" => &["+="],
        "*=" => &["/="],
        "/=" | "%=" => &["*="],
        _ => &[],
    }
}

fn other_extreme(name: &str) -> Option<&'static str> {
    match name {
        "min" => Some("max"),
        "max" => Some("min"),
        _ => None,
    }
}

fn other_limits(range: &ExprRange) -> &'static str {
    match range.limits {
        RangeLimits::HalfOpen(_) => "..=",
        RangeLimits::Closed(_) => "..",
    }
}

/// 0 and 1 are exchanged, n becomes n + 1, x becomes −x.
fn other_literal(literal: &Lit) -> Option<String> {
    match literal {
        Lit::Bool(it) => Some((!it.value).to_string()),
        Lit::Int(it) => {
            let other = match it.base10_parse::<u128>().ok()? {
                0 => 1,
                1 => 0,
                n => n + 1,
            };
            Some(format!("{other}{}", it.suffix()))
        }
        Lit::Float(it) => {
            let value = it.base10_parse::<f64>().ok()?;
            let suffix = it.suffix();
            Some(match value {
                0.0 => format!("1.0{suffix}"),
                1.0 => format!("0.0{suffix}"),
                _ => format!("-{it}"),
            })
        }
        _ => None,
    }
}

/// Values that anybody can make of a type.
fn plain_values(kind: &str) -> Vec<String> {
    let end = kind.find(['<', ',']).unwrap_or(kind.len());
    let values: &[&str] = match kind[..end].rsplit("::").next().unwrap_or(kind) {
        "()" => &["()"],
        "bool" => &["true", "false"],
        "f32" | "f64" => &["0.0", "1.0"],
        "u8" | "u16" | "u32" | "u64" | "usize" => &["0", "1"],
        "i8" | "i16" | "i32" | "i64" | "isize" => &["0", "1"],
        "String" => &["String::new()"],
        "Vec" => &["Vec::new()"],
        "Option" => &["None"],
        "Result" => {
            let inner = plain_values(kind[end..].trim_start_matches('<'));
            return inner.iter().map(|value| format!("Ok({value})")).collect();
        }
        _ => &[],
    };
    values.iter().map(ToString::to_string).collect()
}

/// One line of at most 48 characters.
fn short(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ");
    match line.chars().count() {
        0..=48 => line,
        _ => line.chars().take(47).chain(['…']).collect(),
    }
}
