//! Clusters of similar counterexamples.
//!
//! Two counterexamples are similar if they violate the same leaf of ψ_ego, end in the
//! same kind of contact (or none) with the same agent, and have near traces.
//!
//! The distance of traces is measured on the signals that the ados observe. The world's
//! author selected these signals, and each has a range, so metres and metres per second
//! can be added. Each trace, up to its end, is read at `POINTS` equally spaced times,
//! so episodes of unequal length are compared stage by stage. The distance is the root
//! mean square over times and signals of the difference in half ranges. Traces up to
//! [`NEAR`] are near.
//!
//! Clusters are made by leaders (Hartigan, "Clustering Algorithms", 1975, ch. 3). In the
//! given order, worst first, each counterexample joins the first similar leader or leads
//! a new cluster. Every leader is therefore the worst of its cluster.

use std::cmp;

use super::failure_kind::FailureKind;
use crate::rulebook::Verdict;
use crate::run_dir::Severity;
use crate::testbench::Episode;
use crate::trace::Trace;
use crate::world::Scenario;

/// Times at which a trace is read.
pub(crate) const POINTS: usize = 32;
/// Distance up to which two traces are near, in half ranges of the signals.
pub const NEAR: f64 = 0.15;

/// Features by which counterexamples are compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CrashFeatures {
    /// Kind of the failure, which similar counterexamples share exactly.
    pub kind: FailureKind,
    /// Observed signals at equally spaced times, in half ranges.
    pub signals: Vec<f64>,
}

impl CrashFeatures {
    /// Returns the features of an episode of `scenario`.
    pub fn of(scenario: &Scenario, episode: &Episode) -> CrashFeatures {
        CrashFeatures {
            kind: FailureKind::of(scenario, episode),
            signals: observed(scenario, &episode.trace),
        }
    }

    /// Returns whether two counterexamples are similar.
    pub fn is_like(&self, other: &CrashFeatures) -> bool {
        self.kind == other.kind && self.distance(other) <= NEAR
    }

    /// Returns the root mean square difference of the observed signals, in half ranges.
    pub fn distance(&self, other: &CrashFeatures) -> f64 {
        let pairs = self.signals.iter().zip(&other.signals);
        let squares: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
        // A world whose ado observes nothing has no signal to differ in.
        (squares / self.signals.len().max(1) as f64).sqrt()
    }
}

/// Returns the observed signals at equally spaced times, in half ranges.
fn observed(scenario: &Scenario, trace: &Trace) -> Vec<f64> {
    let last = trace.len().saturating_sub(1) as f64;
    let times: Vec<usize> = (0..POINTS)
        // Episodes of different lengths are compared over the same number of points.
        .map(|n| (last * n as f64 / (POINTS - 1) as f64).round() as usize)
        .collect();
    let observed = scenario.world().observed().iter();
    let columns = observed.filter_map(|it| Some((trace.signal(&it.name)?, it.mid, it.half)));
    columns
        .flat_map(|(column, mid, half)| {
            let at = |&time: &usize| column.get(time).map(|value| (value - mid) / half);
            times.iter().filter_map(at).collect::<Vec<f64>>()
        })
        .collect()
}

/// Returns clusters of similar counterexamples as positions, each with its leader first.
pub fn clusters(shapes: &[CrashFeatures]) -> Vec<Vec<usize>> {
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for (at, shape) in shapes.iter().enumerate() {
        // Against the leader only, so that clusters do not grow along a chain of
        // neighbours.
        let like = |cluster: &&mut Vec<usize>| shapes[cluster[0]].is_like(shape);
        match clusters.iter_mut().find(like) {
            Some(cluster) => cluster.push(at),
            None => clusters.push(vec![at]),
        }
    }
    clusters
}

/// Returns the criteria of severity, the most important first.
pub fn badness(episode: &Episode) -> [f64; 4] {
    // A contact without the ego has no severity and ranks like none.
    let severity = Severity::of(episode);
    let risk = severity.and_then(|severity| severity.injury_risk);
    let depth = match episode.verdict {
        Verdict::Counterexample { by } => by,
        _ => 0.0,
    };
    [
        f64::from(u8::from(severity.is_some())),
        risk.map_or(0.0, |risk| risk.probability),
        severity.map_or(0.0, |severity| severity.closing_speed_mps),
        depth,
    ]
}

/// Orders two lists by their first difference, the larger value first.
pub fn descending(a: &[f64; 4], b: &[f64; 4]) -> cmp::Ordering {
    let mut pairs = b.iter().zip(a).map(|(b, a)| b.total_cmp(a));
    let differing = pairs.find(|order| order.is_ne());
    differing.unwrap_or(cmp::Ordering::Equal)
}

/// Orders two episodes by severity, the worse first.
///
/// A contact comes before none, then injury risk, closing speed and depth of the
/// violation decide.
pub fn worse_first(a: &Episode, b: &Episode) -> cmp::Ordering {
    descending(&badness(a), &badness(b))
}
