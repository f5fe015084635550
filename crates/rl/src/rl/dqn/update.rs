//! Update of the networks on a batch of the replay.

use super::lawful::logs;
use super::{Dqn, DqnWorkspace};
use crate::rl::learner::linear;
use crate::rl::nn::{UsedUnits, argmax};

/// First step size of an extension, as a share of the configured size.
const AGAIN: f64 = 0.3;

/// Steps of Adam between two searches for units that are never on.
// Where nearly every episode returns -1, 83 to 96 of 96 units of the last layer were off for
// good, and the ado of a world with three ados solved 0 and 36 % of the starts. With new
// weights it solved 81 and 40 %.
const RENEWAL: u64 = 1000;
/// Batches in which such a unit is never on.
const RENEWAL_BATCHES: usize = 16;

/// Multiple of rows that the products of all layers compute without a rest.
const STRIP: usize = 8;

impl Dqn {
    /// Returns the current step size of Adam, which falls linearly.
    ///
    /// An extension starts lower, since most is learned by then.
    fn learning_rate(&self) -> f64 {
        let (first, last) = (self.config.learning_rate, self.config.final_learning_rate);
        let first = match self.since {
            0 => first,
            _ => (first * AGAIN).max(last),
        };
        let span = self.tally.requested.saturating_sub(self.since) as f64;
        linear(
            first,
            last,
            self.tally.decisions.saturating_sub(self.since),
            span,
        )
    }

    /// Sets the values of an untrained network to the mean return so far.
    ///
    /// If nearly all returns are −1, the first steps otherwise lower the outputs by
    /// all weights at once, and most units of the last hidden layer never recover.
    fn begin_at_mean(&mut self) {
        // Only an untrained network has outputs without bias.
        let untrained = self.adam.steps == 0
            && self
                .online
                .output_biases_mut()
                .iter()
                .all(|bias| *bias == 0.0);
        if !untrained || self.shown.is_none() {
            return;
        }
        if let Some(mean) = self.replay.mean_end() {
            self.online.output_biases_mut().fill(mean);
            self.target.output_biases_mut().fill(mean);
        }
    }

    /// Gives hidden units that are never on new weights, now and then.
    ///
    /// Units die where nearly all returns are equal, as in worlds of few successes.
    fn renew_unused(&mut self) {
        let due = self.adam.steps > 0 && self.adam.steps.is_multiple_of(RENEWAL);
        if !due || self.shown.is_none() {
            return;
        }
        let DqnWorkspace { batch, here, .. } = &mut self.room;
        let size = self.config.batch;
        let mut used = UsedUnits::of(&self.online);
        for _ in 0..RENEWAL_BATCHES {
            // Any weights serve, since only activations are read.
            self.replay.sample(size, 0.0, &mut self.dice, batch);
            self.online.forward(&batch.observations, size, here);
            used.note(&self.online, here, size);
        }
        let changed = self.online.renew_unused(&used, &mut self.dice);
        // At once, since an average would mix the weights of two units.
        for at in changed {
            self.target.parameters_mut()[at] = self.online.parameters()[at];
            self.adam.forget(at);
        }
    }

    /// Runs a step of Adam on a prioritised batch, then updates the target network.
    pub(super) fn update(&mut self) {
        self.begin_at_mean();
        self.renew_unused();
        let rate = self.learning_rate() as f32;
        let DqnWorkspace {
            batch,
            here,
            there,
            gradient,
            ..
        } = &mut self.room;
        let size = self.config.batch;
        // Unlike the step size, β is not restarted: it stays 1 in an extension.
        let span = self.config.decisions as f64;
        let beta = linear(self.config.correction, 1.0, self.tally.decisions, span);
        let shown = self.shown.as_ref().map_or(0, |shown| shown.drawn_of(size));
        // Order of a batch: own transitions, the newest, successes. The loop below
        // relies on it.
        let own = size - shown;
        let newest = usize::from(self.config.newest && own > 0);
        self.replay
            .sample(own - newest, beta, &mut self.dice, batch);
        if newest > 0 {
            self.replay.append_newest(batch);
        }
        if let Some(successes) = &mut self.shown {
            successes.sample(shown, beta, &mut self.dice, batch);
        }

        // Double DQN: y = r + γ^k Q_target(s', argmax Q_online(s')). After a terminal
        // state γ^k is stored as 0, so that all rows are treated alike.
        let stride = self.online.output_stride();
        let actions = self.online.outputs();
        // Rows without bootstrap are left out. Zeros fill the last rows up, because a
        // product computes its rows in strips.
        let lasting = batch.lasting.len();
        let rows = lasting.next_multiple_of(STRIP).min(size);
        batch.nexts.resize(rows * self.online.inputs(), 0.0);
        let picks = self.online.forward(&batch.nexts, rows, here);
        let judges = self.target.forward(&batch.nexts, rows, there);
        let rows = picks.chunks_exact(stride).zip(judges.chunks_exact(stride));
        for (at, (&i, (pick, judge))) in batch.lasting.iter().zip(rows).enumerate() {
            if let Some(law) = self.law {
                let width = self.online.inputs();
                let next = &batch.nexts[at * width..(at + 1) * width];
                // The reward is a lower bound of the value, not a part of it.
                let value = law.backup(logs(next, actions), &judge[..actions]);
                batch.rewards[i] = batch.rewards[i].max(value);
            } else {
                batch.rewards[i] += batch.discounts[i] * judge[argmax(&pick[..actions])];
            }
        }

        // δ = Q(s, a) − y. The gradient of the Huber loss is δ clipped, that of the
        // squared loss is δ. The priority uses the unclipped error, so that a large
        // error is drawn again soon, however little a step reduces it. Invariant:
        // padding columns and actions not taken have no gradient.
        self.online.forward(&batch.observations, size, here);
        let huber = self.config.huber as f32;
        let (values, gradients) = self.online.output_and_gradient(size, here);
        gradients.fill(0.0);
        let mut loss = 0.0;
        for i in 0..size {
            let at = i * stride + batch.actions[i];
            let error = values[at] - batch.rewards[i];
            let slope = self.config.loss.slope(error, huber);
            loss += batch.weights[i] * self.config.loss.value(error, huber);
            gradients[at] = batch.weights[i] * slope / size as f32;
            batch.errors.push(error);
            // The batch ends with the transitions of successes. Under a law, the value of
            // another action than the one shown is no worse a value.
            let is_shown = own <= i && self.law.is_none();
            if let Some(successes) = self.shown.as_ref().filter(|_| is_shown) {
                let row = i * stride..i * stride + actions;
                let gradient = &mut gradients[row.clone()];
                successes.margin(&values[row], batch.actions[i], 1.0 / size as f32, gradient);
            }
        }
        let (slots, shown_slots) = batch.slots.split_at_mut(own);
        let (errors, shown_errors) = batch.errors.split_at_mut(own);
        self.replay.prioritise_all(slots, errors);
        if let Some(successes) = &mut self.shown {
            successes.prioritise_all(shown_slots, shown_errors);
        }
        self.losses.add(f64::from(loss / size as f32));
        self.online
            .backward(&batch.observations, size, here, gradient);
        self.adam.step(self.online.parameters_mut(), gradient, rate);

        // Paper (Mnih 2015): a periodic copy. Here: Polyak averaging, because it has a
        // parameter less to tune.
        let polyak = self.config.polyak as f32;
        self.target.move_toward(&self.online, polyak);
    }
}
