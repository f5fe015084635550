//! Model of a world: its road and rules, with the surrogate in the ego's place.

use std::sync::{Arc, Mutex, PoisonError};

use super::ego_motion::{MotionReader, MotionSample};
use super::features::Features;
use super::fitted_model::MODELS;
use super::model::Surrogate;
use super::model_driver::{ModelDriverConfig, ModelDriverSlot};
use super::model_fit::EgoInputs;
use crate::rl::Policy;
use crate::sim::PlantKind;
use crate::testbench::{Aftermath, NoisyStart, Testbench};
use crate::world::DriveScenario;

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
    // The ego sees the lights of the world's own road.
    Features::width(spec.agents.len() - 1, spec.lights_of(0).count()) + MODELS
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
        // Planning needs the verdict alone, and nothing is simulated after it.
        self.bench.begin(from.start, from.noise, Aftermath::Skip);
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
        self.bench.begin(from.start, from.noise, Aftermath::Skip);
        self.play_actions(&run.actions);
        std::mem::take(&mut *inputs.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Start;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::{HOLD_DECISIONS, HeldRandom, play};
    use crate::world::Scenario;

    /// Returns a model on the world's own plant.
    fn own(world: DriveScenario<'_>) -> ModelBench {
        ModelBench::on(world, world.spec().plant)
    }

    fn noisy(start: &Start, noise: u64) -> NoisyStart<'_> {
        NoisyStart { start, noise }
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
            let scenario = Scenario::shipped(name)
                .expect("shipped")
                .expect("sound")
                .on(plant);
            let world = scenario.drive().expect("driven");
            for mut model in [own(world), ModelBench::quick(world)] {
                for index in 0..4 {
                    let (start, noise, run) = run_of(world, index);
                    model.begin(noisy(&start, noise), &run, None, VARIATIONS[0]);
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
        let scenario = Scenario::shipped("merge_fair")
            .expect("shipped")
            .expect("sound");
        let world = scenario.drive().expect("driven");
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
                model.begin(noisy(&start, noise), &run, None, VARIATIONS[0]);
                let pairs = place(&real).into_iter().zip(place(&model.bench));
                let apart = pairs.map(|(a, b)| (a.0 - b.0).hypot(a.1 - b.1));
                apart.fold(0.0, f64::max)
            };
            off_own_m = off_own_m.max(off_m(&mut own));
            off_quick_m = off_quick_m.max(off_m(&mut quick));
        }
        assert!(off_own_m < 1e-3, "{off_own_m}");
        assert!(
            10.0 * off_own_m < off_quick_m && off_quick_m > 0.01,
            "{off_quick_m}"
        );
    }

    #[test]
    fn what_an_ego_saw_is_written_down_once_per_sample() {
        let scenario = Scenario::shipped("cut_in")
            .expect("shipped")
            .expect("sound");
        let world = scenario.drive().expect("driven");
        let (start, noise, run) = run_of(world, 1);
        let mut model = own(world);
        let inputs = model.percepts(noisy(&start, noise), &run);
        assert!(run.motion.len().abs_diff(inputs.percepts.len() + 1) <= 1);
        assert!(inputs.briefing.sample_s > 0.0);
        for (percept, moment) in inputs.percepts.iter().zip(&run.motion) {
            assert!((percept.own.speed_mps - moment.speed_mps).abs() < 0.05);
        }
    }
}
