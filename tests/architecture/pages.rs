//! The pages of documentation: short enough to be read, and no link into nothing.

use std::path::{Path, PathBuf};

/// A page that a user reads in one sitting.
const MOST_WORDS: usize = 2000;

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn is_published() -> bool {
    root().join("Cargo.toml.orig").exists()
}

pub fn read(page: &Path) -> String {
    std::fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// Everything with this ending in a directory and below.
pub fn below(directory: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(directory).expect("a directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(below(&path, ending));
        } else if path.extension().is_some_and(|it| it == ending) {
            found.push(path);
        }
    }
    found.sort();
    found
}

pub fn pages() -> Vec<PathBuf> {
    let mut pages = below(&root().join("docs"), "md");
    let mut beside = vec!["README.md", "CHANGELOG.md", "ARCHITECTURE.md"];
    if !is_published() {
        beside.extend(["crates/repro/README.md", "crates/stl/README.md"]);
        pages.extend(below(&root().join("crates/stl/docs"), "md"));
    }
    pages.extend(beside.into_iter().map(|name| root().join(name)));
    pages
}

/// The text without blocks and spans of code.
fn prose(text: &str) -> String {
    let outside = text.split("```").step_by(2).collect::<Vec<_>>().concat();
    outside.split('`').step_by(2).collect()
}

/// What `[…](…)` leads to on other pages and on this one.
fn links(text: &str) -> Vec<String> {
    let targets = prose(text);
    let targets = targets.split("](").skip(1);
    let targets = targets.map(|rest| rest.split([')', ' ']).next().unwrap_or(""));
    let here = targets.filter(|target| !target.contains("://"));
    here.map(str::to_owned).collect()
}

/// The anchors that headings get: lower case, blanks as hyphens, few signs.
fn anchors(text: &str) -> Vec<String> {
    let outside = text.split("```").step_by(2).collect::<Vec<_>>().concat();
    let headings = outside.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| -> String {
        let kept = line.trim_start_matches('#').trim().to_lowercase();
        let kept = kept.replace(' ', "-");
        let is_kept = |c: &char| c.is_alphanumeric() || "-_".contains(*c);
        kept.chars().filter(is_kept).collect()
    };
    headings.map(anchor).collect()
}

/// What is wrong with a link of a page, if anything is.
fn broken(page: &Path, link: &str) -> Option<String> {
    let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
    if is_published() && file.trim_start_matches("../").starts_with("crates/") {
        return None;
    }
    let target = match file {
        "" => page.to_owned(),
        _ => page.parent()?.join(file),
    };
    let leads = target.exists()
        && (anchor.is_empty() || anchors(&read(&target)).contains(&anchor.to_owned()));
    (!leads).then(|| format!("{}: {link}", page.display()))
}

#[test]
fn every_link_leads_somewhere() {
    let mut seen = 0;
    let mut wrong = Vec::new();
    for page in pages() {
        let links = links(&read(&page));
        seen += links.len();
        wrong.extend(links.iter().filter_map(|link| broken(&page, link)));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(100 < seen, "{seen} links");
}

/// Sources, messages and pages name pages as `docs/….md` without a link.
#[test]
fn every_page_that_is_named_exists() {
    let mut directories = vec!["src", "tests", "examples", "docs"];
    if !is_published() {
        directories.push("crates/repro");
    }
    let mut files = pages();
    for directory in directories {
        files.extend(below(&root().join(directory), "rs"));
    }
    let is_name = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let mut seen = 0;
    let mut wrong = Vec::new();
    for file in files {
        let text = read(&file);
        for rest in text.split("docs/").skip(1) {
            let end = rest.find(|c| !is_name(c)).unwrap_or(rest.len());
            let Some((stem, _)) = rest[..end].rsplit_once(".md") else {
                continue;
            };
            let page = format!("docs/{stem}.md");
            seen += 1;
            if !stem.is_empty() && !stem.contains("*") && !root().join(&page).exists() {
                wrong.push(format!("{}: {page}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(100 < seen, "{seen} names");
}

#[test]
fn a_guide_is_read_in_one_sitting() {
    let index = read(&root().join("docs/README.md"));
    let (_, guides) = index.split_once("## To use it").expect("the guides");
    let (guides, _) = guides.split_once("\n## ").expect("their end");
    let guides = links(guides);
    assert!(10 < guides.len(), "{guides:?}");
    for guide in guides {
        let words = read(&root().join("docs").join(&guide))
            .split_whitespace()
            .count();
        assert!(
            words <= MOST_WORDS,
            "docs/{guide} has {words} words: split it by what a reader looks for"
        );
    }
}

#[test]
fn the_index_and_the_site_have_every_page() {
    let docs = root().join("docs");
    for list in ["README.md", "SUMMARY.md"] {
        let listed = links(&read(&docs.join(list)));
        for page in below(&docs, "md") {
            let name = page
                .strip_prefix(&docs)
                .expect("below")
                .display()
                .to_string();
            assert!(
                ["README.md", "SUMMARY.md"].contains(&name.as_str()) || listed.contains(&name),
                "docs/{list} lacks {name}"
            );
        }
    }
}

#[test]
fn the_readme_is_read_at_once() {
    let lines = read(&root().join("README.md")).lines().count();
    assert!(
        lines <= 150,
        "README.md has {lines} lines: tables belong to docs/"
    );
}
