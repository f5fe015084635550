//! Files that would flood, loop or overflow the import are refused by line, or read.

use super::*;
use brakecheck::openx::import::points_of;

/// A light on the ego's way.
pub const LIGHT: &str = r#"<signal id="7" s="300" t="-2" dynamic="yes" orientation="+" name="x"/>"#;
const LEFT: &str =
    r#"<lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>"#;
const LANE: &str =
    r#"<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>"#;

/// An ego that comes to a road that is linked to itself.
fn ring(length_m: &str) -> Vec<Edit> {
    let link = r#"<link><predecessor elementType="road" elementId="1" contactPoint="end"/></link>"#;
    let linked = LEFT.replace("<width", r#"<link><predecessor id="1"/></link><width"#);
    let ring = straight_road()
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
        edit(LEAD, on_route("one")),
    ]);
    let (one, two) = (route("one", "two"), route("two", "one"));
    files.push((
        "./Routes.xosc",
        format!(r#"<OpenSCENARIO><Catalog name="Routes">{one}{two}</Catalog></OpenSCENARIO>"#),
    ));
    let error = import(&files).expect_err("a circle");
    assert_names(&error, 1, &["refer to each other in a circle"]);
}

#[test]
fn elements_that_contradict_each_other_or_are_too_many_are_refused() {
    let sections = format!(
        r#"</laneSection><laneSection s="500"><right>{LANE}</right></laneSection><laneSection s="400"><right>{LANE}</right></laneSection>"#
    );
    let object = |name: &str| format!(r#"<ScenarioObject name="{name}">"#);
    let before = |element: &str, many: &str| edit(element, many.repeat(2_000) + element);
    let signals = format!("<signals>{}</signals>", LIGHT.repeat(6_000));
    table! {
        "a ring without a length": [ring("0")] => says("roads and sections");
        "a ring of 1e-300 m": [ring("1e-300")] => says("roads and sections");
        "a ring of 1 nm": [ring("1e-9")] => says("roads and sections");
        "a lane twice": [edit(LANE, format!("{LANE}{LANE}"))] => says("a second lane -1");
        "a width below 0": [edit(LANE, LANE.replace("3.5", "-3.5"))] => says("a width of -3.500 m");
        "a width below 0 at the end of the road":
            [edit(LANE, LANE.replace(r#"b="0""#, r#"b="-0.01""#))] => says("a width of -6.500 m");
        "sections that go back": [edit("</laneSection>", sections)] => says("before the one ahead of it");
        "an entity twice": [edit(object("Lead"), object("Ego"))] => says("a second entity");
        "acts without end":
            [before(r#"<Act name="act">"#, r#"<Act name="a"/>"#)] => says("more than 1000 elements");
        "maneuvers without end":
            [before(r#"<Maneuver name="maneuver">"#, r#"<Maneuver name="x"/>"#)]
            => says("more than 1000 elements");
        "lights without end": [edit("<!--signals-->", signals)] => says("at most 5000 are read");
    }
}

#[test]
fn pieces_without_a_length_are_left_out() {
    let none = r#"<geometry s="0" x="0" y="0" hdg="0" length="0"><line/></geometry>"#;
    let last = r#"<geometry s="1000" x="1000" y="0" hdg="0" length="0"><line/></geometry>"#;
    let with = imported(&[edit(PLAN, format!("{none}{PLAN}{last}"))]);
    assert_eq!(with.worlds[0].text, imported(&[]).worlds[0].text);
}

#[test]
fn a_light_beside_a_run_without_end_has_a_schedule_of_some_length() {
    let controller = r#"<TrafficSignals><TrafficSignalController name="c"><Phase name="a" duration="0.3"><TrafficSignalState trafficSignalId="7" state="red"/></Phase><Phase name="b" duration="0.3"><TrafficSignalState trafficSignalId="7" state="green"/></Phase></TrafficSignalController></TrafficSignals>"#;
    let edits = [
        edit("<!--network-->", controller),
        edit("<!--signals-->", format!("<signals>{LIGHT}</signals>")),
        until("1e9"),
        edit(r#"<AbsoluteTargetSpeed value="20"/>"#, STANDING),
        edit(LEAD_SPEED, STANDING),
        edit(LATER_SPEED, STANDING),
    ];
    let imported = imported(&edits);
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
    let error = points_of(Path::new("points.xosc"), &|path| text_of(&files, path));
    let error = error.expect_err("too many");
    assert_names(&error, 1, &["values of all points"]);
}
