//! Conversations with started programs, and the pool of waiting programs.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::super::{Briefing, Command, Fault, FaultKind, Percept};
use super::declared::{self, DeclaredParameter};
#[cfg(unix)]
use super::program::{Program, shown};
use super::protocol::{
    AskReset, AskStep, DOCUMENT, EgoMessage, Empty, Greeting, Hello, HelloAnswer, Numbered,
    PROTOCOL, ReadyAnswer, Reset, StepAnswer,
};
use super::transcript::Transcripts;
#[cfg(not(unix))]
use super::unsupported_platform::{UnsupportedProgram as Program, shown};

/// Grace period for the end of a program after its farewell.
const GRACE: Duration = Duration::from_millis(300);
/// Grace period for the end of a program that was started to compare its commands.
const GRACE_APART: Duration = Duration::from_millis(50);
/// Timeouts within which a started program says hello. It may load a model first.
const HELLO_TIMEOUTS: u32 = 3;

/// A started program that has said hello.
pub(super) struct Talk {
    program: Program,
    pub(super) hello: Hello,
    /// Number of the latest question.
    id: u64,
    question: Vec<u8>,
    answer: Vec<u8>,
    /// True after a fault: the program is no longer addressed.
    pub(super) broken: bool,
    /// Grace period for its end.
    pub(super) grace: Duration,
}

impl Talk {
    /// Starts a program and exchanges hellos.
    pub(super) fn start(command: &[String], timeout: Duration) -> Result<Talk, Fault> {
        let mut talk = Talk {
            program: Program::start(command)?,
            hello: Hello {
                protocol: PROTOCOL,
                name: String::new(),
                capabilities: Vec::new(),
                parameters: Vec::new(),
                program: None,
            },
            id: 0,
            question: Vec::new(),
            answer: Vec::new(),
            broken: false,
            grace: GRACE,
        };
        let greeting = Greeting {
            protocol: PROTOCOL,
            program: concat!("brakecheck ", env!("CARGO_PKG_VERSION")),
        };
        let occasion = || "asked for its hello".to_owned();
        // A program loads its libraries and weights before it says hello.
        let most = timeout.saturating_mul(HELLO_TIMEOUTS);
        let answer: Result<HelloAnswer, Fault> =
            talk.ask(&EgoMessage::Hello(greeting), most, &occasion);
        let HelloAnswer { hello } = answer.map_err(|fault| {
            talk.broken = true;
            match fault.kind {
                FaultKind::Timeout => Fault {
                    message: format!(
                        "`{}` did not say hello within {} s of its start, which are \
                         {HELLO_TIMEOUTS} times its `timeout_s`; if it loads for longer, raise \
                         `timeout_s` in its `Process(…)`, and otherwise flush its output after \
                         every line",
                        talk.program.name(),
                        most.as_secs_f64()
                    ),
                    ..fault
                },
                FaultKind::Protocol => Fault {
                    message: format!(
                        "{}; a program begins by saying hello: see {DOCUMENT}",
                        fault.message
                    ),
                    ..fault
                },
                _ => fault,
            }
        })?;
        // A program such as `cat` returns the greeting, which would pass as a
        // hello.
        if hello.program.is_some() {
            talk.broken = true;
            return Err(talk.protocol("repeats what it is told instead of answering"));
        }
        // Checked by the number and not by the fields, which a later version may keep.
        if hello.protocol != PROTOCOL {
            talk.broken = true;
            return Err(talk.protocol(format!(
                "speaks version {} of the ego protocol, not {PROTOCOL}: see {DOCUMENT}",
                hello.protocol
            )));
        }
        if let Some(flaw) = declared::flaw(&hello.parameters) {
            talk.broken = true;
            return Err(talk.protocol(format!("{flaw}: see {DOCUMENT}")));
        }
        talk.hello = hello;
        Ok(talk)
    }

    /// Begins an episode.
    pub(super) fn reset(
        &mut self,
        seed: u64,
        briefing: &Briefing,
        timeout: Duration,
    ) -> Result<(), Fault> {
        let ready = self.try_reset(seed, briefing, timeout);
        self.noting_stderr(ready)
    }

    /// Requests the command of a sample.
    pub(super) fn step(&mut self, percept: &Percept, timeout: Duration) -> Result<Command, Fault> {
        let command = self.try_step(percept, timeout);
        self.noting_stderr(command)
    }

    /// Adds the program's stderr to a fault, wherever it was detected.
    fn noting_stderr<T>(&mut self, result: Result<T, Fault>) -> Result<T, Fault> {
        result.map_err(|fault| {
            if fault.stderr.is_empty() {
                fault.with_stderr(self.program.stderr())
            } else {
                fault
            }
        })
    }

    fn try_reset(
        &mut self,
        seed: u64,
        briefing: &Briefing,
        timeout: Duration,
    ) -> Result<(), Fault> {
        self.id += 1;
        // Out of the way of the borrow by the question.
        let declared = std::mem::take(&mut self.hello.parameters);
        let result = self.ask_reset(seed, briefing, &declared, timeout);
        self.hello.parameters = declared;
        let answer = result?;
        let occasion = || "asked to reset".to_owned();
        self.same_number(answer.id, &occasion)?;
        match (answer.error, answer.ready) {
            (Some(error), _) => Err(self.reported(&error, &occasion)),
            (None, true) => Ok(()),
            (None, false) => Err(self.protocol(format!(
                "answered `{}` when {}: `\"ready\": true` is missing",
                shown(&self.answer),
                occasion()
            ))),
        }
    }

    fn ask_reset(
        &mut self,
        seed: u64,
        briefing: &Briefing,
        parameters: &[DeclaredParameter],
        timeout: Duration,
    ) -> Result<ReadyAnswer, Fault> {
        let name = self.program.name().to_owned();
        let question = Numbered {
            id: self.id,
            question: AskReset {
                reset: Reset {
                    seed,
                    briefing,
                    parameters: declared::values(&name, parameters, &briefing.parameters)?,
                },
            },
        };
        self.ask(&question, timeout, &|| "asked to reset".to_owned())
    }

    fn try_step(&mut self, percept: &Percept, timeout: Duration) -> Result<Command, Fault> {
        self.id += 1;
        let question = Numbered {
            id: self.id,
            question: AskStep { step: percept },
        };
        let occasion = || format!("asked for a command at {:.3} s", percept.time_s);
        let answer: StepAnswer = self.ask(&question, timeout, &occasion)?;
        self.same_number(answer.id, &occasion)?;
        match (answer.error, answer.accel_mps2) {
            (Some(error), _) => Err(self.reported(&error, &occasion)),
            (None, Some(accel_mps2)) => Ok(Command {
                accel_mps2,
                lateral_mps: answer.lateral_mps,
            }),
            (None, None) => Err(self.protocol(format!(
                "answered `{}` when {}: `accel_mps2` is missing",
                shown(&self.answer),
                occasion()
            ))),
        }
    }

    /// Asks the program to end and returns whether it did in time.
    pub(super) fn close(&mut self, grace: Duration) -> bool {
        // A closed program must not be closed again when it is dropped.
        self.broken = true;
        let farewell = serde_json::to_vec(&EgoMessage::Close(Empty {})).unwrap_or_default();
        self.program.close(&[&farewell[..], b"\n"].concat(), grace)
    }

    /// Returns whether the program stays silent while it is asked nothing.
    pub(super) fn is_silent(&mut self, most: Duration) -> bool {
        self.program.is_silent(most)
    }

    fn ask<Q: Serialize, A: DeserializeOwned>(
        &mut self,
        question: &Q,
        timeout: Duration,
        occasion: &dyn Fn() -> String,
    ) -> Result<A, Fault> {
        // One buffer per program, since a question is written for every
        // sample.
        self.question.clear();
        serde_json::to_writer(&mut self.question, question).map_err(|error| {
            Fault::error(format!("the question cannot be written as JSON: {error}"))
        })?;
        // The line end flushes a program that reads by lines.
        self.question.push(b'\n');
        let (program, answer) = (&mut self.program, &mut self.answer);
        program.ask(&self.question, timeout, occasion, answer)?;
        // serde accepts a list for an object, with its values in the order of the keys.
        let begin = self.answer.iter().find(|byte| !byte.is_ascii_whitespace());
        if begin == Some(&b'[') {
            return Err(self.protocol(format!(
                "answered `{}` when {}: an answer is an object, `{{…}}`",
                shown(&self.answer),
                occasion()
            )));
        }
        serde_json::from_slice(&self.answer).map_err(|error| {
            self.protocol(format!(
                "answered `{}` when {}: {error}",
                shown(&self.answer),
                occasion()
            ))
        })
    }

    // A program that answers late or twice would otherwise be a question behind
    // for the rest of the episode.
    fn same_number(&self, id: u64, occasion: &dyn Fn() -> String) -> Result<(), Fault> {
        if id == self.id {
            return Ok(());
        }
        Err(self.protocol(format!(
            "answered question {id} when question {} was open ({}): one answer to each \
             question, with its `id`",
            self.id,
            occasion()
        )))
    }

    fn reported(&self, error: &str, occasion: &dyn Fn() -> String) -> Fault {
        // Foreign text of any length, shortened for messages.
        let shown: String = error.chars().take(200).collect();
        let name = self.program.name();
        Fault::error(format!(
            "`{name}` reported an error when {}: {shown}",
            occasion()
        ))
    }

    fn protocol(&self, what: impl std::fmt::Display) -> Fault {
        let name = self.program.name();
        Fault::new(FaultKind::Protocol, format!("`{name}` {what}"))
    }
}

/// Cost of a program so far, in all episodes of a command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProgramCost {
    /// Number of times that it was started.
    pub starts: u64,
    /// Episodes.
    pub episodes: u64,
    /// Commands that it gave, one per sample.
    pub steps: u64,
    /// Time of waiting for these commands, in seconds, added up over all workers.
    pub waited_s: f64,
}

/// Programs that wait for an episode, and their cost so far.
#[derive(Clone, Default)]
pub(super) struct Pool(Arc<PoolState>);

#[derive(Default)]
struct PoolState {
    waiting: Mutex<Vec<Talk>>,
    starts: AtomicU64,
    episodes: AtomicU64,
    steps: AtomicU64,
    waited_ns: AtomicU64,
    transcripts: Transcripts,
    /// Fault of a program that never said hello in time, which it would not do again.
    silent: Mutex<Option<Fault>>,
    /// Grace period for the end of its programs, if not the usual one.
    grace: Option<Duration>,
}

impl Pool {
    /// Creates the pool of a program that is started for one episode only.
    pub(super) fn apart() -> Pool {
        Pool(Arc::new(PoolState {
            grace: Some(GRACE_APART),
            ..PoolState::default()
        }))
    }

    pub(super) fn transcripts(&self) -> &Transcripts {
        &self.0.transcripts
    }

    /// Returns the cost so far.
    pub(super) fn cost(&self) -> ProgramCost {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        ProgramCost {
            starts: count(&self.0.starts),
            episodes: count(&self.0.episodes),
            steps: count(&self.0.steps),
            waited_s: 1e-9 * count(&self.0.waited_ns) as f64,
        }
    }

    pub(super) fn is(&self, other: &Pool) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    pub(super) fn count_episode(&self) {
        self.0.episodes.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn count_step(&self, waited: Duration) {
        // Whole nanoseconds, because threads add them in any order.
        let waited_ns = u64::try_from(waited.as_nanos()).unwrap_or(u64::MAX);
        self.0.steps.fetch_add(1, Ordering::Relaxed);
        self.0.waited_ns.fetch_add(waited_ns, Ordering::Relaxed);
    }

    /// Returns a waiting program or starts a new one.
    pub(super) fn take(&self, command: &[String], timeout: Duration) -> Result<Talk, Fault> {
        // The lock is released before a start, which may take as long as the
        // timeout.
        let waiting = self.lock().pop();
        match waiting {
            Some(talk) => Ok(talk),
            None => self.start(command, timeout),
        }
    }

    fn start(&self, command: &[String], timeout: Duration) -> Result<Talk, Fault> {
        let silent = || self.0.silent.lock().unwrap_or_else(PoisonError::into_inner);
        // It is waited for once, and not again in every episode.
        if let Some(fault) = &*silent() {
            return Err(fault.clone());
        }
        // Only a program that never said hello is given up. A later delay may be the
        // machine's.
        let is_first = self.0.starts.fetch_add(1, Ordering::Relaxed) == 0;
        let mut started = Talk::start(command, timeout);
        if let (Ok(talk), Some(grace)) = (&mut started, self.0.grace) {
            talk.grace = grace;
        }
        if let Err(fault) = &started
            && is_first
            && fault.kind == FaultKind::Timeout
        {
            *silent() = Some(fault.clone());
        }
        started
    }

    /// Keeps a program for the next episode.
    pub(super) fn give_back(&self, talk: Talk) {
        self.lock().push(talk);
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Talk>> {
        // Push and pop leave no half-changed list, so a poisoned lock is usable.
        let waiting = self.0.waiting.lock();
        waiting.unwrap_or_else(PoisonError::into_inner)
    }
}

/// Equality ignores the pool: waiting programs do not identify an ego.
impl PartialEq for Pool {
    // Worlds are compared by their data, to which waiting programs do not belong.
    fn eq(&self, _other: &Pool) -> bool {
        true
    }
}

impl fmt::Debug for Pool {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pool")
    }
}

impl Drop for Talk {
    fn drop(&mut self) {
        // A broken program may not read, and its grace period would be wasted.
        if !self.broken {
            self.close(self.grace);
        }
    }
}
