use serde_json::Value;

use super::camera::{Camera, SCREEN};
use super::data::json;
use super::picture::Picture;
use super::*;
use crate::run::{About, Severity};
use crate::scene::{Cast, Role};
use crate::seed::{Purpose, StartKey};
use crate::sim::Body;
use crate::testbench::{Aftermath, Constant, Episode, film, play};

fn world(text: &str) -> Scenario {
    Scenario::parse("world.ron", text).expect("a world")
}

/// The first counterexample with a contact that one action, held, gives.
fn crash(scenario: &Scenario) -> Example {
    let mut bench = scenario.bench();
    let tried = (0..200).flat_map(|index| [(index, 0), (index, 2)]);
    let found = tried.map(|(index, action)| {
        let start = bench.draw(StartKey {
            purpose: Purpose::Train,
            seed: 1,
            index,
        });
        play(
            &mut bench,
            &start,
            0,
            &mut Constant(action),
            Aftermath::Play,
        )
    });
    let crashed = found
        .filter(|episode| episode.verdict.is_success())
        .find(|episode| episode.contact.is_some());
    shown(scenario, crashed.expect("a crash"))
}

/// An episode as an example of a report.
fn shown(scenario: &Scenario, episode: Episode) -> Example {
    Example {
        chosen_for: "being one".to_owned(),
        start: 0,
        frames: film(&mut scenario.bench(), &episode),
        about: About {
            severity: Severity::of(&episode),
            ..About::default()
        },
        episode,
    }
}

fn acc() -> Scenario {
    world(include_str!("../../../worlds/acc.ron"))
}

/// The value of a list at a time, as play.js reads it.
fn at(times: &[f64], values: &Value, time_s: f64) -> f64 {
    let value = |i: usize| values[i].as_f64().expect("a number");
    let high = times.iter().position(|t| time_s <= *t + 1e-9);
    let high = high.expect("within the film").max(1);
    let (from, to) = (times[high - 1], times[high]);
    let share = ((time_s - from) / (to - from)).clamp(0.0, 1.0);
    value(high - 1) + share * (value(high) - value(high - 1))
}

fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().expect("a list");
    values.iter().filter_map(Value::as_f64).collect()
}

#[test]
fn the_animation_shows_the_poses_of_the_trace() {
    let scenario = acc();
    let example = crash(&scenario);
    let data = json(&Picture::of(&scenario, &example, 0));
    let data: Value = serde_json::from_str(&data).expect("JSON");
    let times = numbers(&data["t"]);
    let trace = &example.episode.trace;
    let end_s = example.episode.contact.as_ref().expect("a contact").time_s;
    for (who, cast) in scenario.bench().stage().cast.iter().enumerate() {
        let body = &data["bodies"][who];
        let front_m = trace.signal(&format!("{}.x", cast.name)).expect("a place");
        for (sample, front_m) in front_m.iter().enumerate() {
            let time_s = (sample as f64 * trace.dt_s()).min(end_s);
            let heading_rad = at(&times, &body["h"], time_s);
            let shown_m = at(&times, &body["x"], time_s) + 0.5 * cast.size_m[0] * heading_rad.cos();
            let off_m = (shown_m - front_m).abs();
            assert!(off_m <= 0.01, "{} at {time_s} s: {off_m} m", cast.name);
        }
    }
}

#[test]
fn the_contact_is_marked_when_and_where_it_is() {
    let scenario = acc();
    let example = crash(&scenario);
    let touch = example.episode.contact.clone().expect("a contact");
    let picture = Picture::of(&scenario, &example, 0);
    let data: Value = serde_json::from_str(&json(&picture)).expect("JSON");
    let last_s = numbers(&data["t"]).last().copied().expect("samples");
    assert!((last_s - touch.time_s).abs() < 1e-3, "{last_s}");
    let last = picture.moments.last().expect("moments");
    assert_eq!((last.time_s, last.class), (touch.time_s, "k-contact"));
    assert!((picture.violated_s - touch.time_s).abs() < 15.0);
    let at = numbers(&data["contact"]);
    assert!((at[0] - touch.point_m[0]).abs() < 0.01 && (at[1] - touch.point_m[1]).abs() < 0.01);
    let verdict = VerdictWords::of(&scenario, &example);
    let page = animation(&scenario, &example, (0, &verdict)).into_string();
    assert!(page.contains("class=\"burst\""));
    let sentence = format!(
        "The ego hit the rear of ado at {:.1} m/s",
        touch.closing_speed_mps
    );
    assert!(
        verdict.sentence().starts_with(&sentence),
        "{}",
        verdict.sentence()
    );
}

#[test]
fn bodies_have_their_true_sizes() {
    for name in ["sedan", "van", "truck", "motorcycle", "pedestrian"] {
        let body = Body::shipped(name).unwrap().unwrap();
        let cast = Cast {
            name: "ado".to_owned(),
            role: Role::Ado,
            body: name.to_owned(),
            size_m: [body.length_m, body.width_m, body.height_m],
            colour: body.color_rgb,
            on_foot: body.is_on_foot(),
        };
        let drawn = bodies::body(&cast).into_string();
        let number = |text: &str, name: &str| -> Option<f64> {
            let (_, rest) = text.split_once(&format!(" {name}=\""))?;
            rest.split('"').next()?.parse().ok()
        };
        let reach = |axis: usize| {
            let shapes = drawn.split('<').filter(|it| !it.contains("ring"));
            let sides = shapes.filter_map(|shape| match axis {
                0 => number(shape, "x").map(|x| -x).or(number(shape, "rx")),
                _ => number(shape, "y").map(|y| -y).or(number(shape, "ry")),
            });
            2.0 * sides.fold(0.0, f64::max)
        };
        for axis in [0, 1] {
            let off_m = (reach(axis) - cast.size_m[axis]).abs();
            assert!(off_m < 0.002, "{name}, axis {axis}: {} m", reach(axis));
        }
    }
}

#[test]
fn the_camera_keeps_the_conflict_in_the_picture() {
    let bend = world(include_str!("../../../worlds/bend.ron"));
    let mut bench = bend.bench();
    let start = bench.draw(StartKey {
        purpose: Purpose::Train,
        seed: 1,
        index: 0,
    });
    let around = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
    let acc = acc();
    for (scenario, example) in [(&acc, crash(&acc)), (&bend, shown(&bend, around))] {
        let picture = Picture::of(scenario, &example, 0);
        let (ego, ego_m) = picture.ego();
        let [width_px, height_px] = SCREEN.size_px;
        for i in 0..picture.film.times_s.len() {
            let camera = Camera::of(&picture.film, i, Some((ego, ego_m)), &SCREEN);
            assert!(60.0 <= camera.scale * ego_m, "{} px", camera.scale * ego_m);
            let track = &picture.film.tracks[ego];
            let [x, y] = camera.at(picture.film.turned(track.x_m[i], track.y_m[i]));
            let half_px = 0.5 * ego_m * camera.scale;
            assert!(half_px <= x && x <= width_px - half_px && 20.0 <= y && y <= height_px - 20.0);
        }
        let last = picture.film.times_s.len() - 1;
        let camera = Camera::of(&picture.film, last, Some((ego, ego_m)), &SCREEN);
        let met = example.episode.contact.is_some();
        for track in picture.film.tracks.iter().filter(|_| met) {
            let [x, _] = camera.at(picture.film.turned(track.x_m[last], track.y_m[last]));
            assert!((0.0..=width_px).contains(&x), "{x}");
        }
    }
}
