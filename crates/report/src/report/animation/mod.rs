//! Counterexample from above, to play, to scrub and to read.
//!
//! A film (the poses of all bodies per sample) is seen by a camera that follows
//! the conflict. The page contains the still of the decisive moment, stills of
//! other moments, the actions as lanes, and the poses. A small script moves the
//! same shapes. Without it the stills show the course of events.
//!
//! `bodies` and `ground` are shapes in metres. `moves` and `moments` describe
//! the episode. `labels` places words beside bodies. `play.js` is the only
//! script of a page. `looping` is the same picture as one SVG that plays
//! without a script.

#[cfg(test)]
mod aftermath_tests;
mod bodies;
mod camera;
mod data;
mod film_tracks;
mod ground;
mod labels;
mod lanes;
mod looping;
mod moments;
mod moves;
mod picture;
mod running;
#[cfg(test)]
pub(super) mod tests;
mod write;

pub(super) use bodies::colour_class;
pub use looping::{Beside, HOLD_S, LoopingPicture, looping_picture};
use maud::{Markup, html};
pub use running::running_picture;

use super::Example;
use super::verdict::VerdictWords;
use crate::world::Scenario;
use picture::Picture;

/// Script that moves the pictures of a page. It loads nothing.
pub(super) const SCRIPT: &str = include_str!("play.js");
/// Colours of the shapes, which files with a picture have, too.
pub(super) const SHAPES: &str = include_str!("shapes.css");
/// Colours and layout of the pictures of a page.
pub(super) const STYLE: &str = concat!(include_str!("shapes.css"), include_str!("animation.css"));

/// Animated picture of one example. `nth` makes its identifiers unique.
///
/// Empty if the example has no frames.
pub(super) fn animation(
    scenario: &Scenario,
    example: &Example,
    nth: usize,
    verdict: &VerdictWords,
) -> Markup {
    if example.frames.is_empty() {
        return html! {};
    }
    let picture = Picture::of(scenario, example, nth);
    let film = data::json(&picture);
    let event = example.episode.contact.as_ref();
    html! {
        figure class="film" data-film=(film) {
            div class="screen" tabindex="0" {
                (picture.screen(&verdict.sentence()))
                p class="clock" { (format!("{:.2} s", picture.still_s())) }
                @match event {
                    Some(_) if picture.on_cells => { p class="event k-contact" { "Caught" } }
                    Some(touch) => { p class="event k-contact" { "Contact at " (format!("{:.1}", touch.closing_speed_mps)) " m/s" } }
                    None => { p class="event k-broken" { "Requirement broken: " (picture.broken) } }
                }
                p class="ending" { (verdict.sentence()) }
            }
            div class="deck" {
                div {
                    button type="button" class="back" aria-label="A sample back" title="Comma, ←" { "◂" }
                    button type="button" class="play" aria-label="Play" title="Space" { "▶" }
                    button type="button" class="on" aria-label="A sample on" title="Period, →" { "▸" }
                    button type="button" class="rate" aria-label="Speed" title="S" { "1×" }
                }
                input type="range" min="0" max="1000" value="1000" step="any" aria-label="Time";
            }
            (lanes::lanes(&picture))
            div class="strip" style=(format!("--stills:{}", picture.moments.len())) { @for moment in &picture.moments { (picture.thumb(moment)) } }
        }
    }
}
