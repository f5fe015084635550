//! Colours: one family per role, so that roles are recognizable at a glance.

use crate::ego::Phase;
use crate::scene::Role;

/// Red, green and blue.
pub(super) type Rgb = [u8; 3];

/// Asphalt.
pub(super) const ROAD: Rgb = [58, 62, 70];
/// The ground beside the road.
pub(super) const GROUND: Rgb = [26, 30, 34];
/// Lane markings.
pub(super) const MARKING: Rgb = [225, 225, 220];
/// Marks along the road's edge.
pub(super) const POST: Rgb = [120, 128, 138];
/// Glass.
pub(super) const GLASS: Rgb = [24, 30, 40];
/// Tyres.
pub(super) const TYRE: Rgb = [14, 14, 16];
/// Headlights.
pub(super) const HEADLIGHT: Rgb = [255, 244, 200];
/// Tail lights.
pub(super) const TAIL_LIGHT: Rgb = [200, 24, 24];
/// The zero line of a robustness plot.
pub(super) const ZERO: Rgb = [235, 235, 235];
/// Instant at which the verdict became certain.
pub(super) const DECIDED: Rgb = [255, 210, 60];
/// Agent that the ego does not see.
pub(super) const HIDDEN: Rgb = [214, 84, 214];
/// Contact.
pub(super) const CONTACT: Rgb = [255, 64, 92];

/// Action without an effect, which also is that of no action.
pub(super) const IDLE: Rgb = [96, 104, 116];
/// Action that brakes, or makes the weather worse.
pub(super) const BRAKING: Rgb = [204, 62, 50];
/// Action that accelerates, or makes the weather better.
pub(super) const ACCELERATING: Rgb = [52, 152, 86];
/// Action that moves to the left only.
pub(super) const LEFTWARD: Rgb = [62, 124, 214];
/// Action that moves to the right only.
pub(super) const RIGHTWARD: Rgb = [144, 88, 204];

const EGO: [Rgb; 1] = [[74, 158, 255]];
const ADO: [Rgb; 4] = [
    [255, 112, 67],
    [255, 170, 60],
    [240, 98, 146],
    [205, 120, 70],
];
const SCRIPTED: [Rgb; 3] = [[170, 178, 190], [140, 150, 165], [196, 202, 210]];
const NEUTRAL: [Rgb; 6] = [
    [126, 211, 133],
    [190, 147, 255],
    [96, 214, 214],
    [230, 150, 200],
    [170, 186, 92],
    [150, 176, 214],
];
const RULES: [Rgb; 6] = [
    [70, 170, 90],
    [150, 110, 230],
    [40, 160, 170],
    [200, 100, 170],
    [140, 130, 60],
    [176, 140, 120],
];

/// Colour of the `nth` agent in a role.
pub(super) fn of_role(role: Role, nth: usize) -> Rgb {
    match role {
        Role::Ego => EGO[nth % EGO.len()],
        Role::Ado => ADO[nth % ADO.len()],
        Role::Scripted => SCRIPTED[nth % SCRIPTED.len()],
    }
}

/// Colour of the `nth` curve without an owner.
pub(super) fn neutral(nth: usize) -> Rgb {
    NEUTRAL[nth % NEUTRAL.len()]
}

/// Colour of the robustness of the `nth` rule.
pub(super) fn of_rule(nth: usize) -> Rgb {
    RULES[nth % RULES.len()]
}

/// Colour of a light.
pub(super) fn of_phase(phase: Phase) -> Rgb {
    match phase {
        Phase::Green => [40, 214, 110],
        Phase::Yellow => [255, 200, 40],
        Phase::Red => [255, 52, 52],
    }
}

/// Mixes a colour with white by the share `by`.
pub(super) fn brightened(colour: Rgb, by: f32) -> Rgb {
    mixed(colour, [255; 3], by)
}

/// Mixes a colour with the share `by` of another one.
pub(super) fn mixed(colour: Rgb, other: Rgb, by: f32) -> Rgb {
    std::array::from_fn(|i| {
        (f32::from(colour[i]) * (1.0 - by) + f32::from(other[i]) * by).round() as u8
    })
}

/// Mixes a colour with black and keeps the share `keep`.
pub(super) fn dimmed(colour: Rgb, keep: f32) -> Rgb {
    colour.map(|channel| (f32::from(channel) * keep) as u8)
}
