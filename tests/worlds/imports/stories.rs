//! Storyboards of which only the run knows the order of events.
//!
//! esmini moves the lead alike, to one of its steps of 0.01 s.

use super::*;

/// The end of the actors, and that with one more.
const LAST_ACTOR: &str = r#"<EntityRef entityRef="Lead"/></Actors>"#;
const BOTH_ACTORS: &str = r#"<EntityRef entityRef="Lead"/><EntityRef entityRef="Other"/></Actors>"#;

/// A gap behind or ahead of the ego.
fn gap(attributes: &str) -> String {
    format!(
        r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" {attributes}/></LongitudinalAction>"#
    )
}

#[test]
fn events_come_in_the_order_of_the_run() {
    let group = r#"name="group" maximumExecutionCount="1""#;
    let own = |value: &str, kind: &str| {
        aims_at(&format!(
            r#"<RelativeTargetSpeed entityRef="Lead" value="{value}" speedTargetValueType="{kind}" continuous="false"/>"#
        ))
    };
    let slower_than_ego = r#"<RelativeTargetSpeed entityRef="Ego" value="-4" speedTargetValueType="delta" continuous="false"/>"#;
    let stop = |condition: &str| {
        let trigger =
            format!("<StopTrigger><ConditionGroup>{condition}</ConditionGroup></StopTrigger>");
        edit("<!--act-->", trigger)
    };
    let twice = || {
        let Edit { from, to } = second(&after("event", "first", 0.0), FASTER);
        edit(
            from,
            to.replace(r#"Event name="second""#, r#"Event name="first""#),
        )
    };
    let near_ego = r#"<ReachPositionCondition tolerance="20"><Position><RelativeObjectPosition entityRef="Ego" dx="5" dy="0"/></Position></ReachPositionCondition>"#;
    let triggering = |word: &str| {
        edit(
            r#"selectTriggeringEntities="false""#,
            format!(r#"selectTriggeringEntities="{word}""#),
        )
    };
    let still = || SLOWER.replace(r#""rate" value="1""#, r#""rate" value="0""#);
    table! {
        "a group that repeats":
            [edit(group, group.replace('1', "3")), aims_at(slower_than_ego)]
            => lead([(4.0, 192.0, 0.0), (12.0, 312.0, 0.0)]);
        "actors that trigger their act, beside those that are named":
            [triggering("true"), act(travelled("Lead", 5.0))] => lead([(12.0, 228.0, 0.0)]);
        "a falling edge of a time that has come":
            [first(time(2.0, "falling", 0.0))] => lead([(12.0, 270.0, 0.0)]);
        "an edge before the act":
            [act(time(3.0, "none", 0.0)), first(time(2.0, "rising", 0.0))]
            => lead([(12.0, 270.0, 0.0)]);
        "an event that may come first":
            [second(&nearer(20.0, "none"), FASTER)]
            => lead([(4.0, 188.0, 0.0), (8.0, 215.229, 0.0), (12.0, 254.591, 0.0)]);
        "an act that stops after a distance of the lead, which keeps its speed":
            [stop(&travelled("Lead", 50.0))]
            => lead([(4.0, 188.0, 0.0), (8.0, 214.702, 0.0), (12.0, 240.0, 0.0)]);
        "an act that waits for its own event":
            [act(after("event", "first", 0.0))] => lead([(12.0, 270.0, 0.0)]);
        "an edge and a distance, which never come together":
            [first(time(2.0, "rising", 0.0) + &nearer(20.0, "none"))] => lead([(12.0, 270.0, 0.0)]);
        "near a place that goes on beside the ego":
            [first(watch("Lead", near_ego))]
            => lead([(8.0, 229.89, 0.0), (12.0, 260.013, 0.0)]);
        // esmini adds to such a target at every step.
        "a difference from its own speed": [own("1", "delta")] => lead([(12.0, 279.5, 0.0)]);
        "a share of its own speed": [own("0.5", "factor")] => lead([(12.0, 232.5, 0.0)]);
        "a rate of 0, which keeps the speed":
            [does(still())] => lead([(12.0, 270.0, 0.0)]);
        "a rate of 0 of two actors":
            [third(), does(still()), edit(LAST_ACTOR, BOTH_ACTORS)]
            => on("SpeedAction", "a rate of 0 of several actors");
        "a rate of 0 of actors that trigger their act":
            [triggering("1"), act(travelled("Lead", 5.0)), does(still())]
            => on("SpeedAction", "a rate of 0 of several actors");
        "actors that neither trigger nor do not":
            [triggering("yes"), act(travelled("Lead", 5.0))]
            => on("<Actors", "neither true nor false");
        // Players take the first.
        "an end of the first of two events of one name":
            [twice()] => lead([(8.0, 212.0, 0.0), (12.0, 243.0, 0.0)]);
        "which is listed": [own("1", "delta")]
            => drops(["the growth of speeds that are relative to themselves"]);
    }
}

#[test]
fn distances_profiles_and_meetings_begin_in_the_run() {
    let leading = gap(r#"displacement="leadingReferencedEntity" distance="9""#);
    let change = lane_change("linear", "distance", 40.0);
    table! {
        "a gap after the start":
            [does(&leading)] => lead([(4.0, 143.4, 0.0), (12.0, 303.4, 0.0)]);
        "a gap without a side is behind the other":
            [from_start(gap(r#"distance="30""#))] => lead([(1.0, 35.6, 0.0), (12.0, 255.6, 0.0)]);
        "a profile within limits":
            [does(profile(&[(1.0, 2.0)]))] => lead([(4.0, 180.4, 0.0), (12.0, 196.4, 0.0)]);
        "a meeting of an agent that moves":
            [from_start(MEETING)] => lead([(12.0, 195.0, 0.0)]);
        // The way that is really driven counts.
        "a change of lane by distance beside a change of speed":
            [beside(&time(2.5, "none", 0.0), &change)] => lead([(4.0, 187.95, 1.144)]);
        "a change of speed beside a change of lane by distance":
            [does(&change), beside(&time(3.0, "none", 0.0), FASTER)]
            => lead([(4.0, 189.924, 1.743), (8.0, 229.847, 3.5)]);
    }
}

#[test]
fn trajectories_begin_in_the_run_and_are_cut() {
    let way_off = || way([[150.0, -5.25], [250.0, 5.0]]);
    let back = || way([[150.0, -5.25], [250.0, 5.0], [160.0, -5.0]]);
    let run_times = || {
        [
            does(timed("absolute", 1.0, 0.0, "")),
            edit(LEAD_SPEED, STANDING),
        ]
    };
    let segment = |length_m: u32, begins_s: u32, place: &str| {
        format!(
            r#"<ClothoidSplineSegment length="{length_m}" curvatureStart="0" curvatureEnd="0" timeStart="{begins_s}">{place}</ClothoidSplineSegment>"#
        )
    };
    let begins = r#"<PositionStart><WorldPosition x="150" y="-5.25" h="0"/></PositionStart>"#;
    let spline = format!(
        r#"<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape><ClothoidSpline timeEnd="6">{}{}</ClothoidSpline></Shape></Trajectory></TrajectoryRef><TimeReference><Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>"#,
        segment(40, 0, begins),
        segment(60, 2, "")
    );
    let relative = way_off().replace(
        r#"<WorldPosition x="250" y="5"/>"#,
        r#"<RelativeObjectPosition entityRef="Ego" dx="200" dy="0"/>"#,
    );
    table! {
        "of an agent that moves, back to their start":
            [does(way_off())] => lead([(4.0, 169.896, 2.039), (12.0, 249.479, 10.197)]);
        "that turn back":
            [from_start(back())] => lead([(4.0, 189.792, 4.079), (12.0, 230.643, 8.099)]);
        "that an event cuts, which leaves the lead beside its lane":
            [from_start(way_off()), second(&time(2.0, "none", 0.0), FASTER)]
            => lead([(4.0, 189.896, 2.039), (8.0, 229.896, 2.039)]);
        "with times of the run":
            [run_times()] => lead([(4.0, 190.0, 5.0), (8.0, 215.0, 10.0), (12.0, 235.0, 10.0)]);
        "with times of the run, after a distance":
            [run_times(), first(nearer(20.0, "none"))] => lead([(4.0, 190.0, 5.0), (12.0, 235.0, 10.0)]);
        "with scaled times, of an agent that moves":
            [does(timed("relative", 2.0, 1.0, ""))]
            => lead([(3.0, 150.0, 0.0), (7.0, 170.0, 0.0), (11.0, 190.0, 5.0)]);
        "that begin again, by the other word of truth":
            [does(back().replace(r#"closed="false""#, r#"closed="1""#))]
            => on("Trajectory", "begins again");
        "with times of the segments of a spline":
            [does(spline)] => lead([(4.0, 190.0, 0.0), (6.0, 220.0, 0.0)]);
        "relative to an agent that goes on":
            [does(relative)] => on("Polyline", "relative to an agent");
    }
}

#[test]
fn truth_has_two_words() {
    let text = |edit: Edit| imported(&[edit]).worlds[0].text.clone();
    let keeps = |word: &str| {
        let target = format!(
            r#"<RelativeTargetSpeed entityRef="Ego" value="-10" speedTargetValueType="delta" continuous="{word}"/>"#
        );
        text(edit(LEAD_SPEED, target))
    };
    let headway = |word: &str| {
        let condition = format!(
            r#"<TimeHeadwayCondition entityRef="Ego" value="1" freespace="{word}" alongRoute="{word}" rule="lessThan"/>"#
        );
        text(first(watch("Lead", &condition)))
    };
    assert_eq!(keeps("1"), keeps("true"));
    assert_eq!(headway("1"), headway("true"));
    assert_eq!(headway("0"), headway("false"));
    assert_ne!(headway("0"), headway("1"));
}

#[test]
fn rain_that_begins_on_the_way_makes_the_road_slippery() {
    let imported = imported(&[rain("0.3")]);
    let text = &imported.worlds[0].text;
    assert!(text.contains("Friction(value: 0.3)"), "{text}");
    assert_eq!(
        off(&run(&world(&imported)), "lead", (12.0, 228.0, 0.0)),
        None
    );
}

#[test]
fn executions_that_no_world_counts_are_listed() {
    let found = |times: &str| {
        let from = r#"name="first" priority="override" maximumExecutionCount="1""#;
        let to = from.replace("\"1\"", &format!("\"{times}\""));
        // The event is also one that another overrides, which is listed beside it.
        let edits = [edit(from, to), second(&time(3.0, "none", 0.0), FASTER)];
        let mut kinds = dropped(&imported(&edits));
        kinds.retain(|kind| kind.starts_with("executions"));
        kinds
    };
    let repeated = "executions left of an event that another overrides";
    assert_eq!(found("10000"), [repeated]);
    assert_eq!(found("10001"), [repeated, "executions after the 10,000th"]);
}

#[test]
fn differences_from_esmini_are_listed() {
    let often = |event: &str| {
        let count = |times: u32| {
            format!(r#"name="{event}" priority="override" maximumExecutionCount="{times}""#)
        };
        edit(count(1), count(2))
    };
    let slower = r#"<RelativeTargetSpeed entityRef="Ego" value="-4" speedTargetValueType="delta" continuous="false"/>"#;
    let crossing = trajectory(
        r#"<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>"#,
        "",
        &[(0.0, 150.0, -5.25), (4.0, 150.0, -1.25)],
    );
    let walks = [lead_on_foot(), edit(LEAD_SPEED, STANDING), does(crossing)];
    let headway = r#"<TimeHeadwayCondition entityRef="Ego" value="1" freespace="false" alongRoute="true" rule="lessThan"/>"#;
    let late_stop = format!(
        "<StopTrigger><ConditionGroup>{}</ConditionGroup></StopTrigger>",
        time(9.0, "none", 0.0)
    );
    let skips = |Edit { from, to }: Edit| edit(from, to.replace("override", "skip"));
    let in_time = SLOWER.replace(r#""rate""#, r#""time""#);
    let third_event = beside(&time(8.0, "none", 0.0), FASTER).to;
    let cases: [(&str, Vec<Edit>); 10] = [
        (
            "executions left of an event that another overrides",
            vec![often("first"), second(&time(3.0, "none", 0.0), FASTER)],
        ),
        (
            "skips that count as executions",
            vec![skips(second(&time(3.0, "none", 0.0), FASTER))],
        ),
        (
            "stops by other actions or events, which are no ends",
            vec![second(&after("action", "slower", 0.0), FASTER)],
        ),
        (
            "stop triggers of acts that have not begun",
            vec![act(time(2.0, "none", 0.0)), edit("<!--act-->", late_stop)],
        ),
        (
            "changes of speed that may begin at their target",
            vec![often("first"), does(in_time)],
        ),
        (
            "lateral motion of agents that may stand",
            vec![aims_at(STANDING), beside(&time(3.0, "none", 0.0), CENTRE)],
        ),
        (
            "distances along the route",
            vec![first(watch("Lead", headway))],
        ),
        (
            "scaled or shifted times of trajectories",
            vec![does(timed("relative", 2.0, 0.0, ""))],
        ),
        (
            "relative speeds that change until they are reached",
            vec![aims_at(slower)],
        ),
        ("walks behind the end of a trajectory", walks.to_vec()),
    ];
    let plain = dropped(&imported(&[]));
    for (kind, edits) in &cases {
        assert!(!plain.contains(kind), "{kind}");
        let found = dropped(&imported(edits));
        assert!(found.contains(kind), "{kind}: {found:?}");
    }
    // Nothing but the event that waits may stop the first, and then it has ended.
    let chain = second(&after("event", "first", 0.0), FASTER);
    assert!(
        dropped(&imported(std::slice::from_ref(&chain)))
            .iter()
            .all(|it| !it.starts_with("stops by"))
    );
    let third = edit(
        chain.from.clone(),
        format!(
            "{}{}",
            chain.to,
            third_event
                .replace("second", "third")
                .replace("parallel", "override")
        ),
    );
    assert!(
        dropped(&imported(&[third]))
            .iter()
            .any(|it| it.starts_with("stops by"))
    );
}
