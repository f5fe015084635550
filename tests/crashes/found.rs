//! Counterexamples to look at, found by held-random search on the 2D plant.

use std::sync::LazyLock;

use brakecheck::experiment::{Watch, test_starts};
use brakecheck::search::{Hold, SearchRequest, search};
use brakecheck::testbench::{Aftermath, Episode, Replay, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;

/// The cruise control on the 2D plant.
pub fn acc() -> &'static Scenario {
    static ACC: LazyLock<Scenario> = LazyLock::new(|| {
        let text = include_str!("../../worlds/acc.ron");
        let world = Scenario::parse("acc.ron", text).expect("a world");
        world.on(PlantKind::Kinematic)
    });
    &ACC
}

/// The cut-in on the 2D plant: six actions, sideways ones among them.
pub fn cut_in() -> &'static Scenario {
    static CUT_IN: LazyLock<Scenario> = LazyLock::new(|| {
        let text = include_str!("../../worlds/cut_in.ron");
        let world = Scenario::parse("cut_in.ron", text).expect("a world");
        world.on(PlantKind::Kinematic)
    });
    &CUT_IN
}

/// An episode of recorded actions, the last one held.
pub fn replayed(world: &Scenario, of: &Episode, actions: &[usize]) -> Episode {
    let mut ado = Replay::holding(actions);
    let aftermath = Aftermath::Play;
    play(&mut world.bench(), &of.start, of.noise, &mut ado, aftermath)
}

/// Counterexamples of the cruise control, as a random search finds them.
pub fn acc_found() -> &'static [Episode] {
    static FOUND: LazyLock<Vec<Episode>> = LazyLock::new(|| found(acc(), 40));
    &FOUND
}

/// The same of the cut-in.
pub fn cut_in_found() -> &'static [Episode] {
    static FOUND: LazyLock<Vec<Episode>> = LazyLock::new(|| found(cut_in(), 14));
    &FOUND
}

/// Actions are held for five decisions, then drawn anew.
fn found(world: &Scenario, count: usize) -> Vec<Episode> {
    let watch = Watch::unwatched();
    let starts = test_starts(world, 3, count, &watch).expect("not stopped");
    let request = SearchRequest {
        scenario: world,
        ego: "nominal",
        method: Hold.into(),
        budget: 60,
        starts: &starts,
    };
    let found = search(&request, &watch).found;
    let episodes = found
        .iter()
        .zip(&starts.starts)
        .filter_map(|(found, (start, noise))| {
            let actions = found.as_ref()?.actions.as_ref()?;
            let mut ado = Replay::holding(actions);
            let aftermath = Aftermath::Play;
            Some(play(&mut world.bench(), start, *noise, &mut ado, aftermath))
        });
    let episodes: Vec<Episode> = episodes.collect();
    assert!(episodes.iter().all(|it| it.verdict.is_success()));
    assert!(episodes.len() >= 6, "{} found", episodes.len());
    episodes
}
