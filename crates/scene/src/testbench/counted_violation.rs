//! Decision whether a violation that ended in contact counts.

use std::sync::Arc;

use super::Testbench;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::Replayer;
use crate::rulebook::{Counts, Verdict};

impl Testbench {
    /// Returns the verdict under the world's definition of a counterexample.
    ///
    /// The rulebook only reads traces, so the scene's contact is evaluated
    /// here.
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
        // A world that counts contacts does not count a violation without a
        // contact.
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

    /// Returns whether any of these drivers would have avoided the contact.
    fn was_preventable(&mut self, by: &[ReferenceDriver]) -> bool {
        // Built on first use: most episodes end without such a contact.
        if self.replayer.is_none() {
            let world = self.scene.driven();
            self.replayer =
                world.and_then(|world| Replayer::new(&world, Arc::clone(&self.rulebook)));
        }
        match (&mut self.replayer, self.recording.motion()) {
            (Some(replayer), Some(motion)) => {
                replayer.is_avoided_by_any(motion, by).unwrap_or(false)
            }
            // Without a recorded motion there is nothing to replay.
            _ => false,
        }
    }
}
