//! What becomes of the rules between a success and the contact.

use std::sync::atomic::AtomicBool;

use brakecheck::adversary::Ado;
use brakecheck::crashes::Regressions;
use brakecheck::experiment::{TestStarts, Watch};
use brakecheck::rulebook::RulesUntilContact;
use brakecheck::run_dir::Stored;
use brakecheck::run_dir::{Counterexample, Row};
use brakecheck::scene::Start;
use brakecheck::search::{Mutate, SearchRequest, Switches, search};
use brakecheck::testbench::{Aftermath, Constant, Episode, Replay, Success, Testbench, play};
use brakecheck::world::{Change, Scenario};
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};

const ACC: &str = include_str!("../../worlds/acc.ron");

/// A lead car that brakes hard eight metres ahead of an equally fast ego.
const FAST: [f64; 3] = [25.0, 8.0, 25.0];
const BRAKES: usize = 0;

/// The ACC world, its ado fast at first, deciding at each sample, and with
/// another least speed.
fn slowest(v_min_mps: f64, judge: &str) -> Scenario {
    let ahead = "headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)";
    assert!(ACC.contains(ahead));
    let text = ACC
        .replace("plant: Rigid", "plant: Kinematic")
        .replace("decision_s: 0.5", "decision_s: 0.05")
        .replace("judge: UntilViolation", &format!("judge: {judge}"))
        .replace(ahead, "headway_m: (8.0, 60.0), speed_mps: (24.9, 25.0)")
        .replace("\"v_min\": 0.1", &format!("\"v_min\": {v_min_mps:?}"));
    Scenario::parse("acc.ron", &text).expect("a world")
}

fn crash(world: &Scenario) -> Episode {
    let start = Start(FAST.into());
    let mut brakes = Constant(BRAKES);
    play(&mut world.bench(), &start, 0, &mut brakes, Aftermath::Play)
}

fn speeds(episode: &Episode) -> &[f64] {
    episode.trace.signal("ado.speed").expect("published")
}

/// The least speed that the braking ado undercuts at `sample`, not before.
fn undercut_at(episode: &Episode, sample: usize) -> f64 {
    0.5 * (speeds(episode)[sample - 1] + speeds(episode)[sample])
}

fn broken(time_s: f64) -> Option<RulesUntilContact> {
    Some(RulesUntilContact::Broken {
        rule: "never stops or reverses".to_owned(),
        ado: "ado".to_owned(),
        time_s,
    })
}

#[test]
fn a_rule_broken_before_the_contact_is_named_and_changes_nothing_else() {
    let lawful = crash(&slowest(0.1, "UntilViolation"));
    let touch = lawful.contact.clone().expect("a contact");
    let last = lawful.trace.len() - 1;
    let next = lawful.judged;
    assert!(lawful.verdict.is_success() && next + 1 < last);
    assert_eq!(lawful.rules_until_contact, Some(RulesUntilContact::Kept));
    let below_all = speeds(&lawful)[last] - 1e-6;
    let dt_s = lawful.trace.dt_s();
    let time_s = |sample: usize| (sample as f64 * dt_s * 1e9).round() / 1e9;
    let cases = [
        (
            "kept up to the contact",
            below_all,
            Some(RulesUntilContact::Kept),
        ),
        (
            "broken by the contact's sample",
            undercut_at(&lawful, last),
            broken(touch.time_s),
        ),
        (
            "broken in between",
            undercut_at(&lawful, last - 1),
            broken(time_s(last - 1)),
        ),
        (
            "broken at once",
            undercut_at(&lawful, next),
            broken(time_s(next)),
        ),
    ];
    for (what, v_min_mps, expect) in cases {
        let episode = crash(&slowest(v_min_mps, "UntilViolation"));
        assert_eq!(episode.rules_until_contact, expect, "{what}");
        let rules_until_contact = lawful.rules_until_contact.clone();
        let as_before = Episode {
            rules_until_contact,
            ..episode
        };
        assert_eq!(as_before, lawful, "{what}");
    }
    // On the violated sample itself it is a foul, and nothing is played on.
    let foul = crash(&slowest(undercut_at(&lawful, next - 1), "UntilViolation"));
    assert_eq!(foul.verdict.word(), "foul");
    assert_eq!((foul.rules_until_contact, foul.contact), (None, None));
}

#[test]
fn without_a_success_or_a_contact_there_is_nothing_to_say() {
    let world = slowest(0.1, "UntilViolation");
    let start = Start(FAST.into());
    let mut bench = world.bench();
    let skipped = play(
        &mut bench,
        &start,
        0,
        &mut Constant(BRAKES),
        Aftermath::Skip,
    );
    assert!(skipped.verdict.is_success());
    assert_eq!((skipped.rules_until_contact, skipped.contact), (None, None));
    let away = play(&mut bench, &start, 0, &mut Constant(2), Aftermath::Play);
    assert!(!away.verdict.is_success());
    assert_eq!(away.rules_until_contact, None);
}

#[test]
fn the_papers_judge_has_judged_the_whole_run() {
    let lawful = crash(&slowest(0.1, "WholeRun"));
    assert!(lawful.verdict.is_success() && lawful.contact.is_some());
    assert_eq!(lawful.rules_until_contact, Some(RulesUntilContact::Kept));
    // What is a late foul to the default judge is a foul to this one.
    let sample = crash(&slowest(0.1, "UntilViolation")).judged;
    let foul = crash(&slowest(undercut_at(&lawful, sample), "WholeRun"));
    assert_eq!(foul.verdict.word(), "foul");
    assert_eq!(foul.rules_until_contact, None);
}

/// A world in which the ado succeeds, then breaks a rule, then is hit.
fn loose() -> Scenario {
    let lawful = crash(&slowest(0.1, "UntilViolation"));
    slowest(undercut_at(&lawful, lawful.judged), "UntilViolation")
}

fn finish(bench: &mut Testbench) {
    while !bench.is_done() {
        bench.decide(BRAKES);
    }
}

#[test]
fn copies_of_a_bench_follow_the_rules_as_well() {
    let world = loose();
    let expect = crash(&world).rules_until_contact;
    assert!(expect.is_some());
    let start = Start(FAST.into());
    let mut bench = world.bench();
    bench.begin(&start, 0, Aftermath::Play);
    let mut forks = 0;
    while !bench.is_done() {
        let mut fork = bench.fork().expect("a stock ego");
        finish(&mut fork);
        assert_eq!(fork.rules_until_contact(), expect);
        let mut branch = bench.branch().expect("a stock ego");
        finish(&mut branch);
        assert_eq!(branch.rules_until_contact(), expect);
        bench.rejoin(branch);
        bench.decide(BRAKES);
        forks += usize::from(bench.is_decided() && !bench.is_done());
    }
    assert!(forks > 0, "none in the aftermath");
    assert_eq!(bench.rules_until_contact(), expect);
    // What was broken is forgotten: braking only up to the verdict breaks nothing.
    let brakes = vec![BRAKES; crash(&world).judged - 1];
    let mut coasts = Replay::then(&brakes, 1);
    let again = play(&mut bench, &start, 0, &mut coasts, Aftermath::Play);
    assert_eq!(again.rules_until_contact, Some(RulesUntilContact::Kept));
}

#[test]
fn rows_of_evaluations_and_searches_count_fouls_before_contact() {
    static GO: AtomicBool = AtomicBool::new(false);
    let watch = Watch::new(&|_, _| {}, &GO);
    // From the second start the ego is never too near.
    let starts = TestStarts {
        seed: 0,
        starts: vec![(Start(FAST.into()), 0), (Start(vec![5.0, 60.0, 25.0]), 0)],
        trivial: vec![false, false],
    };
    let brakes = Success {
        decisions: 0,
        index: 0,
        start: Start(FAST.into()),
        actions: vec![BRAKES],
        by: 1.0,
    };
    let stored = Stored::new(vec![brakes], &loose().axes());
    for (world, expect) in [(loose(), 0.5), (slowest(0.1, "UntilViolation"), 0.0)] {
        let request = EvalRequest {
            scenario: &world,
            ego: "nominal",
            ado: Ado::Constant(BRAKES),
            starts: &starts,
        };
        let evaluated = eval(&request, &watch);
        let methods = [Switches(0).into(), Mutate(&stored).into()];
        let searched = methods.map(|method| {
            let request = SearchRequest {
                scenario: &world,
                ego: "nominal",
                method,
                budget: 2,
                starts: &starts,
            };
            search(&request, &watch)
        });
        let rows = searched.map(|searched| searched.row);
        for row in rows.into_iter().chain([evaluated.row]) {
            let method = &row.method;
            assert_eq!((row.starts, row.contact_rate), (2, 0.5), "{method}");
            assert_eq!(row.foul_before_contact_rate, Some(expect), "{method}");
        }
    }
}

#[test]
fn a_row_from_before_says_nothing_of_fouls_before_contact() {
    let row = r#"{
        "world": "w", "plant": "Rigid", "judge": "UntilViolation", "ego": "e", "ado": "a",
        "method": "m", "start_seed": 0, "starts": 10, "trivial": 0, "successes": 0,
        "success_rate": 0.0, "ci95": [0.0, 1.0], "foul_rate": 0.0, "contact_rate": 0.0,
        "invalid": 0, "sims_per_start": 1.0, "physics_steps": 0, "cpu_s": 0.0, "solved": ""
    }"#;
    let row: Row = serde_json::from_str(row).expect("a row");
    assert_eq!(row.foul_before_contact_rate, None);
}

#[test]
fn kept_files_say_whether_the_rules_held_and_replays_check_it() {
    let world = loose();
    let episode = crash(&world);
    let kept = Counterexample::record(&world, "nominal", &Change::default(), "constant", &episode);
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("crash.ron");
    kept.save(&file, &episode.trace).expect("written");
    let text = std::fs::read_to_string(&file).expect("a file");
    assert!(text.contains("rule: \"never stops or reverses\""), "{text}");

    let saying = |rules_until_contact| Counterexample {
        rules_until_contact,
        ..kept.clone()
    };
    let contrary = saying(Some(RulesUntilContact::Kept));
    let cases = [
        ("as recorded", kept.clone(), true),
        ("an older file", saying(None), true),
        ("a file that says something else", contrary, false),
    ];
    for (what, kept, identical) in cases {
        kept.save(&file, &episode.trace).expect("written");
        let regressions = Regressions::load(&file).expect("kept");
        let replayed = regressions.replay().expect("replayed");
        assert_eq!(replayed[0].identical, identical, "{what}");
        assert_eq!(replayed[0].first_difference, None, "{what}");
        let rules = &replayed[0].episode.rules_until_contact;
        assert_eq!(*rules, episode.rules_until_contact, "{what}");
    }
}
