//! Choice of the most informative counterexamples, by explicit criteria.

use crate::experiment::{EpisodeLoop, Watch, WorkItem};
use crate::rulebook::Verdict;
use crate::scene::Axis;
use crate::search::ExperimentCell;
use crate::stl::Scratch;
use crate::testbench::{Episode, Testbench};
use crate::world::Scenario;

/// Counterexample with the criterion that chose it.
#[derive(Clone, Debug)]
pub struct Highlight {
    /// The criterion, with the number.
    pub chosen_for: String,
    /// Its position among the test starts.
    pub start: usize,
    /// The episode, to contact or the horizon.
    pub episode: Episode,
}

/// Quantities by which counterexamples are compared.
struct Facts {
    start: usize,
    closing_mps: Option<f64>,
    judged: usize,
    depth: f64,
    spare: Option<f64>,
    place: Vec<f64>,
}

/// Returns at most five counterexamples of a cell, from different starts.
///
/// In order: the highest closing speed, the earliest violation, the deepest violation,
/// the largest margin of all rules, and the start that is farthest from the other four. A
/// criterion without a value is left out.
pub fn highlights(cell: &ExperimentCell) -> Vec<Highlight> {
    let scenario = cell.ego.scenario();
    let (solved, axes) = (cell.solved(), scenario.axes());
    let facts_again = |bench: &mut Testbench, start: &usize, _: &WorkItem| {
        let episode = cell.replay(bench, *start);
        Some(facts_of(*start, &episode, scenario, &axes))
    };
    // The caller has counted these episodes already, so they move no progress bar.
    let unwatched = Watch::unwatched();
    let all = EpisodeLoop::uncounted(&unwatched);
    let facts: Vec<Facts> = all
        .run(&solved, || scenario.bench(), facts_again)
        .into_iter()
        .flatten()
        .collect();
    let dt_s = scenario.bench().clock().sample_s;
    let mut chosen: Vec<(String, &Facts)> = Vec::new();
    type Criterion<'a> = (
        &'a dyn Fn(&Facts) -> Option<f64>,
        &'a dyn Fn(&Facts) -> String,
    );
    let criteria: [Criterion<'_>; 4] = [
        (&|f| f.closing_mps, &|f| {
            let speed = f.closing_mps.unwrap_or(0.0);
            format!("Highest closing speed: {speed:.1} m/s")
        }),
        // The largest score wins, so the earliest time is the largest negative one.
        (&|f| Some(-(f.judged as f64)), &|f| {
            let seconds = f.judged.saturating_sub(1) as f64 * dt_s;
            format!("Earliest violation: {seconds:.2} s")
        }),
        (&|f| f.depth.is_finite().then_some(f.depth), &|f| {
            format!("Deepest violation: ρ(ψ_ego) = {:.3}", -f.depth)
        }),
        (&|f| f.spare.filter(|spare| spare.is_finite()), &|f| {
            let spare = f.spare.unwrap_or(0.0);
            format!("Rules kept with the largest margin: ρ ≥ {spare:.2} for each")
        }),
    ];
    for (score, words) in criteria {
        let left = facts
            .iter()
            // An episode that leads in two criteria would fill two places with the same
            // picture.
            .filter(|f| chosen.iter().all(|(_, other)| other.start != f.start));
        let scored = left.filter_map(|f| Some((score(f)?, f)));
        // Ties go to the first start.
        let best = scored.reduce(|a, b| if a.0 < b.0 { b } else { a });
        if let Some((_, best)) = best {
            chosen.push((words(best), best));
        }
    }
    // The last choice shows variety: the start whose least distance to the others is
    // largest.
    let far = |f: &Facts| {
        let others = chosen
            .iter()
            .map(|(_, other)| apart(&f.place, &other.place));
        others.fold(f64::INFINITY, f64::min)
    };
    let farthest = facts
        .iter()
        .map(|f| (far(f), f))
        // A distance of 0 is the place of a chosen start, which shows nothing new.
        .filter(|(far, _)| *far > 0.0);
    if let Some((_, f)) = farthest.reduce(|a, b| if a.0 < b.0 { b } else { a }) {
        chosen.push(("Start most unlike the others".to_owned(), f));
    }
    // Only the chosen episodes are kept in memory, so they are played again.
    let mut bench = scenario.bench();
    let played = chosen.into_iter().map(|(chosen_for, facts)| Highlight {
        chosen_for,
        start: facts.start,
        episode: cell.replay(&mut bench, facts.start),
    });
    played.collect()
}

fn facts_of(start: usize, episode: &Episode, scenario: &Scenario, axes: &[Axis]) -> Facts {
    let rulebook = scenario.rulebook();
    let judged = episode.judged_trace();
    let mut scratch = Scratch::new();
    let rules = rulebook.rules.iter();
    let spare = rules
        .map(|rule| rule.monitor.robustness(&judged, &mut scratch))
        // The rule that is closest to its violation bounds the fairness of the whole
        // episode.
        .reduce(f64::min);
    // Each axis is scaled to [0, 1], so that metres and speeds are comparable.
    let values = axes.iter().zip(&episode.start.0);
    let place = values.map(|(axis, value)| {
        if axis.lo < axis.hi {
            (value - axis.lo) / (axis.hi - axis.lo)
        } else {
            0.0
        }
    });
    Facts {
        start,
        closing_mps: episode
            .contact
            .as_ref()
            .map(|touch| touch.closing_speed_mps),
        judged: episode.judged,
        depth: match episode.verdict {
            Verdict::Counterexample { by } => by,
            _ => 0.0,
        },
        spare,
        place: place.collect(),
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}
