//! Who is in a scenario, and what they do there.

use super::bodies::ImportedBody;
use super::error::At;
use super::places::Placed;

/// Somebody in it.
#[derive(Clone, Debug)]
pub(super) struct Entity {
    pub name: String,
    pub is_ego: bool,
    pub body: ImportedBody,
    pub placed: Placed,
    pub speed_mps: f64,
    pub steps: Vec<Step>,
    pub meets: Option<Approached>,
    /// So far before the ego at the start, bumper to bumper, whatever the place.
    pub gap_m: Option<f64>,
    /// Where the file places it.
    pub at: At,
}

/// A step of somebody's script.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub when: Option<Watch>,
    pub after_s: f64,
    pub laws: Vec<Law>,
}

/// What a step waits for: a clearance along the road, as a length or as the time
/// that the first needs for it.
#[derive(Clone, Debug)]
pub(super) struct Watch {
    /// One of these, or all of them.
    pub who: Vec<String>,
    pub needs_all: bool,
    pub whom: String,
    pub is_below: bool,
    pub value: f64,
    pub is_time: bool,
    /// Whether it must not hold from the beginning.
    pub rises: bool,
    /// Where the file states it.
    pub at: At,
}

/// What a step does.
#[derive(Clone, Debug)]
pub(super) enum Law {
    Speed {
        to_mps: f64,
        relative_to: Option<String>,
        rate_mps2: Option<f64>,
    },
    LaneChange {
        by_m: f64,
        rate_mps: f64,
    },
    /// To a place beside the reference line of the road, less the lane changes
    /// before.
    Beside {
        t_m: f64,
        most_lateral_mps2: f64,
    },
    Walk {
        speed_mps: f64,
        way_m: f64,
    },
}

/// Somebody who is at a place when the ego is at one.
#[derive(Clone, Debug)]
pub(super) struct Approached {
    pub ego: Placed,
    pub here: Placed,
    pub speed_mps: f64,
    /// By length, or else by time.
    pub steady: Steady,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Steady {
    Metres(f64),
    Seconds(f64),
}
