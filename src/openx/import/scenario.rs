//! Scenario file, and its content at one point.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::acts::acts;
use super::bodies::ImportedBody;
use super::catalog::Catalogs;
use super::dropped::DropLog;
use super::ego_events::{EgoEvent, EgoRequest};
use super::entity::{ImportedEntity, ImportedStep};
use super::frame::{FrameOfEgo, MOST_ASIDE_M, RoadFrame};
use super::lights::{ImportedLight, lights};
use super::motion;
use super::places::{Placed, PositionContext};
use super::points::ImportedPoint;
use super::relations::{absent, changed_parameters, ordered, steered};
use super::request::Import;
use crate::opendrive::error::{At, ImportError};
use crate::opendrive::files::Files;
use crate::opendrive::roads::{OnLane, RoadMap};
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::Bend;
use crate::road::Grade;
use crate::sim::Pose;

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

/// Scenario at a point.
pub(super) struct Concrete {
    pub frame: RoadFrame,
    /// Lateral position of a straight frame, from its reference line.
    straight_zero_m: f64,
    pub roads: Rc<RoadMap>,
    pub lanes: usize,
    pub lane_width_m: f64,
    /// Friction coefficient μ of the ego's road.
    pub friction: f64,
    pub limit_mps: Option<f64>,
    /// Grades of the ego's road.
    pub grades: Vec<Grade>,
    /// Lights of the ego's road.
    pub lights: Vec<ImportedLight>,
    pub entities: Vec<ImportedEntity>,
    /// Time at which the file ends the run, if it states a time alone.
    pub stop_s: Option<f64>,
    /// Place of the file, for later errors.
    pub at: At,
}

impl Protocol {
    pub(super) fn open(import: &Import<'_>, files: Files<'_>) -> Result<Protocol, ImportError> {
        let path = import.scenario;
        let root = XmlNode::read(path, files)?;
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
            let ground = PositionContext {
                roads: &roads,
                catalogs: &self.catalogs,
                files,
                placed: &placed,
                ego: &self.ego,
                changed: &changed,
                steered: &steered,
                absent: &absent,
            };
            // `ground` borrows the places so far, so an entity cannot refer to
            // a later entity.
            let (at, route) = motion::begins(begun, scope, ground)?;
            let before = (&entities[..], body.most_mps2);
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
        let root = XmlNode::read(&path, files).map_err(|error| match given {
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

impl Concrete {
    /// Names of the entities that stand too far from all ways for a world.
    fn far_off(&self) -> Result<Vec<String>, ImportError> {
        let mut far = Vec::new();
        let others = self.entities.iter().filter(|it| !it.is_ego);
        for entity in others.filter(|it| !it.moves() && it.gap_m.is_none()) {
            let left_m = self.station(&entity.placed)?.y_m;
            let middle_m = self.lane_at(left_m) * self.lane_width_m;
            let is_far = |left_m: f64| MOST_ASIDE_M < left_m.abs();
            // It may stand beside the way of somebody who crosses the ego's road.
            let ways = self.entities.iter().filter_map(|it| it.placed.way.as_ref());
            let mut beside = ways
                .filter_map(|on| on.way.course().ok())
                .map(|course| course.locate(&entity.placed.spot).lateral_m);
            if is_far(left_m - middle_m) && beside.all(is_far) {
                far.push(entity.name.clone());
            }
        }
        Ok(far)
    }

    /// Returns a place in the frame: along the ego's road, to its left, and turned.
    ///
    /// Beside a bent path, a place that is not on the path is a place in the
    /// plane.
    ///
    /// # Errors
    ///
    /// Returns an error for a place on another road than a bent one of the ego.
    pub(super) fn in_frame(&self, placed: &Placed) -> Result<Pose, ImportError> {
        let refused = |what: String| self.at.error(what);
        match &self.frame {
            RoadFrame::Straight(origin) => Ok(origin.sees(&placed.spot)),
            RoadFrame::Along(way) => Ok(match &placed.way {
                Some(on) if on.way == *way => Pose {
                    x_m: on.along_m,
                    ..on.spot().sees(&placed.spot)
                },
                _ => way.begins.sees(&placed.spot),
            }),
            RoadFrame::Beside { .. } if placed.lane.is_none() && placed.way.is_some() => {
                Ok(self.in_plane(&placed.spot))
            }
            RoadFrame::Beside { road, t_m } => {
                let OnLane {
                    road: own,
                    s_m,
                    t_m: own_t_m,
                    ..
                } = placed
                    .lane
                    .as_ref()
                    .ok_or_else(|| refused("a place beside a bend is on no lane".to_owned()))?;
                if own != road {
                    return Err(refused(format!(
                        "a place on road `{own}` beside a bend of `{road}`"
                    )));
                }
                let root = self.roads.get(road);
                let root = root.ok_or_else(|| refused(format!("there is no road `{road}`")))?;
                // The frame is a parallel of the reference line, and its length
                // differs by 1 − κ·t.
                let pieces = root.pieces.iter();
                let along = pieces.filter(|piece| piece.s_m < *s_m).map(|piece| {
                    let way_m = (s_m - piece.s_m).min(piece.length_m);
                    way_m * (1.0 - piece.per_m * t_m)
                });
                let on = root.at(*s_m, *own_t_m);
                Ok(Pose {
                    x_m: along.sum(),
                    y_m: own_t_m - t_m,
                    heading_rad: on.sees(&placed.spot).heading_rad,
                })
            }
        }
    }

    /// Returns a place in the plane of the world.
    pub(super) fn in_plane(&self, spot: &Pose) -> Pose {
        match &self.frame {
            RoadFrame::Straight(origin) => origin.sees(spot),
            RoadFrame::Along(way) => way.begins.sees(spot),
            RoadFrame::Beside { road, t_m } => {
                let line = self.roads.get(road);
                line.map_or(*spot, |line| line.at(0.0, *t_m).sees(spot))
            }
        }
    }

    /// Place along the ego's road and to its left, also beside its bends.
    ///
    /// # Errors
    ///
    /// Returns an error for a place on another road than a bent one of the ego.
    pub(super) fn station(&self, placed: &Placed) -> Result<Pose, ImportError> {
        let way = match &self.frame {
            // Places on the ego's own way have their station there.
            RoadFrame::Along(way) if !self.is_on_road(placed) => way,
            _ => return self.in_frame(placed),
        };
        let course = way.course().map_err(|what| self.at.error(what))?;
        let at = course.locate(&placed.spot);
        Ok(Pose {
            x_m: at.s_m,
            y_m: at.lateral_m,
            heading_rad: at.heading_rad,
        })
    }

    /// Greatest curvature of the ego's lane 0, in 1/m.
    pub(super) fn bends_most_per_m(&self) -> f64 {
        let pieces = self.pieces(f64::INFINITY);
        pieces.iter().map(|it| it.per_m.abs()).fold(0.0, f64::max)
    }

    /// Curvature of the ego's lane 0 at the start of its road, in 1/m.
    pub(super) fn bend_per_m(&self) -> f64 {
        // Any positive length returns the first piece.
        self.pieces(1.0).first().map_or(0.0, |piece| piece.per_m)
    }

    /// Returns true if a place is on the ego's road.
    ///
    /// Every place is, except beside an ego that turns off.
    pub(super) fn is_on_road(&self, placed: &Placed) -> bool {
        match &self.frame {
            RoadFrame::Along(way) => placed.way.as_ref().is_some_and(|on| on.way == *way),
            RoadFrame::Straight(_) | RoadFrame::Beside { .. } => {
                placed.way.as_ref().is_none_or(|on| !on.is_lane)
            }
        }
    }

    /// Returns true if the ego's lane bends anywhere.
    pub(super) fn bends(&self) -> bool {
        !matches!(self.frame, RoadFrame::Straight(_))
    }

    /// Returns true if the curvature of the ego's lane changes.
    pub(super) fn bends_change(&self) -> bool {
        let pieces = self.pieces(f64::INFINITY);
        pieces.windows(2).any(|pair| pair[0].per_m != pair[1].per_m)
    }

    /// Lateral position of lane 0, from the reference line of the ego's road.
    pub(super) fn zero_m(&self) -> f64 {
        match &self.frame {
            RoadFrame::Beside { t_m, .. } => *t_m,
            RoadFrame::Straight(_) | RoadFrame::Along(_) => self.straight_zero_m,
        }
    }

    /// Number of the lane at a lateral distance from the middle of lane 0.
    pub(super) fn lane_at(&self, left_m: f64) -> f64 {
        // Places beside all lanes belong to the nearest lane.
        let lane = (left_m / self.lane_width_m).round().max(0.0);
        lane.min(self.lanes as f64 - 1.0)
    }

    /// Pieces of the ego's lane 0 up to a length. A straight lane has none.
    pub(super) fn pieces(&self, until_m: f64) -> Vec<Bend> {
        let (road, t_m) = match &self.frame {
            RoadFrame::Straight(_) => return Vec::new(),
            RoadFrame::Along(way) => return way.pieces.clone(),
            RoadFrame::Beside { road, t_m } => (road, t_m),
        };
        let Some(line) = self.roads.get(road) else {
            return Vec::new();
        };
        let mut left_m = until_m;
        let mut pieces = Vec::new();
        for piece in &line.pieces {
            // A parallel at t has the length 1 − κ·t times that of the
            // reference line, and the curvature κ / (1 − κ·t).
            let scale = 1.0 - piece.per_m * t_m;
            let length_m = (piece.length_m * scale).min(left_m);
            left_m -= length_m;
            let per_m = piece.per_m / scale;
            pieces.push(Bend { length_m, per_m });
            if left_m <= 0.0 {
                break;
            }
        }
        pieces
    }
}
