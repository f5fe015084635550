//! Roads of the files: surfaces, limits, ends, bends, junctions, grades and lights.

use super::*;

#[test]
fn friction_and_speed_limits_are_carried_over() {
    let wet = |scale: f64| {
        global(&format!(
            r#"<EnvironmentAction><Environment name="wet"><Weather/><RoadCondition frictionScaleFactor="{scale}"/></Environment></EnvironmentAction>"#
        ))
    };
    let limit = |max: &str, unit: &str| {
        let text = format!(r#"<type s="0" type="town"><speed max="{max}" unit="{unit}"/></type>"#);
        edit("<!--types-->", text)
    };
    let lanes = |text: &str| edit(WIDTH, format!("{WIDTH}{text}"));
    let materials =
        r#"<material sOffset="0" friction="0.8"/><material sOffset="100" friction="0.4"/>"#;
    let changing = r#"<type s="0" type="town"><speed max="50" unit="km/h"/></type><type s="200" type="town"><speed max="30" unit="km/h"/></type>"#;
    table! {
        "a dry road": [] => road(1.0, None);
        "a wet road": [wet(0.6)] => road(0.6, None);
        "rain that changes nothing, as the Init has its friction":
            [wet(0.3), rain("0.3")] => road(0.3, None);
        "rain without an effect": [rain("1.0")] => road(1.0, None);
        "a wet road of a material":
            [wet(0.5), lanes(r#"<material sOffset="0" friction="0.8"/>"#)] => road(0.4, None);
        "a material that changes along the road": [lanes(materials)] => road(0.4, None);
        "a limit in km/h": [limit("50", "km/h")] => road(1.0, Some(50.0 / 3.6));
        "no limit": [limit("no limit", "km/h")] => road(1.0, None);
        "a limit in mph": [limit("30", "mph")] => road(1.0, Some(13.4112));
        "a limit of the lanes":
            [limit("50", "km/h"), lanes(r#"<speed sOffset="0" max="20" unit="m/s"/>"#)]
            => road(1.0, Some(20.0));
        "a limit that changes along the road": [edit("<!--types-->", changing)] => road(1.0, None);
        "a limit of one lane alone":
            [edit("<!--lane-->", r#"<speed sOffset="0" max="50" unit="km/h"/>"#)] => road(1.0, None);
    }
}

#[test]
fn a_run_ends_before_an_entity_leaves_its_road() {
    let jump = edit(
        "<!--offsets-->",
        "<laneOffset s=\"0\" a=\"0\"/>\n<laneOffset s=\"200\" a=\"3.5\"/>",
    );
    table! {
        "as it is": [] => ends(12.0, 12.0, []);
        // 10 m/s from 950 m of 1000 m on, slower from 2 s on: 30 m at 10 - t m/s more.
        "a lead near the end": [lead_at(950.0)] => ends(5.0, 5.7, [END]);
        "a lead before a jump of its lane": [jump] => ends(4.5, 5.2, [END]);
        "an ego near the end, which coasts": [ego_at(900.0)] => ends(5.0, 5.0, [END]);
    }
}

#[test]
fn what_is_dropped_is_listed_with_the_place_of_the_first() {
    let edits = [
        edit(
            "<lateralProfile/>",
            "<lateralProfile><superelevation s=\"0\" a=\"0\" b=\"0\" c=\"0\" d=\"0\"/>\n<superelevation s=\"10\" a=\"0\" b=\"0.005\" c=\"0\" d=\"0\"/><superelevation s=\"20\" a=\"0.05\" b=\"0\" c=\"0\" d=\"0\"/></lateralProfile>",
        ),
        edit(
            "<!--signals-->",
            r#"<signals><signal id="1" s="50" t="-6" dynamic="no"/></signals>"#,
        ),
        edit(
            "<!--lead vehicle-->",
            r#"<Trailer><CatalogReference catalogName="c" entryName="t"/></Trailer>"#,
        ),
        edit(
            "<!--ego init-->",
            r#"<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false"><Waypoint routeStrategy="shortest"><Position><LanePosition roadId="0" laneId="-1" s="900"/></Position></Waypoint></Route></AssignRouteAction></RoutingAction></PrivateAction>"#,
        ),
        global(
            r#"<EnvironmentAction><Environment name="wet"><Weather/></Environment></EnvironmentAction>"#,
        ),
        edit(
            r#"<Condition name="stop""#,
            r#"<Condition name="and" delay="0" conditionEdge="none"><ByEntityCondition/></Condition><Condition name="stop""#,
        ),
    ];
    let files = files(&edits);
    let expected = [
        ("trailers", "base.xosc", "<Trailer>", 1),
        ("weather", "base.xosc", "<Weather/>", 1),
        (
            "stop conditions",
            "base.xosc",
            "<StopTrigger><ConditionGroup>",
            1,
        ),
        ("lateral profile", "straight.xodr", "s=\"10\"", 2),
        ("traffic signals", "straight.xodr", "<signal ", 1),
        ("routes", "base.xosc", "<AssignRouteAction>", 1),
    ];
    let expected = expected.map(|(kind, file, text, count)| {
        let all = text_of(&files, Path::new(file)).expect("a file");
        let found = all.lines().position(|line| line.contains(text));
        let line = 1 + found.unwrap_or_else(|| panic!("{text}"));
        (kind, file.to_owned(), line, count)
    });
    let found: Vec<_> = import(&files)
        .expect("a world")
        .dropped
        .iter()
        .map(|it| (it.kind, it.file.display().to_string(), it.line, it.count))
        .collect();
    assert_eq!(found, expected);
    // What drops nothing lists nothing.
    assert_eq!(dropped(&imported(&[])), Vec::<&str>::new());
}

#[test]
fn steps_of_the_elevation_are_listed_and_lanes_of_no_side_are_not_read() {
    let elevation =
        |s_m: u32, a: f64| format!(r#"<elevation s="{s_m}" a="{a}" b="0" c="0" d="0"/>"#);
    // A rounding of the file is no step, and one behind the end of the road is on no road.
    for (height_m, at_m, kinds) in [
        (50.0, 100, &["steps of the elevation"][..]),
        (0.05, 100, &[]),
        (50.0, 1000, &[]),
    ] {
        let both = [elevation(0, 0.0), elevation(at_m, height_m)].concat();
        let profile = format!("<elevationProfile>{both}</elevationProfile>");
        let imported = imported(&[edit("<elevationProfile/>", profile)]);
        assert_eq!(dropped(&imported), kinds, "{height_m} m at {at_m} m");
    }
    let elsewhere = [edit("<right>", "<nope>"), edit("</right>", "</nope>")];
    let error = import(&files(&elsewhere)).expect_err("a road without lane -1");
    assert!(error.help.is_some(), "{error}");
}

#[test]
fn a_bend_goes_on_as_far_as_an_entity_drives() {
    let episode = run(&world(&imported(&[on_bend(), until("52")])));
    for time_s in [10.0, 30.0, 50.0] {
        // Lane -1 is 1.75 m to the right of an arc of 250 m, lane -2, on which the
        // world's road begins, 5.25 m.
        let radius_m: f64 = 251.75;
        let turned_rad: f64 = 50.0 / 250.0 + 20.0 * time_s / radius_m;
        let place = (
            time_s,
            radius_m * turned_rad.sin(),
            250.0 - radius_m * turned_rad.cos() + 5.25,
        );
        assert_eq!(off(&episode, "ego", place), None);
    }
}

/// In world files a road goes straight on at both ends, so a road of nearly a full
/// circle would cross its beginning.
#[test]
fn a_road_of_nearly_a_full_circle_ends_before_it_comes_back() {
    let edits = [
        on_bend(),
        edit(r#"curvature="0.004""#, r#"curvature="-0.004""#),
        until("90"),
    ];
    let imported = imported(&edits);
    let episode = run(&world(&imported));
    // The run ends with the road, which the import says.
    let ends_s = 0.05 * (episode.trace.len() - 1) as f64;
    assert!((65.0..72.0).contains(&ends_s), "{ends_s} s");
    assert_eq!(dropped(&imported), [END]);
    // Lane -1 is 1.75 m inside an arc of 250 m, lane -2, on which the world's road
    // begins, 5.25 m.
    for row in 0..episode.trace.len() {
        let (x, y) = at(&episode, "ego", 0.05 * row as f64);
        let off_m = x.hypot(y + 244.75) - 248.25;
        assert!(off_m.abs() < 0.001, "{off_m} m off in row {row}");
    }
}

/// A gap is one between boxes that are turned against each other in a bend.
#[test]
fn a_gap_in_a_bend_counts_along_the_axis_of_the_car_ahead() {
    let gap = r#"<LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" freespace="true" continuous="false" displacement="leadingReferencedEntity" distance="40"/></LongitudinalAction>"#;
    for curvature in ["0.004", "-0.004"] {
        let bent = format!(r#"curvature="{curvature}""#);
        let edits = [
            on_bend(),
            edit(r#"curvature="0.004""#, bent),
            lead_init(gap),
            edit(LEAD_S, r#"laneId="-1" s="150""#),
        ];
        let episode = run(&world(&imported(&edits)));
        let (ego, lead) = (at(&episode, "ego", 0.0), at(&episode, "lead", 0.0));
        let of = |name: &str| {
            episode
                .trace
                .signal(&format!("{name}.heading"))
                .expect("there")[0]
        };
        let (turned, h) = (of("ego"), of("lead"));
        // From the corners of the ego's front to the rear of the lead.
        let clear_m = [-0.9, 0.9].map(|side_m| {
            let x = ego.0 + LEVER_M * turned.cos() - side_m * turned.sin();
            let y = ego.1 + LEVER_M * turned.sin() + side_m * turned.cos();
            (lead.0 - x) * h.cos() + (lead.1 - y) * h.sin() - (4.4 - LEVER_M)
        });
        let clear_m = clear_m[0].min(clear_m[1]);
        assert!((clear_m - 40.0).abs() < 0.005, "{curvature}: {clear_m} m");
    }
}

/// The network, with the ego and the lead at places, and a route of the lead.
fn routed(ego: &str, lead: &str, route: &str) -> Vec<Edit> {
    vec![
        on_network(),
        edit(EGO, ego),
        edit(LEAD, lead),
        edit("<!--lead init-->", route),
        edit(LATER_SPEED, LEAD_SPEED),
    ]
}

#[test]
fn a_route_turns_left_through_a_junction_before_an_ego_on_a_left_lane() {
    let stop = |road: u32| {
        format!(
            r#"<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="{road}" laneId="-1" s="60"/></Position></Waypoint>"#
        )
    };
    let route = format!(
        r#"<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">{}{}</Route></AssignRouteAction></RoutingAction></PrivateAction>"#,
        stop(1),
        stop(2)
    );
    let ego = r#"<LanePosition roadId="3" laneId="1" s="50"/>"#;
    let lead_lane = r#"<LanePosition roadId="1" laneId="-1" s="60"/>"#;
    let turned = imported(&routed(ego, lead_lane, &route));
    // Lanes that turn off are read, so no route is dropped.
    assert!(!dropped(&turned).contains(&"routes"));
    let episode = run(&world(&turned));
    // The world begins at the end of road 3, on its left lane, and faces west.
    let seen = |time_s: f64, x_m: f64, y_m: f64| (time_s, 340.0 - x_m, 1.75 - y_m);
    assert_eq!(off(&episode, "ego", seen(6.0, 70.0, 1.75)), None);
    // 40 m of road 1, then a quarter of a circle, 21.75 m around (100, 20), and on.
    let turned_rad: f64 = 20.0 / 21.75;
    let lead = [
        seen(4.0, 100.0, -1.75),
        seen(
            6.0,
            100.0 + 21.75 * turned_rad.sin(),
            20.0 - 21.75 * turned_rad.cos(),
        ),
        seen(
            9.0,
            121.75,
            20.0 + 50.0 - 21.75 * core::f64::consts::FRAC_PI_2,
        ),
    ];
    for place in lead {
        assert_eq!(off(&episode, "lead", place), None);
    }
    // Without a route, the way of the lead ends at the junction, after 4 s.
    let straight_on = imported(&routed(ego, lead_lane, ""));
    let horizon_s = world(&straight_on).world().clock().horizon_s;
    assert!((3.9..=4.0).contains(&horizon_s), "{horizon_s}");
}

#[test]
fn the_ego_drives_on_the_grades_of_its_road_and_past_its_lights() {
    let rises = "<elevationProfile><elevation s=\"0\" a=\"0\" b=\"0\" c=\"0\" d=\"0\"/>\
                 <elevation s=\"100\" a=\"0\" b=\"-0.04\" c=\"0\" d=\"0\"/></elevationProfile>";
    let signals = r#"<signals>
        <signal id="1" s="250" t="-6" dynamic="yes" orientation="+"/>
        <signal id="2" s="250" t="6" dynamic="yes" orientation="-"/>
        <signal id="3" s="300" t="-6" dynamic="yes" orientation="+"/>
        <signal id="4" s="350" t="-6" dynamic="yes" orientation="+"/>
        </signals>"#;
    // The first two are switched one by one, the third by its group 7, 5 s after them.
    let phases = r#"<TrafficSignals>
        <TrafficSignalController name="main"><Phase name="go" duration="20"><TrafficSignalState trafficSignalId="1" state="off;off;on"/><TrafficSignalState trafficSignalId="2" state="on;off;off"/></Phase><Phase name="stop" duration="10"><TrafficSignalState trafficSignalId="1" state="on;off;off"/><TrafficSignalState trafficSignalId="2" state="off;off;on"/></Phase></TrafficSignalController>
        <TrafficSignalController name="7" delay="5" reference="main"><Phase name="go" duration="20"><TrafficSignalGroupState state="green"/></Phase><Phase name="stop" duration="10"><TrafficSignalGroupState state="red"/></Phase></TrafficSignalController>
        </TrafficSignals>"#;
    let files = files(&[
        edit("<elevationProfile/>", rises),
        edit("<!--signals-->", signals),
        edit("<!--network-->", phases),
        edit(
            "</OpenDRIVE>",
            "<controller id=\"7\" name=\"c\"><control signalId=\"3\"/></controller></OpenDRIVE>",
        ),
    ]);
    let imported = import(&files).expect("a world");
    let world = world(&imported);
    let spec = world.drive().expect("a driving world").spec();
    let grades: Vec<(f64, f64)> = spec
        .grades
        .iter()
        .map(|it| (it.from_s_m, it.rise))
        .collect();
    assert_eq!(grades, [(0.0, 0.0), (100.0, -0.04)]);
    let lights: Vec<(&str, f64)> = spec
        .lights
        .iter()
        .map(|it| (it.name.as_str(), it.line_m))
        .collect();
    assert_eq!(lights, [("light_1", 250.0), ("light_3", 300.0)]);
    // The ego keeps its speed downhill.
    let episode = run(&world);
    let speeds = episode.trace.signal("ego.speed").expect("recorded");
    assert!(speeds.iter().all(|mps| (mps - 20.0).abs() < 0.03));
    let words: Vec<&str> = world.text().split_whitespace().collect();
    let text = words.join(" ");
    for schedule in [
        "line_m: 250.0, drive: Schedule([(0.0, Green), (20.0, Red), (30.0, Green), ",
        "line_m: 300.0, drive: Schedule([(0.0, Red), (5.0, Green), (25.0, Red), (35.0, Green), ",
    ] {
        assert!(text.contains(schedule), "{text}");
    }
    // The light of the other direction and the one without phases are listed.
    let dropped: Vec<(&str, usize)> = imported
        .dropped
        .iter()
        .map(|it| (it.kind, it.count))
        .collect();
    assert_eq!(dropped, [("traffic signals", 2)]);
}
