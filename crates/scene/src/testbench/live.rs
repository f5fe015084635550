//! Episodes that go sample by sample: driven by hand, or moved by another simulator.

use crate::scene::drive::BodyAttitude;
use crate::scene::{BodySample, BodyState};
use crate::stl::Scratch;

use super::Testbench;

/// Robustness of the samples so far, as if the episode ended here.
#[derive(Clone, Debug, PartialEq)]
pub struct Margins {
    /// ρ(ψ_ego).
    pub spec: f64,
    /// Robustness of every rule, in the order of the rulebook.
    pub rules: Vec<f64>,
}

impl Testbench {
    /// Returns whether the ados decide before the next sample.
    pub fn is_decision_due(&self) -> bool {
        self.advances == (self.decisions * self.samples.1) as u64
    }

    /// Sets the ados' joint action until the next decision.
    ///
    /// Unlike [`Testbench::decide`] it plays no sample.
    pub fn decide_only(&mut self, action: usize) {
        self.choose(action);
    }

    /// Advances by one sample. Returns false, and plays nothing, if the episode is over.
    ///
    /// Ados whose decision is due keep their action unless [`Testbench::decide_only`] sets one.
    pub fn play_sample(&mut self) -> bool {
        if self.is_done() {
            return false;
        }
        self.sample();
        if self.is_done() {
            // As after the last sample of `decide`.
            self.scene.finish();
        }
        true
    }

    /// Advances by one sample in which another simulator moves some agents.
    ///
    /// `given` has an agent's state at the end of the sample, in the order of the cast,
    /// or `None` for an agent that this bench moves. Returns false, and plays nothing,
    /// if the agents have no bodies, or the episode is over.
    pub fn sample_given(&mut self, given: &[Option<BodyState>]) -> bool {
        if self.is_done() {
            return false;
        }
        let Some(outcome) = self.scene.advance_given(given) else {
            return false;
        };
        self.take(outcome);
        if self.is_done() {
            // As after the last sample of `decide`.
            self.scene.finish();
        }
        true
    }

    /// Returns the state and the last command of every agent, in the order of the cast.
    pub fn bodies(&self) -> Vec<BodySample> {
        let mut bodies = Vec::new();
        self.scene.bodies(&mut bodies);
        bodies
    }

    /// Returns height, pitch and roll of every agent, in the order of the cast.
    ///
    /// Empty on a grid.
    pub fn attitudes(&self) -> Vec<BodyAttitude> {
        // With the road of this start, whose course its values may change.
        let Some(world) = self.driven() else {
            return Vec::new();
        };
        let (bodies, frame) = (self.bodies(), self.frame());
        let agents = bodies.iter().zip(&frame.placements).enumerate();
        agents
            .map(|(agent, (body, placement))| world.attitude(agent, &body.state.pose, placement))
            .collect()
    }

    /// Returns the robustness of ψ_ego and of every rule on the samples so far.
    pub fn margins(&self) -> Margins {
        let mut scratch = Scratch::default();
        let rulebook = &self.rulebook;
        let rules = rulebook
            .rules
            .iter()
            .map(|rule| rule.monitor.robustness(&self.trace, &mut scratch));
        Margins {
            rules: rules.collect(),
            spec: rulebook.spec.robustness(&self.trace, &mut scratch),
        }
    }
}
