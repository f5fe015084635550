//! Files that use each other in circles.

use std::collections::{BTreeMap, BTreeSet};

use super::sources::Sources;

/// Who uses whom below a directory, and which names.
type Arrows = BTreeMap<usize, BTreeMap<usize, BTreeSet<String>>>;

/// A use through a re-export counts as one of the file that defines it; the
/// `mod` and `pub use` lines of a file with modules below it do not count.
pub fn arrows(sources: &Sources, directory: &str) -> Arrows {
    let inside = |file: usize| sources.files[file].starts_with(directory);
    let mut arrows = Arrows::new();
    for mention in &sources.mentions {
        let Some((_, used)) = &mention.defined else {
            continue;
        };
        let counts = *used != mention.file && !mention.passes_on;
        if counts && inside(*used) && inside(mention.file) {
            let names = arrows.entry(mention.file).or_default().entry(*used);
            let name = mention.path.last().cloned().unwrap_or_default();
            names.or_default().insert(name);
        }
    }
    arrows
}

/// The sets of files below a directory each of which reaches all the others.
pub fn circles(sources: &Sources, directory: &str) -> Vec<Vec<usize>> {
    let arrows = arrows(sources, directory);
    let mut search = Search {
        arrows: &arrows,
        met: BTreeMap::new(),
        open: Vec::new(),
        found: Vec::new(),
    };
    for file in arrows.keys() {
        search.visit(*file);
    }
    search.found
}

/// Tarjan 1972: strongly connected components by one walk.
struct Search<'a> {
    arrows: &'a Arrows,
    /// When a file was met first, and the earliest open file it leads back to.
    met: BTreeMap<usize, (usize, usize)>,
    open: Vec<usize>,
    found: Vec<Vec<usize>>,
}

impl Search<'_> {
    /// Returns the earliest open file that `file` leads back to.
    fn visit(&mut self, file: usize) -> usize {
        if let Some((_, earliest)) = self.met.get(&file) {
            return *earliest;
        }
        let now = self.met.len();
        let mut earliest = now;
        self.met.insert(file, (now, now));
        self.open.push(file);
        for used in self.arrows.get(&file).into_iter().flat_map(BTreeMap::keys) {
            let back = self.visit(*used);
            if self.open.contains(used) {
                earliest = earliest.min(back);
            }
        }
        self.met.insert(file, (now, earliest));
        if earliest == now {
            let first = self.open.iter().position(|open| *open == file);
            let mut circle = self.open.split_off(first.unwrap_or(0));
            circle.sort_unstable();
            if circle.len() > 1 {
                self.found.push(circle);
            }
        }
        earliest
    }
}

/// The files of a circle, and what ties each to the others.
pub fn told(sources: &Sources, directory: &str, circle: &[usize]) -> String {
    let arrows = arrows(sources, directory);
    let mut text = String::new();
    for file in circle {
        let ties = arrows.get(file).into_iter().flatten();
        for (used, names) in ties.filter(|(used, _)| circle.contains(used)) {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let (file, used) = (&sources.files[*file], &sources.files[*used]);
            text += &format!("  {file} → {used}: {}\n", names.join(", "));
        }
    }
    text
}
