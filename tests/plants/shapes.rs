//! Contacts of collision shapes, with answers worked out by hand.
//!
//! The bodies are carried, so that their poses are exact.

use brakecheck_sim::sim::{BodyPart, BodyShape};

use super::*;

const EXACT_M: f64 = 1e-6;

/// Carries the first of two bodies along x at a speed until it touches the second.
///
/// Returns the contact with the way of the first body up to it.
fn way_to_contact(moving: &Body, from: Pose, other: &Body, at: Pose) -> Option<(f64, Contact)> {
    const SPEED_MPS: f64 = 20.0;
    let mut plant = plant(PlantKind::Rigid, DRY);
    let first = plant.spawn(moving, from, 0.0);
    let second = plant.spawn(other, at, 0.0);
    for index in 1..=60 {
        let x_m = from.x_m + SPEED_MPS * SAMPLE_S * f64::from(index);
        plant.command(
            first,
            BodyCommand::Carry {
                to: Pose { x_m, ..from },
            },
        );
        plant.command(second, BodyCommand::Carry { to: at });
        if let Some(contact) = plant.advance(SAMPLE_S, 4) {
            let before_s = SAMPLE_S * f64::from(index - 1);
            return Some((SPEED_MPS * (before_s + contact.after_s), contact));
        }
    }
    None
}

/// A sedan of another height.
fn sedan_of_height(height_m: f64) -> Body {
    Body {
        height_m,
        ..body("sedan")
    }
}

#[test]
fn a_low_car_passes_under_a_raised_trailer_and_a_higher_one_does_not() {
    // The trailer stands across the road. The middle of its open space, 0.25 m
    // behind its middle, is at y = 0.
    let trailer = body("semitrailer");
    let front = at(20.0, 8.5, core::f64::consts::FRAC_PI_2);
    let low = sedan_of_height(1.1);
    assert!(way_to_contact(&low, at(0.0, 0.0, 0.0), &trailer, front).is_none());
    // Its side is 1.275 m from its middle line at x = 20.
    let high = sedan_of_height(1.2);
    let (way_m, contact) =
        way_to_contact(&high, at(0.0, 0.0, 0.0), &trailer, front).expect("a contact");
    close(way_m, 20.0 - 1.275, EXACT_M, "way to the trailer's side");
    close(contact.point_m[2], 0.5 * (1.15 + 1.2), EXACT_M, "height");
    // The tractor's rear reaches the ground, so a low car touches it.
    let at_tractor = at(20.0, 4.25, core::f64::consts::FRAC_PI_2);
    let (way_m, _) =
        way_to_contact(&low, at(0.0, 0.0, 0.0), &trailer, at_tractor).expect("a contact");
    close(way_m, 20.0 - 1.25, EXACT_M, "way to the tractor's side");
}

/// A sedan with mirrors, 2.1 m wide over all and 1.8 m without them.
fn sedan_with_mirrors() -> Body {
    let part = |ahead_m, left_m, up_m| BodyPart::Box {
        ahead_m,
        left_m,
        up_m,
    };
    Body {
        width_m: 2.1,
        shape: BodyShape::Parts(vec![
            part((-2.27, 2.27), (-0.9, 0.9), (0.0, 1.45)),
            part((0.8, 1.0), (0.9, 1.05), (0.9, 1.1)),
            part((0.8, 1.0), (-1.05, -0.9), (0.9, 1.1)),
        ]),
        ..body("sedan")
    }
}

#[test]
fn two_cars_that_pass_closely_touch_with_their_mirrors_only() {
    let car = sedan_with_mirrors();
    let oncoming = |lateral_m| at(30.0, lateral_m, core::f64::consts::PI);
    // The bodies have 0.2 m between them, and the mirrors overlap by 0.1 m. Both
    // mirrors' front faces are 1.27 m behind their bumper.
    let (way_m, contact) =
        way_to_contact(&car, at(0.0, 0.0, 0.0), &car, oncoming(2.0)).expect("a contact");
    close(way_m, 30.0 + 2.0 * 1.27, EXACT_M, "way to the mirror");
    close(contact.point_m[1], 1.0, EXACT_M, "between both mirrors");
    close(contact.point_m[2], 1.0, EXACT_M, "height of the mirrors");
    assert!(way_to_contact(&car, at(0.0, 0.0, 0.0), &car, oncoming(2.11)).is_none());
}

#[test]
fn a_rounded_corner_clips_a_wall_at_45_degrees_where_its_arc_does() {
    let car = Body {
        shape: BodyShape::Rounded {
            corner_radius_m: 0.4,
        },
        ..body("sedan")
    };
    // A box of 1 m, turned by 45°, whose nearest corner is at x = 10, y = 0.8.
    let size_m = 1.0;
    let wall = Body {
        length_m: size_m,
        width_m: size_m,
        ..body("adult")
    };
    let wall = Body {
        shape: BodyShape::Box,
        ..wall
    };
    let middle_x_m = 10.0 + size_m * 0.5_f64.sqrt();
    let half_m = 0.5 * size_m * 0.5_f64.sqrt();
    let turned = at(
        middle_x_m + half_m,
        0.8 + half_m,
        core::f64::consts::FRAC_PI_4,
    );
    let (way_m, contact) =
        way_to_contact(&car, at(0.0, 0.0, 0.0), &wall, turned).expect("a contact");
    // The arc's centre is 0.4 m behind the front and 0.5 m to the left. The wall
    // runs at 45° through the corner, so the centre is 0.4 m from it when it is
    // 0.4·√2 - 0.3 m before the corner.
    let want_m = 10.0 - (0.4 * 2.0_f64.sqrt() - 0.3) + 0.4;
    close(way_m, want_m, EXACT_M, "way to the wall");
    let diagonal = 0.5_f64.sqrt();
    close(contact.normal[0], diagonal, 1e-6, "normal ahead");
    close(contact.normal[1], diagonal, 1e-6, "normal to the left");
    close(
        contact.closing_speed_mps,
        20.0 * diagonal,
        1e-4,
        "closing speed",
    );
}

#[test]
fn a_capsule_is_touched_at_its_radius() {
    let adult = body("adult");
    // The middle of the adult is 0.15 m left of the car's side.
    let beside = at(20.25, 0.9 + 0.15, 0.0);
    let (way_m, contact) =
        way_to_contact(&body("sedan"), at(0.0, 0.0, 0.0), &adult, beside).expect("a contact");
    // The corner reaches the circle of radius 0.25 m about (20, 1.05).
    close(way_m, 20.0 - 0.2, EXACT_M, "way to the capsule");
    close(contact.normal[0], 0.8, 1e-6, "normal ahead");
    close(contact.normal[1], 0.6, 1e-6, "normal to the left");
}

#[test]
fn gaps_are_measured_between_the_shapes() {
    let mut plant = plant(PlantKind::Rigid, DRY);
    let trailer = plant.spawn(&body("semitrailer"), at(0.0, 0.0, 0.0), 0.0);
    // Under the trailer: the floor is nearer than the wheels.
    let low = sedan_of_height(1.0);
    let across = at(-8.5, 2.27, core::f64::consts::FRAC_PI_2);
    let car = plant.spawn(&low, across, 0.0);
    close(plant.gap_m(trailer, car), 0.15, EXACT_M, "gap to the floor");
    let adult = plant.spawn(&body("adult"), at(3.25, 0.0, 0.0), 0.0);
    close(plant.gap_m(trailer, adult), 2.75, EXACT_M, "gap to the cab");
}

#[test]
fn shapes_that_do_not_fit_their_box_are_refused_by_name() {
    let with = |shape| Body {
        shape,
        ..body("sedan")
    };
    let text = |body: Body| body.validate().expect_err("refused").to_string();
    let rounded = with(BodyShape::Rounded {
        corner_radius_m: 0.8,
    });
    assert_eq!(
        text(rounded),
        "`shape.corner_radius_m` is 0.8, but it must be between 0.001 and 0.725"
    );
    let short = with(BodyShape::Parts(vec![BodyPart::Box {
        ahead_m: (-2.27, 2.0),
        left_m: (-0.9, 0.9),
        up_m: (0.0, 1.45),
    }]));
    assert_eq!(
        text(short),
        "`shape.parts, foremost` is 2, but it must be 2.27, as the bounding box has it"
    );
    let line = with(BodyShape::Parts(vec![BodyPart::Prism {
        outline_m: vec![(-2.27, -0.9), (0.0, 0.0), (2.27, 0.9)],
        up_m: (0.0, 1.45),
    }]));
    assert!(text(line).starts_with("`shape.outline_m, area` is 0,"));
    assert!(text(with(BodyShape::Parts(Vec::new()))).contains("`shape.parts` is 0,"));
    let nan = with(BodyShape::Rounded {
        corner_radius_m: f64::NAN,
    });
    assert!(nan.validate().is_err());
}
