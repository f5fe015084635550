//! Files beside the tracks of highD and the inD family.

use std::fmt::Write;

use brakecheck_traffic::{
    Class, ColumnMap, CsvColumns, ReadError, RecordingMeta, TrafficRecording,
};

/// Rate that is not that of the shipped map.
const RATE_HZ: f64 = 30.0;

/// Tracks of inD: a car of 20 m/s, a truck of 15 m/s and a pedestrian without a box.
fn tracks() -> String {
    let mut text = "recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,\
                    xVelocity,yVelocity,xAcceleration,yAcceleration\n"
        .to_owned();
    let users = [
        (0, 10, 20.0, [1.8, 4.5]),
        (1, 20, 15.0, [2.5, 9.0]),
        // The inD family records pedestrians without a size.
        (2, 10, 1.5, [0.0, 0.0]),
    ];
    for (id, first, speed_mps, [width_m, length_m]) in users {
        for i in 0..60 {
            let x_m = speed_mps * f64::from(i) / RATE_HZ;
            let y_m = 10.0 * f64::from(id);
            // Frames count from the beginning of the recording, not of the track.
            let frame = first + i;
            let _ = writeln!(
                text,
                "7,{id},{frame},{i},{x_m},{y_m},0,{width_m},{length_m},{speed_mps},0,0,0"
            );
        }
    }
    text
}

const TRACKS_META: &str = "recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class\n\
                           7,0,10,69,60,1.8,4.5,car\n\
                           7,1,20,79,60,2.5,9.0,truck_bus\n\
                           7,2,10,69,60,0.0,0.0,pedestrian\n";
const RECORDING_META: &str = "recordingId,locationId,frameRate,speedLimit,duration,numTracks\n\
                              7,4,30,13.9,2.7,3\n";

fn read(
    tracks: &str,
    tracks_meta: Option<&str>,
    recording_meta: Option<&str>,
) -> Result<TrafficRecording, ReadError> {
    let mut meta = RecordingMeta::default();
    if let Some(text) = tracks_meta {
        meta = meta.with_tracks(text.as_bytes(), "07_tracksMeta.csv")?;
    }
    if let Some(text) = recording_meta {
        meta = meta.with_recording(text.as_bytes(), "07_recordingMeta.csv")?;
    }
    let columns = CsvColumns {
        meta: Some(&meta),
        ..CsvColumns::default()
    };
    Ok(columns.read(tracks.as_bytes(), "07_tracks.csv")?.0)
}

#[test]
fn rate_classes_and_sizes_are_those_of_the_files_beside() {
    // Without them the rate is that of the map, which the speeds contradict.
    let alone = read(&tracks(), None, None).expect_err("25 Hz");
    assert!(alone.to_string().contains("30.00 Hz"), "{alone}");
    let found = read(&tracks(), Some(TRACKS_META), Some(RECORDING_META)).expect("rows");
    assert!((found.dt_s - 1.0 / RATE_HZ).abs() < 1e-12);
    let classes: Vec<Class> = found.tracks.iter().map(|it| it.class).collect();
    assert_eq!(classes, [Class::Car, Class::Truck, Class::Pedestrian]);
    for words in [
        "frames `frame` at 30 Hz",
        "`07_recordingMeta.csv`: 30 Hz, location 4",
        "`07_tracksMeta.csv`: classes and sizes of 3 tracks",
    ] {
        assert!(found.reading.contains(words), "{}", found.reading);
    }
    // A box that only the file beside has.
    let boxes = TRACKS_META.replace("0.0,0.0,ped", "0.6,0.5,ped");
    let found = read(&tracks(), Some(&boxes), Some(RECORDING_META)).expect("rows");
    assert_eq!(
        (found.tracks[2].length_m, found.tracks[2].width_m),
        (0.5, 0.6)
    );
    assert_eq!(found.counts.assumed_sizes, 0);
    // Tracks that were cut away are counted.
    let more = format!("{TRACKS_META}7,3,0,9,10,1.8,4.5,car\n");
    let recording = RECORDING_META.replace(",3\n", ",4\n");
    let found = read(&tracks(), Some(&more), Some(&recording)).expect("rows");
    assert!(
        found.reading.contains("1 more have no rows"),
        "{}",
        found.reading
    );
}

#[test]
fn contradictions_name_both_files_and_both_values() {
    let tracks_meta = |from: &str, to: &str| TRACKS_META.replace(from, to);
    let recording_meta = |from: &str, to: &str| RECORDING_META.replace(from, to);
    let cases: [(String, String, &str, &str); 10] = [
        (
            tracks_meta("7,1,20,79,60", "7,1,20,89,70"),
            RECORDING_META.to_owned(),
            "`07_tracks.csv`: track `1` has 60 rows",
            "`07_tracksMeta.csv:3`: `numFrames` is 70",
        ),
        (
            tracks_meta("7,1,20,79,60", "7,1,20,79,70"),
            RECORDING_META.to_owned(),
            "`07_tracksMeta.csv:3`: `numFrames` is 70",
            "`initialFrame` is 20 and `finalFrame` is 79",
        ),
        (
            tracks_meta("7,1,20,79,60", "7,1,21,80,60"),
            RECORDING_META.to_owned(),
            "`07_tracks.csv`: track `1` begins with frame 20",
            "`07_tracksMeta.csv:3`: `initialFrame` is 21",
        ),
        (
            tracks_meta("1.8,4.5,car", "1.8,5.5,car"),
            RECORDING_META.to_owned(),
            "`07_tracks.csv`: track `0` has a `length` of 4.5 m",
            "`07_tracksMeta.csv:2`: `length` is 5.5 m",
        ),
        (
            tracks_meta("7,2,", "7,5,"),
            RECORDING_META.to_owned(),
            "`07_tracks.csv`: track `2` has 60 rows",
            "`07_tracksMeta.csv`: there is no such track",
        ),
        (
            tracks_meta("7,2,", "7,1,"),
            RECORDING_META.to_owned(),
            "`07_tracksMeta.csv:4`: `trackId` is 1",
            "`07_tracksMeta.csv:3`: `trackId` is 1, too",
        ),
        (
            TRACKS_META.to_owned(),
            recording_meta(",3\n", ",384\n"),
            "`07_recordingMeta.csv`: `numTracks` is 384",
            "`07_tracksMeta.csv`: it has 3 tracks",
        ),
        (
            TRACKS_META.to_owned(),
            recording_meta("4,30,", "4,10,"),
            "`07_recordingMeta.csv`: `frameRate` is 10 and `duration` is 2.7",
            "`07_tracks.csv`: at this rate its frames last 6.90 s",
        ),
        (
            TRACKS_META.to_owned(),
            recording_meta("4,30,", "4,60,"),
            "the recorded speeds are 0.500 times those of the positions",
            "a frame rate of 30.00 Hz",
        ),
        (
            TRACKS_META.to_owned(),
            recording_meta("4,30,", "4,0,"),
            "`07_recordingMeta.csv`, line 2, column `frameRate`: `0`",
            "not a finite number",
        ),
    ];
    for (tracks_meta, recording_meta, said, other) in cases {
        let error = read(&tracks(), Some(&tracks_meta), Some(&recording_meta)).expect_err(said);
        let text = error.to_string();
        assert!(
            text.contains(said) && text.contains(other),
            "{text}\n{said}\n{other}"
        );
        assert!(!error.help().is_empty());
    }
}

#[test]
fn a_map_of_ones_own_may_not_state_another_rate_or_period() {
    let meta = RecordingMeta::default()
        .with_recording(RECORDING_META.as_bytes(), "r.csv")
        .expect("a row");
    let text = ColumnMap::shipped_text("ind").expect("shipped");
    let read = |map: &str, tracks: &str| {
        let map: ColumnMap = ron::from_str(map).expect("a map");
        let columns = CsvColumns {
            map: Some(&map),
            meta: Some(&meta),
            ..CsvColumns::default()
        };
        let read = columns.read(tracks.as_bytes(), "t.csv");
        read.err().map(|it| it.to_string()).unwrap_or_default()
    };
    let other = read(&text.replace("rate_hz: 25.0", "rate_hz: 50.0"), &tracks());
    assert_eq!(
        other,
        "`r.csv`: `frameRate` is 30, but `the column map`: `rate_hz` is 50"
    );
    assert_eq!(read(text, &tracks()), "");
    // Time stamps have a period of their own, here of 1 s per frame.
    let stamps = text
        .replace(
            "Frames(column: \"frame\", rate_hz: 25.0)",
            "Seconds(\"frame\")",
        )
        .replace("Components(\"xVelocity\", \"yVelocity\")", "Derived");
    let said = read(&stamps, &tracks());
    assert!(
        said.contains("but `t.csv`: at this rate its frames last 69.00 s"),
        "{said}"
    );
}

#[test]
fn in_highd_the_width_is_the_length() {
    let mut tracks =
        "frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration\n".to_owned();
    for i in 0..50 {
        let x_m = 30.0 * f64::from(i) / 25.0;
        let _ = writeln!(tracks, "{},1,{x_m},8,12.0,2.5,30,0,0,0", i + 1);
    }
    let meta = |length_m: f64| {
        format!(
            "id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection\n\
             1,{length_m},2.5,1,50,50,Truck,2\n"
        )
    };
    let found = read(&tracks, Some(&meta(12.0)), None).expect("rows");
    let track = &found.tracks[0];
    assert_eq!(
        (track.class, track.length_m, track.width_m),
        (Class::Truck, 12.0, 2.5)
    );
    let error = read(&tracks, Some(&meta(14.0)), None)
        .expect_err("14 m")
        .to_string();
    assert!(
        error.contains("`width` of 12 m") && error.contains("`width` is 14 m"),
        "{error}"
    );
}
