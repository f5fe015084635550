//! Best of the ados that act alike from every start, which anything learned must beat.

use super::ado::Ado;
use super::rollout::{Evaluated, eval};
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::run_dir::AdversaryId;
use crate::world::Scenario;

/// Returns the constant ado that succeeds most often.
///
/// Ties go to the lower action.
pub fn best_constant(ego: &EgoUnderTest, starts: &TestStarts, watch: &Watch<'_>) -> Evaluated {
    let constant = |action| eval(&ego.against(Ado::Constant(action), starts), watch);
    let actions = ego.scenario().world().spaces().actions;
    // The fold begins with action 0, so a world with a single action has a best one too.
    let others = (1..actions).map(constant);
    let mut best = others.fold(constant(0), more_successful);
    best.row.ado = AdversaryId::BestConstant;
    best.row.method = format!("{}, the best of {actions}", best.row.method);
    best
}

/// Shares of the horizon in which the ado accelerates before it brakes.
const ACCELERATES: [f64; 6] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.75];

/// Returns the best of six ados that accelerate and then brake, both at full strength.
///
/// Ties go to the shorter acceleration. `None`: the ado can do neither.
pub fn best_then_brake(
    ego: &EgoUnderTest,
    starts: &TestStarts,
    watch: &Watch<'_>,
) -> Option<Evaluated> {
    let scenario = ego.scenario();
    let spec = scenario.drive()?.spec();
    let [brake, accelerate] = spec.brake_and_accelerate()?;
    let decisions = spec.clock.decisions() as f64;
    let mut best = ACCELERATES
        .map(|share| {
            let mut actions = vec![accelerate; (share * decisions).round() as usize];
            // A script holds its last entry, so one is enough to brake to the end.
            actions.push(brake);
            let mut one = eval(&ego.against(Ado::Script(&actions), starts), watch);
            one.row.method = in_words(scenario, &actions);
            one
        })
        .into_iter()
        .reduce(more_successful)?;
    best.row.ado = AdversaryId::BestSwitch;
    best.row.method = format!("{}, the best of {}", best.row.method, ACCELERATES.len());
    Some(best)
}

fn more_successful(best: Evaluated, other: Evaluated) -> Evaluated {
    // Strict, so that the first of equals stays, which both baselines promise.
    if best.row.successes < other.row.successes {
        other
    } else {
        best
    }
}

/// Describes an action, or two actions of which the last is held.
pub fn in_words(scenario: &Scenario, actions: &[usize]) -> String {
    let (Some(&first), Some(&last)) = (actions.first(), actions.last()) else {
        return "nothing".to_owned();
    };
    // The last entry is held to the end, so it is not among the counted decisions.
    match actions.len() - 1 {
        0 => format!("{} throughout", scenario.action_label(first)),
        held => format!(
            "{} for {held} decisions, then {}",
            scenario.action_label(first),
            scenario.action_label(last)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::test_starts;

    #[test]
    fn the_best_that_accelerates_and_then_brakes_is_named_with_what_it_does() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let watch = Watch::unwatched();
        let starts = test_starts(&world, 20, 3, &watch).expect("drawn");
        let nominal = EgoUnderTest::nominal(&world);
        let best = best_then_brake(&nominal, &starts, &watch).expect("it drives");
        assert_eq!(best.row.ado, AdversaryId::BestSwitch);
        let stated = &best.row.method;
        assert!(
            stated.ends_with("the best of 6") && stated.contains("-3 m/s²"),
            "{stated}"
        );
        // The first of the six is the constant braking.
        let constant = best_constant(&nominal, &starts, &watch);
        assert!(constant.row.successes <= best.row.successes);
        let light = Scenario::shipped("light_ado")
            .expect("shipped")
            .expect("sound");
        let starts = test_starts(&light, 2, 3, &watch).expect("drawn");
        let light = EgoUnderTest::nominal(&light);
        assert!(best_then_brake(&light, &starts, &watch).is_none());
    }

    #[test]
    fn one_action_and_then_another_are_told_in_words() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        assert_eq!(in_words(&world, &[0]), "-3 m/s² throughout");
        let words = in_words(&world, &[2, 2, 2, 0]);
        assert_eq!(words, "+3 m/s² for 3 decisions, then -3 m/s²");
    }
}
