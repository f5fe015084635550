//! The action sequence from one start that does something most.

use crate::experiment::{EpisodeLoop, Watch};
use crate::scene::Start;
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, Episode, Replay, Testbench};
use crate::world::Scenario;

/// Sequences that are tried on the world's own plant at most.
const MAX_CONFIRMED: usize = 50;

/// Of all sequences with at most `switches` changes of action, the one whose
/// episode scores highest; `None` scores are out of the question.
///
/// Sequences are ranked on the kinematic plant and the first that also scores
/// on the world's own plant is taken. Ties go to the sequence with fewer
/// switches, then to the lower actions and earlier switches. `None`: no
/// sequence scores, or stopped.
pub fn extreme(
    scenario: &Scenario,
    (start, noise): (&Start, u64),
    switches: usize,
    score: impl Fn(&Episode) -> Option<f64> + Sync,
    watch: &Watch<'_>,
) -> Option<Episode> {
    let cheap = scenario.on(PlantKind::Kinematic);
    let space = cheap.world().spaces().actions;
    let sequences = sequences(space, cheap.bench().clock().decisions(), switches);
    let act = |bench: &mut Testbench, actions: &[usize]| {
        let mut ado = Replay::holding(actions);
        watch.play(bench, (start, noise), 0, &mut ado, Aftermath::Play)
    };
    let all = EpisodeLoop::uncounted(watch);
    let scored = all.run(
        &sequences,
        || cheap.bench(),
        |bench, actions, turn| Some((score(&act(bench, actions))?, turn.index)),
    );
    let mut ranked: Vec<(f64, usize)> = scored.into_iter().flatten().collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut bench = scenario.bench();
    let tried = ranked.into_iter().take(MAX_CONFIRMED);
    let mut played = tried.map(|(_, nth)| act(&mut bench, &sequences[nth]));
    played.find(|episode| !watch.stopped() && score(episode).is_some())
}

/// All sequences with at most so many switches, fewest first.
fn sequences(actions: usize, decisions: usize, switches: usize) -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = (0..actions).map(|a| vec![a; decisions]).collect();
    let mut last: Vec<(usize, Vec<usize>)> = all.iter().map(|s| (0, s.clone())).collect();
    for _ in 0..switches {
        let mut next = Vec::new();
        for (from, sequence) in &last {
            for at in from + 1..decisions {
                for other in (0..actions).filter(|a| *a != sequence[at]) {
                    let mut longer = sequence.clone();
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
