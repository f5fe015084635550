//! Episode as numbers to show: its scene, and its motion frame by frame.
//!
//! Pictures, animations and recordings for the viewer draw from it, so that all of them
//! show one instant of the verdict and of the contact.

use serde::Serialize;

use super::running_robustness::{SampleInstant, decided, ending_at};
use crate::ego::Phase;
use crate::preventability::FilmedDriver;
use crate::scene::{ContactEvent, Frame, Role, SceneGeometry};
use crate::testbench::{Episode, FilmAfterContact, Testbench};
use crate::trace::Trace;
use crate::world::Scenario;

/// One frame of an episode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ShownFrame {
    /// Position among the frames, which is the sample up to the contact.
    pub sample: usize,
    /// Time since the start in seconds, rounded to 1 ns. That of a contact is exact.
    pub time_s: f64,
    /// Poses of all agents and phases of all lights.
    #[serde(flatten)]
    pub frame: Frame,
    /// Published speed of every agent in m/s. `None` if it is not known.
    pub speeds_mps: Vec<Option<f64>>,
}

/// Episode as numbers to show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EpisodeFrames {
    /// Static content, on the road of the episode.
    pub stage: SceneGeometry,
    /// Frames in the order of time: those of the record, then those after the contact.
    pub frames: Vec<ShownFrame>,
    /// Number of frames of the record.
    pub recorded: usize,
    /// Time between two samples in seconds.
    pub sample_s: f64,
    /// Contact that ends the record.
    pub contact: Option<ContactEvent>,
    /// Last judged sample.
    pub judged: SampleInstant,
    /// Instant from which the verdict is certain. `None` if ψ_ego holds.
    pub decided: Option<SampleInstant>,
}

impl ShownFrame {
    /// Returns the current sample of a bench, as the first frame of a film.
    pub fn now(bench: &Testbench) -> ShownFrame {
        let trace = bench.trace();
        let last = trace.len().saturating_sub(1);
        let time_s = rounded_s(last, trace.dt_s());
        let frame = bench.frame();
        let bodies = bench.bodies().into_iter();
        let mut speeds_mps: Vec<Option<f64>> = bodies.map(|it| Some(it.state.speed_mps)).collect();
        // Players of a grid have no bodies.
        speeds_mps.resize(frame.placements.len(), None);
        ShownFrame {
            sample: 0,
            // A contact on the whole run holds its sample to the end, and the clock says so.
            time_s: bench.contact().map_or(time_s, |contact| contact.time_s),
            frame,
            speeds_mps,
        }
    }
}

impl EpisodeFrames {
    /// Returns the current sample of a bench as the only frame.
    pub fn now(bench: &Testbench) -> EpisodeFrames {
        let shown = ShownFrame::now(bench);
        EpisodeFrames {
            stage: bench.stage(),
            judged: SampleInstant {
                sample: shown.sample,
                time_s: shown.time_s,
            },
            frames: vec![shown],
            recorded: 1,
            sample_s: bench.trace().dt_s(),
            contact: bench.contact().cloned(),
            decided: None,
        }
    }

    /// Returns an episode whose poses are known, with those after the contact.
    ///
    /// `frames` has one per sample, the first at 0 s. `stage` is that of the episode's road.
    pub fn of(
        scenario: &Scenario,
        episode: &Episode,
        stage: SceneGeometry,
        frames: &[Frame],
        after: Option<&FilmAfterContact>,
    ) -> EpisodeFrames {
        let mut shown = EpisodeFrames {
            stage,
            frames: Vec::with_capacity(frames.len()),
            recorded: frames.len(),
            sample_s: episode.trace.dt_s(),
            contact: episode.contact.clone(),
            judged: ending_at(episode, episode.judged.saturating_sub(1)),
            decided: decided(scenario, episode),
        };
        shown.push_all(frames, Some(&episode.trace));
        if let Some(after) = after {
            // Wrecks slide after the record, and no signal publishes their speed.
            let unknown = vec![None; shown.stage.agents.len()];
            for (i, frame) in after.frames.iter().enumerate() {
                shown.push(after.time_s(i), frame, unknown.clone());
            }
        }
        shown
    }

    /// Returns the drive of another driver in the ego's place, with the same verdict.
    pub fn with_driver(&self, filmed: &FilmedDriver) -> EpisodeFrames {
        let mut shown = EpisodeFrames {
            stage: self.stage.clone(),
            frames: Vec::with_capacity(filmed.frames.len()),
            recorded: filmed.frames.len(),
            contact: filmed.contact.clone(),
            // The verdict stays that of the recorded ego, with which the driver is
            // compared.
            ..*self
        };
        shown.push_all(&filmed.frames, None);
        shown
    }

    fn push_all(&mut self, frames: &[Frame], trace: Option<&Trace>) {
        let column = |name: &str| trace?.signal(&format!("{name}.speed"));
        let agents = self.stage.agents.iter();
        let columns: Vec<Option<&[f64]>> = agents.map(|agent| column(&agent.name)).collect();
        for (sample, frame) in frames.iter().enumerate() {
            // The trace may end before the last frame.
            let speed = |column: &Option<&[f64]>| {
                column.and_then(|it| it.get(sample).or(it.last()).copied())
            };
            let speeds_mps = columns.iter().map(speed).collect();
            self.push(self.time_s(sample), frame, speeds_mps);
        }
    }

    fn push(&mut self, time_s: f64, frame: &Frame, speeds_mps: Vec<Option<f64>>) {
        self.frames.push(ShownFrame {
            sample: self.frames.len(),
            time_s,
            frame: frame.clone(),
            speeds_mps,
        });
    }

    /// Returns the time of a sample in seconds.
    ///
    /// A contact lies between two samples, and the last frame of the record is of its
    /// instant. Samples after it only hold its values.
    pub fn time_s(&self, sample: usize) -> f64 {
        let time_s = rounded_s(sample, self.sample_s);
        match &self.contact {
            Some(touch) if sample < self.recorded => time_s.min(touch.time_s),
            _ => time_s,
        }
    }

    /// Returns the instant of a sample.
    pub fn instant(&self, sample: usize) -> SampleInstant {
        SampleInstant {
            sample,
            time_s: self.time_s(sample),
        }
    }

    /// Returns the frame of a sample of the record, and the last one for those held after it.
    pub fn at_sample(&self, sample: usize) -> Option<&Frame> {
        let last = self.recorded.checked_sub(1)?;
        self.frames.get(sample.min(last)).map(|it| &it.frame)
    }

    /// Returns the poses in the order of time.
    pub fn poses(&self) -> impl Iterator<Item = &Frame> + Clone {
        self.frames.iter().map(|it| &it.frame)
    }

    /// Returns the frames at which a light changes its phase, including the first.
    pub fn light_turns(&self, light: usize) -> Vec<(SampleInstant, Phase)> {
        let mut turns: Vec<(SampleInstant, Phase)> = Vec::new();
        for it in &self.frames {
            let phase = it.frame.phases[light];
            if turns.last().is_none_or(|(_, last)| *last != phase) {
                let (sample, time_s) = (it.sample, it.time_s);
                turns.push((SampleInstant { sample, time_s }, phase));
            }
        }
        turns
    }

    /// Returns the index of the ego in the cast.
    pub fn ego(&self) -> usize {
        ego_of(&self.stage)
    }
}

/// Returns the time of a sample in seconds, without the digits that binary fractions add.
fn rounded_s(sample: usize, sample_s: f64) -> f64 {
    (sample as f64 * sample_s * 1e9).round() / 1e9
}

/// Returns the index of the ego in the cast of a scene.
pub fn ego_of(stage: &SceneGeometry) -> usize {
    let mut agents = stage.agents.iter();
    agents.position(|it| it.role == Role::Ego).unwrap_or(0)
}

/// Returns the word for a phase.
pub fn phase_word(phase: Phase) -> &'static str {
    match phase {
        Phase::Green => "green",
        Phase::Yellow => "yellow",
        Phase::Red => "red",
    }
}

/// Decisions in a row with one action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActionRun {
    /// First decision.
    pub from: usize,
    /// Decision after the last.
    pub until: usize,
    /// Number of the action.
    pub action: usize,
}

/// Returns the runs of equal actions, in the order of the decisions.
pub fn action_runs(actions: &[usize]) -> Vec<ActionRun> {
    let mut from = 0;
    let runs = actions.chunk_by(|one, next| one == next).map(|run| {
        let first = from;
        from += run.len();
        ActionRun {
            from: first,
            until: from,
            action: run[0],
        }
    });
    runs.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Start;
    use crate::testbench::{Aftermath, Film, Replay, film_beyond, play};

    /// Cut-in whose contact violates ψ_ego at its sample, found by `search cut_in --seed 1`.
    fn decided_by_contact(scenario: &Scenario) -> (Episode, Film) {
        let start = Start(vec![24.506718203774593, 6.213589348769963]);
        let mut ado = Replay::holding(&[5, 5, 5, 4]);
        let mut bench = scenario.bench();
        let episode = play(
            &mut bench,
            &start,
            5809757876728845851,
            &mut ado,
            Aftermath::Play,
        );
        let film = film_beyond(&mut scenario.bench(), &episode);
        (episode, film)
    }

    #[test]
    fn a_contact_that_decides_and_its_frame_have_one_instant() {
        let scenario = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let (episode, Film { frames, after }) = decided_by_contact(&scenario);
        let stage = scenario.of_episode(&episode).bench().stage();
        let shown = EpisodeFrames::of(&scenario, &episode, stage, &frames, after.as_ref());
        let contact_s = episode.contact.as_ref().expect("a contact").time_s;
        let last = episode.trace.len() - 1;
        // The contact lies between two samples, so the sample alone would be late.
        assert!(contact_s + 1e-6 < last as f64 * episode.trace.dt_s());
        let decided = shown.decided.expect("decided");
        assert_eq!((decided.sample, decided.time_s), (last, contact_s));
        assert_eq!(shown.judged, decided);
        assert_eq!(shown.frames[shown.recorded - 1].time_s, contact_s);
        assert_eq!(shown.time_s(last), contact_s);
        let times_s = shown.frames.iter().map(|it| it.time_s);
        assert!(times_s.is_sorted_by(|a, b| a < b));
        let speed = format!("{}.speed", shown.stage.agents[0].name);
        let speeds_mps = episode.trace.signal(&speed).expect("a speed");
        assert_eq!(shown.frames[3].speeds_mps[0], Some(speeds_mps[3]));
        // A page gets a frame as one flat object: seven numbers per body.
        let json = serde_json::to_value(&shown.frames[3]).expect("JSON");
        let pose = json["placements"][0].as_array().expect("a pose");
        assert_eq!((pose.len(), &json["sample"]), (7, &3.into()));
    }

    #[test]
    fn equal_actions_are_one_run() {
        assert_eq!(action_runs(&[]), []);
        let runs = action_runs(&[2, 2, 0, 2]).into_iter();
        let runs: Vec<_> = runs.map(|it| (it.from, it.until, it.action)).collect();
        assert_eq!(runs, [(0, 2, 2), (2, 3, 0), (3, 4, 2)]);
    }
}
