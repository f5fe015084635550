//! Random numbers of the learners: ChaCha8, equal on every machine.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::bundle::{BundleError, TensorFile};
use crate::seed;

/// Seeded generator that a checkpoint can save and restore.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerRng(ChaCha8Rng);

impl LearnerRng {
    /// Creates the generator of a seed.
    pub fn new(seed: u64) -> LearnerRng {
        LearnerRng(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Draws uniformly from [0, 1), with 53 random bits.
    pub fn unit(&mut self) -> f64 {
        // 53 bits, as many as the mantissa has: every value is exact.
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Draws uniformly from 0, 1, … `end` − 1, and returns 0 if `end` is 0.
    ///
    /// Multiplication instead of rejection: the bias is below `end` / 2⁶⁴.
    pub fn below(&mut self, end: usize) -> usize {
        // Lemire's product. Its bias is `end`/2⁶⁴, and it always takes one draw.
        ((u128::from(self.0.next_u64()) * end as u128) >> 64) as usize
    }

    /// Draws from the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        seed::normal(&mut self.0)
    }

    /// Shuffles the items (Fisher, Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        // Fisher and Yates, from the end.
        for end in (1..items.len()).rev() {
            items.swap(end, self.below(end + 1));
        }
    }

    /// Writes the state into a checkpoint.
    pub fn save(&self, bundle: &mut TensorFile) {
        // The position exceeds 64 bits, hence two words of it.
        let position = self.0.get_word_pos();
        bundle.put("dice/seed", &[32], self.0.get_seed().to_vec());
        let words = vec![
            position as u64,
            (position >> 64) as u64,
            self.0.get_stream(),
        ];
        bundle.put("dice/position", &[3], words);
    }

    /// Reads the state from a checkpoint.
    ///
    /// # Errors
    /// The two tensors of [`LearnerRng::save`] are missing or misshapen.
    pub fn restore(bundle: &TensorFile) -> Result<LearnerRng, BundleError> {
        let mut seed = [0; 32];
        seed.copy_from_slice(bundle.get::<u8>("dice/seed", &[32])?);
        let words = bundle.get::<u64>("dice/position", &[3])?;
        let mut rng = ChaCha8Rng::from_seed(seed);
        rng.set_stream(words[2]);
        rng.set_word_pos(u128::from(words[0]) | (u128::from(words[1]) << 64));
        Ok(LearnerRng(rng))
    }
}
