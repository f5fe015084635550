//! A running program: its pipes with deadlines, its process group, its end.
//!
//! Everything happens in the calling thread: both pipes and stderr are
//! non-blocking and waited for together, so neither a program that does not
//! read nor one that does not answer can hold anybody for longer than asked,
//! and nothing is left behind that would have to be joined.
//!
//! The program lives in a process group of its own, whose leader is a watchdog:
//! a shell that waits for the end of a pipe which only brakecheck holds. When
//! brakecheck is killed, that pipe closes and the watchdog kills the group. The
//! program joins the group before it runs (`setpgid` before `exec`), so there
//! is no moment at which it could be orphaned.
//!
//! What leaves the group by itself (`setsid`) is found by a mark in its
//! environment, where the system shows those of processes (`/proc`). Only what
//! clears its environment as well escapes. Nobody waits for it.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};

use super::super::{Fault, FaultKind};

/// Longest line a program may answer with.
const MAX_LINE_BYTES: usize = 64 * 1024;
/// The end of stderr that is kept.
const STDERR_BYTES: usize = 4 * 1024;
/// How often a program that says nothing is looked after, in case it ended
/// while something it started still holds its output.
const LOOK_AFTER: Duration = Duration::from_millis(50);
/// How long to wait for the exit status of a program whose output has ended.
const STATUS_WAIT: Duration = Duration::from_millis(100);

/// A shell that outlives brakecheck by a moment, and nothing else. It is given the
/// mark, which its own environment does not hold.
const WATCHDOG: &str = r#"read -r end
for e in $(grep -ls -- "$0" /proc/[0-9]*/environ 2>/dev/null); do
  e=${e#/proc/}; kill -9 "${e%/environ}" 2>/dev/null
done
kill -9 0"#;
/// The variable by which a program and all that it starts are found.
const MARK: &str = "BRAKECHECK_EGO";
/// How often those are looked for that start others while they are ended.
const LOOKS: usize = 20;

/// A started program.
pub(super) struct Program {
    name: String,
    child: Child,
    /// Leads the process group; its stdin is held open and never written to.
    watchdog: Child,
    /// `NAME=VALUE` in the environment of the program and all that it starts.
    mark: String,
    /// `None` once closed: that tells the program to end.
    input: Option<ChildStdin>,
    output: ChildStdout,
    errors: ChildStderr,
    /// Answered, but not asked for yet: more than nothing here is a fault.
    unread: Vec<u8>,
    stderr: Vec<u8>,
    stderr_ended: bool,
}

impl Program {
    /// Starts `command` in a group of its own.
    pub(super) fn start(command: &[String]) -> Result<Program, Fault> {
        let cannot = |what: String| Fault::new(FaultKind::CannotStart, what);
        let Some((name, arguments)) = command.split_first() else {
            return Err(cannot("no program is named: `command` is empty".to_owned()));
        };
        let value = mark();
        let mark = format!("{MARK}={value}");
        let mut watchdog = Command::new("/bin/sh")
            .args(["-c", WATCHDOG, &mark])
            // Of an ego that runs brakecheck itself.
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

    /// As it was named.
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

    /// Sends a line and waits for one, at most for `timeout`.
    ///
    /// `asked` says in messages what it was asked. The answer is appended to
    /// `answer`, without the end of its line.
    pub(super) fn ask(
        &mut self,
        line: &[u8],
        timeout: Duration,
        asked: &dyn Fn() -> String,
        answer: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        answer.clear();
        self.converse(line, timeout, asked, answer)
            .map_err(|fault| fault.with_stderr(self.stderr()))
    }

    /// The end of what it wrote to stderr.
    pub(super) fn stderr(&mut self) -> String {
        self.read_stderr();
        String::from_utf8_lossy(&self.stderr).trim().to_owned()
    }

    fn converse(
        &mut self,
        line: &[u8],
        timeout: Duration,
        asked: &dyn Fn() -> String,
        answer: &mut Vec<u8>,
    ) -> Result<(), Fault> {
        if !self.unread.is_empty() {
            let shown = shown(&self.unread);
            return Err(self.protocol(format!("answered `{shown}` without being asked")));
        }
        let deadline = Instant::now() + timeout;
        let mut unsent = line;
        loop {
            self.send(&mut unsent, asked)?;
            let now = Instant::now();
            if deadline <= now {
                return Err(self.late(unsent.is_empty(), timeout, asked));
            }
            self.wait(!unsent.is_empty(), (deadline - now).min(LOOK_AFTER))?;
            let open = self.receive()?;
            // An answer that came before the question was read is none.
            if unsent.is_empty() && self.take_line(answer)? {
                return Ok(());
            }
            if !open {
                return Err(self.ended(asked));
            }
        }
    }

    /// Writes as much as the pipe takes now.
    fn send(&mut self, unsent: &mut &[u8], asked: &dyn Fn() -> String) -> Result<(), Fault> {
        while !unsent.is_empty() {
            let Some(input) = &mut self.input else {
                return Err(self.ended(asked));
            };
            match input.write(unsent) {
                Ok(written) => *unsent = &unsent[written..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(self.ended(asked)),
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
                answer.pop();
                Ok(true)
            }
            None if MAX_LINE_BYTES <= self.unread.len() => {
                Err(self.protocol(format!("answered a line of over {MAX_LINE_BYTES} bytes")))
            }
            None => Ok(false),
        }
    }

    /// Reads what is there; `false` once the output has ended.
    fn receive(&mut self) -> Result<bool, Fault> {
        let mut chunk = [0; 4096];
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
        // What a program floods faster than this is left in the pipe.
        for _ in 0..16 {
            match self.errors.read(&mut chunk) {
                Ok(0) => {
                    self.stderr_ended = true;
                    return;
                }
                Ok(read) => {
                    self.stderr.extend_from_slice(&chunk[..read]);
                    let over = self.stderr.len().saturating_sub(STDERR_BYTES);
                    self.stderr.drain(..over);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return,
            }
        }
    }

    /// Waits until something can be read or, if asked for, written.
    fn wait(&mut self, to_write: bool, timeout: Duration) -> Result<(), Fault> {
        let mut fds = Vec::with_capacity(3);
        fds.push(PollFd::new(&self.output, PollFlags::IN));
        // A stream that has ended is always ready: it would make this spin.
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
        let spoke = fds.get(1).is_some_and(|fd| !fd.revents().is_empty());
        match waited {
            Ok(0) => {
                // Silence: has it ended, and something it started holds the pipe?
                let ended = matches!(self.child.try_wait(), Ok(Some(_)));
                match ended && !self.receive_more()? {
                    true => Err(self.ended(&|| "it was asked".to_owned())),
                    false => Ok(()),
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

    /// Whether a program that has ended left something to read.
    fn receive_more(&mut self) -> Result<bool, Fault> {
        let before = self.unread.len();
        self.receive()?;
        Ok(before < self.unread.len())
    }

    fn protocol(&self, what: String) -> Fault {
        Fault::new(FaultKind::Protocol, format!("`{}` {what}", self.name))
    }

    fn late(&self, read_it: bool, timeout: Duration, asked: &dyn Fn() -> String) -> Fault {
        let seconds = timeout.as_secs_f64();
        let what = match read_it {
            true => format!("gave no answer within {seconds} s"),
            false => format!("read nothing for {seconds} s"),
        };
        let what = format!("`{}` {what} when {}", self.name, asked());
        Fault::new(FaultKind::Timeout, what)
    }

    fn ended(&mut self, asked: &dyn Fn() -> String) -> Fault {
        let how = match wait_for(&mut self.child, STATUS_WAIT) {
            Some(status) => format!("ended ({status})"),
            None => "closed its output".to_owned(),
        };
        Fault::new(
            FaultKind::Ended,
            format!("`{}` {how} when {}", self.name, asked()),
        )
    }

    /// Tells it to end, by a line and by the end of its input, and waits a
    /// moment; whether it ended by itself.
    pub(super) fn close(&mut self, farewell: &[u8], grace: Duration) -> bool {
        if let Some(mut input) = self.input.take() {
            // A pipe that is full belongs to a program that does not listen.
            let _ = input.write(farewell);
        }
        wait_for(&mut self.child, grace).is_some()
    }

    /// Whether it says nothing for a while in which it is asked nothing.
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
        // Whatever is left of the group, the program's own children included.
        end_group(&mut self.watchdog);
        // It may have left the group, and would then be waited for without end.
        let _ = self.child.kill();
        let _ = self.child.wait();
        end_marked(&self.mark);
    }
}

/// A value that no other program has been marked with.
fn mark() -> String {
    static STARTED: AtomicU64 = AtomicU64::new(0);
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let now = now.map_or(0, |now| now.as_nanos());
    let nth = STARTED.fetch_add(1, Ordering::Relaxed);
    format!("{}-{now}-{nth}", std::process::id())
}

/// Kills what left the group of a program but still has its mark.
fn end_marked(mark: &str) {
    for _ in 0..LOOKS {
        let marked = marked(mark);
        if marked.is_empty() {
            return;
        }
        for pid in marked {
            let _ = kill_process(pid, Signal::KILL);
        }
    }
}

/// Running processes whose environment holds a mark; none where the system does
/// not show that.
fn marked(mark: &str) -> Vec<Pid> {
    let own = std::process::id();
    let processes = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let has_mark = |path: &std::path::Path| {
        let environment = std::fs::read(path.join("environ")).unwrap_or_default();
        let mut variables = environment.split(|byte| *byte == 0);
        variables.any(|variable| variable == mark.as_bytes())
    };
    let marked = processes.filter_map(|process| {
        let number: u32 = process.file_name().to_str()?.parse().ok()?;
        let pid = Pid::from_raw(i32::try_from(number).ok()?)?;
        (number != own && has_mark(&process.path())).then_some(pid)
    });
    marked.collect()
}

/// Kills a group and reaps its leader.
///
/// The leader's number cannot have been given to somebody else: it is not
/// reaped before.
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
        pause = (2 * pause).min(Duration::from_millis(10));
    }
}

/// The beginning of an answer, for messages.
pub(super) fn shown(answer: &[u8]) -> String {
    let text = String::from_utf8_lossy(answer);
    let line = text.lines().next().unwrap_or_default();
    let mut shown: String = line.chars().take(80).collect();
    if shown.len() < line.len() {
        shown.push('…');
    }
    shown
}
