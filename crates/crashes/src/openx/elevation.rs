//! Heights of roads with grades.
//!
//! brakecheck drives in the plane and knows grades as forces. Files state the heights
//! that have these grades, and lift each body to its road.

use super::path::Vertex;
use super::stretch::Stretch;
use super::xml::XmlElement;
use crate::road::{Grade, grade_at};
use crate::scene::drive::DriveWorld;
use crate::sim::{Pose, wrapped};

/// Distance in metres between the heights of a road that follows another.
const STEP_M: f64 = 10.0;

/// Heights of the roads of a world. The world's own road is at 0 m at its s = 0.
#[derive(Clone, Copy)]
pub(crate) struct Elevation<'a>(&'a DriveWorld);

impl<'a> Elevation<'a> {
    /// Returns the heights of a world, or `None` for a flat one.
    pub(crate) fn of(world: &'a DriveWorld) -> Option<Elevation<'a>> {
        world.spec().has_grades().then_some(Elevation(world))
    }

    /// Height and rise of a road at a station.
    ///
    /// A road with grades begins on the ground of the world's own road, and one without
    /// follows that ground.
    fn at(&self, road: usize, s_m: f64) -> (f64, f64) {
        let course = &self.0.courses()[road];
        let grades = self.0.spec().grades_of(road);
        if road == 0 {
            return (climbed_m(grades, s_m), grade_at(grades, s_m).rise);
        }
        if grades.is_empty() {
            let (height_m, rise, turned_rad) = self.ground(&course.pose(s_m, 0.0));
            return (height_m, rise * libm::cos(turned_rad));
        }
        let (begins_m, ..) = self.ground(&course.pose(0.0, 0.0));
        let height_m = begins_m + climbed_m(grades, s_m);
        (height_m, grade_at(grades, s_m).rise)
    }

    /// Height and rise of the world's own road beside a place, and the place's heading
    /// against it.
    fn ground(&self, pose: &Pose) -> (f64, f64, f64) {
        let at = self.0.courses()[0].locate(pose);
        let (height_m, rise) = self.at(0, at.s_m);
        (height_m, rise, at.heading_rad)
    }

    /// Height, pitch and roll of a body on a road.
    ///
    /// Positive angles lower the front and lift the left side.
    pub(crate) fn tilt(&self, road: usize, pose: &Pose) -> (f64, f64, f64) {
        let at = self.0.courses()[road].locate(pose);
        let (height_m, rise) = self.at(road, at.s_m);
        let (sin, cos) = libm::sincos(wrapped(at.heading_rad));
        (height_m, -libm::atan(rise * cos), -libm::atan(rise * sin))
    }

    /// Lifts the vertices of a body to its road.
    pub(super) fn lift(&self, road: usize, vertices: &mut [Vertex]) {
        for vertex in vertices {
            let pose = Pose {
                x_m: vertex.x_m,
                y_m: vertex.y_m,
                heading_rad: vertex.heading_rad,
            };
            (vertex.z_m, vertex.pitch_rad, vertex.roll_rad) = self.tilt(road, &pose);
        }
    }

    /// Elevation profile of a stretch of a road.
    pub(super) fn profile(&self, road: usize, stretch: Stretch) -> XmlElement {
        let stations = self.stations_m(road, stretch);
        let ends_m = stations.iter().skip(1).copied().chain([stretch.to_s_m]);
        let elevations = stations.iter().zip(ends_m).map(|(&s_m, end_m)| {
            let (height_m, _) = self.at(road, s_m);
            let (end_height_m, _) = self.at(road, end_m);
            XmlElement::new("elevation")
                .number("s", stretch.s_m(s_m))
                .number("a", height_m)
                .number("b", (end_height_m - height_m) / (end_m - s_m))
                .number("c", 0.0)
                .number("d", 0.0)
        });
        XmlElement::new("elevationProfile").children(elevations)
    }

    /// Stations at which the rise of a road changes.
    fn stations_m(&self, road: usize, stretch: Stretch) -> Vec<f64> {
        let grades = self.0.spec().grades_of(road);
        let mut all = vec![stretch.from_s_m];
        if grades.is_empty() {
            let steps = ((stretch.to_s_m - stretch.from_s_m) / STEP_M).ceil();
            // Stretches are a few kilometres long at most.
            let steps = 1..steps.min(1e5) as usize;
            all.extend(steps.map(|step| stretch.from_s_m + step as f64 * STEP_M));
        } else {
            // Before the second of them, the first holds.
            all.extend(grades.iter().skip(1).map(|grade| grade.from_s_m));
        }
        all.retain(|s_m| (stretch.from_s_m..stretch.to_s_m).contains(s_m));
        all.dedup();
        all
    }
}

/// Height in metres at a station above that at s = 0.
fn climbed_m(grades: &[Grade], s_m: f64) -> f64 {
    let parts = grades.iter().enumerate().map(|(i, grade)| {
        // The first grade also holds before its station.
        let from_m = if i == 0 {
            f64::NEG_INFINITY
        } else {
            grade.from_s_m
        };
        let to_m = grades
            .get(i + 1)
            .map_or(f64::INFINITY, |next| next.from_s_m);
        grade.rise * (s_m.clamp(from_m, to_m) - 0.0_f64.clamp(from_m, to_m))
    });
    parts.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_are_the_sum_of_the_rises() {
        let grade = |from_s_m: f64, rise: f64| Grade { from_s_m, rise };
        let grades = [grade(10.0, 0.1), grade(30.0, 0.0), grade(50.0, -0.2)];
        let cases = [
            (-20.0, -2.0),
            (0.0, 0.0),
            (30.0, 3.0),
            (45.0, 3.0),
            (60.0, 1.0),
        ];
        for (s_m, height_m) in cases {
            assert!((climbed_m(&grades, s_m) - height_m).abs() < 1e-12, "{s_m}");
        }
        assert_eq!(climbed_m(&[], 40.0), 0.0);
    }
}
