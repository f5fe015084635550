//! Recordings from arrays.

use brakecheck_traffic::{Class, ColumnMap, RecordingColumns, TrafficRecording, read_csv};

#[test]
fn arrays_give_the_recording_of_a_file_with_the_same_rows() {
    let (mut ids, mut times, mut x) = (Vec::new(), Vec::new(), Vec::new());
    let mut text = "time,id,x,y,heading,speed,length,width\n".to_owned();
    for i in [3, 0, 1, 2, 4, 12, 13, 14] {
        for id in [7_u64, 9] {
            let (t, place) = (100.0 + 0.1 * f64::from(i), 2.0 * f64::from(i) + id as f64);
            text += &format!("{t},{id},{place},5,0.1,20,4.5,1.8\n");
            ids.push(id);
            times.push(t);
            x.push(place);
        }
    }
    let all = |value: f64| vec![value; ids.len()];
    let (y, heading, speed) = (all(5.0), all(0.1), all(20.0));
    let (length, width) = (all(4.5), all(1.8));
    let mut columns = RecordingColumns::new(&ids, &times, &x, &y);
    columns.heading_rad = Some(&heading);
    columns.speed_mps = Some(&speed);
    columns.size_m = Some((&length, &width));
    let recording = TrafficRecording::from_columns("rows", &columns).expect("valid");
    let map = ColumnMap::shipped("generic").expect("shipped");
    let mut expected = read_csv(text.as_bytes(), "rows", &map).expect("valid");
    expected.reading.clone_from(&recording.reading);
    assert_eq!(recording, expected);
    assert_eq!(
        (recording.counts.holes_split, recording.tracks.len()),
        (2, 4)
    );

    // Without sizes and classes those of a car are assumed, and it is counted.
    columns.size_m = None;
    let assumed = TrafficRecording::from_columns("rows", &columns).expect("valid");
    assert_eq!(assumed.counts.assumed_sizes, 2);
    let classes = vec![Class::Truck; ids.len()];
    columns.classes = Some(&classes);
    let trucks = TrafficRecording::from_columns("rows", &columns).expect("valid");
    assert_eq!(trucks.tracks[0].class, Class::Truck);
    assert_eq!(trucks.tracks[0].length_m, Class::Truck.usual_size_m()[0]);
}

#[test]
fn every_mistake_names_its_array_and_index() {
    let ids = ["a", "a", "b"];
    let (times, x, y) = ([0.0, 0.1, 0.1], [0.0, 1.0, 5.0], [0.0; 3]);
    let good = RecordingColumns::new(&ids, &times, &x, &y);
    assert!(TrafficRecording::from_columns("arrays", &good).is_ok());
    let infinite = [0.0, f64::INFINITY, 0.0];
    let flat = [1.8, 0.0, 1.8];
    let short = [1.0; 2];
    let mut cases = [good; 5];
    cases[0].x_m = &x[..2];
    cases[1].ids = &ids[..1];
    cases[2].speed_mps = Some(&infinite);
    cases[3].size_m = Some((&flat, &flat));
    cases[4].size_m = Some((&short, &flat));
    let messages = [
        "`arrays`: `x_m` has 2 values, the times have 3",
        "`arrays`: `ids` has 1 values, the times have 3",
        "`arrays`, index 1: `speed_mps` of `the arrays` is not a finite number: `inf`",
        "`arrays`, index 1: `length_m` of `the arrays` is not positive: 0",
        "`arrays`: `length_m` has 2 values, the times have 3",
    ];
    for (columns, message) in cases.iter().zip(messages) {
        let error = TrafficRecording::from_columns("arrays", columns).expect_err(message);
        assert_eq!(error.to_string(), message);
    }
    let none: [&str; 0] = [];
    let empty = RecordingColumns::new(&none, &[], &[], &[]);
    let error = TrafficRecording::from_columns("arrays", &empty).expect_err("empty");
    assert_eq!(error.to_string(), "`arrays`: no road user has two rows");
}

#[test]
fn a_trailer_is_ahead_of_others_and_follows_nobody() {
    let (mut ids, mut times_s, mut x_m, mut classes) = (vec![], vec![], vec![], vec![]);
    let users = [
        ("car", 0.0, Class::Car),
        ("trailer", 40.0, Class::Trailer),
        ("tractor", 48.0, Class::Truck),
    ];
    for i in 0..240 {
        for (id, at_m, class) in users {
            ids.push(id);
            times_s.push(0.05 * f64::from(i));
            x_m.push(at_m + f64::from(i));
            classes.push(class);
        }
    }
    let y_m = vec![0.0; x_m.len()];
    let (lengths_m, widths_m) = (vec![6.0; x_m.len()], vec![2.0; x_m.len()]);
    let mut columns = RecordingColumns::new(&ids, &times_s, &x_m, &y_m);
    columns.classes = Some(&classes);
    columns.size_m = Some((&lengths_m, &widths_m));
    let analysis = brakecheck_traffic::Analysis::of(
        TrafficRecording::from_columns("arrays", &columns).expect("valid"),
    );
    let lead = |i: usize| analysis.leads.of[i][100].map(|it| (it.track, it.gap_m));
    let (track, gap_m) = lead(0).expect("the trailer");
    assert_eq!(track, 1);
    assert!((gap_m - 34.0).abs() < 0.1, "{gap_m}");
    assert_eq!((lead(1), lead(2)), (None, None));
    // Only the two that are driven count in rules.
    let rule = brakecheck_traffic::TrafficRule {
        name: "slow".to_owned(),
        stl: "always (ego.speed <= 1)".to_owned(),
    };
    let rules = brakecheck_traffic::TrafficRuleFile::of(vec![rule]);
    let rules = brakecheck_traffic::BoundRules::bind(&rules, &analysis.recording).expect("a rule");
    let results = rules
        .evaluate(&analysis.recording, &analysis.frame, &analysis.leads)
        .expect("vehicles");
    assert_eq!(results[0].vehicles, 2);
}
