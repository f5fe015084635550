//! One ado on many egos, summed up by hand.

use brakecheck::adversary::Ado;
use brakecheck::experiment::EgoUnderTest;
use brakecheck::run_dir::{AdversaryId, Row};
use brakecheck::stats::paired_difference;
use brakecheck_evaluation::evaluation::reuse::{
    LEAST_REACHABLE, Relation, ReusedOn, Summary, reused_on, summarise,
};
use brakecheck_experiment::adversary::rollout::eval;

use super::costs::row;
use super::near;
use super::scene::{HEADWAYS_M, altered, chase, quiet, starts};

/// An ego and its rows, recall filled in from the search's.
fn ego(name: &str, relation: Relation, search: &str, ados: &[(&str, &str)]) -> ReusedOn {
    let mut rows = vec![row("search", search)];
    rows[0].sims_per_start = 50.0;
    for (ado, solved) in ados {
        let mut row = row(ado, solved);
        row.compare_with_search(&search.parse().expect("marks"));
        rows.push(row);
    }
    ReusedOn {
        ego: name.to_owned(),
        relation,
        fails_without_adversary: Some(0.0),
        reachable: Some(rows[0].success_rate),
        union: Some(0.0),
        rows,
    }
}

fn of<'a>(all: &'a [Summary], relation: Relation, ado: &str) -> &'a Summary {
    let mut found = all
        .iter()
        .filter(|s| s.relation == relation && s.ado == ado.into());
    found.next().expect("a summary")
}

/// Ten starts each. Two trainings of one ado, and a rival.
///
/// | ego | reachable | trainings solve | recall | rival |
/// | --- | --- | --- | --- | --- |
/// | near | 50 % | 4 and 2, all of them reachable | 4/5 and 2/5 | 1 |
/// | wet | 10 % | 3 and 0, of the reachable 1 and 0 | 1 and 0 | 0 |
/// | hard | 0 % | 1 and 1 | none | 2 |
#[test]
fn means_recalls_and_differences_are_those_on_paper() {
    let egos = [
        ego(
            "near",
            Relation::Inside,
            "1111100000",
            &[
                ("trained", "1111000000"),
                ("trained", "1100000000"),
                ("rival", "0000000001"),
            ],
        ),
        ego(
            "wet",
            Relation::Inside,
            "1000000000",
            &[
                ("trained", "1110000000"),
                ("trained", "0000000000"),
                ("rival", "0000000000"),
            ],
        ),
        ego(
            "hard",
            Relation::Outside,
            "0000000000",
            &[
                ("trained", "1000000000"),
                ("trained", "0000000001"),
                ("rival", "1100000000"),
            ],
        ),
    ];
    assert_eq!(LEAST_REACHABLE, 0.1);
    let all = summarise(&egos, &AdversaryId::Trained);
    let inside = of(&all, Relation::Inside, "trained");
    assert_eq!((inside.egos, inside.egos_with_recall), (2, 2));
    near(inside.success_rate, (0.4 + 0.2 + 0.3 + 0.0) / 4.0);
    // Per ego the mean of its trainings: 0.6 and 0.5.
    near(inside.recall_mean.expect("recall"), 0.55);
    let (least, on) = inside.recall_min.clone().expect("recall");
    near(least, 0.5);
    assert_eq!(on, "wet");
    assert!(inside.reference_minus.is_none(), "not with itself");
    near(inside.sims_per_start, 1.0);
    let searched = of(&all, Relation::Inside, "search");
    near(searched.sims_per_start, 50.0);
    near(searched.success_rate, 0.3);
    // The rival: 0.3 − 0.1 and 0.15 − 0 less than the trainings.
    let rival = of(&all, Relation::Inside, "rival");
    let (minus, [lo, hi]) = rival.reference_minus.expect("compared");
    near(minus, (0.2 + 0.15) / 2.0);
    assert!(lo < minus && minus < hi);
    near(rival.recall_mean.expect("recall"), 0.0);
    let outside = of(&all, Relation::Outside, "trained");
    assert_eq!((outside.egos, outside.egos_with_recall), (1, 0));
    assert_eq!(
        (outside.recall_mean, outside.recall_min.clone()),
        (None, None)
    );
    let rival = of(&all, Relation::Outside, "rival");
    let solved = ["1000000000", "0000000001", "1100000000"];
    let [one, other, rival_solved] = &solved.map(|marks| marks.parse().expect("marks"));
    let expected = paired_difference(&[one, other], &[rival_solved]);
    assert_eq!(rival.reference_minus, Some(expected));
    near(expected.0, -0.1);
    // All changed egos together.
    let changed = of(&all, Relation::Changed, "trained");
    assert_eq!((changed.egos, changed.egos_with_recall), (3, 2));
    near(
        changed.success_rate,
        (0.4 + 0.2 + 0.3 + 0.0 + 0.1 + 0.1) / 6.0,
    );
    let blocks: Vec<Relation> = all.iter().map(|s| s.relation).collect();
    assert!(!blocks.contains(&Relation::Trained));
    // One block of changed egos is all of them already.
    let one = summarise(&egos[..2], &AdversaryId::Trained);
    assert!(one.iter().all(|s| s.relation == Relation::Inside));
}

/// An ego that never ran says nothing about an ado, although its rows have a rate of 0.
#[test]
fn egos_without_a_valid_start_are_in_no_mean() {
    let near_by = ("near", "1100000000", "1111000000");
    let broken = ("broken", "1100000000", "xxxxxxxxxx");
    let egos = [near_by, broken]
        .map(|(name, search, solved)| ego(name, Relation::Inside, search, &[("trained", solved)]));
    assert_eq!(egos[1].rows[1].starts, 0);
    let all = summarise(&egos, &AdversaryId::Trained);
    let inside = of(&all, Relation::Inside, "trained");
    assert_eq!((inside.egos, inside.egos_with_recall), (1, 1));
    near(inside.success_rate, 0.4);
    near(inside.recall_mean.expect("recall"), 1.0);
    let none = summarise(&egos[1..], &AdversaryId::Trained);
    assert_eq!(of(&none, Relation::Inside, "trained").egos, 0);
}

/// A row in which everything that a table prints of its adversary is reworded.
fn reworded(row: &Row) -> Row {
    let mut keys = serde_json::to_value(row).expect("JSON");
    assert!(keys["adversary"].is_object(), "{keys}");
    keys["ado"] = "an ado".into();
    keys["method"] = "some method".into();
    serde_json::from_value(keys).expect("a row")
}

#[test]
fn other_captions_change_no_result() {
    let mut egos = [ego(
        "near",
        Relation::Inside,
        "11100",
        &[("trained", "11000"), ("hold", "00001"), ("rival", "10000")],
    )];
    let before = serde_json::to_value(summarise(&egos, &AdversaryId::Trained)).expect("JSON");
    let starts = starts();
    let own = EgoUnderTest::nominal(&chase());
    let all = |rows| reused_on(&own, Relation::Trained, &starts, rows, &quiet()).reachable;
    let rows = egos[0].rows.clone();
    egos[0].rows = rows.iter().map(reworded).collect();
    let after = serde_json::to_value(summarise(&egos, &AdversaryId::Trained)).expect("JSON");
    assert_eq!(before, after);
    assert_eq!(all(egos[0].rows.clone()), Some(0.6));
    assert_eq!(all(rows), Some(0.6));
}

/// The ego fails by itself below 14 m: two of the eighteen, whatever is left out.
/// An ego at 12 m/s gets 4 m nearer, and fails below 18 m: six.
#[test]
fn an_ego_is_asked_what_it_does_without_an_adversary_on_every_start() {
    let starts = starts();
    let rows = |ego: &EgoUnderTest| -> Vec<Row> {
        let mut rows = Vec::new();
        for action in [2, 4] {
            let request = ego.against(Ado::Constant(action), &starts);
            let mut row = eval(&request, &quiet()).row;
            row.ado = if action == 2 { "search" } else { "trained" }.into();
            rows.push(row);
        }
        rows
    };
    let nominal = EgoUnderTest::nominal(&chase());
    let trained = |rows| reused_on(&nominal, Relation::Trained, &starts, rows, &quiet());
    let reused = trained(rows(&nominal));
    near(
        reused.fails_without_adversary.expect("whole"),
        2.0 / HEADWAYS_M.len() as f64,
    );
    // −1 solves nine of sixteen, and −3 no other.
    assert_eq!(reused.reachable, Some(9.0 / 16.0));
    near(reused.union.expect("whole"), 9.0 / 16.0);
    let faster = EgoUnderTest::nominal(&altered(&[("speed_mps: 11.0", "speed_mps: 12.0")]));
    let changed = rows(&faster);
    let reused = reused_on(&faster, Relation::Outside, &starts, changed, &quiet());
    near(
        reused.fails_without_adversary.expect("whole"),
        6.0 / HEADWAYS_M.len() as f64,
    );
    // What either solves counts once: of four starts the first three, of which two alone.
    let ado = |solved: &str| row("trained", solved);
    let rows = vec![row("other", "t110-"), ado("t011x")];
    let reused = trained(rows);
    near(reused.union.expect("whole"), 3.0 / 3.0);
    assert_eq!(reused.reachable, None, "nobody searched");
}
