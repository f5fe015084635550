//! Request of a risk, with its settings.

use std::path::PathBuf;

use serde_json::json;

use super::record::KnownFailure;
use super::script_search::SEARCHING;
use super::traffic::RiskTraffic;
use crate::content_hash;
use crate::experiment::{EgoUnderTest, Watch};
use crate::rl::Policy;
use crate::sim::PlantKind;
use crate::surrogate::SurrogateWorld;

/// Version of the stored runs, which changes with their meaning.
const STORED_RUNS: u32 = 3;
/// Most runs with random actions.
const EXPLORING: usize = 5_000;
/// Most runs of the round that only learns on the plant of the ego.
///
/// Proposals from random actions alone may miss a part of the failures, with a narrow
/// interval.
const LEARNING_ON_OWN: usize = 5_000;

/// Request of a risk.
#[derive(Clone)]
#[non_exhaustive]
pub struct RiskRequest<'a> {
    /// Laws of the traffic.
    pub traffic: &'a RiskTraffic,
    /// Egos. The ratio of two is of the first to the second.
    pub egos: &'a [EgoUnderTest],
    /// Counterexamples from elsewhere.
    pub known: &'a [KnownFailure],
    /// Numbers of runs.
    pub settings: RiskSettings,
    /// Policy of a trained ado, by which a surrogate sees more dangerous situations.
    pub policy: Option<&'a dyn Policy>,
    /// Directory of finished runs, to be resumed from.
    pub dir: Option<PathBuf>,
}

/// Numbers of runs of a risk.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RiskSettings {
    /// Most runs of an ego.
    pub budget: usize,
    /// Natural runs before all others.
    pub natural: usize,
    /// Half-width of the interval at which it stops, as a share of the estimate.
    pub width: f64,
    /// Seed of all draws.
    pub seed: u64,
    /// Plant on which proposals are learned, if not the plant of the egos.
    pub learn_on: Option<PlantKind>,
    /// Runs of the ego from which a surrogate is fitted, to learn the proposals in.
    pub surrogate: Option<u64>,
}

impl Default for RiskSettings {
    fn default() -> RiskSettings {
        RiskSettings {
            budget: 100_000,
            natural: 10_000,
            width: 0.25,
            seed: 0,
            learn_on: None,
            surrogate: None,
        }
    }
}

/// Returns everything of an ego on which its runs depend.
///
/// A name alone would not reveal an ego that has changed.
fn ego_identity(ego: &EgoUnderTest) -> serde_json::Value {
    let scenario = ego.scenario();
    json!([
        ego.name(),
        ego.change(),
        scenario.text(),
        scenario.plant(),
        // A rebuilt program is another ego.
        ego.program_content().map(|content| content.sha256),
    ])
}

impl RiskSettings {
    /// Returns the numbers of natural runs, of runs with random actions, of runs of a search
    /// and of a learning round on the ego's own plant.
    pub(super) fn before_rounds(&self) -> [usize; 4] {
        let natural = self.natural.min(self.budget);
        let left = self.budget - natural;
        // Few, because runs that only learn are not part of the estimate.
        [
            natural,
            EXPLORING.min(left / 10),
            SEARCHING.min(left / 5),
            LEARNING_ON_OWN.min(left / 10),
        ]
    }
}

impl<'a> RiskRequest<'a> {
    /// Creates a request with 100,000 runs per ego and a half-width of 25 %.
    pub fn new(traffic: &'a RiskTraffic, egos: &'a [EgoUnderTest]) -> RiskRequest<'a> {
        RiskRequest {
            traffic,
            egos,
            known: &[],
            settings: RiskSettings::default(),
            policy: None,
            dir: None,
        }
    }

    /// Returns what the stored runs depend on, as the SHA-256 of JSON.
    ///
    /// Budget and width only decide on the number of rounds. So a request with a greater
    /// budget continues from the runs of a smaller one, if both have the same runs before
    /// the rounds. A small budget has fewer of them.
    pub(super) fn fingerprint(&self) -> String {
        let settings = RiskSettings {
            budget: 0,
            natural: 0,
            width: 0.0,
            ..self.settings
        };
        let egos = self.egos.iter().map(ego_identity);
        let known = self
            .known
            .iter()
            .map(|it| json!([it.start, it.noise, it.actions]));
        content_hash::fingerprint(&json!({
            // Another version may play the same request differently.
            "version": env!("CARGO_PKG_VERSION"),
            "stored_runs": STORED_RUNS,
            "egos": egos.collect::<Vec<_>>(),
            "traffic": self.traffic.sha256,
            "known": known.collect::<Vec<_>>(),
            "settings": settings,
            "before_rounds": self.settings.before_rounds(),
        }))
    }

    /// Returns the worlds with a surrogate of every ego, if any. `None`: stopped.
    ///
    /// A world whose starts differ with a surrogate has none, and neither has an ego that
    /// never ran.
    pub(super) fn surrogates(&self, watch: &Watch<'_>) -> Option<Vec<Option<SurrogateWorld>>> {
        let RiskSettings {
            surrogate,
            seed,
            learn_on,
            ..
        } = self.settings;
        let Some(runs) = surrogate else {
            return Some(vec![None; self.egos.len()]);
        };
        // The quickest plant, unless another one is named.
        let plant = learn_on.unwrap_or(PlantKind::Kinematic);
        let worlds = self.egos.iter().map(|ego| {
            watch.phase(&format!("learning {}", ego.name()));
            let (world, quiet) = (ego.scenario(), watch.quiet());
            let found = SurrogateWorld::learned(world, self.policy, runs, seed, plant, &quiet);
            // Sensors of a surrogate are exact, so starts may have no axes of sensors.
            found.filter(|it| it.scenario.axes() == world.axes())
        });
        // Learned before the question, because a stop in between leaves worlds out.
        let learned = worlds.collect();
        (!watch.stopped()).then_some(learned)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, world};
    use super::*;
    use crate::ego::{Command, Controller, Fault, Percept};
    use crate::scene::Start;
    use crate::world::Scenario;

    fn known(change: fn(&mut KnownFailure)) -> Vec<KnownFailure> {
        let mut known = KnownFailure {
            start: Start(vec![30.0]),
            noise: 0,
            actions: vec![0],
        };
        change(&mut known);
        vec![known]
    }

    #[test]
    fn everything_that_changes_a_stored_run_changes_the_digest() {
        let world = world();
        let weak = EgoUnderTest::find(&world, "weak brakes").expect("fits")[0].clone();
        let traffic = |text: &str| RiskTraffic::parse(&world, "t.ron", text).expect("sound");
        let (own, rarer) = (traffic(TRAFFIC), traffic(&TRAFFIC.replace("0.02", "0.01")));
        let egos = [EgoUnderTest::nominal(&world)];
        let digest = |change: &dyn Fn(&mut RiskRequest<'_>)| {
            let mut request = RiskRequest::new(&own, &egos);
            change(&mut request);
            request.fingerprint()
        };
        let others = [
            [weak.clone()],
            [EgoUnderTest::nominal(&world.on(PlantKind::Rigid))],
        ];
        let both = [EgoUnderTest::nominal(&world), weak];
        let lists = [
            known(|_| {}),
            known(|it| it.noise = 1),
            known(|it| it.start = Start(vec![31.0])),
            known(|it| it.actions.push(1)),
        ];
        let mut all = vec![
            digest(&|_| {}),
            RiskRequest::new(&rarer, &egos).fingerprint(),
            RiskRequest::new(&own, &both).fingerprint(),
            digest(&|it| it.settings.seed = 1),
            digest(&|it| it.settings.natural = 9_000),
            // Fewer runs are left to learn from.
            digest(&|it| it.settings.budget = 20_000),
            digest(&|it| it.settings.learn_on = Some(PlantKind::Kinematic)),
            digest(&|it| it.settings.surrogate = Some(100)),
        ];
        all.extend(
            others
                .iter()
                .map(|it| RiskRequest::new(&own, it).fingerprint()),
        );
        all.extend(lists.iter().map(|it| {
            let mut request = RiskRequest::new(&own, &egos);
            request.known = it;
            request.fingerprint()
        }));
        let mut distinct = all.clone();
        distinct.sort();
        distinct.dedup();
        assert_eq!(distinct.len(), all.len(), "{all:?}");
        // More rounds of the same runs.
        assert_eq!(digest(&|it| it.settings.budget = 1_000_000), all[0]);
        assert_eq!(digest(&|it| it.settings.width = 0.01), all[0]);
    }

    #[test]
    fn a_budget_is_shared_between_natural_learning_and_counted_runs() {
        let before = |budget, natural| {
            let settings = RiskSettings {
                budget,
                natural,
                ..RiskSettings::default()
            };
            settings.before_rounds()
        };
        assert_eq!(before(1_000, 10_000), [1_000, 0, 0, 0]);
        assert_eq!(before(20_000, 10_000), [10_000, 1_000, 2_000, 1_000]);
        assert_eq!(before(100_000, 10_000), [10_000, 5_000, 5_000, 5_000]);
    }

    /// Drives like the world's own ego would coast.
    struct Coasting;

    impl Controller for Coasting {
        fn reset(&mut self, _: u64) {}

        fn control(&mut self, _: &Percept) -> Result<Command, Fault> {
            Ok(Command::accelerate(0.0))
        }

        fn fork(&self) -> Option<Box<dyn Controller>> {
            None
        }
    }

    #[test]
    fn every_part_of_an_ego_changes_the_digest() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let of = |ego: &EgoUnderTest| {
            let egos = [ego.clone()];
            RiskRequest::new(&traffic, &egos).fingerprint()
        };
        // Only the name differs.
        let own = |name: &str| {
            let factory = || Box::new(Coasting) as Box<dyn Controller>;
            let ego = EgoUnderTest::own(&world, name, std::sync::Arc::new(factory));
            ego.expect("driven").in_world(world.clone())
        };
        // Only the change differs.
        let changes = ["weak brakes", "strong brakes"].map(|name| {
            let ego = EgoUnderTest::changed(&world, "same", &world.reuse()[name], "none");
            ego.expect("fits").in_world(world.clone())
        });
        // Only the world differs.
        let text = world.text().replace("d_safe\": 4.7", "d_safe\": 4.8");
        assert_ne!(text, world.text());
        let stricter = Scenario::parse("acc.ron", &text)
            .expect("sound")
            .on(PlantKind::Kinematic);
        let [weak, strong] = changes;
        let egos = [
            own("one"),
            own("other"),
            weak,
            strong,
            EgoUnderTest::nominal(&world),
            EgoUnderTest::nominal(&stricter),
        ];
        let mut all: Vec<String> = egos.iter().map(of).collect();
        all.sort();
        all.dedup();
        assert_eq!(all.len(), egos.len());
        // A rebuilt program has its old command.
        let dir = tempfile::tempdir().expect("a directory");
        let file = dir.path().join("ego.sh");
        let program = EgoUnderTest::program(&world, &[file.display().to_string()]).expect("driven");
        let built = |text: &str| {
            std::fs::write(&file, text).expect("written");
            of(&program)
        };
        let first = built("#!/bin/sh\necho 1\n");
        assert_ne!(built("#!/bin/sh\necho 2\n"), first);
        assert_eq!(built("#!/bin/sh\necho 1\n"), first);
    }

    #[test]
    fn a_request_without_surrogates_has_none_for_any_ego() {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        let egos = [EgoUnderTest::nominal(&world), EgoUnderTest::nominal(&world)];
        let found = RiskRequest::new(&traffic, &egos)
            .surrogates(&Watch::unwatched())
            .expect("not stopped");
        assert!(found.len() == 2 && found.iter().all(Option::is_none));
    }
}
