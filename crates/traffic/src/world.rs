//! Recorded situations that can share a world, as the rows of its table of starts.
//!
//! The worlds themselves are made above this crate, which knows no file.

use std::sync::Arc;

use crate::analysis::Analysis;
use crate::crossings::PathCrossing;
use crate::other_plan::OtherPlan;
use crate::road_fit::{FittedRoad, RoadFit};
use crate::situation_plan::{LANE_WIDTH_M, SituationPlan, SituationRoad, slowing_mps};
use crate::situations::{RecordedCutIn, RecordedFollowing, SituationKind};

/// Roads along lanes of carriageways. Within the tolerance a road is straight.
const LANE_FIT: RoadFit = RoadFit {
    tolerance_m: 0.3,
    piece_m: 10.0,
    most_pieces: 64,
    most_per_m: 0.9 / (2.0 * LANE_WIDTH_M),
};

/// Length of the parts of a carriageway whose situations share a road, and the road before
/// and after such a part, in metres. Worlds have no start beyond 5 km.
const SECTION_M: f64 = 2000.0;
const BEYOND_M: [f64; 2] = [200.0, 700.0];

/// Recorded situations of one world.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedWorld {
    /// Name of the world, also of its file without `.ron`.
    pub name: String,
    /// Kind of its situations.
    pub kind: SituationKind,
    /// Middle of its right lane, and the ego's path in a crossing, in the frame of the
    /// recording.
    pub road: Arc<FittedRoad>,
    /// Situations, in the order of its points. A crossing is alone.
    pub situations: Vec<SituationPlan>,
    /// Greatest distance of the road from the fitted lane in metres, 0 if it is
    /// straight and in a crossing.
    pub road_m: f64,
}

/// Worlds of one kind of situations, the hardest first.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RecordedWorlds {
    /// Worlds, one per road, body, side and place of the planned road user.
    pub worlds: Vec<RecordedWorld>,
    /// Situations in the recordings.
    pub found: usize,
    /// Harder situations left out: the start is interpolated, a road user is recorded for
    /// too short a time or moves as no plan does, a cut-in is not a single lane change, or a crossing has no motor
    /// vehicle.
    pub left_out: usize,
}

/// Situation that may become a point.
enum Candidate {
    Following(RecordedFollowing),
    CutIn(RecordedCutIn),
    Crossing(PathCrossing),
}

impl Candidate {
    fn plan(&self, analysis: &Analysis) -> Option<SituationPlan> {
        match self {
            Candidate::Following(window) => SituationPlan::following(analysis, window),
            Candidate::CutIn(cut_in) => SituationPlan::cut_in(analysis, cut_in),
            Candidate::Crossing(crossing) => SituationPlan::crossing(analysis, crossing),
        }
    }
}

impl RecordedWorlds {
    /// Returns the hardest situations of recordings as worlds.
    ///
    /// A following is harder if the lead loses more speed, a cut-in if the follower must
    /// brake more, and a crossing if its post-encroachment time is shorter. At most `most`
    /// situations become points of worlds that are named `name`, `name_2` and so on.
    pub fn of(
        name: &str,
        kind: SituationKind,
        analyses: &[Analysis],
        most: usize,
    ) -> RecordedWorlds {
        RecordedWorlds::with_others(name, kind, analyses, most, 0)
    }

    /// As [`RecordedWorlds::of`], with the nearest road users as scripted traffic.
    ///
    /// A situation with `others` has a world of its own, because they differ.
    pub fn with_others(
        name: &str,
        kind: SituationKind,
        analyses: &[Analysis],
        most: usize,
        others: usize,
    ) -> RecordedWorlds {
        let mut all: Vec<(f64, usize, Candidate)> = analyses
            .iter()
            .enumerate()
            .flat_map(|(i, it)| candidates(kind, it).map(move |(hard, of)| (hard, i, of)))
            .collect();
        // The sort is stable, so equal situations are in the order of the recordings.
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut result = RecordedWorlds {
            found: all.len(),
            ..RecordedWorlds::default()
        };
        let mut roads = LaneRoads::default();
        let mut groups: Vec<SituationGroup> = Vec::new();
        let mut planned = 0;
        // Planned in the order of hardness, so that a cheap limit keeps the
        // hardest.
        for (_, i, candidate) in &all {
            if most <= planned {
                break;
            }
            let analysis = &analyses[*i];
            let road = |plan: &SituationPlan| roads.of(*i, analysis, plan);
            let Some((mut plan, road)) = candidate.plan(analysis).and_then(|plan| {
                let road = { road }(&plan)?;
                Some((plan, road))
            }) else {
                // Counted, since only harder situations than the last kept one
                // are meant.
                result.left_out += 1;
                continue;
            };
            planned += 1;
            if others > 0 {
                let sample = (plan.time_s / analysis.recording.dt_s).round() as usize;
                // After the plan, because the others must not overlap its two
                // road users.
                plan.others = OtherPlan::nearest(analysis, plan.tracks, sample, others);
            }
            match groups.iter_mut().find(|it| it.fits(&road, &plan)) {
                Some(group) => group.situations.push(plan),
                None => groups.push(SituationGroup {
                    road,
                    situations: vec![plan],
                }),
            }
        }
        let worlds = groups.into_iter().enumerate().map(|(i, group)| {
            let name = match i {
                0 => name.to_owned(),
                _ => format!("{name}_{}", i + 1),
            };
            group.world(name, kind)
        });
        result.worlds = worlds.collect();
        result
    }

    /// Returns the situations of all worlds.
    pub fn situations(&self) -> impl Iterator<Item = &SituationPlan> {
        self.worlds.iter().flat_map(|it| &it.situations)
    }
}

/// Situations of one world, with its road.
struct SituationGroup {
    /// `None` for a crossing.
    road: Option<Arc<FittedRoad>>,
    situations: Vec<SituationPlan>,
}

impl SituationGroup {
    /// Returns true if a situation may be a further point of the world.
    fn fits(&self, road: &Option<Arc<FittedRoad>>, plan: &SituationPlan) -> bool {
        let first = &self.situations[0];
        // A crossing has roads of its own and stays alone.
        let (Some(own), Some(road)) = (&self.road, road) else {
            return false;
        };
        let is_alone = |it: &SituationPlan| !it.others.is_empty();
        // Positions are relative to the road, so straight roads of any lanes are equal.
        let is_straight = own.is_straight() && road.is_straight();
        // A plan that the end of a recording cut has fewer columns than the table.
        let is_as_long = first.speed.to_mps.len() == plan.speed.to_mps.len();
        (is_straight || own == road)
            && is_as_long
            && !is_alone(first)
            && !is_alone(plan)
            && (first.body, first.place(), first.is_from_left())
                == (plan.body, plan.place(), plan.is_from_left())
    }

    fn world(self, name: String, kind: SituationKind) -> RecordedWorld {
        let situations = self.situations;
        let bent = self.road.as_deref().filter(|it| !it.is_straight());
        let road_m = bent.map_or(0.0, |it| it.worst_m);
        let road = match (self.road, &situations[0].road) {
            (None, SituationRoad::Crossing(roads)) => Arc::new(roads.ego.clone()),
            (road, _) => road.unwrap_or_default(),
        };
        RecordedWorld {
            name,
            kind,
            road,
            situations,
            road_m,
        }
    }
}

/// Lane of a recording in one part of a carriageway.
#[derive(Clone, Copy, PartialEq)]
struct LaneSection {
    recording: usize,
    carriageway: usize,
    right_lane_m: f64,
    section: usize,
}

/// Fitted roads along lanes, each fitted once.
#[derive(Default)]
struct LaneRoads {
    all: Vec<(LaneSection, Arc<FittedRoad>)>,
}

impl LaneRoads {
    /// Returns the road of a situation, `Some(None)` for a crossing.
    ///
    /// `None` if the lane is no road.
    fn of(
        &mut self,
        recording: usize,
        analysis: &Analysis,
        plan: &SituationPlan,
    ) -> Option<Option<Arc<FittedRoad>>> {
        let SituationRoad::Lanes(place) = plan.road else {
            return Some(None);
        };
        let lane = LaneSection {
            recording,
            carriageway: place.carriageway,
            right_lane_m: place.right_lane_m,
            // A front bumper may lie before the start of the line.
            section: (place.s_m / SECTION_M).max(0.0) as usize,
        };
        // Situations of a part share a road, so that they can share a world.
        if let Some((_, road)) = self.all.iter().find(|it| it.0 == lane) {
            return Some(Some(Arc::clone(road)));
        }
        // Roads begin early and end late, so that vehicles at the edge of a
        // part have room.
        let from_m = lane.section as f64 * SECTION_M;
        let part_m = from_m - BEYOND_M[0]..from_m + SECTION_M + BEYOND_M[1];
        let path = &analysis.frame.carriageways[lane.carriageway].path;
        // The carriageway's line is its right lane, and the world's right lane
        // may be another.
        let middle = path.moved(|_| lane.right_lane_m, 1.0)?;
        let points: Vec<[f64; 2]> = middle
            .points()
            .filter(|(_, s)| part_m.contains(s))
            .map(|(point, _)| point)
            .collect();
        let road = Arc::new(FittedRoad::fit(&points, LANE_FIT)?);
        self.all.push((lane, Arc::clone(&road)));
        Some(Some(road))
    }
}

fn candidates(
    kind: SituationKind,
    analysis: &Analysis,
) -> Box<dyn Iterator<Item = (f64, Candidate)> + '_> {
    let situations = &analysis.situations;
    match kind {
        SituationKind::Following => {
            let windows = situations.windows(&analysis.recording).into_iter();
            Box::new(windows.map(|it| (slowing_mps(analysis, &it), Candidate::Following(it))))
        }
        SituationKind::CutIn => {
            let cut_ins = situations.cut_ins.iter();
            Box::new(cut_ins.map(|it| (it.at_line.needed_mps2(), Candidate::CutIn(*it))))
        }
        SituationKind::Crossing => {
            let crossings = analysis.crossings.iter();
            // A shorter time is harder, so its sign is turned.
            Box::new(crossings.map(|it| (-it.pet_s(), Candidate::Crossing(*it))))
        }
    }
}
