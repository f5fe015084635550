//! Road: surface, verges, lane markings and a post every 10 m.

use re_sdk_types::archetypes::{LineStrips3D, Mesh3D};

use super::error::ViewError;
use super::log_writer::LogWriter;
use super::palette::{self, Rgb};
use super::space::lifted;
use super::viewed_episode::ViewedEpisode;
use crate::scene::ground::{GroundPoint, along, beside, near, reach};

/// Distance in metres from the cars' paths up to which the road is drawn.
const MARGIN_M: f64 = 150.0;
/// Width in metres of the ground beside the road.
const VERGE_M: f64 = 60.0;
/// Depth of side roads below each other, and of the ground, in metres.
const SUNK_M: f64 = 0.005;
const GROUND_M: f64 = -0.03;
/// Distance of the posts from the road, in metres.
const POST_M: f64 = 0.6;

/// Logs the part of the road with agents on it.
pub(super) fn log(story: &ViewedEpisode<'_>, journal: &mut LogWriter) -> Result<(), ViewError> {
    // Roads may be kilometres long, and the viewer needs the part with agents
    // alone.
    let reach = reach(story.poses(), MARGIN_M);
    for (number, side) in story.shown.stage.side_roads_m.iter().enumerate() {
        // Each side road lies slightly lower, so that crossing surfaces do not
        // flicker. The world's own road is on top.
        let sunk_m = SUNK_M * (number + 1) as f64;
        let name = format!("world/road/side_{}", number + 1);
        one_road(&near(side, &reach), &name, sunk_m, journal)?;
    }
    let own = near(&story.shown.stage.lane_borders_m, &reach);
    one_road(&own, "world/road", 0.0, journal)
}

fn one_road(
    borders: &[Vec<GroundPoint>],
    name: &str,
    sunk_m: f64,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let (Some(right), Some(left)) = (borders.first(), borders.last()) else {
        return Ok(());
    };
    let verge = (beside(right, left, -VERGE_M), beside(left, right, -VERGE_M));
    // The verge is one strip below the road, so that no seam shows between
    // them.
    let surface = ribbons([
        (
            &verge.0[..],
            &verge.1[..],
            GROUND_M - sunk_m,
            palette::GROUND,
        ),
        (&right[..], &left[..], -sunk_m, palette::ROAD),
    ]);
    let (mut strips, mut colours, mut radii_m) = (Vec::new(), Vec::new(), Vec::new());
    let mut draw = |strip: Vec<[f32; 3]>, colour: Rgb, radius_m: f32| {
        strips.push(strip);
        colours.push(colour);
        radii_m.push(radius_m);
    };
    for (i, border) in borders.iter().enumerate() {
        if i == 0 || i + 1 == borders.len() {
            let strip = border
                .iter()
                .map(|point| lifted(*point, 0.02 - sunk_m))
                .collect();
            draw(strip, palette::MARKING, 0.07);
        } else {
            for dash in dashes(border, 0.02 - sunk_m) {
                draw(dash, palette::MARKING, 0.07);
            }
        }
    }
    for foot in along(&beside(right, left, -POST_M), 10.0) {
        draw(
            vec![lifted(foot, 0.0), lifted(foot, 0.8)],
            palette::POST,
            0.06,
        );
    }
    let lines = LineStrips3D::new(strips)
        .with_colors(colours)
        .with_radii(radii_m);
    journal.always(name, &[&surface, &lines])
}

type Ribbon<'a> = (&'a [GroundPoint], &'a [GroundPoint], f64, Rgb);

/// Flat surfaces (right edge, left edge, height, colour) as one mesh.
///
/// Both edges of a surface have the same number of points.
fn ribbons<'a>(ribbons: impl IntoIterator<Item = Ribbon<'a>>) -> Mesh3D {
    let (mut corners, mut colours, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for (right, left, lift_m, colour) in ribbons {
        for (i, (r, l)) in right.iter().zip(left).enumerate() {
            let at = corners.len() as u32;
            if i > 0 {
                // Two triangles fill the quadrilateral between two pairs of
                // edge points.
                triangles.extend([[at - 2, at, at - 1], [at - 1, at, at + 1]]);
            }
            corners.extend([lifted(*r, lift_m), lifted(*l, lift_m)]);
            colours.extend([colour; 2]);
        }
    }
    Mesh3D::new(corners)
        .with_triangle_indices(triangles)
        .with_vertex_colors(colours)
}

/// Lane markings: 3 m on, 6 m off.
fn dashes(line: &[GroundPoint], lift_m: f64) -> Vec<Vec<[f32; 3]>> {
    let (on_m, off_m) = (3.0, 6.0);
    let points = along(line, 0.5 * on_m);
    let (on, period) = (2, 2 + (2.0 * off_m / on_m).round() as usize);
    points
        .chunks(period)
        // A last chunk without a full dash would end in a stump.
        .filter(|chunk| on < chunk.len())
        .map(|chunk| chunk[..=on].iter().map(|at| lifted(*at, lift_m)).collect())
        .collect()
}
