//! Search, evaluation and their rows.

use std::sync::atomic::AtomicBool;

use brakecheck::adversary::Ado;
use brakecheck::experiment::{TestStarts, Watch, test_starts};
use brakecheck::search::{Hold, Method, SearchRequest, Switches, search};
use brakecheck::stats::StartOutcome;
use brakecheck::testbench::{Aftermath, Replay, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

fn request<'a>(
    world: &'a Scenario,
    method: Method<'a>,
    starts: &'a TestStarts,
) -> SearchRequest<'a> {
    SearchRequest {
        scenario: world,
        ego: "nominal",
        method,
        budget: 20,
        starts,
    }
}

#[test]
fn search_solves_what_a_replay_of_its_actions_solves_on_the_plant_asked_for() {
    let world = super::acc();
    let starts = test_starts(&world, 3, 24, &quiet()).expect("not stopped");
    let searched = search(&request(&world, Switches(1).into(), &starts), &quiet());
    assert!(searched.row.successes >= 12, "{:?}", searched.row);
    let mut bench = world.bench();
    for ((start, noise), found) in starts.starts.iter().zip(&searched.found) {
        let Some(actions) = found.as_ref().and_then(|found| found.actions.as_ref()) else {
            continue;
        };
        let mut replay = Replay::holding(actions);
        let episode = play(&mut bench, start, *noise, &mut replay, Aftermath::Skip);
        assert!(episode.verdict.is_success());
        let switches = actions.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert!(switches <= 1, "{actions:?}");
    }
}

#[test]
fn more_switches_solve_no_less_and_prefix_sharing_finds_what_brute_force_finds() {
    let world = super::acc().on(PlantKind::Kinematic);
    let starts = test_starts(&world, 5, 12, &quiet()).expect("not stopped");
    let none = search(&request(&world, Switches(0).into(), &starts), &quiet());
    let one = search(&request(&world, Switches(1).into(), &starts), &quiet());
    assert!(none.row.successes <= one.row.successes);
    let mut bench = world.bench();
    let decisions = bench.clock().decisions();
    for (index, (start, noise)) in starts.starts.iter().enumerate() {
        if starts.trivial[index] {
            continue;
        }
        let mut solvable = false;
        for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
            for switch in 1..=decisions {
                let actions: Vec<usize> = (0..decisions)
                    .map(|i| if i < switch { a } else { b })
                    .collect();
                let mut replay = Replay::holding(&actions);
                solvable |= play(&mut bench, start, *noise, &mut replay, Aftermath::Skip)
                    .verdict
                    .is_success();
            }
        }
        let found = one.row.solved[index] == StartOutcome::Solved;
        assert_eq!(found, solvable, "start {index}");
    }
}

#[test]
fn rows_do_not_depend_on_the_number_of_threads() {
    let world = super::acc();
    let rows = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let starts = test_starts(&world, 1, 14, &quiet()).expect("not stopped");
            let hold = EvalRequest {
                scenario: &world,
                ego: "nominal",
                ado: Ado::Hold,
                starts: &starts,
            };
            let mut rows = vec![
                eval(&hold, &quiet()).row,
                search(&request(&world, Hold.into(), &starts), &quiet()).row,
            ];
            // Processor time is measured, everything else is computed.
            rows.iter_mut().for_each(|row| row.cpu_s = 0.0);
            rows
        })
    };
    assert_eq!(rows(1), rows(2));
}

#[test]
fn trivial_starts_are_fixed_on_the_nominal_ego() {
    let world = super::acc();
    let starts = test_starts(&world, 0, 200, &quiet()).expect("not stopped");
    let trivial = starts.trivial.iter().filter(|t| **t).count();
    // PAPER's point mass has 3 to 7 %.
    assert!((2..=20).contains(&trivial), "{trivial}");
    let weak = world
        .with(&world.reuse()["softer brakes"])
        .expect("it fits");
    let row = eval(
        &EvalRequest {
            scenario: &weak,
            ego: "softer brakes",
            ado: Ado::Constant(1),
            starts: &starts,
        },
        &quiet(),
    )
    .row;
    assert_eq!(row.trivial, trivial);
    assert_eq!(row.starts + row.trivial, 200);
}

#[test]
fn a_stopped_evaluation_says_which_starts_it_did_not_reach() {
    let world = super::acc();
    let starts = test_starts(&world, 0, 10, &quiet()).expect("not stopped");
    let stop = AtomicBool::new(true);
    let watch = Watch::new(&|_, _| {}, &stop);
    let row = search(&request(&world, Switches(2).into(), &starts), &watch).row;
    assert_eq!(row.starts, 0);
    let unseen = [StartOutcome::NotReached, StartOutcome::Trivial];
    assert!(row.solved.iter().all(|outcome| unseen.contains(outcome)));
}
