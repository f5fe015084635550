//! What a trained ado has to beat: cross-entropy, mutated counterexamples,
//! replays, a hand-made rule; and the number of starts from which on it pays.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use brakecheck::adversary::Ado;
use brakecheck::adversary::tune_heuristic;
use brakecheck::evaluation::break_even;
use brakecheck::experiment::Cost;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::RunDir;
use brakecheck::run_dir::Stored;
use brakecheck::search::{
    Adversary, BestConstant, Cem, Hold, Method, Mutate, SearchRequest, SearchResult, Switches,
    Uniform, search,
};
use brakecheck::stats::StartOutcome::{Solved, Unsolved};
use brakecheck::testbench::{Aftermath, Replay, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};
use brakecheck_training::training::train_loop::train;

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

fn acc() -> Scenario {
    super::acc().on(PlantKind::Kinematic)
}

/// The counterexamples of a short training on the kinematic plant, and its cost.
fn stored() -> &'static (Stored, Cost) {
    static STORED: OnceLock<(Stored, Cost)> = OnceLock::new();
    STORED.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a directory");
        let mut world = acc();
        world = world.training_for(15_000).expect("in range");
        let mut run = RunDir::create(&dir.path().join("run"), &world, 11).expect("a run");
        train(&world, &mut run, &quiet()).expect("it trains");
        let run = RunDir::open(run.path()).expect("a finished run");
        let cost = Cost::of_training(run.manifest());
        (run.counterexamples().expect("they are stored"), cost)
    })
}

fn request<'a>(
    world: &'a Scenario,
    method: Method<'a>,
    budget: u64,
    starts: &'a TestStarts,
) -> SearchRequest<'a> {
    SearchRequest {
        scenario: world,
        ego: "nominal",
        method,
        budget,
        starts,
    }
}

#[test]
fn every_stored_counterexample_is_one_again_on_the_nominal_ego() {
    let (stored, cost) = stored();
    assert!(stored.all().len() >= 100, "{}", stored.all().len());
    assert!(stored.all().len() as u64 <= cost.simulations);
    assert!(cost.simulations * 40 < cost.physics_steps);
    let world = acc();
    let mut bench = world.bench();
    for success in stored.all() {
        let mut replay = Replay::holding(&success.actions);
        let episode = play(&mut bench, &success.start, 0, &mut replay, Aftermath::Skip);
        assert!(episode.verdict.is_success(), "{success:?}");
        assert_eq!(episode.actions, success.actions);
        assert!((episode.robustness + success.by).abs() < 1e-9);
    }
    let indices: Vec<u64> = stored.all().iter().map(|s| s.decisions).collect();
    assert!(indices.is_sorted(), "in the order of the training");
}

#[test]
fn the_nearest_are_the_nearest() {
    let (stored, _) = stored();
    let axes = acc().axes();
    let world = acc();
    let starts = test_starts(&world, 77, 5, &quiet()).expect("not stopped");
    for (start, _) in &starts.starts {
        let distance = |other: &[f64]| -> f64 {
            let pairs = start.0.iter().zip(other).zip(&axes);
            pairs
                .map(|((a, b), x)| ((a - b) / (x.hi - x.lo)).powi(2))
                .sum()
        };
        let mut all: Vec<f64> = stored.all().iter().map(|s| distance(&s.start.0)).collect();
        all.sort_by(f64::total_cmp);
        let nearest: Vec<f64> = stored
            .nearest(start, 10)
            .into_iter()
            .map(|s| distance(&s.start.0))
            .collect();
        for (near, best) in nearest.iter().zip(&all) {
            assert!((near - best).abs() < 1e-12, "{nearest:?} {:?}", &all[..10]);
        }
    }
    let everything = stored.nearest(&starts.starts[0].0, usize::MAX);
    assert_eq!(everything.len(), stored.all().len());
}

#[test]
fn searches_do_not_depend_on_the_number_of_threads() {
    let world = super::acc();
    let (stored, _) = stored();
    let rows = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let starts = test_starts(&world, 1, 5, &quiet()).expect("not stopped");
            [
                Uniform.into(),
                Cem::default().into(),
                Mutate(stored).into(),
                Switches(1).into(),
            ]
            .map(|method| {
                let mut row = search(&request(&world, method, 30, &starts), &quiet()).row;
                // Processor time is measured, everything else is computed.
                row.cpu_s = 0.0;
                row
            })
        })
    };
    assert_eq!(rows(1), rows(2));
}

#[test]
fn cross_entropy_beats_uniform_actions() {
    let world = acc();
    let starts = test_starts(&world, 77, 150, &quiet()).expect("not stopped");
    let rate = |method| {
        let row = search(&request(&world, method, 100, &starts), &quiet()).row;
        row.success_rate
    };
    let (cem, uniform) = (rate(Cem::default().into()), rate(Uniform.into()));
    assert!(uniform + 0.2 < cem, "{cem} against {uniform}");
}

#[test]
fn mutated_counterexamples_beat_held_random_ones_on_a_changed_ego() {
    let world = acc();
    let changed = world.with(&world.reuse()["wet road"]).expect("it fits");
    let starts = test_starts(&world, 77, 150, &quiet()).expect("not stopped");
    let rate = |method| {
        let row = search(&request(&changed, method, 30, &starts), &quiet()).row;
        row.success_rate
    };
    let (mutated, held) = (rate(Mutate(&stored().0).into()), rate(Hold.into()));
    assert!(held + 0.2 < mutated, "{mutated} against {held}");
}

#[test]
fn a_smaller_budget_is_what_the_larger_one_had_reached_by_then() {
    let world = acc();
    let starts = test_starts(&world, 77, 60, &quiet()).expect("not stopped");
    let whole = search(&request(&world, Hold.into(), 100, &starts), &quiet()).row;
    let budgets: Vec<u64> = whole.anytime.iter().map(|at| at.budget).collect();
    assert_eq!(budgets, [10, 30, 100]);
    for at in &whole.anytime {
        let alone = search(&request(&world, Hold.into(), at.budget, &starts), &quiet()).row;
        assert_eq!(at.successes, alone.successes);
        assert_eq!(at.success_rate, alone.success_rate);
        assert_eq!(at.sims_per_start, alone.sims_per_start);
        assert_eq!(Some(at.ci95), alone.ci95);
    }
}

#[test]
fn replays_cost_what_they_try_and_more_of_them_solve_no_less() {
    let world = acc();
    let starts = test_starts(&world, 77, 150, &quiet()).expect("not stopped");
    let row = |ado| {
        let request = EvalRequest {
            scenario: &world,
            ego: "nominal",
            ado,
            starts: &starts,
        };
        eval(&request, &quiet()).row
    };
    let stored = &stored().0;
    let (one, ten) = (row(Ado::Replays(stored, 1)), row(Ado::Replays(stored, 10)));
    assert_eq!(one.sims_per_start, 1.0);
    assert!(ten.sims_per_start > 1.0 && ten.sims_per_start < 10.0);
    let mut pairs = one.solved.iter().zip(ten.solved.iter());
    assert!(pairs.all(|(one, ten)| one == ten || (*one, *ten) == (Unsolved, Solved)));
    assert!(one.successes + 10 < ten.successes, "{one:?} {ten:?}");
    assert!(row(Ado::Hold).successes < one.successes);
    // They are the first trials of `mutate`.
    let mutated = search(
        &request(&world, Mutate(stored).into(), 10, &starts),
        &quiet(),
    )
    .row;
    assert_eq!(mutated.solved, ten.solved);
    assert_eq!(mutated.sims_per_start, ten.sims_per_start);
}

#[test]
fn the_tuned_heuristic_is_the_same_again_and_beats_the_best_constant() {
    let world = acc();
    let heuristic = tune_heuristic(&world, 11, &quiet()).expect("it observes something");
    let again = tune_heuristic(&world, 11, &quiet()).expect("it observes something");
    assert_eq!(heuristic.text, again.text);
    assert_eq!(heuristic.reward, again.reward);
    assert!(
        heuristic
            .text
            .contains(&heuristic.cost.simulations.to_string())
    );
    let starts = test_starts(&world, 77, 200, &quiet()).expect("not stopped");
    let request = EvalRequest {
        scenario: &world,
        ego: "nominal",
        ado: Ado::Heuristic(&heuristic),
        starts: &starts,
    };
    let row = eval(&request, &quiet()).row;
    let ego = EgoUnderTest::nominal(&world);
    let constant = BestConstant
        .play(&ego, &starts, &quiet())
        .expect("it applies everywhere")
        .row;
    assert_eq!(row.sims_per_start, 1.0);
    assert!(
        constant.success_rate + 0.05 < row.success_rate,
        "{row:?} against {constant:?}"
    );
}

#[test]
fn break_even_is_the_training_over_what_each_start_saves() {
    let world = acc();
    let starts = test_starts(&world, 77, 5, &quiet()).expect("not stopped");
    let mut searched = search(&request(&world, Hold.into(), 100, &starts), &quiet());
    let found = |simulations: u64, solved: bool| {
        Some(SearchResult {
            actions: solved.then(|| vec![0]),
            simulations,
            physics_steps: 1000 * simulations,
            cpu_s: 0.5 * simulations as f64,
            ..SearchResult::default()
        })
    };
    searched.found = vec![
        found(1, true),
        found(20, true),
        found(40, true),
        None,
        found(100, false),
    ];
    let mut trained = searched.row.clone();
    (trained.starts, trained.successes) = (4, 2);
    (trained.success_rate, trained.sims_per_start) = (0.5, 1.0);
    (trained.physics_steps, trained.cpu_s) = (4 * 800, 0.0);
    let once = Cost {
        simulations: 920,
        physics_steps: 1_000_000,
        cpu_s: 40.0,
    };
    let even = break_even(&searched, 100, &trained, once).expect("there are starts");
    // Two of four are solved within 20 simulations: (1 + 20 + 20 + 20) / 4 each.
    assert!(even.matched);
    assert_eq!((even.budget, even.search.simulations), (20, 15.25));
    assert_eq!(even.starts, Some(920.0 / (15.25 - 1.0)));
    assert_eq!(even.starts_by_physics_steps, Some(1e6 / (15_250.0 - 800.0)));
    assert_eq!(even.starts_by_cpu_s, Some(40.0 / 7.625));
    assert!(
        even.curve
            .iter()
            .any(|at| at.budget == 20 && at.successes == 2)
    );
    assert_eq!(even.curve.last().map(|at| at.successes), Some(3));
    // Four of four are out of its reach: the whole budget, said to be so.
    (trained.successes, trained.success_rate) = (4, 1.0);
    let even = break_even(&searched, 100, &trained, once).expect("there are starts");
    assert!(!even.matched);
    assert_eq!((even.budget, even.search.simulations), (100, 40.25));
    // An ado that costs more per start than the search never pays.
    trained.sims_per_start = 50.0;
    let even = break_even(&searched, 100, &trained, once).expect("there are starts");
    assert_eq!(even.starts, None);
}
