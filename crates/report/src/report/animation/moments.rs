//! Key moments of an episode, from the start to the contact.
//!
//! They are the start, the decisive action, the last chance, the violation and
//! the contact.

use super::super::Example;
use super::super::verdict::ego_failed;
use super::moves::{Move, MoveKind};
use crate::testbench::FilmAfterContact;
use crate::world::{Scenario, ScenarioKind};

/// Greatest time in seconds between two moments that share a still.
pub(super) const TOGETHER_S: f64 = 0.02;

/// Instant with a still.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct KeyMoment {
    pub time_s: f64,
    pub words: String,
    /// CSS class of its colour in lanes and stills.
    pub class: &'static str,
}

/// Moments of a counterexample in the order of time, the start first.
pub(super) fn moments(
    scenario: &Scenario,
    example: &Example,
    violated_s: f64,
    moves: &[(String, Vec<Move>)],
) -> Vec<KeyMoment> {
    let moment = |time_s: f64, words: String, class| KeyMoment {
        time_s,
        words,
        class,
    };
    let mut moments = vec![moment(0.0, "start".to_owned(), "k-start")];
    if let Some(why) = &example.about.why {
        moments.extend(why.decisive.as_ref().map(|it| {
            let words = format!("decisive: {}", done_at(it.from_s, moves));
            moment(it.from_s, words, "k-decisive")
        }));
        let chance = why.last_chance.as_ref();
        moments.extend(chance.and_then(|chance| {
            let words = format!("last chance: {}", chance.driver);
            // Without an instant there is no last chance to show.
            Some(moment(chance.at_s?, words, "k-chance"))
        }));
    }
    if ego_failed(&example.episode) {
        let words = "requirement broken".to_owned();
        moments.push(moment(violated_s, words, "k-broken"));
    }
    moments.extend(example.episode.contact.as_ref().map(|touch| {
        let words = match scenario.kind() {
            ScenarioKind::Grid(_) => "caught".to_owned(),
            ScenarioKind::Drive(_) => format!("contact, {:.1} m/s", touch.closing_speed_mps),
        };
        moment(touch.time_s, words, "k-contact")
    }));
    // A decisive action may come before or after the last chance.
    moments.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
    together(moments)
}

/// Captions of the events after the contact, by the time in seconds of the first event.
///
/// Events at about one time share a caption.
pub(super) fn captions(after: &FilmAfterContact) -> Vec<(f64, String)> {
    let mut captions: Vec<(f64, String)> = Vec::new();
    for (time_s, words) in after.motion.events() {
        match captions.last_mut() {
            Some((begun_s, said)) if time_s - *begun_s <= TOGETHER_S => {
                *said = format!("{said}; {words}");
            }
            _ => captions.push((time_s, format!("after the contact: {words}"))),
        }
    }
    captions
}

/// Actions of the ados from a time on. Neutral actions are omitted.
fn done_at(time_s: f64, moves: &[(String, Vec<Move>)]) -> String {
    let now = moves.iter().filter_map(|(ado, moves)| {
        // The tolerance is for times that are products of the decision's
        // length.
        let mut begun = moves.iter().rev().filter(|it| it.from_s < time_s + 1e-9);
        begun.next().map(|it| (ado, it))
    });
    let done = now
        .filter(|(_, it)| it.kind != MoveKind::Neutral)
        .map(|(ado, it)| format!("{ado} {}", it.plain()));
    done.collect::<Vec<_>>().join("; ")
}

/// Joins moments at one time, with the time and the colour of the last.
fn together(moments: Vec<KeyMoment>) -> Vec<KeyMoment> {
    let mut joined: Vec<KeyMoment> = Vec::new();
    for moment in moments {
        match joined.last_mut() {
            Some(last) if moment.time_s - last.time_s <= TOGETHER_S => {
                last.words = match last.class {
                    // The start keeps its short word, whatever it is joined
                    // with.
                    "k-start" => format!("start; {}", moment.words),
                    _ => format!("{}; {}", last.words, moment.words),
                };
                // Of the last, because the still of both must show the
                // outcome.
                (last.class, last.time_s) = (moment.class, moment.time_s);
            }
            _ => joined.push(moment),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_at_one_time_share_a_still() {
        let at = |time_s: f64, words: &str, class| KeyMoment {
            time_s,
            words: words.to_owned(),
            class,
        };
        let joined = together(vec![
            at(0.0, "start", "k-start"),
            at(3.0, "requirement broken", "k-broken"),
            at(3.01, "contact", "k-contact"),
        ]);
        assert_eq!(joined.len(), 2);
        assert_eq!(
            joined[1],
            at(3.01, "requirement broken; contact", "k-contact")
        );
    }
}
