//! Check that the rows of a foreign ego are about that ego and not about its history.

use super::ego_under_test::EgoUnderTest;
use super::progress::Watch;
use super::test_starts::TestStarts;
use crate::ego::{Cause, Fault};
use crate::run_dir::Row;
use crate::testbench::FaultCount;
use crate::world::Scenario;

/// Plays a sample of an ego's episodes again, each against a fresh ego, and marks its
/// rows if commands differ.
///
/// Marked rows have neither rates nor results: the log of faults then has a complaint, which no allowed
/// share of faults excuses. A world with `repeats` may have a random ego.
pub fn check_repeatability<'a>(
    ego: &EgoUnderTest,
    starts: &TestStarts,
    rows: impl IntoIterator<Item = &'a mut Row>,
    watch: &Watch<'_>,
) {
    // A transcript knows its episode by the seed of the noise only.
    let position = |seed| starts.starts.iter().position(|(_, noise)| *noise == seed);
    let found = unrepeatable(ego.scenario(), ego.name(), position, watch);
    if let Some(found) = found {
        for row in rows {
            row.void(found.clone());
        }
    }
}

/// Plays a sample of an ego's episodes again, and returns the reason if commands differ.
///
/// `position` returns the start of a seed. A finding is reported to `watch`.
pub fn unrepeatable(
    scenario: &Scenario,
    name: &str,
    position: impl Fn(u64) -> Option<usize>,
    watch: &Watch<'_>,
) -> Option<FaultCount> {
    let controller = &scenario.ego()?.controller;
    let transcripts = controller.transcripts()?;
    // A part of the episodes proves nothing, and an ego that does not run has a fault.
    if watch.stopped() {
        return None;
    }
    // A program from the pool would bring along the state that is looked for.
    let check = transcripts.check(&|| controller.build_apart());
    if let Some(Fault { message, .. }) = check.failed {
        watch.note(&format!(
            "unknown whether `{name}` keeps state: it did not run when started anew: {message}"
        ));
    }
    let found = check.found?;
    // A world with repeats expects an ego that acts at random.
    if found.cause == Cause::Random && scenario.repeats.runs > 1 {
        return None;
    }
    let start = position(found.seed).map(|start| start as u64);
    let fault = found.fault(name, start);
    let count = FaultCount {
        kind: fault.kind,
        message: fault.message,
        stderr: String::new(),
        // An episode of another stream than the test starts has no position among them.
        first_start: start.unwrap_or(0),
        count: found.differing,
    };
    watch.faults.note_unrepeatable(&count);
    Some(count)
}
