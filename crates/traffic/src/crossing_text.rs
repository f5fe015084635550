//! Text of a world in which a recorded path crosses that of the ego.

use crate::plan::{PIECE_S, rounded};
use crate::situation_plan::{SituationPlan, SituationRoad};
use crate::stock_body::StockBody;
use crate::world_text::{OtherTexts, agent_head, file_name, plain, road_entry, script_steps};

/// Width of the ego's lane in metres.
const EGO_LANE_M: f64 = 3.5;
/// Reaction time and deceleration of a careful driver, who can stop for the ado.
const CAREFUL: (f64, f64) = (0.75, 5.0);

/// Deviations of a kind of road user from its recording.
struct StrayLimit {
    /// Least and greatest acceleration in m/s².
    accel_mps2: f64,
    /// Distance along the path in metres.
    along_m: f64,
}

/// Returns the world of a crossing, empty for another situation.
pub(crate) fn crossing_text(name: &str, plan: &SituationPlan) -> String {
    let SituationRoad::Crossing(roads) = &plan.road else {
        return String::new();
    };
    let origin = roads.ego.course.start();
    let others = OtherTexts::of(&plan.others, origin);
    // A margin of 0.2 m on both sides leaves the body inside its lane.
    let own = road_entry("path", &roads.other, plan.body.width_m + 0.4, origin);
    // The entries of the other road users are in a field of their own.
    let more = others
        .roads
        .trim_start_matches("    roads: {\n")
        .trim_end_matches("    },\n");
    let surface = format!("lanes: 1, lane_width_m: {EGO_LANE_M:?}, friction: 0.9");
    let road = if roads.ego.is_straight() {
        format!("Straight({surface})")
    } else {
        format!("Curved({surface}, pieces: {})", roads.ego.to_ron())
    };
    let angle_deg = roads.angle_rad.to_degrees();
    let horizon_s = plan.speed.to_mps.len() as f64 * PIECE_S;
    format!(
        r#"// {source}, at {time_s:.2} s: {planned} crosses the path of the ego, which replaces {replaced}.
// They passed {pet_s:.2} s after one another, at {angle_deg:.0}°. The plan is fitted to positions: it stays
// within {worst_m:.3} m of the recording along its path and {across_m:.2} m across, and accelerates by at
// most {hardest_mps2:.1} m/s². The ego's path is within {ego_m:.2} m of the recorded one.
Scenario(
    name: "{name}",
    question: "Does the ego avoid a contact with recorded crossing traffic that may stray from its recording?",
    source: "{source}",
    clock: (horizon_s: {horizon_s:?}, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    plant: Kinematic,
    judge: UntilContact,
    counts: Contact(closing_mps: 0.5),
    road: {road},
    roads: {{
{own}{more}    }},
    agents: [
        Vehicle(
            name: "ego", body: "sedan", lane_keeping: RearAxle,
            start: At(x_m: {ego_x:?}, speed_mps: {ego_mps:?}),
            drive: Ego(Idm(
                desired_speed_mps: {desired_mps:?}, time_gap_s: 1.2, min_gap_m: 2.0,
                max_accel_mps2: 1.5, comfort_brake_mps2: 2.5, max_brake_mps2: 7.0,
                lag_s: 0.3,
            )),
        ),
{ado}{agents}    ],
    ego_spec: "always (ego.ado.gap >= 0.01)",
)
"#,
        source = file_name(&plan.source),
        time_s = plan.time_s,
        planned = plain(&plan.planned),
        replaced = plain(&plan.replaced),
        pet_s = roads.pet_s,
        worst_m = plan.speed.worst_m,
        across_m = roads.across_m,
        hardest_mps2 = plan.speed.hardest_mps2(),
        ego_m = roads.ego.worst_m,
        ego_x = rounded(roads.ego_s_m),
        ego_mps = plan.ego_mps,
        desired_mps = rounded(roads.desired_mps),
        ado = ado(plan, roads.other_s_m, &rules(plan)),
        agents = others.agents,
    )
}

/// Returns how far a road user may stray: less on foot than in a car.
fn stray(plan: &SituationPlan) -> StrayLimit {
    match plan.body.name {
        "pedestrian" => StrayLimit {
            accel_mps2: 0.5,
            along_m: 3.0,
        },
        "bicyclist" => StrayLimit {
            accel_mps2: 0.5,
            along_m: 6.0,
        },
        _ => StrayLimit {
            accel_mps2: 1.0,
            along_m: 10.0,
        },
    }
}

fn ado(plan: &SituationPlan, s_m: f64, rules: &[(&str, String)]) -> String {
    let rules = rules.iter().map(|(name, stl)| {
        format!("                    Rule(name: \"{name}\", stl: \"{stl}\"),\n")
    });
    let accel = stray(plan).accel_mps2;
    format!(
        r#"        {head}
            start: At(x_m: {s_m:?}, speed_mps: {speed_mps:?}),
            drive: Ado(
                base: Script([
{script}                ]),
                actions: Deviate(accelerations: [-{accel:?}, 0.0, {accel:?}], lateral_mps: [0.0]), neutral: 1,
                observe: [
                    "ego.ado.conflict", "ado.ego.conflict", "ego.speed", "ado.speed", "ego.accel", "time_left",
                ],
                rulebook: [
{rules}                ],
            ),
        ),
"#,
        head = agent_head("ado", plan.body.name, "path", plan.body.is_on_foot()),
        s_m = rounded(s_m),
        speed_mps = plan.speed.start_mps,
        script = script_steps(&plan.speed, "                    "),
        rules = rules.collect::<String>(),
    )
}

fn rules(plan: &SituationPlan) -> Vec<(&'static str, String)> {
    let SituationRoad::Crossing(roads) = &plan.road else {
        return Vec::new();
    };
    // Distances at which each reaches the strip of the other, rounded to centimetres.
    let cm = |value: f64| (100.0 * value).ceil() / 100.0;
    let edge_m = cm(roads.reach_m(plan.body, StockBody::EGO));
    let ego_edge_m = cm(roads.reach_m(StockBody::EGO, plan.body));
    let ego_past_m = cm(ego_edge_m + StockBody::EGO.length_m);
    let past_m = cm(edge_m + plan.body.length_m);
    let (react_s, brake_mps2) = CAREFUL;
    // Half of the recorded speed on the crossing.
    let least_mps = (50.0 * roads.least_mps).floor() / 100.0;
    let mut rules = vec![
        (
            "stays near its recording",
            format!(
                "always (ado.s - ado.planned.s in [-{0:?}, {0:?}])",
                stray(plan).along_m
            ),
        ),
        (
            "enters where a careful driver could stop",
            format!(
                "always (rise(ado.ego.conflict <= {edge_m:?}) and ego.ado.conflict >= -{ego_past_m:?} implies \
                 ego.ado.conflict - {ego_edge_m:?} > {react_s:?} * ego.speed + ego.speed * ego.speed / (2 * {brake_mps2:?}))"
            ),
        ),
    ];
    // A recording that stands on the crossing would break the rule by itself.
    if least_mps > 0.0 {
        rules.push((
            "does not stop on the crossing",
            format!("always (ado.ego.conflict in [-{past_m:?}, {edge_m:?}] implies ado.speed >= {least_mps:?})"),
        ));
    }
    rules.push(("never reverses", "always (ado.speed >= -0.1)".to_owned()));
    rules
}
