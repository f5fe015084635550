//! Entities of a scenario and their steps.

use super::bodies::ImportedBody;
use super::error::At;
use super::places::Placed;

/// Entity of a scenario.
#[derive(Clone, Debug)]
pub(super) struct ImportedEntity {
    pub name: String,
    pub is_ego: bool,
    pub body: ImportedBody,
    pub placed: Placed,
    pub speed_mps: f64,
    pub steps: Vec<ImportedStep>,
    pub approach: Option<Approached>,
    /// Initial bumper-to-bumper gap to the ego in metres, which replaces the place.
    pub gap_m: Option<f64>,
    /// Place of the entity's Init in the file.
    pub at: At,
}

/// Step of an entity's script.
#[derive(Clone, Debug)]
pub(super) struct ImportedStep {
    pub when: Option<ClearanceCondition>,
    pub after_s: f64,
    pub laws: Vec<ImportedLaw>,
}

/// Condition of a step: a clearance along the road, as a length or a time.
///
/// As a time, it is the clearance divided by the triggering entity's speed.
#[derive(Clone, Debug)]
pub(super) struct ClearanceCondition {
    /// Entities of which one, or all, must meet the condition.
    pub who: Vec<String>,
    pub needs_all: bool,
    pub target: String,
    pub is_below: bool,
    pub value: f64,
    pub is_time: bool,
    /// True if the condition must be false at the start.
    pub rises: bool,
    /// Place of the condition in the file.
    pub at: At,
}

/// Law of motion of a step.
#[derive(Clone, Debug)]
pub(super) enum ImportedLaw {
    Speed {
        to_mps: f64,
        relative_to: Option<String>,
        rate_mps2: Option<f64>,
    },
    LaneChange {
        by_m: f64,
        rate_mps: f64,
    },
    /// Change to an offset from the reference line, less the earlier lane changes.
    Beside {
        t_m: f64,
        most_lateral_mps2: f64,
    },
    Walk {
        speed_mps: f64,
        way_m: f64,
    },
}

/// Meeting: the entity reaches a place when the ego reaches another.
#[derive(Clone, Debug)]
pub(super) struct Approached {
    pub ego: Placed,
    pub here: Placed,
    pub speed_mps: f64,
    /// Last part of the approach, at constant speed.
    pub steady: Steady,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum Steady {
    Metres(f64),
    Seconds(f64),
}
