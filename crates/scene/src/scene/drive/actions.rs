//! Action sets from which ados choose at each decision.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::turn_action::TurnAction;
use super::weather_rates::WeatherRates;
use crate::ego::Command;

/// Action set of an ado.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub enum Actions {
    /// Net accelerations in m/s² of a vehicle that keeps its lane.
    Accelerations(Vec<f64>),
    /// Accelerations and lateral moves of a vehicle.
    Grid(Grid),
    /// Velocities of a pedestrian, along the road and to the left, in m/s.
    Walks(Vec<(f64, f64)>),
    /// Phase changes of a traffic light.
    Phases(Vec<PhaseAction>),
    /// Deviations from the plan of an agent.
    Deviate(Deviation),
    /// Rates of change of the weather.
    Rates(Vec<WeatherRates>),
    /// Curvatures of the next piece of road in 1/m, positive to the left.
    Curvatures(Vec<f64>),
    /// Placed ados that act.
    Turns(Vec<TurnAction>),
}

/// All pairs of an acceleration and a lateral speed, added to a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// Accelerations along the heading, m/s².
    pub accelerations: Vec<f64>,
    /// Speeds to the left, m/s. In an action's number the acceleration counts faster.
    #[serde(default = "straight_on")]
    pub lateral_mps: Vec<f64>,
}

fn straight_on() -> Vec<f64> {
    vec![0.0]
}

impl Deviation {
    /// Returns the added acceleration along the heading and speed to the left.
    pub fn at(&self, action: usize) -> (f64, f64) {
        let count = self.accelerations.len();
        (
            self.accelerations[action % count],
            self.lateral_mps[action / count],
        )
    }
}

/// All pairs of an acceleration and a lateral move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "GridActions")]
pub struct Grid {
    /// Net accelerations, m/s².
    pub accelerations: Vec<f64>,
    /// Lateral moves. In an action's number the acceleration counts faster.
    pub lateral: Vec<Lateral>,
    /// Speed of a lateral move.
    #[serde(default = "lateral_speed_mps")]
    pub lateral_mps: f64,
    /// Time constant of the lateral speed.
    #[serde(default = "lateral_lag_s")]
    pub lateral_lag_s: f64,
}

fn lateral_speed_mps() -> f64 {
    1.5
}

fn lateral_lag_s() -> f64 {
    0.3
}

/// A lateral move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Lateral {
    /// No lateral speed.
    Hold,
    /// To the left.
    Left,
    /// To the right.
    Right,
}

/// Action of a traffic light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum PhaseAction {
    /// Keep the phase.
    Hold,
    /// Switch to the next phase: green, yellow, red, green.
    Advance,
}

/// Decoded action of an ado.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Maneuver {
    /// Wish of a vehicle.
    Drive {
        /// Net acceleration along the heading.
        accel_mps2: f64,
        /// Speed across the road, positive to the left.
        lateral_mps: f64,
    },
    /// Wish of a walker.
    Walk {
        /// Speed along the road.
        along_mps: f64,
        /// Speed across the road, positive to the left.
        left_mps: f64,
    },
    /// Change of a traffic light.
    Turn(PhaseAction),
    /// Change of the weather.
    Change(WeatherRates),
    /// Curvature of the next piece of road.
    Bend {
        /// Curvature, positive to the left.
        curvature_per_m: f64,
    },
}

impl Maneuver {
    /// Action before the first decision: no acceleration, no lateral speed.
    pub const NONE: Maneuver = Maneuver::Drive {
        accel_mps2: 0.0,
        lateral_mps: 0.0,
    };
}

impl Actions {
    /// Returns the number of actions.
    pub fn len(&self) -> usize {
        match self {
            Actions::Accelerations(list) => list.len(),
            Actions::Grid(grid) => grid.accelerations.len() * grid.lateral.len(),
            Actions::Walks(list) => list.len(),
            Actions::Phases(list) => list.len(),
            Actions::Rates(list) => list.len(),
            Actions::Curvatures(list) => list.len(),
            Actions::Turns(list) => list.len(),
            Actions::Deviate(added) => added.accelerations.len() * added.lateral_mps.len(),
        }
    }

    /// Returns whether the set is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns an action in words.
    pub fn label(&self, action: usize) -> String {
        match self {
            Actions::Accelerations(list) => format!("{:+} m/s²", list[action]),
            Actions::Grid(grid) => {
                let (accel_mps2, lateral) = grid.at(action);
                let lateral = match lateral {
                    Lateral::Hold => "hold",
                    Lateral::Left => "left",
                    Lateral::Right => "right",
                };
                format!("{accel_mps2:+} m/s² {lateral}")
            }
            Actions::Walks(list) => {
                let (along_mps, left_mps) = list[action];
                match (along_mps == 0.0, left_mps == 0.0) {
                    (true, true) => "stand".to_owned(),
                    (true, false) => format!("{left_mps:+} m/s across"),
                    (false, true) => format!("{along_mps:+} m/s along"),
                    (false, false) => format!("{along_mps:+} m/s along {left_mps:+} m/s across"),
                }
            }
            Actions::Phases(list) => match list[action] {
                PhaseAction::Hold => "hold".to_owned(),
                PhaseAction::Advance => "advance".to_owned(),
            },
            Actions::Rates(list) => list[action].label(),
            Actions::Curvatures(list) => bend_label(list[action]),
            Actions::Turns(list) => list[action].label(),
            Actions::Deviate(added) => match added.at(action) {
                (0.0, 0.0) => "as planned".to_owned(),
                (accel_mps2, 0.0) => format!("{accel_mps2:+} m/s² on the plan"),
                (0.0, left_mps) => format!("{left_mps:+} m/s aside of the plan"),
                (accel_mps2, left_mps) => {
                    format!("{accel_mps2:+} m/s² {left_mps:+} m/s aside on the plan")
                }
            },
        }
    }

    /// Returns the distance of two actions, 0 to 1.
    ///
    /// The difference of the commanded physical values, as a share of the
    /// largest difference in this set. In a grid both parts weigh one half.
    /// The three rates of the weather weigh one third each. Actions of a light,
    /// and turns, are equal (0) or different (1).
    pub fn distance(&self, a: usize, b: usize) -> f64 {
        let among = |list: &[f64], a: f64, b: f64| {
            let least = list.iter().copied().fold(f64::INFINITY, f64::min);
            let most = list.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            share((a - b).abs(), most - least)
        };
        match self {
            Actions::Accelerations(list) | Actions::Curvatures(list) => {
                among(list, list[a], list[b])
            }
            Actions::Grid(grid) => {
                let ((a, a_moves), (b, b_moves)) = (grid.at(a), grid.at(b));
                let moves: Vec<f64> = grid.lateral.iter().map(|it| it.towards()).collect();
                let lateral = among(&moves, a_moves.towards(), b_moves.towards());
                // Acceleration and lateral move count alike.
                0.5 * (among(&grid.accelerations, a, b) + lateral)
            }
            Actions::Walks(list) => {
                let apart = |a: (f64, f64), b: (f64, f64)| {
                    let (along, left) = (a.0 - b.0, a.1 - b.1);
                    (along * along + left * left).sqrt()
                };
                // Velocities have two parts, so the greatest distance may lie between any two.
                let pairs = list.iter().flat_map(|a| list.iter().map(move |b| (a, b)));
                let most = pairs.map(|(a, b)| apart(*a, *b)).fold(0.0, f64::max);
                share(apart(list[a], list[b]), most)
            }
            Actions::Phases(list) => f64::from(u8::from(list[a] != list[b])),
            Actions::Turns(list) => f64::from(u8::from(list[a] != list[b])),
            Actions::Rates(list) => {
                let of = |part: usize| -> Vec<f64> {
                    list.iter().map(|rates| rates.parts()[part].0).collect()
                };
                let apart = |part: usize| {
                    let values = of(part);
                    among(&values, values[a], values[b])
                };
                // The three rates count alike.
                (apart(0) + apart(1) + apart(2)) / 3.0
            }
            Actions::Deviate(added) => {
                let ((a, a_left), (b, b_left)) = (added.at(a), added.at(b));
                0.5 * (among(&added.accelerations, a, b)
                    + among(&added.lateral_mps, a_left, b_left))
            }
        }
    }

    /// Returns the hardest braking and the hardest acceleration, both without
    /// lateral motion.
    ///
    /// On foot these are the velocities against and along the road. For the weather
    /// they are its worst and its best change. For a light both are to hold, and for
    /// turns the first.
    pub(super) fn hardest(&self) -> [usize; 2] {
        let ends = |list: &mut dyn Iterator<Item = (usize, f64)>| {
            let all: Vec<(usize, f64)> = list.collect();
            // Of equal values, the first is the least and the last the most,
            // so a set of a single value still has two ends.
            let least = all.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            let most = all.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            [least, most].map(|end| end.map_or(0, |end| end.0))
        };
        match self {
            Actions::Accelerations(list) => ends(&mut list.iter().copied().enumerate()),
            Actions::Grid(grid) => {
                let hold = grid.lateral.iter().position(|it| *it == Lateral::Hold);
                // A set without `Hold` has no straight action, so its first
                // lateral move is used.
                let from = hold.unwrap_or(0) * grid.accelerations.len();
                ends(&mut grid.accelerations.iter().copied().enumerate()).map(|end| from + end)
            }
            Actions::Deviate(added) => {
                let straight = added.lateral_mps.iter().position(|mps| *mps == 0.0);
                let from = straight.unwrap_or(0) * added.accelerations.len();
                ends(&mut added.accelerations.iter().copied().enumerate()).map(|end| from + end)
            }
            Actions::Walks(list) => ends(&mut list.iter().map(|walk| walk.0).enumerate()),
            Actions::Rates(list) => ends(&mut list.iter().map(WeatherRates::mildness).enumerate()),
            // A bend slows an ego down, and a straight lets it accelerate.
            Actions::Curvatures(list) => {
                ends(&mut list.iter().map(|per_m| -per_m.abs()).enumerate())
            }
            Actions::Phases(list) => {
                let hold = list.iter().position(|turn| *turn == PhaseAction::Hold);
                [hold.unwrap_or(0); 2]
            }
            Actions::Turns(_) => [0; 2],
        }
    }

    /// Returns a vehicle's acceleration and its speed to the left, m/s.
    ///
    /// With a plan both are added to it. `None` for other action sets.
    pub fn motion(&self, action: usize) -> Option<Command> {
        match self.choice(action) {
            Maneuver::Drive {
                accel_mps2,
                lateral_mps,
            } => Some(Command {
                accel_mps2,
                lateral_mps,
            }),
            _ => None,
        }
    }

    /// Decodes an action.
    pub fn choice(&self, action: usize) -> Maneuver {
        match self {
            Actions::Accelerations(list) => Maneuver::Drive {
                accel_mps2: list[action],
                lateral_mps: 0.0,
            },
            Actions::Grid(grid) => {
                let (accel_mps2, lateral_mps) = grid.command(action);
                Maneuver::Drive {
                    accel_mps2,
                    lateral_mps,
                }
            }
            Actions::Walks(list) => Maneuver::Walk {
                along_mps: list[action].0,
                left_mps: list[action].1,
            },
            Actions::Phases(list) => Maneuver::Turn(list[action]),
            Actions::Rates(list) => Maneuver::Change(list[action]),
            Actions::Curvatures(list) => Maneuver::Bend {
                curvature_per_m: list[action],
            },
            // The scene reads turns by the number of the action.
            Actions::Turns(_) => Maneuver::NONE,
            Actions::Deviate(added) => {
                let (accel_mps2, lateral_mps) = added.at(action);
                Maneuver::Drive {
                    accel_mps2,
                    lateral_mps,
                }
            }
        }
    }

    /// Returns the time constant of the lateral speed.
    pub(super) fn lateral_lag_s(&self) -> f64 {
        match self {
            // Sets without lateral moves still correct their lane position with
            // the default lag.
            Actions::Grid(grid) => grid.lateral_lag_s,
            _ => lateral_lag_s(),
        }
    }
}

/// Returns a curvature in words: the radius and the side.
fn bend_label(curvature_per_m: f64) -> String {
    if curvature_per_m == 0.0 {
        return "straight".to_owned();
    }
    let side = if curvature_per_m < 0.0 {
        "right"
    } else {
        "left"
    };
    format!("{side} {:.0} m", 1.0 / curvature_per_m.abs())
}

/// Returns the ratio of a part to a whole, 0 for an empty whole.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

impl Lateral {
    /// Returns 1 for left, −1 for right and 0 for hold.
    pub fn towards(self) -> f64 {
        match self {
            Lateral::Hold => 0.0,
            Lateral::Left => 1.0,
            Lateral::Right => -1.0,
        }
    }
}

impl Grid {
    /// Returns an action's acceleration and its speed to the left, m/s.
    pub fn command(&self, action: usize) -> (f64, f64) {
        let (accel_mps2, lateral) = self.at(action);
        let lateral_mps = match lateral {
            Lateral::Hold => 0.0,
            Lateral::Left | Lateral::Right => lateral.towards() * self.lateral_mps,
        };
        (accel_mps2, lateral_mps)
    }

    fn at(&self, action: usize) -> (f64, Lateral) {
        let count = self.accelerations.len();
        (
            self.accelerations[action % count],
            self.lateral[action / count],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hardest_braking_and_acceleration_are_found_in_every_kind_of_set() {
        let accelerations = vec![0.0, 3.0, -6.0, -3.0];
        let sets = [
            (Actions::Accelerations(accelerations.clone()), [2, 1]),
            (
                Actions::Grid(Grid {
                    accelerations: accelerations.clone(),
                    lateral: vec![Lateral::Left, Lateral::Hold],
                    lateral_mps: 1.0,
                    lateral_lag_s: 0.3,
                }),
                [6, 5],
            ),
            (
                Actions::Deviate(Deviation {
                    accelerations,
                    lateral_mps: vec![-0.3, 0.0, 0.3],
                }),
                [6, 5],
            ),
            (
                Actions::Walks(vec![(0.0, 1.0), (1.0, 0.0), (-1.0, 0.0)]),
                [2, 1],
            ),
            (
                Actions::Phases(vec![PhaseAction::Advance, PhaseAction::Hold]),
                [1, 1],
            ),
        ];
        for (set, hardest) in sets {
            assert_eq!(set.hardest(), hardest, "{set:?}");
        }
    }
}
