//! What pages name in code exists: functions, files, worlds, verbs and flags.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use std::sync::LazyLock;

use syn::visit::{self, Visit};

use super::files::{below, read, root};
use super::pages::{is_published, pages};
use super::sources::{Names, Sources, words};
use super::{library, texts};

/// Pages that map ideas to sources: each of their words of code is looked up.
const MAPS: [&str; 2] = ["docs/background/paper.md", "ARCHITECTURE.md"];

/// Words of other programs in those, and of this package's manifests.
const FOREIGN: [&str; 3] = ["PR_SET_PDEATHSIG", "dist", "python"];

/// Directories of the repository whose files pages name.
const DIRECTORIES: [&str; 9] = [
    "assets/",
    "benches/",
    "crates/",
    "docs/",
    "examples/",
    "python/",
    "src/",
    "tests/",
    "worlds/",
];

/// Spans of code in running text.
fn spans(text: &str) -> Vec<&str> {
    let outside = text.split("```").step_by(2);
    let spans = outside.flat_map(|part| part.split('`').skip(1).step_by(2));
    spans.collect()
}

/// Lines of blocks of code.
fn block_lines(text: &str) -> Vec<&str> {
    let blocks = text.split("```").skip(1).step_by(2);
    blocks.flat_map(str::lines).map(str::trim).collect()
}

/// `a::{b, c}` is `a::b` and `a::c`.
fn spread(span: &str) -> Vec<String> {
    let Some((head, rest)) = span.split_once('{') else {
        return vec![span.to_owned()];
    };
    let Some((each, tail)) = rest.split_once('}') else {
        return vec![span.to_owned()];
    };
    let each = each.split(',').map(str::trim);
    each.map(|name| format!("{head}{name}{tail}")).collect()
}

fn is_word(text: &str) -> bool {
    let mut letters = text.chars();
    letters
        .next()
        .is_some_and(|c| c.is_alphabetic() || c == '_')
        && letters.all(|c| c.is_alphanumeric() || c == '_')
}

/// What types have: fields, variants, functions and constants, by their name.
#[derive(Default)]
struct Members {
    of: BTreeMap<String, BTreeSet<String>>,
    /// The type whose `impl` is read.
    within: Option<String>,
    /// Words in the macros of a file, any of which may be a member of another.
    in_macros: BTreeSet<String>,
}

impl Members {
    fn read(texts: &[(String, String)]) -> Members {
        let mut members = Members::default();
        for (_, text) in texts {
            members.visit_file(&syn::parse_file(text).expect("a source file"));
            let words = std::mem::take(&mut members.in_macros);
            for name in words
                .iter()
                .filter(|word| word.starts_with(char::is_uppercase))
            {
                let known = members.of.entry(name.clone()).or_default();
                known.extend(words.iter().cloned());
            }
        }
        members
    }

    fn add<'n>(&mut self, of: &impl ToString, names: impl Iterator<Item = &'n proc_macro2::Ident>) {
        let known = self.of.entry(of.to_string()).or_default();
        known.extend(names.map(ToString::to_string));
    }

    fn has(&self, of: &str, member: &str) -> bool {
        self.of.get(of).is_some_and(|known| known.contains(member))
    }
}

impl<'a> Visit<'a> for Members {
    fn visit_item_struct(&mut self, it: &'a syn::ItemStruct) {
        let fields = it.fields.iter().filter_map(|field| field.ident.as_ref());
        self.add(&it.ident, fields);
    }

    fn visit_item_enum(&mut self, it: &'a syn::ItemEnum) {
        self.add(&it.ident, it.variants.iter().map(|variant| &variant.ident));
    }

    fn visit_item_trait(&mut self, it: &'a syn::ItemTrait) {
        let named = |item: &'a syn::TraitItem| match item {
            syn::TraitItem::Fn(it) => Some(&it.sig.ident),
            syn::TraitItem::Const(it) => Some(&it.ident),
            _ => None,
        };
        self.add(&it.ident, it.items.iter().filter_map(named));
    }

    fn visit_item_impl(&mut self, it: &'a syn::ItemImpl) {
        if let syn::Type::Path(of) = &*it.self_ty {
            self.within = of.path.segments.last().map(|last| last.ident.to_string());
        }
        visit::visit_item_impl(self, it);
        self.within = None;
    }

    fn visit_impl_item(&mut self, it: &'a syn::ImplItem) {
        let name = match it {
            syn::ImplItem::Fn(it) => &it.sig.ident,
            syn::ImplItem::Const(it) => &it.ident,
            _ => return,
        };
        if let Some(of) = self.within.clone() {
            self.add(&of, std::iter::once(name));
        }
    }

    fn visit_item_macro(&mut self, it: &'a syn::ItemMacro) {
        self.in_macros.extend(words(it.mac.tokens.clone()));
    }
}

/// The sources as pages name them.
struct Index<'a> {
    sources: &'a Sources,
    members: Members,
}

impl Index<'_> {
    /// Whether `room::file::item` or `Type::member` exists.
    fn has(&self, path: &str) -> bool {
        let path: Names = path.split("::").map(str::to_owned).collect();
        let first = &path[0];
        if first.starts_with(char::is_uppercase) {
            return self.has_members(&path);
        }
        let leads = |path: &[String]| {
            let item = self.sources.item(path);
            let exists = item.is_some_and(|item| item.len() < 2 || self.has_members(&item));
            exists || self.sources.is_for_tests(path)
        };
        let from = |root: &str| [&[root.to_owned()], &path[..]].concat();
        let rooms = [from("brakecheck"), from("brakecheck_stl")];
        if let Some(room) = rooms
            .iter()
            .find(|room| self.sources.item(&room[..2]).is_some())
        {
            return leads(room);
        }
        // `surrogate::model_fit`, on a page that has said of which room.
        let mut modules = self.sources.modules_called(first);
        leads(&path) || modules.any(|module| leads(&[module, &path[1..]].concat()))
    }

    /// `Type::member`; what a variant has is not looked up.
    fn has_members(&self, path: &[String]) -> bool {
        self.members.has(&path[0], &path[1])
    }
}

/// What is wrong with the code in a page: each name of something that is not there.
fn wrong_names(text: &str, index: &Index) -> Vec<String> {
    let spans = spans(text).into_iter().flat_map(spread);
    let is_path = |span: &String| span.contains("::") && span.split("::").all(is_word);
    let paths = spans.filter(is_path);
    paths.filter(|path| !index.has(path)).collect()
}

/// Files of the repository that spans and commands name.
fn wrong_files(text: &str) -> Vec<String> {
    let is_file = |word: &String| {
        let inside = DIRECTORIES
            .iter()
            .any(|directory| word.starts_with(directory));
        inside && !word.contains(['*', '<', '…', '(', '='])
    };
    let spans = spans(text).into_iter().filter(|span| !span.contains(' '));
    let commands = commands(text);
    let words = commands
        .iter()
        .flat_map(|command| command.split_whitespace());
    let files = spans.chain(words).flat_map(spread).filter(is_file);
    files.filter(|file| !root().join(file).exists()).collect()
}

/// Verbs, with what each takes: flags, and words in the place of arguments.
struct Program {
    verbs: BTreeMap<String, BTreeSet<String>>,
}

impl Program {
    fn ask() -> Program {
        let mut verbs = BTreeMap::new();
        for verb in listed(&help(&[])) {
            let text = help(&[&verb]);
            let mut takes = taken(&text);
            for below in listed(&text) {
                takes.extend(taken(&help(&[&verb, &below])));
                takes.insert(below);
            }
            verbs.insert(verb, takes);
        }
        Program { verbs }
    }

    /// What is wrong with a command, without the program's name.
    fn wrong(&self, command: &str) -> Option<String> {
        let mut words = command.split_whitespace();
        let verb = words.next()?;
        let Some(takes) = self.verbs.get(verb) else {
            return (verb.chars().all(char::is_lowercase)).then(|| format!("no verb `{verb}`"));
        };
        let words: Vec<&str> = words
            .take_while(|word| !["--", "#", "|"].contains(word))
            .collect();
        if let Some(what) = words.first()
            && ["campaign", "reference"].contains(&verb)
            && what.starts_with(char::is_lowercase)
            && !takes.contains(*what)
        {
            return Some(format!("no `{verb} {what}`"));
        }
        let flags = words.iter().filter(|word| word.starts_with("--"));
        let name = |flag: &str| -> String {
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-';
            flag.chars().take_while(|c| is_name(*c)).collect()
        };
        let mut flags = flags.map(|flag| name(flag));
        let unknown = flags.find(|flag| {
            !["--help", "--help-all", "--version"].contains(&&**flag) && !takes.contains(flag)
        });
        unknown.map(|flag| format!("`{verb}` takes no `{flag}`"))
    }
}

fn help(words: &[&str]) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_brakecheck"));
    let output = program
        .args(words)
        .arg("--help-all")
        .output()
        .expect("the program");
    String::from_utf8(output.stdout).expect("text")
}

/// The commands that a help text lists.
fn listed(help: &str) -> Vec<String> {
    let (_, below) = help.split_once("\nUsage:").unwrap_or_default();
    let is_end = |line: &&str| ["Arguments:", "Options:"].contains(line);
    let lines = below.lines().take_while(|line| !is_end(line));
    let names = lines.filter_map(|line| line.strip_prefix("  "));
    let names = names.filter(|name| name.starts_with(char::is_alphabetic));
    let names = names.filter_map(|name| name.split(' ').next());
    names.map(str::to_owned).collect()
}

/// Flags and possible values of a help text.
fn taken(help: &str) -> BTreeSet<String> {
    let mut taken = BTreeSet::new();
    for line in help.lines().map(str::trim_start) {
        if let Some(value) = line.strip_prefix("- ") {
            taken.extend(value.split(':').next().map(str::to_owned));
        } else if line.starts_with('-') {
            let words = line
                .split([' ', ',', '['])
                .filter(|word| word.starts_with("--"));
            taken.extend(words.map(str::to_owned));
        }
    }
    taken
}

fn program() -> &'static Program {
    static PROGRAM: LazyLock<Program> = LazyLock::new(Program::ask);
    &PROGRAM
}

/// Commands of a page: after the program's name, or spans of a verb with flags.
fn commands(text: &str) -> Vec<String> {
    let mut commands = Vec::new();
    for line in block_lines(text).into_iter().chain(spans(text)) {
        let starts = [
            "brakecheck ",
            "$B ",
            "target/release/brakecheck ",
            "cargo run --release -- ",
        ];
        let named = starts.iter().find_map(|start| line.strip_prefix(start));
        let first = line.split_whitespace().next().unwrap_or("");
        let bare = line.contains(" --") && program().verbs.contains_key(first);
        match named {
            Some(command) => commands.push(command.to_owned()),
            None if bare => commands.push(line.to_owned()),
            None => {}
        }
    }
    commands
}

fn wrong_commands(text: &str) -> Vec<String> {
    let commands = commands(text);
    let wrong = commands
        .iter()
        .filter_map(|command| program().wrong(command));
    wrong.collect()
}

/// Every word of the sources and of the worlds' files, and the names of worlds and crates.
fn known_words() -> BTreeSet<String> {
    let mut known = BTreeSet::new();
    let crates = std::fs::read_dir(root().join("crates")).expect("readable");
    known.extend(
        crates
            .flatten()
            .map(|it| it.file_name().to_string_lossy().into_owned()),
    );
    let mut texts: Vec<String> = texts().into_iter().map(|(_, text)| text).collect();
    for world in below(&root().join("worlds"), "ron") {
        known.extend(
            world
                .file_stem()
                .map(|name| name.to_string_lossy().into_owned()),
        );
        texts.push(read(&world));
    }
    for text in &texts {
        let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        known.extend(words.map(str::to_owned));
    }
    known.extend(program().verbs.keys().cloned());
    known.extend(program().verbs.values().flatten().cloned());
    known
}

/// Lonely words of code that no source and no world knows.
fn wrong_words(text: &str, known: &BTreeSet<String>) -> Vec<String> {
    let words = spans(text).into_iter().filter(|span| is_word(span));
    let unknown = words.filter(|word| !known.contains(*word) && !FOREIGN.contains(word));
    unknown.map(str::to_owned).collect()
}

fn library_index() -> Index<'static> {
    Index {
        sources: library(),
        members: Members::read(&texts()),
    }
}

#[test]
fn what_pages_name_in_code_exists() {
    if is_published() {
        return;
    }
    let index = library_index();
    let known = known_words();
    let mut wrong = Vec::new();
    let mut seen = 0;
    for page in pages() {
        let name = page
            .strip_prefix(root())
            .expect("below")
            .display()
            .to_string();
        if name == "CHANGELOG.md" {
            continue;
        }
        let text = read(&page);
        seen += spans(&text).len();
        let mut found = wrong_names(&text, &index);
        found.extend(wrong_commands(&text));
        found.extend(wrong_files(&text));
        if MAPS.contains(&&*name) {
            found.extend(wrong_words(&text, &known));
        }
        wrong.extend(found.into_iter().map(|found| format!("{name}: {found}")));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(seen > 1000, "{seen} spans of code");
}

#[test]
fn a_name_of_nothing_is_seen() {
    let texts: Vec<(String, String)> = [
        (
            "src/lib.rs",
            "pub mod campaign; mod studies; pub use brakecheck_stl as stl;",
        ),
        (
            "src/campaign/mod.rs",
            "mod search; pub use search::{Method, search};",
        ),
        (
            "src/campaign/search.rs",
            "pub enum Method { Cem } pub fn search() {} methods! { pub struct Hold { held } }",
        ),
        (
            "src/studies/mod.rs",
            "mod milestones; pub trait Told { fn told(&self); } impl Row { fn mean(&self) {} }",
        ),
        ("src/studies/milestones.rs", "pub fn milestones() {}"),
        ("crates/stl/src/lib.rs", "pub struct Monitor { rows: u8 }"),
    ]
    .map(|(path, text)| (path.to_owned(), text.to_owned()))
    .into();
    let index = Index {
        sources: &Sources::read(&texts),
        members: Members::read(&texts),
    };
    let page = |span: &str| format!("A line with `{span}` in it.");
    for right in [
        "campaign::search",
        "campaign::{Method, search}",
        "campaign::Method::Cem",
        "campaign::search::Hold::held",
        "Method::Cem",
        "Row::mean",
        "stl::Monitor::rows",
        "brakecheck::studies::Told::told",
        "studies::milestones",
        "milestones::milestones",
    ] {
        let wrong = wrong_names(&page(right), &index);
        assert!(wrong.is_empty(), "{wrong:?}");
    }
    for wrong in [
        "campaign::milestones",
        "campaign::{search, milestones}",
        "campaign::Method::Uniform",
        "campaign::search::search::deeper::still",
        "campaign::search::Hold::longer",
        "Method::Uniform",
        "Row::median",
        "Elsewhere::mean",
        "stl::Formula",
        "brakecheck::milestones",
        "milestones::search",
    ] {
        assert_eq!(wrong_names(&page(wrong), &index).len(), 1, "{wrong}");
    }
}

#[test]
fn a_file_a_verb_and_a_flag_of_nothing_are_seen() {
    for (right, wrong) in [
        ("`worlds/acc.ron`", "`worlds/acc_paved.ron`"),
        ("`docs/guide`", "`docs/guides`"),
        ("`src/{lib,main}.rs`", "`src/{lib,mean}.rs`"),
        ("`tests/grid/theorems.rs`", "`tests/grid/lemmas.rs`"),
        (
            "`brakecheck check worlds/acc.ron`",
            "`brakecheck check worlds/ac.ron`",
        ),
    ] {
        assert!(wrong_files(right).is_empty(), "{right}");
        assert_eq!(wrong_files(wrong).len(), 1, "{wrong}");
    }
    for (right, wrong) in [
        (
            "`brakecheck eval RUN --theorems`",
            "`brakecheck eval RUN --theorem`",
        ),
        (
            "`eval RUN --ego E --runs 100`",
            "`eval RUN --ego E --run 100`",
        ),
        (
            "`brakecheck replay FILE --expect recorded`",
            "`brakecheck reproduce table1`",
        ),
        (
            "```sh\n$B train acc -o x\n```",
            "```sh\n$B learn acc -o x\n```",
        ),
        (
            "`brakecheck campaign plan C.ron --dry-run`",
            "`brakecheck campaign play C.ron`",
        ),
        (
            "`brakecheck reference signals`",
            "`brakecheck reference units`",
        ),
        (
            "`brakecheck eval X -- python3 e.py --fast`",
            "`brakecheck eval X --fast -- python3`",
        ),
    ] {
        assert_eq!(wrong_commands(right), [""; 0], "{right}");
        assert_eq!(wrong_commands(wrong).len(), 1, "{wrong}");
    }
    let known = known_words();
    assert!(wrong_words("`merge_fair` and `YellowLight`", &known).is_empty());
    assert_eq!(
        wrong_words("`merge_unfair` and `BlueLight`", &known).len(),
        2
    );
}
