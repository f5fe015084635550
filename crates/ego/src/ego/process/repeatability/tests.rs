//! Egos that keep state, draw, read clocks or are sound, and what the check finds.

use std::sync::atomic::{AtomicU64, Ordering};

use super::super::transcript::Recorder;
use super::*;
use crate::ego::{FaultKind, Percept, Seen};

/// Pauses that a test can afford.
const SHORT: Pauses = Pauses {
    sum: Duration::from_millis(60),
    long: Duration::from_millis(30),
};
/// Samples of an episode.
const SAMPLES: usize = 20;

/// A follower with a way to depend on more than its episode.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Sound,
    Seeded,
    Latch,
    LimpsAfterNearMiss,
    LearnsGap,
    Mean,
    EverySecond,
    EveryThird,
    TiresAfter(u64),
    CountsSteps(u64),
    ColdStart,
    SharedGenerator,
    File,
    Random,
    Coin,
    Clock,
    Stale,
}

/// State outside every ego, such as a file.
static FILE: AtomicU64 = AtomicU64::new(0);
static DRAWS: AtomicU64 = AtomicU64::new(1);

fn splitmix(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Draws without a seed, from 0 to 1.
fn drawn() -> f64 {
    let draw = DRAWS.fetch_add(1, Ordering::Relaxed);
    (splitmix(draw) >> 11) as f64 / (1u64 << 53) as f64
}

struct Double {
    kind: Kind,
    episodes: u64,
    steps: u64,
    in_episode: u64,
    latched: bool,
    near: Option<u64>,
    mean: f64,
    state: u64,
    file: u64,
    coin: bool,
    last: Option<Instant>,
    integral: f64,
}

impl Double {
    fn of(kind: Kind) -> Double {
        Double {
            kind,
            episodes: 0,
            steps: 0,
            in_episode: 0,
            latched: false,
            near: None,
            mean: 0.0,
            state: 1,
            file: 0,
            coin: false,
            last: None,
            integral: 0.0,
        }
    }
}

impl Controller for Double {
    fn reset(&mut self, seed: u64) {
        self.episodes += 1;
        self.in_episode = 0;
        self.integral = 0.0;
        self.last = None;
        match self.kind {
            Kind::Seeded => self.state = seed,
            Kind::File => self.file = FILE.fetch_add(1, Ordering::Relaxed),
            Kind::Coin => self.coin = drawn() < 0.5,
            _ => {}
        }
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        self.steps += 1;
        self.in_episode += 1;
        let lead = &percept.others[0];
        let gap_m = lead.headway_m - lead.length_m;
        let mut wish = 0.2 * (gap_m - 10.0);
        let now = Instant::now();
        let elapsed_s = self.last.map_or(0.0, |last| (now - last).as_secs_f64());
        self.last = Some(now);
        match self.kind {
            Kind::Sound => {}
            Kind::Seeded | Kind::SharedGenerator => {
                self.state = splitmix(self.state);
                wish += (self.state % 1000) as f64 / 1000.0;
            }
            Kind::Latch => {
                self.latched |= gap_m < 1.0;
                if self.latched {
                    wish = -7.0;
                }
            }
            Kind::LimpsAfterNearMiss => {
                if gap_m < 1.0 {
                    self.near = Some(self.episodes);
                }
                // For the next three episodes only.
                if self
                    .near
                    .is_some_and(|near| (1..=3).contains(&(self.episodes - near)))
                {
                    wish = wish.min(0.0);
                }
            }
            Kind::LearnsGap => {
                self.mean += 0.001;
                wish -= self.mean;
            }
            Kind::Mean => {
                self.mean = 0.9 * self.mean + 0.1 * wish;
                wish = self.mean;
            }
            Kind::EverySecond if self.episodes.is_multiple_of(2) => wish -= 0.4,
            Kind::EveryThird if self.episodes.is_multiple_of(3) => wish -= 0.4,
            Kind::TiresAfter(most) if most < self.episodes => wish *= 0.2,
            Kind::CountsSteps(most) if most < self.steps => wish *= 0.2,
            Kind::ColdStart if self.episodes == 1 && self.in_episode < 5 => wish = 0.0,
            Kind::EverySecond
            | Kind::EveryThird
            | Kind::TiresAfter(_)
            | Kind::CountsSteps(_)
            | Kind::ColdStart => {}
            Kind::File => wish += 0.01 * self.file as f64,
            Kind::Random => wish += drawn(),
            Kind::Coin => wish += if self.coin { 0.1 } else { -0.1 },
            Kind::Clock => {
                self.integral += elapsed_s;
                wish += 10.0 * self.integral;
            }
            Kind::Stale => {
                if elapsed_s > 0.02 {
                    wish = -5.0;
                }
            }
        }
        Ok(Command::accelerate(wish))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

/// Plays episodes of which every fifth has a near miss.
fn play(ego: &mut dyn Controller, episodes: std::ops::Range<u64>) {
    for episode in episodes {
        ego.reset(splitmix(episode));
        for sample in 0..SAMPLES {
            let nearest_m = if episode % 5 == 3 { 0.5 } else { 8.0 };
            let away = (sample as f64 - 12.0).abs();
            let lead = Seen {
                headway_m: 4.5 + nearest_m + away + 0.01 * episode as f64,
                length_m: 4.5,
                width_m: 1.8,
                ..Seen::default()
            };
            let percept = Percept {
                time_s: 0.1 * sample as f64,
                others: vec![lead],
                ..Percept::default()
            };
            ego.control(&percept).expect("it answers");
        }
        ego.finish();
    }
}

fn found(kind: Kind, episodes: u64) -> Option<Unrepeatable> {
    let make = || Box::new(Double::of(kind)) as Box<dyn Controller>;
    let log = Transcripts::default();
    let mut used = Recorder::new(make(), &log);
    play(&mut used, 0..episodes);
    let check = log.check_by(&make, SHORT);
    assert_eq!(check.failed, None, "{kind:?}");
    check.found
}

#[test]
fn every_way_to_depend_on_more_than_an_episode_is_found_and_named() {
    let kept = Some(Cause::KeptState);
    let cases = [
        (Kind::Sound, None),
        (Kind::Seeded, None),
        (Kind::Latch, kept),
        (Kind::LimpsAfterNearMiss, kept),
        (Kind::LearnsGap, kept),
        (Kind::Mean, kept),
        (Kind::EverySecond, kept),
        (Kind::EveryThird, kept),
        (Kind::TiresAfter(6), kept),
        (Kind::TiresAfter(35), kept),
        (Kind::CountsSteps(500), kept),
        (Kind::ColdStart, kept),
        (Kind::SharedGenerator, kept),
        (Kind::Random, Some(Cause::Random)),
        (Kind::Coin, Some(Cause::Random)),
        (Kind::Clock, Some(Cause::Clock)),
    ];
    for (kind, cause) in cases {
        // The few episodes that every check plays again are enough.
        let found = found(kind, 40);
        let is = found.as_ref().map(|found| found.cause);
        // A coin may fall alike in all fresh egos.
        let is_coin = kind == Kind::Coin && is.is_some();
        assert!(is == cause || is_coin, "{kind:?}: {found:?}");
    }
}

#[test]
fn state_in_a_file_is_told_from_state_in_the_ego() {
    let found = found(Kind::File, 12).expect("found");
    // Each fresh ego changes the file, so it may look random as well.
    assert!(matches!(found.cause, Cause::KeptOutside | Cause::Random));
}

#[test]
fn an_ego_that_notices_a_silence_is_found_once_it_is_asked_slowly() {
    let make = || Box::new(Double::of(Kind::Stale)) as Box<dyn Controller>;
    let log = Transcripts::default();
    let mut used = Recorder::new(make(), &log);
    play(&mut used, 0..1);
    let sample = log.lock().take_sample();
    let quick = sample[0].replay(&mut *make(), Pace::Quick).expect("it");
    assert_eq!(first_difference(&sample[0].commands(), &quick), None);
    let found = diagnosis(&sample[0], quick, &make, SHORT).expect("found");
    assert_eq!(found.cause, Cause::Clock);
}

#[test]
fn the_message_names_the_ego_the_place_both_commands_and_the_fix() {
    let fault = found(Kind::TiresAfter(6), 12)
        .expect("found")
        .fault("mine", Some(3));
    assert_eq!(fault.kind, FaultKind::KeptState);
    for part in [
        "`mine` keeps state",
        "at 0.00 s of start 3",
        "m/s²",
        "clear your state at `reset`",
    ] {
        assert!(fault.message.contains(part), "{part}: {}", fault.message);
    }
    let fault = found(Kind::Random, 12).expect("found").fault("mine", None);
    assert!(fault.message.contains("`repeats: 5`"), "{}", fault.message);
}

#[test]
fn later_checks_keep_to_their_share_and_keep_what_they_found() {
    let make = || Box::new(Double::of(Kind::TiresAfter(60))) as Box<dyn Controller>;
    let log = Transcripts::default();
    let mut used = Recorder::new(make(), &log);
    play(&mut used, 0..50);
    assert_eq!(log.check_by(&make, SHORT).found, None);
    let first = log.compared();
    assert!(first >= LEAST as u64);
    // Nothing was played since, so there is nothing to compare.
    log.lock().began = Instant::now().checked_sub(Duration::from_secs(3600));
    play(&mut used, 50..80);
    let found = log.check_by(&make, SHORT).found.expect("it tires");
    assert!(log.compared() > first);
    play(&mut used, 80..81);
    assert_eq!(log.check_by(&make, SHORT).found, Some(found));
}

#[test]
fn a_copy_and_an_episode_with_a_fault_leave_no_transcript() {
    struct Failing;
    impl Controller for Failing {
        fn reset(&mut self, _: u64) {}
        fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
            if percept.time_s > 0.5 {
                return Err(Fault::error("lost"));
            }
            Ok(Command::default())
        }
        fn fork(&self) -> Option<Box<dyn Controller>> {
            Some(Box::new(Failing))
        }
    }
    let log = Transcripts::default();
    let mut used = Recorder::new(Box::new(Failing), &log);
    used.reset(1);
    used.control(&Percept::default()).expect("it answers");
    let mut copy = used.fork().expect("a copy");
    copy.control(&Percept::default()).expect("it answers");
    copy.finish();
    let late = Percept {
        time_s: 1.0,
        ..Percept::default()
    };
    used.control(&late).expect_err("lost");
    used.finish();
    assert_eq!(log.lock().take_sample().len(), 0);
}

#[test]
fn every_episode_of_a_fresh_ego_has_an_ego_of_its_own() {
    let log = Transcripts::default();
    let make: super::super::transcript::Maker =
        Arc::new(|| Box::new(Double::of(Kind::TiresAfter(1))) as Box<dyn Controller>);
    let mut used = Recorder::new(make(), &log).anew(Arc::clone(&make));
    play(&mut used, 0..10);
    assert_eq!(log.check_by(&*make, SHORT).found, None);
}
