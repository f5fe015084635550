//! Ados whose driving may be no rarer than a limit among real drivers.

use brakecheck::experiment::{EgoUnderTest, TestStarts, test_starts};
use brakecheck::rl::Policy;
use brakecheck::run_dir::{Counterexample, Row};
use brakecheck::search::{Adversary, Search};
use brakecheck::testbench::{Aftermath, Constant, Episode, PolicyActor, play};
use brakecheck::vector_env::{EnvLayout, VectorEnv};
use brakecheck::world::{Change, PlantKind, Scenario};
use brakecheck_crashes::crashes::save_crashes::description;

use super::scene::quiet;

fn acc() -> Scenario {
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    world.on(PlantKind::Kinematic)
}

fn starts(world: &Scenario) -> TestStarts {
    test_starts(world, 31, 40, &quiet()).expect("not stopped")
}

fn searched(world: &Scenario, starts: &TestStarts) -> Row {
    let ego = EgoUnderTest::nominal(world);
    let cell = Search::switches(2).play(&ego, starts, &quiet());
    cell.expect("a search").row
}

/// Episodes of an ado that brakes all the time.
fn braked(world: &Scenario, starts: &TestStarts) -> Vec<Episode> {
    let mut bench = world.bench();
    let mut play_from =
        |(start, noise)| play(&mut bench, start, noise, &mut Constant(0), Aftermath::Skip);
    let starts = starts.starts.iter();
    starts
        .map(|(start, noise)| play_from((start, *noise)))
        .collect()
}

#[test]
fn ados_do_nothing_rarer_than_the_limit() {
    // Within the speeds of the data, which begin at 12.4 m/s.
    let text = include_str!("../../worlds/acc.ron")
        .replace("(5.0, 25.0)", "(22.0, 25.0)")
        .replace("horizon_s: 15.0", "horizon_s: 3.0");
    let world = Scenario::parse("acc.ron", &text)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let starts = starts(&world);
    let mut rated = 0;
    for per_1000_km in [50.0, 20.0, 10.0] {
        let limited = world.naturally(per_1000_km);
        for episode in braked(&limited, &starts) {
            let known = description(&limited, &episode).naturalness.expect("a car");
            rated += usize::from(known.per_1000_km.is_some());
            // Outside the data there is no rate.
            assert!(
                known.outside.is_empty() || known.per_1000_km.is_none(),
                "{known}"
            );
            let rate = known.per_1000_km.unwrap_or(f64::INFINITY);
            assert!(per_1000_km <= rate, "{per_1000_km}: {known}");
            // It brakes whenever it may.
            assert!(episode.actions.contains(&0), "{per_1000_km}");
        }
        assert_ne!(braked(&limited, &starts), braked(&world, &starts));
    }
    assert!(rated > 0, "all are outside the data");
}

#[test]
fn a_more_natural_ado_finds_fewer_failures() {
    let world = acc();
    let starts = starts(&world);
    let levels = [0.001, 0.1, 1.0, 10.0, 100.0];
    let rows = levels.map(|level| searched(&world.naturally(level), &starts));
    let found = rows.clone().map(|row| row.successes);
    assert!(found.is_sorted_by(|a, b| a >= b), "{found:?}");
    assert!(found[4] < found[0], "{found:?}");
    assert!(found[0] <= searched(&world, &starts).successes);
    for (row, level) in rows.iter().zip(levels) {
        let natural = row.naturalness.as_ref().expect("a limit");
        assert_eq!(natural.limit_per_1000_km, Some(level));
        assert_eq!(natural.successes, row.successes);
        let median = natural.median.as_ref().and_then(|it| it.per_1000_km);
        assert!(median.is_none_or(|rate| level <= rate), "{natural}");
    }
}

#[test]
fn what_was_found_within_a_limit_replays_without_it() {
    let world = acc();
    let limited = world.naturally(0.001);
    for episode in braked(&limited, &starts(&world)).iter().take(5) {
        let kept =
            Counterexample::record(&limited, "nominal", &Change::default(), "constant", episode);
        let mut ado = brakecheck::testbench::Replay::holding(&kept.actions);
        let again = play(
            &mut world.bench(),
            &episode.start,
            episode.noise,
            &mut ado,
            Aftermath::Skip,
        );
        assert_eq!(&again, episode);
    }
}

/// Prefers hard braking, then acceleration, then its neutral action.
struct Prefers;

impl Policy for Prefers {
    fn act(&self, _obs: &[f32]) -> usize {
        0
    }

    fn act_among(&self, _obs: &[f32], allowed: &[bool]) -> usize {
        [0, 2, 1]
            .into_iter()
            .find(|action| allowed[*action])
            .expect("neutral")
    }

    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

#[test]
fn a_policy_takes_its_best_allowed_action() {
    let world = acc().naturally(20.0);
    let (start, noise) = &starts(&world).starts[0];
    let mut bench = world.bench();
    let mut ado = PolicyActor(&Prefers);
    let episode = play(&mut bench, start, *noise, &mut ado, Aftermath::Skip);
    assert!(episode.actions.contains(&2), "{:?}", episode.actions);
    assert!(!episode.actions.contains(&1), "{:?}", episode.actions);
}

#[test]
fn limited_environments_are_stepped_by_benches() {
    let layout = |world: &Scenario| VectorEnv::new(world, 2).layout();
    assert_eq!(layout(&acc()), EnvLayout::Lanes);
    assert_eq!(layout(&acc().naturally(10.0)), EnvLayout::Benches);
}
