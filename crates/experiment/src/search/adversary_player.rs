//! Players of adversaries: ados, the best of several ados, and searches.

use super::cell::ExperimentCell;
use super::list::{Method, Switches};
use super::method::{GuidingPolicy, MethodSettings};
use super::request::SearchRequest;
use super::{SearchError, search};
use crate::adversary::{Ado, Evaluated, Heuristic, best_constant, best_then_brake, eval};
use crate::experiment::{EgoUnderTest, TestStarts, Watch};
use crate::rl::Policy;
use crate::run_dir::{AdversaryId, Stored};

/// Player of all test starts against an ego.
pub trait Adversary {
    /// Plays the starts. `None`: the adversary does not apply to the world.
    fn play(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<ExperimentCell>;
}

/// Constant action that succeeds most often.
pub struct BestConstant;

/// Acceleration and then braking, with the most successful moment.
///
/// It gives no cell in a world where the ado cannot do both.
pub struct BestSwitch;

/// Search of each start.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// Method that chooses the sequences of actions.
    pub method: Method<'a>,
    /// Simulations per start, 0 for methods without a budget.
    pub budget: u64,
}

/// Ados that anything learned must beat.
// Studies read these rows by position: held, random, and the best constant.
pub const BASELINES: [&dyn Adversary; 3] = [&Ado::Hold, &Ado::Random, &BestConstant];

/// What the players of some adversaries are made of.
#[derive(Clone, Copy, Default)]
pub struct PlayerParts<'a> {
    /// Trained policy, and the seed of its training.
    pub policy: Option<(&'a dyn Policy, u64)>,
    /// Tuned rule.
    pub heuristic: Option<&'a Heuristic>,
    /// Counterexamples of a training.
    pub stored: Option<&'a Stored>,
}

impl<'a> PlayerParts<'a> {
    /// Makes the player of an adversary.
    ///
    /// `None`: its part is missing, or it is played in another way: with a world of its own,
    /// a training, or several runs per start.
    ///
    /// # Errors
    /// The id names an unknown search, or one that requires stored counterexamples.
    pub fn player(
        &self,
        id: &'a AdversaryId,
    ) -> Result<Option<Box<dyn Adversary + 'a>>, SearchError> {
        let ado = match id {
            // These two choose among several ados after playing them, so neither is an
            // `Ado`.
            AdversaryId::BestConstant => return Ok(Some(Box::new(BestConstant))),
            AdversaryId::BestSwitch => return Ok(Some(Box::new(BestSwitch))),
            AdversaryId::Search {
                settings: Some(settings),
            } => {
                // A method reads the settings that it takes, and no list of them is kept
                // here.
                let takes = MethodSettings {
                    switches: Some(settings.switches),
                    stored: self.stored,
                    guide: self.policy.map(|(policy, _)| GuidingPolicy(policy)),
                };
                return Ok(Some(Box::new(Search {
                    method: Method::named(&settings.method, &takes)?,
                    budget: settings.budget,
                })));
            }
            AdversaryId::Trained => self.policy.map(|(policy, seed)| Ado::Trained(policy, seed)),
            AdversaryId::Composed => Some(Ado::Composed),
            AdversaryId::Neutral => Some(Ado::Neutral),
            AdversaryId::Random => Some(Ado::Random),
            AdversaryId::Hold => Some(Ado::Hold),
            AdversaryId::Constant { action, .. } => Some(Ado::Constant(*action)),
            AdversaryId::Script { actions, .. } => Some(Ado::Script(actions)),
            AdversaryId::Heuristic => self.heuristic.map(Ado::Heuristic),
            AdversaryId::Replays { nearest } => {
                self.stored.map(|stored| Ado::Replays(stored, *nearest))
            }
            AdversaryId::Search { settings: None }
            | AdversaryId::Sampled
            | AdversaryId::Guided
            | AdversaryId::Without { .. }
            | AdversaryId::Alone { .. }
            | AdversaryId::Adapted
            | AdversaryId::Retrained
            | AdversaryId::Named { .. } => None,
        };
        Ok(ado.map(|ado| Box::new(ado) as Box<dyn Adversary>))
    }
}

impl Search<'_> {
    /// Returns the search of all sequences with at most a number of action switches.
    pub fn switches(most: usize) -> Search<'static> {
        Search {
            method: Switches(most).into(),
            budget: 0,
        }
    }
}

impl Adversary for Ado<'_> {
    fn play(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<ExperimentCell> {
        let evaluated = eval(&ego.against(*self, starts), watch);
        Some(judged(ego, starts, evaluated, watch))
    }
}

impl Adversary for BestConstant {
    fn play(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<ExperimentCell> {
        let evaluated = best_constant(ego, starts, watch);
        Some(judged(ego, starts, evaluated, watch))
    }
}

impl Adversary for BestSwitch {
    fn play(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<ExperimentCell> {
        let evaluated = best_then_brake(ego, starts, watch)?;
        Some(judged(ego, starts, evaluated, watch))
    }
}

impl Adversary for Search<'_> {
    fn play(
        &self,
        ego: &EgoUnderTest,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Option<ExperimentCell> {
        let request = SearchRequest {
            scenario: ego.scenario(),
            ego: ego.name(),
            method: self.method,
            budget: self.budget,
            starts,
        };
        let cell = ExperimentCell::searched(ego, starts, search(&request, watch));
        Some(cell.with_judged_contacts(watch))
    }
}

fn judged(
    ego: &EgoUnderTest,
    starts: &TestStarts,
    evaluated: Evaluated,
    watch: &Watch<'_>,
) -> ExperimentCell {
    ExperimentCell::evaluated(ego, starts, evaluated).with_judged_contacts(watch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::test_starts;
    use crate::run_dir::SearchSettings;
    use crate::sim::PlantKind;
    use crate::world::Scenario;

    #[test]
    fn a_player_is_made_of_an_id_and_plays_it() {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        let ego = EgoUnderTest::nominal(&world.on(PlantKind::Kinematic));
        let watch = Watch::unwatched();
        let starts = test_starts(ego.scenario(), 5, 6, &watch).expect("not stopped");
        let settings = |method: &str| SearchSettings {
            method: method.to_owned(),
            switches: 0,
            budget: 3,
        };
        let searched = |method| AdversaryId::Search {
            settings: Some(settings(method)),
        };
        let actions = vec![2, 0];
        let scripted = AdversaryId::Script {
            name: Some("fast".to_owned()),
            actions: actions.clone(),
        };
        let solved = |player: &dyn Adversary| {
            let cell = player.play(&ego, &starts, &watch).expect("it applies");
            (cell.row.ado, cell.row.solved)
        };
        let parts = PlayerParts::default();
        let played = |id: &AdversaryId| {
            let player = parts.player(id).expect("a known method");
            solved(&*player.expect("it has all its parts"))
        };
        assert_eq!(played(&scripted), solved(&Ado::Script(&actions)));
        assert_eq!(played(&searched("switches")), solved(&Search::switches(0)));
        for id in ["neutral", "random", "hold", "constant", "switch"] {
            let id = AdversaryId::from(id);
            assert_eq!(played(&id).0, id);
        }
        // A method that does not exist, and adversaries whose parts are missing.
        assert!(parts.player(&searched("guess")).is_err());
        for id in ["trained", "heuristic", "replays", "search", "chaser"] {
            let id = AdversaryId::from(id);
            assert!(parts.player(&id).expect("no search").is_none(), "{id}");
        }
    }
}
