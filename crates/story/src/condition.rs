//! Expressions of conditions at an instant.

use crate::axis::AxisSpan;
use crate::pose::Pose;
use crate::road::OnRoad;
use crate::tree::{AgentExpression, AgentQuantity, MeasuredAxis, ValueComparison};
use crate::trigger::Expressed;
use crate::values::{ComparisonRule, CoordinateSystem, DistanceType, TriggeringRule};
use crate::view::{AgentMotion, PosedAgent, StoryPlace, StoryView};

/// Speed below which no time headway and no time to collision is defined.
const LEAST_SPEED_MPS: f64 = 1e-6;

/// Motion at an instant, as expressions read it.
pub(crate) struct Instant<'a, V: ?Sized> {
    pub view: &'a V,
    pub at_s: f64,
    /// Way of each agent at `since_s`. Empty if no condition asks for it.
    pub ways_m: &'a [f64],
    pub since_s: f64,
}

/// Agent ahead of another, and the speeds of both in the direction of the first.
struct AgentAhead {
    ahead_m: f64,
    own_mps: f64,
    other_mps: f64,
}

/// Compares a number, which may be undefined.
pub(crate) fn compared(number: Option<f64>, with: &ValueComparison) -> Expressed {
    // An undefined number fulfils no comparison, not even `NotEqualTo`.
    let holds = number.is_some_and(|it| with.holds(it));
    let asks_equal = matches!(
        with.rule,
        ComparisonRule::EqualTo | ComparisonRule::NotEqualTo
    );
    let key = match number {
        // Equality may last for an instant only, which the side of the value betrays.
        Some(number) if asks_equal => 2 + u64::from(number > with.value),
        _ => u64::from(holds),
    };
    Expressed { holds, key }
}

impl<V: StoryView + ?Sized> Instant<'_, V> {
    /// Evaluates an expression about agents.
    pub fn agents(
        &self,
        agents: &[usize],
        rule: TriggeringRule,
        is: &AgentExpression,
    ) -> Expressed {
        let each = agents.iter().map(|agent| self.agent(*agent, is));
        let is_all = rule == TriggeringRule::All;
        // `All` begins true and `Any` false, the neutral values of both.
        let first = Expressed {
            holds: is_all,
            key: 0,
        };
        // Every agent is visited, because the key must change with each of them.
        each.fold(first, |so_far, now| Expressed {
            holds: if is_all {
                so_far.holds && now.holds
            } else {
                so_far.holds || now.holds
            },
            // Any number that differs if one of them does.
            key: so_far.key.wrapping_mul(31).wrapping_add(now.key),
        })
    }

    /// Evaluates an expression about one agent.
    pub fn agent(&self, agent: usize, is: &AgentExpression) -> Expressed {
        let holds = match is {
            AgentExpression::Number(quantity, with) => {
                return compared(self.quantity(agent, quantity), with);
            }
            AgentExpression::Touches(other) => self.gap_m(agent, *other) <= 0.0,
            AgentExpression::Offroad => {
                let limits = self.view.road_limits(agent);
                let lateral_m = self.at(agent, agent).lateral_m;
                // The border itself belongs to the road.
                !(limits.right_m..=limits.left_m).contains(&lateral_m)
            }
            AgentExpression::AtRoadEnd => {
                let limits = self.view.road_limits(agent);
                let s_m = self.at(agent, agent).s_m;
                // Beyond its end a course goes straight on, so greater stations exist.
                s_m <= limits.from_s_m || limits.to_s_m <= s_m
            }
        };
        Expressed {
            holds,
            key: u64::from(holds),
        }
    }

    fn quantity(&self, agent: usize, quantity: &AgentQuantity) -> Option<f64> {
        match *quantity {
            AgentQuantity::Speed => Some(self.motion(agent).speed_mps),
            AgentQuantity::SpeedLess { other } => {
                Some(self.motion(agent).speed_mps - self.motion(other).speed_mps)
            }
            AgentQuantity::Acceleration => Some(self.motion(agent).accel_mps2),
            AgentQuantity::Rest => {
                let AgentMotion {
                    speed_mps,
                    lateral_mps,
                    ..
                } = self.motion(agent);
                // A body that slides to its side does not rest.
                Some(libm::hypot(speed_mps, lateral_mps))
            }
            AgentQuantity::Way => {
                let before = self.view.motion(agent, self.since_s).pose;
                // Ways are summed up to `since_s`, and the rest is added here.
                let now = self.motion(agent).pose;
                Some(self.ways_m.get(agent)? + apart_m(&before, &now))
            }
            AgentQuantity::DistanceTo {
                other,
                measured,
                freespace,
            } => Some(self.distance_m(agent, other, measured, freespace)),
            AgentQuantity::DistanceToPlace {
                place,
                measured,
                freespace,
            } => Some(self.place_m(agent, &place, measured, freespace)),
            AgentQuantity::Headway {
                other,
                measured,
                freespace,
            } => {
                let seen = self.ahead(agent, other, measured, freespace)?;
                // At rest the headway would be infinite, and in reverse negative.
                (seen.own_mps > LEAST_SPEED_MPS).then(|| seen.ahead_m / seen.own_mps)
            }
            AgentQuantity::Collision {
                other,
                measured,
                freespace,
            } => {
                // Whichever of the two is behind approaches the other.
                let ahead = self.ahead(agent, other, measured, freespace);
                let seen = ahead.or_else(|| self.ahead(other, agent, measured, freespace))?;
                // A pair that keeps its distance has no time to collision.
                let closing_mps = seen.own_mps - seen.other_mps;
                (closing_mps > LEAST_SPEED_MPS).then(|| seen.ahead_m / closing_mps)
            }
            AgentQuantity::TimeToPlace {
                place,
                measured,
                freespace,
            } => {
                let system = measured.system;
                let along = DistanceType::Longitudinal;
                let axis = self.axis(agent, MeasuredAxis { along, system });
                let at_m = axis(&self.view.pose_of(agent, &place, self.at_s));
                let is_further = at_m > self.span(agent, freespace, &axis).middle_m();
                let along_mps = self.speed_along_mps(agent, agent, system);
                // An agent that moves away has no time to the place.
                let closing_mps = if is_further { along_mps } else { -along_mps };
                let away_m = self.place_m(agent, &place, measured, freespace);
                (closing_mps > LEAST_SPEED_MPS).then(|| away_m / closing_mps)
            }
        }
    }

    fn motion(&self, agent: usize) -> AgentMotion {
        self.view.motion(agent, self.at_s)
    }

    /// Returns the pose of the reference point of an agent.
    fn reference(&self, agent: usize) -> Pose {
        self.view.reference(agent, self.at_s)
    }

    fn at(&self, viewer: usize, agent: usize) -> OnRoad {
        self.view.on_road(viewer, &self.reference(agent))
    }

    fn gap_m(&self, a: usize, b: usize) -> f64 {
        self.view.gap_m([a, b].map(|agent| PosedAgent {
            agent,
            pose: self.motion(agent).pose,
        }))
    }

    fn distance_m(
        &self,
        agent: usize,
        other: usize,
        measured: MeasuredAxis,
        freespace: bool,
    ) -> f64 {
        match (measured.along, freespace) {
            (DistanceType::Euclidean, true) => self.gap_m(agent, other),
            (DistanceType::Euclidean, false) => {
                apart_m(&self.reference(agent), &self.reference(other))
            }
            _ => {
                // Both bodies are measured along the axis of the first, or their places
                // could not be compared.
                let axis = self.axis(agent, measured);
                let own = self.span(agent, freespace, &axis);
                own.distance_m(&self.span(other, freespace, &axis))
            }
        }
    }

    fn place_m(
        &self,
        agent: usize,
        place: &StoryPlace,
        measured: MeasuredAxis,
        freespace: bool,
    ) -> f64 {
        let pose = self.view.pose_of(agent, place, self.at_s);
        match (measured.along, freespace) {
            (DistanceType::Euclidean, false) => apart_m(&self.reference(agent), &pose),
            (DistanceType::Euclidean, true) => {
                let size = self.view.size(agent);
                let front = self.motion(agent).pose;
                let at = front.frame().to_local(pose.point_m());
                // In these axes the body reaches from 0 back to minus its length.
                let beyond_m = at.x.max(-size.length_m - at.x).max(0.0);
                let beside_m = (at.y.abs() - 0.5 * size.width_m).max(0.0);
                libm::hypot(beyond_m, beside_m)
            }
            _ => {
                let axis = self.axis(agent, measured);
                let at_m = axis(&pose);
                let own = self.span(agent, freespace, &axis);
                own.distance_m(&AxisSpan {
                    least_m: at_m,
                    most_m: at_m,
                })
            }
        }
    }

    /// Returns what measures places of points along an axis of an agent.
    fn axis(&self, viewer: usize, measured: MeasuredAxis) -> impl Fn(&Pose) -> f64 {
        let is_road = measured.system == CoordinateSystem::Road;
        // Found once, since a motion is a part of a plan that is played.
        let frame = (!is_road).then(|| self.motion(viewer).pose.frame());
        move |pose| {
            let (along_m, across_m) = match &frame {
                None => {
                    let at = self.view.on_road(viewer, pose);
                    (at.s_m, at.lateral_m)
                }
                Some(frame) => {
                    let at = frame.to_local(pose.point_m());
                    (at.x, at.y)
                }
            };
            // A Euclidean distance asks for no axis, so two directions are left.
            if measured.along == DistanceType::Lateral {
                across_m
            } else {
                along_m
            }
        }
    }

    /// Returns the interval of a body along an axis.
    ///
    /// Without `freespace` it is that of the reference point alone.
    fn span(&self, agent: usize, freespace: bool, axis: &impl Fn(&Pose) -> f64) -> AxisSpan {
        let front = self.motion(agent).pose;
        AxisSpan::of(self.view.size(agent), &front, freespace, axis)
    }

    /// Returns distance and both speeds along an axis if `other` is ahead of an agent.
    fn ahead(
        &self,
        agent: usize,
        other: usize,
        measured: MeasuredAxis,
        freespace: bool,
    ) -> Option<AgentAhead> {
        let system = measured.system;
        let along = DistanceType::Longitudinal;
        let axis = self.axis(agent, MeasuredAxis { along, system });
        let (own, its) = (
            self.span(agent, freespace, &axis),
            self.span(other, freespace, &axis),
        );
        // Along a road an agent may drive against its stations.
        let towards = match system {
            CoordinateSystem::Entity => 1.0,
            // The sign alone counts: a slight turn must not shorten distances.
            CoordinateSystem::Road => libm::cos(self.at(agent, agent).heading_rad).signum(),
        };
        // Middles have an order even if the bodies overlap along the axis.
        let is_ahead = towards * (its.middle_m() - own.middle_m()) > 0.0;
        let speed_mps = |it: usize| towards * self.speed_along_mps(agent, it, system);
        is_ahead.then(|| AgentAhead {
            ahead_m: match measured.along {
                DistanceType::Longitudinal => own.distance_m(&its),
                // Only the order is always longitudinal, not the distance itself.
                _ => self.distance_m(agent, other, measured, freespace),
            },
            own_mps: speed_mps(agent),
            other_mps: speed_mps(other),
        })
    }

    fn speed_along_mps(&self, viewer: usize, agent: usize, system: CoordinateSystem) -> f64 {
        let motion = self.motion(agent);
        match system {
            CoordinateSystem::Road => {
                // Along the viewer's road for both agents, so that the difference of
                // their speeds closes the distance.
                let at = self.at(viewer, agent);
                at.velocity_mps(motion.speed_mps, motion.lateral_mps).x
            }
            CoordinateSystem::Entity => {
                let (sin, cos) = libm::sincos(self.motion(viewer).pose.heading_rad);
                let [x_mps, y_mps] = motion.velocity_mps();
                x_mps * cos + y_mps * sin
            }
        }
    }
}

/// Returns the distance of two points on the ground.
pub(crate) fn apart_m(a: &Pose, b: &Pose) -> f64 {
    libm::hypot(b.x_m - a.x_m, b.y_m - a.y_m)
}
