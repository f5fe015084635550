//! Files that would flood, loop or overflow the import are refused by line, or read.

use super::*;

#[path = "bounds.rs"]
mod bounds;

const PLAN: &str = r#"<geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry>"#;
const LEFT: &str =
    r#"<lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>"#;
const LANE: &str =
    r#"<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>"#;

fn refused(edits: &[Edit]) -> ImportError {
    import(&files(edits)).expect_err("it is refused")
}

/// Asserts a refusal with a line and a fix.
fn assert_says(error: &ImportError, says: &str) {
    assert!(error.to_string().contains(says), "{says}: {error}");
    assert!(error.element.is_some() && error.help.is_some(), "{error:?}");
}

/// An ego that comes to a road that is linked to itself.
fn ring(length_m: &str) -> Vec<Edit> {
    let link = r#"<link><predecessor elementType="road" elementId="1" contactPoint="end"/></link>"#;
    let linked = LEFT.replace("<width", r#"<link><predecessor id="1"/></link><width"#);
    let (_, road) = ROADS[0].1.split_once("<road ").expect("a road");
    let (road, _) = road.split_once("</OpenDRIVE>").expect("its end");
    let ring = road
        .replace(r#"id="0" junction"#, r#"id="1" junction"#)
        .replace(r#"length="1000""#, &format!(r#"length="{length_m}""#))
        .replace("<planView>", &format!("{link}<planView>"))
        .replace(LEFT, &linked);
    vec![
        edit(r#"laneId="-1" s="50""#, r#"laneId="1" s="50""#),
        edit(LEFT, linked),
        edit("<!--types-->", link),
        edit("</OpenDRIVE>", format!("<road {ring}</OpenDRIVE>")),
    ]
}

#[test]
fn circles_of_roads_without_a_length_are_refused() {
    for length_m in ["0", "1e-300", "1e-9"] {
        assert_says(&refused(&ring(length_m)), "roads and sections");
    }
}

#[test]
fn routes_that_lead_back_to_themselves_are_refused() {
    let on_route = |name: &str| {
        format!(
            r#"<RoutePosition><RouteRef><CatalogReference catalogName="Routes" entryName="{name}"/></RouteRef><InRoutePosition><FromLaneCoordinates pathS="5" laneId="-1"/></InRoutePosition></RoutePosition>"#
        )
    };
    let route = |name: &str, next: &str| {
        format!(
            r#"<Route name="{name}" closed="false"><Waypoint routeStrategy="shortest"><Position>{}</Position></Waypoint></Route>"#,
            on_route(next)
        )
    };
    let mut files = files(&[
        edit(
            "<CatalogLocations/>",
            r#"<CatalogLocations><RouteCatalog><Directory path="."/></RouteCatalog></CatalogLocations>"#,
        ),
        edit(
            r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#,
            on_route("one"),
        ),
    ]);
    let (one, two) = (route("one", "two"), route("two", "one"));
    files.push((
        "./Routes.xosc",
        format!(r#"<OpenSCENARIO><Catalog name="Routes">{one}{two}</Catalog></OpenSCENARIO>"#),
    ));
    let error = import(&files).expect_err("a circle");
    assert_says(&error, "refer to each other in a circle");
}

#[test]
fn lanes_and_sections_that_contradict_each_other_are_refused() {
    let cases = [
        (edit(LANE, format!("{LANE}{LANE}")), "a second lane -1"),
        (
            edit(LANE, LANE.replace("3.5", "-3.5")),
            "a width of -3.500 m",
        ),
        // Wide at first, and below 0 at the end of the road.
        (
            edit(LANE, LANE.replace(r#"b="0""#, r#"b="-0.01""#)),
            "a width of -6.500 m",
        ),
        (
            edit(
                "</laneSection>",
                format!(
                    r#"</laneSection><laneSection s="500"><right>{LANE}</right></laneSection><laneSection s="400"><right>{LANE}</right></laneSection>"#
                ),
            ),
            "before the one ahead of it",
        ),
        (
            edit(
                r#"<ScenarioObject name="Lead">"#,
                r#"<ScenarioObject name="Ego">"#,
            ),
            "a second entity",
        ),
    ];
    for (edit, says) in cases {
        assert_says(&refused(&[edit]), says);
    }
}

#[test]
fn pieces_without_a_length_are_left_out() {
    let none = r#"<geometry s="0" x="0" y="0" hdg="0" length="0"><line/></geometry>"#;
    let last = r#"<geometry s="1000" x="1000" y="0" hdg="0" length="0"><line/></geometry>"#;
    let imported = import(&files(&[edit(PLAN, format!("{none}{PLAN}{last}"))]));
    let plain = import(&files(&[])).expect("a world");
    assert_eq!(
        imported.expect("a world").worlds[0].text,
        plain.worlds[0].text
    );
}

#[test]
fn numbers_of_elements_are_bounded() {
    let many = |text: &str, count: usize| text.repeat(count);
    let light = r#"<signal id="7" s="300" t="-2" dynamic="yes" orientation="+" name="x"/>"#;
    let cases = [
        (
            edit(
                r#"<Act name="act">"#,
                many(r#"<Act name="a"/>"#, 2_000) + r#"<Act name="act">"#,
            ),
            "more than 1000 elements",
        ),
        (
            edit(
                r#"<Maneuver name="maneuver">"#,
                many(r#"<Maneuver name="x"/>"#, 2_000) + r#"<Maneuver name="maneuver">"#,
            ),
            "more than 1000 elements",
        ),
        (
            edit(
                "<!--signals-->",
                format!("<signals>{}</signals>", many(light, 6_000)),
            ),
            "at most 5000 are read",
        ),
    ];
    for (edit, says) in cases {
        assert_says(&refused(&[edit]), says);
    }
}

#[test]
fn a_light_beside_a_run_without_end_has_a_schedule_of_some_length() {
    let controller = r#"<TrafficSignals><TrafficSignalController name="c"><Phase name="a" duration="0.3"><TrafficSignalState trafficSignalId="7" state="red"/></Phase><Phase name="b" duration="0.3"><TrafficSignalState trafficSignalId="7" state="green"/></Phase></TrafficSignalController></TrafficSignals>"#;
    let stands = r#"<AbsoluteTargetSpeed value="0"/>"#;
    let edits = [
        edit("<!--network-->", controller),
        edit(
            "<!--signals-->",
            r#"<signals><signal id="7" s="300" t="-2" dynamic="yes" orientation="+" name="x"/></signals>"#,
        ),
        edit(
            r#"<SimulationTimeCondition value="12""#,
            r#"<SimulationTimeCondition value="1e9""#,
        ),
        edit(r#"<AbsoluteTargetSpeed value="20"/>"#, stands),
        edit(r#"<AbsoluteTargetSpeed value="10"/>"#, stands),
        edit(r#"<AbsoluteTargetSpeed value="4"/>"#, stands),
    ];
    let imported = import(&files(&edits)).expect("a text");
    // A world refuses so many phases, which is said of an element of the file.
    let world = &imported.worlds[0];
    assert!(world.text.len() < 2_000_000);
    let error = Scenario::parse("small.ron", &world.text).expect_err("too long");
    let places: Vec<String> = error
        .problems
        .iter()
        .filter_map(|problem| {
            let at = world.refused(problem.span.start, "")?.element?;
            Some(at.0)
        })
        .collect();
    assert_eq!(places.len(), error.problems.len(), "{places:?}");
}

#[test]
fn the_values_of_all_points_are_bounded_together() {
    let mut files = files(&[]);
    let one =
        |number: usize| format!(r#"<ParameterAssignment parameterRef="p{number}" value="1"/>"#);
    let set: String = (0..200).map(one).collect();
    files.push((
        "points.xosc",
        format!(
            r#"<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="base.xosc"/><Deterministic><DeterministicMultiParameterDistribution><ValueSetDistribution><ParameterValueSet>{set}</ParameterValueSet></ValueSetDistribution></DeterministicMultiParameterDistribution><DeterministicSingleParameterDistribution parameterName="q"><DistributionRange stepWidth="1"><Range lowerLimit="0" upperLimit="99000"/></DistributionRange></DeterministicSingleParameterDistribution></Deterministic></ParameterValueDistribution></OpenSCENARIO>"#
        ),
    ));
    let read = |path: &Path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path);
        let text = found.map(|(_, text)| text.clone());
        text.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
    };
    let error = brakecheck::openx::import::points_of(Path::new("points.xosc"), &read);
    assert_says(&error.expect_err("too many"), "values of all points");
}
