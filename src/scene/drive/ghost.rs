//! An episode played on to the horizon, as if nobody could be touched.
//!
//! Whoever puts an ego of their own into a recorded crash may never get there:
//! then the others must still be going somewhere after the recorded contact.

use super::world::DriveWorld;
use crate::ego::Fault;
use crate::scene::{Flow, Motion, Passage, Scene, Start};

impl DriveWorld {
    /// An episode to the horizon, in which bodies pass through each other.
    ///
    /// Up to the contact it is the episode itself, bit for bit. From there on
    /// everybody still sees the others and answers to them, but none is stopped:
    /// who was hit goes on as if the other were a ghost. After the last of
    /// `actions` the ados take their neutral one.
    ///
    /// # Errors
    /// The ego or the physics fails on the way.
    pub fn ghostly(&self, start: &Start, noise: u64, actions: &[usize]) -> Result<Passage, Fault> {
        let clock = self.spec().clock;
        let mut scene = self.scene();
        scene.state.plant.pass_through();
        scene.reset(start, noise);
        let mut bodies = Vec::new();
        scene.bodies(&mut bodies);
        let mut motion = Motion::new(start.clone(), &bodies);
        let mut phases = vec![scene.frame().phases];
        for sample in 0..clock.samples() - 1 {
            if sample % clock.samples_per_decision() == 0 {
                let decision = sample / clock.samples_per_decision();
                let neutral = self.spaces().neutral;
                scene.decide(actions.get(decision).copied().unwrap_or(neutral));
            }
            if let Flow::Fault(fault) = scene.advance() {
                return Err(fault);
            }
            bodies.clear();
            scene.bodies(&mut bodies);
            motion.push(&bodies);
            phases.push(scene.frame().phases);
        }
        scene.finish();
        motion.end_s = (clock.samples() - 1) as f64 * clock.sample_s;
        Ok(Passage { motion, phases })
    }
}
