//! Reuse study: two ados and their baselines on changed egos.

use std::sync::atomic::AtomicBool;

use crate::reuse_study::{EgoResult, ReuseReport, WIDE, WIDE_TRIES};
use crate::{ReuseError, ReuseStudy, ReuseStudyConfig, reuse_markdown};
use brakecheck::experiment::{EgoUnderTest, Watch};
use brakecheck::seed::Seeds;
use brakecheck::stats::StartOutcome::Solved;
use brakecheck::world::Scenario;
use brakecheck_evaluation::evaluation::reuse::Relation;

/// Single training with an open seed, as in all tests.
const ONE: Seeds = Seeds {
    first: 1,
    count: 1,
    starts: 0,
};

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

/// ACC on the kinematic plant with trainings of a few seconds.
fn brief() -> Scenario {
    let text = include_str!("../../../../worlds/acc.ron")
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("horizon_s: 15.0", "horizon_s: 8.0")
        .replace("Dqn(decisions: 300_000)", "Dqn(decisions: 6_000)")
        .replace(
            "plants: { Kinematic: 9, Rigid: 1 }",
            "plants: { Kinematic: 1 }",
        )
        .replace("decisions: 8_000_000", "decisions: 6_000");
    Scenario::parse("acc.ron", &text).expect("a world")
}

#[test]
fn every_ado_and_baseline_plays_every_ego_on_the_same_starts() {
    let dir = tempfile::tempdir().expect("scratch");
    let world = brief();
    let config = ReuseStudyConfig {
        seeds: ONE,
        starts: 16,
        tries: 3,
        runs: dir.path(),
    };
    let begun = ReuseStudy::begin(&world, config, &quiet())
        .expect("trainings")
        .expect("not stopped");
    let evaluate = |name: &str| -> EgoResult {
        let ego = EgoUnderTest::find(&world, name).expect("an ego");
        let results = begun.evaluate(&ego[0], &quiet());
        results.expect("rows").expect("not stopped")
    };
    let results = ["nominal", "softer brakes", "van"].map(evaluate).to_vec();
    // The study stores the results of every ego, so a stopped study can continue.
    let kept = serde_json::to_string(&results).expect("JSON");
    let of_two = begun.conclude(results[..2].to_vec());
    let study = begun.conclude(results);
    // The page lists the ados if all changed egos have one relation, too.
    let ados = |report: &ReuseReport| -> Vec<String> {
        let ados = report.blocks().ados.into_iter();
        ados.map(|it| it.ado).collect()
    };
    assert_eq!(ados(&of_two), ados(&study));
    assert!(!ados(&study).is_empty());
    assert!(study.rows.iter().all(|row| row.fails_alone.is_some()));
    // The stored results of every ego give the same study.
    let read: Vec<EgoResult> = serde_json::from_str(&kept).expect("what was written");
    let again = begun.conclude(read);
    assert_eq!(
        reuse_markdown(&[again]),
        reuse_markdown(std::slice::from_ref(&study))
    );
    let relations: Vec<Relation> = study.egos.iter().map(|ego| ego.relation).collect();
    let expected = [Relation::Trained, Relation::Inside, Relation::Outside];
    assert_eq!(relations, expected);
    for ego in &study.egos {
        let of = |ado: &str| {
            let row = ego.rows.iter().find(|row| row.ado == ado.into());
            row.unwrap_or_else(|| panic!("no row of {ado}"))
        };
        let starts = of(WIDE).solved.len();
        assert!(ego.rows.iter().all(|row| row.solved.len() == starts));
        // More tries and more simulations never solve fewer starts.
        let no_worse = |less: &str, more: &str| {
            let mut pairs = of(less).solved.iter().zip(of(more).solved.iter());
            pairs.all(|(less, more)| *less != Solved || *more == Solved)
        };
        assert!(no_worse(WIDE, WIDE_TRIES));
        assert!(no_worse("search, held, 10", "search, held, 30"));
        assert!(no_worse("search, held, 30", "search, held, 100"));
        assert!(no_worse("replay", "replays"));
        // Contacts belong to the counted simulations.
        for searched in ["search, held, 10", "search, held, 30"].map(of) {
            assert!(searched.contact_rate <= searched.success_rate);
        }
        assert!(of("search, held, 10").sims_per_start <= 10.0);
    }
    // Search is compared on every ego on which the wide ado succeeds.
    for ego in &study.egos {
        let wide = ego.rows.iter().filter(|row| row.ado == WIDE.into());
        let succeeds = wide.map(|row| row.successes).sum::<usize>() != 0;
        let mut lines = study.costs.iter();
        let compared = lines.any(|line| line.ego.as_ref() == Some(&ego.ego));
        assert_eq!(compared, succeeds, "{}", ego.ego);
    }
    // Blocks and changed egos are summarised.
    let blocks = |relation| {
        study
            .summary
            .iter()
            .filter(move |sum| sum.relation == relation)
    };
    assert!(blocks(Relation::Changed).count() > 0);
    let changed = blocks(Relation::Changed).find(|sum| sum.ado == WIDE.into());
    assert_eq!(changed.map(|sum| sum.egos), Some(2));
    assert!(changed.is_some_and(|sum| sum.reference_minus.is_none()));
    let table = reuse_markdown(std::slice::from_ref(&study));
    assert!(
        table.contains("| softer brakes | inside the family it was trained against |"),
        "{table}"
    );

    // Finished trainings are used unchanged.
    let again = ReuseStudy::begin(&world, config, &quiet())
        .expect("trainings")
        .expect("not stopped");
    let same = again
        .evaluate(&EgoUnderTest::nominal(&world), &quiet())
        .expect("rows")
        .expect("not stopped");
    assert_eq!(same.rows[0].solved, study.rows[0].solved);
    assert_eq!(again.conclude(vec![same]).train_cpu_s, study.train_cpu_s);
}

#[test]
fn a_world_without_a_family_is_refused() {
    let world = Scenario::parse("cut_in.ron", include_str!("../../../../worlds/cut_in.ron"))
        .expect("a world");
    let dir = tempfile::tempdir().expect("scratch");
    let config = ReuseStudyConfig {
        seeds: ONE,
        starts: 4,
        tries: 2,
        runs: dir.path(),
    };
    let refused = ReuseStudy::begin(&world, config, &quiet());
    assert!(matches!(
        refused.map(|_| ()),
        Err(ReuseError::NoFamily { .. })
    ));
}
