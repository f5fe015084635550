//! Episodes that coverage counts: of a run, a population and kept crashes.

use std::collections::BTreeMap;

use super::episode::{CoveredEpisode, EpisodeObserver, EpisodeOrigin, evenly_spread};
use super::measure::Coverage;
use crate::adversary::Ado;
use crate::crashes::Replayed;
use crate::evaluation::EvaluationError;
use crate::experiment::{EgoUnderTest, EpisodeLoop, TestStarts, Watch, consent};
use crate::population::{PopulationDir, archive_of};
use crate::run_dir::{RunDir, RunError};
use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::testbench::{Aftermath, Episode, Replay, Testbench, play};
use crate::world::Scenario;

/// Most episodes of a source whose rules are evaluated, evenly spread.
pub const RULED_EPISODES: usize = 200;
/// Most stored failures that are played again, evenly spread.
const STORED: usize = 400;

/// Plays items in parallel and observes the valid episodes, in the order of the items.
///
/// The rules of at most `ruled` of them are evaluated. `None`: stopped.
pub fn observed<I: Sync>(
    scenario: &Scenario,
    items: &[I],
    origin: EpisodeOrigin,
    ruled: usize,
    watch: &Watch<'_>,
    episode: impl Fn(&mut Testbench, &I, usize) -> Option<Episode> + Sync + Send,
) -> Option<Vec<CoveredEpisode>> {
    let all = EpisodeLoop::counted(watch, items.len());
    let worker = || (scenario.bench(), EpisodeObserver::new(scenario));
    let seen = all.each(items, worker, |(bench, observer), item, index| {
        let played = episode(bench, item, index)?;
        watch.faults.note(index as u64, played.fault.as_ref());
        // The rules are the slow part, and a prefix would not represent the whole list.
        let with_rules = evenly_spread(index, items.len(), ruled);
        observer.observe(&played, origin, with_rules)
    });
    // Episodes that were not reached would be missing tries.
    (!watch.interrupted()).then(|| seen.into_iter().flatten().collect())
}

/// Measures the coverage of a run: its ado on test starts, and the failures that it stored.
///
/// `scenario` is the world of the run on the plant to play on. `drawn` is the number of test
/// starts and their seed. `None`: stopped.
///
/// # Errors
/// The run is unfinished or damaged, or the ego may not be started.
pub fn coverage_of_run(
    run: &RunDir,
    scenario: &Scenario,
    drawn: (usize, u64),
    watch: &Watch<'_>,
) -> Result<Option<Coverage>, EvaluationError> {
    let Some(starts) = test_starts(run, scenario, drawn, watch)? else {
        return Ok(None);
    };
    watch.phase("playing the ado and trying other actions");
    let Some(tries) = tries(run, scenario, &starts, watch)? else {
        return Ok(None);
    };
    let Some(stored) = stored(run, scenario, watch)? else {
        return Ok(None);
    };
    Ok(Some(Coverage::of(scenario, &[tries, stored].concat())))
}

/// Measures the coverage of a population: all members on test starts, and its archive.
///
/// `scenario` is the world of the members on the plant to play on. `drawn` is the number of
/// test starts and their seed. `None`: stopped.
///
/// # Errors
/// There is no finished member, a file is damaged, or the ego may not be started.
pub fn coverage_of_population(
    dir: &PopulationDir,
    members: &[RunDir],
    scenario: &Scenario,
    drawn: (usize, u64),
    watch: &Watch<'_>,
) -> Result<Option<Coverage>, EvaluationError> {
    let mut episodes = Vec::new();
    if let Some(first) = members.first() {
        // Members share their world, so one draw serves all of them.
        let Some(starts) = test_starts(first, scenario, drawn, watch)? else {
            return Ok(None);
        };
        watch.phase("playing the members and trying other actions");
        for member in members {
            match tries(member, scenario, &starts, watch)? {
                Some(tries) => episodes.extend(tries),
                None => return Ok(None),
            }
        }
    }
    let archive = archive_of(dir)?;
    let failures: Vec<(u64, &[usize])> = archive
        .iter()
        .map(|failure| (failure.index, &failure.actions[..]))
        .collect();
    watch.phase("playing the archive and trying other actions");
    let seed = dir.manifest().seed;
    let replayed = observed(
        scenario,
        &failures,
        EpisodeOrigin::Stored,
        RULED_EPISODES,
        watch,
        |bench, (index, actions), _| {
            // An archive stores the index of a start of training, which has the same draw
            // again.
            let key = StartKey {
                purpose: Purpose::Train,
                seed,
                index: *index,
            };
            // The noise follows from the same key, or the stored actions would meet
            // another episode.
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            repeated_failure(bench, &start, noise, actions)
        },
    );
    let Some(replayed) = replayed else {
        return Ok(None);
    };
    episodes.extend(replayed);
    Ok(Some(Coverage::of(scenario, &episodes)))
}

/// Measures the coverage of replayed crash files, a coverage per world.
///
/// Only files whose ego still fails count, as stored failures.
pub fn coverage_of_kept(replayed: &[Replayed]) -> Vec<Coverage> {
    // Worlds of equal names may differ in their rules, but not if their texts are equal.
    let mut worlds: BTreeMap<&str, Vec<&Replayed>> = BTreeMap::new();
    for one in replayed {
        worlds.entry(&one.scenario.text).or_default().push(one);
    }
    let coverages = worlds.into_values().filter_map(|files| {
        let scenario = &files.first()?.scenario;
        let failing = files.iter().filter(|one| one.still_fails());
        // Files may be of changed egos, so each has an observer of its own world.
        let episodes: Vec<CoveredEpisode> = failing
            .filter_map(|one| {
                let mut observer = EpisodeObserver::new(&one.scenario);
                observer.observe(&one.episode, EpisodeOrigin::Stored, true)
            })
            .collect();
        Some(Coverage::of(scenario, &episodes))
    });
    coverages.collect()
}

/// Draws the test starts of a run. `None`: stopped.
fn test_starts(
    run: &RunDir,
    scenario: &Scenario,
    drawn: (usize, u64),
    watch: &Watch<'_>,
) -> Result<Option<TestStarts>, EvaluationError> {
    let (count, seed) = drawn;
    let ego = EgoUnderTest::nominal(scenario);
    consent(scenario, std::slice::from_ref(&ego))?;
    // Starts are chosen on the plant of the file, so that all verbs have the same.
    let world = EgoUnderTest::nominal(&run.world()?);
    Ok(TestStarts::stored(
        Some(run.path()),
        &world,
        count,
        seed,
        watch,
    ))
}

/// Plays the ado of a run from every start that is not trivial. `None`: stopped.
fn tries(
    run: &RunDir,
    scenario: &Scenario,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Result<Option<Vec<CoveredEpisode>>, EvaluationError> {
    let policy = run.policy()?;
    let ado = Ado::Trained(&*policy, run.manifest().seed);
    let ego = EgoUnderTest::nominal(scenario);
    Ok(tries_of(&ego, ado, starts, RULED_EPISODES, watch))
}

/// Plays an ado against an ego from every start that is not trivial. `None`: stopped.
///
/// The rules of at most `ruled` episodes are evaluated.
pub fn tries_of(
    ego: &EgoUnderTest,
    ado: Ado<'_>,
    starts: &TestStarts,
    ruled: usize,
    watch: &Watch<'_>,
) -> Option<Vec<CoveredEpisode>> {
    let request = ego.against(ado, starts);
    let open: Vec<usize> = (0..starts.starts.len())
        .filter(|index| !starts.trivial[*index])
        .collect();
    let play = |bench: &mut Testbench, start: &usize, _| Some(request.play(bench, *start));
    let origin = EpisodeOrigin::Drawn;
    observed(ego.scenario(), &open, origin, ruled, watch, play)
}

/// Plays failures that a training stored. `None`: stopped.
fn stored(
    run: &RunDir,
    scenario: &Scenario,
    watch: &Watch<'_>,
) -> Result<Option<Vec<CoveredEpisode>>, EvaluationError> {
    let stored = match run.counterexamples() {
        // A training against a family of egos stores none.
        Err(RunError::NothingStored { .. }) => return Ok(Some(Vec::new())),
        stored => stored?,
    };
    let noise = run.noise_of(&stored)?;
    let all: Vec<_> = stored.all().iter().zip(noise).collect();
    // Failures are in the order of the training, so the first ones are of a weak ado.
    let spread = (0..all.len()).filter(|index| evenly_spread(*index, all.len(), STORED));
    let some: Vec<_> = spread.map(|index| all[index]).collect();
    watch.phase("playing stored failures and trying other actions");
    Ok(observed(
        scenario,
        &some,
        EpisodeOrigin::Stored,
        RULED_EPISODES,
        watch,
        |bench, (success, noise), _| {
            repeated_failure(bench, &success.start, *noise, &success.actions)
        },
    ))
}

/// Plays actions again. `None`: the ego does not fail, as on another plant.
fn repeated_failure(
    bench: &mut Testbench,
    start: &Start,
    noise: u64,
    actions: &[usize],
) -> Option<Episode> {
    let mut replay = Replay::holding(actions);
    let episode = play(bench, start, noise, &mut replay, Aftermath::Play);
    // On another plant a stored failure may not happen again.
    episode.verdict.is_success().then_some(episode)
}
