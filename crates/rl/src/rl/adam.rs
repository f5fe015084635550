//! Adam, the optimiser of all networks.

use super::bundle::{BundleError, TensorFile};
use super::kernel::Loop;
use super::nn::Mlp;

/// Adam (Kingma, Ba 2015): the moments and the number of steps taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Running mean of the gradient.
    pub mean: Vec<f32>,
    /// Running mean of the gradient's square.
    pub square: Vec<f32>,
    /// Number of steps taken.
    pub steps: u64,
}

impl Adam {
    // The three constants of Kingma and Ba (2015), which no setting changes.
    const MEAN_DECAY: f32 = 0.9;
    const SQUARE_DECAY: f32 = 0.999;
    const EPSILON: f32 = 1e-8;

    /// Writes the moments of this network's parameters.
    pub fn save(&self, net: &Mlp, prefix: &str, bundle: &mut TensorFile) {
        net.save_as(&self.mean, &format!("{prefix}/mean"), bundle);
        net.save_as(&self.square, &format!("{prefix}/square"), bundle);
        bundle.put(format!("{prefix}/steps"), &[1], vec![self.steps]);
    }

    /// Reads the moments of this network's parameters.
    ///
    /// # Errors
    /// A tensor is missing or misshapen.
    pub fn load(net: &Mlp, prefix: &str, bundle: &TensorFile) -> Result<Adam, BundleError> {
        Ok(Adam {
            mean: net.load_as(&format!("{prefix}/mean"), bundle)?,
            square: net.load_as(&format!("{prefix}/square"), bundle)?,
            steps: bundle.one(&format!("{prefix}/steps"))?,
        })
    }

    /// Creates the state before the first step, for this many parameters.
    pub fn new(parameters: usize) -> Adam {
        Adam {
            mean: vec![0.0; parameters],
            square: vec![0.0; parameters],
            steps: 0,
        }
    }

    /// Forgets the gradients of a parameter that has a new value.
    pub fn forget(&mut self, at: usize) {
        // The moments are those of the old weight, and would push the new one along.
        (self.mean[at], self.square[at]) = (0.0, 0.0);
    }

    /// Moves the parameters against the gradient.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f32) {
        // m̂ = m / (1 − β₁ᵗ) and v̂ = v / (1 − β₂ᵗ). The corrections are moved out of
        // the loop (Kingma, Ba 2015, end of section 2). In f64, because 1 − 0.999ᵗ
        // loses half of its digits in f32 at first.
        self.steps += 1;
        let steps = self.steps as f64;
        let correct = |decay: f32| 1.0 - libm::pow(f64::from(decay), steps);
        let rate = (f64::from(learning_rate) / correct(Adam::MEAN_DECAY)) as f32;
        let shrink = (1.0 / libm::sqrt(correct(Adam::SQUARE_DECAY))) as f32;
        let (means, squares) = (&mut self.mean, &mut self.square);
        Descent {
            parameters,
            gradient,
            means,
            squares,
            rate,
            shrink,
        }
        .vectorized();
    }
}

/// Step of all parameters, after the corrections of the moments.
struct Descent<'a> {
    parameters: &'a mut [f32],
    gradient: &'a [f32],
    means: &'a mut [f32],
    squares: &'a mut [f32],
    rate: f32,
    shrink: f32,
}

impl Loop for Descent<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let moments = self.means.iter_mut().zip(self.squares);
        let all = self.parameters.iter_mut().zip(self.gradient).zip(moments);
        for ((parameter, g), (mean, square)) in all {
            *mean += (1.0 - Adam::MEAN_DECAY) * (g - *mean);
            *square += (1.0 - Adam::SQUARE_DECAY) * (g * g - *square);
            *parameter -= self.rate * *mean / (square.sqrt() * self.shrink + Adam::EPSILON);
        }
    }
}
