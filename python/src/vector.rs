//! Many test benches at once, on buffers that Python owns.

use std::sync::{Mutex, MutexGuard};

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::Aftermath;
use numpy::{PyReadonlyArray1, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::bench::{Playing, columns, purpose_of};
use crate::ego::check_interrupted;
use crate::error::{raised, wrong};
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
    /// Its episode is over: its next step begins another one.
    is_over: bool,
}

impl Slot {
    fn begin(&mut self, purpose: Purpose) {
        let key = StartKey {
            purpose,
            seed: self.seed,
            index: self.index,
        };
        self.index += 1;
        self.is_over = false;
        self.playing.begin(key, Aftermath::Skip);
    }
}

struct Slots {
    all: Vec<Slot>,
    purpose: Purpose,
    pool: Option<rayon::ThreadPool>,
}

/// Test benches that are stepped together; `brakecheck.VectorEnv` is built on it.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawVector {
    slots: Mutex<Slots>,
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
    fn new(world: &RawWorld, count: usize, jobs: usize) -> PyResult<RawVector> {
        let spaces = world.0.world().spaces();
        let slot = |_| Slot {
            playing: Playing::new(&world.0),
            seed: 0,
            index: 0,
            is_over: true,
        };
        let pool = (jobs != 1).then(|| rayon::ThreadPoolBuilder::new().num_threads(jobs).build());
        let pool = pool.transpose();
        Ok(RawVector {
            slots: Mutex::new(Slots {
                all: (0..count).map(slot).collect(),
                purpose: Purpose::Train,
                pool: pool.map_err(|error| raised("FaultError", error.to_string()))?,
            }),
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
        let mut slots = self.lock()?;
        slots.purpose = purpose_of(purpose)?;
        let purpose = slots.purpose;
        if let Some(seeds) = seeds {
            for (slot, seed) in slots.all.iter_mut().zip(seeds) {
                (slot.seed, slot.index) = (seed, 0);
            }
        }
        let rows = obs.as_slice_mut()?;
        self.fits(rows.len() == slots.all.len() * self.observation)?;
        let all = &mut slots.all;
        py.detach(|| {
            let rows = rows.chunks_mut(self.observation);
            for (slot, row) in all.iter_mut().zip(rows) {
                slot.begin(purpose);
                slot.playing.bench.observe(row);
            }
        });
        check_interrupted()
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
        let actions = actions.as_slice()?;
        if let Some(wrong_one) = actions.iter().find(|a| !(0..self.actions).contains(*a)) {
            return Err(wrong(
                format!("{wrong_one} is no action of {}", self.actions),
                format!("actions are 0 to {}", self.actions - 1),
            ));
        }
        let mut slots = self.lock()?;
        let count = slots.all.len();
        let (obs, rewards) = (obs.as_slice_mut()?, rewards.as_slice_mut()?);
        let (terminated, truncated) = (terminated.as_slice_mut()?, truncated.as_slice_mut()?);
        let lengths = [
            actions.len(),
            rewards.len(),
            terminated.len(),
            truncated.len(),
        ];
        let fits = lengths == [count; 4] && obs.len() == count * self.observation;
        self.fits(fits)?;
        let Slots { all, purpose, pool } = &mut *slots;
        let (purpose, width) = (*purpose, self.observation);
        let one = |slot: &mut Slot, action: i64, row: &mut [f32]| {
            let ended = match slot.is_over {
                true => {
                    slot.begin(purpose);
                    (0.0, false, false)
                }
                false => slot.playing.decide(action as usize),
            };
            slot.is_over = ended.1 || ended.2;
            slot.playing.bench.observe(row);
            ended
        };
        let outs = rewards.iter_mut().zip(terminated).zip(truncated);
        let mut work: Vec<_> = all
            .iter_mut()
            .zip(actions)
            .zip(obs.chunks_mut(width))
            .zip(outs)
            .collect();
        type Work<'a> = (
            ((&'a mut Slot, &'a i64), &'a mut [f32]),
            ((&'a mut f64, &'a mut bool), &'a mut bool),
        );
        let play = |(((slot, action), row), ((reward, over), cut)): &mut Work<'_>| {
            (**reward, **over, **cut) = one(slot, **action, row);
        };
        py.detach(|| match pool {
            Some(pool) => pool.install(|| work.par_iter_mut().with_min_len(SHARE).for_each(play)),
            None => work.iter_mut().for_each(play),
        });
        drop(work);
        check_interrupted()?;
        let over = slots.all.iter().enumerate();
        Ok(over
            .filter(|(_, slot)| slot.is_over)
            .map(|(i, _)| i)
            .collect())
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
        match fits {
            true => Ok(()),
            false => Err(wrong(
                "the buffers are of another size",
                "one entry per environment, and of observations one row",
            )),
        }
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Slots>> {
        self.slots.try_lock().map_err(|_| {
            wrong(
                "another thread plays in these environments",
                "make one vector environment per thread",
            )
        })
    }
}
