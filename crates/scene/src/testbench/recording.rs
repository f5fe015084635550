//! Recording of all agents' motion while an episode is played.

use super::{Aftermath, Episode, Film, FilmAfterContact, Testbench, film_beyond};
use crate::scene::{BodySample, Motion, Passage, Start};

/// Recording of the running episode.
#[derive(Clone, Default)]
pub(super) struct MotionRecorder {
    enabled: bool,
    motion: Option<Motion>,
    /// Current sample of every agent, kept to save the allocation.
    bodies: Vec<BodySample>,
}

impl MotionRecorder {
    /// Creates a recording that is active from the first episode, if requested.
    pub(super) fn enabled(enabled: bool) -> MotionRecorder {
        MotionRecorder {
            enabled,
            ..MotionRecorder::default()
        }
    }

    /// Returns the motion so far, if it is recorded.
    pub(super) fn motion(&self) -> Option<&Motion> {
        self.motion.as_ref()
    }
}

impl Testbench {
    /// Records the motion of all agents from the next episode on.
    pub fn record_motion(&mut self) {
        self.recording.enabled = true;
    }

    /// Returns the motion of all agents in this episode so far, if it is recorded.
    pub fn motion(&self) -> Option<&Motion> {
        self.recording.motion.as_ref()
    }

    pub(super) fn begin_motion(&mut self, start: &Start) {
        self.recording.motion = None;
        if self.recording.enabled {
            self.read_bodies();
            self.recording.motion = Some(Motion::new(start.clone(), &self.recording.bodies));
        }
    }

    pub(super) fn push_motion(&mut self) {
        // Most episodes are not recorded, and their bodies need not be read.
        if self.recording.motion.is_none() {
            return;
        }
        self.read_bodies();
        let sample_s = self.clock().sample_s;
        let MotionRecorder { motion, bodies, .. } = &mut self.recording;
        if let Some(motion) = motion {
            motion.push(bodies);
            motion.contact = self.contact.clone();
            let time_s = self.advances as f64 * sample_s;
            // A contact lies within the sample, before its end.
            motion.end_s = motion.contact.as_ref().map_or(time_s, |it| it.time_s);
        }
    }

    fn read_bodies(&mut self) {
        self.recording.bodies.clear();
        self.scene.bodies(&mut self.recording.bodies);
    }
}

/// Plays a recorded episode again and returns the motion of all agents.
pub fn motion_of(bench: &mut Testbench, episode: &Episode) -> Option<Motion> {
    bench.record_motion();
    // The recorded actions include those of the aftermath.
    bench.begin(&episode.start, episode.noise, Aftermath::Play);
    for &action in &episode.actions {
        bench.decide(action);
    }
    bench.motion().cloned()
}

/// Plays a recorded episode again and returns motion and traffic lights.
///
/// The frames after the contact are the second value.
pub fn passage_of(
    bench: &mut Testbench,
    episode: &Episode,
) -> Option<(Passage, Option<FilmAfterContact>)> {
    bench.record_motion();
    let Film { frames, after } = film_beyond(bench, episode);
    let phases = frames.into_iter().map(|frame| frame.phases);
    let passage = Passage {
        motion: bench.motion().cloned()?,
        phases: phases.collect(),
    };
    Some((passage, after))
}
