//! Half of a looping picture: a drive from above, and its outcome.

use maud::{Markup, html};

use super::keyframes::Keyframes;
use crate::report::animation::camera::{Camera, Canvas};
use crate::report::animation::film_tracks::FilmTracks;
use crate::report::animation::ground::lights;
use crate::report::animation::labels::{
    LabelContent, PlacedLabel, SampleLabels, labels_over_time, size_of,
};
use crate::report::animation::moves::Move;
use crate::report::animation::picture::{BRAKES_MPS2, Picture, STAR_S, burst};
use crate::report::animation::write::n;

/// Time between shown samples, and duration of a label's text, in seconds.
const EVERY_S: f64 = 0.1;
const WORDS_S: f64 = 0.5;
/// Time in which a label jumps to another side of its body, in seconds.
const JUMP_S: f64 = 0.002;
/// Distance of a star from the edge at which it is whole, in pixels.
const STAR_PX: f64 = 16.0;
/// Width of a letter of a caption. Longer captions are set closer.
const LETTER_PX: f64 = 7.5;

/// Content of one half.
pub(super) struct LoopPanel<'a> {
    /// Number that makes its identifiers unique.
    pub nth: usize,
    pub picture: &'a Picture<'a>,
    pub film: &'a FilmTracks,
    /// Moves of the ados, which also apply beside another driver.
    pub moves: Vec<(String, Vec<Move>)>,
    /// Place of the contact in the picture's directions.
    pub contact_m: Option<[f64; 2]>,
    /// End of the motion in seconds.
    pub until_s: f64,
    /// Captions by time in seconds, that of the outcome first.
    pub captions: Vec<(f64, String)>,
    pub ending: DriveEnding,
    /// Name of the driver.
    pub title: String,
}

/// End of a drive and its outcome in words.
pub(super) struct DriveEnding {
    /// Time of the contact, of the violation or of the closest approach.
    pub decisive_s: f64,
    pub end_s: f64,
    pub words: String,
    pub is_good: bool,
}

/// Shown samples of a film within a period, with that of its decisive instant.
fn shown(film: &FilmTracks, from_s: f64, until_s: f64, decisive_s: f64) -> Vec<usize> {
    let (first, last) = (film.at(from_s), film.at(until_s));
    let decisive = film.at(decisive_s);
    let mut shown = vec![first];
    for i in first + 1..last {
        let before_s = film.times_s[shown[shown.len() - 1]];
        // The tolerance is for times that are sums of steps.
        if i == decisive || EVERY_S - 1e-6 <= film.times_s[i] - before_s {
            shown.push(i);
        }
    }
    // The end is always shown, however close to the previous sample.
    shown.push(last);
    shown
}

/// Returns whether a star at a place of the picture lies within the half.
fn is_star_whole(camera: &Camera<'_>, place_m: [f64; 2]) -> bool {
    let [x, y] = camera.at(place_m);
    let [width_px, height_px] = camera.canvas.size_px;
    let is_within = |at_px: f64, side_px: f64| (STAR_PX..=side_px - STAR_PX).contains(&at_px);
    is_within(x, width_px) && is_within(y, height_px)
}

impl LoopPanel<'_> {
    /// Pixels per metre at which all agents fit at all times.
    pub(super) fn scale(&self, canvas: &Canvas, from_s: f64) -> f64 {
        let shown = self.shown(from_s);
        let scales = shown
            .iter()
            .map(|i| Camera::fitting(self.film, *i, self.ego(), canvas));
        // The smallest, so that the picture has one scale from start to end.
        scales.fold(f64::INFINITY, f64::min)
    }

    fn shown(&self, from_s: f64) -> Vec<usize> {
        shown(self.film, from_s, self.until_s, self.ending.decisive_s)
    }

    fn ego(&self) -> Option<(usize, f64)> {
        (!self.picture.on_cells).then(|| self.picture.ego())
    }

    /// Picture at a given scale.
    pub(super) fn drawn(&self, keyframes: &mut Keyframes, canvas: &Canvas, scale: f64) -> Markup {
        let shown = self.shown(keyframes.period.from_s);
        let camera = |i: usize| Camera::at_scale(self.film, i, self.ego(), scale, canvas);
        let cameras: Vec<Camera<'_>> = shown.iter().map(|i| camera(*i)).collect();
        let times = || shown.iter().map(|i| self.film.times_s[*i]);
        let centres = cameras.iter().map(|camera| {
            let [u, v] = camera.centre_m;
            format!("translate({}px,{}px)", n(-u, 2), n(-v, 2))
        });
        // The centre moves inside of the scale, so its keyframes are in
        // metres.
        let moved = keyframes.moving(&times().zip(centres).collect::<Vec<_>>());
        // The attributes show the end, for readers without motion.
        let last = &cameras[cameras.len() - 1];
        let [[x, y], [u, v]] = [last.middle_px(), last.centre_m];
        let turn_deg = n(-self.film.turn_rad.to_degrees(), 3);
        let everybody = 0..self.picture.shown.stage.agents.len();
        let content = LabelContent {
            stage: &self.picture.shown.stage,
            film: self.film,
            moves: &self.moves,
        };
        let labels = labels_over_time(content, &shown, &cameras);
        html! {
            g transform=(format!("translate({x} {y}) scale({} {})", n(scale, 3), n(-scale, 3))) {
                g class=(moved) transform=(format!("translate({} {})", n(-u, 2), n(-v, 2))) {
                    g transform=(format!("rotate({turn_deg})")) {
                        use xlink:href={ "#" (self.picture.part("ground")) } {}
                        (self.lights(keyframes))
                        @if self.goes_on() {
                            @let cut_s = self.cut_s(&shown, &cameras);
                            @let begins = [(keyframes.period.from_s, false), (self.ending.end_s, true)];
                            @let turns: Vec<(f64, bool)> = begins.into_iter().chain(cut_s.map(|at_s| (at_s, false))).collect();
                            g class=(keyframes.seen(&turns)) visibility=[cut_s.map(|_| "hidden")] { (self.picture.past_contact(scale)) }
                        }
                        @for who in everybody.clone() { (self.body(keyframes, who, &shown)) }
                    }
                }
            }
            (self.star(keyframes, &shown, &cameras))
            @for who in everybody { (self.label(keyframes, who, &shown, &labels)) }
            (self.result(keyframes, canvas))
        }
    }

    /// Moving body, with brake lamps if it brakes.
    fn body(&self, keyframes: &mut Keyframes, who: usize, shown: &[usize]) -> Markup {
        let track = &self.film.tracks[who];
        let time_s = |i: usize| self.film.times_s[i];
        let poses = shown.iter().map(|&i| {
            let (x, y, turn_deg) = (
                track.x_m[i],
                track.y_m[i],
                track.heading_rad[i].to_degrees(),
            );
            let pose = format!(
                "translate({}px,{}px) rotate({}deg)",
                n(x, 2),
                n(y, 2),
                n(turn_deg, 1)
            );
            (time_s(i), pose)
        });
        let moved = keyframes.moving(&poses.collect::<Vec<_>>());
        let brakes = |i: usize| track.accel_mps2[i] < -BRAKES_MPS2;
        let braking: Vec<(f64, bool)> = shown.iter().map(|&i| (time_s(i), brakes(i))).collect();
        // A body that never brakes needs no second shape.
        let lit = braking.iter().any(|(_, brakes)| *brakes);
        let end = shown[shown.len() - 1];
        html! {
            g class={ "body " (moved) } transform=(self.film.pose(who, end)) {
                use xlink:href={ "#" (self.picture.body(who)) } {}
                @if lit {
                    g class={ "braking " (keyframes.seen(&braking)) } visibility=(if brakes(end) { "visible" } else { "hidden" }) {
                        use xlink:href={ "#" (self.picture.body(who)) } {}
                    }
                }
            }
        }
    }

    /// Lights, as one group per stretch of equal phases.
    fn lights(&self, keyframes: &mut Keyframes) -> Markup {
        let (from, until) = (
            self.film.at(keyframes.period.from_s),
            self.film.at(self.until_s),
        );
        let showing = |i: usize| -> Vec<_> { self.film.phases.iter().map(|it| it[i]).collect() };
        let mut turns = vec![from];
        turns.extend((from + 1..=until).filter(|i| showing(*i) != showing(i - 1)));
        html! {
            @for (nth, &i) in turns.iter().enumerate().filter(|_| !self.film.phases.is_empty()) {
                @let next = turns.get(nth + 1).map(|next| (self.film.times_s[*next], false));
                @let before = (nth > 0).then_some((keyframes.period.from_s, false));
                @let turns: Vec<(f64, bool)> = before.into_iter().chain([(self.film.times_s[i], true)]).chain(next).collect();
                g class=(keyframes.seen(&turns)) visibility=(if next.is_none() { "visible" } else { "hidden" }) { (lights(&self.picture.shown.stage, &showing(i))) }
            }
        }
    }

    /// Returns whether bodies move on after the contact.
    fn goes_on(&self) -> bool {
        self.contact_m.is_some() && self.ending.end_s < self.until_s
    }

    /// Returns the time after the contact from which the edge cuts its star, if it does.
    fn cut_s(&self, shown: &[usize], cameras: &[Camera<'_>]) -> Option<f64> {
        let place_m = self.contact_m?;
        let times = shown.iter().map(|i| self.film.times_s[*i]);
        let mut later = times
            .zip(cameras)
            // Before the contact there is no star to cut.
            .skip_while(|(time_s, _)| *time_s <= self.ending.end_s);
        let cut = later.find(|(_, camera)| !is_star_whole(camera, place_m));
        cut.map(|(time_s, _)| time_s)
    }

    /// Star of a contact, above the bodies that touch.
    fn star(&self, keyframes: &mut Keyframes, shown: &[usize], cameras: &[Camera<'_>]) -> Markup {
        let places: Vec<[f64; 2]> = self
            .contact_m
            .map(|at| cameras.iter().map(move |it| it.at(at)))
            .into_iter()
            .flatten()
            .collect();
        let Some([x, y]) = places.last().copied() else {
            return html! {};
        };
        let begins = [(keyframes.period.from_s, false), (self.ending.end_s, true)];
        if !self.goes_on() {
            // A drive that ends with its contact keeps the star.
            return html! { g class=(keyframes.seen(&begins)) { (burst(x, y)) } };
        }
        let cut_s = self.cut_s(shown, cameras).unwrap_or(self.until_s);
        // A star at the edge vanishes before the edge cuts it.
        let ends = ((self.ending.end_s + STAR_S).min(cut_s), false);
        let turns = [begins.as_slice(), &[ends]].concat();
        let star = html! { g class=(keyframes.seen(&turns)) visibility="hidden" { (burst(x, y)) } };
        // The camera moves on after the contact, and the place of the contact does not.
        let moves = shown.iter().zip(&places).map(|(&i, [then_x, then_y])| {
            let moved = format!("translate({}px,{}px)", n(then_x - x, 1), n(then_y - y, 1));
            (self.film.times_s[i], moved)
        });
        html! { g class=(keyframes.moving(&moves.collect::<Vec<_>>())) { (star) } }
    }

    /// Name, speed and action of a body, with a line to it.
    ///
    /// The group moves with the body, and its text changes every half second.
    fn label(
        &self,
        keyframes: &mut Keyframes,
        who: usize,
        shown: &[usize],
        all: &[SampleLabels],
    ) -> Markup {
        let labels: Vec<&PlacedLabel> = all.iter().map(|(labels, _)| &labels[who]).collect();
        let time_s = |nth: usize| self.film.times_s[shown[nth]];
        // A jump to another side takes no time, so that the label crosses no body.
        let moves = |place: &dyn Fn(&PlacedLabel) -> String| {
            let mut moves: Vec<(f64, String)> = Vec::new();
            for (nth, label) in labels.iter().enumerate() {
                let jumps = nth > 0 && all[nth].1[who];
                if jumps && time_s(nth) - time_s(nth - 1) > JUMP_S {
                    moves.push((time_s(nth) - JUMP_S, place(labels[nth - 1])));
                }
                moves.push((time_s(nth), place(label)));
            }
            moves
        };
        let places = moves(&|label| {
            let [x, y] = middle(label);
            format!("translate({}px,{}px)", n(x, 1), n(y, 1))
        });
        let moved = keyframes.moving(&places);
        let led = keyframes.moving(&moves(&|label| leader(label, "px", "deg")));
        let last = labels.len() - 1;
        let from_s = keyframes.period.from_s;
        let mut words: Vec<(f64, &PlacedLabel)> = Vec::new();
        for (nth, label) in labels.iter().enumerate() {
            // A new action is shown at once, and a new speed only after a
            // while, so that it is readable.
            let is_due = words.last().is_none_or(|(then_s, said)| {
                WORDS_S - 1e-6 <= time_s(nth) - then_s || said.lines[1..] != label.lines[1..]
            });
            // The last text is that of the end, which readers without motion
            // see.
            if is_due || nth == last {
                words.push((time_s(nth), label));
            }
        }
        let [x, y] = middle(labels[last]);
        html! {
            rect class={ "leader " (led) " " (self.picture.classes[who]) } y="-0.6" width="1" height="1.2" transform=(leader(labels[last], "", "")) {}
            g class=(moved) transform=(format!("translate({} {})", n(x, 1), n(y, 1))) {
                @for (nth, (since_s, label)) in words.iter().enumerate() {
                    @let next = words.get(nth + 1).map(|(next_s, _)| (*next_s, false));
                    @let before = (nth > 0).then_some((from_s, false));
                    @let turns: Vec<(f64, bool)> = before.into_iter().chain([(*since_s, true)]).chain(next).collect();
                    g class={ (keyframes.seen(&turns)) " label " (self.picture.classes[who]) } visibility=(if next.is_none() { "visible" } else { "hidden" }) { (words_of(label)) }
                }
            }
        }
    }

    /// Name of the driver, and the outcome at the end.
    fn result(&self, keyframes: &mut Keyframes, canvas: &Canvas) -> Markup {
        let [width_px, height_px] = canvas.size_px;
        html! {
            rect class="plate" width=(width_px) height="25" {}
            text class="title" x="10" y="17.5" { (self.title) }
            @for (nth, (at_s, words)) in self.captions.iter().enumerate() {
                @let next = self.captions.get(nth + 1).map(|(next_s, _)| (*next_s, false));
                @let turns: Vec<(f64, bool)> = [(keyframes.period.from_s, false), (*at_s, true)].into_iter().chain(next).collect();
                // With reduced motion, only the last caption is seen.
                g class=(keyframes.seen(&turns)) visibility=[next.map(|_| "hidden")] {
                    rect class=(if self.ending.is_good { "fine" } else { "poor" }) y=(n(height_px - 28.0, 1)) width=(width_px) height="28" {}
                    @let is_long = width_px - 20.0 < LETTER_PX * words.chars().count() as f64;
                    @let fitted = is_long.then(|| n(width_px - 20.0, 1));
                    @let by = is_long.then_some("spacingAndGlyphs");
                    text class="result" x="10" y=(n(height_px - 9.0, 1)) textLength=[fitted] lengthAdjust=[by] { (words) }
                }
            }
        }
    }
}

/// Middle of the upper side of a label.
///
/// The text is centred there.
fn middle(label: &PlacedLabel) -> [f64; 2] {
    [label.at_px[0] + 0.5 * label.size_px[0], label.at_px[1]]
}

/// Transform of a line of length 1 that leads from the body to the label.
fn leader(label: &PlacedLabel, px: &str, deg: &str) -> String {
    let [[x, y], [to_x, to_y]] = label.leader_px();
    let turn_rad = libm::atan2(to_y - y, to_x - x);
    format!(
        "translate({}{px},{}{px}) rotate({}{deg}) scale({},1)",
        n(x, 1),
        n(y, 1),
        n(turn_rad.to_degrees(), 1),
        n(libm::hypot(to_x - x, to_y - y), 1)
    )
}

/// Label around the middle of its upper side.
fn words_of(label: &PlacedLabel) -> Markup {
    let [w, h] = label.size_px;
    // A short text has its lines in the middle of the height.
    let [_, own_h] = size_of(&label.lines);
    let first_px = 14.5 + 0.5 * (h - own_h);
    html! {
        rect x=(n(-0.5 * w, 1)) width=(n(w, 1)) height=(n(h, 1)) rx="5" {}
        @for (nth, line) in label.lines.iter().enumerate() {
            text class=[(nth == 0).then_some("who")] x="0" y=(n(first_px + 15.0 * nth as f64, 1)) text-anchor="middle" { (line) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::animation::camera::SCREEN;

    #[test]
    fn a_star_is_whole_within_the_picture_only() {
        // One pixel per metre.
        let camera = Camera::still(&SCREEN);
        let [x, y] = camera.middle_px();
        let foot_px = SCREEN.size_px[1] - y;
        for (place_m, is_whole) in [
            ([0.0, 0.0], true),
            ([STAR_PX + 1.0 - x, 0.0], true),
            ([STAR_PX - 1.0 - x, 0.0], false),
            ([x - STAR_PX + 1.0, 0.0], false),
            ([0.0, y - STAR_PX + 1.0], false),
            ([0.0, STAR_PX + 1.0 - foot_px], true),
            ([0.0, STAR_PX - 1.0 - foot_px], false),
        ] {
            assert_eq!(is_star_whole(&camera, place_m), is_whole, "{place_m:?}");
        }
    }
}
