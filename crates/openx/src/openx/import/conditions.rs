//! Conditions of steps in the form of a world file: formulas over signals.

use super::concrete::Concrete;
use super::draft::tidy;
use super::entity::{Measure, WatchedCondition};
use super::seen::{EntityInFrame, EntityPath};
use crate::opendrive::error::ImportError;

/// Curvature in 1/m up to which a distance along the road is that in the direction
/// of an entity.
const STRAIGHT_PER_M: f64 = 1.0 / 2000.0;
/// Curvature in 1/m up to which a clear distance is that of players, to some decimetres.
///
/// Beside it, they measure from the corners of boxes, and along the reference line.
const TIGHT_PER_M: f64 = 1.0 / 200.0;
/// Difference that separates a strict comparison from one that is not.
const STRICT: f64 = 0.000_001;

/// Formula of a quantity below or above a parameter.
///
/// It concerns one of several entities, or all of them. Also returns whether it must
/// have been false before.
///
/// # Errors
///
/// Returns an error for a quantity that a world has no signal for.
pub(super) fn formula(
    concrete: &Concrete,
    all: &[EntityInFrame],
    watch: &WatchedCondition,
    parameters: &mut TriggerParameters<'_>,
    is_first: bool,
) -> Result<(String, bool), ImportError> {
    if let Measure::All(parts) | Measure::Any(parts) = &watch.measure {
        let mut texts = Vec::new();
        for part in parts {
            // It may hold after its entities have passed each other.
            let (text, is_seen) = formula(concrete, all, part, parameters, false)?;
            if is_seen {
                let what = "an edge beside other conditions is not read";
                let help = "write conditionEdge=\"none\"";
                return Err(part.at.error(what).helped(help));
            }
            texts.push(text);
        }
        let and = if matches!(watch.measure, Measure::All(_)) {
            "and"
        } else {
            "or"
        };
        return Ok((format!("({})", texts.join(&format!(") {and} ("))), false));
    }
    let parameter = &parameters.next(watch.value);
    if let Measure::Time = watch.measure {
        return Ok((format!("time >= {parameter} + {STRICT}"), false));
    }
    let find = |name: &str| {
        let found = all.iter().find(|it| it.entity.name == name);
        let what = format!("no agent is called `{name}`");
        found.ok_or_else(|| {
            let error = watch
                .at
                .error(what)
                .helped("name an entity that the Init places");
            error.following(concrete.unread.iter().any(|it| it == name))
        })
    };
    let target = match &watch.measure {
        Measure::Clearance { target, .. }
        | Measure::Along { target, .. }
        | Measure::Gap { target }
        | Measure::Apart { target }
        | Measure::Collision { target }
        | Measure::Faster { target } => Some(find(target)?),
        _ => None,
    };
    let who = watch
        .who
        .iter()
        .map(|name| find(name))
        .collect::<Result<Vec<&EntityInFrame>, ImportError>>()?;
    let is_on_roads = !matches!(
        watch.measure,
        Measure::Speed | Measure::Acceleration | Measure::Faster { .. } | Measure::Gap { .. }
    );
    let turns = |it: &&EntityInFrame| match it.path {
        EntityPath::Own(_, on) => on.is_lane || on.has_corners() || it.entity.body.on_foot,
        _ => false,
    };
    if is_on_roads && who.iter().chain(target.iter()).any(turns) {
        let what = "a distance between entities on different roads is not read";
        let help = "wait for a time, a speed or the distance between both boxes";
        return Err(watch.at.error(what).helped(help));
    }
    let quantities = who
        .iter()
        .map(|it| ConditionQuantity::of(concrete, watch, it, target))
        .collect::<Result<Vec<ConditionQuantity>, ImportError>>()?;
    let mut holding = quantities.iter().map(|it| it.holds_at_start(watch));
    let holds = if watch.needs_all {
        holding.all(|holds| holds)
    } else {
        holding.any(|holds| holds)
    };
    // An edge from false to true requires that it was false since the step waits.
    let is_seen = watch.rises && (holds || watch.is_late || quantities.iter().any(|it| it.is_near));
    let parts: Vec<String> = quantities
        .iter()
        .zip(&who)
        .map(|(it, who)| it.text(watch, who, target, parameter, is_first))
        .collect();
    let text = match (&parts[..], watch.needs_all) {
        ([one], _) => one.clone(),
        (_, true) => format!("({})", parts.join(") and (")),
        (_, false) => format!("({})", parts.join(") or (")),
    };
    Ok((text, is_seen))
}

/// Parameters of the conditions of a world, named after the entity that waits.
pub(super) struct TriggerParameters<'a> {
    pub name: &'a str,
    pub list: &'a mut Vec<(String, f64)>,
}

impl TriggerParameters<'_> {
    /// Adds a parameter, and returns its name.
    fn next(&mut self, value: f64) -> String {
        // All points of a world share the names of its parameters.
        let parameter = match self.list.len() {
            0 => format!("{}_trigger", self.name),
            before => format!("{}_trigger_{}", self.name, before + 1),
        };
        self.list.push((parameter.clone(), value));
        parameter
    }
}

/// ConditionQuantity of one entity: its expression, and its value at the start.
struct ConditionQuantity {
    text: String,
    start: f64,
    /// Speed of the entity, if the quantity is a time.
    over: Option<f64>,
    /// False while the quantity has no value at the start.
    is_defined: bool,
    /// True if the value at the start is too near to the bound to tell on which side it is.
    is_near: bool,
}

impl ConditionQuantity {
    fn of(
        concrete: &Concrete,
        watch: &WatchedCondition,
        who: &EntityInFrame,
        target: Option<&EntityInFrame>,
    ) -> Result<ConditionQuantity, ImportError> {
        let front_m = |it: &EntityInFrame| it.spot.x_m + it.front_along_m();
        let plain = |text: String, start: f64| ConditionQuantity {
            text,
            start,
            over: None,
            is_defined: true,
            is_near: false,
        };
        let refused = |what: &str| {
            let help = "wait for a time, a speed or the distance between both boxes";
            Err(watch.at.error(what).helped(help))
        };
        let name = &who.name;
        // Signals are those of fronts, and files compare reference points.
        let at = (
            format!("({name}.s - {})", tidy(who.front_along_m())),
            format!("({name}.lateral - {})", tidy(who.front_left_m())),
        );
        Ok(match (&watch.measure, target) {
            (Measure::Clearance { is_time, .. }, Some(target)) => {
                if concrete.bends_most_per_m() > TIGHT_PER_M {
                    return refused("a clear distance on a tight bend is not read");
                }
                let ahead_m = front_m(target) - front_m(who);
                // The pair is clear by the gap on either side. The gap is negative
                // while they overlap.
                let behind_m = -ahead_m - who.rear_m();
                let clear_m = (ahead_m - target.rear_m()).max(behind_m);
                ConditionQuantity {
                    start: clear_m.max(0.0),
                    over: is_time.then_some(who.entity.speed_mps),
                    // A time to what is behind is no value.
                    is_defined: !is_time || (behind_m <= 0.0 && who.entity.speed_mps > 0.0),
                    ..plain(String::new(), 0.0)
                }
            }
            (Measure::Along { is_time, .. }, Some(target)) => {
                if concrete.bends_most_per_m() > STRAIGHT_PER_M {
                    return refused("a distance between reference points on a bend is not read");
                }
                let ahead = format!("{name}.{}.headway", target.name);
                let more_m = who.front_along_m() - target.front_along_m();
                let ahead_m = target.spot.x_m - who.spot.x_m;
                let ahead = format!("({ahead} + {})", tidy(more_m));
                ConditionQuantity {
                    // A time to what is behind is no value, and distances have no sign.
                    text: if *is_time {
                        ahead
                    } else {
                        format!("abs{ahead}")
                    },
                    start: if *is_time { ahead_m } else { ahead_m.abs() },
                    over: is_time.then_some(who.entity.speed_mps),
                    is_defined: !is_time || (ahead_m >= 0.0 && who.entity.speed_mps > 0.0),
                    is_near: false,
                }
            }
            (Measure::Gap { .. }, Some(target)) => {
                let apart_m = who.entity.placed.spot.sees(&target.entity.placed.spot);
                // Boxes are nearer than their reference points, by half of both
                // at most.
                let reach_m = who.entity.body.length_m + target.entity.body.length_m;
                let start = libm::hypot(apart_m.x_m, apart_m.y_m);
                ConditionQuantity {
                    is_near: (start - watch.value).abs() < reach_m,
                    ..plain(format!("{name}.{}.gap", target.name), start)
                }
            }
            (Measure::Apart { .. }, Some(target)) => {
                if concrete.bends_most_per_m() > STRAIGHT_PER_M {
                    return refused("a distance between reference points on a bend is not read");
                }
                let along = format!(
                    "({name}.{}.headway + {})",
                    target.name,
                    tidy(who.front_along_m() - target.front_along_m())
                );
                let aside = format!(
                    "({}.lateral - {name}.lateral + {})",
                    target.name,
                    tidy(who.front_left_m() - target.front_left_m())
                );
                let apart = who.spot.sees(&target.spot);
                plain(
                    hypotenuse(&along, &aside),
                    libm::hypot(apart.x_m, apart.y_m),
                )
            }
            (Measure::Collision { .. }, Some(target)) => {
                if concrete.bends_most_per_m() > STRAIGHT_PER_M {
                    return refused("a time to collision on a bend is not read");
                }
                if !matches!(
                    (&who.path, &target.path),
                    (EntityPath::With, EntityPath::With)
                ) {
                    return refused("a time to collision is only read along the ego's road");
                }
                let clear_m = (front_m(target) - front_m(who) - target.rear_m()).max(0.0);
                let closing_mps = who.entity.speed_mps - target.entity.speed_mps;
                ConditionQuantity {
                    start: clear_m,
                    over: Some(closing_mps),
                    is_defined: clear_m > 0.0 && closing_mps > 0.0,
                    ..plain(
                        format!(
                            "({name}.{}.headway - {})",
                            target.name,
                            tidy(target.rear_m())
                        ),
                        0.0,
                    )
                }
            }
            (Measure::Faster { .. }, Some(target)) => {
                let more_mps = who.entity.speed_mps - target.entity.speed_mps;
                plain(format!("({name}.speed - {}.speed)", target.name), more_mps)
            }
            // It also has a part across the path, on bends.
            (Measure::Acceleration, _) => {
                let across = format!("({name}.speed * {name}.yaw_rate)");
                plain(hypotenuse(&format!("{name}.accel"), &across), 0.0)
            }
            (Measure::Speed, _) => plain(format!("{name}.speed"), who.entity.speed_mps),
            (Measure::Travelled, _) => {
                if !matches!(who.path, EntityPath::With) {
                    return refused("a travelled distance is only read along the ego's road");
                }
                plain(format!("({} - {})", at.0, tidy(who.spot.x_m)), 0.0)
            }
            (
                Measure::Place {
                    at: place,
                    is_along,
                },
                _,
            ) => {
                if concrete.bends_most_per_m() > STRAIGHT_PER_M {
                    return refused("a distance to a place on a bend is not read");
                }
                let place = concrete.station(place, &watch.at)?;
                let along = format!("({} - {})", at.0, tidy(place.x_m));
                let aside = format!("({} - {})", at.1, tidy(place.y_m));
                let off = (who.spot.x_m - place.x_m, who.spot.y_m - place.y_m);
                if *is_along {
                    plain(format!("abs{along}"), off.0.abs())
                } else {
                    plain(hypotenuse(&along, &aside), libm::hypot(off.0, off.1))
                }
            }
            _ => return refused("it names no entity"),
        })
    }

    /// Returns true if the condition holds at the start of the run.
    fn holds_at_start(&self, watch: &WatchedCondition) -> bool {
        let bound = watch.value * self.over.unwrap_or(1.0);
        let holds = if watch.is_below {
            self.start < bound
        } else {
            self.start > bound
        };
        self.is_defined && holds
    }

    fn text(
        &self,
        watch: &WatchedCondition,
        who: &EntityInFrame,
        target: Option<&EntityInFrame>,
        parameter: &str,
        is_first: bool,
    ) -> String {
        let speed = match (&watch.measure, target) {
            (Measure::Collision { .. }, Some(target)) => {
                format!("({}.speed - {}.speed)", who.name, target.name)
            }
            _ => format!("{}.speed", who.name),
        };
        let bound = match self.over {
            Some(_) => format!("{parameter} * {speed}"),
            None => parameter.to_owned(),
        };
        if let (Measure::Clearance { .. }, Some(target)) = (&watch.measure, target) {
            return clearance(watch, who, target, &bound, is_first);
        }
        let text = &self.text;
        // A formula has no strict comparison, so a small difference separates the
        // two.
        let compared = if watch.is_below {
            format!("{text} + {STRICT} <= {bound}")
        } else {
            format!("{text} >= {bound} + {STRICT}")
        };
        match self.over {
            Some(_) => format!("{compared} and {text} >= 0 and {speed} >= 0.001"),
            None => compared,
        }
    }
}

fn hypotenuse(along: &str, aside: &str) -> String {
    format!("sqrt({along} * {along} + {aside} * {aside})")
}

fn clearance(
    watch: &WatchedCondition,
    who: &EntityInFrame,
    target: &EntityInFrame,
    bound: &str,
    is_first: bool,
) -> String {
    let is_time = matches!(watch.measure, Measure::Clearance { is_time: true, .. });
    let headway = format!("{}.{}.headway", who.name, target.name);
    let ahead = format!("{headway} - {}", tidy(target.rear_m()));
    let behind = format!("-{headway} - {}", tidy(who.rear_m()));
    // Entities approach before they pass, and are far apart again after
    // passing. A first step below a bound therefore only watches the side of
    // the approach. A time to what is behind is no value.
    let is_ahead = who.spot.x_m <= target.spot.x_m;
    let clearance = match (watch.is_below && is_first, is_ahead) {
        (true, true) => ahead,
        (true, false) => behind.clone(),
        (false, _) if is_time => ahead,
        (false, _) => format!("max({ahead}, {behind})"),
    };
    // The comparison is strict: a touching entity has a clearance of 0 m, not
    // less.
    let compared = if watch.is_below {
        format!("max({clearance}, 0) + {STRICT} <= {bound}")
    } else {
        format!("{clearance} >= {bound} + {STRICT}")
    };
    match (is_time, watch.is_below, is_first && is_ahead) {
        (true, true, false) => format!("{compared} and 0 >= {behind}"),
        (true, false, _) => format!("{compared} and {}.speed >= 0.001", who.name),
        _ => compared,
    }
}
