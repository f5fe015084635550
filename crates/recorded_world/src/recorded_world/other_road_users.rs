//! Further road users of a situation, as scripted traffic.

use brakecheck_traffic::{OtherPlan, rounded};

use super::plain;
use super::planned_motion::{on_path, path_of, steps_of};
use crate::pose::Pose;
use crate::ron_file::ValuePath;
use crate::rulebook::Counts;
use crate::scene::drive::Script;
use crate::world_file::{DriveFile, ScenarioFile, StartFile, TextComment};

/// Counts contacts that the ego causes, and none in which it stands.
pub(super) const CAUSED: Counts = Counts::Contact { closing_mps: 0.5 };

/// Adds road users to a world with an origin, with a road of its own for each.
///
/// Returns a comment per road user: its identity in the recording.
pub(super) fn add(
    others: &[OtherPlan],
    origin: Pose,
    world: &mut ScenarioFile,
) -> Vec<TextComment> {
    let mut comments = Vec::new();
    for (i, other) in others.iter().enumerate() {
        let name = format!("other{}", i + 1);
        let start = StartFile::At {
            x_m: rounded(other.s_m).into(),
            speed_mps: other.speed.as_ref().map_or(0.0, |it| it.start_mps).into(),
        };
        let drive = match &other.speed {
            Some(speed) => DriveFile::Script(steps_of(speed)),
            None if other.body.is_on_foot() => DriveFile::Scripted(Script::Walk(Vec::new())),
            None => DriveFile::Scripted(Script::Stand),
        };
        let here = ValuePath::top().to("agents").at(world.agents.len());
        comments.push(TextComment::new(here, plain(&other.id)));
        world
            .agents
            .push(on_path(&name, other.body.into(), &name, start, drive));
        let path = path_of(other.body.width_m, &other.road, origin);
        world.roads.0.insert(name, path);
        // A scripted road user may run into an ego that stands, which is no
        // failure of the ego.
        world.counts = CAUSED;
    }
    comments
}
