//! Rows of evaluations, number by number.

use brakecheck::adversary::Ado;
use brakecheck::ego::{Fault, FaultKind};
use brakecheck::experiment::{EgoUnderTest, TestStarts, test_starts};
use brakecheck::rl::Policy;
use brakecheck::run_dir::Stored;
use brakecheck::run_dir::{AdversaryId, ClosingSpeed, Row};
use brakecheck::scene::Start;
use brakecheck::search::{Adversary, BestConstant, Guided, GuidingPolicy, SearchRequest, search};
use brakecheck::stats::{StartOutcome, at_most, wilson};
use brakecheck::testbench::{Actor, FaultLog, HeldRandom, Random, Success};
use brakecheck::world::{Repeats, Scenario};
use brakecheck_experiment::adversary::rollout::{EvalRequest, Evaluated, eval};

use super::near;
use super::scene::{
    HEADWAYS_M, Paper, Quirky, SUBSTEPS, chase, counted, paper, paper_of, quiet, share, starts,
    starts_at,
};

fn evaluated(world: &Scenario, ado: Ado<'_>, starts: &TestStarts) -> Evaluated {
    let request = EvalRequest {
        scenario: world,
        ego: "nominal",
        ado,
        starts,
    };
    eval(&request, &quiet())
}

/// The marks of all starts, from what the counted ones came to.
fn marks(of: impl Fn(f64) -> char) -> String {
    let mark = |h: f64| if h < 14.0 { 't' } else { of(h) };
    HEADWAYS_M.into_iter().map(mark).collect()
}

/// Everything that a row says of episodes, from the papers of the counted starts.
#[track_caller]
fn expect_row(row: &Row, papers: &[Paper], simulations: u64, steps: u64) {
    let n = papers.len();
    let count = |of: &dyn Fn(&Paper) -> bool| papers.iter().filter(|p| of(p)).count();
    let successes = count(&|p| p.success);
    assert_eq!((row.starts, row.successes), (n, successes));
    near(row.success_rate, successes as f64 / n as f64);
    assert_eq!(row.ci95, Some(wilson(successes, n)));
    assert_eq!(row.at_most, (successes == 0).then(|| at_most(n)));
    near(
        row.foul_rate,
        count(&|p| p.foul.is_some()) as f64 / n as f64,
    );
    near(
        row.foul_before_contact_rate.expect("followed"),
        count(&|p| p.late_foul) as f64 / n as f64,
    );
    near(
        row.contact_rate,
        count(&|p| p.closing_mps.is_some()) as f64 / n as f64,
    );
    near(row.sims_per_start, simulations as f64 / n as f64);
    assert_eq!(row.physics_steps, steps);
    assert_eq!(row.invalid, 0);
    assert!(row.faults.is_empty());
    assert_eq!((row.repeats, row.unconfirmed), (None, None));
    assert!(row.anytime.is_empty());
}

#[track_caller]
fn expect_speeds(row: &Row, median: f64, p90: Option<f64>) {
    let speeds = row.closing_speed_mps.expect("contacts");
    near(speeds.median, median);
    if let Some(p90) = p90 {
        near(speeds.p90, p90);
    }
}

/// The table in `scene`, constant by constant: successes, fouls, late fouls and
/// contacts among the sixteen starts that count.
#[test]
fn the_row_of_every_constant_is_the_one_on_paper() {
    let world = chase();
    let table = [
        // Speeding up breaks the second rule on the first sample.
        (0, 0, 16, 0, 0, 16),
        // Coasting holds everywhere, for all sixteen samples.
        (1, 0, 0, 0, 0, 16 * 16),
        (2, 9, 0, 0, 3, 0),
        (3, 14, 2, 0, 11, 0),
        (4, 9, 7, 5, 9, 0),
    ];
    for (action, successes, fouls, late, contacts, samples) in table {
        let row = evaluated(&world, Ado::Constant(action), &starts()).row;
        let papers: Vec<Paper> = counted().map(|h| paper_of(h, &[action])).collect();
        let steps = papers.iter().map(Paper::steps).sum();
        expect_row(&row, &papers, 16, steps);
        assert_eq!((row.successes, row.trivial, row.starts), (successes, 2, 16));
        assert_eq!(row.foul_rate, share(fouls));
        assert_eq!(row.foul_before_contact_rate, Some(share(late)));
        assert_eq!(row.contact_rate, share(contacts));
        if samples != 0 {
            assert_eq!(row.physics_steps, SUBSTEPS * samples);
        }
        // By the thresholds alone.
        let bound_m = [0.0, 14.0, 22.0, 27.8125, 21.875][action];
        let solved = marks(|h| if h < bound_m { '1' } else { '0' });
        assert_eq!(row.solved.to_string(), solved, "action {action}");
        assert_eq!((row.recall, row.beyond_search), (None, None));
        assert_eq!((row.ado.caption(), row.start_seed), ("constant", 7));
    }
}

/// √(1 + 2|a|(h − 4.54)): of three starts the middle one for −1 m/s², of eleven
/// the sixth and the tenth for −2, of nine the fifth for −3.
#[test]
fn closing_speeds_are_those_of_the_fall() {
    let world = chase();
    let speed = |a: f64, h: f64| (1.0 + 2.0 * a * (h - 4.54)).sqrt();
    let row = |action| evaluated(&world, Ado::Constant(action), &starts()).row;
    expect_speeds(&row(2), speed(1.0, 15.01), Some(speed(1.0, 16.01)));
    expect_speeds(&row(3), speed(2.0, 18.51), Some(speed(2.0, 22.51)));
    expect_speeds(&row(4), speed(3.0, 18.01), None);
    assert_eq!(row(1).closing_speed_mps, None);
    // By hand: √56.88, √72.88.
    expect_speeds(&row(3), 7.5418830540, Some(8.5369783882));
    // Nearest rank of four: the fourth; of one: the one.
    let of = |speeds: &[f64]| ClosingSpeed::of(speeds.to_vec()).expect("speeds");
    assert_eq!(of(&[4.0, 1.0, 3.0, 2.0]).p90, 4.0);
    assert_eq!(of(&[3.0, 1.0, 50.0]).median, 3.0);
    assert_eq!((of(&[5.0]).median, of(&[5.0]).p90), (5.0, 5.0));
    let twenty_one: Vec<f64> = (0..21).rev().map(f64::from).collect();
    assert_eq!((of(&twenty_one).median, of(&twenty_one).p90), (10.0, 18.0));
    assert_eq!(ClosingSpeed::of(Vec::new()), None);
}

#[test]
fn the_best_constant_is_the_one_that_solves_most_and_of_equals_the_first() {
    let world = chase();
    let ego = EgoUnderTest::nominal(&world);
    let best = |headways_m: &[f64], expected: usize| {
        let starts = starts_at(headways_m);
        let best = BestConstant.play(&ego, &starts, &quiet());
        let row = best.expect("it applies everywhere").row;
        assert_eq!(row.ado, AdversaryId::BestConstant);
        let method = format!("{}, the best of 5", world.action_label(expected));
        assert_eq!(row.method, method);
        row
    };
    let row = best(&HEADWAYS_M, 3);
    assert_eq!((row.successes, row.starts), (14, 16));
    // Three solve both of these, and nothing solves the last.
    best(&[15.0, 16.0, 28.0], 2);
    let row = best(&[28.0], 0);
    assert_eq!((row.successes, row.at_most), (0, Some(0.95)));
}

/// Brakes hard from afar and softly near by: reads the headway, scaled by
/// (h − 20)/20; −0.035 are 19.3 m.
struct Near;

impl Policy for Near {
    fn act(&self, obs: &[f32]) -> usize {
        if obs[0] < -0.035 { 2 } else { 4 }
    }

    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

fn near_19(_: usize, headway_m: f64) -> usize {
    if headway_m < 19.3 { 2 } else { 4 }
}

#[test]
fn a_policy_is_asked_at_every_decision_and_its_row_is_the_one_on_paper() {
    let world = chase();
    let row = evaluated(&world, Ado::Trained(&Near, 5), &starts()).row;
    let papers: Vec<Paper> = counted().map(|h| paper(h, true, near_19)).collect();
    let steps = papers.iter().map(Paper::steps).sum();
    expect_row(&row, &papers, 16, steps);
    assert_eq!(
        row.solved.to_string(),
        marks(|h| paper(h, true, near_19).mark())
    );
    assert_eq!((row.ado.caption(), row.train_seed), ("trained", Some(5)));
    // From 22.5 m it brakes hard for a second or more, and gets closer than one
    // that brakes softly all the time, which fails from 22 m on.
    assert!(row.successes > 10 && row.successes < 16, "{row:?}");
    let rule = Ado::Rule(&Near, "rule", "brakes hard from afar");
    let ruled = evaluated(&world, rule, &starts()).row;
    assert_eq!((ruled.solved, ruled.train_seed), (row.solved, None));
    assert_eq!(
        (ruled.ado.caption(), ruled.method.as_str()),
        ("rule", "brakes hard from afar")
    );
}

/// The random ados draw from the seed of each start's noise; what they draw is
/// asked of them, and what comes of it is worked out.
#[test]
fn random_and_held_ados_come_to_what_their_draws_come_to() {
    let world = chase();
    let starts = starts();
    let drawn = |actor: &mut dyn Actor, index: usize| -> Vec<usize> {
        let (start, noise) = &starts.starts[index];
        actor.begin(*noise, start);
        (0..8).map(|_| actor.act(&[])).collect()
    };
    let of = |actor: &mut dyn Actor| -> Vec<Paper> {
        let counted = (0..HEADWAYS_M.len()).filter(|&i| !starts.trivial[i]);
        counted
            .map(|i| paper_of(HEADWAYS_M[i], &drawn(actor, i)))
            .collect()
    };
    let (random, held) = (of(&mut Random::new(5)), of(&mut HeldRandom::new(5, 5)));
    for (ado, word, papers) in [(Ado::Random, "random", random), (Ado::Hold, "hold", held)] {
        let row = evaluated(&world, ado, &starts).row;
        let steps = papers.iter().map(Paper::steps).sum();
        expect_row(&row, &papers, 16, steps);
        assert_eq!(row.ado.caption(), word);
    }
    // Held for five decisions, then for the next three; else a new one each time.
    let mut actor = HeldRandom::new(5, 5);
    let mut firsts = [0; 5];
    for index in (0..400).map(|i| i % starts.starts.len()) {
        let (start, noise) = &starts.starts[index];
        actor.begin(noise + 7919 * firsts.iter().sum::<u64>(), start);
        let actions: Vec<usize> = (0..10).map(|_| actor.act(&[])).collect();
        assert!(actions[..5].iter().all(|a| *a == actions[0]), "{actions:?}");
        assert!(actions[5..].iter().all(|a| *a == actions[5]), "{actions:?}");
        firsts[actions[0]] += 1;
    }
    // 80 of each expected; five standard deviations are 40.
    assert!(firsts.iter().all(|n| (40..=120).contains(n)), "{firsts:?}");
}

#[test]
fn trivial_are_the_starts_from_which_a_coasting_ado_solves() {
    let world = chase();
    let drawn = test_starts(&world, 3, 200, &quiet()).expect("not stopped");
    let mut trivial = 0;
    for ((start, _), seen) in drawn.starts.iter().zip(&drawn.trivial) {
        assert!((11.0..=60.0).contains(&start.0[0]));
        assert_eq!(*seen, start.0[0] < 14.0, "{start:?}");
        trivial += usize::from(*seen);
    }
    // 3 m of 49: 12 of 200 expected, ± five standard deviations.
    assert!((1..=29).contains(&trivial), "{trivial}");
    let row = evaluated(&world, Ado::Constant(3), &drawn).row;
    let counted: Vec<f64> = drawn.starts.iter().map(|(s, _)| s.0[0]).collect();
    let solved = counted.iter().filter(|h| (14.0..27.8125).contains(*h));
    assert_eq!(row.successes, solved.count());
    assert_eq!((row.trivial, row.starts), (trivial, 200 - trivial));
    assert_eq!(row.solved.count(StartOutcome::Trivial), trivial);
}

fn stored(from: &[(f64, &[usize])]) -> Stored {
    let success = |(i, (h, actions)): (usize, &(f64, &[usize]))| Success {
        decisions: i as u64,
        index: i as u64,
        start: Start(vec![*h]),
        actions: actions.to_vec(),
        by: 1.0,
    };
    let all = from.iter().enumerate().map(success).collect();
    Stored::new(all, &chase().axes())
}

/// Nearest to 16 m: 15 (coasts), then 18 (−1), then 22 (−2): the second solves it.
/// Nearest to 26.5 m: 22 (−2), which solves it. Nearest to 28 m: none of them does.
#[test]
fn replays_cost_one_simulation_each_until_one_succeeds() {
    let world = chase();
    let stored = stored(&[(22.0, &[3]), (15.0, &[1, 1]), (18.0, &[2])]);
    let headways_m = [16.0, 26.5, 28.0];
    let order: [&[usize]; 3] = [&[1, 2], &[3], &[3, 2, 1]];
    let starts = starts_at(&headways_m);
    let rows = [1, 3, 10].map(|most| evaluated(&world, Ado::Replays(&stored, most), &starts).row);
    assert_eq!(rows[0].solved.to_string(), "010");
    assert_eq!(
        (rows[0].sims_per_start, rows[0].ado.caption()),
        (1.0, "replay")
    );
    for row in &rows[1..] {
        assert_eq!(
            (row.solved.to_string(), row.ado.caption()),
            ("110".to_owned(), "replays")
        );
        near(row.sims_per_start, (2.0 + 1.0 + 3.0) / 3.0);
        let pairs = headways_m.iter().zip(order);
        let played = pairs.flat_map(|(h, order)| order.iter().map(|a| paper_of(*h, &[*a])));
        assert_eq!(row.physics_steps, played.map(|p| p.steps()).sum::<u64>());
        // The failure that is shown is the nearest one's: a foul at the horizon.
        near(row.foul_rate, 1.0 / 3.0);
    }
    // Distances count in widths of each axis, and of equals the older comes first.
    let mut axes = chase().axes();
    axes.push(brakecheck::scene::Axis {
        name: "other".to_owned(),
        lo: 0.0,
        hi: 1.0,
        ..axes[0].clone()
    });
    let at = |i: u64, h: f64, other: f64| Success {
        decisions: i,
        index: i,
        start: Start(vec![h, other]),
        actions: vec![0],
        by: 1.0,
    };
    // From (20, 0.5): 4 m of 49 are 0.08, either way, and 0.2 of 1 is 0.2.
    let all = vec![
        at(0, 20.0, 0.7),
        at(1, 24.0, 0.5),
        at(2, 16.0, 0.5),
        at(3, 60.0, 0.5),
    ];
    let stored = Stored::new(all, &axes);
    let nearest = stored.nearest(&Start(vec![20.0, 0.5]), 3);
    let indices: Vec<u64> = nearest.iter().map(|s| s.index).collect();
    assert_eq!(indices, [1, 2, 0]);
}

/// Takes the same action everywhere.
struct Always(usize);

impl Policy for Always {
    fn act(&self, _obs: &[f32]) -> usize {
        self.0
    }

    fn value(&self, _obs: &[f32]) -> f32 {
        0.0
    }
}

/// The first run is greedy, and the others explore.
#[test]
fn tries_count_every_run_until_the_first_success() {
    let world = chase();
    let headways_m = [15.0, 26.5, 50.0];
    let starts = starts_at(&headways_m);
    let run = |greedy: usize, tries: u64| {
        let policy = Always(greedy);
        let request = SearchRequest {
            scenario: &world,
            ego: "nominal",
            method: Guided(GuidingPolicy(&policy)).into(),
            budget: tries,
            starts: &starts,
        };
        let tried = search(&request, &quiet());
        for (headway_m, found) in headways_m.iter().zip(tried.found.iter().flatten()) {
            let Some(actions) = &found.actions else {
                assert_eq!(found.simulations, tries);
                continue;
            };
            assert!(paper_of(*headway_m, actions).success);
        }
        tried.row
    };
    // Greedy alone: −2 solves the first two, and violates a rule on the last.
    let row = run(3, 1);
    assert_eq!((row.sims_per_start, row.max_sims_per_start), (1.0, Some(1)));
    assert_eq!(row.solved.to_string(), "110");
    near(row.foul_rate, 1.0 / 3.0);
    // No sequence solves the last start, so all five runs are charged.
    let row = run(3, 5);
    assert_eq!(row.solved.to_string(), "110");
    near(row.sims_per_start, (1.0 + 1.0 + 5.0) / 3.0);
    assert_eq!(row.max_sims_per_start, Some(5));
    assert_eq!(row.method, "guided, at most 5 runs");
    assert_eq!(row.ado, AdversaryId::Guided);
    let budgets: Vec<u64> = row.anytime.iter().map(|at| at.budget).collect();
    assert_eq!(budgets, [1, 5]);
    near(row.anytime[0].success_rate, 2.0 / 3.0);
    // Coasting solves nothing, so every success is one of a later run.
    assert_eq!(run(1, 1).successes, 0);
    let row = run(1, 30);
    assert!(row.successes > 0 && row.sims_per_start > 1.0);
    near(row.anytime[0].success_rate, 0.0);
}

/// An ego that fails to answer on two starts: they are in no rate.
#[test]
fn starts_on_which_the_ego_fails_are_in_no_rate() {
    let world = Quirky::failing_from(&[16.5, 19.9]).drives(&chase());
    let request = EvalRequest {
        scenario: &world,
        ego: "quirky",
        ado: Ado::Constant(3),
        starts: &starts(),
    };
    let mut watch = quiet();
    watch.faults = FaultLog::allowing(0.5);
    let row = eval(&request, &watch).row;
    // 17.01 and 20.51 m are lost: of fourteen, twelve are solved and two are fouls.
    assert_eq!(
        (row.starts, row.successes, row.trivial, row.invalid),
        (14, 12, 2, 2)
    );
    near(row.success_rate, 12.0 / 14.0);
    assert_eq!(row.ci95, Some(wilson(12, 14)));
    near(row.foul_rate, 2.0 / 14.0);
    near(row.contact_rate, 9.0 / 14.0);
    near(row.invalid_share(), 2.0 / 16.0);
    assert_eq!(row.sims_per_start, 1.0);
    let fails = |h: f64| h == 17.01 || h == 20.51;
    let solved = marks(|h| {
        if fails(h) {
            'x'
        } else if h < 27.8125 {
            '1'
        } else {
            '0'
        }
    });
    assert_eq!(row.solved.to_string(), solved);
    // It answers three times, so three samples are simulated, and a fourth begun.
    let papers = counted()
        .filter(|h| !fails(*h))
        .map(|h| paper_of(h, &[3]).samples);
    assert_eq!(row.physics_steps, SUBSTEPS * (papers.sum::<u64>() + 2 * 4));
    assert_eq!(row.faults.len(), 1);
    let faults = &row.faults[0];
    assert_eq!(
        (faults.kind, faults.count, faults.first_start),
        (FaultKind::Error, 2, 4)
    );
    let complaint = watch.faults.complaint();
    assert!(complaint.is_none(), "fewer than allowed");
}

/// Five runs of each start, in the first two of which the ego does nothing: with a
/// gate of two the starts are solved that −2 m/s² solves, with three none is.
#[test]
fn starts_played_several_times_are_solved_from_the_gate_on() {
    for (gate, solves) in [(2, true), (3, false)] {
        let quirky = Quirky {
            brakes: Some((5, 2)),
            ..Quirky::failing_from(&[])
        };
        let mut world = quirky.drives(&chase());
        world = world.repeated(Repeats { runs: 5, gate });
        let row = evaluated(&world, Ado::Constant(3), &starts()).row;
        assert_eq!(row.successes, if solves { 14 } else { 0 });
        assert_eq!((row.starts, row.sims_per_start), (16, 5.0));
        let repeats = row.repeats.expect("runs");
        assert_eq!(
            (repeats.runs, repeats.gate, repeats.differing),
            (5, gate, 16)
        );
        // 14 starts of 16 in 2 runs of 5.
        near(repeats.failing_share, 28.0 / 80.0);
        // Fouls of an unsolved start are those of the run that stands for it:
        // a foul at 4 s for the two starts that nothing solves.
        let fouls = if solves { share(2) } else { 1.0 };
        near(row.foul_rate, fouls);
    }
    // A start on which the ego fails to answer is in no share: 13 of 15 are solved.
    let quirky = Quirky {
        brakes: Some((5, 2)),
        ..Quirky::failing_from(&[16.5])
    };
    let mut world = quirky.drives(&chase());
    world = world.repeated(Repeats { runs: 5, gate: 2 });
    let request = EvalRequest {
        scenario: &world,
        ego: "quirky",
        ado: Ado::Constant(3),
        starts: &starts(),
    };
    let mut watch = quiet();
    watch.faults = FaultLog::allowing(0.5);
    let row = eval(&request, &watch).row;
    assert_eq!((row.starts, row.successes, row.invalid), (15, 13, 1));
    near(row.repeats.expect("runs").failing_share, 26.0 / 75.0);
    assert_eq!(row.sims_per_start, 5.0);
}

/// A fault outside of the rows, on a trivial start say, is not made up for by a
/// row in which nothing failed.
#[test]
fn a_row_without_faults_takes_no_complaint_away() {
    let fault = Fault::new(FaultKind::Ended, "gone");
    let log = FaultLog::default();
    log.note(0, Some(&fault));
    log.note(1, None);
    log.note_row(|| "a sound row".to_owned(), 0.0);
    let complaint = log.complaint().expect("half of the episodes are invalid");
    assert_eq!((complaint.invalid, complaint.episodes), (1, 2));
    assert_eq!(complaint.row, None);
    let lenient = FaultLog::allowing(0.5);
    lenient.note(0, Some(&fault));
    lenient.note(1, None);
    assert!(lenient.complaint().is_none());
}
