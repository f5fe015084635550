//! Reference drivers: published models of what a driver in the ego's place would do.
//!
//! Each model is a file: [`cc`](CcDriver), the competent and careful human of
//! UN R157, in three readings; [`reg`](RegDriver), the cut-in formula of the
//! same regulation; [`rss`](RssDriver), responsibility-sensitive safety;
//! [`fsm`](FsmDriver), the fuzzy safety model; [`ideal`](IdealDriver), a driver
//! without delay. A model says when it sees danger and how it brakes; a
//! [`Reflexes`] is one of them in motion: reaction time, braking, holding. They
//! only brake, never steer, and judge others on parallel axes: their input is
//! in lane coordinates. What they are good for is in `docs/preventability.md`.
//!
//! ```
//! use brakecheck::ego::reference::{FsmDriver, LaneBody, Reflexes, Response};
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

mod at_the_wheel;
mod cc;
mod fsm;
mod ideal;
mod model;
mod reg;
mod rss;

pub use at_the_wheel::AtTheWheel;
pub(crate) use at_the_wheel::NOMINAL_MPS2;
pub use cc::{CcDriver, CcLaneDriver, CcLatchedDriver};
pub use fsm::{FsmDriver, Satisfaction};
pub use ideal::IdealDriver;
pub use model::ReferenceDriver;
pub use reg::RegDriver;
pub use rss::RssDriver;

/// A body in lane coordinates: x along the lane, y to the left, of its middle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LaneBody {
    /// Position of its middle along the lane.
    pub x_m: f64,
    /// Position of its middle to the left of any line that is parallel to it.
    pub y_m: f64,
    /// Speed along the lane.
    pub speed_mps: f64,
    /// Speed of its middle to the left.
    pub lateral_mps: f64,
    /// Acceleration along the lane over the last sample; read by [`IdealDriver`].
    pub accel_mps2: f64,
    /// Front bumper to rear bumper.
    pub length_m: f64,
    /// Side to side.
    pub width_m: f64,
}

/// The ego and one other, as a model judges them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encounter {
    /// Who judges.
    pub ego: LaneBody,
    /// Whom it judges.
    pub other: LaneBody,
    /// Acceleration that the ego had over the last sample; 0 at the first.
    pub accel_mps2: f64,
    /// Width of the lanes.
    pub lane_width_m: f64,
    /// What counts as time to collision.
    pub ttc: TtcReading,
}

/// Deceleration of a lead car that is an event, and the headway up to which.
const LEAD_BRAKES_MPS2: f64 = 5.0;
const LEAD_HEADWAY_S: f64 = 2.0;

/// Whether a gap that opens has a time to collision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TtcReading {
    /// Only a gap that closes has one.
    #[default]
    Closing,
    /// |g/Δv| of any gap, as the published models compute it: they may take a
    /// car that drives away for a danger.
    Magnitude,
}

impl Encounter {
    /// g: clear distance along the lane; negative alongside.
    pub fn gap_m(&self) -> f64 {
        (self.other.x_m - self.ego.x_m).abs() - self.mean_length_m()
    }

    /// c: clear distance across; 0 or less in each other's path.
    pub fn clearance_m(&self) -> f64 {
        (self.other.y_m - self.ego.y_m).abs() - 0.5 * (self.ego.width_m + self.other.width_m)
    }

    /// Δv: speed of the ego minus the other's; above 0 the gap closes.
    pub fn closing_mps(&self) -> f64 {
        self.ego.speed_mps - self.other.speed_mps
    }

    /// s: how fast the two come closer sideways.
    pub fn approach_mps(&self) -> f64 {
        let apart_mps = self.other.lateral_mps - self.ego.lateral_mps;
        match self.ego.y_m < self.other.y_m {
            true => -apart_mps,
            false => apart_mps,
        }
    }

    /// |g/Δv|; infinite at equal speeds.
    pub fn ttc_s(&self) -> f64 {
        let closing_mps = self.closing_mps();
        let opens = closing_mps < 0.0 && self.ttc == TtcReading::Closing;
        match closing_mps == 0.0 || opens {
            true => f64::INFINITY,
            false => (self.gap_m() / closing_mps).abs(),
        }
    }

    /// Whether the other brakes hard ahead in the ego's path: the event with which
    /// the regulation's following scene begins, harder than 5 m/s² within 2 s.
    ///
    /// The published models get that event from their scene, not from what they
    /// see, so their reading of the time to collision leaves it out.
    pub fn lead_brakes_hard(&self) -> bool {
        self.ttc == TtcReading::Closing
            && !self.is_passed()
            && self.clearance_m() <= 0.0
            && self.other.accel_mps2 < -LEAD_BRAKES_MPS2
            && self.gap_m() <= LEAD_HEADWAY_S * self.ego.speed_mps
    }

    /// l: the length by which middles are farther apart than bumpers.
    fn mean_length_m(&self) -> f64 {
        0.5 * (self.ego.length_m + self.other.length_m)
    }

    /// Whether the ego's middle is past the other's: no braking helps.
    fn is_passed(&self) -> bool {
        self.other.x_m < self.ego.x_m
    }
}

/// How a driver comes to brake, and how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pedal {
    /// τ: samples with danger for this long pass before it brakes.
    pub reaction_s: f64,
    /// Deceleration meanwhile.
    pub waiting_mps2: f64,
    /// How fast braking builds up; infinite is at once.
    pub jerk_mps3: f64,
    /// Hardest braking.
    pub max_brake_mps2: f64,
}

/// How long a driver goes on once it has seen danger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Latching {
    /// It looks again at every sample.
    Momentary,
    /// Until it is no faster than the other, stands, or has passed it.
    UntilSlower,
    /// Until it stands, and it stays there.
    UntilStandstill,
}

/// When a driver sees danger and how it brakes: one of the models.
pub trait DriverModel: Send {
    /// Its reaction and its brakes.
    fn pedal(&self) -> Pedal;

    /// The deceleration that an encounter asks for; `None`: no danger.
    ///
    /// Infinite is all that the pedal gives. An ego that is past the other's
    /// middle is never asked.
    fn danger(&self, encounter: &Encounter) -> Option<f64>;

    /// How long it goes on.
    fn latching(&self) -> Latching {
        Latching::Momentary
    }

    /// It, as a controller of the ego's car.
    fn at_the_wheel(&self) -> AtTheWheel<Self>
    where
        Self: Clone,
    {
        AtTheWheel::new(self.clone())
    }
}

/// What a driver does until the next sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Response {
    /// It has seen no danger yet: it drives as it would anyway.
    Nominal,
    /// A danger has passed: it keeps the speed that it has.
    Hold,
    /// It decelerates by that much, m/s²; 0 while it only waits.
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
    /// Whether it has seen danger before.
    reacted: bool,
    /// Samples with danger that still pass before it brakes.
    left: u32,
    brake_mps2: f64,
    /// Speed at the sample before.
    last_mps: Option<f64>,
    /// Whom it brakes for whatever it sees, by position among the others.
    latched: Option<usize>,
}

impl<M: DriverModel> Reflexes<M> {
    /// A driver with a fresh reaction time, asked every `sample_s`.
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

    /// The same with another reading of the time to collision.
    #[must_use]
    pub fn reading(self, ttc: TtcReading) -> Reflexes<M> {
        Reflexes { ttc, ..self }
    }

    /// Whether it has seen danger.
    pub fn has_reacted(&self) -> bool {
        self.reacted
    }

    /// What it does until the next sample; of several others the one counts
    /// that asks for the hardest braking.
    pub fn step(&mut self, ego: &LaneBody, others: &[LaneBody]) -> Response {
        let last_mps = self.last_mps.replace(ego.speed_mps);
        let accel_mps2 = last_mps.map_or(0.0, |last| (ego.speed_mps - last) / self.sample_s);
        let meet = |other: &LaneBody| Encounter {
            ego: *ego,
            other: *other,
            accel_mps2,
            lane_width_m: self.lane_width_m,
            ttc: self.ttc,
        };
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
            return Response::Hold;
        }
        let mut hardest: Option<(usize, f64)> = None;
        for (i, encounter) in others.iter().map(meet).enumerate() {
            if encounter.is_passed() {
                continue;
            }
            let asked = self.model.danger(&encounter);
            let harder = asked.filter(|ask| hardest.is_none_or(|(_, most)| most < *ask));
            hardest = harder.map(|ask| (i, ask)).or(hardest);
        }
        if self.model.latching() != Latching::Momentary {
            self.latched = hardest.map(|(i, _)| i);
        }
        self.respond(hardest.map(|(_, ask)| ask))
    }

    /// The common step, once it is known what the danger asks for.
    ///
    /// The reaction time runs only in samples with danger and is never reset:
    /// what has passed of it stays passed.
    pub fn respond(&mut self, danger: Option<f64>) -> Response {
        let Some(asked_mps2) = danger else {
            return match self.reacted {
                true => Response::Hold,
                false => Response::Nominal,
            };
        };
        self.reacted = true;
        if 0 < self.left {
            self.left -= 1;
            self.brake_mps2 = self.pedal.waiting_mps2;
            return Response::Brake(self.brake_mps2);
        }
        let built_up_mps2 = self.brake_mps2 + self.pedal.jerk_mps3 * self.sample_s;
        let most_mps2 = self.pedal.max_brake_mps2.min(asked_mps2);
        self.brake_mps2 = built_up_mps2.min(most_mps2);
        Response::Brake(self.brake_mps2)
    }
}

/// Samples that a time lasts; a quotient within 1e-9 of a whole number is it.
fn whole_samples(time_s: f64, sample_s: f64) -> u32 {
    let samples = time_s / sample_s;
    let nearest = libm::round(samples);
    match (samples - nearest).abs() <= 1e-9 {
        true => nearest as u32,
        false => libm::ceil(samples) as u32,
    }
}
