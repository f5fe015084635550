//! What a driving scene publishes: the catalogue of signals and their sources.

mod list;
#[cfg(test)]
mod tests;

use super::light::LightDrive;
use super::motion::DriveScene;
use super::script::Script;
use super::spec::{Drive, DriveSpec};
use crate::stl::Interval;
use crate::trace::Signal;
use list::SIGNALS;
pub use list::TTC_CAP_S;

/// Whose quantity it is; names begin with theirs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    /// The clock's, which nobody influences.
    Clock,
    /// The scene's as a whole.
    Scene,
    /// One agent's.
    Agent,
    /// Two agents', seen from the first.
    Pair,
    /// One traffic light's.
    Light,
    /// An agent's, before a light.
    AgentAndLight,
}

/// A row of the list.
#[derive(Debug)]
pub(super) struct Quantity {
    pub of: Of,
    /// The last part of the signal's name.
    pub name: &'static str,
    former: &'static [&'static str],
    unit: &'static str,
    about: &'static str,
    value: Value,
    bounds: fn(&DriveSpec, [usize; 2]) -> Interval,
    usual: Option<(f64, f64)>,
    always: bool,
}

/// How a value is read off a moving scene; the positions are of its owners.
#[derive(Debug)]
enum Value {
    Real(fn(&DriveScene, [usize; 2]) -> f64),
    Boolean(fn(&DriveScene, [usize; 2]) -> bool),
}

/// Where a published value comes from: a quantity, and whose it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub quantity: &'static Quantity,
    pub whose: [usize; 2],
}

impl Source {
    /// The value now.
    pub fn value(self, scene: &DriveScene) -> f64 {
        match self.quantity.value {
            Value::Real(value) => value(scene, self.whose),
            Value::Boolean(value) => f64::from(u8::from(value(scene, self.whose))),
        }
    }

    /// Between what it stays in any run of a scene.
    pub fn range(self, spec: &DriveSpec) -> Interval {
        (self.quantity.bounds)(spec, self.whose)
    }

    /// Whether it is the same whatever the ados do.
    pub fn is_untouched(self, spec: &DriveSpec) -> bool {
        let agent = |i: usize| match &spec.agents[i].drive {
            Drive::Scripted(Script::Idm(_)) => false,
            Drive::Scripted(_) => true,
            Drive::Ego | Drive::Ado { .. } | Drive::Trained(_) => false,
        };
        let [a, b] = self.whose;
        match self.quantity.of {
            Of::Clock => true,
            Of::Scene => false,
            Of::Agent | Of::AgentAndLight => agent(a),
            Of::Pair => agent(a) && agent(b),
            Of::Light => matches!(spec.lights[a].drive, LightDrive::Schedule(_)),
        }
    }

    /// The names of whose it is, as many as there are.
    fn owners(self, spec: &DriveSpec) -> Vec<&str> {
        let agent = |i: usize| spec.agents[i].name.as_str();
        let light = |i: usize| spec.lights[i].name.as_str();
        let [a, b] = self.whose;
        match self.quantity.of {
            Of::Clock | Of::Scene => Vec::new(),
            Of::Agent => vec![agent(a)],
            Of::Pair => vec![agent(a), agent(b)],
            Of::Light => vec![light(a)],
            Of::AgentAndLight => vec![agent(a), light(b)],
        }
    }

    fn offer(self, spec: &DriveSpec) -> SignalSource {
        let Quantity {
            name, unit, about, ..
        } = *self.quantity;
        let owners = self.owners(spec);
        let name = [&owners[..], &[name]].concat().join(".");
        let about = in_words(about, &owners);
        let Interval { lo, hi } = self.range(spec);
        SignalSource {
            signal: match self.quantity.value {
                Value::Real(_) => Signal::real(name, unit, about),
                Value::Boolean(_) => Signal::boolean(name, about),
            },
            range: self.quantity.usual.unwrap_or((lo, hi)),
            always: self.quantity.always,
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
    /// Its declaration.
    pub signal: Signal,
    /// Usual range; observations are scaled by it.
    pub range: (f64, f64),
    /// Whether every trace holds it; the others are published when mentioned.
    /// Those that a later version adds are among the others, so that what
    /// earlier ones recorded keeps its columns.
    pub always: bool,
    pub(super) source: Source,
}

/// What a signal of an earlier version is called now.
pub fn current_name(name: &str) -> Option<String> {
    let (owner, last) = name.rsplit_once('.')?;
    let now = SIGNALS.iter().find(|row| row.former.contains(&last))?;
    Some(format!("{owner}.{}", now.name))
}

/// The former names of a signal that is offered, as signals of their own.
fn formerly(offer: &SignalSource) -> impl Iterator<Item = SignalSource> {
    let Quantity { former, name, .. } = offer.source.quantity;
    former.iter().map(move |former| {
        let now = &offer.signal.name;
        SignalSource {
            signal: Signal {
                name: format!("{}{former}", now.strip_suffix(name).unwrap_or_default()),
                about: format!("former name of `{now}`"),
                ..offer.signal.clone()
            },
            always: false,
            ..*offer
        }
    })
}

impl DriveSpec {
    /// Every signal this scene can publish, derived ones excepted.
    pub fn catalogue(&self) -> Vec<SignalSource> {
        let agents = 0..self.agents.len();
        let mut owners = vec![(Of::Clock, [0, 0]), (Of::Scene, [0, 0])];
        owners.extend(agents.clone().map(|a| (Of::Agent, [a, 0])));
        for a in agents.clone() {
            let others = agents.clone().filter(|&b| a != b);
            owners.extend(others.map(|b| (Of::Pair, [a, b])));
        }
        for l in 0..self.lights.len() {
            owners.push((Of::Light, [l, 0]));
            owners.extend(agents.clone().map(|a| (Of::AgentAndLight, [a, l])));
        }
        let sources = owners.into_iter().flat_map(|(of, whose)| {
            let rows = SIGNALS.iter().filter(move |row| row.of == of);
            rows.map(move |quantity| Source { quantity, whose })
        });
        let mut offers: Vec<SignalSource> = sources.map(|source| source.offer(self)).collect();
        let former: Vec<SignalSource> = offers.iter().flat_map(formerly).collect();
        offers.extend(former);
        offers
    }

    /// The signals a trace of this scene holds, derived ones excepted.
    pub(super) fn published(&self) -> Vec<SignalSource> {
        let mut offers = self.catalogue();
        offers.retain(|offer| offer.always || self.extra.contains(&offer.signal.name));
        offers
    }
}
