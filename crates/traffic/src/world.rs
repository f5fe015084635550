//! World files from recorded situations, which are the rows of their tables of starts.

use crate::analysis::Analysis;
use crate::plan::{PIECE_S, rounded};
use crate::situation_plan::{LANE_CHANGE_AT_S, SituationPlan, StockBody, slowing_mps};
use crate::situations::{RecordedCutIn, RecordedFollowing};

/// Width of the lanes of a generated world in metres.
const LANE_WIDTH_M: f64 = 3.75;

/// Kind of recorded situations that become worlds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SituationKind {
    /// Windows of 10 s in which a vehicle follows the same lead.
    Following,
    /// Lane changes in front of a follower.
    CutIn,
}

/// World file of recorded situations.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct RecordedWorld {
    /// Name of the world, also of its file without `.ron`.
    pub name: String,
    /// RON text of the world.
    pub text: String,
    /// Situations, in the order of its points.
    pub situations: Vec<SituationPlan>,
}

/// World files of one kind of situations, the hardest first.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RecordedWorlds {
    /// Worlds, one per body, side and place of the planned road user.
    pub worlds: Vec<RecordedWorld>,
    /// Situations in the recordings.
    pub found: usize,
    /// Harder situations left out: the start is interpolated, a vehicle is recorded for
    /// too short a time, or a cut-in is not a single lane change.
    pub left_out: usize,
}

/// Situation that may become a point.
enum Candidate {
    Following(RecordedFollowing),
    CutIn(RecordedCutIn),
}

impl RecordedWorlds {
    /// Returns the hardest situations of recordings as worlds.
    ///
    /// A following is harder if the lead loses more speed, and a cut-in if the follower
    /// must brake more. At most `most` situations become points of worlds that are named
    /// `name`, `name_2` and so on. No recorded position is in their texts.
    pub fn of(
        name: &str,
        kind: SituationKind,
        analyses: &[Analysis],
        most: usize,
    ) -> RecordedWorlds {
        let all = analyses.iter().flat_map(|it| candidates(kind, it));
        let mut all: Vec<(f64, &Analysis, Candidate)> = all.collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut result = RecordedWorlds {
            found: all.len(),
            ..RecordedWorlds::default()
        };
        let mut groups: Vec<Vec<SituationPlan>> = Vec::new();
        let mut planned = 0;
        for (_, analysis, candidate) in &all {
            if most <= planned {
                break;
            }
            let plan = match candidate {
                Candidate::Following(window) => SituationPlan::following(analysis, window),
                Candidate::CutIn(cut_in) => SituationPlan::cut_in(analysis, cut_in),
            };
            let Some(plan) = plan else {
                result.left_out += 1;
                continue;
            };
            planned += 1;
            let same_world = |it: &&mut Vec<SituationPlan>| {
                let [a, b] = [&it[0], &plan];
                (a.body, a.place(), a.is_from_left()) == (b.body, b.place(), b.is_from_left())
            };
            match groups.iter_mut().find(same_world) {
                Some(group) => group.push(plan),
                None => groups.push(vec![plan]),
            }
        }
        let worlds = groups.into_iter().enumerate().map(|(i, situations)| {
            let name = match i {
                0 => name.to_owned(),
                _ => format!("{name}_{}", i + 1),
            };
            RecordedWorld {
                text: text(&name, kind, &situations),
                name,
                situations,
            }
        });
        result.worlds = worlds.collect();
        result
    }

    /// Returns the situations of all worlds.
    pub fn situations(&self) -> impl Iterator<Item = &SituationPlan> {
        self.worlds.iter().flat_map(|it| &it.situations)
    }
}

fn candidates(kind: SituationKind, analysis: &Analysis) -> Vec<(f64, &Analysis, Candidate)> {
    let situations = &analysis.situations;
    match kind {
        SituationKind::Following => situations
            .windows(&analysis.recording)
            .into_iter()
            .map(|it| {
                (
                    slowing_mps(analysis, &it),
                    analysis,
                    Candidate::Following(it),
                )
            })
            .collect(),
        SituationKind::CutIn => situations
            .cut_ins
            .iter()
            .map(|it| (it.at_line.needed_mps2(), analysis, Candidate::CutIn(*it)))
            .collect(),
    }
}

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
            let row = self.axes.iter().map(|it| format!("{:?}", it.1[i]));
            let row: Vec<String> = row.collect();
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
fn plain(text: &str) -> String {
    text.replace(['"', '\\', '\n', '\r'], "_")
}

fn text(name: &str, kind: SituationKind, situations: &[SituationPlan]) -> String {
    let mut table = PointColumns::default();
    let all = || situations.iter();
    let first = &situations[0];
    let (question, road, ego_lane, ado) = match kind {
        SituationKind::Following => (
            "Does the ego follow a recorded lead that may stray from its recording without a contact?",
            1,
            0,
            "lead",
        ),
        SituationKind::CutIn => (
            "Does the ego avoid a contact with a recorded cut-in that may stray from its recording?",
            2,
            usize::from(!first.is_from_left()),
            "ado",
        ),
    };
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
    let worst_m = all().map(|it| it.speed.worst_m).fold(0.0, f64::max);
    let hardest_mps2 = all().map(|it| it.speed.hardest_mps2()).fold(0.0, f64::max);
    let across = all()
        .filter_map(|it| it.across)
        .map(|it| it.worst_m)
        .reduce(f64::max);
    let across = across.map_or(String::new(), |it| {
        format!("\n// Across the road they stay within {it:.2} m.")
    });
    let horizon_s = first.speed.to_mps.len() as f64 * PIECE_S;
    let points = table.to_ron(situations);
    format!(
        r#"// {count} recorded situations. Plans are fitted to positions: along the road they stay within
// {worst_m:.3} m of the recording and accelerate by at most {hardest_mps2:.1} m/s².{across}
Scenario(
    name: "{name}",
    question: "{question}",
    source: "{source}",
    clock: (horizon_s: {horizon_s:?}, decision_s: 0.5, sample_s: 0.05, substeps: 4),
    plant: Kinematic,
    judge: UntilContact,
    road: Straight(lanes: {road}, lane_width_m: {LANE_WIDTH_M:?}, friction: 0.9),
    agents: [
        Vehicle(
            name: "ego", body: "sedan", lane: {ego_lane}, offset_m: {ego_offset},
            start: At(x_m: 0.0, speed_mps: {ego_mps}),
            drive: Ego(Acc(
                kp_per_s2: 0.3, kd_per_s: 1.2,
                standstill_headway_m: 5.7, time_gap_s: 0.5,
                max_brake_mps2: 6.0, max_accel_mps2: 2.5,
                lag_s: 0.4,
            )),
        ),
{agent}    ],
    ego_spec: "always (ego.{ado}.gap >= 0.01)",
{points})
"#,
        count = situations.len(),
        source = sources(situations),
    )
}

/// Returns the name of a recording's file without its directory.
fn file_name(source: &str) -> String {
    plain(source.rsplit(['/', '\\']).next().unwrap_or(source))
}

/// Returns the names of the recordings, each once.
fn sources(situations: &[SituationPlan]) -> String {
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
        let StockBody { name: body, .. } = first.body;
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
        let rules = self.rules();
        let rules = rules.iter().map(|(name, stl)| {
            format!("                    Rule(name: \"{name}\", stl: \"{stl}\"),\n")
        });
        let rules: String = rules.collect();
        let (actions, neutral) = match self.kind {
            SituationKind::Following => ("lateral_mps: [0.0]", 1),
            SituationKind::CutIn => ("lateral_mps: [-0.3, 0.0, 0.3]", 4),
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
