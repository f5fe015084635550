//! Actions of an Init that take time, as a story that begins with the run.

use super::ego_events::EgoRequest;
use super::words::write_words;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Returns a storyboard whose Init contains only what takes no time.
///
/// The rest of it is the first story, so that at one instant a later action wins.
pub(super) fn with_first_story(
    file: &XmlNode,
    ego: &EgoRequest,
    scope: &ParameterScope,
) -> XmlNode {
    let mut board = file.clone();
    write_words(&mut board, scope);
    let taken = |name: &str| file.all("Story").any(|it| it.raw("name") == Some(name));
    let mut names = ["Init", "init", "begin of the run"].into_iter();
    // The stories of the file keep their names, which its conditions mention.
    let free = names.find(|name| !taken(name)).unwrap_or("Init");
    let name = [("name", free)];
    let init = board.children.iter_mut().find(|it| it.name == "Init");
    let actions = init.and_then(|it| it.children.iter_mut().find(|it| it.name == "Actions"));
    let Some(actions) = actions else {
        return board;
    };
    let mut groups = Vec::new();
    let privates = actions.children.iter_mut();
    for private in privates.filter(|it| it.name == "Private") {
        let is_ego = private.raw("entityRef") == Some(&ego.name);
        let lasts = |it: &XmlNode| it.children.first().is_some_and(|it| takes_time(it, scope));
        let follows = |it: &XmlNode| it.children.first().is_some_and(is_timed);
        let all = private.children.iter();
        // The trajectory of an ego says where it begins, and the user drives it.
        let begun = all.filter(|it| lasts(it) || (follows(it) && !is_ego));
        groups.extend(
            begun
                .map(|action| group(private, action))
                .collect::<Vec<_>>(),
        );
        // A trajectory with times stays in the Init as well, which takes the
        // first place from it.
        private.children.retain(|it| !lasts(it));
    }
    if !groups.is_empty() {
        let act = actions.around("Act", &name, groups);
        let story = actions.around("Story", &name, vec![act]);
        board.children.insert(0, story);
    }
    board
}

/// Returns an action of an entity as a group of one event that begins at once.
fn group(private: &XmlNode, action: &XmlNode) -> XmlNode {
    let entity = private.raw("entityRef").unwrap_or_default();
    let name = [("name", entity)];
    let named = action.around("Action", &name, vec![action.clone()]);
    let once = [("name", "Init"), ("priority", "override")];
    let event = private.around("Event", &once, vec![named]);
    let actor = private.around("EntityRef", &[("entityRef", entity)], Vec::new());
    let actors = private.around("Actors", &[], vec![actor]);
    let maneuver = private.around("Maneuver", &name, vec![event]);
    private.around("ManeuverGroup", &name, vec![actors, maneuver])
}

/// Returns whether an action goes on after the start, beside a trajectory with times.
fn takes_time(action: &XmlNode, scope: &ParameterScope) -> bool {
    let inner = action.children.first().map(|it| (it, it.name.as_str()));
    match (action.name.as_str(), inner) {
        ("LateralAction", Some(_)) => true,
        ("LongitudinalAction", Some((speed, "SpeedAction"))) => is_ramp(speed, scope),
        ("LongitudinalAction", Some(_)) => true,
        ("RoutingAction", Some((_, name))) => {
            // Both shape the start, so the Init reads them.
            !matches!(name, "AssignRouteAction" | "FollowTrajectoryAction")
        }
        _ => false,
    }
}

fn is_ramp(speed: &XmlNode, scope: &ParameterScope) -> bool {
    let target = speed
        .child("SpeedActionTarget")
        .and_then(|it| it.children.first());
    let keeps_on = target.is_some_and(|it| scope.is_true(it, "continuous") != Ok(false));
    let dynamics = speed.child("SpeedActionDynamics");
    let lasts = dynamics.is_some_and(|it| {
        // A change in no time equals a step. Problems of the value are named in the story.
        it.raw("dynamicsShape") != Some("step") && scope.number_or_zero(it, "value") != Ok(0.0)
    });
    lasts || keeps_on
}

/// Returns whether an action follows a trajectory with times.
pub(super) fn is_timed(action: &XmlNode) -> bool {
    let follows = action.child("FollowTrajectoryAction");
    let reference = follows.and_then(|it| it.child("TimeReference"));
    reference.is_some_and(|it| it.child("Timing").is_some())
}
