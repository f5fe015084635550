//! How rare the behaviour of a simulated road user is.

use std::fmt::{self, Display, Formatter};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::acceleration_model::AccelerationModel;
use crate::braking::{DECISION_S, SpeedSeries};
use crate::model::TrafficModel;
use crate::starts::{StartRarity, StartState};
use crate::tail::{EventRate, RateSource};

/// Greatest gap between a cut-in and its follower.
pub const CUT_IN_GAP_M: f64 = 100.0;

/// Rollouts of the model with which a run is compared.
pub const ROLLOUTS: usize = 20_000;

/// Behaviour of a simulated road user, to be judged by a model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DrivingBehaviour {
    /// Speed at the start in m/s.
    pub speed_mps: f64,
    /// Length of a decision in seconds.
    pub decision_s: f64,
    /// Mean acceleration of each decision in m/s².
    pub accelerations_mps2: Vec<f64>,
    /// States of followers when the road user crosses the line into their lane.
    pub cut_ins: Vec<CutInState>,
    /// State of the follower at the start.
    pub start: Option<StartState>,
}

/// State of a follower when another vehicle crosses the line into its lane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CutInState {
    /// Clearance in metres.
    pub gap_m: f64,
    /// Speed of the follower minus that of the other vehicle, in m/s.
    pub closing_mps: f64,
    /// Lateral speed in m/s.
    pub lateral_mps: f64,
}

impl CutInState {
    /// Returns the constant deceleration that the follower needs, in m/s².
    pub fn needed_mps2(&self) -> f64 {
        needed_mps2(self.gap_m, self.closing_mps)
    }
}

/// Returns the constant deceleration that avoids a contact, in m/s².
///
/// It is 0 if the gap does not shrink, and infinite without a gap.
pub fn needed_mps2(gap_m: f64, closing_mps: f64) -> f64 {
    if closing_mps <= 0.0 {
        return 0.0;
    }
    // Overlapping boxes count as no gap. The sign of the result stays
    // positive.
    closing_mps * closing_mps / (2.0 * gap_m.max(0.0))
}

impl DrivingBehaviour {
    /// Returns the speeds every 0.5 s, the last one held for an unfinished decision.
    fn series(&self) -> SpeedSeries {
        let speed_at = |time_s: f64| {
            let mut speed_mps = self.speed_mps;
            for (i, accel) in self.accelerations_mps2.iter().enumerate() {
                let within_s = (time_s - i as f64 * self.decision_s).clamp(0.0, self.decision_s);
                speed_mps += accel * within_s;
            }
            speed_mps
        };
        let end_s = self.accelerations_mps2.len() as f64 * self.decision_s;
        // The tolerance keeps a quotient just above a whole number from adding
        // a decision.
        let decisions = (end_s / DECISION_S - 1e-9).ceil().max(0.0) as usize;
        SpeedSeries {
            // Before the start the road user kept its speed for half a second.
            speeds_mps: std::iter::once(self.speed_mps)
                .chain((0..=decisions).map(|k| speed_at(k as f64 * DECISION_S)))
                .collect(),
            ..SpeedSeries::default()
        }
    }
}

/// Kind of an event with its sizes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RareEvent {
    /// Braking, by the peak over one second.
    Braking {
        /// Greatest deceleration over one second in m/s².
        peak_mps2: f64,
        /// Duration in seconds.
        duration_s: f64,
    },
    /// Acceleration, by the peak over one second.
    Acceleration {
        /// Greatest acceleration over one second in m/s².
        peak_mps2: f64,
        /// Duration in seconds.
        duration_s: f64,
    },
    /// Braking, by the speed lost.
    SpeedLoss {
        /// Speed lost in m/s.
        speed_lost_mps: f64,
    },
    /// Cut-in, by the deceleration that the follower needs.
    CutIn {
        /// Deceleration of the follower in m/s².
        needed_mps2: f64,
    },
}

/// Event of a behaviour with its rate among real drivers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RatedEvent {
    /// The event.
    pub event: RareEvent,
    /// Rate per 1,000 km.
    pub per_1000_km: EventRate,
}

/// Reason why a model has no data about a behaviour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum Outside {
    /// A speed that no recorded vehicle had, in m/s.
    Speed(f64),
    /// A mean acceleration that no recorded decision had, in m/s².
    Acceleration(f64),
    /// A lateral speed that no recorded cut-in had, in m/s.
    LateralSpeed(f64),
}

/// Rarity of a behaviour.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Rarity {
    /// All events, the rarest first.
    pub events: Vec<RatedEvent>,
    /// Rarity of the start.
    pub start: Option<StartRarity>,
    /// Reasons why the model has no data, empty if it has.
    pub outside: Vec<Outside>,
}

impl Rarity {
    /// Returns the rarest event, `None` if the behaviour has no event.
    pub fn rarest(&self) -> Option<&RatedEvent> {
        self.events.first()
    }
}

/// Likelihood of a run compared with natural ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Surprise {
    /// Decades by which the run is less likely than the median natural run.
    pub decades: f64,
    /// Share of natural runs that are at most as likely.
    pub rank: f64,
}

impl TrafficModel {
    /// Returns the rarity of a behaviour: its events, its start, and what is no data.
    pub fn rarity(&self, behaviour: &DrivingBehaviour) -> Rarity {
        let series = behaviour.series();
        let mut events = Vec::new();
        for event in series.braking_events() {
            events.push(RatedEvent {
                event: RareEvent::Braking {
                    peak_mps2: event.peak_mps2,
                    duration_s: event.duration_s,
                },
                per_1000_km: self.braking_peak.rate_of(event.peak_mps2),
            });
            events.push(RatedEvent {
                event: RareEvent::SpeedLoss {
                    speed_lost_mps: event.speed_lost_mps,
                },
                per_1000_km: self.braking_loss.rate_of(event.speed_lost_mps),
            });
        }
        // A model without them says nothing about accelerations, not that they are rare.
        if let Some(tail) = &self.acceleration_peak {
            // Mirrored, an acceleration is a braking event, so both have one definition.
            for event in series.mirrored().braking_events() {
                events.push(RatedEvent {
                    event: RareEvent::Acceleration {
                        peak_mps2: event.peak_mps2,
                        duration_s: event.duration_s,
                    },
                    per_1000_km: tail.rate_of(event.peak_mps2),
                });
            }
        }
        let rated = |it: &CutInState| self.cut_in(it.needed_mps2());
        events.extend(behaviour.cut_ins.iter().filter_map(rated));
        // Stable, so that events of equal rates stay in the order of time.
        events.sort_by(|a, b| a.per_1000_km.rate.total_cmp(&b.per_1000_km.rate));
        Rarity {
            events,
            start: behaviour.start.map(|it| self.starts.rarity_of(&it)),
            outside: self.outside(behaviour, &series),
        }
    }

    /// Returns a cut-in with its rate, `None` if the model has no cut-ins.
    pub(crate) fn cut_in(&self, needed_mps2: f64) -> Option<RatedEvent> {
        let need = self.cut_in_need.as_ref()?;
        let per_1000_km = self.exposure.cut_ins_per_1000_km();
        let share = need.rate_of(needed_mps2);
        let rate = if needed_mps2 < need.threshold {
            // Not sized below the threshold: any cut-in.
            EventRate {
                rate: 1.0,
                interval: [1.0; 2],
                source: RateSource::Counted,
                at_most: None,
            }
        } else {
            share
        };
        Some(RatedEvent {
            event: RareEvent::CutIn { needed_mps2 },
            per_1000_km: EventRate {
                rate: rate.rate * per_1000_km,
                interval: rate.interval.map(|it| it * per_1000_km),
                source: rate.source,
                at_most: rate.at_most.map(|it| it * per_1000_km),
            },
        })
    }

    fn outside(&self, behaviour: &DrivingBehaviour, series: &SpeedSeries) -> Vec<Outside> {
        // The ends themselves were recorded, so they are inside.
        let is_outside = |[least, most]: [f64; 2], value: f64| value < least || most < value;
        let speeds = series.speeds_mps.iter().copied();
        let start = behaviour.start.map(|it| it.speed_mps);
        let mut speeds = speeds.chain(start);
        let speed = speeds.find(|it| is_outside(self.domain.speed_mps, *it));
        let mut accels = series.accelerations_mps2().into_iter();
        let accel = accels.find(|it| is_outside(self.domain.accel_mps2, *it));
        let mut laterals = behaviour.cut_ins.iter().map(|it| it.lateral_mps.abs());
        let lateral = laterals.find(|it| self.domain.cut_in_lateral_mps < *it);
        let found = [
            speed.map(Outside::Speed),
            accel.map(Outside::Acceleration),
            lateral.map(Outside::LateralSpeed),
        ];
        found.into_iter().flatten().collect()
    }

    /// Returns the surprise of a behaviour among natural runs of the same length.
    ///
    /// Use it as a tie-breaker only. One step from 0 to −3 m/s² costs seven decades,
    /// so coarse actions dominate it. Returns `None` without a decision.
    pub fn surprise(&self, behaviour: &DrivingBehaviour) -> Option<Surprise> {
        let all = behaviour.series().accelerations_mps2();
        // The first decision is the one before the start.
        let accelerations = all.get(1..).filter(|it| !it.is_empty())?;
        let own = self.driver.log_likelihood(accelerations);
        let natural = natural_likelihoods(&self.driver, accelerations.len());
        let median = natural[natural.len() / 2];
        let below = natural.partition_point(|it| *it <= own);
        Some(Surprise {
            decades: (median - own) / std::f64::consts::LN_10,
            rank: below as f64 / natural.len() as f64,
        })
    }
}

/// Returns the log likelihoods of natural runs, ascending.
fn natural_likelihoods(driver: &AccelerationModel, decisions: usize) -> Vec<f64> {
    // The seed is the length, so that equal behaviours get equal surprises in
    // any run.
    let mut rng = ChaCha8Rng::seed_from_u64(decisions as u64);
    let mut run = vec![0.0; decisions];
    let mut all: Vec<f64> = (0..ROLLOUTS)
        .map(|_| {
            // As `log_likelihood` assumes of every run.
            let mut before = [0.0; 2];
            for accel in &mut run {
                *accel = driver.next(before, &mut rng);
                before = [before[1], *accel];
            }
            driver.log_likelihood(&run)
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all
}

impl Display for RatedEvent {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.event {
            RareEvent::Braking {
                peak_mps2,
                duration_s,
            } => write!(f, "braking of {peak_mps2:.1} m/s² for {duration_s:.1} s: ")?,
            RareEvent::Acceleration {
                peak_mps2,
                duration_s,
            } => write!(
                f,
                "acceleration of {peak_mps2:.1} m/s² for {duration_s:.1} s: "
            )?,
            RareEvent::SpeedLoss { speed_lost_mps } => {
                write!(f, "braking by {speed_lost_mps:.1} m/s: ")?;
            }
            RareEvent::CutIn { needed_mps2 } => {
                write!(f, "cut-in that needs {needed_mps2:.1} m/s²: ")?;
            }
        }
        write!(f, "{} per 1,000 km", self.per_1000_km)
    }
}
