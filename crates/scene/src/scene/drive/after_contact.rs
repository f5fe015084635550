//! Motion after the first contact: rapier resolves the collisions.

use super::motion::DriveScene;
use super::surface::surface_of;
use crate::scene::{AfterContact, CollisionEvent, Frame, PushedEvent};
use crate::sim::{BodyCommand, BodyId, Collision, Plant, Pose, Rigid};

impl DriveScene {
    /// Plays on after the contact of the last sample, without changing the scene.
    ///
    /// It plays `default_s` if the world states no time. Returns the frames after each
    /// sample, too. `None` without a contact, or for a time of 0.
    pub(super) fn collide_on(&self, default_s: f64) -> Option<(AfterContact, Vec<Frame>)> {
        let spec = &self.layout.spec;
        let contact = self.state.touch.as_ref()?;
        let after_s = spec.after_contact_s.unwrap_or(default_s);
        let samples = (after_s / spec.clock.sample_s).round() as usize;
        if samples == 0 {
            return None;
        }
        // A copy, because the recorded episode ends at the contact.
        let mut plant = self.state.plant.fork();
        // The kinematic plant resolves no collisions, so rapier takes its
        // bodies over.
        if !plant.collide(contact.pair) {
            plant = self.handed_over();
            plant.collide(contact.pair);
        }
        let begun_s = self.contact_s(contact);
        let mut lanes: Vec<Option<usize>> = self.lanes(&*plant);
        let mut pushed = Vec::new();
        let mut frames = Vec::with_capacity(samples);
        for sample in 1..=samples {
            plant.advance(spec.clock.sample_s, spec.clock.substeps);
            // Whatever broke down stays as it last was.
            if !plant.sound() {
                break;
            }
            let now = self.lanes(&*plant);
            let time_s = begun_s + sample as f64 * spec.clock.sample_s;
            for (agent, (from, to)) in lanes.iter().zip(&now).enumerate() {
                if from != to && !spec.agents[agent].body.is_on_foot() {
                    pushed.push(PushedEvent {
                        agent: spec.agents[agent].name.clone(),
                        time_s,
                        from: *from,
                        to: *to,
                    });
                }
            }
            lanes = now;
            frames.push(self.frame_of(&*plant));
        }
        let collisions = plant.collisions();
        // A vehicle that drives on changes lanes by itself.
        let hit = |agent: &str| {
            let mut pairs = collisions.iter().map(|collision| collision.pair);
            pairs.any(|(a, b)| spec.agents[a.0].name == agent || spec.agents[b.0].name == agent)
        };
        pushed.retain(|push| hit(&push.agent));
        let after = AfterContact {
            // Fewer frames than wanted if the physics broke down.
            duration_s: frames.len() as f64 * spec.clock.sample_s,
            collisions: collisions
                .iter()
                .map(|collision| self.collision_of(collision, begun_s))
                .collect(),
            pushed,
        };
        Some((after, frames))
    }

    /// Returns the bodies of a plant that resolves no collisions, in rapier's hands.
    fn handed_over(&self) -> Box<dyn Plant> {
        let surface = surface_of(&self.layout.spec, &self.layout.network);
        let agents = self.layout.spec.agents.iter();
        let bodies = agents
            .map(|agent| &agent.body)
            .zip(self.state.states.iter().copied());
        let mut plant = Rigid::taking_over(self.state.ground(), surface.as_ref(), bodies);
        for (id, command) in self.state.bodies.iter().zip(&self.commanded) {
            // A body on a plan keeps its velocity.
            if let Some(command @ (BodyCommand::Drive { .. } | BodyCommand::Walk { .. })) = command
            {
                plant.command(*id, *command);
            }
        }
        Box::new(plant)
    }

    fn collision_of(&self, collision: &Collision, begun_s: f64) -> CollisionEvent {
        let name = |body: BodyId| self.layout.spec.agents[body.0].name.clone();
        let delta_v_mps = collision
            .delta_v_mps
            .map(|[x_mps, y_mps]| (x_mps * x_mps + y_mps * y_mps).sqrt());
        CollisionEvent {
            between: (name(collision.pair.0), name(collision.pair.1)),
            time_s: begun_s + collision.after_s,
            delta_v_mps: delta_v_mps.into(),
        }
    }

    /// Returns the lane of the middle of each body, `None` off the road.
    fn lanes(&self, plant: &dyn Plant) -> Vec<Option<usize>> {
        let bodies = self.state.bodies.iter().enumerate();
        bodies
            .map(|(agent, &body)| {
                let centre_m = plant.placement(body).centre_m;
                // Only the place counts, so any heading serves.
                let middle = Pose {
                    x_m: centre_m[0],
                    y_m: centre_m[1],
                    heading_rad: 0.0,
                };
                let lateral_m = self.state.network.locate(agent, &middle).lateral_m;
                let road = self.layout.spec.road_of(agent);
                let half_m = 0.5 * road.lane_width_m();
                let left_m = road.lane_middle_m(road.lanes() - 1) + half_m;
                let is_on_road = -half_m <= lateral_m && lateral_m <= left_m;
                is_on_road.then(|| road.lane_at(lateral_m))
            })
            .collect()
    }
}
