//! Environments of a vector that a thread steps at a time.

use std::sync::Arc;

use brakecheck::rl::End;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::Aftermath;
use brakecheck::vector_env::VectorEnv;
use brakecheck::world::Scenario;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::bench::Playing;

/// Environments in a structure of arrays, or on a test bench each.
pub(crate) enum Group {
    Lanes(Box<Lanes>),
    Benches(Slots),
}

/// Reward of a step, and two flags: the end of an episode, and its end by a fault.
type StepResult = (f64, bool, bool);

/// Stream of starts of an environment.
#[derive(Clone, Default)]
struct Stream {
    seed: u64,
    /// The episode that the next reset begins.
    index: u64,
}

impl Stream {
    fn next(&mut self, purpose: Purpose) -> StartKey {
        let Stream { seed, index } = *self;
        self.index += 1;
        StartKey {
            purpose,
            seed,
            index,
        }
    }
}

impl Group {
    pub(crate) fn new(world: &Scenario, in_lanes: bool, count: usize) -> Group {
        if in_lanes {
            Group::Lanes(Box::new(Lanes::new(world, count)))
        } else {
            Group::Benches(Slots::new(world, count))
        }
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Group::Lanes(lanes) => lanes.env.len(),
            Group::Benches(slots) => slots.all.len(),
        }
    }

    /// Begins the streams of these seeds, one per environment.
    pub(crate) fn seed(&mut self, seeds: &[u64]) {
        let streams: Vec<&mut Stream> = match self {
            Group::Lanes(lanes) => lanes.streams.iter_mut().collect(),
            Group::Benches(slots) => slots.all.iter_mut().map(|it| &mut it.stream).collect(),
        };
        for (stream, seed) in streams.into_iter().zip(seeds) {
            *stream = Stream {
                seed: *seed,
                index: 0,
            };
        }
    }

    /// Begins the next episode of every stream.
    pub(crate) fn begin_all(&mut self, purpose: Purpose) {
        match self {
            Group::Lanes(lanes) => (0..lanes.env.len()).for_each(|at| lanes.begin(at, purpose)),
            Group::Benches(slots) => {
                let rows = slots.observations.chunks_mut(slots.width);
                let slots = slots.all.iter_mut().zip(rows);
                slots.for_each(|(slot, row)| slot.begin(purpose, row));
            }
        }
    }

    /// Takes a joint action in each, or begins the next episode after an end.
    pub(crate) fn step(&mut self, actions: &[i64], purpose: Purpose) {
        match self {
            Group::Lanes(lanes) => lanes.step(actions, purpose),
            Group::Benches(slots) => slots.step(actions, purpose),
        }
    }

    /// Returns the latest observations, row by row.
    pub(crate) fn observations(&self) -> &[f32] {
        match self {
            Group::Lanes(lanes) => &lanes.observations,
            Group::Benches(slots) => &slots.observations,
        }
    }

    pub(crate) fn results(&self) -> Box<dyn Iterator<Item = StepResult> + '_> {
        match self {
            Group::Lanes(lanes) => Box::new(lanes.results()),
            Group::Benches(slots) => Box::new(slots.all.iter().map(|slot| slot.result)),
        }
    }

    /// Returns verdict, success, robustness and number of decisions of an ended episode.
    pub(crate) fn ended(&mut self, at: usize) -> (&'static str, bool, f64, usize) {
        match self {
            Group::Lanes(lanes) => lanes.ended(at),
            Group::Benches(slots) => slots.all[at].playing.ended(),
        }
    }
}

/// Environments in a structure of arrays.
pub(crate) struct Lanes {
    env: VectorEnv,
    streams: Vec<Stream>,
    observations: Vec<f32>,
    rewards: Vec<f64>,
    ends: Vec<Option<End>>,
    actions: Vec<usize>,
}

impl Lanes {
    fn new(world: &Scenario, count: usize) -> Lanes {
        let env = VectorEnv::new(world, count);
        Lanes {
            streams: vec![Stream::default(); count],
            observations: vec![0.0; count * env.spaces().observation],
            rewards: vec![0.0; count],
            ends: vec![None; count],
            actions: vec![0; count],
            env,
        }
    }

    fn begin(&mut self, at: usize, purpose: Purpose) {
        let width = self.env.spaces().observation;
        let row = &mut self.observations[at * width..][..width];
        let key = self.streams[at].next(purpose);
        self.env.begin(at, key, row);
        (self.rewards[at], self.ends[at]) = (0.0, None);
    }

    fn step(&mut self, actions: &[i64], purpose: Purpose) {
        for (to, action) in self.actions.iter_mut().zip(actions) {
            // The caller has checked all actions, so none is negative.
            *to = *action as usize;
        }
        // The step leaves those alone whose episode was over before it.
        let over: Vec<usize> = (0..actions.len())
            .filter(|at| self.env.is_over(*at))
            .collect();
        // As `Env` has it: what the start decides is paid to no action.
        let decided: Vec<usize> = (0..actions.len())
            .filter(|at| self.env.verdict(*at).is_some())
            .collect();
        let (rewards, ends) = (&mut self.rewards, &mut self.ends);
        self.env
            .step(&self.actions, &mut self.observations, rewards, ends);
        decided.into_iter().for_each(|at| self.rewards[at] = 0.0);
        over.into_iter().for_each(|at| self.begin(at, purpose));
    }

    fn results(&self) -> impl Iterator<Item = StepResult> {
        let all = self.rewards.iter().zip(&self.ends);
        all.map(|(reward, end)| {
            let is_fault = *end == Some(End::Aborted);
            (*reward, *end == Some(End::Terminated), is_fault)
        })
    }

    fn ended(&self, at: usize) -> (&'static str, bool, f64, usize) {
        let decisions = self.env.played(at).map_or(0, |(_, actions)| actions.len());
        let (word, success) = match self.env.verdict(at) {
            Some(verdict) => (verdict.word(), verdict.is_success()),
            None => ("", false),
        };
        (word, success, self.env.robustness(at), decisions)
    }
}

/// Environments on a test bench each.
pub(crate) struct Slots {
    all: Vec<Slot>,
    observations: Vec<f32>,
    width: usize,
}

struct Slot {
    playing: Playing,
    stream: Stream,
    result: StepResult,
}

impl Slot {
    fn begin(&mut self, purpose: Purpose, row: &mut [f32]) {
        let key = self.stream.next(purpose);
        // A learner needs the verdict only, so the motion after it is not computed.
        self.playing.begin(key, Aftermath::Skip);
        self.result = (0.0, false, false);
        self.playing.bench.observe(row);
    }
}

impl Slots {
    fn new(world: &Scenario, count: usize) -> Slots {
        let width = world.world().spaces().observation;
        let slot = |_| Slot {
            playing: Playing::new(world),
            stream: Stream::default(),
            // The first step begins an episode.
            result: (0.0, true, false),
        };
        Slots {
            all: (0..count).map(slot).collect(),
            observations: vec![0.0; count * width],
            width,
        }
    }

    fn step(&mut self, actions: &[i64], purpose: Purpose) {
        let rows = self.observations.chunks_mut(self.width);
        for ((slot, row), action) in self.all.iter_mut().zip(rows).zip(actions) {
            let (_, ended, faulty) = slot.result;
            if ended || faulty {
                slot.begin(purpose, row);
                continue;
            }
            slot.result = slot.playing.decide(*action as usize);
            slot.playing.bench.observe(row);
        }
    }

    pub(crate) fn info<'py>(&mut self, py: Python<'py>, at: usize) -> PyResult<Bound<'py, PyDict>> {
        self.all[at].playing.info(py)
    }

    pub(crate) fn playing(&self, at: usize) -> &Playing {
        &self.all[at].playing
    }
}

/// Episode of a structure of arrays. Playing it again gives its info.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawEpisode {
    world: Arc<Scenario>,
    key: Option<StartKey>,
    actions: Vec<u32>,
}

impl RawEpisode {
    pub(crate) fn of(world: &Arc<Scenario>, lanes: &Lanes, at: usize) -> RawEpisode {
        let played = lanes.env.played(at);
        RawEpisode {
            world: Arc::clone(world),
            key: played.map(|(key, _)| key),
            actions: played
                // Copied, because the next step begins another episode in this place.
                .map(|(_, actions)| actions.to_vec())
                .unwrap_or_default(),
        }
    }
}

impl RawEpisode {
    /// Plays it again, up to its end.
    pub(crate) fn played(&self) -> Playing {
        let mut playing = Playing::new(&self.world);
        if let Some(key) = self.key {
            playing.begin(key, Aftermath::Skip);
        }
        for action in &self.actions {
            // Lanes keep no trace, and the same key and actions give the same bits on a
            // bench.
            playing.decide(*action as usize);
        }
        playing
    }
}

#[pymethods]
impl RawEpisode {
    /// Returns its info.
    pub(crate) fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.played().info(py)
    }
}
