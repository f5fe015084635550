//! Lanes, followings and cut-ins of traffic whose truth is known.

use std::collections::BTreeMap;

use brakecheck_traffic::{ColumnMap, LaneFrame, Leads, Situations, TrafficRecording, read_csv};

use crate::synthetic::{self, Row};

/// Recording of synthetic rows in the DLR format.
pub fn recorded(rows: &[Row]) -> TrafficRecording {
    let map = ColumnMap::shipped("dlr").expect("shipped");
    let text = synthetic::dlr(rows, 1.003);
    read_csv(text.as_bytes(), "log.csv", &map).unwrap_or_else(|it| panic!("{it}"))
}

#[test]
fn lanes_are_found_within_a_decimetre() {
    let (rows, _) = synthetic::traffic(1, 25, 90.0);
    let recording = recorded(&rows);
    // Two directions of two lanes each, without a map.
    let frame = LaneFrame::fit(&recording);
    assert_eq!(frame.carriageways.len(), 2);
    for carriageway in &frame.carriageways {
        // Lane 0 is the reference, and the synthetic lanes are 3.75 m wide.
        let offsets: Vec<f64> = carriageway.lanes.iter().map(|it| it.offset_m).collect();
        assert_eq!(offsets.len(), 2, "{offsets:?}");
        assert!(
            offsets[0].abs() < 0.1 && (offsets[1] - 3.75).abs() < 0.1,
            "{offsets:?}"
        );
        assert!(carriageway.lanes.iter().all(|it| it.wander_m < 0.3));
        assert!(carriageway.outside < 0.02, "{}", carriageway.outside);
    }
    // Every row is within 0.3 m of its true offset.
    let truth: BTreeMap<(String, usize), f64> = rows
        .iter()
        .map(|row| ((row_id(row), row.sample), row.lateral_m))
        .collect();
    let first = rows.first().map_or(0, |row| row.sample);
    for (track, placed) in recording.tracks.iter().zip(&frame.tracks) {
        let placed = placed.as_ref().expect("every vehicle is on a carriageway");
        for (i, lateral_m) in placed.lateral_m.iter().enumerate() {
            let key = (track.id.clone(), first + track.first_sample + i);
            let off = lateral_m - truth[&key];
            assert!(off.abs() < 0.3, "{key:?} is off by {off} m");
        }
    }
}

fn row_id(row: &Row) -> String {
    (1_728_280_701_000_000 + row.id).to_string()
}

#[test]
fn gaps_are_from_bumper_to_bumper() {
    let (rows, _) = synthetic::traffic(2, 20, 60.0);
    let recording = recorded(&rows);
    let frame = LaneFrame::fit(&recording);
    let leads = Leads::find(&recording, &frame);
    // The truth is that of the generator, by vehicle and sample.
    let at: BTreeMap<(String, usize), &Row> = rows
        .iter()
        .map(|row| ((row_id(row), row.sample), row))
        .collect();
    let first = rows.first().map_or(0, |row| row.sample);
    let mut seen = 0;
    for (track, leads) in recording.tracks.iter().zip(&leads.of) {
        for (i, lead) in leads.iter().enumerate() {
            let Some(lead) = lead else { continue };
            let sample = first + track.first_sample + i;
            let own = at[&(track.id.clone(), sample)];
            let ahead = at[&(recording.tracks[lead.track].id.clone(), sample)];
            // Distances are along the right lane, which is longer or shorter than the middle.
            let gap_m = ahead.front_m - ahead.length_m - own.front_m;
            let off = lead.gap_m - gap_m;
            assert!(
                off.abs() < 0.1 + 0.006 * gap_m,
                "{gap_m} m is {} m",
                lead.gap_m
            );
            // A lead on the opposite carriageway would be an oncoming car.
            assert_eq!(own.direction, ahead.direction);
            seen += 1;
        }
    }
    // A test without rows would pass.
    assert!(seen > 10_000, "{seen}");
}

#[test]
fn every_cut_in_is_found_once() {
    let (rows, made) = synthetic::traffic(3, 25, 90.0);
    let recording = recorded(&rows);
    let frame = LaneFrame::fit(&recording);
    let leads = Leads::find(&recording, &frame);
    let found = Situations::find(&recording, &frame, &leads);
    assert!(made >= 20, "{made} cut-ins are too few for this test");
    let changes: Vec<(u8, u8)> = found
        .lane_changes
        .iter()
        .map(|it| (it.from, it.to))
        .collect();
    // The generator lets vehicles move from the left lane to the right one only.
    assert!(changes.iter().all(|it| *it == (1, 0)), "{changes:?}");
    // Those at the end of the recording are not finished.
    assert!(
        (made - 3..=made).contains(&found.cut_ins.len()),
        "{made}, {}",
        found.cut_ins.len()
    );
    for cut_in in &found.cut_ins {
        // At the line, the cosine of 4 s moves by 3.75 · π / 8 m/s.
        assert!(
            (cut_in.lateral_mps - 1.4).abs() < 0.15,
            "{}",
            cut_in.lateral_mps
        );
        assert!((0.0..100.0).contains(&cut_in.at_line.gap_m));
        // The follower is behind the changing vehicle, and was in its new lane before.
        assert_eq!(cut_in.at_line.track, cut_in.change.track);
        let (follower, change) = (cut_in.follower, cut_in.change);
        let at = change.sample - recording.tracks[follower].first_sample;
        let placed = frame.tracks[follower].as_ref().expect("a place");
        assert_eq!(placed.lane[at - 20], Some(change.to));
    }
    let windows = found.windows(&recording);
    assert!(windows.len() > 50, "{}", windows.len());
    assert!(windows.iter().all(|it| it.samples == 200));
}
