//! Frame of the ego's road, and the ways of entities that leave it.

use core::f64::consts::{FRAC_PI_2, PI};

use super::entity::ImportedEntity;
use super::places::{Placed, beside as beside_lane, is_along};
use crate::opendrive::error::{Blockers, ImportError};
use crate::opendrive::lane_drive::{LaneFollower, LaneRoute, LaneStretch};
use crate::opendrive::roads::OnLane;
use crate::opendrive::roads::RoadMap;
use crate::opendrive::tree::XmlNode;
use crate::opendrive::ways::{MOST_ASIDE_M, OnWay, SAME_WAY_M, SAME_WAY_RAD};
use crate::road::Course;
use crate::sim::{Pose, wrapped};

/// Least length in metres of the ego's lane ahead of the ego on a single road.
const LEAST_AHEAD_M: f64 = 100.0;
/// Least length in metres of the ego's way in all.
const LEAST_WAY_M: f64 = 10.0;
/// Greatest length in metres of a way ahead of its entity.
const MOST_M: f64 = 5_000.0;
/// Longest run in seconds for which ways are read, and their length beyond it.
const USUAL_S: f64 = 60.0;
const BEYOND_M: f64 = 200.0;
/// Least angle in radians between an entity and a lane that it does not follow, which no
/// slant of a lane has.
const TURNED_RAD: f64 = 0.1;
/// Help about an ego that the file deletes.
pub(super) const DELETED: &str = "name another entity with --ego, or keep this one";
/// Tolerance in radians of a pedestrian's direction.
pub(super) const SQUARE_RAD: f64 = 0.02;
/// Usual width of a lane in metres, where the file has none.
const USUAL_WIDTH_M: f64 = 3.5;

/// Frame of the ego's road, to which all places refer.
#[derive(Clone, Debug)]
pub(super) enum RoadFrame {
    /// Straight line from a place.
    Straight(Pose),
    /// Parallel to a reference line, `t_m` to its left.
    Beside { road: String, t_m: f64 },
    /// Bent path.
    Along(Course),
}

/// Frame with the lanes of the world.
pub(super) struct FrameOfEgo {
    pub frame: RoadFrame,
    /// Lateral position of the outermost lane, from the reference line.
    pub zero_m: f64,
    pub lanes: usize,
    pub lane_width_m: f64,
    /// True if all lanes of the world are those of the file.
    pub has_even_lanes: bool,
    /// Lanes of the ego's way, and the offset of lane 0 to the left of them.
    pub drive: Option<(Vec<LaneStretch>, f64)>,
}

impl FrameOfEgo {
    /// Returns the frame of the ego's road, and gives entities that leave it a way.
    ///
    /// # Errors
    ///
    /// Returns an error for an ego without a lane or a way, and for lanes that a
    /// world cannot express.
    pub(super) fn of(
        asks: &XmlNode,
        roads: &RoadMap,
        entities: &mut [ImportedEntity],
        stop_s: Option<f64>,
    ) -> Result<FrameOfEgo, ImportError> {
        let reach_m = reach_m(entities, stop_s);
        let Some(ego) = entities.iter().position(|it| it.is_ego) else {
            return Err(asks.refused("the ego is deleted", DELETED));
        };
        if entities[ego].moves() && entities[ego].placed.way.is_none() {
            entities[ego].face_lane(asks, roads)?;
        }
        let it = if stands_askew(roads, &entities[ego]) {
            FrameOfEgo::ahead_of(&entities[ego])
        } else if keeps_road(asks, roads, entities, ego)? {
            FrameOfEgo::of_road(asks, roads, &entities[ego])?
        } else {
            let of_way = FrameOfEgo::of_way(asks, roads, &mut entities[ego], reach_m);
            match of_way {
                // Its controller may drive off, straight ahead.
                Err(_) if !entities[ego].moves() => FrameOfEgo::ahead_of(&entities[ego]),
                it => it?,
            }
        };
        let mut blockers = Blockers::default();
        for entity in entities.iter_mut().filter(|it| !it.is_ego) {
            blockers.keep(it.place(asks, roads, entity, reach_m));
        }
        blockers.none()?;
        Ok(it)
    }

    /// Frame without lanes of a file.
    fn usual(frame: RoadFrame) -> FrameOfEgo {
        FrameOfEgo {
            frame,
            zero_m: 0.0,
            lanes: 2,
            lane_width_m: USUAL_WIDTH_M,
            has_even_lanes: false,
            drive: None,
        }
    }

    /// Straight frame in the direction of an ego.
    fn ahead_of(ego: &ImportedEntity) -> FrameOfEgo {
        FrameOfEgo::usual(RoadFrame::Straight(ego.placed.spot))
    }

    /// Frame of an ego that stays on one road, or on a trajectory.
    fn of_road(
        asks: &XmlNode,
        roads: &RoadMap,
        ego: &ImportedEntity,
    ) -> Result<FrameOfEgo, ImportError> {
        if let Some(on) = &ego.placed.way {
            if on.has_corners() {
                let help = "--leave-ego leaves its trajectory to your controller";
                return Err(asks.refused("an ego on a way that turns at its places", help));
            }
            // A path has no lanes of its own, so two of a usual width are drawn.
            return Ok(FrameOfEgo::usual(if on.way.piece_count() == 0 {
                RoadFrame::Straight(on.way.start())
            } else {
                RoadFrame::Along(on.way.clone())
            }));
        }
        let Some(at) = &ego.placed.lane else {
            // On a plain without roads.
            return Ok(FrameOfEgo::ahead_of(ego));
        };
        let line = roads.road(asks, &at.road)?;
        let beside = line.driven_beside(at.lane, at.s_m);
        let own = beside.iter().find(|(id, _)| *id == at.lane);
        // A shoulder or a sidewalk has a width, too.
        let own_m = own.map(|(_, width_m)| *width_m);
        let width_m = own_m.or_else(|| line.lanes.width_m(at.s_m, at.lane));
        let width_m = width_m
            .filter(|width_m| *width_m > 0.0)
            .unwrap_or(USUAL_WIDTH_M);
        let same = beside.iter().all(|(_, other_m)| *other_m == width_m);
        let (outer, lanes) = match (same, beside.len()) {
            // A single lane, or lanes of different widths: the ego's lane and the
            // oncoming lane.
            (true, 0 | 1) | (false, _) => (at.lane, 2),
            (true, lanes) => (beside[0].0, lanes),
        };
        // The second lane of the world is then the one across the middle.
        let left_m = line.lanes.width_m(at.s_m, beside_lane(outer, 1));
        let t_m = line.middle_m(asks, outer)?;
        let begins = OnLane {
            lane: outer,
            s_m: 0.0,
            t_m,
            ..at.clone()
        };
        let drive = roads.lane_drive(
            asks,
            &begins,
            LaneRoute {
                via: &[],
                reach_m: line.length_m,
            },
        )?;
        let frame = if line.is_straight() {
            RoadFrame::Straight(line.at(0.0, t_m))
        } else {
            RoadFrame::Beside {
                road: at.road.clone(),
                t_m,
            }
        };
        Ok(FrameOfEgo {
            frame,
            zero_m: t_m,
            lanes,
            drive: Some((drive, 0.0)),
            // Lanes wider than the limit of a world are proving grounds, not lanes.
            lane_width_m: width_m.min(20.0),
            has_even_lanes: same && (beside.len() > 1 || left_m == Some(width_m)),
        })
    }

    /// Frame of an ego that drives along lanes of several roads.
    fn of_way(
        asks: &XmlNode,
        roads: &RoadMap,
        ego: &mut ImportedEntity,
        reach_m: f64,
    ) -> Result<FrameOfEgo, ImportError> {
        let Some(at) = ego.placed.lane.clone().filter(|at| at.lane != 0) else {
            let what = "the ego is on no lane and on no way";
            return Err(asks.refused(what, "place it on a lane, or let it stand"));
        };
        let line = roads.road(asks, &at.road)?;
        let first = line.lanes.first_of(at.driven(), at.s_m, line.length_m);
        let from = OnLane {
            lane: first.0,
            s_m: first.1,
            ..at.clone()
        };
        let drive = roads.lane_drive(
            asks,
            &from,
            LaneRoute {
                via: &ego.route,
                // The way begins behind the ego's place, so it is longer by that part.
                reach_m: reach_m + (from.s_m - at.s_m).abs(),
            },
        )?;
        let in_middle = LaneFollower {
            left_m: 0.0,
            // The user drives the ego, so no slant of its lane delays it.
            slowest_mps: f64::INFINITY,
            may_end: true,
        };
        let on = roads.lane_way(asks, &drive, in_middle)?;
        let width_m = line.lanes.width_m(at.s_m, at.lane).unwrap_or(USUAL_WIDTH_M);
        // The lanes of the first road are drawn where the ego's way has them
        // beside it throughout.
        let beside = roads.lanes_beside(&drive, width_m);
        let left_m = -(beside as f64) * width_m;
        let on = match beside {
            0 => on,
            _ => {
                let beside = LaneFollower {
                    left_m,
                    ..in_middle
                };
                roads.lane_way(asks, &drive, beside)?
            }
        };
        let place = on.located(&ego.placed.spot);
        let off = place.spot().sees(&ego.placed.spot);
        if off.x_m.abs() > SAME_WAY_M {
            let help = "place it on a lane, or name another entity with --ego";
            return Err(asks.refused("the ego is not on the way along its lane", help));
        }
        if place.ends_m - place.along_m < LEAST_WAY_M {
            let what = format!(
                "the ego\'s lane {} leads off the road after {:.1} m",
                at.lane,
                place.ends_m - place.along_m
            );
            let help = "place it farther from the end of its road, or leave the point out with \
                        --skip-broken";
            return Err(asks.refused(what, help).of_point());
        }
        let way = place.way.clone();
        ego.placed.way = Some(place);
        Ok(FrameOfEgo {
            frame: RoadFrame::Along(way),
            zero_m: 0.0,
            lanes: (beside + 1).max(2),
            drive: Some((drive, left_m)),
            lane_width_m: width_m.min(20.0),
            has_even_lanes: false,
        })
    }

    /// Gives an entity a way of its own, or its place on that of the ego.
    fn place(
        &self,
        asks: &XmlNode,
        roads: &RoadMap,
        entity: &mut ImportedEntity,
        reach_m: f64,
    ) -> Result<(), ImportError> {
        let RoadFrame::Along(way) = &self.frame else {
            return self.place_beside(asks, roads, entity, reach_m);
        };
        let frame = OnWay {
            is_lane: true,
            ..OnWay::start(way.clone(), way.end_s_m())
        };
        if entity.placed.way.is_some() {
            return Ok(());
        }
        let turned_rad = way.locate(&entity.placed.spot).heading_rad;
        let is_askew = if entity.moves() {
            is_turned(roads, entity)
        } else {
            !is_square(turned_rad)
        };
        if entity.body.on_foot && is_askew {
            // Who faces off its lane walks straight ahead.
            entity.placed.way = Some(straight_ahead(entity));
            return Ok(());
        }
        if !entity.moves() {
            // A standing entity has a place wherever it is.
            entity.placed.way = Some(frame.located(&entity.placed.spot));
            return Ok(());
        }
        let own = own_way(asks, roads, entity, reach_m)?;
        // A way along that of the ego is replaced by it, so that both share a road.
        entity.placed.way = Some(frame.shared_by(&own).unwrap_or(own));
        Ok(())
    }

    /// The same beside a frame of one road.
    fn place_beside(
        &self,
        asks: &XmlNode,
        roads: &RoadMap,
        entity: &mut ImportedEntity,
        reach_m: f64,
    ) -> Result<(), ImportError> {
        let is_by_t = entity.placed.lane.as_ref().is_some_and(|at| at.lane == 0);
        let stays = !entity.body.on_foot && (is_by_t || !entity.moves());
        if entity.placed.way.is_some() || stays {
            return Ok(());
        }
        let turned_rad = self.turned_rad(asks, roads, entity)?;
        if entity.body.on_foot {
            // Who faces neither along the road nor across it walks straight ahead.
            if !is_square(turned_rad) && entity.approach.is_none() {
                entity.placed.way = Some(straight_ahead(entity));
            }
            return Ok(());
        }
        let follows_road = |turned_rad| is_along(turned_rad, 0.0) || is_along(turned_rad, PI);
        if entity.placed.lane.is_some() || !follows_road(turned_rad) {
            entity.face_lane(asks, roads)?;
        }
        let RoadFrame::Straight(origin) = &self.frame else {
            return Ok(());
        };
        let along = follows_road(self.turned_rad(asks, roads, entity)?);
        let is_beside = match &entity.placed.lane {
            Some(at) => {
                let line = roads.road(asks, &at.road)?;
                let is_straight = line.is_straight() && line.lanes.fixed_m(at.lane).is_some();
                let is_near = origin.sees(&entity.placed.spot).y_m.abs() <= MOST_ASIDE_M;
                along && is_straight && is_near && entity.route.is_empty()
            }
            None => along,
        };
        if !is_beside {
            entity.placed.way = Some(own_way(asks, roads, entity, reach_m)?);
        }
        Ok(())
    }

    /// Angle in radians between an entity and a frame of one road, at its place.
    fn turned_rad(
        &self,
        asks: &XmlNode,
        roads: &RoadMap,
        entity: &ImportedEntity,
    ) -> Result<f64, ImportError> {
        let spot = &entity.placed.spot;
        Ok(match (&self.frame, &entity.placed.lane) {
            (RoadFrame::Straight(origin), _) => origin.sees(spot).heading_rad,
            (_, Some(at)) => {
                let on = roads.road(asks, &at.road)?.at(at.s_m, at.t_m);
                on.sees(spot).heading_rad
            }
            _ => 0.0,
        })
    }
}

/// Returns whether an ego stands off the direction of its lane, so that it drives off from
/// there.
fn stands_askew(roads: &RoadMap, ego: &ImportedEntity) -> bool {
    !ego.moves() && ego.placed.way.is_none() && is_turned(roads, ego)
}

/// Returns whether an entity faces off the direction of its lane.
fn is_turned(roads: &RoadMap, entity: &ImportedEntity) -> bool {
    let on = entity.placed.lane.as_ref();
    let road = on.and_then(|on| Some((on, roads.get(&on.road)?)));
    road.is_some_and(|(on, road)| {
        let lane_rad = road.at(on.s_m, on.t_m).heading_rad + if on.forward { 0.0 } else { PI };
        wrapped(entity.placed.spot.heading_rad - lane_rad).abs() > TURNED_RAD
    })
}

/// Length in metres of the ways that a run needs at most.
fn reach_m(entities: &[ImportedEntity], stop_s: Option<f64>) -> f64 {
    let speeds = entities.iter().map(ImportedEntity::most_mps);
    let fastest_mps = speeds.fold(0.0, f64::max);
    (fastest_mps * stop_s.unwrap_or(USUAL_S).min(USUAL_S) + BEYOND_M).min(MOST_M)
}

/// Returns whether the ego stays on one road whose lanes a world can express.
fn keeps_road(
    asks: &XmlNode,
    roads: &RoadMap,
    entities: &[ImportedEntity],
    ego: usize,
) -> Result<bool, ImportError> {
    let ego = &entities[ego];
    if ego.placed.way.is_some() {
        return Ok(true);
    }
    let Some(at) = ego.placed.lane.as_ref() else {
        return Ok(roads.is_empty());
    };
    if at.lane == 0 {
        return Ok(false);
    }
    let line = roads.road(asks, &at.road)?;
    let others = entities.iter().filter(|it| it.placed.way.is_none());
    let moving = others.clone().filter(|it| it.moves());
    let aside_m = moving
        .filter_map(|it| Some((it.placed.lane.as_ref()?.t_m - at.t_m).abs()))
        .fold(0.0, f64::max);
    let is_here = |it: &Placed| it.lane.as_ref().is_some_and(|lane| lane.road == at.road);
    // Only a straight frame can measure places on other roads.
    let alone = line.is_straight() || others.clone().all(|it| is_here(&it.placed));
    let beside = line.driven_beside(at.lane, at.s_m);
    // Lanes of a world keep their place, so the lanes beside must, too.
    let fixed = beside
        .iter()
        .all(|(id, _)| line.lanes.fixed_m(*id).is_some());
    // A world's own road has right-hand lanes that follow its stations.
    Ok(at.lane < 0
        && at.forward
        && !line.is_left_hand
        && !line.overlaps_itself
        && (line.is_straight() || aside_m <= MOST_ASIDE_M)
        && fixed
        && alone
        && ego.route.is_empty()
        && line.length_m - at.s_m >= LEAST_AHEAD_M)
}

fn straight_ahead(entity: &ImportedEntity) -> OnWay {
    OnWay::start(Course::straight_from(entity.placed.spot), MOST_M)
}

/// Way of an entity along its own lane, from its place on.
///
/// On no lane it moves straight ahead.
fn own_way(
    asks: &XmlNode,
    roads: &RoadMap,
    entity: &mut ImportedEntity,
    reach_m: f64,
) -> Result<OnWay, ImportError> {
    if !entity.body.on_foot {
        entity.face_lane(asks, roads)?;
    }
    if entity.placed.lane.is_none() && !entity.later.keeps_aside {
        let kind = "roads beside agents on no lane, who go straight ahead";
        entity.dropped = (!roads.is_empty()).then_some(kind);
        return Ok(straight_ahead(entity));
    }
    let at = entity.placed.lane.as_ref().filter(|at| at.lane != 0);
    let at = at.ok_or_else(|| {
        let help = "place it by a `LanePosition`, or let it follow a trajectory";
        entity
            .at
            .error("it moves on no lane and on no way")
            .helped(help)
    })?;
    let drive = roads.lane_drive(
        asks,
        at,
        LaneRoute {
            via: &entity.route,
            reach_m,
        },
    )?;
    let line = roads.road(asks, &at.road)?;
    let (middle_m, _) = line.middle_at(asks, at.s_m, at.lane)?;
    // Against the stations, the left of a vehicle is the right of its road.
    let left_m = if at.forward {
        at.t_m - middle_m
    } else {
        middle_m - at.t_m
    };
    let follower = LaneFollower {
        left_m,
        slowest_mps: entity.slowest_mps(),
        may_end: true,
    };
    let on = roads.lane_way(asks, &drive, follower)?;
    if on.way.start().sees(&entity.placed.spot).heading_rad.abs() > SAME_WAY_RAD {
        let help = "let it face along its lane, or let it follow a trajectory";
        return Err(entity.at.error("it moves across its lane").helped(help));
    }
    // Lanes of other roads have other numbers, so changes are only read where
    // all lanes go on alike. Other places across need no number.
    if entity.later.lane_changes > 0 && drive.iter().any(|it| it.road != at.road) {
        let what = "a lane change on a way over several roads is not read";
        return Err(entity.at.error(what).helped("join the roads into one"));
    }
    Ok(on)
}

/// Returns whether a direction is along a road or across it, as those of walkers are.
pub(super) fn is_square(heading_rad: f64) -> bool {
    let mut directions = [0.0, FRAC_PI_2, -FRAC_PI_2, PI, -PI].into_iter();
    directions.any(|it| (heading_rad - it).abs() < SQUARE_RAD)
}
