//! Gaps that are planted in three worlds, and nothing else.

use super::{Coverage, EpisodeOrigin, RULED_EPISODES, observed, tries_of};
use crate::adversary::Ado;
use crate::experiment::{EgoUnderTest, Watch, test_starts};
use crate::search::{Adversary, Search};
use crate::world::Scenario;

/// Starts that are tried.
const STARTS: usize = 150;

/// A world on the fast plant, with some texts replaced.
fn planted(text: &str, changes: &[(&str, &str)]) -> Scenario {
    let mut changed = text.replace("plant: Rigid", "plant: Kinematic");
    for (from, to) in changes {
        assert!(changed.contains(from), "{from}");
        changed = changed.replacen(from, to, 1);
    }
    Scenario::parse("planted.ron", &changed).expect("a world")
}

/// Coverage by two tries per start: held-random actions, and a search with one switch.
fn covered(world: &Scenario) -> Coverage {
    let watch = Watch::unwatched();
    let starts = test_starts(world, 3, STARTS, &watch).expect("starts");
    let ego = EgoUnderTest::nominal(world);
    let held = tries_of(&ego, Ado::Hold, &starts, RULED_EPISODES, &watch).expect("played");
    let search = Search::switches(1)
        .play(&ego, &starts, &watch)
        .expect("searched");
    let open: Vec<usize> = (0..STARTS).filter(|at| !starts.trivial[*at]).collect();
    let searched = observed(
        world,
        &open,
        EpisodeOrigin::Drawn,
        RULED_EPISODES,
        &watch,
        // Without a success, the first action is played throughout.
        |bench, start, _| Some(search.replay(bench, *start)),
    );
    Coverage::of(world, &[held, searched.expect("played")].concat())
}

const ACC: &str = include_str!("../../../../worlds/acc.ron");
const CUT_IN: &str = include_str!("../../../../worlds/cut_in.ron");
const ACC_ISO: &str = include_str!("../../../../worlds/acc_iso.ron");

/// Expects these gaps, in any order, and nothing else.
#[track_caller]
fn expect(world: &Scenario, gaps: &[&str]) {
    let coverage = covered(world);
    let mut found = coverage.gaps.clone();
    found.retain(|gap| !gaps.iter().any(|expected| gap.contains(expected)));
    assert!(found.is_empty(), "false: {found:?}");
    for expected in gaps {
        let is_named = coverage.gaps.iter().any(|gap| gap.contains(expected));
        assert!(is_named, "{expected}: {:#?}", coverage);
    }
}

#[test]
fn a_lead_car_has_a_dead_rule_a_dead_part_and_starts_that_never_fail() {
    expect(&planted(ACC, &[]), &[]);
    let limit = r#"Rule(name: "keeps the speed limit","#;
    let rules = format!(
        r#"Rule(name: "planted", stl: "always (ado.accel >= -9)"),
        Rule(name: "far", stl: "headway <= 47 or always (ado.accel >= -0.1)"), {limit}"#
    );
    let world = planted(
        ACC,
        &[
            (limit, &rules),
            (
                "(headway >= d_safe)",
                "(headway >= d_safe and ego.speed <= 200)",
            ),
        ],
    );
    expect(
        &world,
        &[
            "rule “planted” never bounds `ado`",
            "`ego.speed <= 200` never decides a failure",
            "from `ado.headway` 47–60 m",
        ],
    );
}

#[test]
fn a_cut_in_has_a_dead_rule_a_dead_part_and_starts_that_never_fail() {
    expect(&planted(CUT_IN, &[]), &[]);
    let stop = r#"Rule(name: "does not stop","#;
    let rules = format!(
        r#"Rule(name: "planted", stl: "always (ado.accel >= -9)"),
        Rule(name: "far", stl: "d_long <= 47.5 or always (d_lat >= 2.6)"), {stop}"#
    );
    let world = planted(
        CUT_IN,
        &[
            (stop, &rules),
            (
                "(ego.ado.gap >= 0.2)",
                "(ego.ado.gap >= 0.2 and ego.accel <= 9)",
            ),
        ],
    );
    expect(
        &world,
        &[
            "rule “planted” never bounds `ado`",
            "`ego.accel <= 9` never decides a failure",
            "from `ado.headway` 47.5–60 m",
        ],
    );
}

#[test]
fn a_lead_car_by_the_book_has_a_dead_rule_a_dead_disjunct_and_starts_that_never_fail() {
    // The shipped rule forbids more braking than any action has.
    let dead = "rule “brakes no harder than must be expected” never bounds `ado`";
    expect(&planted(ACC_ISO, &[]), &[dead]);
    let limit = r#"Rule(name: "keeps the speed limit","#;
    let rules = format!(
        r#"Rule(name: "far", stl: "headway <= 52.875 or always (ado.accel >= -0.1)"), {limit}"#
    );
    let world = planted(
        ACC_ISO,
        &[
            (limit, &rules),
            (
                "(ego.ado.gap >= 0.2)",
                "(ego.ado.gap >= 0.2 or ego.speed <= -50)",
            ),
        ],
    );
    expect(
        &world,
        &[
            dead,
            "`ego.speed <= -50` never decides a failure",
            "from `ado.headway` 52.875–60 m",
        ],
    );
}
