//! Plans of a world file: number ranges, formulas and laws.

use super::ado_actions::ActsAs;
use super::check;
use super::language::Language;
use super::language::formula;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{
    Agent, Drive, DriveSpec, MeetEgo, MotionLaw, MotionPlan, PlanSpec, Range, ScriptStep,
    SteadyPart,
};
use crate::stl::{Formula, Names};
use crate::world_file::{NumberOrRange, PlanFile};

/// Greatest distance, duration and speed in a plan.
const MOST: f64 = 5_000.0;

/// Reads and checks a plan. `path` is the list of its steps, or its meeting.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    plan: &PlanFile,
    acts_as: ActsAs,
) -> Option<PlanSpec> {
    match plan {
        MotionPlan::Script(steps) => {
            let steps = steps
                .iter()
                .enumerate()
                .map(|(i, step)| read_step(problems, &path.at(i), step, acts_as));
            Some(MotionPlan::Script(steps.collect::<Option<_>>()?))
        }
        MotionPlan::Meet(meet) => {
            read_meet(problems, path, meet);
            // A meeting has no formulas, so only its numbers are converted.
            let numbers = plan.map(|_, _, NumberOrRange(range)| range);
            match numbers {
                MotionPlan::Meet(meet) => Some(MotionPlan::Meet(meet)),
                MotionPlan::Script(_) => None,
            }
        }
    }
}

fn read_meet(problems: &mut Problems, path: &ValuePath, meet: &MeetEgo<NumberOrRange>) {
    // At rest, it would never reach the place of the meeting.
    let fields = [
        ("ego_at_m", meet.ego_at_m, -MOST),
        ("here_at_m", meet.here_at_m, -MOST),
        ("speed_mps", meet.speed_mps, 0.01),
    ];
    for (field, number, least) in fields {
        number_in(problems, &path.to(field), number, least);
    }
    let steady = path.to("steady");
    let (SteadyPart::Metres(number) | SteadyPart::Seconds(number)) = meet.steady;
    number_in(problems, &steady.at(0), number, 0.0);
}

fn read_step(
    problems: &mut Problems,
    path: &ValuePath,
    step: &ScriptStep<NumberOrRange, String>,
    acts_as: ActsAs,
) -> Option<ScriptStep<Range, Formula>> {
    number_in(problems, &path.to("after_s"), step.after_s, 0.0);
    let when = match &step.when {
        Some(text) => Some(formula(problems, &path.to("when"), text)?),
        None => None,
    };
    let list = path.to("does");
    // Laws of one step run at the same time, so each direction has at most one.
    for across in [false, true] {
        let laws = step.does.iter().enumerate();
        let second = laws.filter(|(_, law)| law.is_across() == across).nth(1);
        if let Some((i, _)) = second {
            let what = if across {
                "two laws across the way in one step"
            } else {
                "two laws along the way in one step"
            };
            let help = "one of them goes into a step of its own".to_owned();
            problems.add(&list.at(i), what, "second one", Some(help));
        }
    }
    if step.overlaps && !step.does.iter().any(MotionLaw::is_across) {
        let help = "add `LaneChange` or `LaneOffset`, or leave `overlaps` out".to_owned();
        let what = "`overlaps` without a law across the path";
        problems.add(&path.to("overlaps"), what, "nothing overlaps", Some(help));
    }
    for (i, law) in step.does.iter().enumerate() {
        read_law(problems, &list.at(i), law, acts_as);
    }
    Some(ScriptStep {
        when,
        after_s: step.after_s.0,
        does: step
            .does
            .iter()
            .map(|law| law.map(|_, NumberOrRange(range)| range))
            .collect(),
        overlaps: step.overlaps,
    })
}

fn read_law(
    problems: &mut Problems,
    path: &ValuePath,
    law: &MotionLaw<NumberOrRange>,
    acts_as: ActsAs,
) {
    let walks = acts_as == ActsAs::Walker;
    let (numbers, on_wheels): (Vec<(&str, NumberOrRange, f64)>, bool) = match law {
        MotionLaw::Speed {
            to_mps,
            relative_to,
            rate_mps2,
            ..
        } => {
            // At a rate of 0, the target would never be reached.
            let rate = rate_mps2.map(|rate| ("rate_mps2", rate, 1e-3));
            if relative_to.is_none() && to_mps.0.lo.min(to_mps.0.hi) < 0.0 {
                refuse_reversing(problems, &path.to("to_mps"), *to_mps);
            }
            // Relative to another agent's speed, a target may be below 0.
            let to = ("to_mps", *to_mps, -100.0);
            (std::iter::once(to).chain(rate).collect(), true)
        }
        MotionLaw::Brake { rate_mps2 } => (vec![("rate_mps2", *rate_mps2, 1e-3)], true),
        MotionLaw::LaneChange { by_m, rate_mps, .. } => (
            vec![("by_m", *by_m, -MOST), ("rate_mps", *rate_mps, 1e-3)],
            true,
        ),
        MotionLaw::LaneOffset {
            to_m,
            most_lateral_mps2,
        } => (
            vec![
                ("to_m", *to_m, -MOST),
                ("most_lateral_mps2", *most_lateral_mps2, 1e-3),
            ],
            true,
        ),
        MotionLaw::Walk { speed_mps, way_m } => (
            vec![("speed_mps", *speed_mps, 1e-3), ("way_m", *way_m, 0.0)],
            false,
        ),
    };
    // Speed and braking suit both kinds, while laws across and walks suit one
    // kind.
    if law.is_across() && walks || !on_wheels && !walks {
        let what = format!("{} does not move by this law", acts_as.words());
        let help = if walks {
            "on foot there are `Walk`, `Speed` and `Brake`, the way one faces"
        } else {
            "on wheels there are `Speed`, `Brake`, `LaneChange` and `LaneOffset`"
        };
        problems.add(path, what, "another body's", Some(help.to_owned()));
    }
    for (field, number, least) in numbers {
        number_in(problems, &path.to(field), number, least);
    }
}

/// Refuses a target speed below 0, because no agent moves backwards.
fn refuse_reversing(problems: &mut Problems, path: &ValuePath, NumberOrRange(to): NumberOrRange) {
    let least_mps = to.lo.min(to.hi);
    let what = format!("a target speed of {least_mps} m/s, but no agent moves backwards");
    let help = "write 0.0 to stop, or add `relative_to` if it is relative to an agent's speed";
    problems.add(path, what, "below 0", Some(help.to_owned()));
}

fn number_in(problems: &mut Problems, path: &ValuePath, number: NumberOrRange, least: f64) {
    check::range(problems, path, number.0);
    for value in [number.0.lo, number.0.hi] {
        check::within(problems, path, value, least, MOST);
    }
}

/// Place of an agent's plan in the file.
fn place_of(entry: &ValuePath, agent: &Agent) -> ValuePath {
    let drive = entry.to("drive");
    let plan = match &agent.drive {
        Drive::Ado { .. } => drive.to("base"),
        _ => drive,
    };
    match agent.plan() {
        Some(MotionPlan::Script(_)) => plan.at(0),
        _ => plan,
    }
}

/// Checks the references of plans: relative speeds and conditions.
///
/// `entries` are the agents' positions in the file's list.
pub(super) fn bind(
    problems: &mut Problems,
    language: &mut Language,
    names: &Names,
    list: &ValuePath,
    spec: &DriveSpec,
    entries: &[usize],
) {
    let known: Vec<&str> = spec.agents.iter().map(|it| it.name.as_str()).collect();
    for (agent, entry) in spec.agents.iter().zip(entries) {
        let Some(plan) = agent.plan() else {
            continue;
        };
        let path = place_of(&list.at(*entry), agent);
        for (i, step) in plan.steps().iter().enumerate() {
            let place = path.at(i);
            if let Some(when) = &step.when {
                // During a run only the past is known, so a condition cannot look
                // ahead.
                language.bind_past(problems, &place.to("when"), when, names);
            }
            for (j, law) in step.does.iter().enumerate() {
                let MotionLaw::Speed {
                    relative_to: Some(other),
                    ..
                } = law
                else {
                    continue;
                };
                // All agents of the file are known here, so a plan may refer to
                // later ones.
                if !known.contains(&other.as_str()) {
                    let place = place.to("does").at(j).to("relative_to");
                    problems.unknown(&place, "agent", other, &known);
                }
            }
        }
        // The meeting determines the approach from rest, so a start speed would
        // contradict it.
        if matches!(plan, MotionPlan::Meet(_)) && agent.place.speed_mps() != Range::fixed(0.0) {
            let what = "who meets the ego starts at the speed that makes it fit";
            let help = "write `speed_mps: 0.0`".to_owned();
            let place = list.at(*entry).to("start").to("speed_mps");
            problems.add(&place, what, "not its to say", Some(help));
        }
    }
}

/// Reports a meeting that is impossible at a start, which `words` describe.
pub(super) fn refuse_encounter(
    problems: &mut Problems,
    entry: &ValuePath,
    agent: &Agent,
    why: String,
    cure: &str,
    words: &str,
) {
    let what = format!("`{}` cannot meet the ego: {why}", agent.name);
    let help = format!("{words}; {cure}");
    problems.add(&place_of(entry, agent), what, "never happens", Some(help));
}
