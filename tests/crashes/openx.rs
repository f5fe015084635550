//! Exported crashes: what the files say is what was recorded.
//!
//! Everything is computed from the files as another tool would, and compared
//! with the samples beside the kept counterexamples.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use brakecheck::crashes::SavedCounterexample;
use brakecheck::crashes::{Regressions, Replayed};
use brakecheck::openx::OpenX;
use brakecheck::scene::World;
use brakecheck::trace::Trace;
use brakecheck_crashes::crashes::export::openx;
use brakecheck_scene::scene::drive::{DriveSpec, DriveWorld};

use super::xml::Node;

/// Files hold the numbers of the trace; what is lost is lost by sine and cosine.
const NOTHING_M: f64 = 1e-9;

pub(super) fn regressions() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/regressions")
}

/// A kept counterexample of a road with its three files, read.
pub(super) struct Exported {
    pub kept: SavedCounterexample,
    replayed: Replayed,
    pub trace: Trace,
    road: Node,
    replay: Node,
    external: Node,
    pub texts: OpenX,
}

impl Exported {
    fn name(&self) -> &str {
        self.kept.path.file_stem().unwrap().to_str().unwrap()
    }

    fn world(&self) -> &DriveWorld {
        match self.replayed.scenario.world() {
            World::Drive(world) => world,
            World::Grid(_) => panic!("a grid"),
        }
    }

    fn spec(&self) -> &DriveSpec {
        self.world().spec()
    }

    fn contact_s(&self) -> Option<f64> {
        let contact = self.kept.counterexample.contact.as_ref();
        contact.map(|touch| touch.time_s)
    }

    /// The recorded samples before the contact, by time: a contact's last one
    /// shows its instant, and is held to the horizon in some worlds.
    fn samples(&self) -> impl Iterator<Item = (usize, f64)> {
        let end_s = self.contact_s().unwrap_or(f64::INFINITY);
        let dt_s = self.trace.dt_s();
        let samples = (0..self.trace.len()).map(move |sample| (sample, sample as f64 * dt_s));
        samples.take_while(move |(_, time_s)| *time_s < end_s)
    }

    fn recorded(&self, agent: &str, what: &str, sample: usize) -> f64 {
        let column = self.trace.signal(&format!("{agent}.{what}"));
        column.unwrap_or_else(|| panic!("no {agent}.{what}"))[sample]
    }
}

/// Every kept counterexample of a road, played and exported once.
pub(super) fn all() -> &'static [Exported] {
    static ALL: LazyLock<Vec<Exported>> = LazyLock::new(|| {
        let regressions = Regressions::load(regressions()).unwrap();
        let replayed = regressions.replay_recorded().unwrap();
        let pairs = regressions.kept().iter().cloned().zip(replayed);
        let roads = pairs.filter(|(_, replayed)| replayed.scenario.grid().is_none());
        let exported = roads.map(|(kept, replayed)| {
            let stem = kept.path.file_stem().unwrap().to_str().unwrap();
            let texts = openx(
                &replayed.scenario,
                &replayed.episode,
                stem,
                &kept.counterexample.ego,
            )
            .unwrap();
            Exported {
                trace: kept.counterexample.samples(&kept.path).unwrap().unwrap(),
                road: Node::read(&texts.road),
                replay: Node::read(&texts.replay),
                external: Node::read(&texts.external),
                texts,
                kept,
                replayed,
            }
        });
        exported.collect()
    });
    assert_eq!(ALL.len(), 22);
    &ALL
}

/// The vertices of an agent's trajectory as (time, x, y, h).
pub(super) fn way(scenario: &Node, agent: &str) -> Vec<[f64; 4]> {
    let trajectory = scenario.named("Trajectory", "name", agent);
    let vertices = trajectory.all("Vertex").into_iter().map(|vertex| {
        let at = vertex.one("WorldPosition");
        [
            vertex.number("time"),
            at.number("x"),
            at.number("y"),
            at.number("h"),
        ]
    });
    vertices.collect()
}

/// The middle of a front bumper, by the box that the file states.
fn front(scenario: &Node, agent: &str, vertex: &[f64; 4]) -> (f64, f64) {
    let bounds = scenario
        .named("ScenarioObject", "name", agent)
        .one("BoundingBox");
    let ahead_m =
        bounds.one("Center").number("x") + 0.5 * bounds.one("Dimensions").number("length");
    let [_, x_m, y_m, heading_rad] = vertex;
    (
        x_m + ahead_m * heading_rad.cos(),
        y_m + ahead_m * heading_rad.sin(),
    )
}

#[test]
fn front_bumpers_are_where_they_were_recorded() {
    let mut compared = BTreeMap::new();
    for exported in all() {
        for agent in &exported.spec().agents {
            let name = agent.name.as_str();
            let way = way(&exported.replay, name);
            for (sample, time_s) in exported.samples() {
                let vertex = &way[sample];
                assert!((vertex[0] - time_s).abs() < 1e-9, "{}", exported.name());
                let (x_m, y_m) = front(&exported.replay, name, vertex);
                let off_x_m = x_m - exported.recorded(name, "x", sample);
                let off_y_m = y_m - exported.recorded(name, "y", sample);
                let off_m = off_x_m.hypot(off_y_m);
                let place = format!("{} {name} at {time_s}", exported.name());
                assert!(off_m < NOTHING_M, "{place}: {off_m} m");
                *compared.entry(agent.body.is_on_foot()).or_insert(0) += 1;
            }
        }
    }
    // Both kinds of reference points were looked at.
    assert!(
        compared[&false] > 1000 && compared[&true] > 50,
        "{compared:?}"
    );
}

/// What esmini and others move: a box that is consistent with another point
/// would look right at every sample and turn about the wrong one.
#[test]
fn rear_axles_and_the_middles_of_walkers_are_what_moves() {
    for exported in all() {
        for agent in &exported.spec().agents {
            let entity = exported.replay.named("ScenarioObject", "name", &agent.name);
            let ahead_m = entity.one("Center").number("x");
            let Some(vehicle) = agent.body.vehicle() else {
                assert_eq!(ahead_m, 0.0);
                continue;
            };
            let rear_m = vehicle.rear_axle_ahead_m(&agent.body.dimensions());
            assert!((ahead_m + rear_m).abs() < 1e-12, "{ahead_m}");
            assert_eq!(entity.one("RearAxle").number("positionX"), 0.0);
            let front_m = entity.one("FrontAxle").number("positionX");
            assert_eq!(front_m, vehicle.wheelbase_m);
        }
    }
}

#[test]
fn a_replay_ends_two_seconds_after_the_contact() {
    let mut contacts = 0;
    for exported in all() {
        let contact_s = exported.contact_s();
        let last_s = (exported.trace.len() - 1) as f64 * exported.trace.dt_s();
        let end_s = contact_s.map_or(last_s, |contact_s| contact_s + 2.0);
        for agent in &exported.spec().agents {
            let way = way(&exported.replay, &agent.name);
            let last_s = way.last().unwrap()[0];
            assert!((last_s - end_s).abs() < 1e-9, "{}", exported.name());
            assert!(way.windows(2).all(|pair| pair[0][0] < pair[1][0]));
            // A player with steps of 0.01 s has one in which the bodies touch.
            if let Some(contact_s) = contact_s {
                let at = way.iter().position(|it| (it[0] - contact_s).abs() < 1e-9);
                let [touch, held] = [0, 1].map(|next| way[at.unwrap() + next]);
                assert!(
                    (held[0] - touch[0] - 0.01).abs() < 1e-8,
                    "{}",
                    exported.name()
                );
                assert_eq!(touch[1..], held[1..], "{}", exported.name());
            }
        }
        let stop = exported
            .replay
            .one("StopTrigger")
            .one("SimulationTimeCondition");
        assert!((stop.number("value") - end_s).abs() < 1e-9);
        assert_eq!(stop.text("rule"), "greaterThan");
        contacts += usize::from(contact_s.is_some());
    }
    assert_eq!(contacts, 13);
}

#[test]
fn everybody_begins_as_recorded() {
    for exported in all() {
        for scenario in [&exported.replay, &exported.external] {
            for agent in &exported.spec().agents {
                let name = agent.name.as_str();
                let begin = scenario.named("Private", "entityRef", name);
                let speed = begin.one("AbsoluteTargetSpeed").number("value");
                assert_eq!(speed, exported.recorded(name, "speed", 0));
                let at = begin.one("WorldPosition");
                let at = [0.0, at.number("x"), at.number("y"), at.number("h")];
                let (x_m, y_m) = front(scenario, name, &at);
                assert!((x_m - exported.recorded(name, "x", 0)).abs() < NOTHING_M);
                assert!((y_m - exported.recorded(name, "y", 0)).abs() < NOTHING_M);
            }
            let surface = scenario.one("RoadCondition");
            let friction = exported.spec().road.friction();
            assert_eq!(surface.number("frictionScaleFactor"), friction);
        }
    }
}

/// A point of a plan view: the pose on it at s, by the geometry that holds it.
fn on_reference_line(road: &Node, s_m: f64) -> [f64; 3] {
    let mut pieces = road.all("geometry").into_iter();
    let piece = pieces.rfind(|piece| piece.number("s") <= s_m).unwrap();
    let along_m = s_m - piece.number("s");
    assert!(
        along_m <= piece.number("length") + 1e-9,
        "s = {s_m} is off the road"
    );
    let heading_rad = piece.number("hdg");
    let curvature = piece
        .all("arc")
        .first()
        .map_or(0.0, |arc| arc.number("curvature"));
    let turned_rad = along_m * curvature;
    let (ahead_m, left_m) = if curvature == 0.0 {
        (along_m, 0.0)
    } else {
        (
            turned_rad.sin() / curvature,
            (1.0 - turned_rad.cos()) / curvature,
        )
    };
    let (sin, cos) = heading_rad.sin_cos();
    [
        piece.number("x") + ahead_m * cos - left_m * sin,
        piece.number("y") + ahead_m * sin + left_m * cos,
        heading_rad + turned_rad,
    ]
}

#[test]
fn s_and_t_of_the_road_are_those_of_the_trace() {
    let mut bent = 0;
    for exported in all() {
        let (road, course) = (&exported.road, exported.world().course());
        let first_x_m = road.all("geometry")[0].number("x");
        let agents = exported.spec().agents.iter();
        for (agent, (sample, _)) in agents.flat_map(|it| exported.samples().map(move |at| (it, at)))
        {
            let name = agent.name.as_str();
            let x_m = exported.recorded(name, "x", sample);
            let y_m = exported.recorded(name, "y", sample);
            let at = course.locate(&brakecheck::scene::Pose {
                x_m,
                y_m,
                heading_rad: 0.0,
            });
            // Every road in these worlds begins along world x.
            let [x0_m, y0_m, heading_rad] = on_reference_line(road, at.s_m - first_x_m);
            let (sin, cos) = heading_rad.sin_cos();
            let off_x_m = x0_m - at.lateral_m * sin - x_m;
            let off_y_m = y0_m + at.lateral_m * cos - y_m;
            assert!(off_x_m.hypot(off_y_m) < 1e-6, "{}", exported.name());
            bent += usize::from(heading_rad != 0.0);
        }
    }
    assert!(bent > 100, "{bent}");
}

#[test]
fn the_road_is_long_enough_and_its_lanes_are_those_of_the_world() {
    for exported in all() {
        let (road, spec) = (&exported.road, exported.spec());
        let (lanes, width_m) = (spec.road.lanes(), spec.road.lane_width_m());
        let right = road.one("right").all("lane");
        let ids: Vec<i64> = right.iter().map(|lane| lane.number("id") as i64).collect();
        let expected: Vec<i64> = (1..=lanes as i64).map(|number| -number).collect();
        assert_eq!(ids, expected);
        // The middle of lane −(n − k) is the middle of the world's lane k.
        for k in 0..lanes {
            let number = (lanes - k) as f64;
            let t_m = road.one("laneOffset").number("a") - (number - 0.5) * width_m;
            assert!((t_m - spec.road.lane_middle_m(k)).abs() < 1e-9);
        }
        assert!(
            right
                .iter()
                .all(|lane| lane.one("width").number("a") == width_m)
        );
        let geometries = road.all("geometry");
        let first_x_m = geometries[0].number("x");
        let length_m = road.one("road").number("length");
        let sum: f64 = geometries.iter().map(|it| it.number("length")).sum();
        assert!((sum - length_m).abs() < 1e-9);
        let is_line = |it: &&Node| !it.all("line").is_empty();
        assert!(!geometries.windows(2).any(|pair| pair.iter().all(is_line)));
        for agent in &spec.agents {
            for scenario in [&exported.replay, &exported.external] {
                if scenario
                    .all("Trajectory")
                    .iter()
                    .all(|it| it.text("name") != agent.name)
                {
                    continue;
                }
                for [_, x_m, y_m, heading_rad] in way(scenario, &agent.name) {
                    let pose = brakecheck::scene::Pose {
                        x_m,
                        y_m,
                        heading_rad,
                    };
                    let s_m = exported.world().course().locate(&pose).s_m - first_x_m;
                    assert!(
                        s_m >= 50.0 && s_m + 190.0 <= length_m,
                        "{}",
                        exported.name()
                    );
                }
            }
        }
    }
}

#[test]
fn beside_an_own_ego_the_others_go_on_to_the_horizon() {
    let mut gone_on = 0;
    for exported in all() {
        let (spec, external) = (exported.spec(), &exported.external);
        let horizon_s = spec.clock.horizon_s;
        let controlled: Vec<&str> = (external.all("ScenarioObject").into_iter())
            .filter(|it| !it.all("ObjectController").is_empty())
            .map(|it| it.text("name"))
            .collect();
        assert_eq!(controlled, ["ego"]);
        let properties = external.one("ObjectController");
        let told = properties.named("Property", "name", "esminiController");
        assert_eq!(told.text("value"), "ExternalController");
        let activated = external
            .named("Private", "entityRef", "ego")
            .one("ActivateControllerAction");
        assert_eq!(
            (activated.text("lateral"), activated.text("longitudinal")),
            ("true", "true")
        );
        let ways = external.all("Trajectory").into_iter();
        let names: Vec<&str> = ways.map(|it| it.text("name")).collect();
        let others: Vec<&str> = spec
            .agents
            .iter()
            .filter(|agent| agent.name != "ego")
            .map(|agent| agent.name.as_str())
            .collect();
        assert_eq!(names, others);
        for name in others {
            let (then, on) = (way(&exported.replay, name), way(external, name));
            assert!((on.last().unwrap()[0] - horizon_s).abs() < 1e-9);
            assert_eq!(on.len(), spec.clock.samples());
            // Up to the contact, bit for bit.
            let same = exported.samples().count();
            assert_eq!(then[..same], on[..same], "{} {name}", exported.name());
            let [_, x_m, y_m, _] = on[same - 1];
            let [_, end_x_m, end_y_m, _] = on[on.len() - 1];
            gone_on += usize::from((end_x_m - x_m).hypot(end_y_m - y_m) > 1.0);
        }
        let told = external.named("Property", "name", "brakecheck.after_contact");
        assert!(told.text("value").contains("without contact"));
    }
    assert!(gone_on > 8, "{gone_on}");
}

#[test]
fn lights_show_the_recorded_phases() {
    let mut turned = 0;
    for exported in all() {
        let spec = exported.spec();
        let signals = exported.road.all("signal");
        assert_eq!(signals.len(), spec.lights.len());
        for (light, signal) in spec.lights.iter().zip(signals) {
            let first_x_m = exported.road.all("geometry")[0].number("x");
            assert!((signal.number("s") + first_x_m - light.line_m).abs() < 1e-9);
            let controller = exported
                .replay
                .named("TrafficSignalController", "name", &light.name);
            let ids = controller.all("TrafficSignalState").into_iter();
            assert!(
                ids.into_iter()
                    .all(|it| it.text("trafficSignalId") == signal.text("id"))
            );
            let phases = controller.all("Phase");
            let shown_at = |time_s: f64| {
                let mut ends_s = 0.0;
                let phase = phases.iter().find(|phase| {
                    ends_s += phase.number("duration");
                    time_s < ends_s - 1e-9
                });
                phase.unwrap().one("TrafficSignalState").text("state")
            };
            for (sample, time_s) in exported.samples() {
                let is_red = exported.recorded(&light.name, "red", sample) == 1.0;
                assert_eq!(shown_at(time_s) == "on;off;off", is_red, "{time_s}");
            }
            turned += phases.len() - 1;
        }
    }
    assert!(turned > 4, "{turned}");
}

#[test]
fn what_is_asked_of_whom_is_in_the_header() {
    let exported = all()
        .iter()
        .find(|it| it.name() == "acc-wet-road-0001")
        .unwrap();
    let told = |name: &str| {
        let name = format!("brakecheck.{name}");
        exported
            .replay
            .named("Property", "name", &name)
            .text("value")
            .to_owned()
    };
    assert_eq!(told("world"), "acc");
    assert_eq!(told("ego"), "wet road");
    assert_eq!(told("ego_spec"), "always[0, T] (headway >= d_safe)");
    assert_eq!(
        told("rule.1"),
        "never stops or reverses: always[0, T] (ado.speed >= v_min)"
    );
    assert_eq!(told("constant.d_safe"), "4.7");
    assert_eq!(told("friction"), "0.4");
    let robustness: f64 = told("robustness").parse().unwrap();
    assert_eq!(robustness, exported.kept.counterexample.robustness);
    let file = exported.replay.one("LogicFile").text("filepath");
    assert_eq!(file, "acc-wet-road-0001.xodr");
}
