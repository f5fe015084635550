//! Notations of tables, and quantities that a table states twice: axes and feet.

use brakecheck_traffic::{
    Analysis, ColumnMap, ReadError, TrafficRecording, read_csv, read_csv_guessed,
};

use super::foreign::{State, changing, generic_line, rows, steady};

const HEADER: &str = "time,id,x,y,heading,speed,length,width\n";
const FOOT_M: f64 = 0.3048;

fn read(text: &str) -> Result<TrafficRecording, ReadError> {
    read_csv_guessed(text.as_bytes(), "log.csv").map(|it| it.0)
}

fn said(text: &str) -> String {
    let error = read(text).err();
    error.map_or(String::new(), |it| format!("{it}; {}", it.help()))
}

/// Rows of vehicles on a road along x, of which each third changes its lane.
fn traffic(line: &dyn Fn(f64, &str, State) -> String) -> String {
    let ids: Vec<String> = (0..6).map(|i| i.to_string()).collect();
    let motions: Vec<_> = (0..6)
        .map(|i| {
            changing(
                40.0 * f64::from(i),
                0.0,
                if i % 3 == 0 { 3.5 } else { 0.0 },
                3.0,
                20.0,
            )
        })
        .collect();
    let vehicles: Vec<(&str, &dyn Fn(f64) -> State)> = ids
        .iter()
        .zip(&motions)
        .map(|(id, motion)| (&**id, motion as &dyn Fn(f64) -> State))
        .collect();
    rows(&vehicles, 10.0, 10.0, line)
}

#[test]
fn notations_of_other_programs_are_the_same_recording() {
    let car = steady(5.0, 7.0, 0.4, 20.0);
    let of = |line: &dyn Fn(f64, &str, State) -> String| rows(&[("7", &car)], 10.0, 5.0, line);
    let plain = of(&generic_line);
    let expected = read(&(HEADER.to_owned() + &plain)).expect("rows");
    let date = |day: &str, t: f64, rest: String| {
        let (from, _) = rest.split_once(',').expect("a time");
        format!("{day}{t:06.3}Z{}", &rest[from.len()..])
    };
    let dated = of(&|t, id, s| date("2026-11-29T10:00:", t, generic_line(t, id, s)));
    let blank = of(&|t, id, s| date("2026-11-29 10:00:", t, generic_line(t, id, s)));
    let semicolons = |text: &str| text.replace(',', ";").replace('.', ",");
    for text in [
        format!("{HEADER}{dated}"),
        format!("{HEADER}{blank}"),
        semicolons(&format!("{HEADER}{plain}")),
        format!("sep=;\n{}", semicolons(&format!("{HEADER}{plain}"))),
        format!("{HEADER}{plain}").replace(',', "\t"),
        format!("\u{feff}{HEADER}{plain}").replace('\n', "\r\n"),
        format!("{HEADER}{plain}").replace('\n', ",\n"),
        format!("{HEADER}{}", plain.replace('\n', ",\n")),
        format!("# made by a logger\n{HEADER}{plain}# end\n"),
        format!("# {HEADER}{plain}"),
    ] {
        let recording = read(&text).unwrap_or_else(|it| panic!("{it}\n{text}"));
        assert_eq!(recording.dt_s, 0.1);
        assert_eq!(recording.tracks, expected.tracks, "{}", &text[..90]);
    }
    // The reading says that the times are dates.
    let dates = read(&format!("{HEADER}{dated}")).expect("rows").reading;
    assert!(dates.starts_with("time `time` as a date"), "{dates}");
}

#[test]
fn tables_that_may_mean_two_things_are_refused_by_name() {
    let car = steady(0.0, 0.0, 0.0, 20.0);
    let plain = rows(&[("7", &car)], 10.0, 5.0, &generic_line);
    let twice = "time,id,x,y,heading,speed,length,x\n".to_owned() + &plain;
    assert!(said(&twice).contains("two columns are called `x` in line 1"));
    for (header, column) in [
        (
            "time,id,x [cm],y [cm],heading,speed,length,width\n",
            "x [cm]",
        ),
        ("time,id,x_cm,y_cm,heading,speed,length,width\n", "x_cm"),
        ("time,id,x [ft],y [m],heading,speed,length,width\n", "y [m]"),
        (
            "time,id,x,y,heading,speed [kn],length,width\n",
            "speed [kn]",
        ),
        (
            "time,id,x,y,heading [mrad],speed,length,width\n",
            "heading [mrad]",
        ),
        (
            "time,id,x,y,heading,speed,length_ft,width_ft\n",
            "length_ft",
        ),
    ] {
        let said = said(&(header.to_owned() + &plain));
        let what = format!("the unit of `{column}` in line 1 is not read");
        assert!(said.contains(&what), "{header}: {said}");
    }
    let date = "time,id,x,y\n2026-11-29T10:00:00Z,a,0,0\n0.1,a,2,0\n";
    assert!(said(date).contains("line 3, column `time`: `0.1` is not an ISO 8601 instant"));
}

#[test]
fn recordings_in_feet_need_their_unit() {
    let feet = |t: f64, id: &str, s: State| {
        format!(
            "{t:.1},{id},{},{},{},{},15,6",
            s.x / FOOT_M,
            s.y / FOOT_M,
            s.heading,
            s.speed / FOOT_M
        )
    };
    let text = traffic(&feet);
    let unnamed = said(&(HEADER.to_owned() + &text));
    let what = "most vehicles are 6.00 m wide and 15.00 m long, which fits feet";
    assert!(unnamed.contains(what), "{unnamed}");
    assert!(unnamed.contains("length_unit: Feet"), "{unnamed}");
    // Both cures that the message names.
    let header = "time,id,x [ft],y [ft],heading,speed [ft/s],length,width\n";
    let named = read(&(header.to_owned() + &text)).expect("feet");
    let map = ColumnMap {
        length_unit: brakecheck_traffic::LengthUnit::Feet,
        ..ColumnMap::shipped("generic").expect("shipped")
    };
    let mapped = read_csv((HEADER.to_owned() + &text).as_bytes(), "log.csv", &map);
    for recording in [named, mapped.expect("feet")] {
        assert!((recording.tracks[0].width_m - 6.0 * FOOT_M).abs() < 1e-9);
        assert!((recording.tracks[0].speed_mps[0] - 20.0).abs() < 1e-9);
        assert_eq!(recording.counts.narrow, 0);
    }
    // Metres under a map of feet are the other way round.
    let metres = HEADER.to_owned() + &traffic(&generic_line);
    let shrunk = read_csv(metres.as_bytes(), "log.csv", &map).expect("rows");
    assert_eq!(shrunk.counts.narrow, 6);
    assert_eq!(read(&metres).expect("metres").counts.narrow, 0);
}

#[test]
fn lanes_and_speeds_show_feet_without_sizes() {
    let lane = |i: i32, unit_m: f64| {
        let (y, x) = (3.66 * f64::from(i % 3), 60.0 * f64::from(i));
        steady(x / unit_m, y / unit_m, 0.0, 28.0 / unit_m)
    };
    let analysis = |unit_m: f64| {
        let ids: Vec<String> = (0..12).map(|i| i.to_string()).collect();
        let motions: Vec<_> = (0..12).map(|i| lane(i, unit_m)).collect();
        let vehicles: Vec<(&str, &dyn Fn(f64) -> State)> = ids
            .iter()
            .zip(&motions)
            .map(|(id, motion)| (&**id, motion as &dyn Fn(f64) -> State))
            .collect();
        let line = |t: f64, id: &str, s: State| format!("{t:.1},{id},{},{}", s.x, s.y);
        let text = "time,id,x,y\n".to_owned() + &rows(&vehicles, 10.0, 15.0, &line);
        Analysis::of(read(&text).expect("rows"))
    };
    for (unit_m, distance_m) in [(1.0, 3.66), (FOOT_M, 12.0)] {
        let it = analysis(unit_m);
        let lanes_m = it.frame.lane_distance_m().expect("lanes");
        assert!((lanes_m - distance_m).abs() < 0.1, "{lanes_m}");
        let speed_mps = it.recording.median_speed_mps().expect("vehicles");
        assert!((speed_mps - 28.0 / unit_m).abs() < 1e-6, "{speed_mps}");
    }
}

#[test]
fn an_axis_that_is_mirrored_shows_in_small_headings_too() {
    let heading = |turned: &dyn Fn(f64) -> f64| {
        let text = traffic(&|t, id, s| {
            let heading = turned(s.heading);
            generic_line(t, id, State { heading, ..s })
        });
        said(&(HEADER.to_owned() + &text))
    };
    assert_eq!(heading(&|it| it), "");
    // No heading, and one that only shakes, contradict nothing.
    assert_eq!(heading(&|_| 0.0), "");
    let shaking = |it: f64| it + 0.03 * (1e6 * it + 1.0).sin();
    assert_eq!(heading(&shaking), "");
    let mirrored = heading(&|it| -it);
    assert!(mirrored.contains("those of a y to the right"), "{mirrored}");
    assert!(mirrored.contains("`y_axis: Right`"), "{mirrored}");
    assert!(heading(&f64::to_degrees).contains("fits degrees"));
    let components = |sign: f64| {
        let text = traffic(&|t, id, s| {
            let (sin, cos) = s.heading.sin_cos();
            let (vx, vy) = (s.speed * cos, sign * s.speed * sin);
            format!("{t:.1},{id},{},{},{vx},{vy}", s.x, s.y)
        });
        said(&format!("time,id,x,y,vx,vy\n{text}"))
    };
    assert_eq!(components(1.0), "");
    let mirrored = components(-1.0);
    let what = "the recorded velocities do not lead along the positions";
    assert!(mirrored.contains(what), "{mirrored}");
}
