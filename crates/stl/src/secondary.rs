//! Secondary signals (Sec. II): the margins of a formula's leaves.
//!
//! Logic applies only minimum, maximum and sign to them. A robustness therefore
//! never moves by more than the leaf that moves most: Lemma 1.

use crate::apply::EvalWindow;
use crate::leaf::Semantics;
use crate::monitor::Monitor;
use crate::offline::Scratch;
use crate::program::{Id, MinMax, Op};
use crate::trace::Trace;

impl Monitor {
    /// Returns the secondary signals y_k = f_k(s), a margin per leaf and sample.
    ///
    /// A comparison's margin is f(s) − c up to its sign, a Boolean signal's is ±inf.
    /// The result is empty for an empty trace.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn secondary(&self, trace: &Trace) -> Vec<Vec<f64>> {
        self.check(trace.schema());
        if trace.is_empty() {
            return Vec::new();
        }
        let all = self.program.instructions.iter().enumerate();
        let leaves = all.filter(|(_, instruction)| matches!(instruction.op, Op::Leaf(_)));
        leaves.map(|(id, _)| self.values(id, trace)).collect()
    }

    /// Returns φ at every sample of an invariant `always φ` or `not eventually φ'`.
    ///
    /// The robustness of the invariant is the least of these values, so a single
    /// sample decides it. Returns `None` if the formula has another shape, if φ looks
    /// at more than one sample, or if the window leaves samples out.
    ///
    /// # Panics
    /// As [`Monitor::robustness`].
    pub fn invariant(&self, trace: &Trace) -> Option<Vec<f64>> {
        self.check(trace.schema());
        let root = self.program.root();
        let (sign, side, ahead) = match self.program.get(root).op {
            Op::Not(inner) => (-1.0, MinMax::Max, inner),
            _ => (1.0, MinMax::Min, root),
        };
        match self.program.get(ahead).op {
            // Only windows that cover the trace, over operands of a single sample.
            Op::Ahead(of, window, inner)
                if of == side
                    && window.from == 0
                    && window.to.is_none_or(|to| trace.len() <= to + 1)
                    && self.program.get(inner).pointwise =>
            {
                let values = self.values(inner, trace);
                Some(values.into_iter().map(|value| sign * value).collect())
            }
            _ => None,
        }
    }

    /// Returns the values of a sub-formula without temporal operators.
    fn values(&self, id: Id, trace: &Trace) -> Vec<f64> {
        if trace.is_empty() {
            return Vec::new();
        }
        let mut scratch = Scratch::new();
        let reading: EvalWindow = self.reading(trace.len());
        let len = trace.len();
        let mut evaluation = self.evaluation(trace, len, reading, Semantics::Margin, &mut scratch);
        evaluation.run(id, 0, len).lower
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Constants, Formula};
    use super::*;
    use crate::trace::{Schema, Signal};

    fn trace() -> Trace {
        let signals = [
            Signal::real("x", "m", "where"),
            Signal::boolean("red", "what the light shows"),
        ];
        let schema = Schema::new(0.5, signals).expect("a schema");
        let mut trace = Trace::new(schema.into());
        for row in [[3.0, 0.0], [1.0, 1.0], [2.0, 1.0]] {
            trace.push(&row).expect("finite");
        }
        trace
    }

    fn monitor(text: &str) -> Monitor {
        let formula: Formula = text.parse().expect("a formula");
        let constants = Constants::from([("T".to_owned(), 1.0)]);
        formula.bind(trace().schema(), &constants).expect("bound")
    }

    #[test]
    fn every_leaf_is_a_secondary_signal() {
        let margins = monitor("always[0, T] (red implies x >= 1.5)").secondary(&trace());
        assert_eq!(margins.len(), 2);
        assert!(margins.contains(&vec![1.5, -0.5, 0.5]));
        assert!(margins.contains(&vec![f64::NEG_INFINITY, f64::INFINITY, f64::INFINITY]));
    }

    #[test]
    fn an_invariant_is_decided_by_its_least_sample() {
        let trace = trace();
        for text in [
            "always[0, T] (x >= 1.5)",
            "not eventually[0, T] (x < 1.5)",
            "always (red implies x >= 1.5)",
            "not eventually (red and x < 1.5)",
        ] {
            let monitor = monitor(text);
            let values = monitor.invariant(&trace).expect(text);
            let least = values.iter().copied().fold(f64::INFINITY, f64::min);
            assert_eq!(least, monitor.robustness(&trace, &mut Scratch::new()));
            assert_eq!(values[1], -0.5, "{text}");
        }
        for text in [
            "eventually[0, T] (x >= 1.5)",
            "always[0.5, T] (x >= 1.5)",
            "always[0, 0.5] (x >= 1.5)",
            "always[0, 0.5] eventually[0, 0.5] (x >= 1.5)",
            "x >= 1.5",
        ] {
            assert_eq!(monitor(text).invariant(&trace), None, "{text}");
        }
    }
}
