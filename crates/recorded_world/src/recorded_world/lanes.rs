//! Worlds of followings and cut-ins on the lanes of a recording.

use brakecheck_traffic::{
    FittedRoad, LANE_CHANGE_AT_S, LANE_WIDTH_M, PIECE_S, RecordedWorld, SituationKind,
    SituationPlan, SituationRoad,
};

use super::planned_motion::{PlanStep, change_of_speed, own_road, rule, step};
use super::point_columns::{PointColumns, row_comments};
use super::{clock_of, file_name, other_road_users};
use crate::ego::{Acc, Actuated, ControllerSpec};
use crate::pose::Pose;
use crate::road::Direction;
use crate::rulebook::JudgeKind;
use crate::scene::drive::{Actions, Deviation, LaneKeeping, MotionLaw, MotionPlan};
use crate::sim::PlantKind;
use crate::world_file::{
    AdoFile, AgentFile, CommentedWorld, DriveFile, NumberOrRange, RuleFile, ScenarioFile,
    StartFile, TextComment, WorldFile,
};

const FOLLOWING: &str =
    "Does the ego follow a recorded lead that may stray from its recording without a contact?";
const CUT_IN: &str =
    "Does the ego avoid a contact with a recorded cut-in that may stray from its recording?";

/// Returns the world of followings or cut-ins on one road.
pub(super) fn world(recorded: &RecordedWorld) -> CommentedWorld {
    let RecordedWorld {
        name,
        kind,
        road,
        situations,
        ..
    } = recorded;
    let first = &situations[0];
    let is_cut_in = *kind == SituationKind::CutIn;
    let ado = SituationAdo {
        name: if is_cut_in { "ado" } else { "lead" },
        is_cut_in,
        situations,
    };
    let stations: Vec<f64> = situations.iter().map(|it| station_m(road, it)).collect();
    let mut table = PointColumns::default();
    // In this order the table has its columns.
    let agents = vec![ego(&ado, &stations, &mut table), ado.agent(&mut table)];
    let (question, lanes) = if is_cut_in {
        (CUT_IN, 2)
    } else {
        (FOLLOWING, 1)
    };
    let mut world = ScenarioFile::new(
        name.as_str(),
        question,
        clock_of(first),
        own_road(road, lanes, LANE_WIDTH_M, None),
        agents,
        format!("always (ego.{}.gap >= 0.01)", ado.name),
    );
    world.source = sources(situations);
    world.plant = PlantKind::Kinematic;
    // A recorded lead does not react, so its motion after a contact means
    // nothing.
    world.judge = JudgeKind::UntilContact;
    world.points = table.table(situations.len());
    let mut comments = vec![TextComment::heading(heading(road, situations))];
    let origin = origin(road, stations[0], first);
    comments.extend(other_road_users::add(&first.others, origin, &mut world));
    if world.points.is_some() {
        comments.extend(row_comments(situations));
    }
    CommentedWorld {
        world: WorldFile::Scenario(Box::new(world)),
        comments,
    }
}

/// Returns the number of situations, and how exactly world and recording agree.
fn heading(road: &FittedRoad, situations: &[SituationPlan]) -> String {
    let all = || situations.iter();
    let worst_m = all().map(|it| it.speed.worst_m).fold(0.0, f64::max);
    let hardest_mps2 = all().map(|it| it.speed.hardest_mps2()).fold(0.0, f64::max);
    let mut lines = format!(
        "{} recorded situations. Plans are fitted to positions: along the road they stay within\n\
         {worst_m:.3} m of the recording and accelerate by at most {hardest_mps2:.1} m/s².",
        situations.len()
    );
    let across = all().filter_map(|it| it.across).map(|it| it.worst_m);
    if let Some(across_m) = across.reduce(f64::max) {
        lines += &format!("\nAcross the road they stay within {across_m:.2} m.");
    }
    if !road.is_straight() {
        lines += &format!(
            "\nThe road is within {:.2} m of the recorded lane.",
            road.worst_m
        );
    }
    lines
}

/// Returns the names of the recordings, each once.
fn sources(situations: &[SituationPlan]) -> String {
    let mut names: Vec<String> = Vec::new();
    for it in situations {
        let name = file_name(&it.source);
        // A list and no set, so that the order is that of the situations.
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

/// Returns the station of the ego's front: 0 on a straight road.
fn station_m(road: &FittedRoad, plan: &SituationPlan) -> f64 {
    match &plan.road {
        SituationRoad::Lanes(place) if !road.is_straight() => road.place(place.front_m).s_m,
        _ => 0.0,
    }
}

/// Returns the origin of the world in the frame of the recording.
fn origin(road: &FittedRoad, station_m: f64, plan: &SituationPlan) -> Pose {
    match &plan.road {
        SituationRoad::Lanes(place) => {
            let front_m = road.place(place.front_m).s_m;
            road.course.pose(front_m - station_m, 0.0)
        }
        _ => road.course.start(),
    }
}

/// Returns the ego, which keeps its distance as a usual ACC does.
fn ego(ado: &SituationAdo, stations: &[f64], table: &mut PointColumns) -> AgentFile {
    let all = || ado.situations.iter();
    // The right one of two lanes, unless the ado comes from the right.
    let lane = usize::from(ado.is_cut_in && !ado.situations[0].is_from_left());
    let x_m = table.number("ego.x", stations.iter().copied());
    let offset_m = table.number_from(
        LANE_WIDTH_M * lane as f64,
        "ego.lateral",
        all().map(|it| it.across.map_or(0.0, |it| it.ego_m)),
    );
    let speed_mps = table.number("ego.speed", all().map(|it| it.ego_mps));
    let controller = Acc {
        kp_per_s2: 0.3,
        kd_per_s: 1.2,
        standstill_headway_m: 5.7,
        time_gap_s: 0.5,
        max_brake_mps2: 6.0,
        max_accel_mps2: 2.5,
    };
    AgentFile::Vehicle {
        name: "ego".to_owned(),
        body: "sedan".to_owned(),
        road: None,
        lane,
        direction: Direction::default(),
        lane_keeping: LaneKeeping::default(),
        offset_m,
        start: StartFile::At { x_m, speed_mps },
        drive: DriveFile::Ego(Actuated {
            controller: ControllerSpec::from(controller),
            lag_s: 0.4,
        }),
    }
}

/// Road user with a plan from which it may stray.
struct SituationAdo<'a> {
    name: &'a str,
    is_cut_in: bool,
    situations: &'a [SituationPlan],
}

impl SituationAdo<'_> {
    fn agent(&self, table: &mut PointColumns) -> AgentFile {
        let (name, all) = (self.name, || self.situations.iter());
        let first = &self.situations[0];
        // The lane of the ado is beside the ego's in a cut-in, and the ego's otherwise.
        let lane = usize::from(self.is_cut_in && first.is_from_left());
        let headway_m = table.number(
            &format!("{name}.headway"),
            all().map(SituationPlan::headway_m),
        );
        let offset = all().map(|it| it.across.map_or(0.0, |it| it.change.from_m - self.lane_m()));
        let middle_m = LANE_WIDTH_M * lane as f64;
        let offset_m = table.number_from(middle_m, &format!("{name}.lateral"), offset);
        let speed_mps = table.number(&format!("{name}.speed"), all().map(|it| it.speed.start_mps));
        // Three accelerations times the lateral speeds: the neutral action is
        // the middle one.
        let (lateral_mps, neutral) = if self.is_cut_in {
            (vec![-0.3, 0.0, 0.3], 4)
        } else {
            (vec![0.0], 1)
        };
        let ado = AdoFile {
            base: Some(MotionPlan::Script(self.script(table))),
            actions: Actions::Deviate(Deviation {
                accelerations: vec![-1.0, 0.0, 1.0],
                lateral_mps,
            }),
            neutral,
            observe: None,
            rulebook: self.rulebook(),
            learner: None,
            lag_s: 0.0,
        };
        AgentFile::Vehicle {
            name: name.to_owned(),
            body: first.body.name.to_owned(),
            road: None,
            lane,
            direction: Direction::default(),
            lane_keeping: LaneKeeping::default(),
            offset_m,
            start: StartFile::Ahead {
                of: "ego".to_owned(),
                headway_m,
                speed_mps,
            },
            drive: DriveFile::Ado(ado),
        }
    }

    /// Returns the middle of its own lane, relative to that of the ego's lane.
    fn lane_m(&self) -> f64 {
        if self.situations[0].is_from_left() {
            LANE_WIDTH_M
        } else {
            -LANE_WIDTH_M
        }
    }

    /// Returns the steps: a speed per half second, and the lane change on top of them.
    fn script(&self, table: &mut PointColumns) -> Vec<PlanStep> {
        let all = || self.situations.iter();
        let rates: Vec<Vec<f64>> = all().map(|it| it.speed.rates_mps2()).collect();
        let begin = (LANE_CHANGE_AT_S / PIECE_S).round() as usize;
        let mut steps = Vec::new();
        for piece in 0..rates[0].len() {
            let axis = format!("{}.step{}", self.name, piece + 1);
            let to_mps = table.number(
                &format!("{axis}.speed.to"),
                all().map(|it| it.speed.to_mps[piece]),
            );
            let rate_mps2 = table.number(
                &format!("{axis}.speed.rate"),
                rates.iter().map(|it| it[piece]),
            );
            let mut next = step(vec![change_of_speed(to_mps, rate_mps2)]);
            // A lane change is one action, which begins during a step of the speed.
            if piece == begin
                && let Some(change) = self.lane_change(&axis, table)
            {
                next.does.push(change);
                next.overlaps = true;
            }
            steps.push(next);
        }
        steps
    }

    /// Returns the lane change, `None` of a lead that keeps its lane.
    fn lane_change(
        &self,
        axis: &str,
        table: &mut PointColumns,
    ) -> Option<MotionLaw<NumberOrRange>> {
        let across = self.situations.iter().filter_map(|it| it.across);
        let changes: Vec<_> = across.map(|it| it.change).collect();
        let to = changes.iter().map(|it| it.to_m - self.lane_m());
        let most = changes.iter().map(|it| it.most_lateral_mps2());
        (!changes.is_empty()).then(|| MotionLaw::LaneOffset {
            to_m: table.number(&format!("{axis}.lane_offset.to"), to),
            most_lateral_mps2: table.number(&format!("{axis}.lane_offset.most_lateral"), most),
        })
    }

    fn rulebook(&self) -> Vec<RuleFile> {
        let ado = self.name;
        let mut rules = vec![rule(
            "stays near its recording",
            format!("always ({ado}.s - {ado}.planned.s in [-20, 20])"),
        )];
        if self.is_cut_in {
            rules.push(rule(
                "changes lanes within a second of its recording",
                format!("always ({ado}.lateral - {ado}.planned.lateral in [-1, 1])"),
            ));
            // As in UN R157, §5.2.5.2, and with its rear clear of the ego's front.
            rules.push(rule(
                "cuts in with the time that UN R157 asks for",
                format!(
                    "always (rise(abs({ado}.lateral - ego.lateral) <= 2.35) implies \
                     (ego.{ado}.headway >= {:?} and ego.{ado}.ttc > max(ego.speed - {ado}.speed, 0) / 12 + 0.35))",
                    self.situations[0].body.length_m + 1.0
                ),
            ));
        }
        rules.push(rule("never reverses", format!("always ({ado}.speed >= 0)")));
        rules
    }
}
