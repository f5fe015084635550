//! Who is there, where they begin, and the trajectories they follow.

use super::entity::is_ego;
use super::path::Vertex;
use super::xml::Element;
use crate::scene::drive::Agent;

/// An agent in the scenario.
pub(super) struct Part<'a> {
    pub agent: &'a Agent,
    /// Its recorded way: all of it is followed, or only its begin is taken.
    pub way: &'a [Vertex],
    pub speed_mps: f64,
    pub driver: Driver,
}

/// Who moves an entity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Driver {
    /// Its trajectory.
    Trajectory,
    /// A controller outside of the player.
    External,
}

impl Part<'_> {
    pub fn name(&self) -> &str {
        &self.agent.name
    }
}

/// The storyboard: it stops at the first step after `stop_s`.
pub(super) fn storyboard(parts: &[Part], friction: f64, stop_s: f64) -> Element {
    let begins = parts.iter().map(begin);
    let actions = Element::new("Actions")
        .child(surface(friction))
        .children(begins);
    let init = Element::new("Init").child(actions);
    let driven = parts
        .iter()
        .filter(|part| part.driver == Driver::Trajectory);
    let groups: Vec<Element> = driven.map(maneuver_group).collect();
    let mut storyboard = Element::new("Storyboard").child(init);
    // A story without anybody in it would not be one.
    if !groups.is_empty() {
        let act = Element::new("Act")
            .text("name", "as recorded")
            .children(groups)
            .child(trigger("StartTrigger", "at once", 0.0, "greaterOrEqual"));
        storyboard = storyboard.child(Element::new("Story").text("name", "crash").child(act));
    }
    storyboard.child(trigger("StopTrigger", "end", stop_s, "greaterThan"))
}

/// The road's surface for all of the episode.
fn surface(friction: f64) -> Element {
    let condition = Element::new("RoadCondition").number("frictionScaleFactor", friction);
    let environment = Element::new("Environment").text("name", "recorded");
    let action = Element::new("EnvironmentAction").child(environment.child(condition));
    Element::new("GlobalAction").child(action)
}

/// Where somebody is at first, and how fast.
fn begin(part: &Part) -> Element {
    let private = Element::new("Private").text("entityRef", part.name());
    let place = part.way.iter().take(1).map(Vertex::position);
    let teleport = Element::new("TeleportAction").children(place);
    let private = private
        .child(Element::new("PrivateAction").child(teleport))
        .child(speed(part.speed_mps));
    match part.driver {
        Driver::Trajectory => private,
        Driver::External => private.child(hand_over()),
    }
}

fn speed(speed_mps: f64) -> Element {
    let dynamics = Element::new("SpeedActionDynamics")
        .text("dynamicsShape", "step")
        .number("value", 0.0)
        .text("dynamicsDimension", "time");
    let target = Element::new("AbsoluteTargetSpeed").number("value", speed_mps);
    let action = Element::new("SpeedAction")
        .child(dynamics)
        .child(Element::new("SpeedActionTarget").child(target));
    let longitudinal = Element::new("LongitudinalAction").child(action);
    Element::new("PrivateAction").child(longitudinal)
}

/// Lets the controller that was assigned act, along and across the lane.
fn hand_over() -> Element {
    let activate = Element::new("ActivateControllerAction")
        .text("lateral", "true")
        .text("longitudinal", "true");
    let action = Element::new("ControllerAction").child(activate);
    Element::new("PrivateAction").child(action)
}

/// A controller outside of the player, under the names that esmini and CARLA's
/// ScenarioRunner look for.
pub(super) fn external_controller(agent: &Agent) -> Element {
    let property = |name: &'static str, value: &str| {
        let property = Element::new("Property").text("name", name);
        property.text("value", value)
    };
    let properties = Element::new("Properties")
        .child(property("esminiController", "ExternalController"))
        .child(property("module", "external_control"));
    let controller = Element::new("Controller")
        .text("name", format!("your {}", agent.name))
        .text("controllerType", "movement")
        .child(properties);
    Element::new("ObjectController").child(controller)
}

fn maneuver_group(part: &Part) -> Element {
    let name = part.name();
    let actor = Element::new("EntityRef").text("entityRef", name);
    let actors = Element::new("Actors").text("selectTriggeringEntities", "false");
    let event = Element::new("Event")
        .text("name", format!("{name} moves"))
        .text("priority", "override")
        .text("maximumExecutionCount", "1")
        .child(follow(part))
        .child(trigger("StartTrigger", "at once", 0.0, "greaterOrEqual"));
    let maneuver = Element::new("Maneuver").text("name", format!("{name} goes its way"));
    Element::new("ManeuverGroup")
        .text("name", name)
        .text("maximumExecutionCount", "1")
        .child(actors.child(actor))
        .child(maneuver.child(event))
}

/// A timed polyline. Every vertex has its instant, so that the speed in between
/// follows from it; the position is imposed, not steered for.
fn follow(part: &Part) -> Element {
    let name = part.name();
    let polyline = Element::new("Polyline").children(part.way.iter().map(Vertex::element));
    let trajectory = Element::new("Trajectory")
        .text("name", name)
        .text("closed", "false")
        .child(Element::new("Shape").child(polyline));
    let timing = Element::new("Timing")
        .text("domainAbsoluteRelative", "absolute")
        .number("scale", 1.0)
        .number("offset", 0.0);
    let mode = Element::new("TrajectoryFollowingMode").text("followingMode", "position");
    let action = Element::new("FollowTrajectoryAction")
        .child(Element::new("TrajectoryRef").child(trajectory))
        .child(Element::new("TimeReference").child(timing))
        .child(mode);
    let routing = Element::new("RoutingAction").child(action);
    let private = Element::new("PrivateAction").child(routing);
    Element::new("Action").text("name", name).child(private)
}

/// A trigger of one condition on the time.
fn trigger(kind: &'static str, name: &str, time_s: f64, rule: &str) -> Element {
    let time = Element::new("SimulationTimeCondition")
        .number("value", time_s)
        .text("rule", rule);
    let condition = Element::new("Condition")
        .text("name", name)
        .number("delay", 0.0)
        .text("conditionEdge", "none")
        .child(Element::new("ByValueCondition").child(time));
    Element::new(kind).child(Element::new("ConditionGroup").child(condition))
}

/// Who somebody is driven by, where the ego is somebody else's.
pub(super) fn driver_beside_an_own_ego(agent: &Agent) -> Driver {
    match is_ego(agent) {
        true => Driver::External,
        false => Driver::Trajectory,
    }
}
