//! Kept counterexamples as traces of the Open Simulation Interface.

use brakecheck_traffic::{Class, OsiAxles, OsiBody, OsiFrame, OsiState, OsiTrace, write_osi};

use crate::openx::vehicle_category;
use crate::scene::drive::{Agent, Drive, DriveWorld};
use crate::scene::{BodySample, Placement};
use crate::sim::{Body, BodyKind, PlantKind};
use crate::testbench::{Episode, Film, film_beyond};
use crate::world::Scenario;

/// Returns an episode up to its contact as an OSI trace in MCAP.
///
/// `scenario` repeats the episode bit for bit. `road` is its road as OpenDRIVE, with its
/// name. `None` for a grid world.
pub(super) fn osi_trace(
    scenario: &Scenario,
    episode: &Episode,
    road: (String, String),
) -> Option<Vec<u8>> {
    let drive = scenario.drive()?;
    let agents = &drive.spec().agents;
    let mut bench = scenario.bench();
    bench.record_motion();
    let Film { frames, .. } = film_beyond(&mut bench, episode);
    let motion = bench.motion()?;
    let sample_s = bench.clock().sample_s;
    // The motion ends at the instant of contact, which lies between two samples.
    let contact_s = motion
        .contact
        .as_ref()
        .map_or(f64::INFINITY, |it| it.time_s);
    let mut instants: Vec<OsiFrame> = Vec::with_capacity(frames.len());
    for (sample, frame) in frames.iter().enumerate().take(motion.len()) {
        let time_s = (sample as f64 * sample_s).min(contact_s);
        let time_ns = (time_s * 1e9).round() as u64;
        // A contact right after a sample replaces that sample.
        if instants.last().is_some_and(|last| time_ns <= last.time_ns) {
            instants.pop();
        }
        let bodies = motion.at(sample).iter();
        let states = agents.iter().zip(bodies.zip(&frame.placements));
        instants.push(OsiFrame {
            time_ns,
            states: states
                .map(|(agent, (body, placement))| state(drive.world(), agent, body, placement))
                .collect(),
        });
    }
    let is_ego = |agent: &Agent| matches!(agent.drive, Drive::Ego);
    Some(write_osi(&OsiTrace {
        description: format!(
            "counterexample of brakecheck in the world {}",
            scenario.name()
        ),
        bodies: agents.iter().map(|agent| body(&agent.body)).collect(),
        ego: agents.iter().position(is_ego)?,
        frames: instants,
        open_drive: Some(road),
    }))
}

/// Returns the body with the class that players know.
fn body(body: &Body) -> OsiBody {
    let class = match vehicle_category(body) {
        None => Class::Pedestrian,
        Some("bicycle") => Class::Bicycle,
        Some("motorbike") => Class::Motorcycle,
        Some("van") => Class::Van,
        Some("truck") => Class::Truck,
        Some(_) => Class::Car,
    };
    let wheels = match &body.kind {
        BodyKind::Vehicle(vehicle) => Some((vehicle.wheelbase_m, vehicle.wheel_radius_m)),
        BodyKind::Cyclist(cyclist) => Some((cyclist.wheelbase_m, cyclist.wheel_radius_m)),
        BodyKind::Walker(_) => None,
    };
    let axles = wheels.map(|(wheelbase_m, wheel_radius_m)| {
        // The lever reaches from the front bumper to the rear axle, and OSI counts from
        // the centre.
        let rear_m = body.half_length_m() - body.lever_m();
        OsiAxles {
            rear_m,
            front_m: rear_m + wheelbase_m,
            height_m: wheel_radius_m,
        }
    });
    OsiBody {
        class,
        size_m: [body.length_m, body.width_m, body.height_m],
        axles,
    }
}

/// Returns the state of the centre, while the plant states that of the front bumper.
fn state(
    world: &DriveWorld,
    agent: &Agent,
    sample: &BodySample,
    placement: &Placement,
) -> OsiState {
    let (body, state) = (&agent.body, sample.state);
    let yaw_rad = placement.heading_rad();
    let (sin, cos) = libm::sincos(yaw_rad);
    let turned = |ahead: f64, left: f64| [ahead * cos - left * sin, ahead * sin + left * cos, 0.0];
    let (pitch_rad, roll_rad) = placement.pitch_roll_rad();
    // Turning moves the front sideways, and not the centre.
    let left_mps = state.lateral_mps - state.yaw_rate_rad_per_s * body.half_length_m();
    let mut osi = OsiState {
        centre_m: placement.centre_m,
        roll_pitch_yaw_rad: [roll_rad, pitch_rad, yaw_rad],
        velocity_mps: turned(state.speed_mps, left_mps),
        accel_mps2: turned(state.accel_mps2, 0.0),
        yaw_rate_rad_per_s: state.yaw_rate_rad_per_s,
    };
    // The rigid plant drives on the surface, so its bodies are there already.
    if world.spec().plant == PlantKind::Kinematic {
        let lift = world.attitude_on(agent.road, &state.pose);
        osi.centre_m[2] += lift.z_m;
        osi.roll_pitch_yaw_rad[0] += lift.roll_rad;
        osi.roll_pitch_yaw_rad[1] += lift.pitch_rad;
    }
    osi
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testbench::{Aftermath, Constant, play};

    #[test]
    fn bodies_of_both_plants_are_on_a_road_that_climbs() {
        let climbing = "grades: [(0.0, 0.05)], agents: [";
        let text = include_str!("../../../../worlds/acc.ron").replacen("agents: [", climbing, 1);
        let rigid = Scenario::parse("acc.ron", &text).expect("sound");
        for scenario in [rigid.on(PlantKind::Kinematic), rigid] {
            let drive = scenario.drive().expect("a road");
            let mut bench = scenario.bench();
            let axes = scenario.axes();
            let middle = axes.iter().map(|it| 0.5 * (it.lo + it.hi));
            let start = crate::scene::Start(middle.collect());
            play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Skip);
            let (bodies, frame) = (bench.bodies(), bench.frame());
            for ((agent, body), placement) in drive
                .spec()
                .agents
                .iter()
                .zip(&bodies)
                .zip(&frame.placements)
            {
                let [x_m, _, z_m] = state(drive.world(), agent, body, placement).centre_m;
                let above_m = z_m - 0.05 * x_m - 0.5 * agent.body.height_m;
                assert!(x_m > 20.0 && above_m.abs() < 0.15, "{x_m}: {above_m}");
            }
        }
    }
}
