//! An ego in a separate program: ego protocol 1, JSON lines on its pipes.
//!
//! `docs/reference/ego-protocol.md` defines the protocol. The program says hello once and
//! receives the road and the seed when an episode begins. It answers a command
//! per sample and ends when it is asked to.
//!
//! A crash, a hang, a flood or an invalid answer is a [`Fault`]. It makes the
//! episode invalid and is never a success of the ado. The program is then
//! started anew for the next episode.
//!
//! Architecture Invariant: nothing that a file names is started without the
//! caller's consent. A [`Process`] read from a file has no consent until
//! [`Process::allow`] gives it, and consent is never written to a file.

mod declared;
mod exercise;
#[cfg(unix)]
mod marks;
mod pool;
#[cfg(unix)]
mod program;
mod protocol;
mod repeatability;
mod transcript;
mod unrepeatable;
#[cfg(not(unix))]
mod unsupported_platform;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use declared::DeclaredParameter;
pub use exercise::{Exercise, Finding, exercise};
pub use protocol::{DOCUMENT, Hello};

use super::actuator::written_as;
use super::{
    Actuated, Briefing, Command, Controller, Fault, FaultKind, Parameter, Percept, UnknownParameter,
};
pub(crate) use pool::ProgramCost;
use pool::{Pool, Talk};
pub use transcript::Transcripts;
pub use transcript::{Maker, Recorder};
pub use unrepeatable::Cause;

/// Longest timeout that a world may set.
const MAX_TIMEOUT_S: f64 = 86_400.0;
/// Shortest timeout. Below it, a machine's own delays look like faults.
const MIN_TIMEOUT_S: f64 = 0.001;

/// Set once the process is asked to stop: a signal of the process, not of an ego.
static STOPPING: AtomicBool = AtomicBool::new(false);

/// Ends all waits for programs that do not answer soon.
pub fn stop_waiting() {
    STOPPING.store(true, Ordering::Relaxed);
}

fn is_stopping() -> bool {
    STOPPING.load(Ordering::Relaxed)
}

/// Most characters of a name in a table.
const MOST_NAME_CHARS: usize = 64;

/// A program as the ego, as named in a world file.
#[derive(Clone, Debug, PartialEq)]
pub struct Process {
    /// The program and its arguments, resolved as in a shell.
    pub command: Vec<String>,
    /// Longest wait for an answer. Choose it generously, since machines are busy.
    pub timeout_s: f64,
    /// Start the program anew for every episode. No state then outlives one.
    pub fresh: bool,
    /// Values of parameters that it declares in its hello. Others have their default.
    pub parameters: BTreeMap<String, f64>,
    /// Consent to start the program, which no file can give.
    allowed: bool,
    /// Started programs that wait for an episode, shared by all clones.
    pool: Pool,
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(rename = "Process", deny_unknown_fields)]
struct ProcessFile {
    /// Program and its arguments.
    command: Vec<String>,
    /// Greatest time of an answer, s.
    #[serde(default = "default_timeout_s")]
    timeout_s: f64,
    /// Starts the program anew for every episode.
    #[serde(default, skip_serializing_if = "is_false")]
    fresh: bool,
    /// Values of parameters that the program declares. Others have their default.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, f64>,
    /// Time constant of the actuator behind the command, s. 0 is none.
    #[serde(default)]
    lag_s: f64,
}

fn is_false(value: &bool) -> bool {
    !value
}

impl From<ProcessFile> for Actuated<Process> {
    fn from(file: ProcessFile) -> Actuated<Process> {
        Actuated {
            controller: Process {
                timeout_s: file.timeout_s,
                fresh: file.fresh,
                parameters: file.parameters,
                ..Process::new(file.command)
            },
            lag_s: file.lag_s,
        }
    }
}

impl From<Actuated<Process>> for ProcessFile {
    fn from(Actuated { controller, lag_s }: Actuated<Process>) -> ProcessFile {
        ProcessFile {
            command: controller.command,
            timeout_s: controller.timeout_s,
            fresh: controller.fresh,
            parameters: controller.parameters,
            lag_s,
        }
    }
}

written_as!(Process, ProcessFile);

fn default_timeout_s() -> f64 {
    10.0
}

impl Process {
    /// Names of its numeric parameters.
    pub const PARAMETERS: &[&str] = &["timeout_s"];

    /// Creates the ego for a command line, with the default timeout.
    ///
    /// The program is not started before [`Process::allow`], as if read from a
    /// file.
    pub fn new(command: impl IntoIterator<Item = impl Into<String>>) -> Process {
        Process {
            command: command.into_iter().map(Into::into).collect(),
            timeout_s: default_timeout_s(),
            fresh: false,
            parameters: BTreeMap::new(),
            // Construction gives no consent: only `allow` does.
            allowed: false,
            pool: Pool::default(),
        }
    }

    /// Gives or withdraws the consent to start it.
    pub fn allow(&mut self, allowed: bool) {
        self.allowed = allowed;
    }

    /// Returns whether its start is allowed.
    pub fn is_allowed(&self) -> bool {
        self.allowed
    }

    /// Returns a controller that starts the program at its first percept.
    #[doc(hidden)]
    pub fn controller(&self) -> ProcessController {
        ProcessController {
            spec: self.clone(),
            briefing: Briefing::default(),
            talk: None,
            seed: 0,
            fresh: false,
        }
    }

    /// Returns the same program, whose processes are shared with no other controller.
    pub fn apart(&self) -> Process {
        Process {
            pool: Pool::apart(),
            ..self.clone()
        }
    }

    /// Returns the transcripts of its episodes, which all clones share.
    pub fn transcripts(&self) -> &Transcripts {
        self.pool.transcripts()
    }

    /// Returns a problem of its settings: the field, the message and the help.
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
        let odd = self.parameters.iter().find(|(_, value)| !value.is_finite());
        odd.map(|(name, value)| {
            (
                "parameters",
                format!("the parameter `{name}` is {value}"),
                "give a value within the range that the program declares",
            )
        })
    }

    /// Returns its numeric parameters. The program's own ones are known once it says hello.
    pub fn parameters(&self) -> Vec<Parameter> {
        vec![Parameter {
            name: "timeout_s",
            about: "Longest wait for an answer, s.",
            value: self.timeout_s,
            at_least: MIN_TIMEOUT_S,
        }]
    }

    /// Sets a parameter by name.
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

    /// Starts the program, and returns the name in its hello.
    ///
    /// It then waits for the first episode. `None` without consent, if it fails to start,
    /// and for a name that is empty, long or of several lines.
    pub fn hello_name(&self) -> Option<String> {
        let talk = self.talk().ok()?;
        let name = talk.hello.name.trim().to_owned();
        if !self.fresh {
            self.pool.give_back(talk);
        }
        // Foreign text that goes into tables and file names.
        let is_short = (1..=MOST_NAME_CHARS).contains(&name.chars().count());
        (is_short && !name.contains(char::is_control)).then_some(name)
    }

    /// Starts the program, and returns the parameters that its hello declares.
    ///
    /// # Errors
    /// It is not allowed, or does not start.
    pub fn declared(&self) -> Result<Vec<DeclaredParameter>, Fault> {
        let talk = self.talk()?;
        let parameters = talk.hello.parameters.clone();
        if !self.fresh {
            self.pool.give_back(talk);
        }
        Ok(parameters)
    }

    /// Returns the cost of the program so far, in all episodes of all its clones.
    pub fn cost(&self) -> ProgramCost {
        self.pool.cost()
    }

    /// Returns whether both are one program, as clones are, with one cost.
    pub fn shares_cost(&self, other: &Process) -> bool {
        self.pool.is(&other.pool)
    }

    fn talk(&self) -> Result<Talk, Fault> {
        if !self.allowed {
            return Err(Fault::new(
                FaultKind::CannotStart,
                format!(
                    "`{}` was not started: programs were not allowed",
                    self.command.join(" ")
                ),
            ));
        }
        self.pool.take(&self.command, self.timeout())
    }

    fn timeout(&self) -> Duration {
        // Clamped, because `from_secs_f64` panics on negative and infinite
        // values.
        Duration::from_secs_f64(self.timeout_s.clamp(MIN_TIMEOUT_S, MAX_TIMEOUT_S))
    }
}

/// A controller that runs a program, started with the first percept.
///
/// Between episodes the program waits in a pool that all controllers of a
/// [`Process`] share. A worker thus starts it once, whatever it runs.
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
        // Kept only: the program is asked with the first percept, when its
        // start can fail.
        self.seed = seed;
        self.fresh = true;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let answer = self.converse(percept);
        if answer.is_err()
            && let Some(mut talk) = self.talk.take()
        {
            // A faulty program is ended at once. The next episode gets a new one.
            talk.broken = true;
        }
        answer
    }

    fn finish(&mut self) {
        // A fresh program ends with its episode.
        if let Some(talk) = self.talk.take().filter(|_| !self.spec.fresh) {
            self.spec.pool.give_back(talk);
        }
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        // A running program holds state that cannot be copied.
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
            // Invariant: an episode is continued by the program that began it.
            None if !self.fresh => {
                return Err(Fault::error("the ego was asked after its episode ended"));
            }
            None => self.talk.insert(self.spec.talk()?),
        };
        if self.fresh {
            talk.reset(self.seed, &self.briefing, timeout)?;
            self.spec.pool.count_episode();
            self.fresh = false;
        }
        let began = Instant::now();
        let command = talk.step(percept, timeout)?;
        self.spec.pool.count_step(began.elapsed());
        Ok(command)
    }
}
