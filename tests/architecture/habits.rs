//! Habits of the code that neither rustfmt nor clippy holds.

use std::collections::BTreeMap;

use syn::punctuated::Punctuated;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Pat, Stmt, Token, Type};

use crate::sources::{is_for_tests, words};

/// Habit that makes code harder to read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Habit {
    /// `0 < x` instead of `x > 0`.
    ConstantOnTheLeft,
    /// `let x = a(); let x = x.b();`.
    Rebinding,
    /// `fn f((a, b): (A, B))`.
    TupleParameter,
}

/// Lines of a file with each habit, of its product code alone.
pub fn habits(text: &str) -> BTreeMap<Habit, Vec<usize>> {
    let file = syn::parse_file(text).expect("Rust");
    let mut found = Found::default();
    found.visit_file(&file);
    found.lines
}

#[derive(Default)]
struct Found {
    lines: BTreeMap<Habit, Vec<usize>>,
}

impl Found {
    fn add(&mut self, habit: Habit, place: proc_macro2::Span) {
        self.lines
            .entry(habit)
            .or_default()
            .push(place.start().line);
    }
}

impl<'ast> Visit<'ast> for Found {
    fn visit_item_mod(&mut self, module: &'ast syn::ItemMod) {
        if !module.attrs.iter().any(is_for_tests) {
            visit::visit_item_mod(self, module);
        }
    }

    fn visit_expr_binary(&mut self, both: &'ast syn::ExprBinary) {
        let compares = matches!(
            both.op,
            BinOp::Lt(_) | BinOp::Le(_) | BinOp::Gt(_) | BinOp::Ge(_) | BinOp::Eq(_) | BinOp::Ne(_)
        );
        if compares && is_constant(&both.left) && !is_constant(&both.right) {
            self.add(Habit::ConstantOnTheLeft, both.span());
        }
        visit::visit_expr_binary(self, both);
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        let list = Punctuated::<Expr, Token![,]>::parse_terminated;
        // Macros with a syntax of their own have nothing to compare.
        if let Ok(arguments) = called.parse_body_with(list) {
            let mut inside = Found::default();
            arguments.iter().for_each(|it| inside.visit_expr(it));
            for (habit, lines) in inside.lines {
                self.lines.entry(habit).or_default().extend(lines);
            }
        }
    }

    fn visit_block(&mut self, block: &'ast syn::Block) {
        for pair in block.stmts.windows(2) {
            let [Stmt::Local(before), Stmt::Local(after)] = pair else {
                continue;
            };
            let (Some(name), Some(again)) = (bound(&before.pat), bound(&after.pat)) else {
                continue;
            };
            let uses = |init: &syn::LocalInit| {
                let mut names = Names(Vec::new());
                names.visit_expr(&init.expr);
                names.0.contains(&name)
            };
            if name == again && after.init.as_ref().is_some_and(uses) {
                self.add(Habit::Rebinding, after.span());
            }
        }
        visit::visit_block(self, block);
    }

    fn visit_pat_type(&mut self, parameter: &'ast syn::PatType) {
        if let (Pat::Tuple(_), Type::Tuple(_)) = (&*parameter.pat, &*parameter.ty) {
            self.add(Habit::TupleParameter, parameter.span());
        }
        visit::visit_pat_type(self, parameter);
    }

    fn visit_local(&mut self, local: &'ast syn::Local) {
        // `let (a, b): (A, B) = …` is no parameter.
        if let Some(init) = &local.init {
            self.visit_local_init(init);
        }
    }
}

/// Every name in an expression, also within macros.
struct Names(Vec<String>);

impl<'ast> Visit<'ast> for Names {
    fn visit_ident(&mut self, name: &'ast syn::Ident) {
        self.0.push(name.to_string());
    }

    fn visit_macro(&mut self, called: &'ast syn::Macro) {
        self.0.extend(words(called.tokens.clone()));
    }
}

/// Returns whether an expression is a literal or a named constant.
fn is_constant(expr: &Expr) -> bool {
    match expr {
        Expr::Lit(_) => true,
        Expr::Unary(negated) => matches!(&*negated.expr, Expr::Lit(_)),
        Expr::Path(path) => path.path.segments.last().is_some_and(|last| {
            let name = last.ident.to_string();
            let in_capitals = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
            name.len() > 1 && name.chars().all(in_capitals)
        }),
        _ => false,
    }
}

/// Returns the name that a pattern binds, if it binds nothing else.
fn bound(pattern: &Pat) -> Option<String> {
    match pattern {
        Pat::Ident(name) => Some(name.ident.to_string()),
        Pat::Type(typed) => bound(&typed.pat),
        _ => None,
    }
}

#[test]
fn habits_are_found_in_product_code() {
    let text = r#"
fn f((a, b): (f64, f64), c: f64) -> bool {
    let x = a + b;
    let x = x.sqrt();
    let (d, e): (f64, f64) = (x, c);
    assert!(0.0 < d, "{e}");
    let y = 1;
    let x = y;
    LIMIT <= e && x > 0 && (0 == y)
}
#[cfg(test)]
mod tests {
    fn g(x: u8) -> bool { 0 < x }
}
"#;
    let found = habits(text);
    assert_eq!(found[&Habit::TupleParameter], [2]);
    assert_eq!(found[&Habit::Rebinding], [4]);
    assert_eq!(found[&Habit::ConstantOnTheLeft], [6, 9, 9]);
}
