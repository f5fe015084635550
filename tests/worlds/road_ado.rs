//! A road that an ado lays: the pieces, by hand, their limits, their pictures and exports.

use std::sync::{Arc, Mutex};

use brakecheck::crashes::Regressions;
use brakecheck::ego::{Briefing, Command, Controller, Fault, Percept, RoadPiece};
use brakecheck::preventability::NotApplicable;
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, Testbench, play};
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::export::openx;
use brakecheck_sim::sim::PlantKind;

const PLANTS: [PlantKind; 2] = [PlantKind::Rigid, PlantKind::Kinematic];
/// Samples between two decisions.
const DECISION: usize = 10;
const ROAD: &str = "Road(name: \"bend\", ahead_m: 60.0, piece_m: 20.0, \
    drive: Ado(actions: Curvatures([0.0, 0.01, 0.02, -0.01]), neutral: 0, \
    rulebook: [Rule(name: \"gradual\", stl: \"always (abs(bend.curvature_change) <= 0.015)\"), \
    Rule(name: \"wide\", stl: \"always (bend.radius >= 40 and bend.ahead >= 20 and bend.turned >= -2)\")]))";
const CAR: &str = "Vehicle(name: \"ego\", body: \"sedan\", \
    start: At(x_m: 0.5, speed_mps: 20.0), drive: Ego(Coast(accel_mps2: 0.0, lag_s: 0.0)))";
const PIECES: &str = "pieces: [Line(length_m: 100.0)]";

/// A car at 20 m/s, which is 1 m per sample, on 100 m of listed road.
fn text(road: &str) -> String {
    format!(
        "Scenario(name: \"laid\", question: \"?\", \
         clock: (horizon_s: 8.0, decision_s: 0.5, sample_s: 0.05, substeps: 4), \
         judge: WholeRun, \
         road: Curved(lanes: 1, lane_width_m: 3.5, friction: 0.9, {PIECES}), \
         agents: [{CAR}, {road}], \
         ego_spec: \"always (abs(ego.lateral) <= 0.5)\")"
    )
}

fn world(text: &str) -> Scenario {
    Scenario::parse("laid.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

fn begun(world: &Scenario) -> Testbench {
    let mut bench = world.bench();
    bench.begin(&Start(vec![]), 7, Aftermath::Skip);
    bench
}

#[test]
fn a_piece_has_the_curvature_in_force_when_the_laid_road_ends_too_near() {
    for plant in PLANTS {
        let mut bench = begun(&world(&text(ROAD)).on(plant));
        // The fifth decision acts from sample 40 on, the seventh from sample 60 on.
        for action in [3, 3, 3, 3, 1, 3, 2, 3] {
            bench.decide(action);
        }
        let column = |name: &str| bench.trace().signal(name).expect("recorded");
        // At 40.5 m the 100 m end less than 60 m ahead, and at 60.5 m the 120 m.
        let expected = |sample: usize| match sample {
            0..=40 => (1.0, 0.0, 0.0),
            41..=60 => (2.0, 0.01, 0.01),
            _ => (3.0, 0.02, 0.01),
        };
        for sample in 0..=8 * DECISION {
            let (pieces, curvature, change) = expected(sample);
            assert_eq!(column("bend.pieces")[sample], pieces, "{plant:?} {sample}");
            let off = (column("bend.curvature")[sample] - curvature).abs();
            assert!(off < 1e-12, "{plant:?} {sample}");
            let off = (column("bend.curvature_change")[sample] - change).abs();
            assert!(off < 1e-12, "{plant:?} {sample}");
        }
        // 140 m of road, of which the ego has driven 80.5 m.
        assert!((column("bend.ahead")[8 * DECISION] - 59.5).abs() < 0.01);
        assert!((column("bend.radius")[8 * DECISION] - 50.0).abs() < 1e-9);
        let turned = column("bend.turned")[8 * DECISION];
        assert!((turned - 20.0 * (0.01 + 0.02)).abs() < 1e-9, "{turned}");
    }
}

#[test]
fn the_car_follows_the_road_that_is_laid() {
    for plant in PLANTS {
        let mut bench = begun(&world(&text(ROAD)).on(plant));
        (0..16).for_each(|_| bench.decide(1));
        let headings = bench.trace().signal("ego.heading").expect("recorded");
        // From 100 m on at 100 m of radius, at 160.5 m it has turned by about 0.6 rad.
        let turned = headings[16 * DECISION];
        assert!((turned - 0.6).abs() < 0.05, "{plant:?} {turned}");
        let offsets = bench.trace().signal("ego.lateral").expect("recorded");
        assert!(
            offsets.iter().all(|offset| offset.abs() < 0.25),
            "{plant:?}"
        );
    }
}

#[test]
fn the_road_stops_turning_before_it_comes_back() {
    // Each piece turns by 0.4 rad: after three it has turned by 1.2, and the fourth by 0.3.
    let longer = text(ROAD).replace("horizon_s: 8.0", "horizon_s: 12.0");
    let mut bench = begun(&world(&longer).on(PlantKind::Kinematic));
    (0..24).for_each(|_| bench.decide(2));
    let curvatures = bench.trace().signal("bend.curvature").expect("recorded");
    let mut laid: Vec<f64> = curvatures.to_vec();
    laid.dedup();
    assert_eq!(laid.len(), 4, "{laid:?}");
    for (found, expected) in laid.iter().zip([0.0, 0.02, 0.015, 0.0]) {
        assert!((found - expected).abs() < 1e-9, "{laid:?}");
    }
    let turned = bench.trace().signal("bend.turned").expect("recorded");
    assert!(turned.iter().all(|rad| *rad <= 1.5 + 1e-9));
}

#[test]
fn an_episode_forks_replays_and_leaves_the_next_start_its_listed_road() {
    for plant in PLANTS {
        let world = world(&text(ROAD)).on(plant);
        let mut bench = begun(&world);
        let listed = bench.stage();
        (0..6).for_each(|_| bench.decide(1));
        let mut fork = bench.fork().expect("a stock ego");
        // The fork lays another road, and the first one does not notice.
        fork.decide(3);
        fork.decide(3);
        for action in [2, 1, 0, 1] {
            bench.decide(action);
        }
        assert_ne!(bench.stage(), fork.stage());
        let first = bench.trace().clone();
        assert_ne!(bench.stage(), listed);
        bench.begin(&Start(vec![]), 7, Aftermath::Skip);
        assert_eq!(bench.stage(), listed);
        for action in [1, 1, 1, 1, 1, 1, 2, 1, 0, 1] {
            bench.decide(action);
        }
        assert_eq!(*bench.trace(), first, "{plant:?}");
    }
}

/// Place and road of the ego at each sample.
type Heard = Vec<(f64, Vec<RoadPiece>)>;

/// Keeps its speed, and notes its place and the road of which it is informed.
struct Listener {
    pieces: Vec<RoadPiece>,
    heard: Arc<Mutex<Heard>>,
}

impl Controller for Listener {
    fn brief(&mut self, briefing: &Briefing) {
        self.pieces.clone_from(&briefing.road.pieces);
    }

    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let mut heard = self.heard.lock().expect("sound");
        heard.push((percept.own.s_m, self.pieces.clone()));
        Ok(Command::default())
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

#[test]
fn the_road_that_the_ego_has_seen_never_changes() {
    let heard = Arc::new(Mutex::new(Vec::new()));
    let listener = {
        let heard = Arc::clone(&heard);
        move || {
            Box::new(Listener {
                pieces: Vec::new(),
                heard: Arc::clone(&heard),
            }) as Box<dyn Controller>
        }
    };
    let listening = world(&text(ROAD)).with_ego("listener", Arc::new(listener));
    let mut bench = begun(&listening);
    for action in [1, 2, 1, 3, 1, 2, 2, 1, 1, 1, 3, 0] {
        bench.decide(action);
    }
    let heard = heard.lock().expect("sound");
    for (before, after) in heard.iter().zip(&heard[1..]) {
        assert_eq!(after.1[..before.1.len()], before.1[..]);
    }
    for (s_m, pieces) in heard.iter() {
        let last = pieces.last().expect("a piece");
        assert!(s_m + 60.0 <= last.from_s_m + last.length_m, "{s_m}");
    }
    let last = &heard.last().expect("a sample").1;
    assert!(last.len() >= 5, "{last:?}");
}

fn departure(world: &Scenario) -> Episode {
    let mut bench = world.bench();
    play(
        &mut bench,
        &Start(vec![]),
        3,
        &mut Constant(1),
        Aftermath::Skip,
    )
}

#[test]
fn a_kept_departure_replays_and_is_drawn_and_exported_with_the_driven_road() {
    // At 20 m/s a radius of 100 m takes 4 m/s², which μ = 0.3 does not give.
    let icy = text(ROAD).replace("friction: 0.9", "friction: 0.3");
    let world = world(&icy).on(PlantKind::Kinematic);
    let episode = departure(&world);
    assert!(episode.verdict.is_success(), "{:?}", episode.verdict);
    let kept = Counterexample::record(&world, "nominal", &Change::default(), "constant", &episode);
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("departure.ron");
    kept.save(&file, &episode.trace).expect("written");
    let replayed = &Regressions::load(&file)
        .expect("kept")
        .replay_recorded()
        .expect("replayed")[0];
    assert!(replayed.is_reproduced());

    let mut driven = world.bench();
    play(
        &mut driven,
        &Start(vec![]),
        3,
        &mut Constant(1),
        Aftermath::Skip,
    );
    let drawn = world.of_episode(&episode).bench().stage();
    let driven = driven.stage();
    assert_eq!(drawn.lane_borders_m.len(), driven.lane_borders_m.len());
    for (a, b) in drawn.lane_borders_m.iter().zip(&driven.lane_borders_m) {
        assert_eq!(a.len(), b.len());
        let points = a.iter().flatten().zip(b.iter().flatten());
        assert!(points.into_iter().all(|(a, b)| (a - b).abs() < 1e-6));
    }
    assert_ne!(drawn, world.bench().stage());

    let texts = openx(
        &replayed.scenario,
        &replayed.episode,
        "departure",
        "nominal",
    );
    let road = texts.expect("exported").road;
    assert!(road.contains("curvature=\"0.01\""), "{road}");
}

#[test]
fn mistakes_in_a_laid_road_are_refused_by_name() {
    let cases = [
        (
            ROAD,
            "Curved(lanes",
            "Straight(lanes",
            "an ado lays pieces behind those of a `Curved` road",
        ),
        (
            "ahead_m: 60.0",
            "",
            "ahead_m: 5.0",
            "5 is outside of 20 ..= 1000",
        ),
        (
            "piece_m: 20.0",
            "",
            "piece_m: 5.0",
            "5 is outside of 10 ..= 200",
        ),
        (
            "0.02, -0.01",
            "",
            "0.5, -0.01",
            "a curvature of 0.5 per metre",
        ),
        (
            "0.02, -0.01",
            "",
            "0.2, -0.01",
            "a curvature of 0.2 per metre",
        ),
        (
            "neutral: 0",
            "",
            "neutral: 4",
            "neutral action 4 of 4 actions",
        ),
        (
            "Curvatures([0.0, 0.01, 0.02, -0.01])",
            "",
            "Accelerations([0.0])",
            "a road cannot do this",
        ),
        (
            ROAD,
            "x_m: 0.5",
            "x_m: 120.0",
            "`ego` is at 120 m, beyond the listed road of 100 m",
        ),
        (
            ROAD,
            PIECES,
            "pieces: [Arc(length_m: 100.0, radius_m: 60.0)]",
            "turn the road by 1.67 rad",
        ),
        (
            ROAD,
            "agents: [",
            "roads: { \"side\": (at: (x_m: 60.0, y_m: 0.0, heading_rad: 1.5)) }, agents: [",
            "named roads cross a road that is not laid yet",
        ),
        (
            ROAD,
            "judge: WholeRun",
            "judge: UntilContact, counts: Preventable(by: [RSS])",
            "reference drivers do not apply to a road that an ado lays",
        ),
    ];
    for (from, outside, to, says) in cases {
        let text = if from == ROAD {
            text(ROAD).replace(outside, to)
        } else {
            text(&ROAD.replace(from, to))
        };
        // A straight road has no pieces.
        let text = if to == "Straight(lanes" {
            text.replace(&format!(", {PIECES}"), "")
        } else {
            text
        };
        let error = Scenario::parse("laid.ron", &text)
            .expect_err(says)
            .to_string();
        assert!(error.contains(says), "{to}: {error}");
    }
    let two = format!("{ROAD}, {}", ROAD.replace("bend", "curve"));
    let error = Scenario::parse("laid.ron", &text(&two)).expect_err("two roads");
    assert!(
        error
            .to_string()
            .contains("one ado lays the road of a world")
    );
}

#[test]
fn no_reference_driver_replays_a_contact_on_a_laid_road() {
    let parked = "Obstacle(name: \"parked\", body: \"sedan\", s_m: 95.0, lateral_m: 0.0), Road(";
    let parked = text(ROAD)
        .replace("Road(", parked)
        .replace("judge: WholeRun", "judge: UntilContact")
        .replace("abs(ego.lateral) <= 0.5", "ego.parked.gap >= 1");
    let world = world(&parked);
    let episode = departure(&world);
    assert!(episode.verdict.is_success() && episode.contact.is_some());
    let prevented = world.preventability(&episode);
    assert_eq!(prevented.not_applicable, Some(NotApplicable::ChangingRoad));
}
