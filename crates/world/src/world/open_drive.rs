//! Roads along the lanes of an OpenDRIVE file, as the text of a world file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use super::runs::IncludingFile;
use crate::opendrive::{LaneRoad, LaneStart, bank_list, grade_list, lane_road};
use crate::road::{Piece, Priority};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::sim::Pose;
use crate::world_file::{AgentFile, LanesFile, OwnRoad, RoadFile, ScenarioFile};

/// Length of the vertical curves between the grades of a file, which are short parts.
const VERTICAL_CURVE_M: f64 = 4.0;

/// Returns the values that replace those of an OpenDRIVE file, with their places in
/// the text: roads along lanes, and lights at signals.
pub(super) fn values(
    problems: &mut Problems,
    origin: IncludingFile<'_>,
    file: &ScenarioFile,
) -> Vec<(ValuePath, String)> {
    let top = ValuePath::top();
    let OwnRoad::OpenDrive {
        file: name,
        along,
        speed_limit_mps,
        ..
    } = &file.road
    else {
        // Without a file, nothing is along its lanes.
        let along = file.roads.0.iter().filter(|(_, it)| it.along.is_some());
        for (road, _) in along {
            let what = format!("road `{road}` is along lanes, but no file has them");
            let help = "write `road: OpenDrive(file: \"town.xodr\", …)`".to_owned();
            let place = top.to("roads").to(road).to("along");
            problems.add(&place, what, "of no file", Some(help));
        }
        return Vec::new();
    };
    let place = top.to("road");
    let text = match origin.text(name) {
        Ok(text) => text,
        Err(wrong) => {
            problems.add(&place.to("file"), wrong.what, "this file", Some(wrong.help));
            return Vec::new();
        }
    };
    let mut read = |place: &ValuePath, along: &LanesFile| {
        let from = LaneStart {
            road: &along.road,
            lane: along.lane,
            s_m: along.s_m,
            via: &along.via,
            length_m: along.length_m,
        };
        lane_road(Path::new(name), &text, &from)
            .map_err(|error| {
                problems.add(place, error.to_string(), "these lanes", error.help.clone());
            })
            .ok()
    };
    // The named roads are placed relative to it, so nothing can follow without it.
    let Some(own) = read(&place.to("along"), along) else {
        return Vec::new();
    };
    let friction = raw(&file.road);
    let mut limit = String::new();
    if let Some(limit_mps) = speed_limit_mps {
        // Writing to a string cannot fail.
        let _ = write!(limit, ", speed_limit_mps: {limit_mps:?}");
    }
    let mut text = format!("Curved({}, friction: {friction}{limit})", lanes(&own));
    // Grades and banks of the world itself take precedence.
    if file.grades.is_empty() {
        text += &grades(&own);
    }
    if file.banks.is_empty() {
        text += &banks(&own);
    }
    if file.origin.is_some() {
        let what = "`origin` is that of the lanes of `OpenDrive`".to_owned();
        let help = "leave it out".to_owned();
        problems.add(&top.to("origin"), what, "given twice", Some(help));
        return Vec::new();
    }
    text += &origin_of(name, &own);
    let mut values = vec![(place, text)];
    let mut named = BTreeMap::new();
    for (name, it) in &file.roads.0 {
        // Other roads are written out already.
        let Some(along) = &it.along else { continue };
        let place = top.to("roads").to(name);
        if let Some(road) = read(&place.to("along"), along) {
            values.push((place, placed(&own, &road, it)));
            named.insert(name.as_str(), road);
        }
    }
    values.extend(lines(problems, file, &own, &named));
    values
}

/// Returns the stop lines of lights at signals, with their places in the text.
fn lines(
    problems: &mut Problems,
    file: &ScenarioFile,
    own: &LaneRoad,
    named: &BTreeMap<&str, LaneRoad>,
) -> Vec<(ValuePath, String)> {
    let mut values = Vec::new();
    for (i, light) in file.agents.iter().enumerate() {
        let AgentFile::Light {
            signal: Some(signal),
            line_m: None,
            road,
            ..
        } = light
        else {
            continue;
        };
        let on = match road {
            None => Some(own),
            Some(name) => named.get(name.as_str()),
        };
        let place = ValuePath::top().to("agents").at(i).to("signal");
        match on.map(|road| line_m(road, signal)) {
            // A millimetre is enough for a stop line.
            Some(Ok(line_m)) => values.push((place, format!("{signal:?}, line_m: {line_m:.3}"))),
            Some(Err(help)) => {
                let what = format!("the way passes no signal `{signal}`");
                problems.add(&place, what, "not on it", Some(help));
            }
            // Another message names the road that is not along lanes.
            None => {}
        }
    }
    values
}

/// Station of a signal on a way, or a help that lists the signals of the way.
fn line_m(road: &LaneRoad, signal: &str) -> Result<f64, String> {
    let mut signals = road.signals.iter();
    let found = signals.find(|(id, _)| id == signal);
    found.map(|(_, line_m)| *line_m).ok_or_else(|| {
        let known: Vec<&str> = road.signals.iter().map(|(id, _)| id.as_str()).collect();
        if known.is_empty() {
            "write `line_m: …` instead: the way has no signals".to_owned()
        } else {
            format!("the signals of the way: {}", known.join(", "))
        }
    })
}

/// Friction of the road as it was written: a number or a range.
fn raw(road: &OwnRoad) -> String {
    let range = road.friction().0;
    if range.lo == range.hi {
        format!("{:?}", range.lo)
    } else {
        // Each start draws its own friction, so the range must survive.
        format!("({:?}, {:?})", range.lo, range.hi)
    }
}

fn lanes(road: &LaneRoad) -> String {
    // `{:?}` writes numbers that read back bit for bit.
    let texts = road.pieces.iter().map(|piece| match piece {
        Piece::Line { length_m } => format!("Line(length_m: {length_m:?})"),
        Piece::Arc { length_m, radius_m } => {
            format!("Arc(length_m: {length_m:?}, radius_m: {radius_m:?})")
        }
    });
    let pieces: Vec<String> = texts.collect();
    format!(
        "lanes: {}, lane_width_m: {:?}, pieces: [{}]",
        road.lanes,
        road.lane_width_m,
        pieces.join(", ")
    )
}

/// Grades as a field of its own, if there are any.
fn grades(road: &LaneRoad) -> String {
    if road.grades.is_empty() {
        String::new()
    } else {
        let grades = grade_list(&road.grades);
        format!(", grades: {grades}, vertical_curve_m: {VERTICAL_CURVE_M:?}")
    }
}

/// Banks as a field of its own, if there are any.
fn banks(road: &LaneRoad) -> String {
    if road.banks.is_empty() {
        String::new()
    } else {
        format!(", banks: {}", bank_list(&road.banks))
    }
}

/// Pose of the world's origin in the file, as a field of its own.
fn origin_of(file: &str, road: &LaneRoad) -> String {
    let Pose {
        x_m,
        y_m,
        heading_rad,
    } = road.begins;
    let z_m = road.begins_z_m;
    format!(
        ", origin: (file: {file:?}, x_m: {x_m:?}, y_m: {y_m:?}, z_m: {z_m:?}, \
         heading_rad: {heading_rad:?})"
    )
}

/// Named road, in the frame of the world's own.
fn placed(own: &LaneRoad, road: &LaneRoad, file: &RoadFile) -> String {
    let at = own.sees(road);
    let priority = match file.priority {
        Priority::Yields => "Yields",
        Priority::Equal => "Equal",
        Priority::Over => "Over",
    };
    // The ground of a world is at height 0 where its own road begins.
    let z_m = road.begins_z_m - own.begins_z_m;
    format!(
        "(at: (x_m: {:?}, y_m: {:?}, heading_rad: {:?}, z_m: {z_m:?}), {}{}{}, \
         priority: {priority})",
        at.x_m,
        at.y_m,
        at.heading_rad,
        lanes(road),
        grades(road),
        banks(road)
    )
}
