//! One run under declared traffic: its draws, its density ratios and its end.

use std::sync::Arc;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use super::action_law::ActionLaw;
use super::mixture::Mixture;
use super::record::{DriverAnswer, EgoFailure, KnownFailure, RiskRun, RunEnd, multiply};
use super::start_law::StartLaw;
use crate::ego::{Fault, FaultKind};
use crate::experiment::CrashFeatures;
use crate::preventability::HUMAN_MODELS;
use crate::rulebook::{Rulebook, Verdict};
use crate::scene::Start;
use crate::seed::generator;
use crate::stl::Scratch;
use crate::testbench::{Aftermath, Episode, Testbench};
use crate::world::Scenario;

/// World in which the ego is played to its failure, whatever the rules.
#[derive(Clone)]
pub(super) struct RiskWorld {
    /// World without rules, in which a failure is what the world counts.
    pub(super) scenario: Scenario,
    rules: Arc<Rulebook>,
    pub(super) starts: StartLaw,
    pub(super) actions: ActionLaw,
}

/// Source of a run's actions.
pub(super) enum EpisodeSource<'a> {
    /// A component of the mixture.
    Component(usize),
    /// Random actions, each held for a number of decisions, to find failures.
    Held(usize),
    /// A recorded sequence, whose last action is held.
    Recorded(&'a KnownFailure),
}

/// Request of a run.
pub(super) struct Order<'a> {
    pub(super) seed: u64,
    /// Number of the batch, by which streams differ.
    pub(super) stage: u64,
    pub(super) index: u64,
    pub(super) source: EpisodeSource<'a>,
    /// Determine whether a run without a failure keeps the rules.
    pub(super) judge_held: bool,
    /// Determine whether a failure is preventable.
    pub(super) prevent: bool,
}

impl RiskWorld {
    pub(super) fn new(world: &Scenario, starts: StartLaw, actions: ActionLaw) -> RiskWorld {
        // Contacts that count are judged as in every other verb. Where every violation
        // counts, no run is judged beyond it.
        let judged = if world.rulebook().counts.is_violation() {
            world.counting_every_violation()
        } else {
            world.clone()
        };
        RiskWorld {
            scenario: judged.without_rules(|_| true),
            rules: Arc::new(world.rulebook().clone()),
            starts,
            actions,
        }
    }

    /// Returns the number of inputs of V.
    pub(super) fn inputs(&self) -> usize {
        self.scenario.spaces().observation + self.actions.features() + 1
    }

    /// Returns the inputs of V and the law at the first decision of a start.
    pub(super) fn first_state(&self, bench: &mut Testbench, start: &Start) -> (Vec<f32>, Vec<f64>) {
        bench.begin(start, 0, Aftermath::Skip);
        let memory = self.actions.begin();
        let mut state = DecisionState::new(bench);
        let law = state.read(self, bench, &memory);
        (state.input, law)
    }

    /// Plays a run.
    pub(super) fn play(
        &self,
        bench: &mut Testbench,
        mixture: &Mixture,
        order: &Order<'_>,
    ) -> RiskRun {
        self.play_recorded(bench, mixture, order).0
    }

    /// Plays a run, and returns its episode if it is a failure.
    pub(super) fn play_recorded(
        &self,
        bench: &mut Testbench,
        mixture: &Mixture,
        order: &Order<'_>,
    ) -> (RiskRun, Option<Episode>) {
        // Seeded by its place, so a run is the same on any thread and after a resumption.
        let mut rng = generator("risk", &[order.seed, order.stage, order.index]);
        let mut run = self.begin(mixture, order, &mut rng);
        let Some(start) = self.start_of(order, &run) else {
            return (run, None);
        };
        bench.begin(&start, run.noise, Aftermath::Play);
        let mut played = Vec::new();
        let mut chooser = Chooser::new(order, rng);
        let mut memory = self.actions.begin();
        let mut state = DecisionState::new(bench);
        while !bench.is_done() {
            if let (true, Some(last)) = (bench.is_decided(), played.last().copied()) {
                // The aftermath only shows the contact.
                played.push(last);
                bench.decide(last);
                continue;
            }
            let law = state.read(self, bench, &memory);
            let proposals = mixture.proposals(&state.input, &law);
            let action = chooser.choose(&proposals);
            run.inputs.extend(&state.input);
            run.laws.extend(law.iter().map(|it| *it as f32));
            run.actions.push(action as u32);
            multiply(&mut run.ratios, &proposals, &law, action);
            self.actions.note(&mut memory, action);
            played.push(action);
            bench.decide(action);
        }
        let failed = self.end(bench, &mut run, (order, &start, played));
        // Held actions explore beyond the law on purpose.
        if !run.is_possible() && matches!(order.source, EpisodeSource::Recorded(..)) {
            run.end = RunEnd::Impossible;
        }
        (run, failed)
    }

    pub(super) fn begin(
        &self,
        mixture: &Mixture,
        order: &Order<'_>,
        rng: &mut ChaCha8Rng,
    ) -> RiskRun {
        // Drawn for every source alike, so that equal indices share starts and noise.
        let which = rng.random::<f64>();
        let uniform: Vec<f64> = (0..self.starts.dimensions())
            .map(|_| rng.random::<f64>())
            .collect();
        let noise = rng.next_u64();
        let (component, shares) = match order.source {
            // All of natural traffic is one box.
            EpisodeSource::Component(0) | EpisodeSource::Held(_) => (0, Some(uniform)),
            EpisodeSource::Component(component) => {
                let shares = mixture.tree(component).draw(which, &uniform);
                (component, Some(shares))
            }
            EpisodeSource::Recorded(known) => (0, self.starts.shares(&known.start)),
        };
        // A recorded failure may depend on its noise.
        let noise = match order.source {
            EpisodeSource::Recorded(known) => known.noise,
            _ => noise,
        };
        let is_known = shares.is_some();
        let shares = shares.unwrap_or_default();
        RiskRun {
            ratios: mixture.start_ratios(&shares),
            shares,
            noise,
            actions: Vec::new(),
            inputs: Vec::new(),
            laws: Vec::new(),
            component,
            end: if is_known {
                RunEnd::Outside
            } else {
                RunEnd::Impossible
            },
        }
    }

    pub(super) fn start_of(&self, order: &Order<'_>, run: &RiskRun) -> Option<Start> {
        match order.source {
            EpisodeSource::Recorded(_) if run.end == RunEnd::Impossible => None,
            EpisodeSource::Recorded(known) => Some(known.start.clone()),
            _ => self.starts.start(&run.shares),
        }
    }

    /// Records the end of a run, and returns the episode of a failure.
    fn end(
        &self,
        bench: &Testbench,
        run: &mut RiskRun,
        (order, start, played): (&Order<'_>, &Start, Vec<usize>),
    ) -> Option<Episode> {
        let verdict = bench.verdict().unwrap_or(Verdict::Invalid);
        match verdict {
            Verdict::Invalid => {
                let unknown = || Fault::new(FaultKind::Physics, "the run has no verdict");
                let fault = bench.fault().cloned().unwrap_or_else(unknown);
                run.end = RunEnd::Invalid { fault };
                None
            }
            verdict if verdict.is_success() => {
                let episode = bench.episode(start, run.noise, played);
                run.end = RunEnd::Failed(self.failure(&episode, order.prevent));
                Some(episode)
            }
            _ => {
                let lawful = order
                    .judge_held
                    .then(|| self.broken(bench.trace()).is_none());
                run.end = RunEnd::Held { lawful };
                None
            }
        }
    }

    fn failure(&self, episode: &Episode, prevent: bool) -> EgoFailure {
        // A rule that is broken after the failure did not cause it.
        let mut judged = episode.trace.clone();
        judged.truncate(episode.judged);
        let broken = self.broken(&judged);
        let class = CrashFeatures::of(&self.scenario, episode).class;
        let rules = match broken {
            None => "lawful".to_owned(),
            Some(rule) => format!("breaks “{}”", self.rules.rules[rule].name),
        };
        let answer = || match self.scenario.is_avoided_by_any(episode, &HUMAN_MODELS) {
            Some(true) => DriverAnswer::Avoids,
            Some(false) => DriverAnswer::Fails,
            None => DriverAnswer::NoAnswer,
        };
        EgoFailure {
            mode: format!("{}, {rules}", class.contact_in_words()),
            lawful: broken.is_none(),
            preventable: prevent.then(answer),
        }
    }

    /// Returns the most important rule that a trace does not strictly keep.
    fn broken(&self, trace: &crate::trace::Trace) -> Option<usize> {
        let mut scratch = Scratch::default();
        let rules = self.rules.rules.iter().enumerate();
        let broken = rules.filter(|(_, it)| it.monitor.robustness(trace, &mut scratch) <= 0.0);
        broken.min_by_key(|(_, rule)| rule.priority).map(|(i, _)| i)
    }
}

/// Buffers for the state at a decision.
struct DecisionState {
    input: Vec<f32>,
    observation: Vec<f32>,
    row: Vec<f64>,
}

impl DecisionState {
    fn new(bench: &Testbench) -> DecisionState {
        DecisionState {
            input: Vec::new(),
            observation: vec![0.0; bench.spaces().observation],
            row: vec![0.0; bench.schema().len()],
        }
    }

    /// Reads the inputs of V, and returns the law.
    fn read(
        &mut self,
        world: &RiskWorld,
        bench: &Testbench,
        memory: &super::action_law::LawMemory,
    ) -> Vec<f64> {
        bench.observe(&mut self.observation);
        let trace = bench.trace();
        trace.read_row(trace.len() - 1, &mut self.row);
        self.input.clear();
        self.input.extend(&self.observation);
        memory.features(&world.actions, &mut self.input);
        // With less time left, a failure is less likely in the same state.
        let all = bench.clock().decisions();
        let left = all.saturating_sub(bench.decisions()) as f32 / all as f32;
        self.input.push(left);
        world.actions.probabilities(&self.row, memory)
    }
}

/// Choice of the actions of a run.
struct Chooser<'a> {
    source: &'a EpisodeSource<'a>,
    rng: ChaCha8Rng,
    next: usize,
    last: usize,
}

impl<'a> Chooser<'a> {
    fn new(order: &'a Order<'_>, rng: ChaCha8Rng) -> Chooser<'a> {
        Chooser {
            source: &order.source,
            rng,
            next: 0,
            last: 0,
        }
    }

    fn choose(&mut self, proposals: &[Vec<f64>]) -> usize {
        let at = self.next;
        self.next += 1;
        match self.source {
            EpisodeSource::Component(component) => {
                draw(&proposals[*component], self.rng.random::<f64>())
            }
            EpisodeSource::Held(hold) => {
                if at.is_multiple_of(*hold) {
                    self.last = self.rng.random_range(0..proposals[0].len());
                }
                self.last
            }
            EpisodeSource::Recorded(known) => {
                let action = known.actions.get(at).or(known.actions.last());
                action.copied().unwrap_or(0)
            }
        }
    }
}

/// Returns the action at a share of the probability.
pub(super) fn draw(probabilities: &[f64], share: f64) -> usize {
    let mut left = share;
    let mut last = 0;
    for (action, p) in probabilities.iter().enumerate() {
        // Rounding must not choose an action of probability 0.
        if *p <= 0.0 {
            continue;
        }
        last = action;
        left -= p;
        if left < 0.0 {
            break;
        }
    }
    last
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_follow_their_shares_and_take_no_impossible_action() {
        let law = [0.25, 0.0, 0.5, 0.25, 0.0];
        for (share, action) in [
            (0.0, 0),
            (0.24, 0),
            (0.26, 2),
            (0.74, 2),
            (0.76, 3),
            (1.0, 3),
        ] {
            assert_eq!(draw(&law, share), action, "{share}");
        }
        assert_eq!(draw(&[0.0, 1.0], 0.0), 1);
    }
}
