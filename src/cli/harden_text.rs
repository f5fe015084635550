//! Text of a hardening: verdict, table, details and the gate that keeps the change.

use std::collections::BTreeMap;

use super::common::table_of;
use super::verdict::{bound_in_words, percent};
use crate::evaluation::harden::{
    HardenReport, HardenVerdict, HardenedEgo, LossLimit, LossResult, StartCount,
};
use crate::experiment::EgoUnderTest;
use crate::run_dir::counted;
use crate::stats::at_most;
use crate::visible::command_line;

/// Changes of the front that are listed. JSON has all of them.
const LISTED: usize = 12;

/// Legend of the columns.
pub(super) const EXPLAINED: &str = "
size      sum over the parameters of the change as a share of its range
search    starts of the search, and kept crashes, that fail against all ados
sealed    sealed starts that fail against all ados, that of its own training included
new ado   sealed starts that fail against the ado that was trained against this change
fewer     reduction of the share of sealed starts that fail, and its one-sided 95 % bound";

/// Returns the verdict in at most three lines.
pub(super) fn verdict(report: &HardenReport) -> Vec<String> {
    let ego = &report.ego;
    if let Some(best) = report.confirmed() {
        return confirmed(report, best);
    }
    if report.searched.starts == 0 {
        let why = if report.interrupted {
            "interrupted before the ego was played"
        } else {
            "no start was evaluated"
        };
        return vec![format!("no result: {why}")];
    }
    if report.is_without_failure() {
        // No failure in a few starts is little evidence, so the bound is part of the
        // verdict.
        let bound = bound_in_words(at_most(report.searched.starts));
        let starts = counted(report.searched.starts, "start");
        return vec![format!(
            "nothing to harden: `{ego}` fails from none of {starts}, so {bound}"
        )];
    }
    let begins = if report.interrupted {
        "interrupted: no change is confirmed"
    } else {
        "no change is confirmed"
    };
    let of_own = of(&report.searched);
    match report.candidates.first() {
        None => vec![format!(
            "{begins}: `{ego}` fails from {of_own} starts of the search, and no change fails \
             less within the limits"
        )],
        Some(one) => vec![
            format!(
                "{begins}: the best is {} ({} instead of {of_own} starts of the search)",
                change(report, &one.values),
                of(&one.searched)
            ),
            one.reasons.join("; "),
        ],
    }
}

fn confirmed(report: &HardenReport, best: &HardenedEgo) -> Vec<String> {
    // Invariant: a change is confirmed on sealed starts, so both are there.
    let Some((it, own)) = best.confirmation.as_ref().zip(report.sealed) else {
        return Vec::new();
    };
    // Invariant: a confirmation has played the new ado on all sealed starts.
    let failing = it.new_ado.failing.unwrap_or(0);
    let losses: Vec<String> = it.losses.iter().map(loss).collect();
    vec![
        format!(
            "`{}` withstands with {}: {} instead of {} sealed starts fail, {} fewer (at least \
             {})",
            report.ego,
            change(report, &best.values),
            of(&it.sealed),
            own.failing,
            percent(it.reduction),
            percent(it.reduction_at_least),
        ),
        format!(
            "an ado trained anew makes it fail from {failing} of them; in natural traffic: {}",
            losses.join(", ")
        ),
        format!("the change is {}", best.file.display()),
    ]
}

/// Returns the mark of an unknown number.
fn dash() -> String {
    "–".to_owned()
}

fn of(count: &StartCount) -> String {
    format!("{} of {}", count.failing, count.starts)
}

/// Returns a change in words, such as `time_gap_s` 0.5 → 0.8.
fn change(report: &HardenReport, values: &BTreeMap<String, f64>) -> String {
    // In the order of the parameters, while the map is sorted by name.
    let parameters = report.parameters.iter();
    let parts = parameters.filter_map(|one| {
        let value = values.get(&one.name)?;
        Some(format!("{} {} → {value}", one.name, one.own))
    });
    parts.collect::<Vec<_>>().join(", ")
}

/// Returns a loss in words, relative where its limit is.
fn loss(it: &LossResult) -> String {
    let measure = &it.measure;
    let Some((own, value)) = it.own.zip(it.value) else {
        return format!("{measure} unknown");
    };
    match it.limit {
        // A ratio to a loss of 0 does not exist, so both values are printed then.
        LossLimit::TimesOwn(_) if own > 0.0 => {
            let change = 100.0 * (value / own - 1.0);
            let between = it.ratio_ci95.map_or(String::new(), |ends| {
                let [lo, hi] = ends.map(|ratio| 100.0 * (ratio - 1.0));
                format!(" [{lo:+.1}, {hi:+.1}]")
            });
            format!("{measure} {change:+.1} %{between}")
        }
        _ => format!("{measure} {own:.3} → {value:.3}"),
    }
}

/// Returns the candidates as a table, with the reasons and the crashes that remain.
pub(super) fn table(report: &HardenReport) -> String {
    if report.candidates.is_empty() {
        return String::new();
    }
    let header = [
        "change", "size", "search", "sealed", "new ado", "fewer", "verdict",
    ];
    let lines = report.candidates.iter().map(|one| {
        let it = one.confirmation.as_ref();
        [
            change(report, &one.values),
            format!("{:.2}", one.size),
            of(&one.searched),
            it.map_or_else(dash, |it| of(&it.sealed)),
            it.and_then(|it| it.new_ado.failing)
                .map_or_else(dash, |failing| failing.to_string()),
            it.map_or_else(dash, |it| {
                format!(
                    "{} (≥ {})",
                    percent(it.reduction),
                    percent(it.reduction_at_least)
                )
            }),
            one.verdict.word().to_owned(),
        ]
    });
    let mut text = table_of(header, lines);
    for one in &report.candidates {
        // A confirmed change has no reason to state.
        if one.verdict != HardenVerdict::Confirmed {
            let values = change(report, &one.values);
            text.push_str(&format!("\n{values}: {}", one.reasons.join("; ")));
        }
    }
    if let Some(crashes) = &report.crashes {
        text.push_str(&format!(
            "\nan ado still makes it fail from {}, the worst in {}",
            counted(crashes.found, "start"),
            crashes.dir.display()
        ));
    }
    text
}

/// Returns what is behind the verdict: ranges, losses, the front of the search.
pub(super) fn details(report: &HardenReport) -> String {
    let mut lines = vec![format!(
        "{} on the {} plant, losses in traffic “{}”, {} played",
        report.world,
        report.plant,
        report.traffic,
        counted(report.played, "ego")
    )];
    for one in &report.parameters {
        lines.push(format!(
            "{} {} in {}..{}",
            one.name, one.own, one.lo, one.hi
        ));
    }
    for one in &report.candidates {
        lines.push(format!(
            "{}: {}",
            one.file.display(),
            change(report, &one.values)
        ));
        let Some(it) = &one.confirmation else {
            continue;
        };
        for result in &it.losses {
            let at_most = result.at_most.map_or_else(dash, |it| format!("{it:.3}"));
            lines.push(format!(
                "  {}, at most {at_most}, in {}",
                loss(result),
                counted(result.runs, "run")
            ));
        }
        if let Some([solved, starts]) = it.new_ado.search {
            lines.push(format!(
                "  {}: a search solves {solved} of {} of its training",
                it.new_ado.ado,
                counted(starts, "start")
            ));
        }
        if let Some([failing, answered]) = it.kept {
            let crashes = counted(answered, "kept crash");
            lines.push(format!("  it still fails in {failing} of {crashes}"));
        }
    }
    let front = report.front.iter().take(LISTED).map(|one| {
        [
            change(report, &one.values),
            format!("{:.2}", one.size),
            one.failing.to_string(),
            format!("{:.2}", one.loss),
        ]
    });
    // A header without rows would look like a lost result.
    if !report.front.is_empty() {
        let header = ["front of the search", "size", "failing", "loss of 1"];
        lines.push(table_of(header, front));
    }
    lines.join("\n")
}

/// Returns the command that closes as soon as an ego is worse than the confirmed one.
pub(super) fn gate_command(report: &HardenReport, ego: &EgoUnderTest) -> Option<String> {
    let best = report.confirmed()?;
    // The ado that was trained against the change is the hardest for it, so it guards the
    // change.
    let name = &best.confirmation.as_ref()?.new_ado.ado;
    let ado = report.ados.iter().find(|it| it.ado == *name)?;
    let mut words = ["brakecheck", "gate"].map(str::to_owned).to_vec();
    words.push(ado.run.display().to_string());
    words.extend(["--baseline-ego".to_owned(), best.file.display().to_string()]);
    match ego.scenario().program() {
        Some(program) => {
            words.extend(["--allow-programs", "--"].map(str::to_owned));
            words.extend(program.command.iter().cloned());
        }
        // The next version does not exist yet, so a placeholder stands for its file.
        None => words.extend(["--ego", "NEW.ron"].map(str::to_owned)),
    }
    Some(command_line(&words))
}
