//! Lanes of roads: sections, widths and offsets along the reference line.

use std::collections::BTreeSet;

use super::curve::{Cubic, begun};
use super::error::ImportError;
use super::scope::ParameterScope;
use super::tree::XmlNode;

/// Greatest number of lanes of a section, and of sections or offsets of a road.
const MOST_LANES: usize = 200;
const MOST_SECTIONS: usize = 5_000;
/// Greatest number of widths of a section, and of heights or banks of a road.
///
/// Each is looked up in their list, so the time grows by its square.
const MOST_CUBICS: usize = 20_000;
/// Width in metres by which rounding may take a lane below 0.
const SAME_M: f64 = 0.1;

/// Lane of a section.
#[derive(Clone, Debug)]
pub struct SectionLane {
    /// Id in the file: positive to the left of the reference line.
    pub id: i32,
    widths: Vec<Cubic>,
    /// True for a driving lane.
    pub drives: bool,
    /// Lanes that it continues, before and after it along the reference line.
    pub links: [Option<i32>; 2],
}

/// Lane with the direction in which it is driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectedLane {
    /// Id in the file.
    pub lane: i32,
    /// True along the reference line.
    pub forward: bool,
}

/// Lanes from a station on.
#[derive(Clone, Debug)]
pub struct OpenDriveLaneSection {
    pub(crate) s_m: f64,
    /// Lanes of the section.
    pub lanes: Vec<SectionLane>,
}

/// All lanes of a road.
#[derive(Clone, Debug)]
pub struct RoadLanes {
    offsets: Vec<Cubic>,
    /// Superelevation in radians, positive where the left side is higher.
    pub(super) banks: Vec<Cubic>,
    pub(crate) sections: Vec<OpenDriveLaneSection>,
}

impl OpenDriveLaneSection {
    pub(crate) fn lane(&self, id: i32) -> Option<&SectionLane> {
        self.lanes.iter().find(|lane| lane.id == id)
    }

    /// Refuses lanes of one number, and widths below 0 up to the end of the section.
    fn sound(&self, node: &XmlNode, to_m: f64) -> Result<(), ImportError> {
        let mut known = BTreeSet::new();
        for lane in &self.lanes {
            if !known.insert(lane.id) {
                let what = format!("it has a second lane {}", lane.id);
                return Err(node.refused(what, "give each lane a number of its own"));
            }
            let begins_m = lane.widths.iter().map(|it| it.from_m);
            // A width counts until the next one begins, the last one to the end of the section.
            let ends_m = begins_m.clone().skip(1).chain([to_m]);
            for (width, ends_m) in lane.widths.iter().zip(ends_m) {
                let least_m = width
                    .at(width.from_m)
                    .min(width.at(ends_m.max(width.from_m)));
                // Files round, so a lane that ends may have a width just below 0.
                if least_m < -SAME_M {
                    let what = format!("its lane {} has a width of {least_m:.3} m", lane.id);
                    return Err(node.refused(what, "keep widths at 0 or above"));
                }
            }
        }
        Ok(())
    }
}

impl RoadLanes {
    /// Reads the `lanes` of a road. The first problem is kept in `refused`.
    pub fn of(
        road: &XmlNode,
        lanes: &XmlNode,
        length_m: f64,
        refused: &mut Option<ImportError>,
    ) -> Result<RoadLanes, ImportError> {
        for name in ["laneOffset", "laneSection"] {
            few(lanes, lanes.all(name).count(), name, MOST_SECTIONS)?;
        }
        let offsets = lanes.all("laneOffset").map(|it| cubic(it, "s", 0.0));
        let banks = profile_of(road, "lateralProfile", "superelevation")?;
        let sections = lanes.all("laneSection").map(|section| {
            let s_m = ParameterScope::default().number_or_zero(section, "s")?;
            let sides = || sides_of(section).flat_map(|side| side.all("lane"));
            let counts = sides_of(section).map(|side| side.all("lane").count());
            few(section, counts.sum(), "lane", MOST_LANES)?;
            let widths = sides().map(|lane| lane.all("width").count());
            few(section, widths.sum(), "width", MOST_CUBICS)?;
            let lanes = sides().map(|lane| section_lane(lane, s_m, refused));
            Ok(OpenDriveLaneSection {
                s_m,
                lanes: lanes.collect::<Result<_, ImportError>>()?,
            })
        });
        let sections = sections.collect::<Result<Vec<_>, ImportError>>()?;
        for (node, pair) in lanes.all("laneSection").skip(1).zip(sections.windows(2)) {
            if pair[1].s_m < pair[0].s_m {
                let what = format!("it begins at {} m, before the one ahead of it", pair[1].s_m);
                let help = "order the sections by their `s`";
                // Refused only if an agent drives on this road: maps have faults elsewhere.
                refused.get_or_insert_with(|| node.refused(what, help));
            }
        }
        let ends_m = sections.iter().skip(1).map(|it| it.s_m).chain([length_m]);
        for ((node, section), to_m) in lanes.all("laneSection").zip(&sections).zip(ends_m) {
            if let Err(error) = section.sound(node, to_m) {
                refused.get_or_insert(error);
            }
        }
        Ok(RoadLanes {
            sections,
            offsets: offsets.collect::<Result<_, ImportError>>()?,
            banks,
        })
    }

    /// Returns the number and the lanes of the section at a station.
    pub fn section(&self, s_m: f64) -> Option<(usize, &OpenDriveLaneSection)> {
        let sections = self.sections.iter().enumerate();
        // From behind, so that of two sections at one station the later one counts.
        let found = sections.rev().find(|(_, section)| section.s_m <= s_m);
        found.or_else(|| self.sections.iter().enumerate().next())
    }

    /// Lateral position of the middle of a lane, and its slope along the road.
    ///
    /// `None` if the section at this station has no such lane.
    pub fn middle(&self, section: usize, s_m: f64, lane: i32) -> Option<(f64, f64)> {
        let lanes = self.sections.get(section)?;
        // Before numbers up to it are counted: a world may ask for any.
        if lane != 0 && lanes.lane(lane).is_none() {
            return None;
        }
        let offset = begun(&self.offsets, s_m);
        let (mut t_m, mut slope) = (offset.at(s_m), offset.slope(s_m));
        // The sign of 0 is 0, so lane 0 lies on the offset alone.
        let sign = f64::from(lane.signum());
        // All lanes between the reference line and the lane add up, driven or
        // not.
        for id in 1..=lane.abs() {
            let width = begun(&lanes.lane(id * lane.signum())?.widths, s_m);
            let share = if id == lane.abs() { 0.5 } else { 1.0 };
            t_m += sign * share * width.at(s_m);
            slope += sign * share * width.slope(s_m);
        }
        let (flat, flat_slope) = self.flat(s_m);
        // The product rule, because the bank changes along the road, too.
        Some((t_m * flat, slope * flat + t_m * flat_slope))
    }

    /// Share of a width that is left in the plane of a banked road, and its slope.
    pub fn flat(&self, s_m: f64) -> (f64, f64) {
        let bank = begun(&self.banks, s_m);
        let (sin, cos) = libm::sincos(bank.at(s_m));
        (cos, -sin * bank.slope(s_m))
    }

    /// Returns the lane and the station at which a lane begins on its road.
    ///
    /// In the direction of travel, back over the links of sections.
    pub fn first_of(&self, driven: DirectedLane, s_m: f64, length_m: f64) -> (i32, f64) {
        let DirectedLane { mut lane, forward } = driven;
        let mut section = self.section(s_m).map_or(0, |(section, _)| section);
        loop {
            let before = if forward {
                section.checked_sub(1)
            } else {
                Some(section + 1).filter(|next| *next < self.sections.len())
            };
            let links = self.sections.get(section).and_then(|it| it.lane(lane));
            let link = links.and_then(|it| it.links[usize::from(!forward)]);
            // A link to the other side of the reference line would turn the lane round.
            match before.zip(link.filter(|link| link * lane > 0)) {
                Some((before, link)) => (section, lane) = (before, link),
                None => break,
            }
        }
        let begins_m = self.sections.get(section).map_or(0.0, |it| it.s_m);
        let ends_m = self.sections.get(section + 1).map_or(length_m, |it| it.s_m);
        (lane, if forward { begins_m } else { ends_m })
    }

    /// Returns the lane at a lateral position, driven or not.
    pub fn lane_at(&self, s_m: f64, t_m: f64) -> Option<i32> {
        let (number, section) = self.section(s_m)?;
        let is_on = |id: &i32| {
            let middle = self.middle(number, s_m, *id);
            let half_m = self.width_m(s_m, *id).unwrap_or(0.0) / 2.0;
            middle.is_some_and(|(middle_m, _)| (t_m - middle_m).abs() <= half_m)
        };
        let lanes = section.lanes.iter().map(|lane| lane.id);
        // Lane 0 is the reference line, which has no width.
        lanes.filter(|id| *id != 0).find(is_on)
    }

    /// Width of a lane in metres at a station.
    pub fn width_m(&self, s_m: f64, lane: i32) -> Option<f64> {
        let (_, section) = self.section(s_m)?;
        let width = begun(&section.lane(lane)?.widths, s_m);
        Some(width.at(s_m) * self.flat(s_m).0)
    }

    /// Lateral position of the middle of a lane that keeps it on the whole road.
    pub fn fixed_m(&self, lane: i32) -> Option<f64> {
        let sides = 1..=lane.abs();
        let mut widths = self.sections.iter().flat_map(|section| {
            let lanes = sides
                .clone()
                .filter_map(|id| section.lane(id * lane.signum()));
            lanes.flat_map(|lane| &lane.widths)
        });
        let mut others = self.offsets.iter().chain(&self.banks);
        if !widths.all(Cubic::is_constant) || !others.all(Cubic::is_constant) {
            return None;
        }
        // Constant polynomials may still step, where one begins.
        let begins = self.sections.iter().enumerate().flat_map(|(i, section)| {
            // The last section has no end: places just behind the road count
            // as on it.
            let ends_m = self.sections.get(i + 1).map_or(f64::INFINITY, |it| it.s_m);
            let widths = section.lanes.iter().flat_map(|lane| &lane.widths);
            let begins = widths
                .chain(&self.offsets)
                .chain(&self.banks)
                .map(|it| it.from_m);
            let within = begins.filter(move |s_m| (section.s_m..ends_m).contains(s_m));
            within.chain([section.s_m]).map(move |s_m| (i, s_m))
        });
        let middles: Option<Vec<f64>> = begins
            .map(|(section, s_m)| self.middle(section, s_m, lane).map(|(t_m, _)| t_m))
            .collect();
        let middles = middles?;
        let first_m = *middles.first()?;
        // Exactly: equal numbers of a file are equal bits.
        middles.iter().all(|t_m| *t_m == first_m).then_some(first_m)
    }
}

/// Returns the sides of a section with lanes.
///
/// Lanes in other elements, such as those of another program, are none of the road.
pub(super) fn sides_of(section: &XmlNode) -> impl Iterator<Item = &XmlNode> {
    let is_side = |it: &&XmlNode| ["left", "center", "right"].contains(&it.name.as_str());
    section.children.iter().filter(is_side)
}

/// Reads the heights of a road's reference line.
pub(super) fn heights_of(road: &XmlNode) -> Result<Vec<Cubic>, ImportError> {
    profile_of(road, "elevationProfile", "elevation")
}

/// Reads the polynomials of a profile of a road.
fn profile_of(road: &XmlNode, list: &str, name: &str) -> Result<Vec<Cubic>, ImportError> {
    let Some(profile) = road.child(list) else {
        return Ok(Vec::new());
    };
    few(profile, profile.all(name).count(), name, MOST_CUBICS)?;
    profile.all(name).map(|it| cubic(it, "s", 0.0)).collect()
}

/// Polynomial with its start, which counts from `from_m`.
fn cubic(node: &XmlNode, start: &str, from_m: f64) -> Result<Cubic, ImportError> {
    let plain = ParameterScope::default();
    let [a, b, c, d] = ["a", "b", "c", "d"].map(|term| plain.number_or_zero(node, term));
    Ok(Cubic {
        from_m: from_m + plain.number_or_zero(node, start)?,
        terms: [a?, b?, c?, d?],
    })
}

/// Refuses an element with more parts of a name than are read.
pub(super) fn few(
    node: &XmlNode,
    count: usize,
    name: &str,
    most: usize,
) -> Result<(), ImportError> {
    if count <= most {
        return Ok(());
    }
    let what = format!("it has {count} `{name}`: at most {most} are read");
    Err(node.refused(what, "leave out those on which nobody drives"))
}

fn section_lane(
    lane: &XmlNode,
    s_m: f64,
    refused: &mut Option<ImportError>,
) -> Result<SectionLane, ImportError> {
    let plain = ParameterScope::default();
    if let Some(border) = lane.child("border") {
        let help = "give the lane a `width`";
        refused.get_or_insert_with(|| border.refused("a lane with a `border` is not read", help));
    }
    few(lane, lane.all("width").count(), "width", MOST_SECTIONS)?;
    let widths = lane.all("width").map(|it| cubic(it, "sOffset", s_m));
    let link = |name: &str| {
        let node = lane.child("link").and_then(|it| it.child(name));
        node.map(|it| plain.lane(it, "id")).transpose()
    };
    Ok(SectionLane {
        id: plain.lane(lane, "id")?,
        widths: widths.collect::<Result<_, ImportError>>()?,
        drives: lane.raw("type") == Some("driving"),
        links: [link("predecessor")?, link("successor")?],
    })
}
