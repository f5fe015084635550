//! Kept crash as one SVG that plays by itself.
//!
//! It shows the ego and, beside it, another driver in the ego's place.
//!
//! It serves pages that run no script, such as a README. CSS keyframes move the
//! shapes of the reports up to the contact, or beyond it, in a loop. Both halves have one
//! clock and one scale, so the difference is the driver. With reduced motion
//! only the end is shown.

mod keyframes;
mod panel;
mod words;

use maud::{Markup, PreEscaped, html};

use super::SHAPES;
use super::bodies::body;
use super::camera::Canvas;
use super::film_tracks::FilmTracks;
use super::ground::{cells, road};
use super::moves::{Move, MoveKind};
use super::picture::Picture;
use super::write::n;
use crate::preventability::FilmedDriver;
use crate::report::Example;
use crate::report::file_style::file_style;
use crate::report::page::STYLE;
use crate::visible::visible_markup;
use crate::world::Scenario;
pub use keyframes::HOLD_S;
use keyframes::{Keyframes, Period};
use panel::LoopPanel;
use words::{captions_of, ending_of, facts, outcome_of, wrapped};

/// Seconds shown, up to the end of the recorded drive.
pub(super) const BEFORE_S: f64 = 5.0;
/// Seconds shown after a violation or a closest approach. A contact ends the drive.
const AFTER_S: f64 = 1.0;
/// Width of the picture, gap, height of a line, height of a half.
const WIDTH_PX: f64 = 900.0;
const GAP_PX: f64 = 8.0;
const LINE_PX: f64 = 18.0;
const HEIGHT_PX: f64 = 250.0;

/// Style of the text on a looping picture.
pub(super) const OWN_STYLE: &str = "\
.card{fill:var(--card)}.ground{fill:var(--verge)}.plate{fill:#0c0f13;fill-opacity:.82}\
.fine{fill:#2f7d4d}.poor{fill:#c2273d}.bar{fill:var(--held)}.head2{fill:var(--ink)}\
svg .title,svg .result{fill:#fff;font-size:13px;font-weight:600}\
svg .said{font-size:13px;fill:var(--ink)}svg .told{font-weight:700}\
.k-start{fill:var(--dim)}.k-decisive{fill:var(--ado)}.k-chance{fill:var(--good)}.k-broken{fill:#b26a00}.k-contact{fill:#c2273d}";

/// Other driver in the ego's place.
pub struct Beside {
    /// Description of the driver in a few words.
    pub who: String,
    /// Drive of that driver.
    pub filmed: FilmedDriver,
}

/// Kept crash as an SVG that plays in a loop, or that shows one instant.
pub struct LoopingPicture {
    /// The SVG up to the keyframes in its style sheet, and after them.
    head: String,
    tail: String,
    keyframes: Keyframes,
    /// Time of the episode that a still shows, in seconds.
    still_s: f64,
}

impl LoopingPicture {
    /// Returns the SVG that plays. Programs without CSS animations draw its end.
    pub fn svg(&self) -> String {
        [&self.head, self.keyframes.css().as_str(), &self.tail].concat()
    }

    /// Returns the duration of the motion in seconds, without the pause after it.
    pub fn motion_s(&self) -> f64 {
        self.keyframes.period.until_s - self.keyframes.period.from_s
    }

    /// Returns the SVG of the decisive instant of the ego's drive.
    ///
    /// It is that of the contact, or else of the violation. Without a failure it is the
    /// closest approach.
    pub fn still(&self) -> String {
        let css = self.keyframes.css_at(self.still_s);
        [&self.head, css.as_str(), &self.tail].concat()
    }

    /// Returns the SVG of an instant, in seconds since the picture begins to move.
    ///
    /// It needs no CSS animations. After the motion it is that of the end.
    pub fn at(&self, time_s: f64) -> String {
        let css = self.keyframes.css_at(self.keyframes.period.from_s + time_s);
        [&self.head, css.as_str(), &self.tail].concat()
    }
}

/// Returns a crash as a picture that plays in a loop.
///
/// `ego` describes the system under test, and the note adds a remark on the
/// run. Without `beside` the picture has one half. The example must have
/// frames.
pub fn looping_picture(
    scenario: &Scenario,
    example: &Example,
    ego: &str,
    note: Option<&str>,
    beside: Option<&Beside>,
) -> LoopingPicture {
    let picture = Picture::of(scenario, example, 0);
    let other = beside.map(|it| {
        let shown = picture.shown.with_driver(&it.filmed);
        (it, FilmTracks::of(&shown, None))
    });
    let ending = ending_of(scenario, &picture, AFTER_S);
    let mut panels = vec![LoopPanel {
        nth: 0,
        film: &picture.film,
        moves: picture.moves.clone(),
        contact_m: picture.contact_m(),
        // The motion after the contact is shown to its end.
        until_s: match &example.after {
            Some(_) => picture.film.end_s(),
            None => ending.end_s,
        },
        captions: captions_of(&picture, &ending),
        ending,
        title: format!("The ego: {ego}"),
        picture: &picture,
    }];
    panels.extend(
        other
            .as_ref()
            .map(|(it, film)| beside_it(&picture, it, film)),
    );
    let ends = panels.iter().map(|panel| panel.until_s);
    // Both halves begin with the ego's drive, since they have one clock.
    let from_s = (panels[0].ending.end_s - BEFORE_S).max(0.0);
    let period = Period {
        // The start is a sample that both films have.
        from_s: picture.film.times_s[picture.film.at(from_s)],
        // The longer half, so that neither is cut.
        until_s: ends.fold(0.0, f64::max),
    };
    let said = facts(scenario, &picture, note, beside);
    whole(&panels, period, &said)
}

/// Half of the other driver.
fn beside_it<'a>(picture: &'a Picture<'a>, it: &Beside, film: &'a FilmTracks) -> LoopPanel<'a> {
    let recorded_s = picture.film.recorded_end_s();
    let mut moves = picture.moves.clone();
    for (_, moves) in &mut moves {
        // Only the recorded drive collides.
        moves.retain(|it| it.from_s < recorded_s);
        // After the end of the record no ado chooses an action.
        moves.push(Move {
            from_s: recorded_s,
            until_s: film.end_s(),
            words: "goes on".to_owned(),
            kind: MoveKind::Neutral,
        });
    }
    let contact = it.filmed.contact.as_ref();
    let ending = outcome_of(picture, film, &it.filmed, AFTER_S);
    LoopPanel {
        nth: 1,
        film,
        moves,
        contact_m: contact.map(|touch| film.turned(touch.point_m[0], touch.point_m[1])),
        until_s: ending.end_s,
        captions: vec![(ending.end_s, ending.words.clone())],
        ending,
        title: format!("In its place: {}", it.who),
        picture,
    }
}

/// Halves, clock and text as one picture.
fn whole(panels: &[LoopPanel<'_>], period: Period, said: &[String]) -> LoopingPicture {
    let mut keyframes = Keyframes::new(period);
    let count = panels.len() as f64;
    let canvas = Canvas {
        size_px: [(WIDTH_PX - (count - 1.0) * GAP_PX) / count, HEIGHT_PX],
        margin_px: [46.0, 62.0],
        foot_px: 28.0,
        ego_px: 44.0,
        least_height_m: 9.0,
    };
    // The smallest scale of all halves: equal lengths must look equal.
    let scales = panels.iter().map(|it| it.scale(&canvas, period.from_s));
    let scale = scales.fold(f64::INFINITY, f64::min);
    let [width_px, _] = canvas.size_px;
    let halves: Vec<Markup> = panels
        .iter()
        .map(|panel| {
            let x = panel.nth as f64 * (width_px + GAP_PX);
            html! {
                g transform=(format!("translate({} 0)", n(x, 1))) clip-path="url(#half)" {
                    rect class="ground" width=(n(width_px, 1)) height=(HEIGHT_PX) {}
                    (panel.drawn(&mut keyframes, &canvas, scale))
                }
            }
        })
        .collect();
    let clock = clock(panels[0].picture, &mut keyframes);
    // The first line is the outcome.
    let lines: Vec<(&str, String)> = said
        .iter()
        .enumerate()
        .flat_map(|(nth, it)| {
            let lines = wrapped(it, nth == 0).into_iter();
            lines.map(move |line| (if nth == 0 { "said told" } else { "said" }, line))
        })
        .collect();
    let top_px = HEIGHT_PX + 30.0;
    let height_px = top_px + LINE_PX * lines.len() as f64;
    let picture = panels[0].picture;
    let drawn = html! {
        // Inkscape before 1.3 reads `href` of `use` in this namespace only.
        svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" class="loop" viewBox=(format!("0 0 {WIDTH_PX} {height_px}")) width=(WIDTH_PX) height=(height_px) role="img" {
            title { (said.join(" ")) }
            style { (PreEscaped(file_style(&[STYLE, SHAPES, OWN_STYLE]))) (PreEscaped(format!("svg.loop{{width:{WIDTH_PX}px;height:{height_px}px}}{}", strokes(scale)))) }
            defs {
                clipPath id="half" { rect width=(n(width_px, 1)) height=(HEIGHT_PX) rx="8" {} }
                g id=(picture.part("ground")) { @if picture.on_cells { (cells(&picture.shown.stage)) } @else { (road(&picture.shown.stage, picture.frames())) } }
                @for (who, agent) in picture.shown.stage.agents.iter().enumerate() {
                    g id=(picture.body(who)) class=(picture.classes[who]) { (body(agent)) }
                }
            }
            rect class="card" width=(WIDTH_PX) height=(height_px) rx="8" {}
            @for half in &halves { (half) }
            (clock)
            @for (nth, (class, line)) in lines.iter().enumerate() {
                text class=(class) x="4" y=(n(top_px + LINE_PX * nth as f64, 1)) { (line) }
            }
        }
    };
    // Names of agents may hold characters that no viewer shows.
    let svg = visible_markup(&drawn.into_string()).into_owned();
    // The keyframes end the only style sheet.
    let at = svg.find("</style>").unwrap_or_default();
    let (head, tail) = svg.split_at(at);
    LoopingPicture {
        head: head.to_owned(),
        tail: tail.to_owned(),
        keyframes,
        still_s: panels[0].ending.decisive_s,
    }
}

/// Widths of strokes in metres, at so many pixels per metre.
///
/// Not every program knows `vector-effect`, and the scale of a file is constant.
pub(super) fn strokes(scale: f64) -> String {
    let widths_px = [
        (".paint,.cargo,.ring,.cells", 1.0),
        (".head", 0.8),
        (".wall", 2.0),
    ];
    let rules = widths_px.map(|(shapes, width_px)| {
        let width_m = n(width_px / scale, 4);
        format!("{shapes}{{vector-effect:none;stroke-width:{width_m}}}")
    });
    let [gap_m, dash_m, width_m] = [3.0, 4.0, 1.5].map(|px| n(px / scale, 4));
    let outline = format!(
        ".ghost{{vector-effect:none;stroke-width:{width_m};stroke-dasharray:{dash_m} {gap_m}}}"
    );
    rules.into_iter().chain([outline]).collect()
}

/// Time as a bar with a hand and the moments of the crash.
fn clock(picture: &Picture<'_>, keyframes: &mut Keyframes) -> Markup {
    let Period { from_s, until_s } = keyframes.period;
    // The pause after the motion has no place on the bar.
    let x = |time_s: f64| WIDTH_PX * (time_s - from_s) / (until_s - from_s);
    let ends = [(from_s, 0.0), (until_s, WIDTH_PX - 3.0)];
    let moved =
        keyframes.moving(&ends.map(|(at_s, x)| (at_s, format!("translate({}px,0px)", n(x, 1)))));
    let moments = picture
        .moments
        .iter()
        .filter(|it| from_s < it.time_s && it.time_s <= until_s);
    html! {
        g transform=(format!("translate(0 {})", HEIGHT_PX + 5.0)) {
            rect class="bar" width=(WIDTH_PX) height="6" rx="3" {}
            @for moment in moments { rect class={ "instant " (moment.class) } x=(n(x(moment.time_s) - 2.0, 1)) width="4" height="6" { title { (moment.words) } } }
            rect class={ "head2 " (moved) } y="-1" width="3" height="8" transform=(format!("translate({} 0)", WIDTH_PX - 3.0)) {}
        }
    }
}
