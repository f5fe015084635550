//! Page of replayed counterexamples.

use rayon::prelude::*;

use super::picture::example;
use super::replay::{ReplayCounts, Replayed};
use super::replay_suite::case_name;
use crate::experiment::worse_first;
use crate::report::{PageEpisode, ResultPage, ResultTable, TextTable};

/// Returns the page of replays against an ego, which shows at most `most` of them moving.
///
/// Crashes that still fail are first, the worst before the others. Replays that did not run
/// have no motion.
pub fn replay_page<'a>(replayed: &'a [Replayed], ego: &str, most: usize) -> ResultPage<'a> {
    let counts = ReplayCounts::of(replayed);
    let rows = replayed.iter().map(|one| {
        let contact = one.episode.contact.as_ref();
        [
            case_name(&one.path),
            one.outcome().words().to_owned(),
            contact.map_or("–".to_owned(), |touch| {
                format!("{:.1} m/s", touch.closing_speed_mps)
            }),
            match (one.fault(), one.no_answer()) {
                (Some(fault), _) => format!("{}: {}", fault.kind.word(), fault.message),
                (None, Some(why)) => why.to_string(),
                (None, None) => one.in_words(),
            },
        ]
    });
    let table = TextTable::new(["crash", "outcome", "closing", "run"], rows);
    let mut shown: Vec<&Replayed> = replayed.iter().filter(|it| it.fault().is_none()).collect();
    shown.sort_by(|a, b| {
        let still = b.still_fails().cmp(&a.still_fails());
        still.then_with(|| worse_first(&a.episode, &b.episode))
    });
    shown.truncate(most);
    let examples = shown.par_iter().map(|one| PageEpisode {
        scenario: &one.scenario,
        example: example(one, case_name(&one.path)),
    });
    ResultPage {
        kind: format!("kept crashes, {ego}"),
        verdict: counts.to_string(),
        // Replays without an answer are no evidence for the ego, so they count as bad.
        is_bad: counts.fixed < counts.replayed,
        tables: vec![ResultTable {
            heading: "Every kept crash".to_owned(),
            table,
        }],
        examples: examples.collect(),
        ..ResultPage::default()
    }
}
