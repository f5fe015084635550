//! Episode as numbers to show, independent of the viewer.

use super::log_writer::{OpeningTimeline, SampleInstant};
use super::palette;
use super::palette::Rgb;
use crate::rulebook::Verdict;
use crate::scene::{Frame, Role, SceneGeometry};
use crate::stl::{Interval, Monitor};
use crate::testbench::{Episode, Film, FilmAfterContact, film_beyond};
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
    pub stage: SceneGeometry,
    /// Frames, one per sample of the trace.
    pub frames: Vec<Frame>,
    /// Motion after the contact, in worlds that play it.
    pub after: Option<FilmAfterContact>,
    /// Number of frames before those after the contact, if any: no held samples.
    moving: usize,
    /// Running robustness of ψ_ego.
    pub spec: Running,
    /// Running robustness of every rule, in the rulebook's order.
    pub rules: Vec<Running>,
    /// Sample at which the verdict became certain.
    pub decided: Option<usize>,
    /// First sample at which the replay departs from the record.
    pub departs: Option<usize>,
    /// Number of samples between two decisions.
    pub samples_per_decision: usize,
}

/// Running robustness of one formula.
pub(super) struct Running {
    /// Name: `ego spec`, or that of the rule.
    pub name: String,
    /// Informative bound of the robustness, per sample.
    pub values: Vec<f64>,
    /// Sample from which the formula cannot be satisfied.
    pub lost: Option<usize>,
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
        let Film { mut frames, after } = film_beyond(&mut bench, episode);
        let moving = frames.len();
        let departs = departure(episode, bench.trace());
        // A run that was judged to the horizon holds its last sample.
        if let Some(last) = frames.last().cloned() {
            frames.resize(episode.trace.len(), last);
        }
        let rulebook = scenario.rulebook();
        let samples = bench.clock().samples();
        let follow = |name: &str, monitor: &Monitor, lost: fn(Interval) -> bool| {
            Running::follow(name, monitor, episode, samples, lost)
        };
        let spec = follow("ego spec", &rulebook.spec, Interval::is_violated);
        let rules: Vec<Running> = rulebook
            .rules
            .iter()
            // A rule is broken at ρ = 0 already, unlike the specification of
            // the ego.
            .map(|rule| follow(&rule.name, &rule.monitor, |now| now.hi <= 0.0))
            .collect();
        let last = episode.judged.saturating_sub(1);
        let decided = match episode.verdict {
            Verdict::Counterexample { .. } | Verdict::Uncounted { .. } => {
                Some(spec.lost.unwrap_or(last))
            }
            Verdict::Foul { rule, .. } => Some(rules[rule].lost.unwrap_or(last)),
            Verdict::Invalid => Some(last),
            Verdict::Held { .. } => None,
        };
        ViewedEpisode {
            scenario,
            episode,
            caption,
            stage: bench.stage(),
            moving: if after.is_some() {
                moving.min(frames.len())
            } else {
                frames.len()
            },
            frames,
            after,
            spec,
            rules,
            decided: decided.filter(|&sample| sample < episode.trace.len()),
            departs,
            samples_per_decision: bench.clock().samples_per_decision(),
        }
    }

    /// Number of samples.
    pub(super) fn samples(&self) -> usize {
        self.episode.trace.len()
    }

    /// Time of a sample in seconds.
    pub(super) fn time_s(&self, sample: usize) -> f64 {
        // Time is i · dt. Rounding removes the digits that binary fractions
        // add.
        (sample as f64 * self.episode.trace.dt_s() * 1e9).round() / 1e9
    }

    /// Instant of a sample.
    pub(super) fn instant(&self, sample: usize) -> SampleInstant {
        SampleInstant {
            sample,
            time_s: self.time_s(sample),
        }
    }

    /// First sample at or after an instant.
    pub(super) fn sample_of(&self, time_s: f64) -> usize {
        let sample = (time_s / self.episode.trace.dt_s()).ceil() as usize;
        sample.min(self.samples().saturating_sub(1))
    }

    /// Time of the last sample in seconds.
    pub(super) fn end_s(&self) -> f64 {
        self.time_s(self.samples().saturating_sub(1))
    }

    /// Poses of all agents: at every sample, then after the contact.
    pub(super) fn poses(&self) -> impl Iterator<Item = &Frame> + Clone {
        let after = self.after.iter().flat_map(|after| &after.frames);
        self.frames[..self.moving].iter().chain(after)
    }

    /// Sample and time in seconds of every pose.
    pub(super) fn pose_instants(&self) -> impl Iterator<Item = (usize, f64)> {
        let time_s = |pose: usize| match &self.after {
            Some(after) if self.moving <= pose => after.time_s(pose - self.moving),
            // The motion goes on from the contact, not from the end of its sample.
            Some(after) if pose + 1 == self.moving => after.contact_s,
            _ => self.time_s(pose),
        };
        let poses = self.moving + self.after.as_ref().map_or(0, |after| after.frames.len());
        (0..poses).map(move |pose| (pose, time_s(pose)))
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
        let opening = match (&self.episode.contact, self.decided) {
            (Some(contact), _) => OpeningTimeline {
                name: "until_contact",
                end_s: self.time_s(self.sample_of(contact.time_s)),
            },
            (None, Some(sample)) => OpeningTimeline {
                name: "until_verdict",
                end_s: self.time_s(sample),
            },
            (None, None) => return None,
        };
        (opening.end_s + GOES_ON_S < self.motion_end_s()).then_some(opening)
    }

    /// Height of the ground below a member of the cast: 0 on flat roads.
    pub(super) fn ground_m(&self, who: usize, frame: &Frame) -> f64 {
        let mut borders = self
            .stage
            .lane_borders_m
            .iter()
            .chain(self.stage.side_roads_m.iter().flatten());
        if borders.all(|border| border.iter().all(|point| point[2] == 0.0)) {
            return 0.0;
        }
        frame.placements[who].centre_m[2] - 0.5 * self.stage.agents[who].size_m[2]
    }

    /// Index of the ego in the cast.
    pub(super) fn ego(&self) -> usize {
        let is_ego = |who: &crate::scene::AgentDescription| who.role == Role::Ego;
        self.stage.agents.iter().position(is_ego).unwrap_or(0)
    }

    /// Colour of a member of the cast.
    pub(super) fn colour(&self, who: usize) -> Rgb {
        let role = self.stage.agents[who].role;
        let before = &self.stage.agents[..who];
        palette::of_role(
            role,
            before.iter().filter(|agent| agent.role == role).count(),
        )
    }

    /// Samples that determine the verdict.
    pub(super) fn judged(&self) -> crate::trace::Trace {
        let mut judged = self.episode.trace.clone();
        judged.truncate(self.episode.judged);
        judged
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
        (0..signals).any(|i| recorded.column(i)[*sample] != again.column(i)[*sample])
    };
    // A replay that ends early departs where the record continues.
    let short = again.len() < recorded.len();
    (0..common).find(differs).or(short.then_some(common))
}

impl Running {
    fn follow(
        name: &str,
        monitor: &Monitor,
        episode: &Episode,
        samples: usize,
        lost: fn(Interval) -> bool,
    ) -> Running {
        let trace = &episode.trace;
        let mut online = monitor.online_for(samples);
        let mut row = vec![0.0; trace.schema().len()];
        let mut running = Running {
            name: name.to_owned(),
            values: Vec::with_capacity(trace.len()),
            lost: None,
        };
        let limit = monitor.settings().rho_max.unwrap_or(f64::INFINITY);
        for sample in 0..trace.len() {
            trace.read_row(sample, &mut row);
            // Invariant: a recorded row is finite and has the scene's signals.
            let now = online.push(&row).unwrap_or(Interval::ANY);
            if running.lost.is_none() && lost(now) {
                running.lost = Some(sample);
            }
            running.values.push(shown(now, limit));
        }
        running
    }
}

/// Informative end of an interval of possible values.
///
/// For `always` it is the running minimum, for `eventually` the running
/// maximum.
fn shown(now: Interval, limit: f64) -> f64 {
    match now {
        // An end at the limit carries no information yet.
        Interval { hi, .. } if hi < limit => hi,
        Interval { lo, .. } if -limit < lo => lo,
        Interval { hi, .. } => hi,
    }
}

/// Runs of equal values as (first, end, value), with an exclusive end.
pub(super) fn action_runs(actions: &[usize]) -> Vec<(usize, usize, usize)> {
    let mut runs: Vec<(usize, usize, usize)> = Vec::new();
    for (i, &action) in actions.iter().enumerate() {
        match runs.last_mut() {
            Some((_, to, last)) if *last == action => *to = i + 1,
            _ => runs.push((i, i + 1, action)),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_actions_are_one_run() {
        assert_eq!(action_runs(&[]), []);
        assert_eq!(
            action_runs(&[2, 2, 0, 2]),
            [(0, 2, 2), (2, 3, 0), (3, 4, 2)]
        );
    }

    #[test]
    fn the_informative_end_of_an_interval_is_shown() {
        let any = f64::INFINITY;
        let cases = [
            ((-any, 3.0), 3.0),   // always, undecided
            ((2.0, any), 2.0),    // eventually, undecided
            ((-1.0, -1.0), -1.0), // decided
            ((-any, any), any),   // nothing known
        ];
        for ((lo, hi), expected) in cases {
            assert_eq!(shown(Interval { lo, hi }, any), expected, "[{lo}, {hi}]");
        }
    }
}
