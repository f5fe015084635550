//! Pictures of episodes that play on after the contact.

use serde_json::Value;

use super::data::json;
use super::looping::looping_picture;
use super::picture::Picture;
use super::tests::{acc, at, crash, keyframes, numbers, playing_on};
use super::{SCRIPT, write};
use crate::world::Scenario;

/// The world of `acc`, which plays on after a contact.
fn acc_with_aftermath() -> Scenario {
    playing_on(include_str!("../../../../../worlds/acc.ron"), 1.5)
}

#[test]
fn a_page_goes_on_after_the_contact_and_names_the_collision() {
    let scenario = acc_with_aftermath();
    let example = crash(&scenario);
    let contact_s = example.episode.contact.as_ref().expect("a contact").time_s;
    let after = example.after.as_ref().expect("played on");
    let picture = Picture::of(&scenario, &example, 0);
    let data: Value = serde_json::from_str(&json(&picture)).expect("JSON");
    let times = numbers(&data["t"]);
    let last_s = times.last().copied().expect("samples");
    assert!((last_s - contact_s - 1.5).abs() < 1e-3, "{last_s}");
    // The large still and its star stay those of the contact.
    let still_s = data["still"].as_f64().expect("a time");
    assert!((still_s - contact_s).abs() < 1e-3, "{still_s}");
    let ends = &after.frames[after.frames.len() - 1].placements;
    for (who, end) in ends.iter().enumerate() {
        let track = &picture.film.tracks[who];
        let shown_m = at(&times, &data["bodies"][who]["x"], last_s);
        assert!((shown_m - end.centre_m[0]).abs() < 0.01, "{shown_m}");
        let touched = picture.film.recorded - 1;
        assert!((shown_m - track.x_m[touched]).abs() > 1.0, "it moves on");
        // Speeds after the contact are those of the places.
        let (from, to) = (track.x_m.len() - 3, track.x_m.len() - 1);
        let mean_mps = (track.x_m[to] - track.x_m[from]) / (times[to] - times[from]);
        assert!((track.speed_mps[to - 1] - mean_mps.abs()).abs() < 0.2);
    }
    let [of_ego, of_ado] = after.motion.collisions[0].delta_v_mps.into();
    let caption =
        format!("After the contact: ego and ado collide, Δv {of_ego:.1} and {of_ado:.1} m/s");
    assert_eq!(data["after"][0][1], caption);
    let said_s = data["after"][0][0].as_f64().expect("a time");
    assert!((said_s - after.motion.collisions[0].time_s).abs() < 1e-3);
    assert!(SCRIPT.contains("film.after"));
    // A world may end its pages at the contact.
    assert!(!json(&Picture::of(&acc(), &crash(&acc()), 0)).contains("\"after\""));
}

#[test]
fn a_looping_picture_goes_on_after_the_contact_and_names_the_collision() {
    let scenario = acc_with_aftermath();
    let example = crash(&scenario);
    let picture = Picture::of(&scenario, &example, 0);
    let svg = looping_picture(&scenario, &example, "mine", None, None).svg();
    let film = &picture.film;
    for track in &film.tracks {
        let last = film.times_s.len() - 1;
        let turn_deg = write::n(track.heading_rad[last].to_degrees(), 1);
        let [x, y] = [track.x_m[last], track.y_m[last]].map(|it| write::n(it, 2));
        let pose = format!("transform:translate({x}px,{y}px) rotate({turn_deg}deg)");
        let ends = keyframes(&svg);
        assert!(
            ends.iter().any(|frames| frames[frames.len() - 1].1 == pose),
            "{pose}"
        );
    }
    assert!(film.end_s() - film.recorded_end_s() > 1.0);
    let touch = example.episode.contact.as_ref().expect("a contact");
    // The collision of the contact is said once, in words that fit the panel.
    let caption = format!(">Contact at {:.1} m/s<", touch.closing_speed_mps);
    assert!(svg.contains(&caption), "no {caption}");
}

fn is_below(svg: &str, below: &str, above: &str) -> bool {
    let at = |what: &str| svg.find(what).expect("it is drawn");
    at(below) < at(above)
}

#[test]
fn bodies_that_roll_on_cover_the_place_of_the_contact() {
    let scenario = acc_with_aftermath();
    let example = crash(&scenario);
    let picture = Picture::of(&scenario, &example, 0);
    let contact_s = picture.still_s();
    let screen = picture.screen("").into_string();
    assert!(is_below(&screen, "class=\"past\"", "class=\"body"));
    for moment in &picture.moments {
        let still = picture.thumb(moment).into_string();
        let count = |what: &str| still.matches(&format!("class=\"{what}\"")).count();
        let is_past = moment.time_s > contact_s + 1e-9;
        let is_touched = moment.time_s > contact_s - 1e-9;
        assert_eq!(count("burst"), usize::from(is_touched), "{moment:?}");
        assert_eq!(count("past"), usize::from(is_past), "{moment:?}");
        assert_eq!(count("ghost"), 2 * usize::from(is_past), "{moment:?}");
    }

    let looping = looping_picture(&scenario, &example, "mine", None, None);
    let svg = looping.svg();
    assert!(is_below(&svg, "class=\"past\"", "class=\"body a "));
    // The star above the bodies is the last one.
    let (before, _) = svg.rsplit_once("<polygon class=\"burst\"").expect("a star");
    let (_, group) = before.rsplit_once("<g class=\"s ").expect("a group");
    let (class, _) = group.split_once('"').expect("a class");
    let from_s = picture.film.end_s() - looping.motion_s();
    for (time_s, is_seen) in [
        (contact_s - 0.1, false),
        (contact_s + 0.01, true),
        (picture.film.end_s(), false),
    ] {
        let drawn = looping.at(time_s - from_s);
        let seen = format!(".{class}{{visibility:visible}}");
        assert_eq!(drawn.contains(&seen), is_seen, "{time_s} s");
    }
    // A still is that of the contact, and not of the end.
    let still = looping.still();
    assert!(still.contains(&format!(".{class}{{visibility:visible}}")));
    let touched = picture.film.recorded - 1;
    for track in &picture.film.tracks {
        let turn_deg = write::n(track.heading_rad[touched].to_degrees(), 1);
        let [x, y] = [track.x_m[touched], track.y_m[touched]].map(|it| write::n(it, 2));
        let pose = format!("transform:translate({x},{y}) rotate({turn_deg})");
        assert!(still.contains(&pose), "{pose}");
    }
}
