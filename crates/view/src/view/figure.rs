//! Figures of road users: as large as their bodies, with a shape for each kind.

use rerun::AsComponents;
use rerun::archetypes::{Boxes3D, Capsules3D, Cylinders3D, Points3D};
use rerun::components::FillMode;

use super::entity::agent_path;
use super::error::ViewError;
use super::log_writer::LogWriter;
use super::palette::{self, Rgb};
use super::viewed_episode::ViewedEpisode;
use crate::scene::{AgentDescription, BodyFigure};

/// Logs a body in the frame of its own centre: x forward, y left, z up.
pub(super) fn log(
    story: &ViewedEpisode<'_>,
    who: usize,
    journal: &mut LogWriter,
) -> Result<(), ViewError> {
    let agent = &story.shown.stage.agents[who];
    let colour = story.colour(who);
    let figure = agent.figure();
    let scale = Scale::of(agent);
    let (mut centres, mut sizes, mut colours) = (Vec::new(), Vec::new(), Vec::new());
    for (centre, size, colour) in boxes(figure, &scale, colour, agent.colour) {
        centres.push(centre);
        sizes.push(size);
        colours.push(colour);
    }
    let body = Boxes3D::from_centers_and_sizes(centres, sizes)
        .with_colors(colours)
        .with_fill_mode(FillMode::Solid)
        .with_show_labels(false);
    let label = match figure {
        BodyFigure::Car => agent.name.clone(),
        _ => format!("{} ({})", agent.name, agent.body),
    };
    // The ego's name lies to its right and other names to their left. Seen from
    // above, the names of two touching agents then stay apart.
    let side = if who == story.ego() { -1.0 } else { 1.0 };
    let aside_m = side * (0.5 * scale.width_m + 0.9);
    let name = Points3D::new([[0.0, aside_m, 0.5 * scale.height_m + 0.2]])
        .with_radii([0.03])
        .with_colors([colour])
        .with_labels([label]);
    let wheels = wheels(figure, &scale);
    let limbs = limbs(figure, &scale, colour, agent.colour);
    let mut parts: Vec<&dyn AsComponents> = vec![&body, &name];
    parts.extend(wheels.iter().map(|wheels| wheels as &dyn AsComponents));
    parts.extend(limbs.iter().map(|limbs| limbs as &dyn AsComponents));
    journal.always(agent_path(&agent.name), &parts)
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
    fn place(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        [
            x * self.length_m,
            y * self.width_m,
            (z - 0.5) * self.height_m,
        ]
    }

    fn size(&self, x: f32, y: f32, z: f32) -> [f32; 3] {
        [x * self.length_m, y * self.width_m, z * self.height_m]
    }
}

type ColouredBox = ([f32; 3], [f32; 3], Rgb);

/// Boxes (centre, size, colour) of a figure.
///
/// `colour` identifies the agent, and `paint` is its own.
fn boxes(figure: BodyFigure, body: &Scale, colour: Rgb, paint: Rgb) -> Vec<ColouredBox> {
    let part = |at: [f32; 3], size: [f32; 3], colour: Rgb| -> ColouredBox {
        let (place, size) = (
            body.place(at[0], at[1], at[2]),
            body.size(size[0], size[1], size[2]),
        );
        (place, size, colour)
    };
    let mut parts = match figure {
        // A face shows the direction in which a person looks.
        BodyFigure::Person => {
            return vec![part([0.16, 0.0, 0.92], [0.2, 0.16, 0.06], palette::GLASS)];
        }
        BodyFigure::TwoWheeler => {
            return vec![
                part([0.0, 0.0, 0.36], [0.5, 0.36, 0.22], colour),
                part([-0.22, 0.0, 0.5], [0.34, 0.3, 0.06], palette::TYRE),
                part([0.22, 0.0, 0.64], [0.04, 0.9, 0.03], palette::POST),
                part([0.34, 0.0, 0.54], [0.03, 0.26, 0.1], palette::HEADLIGHT),
                part([-0.44, 0.0, 0.48], [0.03, 0.2, 0.05], palette::TAIL_LIGHT),
            ];
        }
        BodyFigure::Car => vec![
            part([0.0, 0.0, 0.38], [1.0, 1.0, 0.40], colour),
            part([-0.10, 0.0, 0.74], [0.50, 0.86, 0.36], palette::GLASS),
            part([-0.10, 0.0, 0.96], [0.45, 0.84, 0.08], colour),
            // A bright bonnet stripe and lights distinguish the front from the
            // rear.
            part([0.325, 0.0, 0.59], [0.31, 0.16, 0.03], palette::MARKING),
        ],
        BodyFigure::Van => vec![
            part([0.0, 0.0, 0.30], [1.0, 1.0, 0.40], colour),
            part([-0.16, 0.0, 0.74], [0.68, 0.98, 0.48], paint),
            part([0.27, 0.0, 0.66], [0.22, 0.94, 0.32], palette::GLASS),
            part([0.24, 0.0, 0.90], [0.20, 0.96, 0.16], colour),
            part([0.43, 0.0, 0.505], [0.13, 0.16, 0.02], palette::MARKING),
        ],
        BodyFigure::Truck => vec![
            part([-0.02, 0.0, 0.18], [0.94, 0.70, 0.12], palette::TYRE),
            part([0.39, 0.0, 0.34], [0.22, 1.0, 0.40], colour),
            part([0.40, 0.0, 0.60], [0.20, 0.96, 0.14], palette::GLASS),
            part([0.38, 0.0, 0.72], [0.20, 1.0, 0.12], colour),
            part([-0.12, 0.0, 0.62], [0.75, 1.0, 0.76], paint),
            // A band in the colour of its role identifies it from behind too.
            part([-0.12, 0.0, 0.30], [0.756, 1.01, 0.08], colour),
        ],
    };
    // Pillars in the role's colour hold the roof of a car.
    if figure == BodyFigure::Car {
        for x in [0.13, -0.33] {
            for side in [-0.42, 0.42] {
                parts.push(part([x, side, 0.74], [0.02, 0.05, 0.40], colour));
            }
        }
    }
    let low = if figure == BodyFigure::Car {
        0.45
    } else {
        0.24
    };
    for side in [-0.36, 0.36] {
        parts.push(part(
            [0.5, side, low],
            [0.012, 0.2, 0.1],
            palette::HEADLIGHT,
        ));
        parts.push(part(
            [-0.5, side, low],
            [0.012, 0.2, 0.1],
            palette::TAIL_LIGHT,
        ));
    }
    parts
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
    let rolling = rerun::datatypes::Quaternion::from_xyzw([quarter, 0.0, 0.0, quarter]);
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
    let feet = upright.iter().map(|([x, y, z], ..)| body.place(*x, *y, *z));
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
            let scale = Scale::of(&agent);
            for (centre, size, _) in boxes(figure, &scale, [1; 3], [2; 3]) {
                for (axis, whole_m) in agent.size_m.iter().enumerate() {
                    let reach_m = f64::from(centre[axis].abs() + 0.5 * size[axis]);
                    assert!(
                        reach_m <= 0.51 * whole_m,
                        "{name}: axis {axis}, {reach_m} m"
                    );
                }
            }
        }
    }
}
