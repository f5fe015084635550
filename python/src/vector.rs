//! Many environments at once, on buffers that Python owns.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard};

use brakecheck::seed::Purpose;
use brakecheck::vector_env::{EnvLayout, VectorEnv};
use brakecheck::world::Scenario;
use numpy::{PyArray3, PyReadonlyArray1, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::bench::{columns, in_use, no_action, purpose_of, rgb};
use crate::error::{raised, wrong};
use crate::interrupt::check_interrupted;
use crate::python_thread::stopped_by;
use crate::vector_group::{Group, RawEpisode};
use crate::watch::interruptible;
use crate::world::RawWorld;

/// Least number of environments that a thread takes at a time. Fewer are not worth
/// the way to another thread.
const SHARE: usize = 64;

struct Groups {
    all: Vec<Group>,
    purpose: Purpose,
    pool: Option<rayon::ThreadPool>,
}

impl Groups {
    /// Does `work` in each, in the existing threads.
    fn each(&mut self, stop: &Arc<AtomicBool>, work: &(impl Fn(usize, &mut Group) + Sync)) {
        let all = &mut self.all;
        match &self.pool {
            Some(pool) => pool.install(|| {
                let all = all.par_iter_mut().enumerate();
                all.for_each(|(at, group)| stopped_by(stop, || work(at, group)));
            }),
            None => all.iter_mut().enumerate().for_each(|(at, it)| work(at, it)),
        }
    }

    fn at(&mut self, at: usize) -> PyResult<(&mut Group, usize)> {
        let (group, within) = (self.all.get_mut(at / SHARE), at % SHARE);
        group
            .filter(|group| within < group.len())
            .map(|group| (group, within))
            .ok_or_else(|| wrong(format!("there is no environment {at}"), "count from 0"))
    }
}

/// Environments of `brakecheck.VectorEnv`, which step together.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawVector {
    groups: Arc<Mutex<Groups>>,
    world: Arc<Scenario>,
    count: usize,
    /// Set if other threads or a program play, so that this thread does not notice Ctrl-C.
    waits: bool,
    actions: usize,
    observation: usize,
}

/// A buffer per quantity, with an entry or row per environment.
type Buffers<'py> = (
    PyReadwriteArray2<'py, f32>,
    PyReadwriteArray1<'py, f64>,
    PyReadwriteArray1<'py, bool>,
    PyReadwriteArray1<'py, bool>,
);

#[pymethods]
impl RawVector {
    /// Makes `jobs` threads. With 1 the calling thread steps.
    #[new]
    fn new(py: Python<'_>, world: &RawWorld, count: usize, jobs: usize) -> PyResult<RawVector> {
        let world = Arc::new(world.0.clone());
        let spaces = world.world().spaces();
        // A single environment shows the layout, which depends on the world only.
        let in_lanes = VectorEnv::new(&world, 1).layout() == EnvLayout::Lanes;
        let group = |first| Group::new(&world, in_lanes, SHARE.min(count - first));
        let all = py.detach(|| (0..count).step_by(SHARE).map(group).collect());
        check_interrupted()?;
        let pool = (jobs != 1)
            .then(|| rayon::ThreadPoolBuilder::new().num_threads(jobs).build())
            .transpose()
            .map_err(|error| raised("FaultError", error.to_string()))?;
        Ok(RawVector {
            waits: pool.is_some() || world.program().is_some(),
            groups: Arc::new(Mutex::new(Groups {
                all,
                purpose: Purpose::Train,
                pool,
            })),
            actions: spaces.actions,
            observation: spaces.observation,
            world,
            count,
        })
    }

    /// Begins an episode in each. With seeds every stream begins anew, and without
    /// seeds it continues.
    fn reset(
        &self,
        py: Python<'_>,
        purpose: &str,
        seeds: Option<Vec<u64>>,
        mut obs: PyReadwriteArray2<'_, f32>,
    ) -> PyResult<()> {
        let purpose = purpose_of(purpose)?;
        let rows = obs.as_slice_mut()?;
        self.fits(rows.len() == self.count * self.observation)?;
        let mut groups = self.lock()?;
        groups.purpose = purpose;
        if let Some(seeds) = seeds {
            for (group, seeds) in groups.all.iter_mut().zip(seeds.chunks(SHARE)) {
                group.seed(seeds);
            }
        }
        drop(groups);
        self.play(py, move |_, group| group.begin_all(purpose))?;
        let rows = rows.chunks_mut(SHARE * self.observation);
        for (group, rows) in self.lock()?.all.iter().zip(rows) {
            rows.copy_from_slice(group.observations());
        }
        Ok(())
    }

    /// Takes a joint action in each, and returns the environments whose episodes ended.
    ///
    /// An environment whose episode is over begins another episode instead, without a
    /// reward.
    fn step(
        &self,
        py: Python<'_>,
        actions: PyReadonlyArray1<'_, i64>,
        buffers: Buffers<'_>,
    ) -> PyResult<Vec<usize>> {
        let (mut obs, mut rewards, mut terminated, mut truncated) = buffers;
        // Copied, because the work may go on in another thread after Ctrl-C, while Python
        // frees the array.
        let actions = actions.as_slice()?.to_vec();
        let is_action = |action: &i64| usize::try_from(*action).is_ok_and(|it| it < self.actions);
        // All actions are checked before any environment steps, so a refusal changes
        // none.
        if let Some(action) = actions.iter().find(|action| !is_action(action)) {
            return Err(no_action(action, self.actions));
        }
        let (obs, rewards) = (obs.as_slice_mut()?, rewards.as_slice_mut()?);
        let (terminated, truncated) = (terminated.as_slice_mut()?, truncated.as_slice_mut()?);
        let purpose = self.lock()?.purpose;
        let lengths = [
            actions.len(),
            rewards.len(),
            terminated.len(),
            truncated.len(),
        ];
        // Checked before the step, so that a wrong buffer changes no environment.
        let fits = lengths == [self.count; 4] && obs.len() == self.count * self.observation;
        self.fits(fits)?;
        self.play(py, move |at, group| {
            let first = at * SHARE;
            group.step(&actions[first..][..group.len()], purpose);
        })?;
        let mut over = Vec::new();
        // Results are copied after all groups have stepped, so an interrupted step
        // changes no buffer.
        let rows = obs.chunks_mut(SHARE * self.observation);
        for ((i, group), rows) in self.lock()?.all.iter().enumerate().zip(rows) {
            rows.copy_from_slice(group.observations());
            for (at, (reward, ended, faulty)) in group.results().enumerate() {
                let at = i * SHARE + at;
                (rewards[at], terminated[at], truncated[at]) = (reward, ended, faulty);
                if ended || faulty {
                    over.push(at);
                }
            }
        }
        Ok(over)
    }

    /// Returns verdict, success, robustness and number of decisions of ended episodes.
    fn ended(&self, over: Vec<usize>) -> PyResult<Vec<(&'static str, bool, f64, usize)>> {
        let mut groups = self.lock()?;
        let ended = over.into_iter().map(|at| {
            let (group, at) = groups.at(at)?;
            Ok(group.ended(at))
        });
        ended.collect()
    }

    /// Returns the episodes in some of them: an episode to play again on demand, or its
    /// info.
    fn episodes(&self, py: Python<'_>, over: Vec<usize>) -> PyResult<Vec<Py<PyAny>>> {
        let mut groups = self.lock()?;
        let episodes = over.into_iter().map(|at| {
            let (group, at) = groups.at(at)?;
            match group {
                Group::Benches(slots) => Ok(slots.info(py, at)?.into_any().unbind()),
                Group::Lanes(lanes) => {
                    let episode = RawEpisode::of(&self.world, lanes, at);
                    Ok(Py::new(py, episode)?.into_any())
                }
            }
        });
        episodes.collect()
    }

    /// Returns the info of the episode in an environment.
    fn info<'py>(&self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyDict>> {
        let mut groups = self.lock()?;
        let (group, at) = groups.at(at)?;
        match group {
            Group::Benches(slots) => slots.info(py, at),
            Group::Lanes(lanes) => RawEpisode::of(&self.world, lanes, at).info(py),
        }
    }

    /// Returns the samples of the episode in an environment, by signal.
    fn trace<'py>(&self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyDict>> {
        let mut groups = self.lock()?;
        let (group, at) = groups.at(at)?;
        match group {
            Group::Benches(slots) => columns(py, slots.playing(at).bench.trace()),
            Group::Lanes(lanes) => {
                let again = RawEpisode::of(&self.world, lanes, at).played();
                columns(py, again.bench.trace())
            }
        }
    }

    /// Draws the current sample of an environment from above, `[height, width, 3]`.
    fn render<'py>(&self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let mut groups = self.lock()?;
        let (group, at) = groups.at(at)?;
        let drawn = match group {
            Group::Benches(slots) => slots.playing(at).pixels(&self.world),
            Group::Lanes(lanes) => {
                let episode = RawEpisode::of(&self.world, lanes, at);
                episode.played().pixels(&self.world)
            }
        };
        rgb(py, drawn)
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
        work: impl Fn(usize, &mut Group) + Send + Sync + 'static,
    ) -> PyResult<()> {
        if self.waits {
            let groups = self.groups.clone();
            let play = move |stop: &Arc<AtomicBool>| {
                let groups = groups.try_lock().ok();
                groups.map(|mut groups| groups.each(stop, &work))
            };
            let played = interruptible(py, play, |_| Ok(()))?;
            played.ok_or_else(|| in_use("these environments"))?;
        } else {
            let mut locked = self.lock()?;
            let groups = &mut *locked;
            py.detach(|| groups.each(&Arc::default(), &work));
        }
        check_interrupted()
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Groups>> {
        let groups = self.groups.try_lock();
        groups.map_err(|_| in_use("these environments"))
    }
}
