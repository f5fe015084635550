//! Estimates against exact probabilities, in a world small enough to enumerate.

use std::path::Path;

use super::mixture::Mixture;
use super::record::KnownFailure;
use super::run::{EpisodeSource, Order, RiskWorld};
use super::{RiskReport, RiskRequest, RiskSettings, RiskTraffic, RiskTrafficError};
use crate::ego::{Command, Controller, Fault, Percept};
use crate::experiment::{EgoUnderTest, Watch};
use crate::rulebook::Counts;
use crate::sim::PlantKind;
use crate::testbench::FaultLog;
use crate::world::{LoadError, Scenario};

pub(super) const TRAFFIC: &str = r#"Traffic(
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

pub(super) fn settings(seed: u64) -> RiskSettings {
    RiskSettings {
        budget: 20_000,
        natural: 400,
        width: 0.1,
        seed,
        ..RiskSettings::default()
    }
}

pub(super) fn estimated(
    traffic: &RiskTraffic,
    egos: &[EgoUnderTest],
    settings: RiskSettings,
) -> RiskReport {
    let mut request = RiskRequest::new(traffic, egos);
    request.settings = settings;
    let report = request.estimate(&Watch::unwatched()).expect("no disk");
    report.expect("not stopped")
}

/// Exact probabilities of a world that is small enough to enumerate.
#[derive(Clone, Debug, Default)]
pub(super) struct ExactRisk {
    pub(super) fails: f64,
    pub(super) lawful: f64,
    /// By kind of failure.
    pub(super) kinds: std::collections::BTreeMap<String, f64>,
}

/// Sums probabilities over all sequences of three actions, and over starts of equal probability.
pub(super) fn exact(
    world: &Scenario,
    traffic: &RiskTraffic,
    starts: u32,
    decisions: u32,
) -> ExactRisk {
    let (own, actions) = (traffic.starts.clone(), traffic.actions.clone());
    let risk = RiskWorld::new(world, own, actions);
    let mixture = Mixture::natural(traffic.starts.dimensions());
    let mut bench = risk.scenario.bench();
    let mut sum = ExactRisk::default();
    for cell in 0..starts {
        let share = (f64::from(cell) + 0.5) / f64::from(starts);
        let shares = vec![share; traffic.starts.dimensions()];
        let start = traffic.starts.start(&shares).expect("inside");
        let found = traffic.starts.shares(&start).expect("possible");
        let far = found.iter().map(|it| (it - share).abs());
        assert!(
            far.fold(0.0, f64::max) < 1e-9,
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
            let Some(failure) = run.failure() else {
                continue;
            };
            // A run that ends early has several sequences of equal beginnings.
            let taken = run.actions.len();
            let same = 3_usize.pow(decisions - taken as u32);
            let law = (0..taken).map(|k| f64::from(run.law(k)[run.actions[k] as usize]));
            let own = law.product::<f64>() / (same as f64 * f64::from(starts));
            sum.fails += own;
            sum.lawful += if failure.lawful { own } else { 0.0 };
            *sum.kinds.entry(failure.mode.clone()).or_default() += own;
        }
    }
    sum
}

/// Estimates of some seeds: their mean, their number, and that of intervals that contain
/// the exact probability.
fn pooled_over(
    traffic: &RiskTraffic,
    egos: &[EgoUnderTest],
    exact: f64,
    all: impl Iterator<Item = RiskSettings>,
) -> (f64, usize, usize) {
    let (mut sum, mut covered, mut given) = (0.0, 0, 0);
    for settings in all {
        let report = estimated(traffic, egos, settings);
        let ego = &report.egos[0];
        assert!(report.cost.of_ego() <= settings.budget);
        let Some(risk) = ego.readings.fails else {
            assert!(!ego.refusals().is_empty());
            continue;
        };
        sum += risk.probability;
        given += 1;
        let [lo, hi] = risk.interval;
        covered += usize::from((lo..=hi).contains(&exact));
    }
    (sum / f64::from(given as u32), given, covered)
}

#[test]
fn estimates_agree_with_the_enumeration_of_all_sequences() {
    let (world, dir) = (world(), directory("risk-exact"));
    let traffic = traffic(&world, &dir);
    let exact = exact(&world, &traffic, 200, 5).fails;
    assert!((1e-5..5e-3).contains(&exact), "{exact}");
    let egos = [EgoUnderTest::nominal(&world)];
    // Fits of networks take most of the time of an estimate.
    let seeds = 4;
    let settings = (0..seeds).map(|seed| RiskSettings {
        budget: 12_000,
        ..settings(seed)
    });
    let (mean, given, covered) = pooled_over(&traffic, &egos, exact, settings);
    // A check may refuse a sound estimate, above all after as few runs as here.
    assert!(2 * given >= seeds as usize, "{given} of {seeds}");
    let off = (mean / exact - 1.0).abs();
    assert!(off < 0.06, "{mean} instead of {exact}");
    assert!(
        covered + 1 >= given,
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
            // Every round has several pieces, and the fits of its network are short.
            request.settings = RiskSettings {
                budget: 5_000,
                ..settings(3)
            };
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
    for (budget, in_rounds) in [(60_000, 20_000), (20_400, 12_000)] {
        let settings = RiskSettings {
            budget,
            // The first estimate is narrow enough.
            width: 100.0,
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
    let report = request
        .estimate(&Watch::unwatched())
        .expect("no disk")
        .expect("not stopped");
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
    assert!(!report.is_result() && report.egos[0].readings.fails.is_none());
    let [least, most] = report.egos[0].limits.expect("not counted").fails;
    assert!(least == 0.0 && most < 0.05, "{most}");
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
            "`stay` requires 3 probabilities",
        ),
        (
            "0.5],\n        leave: [",
            "0.5, 0.5, 0.5, 0.5],\n        leave: [1.0, 1.0, 1.0, ",
            "the ado `ado` has 3 actions, and this law 6",
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
    let own = RiskTraffic::of_world(&declared)
        .expect("fits")
        .expect("declared");
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
    assert!(failed > 0 && held > 9_000, "{failed} failed, {held} held");
    std::fs::remove_dir_all(&dir).expect("removed");
}

/// Ego that fails in half of its runs, and in half of these gives up before, if it is
/// fragile.
#[derive(Clone)]
struct Reckless {
    is_fragile: bool,
    seed: u64,
}

impl Controller for Reckless {
    fn reset(&mut self, seed: u64) {
        self.seed = seed;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let fails = self.seed % 4 > 1;
        if self.is_fragile && self.seed % 4 == 3 && percept.time_s > 0.5 {
            return Err(Fault::error("gave up"));
        }
        Ok(Command::accelerate(if fails { 2.0 } else { -6.0 }))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

pub(super) fn reckless(world: &Scenario, is_fragile: bool) -> EgoUnderTest {
    let name = if is_fragile { "fragile" } else { "sound" };
    let factory = move || -> Box<dyn Controller> {
        Box::new(Reckless {
            is_fragile,
            seed: 0,
        })
    };
    EgoUnderTest::own(world, name, std::sync::Arc::new(factory)).expect("driven")
}

/// Counts natural runs, with a share of faults that is allowed.
fn counted_with(egos: &[EgoUnderTest], allowed: f64) -> (RiskReport, FaultLog) {
    let traffic = RiskTraffic::parse(egos[0].scenario(), "t.ron", TRAFFIC).expect("sound");
    let mut request = RiskRequest::new(&traffic, egos);
    request.settings = RiskSettings {
        natural: 1000,
        ..settings(2)
    };
    let watch = Watch {
        faults: FaultLog::allowing(allowed),
        ..Watch::unwatched()
    };
    let report = request.estimate(&watch).expect("no disk");
    (report.expect("not stopped"), watch.faults)
}

#[test]
fn a_fault_is_in_every_number_of_a_risk_and_passes_no_limit() {
    let world = world();
    let egos = [reckless(&world, true), reckless(&world, false)];
    let (report, log) = counted_with(&egos, 0.3);
    let [fragile, sound] = &report.egos[..] else {
        panic!("two egos");
    };
    // The same draws without the faults are the truth, which is in between.
    let truth = sound.readings.fails.expect("no fault");
    assert!((0.45..0.55).contains(&truth.probability), "{truth:?}");
    assert!(sound.between.is_none() && sound.faults.invalid == 0);
    assert_eq!(fragile.readings.fails, None);
    let [least, most] = fragile.least_and_most().expect("counted");
    let invalid = fragile.faults.invalid;
    assert!(
        invalid > 200 && fragile.faults.runs == 1000,
        "{:?}",
        fragile.faults
    );
    assert_eq!(most.hits, least.hits + invalid);
    assert!(least.hits < truth.hits && truth.hits <= most.hits);
    // Faults that are left out would make the fragile ego the better one.
    assert!(report.ratio.is_none() && report.greatest_ratio().expect("two egos") > 1.0);
    let [least, most] = report.ratio_between.expect("faults");
    assert!(least.probability < 0.6 && most.probability > 0.95);
    let json = serde_json::to_value(&report).expect("JSON");
    let of_fragile = &json["egos"][0];
    assert!(of_fragile["fails"].is_null() && of_fragile["invalid"] == invalid);
    assert_eq!(of_fragile["faults"][0]["kind"], "error");
    assert_eq!(of_fragile["faults"][0]["count"], invalid);
    let text = report.to_string();
    let share = format!("invalid: {invalid} of 1000 runs ended in a fault");
    for said in [&share[..], "gave up", "if every fault is one", "at least"] {
        assert!(text.contains(said), "{said}: {text}");
    }
    // The worst ego decides, so that a sound one does not hide it.
    assert!(log.complaint().is_none());
    let (_, log) = counted_with(&egos, 0.2);
    assert!(
        log.complaint()
            .is_some_and(|it| it.row.as_deref() == Some("fragile"))
    );
}

#[test]
fn failures_that_do_not_count_in_the_world_do_not_count_in_its_risk() {
    let counting = |closing_mps: f64| {
        let text = world().text().replace(
            "judge: UntilViolation,",
            &format!("judge: UntilContact, counts: Contact(closing_mps: {closing_mps}),"),
        );
        let world = Scenario::parse("acc.ron", &text)
            .expect("sound")
            .on(PlantKind::Kinematic);
        let egos = [reckless(&world, false)];
        counted_with(&egos, 0.0).0
    };
    let soft = counting(5.0);
    assert_eq!(soft.counts, Counts::Contact { closing_mps: 5.0 });
    let fails = soft.egos[0].readings.fails.expect("counted");
    assert!(fails.hits > 300, "{fails:?}");
    assert!(soft.to_string().contains("closing speed of 5 m/s or more"));
    let hard = counting(60.0);
    assert!(!hard.is_result() && hard.egos[0].is_weighted());
    assert_eq!(
        hard.egos[0].refusals()[0].reason,
        "no failure is known in this traffic"
    );
}

#[test]
fn a_risk_is_said_with_its_interval_its_traffic_and_its_length() {
    let world = world();
    let (report, _) = counted_with(&[reckless(&world, false)], 0.0);
    let text = report.to_string();
    let [lo, hi] = report.egos[0].readings.fails.expect("counted").interval;
    let said = "in traffic “test”, on the kinematic plant, in runs of 2.5 s, `sound` fails in";
    assert!(text.contains(said), "{text}");
    let interval = format!("of runs (95 % interval {lo:.4} … {hi:.4})");
    assert!(text.contains(&interval), "{interval}: {text}");
    // Every line of the table is a share of the runs that it names.
    for (line, of) in [
        ("fails ", "all runs"),
        ("fails, lawful ", "all runs"),
        ("fails, preventable ", "all runs"),
        ("fails, given lawful ", "lawful runs"),
        ("lawful ", "1000 natural runs"),
    ] {
        let found = text.lines().find(|it| it.starts_with(line));
        assert!(found.is_some_and(|it| it.ends_with(of)), "{line}: {text}");
    }
}
