//! Reference drivers: published models of a driver in the ego's place.
//!
//! Each model is a file. [`cc`](CcDriver) is the competent and careful human of
//! UN R157, in three readings. [`reg`](RegDriver) is the cut-in formula of the
//! same regulation. [`rss`](RssDriver) is responsibility-sensitive safety.
//! [`fsm`](FsmDriver) is the fuzzy safety model. [`ideal`](IdealDriver) is a
//! driver without delay. A model defines danger and braking. A [`Reflexes`] is
//! a model in motion: reaction time, braking, holding. Reference drivers only
//! brake and never steer. They judge other agents on parallel axes, so their
//! input is in lane coordinates. `docs/background/preventability.md` describes their use.
//!
//! ```
//! use brakecheck_ego::ego::reference::{FsmDriver, LaneBody, Reflexes, Response};
//!
//! let car = LaneBody { length_m: 4.5, width_m: 1.8, ..LaneBody::default() };
//! let ego = LaneBody { speed_mps: 30.0, ..car };
//! let lead = LaneBody { x_m: 40.0, speed_mps: 10.0, ..car };
//! let mut driver = Reflexes::new(FsmDriver::default(), 0.1, 3.5);
//! // 0.75 s are eight samples of waiting, then the foot is on the brake.
//! for _ in 0..8 {
//!     assert_eq!(driver.step(&ego, &[lead]), Response::Brake(0.0));
//! }
//! assert_eq!(driver.step(&ego, &[lead]), Response::Brake(12.65 * 0.1));
//! ```

mod cc;
mod fsm;
mod ideal;
mod model;
mod reference_controller;
mod reg;
mod rss;

pub use cc::{CcDriver, CcLaneDriver, CcLatchedDriver};
pub use fsm::FsmDriver;
pub use ideal::IdealDriver;
pub use model::ReferenceDriver;
pub use reference_controller::{NOMINAL_MPS2, ReferenceController};
pub use reg::RegDriver;
pub use rss::RssDriver;

/// A body in lane coordinates of its middle: x along the lane, y to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LaneBody {
    /// Position of its middle along the lane.
    pub x_m: f64,
    /// Position of its middle to the left of any line parallel to the lane.
    pub y_m: f64,
    /// Speed along the lane.
    pub speed_mps: f64,
    /// Speed of its middle to the left.
    pub lateral_mps: f64,
    /// Acceleration along the lane over the last sample, for [`IdealDriver`].
    pub accel_mps2: f64,
    /// Length from front bumper to rear bumper.
    pub length_m: f64,
    /// Width from side to side.
    pub width_m: f64,
}

/// The ego and another agent, as input to a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// The ego.
    pub ego: LaneBody,
    /// The other agent.
    pub other: LaneBody,
    /// Acceleration of the ego over the last sample, 0 at the first.
    pub accel_mps2: f64,
    /// Width of the lanes.
    pub lane_width_m: f64,
    /// Definition of the time to collision.
    pub ttc: TtcReading,
}

/// Deceleration of a lead car that counts as an event, and its largest headway.
const LEAD_BRAKES_MPS2: f64 = 5.0;
const LEAD_HEADWAY_S: f64 = 2.0;

/// Definition of the time to collision for opening gaps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TtcReading {
    /// Only a closing gap has a time to collision.
    #[default]
    Closing,
    /// g/|Δv| of any gap, as in the published models.
    ///
    /// With it, a car that drives away may count as a danger.
    Magnitude,
}

impl Encounter {
    /// Returns g, the clearance along the lane, negative alongside.
    pub fn gap_m(&self) -> f64 {
        (self.other.x_m - self.ego.x_m).abs() - self.mean_length_m()
    }

    /// Returns c, the lateral clearance, at most 0 in each other's path.
    pub fn clearance_m(&self) -> f64 {
        (self.other.y_m - self.ego.y_m).abs() - 0.5 * (self.ego.width_m + self.other.width_m)
    }

    /// Returns Δv, the ego's speed minus the other's, above 0 if the gap closes.
    pub fn closing_mps(&self) -> f64 {
        self.ego.speed_mps - self.other.speed_mps
    }

    /// Returns s, the lateral closing speed.
    pub fn approach_mps(&self) -> f64 {
        let apart_mps = self.other.lateral_mps - self.ego.lateral_mps;
        // The sign depends on the side: towards the ego is to the right for an
        // agent on its left.
        if self.ego.y_m < self.other.y_m {
            -apart_mps
        } else {
            apart_mps
        }
    }

    /// Returns the time to collision |g/Δv|, infinite at equal speeds.
    pub fn ttc_s(&self) -> f64 {
        let closing_mps = self.closing_mps();
        let opens = closing_mps < 0.0 && self.ttc == TtcReading::Closing;
        if closing_mps == 0.0 || opens {
            f64::INFINITY
        } else {
            // The published models take the magnitude, also alongside.
            (self.gap_m() / closing_mps).abs()
        }
    }

    /// Returns whether the other agent brakes hard ahead in the ego's path.
    ///
    /// This event begins the regulation's following scene: harder than 5 m/s²
    /// within 2 s. The published models get that event from their scene and not
    /// from their input, so their reading of the time to collision omits it.
    pub fn lead_brakes_hard(&self) -> bool {
        self.ttc == TtcReading::Closing
            && !self.is_passed()
            && self.clearance_m() <= 0.0
            && self.other.accel_mps2 < -LEAD_BRAKES_MPS2
            && self.gap_m() <= LEAD_HEADWAY_S * self.ego.speed_mps
    }

    /// Returns l, the difference between distances of middles and of bumpers.
    fn mean_length_m(&self) -> f64 {
        0.5 * (self.ego.length_m + self.other.length_m)
    }

    /// Returns whether the ego's middle is past the other's, so braking is useless.
    fn is_passed(&self) -> bool {
        self.other.x_m < self.ego.x_m
    }
}

/// Reaction and brakes of a driver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pedal {
    /// Reaction time τ: time with danger that passes before it brakes.
    pub reaction_s: f64,
    /// Deceleration during the reaction time.
    pub(crate) waiting_mps2: f64,
    /// Rate at which braking builds up, infinite for at once.
    pub(crate) jerk_mps3: f64,
    /// Hardest braking.
    pub max_brake_mps2: f64,
}

/// Duration of a driver's response to danger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Latching {
    /// Danger is evaluated again at every sample.
    Momentary,
    /// Until the ego is no faster than the agent, stands, or has passed it.
    UntilSlower,
    /// Until the ego stands, and it stays there.
    UntilStandstill,
}

/// A model of danger and braking.
pub trait DriverModel: Send {
    /// Returns its reaction and its brakes.
    fn pedal(&self) -> Pedal;

    /// Returns the deceleration for an encounter, or `None` without danger.
    ///
    /// Infinite is the maximum of the pedal. It is not called once the ego is
    /// past the agent's middle.
    fn danger(&self, encounter: &Encounter) -> Option<f64>;

    /// Returns the duration of its response.
    fn latching(&self) -> Latching {
        Latching::Momentary
    }

    /// Returns it as a controller of the ego's car.
    fn controller(&self) -> ReferenceController<Self>
    where
        Self: Clone,
    {
        ReferenceController::new(self.clone())
    }
}

/// Action of a driver until the next sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Response {
    /// No danger so far: it drives as without the encounter.
    Nominal,
    /// A danger has passed: it keeps its current speed.
    Hold,
    /// Deceleration in m/s², 0 during the reaction time of some models.
    Brake(f64),
}

/// A model in motion: the common step of all reference drivers.
#[derive(Clone, Debug)]
pub struct Reflexes<M> {
    model: M,
    pedal: Pedal,
    sample_s: f64,
    lane_width_m: f64,
    ttc: TtcReading,
    /// True once it has detected danger.
    reacted: bool,
    /// Samples with danger that remain before it brakes.
    left: u32,
    brake_mps2: f64,
    /// Speed at the preceding sample.
    last_mps: Option<f64>,
    /// Agent that it keeps braking for, by position in `others`.
    latched: Option<usize>,
}

impl<M: DriverModel> Reflexes<M> {
    /// Creates a driver with an unused reaction time, stepped every `sample_s`.
    pub fn new(model: M, sample_s: f64, lane_width_m: f64) -> Reflexes<M> {
        let pedal = model.pedal();
        Reflexes {
            left: whole_samples(pedal.reaction_s, sample_s),
            pedal,
            model,
            sample_s,
            lane_width_m,
            ttc: TtcReading::default(),
            reacted: false,
            brake_mps2: 0.0,
            last_mps: None,
            latched: None,
        }
    }

    /// Returns the same driver with a different time to collision.
    #[must_use]
    pub fn reading(self, ttc: TtcReading) -> Reflexes<M> {
        Reflexes { ttc, ..self }
    }

    /// Returns whether it has detected danger.
    pub fn has_reacted(&self) -> bool {
        self.reacted
    }

    /// Returns its action until the next sample.
    ///
    /// If several agents are dangerous, the hardest braking counts.
    pub fn step(&mut self, ego: &LaneBody, others: &[LaneBody]) -> Response {
        // At every sample, also while latched, so that the difference spans
        // one sample.
        let last_mps = self.last_mps.replace(ego.speed_mps);
        let accel_mps2 = last_mps.map_or(0.0, |last| (ego.speed_mps - last) / self.sample_s);
        let meet = |other: &LaneBody| Encounter {
            ego: *ego,
            other: *other,
            accel_mps2,
            lane_width_m: self.lane_width_m,
            ttc: self.ttc,
        };
        // While latched, danger is not evaluated: the response lasts for the
        // same agent.
        if let Some(of) = self.latched {
            let over = match self.model.latching() {
                Latching::UntilStandstill => false,
                Latching::Momentary => true,
                Latching::UntilSlower => others.get(of).map(meet).is_none_or(|it| {
                    it.closing_mps() <= 0.0 || it.ego.speed_mps <= 0.0 || it.is_passed()
                }),
            };
            if !over {
                return self.respond(Some(f64::INFINITY));
            }
            self.latched = None;
            self.brake_mps2 = 0.0;
            // A released driver does not accelerate back: the models end with
            // the danger.
            return Response::Hold;
        }
        let mut hardest: Option<(usize, f64)> = None;
        for (i, encounter) in others.iter().map(meet).enumerate() {
            // Braking cannot avoid an agent that the ego has passed.
            if encounter.is_passed() {
                continue;
            }
            let demanded_mps2 = self.model.danger(&encounter);
            // Strictly harder: among equal demands the first agent is kept, so
            // latching is deterministic.
            let harder = demanded_mps2.filter(|ask| hardest.is_none_or(|(_, most)| most < *ask));
            hardest = harder.map(|ask| (i, ask)).or(hardest);
        }
        if self.model.latching() != Latching::Momentary {
            self.latched = hardest.map(|(i, _)| i);
        }
        self.respond(hardest.map(|(_, ask)| ask))
    }

    /// Performs the common step for a known danger.
    ///
    /// The reaction time runs only in samples with danger and is never reset.
    pub fn respond(&mut self, danger: Option<f64>) -> Response {
        let Some(demanded_mps2) = danger else {
            return if self.reacted {
                Response::Hold
            } else {
                Response::Nominal
            };
        };
        self.reacted = true;
        if self.left > 0 {
            self.left -= 1;
            self.brake_mps2 = self.pedal.waiting_mps2;
            return Response::Brake(self.brake_mps2);
        }
        // The build-up starts from the deceleration of the last sample.
        let built_up_mps2 = self.brake_mps2 + self.pedal.jerk_mps3 * self.sample_s;
        let most_mps2 = self.pedal.max_brake_mps2.min(demanded_mps2);
        // Less braking takes effect at once. Only the build-up has a jerk.
        self.brake_mps2 = built_up_mps2.min(most_mps2);
        Response::Brake(self.brake_mps2)
    }
}

/// Returns a duration in samples, rounded up.
///
/// A quotient within 1e-9 of a whole number counts as whole.
fn whole_samples(time_s: f64, sample_s: f64) -> u32 {
    let samples = time_s / sample_s;
    let nearest = libm::round(samples);
    if (samples - nearest).abs() <= 1e-9 {
        nearest as u32
    } else {
        libm::ceil(samples) as u32
    }
}
