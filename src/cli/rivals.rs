//! What a trained ado has to beat, made from the same run.

use super::{Failure, talk};
use crate::campaign::{Ado, Heuristic, Watch, tune_heuristic};
use crate::run::{RunDir, Stored};
use crate::scenario::Scenario;

/// Stored counterexamples replayed per start: one row for each number.
const REPLAYS: [usize; 2] = [1, 10];

/// A rule tuned on the nominal ego, and the training's counterexamples.
#[derive(Default)]
pub(super) struct Rivals {
    heuristic: Option<Heuristic>,
    stored: Option<Stored>,
}

impl Rivals {
    /// Tunes the heuristic, once for all egos, on the run's training starts.
    pub fn tune(
        &mut self,
        run: &RunDir,
        nominal: &Scenario,
        watch: &Watch<'_>,
    ) -> Result<(), Failure> {
        self.heuristic = tune_heuristic(nominal, run.manifest().seed, watch);
        match &self.heuristic {
            Some(heuristic) => talk::say(&format!(
                "tuned the heuristic in {:.1} s of processor time: it solves {:.0} % of its training starts",
                heuristic.cost.cpu_s,
                100.0 * heuristic.successes
            )),
            None if watch.stopped() => {}
            None => {
                return Err(Failure::input(
                    format!("the ado in `{}` observes nothing", nominal.name),
                    "a heuristic reads one observed signal: leave out `--ado heuristic`",
                ));
            }
        }
        Ok(())
    }

    /// Reads the run's counterexamples.
    pub fn read(&mut self, run: &RunDir) -> Result<(), Failure> {
        self.stored = Some(run.counterexamples()?);
        Ok(())
    }

    /// The tuned rule as an ado.
    pub fn heuristic(&self) -> Vec<Ado<'_>> {
        self.heuristic.iter().map(Ado::Heuristic).collect()
    }

    /// The replays as ados.
    pub fn replays(&self) -> Vec<Ado<'_>> {
        let stored = self.stored.iter();
        stored
            .flat_map(|stored| REPLAYS.map(|nearest| Ado::Replays(stored, nearest)))
            .collect()
    }
}
