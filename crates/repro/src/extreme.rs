//! Action sequence from a start that maximizes a score.

use brakecheck::experiment::Watch;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Episode, NoisyStart, Replay, Testbench};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_experiment::experiment::episode_loop::EpisodeLoop;

/// Largest number of sequences tried on the world's own plant.
const MAX_CONFIRMED: usize = 50;

/// Returns the episode with the highest score among short sequences.
///
/// All sequences with at most `switches` switches are tried. A score of `None` excludes an
/// episode.
/// Sequences are ranked on the kinematic plant, and the first with a score on the world's
/// own plant is taken. Ties go to fewer switches, then to lower actions and earlier switches.
/// `None`: no sequence has a score, or stopped.
pub(crate) fn extreme(
    scenario: &Scenario,
    start: &Start,
    noise: u64,
    switches: usize,
    score: impl Fn(&Episode) -> Option<f64> + Sync,
    watch: &Watch<'_>,
) -> Option<Episode> {
    let cheap = scenario.on(PlantKind::Kinematic);
    let space = cheap.world().spaces().actions;
    let sequences = sequences(space, cheap.bench().clock().decisions(), switches);
    let act = |bench: &mut Testbench, actions: &[usize]| {
        let mut ado = Replay::holding(actions);
        let from = NoisyStart { start, noise };
        watch.play(bench, from, 0, &mut ado, Aftermath::Play)
    };
    let all = EpisodeLoop::uncounted(watch);
    let scored = all.each(
        &sequences,
        || cheap.bench(),
        |bench, actions, nth| Some((score(&act(bench, actions))?, nth)),
    );
    let mut ranked: Vec<(f64, usize)> = scored.into_iter().flatten().collect();
    // The position breaks ties, so the result does not depend on the threads.
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut bench = scenario.bench();
    let tried = ranked.into_iter().take(MAX_CONFIRMED);
    // The iterator is lazy, so the slow plant plays only up to the first success.
    let mut played = tried.map(|(_, nth)| act(&mut bench, &sequences[nth]));
    // A stopped episode has no valid score.
    played.find(|episode| !watch.stopped() && score(episode).is_some())
}

/// Returns all sequences with at most `switches` switches, fewest first.
fn sequences(actions: usize, decisions: usize, switches: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = (0..actions).map(|a| vec![a; decisions]).collect();
    // Position 0 means that nothing has switched, so the first switch is at decision 1.
    let mut last: Vec<(usize, Vec<usize>)> = all.iter().map(|s| (0, s.clone())).collect();
    for _ in 0..switches {
        let mut next = Vec::new();
        for (from, sequence) in &last {
            // Later switches only, so each sequence is generated once.
            for at in from + 1..decisions {
                for other in (0..actions).filter(|a| *a != sequence[at]) {
                    let mut longer = sequence.clone();
                    // The new action lasts to the end, where a later switch may replace it.
                    longer[at..].fill(other);
                    next.push((at, longer));
                }
            }
        }
        all.extend(next.iter().map(|(_, sequence)| sequence.clone()));
        last = next;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sequence_with_so_many_switches_comes_once() {
        let all = sequences(3, 6, 2);
        let switches = |s: &[usize]| s.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let unique: std::collections::HashSet<&Vec<usize>> = all.iter().collect();
        assert_eq!(unique.len(), all.len());
        let count = |n| all.iter().filter(|s| switches(s) == n).count();
        assert_eq!((count(0), count(1), count(2)), (3, 3 * 2 * 5, 3 * 4 * 10));
        assert_eq!(count(0) + count(1) + count(2), all.len());
    }
}
