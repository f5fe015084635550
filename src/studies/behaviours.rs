//! The ado behaviours that the paper's figures show, found anew in our worlds.
//!
//! They are searched, not learned: [`extreme`] looks through all action
//! sequences with few switches, so the same pictures come out on every machine.

use super::extreme::extreme;
use crate::experiment::{TestStarts, Watch};
use crate::rulebook::Verdict;
use crate::scene::Start;
use crate::search::{SWITCHES, SearchRequest, Switches, search};
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Constant, Episode, Replay, play};
use crate::world::Scenario;

/// The same where all sequences are played and two switches would be too many.
const FEW_SWITCHES: usize = 1;
/// Offsets of an ado that has merged, and of one that is about to overlap.
const MERGED_M: f64 = 0.9;
const ON_THE_WAY_M: f64 = 2.5;
/// Starts that are tried for the traffic light.
const TRIED: u64 = 50;

/// An episode and what its ado does, in a few words.
#[derive(Clone, Debug)]
pub struct Shown {
    /// What the ado does.
    pub name: String,
    /// What came of it.
    pub episode: Episode,
}

/// A world does not show what a figure needs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FigureError {
    /// The world's starts have other axes, or other ranges.
    #[error("`{world}` has no start with {wanted}")]
    NoSuchStart {
        /// Name of the world.
        world: String,
        /// The axes and values that were wanted.
        wanted: String,
    },
    /// No action sequence behaves so.
    #[error("no action sequence with at most {switches} switches in `{world}` {what}")]
    NotFound {
        /// Name of the world.
        world: String,
        /// How many switches were allowed.
        switches: usize,
        /// What was looked for.
        what: &'static str,
    },
}

/// Fig. 2: two different behaviours from the paper's failing start of `acc`.
///
/// The violation that comes first, and the one that comes last.
///
/// # Errors
/// The world has no such start, or nothing violates ψ_ego from it; also when
/// stopped.
pub fn two_behaviours(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    let wanted = [
        ("ego.speed", 12.0),
        ("ado.speed", 12.0),
        ("ado.headway", 15.0),
    ];
    let start = start_with(scenario, &wanted)?;
    let violated_at = |episode: &Episode| {
        let success = episode.verdict.is_success();
        success.then_some(episode.judged as f64)
    };
    let find = |sign: f64, what| {
        let score = |episode: &Episode| violated_at(episode).map(|at| sign * at);
        let found = extreme(scenario, (&start, 0), SWITCHES, score, watch);
        found.ok_or_else(|| not_found(scenario, SWITCHES, what))
    };
    Ok(vec![
        shown("First violation", find(-1.0, "violates ψ_ego")?),
        shown("Last violation", find(1.0, "violates ψ_ego")?),
    ])
}

/// Fig. 3: far away; cutting in against the rule; a violation by the rules.
///
/// # Errors
/// As [`two_behaviours`], from the paper's failing start of `merge`.
pub fn three_merges(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    // The paper's distance of 16 m is Euclidean, from the next lane.
    let along_m = libm::sqrt(16.0 * 16.0 - 3.5 * 3.5);
    let wanted = [
        ("ego.speed", 12.0),
        ("ado.speed", 12.0),
        ("ado.headway", along_m),
    ];
    let start = start_with(scenario, &wanted)?;
    let find = |score: &(dyn Fn(&Episode) -> Option<f64> + Sync), what| {
        let found = extreme(scenario, (&start, 0), FEW_SWITCHES, score, watch);
        found.ok_or_else(|| not_found(scenario, FEW_SWITCHES, what))
    };
    let farthest = |episode: &Episode| {
        let held = matches!(episode.verdict, Verdict::Held { .. });
        let merged = last(episode, "ado.lateral")? < MERGED_M;
        (held && merged && episode.contact.is_none()).then_some(episode.robustness)
    };
    // It cuts in: on its way to the other lane when it breaks the rule.
    let rude = |episode: &Episode| {
        let broken = matches!(episode.verdict, Verdict::Foul { rule: 0, .. });
        let moved = last(episode, "ado.lateral")? < ON_THE_WAY_M;
        (broken && moved).then_some(-(episode.judged as f64))
    };
    let lawful = first_found(scenario, &start, watch);
    let lawful = lawful.ok_or_else(|| not_found(scenario, SWITCHES, "violates ψ_ego by the rules"));
    Ok(vec![
        shown(
            "Merges far away",
            find(&farthest, "merges and lets ψ_ego hold")?,
        ),
        shown(
            "Cuts in, breaking its rule",
            find(&rude, "breaks the first rule")?,
        ),
        shown("Violation, every rule kept", lawful?),
    ])
}

/// The first success of a search with at most [`SWITCHES`] switches.
fn first_found(scenario: &Scenario, start: &Start, watch: &Watch<'_>) -> Option<Episode> {
    let starts = TestStarts {
        seed: 0,
        starts: vec![(start.clone(), 0)],
        trivial: vec![false],
    };
    let request = SearchRequest {
        scenario,
        ego: "nominal",
        method: Switches(SWITCHES).into(),
        budget: 0,
        starts: &starts,
    };
    let found = search(&request, watch).found.into_iter().flatten().next()?;
    let actions = found.actions?;
    let mut ado = Replay::holding(&actions);
    Some(play(
        &mut scenario.bench(),
        start,
        0,
        &mut ado,
        Aftermath::Play,
    ))
}

/// Fig. 5: a run in which ψ_ego holds best, and one in which it is violated.
///
/// From the first test start from which the ego does not fail by itself and
/// both can be had.
///
/// # Errors
/// As [`two_behaviours`].
pub fn two_at_the_light(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    let held = |episode: &Episode| {
        let held = matches!(episode.verdict, Verdict::Held { .. }) && episode.contact.is_none();
        held.then_some(episode.robustness)
    };
    let mut bench = scenario.bench();
    for index in 0..TRIED {
        let key = StartKey {
            purpose: Purpose::Test,
            seed: 0,
            index,
        };
        let start = bench.draw(key);
        let mut coasting = Constant(bench.spaces().neutral);
        let coasting = play(&mut bench, &start, 0, &mut coasting, Aftermath::Skip);
        if coasting.verdict.is_success() {
            continue;
        }
        let held = extreme(scenario, (&start, 0), FEW_SWITCHES, held, watch);
        if let (Some(held), Some(found)) = (held, first_found(scenario, &start, watch)) {
            return Ok(vec![
                shown("The ego obeys the light", held),
                shown("The ado makes the ego run the red", found),
            ]);
        }
    }
    Err(not_found(scenario, SWITCHES, "makes the ego run the red"))
}

fn shown(name: &str, episode: Episode) -> Shown {
    Shown {
        name: name.to_owned(),
        episode,
    }
}

fn not_found(scenario: &Scenario, switches: usize, what: &'static str) -> FigureError {
    FigureError::NotFound {
        world: scenario.name.clone(),
        switches,
        what,
    }
}

fn last(episode: &Episode, signal: &str) -> Option<f64> {
    episode.trace.signal(signal)?.last().copied()
}

/// The start with these values by name of the axis.
///
/// # Errors
/// The world's starts have other axes, or other ranges.
pub fn start_with(scenario: &Scenario, wanted: &[(&str, f64)]) -> Result<Start, FigureError> {
    let axes = scenario.axes();
    let value = |axis: &crate::scene::Axis| {
        let (_, value) = wanted.iter().find(|(name, _)| *name == axis.name)?;
        (axis.lo..=axis.hi).contains(value).then_some(*value)
    };
    let values: Option<Vec<f64>> = axes.iter().map(value).collect();
    let known = values.filter(|values| values.len() == wanted.len());
    known.map(Start).ok_or_else(|| {
        let words = wanted
            .iter()
            .map(|(name, value)| format!("{name} = {value:.2}"));
        FigureError::NoSuchStart {
            world: scenario.name.clone(),
            wanted: words.collect::<Vec<_>>().join(", "),
        }
    })
}
