//! What an import refuses, bounds or lists: all of it at once, by line and with a fix.

use super::*;

fn standing() -> Edit {
    edit(LEAD_SPEED, STANDING)
}

fn stop(value: f64, rule: &str, edge: &str) -> String {
    format!(
        r#"<Condition name="stop" delay="0" conditionEdge="{edge}"><ByValueCondition><SimulationTimeCondition value="{value}" rule="{rule}"/></ByValueCondition></Condition>"#
    )
}

#[test]
fn a_standing_entity_changes_its_lane_once_it_drives() {
    let change = lane_change("sinusoidal", "time", 3.0);
    let later = time(6.0, "none", 0.0);
    let edits = [standing(), does(&change), beside(&later, FASTER)];
    let episode = run(&world(&imported(&edits)));
    assert_eq!(off(&episode, "lead", (6.0, 150.0, 0.0)), None);
    let (x_m, y_m) = at(&episode, "lead", 11.5);
    // Of the 30 m that it has driven, the change takes some of the first.
    assert!(
        (y_m - 3.5).abs() < 0.01 && (178.0..179.5).contains(&x_m),
        "{x_m} {y_m}"
    );
    table! {
        "an event that replaces the change stops it before it has begun to move":
            [standing(), does(&change), second(&later, FASTER)] => lead([(11.0, 175.0, 0.0)]);
    }
}

#[test]
fn an_action_has_one_part() {
    let change = lane_change("linear", "distance", 40.0);
    let both = format!("{SLOWER}</PrivateAction><PrivateAction>{change}");
    let at = |time_s: f64| time(time_s, "none", 0.0);
    table! {
        "in one event with a change of speed": [does(both)] => says("more than one part");
        "after a change of speed": [second(&at(8.5), &change)] => lead([]);
    }
}

#[test]
fn runs_end_where_all_times_of_a_group_hold() {
    let group = |conditions: String| edit(STOP, conditions);
    let at = |time_s: f64| ends(time_s, time_s, []);
    table! {
        "at an instant": [group(stop(7.5, "equalTo", "none"))] => at(7.5);
        "after two times":
            [group(stop(6.0, "greaterThan", "none") + &stop(9.0, "greaterThan", "rising"))] => at(9.0);
        "between two times":
            [group(stop(5.0, "greaterOrEqual", "none") + &stop(90.0, "lessThan", "none"))] => at(5.0);
        "at the end of a time": [group(stop(8.0, "lessThan", "falling"))] => at(8.0);
        // These never hold together, so the run is as long as without them.
        "never":
            [group(stop(5.0, "equalTo", "none") + &stop(9.0, "greaterThan", "none"))]
            => drops(["stop conditions"]);
    }
}

#[test]
fn what_is_read_otherwise_than_by_players_is_listed() {
    let walker = r#"<Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian" model="x"><BoundingBox><Center x="0.06" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/></BoundingBox><Properties/></Pedestrian>"#;
    let turned = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"><Orientation type="relative" h="1.5707963"/></LanePosition>"#;
    let walks = |place: &str| {
        let walker = format!(r#"<ScenarioObject name="Lead">{walker}"#);
        [
            edit(lead_object("<!--lead object-->"), walker),
            edit(LEAD, place),
            edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="1.5"/>"#),
        ]
    };
    table! {
        "a meeting": [standing(), from_start(MEETING)]
            => drops(["the approach of a meeting before its steady part"]);
        "a walker across its lane": [walks(turned)]
            => drops(["the direction of a lane for pedestrians that face across it"]);
        "a walker along its lane": [walks(LEAD)] => drops([]);
        "a vehicle that faces off its lane": [edit(LEAD, turned)]
            => drops(["headings of vehicles off the lane that they follow"]);
        "a vehicle on no lane": [edit(LEAD, r#"<WorldPosition x="150" y="-40" h="0.5"/>"#)]
            => drops(["roads beside agents on no lane, who go straight ahead"]);
        "a place by a road beside oncoming traffic":
            [edit(LEAD, r#"<RoadPosition roadId="0" s="150" t="1.75"/>"#)]
            => drops(["players that turn places by a road along their lane"]);
        // Its metres are no number of lanes, of which the world has fewer.
        "an offset from the ego's lane": [does(CENTRE.replace(
            r#"<AbsoluteTargetLaneOffset value="0"/>"#,
            r#"<RelativeTargetLaneOffset entityRef="Ego" value="-3"/>"#,
        ))] => drops([]);
        "a limit of jerk": [does(profile(&[(2.0, 4.0)]).replace("<DynamicConstraints", r#"<DynamicConstraints maxAccelerationRate="4""#))]
            => drops(["limits of the rate of acceleration"]);
    }
}

#[test]
fn one_message_names_all_that_is_not_read() {
    let edits = [
        ego_at(5000.0),
        edit(
            r#"dynamicsShape="linear" dynamicsDimension="rate" value="1""#,
            r#"dynamicsShape="odd" dynamicsDimension="rate" value="1""#,
        ),
        second(&time(9.0, "odd", 0.0), &lane_change("wavy", "time", 3.0)),
    ];
    let error = refused(&edits);
    assert_names(&error, 4, &["5000 m along", "this shape", "no edge `odd`"]);
    assert_eq!(error.to_string().lines().count(), 4);
}

#[test]
fn the_effects_of_a_problem_are_no_problems_of_their_own() {
    // The lead has no place, so what refers to it cannot be read either.
    let edits = [
        edit(LEAD_S, r#"laneId="-7" s="150""#),
        first(nearer(20.0, "none")),
    ];
    let error = refused(&edits);
    assert_eq!(error.all().count(), 1, "{error}");
    let help = error.help.as_deref();
    assert!(
        help.is_some_and(|it| it.contains("1, 0, -1, -2")),
        "{error:?}"
    );
}

#[test]
fn an_ego_without_a_place_is_named() {
    let private = |name: &str| format!(r#"<Private entityRef="{name}">"#);
    // The edits apply one after the other, so that neither is the ego's.
    let others = [
        edit(private("Ego"), private("Lead")),
        edit(private("Lead"), private("Other")),
    ];
    let shown = refused(&others).to_string();
    assert!(shown.contains("no agent has this name"), "{shown}");
    let begin = private("Ego");
    let (_, rest) = BASE.split_once(&begin).expect("it begins");
    let (inner, _) = rest.split_once("</Private>").expect("it ends");
    let error = refused(&[edit(format!("{begin}{inner}</Private>"), "")]);
    assert_eq!(error.what, "the ego is never placed");
}

#[test]
fn an_ego_on_a_shoulder_without_driving_lanes_is_read() {
    let shoulder = |id: &str| {
        let driving = format!(r#"<lane id="{id}" type="driving">"#);
        let shoulder = driving.replace("driving", "shoulder");
        edit(driving, shoulder)
    };
    table! {
        "two shoulders": [shoulder("-1"), shoulder("-2")] => lead([]);
    }
}

#[test]
fn numbers_that_would_flood_or_break_the_import_are_refused_by_line() {
    let piece = |shape: &str, length: &str| {
        let text =
            format!(r#"<geometry s="0" x="0" y="0" hdg="0" length="{length}">{shape}</geometry>"#);
        edit(PLAN, text)
    };
    let cubic = |b_u: &str, c_v: &str, d_v: &str| {
        format!(
            r#"<paramPoly3 pRange="arcLength" aU="0" bU="{b_u}" cU="0" dU="0" aV="0" bV="0" cV="{c_v}" dV="{d_v}"/>"#
        )
    };
    let nowhere = r#"<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>"#;
    let lanes = |count: usize| {
        let lane = |id: usize| {
            format!(
                r#"<lane id="{id}" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>"#
            )
        };
        let lanes: String = (1..=count).map(lane).collect();
        edit("<left>", format!("<left>{lanes}"))
    };
    let left = |id: &str| edit(r#"<lane id="1" type"#, format!(r#"<lane id="{id}" type"#));
    let ego_on = |place: &str| edit(r#"laneId="-1" s="50""#, place);
    let relative = |value: &str| {
        aims_at(&format!(
            r#"<RelativeTargetSpeed entityRef="Ego" value="{value}" speedTargetValueType="delta" continuous="false"/>"#
        ))
    };
    let far = r#"<poly3 a="0" b="0" c="0.001" d="1e-6"/>"#;
    let second_road = format!("<road {}</OpenDRIVE>", straight_road());
    table! {
        "a curvature of 1e308":
            [piece(r#"<spiral curvStart="0" curvEnd="1e308"/>"#, "1000")] => says("`curvEnd` is 1e308");
        "a curvature of -1e300":
            [piece(r#"<spiral curvStart="-1e300" curvEnd="1e300"/>"#, "1000")] => says("`curvStart` is -1e300");
        "a spiral round and round":
            [piece(r#"<spiral curvStart="-900" curvEnd="900"/>"#, "1000")]
            => says("a curvature from -900 to 900");
        "an arc round and round":
            [piece(r#"<arc curvature="999"/>"#, "1000")] => says("a curvature from 999");
        "a line without end": [piece("<line/>", "1e300")] => says("`length` is 1e300");
        "a line backwards": [piece("<line/>", "-5")] => says("`length` is -5");
        "a polynomial without end": [piece(far, "2e5")] => says("`length` is 2e5");
        "a polynomial of zeros": [piece(nowhere, "1000")] => says("lead nowhere");
        "a polynomial that bends":
            [piece(&cubic("1", "1e9", "1e11"), "1000")] => says("more than 10000 arcs");
        "half a lane": [left("1.5")] => says("no number of a lane");
        "a lane of the least number": [left("-2147483648")] => says("no number of a lane");
        "a place on half a lane": [ego_on(r#"laneId="-1.5" s="50""#)] => says("no number of a lane");
        "a place on a lane too large":
            [ego_on(r#"laneId="2147483648" s="50""#)] => says("no number of a lane");
        "a place without end": [ego_on(r#"laneId="-1" s="1e300""#)] => says("`s` is 1e300");
        "lanes without end": [lanes(20_000)] => says("at most 200 are read");
        "a speed without end":
            [edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="1e300"/>"#)] => says("`value` is 1e300");
        "a second road of one name": [edit("</OpenDRIVE>", second_road)] => says("a second road");
        "a speed below that of another": [relative("-25")] => says("a speed of -5 m/s");
        "a speed above 0 below that of another": [relative("-15")] => lead([]);
        "an event that is never carried out": [carried_out("0")] => says("carried out 0 times");
        "an event carried out -1 times": [carried_out("-1")] => says("carried out -1 times");
        "an event carried out in part": [carried_out("1.5")] => says("carried out 1.5 times");
    }
}

fn carried_out(count: &str) -> Edit {
    let priority = r#"priority="override" maximumExecutionCount="#;
    edit(
        format!(r#"{priority}"1""#),
        format!(r#"{priority}"{count}""#),
    )
}
