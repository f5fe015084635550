//! Text of a looping picture: the outcome of each drive, and the facts.

use super::Beside;
use super::panel::DriveEnding;
use crate::preventability::FilmedDriver;
use crate::report::animation::film_tracks::FilmTracks;
use crate::report::animation::moments::TOGETHER_S;
use crate::report::animation::picture::Picture;
use crate::report::verdict::{VerdictWords, capital, ego_failed, outcome_in_words};
use crate::report::words;
use crate::rulebook::{RulesUntilContact, Verdict};
use crate::run_dir::Answer;
use crate::world::Scenario;

/// Letters per line, in normal and in bold type.
const LETTERS: usize = 132;
const BOLD_LETTERS: usize = 116;

/// End and outcome of the recorded drive.
///
/// It ends with a contact, or `after_s` after the violation.
pub(super) fn ending_of(scenario: &Scenario, picture: &Picture<'_>, after_s: f64) -> DriveEnding {
    match &picture.example.episode.contact {
        Some(touch) => DriveEnding {
            decisive_s: touch.time_s,
            end_s: touch.time_s,
            words: if picture.on_cells {
                "Caught".to_owned()
            } else {
                format!("Contact at {:.1} m/s", touch.closing_speed_mps)
            },
            is_good: false,
        },
        None if !ego_failed(&picture.example.episode) => {
            // Without a failure, the closest approach is the most interesting
            // moment.
            let nearest_s = nearest_s(picture, &picture.film, 0.0);
            DriveEnding {
                decisive_s: nearest_s,
                end_s: (nearest_s + after_s).min(picture.film.end_s()),
                words: capital(&outcome_in_words(scenario, &picture.example.episode)),
                is_good: true,
            }
        }
        None => DriveEnding {
            decisive_s: picture.violated_s,
            end_s: (picture.violated_s + after_s).min(picture.film.end_s()),
            words: format!("Broken: {}", picture.broken),
            is_good: false,
        },
    }
}

/// Captions of the recorded drive: its outcome, then the events after the contact.
pub(super) fn captions_of(picture: &Picture<'_>, ending: &DriveEnding) -> Vec<(f64, String)> {
    let mut captions = vec![(ending.decisive_s, ending.words.clone())];
    for (time_s, words) in &picture.after {
        match &mut captions[..] {
            // The first collision is that of the contact, which is said already.
            [(begun_s, said)] if time_s - *begun_s <= TOGETHER_S => {
                if let Some((_, further)) = words.split_once("; ") {
                    *said = format!("{said}; {further}");
                }
            }
            _ => captions.push((*time_s, capital(words))),
        }
    }
    captions
}

/// End and outcome of the other driver's drive.
///
/// It ends with a contact, or `after_s` after the closest approach.
pub(super) fn outcome_of(
    picture: &Picture<'_>,
    film: &FilmTracks,
    filmed: &FilmedDriver,
    after_s: f64,
) -> DriveEnding {
    if let Some(touch) = &filmed.contact {
        return DriveEnding {
            decisive_s: touch.time_s,
            end_s: touch.time_s,
            words: format!("Contact at {:.1} m/s", touch.closing_speed_mps),
            is_good: false,
        };
    }
    // Before the end of the recorded drive, the other driver is not yet past the
    // crash.
    let nearest_s = nearest_s(picture, film, picture.film.recorded_end_s());
    DriveEnding {
        decisive_s: nearest_s,
        end_s: (nearest_s + after_s).min(film.end_s()),
        words: match filmed.outcome.margin {
            Some(gap_m) => format!("No contact: misses by {gap_m:.1} m"),
            None => "No contact: no road user was in its way".to_owned(),
        },
        is_good: true,
    }
}

/// Time of the closest approach of ego and encountered agent, from a time on.
fn nearest_s(picture: &Picture<'_>, film: &FilmTracks, from_s: f64) -> f64 {
    let (ego, _) = picture.ego();
    // The encounter of the recorded film, so that both halves refer to one
    // agent.
    let opponent = picture.film.opponent;
    let apart_m = |i: usize| opponent.map_or(0.0, |opponent| film.apart_m(ego, opponent, i));
    let later = film.at(from_s)..film.times_s.len();
    let nearest = later.min_by(|a, b| apart_m(*a).total_cmp(&apart_m(*b)));
    nearest.map_or(from_s, |i| film.times_s[i])
}

/// Facts of the run: the outcome first, then the numbers.
pub(super) fn facts(
    scenario: &Scenario,
    picture: &Picture<'_>,
    note: Option<&str>,
    beside: Option<&Beside>,
) -> Vec<String> {
    let example = picture.example;
    let about = &example.about;
    let verdict = VerdictWords::of(scenario, example).sentence();
    let speed = about.severity.as_ref().map(|severity| {
        let delta_mps = severity.impact.ego_delta_v_mps;
        let closing_mps = severity.closing_speed_mps;
        format!("closing speed {closing_mps:.1} m/s, Δv of the ego {delta_mps:.1} m/s")
    });
    let count = scenario.rulebook().rules.len();
    let rules = match &example.episode.rules_until_contact {
        _ if matches!(example.episode.verdict, Verdict::Foul { .. }) => "a rule broken".to_owned(),
        Some(RulesUntilContact::Broken { rule, .. }) => {
            format!("“{rule}” broken before the contact")
        }
        _ => format!("rules kept: {count} of {count}"),
    };
    let last_chance = about.why.as_ref().and_then(|why| why.last_chance.as_ref());
    let chance = last_chance.map(|chance| match (chance.at_s, chance.answer()) {
        (Some(at_s), _) => format!(
            "last chance: {} {:.2} s before the failure",
            chance.driver,
            (chance.violated_s - at_s).max(0.0)
        ),
        (None, Answer::NoAnswer(_)) => format!("last chance by {}: no answer", chance.driver),
        (None, _) => format!("last chance: none by {}", chance.driver),
    });
    let persistence = about.persistence.as_ref().map(ToString::to_string);
    let known: Vec<String> = [speed, Some(rules), chance, persistence]
        .into_iter()
        .flatten()
        .collect();
    let mut said = vec![verdict, capital(&format!("{}.", known.join("; ")))];
    said.extend(note.map(str::to_owned));
    said.extend(beside.map(|it| other(&it.who, &it.filmed, picture)));
    said
}

/// Drive of the other driver in words.
fn other(who: &str, filmed: &FilmedDriver, picture: &Picture<'_>) -> String {
    let from_s = filmed.from as f64 * picture.example.episode.trace.dt_s();
    let reacted = filmed.outcome.reacted_s.map_or(String::new(), |at_s| {
        format!(", sees danger at {at_s:.2} s")
    });
    let then = match (&filmed.contact, filmed.outcome.margin) {
        (Some(touch), _) => format!("hits at {:.1} m/s", touch.closing_speed_mps),
        (None, Some(gap_m)) => format!("misses by {gap_m:.1} m"),
        (None, None) => "meets no road user".to_owned(),
    };
    format!(
        "In its place {who} takes over at {from_s:.2} s{reacted} and {then}; the others move as recorded."
    )
}

/// Text in lines that fit, in bold type or not.
pub(super) fn wrapped(text: &str, bold: bool) -> Vec<String> {
    let letters = if bold { BOLD_LETTERS } else { LETTERS };
    words::wrapped(text, letters)
}
