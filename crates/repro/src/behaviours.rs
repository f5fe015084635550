//! Ado behaviours of the paper's figures, found again in the worlds of this project.
//!
//! They are searched and not learned. [`extreme`] tries all action sequences with few
//! switches, so every machine shows the same pictures.

use super::extreme::extreme;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch};
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::search::{Adversary, SWITCHES, Search};
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;

/// Largest number of switches where every sequence is played and two would be too many.
const FEW_SWITCHES: usize = 1;
/// Lateral offsets of an ado that has merged, and of an ado that is about to overlap.
const MERGED_M: f64 = 0.9;
const ON_THE_WAY_M: f64 = 2.5;
/// Largest number of starts tried for the traffic light.
const TRIED: u64 = 50;

/// Episode with a short description of the ado's behaviour.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Description of the ado's behaviour.
    pub name: String,
    /// Episode that shows it.
    pub episode: Episode,
    /// Largest number of switches of the search that found it.
    pub switches: usize,
}

/// Error of a world that does not show what a figure needs.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FigureError {
    /// The world's starts have other axes, or other ranges.
    #[error("`{world}` has no start with {wanted}")]
    NoSuchStart {
        /// Name of the world.
        world: String,
        /// Requested axes and values.
        wanted: String,
    },
    /// No action sequence shows the behaviour.
    #[error("no action sequence with at most {switches} switches in `{world}` {what}")]
    NotFound {
        /// Name of the world.
        world: String,
        /// Largest number of switches.
        switches: usize,
        /// Requested behaviour.
        what: &'static str,
    },
}

/// Fig. 2: two different behaviours from the paper's failing start of `acc`.
///
/// They are the earliest and the latest violation.
///
/// # Errors
/// Returns an error if the world has no such start, if no sequence violates ψ_ego from
/// it, or if stopped.
pub fn two_behaviours(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    let wanted = [
        ("ego.speed", 12.0),
        ("ado.speed", 12.0),
        // The values are those of the paper's Fig. 2.
        ("ado.headway", 15.0),
    ];
    let start = start_with(scenario, &wanted)?;
    let violated_at = |episode: &Episode| {
        let success = episode.verdict.is_success();
        // The number of judged samples is the time of the violation.
        success.then_some(episode.judged as f64)
    };
    let find = |sign: f64, what| {
        // The search maximizes, and the earliest violation is the greatest negated time.
        let score = |episode: &Episode| violated_at(episode).map(|at| sign * at);
        let found = extreme(scenario, &start, 0, SWITCHES, score, watch);
        found.ok_or_else(|| not_found(scenario, SWITCHES, what))
    };
    Ok(vec![
        shown("First violation", find(-1.0, "violates ψ_ego")?, SWITCHES),
        shown("Last violation", find(1.0, "violates ψ_ego")?, SWITCHES),
    ])
}

/// Fig. 3: a distant merge, a cut-in that breaks a rule, and a violation with every rule kept.
///
/// # Errors
/// Returns the errors of [`two_behaviours`], for the paper's failing start of `merge`.
pub fn three_merges(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    // The paper's distance of 16 m is Euclidean, measured from the next lane.
    let along_m = libm::sqrt(16.0 * 16.0 - 3.5 * 3.5);
    let wanted = [
        ("ego.speed", 12.0),
        ("ado.speed", 12.0),
        ("ado.headway", along_m),
    ];
    let start = start_with(scenario, &wanted)?;
    let find = |score: &(dyn Fn(&Episode) -> Option<f64> + Sync), what| {
        let found = extreme(scenario, &start, 0, FEW_SWITCHES, score, watch);
        found.ok_or_else(|| not_found(scenario, FEW_SWITCHES, what))
    };
    let farthest = |episode: &Episode| {
        let held = matches!(episode.verdict, Verdict::Held { .. });
        let merged = last(episode, "ado.lateral")? < MERGED_M;
        // The largest robustness is the farthest merge.
        (held && merged && episode.contact.is_none()).then_some(episode.robustness)
    };
    // A cut-in breaks the rule while the ado moves to the other lane.
    let rude = |episode: &Episode| {
        // Rule 0 is the most important one, which in `merge` is about the gap.
        let broken = matches!(episode.verdict, Verdict::Foul { rule: 0, .. });
        let moved = last(episode, "ado.lateral")? < ON_THE_WAY_M;
        // The earliest violation of the rule is the clearest picture.
        (broken && moved).then_some(-(episode.judged as f64))
    };
    let violation = first_found(scenario, &start, watch)
        .ok_or_else(|| not_found(scenario, SWITCHES, "violates ψ_ego by the rules"));
    Ok(vec![
        shown(
            "Merges far away",
            find(&farthest, "merges and lets ψ_ego hold")?,
            FEW_SWITCHES,
        ),
        shown(
            "Cuts in, breaking its rule",
            find(&rude, "breaks the first rule")?,
            FEW_SWITCHES,
        ),
        shown("Violation, every rule kept", violation?, SWITCHES),
    ])
}

/// Returns the first success of a search with at most [`SWITCHES`] switches.
fn first_found(scenario: &Scenario, start: &Start, watch: &Watch<'_>) -> Option<Episode> {
    let starts = TestStarts {
        // A single start that is never left out as trivial.
        seed: 0,
        starts: vec![(start.clone(), 0)],
        trivial: vec![false],
    };
    let ego = EgoUnderTest::nominal(scenario);
    let cell = Search::switches(SWITCHES).play(&ego, &starts, watch)?;
    // The search keeps actions only, so the episode is played for its trace.
    let solved = *cell.solved().first()?;
    Some(cell.replay(&mut scenario.bench(), solved))
}

/// Fig. 5: the run in which ψ_ego holds best, and a run in which it is violated.
///
/// Both begin at the first test start from which both exist and the ego does not fail by
/// itself.
///
/// # Errors
/// Returns the errors of [`two_behaviours`].
pub fn two_at_the_light(scenario: &Scenario, watch: &Watch<'_>) -> Result<Vec<Shown>, FigureError> {
    let held = |episode: &Episode| {
        // A contact without a violation would not show an ego that obeys the light.
        let held = matches!(episode.verdict, Verdict::Held { .. }) && episode.contact.is_none();
        held.then_some(episode.robustness)
    };
    let mut bench = scenario.bench();
    for index in 0..TRIED {
        let key = StartKey {
            purpose: Purpose::Test,
            // An open stream, because a picture is chosen and is no evidence.
            seed: 0,
            index,
        };
        let start = bench.draw(key);
        let mut neutral = Constant(bench.spaces().neutral);
        let coasting = play(&mut bench, &start, 0, &mut neutral, Aftermath::Skip);
        // The ado has no part in such a failure.
        if coasting.verdict.is_success() {
            continue;
        }
        // The noise seed is fixed, so the figure is the same on every machine.
        let held = extreme(scenario, &start, 0, FEW_SWITCHES, held, watch);
        if let (Some(held), Some(found)) = (held, first_found(scenario, &start, watch)) {
            return Ok(vec![
                shown("The ego obeys the light", held, FEW_SWITCHES),
                shown("The ado makes the ego run the red", found, SWITCHES),
            ]);
        }
    }
    Err(not_found(scenario, SWITCHES, "makes the ego run the red"))
}

fn shown(name: &str, episode: Episode, switches: usize) -> Shown {
    Shown {
        name: name.to_owned(),
        episode,
        switches,
    }
}

fn not_found(scenario: &Scenario, switches: usize, what: &'static str) -> FigureError {
    FigureError::NotFound {
        world: scenario.name().to_owned(),
        switches,
        what,
    }
}

fn last(episode: &Episode, signal: &str) -> Option<f64> {
    episode.trace.signal(signal)?.last().copied()
}

/// Returns the start with these values by name of the axis.
///
/// # Errors
/// Returns an error if the world's starts have other axes or ranges.
pub fn start_with(scenario: &Scenario, wanted: &[(&str, f64)]) -> Result<Start, FigureError> {
    let axes = scenario.axes();
    let value = |axis: &brakecheck::scene::Axis| {
        let (_, value) = wanted.iter().find(|(name, _)| *name == axis.name)?;
        (axis.lo..=axis.hi).contains(value).then_some(*value)
    };
    let values: Option<Vec<f64>> = axes.iter().map(value).collect();
    // An unknown name leaves fewer values than requested.
    let known = values.filter(|values| values.len() == wanted.len());
    known.map(Start).ok_or_else(|| {
        let words = wanted
            .iter()
            .map(|(name, value)| format!("{name} = {value:.2}"));
        FigureError::NoSuchStart {
            world: scenario.name().to_owned(),
            wanted: words.collect::<Vec<_>>().join(", "),
        }
    })
}
