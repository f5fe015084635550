//! World files: refused with a place and a reason, or playable.

use brakecheck::cli::{Failure, plain_theme};
use brakecheck::crashes::SavedCounterexample;
use brakecheck::rulebook::Verdict;
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::Scratch;
use brakecheck::testbench::{Actor, Aftermath, Episode, play};
use brakecheck::world::{Change, Scenario, ScenarioError};
use brakecheck_crashes::crashes::replay::replay;

use super::corpus;
use super::harness::{Seen, Target};
use super::mutate::{extremes, misspelt, mutants, without_a_number};

/// Physics steps that are spent on a world at most.
const AFFORDABLE: u64 = 30_000;

#[test]
fn any_world_file_is_refused_with_a_place_or_plays_and_replays() {
    let dir = tempfile::tempdir().expect("a directory");
    let target = Target {
        name: "world",
        cases: 80,
        shrinks: 100,
        least_percent: (20, 20),
    };
    target.run(
        &mutants(corpus::worlds().into()),
        |mutant| match Scenario::parse("mutant.ron", &mutant.text) {
            Err(error) => refused(&error, &mutant.text),
            Ok(world) => accepted(&world, &mutant.text, dir.path()),
        },
    );
}

#[test]
fn every_number_and_list_of_a_world_may_be_extreme() {
    let dir = tempfile::tempdir().expect("a directory");
    for name in ["acc_plain.ron", "grid.ron"] {
        let path = corpus::root().join("worlds").join(name);
        let good = std::fs::read_to_string(path).expect("a world");
        let (mut accepted, mut refused) = (0, 0);
        for text in extremes(&good, &[-1.0, 3000.0]) {
            let seen = match Scenario::parse("extreme.ron", &text) {
                Err(error) => self::refused(&error, &text),
                Ok(world) => self::accepted(&world, &text, dir.path()),
            };
            match seen {
                Seen::Accepted => accepted += 1,
                Seen::Refused => refused += 1,
            }
        }
        assert!(
            accepted > 10 && refused > 10,
            "{name}: {accepted} and {refused}"
        );
    }
}

#[test]
fn no_number_of_a_world_may_be_none() {
    let dir = tempfile::tempdir().expect("a directory");
    for name in ["merge_plain.ron", "grid.ron"] {
        let path = corpus::root().join("worlds").join(name);
        let good = std::fs::read_to_string(path).expect("a world");
        // Formulas and questions are texts: what is none in them is a word.
        let head = good.find("    signals:").or(good.find("    ego_spec:"));
        let (head, rest) = good.split_at(head.expect("formulas"));
        let begin = head.find("    clock:").or(head.find("    map:"));
        let (begin, head) = head.split_at(begin.expect("numbers"));
        for text in without_a_number(head) {
            let text = format!("{begin}{text}{rest}");
            match Scenario::parse("none.ron", &text) {
                Err(error) => refused(&error, &text),
                Ok(world) => accepted(&world, &text, dir.path()),
            };
        }
    }
}

#[test]
fn any_misspelt_field_is_underlined() {
    let target = Target {
        name: "misspelt",
        cases: 1000,
        shrinks: 500,
        least_percent: (0, 100),
    };
    let good = corpus::worlds();
    target.run(&misspelt(good.into()), |(wrong, text)| {
        let error = Scenario::parse("misspelt.ron", text).expect_err(wrong);
        for problem in &error.problems {
            if problem
                .what
                .starts_with(&format!("unknown field `{wrong}`"))
            {
                assert_eq!(&text[problem.span.clone()], wrong);
            }
        }
        refused(&error, text)
    });
}

/// Every mistake has a place in the text, and can be shown.
pub fn refused(error: &ScenarioError, text: &str) -> Seen {
    assert!(!error.problems.is_empty());
    for problem in &error.problems {
        let span = problem.span.clone();
        assert!(text.get(span.clone()).is_some(), "{span:?}: {problem:?}");
        assert!(!problem.what.is_empty() && !problem.label.is_empty());
    }
    assert!(error.to_string().starts_with(&format!("{}:", error.file)));
    let shown = Failure::from(error.clone()).render(plain_theme(), 100);
    assert!(!shown.is_empty());
    Seen::Refused
}

fn accepted(world: &Scenario, text: &str, dir: &std::path::Path) -> Seen {
    finite(text);
    let clock = *world.world().clock();
    assert!(clock.samples() <= 100_001, "{} samples", clock.samples());
    let spaces = world.spaces();
    assert!(spaces.neutral < spaces.actions && spaces.observation > 0);
    if let Some(episode) = played(world) {
        judged(world, &episode);
        kept(world, &episode, dir);
    }
    Seen::Accepted
}

/// Outside of texts and remarks every number is finite.
pub fn finite(text: &str) {
    if text.contains(['#', '\\']) || text.contains("/*") {
        return;
    }
    let (mut bare, mut quoted) = (String::new(), false);
    for line in text.lines() {
        for (at, c) in line.char_indices() {
            if !quoted && line[at..].starts_with("//") {
                break;
            }
            quoted ^= c == '"';
            bare.push(if quoted { ' ' } else { c });
        }
        bare.push('\n');
    }
    for word in bare.split(|c: char| !c.is_alphanumeric() && !"._+-".contains(c)) {
        let number = word.trim_start_matches(['+', '-']).replace('_', "");
        let huge = number.starts_with(|c: char| c.is_ascii_digit())
            && number.parse::<f64>().is_ok_and(f64::is_infinite);
        assert!(
            !huge && number != "NaN" && number != "inf",
            "{word} is accepted"
        );
    }
}

/// Plays an episode twice; `None`: a whole one takes too long.
pub fn played(world: &Scenario) -> Option<Episode> {
    let mut bench = world.bench();
    let key = StartKey {
        purpose: Purpose::Calibration,
        seed: 7,
        index: 1,
    };
    let (start, noise) = (bench.draw(key), bench.noise_of(key));
    let clock = *bench.clock();
    if clock.samples() as u64 * u64::from(clock.substeps) > AFFORDABLE {
        bench.begin(&start, noise, Aftermath::Skip);
        return None;
    }
    let actions = bench.spaces().actions;
    let mut again = || {
        let mut actor = Rotating { actions, next: 0 };
        play(&mut bench, &start, noise, &mut actor, Aftermath::Play)
    };
    let first = again();
    assert_eq!(again(), first, "a second episode on the same bench");
    Some(first)
}

/// Every action in turn; looks at what it observes.
struct Rotating {
    actions: usize,
    next: usize,
}

impl Actor for Rotating {
    fn begin(&mut self, _seed: u64, _start: &Start) {}

    fn act(&mut self, obs: &[f32]) -> usize {
        assert!(obs.iter().all(|value| value.is_finite()), "{obs:?}");
        self.next += 1;
        self.next / 3 % self.actions
    }
}

/// The verdict against the monitors' values of the judged samples.
fn judged(world: &Scenario, episode: &Episode) {
    let book = world.rulebook();
    let mut trace = episode.trace.clone();
    trace.truncate(episode.judged);
    let mut scratch = Scratch::new();
    let robustness = book.spec.robustness(&trace, &mut scratch);
    let margins: Vec<f64> = book
        .rules
        .iter()
        .map(|rule| rule.monitor.robustness(&trace, &mut scratch))
        .collect();
    assert_eq!(robustness, episode.robustness);
    assert!(episode.verdict != Verdict::Invalid || episode.fault.is_some());
    match episode.verdict {
        Verdict::Counterexample { by } => {
            assert!(by > 0.0 && by == -robustness, "{by} and {robustness}");
            assert!(margins.iter().all(|margin| *margin > 0.0), "{margins:?}");
        }
        Verdict::Uncounted { by } => assert!(by > 0.0, "{by}"),
        Verdict::Held { margin } => assert!(margin >= 0.0, "{margin}"),
        Verdict::Foul { rule, .. } => assert!(margins[rule] <= 0.0, "{margins:?}"),
        Verdict::Invalid => {}
    }
    let reward = book.reward_of(&episode.verdict);
    assert_eq!(reward.is_none(), episode.verdict == Verdict::Invalid);
    assert!(reward.is_none_or(f64::is_finite), "{reward:?}");
}

/// What is kept reads back as it was and replays bit for bit.
fn kept(world: &Scenario, episode: &Episode, dir: &std::path::Path) {
    if episode.verdict == Verdict::Invalid {
        return;
    }
    let path = dir.join("kept.ron");
    let recorded =
        Counterexample::record(world, "nominal", &Change::default(), "rotating", episode);
    recorded.save(&path, &episode.trace).expect("written");
    let counterexample = Counterexample::load(&path).unwrap_or_else(|error| panic!("{error}"));
    let read = Counterexample {
        sha256: None,
        ..counterexample.clone()
    };
    assert_eq!(read, recorded);
    let again = counterexample
        .scenario(&path)
        .unwrap_or_else(|error| panic!("{error}"));
    let replayed = replay(
        &SavedCounterexample {
            path,
            counterexample,
        },
        again,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    assert!(replayed.identical, "{:?}", replayed.first_difference);
}
