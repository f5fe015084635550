//! Estimates against exact probabilities, in a world small enough to enumerate.

use std::path::Path;

use super::mixture::Mixture;
use super::record::KnownFailure;
use super::run::{EpisodeSource, Order, RiskWorld};
use super::{
    RiskReport, RiskRequest, RiskSettings, RiskTraffic, RiskTrafficError, ValueKind,
    unchecked_estimate,
};
use crate::experiment::{EgoUnderTest, Watch};
use crate::sim::PlantKind;
use crate::world::{LoadError, Scenario};

const TRAFFIC: &str = r#"Traffic(
    source: "test",
    starts: { "ado.headway": Normal(mean: 35.0, sd: 2.5, within: (24.0, 46.0)) },
    ados: { "ado": Markov(
        stay: [0.7, 0.95, 0.5],
        leave: [0.0, 1.0, 1.0],
        onsets: { "brake": (rate_per_s: "0.02 * (1 + ado.speed / 25)", to: { "-3": 1.0 }) },
    ) },
)"#;

/// The same world, which declares the traffic itself.
fn declaring(traffic: &str) -> Result<Scenario, crate::world::ScenarioError> {
    let text = world().text().to_owned();
    // The last parenthesis closes the scenario.
    let end = text.trim_end().len() - 1;
    let text = format!("{}    traffic: {traffic},\n)\n", &text[..end]);
    Ok(Scenario::parse("acc.ron", &text)?.on(PlantKind::Kinematic))
}

/// Following of a braking car for 2.5 s: 243 sequences of actions, and one axis of starts.
pub(super) fn world() -> Scenario {
    let text = include_str!("../../../../worlds/acc.ron")
        .replace("horizon_s: 15.0", "horizon_s: 2.5")
        .replace(
            "At(x_m: 0.0, speed_mps: (5.0, 25.0))",
            "At(x_m: 0.0, speed_mps: 25.0)",
        )
        .replace(
            "headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)",
            "headway_m: (24.0, 46.0), speed_mps: 12.0",
        );
    let world = Scenario::parse("acc.ron", &text).expect("sound");
    world.on(PlantKind::Kinematic)
}

pub(super) fn traffic(world: &Scenario, dir: &Path) -> RiskTraffic {
    let file = dir.join("traffic.ron");
    std::fs::write(&file, TRAFFIC).expect("written");
    RiskTraffic::read(world, &file.display().to_string()).expect("sound")
}

pub(super) fn directory(name: &str) -> std::path::PathBuf {
    let dir = std::env::temp_dir().join(format!("brakecheck-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&dir).expect("a directory");
    dir
}

fn settings(seed: u64) -> RiskSettings {
    RiskSettings {
        budget: 20_000,
        natural: 400,
        width: 0.1,
        seed,
        ..RiskSettings::default()
    }
}

fn estimated(traffic: &RiskTraffic, egos: &[EgoUnderTest], settings: RiskSettings) -> RiskReport {
    let mut request = RiskRequest::new(traffic, egos);
    request.settings = settings;
    let report = request.estimate(&Watch::unwatched()).expect("no disk");
    report.expect("not stopped")
}

/// Sums the probability of failure over all sequences, and over starts of equal probability.
fn exact(world: &Scenario, traffic: &RiskTraffic) -> f64 {
    let (starts, actions) = (traffic.starts.clone(), traffic.actions.clone());
    let risk = RiskWorld::new(world, starts, actions);
    let (mixture, mut bench) = (Mixture::natural(1), risk.scenario.bench());
    let (grid, decisions) = (200, 5);
    let mut sum = 0.0;
    for cell in 0..grid {
        let share = (f64::from(cell) + 0.5) / f64::from(grid);
        let start = traffic.starts.start(&[share]).expect("inside");
        let found = traffic.starts.shares(&start).expect("possible");
        assert!(
            (found[0] - share).abs() < 1e-9,
            "{found:?} instead of {share}"
        );
        for number in 0..3_usize.pow(decisions) {
            let known = KnownFailure {
                start: start.clone(),
                noise: 0,
                actions: (0..decisions)
                    .map(|k| number / 3_usize.pow(k) % 3)
                    .collect(),
            };
            let order = Order {
                seed: 0,
                stage: 0,
                index: 0,
                source: EpisodeSource::Recorded(&known),
                judge_held: false,
                prevent: false,
            };
            let run = risk.play(&mut bench, &mixture, &order);
            if run.failure().is_none() {
                continue;
            }
            // A run that ends early has several sequences of equal beginnings.
            let taken = run.actions.len();
            let same = 3_usize.pow(decisions - taken as u32);
            let law = (0..taken).map(|k| f64::from(run.law(k)[run.actions[k] as usize]));
            sum += law.product::<f64>() / (same as f64 * f64::from(grid));
        }
    }
    sum
}

#[test]
fn estimates_agree_with_the_enumeration_of_all_sequences() {
    let (world, dir) = (world(), directory("risk-exact"));
    let traffic = traffic(&world, &dir);
    let exact = exact(&world, &traffic);
    assert!((1e-5..5e-3).contains(&exact), "{exact}");
    let egos = [EgoUnderTest::nominal(&world)];
    let (mut sum, mut covered, mut refused, seeds) = (0.0, 0, 0, 6_u32);
    for seed in 0..seeds {
        let report = estimated(&traffic, &egos, settings(u64::from(seed)));
        let ego = &report.egos[0];
        assert!(report.cost.of_ego() <= 20_000);
        let Some(risk) = ego.fails else {
            assert!(!ego.refusals().is_empty());
            refused += 1;
            continue;
        };
        sum += risk.probability;
        let [lo, hi] = risk.interval;
        covered += usize::from((lo..=hi).contains(&exact));
    }
    // A check may refuse a sound estimate, above all after as few runs as here.
    assert!(refused <= 3, "{refused} of {seeds} refused");
    let mean = sum / f64::from(seeds - refused);
    assert!(
        (mean / exact - 1.0).abs() < 0.06,
        "{mean} instead of {exact}"
    );
    let given = seeds - refused;
    assert!(
        covered + 1 >= given as usize,
        "{covered} of {given} intervals cover {exact}"
    );
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn threads_and_kills_change_no_byte() {
    let (world, dir) = (world(), directory("risk-resumed"));
    let traffic = traffic(&world, &dir);
    let weak = world.with(&world.reuse()["weak brakes"]).expect("fits");
    let egos = [EgoUnderTest::nominal(&weak), EgoUnderTest::nominal(&world)];
    let in_threads = |threads: usize, at: Option<&Path>| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("a pool").install(|| {
            let mut request = RiskRequest::new(&traffic, &egos);
            request.settings = settings(3);
            request.dir = at.map(Path::to_path_buf);
            let report = request.estimate(&Watch::unwatched()).expect("a disk");
            serde_json::to_string(&report.expect("not stopped")).expect("JSON")
        })
    };
    let alone = in_threads(1, None);
    let runs = dir.join("runs");
    assert_eq!(in_threads(3, Some(&runs)), alone);
    let mut files: Vec<_> = std::fs::read_dir(&runs)
        .expect("there")
        .flatten()
        .map(|it| it.path())
        .collect();
    files.sort();
    let before: Vec<Vec<u8>> = files
        .iter()
        .map(|it| std::fs::read(it).expect("there"))
        .collect();
    // A killed process leaves some pieces.
    let pieces = files
        .iter()
        .filter(|it| it.extension().is_some_and(|it| it == "runs"));
    for file in pieces.skip(3).step_by(2) {
        std::fs::remove_file(file).expect("removed");
    }
    assert_eq!(in_threads(2, Some(&runs)), alone);
    let after: Vec<Vec<u8>> = files
        .iter()
        .map(|it| std::fs::read(it).expect("there"))
        .collect();
    assert!(before == after);
    // Runs of another request are refused.
    let mut other = RiskRequest::new(&traffic, &egos[1..]);
    other.dir = Some(runs);
    assert!(other.estimate(&Watch::unwatched()).is_err());
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn narrow_estimates_play_three_rounds_too() {
    let (world, dir) = (world(), directory("risk-rounds"));
    let traffic = traffic(&world, &dir);
    let egos = [EgoUnderTest::nominal(&world)];
    // After the natural runs and those that only learn, four equal parts are left.
    for (budget, in_rounds) in [(60_000, 20_000), (20_400, 14_000)] {
        let settings = RiskSettings {
            budget,
            // The first estimate is narrow enough.
            width: 100.0,
            value: ValueKind::Table,
            ..settings(5)
        };
        let report = estimated(&traffic, &egos, settings);
        assert_eq!(report.cost.rounds, in_rounds);
    }
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn a_greater_budget_continues_from_the_stored_runs() {
    let (world, dir) = (world(), directory("risk-budget"));
    let traffic = traffic(&world, &dir);
    let egos = [EgoUnderTest::nominal(&world)];
    let with_budget = |budget: usize, at: Option<&Path>| {
        let mut request = RiskRequest::new(&traffic, &egos);
        request.settings = RiskSettings {
            budget,
            // Never narrow enough, so that the budget ends it.
            width: 1e-9,
            value: ValueKind::Table,
            ..settings(4)
        };
        request.dir = at.map(Path::to_path_buf);
        let report = request.estimate(&Watch::unwatched()).expect("a disk");
        serde_json::to_string(&report.expect("not stopped")).expect("JSON")
    };
    let runs = dir.join("runs");
    let written = || {
        let files = std::fs::read_dir(&runs).expect("there").flatten();
        let times = files.map(|it| {
            let time = it.metadata().expect("there").modified();
            (it.path(), time.expect("known"))
        });
        times.collect::<std::collections::BTreeMap<_, _>>()
    };
    let small = with_budget(51_000, Some(&runs));
    let before = written();
    let large = with_budget(52_000, Some(&runs));
    assert_ne!(small, large);
    assert_eq!(large, with_budget(52_000, None));
    // Nothing is played twice but the round that the smaller budget cut short.
    let after = written();
    assert!(before.iter().all(|(file, time)| after[file] == *time));
    assert!(before.len() > 80 && after.len() < before.len() + 40);
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn impossible_counterexamples_count_once_for_each_ego() {
    let (world, dir) = (world(), directory("risk-impossible"));
    let traffic = traffic(&world, &dir);
    let weak = world.with(&world.reuse()["weak brakes"]).expect("fits");
    let egos = [EgoUnderTest::nominal(&weak), EgoUnderTest::nominal(&world)];
    // Its headway is outside the law of the starts.
    let known = [KnownFailure {
        start: crate::scene::Start(vec![1e6]),
        noise: 0,
        actions: vec![0],
    }];
    let mut request = RiskRequest::new(&traffic, &egos);
    request.settings = RiskSettings {
        budget: 1000,
        ..settings(0)
    };
    request.known = &known;
    let report = request.estimate(&Watch::unwatched()).expect("no disk");
    let report = report.expect("not stopped");
    assert_eq!([0, 1].map(|ego: usize| report.egos[ego].impossible), [1, 1]);
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn an_ego_that_cannot_fail_has_a_bound_and_no_result() {
    let (world, dir) = (world(), directory("risk-none"));
    let far = TRAFFIC.replace(
        "mean: 35.0, sd: 2.5, within: (24.0, 46.0)",
        "mean: 45.0, sd: 1.0, within: (44.0, 46.0)",
    );
    let file = dir.join("far.ron");
    std::fs::write(&file, far.replace("0.02 *", "0.0 *")).expect("written");
    let traffic = RiskTraffic::read(&world, &file.display().to_string()).expect("sound");
    let report = estimated(&traffic, &[EgoUnderTest::nominal(&world)], settings(0));
    assert!(!report.is_result() && report.egos[0].fails.is_none());
    let checks = report.egos[0].checks.as_ref().expect("not counted");
    assert!(checks.bound < 0.05, "{}", checks.bound);
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn mistakes_in_traffic_have_a_place_and_a_fix() {
    let (world, dir) = (world(), directory("risk-mistakes"));
    let refused = |from: &str, to: &str| {
        let file = dir.join("wrong.ron");
        assert!(TRAFFIC.contains(from), "{from}");
        std::fs::write(&file, TRAFFIC.replace(from, to)).expect("written");
        let error = RiskTraffic::read(&world, &file.display().to_string());
        error.expect_err(to).to_string()
    };
    for (from, to, says) in [
        (
            "\"ado\": Markov",
            "\"lead\": Markov",
            "the ado `ado` has no law of actions",
        ),
        ("\"ado.headway\"", "\"headway\"", "unknown axis `headway`"),
        ("sd: 2.5", "sd: 0.0", "the spread is not above 0"),
        (
            "[0.7, 0.95, 0.5]",
            "[0.7, 0.95]",
            "`stay` has 3 probabilities",
        ),
        ("{ \"-3\": 1.0 }", "{ \"-4\": 1.0 }", "unknown action `-4`"),
        ("ado.speed / 25", "ado.sped / 25", "ado.sped"),
        ("Markov(", "Fitted(", "stay"),
    ] {
        let found = refused(from, to);
        assert!(found.contains(says), "{found}");
    }
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn a_world_can_declare_its_traffic() {
    let declared = declaring(TRAFFIC).expect("sound");
    let own = RiskTraffic::of_world(&declared).expect("fits");
    let own = own.expect("declared");
    let named = RiskTraffic::parse(&declared, "traffic.ron", TRAFFIC).expect("fits");
    let counted = |traffic: &RiskTraffic| {
        let mut few = settings(1);
        few.natural = 20_000;
        let egos = [EgoUnderTest::nominal(&declared)];
        let report = estimated(traffic, &egos, few);
        serde_json::to_string(&report).expect("JSON")
    };
    assert_eq!(counted(&own), counted(&named));
    let none = RiskTraffic::of_world(&world()).expect("nothing to fit");
    assert!(none.is_none());
    // The mistake is in the world's own text.
    let wrong = declaring(&TRAFFIC.replace("0.7, 0.95, 0.5", "0.7, 0.95")).expect("sound");
    let error = RiskTraffic::of_world(&wrong).expect_err("two probabilities");
    let RiskTrafficError::File(LoadError::Scenario(placed)) = &error else {
        panic!("{error}");
    };
    let span = placed.problems[0].span.clone();
    assert!(
        placed.text[span.clone()].contains("stay: [0.7, 0.95]"),
        "{span:?}"
    );
}

#[test]
fn a_table_estimates_the_same_risk() {
    let (world, dir) = (world(), directory("risk-table"));
    let traffic = traffic(&world, &dir);
    let exact = exact(&world, &traffic);
    let mut by_table = settings(0);
    by_table.value = ValueKind::Table;
    let report = estimated(&traffic, &[EgoUnderTest::nominal(&world)], by_table);
    let found = unchecked_estimate(&report.egos[0]).expect("failures");
    assert!(
        (found.probability / exact - 1.0).abs() < 0.15,
        "{found:?} instead of {exact}"
    );
    // Counting the same number of runs would find about twelve failures.
    assert!(100.0 < found.ess, "{found:?}");
    std::fs::remove_dir_all(&dir).expect("removed");
}

#[test]
fn natural_runs_side_by_side_have_the_bits_of_single_ones() {
    let (world, dir) = (world(), directory("risk-lanes"));
    let traffic = traffic(&world, &dir);
    let risk = RiskWorld::new(&world, traffic.starts.clone(), traffic.actions.clone());
    let (mixture, mut bench) = (Mixture::natural(1), risk.scenario.bench());
    let mut lanes = risk.lanes().expect("a kinematic world of vehicles");
    let (mut failed, mut held) = (0, 0);
    // Twice, so that lanes are used again.
    for group in 0..150_u64 {
        let order = |index| Order {
            seed: 5,
            stage: 0,
            index: 64 * group + index,
            source: EpisodeSource::Component(0),
            judge_held: false,
            prevent: false,
        };
        let orders: Vec<Order<'_>> = (0..64).map(order).collect();
        let found = risk.play_lanes(&mut lanes, &mixture, &orders);
        for (found, order) in found.into_iter().zip(&orders) {
            let mut single = risk.play(&mut bench, &mixture, order);
            let Some(found) = found else {
                assert!(single.failure().is_some());
                failed += 1;
                continue;
            };
            (single.actions, single.inputs, single.laws) = Default::default();
            assert_eq!(found, single);
            held += 1;
        }
    }
    assert!(0 < failed && 9_000 < held, "{failed} failed, {held} held");
    std::fs::remove_dir_all(&dir).expect("removed");
}
