//! Surfaces of bodies as meshes of flat faces.

use re_sdk_types::archetypes::Mesh3D;

use super::palette::Rgb;
use crate::sim::BodyPart;

/// Point in the frame of a body: x forward, y left, z up.
pub(super) type MeshPoint = [f32; 3];

/// Steps of a quarter turn of a round part.
const ROUND: usize = 3;

/// Mesh of flat faces, each in one colour.
///
/// Faces share no corner, because a corner has the normal of its face.
#[derive(Default)]
pub(super) struct FaceMesh {
    corners: Vec<MeshPoint>,
    normals: Vec<MeshPoint>,
    colours: Vec<Rgb>,
    triangles: Vec<[u32; 3]>,
}

impl FaceMesh {
    /// Adds a convex face, whose corners turn left as seen from outside.
    pub(super) fn face(&mut self, corners: &[MeshPoint], colour: Rgb) {
        let from = self.corners.len() as u32;
        // A face without an area has no normal, and nothing to draw.
        let Some(normal) = normal(corners) else {
            return;
        };
        self.corners.extend(corners);
        self.normals.extend(corners.iter().map(|_| normal));
        self.colours.extend(corners.iter().map(|_| colour));
        let last = corners.len() as u32 - 1;
        self.triangles
            // A fan fills any convex face.
            .extend((1..last).map(|i| [from, from + i, from + i + 1]));
    }

    /// Adds the sides between layers, from the lowest layer up, and both ends.
    ///
    /// The layers have equally many corners, which turn left as seen from above. Side
    /// `i`, above layer `i`, has colour `colours[i]`.
    pub(super) fn loft(&mut self, layers: &[Vec<MeshPoint>], colours: &[Rgb]) {
        for (pair, colour) in layers.windows(2).zip(colours) {
            let (low, high) = (&pair[0], &pair[1]);
            for i in 0..low.len() {
                let next = (i + 1) % low.len();
                self.face(&[low[i], low[next], high[next], high[i]], *colour);
            }
        }
        if let (Some(low), Some(colour)) = (layers.first(), colours.first()) {
            // Reversed, because from below the corners turn the other way.
            let from_below: Vec<MeshPoint> = low.iter().rev().copied().collect();
            self.face(&from_below, *colour);
        }
        if let (Some(high), Some(colour)) = (layers.last(), colours.last()) {
            self.face(high, *colour);
        }
    }

    /// Adds a box with a centre and a size.
    pub(super) fn block(&mut self, centre: MeshPoint, size: MeshPoint, colour: Rgb) {
        let half = size.map(|it| 0.5 * it);
        let layer = |z: f32| {
            let footprint = RoundRectangle {
                ahead_m: (centre[0] - half[0], centre[0] + half[0]),
                left_m: (centre[1] - half[1], centre[1] + half[1]),
                radius_m: 0.0,
            };
            footprint.at(z)
        };
        let layers = [layer(centre[2] - half[2]), layer(centre[2] + half[2])];
        self.loft(&layers, &[colour]);
    }

    /// Adds a convex part of a body, whose heights count from `ground_m`.
    pub(super) fn part(&mut self, part: &BodyPart, ground_m: f64, colour: Rgb) {
        match part {
            BodyPart::Box {
                ahead_m,
                left_m,
                up_m,
            } => {
                let footprint = RoundRectangle {
                    ahead_m: shown(ahead_m.0, ahead_m.1),
                    left_m: shown(left_m.0, left_m.1),
                    radius_m: 0.0,
                };
                let (low, high) = shown(up_m.0 + ground_m, up_m.1 + ground_m);
                self.loft(&[footprint.at(low), footprint.at(high)], &[colour]);
            }
            BodyPart::Prism { outline_m, up_m } => {
                let hull = hull(outline_m);
                let layer = |up_m: f64| -> Vec<MeshPoint> {
                    let corners = hull.iter();
                    corners
                        .map(|(x, y)| [*x as f32, *y as f32, (up_m + ground_m) as f32])
                        .collect()
                };
                self.loft(&[layer(up_m.0), layer(up_m.1)], &[colour]);
            }
            BodyPart::Capsule {
                from_m,
                to_m,
                radius_m,
            } => {
                let ends = [*from_m, *to_m];
                let [from, to] = ends.map(|(x, y, z)| [x as f32, y as f32, (z + ground_m) as f32]);
                self.capsule(from, to, *radius_m as f32, colour);
            }
        }
    }

    /// Adds all points within a radius of a line.
    fn capsule(&mut self, from: MeshPoint, to: MeshPoint, radius_m: f32, colour: Rgb) {
        // A capsule of no length is a ball, for which any direction serves.
        let along = unit(minus(to, from)).unwrap_or([0.0, 0.0, 1.0]);
        // Any direction that is not along the line spans a plane with it.
        let aside = if along[2].abs() < 0.9 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        };
        let right = unit(cross(aside, along)).unwrap_or([1.0, 0.0, 0.0]);
        let up = cross(along, right);
        let quarter = std::f32::consts::FRAC_PI_2;
        let ring = |centre: MeshPoint, tilt_rad: f32| -> Vec<MeshPoint> {
            let (sin, cos) = tilt_rad.sin_cos();
            let turns = (0..4 * ROUND).map(|i| i as f32 / ROUND as f32 * quarter);
            turns
                .map(|turn| {
                    let (y, x) = turn.sin_cos();
                    std::array::from_fn(|axis| {
                        let around = x * right[axis] + y * up[axis];
                        centre[axis] + radius_m * (cos * around + sin * along[axis])
                    })
                })
                .collect()
        };
        // The last ring of each end is a point.
        let tilts = (0..=ROUND).map(|i| (i as f32 / ROUND as f32) * quarter);
        let below = tilts.clone().rev().map(|tilt| ring(from, -tilt));
        let layers: Vec<Vec<MeshPoint>> = below.chain(tilts.map(|tilt| ring(to, tilt))).collect();
        self.loft(&layers, &vec![colour; layers.len() - 1]);
    }

    /// Returns the mesh for the viewer.
    pub(super) fn mesh(self) -> Mesh3D {
        Mesh3D::new(self.corners)
            .with_vertex_normals(self.normals)
            .with_vertex_colors(self.colours)
            .with_triangle_indices(self.triangles)
    }

    /// Returns the least and the greatest corner.
    #[cfg(test)]
    pub(super) fn bounds(&self) -> [(f32, f32); 3] {
        std::array::from_fn(|axis| {
            let values = self.corners.iter().map(|corner| corner[axis]);
            values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), it| {
                (low.min(it), high.max(it))
            })
        })
    }

    /// Returns the volume within closed surfaces, which is positive if all faces look out.
    #[cfg(test)]
    pub(super) fn volume_m3(&self) -> f32 {
        let of = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| self.corners[i as usize]);
            dot(a, cross(b, c)) / 6.0
        };
        self.triangles.iter().map(of).sum()
    }
}

/// Rectangle on the ground with round corners.
#[derive(Clone, Copy)]
pub(super) struct RoundRectangle {
    /// From rear to front.
    pub ahead_m: (f32, f32),
    /// From right to left.
    pub left_m: (f32, f32),
    /// Radius of the corners.
    pub radius_m: f32,
}

impl RoundRectangle {
    /// Returns its outline at a height, from its front right corner to the left.
    pub(super) fn at(&self, z: f32) -> Vec<MeshPoint> {
        let (rear, front) = self.ahead_m;
        let (right, left) = self.left_m;
        let radius_m = self
            .radius_m
            .min(0.5 * (front - rear))
            .min(0.5 * (left - right));
        if radius_m <= 0.0 {
            return [(front, right), (front, left), (rear, left), (rear, right)]
                .map(|(x, y)| [x, y, z])
                .into();
        }
        let middles = [
            [front - radius_m, right + radius_m],
            [front - radius_m, left - radius_m],
            [rear + radius_m, left - radius_m],
            [rear + radius_m, right + radius_m],
        ];
        let corner = |quarters: f32, [x, y]: [f32; 2]| {
            let angle = quarters * std::f32::consts::FRAC_PI_2;
            [x + radius_m * angle.cos(), y + radius_m * angle.sin(), z]
        };
        let mut outline = Vec::new();
        for (number, middle) in middles.into_iter().enumerate() {
            let from = number as f32 - 1.0;
            let steps = (0..=ROUND).map(|step| from + step as f32 / ROUND as f32);
            outline.extend(steps.map(|quarters| corner(quarters, middle)));
        }
        outline
    }
}

/// Corners of the convex hull of some points, which turn left (Andrew 1979).
fn hull(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let turns_left = |a: &(f64, f64), b: &(f64, f64), c: &(f64, f64)| {
        (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0) > 0.0
    };
    let half = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        let mut chain: Vec<(f64, f64)> = Vec::new();
        for point in points {
            while let [.., a, b] = &chain[..] {
                if turns_left(a, b, &point) {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        // The last point begins the other half.
        chain.pop();
        chain
    };
    let lower = half(&mut sorted.iter().copied());
    let upper = half(&mut sorted.iter().rev().copied());
    [lower, upper].concat()
}

fn shown(from: f64, to: f64) -> (f32, f32) {
    (from as f32, to as f32)
}

/// Normal of a face by the sum over its edges (Newell), or `None` without an area.
fn normal(corners: &[MeshPoint]) -> Option<MeshPoint> {
    let mut sum = [0.0; 3];
    for (i, a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let part = cross(*a, b);
        sum = std::array::from_fn(|axis| sum[axis] + part[axis]);
    }
    unit(sum)
}

fn minus(a: MeshPoint, b: MeshPoint) -> MeshPoint {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: MeshPoint, b: MeshPoint) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: MeshPoint, b: MeshPoint) -> MeshPoint {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: MeshPoint) -> Option<MeshPoint> {
    let length = dot(a, a).sqrt();
    (length > 1e-9).then(|| a.map(|it| it / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_fill_their_bounds_and_all_faces_look_out() {
        let up_m = (0.2, 1.2);
        let cases = [
            (
                BodyPart::Box {
                    ahead_m: (-1.0, 2.0),
                    left_m: (-0.5, 0.5),
                    up_m,
                },
                3.0,
            ),
            (
                // The order of the corners is free, and one lies inside.
                BodyPart::Prism {
                    outline_m: vec![
                        (2.0, 0.5),
                        (-1.0, -0.5),
                        (-1.0, 0.5),
                        (0.0, 0.0),
                        (2.0, -0.5),
                    ],
                    up_m,
                },
                3.0,
            ),
            (
                BodyPart::Capsule {
                    from_m: (-0.5, 0.0, 0.7),
                    to_m: (1.5, 0.0, 0.7),
                    radius_m: 0.5,
                },
                // π r² l + 4/3 π r³, less what flat faces cut off.
                0.9 * (0.25 * 2.0 + 4.0 / 3.0 * 0.125) * std::f32::consts::PI,
            ),
        ];
        for (part, volume_m3) in cases {
            let mut faces = FaceMesh::default();
            faces.part(&part, 0.0, [1; 3]);
            let found = faces.volume_m3();
            assert!((found / volume_m3 - 1.0).abs() < 0.05, "{part:?}: {found}");
            for (axis, (low, high)) in [(-1.0, 2.0), (-0.5, 0.5), (0.2, 1.2)].iter().enumerate() {
                let (least, greatest) = faces.bounds()[axis];
                assert!((least - low).abs() < 0.07, "{part:?}: {least}");
                assert!((greatest - high).abs() < 0.07, "{part:?}: {greatest}");
            }
        }
    }
}
