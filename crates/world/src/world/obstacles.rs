//! Obstacles of a world file: agents that stand on a road.

use core::f64::consts::PI;

use super::bodies;
use super::check;
use crate::road::Direction;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Agent, Drive, Range, Script, StartPlace};
use crate::world_file::{AgentFile, ScenarioFile};

/// Reads an obstacle and reports its mistakes.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    file: &ScenarioFile,
    entry: &AgentFile,
    number: usize,
) -> Option<Agent> {
    let AgentFile::Obstacle {
        name,
        body,
        s_m,
        lateral_m,
        heading_rad,
        ..
    } = entry
    else {
        return None;
    };
    check::range(problems, &path.to("s_m"), s_m.0);
    check::range(problems, &path.to("lateral_m"), lateral_m.0);
    check::within(problems, &path.to("heading_rad"), *heading_rad, -PI, PI);
    let body = bodies::find(problems, &path.to("body"), &file.bodies, body)?;
    if body.is_on_foot() {
        let what = format!("`{}` is no body on wheels", body.name);
        let help = "who stands on foot is a `Pedestrian(…)` with `Scripted(Walk([]))`".to_owned();
        problems.add(&path.to("body"), what, "here", Some(help));
    }
    Some(Agent {
        name: name.clone(),
        body,
        road: number,
        // It never moves, so only its heading decides how it stands.
        direction: Direction::With,
        lane_keeping: entry.lane_keeping(),
        lane: entry.lane(),
        lateral_m: lateral_m.0,
        facing_rad: *heading_rad,
        place: StartPlace::At {
            x_m: s_m.0,
            speed_mps: Range::fixed(0.0),
        },
        drive: Drive::Scripted(Script::Stand),
    })
}
