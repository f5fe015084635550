//! Types by their names.

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};

use super::sources::{Sources, is_for_tests};

/// What makes a type, a trait included.
const KINDS: [&str; 5] = ["struct", "enum", "union", "trait", "type"];

/// The names of public types that are more than one, each with where they are.
///
/// What is `pub` counts wherever it stands, so that a name means one thing in
/// private modules too; a re-export is no type of its own.
pub fn twice(
    sources: &Sources,
    texts: &[(impl AsRef<str>, impl AsRef<str>)],
) -> BTreeMap<String, Vec<String>> {
    let mut public = Public::default();
    for (at, (path, text)) in texts.iter().enumerate() {
        if sources.is_for_tests(&sources.module_of_file(at)) {
            continue;
        }
        let file = syn::parse_file(text.as_ref()).expect("a source file");
        public.path = path.as_ref().to_owned();
        public.visit_file(&file);
    }
    public.types.retain(|_, places| places.len() > 1);
    public.types
}

/// The names of types, private ones included, that several files define.
///
/// Types of tests and the associated types of traits do not count, since a trait
/// of the standard library names some of those.
pub fn in_several_files(
    texts: &[(impl AsRef<str>, impl AsRef<str>)],
) -> BTreeMap<String, BTreeSet<String>> {
    let mut types = Types::default();
    for (path, text) in texts {
        let file = syn::parse_file(text.as_ref()).expect("a source file");
        if file.attrs.iter().any(is_for_tests) {
            continue;
        }
        types.path = path.as_ref().to_owned();
        types.visit_file(&file);
    }
    types.files.retain(|_, files| files.len() > 1);
    types.files
}

#[derive(Default)]
struct Types {
    path: String,
    files: BTreeMap<String, BTreeSet<String>>,
}

impl<'a> Visit<'a> for Types {
    fn visit_item(&mut self, item: &'a syn::Item) {
        if let Some((_, name, attributes)) = type_of(item) {
            if attributes.iter().any(is_for_tests) {
                return;
            }
            let files = self.files.entry(name.to_string()).or_default();
            files.insert(self.path.clone());
        } else if let syn::Item::Mod(it) = item
            && it.attrs.iter().any(is_for_tests)
        {
            return;
        }
        visit::visit_item(self, item);
    }
}

/// Visibility, name and attributes of an item that is a type.
fn type_of(item: &syn::Item) -> Option<(&syn::Visibility, &syn::Ident, &[syn::Attribute])> {
    use syn::Item;
    Some(match item {
        Item::Enum(it) => (&it.vis, &it.ident, &it.attrs),
        Item::Struct(it) => (&it.vis, &it.ident, &it.attrs),
        Item::Trait(it) => (&it.vis, &it.ident, &it.attrs),
        Item::Type(it) => (&it.vis, &it.ident, &it.attrs),
        Item::Union(it) => (&it.vis, &it.ident, &it.attrs),
        _ => return None,
    })
}

#[derive(Default)]
struct Public {
    path: String,
    types: BTreeMap<String, Vec<String>>,
}

impl Public {
    fn add(&mut self, name: &proc_macro2::Ident) {
        let place = format!("{}:{}", self.path, name.span().start().line);
        let places = self.types.entry(name.to_string()).or_default();
        places.push(place);
    }

    /// `pub struct A` in tokens of macros, which are no syntax yet.
    fn scan(&mut self, tokens: TokenStream) {
        // The last two tokens, as far as they are words.
        let (mut before, mut last) = (String::new(), String::new());
        for token in tokens {
            let mut word = String::new();
            match token {
                TokenTree::Group(group) => self.scan(group.stream()),
                TokenTree::Ident(ident) => {
                    if before == "pub" && KINDS.contains(&&*last) {
                        self.add(&ident);
                    }
                    word = ident.to_string();
                }
                _ => {}
            }
            (before, last) = (last, word);
        }
    }
}

impl<'a> Visit<'a> for Public {
    fn visit_item(&mut self, item: &'a syn::Item) {
        use syn::Item;
        let (visible, name, attributes) = match item {
            Item::Enum(it) => (Some(&it.vis), Some(&it.ident), &it.attrs),
            Item::Struct(it) => (Some(&it.vis), Some(&it.ident), &it.attrs),
            Item::Trait(it) => (Some(&it.vis), Some(&it.ident), &it.attrs),
            Item::Type(it) => (Some(&it.vis), Some(&it.ident), &it.attrs),
            Item::Union(it) => (Some(&it.vis), Some(&it.ident), &it.attrs),
            Item::Mod(it) => (None, None, &it.attrs),
            Item::Macro(it) => (None, None, &it.attrs),
            _ => return visit::visit_item(self, item),
        };
        if attributes.iter().any(is_for_tests) {
            return;
        }
        if let (Some(syn::Visibility::Public(_)), Some(name)) = (visible, name) {
            self.add(name);
        }
        visit::visit_item(self, item);
    }

    fn visit_macro(&mut self, it: &'a syn::Macro) {
        self.scan(it.tokens.clone());
    }
}

/// Words that name nothing a reader would search for, in any name of the code.
const PRIVATE_WORDS: [&str; 16] = [
    "alike", "asked", "cast", "foretold", "heard", "lived", "meeting", "meets", "met", "nobody",
    "somebody", "say", "says", "telling", "told", "whom",
];

/// Names with a private word that must stay: keys of stored files, a premise, and a term of
/// collision detection.
const KEPT_NAMES: [&str; 7] = [
    "Asked",
    "NobodyAhead",
    "NotAsked",
    "PremiseNotMet",
    "cast",
    "decisions_asked",
    "not_asked",
];

/// The names of functions, fields, variants, types and variables with a private word,
/// each with its place.
pub fn private_words(
    sources: &Sources,
    texts: &[(impl AsRef<str>, impl AsRef<str>)],
) -> Vec<String> {
    let mut found = PrivateWords::default();
    for (at, (path, text)) in texts.iter().enumerate() {
        if sources.is_for_tests(&sources.module_of_file(at)) {
            continue;
        }
        let file = syn::parse_file(text.as_ref()).expect("a source file");
        if file.attrs.iter().any(is_for_tests) {
            continue;
        }
        found.path = path.as_ref().to_owned();
        found.visit_file(&file);
    }
    found.names
}

#[derive(Default)]
struct PrivateWords {
    path: String,
    names: Vec<String>,
}

impl PrivateWords {
    fn check(&mut self, name: &syn::Ident) {
        let text = name.to_string();
        if KEPT_NAMES.contains(&&*text) {
            return;
        }
        let words = words_of(&text);
        if words.iter().any(|word| PRIVATE_WORDS.contains(&&**word)) {
            let line = name.span().start().line;
            self.names.push(format!("{}:{line}: {text}", self.path));
        }
    }
}

/// The lower-case words of a name in either case style.
fn words_of(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    for c in name.chars() {
        if c == '_' || c.is_uppercase() {
            words.push(String::new());
        }
        if c != '_'
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
    }
    words
}

impl<'a> Visit<'a> for PrivateWords {
    fn visit_item(&mut self, item: &'a syn::Item) {
        if let syn::Item::Mod(it) = item
            && it.attrs.iter().any(is_for_tests)
        {
            return;
        }
        if let Some((_, name, _)) = type_of(item) {
            self.check(name);
        }
        visit::visit_item(self, item);
    }

    fn visit_signature(&mut self, it: &'a syn::Signature) {
        self.check(&it.ident);
        visit::visit_signature(self, it);
    }

    fn visit_field(&mut self, it: &'a syn::Field) {
        if let Some(name) = &it.ident {
            self.check(name);
        }
        visit::visit_field(self, it);
    }

    fn visit_variant(&mut self, it: &'a syn::Variant) {
        self.check(&it.ident);
        visit::visit_variant(self, it);
    }

    fn visit_pat_ident(&mut self, it: &'a syn::PatIdent) {
        self.check(&it.ident);
        visit::visit_pat_ident(self, it);
    }
}
