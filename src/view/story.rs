//! What happened in an episode, as numbers: no viewer in sight.

use super::palette;
use super::palette::Rgb;
use crate::rulebook::Verdict;
use crate::scene::{Frame, Role, Stage};
use crate::stl::{Interval, Monitor};
use crate::testbench::{Episode, film};
use crate::world::Scenario;

/// Who opens a recording later than this after the verdict does not see it.
const GOES_ON_S: f64 = 0.3;

/// An episode with everything derived from it that a viewer shows.
pub(super) struct Story<'a> {
    pub scenario: &'a Scenario,
    pub episode: &'a Episode,
    pub caption: &'a str,
    pub stage: Stage,
    /// One frame per sample of the trace.
    pub frames: Vec<Frame>,
    /// Running robustness of ψ_ego.
    pub spec: Running,
    /// Running robustness of every rule, in the rulebook's order.
    pub rules: Vec<Running>,
    /// The sample at which what the verdict says became certain.
    pub decided: Option<usize>,
    /// The first sample at which the re-simulation departs from the record.
    pub departs: Option<usize>,
    /// Samples between two decisions.
    pub samples_per_decision: usize,
}

/// The robustness of one formula as it develops.
pub(super) struct Running {
    /// Its name: `ego spec` or the rule's.
    pub name: String,
    /// What can still be reached, per sample.
    pub values: Vec<f64>,
    /// The sample from which it can no longer be satisfied.
    pub lost: Option<usize>,
}

impl<'a> Story<'a> {
    /// Plays the episode again and follows its formulas.
    pub fn new(scenario: &'a Scenario, episode: &'a Episode, caption: &'a str) -> Story<'a> {
        let mut bench = scenario.bench();
        let mut frames = film(&mut bench, episode);
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
        Story {
            scenario,
            episode,
            caption,
            stage: bench.stage(),
            frames,
            spec,
            rules,
            decided: decided.filter(|&sample| sample < episode.trace.len()),
            departs,
            samples_per_decision: bench.clock().samples_per_decision(),
        }
    }

    /// How many samples there are.
    pub fn samples(&self) -> usize {
        self.episode.trace.len()
    }

    /// The time of a sample.
    pub fn time_s(&self, sample: usize) -> f64 {
        // Time is i · dt; rounding hides the dust of binary fractions.
        (sample as f64 * self.episode.trace.dt_s() * 1e9).round() / 1e9
    }

    /// The time of the last sample.
    pub fn end_s(&self) -> f64 {
        self.time_s(self.samples().saturating_sub(1))
    }

    /// When the viewer opens, if the episode goes on for long after the verdict.
    pub fn opens_s(&self) -> Option<f64> {
        let decided_s = self.time_s(self.decided?);
        (decided_s + GOES_ON_S < self.end_s()).then_some(decided_s)
    }

    /// The position of the ego in the cast.
    pub fn ego(&self) -> usize {
        let is_ego = |who: &crate::scene::Cast| who.role == Role::Ego;
        self.stage.cast.iter().position(is_ego).unwrap_or(0)
    }

    /// The colour of a member of the cast.
    pub fn colour(&self, who: usize) -> Rgb {
        let role = self.stage.cast[who].role;
        let before = &self.stage.cast[..who];
        palette::of_role(role, before.iter().filter(|cast| cast.role == role).count())
    }

    /// The samples on which the verdict rests.
    pub fn judged(&self) -> crate::trace::Trace {
        let mut judged = self.episode.trace.clone();
        judged.truncate(self.episode.judged);
        judged
    }

    /// The first instant of decision `decision`, as a sample.
    pub fn decision_sample(&self, decision: usize) -> usize {
        decision * self.samples_per_decision
    }
}

/// The first sample of `episode` that the re-simulation does not reproduce.
fn departure(episode: &Episode, again: &crate::trace::Trace) -> Option<usize> {
    let recorded = &episode.trace;
    let common = recorded.len().min(again.len());
    let signals = recorded.schema().len();
    if again.schema().len() != signals {
        return Some(0);
    }
    let differs = |sample: &usize| {
        (0..signals).any(|i| recorded.column(i)[*sample] != again.column(i)[*sample])
    };
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

/// The end of the interval that says something: for `always` the running
/// minimum, for `eventually` the running maximum.
fn shown(now: Interval, limit: f64) -> f64 {
    match now {
        Interval { hi, .. } if hi < limit => hi,
        Interval { lo, .. } if -limit < lo => lo,
        Interval { hi, .. } => hi,
    }
}

/// Equal neighbours as (first, one past the last, value).
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
