//! Campaigns that Python waits for: progress, Ctrl-C, faults.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use brakecheck::campaign::{Remark, Watch};
use brakecheck::cli::Failure;
use brakecheck::testbench::FaultLog;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use rayon::{ThreadBuilder, ThreadPoolBuilder};

use crate::error::{failed, raised};

/// How often somebody looks whether Ctrl-C was pressed, and what there is to show.
const LOOK: Duration = Duration::from_millis(100);

/// How to run a campaign.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Running {
    /// Threads; 0: one per core.
    jobs: usize,
    /// Called with (what is done now, done, total, new remarks), or None.
    progress: Option<Py<PyAny>>,
    /// Largest share of invalid episodes in a row that is no fault.
    pub(crate) allow_invalid: f64,
}

/// What the thread that works tells the one that waits.
#[derive(Default)]
struct Told {
    done: AtomicU64,
    total: AtomicU64,
    words: Mutex<(String, Vec<String>)>,
}

impl Told {
    fn hear(&self, remark: Remark<'_>) {
        let mut words = self.words.lock().unwrap_or_else(PoisonError::into_inner);
        match remark {
            Remark::Phase(phase) => words.0 = phase.to_owned(),
            Remark::Line(line) => words.1.push(line.to_owned()),
        }
    }

    /// Shows `progress` what is new.
    fn show(&self, py: Python<'_>, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        let Some(progress) = progress else {
            return Ok(());
        };
        let (phase, lines) = {
            let mut words = self.words.lock().unwrap_or_else(PoisonError::into_inner);
            (words.0.clone(), std::mem::take(&mut words.1))
        };
        let done = self.done.load(Ordering::Relaxed);
        let total = self.total.load(Ordering::Relaxed);
        progress.call1(py, (phase, done, total, lines)).map(drop)
    }
}

impl Running {
    /// Does `work` in other threads, without the lock of the interpreter, while
    /// this one listens for Ctrl-C and shows progress.
    ///
    /// `None` of `work` means that it was stopped before there was anything.
    pub(crate) fn watched<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Watch<'_>) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let (stop, told) = (AtomicBool::new(false), Told::default());
        let faults = FaultLog::allowing(self.allow_invalid);
        let log = faults.clone();
        let (send, receive) = channel();
        let (told, stop) = (&told, &stop);
        let progress = |done, total| {
            told.done.store(done, Ordering::Relaxed);
            told.total.store(total, Ordering::Relaxed);
        };
        let remarks = |remark: Remark<'_>| told.hear(remark);
        let work = move || {
            let watch = Watch {
                progress: &progress,
                remarks: &remarks,
                stop,
                faults: log,
            };
            let pool = ThreadPoolBuilder::new().num_threads(self.jobs);
            let result = pool.build_scoped(known_to_python, |pool| pool.install(|| work(&watch)));
            let result =
                result.unwrap_or_else(|error| Err(Failure::fault(error.to_string(), None)));
            // Whoever waits is there until this thread has ended.
            let _ = send.send(result);
        };
        let (result, interrupted) = py.detach(move || {
            std::thread::scope(|scope| {
                scope.spawn(work);
                let mut interrupted = None;
                loop {
                    match receive.recv_timeout(LOOK) {
                        Ok(result) => break (Some(result), interrupted),
                        Err(RecvTimeoutError::Disconnected) => break (None, interrupted),
                        Err(RecvTimeoutError::Timeout) if interrupted.is_some() => {}
                        Err(RecvTimeoutError::Timeout) => {
                            let looked = Python::attach(|py| {
                                py.check_signals()?;
                                told.show(py, self.progress.as_ref())
                            });
                            interrupted = looked.err();
                            stop.store(interrupted.is_some(), Ordering::Relaxed);
                        }
                    }
                }
            })
        });
        if let Some(interrupted) = interrupted {
            return Err(interrupted);
        }
        told.show(py, self.progress.as_ref())?;
        let result = result.ok_or_else(|| raised("FaultError", "a worker panicked".to_owned()))?;
        // Why an ego did not run says more than what could not be done for it.
        match faults.complaint() {
            Some(complaint) => Err(failed(complaint)),
            None => result.map_err(failed),
        }
    }
}

/// Runs a thread that calls Python often, known to the interpreter as long as it
/// lives: for one that is not, the interpreter sets up and takes down a state,
/// memory included, at every single call, which costs more than the call.
fn known_to_python(thread: ThreadBuilder) {
    Python::attach(|py| py.detach(|| thread.run()));
}

/// Nothing was computed, though nobody pressed Ctrl-C.
pub(crate) fn something<T>(found: Option<T>) -> PyResult<T> {
    found.ok_or_else(|| PyKeyboardInterrupt::new_err("stopped before anything was finished"))
}
