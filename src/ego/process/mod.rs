//! An ego that is another program: ego protocol 1, JSON lines on its pipes.
//!
//! The protocol is written down in `docs/ego-protocol.md`: the program says
//! hello once, is told of the road and the seed when an episode begins, answers
//! one command per sample, and ends when it is told to.
//!
//! A crash, a hang, a flood or an answer that is no command is a [`Fault`]: it
//! makes the episode invalid, never a success of the ado. The program is
//! started anew for the next episode then.
//!
//! Architecture Invariant: nothing that a file names is started without the
//! caller's consent. A [`Process`] read from a file has none until
//! [`Process::allow`] gives it, and consent is never written to a file.

#[cfg(not(unix))]
mod elsewhere;
mod exercise;
mod pool;
#[cfg(unix)]
mod program;
mod protocol;

use std::time::Duration;

use serde::{Deserialize, Serialize};

pub use exercise::{Exercise, Finding, exercise};
pub use protocol::{DOCUMENT, Hello, PROTOCOL};

use super::actuator::written_as;
use super::{
    Actuated, Briefing, Command, Controller, Fault, FaultKind, Parameter, Percept, UnknownParameter,
};
use pool::{Pool, Talk};

/// Longest wait for an answer that can be asked for.
const MAX_TIMEOUT_S: f64 = 86_400.0;
/// Shortest one: below it a machine's own delays look like faults.
const MIN_TIMEOUT_S: f64 = 0.001;

/// A program as the ego, as named in a world file.
#[derive(Clone, Debug, PartialEq)]
pub struct Process {
    /// The program and its arguments, found as a shell would find it.
    pub command: Vec<String>,
    /// Longest wait for an answer; generous, since machines are busy.
    pub timeout_s: f64,
    /// Whether somebody consented to start it; no file can say so.
    allowed: bool,
    /// Started programs that wait for an episode, shared by all clones.
    pool: Pool,
}

#[derive(Serialize, Deserialize)]
#[serde(rename = "Process", deny_unknown_fields)]
struct InFile {
    command: Vec<String>,
    #[serde(default = "default_timeout_s")]
    timeout_s: f64,
    #[serde(default)]
    lag_s: f64,
}

impl From<InFile> for Actuated<Process> {
    fn from(file: InFile) -> Actuated<Process> {
        Actuated {
            controller: Process {
                timeout_s: file.timeout_s,
                ..Process::new(file.command)
            },
            lag_s: file.lag_s,
        }
    }
}

impl From<Actuated<Process>> for InFile {
    fn from(Actuated { controller, lag_s }: Actuated<Process>) -> InFile {
        InFile {
            command: controller.command,
            timeout_s: controller.timeout_s,
            lag_s,
        }
    }
}

written_as!(Process, InFile);

fn default_timeout_s() -> f64 {
    10.0
}

impl Process {
    /// The names of its numeric parameters.
    pub const PARAMETERS: &[&str] = &["timeout_s"];

    /// A program that somebody typed, with the usual timeout.
    ///
    /// Like one read from a file it is not started before [`Process::allow`].
    pub fn new(command: impl IntoIterator<Item = impl Into<String>>) -> Process {
        Process {
            command: command.into_iter().map(Into::into).collect(),
            timeout_s: default_timeout_s(),
            allowed: false,
            pool: Pool::default(),
        }
    }

    /// Gives or takes back the consent to start it.
    pub fn allow(&mut self, allowed: bool) {
        self.allowed = allowed;
    }

    /// Whether somebody consented to start it.
    pub fn is_allowed(&self) -> bool {
        self.allowed
    }

    /// A controller that starts the program when it is first asked.
    pub fn controller(&self) -> ProcessController {
        ProcessController {
            spec: self.clone(),
            briefing: Briefing::default(),
            talk: None,
            seed: 0,
            fresh: false,
        }
    }

    /// What makes it unusable whatever the program is: what, and the cure.
    pub fn flaw(&self) -> Option<(&'static str, String, &'static str)> {
        if self.command.first().is_none_or(String::is_empty) {
            return Some((
                "command",
                "no program is named".to_owned(),
                "write the program and its arguments, such as [\"python3\", \"ego.py\"]",
            ));
        }
        if !(MIN_TIMEOUT_S..=MAX_TIMEOUT_S).contains(&self.timeout_s) {
            return Some((
                "timeout_s",
                format!("a timeout of {} s", self.timeout_s),
                "0.001 to 86400 s are possible; 10 s are usual",
            ));
        }
        None
    }

    /// Its numeric parameters; what the program does is its own affair.
    pub fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter {
            name: "timeout_s",
            about: "Longest wait for an answer, s.",
            value: self.timeout_s,
            at_least: MIN_TIMEOUT_S,
        }]
    }

    /// Sets one parameter by name.
    ///
    /// # Errors
    /// The name is not `timeout_s`.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
        match name {
            "timeout_s" => self.timeout_s = value,
            _ => {
                return Err(UnknownParameter {
                    name: name.to_owned(),
                    known: Self::PARAMETERS.to_vec(),
                });
            }
        }
        Ok(())
    }

    fn talk(&self) -> Result<Talk, Fault> {
        if !self.allowed {
            return Err(Fault::new(
                FaultKind::CannotStart,
                format!(
                    "`{}` was not started: nobody allowed programs",
                    self.command.join(" ")
                ),
            ));
        }
        self.pool.take(&self.command, self.timeout())
    }

    fn timeout(&self) -> Duration {
        Duration::from_secs_f64(self.timeout_s.clamp(MIN_TIMEOUT_S, MAX_TIMEOUT_S))
    }
}

/// A running program, or one about to be started.
///
/// Between episodes the program waits in a pool that all controllers of one
/// [`Process`] share, so that a worker starts it once, whatever it plays.
pub struct ProcessController {
    spec: Process,
    briefing: Briefing,
    talk: Option<Talk>,
    seed: u64,
    fresh: bool,
}

impl Controller for ProcessController {
    fn brief(&mut self, briefing: &Briefing) {
        self.briefing = briefing.clone();
    }

    fn reset(&mut self, seed: u64) {
        self.seed = seed;
        self.fresh = true;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let answer = self.converse(percept);
        if answer.is_err()
            && let Some(mut talk) = self.talk.take()
        {
            // What misbehaved is ended at once; the next episode gets a new one.
            talk.broken = true;
        }
        answer
    }

    fn finish(&mut self) {
        if let Some(talk) = self.talk.take() {
            self.spec.pool.give_back(talk);
        }
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

impl Drop for ProcessController {
    fn drop(&mut self) {
        self.finish();
    }
}

impl ProcessController {
    fn converse(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let timeout = self.spec.timeout();
        let talk = match &mut self.talk {
            Some(talk) => talk,
            // Invariant: an episode is carried on by the program that began it.
            None if !self.fresh => {
                return Err(Fault::error("the ego was asked after its episode ended"));
            }
            None => self.talk.insert(self.spec.talk()?),
        };
        if self.fresh {
            talk.reset(self.seed, &self.briefing, timeout)?;
            self.fresh = false;
        }
        talk.step(percept, timeout)
    }
}
