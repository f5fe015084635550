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

/// Binary tree of partial sums over leaves that are at least 0.
///
/// Every inner node is exactly the rounded sum of its two children, so the tree
/// is a pure function of its leaves.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct SumTree {
    /// Heap order: node i has the children 2i and 2i + 1, and index 0 is unused.
    nodes: Vec<f64>,
}

impl SumTree {
    /// Creates a tree over these leaves.
    pub fn new(leaves: &[f64]) -> SumTree {
        let mut tree = SumTree::default();
        tree.grow(leaves.len());
        let first = tree.capacity();
        tree.nodes[first..first + leaves.len()].copy_from_slice(leaves);
        tree.sum_up();
        tree
    }

    /// Makes room for leaves with index below `leaves`. New leaves are 0.
    pub fn grow(&mut self, leaves: usize) {
        let old = self.capacity();
        let new = leaves.next_power_of_two();
        if old < new {
            let mut nodes = vec![0.0; 2 * new];
            nodes[new..new + old].copy_from_slice(&self.nodes[old..]);
            self.nodes = nodes;
            self.sum_up();
        }
    }

    /// Sets a leaf.
    pub fn set(&mut self, leaf: usize, value: f64) {
        let mut node = self.capacity() + leaf;
        self.nodes[node] = value;
        // Summed anew from both children: adding the difference would accumulate
        // rounding, and the tree would depend on its history.
        while 1 < node {
            node /= 2;
            self.nodes[node] = self.nodes[2 * node] + self.nodes[2 * node + 1];
        }
    }

    /// Returns a leaf.
    pub fn get(&self, leaf: usize) -> f64 {
        self.nodes[self.capacity() + leaf]
    }

    /// Returns the sum of all leaves.
    pub fn total(&self) -> f64 {
        self.nodes.get(1).copied().unwrap_or(0.0)
    }

    /// Finds, for every mass, the leaf in whose share of the total it lies.
    ///
    /// A leaf of 0 is never found while the total is positive.
    ///
    /// All masses descend together, level by level. The processor then waits for
    /// many nodes at once instead of in sequence.
    pub fn find(&self, masses: &mut [f64], leaves: &mut [usize]) {
        leaves.fill(1);
        for _ in 0..self.capacity().trailing_zeros() {
            for (mass, node) in masses.iter_mut().zip(leaves.iter_mut()) {
                let (left, right) = (self.nodes[2 * *node], self.nodes[2 * *node + 1]);
                // Rounding may leave the mass at the very end. The walk then stays on the
                // side with positive leaves.
                let goes_right = left <= *mass && 0.0 < right;
                *mass -= if goes_right { left } else { 0.0 };
                *node = 2 * *node + usize::from(goes_right);
            }
        }
        leaves.iter_mut().for_each(|node| *node -= self.capacity());
    }

    fn capacity(&self) -> usize {
        self.nodes.len() / 2
    }

    fn sum_up(&mut self) {
        for node in (1..self.capacity()).rev() {
            self.nodes[node] = self.nodes[2 * node] + self.nodes[2 * node + 1];
        }
    }
}

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
    /// Next observations, `[batch, observation]`.
    pub nexts: Vec<f32>,
    /// Actions.
    pub actions: Vec<usize>,
    /// Rewards.
    pub rewards: Vec<f32>,
    /// Discounts of the bootstrap.
    pub discounts: Vec<f32>,
}

/// Replay memory: transitions and their priorities.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayBuffer {
    observation: usize,
    capacity: usize,
    alpha: f64,
    oldest: usize,
    largest: f64,
    /// Observation, next observation, reward and discount, side by side.
    ///
    /// A draw thus waits for the memory only once.
    rows: Vec<f32>,
    actions: Vec<u32>,
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
            largest: 1.0,
            rows: Vec::new(),
            actions: Vec::new(),
            priorities: SumTree::default(),
        }
    }

    /// Returns the number of transitions.
    pub fn len(&self) -> usize {
        self.actions.len()
    }

    /// Returns true if the memory is empty.
    pub fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    /// Returns the length of an observation.
    pub fn observation(&self) -> usize {
        self.observation
    }

    /// Stores a transition, in place of the oldest when full.
    pub fn push(&mut self, transition: Transition) {
        let slot = if self.len() < self.capacity {
            self.rows.resize(self.rows.len() + self.width(), 0.0);
            self.actions.push(0);
            self.priorities.grow(self.len());
            self.len() - 1
        } else {
            let slot = self.oldest;
            self.oldest = (slot + 1) % self.capacity;
            slot
        };
        self.actions[slot] = transition.action as u32;
        let width = self.width();
        let row = &mut self.rows[slot * width..(slot + 1) * width];
        let (observation, rest) = row.split_at_mut(self.observation);
        let (next, numbers) = rest.split_at_mut(self.observation);
        observation.copy_from_slice(transition.observation);
        next.copy_from_slice(transition.next);
        numbers.copy_from_slice(&[transition.reward, transition.discount]);
        // The largest priority ever seen, so that a new transition is drawn soon.
        self.priorities.set(slot, self.largest);
    }

    /// Fills `batch` with `size` draws. β is the strength of the correction.
    pub fn sample(&self, size: usize, beta: f64, dice: &mut LearnerRng, batch: &mut Batch) {
        batch.clear();
        let total = self.priorities.total();
        // Stratified: a draw from each of `size` equal shares of the total mass.
        let strata = (0..size).map(|i| (i as f64 + dice.unit()) / size as f64 * total);
        batch.masses.extend(strata);
        batch.slots.resize(size, 0);
        self.priorities.find(&mut batch.masses, &mut batch.slots);
        for at in 0..size {
            let slot = batch.slots[at];
            let share = self.len() as f64 * self.priorities.get(slot) / total;
            batch.weights.push(libm::powf(share as f32, -beta as f32));
            self.append_row(slot, batch);
        }
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
        self.append_row(slot, batch);
    }

    fn append_row(&self, slot: usize, batch: &mut Batch) {
        let row = &self.rows[slot * self.width()..(slot + 1) * self.width()];
        let (observation, rest) = row.split_at(self.observation);
        let (next, numbers) = rest.split_at(self.observation);
        batch.observations.extend_from_slice(observation);
        batch.nexts.extend_from_slice(next);
        batch.actions.push(self.actions[slot] as usize);
        batch.rewards.push(numbers[0]);
        batch.discounts.push(numbers[1]);
    }

    /// Sets the priority of a slot to (|δ| + floor)^α.
    pub fn prioritise(&mut self, slot: usize, error: f32) {
        let priority = f64::from(libm::powf(
            error.abs() + ReplayBuffer::FLOOR,
            self.alpha as f32,
        ));
        // Never decreases: new transitions get the largest priority ever seen.
        self.largest = self.largest.max(priority);
        self.priorities.set(slot, priority);
    }

    fn width(&self) -> usize {
        2 * self.observation + 2
    }

    /// Writes everything into a checkpoint, as `prefix/rows`, `prefix/actions`, ….
    pub fn save(&self, prefix: &str, bundle: &mut TensorFile) {
        let n = self.len();
        let name = |part| format!("{prefix}/{part}");
        bundle.put(name("rows"), &[n, self.width()], self.rows.clone());
        bundle.put(name("actions"), &[n], self.actions.clone());
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
        self.rows = bundle
            .get::<f32>(&name("rows"), &[n, self.width()])?
            .to_vec();
        self.actions = kept.to_vec();
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
        self.actions.clear();
        self.rewards.clear();
        self.discounts.clear();
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
