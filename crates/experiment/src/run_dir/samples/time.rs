//! Columns of times: which they are, and the period of their stamps.

use brakecheck_stl::sampling::{EvenSampling, MOST_OFF, TimeName, time_name, time_rank};

use super::error::SamplesError;

/// Deviation from even sampling that counts as none, as a share of the period.
pub(super) const UNEVEN: f64 = 1e-3;

/// Digits behind the point from which stamps count as not rounded.
const FULL_DIGITS: usize = 7;

/// Column of times.
pub(super) struct TimeIndex {
    pub(super) column: usize,
    pub(super) unit_s: f64,
}

/// Returns the columns that are times by their names, the most usual name first.
///
/// The column `given` alone is one if it has a name. `needs_time`: none is an error.
pub(super) fn time_columns(
    names: &mut [String],
    given: Option<&str>,
    needs_time: bool,
) -> Result<Vec<TimeIndex>, SamplesError> {
    let columns = || names.join("`, `");
    if let Some(given) = given {
        // A column is asked for with its unit or without.
        let is_given = |it: &String| it == given || bare(it) == given;
        let named = names.iter().position(is_given);
        let column = named.ok_or_else(|| SamplesError::NoSuchTime {
            column: given.to_owned(),
            columns: columns(),
        })?;
        // A name that is no usual one is in seconds, unless it ends with its unit.
        let unit_s = known_time(&names[column])?.map_or(1.0, |it| it.unit_s);
        return Ok(vec![TimeIndex { column, unit_s }]);
    }
    let mut found = Vec::new();
    let mut shortened = Vec::new();
    for (column, name) in names.iter().enumerate() {
        if let Some(time) = known_time(name)? {
            found.push((
                time_rank(&time.name),
                TimeIndex {
                    column,
                    unit_s: time.unit_s,
                },
            ));
            shortened.push((column, time.name));
        }
    }
    if found.is_empty() && needs_time {
        return Err(SamplesError::NoTime { columns: columns() });
    }
    // Only here, because the errors above show the names as the file has them.
    for (column, name) in shortened {
        names[column] = name;
    }
    // The sort is stable, so equal ranks keep the order of the columns.
    found.sort_by_key(|(rank, _)| *rank);
    Ok(found.into_iter().map(|(_, time)| time).collect())
}

fn bare(name: &str) -> &str {
    name.split(['[', '(']).next().unwrap_or(name).trim_end()
}

fn known_time(name: &str) -> Result<Option<TimeName>, SamplesError> {
    time_name(name).map_err(|unit| SamplesError::TimeUnit {
        column: name.to_owned(),
        unit: unit.0,
    })
}

/// Period of a time column, and how far its stamps are off.
#[derive(Clone, Copy)]
pub(super) struct TimeFit {
    pub(super) dt_s: f64,
    pub(super) off_s: f64,
}

/// Times of a column, with what their notation says.
pub(super) struct StampColumn<'a> {
    pub(super) name: &'a str,
    /// Time of each sample.
    pub(super) times_s: Vec<f64>,
    /// Unit in which the column is written.
    pub(super) unit_s: f64,
    /// Most digits behind the point.
    pub(super) digits: usize,
    /// Line of each sample.
    pub(super) lines: &'a [usize],
}

impl StampColumn<'_> {
    /// Fits the period of a time column, which must be even.
    ///
    /// It has at least two times.
    pub(super) fn fit(&self) -> Result<TimeFit, SamplesError> {
        // Times of such a size have lost their digits, and would only look uneven.
        if let Some(error) = self.other_epoch() {
            return Err(error);
        }
        let Some(fit) = EvenSampling::fit(&self.times_s) else {
            return Err(self.odd_step());
        };
        let most_s = UNEVEN * fit.dt_s + rounding_s(&self.times_s, self.digits, self.unit_s);
        let is_even = fit.off_s <= most_s.min(MOST_OFF * fit.dt_s);
        // More periods than steps mean missing samples, which a trace cannot have.
        if fit.periods as usize != self.times_s.len() - 1 || !is_even {
            return Err(self.odd_step());
        }
        Ok(TimeFit {
            dt_s: fit.dt_s,
            off_s: fit.off_s,
        })
    }

    /// Returns an error for times after the year 5000, which are those of a finer unit.
    fn other_epoch(&self) -> Option<SamplesError> {
        let time_s = self.times_s.iter().fold(0.0_f64, |most, it| most.max(*it));
        // Seconds since 1970 have ten digits for centuries, so more are of a finer unit.
        let units = [(1e17, "ns"), (1e14, "µs"), (1e11, "ms")];
        let (_, unit) = units.into_iter().find(|(from_s, _)| time_s > *from_s)?;
        Some(SamplesError::Epoch {
            column: self.name.to_owned(),
            time_s,
            unit,
        })
    }

    /// First time that does not follow from the previous time.
    ///
    /// The mean period is no reference: one long step changes it, and even
    /// samples would be reported. The median step is not affected.
    fn odd_step(&self) -> SamplesError {
        let times_s = &self.times_s;
        let steps = || times_s.windows(2).map(|two| two[1] - two[0]);
        let mut sorted: Vec<f64> = steps().collect();
        sorted.sort_by(f64::total_cmp);
        // Invariant: `fit` has at least two times, so there is a step.
        let usual_s = sorted[(sorted.len() - 1) / 2];
        let off = |step_s: f64| (step_s - usual_s).abs();
        let not_later = times_s.windows(2).position(|two| two[1] <= two[0]);
        // Rounding makes steps differ a little, so the first clear difference is named.
        let clear_s = off(steps().fold(
            usual_s,
            |worst, it| {
                if off(it) > off(worst) { it } else { worst }
            },
        ));
        let odd = steps().position(|it| off(it) >= 0.5 * clear_s && off(it) > UNEVEN * usual_s);
        let at = not_later.or(odd).unwrap_or(0);
        let (before, found, line) = (times_s[at], times_s[at + 1], self.lines[at + 1]);
        if found <= before {
            return SamplesError::NotLater {
                line,
                found,
                before,
            };
        }
        SamplesError::Uneven {
            line,
            found,
            expected: tidy(before + usual_s),
        }
    }
}

/// Returns the distance from an instant that the notation of its stamp causes.
fn rounding_s(times_s: &[f64], digits: usize, unit_s: f64) -> f64 {
    let most_s = times_s.iter().fold(0.0_f64, |most, it| most.max(it.abs()));
    let written_s = if digits < FULL_DIGITS {
        // Half of the last digit, with room for the binary fraction of the stamp.
        0.51 * unit_s / f64::from(10_u32.pow(digits as u32))
    } else {
        0.0
    };
    // Single precision has 24 bits, and prints nine digits of them.
    let is_single = |it: &f64| {
        let single = *it as f32;
        f64::from(single) == *it || format!("{single}").parse() == Ok(*it)
    };
    let single_s = if times_s.iter().all(is_single) {
        most_s * f64::from(f32::EPSILON)
    } else {
        0.0
    };
    // Stamps are scaled and subtracted, which costs some of the last bits.
    written_s.max(single_s) + 4.0 * f64::EPSILON * most_s
}

/// Returns the digits behind the point of a written number.
pub(super) fn digits_of(text: &str) -> usize {
    // An exponent moves the point, so the digits behind it show no rounding.
    if text.contains(['e', 'E']) {
        return FULL_DIGITS;
    }
    let behind = text.split_once(['.', ',']).map_or("", |(_, part)| part);
    behind.bytes().take_while(u8::is_ascii_digit).count()
}

/// Rounds to nine decimals, which removes the digits of binary fractions.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}
