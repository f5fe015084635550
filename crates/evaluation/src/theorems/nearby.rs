//! Theorems 1 and 2 on a grid: promises of nearby values, tested by playing.
//!
//! Paper: V*(x0) = γ^T ρ with fixed T. Here: γ^T R_T in units of the reward, and T is the
//! decision that ends the episode, because a capture ends it.

use serde::Serialize;

use super::TheoremsError;
use super::plays::{GridUnderTest, ROUNDING, TheoremEpisode};
use crate::grid_solver::values::ValueTable;
use crate::rl::Policy;
use crate::world::GridScenario;

/// Values of δ in Theorem 1 and of β in Theorem 2.
///
/// They are those of RQ4 and were fixed before any computation.
pub(crate) const DELTAS: [f64; 4] = [0.01, 0.1, 0.5, 1.0];

/// Result of the check of a theorem.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "is")]
pub enum TheoremOutcome {
    /// Premises and conclusion hold on every pair.
    Holds,
    /// The premises hold for the optimal ado, and this ado misses the conclusion.
    Fails,
    /// The theorem does not apply to this ado.
    PremiseNotMet {
        /// Missing premise, with its numbers.
        why: String,
    },
    /// A consequence of true premises is false, by a bug or a planted fault.
    Refuted {
        /// False consequence, with its numbers.
        why: String,
    },
}

impl TheoremOutcome {
    /// Returns whether the result shows a bug of this program.
    pub fn is_refuted(&self) -> bool {
        matches!(self, TheoremOutcome::Refuted { .. })
    }
}

/// Result of Theorem 1 on every pair of starts.
#[derive(Clone, Debug, Serialize)]
pub struct Theorem1 {
    /// Discount γ.
    pub discount: f64,
    /// Number of starts.
    pub starts: usize,
    /// Largest violation of the optimality equation by the table, 0 for V*.
    pub residual: f64,
    /// max |V(x0) − γ^T R_T| of the table's greedy policy when played, 0 for V*.
    pub unpaid: f64,
    /// Starts from which the trained ado found a counterexample.
    pub found: usize,
    /// Such starts with the discounted reward V*(x0), as the proof requires.
    pub found_optimally: usize,
    /// max |V_k(x0) − V*(x0)| of the trained ado, 0 after convergence.
    pub gap: f64,
    /// Results per δ.
    pub rows: Vec<Theorem1Row>,
}

/// Result of Theorem 1 for a value of δ.
#[derive(Clone, Debug, Serialize)]
pub struct Theorem1Row {
    /// Value of δ.
    pub delta: f64,
    /// Counterexamples with reward V*(x0) and δ < γ^T (g(τ) + ρ), the premise.
    ///
    /// ρ is the mildest penalty of a rule violation: ρ_max for the reward `Plain`, and 1
    /// for `Tanh`.
    #[serde(rename = "meets")]
    pub in_premise: usize,
    /// Such counterexamples with V*(x0) − δ above every reward without a capture.
    ///
    /// The theorem then promises a counterexample from every nearby start.
    pub promising: usize,
    /// Pairs (x0, x0') with the premise at x0 and |V*(x0) − V*(x0')| < δ.
    pub pairs: u64,
    /// Pairs on which the optimal continuation breaks a rule after decision T.
    ///
    /// Its penalty is discounted more than the premise assumes. With one T for all
    /// starts there is no such pair.
    pub late: u64,
    /// Results of the optimal continuation from x0'.
    pub optimal: Nearby,
    /// Results of the trained ado from x0'.
    pub learned: Nearby,
    /// Outcome for the optimal continuation.
    pub outcome: TheoremOutcome,
    /// Outcome for the trained ado.
    pub outcome_of_learned: TheoremOutcome,
}

/// Counts of runs from nearby starts, pair by pair.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Nearby {
    /// Pairs with all rules kept and γ^T' R_T' ≥ V*(x0) − δ.
    pub holds: u64,
    /// Pairs with all rules kept and the printed bound, g(ρ') ≥ g(τ) − δ/γ^T.
    pub printed: u64,
    /// Pairs in which the ego failed.
    pub counterexamples: u64,
}

/// Checks Theorem 1 with the values of `table` for the trained ado `policy`.
///
/// # Errors
/// Returns an error if the world has an unsupported specification.
pub fn theorem_1(
    scenario: GridScenario<'_>,
    policy: &dyn Policy,
    table: &ValueTable,
) -> Result<Theorem1, TheoremsError> {
    let grid = GridUnderTest::of(scenario)?;
    let values = grid.values(table)?;
    // The optimal continuation comes first, as in the counters of a row.
    let played = [grid.greedy(table)?, grid.trained(policy)?];
    let learned = grid.values(&table.learned(scenario.world(), policy))?;
    let paid = played[0].iter().map(TheoremEpisode::paid);
    let found: Vec<bool> = played[1].iter().map(|run| run.success).collect();
    let optimally = found.iter().zip(&played[1]).zip(&values);
    let mut checked = Theorem1 {
        discount: grid.discount,
        starts: values.len(),
        residual: table.residual(grid.discount),
        unpaid: largest_gap(paid, &values),
        found: found.iter().filter(|found| **found).count(),
        found_optimally: optimally
            .filter(|((found, run), value)| **found && is_paid(run, **value))
            .count(),
        gap: largest_gap(learned.into_iter(), &values),
        rows: Vec::new(),
    };
    for delta in DELTAS {
        let row = theorem_1_row(&grid, &values, &played, delta);
        checked.rows.push(checked.judged(row));
    }
    Ok(checked)
}

/// Returns whether a run earned the value of a table: the proof's V*(x0) = γ^T τ.
fn is_paid(run: &TheoremEpisode, value: f64) -> bool {
    (run.paid() - value).abs() <= ROUNDING
}

/// Returns whether a run breaks a rule after another one's T, and is paid enough for it.
fn is_late(other: &TheoremEpisode, run: &TheoremEpisode, least: f64) -> bool {
    !other.keeps_rules && other.decisions > run.decisions && least <= other.paid()
}

fn largest_gap(ours: impl Iterator<Item = f64>, others: &[f64]) -> f64 {
    let gaps = ours.zip(others).map(|(a, b)| (a - b).abs());
    gaps.fold(0.0, f64::max)
}

fn theorem_1_row(
    grid: &GridUnderTest<'_>,
    values: &[f64],
    played: &[Vec<TheoremEpisode>; 2],
    delta: f64,
) -> Theorem1Row {
    let (held, penalty) = (grid.held_at_best(), grid.penalty());
    let counts = grid.sum(|here| {
        // Four numbers per start, then three for each of the two ados.
        let mut counts = [0; 10];
        let run = played[1][here];
        // Paper: δ < γ^T (ρ + ρ_max); here: g(τ) and the penalty of the world's reward.
        let in_premise = run.success
            && is_paid(&run, values[here])
            && delta < run.weight * (run.reward + penalty);
        if !in_premise {
            return counts;
        }
        counts[0] = 1;
        counts[1] = u64::from(held < values[here] - delta);
        // Strict here and not in Theorem 2, as both are printed.
        let near = |there: &usize| (values[here] - values[*there]).abs() < delta;
        for there in (0..values.len()).filter(near) {
            // Sums in another order may miss an exact bound by their last bits.
            let least = values[here] - delta - ROUNDING;
            counts[2] += 1;
            counts[3] += u64::from(is_late(&played[0][there], &run, least));
            for (other, counts) in played.iter().zip(counts[4..].chunks_mut(3)) {
                let other = other[there];
                let holds = least <= other.paid();
                // False where T differs between the two, and so counted beside ours.
                let printed = run.reward - delta / run.weight - ROUNDING <= other.reward;
                counts[0] += u64::from(other.keeps_rules && holds);
                counts[1] += u64::from(other.keeps_rules && printed);
                counts[2] += u64::from(other.success);
            }
        }
        counts
    });
    let nearby = |first: usize| Nearby {
        holds: counts[first],
        printed: counts[first + 1],
        counterexamples: counts[first + 2],
    };
    Theorem1Row {
        delta,
        in_premise: counts[0] as usize,
        promising: counts[1] as usize,
        pairs: counts[2],
        late: counts[3],
        optimal: nearby(4),
        learned: nearby(7),
        outcome: TheoremOutcome::Holds,
        outcome_of_learned: TheoremOutcome::Holds,
    }
}

impl Theorem1 {
    fn judged(&self, mut row: Theorem1Row) -> Theorem1Row {
        row.outcome = self.optimal(&row);
        row.outcome_of_learned = match (&row.outcome, self.learned(&row)) {
            (TheoremOutcome::Holds, outcome) => outcome,
            // If the optimal continuation fails a premise, the trained ado cannot pass.
            (outcome, _) => outcome.clone(),
        };
        row
    }

    fn optimal(&self, row: &Theorem1Row) -> TheoremOutcome {
        let Theorem1Row {
            delta,
            pairs,
            late,
            optimal,
            ..
        } = row;
        // The conclusion is checked before the table, because it needs no assumption on it.
        // Late pairs are no misses, because the theorem assumes one T for both starts.
        let holds = optimal.holds + late;
        if holds < *pairs {
            return TheoremOutcome::Refuted {
                why: format!(
                    "the optimal continuation misses the bound on {} of {pairs} pairs",
                    pairs - holds
                ),
            };
        }
        if self.residual.max(self.unpaid) > ROUNDING {
            return TheoremOutcome::Refuted {
                why: format!(
                    "the table is not V*: its residual is {:.4}, and its greedy policy is paid up to {:.4} other than it says",
                    self.residual, self.unpaid
                ),
            };
        }
        let why = match (self.found, self.found_optimally, row.promising) {
            _ if *late > 0 => format!(
                "on {late} of {pairs} pairs a rule can only be broken, after decision T: the theorem needs one T"
            ),
            (0, ..) => "the trained ado found no counterexample".to_owned(),
            (found, 0, _) => format!("none of the {found} counterexamples is paid V*(x0)"),
            (.., 0) => format!(
                "δ = {delta} promises a counterexample around none of {} starts",
                self.found_optimally
            ),
            _ => return TheoremOutcome::Holds,
        };
        TheoremOutcome::PremiseNotMet { why }
    }

    /// Returns the outcome for the trained ado, if the premises hold for the optimal ado.
    fn learned(&self, row: &Theorem1Row) -> TheoremOutcome {
        // Starts that are near by the learned values need not be near by V* then.
        if row.delta <= self.gap {
            return TheoremOutcome::PremiseNotMet {
                why: format!(
                    "the learned values differ from V* by up to {:.4}, no less than δ = {}",
                    self.gap, row.delta
                ),
            };
        }
        if row.learned.holds == row.pairs {
            TheoremOutcome::Holds
        } else {
            TheoremOutcome::Fails
        }
    }

    /// Returns whether the result shows a bug of this program.
    pub fn is_refuted(&self) -> bool {
        self.rows.iter().any(|row| row.outcome.is_refuted())
    }
}

/// Values V_k with a bound on their distance from V*.
pub struct Approximation<'a> {
    /// Values V_k.
    pub values: &'a ValueTable,
    /// α certified by a stopping rule. `None`: it is measured.
    pub certified: Option<f64>,
    /// Policy that plays. `None`: the greedy policy of V_k.
    pub policy: Option<&'a dyn Policy>,
}

/// Result of Theorem 2 on every pair of starts.
#[derive(Clone, Debug, Serialize)]
pub struct Theorem2 {
    /// α of the stopping rule, if V_k has it.
    pub certified: Option<f64>,
    /// max |V_k − V*| over all pairs of cells and all numbers of steps left.
    pub alpha: f64,
    /// Same maximum over the starts only, as the printed bound uses it.
    pub alpha_of_starts: f64,
    /// Same maximum over the states that greedy play compares.
    pub alpha_ahead: f64,
    /// 2α (γ + … + γ^(K−1)): the largest loss of V_k's greedy policy.
    ///
    /// α is the certified value, or that of the compared states.
    pub loss: f64,
    /// Largest actual loss over all starts.
    pub lost: f64,
    /// Starts from which a counterexample was found.
    pub found: usize,
    /// Results per β.
    pub rows: Vec<Theorem2Row>,
    /// Overall result of the check.
    pub outcome: TheoremOutcome,
}

/// Result of Theorem 2 for a value of β.
#[derive(Clone, Debug, Serialize)]
pub struct Theorem2Row {
    /// Value of β.
    pub beta: f64,
    /// Pairs (x0, x0') with a counterexample from x0 and |V_k(x0) − V_k(x0')| ≤ β.
    pub pairs: u64,
    /// Pairs on which the greedy bound promises a counterexample.
    ///
    /// On the remaining pairs the bound is vacuous.
    pub promising: u64,
    /// Pairs on which the greedy policy misses its bound, each of which is a bug.
    pub misses: u64,
    /// Pairs on which the printed bound promises a counterexample.
    pub printed_promising: u64,
    /// Pairs on which the playing ado misses the printed bound.
    ///
    /// The bound is g(ρ') ≥ g(τ) − (2α + β)/γ^T.
    pub printed_misses: u64,
}

/// Checks Theorem 2, where `truth` is V* and `approximation` is V_k.
///
/// # Errors
/// Returns the errors of [`theorem_1`].
pub fn theorem_2(
    scenario: GridScenario<'_>,
    truth: &ValueTable,
    approximation: &Approximation<'_>,
) -> Result<Theorem2, TheoremsError> {
    let grid = GridUnderTest::of(scenario)?;
    let (best, values) = (grid.values(truth)?, grid.values(approximation.values)?);
    let greedy = grid.greedy(approximation.values)?;
    // A table without a policy of its own plays greedily, so both runs are the same.
    let agent = match approximation.policy {
        Some(policy) => grid.trained(policy)?,
        None => greedy.clone(),
    };
    // The true distance is known here, so a wrong certificate can be detected.
    let alpha = truth.distance(approximation.values);
    // A decision compares successor values, so its loss carries one more power of γ.
    let steps = 1..grid.game.steps as i32;
    let later: f64 = steps.map(|t| grid.discount.powi(t)).sum();
    let certified = approximation.certified;
    let alpha_of_starts = largest_gap(values.iter().copied(), &best);
    let ahead = grid
        .positions
        .iter()
        .map(|start| approximation.values.distance_ahead(truth, *start));
    let alpha_ahead = ahead.fold(0.0, f64::max);
    let lost = best
        .iter()
        .zip(&greedy)
        .map(|(best, run)| best - run.paid());
    let mut checked = Theorem2 {
        certified,
        alpha,
        alpha_of_starts,
        alpha_ahead,
        loss: 2.0 * certified.unwrap_or(alpha_ahead) * later,
        lost: lost.fold(0.0, f64::max),
        found: agent.iter().filter(|run| run.success).count(),
        rows: Vec::new(),
        outcome: TheoremOutcome::Holds,
    };
    // Without a certificate the bound uses the measured distance at the starts.
    let near = certified.unwrap_or(alpha_of_starts);
    let rows = DELTAS.into_iter().map(|beta| {
        let spent = [2.0 * near + beta, checked.loss];
        theorem_2_row(&grid, &values, &[&greedy, &agent], beta, spent)
    });
    checked.rows = rows.collect();
    checked.outcome = checked.judged();
    Ok(checked)
}

/// Counts the pairs of a β.
///
/// `[spent, loss]` are 2α + β and the additional loss of greedy play.
fn theorem_2_row(
    grid: &GridUnderTest<'_>,
    values: &[f64],
    [greedy, agent]: &[&Vec<TheoremEpisode>; 2],
    beta: f64,
    [spent, loss]: [f64; 2],
) -> Theorem2Row {
    let held = grid.held_at_best();
    // The printed bound is undiscounted, so it is compared with an undiscounted reward.
    let held_now = grid.scenario.rulebook().reward.lawful(0.0);
    let counts = grid.sum(|here| {
        let mut counts = [0; 5];
        let run = agent[here];
        if !run.success {
            return counts;
        }
        // The printed bound leaves out the loss of greedy play, so both are counted.
        let bound = run.paid() - spent - loss;
        let printed = run.reward - spent / run.weight;
        let near = |there: &usize| (values[here] - values[*there]).abs() <= beta;
        for there in (0..values.len()).filter(near) {
            let (greedy, agent) = (greedy[there], agent[there]);
            let kept = |run: &TheoremEpisode, have: f64, want: f64| {
                run.keeps_rules && want - ROUNDING <= have
            };
            counts[0] += 1;
            counts[1] += u64::from(held < bound);
            counts[2] += u64::from(!kept(&greedy, greedy.paid(), bound));
            counts[3] += u64::from(held_now < printed);
            counts[4] += u64::from(!kept(&agent, agent.reward, printed));
        }
        counts
    });
    let [pairs, promising, misses, printed_promising, printed_misses] = counts;
    Theorem2Row {
        beta,
        pairs,
        promising,
        misses,
        printed_promising,
        printed_misses,
    }
}

impl Theorem2 {
    fn judged(&self) -> TheoremOutcome {
        let misses: u64 = self.rows.iter().map(|row| row.misses).sum();
        // A wrong certificate would invalidate every bound that uses it.
        if let Some(certified) = self.certified
            && certified + ROUNDING < self.alpha
        {
            return TheoremOutcome::Refuted {
                why: format!(
                    "V_k is certified within {certified} of V*, and differs by {:.4}",
                    self.alpha
                ),
            };
        }
        if misses > 0 || self.loss + ROUNDING < self.lost {
            return TheoremOutcome::Refuted {
                why: format!(
                    "the greedy policy of V_k misses its bound on {misses} pairs; it loses {:.4} of at most {:.4}",
                    self.lost, self.loss
                ),
            };
        }
        let why = match self.rows.iter().any(|row| row.promising > 0) {
            _ if self.found == 0 => "no counterexample was found".to_owned(),
            true => return TheoremOutcome::Holds,
            false => format!(
                "the bound is vacuous everywhere: α is {:.4} on the starts, and greedy play may lose {:.4}",
                self.certified.unwrap_or(self.alpha_of_starts),
                self.loss
            ),
        };
        TheoremOutcome::PremiseNotMet { why }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(beta: f64, promising: u64, misses: u64) -> Theorem2Row {
        Theorem2Row {
            beta,
            pairs: 9,
            promising,
            misses,
            printed_promising: 0,
            printed_misses: 0,
        }
    }

    fn second(certified: Option<f64>, rows: Vec<Theorem2Row>) -> Theorem2 {
        Theorem2 {
            certified,
            alpha: 0.1,
            alpha_of_starts: 0.05,
            alpha_ahead: 0.05,
            loss: 0.2,
            lost: 0.2,
            found: 3,
            rows,
            outcome: TheoremOutcome::Holds,
        }
    }

    fn why(outcome: TheoremOutcome) -> String {
        match outcome {
            TheoremOutcome::Holds | TheoremOutcome::Fails => format!("{outcome:?}"),
            TheoremOutcome::PremiseNotMet { why } => format!("premise: {why}"),
            TheoremOutcome::Refuted { why } => format!("refuted: {why}"),
        }
    }

    #[test]
    fn theorem_2_is_judged_by_its_misses_its_loss_and_its_certificate() {
        let kept = || vec![row(0.01, 0, 0), row(0.1, 4, 0)];
        let sound = second(Some(0.1), kept());
        assert_eq!(sound.judged(), TheoremOutcome::Holds);
        let missed = second(None, vec![row(0.01, 4, 0), row(0.1, 4, 1), row(0.5, 0, 2)]);
        assert!(
            why(missed.judged())
                .starts_with("refuted: the greedy policy of V_k misses its bound on 3 pairs")
        );
        let lost = Theorem2 {
            lost: 0.201,
            ..second(None, kept())
        };
        assert!(why(lost.judged()).contains("it loses 0.2010 of at most 0.2000"));
        let certified = second(Some(0.099), kept());
        assert!(why(certified.judged()).starts_with("refuted: V_k is certified within 0.099"));
        let nothing = Theorem2 {
            found: 0,
            ..second(None, kept())
        };
        assert_eq!(
            why(nothing.judged()),
            "premise: no counterexample was found"
        );
        let vacuous = second(None, vec![row(0.01, 0, 0)]);
        assert!(why(vacuous.judged()).contains("vacuous everywhere: α is 0.0500"));
        assert!(why(second(Some(0.2), Vec::new()).judged()).contains("α is 0.2000"));
    }

    fn first(found: usize, found_optimally: usize) -> Theorem1 {
        Theorem1 {
            discount: 0.8,
            starts: 9,
            residual: 0.0,
            unpaid: 0.0,
            found,
            found_optimally,
            gap: 0.05,
            rows: Vec::new(),
        }
    }

    fn pairs(late: u64, optimal: u64, learned: u64) -> Theorem1Row {
        let nearby = |holds| Nearby {
            holds,
            ..Nearby::default()
        };
        Theorem1Row {
            delta: 0.1,
            in_premise: 3,
            promising: 2,
            pairs: 9,
            late,
            optimal: nearby(optimal),
            learned: nearby(learned),
            outcome: TheoremOutcome::Fails,
            outcome_of_learned: TheoremOutcome::Fails,
        }
    }

    #[test]
    fn theorem_1_is_judged_by_its_pairs_its_table_and_its_premises() {
        let outcomes = |checked: Theorem1, row: Theorem1Row| {
            let row = checked.judged(row);
            [why(row.outcome), why(row.outcome_of_learned)]
        };
        assert_eq!(outcomes(first(3, 3), pairs(0, 9, 9)), ["Holds", "Holds"]);
        assert_eq!(outcomes(first(3, 3), pairs(0, 9, 8)), ["Holds", "Fails"]);
        let [one, both] = outcomes(first(3, 3), pairs(0, 7, 9));
        assert_eq!(
            one,
            "refuted: the optimal continuation misses the bound on 2 of 9 pairs"
        );
        assert_eq!(one, both);
        assert!(outcomes(first(3, 3), pairs(2, 6, 9))[0].contains("misses the bound on 1 of 9"));
        assert!(outcomes(first(3, 3), pairs(2, 7, 9))[0].contains("the theorem needs one T"));
        for wrong in [
            Theorem1 {
                residual: 1e-6,
                ..first(3, 3)
            },
            Theorem1 {
                unpaid: 1e-6,
                ..first(3, 3)
            },
        ] {
            assert!(outcomes(wrong, pairs(0, 9, 9))[0].starts_with("refuted: the table is not V*"));
        }
        let none = &outcomes(first(0, 0), pairs(0, 9, 9))[0];
        assert_eq!(none, "premise: the trained ado found no counterexample");
        let unpaid = &outcomes(first(3, 0), pairs(0, 9, 9))[0];
        assert_eq!(
            unpaid,
            "premise: none of the 3 counterexamples is paid V*(x0)"
        );
        let row = Theorem1Row {
            promising: 0,
            ..pairs(0, 9, 9)
        };
        assert!(outcomes(first(3, 3), row)[0].contains("around none of 3 starts"));
        let far = Theorem1 {
            gap: 0.1,
            ..first(3, 3)
        };
        assert!(outcomes(far, pairs(0, 9, 9))[1].contains("no less than δ = 0.1"));
    }
}
