//! Changes of lane and lateral offsets in the acts of a storyboard.

use super::Reader;
use crate::opendrive::error::ImportError;
use crate::opendrive::roads::OnLane;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::openx::import::entity::AT_ONCE_MPS;
use crate::openx::import::entity::ImportedLaw;
use crate::openx::import::laws::{lane_change, shape_of};
use crate::openx::import::places::lane_beside;
use crate::road::ChangeShape;

impl Reader<'_> {
    pub(super) fn lane_change(
        &mut self,
        who: usize,
        it: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<ImportedLaw, ImportError> {
        let ground = self.ground;
        let on = self.own_lane(who, it)?;
        let target = it.inner("LaneChangeTarget")?.only()?;
        let value = scope.lane(target, "value")?;
        let to = match target.name.as_str() {
            "AbsoluteTargetLane" => value,
            _ => {
                let of = self.lane_of(who, target, scope)?;
                lane_beside(&of, value * of.side())
            }
        };
        let line = ground.roads.road(it, &on.road)?;
        let to_m = line.middle_m(it, to)? + scope.number_or_zero(it, "targetLaneOffset")?;
        let script = &mut self.scripts[who];
        let by_m = to_m - script.lateral.t_m;
        let dynamics = it.inner("LaneChangeActionDynamics")?;
        let law = lane_change(dynamics, scope, by_m, script.speeds.now_mps)?;
        script.lane = Some(to);
        script.lateral.t_m = to_m;
        script.lateral.changed_m += by_m;
        Ok(law)
    }

    pub(super) fn lane_offset(
        &mut self,
        who: usize,
        it: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<ImportedLaw, ImportError> {
        let ground = self.ground;
        let on = self.own_lane(who, it)?;
        if it.raw("continuous").is_some_and(|value| value != "false") {
            let help = "write continuous=\"false\"";
            return Err(it.refused("an offset that is kept for ever is not read", help));
        }
        let target = it.inner("LaneOffsetTarget")?.only()?;
        let mut offset_m = scope.number(target, "value")?;
        let line = ground.roads.road(it, &on.road)?;
        let lane = self.scripts[who].lane.unwrap_or(on.lane);
        let middle_m = line.middle_m(it, lane)?;
        if target.name == "RelativeTargetLaneOffset" {
            let other = self.lane_of(who, target, scope)?;
            offset_m = offset_m * f64::from(other.side()) + other.t_m - middle_m;
        }
        let dynamics = it.inner("LaneOffsetActionDynamics")?;
        let shape = match shape_of(dynamics)? {
            shape @ (None | Some(ChangeShape::Cosine | ChangeShape::Cubic)) => shape,
            Some(_) => {
                let help = "write dynamicsShape=\"sinusoidal\", \"cubic\" or \"step\"";
                return Err(dynamics.refused("linear lane offsets are not read", help));
            }
        };
        let to_m = middle_m + offset_m;
        let by_m = to_m - self.scripts[who].lateral.t_m;
        let law = match shape {
            // The greatest lateral acceleration of a cosine determines its duration.
            Some(ChangeShape::Cosine) => {
                // A world adds lane changes and offsets, so the changes so far are
                // subtracted.
                let t_m = to_m - self.scripts[who].lateral.changed_m;
                let most_lateral_mps2 = scope.number(dynamics, "maxLateralAcc")?;
                self.scripts[who].lateral.t_m = to_m;
                return Ok(ImportedLaw::Beside {
                    t_m,
                    most_lateral_mps2,
                });
            }
            Some(shape) => {
                // That of a cubic curve is 6·by/T².
                let most_mps2 = scope.number(dynamics, "maxLateralAcc")?;
                let lasts_s = (6.0 * by_m.abs() / most_mps2).sqrt();
                let rate_mps = shape.peak() * by_m.abs() / lasts_s;
                let rate_mps = if by_m == 0.0 { 1.0 } else { rate_mps };
                ImportedLaw::LaneChange {
                    by_m,
                    rate_mps,
                    shape,
                }
            }
            None => ImportedLaw::LaneChange {
                by_m,
                rate_mps: AT_ONCE_MPS,
                shape: ChangeShape::Linear,
            },
        };
        let script = &mut self.scripts[who];
        script.lateral.t_m = to_m;
        script.lateral.changed_m += by_m;
        Ok(law)
    }

    /// Lane of the entity to which a target is relative.
    ///
    /// The entity must keep its initial lane for as long as it exists.
    /// `lanes_stay` checks this after all acts are read.
    fn lane_of(
        &mut self,
        who: usize,
        target: &XmlNode,
        scope: &ParameterScope,
    ) -> Result<OnLane, ImportError> {
        let name = scope.text(target, "entityRef")?;
        let script = &self.scripts[who];
        if name == script.name {
            // Relative to itself, with the changes so far.
            let on = self.own_lane(who, target)?;
            return Ok(OnLane {
                lane: script.lane.unwrap_or(on.lane),
                t_m: script.lateral.t_m,
                ..on
            });
        }
        let other = self.ground.placed.get(&name);
        let lane = other.and_then(|it| it.lane.clone()).ok_or_else(|| {
            let help = "place it by a `LanePosition`";
            let error = target.refused(format!("`{name}` is on no lane"), help);
            let is_elsewhere = self.ground.unplaced.contains(&name);
            error.following(is_elsewhere || self.ground.roads.is_unread())
        })?;
        let help = "name the lane by an absolute target";
        let what = format!("a lane relative to `{name}`, who changes its own, is not read");
        self.relative.push((name, target.refused(what, help)));
        Ok(lane)
    }

    /// Lane of an entity, as far as it is known.
    fn own_lane(&self, who: usize, it: &XmlNode) -> Result<OnLane, ImportError> {
        let script = &self.scripts[who];
        if script.is_cut {
            let help = "let the event that cuts the change before it begin after its end";
            return Err(it.refused("a lane after a change that is cut is not read", help));
        }
        let lane = script.placed.lane.clone();
        lane.ok_or_else(|| {
            let error = it.refused("it is on no lane", "place it by a `LanePosition`");
            error.following(self.ground.roads.is_unread())
        })
    }

    /// Refuses targets that are relative to the lane of an entity that leaves it.
    pub(super) fn lanes_stay(&mut self) {
        let leaves = |name: &str| {
            let script = self.scripts.iter().find(|it| it.name == name);
            let laws = script.into_iter().flat_map(|it| &it.steps);
            let mut laws = laws.flat_map(|step| &step.laws);
            laws.any(|law| {
                matches!(
                    law,
                    ImportedLaw::LaneChange { .. } | ImportedLaw::Beside { .. }
                )
            })
        };
        let wrong: Vec<ImportError> = self
            .relative
            .iter()
            .filter(|(name, _)| leaves(name))
            .map(|(_, error)| error.clone())
            .collect();
        wrong.into_iter().for_each(|error| self.blockers.add(error));
    }
}
