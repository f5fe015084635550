//! Test of a program against the ego protocol.

use std::time::{Duration, Instant};

use serde::Serialize;

use super::pool::Talk;
use super::{Hello, Process};
use crate::ego::{Briefing, Command, Fault, Own, Percept, Phase, Seen, SeenLight};

/// Samples of each tested episode.
const SAMPLES: usize = 200;
/// Time between two samples.
const SAMPLE_S: f64 = 0.05;
/// Time without questions in which a program must stay silent.
const SILENCE: Duration = Duration::from_millis(100);
/// Grace period for the end of a program. Controllers grant less.
const GRACE: Duration = Duration::from_secs(2);
/// Answer time beyond which campaigns become slow.
const SLOW: Duration = Duration::from_millis(5);

/// Result of a test against the protocol.
#[derive(Clone, Debug, Serialize)]
pub struct Exercise {
    /// Hello of the program, if it came so far.
    pub hello: Option<Hello>,
    /// Findings in order. Requirements that could not be tested are missing.
    pub findings: Vec<Finding>,
    /// True if equal episodes got equal commands.
    ///
    /// Compared within the same program and with a fresh start of it. `None` if
    /// the test ended before.
    pub deterministic: Option<bool>,
    /// Steps per second, including answers.
    pub steps_per_s: Option<f64>,
    /// Fault that ended the test early.
    pub fault: Option<Fault>,
}

impl Exercise {
    /// Returns whether the program meets every tested requirement.
    pub fn passed(&self) -> bool {
        self.fault.is_none() && self.findings.iter().all(|found| found.passed)
    }

    fn find(&mut self, what: &str, passed: bool, note: impl Into<String>) {
        self.findings.push(Finding {
            what: what.to_owned(),
            passed,
            note: note.into(),
        });
    }
}

/// A requirement with its result.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The requirement.
    pub what: String,
    /// True if it was met.
    pub passed: bool,
    /// Observation, or empty.
    pub note: String,
}

/// Starts a program and runs some episodes that need no plant.
///
/// The program must have been [allowed](Process::allow).
pub fn exercise(process: &Process) -> Exercise {
    let mut done = Exercise {
        hello: None,
        findings: Vec::new(),
        deterministic: None,
        steps_per_s: None,
        fault: None,
    };
    if let Err(fault) = run(process, &mut done) {
        done.fault = Some(fault);
    }
    done
}

fn run(process: &Process, done: &mut Exercise) -> Result<(), Fault> {
    let timeout = process.timeout();
    let mut talk = process.talk()?;
    let hello = talk.hello.clone();
    done.find("starts and says hello", true, hello.name.clone());
    done.hello = Some(hello);

    let briefing = Briefing {
        sample_s: SAMPLE_S,
        speed_limit_mps: Some(30.0),
        ..Briefing::default()
    };
    let clock = Instant::now();
    let first = episode(&mut talk, (7, &briefing), SAMPLES, timeout, &follow)?;
    done.steps_per_s = Some(SAMPLES as f64 / clock.elapsed().as_secs_f64());
    done.find("answers every question, with its number", true, "");
    commands_are_plausible(done, &first);

    // Not finished on purpose: the next reset interrupts this episode, as a
    // contact does.
    episode(&mut talk, (8, &briefing), SAMPLES / 4, timeout, &follow)?;
    done.find("begins anew in the middle of an episode", true, "");
    let again = episode(&mut talk, (7, &briefing), SAMPLES, timeout, &follow)?;
    is_repeatable(done, &first, &again);

    episode(&mut talk, (9, &briefing), SAMPLES / 4, timeout, &|_, _| {
        (Vec::new(), Vec::new())
    })?;
    done.find("drives on an empty road", true, "");
    episode(&mut talk, (9, &briefing), SAMPLES / 4, timeout, &crowd)?;
    done.find("drives among several others and a light", true, "");

    let slowest = first.iter().map(|(_, took)| *took).max();
    let slowest = slowest.unwrap_or_default();
    let note = format!(
        "slowest answer {:.1} ms, {:.0} steps/s",
        1e3 * slowest.as_secs_f64(),
        done.steps_per_s.unwrap_or(0.0)
    );
    let note = if slowest < SLOW {
        note
    } else {
        format!("{note}: campaigns will be slow")
    };
    done.find("answers in time", true, note);
    let silent = talk.is_silent(SILENCE);
    let note = if silent {
        ""
    } else {
        "one answer to each question, and prints for debugging go to stderr"
    };
    done.find("says nothing that it is not asked", silent, note);
    // A second start finds state that survives `reset`, such as files or
    // caches.
    let mut anew = process.talk()?;
    let fresh = episode(&mut anew, (7, &briefing), SAMPLES, timeout, &follow)?;
    drop(anew);
    is_deterministic(done, &first, [&again, &fresh]);
    let ended = talk.close(GRACE);
    let note = if ended {
        ""
    } else {
        "it was still running 2 s later, and killed: end when stdin does, or at `close`"
    };
    done.find("ends when it is told to", ended, note);
    Ok(())
}

/// All other agents and lights at an instant.
type Surroundings = (Vec<Seen>, Vec<SeenLight>);

/// Runs an episode in which the ego moves as it commands.
///
/// Returns the commands and the time that each took.
fn episode(
    talk: &mut Talk,
    (seed, briefing): (u64, &Briefing),
    samples: usize,
    timeout: Duration,
    around: &dyn Fn(f64, f64) -> Surroundings,
) -> Result<Vec<(Command, Duration)>, Fault> {
    talk.reset(seed, briefing, timeout)?;
    let mut own = Own {
        speed_mps: 20.0,
        length_m: 4.5,
        width_m: 1.8,
        ..Own::default()
    };
    let mut commands = Vec::with_capacity(samples);
    for sample in 0..samples {
        let time_s = sample as f64 * SAMPLE_S;
        let (others, lights) = around(time_s, own.s_m);
        let percept = Percept {
            time_s,
            sample_s: SAMPLE_S,
            own,
            others,
            lights,
        };
        let clock = Instant::now();
        let command = talk.step(&percept, timeout)?;
        commands.push((command, clock.elapsed()));
        // A crude integration suffices: the test only needs time to advance.
        let accel_mps2 = if command.accel_mps2.is_finite() {
            command.accel_mps2.clamp(-10.0, 10.0)
        } else {
            0.0
        };
        own.accel_mps2 = accel_mps2;
        own.speed_mps = (own.speed_mps + accel_mps2 * SAMPLE_S).max(0.0);
        own.s_m += own.speed_mps * SAMPLE_S;
    }
    Ok(commands)
}

fn car(name: &str, headway_m: f64, lateral_m: f64, speed_mps: f64) -> Seen {
    Seen {
        name: name.to_owned(),
        headway_m,
        lateral_m,
        speed_mps,
        x_m: headway_m,
        y_m: lateral_m,
        vx_mps: speed_mps,
        length_m: 4.5,
        width_m: 1.8,
        ..Seen::default()
    }
}

/// Returns a leader that brakes from 20 m/s to a stop, initially 40 m ahead.
fn follow(time_s: f64, own_s_m: f64) -> Surroundings {
    let braking_s = time_s.min(10.0);
    let s_m = 40.0 + 20.0 * braking_s - braking_s * braking_s;
    let speed_mps = 20.0 - 2.0 * braking_s;
    let leader = car("leader", s_m - own_s_m, 0.0, speed_mps);
    (vec![leader], Vec::new())
}

fn crowd(time_s: f64, own_s_m: f64) -> Surroundings {
    let others = [(60.0, 0.0), (-20.0, 0.0), (10.0, 3.5), (-5.0, -3.5)];
    let others = others.iter().enumerate();
    let others = others.map(|(i, &(ahead_m, lateral_m))| {
        let s_m = ahead_m + 20.0 * time_s;
        car(&format!("car{i}"), s_m - own_s_m, lateral_m, 20.0)
    });
    let light = SeenLight {
        name: "light".to_owned(),
        line_m: 120.0 - own_s_m,
        phase: if time_s < 1.0 {
            Phase::Green
        } else {
            Phase::Yellow
        },
        phase_s: time_s % 1.0,
    };
    (others.collect(), vec![light])
}

fn commands_are_plausible(done: &mut Exercise, commands: &[(Command, Duration)]) {
    let odd = commands.iter().find_map(|(command, _)| command.flaw());
    let note = odd.as_ref().map_or(String::new(), |fault| {
        format!("{}: {fault}", fault.kind.word())
    });
    done.find("commands what a car can do", odd.is_none(), note);
}

/// Returns the first sample at which two episodes differ.
fn differing(first: &[(Command, Duration)], again: &[(Command, Duration)]) -> Option<usize> {
    let mut pairs = first.iter().zip(again);
    pairs.position(|((a, _), (b, _))| a != b)
}

/// Records whether equal seeds give equal commands. Not a requirement.
///
/// An ego that is not repeatable can be tested, but needs repeats.
fn is_repeatable(
    done: &mut Exercise,
    first: &[(Command, Duration)],
    again: &[(Command, Duration)],
) {
    let note = match differing(first, again) {
        None => "and answers alike when it is given the same seed".to_owned(),
        Some(sample) => format!(
            "but answers differ from sample {sample} on with the same seed: give the world \
             `repeats: 5`, or seed all its randomness from `reset`"
        ),
    };
    done.find("begins anew when it is reset", true, note);
}

/// Records whether crashes of this ego can be minimized and labelled.
///
/// Both need to run the ego again with equal results.
fn is_deterministic(
    done: &mut Exercise,
    first: &[(Command, Duration)],
    others: [&[(Command, Duration)]; 2],
) {
    let differs = others.map(|other| differing(first, other));
    let note = match differs {
        [None, None] => "and commands the same, as it does when it is started anew".to_owned(),
        [Some(sample), _] => format!("and is not deterministic: diverges from sample {sample} on"),
        [None, Some(sample)] => {
            format!("and diverges from sample {sample} on when it is started anew")
        }
    };
    done.deterministic = Some(differs == [None, None]);
    done.find("runs again with one seed", true, note);
}
