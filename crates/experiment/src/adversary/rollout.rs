//! Evaluation of an ado: policy or baseline × ego × test starts → a row.

use std::sync::Arc;

use super::ado::Ado;
use super::nearest_replay::replay_nearest;
use crate::ego::{Command, Fault};
use crate::experiment::{CrashFeatures, badness, clusters, descending};
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::natural::{NaturalnessOfRow, SuccessRarity};
use crate::rulebook::Verdict;
use crate::run_dir::{
    AdversaryId, BrokenRule, ClosingSpeed, ContactSeverity, FailureCount, Partial, Repeated, Row,
    StartRepeated, SuccessContacts,
};
use crate::severity::Impact;
use crate::stats::{Outcomes, StartOutcome, at_most, wilson};
use crate::testbench::{Aftermath, Episode, NoisyStart, Replay, Testbench, count_faults, play};
use crate::world::{Repeats, Scenario};

/// Request of an evaluation.
#[derive(Clone, Copy)]
pub struct EvalRequest<'a> {
    /// World with the ego under test.
    pub scenario: &'a Scenario,
    /// Name of the ego in rows.
    pub ego: &'a str,
    /// Ado to evaluate.
    pub ado: Ado<'a>,
    /// The test starts.
    pub starts: &'a TestStarts,
}

impl EgoUnderTest {
    /// Returns the request to evaluate an ado against the ego.
    #[doc(hidden)]
    pub fn against<'a>(&'a self, ado: Ado<'a>, starts: &'a TestStarts) -> EvalRequest<'a> {
        EvalRequest {
            scenario: self.scenario(),
            ego: self.name(),
            ado,
            starts,
        }
    }
}

/// Outcome of one episode of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Verdict.
    pub verdict: Verdict,
    /// Closing speed, if the agents touched.
    pub closing_speed_mps: Option<f64>,
    /// Effect of the contact on the ego, if the ego takes part in it.
    pub impact: Option<Impact>,
    /// True if a rule was broken between a success and the contact.
    pub violation_before_contact: bool,
    /// Episodes run; only `Ado::Replays` may take more than one.
    pub simulations: u64,
    /// Physics steps spent.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
}

/// Outcome of a start, with the facts for its row and the record of a success.
#[derive(Clone, Debug)]
pub struct EpisodeResult {
    /// Outcome of the start.
    pub outcome: Outcome,
    /// Failure of the ego, if it failed and counts.
    pub(super) failure: Option<RecordedFailure>,
    pub(super) fault: Option<Fault>,
    /// Rules that were broken, if the outcome is a rule violation.
    broken: Vec<usize>,
    pub(super) repeated: Option<StartRepeated>,
    pub(super) success: Option<RecordedSuccess>,
}

/// Record of a success, from which it is played again bit for bit.
#[derive(Clone, Debug, Default)]
pub struct RecordedSuccess {
    /// Joint actions, one per decision. The last one is held.
    pub actions: Vec<usize>,
    /// Commands of an ego that may act otherwise in another run. Empty for other egos.
    pub commands: Arc<[Command]>,
}

impl RecordedSuccess {
    /// Creates the record of a search, which repeats no commands of the ego.
    pub(crate) fn of_actions(actions: Vec<usize>) -> RecordedSuccess {
        RecordedSuccess {
            actions,
            ..RecordedSuccess::default()
        }
    }

    /// Plays the success again, on a bench of `scenario` where the ego repeats itself.
    pub fn play(
        &self,
        scenario: &Scenario,
        bench: &mut Testbench,
        NoisyStart { start, noise }: NoisyStart<'_>,
    ) -> Episode {
        let mut ado = Replay::holding(&self.actions);
        if self.commands.is_empty() {
            return play(bench, start, noise, &mut ado, Aftermath::Play);
        }
        // The ego may act otherwise this time, so its recorded commands drive instead.
        let world = scenario.with_commands(&self.commands);
        // The caller's bench holds the ego itself, so the recorded commands need their
        // own.
        play(&mut world.bench(), start, noise, &mut ado, Aftermath::Play)
    }
}

/// Failure of an ego, with its severity.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedFailure {
    pub(super) shape: CrashFeatures,
    pub(super) badness: [f64; 4],
    /// Rarest driving of an ado. `None` if none drives a vehicle.
    pub rarity: Option<SuccessRarity>,
}

impl RecordedFailure {
    /// Returns the failure in an episode, if the episode is a success of the ados.
    pub fn of(scenario: &Scenario, episode: &Episode) -> Option<RecordedFailure> {
        episode.verdict.is_success().then(|| RecordedFailure {
            shape: CrashFeatures::of(scenario, episode),
            badness: badness(episode),
            rarity: scenario.rarity_of(episode),
        })
    }
}

/// A row and the outcomes behind it.
#[derive(Clone, Debug)]
pub struct Evaluated {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Outcome per start. `None`: trivial or not reached.
    pub outcomes: Vec<Option<Outcome>>,
    /// Record of each success, per start.
    pub successes: Vec<Option<RecordedSuccess>>,
}

impl Evaluated {
    /// Creates the row of the played starts, noted in the log of faults.
    pub fn of(
        request: &EvalRequest<'_>,
        played: Vec<Option<EpisodeResult>>,
        watch: &Watch<'_>,
    ) -> Evaluated {
        let row = request.row(&played);
        note_row(watch, &row);
        let outcomes = played.iter().map(|p| p.as_ref().map(|p| p.outcome));
        Evaluated {
            row,
            outcomes: outcomes.collect(),
            successes: played.into_iter().map(|p| p?.success).collect(),
        }
    }
}

/// Notes a finished row in the log of faults.
pub fn note_row(watch: &Watch<'_>, row: &Row) {
    let name = || format!("ego {}, {}", row.ego, row.ado);
    watch.faults.note_row(name, row.invalid_share());
}

/// Returns the caption of a success that is shown while others are sought.
pub fn success_caption(ego: &str, ado: &AdversaryId, index: usize) -> String {
    format!("ego {ego}, ado {ado}, start {index}")
}

/// Plays every start once and counts.
pub fn eval(request: &EvalRequest<'_>, watch: &Watch<'_>) -> Evaluated {
    watch.phase(&format!("evaluating {}, {}", request.ego, request.ado.id()));
    let bench = || request.scenario.bench();
    let played = request.starts.each(watch, bench, |bench, _, turn| {
        let attempt = request.repeat(bench, turn.index);
        watch.faults.note(turn.index as u64, attempt.fault.as_ref());
        if attempt.episode.verdict.is_success() {
            let caption = || success_caption(request.ego, &request.ado.id(), turn.index);
            // The copy is made only if the viewer has room for it.
            let episode = || attempt.episode.clone();
            watch.show_success(request.scenario, &caption, episode);
        }
        Some(attempt.played(request.scenario, turn.cpu_s()))
    });
    Evaluated::of(request, played, watch)
}

/// One start, played as often as the world requires.
pub struct RepeatedEpisode {
    /// Run that represents all of them.
    episode: Episode,
    /// First fault of any run, even if another run represents them.
    fault: Option<Fault>,
    repeated: Option<StartRepeated>,
    simulations: u64,
    physics_steps: u64,
}

impl RepeatedEpisode {
    /// Creates the result of runs so far, one of which represents them.
    pub fn of(episode: Episode, simulations: u64, physics_steps: u64) -> RepeatedEpisode {
        RepeatedEpisode {
            fault: episode.fault.clone(),
            episode,
            repeated: None,
            simulations,
            physics_steps,
        }
    }

    /// Returns the result that rows count.
    pub fn played(self, scenario: &Scenario, cpu_s: f64) -> EpisodeResult {
        let episode = self.episode;
        let failure = RecordedFailure::of(scenario, &episode);
        let is_success = episode.verdict.is_success();
        EpisodeResult {
            outcome: Outcome {
                verdict: episode.verdict,
                violation_before_contact: episode.is_foul_before_contact(),
                impact: episode.contact.as_ref().and_then(|touch| touch.impact),
                closing_speed_mps: episode.contact.map(|touch| touch.closing_speed_mps),
                simulations: self.simulations,
                physics_steps: self.physics_steps,
                cpu_s,
            },
            failure,
            fault: self.fault,
            broken: episode.broken_rules,
            repeated: self.repeated,
            success: is_success.then(|| RecordedSuccess {
                actions: episode.actions,
                commands: episode.commands.into(),
            }),
        }
    }
}

impl EvalRequest<'_> {
    /// Plays one start, to contact or the horizon after a success.
    pub fn play(&self, bench: &mut Testbench, index: usize) -> Episode {
        self.attempt(bench, index, 0).0
    }

    /// Plays one start as often as the world requires for egos that are not
    /// deterministic.
    fn repeat(&self, bench: &mut Testbench, index: usize) -> RepeatedEpisode {
        let Repeats { runs, gate } = self.scenario.repeats;
        let (mut simulations, mut physics_steps) = (0, 0);
        let mut episodes = Vec::with_capacity(runs as usize);
        // A caller may set any number, and some run has to represent the start.
        for run in 0..runs.max(1) {
            let (episode, more_simulations, more_steps) =
                self.attempt(bench, index, u64::from(run));
            simulations += more_simulations;
            physics_steps += more_steps;
            episodes.push(episode);
        }
        let (repeated, standing) = StartRepeated::of(&episodes, gate);
        RepeatedEpisode {
            fault: episodes.iter().find_map(|episode| episode.fault.clone()),
            episode: episodes.swap_remove(standing),
            // A single run cannot differ from itself, so its row says nothing of
            // repetitions.
            repeated: (runs > 1).then_some(repeated),
            simulations,
            physics_steps,
        }
    }

    /// Plays one run and returns it with its simulations and physics steps.
    fn attempt(&self, bench: &mut Testbench, index: usize, run: u64) -> (Episode, u64, u64) {
        let from = NoisyStart::from(&self.starts.starts[index]);
        // A start may take several replays, which no single actor plays.
        if let Ado::Replays(stored, nearest) = self.ado {
            return replay_nearest(bench, from, stored, nearest);
        }
        // A bench lends itself to the episode, so the shapes are copied.
        let spaces = bench.spaces().clone();
        let mut actor = self.ado.actor(&spaces, run);
        let episode = play(bench, from.start, from.noise, &mut *actor, Aftermath::Play);
        let physics_steps = episode.physics_steps;
        (episode, 1, physics_steps)
    }

    pub(super) fn row(&self, played: &[Option<EpisodeResult>]) -> Row {
        let mut row = blank_row(self.scenario, self.ego, self.ado.id(), self.starts);
        row.method = self.ado.method(self.scenario);
        if let Ado::Trained(_, seed)
        | Ado::Sampled(_, seed, _)
        | Ado::Without(_, seed, _)
        | Ado::Alone(_, seed, _) = self.ado
        {
            row.train_seed = Some(seed);
        }
        // Costs include invalid episodes, because their time was spent as well.
        let all = played.iter().flatten().map(|played| &played.outcome);
        row.physics_steps = all.clone().map(|outcome| outcome.physics_steps).sum();
        // Not `sum`, which is -0.0 of nothing.
        row.cpu_s = all.clone().fold(0.0, |sum, outcome| sum + outcome.cpu_s);
        // The rates below count valid episodes only.
        let valid = all.filter(|outcome| outcome.verdict != Verdict::Invalid);
        let simulations: u64 = valid.clone().map(|outcome| outcome.simulations).sum();
        let violations = valid
            .clone()
            .filter(|o| matches!(o.verdict, Verdict::Foul { .. }))
            .count();
        let uncounted = valid
            .clone()
            .filter(|o| matches!(o.verdict, Verdict::Uncounted { .. }));
        // A world that counts every violation has no such number, rather than 0.
        let some_do_not = !self.scenario.rulebook().counts.is_violation();
        row.uncounted = some_do_not.then(|| uncounted.count());
        let late_violations = valid.clone().filter(|o| o.violation_before_contact).count();
        let impacts: Vec<Impact> = valid.clone().filter_map(|o| o.impact).collect();
        let contacts: Vec<f64> = valid.filter_map(|o| o.closing_speed_mps).collect();
        let marks = played.iter().zip(&self.starts.trivial);
        row.solved = marks
            // A trivial start has no result, and must not look like one that was not
            // reached.
            .map(|(played, trivial)| match (played.as_ref(), trivial) {
                (_, true) => StartOutcome::Trivial,
                (Some(played), _) => StartOutcome::from(&played.outcome.verdict),
                (None, _) => StartOutcome::NotReached,
            })
            .collect();
        count_solved(&mut row);
        let faults = played
            .iter()
            .enumerate()
            .filter_map(|(start, played)| Some((start as u64, played.as_ref()?.fault.as_ref()?)));
        row.faults = count_faults(faults);
        let repeated = played.iter().map(|p| p.as_ref()?.repeated.as_ref());
        row.repeats = Repeated::of(self.scenario.repeats, repeated);
        // Without a valid start the mean is 0, because no row is read back with NaN here.
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        let broken = played.iter().flatten().map(|played| &played.broken[..]);
        row.violations = BrokenRule::counted(self.scenario.rulebook(), broken);
        row.foul_rate = share(violations, row.starts);
        row.foul_before_contact_rate = Some(share(late_violations, row.starts));
        row.contact_rate = share(contacts.len(), row.starts);
        row.closing_speed_mps = ClosingSpeed::of(contacts);
        row.severity = ContactSeverity::of(&impacts);
        let solved = played
            .iter()
            .flatten()
            .filter(|played| played.outcome.verdict.is_success());
        let touching = solved
            .clone()
            .map(|played| &played.outcome)
            .filter(|outcome| outcome.closing_speed_mps.is_some());
        let closing = touching.clone().filter_map(|it| it.closing_speed_mps);
        row.success_closing_mps = ClosingSpeed::of(closing.collect());
        // `None` and not zeros, because without a success nothing was asked.
        row.success_contacts = (row.successes > 0)
            .then(|| SuccessContacts::counted(touching.map(|outcome| outcome.impact)));
        let failures: Vec<Option<&RecordedFailure>> = solved.map(|p| p.failure.as_ref()).collect();
        row.distinct = groups(&failures);
        let kinds = failures.iter().flatten().map(|one| &one.shape.kind);
        row.kinds =
            FailureCount::counted(kinds.map(|kind| (kind.leaf.clone(), kind.agents.clone())));
        row.naturalness = naturalness(self.scenario, &failures);
        row
    }
}

/// Returns the number of groups of similar failures.
///
/// `None`: a failure was not recorded, or there are none.
pub fn groups(failures: &[Option<&RecordedFailure>]) -> Option<usize> {
    // An unrecorded failure may be like another or not, so no number would be right.
    let recorded: Option<Vec<&RecordedFailure>> = failures.iter().copied().collect();
    let mut all = recorded.filter(|all| !all.is_empty())?;
    // Clusters are led by their first member, which must be the worst.
    all.sort_by(|a, b| descending(&a.badness, &b.badness));
    let shapes: Vec<CrashFeatures> = all.iter().map(|one| one.shape.clone()).collect();
    Some(clusters(&shapes).len())
}

/// Returns how natural the ados drove in some failures.
pub fn naturalness(
    scenario: &Scenario,
    failures: &[Option<&RecordedFailure>],
) -> Option<NaturalnessOfRow> {
    let rated: Vec<&SuccessRarity> = failures
        .iter()
        .flatten()
        .filter_map(|it| it.rarity.as_ref())
        .collect();
    scenario.traffic().of_row(&rated)
}

/// Returns a row without results.
pub fn blank_row(scenario: &Scenario, ego: &str, ado: AdversaryId, starts: &TestStarts) -> Row {
    Row {
        world: scenario.name.clone(),
        plant: scenario.plant(),
        judge: scenario.rulebook().judge,
        ego: ego.to_owned(),
        ado,
        method: String::new(),
        train_seed: None,
        warning: None,
        start_seed: starts.seed,
        starts: 0,
        trivial: 0,
        fails_alone: None,
        successes: 0,
        success_rate: 0.0,
        // Without any start, every rate is possible.
        ci95: Some([0.0, 1.0]),
        partial: None,
        specification: scenario.ego_spec().to_string(),
        counts: scenario.rulebook().counts.in_words(),
        at_most: None,
        recall: None,
        beyond_search: None,
        foul_rate: 0.0,
        violations: Vec::new(),
        uncounted: None,
        kinds: Vec::new(),
        distinct: None,
        naturalness: None,
        foul_before_contact_rate: None,
        contact_rate: 0.0,
        closing_speed_mps: None,
        success_closing_mps: None,
        success_contacts: None,
        severity: None,
        invalid: 0,
        faults: Vec::new(),
        repeats: None,
        sims_per_start: 0.0,
        max_sims_per_start: None,
        physics_steps: 0,
        cpu_s: 0.0,
        anytime: Vec::new(),
        unconfirmed: None,
        solved: Outcomes::default(),
    }
}

/// Fills the counts of a row from its `solved`.
pub fn count_solved(row: &mut Row) {
    row.successes = row.solved.count(StartOutcome::Solved);
    row.starts = row.successes + row.solved.count(StartOutcome::Unsolved);
    row.trivial = row.solved.count(StartOutcome::Trivial);
    row.invalid = row.solved.count(StartOutcome::Invalid);
    // An invalid start is in no rate, but nothing about it is left to play.
    let decided = row.starts + row.invalid;
    let missing = row.solved.count(StartOutcome::NotReached);
    row.partial = (missing > 0).then_some(Partial {
        decided,
        of: decided + missing,
    });
    // The starts decided so far were chosen by their cost, so they represent no others.
    let whole = row.partial.is_none();
    // Starts that were not reached may all turn out unsolved, so this share is the least.
    row.success_rate = share(row.successes, row.starts + missing);
    row.ci95 = whole.then(|| wilson(row.successes, row.starts));
    let no_success = row.successes == 0 && row.starts > 0;
    row.at_most = (whole && no_success).then(|| at_most(row.starts));
}

fn share(part: usize, whole: usize) -> f64 {
    match whole {
        0 => 0.0,
        _ => part as f64 / whole as f64,
    }
}
