//! World files from recorded situations.

use std::fmt::Write;

use crate::analysis::Analysis;
use crate::path::Path;
use crate::plan::{PIECE_S, SpeedPlan};
use crate::recording::{Class, RoadUserTrack};
use crate::situations::RecordedFollowing;

/// Width of the lane of a generated world in metres.
const LANE_WIDTH_M: f64 = 3.75;

/// World file of one recorded situation.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedWorld {
    /// Name of the world, also of its file without `.ron`.
    pub name: String,
    /// RON text of the world.
    pub text: String,
    /// Greatest distance of the plan from the recorded positions in metres.
    pub worst_m: f64,
    /// Greatest acceleration or deceleration of the plan in m/s².
    pub hardest_mps2: f64,
    /// Speed that the lead loses in the window, in m/s.
    pub slowing_mps: f64,
}

/// Returns the windows of 10 s as worlds, those with the greatest slowing first.
///
/// The ego takes the follower's place. The lead follows its recording and may stray by
/// ±1 m/s² within 20 m. Windows whose states are interpolated at the start are left out.
pub fn following_worlds(analysis: &Analysis, most: usize) -> Vec<RecordedWorld> {
    let mut windows: Vec<(f64, RecordedFollowing)> = analysis
        .situations
        .windows(&analysis.recording)
        .into_iter()
        .filter_map(|window| Some((slowing(analysis, &window)?, window)))
        .collect();
    windows.sort_by(|a, b| b.0.total_cmp(&a.0));
    let worlds = windows.iter().enumerate();
    let worlds = worlds.filter_map(|(i, (_, window))| following_world(analysis, window, i + 1));
    worlds.take(most).collect()
}

/// Returns the speed that the lead loses at most, `None` for interpolated starts.
fn slowing(analysis: &Analysis, window: &RecordedFollowing) -> Option<f64> {
    let lead = &analysis.recording.tracks[window.lead];
    let own = &analysis.recording.tracks[window.follower];
    let at = window.first_sample - lead.first_sample;
    if lead.filled[at] || own.filled[window.first_sample - own.first_sample] {
        return None;
    }
    let speeds = &lead.speed_mps[at..at + window.samples];
    let mut most = (0.0, f64::NEG_INFINITY);
    for speed in speeds {
        most.1 = f64::max(most.1, *speed);
        most.0 = f64::max(most.0, most.1 - speed);
    }
    Some(most.0)
}

fn following_world(
    analysis: &Analysis,
    window: &RecordedFollowing,
    number: usize,
) -> Option<RecordedWorld> {
    let recording = &analysis.recording;
    let (lead, own) = (
        &recording.tracks[window.lead],
        &recording.tracks[window.follower],
    );
    let (at, own_at) = (
        window.first_sample - lead.first_sample,
        window.first_sample - own.first_sample,
    );
    // One more sample, so that the last piece is whole.
    let samples = window.samples + 1;
    let plan = SpeedPlan::fit(&own_way(lead, at, samples)?, recording.dt_s)?;
    let own_plan = SpeedPlan::fit(&own_way(own, own_at, samples)?, recording.dt_s)?;
    let gap_m = analysis.leads.of[window.follower][own_at]?.gap_m + plan.start_m - own_plan.start_m;
    let name = format!("following_{number:03}");
    let text = following_text(&FollowingText {
        name: &name,
        source: &recording.name,
        follower: &own.id,
        lead: &lead.id,
        time_s: window.first_sample as f64 * recording.dt_s,
        lead_class: lead.class,
        lead_length_m: lead.length_m,
        gap_m,
        ego_mps: own_plan.start_mps,
        plan: &plan,
    });
    Some(RecordedWorld {
        name,
        text,
        worst_m: plan.worst_m,
        hardest_mps2: plan.hardest_mps2(),
        slowing_mps: slowing(analysis, window)?,
    })
}

/// Returns the positions of a road user along its own path.
///
/// Along the right lane's line, a vehicle of the left lane would gain or lose decimetres
/// in a bend. Returns `None` for a road user that hardly moves.
fn own_way(track: &RoadUserTrack, from: usize, samples: usize) -> Option<Vec<f64>> {
    let range = from..(from + samples).min(track.len());
    let points = || range.clone().map(|i| [track.x_m[i], track.y_m[i]]);
    // Half seconds apart, so that the noise of positions does not lengthen the path.
    let thinned = points().step_by(10).chain(points().next_back());
    let path = Path::through(thinned, 0.5)?;
    let mut piece = 0;
    let place = points().map(|point| {
        let place = path.place(point, piece);
        piece = place.piece;
        place.s_m
    });
    Some(place.collect())
}

/// Parts of the text of a following.
struct FollowingText<'a> {
    name: &'a str,
    source: &'a str,
    follower: &'a str,
    lead: &'a str,
    time_s: f64,
    lead_class: Class,
    lead_length_m: f64,
    gap_m: f64,
    ego_mps: f64,
    plan: &'a SpeedPlan,
}

/// Returns the name and the length of the stock body that is nearest.
fn body(class: Class, length_m: f64) -> (&'static str, f64) {
    match class {
        Class::Motorcycle => ("motorcycle", 2.10),
        Class::Van => ("van", 5.93),
        Class::Truck if length_m < 12.5 => ("truck", 9.20),
        Class::Truck => ("semitrailer", 16.50),
        _ => ("sedan", 4.54),
    }
}

fn following_text(it: &FollowingText<'_>) -> String {
    let (body, length_m) = body(it.lead_class, it.lead_length_m);
    // A text in a comment and in a string.
    let plain = |text: &str| text.replace(['"', '\\', '\n', '\r'], "_");
    let horizon_s = it.plan.to_mps.len() as f64 * PIECE_S;
    let mut text = format!(
        "// A recorded following, fitted to positions: the plan is within {:.3} m of the recording\n\
         // and accelerates by at most {:.1} m/s².\n\
         // Road user {} of the recording is the lead. The ego takes the place of {}.\n",
        it.plan.worst_m,
        it.plan.hardest_mps2(),
        plain(it.lead),
        plain(it.follower),
    );
    let _ = write!(
        text,
        r#"Scenario(
    name: "{name}",
    question: "Does the ego follow a recorded lead that may stray from its recording without a contact?",
    source: "{source}, at {time_s:.2} s",
    clock: (horizon_s: {horizon_s:?}, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    plant: Kinematic,
    judge: UntilContact,
    road: Straight(lanes: 1, lane_width_m: {LANE_WIDTH_M:?}, friction: 0.9),
    agents: [
        Vehicle(
            name: "ego", body: "sedan", lane: 0,
            start: At(x_m: 0.0, speed_mps: {ego_mps:?}),
            drive: Ego(Acc(
                kp_per_s2: 0.3, kd_per_s: 1.2,
                standstill_headway_m: 5.7, time_gap_s: 0.5,
                max_brake_mps2: 6.0, max_accel_mps2: 2.5,
                lag_s: 0.4,
            )),
        ),
        Vehicle(
            name: "lead", body: "{body}", lane: 0,
            start: Ahead(of: "ego", headway_m: {headway_m:?}, speed_mps: {lead_mps:?}),
            drive: Ado(
                base: Script([
{script}                ]),
                actions: Deviate(accelerations: [-1.0, 0.0, 1.0], lateral_mps: [0.0]), neutral: 1,
                rulebook: [
                    Rule(name: "stays near its recording", stl: "always (lead.s - lead.planned.s in [-20, 20])"),
                    Rule(name: "never reverses", stl: "always (lead.speed >= 0)"),
                ],
            ),
        ),
    ],
    ego_spec: "always (ego.lead.gap >= 0.01)",
)
"#,
        name = it.name,
        source = plain(it.source),
        time_s = it.time_s,
        ego_mps = it.ego_mps,
        headway_m = ((it.gap_m + length_m) * 1e6).round() / 1e6,
        lead_mps = it.plan.start_mps,
        script = it.plan.to_script("                    "),
    );
    text
}
