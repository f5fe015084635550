//! Threads in which egos and ados written in Python run.
//!
//! A thread of this extension never runs their code itself. It asks its own Python
//! thread and waits without the interpreter's lock, until the deadline of an ego or
//! Ctrl-C. Then it abandons a Python thread that does not answer. An exception ends
//! the Python code in it. A call that blocks outside of Python stays behind in a
//! daemon thread.
//!
//! Below the user's code such a thread has frames of Python only. The interpreter
//! unwinds threads when the process exits, and unwinding frames of Rust would abort it.

use std::cell::{Cell, RefCell};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::interrupt::{is_interrupt_noted, note_interrupt};

/// Interval at which a waiting thread checks for Ctrl-C.
pub(crate) const LOOK: Duration = Duration::from_millis(100);

/// Set before the process exits. No Python thread may wake up after that.
static EXITING: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// The Python thread of this thread, while it is not asked.
    static THREAD: Cell<Option<PythonThread>> = const { Cell::new(None) };
    /// Set if another thread listens for Ctrl-C for this thread.
    static STOP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// A Python callable and its arguments.
type Call = (Py<PyAny>, Py<PyTuple>);

/// A call to make, and the receiver of its result.
struct Question {
    ask: Box<dyn FnOnce(Python<'_>) -> PyResult<Call> + Send>,
    hear: Hear,
}

type Hear = Box<dyn FnOnce(PyResult<Bound<'_, PyAny>>) + Send>;

/// Reason why a call has no result.
pub(crate) enum Unanswered {
    /// It raised an exception.
    Raised(PyErr),
    /// It took too long. The stack has its place.
    Late { stack: String },
    /// Ctrl-C was pressed meanwhile.
    Stopped,
}

/// Runs `work`. Calls of Python in it end after `stop` is set.
pub(crate) fn stopped_by<T>(stop: &Arc<AtomicBool>, work: impl FnOnce() -> T) -> T {
    // Work may nest, and the outer work must hear its own flag afterwards.
    let before = STOP.replace(Some(stop.clone()));
    let done = work();
    STOP.set(before);
    done
}

/// Makes a call in the Python thread of this thread, for at most `limit`.
///
/// The calling thread must not hold the interpreter's lock.
pub(crate) fn call<T: Send + 'static>(
    limit: Option<Duration>,
    ask: impl FnOnce(Python<'_>) -> PyResult<Call> + Send + 'static,
    hear: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T> + Send + 'static,
) -> Result<T, Unanswered> {
    if is_stopped() {
        return Err(Unanswered::Stopped);
    }
    let thread = match THREAD.take() {
        Some(thread) => thread,
        None => PythonThread::start().map_err(Unanswered::Raised)?,
    };
    let (send, receive) = sync_channel(1);
    let question = Question {
        ask: Box::new(ask),
        hear: Box::new(move |answer| {
            // Nobody listens any more to a thread that was abandoned.
            let _ = send.send(answer.and_then(|answer| hear(&answer)));
        }),
    };
    // A thread that has ended drops the question, which is noticed below.
    let _ = thread.questions.send(question);
    let requested = Instant::now();
    loop {
        let left = limit.map_or(LOOK, |limit| limit.saturating_sub(requested.elapsed()));
        match receive.recv_timeout(left.min(LOOK)) {
            Ok(answer) => {
                // Only a thread that answered is used again, since another may be busy for
                // ever.
                THREAD.set(Some(thread));
                return answer.map_err(Unanswered::Raised);
            }
            Err(RecvTimeoutError::Disconnected) => {
                let ended = PyRuntimeError::new_err("the thread of the Python code has ended");
                return Err(Unanswered::Raised(ended));
            }
            Err(RecvTimeoutError::Timeout) if is_interrupted() => {
                thread.abandon();
                return Err(Unanswered::Stopped);
            }
            Err(RecvTimeoutError::Timeout) if limit.is_some_and(|it| it <= requested.elapsed()) => {
                let stack = thread.abandon();
                return Err(Unanswered::Late { stack });
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
    }
}

/// Returns true after Ctrl-C, so that no further call is made.
fn is_stopped() -> bool {
    STOP.with_borrow(|stop| match stop {
        Some(stop) => stop.load(Ordering::Relaxed),
        None => is_interrupt_noted(),
    })
}

/// Returns true if Ctrl-C was pressed. Python notices it in its main thread only, and
/// any other thread gets false.
fn is_interrupted() -> bool {
    // The thread that started this work listens for signals and sets the flag.
    if is_stopped() || STOP.with_borrow(Option::is_some) {
        return is_stopped();
    }
    Python::attach(|py| match py.check_signals() {
        Ok(()) => false,
        Err(raised) => {
            note_interrupt(raised);
            true
        }
    })
}

/// Python thread that waits for calls (`brakecheck/_threads.py`).
struct PythonThread {
    questions: Sender<Question>,
    /// Its `threading.Thread`.
    thread: Py<PyAny>,
}

impl PythonThread {
    fn start() -> PyResult<PythonThread> {
        let (questions, receive) = channel();
        let mailbox = Mailbox {
            questions: Mutex::new(receive),
            hear: Mutex::new(None),
        };
        Python::attach(|py| {
            let threads = py.import("brakecheck._threads")?;
            let thread = threads.call_method1("start", (mailbox,))?.unbind();
            Ok(PythonThread { questions, thread })
        })
    }

    /// Ends its Python code as soon as the interpreter can, and returns its stack.
    fn abandon(&self) -> String {
        Python::attach(|py| {
            let threads = py.import("brakecheck._threads")?;
            threads.call_method1("abandon", (&self.thread,))?.extract()
        })
        .unwrap_or_default()
    }
}

impl Drop for PythonThread {
    fn drop(&mut self) {
        if EXITING.load(Ordering::Relaxed) {
            // Its end would be noticed: a copy that is never dropped keeps it asleep.
            std::mem::forget(self.questions.clone());
        }
    }
}

/// Keeps waiting Python threads asleep before the process exits.
#[pyfunction]
pub(crate) fn exit_threads() {
    EXITING.store(true, Ordering::Relaxed);
}

/// The end of a [`PythonThread`] that Python sees.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct Mailbox {
    questions: Mutex<Receiver<Question>>,
    hear: Mutex<Option<Hear>>,
}

#[pymethods]
impl Mailbox {
    /// Takes the result or exception of the last call, and waits for the next call.
    ///
    /// Returns a callable and its arguments, or None after the last call.
    fn exchange(
        &self,
        py: Python<'_>,
        returned: Bound<'_, PyAny>,
        raised: Option<Bound<'_, PyAny>>,
    ) -> Option<Call> {
        let received = self.hear.lock();
        if let Some(hear) = received.unwrap_or_else(PoisonError::into_inner).take() {
            hear(raised.map_or(Ok(returned), |raised| Err(PyErr::from_value(raised))));
        }
        loop {
            let question = py.detach(|| {
                let questions = self.questions.lock();
                let question = questions.unwrap_or_else(PoisonError::into_inner).recv();
                // `park` may return without a reason, so it is called in a loop.
                while EXITING.load(Ordering::Relaxed) {
                    std::thread::park();
                }
                question
            });
            let Question { ask, hear } = question.ok()?;
            match ask(py) {
                Ok(call) => {
                    let slot = self.hear.lock();
                    *slot.unwrap_or_else(PoisonError::into_inner) = Some(hear);
                    return Some(call);
                }
                Err(error) => hear(Err(error)),
            }
        }
    }
}
