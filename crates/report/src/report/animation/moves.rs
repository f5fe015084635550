//! Chosen actions of the ados in words, with their start and end.

use crate::road::Direction;
use crate::scene::drive::{Actions, Lateral};
use crate::testbench::{Episode, FilmAfterContact};
use crate::world::{Scenario, ScenarioKind};

/// Speed in m/s from which a pedestrian runs.
const RUNS_MPS: f64 = 2.2;

/// Stretch of equal actions of one ado.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Move {
    pub from_s: f64,
    pub until_s: f64,
    pub words: String,
    pub kind: MoveKind,
}

impl Move {
    /// Returns the words without the signs of direction.
    pub(super) fn plain(&self) -> String {
        without_signs(&self.words)
    }
}

/// Words without the signs of direction.
fn without_signs(words: &str) -> String {
    let plain = words.replace(['◀', '▶', '▲', '▼'], "");
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Appearance of a move in the lanes of actions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MoveKind {
    /// No action is requested.
    Neutral,
    /// Slower, or away.
    Brakes,
    /// Faster.
    Speeds,
    /// Sideways, or on foot.
    Goes,
}

impl MoveKind {
    pub(super) fn class(self) -> &'static str {
        match self {
            MoveKind::Neutral => "m-neutral",
            MoveKind::Brakes => "m-brakes",
            MoveKind::Speeds => "m-speeds",
            MoveKind::Goes => "m-goes",
        }
    }
}

/// Moves up to `end_s` of every ado that is a body or a light, by name.
pub(super) fn moves(
    scenario: &Scenario,
    episode: &Episode,
    end_s: f64,
) -> Vec<(String, Vec<Move>)> {
    let decision_s = scenario.bench().clock().decision_s;
    let stretched = |own: &[usize], described: &dyn Fn(usize) -> (String, MoveKind)| {
        let mut moves: Vec<Move> = Vec::new();
        for (nth, action) in own.iter().enumerate() {
            let (words, kind) = described(*action);
            let (from_s, until_s) = (nth as f64 * decision_s, (nth + 1) as f64 * decision_s);
            match moves.last_mut() {
                // Equal words are joined, even if the actions behind them
                // differ.
                Some(last) if last.words == words => last.until_s = until_s.min(end_s),
                _ if from_s < end_s => moves.push(Move {
                    from_s,
                    until_s: until_s.min(end_s),
                    words,
                    kind,
                }),
                // An action after the end was chosen but never shown.
                _ => {}
            }
        }
        moves
    };
    let joint = &episode.actions;
    let spec = match scenario.kind() {
        ScenarioKind::Drive(driving) => driving.spec(),
        // A grid has a single ado, whose actions are the joint actions.
        ScenarioKind::Grid(grid) => {
            let neutral = grid.world().spaces().neutral;
            let described = |action| {
                if action == neutral {
                    (scenario.action_label(action), MoveKind::Neutral)
                } else {
                    (scenario.action_label(action), MoveKind::Goes)
                }
            };
            return vec![("ado".to_owned(), stretched(joint, &described))];
        }
    };
    let mut stride = 1;
    let sets = spec.action_sets().map(|(agent, set, _)| {
        // In a joint action, the first ado's action varies fastest.
        let own: Vec<usize> = joint
            .iter()
            .map(|joint| joint / stride % set.len())
            .collect();
        stride *= set.len();
        // Signs refer to the picture, in which the ego drives to the right.
        // They would be wrong for oncoming or crossing ados.
        let turned = spec
            .agents
            .iter()
            .find(|it| it.name == agent)
            .is_some_and(|it| it.road != 0 || it.direction == Direction::Against);
        let described = |action| match (turned, described(set, action)) {
            (true, (words, kind)) => (without_signs(&words), kind),
            (false, described) => described,
        };
        (agent.to_owned(), stretched(&own, &described))
    });
    sets.collect()
}

/// Adds the motion after the contact, up to `end_s`.
///
/// A hit vehicle rolls freely, and all others keep their last command.
pub(super) fn go_on(moves: &mut [(String, Vec<Move>)], after: &FilmAfterContact, end_s: f64) {
    for (ado, moves) in moves {
        let hit_s = after.hit_s(ado);
        if let Some(last) = moves.last_mut() {
            last.until_s = hit_s.unwrap_or(end_s);
        }
        moves.extend(hit_s.map(|from_s| Move {
            from_s,
            until_s: end_s,
            words: "rolls freely".to_owned(),
            kind: MoveKind::Neutral,
        }));
    }
}

/// Action in words, with its appearance.
fn described(set: &Actions, action: usize) -> (String, MoveKind) {
    match set {
        Actions::Accelerations(list) => along(list[action]),
        Actions::Grid(grid) => {
            let count = grid.accelerations.len();
            // The accelerations vary fastest in the grid of actions.
            let (words, kind) = along(grid.accelerations[action % count]);
            let aside = match grid.lateral[action / count] {
                Lateral::Hold => return (words, kind),
                Lateral::Left => "▲ moves left",
                Lateral::Right => "▼ moves right",
            };
            match kind {
                MoveKind::Neutral => (aside.to_owned(), MoveKind::Goes),
                _ => (format!("{aside}, {words}"), kind),
            }
        }
        Actions::Walks(list) => {
            let (along_mps, left_mps) = list[action];
            on_foot(along_mps, left_mps)
        }
        Actions::Phases(_)
        | Actions::Deviate(_)
        | Actions::Rates(_)
        | Actions::Curvatures(_)
        | Actions::Turns(_) => (set.label(action), MoveKind::Goes),
    }
}

fn along(accel_mps2: f64) -> (String, MoveKind) {
    // The picture has forward to the right.
    match accel_mps2 {
        a if a < 0.0 => (format!("◀ brakes {} m/s²", signed(a)), MoveKind::Brakes),
        a if a > 0.0 => (format!("▶ speeds up {} m/s²", signed(a)), MoveKind::Speeds),
        _ => ("keeps its speed".to_owned(), MoveKind::Neutral),
    }
}

fn on_foot(along_mps: f64, left_mps: f64) -> (String, MoveKind) {
    let speed_mps = libm::hypot(along_mps, left_mps);
    if speed_mps == 0.0 {
        // A pedestrian with a speed of 0 has no direction.
        return ("stands".to_owned(), MoveKind::Neutral);
    }
    let verb = if speed_mps > RUNS_MPS {
        "runs"
    } else {
        "walks"
    };
    let aside = match left_mps {
        left if left > 0.0 => Some(("▲", "to the left")),
        left if left < 0.0 => Some(("▼", "to the right")),
        _ => None,
    };
    let ahead = match along_mps {
        ahead if ahead > 0.0 => Some(("▶", "along")),
        ahead if ahead < 0.0 => Some(("◀", "back")),
        _ => None,
    };
    let parts: Vec<(&str, &str)> = aside.into_iter().chain(ahead).collect();
    let signs: String = parts.iter().map(|(sign, _)| *sign).collect();
    let ways: Vec<&str> = parts.iter().map(|(_, way)| *way).collect();
    let words = format!("{signs} {verb} {speed_mps:.1} m/s {}", ways.join(" and "));
    (words, MoveKind::Goes)
}

/// Number with a plus or a true minus sign.
pub(super) fn signed(value: f64) -> String {
    if value < 0.0 {
        format!("−{}", -value)
    } else {
        format!("+{value}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::{Aftermath, Constant, play};

    #[test]
    fn who_comes_along_or_across_has_no_signs_of_another_direction() {
        for (world, signs) in [
            ("oncoming", false),
            ("turn_across", false),
            ("cut_in", true),
        ] {
            let scenario = Scenario::shipped(world).expect("shipped").expect("sound");
            let mut bench = scenario.bench();
            let start = bench.draw(StartKey {
                purpose: Purpose::Train,
                seed: 1,
                index: 0,
            });
            // The last action brakes, accelerates or moves sideways, and is not
            // neutral.
            let mut last = Constant(scenario.world().spaces().actions - 1);
            let episode = play(&mut bench, &start, 0, &mut last, Aftermath::Skip);
            let moves = moves(&scenario, &episode, 1.0);
            let words = &moves[0].1[0].words;
            let has_signs = words.contains(['◀', '▶', '▲', '▼']);
            assert_eq!(has_signs, signs, "{world}: {words}");
        }
    }

    #[test]
    fn actions_are_told_in_words() {
        let cases = [
            (Actions::Accelerations(vec![-3.0]), "◀ brakes −3 m/s²"),
            (Actions::Accelerations(vec![0.0]), "keeps its speed"),
            (Actions::Walks(vec![(0.0, 0.0)]), "stands"),
            (
                Actions::Walks(vec![(0.0, -1.2)]),
                "▼ walks 1.2 m/s to the right",
            ),
            (
                Actions::Walks(vec![(-3.0, 4.0)]),
                "▲◀ runs 5.0 m/s to the left and back",
            ),
        ];
        for (set, words) in cases {
            assert_eq!(described(&set, 0).0, words);
        }
    }
}
