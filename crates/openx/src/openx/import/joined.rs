//! Several conditions that begin one event: all of a group, or any of several groups.

use super::entity::{Measure, WatchedCondition};
use super::story_element::StoryElement;
use crate::opendrive::error::ImportError;
use crate::opendrive::tree::XmlNode;

/// Start of an act or an event.
pub(super) enum StartTrigger {
    Never,
    /// Simulation time in seconds.
    At(f64),
    After {
        element: StoryElement,
        delay_s: f64,
    },
    When {
        watch: WatchedCondition,
        delay_s: f64,
    },
}

/// Returns the start of a group whose conditions must hold together.
///
/// Conditions that hold from the start on are left out, and without another the group
/// holds at once, which is `None`.
///
/// # Errors
///
/// Returns an error for conditions of instants, of elements, and of different delays.
pub(super) fn all_of(
    group: &XmlNode,
    mut all: Vec<StartTrigger>,
) -> Result<Option<StartTrigger>, ImportError> {
    if all.len() < 2 {
        return Ok(all.pop());
    }
    let refused = || {
        let what =
            "several conditions at a time, with edges or delays or of elements, are not read";
        let help = "begin the event by one condition, or put what it waits for into an event \
                    before it";
        group.refused(what, help)
    };
    let is_edge = |it: &XmlNode| it.raw("conditionEdge").is_some_and(|edge| edge != "none");
    if group.children.iter().any(is_edge) {
        return Err(refused());
    }
    let (watches, latest_s, delay_s) = parts(all, f64::max).ok_or_else(refused)?;
    let Some(delay_s) = delay_s else {
        return Ok(latest_s.map(StartTrigger::At));
    };
    // A time only matters once what it is delayed with could hold.
    let after_s = latest_s.map(|at_s| at_s - delay_s);
    let after_s = after_s.filter(|after_s| *after_s > 0.0);
    let watch = joined(group, watches, after_s, Measure::All);
    Ok(Some(StartTrigger::When { watch, delay_s }))
}

/// Returns the start of an element that any of several groups begins.
///
/// # Errors
///
/// Returns an error for groups with edges, of elements, and of different delays.
pub(super) fn any_of(
    trigger: &XmlNode,
    mut possible: Vec<StartTrigger>,
) -> Result<Option<StartTrigger>, ImportError> {
    if possible.len() < 2 {
        return Ok(possible.pop());
    }
    let refused = || {
        let what = "several ways to begin, with edges or delays or of elements, are not read";
        trigger.refused(what, "begin the event by one condition group")
    };
    let (watches, earliest_s, delay_s) = parts(possible, f64::min).ok_or_else(refused)?;
    let Some(delay_s) = delay_s else {
        return Ok(earliest_s.map(StartTrigger::At));
    };
    let is_early = earliest_s.is_some_and(|at_s| at_s < delay_s);
    if is_early || watches.iter().any(|watch| watch.rises) {
        return Err(refused());
    }
    let after_s = earliest_s.map(|at_s| at_s - delay_s);
    let watch = joined(trigger, watches, after_s, Measure::Any);
    Ok(Some(StartTrigger::When { watch, delay_s }))
}

/// Parts of several starts: what is watched, a time of the run, and the common delay.
type Parts = (Vec<WatchedCondition>, Option<f64>, Option<f64>);

/// Separates starts, or returns `None` for starts that cannot be joined.
fn parts(all: Vec<StartTrigger>, of_two: impl Fn(f64, f64) -> f64) -> Option<Parts> {
    let mut watches = Vec::new();
    let mut time_s: Option<f64> = None;
    let mut delays_s = Vec::new();
    for it in all {
        match it {
            StartTrigger::At(at_s) => {
                time_s = Some(time_s.map_or(at_s, |known_s| of_two(known_s, at_s)));
            }
            StartTrigger::When { watch, delay_s } => {
                watches.push(watch);
                delays_s.push(delay_s);
            }
            StartTrigger::After { .. } | StartTrigger::Never => return None,
        }
    }
    let first_s = delays_s.first().copied();
    let same = delays_s.iter().all(|delay_s| Some(*delay_s) == first_s);
    same.then_some((watches, time_s, first_s))
}

/// Returns conditions and a time as one condition.
fn joined(
    node: &XmlNode,
    mut watches: Vec<WatchedCondition>,
    after_s: Option<f64>,
    of: impl Fn(Vec<WatchedCondition>) -> Measure,
) -> WatchedCondition {
    let plain = |measure: Measure, value: f64| WatchedCondition {
        who: Vec::new(),
        needs_all: false,
        measure,
        is_below: false,
        value,
        rises: false,
        is_late: false,
        at: node.at(),
    };
    watches.extend(after_s.map(|after_s| plain(Measure::Time, after_s)));
    match (watches.pop(), watches.is_empty()) {
        (Some(single), true) => single,
        (last, _) => {
            watches.extend(last);
            plain(of(watches), 0.0)
        }
    }
}
