//! Grades, banks and signals along ways on lanes, from those of their roads.

use super::curve::{begun, pair_of};
use super::error::ImportError;
use super::lane_drive::LaneStretch;
use super::roads::{ImportedRoad, RoadMap};
use super::scope::ParameterScope;
use super::tree::XmlNode;
use crate::road::{Bank, Grade, MAX_RISE};

/// Length in metres of a part with one rise, and greatest number of parts of a way.
const PART_M: f64 = 2.0;
const MOST_PARTS: f64 = 900.0;
/// Length in metres below which a part has no grade of its own.
const LEAST_M: f64 = 0.01;
/// Greatest difference of rises that count as equal: 0.01 m/s² of acceleration.
const SAME_RISE: f64 = 1e-3;
/// Greatest difference of the slopes across the road that count as equal.
const SAME_BANK: f64 = 1e-4;

/// Short part of a way, with its stations on the road and on the way.
struct WayPart<'a> {
    road: &'a ImportedRoad,
    lane: i32,
    on_road_m: [f64; 2],
    on_way_m: [f64; 2],
}

/// Returns banks in the form of a world file.
pub fn bank_list(banks: &[Bank]) -> String {
    let banks: Vec<String> = banks
        .iter()
        .map(|bank| format!("({:.3}, {:.6})", bank.s_m, bank.slope))
        .collect();
    format!("[{}]", banks.join(", "))
}

/// Returns grades in the form of a world file.
pub fn grade_list(grades: &[Grade]) -> String {
    let grades: Vec<String> = grades
        .iter()
        .map(|grade| format!("({:.3}, {:.6})", grade.from_s_m, grade.rise))
        .collect();
    format!("[{}]", grades.join(", "))
}

impl RoadMap {
    /// Returns the grades of a way along lanes, at an offset to the left of their
    /// middle.
    ///
    /// The list is empty for a way without any rise.
    ///
    /// # Errors
    ///
    /// Returns an error for a road with unsupported content, and for one that is
    /// steeper than a world allows.
    pub fn lane_grades(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        left_m: f64,
    ) -> Result<Vec<Grade>, ImportError> {
        // Most roads are level, and points of a protocol ask for one way again and again.
        if !self.any_road(asks, stretches, ImportedRoad::rises)? {
            return Ok(Vec::new());
        }
        let mut grades: Vec<Grade> = Vec::new();
        for part in self.parts(asks, stretches, left_m)? {
            let rise = part.rise();
            // The shortest parts have the rise of rounded stations, and are no rise of a road.
            if rise.abs() > MAX_RISE && part.length_m() > LEAST_M {
                let what = format!("it rises by {rise:.2} per metre");
                let help = format!("keep rises from -{MAX_RISE} to {MAX_RISE}");
                return Err(part.road.node.refused(what, &help));
            }
            let goes_on = |last: &Grade| (last.rise - rise).abs() <= SAME_RISE;
            if part.length_m() > LEAST_M && !grades.last().is_some_and(goes_on) {
                let from_s_m = part.on_way_m[0];
                grades.push(Grade { from_s_m, rise });
            }
        }
        // A level road has no grades in its text.
        let is_flat = grades.iter().all(|grade| grade.rise == 0.0);
        Ok(if is_flat { Vec::new() } else { grades })
    }

    /// Returns the banks of a way along lanes, at an offset to the left of their middle.
    ///
    /// The list is empty for a way without any bank.
    ///
    /// # Errors
    ///
    /// Returns an error for a road with unsupported content.
    pub fn lane_banks(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        left_m: f64,
    ) -> Result<Vec<Bank>, ImportError> {
        let parts = self.parts(asks, stretches, left_m)?;
        let all: Vec<Bank> = parts
            .iter()
            .map(|part| Bank {
                // In the middle of the part, where its bank is evaluated.
                s_m: 0.5 * (part.on_way_m[0] + part.on_way_m[1]),
                slope: part.bank(),
            })
            .collect();
        if all.iter().all(|bank| bank.slope == 0.0) {
            return Ok(Vec::new());
        }
        // A bank between two equal ones changes nothing.
        let same = |a: &Bank, b: &Bank| (a.slope - b.slope).abs() <= SAME_BANK;
        let kept = all.iter().enumerate().filter(|(i, bank)| {
            let (before, after) = (i.checked_sub(1).map(|i| &all[i]), all.get(i + 1));
            !(before.is_some_and(|it| same(it, bank)) && after.is_some_and(|it| same(it, bank)))
        });
        Ok(kept.map(|(_, bank)| *bank).collect())
    }

    /// Returns the signals of a way along lanes with their stations, in order.
    ///
    /// These are the signals and references of its roads that are for its direction
    /// and its lanes.
    ///
    /// # Errors
    ///
    /// Returns an error for a road with unsupported content.
    pub fn lane_signals(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        left_m: f64,
    ) -> Result<Vec<(String, f64)>, ImportError> {
        let mut found: Vec<(String, f64)> = Vec::new();
        let has_signals = |road: &ImportedRoad| signals_of(road).next().is_some();
        if !self.any_road(asks, stretches, has_signals)? {
            return Ok(found);
        }
        for part in self.parts(asks, stretches, left_m)? {
            for signal in signals_of(part.road) {
                let at_m = ParameterScope::default().number(signal, "s")?;
                let id = signal.need("id")?;
                // A signal on the joint of two parts is on both.
                if let Some(on_way_m) = part.station_m(at_m)
                    && found.iter().all(|(known, _)| known != id)
                    && part.is_valid(signal)?
                {
                    found.push((id.to_owned(), on_way_m));
                }
            }
        }
        Ok(found)
    }

    /// Returns whether one of the roads of a way is of a kind.
    fn any_road(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        is_of_kind: impl Fn(&ImportedRoad) -> bool,
    ) -> Result<bool, ImportError> {
        let mut any = false;
        for stretch in stretches {
            any |= is_of_kind(self.road(asks, &stretch.road)?);
        }
        Ok(any)
    }

    fn parts(
        &self,
        asks: &XmlNode,
        stretches: &[LaneStretch],
        left_m: f64,
    ) -> Result<Vec<WayPart<'_>>, ImportError> {
        let way_m: f64 = stretches.iter().map(LaneStretch::length_m).sum();
        // Longer ways have longer parts, so that no world has thousands of grades.
        let most_m = PART_M.max(way_m / MOST_PARTS);
        let mut all = Vec::new();
        let mut way_m = 0.0;
        for stretch in stretches {
            let road = self.road(asks, &stretch.road)?;
            let parts = (stretch.length_m() / most_m).ceil();
            for part in 0..parts as usize {
                let ends = [part, part + 1].map(|it| it as f64 / parts * stretch.length_m());
                // Arcs measure the length, so that stations agree with those
                // of `lane_way`.
                let [start, end] = ends.map(|along_m| stretch.pose(road, along_m, left_m));
                let [first, second] = pair_of(start, end);
                let begins_m = way_m;
                way_m += first.1.length_m + second.1.length_m;
                all.push(WayPart {
                    road,
                    lane: stretch.lane,
                    on_road_m: ends.map(|along_m| stretch.station_m(along_m)),
                    on_way_m: [begins_m, way_m],
                });
            }
        }
        Ok(all)
    }
}

/// Signals of a road, and references to those of others, that have a station.
fn signals_of(road: &ImportedRoad) -> impl Iterator<Item = &XmlNode> {
    let lists = road.node.all("signals");
    let signals = lists.flat_map(|list| &list.children);
    signals.filter(|it| it.raw("s").is_some())
}

impl WayPart<'_> {
    fn length_m(&self) -> f64 {
        self.on_way_m[1] - self.on_way_m[0]
    }

    /// Rise in the direction of travel.
    ///
    /// A lane on the inside of a bend is shorter than its road and so steeper.
    fn rise(&self) -> f64 {
        let [from_m, to_m] = self.on_road_m;
        let middle_m = 0.5 * (from_m + to_m);
        let slope = begun(&self.road.heights_m, middle_m).slope(middle_m);
        // A way beside the reference line is longer or shorter than it, with the same climb.
        slope * (to_m - from_m) / self.length_m()
    }

    /// Slope to the left of the direction of travel.
    fn bank(&self) -> f64 {
        let [from_m, to_m] = self.on_road_m;
        let middle_m = 0.5 * (from_m + to_m);
        let slope = libm::tan(begun(&self.road.lanes.banks, middle_m).at(middle_m));
        // Against the road of the file, its left side is the right one of the way.
        if from_m <= to_m { slope } else { -slope }
    }

    /// Station on the way of a station on the road, if the part contains it.
    fn station_m(&self, road_m: f64) -> Option<f64> {
        let [from_m, to_m] = self.on_road_m;
        // A part that is driven backwards divides two negative lengths.
        let share = (road_m - from_m) / (to_m - from_m);
        let is_on = (0.0..=1.0).contains(&share);
        is_on.then_some(self.on_way_m[0] + share * self.length_m())
    }

    /// Returns whether a signal is for the direction and the lane of the part.
    fn is_valid(&self, signal: &XmlNode) -> Result<bool, ImportError> {
        let [from_m, to_m] = self.on_road_m;
        let faces = match signal.raw("orientation") {
            Some("+") => from_m < to_m,
            Some("-") => to_m < from_m,
            _ => true,
        };
        let plain = ParameterScope::default();
        let lane = f64::from(self.lane);
        let includes = |validity: &XmlNode| {
            let from = plain.number(validity, "fromLane")?;
            let to = plain.number(validity, "toLane")?;
            // Files state the two ends of a validity in either order.
            Ok((from.min(to)..=from.max(to)).contains(&lane))
        };
        let lanes = signal
            .all("validity")
            .map(includes)
            .collect::<Result<Vec<bool>, ImportError>>()?;
        Ok(faces && (lanes.is_empty() || lanes.contains(&true)))
    }
}
