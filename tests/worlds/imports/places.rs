//! Places of entities: where they begin, which way they go, and who is there at all.
//!
//! esmini 3.6 has the same places, in its own frame, except for an entity that the
//! Init adds.

use super::*;

const LEAD: &str = r#"<LanePosition roadId="0" laneId="-2" s="150" offset="0"/>"#;
const EGO: &str = r#"<LanePosition roadId="0" laneId="-1" s="50"/>"#;
const TURNED: &str = r#"<Orientation type="relative" h="3.141592653589793"/>"#;
const STANDING: &str = r#"<AbsoluteTargetSpeed value="0"/>"#;
const EGO_SPEED: &str = r#"<AbsoluteTargetSpeed value="20"/><!--ego speed-->"#;

fn lane(lane: i32, s_m: f64, inner: &str) -> String {
    format!(r#"<LanePosition roadId="0" laneId="{lane}" s="{s_m}">{inner}</LanePosition>"#)
}

fn teleport(position: &str) -> String {
    format!(
        "<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"
    )
}

fn global(action: &str) -> Edit {
    edit(
        "<!--global-->",
        format!("<GlobalAction>{action}</GlobalAction>"),
    )
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

/// The kinds of what an import drops.
fn dropped(imported: &Imported) -> Vec<&'static str> {
    imported.dropped.iter().map(|it| it.kind).collect()
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
    let lead_speed = r#"<SpeedActionTarget><AbsoluteTargetSpeed value="10"/>"#;
    type Case = (&'static str, Vec<Edit>, &'static str, (f64, f64, f64));
    let cases: Vec<Case> = vec![
        (
            "left-hand traffic, in which lane -1 leads back",
            vec![
                edit(r#"rule="RHT""#, r#"rule="LHT""#),
                edit(EGO, lane(-1, 950.0, "")),
                edit(LEAD, lane(-2, 850.0, "")),
            ],
            "lead",
            (12.0, 228.0, 3.5),
        ),
        (
            "along the road on a lane of oncoming traffic",
            vec![edit(LEAD, lane(1, 150.0, TURNED))],
            "lead",
            (12.0, 228.0, 7.0),
        ),
        (
            "against the traffic",
            vec![edit(LEAD, lane(-2, 150.0, TURNED))],
            "lead",
            (12.0, 72.0, 0.0),
        ),
        (
            "a second place, relative to the first",
            vec![edit(
                "<!--lead init-->",
                teleport(r#"<RelativeRoadPosition entityRef="Lead" ds="10" dt="0"/>"#),
            )],
            "lead",
            (12.0, 238.0, 0.0),
        ),
        (
            "an ego by its distance from the reference line",
            vec![edit(EGO, r#"<RoadPosition roadId="0" s="50" t="-1.75"/>"#)],
            "ego",
            (12.0, 290.0, 3.5),
        ),
        (
            "an entity that the Init adds",
            vec![
                edit(
                    "<PrivateAction><TeleportAction><Position><LanePosition roadId=\"0\" laneId=\"-2\" s=\"150\" offset=\"0\"/></Position></TeleportAction></PrivateAction>",
                    "",
                ),
                global(&format!(
                    r#"<EntityAction entityRef="Lead"><AddEntityAction><Position>{LEAD}</Position></AddEntityAction></EntityAction>"#
                )),
            ],
            "lead",
            (12.0, 228.0, 0.0),
        ),
        (
            "a banked road, whose lanes are narrower in the plane",
            vec![banked(r#"a="0.5" b="0" c="0" d="0""#)],
            "ego",
            (12.0, 290.0, 3.0715),
        ),
        (
            "lanes that bend as a road is banked",
            vec![banked(r#"a="0" b="0.003" c="0" d="0""#)],
            "lead",
            (12.0, 228.0, -2.319),
        ),
        (
            "relative to one who comes back, along the road",
            vec![
                edit(EGO, lane(1, 500.0, "")),
                edit(
                    LEAD,
                    r#"<RelativeLanePosition entityRef="Ego" dLane="0" ds="-100"/>"#,
                ),
            ],
            "lead",
            (2.0, 580.0, 0.0),
        ),
        (
            "relative to one who comes back, along the lane",
            vec![
                edit(EGO, lane(1, 500.0, "")),
                edit(
                    LEAD,
                    r#"<RelativeLanePosition entityRef="Ego" dLane="0" dsLane="100"/>"#,
                ),
            ],
            "lead",
            (5.0, 645.5, 0.0),
        ),
        (
            "beside an ego that stands off the road",
            vec![
                edit(EGO, r#"<WorldPosition x="50" y="500" h="0.5"/>"#),
                edit(EGO_SPEED, STANDING),
            ],
            "lead",
            (12.0, -86.020, -528.736),
        ),
        (
            "on a route that turns",
            vec![
                edit(r#"filepath="straight.xodr""#, r#"filepath="network.xodr""#),
                edit(EGO, EGO.replace(r#"roadId="0""#, r#"roadId="1""#)),
                edit(LEAD, route),
            ],
            "lead",
            (2.0, 121.75, 23.894),
        ),
        (
            "a meeting at a speed relative to that of the ego",
            vec![
                edit(SLOWER, meeting),
                edit(FIRST, time(0.0, "none", 0.0)),
                edit(lead_speed, format!("<SpeedActionTarget>{STANDING}")),
            ],
            "lead",
            (12.0, 195.0, 0.0),
        ),
        (
            "near an ego that goes on",
            vec![edit(FIRST, watch("Lead", &near_ego("0")))],
            "lead",
            (12.0, 252.092, 0.0),
        ),
        (
            "round a circle",
            vec![edit("<line/>", r#"<arc curvature="0.01"/>"#)],
            "ego",
            (12.0, 28.4, 202.956),
        ),
    ];
    let mut wrong = Vec::new();
    for (case, edits, name, place) in cases {
        match import(&files(&edits)) {
            Err(error) => wrong.push(format!("{case}: {error}")),
            Ok(imported) => {
                let off = off(&run(&world(&imported)), name, place);
                wrong.extend(off.map(|off| format!("{case}: {off}")));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_place_that_goes_on_beside_an_entity_is_refused() {
    let edits = [edit(FIRST, watch("Lead", &near_ego("5")))];
    let error = import(&files(&edits)).expect_err("a place that moves");
    let shown = error.to_string();
    assert!(shown.contains("a place that goes on beside"), "{shown}");
    assert!(shown.contains("RelativeObjectPosition"), "{shown}");
    assert!(error.help.is_some());
}

#[test]
fn entities_that_are_not_there_are_left_out_and_listed() {
    let delete = r#"<EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction>"#;
    let [object, placed] = [0, 1].map(|it| third().swap_remove(it));
    let far = |offset_m: &str| {
        let text = placed.1.replace(
            r#"laneId="-1" s="120" offset="0""#,
            &format!(r#"laneId="-1" s="120" offset="{offset_m}""#),
        );
        edit(
            placed.0,
            text.replace(r#"<AbsoluteTargetSpeed value="15"/>"#, STANDING),
        )
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
        let imported = import(&files(&edits)).unwrap_or_else(|error| panic!("{error}"));
        let agents = world(&imported)
            .drive()
            .expect("a scene")
            .spec()
            .agents
            .len();
        assert_eq!((agents - 1, dropped(&imported)), (others, kinds));
    }
}

#[test]
fn two_edges_of_different_causes_never_come_together() {
    let travelled = watch("Ego", r#"<TraveledDistanceCondition value="30"/>"#)
        .replace(r#"conditionEdge="none""#, r#"conditionEdge="rising""#);
    let edits = [edit(
        ACT,
        format!("{travelled}{}", time(0.0, "rising", 0.0)),
    )];
    let imported = import(&files(&edits)).expect("a world");
    assert_eq!(dropped(&imported), ["conditions of different instants"]);
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "lead", (12.0, 270.0, 0.0)), None);
}

#[test]
fn a_way_ends_before_its_road_comes_back() {
    let edits = [
        edit("<line/>", r#"<arc curvature="0.01"/>"#),
        edit(
            r#"<SimulationTimeCondition value="12""#,
            r#"<SimulationTimeCondition value="60""#,
        ),
    ];
    let imported = import(&files(&edits)).expect("a world");
    assert_eq!(
        dropped(&imported),
        ["what happens behind the end of a road"]
    );
    // The ego begins 50 m round a circle of 628 m, at 20 m/s.
    let world = world(&imported);
    let clock = &world.drive().expect("a scene").spec().clock;
    assert!(
        (24.0..28.0).contains(&clock.horizon_s),
        "{}",
        clock.horizon_s
    );
}

#[test]
fn catalogs_are_found_beside_the_scenario_whatever_name_is_in_them() {
    let (_, vehicle) = BASE.split_once("<Vehicle").expect("a vehicle");
    let (vehicle, _) = vehicle.split_once("</Vehicle>").expect("its end");
    let lead = r#"<ScenarioObject name="Lead">"#;
    let (_, object) = BASE.split_once(lead).expect("the lead");
    let (object, _) = object.split_once("</Vehicle>").expect("its end");
    let mut files = files(&[edit(
        "<CatalogLocations/>",
        r#"<CatalogLocations><VehicleCatalog><Directory path="/cars"/></VehicleCatalog></CatalogLocations>"#,
    )]);
    let reference = r#"<CatalogReference catalogName="Cars" entryName="sedan"/>"#;
    files[0].1 = files[0].1.replacen(
        &format!("{lead}{object}</Vehicle>"),
        &format!("{lead}{reference}"),
        1,
    );
    let Err(error) = import(&files) else {
        panic!("without a catalog");
    };
    assert!(
        error.to_string().contains("no catalog `Cars.xosc`"),
        "{error}"
    );
    assert!(error.help.is_some());
    let catalog = format!(
        r#"<OpenSCENARIO><Catalog name="Others"><Vehicle{vehicle}</Vehicle></Catalog></OpenSCENARIO>"#
    );
    files.push(("cars/Cars.xosc", catalog));
    let episode = run(&world(&import(&files).expect("a world")));
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}
