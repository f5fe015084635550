//! Keyed random streams: every draw is a pure function of names and numbers.
//!
//! A start is drawn from the stream (world, purpose, seed, index), and the noise
//! of its episode from another stream. Streams with different keys are
//! independent. Training therefore never sees a test start, and results never
//! depend on the thread count.
//!
//! Seeds are of two kinds, separated at [`FIRST_SEALED`]. You may look at open
//! seeds while you tune a setting. Sealed seeds are for reported numbers.
//!
//! ```
//! # use brakecheck_stats as brakecheck;
//! use brakecheck::seed::{FIRST_SEALED, Seeds};
//!
//! let reported = Seeds::sealed(3);
//! assert!(reported.trainings().all(|seed| FIRST_SEALED <= seed));
//! assert_eq!(
//!     reported.to_string(),
//!     "training seeds 100 to 102, test starts of seed 100; sealed"
//! );
//! ```

use std::fmt;
use std::ops::Range;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Purpose of a stream of starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Purpose {
    /// Starts that a learner may see.
    Train,
    /// Starts used to estimate ε and thresholds (Theorem 3, a priori).
    Calibration,
    /// Starts on which rates are reported.
    Test,
}

/// First sealed seed, of trainings and of streams of test starts alike.
///
/// A number used to choose a setting is no evidence for that setting. Settings
/// are therefore chosen on seeds below this value and reported on seeds from
/// this value on. docs/background/intervals.md lists the seeds looked at so far.
pub const FIRST_SEALED: u64 = 100;

/// Trainings and test starts behind a reported number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seeds {
    /// Seed of the first training. The others follow it.
    pub first: u64,
    /// Number of trainings.
    pub count: u64,
    /// Seed of the stream of test starts.
    pub starts: u64,
}

impl Seeds {
    /// Returns the first `count` sealed trainings, on sealed test starts.
    pub fn sealed(count: u64) -> Seeds {
        Seeds {
            first: FIRST_SEALED,
            count,
            starts: FIRST_SEALED,
        }
    }

    /// Returns the training seeds in rising order, without those beyond `u64`.
    pub fn trainings(&self) -> Range<u64> {
        // Saturating, so that a first seed near the end of `u64` does not overflow.
        self.first..self.first.saturating_add(self.count)
    }

    /// Returns true if no tuning of a setting may have seen any of these seeds.
    pub fn is_sealed(&self) -> bool {
        self.first >= FIRST_SEALED && self.starts >= FIRST_SEALED
    }
}

impl fmt::Display for Seeds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Zero trainings print the first seed instead of an empty range.
        let last = self.trainings().last().unwrap_or(self.first);
        if last == self.first {
            write!(f, "training seed {last}")?
        } else {
            write!(f, "training seeds {} to {last}", self.first)?
        }
        let kind = if self.is_sealed() { "sealed" } else { "open" };
        write!(f, ", test starts of seed {}; {kind}", self.starts)
    }
}

/// Key of one start and of the noise of its episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct StartKey {
    /// Purpose of the stream.
    pub purpose: Purpose,
    /// Seed of the stream.
    pub seed: u64,
    /// Position in the stream.
    pub index: u64,
}

/// Distance between the seeds that are derived from one seed.
const STRIDE: u64 = 1_000_000;

/// Returns the seed of a training or of starts, among those of a request with a seed.
///
/// Number 0 has the seed of the request. Requests of neighbouring seeds share no other one.
pub fn derived_seed(seed: u64, number: u64) -> u64 {
    seed.wrapping_add(number.wrapping_mul(STRIDE))
}

/// Returns the generator of a key, with equal streams on any machine.
pub fn generator(name: &str, key: &[u64]) -> ChaCha8Rng {
    // "brakeche" in ASCII, an arbitrary but fixed initial state.
    let mut state = Mixer(0x6272_616b_6563_6865);
    for byte in name.bytes() {
        state.absorb(u64::from(byte) + 1);
    }
    for part in key {
        // + 256 keeps the numbers apart from the bytes of the name.
        state.absorb(part.wrapping_add(0x0100));
    }
    let mut seed = [0u8; 32];
    for chunk in seed.chunks_exact_mut(8) {
        chunk.copy_from_slice(&state.next().to_le_bytes());
    }
    // ChaCha8 is specified, while rand's default generator may change with its version.
    ChaCha8Rng::from_seed(seed)
}

/// Returns a standard normal number (Box, Muller 1958).
///
/// The second number of the pair is discarded, so the generator is the whole state.
pub fn normal(rng: &mut impl Rng) -> f64 {
    normal_pair(rng).0
}

/// Returns two independent standard normal numbers (Box, Muller 1958).
pub fn normal_pair(rng: &mut impl Rng) -> (f64, f64) {
    // `random` is in 0 .. 1. The complement avoids log 0.
    let radius = libm::sqrt(-2.0 * libm::log(1.0 - rng.random::<f64>()));
    let (sin, cos) = libm::sincos(core::f64::consts::TAU * rng.random::<f64>());
    (radius * cos, radius * sin)
}

impl StartKey {
    /// Returns the generator of `what` (start, noise, …) for this key in a world.
    pub fn generator(&self, world: &str, what: &str) -> ChaCha8Rng {
        // Explicit numbers, so that reordering the enum never moves a stream.
        let purpose = match self.purpose {
            Purpose::Train => 1,
            Purpose::Calibration => 2,
            Purpose::Test => 3,
        };
        generator(
            &format!("{world}/{what}"),
            &[purpose, self.seed, self.index],
        )
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014), used as a sponge over the key.
struct Mixer(u64);

impl Mixer {
    fn absorb(&mut self, value: u64) {
        self.0 = self.0.wrapping_add(value);
        self.0 = self.next();
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_every_part_of_the_key() {
        let key = |purpose, seed, index| StartKey {
            purpose,
            seed,
            index,
        };
        let mut seen = std::collections::HashSet::new();
        for purpose in [Purpose::Train, Purpose::Calibration, Purpose::Test] {
            for seed in 0..20 {
                for index in 0..20 {
                    for world in ["acc", "merge"] {
                        let mut rng = key(purpose, seed, index).generator(world, "start");
                        assert!(seen.insert(rng.next_u64()));
                    }
                }
            }
        }
    }

    #[test]
    fn requests_of_neighbouring_seeds_share_no_seed() {
        assert_eq!(derived_seed(7, 0), 7);
        let mut seen = std::collections::HashSet::new();
        for seed in 0..200 {
            assert!((0..20).all(|number| seen.insert(derived_seed(seed, number))));
        }
    }

    /// Policies, noise and searches that are recorded rest on these bits: drawn from
    /// 53 bits each, with the cosine alone.
    #[test]
    fn normal_numbers_keep_their_bits() {
        let (mut rng, mut same) = (generator("normal", &[7]), generator("normal", &[7]));
        let mut unit = || (same.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64);
        let mut sum = 0.0;
        for _ in 0..10_000 {
            let radius = (-2.0 * libm::log(1.0 - unit())).sqrt();
            let expected = radius * libm::cos(core::f64::consts::TAU * unit());
            let found = normal(&mut rng);
            assert_eq!(found.to_bits(), expected.to_bits());
            sum += found * found;
        }
        // Variance 1, with a standard error of 0.014.
        assert!((sum / 10_000.0 - 1.0).abs() < 0.05, "{sum}");
    }

    #[test]
    fn open_and_sealed_seeds_never_meet() {
        for count in [1, 5, 100] {
            let reported = Seeds::sealed(count);
            assert!(reported.is_sealed());
            assert_eq!(reported.trainings().count() as u64, count);
            assert!(reported.trainings().all(|seed| seed >= FIRST_SEALED));
        }
        let open = Seeds {
            first: FIRST_SEALED - 3,
            count: 3,
            starts: FIRST_SEALED,
        };
        assert!(!open.is_sealed());
        assert!(open.trainings().all(|seed| seed < FIRST_SEALED));
        let seen_starts = Seeds {
            starts: 0,
            ..Seeds::sealed(1)
        };
        assert_eq!(
            seen_starts.to_string(),
            "training seed 100, test starts of seed 0; open"
        );
    }

    #[test]
    fn a_key_gives_the_same_numbers_on_every_machine() {
        let mut rng = generator("acc/start", &[3, 0, 7]);
        assert_eq!(rng.next_u64(), 15_680_933_773_575_291_895);
    }
}
