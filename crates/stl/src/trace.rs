//! Traces: named, unit-carrying, finite, uniformly sampled signals.
//!
//! A [`Schema`] declares the signals once. A [`Trace`] contains their values,
//! column by column, at `t = i · dt`. These two types are the common
//! representation of a run: scenes publish rows, monitors read columns.
//!
//! Architecture Invariant: every value of a trace is finite. A NaN or an infinity
//! is an error at [`Trace::push`], never a robustness or a reward.
//!
//! ```
//! use brakecheck_stl::trace::{Schema, Signal, Trace};
//!
//! let schema = Schema::new(0.1, [Signal::real("headway", "m", "front to front")])?;
//! let mut trace = Trace::new(schema.into());
//! trace.push(&[12.5])?;
//! assert_eq!(trace.column(0), [12.5]);
//! assert!(trace.push(&[f64::NAN]).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Reading of a signal in a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SignalKind {
    /// Number, whose robustness is in its unit.
    Real,
    /// Truth value, 1 for true and 0 for false.
    ///
    /// The robustness is ±inf before clamping.
    Boolean,
}

/// Declared signal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Signal {
    /// Name in dotted lower case, such as `ego.speed`.
    pub name: String,
    /// SI unit as displayed, such as `m/s`, empty for dimensionless.
    pub unit: Cow<'static, str>,
    /// Meaning, in a single sentence.
    pub about: String,
    /// Real or Boolean.
    pub kind: SignalKind,
}

impl Signal {
    /// Declares a real-valued signal.
    pub fn real(
        name: impl Into<String>,
        unit: impl Into<Cow<'static, str>>,
        about: impl Into<String>,
    ) -> Signal {
        Signal {
            name: name.into(),
            unit: unit.into(),
            about: about.into(),
            kind: SignalKind::Real,
        }
    }

    /// Declares a Boolean signal, published as 1 or 0.
    pub fn boolean(name: impl Into<String>, about: impl Into<String>) -> Signal {
        Signal {
            name: name.into(),
            unit: "".into(),
            about: about.into(),
            kind: SignalKind::Boolean,
        }
    }
}

/// Error in the declaration of a schema.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SchemaError {
    /// Two signals have the same name.
    #[error("the signal `{name}` is declared twice")]
    Duplicate {
        /// Repeated name.
        name: String,
    },
    /// The sampling period is not positive and finite.
    #[error("the sampling period must be positive and finite, not {dt_s} s")]
    Period {
        /// Refused period.
        dt_s: f64,
    },
}

/// Declared signals of a trace with its sampling period.
///
/// Cheap to clone, since clones share the declaration.
#[derive(Clone, Debug)]
pub struct Schema {
    dt_s: f64,
    declared: Arc<SchemaSignals>,
}

#[derive(Debug)]
struct SchemaSignals {
    signals: Vec<Signal>,
    index: HashMap<String, usize>,
}

impl Schema {
    /// Declares `signals`, sampled every `dt_s` seconds.
    ///
    /// # Errors
    /// A repeated name, or a period that is not positive and finite.
    pub fn new(
        dt_s: f64,
        signals: impl IntoIterator<Item = Signal>,
    ) -> Result<Schema, SchemaError> {
        // Negated, so that NaN is refused as well.
        if !(dt_s.is_finite() && dt_s > 0.0) {
            return Err(SchemaError::Period { dt_s });
        }
        let signals: Vec<Signal> = signals.into_iter().collect();
        let mut index = HashMap::with_capacity(signals.len());
        for (i, signal) in signals.iter().enumerate() {
            if index.insert(signal.name.clone(), i).is_some() {
                return Err(SchemaError::Duplicate {
                    name: signal.name.clone(),
                });
            }
        }
        Ok(Schema {
            dt_s,
            declared: Arc::new(SchemaSignals { signals, index }),
        })
    }

    /// Returns the sampling period in seconds.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// Returns the signals in declaration order (the order of a row).
    pub fn signals(&self) -> &[Signal] {
        &self.declared.signals
    }

    /// Returns the position of a signal in a row.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.declared.index.get(name).copied()
    }

    /// Returns the number of signals in a row.
    pub fn len(&self) -> usize {
        self.declared.signals.len()
    }

    /// Returns true if no signal is declared.
    pub fn is_empty(&self) -> bool {
        self.declared.signals.is_empty()
    }

    /// Returns true if names, their order and the sampling period are equal.
    ///
    /// Units, kinds and descriptions may differ. The test takes constant time for
    /// clones of a schema, which a run and its monitors nearly always have.
    pub(crate) fn has_rows_of(&self, other: &Schema) -> bool {
        self.dt_s == other.dt_s && (self.is_clone_of(other) || self.names().eq(other.names()))
    }

    /// Returns the signals' names, in declaration order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.signals().iter().map(|signal| signal.name.as_str())
    }

    fn is_clone_of(&self, other: &Schema) -> bool {
        Arc::ptr_eq(&self.declared, &other.declared)
    }

    /// Checks that row number `sample` has a finite value per signal.
    ///
    /// # Errors
    /// A NaN, an infinity or a wrong length.
    pub fn check_row(&self, row: &[f64], sample: usize) -> Result<(), RowError> {
        if row.len() != self.len() {
            return Err(RowError::Length {
                got: row.len(),
                want: self.len(),
                sample,
            });
        }
        // Without an early exit, this check is a few vector instructions. Every monitor
        // of a run repeats it.
        if row.iter().fold(true, |all, value| all & value.is_finite()) {
            return Ok(());
        }
        let refused = row.iter().position(|value| !value.is_finite());
        refused.map_or(Ok(()), |i| {
            Err(RowError::NotFinite {
                signal: self.signals()[i].name.clone(),
                value: row[i],
                sample,
            })
        })
    }
}

impl PartialEq for Schema {
    fn eq(&self, other: &Schema) -> bool {
        // Clones of a schema are common, and comparing pointers is cheaper.
        let same = || self.is_clone_of(other) || self.signals() == other.signals();
        self.dt_s == other.dt_s && same()
    }
}

/// Value that is not finite, or row of the wrong length.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RowError {
    /// A value is NaN or infinite.
    #[error("`{signal}` is {value} at sample {sample}: traces hold finite numbers only")]
    NotFinite {
        /// Name of the signal.
        signal: String,
        /// Refused value.
        value: f64,
        /// Sample index that the row would have had.
        sample: usize,
    },
    /// The row does not match the schema.
    #[error("a row of {got} values for {want} signals at sample {sample}")]
    Length {
        /// Number of values in the row.
        got: usize,
        /// Number of signals in the schema.
        want: usize,
        /// Sample index that the row would have had.
        sample: usize,
    },
}

/// Run with a finite value per signal and sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    schema: Arc<Schema>,
    columns: Vec<Vec<f64>>,
    len: usize,
}

impl Trace {
    /// Creates an empty trace.
    pub fn new(schema: Arc<Schema>) -> Trace {
        let columns = vec![Vec::new(); schema.len()];
        Trace {
            schema,
            columns,
            len: 0,
        }
    }

    /// Appends a sample of every signal, in schema order.
    ///
    /// # Errors
    /// A NaN, an infinity or a wrong length. The trace is then unchanged.
    pub fn push(&mut self, row: &[f64]) -> Result<(), RowError> {
        // Before any column changes, so that an error leaves them all equally long.
        self.schema.check_row(row, self.len)?;
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.push(*value);
        }
        self.len += 1;
        Ok(())
    }

    /// Removes all samples and keeps the memory.
    pub fn clear(&mut self) {
        for column in &mut self.columns {
            column.clear();
        }
        self.len = 0;
    }

    /// Keeps the first `len` samples.
    pub fn truncate(&mut self, len: usize) {
        for column in &mut self.columns {
            column.truncate(len);
        }
        self.len = self.len.min(len);
    }

    /// Returns the declared signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    /// Returns the sampling period in seconds.
    pub fn dt_s(&self) -> f64 {
        self.schema.dt_s
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns all samples of the `signal`-th signal.
    pub fn column(&self, signal: usize) -> &[f64] {
        &self.columns[signal]
    }

    /// Returns all samples of a signal by name.
    pub fn signal(&self, name: &str) -> Option<&[f64]> {
        self.schema.position(name).map(|i| self.column(i))
    }

    /// Copies the `sample`-th row into `row`.
    pub fn read_row(&self, sample: usize, row: &mut [f64]) {
        for (value, column) in row.iter_mut().zip(&self.columns) {
            *value = column[sample];
        }
    }
}
