//! Places of entities: where they begin, which way they go, and who is there at all.
//!
//! esmini 3.6 has the same places, in its own frame, except for an entity that the
//! Init adds.

use super::*;

fn lane(lane: i32, s_m: f64, inner: &str) -> String {
    format!(r#"<LanePosition roadId="0" laneId="{lane}" s="{s_m}">{inner}</LanePosition>"#)
}

fn banked(terms: &str) -> Edit {
    let text = format!(r#"<lateralProfile><superelevation s="0" {terms}/></lateralProfile>"#);
    edit("<lateralProfile/>", text)
}

/// Less than 40 m from a place before the ego.
fn near_ego(dx_m: &str) -> String {
    format!(
        r#"<DistanceCondition value="40" freespace="false" rule="lessThan"><Position><RelativeObjectPosition entityRef="Ego" dx="{dx_m}" dy="0"/></Position></DistanceCondition>"#
    )
}

#[test]
fn a_place_on_a_route_along_a_bend_is_one_on_its_lane() {
    let stop = |s_m: f64| {
        let place = lane(-2, s_m, "");
        format!(r#"<Waypoint routeStrategy="shortest"><Position>{place}</Position></Waypoint>"#)
    };
    let (from, to) = (stop(150.0), stop(250.0));
    let route = format!(
        r#"<RoutePosition><RouteRef><Route name="r" closed="false">{from}{to}</Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="50" laneId="-2"/></InRoutePosition></RoutePosition>"#
    );
    let text = |position: String| {
        let imported = imported(&[on_bend(), edit(LEAD, position)]);
        imported.worlds[0].text.clone()
    };
    assert_eq!(text(route), text(lane(-2, 200.0, "")));
}

#[test]
fn an_offset_on_a_route_is_one_of_its_lane() {
    let stop = |s_m: f64| {
        let place = lane(1, s_m, "");
        format!(r#"<Waypoint routeStrategy="shortest"><Position>{place}</Position></Waypoint>"#)
    };
    // Lane 1 leads back.
    let (from, to) = (stop(300.0), stop(200.0));
    let route = format!(
        r#"<RoutePosition><RouteRef><Route name="r" closed="false">{from}{to}</Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="50" laneId="1" laneOffset="0.5"/></InRoutePosition></RoutePosition>"#
    );
    let on_lane = r#"<LanePosition roadId="0" laneId="1" s="250" offset="0.5"/>"#;
    let begins = |position: &str| {
        let imported = imported(&[edit(LEAD, position)]);
        at(&run(&world(&imported)), "lead", 0.0)
    };
    let (x_m, y_m) = begins(&route);
    let expected = begins(on_lane);
    assert!((x_m - expected.0).hypot(y_m - expected.1) < 1e-6);
}

#[test]
fn entities_go_where_they_face_from_wherever_they_are_placed() {
    let route = r#"<RoutePosition><RouteRef><Route name="r" closed="false">
        <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="10"/></Position></Waypoint>
        <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="2" laneId="-1" s="150"/></Position></Waypoint>
        </Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="105" laneId="-1"/></InRoutePosition></RoutePosition>"#;
    let meeting = MEETING.replace(
        r#"<AbsoluteSpeed value="10"><TargetDistanceSteadyState distance="5"/></AbsoluteSpeed>"#,
        r#"<RelativeSpeedToMaster value="-10" speedTargetValueType="delta"><TargetDistanceSteadyState distance="5"/></RelativeSpeedToMaster>"#,
    );
    let teleported = |position: &str| {
        format!("<TeleportAction><Position>{position}</Position></TeleportAction>")
    };
    let placed = format!("<PrivateAction>{}</PrivateAction>", teleported(LEAD));
    let again = teleported(r#"<RelativeRoadPosition entityRef="Lead" ds="10" dt="0"/>"#);
    let added = format!(
        r#"<EntityAction entityRef="Lead"><AddEntityAction><Position>{LEAD}</Position></AddEntityAction></EntityAction>"#
    );
    let lead_speed = r#"<SpeedActionTarget><AbsoluteTargetSpeed value="10"/>"#;
    table! {
        "left-hand traffic, in which lane -1 leads back":
            [
                edit(r#"rule="RHT""#, r#"rule="LHT""#),
                edit(EGO, lane(-1, 950.0, "")),
                edit(LEAD, lane(-2, 850.0, "")),
            ] => lead([(12.0, 228.0, 3.5)]);
        "along the road on a lane of oncoming traffic":
            [edit(LEAD, lane(1, 150.0, TURNED))] => lead([(12.0, 228.0, 7.0)]);
        "against the traffic": [edit(LEAD, lane(-2, 150.0, TURNED))] => lead([(12.0, 72.0, 0.0)]);
        "a vehicle that faces off its lane, which it follows":
            [edit(LEAD, lane(-2, 150.0, r#"<Orientation type="relative" h="0.4"/>"#))]
            => lead([(12.0, 228.0, 0.0)]);
        "a vehicle that faces off its lane, and more against it":
            [edit(LEAD, r#"<WorldPosition x="150" y="-5.25" h="2.5"/>"#)] => lead([(12.0, 72.0, 0.0)]);
        "a vehicle on no lane, which goes straight ahead":
            [edit(LEAD, r#"<WorldPosition x="150" y="-40" h="0.5"/>"#)]
            => lead([(2.0, 167.552, -25.161)]);
        "a second place, relative to the first": [lead_init(&again)] => lead([(12.0, 238.0, 0.0)]);
        "an ego by its distance from the reference line":
            [edit(EGO, r#"<RoadPosition roadId="0" s="50" t="-1.75"/>"#)] => ego([(12.0, 290.0, 3.5)]);
        "an entity that the Init adds":
            [edit(placed, ""), global(&added)] => lead([(12.0, 228.0, 0.0)]);
        "a banked road, whose lanes are narrower in the plane":
            [banked(r#"a="0.5" b="0" c="0" d="0""#)] => ego([(12.0, 290.0, 3.0715)]);
        "lanes that bend as a road is banked":
            [banked(r#"a="0" b="0.003" c="0" d="0""#)] => lead([(12.0, 228.0, -2.319)]);
        "relative to an ego that comes back, along the road":
            [
                edit(EGO, lane(1, 500.0, "")),
                edit(LEAD, r#"<RelativeLanePosition entityRef="Ego" dLane="0" ds="-100"/>"#),
            ] => lead([(2.0, 580.0, 0.0)]);
        "relative to an ego that comes back, along the lane":
            [
                edit(EGO, lane(1, 500.0, "")),
                edit(LEAD, r#"<RelativeLanePosition entityRef="Ego" dLane="0" dsLane="100"/>"#),
            ] => lead([(5.0, 645.5, 0.0)]);
        "beside an ego that stands off the road":
            [edit(EGO, r#"<WorldPosition x="50" y="500" h="0.5"/>"#), edit(EGO_SPEED, STANDING)]
            => lead([(12.0, -86.020, -528.736)]);
        "on a route that turns":
            [
                on_network(),
                edit(EGO, EGO.replace(r#"roadId="0""#, r#"roadId="1""#)),
                edit(LEAD, route),
            ] => lead([(2.0, 121.75, 23.894)]);
        "a meeting at a speed relative to that of the ego":
            [
                does(meeting),
                first(time(0.0, "none", 0.0)),
                edit(lead_speed, format!("<SpeedActionTarget>{STANDING}")),
            ] => lead([(12.0, 195.0, 0.0)]);
        "near an ego that goes on":
            [first(watch("Lead", &near_ego("0")))] => lead([(12.0, 252.092, 0.0)]);
        "round a circle":
            [edit("<line/>", r#"<arc curvature="0.01"/>"#)] => ego([(12.0, 28.4, 202.956)]);
        // The ego begins 50 m round a circle of 628 m, at 20 m/s.
        "a way ends before its road comes back":
            [edit("<line/>", r#"<arc curvature="0.01"/>"#), until("60")] => ends(24.0, 28.0, [END]);
        "two edges of different causes never come together": [two_edges()] => lead([(12.0, 270.0, 0.0)]);
    }
}

fn two_edges() -> Edit {
    let rising =
        travelled("Ego", 30.0).replace(r#"conditionEdge="none""#, r#"conditionEdge="rising""#);
    act(rising + &time(0.0, "rising", 0.0))
}

#[test]
fn entities_that_are_not_there_are_left_out_and_listed() {
    let delete = r#"<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>"#;
    let [object, placed] = third();
    let far = |offset_m: &str| {
        let offset = format!(r#"laneId="-1" s="120" offset="{offset_m}""#);
        let text = placed
            .to
            .replace(r#"laneId="-1" s="120" offset="0""#, &offset);
        let speed = r#"<AbsoluteTargetSpeed value="15"/>"#;
        edit(placed.from.clone(), text.replace(speed, STANDING))
    };
    // With the number of other agents that are left.
    let cases = [
        (
            vec![object.clone()],
            1,
            vec!["entities that are never placed"],
        ),
        (
            vec![object.clone(), placed.clone(), global(delete)],
            1,
            vec![],
        ),
        (
            vec![object.clone(), far("60")],
            1,
            vec!["entities that stand far from the road"],
        ),
        (vec![object.clone(), far("15")], 2, vec![]),
    ];
    for (edits, others, kinds) in cases {
        let imported = imported(&edits);
        let world = world(&imported);
        let agents = &world.drive().expect("a scene").spec().agents;
        assert_eq!((agents.len() - 1, dropped(&imported)), (others, kinds));
    }
}

#[test]
fn catalogs_are_found_beside_the_scenario_whatever_name_is_in_them() {
    let object = lead_object("</Vehicle>");
    let (begin, vehicle) = object.split_once("<Vehicle").expect("a vehicle");
    let begin = begin.trim_end();
    let reference = r#"<CatalogReference catalogName="Cars" entryName="sedan"/>"#;
    let mut files = files(&[
        edit(
            "<CatalogLocations/>",
            r#"<CatalogLocations><VehicleCatalog><Directory path="/cars"/></VehicleCatalog></CatalogLocations>"#,
        ),
        edit(format!("{object}</Vehicle>"), format!("{begin}{reference}")),
    ]);
    let error = import(&files).expect_err("without a catalog");
    let shown = error.to_string();
    assert!(shown.contains("no catalog `Cars.xosc`"), "{shown}");
    assert!(error.help.is_some());
    let catalog = format!(
        r#"<OpenSCENARIO><Catalog name="Others"><Vehicle{vehicle}</Vehicle></Catalog></OpenSCENARIO>"#
    );
    files.push(("cars/Cars.xosc", catalog));
    let episode = run(&world(&import(&files).expect("a world")));
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}

#[test]
fn an_ego_that_stands_askew_drives_off_from_there() {
    let edits = [
        edit(
            r#"laneId="-1" s="50"/>"#,
            r#"laneId="-1" s="50"><Orientation type="relative" h="0.5"/></LanePosition>"#,
        ),
        edit(EGO_SPEED, r#"<AbsoluteTargetSpeed value="0"/>"#),
    ];
    let episode = run(&world(&imported(&edits)));
    let (ego, lead) = (at(&episode, "ego", 2.0), at(&episode, "lead", 2.0));
    let apart_m = (lead.0 - ego.0).hypot(lead.1 - ego.1);
    assert!((apart_m - 120.0_f64.hypot(3.5)).abs() < 0.02, "{apart_m}");
}

/// The lead as a walker at a place on a road, turned to its left.
fn walker(road: u32, turned_rad: f64) -> Vec<Edit> {
    let walker = r#"<Pedestrian name="walker" mass="80" pedestrianCategory="pedestrian" model="x"><BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.6" height="1.8"/></BoundingBox><Properties/></Pedestrian>"#;
    let walker = format!(r#"<ScenarioObject name="Lead">{walker}"#);
    let place = format!(
        r#"<LanePosition roadId="{road}" laneId="-1" s="60"><Orientation type="relative" h="{turned_rad}"/></LanePosition>"#
    );
    vec![
        edit(lead_object("<!--lead object-->"), walker),
        edit(LEAD, place),
        edit(LEAD_SPEED, r#"<AbsoluteTargetSpeed value="1.5"/>"#),
        edit(LATER_SPEED, r#"<AbsoluteTargetSpeed value="1.5"/>"#),
    ]
}

/// Way in metres of a walker within two seconds.
fn walked(edits: &[Edit]) -> (f64, f64) {
    let episode = run(&world(&imported(edits)));
    let (from, to) = (
        at_by(&episode, "lead", 0.0, 0.3),
        at_by(&episode, "lead", 2.0, 0.3),
    );
    (to.0 - from.0, to.1 - from.1)
}

#[test]
fn a_walker_beside_a_way_that_bends_walks_ahead() {
    // The ego turns left, from road 1 into road 2.
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
    let mut edits = walker(1, std::f64::consts::FRAC_PI_2);
    edits.extend([
        on_network(),
        edit(EGO, r#"<LanePosition roadId="1" laneId="-1" s="20"/>"#),
        edit("<!--ego init-->", route),
    ]);
    let way = walked(&edits);
    assert!(way.0.abs() < 1e-3 && (way.1 - 3.0).abs() < 0.02, "{way:?}");
}

#[test]
fn a_walker_that_faces_askew_walks_there_or_stands() {
    let mut edits = walker(0, 0.5);
    edits.push(ego_at(300.0));
    let (x_m, y_m) = walked(&edits);
    let off_m = (x_m - 3.0 * 0.5_f64.cos()).hypot(y_m - 3.0 * 0.5_f64.sin());
    assert!(off_m < 0.02, "{x_m} {y_m}");
    for it in edits.iter_mut().filter(|it| it.to.contains("1.5\"/>")) {
        it.to = STANDING.to_owned();
    }
    world(&imported(&edits));
}
