//! Texts of worlds on the lanes of a recording.

use std::fmt::Write;

use brakecheck_road::pose::Pose;

use crate::other_plan::OtherPlan;
use crate::plan::{PIECE_S, SpeedPlan, rounded};
use crate::road_fit::FittedRoad;
use crate::situation_plan::{LANE_CHANGE_AT_S, LANE_WIDTH_M, SituationPlan, SituationRoad};
use crate::situations::SituationKind;

/// Numbers of a world that differ between its points.
#[derive(Default)]
struct PointColumns {
    axes: Vec<(String, Vec<f64>)>,
}

impl PointColumns {
    /// Returns a number, or the range of an axis if it differs.
    fn number(&mut self, axis: &str, values: impl Iterator<Item = f64>) -> String {
        self.number_from(0.0, axis, values)
    }

    /// As `number`, for an axis whose values are relative to another origin.
    fn number_from(
        &mut self,
        origin: f64,
        axis: &str,
        values: impl Iterator<Item = f64>,
    ) -> String {
        // Rounded first, so that the range and the rows have the same digits.
        let values: Vec<f64> = values.map(rounded).collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if least == most {
            return format!("{least:?}");
        }
        let values = values.into_iter().map(|it| origin + it);
        self.axes.push((axis.to_owned(), values.collect()));
        format!("({least:?}, {most:?})")
    }

    /// Returns the field `points` with a remark per row, empty without an axis.
    fn to_ron(&self, situations: &[SituationPlan]) -> String {
        if self.axes.is_empty() {
            return String::new();
        }
        let axes: Vec<String> = self.axes.iter().map(|it| format!("{:?}", it.0)).collect();
        let rows = situations.iter().enumerate().map(|(i, situation)| {
            let row: Vec<String> = self.axes.iter().map(|it| format!("{:?}", it.1[i])).collect();
            format!(
                "            // {}, at {:.2} s: {} ahead of the ego, which replaces {}\n            [{}],\n",
                file_name(&situation.source),
                situation.time_s,
                plain(&situation.planned),
                plain(&situation.replaced),
                row.join(", ")
            )
        });
        format!(
            "    points: (\n        axes: [{}],\n        rows: [\n{}        ],\n    ),\n",
            axes.join(", "),
            rows.collect::<String>()
        )
    }
}

/// Returns a text that may be in a comment and in a string.
pub(crate) fn plain(text: &str) -> String {
    text.replace(['"', '\\', '\n', '\r'], "_")
}

/// World of followings or cut-ins on one road.
pub(crate) struct LaneText<'a> {
    pub(crate) name: &'a str,
    pub(crate) kind: SituationKind,
    pub(crate) situations: &'a [SituationPlan],
    /// Middle of the right lane, in the frame of the recording.
    pub(crate) road: &'a FittedRoad,
}

impl LaneText<'_> {
    pub(crate) fn to_ron(&self) -> String {
        let LaneText {
            name,
            kind,
            situations,
            road,
        } = *self;
        let mut table = PointColumns::default();
        let all = || situations.iter();
        let first = &situations[0];
        let (question, lanes, ego_lane, ado) = match kind {
            SituationKind::CutIn => (
                "Does the ego avoid a contact with a recorded cut-in that may stray from its recording?",
                2,
                usize::from(!first.is_from_left()),
                "ado",
            ),
            _ => (
                "Does the ego follow a recorded lead that may stray from its recording without a contact?",
                1,
                0,
                "lead",
            ),
        };
        let stations: Vec<f64> = all().map(|it| self.station_m(it)).collect();
        let ego_x = table.number("ego.x", stations.iter().copied());
        let ego_offset = table.number_from(
            LANE_WIDTH_M * ego_lane as f64,
            "ego.lateral",
            all().map(|it| it.across.map_or(0.0, |it| it.ego_m)),
        );
        let ego_mps = table.number("ego.speed", all().map(|it| it.ego_mps));
        let agent = SituationAdo {
            name: ado,
            kind,
            situations,
        }
        .to_ron(&mut table);
        let others = OtherTexts::of(&first.others, self.origin(stations[0], first));
        let worst_m = all().map(|it| it.speed.worst_m).fold(0.0, f64::max);
        let hardest_mps2 = all().map(|it| it.speed.hardest_mps2()).fold(0.0, f64::max);
        let across = all()
            .filter_map(|it| it.across)
            .map(|it| it.worst_m)
            .reduce(f64::max)
            .map_or(String::new(), |it| {
                format!("\n// Across the road they stay within {it:.2} m.")
            });
        let horizon_s = first.speed.to_mps.len() as f64 * PIECE_S;
        let points = table.to_ron(situations);
        let surface = format!("lanes: {lanes}, lane_width_m: {LANE_WIDTH_M:?}, friction: 0.9");
        let (road, bend) = if road.is_straight() {
            (format!("Straight({surface})"), String::new())
        } else {
            let bend = format!(
                "\n// The road is within {:.2} m of the recorded lane.",
                road.worst_m
            );
            (
                format!("Curved({surface}, pieces: {})", road.to_ron()),
                bend,
            )
        };
        format!(
            r#"// {count} recorded situations. Plans are fitted to positions: along the road they stay within
// {worst_m:.3} m of the recording and accelerate by at most {hardest_mps2:.1} m/s².{across}{bend}
Scenario(
    name: "{name}",
    question: "{question}",
    source: "{source}",
    clock: (horizon_s: {horizon_s:?}, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    plant: Kinematic,
    judge: UntilContact,
{counts}    road: {road},
{roads}    agents: [
        Vehicle(
            name: "ego", body: "sedan", lane: {ego_lane}, offset_m: {ego_offset},
            start: At(x_m: {ego_x}, speed_mps: {ego_mps}),
            drive: Ego(Acc(
                kp_per_s2: 0.3, kd_per_s: 1.2,
                standstill_headway_m: 5.7, time_gap_s: 0.5,
                max_brake_mps2: 6.0, max_accel_mps2: 2.5,
                lag_s: 0.4,
            )),
        ),
{agent}{agents}    ],
    ego_spec: "always (ego.{ado}.gap >= 0.01)",
{points})
"#,
            count = situations.len(),
            source = sources(situations),
            counts = others.counts,
            roads = others.roads,
            agents = others.agents,
        )
    }

    /// Returns the station of the ego's front: 0 on a straight road.
    fn station_m(&self, plan: &SituationPlan) -> f64 {
        match &plan.road {
            SituationRoad::Lanes(place) if !self.road.is_straight() => {
                self.road.place(place.front_m).s_m
            }
            _ => 0.0,
        }
    }

    /// Returns the origin of the world in the frame of the recording.
    fn origin(&self, station_m: f64, plan: &SituationPlan) -> Pose {
        match &plan.road {
            SituationRoad::Lanes(place) => {
                let front_m = self.road.place(place.front_m).s_m;
                self.road.course.pose(front_m - station_m, 0.0)
            }
            SituationRoad::Crossing(roads) => roads.ego.course.start(),
        }
    }
}

/// Parts of a world's text for further road users.
#[derive(Default)]
pub(crate) struct OtherTexts {
    /// Field `counts`: only contacts that the ego causes.
    pub(crate) counts: String,
    /// Field `roads`.
    pub(crate) roads: String,
    pub(crate) agents: String,
}

impl OtherTexts {
    /// Returns empty texts without road users. `origin` is that of the world.
    pub(crate) fn of(others: &[OtherPlan], origin: Pose) -> OtherTexts {
        if others.is_empty() {
            return OtherTexts::default();
        }
        let mut texts = OtherTexts::default();
        for (i, other) in others.iter().enumerate() {
            let name = format!("other{}", i + 1);
            texts.roads += &road_entry(&name, &other.road, other.body.width_m + 0.4, origin);
            texts.agents += &other_agent(&name, other);
        }
        OtherTexts {
            counts: "    counts: Contact(closing_mps: 0.5),\n".to_owned(),
            roads: format!("    roads: {{\n{}    }},\n", texts.roads),
            agents: texts.agents,
        }
    }
}

/// Returns a named road of one lane as an entry of `roads`.
pub(crate) fn road_entry(name: &str, road: &FittedRoad, width_m: f64, origin: Pose) -> String {
    let start = origin.sees(&road.course.start());
    let [x, y, heading_rad] = [start.x_m, start.y_m, start.heading_rad].map(rounded);
    // A lane is at least 1 m wide, and the world's own is 3.5 m or more.
    let width_m = rounded(width_m.max(1.0));
    let pieces = road.to_ron();
    format!(
        "        \"{name}\": (at: (x_m: {x:?}, y_m: {y:?}, heading_rad: {heading_rad:?}), \
         lane_width_m: {width_m:?}, pieces: {pieces}),\n"
    )
}

fn other_agent(name: &str, other: &OtherPlan) -> String {
    let body = other.body.name;
    let s_m = rounded(other.s_m);
    let speed_mps = other.speed.as_ref().map_or(0.0, |it| it.start_mps);
    let start = format!("start: At(x_m: {s_m:?}, speed_mps: {speed_mps:?})");
    let on_foot = other.body.is_on_foot();
    let drive = match &other.speed {
        Some(speed) => format!(
            "Script([\n{}            ])",
            script_steps(speed, "                ")
        ),
        None if on_foot => "Scripted(Walk([]))".to_owned(),
        None => "Scripted(Stand)".to_owned(),
    };
    let id = plain(&other.id);
    let agent = agent_head(name, body, name, on_foot);
    format!(
        "        // {id}\n        {agent}\n            {start},\n            drive: {drive},\n        ),\n"
    )
}

/// Returns the first line of an agent in the middle of a named road.
pub(crate) fn agent_head(name: &str, body: &str, road: &str, on_foot: bool) -> String {
    if on_foot {
        format!(
            "Pedestrian(\n            name: \"{name}\", body: \"{body}\", road: \"{road}\", lateral_m: 0.0, facing: Ahead,"
        )
    } else {
        format!("Vehicle(\n            name: \"{name}\", body: \"{body}\", road: \"{road}\",")
    }
}

/// Returns the steps of a script without ranges, a line each.
pub(crate) fn script_steps(speed: &SpeedPlan, indent: &str) -> String {
    let mut text = String::new();
    for (to, rate) in speed.to_mps.iter().zip(speed.rates_mps2()) {
        let rate = rounded(rate);
        // Invariant: writing into a string does not fail.
        let _ = writeln!(
            text,
            "{indent}(does: [Speed(to_mps: {to:?}, rate_mps2: {rate:?})]),"
        );
    }
    text
}

/// Returns the name of a recording's file without its directory.
pub(crate) fn file_name(source: &str) -> String {
    // Sources may have been named on another system.
    plain(source.rsplit(['/', '\\']).next().unwrap_or(source))
}

/// Returns the names of the recordings, each once.
pub(crate) fn sources(situations: &[SituationPlan]) -> String {
    let mut names: Vec<String> = Vec::new();
    for it in situations {
        let name = file_name(&it.source);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names.join(", ")
}

/// Road user with a plan from which it may stray.
struct SituationAdo<'a> {
    name: &'a str,
    kind: SituationKind,
    situations: &'a [SituationPlan],
}

impl SituationAdo<'_> {
    fn to_ron(&self, table: &mut PointColumns) -> String {
        let (name, all) = (self.name, || self.situations.iter());
        let first = &self.situations[0];
        let body = first.body.name;
        // The lane of the ado is beside the ego's in a cut-in, and the ego's otherwise.
        let lane = usize::from(self.kind == SituationKind::CutIn && first.is_from_left());
        let headway = table.number(
            &format!("{name}.headway"),
            all().map(SituationPlan::headway_m),
        );
        let offset = all().map(|it| it.across.map_or(0.0, |it| it.change.from_m - self.lane_m()));
        let middle_m = LANE_WIDTH_M * lane as f64;
        let offset = table.number_from(middle_m, &format!("{name}.lateral"), offset);
        let speed = table.number(&format!("{name}.speed"), all().map(|it| it.speed.start_mps));
        let script = self.script(table);
        let rules: String = self
            .rules()
            .iter()
            .map(|(name, stl)| {
                format!("                    Rule(name: \"{name}\", stl: \"{stl}\"),\n")
            })
            .collect();
        let (actions, neutral) = match self.kind {
            SituationKind::CutIn => ("lateral_mps: [-0.3, 0.0, 0.3]", 4),
            _ => ("lateral_mps: [0.0]", 1),
        };
        format!(
            r#"        Vehicle(
            name: "{name}", body: "{body}", lane: {lane}, offset_m: {offset},
            start: Ahead(of: "ego", headway_m: {headway}, speed_mps: {speed}),
            drive: Ado(
                base: Script([
{script}                ]),
                actions: Deviate(accelerations: [-1.0, 0.0, 1.0], {actions}), neutral: {neutral},
                rulebook: [
{rules}                ],
            ),
        ),
"#
        )
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
    fn script(&self, table: &mut PointColumns) -> String {
        let all = || self.situations.iter();
        let rates: Vec<Vec<f64>> = all().map(|it| it.speed.rates_mps2()).collect();
        let begin = (LANE_CHANGE_AT_S / PIECE_S).round() as usize;
        let mut text = String::new();
        for piece in 0..rates[0].len() {
            let step = format!("{}.step{}", self.name, piece + 1);
            let to = table.number(
                &format!("{step}.speed.to"),
                all().map(|it| it.speed.to_mps[piece]),
            );
            let rate = table.number(
                &format!("{step}.speed.rate"),
                rates.iter().map(|it| it[piece]),
            );
            let mut does = format!("does: [Speed(to_mps: {to}, rate_mps2: {rate})");
            let across: Vec<_> = all()
                .filter_map(|it| it.across)
                .map(|it| it.change)
                .collect();
            // A lane change is one action, which begins during a step of the speed.
            if piece == begin && !across.is_empty() {
                let to = across.iter().map(|it| it.to_m - self.lane_m());
                let to = table.number(&format!("{step}.lane_offset.to"), to);
                let most = across.iter().map(|it| it.most_lateral_mps2());
                let most = table.number(&format!("{step}.lane_offset.most_lateral"), most);
                does = format!(
                    "overlaps: true, {does}, LaneOffset(to_m: {to}, most_lateral_mps2: {most})"
                );
            }
            text += &format!("                    ({does}]),\n");
        }
        text
    }

    fn rules(&self) -> Vec<(&'static str, String)> {
        let ado = self.name;
        let near = format!("always ({ado}.s - {ado}.planned.s in [-20, 20])");
        let forward = format!("always ({ado}.speed >= 0)");
        let mut rules = vec![("stays near its recording", near)];
        if self.kind == SituationKind::CutIn {
            let first = &self.situations[0];
            rules.push((
                "changes lanes within a second of its recording",
                format!("always ({ado}.lateral - {ado}.planned.lateral in [-1, 1])"),
            ));
            // As in UN R157, §5.2.5.2, and with its rear clear of the ego's front.
            rules.push((
                "cuts in with the time that UN R157 asks for",
                format!(
                    "always (rise(abs({ado}.lateral - ego.lateral) <= 2.35) implies \
                     (ego.{ado}.headway >= {:?} and ego.{ado}.ttc > max(ego.speed - {ado}.speed, 0) / 12 + 0.35))",
                    first.body.length_m + 1.0
                ),
            ));
        }
        rules.push(("never reverses", forward));
        rules
    }
}
