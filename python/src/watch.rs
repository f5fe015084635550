//! Campaigns with progress, Ctrl-C and faults, for Python.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use brakecheck::cli::Failure;
use brakecheck::experiment::{Remark, Watch};
use brakecheck::testbench::FaultLog;
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

use crate::error::{failed, raised};
use crate::interrupt::check_interrupted;
use crate::python_thread::{LOOK, stopped_by};

/// Time in which stopped work must end, before it is left behind.
const GRACE: Duration = Duration::from_millis(500);

/// Settings of a campaign.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Running {
    /// Number of threads, where 0 is a thread per core.
    jobs: usize,
    /// Function of (phase, done, total, new remarks), or None.
    progress: Option<Py<PyAny>>,
    /// Share of invalid episodes to tolerate in each row.
    pub(crate) allow_invalid: f64,
}

/// State that the working thread shares with the waiting thread.
#[derive(Default)]
struct Reported {
    done: AtomicU64,
    total: AtomicU64,
    words: Mutex<(String, Vec<String>)>,
}

impl Reported {
    fn hear(&self, remark: Remark<'_>) {
        let mut words = self.words.lock().unwrap_or_else(PoisonError::into_inner);
        match remark {
            Remark::Phase { what, .. } => words.0 = what.to_owned(),
            Remark::Detail(_) => {}
            Remark::Line(line) => words.1.push(line.to_owned()),
        }
    }

    /// Passes news to `progress`.
    fn show(&self, py: Python<'_>, progress: Option<&Py<PyAny>>) -> PyResult<()> {
        let Some(progress) = progress else {
            return Ok(());
        };
        let (phase, lines) = {
            let mut words = self.words.lock().unwrap_or_else(PoisonError::into_inner);
            // The lock is released before Python runs, because workers report while a
            // callback takes long.
            (words.0.clone(), std::mem::take(&mut words.1))
        };
        let done = self.done.load(Ordering::Relaxed);
        let total = self.total.load(Ordering::Relaxed);
        progress.call1(py, (phase, done, total, lines)).map(drop)
    }
}

impl Running {
    /// Does `work` in other threads, without the lock of the interpreter, while
    /// this thread listens for Ctrl-C and shows progress.
    ///
    /// `None` of `work` means that it was stopped before its first result.
    pub(crate) fn watched<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Watch<'_>) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let reported = Arc::new(Reported::default());
        let faults = FaultLog::allowing(self.allow_invalid);
        let (hearer, log, jobs) = (reported.clone(), faults.clone(), self.jobs);
        let work = move |stop: &Arc<AtomicBool>| {
            let progress = |done, total| {
                hearer.done.store(done, Ordering::Relaxed);
                hearer.total.store(total, Ordering::Relaxed);
            };
            let remarks = |remark: Remark<'_>| hearer.hear(remark);
            let watch = Watch {
                remarks: &remarks,
                faults: log,
                ..Watch::new(&progress, stop)
            };
            let pool = ThreadPoolBuilder::new().num_threads(jobs);
            // A pool per call, so that `jobs` of one call does not bind the next, and
            // each thread knows its flag.
            let result = pool.build_scoped(
                |thread| stopped_by(stop, || thread.run()),
                |pool| pool.install(|| work(&watch)),
            );
            result.unwrap_or_else(|error| Err(Failure::fault(error.to_string(), None)))
        };
        let result = interruptible(py, work, |py| reported.show(py, self.progress.as_ref()))?;
        // Ctrl-C may have been pressed inside an ego.
        check_interrupted()?;
        // The last news may be younger than the last look.
        reported.show(py, self.progress.as_ref())?;
        // Why an ego did not run says more than what could not be done for it.
        match faults.complaint() {
            Some(complaint) => Err(failed(complaint)),
            None => result.map_err(failed),
        }
    }
}

/// Does `work` in a separate thread while this thread listens for Ctrl-C and
/// calls `show` at intervals.
///
/// After Ctrl-C it stops the work, and abandons it if it does not end.
pub(crate) fn interruptible<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>) -> T + Send + 'static,
    show: impl Fn(Python<'_>) -> PyResult<()>,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let (send, receive) = channel();
    let receive = Mutex::new(receive);
    let wait = |most| {
        let receive = receive.lock();
        receive
            .unwrap_or_else(PoisonError::into_inner)
            .recv_timeout(most)
    };
    let flag = stop.clone();
    std::thread::spawn(move || {
        // Nobody receives what was left behind.
        let _ = send.send(stopped_by(&flag, || work(&flag)));
    });
    loop {
        match py.detach(|| wait(LOOK)) {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(raised("FaultError", "a worker panicked".to_owned()));
            }
            Err(RecvTimeoutError::Timeout) => {
                // An exception of the progress function stops the work like Ctrl-C.
                let Err(interrupt) = py.check_signals().and_then(|()| show(py)) else {
                    continue;
                };
                stop.store(true, Ordering::Relaxed);
                // Work that hears of it ends tidily: a training keeps a checkpoint.
                let _ = py.detach(|| wait(GRACE));
                return Err(interrupt);
            }
        }
    }
}

/// Returns the result, or `KeyboardInterrupt` if the work stopped before its first result.
pub(crate) fn something<T>(found: Option<T>) -> PyResult<T> {
    found.ok_or_else(|| PyKeyboardInterrupt::new_err("stopped before anything was finished"))
}
