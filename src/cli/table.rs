//! Rows as tables for people.

use super::answer::PrintedAnswer;
use super::display::stdout_columns;
use super::verdict::{bound_in_words, ego, percent, severity, verdict};
use crate::evaluation::{AdoEffect, AdoFinding};
use crate::report::{TextTable, known_if};
use crate::run_dir::{AdversaryId, Row, counted};

/// Legend of the columns of rows, after the line on successes.
const ROWS_EXPLAINED: &str = "
95 % interval  of the success rate over other starts, two-sided
contact        share of the successes that end in a contact, and its median closing speed
recall         share solved here of the starts that search solves; –: no search, or it solved none
sims/start     simulations spent per start, on average
front/side/    contacts by the side of the ego that is touched
rest, hit      contacts with the ego at rest (at most 0.5 m/s) or hit from behind
avoided        of a sample of them: avoided by a reference driver, of those that can be judged
fouls          starts on which a rule was broken first: no success; search: sequences it tried
cpu s          processor time spent on all of the starts";
/// Effects of ados in the verdict. The details have all of them.
const EFFECTS_SHOWN: usize = 2;
/// Width of the first column of the legend.
const LEGEND_INDENT: usize = 15;

/// Puts the verdict of rows above their table.
pub(super) fn rows(rows: &[Row]) -> PrintedAnswer {
    PrintedAnswer {
        verdict: verdict(rows),
        table: found(rows),
        warnings: warnings(rows),
        details: format!("{}{}", contacts(rows), remarks(rows)),
        legend: legend(rows),
    }
}

/// Adds effects of single ados: to the verdict if one hinders, and all to the details.
pub(super) fn add_effects(answer: &mut PrintedAnswer, effects: &[AdoEffect]) {
    let hinders = |effect: &&AdoEffect| effect.finding == AdoFinding::Hinders;
    // A world is better tested without an ado that hinders the others.
    let named = effects.iter().filter(hinders).take(EFFECTS_SHOWN);
    answer.verdict.extend(named.map(ToString::to_string));
    for effect in effects {
        answer.details.push_str(&format!("\n{effect}"));
    }
}

/// Explains the columns of rows, with the successes of their world first.
pub(super) fn legend(rows: &[Row]) -> String {
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
    // With this width, the first word begins a new line.
    let mut width = usize::MAX;
    for word in text.split(' ') {
        let more = 1 + word.chars().count();
        if width.saturating_add(more) > stdout_columns() {
            lines.push('\n');
            // One column less, because a blank precedes every word.
            lines.push_str(&" ".repeat(LEGEND_INDENT - 1));
            width = LEGEND_INDENT - 1;
        }
        lines.push(' ');
        lines.push_str(word);
        width += more;
    }
    lines
}

/// Formats the remarks without which a table would mislead, a line each.
pub(super) fn warnings(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut trainings: Vec<&str> = Vec::new();
    for row in rows {
        // A training is as doubtful for every ego.
        if let Some(warning) = row
            .warning
            .as_ref()
            .filter(|it| !trainings.contains(&&*it.what))
        {
            trainings.push(&warning.what);
            text.push_str(&format!("\nwarning: {}: {}", row.ado, warning.what));
        }
        if let Some(warning) = success_warning(row) {
            text.push_str(&format!(
                "\nwarning: {}, {}: {warning}; `counts` in the world leaves these out \
                 (docs/reference/world-file.md)",
                row.ego, row.ado
            ));
        }
        for fault in &row.faults {
            text.push_str(&format!("\ninvalid: {}, {}: {fault}", row.ego, row.ado));
        }
        // A start counts by a number of its runs, so the share of all runs is stated
        // beside it.
        if let Some(repeats) = &row.repeats {
            let [lo, hi] = repeats.ci95.map(|share| 100.0 * share);
            text.push_str(&format!(
                "\n{}, {}: {} per start, solved if {} fail; the ego fails in {:.1} % of all \
                 runs [{lo:.1}, {hi:.1}]",
                row.ego,
                row.ado,
                counted(repeats.runs, "run"),
                repeats.gate,
                100.0 * repeats.failing_share
            ));
            if repeats.differing > 0 {
                text.push_str(&format!(
                    "; on {} its commands differ between the runs",
                    counted(repeats.differing, "start")
                ));
            }
        }
    }
    format!("{}{text}", partials(rows))
}

/// Formats bounds, contacts, traffic and kinds of failures, a line each.
pub(super) fn remarks(rows: &[Row]) -> String {
    let mut text = format!("{}{}", bounds(rows), uncounted(rows));
    for row in rows {
        if let Some(severity) = &row.severity {
            let late = row
                .foul_before_contact_rate
                .filter(|share| *share > 0.0)
                .map_or(String::new(), |share| {
                    let share = percent(share);
                    format!("; on {share} of the starts a rule broke between failure and contact")
                });
            // A success that no driver can judge must not be taken for unavoidable.
            let partly = row.success_contacts.as_ref().filter(|it| it.not_judged > 0);
            let unjudged = partly.map_or(String::new(), |of| {
                let sample = counted(of.judged + of.not_judged, "success");
                let unjudged = of.not_judged;
                format!("; reference drivers cannot judge {unjudged} of {sample}")
            });
            text.push_str(&format!(
                "\ncontacts: {}, {}: {severity}{late}{unjudged}",
                row.ego, row.ado
            ));
        }
        if let Some(most) = row
            .max_sims_per_start
            // Other ados play a fixed number of runs, which the table has.
            .filter(|_| row.ado == AdversaryId::Guided)
        {
            text.push_str(&format!(
                "\nruns per start: {}, {}: {:.1} on average, at most {most}",
                row.ego, row.ado, row.sims_per_start
            ));
        }
        if let Some(natural) = &row.naturalness {
            text.push_str(&format!("\ntraffic: {}, {}: {natural}", ego(row), row.ado));
        }
        let groups = row.distinct.map(|groups| counted(groups, "group"));
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
    }
    text
}

/// Returns the warning about contacts that are no fault of the ego, if most are.
fn success_warning(row: &Row) -> Option<String> {
    row.success_contacts.as_ref()?.warning(row.successes)
}

/// Formats the share of successes, of an interrupted row the least.
pub(super) fn success(row: &Row) -> String {
    match (row.starts, row.partial) {
        (_, Some(partial)) => format!("at least {}/{}", row.successes, partial.of),
        // A rate of 0 % over no starts would look safe.
        (0, None) => "– (0/0)".to_owned(),
        (starts, None) => format!("{} ({}/{starts})", percent(row.success_rate), row.successes),
    }
}

/// Formats the 95 % interval in percent.
pub(super) fn interval(row: &Row) -> String {
    row.ci95.map_or("–".to_owned(), |[lo, hi]| {
        format!("{:.1} – {:.1}", 100.0 * lo, 100.0 * hi)
    })
}

/// Draws the rates with their severity and their cost.
pub(super) fn found(rows: &[Row]) -> String {
    let lines = rows.iter().map(|row| {
        [
            ego(row),
            row.ado.to_string(),
            row.method.clone(),
            success(row),
            interval(row),
            severity(row).unwrap_or("–".to_owned()),
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
        "contact",
        "recall",
        "sims/start",
    ];
    let table = TextTable::new(columns, lines).numbers_from(3);
    named_once(table, rows).to_terminal(stdout_columns())
}

/// Leaves out the first column if all rows have the same ego, which the verdict names.
fn named_once(table: TextTable, rows: &[Row]) -> TextTable {
    let first = rows.first().map(ego);
    if rows.iter().all(|row| Some(ego(row)) == first) {
        table.without_first_column()
    } else {
        table
    }
}

/// Draws contacts, broken rules and processor times.
pub(super) fn contacts(rows: &[Row]) -> String {
    let lines = rows.iter().map(|row| {
        // The first cell is the contact, which the table of rates has already.
        let [_, sides, without_fault, avoided] = row.contact_cells();
        [
            ego(row),
            row.ado.to_string(),
            sides,
            without_fault,
            avoided,
            fouls(row),
            format!("{:.1}", row.cpu_s),
        ]
    });
    let columns = [
        "ego",
        "ado",
        "front/side/\nrear",
        "rest, hit\nbehind",
        "avoided",
        "fouls",
        "cpu s",
    ];
    let table = TextTable::new(columns, lines).numbers_from(2);
    named_once(table, rows).to_terminal(stdout_columns())
}

/// Formats the share of starts on which a rule was broken.
fn fouls(row: &Row) -> String {
    known_if(row.starts > 0, || percent(row.foul_rate))
}

/// Bounds of interrupted rows, a line for each.
fn partials(rows: &[Row]) -> String {
    let lines = rows.iter().filter_map(|row| {
        let partial = row.partial?;
        // Undecided starts may all succeed or none, which gives both bounds.
        let open = partial.of - partial.decided;
        Some(format!(
            "\npartial: {}, {}: {} of {} decided. Starts with a success are decided sooner, so \
             there is no interval: at least {} succeed, at most {}",
            row.ego,
            row.ado,
            partial.decided,
            counted(partial.of, "start"),
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
    // `all` asks nothing of an empty list, so the index is safe.
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
        // The bound depends on the number of starts only, so such rows share a line.
        match by_starts.iter_mut().find(|line| line.0 == row.starts) {
            Some((_, _, names)) => names.push(name),
            None => by_starts.push((row.starts, bound, vec![name])),
        }
    }
    let lines = by_starts.iter().map(|(starts, bound, names)| {
        let (names, bound) = (names.join(", "), bound_in_words(*bound));
        format!(
            "\n{names}: no success in {starts}, so such an adversary succeeds {bound}; others may \
             succeed on more"
        )
    });
    lines.collect()
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

    /// The whole answer.
    fn text(rows: &[Row]) -> String {
        let PrintedAnswer {
            verdict,
            table,
            warnings,
            details,
            legend,
        } = super::rows(rows);
        [verdict.join("\n"), table, warnings, details, legend].join("\n")
    }

    /// Long names fit, and every mark is explained.
    #[test]
    fn tables_fit_a_terminal_and_their_columns_are_explained() {
        let long = "an ego whose name does not end as soon as one would wish";
        let rows = [
            row(long, "best constant", 250, 284),
            row("nominal", "search", 0, 50),
        ];
        let text = text(&rows);
        let tables = text
            .lines()
            .filter(|line| line.starts_with(['┌', '│', '╞', '└']));
        for line in tables.chain(super::legend(&rows).lines()) {
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
    fn an_ego_without_a_result_is_counted_apart() {
        let mut broken = row("broken", "search", 0, 0);
        broken.invalid = 50;
        let text = text(&[row("nominal", "search", 3, 50), broken.clone()]);
        let verdict = "1 of 2 egos fail, 1 without a result, the worst of them: `nominal` fails";
        assert!(text.starts_with(verdict), "{text}");
        // Its share of rule violations is unknown, and 0.0 % would look safe.
        assert_eq!(fouls(&broken), "–");
        assert_eq!(fouls(&row("nominal", "search", 3, 50)), "0.0 %");
    }

    #[test]
    fn an_ego_that_is_given_up_is_not_interrupted() {
        let mut broken = row("broken", "search", 0, 0);
        broken.invalid = 3;
        broken.partial = Some(Partial { decided: 3, of: 50 });
        let text = text(&[broken]);
        let verdict = "no result: `broken` did not run from any of 3 starts";
        assert!(text.starts_with(verdict), "{text}");
    }

    #[test]
    fn an_interrupted_row_has_counts_and_bounds_and_no_interval() {
        let mut row = row("nominal", "search", 19, 19);
        row.partial = Some(Partial {
            decided: 20,
            of: 100,
        });
        (row.ci95, row.invalid) = (None, 1);
        let text = text(&[row]);
        let says = [
            "100 starts of seed 0",
            "fails from at least 19 of 100 starts against the search",
            "┆ at least 19/100 ┆",
            "partial: nominal, search: 20 of 100 starts decided.",
            // The 80 open starts may all succeed.
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
        let says = text(std::slice::from_ref(&row));
        for part in [
            // 222 of 278 successes are 79.9 %.
            "300 starts against the trained ado: 0.0 % [0.0, 100.0]; contact: 80 %",
            "┆    80 % ┆",
            "┆     0/220/2 ┆",
            "┆       1 % ┆ 12 of 18 ┆",
            "specification: always (ego.ado.gap >= 0.2)",
            "`counts`: only a contact of the moving ego",
        ] {
            assert!(says.contains(part), "{part}: {says}");
        }
        assert!(!says.contains("warning"), "{says}");
        row.success_contacts = Some(SuccessContacts {
            contacts: 146,
            ego_at_rest: 146,
            ..SuccessContacts::default()
        });
        let text = text(&[row]);
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
            "\nhold, random: no success in 284, so such an adversary succeeds from at most 1.1 % of \
             such starts (one-sided 95 % bound); others may succeed on more\
             \nsearch (m): no success in 50, so such an adversary succeeds from at most 5.9 % of \
             such starts (one-sided 95 % bound); others may succeed on more"
        );
        let two_egos = [row("nominal", "hold", 0, 100), row("van", "hold", 0, 100)];
        assert_eq!(
            bounds(&two_egos),
            "\nhold on nominal, hold on van: no success in 100, so such an adversary succeeds from \
             at most 3.0 % of such starts (one-sided 95 % bound); others may succeed on more"
        );
        assert_eq!(bounds(&[]), "");
    }
}
