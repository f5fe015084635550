//! Robustness of formulas while an episode runs, and the instant of its verdict.

use serde::Serialize;

use crate::rulebook::Verdict;
use crate::stl::{Interval, Monitor};
use crate::testbench::Episode;
use crate::world::Scenario;

/// Instant of an episode: a sample and its time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SampleInstant {
    /// Position among the samples.
    pub sample: usize,
    /// Time since the start in seconds.
    pub time_s: f64,
}

/// Running robustness of one formula.
pub struct RunningRobustness {
    /// Name: `ego spec`, or that of the rule.
    pub name: String,
    /// Informative bound of the robustness, per sample.
    pub values: Vec<f64>,
    /// Sample from which the formula cannot be satisfied.
    pub lost: Option<usize>,
}

impl RunningRobustness {
    /// Returns that of ψ_ego.
    pub fn of_spec(scenario: &Scenario, episode: &Episode) -> RunningRobustness {
        let monitor = &scenario.rulebook().spec;
        // Lost strictly below 0, because ψ_ego holds at ρ = 0.
        follow(
            scenario,
            "ego spec",
            monitor,
            episode,
            Interval::is_violated,
        )
    }

    /// Returns that of a rule by its position in the rulebook.
    pub fn of_rule(scenario: &Scenario, rule: usize, episode: &Episode) -> RunningRobustness {
        let rule = &scenario.rulebook().rules[rule];
        // A rule is broken at ρ = 0 already, unlike the specification of the ego.
        follow(scenario, &rule.name, &rule.monitor, episode, |now| {
            now.hi <= 0.0
        })
    }
}

/// Returns the instant from which the verdict of an episode is certain.
///
/// `None` if ψ_ego holds, which only the end of the episode shows.
pub fn decided(scenario: &Scenario, episode: &Episode) -> Option<SampleInstant> {
    let lost = match episode.verdict {
        Verdict::Counterexample { .. } | Verdict::Uncounted { .. } => {
            RunningRobustness::of_spec(scenario, episode).lost
        }
        Verdict::Foul { rule, .. } => RunningRobustness::of_rule(scenario, rule, episode).lost,
        // A fault decides at the last judged sample, whatever the formulas say.
        Verdict::Invalid => None,
        Verdict::Held { .. } => return None,
    };
    let judged = episode.judged.min(episode.trace.len());
    // Later samples are aftermath, which does not affect the verdict.
    let in_time = lost.filter(|sample| *sample < judged);
    let sample = in_time.unwrap_or(judged.saturating_sub(1));
    Some(ending_at(episode, sample))
}

/// Returns the instant from which the verdict is certain, the last judged one if ψ_ego holds.
pub fn verdict_instant(scenario: &Scenario, episode: &Episode) -> SampleInstant {
    let last = || ending_at(episode, episode.judged.saturating_sub(1));
    decided(scenario, episode).unwrap_or_else(last)
}

/// Returns the instant of a sample with which something ends.
///
/// A contact lies between two samples, and the row after it is of its instant. A run that
/// is judged to the horizon holds that row.
pub fn ending_at(episode: &Episode, sample: usize) -> SampleInstant {
    // Rounding removes the digits that binary fractions add.
    let time_s = (sample as f64 * episode.trace.dt_s() * 1e9).round() / 1e9;
    let contact_s = episode.contact.as_ref().map(|touch| touch.time_s);
    SampleInstant {
        sample,
        time_s: time_s.min(contact_s.unwrap_or(f64::INFINITY)),
    }
}

fn follow(
    scenario: &Scenario,
    name: &str,
    monitor: &Monitor,
    episode: &Episode,
    is_lost: fn(Interval) -> bool,
) -> RunningRobustness {
    let trace = &episode.trace;
    // The monitor needs the length of a full episode, not that of the recorded part.
    let mut online = monitor.online_for(scenario.world().clock().samples());
    let mut row = vec![0.0; trace.schema().len()];
    let limit = monitor.settings().rho_max.unwrap_or(f64::INFINITY);
    let mut running = RunningRobustness {
        name: name.to_owned(),
        values: Vec::with_capacity(trace.len()),
        lost: None,
    };
    for sample in 0..trace.len() {
        trace.read_row(sample, &mut row);
        // Invariant: a recorded row is finite and has the scene's signals.
        let now = online.push(&row).unwrap_or(Interval::ANY);
        if running.lost.is_none() && is_lost(now) {
            running.lost = Some(sample);
        }
        running.values.push(shown(now, limit));
    }
    running
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

#[cfg(test)]
mod tests {
    use super::*;

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
