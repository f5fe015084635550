//! Effect of one of several ados on the others, by leaving it out.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::run_dir::{AdversaryId, Row, counted};
use crate::stats::{StartOutcome, mcnemar, paired_difference};

/// Probability of an error at or below which a difference counts as shown.
const ALPHA: f64 = 0.05;

/// All ados of a world compared with some of them, on the same starts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdoEffect {
    /// Name of the ego.
    pub ego: String,
    /// Ado that is left out, or that acts alone.
    pub ado: String,
    /// True if the ado acts alone. Otherwise it is left out.
    pub alone: bool,
    /// Starts that all ados together solve, of those with a result of both.
    pub all: usize,
    /// Starts that the smaller group solves.
    pub some: usize,
    /// Starts with a result of both.
    pub starts: usize,
    /// Share solved by all ados, less that of the smaller group.
    pub difference: f64,
    /// 95 % interval of the difference, paired on starts.
    pub ci95: [f64; 2],
    /// Exact two-sided p-value of McNemar's test, times the comparisons of the ego.
    pub p_value: f64,
    /// Conclusion of interval and test.
    pub finding: AdoFinding,
}

/// Conclusion on the effect of some ados on the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AdoFinding {
    /// All ados together solve more starts.
    Helps,
    /// All ados together solve fewer starts.
    Hinders,
    /// Neither is shown.
    Unknown,
}

/// Compares, for every ego, all ados with each smaller group of them in the rows.
///
/// Interrupted rows are not compared, because their first starts are the easy ones.
pub fn ado_effects(rows: &[Row]) -> Vec<AdoEffect> {
    let whole = |row: &&Row| row.partial.is_none();
    let is_all = |row: &&Row| matches!(row.ado, AdversaryId::Trained | AdversaryId::Composed);
    let of_all = rows.iter().filter(whole).filter(is_all);
    let effects = of_all.flat_map(|all| {
        let same = |row: &&Row| row.ego == all.ego && group(&row.ado).is_some();
        let some: Vec<&Row> = rows.iter().filter(whole).filter(same).collect();
        // All smaller groups of an ego are one family of tests.
        let comparisons = some.len();
        let effects = some.into_iter().filter_map(move |some| {
            let group = group(&some.ado)?;
            Some(effect(all, some, group, comparisons))
        });
        effects.collect::<Vec<_>>()
    });
    effects.collect()
}

/// Ado that makes a group smaller than all.
struct FewerAdos<'a> {
    ado: &'a str,
    alone: bool,
}

fn group(id: &AdversaryId) -> Option<FewerAdos<'_>> {
    let left_out = id.left_out().map(|ado| FewerAdos { ado, alone: false });
    left_out.or_else(|| id.only().map(|ado| FewerAdos { ado, alone: true }))
}

fn effect(all: &Row, some: &Row, group: FewerAdos<'_>, comparisons: usize) -> AdoEffect {
    let (mut starts, mut by_all, mut by_some, mut both) = (0, 0, 0, 0);
    for (one, other) in all.solved.iter().zip(some.solved.iter()) {
        // Trivial and invalid starts are in no rate.
        if one.score().is_none() || other.score().is_none() {
            continue;
        }
        let solved = [one, other].map(|it| *it == StartOutcome::Solved);
        starts += 1;
        by_all += usize::from(solved[0]);
        by_some += usize::from(solved[1]);
        both += usize::from(solved == [true, true]);
    }
    let (difference, ci95) = paired_difference(&[&all.solved], &[&some.solved]);
    // Bonferroni's correction: of several ados, some would hinder by chance.
    let p_value = (comparisons as f64 * mcnemar(by_all - both, by_some - both)).min(1.0);
    // Interval and test may disagree on few starts, and a claim needs both.
    let finding = if p_value <= ALPHA && ci95[0] > 0.0 {
        AdoFinding::Helps
    } else if p_value <= ALPHA && ci95[1] < 0.0 {
        AdoFinding::Hinders
    } else {
        AdoFinding::Unknown
    };
    AdoEffect {
        ego: all.ego.clone(),
        ado: group.ado.to_owned(),
        alone: group.alone,
        all: by_all,
        some: by_some,
        starts,
        difference,
        ci95,
        p_value,
        finding,
    }
}

impl Display for AdoEffect {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (ado, starts) = (&self.ado, counted(self.starts, "start"));
        match (self.finding, self.alone) {
            (AdoFinding::Helps, false) => write!(f, "`{ado}` helps the other ados"),
            (AdoFinding::Hinders, false) => write!(f, "`{ado}` makes the other ados worse"),
            // If the ado acts alone, it is the others whose absence makes the difference.
            (AdoFinding::Helps, true) => write!(f, "the other ados help `{ado}`"),
            (AdoFinding::Hinders, true) => write!(f, "the other ados make `{ado}` worse"),
            (AdoFinding::Unknown, false) => {
                write!(f, "no effect of `{ado}` on the others is shown")
            }
            (AdoFinding::Unknown, true) => write!(f, "no effect of the others on `{ado}` is shown"),
        }?;
        let some = if self.alone { "alone" } else { "without it" };
        let [lo, hi] = self.ci95.map(|share| 100.0 * share);
        write!(
            f,
            ": `{}` fails from {} of {starts} {some} and from {} against all, {:+.1} points \
             [{lo:+.1}, {hi:+.1}], exact McNemar p = {:.2e}",
            self.ego,
            self.some,
            self.all,
            100.0 * self.difference,
            self.p_value
        )
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Row of an ado with the marks of its starts.
    fn row(ado: AdversaryId, solved: &str) -> Row {
        let row = json!({
            "world": "w", "plant": "Kinematic", "judge": "UntilContact", "ego": "nominal",
            "ado": ado.caption(), "adversary": ado, "method": "dqn", "start_seed": 0,
            "starts": solved.len(), "trivial": 0, "successes": 0, "success_rate": 0.0,
            "ci95": null, "foul_rate": 0.0, "contact_rate": 0.0, "invalid": 0,
            "sims_per_start": 1.0, "physics_steps": 0, "cpu_s": 0.0, "solved": solved,
        });
        serde_json::from_value(row).expect("a row")
    }

    fn effects(all: &str, without: &str, alone: &str) -> Vec<AdoEffect> {
        ado_effects(&[
            row(AdversaryId::Trained, all),
            row(AdversaryId::without("lead"), without),
            row(AdversaryId::Hold, &"1".repeat(all.len())),
            row(AdversaryId::alone("lead"), alone),
        ])
    }

    #[test]
    fn an_ado_that_makes_the_others_worse_is_named_if_test_and_interval_agree() {
        let all = ["1".repeat(20), "0".repeat(20)].concat();
        let without = ["1".repeat(32), "0".repeat(8)].concat();
        let found = effects(&all, &without, &all);
        assert_eq!(found.len(), 2);
        let lead = &found[0];
        assert_eq!((lead.all, lead.some, lead.starts), (20, 32, 40));
        // Twelve starts are solved without the lead only: 2 × 2⁻¹², for two comparisons.
        assert!(
            (lead.p_value - 2.0 * 2.0 / 4096.0).abs() < 1e-12,
            "{lead:?}"
        );
        assert!((lead.difference + 0.3).abs() < 1e-12 && lead.ci95[1] < 0.0);
        assert_eq!(lead.finding, AdoFinding::Hinders);
        let text = lead.to_string();
        assert!(
            text.starts_with("`lead` makes the other ados worse: "),
            "{text}"
        );
        assert_eq!(found[1].finding, AdoFinding::Unknown);
        assert_eq!(found[1].p_value, 1.0);
        // The reverse is help, and the same difference by chance is neither.
        assert_eq!(effects(&without, &all, &all)[0].finding, AdoFinding::Helps);
        let all = ["1".repeat(20), "0".repeat(6), "1".repeat(2)].concat();
        let without = ["1".repeat(26), "0".repeat(2)].concat();
        assert_eq!(
            effects(&all, &without, &all)[0].finding,
            AdoFinding::Unknown
        );
    }

    #[test]
    fn starts_without_a_result_of_both_are_not_compared() {
        let found = effects("1t0x1", "1t110", "0t001");
        assert_eq!(found[0].starts, 3);
        assert_eq!((found[0].all, found[0].some), (2, 2));
        assert!(found[1].alone && found[1].some == 1);
        // An interrupted row has the easy starts only.
        let mut all = row(AdversaryId::Trained, "11--");
        all.partial = Some(crate::run_dir::Partial { decided: 2, of: 4 });
        assert!(ado_effects(&[all, row(AdversaryId::without("lead"), "0000")]).is_empty());
    }
}
