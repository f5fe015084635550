//! Worlds in which some violations are no counterexamples.

use brakecheck::ego::ReferenceDriver;
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Side;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, Episode, HeldRandom, play};
use brakecheck::world::Scenario;
use brakecheck_scene::testbench::actors::HOLD_DECISIONS;

const ISO: &str = include_str!("../../worlds/acc_iso.ron");
const OF_ISO: &str = "counts: Preventable(by: [RSS], closing_mps: 3.0)";

/// `acc_iso.ron` on the kinematic plant, counting something else.
fn counting(counts: &str) -> Scenario {
    assert!(ISO.contains(OF_ISO), "acc_iso counts otherwise");
    let text = ISO
        .replace(OF_ISO, counts)
        .replace("plant: Rigid,", "plant: Kinematic,");
    Scenario::parse("acc_iso.ron", &text).unwrap_or_else(|error| panic!("{error}"))
}

/// Held-random episodes from calibration starts.
fn episodes(world: &Scenario, count: u64) -> Vec<Episode> {
    let mut bench = world.bench();
    let played = (0..count).map(|index| {
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed: 1,
            index,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        let mut held = HeldRandom::new(bench.spaces().actions, HOLD_DECISIONS);
        play(&mut bench, &start, noise, &mut held, Aftermath::Play)
    });
    played.collect()
}

fn closing_mps(episode: &Episode) -> f64 {
    let contact = episode.contact.as_ref();
    contact.map_or(0.0, |touch| touch.closing_speed_mps)
}

#[test]
fn a_contact_counts_from_its_closing_speed_on_and_nothing_else_changes() {
    let all = episodes(&counting("counts: Violation"), 60);
    let hard = episodes(&counting("counts: Contact(closing_mps: 6.0)"), 60);
    let (mut counted, mut uncounted) = (0, 0);
    for (any, hard) in all.iter().zip(&hard) {
        assert_eq!(any.trace, hard.trace);
        match (any.verdict, hard.verdict) {
            (Verdict::Counterexample { by }, Verdict::Counterexample { by: same }) => {
                assert!(by == same && closing_mps(hard) >= 6.0);
                counted += 1;
            }
            (Verdict::Counterexample { by }, Verdict::Uncounted { by: same }) => {
                assert!(by == same && closing_mps(hard) < 6.0);
                uncounted += 1;
            }
            (any, hard) => assert_eq!(any, hard),
        }
    }
    assert!(counted > 0 && uncounted > 0, "{counted} {uncounted}");
}

#[test]
fn preventable_is_what_the_replay_says() {
    let by = [ReferenceDriver::Cc];
    let world = counting("counts: Preventable(by: [CC])");
    let (mut counted, mut uncounted) = (0, 0);
    for episode in episodes(&world, 150) {
        if episode.contact.is_none() || matches!(episode.verdict, Verdict::Foul { .. }) {
            assert!(!episode.verdict.is_success());
            continue;
        }
        let said = world.preventability(&episode);
        let avoided = by.iter().any(|driver| said.is_avoided_by(*driver));
        assert_eq!(episode.verdict.is_success(), avoided, "{said}");
        counted += usize::from(avoided);
        uncounted += usize::from(!avoided);
    }
    assert!(counted > 0 && uncounted > 0, "{counted} {uncounted}");
}

/// A car behind that does not brake: the ego is struck, and is not asked.
#[test]
fn an_ego_that_is_struck_from_behind_is_not_counted() {
    let text = ISO
        .replace(OF_ISO, "counts: Contact(closing_mps: 0.0)")
        .replace("plant: Rigid,", "plant: Kinematic,")
        .replace("headway_m: (31.5, 60.0)", "headway_m: (-40.0, -15.0)")
        .replace("[-6.0, 0.0, 2.0]", "[-6.0, 0.0, 4.0]");
    let world = Scenario::parse("behind.ron", &text).unwrap_or_else(|error| panic!("{error}"));
    let mut struck = 0;
    for episode in episodes(&world, 60) {
        let impact = episode.contact.as_ref().and_then(|touch| touch.impact);
        if let Some(impact) = impact {
            assert_eq!(impact.ego_side, Side::Rear);
            assert!(!episode.verdict.is_success(), "{:?}", episode.verdict);
            struck += usize::from(matches!(episode.verdict, Verdict::Uncounted { .. }));
        }
    }
    assert!(struck > 0);
}

/// Forks share a past, whatever has to be remembered of it for counting.
#[test]
fn a_copy_of_the_bench_counts_as_the_original_does() {
    let world = counting("counts: Preventable(by: [RSS])");
    let mut counted = 0;
    for episode in episodes(&world, 40) {
        let mut bench = world.bench();
        bench.begin(&episode.start, episode.noise, Aftermath::Skip);
        for &action in &episode.actions {
            let mut copy = bench.fork().expect("a stock ego");
            copy.decide(action);
            bench = copy;
        }
        assert_eq!(bench.verdict(), Some(episode.verdict));
        counted += usize::from(episode.verdict.is_success());
    }
    assert!(counted > 0);
}

/// A cut-out: the car ahead leaves the lane, and the ego hits who stands there,
/// whom no ado drives.
#[test]
fn a_contact_with_somebody_whom_no_ado_drives_counts() {
    let text = include_str!("../../worlds/r157/cut_out.ron").replace(
        "judge: UntilContact,",
        "judge: UntilContact, counts: Contact(closing_mps: 2.0),",
    );
    let world = Scenario::parse("cut_out.ron", &text).expect("a world");
    let coasting = world.with(&world.reuse()["coasts"]).expect("an ego");
    let mut bench = coasting.bench();
    let start = bench.draw(StartKey {
        purpose: Purpose::Test,
        seed: 0,
        index: 0,
    });
    let mut neutral = Constant(bench.spaces().neutral);
    let episode = play(&mut bench, &start, 0, &mut neutral, Aftermath::Skip);
    let touch = episode.contact.as_ref().expect("a contact");
    assert_eq!(
        touch.between,
        ("ego".to_owned(), "target_blocking".to_owned())
    );
    assert!(episode.verdict.is_success(), "{:?}", episode.verdict);
}
