//! Coverage in words and tables.

use super::measure::{
    AXIS_BINS, CellCoverage, Coverage, CoverageState, PartCoverage, RuleCoverage,
};
use crate::report::TextTable;
use crate::run_dir::counted;

/// Most gaps in the verdict. The table has more.
const NAMED: usize = 3;

/// Meaning of the columns.
pub const COVERAGE_EXPLAINED: &str = "
rule          bounds an episode in which it is broken, in which another action of one ado would
              have broken it before the next decision; where that is unknown, in which its margin is
              within 5 % of the spread of its margins
part          of the ego's specification: decides a failure if its value is the robustness
cell          quarter of the range of a start axis × kind of failure
kind          deciding leaf, geometry of the contact and its agents
covered, of   occurrences, of the episodes (rule), failures (part) or tries (cell) that could show it;
              + stored failures, which cover a cell, but are no tries
never         at most 5 % of such episodes (one-sided 95 % bound); a cell: no chance, by an exact
              test with a 5 % risk of any false one
too few       none, and too few episodes for such a claim
not tried     no episode could show it
tries         episodes from drawn starts";

impl CoverageState {
    /// Returns the words of tables.
    pub fn words(self) -> &'static str {
        match self {
            CoverageState::Never => "never",
            CoverageState::Untried => "not tried",
            CoverageState::TooFew => "too few",
            CoverageState::Covered => "covered",
        }
    }
}

impl CellCoverage {
    /// Returns the bin of the axis in words.
    pub fn bin_in_words(&self) -> String {
        let [from, to] = self.range.map(short);
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", self.unit)
        };
        format!("`{}` {from}–{to}{unit}", self.axis)
    }
}

/// Number with three significant decimal places at most.
fn short(value: f64) -> String {
    let rounded = (value * 1000.0).round() / 1000.0;
    // Adding 0 turns −0 into 0.
    format!("{}", rounded + 0.0)
}

impl Coverage {
    /// Returns a kind of failure in words, its leaf only if it distinguishes kinds.
    pub fn kind_in_words(&self, kind: usize) -> String {
        let kind = &self.kinds[kind].kind;
        let first = self.kinds.first().map(|first| &first.kind.leaf);
        let words = kind.in_words();
        // What all of them share tells none apart.
        let is_one_leaf = self.kinds.iter().all(|one| Some(&one.kind.leaf) == first);
        // Without a contact the words have the leaf already.
        if is_one_leaf || kind.agents.is_none() {
            return words;
        }
        format!("{words}, `{}`", kind.leaf)
    }

    /// Returns what is never covered, in words: rules, parts, cells.
    ///
    /// A part within a part that never decides is not repeated.
    pub(super) fn gaps_in_words(&self) -> Vec<String> {
        let never = |state: CoverageState| state == CoverageState::Never;
        let rules = self
            .rules
            .iter()
            .filter(|rule| never(rule.state))
            .map(|it| format!("rule “{}” never bounds `{}`", it.rule, it.ado));
        // A part of a part that never decides goes without saying.
        let is_named = |part: &&PartCoverage| {
            let larger = part.within.map(|at| self.parts[at].state);
            never(part.state) && !larger.is_some_and(never)
        };
        let parts = self
            .parts
            .iter()
            .filter(is_named)
            .map(|it| format!("`{}` never decides a failure", it.part));
        let empty = self.cells.iter().filter(|cell| never(cell.state));
        let cells = empty.map(|cell| {
            let (kind, bin) = (self.kind_in_words(cell.kind), cell.bin_in_words());
            format!("no failure ({kind}) from {bin}")
        });
        rules.chain(parts).chain(cells).collect()
    }

    /// Returns the verdict in at most three lines.
    pub fn verdict(&self) -> Vec<String> {
        let world = &self.world;
        if self.is_empty() {
            return vec![format!("no result: no episode of `{world}` was evaluated")];
        }
        let named = self.gaps[..self.gaps.len().min(NAMED)].join("; ");
        let mut first = match (self.gaps.len(), self.open()) {
            (0, 0) => format!("`{world}`: no gap"),
            // An open question is no coverage.
            (0, open) => format!("`{world}`: no gap found, and {open} without an answer"),
            (1, _) => format!("`{world}`: 1 gap: {named}"),
            (some, _) => format!("`{world}`: {some} gaps: {named}"),
        };
        if self.gaps.len() > NAMED {
            first.push_str(&format!("; and {} more", self.gaps.len() - NAMED));
        }
        let open = self.open_in_words();
        [first, self.evidence_in_words()]
            .into_iter()
            .chain(open)
            .collect()
    }

    /// Returns the number of rules, parts and cells without an answer.
    fn open(&self) -> usize {
        let rules = self.rules.iter().map(|it| it.state);
        let parts = self.parts.iter().map(|it| it.state);
        let cells = self.cells.iter().map(|it| it.state);
        let is_open =
            |it: &CoverageState| matches!(it, CoverageState::TooFew | CoverageState::Untried);
        rules.chain(parts).chain(cells).filter(is_open).count()
    }

    fn evidence_in_words(&self) -> String {
        let mut parts = Vec::new();
        if self.tries > 0 {
            parts.push(format!(
                "{} of {} fail",
                self.failing_tries,
                counted(self.tries, "try")
            ));
        }
        if self.stored > 0 {
            parts.push(counted(self.stored, "stored failure"));
        }
        let kinds = counted(self.kinds.len(), "kind");
        parts.push(format!("{kinds} of failure"));
        match &self.all_kinds {
            Some(all) => {
                let [lo, hi] = all.ci95;
                parts.push(format!(
                    "{:.1} kinds estimated in all [{lo:.1}, {hi:.1}]",
                    all.all
                ));
            }
            None => parts.push("no estimate of unseen kinds without failing tries".to_owned()),
        }
        parts.join(", ")
    }

    /// Returns the number of questions without an answer, `None` if there is none.
    fn open_in_words(&self) -> Option<String> {
        let count = |state: CoverageState| {
            let is = |it: CoverageState| it == state;
            let rules = self.rules.iter().filter(|it| is(it.state)).count();
            let parts = self.parts.iter().filter(|it| is(it.state)).count();
            let cells = self.cells.iter().filter(|it| is(it.state)).count();
            let counts = [(rules, "rule"), (parts, "part"), (cells, "cell")];
            let some = counts.into_iter().filter(|(count, _)| *count > 0);
            let words: Vec<String> = some.map(|(n, word)| counted(n, word)).collect();
            (!words.is_empty()).then(|| format!("{}: {}", state.words(), words.join(", ")))
        };
        let open: Vec<String> = [CoverageState::TooFew, CoverageState::Untried]
            .into_iter()
            .filter_map(count)
            .collect();
        (!open.is_empty()).then(|| format!("no answer yet: {}", open.join("; ")))
    }

    /// Returns all lines, gaps first: what, name, covered, of, answer.
    fn lines(&self) -> Vec<(CoverageState, [String; 5])> {
        let line = |state: CoverageState, what: &str, name: String, covered: String, of: usize| {
            let of = of.to_string();
            let cells = [what.to_owned(), name, covered, of, state.words().to_owned()];
            (state, cells)
        };
        let rules = self.rules.iter().map(|it: &RuleCoverage| {
            let name = format!("“{}” of {}", it.rule, it.ado);
            line(it.state, "rule", name, it.bounds.to_string(), it.episodes)
        });
        let parts = self.parts.iter().map(|it| {
            let decides = it.decides.to_string();
            line(it.state, "part", it.part.clone(), decides, it.failures)
        });
        let cells = self.cells.iter().map(|it| {
            let name = format!("{} × {}", it.bin_in_words(), self.kind_in_words(it.kind));
            let covered = match it.stored {
                0 => it.failures.to_string(),
                stored => format!("{} + {stored}", it.failures),
            };
            line(it.state, "cell", name, covered, it.tries)
        });
        let mut lines: Vec<_> = rules.chain(parts).chain(cells).collect();
        // The sort is stable: rules before parts before cells.
        lines.sort_by_key(|(state, _)| *state);
        lines
    }

    /// Returns the table of at most `most` lines, gaps first and covered cells together.
    pub fn table(&self, most: usize) -> TextTable {
        let mut lines = self.lines();
        let is_plain = |(state, cells): &(CoverageState, [String; 5])| {
            // Gaps keep a line each, and other cells would bury them.
            cells[0] == "cell" && *state != CoverageState::Never
        };
        for state in [
            CoverageState::Untried,
            CoverageState::TooFew,
            CoverageState::Covered,
        ] {
            let is_of = |line: &(CoverageState, [String; 5])| is_plain(line) && line.0 == state;
            let count = lines.iter().filter(|line| is_of(line)).count();
            if count == 0 {
                continue;
            }
            lines.retain(|line| !is_of(line));
            let share = format!("{count} of {}", self.cells.len());
            let together = ["cell", share.as_str(), "–", "–", state.words()];
            lines.push((state, together.map(str::to_owned)));
        }
        // The lines of cells were appended behind covered rules.
        lines.sort_by_key(|(state, _)| *state);
        let hidden = lines.len().saturating_sub(most);
        if hidden > 0 {
            // One line less, for the number of those that are hidden.
            lines.truncate(most.saturating_sub(1));
            let more = format!("and {} more with --details", hidden + 1);
            let line = ["…", more.as_str(), "–", "–", "–"].map(str::to_owned);
            lines.push((CoverageState::Covered, line));
        }
        table_of(lines)
    }

    /// Returns the table of every rule, part and cell.
    pub fn whole_table(&self) -> TextTable {
        table_of(self.lines())
    }

    /// Returns the table of the kinds of failure.
    pub fn kind_table(&self) -> TextTable {
        let lines = self.kinds.iter().enumerate().map(|(at, kind)| {
            [
                self.kind_in_words(at),
                kind.tries.to_string(),
                kind.stored.to_string(),
            ]
        });
        TextTable::new(["kind of failure", "tries", "stored"], lines).numbers_from(1)
    }

    /// Returns remarks on the evidence, a line each.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        let without: Vec<&RuleCoverage> = self
            .rules
            .iter()
            .filter(|rule| rule.others_tried < rule.episodes)
            .collect();
        if let Some(rule) = without.first() {
            remarks.push(format!(
                "other actions were tried in {} of {}: not for programs, rules that look ahead, \
                 runs judged at their end, and rows of a campaign without a failure",
                rule.others_tried,
                counted(rule.episodes, "episode")
            ));
        }
        if self.tries == 0 && !self.is_empty() {
            remarks.push(format!(
                "stored failures are no tries, so none of the {AXIS_BINS} bins of an axis can \
                 be empty"
            ));
        }
        remarks
    }
}

fn table_of(lines: Vec<(CoverageState, [String; 5])>) -> TextTable {
    let cells = lines.into_iter().map(|(_, cells)| cells);
    TextTable::new(["what", "name", "covered", "of", "answer"], cells)
}
