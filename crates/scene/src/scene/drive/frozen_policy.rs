//! Trained ados bound to the world in which they act.
//!
//! The signals that a policy observed in its training world are computed here
//! from the agents that take the corresponding parts.

use std::sync::Arc;

use indexmap::IndexMap;
use rand::RngExt;

use super::actions::Actions;
use super::names::SignalOwner;
use super::observing::Observation;
use super::signals::{DeclaredSignal, Of, SignalReading, declared};
use super::spec::DriveSpec;
use super::state::SceneState;
use super::trained::{TrainedAdo, TrainingWorld};
use crate::rl::Policy;
use crate::scene::Derived;
use crate::seed;
use crate::stl::{BoundExpr, StlError};
use crate::trace::{Schema, SchemaError};

/// Error: a trained ado cannot act in a world.
#[derive(Debug, thiserror::Error)]
pub enum TrainedError {
    /// Its decisions would fall between two samples.
    #[error("it decides every {decision_s} s, which is no multiple of `sample_s` = {sample_s} s")]
    Period {
        /// Time between its decisions.
        decision_s: f64,
        /// Time between samples in this world.
        sample_s: f64,
    },
    /// No agent takes a part that it observes.
    #[error("it observes `{signal}`, but no agent here is `{name}`")]
    UnknownAgent {
        /// Signal in the training world.
        signal: String,
        /// Name of the part.
        name: String,
    },
    /// A mapped part does not exist in the training world.
    #[error("its world has no `{name}`")]
    Stranger {
        /// Name in the file.
        name: String,
        /// Names in the training world.
        known: Vec<String>,
    },
    /// A part is mapped to an unknown agent.
    #[error("no agent here is called `{name}`")]
    Unknown {
        /// The part.
        part: String,
        /// Name in the file.
        name: String,
        /// Names in this world.
        known: Vec<String>,
    },
    /// A light is mapped to a road user, or a road user to a light.
    #[error("`{name}` cannot play `{part}`: one is a traffic light, the other a road user")]
    Kind {
        /// The part.
        part: String,
        /// Agent mapped to the part.
        name: String,
    },
    /// Its own part is mapped to a different agent.
    #[error("it plays `{part}` itself, not `{name}`")]
    Itself {
        /// Its own part.
        part: String,
        /// Name in the file.
        name: String,
    },
    /// Its signals clash.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// A derived signal of its world does not bind.
    #[error(transparent)]
    Derived(#[from] StlError),
}

/// A trained ado bound to the world in which it acts.
#[derive(Clone)]
pub(super) struct Frozen {
    pub(super) who: SignalOwner,
    pub(super) actions: Actions,
    policy: Arc<dyn Policy>,
    samples_per_decision: usize,
    temperature: Option<f64>,
    pub(super) neutral: usize,
    idle: bool,
    inputs: Vec<Input>,
    derived: Vec<BoundExpr>,
    observed: Observation,
}

/// A basic signal of the training world, computed in this world.
#[derive(Clone, Copy)]
enum Input {
    Here(SignalReading),
    /// Remaining time, capped at the horizon of the training world.
    TimeLeft {
        source: SignalReading,
        horizon_s: f64,
    },
    Time {
        source: SignalReading,
        later_s: f64,
    },
}

impl TrainedAdo {
    /// Checks that it can act in a world as the agent or light `own`.
    ///
    /// # Errors
    /// A part is missing or of the wrong kind, or the decision times do not match.
    pub fn fits(&self, here: &DriveSpec, own: &str) -> Result<(), TrainedError> {
        self.bind(here, own).map(|_| ())
    }

    /// Returns the names in a world of those basic signals that are `needed`.
    ///
    /// Keys are names in the training world. Other names than those of basic signals are
    /// left out.
    ///
    /// # Errors
    /// A part is missing or of the wrong kind.
    pub fn signals_in(
        &self,
        here: &DriveSpec,
        own: &str,
        needed: &[String],
    ) -> Result<IndexMap<String, String>, TrainedError> {
        let home = &*self.home;
        let parts = self.parts(here, own)?;
        let mut basic = declared(&home.names);
        basic.retain(|declared| needed.iter().any(|name| *declared.signal.name == **name));
        let names = here.names();
        let renamed =
            basic.iter().map(|declared| {
                let (Input::Here(source)
                | Input::TimeLeft { source, .. }
                | Input::Time { source, .. }) = input(home, here, &parts, declared)?;
                let here = source.declared(&names).signal.name;
                Ok((declared.signal.name.to_string(), here.to_string()))
            });
        renamed.collect()
    }

    pub(super) fn bind(&self, here: &DriveSpec, own: &str) -> Result<Frozen, TrainedError> {
        let home = &*self.home;
        let (decision_s, sample_s) = (home.clock.decision_s, here.clock.sample_s);
        let ratio = decision_s / sample_s;
        // A tolerance, since 0.3 / 0.1 is no integer in binary.
        if ratio.round() < 1.0 || (ratio - ratio.round()).abs() > 1e-6 {
            return Err(TrainedError::Period {
                decision_s,
                sample_s,
            });
        }
        let parts = self.parts(here, own)?;
        let (basic, derived) = needed(home);
        let inputs = basic
            .iter()
            .map(|needed| input(home, here, &parts, needed))
            .collect::<Result<Vec<Input>, TrainedError>>()?;
        let signals = basic
            .iter()
            .map(|needed| needed.signal.clone())
            .chain(derived.iter().map(|derived| derived.signal.clone()));
        let schema = Schema::new(home.clock.sample_s, signals)?;
        let bound = derived
            .iter()
            .map(|derived| derived.expr.bind(&schema, &home.constants))
            .collect::<Result<Vec<BoundExpr>, StlError>>()?;
        // Invariant: the training world was assembled, so it publishes them.
        let observed = Observation::bind(&home.observe, &schema)
            .map_err(|name| no_agent(name, &home.world))?;
        Ok(Frozen {
            who: here.names().who(own).ok_or_else(|| no_agent("", own))?,
            actions: self.actions.clone(),
            policy: Arc::clone(&self.policy),
            samples_per_decision: ratio.round() as usize,
            temperature: self.temperature,
            neutral: self.neutral,
            idle: self.idle,
            inputs,
            derived: bound,
            observed,
        })
    }

    /// Returns the agent for each part of the training world that has one.
    fn parts(
        &self,
        here: &DriveSpec,
        own: &str,
    ) -> Result<Vec<(String, SignalOwner)>, TrainedError> {
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
            // Without a mapping, parts go to agents of the same name, and its
            // own part to itself.
            let namesake = || if *part == self.part { own } else { part };
            let name = self.names.get(part).map_or_else(namesake, String::as_str);
            // A part that no observed signal needs may stay without an agent.
            let Some(player) = here.who(name) else {
                continue;
            };
            let is_light = |who: Option<SignalOwner>| matches!(who, Some(SignalOwner::Light(_)));
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

fn no_agent(signal: &str, name: &str) -> TrainedError {
    TrainedError::UnknownAgent {
        signal: signal.to_owned(),
        name: name.to_owned(),
    }
}

/// Returns the signals on which the observation depends, in order.
fn needed(home: &TrainingWorld) -> (Vec<DeclaredSignal>, Vec<&Derived>) {
    let mut names: Vec<String> = home.observe.iter().map(|o| o.name.clone()).collect();
    let mut derived: Vec<&Derived> = Vec::new();
    // Backwards: a derived signal only mentions earlier ones, so a single pass
    // finds all dependencies.
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

/// Returns the same quantity for the agents that take the parts here.
fn input(
    home: &TrainingWorld,
    here: &DriveSpec,
    parts: &[(String, SignalOwner)],
    needed: &DeclaredSignal,
) -> Result<Input, TrainedError> {
    let player = |name: &str| {
        let mut parts = parts.iter();
        let found = parts.find(|(part, _)| part == name);
        found.map(|(_, who)| *who)
    };
    // Invariant: a light plays a light and a road user a road user.
    let agent = |i: usize| match player(&home.names.agents[i]) {
        Some(SignalOwner::Agent(i)) => Ok(i),
        _ => Err(no_agent(&needed.signal.name, &home.names.agents[i])),
    };
    let light = |i: usize| match player(&home.names.lights[i]) {
        Some(SignalOwner::Light(i)) => Ok(i),
        _ => Err(no_agent(&needed.signal.name, &home.names.lights[i])),
    };
    let SignalReading { quantity, whose } = needed.source;
    let [a, b] = whose;
    let whose = match quantity.of {
        Of::Clock | Of::Scene => whose,
        Of::Parameter => {
            let name = &home.names.parameters[a];
            let number = here.parameters.get_index_of(name);
            [
                number.ok_or_else(|| no_agent(&needed.signal.name, name))?,
                0,
            ]
        }
        Of::Agent => [agent(a)?, 0],
        Of::Pair => [agent(a)?, agent(b)?],
        Of::Light => [light(a)?, 0],
        Of::AgentAndLight => [agent(a)?, light(b)?],
        // Weather of another world would have other bounds.
        Of::Weather => {
            let name = home.names.weather.as_deref().unwrap_or_default();
            return Err(no_agent(&needed.signal.name, name));
        }
        Of::Road => {
            let name = home.names.road.as_deref().unwrap_or_default();
            return Err(no_agent(&needed.signal.name, name));
        }
    };
    let source = SignalReading { quantity, whose };
    // A quantity can exist in the training world and be meaningless here,
    // depending on roads, plans or kinds of body.
    if !source.exists(here) {
        return Err(no_agent(&needed.signal.name, &home.world));
    }
    // A policy has only seen times up to its own horizon. Its clock is shifted
    // so that both episodes end at the same time.
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
    /// Returns its action at a sample, or `None` between decisions.
    ///
    /// An action that is drawn depends on the episode's `noise`, the ado and the sample.
    pub(super) fn act(&self, scene: &SceneState, ado: usize, noise: u64) -> Option<usize> {
        if !scene.sample.is_multiple_of(self.samples_per_decision) {
            return None;
        }
        if self.idle {
            return Some(self.neutral);
        }
        let obs = self.observation(scene);
        // The temperature of the world file comes before that of the policy.
        let drawn_at = self.temperature.or(self.policy.drawn_at());
        let Some(temperature) = drawn_at else {
            return Some(self.policy.act(&obs));
        };
        // Keyed by episode, ado and sample, so that no draw depends on an
        // earlier one.
        let key = [noise, ado as u64, scene.sample as u64];
        let mut dice = seed::generator("drawn action of a trained ado", &key);
        let mut units = || dice.random::<f64>();
        Some(self.policy.sample(&obs, temperature, &mut units))
    }

    fn observation(&self, scene: &SceneState) -> Vec<f32> {
        let inputs = self.inputs.iter().map(|input| input.value(scene));
        let mut row: Vec<f64> = inputs.collect();
        let basic = row.len();
        row.resize(basic + self.derived.len(), 0.0);
        // In order, because a derived signal reads earlier ones.
        for (i, expr) in self.derived.iter().enumerate() {
            row[basic + i] = expr.eval(&row);
        }
        let mut obs = vec![0.0; self.observed.len()];
        self.observed.read(|position| row[position], &mut obs);
        obs
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
