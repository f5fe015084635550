//! Storyboard: entities, their initial states and their trajectories.

use super::entity::is_ego;
use super::path::Vertex;
use crate::scene::drive::Agent;
use crate::xml::XmlElement;

/// Agent of the scenario, with its trajectory and its driver.
pub(super) struct StoryboardAgent<'a> {
    pub agent: &'a Agent,
    /// Recorded vertices of the trajectory.
    ///
    /// With an external driver, only the first vertex is used, as the start.
    pub way: &'a [Vertex],
    pub speed_mps: f64,
    pub driver: MotionSource,
}

/// Source of an entity's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MotionSource {
    /// Recorded trajectory.
    Trajectory,
    /// Controller outside of the player.
    External,
}

impl StoryboardAgent<'_> {
    pub(super) fn name(&self) -> &str {
        &self.agent.name
    }
}

/// Returns the storyboard, which stops at the first step after `stop_s`.
pub(super) fn storyboard(parts: &[StoryboardAgent], friction: f64, stop_s: f64) -> XmlElement {
    let begins = parts.iter().map(begin);
    let actions = XmlElement::new("Actions")
        .child(surface(friction))
        .children(begins);
    let init = XmlElement::new("Init").child(actions);
    let driven = parts
        .iter()
        .filter(|part| part.driver == MotionSource::Trajectory);
    let groups: Vec<XmlElement> = driven.map(maneuver_group).collect();
    let mut storyboard = XmlElement::new("Storyboard").child(init);
    // The schema requires an act in every story, so an ego alone gets no story.
    if !groups.is_empty() {
        let act = XmlElement::new("Act")
            .text("name", "as recorded")
            .children(groups)
            .child(trigger("StartTrigger", "at once", 0.0, "greaterOrEqual"));
        storyboard = storyboard.child(XmlElement::new("Story").text("name", "crash").child(act));
    }
    // "Greater than" and not "or equal": the last vertex is reached before the
    // end.
    storyboard.child(trigger("StopTrigger", "end", stop_s, "greaterThan"))
}

/// Surface of the road, constant over the episode.
fn surface(friction: f64) -> XmlElement {
    let condition = XmlElement::new("RoadCondition").number("frictionScaleFactor", friction);
    let environment = XmlElement::new("Environment").text("name", "recorded");
    let action = XmlElement::new("EnvironmentAction").child(environment.child(condition));
    XmlElement::new("GlobalAction").child(action)
}

/// Initial place and speed of one agent.
fn begin(part: &StoryboardAgent) -> XmlElement {
    let private = XmlElement::new("Private").text("entityRef", part.name());
    // At most one vertex: the initial place.
    let place = part.way.iter().take(1).map(Vertex::position);
    let teleport = XmlElement::new("TeleportAction").children(place);
    let private = private
        .child(XmlElement::new("PrivateAction").child(teleport))
        .child(speed(part.speed_mps));
    match part.driver {
        MotionSource::Trajectory => private,
        MotionSource::External => private.child(hand_over()),
    }
}

fn speed(speed_mps: f64) -> XmlElement {
    // A step of zero seconds sets the speed at once.
    let dynamics = XmlElement::new("SpeedActionDynamics")
        .text("dynamicsShape", "step")
        .number("value", 0.0)
        .text("dynamicsDimension", "time");
    let target = XmlElement::new("AbsoluteTargetSpeed").number("value", speed_mps);
    let action = XmlElement::new("SpeedAction")
        .child(dynamics)
        .child(XmlElement::new("SpeedActionTarget").child(target));
    let longitudinal = XmlElement::new("LongitudinalAction").child(action);
    XmlElement::new("PrivateAction").child(longitudinal)
}

/// Activates the assigned controller, along and across the lane.
fn hand_over() -> XmlElement {
    let activate = XmlElement::new("ActivateControllerAction")
        .text("lateral", "true")
        .text("longitudinal", "true");
    let action = XmlElement::new("ControllerAction").child(activate);
    XmlElement::new("PrivateAction").child(action)
}

/// Controller outside of the player.
///
/// The names are those that esmini and CARLA's ScenarioRunner look for.
pub(super) fn external_controller(agent: &Agent) -> XmlElement {
    let property = |name: &'static str, value: &str| {
        let property = XmlElement::new("Property").text("name", name);
        property.text("value", value)
    };
    let properties = XmlElement::new("Properties")
        .child(property("esminiController", "ExternalController"))
        .child(property("module", "external_control"));
    let controller = XmlElement::new("Controller")
        .text("name", format!("your {}", agent.name))
        .text("controllerType", "movement")
        .child(properties);
    XmlElement::new("ObjectController").child(controller)
}

fn maneuver_group(part: &StoryboardAgent) -> XmlElement {
    let name = part.name();
    let actor = XmlElement::new("EntityRef").text("entityRef", name);
    let actors = XmlElement::new("Actors").text("selectTriggeringEntities", "false");
    let event = XmlElement::new("Event")
        .text("name", format!("{name} moves"))
        .text("priority", "override")
        .text("maximumExecutionCount", "1")
        .child(follow(part))
        .child(trigger("StartTrigger", "at once", 0.0, "greaterOrEqual"));
    let maneuver = XmlElement::new("Maneuver").text("name", format!("{name} goes its way"));
    XmlElement::new("ManeuverGroup")
        .text("name", name)
        .text("maximumExecutionCount", "1")
        .child(actors.child(actor))
        .child(maneuver.child(event))
}

/// Timed polyline of one agent.
///
/// Every vertex has its instant, so the speed between vertices follows from the
/// times. The position is imposed, not steered for.
fn follow(part: &StoryboardAgent) -> XmlElement {
    let name = part.name();
    let polyline = XmlElement::new("Polyline").children(part.way.iter().map(Vertex::element));
    let trajectory = XmlElement::new("Trajectory")
        .text("name", name)
        .text("closed", "false")
        .child(XmlElement::new("Shape").child(polyline));
    // Times of the vertices are simulation times: absolute, neither scaled nor
    // shifted.
    let timing = XmlElement::new("Timing")
        .text("domainAbsoluteRelative", "absolute")
        .number("scale", 1.0)
        .number("offset", 0.0);
    let mode = XmlElement::new("TrajectoryFollowingMode").text("followingMode", "position");
    let action = XmlElement::new("FollowTrajectoryAction")
        .child(XmlElement::new("TrajectoryRef").child(trajectory))
        .child(XmlElement::new("TimeReference").child(timing))
        .child(mode);
    let routing = XmlElement::new("RoutingAction").child(action);
    let private = XmlElement::new("PrivateAction").child(routing);
    XmlElement::new("Action").text("name", name).child(private)
}

/// Trigger with one condition on the simulation time.
fn trigger(kind: &'static str, name: &str, time_s: f64, rule: &str) -> XmlElement {
    let time = XmlElement::new("SimulationTimeCondition")
        .number("value", time_s)
        .text("rule", rule);
    let condition = XmlElement::new("Condition")
        .text("name", name)
        .number("delay", 0.0)
        // No edge: the condition also holds if it is true from the first step
        // on.
        .text("conditionEdge", "none")
        .child(XmlElement::new("ByValueCondition").child(time));
    XmlElement::new(kind).child(XmlElement::new("ConditionGroup").child(condition))
}

/// Driver of an agent beside an external ego.
pub(super) fn driver_beside_an_own_ego(agent: &Agent) -> MotionSource {
    if is_ego(agent) {
        MotionSource::External
    } else {
        MotionSource::Trajectory
    }
}
