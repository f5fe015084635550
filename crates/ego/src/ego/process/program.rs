//! A running program: its pipes with deadlines, its process group, its end.
//!
//! Everything happens in the calling thread. Both pipes and stderr are
//! non-blocking and polled together. A program that does not read or does not
//! answer therefore holds no thread longer than its timeout, and nothing
//! remains to be joined.
//!
//! The program lives in a process group of its own, whose leader is a watchdog.
//! The watchdog is a shell that waits for the end of a pipe which only
//! brakecheck holds. When brakecheck is killed, that pipe closes and the
//! watchdog kills the group. The program joins the group before it runs
//! (`setpgid` before `exec`), so it cannot be orphaned at any moment.
//!
//! Processes that leave the group by themselves (`setsid`) are found by a mark
//! ([`marks`](super::marks)).

use std::io::{ErrorKind, Read, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

use super::super::{Fault, FaultKind};
use super::is_stopping;
use super::marks::{MARK, end_marked, new_mark};

/// Longest line that a program may answer.
const MAX_LINE_BYTES: usize = 64 * 1024;
/// Length of the last part of stderr that is kept.
const STDERR_BYTES: usize = 4 * 1024;
/// Interval of checks on a silent program.
///
/// It may have ended while a child of it still holds its output.
const LOOK_AFTER: Duration = Duration::from_millis(50);
/// Longest wait for an answer after a stop was requested.
const AFTER_STOP: Duration = Duration::from_millis(200);
/// Longest wait for the exit status of a program whose output has ended.
const STATUS_WAIT: Duration = Duration::from_millis(100);

/// Script of the watchdog, which outlives brakecheck by a moment.
///
/// It receives the mark as an argument. Its own environment does not hold the
/// mark.
const WATCHDOG: &str = r#"read -r end
for look in 1 2 3; do
  for e in $(grep -ls -- "$0" /proc/[0-9]*/environ 2>/dev/null); do
    e=${e#/proc/}; kill -9 "${e%/environ}" 2>/dev/null
  done
done
kill -9 0"#;

/// A started program.
pub(super) struct Program {
    name: String,
    child: Child,
    /// Leader of the process group. Its stdin is held open and never written to.
    watchdog: Child,
    /// `NAME=VALUE` in the environment of the program and its descendants.
    mark: String,
    /// `None` once closed, which asks the program to end.
    input: Option<ChildStdin>,
    output: ChildStdout,
    errors: ChildStderr,
    /// Output that is not consumed yet. Any before a question is a fault.
    unread: Vec<u8>,
    stderr: Vec<u8>,
    stderr_ended: bool,
}

impl Program {
    /// Starts `command` in a process group of its own.
    pub(super) fn start(command: &[String]) -> Result<Program, Fault> {
        let cannot = |what: String| Fault::new(FaultKind::CannotStart, what);
        let Some((name, arguments)) = command.split_first() else {
            return Err(cannot("no program is named: `command` is empty".to_owned()));
        };
        let value = new_mark();
        // In the form that an environment has, so that it is compared without
        // parsing.
        let mark = format!("{MARK}={value}");
        let mut watchdog = Command::new("/bin/sh")
            .args(["-c", WATCHDOG, &mark])
            // An ego that itself runs brakecheck has a mark, which must not be inherited.
            .env_remove(MARK)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()
            .map_err(|error| {
                cannot(format!(
                    "`/bin/sh`, which guards programs, cannot be started: {error}"
                ))
            })?;
        let started = Command::new(name)
            .args(arguments)
            .env(MARK, value)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // The group exists already, so the program is in it from its first
            // instruction.
            .process_group(Pid::from_child(&watchdog).as_raw_nonzero().get())
            .spawn();
        let mut child = match started {
            Ok(child) => child,
            Err(error) => {
                end_group(&mut watchdog);
                return Err(cannot(format!("`{name}` cannot be started: {error}")));
            }
        };
        let pipes = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(input), Some(output), Some(errors)) = pipes else {
            end_group(&mut watchdog);
            let _ = child.kill();
            let _ = child.wait();
            return Err(cannot(format!("`{name}` has no pipes")));
        };
        // From here on, `Drop` ends everything on an error.
        let program = Program {
            name: name.clone(),
            child,
            watchdog,
            mark,
            input: Some(input),
            output,
            errors,
            unread: Vec::new(),
            stderr: Vec::new(),
            stderr_ended: false,
        };
        program.unblock().map_err(|error| {
            cannot(format!(
                "the pipes of `{name}` cannot be waited for: {error}"
            ))
        })?;
        Ok(program)
    }

    /// Returns the program as named in the world.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    fn unblock(&self) -> rustix::io::Result<()> {
        if let Some(input) = &self.input {
            rustix::io::ioctl_fionbio(input, true)?;
        }
        rustix::io::ioctl_fionbio(&self.output, true)?;
        rustix::io::ioctl_fionbio(&self.errors, true)
    }

    /// Sends a line and waits for an answer, at most for `timeout`.
    ///
    /// `occasion` describes the question in messages. `answer` receives the answer
    /// without its line end.
    pub(super) fn ask(
        &mut self,
        line: &[u8],
        timeout: Duration,
        occasion: &dyn Fn() -> String,
        answer: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        answer.clear();
        self.converse(line, timeout, occasion, answer)
            .map_err(|fault| fault.with_stderr(self.stderr()))
    }

    /// Returns the last part of its stderr.
    pub(super) fn stderr(&mut self) -> String {
        self.read_stderr();
        String::from_utf8_lossy(&self.stderr).trim().to_owned()
    }

    fn converse(
        &mut self,
        line: &[u8],
        timeout: Duration,
        occasion: &dyn Fn() -> String,
        answer: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        // Checked before sending: output that precedes the question cannot
        // answer it.
        if !self.unread.is_empty() {
            let shown = shown(&self.unread);
            return Err(self.protocol(format!("answered `{shown}` without being asked")));
        }
        // One deadline for sending and answering, so that a slow reader gains
        // no time.
        let deadline = Instant::now() + timeout;
        let mut unsent = line;
        loop {
            // In each round, since the pipe takes a long question in pieces.
            self.send(&mut unsent, occasion)?;
            let now = Instant::now();
            if deadline <= now {
                return Err(self.late(unsent.is_empty(), timeout, occasion));
            }
            let waited = timeout.saturating_sub(deadline - now);
            if is_stopping() && waited >= AFTER_STOP {
                return Err(self.stopped(occasion));
            }
            if !self.is_guarded() {
                return Err(self.protocol(format!(
                    "ended `/bin/sh`, which guards it, when {}",
                    occasion()
                )));
            }
            self.wait(!unsent.is_empty(), (deadline - now).min(LOOK_AFTER))?;
            let open = self.receive()?;
            // An answer that precedes the reading of the question is no answer.
            if unsent.is_empty() && self.take_line(answer)? {
                return Ok(());
            }
            if !open {
                return Err(self.ended(occasion));
            }
        }
    }

    /// Writes as much as the pipe accepts now.
    fn send(&mut self, unsent: &mut &[u8], occasion: &dyn Fn() -> String) -> Result<(), Fault> {
        while !unsent.is_empty() {
            let Some(input) = &mut self.input else {
                return Err(self.ended(occasion));
            };
            match input.write(unsent) {
                Ok(written) => *unsent = &unsent[written..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(self.ended(occasion)),
            }
        }
        Ok(())
    }

    /// Moves the first whole line into `answer`.
    fn take_line(&mut self, answer: &mut Vec<u8>) -> Result<bool, Fault> {
        let end = self.unread.iter().position(|&byte| byte == b'\n');
        match end {
            Some(end) => {
                answer.extend(self.unread.drain(..=end));
                // The line end is no part of the answer.
                answer.pop();
                Ok(true)
            }
            // The limit keeps a flood without line ends from filling the
            // memory.
            None if self.unread.len() >= MAX_LINE_BYTES => {
                Err(self.protocol(format!("answered a line of over {MAX_LINE_BYTES} bytes")))
            }
            None => Ok(false),
        }
    }

    /// Reads the available output. Returns `false` once the output has ended.
    fn receive(&mut self) -> Result<bool, Fault> {
        let mut chunk = [0; 4096];
        // A flood stays in its pipe, which blocks the program and not the
        // memory.
        while self.unread.len() < MAX_LINE_BYTES {
            match self.output.read(&mut chunk) {
                Ok(0) => return Ok(false),
                Ok(read) => {
                    self.unread.extend_from_slice(&chunk[..read]);
                    if read < chunk.len() {
                        break;
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.protocol(format!("cannot be read: {error}"))),
            }
        }
        Ok(true)
    }

    fn read_stderr(&mut self) {
        let mut chunk = [0; 4096];
        // Faster floods stay in the pipe, so this loop is bounded.
        for _ in 0..16 {
            match self.errors.read(&mut chunk) {
                Ok(0) => {
                    self.stderr_ended = true;
                    return;
                }
                Ok(read) => {
                    self.stderr.extend_from_slice(&chunk[..read]);
                    // Only the last part is kept: errors come last.
                    let over = self.stderr.len().saturating_sub(STDERR_BYTES);
                    self.stderr.drain(..over);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }

    /// Waits until reading or, if requested, writing is possible.
    fn wait(&mut self, to_write: bool, timeout: Duration) -> Result<(), Fault> {
        let mut fds = Vec::with_capacity(3);
        fds.push(PollFd::new(&self.output, PollFlags::IN));
        // A stream that has ended is always ready and would make this spin.
        if !self.stderr_ended {
            fds.push(PollFd::new(&self.errors, PollFlags::IN));
        }
        if let (true, Some(input)) = (to_write, &self.input) {
            fds.push(PollFd::new(input, PollFlags::OUT));
        }
        let timeout = Timespec {
            tv_sec: i64::try_from(timeout.as_secs()).unwrap_or(i64::MAX),
            tv_nsec: i64::from(timeout.subsec_nanos()),
        };
        let waited = poll(&mut fds, Some(&timeout));
        // The second entry is stderr as long as that is open.
        let spoke = fds.get(1).is_some_and(|fd| !fd.revents().is_empty());
        match waited {
            Ok(0) => {
                // Silence: check for an exit, since a child may still hold the pipe.
                let ended = matches!(self.child.try_wait(), Ok(Some(_)));
                if ended && !self.receive_more()? {
                    Err(self.ended(&|| "it was asked".to_owned()))
                } else {
                    Ok(())
                }
            }
            Ok(_) => {
                if spoke && !self.stderr_ended {
                    self.read_stderr();
                }
                Ok(())
            }
            Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(self.protocol(format!("cannot be waited for: {error}"))),
        }
    }

    /// Returns whether a program that has ended left output to read.
    fn receive_more(&mut self) -> Result<bool, Fault> {
        let before = self.unread.len();
        self.receive()?;
        Ok(before < self.unread.len())
    }

    fn protocol(&self, what: String) -> Fault {
        Fault::new(FaultKind::Protocol, format!("`{}` {what}", self.name))
    }

    fn late(&self, read_it: bool, timeout: Duration, occasion: &dyn Fn() -> String) -> Fault {
        let seconds = timeout.as_secs_f64();
        let name = &self.name;
        let what = if read_it {
            // An answer that stays in a buffer is the usual cause.
            format!(
                "`{name}` gave no answer within {seconds} s when {}; \
                 a program must flush its output after every line",
                occasion()
            )
        } else {
            format!("`{name}` read nothing for {seconds} s when {}", occasion())
        };
        Fault::new(FaultKind::Timeout, what)
    }

    fn stopped(&self, occasion: &dyn Fn() -> String) -> Fault {
        let name = &self.name;
        Fault::error(format!(
            "`{name}` was not waited for any longer when {}: stopped by Ctrl-C",
            occasion()
        ))
    }

    /// Returns whether the watchdog runs, without which the program could outlive
    /// brakecheck.
    fn is_guarded(&self) -> bool {
        let leader = WaitId::Pid(Pid::from_child(&self.watchdog));
        // Not reaped here, so its number stays that of the group.
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        !matches!(waitid(leader, options), Ok(Some(_)))
    }

    fn ended(&mut self, occasion: &dyn Fn() -> String) -> Fault {
        // The output can end shortly before the status is available.
        let how = match wait_for(&mut self.child, STATUS_WAIT) {
            Some(status) => format!("ended ({status})"),
            None => "closed its output".to_owned(),
        };
        Fault::new(
            FaultKind::Ended,
            format!("`{}` {how} when {}", self.name, occasion()),
        )
    }

    /// Asks it to end, by a line and by closing its input.
    ///
    /// Returns whether it ended by itself within the grace period.
    pub(super) fn close(&mut self, farewell: &[u8], grace: Duration) -> bool {
        if let Some(mut input) = self.input.take() {
            // A full pipe belongs to a program that does not read it.
            let _ = input.write(farewell);
        }
        wait_for(&mut self.child, grace).is_some()
    }

    /// Returns whether it stays silent while it is asked nothing.
    pub(super) fn is_silent(&mut self, most: Duration) -> bool {
        let deadline = Instant::now() + most;
        while self.unread.is_empty() && Instant::now() < deadline {
            thread::sleep(Duration::from_millis(1));
            if self.receive().is_err() {
                return false;
            }
        }
        self.unread.is_empty()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // Kills the rest of the group, including the program's own children.
        end_group(&mut self.watchdog);
        // It may have left the group. Waiting for it would then never end.
        let _ = self.child.kill();
        let _ = self.child.wait();
        end_marked(&self.mark);
    }
}

/// Kills a group and reaps its leader.
///
/// The leader is not reaped before, so its number cannot belong to a different
/// process.
fn end_group(leader: &mut Child) {
    let _ = kill_process_group(Pid::from_child(leader), Signal::KILL);
    let _ = leader.wait();
}

fn wait_for(child: &mut Child, most: Duration) -> Option<std::process::ExitStatus> {
    let deadline = Instant::now() + most;
    let mut pause = Duration::from_micros(200);
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if Instant::now() < deadline => thread::sleep(pause),
            _ => return None,
        }
        // Exits are usually fast, so the first waits are short.
        pause = (2 * pause).min(Duration::from_millis(10));
    }
}

/// Returns the beginning of an answer, for messages.
pub(super) fn shown(answer: &[u8]) -> String {
    let text = String::from_utf8_lossy(answer);
    let line = text.lines().next().unwrap_or_default();
    let mut shown: String = line.chars().take(80).collect();
    if shown.len() < line.len() {
        shown.push('…');
    }
    shown
}
