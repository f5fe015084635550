//! What a storyboard lets somebody do: where they begin, and their laws.

use super::entity::{Approached, Entity, Law, Step};
use super::error::ImportError;
use super::laws::{approached, dynamics, gap_of, speed, walked};
use super::places::{Ground, Placed, lane_beside, lane_change_m};
use super::scope::Scope;
use super::tree::Node;
use super::triggers::{Starts, starts};

/// Acts that begin so soon begin at once.
const SOON_S: f64 = 1.0;

/// What an action does to nobody's motion: the ego's controller, lights,
/// weather, logs.
const IGNORED: [&str; 6] = [
    "ControllerAction",
    "ActivateControllerAction",
    "AppearanceAction",
    "EnvironmentAction",
    "VariableAction",
    "VisibilityAction",
];

/// Where somebody begins.
pub(super) fn begins(
    private: &Node,
    scope: &Scope,
    ground: Ground<'_>,
) -> Result<Placed, ImportError> {
    let mut at = None;
    for action in private.all("PrivateAction") {
        let it = action.only()?;
        match it.name.as_str() {
            "TeleportAction" => at = Some(ground.place(it.inner("Position")?, scope)?),
            "RoutingAction" => {
                let it = it.only()?;
                match it.name.as_str() {
                    "AssignRouteAction" => {}
                    "FollowTrajectoryAction" => at = Some(on_trajectory(it, scope, ground)?),
                    _ => return Err(it.error("an action of this kind is not read")),
                }
            }
            "LongitudinalAction" => {}
            name if IGNORED.contains(&name) => {}
            _ => return Err(it.error("an action of this kind is not read")),
        }
    }
    at.ok_or_else(|| private.error("nothing says where it begins"))
}

fn on_trajectory(it: &Node, scope: &Scope, ground: Ground<'_>) -> Result<Placed, ImportError> {
    let (trajectory, own) = ground.trajectory(it.inner("TrajectoryRef")?, scope)?;
    let mut on = ground.way(&trajectory, &own)?;
    on.along_m += scope.number_or_zero(it, "initialDistanceOffset")?;
    Ok(Placed {
        spot: on.spot(),
        lane: None,
        way: Some(on),
    })
}

fn longitudinal<'a>(private: &'a Node, name: &'a str) -> impl Iterator<Item = &'a Node> {
    let actions = private.all("PrivateAction");
    let along = actions.filter_map(|it| it.child("LongitudinalAction"));
    along.filter_map(move |it| it.child(name))
}

/// How fast somebody is at first.
pub(super) fn first_speed_mps(
    private: &Node,
    scope: &Scope,
    before: &[Entity],
) -> Result<f64, ImportError> {
    let mut speed_mps = 0.0;
    for action in longitudinal(private, "SpeedAction") {
        let target = action.inner("SpeedActionTarget")?.only()?;
        let value_mps = scope.number(target, "value")?;
        speed_mps = match target.name.as_str() {
            "AbsoluteTargetSpeed" => value_mps,
            "RelativeTargetSpeed" => {
                let name = scope.text(target, "entityRef")?;
                let other = before.iter().find(|it| it.name == name);
                let other =
                    other.ok_or_else(|| target.error(format!("`{name}` is not placed before")))?;
                other.speed_mps + value_mps
            }
            _ => return Err(target.error("a target speed of this kind is not read")),
        };
    }
    match 0.0 <= speed_mps {
        true => Ok(speed_mps),
        false => Err(private.error(format!("it starts at {speed_mps} m/s: nobody reverses"))),
    }
}

/// How far before the ego somebody is put, bumper to bumper.
pub(super) fn first_gap_m(
    private: &Node,
    scope: &Scope,
    speed_mps: f64,
) -> Result<Option<f64>, ImportError> {
    let mut gap_m = None;
    for action in longitudinal(private, "LongitudinalDistanceAction") {
        gap_m = Some(gap_of(action, scope, speed_mps)?);
    }
    Ok(gap_m)
}

/// When the file ends a run, if it says so by a time.
pub(super) fn stop_s(board: &Node, scope: &Scope) -> Result<Option<f64>, ImportError> {
    let groups = board.child("StopTrigger");
    let groups = groups.into_iter().flat_map(|it| it.all("ConditionGroup"));
    for condition in groups.flat_map(|it| it.all("Condition")) {
        let time = condition
            .child("ByValueCondition")
            .and_then(|it| it.child("SimulationTimeCondition"));
        if let Some(time) = time {
            let delay_s = scope.number_or_zero(condition, "delay")?;
            return Ok(Some(scope.number(time, "value")? + delay_s));
        }
    }
    Ok(None)
}

/// Reads the acts: who does what, and who is not there.
pub(super) fn acts(
    board: &Node,
    scope: &Scope,
    ground: Ground<'_>,
    entities: &mut Vec<Entity>,
) -> Result<(), ImportError> {
    let mut scripts: Vec<Script> = entities.iter().map(Script::of).collect();
    let mut gone: Vec<String> = Vec::new();
    for act in board.all("Story").flat_map(|story| story.all("Act")) {
        match starts(act, scope)? {
            Starts::Never => continue,
            Starts::Now => {}
            Starts::At(at_s) if at_s <= SOON_S => {}
            // Whatever ends up doing nothing may begin when it likes.
            _ if is_ignored(act) => continue,
            _ => return Err(act.error("an act that begins later is not read")),
        }
        for group in act.all("ManeuverGroup") {
            let actors = group.child("Actors");
            let actors = actors.into_iter().flat_map(|it| it.all("EntityRef"));
            let actors = actors.map(|it| scope.text(it, "entityRef"));
            let actors = actors.collect::<Result<Vec<_>, _>>()?;
            for it in &group.children {
                let (maneuver, own) = match it.name.as_str() {
                    "Maneuver" => (it.clone(), scope.clone()),
                    "CatalogReference" => ground.catalogs.entry(it, scope, ground.files)?,
                    _ => continue,
                };
                for event in maneuver.all("Event") {
                    let mut reader = Reader {
                        scope: &own,
                        ground,
                        scripts: &mut scripts,
                        gone: &mut gone,
                    };
                    reader.event(event, &maneuver, &actors)?;
                }
            }
        }
    }
    for (entity, script) in entities.iter_mut().zip(scripts) {
        entity.steps = script.steps;
        entity.meets = script.meets;
        entity.gap_m = script.gap_m;
        entity.placed = script.placed;
    }
    entities.retain(|it| !gone.contains(&it.name));
    Ok(())
}

/// Whether nothing in it moves anybody.
fn is_ignored(act: &Node) -> bool {
    fn actions<'a>(node: &'a Node, found: &mut Vec<&'a Node>) {
        for child in &node.children {
            match child.name.as_str() {
                "PrivateAction" | "GlobalAction" => found.extend(child.children.first()),
                _ => actions(child, found),
            }
        }
    }
    let mut found = Vec::new();
    actions(act, &mut found);
    found.iter().all(|it| IGNORED.contains(&it.name.as_str()))
}

/// What somebody does, as far as it has been read.
struct Script {
    name: String,
    placed: Placed,
    speed_mps: f64,
    most_mps2: (f64, f64),
    lane: Option<i32>,
    steps: Vec<Step>,
    meets: Option<Approached>,
    gap_m: Option<f64>,
    /// What the step before may be called.
    called: Vec<String>,
}

impl Script {
    fn of(entity: &Entity) -> Script {
        Script {
            name: entity.name.clone(),
            placed: entity.placed.clone(),
            speed_mps: entity.speed_mps,
            most_mps2: entity.body.most_mps2,
            lane: entity.placed.lane.as_ref().map(|at| at.lane),
            steps: Vec::new(),
            meets: None,
            gap_m: entity.gap_m,
            called: Vec::new(),
        }
    }
}

struct Reader<'a> {
    scope: &'a Scope,
    ground: Ground<'a>,
    scripts: &'a mut Vec<Script>,
    gone: &'a mut Vec<String>,
}

impl Reader<'_> {
    fn event(
        &mut self,
        event: &Node,
        maneuver: &Node,
        actors: &[String],
    ) -> Result<(), ImportError> {
        let mut moving = Vec::new();
        for action in event.all("Action") {
            let it = action.only()?;
            let inner = it.only()?;
            if IGNORED.contains(&inner.name.as_str()) {
                continue;
            }
            match it.name.as_str() {
                "PrivateAction" => moving.push(inner),
                "GlobalAction" => self.global(event, inner)?,
                _ => return Err(it.error("an action of this kind is not read")),
            }
        }
        if moving.is_empty() {
            return Ok(());
        }
        for actor in actors {
            if actor == "Ego" {
                return Err(moving[0].error("an ego that is told how to move is not read"));
            }
            let known = self.scripts.iter().position(|it| it.name == *actor);
            let known =
                known.ok_or_else(|| event.error(format!("there is nobody called `{actor}`")))?;
            self.step(known, event, &moving)?;
            let names = [maneuver.raw("name"), event.raw("name")];
            let actions = event.all("Action").map(|it| it.raw("name"));
            let names = names.into_iter().chain(actions).flatten();
            self.scripts[known].called = names.map(str::to_owned).collect();
        }
        Ok(())
    }

    fn global(&mut self, event: &Node, it: &Node) -> Result<(), ImportError> {
        let deletes = it.name == "EntityAction" && it.child("DeleteEntityAction").is_some();
        if !deletes {
            return Err(it.error("an action of this kind is not read"));
        }
        match starts(event, self.scope)? {
            Starts::Now => self.gone.push(self.scope.text(it, "entityRef")?),
            Starts::Never => {}
            _ => return Err(it.error("somebody who vanishes on the way is not read")),
        }
        Ok(())
    }

    fn step(&mut self, who: usize, event: &Node, actions: &[&Node]) -> Result<(), ImportError> {
        let script = &self.scripts[who];
        let is_first = script.steps.is_empty() && script.called.is_empty();
        let mut step = Step {
            when: None,
            after_s: 0.0,
            laws: Vec::new(),
        };
        match starts(event, self.scope)? {
            Starts::Never => return Ok(()),
            Starts::Now if is_first => {}
            Starts::At(at_s) if is_first => step.after_s = at_s,
            Starts::After { element, delay_s } if script.called.contains(&element) => {
                step.after_s = delay_s;
            }
            Starts::When { watch, delay_s } => {
                step.when = Some(watch);
                step.after_s = delay_s;
            }
            _ => {
                let what = "an event that does not begin after the one before it is not read";
                return Err(event.error(what));
            }
        }
        for action in actions {
            self.action(who, action, is_first, &mut step)?;
        }
        // What is done at the start by itself needs no step.
        let is_setting = step.laws.is_empty();
        if !is_setting {
            self.scripts[who].steps.push(step);
        }
        Ok(())
    }

    fn action(
        &mut self,
        who: usize,
        action: &Node,
        is_first: bool,
        step: &mut Step,
    ) -> Result<(), ImportError> {
        let (scope, ground) = (self.scope, self.ground);
        let it = match action.name.as_str() {
            "LongitudinalAction" | "LateralAction" | "RoutingAction" => action.only()?,
            _ => action,
        };
        let script = &mut self.scripts[who];
        match it.name.as_str() {
            "SpeedAction" => {
                let law = speed(it, scope, (script.speed_mps, script.most_mps2))?;
                if let Law::Speed {
                    to_mps,
                    relative_to: None,
                    ..
                } = law
                {
                    script.speed_mps = to_mps;
                }
                step.laws.push(law);
            }
            "LaneChangeAction" => {
                let lane = script.placed.lane.clone();
                let lane = lane.ok_or_else(|| it.error("it is on no lane"))?;
                let target = it.inner("LaneChangeTarget")?.only()?;
                let value = scope.number(target, "value")? as i32;
                let to = match target.name.as_str() {
                    "AbsoluteTargetLane" => value,
                    _ => {
                        let name = scope.text(target, "entityRef")?;
                        let other = ground.placed.get(&name).and_then(|it| it.lane.as_ref());
                        let other =
                            other.ok_or_else(|| target.error(format!("`{name}` is on no lane")))?;
                        lane_beside(other, value)
                    }
                };
                let now = super::places::Placed {
                    lane: script.lane.map(|id| super::places::OnLane {
                        lane: id,
                        ..lane.clone()
                    }),
                    ..script.placed.clone()
                };
                let from = now.lane.as_ref().unwrap_or(&lane);
                let by_m = lane_change_m(ground, it, from, to)?;
                let rate_mps = dynamics(it.inner("LaneChangeActionDynamics")?, scope, "rate")?;
                script.lane = Some(to);
                step.laws.push(Law::LaneChange { by_m, rate_mps });
            }
            "LaneOffsetAction" => {
                let lane = script.placed.lane.as_ref();
                let lane = lane.ok_or_else(|| it.error("it is on no lane"))?;
                let target = it.inner("LaneOffsetTarget")?.only()?;
                let mut offset_m = scope.number(target, "value")?;
                let line = ground.roads.road(it, &lane.road)?;
                let middle_m = line.middle_m(it, script.lane.unwrap_or(lane.lane))?;
                if target.name == "RelativeTargetLaneOffset" {
                    let name = scope.text(target, "entityRef")?;
                    let other = ground.placed.get(&name).and_then(|it| it.lane.as_ref());
                    let other =
                        other.ok_or_else(|| target.error(format!("`{name}` is on no lane")))?;
                    offset_m += other.t_m - line.middle_m(it, other.lane)?;
                }
                let dynamics = it.inner("LaneOffsetActionDynamics")?;
                if dynamics.raw("dynamicsShape") != Some("sinusoidal") {
                    return Err(dynamics.error("only sinusoidal lane offsets are read"));
                }
                step.laws.push(Law::Beside {
                    t_m: middle_m + offset_m,
                    most_lateral_mps2: scope.number(dynamics, "maxLateralAcc")?,
                });
            }
            "LongitudinalDistanceAction" if is_first && step.when.is_none() => {
                script.gap_m = Some(gap_of(it, scope, script.speed_mps)?);
            }
            "SynchronizeAction" if is_first && step.when.is_none() => {
                script.meets = Some(approached(it, scope, ground)?);
            }
            "FollowTrajectoryAction" => {
                let (way, law) = walked(it, scope, ground)?;
                script.placed.way = Some(way);
                step.laws.push(law);
            }
            _ => return Err(it.error("an action of this kind is not read here")),
        }
        Ok(())
    }
}
