//! Whether a violation that ended in contact is one that counts.

use super::Testbench;
use crate::rulebook::{Counts, Verdict};

impl Testbench {
    /// The verdict as the world counts it: the rulebook reads traces, and what
    /// a contact was is known to the scene.
    pub(super) fn counted(&self, verdict: Verdict) -> Verdict {
        match verdict {
            Verdict::Counterexample { by } if !self.counts() => Verdict::Uncounted { by },
            verdict => verdict,
        }
    }

    fn counts(&self) -> bool {
        let counts = &self.rulebook.counts;
        let Some(least_mps) = counts.closing_mps() else {
            return true;
        };
        let Some(touch) = &self.contact else {
            return false;
        };
        if touch.closing_speed_mps < least_mps || !self.scene.is_egos_contact() {
            return false;
        }
        match counts {
            Counts::Violation | Counts::Contact { .. } => true,
            Counts::Preventable { by, .. } => self.scene.was_avoidable(by),
        }
    }
}
