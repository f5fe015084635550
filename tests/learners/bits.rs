//! Fast paths against the plain formula, to the last bit.

use brakecheck::rl::{Env, LearnerRng, TensorFile};
use brakecheck_rl::rl::nn::Mlp;
use brakecheck_rl::rl::replay::{Batch, ReplayBuffer, Transition};
use brakecheck_rl::rl::sum_tree::SumTree;
use proptest::prelude::*;

use crate::{Acc, config, go_on};

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// A network, layer by layer, as the module documentation describes its numbers.
struct Naive {
    inputs: usize,
    width: usize,
    bias: Vec<f32>,
    weights: Vec<f32>,
}

impl Naive {
    fn layers(net: &Mlp, sizes: &[usize]) -> Vec<Naive> {
        let mut rest = net.parameters();
        let layer = |ends: &[usize]| {
            let width = ends[1].next_multiple_of(8);
            let (bias, after) = rest.split_at(width);
            let (weights, after) = after.split_at(ends[0] * width);
            rest = after;
            Naive {
                inputs: ends[0],
                width,
                bias: bias.to_vec(),
                weights: weights.to_vec(),
            }
        };
        sizes.windows(2).map(layer).collect()
    }
}

/// Outputs and the gradient, every sum from first to last.
fn naive(net: &Mlp, sizes: &[usize], x: &[f32], batch: usize, pull: &[f32]) -> [Vec<f32>; 2] {
    let layers = Naive::layers(net, sizes);
    let mut values = vec![x.to_vec()];
    for (i, layer) in layers.iter().enumerate() {
        let stride = values[i].len() / batch;
        let mut out = Vec::new();
        for row in values[i].chunks_exact(stride) {
            for q in 0..layer.width {
                let mut sum = layer.bias[q];
                for (p, x) in row.iter().enumerate().take(layer.inputs) {
                    sum += x * layer.weights[p * layer.width + q];
                }
                let is_hidden = i + 1 < layers.len();
                out.push(if is_hidden && sum <= 0.0 { 0.0 } else { sum });
            }
        }
        values.push(out);
    }
    let mut delta = pull.to_vec();
    let mut gradients = Vec::new();
    for (i, layer) in layers.iter().enumerate().rev() {
        let stride = values[i].len() / batch;
        let width = layer.width;
        let mut gradient = vec![0.0; width];
        for row in delta.chunks_exact(width) {
            gradient.iter_mut().zip(row).for_each(|(sum, d)| *sum += d);
        }
        for p in 0..layer.inputs {
            for q in 0..width {
                let terms = (0..batch).map(|r| values[i][r * stride + p] * delta[r * width + q]);
                gradient.push(terms.fold(0.0, |sum, term| sum + term));
            }
        }
        gradients.push(gradient);
        let mut below = vec![0.0; batch * stride];
        for r in 0..batch {
            for p in 0..layer.inputs {
                let weights = &layer.weights[p * width..(p + 1) * width];
                let row = &delta[r * width..(r + 1) * width];
                let sum = row.iter().zip(weights).fold(0.0, |sum, (d, w)| sum + d * w);
                let is_on = values[i][r * stride + p] > 0.0;
                below[r * stride + p] = if is_on { sum } else { 0.0 };
            }
        }
        delta = below;
    }
    gradients.reverse();
    [values.remove(layers.len()), gradients.concat()]
}

#[test]
fn networks_have_the_bits_of_the_plain_sums() {
    let mut dice = LearnerRng::new(3);
    // Few and many outputs, widths of all tiles, and layers that are not padded evenly.
    let shapes: [&[usize]; 7] = [
        &[5, 64, 64, 3],
        &[7, 96, 8],
        &[3, 128, 40, 5],
        &[4, 10, 2],
        &[6, 24, 1],
        &[2, 80, 17],
        &[9, 4],
    ];
    for sizes in shapes {
        let mut net = Mlp::orthogonal(sizes, 1.0, &mut dice);
        let mut tape = net.tape(64);
        let stride = net.output_stride();
        // Biases too. Padding stays 0.
        for (at, weight) in net.parameters_mut().iter_mut().enumerate() {
            *weight += if *weight == 0.0 {
                0.0
            } else {
                0.01 * (at % 7) as f32
            };
        }
        // One tape for all batches: a shorter one must not read what a longer one left.
        for batch in [64, 24, 1, 8, 13, 40, 64] {
            let x: Vec<f32> = (0..batch * sizes[0])
                .map(|_| dice.normal() as f32)
                .collect();
            let mut pull = vec![0.0; batch * stride];
            for row in pull.chunks_exact_mut(stride) {
                row[dice.below(net.outputs())] = dice.normal() as f32;
            }
            let [outputs, expected] = naive(&net, sizes, &x, batch, &pull);
            let found = net.forward(&x, batch, &mut tape);
            assert_eq!(bits(found), bits(&outputs), "{sizes:?}, {batch} rows");
            let (_, gradient) = net.output_and_gradient(batch, &mut tape);
            gradient.copy_from_slice(&pull);
            let mut gradient = vec![f32::NAN; net.parameters().len()];
            net.backward(&x, batch, &mut tape, &mut gradient);
            assert_eq!(bits(&gradient), bits(&expected), "{sizes:?}, {batch} rows");
            for (row, x) in outputs.chunks_exact(stride).zip(x.chunks_exact(sizes[0])) {
                assert_eq!(net.evaluate(x, bits), bits(&row[..net.outputs()]));
            }
        }
        assert!(net.forward(&[], 0, &mut tape).is_empty());
    }
}

proptest! {
    #[test]
    fn leaves_set_together_give_the_tree_of_leaves_set_singly(
        leaves in prop::collection::vec(0.0f64..10.0, 1..150),
        changes in prop::collection::vec((0usize..150, 0.0f32..9.0), 0..70),
        sorted in any::<bool>(),
    ) {
        let mut changes: Vec<(usize, f32)> = changes;
        changes.retain(|(leaf, _)| *leaf < leaves.len());
        if sorted {
            changes.sort_by_key(|(leaf, _)| *leaf);
        }
        let (mut together, mut singly) = (SumTree::new(&leaves), SumTree::new(&leaves));
        for (leaf, value) in &changes {
            singly.set(*leaf, f64::from(*value));
        }
        let (mut slots, values): (Vec<usize>, Vec<f32>) = changes.into_iter().unzip();
        together.set_all(&mut slots, &values);
        prop_assert_eq!(together, singly);
    }
}

#[test]
fn only_next_observations_that_matter_are_in_a_batch() {
    let mut replay = ReplayBuffer::new(2, 10, 0.6);
    for i in 0..10 {
        let x = i as f32;
        replay.push(Transition {
            observation: &[x, -x],
            action: i,
            reward: x,
            next: &[x + 0.5, x],
            discount: if i % 3 == 0 { 0.0 } else { 0.9 },
        });
    }
    let (mut batch, mut dice) = (Batch::default(), LearnerRng::new(1));
    replay.sample(40, 0.5, &mut dice, &mut batch);
    let second = batch.clone();
    batch.append(&second);
    replay.append_newest(&mut batch);
    let is_lasting = |at: &usize| batch.actions[*at] % 3 != 0;
    let lasting: Vec<usize> = (0..81).filter(is_lasting).collect();
    assert_eq!(batch.lasting, lasting);
    assert!(
        lasting.len() > 20 && lasting.len() < 70,
        "{}",
        lasting.len()
    );
    let next = |at: &usize| [batch.rewards[*at] + 0.5, batch.rewards[*at]];
    assert_eq!(
        batch.nexts,
        lasting.iter().flat_map(next).collect::<Vec<_>>()
    );
    for at in 0..81 {
        let x = batch.actions[at] as f32;
        assert_eq!(batch.observations[2 * at..2 * at + 2], [x, -x]);
    }
}

/// FNV-1a of all numbers of a network.
fn digest(bundle: &TensorFile, name: &str, sizes: &[usize]) -> u64 {
    let mut numbers = Vec::new();
    for (i, ends) in sizes.windows(2).enumerate() {
        let part = |part, shape: &[usize]| bundle.get::<f32>(&format!("{name}/{i}/{part}"), shape);
        numbers.extend_from_slice(part("bias", &ends[1..]).unwrap());
        numbers.extend_from_slice(part("weight", ends).unwrap());
    }
    let bytes = numbers.iter().flat_map(|x| x.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Kept policies, tables and pages are of these bits. Change them once, if at all,
/// with all results measured again.
#[test]
fn trainings_have_the_bits_of_version_0_2() {
    let cases: [(&str, &str, &[usize], u64); 5] = [
        (
            "Dqn(decisions: 6_000)",
            "q",
            &[5, 64, 64, 3],
            0x1a1f_b8c6_682b_cebb,
        ),
        (
            "Dqfd(decisions: 4_000)",
            "q",
            &[5, 96, 96, 96, 3],
            0x9f57_081a_6037_25a9,
        ),
        (
            "Dqn(decisions: 3_000, hidden: [12], batch: 10, capacity: Some(1_500))",
            "q",
            &[5, 12, 3],
            0x18ba_8d76_d450_fb7b,
        ),
        (
            "Dqn(decisions: 3_000, steps: 1, newest: true, loss: Squared, priority: 0.0, correction: 0.0)",
            "q",
            &[5, 64, 64, 3],
            0x4535_55be_29cb_91a8,
        ),
        (
            "Ppo(decisions: 6_000)",
            "actor",
            &[5, 64, 64, 3],
            0x3acd_d3c6_43ea_238f,
        ),
    ];
    let trained = cases.map(|(ron, name, sizes, _)| {
        let mut learner = config(ron).build(Acc::new(1).spaces(), 1);
        go_on(&mut *learner, &mut Acc::new(1));
        digest(&learner.policy_bundle(), name, sizes)
    });
    assert_eq!(
        trained,
        cases.map(|(_, _, _, digest)| digest),
        "{trained:#x?}"
    );
}
