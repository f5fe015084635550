//! Multilayer perceptron with ReLU, and its gradient.
//!
//! Parameters lie in a flat vector, layer after layer. A layer is a bias
//! `[width]` followed by weights `[inputs, width]`, where `width` is the number
//! of outputs padded by `padded`. Padding is zero and stays zero, because its
//! gradient vanishes.
//!
//! Architecture Invariant: nothing is allocated after construction, and no
//! result depends on the batch in which it was computed (see `rl::kernel`).

mod action_choice;
mod dead_units;

pub use action_choice::argmax;
pub(crate) use action_choice::argmax_among;
pub(super) use action_choice::{draw, sample, softmax};
pub(super) use dead_units::UsedUnits;

use super::bundle::{BundleError, TensorFile};
use super::dice::LearnerRng;
use super::kernel::{LANES, Loop, Product, padded};
use super::loops::{Blend, Mask, Relu};
use super::orthogonal::orthogonal_matrix;
use super::transpose::transpose;

/// Affine layer, as offsets into the flat parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layer {
    inputs: usize,
    outputs: usize,
    width: usize,
    bias: usize,
    weights: usize,
    end: usize,
}

/// Perceptron: affine layers with ReLU between them, none after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    layers: Vec<Layer>,
    parameters: Vec<f32>,
}

/// Buffers for a batch: activations forward, deltas backward.
#[derive(Clone, Debug)]
pub struct Tape {
    activations: Vec<Vec<f32>>,
    deltas: Vec<Vec<f32>>,
    /// A transposed matrix: weights, or hidden units below a row of ones.
    turned: Vec<f32>,
    /// Transposed outputs or gradient of a layer of few outputs.
    narrow: Vec<f32>,
    zeros: Vec<f32>,
}

impl Layer {
    /// Returns true if a row of outputs is shorter than a register, below whole ones.
    fn is_narrow(&self) -> bool {
        self.width == LANES && self.inputs.is_multiple_of(LANES)
    }

    /// Returns the number of rows to compute of a transposed layer of few outputs.
    ///
    /// Products compute four rows together. The other rows are padding.
    fn turned_rows(&self) -> usize {
        self.outputs.next_multiple_of(LANES / 2)
    }
}

/// Returns true if a row as long as the batch fills registers.
fn fits_registers(batch: usize) -> bool {
    batch > 0 && batch.is_multiple_of(LANES)
}

/// Buffers of a [`Tape`] for a layer of few outputs.
struct Room<'a> {
    turned: &'a mut [f32],
    narrow: &'a mut [f32],
    zeros: &'a [f32],
}

impl Mlp {
    /// Creates a network of zeros. `sizes` are inputs, hidden widths, outputs.
    pub fn zeros(sizes: &[usize]) -> Mlp {
        let mut layers = Vec::new();
        let mut end = 0;
        for pair in sizes.windows(2) {
            let width = padded(pair[1]);
            let (bias, weights) = (end, end + width);
            end = weights + pair[0] * width;
            layers.push(Layer {
                inputs: pair[0],
                outputs: pair[1],
                width,
                bias,
                weights,
                end,
            });
        }
        // Invariant: at least inputs and outputs were given.
        assert!(!layers.is_empty(), "a network needs at least two sizes");
        Mlp {
            layers,
            parameters: vec![0.0; end],
        }
    }

    /// Creates orthogonal weights (Saxe 2014) and zero biases.
    ///
    /// Hidden layers have gain √2 (for ReLU), the last layer has `last_gain`. A small
    /// `last_gain` makes all outputs start near zero.
    pub fn orthogonal(sizes: &[usize], last_gain: f32, dice: &mut LearnerRng) -> Mlp {
        let mut net = Mlp::zeros(sizes);
        let last = net.layers.len() - 1;
        for (i, layer) in net.layers.clone().into_iter().enumerate() {
            let gain = if i == last {
                last_gain
            } else {
                // A ReLU halves the variance of its inputs, for which √2 makes up.
                std::f32::consts::SQRT_2
            };
            let matrix = orthogonal_matrix(layer.inputs, layer.outputs, dice);
            for (row, values) in matrix.iter().enumerate() {
                let at = layer.weights + row * layer.width;
                for (weight, value) in net.parameters[at..].iter_mut().zip(values) {
                    *weight = gain * (*value as f32);
                }
            }
        }
        net
    }

    /// Returns the biases of the outputs.
    pub fn output_biases_mut(&mut self) -> &mut [f32] {
        let Layer { bias, outputs, .. } = *self.last();
        &mut self.parameters[bias..bias + outputs]
    }

    /// Returns the length of an input.
    pub fn inputs(&self) -> usize {
        self.layers[0].inputs
    }

    /// Returns the length of an output.
    pub fn outputs(&self) -> usize {
        self.last().outputs
    }

    /// Returns the distance between the output rows of a batch.
    pub fn output_stride(&self) -> usize {
        self.last().width
    }

    /// Returns all parameters, flat, with padding.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// Returns all parameters, flat and mutable.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// Returns the lengths of inputs and outputs.
    pub fn ends(&self) -> [usize; 2] {
        [self.inputs(), self.outputs()]
    }

    /// Moves all parameters toward those of `other` by a share of the difference.
    ///
    /// Both networks have the same sizes.
    pub fn move_toward(&mut self, other: &Mlp, share: f32) {
        let own = &mut self.parameters[..];
        let other = &other.parameters;
        Blend { own, other, share }.vectorized();
    }

    /// Writes the parameters as `prefix/0/bias`, `prefix/0/weight`, ….
    pub fn save(&self, prefix: &str, bundle: &mut TensorFile) {
        self.save_as(&self.parameters, prefix, bundle);
    }

    /// Writes flat numbers of this network's shape, without the padding.
    ///
    /// Biases have shape `[outputs]`, weights `[inputs, outputs]`.
    pub fn save_as(&self, flat: &[f32], prefix: &str, bundle: &mut TensorFile) {
        for (i, layer) in self.layers.iter().enumerate() {
            let bias = flat[layer.bias..layer.bias + layer.outputs].to_vec();
            // Without padding, so that other tools read plain matrices.
            let rows = flat[layer.weights..layer.end].chunks_exact(layer.width);
            let weight: Vec<f32> = rows
                .flat_map(|row| &row[..layer.outputs])
                .copied()
                .collect();
            bundle.put(format!("{prefix}/{i}/bias"), &[layer.outputs], bias);
            bundle.put(
                format!("{prefix}/{i}/weight"),
                &[layer.inputs, layer.outputs],
                weight,
            );
        }
    }

    /// Reads a network whose sizes are those of the tensors found.
    ///
    /// # Errors
    /// A tensor is missing or does not fit its neighbours.
    pub fn load(prefix: &str, bundle: &TensorFile) -> Result<Mlp, BundleError> {
        let mut sizes = Vec::new();
        while let Some(shape) = bundle.shape(&format!("{prefix}/{}/weight", sizes.len())) {
            sizes.push(shape.to_vec());
        }
        let ends: Vec<usize> = sizes
            .iter()
            .map(|s| s.last().copied().unwrap_or(0))
            .collect();
        let first = sizes.first().and_then(|s| s.first()).copied().unwrap_or(0);
        let sizes: Vec<usize> = std::iter::once(first).chain(ends).collect();
        if sizes.len() < 2 || sizes.contains(&0) {
            return Err(BundleError::Missing {
                name: format!("{prefix}/0/weight"),
            });
        }
        // Checked before memory is reserved: the sizes must belong to numbers that
        // exist, so that a small file cannot request much memory.
        for (i, ends) in sizes.windows(2).enumerate() {
            bundle.get::<f32>(&format!("{prefix}/{i}/weight"), ends)?;
        }
        let mut net = Mlp::zeros(&sizes);
        net.parameters = net.load_as(prefix, bundle)?;
        Ok(net)
    }

    /// Reads flat numbers of this network's shape.
    ///
    /// # Errors
    /// A tensor is missing or misshapen.
    pub fn load_as(&self, prefix: &str, bundle: &TensorFile) -> Result<Vec<f32>, BundleError> {
        let mut flat = vec![0.0; self.parameters.len()];
        for (i, layer) in self.layers.iter().enumerate() {
            let bias = bundle.get::<f32>(&format!("{prefix}/{i}/bias"), &[layer.outputs])?;
            let shape = [layer.inputs, layer.outputs];
            let weight = bundle.get::<f32>(&format!("{prefix}/{i}/weight"), &shape)?;
            flat[layer.bias..layer.bias + layer.outputs].copy_from_slice(bias);
            let rows = flat[layer.weights..layer.end].chunks_exact_mut(layer.width);
            for (row, values) in rows.zip(weight.chunks_exact(layer.outputs)) {
                row[..layer.outputs].copy_from_slice(values);
            }
        }
        Ok(flat)
    }

    /// Creates buffers for batches of up to `batch` rows.
    pub fn tape(&self, batch: usize) -> Tape {
        let per_layer = || {
            self.layers
                .iter()
                .map(|layer| vec![0.0; batch * layer.width])
                .collect()
        };
        let weights = |layer: &Layer| padded(layer.inputs) * layer.width;
        let largest = self.layers.iter().map(weights).max().unwrap_or(0);
        let widest = self.widest();
        Tape {
            activations: per_layer(),
            deltas: per_layer(),
            turned: vec![0.0; largest.max((1 + widest) * batch)],
            narrow: vec![0.0; LANES * widest.max(batch)],
            zeros: vec![0.0; widest.max(batch)],
        }
    }

    /// Computes outputs for `batch` inputs, `[batch, inputs]`, dense.
    ///
    /// Returns `[batch, output_stride]`. The tape keeps the activations for
    /// [`Mlp::backward`].
    #[inline(always)]
    pub fn forward<'a>(&self, inputs: &[f32], batch: usize, tape: &'a mut Tape) -> &'a [f32] {
        let last = self.layers.len() - 1;
        for (i, layer) in self.layers.iter().enumerate() {
            let (before, after) = tape.activations.split_at_mut(i);
            let (left, row) = match before.last() {
                None => (inputs, layer.inputs),
                Some(hidden) => (&hidden[..], self.layers[i - 1].width),
            };
            let out = &mut after[0][..batch * layer.width];
            if i > 0 && layer.is_narrow() && fits_registers(batch) {
                let room = Room {
                    turned: &mut tape.turned,
                    narrow: &mut tape.narrow,
                    zeros: &tape.zeros,
                };
                self.affine_narrow(layer, &left[..batch * row], out, room);
            } else {
                self.affine(layer, left, row, out);
            }
            if i < last {
                Relu(out).vectorized();
            }
        }
        &tape.activations[last][..batch * self.layers[last].width]
    }

    /// Returns the outputs of the last [`Mlp::forward`] and a gradient to fill.
    ///
    /// Both are `[batch, output_stride]`. Padding columns of the gradient must be
    /// zero.
    pub fn output_and_gradient<'a>(
        &self,
        batch: usize,
        tape: &'a mut Tape,
    ) -> (&'a [f32], &'a mut [f32]) {
        let last = self.layers.len() - 1;
        let end = batch * self.layers[last].width;
        (
            &tape.activations[last][..end],
            &mut tape.deltas[last][..end],
        )
    }

    /// Computes the gradient of the parameters.
    ///
    /// Call it after [`Mlp::forward`] on the same inputs, with the tape's output
    /// gradient filled in. The result sums over the batch and overwrites `gradient`.
    #[inline(always)]
    pub fn backward(&self, inputs: &[f32], batch: usize, tape: &mut Tape, gradient: &mut [f32]) {
        for (i, layer) in self.layers.iter().enumerate().rev() {
            let (below, here) = tape.deltas.split_at_mut(i);
            let delta = &here[0][..batch * layer.width];
            let (left, row) = match i {
                0 => (inputs, layer.inputs),
                _ => (&tape.activations[i - 1][..], self.layers[i - 1].width),
            };
            // dW = xᵀ · delta. Exchanged strides read the inputs transposed.
            let weights = &mut gradient[layer.weights..layer.end];
            let start = &tape.zeros[..layer.width];
            if i > 0 && layer.is_narrow() {
                // dWᵀ = deltaᵀ · x: the same sums, in full registers.
                let turned = &mut tape.narrow[..LANES * row];
                let (used, padding) = turned.split_at_mut(layer.turned_rows() * row);
                padding.fill(0.0);
                Product {
                    left: delta,
                    row: 1,
                    column: layer.width,
                    right: &left[..batch * row],
                    start: &tape.zeros[..row],
                }
                .write(used);
                transpose(turned, row, weights, LANES);
            } else {
                Product {
                    left,
                    row: 1,
                    column: row,
                    right: delta,
                    start,
                }
                .write(weights);
            }
            // db = Σ delta = 1ᵀ · delta. Strides of 0 read the same 1 again.
            Product {
                left: &[1.0],
                row: 0,
                column: 0,
                right: delta,
                start,
            }
            .write(&mut gradient[layer.bias..layer.weights]);
            // The delta below is delta · Wᵀ where the hidden unit was on.
            let Some(below) = below.last_mut() else {
                continue;
            };
            // A product reads its right factor row by row, so the transpose is copied.
            // Padding columns may be stale. The ReLU mask below zeroes their result, since
            // padded units are never on.
            let width = self.layers[i - 1].width;
            let weights = &self.parameters[layer.weights..layer.end];
            let turned = &mut tape.turned;
            transpose(weights, layer.width, turned, width);
            let out = &mut below[..batch * width];
            let start = &tape.zeros[..width];
            Product {
                left: delta,
                row: layer.width,
                column: 1,
                right: &tape.turned[..layer.outputs * width],
                start,
            }
            .write(out);
            let hidden = &tape.activations[i - 1];
            Mask {
                deltas: out,
                hidden,
            }
            .vectorized();
        }
    }

    /// Calls `read` with the outputs for a single input, without a tape.
    ///
    /// The bits are those of [`Mlp::forward`]. Layers up to 128 wide stay on the
    /// stack.
    pub fn evaluate<T>(&self, input: &[f32], read: impl FnOnce(&[f32]) -> T) -> T {
        // A policy acts at every sample, so the usual widths avoid an allocation.
        const STACK: usize = 128;
        let widest = self.widest();
        if widest <= STACK {
            let (mut a, mut b) = ([0.0; STACK], [0.0; STACK]);
            self.evaluate_in(input, &mut a, &mut b, read)
        } else {
            let (mut a, mut b) = (vec![0.0; widest], vec![0.0; widest]);
            self.evaluate_in(input, &mut a, &mut b, read)
        }
    }

    fn evaluate_in<'a, T>(
        &self,
        input: &[f32],
        mut here: &'a mut [f32],
        mut there: &'a mut [f32],
        read: impl FnOnce(&[f32]) -> T,
    ) -> T {
        let last = self.layers.len() - 1;
        for (i, layer) in self.layers.iter().enumerate() {
            let left = if i == 0 { input } else { &*there };
            let out = &mut here[..layer.width];
            self.affine(layer, left, layer.inputs, out);
            if i < last {
                Relu(out).run();
            }
            std::mem::swap(&mut here, &mut there);
        }
        // The last swap moved the outputs into `there`.
        read(&there[..self.outputs()])
    }

    #[inline(always)]
    fn affine(&self, layer: &Layer, left: &[f32], row: usize, out: &mut [f32]) {
        let right = &self.parameters[layer.weights..layer.end];
        let start = &self.parameters[layer.bias..layer.weights];
        Product {
            left,
            row,
            column: 1,
            right,
            start,
        }
        .write(out);
    }

    /// Computes a layer of few outputs for a batch, with the bits of [`Mlp::affine`].
    ///
    /// A row of few outputs fills no register. The transpose, bias · 1ᵀ + Wᵀ · xᵀ, has
    /// rows as long as the batch. The bias is the row of the flat parameters before the
    /// weights, and multiplies the row of ones before the inputs.
    fn affine_narrow(&self, layer: &Layer, inputs: &[f32], out: &mut [f32], room: Room) {
        let batch = out.len() / layer.width;
        let (ones, turned) = room.turned.split_at_mut(batch);
        ones.fill(1.0);
        transpose(inputs, layer.inputs, turned, batch);
        let turned = &mut room.narrow[..LANES * batch];
        let (used, padding) = turned.split_at_mut(layer.turned_rows() * batch);
        padding.fill(0.0);
        Product {
            left: &self.parameters[layer.bias..layer.end],
            row: 1,
            column: layer.width,
            right: &room.turned[..(1 + layer.inputs) * batch],
            start: &room.zeros[..batch],
        }
        .write(used);
        transpose(turned, batch, out, layer.width);
    }

    fn widest(&self) -> usize {
        let widths = self.layers.iter().map(|layer| layer.width);
        widths.max().unwrap_or(0)
    }

    fn last(&self) -> &Layer {
        &self.layers[self.layers.len() - 1]
    }
}
