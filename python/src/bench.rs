//! One test bench, played decision by decision from Python.

use std::sync::{Mutex, MutexGuard};

use brakecheck::rulebook::Verdict;
use brakecheck::scenario::Scenario;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::Scratch;
use brakecheck::testbench::{Aftermath, Testbench};
use brakecheck::trace::Trace;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::objects;
use crate::ego::check_interrupted;
use crate::error::wrong;
use crate::world::RawWorld;

/// What a stream of starts is for.
pub(crate) fn purpose_of(word: &str) -> PyResult<Purpose> {
    match word {
        "train" => Ok(Purpose::Train),
        "calibration" => Ok(Purpose::Calibration),
        "test" => Ok(Purpose::Test),
        other => Err(wrong(
            format!("`purpose={other:?}` is not known"),
            "known: train, calibration, test",
        )),
    }
}

/// A test bench and the episode on it.
pub(crate) struct Playing {
    pub(crate) bench: Testbench,
    noise: u64,
    start: Start,
    actions: Vec<usize>,
    scratch: Scratch,
}

impl Playing {
    pub(crate) fn new(world: &Scenario) -> Playing {
        Playing {
            bench: world.bench(),
            noise: 0,
            start: Start(Vec::new()),
            actions: Vec::new(),
            scratch: Scratch::new(),
        }
    }

    /// Begins the episode of a key.
    pub(crate) fn begin(&mut self, key: StartKey, aftermath: Aftermath) {
        let (start, noise) = (self.bench.draw(key), self.bench.noise_of(key));
        self.begin_at(start, noise, aftermath);
    }

    fn begin_at(&mut self, start: Start, noise: u64, aftermath: Aftermath) {
        (self.start, self.noise) = (start, noise);
        self.actions.clear();
        self.bench.begin(&self.start, noise, aftermath);
    }

    /// Takes a decision: the reward it is paid, and whether the episode ended
    /// as an episode does, and whether it ended in a fault.
    pub(crate) fn decide(&mut self, action: usize) -> (f64, bool, bool) {
        let before = self.bench.verdict();
        self.bench.decide(action);
        self.actions.push(action);
        let done = self.bench.is_done();
        // The reward is paid once, with the verdict.
        let fell = self.bench.verdict().filter(|_| before.is_none());
        let reward = fell.and_then(|verdict| self.bench.rulebook().reward_of(&verdict));
        let invalid = self.bench.verdict() == Some(Verdict::Invalid);
        (reward.unwrap_or(0.0), done && !invalid, done && invalid)
    }

    /// What there is to say of the episode so far.
    pub(crate) fn info<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = PyDict::new(py);
        let bench = &self.bench;
        info.set_item("decisions", bench.decisions())?;
        let samples = bench.trace().len().saturating_sub(1);
        info.set_item("time_s", samples as f64 * bench.clock().sample_s)?;
        let Some(verdict) = bench.verdict() else {
            return Ok(info);
        };
        let rulebook = bench.rulebook();
        info.set_item("verdict", verdict.word())?;
        info.set_item("is_success", verdict.is_success())?;
        let (trace, scratch) = (bench.trace(), &mut self.scratch);
        info.set_item("robustness", rulebook.spec.robustness(trace, scratch))?;
        let rules = PyDict::new(py);
        for rule in &rulebook.rules {
            rules.set_item(&rule.name, rule.monitor.robustness(trace, scratch))?;
        }
        info.set_item("rules", rules)?;
        let broken = match verdict {
            Verdict::Foul { rule, .. } => Some(rulebook.rules[rule].name.as_str()),
            _ => None,
        };
        info.set_item("broken_rule", broken)?;
        info.set_item("contact", objects(py, &bench.contact())?)?;
        info.set_item("fault", objects(py, &bench.fault())?)?;
        Ok(info)
    }
}

/// The samples of every signal, as arrays.
pub(crate) fn columns<'py>(py: Python<'py>, trace: &Trace) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let times = (0..trace.len()).map(|i| i as f64 * trace.dt_s());
    columns.set_item("time", PyArray1::from_iter(py, times))?;
    for (at, signal) in trace.schema().signals().iter().enumerate() {
        columns.set_item(&signal.name, PyArray1::from_slice(py, trace.column(at)))?;
    }
    Ok(columns)
}

/// A test bench; `brakecheck.Env` is built on it.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawBench {
    playing: Mutex<Playing>,
    observation: usize,
    actions: usize,
}

#[pymethods]
impl RawBench {
    #[new]
    fn new(world: &RawWorld) -> RawBench {
        let spaces = world.0.world().spaces();
        RawBench {
            observation: spaces.observation,
            actions: spaces.actions,
            playing: Mutex::new(Playing::new(&world.0)),
        }
    }

    /// Begins the `index`-th episode of a stream; its first observation.
    fn reset<'py>(
        &self,
        py: Python<'py>,
        key: (String, u64, u64),
        aftermath: bool,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (purpose, seed, index) = key;
        let purpose = purpose_of(&purpose)?;
        let key = StartKey {
            purpose,
            seed,
            index,
        };
        let mut playing = self.lock()?;
        playing.begin(key, after(aftermath));
        check_interrupted()?;
        self.observed(py, &playing)
    }

    /// Begins an episode from a start of one's own: a value per axis.
    fn reset_at<'py>(
        &self,
        py: Python<'py>,
        start: Vec<f64>,
        noise: u64,
        aftermath: bool,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let mut playing = self.lock()?;
        let axes = playing.bench.axes();
        if axes.len() != start.len() {
            let names: Vec<_> = axes.iter().map(|axis| axis.name.as_str()).collect();
            return Err(wrong(
                format!("{} values are no start of {} axes", start.len(), axes.len()),
                format!("give one for each of: {}", names.join(", ")),
            ));
        }
        for (axis, value) in axes.iter().zip(&start) {
            if !(axis.lo..=axis.hi).contains(value) {
                return Err(wrong(
                    format!("the start's `{}` is {value} {}", axis.name, axis.unit),
                    format!("it lies from {} to {} in this world", axis.lo, axis.hi),
                ));
            }
        }
        playing.begin_at(Start(start), noise, after(aftermath));
        check_interrupted()?;
        self.observed(py, &playing)
    }

    /// Takes one joint action: observation, reward, terminated, truncated.
    fn step<'py>(
        &self,
        py: Python<'py>,
        action: usize,
    ) -> PyResult<(Bound<'py, PyArray1<f32>>, f64, bool, bool)> {
        let mut playing = self.lock()?;
        if self.actions <= action {
            return Err(wrong(
                format!("{action} is no action of {}", self.actions),
                format!("actions are 0 to {}", self.actions - 1),
            ));
        }
        if playing.bench.trace().is_empty() || playing.bench.is_done() {
            return Err(wrong(
                "there is no episode to go on with",
                "call `reset` before the first step and after the last one",
            ));
        }
        let episode = &mut *playing;
        let (reward, terminated, truncated) = py.detach(|| episode.decide(action));
        check_interrupted()?;
        Ok((self.observed(py, &playing)?, reward, terminated, truncated))
    }

    /// What there is to say of the episode so far.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.lock()?.info(py)
    }

    /// The samples so far, by signal.
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, self.lock()?.bench.trace())
    }

    /// Start, noise and joint actions: what it takes to play it again.
    fn played(&self) -> PyResult<(Vec<f64>, u64, Vec<usize>)> {
        let playing = self.lock()?;
        Ok((
            playing.start.0.clone(),
            playing.noise,
            playing.actions.clone(),
        ))
    }
}

fn after(aftermath: bool) -> Aftermath {
    match aftermath {
        true => Aftermath::Play,
        false => Aftermath::Skip,
    }
}

impl RawBench {
    /// Never waits: whoever holds it may be waiting for the interpreter.
    fn lock(&self) -> PyResult<MutexGuard<'_, Playing>> {
        self.playing.try_lock().map_err(|_| {
            wrong(
                "another thread plays in this environment",
                "make one environment per thread",
            )
        })
    }

    fn observed<'py>(
        &self,
        py: Python<'py>,
        playing: &Playing,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let obs = PyArray1::<f32>::zeros(py, self.observation, false);
        {
            let mut written = obs.readwrite();
            playing.bench.observe(written.as_slice_mut()?);
        }
        Ok(obs)
    }
}
