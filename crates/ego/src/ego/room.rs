//! Space that bodies occupy on the ego's road, for any heading.
//!
//! A follower uses the rear of its leader and its speed. This does not suit a
//! car that stands across the lane or approaches the ego. The nearest face of
//! such a car is a different side. The middle of its front bumper may lie in a
//! lane that the rest of its body does not occupy, or the reverse. Here a body
//! is its box in road coordinates, and a crossing is an overlap of two time
//! intervals.

use super::{Own, Seen};

/// Angle to the road up to which a body counts as along it.
const ALONG_RAD: f64 = core::f64::consts::FRAC_PI_6;
/// Ratio of length to width below which a body counts as along the road.
///
/// Such a body, for example a pedestrian, occupies similar space at any
/// heading.
const COMPACT: f64 = 1.5;
/// Time ahead for which followers extrapolate crossing agents, s.
const EXPECTED_S: f64 = 2.0;

/// A rectangle on the straightened road, relative to the middle of the ego's front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneOccupancy {
    /// Nearest face along the road.
    pub near_m: f64,
    /// Farthest face along the road.
    pub far_m: f64,
    /// Its right edge, positive to the left.
    pub right_m: f64,
    /// Its left edge, positive to the left.
    pub left_m: f64,
}

/// A time interval from now on, empty if the end precedes the beginning.
type TimeInterval = (f64, f64);

impl LaneOccupancy {
    /// Returns the box of a body from the middle of its front and its heading.
    ///
    /// The heading is counter-clockwise from the road.
    pub fn of(front_m: (f64, f64), heading_rad: f64, size_m: (f64, f64)) -> LaneOccupancy {
        let (sin, cos) = libm::sincos(heading_rad);
        let (half_length_m, half_width_m) = (0.5 * size_m.0, 0.5 * size_m.1);
        let middle = (
            front_m.0 - half_length_m * cos,
            front_m.1 - half_length_m * sin,
        );
        let along_m = half_length_m * cos.abs() + half_width_m * sin.abs();
        let across_m = half_length_m * sin.abs() + half_width_m * cos.abs();
        LaneOccupancy {
            near_m: middle.0 - along_m,
            far_m: middle.0 + along_m,
            right_m: middle.1 - across_m,
            left_m: middle.1 + across_m,
        }
    }

    /// Returns whether it reaches into a corridor around the ego's middle.
    pub fn is_within(&self, half_m: f64) -> bool {
        self.right_m < half_m && -half_m < self.left_m
    }

    /// Returns its time inside the corridor, at a constant speed to the left.
    fn inside_s(&self, half_m: f64, lateral_mps: f64) -> TimeInterval {
        // Exactly 0: any other speed divides without harm.
        match lateral_mps == 0.0 {
            // A body without lateral motion is inside for ever or never.
            true if self.is_within(half_m) => (0.0, f64::INFINITY),
            true => (0.0, -1.0),
            false => {
                // The leading edge enters first, and the trailing edge leaves
                // last.
                let (enters_m, leaves_m) = if lateral_mps > 0.0 {
                    (-half_m - self.left_m, half_m - self.right_m)
                } else {
                    (half_m - self.right_m, -half_m - self.left_m)
                };
                (enters_m / lateral_mps, leaves_m / lateral_mps)
            }
        }
    }

    /// Returns the time of the ego beside it, at a constant closing speed above 0.
    fn beside_s(&self, own: &Own, closing_mps: f64) -> TimeInterval {
        // Until the rear of the ego has passed its far face.
        let (first_m, last_m) = (self.near_m, self.far_m + own.length_m);
        (first_m / closing_mps, last_m / closing_mps)
    }
}

impl Seen {
    /// Returns whether it is along the road, like a leader. Pedestrians are.
    #[inline]
    pub fn is_along(&self) -> bool {
        self.road_heading_rad.abs() <= ALONG_RAD || self.length_m <= COMPACT * self.width_m
    }

    /// Returns the space that it occupies on the road.
    pub fn room(&self) -> LaneOccupancy {
        // Headings near the road's count as 0, so leaders have the same
        // clearance as in the car-following models.
        if self.is_along() {
            LaneOccupancy {
                near_m: self.headway_m - self.length_m,
                far_m: self.headway_m,
                right_m: self.lateral_m - 0.5 * self.width_m,
                left_m: self.lateral_m + 0.5 * self.width_m,
            }
        } else {
            LaneOccupancy::of(
                (self.headway_m, self.lateral_m),
                self.road_heading_rad,
                (self.length_m, self.width_m),
            )
        }
    }

    /// Returns the clearance from the ego's front to its nearest face.
    pub fn clearance_m(&self) -> f64 {
        self.room().near_m
    }

    /// Returns the headway of a leader with the same length and clearance.
    #[inline]
    pub fn following_headway_m(&self) -> f64 {
        if self.is_along() {
            self.headway_m
        } else {
            self.clearance_m() + self.length_m
        }
    }

    /// Returns whether it is in the ego's path, or will be when the ego arrives.
    ///
    /// Both are extrapolated for at most `look_ahead_s`. Only for agents across
    /// or against the road: each controller predicts the rest itself.
    pub(super) fn crosses_path(&self, own: &Own, side_m: f64, look_ahead_s: f64) -> bool {
        let room = self.room();
        let half_m = 0.5 * own.width_m + side_m;
        // It is behind the ego's front, where braking changes nothing.
        if room.far_m <= 0.0 {
            return false;
        }
        if room.is_within(half_m) {
            return true;
        }
        // An agent that is no slower than the ego is never reached.
        let closing_mps = own.speed_mps - self.speed_mps;
        if closing_mps <= 0.0 {
            return false;
        }
        let (enters_s, leaves_s) = room.inside_s(half_m, self.lateral_mps);
        let (first_s, last_s) = room.beside_s(own, closing_mps);
        let (begins_s, ends_s) = (enters_s.max(first_s).max(0.0), leaves_s.min(last_s));
        // Both intervals must overlap, and the agent must enter soon enough to
        // be predictable.
        enters_s <= leaves_s && begins_s <= ends_s && enters_s <= look_ahead_s
    }

    /// Returns whether it is ahead of a follower: in its path or about to cross.
    #[inline]
    pub fn is_ahead_of(&self, own: &Own) -> bool {
        if self.is_along() {
            self.headway_m > 0.0 && self.lateral_m.abs() < (self.width_m + own.width_m) / 2.0
        } else {
            self.crosses_path(own, 0.0, EXPECTED_S)
        }
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::{FRAC_PI_2, PI};

    use super::*;

    const OWN: Own = Own {
        speed_mps: 10.0,
        accel_mps2: 0.0,
        s_m: 0.0,
        lateral_m: 0.0,
        lane: 0,
        heading_rad: 0.0,
        lateral_mps: 0.0,
        yaw_rate_rad_per_s: 0.0,
        length_m: 4.5,
        width_m: 1.8,
    };

    fn car(headway_m: f64, lateral_m: f64, road_heading_rad: f64) -> Seen {
        Seen {
            headway_m,
            lateral_m,
            road_heading_rad,
            length_m: 4.5,
            width_m: 1.8,
            ..Seen::default()
        }
    }

    #[test]
    fn what_a_car_takes_up_turns_with_it() {
        for (heading_rad, room) in [
            (0.0, [25.5, 30.0, -0.9, 0.9]),
            (FRAC_PI_2, [29.1, 30.9, -4.5, 0.0]),
            (-FRAC_PI_2, [29.1, 30.9, 0.0, 4.5]),
            (PI, [30.0, 34.5, -0.9, 0.9]),
        ] {
            let it = car(30.0, 0.0, heading_rad).room();
            let found = [it.near_m, it.far_m, it.right_m, it.left_m];
            let mut pairs = found.iter().zip(&room);
            assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        }
    }

    #[test]
    fn who_stands_across_the_path_is_ahead_wherever_its_front_is() {
        for (front_m, heading_rad, ahead) in [
            (2.0, FRAC_PI_2, true),
            (-1.0, FRAC_PI_2, false),
            (6.0, FRAC_PI_2, false),
            (-2.0, -FRAC_PI_2, true),
            (1.0, -FRAC_PI_2, false),
            (3.5, PI, false),
            (1.5, PI, true),
        ] {
            let seen = car(30.0, front_m, heading_rad);
            assert_eq!(seen.is_ahead_of(&OWN), ahead, "{front_m} {heading_rad}");
        }
    }

    #[test]
    fn who_crosses_is_ahead_if_both_would_be_there_at_one_time() {
        // The ego is beside a car 15 m ahead from 1.4 to 2.1 s on. A body of 4.5 m
        // that moves at 5 m/s is in its path for 1.3 s. A body that is in the path
        // now is ahead, however soon it will have left.
        for (front_m, lateral_mps, ahead) in [
            (-6.0, 5.0, true),
            (-2.0, 5.0, true),
            (-13.0, 5.0, false),
            (3.0, 5.0, true),
            (6.0, 5.0, false),
            (-6.0, 0.0, false),
            (-6.0, -5.0, false),
        ] {
            let seen = Seen {
                lateral_mps,
                ..car(15.0, front_m, FRAC_PI_2)
            };
            assert_eq!(seen.is_ahead_of(&OWN), ahead, "{front_m} {lateral_mps}");
        }
    }
}
