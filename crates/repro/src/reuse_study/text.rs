//! Markdown of the reuse study.

use super::{CostComparison, ReuseReport, WIDE, WIDE_TRIES};
use brakecheck::run_dir::Row;
use brakecheck_evaluation::evaluation::reuse::{ReusedOn, Summary};
use brakecheck_report::report::table::TextTable;

/// Formats the study: every ego, then the means of every block.
pub fn reuse_markdown(studies: &[ReuseReport]) -> String {
    studies.iter().map(one_markdown).collect()
}

/// Explanation of the columns of the first table.
const EGOS_EXPLAINED: &str = "
- relation: the ego that was trained against, inside the family it is of, or outside
- fails without an adversary: share of starts, left out; reachable: share that search solves
- nominal ado, wide, …: share from which each ado makes the ego fail, mean over trainings
- recall of wide: of the starts that search solves, the share it solves too
";

/// Explanation of the columns of the summaries.
const BLOCKS_EXPLAINED: &str = "
- mean success: over the egos of the block; − it: how much more the named ado has, in points
- mean recall, least recall: over those egos of which search solves enough to ask
";

/// Explanation of the columns of the last table.
const COSTS_EXPLAINED: &str = "
- training: simulations of one training
- held search: simulations per start of a search that solves as many starts
- cheaper from: starts from which on the ado costs less than it, its training included
";

/// Ados in the table of egos, with their headings.
const SHOWN: [(&str, &str); 7] = [
    ("nominal ado", "nominal ado"),
    (WIDE, "wide"),
    (WIDE_TRIES, "wide, tries"),
    ("replays", "10 replays"),
    ("heuristic", "heuristic"),
    ("search, held, 100", "held search, 100"),
    ("constant", "best constant"),
];

fn one_markdown(study: &ReuseReport) -> String {
    let percent = |share: f64| format!("{:.1} %", 100.0 * share);
    let trained: Vec<String> = study
        .train_cpu_s
        .iter()
        .map(|(ado, cpu_s)| format!("{ado} {cpu_s:.0} s"))
        .collect();
    let mut text = format!(
        "## {}\n\n{} starts ({} trivial), {} training seeds; training, processor time each: {}.\n\n",
        study.world,
        study.starts,
        study.trivial,
        study.seeds,
        trained.join(", ")
    );
    let before = ["ego", "relation", "fails without an adversary", "reachable"];
    let ados = SHOWN.map(|(_, heading)| heading);
    let columns = before.into_iter().chain(ados).chain(["recall of wide"]);
    let lines = study.egos.iter().map(|ego| {
        let rates = SHOWN.map(|(word, _)| mean_of(ego, word, |row| Some(row.success_rate)));
        let recall = mean_of(ego, WIDE, |row| row.recall);
        let shown = [
            ego.ego.clone(),
            ego.relation.heading().to_owned(),
            or_dash(ego.fails_without_adversary.map(percent)),
            or_dash(ego.reachable.map(percent)),
        ];
        let rates = rates.map(|rate| or_dash(rate.map(percent)));
        let recall = or_dash(recall.map(|recall| format!("{recall:.3}")));
        shown.into_iter().chain(rates).chain([recall])
    });
    text.push_str(&TextTable::new(columns, lines).to_markdown());
    text.push_str(EGOS_EXPLAINED);
    // Differences are from one ado each, so both reference ados have a table.
    for (reference, summaries) in [
        (WIDE, &study.summary),
        (WIDE_TRIES, &study.summary_of_tries),
    ] {
        let columns = [
            "block",
            "ado",
            "egos",
            "mean success",
            &format!("`{reference}` − it [95 %]"),
            "mean recall (egos)",
            "least recall",
            "simulations per start",
        ];
        text.push('\n');
        text.push_str(&TextTable::new(columns, summaries.iter().map(summary_line)).to_markdown());
    }
    text.push_str(BLOCKS_EXPLAINED);
    text.push_str(&costs_markdown(study));
    text.push_str(COSTS_EXPLAINED);
    text.push('\n');
    text
}

/// Formats the starts from which the wide ado is cheaper than search, ego by ego.
fn costs_markdown(study: &ReuseReport) -> String {
    let columns = [
        "ego",
        "training: simulations",
        "held search: simulations per start",
        "wide ado cheaper from",
    ];
    let lines = study.costs.iter().map(|line| {
        let [search, starts] = cost_words(line);
        let training = format!("{:.0}", line.once);
        match &line.ego {
            Some(ego) => [ego.clone(), training, search, starts],
            None => {
                // The line sums over the egos, so each of them needs this number of
                // starts.
                let starts = format!("{starts} on each");
                ["all of them".to_owned(), training, search, starts]
            }
        }
    });
    format!("\n{}", TextTable::new(columns, lines).to_markdown())
}

/// Returns the simulations of the search per start, and the starts that pay off.
fn cost_words(line: &CostComparison) -> [String; 2] {
    // An unmatched search costs its whole budget, so the true number may be smaller.
    let at_most = if line.matched { "" } else { "at most " };
    let starts = line.starts.map_or("never".to_owned(), |starts| {
        format!("{at_most}{starts:.0} starts")
    });
    [format!("{:.1}", line.search), starts]
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}

/// Returns the mean over the training seeds of an ado's rows on an ego.
fn mean_of(ego: &ReusedOn, ado: &str, of: fn(&Row) -> Option<f64>) -> Option<f64> {
    let rows = ego.rows.iter().filter(|row| row.ado == ado.into());
    let values: Vec<f64> = rows.filter_map(of).collect();
    // An ado without a row has no mean, which differs from a mean of 0.
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn summary_line(sum: &Summary) -> [String; 8] {
    let difference = sum.reference_minus.map(|(mean, [lo, hi])| {
        let [mean, lo, hi] = [mean, lo, hi].map(|share| 100.0 * share);
        format!("{mean:+.1} [{lo:+.1}, {hi:+.1}]")
    });
    let recall = sum
        .recall_mean
        .map(|recall| format!("{recall:.3} ({})", sum.egos_with_recall));
    let least = sum
        .recall_min
        .as_ref()
        .map(|(recall, ego)| format!("{recall:.3} ({ego})"));
    [
        sum.relation.heading().to_owned(),
        sum.ado.to_string(),
        sum.egos.to_string(),
        format!("{:.1} %", 100.0 * sum.success_rate),
        or_dash(difference),
        or_dash(recall),
        or_dash(least),
        format!("{:.1}", sum.sims_per_start),
    ]
}
