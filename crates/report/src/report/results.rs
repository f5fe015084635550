//! Results as pictures and tables: training, starts, robustness, rows and costs.

use maud::{Markup, html};

use super::lookup::{map_card, share_in_words, sweep_card};
use super::plot::{Chart, Curve, HeatMap, HeatMapCell, Histogram, Mark, chart, histogram};
use super::table::known_if;
use super::{Nominal, TestingCost, Training};
use crate::rulebook::Verdict;
use crate::run_dir::{Row, Swept};
use crate::scene::Axis;
use crate::stats::wilson;

/// Greatest number of columns and rows of a heat map.
const BINS: usize = 10;
/// Wanted average number of starts per cell.
const PER_CELL: f64 = 4.0;
/// Number of axes of X_init that are paired.
const PAIRED_AXES: usize = 3;
/// Bars of a histogram.
const BARS: usize = 30;
/// Costs are drawn to this multiple of the last break-even.
const BEYOND: f64 = 2.0;

pub(super) fn percent(share: f64) -> String {
    // A rate is NaN if it is unknown.
    known_if(!share.is_nan(), || format!("{:.1} %", 100.0 * share))
}

/// Returns a share of some starts in percent, which is unknown without any.
pub(super) fn share_of(starts: usize, share: f64) -> String {
    known_if(starts > 0, || percent(share))
}

/// Share of training episodes that were solved, and the mean return.
pub(super) fn training(trainings: &[Training]) -> Markup {
    let curve = |nth: usize, training: &Training, y: fn(&crate::run_dir::Progress) -> f64| {
        let points = training.progress.iter();
        Curve {
            name: format!("seed {}", training.manifest.seed),
            class: format!("c-{}", nth % 6),
            points: points.map(|p| (p.decisions as f64 / 1e3, y(p))).collect(),
            dots: Vec::new(),
        }
    };
    let picture = |title: &str, label: &str, y: fn(&crate::run_dir::Progress) -> f64| {
        let curves = trainings.iter().enumerate();
        chart(&Chart {
            title: title.to_owned(),
            x_label: "decisions [thousands]".to_owned(),
            y_label: label.to_owned(),
            curves: curves.map(|(nth, t)| curve(nth, t, y)).collect(),
            ..Chart::default()
        })
    };
    // A run may be without progress, and two empty pictures show nothing.
    let any = trainings.iter().any(|t| !t.progress.is_empty());
    html! {
        @if any {
            div class="cards" {
                div class="card" { (picture("Episodes solved while training", "share", |p| p.solved_share)) }
                div class="card" { (picture("Mean return while training", "return", |p| p.mean_return)) }
            }
            p class="dim" { "With exploration, and from starts of which many failed before: not the success rate of the finished ado." }
        } @else {
            p { "No progress is recorded." }
        }
        div class="wide" { table class="rows" {
            thead { tr { th { "run" } th class="n" { "seed" } th class="n" { "decisions" } th class="n" { "episodes" } th class="n" { "CPU s" } th class="n" { "recall on calibration starts" } th class="n" { "closing evaluation" } th { "95 %" } } }
            tbody { @for training in trainings {
                @let m = &training.manifest;
                tr {
                    td { code { (training.run) } } td class="n" data-l="seed" { (m.seed) }
                    td class="n" data-l="decisions" { (m.decisions_done) @if m.decisions_done < m.decisions { " of " (m.decisions) } }
                    td class="n" data-l="episodes" { (m.episodes) } td class="n" data-l="CPU s" { (format!("{:.0}", m.cpu_s)) }
                    td class="n" data-l="recall on calibration starts" { (m.calibration.map_or("–".to_owned(), |c| format!("{} of {}", c.both, c.searched))) }
                    @match training.closing.first() {
                        Some(row) => { td class="n" data-l="closing evaluation" { (success(row)) } td data-l="95 %" { (interval(row)) } }
                        None => { td class="n" data-l="closing evaluation" { "–" } td {} }
                    }
                }
            } }
        } }
        @for training in trainings {
            @if let Some(warning) = training.manifest.calibration.and_then(|c| c.warning()) {
                p class="warning" { b { code { (training.run) } ": " (warning.what) } " – " (warning.help) "." }
            }
        }
    }
}

/// Returns the 95 % interval of a row in %, or its progress if it was interrupted.
pub(super) fn interval(row: &Row) -> String {
    match (row.ci95, row.partial) {
        (Some([lo, hi]), _) => format!("{:.1} – {:.1}", 100.0 * lo, 100.0 * hi),
        (None, Some(partial)) => format!("{} of {} decided", partial.decided, partial.of),
        (None, None) => "–".to_owned(),
    }
}

/// Returns the success of a row, of an interrupted row the least that it can be.
pub(super) fn success(row: &Row) -> String {
    match (row.starts, row.partial) {
        // Of an interrupted row the undecided starts may still be solved.
        (_, Some(partial)) => format!("at least {} of {}", row.successes, partial.of),
        (0, None) => "–".to_owned(),
        (starts, None) => format!("{} ({}/{starts})", percent(row.success_rate), row.successes),
    }
}

/// Success by start for the first pairs of axes, and the robustness.
pub(super) fn starts(nominal: &Nominal, axes: &[Axis]) -> Markup {
    // An axis of one value has no second dimension to show.
    let wide: Vec<usize> = (0..axes.len())
        .filter(|i| axes[*i].lo < axes[*i].hi)
        .take(PAIRED_AXES)
        .collect();
    let pairs = wide.iter().enumerate().flat_map(|(n, x)| {
        let later = wide[n + 1..].iter();
        later.map(move |y| (*x, *y))
    });
    let maps: Vec<HeatMap> = pairs.map(|(x, y)| by_start(nominal, axes, x, y)).collect();
    let values = nominal.starts.iter().filter_map(|(_, v)| rho(v));
    // Apart, because few deep violations would vanish beside many margins.
    let (violated, held): (Vec<f64>, Vec<f64>) = values.partition(|rho| *rho < 0.0);
    html! {
        div class="cards" {
            @for map in &maps { (map_card(map)) }
            @for (title, values) in [("Depth of the violations", violated), ("Margin where ψ_ego held", held)] {
                @if !values.is_empty() {
                    div class="card" { (histogram(&Histogram {
                        title: title.to_owned(),
                        x_label: "ρ(ψ_ego)".to_owned(),
                        y_label: "episodes".to_owned(),
                        values,
                        bars: BARS,
                    })) }
                }
            }
        }
        @if maps.is_empty() {
            p { "The starts differ in fewer than two quantities: there is no map of them." }
        } @else {
            p class="dim" { "Colour: share of the starts in a cell on which the ego violates its specification. Ring: share on which a rule was broken, by its area. Question mark: unknown, no start or only starts from which the ego fails by itself. The sliders, or a click, give the counts of a cell and the 95 % interval of its share. Robustness is of episodes without fouls." }
        }
    }
}

fn rho(verdict: &Option<Verdict>) -> Option<f64> {
    match verdict {
        // A counterexample's depth is positive, and its robustness is negative.
        Some(Verdict::Counterexample { by } | Verdict::Uncounted { by }) => Some(-by),
        Some(Verdict::Held { margin }) => Some(*margin),
        _ => None,
    }
}

fn by_start(nominal: &Nominal, axes: &[Axis], x: usize, y: usize) -> HeatMap {
    // Few starts get larger cells, since a share of one start says little.
    let wanted = (nominal.starts.len() as f64 / PER_CELL).sqrt() as usize;
    // Two at least, so that a map shows a difference.
    let bins = wanted.clamp(2, BINS);
    let bin = |axis: &Axis, value: f64| axis.bin(value, bins);
    let mut counts = vec![[0usize; 3]; bins * bins];
    for (start, verdict) in &nominal.starts {
        let (Some(verdict), Some(a), Some(b)) = (verdict, start.0.get(x), start.0.get(y)) else {
            continue;
        };
        // A start without a run has no outcome to show.
        if *verdict == Verdict::Invalid {
            continue;
        }
        // Row by row from the lower left, as `at` below reads it.
        let cell = &mut counts[bin(&axes[y], *b) * bins + bin(&axes[x], *a)];
        cell[0] += 1;
        cell[1] += usize::from(verdict.is_success());
        cell[2] += usize::from(matches!(verdict, Verdict::Foul { .. }));
    }
    let named = |axis: &Axis| {
        if axis.unit.is_empty() {
            (axis.name.clone(), axis.lo, axis.hi)
        } else {
            (format!("{} [{}]", axis.name, axis.unit), axis.lo, axis.hi)
        }
    };
    let counted = counts.iter().enumerate();
    let cells = counted.map(|(i, &[all, solved, fouls])| {
        // A cell without a result is unknown, which is not a share of 0.
        let share = |count: usize| (all > 0).then(|| count as f64 / all as f64);
        let [lo, hi] = wilson(solved, all).map(|share| 100.0 * share);
        let broken = match fouls {
            0 => String::new(),
            some => format!("; a rule is broken on {some}"),
        };
        HeatMapCell {
            at: (i % bins, i / bins),
            share: share(solved),
            dot: share(fouls).unwrap_or(0.0),
            about: match all {
                0 => "unknown: no start here has a result".to_owned(),
                _ => format!("{}{broken}", share_in_words(solved, all)),
            },
            short: match all {
                0 => "unknown".to_owned(),
                _ => format!("{solved}/{all} [{lo:.0}, {hi:.0}]"),
            },
        }
    });
    HeatMap {
        title: format!("{} and {}", axes[x].name, axes[y].name),
        x: named(&axes[x]),
        y: named(&axes[y]),
        size: (bins, bins),
        cells: cells.collect(),
        shares: ("fails on".to_owned(), "fouls on 25 %".to_owned()),
    }
}

/// Failing starts over the values of parameters of the ego.
pub(super) fn sweeps(sweeps: &[Swept]) -> Markup {
    html! {
        div class="cards" { @for swept in sweeps { (sweep_card(swept)) } }
    }
}

/// Simulations for n new starts, and the break-even of the trained ado.
pub(super) fn costs(costs: &[TestingCost]) -> Markup {
    // The first method is the trained ado, which does not break even with
    // itself.
    let even: Vec<(f64, &TestingCost)> = costs
        .iter()
        .skip(1)
        .filter_map(|other| Some((break_even(costs.first()?, other)?, other)))
        .collect();
    // Without a break-even, the picture shows at least 10 starts.
    let furthest = even.iter().map(|(n, _)| *n).fold(10.0, f64::max);
    let end = BEYOND * furthest;
    // Steep lines end at the top, so that the flat line of the ado remains
    // readable.
    let top = costs.first().map_or(1.0, |first| 2.0 * first.at(end));
    let curves = costs.iter().enumerate().map(|(nth, cost)| {
        // The divisor is guarded, since a method may cost nothing per start.
        let until = ((top - cost.fixed) / cost.per_start.max(1e-9)).clamp(0.0, end);
        Curve {
            name: cost.name.clone(),
            class: format!("c-{}", nth % 6),
            // Costs are linear, so two points draw the whole line.
            points: [0.0, until].map(|n| (n, cost.at(n))).into(),
            dots: Vec::new(),
        }
    });
    let marks = even.iter().map(|(n, other)| Mark {
        at: *n,
        word: format!("{} ({})", in_starts(*n, other), other.name),
    });
    let reached = costs
        .iter()
        .enumerate()
        .map(|(nth, cost)| Curve {
            name: cost.name.clone(),
            class: format!("c-{}", nth % 6),
            points: cost.anytime.clone(),
            dots: Vec::new(),
        })
        .filter(|curve| !curve.points.is_empty());
    let by_ado = costs.first().map(|first| Mark {
        at: first.solves,
        word: format!("{}, 1 simulation", first.name),
    });
    html! {
        div class="cards" {
            div class="card" { (chart(&Chart {
                title: "Simulations for n new starts".to_owned(),
                x_label: "new starts".to_owned(),
                y_label: "simulations".to_owned(),
                curves: curves.collect(),
                at_x: marks.collect(),
                ..Chart::default()
            })) }
            div class="card" { (chart(&Chart {
                title: "Success by simulations per start".to_owned(),
                x_label: "simulations per start, at most".to_owned(),
                y_label: "share solved".to_owned(),
                curves: reached.collect(),
                at_y: by_ado.into_iter().collect(),
                y_span: Some((0.0, 1.0)),
                ..Chart::default()
            })) }
        }
        div class="wide" { table {
            thead { tr { th { "method" } th class="n" { "sims once" } th class="n" { "sims / start" } th class="n" { "success" } th class="n" { "break-even [starts]" } } }
            tbody { @for cost in costs { tr {
                td { (cost.name) } td class="n" { (format!("{:.0}", cost.fixed)) }
                td class="n" { (format!("{:.1}", cost.per_start)) } td class="n" { (percent(cost.solves)) }
                td class="n" { (costs.first().and_then(|first| break_even(first, cost)).map_or("–".to_owned(), |n| in_starts(n, cost))) }
            } } }
        } }
    }
}

/// Break-even in words: a bound if the search solves less than the ado.
fn in_starts(starts: f64, search: &TestingCost) -> String {
    let bound = if search.matched { "" } else { "at most " };
    format!("{bound}{starts:.0}")
}

impl TestingCost {
    /// Simulations for `n` starts.
    fn at(&self, n: f64) -> f64 {
        self.fixed + n * self.per_start
    }
}

/// Number of starts from which the first method is cheaper than the other.
fn break_even(first: &TestingCost, other: &TestingCost) -> Option<f64> {
    let saved = other.per_start - first.per_start;
    // A search that is cheaper per start is never overtaken.
    (saved > 0.0).then(|| ((first.fixed - other.fixed) / saved).max(0.0))
}
