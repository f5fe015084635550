//! Entities of the files: their bodies, where they are, and whose motion is left.

use super::*;
use brakecheck_sim::sim::Body;

fn as_ego(name: &str, leaves_ego: bool, files: &[(&str, String)]) -> Result<Imported, ImportError> {
    let import = Import {
        ego: Some(name),
        leaves_ego,
        ..plain()
    };
    import_as(&import, files)
}

#[test]
fn a_bicycle_becomes_a_bicyclist_of_the_files_size() {
    let car = lead_object("BoundingBox");
    let bicycle = car
        .replace("sedan", "bike")
        .replace(r#"vehicleCategory="car""#, r#"vehicleCategory="bicycle""#);
    let imported = imported(&[edit(car, bicycle)]);
    let world = world(&imported);
    let agents = &world
        .drive()
        .expect("a driving world")
        .world()
        .spec()
        .agents;
    let body = |name: &str| {
        let agent = agents.iter().find(|agent| agent.name == name);
        &agent.expect("an agent").body
    };
    assert!(body("ego").vehicle().is_some() && body("ego").cyclist().is_none());
    let stock = Body::shipped("bicyclist").expect("shipped").expect("valid");
    let (bike, stock) = (body("lead"), stock.cyclist().expect("a cyclist"));
    let cyclist = bike.cyclist().expect("a cyclist");
    assert_eq!((bike.length_m, bike.width_m), (4.4, 1.8));
    assert!((bike.lever_m() - LEVER_M).abs() < 1e-9);
    assert_eq!(cyclist.wheelbase_m, 2.8);
    assert_eq!(
        (cyclist.brake_mps2, cyclist.power_w, cyclist.lean_rate_mps3),
        (stock.brake_mps2, stock.power_w, stock.lean_rate_mps3)
    );
    // A plan carries it, whatever its limits are.
    let episode = run(&world);
    for place in [(2.0, 170.0, 0.0), (12.0, 228.0, 0.0)] {
        assert_eq!(off(&episode, "lead", place), None);
    }
}

#[test]
fn an_init_adds_and_deletes_entities() {
    let deleted = global(r#"<EntityAction entityRef="Lead"><DeleteEntityAction/></EntityAction>"#);
    let without = imported(&[deleted]);
    assert!(!without.worlds[0].text.contains("\"lead\""));
    // It stands where it is added.
    let [object, _] = third();
    let added = global(
        r#"<EntityAction entityRef="Other"><AddEntityAction><Position><LanePosition roadId="0" laneId="-1" s="400"/></Position></AddEntityAction></EntityAction>"#,
    );
    let episode = run(&world(&imported(&[object, added])));
    assert_eq!(off(&episode, "other", (0.0, 400.0, 3.5)), None);
    assert_eq!(off(&episode, "other", (6.0, 400.0, 3.5)), None);
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}

#[test]
fn an_ego_on_a_trajectory_with_times_begins_with_its_speed() {
    let way = timed("relative", 1.0, 0.0, "")
        .replace("-5.25", "-1.75")
        .replace(r#"x="150""#, r#"x="50""#)
        .replace(r#"x="180""#, r#"x="95""#);
    let init = format!("<PrivateAction>{way}</PrivateAction>");
    let files = files(&[edit("<!--ego init-->", init)]);
    let error = import(&files).expect_err("the file moves the ego");
    assert!(error.help.is_some(), "{error}");
    let import = Import {
        leaves_ego: true,
        ..plain()
    };
    let imported = import_as(&import, &files).expect("a world");
    assert_eq!(imported.ego_events.len(), 1);
    let episode = run(&world(&imported));
    // 45 m in 3 s.
    assert_eq!(off(&episode, "ego", (2.0, 80.0, 3.5)), None);
}

#[test]
fn an_ego_without_roads_faces_along_the_trajectory_that_is_left_to_it() {
    // No road has such a corner.
    let corner = way([[50.0, 0.0], [40.0, 0.0], [40.0, -10.0]]);
    let files = files(&[
        edit(r#"<LogicFile filepath="straight.xodr"/>"#, ""),
        edit(EGO, r#"<WorldPosition x="50" y="0"/>"#),
        edit(LEAD, r#"<WorldPosition x="150" y="0" h="0"/>"#),
        edit(
            "<!--ego init-->",
            format!("<PrivateAction>{corner}</PrivateAction>"),
        ),
    ]);
    let import = Import {
        leaves_ego: true,
        ..plain()
    };
    let imported = import_as(&import, &files).expect("a world");
    let episode = run(&world(&imported));
    let [ego, lead] = ["ego", "lead"].map(|name| at(&episode, name, 1.0));
    // The ego drives 20 m away, and the lead 10 m.
    let apart_m = (lead.0 - ego.0).hypot(lead.1 - ego.1);
    assert!((apart_m - 130.0).abs() < 0.1, "{apart_m}");
}

#[test]
fn somebody_on_foot_waits_and_walks_around_a_corner() {
    let around = way([[150.0, -5.25], [150.0, -1.25], [154.0, -1.25]]);
    let speed = SLOWER.replace(r#"value="4""#, r#"value="1.5""#);
    let both =
        format!(r#"{speed}</PrivateAction></Action><Action name="way"><PrivateAction>{around}"#);
    // A slow ego comes there only later.
    let edits = [
        lead_on_foot(),
        edit(LEAD_SPEED, STANDING),
        slow_ego(),
        does(both),
    ];
    let world = world(&imported(&edits));
    // The way is over after 8 m: at 1.5 m/s, of which the ramp takes 0.75 s.
    let horizon_s = world.world().clock().horizon_s;
    assert!((7.0..=8.1).contains(&horizon_s), "{horizon_s}");
    let episode = run(&world);
    let places = [(2.0, 150.0, 0.0), (4.0, 150.0, 1.875), (6.0, 150.875, 4.0)];
    for (time_s, x_m, y_m) in places {
        let (x, y) = at_by(&episode, "lead", time_s, 0.3);
        assert!((x - x_m).hypot(y - y_m) < 0.02, "({x}, {y}) at {time_s} s");
    }
}

#[test]
fn an_ego_has_any_name_and_its_events_are_left_only_on_request() {
    let renamed = files(&[edit("\"Ego\"", "\"Host\"")]);
    let unknown = import(&renamed).expect_err("nobody is called Ego");
    assert_eq!(
        unknown.help.as_deref(),
        Some("name the ego with --ego: Host, Lead")
    );
    let imported = as_ego("Host", false, &renamed).expect("a world");
    assert_eq!(imported.ego_events, []);
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "host", (6.0, 170.0, 3.5)), None);
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
    // The lead is the ego: the file moves it at 2 s.
    let files = files(&[]);
    let error = as_ego("Lead", false, &files).expect_err("it has an event");
    assert!(
        error
            .to_string()
            .contains("the ego has a motion of its own")
    );
    let imported = as_ego("Lead", true, &files).expect("a world");
    let events: Vec<(&str, usize)> = imported
        .ego_events
        .iter()
        .map(|it| (it.name.as_str(), it.line))
        .collect();
    let line = BASE
        .lines()
        .position(|line| line.contains(r#"<Event name="first""#));
    assert_eq!(events, [("first", 1 + line.expect("the event"))]);
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "lead", (12.0, 270.0, 0.0)), None);
}

#[test]
fn agents_have_names_that_a_world_can_state() {
    for (name, agent) in [("4", "agent_4"), ("Bär-2", "bue4r2")] {
        let episode = run(&world(&imported(&[edit(
            "\"Lead\"",
            format!("\"{name}\""),
        )])));
        assert_eq!(off(&episode, agent, (12.0, 228.0, 0.0)), None);
    }
}
