//! Episode with the derived values that only the viewer shows.

use nalgebra::Vector3;

use super::log_writer::OpeningTimeline;
use super::palette;
use super::palette::Rgb;
use crate::experiment::{EpisodeFrames, RunningRobustness, SampleInstant};
use crate::scene::{AfterContact, Frame};
use crate::testbench::{Episode, Film, film_beyond};
use crate::world::Scenario;

/// Least motion in seconds after contact or verdict for which a recording opens there.
///
/// Below it, the end of the motion shows the same.
const GOES_ON_S: f64 = 0.3;

/// Episode with all derived values that a viewer shows.
pub(super) struct ViewedEpisode<'a> {
    pub scenario: &'a Scenario,
    pub episode: &'a Episode,
    pub caption: &'a str,
    /// Poses, lights and instants.
    pub shown: EpisodeFrames,
    /// Collisions and pushes after the contact, in worlds that play them.
    pub after: Option<AfterContact>,
    /// Running robustness of ψ_ego.
    pub spec: RunningRobustness,
    /// Running robustness of every rule, in the rulebook's order.
    pub rules: Vec<RunningRobustness>,
    /// First sample at which the replay departs from the record.
    pub departs: Option<usize>,
    /// Number of samples between two decisions.
    pub samples_per_decision: usize,
}

impl<'a> ViewedEpisode<'a> {
    /// Replays the episode and evaluates its formulas.
    pub(super) fn new(
        scenario: &'a Scenario,
        episode: &'a Episode,
        caption: &'a str,
    ) -> ViewedEpisode<'a> {
        // A program is not started again: its commands are in the episode.
        let mut bench = scenario.repeating(episode).bench();
        let Film { frames, after } = film_beyond(&mut bench, episode);
        let rules = 0..scenario.rulebook().rules.len();
        ViewedEpisode {
            scenario,
            episode,
            caption,
            shown: EpisodeFrames::of(scenario, episode, bench.stage(), &frames, after.as_ref()),
            after: after.map(|after| after.motion),
            spec: RunningRobustness::of_spec(scenario, episode),
            rules: rules
                .map(|rule| RunningRobustness::of_rule(scenario, rule, episode))
                .collect(),
            departs: departure(episode, bench.trace()),
            samples_per_decision: bench.clock().samples_per_decision(),
        }
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.episode.trace.len()
    }

    /// Time of a sample in seconds.
    pub(super) fn time_s(&self, sample: usize) -> f64 {
        self.shown.time_s(sample)
    }

    /// Instant of a sample.
    pub(super) fn instant(&self, sample: usize) -> SampleInstant {
        self.shown.instant(sample)
    }

    /// First sample at or after an instant.
    pub(super) fn sample_of(&self, time_s: f64) -> usize {
        // Upwards, since a contact between two samples shows in the later one. The
        // tolerance is for 3 · 0.1 s, which is a little more than three samples.
        let sample = (time_s / self.episode.trace.dt_s() - 1e-9).ceil() as usize;
        sample.min(self.samples().saturating_sub(1))
    }

    /// Time of the last sample in seconds.
    pub(super) fn end_s(&self) -> f64 {
        self.time_s(self.samples().saturating_sub(1))
    }

    /// Poses of all agents: at every sample, then after the contact.
    pub(super) fn poses(&self) -> impl Iterator<Item = &Frame> + Clone {
        self.shown.poses()
    }

    /// Sample and time in seconds of every pose.
    pub(super) fn pose_instants(&self) -> impl Iterator<Item = (usize, f64)> {
        self.shown.frames.iter().map(|it| (it.sample, it.time_s))
    }

    /// Time of the last pose or sample in seconds.
    pub(super) fn motion_end_s(&self) -> f64 {
        let last = self.pose_instants().last();
        last.map_or(0.0, |(_, time_s)| time_s).max(self.end_s())
    }

    /// Opening time of the viewer, if the motion continues long after it.
    ///
    /// It is the contact, or the verdict of an episode without a contact.
    pub(super) fn opening(&self) -> Option<OpeningTimeline> {
        let opening = match (&self.episode.contact, self.shown.decided) {
            (Some(contact), _) => OpeningTimeline {
                name: "until_contact",
                end_s: self.time_s(self.sample_of(contact.time_s)),
            },
            (None, Some(decided)) => OpeningTimeline {
                name: "until_verdict",
                end_s: decided.time_s,
            },
            (None, None) => return None,
        };
        (opening.end_s + GOES_ON_S < self.motion_end_s()).then_some(opening)
    }

    /// Velocity in m/s of a member of the cast at every pose, in the frame of its body.
    ///
    /// It is that from the pose before, so at a contact it is the one before the contact.
    /// The first pose has the next one's velocity, and a single pose 0.
    pub(super) fn velocities_mps(&self, who: usize) -> Vec<[f64; 3]> {
        let pairs = self.shown.frames.windows(2);
        let moving = pairs.map(|pair| {
            let [from, to] = [&pair[0], &pair[1]].map(|it| &it.frame.placements[who]);
            // Two poses may have one instant, at a contact right on a sample.
            let time_s = (pair[1].time_s - pair[0].time_s).max(1e-9);
            let way_m = Vector3::from(to.centre_m) - Vector3::from(from.centre_m);
            (to.rotation.inverse() * way_m / time_s).into()
        });
        let mut velocities: Vec<[f64; 3]> = moving.collect();
        velocities.insert(0, velocities.first().copied().unwrap_or_default());
        velocities
    }

    /// Instant at which the plots end: the contact or the verdict, the later of both.
    ///
    /// Without either it is the last sample.
    pub(super) fn plotted_until_s(&self) -> f64 {
        let contact_s = self.episode.contact.as_ref().map(|touch| touch.time_s);
        let decided_s = self.shown.decided.map(|decided| decided.time_s);
        let ends_s = contact_s.into_iter().chain(decided_s);
        ends_s.reduce(f64::max).unwrap_or(self.end_s())
    }

    /// Number of samples in the plots.
    pub(super) fn plotted_samples(&self) -> usize {
        // The tolerance keeps an instant right on a sample from taking the
        // next one.
        let last = self.sample_of(self.plotted_until_s() - 1e-9);
        self.samples().min(last + 1)
    }

    /// Height of the ground below a member of the cast: 0 on flat roads.
    pub(super) fn ground_m(&self, who: usize, frame: &Frame) -> f64 {
        let mut borders = self
            .shown
            .stage
            .lane_borders_m
            .iter()
            .chain(self.shown.stage.side_roads_m.iter().flatten());
        if borders.all(|border| border.iter().all(|point| point[2] == 0.0)) {
            return 0.0;
        }
        frame.placements[who].centre_m[2] - 0.5 * self.shown.stage.agents[who].size_m[2]
    }

    /// Index of the ego in the cast.
    pub(super) fn ego(&self) -> usize {
        self.shown.ego()
    }

    /// Colour of a member of the cast.
    pub(super) fn colour(&self, who: usize) -> Rgb {
        let role = self.shown.stage.agents[who].role;
        let before = &self.shown.stage.agents[..who];
        palette::of_role(
            role,
            before.iter().filter(|agent| agent.role == role).count(),
        )
    }

    /// First sample of decision `decision`.
    pub(super) fn decision_sample(&self, decision: usize) -> usize {
        decision * self.samples_per_decision
    }
}

/// First sample of `episode` that the replay does not reproduce.
fn departure(episode: &Episode, again: &crate::trace::Trace) -> Option<usize> {
    let recorded = &episode.trace;
    let common = recorded.len().min(again.len());
    let signals = recorded.schema().len();
    // Another number of signals means another build, whose columns do not
    // correspond.
    if again.schema().len() != signals {
        return Some(0);
    }
    let differs = |sample: &usize| {
        // Exactly: a replay has equal bits, or it is another run.
        (0..signals).any(|i| recorded.column(i)[*sample] != again.column(i)[*sample])
    };
    // A replay that ends early departs where the record continues.
    let short = again.len() < recorded.len();
    (0..common).find(differs).or(short.then_some(common))
}
