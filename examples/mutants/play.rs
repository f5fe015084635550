//! Test programs under a mutant: killed by which test, or survived.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::compile::Fallible;

/// Address space of one test program, in KiB: a mutant that fills it fails.
const ROOM_KIB: u64 = 12 << 20;
/// The limit of a suite, in times without a mutant and five seconds more.
const PATIENCE: f64 = 6.0;
/// How often a silent program is asked whether it has ended.
const GLANCE: Duration = Duration::from_millis(100);

/// How a mutant fared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// This test failed, or the program ended otherwise than well.
    Killed { suite: String, test: String },
    /// The suite took longer than its limit.
    TimedOut { suite: String },
    /// Every suite that reaches it passed; none where it is not reached.
    Survived { reached_by: Vec<String> },
}

/// One test program, timed without a mutant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Suite {
    /// Its name.
    pub name: String,
    /// The program.
    pub program: PathBuf,
    /// Seconds without a mutant.
    pub seconds: f64,
    /// Mutants whose place was met.
    pub reached: Vec<u32>,
}

/// What stays the same for all mutants.
#[derive(Debug)]
pub struct Stage {
    /// Where the suites run: the copy.
    pub copy: PathBuf,
    /// For temporary files, which are removed after every program.
    pub scratch: PathBuf,
    /// Patterns of tests that are left out.
    pub skip: Vec<String>,
    /// Patterns of the tests that are run, by suite, where not all are.
    pub only: BTreeMap<String, Vec<String>>,
}

enum Ending {
    Passed,
    Failed(String),
    TooLong,
}

impl Stage {
    /// Times a suite without a mutant and notes what it reaches.
    ///
    /// # Errors
    /// When a test fails that has no reason to.
    pub fn rehearse(&self, name: &str, program: &Path) -> Fallible<Suite> {
        let list = self.scratch.join(format!("reached-{name}"));
        let _ = std::fs::remove_file(&list);
        let started = Instant::now();
        let note = Some(list.as_path());
        match self.play((name, program), 0, note, Duration::from_secs(3600))? {
            Ending::Passed => {}
            Ending::Failed(test) => return Err(format!("{name}: {test} fails unchanged").into()),
            Ending::TooLong => return Err(format!("{name} takes more than an hour").into()),
        }
        let mut reached: Vec<u32> = std::fs::read_to_string(&list)
            .unwrap_or_default()
            .lines()
            .filter_map(|id| id.parse().ok())
            .collect();
        reached.sort_unstable();
        reached.dedup();
        Ok(Suite {
            name: name.to_string(),
            program: program.to_path_buf(),
            seconds: started.elapsed().as_secs_f64(),
            reached,
        })
    }

    /// Runs the suites that reach a mutant, up to the first that fails.
    ///
    /// # Errors
    /// When a program cannot be started.
    pub fn judge(&self, id: u32, suites: &[Suite]) -> std::io::Result<Verdict> {
        let mut reached_by = Vec::new();
        for suite in suites.iter().filter(|suite| suite.reached.contains(&id)) {
            let limit = Duration::from_secs_f64(PATIENCE * (suite.seconds + 5.0));
            let ending = self.play((&suite.name, &suite.program), id, None, limit)?;
            let suite = suite.name.clone();
            match ending {
                Ending::Passed => reached_by.push(suite),
                Ending::TooLong => return Ok(Verdict::TimedOut { suite }),
                Ending::Failed(test) => return Ok(Verdict::Killed { suite, test }),
            }
        }
        Ok(Verdict::Survived { reached_by })
    }

    /// Runs one test program up to its first failure.
    fn play(
        &self,
        (name, program): (&str, &Path),
        id: u32,
        reached: Option<&Path>,
        limit: Duration,
    ) -> std::io::Result<Ending> {
        let scratch = self.scratch.join(format!("mutant-{id}"));
        std::fs::create_dir_all(&scratch)?;
        let mut command = Command::new("sh");
        command
            .arg("-c")
            .arg(format!("ulimit -v {ROOM_KIB}; exec \"$0\" \"$@\""))
            .arg(program)
            .args(self.only.get(name).into_iter().flatten())
            .args(self.skip.iter().flat_map(|pattern| ["--skip", pattern]))
            .current_dir(&self.copy)
            .env("CARGO_MANIFEST_DIR", &self.copy)
            .env("INSTA_UPDATE", "no")
            .env("TMPDIR", &scratch)
            .env("BRAKECHECK_MUTANT", id.to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        if let Some(reached) = reached {
            command.env("BRAKECHECK_MUTANTS_MET", reached);
        }
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let ending = watch(&mut child, Instant::now() + limit);
        end(&mut child);
        let _ = std::fs::remove_dir_all(&scratch);
        ending
    }
}

/// Reads what libtest prints until a test fails or all have ended.
fn watch(child: &mut Child, deadline: Instant) -> std::io::Result<Ending> {
    let (sender, lines) = mpsc::channel();
    if let Some(stdout) = child.stdout.take() {
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
    }
    // What is left of the lines of a program that has ended is read as well.
    let mut ended = None;
    loop {
        match lines.recv_timeout(GLANCE) {
            Ok(line) => {
                let failed = line.strip_suffix(" ... FAILED");
                if let Some(test) = failed.and_then(|test| test.strip_prefix("test ")) {
                    return Ok(Ending::Failed(test.to_string()));
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                ended = Some(child.wait()?);
            }
            Err(RecvTimeoutError::Timeout) => ended = child.try_wait()?,
        }
        match ended {
            Some(status) if status.success() => return Ok(Ending::Passed),
            Some(status) => return Ok(Ending::Failed(format!("({status})"))),
            None if deadline < Instant::now() => return Ok(Ending::TooLong),
            None => {}
        }
    }
}

/// Ends a program with all that it has started.
fn end(child: &mut Child) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    }
    let _ = child.kill();
    let _ = child.wait();
}
