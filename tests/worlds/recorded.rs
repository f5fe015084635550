//! Worlds from recordings: played without an action, they repeat the recording.

use std::collections::BTreeMap;

use brakecheck::rulebook::Verdict;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;
use brakecheck_traffic::{
    Analysis, ColumnMap, RecordedWorld, RecordedWorlds, SituationKind, SituationPlan, read_csv,
};

#[path = "../../crates/traffic/tests/traffic/synthetic.rs"]
mod synthetic;

use synthetic::Row;

/// Simulated rows per road user, by sample from the first row.
type Truth = BTreeMap<(String, usize), Row>;

fn recording(seed: u64, seconds: f64) -> (Analysis, Truth) {
    let (rows, _) = synthetic::traffic(seed, 25, seconds);
    let map = ColumnMap::shipped("dlr").expect("shipped");
    // Recorded speeds are 0.3 % off, so that integrated ones would miss the positions.
    let text = synthetic::dlr(&rows, 1.003);
    let recording = read_csv(text.as_bytes(), "tracks.csv", &map).expect("valid rows");
    let first = rows.first().map_or(0, |row| row.sample);
    let truth = rows.into_iter().map(|row| {
        let id = (1_728_280_701_000_000 + row.id).to_string();
        ((id, row.sample - first), row)
    });
    (Analysis::of(recording), truth.collect())
}

fn parsed(world: &RecordedWorld) -> Scenario {
    let scenario = Scenario::parse("recorded.ron", &world.text).unwrap_or_else(|error| {
        let problem = &error.problems[0];
        panic!("{}; {:?}\n{}", problem.what, problem.help, world.text)
    });
    let warnings: Vec<&str> = scenario.warnings().iter().map(|it| &*it.what).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
    scenario
}

/// Plays every situation of a world with the neutral action.
fn replays(world: &RecordedWorld, neutral: usize) -> Vec<Episode> {
    let scenario = parsed(world);
    let starts = scenario.starts().expect("a table of starts");
    assert_eq!(starts.len(), world.situations.len());
    let episodes = starts.iter().map(|start| {
        let mut bench = scenario.bench();
        play(
            &mut bench,
            start,
            0,
            &mut Constant(neutral),
            Aftermath::Play,
        )
    });
    episodes.collect()
}

fn column<'a>(episode: &'a Episode, name: &str) -> &'a [f64] {
    let values = episode.trace.signal(name);
    values.unwrap_or_else(|| panic!("{name} is not published"))
}

/// Simulated rows of a situation's road user, from its start on.
fn rows<'a>(truth: &'a Truth, situation: &SituationPlan) -> Vec<&'a Row> {
    let start = (situation.time_s / synthetic::DT_S).round() as usize;
    let rows = (0..=200).map_while(|i| truth.get(&(situation.planned.clone(), start + i)));
    rows.collect()
}

/// Distances along the road since the start: the way without its part across.
fn ways_m(rows: &[&Row]) -> Vec<f64> {
    let mut way_m = 0.0;
    let steps = rows.windows(2).map(|pair| {
        let (dx, dy) = (pair[1].x_m - pair[0].x_m, pair[1].y_m - pair[0].y_m);
        let across = pair[1].lateral_m - pair[0].lateral_m;
        way_m += (dx * dx + dy * dy - across * across).sqrt();
        way_m
    });
    std::iter::once(0.0).chain(steps).collect()
}

/// Greatest distance of an episode's road user from its recording, along the road.
fn worst_m(episode: &Episode, name: &str, rows: &[&Row]) -> f64 {
    let s_m = column(episode, name);
    assert!(190 < s_m.len(), "{} samples", s_m.len());
    let ways = ways_m(rows);
    // The plan's first position is fitted, as all others are.
    let offs: Vec<f64> = s_m
        .iter()
        .zip(&ways)
        .map(|(s, way)| s - s_m[0] - way)
        .collect();
    let least = offs.iter().copied().fold(f64::INFINITY, f64::min);
    let most = offs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    0.5 * (most - least)
}

#[test]
fn a_lead_without_an_action_stays_within_a_decimetre_of_its_recording() {
    let (analysis, truth) = recording(21, 60.0);
    let recorded = RecordedWorlds::of("follow", SituationKind::Following, &[analysis], 24);
    assert_eq!(recorded.situations().count(), 24);
    for world in &recorded.worlds {
        for (episode, situation) in replays(world, 1).iter().zip(&world.situations) {
            let rows = rows(&truth, situation);
            let worst = worst_m(episode, "lead.s", &rows);
            assert!(worst < 0.1, "{} is {worst} m off", situation.planned);
            // The start is the recorded one, from bumper to bumper.
            let own = &truth[&(
                situation.replaced.clone(),
                (situation.time_s / 0.05).round() as usize,
            )];
            let gap_m = rows[0].front_m - rows[0].length_m - own.front_m;
            let start_m = column(episode, "ego.lead.gap")[0];
            assert!(
                (start_m - gap_m).abs() < 0.2 + 0.006 * gap_m,
                "{start_m} {gap_m}"
            );
        }
    }
}

#[test]
fn a_cut_in_without_an_action_is_the_recorded_one_along_and_across() {
    let (analysis, truth) = recording(3, 90.0);
    let recorded = RecordedWorlds::of("cut", SituationKind::CutIn, &[analysis], 24);
    assert!(10 <= recorded.situations().count());
    for world in &recorded.worlds {
        for (episode, situation) in replays(world, 4).iter().zip(&world.situations) {
            let rows = rows(&truth, situation);
            let worst = worst_m(episode, "ado.s", &rows);
            assert!(worst < 0.1, "{} is {worst} m off along", situation.planned);
            // Rear bumpers agree, so the recorded centre is half a length ahead of them.
            let behind_m = situation.body.length_m - 0.5 * rows[0].length_m;
            let lateral = column(episode, "ado.lateral").iter();
            let lateral = lateral.zip(column(episode, "ado.heading"));
            let across = lateral.zip(&rows).map(|((lateral, heading), row)| {
                (lateral - behind_m * heading.sin() - row.lateral_m).abs()
            });
            let across = across.fold(0.0, f64::max);
            assert!(
                across < 0.1,
                "{} is {across} m off across",
                situation.planned
            );
        }
    }
}

#[test]
fn the_ado_may_stray_only_as_far_as_its_rules_allow() {
    let (analysis, _) = recording(3, 90.0);
    let recorded = RecordedWorlds::of("cut", SituationKind::CutIn, &[analysis], 24);
    let world = &recorded.worlds[0];
    let scenario = parsed(world);
    // Braking by 1 m/s² for 10 s is 50 m, and the rule allows 20.
    for episode in replays(world, 3) {
        let Verdict::Foul { rule, .. } = &episode.verdict else {
            panic!("{:?}", episode.verdict);
        };
        assert_eq!(scenario.rules()[*rule].name, "stays near its recording");
    }
}
