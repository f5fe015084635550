//! Scenario file, and how its content is read at one point.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::acts::acts;
use super::bodies::ImportedBody;
use super::catalog::Catalogs;
use super::concrete::Concrete;
use super::dropped::DropLog;
use super::ego_events::{EgoEvent, EgoRequest};
use super::entity::{ImportedEntity, ImportedStep};
use super::frame::FrameOfEgo;
use super::lights::lights;
use super::motion;
use super::places::{Placed, PositionContext};
use super::points::ImportedPoint;
use super::relations::{absent, ambiguous, changed_parameters, ordered, steered};
use super::request::Import;
use crate::opendrive::error::{At, ImportError};
use crate::opendrive::files::Files;
use crate::opendrive::roads::RoadMap;
use crate::opendrive::scope::{ParameterScope, number};
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
}

impl Protocol {
    pub(super) fn open(import: &Import<'_>, files: Files<'_>) -> Result<Protocol, ImportError> {
        let path = import.scenario;
        let root = XmlNode::read(path, "OpenSCENARIO", files)?;
        if root.child("Storyboard").is_none() {
            let error = root.error("there is no `Storyboard` in it: it is no scenario");
            return Err(error.helped("a variation file is named with --points"));
        }
        let beside = path.parent().unwrap_or(Path::new(""));
        let header = root.child("FileHeader");
        let about = header
            .and_then(|it| it.raw("description"))
            .unwrap_or_default();
        let dropped = Rc::new(DropLog::default());
        dropped.look(&root);
        Ok(Protocol {
            catalogs: Catalogs::of(&root, beside, Rc::clone(&dropped))?,
            dropped,
            path: path.to_owned(),
            roads: RefCell::default(),
            about: about.to_owned(),
            ego: EgoRequest::new(import.ego.unwrap_or("Ego"), import.leaves_ego),
            maps: import.maps.to_vec(),
            root,
        })
    }

    /// Returns the events that are left to the user's ego.
    pub(super) fn ego_events(&self) -> Vec<EgoEvent> {
        self.ego.events()
    }

    /// Line of the file's StopTrigger.
    pub(super) fn ends_line(&self) -> usize {
        let board = self.root.child("Storyboard");
        let stop = board.and_then(|it| it.child("StopTrigger"));
        stop.unwrap_or(&self.root).line
    }

    /// Returns true if an `Orientation` without a type is relative.
    ///
    /// Up to OpenSCENARIO 1.2 it is absolute.
    fn turns_relative(&self) -> bool {
        let header = self.root.child("FileHeader");
        let minor = header.and_then(|it| it.raw("revMinor"));
        minor.and_then(number).is_some_and(|minor| 3.0 <= minor)
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
            let list = self.declarations();
            let mut list = list
                .into_iter()
                .flat_map(|it| it.all("ParameterDeclaration"));
            list.any(|it| it.raw("name") == Some(name))
        };
        // A misspelled parameter would silently leave its default in place.
        if let Some((name, _)) = point.0.iter().find(|(name, _)| !declared(name)) {
            let what = format!("a point sets `{name}`, which the scenario does not declare");
            return Err(self.root.error(what));
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
            let error = declaration.error(format!("{value} breaks its constraints"));
            error.of_point()
        }))
    }

    /// Returns the scenario with the given parameters.
    ///
    /// # Errors
    ///
    /// Returns an error with file and element for unsupported content.
    pub(super) fn at(
        &self,
        scope: &ParameterScope,
        files: Files<'_>,
    ) -> Result<Concrete, ImportError> {
        let roads = self.road_map(scope, files)?;
        let mut placed: BTreeMap<String, Placed> = BTreeMap::new();
        let mut entities = Vec::new();
        let init = self
            .root
            .inner("Storyboard")?
            .inner("Init")?
            .inner("Actions")?;
        let changed = changed_parameters(&self.root);
        let objects = self.root.inner("Entities")?;
        let objects: Vec<&XmlNode> = objects.all("ScenarioObject").collect();
        let absent = absent(init);
        let privates = motion::present(init, &objects, (&absent, &self.catalogs))?;
        let privates: Vec<&XmlNode> = privates.iter().collect();
        let steered = steered(&self.root, &objects);
        let ambiguous = ambiguous(self.root.inner("Storyboard")?);
        let turns_relative = self.turns_relative();
        for begun in ordered(&privates) {
            let name = begun.need("entityRef")?;
            let object = objects.iter().find(|it| it.raw("name") == Some(name));
            let object = object.ok_or_else(|| begun.error("no agent has this name"))?;
            if placed.contains_key(name) {
                return Err(begun.error("it is placed twice"));
            }
            let (body, own) = match object.only()? {
                it if it.name == "CatalogReference" => self.catalogs.entry(it, scope, files)?,
                it => {
                    let declared = it.child("ParameterDeclarations");
                    (it.clone(), ParameterScope::declared(declared, scope, &[])?)
                }
            };
            let body = ImportedBody::of(&body, &own)?;
            let body = body.beside(entities.iter().map(|it: &ImportedEntity| &it.body));
            let ground = PositionContext {
                roads: &roads,
                catalogs: &self.catalogs,
                files,
                placed: &placed,
                ego: &self.ego,
                changed: &changed,
                steered: &steered,
                absent: &absent,
                turns_relative,
                ambiguous: &ambiguous,
            };
            // `ground` borrows the places so far, so an entity cannot refer to
            // a later entity.
            let (at, route) = motion::begins(begun, scope, ground)?;
            let before = (&entities[..], &body);
            let (speed_mps, ramp) = motion::first_speed_mps(begun, scope, before)?;
            let is_ego = name == self.ego.name;
            // The trajectory of an ego that is left states the speed with which it begins.
            let timed_mps = motion::timed_mps(begun, scope, ground);
            let timed_mps = timed_mps.filter(|_| is_ego && self.ego.is_left);
            let speed_mps = timed_mps.unwrap_or(speed_mps);
            if is_ego && ramp.is_some() && !self.ego.is_left {
                let help = "--leave-ego leaves its events to your controller and lists them";
                return Err(begun.refused("the ego begins with a change of speed", help));
            }
            if is_ego && ramp.is_some() {
                self.ego.leave(begun);
            }
            let first = ramp.filter(|_| !is_ego).map(|law| ImportedStep {
                when: None,
                after_s: 0.0,
                laws: vec![law],
                overlaps: false,
            });
            let gap_m = motion::first_gap_m(begun, scope, (speed_mps, &self.ego.name))?;
            placed.insert(name.to_owned(), at.clone());
            entities.push(ImportedEntity {
                name: name.to_owned(),
                is_ego: name == self.ego.name,
                body,
                placed: at,
                speed_mps,
                steps: first.into_iter().collect(),
                approach: None,
                route,
                gap_m,
                at: begun.at(),
            });
        }
        let ground = PositionContext {
            roads: &roads,
            catalogs: &self.catalogs,
            files,
            placed: &placed,
            ego: &self.ego,
            changed: &changed,
            steered: &steered,
            absent: &absent,
            turns_relative,
            ambiguous: &ambiguous,
        };
        let board = self.root.inner("Storyboard")?;
        let scale = motion::friction_scale(init, scope, ground)?;
        let acts_stop_s = acts(board, scope, (ground, scale), &mut entities)?;
        let ego = entities.iter().find(|it| it.is_ego);
        let asks = privates
            .iter()
            .find(|it| it.raw("entityRef") == Some(&self.ego.name));
        let (Some(_), Some(asks)) = (ego, asks) else {
            let names: Vec<&str> = objects.iter().filter_map(|it| it.raw("name")).collect();
            let what = format!("no agent is called `{}`", self.ego.name);
            let help = format!("name the ego with --ego: {}", names.join(", "));
            return Err(self.root.refused(what, &help));
        };
        // The road of the ego decides: one world has one friction and one speed
        // limit.
        let stop_s = motion::stop_s(board, scope)?.into_iter().chain(acts_stop_s);
        let stop_s = stop_s.reduce(f64::min);
        let FrameOfEgo {
            frame,
            zero_m,
            lanes,
            lane_width_m,
            drive,
        } = FrameOfEgo::of(asks, &roads, (&mut entities, stop_s))?;
        let ego = entities.iter().find(|it| it.is_ego);
        let ego = ego.ok_or_else(|| asks.error("the ego is deleted"))?;
        let road = ego.placed.lane.as_ref().map(|at| at.road.as_str());
        let friction = roads.friction(road)? * scale;
        if !FRICTIONS.contains(&friction) {
            let what = format!("a friction of {friction} is outside of 0.01 ..= 2");
            return Err(init.error(what));
        }
        if drive.is_none() {
            // A trajectory has no heights of its own.
            let heights = roads.all().filter(|(_, road)| road.rises());
            heights.for_each(|(_, road)| self.dropped.note("elevation", &road.node));
        }
        let (drive, left_m) = drive.unwrap_or_default();
        let passed = roads.lane_signals(asks, &drive, left_m)?;
        // A world has one speed limit, or none.
        let limit_mps = roads.limit_mps(road).unwrap_or_else(|_| {
            self.dropped.note("speed limits that change", asks);
            None
        });
        let mut concrete = Concrete {
            grades: roads.lane_grades(asks, &drive, left_m)?,
            lights: lights(&self.root, scope, (&roads, &passed), &self.dropped)?,
            friction,
            limit_mps,
            frame,
            straight_zero_m: zero_m,
            lanes,
            lane_width_m,
            stop_s,
            at: At::file(self.root.file()),
            entities,
            road_ends_m: f64::INFINITY,
            roads,
        };
        for name in concrete.far_off()? {
            let private = privates
                .iter()
                .find(|it| it.raw("entityRef") == Some(&name));
            self.dropped.note(
                "entities that stand far from the road",
                private.unwrap_or(asks),
            );
            concrete.entities.retain(|it| it.name != name);
        }
        concrete.road_ends_m = concrete.unlapped_m();
        Ok(concrete)
    }

    fn road_map(
        &self,
        scope: &ParameterScope,
        files: Files<'_>,
    ) -> Result<Rc<RoadMap>, ImportError> {
        let file = self.root.child("RoadNetwork");
        let file = file.and_then(|it| it.child("LogicFile"));
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
                file.refused(what, &format!("name it with --map {name}=FILE.xodr"))
            }
            _ => error,
        })?;
        self.dropped.look(&root);
        let map = Rc::new(RoadMap::of(&root)?);
        self.roads.borrow_mut().insert(path, Rc::clone(&map));
        Ok(map)
    }
}
