//! Worlds to train the traffic of a risk in.

use super::action_law::{AdoLaw, FittedLaw, LawKind, MarkovLaw};
use super::traffic::RiskTraffic;
use crate::rl::{LawFactor, LawOnset, TrafficLaw, TrafficSettings};
use crate::ron_file::{LoadError, ScenarioError};
use crate::scene::drive::DriveSpec;
use crate::world::{LawSignal, Scenario};

/// Error: the ados of a world cannot be trained as traffic.
#[derive(Debug, thiserror::Error)]
pub enum TrafficTrainingError {
    /// Ado without a body, of whose last action no signal exists.
    #[error("the ado `{ado}` is no road user, and only road users are trained as traffic")]
    Bodiless {
        /// Name of the ado.
        ado: String,
    },
    /// Decisions that are shorter than those of a fitted model.
    #[error("the model of traffic holds an action of `{ado}` for {decisions} decisions")]
    Held {
        /// Name of the ado.
        ado: String,
        /// Number of decisions.
        decisions: usize,
    },
    /// World that does not observe the signals of the law.
    #[error(transparent)]
    World(#[from] LoadError),
}

impl TrafficTrainingError {
    /// Returns the fix. `None`: the wrapped error has its own.
    pub fn help(&self) -> Option<&'static str> {
        match self {
            TrafficTrainingError::Bodiless { .. } => Some(
                "leave `--traffic` out, or make the ado a part of the world that acts by itself",
            ),
            TrafficTrainingError::Held { .. } => {
                Some("declare a `Markov` law, or set `decision_s: 0.5` in the world")
            }
            TrafficTrainingError::World(_) => None,
        }
    }
}

impl RiskTraffic {
    /// Returns a world whose ados are trained as this traffic, given that the ego fails.
    ///
    /// The learner of the world is [`TrafficSettings`] with the law of this traffic.
    /// `settings` has everything else.
    ///
    /// # Errors
    /// An ado is no road user, or its law holds actions over several decisions.
    pub fn training_world(
        &self,
        world: &Scenario,
        settings: TrafficSettings,
    ) -> Result<Scenario, TrafficTrainingError> {
        let mut signals = Signals::default();
        let mut factors = Vec::new();
        for ado in &self.actions.ados {
            if let Some(driving) = world.drive()
                && !is_road_user(driving.spec(), &ado.name)
            {
                let ado = ado.name.clone();
                return Err(TrafficTrainingError::Bodiless { ado });
            }
            factors.extend(signals.factors_of(ado)?);
        }
        let decision_s = world.world().clock().decision_s;
        let learner = |positions: &[usize]| {
            for factor in &mut factors {
                // Factors have numbers of signals until the schema of the world gives
                // these their positions.
                let at = |signal: &mut usize| *signal = positions[*signal];
                at(&mut factor.last);
                factor.before.iter_mut().for_each(at);
                factor
                    .onsets
                    .iter_mut()
                    .for_each(|onset| at(&mut onset.rate));
            }
            TrafficSettings {
                law: TrafficLaw {
                    decision_s,
                    factors: std::mem::take(&mut factors),
                },
                ..settings
            }
        };
        let trained = world.learning_in_traffic(&self.file, &signals.0, learner);
        Ok(trained.map_err(|error: ScenarioError| LoadError::Scenario(Box::new(error)))?)
    }
}

fn is_road_user(spec: &DriveSpec, name: &str) -> bool {
    let mut agents = spec.agents.iter();
    agents.any(|agent| agent.name == name && agent.actions().is_some())
}

/// Signals that a law reads, in the order of their positions.
#[derive(Default)]
struct Signals(Vec<LawSignal>);

impl Signals {
    /// Adds a signal and returns its number.
    fn add(&mut self, name: String, expr: String, about: String) -> usize {
        self.0.push(LawSignal { name, expr, about });
        self.0.len() - 1
    }

    fn action(&mut self, ado: &str, which: &str, about: &str) -> usize {
        let name = format!("traffic.{ado}.{which}");
        let about = format!("number of the {about} of {ado}, for the law of the traffic");
        self.add(name, format!("{ado}.{which}"), about)
    }

    fn factors_of(&mut self, ado: &AdoLaw) -> Result<Vec<LawFactor>, TrafficTrainingError> {
        let last = self.action(&ado.name, "action", "last action");
        match &ado.kind {
            LawKind::Markov(law) => Ok(vec![self.markov(&ado.name, law, last, 1)]),
            LawKind::Fitted(law) if law.hold > 1 => Err(TrafficTrainingError::Held {
                ado: ado.name.clone(),
                decisions: law.hold,
            }),
            LawKind::Fitted(law) => {
                let before = self.action(&ado.name, "action_before", "action before the last one");
                let along = fitted(law, last, before);
                // The lateral move is the higher digit of an action.
                let unit = along.actions;
                let lateral = law.lateral.as_ref();
                let aside = lateral.map(|law| self.markov(&ado.name, law, last, unit));
                Ok(std::iter::once(along).chain(aside).collect())
            }
        }
    }

    fn markov(&mut self, ado: &str, law: &MarkovLaw, last: usize, unit: usize) -> LawFactor {
        let onsets = law.onsets.iter().enumerate().map(|(at, onset)| LawOnset {
            rate: self.add(
                format!("traffic.{ado}.rate_{at}"),
                onset.text.clone(),
                format!("rate per second of onset {at} of {ado}, for the law of the traffic"),
            ),
            to: onset.to.clone(),
        });
        LawFactor {
            actions: law.transitions.len(),
            unit,
            last,
            before: None,
            onsets: onsets.collect(),
            transitions: law.transitions.clone(),
        }
    }
}

/// Returns the law of accelerations as a table over the last two.
fn fitted(law: &FittedLaw, last: usize, before: usize) -> LawFactor {
    let n = law.accelerations_mps2.len();
    LawFactor {
        actions: n,
        unit: 1,
        last,
        before: Some(before),
        transitions: (0..n * n)
            // A row is numbered by the earlier action first, as the learner reads it.
            .map(|row| law.along([row / n, row % n]))
            .collect(),
        onsets: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, world};
    use super::*;
    use crate::testbench::Aftermath;

    /// The law that a policy reads from an observation is that of the risk.
    #[test]
    fn a_trained_ado_reads_the_law_of_the_risk_at_every_decision() {
        let world = world();
        for traffic in [
            RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound"),
            RiskTraffic::read(&world, "motorway").expect("shipped"),
        ] {
            let training = traffic
                .training_world(&world, TrafficSettings::default())
                .expect("road users");
            let law = &training.learner().as_traffic().expect("traffic").law;
            let mut bench = training.bench();
            let start = crate::scene::Start(vec![45.0]);
            bench.begin(&start, 7, Aftermath::Skip);
            let mut memory = traffic.actions.begin();
            let mut obs = vec![0.0; training.spaces().observation];
            let mut own_bench = world.bench();
            own_bench.begin(&start, 7, Aftermath::Skip);
            for action in [1, 0, 0, 1, 0] {
                if bench.is_done() {
                    break;
                }
                bench.observe(&mut obs);
                let mut read = Vec::new();
                law.probabilities(&obs, training.spaces().actions, &mut read);
                let mut row = vec![0.0; own_bench.schema().len()];
                let trace = own_bench.trace();
                trace.read_row(trace.len() - 1, &mut row);
                let exact = traffic.actions.probabilities(&row, &memory);
                for (a, b) in read.iter().zip(&exact) {
                    assert!((a - b).abs() < 1e-6, "{read:?} {exact:?}");
                }
                traffic.actions.note(&mut memory, action);
                bench.decide(action);
                own_bench.decide(action);
            }
            // The world is a file as any other.
            let again = Scenario::parse("acc.ron", training.text()).expect("sound");
            assert_eq!(again.learner(), training.learner());
            assert_eq!(again.spaces(), training.spaces());
            let laws = RiskTraffic::of_world(&again)
                .expect("sound")
                .expect("declared");
            assert_eq!(laws.exposure, traffic.exposure);
        }
    }
}
