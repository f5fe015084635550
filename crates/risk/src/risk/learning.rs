//! Learning of the proposals: runs, kinds of failure, V and the tilted starts.

use indexmap::IndexMap;
use rand::RngExt;
use rayon::prelude::*;

use super::decisions::ActionValues;
use super::mixture::Mixture;
use super::pool::RiskEstimate;
use super::record::RiskRun;
use super::run::RiskWorld;
use super::start_tree::StartTree;
use super::value_network::ValueNetwork;
use crate::seed::generator;

/// Most kinds of failure with a proposal of their own.
const MODES: usize = 6;
/// Failures of a kind before it gets a proposal.
const MODE_FAILURES: usize = 10;
/// Starts by which the proposals of starts are fitted.
const POOL: usize = 8192;
/// Most runs of a fit, and most of them that fail.
const FITTED: (usize, usize) = (15_000, 7_500);

/// Inputs of V and the law at the first decision of a start.
type FirstState = (Vec<f32>, Vec<f64>);

/// Runs of which V is learned, and V.
pub(super) struct Learning {
    /// Runs with the number of the ego of each.
    data: Vec<(usize, RiskRun)>,
    egos: Vec<String>,
    /// Kinds of failure with a head of their own.
    modes: Vec<String>,
    value: Option<ValueNetwork>,
    /// Natural starts with their first states, `None` outside X_init.
    pool: Vec<(Vec<f64>, Option<FirstState>)>,
    /// Inputs of V, and joint actions.
    sizes: (usize, usize),
    dimensions: usize,
    seed: u64,
}

impl Learning {
    /// Draws natural starts, from which the tilted starts are fitted.
    pub(super) fn begin(world: &RiskWorld, egos: Vec<String>, seed: u64) -> Learning {
        let law = &world.starts;
        // No episode is played, so one bench is fast enough.
        let mut bench = world.scenario.bench();
        let drawn = (0..POOL as u64).map(|index| {
            let mut rng = generator("risk-pool", &[seed, index]);
            let shares: Vec<f64> = (0..law.dimensions()).map(|_| rng.random::<f64>()).collect();
            let start = law.start(&shares);
            let state = start.map(|start| world.first_state(&mut bench, &start));
            (shares, state)
        });
        Learning {
            data: Vec::new(),
            egos,
            modes: Vec::new(),
            value: None,
            pool: drawn.collect(),
            sizes: (world.inputs(), world.scenario.spaces().actions),
            dimensions: law.dimensions(),
            seed,
        }
    }

    /// Returns the share of the law of starts inside X_init, exact if all are inside.
    pub(super) fn inside(&self) -> RiskEstimate {
        let starts = self.pool.iter().filter(|(_, state)| state.is_some());
        // At least one, because risks are divided by it.
        let inside = starts.count().max(1);
        let counted = RiskEstimate::counted(inside, POOL);
        if inside < POOL {
            counted
        } else {
            RiskEstimate {
                interval: [1.0; 2],
                ..counted
            }
        }
    }

    /// Adds a run of an ego.
    pub(super) fn add(&mut self, ego: usize, run: RiskRun) {
        // A start outside X_init has no decision to learn from.
        if !run.actions.is_empty() {
            self.data.push((ego, run));
        }
    }

    /// Returns the number of runs of which V is learned.
    #[cfg(test)]
    pub(super) fn runs(&self) -> usize {
        self.data.len()
    }

    /// Refits V and the mixture. `None` without a known failure.
    ///
    /// `stage` is the number of batches so far, by which random numbers differ.
    pub(super) fn refit(&mut self, stage: u64) -> Option<Mixture> {
        self.forget();
        self.add_modes();
        let (failing, held): (Vec<_>, Vec<_>) = self
            .data
            .iter()
            .partition(|(_, run)| run.failure().is_some());
        if failing.is_empty() {
            return None;
        }
        let chosen = self.latest_of_each(&failing);
        // At most half of the runs fail, so this is never below 0.
        let others = FITTED.0 - chosen.len();
        let held = &held[held.len().saturating_sub(others)..];
        let fitted: Vec<(&RiskRun, Vec<bool>)> = chosen
            .iter()
            .chain(held)
            .map(|(ego, run)| (run, self.heads_of(*ego, run)))
            .collect();
        let (inputs, actions) = self.sizes;
        let heads = 1 + self.modes.len();
        let sizes = [inputs, heads, actions];
        let fresh = || ValueNetwork::new(sizes, self.seed);
        // The last network is close already, so a fit continues from it.
        let mut value = self.value.clone().unwrap_or_else(fresh);
        // With one seed for all fits, each would draw its rows in the same places.
        value.fit(&fitted, self.seed.wrapping_add(stage));
        let mixture = Mixture::of(value.clone(), self.start_trees(&value));
        self.value = Some(value);
        Some(mixture)
    }

    /// Returns as many failing runs as a fit reads: the latest of each kind.
    fn latest_of_each<'b>(&self, failing: &[&'b (usize, RiskRun)]) -> Vec<&'b (usize, RiskRun)> {
        let mut kinds: IndexMap<Option<usize>, Vec<&(usize, RiskRun)>> = IndexMap::new();
        for pair in failing {
            let label = self.label(pair.0, &pair.1);
            let kind = self
                .modes
                .iter()
                .position(|mode| Some(mode) == label.as_ref());
            kinds.entry(kind).or_default().push(pair);
        }
        // The rarest first, because what it leaves over goes to the others.
        kinds.sort_by(|_, a, _, b| a.len().cmp(&b.len()));
        let (mut left, mut chosen) = (FITTED.1, Vec::new());
        let groups = kinds.len();
        for (at, runs) in kinds.into_values().enumerate() {
            let most = runs.len().min(left / (groups - at));
            left -= most;
            // The latest runs come from the best proposals so far.
            chosen.extend(&runs[runs.len() - most..]);
        }
        chosen
    }

    /// Drops the earliest runs without a failure, of which no fit reads so many.
    fn forget(&mut self) {
        let held = self.data.iter().filter(|(_, run)| run.failure().is_none());
        let mut excess = held.count().saturating_sub(FITTED.0);
        self.data.retain(|(_, run)| {
            let drop = excess > 0 && run.failure().is_none();
            excess -= usize::from(drop);
            !drop
        });
    }

    /// Adds kinds of failure with enough failures. V then begins anew.
    fn add_modes(&mut self) {
        let mut counts: IndexMap<String, usize> = IndexMap::new();
        for (ego, run) in &self.data {
            if let Some(mode) = self.label(*ego, run) {
                *counts.entry(mode).or_default() += 1;
            }
        }
        counts.retain(|mode, count| *count >= MODE_FAILURES && !self.modes.contains(mode));
        // The most frequent first, because there are few heads.
        counts.sort_by(|_, a, _, b| b.cmp(a));
        let room = MODES.saturating_sub(self.modes.len());
        let new: Vec<String> = counts.into_keys().take(room).collect();
        if !new.is_empty() {
            self.modes.extend(new);
            // A network has a fixed number of heads.
            self.value = None;
        }
    }

    /// Returns the kind of a run's failure. `None` without one.
    fn label(&self, ego: usize, run: &RiskRun) -> Option<String> {
        let mode = &run.failure()?.mode;
        // Egos fail in different states, so their kinds are learned apart.
        Some(match &self.egos[..] {
            [_] => mode.clone(),
            egos => format!("{}: {mode}", egos[ego]),
        })
    }

    fn heads_of(&self, ego: usize, run: &RiskRun) -> Vec<bool> {
        let label = self.label(ego, run);
        let modes = self.modes.iter();
        let of_mode = modes.map(|mode| label.as_ref() == Some(mode));
        // Head 0 is of any failure, the others of one kind each.
        std::iter::once(label.is_some()).chain(of_mode).collect()
    }

    /// Fits the proposals of starts to V at the first decisions.
    fn start_trees(&self, value: &ValueNetwork) -> Vec<StartTree> {
        let actions = self.sizes.1;
        let rows = self.pool.par_iter().map(|(_, state)| match state {
            // A start outside X_init cannot fail.
            None => vec![0.0; value.heads()],
            Some((input, law)) => {
                let values = value.values(input);
                let mean = |own: &[f64]| own.iter().zip(law).map(|(v, p)| v * p).sum();
                values.chunks(actions).map(mean).collect()
            }
        });
        let rated: Vec<Vec<f64>> = rows.collect();
        let tree = |head: usize, of: fn(f64) -> f64| {
            let pairs = self
                .pool
                .iter()
                .zip(&rated)
                .map(|((shares, _), values)| (shares.clone(), of(values[head])));
            StartTree::fit(&pairs.collect::<Vec<_>>(), self.dimensions)
        };
        // The first proposal tilts by the root of V, as its actions do.
        let soft = std::iter::once(tree(0, libm::sqrt));
        let heads = (0..value.heads()).map(|head| tree(head, |value| value));
        soft.chain(heads).collect()
    }

    /// Returns the greatest weight of an ego's failures so far, under a mixture.
    pub(super) fn limit(&self, ego: usize, mixture: &Mixture) -> f64 {
        let fails = |run: &RiskRun| run.failure().is_some() && run.is_possible();
        let known: Vec<&RiskRun> = self
            .data
            .iter()
            .filter(|(of, run)| *of == ego && fails(run))
            .map(|(_, run)| run)
            .collect();
        // Evenly over all rounds, because the weights of earlier ones are larger.
        let step = known.len().div_ceil(4000).max(1);
        let known: Vec<&RiskRun> = known.into_iter().step_by(step).collect();
        let weights = known.par_iter().map(|run| mixture.weight_of(run));
        weights.reduce(|| 0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::{EgoFailure, RunEnd};
    use super::*;

    fn learning(egos: &[&str]) -> Learning {
        Learning {
            data: Vec::new(),
            egos: egos.iter().map(|it| (*it).to_owned()).collect(),
            modes: Vec::new(),
            value: None,
            pool: Vec::new(),
            sizes: (1, 2),
            dimensions: 1,
            seed: 0,
        }
    }

    fn run(mode: Option<&str>) -> RiskRun {
        let end = match mode {
            None => RunEnd::Held { lawful: None },
            Some(mode) => RunEnd::Failed(EgoFailure {
                mode: mode.to_owned(),
                lawful: true,
                preventable: None,
            }),
        };
        RiskRun {
            actions: vec![0],
            inputs: vec![0.0],
            laws: vec![0.5, 0.5],
            ..RiskRun::ending(end)
        }
    }

    fn with(mut learning: Learning, modes: &[(&str, usize)]) -> Learning {
        for (mode, count) in modes {
            (0..*count).for_each(|_| learning.add(0, run(Some(mode))));
        }
        learning.add_modes();
        learning
    }

    #[test]
    fn the_most_frequent_kinds_have_a_proposal_of_their_own() {
        let few = with(learning(&["ego"]), &[("a", 9), ("b", 10)]);
        assert_eq!(few.modes, ["b"]);
        let all = [
            ("a", 11),
            ("b", 12),
            ("c", 13),
            ("d", 14),
            ("e", 15),
            ("f", 16),
            ("g", 17),
        ];
        let mut most = with(learning(&["ego"]), &all);
        let six = ["g", "f", "e", "d", "c", "b"];
        assert_eq!(most.modes, six);
        // Known kinds stay, and there is no room for others.
        most.value = Some(ValueNetwork::flat([1, 7, 2]));
        let more = with(most, &[("h", 50)]);
        assert_eq!(more.modes, six);
        assert!(more.value.is_some());
        // A new kind needs a V with another head.
        let mut few = few;
        few.value = Some(ValueNetwork::flat([1, 2, 2]));
        let more = with(few, &[("a", 1)]);
        assert_eq!(more.modes, ["b", "a"]);
        assert!(more.value.is_none());
    }

    #[test]
    fn heads_are_of_all_failures_and_of_each_kind() {
        let one = with(learning(&["ego"]), &[("a", 20), ("b", 10)]);
        assert_eq!(one.heads_of(0, &run(Some("b"))), [true, false, true]);
        assert_eq!(one.heads_of(0, &run(Some("c"))), [true, false, false]);
        assert_eq!(one.heads_of(0, &run(None)), [false; 3]);
        // Kinds of two egos are different kinds.
        let two = with(learning(&["new", "old"]), &[("a", 20)]);
        assert_eq!(two.modes, ["new: a"]);
        assert_eq!(two.heads_of(1, &run(Some("a"))), [true, false]);
    }

    #[test]
    fn the_earliest_runs_without_a_failure_are_forgotten() {
        let mut all = learning(&["ego"]);
        all.add(0, RiskRun::ending(RunEnd::Outside));
        assert!(all.data.is_empty());
        all.add(0, run(Some("a")));
        for at in 0..FITTED.0 + 2 {
            let mut run = run(None);
            run.noise = at as u64;
            all.add(0, run);
        }
        all.forget();
        assert_eq!(all.data.len(), FITTED.0 + 1);
        assert!(all.data[0].1.failure().is_some());
        assert_eq!(all.data[1].1.noise, 2);
        assert!(learning(&["ego"]).refit(0).is_none());
    }

    #[test]
    fn a_fit_reads_the_latest_runs_of_every_kind() {
        let mut all = with(
            learning(&["ego"]),
            &[("rare", 20), ("often", FITTED.1 + 50)],
        );
        all.data.last_mut().expect("a run").1.noise = 7;
        let failing: Vec<&(usize, RiskRun)> = all.data.iter().collect();
        let chosen = all.latest_of_each(&failing);
        let of = |mode: &str| {
            let is = |it: &&&(usize, RiskRun)| it.1.failure().is_some_and(|it| it.mode == mode);
            chosen.iter().filter(is).count()
        };
        assert_eq!([of("rare"), of("often")], [20, FITTED.1 - 20]);
        assert_eq!(chosen.last().expect("a run").1.noise, 7);
    }

    #[test]
    fn a_limit_is_the_greatest_weight_of_an_ego_s_own_possible_failures() {
        let mut all = learning(&["new", "old"]);
        let mixture = Mixture::natural(1);
        all.add(1, run(Some("a")));
        all.add(0, run(None));
        let mut impossible = run(Some("a"));
        impossible.ratios = vec![0.0];
        all.add(0, impossible);
        assert_eq!(all.limit(0, &mixture), 0.0);
        assert_eq!(all.limit(1, &mixture), 1.0);
    }

    #[test]
    fn the_share_of_starts_inside_is_exact_if_all_are() {
        let state = |inside: bool| inside.then(|| (vec![0.0], vec![1.0]));
        let inside = |count: usize| {
            let mut all = learning(&["ego"]);
            all.pool = (0..POOL).map(|at| (vec![0.5], state(at < count))).collect();
            all.inside()
        };
        assert_eq!(inside(POOL).interval, [1.0; 2]);
        let half = inside(POOL / 2);
        assert!((half.probability - 0.5).abs() < 1e-12);
        assert!(half.interval[0] < 0.5 && half.interval[1] > 0.5);
        assert_eq!(inside(0).hits, 1);
    }
}
