//! Pictures from above, read back from their SVG.

use brakecheck_traffic::{Analysis, RecordingColumns, TrafficRecording, svg_instant, svg_overview};

use crate::situations::recorded;
use crate::synthetic;

/// Value of an attribute of an element.
fn attribute<'a>(element: &'a str, name: &str) -> &'a str {
    let start = element.find(&format!(" {name}=\"")).expect("the attribute") + name.len() + 3;
    let end = element[start..].find('"').expect("its end");
    &element[start..start + end]
}

fn number(element: &str, name: &str) -> f64 {
    attribute(element, name).parse().expect("a number")
}

fn points(element: &str) -> Vec<[f64; 2]> {
    let point = |text: &str| {
        let (x, y) = text.split_once(',').expect("two coordinates");
        [x.parse().expect("x"), y.parse().expect("y")]
    };
    attribute(element, "points").split(' ').map(point).collect()
}

fn elements<'a>(svg: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let lines = svg.lines().map(str::trim_start);
    lines.filter(move |line| line.starts_with(&format!("<{name} ")))
}

/// Whether a point is inside a convex polygon.
fn is_inside(corners: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let side = |i: usize| {
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
    };
    (0..corners.len()).all(|i| side(i) > 0.0) || (0..corners.len()).all(|i| side(i) < 0.0)
}

#[test]
fn labels_and_their_lines_cover_no_body() {
    let (rows, _) = synthetic::traffic(3, 30, 60.0);
    let analysis = Analysis::of(recorded(&rows));
    let mut labelled = 0;
    for (i, track) in analysis.recording.tracks.iter().enumerate().step_by(7) {
        let sample = track.first_sample + track.len() / 2;
        let svg = svg_instant(&analysis, i, sample, "an instant").expect("a sample");
        let boxes: Vec<Vec<[f64; 2]>> = elements(&svg, "polygon").map(points).collect();
        let own = elements(&svg, "polygon").filter(|it| it.contains("#e03131"));
        assert_eq!(own.count(), 1);
        // The road user is in the middle and heads to the right: its box is level.
        assert!(
            (boxes[0][0][1] - boxes[0][1][1]).abs() < 0.2,
            "{:?}",
            boxes[0]
        );
        let lines: Vec<&str> = elements(&svg, "line")
            .filter(|it| it.contains("#495057"))
            .collect();
        assert!(lines.len() <= boxes.len().min(8));
        labelled += lines.len();
        for line in lines {
            let (a, b) = (
                [number(line, "x1"), number(line, "y1")],
                [number(line, "x2"), number(line, "y2")],
            );
            for k in 0..=200 {
                let share = f64::from(k) / 200.0;
                let point = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
                // The coordinates have one decimal, so the start may be on its own edge.
                let is_start = share < 0.02;
                let over = boxes.iter().any(|corners| is_inside(corners, point));
                assert!(!over || is_start, "{line} in {svg}");
            }
        }
        for text in elements(&svg, "text").filter(|it| it.contains("m/s")) {
            let (x, y) = (number(text, "x"), number(text, "y"));
            // Boxes lie between the rows of the labels, whose letters reach 3 px down.
            let reaches = |it: &[f64; 2]| it[1] < 60.0 || it[1] > 360.0;
            let is_in_row = y <= 57.0 || y >= 372.0;
            let over = x < 0.0 || !is_in_row || boxes.iter().flatten().any(reaches);
            assert!(!over, "{text}");
        }
    }
    assert!(labelled > 30, "{labelled}");
}

#[test]
fn an_overview_has_all_tracks_the_lanes_and_a_scale() {
    let (rows, _) = synthetic::traffic(3, 20, 60.0);
    let analysis = Analysis::of(recorded(&rows));
    let svg = svg_overview(&analysis);
    let of = |colour: &str| {
        elements(&svg, "polyline")
            .filter(|it| it.contains(colour))
            .count()
    };
    let tracks = analysis.recording.tracks.len();
    assert_eq!(of("#1971c2") + of("#8d5524"), tracks);
    // Two lanes per direction have three borders.
    assert_eq!(of("#adb5bd"), 6);
    let scale = svg
        .lines()
        .find(|it| it.contains(" m</text>"))
        .expect("a scale");
    assert!(scale.contains(">200 m<"), "{scale}");
    let x_m = analysis
        .recording
        .tracks
        .iter()
        .flat_map(|it| it.x_m.iter().copied());
    let (low_m, high_m) = x_m.fold((f64::INFINITY, -f64::INFINITY), |(low, high), it| {
        (low.min(it), high.max(it))
    });
    let bar = elements(&svg, "line").next().expect("a bar");
    let bar_px = number(bar, "x2") - number(bar, "x1");
    assert!(
        (bar_px - 872.0 / (high_m - low_m) * 200.0).abs() < 0.2,
        "{bar_px}"
    );
    for element in elements(&svg, "polyline") {
        for [x, y] in points(element) {
            assert!((0.0..=900.0).contains(&x) && y > 0.0, "{element}");
        }
    }
}

#[test]
fn names_of_a_file_are_text_and_missing_samples_have_no_picture() {
    let ids = ["<a&\"\u{1}>", "<a&\"\u{1}>"];
    let columns = RecordingColumns::new(&ids, &[0.0, 0.1], &[0.0, 1.0], &[0.0, 0.0]);
    let recording = TrafficRecording::from_columns("a<b>.osi", &columns).expect("valid");
    let analysis = Analysis::of(recording);
    let svg = svg_instant(&analysis, 0, 1, "x < 1 & y").expect("a sample");
    assert!(svg.contains("<title>x &lt; 1 &amp; y</title>"), "{svg}");
    assert!(
        svg.contains(r">car &lt;a&amp;&quot;\u{1}&gt;, 10.0 m/s<"),
        "{svg}"
    );
    assert!(svg_overview(&analysis).contains("a&lt;b&gt;.osi: 1 road users"));
    assert_eq!(svg_instant(&analysis, 0, 2, ""), None);
    assert_eq!(svg_instant(&analysis, 1, 0, ""), None);
    assert!(svg_overview(&Analysis::default()).ends_with("</svg>\n"));
}
