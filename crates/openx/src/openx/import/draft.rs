//! Drafts of worlds: values with numbers that may vary between points.
//!
//! Points whose values differ only in those numbers share one world. A number that is equal
//! at all points is written as it is. Other numbers become ranges, and `points` has a column
//! for each of them.

use crate::opendrive::error::{At, ImportError};
use crate::ron_file::{Ordered, ValuePath};
use crate::scene::drive::{MeetEgo, MotionPlan, Range, SteadyPart};
use crate::world_file::{
    AgentFile, CommentedWorld, DriveFile, NumberOrRange, PointsFile, ScenarioFile, StartFile,
    TextComment, WorldFile,
};

/// Greatest number of worlds of an import.
pub(super) const MOST_WORLDS: usize = 1_000;

/// Time between two decisions of an ado in seconds.
const DECISION_S: f64 = 0.5;
/// Longest run in seconds with decisions at that rate.
///
/// Longer runs decide less often, so that their search is no larger than that of short runs.
const OFTEN_UNTIL_S: f64 = 60.0;

/// World that an import produced.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportedWorld {
    /// Name of the world.
    pub name: String,
    /// RON text of the world.
    pub text: String,
    /// Indices in the variation file of its points, in the order of its table.
    pub points: Vec<usize>,
    /// Elements of the files from which its values come.
    origins: Vec<(ValuePath, At)>,
}

impl ImportedWorld {
    /// Returns a problem of the text, from an offset on, as one of the element of the
    /// files that leads to it.
    pub fn refused(&self, offset: usize, what: &str) -> Option<ImportError> {
        let begun = self.origins.iter().filter_map(|(path, at)| {
            let from = path.find(&self.text).start;
            (from <= offset).then_some((from, at))
        });
        // Values begin behind those that hold them, so the last is the innermost.
        let nearest = begun.max_by_key(|(from, _)| *from);
        nearest.map(|(_, at)| at.error(what))
    }
}

/// Value of a number that may vary.
#[derive(Clone, Debug, PartialEq)]
struct DraftNumber {
    /// Name of its axis.
    axis: String,
    value: f64,
    /// Difference between the value on the axis and the written one.
    more: f64,
}

/// World at one point.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    /// Its value, with 0 for each number that may vary and for the horizon.
    blank: ScenarioFile,
    numbers: Vec<DraftNumber>,
    origins: Vec<(ValuePath, At)>,
    /// Duration of the run.
    until_s: f64,
    /// True if the files say how long the run lasts.
    has_end: bool,
    /// Earliest time at which an entity leaves its road.
    leaves_s: f64,
    /// True if the run ends before the stop time of the file.
    pub is_cut: bool,
}

/// Duration of a run.
#[derive(Clone, Copy, Debug)]
pub(super) struct RunDuration {
    pub until_s: f64,
    /// True if the files say how long the run lasts.
    pub has_end: bool,
    /// Earliest time at which an entity leaves its road.
    pub leaves_s: f64,
}

impl Draft {
    pub(super) fn of(
        mut file: ScenarioFile,
        origins: Vec<(ValuePath, At)>,
        duration: RunDuration,
    ) -> Draft {
        let all = numbers(&mut file).into_iter();
        let taken = all.map(|(axis, more, number)| {
            let value = number.0.lo;
            *number = NumberOrRange::default();
            DraftNumber { axis, value, more }
        });
        let numbers = taken.collect();
        let RunDuration {
            until_s,
            has_end,
            leaves_s,
        } = duration;
        // The group of a draft decides on both, so no draft differs by them.
        file.clock.horizon_s = 0.0;
        file.clock.decision_s = 0.0;
        Draft {
            blank: file,
            numbers,
            origins,
            until_s,
            has_end,
            // Rounded up to whole samples, a run may end just after the departure, and
            // its draft must still fit a group.
            leaves_s: if has_end {
                leaves_s.max(until_s)
            } else {
                f64::INFINITY
            },
            is_cut: false,
        }
    }

    fn is_like(&self, other: &Draft) -> bool {
        let mut pairs = self.numbers.iter().zip(&other.numbers);
        self.has_end == other.has_end
            && self.numbers.len() == other.numbers.len()
            && pairs.all(|(one, other)| one.axis == other.axis && one.more == other.more)
            // Last, since it takes longest.
            && self.blank == other.blank
    }

    /// Duration that its run needs to have at least.
    fn least_s(&self) -> f64 {
        if self.has_end { self.until_s } else { 0.0 }
    }
}

/// Returns the numbers of a world that may vary, with their axes.
///
/// The second value is the difference between a number on its axis and the written one.
fn numbers(file: &mut ScenarioFile) -> Vec<(String, f64, &mut NumberOrRange)> {
    let width_m = file.road.lane_width_m().0.lo;
    let mut all = Vec::new();
    for agent in &mut file.agents {
        let name = agent.name().to_owned();
        let axis = |what: &str| format!("{name}.{what}");
        match agent {
            AgentFile::Vehicle {
                road,
                lane,
                offset_m,
                start,
                drive,
                ..
            } => {
                if road.is_none() {
                    // A lane is far below the greatest whole number.
                    all.push((axis("lateral"), *lane as f64 * width_m, offset_m));
                }
                all.extend(starts(start, &axis));
                all.extend(meetings(drive, &axis));
            }
            AgentFile::Pedestrian {
                lateral_m,
                start,
                drive,
                ..
            } => {
                all.push((axis("lateral"), 0.0, lateral_m));
                all.extend(starts(start, &axis));
                all.extend(meetings(drive, &axis));
            }
            AgentFile::Obstacle { s_m, lateral_m, .. } => {
                all.push((axis("x"), 0.0, s_m));
                all.push((axis("lateral"), 0.0, lateral_m));
            }
            AgentFile::Light { .. }
            | AgentFile::Weather(_)
            | AgentFile::Road(_)
            | AgentFile::Turns { .. } => {}
        }
    }
    let Ordered(parameters) = &mut file.parameters;
    all.extend(
        parameters
            .iter_mut()
            .map(|(name, it)| (name.clone(), 0.0, it)),
    );
    all
}

fn starts<'a>(
    start: &'a mut StartFile,
    axis: &impl Fn(&str) -> String,
) -> Vec<(String, f64, &'a mut NumberOrRange)> {
    match start {
        StartFile::At { x_m, speed_mps } => {
            vec![(axis("x"), 0.0, x_m), (axis("speed"), 0.0, speed_mps)]
        }
        // An import writes places, never gaps to others.
        StartFile::Ahead { .. } => Vec::new(),
    }
}

fn meetings<'a>(
    drive: &'a mut DriveFile,
    axis: &impl Fn(&str) -> String,
) -> Vec<(String, f64, &'a mut NumberOrRange)> {
    let meet = match drive {
        DriveFile::Meet(meet) => meet,
        DriveFile::Ado(ado) => match &mut ado.base {
            Some(MotionPlan::Meet(meet)) => meet,
            _ => return Vec::new(),
        },
        _ => return Vec::new(),
    };
    let MeetEgo {
        ego_at_m,
        here_at_m,
        speed_mps,
        steady: SteadyPart::Metres(steady) | SteadyPart::Seconds(steady),
    } = meet;
    vec![
        (axis("meet.ego_at"), 0.0, ego_at_m),
        (axis("meet.here_at"), 0.0, here_at_m),
        (axis("meet.speed"), 0.0, speed_mps),
        (axis("meet.steady"), 0.0, steady),
    ]
}

/// Rounds to nine decimals, without −0.
///
/// Rounding removes the digits that sums of decimal fractions add.
pub(super) fn tidy(value: f64) -> f64 {
    let tidy = (value * 1e9).round() / 1e9;
    // The sum turns −0 into 0, whose text has no sign.
    tidy + 0.0
}

/// Drafts that share a world.
struct DraftGroup {
    drafts: Vec<(usize, Draft)>,
    /// Longest run of them, and earliest departure of an entity.
    until_s: f64,
    leaves_s: f64,
}

impl DraftGroup {
    /// Returns true for a draft of the same value whose run, as the longest of the
    /// others, ends before an entity of any of them leaves its road.
    fn fits(&self, draft: &Draft) -> bool {
        let until_s = self.until_s.max(draft.least_s());
        let ends = until_s <= self.leaves_s.min(draft.leaves_s);
        ends && self.drafts[0].1.is_like(draft)
    }
}

/// Groups drafts into worlds, each with the points that share it.
///
/// Several worlds are numbered from 1. Returns `None` for more than [`MOST_WORLDS`].
///
/// # Errors
///
/// A world cannot be written.
pub(super) fn worlds(
    name: &str,
    source: &str,
    drafts: Vec<(usize, Draft)>,
) -> Result<Option<Vec<ImportedWorld>>, ron::Error> {
    let mut groups: Vec<DraftGroup> = Vec::new();
    for (index, draft) in drafts {
        // A full list still takes drafts that share one of its worlds.
        let is_full = groups.len() == MOST_WORLDS;
        let group = groups.iter_mut().find(|group| group.fits(&draft));
        match group {
            Some(group) => {
                group.until_s = group.until_s.max(draft.least_s());
                group.leaves_s = group.leaves_s.min(draft.leaves_s);
                group.drafts.push((index, draft));
            }
            None if is_full => return Ok(None),
            None => groups.push(DraftGroup {
                until_s: draft.least_s(),
                leaves_s: draft.leaves_s,
                drafts: vec![(index, draft)],
            }),
        }
    }
    let several = groups.len() > 1;
    let groups = groups.iter().map(|group| &group.drafts);
    let worlds = groups.zip(1..).map(|(group, number)| {
        let name = if several {
            format!("{name}_{number}")
        } else {
            name.to_owned()
        };
        world(&name, source, group)
    });
    worlds.collect::<Result<_, _>>().map(Some)
}

/// Returns the world of a group of points.
fn world(name: &str, source: &str, group: &[(usize, Draft)]) -> Result<ImportedWorld, ron::Error> {
    let first = &group[0].1;
    let mut file = first.blank.clone();
    file.name = name.to_owned();
    file.source = source.to_owned();
    let durations_s = group.iter().map(|(_, draft)| draft.until_s);
    let longest_s = durations_s.clone().fold(0.0, f64::max);
    // With an unknown end, the run ends at the earliest departure of all points.
    file.clock.horizon_s = tidy(if first.has_end {
        longest_s
    } else {
        durations_s.fold(f64::INFINITY, f64::min)
    });
    file.clock.decision_s = DECISION_S * (longest_s / OFTEN_UNTIL_S).ceil().max(1.0);
    let mut axes = Vec::new();
    let mut rows = vec![Vec::new(); group.len()];
    for (i, (axis, more, number)) in numbers(&mut file).into_iter().enumerate() {
        // All drafts of a group have the same numbers, so the index fits all of them.
        let values = group.iter().map(|(_, draft)| draft.numbers[i].value);
        let lo = values.clone().fold(f64::INFINITY, f64::min);
        let hi = values.clone().fold(f64::NEG_INFINITY, f64::max);
        *number = NumberOrRange(Range { lo, hi });
        // A number that is equal at all points is no axis of the starts.
        if lo != hi {
            axes.push(axis);
            for (row, value) in rows.iter_mut().zip(values) {
                // The axis counts from the middle of lane 0, and the file from
                // that of the own lane.
                row.push(value + more);
            }
        }
    }
    file.points = (!axes.is_empty()).then_some(PointsFile { axes, rows });
    let heading = TextComment::heading(
        "Imported by `brakecheck new --from`.\n\
         The ego coasts as the protocol assumes: `brakecheck eval` with `--ego` or \
         `-- COMMAND` tests yours.",
    );
    let commented = CommentedWorld {
        world: WorldFile::Scenario(Box::new(file)),
        comments: vec![heading],
    };
    Ok(ImportedWorld {
        name: name.to_owned(),
        text: commented.text()?,
        points: group.iter().map(|(index, _)| *index).collect(),
        origins: first.origins.clone(),
    })
}
