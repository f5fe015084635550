//! Figures of road users: as large as their bodies, with a shape for each kind.
//!
//! A vehicle whose body file lists the parts of its collision shape is drawn as these
//! parts, and the outline of a car has the corner radius of its shape.

use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Capsules3D, Cylinders3D, Points3D};
use re_sdk_types::components::FillMode;

use super::camera::ViewExtent;
use super::entity::agent_path;
use super::error::ViewError;
use super::log_writer::LogWriter;
use super::mesh::{FaceMesh, RoundRectangle};
use super::palette::{self, Rgb};
use super::viewed_episode::ViewedEpisode;
use crate::scene::{AgentDescription, BodyFigure};
use crate::sim::{BodyPart, BodyShape};

/// Radius of the corners of a car whose collision shape is a box, in metres.
const EDGE_M: f32 = 0.08;

/// Logs a body in the frame of its own centre: x forward, y left, z up.
pub(super) fn log(
    story: &ViewedEpisode<'_>,
    who: usize,
    around: &ViewExtent,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let agent = &story.shown.stage.agents[who];
    let colour = story.colour(who);
    let figure = agent.figure();
    let scale = Scale::of(agent);
    let body = surface(agent, colour).mesh();
    let name = Points3D::new([around.label_place(story, who)])
        .with_radii([0.03])
        .with_colors([colour])
        .with_labels([agent.name.as_str()]);
    let wheels = wheels(figure, &scale);
    let limbs = limbs(figure, &scale, colour, agent.colour);
    // One message per agent, since each one costs the viewer a chunk.
    let mut parts: Vec<&dyn AsComponents> = vec![&body, &name];
    parts.extend(wheels.iter().map(|wheels| wheels as &dyn AsComponents));
    parts.extend(limbs.iter().map(|limbs| limbs as &dyn AsComponents));
    journal.always(agent_path(&agent.name), &parts)
}

/// Flat faces of a body. `colour` identifies the agent.
fn surface(agent: &AgentDescription, colour: Rgb) -> FaceMesh {
    let (figure, scale) = (agent.figure(), Scale::of(agent));
    let mut faces = FaceMesh::default();
    match (&agent.shape, figure) {
        (BodyShape::Parts(parts), BodyFigure::Car | BodyFigure::Van | BodyFigure::Truck) => {
            add_parts(parts, agent.size_m[2], colour, &mut faces);
        }
        (BodyShape::Rounded { corner_radius_m }, BodyFigure::Car) => {
            add_car(&scale, *corner_radius_m as f32, colour, &mut faces);
        }
        (_, BodyFigure::Car) => add_car(&scale, EDGE_M, colour, &mut faces),
        (_, BodyFigure::Van) => add_van(&scale, colour, agent.colour, &mut faces),
        _ => {}
    }
    for (centre, size, colour) in blocks(agent, colour) {
        faces.block(scale.place(centre), scale.size(size), colour);
    }
    faces
}

/// Adds the parts of a collision shape, in shades of one colour.
fn add_parts(parts: &[BodyPart], height_m: f64, colour: Rgb, faces: &mut FaceMesh) {
    // In turn, so that neighbouring parts stay distinguishable.
    for (part, keep) in parts.iter().zip([1.0, 0.8, 0.65].into_iter().cycle()) {
        faces.part(part, -0.5 * height_m, palette::dimmed(colour, keep));
    }
}

/// Adds a body with a bonnet, and a cabin of glass with a roof.
fn add_car(body: &Scale, radius_m: f32, colour: Rgb, faces: &mut FaceMesh) {
    let layer = |[rear, front]: [f32; 2], half_width: f32, up: f32| {
        body.footprint(rear, front, half_width, radius_m)
            .at(body.up(up))
    };
    let hull = [
        layer([-0.48, 0.48], 0.47, 0.16),
        layer([-0.5, 0.5], 0.5, 0.26),
        layer([-0.5, 0.5], 0.5, 0.46),
        layer([-0.485, 0.47], 0.48, 0.58),
    ];
    // A colour per side between two layers, so one fewer than layers.
    faces.loft(&hull, &[colour; 3]);
    let cabin = [
        layer([-0.44, 0.22], 0.455, 0.58),
        layer([-0.33, 0.05], 0.37, 0.94),
        layer([-0.31, 0.03], 0.34, 1.0),
    ];
    faces.loft(&cabin, &[palette::GLASS, colour]);
}

/// Adds a body with a slanted front. Its roof identifies it from above.
fn add_van(body: &Scale, colour: Rgb, paint: Rgb, faces: &mut FaceMesh) {
    let layer = |[rear, front]: [f32; 2], half_width: f32, up: f32| {
        body.footprint(rear, front, half_width, EDGE_M)
            .at(body.up(up))
    };
    let hull = [
        layer([-0.5, 0.5], 0.5, 0.1),
        layer([-0.5, 0.5], 0.5, 0.36),
        layer([-0.5, 0.44], 0.5, 0.5),
        layer([-0.5, 0.28], 0.48, 0.95),
        layer([-0.49, 0.26], 0.46, 1.0),
    ];
    faces.loft(&hull, &[colour, colour, paint, colour]);
    // The windscreen lies on the slanted front, slightly before it.
    let at = |ahead: f32, left: f32, up: f32| body.place([ahead, left, up]);
    let windscreen = [
        at(0.432, -0.44, 0.54),
        at(0.432, 0.44, 0.54),
        at(0.314, 0.42, 0.88),
        at(0.314, -0.42, 0.88),
    ];
    faces.face(&windscreen, palette::GLASS);
}

/// Size of a body in the viewer's precision.
struct Scale {
    length_m: f32,
    width_m: f32,
    height_m: f32,
}

impl Scale {
    fn of(agent: &AgentDescription) -> Scale {
        let [length_m, width_m, height_m] = agent.size_m.map(|size_m| size_m as f32);
        Scale {
            length_m,
            width_m,
            height_m,
        }
    }

    /// Place by shares of the body: 0 is the middle, or the foot for z.
    fn place(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [x * self.length_m, y * self.width_m, self.up(z)]
    }

    fn size(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [x * self.length_m, y * self.width_m, z * self.height_m]
    }

    /// Height above the centre by a share of the height.
    fn up(&self, share: f32) -> f32 {
        (share - 0.5) * self.height_m
    }

    /// Rectangle by shares of length and width.
    fn footprint(&self, rear: f32, front: f32, half_width: f32, radius_m: f32) -> RoundRectangle {
        let half_m = half_width * self.width_m;
        RoundRectangle {
            ahead_m: (rear * self.length_m, front * self.length_m),
            left_m: (-half_m, half_m),
            radius_m,
        }
    }
}

/// Block by shares of a body: centre, size, colour.
type FigureBlock = ([f32; 3], [f32; 3], Rgb);

/// Blocks of a figure, beside its curved surfaces.
///
/// `colour` identifies the agent.
fn blocks(agent: &AgentDescription, colour: Rgb) -> Vec<FigureBlock> {
    let figure = agent.figure();
    let low = match figure {
        // A face shows the direction in which a person looks.
        BodyFigure::Person => {
            return vec![([0.16, 0.0, 0.92], [0.2, 0.16, 0.06], palette::GLASS)];
        }
        BodyFigure::TwoWheeler => {
            return vec![
                ([0.0, 0.0, 0.36], [0.5, 0.36, 0.22], colour),
                ([-0.22, 0.0, 0.5], [0.34, 0.3, 0.06], palette::TYRE),
                ([0.22, 0.0, 0.64], [0.04, 0.9, 0.03], palette::POST),
                ([0.34, 0.0, 0.54], [0.03, 0.26, 0.1], palette::HEADLIGHT),
                ([-0.44, 0.0, 0.48], [0.03, 0.2, 0.05], palette::TAIL_LIGHT),
            ];
        }
        BodyFigure::Car => 0.42,
        BodyFigure::Van | BodyFigure::Truck => 0.24,
    };
    let mut blocks = Vec::new();
    for side in [-0.36, 0.36] {
        blocks.push(([0.5, side, low], [0.012, 0.2, 0.08], palette::HEADLIGHT));
        blocks.push(([-0.5, side, low], [0.012, 0.2, 0.08], palette::TAIL_LIGHT));
    }
    let is_of_parts = matches!(agent.shape, BodyShape::Parts(_));
    match figure {
        // A bright stripe on the bonnet distinguishes the front from the rear.
        BodyFigure::Car if !is_of_parts => {
            blocks.push(([0.34, 0.0, 0.58], [0.24, 0.12, 0.02], palette::MARKING));
        }
        BodyFigure::Truck if !is_of_parts => blocks.extend([
            ([-0.02, 0.0, 0.18], [0.94, 0.70, 0.12], palette::TYRE),
            ([0.39, 0.0, 0.34], [0.22, 1.0, 0.40], colour),
            ([0.40, 0.0, 0.60], [0.20, 0.96, 0.14], palette::GLASS),
            ([0.38, 0.0, 0.72], [0.20, 1.0, 0.12], colour),
            ([-0.12, 0.0, 0.62], [0.75, 1.0, 0.76], agent.colour),
            // A band in the colour of its role identifies it from behind too.
            ([-0.12, 0.0, 0.30], [0.756, 1.01, 0.08], colour),
        ]),
        _ => {}
    }
    blocks
}

/// Wheels: four, or two on a motorcycle, or none on foot.
fn wheels(figure: BodyFigure, body: &Scale) -> Option<Cylinders3D> {
    let (axles, sides, radius_m, breadth_m): (_, &[f32], _, _) = match figure {
        BodyFigure::Person => return None,
        BodyFigure::TwoWheeler => ([-0.34, 0.34], &[0.0], 0.31, 0.14),
        BodyFigure::Car | BodyFigure::Van => {
            let radius_m = 0.07 * body.length_m;
            ([-0.31, 0.31], &[-0.45, 0.45], radius_m, 0.13 * body.width_m)
        }
        BodyFigure::Truck => ([-0.28, 0.34], &[-0.44, 0.44], 0.48, 0.3),
    };
    // A flat body limits the radius, since wheels must not reach above it.
    let radius_m = f32::min(radius_m, 0.5 * body.height_m);
    let on_axle = |axle: f32| {
        let sides = sides.iter();
        sides.map(move |side| {
            [
                axle * body.length_m,
                side * body.width_m,
                radius_m - 0.5 * body.height_m,
            ]
        })
    };
    let centres: Vec<[f32; 3]> = axles.into_iter().flat_map(on_axle).collect();
    // A cylinder is upright along z. A quarter turn about x makes it roll.
    let quarter = std::f32::consts::FRAC_1_SQRT_2;
    let rolling = re_sdk_types::datatypes::Quaternion::from_xyzw([quarter, 0.0, 0.0, quarter]);
    let wheels = Cylinders3D::from_lengths_and_radii(
        vec![breadth_m; centres.len()],
        vec![radius_m; centres.len()],
    )
    .with_quaternions(vec![rolling; centres.len()])
    .with_centers(centres)
    .with_colors([palette::TYRE])
    .with_fill_mode(FillMode::Solid);
    Some(wheels)
}

/// Round parts of people, on foot or on a motorcycle.
fn limbs(figure: BodyFigure, body: &Scale, colour: Rgb, paint: Rgb) -> Option<Capsules3D> {
    // Foot of the axis, its length and its radius, in shares of the height.
    let upright: &[([f32; 3], f32, f32, Rgb)] = match figure {
        BodyFigure::Person => &[
            ([0.0, -0.2, 0.06], 0.42, 0.05, palette::dimmed(colour, 0.5)),
            ([0.0, 0.2, 0.06], 0.42, 0.05, palette::dimmed(colour, 0.5)),
            ([0.0, 0.0, 0.54], 0.2, 0.12, colour),
            ([0.0, -0.42, 0.48], 0.3, 0.035, colour),
            ([0.0, 0.42, 0.48], 0.3, 0.035, colour),
            ([0.0, 0.0, 0.9], 0.03, 0.068, palette::HEADLIGHT),
        ],
        BodyFigure::TwoWheeler => &[
            ([-0.1, 0.0, 0.56], 0.2, 0.12, colour),
            ([-0.1, -0.3, 0.42], 0.36, 0.05, palette::dimmed(colour, 0.6)),
            ([-0.1, 0.3, 0.42], 0.36, 0.05, palette::dimmed(colour, 0.6)),
            ([-0.1, 0.0, 0.93], 0.02, 0.085, paint),
        ],
        BodyFigure::Car | BodyFigure::Van | BodyFigure::Truck => return None,
    };
    let height_m = body.height_m;
    let feet = upright.iter().map(|(foot, ..)| body.place(*foot));
    let limbs = Capsules3D::from_lengths_and_radii(
        upright.iter().map(|(_, length, ..)| length * height_m),
        upright.iter().map(|(_, _, radius, _)| radius * height_m),
    )
    .with_translations(feet)
    .with_colors(upright.iter().map(|(.., colour)| *colour))
    .with_fill_mode(FillMode::Solid);
    Some(limbs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Role;
    use crate::sim::Body;

    #[test]
    fn shipped_bodies_are_recognised_and_drawn_within_their_size() {
        let expected = [
            ("sedan", BodyFigure::Car),
            ("van", BodyFigure::Van),
            ("truck", BodyFigure::Truck),
            ("motorcycle", BodyFigure::TwoWheeler),
            ("pedestrian", BodyFigure::Person),
        ];
        for (name, figure) in expected {
            let body = Body::shipped(name).unwrap().unwrap();
            let agent = AgentDescription::of("ado", Role::Ado, &body);
            assert_eq!(agent.figure(), figure, "{name}");
            let bounds = surface(&agent, [1; 3]).bounds();
            for ((least, greatest), whole_m) in bounds.into_iter().zip(agent.size_m) {
                let reach_m = f64::from(greatest.max(-least));
                assert!(reach_m <= 0.51 * whole_m, "{name}: {reach_m} m");
            }
        }
    }

    #[test]
    fn a_body_of_parts_is_drawn_as_its_parts() {
        let body = Body::shipped("lorry_40t").unwrap().unwrap();
        let agent = AgentDescription::of("ado", Role::Ado, &body);
        assert!(matches!(agent.shape, BodyShape::Parts(_)));
        // Cab, rear of the tractor, trailer and its wheels. A box would have 168 m³.
        let tractor_m3 = 2.4 * 2.5 * 3.8 + 3.65 * 2.5 * 1.15;
        let parts_m3 = tractor_m3 + 13.6 * 2.55 * 2.85 + 3.9 * 2.5 * 1.15;
        let found_m3 = surface(&agent, [1; 3]).volume_m3();
        assert!((found_m3 - parts_m3).abs() < 0.3, "{found_m3} m³");
    }
}
