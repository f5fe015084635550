//! What `eval --theorems` prints.

use super::table_of;
use crate::campaign::{CarryOver, Forecast, NearbyStarts, TheoremsChecked};

/// Tables and sentences.
pub(super) fn text(checked: &TheoremsChecked) -> String {
    match checked {
        TheoremsChecked::NearbyStarts(nearby) => on_a_grid(nearby),
        TheoremsChecked::CarryOver(carried) => on_the_road(carried),
    }
}

fn on_a_grid(nearby: &NearbyStarts) -> String {
    format!(
        "Theorem 1: from {} of {} starts the best ado makes the ego fail; {} pairs (x0, x0') with \
         |V*(x0) − V*(x0')| < δ < V*(x0) + 1, {} misses\n\
         Theorem 2: α = max |V − V*| of the trained ado is {:.3}; {} pairs with δ + 2α < V*(x0) + 1, \
         {} misses",
        nearby.counterexamples,
        nearby.starts,
        nearby.pairs,
        nearby.misses,
        nearby.alpha,
        nearby.pairs_of_2,
        nearby.misses_of_2
    )
}

fn on_the_road(carried: &CarryOver) -> String {
    let mut text = format!(
        "Theorem 3 and Lemma 1: {} nominal counterexamples on changed egos\n\
         τ, what they have to spare: median {:.3}, 90 % ≤ {:.3}, all ≤ {:.3} \
         (where the verdict falls: median {:.3})\n\n\
         Afterwards, ε measured on the changed run (a miss is a bug of this program):\n",
        carried.counterexamples,
        carried.tau.median,
        carried.tau.p90,
        carried.tau.max,
        carried.tau_at_verdict.median,
    );
    let measured = carried.rows.iter().map(|row| {
        let sharper = row.sharper.as_ref();
        [
            row.ego.clone(),
            row.ado.to_owned(),
            format!("{} of {}", row.carried, row.pairs),
            number(row.epsilon.median),
            format!("{} ({})", row.covered, row.misses),
            sharper.map_or("–".to_owned(), |s| {
                format!("{} ({})", s.covered, s.misses)
            }),
        ]
    });
    let header = [
        "ego",
        "ado",
        "carried over",
        "ε, median",
        "ε < τ (misses)",
        "sharper (misses)",
    ];
    text.push_str(&table_of(header, measured));
    text.push_str(
        "\ncarried over   counterexamples against the nominal ego that are some against this one\
         \nε              distance of the runs; where it is below τ the theorem promises carry-over\
         \nε, median      how far apart the runs are, over all pairs\
         \n(misses)       promises that were not kept: each is a bug of this program\
         \nsharper        the same where only the deepest sample counts; –: ψ_ego is no `always φ`",
    );
    text.push_str(&format!(
        "\n\nBefore running, distances bounded at {:.0} % by as many other starts:\n",
        100.0 * (1.0 - carried.alpha)
    ));
    let foretold = carried.rows.iter().flat_map(|row| {
        let plain = foretold(&row.ego, row.ado, "ε < τ", &row.forecast);
        let sharper = row.sharper.as_ref();
        let sharper = sharper.map(|s| foretold(&row.ego, row.ado, "sharper", &s.forecast));
        std::iter::once(plain).chain(sharper)
    });
    let header = [
        "ego",
        "ado",
        "reading",
        "bounds",
        "coverage [95 %]",
        "predicted",
        "precision",
        "recall",
    ];
    text.push_str(&table_of(header, foretold));
    text.push_str(
        "\nreading        ε < τ as in the theorem, or the sharper one\
         \nbounds         distances that are not exceeded, by the other starts\
         \ncoverage       pairs that stay within the bounds\
         \npredicted      pairs foretold to carry over; precision: of those, the share that does;\
         \n               recall: of those that do, the share foretold",
    );
    for refused in &carried.refused {
        text.push_str(&format!("\nleft out: {}", refused.why));
    }
    text
}

fn foretold(ego: &str, ado: &str, reading: &str, forecast: &Forecast) -> [String; 8] {
    let bounds = forecast.quantiles.iter().map(|q| number(*q));
    let [lo, hi] = forecast.coverage_ci95.map(|share| 100.0 * share);
    let coverage = format!("{:.1} % [{lo:.1}, {hi:.1}]", 100.0 * forecast.coverage);
    let promised = match forecast.as_promised {
        true => coverage,
        false => format!("{coverage}, too little"),
    };
    let share = |share: Option<f64>| share.map_or("–".to_owned(), |s| format!("{s:.3}"));
    [
        ego.to_owned(),
        ado.to_owned(),
        reading.to_owned(),
        bounds.collect::<Vec<_>>().join(", "),
        promised,
        format!("{:.1} %", 100.0 * forecast.predicted),
        share(forecast.precision),
        share(forecast.recall),
    ]
}

/// Three places, or the order of magnitude of what would vanish so.
fn number(value: f64) -> String {
    match value.abs() {
        size if size.is_infinite() => "∞".to_owned(),
        size if 0.0 < size && size < 5e-4 => format!("{value:.0e}"),
        _ => format!("{value:.3}"),
    }
}
