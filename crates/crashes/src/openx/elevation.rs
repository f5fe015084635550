//! Heights of roads with grades.
//!
//! Plants place bodies in the plane. Files state the heights of the roads, and lift each
//! body to its road.

use super::path::Vertex;
use super::stretch::Stretch;
use crate::road::RoadProfile;
use crate::scene::drive::{BodyAttitude, DriveWorld};
use crate::sim::Pose;
use crate::xml::XmlElement;

/// Least length of a written stretch, in metres.
const LEAST_M: f64 = 1e-9;

/// Heights of the roads of a world.
#[derive(Clone, Copy)]
pub(crate) struct Elevation<'a>(&'a DriveWorld);

impl<'a> Elevation<'a> {
    /// Returns the heights of a world, or `None` for a flat one.
    pub(crate) fn of(world: &'a DriveWorld) -> Option<Elevation<'a>> {
        world.spec().has_slopes().then_some(Elevation(world))
    }

    fn heights(&self, road: usize) -> RoadProfile<'a> {
        self.0.spec().profile_of(road)
    }

    /// Lifts the vertices of a body to its road.
    pub(super) fn lift(&self, road: usize, vertices: &mut [Vertex]) {
        for vertex in vertices {
            let pose = Pose {
                x_m: vertex.x_m,
                y_m: vertex.y_m,
                heading_rad: vertex.heading_rad,
            };
            let BodyAttitude {
                z_m,
                pitch_rad,
                roll_rad,
            } = self.0.attitude_on(road, &pose);
            (vertex.z_m, vertex.pitch_rad, vertex.roll_rad) = (z_m, pitch_rad, roll_rad);
        }
    }

    /// Elevation profile of a stretch of a road.
    pub(super) fn profile(&self, road: usize, stretch: Stretch) -> XmlElement {
        let heights = self.heights(road);
        let stations = stations_m(&heights, stretch);
        let ends_m = stations.iter().skip(1).copied().chain([stretch.to_s_m]);
        let elevations = stations.iter().zip(ends_m).map(|(&s_m, end_m)| {
            let length_m = end_m - s_m;
            let [begin, middle, end] =
                [s_m, s_m + 0.5 * length_m, end_m].map(|s_m| heights.height_m(s_m, 0.0));
            // Between two stations a vertical curve is a parabola, and the rest is straight.
            let bend = if heights.vertical_curve_m == 0.0 {
                0.0
            } else {
                2.0 * (begin - 2.0 * middle + end) / (length_m * length_m)
            };
            XmlElement::new("elevation")
                .number("s", stretch.s_m(s_m))
                .number("a", begin)
                // The slope at the begin of the parabola through the three heights, as
                // OpenDRIVE counts from there.
                .number("b", (end - begin) / length_m - bend * length_m)
                .number("c", bend)
                .number("d", 0.0)
        });
        XmlElement::new("elevationProfile").children(elevations)
    }
}

/// Stations at which the rise of a road or its change changes.
fn stations_m(heights: &RoadProfile<'_>, stretch: Stretch) -> Vec<f64> {
    let half_m = 0.5 * heights.vertical_curve_m;
    // Before the second of them, the first holds.
    let changes = heights
        .grades
        .iter()
        .skip(1)
        .flat_map(|grade| [grade.from_s_m - half_m, grade.from_s_m + half_m]);
    let mut all: Vec<f64> = [stretch.from_s_m].into_iter().chain(changes).collect();
    all.retain(|s_m| (stretch.from_s_m..stretch.to_s_m).contains(s_m));
    all.sort_by(f64::total_cmp);
    // Two curves that touch share a station up to rounding, and a stretch of no length
    // has no slope.
    all.dedup_by(|next, before| *next - *before < LEAST_M);
    all
}
