//! The pages of documentation: short enough to be read, and no link into nothing.

use std::path::{Path, PathBuf};

use super::files::{below, read, root};

/// Returns true in a published package, which lacks `python` and `crates`.
pub fn is_published() -> bool {
    root().join("Cargo.toml.orig").exists()
}

pub fn pages() -> Vec<PathBuf> {
    let mut pages = below(&root().join("docs"), "md");
    pages.extend(below(&root().join("crates/stl/docs"), "md"));
    let beside = [
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "ARCHITECTURE.md",
        "examples/egos/README.md",
        "crates/repro/README.md",
        "crates/stl/README.md",
        "crates/traffic/README.md",
        "python/README.md",
    ];
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
    if is_published() {
        return;
    }
    let mut seen = 0;
    let mut wrong = Vec::new();
    for page in pages() {
        let links = links(&read(&page));
        seen += links.len();
        wrong.extend(links.iter().filter_map(|link| broken(&page, link)));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(seen > 100, "{seen} links");
}

/// Pages under a directory that a text names without a link.
fn named<'a>(text: &'a str, directory: &'a str) -> impl Iterator<Item = String> + 'a {
    fn is_name(c: char) -> bool {
        c.is_ascii_alphanumeric() || "/._-".contains(c)
    }
    let places = text.match_indices(directory);
    let whole = places.filter(move |(at, _)| !text[..*at].ends_with(is_name));
    whole.filter_map(move |(at, _)| {
        let end = text[at..].find(|c| !is_name(c));
        let name = &text[at..end.map_or(text.len(), |end| at + end)];
        let (stem, _) = name.rsplit_once(".md")?;
        (stem.len() > directory.len()).then(|| format!("{stem}.md"))
    })
}

/// Sources, messages, worlds and pages name pages as `docs/….md` without a link.
#[test]
fn every_page_that_is_named_exists() {
    if is_published() {
        return;
    }
    let mut files = pages();
    for directory in ["src", "tests", "examples", "benches", "crates"] {
        files.extend(below(&root().join(directory), "rs"));
    }
    for directory in ["worlds", "examples"] {
        files.extend(below(&root().join(directory), "ron"));
    }
    let mut seen = 0;
    let mut wrong = Vec::new();
    for file in files {
        let text = read(&file);
        for page in named(&text, "docs/") {
            seen += 1;
            // A package of its own names its own pages.
            let own = file.parent().is_some_and(|own| own.join(&page).exists());
            if !own && !root().join(&page).exists() {
                wrong.push(format!("{}: {page}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    assert!(seen > 200, "{seen} names");
}

#[test]
fn a_page_that_is_named_without_a_link_is_seen() {
    let text =
        "as in docs/guide/worlds.md. (worlds/bend.md); ../docs/glossary.md, `docs/`, docs/*.md";
    let docs: Vec<String> = named(text, "docs/").collect();
    assert_eq!(docs, ["docs/guide/worlds.md"]);
    let worlds: Vec<String> = named(text, "worlds/").collect();
    assert_eq!(worlds, ["worlds/bend.md"]);
}

/// Pages of a directory that a list in it does not link to.
fn unlisted(directory: &Path, list: &str) -> Vec<String> {
    let listed = links(&read(&directory.join(list)));
    let names = below(directory, "md").into_iter().map(|page| {
        let name = page.strip_prefix(directory).expect("below");
        name.display().to_string()
    });
    let is_list = |name: &str| ["README.md", "SUMMARY.md"].contains(&name);
    names
        .filter(|name| !is_list(name) && !listed.contains(name))
        .collect()
}

#[test]
fn the_indexes_and_the_site_have_every_page() {
    if is_published() {
        return;
    }
    for (directory, list) in [("docs", "README.md"), ("docs", "SUMMARY.md")] {
        let missing = unlisted(&root().join(directory), list);
        assert!(missing.is_empty(), "{directory}/{list} lacks {missing:?}");
    }
}
