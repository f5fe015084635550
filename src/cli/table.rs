//! Rows as tables for people.

use crate::evaluation::{LEAST_REACHABLE, Relation, ReusedOn, Summary};
use crate::report::{TextTable, WIDTH};
use crate::run_dir::{AdversaryId, Row};

/// Legend of the columns of rows, after the line on successes.
const ROWS_EXPLAINED: &str = "
95 % interval  of the success rate over other starts, two-sided
recall         share solved here of the starts that search solves; –: no search, or it solved none
sims/start     simulations spent per start, on average
contact        share of the successes that end in a contact
front/side/    contacts by the side of the ego that is touched
closing        median closing speed of these contacts
rest, hit      contacts with the ego at rest (at most 0.5 m/s) or hit from behind
avoided        of a sample of them: avoided by a reference driver, of those that can be judged
fouls          starts on which a rule was broken first: no success; search: sequences it tried
cpu s          processor time spent on all of the starts";
/// Width of the first column of the legend.
const LEGEND_INDENT: usize = 15;

/// Legend of the columns of a block's egos and of its summary.
const BLOCKS_EXPLAINED: &str = "
reachable      starts that search solves; –: no search was asked for
union          starts that any ado here, or search, solves
trained − it   success of the trained ado less that of this one, over the egos of the block
mean, least    over those egos of which search solves enough to ask for recall";

/// Formats all rows as a table, after a line on failures without an adversary.
pub(super) fn rows(rows: &[Row]) -> String {
    let (lines, remarks) = (lines(rows), remarks(rows));
    let legend = legend(rows);
    format!("{}\n{lines}{legend}{remarks}", opening(rows))
}

/// Explains the columns of rows, with the successes of their world first.
fn legend(rows: &[Row]) -> String {
    let Some(row) = rows.first() else {
        return ROWS_EXPLAINED.to_owned();
    };
    let mut text = "\nsuccess        starts on which the ego violates its specification, and no \
                    rule was broken before"
        .to_owned();
    // Rows of earlier versions have no specification.
    if !row.specification.is_empty() {
        text.push_str(&in_legend(&format!("specification: {}", row.specification)));
    }
    if let Some(counts) = &row.counts {
        text.push_str(&in_legend(&format!("`counts`: {counts}")));
    }
    text + ROWS_EXPLAINED
}

/// Breaks a text into indented lines of the legend, between words.
fn in_legend(text: &str) -> String {
    let mut lines = String::new();
    let mut width = usize::MAX;
    for word in text.split(' ') {
        let more = 1 + word.chars().count();
        if width.saturating_add(more) > usize::from(WIDTH) {
            lines.push('\n');
            lines.push_str(&" ".repeat(LEGEND_INDENT - 1));
            width = LEGEND_INDENT - 1;
        }
        lines.push(' ');
        lines.push_str(word);
        width += more;
    }
    lines
}

/// Formats contacts, faults and repeated runs, which do not fit into the table.
pub(super) fn remarks(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        if let Some(warning) = &row.warning {
            text.push_str(&format!(
                "\nwarning: {}, {}: {}",
                row.ego, row.ado, warning.what
            ));
        }
        if let Some(warning) = success_warning(row) {
            text.push_str(&format!(
                "\nwarning: {}, {}: {warning}; `counts` in the world leaves these out \
                 (docs/reference/world-file.md)",
                row.ego, row.ado
            ));
        }
        if let Some(severity) = &row.severity {
            let late = row
                .foul_before_contact_rate
                .filter(|share| *share > 0.0)
                .map_or(String::new(), |share| {
                    let share = percent(share);
                    format!("; on {share} of the starts a rule broke between failure and contact")
                });
            let partly = row.success_contacts.as_ref().filter(|it| it.not_judged > 0);
            let unjudged = partly.map_or(String::new(), |of| {
                let sample = of.judged + of.not_judged;
                let unjudged = of.not_judged;
                format!("; reference drivers cannot judge {unjudged} of {sample} successes")
            });
            text.push_str(&format!(
                "\ncontacts: {}, {}: {severity}{late}{unjudged}",
                row.ego, row.ado
            ));
        }
        if let Some(natural) = &row.naturalness {
            text.push_str(&format!("\ntraffic: {}, {}: {natural}", ego(row), row.ado));
        }
        let groups = row.distinct.map(|groups| match groups {
            1 => "1 group".to_owned(),
            _ => format!("{groups} groups"),
        });
        // With a single kind there is nothing to distinguish.
        let kinds = row
            .kinds
            .iter()
            .filter(|_| row.kinds.len() > 1)
            .map(ToString::to_string);
        let failures: Vec<String> = groups.into_iter().chain(kinds).collect();
        if !failures.is_empty() {
            let failures = failures.join("; ");
            text.push_str(&format!("\nfailures: {}, {}: {failures}", row.ego, row.ado));
        }
        // With a single ado, `fouls` has it all.
        let mut ados = row.violations.iter().map(|broken| &broken.ado);
        let first = ados.next();
        if ados.any(|ado| Some(ado) != first) {
            let rules: Vec<String> = row.violations.iter().map(ToString::to_string).collect();
            let broken = rules.join("; ");
            text.push_str(&format!(
                "\nrule violations: {}, {}: {broken}",
                row.ego, row.ado
            ));
        }
        for fault in &row.faults {
            text.push_str(&format!("\ninvalid: {}, {}: {fault}", row.ego, row.ado));
        }
        if let Some(repeats) = &row.repeats {
            let [lo, hi] = repeats.ci95.map(|share| 100.0 * share);
            text.push_str(&format!(
                "\n{}, {}: {} runs per start, solved if {} fail; the ego fails in {:.1} % of all \
                 runs [{lo:.1}, {hi:.1}]",
                row.ego,
                row.ado,
                repeats.runs,
                repeats.gate,
                100.0 * repeats.failing_share
            ));
            if repeats.differing > 0 {
                text.push_str(&format!(
                    "; on {} starts its commands differ between the runs",
                    repeats.differing
                ));
            }
        }
    }
    text
}

/// Returns the warning about contacts that are no fault of the ego, if most are.
fn success_warning(row: &Row) -> Option<String> {
    row.success_contacts.as_ref()?.warning(row.successes)
}

/// Returns the ego of a row, with the limit on its ados.
fn ego(row: &Row) -> String {
    let natural = row.naturalness.as_ref();
    match natural.and_then(|it| it.limit_per_1000_km) {
        Some(rate) => format!("{}, natural {rate}", row.ego),
        None => row.ego.clone(),
    }
}

/// Formats the rows of several egos in blocks with summaries.
///
/// For a single ego it formats the rows only.
pub(super) fn reuse(egos: &[ReusedOn], summaries: &[Summary]) -> String {
    let all: Vec<Row> = egos.iter().flat_map(|ego| ego.rows.clone()).collect();
    // Means over a single ego would repeat its rows.
    if egos.len() < 2 {
        return rows(&all);
    }
    let mut text = opening(&all);
    let mut relations: Vec<_> = egos.iter().map(|ego| ego.relation).collect();
    relations.sort();
    relations.dedup();
    for relation in relations {
        let block: Vec<&ReusedOn> = egos.iter().filter(|ego| ego.relation == relation).collect();
        let rows: Vec<Row> = block.iter().flat_map(|ego| ego.rows.clone()).collect();
        let of_block = summaries.iter().filter(|sum| sum.relation == relation);
        text.push_str(&format!(
            "\n\n# {}\n{}{}\n{}\n{}",
            relation.heading(),
            lines(&rows),
            remarks(&rows),
            without_adversary(&block),
            summary(of_block)
        ));
    }
    let of_all = summaries
        .iter()
        .filter(|sum| sum.relation == Relation::Changed);
    if of_all.clone().count() > 0 {
        let heading = Relation::Changed.heading();
        text.push_str(&format!("\n\n# {heading}\n{}", summary(of_all)));
    }
    text.push_str(&format!("\n{}{BLOCKS_EXPLAINED}", legend(&all)));
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
    TextTable::new(columns, rows).numbers_from(1).to_terminal()
}

/// One line per ado: its means over the block.
fn summary<'a>(summaries: impl Iterator<Item = &'a Summary>) -> String {
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
            percent(sum.success_rate),
            sum.reference_minus
                .map_or("–".to_owned(), |(mean, [lo, hi])| {
                    let [mean, lo, hi] = [mean, lo, hi].map(|share| 100.0 * share);
                    format!("{mean:+.1} [{lo:+.1}, {hi:+.1}]")
                }),
            sum.recall_mean.map_or("–".to_owned(), |recall| {
                format!("{recall:.3} ({} egos)", sum.egos_with_recall)
            }),
            sum.recall_min
                .as_ref()
                .map_or("–".to_owned(), |(recall, ego)| {
                    format!("{recall:.3} ({ego})")
                }),
            format!("{:.1}", sum.sims_per_start),
        ]
    });
    TextTable::new(columns, rows).numbers_from(1).to_terminal()
}

/// Draws two tables: the findings with their cost, and the details.
fn lines(rows: &[Row]) -> String {
    let found = rows.iter().map(|row| {
        [
            ego(row),
            row.ado.to_string(),
            row.method.clone(),
            match (row.starts, row.partial) {
                (_, Some(partial)) => format!("at least {}/{}", row.successes, partial.of),
                (0, None) => "– (0/0)".to_owned(),
                (starts, None) => {
                    format!("{} ({}/{starts})", percent(row.success_rate), row.successes)
                }
            },
            row.ci95.map_or("–".to_owned(), |[lo, hi]| {
                format!("{:.1} – {:.1}", 100.0 * lo, 100.0 * hi)
            }),
            row.recall.map_or("–".to_owned(), |r| format!("{r:.3}")),
            format!("{:.1}", row.sims_per_start),
        ]
    });
    let columns = [
        "ego",
        "ado",
        "method",
        "success",
        "95 % interval",
        "recall",
        "sims/start",
    ];
    let found = TextTable::new(columns, found).numbers_from(3).to_terminal();
    let how = rows.iter().map(|row| {
        // Rows of earlier versions have the closing speed of all contacts only.
        let closing = row.success_closing_mps.or(row.closing_speed_mps);
        let [contact, sides, without_fault, avoided] = row.contact_cells();
        [
            ego(row),
            row.ado.to_string(),
            contact,
            sides,
            closing.map_or("–".to_owned(), |closing| format!("{:.1}", closing.median)),
            without_fault,
            avoided,
            percent(row.foul_rate),
            format!("{:.1}", row.cpu_s),
        ]
    });
    let columns = [
        "ego",
        "ado",
        "contact",
        "front/side/\nrear",
        "closing\nm/s",
        "rest, hit\nbehind",
        "avoided",
        "fouls",
        "cpu s",
    ];
    let how = TextTable::new(columns, how).numbers_from(2).to_terminal();
    let (bounds, partials, uncounted) = (bounds(rows), partials(rows), uncounted(rows));
    format!("{found}\n{how}{bounds}{partials}{uncounted}")
}

/// Bounds of interrupted rows, a line for each.
fn partials(rows: &[Row]) -> String {
    let lines = rows.iter().filter_map(|row| {
        let partial = row.partial?;
        let open = partial.of - partial.decided;
        Some(format!(
            "\npartial: {}, {}: {} of {} starts decided. Starts with a success are decided sooner, so \
             there is no interval: at least {} succeed, at most {}",
            row.ego,
            row.ado,
            partial.decided,
            partial.of,
            row.successes,
            row.successes + open
        ))
    });
    lines.collect()
}

/// Violations that do not count in a world, one line for all rows.
fn uncounted(rows: &[Row]) -> String {
    // With a single ego its name would only repeat.
    let one_ego = rows.iter().all(|row| row.ego == rows[0].ego);
    let counts = rows.iter().filter_map(|row| {
        let (uncounted, starts) = (row.uncounted.filter(|count| *count > 0)?, row.starts);
        let name = if one_ego {
            row.ado.to_string()
        } else {
            format!("{} on {}", row.ado, row.ego)
        };
        Some(format!("{name} {uncounted} of {starts}"))
    });
    let named: Vec<String> = counts.collect();
    if named.is_empty() {
        String::new()
    } else {
        format!(
            "\nviolations that `counts` excludes (uncounted): {}",
            named.join(", ")
        )
    }
}

/// Formats upper bounds of rates without a success, per number of starts.
fn bounds(rows: &[Row]) -> String {
    let one_ego = rows.iter().all(|row| row.ego == rows[0].ego);
    let mut by_starts: Vec<(usize, f64, Vec<String>)> = Vec::new();
    for row in rows {
        let Some(bound) = row.at_most else { continue };
        // A wider search may succeed where this one does not.
        let ado = match row.ado {
            AdversaryId::Search { .. } => format!("search ({})", row.method),
            _ => row.ado.to_string(),
        };
        let name = if one_ego {
            ado
        } else {
            format!("{ado} on {}", row.ego)
        };
        match by_starts.iter_mut().find(|line| line.0 == row.starts) {
            Some((_, _, names)) => names.push(name),
            None => by_starts.push((row.starts, bound, vec![name])),
        }
    }
    let lines = by_starts.iter().map(|(starts, bound, names)| {
        // An upper bound is rounded up.
        let bound = (1000.0 * bound).ceil() / 10.0;
        let names = names.join(", ");
        format!(
            "\n{names}: no success in {starts}, so such an adversary succeeds on at most {bound:.1} % of \
             starts like these (one-sided 95 % bound); others may succeed on more"
        )
    });
    lines.collect()
}

fn opening(rows: &[Row]) -> String {
    let Some(row) = rows.first() else {
        return String::new();
    };
    // `starts` counts the starts in the rates only.
    let open = row
        .partial
        .map_or(0, |partial| partial.of - partial.decided);
    let all = row.starts + row.trivial + row.invalid + open;
    let share = 100.0 * row.trivial as f64 / all.max(1) as f64;
    let mut text = format!(
        "{} on the {} plant, {all} starts of seed {}",
        row.world, row.plant, row.start_seed
    );
    let judged_itself = rows
        .iter()
        .all(|row| row.fails_alone.is_some_and(|it| it.left_out));
    // If each ego is judged itself, the excluded starts differ from row to row.
    if !judged_itself {
        text.push_str(&format!(
            "; fails without an adversary: {share:.1} % ({}), left out below",
            row.trivial
        ));
    }
    text.push_str(&by_itself(rows, all));
    let invalid: usize = rows.iter().map(|row| row.invalid).sum();
    if invalid > 0 {
        text.push_str(&format!("; {invalid} invalid, in no rate"));
    }
    text
}

/// On how many starts each tested ego itself fails without an adversary.
fn by_itself(rows: &[Row], all: usize) -> String {
    let mut egos: Vec<&str> = Vec::new();
    let mut text = String::new();
    for row in rows {
        let Some(alone) = row
            .fails_alone
            .filter(|_| !egos.contains(&row.ego.as_str()))
        else {
            continue;
        };
        // All rows of an ego have the same number, so the first suffices.
        egos.push(&row.ego);
        // For the nominal ego the number equals the excluded starts, unless the plant
        // differs.
        if !alone.left_out && row.ego == "nominal" && alone.starts == row.trivial {
            continue;
        }
        let share = 100.0 * alone.starts as f64 / all.max(1) as f64;
        let left_out = if alone.left_out {
            ", left out below"
        } else {
            ""
        };
        text.push_str(&format!(
            "; `{}` itself: {share:.1} % ({}){left_out}",
            row.ego, alone.starts
        ));
    }
    text
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_dir::{Partial, SuccessContacts};
    use brakecheck_sim::severity::Side;

    fn row(ego: &str, ado: &str, successes: usize, starts: usize) -> Row {
        let at_most = (successes == 0).then(|| crate::stats::at_most(starts));
        let row = serde_json::json!({
            "world": "w", "plant": "Kinematic", "judge": "UntilViolation", "ego": ego, "ado": ado,
            "method": "m", "start_seed": 0, "starts": starts, "trivial": 0,
            "successes": successes, "success_rate": 0.0, "ci95": [0.0, 1.0], "at_most": at_most,
            "foul_rate": 0.0, "contact_rate": 0.0, "invalid": 0, "sims_per_start": 1.0,
            "physics_steps": 0, "cpu_s": 0.0, "solved": "",
        });
        serde_json::from_value(row).expect("a row")
    }

    /// Long names fit, and every mark is explained.
    #[test]
    fn tables_fit_a_terminal_and_their_columns_are_explained() {
        let long = "an ego whose name does not end as soon as one would wish";
        let rows = [
            row(long, "best constant", 250, 284),
            row("nominal", "search", 0, 50),
        ];
        let text = super::rows(&rows);
        for line in text
            .lines()
            .skip(1)
            .filter(|line| !line.contains("no success in"))
        {
            assert!(line.chars().count() <= 100, "{line}");
        }
        for column in [
            "success  ",
            "recall  ",
            "sims/start  ",
            "rest, hit  ",
            "avoided  ",
            "cpu s  ",
        ] {
            assert!(text.contains(&format!("\n{column}")), "{column}: {text}");
        }
    }

    #[test]
    fn an_interrupted_row_has_counts_and_bounds_and_no_interval() {
        let mut row = row("nominal", "search", 19, 19);
        row.partial = Some(Partial {
            decided: 20,
            of: 100,
        });
        (row.ci95, row.invalid) = (None, 1);
        let text = super::rows(&[row]);
        let says = [
            "100 starts of seed 0",
            "┆ at least 19/100 ┆             – ┆",
            "partial: nominal, search: 20 of 100 starts decided.",
            "at least 19 succeed, at most 99",
        ];
        for says in says {
            assert!(text.contains(says), "{says}: {text}");
        }
        assert!(!text.contains("100.0 %"), "{text}");
    }

    #[test]
    fn successes_are_described_beside_their_rate() {
        let mut row = row("nominal", "trained", 278, 300);
        row.specification = "always (ego.ado.gap >= 0.2)".to_owned();
        row.counts = Some("only a contact of the moving ego".to_owned());
        row.success_contacts = Some(SuccessContacts {
            contacts: 222,
            sides: [(Side::Left, 200), (Side::Right, 20), (Side::Rear, 2)].into(),
            ego_at_rest: 1,
            hit_from_behind: 1,
            judged: 18,
            avoided: 12,
            not_judged: 2,
        });
        let text = super::rows(std::slice::from_ref(&row));
        for says in [
            "┆    80 % ┆     0/220/2 ┆",
            "┆       1 % ┆ 12 of 18 ┆",
            "specification: always (ego.ado.gap >= 0.2)",
            "`counts`: only a contact of the moving ego",
        ] {
            assert!(text.contains(says), "{says}: {text}");
        }
        assert!(!text.contains("warning"), "{text}");
        row.success_contacts = Some(SuccessContacts {
            contacts: 146,
            ego_at_rest: 146,
            ..SuccessContacts::default()
        });
        let text = super::rows(&[row]);
        let warning = "warning: nominal, trained: of 278 successes, 146 are contacts with the ego \
                       at rest or hit from behind and 132 have no contact";
        assert!(text.contains(warning), "{text}");
    }

    #[test]
    fn a_row_without_success_says_how_much_there_may_be_after_all() {
        // 1 − 0.05^(1/284) is 1.0493 %.
        let some = [row("nominal", "trained", 250, 284)];
        assert_eq!(bounds(&some), "");
        let none = [
            row("nominal", "hold", 0, 284),
            row("nominal", "trained", 250, 284),
            row("nominal", "random", 0, 284),
            row("nominal", "search", 0, 50),
        ];
        assert_eq!(
            bounds(&none),
            "\nhold, random: no success in 284, so such an adversary succeeds on at most 1.1 % of \
             starts like these (one-sided 95 % bound); others may succeed on more\
             \nsearch (m): no success in 50, so such an adversary succeeds on at most 5.9 % of \
             starts like these (one-sided 95 % bound); others may succeed on more"
        );
        let two_egos = [row("nominal", "hold", 0, 100), row("van", "hold", 0, 100)];
        assert_eq!(
            bounds(&two_egos),
            "\nhold on nominal, hold on van: no success in 100, so such an adversary succeeds on at \
             most 3.0 % of starts like these (one-sided 95 % bound); others may succeed on more"
        );
        assert_eq!(bounds(&[]), "");
    }
}
