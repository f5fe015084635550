//! Update of the networks on a batch of the replay.

use super::{Dqn, DqnWorkspace};
use crate::rl::learner::linear;
use crate::rl::nn::argmax;

/// First step size of an extension, as a share of the configured size.
const AGAIN: f64 = 0.3;

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

    /// Runs a step of Adam on a prioritised batch, then updates the target network.
    pub(super) fn update(&mut self) {
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
        let newest = usize::from(self.config.newest && 0 < own);
        self.replay
            .sample(own - newest, beta, &mut self.dice, batch);
        if 0 < newest {
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
        for (&i, (pick, judge)) in batch.lasting.iter().zip(rows) {
            batch.rewards[i] += batch.discounts[i] * judge[argmax(&pick[..actions])];
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
            // The batch ends with the transitions of successes.
            if let Some(successes) = self.shown.as_ref().filter(|_| own <= i) {
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
