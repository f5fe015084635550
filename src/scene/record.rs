//! What everybody did in an episode, sample by sample.

use super::{Start, Touch};
use crate::ego::Phase;
use crate::sim::{BodyCommand, BodyState};

/// One body at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySample {
    /// How it moves.
    pub state: BodyState,
    /// What it was asked to do over the sample before; `None`: nothing.
    pub command: Option<BodyCommand>,
}

/// The motion of everybody in one episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Where the episode began.
    pub start: Start,
    /// The first contact, with which the motion ended.
    pub contact: Option<Touch>,
    /// When the last sample was; at a contact, the instant of it.
    pub end_s: f64,
    agents: usize,
    /// Sample by sample, everybody in the order of the cast.
    bodies: Vec<BodySample>,
}

/// The motion of everybody, and what the traffic lights showed meanwhile.
#[derive(Clone, Debug, PartialEq)]
pub struct Passage {
    /// How everybody moved.
    pub motion: Motion,
    /// Sample by sample, a phase per light in the order of the world file.
    pub phases: Vec<Vec<Phase>>,
}

impl Motion {
    /// A motion that begins with `first`, everybody's sample at 0 s.
    pub fn new(start: Start, first: &[BodySample]) -> Motion {
        Motion {
            start,
            contact: None,
            end_s: 0.0,
            agents: first.len(),
            bodies: first.to_vec(),
        }
    }

    /// Adds the next sample, everybody in the same order.
    pub fn push(&mut self, sample: &[BodySample]) {
        // Invariant: a cast does not change during an episode.
        assert_eq!(sample.len(), self.agents, "everybody has a sample");
        self.bodies.extend_from_slice(sample);
    }

    /// Number of samples, the one at 0 s included; 0: nobody has a body.
    pub fn len(&self) -> usize {
        self.bodies.len() / self.agents.max(1)
    }

    /// Whether nobody has a body.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Everybody at a sample below [`Motion::len`].
    pub fn at(&self, sample: usize) -> &[BodySample] {
        &self.bodies[sample * self.agents..][..self.agents]
    }

    pub(super) fn at_mut(&mut self, sample: usize) -> &mut [BodySample] {
        &mut self.bodies[sample * self.agents..][..self.agents]
    }
}
