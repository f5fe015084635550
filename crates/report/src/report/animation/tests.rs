use serde_json::Value;

use super::camera::{Camera, SCREEN};
use super::data::json;
use super::picture::Picture;
use super::*;
use crate::run_dir::{About, Severity};
use crate::scene::{AgentDescription, Role};
use crate::seed::{Purpose, StartKey};
use crate::sim::Body;
use crate::testbench::{Aftermath, Constant, Episode, Film, film_beyond, play};

pub(in crate::report) fn world(text: &str) -> Scenario {
    Scenario::parse("world.ron", text).expect("a world")
}

/// First counterexample with a contact that a constant action causes.
pub(in crate::report) fn crash(scenario: &Scenario) -> Example {
    let mut bench = scenario.bench();
    let spaces = scenario.world().spaces();
    // The neutral action is no attack.
    let held: Vec<usize> = (0..spaces.actions)
        .filter(|action| *action != spaces.neutral)
        .collect();
    let tried = (0..200).flat_map(|index| held.iter().map(move |action| (index, *action)));
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

/// Episode as an example of a report.
pub(in crate::report) fn shown(scenario: &Scenario, episode: Episode) -> Example {
    let Film { frames, after } = film_beyond(&mut scenario.bench(), &episode);
    Example {
        chosen_for: "being one".to_owned(),
        start: None,
        frames,
        after,
        about: About {
            severity: Severity::of(&episode),
            ..About::default()
        },
        episode,
        scenarios: Vec::new(),
    }
}

/// A shipped world that plays on after a contact for a time.
pub(super) fn playing_on(text: &str, after_s: f64) -> Scenario {
    world(&text.replace(
        "plant: Rigid,",
        &format!("plant: Rigid, after_contact_s: {after_s:?},"),
    ))
}

/// Following, up to the contact.
pub(super) fn acc() -> Scenario {
    playing_on(include_str!("../../../../../worlds/acc.ron"), 0.0)
}

/// Value of a list at a time, interpolated as in play.js.
pub(super) fn at(times: &[f64], values: &Value, time_s: f64) -> f64 {
    let value = |i: usize| values[i].as_f64().expect("a number");
    let high = times
        .iter()
        .position(|t| time_s <= *t + 1e-9)
        .expect("within the film")
        .max(1);
    let (from, to) = (times[high - 1], times[high]);
    let share = ((time_s - from) / (to - from)).clamp(0.0, 1.0);
    value(high - 1) + share * (value(high) - value(high - 1))
}

pub(super) fn numbers(values: &Value) -> Vec<f64> {
    let values = values.as_array().expect("a list");
    values.iter().filter_map(Value::as_f64).collect()
}

/// Cut-in, in which y and heading of an agent change, up to the contact.
fn cut_in() -> Scenario {
    playing_on(include_str!("../../../../../worlds/cut_in.ron"), 0.0)
}

/// Numbers in the brackets after a name in a `transform`.
fn arguments(transform: &str, name: &str) -> Vec<f64> {
    let (_, rest) = transform.split_once(&format!("{name}(")).expect(name);
    let inside = rest.split(')').next().expect("brackets");
    let numbers = inside.split([' ', ',']);
    numbers.map(|it| it.parse().expect("a number")).collect()
}

#[test]
fn the_animation_shows_places_headings_and_speeds_of_the_trace() {
    for scenario in [acc(), cut_in()] {
        let example = crash(&scenario);
        let data: Value =
            serde_json::from_str(&json(&Picture::of(&scenario, &example, 0))).expect("JSON");
        let times = numbers(&data["t"]);
        let trace = &example.episode.trace;
        let end_s = example.episode.contact.as_ref().expect("a contact").time_s;
        let mut turned = 0.0_f64;
        for (who, agent) in scenario.bench().stage().agents.iter().enumerate() {
            let body = &data["bodies"][who];
            for (shown_m, size_m) in numbers(&body["size"]).iter().zip(agent.size_m) {
                assert!(
                    (shown_m - size_m).abs() < 1e-3,
                    "{}: {shown_m} m",
                    agent.name
                );
            }
            let column = |field: &str| {
                let name = format!("{}.{field}", agent.name);
                trace.signal(&name).expect("a signal").to_vec()
            };
            let (x_m, y_m) = (column("x"), column("y"));
            let (headings_rad, speeds_mps) = (column("heading"), column("speed"));
            for sample in 0..trace.len() {
                let time_s = (sample as f64 * trace.dt_s()).min(end_s);
                let heading_rad = at(&times, &body["h"], time_s);
                // The trace has the front bumper, and the picture the centre.
                let half_m = 0.5 * agent.size_m[0];
                let shown = [
                    at(&times, &body["x"], time_s) + half_m * heading_rad.cos() - x_m[sample],
                    at(&times, &body["y"], time_s) + half_m * heading_rad.sin() - y_m[sample],
                    heading_rad - headings_rad[sample],
                    at(&times, &body["v"], time_s) - speeds_mps[sample],
                ];
                for (off, most) in shown.iter().zip([0.01, 0.01, 0.002, 0.01]) {
                    assert!(off.abs() <= most, "{} at {time_s} s: {shown:?}", agent.name);
                }
                turned = turned.max(heading_rad.abs());
            }
        }
        // A world without a turn would not test headings.
        assert!(scenario.name == "acc" || turned > 0.02, "{turned} rad");
    }
}

#[test]
fn left_is_up_forward_is_right_and_bodies_are_turned_in_degrees() {
    let scenario = cut_in();
    let example = crash(&scenario);
    let picture = Picture::of(&scenario, &example, 0);
    let film = &picture.film;
    let i = film.at(0.5 * film.end_s());
    let camera = Camera::of(film, i, Some(picture.ego()), &SCREEN);
    let shown = camera.at([camera.centre_m[0] + 1.0, camera.centre_m[1] + 1.0]);
    let middle = camera.middle_px();
    assert!(middle[0] < shown[0] && shown[1] < middle[1], "{shown:?}");
    // The function that places labels and stars agrees with the transform of
    // the bodies.
    let transform = camera.transform();
    let scale = arguments(&transform, "scale");
    assert!((scale[0] - camera.scale).abs() < 1e-3 && (scale[1] + camera.scale).abs() < 1e-3);
    for (who, track) in film.tracks.iter().enumerate() {
        let pose = film.pose(who, i);
        let turn_deg = arguments(&pose, "rotate")[0];
        assert!(
            (turn_deg.to_radians() - track.heading_rad[i]).abs() < 1e-3,
            "{pose}"
        );
        let at = arguments(&pose, "translate");
        assert!((at[0] - track.x_m[i]).abs() < 1e-2 && (at[1] - track.y_m[i]).abs() < 1e-2);
    }
}

#[test]
fn the_violation_is_when_what_is_asked_is_lost() {
    // Bounds of ψ_ego in the two worlds.
    for (scenario, least_m) in [(acc(), 4.7), (cut_in(), 0.2)] {
        let example = crash(&scenario);
        let trace = &example.episode.trace;
        let name = if least_m < 1.0 {
            "ego.ado.gap"
        } else {
            "headway"
        };
        let distance_m = trace.signal(name).expect("a distance");
        let lost = distance_m.iter().position(|it| *it < least_m);
        let touch_s = example.episode.contact.as_ref().expect("a contact").time_s;
        let lost_s = (lost.expect("a violation") as f64 * trace.dt_s()).min(touch_s);
        let picture = Picture::of(&scenario, &example, 0);
        assert!((picture.violated_s - lost_s).abs() < 1e-9, "{lost_s} s");
        let told = picture
            .moments
            .iter()
            .find(|it| it.words.contains("requirement broken"));
        assert!((told.expect("the moment").time_s - lost_s).abs() <= 0.02);
        let data: Value = serde_json::from_str(&json(&picture)).expect("JSON");
        assert!((data["broken"].as_f64().expect("a time") - lost_s).abs() < 1e-3);
    }
}

#[test]
fn labels_say_the_speeds_and_actions_of_the_moment() {
    let scenario = acc();
    let example = crash(&scenario);
    let picture = Picture::of(&scenario, &example, 0);
    let film = &picture.film;
    let trace = &example.episode.trace;
    let sample = 20;
    let i = film.at(sample as f64 * trace.dt_s());
    let camera = Camera::of(film, i, Some(picture.ego()), &SCREEN);
    let content = labels::LabelContent {
        stage: &picture.shown.stage,
        film,
        moves: &picture.moves,
    };
    let labels = labels::labels(content, i, &camera);
    for (agent, label) in picture.shown.stage.agents.iter().zip(&labels) {
        let speeds_mps = trace.signal(&format!("{}.speed", agent.name));
        let speed_mps = speeds_mps.expect("a speed")[sample];
        assert_eq!(label.lines[0], format!("{} {speed_mps:.1} m/s", agent.name));
    }
    let clock = *scenario.bench().clock();
    let decision = sample / clock.samples_per_decision();
    let action = scenario.action_label(example.episode.actions[decision]);
    let number = action
        .trim_start_matches(['+', '-'])
        .split(' ')
        .next()
        .expect("a number");
    let ado = labels
        .iter()
        .find(|it| it.lines[0].starts_with("ado"))
        .expect("the ado");
    let said = ado.lines.get(1).expect("an action");
    assert!(
        said.contains(number) || number == "0",
        "{said} for {action}"
    );
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
    let page = animation(&scenario, &example, 0, &verdict).into_string();
    // The star appears in the large still and in that of the contact.
    assert_eq!(page.matches("class=\"burst\"").count(), 2);
    let camera = Camera::of(
        &picture.film,
        picture.film.times_s.len() - 1,
        Some(picture.ego()),
        &SCREEN,
    );
    let screen = picture.screen("").into_string();
    let star = screen.split("class=\"burst\"").nth(1).expect("a star");
    let [x, y] = camera.at(picture.contact_m().expect("a contact"));
    let shown = arguments(star, "translate");
    assert!(
        (shown[0] - x).abs() < 0.1 && (shown[1] - y).abs() < 0.1,
        "{shown:?}"
    );
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
        let agent = AgentDescription::of("ado", Role::Ado, &body);
        let drawn = bodies::body(&agent).into_string();
        let number = |text: &str, name: &str| -> Option<f64> {
            let (_, rest) = text.split_once(&format!(" {name}=\""))?;
            rest.split('"').next()?.parse().ok()
        };
        let reach = |axis: usize| {
            // The ring around a pedestrian is larger than its body.
            let shapes = drawn.split('<').filter(|it| !it.contains("ring"));
            let sides = shapes.filter_map(|shape| match axis {
                0 => number(shape, "x").map(|x| -x).or(number(shape, "rx")),
                _ => number(shape, "y").map(|y| -y).or(number(shape, "ry")),
            });
            2.0 * sides.fold(0.0, f64::max)
        };
        for axis in [0, 1] {
            let off_m = (reach(axis) - agent.size_m[axis]).abs();
            assert!(off_m < 0.002, "{name}, axis {axis}: {} m", reach(axis));
        }
    }
}

#[test]
fn the_camera_keeps_the_conflict_in_the_picture() {
    let bend = world(include_str!("../../../../../worlds/bend.ron"));
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
            assert!(camera.scale * ego_m >= 60.0, "{} px", camera.scale * ego_m);
            let track = &picture.film.tracks[ego];
            let [x, y] = camera.at(picture.film.turned(track.x_m[i], track.y_m[i]));
            let half_px = 0.5 * ego_m * camera.scale;
            assert!(half_px <= x && x <= width_px - half_px && y >= 20.0 && y <= height_px - 20.0);
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

/// Values of every list of keyframes, with their percentages.
pub(super) fn keyframes(svg: &str) -> Vec<Vec<(f64, String)>> {
    let lists = svg.split("@keyframes ").skip(1);
    let list = |text: &str| -> Vec<(f64, String)> {
        let frames = text
            .split_once("{")
            .expect("a list")
            .1
            .split("}}")
            .next()
            .expect("its end")
            .split('}');
        let frame = |it: &str| {
            let (percent, value) = it.split_once("%{").expect("a frame");
            (percent.parse().expect("a percent"), value.to_owned())
        };
        frames.map(frame).collect()
    };
    lists.map(list).collect()
}

#[test]
fn a_looping_picture_moves_everybody_from_the_first_to_the_last_pose() {
    for scenario in [acc(), cut_in()] {
        let example = crash(&scenario);
        let picture = Picture::of(&scenario, &example, 0);
        let svg = looping_picture(&scenario, &example, "mine", None, None).svg();
        assert!(svg.contains("prefers-reduced-motion") && !svg.contains("<script"));
        // Programs without CSS variables draw it, too.
        assert!(!svg.contains("var(--"), "a variable is left");
        for frames in keyframes(&svg) {
            let percents: Vec<f64> = frames.iter().map(|(percent, _)| *percent).collect();
            assert!(percents.is_sorted() && percents[0] == 0.0, "{percents:?}");
            assert_eq!(percents.last(), Some(&100.0));
        }
        let film = &picture.film;
        let from_s = (film.end_s() - looping::BEFORE_S).max(0.0);
        let (first, last) = (film.at(from_s), film.times_s.len() - 1);
        for track in &film.tracks {
            let pose = |i: usize| {
                let turn_deg = write::n(track.heading_rad[i].to_degrees(), 1);
                let [x, y] = [track.x_m[i], track.y_m[i]].map(|it| write::n(it, 2));
                format!("transform:translate({x}px,{y}px) rotate({turn_deg}deg)")
            };
            let all = keyframes(&svg);
            let of = |frames: &&Vec<(f64, String)>| {
                frames[0].1 == pose(first) && frames[frames.len() - 1].1 == pose(last)
            };
            assert!(
                all.iter().any(|it| of(&it)),
                "{} to {}",
                pose(first),
                pose(last)
            );
        }
        let touch = example.episode.contact.as_ref().expect("a contact");
        let ending = format!("Contact at {:.1} m/s", touch.closing_speed_mps);
        assert!(svg.contains(&ending) && svg.matches("class=\"burst\"").count() == 1);
    }
}

#[test]
fn the_script_moves_shapes_as_the_stills_were_drawn() {
    // Formulas of Camera and Picture, in the text of the script.
    let [across_px, along_px] = SCREEN.margin_px;
    let foot_px = SCREEN.foot_px;
    let same = [
        "scale(${scale} ${-scale})".to_owned(),
        "0.5 * room[0] + (a - centre[0]) * scale, 0.5 * room[1] - (b - centre[1]) * scale]"
            .to_owned(),
        "translate(${pose.x} ${pose.y}) rotate(${pose.h * 180 / Math.PI})".to_owned(),
        format!("const margin = wide ? [{across_px}, {along_px}]"),
        format!("const foot = wide ? {foot_px}"),
        format!("pose.a < -{}", super::picture::BRAKES_MPS2),
        format!("film.still + {} < time", super::picture::STAR_S),
        format!("room[1] / {}", SCREEN.least_height_m),
        "${body.name} ${pose.v.toFixed(1)} m/s".to_owned(),
        "Math.min(0.1, (now - before) / 1000)".to_owned(),
    ];
    for words in same {
        assert!(SCRIPT.contains(&words), "{words}");
    }
}
