//! Stills of a film: a large still, and small stills of its moments.

use maud::{Markup, html};

use super::bodies::{body, colour_class};
use super::camera::{Camera, Canvas, SCREEN, THUMB};
use super::film_tracks::{FilmTracks, is_on_cells};
use super::ground::{cells, lights, road, trails};
use super::labels::{LabelContent, drawn, labels};
use super::moments::{KeyMoment, captions, moments};
use super::moves::{Move, go_on, moves};
use super::write::n;
use crate::ego::Phase;
use crate::experiment::EpisodeFrames;
use crate::report::Example;
use crate::scene::Frame;
use crate::world::Scenario;

/// Deceleration in m/s² above which brake lamps are lit.
pub(super) const BRAKES_MPS2: f64 = 0.8;

/// Time in seconds for which the star of a contact lies above bodies that roll on.
pub(super) const STAR_S: f64 = 0.4;

/// Content of an example's picture.
pub(super) struct Picture<'a> {
    pub example: &'a Example,
    pub shown: EpisodeFrames,
    pub film: FilmTracks,
    /// Colour classes of all agents.
    pub classes: Vec<String>,
    /// Moves of each ado by name.
    pub moves: Vec<(String, Vec<Move>)>,
    pub moments: Vec<KeyMoment>,
    /// Captions of the collisions and pushes after the contact, by time in seconds.
    pub after: Vec<(f64, String)>,
    /// Time of the violation of ψ_ego in seconds.
    pub violated_s: f64,
    /// Violated leaf of ψ_ego.
    pub broken: String,
    /// True for a world of cells.
    pub on_cells: bool,
    /// Number that makes its identifiers unique on the page.
    id: usize,
}

impl<'a> Picture<'a> {
    /// Returns the picture of an example with frames.
    pub(super) fn of(scenario: &Scenario, example: &'a Example, id: usize) -> Picture<'a> {
        // The road is that of the episode.
        let stage = scenario.of_episode(&example.episode).bench().stage();
        let (frames, after) = (&example.frames, example.after.as_ref());
        let shown = EpisodeFrames::of(scenario, &example.episode, stage, frames, after);
        let film = FilmTracks::of(&shown, after);
        // A specification that holds is certain at the end only.
        let violated_s = shown.decided.unwrap_or(shown.judged).time_s;
        let why = example.about.why.as_ref();
        let mut moves = moves(scenario, &example.episode, film.recorded_end_s());
        let mut moments = moments(scenario, example, violated_s, &moves);
        if let Some(after) = &example.after {
            // After the moments, which are those of the recorded drive.
            go_on(&mut moves, after, film.end_s());
            moments.push(KeyMoment {
                time_s: film.end_s(),
                words: "after the contact".to_owned(),
                class: "k-contact",
            });
        }
        Picture {
            example,
            classes: (0..shown.stage.agents.len())
                .map(|who| colour_class(&shown.stage.agents, who))
                .collect(),
            after: example.after.as_ref().map(captions).unwrap_or_default(),
            moments,
            moves,
            violated_s,
            broken: why.map(|why| why.leaf.clone()).unwrap_or_default(),
            on_cells: is_on_cells(&shown.stage),
            shown,
            film,
            id,
        }
    }

    /// Time of the large still: the contact, otherwise the violation.
    pub(super) fn still_s(&self) -> f64 {
        let contact = self.example.episode.contact.as_ref();
        // Without a contact, the moment that decided the episode.
        contact.map_or(self.violated_s, |touch| touch.time_s)
    }

    /// Frames of the example, with those after the contact.
    pub(super) fn frames(&self) -> impl Iterator<Item = &Frame> + Clone {
        self.shown.poses()
    }

    /// Index of the ego in the cast, and its length.
    pub(super) fn ego(&self) -> (usize, f64) {
        let ego = self.shown.ego();
        (ego, self.shown.stage.agents[ego].size_m[0])
    }

    fn camera<'c>(&self, i: usize, canvas: &'c Canvas) -> Camera<'c> {
        // A grid is shown as a whole, so the camera ignores the ego.
        let ego = (!self.on_cells).then(|| self.ego());
        Camera::of(&self.film, i, ego, canvas)
    }

    /// Large still, whose parts play.js moves.
    pub(super) fn screen(&self, label: &str) -> Markup {
        let i = self.film.at(self.still_s());
        let camera = self.camera(i, &SCREEN);
        let [width_px, height_px] = SCREEN.size_px;
        let content = LabelContent {
            stage: &self.shown.stage,
            film: &self.film,
            moves: &self.moves,
        };
        let words = labels(content, i, &camera);
        html! {
            svg class="stage" viewBox=(format!("0 0 {width_px} {height_px}")) role="img" aria-label=(label) {
                defs {
                    g id=(self.part("ground")) { @if self.on_cells { (cells(&self.shown.stage)) } @else { (road(&self.shown.stage, self.frames())) } }
                    @for (who, agent) in self.shown.stage.agents.iter().enumerate() {
                        g id=(self.body(who)) class=(self.classes[who]) { (body(agent)) }
                    }
                }
                g class="world" transform=(camera.transform()) {
                    use href={ "#" (self.part("ground")) } {}
                    g class="trails" { (trails(&self.film, &self.classes)) }
                    (lights(&self.shown.stage, &self.phases(i)))
                    g class="ghosts" { (self.outlines(self.violated_s)) }
                    // Shown by play.js, since the large still is that of the contact.
                    g class="met" style="display:none" { (self.past_contact(camera.scale)) }
                    @for who in 0..self.shown.stage.agents.len() { (self.placed(who, i)) }
                }
                @if let Some([x, y]) = self.contact_m().map(|at| camera.at(at)) { (burst(x, y)) }
                @for (label, class) in words.iter().zip(&self.classes) { (drawn(label, class)) }
            }
        }
    }

    /// Small still of a moment with its words. play.js jumps to it.
    pub(super) fn thumb(&self, moment: &KeyMoment) -> Markup {
        let i = self.film.at(moment.time_s);
        let camera = self.camera(i, &THUMB);
        let [width_px, height_px] = THUMB.size_px;
        let end_s = self.film.recorded_end_s();
        // The tolerance is for a moment at the very end, whose time is a sum.
        let is_past = end_s + 1e-9 < moment.time_s;
        let touched = self
            .contact_m()
            .filter(|_| !is_past && end_s <= moment.time_s + 1e-9);
        html! {
            button type="button" class={ "thumb " (moment.class) } data-t=(n(moment.time_s, 3)) {
                svg viewBox=(format!("0 0 {width_px} {height_px}")) aria-hidden="true" {
                    g class="world" transform=(camera.transform()) {
                        use href={ "#" (self.part("ground")) } {}
                        (lights(&self.shown.stage, &self.phases(i)))
                        @if is_past { (self.past_contact(camera.scale)) }
                        @for who in 0..self.shown.stage.agents.len() { (self.placed(who, i)) }
                    }
                    @for who in 0..self.shown.stage.agents.len() { (self.beyond(who, i, &camera)) }
                    @if let Some([x, y]) = touched.map(|at| camera.at(at)) { (burst(x, y)) }
                }
                span { b { (format!("{:.2} s", moment.time_s)) } " " (moment.words) }
            }
        }
    }

    /// Arrow at the edge for an agent outside of a still.
    fn beyond(&self, who: usize, i: usize, camera: &Camera<'_>) -> Markup {
        let [width_px, height_px] = camera.canvas.size_px;
        let track = &self.film.tracks[who];
        let [x, y] = camera.at(self.film.turned(track.x_m[i], track.y_m[i]));
        // Only to the sides: the road runs through the picture from left to right.
        let turn_deg = match (x < 0.0, width_px < x) {
            (true, _) => 180,
            (_, true) => 0,
            _ => return html! {},
        };
        // The triangle is 8 px long and stays whole at the edge.
        let (x, y) = (x.clamp(9.0, width_px - 9.0), y.clamp(9.0, height_px - 9.0));
        html! {
            polygon class={ "beyond " (self.classes[who]) } transform=(format!("translate({} {}) rotate({turn_deg})", n(x, 1), n(y, 1))) points="8,0 -6,-7 -6,7" {}
        }
    }

    /// Place of the contact in the picture's directions.
    pub(super) fn contact_m(&self) -> Option<[f64; 2]> {
        let touch = self.example.episode.contact.as_ref()?;
        Some(self.film.turned(touch.point_m[0], touch.point_m[1]))
    }

    fn phases(&self, i: usize) -> Vec<Phase> {
        let phases = self.film.phases.iter();
        phases.map(|phases| phases[i]).collect()
    }

    /// Body at its pose of a sample, with brake lamps if it brakes.
    fn placed(&self, who: usize, i: usize) -> Markup {
        let brakes = self.film.tracks[who].accel_mps2[i] < -BRAKES_MPS2;
        html! {
            g class=(if brakes { "body braking" } else { "body" }) transform=(self.film.pose(who, i)) {
                use href={ "#" (self.body(who)) } {}
            }
        }
    }

    /// Outlines of the ego and the encountered agent at a time.
    fn outlines(&self, time_s: f64) -> Markup {
        let i = self.film.at(time_s);
        let (ego, _) = self.ego();
        html! {
            @for who in std::iter::once(ego).chain(self.film.opponent).filter(|_| !self.on_cells) {
                @let [length_m, width_m, _] = self.shown.stage.agents[who].size_m;
                g transform=(self.film.pose(who, i)) {
                    rect class="ghost" x=(n(-0.5 * length_m, 3)) y=(n(-0.5 * width_m, 3)) width=(n(length_m, 3)) height=(n(width_m, 3)) rx="0.3" {}
                }
            }
        }
    }

    /// Place of the contact, to be drawn below bodies that have rolled on from it.
    ///
    /// It has the outlines of that instant and a faded star, whose size is constant at
    /// `scale` pixels per metre. Empty if nothing moves after the contact.
    pub(super) fn past_contact(&self, scale: f64) -> Markup {
        let played_on = self.example.after.is_some();
        let touch = self.example.episode.contact.as_ref().filter(|_| played_on);
        html! {
            @if let Some(touch) = touch {
                (self.outlines(touch.time_s))
                g transform=(format!("translate({} {})", n(touch.point_m[0], 2), n(touch.point_m[1], 2))) {
                    g class="past" transform=(format!("scale({})", n(1.0 / scale, 5))) { (burst(0.0, 0.0)) }
                }
            }
        }
    }

    /// Identifier of a part that is drawn once and used several times.
    pub(super) fn part(&self, name: &str) -> String {
        // Ids must be unique on a page with several films.
        format!("film{}-{name}", self.id)
    }

    /// Identifier of a body's shape.
    pub(super) fn body(&self, who: usize) -> String {
        self.part(&format!("body{who}"))
    }
}

/// Star at a contact, of one size at any scale.
pub(super) fn burst(x: f64, y: f64) -> Markup {
    let point = |nth| {
        let turn_rad = f64::from(nth) * std::f64::consts::TAU / 16.0;
        // A star of eight points.
        let reach_px = if nth % 2 == 0 { 15.0 } else { 6.5 };
        let (sin, cos) = libm::sincos(turn_rad);
        format!("{},{}", n(reach_px * cos, 1), n(reach_px * sin, 1))
    };
    let points: Vec<String> = (0..16).map(point).collect();
    html! {
        polygon class="burst" transform=(format!("translate({} {})", n(x, 1), n(y, 1))) points=(points.join(" ")) {}
    }
}
