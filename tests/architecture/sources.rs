//! The sources as syntax: modules, what they define, and every path they name.
//!
//! Only names are followed, no types: a path is made absolute by the `use`s of
//! its module, and a definition is found through re-exports. What is for tests
//! (`#[cfg(test)]`) is left out.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use proc_macro2::{Spacing, Span, TokenStream, TokenTree};
use syn::parse::Parser;
use syn::punctuated::Punctuated;
use syn::visit::{self, Visit};

/// `["brakecheck", "rl", "nn"]`
pub type Names = Vec<String>;

/// A path in a file, as written and made absolute.
#[derive(Debug)]
pub struct Mention {
    pub file: usize,
    pub line: usize,
    /// Absolute, as far as it leads into these sources; `Purpose::*` ends in `*`.
    pub path: Names,
    /// The module in which what it names is defined, and its file.
    pub defined: Option<(Names, usize)>,
    /// Whether it is a `pub use` of a file that has modules below it.
    pub passes_on: bool,
    /// Where it is, and what is written there.
    within: Names,
    written: Names,
}

/// What a module holds.
#[derive(Debug, Default)]
struct Module {
    file: usize,
    items: BTreeSet<String>,
    /// Words in macros between its items, any of which may become one.
    made: BTreeSet<String>,
    /// What its `use`s bring in, as written.
    brought: BTreeMap<String, Names>,
    globs: Vec<Names>,
}

#[derive(Debug, Default)]
pub struct Sources {
    /// Paths from the repository's root.
    pub files: Vec<String>,
    pub mentions: Vec<Mention>,
    modules: BTreeMap<Names, Module>,
    /// Modules that are compiled for tests only.
    tests: Vec<Names>,
}

/// Directory of the crates below the facade, `crates/NAME` with the package `brakecheck-NAME`.
const CRATES: &str = "crates/";

/// A chain of `use`s longer than this goes in a circle.
const LONGEST: usize = 32;

impl Sources {
    /// Reads files: paths from the repository's root, and texts.
    pub fn read(texts: &[(impl AsRef<str>, impl AsRef<str>)]) -> Sources {
        let mut sources = Sources::default();
        for (path, text) in texts {
            let (path, text) = (path.as_ref(), text.as_ref());
            let file = syn::parse_file(text).unwrap_or_else(|e| panic!("{path}: {e}"));
            let module = module_of(path);
            sources.files.push(path.to_owned());
            if file.attrs.iter().any(is_for_tests) {
                sources.tests.push(module);
                continue;
            }
            let has_modules =
                |item: &syn::Item| matches!(item, syn::Item::Mod(m) if m.content.is_none());
            let mut reader = Reader {
                file: sources.files.len() - 1,
                has_modules: file.items.iter().any(has_modules),
                module,
                sources: &mut sources,
            };
            reader.enter();
            reader.visit_file(&file);
        }
        let mut modules = std::mem::take(&mut sources.modules);
        modules.retain(|module, _| !sources.is_for_tests(module));
        sources.modules = modules;
        let mut mentions = std::mem::take(&mut sources.mentions);
        mentions.retain(|mention| !sources.is_for_tests(&mention.within));
        for mention in &mut mentions {
            mention.path = sources.absolute(&mention.within, &mention.written, 0);
            let defined = sources.defined(&mention.path, 0);
            mention.defined = defined.map(|(module, file)| (module.to_vec(), file));
        }
        sources.mentions = mentions;
        sources
    }

    /// Whether a module is compiled for tests only.
    pub fn is_for_tests(&self, module: &[String]) -> bool {
        self.tests.iter().any(|test| module.starts_with(test))
    }

    /// The module that a file is.
    pub fn module_of_file(&self, file: usize) -> Names {
        module_of(&self.files[file])
    }

    /// The module in which what a path names is defined, and its file.
    fn defined(&self, path: &[String], steps: usize) -> Option<(&[String], usize)> {
        let (mut at, mut module) = self.modules.get_key_value(path.get(..1)?)?;
        for (i, name) in path.iter().enumerate().skip(1) {
            let child = self.modules.get_key_value(&path[..=i]);
            let last = i + 1 == path.len();
            match child {
                // A function may have the name of its module.
                Some(child) if !last || !module.has(name) => (at, module) = child,
                _ if module.items.contains(name) || steps > LONGEST => break,
                _ => match self.brought_in(at, module, name, steps) {
                    Some(mut path_there) => {
                        path_there.extend_from_slice(&path[i + 1..]);
                        return self.defined(&path_there, steps + 1);
                    }
                    None => break,
                },
            }
        }
        Some((at, module.file))
    }

    /// The item that a path from its crate on leads to, and what the path names
    /// of it; nothing behind a module. `None` if a part of it does not exist.
    pub fn item(&self, path: &[String]) -> Option<Names> {
        self.item_within(path, 0)
    }

    fn item_within(&self, path: &[String], steps: usize) -> Option<Names> {
        let (mut at, mut module) = self.modules.get_key_value(path.get(..1)?)?;
        for (i, name) in path.iter().enumerate().skip(1) {
            let last = i + 1 == path.len();
            match self.modules.get_key_value(&path[..=i]) {
                Some(child) if !last || !module.has(name) => (at, module) = child,
                _ if module.items.contains(name) => return Some(path[i..].to_vec()),
                _ if steps > LONGEST => return None,
                _ => {
                    let from = self.brought_in(at, module, name, steps);
                    let from = from.map(|from| [&from, &path[i + 1..]].concat());
                    let item = from.and_then(|from| self.item_within(&from, steps + 1));
                    let made = || {
                        let through = |glob: &Names| {
                            let there = self.through(at, glob, name, steps);
                            let module = self.modules.get(&there[..there.len() - 1]);
                            module.is_some_and(|module| module.made.contains(name))
                        };
                        module.made.contains(name) || module.globs.iter().any(through)
                    };
                    return item.or_else(|| made().then(|| path[i..].to_vec()));
                }
            }
        }
        Some(Names::new())
    }

    /// Modules that have this name, wherever they are.
    pub fn modules_called(&self, name: &str) -> impl Iterator<Item = &Names> {
        let called = move |module: &&Names| module.last().is_some_and(|last| last == name);
        self.modules.keys().filter(called)
    }

    /// Where a name of a module comes from, if from elsewhere.
    fn brought_in(
        &self,
        at: &[String],
        module: &Module,
        name: &str,
        steps: usize,
    ) -> Option<Names> {
        match module.brought.get(name) {
            Some(written) => Some(self.absolute(at, written, steps + 1)),
            None => module.globs.iter().find_map(|glob| {
                let there = self.through(at, glob, name, steps);
                let module = self.modules.get(&there[..there.len() - 1])?;
                (module.has(name) || self.modules.contains_key(&there)).then_some(there)
            }),
        }
    }

    /// Where a name would come from through a glob.
    fn through(&self, at: &[String], glob: &[String], name: &str, steps: usize) -> Names {
        self.absolute(at, &[glob, &[name.to_owned()]].concat(), steps + 1)
    }

    /// A path of the module `at`, from the name of its crate on.
    fn absolute(&self, at: &[String], written: &[String], steps: usize) -> Names {
        let (mut base, mut rest) = (at, written);
        while let Some(first) = rest.first() {
            base = match first.as_str() {
                "crate" => &base[..1],
                "self" => base,
                "super" => &base[..base.len().saturating_sub(1).max(1)],
                _ => break,
            };
            rest = &rest[1..];
        }
        let known = self.modules.get(base).filter(|_| steps < LONGEST);
        let (Some((first, below)), Some(module)) = (rest.split_first(), known) else {
            return [base, rest].concat();
        };
        let here = [base, rest].concat();
        // A lonely name is a value or a type, not a module.
        let is_here = module.items.contains(first)
            || (written.len() > 1 && self.modules.contains_key(&here[..=base.len()]));
        match module.brought.get(first) {
            // `use explain::explain` and `use libm` begin elsewhere.
            Some(path) if path.first() == Some(first) && is_here => here,
            Some(path) if path.first() == Some(first) => rest.to_vec(),
            None if is_here || rest.len() < written.len() => here,
            _ => match self.brought_in(base, module, first, steps) {
                Some(there) => [&there, below].concat(),
                None => rest.to_vec(),
            },
        }
    }
}

impl Module {
    fn has(&self, name: &str) -> bool {
        self.items.contains(name) || self.brought.contains_key(name)
    }
}

fn module_of(path: &str) -> Names {
    let below = path
        .strip_prefix(CRATES)
        .and_then(|path| path.split_once("/src/"));
    let (name, inside) = match (below, path.strip_prefix("src/")) {
        (Some((name, inside)), _) => (format!("brakecheck_{name}"), inside),
        (None, Some(inside)) => ("brakecheck".to_owned(), inside),
        (None, None) => panic!("{path} is in no crate"),
    };
    let inside = inside.trim_end_matches(".rs");
    let parts = inside
        .split('/')
        .filter(|part| !["lib", "mod"].contains(part));
    match inside {
        // A crate of its own.
        "main" => vec!["main".to_owned()],
        _ => std::iter::once(name)
            .chain(parts.map(str::to_owned))
            .collect(),
    }
}

/// `#[cfg(test)]`, `#[cfg(all(test, unix))]`, `#[test]`
pub fn is_for_tests(attribute: &syn::Attribute) -> bool {
    fn asks(meta: &syn::Meta) -> bool {
        let inner = |list: &syn::MetaList| {
            let all = Punctuated::<syn::Meta, syn::Token![,]>::parse_terminated;
            all.parse2(list.tokens.clone()).unwrap_or_default()
        };
        match meta {
            syn::Meta::Path(path) => path.is_ident("test"),
            syn::Meta::List(list) if list.path.is_ident("any") => inner(list).iter().all(asks),
            syn::Meta::List(list) if list.path.is_ident("not") => false,
            syn::Meta::List(list) => inner(list).iter().any(asks),
            syn::Meta::NameValue(_) => false,
        }
    }
    let path = attribute.path();
    (path.is_ident("cfg") || path.is_ident("test")) && asks(&attribute.meta)
}

/// Walks one file; `module` is where it is.
struct Reader<'a> {
    sources: &'a mut Sources,
    file: usize,
    has_modules: bool,
    module: Names,
}

impl Reader<'_> {
    fn enter(&mut self) -> &mut Module {
        let file = self.file;
        let new = || Module {
            file,
            ..Module::default()
        };
        self.sources
            .modules
            .entry(self.module.clone())
            .or_insert_with(new)
    }

    fn mention(&mut self, written: Names, span: Span, passes_on: bool) {
        self.sources.mentions.push(Mention {
            file: self.file,
            line: span.start().line,
            path: Vec::new(),
            defined: None,
            passes_on,
            within: self.module.clone(),
            written,
        });
    }

    fn bring_in(&mut self, tree: &syn::UseTree, mut path: Names, passes_on: bool) {
        let (name, span) = match tree {
            syn::UseTree::Path(it) => {
                path.push(it.ident.to_string());
                return self.bring_in(&it.tree, path, passes_on);
            }
            syn::UseTree::Group(it) => {
                let each = |tree| self.bring_in(tree, path.clone(), passes_on);
                return it.items.iter().for_each(each);
            }
            syn::UseTree::Glob(it) => {
                self.enter().globs.push(path.clone());
                path.push("*".to_owned());
                return self.mention(path, it.star_token.spans[0], passes_on);
            }
            syn::UseTree::Name(it) => (&it.ident, &it.ident),
            syn::UseTree::Rename(it) => (&it.rename, &it.ident),
        };
        // `use a::{self, self as b}`
        if span != "self" || path.is_empty() {
            path.push(span.to_string());
        }
        let name = if name == "self" {
            path.last().cloned().unwrap_or_default()
        } else {
            name.to_string()
        };
        self.enter().brought.insert(name, path.clone());
        self.mention(path, span.span(), passes_on);
    }

    /// Paths in tokens that are no syntax yet: `a::b` and `a::{b, c::d}`.
    fn scan(&mut self, tokens: TokenStream, prefix: &[String]) {
        let mut path = prefix.to_vec();
        let mut joined = !prefix.is_empty();
        let mut colons = 0;
        let mut span = Span::call_site();
        for token in tokens {
            match token {
                TokenTree::Punct(p)
                    if p.as_char() == ':' && (colons == 1 || p.spacing() == Spacing::Joint) =>
                {
                    colons += 1;
                    joined = colons == 2 && !path.is_empty();
                    continue;
                }
                TokenTree::Ident(ident) => {
                    if !joined {
                        self.end(&mut path, span);
                    }
                    (path, span) = ([path, vec![ident.to_string()]].concat(), ident.span());
                    (joined, colons) = (false, 0);
                    continue;
                }
                TokenTree::Group(group) => {
                    let below = if joined {
                        std::mem::take(&mut path)
                    } else {
                        Vec::new()
                    };
                    self.end(&mut path, span);
                    self.scan(group.stream(), &below);
                }
                TokenTree::Punct(p) if p.as_char() == ',' => {
                    self.end(&mut path, span);
                    (path, joined, colons) = (prefix.to_vec(), !prefix.is_empty(), 0);
                    continue;
                }
                TokenTree::Literal(literal) => {
                    self.end(&mut path, span);
                    if let syn::Lit::Str(text) = syn::Lit::new(literal)
                        && let Ok(path) = text.parse::<syn::Path>()
                    {
                        self.visit_path(&path);
                    }
                }
                TokenTree::Punct(_) => self.end(&mut path, span),
            }
            (joined, colons) = (false, 0);
        }
        self.end(&mut path, span);
    }

    fn end(&mut self, path: &mut Names, span: Span) {
        let path = std::mem::take(path);
        if path.len() > 1 {
            self.mention(path, span, false);
        }
    }
}

impl<'a> Visit<'a> for Reader<'_> {
    fn visit_item(&mut self, item: &'a syn::Item) {
        use syn::Item;
        let (name, attributes) = match item {
            Item::Const(it) => (Some(&it.ident), &it.attrs),
            Item::Enum(it) => (Some(&it.ident), &it.attrs),
            Item::ExternCrate(it) => (None, &it.attrs),
            Item::Fn(it) => (Some(&it.sig.ident), &it.attrs),
            Item::Impl(it) => (None, &it.attrs),
            Item::Macro(it) => (it.ident.as_ref(), &it.attrs),
            Item::Mod(it) => (None, &it.attrs),
            Item::Static(it) => (Some(&it.ident), &it.attrs),
            Item::Struct(it) => (Some(&it.ident), &it.attrs),
            Item::Trait(it) => (Some(&it.ident), &it.attrs),
            Item::Type(it) => (Some(&it.ident), &it.attrs),
            Item::Union(it) => (Some(&it.ident), &it.attrs),
            Item::Use(it) => (None, &it.attrs),
            _ => return visit::visit_item(self, item),
        };
        if attributes.iter().any(is_for_tests) {
            if let Item::Mod(it) = item {
                let test = [&self.module[..], &[it.ident.to_string()]].concat();
                self.sources.tests.push(test);
            }
            return;
        }
        if let Some(name) = name {
            self.enter().items.insert(name.to_string());
        }
        if let Item::Macro(it) = item {
            let words = words(it.mac.tokens.clone());
            self.enter().made.extend(words);
        }
        visit::visit_item(self, item);
    }

    fn visit_item_mod(&mut self, it: &'a syn::ItemMod) {
        if it.content.is_some() {
            self.module.push(it.ident.to_string());
            self.enter();
            visit::visit_item_mod(self, it);
            self.module.pop();
        }
    }

    fn visit_item_use(&mut self, it: &'a syn::ItemUse) {
        let public = !matches!(it.vis, syn::Visibility::Inherited);
        let passes_on = public && self.has_modules;
        self.bring_in(&it.tree, Vec::new(), passes_on);
    }

    fn visit_item_extern_crate(&mut self, it: &'a syn::ItemExternCrate) {
        let name = it.rename.as_ref().map_or(&it.ident, |(_, name)| name);
        let path = if it.ident == "self" {
            "crate".to_owned()
        } else {
            it.ident.to_string()
        };
        self.enter().brought.insert(name.to_string(), vec![path]);
    }

    fn visit_impl_item(&mut self, it: &'a syn::ImplItem) {
        let attributes = match it {
            syn::ImplItem::Fn(it) => &it.attrs,
            syn::ImplItem::Const(it) => &it.attrs,
            _ => return visit::visit_impl_item(self, it),
        };
        if !attributes.iter().any(is_for_tests) {
            visit::visit_impl_item(self, it);
        }
    }

    /// `pub(crate)` names nothing.
    fn visit_visibility(&mut self, _: &'a syn::Visibility) {}

    fn visit_path(&mut self, path: &'a syn::Path) {
        let written = path
            .segments
            .iter()
            .map(|it| it.ident.to_string())
            .collect();
        let span = path
            .segments
            .last()
            .map_or_else(Span::call_site, |it| it.ident.span());
        self.mention(written, span, false);
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, it: &'a syn::Macro) {
        let mut path: Names = it
            .path
            .segments
            .iter()
            .map(|s| s.ident.to_string())
            .collect();
        if let Some(last) = path.last_mut() {
            last.push('!');
        }
        let span = it
            .path
            .segments
            .last()
            .map_or_else(Span::call_site, |s| s.ident.span());
        self.mention(path, span, false);
        self.scan(it.tokens.clone(), &[]);
    }

    fn visit_attribute(&mut self, it: &'a syn::Attribute) {
        if let syn::Meta::List(list) = &it.meta {
            self.scan(list.tokens.clone(), &[]);
        }
    }
}

/// Every word in tokens, however deep.
pub fn words(tokens: TokenStream) -> Vec<String> {
    let of = |token| match token {
        TokenTree::Group(group) => words(group.stream()),
        TokenTree::Ident(ident) => vec![ident.to_string()],
        TokenTree::Punct(_) | TokenTree::Literal(_) => Vec::new(),
    };
    tokens.into_iter().flat_map(of).collect()
}

/// Every Rust file below a directory, from `root`.
pub fn list(root: &Path, directory: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut directories = vec![root.join(directory)];
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(directory).expect("a source directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                directories.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).expect("a source file");
                let inside = path.strip_prefix(root).expect("inside");
                files.push((inside.to_string_lossy().into_owned(), text));
            }
        }
    }
    files.sort();
    files
}
