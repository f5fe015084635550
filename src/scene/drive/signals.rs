//! What a driving scene publishes: the catalogue of signals and their sources.

use super::spec::DriveSpec;
use crate::trace::Signal;

/// A quantity of one agent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Field {
    X,
    Y,
    Heading,
    Speed,
    Accel,
    S,
    Lateral,
    LateralSpeed,
    Lane,
    YawRate,
}

/// A quantity of two agents, seen from the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    Headway,
    Lateral,
    Distance,
    Gap,
    Ttc,
    Contact,
}

/// A quantity of one traffic light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lamp {
    Green,
    Yellow,
    Red,
    Phase,
    PhaseTime,
}

/// Where a published value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    Time,
    TimeLeft,
    Contact,
    Agent(usize, Field),
    Pair(usize, usize, Between),
    Light(usize, Lamp),
    /// From an agent to the stop line of a light.
    Line(usize, usize),
}

/// A signal that can be published, with the range by which it is observed.
#[derive(Clone, Debug)]
pub struct Offer {
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

/// What the last part of a name was in earlier versions, and what it is now:
/// worlds and kept files that say the old one go on working.
const FORMER: &[(&str, &str)] = &[
    // None yet; tests have one.
    #[cfg(test)]
    ("velocity", "speed"),
];

/// What a signal of an earlier version is called now.
pub fn current_name(name: &str) -> Option<String> {
    let (owner, last) = name.rsplit_once('.')?;
    let (_, now) = FORMER.iter().find(|(former, _)| *former == last)?;
    Some(format!("{owner}.{now}"))
}

/// The former names of a signal that is offered, as signals of their own.
fn formerly(offer: &Offer) -> impl Iterator<Item = Offer> {
    let parts = offer.signal.name.rsplit_once('.');
    let named = parts.into_iter().flat_map(move |(owner, last)| {
        let former = FORMER.iter().filter(move |(_, now)| *now == last);
        former.map(move |(former, _)| format!("{owner}.{former}"))
    });
    named.map(|name| Offer {
        signal: Signal {
            about: format!("former name of `{}`", offer.signal.name),
            name,
            ..offer.signal.clone()
        },
        always: false,
        ..*offer
    })
}

/// Time to collision is capped here, so that it is finite when not closing.
pub const TTC_CAP_S: f64 = 100.0;

/// Source, name, unit, meaning, usual range, and whether every trace holds it.
type FieldOffer<F> = (
    F,
    &'static str,
    &'static str,
    &'static str,
    (f64, f64),
    bool,
);

/// The same of a pair; `{a}` and `{b}` stand for the two names.
type PairOffer = (
    Between,
    &'static str,
    &'static str,
    &'static str,
    (f64, f64),
);

const FIELDS: [FieldOffer<Field>; 10] = [
    (
        Field::X,
        "x",
        "m",
        "front bumper along world x",
        (-100.0, 100.0),
        true,
    ),
    (
        Field::Y,
        "y",
        "m",
        "front bumper along world y (left)",
        (-10.0, 10.0),
        true,
    ),
    (
        Field::Heading,
        "heading",
        "rad",
        "counter-clockwise from world x",
        (-1.0, 1.0),
        true,
    ),
    (
        Field::Speed,
        "speed",
        "m/s",
        "velocity along the heading",
        (0.0, 30.0),
        true,
    ),
    (
        Field::Accel,
        "accel",
        "m/s²",
        "acceleration along the heading over the last sample",
        (-5.0, 5.0),
        true,
    ),
    (
        Field::S,
        "s",
        "m",
        "front bumper along the road",
        (-100.0, 100.0),
        false,
    ),
    (
        Field::Lateral,
        "lateral",
        "m",
        "offset to the left of the middle of lane 0",
        (-10.0, 10.0),
        false,
    ),
    (
        Field::LateralSpeed,
        "lateral_speed",
        "m/s",
        "velocity across the road, to the left",
        (-3.0, 3.0),
        false,
    ),
    (
        Field::Lane,
        "lane",
        "",
        "lane of the front bumper, 0 is the rightmost",
        (0.0, 3.0),
        false,
    ),
    (
        Field::YawRate,
        "yaw_rate",
        "rad/s",
        "turning rate, counter-clockwise",
        (-1.0, 1.0),
        false,
    ),
];

const BETWEENS: [PairOffer; 6] = [
    (
        Between::Headway,
        "headway",
        "m",
        "distance along the road from {a} to {b}, front to front",
        (-100.0, 100.0),
    ),
    (
        Between::Lateral,
        "lateral",
        "m",
        "lateral offset of {b} from {a}, to the left",
        (-10.0, 10.0),
    ),
    (
        Between::Distance,
        "distance",
        "m",
        "distance between {a} and {b}, front to front as the crow flies",
        (0.0, 100.0),
    ),
    (
        Between::Gap,
        "gap",
        "m",
        "clearance between the bodies of {a} and {b}",
        (0.0, 100.0),
    ),
    (
        Between::Ttc,
        "ttc",
        "s",
        "clearance along the road over closing speed, at most 100 s",
        (0.0, 20.0),
    ),
    (
        Between::Contact,
        "contact",
        "",
        "whether {a} and {b} touched",
        (0.0, 1.0),
    ),
];

const LAMPS: [FieldOffer<Lamp>; 5] = [
    (
        Lamp::Green,
        "green",
        "",
        "whether {a} is green",
        (0.0, 1.0),
        false,
    ),
    (
        Lamp::Yellow,
        "yellow",
        "",
        "whether {a} is yellow",
        (0.0, 1.0),
        false,
    ),
    (
        Lamp::Red,
        "red",
        "",
        "whether {a} is red",
        (0.0, 1.0),
        false,
    ),
    (
        Lamp::Phase,
        "phase",
        "",
        "0 while {a} is green, 1 yellow, 2 red",
        (0.0, 2.0),
        true,
    ),
    (
        Lamp::PhaseTime,
        "phase_time",
        "s",
        "for how long {a} has been in its phase",
        (0.0, 10.0),
        false,
    ),
];

impl DriveSpec {
    /// Every signal this scene can publish, derived ones excepted.
    pub fn catalogue(&self) -> Vec<Offer> {
        let mut offers = vec![
            Offer {
                signal: Signal::real("time", "s", "time since the start"),
                range: (0.0, self.clock.horizon_s),
                always: false,
                source: Source::Time,
            },
            Offer {
                signal: Signal::real("time_left", "s", "time to the horizon"),
                range: (0.0, self.clock.horizon_s),
                always: true,
                source: Source::TimeLeft,
            },
            Offer {
                signal: Signal::boolean("contact", "whether any two agents touched"),
                range: (0.0, 1.0),
                always: true,
                source: Source::Contact,
            },
        ];
        for (i, agent) in self.agents.iter().enumerate() {
            for (field, name, unit, about, range, always) in FIELDS {
                offers.push(Offer {
                    signal: Signal::real(format!("{}.{name}", agent.name), unit, about),
                    range,
                    always,
                    source: Source::Agent(i, field),
                });
            }
        }
        for (i, a) in self.agents.iter().enumerate() {
            for (j, b) in self.agents.iter().enumerate() {
                if i == j {
                    continue;
                }
                for (between, name, unit, about, range) in BETWEENS {
                    let name = format!("{}.{}.{name}", a.name, b.name);
                    let about = about.replace("{a}", &a.name).replace("{b}", &b.name);
                    offers.push(Offer {
                        signal: match between {
                            Between::Contact => Signal::boolean(name, about),
                            _ => Signal::real(name, unit, about),
                        },
                        range,
                        always: false,
                        source: Source::Pair(i, j, between),
                    });
                }
            }
        }
        for (l, light) in self.lights.iter().enumerate() {
            for (lamp, name, unit, about, range, always) in LAMPS {
                let name = format!("{}.{name}", light.name);
                let about = about.replace("{a}", &light.name);
                offers.push(Offer {
                    signal: match lamp {
                        Lamp::Phase | Lamp::PhaseTime => Signal::real(name, unit, about),
                        _ => Signal::boolean(name, about),
                    },
                    range,
                    always,
                    source: Source::Light(l, lamp),
                });
            }
            for (i, agent) in self.agents.iter().enumerate() {
                let about = format!(
                    "distance along the road from {} to the stop line of {}, positive before it",
                    agent.name, light.name
                );
                offers.push(Offer {
                    signal: Signal::real(format!("{}.{}.line", agent.name, light.name), "m", about),
                    range: (-50.0, 50.0),
                    always: false,
                    source: Source::Line(i, l),
                });
            }
        }
        let former: Vec<Offer> = offers.iter().flat_map(formerly).collect();
        offers.extend(former);
        offers
    }

    /// The signals a trace of this scene holds, derived ones excepted.
    pub(super) fn published(&self) -> Vec<Offer> {
        let mut offers = self.catalogue();
        offers.retain(|offer| offer.always || self.extra.contains(&offer.signal.name));
        offers
    }
}
