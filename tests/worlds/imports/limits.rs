//! What an import refuses, bounds or lists: all of it at once, by line and with a fix.

use super::*;

const LEAD_SPEED: &str = r#"<AbsoluteTargetSpeed value="10"/>"#;
const STOP: &str = r#"<Condition name="stop" delay="0" conditionEdge="none"><ByValueCondition><SimulationTimeCondition value="12" rule="greaterThan"/></ByValueCondition></Condition>"#;
const PLAN: &str = r#"<geometry s="0" x="0" y="0" hdg="0" length="1000"><line/></geometry>"#;

fn standing() -> Edit {
    edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="0"/>"#)
}

fn refused(edits: &[Edit]) -> ImportError {
    import(&files(edits)).expect_err("it is refused")
}

fn stop(value: f64, rule: &str, edge: &str) -> String {
    format!(
        r#"<Condition name="stop" delay="0" conditionEdge="{edge}"><ByValueCondition><SimulationTimeCondition value="{value}" rule="{rule}"/></ByValueCondition></Condition>"#
    )
}

#[test]
fn a_standing_entity_changes_its_lane_once_it_drives() {
    let change = lane_change("sinusoidal", "time", 3.0);
    let edits = [
        standing(),
        edit(SLOWER, &change),
        beside(&time(6.0, "none", 0.0), FASTER),
    ];
    let episode = run(&world(&import(&files(&edits)).expect("read")));
    let off = off(&episode, "lead", (6.0, 150.0, 0.0));
    assert_eq!(off, None);
    let (x_m, y_m) = at(&episode, "lead", 11.5);
    // Of the 30 m that it has driven, the change takes some of the first.
    assert!(
        (y_m - 3.5).abs() < 0.01 && (178.0..179.5).contains(&x_m),
        "{x_m} {y_m}"
    );
    // An event that replaces the change stops it before it has begun to move.
    let edits = [
        standing(),
        edit(SLOWER, &change),
        second(&time(6.0, "none", 0.0), FASTER),
    ];
    let episode = run(&world(&import(&files(&edits)).expect("read")));
    assert_eq!(super::off(&episode, "lead", (11.0, 175.0, 0.0)), None);
}

#[test]
fn lane_changes_by_distance_take_a_speed_that_stays() {
    let change = lane_change("linear", "distance", 40.0);
    let says = "by distance beside a change of speed";
    let cases = [
        vec![beside(&time(2.5, "none", 0.0), &change)],
        vec![
            edit(SLOWER, &change),
            beside(&time(3.0, "none", 0.0), FASTER),
        ],
    ];
    for edits in &cases {
        let error = refused(edits);
        assert!(error.what.contains(says), "{error}");
    }
    let both = format!("{SLOWER}</PrivateAction><PrivateAction>{change}");
    let error = refused(&[edit(SLOWER, both)]);
    assert!(error.what.contains("more than one part"), "{error}");
    let later = [second(&time(8.5, "none", 0.0), &change)];
    assert!(import(&files(&later)).is_ok());
}

#[test]
fn runs_end_where_all_times_of_a_group_hold() {
    let cases = [
        (stop(7.5, "equalTo", "none"), "7.5"),
        (
            stop(6.0, "greaterThan", "none") + &stop(9.0, "greaterThan", "rising"),
            "9.0",
        ),
        (
            stop(5.0, "greaterOrEqual", "none") + &stop(90.0, "lessThan", "none"),
            "5.0",
        ),
        (stop(8.0, "lessThan", "falling"), "8.0"),
        // These never hold together, so the run is as long as without them.
        (
            stop(5.0, "equalTo", "none") + &stop(9.0, "greaterThan", "none"),
            "46",
        ),
    ];
    for (conditions, horizon_s) in cases {
        let imported = import(&files(&[edit(STOP, &conditions)])).expect("read");
        let text = &imported.worlds[0].text;
        let is_never = horizon_s == "46";
        let says = format!("horizon_s: {horizon_s},");
        assert!(is_never || text.contains(&says), "{conditions}\n{text}");
        let listed = imported
            .dropped
            .iter()
            .any(|it| it.kind == "stop conditions");
        assert_eq!(listed, is_never, "{conditions}");
    }
}

#[test]
fn a_speed_below_that_of_another_is_never_negative() {
    let relative = r#"<RelativeTargetSpeed entityRef="Ego" value="-25" speedTargetValueType="delta" continuous="false"/>"#;
    let edits = |value: &str| {
        let target = relative.replace("-25", value);
        let action = SLOWER.replace(r#"<AbsoluteTargetSpeed value="4"/>"#, &target);
        vec![edit(SLOWER, action)]
    };
    assert!(refused(&edits("-25")).what.contains("a speed of -5 m/s"));
    assert!(import(&files(&edits("-15"))).is_ok());
}

#[test]
fn what_is_read_otherwise_than_by_players_is_listed() {
    let kinds = |edits: &[Edit]| -> Vec<&'static str> {
        let imported = import(&files(edits)).expect("read");
        imported.dropped.iter().map(|it| it.kind).collect()
    };
    let meets = [
        standing(),
        edit(FIRST, time(0.0, "none", 0.0)),
        edit(SLOWER, MEETING),
    ];
    assert_eq!(
        kinds(&meets),
        ["the approach of a meeting before its steady part"]
    );
    let (_, lead) = BASE
        .split_once(r#"<ScenarioObject name="Lead">"#)
        .expect("an object");
    let (vehicle, _) = lead.split_once("<!--lead object-->").expect("its end");
    let walker = r#"<Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian" model="x"><BoundingBox><Center x="0.06" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/></BoundingBox><Properties/></Pedestrian>"#;
    let object = |inner: &str| format!(r#"<ScenarioObject name="Lead">{inner}<!--lead object-->"#);
    // The texts live as long as the test.
    let vehicle: &'static str = Box::leak(object(vehicle).into_boxed_str());
    let place = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#;
    let turned = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"><Orientation type="relative" h="1.5707963"/></LanePosition>"#;
    let walks = |place_of: &str| {
        vec![
            edit(vehicle, object(walker)),
            edit(place, place_of),
            edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="1.5"/>"#),
        ]
    };
    let across = "the direction of a lane for pedestrians that face across it";
    assert_eq!(kinds(&walks(turned)), [across]);
    assert_eq!(kinds(&walks(place)), Vec::<&str>::new());
}

#[test]
fn one_message_names_all_that_is_not_read() {
    let wrong = lane_change("wavy", "time", 3.0);
    let edits = [
        edit(r#"laneId="-1" s="50""#, r#"laneId="-1" s="5000""#),
        edit(
            r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#,
            r#"dynamicsShape="odd" dynamicsDimension="rate" value="1""#,
        ),
        second(&time(9.0, "falling", 0.0), &wrong),
    ];
    let error = refused(&edits);
    let lines: Vec<(&str, usize)> = error
        .all()
        .map(|it| (it.what.as_str(), it.element.as_ref().expect("a line").1))
        .collect();
    assert_eq!(lines.len(), 4, "{error}");
    assert!(
        lines.windows(2).all(|pair| pair[0].1 <= pair[1].1),
        "{lines:?}"
    );
    assert!(error.all().all(|it| it.help.is_some()), "{error:?}");
    assert_eq!(error.to_string().lines().count(), 4);
    for says in ["5000 m along", "this shape", "falling edge"] {
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn the_effects_of_a_problem_are_no_problems_of_their_own() {
    // The lead has no place, so what refers to it cannot be read either.
    let edits = [
        edit(r#"laneId="-2" s="150""#, r#"laneId="-7" s="150""#),
        edit(FIRST, distance(&["Ego"], "lessThan", "none", "any", 20.0)),
    ];
    let error = refused(&edits);
    assert_eq!(error.all().count(), 1, "{error}");
    assert!(
        error
            .help
            .as_deref()
            .is_some_and(|it| it.contains("1, 0, -1, -2")),
        "{error:?}"
    );
}

#[test]
fn an_ego_without_a_place_is_named() {
    let edits = [
        edit(
            r#"<Private entityRef="Ego">"#,
            r#"<Private entityRef="Lead">"#,
        ),
        edit(
            r#"<Private entityRef="Lead">"#,
            r#"<Private entityRef="Other">"#,
        ),
    ];
    // The edits apply one after the other, so that neither is the ego's.
    let error = refused(&edits);
    let says = error.to_string();
    assert!(says.contains("no agent has this name"), "{says}");
    let private = BASE
        .split_once(r#"      <Private entityRef="Ego">"#)
        .expect("it begins")
        .1
        .split_once("</Private>")
        .expect("it ends")
        .0;
    let all: &'static str = Box::leak(
        format!(r#"      <Private entityRef="Ego">{private}</Private>"#).into_boxed_str(),
    );
    let error = refused(&[edit(all, "")]);
    assert_eq!(error.what, "the ego is never placed");
}

#[test]
fn numbers_that_would_flood_or_break_the_import_are_refused_by_line() {
    let piece = |shape: &str, length: &str| {
        let text =
            format!(r#"<geometry s="0" x="0" y="0" hdg="0" length="{length}">{shape}</geometry>"#);
        edit(PLAN, text)
    };
    let many = |count: usize| {
        let lane = |id: usize| {
            format!(
                r#"<lane id="{id}" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>"#
            )
        };
        let lanes: String = (1..=count).map(lane).collect();
        edit("<left>", format!("<left>{lanes}"))
    };
    let far = r#"<poly3 a="0" b="0" c="0.001" d="1e-6"/>"#;
    let cases: Vec<(Edit, &str)> = vec![
        (
            piece(r#"<spiral curvStart="0" curvEnd="1e308"/>"#, "1000"),
            "`curvEnd` is 1e308",
        ),
        (
            piece(r#"<spiral curvStart="-1e300" curvEnd="1e300"/>"#, "1000"),
            "`curvStart` is -1e300",
        ),
        (
            piece(r#"<spiral curvStart="-900" curvEnd="900"/>"#, "1000"),
            "a curvature from -900 to 900",
        ),
        (
            piece(r#"<arc curvature="999"/>"#, "1000"),
            "a curvature from 999",
        ),
        (piece("<line/>", "1e300"), "`length` is 1e300"),
        (piece("<line/>", "-5"), "`length` is -5"),
        (piece(far, "2e5"), "`length` is 2e5"),
        (
            piece(
                r#"<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>"#,
                "1000",
            ),
            "lead nowhere",
        ),
        (
            piece(
                r#"<paramPoly3 pRange="arcLength" aU="0" bU="1" cU="0" dU="0" aV="0" bV="0" cV="1e9" dV="1e11"/>"#,
                "1000",
            ),
            "more than 10000 arcs",
        ),
        (
            edit(r#"<lane id="1" type"#, r#"<lane id="1.5" type"#),
            "no number of a lane",
        ),
        (
            edit(r#"<lane id="1" type"#, r#"<lane id="-2147483648" type"#),
            "no number of a lane",
        ),
        (
            edit(r#"laneId="-1" s="50""#, r#"laneId="-1.5" s="50""#),
            "no number of a lane",
        ),
        (
            edit(r#"laneId="-1" s="50""#, r#"laneId="2147483648" s="50""#),
            "no number of a lane",
        ),
        (
            edit(r#"laneId="-1" s="50""#, r#"laneId="-1" s="1e300""#),
            "`s` is 1e300",
        ),
        (many(20_000), "at most 200 are read"),
        (
            edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="1e300"/>"#),
            "`value` is 1e300",
        ),
    ];
    for (edit, says) in cases {
        let error = refused(&[edit]);
        assert!(error.to_string().contains(says), "{says}: {error}");
        assert!(
            error
                .all()
                .all(|it| it.element.is_some() && it.help.is_some()),
            "{error:?}"
        );
    }
    let (_, road) = ROADS[0].1.split_once("<road ").expect("a road");
    let (road, _) = road.split_once("</OpenDRIVE>").expect("its end");
    let error = refused(&[edit("</OpenDRIVE>", format!("<road {road}</OpenDRIVE>"))]);
    assert!(error.to_string().contains("a second road"), "{error}");
}

#[test]
fn an_ego_on_a_shoulder_without_driving_lanes_is_read() {
    let shoulders = |id: &'static str| {
        let driving: &'static str =
            Box::leak(format!(r#"<lane id="{id}" type="driving">"#).into_boxed_str());
        edit(driving, driving.replace("driving", "shoulder"))
    };
    let imported = import(&files(&[shoulders("-1"), shoulders("-2")])).expect("read");
    run(&world(&imported));
}
