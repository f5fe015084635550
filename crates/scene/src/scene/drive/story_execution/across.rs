//! Laws of actions across the path, on curves, on other roads and at other places.

use std::sync::Arc;

use super::SampleStage;
use crate::road::{OnRoad, RoadNetwork};
use crate::scene::drive::beside_law::BesideLaw;
use crate::scene::drive::plan_way::{TrajectoryClock, TrajectoryLaw};
use crate::scene::drive::story_law::{LateralBase, LateralTiming, StoryLaw};
use crate::sim::Pose;
use crate::story::values::{CoordinateSystem, DistanceOrTime, FollowingMode, TrajectoryTiming};
use crate::story::view::{
    ActorAction, ActorDistance, ActorOffset, DistanceSide, PlaceFrame, SceneChange, StoryPlace,
    StoryView,
};

/// Distance of bodies out of reach from the start of the world's own road.
const AWAY_M: f64 = 9_000.0;
/// Distance between two of them.
const AWAY_APART_M: f64 = 30.0;

impl SampleStage<'_> {
    /// Returns the law of an action across the path or at another place.
    ///
    /// `None` for others, and for those that move nothing.
    pub(super) fn law_across(
        &self,
        agent: usize,
        action: &ActorAction,
        at_s: f64,
    ) -> Option<StoryLaw> {
        let law = match action {
            ActorAction::LaneOffset {
                target: ActorOffset::Relative(of, by_m),
                continuous,
                shape,
                most_lateral_mps2,
            } => {
                let beside = BesideLaw {
                    of: *of,
                    by_m: *by_m,
                    front_m: self.size(*of).front_m,
                    in_its_axes: false,
                    continuous: *continuous,
                    most_mps: f64::INFINITY,
                    most_accel_mps2: *most_lateral_mps2,
                    most_decel_mps2: *most_lateral_mps2,
                };
                if *continuous {
                    StoryLaw::Beside(beside)
                } else {
                    StoryLaw::Lateral {
                        from: LateralBase::Course,
                        // A law that does not continue aims at the place of the moment.
                        offset_m: self.on_road(agent, &self.reference(*of, at_s)).lateral_m + by_m,
                        shape: shape.curve(),
                        timing: LateralTiming::Acceleration(*most_lateral_mps2),
                    }
                }
            }
            ActorAction::LaneOffset {
                target: ActorOffset::Absolute(to_m),
                shape,
                most_lateral_mps2,
                ..
            } => StoryLaw::Lateral {
                // OpenSCENARIO counts absolute offsets from the middle of the actor's
                // lane.
                from: LateralBase::PresentLane,
                offset_m: *to_m,
                shape: shape.curve(),
                timing: LateralTiming::Acceleration(*most_lateral_mps2),
            },
            ActorAction::LaneOffset {
                target: ActorOffset::Line(lateral_m),
                shape,
                most_lateral_mps2,
                ..
            } => StoryLaw::Lateral {
                from: LateralBase::Course,
                offset_m: *lateral_m,
                shape: shape.curve(),
                timing: LateralTiming::Acceleration(*most_lateral_mps2),
            },
            ActorAction::LateralDistance(distance) => self.beside(agent, distance, at_s),
            ActorAction::FollowTrajectory {
                path,
                timing,
                following,
                initial_distance_m,
            } => StoryLaw::Follow(TrajectoryLaw {
                path: Arc::clone(path),
                clock: timing.as_ref().map(clock_of),
                is_smooth: *following == FollowingMode::Follow,
                // A file may ask for a start beyond the end.
                from_m: initial_distance_m.min(path.length_m),
            }),
            ActorAction::AssignRoute(road) => StoryLaw::Route(*road),
            ActorAction::Teleport(place) => self.placed(agent, place, at_s),
            _ => return None,
        };
        Some(law)
    }

    /// Returns the law of a change of the scene, with its agent. `None` for others.
    pub(super) fn law_of_change(
        &self,
        change: SceneChange,
        at_s: f64,
    ) -> Option<(usize, StoryLaw)> {
        match change {
            SceneChange::Add(agent, place) => Some((agent, self.placed(agent, &place, at_s))),
            SceneChange::Delete(agent) => {
                let to = out_of_reach(&self.state.network, agent);
                Some((agent, StoryLaw::Vanish { to }))
            }
            SceneChange::Friction(_) | SceneChange::TrafficSignal(..) => None,
        }
    }

    fn placed(&self, agent: usize, place: &StoryPlace, at_s: f64) -> StoryLaw {
        let at = self.pose_of(agent, place, at_s);
        let own = self.layout.spec.agents[agent].road;
        let road = match place.frame {
            PlaceFrame::Road(road) => Some(road.unwrap_or(own)),
            _ => None,
        };
        // A place on the own road needs no other one.
        StoryLaw::Place {
            at,
            road: road.filter(|road| *road != own),
        }
    }

    fn beside(&self, agent: usize, distance: &ActorDistance, at_s: f64) -> StoryLaw {
        let of = distance.of;
        let (own, other) = (self.reference(agent, at_s), self.reference(of, at_s));
        let [own_on, other_on] = [&own, &other].map(|pose| self.on_road(agent, pose));
        let away_m = match distance.distance {
            DistanceOrTime::Metres(away_m) => away_m,
            // Invariant: a distance across the path is a length.
            DistanceOrTime::Seconds(_) => 0.0,
        };
        let widths_m = self.size(agent).width_m + self.size(of).width_m;
        let whole_m = if distance.freespace {
            away_m + 0.5 * widths_m
        } else {
            away_m
        };
        let in_its_axes = distance.system == CoordinateSystem::Entity;
        let left_m = if in_its_axes {
            other.frame().to_local(own.point_m())[1]
        } else {
            own_on.lateral_m - other_on.lateral_m
        };
        // Sides are those of the other agent, which may face against the road.
        let turned = if in_its_axes { 1.0 } else { facing(&other_on) };
        let side = match distance.side {
            // On either side is allowed, so the agent stays on its own.
            DistanceSide::Any => 1f64.copysign(left_m),
            DistanceSide::More => turned,
            DistanceSide::Less => -turned,
        };
        let limit = |most: Option<f64>| most.unwrap_or(f64::INFINITY);
        let law = BesideLaw {
            of,
            by_m: side * whole_m,
            front_m: self.size(of).front_m,
            in_its_axes,
            continuous: distance.continuous,
            most_mps: limit(distance.limits.max_speed_mps),
            most_accel_mps2: limit(distance.limits.max_accel_mps2),
            most_decel_mps2: limit(distance.limits.max_decel_mps2),
        };
        if law.continuous || !law.is_unlimited() || in_its_axes {
            return StoryLaw::Beside(law);
        }
        StoryLaw::Lateral {
            from: LateralBase::Course,
            offset_m: other_on.lateral_m + law.by_m,
            shape: None,
            timing: LateralTiming::Acceleration(f64::INFINITY),
        }
    }
}

/// Returns 1 for a body that faces along its road, and −1 against it.
fn facing(at: &OnRoad) -> f64 {
    libm::cos(at.heading_rad).signum()
}

fn clock_of(timing: &TrajectoryTiming<f64>) -> TrajectoryClock {
    let (TrajectoryTiming::Absolute { scale, offset_s }
    | TrajectoryTiming::Relative { scale, offset_s }) = timing;
    TrajectoryClock {
        is_relative: matches!(timing, TrajectoryTiming::Relative { .. }),
        scale: *scale,
        offset_s: *offset_s,
    }
}

/// Returns the pose at which an agent stands that is no part of the scene.
///
/// It is behind and beside all roads, so that no signal of a distance is small.
fn out_of_reach(network: &RoadNetwork, agent: usize) -> Pose {
    let behind_m = AWAY_M + AWAY_APART_M * agent as f64;
    network.main().pose(-behind_m, -AWAY_M)
}
