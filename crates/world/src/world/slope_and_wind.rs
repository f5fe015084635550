//! Checks of the grades and banks of roads and of the wind.

use super::check::{range_within, within};
use crate::road::{Bank, Grade, MAX_RISE};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{EnvironmentQuantity, Range};
use crate::world_file::{NumberOrRange, RoadFile, ScenarioFile};

/// Greatest speed of wind, in m/s.
const MAX_WIND_MPS: f64 = 60.0;
/// Bounds of the duration of a gust, in seconds.
const GUST_S: (f64, f64) = (0.1, 60.0);
/// Greatest number of grades, and of banks.
const MAX_GRADES: usize = 1_000;
/// Greatest slope across a road.
const MAX_BANK: f64 = 0.5;
/// Greatest length of a vertical curve.
const MAX_VERTICAL_CURVE_M: f64 = 1_000.0;

/// A number of a file with its quantity and its place.
type PlacedRange = (EnvironmentQuantity, ValuePath, NumberOrRange);

/// Returns the numbers that may be ranges, with their places.
pub(super) fn ranges(file: &ScenarioFile) -> Vec<PlacedRange> {
    let (grades, wind) = (ValuePath::top().to("grades"), ValuePath::top().to("wind"));
    // In this order they become axes of the starts.
    let rises = file.grades.iter().enumerate();
    let mut all: Vec<PlacedRange> = rises
        .map(|(i, &(_, rise))| {
            let place = grades.at(i).at(1);
            (EnvironmentQuantity::Rise { grade: i }, place, rise)
        })
        .collect();
    if let Some(file) = &file.wind {
        let place = wind.to("speed_mps");
        all.push((EnvironmentQuantity::WindSpeed, place, file.speed_mps));
        if let Some(gust) = &file.gust {
            let place = wind.to("gust");
            let (peak, begin) = (place.to("peak_mps"), place.to("begin_s"));
            all.push((EnvironmentQuantity::GustPeak, peak, gust.peak_mps));
            all.push((EnvironmentQuantity::GustBegin, begin, gust.begin_s));
        }
    }
    all
}

/// Checks grades and wind.
pub(super) fn check(problems: &mut Problems, file: &ScenarioFile) {
    for (quantity, place, NumberOrRange(numbers)) in ranges(file) {
        let (lo, hi) = match quantity {
            EnvironmentQuantity::Rise { .. } => (-MAX_RISE, MAX_RISE),
            // A gust that begins after the end would never blow.
            EnvironmentQuantity::GustBegin => (0.0, file.clock.horizon_s),
            // A negative speed blows the other way.
            _ => (-MAX_WIND_MPS, MAX_WIND_MPS),
        };
        range_within(problems, &place, numbers, Range { lo, hi });
    }
    let top = ValuePath::top();
    let stations_m: Vec<f64> = file.grades.iter().map(|(from_s_m, _)| *from_s_m).collect();
    in_order(problems, &top.to("grades"), "grade", &stations_m);
    shaped(problems, &top, file.vertical_curve_m, &file.banks);
    if let Some(wind) = &file.wind {
        let place = ValuePath::top().to("wind");
        let turn = core::f64::consts::TAU;
        within(problems, &place.to("from_rad"), wind.from_rad, -turn, turn);
        if let Some(gust) = &wind.gust {
            let place = place.to("gust").to("duration_s");
            within(problems, &place, gust.duration_s, GUST_S.0, GUST_S.1);
        }
    }
}

/// Checks the vertical curves and the banks of a road.
fn shaped(problems: &mut Problems, road: &ValuePath, curve_m: f64, banks: &[(f64, f64)]) {
    let place = road.to("vertical_curve_m");
    within(problems, &place, curve_m, 0.0, MAX_VERTICAL_CURVE_M);
    let place = road.to("banks");
    for (i, (_, slope)) in banks.iter().enumerate() {
        within(problems, &place.at(i).at(1), *slope, -MAX_BANK, MAX_BANK);
    }
    let stations_m: Vec<f64> = banks.iter().map(|(s_m, _)| *s_m).collect();
    in_order(problems, &place, "bank", &stations_m);
}

/// Returns the banks of a file.
pub(super) fn banks_of(banks: &[(f64, f64)]) -> Vec<Bank> {
    let banks = banks.iter();
    banks.map(|&(s_m, slope)| Bank { s_m, slope }).collect()
}

/// Reads the grades of a named road, and checks its profile.
pub(super) fn placed(problems: &mut Problems, path: &ValuePath, road: &RoadFile) -> Vec<Grade> {
    let (place, grades) = (path.to("grades"), &road.grades);
    for (i, (_, rise)) in grades.iter().enumerate() {
        within(problems, &place.at(i).at(1), *rise, -MAX_RISE, MAX_RISE);
    }
    let stations_m: Vec<f64> = grades.iter().map(|(from_s_m, _)| *from_s_m).collect();
    in_order(problems, &place, "grade", &stations_m);
    shaped(problems, path, road.vertical_curve_m, &road.banks);
    let grades = grades
        .iter()
        .map(|&(from_s_m, rise)| Grade { from_s_m, rise });
    grades.collect()
}

/// Refuses too many grades or banks, and stations that do not increase.
fn in_order(problems: &mut Problems, place: &ValuePath, what: &str, stations_m: &[f64]) {
    let kind = what;
    if stations_m.len() > MAX_GRADES {
        let what = format!("{} {kind}s", stations_m.len());
        let help = format!("at most {MAX_GRADES}");
        problems.add(place, what, "too many", Some(help));
    }
    for (i, pair) in stations_m.windows(2).enumerate() {
        // The negation of this also refuses NaN.
        let is_increasing = pair[0] < pair[1];
        if !is_increasing {
            let what = format!(
                "the {kind} from {:?} m on follows that from {:?} m on",
                pair[1], pair[0]
            );
            let help = format!("list {kind}s by increasing station");
            problems.add(&place.at(i + 1), what, "out of order", Some(help));
        }
    }
}
