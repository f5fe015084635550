//! Markdown of the reuse study.

use super::{CONDITIONAL, CONDITIONAL_TRIES, Economy, ReuseReport};
use brakecheck::evaluation::{ReusedOn, Summary};
use brakecheck::run_dir::Row;
use brakecheck::sysid::describes;

/// Formats the study: every ego, then the means of every block.
pub fn reuse_markdown(studies: &[ReuseReport]) -> String {
    studies.iter().map(one_markdown).collect()
}

/// Explanation of the columns of the first table.
const EGOS_EXPLAINED: &str = "
- relation: the ego that was trained against, inside the family it is of, or outside
- fails without an adversary: share of starts, left out; reachable: share that search solves
- nominal ado, wide, …: share from which each ado makes the ego fail, mean over trainings
- recall of conditional: of the starts that search solves, the share it solves too
";

/// Explanation of the columns of the summaries.
const BLOCKS_EXPLAINED: &str = "
- mean success: over the egos of the block; − it: how much more the named ado has, in points
- mean recall, least recall: over those egos of which search solves enough to ask
";

/// Explanation of the columns of the last table.
const KNOWN_EXPLAINED: &str = "
- taken for: the member of the family that the recorded runs are nearest to
- explained: whether it is as near as noise allows; residual: how far it is, (the nominal ego)
- simulations: of the ego, to identify it
- held search: simulations per start of a search that solves as many starts
- cheaper from: starts from which on the ado costs less than it, its training included
";

/// Ados in the table of egos, with their headings.
const SHOWN: [(&str, &str); 8] = [
    ("nominal ado", "nominal ado"),
    ("wide", "wide"),
    (CONDITIONAL, "conditional"),
    (CONDITIONAL_TRIES, "conditional, tries"),
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
        "## {}\n\n{} starts ({} trivial), {} training seeds; training, processor time each: {}.\n\n\
         | ego | relation | fails without an adversary | reachable |",
        study.world,
        study.starts,
        study.trivial,
        study.seeds,
        trained.join(", ")
    );
    for (_, header) in SHOWN {
        text.push_str(&format!(" {header} |"));
    }
    text.push_str(" recall of conditional |\n|");
    // Four columns precede the ados, and a single column follows them.
    text.push_str(&" --- |".repeat(SHOWN.len() + 5));
    text.push('\n');
    for ego in &study.egos {
        let reachable = ego.reachable.map_or("–".to_owned(), percent);
        text.push_str(&format!(
            "| {} | {:?} | {} | {reachable} |",
            ego.ego,
            ego.relation,
            percent(ego.fails_without_adversary),
        ));
        for (word, _) in SHOWN {
            let rate = mean_of(ego, word, |row| Some(row.success_rate));
            text.push_str(&format!(" {} |", rate.map_or("–".to_owned(), percent)));
        }
        let recall = mean_of(ego, CONDITIONAL, |row| row.recall);
        let recall = recall.map_or("–".to_owned(), |recall| format!("{recall:.3}"));
        text.push_str(&format!(" {recall} |\n"));
    }
    text.push_str(EGOS_EXPLAINED);
    for (reference, summaries) in [
        (CONDITIONAL, &study.summary),
        (CONDITIONAL_TRIES, &study.summary_of_tries),
    ] {
        text.push_str(&format!(
            "\n| block | ado | egos | mean success | `{reference}` − it [95 %] | \
             mean recall (egos) | least recall | simulations per start |\n\
             | --- | --- | --- | --- | --- | --- | --- | --- |\n"
        ));
        for sum in summaries {
            text.push_str(&summary_line(sum));
        }
    }
    text.push_str(BLOCKS_EXPLAINED);
    text.push_str(&known_markdown(study));
    text.push_str(KNOWN_EXPLAINED);
    text.push('\n');
    text
}

/// Formats the identification of every ego and its economy.
fn known_markdown(study: &ReuseReport) -> String {
    let mut text = String::from(
        "\n| ego | taken for | explained | residual m (nominal) | identification: simulations | \
         held search: simulations per start | conditional ado cheaper from |\n\
         | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for known in &study.known {
        let mut lines = study.economy.iter();
        let line = lines.find(|line| line.ego.as_deref() == Some(&known.ego));
        text.push_str(&format!(
            "| {} | {} | {} | {:.2} ({:.2}) | {} | {} |\n",
            known.ego,
            if describes(known.explained, known.residual_m, known.nominal_residual_m) {
                &known.taken_for
            } else {
                // A member that does not describe the ego is not used, so it is not shown.
                "the nominal ego"
            },
            if known.explained { "yes" } else { "no" },
            known.residual_m,
            known.nominal_residual_m,
            known.simulations,
            line.map_or("– | –".to_owned(), economy_words),
        ));
    }
    if let Some(all) = study.economy.iter().find(|line| line.ego.is_none()) {
        text.push_str(&format!(
            "| all of them | | | | {:.0}, training included | {} on each |\n",
            all.once,
            economy_words(all),
        ));
    }
    text
}

fn economy_words(line: &Economy) -> String {
    // An unmatched search costs its whole budget, so the true number may be smaller.
    let at_most = if line.matched { "" } else { "at most " };
    let starts = line.starts.map_or("never".to_owned(), |starts| {
        format!("{at_most}{starts:.0} starts")
    });
    format!("{:.1} | {starts}", line.search)
}

/// Returns the mean over the training seeds of an ado's rows on an ego.
fn mean_of(ego: &ReusedOn, ado: &str, of: fn(&Row) -> Option<f64>) -> Option<f64> {
    let rows = ego.rows.iter().filter(|row| row.ado == ado.into());
    let values: Vec<f64> = rows.filter_map(of).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn summary_line(sum: &Summary) -> String {
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
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    format!(
        "| {} | {} | {} | {:.1} % | {} | {} | {} | {:.1} |\n",
        sum.relation.heading(),
        sum.ado,
        sum.egos,
        100.0 * sum.success_rate,
        or_dash(difference),
        or_dash(recall),
        or_dash(least),
        sum.sims_per_start,
    )
}
