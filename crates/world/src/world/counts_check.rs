//! Checks of `counts` and `goals` against the judge, the reward and the road users.

use super::check;
use crate::rl::LearnerConfig;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::rulebook::{Counts, JudgeKind, Reward, Rulebook};
use crate::story::check::CheckedStoryboard;
use crate::trace::Schema;
use crate::world_file::{AgentFile, DriveFile, ScenarioFile, TrainingGoal};

/// Greatest closing speed that `counts` may require, in m/s.
const MAX_CLOSING_MPS: f64 = 150.0;

pub(super) fn check(problems: &mut Problems, top: &ValuePath, file: &ScenarioFile) {
    let goals = file.goals.as_deref().unwrap_or_default();
    if let Some((what, help)) = against_goals(goals, Some(others(file))) {
        problems.add(&top.to("goals"), what, "here", Some(help));
    }
    let place = top.to("counts");
    let Some(closing_mps) = file.counts.closing_mps() else {
        return;
    };
    check::within(
        problems,
        &place.to("closing_mps"),
        closing_mps,
        0.0,
        MAX_CLOSING_MPS,
    );
    if let Counts::Preventable { by, .. } = &file.counts
        && by.is_empty()
    {
        let what = "no driver is named who would have avoided it".to_owned();
        let help = Some("name drivers, of whom any is enough: by: [RSS]".to_owned());
        problems.add(&place.to("by"), what, "empty", help);
    }
    let changing = file.agents.iter().find_map(|agent| match agent {
        AgentFile::Weather(_) => Some("weather that an ado changes"),
        AgentFile::Road(_) => Some("a road that an ado lays"),
        _ => None,
    });
    if let Some(changing) = changing {
        refuse_drivers(problems, top, &file.counts, changing);
    }
    if file.judge != JudgeKind::UntilContact {
        let what = format!(
            "judge {:?} ends an episode before the contact on which `counts` rests",
            file.judge
        );
        let help = Some("write judge: UntilContact".to_owned());
        problems.add(&place, what, "needs another judge", help);
    }
    // Lemma 2 requires a reward for violations that do not count below that of
    // all that count.
    let stepped = matches!(file.reward, Reward::Tanh { jump, .. } if 0.0 < jump);
    if !stepped {
        let what = "this reward has no step between what counts and what does not".to_owned();
        let help = Some("write reward: Tanh() or any with jump above 0".to_owned());
        problems.add(&place, what, "needs another reward", help);
    }
    if others(file) == 0 {
        let what = "no agent of this world can touch the ego".to_owned();
        let help = Some(
            "add a vehicle, a pedestrian or an obstacle; or write counts: Violation".to_owned(),
        );
        problems.add(&place, what, "here", help);
    }
}

/// Refuses reference drivers in a world whose storyboard changes the friction.
pub(super) fn check_story(
    problems: &mut Problems,
    top: &ValuePath,
    counts: &Counts,
    story: Option<&CheckedStoryboard>,
) {
    if story.is_some_and(CheckedStoryboard::changes_friction) {
        refuse_drivers(
            problems,
            top,
            counts,
            "a friction that a storyboard changes",
        );
    }
}

/// Refuses reference drivers in a world in which their replays could not repeat a change.
fn refuse_drivers(problems: &mut Problems, top: &ValuePath, counts: &Counts, changing: &str) {
    if let Counts::Preventable { .. } = counts {
        let what = format!("reference drivers do not apply to {changing}");
        let help = Some("write counts: Contact(closing_mps: 3.0)".to_owned());
        problems.add(&top.to("counts"), what, "nothing would count", help);
    }
}

/// Returns the goals of a world that states none, with so many `others` with a body.
///
/// A failure is a contact where the specification reads a gap or a contact. A severe one
/// is then worth more. Worlds that name another learner train as before, to the bit.
// With `Dqfd` recall stayed at 0.97 to 1.00 on four worlds, and contacts were 1.6 to 1.8
// times as fast on `cut_in` and `acc_iso`. With `Dqn` 9 of 523 successes of `merge_fair`
// were lost, and one of three trainings on `cut_in` collapsed.
pub(super) fn default_goals(
    others: usize,
    learner: &LearnerConfig,
    rulebook: &Rulebook,
    schema: &Schema,
) -> Vec<TrainingGoal> {
    let signals = rulebook.spec.signals();
    let mut names = signals.iter().map(|at| schema.signals()[*at].name.as_str());
    // Severity belongs to contacts, so only a specification about them gets
    // the goal.
    let is_of_contacts =
        names.any(|name| matches!(name.rsplit('.').next(), Some("gap" | "contact")));
    let is_default_learner = learner.name() == LearnerConfig::default().name();
    if is_of_contacts && is_default_learner && others > 0 {
        vec![TrainingGoal::Severe]
    } else {
        Vec::new()
    }
}

/// Returns the number of agents that can touch the ego.
pub(super) fn others(file: &ScenarioFile) -> usize {
    let agents = file.agents.iter();
    agents.filter(|agent| is_other_with_a_body(agent)).count()
}

/// Why a training cannot have these goals, and the cure, among so many `others`
/// with a body; `None`: the world is a grid.
pub(super) fn against_goals(
    goals: &[TrainingGoal],
    others: Option<usize>,
) -> Option<(String, String)> {
    let named = |goal: TrainingGoal| goals.iter().filter(|it| **it == goal).count();
    let (severe, distinct) = (named(TrainingGoal::Severe), named(TrainingGoal::Distinct));
    let refused = |what: &str, help: &str| Some((what.to_owned(), help.to_owned()));
    match others {
        None if !goals.is_empty() => refused(
            "training goals require a driving world, and this is a grid",
            "leave out the goals",
        ),
        Some(0) if severe > 0 => refused(
            "the goal `Severe` requires an agent that can touch the ego",
            "add a vehicle, a pedestrian or an obstacle; or leave out `Severe`",
        ),
        _ if severe > 1 || distinct > 1 => {
            refused("a training goal is named twice", "name each goal once")
        }
        _ => None,
    }
}

fn is_other_with_a_body(agent: &AgentFile) -> bool {
    match agent {
        AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } => {
            !matches!(drive, DriveFile::Ego(_))
        }
        AgentFile::Obstacle { .. } => true,
        AgentFile::Light { .. }
        | AgentFile::Weather(_)
        | AgentFile::Road(_)
        | AgentFile::Turns { .. } => false,
    }
}

/// Refuses a judge or a count that requires contacts in a world of cells.
pub(super) fn nothing_touches(
    problems: &mut Problems,
    top: &ValuePath,
    judge: JudgeKind,
    counts: &Counts,
) {
    let nothing = "nothing touches in a world of cells".to_owned();
    if judge == JudgeKind::UntilContact {
        let help = Some("write judge: UntilViolation or WholeRun".to_owned());
        problems.add(&top.to("judge"), nothing, "no contact", help);
    } else if !counts.is_violation() {
        let help = Some("leave `counts` out".to_owned());
        problems.add(&top.to("counts"), nothing, "no contact", help);
    }
}
