//! A scenario file, and what it is at a point.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::acts::acts;
use super::bodies::ImportedBody;
use super::catalog::Catalogs;
use super::dropped::DropLog;
use super::entity::Entity;
use super::error::{At, ImportError};
use super::files::Files;
use super::motion;
use super::places::{Ground, OnLane, Placed};
use super::points::ImportedPoint;
use super::roads::RoadMap;
use super::scope::Scope;
use super::spot::Spot;
use super::tree::Node;
use super::ways::{Bend, OnWay, Way};

/// What a road's friction may be.
const FRICTIONS: core::ops::RangeInclusive<f64> = 0.01..=2.0;
/// A lane with less than this ahead of the ego leads off the road.
const LEAST_AHEAD_M: f64 = 100.0;

/// A scenario file with its catalogs and roads.
pub(super) struct Protocol {
    root: Node,
    path: PathBuf,
    catalogs: Catalogs,
    roads: RefCell<BTreeMap<PathBuf, Rc<RoadMap>>>,
    /// What the file says that it is.
    pub about: String,
    /// What all files say in vain.
    pub dropped: Rc<DropLog>,
}

/// The ego's road, in whose frame all is said.
#[derive(Clone, Debug)]
pub(super) enum Frame {
    /// Straight on from a place.
    Straight(Spot),
    /// Beside a reference line, so far to its left.
    Beside { road: String, t_m: f64 },
    /// Along a way that bends.
    Along(Way),
}

/// A scenario at a point.
pub(super) struct Concrete {
    pub frame: Frame,
    /// Where a straight frame lies beside its reference line.
    straight_zero_m: f64,
    pub roads: Rc<RoadMap>,
    pub lanes: usize,
    pub lane_width_m: f64,
    /// μ of the ego's road.
    pub friction: f64,
    pub limit_mps: Option<f64>,
    pub entities: Vec<Entity>,
    /// When the file ends the run, if it says so by time.
    pub stop_s: Option<f64>,
    /// The file, for what is refused later.
    pub at: At,
}

impl Protocol {
    pub fn open(path: &Path, files: Files<'_>) -> Result<Protocol, ImportError> {
        let root = Node::read(path, files)?;
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
            root,
        })
    }

    /// The line on which the file ends the run.
    pub fn ends_line(&self) -> usize {
        let board = self.root.child("Storyboard");
        let stop = board.and_then(|it| it.child("StopTrigger"));
        stop.unwrap_or(&self.root).line
    }

    fn declarations(&self) -> Option<&Node> {
        self.root.child("ParameterDeclarations")
    }

    /// The parameters at a point.
    pub fn scope(&self, point: &ImportedPoint) -> Result<Scope, ImportError> {
        let declared = |name: &str| {
            let list = self.declarations();
            let mut list = list
                .into_iter()
                .flat_map(|it| it.all("ParameterDeclaration"));
            list.any(|it| it.raw("name") == Some(name))
        };
        if let Some((name, _)) = point.0.iter().find(|(name, _)| !declared(name)) {
            let what = format!("a point sets `{name}`, which the scenario does not declare");
            return Err(self.root.error(what));
        }
        Scope::declared(self.declarations(), &Scope::default(), &point.0)
    }

    /// What is wrong with a point whose values the file does not allow.
    pub fn broken(&self, scope: &Scope) -> Result<Option<ImportError>, ImportError> {
        let broken = scope.broken(self.declarations())?;
        Ok(broken.map(|declaration| {
            let name = declaration.raw("name").unwrap_or_default();
            let value = scope.get(name).unwrap_or_default();
            let error = declaration.error(format!("{value} breaks its constraints"));
            error.of_point()
        }))
    }

    /// The scenario with these parameters.
    pub fn at(&self, scope: &Scope, files: Files<'_>) -> Result<Concrete, ImportError> {
        let roads = self.road_map(scope, files)?;
        let mut placed: BTreeMap<String, Placed> = BTreeMap::new();
        let mut entities = Vec::new();
        let init = self
            .root
            .inner("Storyboard")?
            .inner("Init")?
            .inner("Actions")?;
        let objects = self.root.inner("Entities")?;
        let objects: Vec<&Node> = objects.all("ScenarioObject").collect();
        let privates: Vec<&Node> = init.all("Private").collect();
        for object in &objects {
            let name = object.need("name")?;
            if !privates.iter().any(|it| it.raw("entityRef") == Some(name)) {
                return Err(object.error("it is not placed"));
            }
        }
        // In the order in which they are placed: some relative to those before.
        for begun in &privates {
            let name = begun.need("entityRef")?;
            let object = objects.iter().find(|it| it.raw("name") == Some(name));
            let object = object.ok_or_else(|| begun.error("there is nobody of this name"))?;
            if placed.contains_key(name) {
                return Err(begun.error("it is placed twice"));
            }
            let (body, own) = match object.only()? {
                it if it.name == "CatalogReference" => self.catalogs.entry(it, scope, files)?,
                it => (it.clone(), scope.clone()),
            };
            let body = ImportedBody::of(&body, &own)?;
            let ground = Ground {
                roads: &roads,
                catalogs: &self.catalogs,
                files,
                placed: &placed,
            };
            let at = motion::begins(begun, scope, ground)?;
            let speed_mps = motion::first_speed_mps(begun, scope, &entities)?;
            let gap_m = motion::first_gap_m(begun, scope, speed_mps)?;
            placed.insert(name.to_owned(), at.clone());
            entities.push(Entity {
                name: name.to_owned(),
                is_ego: name == "Ego",
                body,
                placed: at,
                speed_mps,
                steps: Vec::new(),
                meets: None,
                gap_m,
                at: begun.at(),
            });
        }
        let ground = Ground {
            roads: &roads,
            catalogs: &self.catalogs,
            files,
            placed: &placed,
        };
        let board = self.root.inner("Storyboard")?;
        acts(board, scope, ground, &mut entities)?;
        let ego = entities.iter().find(|it| it.is_ego);
        let asks = privates
            .iter()
            .find(|it| it.raw("entityRef") == Some("Ego"));
        let (Some(ego), Some(asks)) = (ego, asks) else {
            return Err(self.root.error("nobody is called `Ego`"));
        };
        let (frame, zero_m, lanes, lane_width_m) = frame(asks, &roads, ego)?;
        let road = ego.placed.lane.as_ref().map(|at| at.road.as_str());
        let scale = motion::friction_scale(init, scope, ground)?;
        let friction = roads.friction(road)? * scale;
        if !FRICTIONS.contains(&friction) {
            let what = format!("a friction of {friction} is outside of 0.01 ..= 2");
            return Err(init.error(what));
        }
        Ok(Concrete {
            friction,
            limit_mps: roads.limit_mps(road)?,
            frame,
            straight_zero_m: zero_m,
            lanes,
            lane_width_m,
            stop_s: motion::stop_s(board, scope)?,
            at: At::file(self.root.file()),
            entities,
            roads,
        })
    }

    fn road_map(&self, scope: &Scope, files: Files<'_>) -> Result<Rc<RoadMap>, ImportError> {
        let file = self.root.inner("RoadNetwork")?.inner("LogicFile")?;
        let beside = self.path.parent().unwrap_or(Path::new(""));
        let path = beside.join(scope.text(file, "filepath")?);
        if let Some(known) = self.roads.borrow().get(&path) {
            return Ok(Rc::clone(known));
        }
        let root = Node::read(&path, files)?;
        self.dropped.look(&root);
        let map = Rc::new(RoadMap::of(&root)?);
        self.roads.borrow_mut().insert(path, Rc::clone(&map));
        Ok(map)
    }
}

impl Concrete {
    /// A place along the ego's road, to its left, and turned from it; beside a way
    /// that bends one that is not on it is a place in the plane.
    pub fn in_frame(&self, placed: &Placed) -> Result<Spot, ImportError> {
        let refused = |what: String| self.at.error(what);
        match &self.frame {
            Frame::Straight(origin) => Ok(origin.sees(&placed.spot)),
            Frame::Along(way) => Ok(match &placed.way {
                Some(on) if on.way == *way => Spot {
                    x_m: on.along_m,
                    ..on.spot().sees(&placed.spot)
                },
                _ => way.begins.sees(&placed.spot),
            }),
            Frame::Beside { road, t_m } => {
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
                let pieces = root.pieces.iter();
                let along = pieces.filter(|piece| piece.s_m < *s_m).map(|piece| {
                    let way_m = (s_m - piece.s_m).min(piece.length_m);
                    way_m * (1.0 - piece.per_m * t_m)
                });
                let on = root.at(*s_m, *own_t_m);
                Ok(Spot {
                    x_m: along.sum(),
                    y_m: own_t_m - t_m,
                    heading_rad: on.sees(&placed.spot).heading_rad,
                })
            }
        }
    }

    /// The curvature of the ego's lane 0 where its road begins.
    pub fn bend_per_m(&self) -> f64 {
        self.pieces(1.0).first().map_or(0.0, |piece| piece.per_m)
    }

    /// Whether the ego's road is that of a place, too: all are on it but where
    /// the ego turns off.
    pub fn is_on_road(&self, placed: &Placed) -> bool {
        match &self.frame {
            Frame::Along(way) => placed.way.as_ref().is_some_and(|on| on.way == *way),
            Frame::Straight(_) | Frame::Beside { .. } => true,
        }
    }

    /// Whether the ego's lane bends anywhere.
    pub fn bends(&self) -> bool {
        !matches!(self.frame, Frame::Straight(_))
    }

    /// Whether the ego's lane is bent in different ways as it goes on.
    pub fn bends_change(&self) -> bool {
        let pieces = self.pieces(f64::INFINITY);
        pieces.windows(2).any(|pair| pair[0].per_m != pair[1].per_m)
    }

    /// Where lane 0 is beside the reference line of the ego's road.
    pub fn zero_m(&self) -> f64 {
        match &self.frame {
            Frame::Beside { t_m, .. } => *t_m,
            Frame::Straight(_) | Frame::Along(_) => self.straight_zero_m,
        }
    }

    /// The number of the lane in which a place beside lane 0's middle lies.
    pub fn lane_at(&self, left_m: f64) -> f64 {
        let lane = (left_m / self.lane_width_m).round().max(0.0);
        lane.min(self.lanes as f64 - 1.0)
    }

    /// The pieces of the ego's lane 0 for so far; none where it is straight.
    pub fn pieces(&self, until_m: f64) -> Vec<Bend> {
        let (road, t_m) = match &self.frame {
            Frame::Straight(_) => return Vec::new(),
            Frame::Along(way) => return way.pieces.clone(),
            Frame::Beside { road, t_m } => (road, t_m),
        };
        let Some(line) = self.roads.get(road) else {
            return Vec::new();
        };
        let mut left_m = until_m;
        let mut pieces = Vec::new();
        for piece in &line.pieces {
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

/// The frame of the ego's road: its outermost lane, where that is beside the
/// reference line, how many there are, and their width.
fn frame(
    asks: &Node,
    roads: &RoadMap,
    ego: &Entity,
) -> Result<(Frame, f64, usize, f64), ImportError> {
    if let Some(OnWay { way, .. }) = &ego.placed.way {
        let frame = match way.pieces.is_empty() {
            true => Frame::Straight(way.begins),
            false => Frame::Along(way.clone()),
        };
        return Ok((frame, 0.0, 2, 3.5));
    }
    let lane = ego.placed.lane.as_ref().filter(|at| at.lane != 0);
    let at = lane.ok_or_else(|| asks.error("the ego is on no lane and on no way"))?;
    let line = roads.road(asks, &at.road)?;
    let ahead_m = match 0 < at.lane {
        true => at.s_m,
        false => line.length_m - at.s_m,
    };
    if ahead_m < LEAST_AHEAD_M {
        let what = format!(
            "the ego\'s lane {} leads off the road after {ahead_m} m",
            at.lane
        );
        return Err(asks.error(what).of_point());
    }
    if 0 < at.lane {
        let what = format!("the ego drives on lane {}, against its road", at.lane);
        return Err(asks.error(what).of_point());
    }
    let beside = line.driven_beside(at.lane);
    let own = beside.iter().find(|(id, _)| *id == at.lane);
    let width_m = own.map_or(3.5, |(_, width_m)| *width_m);
    let same = beside.iter().all(|(_, other_m)| *other_m == width_m);
    let (outer, lanes) = match (same, beside.len()) {
        // The oncoming lane is drawn as well.
        (true, 1) | (false, _) => (at.lane, 2),
        (true, lanes) => (beside[0].0, lanes),
    };
    let t_m = line.middle_m(asks, outer)?;
    let frame = match line.is_straight() {
        true => Frame::Straight(line.at(0.0, t_m)),
        false => Frame::Beside {
            road: at.road.clone(),
            t_m,
        },
    };
    // Wider lanes than a world may have are fields, not lanes.
    Ok((frame, t_m, lanes, width_m.min(20.0)))
}
