//! Cases of a target, one after the other; a failing one is made small.

use std::path::Path;
use std::time::{Duration, Instant};

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngAlgorithm, TestError, TestRng, TestRunner};

/// What became of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// A named error.
    Refused,
    /// A value, and everything asked of it held.
    Accepted,
}

/// Bytes that are shown as text.
#[derive(Clone)]
pub struct Bytes(pub Vec<u8>);

impl std::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let shown = self.0[..self.0.len().min(300)].escape_ascii();
        write!(f, "{} bytes: {shown}", self.0.len())
    }
}

/// Time of a case that is taken for an endless one.
const LONGEST: Duration = Duration::from_secs(10);

/// One kind of input.
pub struct Target {
    pub name: &'static str,
    /// Cases of a short run.
    pub cases: u64,
    /// Runs of the check while a failing input is made smaller.
    pub shrinks: u32,
    /// Share of the inputs, in percent, that a short run must see accepted,
    /// and refused: what always meets the first error tests nothing else.
    pub least_percent: (u64, u64),
}

impl Target {
    /// Checks inputs: so many as the target says, or as the environment does.
    ///
    /// `FUZZ_SECONDS` goes on for so long, `FUZZ_CASES` for so many cases, `FUZZ_SEED` takes
    /// other inputs, `FUZZ_CASE` runs one case alone. In a long run no case may take
    /// longer than [`LONGEST`].
    pub fn run<S: Strategy>(&self, inputs: &S, check: impl Fn(&S::Value) -> Seen) {
        let seed = number("FUZZ_SEED").unwrap_or(0);
        let only = number("FUZZ_CASE");
        let seconds = number("FUZZ_SECONDS").map(Duration::from_secs);
        let cases = number("FUZZ_CASES");
        let is_long = seconds.is_some() || cases.is_some();
        let mut slowest = (Duration::ZERO, 0);
        let begun = Instant::now();
        let (mut accepted, mut done) = (0, 0);
        for case in only.unwrap_or(0).. {
            let enough = match (only, seconds) {
                (Some(only), _) => only < case,
                (None, Some(seconds)) => seconds < begun.elapsed(),
                (None, None) => cases.unwrap_or(self.cases) <= case,
            };
            if enough {
                break;
            }
            if is_long {
                self.note(seed, case);
            }
            let started = Instant::now();
            accepted += u64::from(self.case(seed, case, inputs, &check) == Seen::Accepted);
            done += 1;
            slowest = slowest.max((started.elapsed(), case));
        }
        let (longest, slow) = slowest;
        println!(
            "{}: {accepted} of {done} cases accepted, the slowest took {:.3} s",
            self.name,
            longest.as_secs_f64()
        );
        assert!(
            !is_long || longest <= LONGEST,
            "{}: case {slow} took {longest:?}",
            self.name
        );
        if only.is_none() {
            let (least, refused) = self.least_percent;
            assert!(least * done <= 100 * accepted, "too few are accepted");
            assert!(
                refused * done <= 100 * (done - accepted),
                "too few are refused"
            );
        }
    }

    fn case<S: Strategy>(
        &self,
        seed: u64,
        case: u64,
        inputs: &S,
        check: impl Fn(&S::Value) -> Seen,
    ) -> Seen {
        let config = Config {
            failure_persistence: None,
            max_shrink_iters: self.shrinks,
            ..Config::default()
        };
        let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &self.key(seed, case));
        let mut runner = TestRunner::new_with_rng(config, rng);
        let tree = inputs.new_tree(&mut runner).expect("an input");
        let seen = std::cell::Cell::new(Seen::Refused);
        let result = runner.run_one(tree, |input| {
            seen.set(check(&input));
            Ok(())
        });
        match result {
            Ok(_) => seen.get(),
            Err(TestError::Fail(why, input)) => panic!(
                "{why}\nthe smallest input found: {input:#?}\nagain: FUZZ_SEED={seed} FUZZ_CASE={case} cargo test --release --test fuzz {}",
                self.name
            ),
            Err(TestError::Abort(why)) => panic!("{}: {why}", self.name),
        }
    }

    /// Seed of one case: the target's name, the run's seed and the number.
    fn key(&self, seed: u64, case: u64) -> [u8; 32] {
        let mut key = [0; 32];
        let name = self.name.bytes().take(16).enumerate();
        name.for_each(|(i, byte)| key[i] = byte);
        key[16..24].copy_from_slice(&seed.to_le_bytes());
        key[24..].copy_from_slice(&case.to_le_bytes());
        key
    }

    /// Says in a file which case runs: what never ends, or ends the process,
    /// is found there.
    fn note(&self, seed: u64, case: u64) {
        let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{}", self.name));
        let text = format!("FUZZ_SEED={seed} FUZZ_CASE={case}\n");
        std::fs::write(file, text).expect("written");
    }
}

fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name}={value} is no number")),
    )
}
