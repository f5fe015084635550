//! The list of published signals: one row is all there is to a signal.
//!
//! A row says whose the signal is, its name, unit and meaning, its value, and
//! where it differs from what is usual: between what it stays in any run, by
//! what range it is observed, whether every trace holds it, former names. What
//! `check` lists, what `vacuous` knows and the table in `docs/worlds.md` follow.
//!
//! The order is that of traces: a row that a later version adds stands last
//! among those of its owner, and is not `always` recorded, so that what earlier
//! versions recorded keeps its columns.

use super::super::motion::DriveScene;
use super::super::spec::DriveSpec;
use super::{Of, Quantity, Value};
use crate::ego::Phase;
use crate::stl::Interval;
use Of::{Agent, AgentAndLight, Clock, Light, Pair, Scene};

/// Time to collision is capped here, so that it is finite when not closing.
pub const TTC_CAP_S: f64 = 100.0;
/// Vehicles do not reverse, but may roll back while they settle.
const SLOWEST_MPS: f64 = -1.0;
/// Nobody starts faster than 100 m/s.
const FASTEST_MPS: f64 = 200.0;

pub(super) static SIGNALS: &[Quantity] = &[
    Clock
        .signal("time", "s")
        .is(|scene, _| scene.time_s())
        .about("time since the start")
        .within(|spec, _| zero_to(spec.clock.horizon_s)),
    Clock
        .signal("time_left", "s")
        .is(|scene, _| (scene.layout.spec.clock.horizon_s - scene.time_s()).max(0.0))
        .about("time to the horizon")
        .within(|spec, _| zero_to(spec.clock.horizon_s))
        .always(),
    Scene
        .signal("contact", "")
        .holds_if(|scene, _| scene.touch.is_some())
        .about("whether any two agents touched")
        .always(),
    Agent
        .signal("x", "m")
        .is(|scene, [a, _]| scene.states[a].pose.x_m)
        .about("front bumper along world x")
        .seen_in(-100.0, 100.0)
        .always(),
    Agent
        .signal("y", "m")
        .is(|scene, [a, _]| scene.states[a].pose.y_m)
        .about("front bumper along world y (left)")
        .seen_in(-10.0, 10.0)
        .always(),
    Agent
        .signal("heading", "rad")
        .is(|scene, [a, _]| scene.states[a].pose.heading_rad)
        .about("counter-clockwise from world x")
        .seen_in(-1.0, 1.0)
        .always(),
    Agent
        .signal("speed", "m/s")
        .is(|scene, [a, _]| scene.states[a].speed_mps)
        .about("velocity along the heading")
        .within(|spec, [a, _]| match spec.agents[a].body.is_on_foot() {
            true => Interval::ANY,
            false => between(SLOWEST_MPS, FASTEST_MPS),
        })
        .seen_in(0.0, 30.0)
        // No signal has a former name yet; tests have one.
        .formerly(if cfg!(test) { &["velocity"] } else { &[] })
        .always(),
    Agent
        .signal("accel", "m/s²")
        .is(|scene, [a, _]| scene.states[a].accel_mps2)
        .about("acceleration along the heading over the last sample")
        .seen_in(-5.0, 5.0)
        .always(),
    Agent
        .signal("s", "m")
        .is(|scene, [a, _]| scene.on_road[a].s_m)
        .about("front bumper along the road")
        .seen_in(-100.0, 100.0),
    Agent
        .signal("lateral", "m")
        .is(|scene, [a, _]| scene.on_road[a].lateral_m)
        .about("offset to the left of the middle of lane 0")
        .seen_in(-10.0, 10.0),
    Agent
        .signal("lateral_speed", "m/s")
        .is(|scene, [a, _]| scene.velocity_mps(a).1)
        .about("velocity across the road, to the left")
        .seen_in(-3.0, 3.0),
    Agent
        .signal("lane", "")
        .is(|scene, [a, _]| scene.layout.spec.road.lane_at(scene.on_road[a].lateral_m) as f64)
        .about("lane of the front bumper, 0 is the rightmost")
        .within(|spec, _| zero_to(spec.road.lanes() as f64 - 1.0))
        .seen_in(0.0, 3.0),
    Agent
        .signal("yaw_rate", "rad/s")
        .is(|scene, [a, _]| scene.states[a].yaw_rate_rad_per_s)
        .about("turning rate, counter-clockwise")
        .seen_in(-1.0, 1.0),
    #[cfg(test)]
    Agent
        .signal("doubled_speed", "m/s")
        .is(|scene, [a, _]| 2.0 * scene.states[a].speed_mps)
        .about("twice the speed of {a}: one row is all it takes")
        .within(|_, _| zero_to(2.0 * FASTEST_MPS))
        .seen_in(0.0, 60.0),
    Pair.signal("headway", "m")
        .is(|scene, [a, b]| scene.on_road[b].s_m - scene.on_road[a].s_m)
        .about("distance along the road from {a} to {b}, front to front")
        .seen_in(-100.0, 100.0),
    Pair.signal("lateral", "m")
        .is(|scene, [a, b]| scene.on_road[b].lateral_m - scene.on_road[a].lateral_m)
        .about("lateral offset of {b} from {a}, to the left")
        .seen_in(-10.0, 10.0),
    Pair.signal("distance", "m")
        .is(|scene, [a, b]| {
            let (from, to) = (&scene.states[a].pose, &scene.states[b].pose);
            let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
            (dx * dx + dy * dy).sqrt()
        })
        .about("distance between {a} and {b}, front to front as the crow flies")
        .within(|_, _| zero_to(f64::INFINITY))
        .seen_in(0.0, 100.0),
    Pair.signal("gap", "m")
        .is(|scene, [a, b]| scene.plant.gap_m(scene.bodies[a], scene.bodies[b]))
        .about("clearance between the bodies of {a} and {b}")
        .within(|_, _| zero_to(f64::INFINITY))
        .seen_in(0.0, 100.0),
    Pair.signal("ttc", "s")
        .is(time_to_collision_s)
        .about("clearance along the road over closing speed, at most 100 s")
        .within(|_, _| zero_to(TTC_CAP_S))
        .seen_in(0.0, 20.0),
    Pair.signal("contact", "")
        .holds_if(|scene, [a, b]| {
            let pair = (scene.bodies[a.min(b)], scene.bodies[a.max(b)]);
            scene.touch.is_some_and(|contact| contact.pair == pair)
        })
        .about("whether {a} and {b} touched"),
    Light
        .signal("green", "")
        .holds_if(|scene, [l, _]| scene.lights[l].phase == Phase::Green)
        .about("whether {a} is green"),
    Light
        .signal("yellow", "")
        .holds_if(|scene, [l, _]| scene.lights[l].phase == Phase::Yellow)
        .about("whether {a} is yellow"),
    Light
        .signal("red", "")
        .holds_if(|scene, [l, _]| scene.lights[l].phase == Phase::Red)
        .about("whether {a} is red"),
    Light
        .signal("phase", "")
        .is(|scene, [l, _]| match scene.lights[l].phase {
            Phase::Green => 0.0,
            Phase::Yellow => 1.0,
            Phase::Red => 2.0,
        })
        .about("0 while {a} is green, 1 yellow, 2 red")
        .within(|_, _| zero_to(2.0))
        .always(),
    Light
        .signal("phase_time", "s")
        .is(|scene, [l, _]| scene.phase_s(l))
        .about("for how long {a} has been in its phase")
        .within(|spec, _| zero_to(spec.clock.horizon_s))
        .seen_in(0.0, 10.0),
    AgentAndLight
        .signal("line", "m")
        .is(|scene, [a, l]| scene.line_m(a, l))
        .about("distance along the road from {a} to the stop line of {b}, positive before it")
        .seen_in(-50.0, 50.0),
];

/// A signal with whose it is, its name and its unit.
struct Named(Of, &'static str, &'static str);

impl Of {
    const fn signal(self, name: &'static str, unit: &'static str) -> Named {
        Named(self, name, unit)
    }
}

impl Named {
    /// A number that may be anything, unless `within` says otherwise.
    const fn is(self, value: fn(&DriveScene, [usize; 2]) -> f64) -> Quantity {
        Quantity {
            of: self.0,
            name: self.1,
            former: &[],
            unit: self.2,
            about: "",
            value: Value::Real(value),
            bounds: |_, _| Interval::ANY,
            usual: None,
            always: false,
        }
    }

    const fn holds_if(self, value: fn(&DriveScene, [usize; 2]) -> bool) -> Quantity {
        Quantity {
            value: Value::Boolean(value),
            bounds: |_, _| zero_to(1.0),
            ..self.is(|_, _| 0.0)
        }
    }
}

impl Quantity {
    /// `{a}` and `{b}` stand for the names of whose it is.
    const fn about(self, about: &'static str) -> Quantity {
        Quantity { about, ..self }
    }

    /// Between what it stays in any run.
    const fn within(self, bounds: fn(&DriveSpec, [usize; 2]) -> Interval) -> Quantity {
        Quantity { bounds, ..self }
    }

    /// By what range it is observed, where that is not all it can be.
    const fn seen_in(self, lo: f64, hi: f64) -> Quantity {
        Quantity {
            usual: Some((lo, hi)),
            ..self
        }
    }

    /// What the last part of its name was in earlier versions: worlds and kept
    /// files that say the old one go on working.
    const fn formerly(self, former: &'static [&'static str]) -> Quantity {
        Quantity { former, ..self }
    }

    /// Every trace holds it, mentioned or not.
    const fn always(self) -> Quantity {
        Quantity {
            always: true,
            ..self
        }
    }
}

const fn between(lo: f64, hi: f64) -> Interval {
    Interval { lo, hi }
}

const fn zero_to(hi: f64) -> Interval {
    between(0.0, hi)
}

/// Clearance along the road over closing speed; the cap when not closing.
fn time_to_collision_s(scene: &DriveScene, [a, b]: [usize; 2]) -> f64 {
    let ahead_m = scene.on_road[b].s_m - scene.on_road[a].s_m;
    let front = if 0.0 < ahead_m { b } else { a };
    let clearance_m = ahead_m.abs() - scene.layout.spec.agents[front].body.length_m;
    let closing_mps = (scene.velocity_mps(a).0 - scene.velocity_mps(b).0) * ahead_m.signum();
    if closing_mps <= 0.0 {
        return TTC_CAP_S;
    }
    (clearance_m.max(0.0) / closing_mps).min(TTC_CAP_S)
}
