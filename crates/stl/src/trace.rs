//! Traces: named, unit-carrying, finite, uniformly sampled signals.
//!
//! A [`Schema`] declares the signals once; a [`Trace`] holds their values,
//! column by column, at `t = i · dt`. Everything above agrees on a run through
//! these two types: scenes publish rows, monitors read columns.
//!
//! Architecture Invariant: every value of a trace is finite. A NaN or an
//! infinity is an error at [`Trace::push`], never a robustness or a reward.
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

/// How a signal is read by a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SignalKind {
    /// A number; robustness is in its unit.
    Real,
    /// 1 is true, 0 is false; robustness is ±inf before clamping.
    Boolean,
}

/// One declared signal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Signal {
    /// Dotted lower case, such as `ego.speed`.
    pub name: String,
    /// SI unit as displayed, such as `m/s`; empty for dimensionless.
    pub unit: Cow<'static, str>,
    /// What it means, in one sentence.
    pub about: String,
    /// Real or Boolean.
    pub kind: SignalKind,
}

impl Signal {
    /// A real-valued signal.
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

    /// A Boolean signal, published as 1 or 0.
    pub fn boolean(name: impl Into<String>, about: impl Into<String>) -> Signal {
        Signal {
            name: name.into(),
            unit: "".into(),
            about: about.into(),
            kind: SignalKind::Boolean,
        }
    }
}

/// A schema could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SchemaError {
    /// Two signals of one name.
    #[error("the signal `{name}` is declared twice")]
    Duplicate {
        /// The name in question.
        name: String,
    },
    /// A sampling period must be finite and positive.
    #[error("the sampling period must be positive and finite, not {dt_s} s")]
    Period {
        /// The refused period.
        dt_s: f64,
    },
}

/// The declared signals of a trace and its sampling period.
///
/// Cheap to clone: clones share the declaration.
#[derive(Clone, Debug)]
pub struct Schema {
    dt_s: f64,
    declared: Arc<Declared>,
}

#[derive(Debug)]
struct Declared {
    signals: Vec<Signal>,
    index: HashMap<String, usize>,
}

impl Schema {
    /// Declares `signals`, sampled every `dt_s` seconds.
    ///
    /// # Errors
    /// A repeated name; a period that is not positive and finite.
    pub fn new(
        dt_s: f64,
        signals: impl IntoIterator<Item = Signal>,
    ) -> Result<Schema, SchemaError> {
        if !(dt_s.is_finite() && 0.0 < dt_s) {
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
            declared: Arc::new(Declared { signals, index }),
        })
    }

    /// The sampling period in seconds.
    pub fn dt_s(&self) -> f64 {
        self.dt_s
    }

    /// The signals, in declaration order (the order of a row).
    pub fn signals(&self) -> &[Signal] {
        &self.declared.signals
    }

    /// The position of a signal in a row.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.declared.index.get(name).copied()
    }

    /// How many signals a row has.
    pub fn len(&self) -> usize {
        self.declared.signals.len()
    }

    /// Whether no signal is declared.
    pub fn is_empty(&self) -> bool {
        self.declared.signals.is_empty()
    }

    /// Whether rows and sampling periods mean the same: names, order, period.
    ///
    /// Units, kinds and descriptions may differ. Constant time for clones of
    /// one schema, which is what a run and its monitors nearly always have.
    pub(crate) fn has_rows_of(&self, other: &Schema) -> bool {
        self.dt_s == other.dt_s && (self.is_clone_of(other) || self.names().eq(other.names()))
    }

    /// The signals' names, in declaration order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.signals().iter().map(|signal| signal.name.as_str())
    }

    fn is_clone_of(&self, other: &Schema) -> bool {
        Arc::ptr_eq(&self.declared, &other.declared)
    }

    /// Whether `row`, the `sample`-th one, has a finite value per signal.
    ///
    /// # Errors
    /// A NaN, an infinity or a wrong length.
    pub(crate) fn check_row(&self, row: &[f64], sample: usize) -> Result<(), RowError> {
        if row.len() != self.len() {
            return Err(RowError::Length {
                got: row.len(),
                want: self.len(),
                sample,
            });
        }
        // Without an early exit this is a few vector instructions; every
        // monitor of a run asks it again.
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
        let same = || self.is_clone_of(other) || self.signals() == other.signals();
        self.dt_s == other.dt_s && same()
    }
}

/// A value that is no finite number, or a row of the wrong length.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RowError {
    /// NaN or infinite.
    #[error("`{signal}` is {value} at sample {sample}: traces hold finite numbers only")]
    NotFinite {
        /// The signal's name.
        signal: String,
        /// The refused value.
        value: f64,
        /// The sample index the row would have had.
        sample: usize,
    },
    /// The row does not match the schema.
    #[error("a row of {got} values for {want} signals at sample {sample}")]
    Length {
        /// Values in the row.
        got: usize,
        /// Signals in the schema.
        want: usize,
        /// The sample index the row would have had.
        sample: usize,
    },
}

/// A run: one finite value per signal and sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    schema: Arc<Schema>,
    columns: Vec<Vec<f64>>,
    len: usize,
}

impl Trace {
    /// An empty trace.
    pub fn new(schema: Arc<Schema>) -> Trace {
        let columns = vec![Vec::new(); schema.len()];
        Trace {
            schema,
            columns,
            len: 0,
        }
    }

    /// Appends one sample of every signal, in schema order.
    ///
    /// # Errors
    /// A NaN, an infinity or a wrong length; the trace is then unchanged.
    pub fn push(&mut self, row: &[f64]) -> Result<(), RowError> {
        self.schema.check_row(row, self.len)?;
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.push(*value);
        }
        self.len += 1;
        Ok(())
    }

    /// Forgets all samples and keeps the memory.
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

    /// The declared signals.
    pub fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    /// The sampling period in seconds.
    pub fn dt_s(&self) -> f64 {
        self.schema.dt_s
    }

    /// How many samples there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// All samples of the `signal`-th signal.
    pub fn column(&self, signal: usize) -> &[f64] {
        &self.columns[signal]
    }

    /// All samples of a signal by name.
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
