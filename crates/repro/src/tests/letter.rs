//! Path from the paper's setup to the defaults: its ends, its steps, its judges.

use std::sync::atomic::AtomicBool;

use crate::letter::{LetterChange, LetterStudy};
use crate::{
    CaseStudies, JUDGES, LETTER_PATHS, LetterError, LetterPath, letter_baselines, letter_markdown,
    letter_row,
};
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::rl::LearnerConfig;
use brakecheck::rulebook::{JudgeKind, Reward};
use brakecheck::seed::Seeds;
use brakecheck::world::Scenario;

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

fn shipped(name: &str) -> Scenario {
    let world = Scenario::shipped(name).expect("it is shipped");
    world.expect("a sound world")
}

/// Returns the parts that steps change: observations, reward, judge, learner.
fn parts(scenario: &Scenario) -> [String; 4] {
    let book = scenario.rulebook();
    let seen = scenario.drive().map(|driving| &driving.spec().observe);
    [
        format!("{seen:?}"),
        format!("{:?}", book.reward),
        format!("{:?}", book.judge),
        format!("{:?}", scenario.learner()),
    ]
}

#[test]
fn every_way_begins_with_the_letter_ends_with_the_defaults_and_changes_one_thing_at_a_time() {
    for path in LETTER_PATHS {
        let letter = shipped(path.world);
        assert_eq!(letter.rulebook().judge, JudgeKind::WholeRun);
        let plain = Reward::Plain { rho_max: 50.0 };
        assert_eq!(letter.rulebook().reward, plain);
        assert!(letter.warnings().is_empty(), "{:?}", letter.warnings());

        let steps = path.steps(letter.text()).expect("every edit fits");
        let worlds: Vec<Scenario> = steps
            .iter()
            .map(|step| step.scenario().expect("a sound world"))
            .collect();
        for pair in worlds.windows(2) {
            let [before, after] = [&pair[0], &pair[1]].map(parts);
            let changed = before.iter().zip(&after).filter(|(a, b)| a != b).count();
            // A table needs new cells for a new state.
            let with_cells = usize::from(before[0] != after[0] && path.learner.is_some());
            assert_eq!(changed, 1 + with_cells, "{before:?} {after:?}");
        }

        let name = path.world.trim_end_matches("_letter");
        let world = shipped(name);
        let own = match path.learner {
            Some(learner) => world.learning_by(learner).expect("it has one"),
            // The default learner with the same number of decisions as on the path.
            None => world.learning_with(default_for(worlds[0].learner().decisions())),
        };
        let end = worlds.last().expect("a step");
        assert_eq!(parts(end), parts(&own), "{}", path.world);
        let rules = |world: &Scenario| format!("{:?}", world.rules());
        let formulas = |world: &Scenario| -> Vec<String> {
            let rules = world.rules().iter();
            rules.map(|rule| rule.formula.to_string()).collect()
        };
        assert_eq!(formulas(end), formulas(&own), "{}", rules(end));
        assert_eq!(end.ego_spec().to_string(), own.ego_spec().to_string());
    }
}

fn default_for(decisions: u64) -> LearnerConfig {
    let default = LearnerConfig::default().with_decisions(decisions);
    default.expect("in range")
}

#[test]
fn an_edit_that_does_not_fit_is_refused() {
    for (from, found) in [("judge: UntilContact", 0), ("ado.speed", 3)] {
        // A path holds static edits, so those of the test are leaked.
        let edits: &'static [(&str, &str)] = Box::leak(Box::new([(from, "")]));
        let changes: &'static [LetterChange] =
            Box::leak(Box::new([LetterChange { what: "odd", edits }]));
        let path = LetterPath {
            changes,
            ..LETTER_PATHS[0]
        };
        let error = path.steps(shipped("acc_letter").text()).unwrap_err();
        let LetterError::Edit { times, .. } = error else {
            panic!("{error}");
        };
        assert_eq!(times, found, "{from}");
    }
}

#[test]
fn a_step_is_judged_by_both_judges_on_the_same_starts() {
    const SHORT: [LetterChange; 1] = [LetterChange {
        what: "short",
        edits: &[("decisions: 50_000", "decisions: 1_000")],
    }];
    let path = LetterPath {
        changes: &SHORT,
        switches: 1,
        ..LETTER_PATHS[0]
    };
    let steps = path.steps(shipped(path.world).text()).expect("it fits");
    let starts = |judge| {
        let world = steps[1].judged_by(judge).expect("a sound world");
        let starts = test_starts(&world, 3, 30, &quiet()).expect("not stopped");
        (world, starts)
    };
    let baselines: Vec<_> = JUDGES
        .into_iter()
        .map(|judge| {
            let (world, starts) = starts(judge);
            let made =
                letter_baselines(&world, path.switches, &starts, &quiet()).expect("not stopped");
            assert_eq!(made.judge, judge);
            made
        })
        .collect();
    assert_eq!(starts(JUDGES[0]).1.starts, starts(JUDGES[1]).1.starts);

    let scratch = tempfile::tempdir().expect("scratch");
    let request = CaseStudies {
        seeds: Seeds {
            first: 1,
            count: 2,
            starts: 3,
        },
        starts: 30,
        runs: scratch.path(),
    };
    let row = letter_row(&steps[1], &baselines, &request, &quiet())
        .expect("it trains")
        .expect("not stopped");
    assert_eq!((row.learner.as_str(), row.decisions), ("Dqn", 1000));
    assert!(row.judged.iter().all(|judged| judged.rates.len() == 2));
    // A success over the whole run was also a success when ψ_ego was violated.
    assert!(row.judged[0].success_rate <= row.judged[1].success_rate);
    let study = LetterStudy {
        world: path.world.to_owned(),
        learner: None,
        switches: 1,
        baselines,
        rows: vec![row],
    };
    let table = letter_markdown(&[study]);
    for line in ["| short | Dqn, 1000 |", "| *search, ≤ 1 switches* |"] {
        assert!(table.contains(line), "{table}");
    }
}
