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
        member.plant = PlantKind::Kinematic;
        let cheap = self.cheap.as_ref().unwrap_or(self.scenario);
        cheap.place_member(&family.variant(&member), first);
    }
}
