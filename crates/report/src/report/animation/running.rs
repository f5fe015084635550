//! Current sample of a running episode, as a picture of constant size and scale.
//!
//! The ego drives to the right, so the frames of one episode are a steady video.

use maud::{PreEscaped, html};

use super::SHAPES;
use super::bodies::{body, colour_class};
use super::camera::{Camera, Canvas};
use super::film_tracks::{FilmTracks, is_on_cells};
use super::ground::{cells, lights, road};
use super::labels::{LabelContent, drawn, labels};
use super::looping::{OWN_STYLE, strokes};
use super::moves::moves;
use super::picture::{BRAKES_MPS2, burst};
use super::write::n;
use crate::experiment::EpisodeFrames;
use crate::report::file_style::file_style;
use crate::report::page::STYLE;
use crate::report::verdict::{capital, outcome_in_words};
use crate::rulebook::Verdict;
use crate::testbench::{Episode, Testbench};
use crate::visible::visible_markup;
use crate::world::Scenario;

/// Layout. Both sides are multiples of 16, as encoders of videos ask.
const CANVAS: Canvas = Canvas {
    size_px: [896.0, 288.0],
    margin_px: [40.0, 40.0],
    foot_px: 28.0,
    ego_px: 44.0,
    least_height_m: 9.0,
};
/// Pixels per metre in worlds of vehicles.
const SCALE: f64 = 9.0;
/// Distance in metres from the ego to the middle of the picture, ahead of it.
const AHEAD_M: f64 = 14.0;

/// Draws the current sample of a running or ended episode as an SVG of 896 × 288 pixels.
///
/// `episode` is the record of the samples so far. Its actions are beside the ados, and
/// its verdict, once `bench` has one, is at the bottom.
pub fn running_picture(scenario: &Scenario, bench: &Testbench, episode: &Episode) -> String {
    let shown = EpisodeFrames::now(bench);
    let stage = &shown.stage;
    let mut film = FilmTracks::of(&shown, None);
    // A single frame has no slope of its speeds.
    for (track, sample) in film.tracks.iter_mut().zip(bench.bodies()) {
        track.accel_mps2 = vec![sample.state.accel_mps2];
    }
    let on_cells = is_on_cells(stage);
    let scale = if on_cells {
        Camera::fitting(&film, 0, None, &CANVAS)
    } else {
        let track = &film.tracks[shown.ego()];
        film.turn_rad = track.heading_rad[0];
        let [x, y] = film.turned(track.x_m[0], track.y_m[0]);
        // The ego is left of the middle, since what happens is ahead of it.
        film.focus[0].centre_m = [x + AHEAD_M, y];
        SCALE
    };
    let camera = Camera::at_scale(&film, 0, None, scale, &CANVAS);
    let classes: Vec<String> = (0..stage.agents.len())
        .map(|who| colour_class(&stage.agents, who))
        .collect();
    let time_s = film.end_s();
    let moves = moves(scenario, episode, time_s);
    let content = LabelContent {
        stage,
        film: &film,
        moves: &moves,
    };
    let words = labels(content, 0, &camera);
    let phases: Vec<_> = film.phases.iter().map(|it| it[0]).collect();
    let contact = shown.contact.as_ref();
    let star = contact.map(|touch| camera.at(film.turned(touch.point_m[0], touch.point_m[1])));
    let [width_px, height_px] = CANVAS.size_px;
    let foot_px = height_px - CANVAS.foot_px;
    let outcome = bench.verdict().map(|verdict| {
        let class = match verdict {
            Verdict::Counterexample { .. } | Verdict::Uncounted { .. } => "poor",
            Verdict::Held { .. } => "fine",
            Verdict::Foul { .. } | Verdict::Invalid => "plate",
        };
        (class, capital(&outcome_in_words(scenario, episode)))
    });
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width_px} {height_px}")) width=(width_px) height=(height_px) {
            style { (PreEscaped(file_style(&[STYLE, SHAPES, OWN_STYLE]))) (PreEscaped(strokes(scale))) }
            rect class="ground" width=(width_px) height=(height_px) {}
            g transform=(camera.transform()) {
                @if on_cells { (cells(stage)) } @else { (road(stage, shown.poses())) }
                (lights(stage, &phases))
                @for (who, agent) in stage.agents.iter().enumerate() {
                    @let brakes = film.tracks[who].accel_mps2[0] < -BRAKES_MPS2;
                    g class={ "body " (classes[who]) @if brakes { " braking" } } transform=(film.pose(who, 0)) { (body(agent)) }
                }
            }
            @if let Some([x, y]) = star { (burst(x, y)) }
            @for (label, class) in words.iter().zip(&classes) { (drawn(label, class)) }
            rect class="plate" width=(width_px) height="25" {}
            text class="title" x="10" y="17.5" { (scenario.name()) ", " (format!("{time_s:.2} s")) }
            @if let Some((class, words)) = outcome {
                rect class=(class) y=(n(foot_px, 1)) width=(width_px) height=(n(CANVAS.foot_px, 1)) {}
                text class="result" x="10" y=(n(foot_px + 19.0, 1)) { (words) }
            }
        }
    };
    visible_markup(&svg.into_string()).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::Aftermath;

    /// Pictures of an episode's first and last sample, with one action throughout.
    fn ends(world: &str, action: usize) -> [String; 2] {
        let scenario = Scenario::shipped(world).expect("shipped").expect("sound");
        let mut bench = scenario.bench();
        let start = bench.draw(StartKey {
            purpose: Purpose::Train,
            seed: 3,
            index: 0,
        });
        bench.begin(&start, 0, Aftermath::Skip);
        let drawn = |bench: &Testbench, actions| {
            let episode = bench.episode(&start, 0, actions);
            running_picture(&scenario, bench, &episode)
        };
        let first = drawn(&bench, Vec::new());
        let mut actions = Vec::new();
        while !bench.is_done() {
            bench.decide(action);
            actions.push(action);
        }
        [first, drawn(&bench, actions)]
    }

    #[test]
    fn every_kind_of_world_has_pictures_of_its_first_and_last_sample() {
        for world in [
            "acc",
            "merge",
            "pedestrian",
            "yellow_light",
            "grid_hard",
            "crossroads",
        ] {
            let [first, last] = ends(world, 0);
            assert!(
                first.contains(&format!(">{world}, 0.00 s<")),
                "{world}: {first}"
            );
            assert!(
                first != last && !first.contains("class=\"result\""),
                "{world}"
            );
            assert!(last.contains("class=\"result\""), "{world}");
            for svg in [&first, &last] {
                assert!(
                    !svg.contains("NaN") && !svg.contains("inf"),
                    "{world}: {svg}"
                );
                assert!(
                    svg.contains("class=\"body c-ego") || svg.contains("c-ego"),
                    "{world}"
                );
            }
        }
    }

    #[test]
    fn the_ego_stays_at_one_place_and_actions_are_beside_the_ados() {
        let [first, last] = ends("acc", 0);
        let camera = |svg: &str| svg.split("scale(9.0000 -9.0000)").count();
        assert_eq!((camera(&first), camera(&last)), (2, 2));
        assert!(
            !first.contains("brakes −") && last.contains("◀ brakes −"),
            "{last}"
        );
    }
}
