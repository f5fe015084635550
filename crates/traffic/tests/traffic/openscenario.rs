//! OpenSCENARIO trajectories as recordings.

use std::fmt::Write;

use brakecheck_traffic::{Class, ReadError, TrafficRecording, read_xosc};

const ABSOLUTE: &str = r#"<Timing domainAbsoluteRelative="absolute" scale="1.0" offset="0.0"/>"#;

/// Definition of a car of 4 m × 2 m whose reference point is 1.4 m behind its centre.
const CAR: &str = r#"<Vehicle name="c" vehicleCategory="car"><BoundingBox>
<Center x="1.4" y="0.1" z="0.75"/><Dimensions width="2" length="4" height="1.5"/>
</BoundingBox></Vehicle>"#;

fn entity(name: &str, definition: &str) -> String {
    format!("<ScenarioObject name=\"{name}\">\n{definition}\n</ScenarioObject>\n")
}

/// Vertices, a line each, of a road user with 10 m/s to the north.
fn vertices(instants: &[f64], heading: &str) -> String {
    let mut text = String::new();
    for t in instants {
        let y = 10.0 * t;
        let position = format!("<WorldPosition x=\"100\" y=\"{y}\" {heading}/>");
        let _ = writeln!(
            text,
            "<Vertex time=\"{t}\"><Position>{position}</Position></Vertex>"
        );
    }
    text
}

fn group(name: &str, vertices: &str, timing: &str, trigger: &str) -> String {
    format!(
        "<ManeuverGroup name=\"g\" maximumExecutionCount=\"1\">
<Actors selectTriggeringEntities=\"false\"><EntityRef entityRef=\"{name}\"/></Actors>
<Maneuver name=\"m\"><Event name=\"e\" priority=\"parallel\"><Action name=\"a\"><PrivateAction>
<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name=\"t\" closed=\"false\">
<Shape><Polyline>
{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>
<TimeReference>{timing}</TimeReference></FollowTrajectoryAction></RoutingAction>
</PrivateAction></Action><StartTrigger><ConditionGroup><Condition name=\"s\"><ByValueCondition>
{trigger}</ByValueCondition></Condition></ConditionGroup></StartTrigger></Event></Maneuver>
</ManeuverGroup>\n"
    )
}

fn scenario(entities: &str, groups: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>
<OpenSCENARIO><FileHeader revMajor=\"1\" revMinor=\"2\"/><RoadNetwork/>
<Entities>\n{entities}</Entities>
<Storyboard><Init><Actions/></Init><Story name=\"s\"><Act name=\"a\">
{groups}<StartTrigger><ConditionGroup><Condition name=\"a\"><ByValueCondition>
<SimulationTimeCondition value=\"77\" rule=\"greaterThan\"/>
</ByValueCondition></Condition></ConditionGroup></StartTrigger></Act></Story></Storyboard>
</OpenSCENARIO>\n"
    )
}

fn read(text: &str) -> Result<TrafficRecording, ReadError> {
    read_xosc(text.as_bytes(), "drive.xosc")
}

fn good(text: &str) -> TrafficRecording {
    read(text).unwrap_or_else(|it| panic!("{it}"))
}

const TENTHS: [f64; 5] = [0.0, 0.1, 0.2, 0.3, 0.4];

/// World coordinates of a sample.
fn place(recording: &TrafficRecording, track: usize, at: usize) -> [f64; 2] {
    let track = &recording.tracks[track];
    let origin_m = recording.origin_m;
    [origin_m[0] + track.x_m[at], origin_m[1] + track.y_m[at]]
}

fn is_near(a: [f64; 2], b: [f64; 2]) -> bool {
    (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9
}

#[test]
fn the_centre_of_the_box_is_ahead_of_the_reference_point() {
    // With the heading in the file, and with that of the motion.
    for heading in ["h=\"1.5707963267948966\"", ""] {
        let groups = group("a", &vertices(&TENTHS, heading), ABSOLUTE, "");
        let recording = good(&scenario(&entity("a", CAR), &groups));
        let track = &recording.tracks[0];
        assert_eq!((&*track.id, track.class), ("a", Class::Car));
        assert_eq!((track.length_m, track.width_m), (4.0, 2.0));
        assert_eq!(
            (recording.counts.rows, recording.counts.assumed_sizes),
            (5, 0)
        );
        // North is ahead and west is to the left.
        let centre = place(&recording, 0, 2);
        assert!(is_near(centre, [99.9, 3.4]), "{centre:?}");
        assert!((track.speed_mps[2] - 10.0).abs() < 1e-9);
        assert!((recording.dt_s - 0.1).abs() < 1e-9);
    }
}

#[test]
fn classes_come_from_definitions_and_words_of_catalog_entries() {
    let catalog = |catalog: &str, entry: &str| {
        format!("<CatalogReference catalogName=\"{catalog}\" entryName=\"{entry}\"/>")
    };
    let vehicle = |category: &str| format!("<Vehicle vehicleCategory=\"{category}\"></Vehicle>");
    let cases = [
        (vehicle("bicycle"), Class::Bicycle, true),
        (vehicle("bus"), Class::Truck, true),
        (vehicle("semitrailer"), Class::Trailer, true),
        (vehicle("hovercraft"), Class::Car, false),
        (
            "<Pedestrian pedestrianCategory=\"pedestrian\"/>".to_owned(),
            Class::Pedestrian,
            true,
        ),
        (
            "<Pedestrian pedestrianCategory=\"animal\"/>".to_owned(),
            Class::Other,
            true,
        ),
        (catalog("VehicleCatalog", "van_red"), Class::Van, true),
        (
            catalog("VehicleCatalog", "motorbike"),
            Class::Motorcycle,
            true,
        ),
        (catalog("VehicleCatalog", "caravan"), Class::Car, false),
        (
            catalog("PedestrianCatalog", "adult_1"),
            Class::Pedestrian,
            true,
        ),
    ];
    let name = |i: usize| format!("u{i}");
    let entities: String = (0..cases.len())
        .map(|i| entity(&name(i), &cases[i].0))
        .collect();
    let groups: String = (0..cases.len())
        .map(|i| group(&name(i), &vertices(&TENTHS, ""), ABSOLUTE, ""))
        .collect();
    let recording = good(&scenario(&entities, &groups));
    for (track, (definition, class, _)) in recording.tracks.iter().zip(&cases) {
        assert_eq!(track.class, *class, "{definition}");
        assert_eq!([track.length_m, track.width_m], class.usual_size_m());
    }
    let unknown = cases.iter().filter(|it| !it.2).count();
    assert_eq!(recording.counts.unknown_class, 5 * unknown);
    assert_eq!(recording.counts.assumed_sizes, cases.len());
}

#[test]
fn times_have_a_scale_an_offset_and_a_start() {
    let timing = |domain: &str| {
        format!("<Timing domainAbsoluteRelative=\"{domain}\" scale=\"2.0\" offset=\"1.0\"/>")
    };
    let trigger = "<SimulationTimeCondition value=\"4.0\" rule=\"greaterThan\"/>";
    let both = entity("a", CAR) + &entity("b", CAR) + &entity("parked", CAR);
    let line = vertices(&TENTHS, "");
    let groups = group("a", &line, &timing("absolute"), trigger)
        + &group("b", &line, &timing("relative"), trigger);
    let recording = good(&scenario(&both, &groups));
    // Twice as fast: from −0.5 to −0.3 s and from 3.5 to 3.7 s, on a grid from the first.
    let spans: Vec<(usize, usize)> = recording
        .tracks
        .iter()
        .map(|it| (it.first_sample, it.end_sample()))
        .collect();
    assert!((recording.dt_s - 0.05).abs() < 1e-9);
    assert_eq!(spans, [(0, 5), (80, 85)]);
    assert!((recording.tracks[0].speed_mps[2] - 20.0).abs() < 1e-6);
    assert_eq!(recording.counts.without_motion, 1);
    // The start of the act is not that of the event.
    let groups = group("a", &line, &timing("relative"), "");
    let error = read(&scenario(&both, &groups)).expect_err("no start");
    assert!(
        error
            .to_string()
            .contains("relative to an event without an instant"),
        "{error}"
    );
}

#[test]
fn several_lines_of_an_entity_are_one_track_with_its_holes() {
    let later = [1.5, 1.6, 1.7];
    let groups = group("a", &vertices(&TENTHS, ""), ABSOLUTE, "")
        + &group("a", &vertices(&later, ""), ABSOLUTE, "");
    let recording = good(&scenario(&entity("a", CAR), &groups));
    assert_eq!((recording.tracks.len(), recording.road_users()), (2, 1));
    assert_eq!(recording.counts.holes_split, 1);
    assert_eq!(recording.tracks[1].first_sample, 15);
}

#[test]
fn every_mistake_has_its_line_and_a_fix() {
    let line = vertices(&TENTHS, "");
    let whole = |line: &str| scenario(&entity("a", CAR), &group("a", line, ABSOLUTE, ""));
    // The vertices begin in line 16.
    for (text, message, fix) in [
        (
            whole(&line.replacen("time=\"0.2\"", "time=\"soon\"", 1)),
            "`drive.xosc`, line 18: `time` of `Vertex` is not a finite number: `soon`",
            "write a number",
        ),
        (
            whole(&line.replacen("y=\"3\"", "y=\"NaN\"", 1)),
            "`drive.xosc`, line 19: `y` of `WorldPosition` is not a finite number: `NaN`",
            "write a number",
        ),
        (
            whole(&line.replacen("y=\"3\"", "", 1)),
            "`drive.xosc`, line 19: `WorldPosition` has no `y`",
            "add the attribute",
        ),
        (
            whole(&line.replacen("WorldPosition", "LanePosition", 1)),
            "`drive.xosc`, line 16: a vertex without `WorldPosition`",
            "WorldPosition with x and y",
        ),
        (
            whole("<Clothoid/>"),
            "`drive.xosc`, line 16: a trajectory of the shape `Clothoid`",
            "Polyline",
        ),
        (
            whole(&line).replacen("length=\"4\"", "length=\"-4\"", 1),
            "`drive.xosc`, line 6: `length` of `Dimensions` is not positive: -4",
            "leave it out",
        ),
        (
            whole(&line).replacen("</Polyline>", "", 1),
            "`drive.xosc`, line 21: invalid XML: ",
            "export the scenario again",
        ),
        (
            scenario(&entity("a", CAR), ""),
            "`drive.xosc`: no entity follows a polyline",
            "brakecheck new --from",
        ),
        (
            whole(&line.replacen("0.4", "4e9", 1)),
            "`drive.xosc`: the instants span 4000000000 s in steps of 0.1 s",
            "in its unit",
        ),
    ] {
        let error = read(&text).expect_err(message);
        assert!(error.to_string().starts_with(message), "{error}\n{message}");
        assert!(error.help().contains(fix), "{}", error.help());
    }
}

#[test]
fn a_file_that_ends_early_is_refused_wherever_it_ends() {
    let groups = group("a", &vertices(&TENTHS, "h=\"0\""), ABSOLUTE, "");
    let text = scenario(&entity("a", CAR), &groups);
    let end = text.find("</OpenSCENARIO>").expect("a root") + "</OpenSCENARIO>".len();
    for cut in (0..end).step_by(97) {
        let error = read(&text[..cut]).expect_err("a cut file");
        assert!(error.to_string().contains("drive.xosc"), "{error}");
    }
    let error = read(&text[..text.find("</Polyline>").expect("a line")]).expect_err("cut");
    let message = "`drive.xosc`, line 21: the file ends inside `Polyline`";
    assert_eq!(error.to_string(), message);
    // Bytes that are no text.
    for byte in [0x00, 0x80, 0xff] {
        let mut bytes = text.clone().into_bytes();
        for at in (0..bytes.len()).step_by(97) {
            let old = std::mem::replace(&mut bytes[at], byte);
            let _ = read_xosc(&bytes[..], "drive.xosc");
            bytes[at] = old;
        }
    }
}
