//! Output of `eval --theorems`.

use super::answer::PrintedAnswer;
use super::common::table_of;
use crate::evaluation::TheoremsChecked;
use crate::report::known_if;
use crate::theorems::{
    CarryOver, Forecast, GridTheorems, Nearby, ReplayedOnGrid, Theorem1, Theorem2, Theorem3,
    TheoremOutcome,
};

/// Returns the verdict, with tables and sentences as details.
pub(super) fn answer(checked: &TheoremsChecked) -> PrintedAnswer {
    let verdict = if checked.is_refuted() {
        "a theorem is refuted"
    } else {
        "no theorem is refuted"
    };
    PrintedAnswer {
        verdict: vec![verdict.to_owned()],
        details: match checked {
            TheoremsChecked::Grid(checked) => on_a_grid(checked),
            TheoremsChecked::CarryOver(carried) => on_the_road(carried),
        },
        ..PrintedAnswer::default()
    }
}

fn on_a_grid(checked: &GridTheorems) -> String {
    let mut text = nearby_starts(&checked.theorem_1);
    text.push_str(&format!(
        "\n\nTheorem 2: values V_k within α of V*; iterated: value iteration, {} sweeps, rounded\n",
        checked.sweeps
    ));
    text.push_str(&approximate_values(&[
        ("iterated", &checked.theorem_2),
        ("trained", &checked.theorem_2_learned),
    ]));
    text.push_str("\n\nTheorem 3: changed grids, the trained ado untouched\n");
    text.push_str(&bisimilar(&checked.theorem_3));
    if !checked.not_comparable.is_empty() {
        let names = checked.not_comparable.join(", ");
        text.push_str(&format!(
            "\nof another size, or with formulas on other signals, not compared: {names}"
        ));
    }
    // A theorem that was not checked must not read as one that holds.
    if !checked.unchecked.is_empty() {
        let names = checked.unchecked.join(", ");
        text.push_str(&format!(
            "\nnothing was checked, a bug of this program: {names}"
        ));
    } else if checked.theorem_3.is_empty() {
        text.push_str("\nnothing was checked: no changed grid can be compared");
    }
    text
}

fn word(outcome: &TheoremOutcome) -> String {
    match outcome {
        TheoremOutcome::Holds => "holds".to_owned(),
        TheoremOutcome::Fails => "fails".to_owned(),
        // A theorem without its premise promises nothing, so it is no failure.
        TheoremOutcome::PremiseNotMet { why } => format!("premise not met: {why}"),
        TheoremOutcome::Refuted { why } => format!("refuted: {why}"),
    }
}

fn of(part: u64, whole: u64) -> String {
    known_if(whole > 0, || {
        format!("{:.2} %", 100.0 * part as f64 / whole as f64)
    })
}

fn nearby_starts(checked: &Theorem1) -> String {
    let mut text = format!(
        "Theorem 1, γ = {}: the trained ado found counterexamples from {} of {} starts, {} of them \
         paid V*; its values differ from V* by up to {:.4}\n",
        checked.discount, checked.found, checked.starts, checked.found_optimally, checked.gap,
    );
    let rows = checked.rows.iter().map(|row| {
        let shares = |nearby: &Nearby| of(nearby.holds, row.pairs);
        [
            row.delta.to_string(),
            format!("{} ({})", row.in_premise, row.promising),
            row.pairs.to_string(),
            shares(&row.optimal),
            shares(&row.learned),
            of(row.learned.counterexamples, row.pairs),
            of(row.optimal.printed, row.pairs),
        ]
    });
    let header = [
        "δ",
        "x0 (promising)",
        "pairs",
        "optimal",
        "trained",
        "trained captures",
        "printed bound, optimal",
    ];
    text.push_str(&table_of(header, rows));
    text.push_str(
        "\nx0             counterexamples found, paid V*, with δ < γ^T (g(τ) + ρ), ρ the least penalty\
         \n(promising)    those around which V*(x0) − δ promises a counterexample\
         \npairs          (x0, x0') with |V*(x0) − V*(x0')| < δ\
         \noptimal        rules kept and γ^T' R' ≥ V*(x0) − δ by the optimal continuation, played\
         \ntrained        the same by the trained ado, played: a result, not a promise\
         \nprinted bound  g(ρ') ≥ g(τ) − δ/γ^T, which needs one T for all starts",
    );
    // Outcomes are sentences with reasons, for which a cell has no room.
    for row in &checked.rows {
        let outcome = word(&row.outcome_of_learned);
        text.push_str(&format!("\nδ = {}, the trained ado: {outcome}", row.delta));
    }
    text
}

fn approximate_values(all: &[(&str, &Theorem2); 2]) -> String {
    let rows = all.iter().flat_map(|(name, checked)| {
        checked.rows.iter().map(move |row| {
            [
                (*name).to_owned(),
                row.beta.to_string(),
                row.pairs.to_string(),
                format!("{} ({})", row.promising, row.misses),
                format!("{} ({})", row.printed_promising, row.printed_misses),
            ]
        })
    });
    let header = [
        "V_k",
        "β",
        "pairs",
        "greedy bound (misses)",
        "printed bound (misses)",
    ];
    let mut text = table_of(header, rows);
    text.push_str(
        "\npairs          (x0, x0'), x0 a counterexample, |V_k(x0) − V_k(x0')| ≤ β\
         \ngreedy bound   pairs on which γ^T g(τ) − (2α + β) − loss promises a counterexample;\
         \n               a miss is a bug of this program\
         \nprinted bound  the same for g(τ) − (2α + β)/γ^T, and the ado that plays\
         \nα              max |V_k − V*|: over all states, over the starts, and over the states that\
         \n               greedy play compares\
         \nloss           of the greedy policy of V_k, played, and its bound 2α (γ + … + γ^(K−1))",
    );
    for (name, checked) in all {
        let certified = checked.certified.map_or(String::new(), |certified| {
            format!(", certified ≤ {certified}")
        });
        text.push_str(&format!(
            "\n{name}: α {:.4}, {:.4}, {:.4}{certified}; loss {:.4} ≤ {:.4}: {}",
            checked.alpha,
            checked.alpha_of_starts,
            checked.alpha_ahead,
            checked.lost,
            checked.loss,
            word(&checked.outcome)
        ));
    }
    text
}

fn bisimilar(all: &[Theorem3]) -> String {
    let rows = all.iter().map(|row| {
        let shares = |carried: &ReplayedOnGrid| {
            let of = |part: usize| of(part as u64, carried.pairs as u64);
            [carried.replayed, carried.by_cell, carried.own_view]
                .map(of)
                .join(", ")
        };
        [
            format!("{}, {}", row.changed, number(row.epsilon)),
            format!("{} of {}", row.related, row.candidates),
            format!("{} of {}", row.related_starts, row.starts),
            row.least_epsilon.map_or("–".to_owned(), number),
            format!("{}: {}", row.inside.pairs, shares(&row.inside)),
            // Pairs outside of the relation are a comparison: nothing is promised there.
            format!("{}: {}", row.outside.pairs, shares(&row.outside)),
        ]
    });
    let header = [
        "grid, ε",
        "states",
        "starts",
        "least ε",
        "related: captured",
        "else: captured",
    ];
    let mut text = table_of(header, rows);
    text.push_str(
        "\nstates         pairs in the greatest ε-approximate bisimulation, of those within ε\
         \nstarts         related start pairs; least ε: the least that relates any\
         \ncaptured       counterexamples played from related starts, and from the others: share that\
         \n               stays one under the same actions, under the policy acting on the cells of\
         \n               the unchanged grid (both promised if related), and under the policy looking\
         \n               at the changed grid (promised by nothing)",
    );
    for row in all {
        let outcome = word(&row.outcome);
        text.push_str(&format!(
            "\n{}, ε = {}: {outcome}",
            row.changed,
            number(row.epsilon)
        ));
    }
    text
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
    let forecasts = carried.rows.iter().flat_map(|row| {
        let plain = forecast_row(&row.ego, row.ado, "ε < τ", &row.forecast);
        let sharper = row
            .sharper
            .as_ref()
            .map(|s| forecast_row(&row.ego, row.ado, "sharper", &s.forecast));
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
    text.push_str(&table_of(header, forecasts));
    text.push_str(
        "\nreading        ε < τ as in the theorem, or the sharper one\
         \nbounds         distances that are not exceeded, by the other starts\
         \ncoverage       pairs that stay within the bounds\
         \npredicted      pairs forecast to carry over; precision: of those, the share that does;\
         \n               recall: of those that do, the share forecast",
    );
    // An ego without a row could be taken for one on which nothing carries over.
    for refused in &carried.refused {
        text.push_str(&format!("\nleft out: {}", refused.why));
    }
    text
}

fn forecast_row(ego: &str, ado: &str, reading: &str, forecast: &Forecast) -> [String; 8] {
    let bounds = forecast.quantiles.iter().map(|q| number(*q));
    let [lo, hi] = forecast.coverage_ci95.map(|share| 100.0 * share);
    let coverage = format!("{:.1} % [{lo:.1}, {hi:.1}]", 100.0 * forecast.coverage);
    // Bounds that are exceeded more often than promised make the forecast useless.
    let promised = if forecast.as_promised {
        coverage
    } else {
        format!("{coverage}, too little")
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

/// Formats three decimals, or the order of magnitude of a smaller number.
fn number(value: f64) -> String {
    match value.abs() {
        size if size.is_nan() => "–".to_owned(),
        size if size.is_infinite() => if value > 0.0 { "∞" } else { "−∞" }.to_owned(),
        // Three decimals would print such a number as 0.
        size if size > 0.0 && size < 5e-4 => format!("{value:.0e}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn an_unknown_number_and_both_infinities_are_told_apart() {
        let shown = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.5, 1e-5].map(number);
        assert_eq!(shown, ["–", "∞", "−∞", "-0.500", "1e-5"]);
    }
}
