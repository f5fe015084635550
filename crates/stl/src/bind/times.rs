//! Exact conversion of bounds to samples.

use std::ops::Range;

use super::{Binder, not_finite};
use crate::error::{StlError, suggest};
use crate::number::Ratio;
use crate::syntax::{Arithmetic, Time, TimeBounds, TimeKind, TimeUnit};
use crate::trace_operators::SampleWindow;

impl Binder<'_> {
    pub(super) fn window(&self, bounds: Option<&TimeBounds>) -> Result<SampleWindow, StlError> {
        let Some(bounds) = bounds else {
            return Ok(SampleWindow { from: 0, to: None });
        };
        let from_s = self.time(&bounds.from)?;
        let from = self.samples(from_s, &bounds.from)?;
        let Some(to) = &bounds.to else {
            return Ok(SampleWindow { from, to: None });
        };
        let to_s = self.time(to)?;
        let to_samples = self.samples(to_s, to)?;
        // Compared in samples, since each end may have been rounded on its own.
        if to_samples < from {
            let what = format!("the window ends at {to_s} s, before it begins at {from_s} s");
            let error = StlError::new(what, bounds.span.0.clone(), "empty");
            return Err(
                // `[1, 500 ms]` is the usual cause, so the help explains units.
                error.maybe_help((!has_unit(&bounds.from) && has_unit(to)).then(|| {
                    "a bound without a unit is in seconds, whatever the unit of the other one"
                        .to_owned()
                })),
            );
        }
        Ok(SampleWindow {
            from,
            to: Some(to_samples),
        })
    }

    fn time(&self, time: &Time) -> Result<Ratio, StlError> {
        let value = match &time.kind {
            TimeKind::Literal(value, unit) => {
                value.ratio().and_then(|value| in_seconds(value, *unit))
            }
            TimeKind::Name(name, unit) => {
                let value = self.constant(name, time.span.0.clone())?;
                // A constant arrives as an f64, so 0.1 must become 1/10 again.
                Ratio::from_f64(value).and_then(|value| in_seconds(value, *unit))
            }
            // The sign is checked at the end: a negative summand of a positive bound is
            // fine.
            TimeKind::Negative(a) => self.time(a)?.neg(),
            TimeKind::Calculated(op, sides) => {
                let (a, b) = (self.time(&sides.0)?, self.time(&sides.1)?);
                match op {
                    Arithmetic::Add => a.add(b),
                    Arithmetic::Subtract => a.sub(b),
                    Arithmetic::Multiply => a.mul(b),
                    Arithmetic::Divide => a.div(b),
                }
            }
        };
        value.ok_or_else(|| {
            StlError::new(
                format!("`{time}` is no time that can be counted exactly"),
                time.span.0.clone(),
                "not a time",
            )
        })
    }

    fn constant(&self, name: &str, span: Range<usize>) -> Result<f64, StlError> {
        let scope = &self.scope;
        match scope.names.constants.get(name) {
            Some(value) if value.is_finite() => Ok(*value),
            Some(value) => Err(not_finite(name, *value, span)),
            // A common confusion, so it gets a message of its own.
            None if scope.schema.position(name).is_some() => {
                let what = format!("`{name}` is a signal; a bound cannot change with time");
                Err(StlError::new(what, span, "not a constant"))
            }
            None => {
                let constants = scope.names.constants.keys().map(String::as_str);
                let error = StlError::new(
                    format!("there is no constant `{name}`"),
                    span,
                    "unknown constant",
                );
                let none = "write a number; a window to the end of the trace is `[0, end]`";
                let help = suggest(name, "constants", constants);
                Err(error.with_help(help.unwrap_or_else(|| none.to_owned())))
            }
        }
    }

    /// Returns a time as a number of samples, exactly.
    fn samples(&self, value: Ratio, time: &Time) -> Result<usize, StlError> {
        let span = time.span.0.clone();
        if value.is_negative() {
            let what = format!("a bound cannot be negative, and this is {value} s");
            return Err(StlError::new(what, span, "negative")
                .with_help("look back with `once`, `historically` or `since`"));
        }
        let limit = self.settings.limits.horizon_samples;
        let too_far = || {
            let what = format!(
                "{value} s is more than {limit} samples of {} s",
                self.period
            );
            StlError::new(what, span.clone(), "too far")
                .with_help("`end` means to the end of the trace")
        };
        // A quotient that does not fit is certainly beyond the limit.
        let samples = value.div(self.period).ok_or_else(too_far)?;
        let rounded = nearest(samples).or_else(|| written(samples, value, self.period));
        let whole = rounded.unwrap_or_else(|| samples.floor());
        // Rounding further would silently change the formula, so neighbours are suggested.
        if rounded.is_none() {
            let beside = |n: i128| {
                let time = Ratio::new(n, 1).and_then(|n| n.mul(self.period));
                time.map_or_else(|| "?".to_owned(), |time| time.to_string())
            };
            return Err(StlError::new(
                format!(
                    "{value} s is not a multiple of the sampling period {} s",
                    self.period
                ),
                span.clone(),
                "between two samples",
            )
            .with_help(format!(
                "the neighbours are {} s and {} s: write one of them, or resample the trace",
                beside(whole),
                beside(whole + 1)
            )));
        }
        usize::try_from(whole)
            .ok()
            .filter(|n| *n <= limit)
            .ok_or_else(too_far)
    }
}

/// Largest share by which a bound may be off a multiple of the sampling period.
///
/// It is that of a period or a bound that was written with seven digits.
const ROUNDED: f64 = 1e-6;

/// Returns the whole number of samples, `None` if it is not within [`ROUNDED`].
fn nearest(samples: Ratio) -> Option<i128> {
    let (value, below) = (samples.to_f64(), samples.floor());
    let off = |n: i128| (value - n as f64).abs();
    let whole = if off(below) <= off(below + 1) {
        below
    } else {
        below + 1
    };
    // Never by a noticeable part of a sample, however long the bound is.
    let is_near = off(whole) <= (ROUNDED * value).min(1e-3);
    // Zero is never a rounding, or a short bound would become the present sample.
    (samples.is_whole() || (is_near && whole > 0)).then_some(whole)
}

/// Returns the sample whose time is the bound if it is rounded to as many digits.
///
/// So 0.033 s is a sample of 30 Hz. Rounding is that to milliseconds or finer, and always
/// less than a tenth of a period.
fn written(samples: Ratio, value: Ratio, period: Ratio) -> Option<i128> {
    let below = samples.floor();
    let (value_s, period_s) = (value.to_f64(), period.to_f64());
    (3..=9).find_map(|digits| {
        let power = f64::from(10_u32.pow(digits));
        let in_units = (value_s * power).round();
        let is_written = (value_s * power - in_units).abs() < 1e-4;
        let is_fine = 0.5 / power <= 0.1 * period_s;
        let is_it = |n: &i128| *n > 0 && (*n as f64 * period_s * power).round() == in_units;
        let sample = [below, below + 1].into_iter().find(is_it);
        sample.filter(|_| is_written && is_fine)
    })
}

fn in_seconds(value: Ratio, unit: Option<TimeUnit>) -> Option<Ratio> {
    value.div(Ratio::new(unit.map_or(1, |unit| unit.per_second()), 1)?)
}

fn has_unit(time: &Time) -> bool {
    matches!(
        time.kind,
        TimeKind::Literal(_, Some(_)) | TimeKind::Name(_, Some(_))
    )
}
