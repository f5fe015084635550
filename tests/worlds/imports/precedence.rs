//! Which of two statements of a file counts: priorities, defaults and names.
//!
//! esmini 3.6 moves the entities alike.

use super::*;

const LEAD: &str = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#;
/// Between two groups of conditions.
const OR: &str = "</ConditionGroup><ConditionGroup>";
const FACES_AHEAD: &str = r#"<Orientation h="0"/>"#;

/// Events of the entities in turn.
fn events(first: &str, at_s: f64, second_action: &str) -> Vec<Edit> {
    vec![
        edit(SLOWER, first),
        second(&time(at_s, "none", 0.0), second_action),
    ]
}

#[test]
fn what_counts_of_two_statements_moves_the_lead() {
    let on_left = |inner: &str| {
        let place = r#"<LanePosition roadId="0" laneId="1" s="150">"#;
        edit(LEAD, format!("{place}{inner}</LanePosition>"))
    };
    let newer = || edit(r#"revMinor="2""#, r#"revMinor="3""#);
    let offset = CENTRE.replace(
        r#"AbsoluteTargetLaneOffset value="0""#,
        r#"AbsoluteTargetLaneOffset value="1""#,
    );
    let itself = |value: &str, more: &str| {
        let target = format!(r#"<RelativeTargetSpeed entityRef="Lead" value="{value}" {more}/>"#);
        let action = SLOWER.replace(r#"<AbsoluteTargetSpeed value="4"/>"#, &target);
        vec![edit(SLOWER, action)]
    };
    let near = distance(&["Ego"], "lessThan", "none", "any", 20.0);
    // An ego far ahead meets no lead on its lane.
    let far = |mut edits: Vec<Edit>| {
        edits.push(edit(r#"laneId="-1" s="50""#, r#"laneId="-1" s="400""#));
        edits
    };
    type Case = (&'static str, Vec<Edit>, Vec<(f64, f64, f64)>);
    let cases: Vec<Case> = vec![
        (
            "a change of speed stops a change of lane half-way",
            far(events(&lane_change("sinusoidal", "time", 4.0), 4.0, SLOWER)),
            // The slanted way takes 9.5 cm of that along the road.
            vec![(4.0, 189.9052, 1.75), (12.0, 239.9052, 1.75)],
        ),
        (
            "a change of speed stops a lane offset",
            // It takes π·√(1/2) s.
            events(
                &offset,
                2.0 + 0.5 * core::f64::consts::PI * 0.5_f64.sqrt(),
                SLOWER,
            ),
            vec![(12.0, 234.6643, 0.5)],
        ),
        (
            "a change of lane stops a change of speed",
            far(events(SLOWER, 4.0, &lane_change("sinusoidal", "time", 4.0))),
            vec![(12.0, 251.7626, 3.5)],
        ),
        (
            "a change of lane does not stop a change of speed of the Init",
            far(vec![
                edit(
                    r#"dynamicsShape="step" dynamicsDimension="time" value="0"/><!--init dynamics-->"#,
                    r#"dynamicsShape="linear" dynamicsDimension="time" value="5"/>"#,
                ),
                edit(SLOWER, lane_change("sinusoidal", "time", 4.0)),
            ]),
            vec![(12.0, 244.7532, 3.5)],
        ),
        (
            "a speed above the greatest of the body",
            vec![edit(r#"maxSpeed="70""#, r#"maxSpeed="8""#)],
            vec![(2.0, 166.0, 0.0), (12.0, 214.0, 0.0)],
        ),
        (
            "an orientation without a type is absolute up to OpenSCENARIO 1.2",
            vec![on_left(FACES_AHEAD)],
            vec![(12.0, 228.0, 7.0)],
        ),
        (
            "and relative from 1.3 on",
            vec![on_left(FACES_AHEAD), newer()],
            vec![(12.0, 72.0, 7.0)],
        ),
        (
            "a place without a heading faces along its road, also on oncoming lanes",
            vec![edit(LEAD, r#"<WorldPosition x="150" y="1.75"/>"#)],
            vec![(12.0, 228.0, 7.0)],
        ),
        (
            "an event with an empty action changes nothing",
            vec![edit(SLOWER, "")],
            vec![(12.0, 270.0, 0.0)],
        ),
        (
            "two times that must both have come",
            vec![edit(
                FIRST,
                time(2.0, "none", 0.0) + &time(4.0, "none", 0.0),
            )],
            vec![(12.0, 240.0, 0.0)],
        ),
        (
            "a distance after a time that has come before",
            vec![edit(FIRST, time(2.0, "none", 0.0) + &near)],
            vec![(12.0, 260.143, 0.0)],
        ),
        (
            "a time after a distance that was reached before",
            vec![edit(FIRST, time(9.0, "none", 0.0) + &near)],
            vec![(12.0, 265.5, 0.0)],
        ),
        (
            "a time before a distance, of which either is enough",
            vec![edit(FIRST, time(5.0, "none", 0.0) + OR + &near)],
            vec![(12.0, 246.0, 0.0)],
        ),
        (
            "a distance before a time, of which either is enough",
            vec![edit(FIRST, time(9.0, "none", 0.0) + OR + &near)],
            vec![(12.0, 260.143, 0.0)],
        ),
        (
            "a speed that is its own",
            itself("0", r#"speedTargetValueType="delta" continuous="true""#),
            vec![(2.0, 170.0, 0.0), (12.0, 270.0, 0.0)],
        ),
        (
            "the whole of its own speed",
            itself("1", r#"speedTargetValueType="factor" continuous="false""#),
            vec![(12.0, 270.0, 0.0)],
        ),
    ];
    let mut wrong = Vec::new();
    for (name, edits, places) in cases {
        let imported = match import(&files(&edits)) {
            Ok(imported) => imported,
            Err(error) => {
                wrong.push(format!("{name}: {error}"));
                continue;
            }
        };
        let episode = run(&world(&imported));
        let off = places
            .into_iter()
            .filter_map(|place| off(&episode, "lead", place));
        wrong.extend(off.map(|off| format!("{name}: {off}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn bodies_of_one_name_keep_their_sizes() {
    let from = BASE
        .find(r#"<ScenarioObject name="Lead">"#)
        .expect("the lead");
    let to = BASE.find("<!--lead vehicle-->").expect("its end");
    let lead = &BASE[from..to];
    let longer = lead.replace(r#"length="4.4""#, r#"length="6""#);
    let imported = import(&files(&[edit(lead, longer)])).expect("it is read");
    let text = &imported.worlds[0].text;
    for length in ["length_m: 4.4,", "length_m: 6,"] {
        assert!(text.contains(length), "{length} is not in {text}");
    }
    // The rear axle is where the file places it, whatever the body.
    let (x_m, _) = at_by(&run(&world(&imported)), "lead", 2.0, 1.4 + 3.0);
    assert!((x_m - 170.0).abs() < 0.02, "{x_m}");
}

#[test]
fn what_another_player_reads_otherwise_is_refused() {
    let gap = |more: &str| {
        let action = format!(
            r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" distance="30"{more}</LongitudinalDistanceAction></LongitudinalAction>"#
        );
        vec![edit(FIRST, time(0.0, "none", 0.0)), edit(SLOWER, action)]
    };
    let leading = r#" displacement="leadingReferencedEntity">"#;
    let limits = format!(
        r#"{leading}<DynamicConstraints maxSpeed="30" maxAcceleration="5" maxDeceleration="5"/>"#
    );
    let system = |system: &str| {
        let distance = distance(&["Ego"], "lessThan", "none", "any", 20.0);
        let text = format!(r#"relativeDistanceType="longitudinal" coordinateSystem="{system}""#);
        vec![edit(
            FIRST,
            distance.replace(r#"relativeDistanceType="longitudinal""#, &text),
        )]
    };
    let run_times = || {
        let mut edits = vec![edit(SLOWER, timed("absolute", 1.0, 0.0, ""))];
        edits.push(edit(
            r#"<AbsoluteTargetSpeed value="10"/>"#,
            r#"<AbsoluteTargetSpeed value="0"/>"#,
        ));
        edits
    };
    let waiting = || {
        let mut edits = run_times();
        edits.push(edit(
            FIRST,
            distance(&["Ego"], "lessThan", "none", "any", 20.0),
        ));
        edits
    };
    let itself = SLOWER.replace(
        r#"<AbsoluteTargetSpeed value="4"/>"#,
        r#"<RelativeTargetSpeed entityRef="Lead" value="1" speedTargetValueType="delta" continuous="false"/>"#,
    );
    let near = distance(&["Ego"], "lessThan", "none", "any", 20.0);
    let instant = time(2.0, "rising", 0.0) + &near;
    let twice = second(&after("event", "first", 0.0), FASTER);
    let twice = (
        twice.0,
        twice
            .1
            .replace(r#"Event name="second""#, r#"Event name="first""#),
    );
    let cases: Vec<(Vec<Edit>, &str)> = vec![
        (gap(">"), "only a clear gap before the ego"),
        (gap(&limits), "only a clear gap before the ego"),
        (system("world"), "the coordinate system `world`"),
        (system("trajectory"), "the coordinate system `trajectory`"),
        // At 2 s, the time of the run is that of a place 20 m further.
        (run_times(), "a way that begins 20.000 m from"),
        (waiting(), "times of the run"),
        (vec![edit(SLOWER, itself)], "relative to its own"),
        (vec![edit(FIRST, instant)], "several conditions at a time"),
        (vec![twice], "several elements are called `first`"),
    ];
    for (edits, what) in cases {
        let error = import(&files(&edits)).expect_err(what);
        assert!(error.to_string().contains(what), "{what}: {error}");
        assert!(error.help.is_some(), "{what}: no help");
    }
    // What is refused without these is read.
    assert!(import(&files(&gap(leading))).is_ok());
    assert!(import(&files(&system("lane"))).is_ok());
}
