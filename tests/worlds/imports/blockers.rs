//! One message names all problems of an import, and what is not read before they are mended.

use super::*;

const LEAD_PLACE: &str = r#"laneId="-2" s="150""#;
const LEAD_SPEED: &str = r#"<AbsoluteTargetSpeed value="10"/>"#;
const UNKNOWN: &str = r#"<Condition name="u" delay="0" conditionEdge="none"><ByValueCondition><UserDefinedValueCondition name="x" rule="equalTo" value="1"/></ByValueCondition></Condition>"#;

fn refused(edits: &[Edit]) -> ImportError {
    import(&files(edits)).expect_err("it is refused")
}

/// The lead as an entry of a catalog that is not there.
fn in_catalog() -> Edit {
    let (_, lead) = BASE
        .split_once(r#"<ScenarioObject name="Lead">"#)
        .expect("the lead");
    let (vehicle, _) = lead.split_once("<!--lead object-->").expect("its end");
    let whole = format!(r#"<ScenarioObject name="Lead">{vehicle}"#);
    // The text lives as long as the test.
    let whole: &'static str = Box::leak(whole.into_boxed_str());
    edit(
        whole,
        r#"<ScenarioObject name="Lead"><CatalogReference catalogName="Cars" entryName="sedan"/>"#,
    )
}

/// Asserts that each problem is named once, with a line and a fix, in the order of the file.
fn assert_names(error: &ImportError, says: &[&str]) {
    let all: Vec<&ImportError> = error.all().collect();
    assert_eq!(all.len(), says.len(), "{error}");
    for says in says {
        assert!(
            all.iter().any(|it| it.what.contains(says)),
            "{says}: {error}"
        );
    }
    for it in &all {
        assert!(it.help.is_some() && it.element.is_some(), "{it:?}");
    }
    let lines: Vec<_> = all
        .iter()
        .map(|it| (&it.file, it.element.as_ref().map(|it| it.1)))
        .collect();
    assert!(lines.is_sorted(), "{lines:?}");
}

#[test]
fn an_unknown_condition_a_missing_catalog_and_a_place_off_the_road_are_one_message() {
    let edits = [
        in_catalog(),
        edit(LEAD_PLACE, r#"laneId="-2" s="5000""#),
        edit(FIRST, UNKNOWN),
    ];
    let error = refused(&edits);
    assert_names(
        &error,
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
        edit(LEAD_PLACE, r#"laneId="-2" s="5000""#),
        edit(FIRST, UNKNOWN),
        edit(SLOWER, CHANGE.replace("sinusoidal", "odd")),
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
        edit(SLOWER, both),
        edit(FIRST, UNKNOWN),
        second(&time(9.0, "falling", 0.0), &odd),
        edit(
            "<!--global-->",
            "<GlobalAction><SetMonitorAction/></GlobalAction><UserDefinedAction/>",
        ),
        edit(
            "<!--lead init-->",
            "<PrivateAction><LateralAction><LateralDistanceAction/></LateralAction></PrivateAction><PrivateAction><RoutingAction><AcquirePositionAction/></RoutingAction></PrivateAction>",
        ),
    ];
    let error = refused(&edits);
    let shown = error.to_string();
    for says in [
        "more than one part",
        "condition of this kind",
        "falling edge",
        "SetMonitorAction",
        "UserDefinedAction",
        "LateralAction",
        "AcquirePositionAction",
    ] {
        assert!(shown.contains(says), "{says}: {shown}");
    }
    assert!(error.all().all(|it| it.help.is_some()), "{error:?}");
}

#[test]
fn problems_of_the_roads_stand_beside_those_of_the_storyboard() {
    let edits = [
        edit(FIRST, UNKNOWN),
        // Steeper than a world allows.
        edit(
            "<elevationProfile/>",
            r#"<elevationProfile><elevation s="0" a="0" b="0.9" c="0" d="0"/></elevationProfile>"#,
        ),
    ];
    assert_names(
        &refused(&edits),
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
        edit(FIRST, UNKNOWN),
    ];
    let error = refused(&edits);
    assert_names(&error, &["no agent is called `Ego`"]);
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
        edit(LEAD_PLACE, r#"laneId="-2" s="$s""#),
    ]);
    let set = ["150", "2000", "160", "3000"].map(|it| format!(r#"<Element value="{it}"/>"#));
    files.push((
        "points.xosc",
        format!(
            r#"<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="base.xosc"/><Deterministic><DeterministicSingleParameterDistribution parameterName="s"><DistributionSet>{}</DistributionSet></DeterministicSingleParameterDistribution></Deterministic></ParameterValueDistribution></OpenSCENARIO>"#,
            set.concat()
        ),
    ));
    let mut import = Import {
        scenario: Path::new("base.xosc"),
        points: Some(Path::new("points.xosc")),
        only: None,
        skips_broken: false,
        name: "small",
        ado: None,
        ego: None,
        leaves_ego: false,
        maps: &[],
    };
    let read = |path: &Path| {
        let found = files.iter().find(|(name, _)| Path::new(name) == path);
        let text = found.map(|(_, text)| text.clone());
        text.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
    };
    let error = import.read(&read).expect_err("two points");
    assert_names(&error, &["2000 m along", "3000 m along"]);
    let points: Vec<_> = error
        .all()
        .map(|it| it.point.as_ref().map(|it| it.0))
        .collect();
    assert_eq!(points, [Some(1), Some(3)]);
    import.skips_broken = true;
    let imported = import.read(&read).expect("the other two");
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
            edit(FIRST, time(1e6, "none", 0.0)),
            "Event `first`",
            r#"<Event name="first""#,
        ),
    ];
    for (edit, element, text) in cases {
        let imported = import(&files(&[edit])).expect("a text");
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
    let edits = [
        edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="60"/>"#),
        edit(LEAD_PLACE, r#"laneId="-2" s="999""#),
    ];
    let error = refused(&edits);
    assert!(error.what.contains("leaves its road after"), "{error}");
    assert!(error.to_string().contains("Private `Lead`"), "{error}");
}
