//! Choice of an action by the outputs of a network: the greatest, or a draw.

/// Returns the index of the largest value. Ties go to the lowest index.
pub fn argmax(values: &[f32]) -> usize {
    let mut best = 0;
    for (i, value) in values.iter().enumerate() {
        // Strict, so that equal values give the first action on every machine.
        if values[best] < *value {
            best = i;
        }
    }
    best
}

/// Returns the position of the greatest of the allowed values, the first if equal.
///
/// Without an allowed value it is that of the greatest.
pub(crate) fn argmax_among(values: &[f32], allowed: &[bool]) -> usize {
    let allowed = values
        .iter()
        .enumerate()
        .zip(allowed)
        .filter(|(_, it)| **it);
    let best = allowed.reduce(|best, it| if best.0.1 < it.0.1 { it } else { best });
    // No allowed action would be a mistake of the caller, and a policy must still act.
    best.map_or_else(|| argmax(values), |((i, _), _)| i)
}

/// Computes probabilities that are never exactly 0, with finite logarithms.
///
/// The largest logit is subtracted, so that no exponential overflows. e⁻⁴⁰ is
/// still a normal `f32`.
pub(in crate::rl) fn softmax(logits: &[f32], probabilities: &mut Vec<f32>) {
    // Relative to the greatest, because the exponential of a large number is infinite.
    let top = logits[argmax(logits)];
    probabilities.clear();
    probabilities.extend(
        logits
            .iter()
            .map(|logit| libm::expf((logit - top).max(-40.0))),
    );
    let sum: f32 = probabilities.iter().sum();
    for p in probabilities {
        *p /= sum;
    }
}

/// Draws an action from the softmax of values divided by a temperature.
pub(in crate::rl) fn sample(
    values: &[f32],
    temperature: f64,
    units: &mut dyn FnMut() -> f64,
) -> usize {
    let scaled: Vec<f32> = values.iter().map(|v| v / temperature as f32).collect();
    let mut probabilities = Vec::with_capacity(values.len());
    softmax(&scaled, &mut probabilities);
    draw(&probabilities, units())
}

/// Returns the action at which the running sum of probabilities exceeds `unit`.
pub(in crate::rl) fn draw(probabilities: &[f32], unit: f64) -> usize {
    let mut left = unit as f32;
    for (action, p) in probabilities.iter().enumerate() {
        if left < *p {
            return action;
        }
        left -= p;
    }
    // Rounding may leave a remainder, which goes to the likeliest action.
    argmax(probabilities)
}
