//! Recorded motion of all agents in an episode, sample by sample.

use super::{ContactEvent, Start};
use crate::ego::Phase;
use crate::sim::{BodyCommand, BodyState};

/// State and command of one body at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySample {
    /// Motion of the body at the sample.
    pub state: BodyState,
    /// Command over the preceding sample. `None` without one, as at t = 0.
    pub command: Option<BodyCommand>,
}

/// Motion of all agents in one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Start of the episode.
    pub start: Start,
    /// First contact, which ended the motion.
    pub contact: Option<ContactEvent>,
    /// Time of the last sample, or of the contact if there was one.
    pub end_s: f64,
    agents: usize,
    /// Flat list: per sample, every agent in the order of the cast.
    bodies: Vec<BodySample>,
}

/// Motion of all agents together with the phases of the traffic lights.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    /// Motion of all agents.
    pub motion: Motion,
    /// Per sample, the phase of each light in the order of the world file.
    pub phases: Vec<Vec<Phase>>,
}

impl Motion {
    /// Creates a motion from `first`, the sample of every agent at 0 s.
    pub fn new(start: Start, first: &[BodySample]) -> Motion {
        Motion {
            start,
            contact: None,
            end_s: 0.0,
            agents: first.len(),
            bodies: first.to_vec(),
        }
    }

    /// Appends the next sample, with the agents in the same order.
    pub fn push(&mut self, sample: &[BodySample]) {
        // Invariant: a cast does not change during an episode.
        assert_eq!(sample.len(), self.agents, "everybody has a sample");
        self.bodies.extend_from_slice(sample);
    }

    /// Returns the number of samples, including 0 s. 0 if no agent has a body.
    pub fn len(&self) -> usize {
        // Without agents the list is empty, and the divisor must not be 0.
        self.bodies.len() / self.agents.max(1)
    }

    /// Returns whether no agent has a body.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Returns every agent at a sample below [`Motion::len`].
    pub fn at(&self, sample: usize) -> &[BodySample] {
        &self.bodies[sample * self.agents..][..self.agents]
    }

    pub(super) fn at_mut(&mut self, sample: usize) -> &mut [BodySample] {
        &mut self.bodies[sample * self.agents..][..self.agents]
    }
}
