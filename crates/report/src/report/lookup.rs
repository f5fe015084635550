//! Sliders that look up precomputed results: by start, and by a parameter of the ego.
//!
//! The pictures and the tables hold all results, so a page without its script
//! shows them too. `lookup.js` only marks the chosen cell and repeats its words.

use maud::{Markup, html};

use super::plot::{Chart, Curve, Estimate, HeatMap, chart, heat_map};
use crate::run_dir::{SweepPoint, Swept, counted};
use crate::stats::wilson;

/// Script that reads the sliders. It loads nothing.
pub(super) const SCRIPT: &str = include_str!("lookup.js");

/// Words for counts without a start.
const NO_RESULT: &str = "no start has a result";

/// Slider over the cells of one axis.
struct CellSlider<'a> {
    /// Name and unit of the quantity.
    name: &'a str,
    /// Range or value of every cell in words.
    cells: Vec<String>,
    /// Cell that is chosen first.
    first: usize,
}

/// Returns counts with the 95 % interval of their share, in words.
pub(super) fn share_in_words(failing: usize, starts: usize) -> String {
    // A share of nothing is unknown, which is not a share of 0.
    if starts == 0 {
        return NO_RESULT.to_owned();
    }
    let [lo, hi] = wilson(failing, starts).map(|share| 100.0 * share);
    let share = 100.0 * failing as f64 / starts as f64;
    let of = counted(starts, "start");
    let verb = if starts == 1 { "fails" } else { "fail" };
    format!("{failing} of {of} {verb}, {share:.0} % [{lo:.0}, {hi:.0}]")
}

/// Card of a map over two quantities of the start: picture, sliders and table.
pub(super) fn map_card(map: &HeatMap) -> Markup {
    // The worst cell says most.
    let known = map.cells.iter().filter(|cell| cell.share.is_some());
    let worst = known.max_by(|a, b| a.share.unwrap_or(-1.0).total_cmp(&b.share.unwrap_or(-1.0)));
    // A map without any known cell starts at the lower left.
    let first = worst.map_or((0, 0), |cell| cell.at);
    let (across, up) = (ranges(&map.x, map.size.0), ranges(&map.y, map.size.1));
    let at = |column: usize, row: usize| map.cells.iter().find(|cell| cell.at == (column, row));
    html! {
        div class="card lookup" {
            (heat_map(map))
            (sliders(&[
                CellSlider { name: &map.x.0, cells: across.clone(), first: first.0 },
                CellSlider { name: &map.y.0, cells: up.clone(), first: first.1 },
            ], worst.map_or("", |cell| &cell.about)))
            details {
                summary { "The map as a table" }
                div class="wide" { table class="cells" {
                    thead {
                        tr { th {} th colspan=(across.len()) { (map.x.0) } }
                        tr { th { (map.y.0) } @for range in &across { th class="n" { (range) } } }
                    }
                    // From the top, as in the picture.
                    tbody { @for (row, range) in up.iter().enumerate().rev() { tr {
                        th class="n" { (range) }
                        @for column in 0..across.len() { td class="n" { (at(column, row).map_or("unknown", |cell| &cell.short)) } }
                    } } }
                } }
            }
        }
    }
}

/// Ranges of the cells along an axis, with as many decimals as tell them apart.
fn ranges((_, lo, hi): &(String, f64, f64), cells: usize) -> Vec<String> {
    let step = (hi - lo) / cells.max(1) as f64;
    // One decimal more than the step has, because its multiples are not round.
    let places = (1.0 - libm::floor(libm::log10(step))).clamp(0.0, 6.0) as usize;
    let edge = |nth: usize| format!("{:.places$}", lo + step * nth as f64);
    (0..cells)
        .map(|nth| format!("{} to {}", edge(nth), edge(nth + 1)))
        .collect()
}

fn sliders(sliders: &[CellSlider<'_>], said: &str) -> Markup {
    html! {
        div class="sliders" {
            @for slider in sliders {
                // A list of texts always has a JSON form.
                @let cells = serde_json::to_string(&slider.cells).unwrap_or_default();
                label {
                    span { (slider.name) }
                    output { (slider.cells.get(slider.first).map_or("", |it| it)) }
                    input type="range" min="0" max=(slider.cells.len().saturating_sub(1)) step="1" value=(slider.first) data-cells=(cells);
                }
            }
            p class="said" role="status" { (said) }
        }
    }
}

/// Card of a sweep: picture, slider and table.
pub(super) fn sweep_card(swept: &Swept) -> Markup {
    let cells: Vec<String> = swept.points.iter().map(|it| it.value.to_string()).collect();
    html! {
        div class="card lookup" {
            (chart(&sweep_chart(swept)))
            (sliders(&[CellSlider { name: &swept.parameter, cells, first: 0 }],
                &swept.points.first().map_or(String::new(), |point| at_value(swept, point))))
            div class="wide" { table {
                thead { tr { th class="n" { (swept.parameter) } th class="n" { "failing starts" } th { "95 % CI" } } }
                tbody { @for point in &swept.points { tr {
                    td class="n" { (point.value) }
                    @match known(point) {
                        Some([lo, hi]) => {
                            td class="n" { (point.failing) " of " (point.starts) }
                            td { (format!("{:.1} – {:.1}", 100.0 * lo, 100.0 * hi)) }
                        }
                        None => { td class="n" { "unknown" } td { (unknown(point)) } }
                    }
                } } }
            } }
        }
    }
}

/// Chart of the share of failing starts over a parameter of the ego.
pub(super) fn sweep_chart(swept: &Swept) -> Chart {
    let percent = |share: f64| 100.0 * share;
    let share = |point: &SweepPoint| percent(point.failing as f64 / point.starts as f64);
    let estimates = swept.points.iter().map(|point| {
        let interval = known(point);
        // An unknown share may be any, which the question mark stands in the
        // middle of.
        let [lo, hi] = interval.unwrap_or([0.0, 1.0]).map(percent);
        Estimate {
            at: point.value,
            value: interval.map(|_| share(point)),
            interval: (lo, hi),
            about: at_value(swept, point),
        }
    });
    let known = swept.points.iter().filter(|point| known(point).is_some());
    Chart {
        title: format!("failing starts over {}", swept.parameter),
        x_label: swept.parameter.clone(),
        y_label: "starts that fail [%]".to_owned(),
        curves: vec![
            Curve {
                name: "share".to_owned(),
                class: "c-ego".to_owned(),
                points: known.map(|point| (point.value, share(point))).collect(),
                dots: Vec::new(),
            },
            // Only for the legend, since the bars are no curve.
            Curve {
                name: "95 % interval".to_owned(),
                class: "c-ado".to_owned(),
                points: Vec::new(),
                dots: Vec::new(),
            },
        ],
        estimates: estimates.collect(),
        // All sweeps have the same scale, so that flat curves look flat.
        y_span: Some((0.0, 100.0)),
        ..Chart::default()
    }
}

/// Interval of a value's share. `None` if the share is unknown.
fn known(point: &SweepPoint) -> Option<[f64; 2]> {
    // The starts of an interrupted value that are decided early are not like the others.
    let whole = point.starts > 0 && point.partial.is_none();
    whole.then(|| wilson(point.failing, point.starts))
}

fn at_value(swept: &Swept, point: &SweepPoint) -> String {
    let at = format!("{} = {}", swept.parameter, point.value);
    match known(point) {
        Some(_) => format!("{at}: {}", share_in_words(point.failing, point.starts)),
        None => format!("{at}: unknown, {}", unknown(point)),
    }
}

/// Reason why a share is unknown.
fn unknown(point: &SweepPoint) -> String {
    match point.partial {
        Some(partial) => format!(
            "interrupted, at least {} of {} fail",
            point.failing, partial.of
        ),
        None => NO_RESULT.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::HeatMapCell;
    use crate::run_dir::Partial;

    fn map(name: &str) -> HeatMap {
        let cell = |at, share, about: &str, short: &str| HeatMapCell {
            at,
            share,
            dot: 0.0,
            about: about.to_owned(),
            short: short.to_owned(),
        };
        HeatMap {
            title: "gap and speed".to_owned(),
            x: (name.to_owned(), 10.0, 30.0),
            y: ("speed [m/s]".to_owned(), 0.0, 1.0),
            size: (2, 2),
            cells: vec![
                cell((0, 0), Some(0.0), "0 of 2", "0/2"),
                cell((1, 0), Some(1.0), "3 of 3", "3/3"),
                cell((0, 1), None, "unknown: nothing", "unknown"),
                cell((1, 1), Some(0.5), "1 of 2", "1/2"),
            ],
            shares: ("fails on".to_owned(), "rings".to_owned()),
        }
    }

    #[test]
    fn a_map_has_sliders_over_all_cells_and_says_unknown_where_it_is() {
        let html = map_card(&map("gap [m]")).into_string();
        // The worst cell first, in the right place.
        assert!(
            html.contains(r#"max="1" step="1" value="1" data-cells="[&quot;10 to 20&quot;,&quot;20 to 30&quot;]""#),
            "{html}"
        );
        assert!(html.contains(r#"<p class="said" role="status">3 of 3</p>"#));
        assert!(html.contains("<output>0.00 to 0.50</output>"), "{html}");
        for key in ["0,0", "1,0", "0,1", "1,1"] {
            assert_eq!(html.matches(&format!("data-cell=\"{key}\"")).count(), 1);
        }
        // The upper left is unknown: a question mark, no colour, and the word in the table.
        let cell = html.split("data-cell=\"0,1\"").nth(1).expect("the cell");
        let cell = &cell[..cell.find("</g>").expect("its end")];
        assert!(cell.contains("?</text>") && !cell.contains("hot"), "{cell}");
        let rows: Vec<&str> = html.split("<tr>").skip(3).collect();
        assert!(rows[0].contains(r#"<td class="n">unknown</td><td class="n">1/2</td>"#));
        assert!(rows[1].contains(r#"<td class="n">0/2</td><td class="n">3/3</td>"#));
        assert_eq!(html.matches(">unknown</td>").count(), 1);
    }

    #[test]
    fn names_are_escaped_everywhere() {
        let hostile = "<b>\"&'</b>";
        let swept = Swept::of(hostile, vec![point(0.5, 1, 2)]);
        for html in [map_card(&map(hostile)), sweep_card(&swept)] {
            let html = html.into_string();
            assert!(
                !html.contains("<b>") && html.contains("&lt;b&gt;"),
                "{html}"
            );
        }
    }

    fn point(value: f64, failing: usize, starts: usize) -> SweepPoint {
        SweepPoint {
            value,
            starts,
            failing,
            partial: None,
        }
    }

    #[test]
    fn a_share_of_no_start_is_not_a_number() {
        assert_eq!(share_in_words(0, 0), "no start has a result");
        assert!(share_in_words(0, 1).starts_with("0 of 1 start fails, 0 % ["));
    }

    #[test]
    fn a_sweep_has_the_counts_and_intervals_of_its_values_and_no_share_without_starts() {
        let cut = SweepPoint {
            partial: Some(Partial { decided: 3, of: 20 }),
            ..point(1.5, 2, 3)
        };
        let points = vec![point(0.5, 5, 20), point(1.0, 0, 0), cut];
        let swept = Swept::of("time_gap_s", points);
        let html = sweep_card(&swept).into_string();
        let [lo, hi] = wilson(5, 20).map(|it| 100.0 * it);
        for words in [
            format!("time_gap_s = 0.5: 5 of 20 starts fail, 25 % [{lo:.0}, {hi:.0}]"),
            format!("<td class=\"n\">5 of 20</td><td>{lo:.1} – {hi:.1}</td>"),
            "time_gap_s = 1: unknown, no start has a result".to_owned(),
            "time_gap_s = 1.5: unknown, interrupted, at least 2 of 20 fail".to_owned(),
            "data-cells=\"[&quot;0.5&quot;,&quot;1&quot;,&quot;1.5&quot;]\"".to_owned(),
        ] {
            assert!(html.contains(&words), "{words} in {html}");
        }
        // One dot, two question marks, and a curve through the one known value.
        assert_eq!(html.matches("class=\"dot c-ego\"").count(), 1);
        assert_eq!(html.matches(">?</text>").count(), 2);
        assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
    }
}
