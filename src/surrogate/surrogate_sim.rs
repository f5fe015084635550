//! Model of a world: its road and rules, with the surrogate in the ego's place.

use std::sync::{Arc, Mutex, PoisonError};

use super::emergency_brake::Situation;
use super::features::{Features, ModelInputs};
use super::model::Surrogate;
use super::model_fit::{EgoInputs, MODELS};
use crate::ego::{Briefing, Command, Controller, Fault, Percept};
use crate::rl::Policy;
use crate::scene::Start;
use crate::scene::drive::{ControllerFactory, Course};
use crate::sim::{PlantKind, Pose};
use crate::testbench::{Aftermath, Testbench};
use crate::world::DriveScenario;

/// Start with the seed of its noise.
pub(super) type NoisyStart<'a> = (&'a Start, u64);

/// Known actions of the ado and motion of the ego, up to now.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RunPrefix {
    pub actions: Vec<usize>,
    pub motion: Vec<MotionSample>,
}

impl RunPrefix {
    /// Returns the part up to a number of decisions.
    pub(super) fn up_to(&self, decisions: usize, samples_per_decision: usize) -> RunPrefix {
        // A motion has a sample more than intervals: the sample at the start.
        let moments = (decisions * samples_per_decision + 1).min(self.motion.len());
        RunPrefix {
            actions: self.actions[..decisions].to_vec(),
            motion: self.motion[..moments].to_vec(),
        }
    }
}

/// Variation of the predicted ego.
///
/// It uses one member of the ensemble or the mean of all members. The bias makes the
/// ego a little more or less careful.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurrogateVariation {
    pub member: Option<usize>,
    pub bias_mps3: f64,
}

/// Variations that a plan is tried on, the surrogate itself first.
///
/// A plan that succeeds on all of them tolerates a small prediction error.
/// The variations ease off, or brake, a little more at every sample than predicted.
/// The careful variations are close together, because an ego that brakes at the last
/// moment leaves only centimetres. Among the plans that fit these centimetres, the
/// search must find the plan with the largest margin.
pub(super) const VARIATIONS: [SurrogateVariation; 12] = {
    const fn mean(bias_mps3: f64) -> SurrogateVariation {
        let member = None;
        SurrogateVariation { member, bias_mps3 }
    }
    const fn one(member: usize, bias_mps3: f64) -> SurrogateVariation {
        let member = Some(member);
        SurrogateVariation { member, bias_mps3 }
    }
    [
        mean(0.0),
        one(0, 0.0),
        one(1, 0.0),
        one(0, 0.05),
        one(1, 0.2),
        one(0, 0.5),
        mean(-0.02),
        one(0, -0.05),
        one(1, -0.05),
        one(0, -0.1),
        one(1, -0.2),
        one(0, -0.5),
    ]
};

/// Returns the number of inputs per sample in a world.
pub(super) fn width_of(world: DriveScenario<'_>) -> usize {
    let spec = world.spec();
    Features::width(spec.agents.len() - 1, spec.lights.len()) + MODELS
}

/// Model world that is played decision by decision.
pub(super) struct ModelBench {
    pub bench: Testbench,
    pub driver_slot: ModelDriverSlot,
    reader: MotionReader,
    obs: Vec<f32>,
}

impl ModelBench {
    /// Returns a model of `world` on the kinematic plant.
    ///
    /// It is faster than the rigid plant. Lane changes differ by some centimetres.
    pub(super) fn quick(world: DriveScenario<'_>) -> ModelBench {
        ModelBench::on(world, PlantKind::Kinematic)
    }

    /// Returns the same model on any plant.
    pub(super) fn on(world: DriveScenario<'_>, plant: PlantKind) -> ModelBench {
        let driver_slot = ModelDriverSlot::default();
        // The bench takes its driver from `driver_slot`, so the part can change between episodes.
        let bench = world.as_model(plant, driver_slot.factory()).bench();
        ModelBench {
            obs: vec![0.0; bench.spaces().observation],
            bench,
            driver_slot,
            reader: MotionReader::of(world),
        }
    }

    /// Begins at a start and repeats the known actions.
    pub(super) fn begin(
        &mut self,
        from: NoisyStart<'_>,
        so_far: &RunPrefix,
        surrogate: Option<&Arc<Surrogate>>,
        variation: SurrogateVariation,
    ) {
        self.set_ego(so_far, surrogate, variation);
        self.bench.begin(from.0, from.1, Aftermath::Skip);
        for &action in &so_far.actions {
            // The model can reach its verdict earlier than the recorded run did.
            if self.bench.is_done() {
                break;
            }
            self.bench.decide(action);
        }
    }

    /// Sets the motion and the surrogate that the ego follows in the next episodes.
    pub(super) fn set_ego(
        &self,
        so_far: &RunPrefix,
        surrogate: Option<&Arc<Surrogate>>,
        variation: SurrogateVariation,
    ) {
        self.driver_slot.set(ModelDriverConfig {
            known: so_far.motion.as_slice().into(),
            surrogate: surrogate.cloned(),
            member: variation.member,
            bias_mps3: variation.bias_mps3,
            inputs: None,
        });
    }

    /// Plays `actions`, the last action held, until the verdict.
    pub(super) fn play_actions(&mut self, actions: &[usize]) {
        let mut rest = actions.iter();
        let mut action = 0;
        while !self.bench.is_done() {
            // An empty plan holds action 0.
            action = *rest.next().unwrap_or(&action);
            self.bench.decide(action);
        }
    }

    /// Follows a policy until the verdict.
    pub(super) fn follow(&mut self, policy: &dyn Policy) {
        while !self.bench.is_done() {
            self.bench.observe(&mut self.obs);
            let action = policy.act(&self.obs);
            self.bench.decide(action);
        }
    }

    /// Returns whether the ego violated its specification and the ado kept every rule.
    pub(super) fn is_success(&self) -> bool {
        self.bench
            .verdict()
            .is_some_and(|verdict| verdict.is_success())
    }

    /// Returns the motion of the ego.
    pub(super) fn motion(&self) -> Vec<MotionSample> {
        let mut motion = Vec::new();
        self.reader.follow(&self.bench, &mut motion);
        motion
    }

    /// Returns the ego's percepts in a run, sample by sample.
    pub(super) fn percepts(&mut self, from: NoisyStart<'_>, run: &RunPrefix) -> EgoInputs {
        let inputs = Arc::new(Mutex::new(EgoInputs::default()));
        // Without a surrogate the ego follows the recorded motion only.
        self.driver_slot.set(ModelDriverConfig {
            known: run.motion.as_slice().into(),
            inputs: Some(Arc::clone(&inputs)),
            ..ModelDriverConfig::default()
        });
        self.bench.begin(from.0, from.1, Aftermath::Skip);
        self.play_actions(&run.actions);
        std::mem::take(&mut *inputs.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Largest acceleration of a car, m/s².
const MOST_ACCEL_MPS2: f64 = 15.0;
/// Largest lateral speed of a car, m/s.
const MOST_LATERAL_MPS: f64 = 4.0;

/// Behaviour of a model's driver in the next episode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelDriverConfig {
    /// Recorded motion of the ego, which is repeated sample by sample.
    pub known: Arc<[MotionSample]>,
    /// Behaviour afterwards. `None`: constant acceleration.
    pub surrogate: Option<Arc<Surrogate>>,
    /// Member of the ensemble. `None`: the mean of all.
    pub member: Option<usize>,
    /// Jerk added to every answer, which makes the ego more or less careful.
    pub bias_mps3: f64,
    /// Record of the percepts of every sample.
    pub inputs: Option<Arc<Mutex<EgoInputs>>>,
}

/// Slot that hands a part to the driver of a model at the start of an episode.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelDriverSlot(Arc<Mutex<ModelDriverConfig>>);

impl ModelDriverSlot {
    pub(super) fn set(&self, config: ModelDriverConfig) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = config;
    }

    fn take(&self) -> ModelDriverConfig {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Returns a factory of drivers that play the parts given here.
    pub(super) fn factory(&self) -> ControllerFactory {
        let driver_slot = self.clone();
        Arc::new(move || {
            Box::new(ModelDriver {
                driver_slot: driver_slot.clone(),
                config: ModelDriverConfig::default(),
                briefing: Briefing::default(),
                model_inputs: ModelInputs::default(),
                row: Vec::new(),
                scaled: Vec::new(),
                sample: 0,
            })
        })
    }
}

/// Driver that repeats the recorded motion and then follows the surrogate.
#[derive(Clone)]
struct ModelDriver {
    driver_slot: ModelDriverSlot,
    config: ModelDriverConfig,
    briefing: Briefing,
    model_inputs: ModelInputs,
    row: Vec<f32>,
    scaled: Vec<f32>,
    sample: usize,
}

impl ModelDriver {
    fn command(&mut self, percept: &Percept) -> Command {
        let own = &percept.own;
        let known = &self.config.known;
        if let (Some(here), Some(next)) = (known.get(self.sample), known.get(self.sample + 1)) {
            // The command starts from the model's own speed, so deviations are corrected.
            return Command {
                accel_mps2: (next.speed_mps - own.speed_mps) / percept.sample_s,
                lateral_mps: (next.lateral_m - here.lateral_m) / percept.sample_s,
            };
        }
        let Some(surrogate) = &self.config.surrogate else {
            return Command::accelerate(own.accel_mps2);
        };
        let [change_mps2, lateral_mps] =
            surrogate.answer(self.config.member, &self.row, &mut self.scaled);
        let braking_mps2 = surrogate
            .brake
            .and_then(|brake| brake.change_mps2(&Situation::of(percept)));
        // The brake only adds braking, so the harder of both applies.
        let change_mps2 = braking_mps2.map_or(change_mps2, |braking| change_mps2.min(braking));
        let accel_mps2 = own.accel_mps2 + change_mps2 + self.config.bias_mps3 * percept.sample_s;
        // A prediction outside the recorded range would be an extrapolation.
        let [least, most] = surrogate.range_mps2;
        Command {
            accel_mps2: accel_mps2.clamp(least, most),
            lateral_mps,
        }
    }
}

impl Controller for ModelDriver {
    fn brief(&mut self, briefing: &Briefing) {
        self.briefing = briefing.clone();
    }

    fn reset(&mut self, _seed: u64) {
        self.config = self.driver_slot.take();
        self.sample = 0;
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        if let Some(inputs) = &self.config.inputs {
            let mut inputs = inputs.lock().unwrap_or_else(PoisonError::into_inner);
            inputs.percepts.push(percept.clone());
            inputs.briefing = self.briefing.clone();
        }
        // The row is read during the recorded motion too, because it holds past frames.
        if let Some(surrogate) = &self.config.surrogate {
            if self.sample == 0 {
                self.model_inputs
                    .begin(&surrogate.nearest, &self.briefing, percept);
            }
            self.model_inputs.read(percept, &mut self.row);
        }
        let Command {
            accel_mps2,
            lateral_mps,
        } = self.command(percept);
        self.sample += 1;
        Ok(Command {
            accel_mps2: accel_mps2.clamp(-MOST_ACCEL_MPS2, MOST_ACCEL_MPS2),
            lateral_mps: lateral_mps.clamp(-MOST_LATERAL_MPS, MOST_LATERAL_MPS),
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(self.clone()))
    }
}

/// Position and speed of an ego at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MotionSample {
    /// Position along the road.
    pub s_m: f64,
    /// Position to the left of the middle of lane 0.
    pub lateral_m: f64,
    /// Speed along the heading.
    pub speed_mps: f64,
}

impl MotionSample {
    /// Returns the distance between two positions on the road.
    pub(super) fn distance_m(&self, other: &MotionSample) -> f64 {
        libm::hypot(self.s_m - other.s_m, self.lateral_m - other.lateral_m)
    }

    /// Returns whether two motions differ too much to share a plan.
    pub(super) fn strays_from(&self, other: &MotionSample) -> bool {
        const APART_M: f64 = 0.1;
        const APART_MPS: f64 = 0.1;
        APART_M < self.distance_m(other) || APART_MPS < (self.speed_mps - other.speed_mps).abs()
    }
}

/// Reader of the ego's motion from the traces of a world.
#[derive(Clone, Debug)]
pub(super) struct MotionReader {
    columns: [usize; 3],
    course: Arc<Course>,
}

impl MotionReader {
    /// Returns a reader for the traces of `world`.
    pub(super) fn of(world: DriveScenario<'_>) -> MotionReader {
        MotionReader {
            columns: world.ego_columns(),
            course: Arc::new(world.world().course().clone()),
        }
    }

    /// Appends the samples of a bench that `motion` does not hold yet.
    pub(super) fn follow(&self, bench: &Testbench, motion: &mut Vec<MotionSample>) {
        let [x, y, speed] = self.columns.map(|column| bench.trace().column(column));
        // After a held contact the trace continues to the horizon, but the motion ends.
        let moved = bench.physics_steps() / u64::from(bench.clock().substeps);
        for sample in motion.len()..=moved as usize {
            let at = self.course.locate(&Pose {
                x_m: x[sample],
                y_m: y[sample],
                // The heading has no influence on the position along the road.
                heading_rad: 0.0,
            });
            motion.push(MotionSample {
                s_m: at.s_m,
                lateral_m: at.lateral_m,
                speed_mps: speed[sample],
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ego::Own;
    use crate::seed::{Purpose, StartKey};
    use crate::surrogate::model::tests::surrogate;
    use crate::testbench::{HOLD_DECISIONS, HeldRandom, play};
    use crate::world::Scenario;

    /// Returns a model on the world's own plant.
    fn own(world: DriveScenario<'_>) -> ModelBench {
        ModelBench::on(world, world.spec().plant)
    }

    /// Returns a run of the real ego of `world` under random actions.
    fn run_of(world: DriveScenario<'_>, index: u64) -> (Start, u64, RunPrefix) {
        let mut bench = world.bench();
        let key = StartKey {
            purpose: Purpose::Calibration,
            seed: 3,
            index,
        };
        let (start, noise) = (bench.draw(key), bench.noise_of(key));
        let mut actor = HeldRandom::new(bench.spaces().actions, HOLD_DECISIONS);
        let episode = play(&mut bench, &start, noise, &mut actor, Aftermath::Skip);
        let mut motion = Vec::new();
        MotionReader::of(world).follow(&bench, &mut motion);
        let actions = episode.actions;
        (start, noise, RunPrefix { actions, motion })
    }

    #[test]
    fn a_model_does_again_what_an_ego_is_known_to_have_done() {
        for (name, plant, apart_m) in [
            ("acc", PlantKind::Kinematic, 0.03),
            ("acc", PlantKind::Rigid, 0.2),
            ("bend", PlantKind::Kinematic, 0.1),
        ] {
            let world = Scenario::shipped(name).expect("shipped").expect("sound");
            let world = world.on(plant);
            let world = world.drive().expect("driven");
            for mut model in [own(world), ModelBench::quick(world)] {
                for index in 0..4 {
                    let (start, noise, run) = run_of(world, index);
                    model.begin((&start, noise), &run, None, VARIATIONS[0]);
                    let both = run.motion.iter().zip(model.motion());
                    for (sample, (there, here)) in both.enumerate() {
                        let off_m = there.distance_m(&here);
                        assert!(
                            off_m < apart_m,
                            "{name} {plant:?} {index}: {off_m} m at {sample}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn on_the_worlds_own_plant_the_ado_moves_as_it_does_there() {
        let world = Scenario::shipped("merge_fair");
        let world = world.expect("shipped").expect("sound");
        let world = world.drive().expect("driven");
        assert_eq!(world.spec().plant, PlantKind::Rigid);
        let (mut own, mut quick) = (own(world), ModelBench::quick(world));
        let columns = ["ado.x", "ado.y"].map(|name| world.world().schema().position(name));
        let [x, y] = columns.map(|column| column.expect("published"));
        let place = |bench: &Testbench| -> Vec<(f64, f64)> {
            let of = |column| bench.trace().column(column).iter().copied();
            of(x).zip(of(y)).collect()
        };
        let [mut off_own_m, mut off_quick_m] = [0.0f64; 2];
        for index in 0..4 {
            let (start, noise, run) = run_of(world, index);
            let mut real = world.bench();
            real.begin(&start, noise, Aftermath::Skip);
            run.actions.iter().for_each(|&action| real.decide(action));
            let off_m = |model: &mut ModelBench| {
                model.begin((&start, noise), &run, None, VARIATIONS[0]);
                let pairs = place(&real).into_iter().zip(place(&model.bench));
                let apart = pairs.map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1));
                apart.fold(0.0, f64::max)
            };
            off_own_m = off_own_m.max(off_m(&mut own));
            off_quick_m = off_quick_m.max(off_m(&mut quick));
        }
        assert!(off_own_m < 1e-3, "{off_own_m}");
        assert!(
            10.0 * off_own_m < off_quick_m && 0.01 < off_quick_m,
            "{off_quick_m}"
        );
    }

    #[test]
    fn what_an_ego_saw_is_written_down_once_per_sample() {
        let world = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let world = world.drive().expect("driven");
        let (start, noise, run) = run_of(world, 1);
        let mut model = own(world);
        let inputs = model.percepts((&start, noise), &run);
        assert!(run.motion.len().abs_diff(inputs.percepts.len() + 1) <= 1);
        assert!(0.0 < inputs.briefing.sample_s);
        for (percept, moment) in inputs.percepts.iter().zip(&run.motion) {
            assert!((percept.own.speed_mps - moment.speed_mps).abs() < 0.05);
        }
    }

    #[test]
    fn it_brakes_and_accelerates_no_harder_than_was_seen() {
        let percept = Percept {
            sample_s: 0.05,
            own: Own {
                speed_mps: 20.0,
                ..Own::default()
            },
            ..Percept::default()
        };
        // An answer of this size exceeds every limit.
        for unit_mps2 in [1e6, -1e6] {
            let driver_slot = ModelDriverSlot::default();
            driver_slot.set(ModelDriverConfig {
                surrogate: Some(Arc::new(surrogate([-4.0, 2.0], unit_mps2))),
                ..ModelDriverConfig::default()
            });
            let mut driver = driver_slot.factory()();
            driver.reset(0);
            let command = driver.control(&percept).expect("it drives");
            assert!([-4.0, 2.0].contains(&command.accel_mps2), "{command:?}");
        }
    }
}
