//! Traces of an ego in natural traffic, for measures other than its failures.

use std::ops::Range;

use super::mixture::Mixture;
use super::record::RunEnd;
use super::run::{EpisodeSource, Order, RiskWorld};
use super::traffic::RiskTraffic;
use crate::experiment::{EpisodeLoop, Watch};
use crate::trace::Trace;
use crate::world::Scenario;

/// Batch of these runs, by which their draws differ from those of a risk.
const STAGE: u64 = u64::MAX - 1;

/// Natural run of an ego.
#[derive(Clone, Copy, Debug)]
pub struct NaturalRun<'a> {
    /// Samples, up to the failure if the ego fails.
    pub trace: &'a Trace,
    /// True if the ego fails, whatever the rules.
    pub fails: bool,
}

impl RiskTraffic {
    /// Plays natural runs, and returns what `measure` makes of each, in order.
    ///
    /// `ego` is the world of the traffic, with any ego. Runs of equal seed and index have
    /// the same start, noise and random numbers for every ego.
    ///
    /// A result is `None` if the start is outside the world's ranges, if the ego or the
    /// physics failed, or after a stop. Faults are noted in the log of `watch`.
    pub fn natural_runs<R: Send>(
        &self,
        ego: &Scenario,
        seed: u64,
        which: Range<usize>,
        watch: &Watch<'_>,
        measure: impl Fn(NaturalRun<'_>) -> R + Sync + Send,
    ) -> Vec<Option<R>> {
        let world = RiskWorld::new(ego, self.starts.clone(), self.actions.clone());
        let mixture = Mixture::natural(self.starts.dimensions());
        let indices: Vec<usize> = which.collect();
        let bench = || world.scenario.bench();
        EpisodeLoop::uncounted(watch).each(&indices, bench, |bench, index, _| {
            let order = Order {
                seed,
                stage: STAGE,
                index: *index as u64,
                // The only component of a natural mixture.
                source: EpisodeSource::Component(0),
                // Measures read motions only, so neither rules nor drivers are judged.
                judge_held: false,
                prevent: false,
            };
            let (run, failed) = world.play_recorded(bench, &mixture, &order);
            watch.faults.note(order.index, run.fault());
            match (run.end, failed) {
                (RunEnd::Held { .. }, _) => Some(measure(NaturalRun {
                    trace: bench.trace(),
                    fails: false,
                })),
                (RunEnd::Failed(_), Some(episode)) => {
                    // Driving after the failure is no driving in traffic.
                    let mut judged = episode.trace;
                    judged.truncate(episode.judged);
                    let fails = true;
                    Some(measure(NaturalRun {
                        trace: &judged,
                        fails,
                    }))
                }
                _ => None,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, reckless, world};
    use super::*;

    #[test]
    fn equal_indices_have_equal_draws_for_every_ego() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let watch = Watch::unwatched();
        let first = |run: NaturalRun<'_>| {
            let column = |name: &str| run.trace.signal(name).expect("published").to_vec();
            (column("headway")[0], column("ado.speed"), run.fails)
        };
        let runs = |ego: &Scenario, which| traffic.natural_runs(ego, 3, which, &watch, first);
        let own = runs(&world, 0..40);
        assert!(own.iter().all(Option::is_some));
        assert_eq!(runs(&world, 30..40), own[30..]);
        let other = reckless(&world, false);
        let others = runs(other.scenario(), 0..40);
        let pairs = own.iter().flatten().zip(others.iter().flatten());
        for ((headway_m, speeds, _), (other_m, other_speeds, _)) in pairs {
            assert_eq!(headway_m, other_m);
            // A contact changes the speed in the last sample.
            let known = speeds.len().min(other_speeds.len()) - 1;
            assert_eq!(speeds[..known], other_speeds[..known]);
        }
        let failing = |all: &[Option<(f64, Vec<f64>, bool)>]| {
            all.iter().flatten().filter(|(_, _, fails)| *fails).count()
        };
        assert!(failing(&own) < failing(&others), "{}", failing(&others));
    }
}
