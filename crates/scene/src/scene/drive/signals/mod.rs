//! Signals of a driving scene: their catalogue and their sources.

mod list;
mod quantity;
#[cfg(test)]
mod tests;

use super::light::LightDrive;
use super::names::AgentNames;
use super::script::Script;
use super::spec::{Drive, DriveSpec};
use super::state::SceneState;
use crate::scene::Availability;
use crate::stl::Interval;
use crate::trace::{Schema, SchemaError, Signal};
use list::SIGNALS;
use quantity::QuantityReader;
pub(super) use quantity::{Of, SignalQuantity};

/// Source of a published value: a quantity and its owners.
#[derive(Clone, Copy, Debug)]
pub struct SignalReading {
    /// Quantity that is read.
    pub quantity: &'static SignalQuantity,
    /// Indices of its owners.
    pub whose: [usize; 2],
}

impl SignalReading {
    /// Returns the value at the current sample.
    #[inline]
    pub fn value(self, state: &SceneState) -> f64 {
        match self.quantity.value {
            QuantityReader::Real(value) => value(state, self.whose),
            QuantityReader::Boolean(value) => f64::from(u8::from(value(state, self.whose))),
        }
    }

    /// Returns an interval that contains the value in every run of a scene.
    pub(super) fn range(self, spec: &DriveSpec) -> Interval {
        (self.quantity.bounds)(spec, self.whose)
    }

    /// Returns whether no ado can change the value.
    pub(super) fn is_untouched(self, spec: &DriveSpec) -> bool {
        let agent = |i: usize| match &spec.agents[i].drive {
            // Traffic that follows a leader reacts to ados, and so do the ego
            // and trained ados.
            Drive::Scripted(Script::Idm(_)) => false,
            Drive::Scripted(Script::Stand) => true,
            Drive::Scripted(Script::Walk(_)) => spec.road_ado.is_none(),
            // Its tyres may lose their grip, and its road may bend.
            Drive::Scripted(_) => spec.weather.is_none() && spec.road_ado.is_none(),
            // A story may look at any agent.
            Drive::Planned(plan) => plan.is_blind() && spec.story.is_none(),
            Drive::Ego | Drive::Ado { .. } | Drive::Trained(_) => false,
        };
        let [a, b] = self.whose;
        match self.quantity.of {
            Of::Clock | Of::Parameter => true,
            // Every contact in the scene may involve an ado.
            Of::Scene => false,
            Of::Agent | Of::AgentAndLight => agent(a),
            Of::Pair => agent(a) && agent(b),
            Of::Light => matches!(spec.lights[a].drive, LightDrive::Schedule(_)),
            Of::Weather | Of::Road => false,
        }
    }

    /// Returns whether it is a plan or an action, and so no motion of a body.
    pub(super) fn is_decided(self) -> bool {
        let name = self.quantity.name;
        name.starts_with("planned.") || matches!(name, "action" | "action_before")
    }

    /// Returns whether a scene of this spec has the signal.
    pub(super) fn exists(self, spec: &DriveSpec) -> bool {
        (self.quantity.exists)(spec, self.whose)
    }

    /// Returns the names of its owners.
    fn owners(self, names: &AgentNames) -> Vec<&str> {
        let agent = |i: usize| names.agents[i].as_str();
        let light = |i: usize| names.lights[i].as_str();
        let [a, b] = self.whose;
        match self.quantity.of {
            Of::Clock | Of::Scene => Vec::new(),
            Of::Parameter => vec![names.parameters[a].as_str()],
            Of::Agent => vec![agent(a)],
            Of::Pair => vec![agent(a), agent(b)],
            Of::Light => vec![light(a)],
            Of::AgentAndLight => vec![agent(a), light(b)],
            Of::Weather => names.weather.iter().map(String::as_str).collect(),
            Of::Road => names.road.iter().map(String::as_str).collect(),
        }
    }

    pub(super) fn declared(self, names: &AgentNames) -> DeclaredSignal {
        let SignalQuantity {
            name, unit, about, ..
        } = *self.quantity;
        let owners = self.owners(names);
        // A parameter belongs to no agent, so its own name is the whole name.
        let name = match self.quantity.of {
            Of::Parameter => owners.concat(),
            _ => [&owners[..], &[name]].concat().join("."),
        };
        let about = in_words(about, &owners);
        DeclaredSignal {
            signal: match self.quantity.value {
                QuantityReader::Real(_) => Signal::real(name, unit, about),
                QuantityReader::Boolean(_) => Signal::boolean(name, about),
            },
            source: self,
        }
    }
}

fn in_words(about: &str, owners: &[&str]) -> String {
    let named = ["{a}", "{b}"].iter().zip(owners);
    named.fold(about.to_owned(), |about, (hole, owner)| {
        about.replace(hole, owner)
    })
}

/// A signal that can be published, with the range by which it is observed.
#[derive(Clone, Debug)]
pub struct SignalSource {
    /// Declaration of the signal.
    pub signal: Signal,
    /// Usual range, by which observations are scaled.
    pub range: (f64, f64),
    /// True if every trace holds it. Otherwise it is published when mentioned.
    ///
    /// Signals added by a later version are published when mentioned, so that
    /// recordings of earlier versions keep their columns.
    pub always: bool,
    pub(super) source: SignalReading,
}

/// A signal by name, with the source of its value.
#[derive(Clone, Debug)]
pub(super) struct DeclaredSignal {
    pub signal: Signal,
    pub source: SignalReading,
}

/// Returns every published signal of driving worlds, with its unit and its meaning.
///
/// In the names, `A` and `B` are agents, `L` is a light, `W` the weather, `R` a road that
/// an ado lays, and `P` a parameter.
pub fn signal_list() -> Vec<(Signal, Availability)> {
    let names = AgentNames {
        agents: vec!["A".to_owned(), "B".to_owned()],
        lights: vec!["L".to_owned()],
        weather: Some("W".to_owned()),
        road: Some("R".to_owned()),
        parameters: vec!["P".to_owned()],
    };
    let mut all = declared(&names);
    // Those of the second agent are the same again.
    all.retain(|it| !it.signal.name.starts_with("B."));
    let listed = |it: DeclaredSignal| {
        let is_recorded = it.source.quantity.always || it.source.quantity.of == Of::Parameter;
        let availability = if is_recorded {
            Availability::Recorded
        } else {
            Availability::OnDemand
        };
        (it.signal, availability)
    };
    all.into_iter().map(listed).collect()
}

/// Returns every signal of the named agents.
pub(super) fn declared(names: &AgentNames) -> Vec<DeclaredSignal> {
    declared_of(names, &|_| true)
}

/// The same of some quantities only.
fn declared_of(
    names: &AgentNames,
    wanted: &dyn Fn(&SignalQuantity) -> bool,
) -> Vec<DeclaredSignal> {
    let agents = 0..names.agents.len();
    // The order of owners is that of the columns in traces. Recorded traces
    // depend on it.
    let mut owners = vec![(Of::Clock, [0, 0]), (Of::Scene, [0, 0])];
    owners.extend(agents.clone().map(|a| (Of::Agent, [a, 0])));
    for a in agents.clone() {
        let others = agents.clone().filter(|&b| a != b);
        owners.extend(others.map(|b| (Of::Pair, [a, b])));
    }
    for l in 0..names.lights.len() {
        owners.push((Of::Light, [l, 0]));
        owners.extend(agents.clone().map(|a| (Of::AgentAndLight, [a, l])));
    }
    owners.extend(names.weather.iter().map(|_| (Of::Weather, [0, 0])));
    owners.extend(names.road.iter().map(|_| (Of::Road, [0, 0])));
    let parameters = 0..names.parameters.len();
    owners.extend(parameters.map(|p| (Of::Parameter, [p, 0])));
    let sources = owners.into_iter().flat_map(|(of, whose)| {
        let rows = SIGNALS
            .iter()
            .filter(move |row| row.of == of && wanted(row));
        rows.map(move |quantity| SignalReading { quantity, whose })
    });
    sources.map(|source| source.declared(names)).collect()
}

/// Returns the schema of a spec's traces: published signals, then derived ones.
///
/// # Errors
/// Two signals have the same name.
pub(crate) fn schema_of(spec: &DriveSpec) -> Result<Schema, SchemaError> {
    let published = spec.published().into_iter().map(|offer| offer.signal);
    let derived = spec.derived.iter().map(|derived| derived.signal.clone());
    Schema::new(spec.clock.sample_s, published.chain(derived))
}

impl DriveSpec {
    /// Returns every signal this scene can publish, except derived ones.
    pub fn catalogue(&self) -> Vec<SignalSource> {
        self.offers(&|_| true)
    }

    fn offers(&self, wanted: &dyn Fn(&SignalQuantity) -> bool) -> Vec<SignalSource> {
        let offer = |declared: DeclaredSignal| {
            let (source, quantity) = (declared.source, declared.source.quantity);
            let Interval { lo, hi } = source.range(self);
            // A parameter that is equal at every start would give a scale of width 0.
            let (lo, hi) = if lo == hi {
                (lo - 1.0, hi + 1.0)
            } else {
                (lo, hi)
            };
            SignalSource {
                signal: declared.signal,
                range: quantity.usual.unwrap_or((lo, hi)),
                always: quantity.always,
                source,
            }
        };
        let exists = |declared: &DeclaredSignal| declared.source.exists(self);
        let all = declared_of(&self.names(), wanted).into_iter();
        all.filter(exists).map(offer).collect()
    }

    /// Returns the signals in a trace of this scene, except derived ones.
    pub(super) fn published(&self) -> Vec<SignalSource> {
        // A hundred agents have a hundred thousand signals, of which few are wanted:
        // their names and meanings are not even written.
        let mentioned = |last: &str| self.extra.iter().any(|name| name.ends_with(last));
        let mut offers = self.offers(&|row: &SignalQuantity| {
            row.always || row.of == Of::Parameter || mentioned(row.name)
        });
        // Other signals may end alike, so whole names decide.
        offers.retain(|offer| offer.always || self.extra.contains(&offer.signal.name));
        offers
    }
}
