//! The estimation: natural runs, exploration and a search, then rounds with refitted proposals.

use super::batch::{self, Content, Player};
use super::checks::{Checks, Probe};
use super::counted_rounds::{Hindsight, exemplars};
use super::learning::Learning;
use super::limits::{LimitRuns, RiskLimits};
use super::mixture::Mixture;
use super::natural_counts::NaturalCounts;
use super::pool::{self, RiskEstimate, Round, WeightedFailure, WeightedFault, pooled};
use super::record::{EgoFailure, RiskRun, RunEnd};
use super::report::{EgoRisk, RiskCost, RiskReport, WeightedRuns};
use super::request::RiskRequest;
use super::run::RiskWorld;
use super::run_faults::RunFaults;
use super::script_search::{ScriptSearch, log_likelihood};
use crate::experiment::{EgoUnderTest, Watch, unrepeatable};
use crate::run_dir::{ProgramContents, RunError, bind_programs, file_name, make_dir};
use crate::surrogate::SurrogateWorld;
use crate::world::Scenario;

/// Natural failures from which counting is enough.
pub(super) const ENOUGH: usize = 100;
/// Most runs of the first round. Rounds grow from the second one on.
const FIRST_ROUND: usize = 5_000;
/// Fewest rounds, unless the budget ends.
///
/// An estimate that has not yet drawn its heavy failures is too low and looks narrow, so a
/// stop at the first narrow interval would prefer such estimates.
// With stops after one round, 28 of 40 intervals of `sandwich` held. With three, 38 of 40.
const LEAST_ROUNDS: usize = 3;
/// Fewest runs of a round.
const LEAST_ROUND: usize = 500;
/// Rounds that only learn, where learning has a plant of its own.
const LEARNING: [usize; 3] = [5_000, 5_000, 10_000];

/// State of an estimation.
pub(super) struct Estimation<'a> {
    request: &'a RiskRequest<'a>,
    watch: &'a Watch<'a>,
    players: Vec<Player<'a>>,
    /// Players of runs that only learn, on a plant of their own.
    learners: Vec<Player<'a>>,
    stage: u64,
    natural: Vec<NaturalCounts>,
    /// Faults among all runs on the ego's own plant, by ego.
    faults: Vec<RunFaults>,
    learning: Learning,
    probes: Vec<Probe>,
    /// Counterexamples from elsewhere that the traffic cannot produce, by ego.
    impossible: Vec<usize>,
    /// Kinds of the counterexamples from elsewhere, by ego.
    known_modes: Vec<(usize, String)>,
    /// Kinds of the failures before the first round, by ego.
    early_modes: Vec<(usize, String)>,
    search: ScriptSearch,
    mixture: Mixture,
    rounds: Vec<Vec<Round>>,
    /// Weights of later failures in each round, by ego.
    hindsight: Vec<Hindsight>,
    /// Greatest failing weight before the last round.
    limits: Vec<f64>,
    likeliest: Vec<(usize, f64, RiskRun)>,
    /// Error of the surrogate of every ego, if it has one, m.
    surrogate_errors_m: Vec<Option<f64>>,
    cost: RiskCost,
}

impl RiskRequest<'_> {
    /// Estimates the risk of every ego. `None`: stopped.
    ///
    /// Every round uses proposals from earlier runs only, so its estimate is unbiased.
    ///
    /// # Errors
    /// The disk refuses, or the directory belongs to another request.
    pub fn estimate(&self, watch: &Watch<'_>) -> Result<Option<RiskReport>, RunError> {
        // Stored runs of another request would be counted as runs of this one. Refused
        // first, since a surrogate may take hours of runs.
        if let Some(dir) = &self.dir {
            let named = |ego: &EgoUnderTest| Some((ego.name().to_owned(), ego.program_content()?));
            let programs: ProgramContents = self.egos.iter().filter_map(named).collect();
            for (ego, content) in &programs {
                if !content.not_covered.is_empty() {
                    let missing = content.not_covered.join("; ");
                    watch.note(&format!(
                        "warning: the stored runs of `{ego}` are not bound to {missing}"
                    ));
                }
            }
            // The directory is bound to the programs before any run is stored in it.
            make_dir(dir)?;
            bind_programs(dir, &programs, batch::is_used(dir))?;
            batch::open(dir, &self.fingerprint())?;
        }
        let Some(models) = self.surrogates(watch) else {
            return Ok(None);
        };
        let mut estimation = Estimation::begin(self, models, watch);
        if estimation.run()?.is_none() {
            return Ok(None);
        }
        let mut report = estimation.report();
        for (ego, risk) in self.egos.iter().zip(&mut report.egos) {
            // After all runs, because only a used program shows that it keeps state.
            risk.unrepeatable = unrepeatable(ego.scenario(), ego.name(), |_| None, watch);
        }
        Ok(Some(report))
    }
}

impl<'a> Estimation<'a> {
    pub(super) fn begin(
        request: &'a RiskRequest<'a>,
        models: Vec<Option<SurrogateWorld>>,
        watch: &'a Watch<'a>,
    ) -> Self {
        let traffic = request.traffic;
        let digest = request.fingerprint();
        let player = |at: usize, scenario: &Scenario, learns: bool| {
            let (starts, actions) = (traffic.starts.clone(), traffic.actions.clone());
            // Files of both plants are in one directory.
            let on = if learns { "learning-" } else { "" };
            let world = RiskWorld::new(scenario, starts, actions);
            Player {
                has_lanes: world.lanes().is_some(),
                world,
                seed: request.settings.seed,
                request: digest.clone(),
                name: format!("{at}-{on}{}", file_name(request.egos[at].name())),
                dir: request.dir.clone(),
                watch,
            }
        };
        let egos = request.egos.iter().map(EgoUnderTest::scenario).enumerate();
        let players: Vec<Player<'a>> = egos
            .clone()
            .map(|(at, ego)| player(at, ego, false))
            .collect();
        let plant = request.settings.learn_on;
        let each = egos.map(|(at, ego)| match (&models[at], plant) {
            (Some(model), _) => Some(player(at, &model.scenario, true)),
            (None, Some(plant)) => Some(player(at, &ego.on(plant), true)),
            (None, None) => None,
        });
        // Egos learn from the same draws, so all have a learner or none has.
        let learners: Option<Vec<Player<'a>>> = each.collect();
        let mut cost = RiskCost::default();
        if models.iter().any(Option::is_some) {
            cost.surrogate = request.settings.surrogate.unwrap_or(0) as usize;
        }
        let errors = models.iter().map(|model| model.as_ref()?.error);
        let surrogate_errors_m = errors.map(|it| it.map(|it| it.rms_m)).collect();
        let dimensions = traffic.starts.dimensions();
        let names = request
            .egos
            .iter()
            .map(|ego| ego.name().to_owned())
            .collect();
        let seed = request.settings.seed;
        let world = &players[0].world;
        let decisions = world.scenario.world().clock().decisions();
        let search = ScriptSearch::new(seed, decisions, world.scenario.spaces().actions);
        let learning = Learning::begin(world, names, seed);
        Estimation {
            natural: Vec::new(),
            faults: vec![RunFaults::default(); players.len()],
            learning,
            probes: Vec::new(),
            impossible: vec![0; players.len()],
            known_modes: Vec::new(),
            early_modes: Vec::new(),
            search,
            mixture: Mixture::natural(dimensions),
            rounds: vec![Vec::new(); players.len()],
            hindsight: vec![Hindsight::default(); players.len()],
            limits: vec![0.0; players.len()],
            likeliest: Vec::new(),
            stage: 0,
            cost,
            surrogate_errors_m,
            learners: learners.unwrap_or_default(),
            players,
            request,
            watch,
        }
    }

    /// Plays until an estimate is good enough or the budget is spent. `None`: stopped.
    pub(super) fn run(&mut self) -> Result<Option<()>, RunError> {
        let settings = self.request.settings;
        let [natural_runs, ..] = settings.before_rounds();
        self.watch.phase("natural runs");
        // Nothing is learned from them, so that they can refute the proposals.
        // A stage draws from a stream of its own, so that no run is drawn twice.
        let stage = self.stage;
        self.stage += 1;
        let players = self.players.iter();
        let natural = players.map(|it| it.count(stage, natural_runs, &self.mixture));
        let Some(natural) = natural.collect::<Result<Option<Vec<_>>, _>>()? else {
            return Ok(None);
        };
        self.cost.natural = natural[0].len();
        self.faults = natural.iter().map(|it| it.faults.clone()).collect();
        self.natural = natural;
        // Counted failures need neither proposals nor weights, which could be wrong.
        if self.is_counted() {
            return Ok(Some(()));
        }
        if self.learn_proposals()?.is_none() {
            return Ok(None);
        }
        self.rounds_within(settings.budget)
    }

    /// Plays the runs from which the proposals are learned before the first round.
    fn learn_proposals(&mut self) -> Result<Option<()>, RunError> {
        let settings = self.request.settings;
        let [_, exploring, searching, learning_on_own] = settings.before_rounds();
        self.watch.phase("exploration");
        // Runs on another plant do not count against the budget of an ego.
        let on_own = self.learners.is_empty();
        if self.learn(Content::Exploring(exploring), on_own)?.is_none() {
            return Ok(None);
        }
        if self.search_kinds(searching, on_own)?.is_none() {
            return Ok(None);
        }
        // A surrogate need not fail where its ego does.
        let known_on_own = on_own || settings.surrogate.is_some();
        let known = Content::Known(self.request.known);
        if self.learn(known, known_on_own)?.is_none() {
            return Ok(None);
        }
        let on_own_sizes = [learning_on_own];
        // Runs on another plant are cheap, so more of them are played.
        let sizes: &[usize] = if on_own { &on_own_sizes } else { &LEARNING };
        for size in sizes {
            self.watch.phase("learning rounds");
            if !self.refit() {
                break;
            }
            if self.learn(Content::Round(*size), on_own)?.is_none() {
                return Ok(None);
            }
        }
        Ok(Some(()))
    }

    /// Plays scripts to find failures of every kind. `None`: stopped.
    fn search_kinds(&mut self, runs: usize, on_own: bool) -> Result<Option<()>, RunError> {
        self.watch.phase("search for kinds of failure");
        let request = self.request;
        let starts = &request.traffic.starts;
        let mut left = runs;
        while left > 0 {
            let scripts = self.search.generation(starts, left);
            // Without a start inside the ranges of the world, nothing can be played.
            if scripts.is_empty() {
                break;
            }
            left = left.saturating_sub(scripts.len());
            if self.learn(Content::Scripts(&scripts), on_own)?.is_none() {
                return Ok(None);
            }
        }
        let likely = self.search.likely();
        self.probes.extend(likely.map(|(ego, run)| Probe {
            ego,
            run: run.clone(),
        }));
        Ok(Some(()))
    }

    /// Plays rounds until all checks hold and the interval is narrow enough.
    fn rounds_within(&mut self, budget: usize) -> Result<Option<()>, RunError> {
        let left = budget.saturating_sub(self.cost.of_ego());
        // The third round is twice as large as each of the first two.
        let mut size = FIRST_ROUND.min(left / 4).max(LEAST_ROUND);
        for round in 0.. {
            let left = budget.saturating_sub(self.cost.of_ego());
            let n = size.min(left);
            // The variance of a very small round would be unreliable.
            if n < LEAST_ROUND.min(budget) || n == 0 || !self.refit() {
                break;
            }
            self.watch.phase(&format!("round {}", round + 1));
            // Limits are fixed before the round, or the bound would not hold.
            let egos = 0..self.players.len();
            let limits = egos.map(|ego| self.learning.limit(ego, &self.mixture));
            self.limits = limits.collect();
            let Some(runs) = self.batches(Content::Round(n), false)? else {
                return Ok(None);
            };
            self.cost.rounds += n;
            for (ego, runs) in runs.into_iter().enumerate() {
                self.note_round(ego, runs);
            }
            // Checks replay V on every probe, so the number of rounds comes first.
            let are_enough = round + 1 >= LEAST_ROUNDS;
            if are_enough && (0..self.players.len()).all(|ego| self.is_good(ego)) {
                break;
            }
            // Two small rounds find the failures, larger ones measure them.
            if round >= 1 {
                size *= 2;
            }
        }
        Ok(Some(()))
    }

    /// Returns the number of rounds, from the first, that do not count.
    ///
    /// They are the same for all egos, whose rounds are compared.
    fn set_aside(&self) -> usize {
        let each = self.hindsight.iter().zip(&self.rounds);
        each.map(|(it, rounds)| it.set_aside(rounds))
            .max()
            .unwrap_or(0)
    }

    /// Returns the rounds of an ego that count.
    fn counted(&self, ego: usize) -> &[Round] {
        &self.rounds[ego][self.set_aside().min(self.rounds[ego].len())..]
    }

    fn is_good(&self, ego: usize) -> bool {
        let Some(all) = pooled(self.counted(ego), |_| true) else {
            return false;
        };
        let settings = &self.request.settings;
        // A narrow interval of few effective failures may miss a heavy weight.
        let is_narrow = all.half_width() <= settings.width && ENOUGH as f64 <= all.ess;
        is_narrow && self.checks(ego).refusals.is_empty()
    }

    /// Plays a batch with every ego.
    fn batches(
        &mut self,
        content: Content<'_>,
        learning: bool,
    ) -> Result<Option<Vec<Vec<RiskRun>>>, RunError> {
        let stage = self.stage;
        self.stage += 1;
        let players = if learning && !self.learners.is_empty() {
            &self.learners
        } else {
            &self.players
        };
        let played = players
            .iter()
            .map(|it| it.play(stage, content, &self.mixture));
        played.collect()
    }

    /// Plays a batch of which V is learned, and which is not counted.
    fn learn(&mut self, content: Content<'_>, on_own: bool) -> Result<Option<()>, RunError> {
        let is_known = matches!(content, Content::Known(_));
        let is_search = matches!(content, Content::Scripts(_));
        let Some(all) = self.batches(content, !on_own)? else {
            return Ok(None);
        };
        let runs = all.first().map_or(0, Vec::len);
        if on_own && is_search {
            self.cost.searching += runs;
        } else if on_own {
            self.cost.exploring += runs;
        } else {
            self.cost.learning += runs;
        }
        for (ego, runs) in all.into_iter().enumerate() {
            if on_own {
                self.faults[ego].add(&runs);
            }
            for run in runs {
                // A run of probability 0 has no weight to learn from.
                if run.end == RunEnd::Impossible {
                    // The start of a script may be beyond its law by rounding.
                    self.impossible[ego] += usize::from(!is_search);
                    continue;
                }
                // A counterexample of another ego need not fail this one.
                if is_known && run.failure().is_none() {
                    continue;
                }
                if let Some(failure) = run.failure() {
                    let kind = (ego, failure.mode.clone());
                    if is_known {
                        self.known_modes.push(kind.clone());
                    }
                    if !self.early_modes.contains(&kind) {
                        self.early_modes.push(kind);
                    }
                }
                // A search plays what is hardly ever likely, so only its likeliest are probes.
                if is_search {
                    self.search.add(ego, &run);
                } else if run.failure().is_some() && run.component == 0 && run.is_possible() {
                    self.probes.push(Probe {
                        ego,
                        run: run.clone(),
                    });
                }
                self.learning.add(ego, run);
            }
        }
        // A part of many probes says the same.
        let step = self.probes.len().div_ceil(2000).max(1);
        if step > 1 {
            self.probes = self.probes.iter().step_by(step).cloned().collect();
        }
        Ok(Some(()))
    }

    fn is_counted(&self) -> bool {
        self.natural.iter().all(|it| it.failures() >= ENOUGH)
    }

    fn note_round(&mut self, ego: usize, runs: Vec<RiskRun>) {
        self.faults[ego].add(&runs);
        let mut round = Round {
            draws: vec![0; self.mixture.shares().len()],
            ..Round::default()
        };
        runs.iter().for_each(|run| round.draws[run.component] += 1);
        for (index, run) in runs.iter().enumerate() {
            let weight = self.mixture.weight_among(&run.ratios, &round.draws);
            if matches!(run.end, RunEnd::Invalid { .. }) {
                round.faults.push(WeightedFault {
                    index,
                    component: run.component,
                    weight,
                });
            }
            if let Some(failure) = run.failure() {
                round.failures.push(WeightedFailure {
                    index,
                    component: run.component,
                    weight,
                    mode: failure.mode.clone(),
                    lawful: failure.lawful,
                    preventable: failure.preventable,
                });
                self.note_likely(ego, failure, run);
            }
        }
        let weights: Vec<f64> = round.failures.iter().map(|it| it.weight).collect();
        let found = exemplars(&weights).into_iter();
        let shown: Vec<&RiskRun> = found.map(|at| &runs[round.failures[at].index]).collect();
        self.hindsight[ego].add(&self.mixture, &shown);
        self.rounds[ego].push(round);
        // Only later rounds learn from these runs, which keeps each estimate unbiased.
        for run in runs {
            self.learning.add(ego, run);
        }
    }

    /// Keeps the likeliest failure of every mode.
    fn note_likely(&mut self, ego: usize, failure: &EgoFailure, run: &RiskRun) {
        let log = log_likelihood(run);
        let same = |(other, _, known): &&mut (usize, f64, RiskRun)| {
            *other == ego && known.failure().is_some_and(|it| it.mode == failure.mode)
        };
        match self.likeliest.iter_mut().find(same) {
            // The first of equally likely failures stays.
            Some(known) if log <= known.1 => {}
            Some(known) => *known = (ego, log, run.clone()),
            None => self.likeliest.push((ego, log, run.clone())),
        }
    }

    /// Refits the proposals. Returns false without a known failure.
    fn refit(&mut self) -> bool {
        match self.learning.refit(self.stage) {
            Some(mixture) => {
                self.mixture = mixture;
                true
            }
            None => false,
        }
    }

    fn checks(&self, ego: usize) -> Checks {
        let own = self.probes.iter().filter(|it| it.ego == ego);
        let probes: Vec<&Probe> = own.collect();
        let (natural, limit) = (&self.natural[ego], self.limits[ego]);
        let counted = self.counted(ego);
        let mut checks = Checks::of(counted, natural, limit, &self.mixture, &probes);
        let rounds = &self.rounds[ego];
        let earlier = &rounds[..rounds.len() - counted.len()];
        checks.note_set_aside(earlier);
        let mut modes: Vec<&str> = Vec::new();
        for failure in rounds.iter().flat_map(|it| &it.failures) {
            let is_early = |(of, mode): &(usize, String)| *of == ego && *mode == failure.mode;
            if !modes.contains(&&*failure.mode) && !self.early_modes.iter().any(is_early) {
                modes.push(&failure.mode);
            }
        }
        checks.late_kinds = modes.len();
        checks
    }

    /// Returns the bounds of an ego that hold whatever the proposals missed.
    fn limits_of(&self, ego: usize) -> RiskLimits {
        RiskLimits::of(&LimitRuns {
            rounds: &self.rounds[ego],
            least_rounds: LEAST_ROUNDS,
            natural: &self.natural[ego],
            inside: self.learning.inside(),
            limit: self.limits[ego],
            mixture: &self.mixture,
        })
    }

    pub(super) fn report(mut self) -> RiskReport {
        let all: Vec<EgoRisk> = (0..self.players.len())
            .map(|ego| self.ego_risk(ego))
            .collect();
        for ego in &all {
            // The worst ego decides, as the worst row of a table does.
            let faults = &self.watch.faults;
            faults.note_row(|| ego.ego.clone(), ego.faults.share());
        }
        let (ratio, ratio_between) = match self.ratios(&all) {
            Some([least, most]) if all.iter().any(|ego| ego.between.is_some()) => {
                (None, Some([least, most]))
            }
            ratios => (ratios.map(|[ratio, _]| ratio), None),
        };
        self.cost.egos = all.len();
        let scenario = self.request.egos[0].scenario();
        let traffic = self.request.traffic;
        let report = RiskReport {
            world: scenario.name().to_owned(),
            plant: scenario.plant().to_string(),
            horizon_s: scenario.world().clock().horizon_s,
            traffic: traffic.source.clone(),
            uniform_axes: traffic.uniform_axes.clone(),
            counts: scenario.rulebook().counts.clone(),
            inside: self.learning.inside().probability,
            exposure: traffic.exposure,
            egos: all,
            ratio,
            ratio_between,
            surrogate_errors_m: self.surrogate_errors_m,
            cost: self.cost,
            at_most: None,
        };
        if report.is_result() {
            return report;
        }
        // A ratio of numbers that are no results is none either.
        RiskReport {
            ratio: None,
            ratio_between: None,
            ..report
        }
    }

    /// Returns the ratio of two egos, with the faults of either one as failures in turn.
    ///
    /// The first is the least that faults allow, and the second the most.
    fn ratios(&self, all: &[EgoRisk]) -> Option<[RiskEstimate; 2]> {
        if self.rounds.len() != 2 {
            return None;
        }
        let [first, second] = [0, 1].map(|ego| self.counted(ego));
        if !all.iter().all(EgoRisk::is_weighted) {
            // The ratio is least with the fewest failures of the first ego and the most
            // of the second.
            let [a, b] = [all[0].least_and_most()?, all[1].least_and_most()?];
            return Some([a[0].over(&b[1]), a[1].over(&b[0])]);
        }
        // Egos share their draws in rounds, which makes the ratio of rounds narrower.
        let failing = |rounds: &[Round]| -> Vec<Round> {
            rounds.iter().map(Round::with_failing_faults).collect()
        };
        let least = pool::ratio(first, &failing(second))?;
        Some([least, pool::ratio(&failing(first), second)?])
    }

    fn ego_risk(&self, ego: usize) -> EgoRisk {
        let name = self.request.egos[ego].name();
        let natural = &self.natural[ego];
        if self.is_counted() {
            return EgoRisk::counted(name, natural);
        }
        let likeliest = self
            .likeliest
            .iter()
            .filter(|(of, ..)| *of == ego)
            .map(|(_, _, run)| run.clone())
            .collect();
        let checks = self.checks(ego);
        let known: Vec<&str> = self
            .known_modes
            .iter()
            .filter(|(of, _)| *of == ego)
            .map(|(_, mode)| mode.as_str())
            .collect();
        let runs = WeightedRuns {
            rounds: self.counted(ego),
            limits: self.limits_of(ego),
            inside: self.learning.inside(),
            faults: self.faults[ego].clone(),
            impossible: self.impossible[ego],
            likeliest,
        };
        EgoRisk::weighted(name, runs, natural, checks).with_known(&known)
    }
}

#[cfg(test)]
mod tests {
    use super::super::RiskTraffic;
    use super::super::record::KnownFailure;
    use super::super::tests::{TRAFFIC, directory, traffic, world};
    use super::super::two_modes;
    use super::*;
    use crate::ego::Fault;
    use crate::scene::Start;
    use crate::sim::PlantKind;

    fn failed(mode: &str, action: u32) -> RiskRun {
        RiskRun {
            actions: vec![action],
            inputs: vec![0.0],
            laws: vec![0.1, 0.2, 0.7],
            ..RiskRun::ending(RunEnd::Failed(EgoFailure {
                mode: mode.to_owned(),
                lawful: mode == "lawful",
                preventable: None,
            }))
        }
    }

    #[test]
    fn a_round_has_its_failures_its_faults_and_the_likeliest_of_each_kind() {
        let (world, dir) = (world(), directory("risk-round"));
        let traffic = traffic(&world, &dir);
        let egos = [EgoUnderTest::nominal(&world)];
        let request = RiskRequest::new(&traffic, &egos);
        let watch = Watch::unwatched();
        let mut estimation = Estimation::begin(&request, vec![None], &watch);
        let invalid = RunEnd::Invalid {
            fault: Fault::error("x"),
        };
        let runs = vec![
            failed("lawful", 1),
            RiskRun::ending(RunEnd::Outside),
            failed("broken", 0),
            RiskRun::ending(invalid),
            failed("lawful", 2),
            failed("lawful", 0),
        ];
        estimation.note_round(0, runs);
        let round = &estimation.rounds[0][0];
        assert_eq!((round.len(), round.failures.len()), (6, 4));
        let indices: Vec<(usize, bool)> = round
            .failures
            .iter()
            .map(|it| (it.index, it.lawful))
            .collect();
        assert_eq!(indices, [(0, true), (2, false), (4, true), (5, true)]);
        assert_eq!((round.faults.len(), round.faults[0].index), (1, 3));
        assert_eq!(round.faults[0].weight, 1.0);
        assert_eq!(estimation.faults[0].invalid, 1);
        // The law prefers action 2, and each kind has one.
        let likeliest = estimation
            .likeliest
            .iter()
            .map(|(ego, _, run)| (*ego, run.actions[0]));
        assert_eq!(likeliest.collect::<Vec<_>>(), [(0, 2), (0, 0)]);
        std::fs::remove_dir_all(&dir).expect("removed");
    }

    /// Round of 10,000 natural draws, of which some fail and others end in a fault.
    fn round(failures: usize, faults: usize) -> Round {
        let failure = |index| WeightedFailure {
            index,
            component: 0,
            weight: 0.1,
            mode: "contact".to_owned(),
            lawful: true,
            preventable: None,
        };
        let fault = |index| WeightedFault {
            index,
            component: 0,
            weight: 0.1,
        };
        Round {
            draws: vec![10_000],
            failures: (0..failures).map(failure).collect(),
            faults: (5000..5000 + faults).map(fault).collect(),
        }
    }

    #[test]
    fn an_estimate_is_good_if_it_is_narrow_rests_on_enough_and_passes_its_checks() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world)];
        let is_good = |width: f64, rounds: Vec<Round>, natural: Vec<RiskRun>| {
            let mut request = RiskRequest::new(&traffic, &egos);
            request.settings.width = width;
            let watch = Watch::unwatched();
            let mut estimation = Estimation::begin(&request, vec![None], &watch);
            let mut counts = NaturalCounts::default();
            counts.add(natural);
            (estimation.natural, estimation.rounds) = (vec![counts], vec![rounds]);
            estimation.is_good(0)
        };
        assert!(is_good(0.25, vec![round(101, 0)], Vec::new()));
        // Its half-width is 22 %.
        assert!(!is_good(0.21, vec![round(101, 0)], Vec::new()));
        assert!(!is_good(0.25, vec![round(99, 0)], Vec::new()));
        assert!(!is_good(0.25, Vec::new(), Vec::new()));
        // Nature fails in every run.
        assert!(!is_good(
            0.25,
            vec![round(101, 0)],
            vec![failed("lawful", 1); 50]
        ));
    }

    #[test]
    fn a_ratio_of_weighted_risks_has_both_ends_of_what_faults_allow() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world), EgoUnderTest::nominal(&world)];
        let request = RiskRequest::new(&traffic, &egos);
        let watch = Watch::unwatched();
        let report = |rounds: [Round; 2]| {
            let mut estimation = Estimation::begin(&request, vec![None; 2], &watch);
            estimation.natural = vec![NaturalCounts::default(); 2];
            estimation.rounds = rounds.map(|round| vec![round]).into();
            estimation.report()
        };
        let of = |it: Option<RiskEstimate>| it.map(|it| (it.probability * 1e9).round());
        let sound = report([round(130, 0), round(260, 0)]);
        assert_eq!((of(sound.ratio), sound.ratio_between), (Some(5e8), None));
        assert_eq!((sound.cost.egos, sound.inside), (2, 1.0));
        // Faults of the second ego may only lower the ratio, and those of the first raise it.
        let faulty = report([round(130, 13), round(260, 26)]);
        assert!(faulty.is_result() && faulty.ratio.is_none());
        let between = faulty.ratio_between.expect("faults");
        let ends = between.map(|it| (it.probability * 1e9).round());
        assert_eq!(ends, [(1e9_f64 * 130.0 / 286.0).round(), 5.5e8]);
        // Numbers that are no results have no ratio.
        let few = report([round(10, 0), round(130, 0)]);
        assert!(!few.is_result() && few.ratio.is_none() && few.ratio_between.is_none());
        let few = report([round(10, 2), round(130, 0)]);
        assert!(few.ratio.is_none() && few.ratio_between.is_none());
    }

    #[test]
    fn each_ego_has_its_own_likeliest_failures() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world), EgoUnderTest::nominal(&world)];
        let request = RiskRequest::new(&traffic, &egos);
        let watch = Watch::unwatched();
        let mut estimation = Estimation::begin(&request, vec![None; 2], &watch);
        estimation.note_round(0, vec![failed("lawful", 1)]);
        estimation.note_round(1, vec![failed("lawful", 2), failed("lawful", 0)]);
        estimation.note_round(0, vec![failed("lawful", 0)]);
        let likeliest = estimation
            .likeliest
            .iter()
            .map(|(ego, _, run)| (*ego, run.actions[0]));
        assert_eq!(likeliest.collect::<Vec<_>>(), [(0, 1), (1, 2)]);
        // Later rounds learn from all of them.
        assert_eq!(estimation.learning.runs(), 4);
    }

    fn known(headway_m: f64, action: usize) -> KnownFailure {
        KnownFailure {
            start: Start(vec![headway_m]),
            noise: 0,
            actions: vec![action],
        }
    }

    #[test]
    fn known_counterexamples_count_for_the_egos_that_they_fail() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world), EgoUnderTest::nominal(&world)];
        // One that fails both egos, one that does not, and one that is impossible.
        let all = [known(24.5, 0), known(45.0, 1), known(1e6, 0)];
        let mut request = RiskRequest::new(&traffic, &egos);
        request.known = &all;
        let watch = Watch::unwatched();
        let mut estimation = Estimation::begin(&request, vec![None; 2], &watch);
        let learned = estimation.learn(Content::Known(&all), true);
        assert_eq!(learned.expect("no disk"), Some(()));
        assert_eq!(
            (estimation.cost.exploring, estimation.cost.learning),
            (3, 0)
        );
        assert_eq!(estimation.impossible, [1, 1]);
        assert_eq!(estimation.faults[1].runs, 3);
        let probes = estimation
            .probes
            .iter()
            .map(|it| (it.ego, it.run.failure().is_some()));
        assert_eq!(probes.collect::<Vec<_>>(), [(0, true), (1, true)]);
        let modes = estimation.known_modes.iter().map(|(ego, _)| *ego);
        assert_eq!(modes.collect::<Vec<_>>(), [0, 1]);
        // A run that held teaches nothing about counterexamples.
        assert_eq!(estimation.learning.runs(), 2);
    }

    #[test]
    fn probes_are_failures_that_nature_can_draw() {
        let world = world();
        // No ado begins to brake.
        let never = TRAFFIC.replace("0.02 *", "0.0 *");
        let [rare, never] =
            [TRAFFIC, &never].map(|text| RiskTraffic::parse(&world, "t.ron", text).expect("sound"));
        let egos = [EgoUnderTest::nominal(&world)];
        let probes = |traffic: &RiskTraffic| {
            let request = RiskRequest::new(traffic, &egos);
            let watch = Watch::unwatched();
            let mut estimation = Estimation::begin(&request, vec![None], &watch);
            let learned = estimation.learn(Content::Exploring(2000), true);
            assert_eq!(learned.expect("no disk"), Some(()));
            estimation.probes.len()
        };
        assert_eq!(probes(&never), 0);
        assert!(probes(&rare) > 0);
    }

    /// Estimates a world of two modes by proposals that know one of them.
    fn blind(world: &Scenario, traffic: &RiskTraffic, seed: u64) -> RiskReport {
        let egos = [EgoUnderTest::nominal(world)];
        let mut request = RiskRequest::new(traffic, &egos);
        (request.settings.seed, request.settings.width) = (seed, 0.1);
        let watch = Watch::unwatched();
        let mut estimation = Estimation::begin(&request, vec![None], &watch);
        let natural = estimation.players[0].count(0, 1000, &estimation.mixture);
        estimation.natural = vec![natural.expect("no disk").expect("not stopped")];
        estimation.stage = 1;
        // The lead car brakes throughout, from different decisions on.
        let braking = |wait: usize| KnownFailure {
            start: traffic.starts.start(&[0.5; 8]).expect("inside"),
            noise: 0,
            actions: [&vec![1; wait][..], &[0]].concat(),
        };
        let known: Vec<KnownFailure> = (0..3).map(braking).collect();
        let learned = estimation.learn(Content::Known(&known), true);
        assert_eq!(learned.expect("no disk"), Some(()));
        assert!(!estimation.probes.is_empty());
        let played = estimation.rounds_within(8_000);
        assert_eq!(played.expect("no disk"), Some(()));
        estimation.report()
    }

    /// What no proposal knew is found late, and is never a narrow interval beside the truth.
    #[test]
    fn an_estimate_that_begins_blind_to_a_mode_says_so_or_is_right() {
        let world = two_modes::world();
        let traffic = two_modes::traffic(&world, two_modes::TURNS[0]);
        let exact = two_modes::exact_of(&world, &traffic);
        let report = blind(&world, &traffic, 1);
        let ego = &report.egos[0];
        assert!(two_modes::holds(ego, &exact), "{report} of {exact:?}");
        assert_ne!(
            two_modes::covers(ego, &exact),
            Some(false),
            "{report} of {exact:?}"
        );
        let checks = ego.checks.as_ref().expect("weighted");
        assert!(checks.late_kinds > 0, "{report}");
    }

    #[test]
    fn runs_on_another_plant_cost_the_ego_nothing() {
        let world = world();
        // From so far ahead nothing fails, so that no round follows.
        let far = TRAFFIC.replace(
            "mean: 35.0, sd: 2.5, within: (24.0, 46.0)",
            "mean: 45.0, sd: 1.0, within: (44.0, 46.0)",
        );
        let traffic = RiskTraffic::parse(&world, "t.ron", &far).expect("sound");
        let egos = [EgoUnderTest::nominal(&world)];
        let all = [known(45.0, 1)];
        let costs = |learn_on: Option<PlantKind>, surrogate: Option<u64>| {
            let mut request = RiskRequest::new(&traffic, &egos);
            request.known = &all;
            request.settings.budget = 100;
            request.settings.natural = 50;
            (request.settings.learn_on, request.settings.surrogate) = (learn_on, surrogate);
            let watch = Watch::unwatched();
            let mut estimation = Estimation::begin(&request, vec![None], &watch);
            let plants = estimation
                .learners
                .iter()
                .filter_map(|it| it.world.scenario.plant().plant());
            assert_eq!(plants.collect::<Vec<_>>(), Vec::from_iter(learn_on));
            assert!(estimation.learn_proposals().expect("no disk").is_some());
            let cost = estimation.cost;
            assert_eq!(cost.of_ego(), estimation.faults[0].runs);
            [cost.exploring, cost.searching, cost.learning]
        };
        // Five runs explore, ten search, and one counterexample is known.
        assert_eq!(costs(None, None), [6, 10, 0]);
        assert_eq!(costs(Some(PlantKind::Rigid), None), [0, 0, 16]);
        // A surrogate need not fail where its ego does.
        assert_eq!(costs(Some(PlantKind::Rigid), Some(5)), [1, 0, 15]);
    }
}
