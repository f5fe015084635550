//! Figures of the prose: words a page, forms of address, sentences, comments.
//!
//! The targets come from projects that are easy to read. A figure that misses
//! its target names a text to rewrite, never a word to replace.

mod files;

use std::process::Command;

use files::{below, read, root};

/// Most words of a page that describes a task.
const GUIDE_WORDS: usize = 900;
/// Most words of README.md and of all pages under `docs/`, blocks and tables included.
const DOCS_WORDS: usize = 40_000;
const README_LINES: usize = 135;
/// Largest share of doc comments that open with a question word.
const QUESTION_SHARE: f64 = 0.05;
/// Least number of plain comments per line of code.
const COMMENT_SHARE: f64 = 0.05;

const OPENINGS: [&str; 9] = [
    "What", "Who", "Whoever", "Of", "Where", "How", "Whether", "So", "As",
];
const QUESTIONS: [&str; 10] = [
    "What", "Who", "Whose", "Whom", "Whether", "How", "Where", "When", "Which", "Why",
];
/// Words before `one` that make a pronoun of it.
const BEFORE_ONE: [&str; 9] = [
    "that", "this", "the", "a", "an", "which", "such", "other", "another",
];

/// Target of texts that lead through a task. Reference texts state facts.
const ADDRESS: &str = "you: 5 or more";

/// Counts of one text. Frequencies are per 1,000 words.
#[derive(Debug)]
struct Figures {
    you: f64,
    semicolons: f64,
    somebody: f64,
    tell: f64,
    what: f64,
    pronoun_one: f64,
    words_per_sentence: f64,
    /// Percentage of sentences that open with one of [`OPENINGS`].
    openings: f64,
}

impl Figures {
    fn of(markdown: &str) -> Figures {
        let text = prose(markdown);
        let words = words(&text);
        let tokens = tokens(&text);
        let per_mille = |count: usize| 1000.0 * count as f64 / words.max(1) as f64;
        let any = |forms: &[&str]| {
            let found = tokens.iter().filter(|(_, word)| forms.contains(&&**word));
            per_mille(found.count())
        };
        let lengths = |s: &&str| s.split_whitespace().count();
        let sentences: Vec<&str> = sentences(&text)
            .into_iter()
            .filter(|s| lengths(s) > 3)
            .collect();
        let all = sentences.len().max(1) as f64;
        let opening = sentences.iter().filter(|s| opens_with(s, &OPENINGS));
        Figures {
            you: any(&["you", "your", "yours"]),
            semicolons: per_mille(text.matches(';').count()),
            somebody: any(&["somebody", "nobody", "everybody", "whoever", "whom"]),
            tell: any(&["tell", "tells", "told", "telling"]),
            what: any(&["what"]),
            pronoun_one: per_mille(pronoun_ones(&text, &tokens)),
            words_per_sentence: sentences.iter().map(lengths).sum::<usize>() as f64 / all,
            openings: 100.0 * opening.count() as f64 / all,
        }
    }

    /// Returns the figures that miss their targets.
    fn missed(&self) -> Vec<&'static str> {
        let targets = [
            (ADDRESS, self.you >= 5.0),
            ("semicolons: 4 or fewer", self.semicolons <= 4.0),
            ("somebody, nobody, whoever: 0.1", self.somebody <= 0.1),
            ("tell, told: 0.3", self.tell <= 0.3),
            ("what: 2", self.what <= 2.0),
            ("the pronoun one: 0.4", self.pronoun_one <= 0.4),
            ("words a sentence: 20", self.words_per_sentence <= 20.0),
            ("openings: 4 %", self.openings <= 4.0),
        ];
        let missed = targets.into_iter().filter(|(_, met)| !met);
        missed.map(|(target, _)| target).collect()
    }
}

/// Running text: no blocks, no tables, `CODE` for spans, links by their words.
fn prose(markdown: &str) -> String {
    let text = markdown.split("```").step_by(2).collect::<Vec<_>>();
    let is_row = |line: &&str| {
        let line = line.trim();
        line.len() > 1 && line.starts_with('|') && line.ends_with('|')
    };
    let text = text.join(" ");
    let lines: Vec<&str> = text.lines().filter(|line| !is_row(line)).collect();
    let text = lines.join("\n");
    let parts = text
        .split('`')
        .enumerate()
        .map(|(n, part)| if n % 2 == 0 { part } else { "CODE" });
    let text = parts.collect::<String>();
    let mut rest = text.as_str();
    let mut out = String::new();
    // A link ends in `](…)`, of which only the words in front are read.
    while let Some((before, after)) = rest.split_once("](") {
        out.push_str(before);
        rest = after.split_once(')').map_or("", |(_, rest)| rest);
    }
    out + rest
}

/// Words of letters, with apostrophes and hyphens inside.
fn words(text: &str) -> usize {
    let is_letter = |c: char| c.is_ascii_alphabetic();
    let is_part = |c: char| is_letter(c) || "'’-".contains(c);
    let runs = text.split(|c| !is_part(c));
    runs.filter(|run| run.contains(is_letter)).count()
}

/// Lower-case words of letters, digits and underscores, with their places.
fn tokens(text: &str) -> Vec<(usize, String)> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut tokens = Vec::new();
    let mut at = 0;
    for run in text.split(|c| !is_part(c)) {
        if !run.is_empty() {
            tokens.push((at, run.to_lowercase()));
        }
        let separator = text[at + run.len()..].chars().next();
        at += run.len() + separator.map_or(0, char::len_utf8);
    }
    tokens
}

fn pronoun_ones(text: &str, tokens: &[(usize, String)]) -> usize {
    let ones = tokens.iter().filter(|(_, word)| word == "ones").count();
    let is_pronoun = |pair: &&[(usize, String)]| {
        let (first, second) = (&pair[0], &pair[1]);
        let word = BEFORE_ONE.contains(&&*first.1) && second.1 == "one";
        word && text[first.0..second.0].trim_start_matches(char::is_alphanumeric) == " "
    };
    ones + tokens.windows(2).filter(is_pronoun).count()
}

/// Stretches that end in a full stop or another mark before white space.
fn sentences(text: &str) -> Vec<&str> {
    let mut sentences = Vec::new();
    let mut from = 0;
    let mut before = ' ';
    for (at, c) in text.char_indices() {
        if c.is_whitespace() && ".!?".contains(before) {
            sentences.push(&text[from..at]);
            from = at;
        }
        before = c;
    }
    sentences.push(&text[from..]);
    sentences
}

fn opens_with(sentence: &str, openings: &[&str]) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let start = sentence.trim_start_matches(|c| !is_part(c));
    let end = start.find(|c| !is_part(c)).unwrap_or(start.len());
    openings.contains(&&start[..end])
}

/// Counts of the comments of some sources.
#[derive(Debug, Default)]
struct Comments {
    docs: usize,
    questions: usize,
    plain: usize,
    code: usize,
}

impl Comments {
    fn count(&mut self, source: &str) {
        let is_doc = |line: &str| line.starts_with("///") || line.starts_with("//!");
        let mut follows_doc = false;
        for line in source.lines().map(str::trim) {
            if is_doc(line) && !follows_doc {
                self.docs += 1;
                self.questions += usize::from(opens_with(&line[3..], &QUESTIONS));
            }
            self.plain += usize::from(!is_doc(line) && line.starts_with("//"));
            self.code += usize::from(!line.is_empty() && !line.starts_with("//"));
            follows_doc = is_doc(line);
        }
    }
}

#[test]
fn a_task_is_described_on_a_short_page() {
    let pages = below(&root().join("docs/guide"), "md");
    assert!(pages.len() > 10, "{pages:?}");
    for page in pages {
        let words = words(&prose(&read(&page)));
        assert!(words <= GUIDE_WORDS, "{}: {words} words", page.display());
    }
    let lines = read(&root().join("README.md")).lines().count();
    assert!(lines <= README_LINES, "README.md has {lines} lines");
}

#[test]
fn pages_read_like_those_of_projects_that_are_easy_to_read() {
    let mut pages = below(&root().join("docs"), "md");
    // A list of links is no prose.
    pages.retain(|page| !page.ends_with("SUMMARY.md"));
    let docs: Vec<String> = pages.iter().map(|page| read(page)).collect();
    let docs = docs.join("\n");
    let one = |name: &str| read(&root().join(name));
    for (name, text) in [
        ("docs", docs.clone()),
        ("README.md", one("README.md")),
        ("ARCHITECTURE.md", one("ARCHITECTURE.md")),
    ] {
        let figures = Figures::of(&text);
        let missed = figures.missed();
        assert!(missed.is_empty(), "{name}: {missed:?} of {figures:#?}");
    }
    pages.push(root().join("docs/SUMMARY.md"));
    pages.push(root().join("README.md"));
    let words = pages
        .iter()
        .map(|page| read(page).split_whitespace().count());
    let words: usize = words.sum();
    assert!(words <= DOCS_WORDS, "README.md and docs: {words} words");
}

/// Returns the docstrings of a Python source, and its comments that begin with `#:`.
fn docstrings(source: &str) -> String {
    let parts: Vec<&str> = source.split("\"\"\"").collect();
    // Texts are between the marks, each with the code before it.
    let strings = parts.windows(2).step_by(2);
    let opens = |before: &str| {
        let line = before.rsplit('\n').next().unwrap_or_default();
        ["", "r"].contains(&line.trim())
    };
    let strings = strings.filter(|pair| opens(pair[0])).map(|pair| pair[1]);
    let lines = source.lines().map(str::trim_start);
    let comments = lines.filter_map(|line| line.strip_prefix("#:"));
    // Code is between two backticks there.
    strings
        .chain(comments)
        .collect::<Vec<_>>()
        .join("\n\n")
        .replace("``", "`")
}

/// Returns the doc comments of a Rust source.
fn doc_comments(source: &str) -> String {
    let lines = source.lines().map(str::trim_start);
    let lines = lines.map(|line| line.strip_prefix("///").unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// Returns the texts of all commands and tables that the program prints.
fn printed() -> String {
    let reference = |words: &[&str]| -> serde_json::Value {
        let mut program = Command::new(env!("CARGO_BIN_EXE_brakecheck"));
        let output = program.arg("reference").args(words).arg("--json").output();
        serde_json::from_slice(&output.expect("it runs").stdout).expect("JSON")
    };
    let topics = reference(&[]);
    let topics = topics["tables"][0]["rows"].as_array().expect("topics");
    let topics = topics.iter().filter_map(|it| it["topic"].as_str());
    let pages: Vec<_> = topics
        .map(|it| reference(&[it.trim_matches('`')]))
        .collect();
    assert!(pages.len() >= 5, "{pages:?}");
    let mut texts = Vec::new();
    for page in &pages {
        texts.push(page["about"].as_str());
        for table in page["tables"].as_array().expect("tables") {
            texts.push(table["about"].as_str());
            for row in table["rows"].as_array().expect("rows") {
                texts.extend(["effect", "meaning"].map(|column| row[column].as_str()));
            }
        }
    }
    // Cells end without a full stop.
    let texts = texts.into_iter().flatten().filter(|it| !it.is_empty());
    let texts = texts.map(|it| format!("{}.", it.trim_end_matches('.')));
    texts.collect::<Vec<_>>().join("\n\n")
}

#[test]
fn texts_of_code_and_commands_read_like_the_pages() {
    let joined = |directory: &str, ending: &str, part: &dyn Fn(&str) -> String| {
        let directory = root().join(directory);
        // A published package lacks some.
        let files = if directory.is_dir() {
            below(&directory, ending)
        } else {
            Vec::new()
        };
        let texts: Vec<String> = files.iter().map(|file| part(&read(file))).collect();
        texts.join("\n\n")
    };
    let python = [("py", "python"), ("pyi", "python")].map(|(it, at)| joined(at, it, &docstrings));
    let python = format!(
        "{}\n\n{}",
        python.join("\n\n"),
        joined("python/src", "rs", &doc_comments)
    );
    let pages = ["examples", "crates", "python"].map(|it| joined(it, "md", &str::to_owned));
    for (name, text, is_reference) in [
        ("docstrings", python, false),
        ("`brakecheck reference`", printed(), true),
        ("README files", pages.join("\n\n"), false),
    ] {
        if text.trim().is_empty() {
            continue;
        }
        let figures = Figures::of(&text);
        let mut missed = figures.missed();
        missed.retain(|it| !is_reference || *it != ADDRESS);
        assert!(missed.is_empty(), "{name}: {missed:?} of {figures:#?}");
    }
}

#[test]
fn comments_state_nouns_and_reasons() {
    let mut comments = Comments::default();
    // A published package has no `crates`.
    let directories = ["src", "crates"].map(|it| root().join(it));
    for directory in directories.iter().filter(|it| it.is_dir()) {
        for file in below(directory, "rs") {
            comments.count(&read(&file));
        }
    }
    let questions = comments.questions as f64 / comments.docs as f64;
    assert!(questions <= QUESTION_SHARE, "{comments:?}");
    let share = comments.plain as f64 / comments.code as f64;
    assert!(share >= COMMENT_SHARE, "{comments:?}");
}

#[test]
fn planted_text_misses_its_targets() {
    let good = "You run the test, and you read your table. ";
    let missed = |planted: &str| Figures::of(&format!("{good}{planted}")).missed().len();
    assert_eq!(missed(""), 0);
    for planted in [
        "It runs; it ends.",
        "Somebody reads.",
        "He told it.",
        "Then what?",
        "Take the one.",
        "What it is you see.",
        &"word ".repeat(40),
    ] {
        assert!(missed(planted) > 0, "{planted}");
    }
    for kept in [
        "`told; what`",
        "\n| what | told; |\n",
        "```\nwhat;\n```",
        "[you](what;told)",
    ] {
        assert_eq!(missed(kept), 0, "{kept}");
    }
    let cold = "The test runs and the table has numbers.";
    assert_eq!(Figures::of(cold).missed(), [ADDRESS]);
    let source = "\"\"\"Module; text.\"\"\"\nTEXT = \"\"\"no; docs\"\"\"\n#: Field; a.\nx = 1\n";
    assert_eq!(docstrings(source), "Module; text.\n\n Field; a.");
    assert_eq!(
        doc_comments("    /// Returns it.\nfn f() {}"),
        " Returns it.\n"
    );
    let mut comments = Comments::default();
    comments.count("/// Whether it runs.\n/// What else.\nfn f() {}\n// Reason.\n\n//! State.");
    assert_eq!((comments.docs, comments.questions), (2, 1));
    assert_eq!((comments.plain, comments.code), (1, 1));
}
