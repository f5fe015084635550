//! Environments on a test bench each, for every world.

use super::StepInto;
use super::run::EnvRun;
use crate::seed::StartKey;
use crate::stl::Scratch;
use crate::testbench::{Aftermath, NoisyStart, Testbench};
use crate::world::Scenario;

/// Environments with a test bench each.
pub(super) struct BenchRuns {
    benches: Vec<Testbench>,
    runs: Vec<EnvRun>,
    scratch: Scratch,
}

impl BenchRuns {
    pub(super) fn new(world: &Scenario, runs: usize) -> BenchRuns {
        BenchRuns {
            benches: (0..runs).map(|_| world.bench()).collect(),
            runs: EnvRun::several(runs, world.world().clock().decisions()),
            scratch: Scratch::new(),
        }
    }

    pub(super) fn run(&self, at: usize) -> &EnvRun {
        &self.runs[at]
    }

    pub(super) fn begin(&mut self, at: usize, key: StartKey, observation: &mut [f32]) {
        let bench = &mut self.benches[at];
        let start = (bench.draw(key), bench.noise_of(key));
        self.begin_at(at, NoisyStart::from(&start), observation);
        // Only after the call above, which begins a start without a key.
        self.runs[at].key = Some(key);
    }

    pub(super) fn begin_at(&mut self, at: usize, from: NoisyStart<'_>, observation: &mut [f32]) {
        let (bench, run) = (&mut self.benches[at], &mut self.runs[at]);
        run.begin(None);
        // Learners get nothing after a verdict, so it ends the motion.
        bench.begin(from.start, from.noise, Aftermath::Skip);
        // The first sample may have decided the episode already.
        run.verdict = bench.verdict();
        bench.observe(observation);
    }

    pub(super) fn step(&mut self, actions: &[usize], mut into: StepInto<'_>) {
        let count = self.runs.len();
        for (at, (bench, run)) in self.benches.iter_mut().zip(&mut self.runs).enumerate() {
            // The numbers of the last step must not be read as those of this one.
            (into.rewards[at], into.ends[at]) = (0.0, None);
            if run.is_over {
                continue;
            }
            bench.decide(actions[at]);
            run.actions.push(actions[at] as u32);
            run.verdict = bench.verdict();
            bench.observe(into.row(at, count));
            let rulebook = bench.rulebook();
            (into.rewards[at], into.ends[at]) = run.report(rulebook);
            // After a fault only a part is recorded, of which the formula says nothing.
            if run.is_over && bench.fault().is_none() {
                let trace = bench.trace();
                run.robustness = rulebook.spec.robustness(trace, &mut self.scratch);
            }
        }
    }
}
