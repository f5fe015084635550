//! Traffic lights: signals beside the road and the controllers that switch them.

use super::path::sample_time_s;
use super::stretch::Stretch;
use crate::ego::Phase;
use crate::scene::Passage;
use crate::scene::drive::DriveSpec;
use crate::xml::XmlElement;

/// Extra duration of the last phase beyond the episode, in seconds.
const LAST_LONGER_S: f64 = 1000.0;
/// Distance of a post from the right edge of the rightmost lane, in metres.
const BESIDE_M: f64 = 1.0;

/// Identifier of a light, shared by the OpenDRIVE and OpenSCENARIO files.
// Identifiers count from 1, like those of the roads.
fn id(light: usize) -> String {
    (light + 1).to_string()
}

/// Signal posts at every stop line of a road.
pub(super) fn signals(spec: &DriveSpec, road: usize, stretch: Stretch) -> XmlElement {
    // The reference line is the course of lane 0, so its right edge lies half a
    // lane to the right (negative t).
    let beside_m = -0.5 * spec.road_at(road).lane_width_m() - BESIDE_M;
    let posts = spec.lights_of(road).map(|(number, light)| {
        XmlElement::new("signal")
            .number("s", stretch.s_m(light.line_m))
            .number("t", beside_m)
            .text("id", id(number))
            .text("name", &light.name)
            .text("dynamic", "yes")
            .text("orientation", "+")
            .number("zOffset", 2.5)
            // A light with three bulbs, in OpenDRIVE's own catalogue.
            .text("country", "OpenDRIVE")
            .text("type", "1000001")
            .text("subtype", "-1")
            .number("height", 1.0)
            .number("width", 0.35)
    });
    XmlElement::new("signals").children(posts)
}

/// Signal controllers, each with the recorded phases of its light.
pub(super) fn controllers(spec: &DriveSpec, passage: &Passage) -> XmlElement {
    let lights = spec.lights.iter().enumerate();
    let controllers = lights.map(|(number, light)| {
        // Recorded phases and not the cycle of the light: a replay shows what
        // was recorded.
        let shown: Vec<Phase> = passage.phases.iter().map(|row| row[number]).collect();
        let phases = phases(&shown, spec.clock.sample_s)
            .into_iter()
            .enumerate()
            .map(|(i, (phase, duration_s))| {
                let state = XmlElement::new("TrafficSignalState")
                    .text("trafficSignalId", id(number))
                    .text("state", bulbs(phase));
                XmlElement::new("Phase")
                    // A cycle shows a phase more than once, and names of phases must
                    // differ.
                    .text("name", format!("{} {}", i + 1, word(phase)))
                    .number("duration", duration_s)
                    .child(state)
            });
        let controller = XmlElement::new("TrafficSignalController").text("name", &light.name);
        controller.children(phases)
    });
    XmlElement::new("TrafficSignals").children(controllers)
}

/// Phases with their durations in seconds, from the phase shown at every sample.
fn phases(shown: &[Phase], sample_s: f64) -> Vec<(Phase, f64)> {
    let mut begun: Vec<(Phase, usize)> = Vec::new();
    for (sample, &phase) in shown.iter().enumerate() {
        if begun.last().is_none_or(|(last, _)| *last != phase) {
            begun.push((phase, sample));
        }
    }
    // A phase ends at the first sample of the next phase, the last phase at the
    // final sample.
    let ends: Vec<usize> = begun
        .iter()
        .skip(1)
        .map(|(_, sample)| *sample)
        .chain([shown.len().saturating_sub(1)])
        .collect();
    let last = begun.len().saturating_sub(1);
    let spans = begun
        .iter()
        .zip(ends)
        .enumerate()
        .map(|(number, ((phase, from), to))| {
            // Players repeat the cycle of a controller. A long last phase keeps
            // them from starting it again before the scenario ends.
            let longer_s = if number == last { LAST_LONGER_S } else { 0.0 };
            (*phase, sample_time_s(to - from, sample_s) + longer_s)
        });
    spans.collect()
}

/// State of the bulbs from top to bottom: red, yellow, green.
fn bulbs(phase: Phase) -> &'static str {
    match phase {
        Phase::Red => "on;off;off",
        Phase::Yellow => "off;on;off",
        Phase::Green => "off;off;on",
    }
}

fn word(phase: Phase) -> &'static str {
    match phase {
        Phase::Red => "red",
        Phase::Yellow => "yellow",
        Phase::Green => "green",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_last_until_the_next_and_the_last_one_longer() {
        use Phase::{Green, Red, Yellow};
        let shown = [Green, Green, Yellow, Red, Red, Green];
        let lasted = [(Green, 0.1), (Yellow, 0.05), (Red, 0.1), (Green, 1000.0)];
        assert_eq!(phases(&shown, 0.05), lasted);
        assert_eq!(phases(&[Red], 0.05), [(Red, 1000.0)]);
    }
}
