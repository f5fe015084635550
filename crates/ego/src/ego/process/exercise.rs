//! Test of a program against the ego protocol.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::pool::Talk;
use super::repeatability::{PAUSES, Pace, TranscriptComparison, by_pace};
use super::transcript::Transcript;
use super::unrepeatable::Cause;
use super::{Hello, Process};
use crate::ego::{Briefing, Controller, Fault, Own, Percept, Phase, Seen, SeenLight};

/// Samples of an episode in which the answers are timed.
const SAMPLES: usize = 200;
/// Samples of a short episode.
const SHORT: usize = 50;
/// Time between two samples.
const SAMPLE_S: f64 = 0.05;
/// Time without questions in which a program must stay silent.
const SILENCE: Duration = Duration::from_millis(100);
/// Grace period for the end of a program. Controllers grant less.
const GRACE: Duration = Duration::from_secs(2);
/// Answer time beyond which campaigns become slow.
const SLOW: Duration = Duration::from_millis(5);
/// Fewest episodes that are played again in programs started anew.
const LEAST: usize = 6;
/// Time after which only the fewest episodes are played again.
const PATIENCE: Duration = Duration::from_secs(15);

/// Episodes after those that test the messages: their samples and what is around the ego.
///
/// Hard ones leave their traces in a program that keeps state. The easy ones after them
/// show it, and there are enough for programs that count episodes.
const EPISODES: &[(usize, Around)] = &[
    (SAMPLES, hard_stop),
    (SHORT, follow),
    (3 * SHORT, near_miss),
    (SHORT, follow),
    (3 * SHORT, cut_in),
    (SAMPLES, standing),
    (SHORT, empty),
    (800, follow),
    (3 * SHORT, touch),
    (SHORT, follow),
    (SHORT, hard_stop),
    (SHORT, follow),
    (SHORT, crowd),
    (SHORT, follow),
    (SHORT, cut_in),
    (SHORT, follow),
    (SAMPLES, follow),
    (SAMPLES, hard_stop),
];

/// Result of a test against the protocol.
#[derive(Clone, Debug, Serialize)]
pub struct Exercise {
    /// Hello of the program, if it came so far.
    pub hello: Option<Hello>,
    /// Findings in order. Requirements that could not be tested are missing.
    pub findings: Vec<Finding>,
    /// True if equal episodes got equal commands.
    ///
    /// Compared with programs that were started anew. `None` if the test ended before.
    pub deterministic: Option<bool>,
    /// Reason why equal episodes got unequal commands, if they did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unrepeatable: Option<Fault>,
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
        unrepeatable: None,
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
    let declared = hello.parameters.clone();
    done.hello = Some(hello);

    let briefing = Briefing {
        sample_s: SAMPLE_S,
        speed_limit_mps: Some(30.0),
        ..Briefing::default()
    };
    let mut all = Vec::new();
    let mut play = |talk: &mut Talk, seed: u64, samples: usize, around: Around| {
        let played = episode(talk, seed, &briefing, samples, timeout, around)?;
        let number = all.len() as u64;
        let transcript = Transcript {
            number,
            ..played.transcript
        };
        all.push(Arc::new(transcript));
        Ok::<Duration, Fault>(played.slowest)
    };
    // Only the first episode is timed, because later ones differ in length and traffic.
    let clock = Instant::now();
    let slowest = play(&mut talk, 7, SAMPLES, follow)?;
    done.steps_per_s = Some(SAMPLES as f64 / clock.elapsed().as_secs_f64());
    done.find("answers every question, with its number", true, "");

    // Not finished on purpose: the next reset interrupts this episode, as a
    // contact does.
    play(&mut talk, 8, SHORT, follow)?;
    done.find("begins anew in the middle of an episode", true, "");
    play(&mut talk, 7, SAMPLES, follow)?;
    play(&mut talk, 9, SHORT, empty)?;
    done.find("drives on an empty road", true, "");
    play(&mut talk, 9, SHORT, crowd)?;
    done.find("drives among several others and a light", true, "");
    for (seed, (samples, around)) in (10..).zip(EPISODES) {
        play(&mut talk, seed, *samples, *around)?;
    }
    done.find("brakes hard, and goes on after a contact", true, "");
    let usual = all.first().map(|first| first.commands());
    let mut idle = Vec::new();
    for one in &declared {
        let mut is_idle = true;
        for value in [one.lo, one.hi] {
            let setting = Briefing {
                parameters: BTreeMap::from([(one.name.clone(), value)]),
                ..briefing.clone()
            };
            let played = episode(&mut talk, 7, &setting, SAMPLES, timeout, follow)?;
            is_idle &= Some(played.transcript.commands()) == usual;
            let number = all.len() as u64;
            all.push(Arc::new(Transcript {
                number,
                ..played.transcript
            }));
        }
        if is_idle {
            idle.push(one.name.as_str());
        }
    }
    takes_parameters(done, declared.len(), &idle);
    commands_are_plausible(done, &all);

    let pace = format!(
        "slowest answer {:.1} ms, {:.0} steps/s",
        1e3 * slowest.as_secs_f64(),
        done.steps_per_s.unwrap_or(0.0)
    );
    let note = if slowest < SLOW {
        pace
    } else {
        format!("{pace}: campaigns will be slow")
    };
    done.find("answers in time", true, note);
    // Last, because a line that was not asked for would answer the next question.
    let silent = talk.is_silent(SILENCE);
    let note = if silent {
        ""
    } else {
        "one answer to each question, and prints for debugging go to stderr"
    };
    done.find("says nothing that it is not asked", silent, note);
    is_repeatable(done, process, &all)?;
    let ended = talk.close(GRACE);
    let note = if ended {
        ""
    } else {
        "it was still running 2 s later, and killed: end when stdin does, or at `close`"
    };
    done.find("ends when it is told to", ended, note);
    Ok(())
}

/// Records that a program drives with both ends of each parameter.
fn takes_parameters(done: &mut Exercise, count: usize, idle: &[&str]) {
    let note = if idle.is_empty() {
        format!("{count} parameters, each at both ends")
    } else {
        format!(
            "no other command behind a braking car with: {}",
            idle.join(", ")
        )
    };
    // Most programs declare none, and their list stays as it is.
    if count > 0 {
        done.find("drives with the values of its parameters", true, note);
    }
}

/// All other agents and lights at an instant.
type Surroundings = (Vec<Seen>, Vec<SeenLight>);

/// Surroundings at a time and a state of the ego.
type Around = fn(f64, &Own) -> Surroundings;

/// An episode with the time of its slowest answer.
struct Played {
    transcript: Transcript,
    slowest: Duration,
}

/// Runs an episode in which the ego moves as it commands.
fn episode(
    talk: &mut Talk,
    seed: u64,
    briefing: &Briefing,
    samples: usize,
    timeout: Duration,
    around: Around,
) -> Result<Played, Fault> {
    talk.reset(seed, briefing, timeout)?;
    let mut own = Own {
        speed_mps: 20.0,
        length_m: 4.5,
        width_m: 1.8,
        ..Own::default()
    };
    let mut steps = Vec::with_capacity(samples);
    let mut slowest = Duration::ZERO;
    for sample in 0..samples {
        let time_s = sample as f64 * SAMPLE_S;
        let (others, lights) = around(time_s, &own);
        let percept = Percept {
            time_s,
            sample_s: SAMPLE_S,
            own,
            others,
            lights,
        };
        let clock = Instant::now();
        let command = talk.step(&percept, timeout)?;
        slowest = slowest.max(clock.elapsed());
        steps.push((percept, command));
        // A crude integration suffices: the test only needs time to advance.
        let accel_mps2 = if command.accel_mps2.is_finite() {
            command.accel_mps2.clamp(-10.0, 10.0)
        } else {
            0.0
        };
        own.accel_mps2 = accel_mps2;
        own.speed_mps = (own.speed_mps + accel_mps2 * SAMPLE_S).max(0.0);
        // The own speed is updated first, which keeps the integration stable.
        own.s_m += own.speed_mps * SAMPLE_S;
    }
    let transcript = Transcript {
        seed,
        briefing: Some(briefing.clone()),
        steps,
        ..Transcript::default()
    };
    Ok(Played {
        transcript,
        slowest,
    })
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

/// Returns a leader that brakes from 20 m/s to a stop, initially `ahead_m` ahead.
fn stopping(time_s: f64, own: &Own, ahead_m: f64, braking_mps2: f64) -> Surroundings {
    // A leader that stands stays where it stopped.
    let braking_s = time_s.min(20.0 / braking_mps2);
    let speed_mps = 20.0 - braking_mps2 * braking_s;
    let s_m = ahead_m + (20.0 + speed_mps) / 2.0 * braking_s;
    (
        vec![car("leader", s_m - own.s_m, 0.0, speed_mps)],
        Vec::new(),
    )
}

fn follow(time_s: f64, own: &Own) -> Surroundings {
    stopping(time_s, own, 40.0, 2.0)
}

fn hard_stop(time_s: f64, own: &Own) -> Surroundings {
    stopping(time_s, own, 25.0, 8.0)
}

/// Returns a leader that comes as near as `least_m` and leaves again, whatever the ego does.
fn approaching(time_s: f64, own: &Own, least_m: f64) -> Surroundings {
    // The gap is least after 4 s, and opens again as fast as it closed.
    let away_s = (time_s - 4.0).abs();
    let gap_m = least_m + 6.0 * away_s.min(3.5);
    let closing_mps = if time_s < 4.0 { 6.0 } else { -6.0 };
    let leader = car(
        "leader",
        4.5 + gap_m,
        0.0,
        (own.speed_mps - closing_mps).max(0.0),
    );
    (vec![leader], Vec::new())
}

fn near_miss(time_s: f64, own: &Own) -> Surroundings {
    approaching(time_s, own, 0.3)
}

fn touch(time_s: f64, own: &Own) -> Surroundings {
    approaching(time_s, own, -0.5)
}

/// Returns a slower car that cuts in from the left.
fn cut_in(time_s: f64, own: &Own) -> Surroundings {
    let s_m = 14.0 + 16.0 * time_s;
    let lateral_m = (3.5 - 2.0 * (time_s - 1.0).max(0.0)).max(0.0);
    (
        vec![car("cutter", s_m - own.s_m, lateral_m, 16.0)],
        Vec::new(),
    )
}

fn standing(_: f64, own: &Own) -> Surroundings {
    (vec![car("obstacle", 60.0 - own.s_m, 0.0, 0.0)], Vec::new())
}

fn empty(_: f64, _: &Own) -> Surroundings {
    (Vec::new(), Vec::new())
}

fn crowd(time_s: f64, own: &Own) -> Surroundings {
    let own_s_m = own.s_m;
    // Ahead, behind, and in both other lanes.
    let others = [(60.0, 0.0), (-20.0, 0.0), (10.0, 3.5), (-5.0, -3.5)]
        .iter()
        .enumerate()
        .map(|(i, &(ahead_m, lateral_m))| {
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

fn commands_are_plausible(done: &mut Exercise, all: &[Arc<Transcript>]) {
    let commands = all.iter().flat_map(|transcript| &transcript.steps);
    let odd = commands.filter_map(|(_, command)| command.flaw()).next();
    let note = odd.as_ref().map_or(String::new(), |fault| {
        format!("{}: {fault}", fault.kind.word())
    });
    done.find("commands what a car can do", odd.is_none(), note);
}

/// Records whether the commands depend on nothing but the episode.
///
/// State that outlives `reset`, and a clock, fail the test. A random ego can be tested,
/// but needs repeats.
fn is_repeatable(
    done: &mut Exercise,
    process: &Process,
    all: &[Arc<Transcript>],
) -> Result<(), Fault> {
    // Programs of their own, so that no comparison shares state with the tested one.
    let make = || Box::new(process.apart().controller()) as Box<dyn Controller>;
    let began = Instant::now();
    let mut comparison = TranscriptComparison::default();
    // The latest episodes have the longest history.
    let sample: Vec<Arc<Transcript>> = all.iter().rev().cloned().collect();
    // The slow replay mostly sleeps, so it runs beside the comparison.
    let slow = thread::scope(|scope| {
        let slow = scope.spawn(|| all.first()?.replay(&mut *make(), Pace::Slow(PAUSES)).ok());
        for batch in sample.chunks(rayon::current_num_threads().max(2)) {
            // One difference suffices, and slow programs would take minutes.
            if !comparison.is_equal()
                || (comparison.compared >= LEAST && began.elapsed() > PATIENCE)
            {
                break;
            }
            comparison.compare(batch, &make);
        }
        slow.join().ok().flatten()
    });
    let compared = comparison.compared;
    let check = comparison.explained(&make, PAUSES);
    if let Some(fault) = check.failed {
        return Err(fault);
    }
    // Asked only if the pace is the last possible cause.
    let slowly = || by_pace(all.first()?, slow.as_ref()?, &make, PAUSES);
    let found = check.found.or_else(slowly);
    let cause = found.as_ref().map(|found| found.cause);
    let fault = found.map(|found| found.fault(&process.command.join(" "), None));
    let said = fault
        .as_ref()
        .map_or(String::new(), |it| it.message.clone());
    let keeps = matches!(cause, Some(Cause::KeptState | Cause::KeptOutside));
    let same_commands = format!(
        "{compared} episodes, of which some are hard, had the same commands in programs \
         started anew"
    );
    let notes = match cause {
        Some(_) if keeps => [said, String::new()],
        Some(_) => [String::new(), said],
        None => [same_commands, "also when it is asked slowly".to_owned()],
    };
    let [of_reset, of_seed] = notes;
    done.find("begins anew when it is reset", !keeps, of_reset);
    if !keeps {
        let is_clock = cause == Some(Cause::Clock);
        done.find("runs again with one seed", !is_clock, of_seed);
    }
    done.deterministic = Some(fault.is_none());
    done.unrepeatable = fault;
    Ok(())
}
