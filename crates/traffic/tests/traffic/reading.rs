//! One motion in every format gives one recording.

use brakecheck_traffic::{
    Class, ColumnMap, Reference, TrafficRecording, read_csv, read_csv_guessed,
};

/// Reads a text with a shipped map.
fn read(map: &str, text: &str) -> TrafficRecording {
    let map = ColumnMap::shipped(map).expect("shipped");
    read_csv(text.as_bytes(), "log.csv", &map).unwrap_or_else(|it| panic!("{it}"))
}

/// A car of 4 m × 2 m drives along the first axis with 20 m/s, its centre at (7, 3) first.
fn rows(line: impl Fn(usize, f64, f64) -> String, header: &str) -> String {
    let lines = (0..20).map(|i| line(i, 7.0 + 20.0 * 0.04 * i as f64, 3.0));
    let lines: Vec<String> = std::iter::once(header.to_owned()).chain(lines).collect();
    lines.join("\n")
}

fn ind() -> String {
    rows(
        |i, x, y| format!("1,{},{i},{x},{y},0.0,2.0,4.0,20.0,0.0,0.0,0.0", 7),
        "recordingId,trackId,frame,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,xAcceleration,yAcceleration",
    )
}

fn highd() -> String {
    // y points down, and (x, y) is the corner with the smallest coordinates.
    rows(
        |i, x, y| format!("{i},7,{},{},4.0,2.0,20.0,0.0,0.0,0.0", x - 2.0, -y - 1.0),
        "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration",
    )
}

fn ngsim() -> String {
    // Feet, the front bumper, Local_X to the right.
    let feet = |metres: f64| metres / 0.3048;
    rows(
        |i, x, y| {
            format!(
                "7,{},{},{},{},{},{},2,{},0.0",
                1_118_846_980_200_u64 + 40 * i as u64,
                feet(-y),
                feet(x + 2.0),
                feet(4.0),
                feet(2.0),
                1,
                feet(20.0),
            )
        },
        "Vehicle_ID,Global_Time,Local_X,Local_Y,v_Length,v_Width,Lane_ID,v_Class,v_Vel,v_Acc",
    )
}

#[test]
fn one_motion_in_four_formats_is_one_motion() {
    let expected = read("ind", &ind());
    assert_eq!(expected.tracks[0].len(), 20);
    assert!((expected.dt_s - 0.04).abs() < 1e-9);
    for (map, text) in [("highd", highd()), ("ngsim", ngsim())] {
        let other = read(map, &text);
        let (a, b) = (&expected.tracks[0], &other.tracks[0]);
        assert_eq!(
            (&a.id, a.class, a.len()),
            (&b.id, b.class, b.len()),
            "{map}"
        );
        assert!((a.length_m - b.length_m).abs() < 1e-9, "{map}");
        for i in 0..a.len() {
            let place = |recording: &TrafficRecording| {
                let track = &recording.tracks[0];
                [
                    recording.origin_m[0] + track.x_m[i],
                    recording.origin_m[1] + track.y_m[i],
                    track.heading_rad[i],
                    track.speed_mps[i],
                ]
            };
            for (a, b) in place(&expected).into_iter().zip(place(&other)) {
                assert!((a - b).abs() < 1e-6, "{map}, row {i}: {a} and {b}");
            }
        }
    }
}

#[test]
fn a_corner_taken_as_the_centre_is_off_by_half_the_box() {
    let map = ColumnMap::shipped("highd").expect("shipped");
    let wrong = ColumnMap {
        reference: Reference::Centre,
        ..map.clone()
    };
    let place = |map: &ColumnMap| {
        let recording = read_csv(highd().as_bytes(), "log.csv", map).expect("rows");
        [
            recording.origin_m[0] + recording.tracks[0].x_m[0],
            recording.origin_m[1] + recording.tracks[0].y_m[0],
        ]
    };
    assert_eq!(place(&map), [7.0, 3.0]);
    assert_eq!(place(&wrong), [5.0, 4.0]);
}

#[test]
fn the_header_determines_the_map() {
    for (name, text) in [("ind", ind()), ("highd", highd()), ("ngsim", ngsim())] {
        let read = read_csv_guessed(text.as_bytes(), "log.csv");
        let (_, map) = read.unwrap_or_else(|it| panic!("{it}"));
        assert_eq!(map, name);
    }
    let error = read_csv_guessed("a,b\n1,2\n".as_bytes(), "log.csv").expect_err("no map");
    let said = "`log.csv`: no shipped column map fits the header `a,b`";
    assert_eq!(error.to_string(), said);
}

const GENERIC: &str = "time,id,x,y,heading,speed,length,width\n";

/// Rows of one car with 10 m/s at the given instants.
fn at(instants: &[f64]) -> String {
    let row = |t: &f64| format!("{t},a,{},0,0,10,4.5,1.8", 10.0 * t);
    let rows: Vec<String> = instants.iter().map(row).collect();
    format!("{GENERIC}{}", rows.join("\n"))
}

/// The generic map has no class, so walkers were cars.
#[test]
fn a_column_of_classes_beside_those_of_the_generic_map_is_read() {
    let users = [
        ("a", "car", Class::Car),
        ("b", "truck", Class::Truck),
        ("c", "pedestrian", Class::Pedestrian),
        ("d", "bicycle", Class::Bicycle),
    ];
    for name in ["class", "agent_type"] {
        let mut text = GENERIC.replace("width", &format!("width,{name}"));
        for (y, (id, word, _)) in users.iter().enumerate() {
            for step in 0..5 {
                let (t, x) = (0.1 * f64::from(step), f64::from(step));
                text += &format!("{t:.1},{id},{x},{},0,10,4.5,1.8,{word}\n", 10 * y);
            }
        }
        let (recording, map) = read_csv_guessed(text.as_bytes(), "log.csv").expect("rows");
        assert_eq!(map, "generic");
        let classes: Vec<Class> = recording.tracks.iter().map(|it| it.class).collect();
        assert_eq!(classes, users.map(|(_, _, class)| class), "{name}");
    }
}

#[test]
fn short_holes_are_filled_and_long_ones_split_and_both_are_counted() {
    let recording = read(
        "generic",
        &at(&[0.0, 0.1, 0.2, 0.5, 0.6, 0.7, 1.5, 1.6, 1.7]),
    );
    assert_eq!(recording.tracks.len(), 2);
    assert_eq!(recording.counts.holes_filled, 2);
    assert_eq!(recording.counts.holes_split, 1);
    let first = &recording.tracks[0];
    assert_eq!(first.len(), 8);
    assert_eq!(
        first.filled,
        [false, false, false, true, true, false, false, false]
    );
    for (i, x) in first.x_m.iter().enumerate() {
        assert!((x - i as f64).abs() < 1e-9, "sample {i} is at {x}");
    }
    assert_eq!(recording.tracks[1].first_sample, 15);
    assert_eq!(recording.road_users(), 1);
}

#[test]
fn irregular_instants_are_interpolated_onto_the_grid_and_counted() {
    let recording = read("generic", &at(&[0.0, 0.1, 0.17, 0.3, 0.4, 0.5]));
    assert_eq!(recording.counts.off_grid, 1);
    assert_eq!(recording.counts.holes_filled, 0);
    let track = &recording.tracks[0];
    assert_eq!(track.len(), 6);
    assert!((track.x_m[2] - 2.0).abs() < 1e-9, "{}", track.x_m[2]);
}

#[test]
fn the_order_of_rows_does_not_matter() {
    let sorted = read("generic", &at(&[0.0, 0.1, 0.2, 0.3]));
    let mixed = read("generic", &at(&[0.2, 0.0, 0.3, 0.1]));
    let places = |it: &TrafficRecording| -> Vec<f64> {
        it.tracks[0]
            .x_m
            .iter()
            .map(|x| x + it.origin_m[0])
            .collect()
    };
    assert_eq!(places(&sorted), places(&mixed));
    assert_eq!(mixed.tracks[0].first_sample, 0);
}

#[test]
fn the_largest_mean_share_is_the_class() {
    let header = super::synthetic::dlr(&[], 1.0);
    let row = |i: usize, car: f64, truck: f64| {
        format!(
            "2024-10-07 06:00:00.{:06}+00:00,1,0,0,10,0,10,0,0,0,0,0,9,2,3,0,0,0,{car},0,{truck},False",
            i * 50_000
        )
    };
    let text = format!(
        "{header}{}\n{}\n{}\n",
        row(0, 0.6, 0.4),
        row(1, 0.6, 0.4),
        row(2, 0.1, 0.9)
    );
    assert_eq!(read("dlr", &text).tracks[0].class, Class::Truck);
}

#[test]
fn every_mistake_has_file_line_column_and_fix() {
    let generic = |rows: &str| format!("{GENERIC}{rows}");
    let good = "0,a,0,0,0,10,4.5,1.8\n";
    for (text, said, fix) in [
        (
            "time,id,x,y,heading,velocity,length,width\n".to_owned(),
            "`log.csv`: missing column `speed` in line 1",
            "map a column of `time,id,x,y,heading,velocity,length,width`",
        ),
        (
            "time,id,x,y,heading,speeds,length,width\n".to_owned(),
            "`log.csv`: missing column `speed` in line 1",
            "map `speeds`, or another of",
        ),
        (
            generic(&format!("{good}0.1,a,east,0,0,10,4.5,1.8\n")),
            "`log.csv`, line 3, column `x`: `east` is not a finite number",
            "remove the row, or map another column",
        ),
        (
            generic(&format!("{good}0.1,a,0,NaN,0,10,4.5,1.8\n")),
            "`log.csv`, line 3, column `y`: `NaN` is not a finite number",
            "remove the row",
        ),
        (
            generic(&format!("2024-02-30T00:00:00,a,0,0,0,10,4.5,1.8\n{good}")),
            "`log.csv`, line 2, column `time`: `2024-02-30T00:00:00` is not an ISO 8601 instant: \
             2024-02 has the days 1 to 29",
            "write 2024-10-07T06:00:00.05Z",
        ),
        (
            generic(&format!("{good}{},a,0,0,0,10,4.5,1.8\n", "9".repeat(300))),
            "`log.csv`, line 3, column `time`: 1e300 is no time from -1e21 to 1e21",
            "remove the row",
        ),
        (
            generic(&format!("{good}0.1,a,{},0,0,10,4.5,1.8\n", "9".repeat(300))),
            "`log.csv`, line 3, column `x`: 1e300 is farther than 100,000 km",
            "remove the row",
        ),
        (
            generic(&format!("{good}0.1,a,0,0,0\n")),
            "`log.csv`, line 3: 5 fields, the header has 8",
            "quote fields",
        ),
        (
            generic(&format!("{good}0.1,a,0,0,0,10,-1,1.8\n")),
            "`log.csv`, line 3, column `length`: -1 is not the size of a road user",
            "Fixed(length_m: 4.5, width_m: 1.8)",
        ),
        (
            generic(&format!("{good}{good}")),
            "`log.csv`: road user `a` has two rows at 0.000 s after the first row",
            "unique per road user",
        ),
        (
            generic(""),
            "`log.csv`: no row follows the header",
            "at least two rows",
        ),
        (
            generic(good),
            "`log.csv`: no road user has two rows",
            "map `id`",
        ),
    ] {
        let map = ColumnMap::shipped("generic").expect("shipped");
        let error = read_csv(text.as_bytes(), "log.csv", &map).expect_err(said);
        assert_eq!(error.to_string(), said);
        assert!(error.help().contains(fix), "{}", error.help());
        // Lines are counted alike in files of other systems.
        let text = text.replace('\n', "\r\n");
        let error = read_csv(text.as_bytes(), "log.csv", &map).expect_err(said);
        assert_eq!(error.to_string(), said);
    }
    let dlr = ColumnMap::shipped("dlr").expect("shipped");
    let text = super::synthetic::dlr(&[], 1.0)
        + "7.10.2024 6:00,1,0,0,10,0,10,0,0,0,0,0,4,2,2,0,0,0,1,0,0,False\n";
    let error = read_csv(text.as_bytes(), "log.csv", &dlr).expect_err("an instant");
    let said = "`log.csv`, line 2, column `timestamp`: `7.10.2024 6:00` is not an ISO 8601 instant";
    assert_eq!(error.to_string(), said);
}
