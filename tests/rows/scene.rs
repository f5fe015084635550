//! A scene whose every outcome is known on paper, and the paper.
//!
//! The ego drives at 11 m/s for ever; the ado starts h metres ahead at 10 m/s
//! and accelerates by a. So, with one action a all the time,
//!
//! ```text
//! speed(t) = 10 + a t        headway(t) = h − t + a t²/2
//! ```
//!
//! ψ_ego: headway ≥ 10. Rules: speed ≥ 2, then acceleration ≤ 0.5; a rule at its
//! bound is broken. Samples every 0.25 s up to 4 s. By hand:
//!
//! | a | what ends it | solved | foul | contact, at 4.54 m |
//! | --- | --- | --- | --- | --- |
//! | +1 | second rule at 0.25 s | never | always | |
//! | 0 | headway(4) = h − 4 | h < 14: trivial | | |
//! | −1 | headway(4) = h − 12 | h < 22 | | h ≤ 16.54 |
//! | −2 | speed(4) = 2; headway(3.75) = h − 17.8125 | h < 27.8125 | else, at 4 s | h ≤ 24.54 |
//! | −3 | speed(2.75) = 1.75; headway(2.5) = h − 11.875 | h < 21.875 | else, at 2.75 s | where solved |
//!
//! With a < 0 they touch after t = (√(1 + 2|a|(h − 4.54)) − 1)/|a| seconds, at a
//! closing speed of 1 + |a| t = √(1 + 2|a|(h − 4.54)). With a = −3 the first rule
//! is lost from speed(8/3) = 2 on, where headway is h − 13.33: before the contact,
//! or at it, if h ≥ 17.8733. With a = −2 it is lost at 4 s, when all contacts are over.
//!
//! Nothing solves h ≥ 46: a lawful ado is slower than the ego by less than 9 m/s.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::experiment::{TestStarts, Watch};
use brakecheck::scene::Start;
use brakecheck::world::Scenario;

pub const TEXT: &str = include_str!("chase.ron");
pub const ACCELERATIONS: [f64; 5] = [1.0, 0.0, -1.0, -2.0, -3.0];
pub const SUBSTEPS: u64 = 13;
pub const SAMPLES: u64 = 16;
pub const DECISIONS: usize = 8;
const SAMPLE_S: f64 = 0.25;
const EGO_MPS: f64 = 11.0;
const CAR_M: f64 = 4.54;

/// The starts of most tests: two trivial ones, eleven that touch under −2 m/s²,
/// three that are solved without, one that is a foul then, and one for nobody.
///
/// (The hundredths keep every sample away from the bounds by more than rounding.)
pub const HEADWAYS_M: [f64; 18] = [
    11.51, 14.26, 15.01, 16.01, 17.01, 18.01, 18.51, 13.01, 19.01, 20.51, 21.01, 22.51, 24.01,
    25.01, 26.51, 27.51, 28.01, 50.01,
];
/// Those that are not trivial.
const COUNTED: usize = 16;

static GO: AtomicBool = AtomicBool::new(false);

pub fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

pub fn world_of(text: &str) -> Scenario {
    Scenario::parse("chase.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

pub fn chase() -> Scenario {
    world_of(TEXT)
}

/// The chase with some words exchanged.
pub fn altered(words: &[(&str, &str)]) -> Scenario {
    let mut text = TEXT.to_owned();
    for (old, new) in words {
        assert!(text.contains(old), "{old}");
        text = text.replace(old, new);
    }
    world_of(&text)
}

/// Starts at these headways; trivial below 14 m, by the table above.
pub fn starts_at(headways_m: &[f64]) -> TestStarts {
    let start = |(i, h): (usize, &f64)| (Start(vec![*h]), 1000 + i as u64);
    TestStarts {
        seed: 7,
        starts: headways_m.iter().enumerate().map(start).collect(),
        trivial: headways_m.iter().map(|h| *h < 14.0).collect(),
    }
}

pub fn starts() -> TestStarts {
    starts_at(&HEADWAYS_M)
}

/// The headways that are not trivial.
pub fn counted() -> impl Iterator<Item = f64> + Clone {
    HEADWAYS_M.into_iter().filter(|h| *h >= 14.0)
}

/// What the paper says of an episode.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Paper {
    pub success: bool,
    /// The rule that is broken, if the episode ends with that.
    pub foul: Option<usize>,
    /// headway − 10 at its least, over the judged samples.
    pub robustness: f64,
    /// Samples that were simulated up to the verdict, and in all.
    pub judged: u64,
    pub samples: u64,
    pub closing_mps: Option<f64>,
    /// A rule lost after a success, at or before the contact.
    pub late_foul: bool,
}

impl Paper {
    /// As a row marks it.
    pub fn mark(&self) -> char {
        if self.success { '1' } else { '0' }
    }

    pub fn steps(&self) -> u64 {
        SUBSTEPS * self.samples
    }

    /// Definition 4 under the world's transform; the first of two rules forfeits both.
    pub fn reward(&self) -> f64 {
        match self.foul {
            Some(0) => -1.0 - 0.1 / 2.0,
            Some(_) => -1.0,
            None if self.success => 0.5 + 0.5 * (-self.robustness / 10.0).tanh(),
            None => -0.5 - 0.5 * (self.robustness / 10.0).tanh(),
        }
    }
}

/// Works an episode out: s = v t + a t²/2, sample by sample.
///
/// `choose` gives the action from the decision's number and the headway;
/// `after` says whether a success is played on to the contact.
pub fn paper(h: f64, after: bool, mut choose: impl FnMut(usize, f64) -> usize) -> Paper {
    let (mut headway_m, mut speed_mps) = (h, 10.0);
    let mut seen = Paper {
        robustness: h - 10.0,
        ..Paper::default()
    };
    let (mut decided, mut lost_m, mut action) = (false, false, 0);
    for sample in 0..SAMPLES {
        if sample % 2 == 0 {
            action = choose(sample as usize / 2, headway_m);
        }
        let a = ACCELERATIONS[action];
        seen.samples += 1;
        let touch_s = contact_s(headway_m - CAR_M, speed_mps, a);
        let moving_s = touch_s.unwrap_or(SAMPLE_S);
        let (before_mps, until_stop_s) = (speed_mps, standstill_s(speed_mps, a).min(moving_s));
        headway_m += before_mps * until_stop_s + 0.5 * a * until_stop_s * until_stop_s;
        headway_m -= EGO_MPS * moving_s;
        speed_mps = if until_stop_s < moving_s {
            0.0
        } else {
            before_mps + a * moving_s
        };
        let accel_mps2 = (speed_mps - before_mps) / moving_s;
        let broken = match (speed_mps <= 2.0, accel_mps2 >= 0.5) {
            (true, _) => Some(0),
            (false, true) => Some(1),
            _ => None,
        };
        if touch_s.is_some() {
            seen.closing_mps = Some(EGO_MPS - speed_mps);
        }
        if decided {
            lost_m |= broken.is_some();
        } else {
            seen.judged = seen.samples;
            seen.robustness = seen.robustness.min(headway_m - 10.0);
            seen.foul = broken;
            seen.success = broken.is_none() && seen.robustness < 0.0;
            decided = broken.is_some() || seen.success;
        }
        if touch_s.is_some() || (decided && !(seen.success && after)) {
            break;
        }
    }
    seen.late_foul = lost_m && seen.closing_mps.is_some();
    if !seen.success && seen.foul.is_none() {
        seen.robustness = seen.robustness.max(0.0);
    }
    seen
}

/// Plays a list of actions, the last one held.
pub fn paper_of(h: f64, actions: &[usize]) -> Paper {
    paper(h, true, |at, _| actions[at.min(actions.len() - 1)])
}

fn standstill_s(speed_mps: f64, a: f64) -> f64 {
    if a < 0.0 {
        -speed_mps / a
    } else {
        f64::INFINITY
    }
}

/// When the clearance is used up within a sample: gap + (v − 11) t + a t²/2 = 0.
fn contact_s(gap_m: f64, speed_mps: f64, a: f64) -> Option<f64> {
    let closing_mps = EGO_MPS - speed_mps;
    let stop_s = standstill_s(speed_mps, a);
    let root = closing_mps * closing_mps - 2.0 * a * gap_m;
    let moving = if a == 0.0 {
        (closing_mps > 0.0).then(|| gap_m / closing_mps)
    } else {
        // The smaller root, in the form that loses no digits.
        (root >= 0.0 && closing_mps + root.sqrt() > 0.0)
            .then(|| 2.0 * gap_m / (closing_mps + root.sqrt()))
    };
    let moving = moving.filter(|at| *at <= stop_s);
    let standing = || {
        let left_m = gap_m - (closing_mps * stop_s - 0.5 * a * stop_s * stop_s);
        stop_s.is_finite().then(|| stop_s + left_m / EGO_MPS)
    };
    moving.or_else(standing).filter(|at| *at <= SAMPLE_S)
}

/// Shares out of the starts that count.
pub fn share(count: usize) -> f64 {
    count as f64 / COUNTED as f64
}

/// The ego of the world, but for what some headways at the start make it do.
#[derive(Clone, Debug)]
pub struct Quirky {
    /// From these headways on by one metre it fails to answer.
    pub fails_m: &'static [f64],
    /// Of so many runs it brakes in all but the first few.
    pub brakes: Option<(u64, u64)>,
    pub calls: u64,
    pub resets: u64,
    pub failing: bool,
}

impl Quirky {
    pub fn failing_from(fails_m: &'static [f64]) -> Quirky {
        Quirky {
            fails_m,
            brakes: None,
            calls: 0,
            resets: 0,
            failing: false,
        }
    }

    pub fn drives(self, world: &Scenario) -> Scenario {
        world.with_ego("quirky", Arc::new(move || Box::new(self.clone())))
    }
}

impl Controller for Quirky {
    fn reset(&mut self, _seed: u64) {
        self.calls = 0;
        self.resets += 1;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let headway_m = percept.leader().map_or(0.0, |lead| lead.headway_m);
        if self.calls == 0 {
            let within = |from: &f64| (*from..from + 1.0).contains(&headway_m);
            self.failing = self.fails_m.iter().any(within);
        }
        self.calls += 1;
        if self.failing && self.calls == 4 {
            return Err(Fault::error("no answer"));
        }
        let careful = self
            .brakes
            .is_some_and(|(runs, first)| first <= (self.resets - 1) % runs);
        Ok(Command::accelerate(if careful { -6.0 } else { 0.0 }))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
