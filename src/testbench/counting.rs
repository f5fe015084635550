//! Whether a violation that ended in contact is one that counts.

use std::sync::Arc;

use super::Testbench;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::Replayer;
use crate::rulebook::{Counts, Verdict};

impl Testbench {
    /// The verdict as the world counts it: the rulebook reads traces, and what
    /// a contact was is known to the scene.
    pub(super) fn counted(&mut self, verdict: Verdict) -> Verdict {
        match verdict {
            Verdict::Counterexample { by } if !self.counts() => Verdict::Uncounted { by },
            verdict => verdict,
        }
    }

    fn counts(&mut self) -> bool {
        let rulebook = Arc::clone(&self.rulebook);
        let counts = &rulebook.counts;
        let Some(least_mps) = counts.closing_mps() else {
            return true;
        };
        let Some(touch) = &self.contact else {
            return false;
        };
        let concerns_ego = touch.impact.is_some_and(|impact| impact.concerns_ego());
        if touch.closing_speed_mps < least_mps || !concerns_ego {
            return false;
        }
        match counts {
            Counts::Violation | Counts::Contact { .. } => true,
            Counts::Preventable { by, .. } => self.was_preventable(by),
        }
    }

    /// Whether any of these drivers in the ego's place would have avoided it.
    fn was_preventable(&mut self, by: &[ReferenceDriver]) -> bool {
        if self.replayer.is_none() {
            let world = self.scene.driven();
            self.replayer =
                world.and_then(|world| Replayer::new(&world, Arc::clone(&self.rulebook)));
        }
        match (&mut self.replayer, self.recording.motion()) {
            (Some(replayer), Some(motion)) => replayer.preventable_by(motion, by),
            _ => false,
        }
    }
}
