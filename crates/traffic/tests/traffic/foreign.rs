//! Recordings of other programs: their units, rates, orders and faults.

use std::fmt::Write;

use brakecheck_traffic::{
    Analysis, BoundRules, ColumnMap, ReadError, RuleResult, TrafficRecording, TrafficRule,
    TrafficRuleFile, read_csv, read_csv_guessed, read_csv_timed, read_fcd, read_xml,
};

/// State of a vehicle: metres, radians, m/s.
#[derive(Clone, Copy)]
pub(super) struct State {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading: f64,
    pub(super) speed: f64,
}

/// Rows of vehicles in a header of the generic kind, with a line per state.
pub(super) fn rows(
    vehicles: &[(&str, &dyn Fn(f64) -> State)],
    rate_hz: f64,
    seconds: f64,
    line: &dyn Fn(f64, &str, State) -> String,
) -> String {
    let mut text = String::new();
    for (id, state) in vehicles {
        for i in 0..=(seconds * rate_hz) as usize {
            let time_s = i as f64 / rate_hz;
            let _ = writeln!(text, "{}", line(time_s, id, state(time_s)));
        }
    }
    text
}

/// A vehicle with a constant speed and heading.
pub(super) fn steady(x: f64, y: f64, heading: f64, speed: f64) -> impl Fn(f64) -> State {
    move |t| State {
        x: x + speed * t * heading.cos(),
        y: y + speed * t * heading.sin(),
        heading,
        speed,
    }
}

/// A vehicle that moves from `from` to `to` across a road along x from `start` on.
pub(super) fn changing(
    x: f64,
    from: f64,
    to: f64,
    start: f64,
    speed: f64,
) -> impl Fn(f64) -> State {
    move |t| {
        let share = ((t - start) / 4.0).clamp(0.0, 1.0);
        let y = from + (to - from) * 0.5 * (1.0 - (std::f64::consts::PI * share).cos());
        let rate =
            (to - from) * 0.5 * std::f64::consts::PI / 4.0 * (std::f64::consts::PI * share).sin();
        State {
            x: x + speed * t,
            y,
            heading: (rate / speed).atan(),
            speed,
        }
    }
}

pub(super) fn generic(text: &str) -> Result<TrafficRecording, ReadError> {
    let map = ColumnMap::shipped("generic").expect("shipped");
    let text = format!("time,id,x,y,heading,speed,length,width\n{text}");
    read_csv(text.as_bytes(), "log.csv", &map)
}

pub(super) fn generic_line(t: f64, id: &str, s: State) -> String {
    format!(
        "{t:.4},{id},{:.4},{:.4},{:.6},{:.3},4.5,1.8",
        s.x, s.y, s.heading, s.speed
    )
}

fn one_rule(analysis: &Analysis, stl: &str) -> RuleResult {
    let rule = TrafficRule {
        name: stl.to_owned(),
        stl: stl.to_owned(),
    };
    let file = TrafficRuleFile::of(vec![rule]);
    let bound = BoundRules::bind(&file, &analysis.recording).expect("a rule");
    let found = bound.evaluate(&analysis.recording, &analysis.frame, &analysis.leads);
    found.expect("vehicles").remove(0)
}

#[test]
fn slow_vehicles_and_those_without_lanes_are_evaluated() {
    // Slow pairs were once left out as parked, and pairs off the axes fit no carriageway.
    // The boxes are 7.5 m apart, so a rule of 10 m misses by 2.5 m whatever the speed.
    for speed in [1.5, 4.0, 8.0, 9.0, 20.0] {
        for heading in [0.0, 0.7, 2.5, -1.6] {
            let (behind, ahead) = (
                steady(0.0, 0.0, heading, speed),
                steady(12.0 * heading.cos(), 12.0 * heading.sin(), heading, speed),
            );
            let text = rows(&[("a", &behind), ("b", &ahead)], 10.0, 12.0, &generic_line);
            let analysis = Analysis::of(generic(&text).expect("rows"));
            let found = one_rule(&analysis, "ego.lead.gap >= 10");
            assert_eq!(
                (found.vehicles, found.episodes),
                (1, 1),
                "{speed} m/s, {heading}"
            );
            let worst = found.worst.expect("an episode");
            assert!(
                (worst.robustness + 2.5).abs() < 0.01,
                "{}",
                worst.robustness
            );
        }
    }
}

#[test]
fn lane_changes_belong_to_the_vehicle_that_moves_sideways() {
    // Whoever drives farthest, and in whatever order the vehicles are listed.
    for (speed, from, to) in [(19.5, 3.5, 0.0), (21.0, 3.5, 0.0), (20.5, 0.0, 3.5)] {
        for start in [4.0, 9.0, 15.0] {
            // The follower and the far car stay in the lane into which the third one moves.
            let follower = steady(-20.0, to, 0.0, 20.0);
            let (a, b) = (
                steady(60.0, from, 0.0, 20.0),
                steady(-60.0, from, 0.0, 20.0),
            );
            // A fit along whoever drives farthest gave the lane change to this car.
            let far = steady(90.0, to, 0.0, 20.0);
            let cut = changing(15.0, from, to, start, speed);
            let mut vehicles: Vec<(&str, &dyn Fn(f64) -> State)> = vec![
                ("f", &follower),
                ("a", &a),
                ("b", &b),
                ("far", &far),
                ("cut", &cut),
            ];
            for _ in 0..2 {
                // The order of a file is no information about lanes.
                vehicles.rotate_left(3);
                let text = rows(&vehicles, 10.0, 25.0, &generic_line);
                let analysis = Analysis::of(generic(&text).expect("rows"));
                let (frame, found) = (&analysis.frame, &analysis.situations);
                assert_eq!(frame.carriageways.len(), 1);
                assert_eq!(frame.carriageways[0].lanes.len(), 2, "{speed}, {start}");
                let changes = &found.lane_changes;
                assert_eq!(changes.len(), 1, "{speed}, {from}, {start}: {changes:?}");
                let id = &analysis.recording.tracks[changes[0].track].id;
                assert_eq!(id, "cut");
                assert_eq!(found.cut_ins.len(), 1, "{speed}, {from}, {start}");
            }
        }
    }
}

#[test]
fn a_roundabout_and_laps_have_no_lanes() {
    // Eight vehicles enter from four arms, drive round with a radius of 18 m and leave.
    let arm = |k: usize| {
        move |t: f64| {
            // Each arm is the first one, turned about the middle of the roundabout.
            let turn = std::f64::consts::FRAC_PI_2 * (k % 4) as f64;
            let s = 8.0 * t - 60.0 - 11.0 * (k / 4) as f64;
            let (x, y, heading) = if s < 0.0 {
                (s - 18.0, -3.0, 0.0)
            } else if s < 18.0 * 3.5 {
                let angle = s / 18.0;
                (-18.0 * angle.cos(), -3.0 - 18.0 * angle.sin(), angle - 1.57)
            } else {
                let (angle, rest) = (3.5_f64, s - 63.0);
                let way = angle - 1.57;
                (
                    -18.0 * angle.cos() + rest * way.cos(),
                    -3.0 - 18.0 * angle.sin() + rest * way.sin(),
                    way,
                )
            };
            State {
                x: x * turn.cos() - y * turn.sin(),
                y: x * turn.sin() + y * turn.cos(),
                heading: heading + turn,
                speed: 8.0,
            }
        }
    };
    let arms: Vec<_> = (0..8).map(arm).collect();
    let ids = ["0", "1", "2", "3", "4", "5", "6", "7"];
    let vehicles: Vec<(&str, &dyn Fn(f64) -> State)> = ids
        .into_iter()
        .zip(&arms)
        .map(|(id, state)| (id, state as &dyn Fn(f64) -> State))
        .collect();
    let line = |t: f64, id: &str, s: State| format!("{t:.2},{id},{:.3},{:.3},4.5,1.8", s.x, s.y);
    let text = rows(&vehicles, 10.0, 25.0, &line);
    // Headings are left out: they follow from the positions.
    let text = format!("time,id,x,y,length,width\n{text}");
    let (recording, map) = read_csv_guessed(text.as_bytes(), "log.csv").expect("rows");
    // No shipped map has these columns, so each is found by its usual name.
    assert_eq!(map, "by name");
    let analysis = Analysis::of(recording);
    // A turn of the way is no change of a lane: where the traffic has no lanes, none are
    // invented, and no situation is made of them.
    assert_eq!(analysis.situations.lane_changes, []);
    // Two cars that drive laps pass the same places again and again, without an end of
    // their road. The walk along it once had none, either.
    let laps = |k: f64| {
        move |t: f64| {
            let angle = (12.0 * t + k) / 80.0;
            State {
                x: 80.0 * angle.cos(),
                y: 80.0 * angle.sin(),
                heading: angle + std::f64::consts::FRAC_PI_2,
                speed: 12.0,
            }
        }
    };
    // The second one is 20 m ahead on the circle.
    let (a, b) = (laps(0.0), laps(20.0));
    let text = rows(&[("a", &a), ("b", &b)], 10.0, 90.0, &generic_line);
    let analysis = Analysis::of(generic(&text).expect("rows"));
    assert_eq!(analysis.situations.lane_changes, []);
    // The cars are 20 m apart along the lap, bumper to bumper 15.5 m.
    let found = one_rule(&analysis, "ego.lead.gap >= 16");
    assert_eq!(
        (found.vehicles, found.share() > 0.4),
        (1, true),
        "{found:?}"
    );
}

#[test]
fn units_that_contradict_the_positions_are_refused_by_name() {
    let (a, b) = (steady(0.0, 0.0, 0.4, 20.0), steady(40.0, 3.5, 1.9, 15.0));
    let read = |line: &dyn Fn(f64, &str, State) -> String| {
        let text = rows(&[("a", &a), ("b", &b)], 10.0, 10.0, line);
        generic(&text)
            .err()
            .map(|it| it.to_string())
            .unwrap_or_default()
    };
    // One column is in another unit, and the positions stay.
    let with = |speed: f64, heading: &dyn Fn(f64) -> f64| {
        read(&|t, id, s| {
            let s = State {
                speed: s.speed * speed,
                heading: heading(s.heading),
                ..s
            };
            generic_line(t, id, s)
        })
    };
    let north = std::f64::consts::FRAC_PI_2;
    // The same rows in the right units contradict nothing.
    assert_eq!(with(1.0, &|it| it), "");
    for (said, fits) in [
        (with(3.6, &|it| it), "km/h"),
        (with(2.23694, &|it| it), "mph"),
        (with(3.28084, &|it| it), "ft/s"),
        (with(1.0, &f64::to_degrees), "which fits degrees"),
        (with(1.0, &|it| north - it), "radians of a compass"),
        (
            with(1.0, &|it| (north - it).to_degrees()),
            "degrees of a compass",
        ),
        (with(1.0, &|it| -it), "clockwise angles"),
        (read(&|t, id, s| generic_line(1000.0 * t, id, s)), "apart"),
    ] {
        assert!(said.contains(fits), "{fits}: {said}");
    }
    // Speeds and headings agree at any rate that is wrong by a factor, but the columns of
    // velocity against the steps of the positions do not.
    // A frame rate that is not that of the map.
    // This map says 25 Hz, and the rows are of 30 Hz.
    let map = ColumnMap::shipped("highd").expect("shipped");
    let header = "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n";
    let line = |t: f64, id: &str, s: State| {
        let (sin, cos) = s.heading.sin_cos();
        let frame = (30.0 * t).round();
        format!(
            "{frame},{id},{},{},4.5,1.8,{},{},0,0",
            s.x,
            -s.y,
            s.speed * cos,
            -s.speed * sin
        )
    };
    let text = header.to_owned() + &rows(&[("a", &a), ("b", &b)], 30.0, 10.0, &line);
    let error = read_csv(text.as_bytes(), "t.csv", &map).expect_err("30 Hz");
    assert!(error.to_string().contains("30.00 Hz"), "{error}");
}

#[test]
fn names_units_separators_and_orders_of_columns_do_not_matter() {
    let (a, b) = (steady(5.0, 7.0, 0.4, 20.0), steady(40.0, 3.5, 1.9, 15.0));
    let vehicles: [(&str, &dyn Fn(f64) -> State); 2] = [("a", &a), ("b", &b)];
    // The reference is the same motion in the generic format.
    let expected = generic(&rows(&vehicles, 20.0, 5.0, &generic_line)).expect("rows");
    // Each file states one motion in the words of another program: its names, its units, its
    // separator, and its order. The clock is in seconds, milliseconds or nanoseconds.
    type Line<'a> = &'a dyn Fn(f64, &str, State) -> String;
    let files: [(&str, Line<'_>); 5] = [
        (
            "track_id,timestamp,x_m,y_m,yaw_deg,speed_kmh,length,width",
            &|t, id, s| {
                format!(
                    "{id},{t:.3},{},{},{},{},4.5,1.8",
                    s.x,
                    s.y,
                    s.heading.to_degrees(),
                    3.6 * s.speed
                )
            },
        ),
        ("x;y;width;length;vx;vy;object_id;sim_time", &|t, id, s| {
            let (sin, cos) = s.heading.sin_cos();
            format!(
                "{};{};1.8;4.5;{};{};{id};{t}",
                s.x,
                s.y,
                s.speed * cos,
                s.speed * sin
            )
        }),
        (
            "time_ms\tvehicleId\tposX\tposY\tspeed [mph]\tlength\twidth",
            &|t, id, s| {
                let mph = s.speed * 3600.0 / 1609.344;
                format!(
                    "{}\t{id}\t{}\t{}\t{mph}\t4.5\t1.8",
                    (1000.0 * t).round(),
                    s.x,
                    s.y
                )
            },
        ),
        (
            "timestamp_ns,id,x,y,yaw [deg],velocity (km/h),length,width",
            &|t, id, s| {
                let nanos = 1_700_000_000_000_000_000_u64 + (t * 1e9).round() as u64;
                format!(
                    "{nanos},{id},{},{},{},{},4.5,1.8",
                    s.x,
                    s.y,
                    s.heading.to_degrees(),
                    3.6 * s.speed
                )
            },
        ),
        (
            "psi_rad,agent_type,timestamp_ms,track_id,frame_id,x,y,vx,vy,length,width",
            &|t, id, s| {
                let (sin, cos) = s.heading.sin_cos();
                format!(
                    "{},car,{:.0},{id},{:.0},{},{},{},{},4.5,1.8",
                    s.heading,
                    1000.0 * t,
                    20.0 * t,
                    s.x,
                    s.y,
                    s.speed * cos,
                    s.speed * sin
                )
            },
        ),
    ];
    for (header, line) in files {
        let text = format!("{header}\n{}", rows(&vehicles, 20.0, 5.0, line));
        let read = read_csv_guessed(text.as_bytes(), "log.csv");
        let (recording, _) = read.unwrap_or_else(|it| panic!("{header}: {it}"));
        // A rational fit gives the period to the bit, also from rounded stamps.
        assert_eq!(recording.dt_s, 0.05, "{header}");
        for (a, b) in expected.tracks.iter().zip(&recording.tracks) {
            assert_eq!((&a.id, a.len(), a.length_m), (&b.id, b.len(), b.length_m));
            for i in 0..a.len() {
                assert!((a.x_m[i] - b.x_m[i]).abs() < 1e-3, "{header}");
                assert!((a.speed_mps[i] - b.speed_mps[i]).abs() < 1e-2, "{header}");
                assert!(
                    (a.heading_rad[i] - b.heading_rad[i]).abs() < 1e-3,
                    "{header}"
                );
            }
        }
    }
    // A column that is named, where no name is a usual one.
    let line = |t: f64, id: &str, s: State| format!("{id},{},{},{t}", s.x, s.y);
    let text = "id,x,y,k\n".to_owned() + &rows(&vehicles, 20.0, 5.0, &line);
    assert!(read_csv_guessed(text.as_bytes(), "log.csv").is_err());
    let (named, _) = read_csv_timed(text.as_bytes(), "log.csv", Some("k")).expect("rows");
    assert_eq!(named.dt_s, 0.05);
}

#[test]
fn sumo_writes_the_same_motion_in_xml_and_csv() {
    let (a, b) = (steady(5.0, 7.0, 0.4, 20.0), steady(40.0, 3.5, 1.9, 15.0));
    // SUMO counts its angles clockwise from north, in degrees.
    let north = std::f64::consts::FRAC_PI_2;
    let angle = |s: State| (north - s.heading).to_degrees().rem_euclid(360.0);
    let csv = |t: f64, id: &str, s: State| {
        format!(
            "{t:.2};{};{id};;{};truck;{};{}",
            angle(s),
            s.speed,
            s.x,
            s.y
        )
    };
    let header = "timestep_time;vehicle_angle;vehicle_id;vehicle_lane;vehicle_speed;\
                  vehicle_type;vehicle_x;vehicle_y\n";
    let text =
        // Its CSV has a row without a vehicle for a step in which nobody drives.
        header.to_owned() + "0.00;;;;;;;\n" + &rows(&[("a", &a), ("b", &b)], 10.0, 5.0, &csv);
    let (csv, map) = read_csv_guessed(text.as_bytes(), "fcd.csv").expect("rows");
    // The empty step is counted, because a row without an identity is usually a fault.
    assert_eq!((map, csv.counts.without_id), ("sumo", 1));
    let mut text = String::from("<fcd-export>\n");
    for i in 0..=50 {
        let t = 0.1 * f64::from(i);
        // Both writers of SUMO describe one simulation, so their readers have to agree.
        let _ = write!(text, "<timestep time=\"{t:.2}\">");
        for (id, s) in [("a", a(t)), ("b", b(t))] {
            let _ = write!(
                text,
                "<vehicle id=\"{id}\" x=\"{}\" y=\"{}\" angle=\"{}\" type=\"truck\" speed=\"{}\"/>",
                s.x,
                s.y,
                angle(s),
                s.speed
            );
        }
        text += "</timestep>\n";
    }
    text += "</fcd-export>\n";
    let xml = read_fcd(text.as_bytes(), "fcd.xml").expect("rows");
    for (a, b) in csv.tracks.iter().zip(&xml.tracks) {
        assert_eq!((&a.id, a.class, a.len()), (&b.id, b.class, b.len()));
        // The type `truck` gives both the size of its class, because FCD has no sizes.
        assert!((a.x_m[7] - b.x_m[7]).abs() < 1e-9 && a.length_m == b.length_m);
    }
}

/// A CommonRoad scenario of one parked van and some moving obstacles.
fn commonroad(obstacle: &str, time: &str) -> String {
    let mut text = String::from(
        "<?xml version='1.0'?>\n<commonRoad timeStepSize=\"0.1\" commonRoadVersion=\"2020a\">\n\
         <lanelet id=\"1\"><leftBound><point><x>1</x><y>1</y></point></leftBound></lanelet>\n\
         <staticObstacle id=\"9\"><type>parkedVehicle</type><shape><rectangle>\
         <length>5</length><width>2</width></rectangle></shape><initialState><position><point>\
         <x>3</x><y>4</y></point></position><orientation><exact>0</exact></orientation>\
         <time><exact>0</exact></time></initialState></staticObstacle>\n",
    );
    for (id, kind, from_m, speed_mps) in [("30", "truck", 40.0, 18.0), ("31", "car", 0.0, 25.0)] {
        text += &format!(
            "<{obstacle} id=\"{id}\">{}<type>{kind}</type><shape><rectangle><length>4.4</length>\
             <width>1.9</width></rectangle></shape>",
            if obstacle == "obstacle" {
                "<role>dynamic</role>"
            } else {
                ""
            }
        );
        for step in 0..50 {
            let name = if step == 0 { "initialState" } else { "state" };
            let x_m = 5000.0 + from_m + 0.1 * speed_mps * f64::from(step);
            text += &format!(
                "<{name}><position><point><x>{x_m}</x><y>-7</y></point></position>\n\
                 <orientation><exact>0</exact></orientation><time>{time}</time>\
                 <velocity><exact>{speed_mps}</exact></velocity></{name}>"
            )
            .replace("STEP", &step.to_string());
        }
        text += &format!("</{obstacle}>\n");
    }
    text + "<planningProblem id=\"1\"><initialState><position><point><x>0</x><y>0</y></point>\
            </position></initialState></planningProblem></commonRoad>"
}

#[test]
fn commonroad_scenarios_are_recordings_of_their_moving_obstacles() {
    for obstacle in ["dynamicObstacle", "obstacle"] {
        let text = commonroad(obstacle, "<exact>STEP</exact>");
        let (recording, format) = read_xml(text.as_bytes(), "cr.xml").expect("states");
        assert_eq!((format, recording.tracks.len()), ("commonroad", 2));
        let [truck, car] = &recording.tracks[..] else {
            panic!("two obstacles");
        };
        assert_eq!((&*truck.id, truck.class.name()), ("30", "truck"));
        assert_eq!((&*car.id, car.class.name(), car.len()), ("31", "car", 50));
        assert!((recording.dt_s - 0.1).abs() < 1e-9 && (car.length_m - 4.4).abs() < 1e-6);
        // By hand: 40 m apart, closing at 7 m/s, after 2 s.
        assert!((truck.x_m[20] - car.x_m[20] - 26.0).abs() < 1e-9);
    }
}

#[test]
fn a_number_is_whole_whatever_cuts_its_text() {
    let plain = commonroad("dynamicObstacle", "<exact>STEP</exact>");
    let read = |text: &str| read_xml(text.as_bytes(), "cr.xml").expect("states").0;
    for cut in ["4<!-- of 49 -->9", "4&#57;", "<![CDATA[49]]>", "4<?a?>9"] {
        let text = plain.replace("<exact>49</exact>", &format!("<exact>{cut}</exact>"));
        assert_ne!(text, plain);
        assert_eq!(read(&text).tracks, read(&plain).tracks, "{cut}");
    }
}

#[test]
fn xml_that_readers_take_in_two_ways_is_refused() {
    let exact = commonroad("dynamicObstacle", "<exact>STEP</exact>");
    for (text, says) in [
        (
            exact.replace(
                "timeStepSize=\"0.1\"",
                "timeStepSize=\"0.1\" timeStepSize=\"1\"",
            ),
            "line 2: invalid XML: ",
        ),
        (
            exact.replace("id=\"30\"", "id=\"30\" note=\"&car;\""),
            "line 5: invalid XML: ",
        ),
        (
            format!("{exact}\n<fcd-export/>"),
            "`fcd-export` is a second root element",
        ),
        (
            exact.replace("<commonRoad ", "<!DOCTYPE a [<!ENTITY b 'c'>]><commonRoad "),
            "line 2: invalid XML: it declares entities",
        ),
        // An element of another vocabulary only has the same name.
        (
            exact.replace("dynamicObstacle", "x:dynamicObstacle"),
            "no dynamic obstacle",
        ),
    ] {
        let error = read_xml(text.as_bytes(), "cr.xml").expect_err(says);
        assert!(error.to_string().contains(says), "{says}: {error}");
    }
}

#[test]
fn commonroad_scenarios_without_exact_motion_are_refused_with_their_line() {
    let exact = commonroad("dynamicObstacle", "<exact>STEP</exact>");
    let interval = "<intervalStart>STEP</intervalStart><intervalEnd>9</intervalEnd>";
    for (text, says) in [
        (
            commonroad("dynamicObstacle", interval),
            "a state of obstacle 30 has no `time/exact`",
        ),
        (
            exact.replace("timeStepSize=\"0.1\"", "timeStepSize=\"0\""),
            "0 s apart",
        ),
        (
            exact.replace("timeStepSize=\"0.1\"", ""),
            "has no `timeStepSize`",
        ),
        (
            exact.replace("<x>5040</x>", "<x>1e300</x>"),
            "line 6: `x` of `30` is 1e300 m from the origin",
        ),
        (
            exact.replace("<x>5040</x>", "<x>far</x>"),
            "not a finite number: `far`",
        ),
        (
            exact.replace("<exact>49</exact>", "<exact>1e12</exact>"),
            "the instants span 100000000000 s",
        ),
        (
            commonroad("environmentObstacle", "<exact>STEP</exact>"),
            "no dynamic obstacle",
        ),
    ] {
        let error = read_xml(text.as_bytes(), "cr.xml").expect_err(says);
        assert!(error.to_string().contains(says), "{says}: {error}");
        assert!(!error.help().is_empty());
    }
}

#[test]
fn boxes_of_nothing_have_the_size_of_their_class() {
    let header = "trackId,frame,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,\
                  xAcceleration,yAcceleration\n";
    // inD gives pedestrians and bicycles a box of 0 × 0, which is no measurement.
    let line = |size: &'static str| {
        move |t: f64, id: &str, s: State| {
            let frame = (25.0 * t).round();
            format!("{id},{frame},{},{},0,{size},{},0,0,0", s.x, s.y, s.speed)
        }
    };
    let (walker, car) = (steady(0.0, 9.0, 0.0, 2.5), steady(0.0, 0.0, 0.0, 12.0));
    let text = header.to_owned()
        + &rows(&[("7", &walker)], 25.0, 4.0, &line("0,0"))
        + &rows(&[("8", &car)], 25.0, 4.0, &line("1.8,4.6"));
    let (recording, map) = read_csv_guessed(text.as_bytes(), "00_tracks.csv").expect("rows");
    assert_eq!(map, "ind");
    let shown = recording
        .tracks
        .iter()
        .map(|it| (it.class.name(), (10.0 * it.length_m).round()));
    assert_eq!(
        shown.collect::<Vec<_>>(),
        // Half a metre is assumed for the pedestrian, and the car keeps its measured length.
        [("pedestrian", 5.0), ("car", 46.0)]
    );
    assert_eq!(recording.counts.assumed_sizes, 1);
}

#[test]
fn rates_of_rounded_stamps_are_those_that_made_them() {
    let (a, b) = (steady(5.0, 7.0, 0.4, 20.0), steady(40.0, 3.5, 1.9, 15.0));
    for rate_hz in [10.0, 15.0, 24.0, 25.0, 30.0, 60.0] {
        // Stamps in milliseconds, in tenths of them, and in full digits.
        for digits in [3, 4, 9] {
            let line = |t: f64, id: &str, s: State| {
                // An offset takes digits from the stamps, as an epoch does.
                let t = format!("{:.*}", digits, 1000.0 + t);
                format!(
                    "{t},{id},{:.4},{:.4},{:.6},{:.3},4.5,1.8",
                    s.x, s.y, s.heading, s.speed
                )
            };
            let text = rows(&[("a", &a), ("b", &b)], rate_hz, 8.0, &line);
            let recording = generic(&text).expect("rows");
            assert_eq!(recording.dt_s, 1.0 / rate_hz, "{rate_hz} Hz, {digits}");
            // Rounding moves no row off its sample.
            assert_eq!(recording.counts.off_grid, 0, "{rate_hz} Hz, {digits}");
        }
    }
}
