//! Stream of starts that are searched, each with its member of the family.

use std::sync::Arc;

use crate::scene::Start;
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;
use crate::testbench::{FIRST_KNOWN, KnownEpisode, Testbench};
use crate::world::Scenario;

/// Stream of starts, each with its member of the family.
pub(super) struct SearchStream<'a> {
    pub(super) scenario: &'a Scenario,
    /// World on the plant of the pre-screening, if another plant is requested.
    pub(super) cheap: Option<Scenario>,
    purpose: Purpose,
    seed: u64,
    /// Episodes beyond the stream, from index [`FIRST_KNOWN`] on.
    known: Arc<[KnownEpisode]>,
}

impl<'a> SearchStream<'a> {
    /// Creates the stream (purpose, seed), which is no test stream.
    pub(super) fn new(scenario: &'a Scenario, purpose: Purpose, seed: u64) -> SearchStream<'a> {
        // Invariant: training never sees a test start.
        let open = matches!(purpose, Purpose::Train | Purpose::Calibration);
        assert!(open, "test starts are not searched");
        // Kinematic runs are about a hundred times as fast. Their successes are confirmed on
        // the requested plant.
        SearchStream {
            scenario,
            cheap: scenario.screening(),
            purpose,
            seed,
            known: Arc::default(),
        }
    }

    /// Returns the stream with known episodes, whose starts follow [`FIRST_KNOWN`].
    pub(super) fn knowing(mut self, known: &Arc<[KnownEpisode]>) -> SearchStream<'a> {
        self.known = Arc::clone(known);
        self
    }

    /// Returns a known episode by its index.
    pub(super) fn known(&self, index: u64) -> Option<&KnownEpisode> {
        self.known.get(index.checked_sub(FIRST_KNOWN)? as usize)
    }

    /// Returns the starts of some indices.
    pub(super) fn starts(&self, indices: impl Iterator<Item = u64>) -> Vec<Start> {
        let scene = self.scenario.world().scene();
        let drawn = indices.map(|index| match self.known(index) {
            Some(known) => known.start.clone(),
            None => scene.draw(self.key(index)),
        });
        drawn.collect()
    }

    pub(super) fn key(&self, index: u64) -> StartKey {
        StartKey {
            purpose: self.purpose,
            seed: self.seed,
            index,
        }
    }

    /// Puts the ego of an episode on the benches, if there is a family.
    pub(super) fn place_member(
        &self,
        key: StartKey,
        first: &mut Testbench,
        target: Option<&mut Testbench>,
    ) {
        let against = self.scenario.against;
        let Some(family) = self.scenario.family().filter(|_| !against.is_nominal()) else {
            return;
        };
        // The member of the training episode of this key, or a success would not hold there.
        let mut member = family.draw(&self.scenario.name, key);
        if let Some(target) = target {
            self.scenario.place_member(&family.variant(&member), target);
        }
        // Without a pre-screening, the first bench is the one that counts.
        if self.cheap.is_some() {
            member.plant = PlantKind::Kinematic;
        }
        let cheap = self.cheap.as_ref().unwrap_or(self.scenario);
        cheap.place_member(&family.variant(&member), first);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testbench::Aftermath;
    use crate::world::TrainingEgos;

    #[test]
    fn a_member_is_searched_on_its_plant_without_a_pre_screening() {
        let text = include_str!("../../../../worlds/acc.ron")
            .replace("plants: { Kinematic: 9, Rigid: 1 }", "plants: { Rigid: 1 }");
        let world = Scenario::parse("acc.ron", &text).expect("a world");
        let family = world
            .on(PlantKind::Kinematic)
            .training_against(TrainingEgos::Randomized)
            .expect("a family");
        let stream = SearchStream::new(&family, Purpose::Train, 3);
        assert!(stream.cheap.is_none());
        let key = stream.key(0);
        let mut first = family.bench();
        stream.place_member(key, &mut first, None);
        let egos = family.family().expect("a family");
        let mut member = egos.draw(&family.name, key);
        assert_eq!(member.plant, PlantKind::Rigid);
        let mut own = family.bench();
        family.place_member(&egos.variant(&member), &mut own);
        let mut cheap = family.bench();
        member.plant = PlantKind::Kinematic;
        family.place_member(&egos.variant(&member), &mut cheap);
        let [searched, own, cheap] = [first, own, cheap].map(|mut bench| {
            let (start, noise) = (bench.draw(key), bench.noise_of(key));
            bench.begin(&start, noise, Aftermath::Skip);
            bench.decide(0);
            bench.trace().signal("ado.x").expect("published").to_vec()
        });
        assert_eq!(searched, own);
        assert_ne!(searched, cheap);
    }
}
