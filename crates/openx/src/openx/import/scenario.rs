//! Scenario file, and how its content is read at one point.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::bodies::ImportedBody;
use super::bounds::few;
use super::catalog::Catalogs;
use super::concrete::Concrete;
use super::draft::Draft;
use super::dropped::DropLog;
use super::ego_events::{EgoEvent, EgoRequest};
use super::entity::ImportedEntity;
use super::file_content::{FileContent, absent, changed_parameters, steered, turns_relative};
use super::first_story::with_first_story;
use super::frame::{DELETED, FrameOfEgo};
use super::later::LaterMotion;
use super::lights::lights;
use super::motion;
use super::motion::ordered;
use super::places::{Placed, PositionContext};
use super::points::ImportedPoint;
use super::request::Import;
use super::story::{
    StoryFrame, StoryNumbers, StoryParts, StorySource, StorySurvey, catalog_maneuvers, survey,
    written,
};
use super::world::{draft, seen_scenario};
use crate::opendrive::error::{Blockers, ImportError, UnreadPart};
use crate::opendrive::files::Files;
use crate::opendrive::roads::RoadMap;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;

/// Valid range of friction coefficients.
const FRICTIONS: core::ops::RangeInclusive<f64> = 0.01..=2.0;

/// Scenario file with its catalogs and roads.
pub(super) struct Protocol {
    root: XmlNode,
    path: PathBuf,
    catalogs: Catalogs,
    roads: RefCell<BTreeMap<PathBuf, Rc<RoadMap>>>,
    /// Description of the file.
    pub about: String,
    /// Elements of all files that have no effect.
    pub dropped: Rc<DropLog>,
    ego: EgoRequest,
    /// Road files by the name of a map.
    maps: Vec<(String, PathBuf)>,
    /// True if it is read at several points.
    varies: bool,
}

/// Content of a scenario, in the frame of its files.
struct BegunScenario<'a> {
    /// `Private` of the ego.
    asks: &'a XmlNode,
    init: &'a XmlNode,
    privates: &'a [&'a XmlNode],
    roads: Rc<RoadMap>,
    entities: Vec<ImportedEntity>,
    /// Factor on the friction of all roads.
    scale: f64,
    stop_s: Option<f64>,
}

/// Entities of an Init, as far as they have been read.
#[derive(Default)]
struct BegunEntities {
    entities: Vec<ImportedEntity>,
    /// Their places, by name.
    placed: BTreeMap<String, Placed>,
    /// Names of those that have a problem.
    unread: Vec<String>,
}

impl BegunEntities {
    fn add(&mut self, entity: ImportedEntity) {
        self.placed
            .insert(entity.name.clone(), entity.placed.clone());
        self.entities.push(entity);
    }
}

impl Protocol {
    pub(super) fn open(import: &Import<'_>, files: Files<'_>) -> Result<Protocol, ImportError> {
        let path = import.scenario;
        let root = XmlNode::read(path, "OpenSCENARIO", files)?;
        if root.child("Storyboard").is_none() {
            let error = root.error("there is no `Storyboard` in it: it is no scenario");
            return Err(error.helped("a variation file is named with --points"));
        }
        // Before anything walks through the file, whose size it bounds.
        few(&root)?;
        let beside = path.parent().unwrap_or(Path::new(""));
        let header = root.child("FileHeader");
        let about = header
            .and_then(|it| it.raw("description"))
            .unwrap_or_default();
        let dropped = Rc::new(DropLog::default());
        dropped.look(&root);
        Ok(Protocol {
            catalogs: Catalogs::of(&root, beside, Rc::clone(&dropped)),
            dropped,
            path: path.to_owned(),
            roads: RefCell::default(),
            about: about.to_owned(),
            ego: EgoRequest::new(import.ego.unwrap_or("Ego"), import.leaves_ego),
            maps: import.maps.to_vec(),
            varies: import.points.is_some(),
            root,
        })
    }

    /// Returns the events that are left to the user's ego.
    pub(super) fn ego_events(&self) -> Vec<EgoEvent> {
        self.ego.events()
    }

    /// Element that ends the run: the StopTrigger, or the whole file.
    pub(super) fn ends(&self) -> &XmlNode {
        let board = self.root.child("Storyboard");
        let stop = board.and_then(|it| it.child("StopTrigger"));
        stop.unwrap_or(&self.root)
    }

    /// Returns the number of elements of the file.
    pub(super) fn elements(&self) -> usize {
        self.root.count()
    }

    fn declarations(&self) -> Option<&XmlNode> {
        self.root.child("ParameterDeclarations")
    }

    /// Returns the parameters at a point.
    ///
    /// # Errors
    ///
    /// Returns an error for a value of an undeclared parameter.
    pub(super) fn scope(&self, point: &ImportedPoint) -> Result<ParameterScope, ImportError> {
        let declared = |name: &str| {
            let mut list = self
                .declarations()
                .into_iter()
                .flat_map(|it| it.all("ParameterDeclaration"));
            list.any(|it| it.raw("name") == Some(name))
        };
        // A misspelled parameter would silently leave its default in place.
        if let Some((name, _)) = point.0.iter().find(|(name, _)| !declared(name)) {
            let what = format!("a point sets `{name}`, which the scenario does not declare");
            let help = "correct its name, or declare it in the scenario";
            return Err(self.root.refused(what, help));
        }
        ParameterScope::declared(self.declarations(), &ParameterScope::default(), &point.0)
    }

    /// Returns the error of a point whose values break a constraint of the file.
    pub(super) fn broken(
        &self,
        scope: &ParameterScope,
    ) -> Result<Option<ImportError>, ImportError> {
        let broken = scope.broken(self.declarations())?;
        Ok(broken.map(|declaration| {
            let name = declaration.raw("name").unwrap_or_default();
            let value = scope.get(name).unwrap_or_default();
            let help = "change its value, or leave such points out with --skip-broken";
            let error = declaration.refused(format!("{value} breaks its constraints"), help);
            error.of_point()
        }))
    }

    /// Returns the world of the scenario with the given parameters.
    ///
    /// # Errors
    ///
    /// Returns all problems with file and element as one error.
    pub(super) fn draft_at(
        &self,
        scope: &ParameterScope,
        files: Files<'_>,
        ado: Option<&str>,
    ) -> Result<Draft, ImportError> {
        let mut blockers = Blockers::default();
        let drafted = self.drafted(scope, files, ado, &mut blockers);
        blockers.none()?;
        drafted.ok_or_else(|| self.root.refused("it is not read", "report this file"))
    }

    /// Returns the world, or `None` with problems.
    fn drafted(
        &self,
        scope: &ParameterScope,
        files: Files<'_>,
        ado: Option<&str>,
        blockers: &mut Blockers,
    ) -> Option<Draft> {
        let (board, objects) = blockers.keep(self.parts())?;
        let board = &with_first_story(board, &self.ego, scope);
        let init = board.inner("Init").and_then(|it| it.inner("Actions"));
        let rest = UnreadPart::RestOfScenario;
        let init = blockers.keep(init.map_err(|error| error.before(rest)))?;
        let unread = |error: ImportError| error.before(UnreadPart::OnTheRoads);
        let roads = blockers
            .keep(self.road_map(scope, files).map_err(unread))
            .unwrap_or_else(|| Rc::new(RoadMap::unread()));
        blockers.keep(self.catalogs.sound());
        let content = FileContent {
            catalogs: &self.catalogs,
            files,
            ego: &self.ego,
            roads,
            absent: absent(init),
            changed: changed_parameters(&self.root),
            steered: steered(&self.root, &objects),
            turns_relative: turns_relative(&self.root),
        };
        // In the order of the file, so that all points of a world share their names.
        let numbers = StoryNumbers::new(self.varies);
        let present = motion::present(init, &objects, &content.absent, &self.catalogs, blockers);
        let privates: Vec<&XmlNode> = present.iter().collect();
        let mut begun = BegunEntities::default();
        for private in ordered(&privates) {
            // An entity cannot refer to a later one.
            let ground = content.ground(&begun.placed, &begun.unread);
            let read = self.entity(private, scope, ground, &objects, &begun.entities);
            match blockers.keep(read) {
                Some(entity) => begun.add(entity),
                None => begun
                    .unread
                    .extend(private.raw("entityRef").map(str::to_owned)),
            }
        }
        let BegunEntities {
            mut entities,
            placed,
            unread,
        } = begun;
        let ground = content.ground(&placed, &unread);
        let scale = blockers
            .keep(motion::friction_scale(init, scope, ground))
            .unwrap_or(1.0);
        let catalogs = catalog_maneuvers(board, scope, ground, blockers);
        let parts = StoryParts::of(board, scope, &catalogs, blockers);
        let survey = survey(&parts, ground, &mut entities, blockers);
        // Nobody can meet them, and what refers to them has a problem of its own.
        entities.retain(|it| !survey.gone.contains(&it.name));
        let stop_s = blockers
            .keep(motion::stop_s(board, scope, &self.dropped))
            .flatten();
        let source = StorySource {
            root: &self.root,
            parts: &parts,
            survey: &survey,
            ground,
            numbers: &numbers,
            friction_scale: scale,
        };
        let asks = privates
            .iter()
            .find(|it| it.raw("entityRef") == Some(&self.ego.name));
        let concrete = match asks {
            None => {
                blockers.add(self.no_ego(&objects));
                None
            }
            // All else refers to the roads and to the ego.
            Some(_) if content.roads.is_unread() || unread.contains(&self.ego.name) => None,
            Some(asks) => {
                let begun = BegunScenario {
                    asks,
                    init,
                    privates: &privates,
                    roads: Rc::clone(&content.roads),
                    entities,
                    scale,
                    stop_s,
                };
                blockers.keep(self.concrete(begun, scope, &survey))
            }
        };
        let read = concrete.as_ref().map(seen_scenario);
        let seen = read.and_then(|seen| blockers.keep(seen));
        let both = concrete.as_ref().zip(seen.as_ref());
        // Without a frame the storyboard is still read, so that one message names all.
        let frame = both.map(|(concrete, seen)| StoryFrame {
            concrete,
            all: &seen.all,
        });
        let story = written(source, frame, blockers);
        let (concrete, seen) = (concrete.as_ref()?, seen.as_ref()?);
        // With problems it is a part of the scenario, which may have more of them.
        blockers.keep(draft(concrete, seen, story, numbers.parameters(), ado))
    }

    /// Returns the storyboard and the entities.
    ///
    /// # Errors
    ///
    /// Returns an error for a missing part, and for a file without the ego.
    fn parts(&self) -> Result<(&XmlNode, Vec<&XmlNode>), ImportError> {
        let unread = |error: ImportError| error.before(UnreadPart::RestOfScenario);
        let board = self.root.inner("Storyboard").map_err(unread)?;
        let objects: Vec<&XmlNode> = self
            .root
            .inner("Entities")
            .map_err(unread)?
            .all("ScenarioObject")
            .collect();
        // Whether a motion is read depends on whether it is that of the ego.
        let is_ego = |it: &&XmlNode| it.raw("name") == Some(&self.ego.name);
        if !objects.iter().any(is_ego) {
            return Err(unread(self.no_ego(&objects)));
        }
        // References to two entities of one name would be ambiguous.
        let mut known = BTreeSet::new();
        let second = objects.iter().find(|it| !known.insert(it.raw("name")));
        if let Some(second) = second.filter(|it| it.raw("name").is_some()) {
            let help = "give each entity a name of its own";
            return Err(unread(second.refused("a second entity of this name", help)));
        }
        Ok((board, objects))
    }

    /// Returns the scenario in the frame of its ego.
    fn concrete(
        &self,
        begun: BegunScenario<'_>,
        scope: &ParameterScope,
        survey: &StorySurvey,
    ) -> Result<Concrete, ImportError> {
        let BegunScenario {
            asks,
            init,
            privates,
            roads,
            mut entities,
            scale,
            stop_s,
        } = begun;
        let FrameOfEgo {
            frame,
            zero_m,
            lanes,
            lane_width_m,
            has_even_lanes,
            drive,
        } = FrameOfEgo::of(asks, &roads, &mut entities, stop_s)?;
        let ego = entities
            .iter()
            .find(|it| it.is_ego)
            .ok_or_else(|| asks.refused("the ego is deleted", DELETED))?;
        let road = ego.placed.lane.as_ref().map(|at| at.road.as_str());
        let mut blockers = Blockers::default();
        // A world has one friction. The least is the hardest for its ego.
        let of_road = roads.friction(road).unwrap_or_else(|_| {
            self.dropped.note("friction that changes", asks);
            roads.least_friction(road)
        });
        let friction = of_road * scale;
        if !FRICTIONS.contains(&friction) {
            let what = format!("a friction of {friction} is outside of 0.01 ..= 2");
            let help = "change the frictionScaleFactor, or the friction of the material";
            blockers.add(init.refused(what, help));
        }
        // Grades have slopes, and a step has none.
        let steps = roads.all().filter(|(_, road)| road.has_steps());
        steps.for_each(|(_, road)| self.dropped.note("steps of the elevation", &road.node));
        if drive.is_none() {
            // A trajectory has no heights of its own.
            let heights = roads.all().filter(|(_, road)| road.rises());
            heights.for_each(|(_, road)| self.dropped.note("elevation", &road.node));
        }
        for entity in &entities {
            let across = "the direction of a lane for pedestrians that face across it";
            let walks = entity.walks_across(&roads).then_some(across);
            let Some(kind) = entity.dropped.or(walks) else {
                continue;
            };
            let private = privates
                .iter()
                .find(|it| it.raw("entityRef") == Some(&entity.name));
            self.dropped.note(kind, private.unwrap_or(&asks));
        }
        let (drive, left_m) = drive.unwrap_or_default();
        let passed = blockers
            .keep(roads.lane_signals(asks, &drive, left_m))
            .unwrap_or_default();
        // A world has one speed limit, or none.
        let limit_mps = roads.limit_mps(road).unwrap_or_else(|_| {
            self.dropped.note("speed limits that change", asks);
            None
        });
        let grades = blockers.keep(roads.lane_grades(asks, &drive, left_m));
        let lights = blockers.keep(lights(&self.root, scope, &roads, &passed, &self.dropped));
        blockers.none()?;
        let mut concrete = Concrete {
            grades: grades.unwrap_or_default(),
            lights: lights.unwrap_or_default(),
            friction,
            limit_mps,
            frame,
            straight_zero_m: zero_m,
            lanes,
            lane_width_m,
            has_even_lanes,
            stop_s,
            ends_at: self.ends().at(),
            ego_at: asks.at(),
            entities,
            road_ends_m: f64::INFINITY,
            roads,
        };
        for name in concrete.far_off(|name| survey.names.contains(name))? {
            let private = privates
                .iter()
                .find(|it| it.raw("entityRef") == Some(&name));
            self.dropped.note(
                "entities that stand far from the road",
                private.unwrap_or(&asks),
            );
            concrete.entities.retain(|it| it.name != name);
        }
        // Last, because entities far from the road must not decide on its length.
        concrete.road_ends_m = concrete.unlapped_m();
        Ok(concrete)
    }

    /// Reads an entity of the Init: its body, its place and its first speed.
    fn entity(
        &self,
        begun: &XmlNode,
        scope: &ParameterScope,
        ground: PositionContext<'_>,
        objects: &[&XmlNode],
        before: &[ImportedEntity],
    ) -> Result<ImportedEntity, ImportError> {
        let name = begun.need("entityRef")?;
        let object = objects
            .iter()
            .find(|it| it.raw("name") == Some(name))
            .ok_or_else(|| {
                begun.refused(
                    "no agent has this name",
                    "name a `ScenarioObject` of the file",
                )
            })?;
        if ground.placed.contains_key(name) {
            let help = "join both `Private` of the entity";
            return Err(begun.refused("it is placed twice", help));
        }
        let mut blockers = Blockers::default();
        let body = blockers.keep(self.body(object, scope, ground.files));
        let body = body.map(|body| body.beside(before.iter().map(|it| &it.body)));
        let begins = blockers.keep(motion::begins(begun, scope, ground));
        let first = motion::first_speed_mps(begun, scope, before, body.as_ref(), ground.unplaced);
        let speed_mps = blockers.keep(first).unwrap_or_default();
        let is_ego = name == self.ego.name;
        // The trajectory of an ego that is left states the speed with which it begins.
        let timed_mps =
            motion::timed_mps(begun, scope, ground).filter(|_| is_ego && self.ego.is_left);
        let speed_mps = timed_mps.unwrap_or(speed_mps);
        blockers.none()?;
        let (Some(body), Some((placed, route))) = (body, begins) else {
            return Err(begun.refused("it is not read", "report this file"));
        };
        Ok(ImportedEntity {
            name: name.to_owned(),
            is_ego,
            body,
            gap_m: None,
            dropped: None,
            placed,
            speed_mps,
            later: LaterMotion::default(),
            approach: None,
            route,
            at: begun.at(),
        })
    }

    fn body(
        &self,
        object: &XmlNode,
        scope: &ParameterScope,
        files: Files<'_>,
    ) -> Result<ImportedBody, ImportError> {
        let (body, own) = match object.only()? {
            it if it.name == "CatalogReference" => self.catalogs.entry(it, scope, files)?,
            it => {
                let declared = it.child("ParameterDeclarations");
                (it.clone(), ParameterScope::declared(declared, scope, &[])?)
            }
        };
        ImportedBody::of(&body, &own)
    }

    /// Error of a file whose ego has another name, or no place.
    fn no_ego(&self, objects: &[&XmlNode]) -> ImportError {
        let name = &self.ego.name;
        let own = objects.iter().find(|it| it.raw("name") == Some(name));
        if let Some(object) = own {
            let help = "place it in Init by a `TeleportAction`, or name another with --ego";
            return object.refused("the ego is never placed", help);
        }
        let names: Vec<&str> = objects.iter().filter_map(|it| it.raw("name")).collect();
        let help = format!("name the ego with --ego: {}", names.join(", "));
        self.root
            .refused(format!("no agent is called `{name}`"), &help)
    }

    /// Returns the name of a given map that no point has used.
    pub(super) fn unused_map(&self) -> Option<&str> {
        let read = self.roads.borrow();
        let unused = self.maps.iter().find(|(_, path)| !read.contains_key(path));
        unused.map(|(name, _)| name.as_str())
    }

    fn road_map(
        &self,
        scope: &ParameterScope,
        files: Files<'_>,
    ) -> Result<Rc<RoadMap>, ImportError> {
        let file = self
            .root
            .child("RoadNetwork")
            .and_then(|it| it.child("LogicFile"));
        let name = file.map(|file| scope.text(file, "filepath")).transpose()?;
        // Without a road file, everybody is on a plain.
        let Some((file, name)) = file.zip(name).filter(|(_, name)| !name.is_empty()) else {
            return Ok(Rc::default());
        };
        let beside = self.path.parent().unwrap_or(Path::new(""));
        let given = self.maps.iter().find(|(known, _)| *known == name);
        let path = given.map_or_else(|| beside.join(&name), |(_, path)| path.clone());
        // Points often share a road file, which is parsed once.
        if let Some(known) = self.roads.borrow().get(&path) {
            return Ok(Rc::clone(known));
        }
        let root = XmlNode::read(&path, "OpenDRIVE", files).map_err(|error| match given {
            None if !name.ends_with(".xodr") => {
                let what = format!("the road file of the map `{name}` is not known");
                file.refused(what, &format!("name it with --road {name}=FILE.xodr"))
            }
            _ => error,
        })?;
        self.dropped.look(&root);
        let map = Rc::new(RoadMap::of(&root)?);
        self.roads.borrow_mut().insert(path, Rc::clone(&map));
        Ok(map)
    }
}
