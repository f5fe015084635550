//! Which counterexamples are the same one over and over.
//!
//! Two are alike if the same leaf of ψ_ego is violated, in the same kind of
//! contact (or none) with the same agent, and their traces are near each other.
//!
//! Near is measured on what the ados observe: of all signals those are the ones
//! that the world's author says matter, and each has a range, so that metres
//! and metres per second can be added. Each trace, up to its end, is read at
//! [`POINTS`] equally spaced times, so that equal stories of unequal length are
//! compared stage by stage; the distance is the root mean square over times and
//! signals of the difference in half ranges. Up to [`NEAR`] is near.
//!
//! Clusters are made by leaders (Hartigan, "Clustering Algorithms", 1975, ch. 3):
//! in the order given, worst first, each joins the first leader it is like, or
//! leads a new cluster. So every leader is the worst of its cluster.

use std::cmp;

use serde::{Deserialize, Serialize};

use super::failed_leaf::leaf;
use crate::rulebook::Verdict;
use crate::run_dir::Severity;
use crate::severity::CrashKind;
use crate::testbench::Episode;
use crate::trace::Trace;
use crate::world::Scenario;

/// Times at which a trace is read.
pub const POINTS: usize = 32;
/// Distance up to which two traces are near, in half ranges of the signals.
pub const NEAR: f64 = 0.15;

/// What of a counterexample is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CrashFeatures {
    pub(crate) story: CrashClass,
    pub(crate) signals: Vec<f64>,
}

/// What alike counterexamples have in common exactly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct CrashClass {
    leaf: String,
    kind: Option<CrashKind>,
    with: Option<(String, String)>,
}

impl CrashClass {
    /// The leaf of ψ_ego that was violated, and who touched.
    pub(crate) fn told(&self) -> (String, Option<(String, String)>) {
        (self.leaf.clone(), self.with.clone())
    }
}

impl CrashFeatures {
    /// That of an episode of `scenario`.
    pub fn of(scenario: &Scenario, episode: &Episode) -> CrashFeatures {
        let contact = episode.contact.as_ref();
        CrashFeatures {
            story: CrashClass {
                leaf: leaf(scenario, episode),
                kind: contact.and_then(|touch| Some(touch.impact?.kind)),
                with: contact.map(|touch| touch.between.clone()),
            },
            signals: observed(scenario, &episode.trace),
        }
    }

    /// Whether it is the same one over again.
    pub fn is_like(&self, other: &CrashFeatures) -> bool {
        self.story == other.story && self.distance(other) <= NEAR
    }

    /// Root mean square difference of what is observed, in half ranges.
    pub fn distance(&self, other: &CrashFeatures) -> f64 {
        let pairs = self.signals.iter().zip(&other.signals);
        let squares: f64 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
        (squares / self.signals.len().max(1) as f64).sqrt()
    }
}

/// The observed signals at equally spaced times, in half ranges.
fn observed(scenario: &Scenario, trace: &Trace) -> Vec<f64> {
    let last = trace.len().saturating_sub(1) as f64;
    let times = (0..POINTS).map(|n| (last * n as f64 / (POINTS - 1) as f64).round() as usize);
    let times: Vec<usize> = times.collect();
    let observed = scenario.world().observed().iter();
    let columns = observed.filter_map(|it| Some((trace.signal(&it.name)?, it.mid, it.half)));
    columns
        .flat_map(|(column, mid, half)| {
            let at = |&time: &usize| column.get(time).map(|value| (value - mid) / half);
            times.iter().filter_map(at).collect::<Vec<f64>>()
        })
        .collect()
}

/// Counterexamples that are alike: positions in what was given, the leader first.
pub fn clusters(shapes: &[CrashFeatures]) -> Vec<Vec<usize>> {
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for (at, shape) in shapes.iter().enumerate() {
        let like = |cluster: &&mut Vec<usize>| shapes[cluster[0]].is_like(shape);
        match clusters.iter_mut().find(like) {
            Some(cluster) => cluster.push(at),
            None => clusters.push(vec![at]),
        }
    }
    clusters
}

/// What makes one worse than another, first things first.
pub(crate) fn badness(episode: &Episode) -> [f64; 4] {
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

/// Of two lists the one that is larger where they first differ comes first.
pub(crate) fn descending(a: &[f64; 4], b: &[f64; 4]) -> cmp::Ordering {
    let mut pairs = b.iter().zip(a).map(|(b, a)| b.total_cmp(a));
    let differing = pairs.find(|order| order.is_ne());
    differing.unwrap_or(cmp::Ordering::Equal)
}

/// The worse of two comes first: a contact before none, then by injury risk,
/// closing speed, and depth of the violation.
pub(crate) fn worse_first(a: &Episode, b: &Episode) -> cmp::Ordering {
    descending(&badness(a), &badness(b))
}
