//! Storyboard: entities, their initial states and their trajectories.

use super::entity::is_ego;
use super::path::Vertex;
use super::xml::Element;
use crate::scene::drive::Agent;

/// Agent of the scenario, with its trajectory and its driver.
pub(super) struct Part<'a> {
    pub agent: &'a Agent,
    /// Recorded vertices of the trajectory.
    ///
    /// With an external driver, only the first vertex is used, as the start.
    pub way: &'a [Vertex],
    pub speed_mps: f64,
    pub driver: Driver,
}

/// Source of an entity's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Driver {
    /// Recorded trajectory.
    Trajectory,
    /// Controller outside of the player.
    External,
}

impl Part<'_> {
    pub fn name(&self) -> &str {
        &self.agent.name
    }
}

/// Returns the storyboard, which stops at the first step after `stop_s`.
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
    // The schema requires an act in every story, so an ego alone gets no story.
    if !groups.is_empty() {
        let act = Element::new("Act")
            .text("name", "as recorded")
            .children(groups)
            .child(trigger("StartTrigger", "at once", 0.0, "greaterOrEqual"));
        storyboard = storyboard.child(Element::new("Story").text("name", "crash").child(act));
    }
    // "Greater than" and not "or equal": the last vertex is reached before the
    // end.
    storyboard.child(trigger("StopTrigger", "end", stop_s, "greaterThan"))
}

/// Surface of the road, constant over the episode.
fn surface(friction: f64) -> Element {
    let condition = Element::new("RoadCondition").number("frictionScaleFactor", friction);
    let environment = Element::new("Environment").text("name", "recorded");
    let action = Element::new("EnvironmentAction").child(environment.child(condition));
    Element::new("GlobalAction").child(action)
}

/// Initial place and speed of one agent.
fn begin(part: &Part) -> Element {
    let private = Element::new("Private").text("entityRef", part.name());
    // At most one vertex: the initial place.
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
    // A step of zero seconds sets the speed at once.
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

/// Activates the assigned controller, along and across the lane.
fn hand_over() -> Element {
    let activate = Element::new("ActivateControllerAction")
        .text("lateral", "true")
        .text("longitudinal", "true");
    let action = Element::new("ControllerAction").child(activate);
    Element::new("PrivateAction").child(action)
}

/// Controller outside of the player.
///
/// The names are those that esmini and CARLA's ScenarioRunner look for.
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

/// Timed polyline of one agent.
///
/// Every vertex has its instant, so the speed between vertices follows from the
/// times. The position is imposed, not steered for.
fn follow(part: &Part) -> Element {
    let name = part.name();
    let polyline = Element::new("Polyline").children(part.way.iter().map(Vertex::element));
    let trajectory = Element::new("Trajectory")
        .text("name", name)
        .text("closed", "false")
        .child(Element::new("Shape").child(polyline));
    // Times of the vertices are simulation times: absolute, neither scaled nor
    // shifted.
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

/// Trigger with one condition on the simulation time.
fn trigger(kind: &'static str, name: &str, time_s: f64, rule: &str) -> Element {
    let time = Element::new("SimulationTimeCondition")
        .number("value", time_s)
        .text("rule", rule);
    let condition = Element::new("Condition")
        .text("name", name)
        .number("delay", 0.0)
        // No edge: the condition also holds if it is true from the first step
        // on.
        .text("conditionEdge", "none")
        .child(Element::new("ByValueCondition").child(time));
    Element::new(kind).child(Element::new("ConditionGroup").child(condition))
}

/// Driver of an agent beside an external ego.
pub(super) fn driver_beside_an_own_ego(agent: &Agent) -> Driver {
    if is_ego(agent) {
        Driver::External
    } else {
        Driver::Trajectory
    }
}
