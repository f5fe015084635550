//! Storyboard of a file as that of a world.
//!
//! Elements, triggers and actions keep their names and their order. What moves nobody is
//! left out, with what only refers to it.

mod actions;
mod begins;
mod differences;
mod lanes;
mod numbers;
mod parts;
mod places;
mod quantities;
mod relevant;
mod speeds;
mod survey;
mod triggers;

pub(super) use numbers::StoryNumbers;
pub(super) use parts::{StoryParts, catalog_maneuvers};
pub(super) use survey::{StorySurvey, survey};

use std::collections::BTreeMap;

use numbers::StatedIn;
use parts::{PartKind, StoryPart};
use speeds::UNLIMITED;
use survey::{TakenAction, content};

use super::concrete::Concrete;
use super::draft::tidy;
use super::places::PositionContext;
use super::seen::{EntityInFrame, agent_name};
use super::still::is_still;
use crate::opendrive::error::{At, Blockers, ImportError};
use crate::opendrive::scope::number;
use crate::opendrive::tree::XmlNode;
use crate::ron_file::ValuePath;
use crate::story::values::{
    Act, DynamicLimits, EntityPerformance, EventPriority, ManeuverGroup, Story, StoryEvent,
    StoryManeuver, StoryNumber, Storyboard, Variable,
};

/// Greatest number of executions that a world counts.
const MOST_EXECUTIONS: f64 = 10_000.0;
/// Kind of the executions that it does not count.
const UNCOUNTED: &str = "executions after the 10,000th";

/// World in which a storyboard plays.
#[derive(Clone, Copy)]
pub(super) struct StoryFrame<'a> {
    pub concrete: &'a Concrete,
    pub all: &'a [EntityInFrame<'a>],
}

/// Content of a storyboard, and what of it is a part of the start.
#[derive(Clone, Copy)]
pub(super) struct StorySource<'a> {
    /// File with the declarations of variables.
    pub root: &'a XmlNode,
    pub parts: &'a StoryParts<'a>,
    pub survey: &'a StorySurvey,
    pub ground: PositionContext<'a>,
    pub numbers: &'a StoryNumbers,
    /// Factor by which the Init scales the friction of all roads.
    pub friction_scale: f64,
}

/// Storyboard of a world, with the elements of the file that its values come from.
pub(super) struct WrittenStory {
    pub board: Storyboard,
    pub origins: Vec<(ValuePath, At)>,
}

/// Returns the storyboard of a world, or `None` without one.
///
/// Without a frame it is read for its problems only.
pub(super) fn written(
    source: StorySource<'_>,
    frame: Option<StoryFrame<'_>>,
    blockers: &mut Blockers,
) -> Option<WrittenStory> {
    let StorySource {
        root,
        parts,
        survey,
        ground,
        numbers,
        friction_scale,
    } = source;
    let mut writer = StoryWriter {
        root,
        parts,
        survey,
        ground,
        frame,
        numbers,
        friction_scale,
        repeats: false,
        is_relevant: Vec::new(),
        variables: BTreeMap::new(),
        blockers: Blockers::default(),
        origins: Vec::new(),
    };
    // First, because the lists and the board leave out all that does not matter.
    writer.is_relevant = relevant::relevant(parts, |action| writer.moves(action));
    writer.leave_ego();
    writer.note_dropped();
    writer.note_differences();
    let board = writer.board();
    let StoryWriter {
        blockers: found,
        origins,
        ..
    } = writer;
    blockers.keep(found.none());
    (!board.stories.is_empty()).then_some(WrittenStory { board, origins })
}

struct StoryWriter<'a> {
    root: &'a XmlNode,
    parts: &'a StoryParts<'a>,
    survey: &'a StorySurvey,
    ground: PositionContext<'a>,
    frame: Option<StoryFrame<'a>>,
    numbers: &'a StoryNumbers,
    friction_scale: f64,
    /// True while an event or a group that may repeat is written.
    repeats: bool,
    is_relevant: Vec<bool>,
    /// Variables that the storyboard uses, with their first values.
    variables: BTreeMap<String, StoryNumber>,
    blockers: Blockers,
    origins: Vec<(ValuePath, At)>,
}

impl<'a> StoryWriter<'a> {
    fn board(&mut self) -> Storyboard {
        let stories = ValuePath::top().to("storyboard").to("stories");
        let mut written = Vec::new();
        for number in self.relevant(PartKind::Story, None) {
            let path = stories.at(written.len());
            let part = &self.parts.0[number];
            self.origins.push((path.clone(), part.node.at()));
            let held = self.relevant(PartKind::Act, Some(number));
            let numbered = held.into_iter().enumerate();
            let acts = numbered
                .map(|(i, act)| self.act(act, &path.to("acts").at(i)))
                .collect();
            written.push(Story {
                name: part.name.clone(),
                acts,
            });
        }
        // Sorted by name, so that equal files write equal texts.
        let variables = self.variables.iter().map(|(name, value)| Variable {
            name: name.clone(),
            value: value.clone(),
        });
        Storyboard {
            variables: variables.collect(),
            performance: self.performance(),
            stories: written,
            // The stop of a file ends the run, which is the horizon of a world.
            stop_trigger: Vec::new(),
        }
    }

    /// Limits of the entities that act.
    fn performance(&self) -> Vec<EntityPerformance> {
        let all = self.frame.map_or(&[][..], |frame| frame.all).iter();
        let acting = all.filter(|it| {
            let entity = it.entity;
            !entity.is_ego && entity.approach.is_none() && entity.is_driven()
        });
        // Files give limits to all entities, and only those of actors matter.
        let limited = acting.map(|it| {
            let body = &it.entity.body;
            // Files write the greatest number there is for no limit.
            let limit = |value: f64| (value < UNLIMITED).then(|| StoryNumber::Number(tidy(value)));
            EntityPerformance {
                entity: it.name.clone(),
                limits: DynamicLimits {
                    max_speed_mps: limit(body.most_mps),
                    max_accel_mps2: limit(body.most_accel_mps2),
                    max_decel_mps2: limit(body.most_decel_mps2),
                },
            }
        });
        limited.filter(|it| !it.limits.is_unlimited()).collect()
    }

    fn act(&mut self, number: usize, path: &ValuePath) -> Act {
        let part = &self.parts.0[number];
        self.origins.push((path.clone(), part.node.at()));
        let (start_trigger, stop_trigger) = (
            self.trigger(number, "StartTrigger"),
            self.trigger(number, "StopTrigger"),
        );
        let held = self.relevant(PartKind::ManeuverGroup, Some(number));
        let groups = held.into_iter().enumerate();
        Act {
            name: part.name.clone(),
            start_trigger,
            stop_trigger,
            maneuver_groups: groups
                .map(|(i, group)| self.group(group, &path.to("maneuver_groups").at(i)))
                .collect(),
        }
    }

    fn group(&mut self, number: usize, path: &ValuePath) -> ManeuverGroup {
        let part = &self.parts.0[number];
        self.origins.push((path.clone(), part.node.at()));
        let executions = self.executions(part);
        let present = self.present_actors(number);
        let is_triggering = self.triggering(number);
        let actors = present.iter().map(|it| it.name.clone()).collect();
        let maneuvers = self.relevant(PartKind::Maneuver, Some(number));
        let mut written = Vec::new();
        for maneuver in maneuvers {
            let path = path.to("maneuvers").at(written.len());
            let part = &self.parts.0[maneuver];
            self.origins.push((path.clone(), part.node.at()));
            let held = self.relevant(PartKind::Event, Some(maneuver));
            let events = held.into_iter().enumerate();
            written.push(StoryManeuver {
                name: part.name.clone(),
                events: events
                    .map(|(i, event)| self.event(event, executions, &path.to("events").at(i)))
                    .collect(),
            });
        }
        ManeuverGroup {
            name: part.name.clone(),
            actors,
            actors_are_triggering: self.blockers.keep(is_triggering).unwrap_or(false),
            maximum_execution_count: executions,
            maneuvers: written,
        }
    }

    fn event(&mut self, number: usize, of_group: u32, path: &ValuePath) -> StoryEvent {
        let part = &self.parts.0[number];
        self.origins.push((path.clone(), part.node.at()));
        let start_trigger = self.trigger(number, "StartTrigger");
        let executions = match self.executions(part) {
            // Without a trigger it begins with its maneuver, once.
            _ if start_trigger.is_empty() => 1,
            executions => executions,
        };
        // Targets that are relative to themselves move on with each execution.
        self.repeats = executions.max(of_group) > 1;
        let actions = self.actions(number);
        let places = actions.iter().enumerate().map(|(i, (action, _))| {
            let at = self.parts.0[*action].node.at();
            (path.to("actions").at(i), at)
        });
        // Collected first, because the list of places belongs to the writer, too.
        let found: Vec<_> = places.collect();
        self.origins.extend(found);
        StoryEvent {
            name: part.name.clone(),
            priority: match part.node.raw("priority") {
                Some("override" | "overwrite") => EventPriority::Override,
                Some("skip") => EventPriority::Skip,
                // Files without a priority mean no effect on others, as players do.
                _ => EventPriority::Parallel,
            },
            maximum_execution_count: executions,
            start_trigger,
            actions: actions.into_iter().map(|(_, action)| action).collect(),
        }
    }

    /// Returns the elements of a kind that matter, of one that holds them.
    fn relevant(&self, kind: PartKind, parent: Option<usize>) -> Vec<usize> {
        let all = self.parts.all(kind);
        let matter = all.filter(|it| self.is_relevant[*it] && self.parts.0[*it].parent == parent);
        matter.collect()
    }

    fn executions(&mut self, part: &StoryPart<'_>) -> u32 {
        let name = "maximumExecutionCount";
        if part.node.raw(name).is_none() {
            return 1;
        }
        let stated = part.scope.number(part.node, name).and_then(|often| {
            if often >= 1.0 && often.fract() == 0.0 {
                return Ok(often);
            }
            let what = format!("it is carried out {often} times");
            Err(part.node.refused(what, "write a whole number from 1 on"))
        });
        let count = self.blockers.keep(stated).unwrap_or(1.0);
        if count > MOST_EXECUTIONS {
            self.ground.catalogs.note(UNCOUNTED, part.node);
        }
        // A whole number of this size has the same value as an integer.
        count.min(MOST_EXECUTIONS) as u32
    }

    /// Actors of the group around an element that exist, without the ego.
    fn present_actors(&self, number: usize) -> Vec<&'a EntityInFrame<'a>> {
        let Some(frame) = self.frame else {
            return Vec::new();
        };
        let actors = &self.parts.0[number].actors;
        let all = frame.all.iter();
        let is_actor = |it: &&EntityInFrame<'_>| actors.contains(&it.entity.name);
        all.filter(is_actor)
            // A meeting is a plan of its own, which no story may move.
            .filter(|it| !it.entity.is_ego && it.entity.approach.is_none())
            .collect()
    }

    /// Returns whether agents that trigger the act of an element are its actors, too.
    fn is_triggering(&self, number: usize) -> bool {
        // A wrong word is named where the group is written.
        self.triggering(number).unwrap_or(false)
    }

    fn triggering(&self, number: usize) -> Result<bool, ImportError> {
        let mut around = self.parts.around(number).map(|it| &self.parts.0[it]);
        let group = around.find(|it| it.kind == PartKind::ManeuverGroup);
        match group.and_then(|it| Some((it.node.child("Actors")?, &it.scope))) {
            Some((actors, scope)) => scope.is_true(actors, "selectTriggeringEntities"),
            None => Ok(false),
        }
    }

    /// Returns the name of an entity in the world.
    fn entity(&self, at: &XmlNode, name: &str) -> Result<String, ImportError> {
        let is_known = match &self.frame {
            // Entities far from the road are no agents, though the file places them.
            Some(frame) => frame.all.iter().any(|it| it.entity.name == name),
            None => self.ground.placed.contains_key(name),
        };
        if is_known {
            Ok(agent_name(name))
        } else {
            Err(self.no_entity(at, name))
        }
    }

    fn no_entity(&self, at: &XmlNode, name: &str) -> ImportError {
        let help = "name an entity that the Init places";
        let error = at.refused(format!("no agent is called `{name}`"), help);
        error.following(self.ground.unplaced.iter().any(|it| it == name))
    }

    /// Returns the name of a variable, which the storyboard then declares.
    fn variable(&mut self, at: StatedIn<'_>, name: &str) -> Result<String, ImportError> {
        let declared = |list: &str, element: &str| {
            let list = self.root.child(list).into_iter();
            let mut all = list.flat_map(|it| it.children.iter());
            all.find(|it| it.name == element && it.raw("name") == Some(name))
        };
        let variable = declared("VariableDeclarations", "VariableDeclaration");
        // The Init may set it before anything asks.
        let set = self.set_in_init(name).or(variable);
        let stated = match set {
            Some(variable) => Some(at.scope.text(variable, "value")?),
            None => at.scope.get(name).map(str::to_owned),
        };
        let value = stated.ok_or_else(|| {
            let help = "declare it in the `VariableDeclarations`";
            at.node
                .refused(format!("there is no variable `{name}`"), help)
        })?;
        // Worlds count truth as 1 and 0, which comparisons understand alike.
        let known = match value.as_str() {
            "true" => Some(1.0),
            "false" => Some(0.0),
            text => number(text),
        };
        let first = known.ok_or_else(|| {
            let what = format!("`{name}` is `{value}`, which is no number");
            at.node
                .refused(what, "wait for a number, or for an element")
        })?;
        self.variables
            .insert(name.to_owned(), StoryNumber::Number(first));
        Ok(name.to_owned())
    }

    /// Returns the last `SetAction` of the Init for a variable.
    fn set_in_init(&self, name: &str) -> Option<&'a XmlNode> {
        let init = self
            .root
            .child("Storyboard")?
            .child("Init")?
            .child("Actions")?;
        let global = init.all("GlobalAction");
        let actions = global.filter_map(|it| it.child("VariableAction"));
        let of_it = actions.filter(|it| it.raw("variableRef") == Some(name));
        of_it.filter_map(|it| it.child("SetAction")).last()
    }

    /// Returns whether only the user's ego, or a meeting, decides when an element ends.
    fn is_left(&self, element: usize) -> bool {
        let parts = &self.parts.0;
        let mut inside = self
            .parts
            .all(PartKind::Action)
            .filter(|action| self.parts.around(*action).any(|it| it == element));
        let is_approach = |it: &usize| self.survey.taken.get(it) == Some(&TakenAction::Approach);
        inside.any(|action| is_approach(&action) || self.moves_ego(&parts[action]))
    }

    fn moves_ego(&self, part: &StoryPart<'_>) -> bool {
        let ego = &self.ground.ego.name;
        let is_its = part.actors.iter().any(|it| it == ego);
        let moving = content(part.node).ok().flatten();
        is_its
            && moving.is_some_and(|(kind, node)| {
                let is_still = is_still(node, &part.scope, true).unwrap_or(false);
                kind.name == "PrivateAction" && !is_still
            })
    }

    /// Leaves the motion of the ego to the user, or refuses it.
    fn leave_ego(&mut self) {
        for number in self.parts.all(PartKind::Event).collect::<Vec<_>>() {
            let actions = self.parts.0[number].parts.iter();
            let moving = actions
                .copied()
                .find(|it| self.moves_ego(&self.parts.0[*it]));
            // What never begins moves nobody, and is no matter of the user.
            let begins = self.survey.begins[number].at_s < f64::INFINITY;
            let Some(action) = moving.filter(|_| begins) else {
                continue;
            };
            if self.ground.ego.is_left {
                self.ground.ego.leave(self.parts.0[number].node);
                continue;
            }
            let help = "--leave-ego leaves its events to your controller and lists them";
            let node = content(self.parts.0[action].node).ok().flatten();
            let error = node.map(|(_, node)| node.refused("the ego has a motion of its own", help));
            error.into_iter().for_each(|it| self.blockers.add(it));
        }
    }

    /// Lists actions that change lights and variables and move nobody.
    fn note_dropped(&self) {
        const KINDS: [(&str, &str); 3] = [
            ("InfrastructureAction", "traffic signals"),
            ("ParameterAction", "parameters"),
            ("VariableAction", "variables"),
        ];
        for number in self.parts.all(PartKind::Action) {
            let content = content(self.parts.0[number].node).ok().flatten();
            let kind = content.and_then(|(_, node)| {
                let found = KINDS.iter().find(|(name, _)| *name == node.name)?;
                Some((found.1, node))
            });
            if let Some((kind, node)) = kind.filter(|_| !self.is_relevant[number]) {
                self.ground.catalogs.note(kind, node);
            }
        }
    }
}
