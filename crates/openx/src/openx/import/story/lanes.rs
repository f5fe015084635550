//! Actions across the path of an entity: lanes, offsets and distances.

use super::numbers::StatedIn;
use super::quantities::coordinate_system;
use super::speeds::{dynamics, shape};
use super::{StoryFrame, StoryWriter};
use crate::opendrive::error::ImportError;
use crate::opendrive::roads::OnLane;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::entity::ImportedEntity;
use crate::openx::import::frame::RoadFrame;
use crate::openx::import::places::lane_beside;
use crate::openx::import::seen::{EntityInFrame, EntityPath};
use crate::story::values::{Effect, LaneTarget, LateralDisplacement, OffsetTarget, StoryNumber};

/// Target across a road, as a line of it or as what the run decides.
enum TargetAcross {
    /// To the left of the reference line of the file's road.
    Line(f64),
    /// Beside the lane of an entity, so many lanes to the left.
    Lane { entity: String, lanes: i32 },
}

impl StoryWriter<'_> {
    pub(super) fn lane_change(
        &self,
        at: StatedIn<'_>,
        actors: &[&EntityInFrame<'_>],
    ) -> Result<Effect, ImportError> {
        let it = at.node;
        let dynamics = dynamics(at.at(it.inner("LaneChangeActionDynamics")?), self.numbers)?;
        let target = it.inner("LaneChangeTarget")?.only()?;
        let value = at.scope.lane(target, "value")?;
        let offset_m = at.scope.number_or_zero(it, "targetLaneOffset")?;
        let Some((frame, actor)) = self.single(it, actors)? else {
            // Without a frame no target is known.
            return Ok(Effect::LaneChange {
                target: LaneTarget::Absolute { lane: 0 },
                target_lane_offset_m: StoryNumber::Number(0.0),
                dynamics,
            });
        };
        let on = own_lane(it, actor.entity)?;
        let line = frame.concrete.roads.road(it, &on.road)?;
        let across = match target.name.as_str() {
            "AbsoluteTargetLane" => TargetAcross::Line(line.middle_m(it, value)?),
            "RelativeTargetLane" => match self.lane_of(at.at(target), frame, actor, value)? {
                Ok(of) => {
                    same_road(target, &of, &on)?;
                    // Left of an entity that faces against its road is the road's right.
                    let to = lane_beside(&of, value * of.side());
                    TargetAcross::Line(line.middle_m(it, to)?)
                }
                Err(entity) => TargetAcross::Lane {
                    entity: entity.name.clone(),
                    lanes: self.lanes_to_left(target, frame, entity, value)?,
                },
            },
            _ => {
                let help = "write an `AbsoluteTargetLane` or a `RelativeTargetLane`";
                return Err(target.refused("a target of this kind is not read", help));
            }
        };
        Ok(match across {
            TargetAcross::Line(t_m) => Effect::LaneChange {
                target: LaneTarget::Line {
                    lateral_m: self
                        .numbers
                        .stated(at, &[], line_m(frame, actor, t_m + offset_m)),
                },
                // The line contains the offset already.
                target_lane_offset_m: StoryNumber::Number(0.0),
                dynamics,
            },
            TargetAcross::Lane { entity, lanes } => Effect::LaneChange {
                target: LaneTarget::Relative { entity, lanes },
                target_lane_offset_m: self.numbers.or(at, "targetLaneOffset", 0.0)?,
                dynamics,
            },
        })
    }

    pub(super) fn lane_offset(
        &self,
        at: StatedIn<'_>,
        actors: &[&EntityInFrame<'_>],
    ) -> Result<Effect, ImportError> {
        let it = at.node;
        let target = it.inner("LaneOffsetTarget")?.only()?;
        let value = at.scope.number(target, "value")?;
        let changes = at.at(it.inner("LaneOffsetActionDynamics")?);
        let shape = shape(changes.node)?;
        let max_lateral_acc_mps2 = match changes.node.raw("maxLateralAcc") {
            Some(_) => Some(self.numbers.of(changes, "maxLateralAcc", f64::abs)?),
            None => None,
        };
        let offset_target = match self.single(it, actors)? {
            None => OffsetTarget::Absolute {
                value_m: StoryNumber::Number(0.0),
            },
            Some((frame, actor)) => self.offset_target(at.at(target), frame, actor, value)?,
        };
        Ok(Effect::LaneOffset {
            target_m: None,
            target: Some(offset_target),
            continuous: at.scope.is_true(at.node, "continuous")?,
            shape,
            max_lateral_acc_mps2,
        })
    }

    fn offset_target(
        &self,
        at: StatedIn<'_>,
        frame: &StoryFrame<'_>,
        actor: &EntityInFrame<'_>,
        value: f64,
    ) -> Result<OffsetTarget, ImportError> {
        let target = at.node;
        let on = own_lane(target, actor.entity)?;
        let to_line = |t_m: f64| OffsetTarget::Line {
            lateral_m: self.numbers.stated(at, &[], line_m(frame, actor, t_m)),
        };
        if target.name != "RelativeTargetLaneOffset" {
            // The lane in which it starts is its own as long as it changes none.
            if actor.entity.later.lane_changes == 0 {
                let line = frame.concrete.roads.road(target, &on.road)?;
                return Ok(to_line(line.middle_m(target, on.lane)? + value));
            }
            self.shares_lanes(target, frame, actor)?;
            let value_m = self.numbers.stated(at, &["value"], value);
            return Ok(OffsetTarget::Absolute { value_m });
        }
        // An offset counts from the lane of the other itself.
        match self.lane_of(at, frame, actor, 0)? {
            Ok(other) => {
                same_road(target, &other, &on)?;
                Ok(to_line(value * f64::from(other.side()) + other.t_m))
            }
            Err(other) => {
                self.shares_lanes(target, frame, actor)?;
                self.shares_lanes(target, frame, other)?;
                Ok(OffsetTarget::Relative {
                    entity: other.name.clone(),
                    value_m: self.numbers.stated(at, &["value"], value),
                })
            }
        }
    }

    pub(super) fn distance_across(&self, at: StatedIn<'_>) -> Result<Effect, ImportError> {
        let it = at.node;
        Ok(Effect::LateralDistance {
            entity: self.entity(it, &at.scope.text(it, "entityRef")?)?,
            distance_m: self.numbers.or(at, "distance", 0.0)?,
            displacement: match it.raw("displacement") {
                None | Some("any") => LateralDisplacement::Any,
                Some("leftToReferencedEntity") => LateralDisplacement::LeftTo,
                Some("rightToReferencedEntity") => LateralDisplacement::RightTo,
                Some(other) => {
                    let help = "write any, leftToReferencedEntity or rightToReferencedEntity";
                    return Err(it.refused(format!("there is no side `{other}`"), help));
                }
            },
            freespace: at.scope.is_true(at.node, "freespace")?,
            coordinate_system: coordinate_system(it)?,
            continuous: at.scope.is_true(at.node, "continuous")?,
            limits: self.limits(at)?,
        })
    }

    /// Returns the only actor, with the frame of places, or `None` without a frame.
    fn single<'a, 'b>(
        &'a self,
        it: &XmlNode,
        actors: &'a [&'a EntityInFrame<'b>],
    ) -> Result<Option<(&'a StoryFrame<'a>, &'a EntityInFrame<'b>)>, ImportError> {
        let Some(frame) = &self.frame else {
            return Ok(None);
        };
        match actors {
            // A group of the ego alone has no actor in the world.
            [] => Ok(None),
            [one] => Ok(Some((frame, one))),
            _ => {
                let help = "give each of them a `ManeuverGroup` of its own";
                Err(it.refused("lanes of several actors are not read", help))
            }
        }
    }

    /// Returns the lane to which a target is relative, or the entity if the run decides it.
    ///
    /// The target is on the lane that is `lanes` to the left of it.
    fn lane_of<'a>(
        &self,
        at: StatedIn<'_>,
        frame: &'a StoryFrame<'_>,
        actor: &'a EntityInFrame<'_>,
        lanes: i32,
    ) -> Result<Result<OnLane, &'a EntityInFrame<'a>>, ImportError> {
        let name = at.scope.text(at.node, "entityRef")?;
        let found = frame.all.iter().find(|it| it.entity.name == name);
        let other = found.ok_or_else(|| self.no_entity(at.node, &name))?;
        let lane = own_lane(at.node, other.entity)?;
        let later = &other.entity.later;
        let changes = later.lane_changes + later.offsets;
        let is_own = other.entity.name == actor.entity.name;
        // The user drives the ego, which need not stay where it starts.
        if other.entity.is_ego {
            let first = frame.concrete.lane_at(other.spot.y_m);
            let by = f64::from(lanes * lane.side());
            // Lanes beyond those of the world have no number there.
            let is_lane = (0.0..frame.concrete.lanes as f64).contains(&(first + by));
            let shared = [other, actor].map(|it| self.shares_lanes(at.node, frame, it).is_ok());
            if is_lane && shared == [true, true] {
                return Ok(Err(other));
            }
            let kind = "lanes relative to the ego, as it starts";
            self.ground.catalogs.note(kind, at.node);
        }
        // Its own lane at its only change is that of the start. Nobody else moves it
        // across, so its lane is known before the run.
        if changes == 0 || (is_own && changes == 1 && !self.repeats) {
            Ok(Ok(lane))
        } else {
            Ok(Err(other))
        }
    }

    /// Number of lanes to the left of the world's road.
    fn lanes_to_left(
        &self,
        target: &XmlNode,
        frame: &StoryFrame<'_>,
        entity: &EntityInFrame<'_>,
        value: i32,
    ) -> Result<i32, ImportError> {
        self.shares_lanes(target, frame, entity)?;
        let lanes = value * own_lane(target, entity.entity)?.side();
        Ok(lanes)
    }

    /// Refuses an entity whose lanes are not those of the world's road.
    pub(super) fn shares_lanes(
        &self,
        it: &XmlNode,
        frame: &StoryFrame<'_>,
        entity: &EntityInFrame<'_>,
    ) -> Result<(), ImportError> {
        // Only there do lanes of the world and of the file have the same order.
        let is_shared = matches!(entity.path, EntityPath::With | EntityPath::Against);
        // Lanes of a way over several roads are drawn as those of its first road.
        let has_lanes = !matches!(frame.concrete.frame, RoadFrame::Along(_));
        if is_shared && has_lanes && frame.concrete.has_even_lanes {
            return Ok(());
        }
        let help = "name the lane by an absolute target";
        let what = format!(
            "a lane relative to `{}`, who changes its own, is not read",
            entity.name
        );
        Err(it.refused(what, help))
    }
}

/// Lane in which an entity starts.
fn own_lane(it: &XmlNode, entity: &ImportedEntity) -> Result<OnLane, ImportError> {
    let lane = entity.placed.lane.clone();
    lane.ok_or_else(|| it.refused("it is on no lane", "place it by a `LanePosition`"))
}

/// Refuses a lane of another road, whose lanes have numbers of their own.
fn same_road(it: &XmlNode, of: &OnLane, on: &OnLane) -> Result<(), ImportError> {
    if of.road == on.road {
        return Ok(());
    }
    let what = format!(
        "a lane relative to one of road `{}` is not read on another",
        of.road
    );
    Err(it.refused(what, "name the lane by an absolute target"))
}

/// Returns a line to the left of a file's reference line, on the road of an actor.
fn line_m(frame: &StoryFrame<'_>, actor: &EntityInFrame<'_>, t_m: f64) -> f64 {
    let is_against = matches!(actor.path, EntityPath::Against);
    let side = actor.entity.side(is_against);
    let way = actor.entity.placed.way.as_ref().filter(|on| on.is_lane);
    let on = actor.entity.placed.lane.as_ref();
    let road = on.and_then(|on| Some((on, frame.concrete.roads.get(&on.road)?)));
    match (way, &actor.path) {
        // A straight world may hold several roads of the file.
        (None, _) if matches!(frame.concrete.frame, RoadFrame::Straight(_)) && road.is_some() => {
            road.map_or(t_m, |(on, line)| {
                frame.concrete.in_plane(&line.at(on.s_m, t_m)).y_m
            })
        }
        // A world measures from the middle of lane 0, and the file
        // from the reference line.
        (None, _) => t_m - frame.concrete.zero_m(),
        // A way of its own leads through the place of the entity.
        (Some(_), EntityPath::Own(..)) => side * (t_m - actor.start_t_m()),
        (Some(_), _) => actor.spot.y_m + side * (t_m - actor.start_t_m()),
    }
}
