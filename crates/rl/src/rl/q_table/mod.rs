//! Tabular Q-learning.
//!
//! Watkins, "Learning from Delayed Rewards", 1989, and Watkins, Dayan,
//! "Q-learning", Machine Learning 1992: off-policy one-step updates
//! Q(s, a) ← Q(s, a) + α (r + γ max Q(s', ·) − Q(s, a)), with α = 1/n^ω where n
//! counts the visits of (s, a) (Even-Dar, Mansour 2003), or constant.
//!
//! Deviations: docs/background/learners.md.

mod settings;
mod table;

pub use settings::{Bins, LearningRate, QTableSettings};
use table::Table;

use crate::rl::bundle::{BundleError, TensorFile};
use crate::rl::dice::LearnerRng;
use crate::rl::learner::{
    Built, Choice, ConfigError, EpisodePlan, Learner, LearnerKind, Shaped, TrainingCounters,
    epsilon, expect_sizes, within,
};
use crate::rl::nn::{argmax, argmax_among, sample};
use crate::rl::replay::EpisodeBuffer;
use crate::rl::{End, Losses, Policy, Spaces, Step};

/// Kind of a kept policy.
const POLICY: &str = "brakecheck q-table policy 1";
/// Kind of a checkpoint.
const CHECKPOINT: &str = "brakecheck q-table checkpoint 1";

impl LearnerKind for QTableSettings {
    fn bundles(&self) -> [&'static str; 2] {
        [POLICY, CHECKPOINT]
    }

    fn check(&self) -> Result<(), ConfigError> {
        match self.learning_rate {
            LearningRate::Constant(rate) => within("learning_rate", rate, 1e-9, 1.0)?,
            // Above 1, all steps 1/n^ω together are finite, so they may end short of
            // the value.
            LearningRate::Power(omega) => within("learning_rate", omega, 0.0, 1.0)?,
        }
        within("discount", self.discount, 0.0, 1.0)?;
        within("initial_value", self.initial_value, -1e6, 1e6)?;
        within("initial_spread", self.initial_spread, 0.0, 1e6)?;
        within("exploration", self.exploration, 0.0, 1.0)?;
        within("final_exploration", self.final_exploration, 0.0, 1.0)?;
        within("exploration_fraction", self.exploration_fraction, 0.0, 1.0)?;
        within("hold", self.hold as f64, 1.0, 1e6)?;
        within("bins", self.bins.len() as f64, 1.0, 1e6)?;
        for bins in &self.bins {
            within("bins: low", bins.low, -1e9, 1e9)?;
            within("bins: high", bins.high, -1e9, 1e9)?;
            within("bins: count", f64::from(bins.count), 1.0, 65536.0)?;
            // An empty range would divide by 0 in `Table::cell`.
            if bins.high <= bins.low {
                return Err(ConfigError {
                    field: "bins",
                    why: format!("go from {} to {}", bins.low, bins.high),
                    help: "give a `high` above `low`".into(),
                });
            }
        }
        Ok(())
    }

    fn discount(&self) -> f64 {
        self.discount
    }

    fn build(&self, spaces: &Spaces, seed: u64) -> Box<dyn Learner> {
        let table = Table {
            observation: spaces.observation,
            actions: spaces.actions,
            neutral: spaces.neutral,
            bins: self.bins.clone(),
            rows: Default::default(),
            values: Vec::new(),
        };
        Box::new(QTable::around(self, spaces, table, LearnerRng::new(seed)))
    }

    fn build_from(&self, spaces: &Spaces, seed: u64, policy: &TensorFile) -> Built {
        let table = QTable::fitting(self, spaces, policy)?;
        Ok(Box::new(QTable::around(
            self,
            spaces,
            table,
            LearnerRng::new(seed),
        )))
    }

    fn restore(&self, spaces: &Spaces, bundle: &TensorFile) -> Built {
        let table = QTable::fitting(self, spaces, bundle)?;
        let mut learner = QTable::around(self, spaces, table, LearnerRng::restore(bundle)?);
        let shape = [learner.table.rows.len(), spaces.actions];
        // Loaded rows are numbered in the order of the file, which is also that of the
        // visits.
        learner.visits = bundle.get::<u32>("visits", &shape)?.to_vec();
        learner.tally.restore(bundle)?;
        Ok(Box::new(learner))
    }

    fn load(&self, policy: &TensorFile) -> Shaped {
        let table = Table::load(policy)?;
        let shape = [table.observation, table.actions];
        Ok((Box::new(TablePolicy { table }), shape))
    }
}

/// Learner state: everything that changes during training.
struct QTable {
    config: QTableSettings,
    spaces: Spaces,
    table: Table,
    visits: Vec<u32>,
    dice: LearnerRng,
    tally: TrainingCounters,
    cell: Vec<u32>,
    buffer: EpisodeBuffer,
    /// Row of every observation of the episode.
    trail: Vec<usize>,
    /// Exploratory action, and the decisions for which it is still held.
    held: usize,
    holding: usize,
    losses: Losses,
}

impl QTable {
    fn fitting(
        config: &QTableSettings,
        spaces: &Spaces,
        bundle: &TensorFile,
    ) -> Result<Table, BundleError> {
        let table = Table::load(bundle)?;
        let (found, expected) = (
            [table.observation, table.actions],
            [spaces.observation, spaces.actions],
        );
        expect_sizes("the table's observation and actions", &found, &expected)?;
        // Other bins would read the same cells as other observations.
        if table.bins != config.bins {
            return Err(BundleError::Mismatch {
                what: "the table's `bins`",
                expected: format!("{:?}", config.bins),
                found: format!("{:?}", table.bins),
            });
        }
        Ok(table)
    }

    fn around(config: &QTableSettings, spaces: &Spaces, table: Table, dice: LearnerRng) -> QTable {
        QTable {
            config: config.clone(),
            spaces: spaces.clone(),
            // A kept policy has no visits, so its values move as fast as new ones.
            visits: vec![0; table.values.len()],
            table,
            dice,
            tally: TrainingCounters::new(config.decisions),
            cell: Vec::new(),
            buffer: EpisodeBuffer::default(),
            trail: Vec::new(),
            held: 0,
            holding: 0,
            losses: Losses::default(),
        }
    }

    /// Updates one step at a time from the end of the episode to its beginning.
    ///
    /// A reward at the end thus reaches the start at once (Lin 1992).
    fn replay_backward(&mut self, bootstrap: f32) {
        let mut next = bootstrap;
        for t in (0..self.trail.len()).rev() {
            let (row, action) = (self.trail[t], self.buffer.actions[t]);
            self.update(row, action, self.buffer.rewards[t], next);
            // Read after the update, so that the new value passes on to the step before.
            next = self.best(row);
        }
    }

    /// Updates Q(s, a) with the estimated value of the next state.
    fn update(&mut self, row: usize, action: usize, reward: f32, next: f32) {
        let at = row * self.spaces.actions + action;
        // Saturating, since the count only sets the step size.
        self.visits[at] = self.visits[at].saturating_add(1);
        let rate = match self.config.learning_rate {
            LearningRate::Constant(rate) => rate,
            LearningRate::Power(omega) => libm::pow(f64::from(self.visits[at]), -omega),
        };
        let target = reward + self.config.discount as f32 * next;
        let error = target - self.table.values[at];
        // Half of the square, so that the update descends the gradient of the loss.
        self.losses.add(0.5 * f64::from(error * error));
        self.table.values[at] += rate as f32 * error;
    }

    /// Returns the row of the observation's cell, creating it if needed.
    fn row(&mut self, obs: &[f32]) -> usize {
        let mut cell = std::mem::take(&mut self.cell);
        self.table.cell(obs, &mut cell);
        let row = match self.table.rows.get(cell.as_slice()) {
            Some(row) => *row,
            None => {
                let row = self.table.rows.len();
                self.table.rows.insert(cell.as_slice().into(), row);
                let end = (row + 1) * self.spaces.actions;
                let (value, spread) = (self.config.initial_value, self.config.initial_spread);
                self.table.values.resize(end, value as f32);
                self.visits.resize(end, 0);
                // No draw at a spread of 0, so the random stream does not depend on new cells.
                if spread > 0.0 {
                    for at in row * self.spaces.actions..end {
                        let drawn = value + spread * (2.0 * self.dice.unit() - 1.0);
                        self.table.values[at] = drawn as f32;
                    }
                }
                row
            }
        };
        self.cell = cell;
        row
    }

    /// Returns the action of an exploring decision.
    fn explored(&mut self, row: usize) -> usize {
        if self.holding == 0 && self.dice.unit() < self.exploration() {
            self.held = self.dice.below(self.spaces.actions);
            self.holding = 1 + self.dice.below(self.config.hold);
        }
        // The decision that draws an action is the first for which it is held.
        let holding = self.holding;
        self.holding = holding.saturating_sub(1);
        match holding {
            0 => argmax(self.values(row)),
            _ => self.held,
        }
    }

    /// Returns the value after a decision, 0 at a terminal state.
    fn after(&mut self, end: Option<End>, obs: &[f32]) -> f32 {
        if end == Some(End::Terminated) {
            return 0.0;
        }
        // A truncated episode bootstraps too, since its world would go on.
        let row = self.row(obs);
        self.best(row)
    }

    fn values(&self, row: usize) -> &[f32] {
        &self.table.values[row * self.spaces.actions..(row + 1) * self.spaces.actions]
    }

    fn best(&self, row: usize) -> f32 {
        let values = self.values(row);
        values[argmax(values)]
    }
}

impl Learner for QTable {
    fn plan(&mut self) -> EpisodePlan {
        EpisodePlan::of(self.tally.begun())
    }

    fn begin(&mut self, _: &EpisodePlan, _: &[f32]) {
        self.buffer.clear();
        self.trail.clear();
        // An exploratory action is not held into another episode.
        self.holding = 0;
    }

    fn act(&mut self, obs: &[f32], choice: Choice) -> usize {
        let row = self.row(obs);
        let action = match choice {
            Choice::Given(action) => action,
            // Greedy play is no training, so it leaves no trail.
            Choice::Greedy => return argmax(self.values(row)),
            Choice::Own => self.explored(row),
        };
        self.trail.push(row);
        self.buffer.actions.push(action);
        action
    }

    fn learn(&mut self, step: Step, obs: &[f32]) {
        self.buffer.rewards.push(step.reward);
        self.tally.decisions += 1;
        if step.end == Some(End::Aborted) {
            // The trail of a fault is forgotten when the next episode begins.
            self.tally.aborted += 1;
            return;
        }
        if step.end.is_some() {
            self.tally.episodes += 1;
        }
        // As in the paper, an update per decision. An aborted decision is dropped.
        if !self.config.backward {
            let after = self.after(step.end, obs);
            let last = self.trail.len() - 1;
            let (row, action) = (self.trail[last], self.buffer.actions[last]);
            self.update(row, action, step.reward, after);
        } else if step.end.is_some() {
            let bootstrap = self.after(step.end, obs);
            self.replay_backward(bootstrap);
        }
    }

    fn tally(&self) -> &TrainingCounters {
        &self.tally
    }

    fn take_losses(&mut self) -> Losses {
        std::mem::take(&mut self.losses)
    }

    fn exploration(&self) -> f64 {
        let ends = (self.config.exploration, self.config.final_exploration);
        epsilon(&self.tally, ends, self.config.exploration_fraction)
    }

    fn policy(&self) -> Box<dyn Policy> {
        Box::new(TablePolicy {
            table: self.table.clone(),
        })
    }

    fn policy_bundle(&self) -> TensorFile {
        let mut bundle = TensorFile::new(POLICY);
        self.table.save(&mut bundle);
        bundle
    }

    fn checkpoint(&self) -> TensorFile {
        let mut bundle = TensorFile::new(CHECKPOINT);
        self.table.save(&mut bundle);
        // Rows are numbered by their first visit, but equal tables must give equal bytes.
        let visits = self.table.in_order(&self.visits);
        bundle.put(
            "visits",
            &[self.table.rows.len(), self.spaces.actions],
            visits,
        );
        self.dice.save(&mut bundle);
        self.tally.save(&mut bundle);
        bundle
    }
}

/// Greedy policy in the table, neutral with value 0 in an unvisited cell.
struct TablePolicy {
    table: Table,
}

impl Policy for TablePolicy {
    fn act(&self, obs: &[f32]) -> usize {
        self.table.values(obs).map_or(self.table.neutral, argmax)
    }

    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        let values = self.table.values(obs);
        values.map_or(self.table.neutral, |values| argmax_among(values, allowed))
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        let values = self.table.values(obs);
        values.map_or(self.table.neutral, |values| {
            sample(values, temperature, units)
        })
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.table
            .values(obs)
            .map_or(0.0, |values| values[argmax(values)])
    }

    fn action_values(&self, obs: &[f32]) -> Option<Vec<f32>> {
        self.table.values(obs).map(<[f32]>::to_vec)
    }
}
