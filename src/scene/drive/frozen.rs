//! TrainedAdo ados bound to the world they act in.
//!
//! Whatever a policy observed at home is worked out here from those who play
//! the parts it knows.

use std::sync::Arc;

use super::actions::Actions;
use super::names::Who;
use super::observing::Observation;
use super::signals::{Declared, Of, Source, declared};
use super::spec::DriveSpec;
use super::state::SceneState;
use super::trained::{TrainedAdo, TrainingWorld};
use crate::rl::Policy;
use crate::scene::Derived;
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};

/// A trained ado that cannot act in a world.
#[derive(Debug, thiserror::Error)]
pub enum TrainedError {
    /// It decides between two samples.
    #[error("it decides every {decision_s} s, which is no multiple of `sample_s` = {sample_s} s")]
    Period {
        /// Time between its decisions.
        decision_s: f64,
        /// Time between samples here.
        sample_s: f64,
    },
    /// Nobody plays a part that it observes.
    #[error("it observes `{signal}`, but nobody here is `{name}`")]
    Nobody {
        /// The signal at home.
        signal: String,
        /// The part.
        name: String,
    },
    /// A part that its world does not have.
    #[error("its world has no `{name}`")]
    Stranger {
        /// What was written.
        name: String,
        /// Who there is.
        known: Vec<String>,
    },
    /// A part given to somebody who is not here.
    #[error("nobody here is called `{name}`")]
    Unknown {
        /// The part.
        part: String,
        /// What was written.
        name: String,
        /// Who there is.
        known: Vec<String>,
    },
    /// A light for a road user, or the other way round.
    #[error("`{name}` cannot play `{part}`: one is a traffic light, the other a road user")]
    Kind {
        /// The part.
        part: String,
        /// Who should play it.
        name: String,
    },
    /// Its own part given to somebody else.
    #[error("it plays `{part}` itself, not `{name}`")]
    Itself {
        /// Its own part.
        part: String,
        /// What was written.
        name: String,
    },
    /// Its signals clash.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A derived signal of its world does not bind.
    #[error(transparent)]
    Derived(#[from] StlError),
}

/// A trained ado bound to the world it acts in.
#[derive(Clone)]
pub(super) struct Frozen {
    pub(super) who: Who,
    pub(super) actions: Actions,
    policy: Arc<dyn Policy>,
    samples_per_decision: usize,
    inputs: Vec<Input>,
    derived: Vec<BoundExpr>,
    observed: Observation,
}

/// A basic signal of its own world, worked out here.
#[derive(Clone, Copy)]
enum Input {
    Here(Source),
    /// Times count as if its own episode ended with this one.
    TimeLeft {
        source: Source,
        horizon_s: f64,
    },
    Time {
        source: Source,
        later_s: f64,
    },
}

impl TrainedAdo {
    /// Whether it can act in a world as the agent or light `own` of it.
    ///
    /// # Errors
    /// A part nobody plays, or one that does not fit; other decision times.
    pub fn fits(&self, here: &DriveSpec, own: &str) -> Result<(), TrainedError> {
        self.bind(here, own).map(|_| ())
    }

    pub(super) fn bind(&self, here: &DriveSpec, own: &str) -> Result<Frozen, TrainedError> {
        let home = &*self.home;
        let (decision_s, sample_s) = (home.clock.decision_s, here.clock.sample_s);
        let ratio = decision_s / sample_s;
        if ratio.round() < 1.0 || 1e-6 < (ratio - ratio.round()).abs() {
            return Err(TrainedError::Period {
                decision_s,
                sample_s,
            });
        }
        let parts = self.parts(here, own)?;
        let (basic, derived) = needed(home);
        let inputs = basic.iter().map(|needed| input(home, here, &parts, needed));
        let inputs = inputs.collect::<Result<Vec<Input>, TrainedError>>()?;
        let signals = basic.iter().map(|needed| needed.signal.clone());
        let signals = signals.chain(derived.iter().map(|derived| derived.signal.clone()));
        let schema = Schema::new(home.clock.sample_s, signals)?;
        let bound = derived
            .iter()
            .map(|derived| derived.expr.bind(&schema, &home.constants));
        let bound = bound.collect::<Result<Vec<BoundExpr>, StlError>>()?;
        // Invariant: its own world was assembled, so it publishes them.
        let observed = Observation::bind(&home.observe, &schema);
        let observed = observed.map_err(|name| nobody(name, &home.world))?;
        Ok(Frozen {
            who: here.names().who(own).ok_or_else(|| nobody("", own))?,
            actions: self.actions.clone(),
            policy: Arc::clone(&self.policy),
            samples_per_decision: ratio.round() as usize,
            inputs,
            derived: bound,
            observed,
        })
    }

    /// Who plays each part of its world that somebody plays.
    fn parts(&self, here: &DriveSpec, own: &str) -> Result<Vec<(String, Who)>, TrainedError> {
        let (home, here) = (&self.home.names, here.names());
        for (part, name) in &self.names {
            if home.who(part).is_none() {
                return Err(TrainedError::Stranger {
                    name: part.clone(),
                    known: home.all().cloned().collect(),
                });
            }
            if *part == self.part && name != own {
                return Err(TrainedError::Itself {
                    part: part.clone(),
                    name: name.clone(),
                });
            }
            if here.who(name).is_none() {
                return Err(TrainedError::Unknown {
                    part: part.clone(),
                    name: name.clone(),
                    known: here.all().cloned().collect(),
                });
            }
        }
        let mut parts = Vec::new();
        for part in home.all() {
            let namesake = || if *part == self.part { own } else { part };
            let name = self.names.get(part).map_or_else(namesake, String::as_str);
            let Some(player) = here.who(name) else {
                continue;
            };
            let is_light = |who: Option<Who>| matches!(who, Some(Who::Light(_)));
            if is_light(home.who(part)) != is_light(Some(player)) {
                return Err(TrainedError::Kind {
                    part: part.clone(),
                    name: name.to_owned(),
                });
            }
            parts.push((part.clone(), player));
        }
        Ok(parts)
    }
}

fn nobody(signal: &str, name: &str) -> TrainedError {
    TrainedError::Nobody {
        signal: signal.to_owned(),
        name: name.to_owned(),
    }
}

/// What of its world's signals an observation hangs on, in order.
fn needed(home: &TrainingWorld) -> (Vec<Declared>, Vec<&Derived>) {
    let mut names: Vec<String> = home.observe.iter().map(|o| o.name.clone()).collect();
    let mut derived: Vec<&Derived> = Vec::new();
    for candidate in home.derived.iter().rev() {
        if names.contains(&candidate.signal.name) {
            let mentioned = candidate.expr.signals();
            names.extend(mentioned.iter().map(|name| (*name).to_owned()));
            derived.insert(0, candidate);
        }
    }
    let mut basic = declared(&home.names);
    basic.retain(|declared| names.contains(&declared.signal.name));
    (basic, derived)
}

/// The same quantity of those who play the parts here.
fn input(
    home: &TrainingWorld,
    here: &DriveSpec,
    parts: &[(String, Who)],
    needed: &Declared,
) -> Result<Input, TrainedError> {
    let player = |name: &str| {
        let mut parts = parts.iter();
        let found = parts.find(|(part, _)| part == name);
        found.map(|(_, who)| *who)
    };
    // Invariant: a light plays a light and a road user a road user.
    let agent = |i: usize| match player(&home.names.agents[i]) {
        Some(Who::Agent(i)) => Ok(i),
        _ => Err(nobody(&needed.signal.name, &home.names.agents[i])),
    };
    let light = |i: usize| match player(&home.names.lights[i]) {
        Some(Who::Light(i)) => Ok(i),
        _ => Err(nobody(&needed.signal.name, &home.names.lights[i])),
    };
    let Source { quantity, whose } = needed.source;
    let [a, b] = whose;
    let whose = match quantity.of {
        Of::Clock | Of::Scene => whose,
        Of::Parameter => {
            let name = &home.names.parameters[a];
            let number = here.parameters.get_index_of(name);
            [number.ok_or_else(|| nobody(&needed.signal.name, name))?, 0]
        }
        Of::Agent => [agent(a)?, 0],
        Of::Pair => [agent(a)?, agent(b)?],
        Of::Light => [light(a)?, 0],
        Of::AgentAndLight => [agent(a)?, light(b)?],
    };
    let source = Source { quantity, whose };
    if !source.exists(here) {
        return Err(nobody(&needed.signal.name, &home.world));
    }
    Ok(match (quantity.of, quantity.name) {
        (Of::Clock, "time") => Input::Time {
            source,
            later_s: here.clock.horizon_s - home.clock.horizon_s,
        },
        (Of::Clock, "time_left") => Input::TimeLeft {
            source,
            horizon_s: home.clock.horizon_s,
        },
        _ => Input::Here(source),
    })
}

impl Frozen {
    /// What it does at a sample, if it decides there.
    pub(super) fn act(&self, scene: &SceneState) -> Option<usize> {
        if !scene.sample.is_multiple_of(self.samples_per_decision) {
            return None;
        }
        let inputs = self.inputs.iter().map(|input| input.value(scene));
        let mut row: Vec<f64> = inputs.collect();
        let basic = row.len();
        row.resize(basic + self.derived.len(), 0.0);
        for (i, expr) in self.derived.iter().enumerate() {
            row[basic + i] = expr.eval(&row);
        }
        let mut obs = vec![0.0; self.observed.len()];
        self.observed.read(&row, &mut obs);
        Some(self.policy.act(&obs))
    }
}

impl Input {
    fn value(self, scene: &SceneState) -> f64 {
        match self {
            Input::Here(source) => source.value(scene),
            Input::TimeLeft { source, horizon_s } => source.value(scene).min(horizon_s),
            Input::Time { source, later_s } => (source.value(scene) - later_s).max(0.0),
        }
    }
}
