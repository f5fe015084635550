//! The list of published signals: a row fully defines its signal.
//!
//! A row holds the owner of the signal, its name, unit, meaning and value. It
//! also holds deviations from the defaults: bounds, range of observation and
//! permanent recording. The output of `check`, the bounds in
//! `vacuous` and the table of `brakecheck reference signals` are generated from the list.
//!
//! The order is that of traces. A row of a later version comes last among those
//! of its owner and is not `always` recorded, so that recordings of earlier
//! versions keep their columns.

use super::super::actions::Actions;
use super::super::range::Range;
use super::super::spec::DriveSpec;
use super::super::state::SceneState;
use super::super::weather::{Weather as DrivenWeather, WeatherState};
use super::quantity::{Of, SignalQuantity, between, zero_to};
use crate::ego::Phase;
use crate::road::goes_first;
use crate::stl::Interval;
use Of::{Agent, AgentAndLight, Clock, Light, Pair, Parameter, Road, Scene, Weather};

/// Upper bound on times to collision, returned when the gap is not closing.
pub(crate) const TTC_CAP_S: f64 = 100.0;
/// Radius of a straight road.
const STRAIGHT_M: f64 = 10_000.0;
/// Distance to the crossing of paths that never cross.
const NEVER_M: f64 = 1000.0;
/// Vehicles do not reverse, but may roll back while they settle.
const SLOWEST_MPS: f64 = -1.0;
/// Upper bound on speeds. Starts are limited to 100 m/s.
const FASTEST_MPS: f64 = 200.0;

pub(super) static SIGNALS: &[SignalQuantity] = &[
    Clock
        .signal("time", "s")
        .is(|state, _| state.time_s())
        .about("time since the start")
        .within(|spec, _| zero_to(spec.clock.horizon_s)),
    Clock
        .signal("time_left", "s")
        // A time that is rounded up at the last sample must not leave the bounds.
        .is(|state, _| (state.spec.clock.horizon_s - state.time_s()).max(0.0))
        .about("time to the horizon")
        .within(|spec, _| zero_to(spec.clock.horizon_s))
        .always(),
    Scene
        .signal("contact", "")
        .holds_if(|state, _| state.touch.is_some())
        .about("whether any two agents touched")
        .always(),
    Agent
        .signal("x", "m")
        .is(|state, [a, _]| state.states[a].pose.x_m)
        .about("front bumper along world x")
        .seen_in(-100.0, 100.0)
        .always(),
    Agent
        .signal("y", "m")
        .is(|state, [a, _]| state.states[a].pose.y_m)
        .about("front bumper along world y (left)")
        .seen_in(-10.0, 10.0)
        .always(),
    Agent
        .signal("heading", "rad")
        .is(|state, [a, _]| state.states[a].pose.heading_rad)
        .about("counter-clockwise from world x")
        .seen_in(-1.0, 1.0)
        .always(),
    Agent
        .signal("speed", "m/s")
        .is(|state, [a, _]| state.states[a].speed_mps)
        .about("velocity along the heading")
        .within(|spec, [a, _]| if spec.agents[a].body.is_on_foot() {
Interval::ANY
} else {
between(SLOWEST_MPS, FASTEST_MPS)
})
        .seen_in(0.0, 30.0)
        .always(),
    Agent
        .signal("accel", "m/s²")
        .is(|state, [a, _]| state.states[a].accel_mps2)
        .about("acceleration along the heading over the last sample")
        .seen_in(-5.0, 5.0)
        .always(),
    Agent
        .signal("s", "m")
        .is(|state, [a, _]| state.on_road[a].s_m)
        .about("front bumper along the road")
        .seen_in(-100.0, 100.0),
    Agent
        .signal("lateral", "m")
        .is(|state, [a, _]| state.on_road[a].lateral_m)
        .about("offset to the left of the middle of lane 0")
        .seen_in(-10.0, 10.0),
    Agent
        .signal("lateral_speed", "m/s")
        .is(|state, [a, _]| state.velocity_mps(a).y)
        .about("velocity across the road, to the left")
        .seen_in(-3.0, 3.0),
    Agent
        .signal("lane", "")
        .is(|state, [a, _]| {
            let road = state.spec.road_of(a);
            road.lane_at(state.on_road[a].lateral_m) as f64
        })
        .about("lane of the front bumper, 0 is the rightmost")
        .within(|spec, [a, _]| zero_to(spec.road_of(a).lanes() as f64 - 1.0))
        .seen_in(0.0, 3.0),
    Agent
        .signal("yaw_rate", "rad/s")
        .is(|state, [a, _]| state.states[a].yaw_rate_rad_per_s)
        .about("turning rate, counter-clockwise")
        .seen_in(-1.0, 1.0),
    Agent
        .signal("planned.s", "m")
        .is(|state, [a, _]| state.planned_of(a).s_m)
        .about("front bumper along the road, as its plan has it")
        .only_if(keeps_to_a_plan)
        .seen_in(-100.0, 100.0),
    Agent
        .signal("planned.lateral", "m")
        .is(|state, [a, _]| state.planned_of(a).lateral_m)
        .about("offset to the left of the middle of lane 0, as its plan has it")
        .only_if(keeps_to_a_plan)
        .seen_in(-10.0, 10.0),
    Agent
        .signal("planned.speed", "m/s")
        .is(|state, [a, _]| state.planned_of(a).speed_mps)
        .about("velocity along the heading, as its plan has it")
        .only_if(keeps_to_a_plan)
        .within(|_, _| zero_to(FASTEST_MPS))
        .seen_in(0.0, 30.0),
    Agent
        .signal("action", "")
        .is(|state, [a, _]| state.actions[a][1] as f64)
        .about("number of its last action, from 0 on in the order of the world file; the one without effect before the first decision")
        .only_if(acts)
        .within(action_bounds),
    Agent
        .signal("action_before", "")
        .is(|state, [a, _]| state.actions[a][0] as f64)
        .about("number of the action before its last one")
        .only_if(acts)
        .within(action_bounds),
    Pair.signal("headway", "m")
        // Both on the road of the first, since stations of two roads do not compare.
        .is(|state, [a, b]| state.on_road_of(a, b).s_m - state.on_road[a].s_m)
        .about("distance along the road from {a} to {b}, front to front; negative if {b} is behind {a}")
        .seen_in(-100.0, 100.0),
    Pair.signal("lateral", "m")
        .is(|state, [a, b]| state.on_road_of(a, b).lateral_m - state.on_road[a].lateral_m)
        .about("lateral offset of {b} from {a}, to the left")
        .seen_in(-10.0, 10.0),
    Pair.signal("distance", "m")
        .is(|state, [a, b]| {
            let (from, to) = (&state.states[a].pose, &state.states[b].pose);
            let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
            (dx * dx + dy * dy).sqrt()
        })
        .about("distance between {a} and {b}, front to front as the crow flies")
        .within(|_, _| zero_to(f64::INFINITY))
        .seen_in(0.0, 100.0),
    Pair.signal("gap", "m")
        .is(|state, [a, b]| state.plant.gap_m(state.bodies[a], state.bodies[b]))
        .about("clearance between the bodies of {a} and {b}")
        .within(|_, _| zero_to(f64::INFINITY))
        .seen_in(0.0, 100.0),
    Pair.signal("ttc", "s")
        .is(time_to_collision_s)
        .about("clearance along the road over closing speed, at most 100 s")
        .within(|_, _| zero_to(TTC_CAP_S))
        .seen_in(0.0, 20.0),
    Pair.signal("contact", "")
        .holds_if(|state, [a, b]| {
            // A contact names the lower body first.
            let pair = (state.bodies[a.min(b)], state.bodies[a.max(b)]);
            state.touch.is_some_and(|contact| contact.pair == pair)
        })
        .about("whether {a} and {b} touched"),
    Pair.signal("conflict", "m")
        .is(|state, pair| state.conflict_m(pair).unwrap_or(NEVER_M))
        .about("distance along its road from {a} to where the way of {b} crosses, positive before it; 1000 m if they never cross")
        .only_if(on_two_roads)
        .seen_in(-20.0, 80.0),
    Pair.signal("conflict_time", "s")
        .is(time_to_conflict_s)
        .about("time until {a} is there at its present speed, 0 to 100 s; 100 once its rear has passed, while it stands, and if the ways never cross")
        .only_if(on_two_roads)
        .within(|_, _| zero_to(TTC_CAP_S))
        .seen_in(0.0, 20.0),
    Pair.signal("priority", "")
        .holds_if(|state, pair| goes_first(state.network.crossings(pair[0], pair[1]), state.spec.priorities(pair)))
        .about("whether {a} goes before {b} where their ways cross")
        .only_if(on_two_roads),
    Light
        .signal("green", "")
        .holds_if(|state, [l, _]| state.lights[l].phase == Phase::Green)
        .about("whether {a} is green"),
    Light
        .signal("yellow", "")
        .holds_if(|state, [l, _]| state.lights[l].phase == Phase::Yellow)
        .about("whether {a} is yellow"),
    Light
        .signal("red", "")
        .holds_if(|state, [l, _]| state.lights[l].phase == Phase::Red)
        .about("whether {a} is red"),
    Light
        .signal("phase", "")
        .is(|state, [l, _]| match state.lights[l].phase {
            Phase::Green => 0.0,
            Phase::Yellow => 1.0,
            Phase::Red => 2.0,
        })
        .about("0 while {a} is green, 1 yellow, 2 red")
        .within(|_, _| zero_to(2.0))
        .always(),
    Light
        .signal("phase_time", "s")
        .is(|state, [l, _]| state.phase_s(l))
        .about("for how long {a} has been in its phase")
        .within(|spec, _| zero_to(spec.clock.horizon_s))
        .seen_in(0.0, 10.0),
    AgentAndLight
        .signal("line", "m")
        .is(|state, [a, l]| state.line_m(a, l))
        .about("distance along the road from {a} to the stop line of {b}, positive before it")
        .seen_in(-50.0, 50.0),
    Weather
        .signal("friction", "")
        .is(|state, _| weather(state, |it| it.friction))
        .about("coefficient of friction μ of the road")
        .only_if(|spec, _| changes(spec, |it| it.friction))
        .within(friction_bounds)
        .always(),
    Weather
        .signal("visibility", "m")
        .is(|state, _| weather(state, |it| it.visibility_m))
        .about("distance from the ego's front beyond which it sees no road user")
        .only_if(|spec, _| changes(spec, |it| it.visibility_m))
        .within(|spec, _| bounds_of(spec, |it| it.visibility_m))
        .always(),
    Weather
        .signal("noise", "")
        .is(|state, _| weather(state, |it| it.noise_scale))
        .about("factor on the noise of the ego's sensors")
        .only_if(|spec, _| changes(spec, |it| it.noise_scale))
        .within(|spec, _| bounds_of(spec, |it| it.noise_scale))
        .always(),
    Weather
        .signal("friction_rate", "1/s")
        .is(|state, _| weather(state, |it| it.changes.friction_per_s))
        .about("change of the friction over the last sample")
        .only_if(|spec, _| changes(spec, |it| it.friction))
        .seen_in(-0.5, 0.5),
    Weather
        .signal("visibility_rate", "m/s")
        .is(|state, _| weather(state, |it| it.changes.visibility_mps))
        .about("change of the visibility over the last sample")
        .only_if(|spec, _| changes(spec, |it| it.visibility_m))
        .seen_in(-50.0, 50.0),
    Weather
        .signal("noise_rate", "1/s")
        .is(|state, _| weather(state, |it| it.changes.noise_per_s))
        .about("change of the noise over the last sample")
        .only_if(|spec, _| changes(spec, |it| it.noise_scale))
        .seen_in(-2.0, 2.0),
    Road.signal("curvature", "1/m")
        .is(|state, _| state.network.main().last_curvatures_per_m()[0])
        .about("curvature of the last laid piece, positive to the left")
        .within(|spec, _| curvature_bounds(spec))
        .always(),
    Road.signal("pieces", "")
        .is(|state, _| state.network.main().piece_count() as f64)
        .about("number of pieces of the road")
        .seen_in(0.0, 50.0)
        .always(),
    Road.signal("curvature_change", "1/m")
        .is(|state, _| {
            let [last, before] = state.network.main().last_curvatures_per_m();
            last - before
        })
        .about("curvature of the last laid piece minus that of the piece before")
        .seen_in(-0.03, 0.03),
    Road.signal("radius", "m")
        .is(|state, _| {
            let [last, _] = state.network.main().last_curvatures_per_m();
            // Traces hold finite numbers only, and a straight piece has an infinite
            // radius.
            (1.0 / last.abs()).min(STRAIGHT_M)
        })
        .about("radius of the last laid piece, 10,000 if it is straight")
        .within(|_, _| zero_to(STRAIGHT_M))
        .seen_in(0.0, 300.0),
    Road.signal("ahead", "m")
        .is(|state, _| {
            // Invariant: an assembled scene has exactly one.
            let ego = state.spec.egos().next().unwrap_or(0);
            state.network.main().end_s_m() - state.on_road[ego].s_m
        })
        .about("distance along the road from the ego's front to the end of the last laid piece")
        .seen_in(0.0, 100.0),
    Road.signal("turned", "rad")
        .is(|state, _| {
            let course = state.network.main();
            course.pose(course.end_s_m(), 0.0).heading_rad
        })
        .about("heading at the end of the last laid piece, counter-clockwise from world x")
        .seen_in(-1.5, 1.5),
    Parameter
        .signal("parameter", "")
        .is(|state, [p, _]| state.parameters.get(p).copied().unwrap_or_default())
        .about("a number of the start")
        .within(|spec, [p, _]| {
            let range = spec.parameters.values().nth(p);
            range.map_or(Interval::ANY, |range| between(range.lo, range.hi))
        }),
];

/// Returns clearance along the road over closing speed, capped if not closing.
fn time_to_collision_s(state: &SceneState, [a, b]: [usize; 2]) -> f64 {
    let agents = &state.spec.agents;
    // Oncoming and crossing agents have no common direction, so the clearance
    // is computed from the space that both occupy.
    if !(agents[a].is_with_road() && agents[b].is_with_road()) {
        let (clearance_m, closing_mps) = state.closing_along([a, b]);
        return capped_s(clearance_m, closing_mps);
    }
    let ahead_m = state.on_road[b].s_m - state.on_road[a].s_m;
    // Positions are front bumpers, so the length of the leading body is
    // subtracted.
    let front = if ahead_m > 0.0 { b } else { a };
    let clearance_m = ahead_m.abs() - state.spec.agents[front].body.length_m;
    // Positive for an approach, whichever of the two is ahead.
    let closing_mps = (state.velocity_mps(a).x - state.velocity_mps(b).x) * ahead_m.signum();
    capped_s(clearance_m, closing_mps)
}

/// Returns the time for a distance at a speed, capped without speed.
fn capped_s(way_m: f64, speed_mps: f64) -> f64 {
    if speed_mps <= 0.0 {
        return TTC_CAP_S;
    }
    // Bodies that overlap have a clearance below 0, which is no time.
    (way_m.max(0.0) / speed_mps).min(TTC_CAP_S)
}

/// Returns the time to the conflict point, capped if passed or never reached.
fn time_to_conflict_s(state: &SceneState, pair: [usize; 2]) -> f64 {
    let [a, _] = pair;
    match state.conflict_m(pair) {
        // The conflict lasts until the rear of `a` has passed the point.
        Some(way_m) if -state.spec.agents[a].body.length_m <= way_m => {
            capped_s(way_m, state.states[a].speed_mps)
        }
        _ => TTC_CAP_S,
    }
}

fn weather(state: &SceneState, read: fn(&WeatherState) -> f64) -> f64 {
    // Invariant: the signals exist in worlds with weather only.
    state.weather.as_ref().map_or(0.0, read)
}

fn changes(spec: &DriveSpec, bounds: fn(&DrivenWeather) -> Option<Range>) -> bool {
    spec.weather.as_ref().and_then(bounds).is_some()
}

fn bounds_of(spec: &DriveSpec, bounds: fn(&DrivenWeather) -> Option<Range>) -> Interval {
    let bounds = spec.weather.as_ref().and_then(bounds);
    bounds.map_or(Interval::ANY, |range| between(range.lo, range.hi))
}

fn friction_bounds(spec: &DriveSpec, _: [usize; 2]) -> Interval {
    let Interval { lo, hi } = bounds_of(spec, |it| it.friction);
    // A changed road may begin beyond a bound.
    let road = spec.road.friction();
    between(lo.min(road), hi.max(road))
}

/// Bounds of the curvatures that an ado lays, with those of the listed pieces.
fn curvature_bounds(spec: &DriveSpec) -> Interval {
    let Some(Actions::Curvatures(list)) = spec.road_ado.as_ref().map(|road| &road.actions) else {
        return Interval::ANY;
    };
    let pieces = spec
        .road
        .course()
        .map(|course| course.pieces())
        .unwrap_or_default();
    let listed = pieces.iter().map(|piece| piece.curvature_per_m);
    let all = listed.chain(list.iter().copied());
    // A road that has turned by its limit is laid straight.
    let (lo, hi) = all.fold((0.0_f64, 0.0_f64), |(lo, hi), it| (lo.min(it), hi.max(it)));
    between(lo, hi)
}

fn acts(spec: &DriveSpec, [a, _]: [usize; 2]) -> bool {
    spec.agents[a].actions().is_some()
}

fn action_bounds(spec: &DriveSpec, [a, _]: [usize; 2]) -> Interval {
    let actions = spec.agents[a].actions();
    zero_to(actions.map_or(0.0, |set| set.len().saturating_sub(1) as f64))
}

fn keeps_to_a_plan(spec: &DriveSpec, [a, _]: [usize; 2]) -> bool {
    spec.agents[a].plan().is_some()
}

fn on_two_roads(spec: &DriveSpec, [a, b]: [usize; 2]) -> bool {
    spec.agents[a].road != spec.agents[b].road
}
