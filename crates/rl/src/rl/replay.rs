//! Prioritised experience replay with n-step returns.
//!
//! - Schaul, Quan, Antonoglou, Silver, "Prioritized Experience Replay", ICLR
//!   2016: proportional variant, P(i) ∝ p_i^α, weights (N·P(i))^−β scaled by
//!   their maximum in the batch, new transitions with the largest priority
//!   seen, stratified sampling.
//! - Watkins, "Learning from Delayed Rewards", 1989: an n-step return ends
//!   before the first exploratory action that was not greedy.

use super::bundle::{BundleError, TensorFile};
use super::dice::LearnerRng;
use super::power::powers;
use super::sum_tree::SumTree;

/// n-step transition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<'a> {
    /// Observation s.
    pub observation: &'a [f32],
    /// Action taken in s.
    pub action: usize,
    /// Discounted rewards r₁ + γ r₂ + … up to the next observation.
    pub reward: f32,
    /// Observation after those rewards.
    pub next: &'a [f32],
    /// γ^k for a bootstrap after k rewards, 0 after a terminal state.
    pub discount: f32,
}

/// Batch of transitions with their importance weights.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    masses: Vec<f64>,
    /// Slots in the replay.
    pub slots: Vec<usize>,
    /// Importance weights, at most 1.
    pub weights: Vec<f32>,
    /// Observations, `[batch, observation]`.
    pub observations: Vec<f32>,
    /// Next observations where the return bootstraps, `[lasting, observation]`.
    pub nexts: Vec<f32>,
    /// Indices of the transitions whose return bootstraps.
    pub lasting: Vec<usize>,
    /// Actions.
    pub actions: Vec<usize>,
    /// Rewards.
    pub rewards: Vec<f32>,
    /// Discounts of the bootstrap.
    pub discounts: Vec<f32>,
    /// Errors of the transitions, from which their priorities are computed.
    pub errors: Vec<f32>,
}

/// Replay memory: transitions and their priorities.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayBuffer {
    observation: usize,
    capacity: usize,
    alpha: f64,
    oldest: usize,
    largest: f64,
    /// Reward, discount, observation, next observation and the bits of the action.
    ///
    /// Side by side, so that a draw waits for the memory only once.
    rows: Vec<f32>,
    /// Number of transitions.
    len: usize,
    priorities: SumTree,
}

impl ReplayBuffer {
    /// Offset on |δ|, so that every transition can be drawn again.
    const FLOOR: f32 = 1e-3;

    /// Creates an empty memory of up to `capacity` transitions.
    pub fn new(observation: usize, capacity: usize, alpha: f64) -> ReplayBuffer {
        ReplayBuffer {
            observation,
            capacity,
            alpha,
            oldest: 0,
            // As p₁ in Algorithm 1 of Schaul 2016.
            largest: 1.0,
            rows: Vec::new(),
            len: 0,
            priorities: SumTree::default(),
        }
    }

    /// Returns the number of transitions.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if the memory is empty.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the length of an observation.
    pub fn observation(&self) -> usize {
        self.observation
    }

    /// Stores a transition, in place of the oldest when full.
    pub fn push(&mut self, transition: Transition) {
        let slot = if self.len < self.capacity {
            self.rows.resize(self.rows.len() + self.width(), 0.0);
            self.len += 1;
            self.priorities.grow(self.len);
            self.len - 1
        } else {
            let slot = self.oldest;
            self.oldest = (slot + 1) % self.capacity;
            slot
        };
        self.write_row(slot, transition);
        // The largest priority ever seen, so that a new transition is drawn soon.
        self.priorities.set(slot, self.largest);
    }

    /// Returns the mean reward of the transitions at which episodes ended, if there are any.
    pub fn mean_end(&self) -> Option<f32> {
        let rows = self.rows.chunks_exact(self.width());
        let ends = rows
            // Nothing is bootstrapped after an end, so its discount is 0.
            .filter(|row| row[1] == 0.0)
            .map(|row| f64::from(row[0]));
        let (sum, count) = ends.fold((0.0, 0u64), |(sum, count), end| (sum + end, count + 1));
        (count > 0).then(|| (sum / count as f64) as f32)
    }

    /// Fills `batch` with `size` draws. β is the strength of the correction.
    pub fn sample(&self, size: usize, beta: f64, dice: &mut LearnerRng, batch: &mut Batch) {
        batch.clear();
        let total = self.priorities.total();
        // Stratified: a draw from each of `size` equal shares of the total mass.
        let strata = (0..size).map(|i| (i as f64 + dice.unit()) / size as f64 * total);
        batch.masses.extend(strata);
        batch.slots.resize(size, 0);
        self.priorities.find(&batch.masses, &mut batch.slots);
        let shares = batch.slots.iter().map(|slot| {
            let share = self.len as f64 * self.priorities.get(*slot) / total;
            share as f32
        });
        batch.weights.extend(shares);
        powers(&mut batch.weights, -beta as f32);
        self.append_rows(0, batch);
        // Scaled by the maximum of the batch, so that weights only shrink a step.
        let largest = batch.weights.iter().copied().fold(0.0, f32::max);
        batch
            .weights
            .iter_mut()
            .for_each(|weight| *weight /= largest);
    }

    /// Appends the newest transition to a batch, with a weight of 1.
    pub fn append_newest(&self, batch: &mut Batch) {
        if self.is_empty() {
            return;
        }
        // The slot before the oldest. Before the memory is full, `oldest` is 0.
        let slot = (self.oldest + self.len() - 1) % self.len();
        batch.slots.push(slot);
        batch.weights.push(1.0);
        self.append_rows(batch.slots.len() - 1, batch);
    }

    /// Appends the rows of the slots from index `from` on.
    fn append_rows(&self, from: usize, batch: &mut Batch) {
        // The ends of all rows first: this loop is so short that the processor waits for
        // many rows at once. The second loop then finds them in its cache.
        for slot in &batch.slots[from..] {
            let row = self.row(*slot);
            batch.rewards.push(row[0]);
            batch.discounts.push(row[1]);
            batch.actions.push(row[row.len() - 1].to_bits() as usize);
        }
        for (at, slot) in batch.slots.iter().enumerate().skip(from) {
            let [observation, next] = self.observations(*slot);
            batch.observations.extend_from_slice(observation);
            // A next observation without bootstrap has no effect.
            if batch.discounts[at] != 0.0 {
                batch.nexts.extend_from_slice(next);
                batch.lasting.push(at);
            }
        }
    }

    /// Sets the priority of a slot to (|δ| + floor)^α.
    pub fn prioritise(&mut self, slot: usize, error: f32) {
        self.prioritise_all(&mut [slot], &mut [error]);
    }

    /// Sets the priorities of many slots, the last one if a slot is repeated.
    ///
    /// Uses `slots` up as working memory, and turns the errors into priorities.
    pub fn prioritise_all(&mut self, slots: &mut [usize], errors: &mut [f32]) {
        errors
            .iter_mut()
            .for_each(|error| *error = error.abs() + ReplayBuffer::FLOOR);
        powers(errors, self.alpha as f32);
        // Never decreases: new transitions get the largest priority ever seen.
        let largest = errors.iter().copied().fold(0.0, f32::max);
        self.largest = self.largest.max(f64::from(largest));
        self.priorities.set_all(slots, errors);
    }

    fn row(&self, slot: usize) -> &[f32] {
        &self.rows[slot * self.width()..(slot + 1) * self.width()]
    }

    fn observations(&self, slot: usize) -> [&[f32]; 2] {
        let row = self.row(slot);
        let (observation, next) = row[2..row.len() - 1].split_at(self.observation);
        [observation, next]
    }

    fn write_row(&mut self, slot: usize, transition: Transition) {
        let width = self.width();
        let row = &mut self.rows[slot * width..(slot + 1) * width];
        row[0] = transition.reward;
        row[1] = transition.discount;
        row[width - 1] = f32::from_bits(transition.action as u32);
        let (observation, next) = row[2..width - 1].split_at_mut(self.observation);
        observation.copy_from_slice(transition.observation);
        next.copy_from_slice(transition.next);
    }

    fn width(&self) -> usize {
        2 * self.observation + 3
    }

    /// Writes everything into a checkpoint, as `prefix/rows`, `prefix/actions`, ….
    pub fn save(&self, prefix: &str, bundle: &mut TensorFile) {
        let n = self.len;
        let name = |part| format!("{prefix}/{part}");
        let mut rows = Vec::with_capacity(n * (2 * self.observation + 2));
        let mut actions = Vec::with_capacity(n);
        for slot in 0..n {
            let row = self.row(slot);
            // Observations before reward and discount, the order of the first versions.
            rows.extend_from_slice(&row[2..row.len() - 1]);
            rows.extend_from_slice(&row[..2]);
            actions.push(row[row.len() - 1].to_bits());
        }
        bundle.put(name("rows"), &[n, 2 * self.observation + 2], rows);
        bundle.put(name("actions"), &[n], actions);
        let leaves: Vec<f64> = (0..n).map(|slot| self.priorities.get(slot)).collect();
        bundle.put(name("priorities"), &[n], leaves);
        bundle.put(name("oldest"), &[1], vec![self.oldest as u64]);
        bundle.put(name("largest"), &[1], vec![self.largest]);
    }

    /// Fills an empty memory from a checkpoint.
    ///
    /// # Errors
    /// A tensor is missing or misshapen, or an index is out of range.
    pub fn restore(
        &mut self,
        prefix: &str,
        bundle: &TensorFile,
        actions: usize,
    ) -> Result<(), BundleError> {
        let name = |part| format!("{prefix}/{part}");
        let kept = bundle.rows::<u32>(&name("actions"), &[])?;
        let n = kept.len();
        let oldest = bundle.one::<u64>(&name("oldest"))? as usize;
        let leaves = bundle.get::<f64>(&name("priorities"), &[n])?;
        // The bound is exclusive, and a full memory is valid.
        check("replay length", n, self.capacity.saturating_add(1))?;
        check("oldest slot of the replay", oldest, n.max(1))?;
        for action in kept {
            check("action in the replay", *action as usize, actions)?;
        }
        let largest = bundle.one::<f64>(&name("largest"))?;
        // A priority of 0 could never be drawn, and its weight would be infinite.
        let mut priorities = leaves.iter().chain([&largest]);
        if let Some(leaf) = priorities.find(|leaf| **leaf <= 0.0) {
            return Err(BundleError::Mismatch {
                what: "priority in the replay",
                expected: "positive".into(),
                found: leaf.to_string(),
            });
        }
        let ends = 2 * self.observation;
        let rows = bundle.get::<f32>(&name("rows"), &[n, ends + 2])?;
        self.rows = vec![0.0; n * self.width()];
        self.len = n;
        for (slot, action) in kept.iter().enumerate() {
            let row = &rows[slot * (ends + 2)..(slot + 1) * (ends + 2)];
            self.write_row(
                slot,
                Transition {
                    observation: &row[..self.observation],
                    action: *action as usize,
                    reward: row[ends],
                    next: &row[self.observation..ends],
                    discount: row[ends + 1],
                },
            );
        }
        // The inner nodes are rebuilt, since the tree is a function of its leaves.
        self.priorities = SumTree::new(leaves);
        self.oldest = oldest;
        self.largest = largest;
        Ok(())
    }
}

impl Batch {
    /// Appends the transitions of another batch.
    pub fn append(&mut self, other: &Batch) {
        let before = self.slots.len();
        self.lasting
            .extend(other.lasting.iter().map(|at| before + at));
        self.slots.extend_from_slice(&other.slots);
        self.weights.extend_from_slice(&other.weights);
        self.observations.extend_from_slice(&other.observations);
        self.nexts.extend_from_slice(&other.nexts);
        self.actions.extend_from_slice(&other.actions);
        self.rewards.extend_from_slice(&other.rewards);
        self.discounts.extend_from_slice(&other.discounts);
    }

    fn clear(&mut self) {
        self.masses.clear();
        self.slots.clear();
        self.weights.clear();
        self.observations.clear();
        self.nexts.clear();
        self.lasting.clear();
        self.actions.clear();
        self.rewards.clear();
        self.discounts.clear();
        self.errors.clear();
    }
}

/// Refuses an index that is not below `end`.
pub(super) fn check(what: &'static str, index: usize, end: usize) -> Result<(), BundleError> {
    if index < end {
        return Ok(());
    }
    let expected = format!("below {end}");
    Err(BundleError::Mismatch {
        what,
        expected,
        found: index.to_string(),
    })
}

/// Continuation after an episode's last observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tail {
    /// Nothing follows, so there is no bootstrap.
    Terminal,
    /// The world would go on, so returns bootstrap from the last observation.
    Open,
}

/// Played episode: L decisions and L + 1 observations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpisodeBuffer {
    /// Observations, `[L + 1, observation]`.
    pub observations: Vec<f32>,
    /// Actions taken.
    pub actions: Vec<usize>,
    /// Flags of the actions that were greedy when taken.
    pub greedy: Vec<bool>,
    /// Rewards.
    pub rewards: Vec<f32>,
}

impl EpisodeBuffer {
    /// Removes everything but keeps the allocated memory.
    pub fn clear(&mut self) {
        self.observations.clear();
        self.actions.clear();
        self.greedy.clear();
        self.rewards.clear();
    }

    /// Begins another episode in the same memory.
    pub fn begin(&mut self, observation: &[f32]) {
        self.clear();
        self.observations.extend_from_slice(observation);
    }

    /// Records a decision and its result.
    pub fn note(&mut self, action: usize, greedy: bool, reward: f32, observation: &[f32]) {
        self.observations.extend_from_slice(observation);
        self.actions.push(action);
        self.greedy.push(greedy);
        self.rewards.push(reward);
    }

    /// Passes the n-step transitions of the episode to `take`.
    ///
    /// A return starting at decision t ends after n rewards, at the end of the
    /// episode, or before the first later decision that was not greedy. Beyond that
    /// decision the rewards are not those of the greedy policy.
    pub fn n_step(
        &self,
        width: usize,
        n: usize,
        discount: f32,
        tail: Tail,
        mut take: impl FnMut(Transition),
    ) {
        let row = |t: usize| &self.observations[t * width..(t + 1) * width];
        let end = self.actions.len();
        for t in 0..end {
            let (mut reward, mut factor, mut next) = (0.0, 1.0, t);
            // The first action may be exploratory: Q(s, a) is defined for any action a.
            while next < end && next < t + n && (next == t || self.greedy[next]) {
                reward += factor * self.rewards[next];
                factor *= discount;
                next += 1;
            }
            // A discount of 0 removes the bootstrap without a special case in the update.
            if next == end && tail == Tail::Terminal {
                factor = 0.0;
            }
            take(Transition {
                observation: row(t),
                action: self.actions[t],
                reward,
                next: row(next),
                discount: factor,
            });
        }
    }
}
