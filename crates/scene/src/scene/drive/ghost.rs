//! Continuation of an episode to the horizon, with contacts ignored.
//!
//! A user's own ego in a recorded crash may never reach the contact. The other
//! agents must then continue to move after the recorded contact.

use super::world::DriveWorld;
use crate::ego::Fault;
use crate::scene::{Motion, Passage, Scene, Start, StepOutcome};

impl DriveWorld {
    /// Runs an episode to the horizon with bodies that pass through each other.
    ///
    /// Up to the contact it equals the episode, bit for bit. From then on all
    /// agents still perceive and avoid each other, but no contact stops them.
    /// After the last of `actions` the ados take their neutral action.
    ///
    /// # Errors
    /// The ego or the physics fails on the way.
    pub fn ghostly(&self, start: &Start, noise: u64, actions: &[usize]) -> Result<Passage, Fault> {
        let clock = self.spec().clock;
        let mut scene = self.scene();
        // The setting survives `reset`, which clears the plant.
        scene.state.plant.pass_through();
        scene.reset(start, noise);
        let mut bodies = Vec::new();
        scene.bodies(&mut bodies);
        let mut motion = Motion::new(start.clone(), &bodies);
        let mut phases = vec![scene.frame().phases];
        // The start is the first sample already.
        for sample in 0..clock.samples() - 1 {
            if sample % clock.samples_per_decision() == 0 {
                let decision = sample / clock.samples_per_decision();
                let neutral = self.spaces().neutral;
                scene.decide(actions.get(decision).copied().unwrap_or(neutral));
            }
            if let StepOutcome::Fault(fault) = scene.advance() {
                return Err(fault);
            }
            bodies.clear();
            scene.bodies(&mut bodies);
            motion.push(&bodies);
            phases.push(scene.frame().phases);
        }
        scene.finish();
        // No contact ends this motion, so it always reaches the horizon.
        motion.end_s = (clock.samples() - 1) as f64 * clock.sample_s;
        Ok(Passage { motion, phases })
    }
}
