//! One run under declared traffic: its draws, its density ratios and its end.

use std::sync::Arc;

use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;

use super::action_law::ActionLaw;
use super::mixture::Mixture;
use super::record::{DriverAnswer, EgoFailure, KnownFailure, RiskRun, RunEnd, multiply};
use super::script_search::BY_LAW;
use super::start_law::StartLaw;
use crate::ego::{Fault, FaultKind};
use crate::experiment::FailureKind;
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
    /// A script of a search, with the likeliest action where the law excludes its own.
    Scripted(&'a KnownFailure),
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
            let action = chooser.choose(&proposals, &law);
            run.inputs.extend(&state.input);
            run.laws.extend(law.iter().map(|it| *it as f32));
            run.actions.push(action as u32);
            multiply(&mut run.ratios, &proposals, &law, action);
            self.actions.note(&mut memory, action);
            played.push(action);
            bench.decide(action);
        }
        let manoeuvre = memory.manoeuvre_in_symbols();
        let failed = self.end(
            bench,
            &mut run,
            order,
            RunOf {
                start: &start,
                manoeuvre: &manoeuvre,
            },
            played,
        );
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
            EpisodeSource::Recorded(known) | EpisodeSource::Scripted(known) => {
                (0, self.starts.shares(&known.start))
            }
        };
        // A recorded failure may depend on its noise.
        let noise = match order.source {
            EpisodeSource::Recorded(known) | EpisodeSource::Scripted(known) => known.noise,
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
            // A run that is never played keeps this end.
            end: if is_known {
                RunEnd::Outside
            } else {
                RunEnd::Impossible
            },
        }
    }

    pub(super) fn start_of(&self, order: &Order<'_>, run: &RiskRun) -> Option<Start> {
        match order.source {
            _ if run.end == RunEnd::Impossible => None,
            EpisodeSource::Recorded(known) | EpisodeSource::Scripted(known) => {
                Some(known.start.clone())
            }
            _ => self.starts.start(&run.shares),
        }
    }

    /// Records the end of a run, and returns the episode of a failure.
    fn end(
        &self,
        bench: &Testbench,
        run: &mut RiskRun,
        order: &Order<'_>,
        of: RunOf<'_>,
        played: Vec<usize>,
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
                let episode = bench.episode(of.start, run.noise, played);
                run.end = RunEnd::Failed(self.failure(&episode, of.manoeuvre, order.prevent));
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

    fn failure(&self, episode: &Episode, manoeuvre: &str, prevent: bool) -> EgoFailure {
        // A rule that is broken after the failure did not cause it.
        let mut judged = episode.trace.clone();
        judged.truncate(episode.judged);
        let broken = self.broken(&judged);
        let kind = FailureKind::of(&self.scenario, episode);
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
            mode: format!("{}{}, {rules}", kind.in_words(), after(manoeuvre)),
            lawful: broken.is_none(),
            // The drivers play the encounter again, so they are asked on request only.
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

/// Start of a run, and the phases of the ados up to its verdict.
struct RunOf<'a> {
    start: &'a Start,
    manoeuvre: &'a str,
}

/// Returns a manoeuvre as a part of the words of a kind.
fn after(manoeuvre: &str) -> String {
    match manoeuvre {
        "" => String::new(),
        symbols => format!(" after {symbols}"),
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
        // A bench that has begun has its first sample, so the trace is never empty.
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

    fn choose(&mut self, proposals: &[Vec<f64>], law: &[f64]) -> usize {
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
            EpisodeSource::Scripted(script) => {
                // Drawn at every decision, so that later draws do not depend on the
                // script.
                let share = self.rng.random::<f64>();
                let action = script.actions.get(at).copied().unwrap_or(BY_LAW);
                match law.get(action) {
                    // BY_LAW is no action of the law, which then decides.
                    None => draw(law, share),
                    Some(p) if *p > 0.0 => action,
                    // The traffic cannot produce the script as it is.
                    Some(_) => likeliest(law),
                }
            }
        }
    }
}

/// Returns the likeliest action, the first of equals.
fn likeliest(law: &[f64]) -> usize {
    let greater = |best: usize, at: usize| if law[best] < law[at] { at } else { best };
    (1..law.len()).fold(0, greater)
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
    use super::super::RiskTraffic;
    use super::super::tests::{TRAFFIC, reckless, world};
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

    const NOTHING: fn(&mut KnownFailure) = |_| {};

    /// Plays a recorded sequence in a world, with its rate of braking.
    fn played(
        world: &Scenario,
        rate: &str,
        (headway_m, actions): (f64, &[usize]),
        change: fn(&mut KnownFailure),
        [judge_held, prevent]: [bool; 2],
    ) -> RiskRun {
        let traffic = TRAFFIC.replace("0.02 *", rate);
        let traffic = RiskTraffic::parse(world, "t.ron", &traffic).expect("sound");
        let risk = RiskWorld::new(world, traffic.starts, traffic.actions);
        let mut known = KnownFailure {
            start: Start(vec![headway_m]),
            noise: 77,
            actions: actions.to_vec(),
        };
        change(&mut known);
        let order = Order {
            seed: 3,
            stage: 4,
            index: 5,
            source: EpisodeSource::Recorded(&known),
            judge_held,
            prevent,
        };
        let mut bench = risk.scenario.bench();
        risk.play(&mut bench, &Mixture::natural(1), &order)
    }

    fn recorded(
        rate: &str,
        sequence: (f64, &[usize]),
        change: fn(&mut KnownFailure),
        asked: [bool; 2],
    ) -> RiskRun {
        played(&world(), rate, sequence, change, asked)
    }

    #[test]
    fn a_recorded_sequence_keeps_its_noise_its_last_action_and_its_law() {
        let run = recorded("0.02 *", (24.5, &[1, 0]), NOTHING, [true, false]);
        assert_eq!(run.noise, 77);
        let taken = run.actions.len();
        assert!(taken > 2, "{:?}", run.actions);
        assert!(run.actions[..2] == [1, 0] && run.actions[2..].iter().all(|it| *it == 0));
        // Braking goes on with 0.7, or begins anew by an onset.
        let law = run.law(2);
        let none = law[1] / 0.15;
        assert!((law[0] - (0.7 * none + 1.0 - none)).abs() < 1e-6, "{law:?}");
        assert!(law[1] == law[2] && none > 0.98 && none < 0.99, "{law:?}");
        let onset = 0.02 * (1.0 + 12.0 / 25.0) * 0.5;
        let kept = 0.95 * libm::exp(-onset);
        assert!(
            (f64::from(run.law(0)[1]) - kept).abs() < 1e-6,
            "{:?}",
            run.law(0)
        );
        // The last input is the share of the decisions that are left.
        let left: Vec<f32> = (0..taken)
            .map(|at| *run.input(at).last().expect("it"))
            .collect();
        let all = [1.0, 0.8, 0.6, 0.4, 0.2];
        assert_eq!(left, all[..taken]);
        assert!((run.ratios[0] - 1.0).abs() < 1e-12, "{:?}", run.ratios);
    }

    #[test]
    fn the_first_state_is_what_a_run_reads_first() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let risk = RiskWorld::new(&world, traffic.starts, traffic.actions);
        let run = recorded("0.02 *", (30.0, &[0]), NOTHING, [true, false]);
        let start = Start(vec![30.0]);
        let (input, law) = risk.first_state(&mut risk.scenario.bench(), &start);
        assert_eq!((input.len(), &input[..]), (risk.inputs(), run.input(0)));
        let law: Vec<f32> = law.iter().map(|it| *it as f32).collect();
        assert_eq!(law, run.law(0));
    }

    #[test]
    fn the_end_of_a_run_is_judged_as_far_as_it_was_asked() {
        let held = |asked| recorded("0.02 *", (45.0, &[1]), NOTHING, [asked, true]).end;
        assert_eq!(held(true), RunEnd::Held { lawful: Some(true) });
        assert_eq!(held(false), RunEnd::Held { lawful: None });
        let failed = |asked| {
            let run = recorded("0.02 *", (24.5, &[0]), NOTHING, [true, asked]);
            run.failure().cloned().expect("a failure")
        };
        assert!(failed(false).lawful && failed(false).preventable.is_none());
        assert!(
            failed(true).mode.ends_with(", lawful"),
            "{:?}",
            failed(true)
        );
        assert_eq!(failed(true).preventable, Some(DriverAnswer::Fails));
        // A law without braking cannot produce it, and neither can one of nearer starts.
        let never = recorded("0.0 *", (24.5, &[0]), NOTHING, [true, true]);
        assert_eq!((never.end, never.ratios), (RunEnd::Impossible, vec![0.0]));
        let far = recorded("0.02 *", (24.5, &[0]), |it| it.start.0[0] = 60.0, [true; 2]);
        assert_eq!((far.end, far.actions.len()), (RunEnd::Impossible, 0));
    }

    /// A rule that the ado breaks after the failure did not cause it.
    #[test]
    fn a_failure_is_lawful_if_the_rules_were_kept_up_to_it() {
        // With a larger distance to keep, the ado brakes on before the contact.
        let text = world().text().replace("\"d_safe\": 4.7", "\"d_safe\": 9.0");
        let plain = Scenario::parse("acc.ron", &text)
            .expect("sound")
            .on(crate::sim::PlantKind::Kinematic);
        let start = Start(vec![24.0]);
        let mut bench = plain.without_rules(|_| true).bench();
        bench.begin(&start, 77, Aftermath::Play);
        while !bench.is_done() {
            bench.decide(0);
        }
        let column = |name: &str| bench.trace().signal(name).expect("published");
        let (headways, speeds) = (column("headway"), column("ado.speed"));
        let failed = headways.iter().position(|it| *it < 9.0).expect("a failure");
        let (then_mps, end_mps) = (speeds[failed], speeds[speeds.len() - 1]);
        assert!(
            end_mps + 0.1 < then_mps,
            "{end_mps} at the end, {then_mps} before"
        );
        let failure = |least_mps: f64| {
            let text = plain
                .text()
                .replace("\"v_min\": 0.1", &format!("\"v_min\": {least_mps:?}"));
            assert_ne!(text, plain.text());
            let world = Scenario::parse("acc.ron", &text)
                .expect("sound")
                .on(crate::sim::PlantKind::Kinematic);
            let run = played(&world, "0.02 *", (24.0, &[0]), NOTHING, [true, false]);
            run.failure().cloned().expect("a failure")
        };
        let lawful = failure(0.5 * (then_mps + end_mps));
        assert!(
            lawful.lawful && lawful.mode.ends_with(", lawful"),
            "{lawful:?}"
        );
        let unlawful = failure(then_mps + 0.01);
        let said = "breaks “never stops or reverses”";
        assert!(
            !unlawful.lawful && unlawful.mode.ends_with(said),
            "{unlawful:?}"
        );
    }

    /// Reference drivers are asked about a contact, and either answer is kept.
    #[test]
    fn a_contact_is_preventable_if_a_driver_model_avoids_it() {
        let world = world();
        let ego = reckless(&world, false);
        let answer = |headway_m: f64, actions: &[usize]| {
            let sequence = (headway_m, actions);
            // With this seed the ego speeds up.
            let change = |it: &mut KnownFailure| it.noise = 78;
            let run = played(ego.scenario(), "0.02 *", sequence, change, [true, true]);
            run.failure().and_then(|it| it.preventable)
        };
        assert_eq!(answer(40.0, &[1]), Some(DriverAnswer::Avoids));
        assert_eq!(answer(24.0, &[0]), Some(DriverAnswer::Fails));
    }
}
