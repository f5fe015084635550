//! Figures of the paper, redrawn from brakecheck's runs, as SVG files.

use maud::{Markup, PreEscaped, html};

use super::file_style::file_style;
use super::lookup::sweep_chart;
use super::page::STYLE;
use super::plot::{Chart, Curve, Mark, Region, chart};
use super::words::wrapped;
use crate::run_dir::Swept;
use crate::visible::visible_markup;

/// Height of a caption's line, and the number of letters that fit.
const LINE: f64 = 13.0;
const LETTERS: usize = 78;
/// Distances are shown up to this many junction lengths after the line.
const BEYOND: f64 = 2.5;
/// Size of one panel in the units of `plot`.
const PANEL: (f64, f64) = (420.0, 264.0);

/// Behaviour of an ado over time.
pub struct Behaviour {
    /// Description in a few words.
    pub name: String,
    /// Time and speed of the ego.
    pub ego_speed_mps: Vec<(f64, f64)>,
    /// Time and speed of the ado.
    pub ado_speed_mps: Vec<(f64, f64)>,
    /// Time and distance between them.
    pub distance_m: Vec<(f64, f64)>,
    /// Paths of ego and ado over the ground, x and y, from start to verdict.
    ///
    /// Empty if both drive in one lane, where a path shows nothing.
    pub paths_m: [Vec<(f64, f64)>; 2],
    /// Points of each path per second.
    pub per_second: usize,
    /// Time of the violation of ψ_ego or of a rule, and its name.
    pub decided: (f64, String),
}

/// Fig. 2: two behaviours from one start of the adaptive cruise control.
///
/// `safe_m` is d_safe, and `caption` states the origin of the runs.
pub fn figure_2(behaviours: &[Behaviour], safe_m: f64, caption: &str) -> String {
    of_behaviours(behaviours, safe_m, caption)
}

/// Fig. 3: three merges, from far away, against the rule and within it.
///
/// Each row has the paths over the ground, the speeds and the distance.
pub fn figure_3(behaviours: &[Behaviour], safe_m: f64, caption: &str) -> String {
    of_behaviours(behaviours, safe_m, caption)
}

/// Figure with a row of panels per behaviour.
fn of_behaviours(behaviours: &[Behaviour], safe_m: f64, caption: &str) -> String {
    let rows: Vec<Vec<Chart>> = behaviours.iter().map(|it| panels_of(it, safe_m)).collect();
    let columns = rows.iter().map(Vec::len).max().unwrap_or(1);
    let panels: Vec<Chart> = rows.into_iter().flatten().collect();
    figure(&panels, columns, caption)
}

fn panels_of(one: &Behaviour, safe_m: f64) -> Vec<Chart> {
    let decided = || Mark {
        at: one.decided.0,
        word: one.decided.1.clone(),
    };
    let speeds = Chart {
        title: format!("{}: speeds", one.name),
        x_label: "time [s]".to_owned(),
        y_label: "speed [m/s]".to_owned(),
        curves: vec![
            curve("ego", "c-ego", &one.ego_speed_mps),
            curve("ado", "c-ado", &one.ado_speed_mps),
        ],
        at_x: vec![decided()],
        ..Chart::default()
    };
    let distance = Chart {
        title: format!("{}: distance", one.name),
        x_label: "time [s]".to_owned(),
        y_label: "distance [m]".to_owned(),
        curves: vec![curve("", "c-3", &one.distance_m)],
        at_x: vec![decided()],
        at_y: vec![Mark {
            at: safe_m,
            word: format!("d_safe = {safe_m} m"),
        }],
        // From 0, so that distances of several panels compare by eye.
        y_span: Some((0.0, 0.0)),
        ..Chart::default()
    };
    paths(one).into_iter().chain([speeds, distance]).collect()
}

/// Paths over the ground, with one dot per second. Equal dots are equal times.
fn paths(one: &Behaviour) -> Option<Chart> {
    let [ego, ado] = &one.paths_m;
    let way = |name: &str, class: &str, points: &[(f64, f64)]| Curve {
        dots: points
            .iter()
            // A world sampled less than once a second has a dot at every sample.
            .step_by(one.per_second.max(1))
            .copied()
            .collect(),
        ..curve(name, class, points)
    };
    (!ego.is_empty()).then(|| Chart {
        title: format!("{}: paths, a dot per second", one.name),
        x_label: "x [m]".to_owned(),
        y_label: "y [m]".to_owned(),
        curves: vec![way("ego", "c-ego", ego), way("ado", "c-ado", ado)],
        ..Chart::default()
    })
}

fn curve(name: &str, class: &str, points: &[(f64, f64)]) -> Curve {
    Curve {
        name: name.to_owned(),
        class: class.to_owned(),
        points: points.to_vec(),
        dots: Vec::new(),
    }
}

/// Distances to a stop line over time.
pub struct Distances {
    /// Behaviour of the ado in a few words.
    pub name: String,
    /// Time and distance of the ego, positive before the line.
    pub ego_m: Vec<(f64, f64)>,
    /// Time and distance of the ado.
    pub ado_m: Vec<(f64, f64)>,
    /// Start of the red phase, and the greatest duration of the run, in seconds.
    pub red_s: (f64, f64),
    /// Length in metres of the junction behind the line.
    pub junction_m: f64,
}

/// Fig. 5: distances of ego and ado to the line, with the red-light zone.
///
/// Points far beyond the junction are left out.
pub fn figure_5(runs: &[Distances], caption: &str) -> String {
    // The curve ends at the first point beyond the shown distance: a later
    // return would be joined by a wrong line.
    let near = |points: &[(f64, f64)], junction_m: f64| -> Vec<(f64, f64)> {
        let all = points.iter().copied();
        all.take_while(|(_, m)| -BEYOND * junction_m < *m).collect()
    };
    let panels = runs.iter().map(|run| Chart {
        title: run.name.clone(),
        x_label: "time [s]".to_owned(),
        y_label: "distance to the line [m]".to_owned(),
        curves: vec![
            curve("ego", "c-ego", &near(&run.ego_m, run.junction_m)),
            curve("ado", "c-ado", &near(&run.ado_m, run.junction_m)),
        ],
        at_x: vec![Mark {
            at: run.red_s.0,
            word: "red".to_owned(),
        }],
        regions: vec![Region {
            x: run.red_s,
            y: (-run.junction_m, 0.0),
            word: "runs the red light".to_owned(),
        }],
        // The zone stays in sight even if no vehicle reaches it.
        y_span: Some((-BEYOND * run.junction_m, 0.0)),
        ..Chart::default()
    });
    figure(&panels.collect::<Vec<_>>(), 2, caption)
}

/// Share of failing starts over a parameter of the ego.
///
/// A value without a result has a question mark, and no share.
pub fn sweep_curve(swept: &Swept, caption: &str) -> String {
    figure(&[sweep_chart(swept)], 1, caption)
}

/// Panels in columns over a caption in plain text.
fn figure(panels: &[Chart], columns: usize, caption: &str) -> String {
    let rows = panels.len().div_ceil(columns);
    // SVG has no code font inside a line, and no wrapping.
    let lines = wrapped(&caption.replace('`', ""), LETTERS * columns);
    let width = PANEL.0 * columns as f64;
    let height = PANEL.1 * rows as f64 + LINE * (lines.len() + 1) as f64;
    let placed = panels.iter().enumerate().map(|(nth, panel)| {
        let (x, y) = (
            PANEL.0 * (nth % columns) as f64,
            PANEL.1 * (nth / columns) as f64,
        );
        html! { g transform=(format!("translate({x} {y})")) { g { (sized(panel)) } } }
    });
    let below = PANEL.1 * rows as f64;
    let picture = html! {
        (PreEscaped("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"))
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width} {height}")) width=(width) height=(height) {
            style { (PreEscaped(file_style(&[STYLE, ".card{fill:var(--card)}"]))) }
            rect width="100%" height="100%" class="card" {}
            @for panel in placed { (panel) }
            @for (nth, line) in lines.iter().enumerate() {
                text x="12" y=(below + LINE * (nth + 1) as f64) { (line) }
            }
        }
    };
    // Names of agents may hold characters that no viewer shows.
    visible_markup(&picture.into_string()).into_owned()
}

/// Chart in a place of fixed size.
fn sized(panel: &Chart) -> Markup {
    html! {
        svg width=(PANEL.0) height=(PANEL.1) { (chart(panel)) }
    }
}
