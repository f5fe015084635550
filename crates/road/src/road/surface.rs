//! Surface of a road as a mesh of triangles.

use core::ops::Range;

use super::course::Course;
use super::slope::RoadProfile;

/// Greatest change of the rise from one facet to the next, in vertical curves.
const FACET_RISE: f64 = 5e-4;
/// Least and greatest length of a facet in a vertical curve.
const FACET_M: (f64, f64) = (0.1, 2.0);
/// Length of a facet in bends, and where the bank changes.
const BEND_FACET_M: f64 = 1.0;
/// Width of a strip of facets where the surface is twisted.
///
/// A triangle has one slope, so its width decides its error there.
const STRIP_M: f64 = 1.0;
/// Ground beside the outer lanes.
const SHOULDER_M: f64 = 30.0;
/// Greatest share of a bend's radius that the ground on its inside covers.
const INSIDE: f64 = 0.9;

/// Mesh of triangles, seen counter-clockwise from above.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Corners in the world frame.
    pub points_m: Vec<[f64; 3]>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Part of a road that has a surface.
#[derive(Clone, Debug)]
pub struct SurfaceExtent {
    /// First to last station.
    pub stations_m: Range<f64>,
    /// Right to left border of the lanes, as offsets to the left of the course.
    pub borders_m: Range<f64>,
}

impl SurfaceMesh {
    /// Adds the surface of a road.
    pub fn add(&mut self, course: &Course, profile: &RoadProfile, extent: &SurfaceExtent) {
        let stations_m = stations_m(course, profile, &extent.stations_m);
        let offsets_m = offsets_m(course, profile, &extent.borders_m);
        let (first, width) = (self.points_m.len() as u32, offsets_m.len() as u32);
        for &s_m in &stations_m {
            for &lateral_m in &offsets_m {
                let at = course.pose(s_m, lateral_m);
                let z_m = profile.height_m(s_m, lateral_m);
                self.points_m.push([at.x_m, at.y_m, z_m]);
            }
        }
        for row in 1..stations_m.len() as u32 {
            for column in 1..width {
                let right = first + (row - 1) * width + column - 1;
                let ahead = right + width;
                // Counter-clockwise from above, so that normals point upwards.
                self.triangles.push([right, ahead, ahead + 1]);
                self.triangles.push([right, ahead + 1, right + 1]);
            }
        }
    }
}

/// Returns stations between which the surface is nearly plane along the road.
pub fn stations_m(course: &Course, profile: &RoadProfile, within_m: &Range<f64>) -> Vec<f64> {
    let half_m = 0.5 * profile.vertical_curve_m;
    let grades = profile
        .grades
        .iter()
        .map(|grade| grade.from_s_m)
        // The ends of the vertical curve around the station of each grade.
        .flat_map(|s_m| [s_m - half_m, s_m + half_m]);
    let arcs = course.pieces();
    let pieces = arcs
        .iter()
        .flat_map(|piece| [piece.from_s_m, piece.from_s_m + piece.length_m]);
    let banks = profile.banks.iter().map(|bank| bank.s_m);
    let mut edges: Vec<f64> = grades
        .chain(pieces)
        .chain(banks)
        .filter(|s_m| within_m.contains(s_m))
        .collect();
    edges.extend([within_m.start, within_m.end]);
    edges.sort_by(f64::total_cmp);
    // Equal edges would make facets without an area.
    edges.dedup();
    let mut stations_m = vec![within_m.start];
    for pair in edges.windows(2) {
        let (length_m, middle_m) = (pair[1] - pair[0], 0.5 * (pair[0] + pair[1]));
        let mut facet_m = length_m;
        let bend_per_m = profile.curvature_per_m(middle_m).abs();
        if bend_per_m > 0.0 {
            // The rise changes by curvature times length, and by a bounded amount per facet.
            facet_m = facet_m.min((FACET_RISE / bend_per_m).clamp(FACET_M.0, FACET_M.1));
        }
        let is_twisted = profile.bank(pair[0]) != profile.bank(pair[1]);
        if is_twisted || course.curvature_per_m(middle_m) != 0.0 {
            facet_m = facet_m.min(BEND_FACET_M);
        }
        let facets = (length_m / facet_m).ceil().max(1.0) as usize;
        let step_m = length_m / facets as f64;
        stations_m.extend((1..facets).map(|i| pair[0] + i as f64 * step_m));
        stations_m.push(pair[1]);
    }
    stations_m
}

/// Returns the offsets between which the surface is nearly plane across the road.
fn offsets_m(course: &Course, profile: &RoadProfile, borders_m: &Range<f64>) -> Vec<f64> {
    let (right_m, left_m) = (borders_m.start, borders_m.end);
    let pieces = course.pieces();
    let bends = pieces.iter().map(|piece| piece.curvature_per_m);
    let (mut least_m, mut most_m) = (right_m - SHOULDER_M, left_m + SHOULDER_M);
    for bend_per_m in bends.clone().filter(|bend_per_m| *bend_per_m != 0.0) {
        // Beyond the centre of a bend, the surface would fold over itself.
        let inside_m = INSIDE / bend_per_m;
        if bend_per_m > 0.0 {
            most_m = most_m.min(inside_m.max(left_m));
        } else {
            least_m = least_m.max(inside_m.min(right_m));
        }
    }
    let is_bent = bends.clone().any(|bend_per_m| bend_per_m != 0.0);
    let is_twisted = profile
        .banks
        .windows(2)
        .any(|it| it[0].slope != it[1].slope);
    let mut offsets_m = vec![least_m];
    // Without bends and twists one facet spans the width, which keeps the mesh
    // small.
    if is_bent || is_twisted {
        let strips = ((left_m - right_m) / STRIP_M).ceil().max(1.0);
        let strip_m = (left_m - right_m) / strips;
        offsets_m.extend((0..=strips as usize).map(|i| right_m + i as f64 * strip_m));
    }
    offsets_m.push(most_m);
    // A bend may cut the shoulder to nothing, which would leave a strip
    // without an area.
    offsets_m.dedup();
    offsets_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::{Bank, Grade, Piece, PlacedRoad, Priority, Road, RoadPlace};

    fn bend() -> Course {
        let road = PlacedRoad {
            at: RoadPlace::default(),
            road: Road::Straight {
                lanes: 1,
                lane_width_m: 3.5,
                friction: 0.9,
                speed_limit_mps: None,
            },
            shares_lane_width: true,
            pieces: vec![
                Piece::Line { length_m: 50.0 },
                Piece::Arc {
                    length_m: 80.0,
                    radius_m: 60.0,
                },
            ],
            priority: Priority::Equal,
            grades: Vec::new(),
            vertical_curve_m: 0.0,
            banks: Vec::new(),
        };
        road.course().expect("a course")
    }

    /// Height of a mesh at a point of the plane.
    fn height_m(mesh: &SurfaceMesh, (x, y): (f64, f64)) -> Option<f64> {
        mesh.triangles.iter().find_map(|triangle| {
            let [a, b, c] = triangle.map(|corner| mesh.points_m[corner as usize]);
            let cross =
                |p: [f64; 3], q: [f64; 3]| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
            let (of_c, of_a, of_b) = (cross(a, b), cross(b, c), cross(c, a));
            let all = of_a + of_b + of_c;
            let is_in = [of_a, of_b, of_c].iter().all(|it| *it >= -1e-9 * all.abs());
            (is_in && all > 0.0).then(|| (a[2] * of_a + b[2] * of_b + c[2] * of_c) / all)
        })
    }

    #[test]
    fn a_mesh_has_the_heights_of_its_road_to_a_millimetre() {
        let grades = [
            Grade {
                from_s_m: 0.0,
                rise: 0.05,
            },
            Grade {
                from_s_m: 70.0,
                rise: -0.05,
            },
        ];
        let banks = [
            Bank {
                s_m: 50.0,
                slope: 0.0,
            },
            Bank {
                s_m: 70.0,
                slope: -0.06,
            },
        ];
        let profile = RoadProfile {
            grades: &grades,
            vertical_curve_m: 30.0,
            banks: &banks,
            z_m: 0.0,
        };
        let course = bend();
        let extent = SurfaceExtent {
            stations_m: -20.0..150.0,
            borders_m: -1.75..5.25,
        };
        let mut mesh = SurfaceMesh::default();
        mesh.add(&course, &profile, &extent);
        for i in 0..160 {
            let (s_m, lateral_m) = (-15.0 + f64::from(i), -1.7 + 0.04 * f64::from(i));
            let at = course.pose(s_m, lateral_m);
            let z_m = height_m(&mesh, (at.x_m, at.y_m)).expect("on the mesh");
            let error_m = (z_m - profile.height_m(s_m, lateral_m)).abs();
            assert!(error_m < 1e-3, "{s_m} {lateral_m}: {error_m}");
        }
    }
}
