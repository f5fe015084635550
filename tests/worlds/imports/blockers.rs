//! One message names all problems of an import, and what is not read before they are mended.

use super::*;

/// The lead as an entry of a catalog that is not there.
fn in_catalog() -> Edit {
    let reference = r#"<CatalogReference catalogName="Cars" entryName="sedan"/>"#;
    let object = format!(r#"<ScenarioObject name="Lead">{reference}"#);
    edit(lead_object("<!--lead object-->"), object)
}

#[test]
fn an_unknown_condition_a_missing_catalog_and_a_place_off_the_road_are_one_message() {
    let edits = [in_catalog(), lead_at(5000.0), first(UNKNOWN)];
    let error = refused(&edits);
    assert_names(
        &error,
        3,
        &[
            "no catalog `Cars.xosc`",
            "5000 m along",
            "condition of this kind",
        ],
    );
    assert_eq!(error.unread_part(), None);
}

#[test]
fn a_missing_road_file_hides_only_what_lies_on_its_roads() {
    let edits = [
        in_catalog(),
        edit(r#"filepath="straight.xodr""#, r#"filepath="lost.xodr""#),
        lead_at(5000.0),
        first(UNKNOWN),
        does(CHANGE.replace("sinusoidal", "odd")),
    ];
    let error = refused(&edits);
    let shown = error.to_string();
    for says in [
        "lost.xodr",
        "no catalog `Cars.xosc`",
        "condition of this kind",
    ] {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    assert!(!shown.contains("no road"), "{shown}");
    assert!(
        shown.ends_with("not read before that: places and motion on the roads"),
        "{shown}"
    );
}

#[test]
fn problems_of_events_beside_one_another_are_all_named() {
    let odd = SLOWER.replace(r#"dynamicsShape="linear""#, r#"dynamicsShape="odd""#);
    let both = format!("{SLOWER}</PrivateAction><PrivateAction>{SLOWER}");
    let edits = [
        // An action with two parts and an unknown condition in one event, then another.
        does(both),
        first(UNKNOWN),
        second(&time(9.0, "odd", 0.0), &odd),
        edit(
            "<!--global-->",
            "<GlobalAction><SetMonitorAction/></GlobalAction><UserDefinedAction/>",
        ),
        lead_init(
            "<LateralAction><LateralDistanceAction/></LateralAction></PrivateAction><PrivateAction><RoutingAction><AcquirePositionAction/></RoutingAction>",
        ),
    ];
    let error = refused(&edits);
    let shown = error.to_string();
    for says in [
        "more than one part",
        "condition of this kind",
        "no edge `odd`",
        "SetMonitorAction",
        "UserDefinedAction",
        "LateralDistanceAction",
        "AcquirePositionAction",
    ] {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    assert!(error.all().all(|it| it.help.is_some()), "{error:?}");
}

#[test]
fn problems_of_the_roads_stand_beside_those_of_the_storyboard() {
    let edits = [
        first(UNKNOWN),
        // Steeper than a world allows.
        edit(
            "<elevationProfile/>",
            r#"<elevationProfile><elevation s="0" a="0" b="0.9" c="0" d="0"/></elevationProfile>"#,
        ),
    ];
    assert_names(
        &refused(&edits),
        2,
        &["condition of this kind", "it rises by 0.90"],
    );
}

#[test]
fn without_an_ego_the_rest_is_not_read_and_that_is_said() {
    let edits = [
        edit(
            r#"<ScenarioObject name="Ego">"#,
            r#"<ScenarioObject name="Hero">"#,
        ),
        first(UNKNOWN),
    ];
    let error = refused(&edits);
    assert_names(&error, 1, &["no agent is called `Ego`"]);
    assert_eq!(error.unread_part(), Some("the rest of the scenario"));
    assert!(
        error
            .help
            .as_deref()
            .is_some_and(|it| it.contains("Hero, Lead")),
        "{error:?}"
    );
}

#[test]
fn every_point_with_a_problem_is_named() {
    let mut files = files(&[
        edit(
            "<ParameterDeclarations/>\n  <CatalogLocations/>",
            "<ParameterDeclarations><ParameterDeclaration name=\"s\" parameterType=\"double\" value=\"150\"/></ParameterDeclarations>\n  <CatalogLocations/>",
        ),
        edit(LEAD_S, r#"laneId="-2" s="$s""#),
    ]);
    let set = ["150", "2000", "160", "3000"].map(|it| format!(r#"<Element value="{it}"/>"#));
    files.push((
        "points.xosc",
        format!(
            r#"<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="base.xosc"/><Deterministic><DeterministicSingleParameterDistribution parameterName="s"><DistributionSet>{}</DistributionSet></DeterministicSingleParameterDistribution></Deterministic></ParameterValueDistribution></OpenSCENARIO>"#,
            set.concat()
        ),
    ));
    let mut import = at_points();
    let error = import_as(&import, &files).expect_err("two points");
    assert_names(&error, 2, &["2000 m along", "3000 m along"]);
    let points: Vec<_> = error
        .all()
        .map(|it| it.point.as_ref().map(|it| it.0))
        .collect();
    assert_eq!(points, [Some(1), Some(3)]);
    import.skips_broken = true;
    let imported = import_as(&import, &files).expect("the other two");
    assert_eq!((imported.broken, imported.worlds[0].points.len()), (2, 2));
}

#[test]
fn what_a_world_does_not_allow_is_named_where_the_files_say_it() {
    let cases = [
        // A body too short, by its vehicle, and a wait too long, by its event.
        (
            edit(r#"length="4.4""#, r#"length="0.01""#),
            "Vehicle `sedan`",
            "<!--ego vehicle-->",
        ),
        (
            first(time(2e6, "none", 0.0)),
            "Event `first`",
            r#"<Event name="first""#,
        ),
    ];
    for (edit, element, text) in cases {
        let imported = imported(&[edit]);
        let world = &imported.worlds[0];
        let error = Scenario::parse("small.ron", &world.text).expect_err("not allowed");
        let offset = error.problems[0].span.start;
        let shown = world
            .refused(offset, "too much")
            .expect("a place")
            .to_string();
        assert!(
            shown.contains(element) && shown.contains("base.xosc"),
            "{shown}"
        );
        let (before, _) = BASE.split_once(text).expect("the element");
        let line = before.lines().count();
        let named = world
            .refused(offset, "")
            .and_then(|it| it.element)
            .expect("a line")
            .1;
        // The end of its opening tag, within the element.
        assert!(named <= line && line < named + 12, "{named} {line}");
    }
}

#[test]
fn an_entity_that_is_off_its_road_at_once_is_named() {
    let fast = || edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="60"/>"#);
    table! {
        "a fast lead at the end of its road":
            [fast(), lead_at(999.0)] => says("leaves its road after");
        "its name": [fast(), lead_at(999.0)] => says("Private `Lead`");
    }
}
