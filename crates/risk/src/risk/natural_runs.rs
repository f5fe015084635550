//! Natural runs side by side, which are several times as fast as one after the other.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::action_law::LawMemory;
use super::mixture::Mixture;
use super::record::{RiskRun, RunEnd};
use super::run::{Order, RiskWorld, draw};
use crate::rulebook::Verdict;
use crate::seed::generator;
use crate::testbench::NoisyStart;
use crate::vector_env::{EnvLayout, VectorEnv};

/// Runs side by side.
pub(super) const LANES: usize = 64;

/// Run that is not over.
struct LaneRun {
    rng: ChaCha8Rng,
    memory: LawMemory,
    run: RiskRun,
    has_begun: bool,
}

impl RiskWorld {
    /// Returns environments for natural runs, `None` if the world needs test benches.
    pub(super) fn lanes(&self) -> Option<VectorEnv> {
        let env = VectorEnv::with_rows(&self.scenario, LANES, &self.actions.signals());
        (env.layout() == EnvLayout::Lanes).then_some(env)
    }

    /// Plays at most [`LANES`] natural runs.
    ///
    /// The result has the bits of [`RiskWorld::play`] without decisions. A run that does
    /// not keep ψ_ego is `None`, because a test bench has to show why.
    pub(super) fn play_lanes(
        &self,
        env: &mut VectorEnv,
        mixture: &Mixture,
        orders: &[Order<'_>],
    ) -> Vec<Option<RiskRun>> {
        let width = env.spaces().observation;
        let mut observations = vec![0.0; LANES * width];
        let mut lanes = Vec::with_capacity(orders.len());
        for (at, order) in orders.iter().enumerate() {
            // The order of the draws is that of a single run.
            let mut rng = generator("risk", &[order.seed, order.stage, order.index]);
            let run = self.begin(mixture, order, &mut rng);
            let start = self.start_of(order, &run);
            if let Some(start) = &start {
                let row = &mut observations[at * width..][..width];
                let noise = run.noise;
                env.begin_at(at, NoisyStart { start, noise }, row);
            }
            lanes.push(LaneRun {
                rng,
                memory: self.actions.begin(),
                run,
                has_begun: start.is_some(),
            });
        }
        self.play_out(env, &mut lanes, &mut observations);
        let ended = lanes.into_iter().enumerate();
        ended.map(|(at, lane)| lane.ended(env, at)).collect()
    }

    fn play_out(&self, env: &mut VectorEnv, lanes: &mut [LaneRun], observations: &mut [f32]) {
        let (mut rewards, mut ends) = (vec![0.0; LANES], vec![None; LANES]);
        loop {
            // Environments that are over ignore their action.
            let (mut actions, mut is_over) = (vec![0; LANES], true);
            for (at, lane) in lanes.iter_mut().enumerate() {
                if !lane.has_begun || env.is_over(at) {
                    continue;
                }
                is_over = false;
                let law = self.actions.probabilities(env.row(at), &lane.memory);
                // One number per decision, as a single run draws them, or
                // the bits would differ.
                actions[at] = draw(&law, lane.rng.random::<f64>());
                self.actions.note(&mut lane.memory, actions[at]);
            }
            if is_over {
                return;
            }
            env.step(&actions, observations, &mut rewards, &mut ends);
        }
    }
}

impl LaneRun {
    /// Returns the run if it kept ψ_ego, or never began.
    fn ended(self, env: &VectorEnv, at: usize) -> Option<RiskRun> {
        if !self.has_begun {
            return Some(self.run);
        }
        let is_held = matches!(env.verdict(at), Some(Verdict::Held { .. }));
        is_held.then_some(RiskRun {
            // Lanes know nothing of rules.
            end: RunEnd::Held { lawful: None },
            ..self.run
        })
    }
}
