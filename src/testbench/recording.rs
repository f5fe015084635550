//! Everybody's motion, noted while an episode is played.

use super::{Aftermath, Episode, Testbench, film};
use crate::scene::{BodySample, Motion, Passage, Start};

/// Notes of the running episode.
#[derive(Clone, Default)]
pub(super) struct Recording {
    asked: bool,
    motion: Option<Motion>,
    /// Everybody's present sample, kept to save the allocation.
    bodies: Vec<BodySample>,
}

impl Recording {
    /// Notes from the first episode on, if it is asked to.
    pub(super) fn asked(asked: bool) -> Recording {
        Recording {
            asked,
            ..Recording::default()
        }
    }

    /// The motion so far, where it is noted.
    pub(super) fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }
}

impl Testbench {
    /// From the next episode on, notes how everybody moves.
    pub fn record_motion(&mut self) {
        self.recording.asked = true;
    }

    /// How everybody moved in this episode so far, where that is noted.
    pub fn motion(&self) -> Option<&Motion> {
        self.recording.motion.as_ref()
    }

    pub(super) fn begin_motion(&mut self, start: &Start) {
        self.recording.motion = None;
        if self.recording.asked {
            self.read_bodies();
            self.recording.motion = Some(Motion::new(start.clone(), &self.recording.bodies));
        }
    }

    pub(super) fn push_motion(&mut self) {
        if self.recording.motion.is_none() {
            return;
        }
        self.read_bodies();
        let sample_s = self.clock().sample_s;
        let Recording { motion, bodies, .. } = &mut self.recording;
        if let Some(motion) = motion {
            motion.push(bodies);
            motion.contact = self.contact.clone();
            let time_s = self.advances as f64 * sample_s;
            motion.end_s = motion.contact.as_ref().map_or(time_s, |it| it.time_s);
        }
    }

    fn read_bodies(&mut self) {
        self.recording.bodies.clear();
        self.scene.bodies(&mut self.recording.bodies);
    }
}

/// Plays a recorded episode again and returns how everybody moved in it.
pub fn motion_of(bench: &mut Testbench, episode: &Episode) -> Option<Motion> {
    bench.record_motion();
    bench.begin(&episode.start, episode.noise, Aftermath::Play);
    for &action in &episode.actions {
        bench.decide(action);
    }
    bench.motion().cloned()
}

/// Plays a recorded episode again and returns how everybody moved in it, and
/// what the traffic lights showed.
pub fn passage_of(bench: &mut Testbench, episode: &Episode) -> Option<Passage> {
    bench.record_motion();
    let frames = film(bench, episode);
    let phases = frames.into_iter().map(|frame| frame.phases);
    Some(Passage {
        motion: bench.motion().cloned()?,
        phases: phases.collect(),
    })
}
