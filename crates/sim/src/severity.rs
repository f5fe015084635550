//! Severity of a contact for the ego: kind, speeds, Δv and injury risk.
//!
//! The functions are pure and read two bodies' states at the instant of the
//! contact. The contact normal gives the side of each body that is touched, and
//! the masses give the change of either velocity:
//!
//! Δv_ego = m_other / (m_ego + m_other) · (1 + e) · closing speed, with e = 0.
//!
//! That is the plastic, central impact along the normal, without friction or
//! rotation. Crashes above walking pace have e ≈ 0 … 0.2, so Δv is
//! underestimated rather than overestimated.
//!
//! Risks come from published curves only ([`RiskCurve`]). If no curve applies,
//! no risk is reported. `docs/reference/crash-labels.md` explains the terms to users.
//!
//! ```
//! use brakecheck_sim::severity::Party;
//! use brakecheck_sim::severity::{CrashKind, Impact};
//! use brakecheck_sim::sim::{Body, BodyState, Pose};
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
//! Architecture Invariant: knows bodies, but no scene, no rule and no role
//! except "ego" and "other".

use core::f64::consts::FRAC_PI_4;
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};
use strum::IntoStaticStr;

use crate::sim::{Body, BodyState, wrapped};

/// Mass range of the cars behind the published curves, in kilograms.
const LIGHT_KG: std::ops::RangeInclusive<f64> = 500.0..=4000.0;
/// Turn of 135°, beyond which two headings are opposed.
const OPPOSED_RAD: f64 = 3.0 * FRAC_PI_4;

/// Geometry of a collision between two bodies.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[strum(serialize_all = "kebab-case")]
pub enum CrashKind {
    /// Front of one body against the rear of the other.
    RearEnd,
    /// Front against front, with headings opposed by more than 135°.
    HeadOn,
    /// Flank along flank, in either direction of travel.
    SideSwipe,
    /// Contact at an angle, most often a front against a flank.
    Crossing,
    /// Contact with a pedestrian.
    Pedestrian,
}

impl CrashKind {
    /// Returns the word used in tables.
    pub fn word(self) -> &'static str {
        self.into()
    }
}

/// Side of a body out of which the contact normal points.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, IntoStaticStr,
)]
#[strum(serialize_all = "lowercase")]
pub enum Side {
    /// Front, within 45° of the heading.
    Front,
    /// Left flank.
    Left,
    /// Right flank.
    Right,
    /// Rear, within 45° of the direction opposite to the heading.
    Rear,
}

impl Side {
    /// Returns the side out of which a direction points.
    ///
    /// `direction_rad` is relative to the body's heading.
    fn towards(direction_rad: f64) -> Side {
        match direction_rad.abs() {
            off if off < FRAC_PI_4 => Side::Front,
            off if off > OPPOSED_RAD => Side::Rear,
            _ if direction_rad > 0.0 => Side::Left,
            _ => Side::Right,
        }
    }

    fn is_flank(self) -> bool {
        matches!(self, Side::Left | Side::Right)
    }

    /// Returns the word used in tables.
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
    /// Risk that an occupant of the ego is seriously injured (MAIS 3+).
    ///
    /// It depends on the ego's Δv and on the side that is hit:
    ///
    /// P = 1 / (1 + exp(4.457 − 0.177 Δv − side)), Δv in m/s, side 0 for the
    /// front, 0.244 for a flank, −0.431 for the rear.
    ///
    /// Source: the logistic regression over four symmetric areas of Geisslinger,
    /// Poszler and Lienkamp, "An ethical trajectory planning algorithm for
    /// autonomous vehicles", Nature Machine Intelligence 5 (2023) 137–144. The
    /// coefficients are from its code (TUMFTM/EthicalTrajectoryPlanning,
    /// `harm_parameters.json`, `reduced_sym_angle_areas`). The curve is fitted to
    /// reported crashes and gives 1 % at Δv 0, so compare differences and do not
    /// read small values as absolute.
    OccupantMais3,
    /// Risk that an adult pedestrian hit by the ego's front dies.
    ///
    /// It depends on the ego's speed:
    ///
    /// P = 1 / (1 + exp(6.9 − 0.090 v)), v in km/h.
    ///
    /// Source: Rosén and Sander, "Pedestrian fatality risk as a function of car
    /// impact speed", Accident Analysis and Prevention 41 (2009) 536–542.
    PedestrianFatality,
}

impl RiskCurve {
    /// Returns the injury whose probability the curve gives, in words.
    pub fn about(self) -> &'static str {
        match self {
            RiskCurve::OccupantMais3 => "MAIS 3+ of the ego's occupants",
            RiskCurve::PedestrianFatality => "death of the pedestrian",
        }
    }
}

/// Probability of an injury and the curve behind it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InjuryRisk {
    /// Curve that gives the probability.
    pub curve: RiskCurve,
    /// Probability, 0 to 1.
    pub probability: f64,
}

impl Display for InjuryRisk {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.probability;
        write!(f, "{percent:.1} % ({})", self.curve.about())
    }
}

/// One of two touching bodies.
#[derive(Clone, Copy, Debug)]
pub struct Party<'a> {
    /// Size and mass of the body.
    pub body: &'a Body,
    /// State at the instant of the contact.
    pub state: BodyState,
}

impl Party<'_> {
    /// Returns the speed over ground of the front bumper.
    fn speed_mps(&self) -> f64 {
        let (ahead, left) = (self.state.speed_mps, self.state.lateral_mps);
        (ahead * ahead + left * left).sqrt()
    }

    fn is_light_vehicle(&self) -> bool {
        !self.body.is_on_foot() && LIGHT_KG.contains(&self.body.mass_kg)
    }

    /// Returns the lateral position and half width of a front or rear face.
    ///
    /// Both are measured to the left in the frame of `frame`'s heading and position.
    fn face(&self, side: Side, frame: &Party<'_>) -> (f64, f64) {
        // Poses are of the front bumper, so only the rear face lies a length behind.
        let back_m = if side == Side::Rear {
            self.body.length_m
        } else {
            0.0
        };
        let face = self.state.pose.ahead(-back_m).frame();
        let frame = frame.state.pose.frame();
        // Cosine of the relative heading: the face's width projected across the frame.
        let turned = face.ahead().dot(&frame.ahead());
        let left_m = frame.to_local(face.origin_m).y;
        (left_m, 0.5 * self.body.width_m * turned.abs())
    }
}

/// Effect of a contact on the ego.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Impact {
    /// Geometry of the collision.
    pub kind: CrashKind,
    /// Side of the ego that is touched.
    pub ego_side: Side,
    /// Side of the other body that is touched.
    pub other_side: Side,
    /// Overlap of fronts and rears, 0 to 1.
    ///
    /// Share of the narrower width in common, measured across the ego's heading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap: Option<f64>,
    /// Speed over ground of the ego's front bumper.
    pub ego_speed_mps: f64,
    /// Speed over ground of the other body's front bumper.
    pub other_speed_mps: f64,
    /// Heading relative to the ego's, counter-clockwise, in −π to π.
    pub turned_rad: f64,
    /// Change of the ego's velocity.
    pub ego_delta_v_mps: f64,
    /// Change of the other body's velocity.
    pub other_delta_v_mps: f64,
    /// Applicable risk curve, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<RiskCurve>,
}

/// Speed up to which the ego counts as stationary and not at fault.
pub(crate) const STANDING_MPS: f64 = 0.5;

impl Impact {
    /// Returns true if the contact can be attributed to the ego.
    ///
    /// The ego must move and must not be struck from behind.
    pub fn concerns_ego(&self) -> bool {
        !self.is_ego_at_rest() && self.ego_side != Side::Rear
    }

    /// Returns true if the ego stands at the contact, at 0.5 m/s or less.
    pub fn is_ego_at_rest(&self) -> bool {
        self.ego_speed_mps <= STANDING_MPS
    }

    /// Computes the effect of a contact on `ego`.
    ///
    /// `normal` is the contact normal from the ego to the other body, a unit vector
    /// in the world frame. `closing_speed_mps` is the approach speed along it.
    #[doc(hidden)]
    pub fn of(
        ego: Party<'_>,
        other: Party<'_>,
        normal: [f64; 2],
        closing_speed_mps: f64,
    ) -> Impact {
        let (own, its) = (ego.state.pose.heading_rad, other.state.pose.heading_rad);
        let out_rad = libm::atan2(normal[1], normal[0]);
        let ego_side = Side::towards(wrapped(out_rad - own));
        // The same normal points into the other body, so its direction is reversed.
        let other_side = Side::towards(wrapped(libm::atan2(-normal[1], -normal[0]) - its));
        let turned_rad = wrapped(its - own);
        let kind = if other.body.is_on_foot() {
            CrashKind::Pedestrian
        } else {
            kind_of(ego_side, other_side, turned_rad)
        };
        let (ego_kg, other_kg) = (ego.body.mass_kg, other.body.mass_kg);
        // An overlap across the heading has no meaning for flanks and pedestrians.
        let lengthwise = matches!(kind, CrashKind::RearEnd | CrashKind::HeadOn);
        Impact {
            kind,
            ego_side,
            other_side,
            overlap: lengthwise.then(|| overlap(&ego, ego_side, &other, other_side)),
            ego_speed_mps: ego.speed_mps(),
            other_speed_mps: other.speed_mps(),
            turned_rad,
            // Conservation of momentum in a plastic impact: each body takes the share of
            // the closing speed that the other body's mass imposes.
            ego_delta_v_mps: other_kg / (ego_kg + other_kg) * closing_speed_mps,
            other_delta_v_mps: ego_kg / (ego_kg + other_kg) * closing_speed_mps,
            curve: match kind {
                // The curves were fitted to light vehicles and do not apply to a truck or a
                // motorcycle as the ego.
                _ if !ego.is_light_vehicle() => None,
                CrashKind::Pedestrian => {
                    (ego_side == Side::Front).then_some(RiskCurve::PedestrianFatality)
                }
                _ => Some(RiskCurve::OccupantMais3),
            },
        }
    }

    /// Returns the risk by the applicable curve, `None` if no curve applies.
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
            // The published coefficient is per km/h.
            RiskCurve::PedestrianFatality => 6.9 - 0.090 * 3.6 * self.ego_speed_mps,
        };
        Some(InjuryRisk {
            curve,
            probability: 1.0 / (1.0 + libm::exp(exponent)),
        })
    }

    /// Returns true if another body ran into the ego's rear.
    pub fn is_struck_from_behind(&self) -> bool {
        self.kind == CrashKind::RearEnd && self.ego_side == Side::Rear
    }
}

impl Display for Impact {
    /// Formats kind, sides, overlap, speeds and Δv in one line.
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

/// Returns the kind by the touching sides and the relative heading.
fn kind_of(ego: Side, other: Side, turned_rad: f64) -> CrashKind {
    let turned_rad = turned_rad.abs();
    // Flanks count as side-swipe in either direction, so only crossing headings
    // are excluded.
    let aligned = !(FRAC_PI_4..=OPPOSED_RAD).contains(&turned_rad);
    match (ego, other) {
        (Side::Front, Side::Rear) | (Side::Rear, Side::Front | Side::Rear) => CrashKind::RearEnd,
        (Side::Front, Side::Front) if turned_rad > OPPOSED_RAD => CrashKind::HeadOn,
        (ego, other) if ego.is_flank() && other.is_flank() && aligned => CrashKind::SideSwipe,
        _ => CrashKind::Crossing,
    }
}

/// Returns the share of the narrower width that two faces have in common.
///
/// The faces are seen along the ego's heading.
fn overlap(ego: &Party<'_>, ego_side: Side, other: &Party<'_>, other_side: Side) -> f64 {
    let (own_m, own_half_m) = ego.face(ego_side, ego);
    let (its_m, its_half_m) = other.face(other_side, ego);
    let common_m =
        (own_m + own_half_m).min(its_m + its_half_m) - (own_m - own_half_m).max(its_m - its_half_m);
    // The faces of a corner contact may not overlap at all, which gives a
    // negative share.
    (common_m / ego.body.width_m.min(other.body.width_m)).clamp(0.0, 1.0)
}
