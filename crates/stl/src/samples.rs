//! Borrowed samples: whole columns, read in place.

use std::sync::Arc;

use crate::interval::Interval;
use crate::leaf::{Columns, Semantics};
use crate::monitor::Monitor;
use crate::offline::Scratch;
use crate::trace::{RowError, Schema};

/// Run whose columns are borrowed, such as arrays of another language.
///
/// Use [`Trace`](crate::trace::Trace) to collect samples, and this type for
/// samples that already exist. Nothing is copied, and monitors give the same bits.
///
/// ```
/// use std::sync::Arc;
/// use brakecheck_stl::trace::{Schema, Signal};
/// use brakecheck_stl::{Constants, Formula, Samples, Scratch};
///
/// let schema = Arc::new(Schema::new(1.0, [Signal::real("gap", "m", "clearance")])?);
/// let gaps = [3.0, 2.0, 4.0];
/// let samples = Samples::new(Arc::clone(&schema), vec![&gaps[..]])?;
/// let formula: Formula = "always (gap >= 1.5)".parse()?;
/// let monitor = formula.bind(&schema, &Constants::new())?;
/// assert_eq!(monitor.robustness_of(&samples, &mut Scratch::new()), 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    schema: Arc<Schema>,
    columns: Vec<&'a [f64]>,
    len: usize,
}

/// Error in the columns of a run.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ColumnsError {
    /// The number of columns differs from the number of signals.
    #[error("{got} columns for {want} signals")]
    Count {
        /// Number of columns.
        got: usize,
        /// Number of signals in the schema.
        want: usize,
    },
    /// Columns have unequal lengths.
    #[error("`{signal}` has {got} samples, the signals before it {want}")]
    Length {
        /// First signal of another length.
        signal: String,
        /// Number of its samples.
        got: usize,
        /// Number of samples of the first signal.
        want: usize,
    },
    /// A value is NaN or infinite.
    #[error(transparent)]
    Value(#[from] RowError),
}

impl<'a> Samples<'a> {
    /// Creates samples from a column per signal, in the order of the schema.
    ///
    /// # Errors
    /// The number of columns or their lengths do not fit, or a value is NaN or
    /// infinite.
    pub fn new(schema: Arc<Schema>, columns: Vec<&'a [f64]>) -> Result<Samples<'a>, ColumnsError> {
        if columns.len() != schema.len() {
            return Err(ColumnsError::Count {
                got: columns.len(),
                want: schema.len(),
            });
        }
        let len = columns.first().map_or(0, |column| column.len());
        for (column, signal) in columns.iter().zip(schema.signals()) {
            if column.len() != len {
                return Err(ColumnsError::Length {
                    signal: signal.name.clone(),
                    got: column.len(),
                    want: len,
                });
            }
            // Without an early exit, this check is a few vector instructions per chunk.
            let finite = |part: &[f64]| part.iter().fold(true, |all, x| all & x.is_finite());
            if !column.chunks(4096).all(finite) {
                // Only a refused column is searched for the place of the error.
                let refused = column.iter().position(|value| !value.is_finite());
                let sample = refused.unwrap_or(0);
                return Err(ColumnsError::Value(RowError::NotFinite {
                    signal: signal.name.clone(),
                    value: column[sample],
                    sample,
                }));
            }
        }
        Ok(Samples {
            schema,
            columns,
            len,
        })
    }

    /// Returns the declared signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl Columns for Samples<'_> {
    fn column(&self, signal: usize) -> &[f64] {
        self.columns[signal]
    }
}

impl Monitor {
    /// Computes [`Monitor::robustness`] of borrowed samples.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_of(&self, samples: &Samples<'_>, scratch: &mut Scratch) -> f64 {
        self.check(&samples.schema);
        self.clamp(self.value(samples, samples.len, Semantics::Margin, scratch))
    }

    /// Computes [`Monitor::satisfied`] of borrowed samples.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn satisfied_of(&self, samples: &Samples<'_>, scratch: &mut Scratch) -> bool {
        self.check(&samples.schema);
        self.value(samples, samples.len, Semantics::Truth, scratch) > 0.0
    }

    /// Computes [`Monitor::robustness_into`] of borrowed samples.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn robustness_of_all(&self, samples: &Samples<'_>, all: &mut Vec<f64>) {
        self.check(&samples.schema);
        self.all_values(samples, samples.len, &mut Scratch::new(), all);
    }

    /// Computes [`Monitor::interval`] of borrowed samples.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn interval_of(&self, samples: &Samples<'_>, scratch: &mut Scratch) -> Interval {
        self.check(&samples.schema);
        self.still_possible(samples, samples.len, scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Signal, Trace};
    use crate::{Constants, Formula};

    fn schema() -> Arc<Schema> {
        let signals = ["x", "y"].map(|name| Signal::real(name, "m", "where it is"));
        Arc::new(Schema::new(0.5, signals).expect("two names"))
    }

    #[test]
    fn borrowed_samples_give_the_bits_of_a_trace() {
        let schema = schema();
        let x: Vec<f64> = (0..40).map(|i| f64::from(i * 7 % 11) - 3.3).collect();
        let y: Vec<f64> = (0..40).map(|i| f64::from(i * 5 % 13) - 6.1).collect();
        let mut trace = Trace::new(Arc::clone(&schema));
        for (x, y) in x.iter().zip(&y) {
            trace.push(&[*x, *y]).expect("finite");
        }
        let samples = Samples::new(Arc::clone(&schema), vec![&x, &y]).expect("finite");
        for text in [
            "always (x > y)",
            "eventually[1, 3] (x + y > 2 and y < 1)",
            "(x > 0) until[0, 5] (y > 5)",
        ] {
            let formula: Formula = text.parse().expect("a formula");
            let monitor = formula.bind(&schema, &Constants::new()).expect("bound");
            let scratch = &mut Scratch::new();
            let value = monitor.robustness(&trace, scratch);
            assert_eq!(monitor.robustness_of(&samples, scratch), value, "{text}");
            let holds = monitor.satisfied(&trace, scratch);
            assert_eq!(monitor.satisfied_of(&samples, scratch), holds, "{text}");
            let mut all = Vec::new();
            monitor.robustness_of_all(&samples, &mut all);
            assert_eq!(all, monitor.robustness_all(&trace), "{text}");
            let open = monitor.interval(&trace, scratch);
            assert_eq!(monitor.interval_of(&samples, scratch), open, "{text}");
            let why = monitor.explain(&trace).to_string();
            assert_eq!(monitor.explain_of(&samples).to_string(), why, "{text}");
        }
    }

    #[test]
    fn columns_that_are_no_run_are_refused() {
        let good = [1.0, 2.0, 3.0];
        let nan = [1.0, 2.0, f64::NAN];
        let cases: [(&[&[f64]], &str); 3] = [
            (&[&good], "1 columns for 2 signals"),
            (
                &[&good, &good[..2]],
                "`y` has 2 samples, the signals before it 3",
            ),
            (
                &[&good, &nan],
                "`y` is NaN at sample 2: traces hold finite numbers only",
            ),
        ];
        for (columns, said) in cases {
            let error = Samples::new(schema(), columns.to_vec()).expect_err(said);
            assert_eq!(error.to_string(), said);
        }
    }
}
