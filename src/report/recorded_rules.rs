//! Rules on recorded traffic: JUnit XML, and a picture of the worst instant.

use brakecheck_traffic::{Analysis, Carriageway, RoadUserTrack, RuleResult};
use maud::{Markup, PreEscaped, html};

use crate::visible::visible_markup;

/// Distance that a picture shows behind, ahead of and beside the vehicle, in metres.
const BEHIND_M: f64 = 60.0;
const AHEAD_M: f64 = 100.0;
const BESIDE_M: f64 = 16.0;
/// Size of a metre, and height of the lines above and below the picture.
const SCALE: f64 = 6.0;
const LINE: f64 = 20.0;
/// Distance of the border of the outer lanes from their middle.
const BORDER_M: f64 = 1.8;

/// Returns JUnit XML: a suite per recording, and a case per rule.
///
/// A case fails if the rule has an episode of a violation.
pub(crate) fn recorded_rules_junit<'a>(
    recordings: impl Iterator<Item = (&'a str, &'a [RuleResult])>,
) -> String {
    let recordings: Vec<_> = recordings.collect();
    let failures = |rules: &[RuleResult]| rules.iter().filter(|it| 0 < it.episodes).count();
    let tests: usize = recordings.iter().map(|(_, rules)| rules.len()).sum();
    let failed: usize = recordings.iter().map(|(_, rules)| failures(rules)).sum();
    let page = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        testsuites name="brakecheck" tests=(tests) failures=(failed) errors="0" {
            @for (name, rules) in &recordings {
                testsuite name=(name) tests=(rules.len()) failures=(failures(rules)) errors="0" {
                    @for rule in *rules {
                        testcase classname=(name) name=(rule.rule) {
                            @if 0 < rule.episodes {
                                failure type="rule violation" message=(format!("{} episodes of {} vehicles", rule.episodes, rule.vehicles)) {
                                    (in_words(rule))
                                }
                            }
                        }
                    }
                }
            }
        }
    };
    visible_markup(&page.into_string()).into_owned()
}

fn in_words(rule: &RuleResult) -> String {
    let worst = rule.worst.as_ref().map_or(String::new(), |it| {
        let lead = it.lead.as_ref();
        let lead = lead.map_or(String::new(), |lead| format!(" behind {lead}"));
        format!(
            "\nworst: ρ = {:.3} at {:.2} s, {}{lead}",
            it.robustness, it.time_s, it.id
        )
    });
    format!(
        "{:.1} per 1,000 km, {:.4} % of the time, {} episodes left out{worst}",
        rule.per_1000_km(),
        100.0 * rule.share(),
        rule.doubtful
    )
}

/// View from above that moves and turns with a vehicle.
struct VehicleView {
    x_m: f64,
    y_m: f64,
    cos: f64,
    sin: f64,
}

impl VehicleView {
    /// Returns the place on the canvas of a place in the recording.
    fn at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let (dx, dy) = (x_m - self.x_m, y_m - self.y_m);
        let ahead_m = self.cos * dx + self.sin * dy;
        let left_m = self.cos * dy - self.sin * dx;
        (
            SCALE * (ahead_m + BEHIND_M),
            LINE + SCALE * (BESIDE_M - left_m),
        )
    }

    fn points(&self, places: impl Iterator<Item = (f64, f64)>) -> String {
        let places = places.map(|(x, y)| {
            let (x, y) = self.at(x, y);
            format!("{x:.1},{y:.1}")
        });
        places.collect::<Vec<_>>().join(" ")
    }
}

/// Returns an SVG of the traffic around the vehicle at a rule's worst instant.
///
/// It is `None` for a rule without a violation.
pub(crate) fn worst_instant(analysis: &Analysis, rule: &RuleResult) -> Option<String> {
    let worst = rule.worst.as_ref()?;
    let recording = &analysis.recording;
    let own = recording.tracks.get(worst.track)?;
    let sample = (worst.time_s / recording.dt_s).round() as usize;
    let at = sample.checked_sub(own.first_sample)?;
    let view = VehicleView {
        x_m: *own.x_m.get(at)?,
        y_m: own.y_m[at],
        cos: libm::cos(own.heading_rad[at]),
        sin: libm::sin(own.heading_rad[at]),
    };
    let placed = analysis.frame.tracks[worst.track].as_ref();
    let carriageway = placed.map(|it| &analysis.frame.carriageways[it.carriageway]);
    let (width, height) = (
        SCALE * (BEHIND_M + AHEAD_M),
        2.0 * LINE + 2.0 * SCALE * BESIDE_M,
    );
    let title = format!(
        "{}: ρ = {:.2} at {:.2} s",
        rule.rule, worst.robustness, worst.time_s
    );
    let there = recording
        .tracks
        .iter()
        .enumerate()
        .filter_map(|(i, track)| {
            let at = sample.checked_sub(track.first_sample)?;
            (at < track.len()).then_some((i, track, at))
        });
    let page = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width} {height}")) role="img" aria-label=(title) font-family="sans-serif" font-size="12" {
            rect width=(width) height=(height) fill="#ffffff" {}
            @if let Some(carriageway) = carriageway { (borders(carriageway, &view)) }
            @for (i, track, at) in there {
                (road_user(track, at, &view, colour(worst.track == i, worst.lead.as_ref() == Some(&track.id))))
            }
            text x="8" y="15" { (title) }
            text x="8" y=(height - 6.0) fill="#555555" {
                (format!("{}; red: {}, orange: its lead; {BEHIND_M} m behind to {AHEAD_M} m ahead", recording.name, worst.id))
            }
        }
    };
    Some(visible_markup(&page.into_string()).into_owned())
}

fn colour(is_own: bool, is_lead: bool) -> &'static str {
    if is_own {
        "#c62828"
    } else if is_lead {
        "#ef8f00"
    } else {
        "#90a4ae"
    }
}

/// Draws the borders of lanes, halfway between their middles.
fn borders(carriageway: &Carriageway, view: &VehicleView) -> Markup {
    let middles: Vec<f64> = carriageway.lanes.iter().map(|it| it.offset_m).collect();
    let between = middles.windows(2).map(|it| 0.5 * (it[0] + it[1]));
    let first = middles.first().map(|it| it - BORDER_M);
    let last = middles.last().map(|it| it + BORDER_M);
    let all = first.into_iter().chain(between).chain(last);
    let lines = all.filter_map(|offset_m| carriageway.path.moved(|_| offset_m, 1.0));
    html! {
        @for line in lines {
            polyline fill="none" stroke="#cfd8dc" stroke-width="1.5" points=(view.points(line.points().map(|([x, y], _)| (x, y)))) {}
        }
    }
}

/// Draws the box of a road user with its speed.
fn road_user(track: &RoadUserTrack, at: usize, view: &VehicleView, fill: &str) -> Markup {
    let (sin, cos) = (
        libm::sin(track.heading_rad[at]),
        libm::cos(track.heading_rad[at]),
    );
    let (half_m, side_m) = (0.5 * track.length_m, 0.5 * track.width_m);
    let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)];
    let corners = corners.map(|(ahead, left)| {
        let (ahead_m, left_m) = (ahead * half_m, left * side_m);
        (
            track.x_m[at] + cos * ahead_m - sin * left_m,
            track.y_m[at] + sin * ahead_m + cos * left_m,
        )
    });
    let (x, y) = view.at(track.x_m[at], track.y_m[at]);
    html! {
        polygon fill=(fill) points=(view.points(corners.into_iter())) {}
        text x=(format!("{x:.1}")) y=(format!("{:.1}", y - SCALE * side_m - 3.0)) text-anchor="middle" font-size="10" {
            (format!("{:.1} m/s", track.speed_mps[at]))
        }
    }
}
