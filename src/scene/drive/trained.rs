//! Trained ados as traffic: frozen policies that observe as they did at home.
//!
//! A policy knows the signals, scales and actions of the world it was trained
//! in. Here others play the parts it knows: `names` says who, and its signals
//! are worked out from them, derived ones and constants of its own world
//! included.

use std::sync::Arc;

use indexmap::IndexMap;

use super::actions::Actions;
use super::motion::DriveScene;
use super::reading::scaled;
use super::signals::{Of, SignalSource, Source};
use super::spec::DriveSpec;
use crate::rl::Policy;
use crate::scene::Derived;
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};

/// A trained ado and what it knows.
#[derive(Clone)]
pub struct TrainedAdo {
    /// The world it was trained in.
    pub home: Arc<DriveSpec>,
    /// Its name there.
    pub part: String,
    /// What it may choose from.
    pub actions: Actions,
    /// Time constant with which its acceleration follows; 0 is none.
    pub lag_s: f64,
    /// How it chooses.
    pub policy: Arc<dyn Policy>,
    /// Who plays whose part: names at home to names here.
    pub names: IndexMap<String, String>,
}

impl std::fmt::Debug for TrainedAdo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Trained({} of {})", self.part, self.home.world)
    }
}

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

/// Somebody in a world: a road user or a light, by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    Agent(usize),
    Light(usize),
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
    observed: Vec<(usize, f64, f64)>,
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
        let inputs = basic.iter().map(|offer| input(home, here, &parts, offer));
        let inputs = inputs.collect::<Result<Vec<Input>, TrainedError>>()?;
        let signals = basic.iter().map(|offer| offer.signal.clone());
        let signals = signals.chain(derived.iter().map(|derived| derived.signal.clone()));
        let schema = Schema::new(home.clock.sample_s, signals)?;
        let bound = derived
            .iter()
            .map(|derived| derived.expr.bind(&schema, &home.constants));
        let bound = bound.collect::<Result<Vec<BoundExpr>, StlError>>()?;
        let observed = home.observe.iter().filter_map(|observed| {
            let position = schema.position(&observed.name)?;
            Some((position, observed.mid, 1.0 / observed.half))
        });
        Ok(Frozen {
            who: who(here, own).ok_or_else(|| nobody("", own))?,
            actions: self.actions.clone(),
            policy: Arc::clone(&self.policy),
            samples_per_decision: ratio.round() as usize,
            inputs,
            derived: bound,
            observed: observed.collect(),
        })
    }

    /// Who plays each part of its world that somebody plays.
    fn parts(&self, here: &DriveSpec, own: &str) -> Result<Vec<(String, Who)>, TrainedError> {
        let known = names_of(&self.home);
        for (part, name) in &self.names {
            if !known.contains(part) {
                return Err(TrainedError::Stranger {
                    name: part.clone(),
                    known,
                });
            }
            if *part == self.part && name != own {
                return Err(TrainedError::Itself {
                    part: part.clone(),
                    name: name.clone(),
                });
            }
            if who(here, name).is_none() {
                return Err(TrainedError::Unknown {
                    part: part.clone(),
                    name: name.clone(),
                    known: names_of(here),
                });
            }
        }
        let mut parts = Vec::new();
        for part in known {
            let namesake = || if part == self.part { own } else { &part };
            let name = self.names.get(&part).map_or_else(namesake, String::as_str);
            let Some(player) = who(here, name) else {
                continue;
            };
            let is_light = |who: Option<Who>| matches!(who, Some(Who::Light(_)));
            if is_light(who(&self.home, &part)) != is_light(Some(player)) {
                return Err(TrainedError::Kind {
                    name: name.to_owned(),
                    part,
                });
            }
            parts.push((part, player));
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

fn names_of(spec: &DriveSpec) -> Vec<String> {
    let agents = spec.agents.iter().map(|agent| agent.name.clone());
    let lights = spec.lights.iter().map(|light| light.name.clone());
    agents.chain(lights).collect()
}

fn who(spec: &DriveSpec, name: &str) -> Option<Who> {
    let agent = spec.agents.iter().position(|agent| agent.name == name);
    let light = || spec.lights.iter().position(|light| light.name == name);
    agent.map(Who::Agent).or_else(|| light().map(Who::Light))
}

/// What of its world's signals an observation hangs on, in order.
fn needed(home: &DriveSpec) -> (Vec<SignalSource>, Vec<&Derived>) {
    let mut names: Vec<String> = home.observe.iter().map(|o| o.name.clone()).collect();
    let mut derived: Vec<&Derived> = Vec::new();
    for candidate in home.derived.iter().rev() {
        if names.contains(&candidate.signal.name) {
            let mentioned = candidate.expr.signals();
            names.extend(mentioned.iter().map(|name| (*name).to_owned()));
            derived.insert(0, candidate);
        }
    }
    let mut basic = home.catalogue();
    basic.retain(|offer| names.contains(&offer.signal.name));
    (basic, derived)
}

/// The same quantity of those who play the parts here.
fn input(
    home: &DriveSpec,
    here: &DriveSpec,
    parts: &[(String, Who)],
    offer: &SignalSource,
) -> Result<Input, TrainedError> {
    let player = |name: &str| {
        let mut parts = parts.iter();
        let found = parts.find(|(part, _)| part == name);
        found.map(|(_, who)| *who)
    };
    // Invariant: a light plays a light and a road user a road user.
    let agent = |i: usize| match player(&home.agents[i].name) {
        Some(Who::Agent(i)) => Ok(i),
        _ => Err(nobody(&offer.signal.name, &home.agents[i].name)),
    };
    let light = |i: usize| match player(&home.lights[i].name) {
        Some(Who::Light(i)) => Ok(i),
        _ => Err(nobody(&offer.signal.name, &home.lights[i].name)),
    };
    let Source { quantity, whose } = offer.source;
    let [a, b] = whose;
    let whose = match quantity.of {
        Of::Clock | Of::Scene => whose,
        Of::Agent => [agent(a)?, 0],
        Of::Pair => [agent(a)?, agent(b)?],
        Of::Light => [light(a)?, 0],
        Of::AgentAndLight => [agent(a)?, light(b)?],
    };
    let source = Source { quantity, whose };
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
    pub(super) fn act(&self, scene: &DriveScene) -> Option<usize> {
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
        scaled(&row, &self.observed, &mut obs);
        Some(self.policy.act(&obs))
    }
}

impl Input {
    fn value(self, scene: &DriveScene) -> f64 {
        match self {
            Input::Here(source) => source.value(scene),
            Input::TimeLeft { source, horizon_s } => source.value(scene).min(horizon_s),
            Input::Time { source, later_s } => (source.value(scene) - later_s).max(0.0),
        }
    }
}
