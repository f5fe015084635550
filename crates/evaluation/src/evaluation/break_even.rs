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

/// Comparison of a trained ado with a search of the same starts.
///
/// The ado costs `once`, and then a simulation per start. The search costs nothing once.
/// Per start it costs its simulations to the first success, or its whole budget.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BreakEven {
    /// Name of the ego of both.
    pub ego: String,
    /// Name of the search method.
    pub method: String,
    /// Seed of the training.
    pub train_seed: Option<u64>,
    /// Cost of the training.
    pub once: Cost,
    /// Success and cost per start of the trained ado.
    pub ado: PerStart,
    /// The least budget with which the search solves as many starts as the ado.
    ///
    /// Where even the whole budget does not, it is that, and `matched` is false:
    /// the search then costs less than equal success would.
    pub budget: u64,
    /// True if the search reaches the success of the ado.
    pub matched: bool,
    /// The search with that budget.
    pub search: PerStart,
    /// Starts from which on the ado is cheaper, by simulations.
    ///
    /// `None`, here and below: it never is, because one start costs it no less.
    pub starts: Option<f64>,
    /// Break-even by physics steps.
    pub starts_by_physics_steps: Option<f64>,
    /// Break-even by processor time.
    pub starts_by_cpu_s: Option<f64>,
    /// Success of the search against simulations spent.
    pub curve: Vec<Anytime>,
}

/// Compares a search with a trained ado on the same ego and starts.
///
/// `searched` has `budget` simulations per start. `trained` is the ado's row on the same
/// starts, and `once` is the cost of its training. If the search is cut short, physics
/// steps and time of a start are proportional to its simulations.
///
/// Returns `None` if the ado solves nothing.
pub fn break_even(
    searched: &Searched,
    budget: u64,
    trained: &Row,
    once: Cost,
) -> Option<BreakEven> {
    let starts = searched.found.iter().flatten().count();
    // Without a success there is nothing to match.
    if starts == 0 || trained.successes == 0 {
        return None;
    }
    let reached = |budget| trained.successes <= anytime(&searched.found, budget).successes;
    let matched = reached(budget);
    // Equal success makes the costs comparable.
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
        // Break-even: the savings of this many starts equal the cost of the training.
        (saved > 0.0).then(|| once / saved)
    };
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
        starts_by_physics_steps: by_physics_steps,
        starts_by_cpu_s: saved(once.cpu_s, ado.cpu_s, search.cpu_s),
        curve: curve
            .map(|budget| anytime(&searched.found, budget))
            .collect(),
    })
}

/// Returns the least number up to `most` that passes.
///
/// `passes` must be monotone: a greater number passes if a smaller number does.
fn least(most: u64, passes: impl Fn(u64) -> bool) -> u64 {
    // The caller knows that `most` passes, and no simulation at all solves nothing.
    let (mut fails, mut passing) = (0, most);
    while passing - fails > 1 {
        // The sum of both ends could exceed the largest number.
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

/// Returns ten budgets per decade, and `also`.
fn curve_budgets(most: u64, also: u64) -> Vec<u64> {
    let mut budgets = vec![also, most];
    let mut budget = 1;
    while budget < most {
        budgets.push(budget);
        // 1.25 to the tenth is about 9.3, so these are ten budgets per decade.
        // A user may ask for the largest number, which a product would exceed.
        budget = budget.saturating_add(budget.div_ceil(4));
    }
    budgets.sort_unstable();
    budgets.dedup();
    budgets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_of_a_curve_grow_by_a_quarter_up_to_the_largest_number() {
        assert_eq!(curve_budgets(10, 10), [1, 2, 3, 4, 5, 7, 9, 10]);
        assert_eq!(curve_budgets(u64::MAX, 1).last(), Some(&u64::MAX));
    }
}
