//! Scenarios and roads of other programs: read as they say, or refused with place and fix.

use std::io;
use std::ops::Range;
use std::path::Path;

use brakecheck::openx::import::{Import, driven_lanes, lane_places};
use brakecheck::world::Scenario;
use proptest::prelude::*;
use proptest::sample::{Index, select};

use super::corpus::{self, Source};
use super::harness::{Seen, Target};
use super::mutate::mutants;

const DIR: &str = "tests/worlds/imports";
/// Actions of the lead, beside the one that the scenario has.
const ACTIONS: [&str; 7] = [
    r#"<LateralAction><LaneChangeAction targetLaneOffset="0.5"><LaneChangeActionDynamics dynamicsShape="cubic" dynamicsDimension="time" value="3"/><LaneChangeTarget><RelativeTargetLane entityRef="Lead" value="1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#,
    r#"<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="distance" value="40"/><LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget></LaneChangeAction></LateralAction>"#,
    r#"<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="1"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.7"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>"#,
    r#"<LongitudinalAction><SpeedProfileAction followingMode="position"><DynamicConstraints maxAcceleration="5" maxDeceleration="5"/><SpeedProfileEntry time="2" speed="6"/><SpeedProfileEntry time="1" speed="8"/></SpeedProfileAction></LongitudinalAction>"#,
    r#"<SynchronizeAction masterEntityRef="Ego"><TargetPositionMaster><LanePosition roadId="0" laneId="-1" s="300"/></TargetPositionMaster><TargetPosition><RoadPosition roadId="0" s="200" t="-5.25"/></TargetPosition><FinalSpeed><AbsoluteSpeed value="10"><TargetTimeSteadyState time="2"/></AbsoluteSpeed></FinalSpeed></SynchronizeAction>"#,
    r#"<RoutingAction><FollowTrajectoryAction initialDistanceOffset="0"><TrajectoryRef><Trajectory name="t" closed="false"><Shape><ClothoidSpline><ClothoidSplineSegment length="40" curvatureStart="0" curvatureEnd="0.01"><PositionStart><WorldPosition x="150" y="-5.25" h="0"/></PositionStart></ClothoidSplineSegment></ClothoidSpline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference></FollowTrajectoryAction></RoutingAction>"#,
    r#"<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline><Vertex time="0"><Position><WorldPosition x="150" y="-5.25"/></Position></Vertex><Vertex time="9"><Position><WorldPosition x="220" y="4.75"/></Position></Vertex></Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/></TimeReference></FollowTrajectoryAction></RoutingAction>"#,
];
/// Reference lines instead of the straight one.
const LINES: [&str; 4] = [
    r#"<arc curvature="0.001"/>"#,
    r#"<spiral curvStart="0" curvEnd="0.002"/>"#,
    r#"<poly3 a="0" b="0" c="0.0005" d="1e-7"/>"#,
    r#"<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="0.0004" dV="0"/>"#,
];
/// Values at which readers err.
const VALUES: [&str; 20] = [
    "",
    "0",
    "-1",
    "1.5",
    "-2147483648",
    "2147483648",
    "1e9",
    "1e300",
    "-1e308",
    "1e-308",
    "1e999",
    "NaN",
    "inf",
    "é",
    "${1/0}",
    "$none",
    "true",
    "Ego",
    "step",
    "../../dev/zero",
];

fn scenarios() -> Vec<Source> {
    let base = corpus::files(DIR, "xosc").remove(0);
    let from = base
        .text
        .find("<LongitudinalAction><SpeedAction>\n                <Speed")
        .expect("an action");
    let until = from + base.text[from..].find("</PrivateAction>").expect("its end");
    let with = |action: &str| {
        let text = format!("{}{action}{}", &base.text[..from], &base.text[until..]);
        Source::new("base.xosc", text)
    };
    let mut all: Vec<Source> = ACTIONS.iter().map(|action| with(action)).collect();
    all.push(base);
    all
}

fn roads() -> Vec<Source> {
    let mut all = corpus::files(DIR, "xodr");
    let straight = all
        .iter()
        .find(|it| it.name == "straight.xodr")
        .expect("a road");
    let straight = straight.text.clone();
    all.extend(
        LINES
            .iter()
            .map(|line| Source::new("straight.xodr", straight.replace("<line/>", line))),
    );
    // The scenario drives on this one.
    all.iter_mut()
        .for_each(|it| it.name = "straight.xodr".to_owned());
    all
}

/// One change of the elements of a document.
#[derive(Clone, Debug)]
enum Edit {
    Drop(Index),
    Repeat(Index, usize),
    Move(Index, Index),
    Value(Index, &'static str),
}

fn edit() -> impl Strategy<Value = Edit> {
    let place = any::<Index>;
    prop_oneof![
        2 => place().prop_map(Edit::Drop),
        1 => (place(), select(vec![2, 3, 300])).prop_map(|(at, times)| Edit::Repeat(at, times)),
        1 => (place(), place()).prop_map(|(from, to)| Edit::Move(from, to)),
        4 => (place(), select(VALUES.to_vec())).prop_map(|(at, value)| Edit::Value(at, value)),
    ]
}

/// Elements with their content.
fn elements(text: &str) -> Vec<Range<usize>> {
    let mut open: Vec<usize> = Vec::new();
    let mut all = Vec::new();
    for (from, _) in text.match_indices('<') {
        let Some(length) = text[from..].find('>') else {
            break;
        };
        let tag = &text[from..=from + length];
        if tag.starts_with("</") {
            all.extend(open.pop().map(|begins| begins..from + length + 1));
        } else if tag.ends_with("/>") {
            all.push(from..from + length + 1);
        } else if !tag.starts_with("<?") && !tag.starts_with("<!") {
            open.push(from);
        }
    }
    all
}

/// Values of attributes, without their quotes.
fn values(text: &str) -> Vec<Range<usize>> {
    let mut all = Vec::new();
    let mut quotes = text.match_indices('"').map(|(at, _)| at);
    while let (Some(from), Some(to)) = (quotes.next(), quotes.next()) {
        all.push(from + 1..to);
    }
    all
}

impl Edit {
    fn of(&self, text: String) -> String {
        let pick =
            |all: Vec<Range<usize>>, at: &Index| (!all.is_empty()).then(|| at.get(&all).clone());
        let elements = || elements(&text);
        let changed = match self {
            Edit::Drop(at) => pick(elements(), at).map(|it| (it, String::new())),
            Edit::Repeat(at, times) => pick(elements(), at).map(|it| {
                let repeated = text[it.clone()].repeat(*times);
                (
                    it,
                    if repeated.len() < 200_000 {
                        repeated
                    } else {
                        String::new()
                    },
                )
            }),
            Edit::Move(from, to) => pick(elements(), from)
                .zip(pick(elements(), to))
                .map(|(from, to)| (to, text[from].to_owned())),
            Edit::Value(at, value) => pick(values(&text), at).map(|it| (it, (*value).to_owned())),
        };
        match changed {
            Some((span, with)) => format!("{}{with}{}", &text[..span.start], &text[span.end..]),
            None => text,
        }
    }
}

/// Documents with changes of their elements, of their characters, or of both.
fn documents(sources: Vec<Source>) -> impl Strategy<Value = String> {
    let sources: std::sync::Arc<[Source]> = sources.into();
    let edited = (any::<Index>(), prop::collection::vec(edit(), 1..4)).prop_map({
        let sources = sources.clone();
        move |(which, edits)| {
            let text = which.get(&sources).text.clone();
            edits.iter().fold(text, |text, edit| edit.of(text))
        }
    });
    prop_oneof![3 => edited, 1 => mutants(sources).prop_map(|mutant| mutant.text)]
}

fn imported(scenario: &str, road: &str) -> Seen {
    let files = |path: &Path| match path.to_string_lossy().as_ref() {
        "fuzz.xosc" => Ok(scenario.to_owned()),
        "straight.xodr" => Ok(road.to_owned()),
        _ => Err(io::Error::from(io::ErrorKind::NotFound)),
    };
    let import = Import {
        scenario: Path::new("fuzz.xosc"),
        points: None,
        only: None,
        skips_broken: false,
        name: "fuzz",
        ado: None,
        ego: None,
        leaves_ego: true,
        maps: &[],
    };
    match import.read(&files) {
        Ok(imported) => {
            assert!(!imported.worlds.is_empty());
            for world in &imported.worlds {
                if let Err(error) = Scenario::parse("fuzz.ron", &world.text) {
                    return super::worlds::refused(&error, &world.text);
                }
            }
            Seen::Accepted
        }
        Err(error) => {
            for problem in error.all() {
                assert!(
                    !problem.what.is_empty() && problem.help.is_some(),
                    "{problem:?}"
                );
            }
            Seen::Refused
        }
    }
}

#[test]
fn any_scenario_is_refused_with_a_fix_or_becomes_a_world() {
    let target = Target {
        name: "xosc",
        cases: 150,
        shrinks: 200,
        least_percent: (10, 20),
    };
    let road = corpus::files(DIR, "xodr");
    let road = road
        .iter()
        .find(|it| it.name == "straight.xodr")
        .expect("a road");
    target.run(&documents(scenarios()), |text| imported(text, &road.text));
}

#[test]
fn any_road_is_refused_with_a_fix_or_driven() {
    let target = Target {
        name: "xodr",
        cases: 150,
        shrinks: 200,
        least_percent: (5, 20),
    };
    let base = corpus::files(DIR, "xosc").remove(0);
    target.run(&documents(roads()), |text| {
        let files = |_: &Path| Ok(text.clone());
        let path = Path::new("straight.xodr");
        let _ = driven_lanes(path, &files);
        let _ = lane_places(path, &files, 1.0);
        imported(&base.text, text)
    });
}
