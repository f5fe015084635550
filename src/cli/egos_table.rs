//! Tables of several egos: the worst first, and blocks with summaries.

use super::answer::PrintedAnswer;
use super::display::stdout_columns;
use super::table::{contacts, found, interval, legend, remarks, rows, success, warnings};
use super::verdict::{ego, percent, severity, strongest, verdict};
use crate::evaluation::{LEAST_REACHABLE, Relation, ReusedOn, Summary};
use crate::report::{TextTable, known_if};
use crate::run_dir::{Row, counted};

/// Egos in the table of many egos. The details have all of them.
const EGOS_SHOWN: usize = 12;

/// Warnings below that table.
const WARNINGS_SHOWN: usize = 2;

/// Legend of the columns of a block's egos and of its summary.
const BLOCKS_EXPLAINED: &str = "
reachable      starts that search solves; –: no search was asked for
union          starts that any ado here, or search, solves
trained − it   success of the trained ado less that of this one, over the egos of the block
mean, least    over those egos of which search solves enough to ask for recall";

/// Puts the verdict of the rows of several egos above a table of the egos.
///
/// For a single ego it formats the rows only.
pub(super) fn reuse(egos: &[ReusedOn], summaries: &[Summary]) -> PrintedAnswer {
    let all: Vec<Row> = egos.iter().flat_map(|ego| ego.rows.clone()).collect();
    // Means over a single ego would repeat its rows.
    if egos.len() < 2 {
        return rows(&all);
    }
    let warnings = warnings(&all);
    let lines: Vec<&str> = warnings.lines().filter(|line| !line.is_empty()).collect();
    // The warnings of many egos would push the table off the screen.
    let (shown, more) = lines.split_at(lines.len().min(WARNINGS_SHOWN));
    PrintedAnswer {
        verdict: verdict(&all),
        table: by_ego(egos),
        warnings: shown.join("\n"),
        details: format!("{}{}", more.join("\n"), blocks(egos, summaries)),
        legend: format!("{}{BLOCKS_EXPLAINED}", legend(&all)),
    }
}

/// One line per ego with its strongest adversary, the worst first.
fn by_ego(egos: &[ReusedOn]) -> String {
    let mut worst: Vec<(&ReusedOn, &Row)> = egos
        .iter()
        // An ego without a row has no adversary to name.
        .filter_map(|ego| Some((ego, strongest(ego.rows.iter())?)))
        .collect();
    // Stable, so that egos of equal rates keep the order of the world. An unknown rate is
    // NaN, which would come first.
    let rate = |row: &Row| row.success_rate.max(0.0);
    worst.sort_by(|a, b| rate(b.1).total_cmp(&rate(a.1)));
    let lines = worst.iter().take(EGOS_SHOWN).map(|(reused, row)| {
        [
            ego(row),
            row.ado.to_string(),
            success(row),
            interval(row),
            severity(row).unwrap_or("–".to_owned()),
            row.recall.map_or("–".to_owned(), |r| format!("{r:.3}")),
            reused
                .fails_without_adversary
                .map_or("–".to_owned(), percent),
        ]
    });
    let columns = [
        "ego",
        "ado",
        "success",
        "95 % interval",
        "contact",
        "recall",
        "alone",
    ];
    // The two columns of names stay at the left, and numbers are aligned to the right.
    let table = TextTable::new(columns, lines)
        .numbers_from(2)
        .to_terminal(stdout_columns());
    match worst.len().saturating_sub(EGOS_SHOWN) {
        0 => table,
        1 => format!("{table}\n1 more ego fails as rarely or more rarely"),
        more => format!("{table}\n{more} more egos fail as rarely or more rarely"),
    }
}

/// Formats all rows in blocks by the relation of the ego to the training.
fn blocks(egos: &[ReusedOn], summaries: &[Summary]) -> String {
    let mut text = String::new();
    let mut relations: Vec<_> = egos.iter().map(|ego| ego.relation).collect();
    // `dedup` removes neighbours only.
    relations.sort();
    relations.dedup();
    for relation in relations {
        let block: Vec<&ReusedOn> = egos.iter().filter(|ego| ego.relation == relation).collect();
        let rows: Vec<Row> = block.iter().flat_map(|ego| ego.rows.clone()).collect();
        let of_block = summaries.iter().filter(|sum| sum.relation == relation);
        let parts = [
            format!("\n# {}", relation.heading()),
            found(&rows),
            contacts(&rows),
            remarks(&rows).trim_start_matches('\n').to_owned(),
            without_adversary(&block),
            summary(of_block),
        ];
        for part in parts.iter().filter(|part| !part.is_empty()) {
            text.push_str(&format!("\n{part}"));
        }
    }
    let of_all = summaries
        .iter()
        .filter(|sum| sum.relation == Relation::Changed);
    // A heading above an empty table would suggest a lost result.
    if of_all.clone().count() > 0 {
        let heading = Relation::Changed.heading();
        text.push_str(&format!("\n\n# {heading}\n{}", summary(of_all)));
    }
    text
}

/// Formats the failures of each ego of a block by itself, and its reachable share.
fn without_adversary(block: &[&ReusedOn]) -> String {
    let rows = block.iter().map(|ego| {
        [
            ego.ego.clone(),
            ego.fails_without_adversary.map_or("–".to_owned(), percent),
            ego.reachable.map_or("–".to_owned(), percent),
            ego.union.map_or("–".to_owned(), percent),
        ]
    });
    let columns = ["ego", "fails without an adversary", "reachable", "union"];
    TextTable::new(columns, rows)
        .numbers_from(1)
        .to_terminal(stdout_columns())
}

/// One line per ado: its means over the block.
fn summary<'a>(summaries: impl Iterator<Item = &'a Summary>) -> String {
    // With few reachable starts, recall is too noisy for a mean.
    let recall = format!("mean recall, reachable ≥ {:.0} %", 100.0 * LEAST_REACHABLE);
    let columns = [
        "ado",
        "egos",
        "mean success",
        "trained − it [95 %]",
        &recall,
        "least recall",
        "sims/start",
    ];
    let rows = summaries.map(|sum| {
        [
            sum.ado.to_string(),
            sum.egos.to_string(),
            known_if(sum.egos > 0, || percent(sum.success_rate)),
            sum.reference_minus
                .map_or("–".to_owned(), |(mean, [lo, hi])| {
                    let [mean, lo, hi] = [mean, lo, hi].map(|share| 100.0 * share);
                    format!("{mean:+.1} [{lo:+.1}, {hi:+.1}]")
                }),
            sum.recall_mean.map_or("–".to_owned(), |recall| {
                format!("{recall:.3} ({})", counted(sum.egos_with_recall, "ego"))
            }),
            sum.recall_min
                .as_ref()
                .map_or("–".to_owned(), |(recall, ego)| {
                    format!("{recall:.3} ({ego})")
                }),
            format!("{:.1}", sum.sims_per_start),
        ]
    });
    TextTable::new(columns, rows)
        .numbers_from(1)
        .to_terminal(stdout_columns())
}
