//! Rows of searches: what is found, and what it takes to find it.

use std::sync::Arc;

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::experiment::ControllerFactory;
use brakecheck::experiment::TestStarts;
use brakecheck::run_dir::Stored;
use brakecheck::run_dir::{ClosingSpeed, Row, Unconfirmed};
use brakecheck::scene::Start;
use brakecheck::search::{
    Cem, Hold, Method, Mutate, SearchRequest, SearchResult, Searched, Switches, Uniform, anytime,
    search,
};
use brakecheck::stats::{at_most, wilson};
use brakecheck::testbench::{FaultLog, Success};
use brakecheck::world::Scenario;

use super::near;
use super::scene::{
    ACCELERATIONS, DECISIONS, HEADWAYS_M, Paper, Quirky, SUBSTEPS, altered, chase, paper, paper_of,
    quiet, starts, starts_at,
};

fn searched(world: &Scenario, method: Method<'_>, budget: u64, starts: &TestStarts) -> Searched {
    let request = SearchRequest {
        scenario: world,
        ego: "nominal",
        method,
        budget,
        starts,
    };
    search(&request, &quiet())
}

/// What a search of all sequences with few switches comes to on paper.
#[derive(Default)]
struct Tree {
    h: f64,
    /// A rule that is only on paper: whether a sequence that solves carries over.
    carries: bool,
    most_confirmed: u64,
    simulations: u64,
    decisions_steps: u64,
    unconfirmed: u64,
    /// Of the sequences that solve: how often the first action is a new one.
    beginnings: u64,
    last_begun: Option<usize>,
    found: Option<Vec<usize>>,
    over: bool,
}

impl Tree {
    /// Fewest switches first; of these the lower first action, the earlier switch,
    /// the lower next action.
    fn search(h: f64, most: usize, carries: bool) -> Tree {
        let mut tree = Tree {
            h,
            carries,
            most_confirmed: 300,
            ..Tree::default()
        };
        for switches in 0..=most {
            for action in 0..ACCELERATIONS.len() {
                tree.grow(&mut Vec::new(), action, switches);
            }
        }
        tree
    }

    /// Episode of a prefix: samples simulated in it, and whether it is over.
    fn at(&self, prefix: &[usize]) -> (Paper, bool) {
        let seen = paper(self.h, false, |at, _| prefix[at.min(prefix.len() - 1)]);
        let played = 2 * prefix.len() as u64;
        let samples = seen.samples.min(played);
        (Paper { samples, ..seen }, seen.samples <= played)
    }

    /// Walks on with `action`; every decision that was not walked before costs.
    fn grow(&mut self, prefix: &mut Vec<usize>, action: usize, switches: usize) {
        if self.over {
            return;
        }
        let depth = prefix.len();
        self.simulations += u64::from(switches == 0);
        let mut before = match depth {
            0 => 0,
            _ => self.at(prefix).0.samples,
        };
        loop {
            prefix.push(action);
            let (seen, over) = self.at(prefix);
            self.decisions_steps += SUBSTEPS * (seen.samples - before);
            before = seen.samples;
            if over {
                if switches == 0 && seen.success {
                    self.solved(prefix);
                }
                break;
            }
            for other in (0..ACCELERATIONS.len()).filter(|other| *other != action) {
                if switches > 0 {
                    self.grow(prefix, other, switches - 1);
                }
                if self.over {
                    return;
                }
            }
        }
        prefix.truncate(depth);
    }

    fn solved(&mut self, prefix: &[usize]) {
        self.beginnings += u64::from(self.last_begun != Some(prefix[0]));
        self.last_begun = Some(prefix[0]);
        self.unconfirmed += u64::from(!self.carries);
        if self.carries {
            self.found = Some(prefix.to_vec());
        }
        self.over = self.carries || self.unconfirmed == self.most_confirmed;
    }
}

/// Without a solution every sequence is tried: 5 of one action, and with one
/// switch at seven places among four others; +1 is a foul at its first sample, so
/// that it has no switch behind it and ends whatever switches to it.
#[test]
fn the_cost_of_a_search_without_solution_is_a_closed_form() {
    let world = chase();
    let starts = starts_at(&[50.01]);
    // Nothing brakes for longer than its rule allows: −3 lasts five decisions,
    // and is over in the sixth, −2 lasts all eight.
    let none = searched(&world, Switches(0).into(), 1, &starts);
    assert_eq!((none.row.sims_per_start, none.row.successes), (5.0, 0));
    // Samples: 1, 16, 16, 16 and 11.
    assert_eq!(none.row.physics_steps, SUBSTEPS * (1 + 16 + 16 + 16 + 11));
    // From 0, −1 and −2 there are 7 places to switch, from −3 there are 5, with
    // four others each: 7 · 4 · 3 + 5 · 4 sequences more.
    let one = searched(&world, Switches(1).into(), 1, &starts);
    assert_eq!(one.row.sims_per_start, (5 + 7 * 4 * 3 + 5 * 4) as f64);
    let row = one.row;
    assert_eq!((row.at_most, row.recall), (Some(at_most(1)), None));
    assert_eq!(row.solved.to_string(), "0");
    assert_eq!(row.unconfirmed, None, "nothing pre-screens on this plant");
    assert_eq!(row.method, "switches ≤ 1");
    assert!(row.anytime.is_empty());
}

#[test]
fn sequences_with_few_switches_are_found_where_and_when_paper_finds_them() {
    let world = chase();
    for most in 0..=2 {
        let Searched { row, found } = searched(&world, Switches(most).into(), 1, &starts());
        let mut papers = Vec::new();
        let (mut simulations, mut steps) = (0, 0);
        for (h, found) in HEADWAYS_M.into_iter().zip(&found) {
            if h < 14.0 {
                assert!(found.is_none());
                continue;
            }
            let tree = Tree::search(h, most, true);
            let found = found.as_ref().expect("searched");
            assert_eq!(found.actions, tree.found, "{h} m");
            assert_eq!(found.simulations, tree.simulations, "{h} m");
            // What succeeds is played once more, to the contact.
            let shown = tree.found.as_ref().map(|actions| paper_of(h, actions));
            let again = shown.map_or(0, |shown| shown.steps());
            assert_eq!(found.physics_steps, tree.decisions_steps + again, "{h} m");
            let shown = shown.unwrap_or_default();
            assert_eq!(found.violation_before_contact, shown.late_foul, "{h} m");
            match (found.closing_speed_mps, shown.closing_mps) {
                (Some(speed), Some(expected)) => near(speed, expected),
                (speed, expected) => assert_eq!(speed, expected, "{h} m"),
            }
            simulations += tree.simulations;
            steps += found.physics_steps;
            papers.push(shown);
        }
        let count = |of: fn(&Paper) -> bool| papers.iter().filter(|p| of(p)).count();
        let successes = count(|p| p.success);
        assert_eq!((row.starts, row.trivial, row.successes), (16, 2, successes));
        assert_eq!(row.ci95, Some(wilson(successes, 16)));
        near(row.sims_per_start, simulations as f64 / 16.0);
        assert_eq!(row.physics_steps, steps);
        near(
            row.contact_rate,
            count(|p| p.closing_mps.is_some()) as f64 / 16.0,
        );
        let late = row.foul_before_contact_rate.expect("followed");
        near(late, count(|p| p.late_foul) as f64 / 16.0);
        assert!(row.foul_rate > 0.0 && row.foul_rate < 1.0);
        // −2 solves what constants can; braking early and coasting solves 28.01 m too.
        assert_eq!(successes, [14, 15, 15][most]);
        let speeds: Vec<f64> = papers.iter().filter_map(|p| p.closing_mps).collect();
        near(
            row.closing_speed_mps.expect("contacts").median,
            ClosingSpeed::of(speeds).expect("contacts").median,
        );
    }
}

/// A rule that the flat plant keeps and rolling wheels do not, since their positions
/// are numbers of 32 bits: the ego is where 11 m/s take it, to a nanometre.
const EXACT: &str = "always[0.25, T] (abs(ego.x - 11 * time) <= 0.000000001)";

/// The chase on rigid bodies with one more rule, of the least priority.
fn rigid_with(rule: &str) -> Scenario {
    let rules = format!("rulebook: [ Rule(name: \"more\", priority: 3, stl: \"{rule}\"),");
    altered(&[
        ("rulebook: [", &rules),
        ("plant: Kinematic", "plant: Rigid"),
    ])
}

/// Nearer than 20 m the rule is kept on both plants; farther away whatever succeeds
/// when pre-screened is no success on rigid bodies.
#[test]
fn what_does_not_carry_over_to_rigid_bodies_is_counted() {
    let world = rigid_with(&format!("headway < 20 or {EXACT}"));
    let headways_m = [15.51, 17.01, 20.51, 24.01, 50.01];
    let starts = starts_at(&headways_m);
    let Searched { row, found } = searched(&world, Switches(1).into(), 1, &starts);
    let trees = headways_m.map(|h| Tree::search(h, 1, h < 20.0));
    let mut simulations = 0;
    for ((h, tree), found) in headways_m.iter().zip(&trees).zip(&found) {
        let found = found.as_ref().expect("searched");
        assert_eq!(found.actions, tree.found, "{h} m");
        assert_eq!(found.unconfirmed, tree.unconfirmed, "{h} m");
        // Each sequence that went on to rigid bodies is a simulation more.
        let confirmed = tree.unconfirmed + u64::from(tree.found.is_some());
        assert_eq!(found.simulations, tree.simulations + confirmed, "{h} m");
        simulations += found.simulations;
        let rigid = found.physics_steps - tree.decisions_steps;
        match &tree.found {
            // One episode, which may touch a sample sooner or later.
            Some(actions) => {
                let expected = paper_of(*h, actions).steps();
                assert!(rigid.abs_diff(expected) <= SUBSTEPS, "{rigid}, {expected}");
            }
            // The rule is lost on the first sample; a sequence that begins as the
            // one before it does goes on from there.
            None => assert_eq!(rigid, SUBSTEPS * tree.beginnings, "{h} m"),
        }
    }
    assert_eq!(row.solved.to_string(), "11000");
    let sequences = trees.iter().map(|tree| tree.unconfirmed).sum();
    let expected = Unconfirmed {
        sequences,
        starts: 2,
    };
    assert!(sequences > 20, "{sequences}");
    assert_eq!(row.unconfirmed, Some(expected));
    near(row.sims_per_start, simulations as f64 / 5.0);
    let told = format!("{sequences} unconfirmed (nothing else on 2 starts)");
    assert!(row.method.ends_with(&told), "{}", row.method);
    // A contact on rigid bodies comes at about the speed it has on paper.
    let speeds = found[..2].iter().flatten().map(|f| f.closing_speed_mps);
    for (speed, (h, tree)) in speeds.zip(headways_m.iter().zip(&trees)) {
        let expected = tree
            .found
            .as_ref()
            .and_then(|a| paper_of(*h, a).closing_mps);
        assert_eq!(speed.is_some(), expected.is_some(), "{h} m");
        if let (Some(speed), Some(expected)) = (speed, expected) {
            assert!((speed - expected).abs() < 0.2, "{speed}, not {expected}");
        }
    }
}

/// Braking softly solves 19.01 m, but on rigid bodies only who also brakes hard keeps
/// the rule: −1 and −2 are unconfirmed, and −3 is the third simulation there.
#[test]
fn a_start_that_is_solved_in_the_end_is_not_one_with_nothing_else() {
    let world = rigid_with(&format!("{EXACT} or eventually[0, T] (ado.accel <= -2.5)"));
    let starts = starts_at(&[19.01]);
    let Searched { row, found } = searched(&world, Switches(0).into(), 1, &starts);
    let found = found[0].as_ref().expect("searched");
    assert_eq!(row.solved.to_string(), "1");
    let actions = found.actions.as_ref().expect("solved");
    assert!(actions.iter().all(|action| *action == 4), "{actions:?}");
    assert_eq!((found.unconfirmed, found.simulations), (2, 5 + 3));
    let expected = Unconfirmed {
        sequences: 2,
        starts: 0,
    };
    assert_eq!(row.unconfirmed, Some(expected));
    assert!(row.method.ends_with(", 2 unconfirmed"), "{}", row.method);
}

/// Constants: +1 breaks a rule at once, −2 does so on rigid bodies, −3 on one of the
/// plants.
#[test]
fn rules_that_are_broken_on_rigid_bodies_are_in_the_share() {
    let starts = starts_at(&[24.01]);
    let Searched { row, found } = searched(&rigid_with(EXACT), Switches(0).into(), 1, &starts);
    let found = found[0].as_ref().expect("searched");
    assert_eq!((found.violations, &found.actions), (3, &None));
    near(row.foul_rate, 3.0 / found.simulations as f64);
}

/// After three hundred sequences that did not carry over a start is given up.
#[test]
fn a_start_is_given_up_after_three_hundred_confirmations() {
    let world = rigid_with(&format!("headway < 20 or {EXACT}"));
    let tree = Tree::search(20.51, 2, false);
    assert_eq!(tree.unconfirmed, 300, "there are more");
    let searched = searched(&world, Switches(2).into(), 1, &starts_at(&[20.51]));
    let found = searched.found[0].as_ref().expect("searched");
    assert_eq!((found.unconfirmed, &found.actions), (300, &None));
    assert_eq!(found.simulations, tree.simulations + 300);
}

/// Every other method plays whole episodes until the first success, and its whole
/// budget where there is none.
#[test]
fn searches_with_a_budget_cost_their_episodes() {
    let world = chase();
    let stored = Stored::new(
        [(20.0, 3), (30.0, 2), (45.0, 4)]
            .iter()
            .enumerate()
            .map(|(i, (h, action))| Success {
                decisions: i as u64,
                index: i as u64,
                start: Start(vec![*h]),
                actions: vec![*action],
                by: 1.0,
            })
            .collect(),
        &world.axes(),
    );
    let nothing = Stored::new(Vec::new(), &world.axes());
    let methods = [
        (Uniform.into(), "uniform, 40 simulations"),
        (Hold.into(), "hold, 40 simulations"),
        (Cem::default().into(), "cem, held 5, 40 simulations"),
        (Mutate(&stored).into(), "mutate, 40 simulations"),
        // A training that found nothing leaves nothing to mutate.
        (Mutate(&nothing).into(), "mutate, 40 simulations"),
    ];
    let starts = starts();
    for (method, text) in methods {
        let Searched { row, found } = searched(&world, method, 40, &starts);
        assert_eq!((row.method.as_str(), row.ado.caption()), (text, "search"));
        let (mut papers, mut spent, mut steps) = (Vec::new(), Vec::new(), 0);
        for (h, found) in HEADWAYS_M.into_iter().zip(&found) {
            let Some(found) = found else {
                assert!(h < 14.0);
                continue;
            };
            let shown = found.actions.as_ref().map(|a| paper_of(h, a));
            assert!(shown.is_none_or(|shown| shown.success), "{text}: {h} m");
            assert_eq!(
                found.simulations == 40,
                shown.is_none() || found.simulations == 40
            );
            assert!((1..=40).contains(&found.simulations));
            let shown = shown.unwrap_or_default();
            assert_eq!(
                found.violation_before_contact, shown.late_foul,
                "{text}: {h} m"
            );
            assert_eq!(
                found.closing_speed_mps.is_some(),
                shown.closing_mps.is_some()
            );
            // One episode costs what it does on paper, a failure a sample or more.
            let least = shown.steps() + SUBSTEPS * (found.simulations - u64::from(shown.success));
            assert!(least <= found.physics_steps, "{text}: {h} m");
            assert!(found.physics_steps <= SUBSTEPS * 16 * found.simulations);
            assert!(found.simulations > 1 || found.physics_steps == shown.steps());
            steps += found.physics_steps;
            spent.push(found.simulations);
            papers.push(shown);
        }
        let successes = papers.iter().filter(|p| p.success).count();
        assert_eq!((row.starts, row.successes), (16, successes));
        assert!(
            !papers[15].success && spent[15] == 40,
            "nothing solves 50 m"
        );
        near(row.sims_per_start, spent.iter().sum::<u64>() as f64 / 16.0);
        assert_eq!(row.physics_steps, steps);
        let budgets: Vec<u64> = row.anytime.iter().map(|at| at.budget).collect();
        assert_eq!(budgets, [10, 30, 40]);
        for at in &row.anytime {
            let by = |(p, spent): &(&Paper, &u64)| p.success && **spent <= at.budget;
            let reached = papers.iter().zip(&spent).filter(by).count();
            assert_eq!(at.successes, reached, "{text} after {}", at.budget);
            assert_eq!(at.ci95, wilson(reached, 16));
            let cost: u64 = spent.iter().map(|spent| (*spent).min(at.budget)).sum();
            near(at.sims_per_start, cost as f64 / 16.0);
        }
    }
    // Nearest first, as they are: 20, 30 and 45 m with −2, −1 and −3. At 27.51 m
    // the second simulation solves, at 24.01 m the first.
    let found = searched(&world, Mutate(&stored).into(), 3, &starts).found;
    let spent = |h: f64| {
        let at = HEADWAYS_M
            .iter()
            .position(|other| *other == h)
            .expect("a start");
        let found = found[at].as_ref().expect("searched");
        (found.simulations, found.actions.as_deref().map(|a| a[0]))
    };
    assert_eq!(spent(24.01), (1, Some(3)));
    assert_eq!(spent(27.51), (2, Some(3)));
    assert_eq!(spent(28.01), (3, None));
    // Held draws are five decisions long.
    let held = searched(&world, Hold.into(), 40, &starts).found;
    for actions in held.iter().flatten().filter_map(|f| f.actions.as_ref()) {
        let first = &actions[..actions.len().min(5)];
        assert!(first.iter().all(|a| *a == first[0]), "{actions:?}");
        assert!(actions.len() <= DECISIONS);
    }
}

/// By hand: solved after 1, 10 and 30; unsolved after 40; invalid; never reached.
#[test]
fn what_was_reached_with_less_is_counted_by_hand() {
    let found = |simulations: u64, solved: bool, faulty: bool| {
        Some(SearchResult {
            actions: solved.then(|| vec![0]),
            simulations,
            fault: faulty.then(|| brakecheck::ego::Fault::error("no answer")),
            ..SearchResult::default()
        })
    };
    let all = [
        found(1, true, false),
        found(10, true, true),
        found(30, true, false),
        found(40, false, false),
        found(2, false, true),
        None,
    ];
    // Before its solution, the second start is invalid too.
    for (budget, starts, successes, simulations) in [
        (1, 3, 1, 1 + 1 + 1),
        (9, 3, 1, 1 + 9 + 9),
        (10, 4, 2, 1 + 10 + 10 + 10),
        (30, 4, 3, 1 + 10 + 30 + 30),
        (40, 4, 3, 1 + 10 + 30 + 40),
    ] {
        let at = anytime(&all, budget);
        assert_eq!((at.budget, at.successes), (budget, successes));
        near(at.success_rate, successes as f64 / starts as f64);
        near(at.sims_per_start, f64::from(simulations) / starts as f64);
        assert_eq!(at.ci95, wilson(successes, starts));
    }
    assert_eq!(anytime(&[None], 5).sims_per_start, 0.0);
}

/// A search that is cut short is one with less, and nothing stays of what came later.
#[test]
fn the_row_within_a_budget_is_that_of_a_search_with_it() {
    let (world, starts) = (chase(), starts());
    let request = SearchRequest {
        scenario: &world,
        ego: "nominal",
        method: Hold.into(),
        budget: 40,
        starts: &starts,
    };
    let mut most = search(&request, &quiet());
    let less = searched(&world, Hold.into(), 5, &starts).row;
    let cut = most.row_within(&request, 5);
    // How many of the first five simulations broke a rule is not recorded.
    assert!(cut.foul_rate.is_nan());
    assert!(cut.physics_steps < most.row.physics_steps && cut.cpu_s < most.row.cpu_s);
    let known = Row {
        foul_rate: less.foul_rate,
        physics_steps: less.physics_steps,
        cpu_s: less.cpu_s,
        ..cut
    };
    assert_eq!(known, less);
    assert_eq!(most.row_within(&request, 40), most.row);
    // A fault ahead of a later solution leaves the start without an outcome.
    let is_late = |found: &&mut SearchResult| found.actions.is_some() && found.simulations > 1;
    let late = most.found.iter_mut().flatten().find(is_late);
    late.expect("some start takes two").fault = Some(Fault::error("no answer"));
    let cut = most.row_within(&request, 1);
    assert_eq!((cut.invalid, cut.starts), (1, less.starts - 1));
    assert_eq!((cut.sims_per_start, cut.faults.len()), (1.0, 1));
}

/// What fails to answer on its fourth call is solved before that, or not at all.
#[test]
fn starts_on_which_the_ego_fails_say_nothing_of_a_search() {
    let world = Quirky::failing_from(&[16.5, 19.9]).drives(&chase());
    let request = SearchRequest {
        scenario: &world,
        ego: "quirky",
        method: Switches(0).into(),
        budget: 1,
        starts: &starts(),
    };
    let mut watch = quiet();
    watch.faults = FaultLog::allowing(0.9);
    let row = search(&request, &watch).row;
    assert_eq!(
        (row.starts, row.successes, row.invalid, row.trivial),
        (14, 12, 2, 2)
    );
    let faults: Vec<(u64, u64)> = row
        .faults
        .iter()
        .map(|f| (f.first_start, f.count))
        .collect();
    assert_eq!(faults, [(4, 2)]);
    // Constants up to the first that solves: −1 is the third, −2 the fourth.
    let sims = |h: &&f64| {
        if **h < 22.0 {
            3.0
        } else if **h < 27.8125 {
            4.0
        } else {
            5.0
        }
    };
    let valid = HEADWAYS_M
        .iter()
        .filter(|h| **h >= 14.0 && **h != 17.01 && **h != 20.51);
    near(
        row.sims_per_start,
        valid.map(|h| sims(&h)).sum::<f64>() / 14.0,
    );
}

/// An ego that fails in two runs of five: a gate of two is met, one of three not.
#[test]
fn a_search_asks_for_as_many_failures_as_the_gate() {
    for (gate, solved) in [(2, "1"), (3, "0")] {
        let quirky = Quirky {
            brakes: Some((5, 2)),
            ..Quirky::failing_from(&[])
        };
        let mut world = quirky.drives(&chase());
        world = world.repeated(brakecheck::world::Repeats { runs: 5, gate });
        let stored = Stored::new(
            vec![Success {
                decisions: 0,
                index: 0,
                start: Start(vec![20.0]),
                actions: vec![3],
                by: 1.0,
            }],
            &world.axes(),
        );
        let row = searched(&world, Mutate(&stored).into(), 1, &starts_at(&[24.01])).row;
        assert_eq!(row.solved.to_string(), solved);
        assert_eq!(row.sims_per_start, 5.0);
    }
}

/// Whoever can only brake hard solves h < 21.875 m, and has lost its rule when they
/// touch from 17.8733 m on.
#[test]
fn a_search_tells_of_rules_that_were_broken_before_the_contact() {
    let world = altered(&[("[1.0, 0.0, -1.0, -2.0, -3.0]", "[1.0, 0.0, -3.0]")]);
    for method in [Switches(0).into(), Hold.into()] {
        let Searched { row, found } = searched(&world, method, 1000, &starts());
        let late: Vec<bool> = found
            .iter()
            .flatten()
            .map(|f| f.violation_before_contact)
            .collect();
        let share = late.iter().filter(|late| **late).count() as f64 / 16.0;
        near(row.foul_before_contact_rate.expect("followed"), share);
        if matches!(method, Method::Switches(_)) {
            let expected = |h: &f64| (17.8733..21.875).contains(h);
            let counted = HEADWAYS_M.iter().filter(|h| **h >= 14.0);
            assert_eq!(late, counted.map(expected).collect::<Vec<bool>>());
            assert_eq!((row.successes, share), (9, 5.0 / 16.0));
            assert_eq!(row.contact_rate, 9.0 / 16.0);
        }
    }
}

/// One action for the whole run, one elite, and no memory of what was before: from the
/// second generation on the best of the first is played. Far away that is to brake
/// softly, or to coast, for all 16 samples; to brake hard is a foul after eleven, to
/// speed up one after the first.
#[test]
fn cross_entropy_draws_from_the_best() {
    let world = altered(&[("[1.0, 0.0, -1.0, -2.0, -3.0]", "[1.0, 0.0, -1.0, -3.0]")]);
    let cem = Cem {
        population: 12,
        elites: 1,
        smoothing: 1.0,
        hold: 8,
        exploration: 0.0,
    };
    let starts = starts_at(&[50.01]);
    let steps = |budget: u64| {
        let row = searched(&world, cem.into(), budget, &starts).row;
        assert_eq!(row.sims_per_start, budget as f64);
        row.physics_steps
    };
    assert_eq!(steps(32) - steps(12), 20 * 16 * SUBSTEPS);
}

/// An ego that cannot be copied.
struct Single(Quirky);

impl Controller for Single {
    fn reset(&mut self, seed: u64) {
        self.0.reset(seed);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        self.0.control(percept)
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

/// A world that requires several failures has them played, and they cost.
#[test]
fn the_repetitions_of_a_confirmed_sequence_are_counted() {
    let single: ControllerFactory = Arc::new(|| Box::new(Single(Quirky::failing_from(&[]))));
    let once = chase().with_ego("single", single);
    let thrice = once.repeated(brakecheck::world::Repeats { runs: 3, gate: 3 });
    let of = |world| searched(world, Switches(0).into(), 1, &starts()).found;
    for (one, three) in of(&once).iter().zip(&of(&thrice)) {
        let (Some(one), Some(three)) = (one, three) else {
            continue;
        };
        assert_eq!(one.actions, three.actions);
        let more = if one.actions.is_some() { 2 } else { 0 };
        assert_eq!(one.simulations + more, three.simulations);
        assert_eq!(one.violations, three.violations);
    }
}

/// What cannot be copied is played from the start for every sequence: they are
/// the same sequences, and cost more.
#[test]
fn an_ego_that_cannot_be_copied_is_searched_with_the_same_sequences() {
    let world = chase();
    let single: ControllerFactory = Arc::new(|| Box::new(Single(Quirky::failing_from(&[]))));
    let single = world.with_ego("single", single);
    // Without a solution every sequence is tried.
    let hopeless = starts_at(&[50.01]);
    for most in 0..=1 {
        let of = |world| searched(world, Switches(most).into(), 1, &starts()).row;
        let (copied, played) = (of(&world), of(&single));
        assert_eq!(played.solved, copied.solved, "{most}");
        let of = |world| searched(world, Switches(most).into(), 1, &hopeless).row;
        let (copied, played) = (of(&world), of(&single));
        // Where to switch is known once the five of one action are played again.
        let again = (5 * most) as f64;
        assert_eq!(
            played.sims_per_start,
            copied.sims_per_start + again,
            "{most}"
        );
        assert!(copied.physics_steps <= played.physics_steps, "{most}");
    }
}
