//! Bring your own ego: replay kept crashes against it, three lines in a test.
//!
//! ```sh
//! cargo run --release --example own_ego
//! ```

use std::sync::Arc;

use brakecheck::crashes::Regressions;
use brakecheck::ego::{Command, Controller, Fault, Percept};

/// A cautious follower: keeps a two-second gap and brakes early.
#[derive(Clone)]
struct TwoSeconds;

impl Controller for TwoSeconds {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let Some(lead) = percept.leader() else {
            return Ok(Command::accelerate(0.0));
        };
        let own = percept.own;
        let wish_m = lead.length_m + 4.0 + 2.0 * own.speed_mps;
        let accel = 0.2 * (lead.headway_m - wish_m) + 1.0 * (lead.speed_mps - own.speed_mps);
        Ok(Command::accelerate(accel.clamp(-8.0, 2.0)))
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mine = Arc::new(|| Box::new(TwoSeconds) as Box<dyn Controller>);

    // The same three lines in a `#[test]` of your crate guard your ego.
    let kept = Regressions::load("tests/regressions")?;
    let outcome = kept.with_ego("two seconds", mine).pass();
    println!(
        "{}",
        outcome.map_or_else(|e| e.to_string(), |counts| counts.to_string())
    );

    // And these two guard the recording itself, bit for bit.
    Regressions::load("tests/regressions")?.reproduce()?;
    println!("the recorded ego reproduces every kept crash bit for bit");
    Ok(())
}
