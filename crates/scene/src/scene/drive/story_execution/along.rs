//! Laws of actions along the path.

use super::SampleStage;
use crate::scene::drive::along_law::{AlongAim, AlongLaw, SpeedLimits};
use crate::scene::drive::story_law::StoryLaw;
use crate::story::values::{CoordinateSystem, DynamicLimits};
use crate::story::view::{
    ActorAction, ActorDistance, ActorSpeed, ActorTransition, DistanceSide, StoryView,
    Synchronization,
};

impl SampleStage<'_> {
    /// Returns the law of an action along the path, and `None` for others.
    pub(super) fn law_along(
        &self,
        agent: usize,
        action: &ActorAction,
        at_s: f64,
    ) -> Option<StoryLaw> {
        let limits = SpeedLimits::NONE.with(&self.board.limits(agent));
        let law = match action {
            ActorAction::Speed { target, dynamics } => {
                self.speed_law(*target, *dynamics, limits, at_s)
            }
            ActorAction::SpeedProfile {
                relative_to,
                points,
                limits: own,
                ..
            } => {
                let base_mps = relative_to.map_or(0.0, |of| self.motion(of, at_s).speed_mps);
                StoryLaw::Profile {
                    base_mps,
                    points: points.clone(),
                    limits: bounded(limits, own),
                }
            }
            ActorAction::LongitudinalDistance(distance) => StoryLaw::Along(AlongLaw {
                of: distance.of,
                aim: AlongAim::Distance {
                    distance: distance.distance,
                    leads: self.leads(agent, distance, at_s),
                    freespace: distance.freespace,
                    on_road: distance.system == CoordinateSystem::Road,
                    continuous: distance.continuous,
                },
                limits: bounded(limits, &distance.limits),
            }),
            ActorAction::Synchronize(with) => {
                StoryLaw::Along(self.synchronization(agent, with, limits, at_s))
            }
            _ => return None,
        };
        Some(law)
    }

    fn speed_law(
        &self,
        target: ActorSpeed,
        dynamics: ActorTransition,
        limits: SpeedLimits,
        at_s: f64,
    ) -> StoryLaw {
        let relative = match target {
            ActorSpeed::Absolute(_) => None,
            ActorSpeed::Delta(to) => Some((to, 1.0, to.by)),
            ActorSpeed::Factor(to) => Some((to, to.by, 0.0)),
        };
        let (shape, size) = (dynamics.shape.curve(), dynamics.dimension);
        // Only a lasting target follows the other agent. Any other is read once.
        if let Some((to, factor, by_mps)) = relative.filter(|it| it.0.continuous) {
            return StoryLaw::Along(AlongLaw {
                of: to.of,
                aim: AlongAim::Speed {
                    factor,
                    by_mps,
                    shape,
                    size,
                },
                limits,
            });
        }
        let to_mps = match (target, relative) {
            (ActorSpeed::Absolute(to_mps), _) => to_mps,
            (_, Some((to, factor, by_mps))) => factor * self.motion(to.of, at_s).speed_mps + by_mps,
            // Invariant: all other targets are relative.
            (_, None) => 0.0,
        };
        StoryLaw::Speed {
            to_mps,
            shape,
            size,
            limits,
        }
    }

    /// Returns whether an agent keeps a distance ahead of the other.
    fn leads(&self, agent: usize, distance: &ActorDistance, at_s: f64) -> bool {
        match distance.side {
            DistanceSide::Less => false,
            DistanceSide::More => true,
            DistanceSide::Any => {
                let [own, other] = [agent, distance.of].map(|it| self.reference(it, at_s));
                if distance.system == CoordinateSystem::Entity {
                    return own.frame().to_local(other.point_m()).x < 0.0;
                }
                let [own_on, other_on] = [own, other].map(|pose| self.on_road(agent, &pose));
                // Against its road, an agent ahead has the lower station.
                libm::cos(own_on.heading_rad) * (other_on.s_m - own_on.s_m) < 0.0
            }
        }
    }

    fn synchronization(
        &self,
        agent: usize,
        with: &Synchronization,
        limits: SpeedLimits,
        at_s: f64,
    ) -> AlongLaw {
        AlongLaw {
            of: with.master,
            aim: AlongAim::Synchronize {
                to: self.pose_of(agent, &with.target_place, at_s),
                tolerance_m: with.target_tolerance_m,
                its: self.pose_of(with.master, &with.master_place, at_s),
                its_tolerance_m: with.master_tolerance_m,
                final_speed: with.final_speed,
                steady: with.steady,
            },
            limits,
        }
    }
}

/// Returns the limits of an action that may have its own.
///
/// OpenSCENARIO 1.3, `dynamicConstraints`: "unlimited dynamics (if omitted)".
fn bounded(performance: SpeedLimits, own: &DynamicLimits<f64>) -> SpeedLimits {
    // Without limits of its own an action is exact, whatever the performance.
    if own.is_unlimited() {
        SpeedLimits::NONE
    } else {
        performance.with(own)
    }
}
