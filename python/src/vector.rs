//! Many test benches at once, on buffers that Python owns.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard};

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::Aftermath;
use numpy::{PyReadonlyArray1, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::bench::{Playing, columns, in_use, purpose_of};
use crate::error::{raised, wrong};
use crate::interrupt::check_interrupted;
use crate::python_thread::stopped_by;
use crate::watch::interruptible;
use crate::world::RawWorld;

/// Environments that one thread takes at a time, at least: fewer are not worth
/// the way to another thread.
const SHARE: usize = 64;

/// One of them.
struct Slot {
    playing: Playing,
    seed: u64,
    /// The episode that the next reset begins.
    index: u64,
    /// The latest observation.
    obs: Vec<f32>,
    reward: f64,
    terminated: bool,
    truncated: bool,
}

impl Slot {
    fn new(world: &RawWorld, observation: usize) -> Slot {
        Slot {
            playing: Playing::new(&world.0),
            seed: 0,
            index: 0,
            obs: vec![0.0; observation],
            reward: 0.0,
            // The first step begins an episode.
            terminated: true,
            truncated: false,
        }
    }

    fn begin(&mut self, purpose: Purpose) {
        let key = StartKey {
            purpose,
            seed: self.seed,
            index: self.index,
        };
        self.index += 1;
        self.playing.begin(key, Aftermath::Skip);
        (self.reward, self.terminated, self.truncated) = (0.0, false, false);
        self.playing.bench.observe(&mut self.obs);
    }

    /// Takes a joint action, or begins the next episode if one is over.
    fn step(&mut self, action: usize, purpose: Purpose) {
        if self.is_over() {
            return self.begin(purpose);
        }
        (self.reward, self.terminated, self.truncated) = self.playing.decide(action);
        self.playing.bench.observe(&mut self.obs);
    }

    fn is_over(&self) -> bool {
        self.terminated || self.truncated
    }
}

struct Slots {
    all: Vec<Slot>,
    purpose: Purpose,
    pool: Option<rayon::ThreadPool>,
}

impl Slots {
    /// Does `work` in each, in the threads there are.
    fn each(&mut self, stop: &Arc<AtomicBool>, work: &(impl Fn(usize, &mut Slot) + Sync)) {
        let all = &mut self.all;
        match &self.pool {
            Some(pool) => pool.install(|| {
                let all = all.par_iter_mut().enumerate().with_min_len(SHARE);
                all.for_each(|(at, slot)| stopped_by(stop, || work(at, slot)));
            }),
            None => all.iter_mut().enumerate().for_each(|(at, it)| work(at, it)),
        }
    }
}

/// Test benches that are stepped together; `brakecheck.VectorEnv` is built on it.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawVector {
    slots: Arc<Mutex<Slots>>,
    /// This thread does not hear of Ctrl-C by itself: other threads play, or a program.
    waits: bool,
    actions: i64,
    observation: usize,
}

/// A buffer per quantity, one entry or row per environment.
type Buffers<'py> = (
    PyReadwriteArray2<'py, f32>,
    PyReadwriteArray1<'py, f64>,
    PyReadwriteArray1<'py, bool>,
    PyReadwriteArray1<'py, bool>,
);

#[pymethods]
impl RawVector {
    /// `jobs` threads; 1: the one that calls.
    #[new]
    fn new(py: Python<'_>, world: &RawWorld, count: usize, jobs: usize) -> PyResult<RawVector> {
        let spaces = world.0.world().spaces();
        let slot = |_| Slot::new(world, spaces.observation);
        let all = py.detach(|| (0..count).map(slot).collect());
        check_interrupted()?;
        let pool = (jobs != 1).then(|| rayon::ThreadPoolBuilder::new().num_threads(jobs).build());
        let pool = pool.transpose();
        let pool = pool.map_err(|error| raised("FaultError", error.to_string()))?;
        Ok(RawVector {
            waits: pool.is_some() || world.0.program().is_some(),
            slots: Arc::new(Mutex::new(Slots {
                all,
                purpose: Purpose::Train,
                pool,
            })),
            actions: spaces.actions as i64,
            observation: spaces.observation,
        })
    }

    /// Begins an episode in each: of its own stream from the start, where seeds
    /// are given, else the next one of its stream.
    fn reset(
        &self,
        py: Python<'_>,
        purpose: &str,
        seeds: Option<Vec<u64>>,
        mut obs: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
        let purpose = purpose_of(purpose)?;
        let mut slots = self.lock()?;
        slots.purpose = purpose;
        if let Some(seeds) = seeds {
            for (slot, seed) in slots.all.iter_mut().zip(seeds) {
                (slot.seed, slot.index) = (seed, 0);
            }
        }
        let rows = obs.as_slice_mut()?;
        self.fits(rows.len() == slots.all.len() * self.observation)?;
        drop(slots);
        self.play(py, move |_, slot| slot.begin(purpose))?;
        for (slot, row) in self
            .lock()?
            .all
            .iter()
            .zip(rows.chunks_mut(self.observation))
        {
            row.copy_from_slice(&slot.obs);
        }
        Ok(())
    }

    /// Takes one joint action in each; those whose episode is over begin the
    /// next one instead, and are paid nothing. Which ones ended.
    fn step(
        &self,
        py: Python<'_>,
        actions: PyReadonlyArray1<'_, i64>,
        buffers: Buffers<'_>,
    ) -> PyResult<Vec<usize>> {
        let (mut obs, mut rewards, mut terminated, mut truncated) = buffers;
        let actions = actions.as_slice()?.to_vec();
        if let Some(wrong_one) = actions.iter().find(|a| !(0..self.actions).contains(*a)) {
            return Err(wrong(
                format!("{wrong_one} is no action of {}", self.actions),
                format!("actions are 0 to {}", self.actions - 1),
            ));
        }
        let (obs, rewards) = (obs.as_slice_mut()?, rewards.as_slice_mut()?);
        let (terminated, truncated) = (terminated.as_slice_mut()?, truncated.as_slice_mut()?);
        let slots = self.lock()?;
        let (count, purpose) = (slots.all.len(), slots.purpose);
        drop(slots);
        let lengths = [
            actions.len(),
            rewards.len(),
            terminated.len(),
            truncated.len(),
        ];
        let fits = lengths == [count; 4] && obs.len() == count * self.observation;
        self.fits(fits)?;
        self.play(py, move |at, slot| slot.step(actions[at] as usize, purpose))?;
        let mut over = Vec::new();
        let rows = obs.chunks_mut(self.observation);
        for ((at, slot), row) in self.lock()?.all.iter().enumerate().zip(rows) {
            row.copy_from_slice(&slot.obs);
            rewards[at] = slot.reward;
            (terminated[at], truncated[at]) = (slot.terminated, slot.truncated);
            if slot.is_over() {
                over.push(at);
            }
        }
        Ok(over)
    }

    /// What there is to say of the episode in one of them.
    fn info<'py>(&self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyDict>> {
        let mut slots = self.lock()?;
        match slots.all.get_mut(at) {
            Some(slot) => slot.playing.info(py),
            None => Err(wrong(
                format!("there is no environment {at}"),
                "count from 0",
            )),
        }
    }

    /// The samples of the episode in one of them, by signal.
    fn trace<'py>(&self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyDict>> {
        match self.lock()?.all.get(at) {
            Some(slot) => columns(py, slot.playing.bench.trace()),
            None => Err(wrong(
                format!("there is no environment {at}"),
                "count from 0",
            )),
        }
    }
}

impl RawVector {
    fn fits(&self, fits: bool) -> PyResult<()> {
        if fits {
            Ok(())
        } else {
            Err(wrong(
                "the buffers are of another size",
                "one entry per environment, and of observations one row",
            ))
        }
    }

    /// Plays without the lock of the interpreter, until Ctrl-C at most.
    fn play(
        &self,
        py: Python<'_>,
        work: impl Fn(usize, &mut Slot) + Send + Sync + 'static,
    ) -> PyResult<()> {
        if self.waits {
            let slots = self.slots.clone();
            let play = move |stop: &Arc<AtomicBool>| {
                let slots = slots.try_lock().ok();
                slots.map(|mut slots| slots.each(stop, &work))
            };
            let played = interruptible(py, play, |_| Ok(()))?;
            played.ok_or_else(|| in_use("these environments"))?;
        } else {
            let mut slots = self.lock()?;
            let slots = &mut *slots;
            py.detach(|| slots.each(&Arc::default(), &work));
        }
        check_interrupted()
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Slots>> {
        let slots = self.slots.try_lock();
        slots.map_err(|_| in_use("these environments"))
    }
}
