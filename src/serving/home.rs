//! Replay of a judged episode at home, so that it can be kept.
//!
//! The ego of the other simulator does not exist here. An ego that tracks its recorded
//! motion takes its place, and its commands are kept, as those of any external ego.
//! The kept file is then repeated bit for bit, and deviates from the other simulator by
//! the reported distance.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;

use super::live::LiveEpisode;
use crate::crashes::{file_stem, labels_of_contact};
use crate::ego::{Command, Controller, Fault, Percept};
use crate::run_dir::{Counterexample, KeptError};
use crate::scene::Pose;
use crate::scene::drive::{Drive, DriveWorld};
use crate::sim::wrapped;
use crate::testbench::{Aftermath, Episode, Replay, play};
use crate::world::{Change, Scenario};

/// Name of the ego in kept files.
const EGO: &str = "external";
/// Share of an error in place that is corrected per second, 1/s.
const CORRECTION_PER_S: f64 = 1.0;
/// Rounding of a ratio of decimal fractions.
const ROUNDING: f64 = 1e-6;
/// Bounds of the tracking commands, within those of any ego.
const MOST_ACCEL_MPS2: f64 = 15.0;
const MOST_LATERAL_MPS: f64 = 5.0;

/// Kept counterexample of another simulator.
pub(super) struct KeptLive {
    /// File of the counterexample.
    pub file: PathBuf,
    /// Greatest distance of an ego's front bumper here and there.
    pub off_m: f64,
}

/// Reason why a counterexample is not kept.
#[derive(Debug, thiserror::Error)]
pub(super) enum NotKept {
    /// The world has no ego with a motion.
    #[error("the world has no vehicles")]
    NoVehicles,
    /// The replay does not fail.
    #[error("the replay at home ends otherwise: {verdict}, with the ego at most {off_m:.2} m off")]
    Differs {
        /// Word for the verdict of the replay.
        verdict: &'static str,
        /// Greatest distance of the ego.
        off_m: f64,
    },
    /// The disk refuses.
    #[error(transparent)]
    Disk(#[from] KeptError),
}

/// Replays a counterexample at home and writes it into `dir`.
pub(super) fn keep(world: &Scenario, live: &LiveEpisode, dir: &Path) -> Result<KeptLive, NotKept> {
    let there = live.episode();
    let drive = world.drive().ok_or(NotKept::NoVehicles)?;
    let motion = EgoMotion::of(drive.world(), &there).ok_or(NotKept::NoVehicles)?;
    let here = world.with_ego(EGO, motion.tracker());
    let episode = play(
        &mut here.bench(),
        &there.start,
        there.noise,
        // The last action is held, because the tracking ego may meet the ado later.
        &mut Replay::holding(&there.actions),
        // To the contact, which a kept file needs for its severity.
        Aftermath::Play,
    );
    let off_m = motion.off_m(&episode);
    if !episode.verdict.is_success() {
        let verdict = episode.verdict.word();
        return Err(NotKept::Differs { verdict, off_m });
    }
    // The ego is in no file, so there is no change that leads to it.
    let change = Change::default();
    let kept = Counterexample {
        // Persistence and cause ask an ego, and the real one is in the other simulator.
        about: Some(labels_of_contact(&here, &episode)),
        ..Counterexample::record(&here, EGO, &change, live.adversary().caption(), &episode)
    };
    crate::run_dir::make_dir(dir).map_err(KeptError::from)?;
    // A start of the simulator has no number, so the start itself is one.
    let (seed, index) = live.test_start.unwrap_or((episode.noise, 0));
    let mut stem = file_stem(&here, EGO, seed, index);
    if live.test_start.is_none() {
        // Two starts of the simulator would otherwise overwrite each other's file.
        let digest = crate::content_hash::fingerprint(&json!(episode.start.0));
        // Eight digits tell the starts in a directory apart, and keep names short.
        stem = format!("{stem}-{}", &digest[..8]);
    }
    let file = kept.save_as(dir, &stem, &episode.trace)?;
    Ok(KeptLive { file, off_m })
}

/// Motion of the ego along its road, per sample.
struct EgoMotion {
    name: String,
    samples: Arc<[ReportedEgo]>,
    lag_s: f64,
}

/// Motion of the ego at one sample.
#[derive(Clone, Copy, Debug)]
struct ReportedEgo {
    x_m: f64,
    y_m: f64,
    s_m: f64,
    lateral_m: f64,
    speed_mps: f64,
}

impl EgoMotion {
    /// Reads the motion from the trace of an episode, at the samples of the world.
    ///
    /// `None` without an ego.
    fn of(drive: &DriveWorld, episode: &Episode) -> Option<EgoMotion> {
        let spec = drive.spec();
        let ego = &spec.agents[spec
            .agents
            .iter()
            .position(|it| matches!(it.drive, Drive::Ego))?];
        let course = &drive.courses()[ego.road];
        let column = |of: &str| episode.trace.signal(&format!("{}.{of}", ego.name));
        let (x, y) = (column("x")?, column("y")?);
        let (heading, speed) = (column("heading")?, column("speed")?);
        // The other simulator may have another step than the world's samples.
        let step_s = episode.trace.dt_s();
        let steps = spec.clock.sample_s / step_s;
        let last = episode.trace.len().saturating_sub(1);
        // A contact cuts the last step short.
        let contact_s = episode.contact.as_ref().map(|it| it.time_s);
        let cut = contact_s.map_or(1.0, |it| it / step_s - last as f64 + 1.0);
        let samples = (0..=(last as f64 / steps - ROUNDING).ceil() as usize).map(|i| {
            // The last step of the world may reach beyond the record.
            let at = (i as f64 * steps).min(last as f64);
            // A product of decimals may lie just below a whole number, and `floor` alone
            // would then take the sample before.
            let before = (at + ROUNDING).floor() as usize;
            let after = (before + 1).min(last);
            let length = if after == last {
                cut.clamp(ROUNDING, 1.0)
            } else {
                1.0
            };
            // With its rounding, `before` may lie a little behind `at`.
            let share = (at - before as f64).max(0.0) / length;
            let mixed = |column: &[f64]| column[before] + share * (column[after] - column[before]);
            // Headings jump at ±π, where a plain mean would point backwards.
            let turn_rad = wrapped(heading[after] - heading[before]);
            let pose = Pose {
                x_m: mixed(x),
                y_m: mixed(y),
                heading_rad: heading[before] + share * turn_rad,
            };
            let at = course.locate(&pose);
            ReportedEgo {
                x_m: pose.x_m,
                y_m: pose.y_m,
                s_m: at.s_m,
                lateral_m: at.lateral_m,
                speed_mps: mixed(speed),
            }
        });
        Some(EgoMotion {
            name: ego.name.clone(),
            samples: samples.collect(),
            lag_s: spec.ego.lag_s,
        })
    }

    /// Returns the factory of an ego that tracks the motion.
    fn tracker(&self) -> crate::experiment::ControllerFactory {
        let (samples, lag_s) = (Arc::clone(&self.samples), self.lag_s);
        Arc::new(move || {
            Box::new(MotionTracker {
                samples: Arc::clone(&samples),
                lag_s,
                next: 0,
                arriving_mps2: 0.0,
            })
        })
    }

    /// Returns the greatest distance of the ego's front in an episode from the motion.
    fn off_m(&self, episode: &Episode) -> f64 {
        let column = |of: &str| episode.trace.signal(&format!("{}.{of}", self.name));
        let (Some(x), Some(y)) = (column("x"), column("y")) else {
            // A distance that cannot be measured must not look like none.
            return f64::INFINITY;
        };
        // A contact ends one of the two earlier, within the last sample.
        let shared = episode
            .trace
            .len()
            .min(self.samples.len())
            .saturating_sub(1);
        let samples = self.samples.iter().take(shared);
        let off_m = samples
            .zip(x.iter().zip(y))
            .map(|(there, (x_m, y_m))| libm::hypot(there.x_m - x_m, there.y_m - y_m));
        off_m.fold(0.0, f64::max)
    }
}

/// Ego that follows a recorded motion through its actuator.
#[derive(Clone)]
struct MotionTracker {
    samples: Arc<[ReportedEgo]>,
    lag_s: f64,
    next: usize,
    /// Acceleration at the end of the actuator.
    arriving_mps2: f64,
}

impl Controller for MotionTracker {
    fn reset(&mut self, _seed: u64) {
        self.next = 0;
        self.arriving_mps2 = 0.0;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let Some(last) = self.samples.len().checked_sub(1) else {
            return Ok(Command::default());
        };
        // After its record the motion stands at its last sample, and the clamp keeps the
        // index valid.
        let now = self.samples[self.next.min(last)];
        let then = self.samples[(self.next + 1).min(last)];
        self.next += 1;
        let (own, sample_s) = (&percept.own, percept.sample_s);
        // The speed of the next sample, and a little of the distance behind.
        let behind_m = now.s_m - own.s_m;
        let speed_mps = then.speed_mps + CORRECTION_PER_S * behind_m;
        let wish_mps2 =
            ((speed_mps - own.speed_mps) / sample_s).clamp(-MOST_ACCEL_MPS2, MOST_ACCEL_MPS2);
        // The inverse of the lag a' = u + (a − u) e^(−dt/τ).
        let decay = if self.lag_s > 0.0 {
            libm::exp(-sample_s / self.lag_s)
        } else {
            0.0
        };
        // The inverse of a slow actuator asks for far more than a car can do.
        let accel_mps2 = ((wish_mps2 - self.arriving_mps2 * decay) / (1.0 - decay))
            .clamp(-MOST_ACCEL_MPS2, MOST_ACCEL_MPS2);
        // A percept has no command that is on its way, so the lag is computed here, too.
        self.arriving_mps2 = accel_mps2 + (self.arriving_mps2 - accel_mps2) * decay;
        let aside_mps = (then.lateral_m - now.lateral_m) / sample_s
            + CORRECTION_PER_S * (now.lateral_m - own.lateral_m);
        Ok(Command {
            accel_mps2,
            lateral_mps: aside_mps.clamp(-MOST_LATERAL_MPS, MOST_LATERAL_MPS),
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}
