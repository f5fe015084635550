//! Planned motions: steps that follow laws, or a meeting with the ego.
//!
//! The laws are those of OpenSCENARIO files, so that worlds can express the
//! motions of test protocols. Numbers have a type `N`: a number or a range in a
//! world, and a number once a start is drawn. The trigger of a step has a type
//! `W`: a formula.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::road::ChangeShape;

/// Planned motion of an agent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(bound(
    serialize = "N: Serialize + PartialEq + From<f64>, W: Serialize",
    deserialize = "N: Deserialize<'de> + From<f64>, W: Deserialize<'de>"
))]
#[schemars(bound = "N: JsonSchema + Serialize + PartialEq + From<f64>, W: JsonSchema + Serialize")]
pub enum MotionPlan<N, W> {
    /// Steps in sequence.
    Script(Vec<ScriptStep<N, W>>),
    /// Arrival at a place when the ego arrives at one.
    Meet(MeetEgo<N>),
}

/// A step of a script.
///
/// It waits for the end of the preceding step, then for its formula, then for a
/// delay. It then begins all its laws at once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Step", deny_unknown_fields)]
#[serde(bound(
    serialize = "N: Serialize + PartialEq + From<f64>, W: Serialize",
    deserialize = "N: Deserialize<'de> + From<f64>, W: Deserialize<'de>"
))]
#[schemars(bound = "N: JsonSchema + Serialize + PartialEq + From<f64>, W: JsonSchema + Serialize")]
pub struct ScriptStep<N, W> {
    /// Formula over present and past that triggers the step. Default: at once.
    #[serde(default)]
    pub when: Option<W>,
    /// Delay after the trigger.
    #[serde(default = "zero::<N>", skip_serializing_if = "is_zero")]
    pub after_s: N,
    /// Laws to begin: at most one along the path and one across it.
    #[serde(default)]
    pub does: Vec<MotionLaw<N>>,
    /// Whether the next step may begin while the law across the path goes on.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub overlaps: bool,
}

/// Change of a motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[serde(bound(deserialize = "N: Deserialize<'de> + From<f64>"))]
#[schemars(bound = "N: JsonSchema + Serialize")]
pub enum MotionLaw<N> {
    /// The speed v changes to a new value.
    Speed {
        /// Target speed.
        to_mps: N,
        /// Agent whose speed at the start of the step is added to the target.
        #[serde(default)]
        relative_to: Option<String>,
        /// Greatest rate |v̇|. Default: at once.
        #[serde(default)]
        rate_mps2: Option<N>,
        /// Course of the change. Default: linear.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shape: Option<ChangeShape>,
    },
    /// The speed v changes linearly to 0.
    Brake {
        /// Rate |v̇|.
        rate_mps2: N,
    },
    /// Lateral motion by Δ: y = Δ/2·(1 − cos πt/T), T = π·|Δ|/(2·rate).
    ///
    /// With `Cubic` it is y = Δ·p²·(3 − 2p), p = t/T, T = 1.5·|Δ|/rate, and
    /// with `Linear` y = Δ·p, T = |Δ|/rate.
    ///
    /// The speed v stays that along the heading, so lateral motion reduces
    /// progress along the road.
    LaneChange {
        /// Distance Δ, to the left in road direction.
        by_m: N,
        /// Greatest lateral speed.
        rate_mps: N,
        /// Course of the change. Default: cosine.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shape: Option<ChangeShape>,
    },
    /// Lateral motion to an offset from the middle of the lane.
    ///
    /// The lane is that of the start, shifted by all lane changes since. The
    /// curve is that of `LaneChange` with T = π·√(|Δ|/(2·a)). The speed v stays
    /// that along the road.
    LaneOffset {
        /// Target offset, to the left in road direction.
        to_m: N,
        /// Greatest lateral acceleration a.
        most_lateral_mps2: N,
    },
    /// On foot: a distance at a constant speed, reached at once.
    Walk {
        /// Speed.
        speed_mps: N,
        /// Distance.
        way_m: N,
    },
}

/// Arrival at a place when the ego arrives at one.
///
/// The ego is assumed to keep its initial speed. The agent stands, accelerates
/// evenly and keeps its speed for the last part of the distance and beyond. If
/// the time is too short to stand first, it begins in motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Meet", deny_unknown_fields)]
pub struct MeetEgo<N> {
    /// Front bumper of the ego at the meeting, along the world's own road.
    pub ego_at_m: N,
    /// Own front at the meeting, along its road. For crossing agents, its `lateral`.
    pub here_at_m: N,
    /// Final speed.
    pub speed_mps: N,
    /// Length of the steady part before the meeting.
    pub steady: SteadyPart<N>,
}

/// The last part of a path, driven at constant speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum SteadyPart<N> {
    /// Part given by its length.
    Metres(N),
    /// Part given by its duration.
    Seconds(N),
}

fn zero<N: From<f64>>() -> N {
    N::from(0.0)
}

fn is_zero<N: PartialEq + From<f64>>(number: &N) -> bool {
    *number == zero()
}

/// Name and unit of a number in a plan.
pub(super) type PlanNumber = (&'static str, &'static str);

impl<N: Copy> MotionLaw<N> {
    /// Returns the same law with converted numbers, in the order of the fields.
    pub fn map<M>(&self, mut f: impl FnMut(PlanNumber, N) -> M) -> MotionLaw<M> {
        match self {
            MotionLaw::Speed {
                to_mps,
                relative_to,
                rate_mps2,
                shape,
            } => MotionLaw::Speed {
                to_mps: f(("speed.to", "m/s"), *to_mps),
                relative_to: relative_to.clone(),
                rate_mps2: rate_mps2.map(|it| f(("speed.rate", "m/s²"), it)),
                shape: *shape,
            },
            MotionLaw::Brake { rate_mps2 } => MotionLaw::Brake {
                rate_mps2: f(("brake.rate", "m/s²"), *rate_mps2),
            },
            MotionLaw::LaneChange {
                by_m,
                rate_mps,
                shape,
            } => MotionLaw::LaneChange {
                shape: *shape,
                by_m: f(("lane_change.by", "m"), *by_m),
                rate_mps: f(("lane_change.rate", "m/s"), *rate_mps),
            },
            MotionLaw::LaneOffset {
                to_m,
                most_lateral_mps2,
            } => MotionLaw::LaneOffset {
                to_m: f(("lane_offset.to", "m"), *to_m),
                most_lateral_mps2: f(("lane_offset.most_lateral", "m/s²"), *most_lateral_mps2),
            },
            MotionLaw::Walk { speed_mps, way_m } => MotionLaw::Walk {
                speed_mps: f(("walk.speed", "m/s"), *speed_mps),
                way_m: f(("walk.way", "m"), *way_m),
            },
        }
    }

    /// Returns whether it moves across the path, and not along it.
    pub fn is_across(&self) -> bool {
        matches!(
            self,
            MotionLaw::LaneChange { .. } | MotionLaw::LaneOffset { .. }
        )
    }
}

impl<N: Copy, W> MotionPlan<N, W> {
    /// Returns the same plan with converted numbers and without formulas.
    ///
    /// `f` receives dotted names, in which steps count from 1.
    pub fn map<M>(&self, mut f: impl FnMut(&str, &'static str, N) -> M) -> MotionPlan<M, ()> {
        match self {
            // The order of these calls is that of the axes of X_init. Recorded
            // starts depend on it.
            MotionPlan::Script(steps) => {
                let steps = steps.iter().zip(1..).map(|(step, number)| {
                    let mut of_step =
                        |(name, unit), it| f(&format!("step{number}.{name}"), unit, it);
                    ScriptStep {
                        when: None,
                        after_s: of_step(("after", "s"), step.after_s),
                        does: step.does.iter().map(|law| law.map(&mut of_step)).collect(),
                        overlaps: step.overlaps,
                    }
                });
                MotionPlan::Script(steps.collect())
            }
            MotionPlan::Meet(meet) => {
                let mut of_meet = |name, unit, it| f(&format!("meet.{name}"), unit, it);
                MotionPlan::Meet(MeetEgo {
                    ego_at_m: of_meet("ego_at", "m", meet.ego_at_m),
                    here_at_m: of_meet("here_at", "m", meet.here_at_m),
                    speed_mps: of_meet("speed", "m/s", meet.speed_mps),
                    steady: match meet.steady {
                        SteadyPart::Metres(it) => SteadyPart::Metres(of_meet("steady", "m", it)),
                        SteadyPart::Seconds(it) => SteadyPart::Seconds(of_meet("steady", "s", it)),
                    },
                })
            }
        }
    }

    /// Returns its steps. A meeting has none.
    pub fn steps(&self) -> &[ScriptStep<N, W>] {
        match self {
            MotionPlan::Script(steps) => steps,
            MotionPlan::Meet(_) => &[],
        }
    }

    /// Returns whether it proceeds alike regardless of all other agents.
    pub fn is_blind(&self) -> bool {
        let steps = self.steps().iter();
        let mut laws = steps.clone().flat_map(|step| &step.does);
        let looks = laws.any(|law| {
            matches!(
                law,
                MotionLaw::Speed {
                    relative_to: Some(_),
                    ..
                }
            )
        });
        !looks && steps.clone().all(|step| step.when.is_none())
    }
}

/// Begin of a meeting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Initial speed.
    pub from_mps: f64,
    /// Time at which it begins to accelerate.
    pub begins_s: f64,
    /// Acceleration from then on.
    pub accel_mps2: f64,
    /// Final speed.
    pub to_mps: f64,
}

impl Approach {
    /// Returns the meeting as the single step of a script.
    pub(super) fn step(self) -> ScriptStep<f64, ()> {
        ScriptStep {
            when: None,
            after_s: self.begins_s,
            does: vec![MotionLaw::Speed {
                to_mps: self.to_mps,
                relative_to: None,
                // No rate means at once, and an infinite one has no place in a file.
                rate_mps2: self.accel_mps2.is_finite().then_some(self.accel_mps2),
                shape: None,
            }],
            overlaps: false,
        }
    }
}

/// Reason why a meeting is infeasible, with advice.
pub(super) type Unmet = (String, &'static str);

impl MeetEgo<f64> {
    /// Solves the law for a start.
    ///
    /// `ego_m` and `ego_mps` are the initial position and speed of the ego's front.
    /// `way_m` is the distance from the own start to the meeting. The last D are driven at
    /// the speed v, and r = way − D before that. From a standstill an even
    /// acceleration takes 2·r/v. If only t < 2·r/v is left, the agent begins at
    /// 2·r/t − v.
    ///
    /// # Errors
    /// The ego never gets there, or the distance is shorter than its steady part.
    pub fn approach(&self, ego_m: f64, ego_mps: f64, way_m: f64) -> Result<Approach, Unmet> {
        if self.speed_mps <= 0.0 {
            return Err((
                format!("an agent that meets the ego at {} m/s", self.speed_mps),
                "`speed_mps` must be above 0",
            ));
        }
        let until_s = (self.ego_at_m - ego_m) / ego_mps;
        // Also rejects NaN and infinity, which a standing ego gives. The upper
        // bound rejects an ego that hardly moves.
        if !(0.0..=1e6).contains(&until_s) {
            return Err((
                format!(
                    "the ego starts at {ego_m} m with {ego_mps} m/s and is never at {} m",
                    self.ego_at_m
                ),
                "`ego_at_m` lies ahead of the ego's start, and the ego starts moving",
            ));
        }
        let steady_m = match self.steady {
            SteadyPart::Metres(it) => it,
            SteadyPart::Seconds(it) => self.speed_mps * it,
        };
        let ramp_m = way_m - steady_m;
        if ramp_m < 0.0 {
            return Err((
                format!("a way of {way_m} m with its last {steady_m} m at one speed"),
                "start farther away, or make `steady` shorter",
            ));
        }
        let left_s = until_s - steady_m / self.speed_mps;
        // Without time for the ramp no finite acceleration exists.
        if left_s < 0.0 || (left_s == 0.0 && ramp_m > 0.0) {
            return Err((
                format!(
                    "the ego is at {} m after {until_s} s, before the steady part could be driven",
                    self.ego_at_m
                ),
                "let the ego start farther away, or make `steady` shorter",
            ));
        }
        // From rest at even acceleration, the mean speed is half of the final
        // one.
        let ramp_s = 2.0 * ramp_m / self.speed_mps;
        let (from_mps, begins_s) = if ramp_s <= left_s {
            (0.0, left_s - ramp_s)
        } else {
            // Too little time for a start from rest: the initial speed makes
            // the mean fit.
            (2.0 * ramp_m / left_s - self.speed_mps, 0.0)
        };
        Ok(Approach {
            from_mps,
            begins_s,
            // No ramp: the agent starts to move at its final speed.
            accel_mps2: if ramp_m == 0.0 {
                f64::INFINITY
            } else {
                (self.speed_mps - from_mps) / (left_s - begins_s)
            },
            to_mps: self.speed_mps,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meet(steady: SteadyPart<f64>) -> MeetEgo<f64> {
        MeetEgo {
            ego_at_m: 100.0,
            here_at_m: 0.0,
            speed_mps: 4.0,
            steady,
        }
    }

    /// Distance driven until the ego is at its place.
    fn driven_m(approach: &Approach, until_s: f64) -> f64 {
        let Approach {
            from_mps,
            begins_s,
            accel_mps2,
            to_mps,
        } = *approach;
        let ramp_s = (to_mps - from_mps) / accel_mps2;
        let ramp_m = 0.5 * (from_mps + to_mps) * ramp_s;
        from_mps * begins_s + ramp_m + to_mps * (until_s - begins_s - ramp_s)
    }

    #[test]
    fn who_has_time_stands_first() {
        let approach = meet(SteadyPart::Metres(12.0))
            .approach(0.0, 10.0, 14.0)
            .expect("it fits");
        // 12 m take 3 s of the 10, 2 m from a standstill 1 s.
        assert_eq!((approach.from_mps, approach.begins_s), (0.0, 6.0));
        assert!((driven_m(&approach, 10.0) - 14.0).abs() < 1e-12);
    }

    #[test]
    fn who_has_no_time_begins_moving() {
        let approach = meet(SteadyPart::Seconds(5.0))
            .approach(0.0, 10.0, 34.0)
            .expect("it fits");
        assert_eq!(approach.begins_s, 0.0);
        assert!(approach.from_mps > 0.0 && approach.from_mps < 4.0);
        assert!((driven_m(&approach, 10.0) - 34.0).abs() < 1e-12);
    }

    #[test]
    fn meetings_that_never_happen_are_refused() {
        let meet = meet(SteadyPart::Metres(12.0));
        assert!(meet.approach(0.0, 0.0, 14.0).is_err());
        assert!(meet.approach(110.0, 10.0, 14.0).is_err());
        assert!(meet.approach(0.0, 10.0, 11.0).is_err());
        assert!(meet.approach(80.0, 10.0, 14.0).is_err());
    }
}
