//! Coverage of one world by episodes.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::episode::{CoveredEpisode, EpisodeOrigin, RuleBound};
use crate::experiment::FailureKind;
use crate::scene::Axis;
use crate::stats::{Incidence, KindsEstimate, at_most};
use crate::world::Scenario;

/// Bins of each axis of X_init.
pub const AXIS_BINS: usize = 4;
/// Share of episodes below which an absence is called *never*, with 95 % confidence.
pub(super) const RARE: f64 = 0.05;
/// Probability of any false empty cell.
pub(super) const FALSE_CELL: f64 = 0.05;
/// Share of the spread of a rule's margins within which a margin is near 0.
pub(super) const NEAR: f64 = 0.05;

/// Answer of coverage to the question whether something occurs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CoverageState {
    /// It does not occur, and enough episodes show it.
    Never,
    /// No episode could show it.
    Untried,
    /// It does not occur, and the episodes are too few for a claim.
    TooFew,
    /// It occurs.
    Covered,
}

/// Coverage of a rule of an ado.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RuleCoverage {
    /// Name of the rule.
    pub rule: String,
    /// Ado that must keep it.
    pub ado: String,
    /// Episodes in which it bounds the ado.
    pub bounds: usize,
    /// Episodes in which it was evaluated.
    pub episodes: usize,
    /// Episodes in which other actions were tried, too.
    pub others_tried: usize,
    /// Least margin above 0, in the unit of its formula. `None`: there is none.
    pub least_margin: Option<f64>,
    /// Answer.
    pub state: CoverageState,
}

/// Coverage of a part of ψ_ego.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartCoverage {
    /// Canonical text.
    pub part: String,
    /// Position of the smallest larger part. `None`: there is none.
    pub within: Option<usize>,
    /// Failures that it decides.
    pub decides: usize,
    /// Failures in all.
    pub failures: usize,
    /// Answer.
    pub state: CoverageState,
}

/// Number of failures of a kind.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KindCoverage {
    /// The kind.
    pub kind: FailureKind,
    /// Tries that show it.
    pub tries: usize,
    /// Drawn starts from which a try shows it.
    pub starts: usize,
    /// Stored failures that show it.
    pub stored: usize,
}

/// Cell of an axis of the starts and a kind of failure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellCoverage {
    /// Name of the axis.
    pub axis: String,
    /// Its unit.
    pub unit: &'static str,
    /// Least and greatest value of the bin.
    pub range: [f64; 2],
    /// Position of the kind in [`Coverage::kinds`].
    pub kind: usize,
    /// Tries that fail in the kind, from starts in the bin.
    pub failures: usize,
    /// Stored failures of the kind, from starts in the bin.
    pub stored: usize,
    /// Tries from starts in the bin.
    pub tries: usize,
    /// Drawn starts of these tries: several ados may try a start.
    pub starts: usize,
    /// Probability of no failure here if the kind depended on no start. `None`: no try.
    pub chance: Option<f64>,
    /// Answer.
    pub state: CoverageState,
}

/// Coverage of the specification, the rules and the starts of one world.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Coverage {
    /// Name of the world.
    pub world: String,
    /// Episodes from drawn starts, each a try.
    pub tries: usize,
    /// Drawn starts of these tries.
    pub starts: usize,
    /// Tries in which the ego fails with all rules kept.
    pub failing_tries: usize,
    /// Stored failures.
    pub stored: usize,
    /// Rules, in the order of the rulebook.
    pub rules: Vec<RuleCoverage>,
    /// Parts of ψ_ego, a part behind those that contain it.
    pub parts: Vec<PartCoverage>,
    /// Kinds of failure, the most frequent first.
    pub kinds: Vec<KindCoverage>,
    /// Estimated number of kinds (Chao2) from the tries. `None`: no try, or no failing one.
    pub all_kinds: Option<KindsEstimate>,
    /// Cells: axis by axis, bin by bin, kind by kind.
    pub cells: Vec<CellCoverage>,
    /// What is never covered, in words.
    pub gaps: Vec<String>,
}

impl Coverage {
    /// Measures the coverage of a world by valid episodes.
    pub fn of(scenario: &Scenario, episodes: &[CoveredEpisode]) -> Coverage {
        let drawn = |it: &&CoveredEpisode| is_try(it);
        let tries = episodes.iter().filter(drawn).count();
        let failing = |it: &&CoveredEpisode| it.failure.is_some();
        let failing_tries = episodes.iter().filter(drawn).filter(failing).count();
        let starts = distinct_starts(episodes.iter().filter(drawn));
        let kinds = kinds(episodes);
        // A start is the unit of a sample: tries of several ados from it are no more units.
        let counts = kinds.iter().map(|kind| kind.starts as u64);
        let mut coverage = Coverage {
            world: scenario.name().to_owned(),
            tries,
            starts,
            failing_tries,
            // Each episode is of one origin, so the rest is stored.
            stored: episodes.len() - tries,
            rules: rules(scenario, episodes),
            parts: parts(scenario, episodes),
            // Stored failures were chosen and not drawn, so no estimate rests on them.
            all_kinds: (failing_tries > 0).then(|| Incidence::new(starts as u64, counts).kinds()),
            cells: cells(&scenario.axes(), &kinds, episodes, starts),
            kinds,
            gaps: Vec::new(),
        };
        coverage.gaps = coverage.gaps_in_words();
        coverage
    }

    /// Returns whether no episode was evaluated.
    pub fn is_empty(&self) -> bool {
        self.tries + self.stored == 0
    }
}

/// Answers by the number of occurrences in some episodes.
fn state(occurrences: usize, episodes: usize) -> CoverageState {
    match (occurrences, episodes) {
        (1.., _) => CoverageState::Covered,
        (0, 0) => CoverageState::Untried,
        // 59 episodes are the fewest that suffice, as 0.95 to the 59th is below 5 %.
        (0, some) if at_most(some) <= RARE => CoverageState::Never,
        _ => CoverageState::TooFew,
    }
}

fn rules(scenario: &Scenario, episodes: &[CoveredEpisode]) -> Vec<RuleCoverage> {
    let rules = scenario.rulebook().rules.iter().enumerate();
    let coverage = rules.map(|(position, rule)| {
        let bound = |it: &CoveredEpisode| it.rules.get(position).copied().flatten();
        let bounds: Vec<RuleBound> = episodes.iter().filter_map(bound).collect();
        let margins = || bounds.iter().filter_map(|bound| bound.margin);
        let least = margins().reduce(f64::min);
        // A rule without any margin has no spread, and nothing is near its bound.
        let greatest = margins().reduce(f64::max).unwrap_or(0.0);
        // Relative to the spread, because formulas have different units.
        let near = NEAR * (greatest - least.unwrap_or(greatest));
        let is_near = |bound: &&RuleBound| {
            bound.is_broken
                || bound.forbids_other == Some(true)
                // A margin is no evidence where an action could break the rule and none does.
                || (bound.forbids_other.is_none()
                    && bound.margin.is_some_and(|margin| margin <= near))
        };
        let count = bounds.iter().filter(is_near).count();
        RuleCoverage {
            rule: rule.name.clone(),
            ado: rule.ado.clone(),
            bounds: count,
            episodes: bounds.len(),
            others_tried: bounds
                .iter()
                .filter(|it| it.forbids_other.is_some())
                .count(),
            least_margin: least,
            state: state(count, bounds.len()),
        }
    });
    coverage.collect()
}

fn parts(scenario: &Scenario, episodes: &[CoveredEpisode]) -> Vec<PartCoverage> {
    let failures = || episodes.iter().filter_map(|it| it.failure.as_ref());
    let count = failures().count();
    let parts = scenario.rulebook().spec.parts().into_iter();
    let coverage = parts.map(|part| {
        let decides = failures()
            // A path leads through all larger parts, so a failure
            // counts for each of them.
            .filter(|it| it.path.contains(&part.formula))
            .count();
        PartCoverage {
            part: part.formula,
            within: part.within,
            decides,
            failures: count,
            state: state(decides, count),
        }
    });
    coverage.collect()
}

/// Counts the drawn starts of some episodes, a start of several episodes once.
fn distinct_starts<'a>(episodes: impl Iterator<Item = &'a CoveredEpisode>) -> usize {
    // Equal draws are equal to the last bit, and floats alone have no order for a set.
    let bits =
        |it: &CoveredEpisode| -> Vec<u64> { it.start.0.iter().map(|x| x.to_bits()).collect() };
    let starts: BTreeSet<Vec<u64>> = episodes.map(bits).collect();
    starts.len()
}

/// Counts the kinds of failure, the most frequent first and equals in their order.
fn kinds(episodes: &[CoveredEpisode]) -> Vec<KindCoverage> {
    // Sorted, so that equally frequent ones keep an order that no hash decides.
    let mut of_kind: BTreeMap<&FailureKind, Vec<&CoveredEpisode>> = BTreeMap::new();
    for episode in episodes {
        if let Some(failure) = &episode.failure {
            of_kind.entry(&failure.kind).or_default().push(episode);
        }
    }
    let counted = of_kind.into_iter().map(|(kind, episodes)| {
        let drawn = || episodes.iter().copied().filter(|it| is_try(it));
        let tries = drawn().count();
        KindCoverage {
            kind: kind.clone(),
            tries,
            starts: distinct_starts(drawn()),
            stored: episodes.len() - tries,
        }
    });
    let mut kinds: Vec<KindCoverage> = counted.collect();
    kinds.sort_by_key(|kind| std::cmp::Reverse(kind.tries + kind.stored));
    kinds
}

fn is_try(episode: &CoveredEpisode) -> bool {
    episode.origin == EpisodeOrigin::Drawn
}

/// Counts the failures and tries of each cell, of tries from `starts` starts in all.
fn cells(
    axes: &[Axis],
    kinds: &[KindCoverage],
    episodes: &[CoveredEpisode],
    starts: usize,
) -> Vec<CellCoverage> {
    let mut cells = Vec::new();
    for (position, axis) in axes.iter().enumerate() {
        // An axis of one value has nothing to cover.
        if axis.hi <= axis.lo {
            continue;
        }
        for bin in 0..AXIS_BINS {
            let is_here = |it: &&CoveredEpisode| {
                let value = it.start.0.get(position);
                value.is_some_and(|value| axis.bin(*value, AXIS_BINS) == bin)
            };
            let here: Vec<&CoveredEpisode> = episodes.iter().filter(is_here).collect();
            let drawn = || here.iter().copied().filter(|it| is_try(it));
            for (kind, counted) in kinds.iter().enumerate() {
                let is_kind = |it: &&&CoveredEpisode| {
                    let failure = it.failure.as_ref();
                    failure.is_some_and(|it| it.kind == counted.kind)
                };
                let failing = || here.iter().filter(is_kind);
                let failures = failing().filter(|it| is_try(it)).count();
                cells.push(CellCoverage {
                    axis: axis.name.clone(),
                    unit: axis.unit,
                    range: axis.bin_ends(bin, AXIS_BINS),
                    kind,
                    failures,
                    stored: failing().count() - failures,
                    tries: drawn().count(),
                    starts: distinct_starts(drawn()),
                    // The level of the test depends on the number of tried cells, which
                    // is known at the end.
                    chance: None,
                    state: CoverageState::Untried,
                });
            }
        }
    }
    judge_cells(&mut cells, kinds, starts);
    cells
}

/// Fills in the answers of cells, of tries from `starts` starts in all.
fn judge_cells(cells: &mut [CellCoverage], kinds: &[KindCoverage], starts: usize) {
    let tried = cells.iter().filter(|cell| cell.starts > 0).count();
    // Each cell is a test of its own, so the probability of a false one is shared.
    let level = FALSE_CELL / tried.max(1) as f64;
    for cell in cells {
        let chance = chance_of_none(starts, cell.starts, kinds[cell.kind].starts);
        cell.chance = (cell.starts > 0).then_some(chance);
        cell.state = match cell {
            // A stored failure fills its cell, although it is no try.
            CellCoverage { failures: 1.., .. } | CellCoverage { stored: 1.., .. } => {
                CoverageState::Covered
            }
            CellCoverage { starts: 0, .. } => CoverageState::Untried,
            _ if chance <= level => CoverageState::Never,
            _ => CoverageState::TooFew,
        };
    }
}

/// Returns the probability that none of `failing` among `all` starts is among `here` starts.
///
/// The starts here are a random sample of all under the hypothesis that the start does not
/// matter (hypergeometric distribution).
fn chance_of_none(all: usize, here: usize, failing: usize) -> f64 {
    let elsewhere = all.saturating_sub(here);
    let one = |nth: usize| {
        let left = all.saturating_sub(nth).max(1);
        elsewhere.saturating_sub(nth) as f64 / left as f64
    };
    // Draw by draw: the next failing start is elsewhere, given that those before it are.
    (0..failing.min(all)).map(one).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absence_is_claimed_only_with_enough_episodes() {
        assert_eq!(state(1, 1), CoverageState::Covered);
        assert_eq!(state(0, 0), CoverageState::Untried);
        // 1 − 0.05^(1/58) is 5.03 %, and 1 − 0.05^(1/59) is 4.95 %.
        assert_eq!(state(0, 58), CoverageState::TooFew);
        assert_eq!(state(0, 59), CoverageState::Never);
    }

    #[test]
    fn the_chance_of_an_empty_cell_is_hypergeometric() {
        // 10 tries, of which 3 fail and 4 are here: C(6, 3) / C(10, 3) is 20 / 120.
        assert!((chance_of_none(10, 4, 3) - 20.0 / 120.0).abs() < 1e-15);
        // More failures than tries elsewhere cannot all be elsewhere.
        assert_eq!(chance_of_none(10, 4, 7), 0.0);
        // Without a failing try, or without a try here, emptiness shows nothing.
        assert_eq!(chance_of_none(10, 4, 0), 1.0);
        assert_eq!(chance_of_none(0, 0, 0), 1.0);
        assert_eq!(chance_of_none(10, 0, 5), 1.0);
    }

    #[test]
    fn a_cell_is_untried_open_empty_or_covered() {
        let kind = KindCoverage {
            kind: FailureKind {
                leaf: "gap > 0".to_owned(),
                geometry: None,
                agents: None,
            },
            tries: 40,
            starts: 40,
            stored: 3,
        };
        let cell = |failures, stored, starts| CellCoverage {
            axis: "x".to_owned(),
            unit: "m",
            range: [0.0, 1.0],
            kind: 0,
            failures,
            stored,
            tries: starts,
            starts,
            chance: None,
            state: CoverageState::Untried,
        };
        let mut cells = [
            cell(40, 0, 60),
            cell(0, 0, 36),
            cell(0, 0, 4),
            cell(0, 0, 0),
            cell(0, 3, 0),
        ];
        judge_cells(&mut cells, &[kind], 100);
        let states: Vec<CoverageState> = cells.iter().map(|cell| cell.state).collect();
        use CoverageState::{Covered, Never, TooFew, Untried};
        assert_eq!(states, [Covered, Never, TooFew, Untried, Covered]);
        assert_eq!(cells[3].chance, None);
    }
}
