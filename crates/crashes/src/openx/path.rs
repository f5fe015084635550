//! Vertices of a trajectory, computed from recorded motions.

use core::f64::consts::PI;

use crate::scene::Motion;
use crate::sim::{Body, BodyState, Placement, Pose};
use crate::testbench::FilmAfterContact;
use crate::xml::XmlElement;

/// Smallest distance of two instants in seconds, below the step of every player.
const ONE_INSTANT_S: f64 = 1e-6;
/// Time in seconds for which the pose of the contact is held, a usual step of players.
const HELD_S: f64 = 0.01;

/// Pose of the reference point of a body at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    pub time_s: f64,
    pub x_m: f64,
    pub y_m: f64,
    pub heading_rad: f64,
    /// Height and tilt, 0 on a flat road.
    pub z_m: f64,
    pub pitch_rad: f64,
    pub roll_rad: f64,
}

/// Distance in metres from the front bumper back to the reference point.
///
/// OpenSCENARIO moves the rear axle of a vehicle or bicycle and the middle of a
/// pedestrian.
pub(super) fn reference_behind_front_m(body: &Body) -> f64 {
    if body.is_on_foot() {
        body.half_length_m()
    } else {
        body.lever_m()
    }
}

/// Vertices of one agent's trajectory, one per sample.
///
/// A motion that ends in a contact has the instant of the contact in its last
/// sample, which is no multiple of the sampling time. Headings are not wrapped
/// at ±π. A player that interpolates them would otherwise turn the long way
/// round.
pub(super) fn vertices(motion: &Motion, agent: usize, body: &Body, sample_s: f64) -> Vec<Vertex> {
    let behind_m = reference_behind_front_m(body);
    let mut vertices: Vec<Vertex> = Vec::with_capacity(motion.len());
    for sample in 0..motion.len() {
        let is_end = sample + 1 == motion.len() && motion.contact.is_some();
        let time_s = if is_end {
            motion.end_s
        } else {
            sample_time_s(sample, sample_s)
        };
        // A contact right after a sample replaces the vertex of that sample.
        if vertices
            .last()
            .is_some_and(|last| time_s < last.time_s + ONE_INSTANT_S)
        {
            vertices.pop();
        }
        let vertex = vertex(&motion.at(sample)[agent].state, time_s, behind_m);
        push_unwrapped(&mut vertices, vertex);
    }
    vertices
}

/// Appends the vertices of one agent after the contact, one per frame.
///
/// The pose of the contact is held first. Bodies part again within a step, so a player
/// that compares them at its own steps would miss the contact.
pub(super) fn go_on(
    vertices: &mut Vec<Vertex>,
    after: &FilmAfterContact,
    agent: usize,
    body: &Body,
) {
    // A frame has the middle of the body, and a vertex its reference point.
    let ahead_m = body.half_length_m() - reference_behind_front_m(body);
    let held_until_s = nanoseconds(after.contact_s + HELD_S);
    vertices.extend(vertices.last().copied().map(|contact| Vertex {
        time_s: held_until_s,
        ..contact
    }));
    for (number, frame) in after.frames.iter().enumerate() {
        let time_s = after.time_s(number);
        if time_s < held_until_s + ONE_INSTANT_S {
            continue;
        }
        let vertex = Vertex {
            time_s,
            ..placed(&frame.placements[agent], ahead_m)
        };
        push_unwrapped(vertices, vertex);
    }
}

/// Appends a vertex with the nearest equivalent heading to the previous vertex.
fn push_unwrapped(vertices: &mut Vec<Vertex>, mut vertex: Vertex) {
    if let Some(last) = vertices.last() {
        // It may exceed ±π.
        let turns = (last.heading_rad - vertex.heading_rad) / (2.0 * PI);
        vertex.heading_rad += 2.0 * PI * libm::round(turns);
    }
    vertices.push(vertex);
}

/// Vertex at 0 s of a point on the axis of a body, ahead of its middle.
fn placed(placement: &Placement, ahead_m: f64) -> Vertex {
    let [x_m, y_m, _] = placement.centre_m;
    let middle = Pose {
        x_m,
        y_m,
        heading_rad: placement.heading_rad(),
    };
    let pose = middle.ahead(ahead_m);
    Vertex {
        time_s: 0.0,
        x_m: pose.x_m,
        y_m: pose.y_m,
        heading_rad: pose.heading_rad,
        z_m: 0.0,
        pitch_rad: 0.0,
        roll_rad: 0.0,
    }
}

fn vertex(state: &BodyState, time_s: f64, behind_m: f64) -> Vertex {
    let pose = state.pose.ahead(-behind_m);
    Vertex {
        time_s,
        x_m: pose.x_m,
        y_m: pose.y_m,
        heading_rad: pose.heading_rad,
        z_m: 0.0,
        pitch_rad: 0.0,
        roll_rad: 0.0,
    }
}

/// Time of a sample in seconds: i · dt, rounded to 1 ns.
///
/// Rounding removes the digits that binary fractions add, such as
/// 0.15000000000000002.
pub(super) fn sample_time_s(sample: usize, sample_s: f64) -> f64 {
    nanoseconds(sample as f64 * sample_s)
}

/// Rounds a time in seconds to 1 ns.
fn nanoseconds(time_s: f64) -> f64 {
    (time_s * 1e9).round() / 1e9
}

impl Vertex {
    /// Returns the place as a `Position`.
    pub(super) fn position(&self) -> XmlElement {
        let place = XmlElement::new("WorldPosition")
            .number("x", self.x_m)
            .number("y", self.y_m)
            .number("z", self.z_m)
            .number("h", self.heading_rad)
            .number("p", self.pitch_rad)
            .number("r", self.roll_rad);
        XmlElement::new("Position").child(place)
    }

    /// Returns the vertex on a line of its own.
    pub(super) fn element(&self) -> XmlElement {
        let vertex = XmlElement::new("Vertex").number("time", self.time_s);
        vertex.child(self.position()).on_one_line()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{AfterContact, BodySample, ContactEvent, Frame, Start};

    fn sample(heading_rad: f64) -> BodySample {
        let pose = Pose {
            heading_rad,
            ..Pose::default()
        };
        let state = BodyState {
            pose,
            ..BodyState::default()
        };
        BodySample {
            state,
            command: None,
        }
    }

    fn turning(headings_rad: &[f64], contact_s: Option<f64>) -> Vec<Vertex> {
        let mut motion = Motion::new(Start(Vec::new()), &[sample(headings_rad[0])]);
        for heading_rad in &headings_rad[1..] {
            motion.push(&[sample(*heading_rad)]);
        }
        motion.contact = contact_s.map(|time_s| ContactEvent {
            between: ("a".to_owned(), "b".to_owned()),
            time_s,
            closing_speed_mps: 1.0,
            point_m: [0.0; 3],
            impact: None,
        });
        motion.end_s = contact_s.unwrap_or(0.0);
        let body = Body::shipped("sedan").expect("shipped").expect("a body");
        vertices(&motion, 0, &body, 0.05)
    }

    #[test]
    fn the_rear_axle_is_what_moves() {
        let body = Body::shipped("sedan").expect("shipped").expect("a body");
        let vehicle = body.vehicle().expect("a vehicle");
        let front = BodyState {
            pose: Pose {
                x_m: 10.0,
                y_m: 2.0,
                heading_rad: 0.5 * PI,
            },
            ..BodyState::default()
        };
        let rear = vertex(&front, 0.0, reference_behind_front_m(&body));
        assert!((rear.x_m - 10.0).abs() < 1e-12);
        let expected_m = 2.0 - vehicle.wheelbase_m - vehicle.front_overhang_m;
        assert!((rear.y_m - expected_m).abs() < 1e-12);
    }

    #[test]
    fn headings_go_on_beyond_a_half_turn() {
        // The headings cross ±π twice, once each way.
        let turned = turning(&[3.1, -3.1, -2.9, 3.0], None);
        let headings = turned.iter().map(|vertex| vertex.heading_rad);
        let steps: Vec<f64> = headings.collect();
        assert!(steps.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 1.0));
    }

    #[test]
    fn the_last_vertex_is_at_the_contact() {
        let times = |contact_s| -> Vec<f64> {
            let crashed = turning(&[0.0; 3], contact_s);
            crashed.iter().map(|vertex| vertex.time_s).collect()
        };
        assert_eq!(times(Some(0.0625)), [0.0, 0.05, 0.0625]);
        assert_eq!(times(None), [0.0, 0.05, 0.1]);
        // At the sample itself, the contact gives no second vertex.
        assert_eq!(times(Some(0.05)), [0.0, 0.05]);
    }

    #[test]
    fn the_pose_of_the_contact_is_held_for_a_step_of_players() {
        let body = Body::shipped("sedan").expect("shipped").expect("a body");
        let moved = |x_m: f64| Placement::upright([x_m, 0.0, 0.7], 0.0);
        // Samples longer and shorter than the step.
        for (sample_s, times_s) in [
            (0.05, vec![0.0625, 0.0725, 0.1125]),
            (0.005, vec![0.0625, 0.0725]),
        ] {
            let mut way = turning(&[0.0; 3], Some(0.0625));
            let before = way.clone();
            let after = FilmAfterContact {
                contact_s: 0.0625,
                sample_s,
                motion: AfterContact {
                    duration_s: sample_s,
                    collisions: Vec::new(),
                    pushed: Vec::new(),
                },
                frames: vec![Frame {
                    placements: vec![moved(5.0)],
                    phases: Vec::new(),
                    seen: None,
                }],
            };
            go_on(&mut way, &after, 0, &body);
            assert_eq!(way[..before.len()], before);
            let contact = before[before.len() - 1];
            let time_s = contact.time_s;
            let held = way[before.len()];
            assert_eq!(Vertex { time_s, ..held }, contact);
            let ends = way[before.len() - 1..].iter().map(|it| it.time_s);
            assert_eq!(ends.collect::<Vec<f64>>(), times_s);
        }
    }
}
