//! Kinds of ados: the trained ado, and the baselines that it must beat.

use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::ado::Ado;
use super::error::AdversaryError;
use super::threshold_rule::{Heuristic, tune_heuristic};
use crate::experiment::Watch;
use crate::run_dir::{RunDir, Stored};
use crate::world::{Scenario, ScenarioKind, TrainingEgos};

/// Stored counterexamples replayed per start: one row for each number.
const REPLAYS: [usize; 2] = [1, 10];

/// Kind of ado in an evaluation.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr, EnumMessage,
)]
#[strum(serialize_all = "kebab-case")]
pub enum AdoKind {
    /// The trained policy.
    Trained,
    /// The trained policy without each of its ados in turn, in worlds with several.
    Without,
    /// A random action at each decision.
    Random,
    /// A random action, held for five decisions.
    Hold,
    /// The best of the constant actions.
    Constant,
    /// Accelerates for some time, then brakes: the best of six.
    Switch,
    /// A rule with three zones, tuned on the nominal ego.
    Heuristic,
    /// The nearest training counterexample, replayed; then the ten nearest.
    Replays,
    /// An ado trained anew for each changed ego, kept under RUN/retrained.
    Retrained,
    /// The exact solution of a grid world.
    Optimal,
    /// A step towards the ego along the larger axis (grid worlds).
    Chaser,
    /// All of them that apply; `retrained` takes a training per changed ego.
    All,
}

impl AdoKind {
    /// Returns the kinds that apply to a world, in the order of its rows.
    fn all(world: &Scenario) -> Vec<AdoKind> {
        use AdoKind::{
            Chaser, Constant, Heuristic, Hold, Optimal, Random, Replays, Retrained, Switch,
            Trained, Without,
        };
        let mut all = vec![Trained, Without, Hold, Random, Constant];
        all.extend(match world.kind() {
            ScenarioKind::Grid(_) => [Optimal, Chaser].as_slice(),
            ScenarioKind::Drive(_) => &[Switch, Heuristic, Replays, Retrained],
        });
        all
    }
}

/// Baselines of a run, made once for all egos of an evaluation.
#[derive(Debug)]
pub struct Baselines {
    /// Kinds of ados, in the order of the rows.
    pub ados: Vec<AdoKind>,
    heuristic: Option<Heuristic>,
    stored: Option<Stored>,
}

impl Baselines {
    /// Makes the baselines that `requested` needs.
    ///
    /// The heuristic is tuned on the run's training starts, and the run's
    /// counterexamples are read.
    pub fn of(
        requested: &[AdoKind],
        run: &RunDir,
        nominal: &Scenario,
        watch: &Watch<'_>,
    ) -> Result<Baselines, AdversaryError> {
        let all = requested.contains(&AdoKind::All);
        let ados = if all {
            AdoKind::all(nominal)
        } else {
            requested.to_vec()
        };
        let heuristic = if ados.contains(&AdoKind::Heuristic) {
            tuned(run, nominal, watch)?
        } else {
            None
        };
        // Only a training against one ego stores counterexamples.
        let stores = run.manifest().against == TrainingEgos::Nominal;
        let replays =
            ados.contains(&AdoKind::Replays) && (stores || requested.contains(&AdoKind::Replays));
        Ok(Baselines {
            ados,
            heuristic,
            stored: replays.then(|| run.counterexamples()).transpose()?,
        })
    }

    /// Returns the ados of a kind that needs no policy: none, one or several.
    pub fn made(&self, kind: AdoKind) -> Vec<Ado<'_>> {
        match kind {
            AdoKind::Random => vec![Ado::Random],
            AdoKind::Hold => vec![Ado::Held],
            AdoKind::Heuristic => self.heuristic.iter().map(Ado::Heuristic).collect(),
            AdoKind::Replays => {
                let stored = self.stored.iter();
                stored
                    .flat_map(|stored| REPLAYS.map(|nearest| Ado::Replays(stored, nearest)))
                    .collect()
            }
            _ => Vec::new(),
        }
    }
}

fn tuned(
    run: &RunDir,
    nominal: &Scenario,
    watch: &Watch<'_>,
) -> Result<Option<Heuristic>, AdversaryError> {
    let heuristic = tune_heuristic(nominal, run.manifest().seed, watch);
    match &heuristic {
        Some(heuristic) => watch.note(&format!(
            "tuned the heuristic in {:.1} s of processor time: it solves {:.0} % of its training starts",
            heuristic.cost.cpu_s,
            100.0 * heuristic.successes
        )),
        None if watch.stopped() => {}
        None => {
            return Err(AdversaryError::NothingObserved {
                world: nominal.name.clone(),
            });
        }
    }
    Ok(heuristic)
}
