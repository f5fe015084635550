//! How often events exceed a size: counts, and a generalised Pareto tail.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::simplex::minimum;

/// Fewest events for a rate to be a count.
pub const COUNTED_FROM: u32 = 5;

/// Least tail rate that is computed, relative to the rate at the threshold.
const LEAST_SHARE: f64 = 1e-12;

/// Generalised Pareto distribution of excesses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pareto {
    /// Shape ξ. Positive for a heavy tail.
    pub shape: f64,
    /// Scale β, in the unit of the excesses.
    pub scale: f64,
}

impl Pareto {
    /// Fits excesses by maximum likelihood, with the shape within ±0.9.
    ///
    /// Returns `None` for fewer than five excesses.
    pub fn fit(excesses: &[f64]) -> Option<Pareto> {
        if excesses.len() < COUNTED_FROM as usize {
            return None;
        }
        let mean = excesses.iter().sum::<f64>() / excesses.len() as f64;
        // Excesses of 0 alone have no scale.
        if mean <= 0.0 {
            return None;
        }
        let of = |p: &[f64]| Pareto {
            shape: p[0],
            // An exponential keeps the scale positive, and 0 starts the search
            // at the mean.
            scale: mean * libm::exp(p[1]),
        };
        let loss = |p: &[f64]| {
            // Beyond 1 the tail has no mean. The infinite loss turns the
            // simplex back.
            if p[0].abs() > 0.9 {
                return f64::INFINITY;
            }
            -excesses
                .iter()
                .map(|it| of(p).log_density(*it))
                .sum::<f64>()
        };
        Some(of(&minimum(loss, &[0.1, -0.1], &[0.2, 0.2], 300)))
    }

    fn log_density(&self, excess: f64) -> f64 {
        // The limit of a shape of 0, where the general form divides by it.
        if self.shape.abs() < 1e-9 {
            return -libm::log(self.scale) - excess / self.scale;
        }
        let inside = 1.0 + self.shape * excess / self.scale;
        // Beyond the end of a bounded tail, the likelihood is 0.
        if inside <= 0.0 {
            return f64::NEG_INFINITY;
        }
        -libm::log(self.scale) - (1.0 + 1.0 / self.shape) * libm::log(inside)
    }

    /// Returns the share of excesses above a value.
    pub fn beyond(&self, excess: f64) -> f64 {
        if excess <= 0.0 {
            return 1.0;
        }
        if self.shape.abs() < 1e-9 {
            return libm::exp(-excess / self.scale);
        }
        // A bounded tail ends, and a negative base would give NaN.
        let inside = (1.0 + self.shape * excess / self.scale).max(0.0);
        libm::pow(inside, -1.0 / self.shape)
    }
}

/// Rates at which events reach a size.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventTail {
    /// Size from which the tail is fitted.
    pub threshold: f64,
    /// Rate of events of at least the threshold, per 1,000 km or per cut-in.
    pub rate: f64,
    /// Distribution of sizes above the threshold.
    pub pareto: Pareto,
    /// Exposure in 1,000 km or in cut-ins.
    pub exposure: f64,
    /// Counts and intervals at ascending sizes.
    pub points: Vec<TailPoint>,
}

/// Counts and intervals of a tail at one size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TailPoint {
    /// Size of the events.
    pub at: f64,
    /// Recorded events of at least this size.
    pub count: u32,
    /// 95 % interval of the counted rate, vehicles resampled.
    pub counted: [f64; 2],
    /// 95 % interval of the tail's rate, vehicles resampled.
    pub tail: [f64; 2],
}

/// Source of a rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RateSource {
    /// Five or more recorded events.
    Counted,
    /// Fewer events: the fitted tail.
    Tail,
    /// No recorded event: the fitted tail, extrapolated.
    NeverSeen,
}

/// Rate of events of at least some size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct EventRate {
    /// Rate per 1,000 km or per cut-in.
    pub rate: f64,
    /// 95 % interval.
    pub interval: [f64; 2],
    /// Count, tail or extrapolation.
    pub source: RateSource,
    /// Upper bound by the rule of three where no event was seen.
    pub at_most: Option<f64>,
}

impl EventTail {
    /// Fits sizes of events, one list per vehicle, with an exposure.
    ///
    /// `at` lists ascending sizes to count at. `resampled` holds draws of vehicles with
    /// replacement, for the intervals. Returns `None` if too few events reach the
    /// threshold.
    pub fn fit(
        sizes: &[Vec<f64>],
        exposures: &[f64],
        threshold: f64,
        at: &[f64],
        resampled: &[Vec<usize>],
    ) -> Option<EventTail> {
        let all: Vec<usize> = (0..sizes.len()).collect();
        let (rate, pareto, exposure) = fitted(sizes, exposures, threshold, &all)?;
        let mut tails: Vec<Vec<f64>> = vec![Vec::new(); at.len()];
        let mut counts: Vec<Vec<f64>> = vec![Vec::new(); at.len()];
        for draw in resampled {
            let exposure: f64 = draw.iter().map(|i| exposures[*i]).sum();
            let tail = fitted(sizes, exposures, threshold, draw);
            for (k, size) in at.iter().enumerate() {
                counts[k].push(f64::from(count(sizes, draw, *size)) / exposure);
                // A draw with too few events still has counts.
                if let Some((rate, pareto, _)) = tail {
                    tails[k].push(rate * pareto.beyond(size - threshold));
                }
            }
        }
        let points = at
            .iter()
            .zip(tails.into_iter().zip(counts))
            .map(|(size, (tail, counted))| TailPoint {
                at: *size,
                count: count(sizes, &all, *size),
                counted: interval(counted),
                tail: interval(tail),
            });
        Some(EventTail {
            threshold,
            rate,
            pareto,
            exposure,
            points: points.collect(),
        })
    }

    /// Returns the rate of events of at least a size. It falls as the size grows.
    ///
    /// Below the threshold it is the rate at the threshold.
    pub fn rate_of(&self, size: f64) -> EventRate {
        let tail = self.rate * self.pareto.beyond(size - self.threshold).max(LEAST_SHARE);
        // The listed size at or below, so that the count is an upper bound.
        let after = self.points.partition_point(|point| point.at <= size + 1e-9);
        // Below the least listed size there is no count to state.
        let Some(point) = after.checked_sub(1).map(|i| self.points[i]) else {
            return EventRate {
                rate: tail,
                interval: [tail; 2],
                source: RateSource::Counted,
                at_most: None,
            };
        };
        if point.count >= COUNTED_FROM {
            return EventRate {
                rate: f64::from(point.count) / self.exposure,
                interval: point.counted,
                source: RateSource::Counted,
                at_most: None,
            };
        }
        let is_unseen = point.count == 0;
        // Never above the last count, so that a larger event is never less rare.
        let tail = tail.min(self.last_counted());
        // Intervals of the listed size, moved along the tail to the size itself.
        let there = self.rate
            * self
                .pareto
                .beyond(point.at - self.threshold)
                .max(LEAST_SHARE);
        EventRate {
            rate: tail,
            interval: point.tail.map(|it| it * tail / there),
            source: if is_unseen {
                RateSource::NeverSeen
            } else {
                RateSource::Tail
            },
            at_most: is_unseen.then(|| self.supported()),
        }
    }

    /// Returns the rate at the largest size with five events.
    fn last_counted(&self) -> f64 {
        let mut points = self.points.iter().rev();
        let last = points.find(|point| point.count >= COUNTED_FROM);
        last.map_or(f64::INFINITY, |it| f64::from(it.count) / self.exposure)
    }

    /// Returns the least rate that the exposure supports, by the rule of three.
    pub fn supported(&self) -> f64 {
        3.0 / self.exposure
    }
}

impl Display for EventRate {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [least, most] = self.interval.map(number);
        write!(f, "{} ", number(self.rate))?;
        match self.source {
            RateSource::Counted => write!(f, "(counted, 95 %: {least} to {most})"),
            RateSource::Tail => write!(f, "(tail, 95 %: {least} to {most})"),
            RateSource::NeverSeen => {
                write!(f, "(extrapolated, 95 %: {least} to {most}; never seen")?;
                match self.at_most {
                    Some(bound) => write!(f, ": below {})", number(bound)),
                    None => write!(f, ")"),
                }
            }
        }
    }
}

/// Formats a number with two significant digits.
fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = (1.0 - libm::floor(libm::log10(value.abs()))).clamp(0.0, 12.0);
    format!("{value:.0$}", digits as usize)
}

fn count(sizes: &[Vec<f64>], draw: &[usize], size: f64) -> u32 {
    let of = |i: &usize| sizes[*i].iter().filter(|it| size <= **it).count();
    draw.iter().map(of).sum::<usize>() as u32
}

/// Returns rate, distribution and exposure of a draw of vehicles.
fn fitted(
    sizes: &[Vec<f64>],
    exposures: &[f64],
    threshold: f64,
    draw: &[usize],
) -> Option<(f64, Pareto, f64)> {
    let exposure: f64 = draw.iter().map(|i| exposures[*i]).sum();
    let excesses: Vec<f64> = draw
        .iter()
        .flat_map(|i| sizes[*i].iter())
        .filter(|it| threshold <= **it)
        .map(|it| it - threshold)
        .collect();
    let pareto = Pareto::fit(&excesses)?;
    Some((excesses.len() as f64 / exposure, pareto, exposure))
}

fn interval(mut values: Vec<f64>) -> [f64; 2] {
    if values.is_empty() {
        // No draw had enough events, so nothing is known.
        return [0.0, f64::INFINITY];
    }
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values[(share * (values.len() - 1) as f64).round() as usize];
    [at(0.025), at(0.975)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_fit_finds_the_tail_that_made_the_data() {
        let truth = Pareto {
            shape: 0.21,
            scale: 0.37,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let draw = |_| {
            let share: f64 = 1.0 - rng.random::<f64>();
            truth.scale * (libm::pow(share, -truth.shape) - 1.0) / truth.shape
        };
        let excesses: Vec<f64> = (0..20_000).map(draw).collect();
        let found = Pareto::fit(&excesses).expect("enough");
        assert!((found.shape - truth.shape).abs() < 0.03, "{found:?}");
        assert!((found.scale - truth.scale).abs() < 0.02, "{found:?}");
        let beyond = |x: f64| excesses.iter().filter(|it| x < **it).count() as f64 / 20_000.0;
        for x in [0.5, 1.0, 2.0] {
            assert!((found.beyond(x) / beyond(x) - 1.0).abs() < 0.15, "{x}");
        }
    }

    #[test]
    fn counts_win_over_the_tail_where_there_are_five() {
        // Ten vehicles of 100 km; 20 events of 1.5, six of 2.5 and one of 3.5.
        let mut sizes = vec![vec![1.5, 1.5]; 10];
        for vehicle in &mut sizes[..6] {
            vehicle.push(2.5);
        }
        sizes[0].push(3.5);
        let draws: Vec<Vec<usize>> = (0..50)
            .map(|k| (0..10).map(|i| (i * 7 + k) % 10).collect())
            .collect();
        let tail = EventTail::fit(&sizes, &[0.1; 10], 1.0, &[1.0, 2.0, 3.0, 4.0], &draws)
            .expect("27 events");
        let rate = |size: f64| tail.rate_of(size);
        assert!((rate(2.0).rate - 7.0).abs() < 1e-9);
        assert_eq!(rate(2.0).source, RateSource::Counted);
        assert_eq!(rate(3.0).source, RateSource::Tail);
        assert_eq!(rate(4.0).source, RateSource::NeverSeen);
        assert!(rate(4.0).at_most.is_some_and(|it| (it - 3.0).abs() < 1e-9));
        assert!(rate(5.0).rate < rate(4.0).rate);
    }
}
