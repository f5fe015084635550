//! From how many starts on a trained ado is cheaper than searching each start.

use serde::{Deserialize, Serialize};

use crate::experiment::Cost;
use crate::run_dir::{Anytime, Row};
use crate::search::{SearchResult, Searched, anytime};

/// Mean cost of one start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PerStart {
    /// Share of the starts solved.
    pub success_rate: f64,
    /// Episodes run.
    pub simulations: f64,
    /// Physics steps spent.
    pub physics_steps: f64,
    /// Processor time spent.
    pub cpu_s: f64,
}

/// A trained ado against a search of the same starts.
///
/// The ado costs what was spent `once` and one simulation per start; the search
/// costs nothing once and, per start, its simulations to the first success, or
/// its whole budget where there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BreakEven {
    /// Name of the ego that both met.
    pub ego: String,
    /// How the search chose its sequences.
    pub method: String,
    /// Seed of the training.
    pub train_seed: Option<u64>,
    /// What the training cost, paid once.
    pub once: Cost,
    /// What the trained ado does and costs per start.
    pub ado: PerStart,
    /// The least budget with which the search solves as many starts as the ado.
    ///
    /// Where even the whole budget does not, it is that, and `matched` is false:
    /// the search then costs less than equal success would.
    pub budget: u64,
    /// Whether the search reaches the success of the ado.
    pub matched: bool,
    /// The search with that budget.
    pub search: PerStart,
    /// Starts from which on the ado is cheaper, by simulations.
    ///
    /// `None`, here and below: it never is, because one start costs it no less.
    pub starts: Option<f64>,
    /// The same by physics steps; `None` also where the training counted none.
    pub starts_by_physics_steps: Option<f64>,
    /// The same by processor time.
    pub starts_by_cpu_s: Option<f64>,
    /// Success of the search against simulations spent.
    pub curve: Vec<Anytime>,
}

/// Compares a search with a trained ado on the same ego and starts.
///
/// `searched` is of a method with `budget` simulations per start; `trained` is
/// the ado's row over the same starts, and `once` what it took to have it.
/// Where the search is cut short, physics steps and time of a start are taken
/// in proportion to its simulations. `None` where the ado solves nothing.
pub fn break_even(
    searched: &Searched,
    budget: u64,
    trained: &Row,
    once: Cost,
) -> Option<BreakEven> {
    let starts = searched.found.iter().flatten().count();
    if starts == 0 || trained.successes == 0 {
        return None;
    }
    let reached = |budget| trained.successes <= anytime(&searched.found, budget).successes;
    let matched = reached(budget);
    let enough = if matched {
        least(budget, reached)
    } else {
        budget
    };
    let per_start = |sum: f64| sum / trained.starts as f64;
    let ado = PerStart {
        success_rate: trained.success_rate,
        simulations: trained.sims_per_start,
        physics_steps: per_start(trained.physics_steps as f64),
        cpu_s: per_start(trained.cpu_s),
    };
    let search = cut(&searched.found, enough);
    let saved = |once: f64, each: f64, searched: f64| {
        let saved = searched - each;
        (0.0 < saved).then(|| once / saved)
    };
    // Earlier versions did not count the physics steps of a training.
    let uncounted = once.physics_steps == 0 && 0 < once.simulations;
    let by_physics_steps = saved(
        once.physics_steps as f64,
        ado.physics_steps,
        search.physics_steps,
    );
    let curve = curve_budgets(budget, enough).into_iter();
    Some(BreakEven {
        ego: trained.ego.clone(),
        method: searched.row.method.clone(),
        train_seed: trained.train_seed,
        once,
        ado,
        budget: enough,
        matched,
        search,
        starts: saved(once.simulations as f64, ado.simulations, search.simulations),
        starts_by_physics_steps: by_physics_steps.filter(|_| !uncounted),
        starts_by_cpu_s: saved(once.cpu_s, ado.cpu_s, search.cpu_s),
        curve: curve
            .map(|budget| anytime(&searched.found, budget))
            .collect(),
    })
}

/// The least number up to `most` that passes; more never fails what less passes.
fn least(most: u64, passes: impl Fn(u64) -> bool) -> u64 {
    let (mut fails, mut passing) = (0, most);
    while 1 < passing - fails {
        let middle = fails + (passing - fails) / 2;
        if passes(middle) {
            passing = middle
        } else {
            fails = middle
        }
    }
    passing
}

/// Mean cost per start of a search that stops after `budget` simulations.
fn cut(found: &[Option<SearchResult>], budget: u64) -> PerStart {
    let (mut starts, mut physics_steps, mut cpu_s) = (0, 0.0, 0.0);
    for found in found.iter().flatten() {
        let (spent, _) = found.within(budget);
        let share = spent as f64 / found.simulations.max(1) as f64;
        starts += 1;
        physics_steps += share * found.physics_steps as f64;
        cpu_s += share * found.cpu_s;
    }
    let reached = anytime(found, budget);
    PerStart {
        success_rate: reached.success_rate,
        simulations: reached.sims_per_start,
        physics_steps: physics_steps / starts.max(1) as f64,
        cpu_s: cpu_s / starts.max(1) as f64,
    }
}

/// Ten budgets per decade and the one in question.
fn curve_budgets(most: u64, also: u64) -> Vec<u64> {
    let mut budgets = vec![also, most];
    let mut budget = 1;
    while budget < most {
        budgets.push(budget);
        budget = (budget * 5).div_ceil(4);
    }
    budgets.sort_unstable();
    budgets.dedup();
    budgets
}
