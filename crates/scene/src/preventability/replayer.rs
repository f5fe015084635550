//! Replay of a recorded motion with a driver in the ego's place.

use std::sync::Arc;

use super::contact::{
    STANDING_MPS, between, exoneration, other_of, partner, reason_against, reason_against_replays,
    struck,
};
use super::moments::LaneRecord;
use super::outcome::{DriverOutcome, NotApplicable, Preventability, ReplayContact};
use super::reference_drive::{Notes, ReferenceDriverRun, ReplayRows, Seat};
use super::{Label, PANEL};
use crate::ego::Actuator;
use crate::ego::reference::{LaneBody, NOMINAL_MPS2, ReferenceDriver, Response};
use crate::rulebook::Rulebook;
use crate::scene::drive::{DriveScene, DriveWorld};
use crate::scene::{ContactEvent, Frame, Motion, Scene, StepOutcome};
use crate::sim::{BodyCommand, GRAVITY_MPS2, PlantKind};
use crate::trace::Trace;

/// Least duration of a replay after the recorded contact.
const AFTER_CONTACT_S: f64 = 5.0;

/// Recorded episode, prepared for other drivers.
pub struct RecordedEpisode {
    /// Motion, continued after its end.
    whole: Motion,
    /// Number of full samples in the record, at which drivers can take over.
    recorded: usize,
    /// Vehicles that drivers consider, by position among the agents.
    traffic: Vec<usize>,
    lanes: LaneRecord,
    /// First sample at which a driver may have to react.
    pub handover: Option<usize>,
    /// The first sample at which the ideal driver brakes.
    pub danger: Option<usize>,
}

/// Replay for display.
#[derive(Clone, Debug)]
pub struct FilmedDriver {
    /// Sample of the episode at which the driver takes over.
    pub from: usize,
    /// Positions of all agents at each sample from there on.
    pub frames: Vec<Frame>,
    /// Contact that the driver does not avoid, if any.
    pub contact: Option<ContactEvent>,
    /// Outcome of the driver.
    pub outcome: DriverOutcome,
}

/// Replayer of episodes in a world, with the data that they share.
pub struct Replayer {
    world: DriveWorld,
    scene: DriveScene,
    rulebook: Arc<Rulebook>,
    /// Whether replays have all signals of the rules.
    repeats_rules: bool,
    /// Whether replays have all signals of ψ_ego.
    repeats_spec: bool,
    /// Other vehicles, by position among the agents.
    vehicles: Vec<usize>,
    sample_s: f64,
    /// Factor of the ego's tyres on the road's friction.
    grip: f64,
    lag_s: f64,
    /// Other vehicles at the current sample, kept to avoid an allocation.
    others: Vec<LaneBody>,
}

/// Full braking in the ego's place, from any sample of a recorded motion on.
///
/// It covers every contact of the ego, because full braking judges no other agent.
pub struct BrakingReplays {
    replayer: Replayer,
    case: RecordedEpisode,
}

impl BrakingReplays {
    /// Returns whether full braking from this sample on avoids the contact.
    ///
    /// From the contact on it is too late.
    pub fn avoids(&mut self, sample: usize) -> bool {
        self.replayer.braking_avoids(&self.case, sample)
    }

    /// Returns the last sample from which full braking avoids the contact.
    pub fn last(&mut self) -> Option<usize> {
        self.replayer.last_braking(&self.case)
    }
}

/// Stretch of driving: its first sample, and its speed without danger.
#[derive(Clone, Copy)]
struct DriveInterval {
    from: usize,
    nominal: NominalSpeed,
}

#[derive(Clone, Copy)]
enum NominalSpeed {
    /// Speed at the start of the episode.
    Initial,
    /// Speed at the same sample of the record.
    Recorded,
}

impl Replayer {
    /// Creates a replayer of a driving world, or `None` if the ego is no vehicle.
    ///
    /// `rulebook` is evaluated on each replay.
    pub fn new(world: &DriveWorld, rulebook: Arc<Rulebook>) -> Option<Replayer> {
        let spec = world.spec();
        let ego = world.ego();
        // The drivers model cars. A bicycle as the ego has none.
        let vehicle = spec.agents[ego].body.vehicle()?;
        let agents = spec.agents.iter().enumerate();
        let vehicles = agents.filter(|(i, agent)| *i != ego && !agent.body.is_on_foot());
        let mut rules = rulebook.rules.iter();
        Some(Replayer {
            scene: world.for_replay().scene(),
            world: world.clone(),
            repeats_rules: rules.all(|rule| world.repeats(&rule.monitor.signals())),
            repeats_spec: world.repeats(&rulebook.spec.signals()),
            rulebook,
            vehicles: vehicles.map(|(i, _)| i).collect(),
            sample_s: spec.clock.sample_s,
            grip: vehicle.grip,
            lag_s: spec.ego.lag_s,
            others: Vec::new(),
        })
    }

    /// Prepares an episode for its replays.
    pub fn case(&self, motion: &Motion) -> RecordedEpisode {
        let contact_s = motion.contact.as_ref().map_or(0.0, |touch| touch.time_s);
        let after = ((contact_s + AFTER_CONTACT_S) / self.sample_s).ceil() as usize + 1;
        // A driver may only delay the contact, so the replay continues beyond it.
        let samples = self.world.spec().clock.samples().max(after);
        // The last sample of a contact shows the instant of contact, not a full sample.
        let partial = usize::from(motion.contact.is_some());
        // The start is there even if a contact ends the first sample.
        let recorded = motion.len().saturating_sub(partial).max(1);
        let world = self.world.at_start(&motion.start);
        let body = |sample: usize, i: usize| world.lane_body(i, &motion.at(sample)[i].state);
        // An oncoming vehicle is on no parallel axis.
        let comes = |i: usize| (0..recorded).any(|at| body(at, i).speed_mps < -STANDING_MPS);
        let vehicles = self.vehicles.iter().copied();
        let traffic: Vec<usize> = vehicles.filter(|&i| !comes(i)).collect();
        // The ego comes first, as the lane record expects.
        let agents = [&[self.world.ego()], &*traffic].concat();
        let samples_of = |at: usize| agents.iter().map(move |&i| body(at, i));
        let seen_at = |at: usize| {
            let seen = world.seen(motion.at(at));
            agents.iter().map(move |&i| seen[i]).collect::<Vec<bool>>()
        };
        let lanes = LaneRecord {
            seen: (0..recorded).flat_map(seen_at).collect(),
            sample_s: self.sample_s,
            lane_width_m: world.spec().road.lane_width_m(),
            width: agents.len(),
            bodies: (0..recorded).flat_map(samples_of).collect(),
        };
        RecordedEpisode {
            traffic,
            handover: lanes.handover(),
            danger: lanes.danger(),
            whole: world.continued(motion, samples),
            recorded,
            lanes,
        }
    }

    /// Returns whether any of `drivers` avoids the contact from the handover on.
    ///
    /// `None`: the drivers do not apply, as in [`Replayer::assess`].
    pub fn is_avoided_by_any(
        &mut self,
        motion: &Motion,
        drivers: &[ReferenceDriver],
    ) -> Option<bool> {
        if reason_against(&self.world.at_start(&motion.start), motion).is_some() {
            return None;
        }
        let case = self.case(motion);
        // No road user was ahead, so no driver would react.
        case.handover?;
        let mut drivers = drivers.to_vec();
        // The most capable drivers first, so that few replays are needed.
        drivers.sort_by_key(|driver| chances(*driver));
        Some(drivers.into_iter().any(|driver| {
            let outcome = self.from_handover(&case, driver, None);
            outcome.is_some_and(|outcome| outcome.avoided)
        }))
    }

    /// Returns the assessment of the contact at the end of a motion.
    ///
    /// With the `trace` of the episode, the rulebook is evaluated on each replay. Worlds
    /// with traffic lights are excluded from that, because a motion has no phases.
    pub fn assess(&mut self, motion: &Motion, trace: Option<&Trace>) -> Preventability {
        let world = self.world.at_start(&motion.start);
        let exonerated = exoneration(&world, motion);
        if let Some(why) = reason_against(&world, motion) {
            return Preventability {
                exonerated,
                ..Preventability::not_applicable(why)
            };
        }
        let trace = trace.filter(|_| self.world.spec().lights.is_empty());
        let case = self.case(motion);
        let Some(handover) = case.handover else {
            return Preventability {
                exonerated,
                ..Preventability::not_applicable(NotApplicable::NobodyAhead)
            };
        };
        let time_s = |sample: usize| sample as f64 * self.sample_s;
        let mut assessed = Preventability {
            label: Label::NotApplicable,
            not_applicable: None,
            exonerated,
            handover_s: Some(time_s(handover)),
            danger_s: case.danger.map(time_s),
            cut_in: partner(&self.world, motion).and_then(|with| {
                let number = case.traffic.iter().position(|&i| i == with)?;
                case.lanes.cut_in(number)
            }),
            ..Preventability::not_applicable(NotApplicable::NoContact)
        };
        for driver in PANEL {
            if let Some(outcome) = self.from_handover(&case, driver, trace) {
                assessed.handover.insert(driver, outcome);
            }
            // From the start a driver tests the whole approach, not only the reaction.
            let seat = Seat::Driver(driver);
            assessed
                .t0
                .insert(driver, self.from_start(&case, seat, trace));
        }
        assessed.perfect = self.from_handover(&case, ReferenceDriver::Ideal, trace);
        assessed.foresight = Some(self.from_start(&case, Seat::FullBrakes, trace));
        assessed.label_outcomes();
        // Only if braking at the first danger fails, because this replays from many
        // samples.
        if assessed.label == Label::UnavoidableByBraking {
            // Braking may help between the start and the first danger, or after it.
            assessed.label = match (self.last_braking(&case), case.danger) {
                (Some(last), Some(danger)) if danger <= last => Label::OnlyByPerfect,
                (Some(_), _) => Label::OnlyByForesight,
                (None, _) => Label::UnavoidableByBraking,
            };
        }
        assessed
    }

    /// Returns replays with full braking, `None` if the motion cannot be replayed.
    pub fn braking(self, motion: &Motion) -> Option<BrakingReplays> {
        let world = self.world.at_start(&motion.start);
        reason_against_replays(&world, motion)
            .is_none()
            .then(|| BrakingReplays {
                case: self.case(motion),
                replayer: self,
            })
    }

    /// Returns whether full braking from this sample on avoids the contact.
    fn braking_avoids(&mut self, case: &RecordedEpisode, from: usize) -> bool {
        let nominal = NominalSpeed::Recorded;
        let stint = DriveInterval { from, nominal };
        let mut notes = Notes::default();
        from < case.recorded
            && self
                .drive(case, Seat::FullBrakes, stint, &mut notes)
                .avoided
    }

    /// Returns the last sample from which full braking avoids the contact.
    fn last_braking(&mut self, case: &RecordedEpisode) -> Option<usize> {
        // Backwards, so that the last such sample is found first.
        let mut samples = (0..case.recorded).rev();
        samples.find(|from| self.braking_avoids(case, *from))
    }

    /// Returns the outcome of a driver from the handover on.
    ///
    /// The ideal driver takes over at the first danger.
    pub fn from_handover(
        &mut self,
        case: &RecordedEpisode,
        driver: ReferenceDriver,
        trace: Option<&Trace>,
    ) -> Option<DriverOutcome> {
        let (stint, seat) = case.handed_over_to(driver)?;
        let mut notes = self.notes(trace, stint.from);
        Some(self.drive(case, seat, stint, &mut notes))
    }

    /// Returns the frames and the outcome of a driver from the handover on.
    ///
    /// `None` if the drivers do not apply, as in [`Replayer::assess`], or if no agent was
    /// ahead.
    pub fn film(&mut self, motion: &Motion, driver: ReferenceDriver) -> Option<FilmedDriver> {
        if reason_against(&self.world.at_start(&motion.start), motion).is_some() {
            return None;
        }
        let case = self.case(motion);
        let (stint, seat) = case.handed_over_to(driver)?;
        let mut notes = Notes {
            frames: Some(Vec::new()),
            ..Notes::default()
        };
        let outcome = self.drive(&case, seat, stint, &mut notes);
        Some(FilmedDriver {
            from: stint.from,
            frames: notes.frames.unwrap_or_default(),
            contact: notes.contact,
            outcome,
        })
    }

    /// Returns the outcome of a driver from the start on, with the initial nominal speed.
    pub fn from_start(
        &mut self,
        case: &RecordedEpisode,
        seat: Seat,
        trace: Option<&Trace>,
    ) -> DriverOutcome {
        let nominal = NominalSpeed::Initial;
        let mut notes = self.notes(trace, 0);
        self.drive(case, seat, DriveInterval { from: 0, nominal }, &mut notes)
    }

    /// Creates notes from a sample on, with rows if there is a trace.
    fn notes(&self, trace: Option<&Trace>, from: usize) -> Notes {
        Notes {
            rows: trace.map(|trace| ReplayRows::begin(trace, from, self.scene.clock().samples())),
            ..Notes::default()
        }
    }

    fn drive(
        &mut self,
        case: &RecordedEpisode,
        seat: Seat,
        stint: DriveInterval,
        notes: &mut Notes,
    ) -> DriverOutcome {
        let DriveInterval { from, .. } = stint;
        // The actuator continues from the acceleration of the recorded ego.
        let arriving_mps2 = case.whole.at(from)[self.world.ego()].state.accel_mps2;
        let actuator = Actuator::new(self.lag_of(seat), self.sample_s).from(arriving_mps2);
        self.scene.take_up(&case.whole, from);
        let lane_width_m = self.scene.road().lane_width_m();
        let mut at_wheel = ReferenceDriverRun::new(seat, actuator, self.sample_s, lane_width_m);
        notes.begin(&self.scene);
        let mut least_m: Option<f64> = None;
        let mut contact = None;
        // The others repeat the record, and after its end its continuation.
        for sample in from + 1..case.whole.len() {
            let ego = self.look(&case.traffic, &mut least_m);
            let command = match seat {
                Seat::Recorded => self.as_recorded(case, sample, &ego),
                _ => {
                    let nominal_mps = case.nominal_mps(stint.nominal, sample, self.world.ego());
                    let accel_mps2 = self.accel(&mut at_wheel, seat, &ego, nominal_mps);
                    self.scene.keep_lane(accel_mps2)
                }
            };
            let flow = self.scene.advance_along(command, case.whole.at(sample));
            notes.push(&self.scene);
            if let StepOutcome::Contact(touch) = flow {
                notes.contact = Some(touch.clone());
                // The gap at the contact is the least of all.
                self.look(&case.traffic, &mut least_m);
                contact = self.contact_of(touch);
                break;
            }
        }
        self.outcome(
            case,
            contact,
            least_m,
            at_wheel.reacted(from, self.sample_s),
            notes.rows.take(),
        )
    }

    /// Returns the actuator's lag for a driver.
    fn lag_of(&self, seat: Seat) -> f64 {
        // Braking with a build-up of its own includes the actuator's lag.
        if matches!(seat, Seat::Driver(driver) if driver.has_build_up()) {
            0.0
        } else {
            self.lag_s
        }
    }

    /// Reads all positions, and the gap to the vehicle ahead in the path.
    ///
    /// A hidden vehicle is unseen for the driver, as for the ego.
    fn look(&mut self, traffic: &[usize], least_m: &mut Option<f64>) -> LaneBody {
        let ego = self.scene.lane_body(self.world.ego());
        let seen = self.scene.seen();
        self.others.clear();
        for &i in traffic {
            let other = self.scene.lane_body(i);
            let encounter = between(&ego, &other);
            // Only vehicles ahead in the ego's way have a gap that it keeps.
            if encounter.clearance_m() < 0.0 && ego.x_m < other.x_m {
                let gap_m = encounter.gap_m();
                *least_m = Some(least_m.map_or(gap_m, |least| least.min(gap_m)));
            }
            self.others
                .push(if seen[i] { other } else { LaneBody::unseen() });
        }
        ego
    }

    /// Returns the recorded ego's next command.
    ///
    /// The kinematic plant answers commands of the rigid plant differently. The command
    /// then reproduces the recorded speed instead.
    fn as_recorded(
        &mut self,
        case: &RecordedEpisode,
        sample: usize,
        ego: &LaneBody,
    ) -> BodyCommand {
        let then = case.whole.at(sample)[self.world.ego()];
        let is_exact = self.world.spec().plant == PlantKind::Kinematic;
        match then.command {
            // The kinematic plant repeats a command to the bit, and the rigid one from
            // another state does not.
            Some(command @ BodyCommand::Drive { .. }) if is_exact => command,
            _ if sample < case.recorded => {
                let gained_mps = then.state.speed_mps - ego.speed_mps;
                self.scene.keep_lane(gained_mps / self.sample_s)
            }
            // After the record there is no speed left to reproduce.
            _ => self.scene.keep_lane(then.state.accel_mps2),
        }
    }

    /// Returns the acceleration of the vehicle for the response of the driver.
    fn accel(
        &self,
        at_wheel: &mut ReferenceDriverRun,
        seat: Seat,
        ego: &LaneBody,
        nominal_mps: f64,
    ) -> f64 {
        // A driver returns to the nominal speed gently, as the stock egos of these
        // drivers do.
        let nominal = || {
            let wish_mps2 = (nominal_mps - ego.speed_mps) / self.sample_s;
            wish_mps2.clamp(-NOMINAL_MPS2, NOMINAL_MPS2)
        };
        // In a curve, tyre forces that keep the lane are not available for braking.
        let across_mps2 = ego.speed_mps * ego.speed_mps * self.scene.curvature_per_m();
        // The friction is that of the start at which the scene was taken up.
        let grip_mps2 = self.scene.road().friction() * self.grip * GRAVITY_MPS2;
        let cap_mps2 = (grip_mps2 * grip_mps2 - across_mps2 * across_mps2)
            .max(0.0)
            .sqrt();
        let wish_mps2 = match (seat, &mut at_wheel.driver) {
            // Full brakes have no reaction time and no build-up.
            (Seat::FullBrakes, _) => -cap_mps2,
            (Seat::Driver(_), Some(driver)) => match driver.step(ego, &self.others) {
                Response::Nominal => nominal(),
                Response::Hold => 0.0,
                Response::Brake(brake_mps2) => -brake_mps2.min(cap_mps2),
            },
            _ => nominal(),
        };
        at_wheel.note();
        // The actuator lags behind nominal commands, too.
        at_wheel.actuator.step(wish_mps2)
    }

    fn contact_of(&self, touch: ContactEvent) -> Option<ReplayContact> {
        let with = other_of(&self.world, &touch)?;
        let ego = self.scene.lane_body(self.world.ego());
        Some(ReplayContact {
            struck: struck(&ego, &self.scene.lane_body(with)),
            with: self.world.spec().agents[with].name.clone(),
            time_s: touch.time_s,
            closing_speed_mps: touch.closing_speed_mps,
        })
    }

    fn outcome(
        &self,
        case: &RecordedEpisode,
        contact: Option<ReplayContact>,
        least_m: Option<f64>,
        reacted_s: Option<f64>,
        judged: Option<ReplayRows>,
    ) -> DriverOutcome {
        let recorded = case.whole.contact.as_ref();
        let recorded_mps = recorded.map_or(0.0, |touch| touch.closing_speed_mps);
        let now_mps = contact.as_ref().map(|it| it.closing_speed_mps);
        let judged = judged.map(|rows| rows.judge(&self.rulebook));
        DriverOutcome {
            avoided: contact.is_none(),
            // Below 0 for a contact, so that one number orders all outcomes.
            margin: now_mps.map(|closing_mps| -closing_mps).or(least_m),
            saved_mps: recorded_mps - now_mps.unwrap_or(0.0),
            contact,
            reacted_s,
            rules_kept: judged.filter(|_| self.repeats_rules).map(|(kept, _)| kept),
            robustness: judged
                .filter(|_| self.repeats_spec)
                .map(|(_, robustness)| robustness),
        }
    }
}

impl RecordedEpisode {
    /// Returns the takeover of a driver, or `None` without a danger to react to.
    fn handed_over_to(&self, driver: ReferenceDriver) -> Option<(DriveInterval, Seat)> {
        let (from, seat) = match driver {
            ReferenceDriver::Ideal => (self.danger?, Seat::FullBrakes),
            _ => (self.handover?, Seat::Driver(driver)),
        };
        let nominal = NominalSpeed::Recorded;
        Some((DriveInterval { from, nominal }, seat))
    }

    /// Returns the speed of the ego at a sample without danger.
    fn nominal_mps(&self, nominal: NominalSpeed, sample: usize, ego: usize) -> f64 {
        let sample = match nominal {
            NominalSpeed::Initial => 0,
            // After the record the ego keeps its last speed.
            NominalSpeed::Recorded => sample.min(self.recorded - 1),
        };
        self.whole.at(sample)[ego].state.speed_mps
    }
}

/// Returns the rank of a driver by its success.
///
/// They avoid 99, 84, 82, 71, 66, 66 and 55 % of the cut-ins to which the ego does not
/// react.
fn chances(driver: ReferenceDriver) -> usize {
    use ReferenceDriver::{Cc, CcLane, CcLatched, Fsm, Ideal, Reg, Rss};
    let order = [Ideal, Rss, Fsm, Reg, CcLatched, CcLane, Cc];
    order
        .iter()
        .position(|it| *it == driver)
        .unwrap_or(usize::MAX)
}
