//! Same ado against other egos: sorted rows, and their summary in words.

use maud::{Markup, html};

use super::results::{interval, percent, share_of, success};
use super::{Tested, Training};
use crate::run_dir::{AdversaryId, Row};
use crate::stats::StartOutcome;

/// Sorted rows: the nominal ego first, then by falling success of the trained ado.
///
/// Rows of one ego are sorted by falling success.
pub(super) fn rows(tested: &[Tested]) -> Markup {
    let sorted = sorted(tested);
    html! {
        div class="wide" { table class="rows" {
            thead { tr { th { "ego" } th { "ado" } th { "method" } th class="n" { "success" } th { "" } th { "95 %" } th class="n" { "recall" } th class="n" { "fouls" } th class="n" { "fouls before contact" } th class="n" { "contact" } th class="n" { "front / side / rear" } th class="n" { "closing m/s, median / 90 %" } th class="n" { "at rest, hit behind" } th class="n" { "avoided" } th class="n" { "sims / start" } } }
            tbody { @for Tested { row, .. } in &sorted { @let cells = row.contact_cells(); tr {
                td { (row.ego) } td data-l="ado" { (row.ado) } td class="m" data-l="method" { (row.method) }
                td class="n" data-l="success" {
                    (success(row))
                    @if row.invalid > 0 { ", " (row.invalid) " invalid" }
                }
                td class="bar" { span class="share" style=(format!("width:{:.1}rem", 4.0 * row.success_rate.max(0.0))) {} }
                td data-l="95 %" { (interval(row)) }
                td class="n" data-l="recall" { (row.recall.map_or("–".to_owned(), |r| format!("{r:.3}"))) }
                td class="n" data-l="fouls" { (share_of(row.starts, row.foul_rate)) } td class="n" data-l="fouls before contact" { (row.foul_before_contact_rate.map_or("–".to_owned(), |share| share_of(row.starts, share))) } td class="n" data-l="contact" { (cells[0]) }
                td class="n" data-l="front / side / rear" { (cells[1]) }
                td class="n" data-l="closing m/s, median / 90 %" { (row.success_closing_mps.or(row.closing_speed_mps).map_or("–".to_owned(), |c| format!("{:.1} / {:.1}", c.median, c.p90))) }
                td class="n" data-l="at rest, hit behind" { (cells[2]) } td class="n" data-l="avoided" { (cells[3]) }
                td class="n" data-l="sims / start" { (format!("{:.1}", row.sims_per_start)) }
            } } }
        } }
        @for words in in_words(&sorted) { p { (words) } }
        @for Tested { row, .. } in &sorted { @if let Some(warning) = row.success_contacts.as_ref().and_then(|it| it.warning(row.successes)) {
            p class="warning" { (row.ego) ", " (row.ado) ": " (warning) "." }
        } }
        @for Tested { row, .. } in &sorted { @if let Some(severity) = &row.severity {
            p class="dim" { "Contacts, " (row.ego) ", " (row.ado) ": " (severity) }
        } }
        @for Tested { row, .. } in &sorted { @for fault in &row.faults {
            p class="note" { (row.ego) ", " (row.ado) ": " (fault) }
        } }
    }
}

/// Note if the closing evaluation of the training has another rate than the page.
pub(super) fn which_rate(row: &Row, trainings: &[Training]) -> Markup {
    let closing = trainings.first().and_then(|it| it.closing.first());
    // Equal seeds and numbers mean equal starts, so both rates would be equal.
    let same = |other: &Row| other.starts == row.starts && other.start_seed == row.start_seed;
    // A rate of another ego is no other rate of this one, and no start gives no rate.
    let own = closing.filter(|closing| closing.ego == row.ego && row.starts > 0);
    let Some(closing) = own.filter(|closing| !same(closing)) else {
        return html! {};
    };
    html! {
        p class="dim" {
            "Two rates, since they are of different starts: that of this page, " (percent(row.success_rate)) ", is of "
            (row.starts) " starts of seed " (row.start_seed) "; " (percent(closing.success_rate)) " is what the training measured when it closed, on "
            (closing.starts) " of seed " (closing.start_seed) ". Quote the former."
        }
    }
}

fn sorted(tested: &[Tested]) -> Vec<&Tested> {
    let by_trained = |ego: &str| {
        let own = tested.iter().map(|it| &it.row).filter(|row| row.ego == ego);
        let trained = own
            .filter(|row| is_trained(row))
            .map(|row| row.success_rate);
        // An ego without a trained row comes last.
        trained.fold(-1.0, f64::max)
    };
    let mut sorted: Vec<&Tested> = tested.iter().collect();
    sorted.sort_by(|a, b| {
        let (a, b) = (&a.row, &b.row);
        let egos = (b.ego == "nominal")
            .cmp(&(a.ego == "nominal"))
            .then(by_trained(&b.ego).total_cmp(&by_trained(&a.ego)));
        // By name after equal successes, so that rows of one ego stay
        // together.
        egos.then_with(|| a.ego.cmp(&b.ego))
            .then(b.success_rate.total_cmp(&a.success_rate))
    });
    sorted
}

fn is_trained(row: &Row) -> bool {
    row.ado == AdversaryId::Trained
}

/// Returns true for an ado that neither learned nor searched.
fn is_baseline(row: &Row) -> bool {
    row.train_seed.is_none() && !row.ado.is_search() && !is_trained(row)
}

/// Egos on which a baseline is at least as good as the trained ado.
///
/// Only starts on which both were evaluated are compared.
fn in_words(sorted: &[&Tested]) -> Vec<String> {
    let rows = || sorted.iter().map(|it| &it.row);
    let mut beaten = Vec::new();
    let mut compared = 0;
    for trained in rows().filter(|row| is_trained(row)) {
        let own = rows().filter(|row| row.ego == trained.ego && is_baseline(row));
        // Only the best baseline, since the others say less.
        let best = own.max_by(|a, b| a.success_rate.total_cmp(&b.success_rate));
        let Some(best) = best else { continue };
        // Rows may have different numbers of starts, of which the shorter list
        // is the common part.
        let both = trained.solved.len().min(best.solved.len());
        let ([ado, starts], [baseline, _]) = (counts(trained, both), counts(best, both));
        // Two zeros are no equality worth mentioning, and no victory either.
        if ado == 0 && baseline == 0 {
            continue;
        }
        compared += 1;
        if ado <= baseline {
            let verb = if ado < baseline { "beats" } else { "equals" };
            beaten.push(format!(
                "On {} the baseline {} ({}) {verb} the trained ado: {baseline} of {starts} starts against {ado}.",
                trained.ego, best.ado, best.method
            ));
        }
    }
    // Without a comparison the sentence would claim a victory over nothing.
    if beaten.is_empty() && compared > 0 {
        beaten.push(format!(
            "On {} no baseline of this table is as good as the trained ado.",
            match compared {
                1 => "the only ego that either makes fail".to_owned(),
                some => format!("all {some} egos that either makes fail"),
            }
        ));
    }
    beaten
}

/// Numbers of solved and evaluated starts among the first `most`.
fn counts(row: &Row, most: usize) -> [usize; 2] {
    let first = || row.solved.iter().take(most);
    let solved = first().filter(|it| **it == StartOutcome::Solved).count();
    let evaluated = first().filter(|it| it.score().is_some()).count();
    [solved, evaluated]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tested(ego: &str, ado: &str, solved: &str) -> Tested {
        let successes = solved.matches('1').count();
        let trained = ado == "trained";
        let json = serde_json::json!({
            "world": "acc", "plant": "Kinematic", "judge": "UntilViolation", "ego": ego,
            "ado": ado, "method": "some", "train_seed": trained.then_some(0), "start_seed": 0,
            "starts": solved.len(), "trivial": 0, "successes": successes,
            "success_rate": successes as f64 / solved.len().max(1) as f64, "ci95": [0.0, 1.0],
            "foul_rate": 0.0, "contact_rate": 0.0, "invalid": 0, "sims_per_start": 1.0,
            "physics_steps": 0, "cpu_s": 0.0, "solved": solved,
        });
        let row = serde_json::from_value(json).expect("a row");
        Tested {
            row,
            why: None,
            outcomes: None,
        }
    }

    #[test]
    fn rows_are_sorted_and_say_where_a_baseline_is_better() {
        let rows = [
            tested("wet", "hold", "1100"),
            tested("wet", "trained", "1000"),
            tested("soft", "hold", "0000"),
            tested("soft", "trained", "1110"),
            tested("nominal", "hold", "01"),
            // The rows differ in their number of starts and are compared on the
            // common starts.
            tested("nominal", "trained", "1100"),
        ];
        let sorted = sorted(&rows);
        let order: Vec<(&str, &str)> = sorted
            .iter()
            .map(|it| (it.row.ego.as_str(), it.row.ado.caption()))
            .collect();
        let expected = [
            ("nominal", "hold"),
            ("nominal", "trained"),
            ("soft", "trained"),
            ("soft", "hold"),
            ("wet", "hold"),
            ("wet", "trained"),
        ];
        assert_eq!(order, expected);
        let words = in_words(&sorted);
        let beaten =
            "On wet the baseline hold (some) beats the trained ado: 2 of 4 starts against 1.";
        assert_eq!(words, [beaten]);
        assert!(in_words(&sorted[..2]).concat().contains("no baseline"));
        let even = [tested("dry", "hold", "00"), tested("dry", "trained", "00")];
        assert!(in_words(&super::sorted(&even)).is_empty());
        // Neither order nor verdict depends on the captions of the ados.
        let reworded = rows.each_ref().map(|Tested { row, .. }| {
            let mut keys = serde_json::to_value(row).expect("JSON");
            keys["ado"] = "an ado".into();
            let row = serde_json::from_value(keys).expect("a row");
            Tested {
                row,
                why: None,
                outcomes: None,
            }
        });
        let again = super::sorted(&reworded);
        assert!(again.iter().zip(&sorted).all(|(a, b)| a.row == b.row));
        assert_eq!(in_words(&again), words);
    }

    #[test]
    fn a_share_of_no_starts_is_unknown() {
        let row = |solved: &str| rows(&[tested("wet", "trained", solved)]).into_string();
        let fouls = |solved: &str| {
            let table = row(solved);
            let cell = table.split("data-l=\"fouls\">").nth(1).expect("a cell");
            cell.split('<').next().unwrap_or_default().to_owned()
        };
        assert_eq!([fouls("10"), fouls("")], ["0.0 %", "–"]);
        let unknown = [tested("wet", "hold", ""), tested("wet", "trained", "")];
        assert!(in_words(&sorted(&unknown)).is_empty());
    }
}
