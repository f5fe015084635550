//! Estimates and bounds against exact probabilities of worlds that fail in two ways.
//!
//! The ego comes too near if the lead car brakes for long, and the specification also forbids
//! a manoeuvre in three phases: braking, accelerating, braking, a second each.

use super::tests::{ExactRisk, estimated, exact, settings};
use super::{EgoRisk, RiskReport, RiskSettings, RiskTraffic};
use crate::experiment::EgoUnderTest;
use crate::sim::PlantKind;
use crate::world::Scenario;

/// Decisions of a run in the enumeration, which has a single start.
const DECISIONS: u32 = 8;
/// Probabilities of turning from a phase to its opposite: modes of equal and unequal size.
pub(super) const TURNS: [f64; 2] = [0.3, 0.1];

/// Following for four seconds from one start: 6561 sequences of actions.
pub(super) fn world() -> Scenario {
    let manoeuvre = "not eventually[0, T] (always[0, 0.8] (ado.accel <= -2) and \
                     eventually[0, T] (always[0, 0.8] (ado.accel >= 2) and \
                     eventually[0, T] always[0, 0.8] (ado.accel <= -2)))";
    let text = include_str!("../../../../worlds/acc.ron")
        .replace("horizon_s: 15.0", "horizon_s: 4.0")
        .replace(
            "At(x_m: 0.0, speed_mps: (5.0, 25.0))",
            "At(x_m: 0.0, speed_mps: 25.0)",
        )
        .replace(
            "headway_m: (8.0, 60.0), speed_mps: (5.0, 25.0)",
            "headway_m: 33.0, speed_mps: 12.0",
        )
        .replace(
            "always[0, T] (headway >= d_safe)",
            &format!("(always[0, T] (headway >= d_safe)) and {manoeuvre}"),
        );
    let world = Scenario::parse("acc.ron", &text).expect("sound");
    world.on(PlantKind::Kinematic)
}

/// Traffic in which the lead car rarely leaves its speed.
pub(super) fn traffic(world: &Scenario, turn: f64) -> RiskTraffic {
    let rest = 0.4 - turn;
    let text = format!(
        "Traffic(source: \"two modes\", starts: {{}}, ados: {{ \"ado\": Markov(transitions: [\
         [0.6, {rest}, {turn}], [0.0001, 0.9998, 0.0001], [{turn}, {rest}, 0.6]]) }})"
    );
    RiskTraffic::parse(world, "two_modes.ron", &text).expect("sound")
}

pub(super) fn exact_of(world: &Scenario, traffic: &RiskTraffic) -> ExactRisk {
    exact(world, traffic, 1, DECISIONS)
}

/// Returns whether a kind is the manoeuvre, of which only the leaf tells.
pub(super) fn is_manoeuvre(kind: &str) -> bool {
    kind.contains("ado.accel")
}

/// Returns whether the bounds of an estimate hold, for every reading that was enumerated.
pub(super) fn holds(ego: &EgoRisk, exact: &ExactRisk) -> bool {
    let limits = ego.limits.expect("weighted");
    let pairs = [
        (limits.fails, exact.fails),
        (limits.fails_lawful, exact.lawful),
    ];
    pairs
        .iter()
        .all(|([least, most], truth)| least <= truth && truth <= most)
}

/// Returns whether the interval of an estimate contains the truth. `None`: it was refused.
pub(super) fn covers(ego: &EgoRisk, exact: &ExactRisk) -> Option<bool> {
    let [lo, hi] = ego.readings.fails?.interval;
    Some((lo..=hi).contains(&exact.fails))
}

fn estimate(world: &Scenario, traffic: &RiskTraffic, seed: u64) -> RiskReport {
    let settings = RiskSettings {
        budget: 8_000,
        natural: 1000,
        width: 0.25,
        ..settings(seed)
    };
    let egos = [EgoUnderTest::nominal(world)];
    estimated(traffic, &egos, settings)
}

#[test]
fn a_second_mode_in_three_phases_is_found_and_named() {
    let world = world();
    for (seed, turn) in TURNS.into_iter().enumerate() {
        let traffic = traffic(&world, turn);
        let exact = exact_of(&world, &traffic);
        let own = exact.kinds.iter().filter(|it| is_manoeuvre(it.0));
        let share = own.map(|it| it.1).sum::<f64>() / exact.fails;
        // Checked by enumeration, or a changed world would test other sizes unseen.
        let sizes = [0.4..0.6, 0.02..0.1];
        assert!(sizes[seed].contains(&share), "{share} of {exact:?}");
        let report = estimate(&world, &traffic, seed as u64);
        let ego = &report.egos[0];
        assert!(report.cost.searching > 500, "{:?}", report.cost);
        assert!(holds(ego, &exact), "{:?} of {exact:?}", ego.limits);
        let fails = ego.readings.fails.expect("a result");
        let off = (fails.probability / exact.fails - 1.0).abs();
        // Four standard errors, and a missed mode would be half of the risk.
        assert!(off < 0.1, "{report} of {exact:?}");
        assert!(
            ego.modes.iter().any(|it| is_manoeuvre(&it.mode)),
            "{report}"
        );
        // The pair is said first, and the interval after it with its kinds.
        let said = report.verdict();
        assert!(said[0].contains("at least") && said[1].starts_with("if the kinds"));
    }
}
