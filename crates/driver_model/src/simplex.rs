//! Minimum of a function without derivatives (Nelder and Mead 1965).

/// Returns the best point found from `start`, with steps of `step` at first.
pub(crate) fn minimum(
    function: impl Fn(&[f64]) -> f64,
    start: &[f64],
    step: &[f64],
    evaluations: usize,
) -> Vec<f64> {
    let n = start.len();
    // A NaN is worse than every number, so its point is the first to be replaced.
    let value = |point: &[f64]| {
        let value = function(point);
        if value.is_nan() { f64::INFINITY } else { value }
    };
    let mut simplex: Vec<(f64, Vec<f64>)> = (0..=n)
        .map(|i| {
            let mut point = start.to_vec();
            if let Some(at) = i.checked_sub(1) {
                point[at] += step[at];
            }
            (value(&point), point)
        })
        .collect();
    let mut used = n + 1;
    while used < evaluations {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spread = simplex[n].0 - simplex[0].0;
        // Relative for large values, absolute near zero, where no relative spread is small.
        if spread.abs() <= 1e-10 * (1.0 + simplex[0].0.abs()) {
            break;
        }
        let middle: Vec<f64> = (0..n)
            .map(|k| simplex[..n].iter().map(|it| it.1[k]).sum::<f64>() / n as f64)
            .collect();
        let along = |factor: f64, simplex: &[(f64, Vec<f64>)]| {
            let worst = &simplex[n].1;
            let point: Vec<f64> = (0..n)
                .map(|k| middle[k] + factor * (worst[k] - middle[k]))
                .collect();
            (value(&point), point)
        };
        let reflected = along(-1.0, &simplex);
        used += 1;
        // A new best point shows a good direction, so a longer step is tried, too.
        if reflected.0 < simplex[0].0 {
            let further = along(-2.0, &simplex);
            used += 1;
            simplex[n] = if further.0 < reflected.0 {
                further
            } else {
                reflected
            };
            continue;
        }
        // Better than the second worst: the next round moves another point.
        if reflected.0 < simplex[n - 1].0 {
            simplex[n] = reflected;
            continue;
        }
        // The reflection would be the worst again, so the step is halved on the better side.
        let nearer = along(
            if reflected.0 < simplex[n].0 {
                -0.5
            } else {
                0.5
            },
            &simplex,
        );
        used += 1;
        if nearer.0 < simplex[n].0.min(reflected.0) {
            simplex[n] = nearer;
            continue;
        }
        // Not even half a step helps, so all points move towards the best.
        let best = simplex[0].1.clone();
        for (at, point) in &mut simplex[1..] {
            for (x, best) in point.iter_mut().zip(&best) {
                *x = 0.5 * (*x + best);
            }
            *at = value(point);
        }
        used += n;
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    simplex.swap_remove(0).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bottom_of_a_curved_valley_is_found() {
        let valley = |p: &[f64]| (1.0 - p[0]).powi(2) + 100.0 * (p[1] - p[0] * p[0]).powi(2);
        let found = minimum(valley, &[-1.2, 1.0], &[0.5, 0.5], 1000);
        assert!(
            (found[0] - 1.0).abs() < 1e-3 && (found[1] - 1.0).abs() < 1e-3,
            "{found:?}"
        );
    }
}
