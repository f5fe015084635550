//! Copies of a test bench in the middle of an episode.

use std::sync::Arc;

use super::Testbench;
use crate::scene::Scene;
use crate::trace::Trace;

impl Testbench {
    /// Returns a copy that continues bit for bit, or `None` if the ego cannot fork.
    pub fn fork(&self) -> Option<Testbench> {
        Some(self.fork_around(self.trace.clone(), self.scene.fork()?))
    }

    /// Returns a copy like [`Testbench::fork`], which takes the samples with it.
    ///
    /// This bench must not continue before [`Testbench::rejoin`] returns them.
    pub fn branch(&mut self) -> Option<Testbench> {
        let scene = self.scene.fork()?;
        // Moved and not copied: tree searches branch at every decision, and
        // copies of the trace would grow with its length.
        let empty = Trace::new(Arc::clone(self.scene.schema()));
        let trace = std::mem::replace(&mut self.trace, empty);
        Some(self.fork_around(trace, scene))
    }

    /// Takes back the samples that [`Testbench::branch`] moved.
    pub fn rejoin(&mut self, branch: Testbench) {
        self.trace = branch.trace;
        // The trace has a sample at t = 0 and a sample per advance.
        self.trace.truncate(self.advances as usize + 1);
    }

    fn fork_around(&self, trace: Trace, scene: Box<dyn Scene>) -> Testbench {
        Testbench {
            scene,
            rulebook: Arc::clone(&self.rulebook),
            judge: self.judge.clone(),
            trace,
            samples: self.samples,
            row: self.row.clone(),
            verdict: self.verdict,
            judged: self.judged,
            contact: self.contact.clone(),
            lost: self.lost,
            broken: self.broken.clone(),
            fault: self.fault.clone(),
            decisions: self.decisions,
            advances: self.advances,
            aftermath: self.aftermath,
            recording: self.recording.clone(),
            // It is built again on first use.
            replayer: None,
            limit: self.limit.clone(),
            played: self.played.clone(),
        }
    }
}
