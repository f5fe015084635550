//! How severe a contact is for the ego: its kind, speeds, Δv and injury risk.
//!
//! Pure functions of two bodies' states at the instant of the contact. The
//! contact normal says which side of each body is touched, the masses say how
//! much either velocity changes:
//!
//! Δv_ego = m_other / (m_ego + m_other) · (1 + e) · closing speed, with e = 0.
//!
//! That is the plastic, central impact along the normal (no friction, no
//! rotation); crashes above walking pace have e ≈ 0 … 0.2, so Δv is rather too
//! small than too large.
//!
//! Risks are published curves and nothing else ([`RiskCurve`]); where none fits,
//! there is no risk rather than a guess. What the words mean to users is in
//! `docs/crashes.md`.
//!
//! ```
//! use brakecheck::severity::{CrashKind, Impact, Party};
//! use brakecheck::sim::{Body, BodyState, Pose};
//!
//! let sedan = Body::shipped("sedan").unwrap().unwrap();
//! let at = |x_m, speed_mps| BodyState {
//!     pose: Pose { x_m, ..Pose::default() },
//!     speed_mps,
//!     ..BodyState::default()
//! };
//! let ego = Party { body: &sedan, state: at(0.0, 20.0) };
//! let other = Party { body: &sedan, state: at(4.54, 12.0) };
//! let impact = Impact::of(ego, other, [1.0, 0.0], 8.0);
//! assert_eq!(impact.kind, CrashKind::RearEnd);
//! assert_eq!(impact.ego_delta_v_mps, 4.0);
//! ```
//!
//! Architecture Invariant: knows bodies, no scene, no rule and no role but "the
//! ego and the other one".

use core::f64::consts::{FRAC_PI_4, TAU};
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use crate::sim::{Body, BodyState};

/// Masses of the cars from whose crashes the curves were made.
const LIGHT_KG: std::ops::RangeInclusive<f64> = 500.0..=4000.0;
/// A quarter turn and a half: from here on two headings are opposed.
const OPPOSED_RAD: f64 = 3.0 * FRAC_PI_4;

/// How two bodies meet.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[strum(serialize_all = "kebab-case")]
pub enum CrashKind {
    /// The front of one against the rear of the other.
    RearEnd,
    /// Front against front, headings opposed by more than 135°.
    HeadOn,
    /// Flank along flank, in either direction.
    SideSwipe,
    /// Whatever meets at an angle: a front in a flank, most of all.
    Crossing,
    /// The other one is on foot.
    Pedestrian,
}

impl CrashKind {
    /// The word in tables.
    pub fn word(self) -> &'static str {
        self.into()
    }
}

/// Which side of a body is touched: the one the contact normal points out of.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
pub enum Side {
    /// Within 45° of its heading.
    Front,
    /// The flank to the left.
    Left,
    /// The flank to the right.
    Right,
    /// Within 45° of straight back.
    Rear,
}

impl Side {
    /// The side out of which a direction points, itself relative to the heading.
    fn towards(direction_rad: f64) -> Side {
        match direction_rad.abs() {
            off if off < FRAC_PI_4 => Side::Front,
            off if OPPOSED_RAD < off => Side::Rear,
            _ if 0.0 < direction_rad => Side::Left,
            _ => Side::Right,
        }
    }

    fn is_flank(self) -> bool {
        matches!(self, Side::Left | Side::Right)
    }

    /// The word in tables.
    pub fn word(self) -> &'static str {
        self.into()
    }
}

/// A published curve of injury risk.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[strum(serialize_all = "kebab-case")]
pub enum RiskCurve {
    /// That an occupant of the ego is injured seriously or worse (MAIS 3+), by
    /// the ego's Δv and the side that is hit.
    ///
    /// P = 1 / (1 + exp(4.457 − 0.177 Δv − side)), Δv in m/s, side 0 for the
    /// front, 0.244 for a flank, −0.431 for the rear: the logistic regression
    /// over four symmetric areas of Geisslinger, Poszler and Lienkamp, "An
    /// ethical trajectory planning algorithm for autonomous vehicles", Nature
    /// Machine Intelligence 5 (2023) 137–144, coefficients from its code
    /// (TUMFTM/EthicalTrajectoryPlanning, `harm_parameters.json`,
    /// `reduced_sym_angle_areas`). It is fitted to reported crashes, so it is
    /// 1 % at Δv 0: read differences, not small values.
    OccupantMais3,
    /// That an adult on foot who is hit by the ego's front dies, by the ego's
    /// speed.
    ///
    /// P = 1 / (1 + exp(6.9 − 0.090 v)), v in km/h: Rosén and Sander, "Pedestrian
    /// fatality risk as a function of car impact speed", Accident Analysis and
    /// Prevention 41 (2009) 536–542.
    PedestrianFatality,
}

impl RiskCurve {
    /// What it tells the probability of, in words.
    pub fn about(self) -> &'static str {
        match self {
            RiskCurve::OccupantMais3 => "MAIS 3+ of the ego's occupants",
            RiskCurve::PedestrianFatality => "death of the pedestrian",
        }
    }
}

/// A probability of injury, and the curve it is from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InjuryRisk {
    /// Whose injury, by which curve.
    pub curve: RiskCurve,
    /// 0 to 1.
    pub probability: f64,
}

impl Display for InjuryRisk {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.probability;
        write!(f, "{percent:.1} % ({})", self.curve.about())
    }
}

/// One of two bodies that touch.
#[derive(Clone, Copy, Debug)]
pub struct Party<'a> {
    /// Its size and mass.
    pub body: &'a Body,
    /// Its state at the instant of the contact.
    pub state: BodyState,
}

impl Party<'_> {
    /// Speed over ground of its front.
    fn speed_mps(&self) -> f64 {
        let (ahead, left) = (self.state.speed_mps, self.state.lateral_mps);
        (ahead * ahead + left * left).sqrt()
    }

    fn is_light_vehicle(&self) -> bool {
        !self.body.is_on_foot() && LIGHT_KG.contains(&self.body.mass_kg)
    }

    /// Middle of its front or rear, in the frame of `heading_rad` at `origin`,
    /// to the left; with half the width that this face has there.
    fn face(&self, side: Side, frame: &Party<'_>) -> (f64, f64) {
        let (own, other) = (&self.state.pose, &frame.state.pose);
        let back_m = if side == Side::Rear {
            self.body.length_m
        } else {
            0.0
        };
        let (sin, cos) = libm::sincos(own.heading_rad);
        let (dx_m, dy_m) = (
            own.x_m - back_m * cos - other.x_m,
            own.y_m - back_m * sin - other.y_m,
        );
        let (frame_sin, frame_cos) = libm::sincos(other.heading_rad);
        let turned = cos * frame_cos + sin * frame_sin;
        let left_m = dy_m * frame_cos - dx_m * frame_sin;
        (left_m, 0.5 * self.body.width_m * turned.abs())
    }
}

/// What a contact does to the ego.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impact {
    /// How they meet.
    pub kind: CrashKind,
    /// Where the ego is touched.
    pub ego_side: Side,
    /// Where the other one is touched.
    pub other_side: Side,
    /// Of fronts and rears: the share of the narrower width that overlaps,
    /// across the ego's heading; 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap: Option<f64>,
    /// Speed over ground of the ego's front.
    pub ego_speed_mps: f64,
    /// Speed over ground of the other one.
    pub other_speed_mps: f64,
    /// Heading of the other one relative to the ego's, counter-clockwise, in −π to π.
    pub turned_rad: f64,
    /// How much the ego's velocity changes.
    pub ego_delta_v_mps: f64,
    /// How much that of the other one changes.
    pub other_delta_v_mps: f64,
    /// The curve that applies, if one does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<RiskCurve>,
}

/// Speed at or below which the ego stands, and is to blame for no contact.
pub const STANDING_MPS: f64 = 0.5;

impl Impact {
    /// Whether the ego can be asked about it at all: it moved, and was not
    /// struck from behind.
    pub fn concerns_ego(&self) -> bool {
        STANDING_MPS < self.ego_speed_mps && self.ego_side != Side::Rear
    }

    /// What the contact does to `ego`.
    ///
    /// `normal` is the contact normal from the ego to the other one, a unit
    /// vector in the world frame; along it they close by `closing_speed_mps`.
    pub fn of(
        ego: Party<'_>,
        other: Party<'_>,
        normal: [f64; 2],
        closing_speed_mps: f64,
    ) -> Impact {
        let (own, its) = (ego.state.pose.heading_rad, other.state.pose.heading_rad);
        let out_rad = libm::atan2(normal[1], normal[0]);
        let ego_side = Side::towards(wrapped(out_rad - own));
        // The other one is touched from the opposite direction.
        let other_side = Side::towards(wrapped(libm::atan2(-normal[1], -normal[0]) - its));
        let turned_rad = wrapped(its - own);
        let kind = match other.body.is_on_foot() {
            true => CrashKind::Pedestrian,
            false => kind_of(ego_side, other_side, turned_rad),
        };
        let (ego_kg, other_kg) = (ego.body.mass_kg, other.body.mass_kg);
        let lengthwise = matches!(kind, CrashKind::RearEnd | CrashKind::HeadOn);
        Impact {
            kind,
            ego_side,
            other_side,
            overlap: lengthwise.then(|| overlap((&ego, ego_side), (&other, other_side))),
            ego_speed_mps: ego.speed_mps(),
            other_speed_mps: other.speed_mps(),
            turned_rad,
            ego_delta_v_mps: other_kg / (ego_kg + other_kg) * closing_speed_mps,
            other_delta_v_mps: ego_kg / (ego_kg + other_kg) * closing_speed_mps,
            curve: match kind {
                _ if !ego.is_light_vehicle() => None,
                CrashKind::Pedestrian => {
                    (ego_side == Side::Front).then_some(RiskCurve::PedestrianFatality)
                }
                _ => Some(RiskCurve::OccupantMais3),
            },
        }
    }

    /// The risk by the curve that applies; `None`: not computed, as none does.
    pub fn injury_risk(&self) -> Option<InjuryRisk> {
        let curve = self.curve?;
        let exponent = match curve {
            RiskCurve::OccupantMais3 => {
                let side = match self.ego_side {
                    Side::Front => 0.0,
                    Side::Left | Side::Right => 0.244,
                    Side::Rear => -0.431,
                };
                4.457 - 0.177 * self.ego_delta_v_mps - side
            }
            RiskCurve::PedestrianFatality => 6.9 - 0.090 * 3.6 * self.ego_speed_mps,
        };
        Some(InjuryRisk {
            curve,
            probability: 1.0 / (1.0 + libm::exp(exponent)),
        })
    }

    /// Whether somebody ran into the ego's rear.
    pub fn is_struck_from_behind(&self) -> bool {
        self.kind == CrashKind::RearEnd && self.ego_side == Side::Rear
    }
}

impl Display for Impact {
    /// Kind, sides, overlap, speeds and Δv in one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (own, its) = (self.ego_side.word(), self.other_side.word());
        write!(f, "{}: the ego's {own} against ", self.kind.word())?;
        match self.kind {
            CrashKind::Pedestrian => write!(f, "a pedestrian")?,
            _ => write!(f, "the other's {its}")?,
        }
        if let Some(overlap) = self.overlap {
            write!(f, ", overlap {:.0} %", 100.0 * overlap)?;
        }
        let (ego, other) = (self.ego_speed_mps, self.other_speed_mps);
        write!(f, ", ego {ego:.1} m/s, other {other:.1} m/s, ")?;
        write!(f, "Δv of the ego {:.1} m/s", self.ego_delta_v_mps)
    }
}

/// By the sides that touch, and by how much one is turned from the other.
fn kind_of(ego: Side, other: Side, turned_rad: f64) -> CrashKind {
    let turned_rad = turned_rad.abs();
    let aligned = !(FRAC_PI_4..=OPPOSED_RAD).contains(&turned_rad);
    match (ego, other) {
        (Side::Front, Side::Rear) | (Side::Rear, Side::Front | Side::Rear) => CrashKind::RearEnd,
        (Side::Front, Side::Front) if OPPOSED_RAD < turned_rad => CrashKind::HeadOn,
        (ego, other) if ego.is_flank() && other.is_flank() && aligned => CrashKind::SideSwipe,
        _ => CrashKind::Crossing,
    }
}

/// Share of the narrower width that two faces have in common, seen along the
/// ego's heading.
fn overlap((ego, ego_side): (&Party<'_>, Side), (other, other_side): (&Party<'_>, Side)) -> f64 {
    let (own_m, own_half_m) = ego.face(ego_side, ego);
    let (its_m, its_half_m) = other.face(other_side, ego);
    let common_m =
        (own_m + own_half_m).min(its_m + its_half_m) - (own_m - own_half_m).max(its_m - its_half_m);
    (common_m / ego.body.width_m.min(other.body.width_m)).clamp(0.0, 1.0)
}

/// The same angle in −π to π.
fn wrapped(angle_rad: f64) -> f64 {
    libm::remainder(angle_rad, TAU)
}
