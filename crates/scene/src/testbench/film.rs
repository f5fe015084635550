//! Poses of a recorded episode, up to the contact and after it.

use std::borrow::Cow;

use super::{Aftermath, Episode, Testbench};
use crate::scene::{AfterContact, Frame, KEPT_AFTER_CONTACT_S};

/// Poses of a recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// One frame per sample, the first at 0 s. With a contact, the last is its instant.
    pub frames: Vec<Frame>,
    /// Motion after the contact, if there is one.
    pub after: Option<FilmAfterContact>,
}

/// Poses after the contact of an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmAfterContact {
    /// Time of the contact since the start of the episode.
    pub contact_s: f64,
    /// Time between two frames.
    pub sample_s: f64,
    /// Collisions and pushes.
    pub motion: AfterContact,
    /// One frame per sample, the first one sample after the contact.
    pub frames: Vec<Frame>,
}

impl Film {
    /// Returns all frames, with those after the contact at the end.
    pub fn whole(&self) -> Cow<'_, [Frame]> {
        joined(&self.frames, self.after.as_ref())
    }
}

impl FilmAfterContact {
    /// Returns the time of a frame since the start of the episode, rounded to 1 ns.
    pub fn time_s(&self, frame: usize) -> f64 {
        let time_s = self.contact_s + (frame + 1) as f64 * self.sample_s;
        (time_s * 1e9).round() / 1e9
    }

    /// Returns the time of the first collision of an agent, if it collides.
    pub fn hit_s(&self, agent: &str) -> Option<f64> {
        let mut collisions = self.motion.collisions.iter();
        let hit = collisions.find(|it| it.between.0 == agent || it.between.1 == agent);
        hit.map(|it| it.time_s)
    }
}

/// Returns frames followed by those after the contact, if any.
pub fn joined<'a>(frames: &'a [Frame], after: Option<&FilmAfterContact>) -> Cow<'a, [Frame]> {
    match after {
        Some(after) => Cow::Owned([frames, &after.frames].concat()),
        None => Cow::Borrowed(frames),
    }
}

/// Plays a recorded episode again and returns the poses per sample.
pub fn film(bench: &mut Testbench, episode: &Episode) -> Vec<Frame> {
    // A recording may go on after its verdict, up to the contact.
    bench.begin(&episode.start, episode.noise, Aftermath::Play);
    let mut frames = vec![bench.frame()];
    for &action in &episode.actions {
        bench.decide_watched(action, &mut |scene| frames.push(scene.frame()));
    }
    frames
}

/// Returns the poses of [`film`], and those after the contact.
pub fn film_beyond(bench: &mut Testbench, episode: &Episode) -> Film {
    let frames = film(bench, episode);
    let after = bench.contact.as_ref().and_then(|touch| {
        let (motion, frames) = bench.scene.after_contact(KEPT_AFTER_CONTACT_S)?;
        Some(FilmAfterContact {
            contact_s: touch.time_s,
            sample_s: bench.clock().sample_s,
            motion,
            frames,
        })
    });
    Film {
        frames,
        after: after.filter(|after| !after.frames.is_empty()),
    }
}
