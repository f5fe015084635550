//! Finding about an ego whose commands depend on more than its episode.

use crate::ego::{Command, Fault, FaultKind};

/// Reason for which the commands of an ego depend on more than its episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// State that a used ego keeps over `reset`.
    KeptState,
    /// State outside the ego, such as a file, that outlives it.
    KeptOutside,
    /// Random draws that do not derive from the seed of `reset`.
    Random,
    /// The time of a clock.
    Clock,
}

/// An ego whose commands depend on more than its episode, with an example.
#[derive(Clone, Debug, PartialEq)]
pub struct Unrepeatable {
    pub cause: Cause,
    /// Seed of the example.
    pub seed: u64,
    /// Time of the first command that differs.
    pub(super) time_s: f64,
    /// Command that was given or, if a clock is the cause, given without pauses.
    pub(super) command: Command,
    /// Command of another ego on the same percepts.
    pub(super) other: Command,
    /// Episodes with other commands, among those played again.
    pub differing: u64,
}

impl Unrepeatable {
    /// Returns the fault that is reported. `start` is the position of the example's start.
    pub fn fault(&self, ego: &str, start: Option<u64>) -> Fault {
        let place = match start {
            Some(start) => format!("start {start}"),
            None => format!("an episode of seed {}", self.seed),
        };
        let (at, [was, is]) = (
            format!("at {:.2} s of {place}", self.time_s),
            commanded(self.command, self.other),
        );
        let (kind, what) = match self.cause {
            Cause::KeptState => (
                FaultKind::KeptState,
                format!(
                    "`{ego}` keeps state over `reset`: {at} it commanded {was} after earlier \
                     episodes, and {is} when started anew; clear your state at `reset`, or \
                     test it with `--fresh`"
                ),
            ),
            Cause::KeptOutside => (
                FaultKind::KeptState,
                format!(
                    "`{ego}` keeps state outside itself, such as in a file: {at} it first \
                     commanded {was}, and {is} when started anew later; clear that state at \
                     `reset`"
                ),
            ),
            Cause::Random => (
                FaultKind::Random,
                format!(
                    "`{ego}` is random: {at} it commanded {was}, and {is} with the same seed; \
                     derive all randomness from the seed of `reset`, or give the world \
                     `repeats: 5`"
                ),
            ),
            Cause::Clock => (
                FaultKind::Clock,
                format!(
                    "`{ego}` reads a clock: {at} it commanded {was}, and {is} when asked at \
                     another pace; use the percept's `time_s`, since simulated time is not \
                     that of a clock"
                ),
            ),
        };
        Fault::new(kind, what)
    }
}

/// Formats two commands by the components in which they differ.
fn commanded(one: Command, other: Command) -> [String; 2] {
    let digits = |a: f64, b: f64| if (a - b).abs() < 0.01 { 17 } else { 2 };
    let (what, pair): (&str, [f64; 2]) = if one.accel_mps2 == other.accel_mps2 {
        (" m/s across", [one.lateral_mps, other.lateral_mps])
    } else {
        (" m/s²", [one.accel_mps2, other.accel_mps2])
    };
    let digits = digits(pair[0], pair[1]);
    pair.map(|value| {
        // Close values are shown with all digits.
        if digits > 2 {
            format!("{value:?}{what}")
        } else {
            format!("{value:.digits$}{what}")
        }
    })
}
