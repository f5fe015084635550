//! Lanes over time: actions of ados, phases of lights, and key moments.

use maud::{Markup, html};

use super::picture::Picture;
use crate::experiment::phase_word;

/// Share of a lane that a letter takes on a wide screen.
///
/// Words that do not fit are left out.
const LETTER_SHARE: f64 = 0.0068;
/// Share of a lane that a letter takes on a phone.
///
/// Words that do not fit are hidden.
const PHONE_LETTER_SHARE: f64 = 0.0245;

/// Stretch of a lane.
struct LaneSegment<'a> {
    from_s: f64,
    until_s: f64,
    words: &'a str,
    class: String,
}

/// Lanes: one per ado and one per light.
pub(super) fn lanes(picture: &Picture<'_>) -> Markup {
    // An episode may end at its first sample, and the shares divide by its
    // duration.
    let end_s = picture.film.end_s().max(1e-9);
    let agents = &picture.shown.stage.agents;
    // A light that is an ado has a lane of phases instead of actions.
    let is_light = |name: &String| picture.shown.stage.lights.iter().any(|it| it.name == *name);
    html! {
        div class="lanes" {
            @for (ado, moves) in picture.moves.iter().filter(|(ado, _)| !is_light(ado)) {
                @let who = agents.iter().position(|agent| agent.name == *ado);
                @let class = who.map_or("c-by", |who| picture.classes[who].as_str());
                span class={ "swatch " (class) } { (ado) }
                div class="lane" { @for it in moves { (stretch(end_s, &LaneSegment { from_s: it.from_s, until_s: it.until_s, words: &it.words, class: it.kind.class().to_owned() })) } }
            }
            @for (light, phases) in picture.shown.stage.lights.iter().zip(&picture.film.phases) {
                span class="swatch c-by" { (light.name) }
                div class="lane" { @for (from_s, until_s, phase) in runs(&picture.film.times_s, phases) {
                    (stretch(end_s, &LaneSegment { from_s, until_s, words: phase_word(phase), class: format!("p-{}", phase_word(phase)) }))
                } }
            }
            div class="ticks" { @for moment in picture.moments.iter().skip(1) {
                i class=(moment.class) style=(format!("left:{:.2}%", 100.0 * moment.time_s / end_s)) title=(moment.words) {}
            } }
        }
    }
}

fn stretch(end_s: f64, it: &LaneSegment<'_>) -> Markup {
    let share = (it.until_s - it.from_s) / end_s;
    // Two letters more than the text, for the padding.
    let letters = (it.words.chars().count() + 2) as f64;
    // Both widths are known here only, and the page has no script for its
    // layout.
    let fits = PHONE_LETTER_SHARE * letters < share;
    let class = format!("{}{}", it.class, if fits { " fits" } else { "" });
    let title = format!("{:.2} to {:.2} s: {}", it.from_s, it.until_s, it.words);
    html! {
        span class=(class) style=(format!("width:{:.2}%", 100.0 * share)) title=(title) { @if LETTER_SHARE * letters < share { (it.words) } }
    }
}

/// Runs of equal values, with start and end in seconds.
fn runs<T: Copy + PartialEq>(times_s: &[f64], values: &[T]) -> Vec<(f64, f64, T)> {
    let mut runs: Vec<(f64, f64, T)> = Vec::new();
    for (time_s, value) in times_s.iter().zip(values) {
        match runs.last_mut() {
            Some((_, until_s, last)) => {
                // A run lasts until the next value is first seen.
                *until_s = *time_s;
                if last != value {
                    runs.push((*time_s, *time_s, *value));
                }
            }
            None => runs.push((*time_s, *time_s, *value)),
        }
    }
    runs
}
