//! An ego that is another program: JSON lines on its stdin and stdout.
//!
//! Per episode the program reads one line `{"reset": {"seed": 7}}` and answers
//! `{"ready": true}`; per sample it reads one line, a [`Percept`] as JSON, and
//! answers with a [`Command`], such as `{"accel_mps2": -1.5}`. It should flush
//! after every line and end when its stdin does. What it writes to stderr is
//! shown.
//!
//! A crash, a hang, a flood or an answer that is no command is a [`Fault`]: it
//! makes the episode invalid, never a success of the ado. The program is
//! started anew for the next episode then.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command as Program, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{Command, Controller, Fault, Parameter, Percept, UnknownParameter};

/// Longest wait for an answer that can be asked for.
const MAX_TIMEOUT_S: f64 = 86_400.0;
/// Longest line a program may answer with.
const MAX_LINE_BYTES: u64 = 64 * 1024;
/// Answers that may wait unread; a program that floods stalls itself.
const MAX_WAITING: usize = 16;

/// A program as the ego, as named in a world file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Process {
    /// The program and its arguments, found as a shell would find it.
    pub command: Vec<String>,
    /// Longest wait for an answer; generous, since machines are busy.
    #[serde(default = "default_timeout_s")]
    pub timeout_s: f64,
    /// Time constant of the actuator behind the command; 0 is none.
    #[serde(default)]
    pub lag_s: f64,
}

fn default_timeout_s() -> f64 {
    10.0
}

impl Process {
    /// A controller that starts the program when it is first asked.
    pub fn controller(&self) -> ProcessController {
        ProcessController {
            spec: self.clone(),
            talk: None,
            seed: 0,
            fresh: false,
            line: String::new(),
        }
    }

    /// Its numeric parameters; what the program does is its own affair.
    pub fn parameters(&self) -> Vec<Parameter> {
        let parameter = |name, about, value| Parameter {
            name,
            about,
            value,
            at_least: 0.0,
        };
        vec![
            parameter(
                "timeout_s",
                "Longest wait for an answer, s.",
                self.timeout_s,
            ),
            parameter(
                "lag_s",
                "Time constant of the actuator, s; 0 is none.",
                self.lag_s,
            ),
        ]
    }

    /// Sets one parameter by name.
    ///
    /// # Errors
    /// The name is neither `timeout_s` nor `lag_s`.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), UnknownParameter> {
        match name {
            "timeout_s" => self.timeout_s = value,
            "lag_s" => self.lag_s = value,
            _ => {
                return Err(UnknownParameter {
                    name: name.to_owned(),
                    known: vec!["timeout_s", "lag_s"],
                });
            }
        }
        Ok(())
    }
}

/// A running program, or one about to be started.
pub struct ProcessController {
    spec: Process,
    talk: Option<Talk>,
    seed: u64,
    fresh: bool,
    line: String,
}

/// The two ends of a conversation.
struct Talk {
    child: Child,
    input: ChildStdin,
    output: Receiver<Result<String, String>>,
}

impl Drop for Talk {
    fn drop(&mut self) {
        // It may have ended by itself; either way nothing is left behind.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[derive(Serialize)]
struct Reset {
    reset: Seed,
}

#[derive(Serialize)]
struct Seed {
    seed: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ready {
    ready: bool,
}

impl Controller for ProcessController {
    fn reset(&mut self, seed: u64) {
        self.seed = seed;
        self.fresh = true;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let answer = self.converse(percept);
        if answer.is_err() {
            self.talk = None;
        }
        answer.map_err(|what| Fault::Ego { what })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

impl ProcessController {
    fn converse(&mut self, percept: &Percept) -> Result<Command, String> {
        if self.talk.is_none() {
            self.talk = Some(start(&self.spec)?);
            self.fresh = true;
        }
        if self.fresh {
            let reset = Reset {
                reset: Seed { seed: self.seed },
            };
            let answer: Ready = self.ask(&reset)?;
            if !answer.ready {
                return Err("it is not ready".to_owned());
            }
            self.fresh = false;
        }
        self.ask(percept)
    }

    fn ask<Q: Serialize, A: for<'a> Deserialize<'a>>(&mut self, question: &Q) -> Result<A, String> {
        let Some(talk) = &mut self.talk else {
            return Err("it is not running".to_owned());
        };
        self.line = serde_json::to_string(question).map_err(|error| error.to_string())?;
        self.line.push('\n');
        let sent = talk.input.write_all(self.line.as_bytes());
        if let Err(error) = sent.and_then(|()| talk.input.flush()) {
            return Err(ended(talk, &error.to_string()));
        }
        let timeout = Duration::from_secs_f64(self.spec.timeout_s.clamp(0.0, MAX_TIMEOUT_S));
        match talk.output.recv_timeout(timeout) {
            Ok(Ok(line)) => serde_json::from_str(&line).map_err(|error| {
                let shown: String = line.trim_end().chars().take(80).collect();
                format!("it answered `{shown}`: {error}")
            }),
            Ok(Err(what)) => Err(what),
            Err(RecvTimeoutError::Timeout) => {
                Err(format!("no answer within {} s", self.spec.timeout_s))
            }
            Err(RecvTimeoutError::Disconnected) => Err(ended(talk, "its output is closed")),
        }
    }
}

fn ended(talk: &mut Talk, why: &str) -> String {
    match talk.child.try_wait() {
        Ok(Some(status)) => format!("the program ended ({status})"),
        _ => why.to_owned(),
    }
}

fn start(spec: &Process) -> Result<Talk, String> {
    let Some((program, arguments)) = spec.command.split_first() else {
        return Err("no program is named".to_owned());
    };
    let mut child = Program::new(program)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(|error| format!("`{program}` cannot be started: {error}"))?;
    let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
        return Err("its stdin or stdout is missing".to_owned());
    };
    let (sender, receiver) = sync_channel(MAX_WAITING);
    thread::spawn(move || {
        let mut output = BufReader::new(output);
        loop {
            let mut bytes = Vec::new();
            let limited = output
                .by_ref()
                .take(MAX_LINE_BYTES)
                .read_until(b'\n', &mut bytes);
            let line = match limited {
                Ok(0) => return,
                Ok(_) if bytes.last() != Some(&b'\n') && MAX_LINE_BYTES <= bytes.len() as u64 => {
                    Err(format!("it answered a line of over {MAX_LINE_BYTES} bytes"))
                }
                Ok(_) => String::from_utf8(bytes).map_err(|_| "its answer is not UTF-8".to_owned()),
                Err(error) => Err(error.to_string()),
            };
            let last = line.is_err();
            if sender.send(line).is_err() || last {
                return;
            }
        }
    });
    Ok(Talk {
        child,
        input,
        output: receiver,
    })
}
