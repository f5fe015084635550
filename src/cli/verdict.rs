//! Rows in one to three sentences: the strongest adversary, and the starts.

use crate::report::known_if;
use crate::run_dir::{AdversaryId, Row, counted};

/// Returns the verdict of rows on their egos, of which the strongest adversary decides.
pub(super) fn verdict(rows: &[Row]) -> Vec<String> {
    let mut egos: Vec<String> = rows.iter().map(ego).collect();
    // Rows of one ego are adjacent, so no sorting is needed.
    egos.dedup();
    let Some(worst) = strongest(rows.iter()) else {
        return vec!["no result: no row was evaluated".to_owned()];
    };
    let first = if egos.len() > 1 {
        let fails = |name: &&String| {
            let mut own = rows.iter().filter(|row| ego(row) == **name);
            own.any(|row| row.successes > 0)
        };
        // An ego without an evaluated start neither fails nor passes.
        let is_unknown = |name: &&String| {
            let mut own = rows.iter().filter(|row| ego(row) == **name);
            own.all(|row| row.starts == 0)
        };
        let unknown = match egos.iter().filter(is_unknown).count() {
            0 => String::new(),
            some => format!(", {some} without a result"),
        };
        format!(
            "{} of {} egos fail{unknown}, the worst of them: {}",
            egos.iter().filter(fails).count(),
            egos.len(),
            sentence(worst)
        )
    } else {
        sentence(worst)
    };
    vec![first, opening(rows)]
}

/// Returns the row with the highest rate, the first of equal ones.
pub(super) fn strongest<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<&'a Row> {
    // `max_by` would return the last of equal rows.
    rows.reduce(|a, b| {
        // An unknown rate is NaN, and any other is worse.
        if b.success_rate > a.success_rate || a.success_rate.is_nan() {
            b
        } else {
            a
        }
    })
}

/// Returns the result of a row in a sentence.
fn sentence(row: &Row) -> String {
    let ego = ego(row);
    let against = match &row.ado {
        AdversaryId::Trained => "the trained ado".to_owned(),
        AdversaryId::Guided => "the search by the trained ado".to_owned(),
        ado if ado.is_search() => "the search".to_owned(),
        ado => format!("the ado `{ado}`"),
    };
    if let Some(fault) = row.faults.first().filter(|_| row.is_unrepeatable()) {
        let kind = fault.kind.word();
        return format!("no result: `{ego}` depends on more than the episode ({kind})");
    }
    // Such an ego is given up, which is no interruption.
    if row.starts == 0 && row.invalid > 0 {
        return format!(
            "no result: `{ego}` did not run from any of {}",
            counted(row.invalid, "start")
        );
    }
    // Solved starts end sooner, so a rate of the decided ones would be too high.
    if let Some(partial) = row.partial {
        return format!(
            "interrupted: `{ego}` fails from at least {} of {} against {against}",
            row.successes,
            counted(partial.of, "start")
        );
    }
    match (row.starts, row.successes) {
        (0, _) => format!("no result: no start was evaluated against {against}"),
        (starts, 0) => {
            let bound = row.at_most.map(bound_in_words);
            format!(
                "`{ego}` fails from none of {} against {against}{}",
                counted(starts, "start"),
                bound.map_or(String::new(), |bound| format!(", so {bound}"))
            )
        }
        (starts, successes) => {
            let percents = row.ci95.map(|ends| ends.map(|share| 100.0 * share));
            let interval =
                percents.map_or(String::new(), |[lo, hi]| format!(" [{lo:.1}, {hi:.1}]"));
            let severity = severity(row).map_or(String::new(), |it| format!("; contact: {it}"));
            format!(
                "`{ego}` fails from {successes} of {} against {against}: {}{interval}{severity}",
                counted(starts, "start"),
                percent(row.success_rate)
            )
        }
    }
}

/// Returns the one-sided bound of a rate without a success.
pub(super) fn bound_in_words(at_most: f64) -> String {
    // An upper bound is rounded up.
    let bound = (1000.0 * at_most).ceil() / 10.0;
    format!("from at most {bound:.1} % of such starts (one-sided 95 % bound)")
}

/// Returns the share of successes with a contact, and its median closing speed.
///
/// `None` without a success or if it was not recorded.
pub(super) fn severity(row: &Row) -> Option<String> {
    let contacts = row.success_contacts.as_ref()?.contacts;
    // Without a success the share would be 0/0.
    let share = (row.successes > 0).then(|| contacts as f64 / row.successes as f64)?;
    // Rows of earlier versions have the closing speed of all contacts only.
    let closing = row.success_closing_mps.or(row.closing_speed_mps);
    let share = format!("{:.0} %", 100.0 * share);
    Some(match closing.filter(|_| contacts > 0) {
        Some(closing) => format!("{share}, {:.1} m/s", closing.median),
        None => share,
    })
}

/// Returns the ego of a row, with the limit on its ados.
pub(super) fn ego(row: &Row) -> String {
    let natural = row.naturalness.as_ref();
    match natural.and_then(|it| it.limit_per_1000_km) {
        Some(rate) => format!("{}, natural {rate}", row.ego),
        None => row.ego.clone(),
    }
}

/// Returns a share in percent.
pub(super) fn percent(share: f64) -> String {
    known_if(!share.is_nan(), || format!("{:.1} %", 100.0 * share))
}

/// Returns the world, the starts, and those that are left out.
fn opening(rows: &[Row]) -> String {
    let Some(row) = rows.first() else {
        return String::new();
    };
    // `starts` counts the starts in the rates only.
    let open = row
        .partial
        .map_or(0, |partial| partial.of - partial.decided);
    let all = row.starts + row.trivial + row.invalid + open;
    // Without any start the share is 0 instead of NaN.
    let share = 100.0 * row.trivial as f64 / all.max(1) as f64;
    let mut text = format!(
        "{} on the {} plant, {} of seed {}",
        row.world,
        row.plant,
        counted(all, "start"),
        row.start_seed
    );
    let judged_itself = rows
        .iter()
        .all(|row| row.fails_alone.is_some_and(|it| it.left_out));
    // If each ego is judged itself, the excluded starts differ from row to row.
    if !judged_itself {
        text.push_str(&format!(
            "; fails without an adversary: {share:.1} % ({}), left out",
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

/// Egos of which the verdict states the starts that they fail from without an adversary.
const NAMED: usize = 2;

/// On how many starts each tested ego itself fails without an adversary.
fn by_itself(rows: &[Row], all: usize) -> String {
    let mut egos: Vec<&str> = Vec::new();
    let mut parts = Vec::new();
    for row in rows {
        let Some(alone) = row
            .fails_alone
            .filter(|_| !egos.contains(&row.ego.as_str()) && !row.is_unrepeatable())
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
        let left_out = if alone.left_out { ", left out" } else { "" };
        parts.push(format!(
            "; `{}` itself: {share:.1} % ({}){left_out}",
            row.ego, alone.starts
        ));
    }
    // The table of many egos has a column of them.
    if parts.len() > NAMED {
        return String::new();
    }
    parts.concat()
}
