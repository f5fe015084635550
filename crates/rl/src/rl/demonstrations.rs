//! Demonstrated and discovered successes, for deep Q-learning.
//!
//! - Hester et al., "Deep Q-learning from Demonstrations", AAAI 2018: part of
//!   every batch comes from demonstrations. On that part a large-margin loss
//!   raises the demonstrated action above the others.
//! - Salimans and Chen, "Learning Montezuma's Revenge from a Single
//!   Demonstration", 2018: episodes that begin along a demonstration.
//!
//! Deviations: docs/background/learners.md.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bundle::{BundleError, TensorFile};
use super::dice::LearnerRng;
use super::learner::{ConfigError, Demonstration, EpisodePlan, within};
use super::replay::{Batch, EpisodeBuffer, ReplayBuffer, Tail, check};
use super::starts::{EpisodeStart, StartPool};

/// Use of demonstrations by a learner.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Imitation {
    /// Share of every batch drawn from successes alone (0.25).
    pub share: f64,
    /// Margin by which the action of a success should exceed the others (0.1).
    pub margin: f64,
    /// Weight of the margin loss beside the temporal-difference error (0.02).
    ///
    /// A larger weight only imitates.
    pub weight: f64,
    /// Share of the episodes that begin along a success (0.2).
    ///
    /// Half of them begin from the success's own start, half from another start.
    pub(crate) guided: f64,
    /// Number of recent successes kept for guidance (5000).
    pub(crate) remembered: usize,
}

impl Default for Imitation {
    fn default() -> Self {
        Imitation {
            share: 0.25,
            margin: 0.1,
            weight: 0.02,
            guided: 0.2,
            remembered: 5000,
        }
    }
}

impl Imitation {
    /// Refuses the first number out of range.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        // At most 0.9, so that every batch still has transitions of the training
        // itself.
        within("share", self.share, 0.0, 0.9)?;
        within("margin", self.margin, 0.0, 10.0)?;
        within("weight", self.weight, 0.0, 10.0)?;
        within("guided", self.guided, 0.0, 1.0)?;
        within("remembered", self.remembered as f64, 1.0, 1e9)
    }
}

/// Successes, as transitions to learn from and as beginnings to follow.
pub(super) struct Demonstrations {
    imitation: Imitation,
    replay: ReplayBuffer,
    /// Transitions of a batch that came from here.
    drawn: Batch,
    guides: GuideMemory,
}

/// Recent successes along which episodes begin.
pub(super) struct GuideMemory {
    /// Share of the episodes that begin along a success.
    guided: f64,
    /// Greatest number of successes.
    capacity: usize,
    episodes: Vec<Demonstration>,
    /// Slot of the next episode once the memory is full.
    oldest: usize,
}

/// Beginning of a guided episode.
struct Guide {
    /// Start of the demonstration, `None` for any other start.
    index: Option<u64>,
    actions: Vec<usize>,
}

/// Returns the beginning of the next episode: along a success, or from a start of the pool.
pub(super) fn plan(
    guides: Option<&GuideMemory>,
    starts: &mut StartPool,
    dice: &mut LearnerRng,
) -> EpisodePlan {
    // The guide is drawn before the start, since it may replace the start.
    let guide = guides.and_then(|guides| guides.guide(dice));
    let start = match guide.as_ref().and_then(|guide| guide.index) {
        Some(index) => EpisodeStart::once(index),
        None => starts.pick(dice),
    };
    let first = guide.map_or(Vec::new(), |guide| guide.actions);
    EpisodePlan { start, first }
}

impl Demonstrations {
    /// Creates an empty memory.
    pub(super) fn new(imitation: &Imitation, observation: usize, priority: f64) -> Demonstrations {
        Demonstrations {
            imitation: imitation.clone(),
            // Unbounded and separate, so failures never displace a success.
            replay: ReplayBuffer::new(observation, usize::MAX - 1, priority),
            drawn: Batch::default(),
            guides: GuideMemory::new(imitation.guided, imitation.remembered),
        }
    }

    /// Returns the number of transitions per batch that are drawn from here.
    pub(super) fn drawn_of(&self, batch: usize) -> usize {
        if self.replay.is_empty() {
            // Before the first success a whole batch is of the training.
            0
        } else {
            (self.imitation.share * batch as f64) as usize
        }
    }

    /// Records an episode that succeeded.
    pub(super) fn remember(
        &mut self,
        index: u64,
        buffer: &EpisodeBuffer,
        steps: usize,
        discount: f32,
    ) {
        self.remember_with(index, buffer, |replay| {
            let width = replay.observation();
            let push = |transition: super::replay::Transition| replay.push(transition);
            // A success counts as terminal, even if its episode was cut off.
            buffer.n_step(width, steps, discount, Tail::Terminal, push);
        });
    }

    /// Records an episode that succeeded, whose transitions `push` adds.
    pub(super) fn remember_with(
        &mut self,
        index: u64,
        buffer: &EpisodeBuffer,
        push: impl FnOnce(&mut ReplayBuffer),
    ) {
        let episode = Demonstration {
            index,
            actions: buffer.actions.clone(),
        };
        self.guides.remember(episode);
        push(&mut self.replay);
    }

    /// Returns the successes along which episodes begin.
    pub(super) fn guides(&self) -> &GuideMemory {
        &self.guides
    }

    /// Appends `size` transitions of successes to a batch.
    pub(super) fn sample(
        &mut self,
        size: usize,
        beta: f64,
        dice: &mut LearnerRng,
        batch: &mut Batch,
    ) {
        if size > 0 {
            self.replay.sample(size, beta, dice, &mut self.drawn);
            batch.append(&self.drawn);
        }
    }

    /// Sets the priorities of transitions drawn from here, as [`ReplayBuffer::prioritise_all`].
    pub(super) fn prioritise_all(&mut self, slots: &mut [usize], errors: &mut [f32]) {
        self.replay.prioritise_all(slots, errors);
    }

    /// Adds the gradient of the large-margin loss to one row of a batch.
    ///
    /// The loss is max over a of Q(a) + margin · [a is not demonstrated], minus Q of
    /// the demonstrated action.
    pub(super) fn margin(&self, values: &[f32], shown: usize, scale: f32, gradient: &mut [f32]) {
        let margin = self.imitation.margin as f32;
        // The demonstrated action wins ties, which gives no gradient at a tie.
        let rival = |a: usize| values[a] + if a == shown { 0.0 } else { margin };
        let best = (0..values.len()).fold(
            shown,
            |best, a| if rival(best) < rival(a) { a } else { best },
        );
        let weight = self.imitation.weight as f32 * scale;
        if best != shown {
            gradient[best] += weight;
            gradient[shown] -= weight;
        }
    }

    /// Writes everything into a checkpoint.
    pub(super) fn save(&self, bundle: &mut TensorFile) {
        self.replay.save("shown", bundle);
        self.guides.save(bundle);
    }

    /// Fills an empty memory from a checkpoint.
    ///
    /// # Errors
    /// A tensor is missing or misshapen, or an index is out of range.
    pub(super) fn restore(
        &mut self,
        bundle: &TensorFile,
        actions: usize,
    ) -> Result<(), BundleError> {
        self.replay.restore("shown", bundle, actions)?;
        self.guides.restore(bundle, actions)
    }
}

impl GuideMemory {
    /// Creates an empty memory of at most `capacity` successes.
    pub(super) fn new(guided: f64, capacity: usize) -> GuideMemory {
        GuideMemory {
            guided,
            capacity,
            episodes: Vec::new(),
            oldest: 0,
        }
    }

    /// Records an episode that succeeded.
    pub(super) fn remember(&mut self, episode: Demonstration) {
        if self.episodes.len() < self.capacity {
            self.episodes.push(episode);
        } else {
            // The ring displaces the oldest episode.
            self.episodes[self.oldest] = episode;
            self.oldest = (self.oldest + 1) % self.capacity;
        }
    }

    /// Returns the beginning of a random success, in a share of the calls.
    fn guide(&self, dice: &mut LearnerRng) -> Option<Guide> {
        // An empty memory draws no number, so the random stream is that of plain deep
        // Q-learning until the first success.
        if self.episodes.is_empty() || self.guided <= dice.unit() {
            return None;
        }
        let shown = &self.episodes[dice.below(self.episodes.len())];
        let own = dice.unit() < 0.5;
        // A strict prefix, so that the learner decides at least the last action.
        let length = dice.below(shown.actions.len().max(1));
        Some(Guide {
            index: own.then_some(shown.index),
            actions: shown.actions[..length].to_vec(),
        })
    }

    /// Writes everything into a checkpoint.
    pub(super) fn save(&self, bundle: &mut TensorFile) {
        let n = self.episodes.len();
        let indices = self.episodes.iter().map(|shown| shown.index).collect();
        bundle.put::<u64>("shown/starts", &[n], indices);
        let lengths = self.episodes.iter().map(|shown| shown.actions.len() as u64);
        bundle.put::<u64>("shown/lengths", &[n], lengths.collect());
        let actions: Vec<u32> = self
            .episodes
            .iter()
            .flat_map(|shown| &shown.actions)
            .map(|&action| action as u32)
            .collect();
        bundle.put("shown/followed", &[actions.len()], actions);
        bundle.put("shown/next", &[1], vec![self.oldest as u64]);
    }

    /// Fills an empty memory from a checkpoint.
    ///
    /// # Errors
    /// A tensor is missing or misshapen, or an index is out of range.
    pub(super) fn restore(
        &mut self,
        bundle: &TensorFile,
        actions: usize,
    ) -> Result<(), BundleError> {
        let indices = bundle.rows::<u64>("shown/starts", &[])?;
        let lengths = bundle.get::<u64>("shown/lengths", &[indices.len()])?;
        let followed = bundle.rows::<u32>("shown/followed", &[])?;
        for action in followed {
            check("action of a demonstration", *action as usize, actions)?;
        }
        // Lengths come from the file: each is checked before the actions are split.
        let mut rest = followed;
        for (&index, &length) in indices.iter().zip(lengths) {
            let length = length as usize;
            check("length of a demonstration", length, rest.len() + 1)?;
            let (these, others) = rest.split_at(length);
            rest = others;
            let actions = these.iter().map(|&action| action as usize).collect();
            self.episodes.push(Demonstration { index, actions });
        }
        let room = self.capacity;
        check(
            "number of demonstrations",
            indices.len(),
            room.saturating_add(1),
        )?;
        self.oldest = bundle.one::<u64>("shown/next")? as usize;
        check("oldest demonstration", self.oldest, indices.len().max(1))
    }
}
