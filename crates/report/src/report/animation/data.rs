//! Film as text that play.js reads: lists of rounded numbers per body.
//!
//! Places are rounded to 1 mm and headings to 0.1 mrad. A shape is then less
//! than 1 cm from the place of its body.

use serde_json::to_string;

use super::picture::Picture;
use super::write::{list, n};
use crate::experiment::{EpisodeFrames, phase_word};
use crate::report::verdict::capital;
use crate::visible::visible_json;

/// Data of all moving elements of a picture.
pub(super) fn json(picture: &Picture<'_>) -> String {
    let film = &picture.film;
    let (ego, _) = picture.ego();
    let bodies: Vec<String> = (0..film.tracks.len())
        .map(|who| body(picture, who))
        .collect();
    let focus = [
        film.focus.iter().map(|f| f.centre_m[0]).collect::<Vec<_>>(),
        film.focus.iter().map(|f| f.centre_m[1]).collect(),
        film.focus.iter().map(|f| f.size_m[0]).collect(),
        film.focus.iter().map(|f| f.size_m[1]).collect(),
    ]
    .map(|values| list(&values, 2));
    let lights: Vec<String> = (0..film.phases.len())
        .map(|light| turns(&picture.shown, light))
        .collect();
    // `null` and not a missing key, so that the script reads one shape.
    let contact = picture
        .contact_m()
        .map_or("null".to_owned(), |at| list(&at, 3));
    // Only pictures that go on after the contact have the list.
    let captions: Vec<String> = picture
        .after
        .iter()
        .map(|(time_s, words)| format!("[{},{}]", n(*time_s, 3), quoted(&capital(words))))
        .collect();
    let after = if captions.is_empty() {
        String::new()
    } else {
        format!(",\"after\":[{}]", captions.join(","))
    };
    format!(
        "{{\"t\":{},\"ego\":{ego},\"turn\":{},\"cells\":{},\"bodies\":[{}],\"focus\":[{}],\"lights\":[{}],\"contact\":{contact},\"broken\":{},\"still\":{},\"leaf\":{}{after}}}",
        list(&film.times_s, 4),
        n(film.turn_rad, 4),
        picture.on_cells,
        bodies.join(","),
        focus.join(","),
        lights.join(","),
        n(picture.violated_s, 3),
        n(picture.still_s(), 4),
        quoted(&picture.broken),
    )
}

fn body(picture: &Picture<'_>, who: usize) -> String {
    let (agent, track) = (&picture.shown.stage.agents[who], &picture.film.tracks[who]);
    let own = picture.moves.iter().find(|(ado, _)| *ado == agent.name);
    let moves = own
        .map_or(&[][..], |(_, moves)| moves)
        .iter()
        .map(|it| format!("[{},{}]", n(it.from_s, 3), quoted(&it.words)));
    format!(
        "{{\"name\":{},\"size\":{},\"x\":{},\"y\":{},\"h\":{},\"v\":{},\"a\":{},\"moves\":[{}]}}",
        quoted(&agent.name),
        list(&agent.size_m[..2], 3),
        list(&track.x_m, 3),
        list(&track.y_m, 3),
        list(&track.heading_rad, 4),
        list(&track.speed_mps, 2),
        list(&track.accel_mps2, 1),
        moves.collect::<Vec<_>>().join(","),
    )
}

/// Times at which a light changes, with the new phase.
fn turns(shown: &EpisodeFrames, light: usize) -> String {
    let turns = shown
        .light_turns(light)
        .into_iter()
        .map(|(at, phase)| format!("[{},\"{}\"]", n(at.time_s, 3), phase_word(phase)));
    format!("[{}]", turns.collect::<Vec<_>>().join(","))
}

/// Text as JSON, which the page escapes once more.
fn quoted(text: &str) -> String {
    // A string always has a JSON form. If not, empty quotes keep the page
    // valid.
    let json = to_string(text).unwrap_or_else(|_| "\"\"".to_owned());
    visible_json(&json).into_owned()
}
