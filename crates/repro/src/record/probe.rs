//! Digests of everything that a measured number depends on.
//!
//! A probe runs a small, deterministic part of the program and hashes the bits of its
//! results. Any edit that changes the physics of a world, the values of its formulas, the
//! weights of a learner or the outcome of a search changes a digest. A text, a comment or
//! a caption does not.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display, Formatter};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use brakecheck::ego::KINDS;
use brakecheck::experiment::{EgoUnderTest, Watch, test_starts};
use brakecheck::rl::{Control, Demonstration, Env, Policy};
use brakecheck::search::{Adversary, BASELINES, Search};
use brakecheck::seed::Purpose;
use brakecheck::stats::{Outcomes, paired_difference, predicted, seeds_interval, wilson};
use brakecheck::testbench::{Episode, Gym};
use brakecheck::world::{PlantKind, Scenario, TrainingEgos};
use brakecheck_files::content_hash::sha256;
use brakecheck_surrogate::surrogate::{LEAST_RUNS, LearnEgoRequest, learn_ego};
use brakecheck_training::training::goals::GoalTracker;
use brakecheck_training::training::training_egos::TrainingGym;
use rayon::prelude::*;
use serde::Serialize;

use crate::LETTER_PATHS;

/// Episodes on the plant of a world.
const EPISODES: u64 = 12;
/// Episodes against each changed ego.
const EPISODES_PER_EGO: u64 = 2;
/// Decisions of a training.
const DECISIONS: u64 = 1_500;
/// Scripted episodes that a learner is shown, if it learns from demonstrations.
const SHOWN: u64 = 30;
/// Test starts of the search and the baselines.
const STARTS: usize = 6;
/// Updates of the networks of a surrogate.
const UPDATES: [u64; 2] = [300, 600];
/// Stock controllers that the probe of the surrogate fits. All of them take too long.
const COMPARED: [&str; 2] = ["Acc", "Idm"];
/// Seed of all probes, which is open.
const SEED: u64 = 0;

/// Small run of the program with a digest.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum DigestProbe {
    /// Scripted episodes of a shipped world: starts, observations, rewards, physics, ego,
    /// monitor.
    World(String),
    /// Scripted episodes against every changed ego of a shipped world.
    Egos(String),
    /// Weights after a short training in a shipped world, with a learner of its file.
    Learner {
        /// The world.
        world: String,
        /// Name under `learners`. `None`: the world's own learner.
        learner: Option<String>,
    },
    /// The same against the family of the world.
    Family(String),
    /// World and learner of a step from the letter to the defaults.
    Letter {
        /// Position in [`LETTER_PATHS`].
        path: usize,
        /// Number of changes.
        step: usize,
    },
    /// Baselines and search on some starts.
    Search,
    /// Reference drivers in the ego's place.
    Drivers,
    /// Surrogate of an ego.
    Surrogate,
    /// Intervals of some outcomes.
    Intervals,
}

impl DigestProbe {
    /// The probes of an evaluation in a world by its own learner.
    pub(crate) fn of_training(world: &str) -> BTreeSet<DigestProbe> {
        let learner = DigestProbe::Learner {
            world: world.to_owned(),
            learner: None,
        };
        let world = DigestProbe::World(world.to_owned());
        BTreeSet::from([world, learner, DigestProbe::Search, DigestProbe::Intervals])
    }

    /// Returns the digest. An impossible probe has the digest of its reason.
    fn digest(&self) -> String {
        let mut bits = Bits::default();
        if let Err(reason) = self.run(&mut bits) {
            bits.text(&reason);
        }
        // A prefix of 64 bits: rows are compared, not defended.
        sha256(&bits.0)[..16].to_owned()
    }

    fn run(&self, bits: &mut Bits) -> Result<(), String> {
        match self {
            DigestProbe::World(name) => bits.episodes(&shipped(name)?, EPISODES),
            DigestProbe::Egos(name) => {
                let world = shipped(name)?;
                let egos = EgoUnderTest::find(&world, "all").map_err(|it| it.to_string())?;
                for ego in &egos {
                    bits.episodes(ego.scenario(), EPISODES_PER_EGO);
                }
            }
            DigestProbe::Learner { world, learner } => {
                let world = shipped(world)?;
                let chosen = learner.as_ref().map(|name| {
                    let missing = || format!("no learner `{name}`");
                    world.learning_by(name).ok_or_else(missing)
                });
                bits.training(&chosen.transpose()?.unwrap_or(world))?;
            }
            DigestProbe::Family(name) => {
                let family = shipped(name)?.training_against(TrainingEgos::Randomized);
                bits.training(&family.ok_or("no family")?)?;
            }
            DigestProbe::Letter { path, step } => {
                let path = LETTER_PATHS.get(*path).ok_or("no such path")?;
                let letter = shipped(path.world)?;
                let steps = path.steps(letter.text()).map_err(|it| it.to_string())?;
                let step = steps.get(*step).ok_or("no such step")?;
                let world = step.scenario().map_err(|it| it.to_string())?;
                // A step changes the world or the learner, and the digest cannot tell
                // which.
                bits.episodes(&world, EPISODES);
                bits.training(&world)?;
            }
            DigestProbe::Search => bits.search(&shipped("acc")?.on(PlantKind::Kinematic))?,
            DigestProbe::Drivers => bits.drivers(&shipped("acc_iso")?),
            DigestProbe::Surrogate => bits.surrogate(&shipped("acc_structures")?)?,
            DigestProbe::Intervals => bits.intervals()?,
        }
        Ok(())
    }
}

/// Returns the digests of some probes by their names.
///
/// A digest is a constant of the program, so each is computed once.
pub(crate) fn digests(probes: &BTreeSet<DigestProbe>) -> BTreeMap<String, String> {
    static KNOWN: Mutex<BTreeMap<String, String>> = Mutex::new(BTreeMap::new());
    // A poisoned map still holds whole entries.
    let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    // The lock is not held while probes run, which takes long.
    let missing: Vec<&DigestProbe> = {
        let computed = known();
        let is_missing = |probe: &&DigestProbe| !computed.contains_key(&probe.to_string());
        probes.iter().filter(is_missing).collect()
    };
    let found: Vec<(String, String)> = missing
        .into_par_iter()
        // Probes take very different times, so each is a task of its own.
        .with_max_len(1)
        .map(|probe| (probe.to_string(), probe.digest()))
        .collect();
    let mut all = known();
    all.extend(found);
    let names = probes.iter().map(DigestProbe::to_string);
    names
        .filter_map(|name| all.get_key_value(&name))
        .map(|(name, digest)| (name.clone(), digest.clone()))
        .collect()
}

impl Display for DigestProbe {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        // Rows are recorded under these names, and `from_str` reads them again.
        match self {
            DigestProbe::World(name) => write!(f, "world {name}"),
            DigestProbe::Egos(name) => write!(f, "egos {name}"),
            DigestProbe::Learner { world, learner } => match learner {
                Some(learner) => write!(f, "learner {world} {learner}"),
                None => write!(f, "learner {world}"),
            },
            DigestProbe::Family(name) => write!(f, "family {name}"),
            DigestProbe::Letter { path, step } => write!(f, "letter {path} {step}"),
            DigestProbe::Search => f.write_str("search"),
            DigestProbe::Drivers => f.write_str("drivers"),
            DigestProbe::Surrogate => f.write_str("surrogate"),
            DigestProbe::Intervals => f.write_str("intervals"),
        }
    }
}

impl FromStr for DigestProbe {
    type Err = ();

    fn from_str(text: &str) -> Result<DigestProbe, ()> {
        // No name of a world or a learner has a blank.
        let words: Vec<&str> = text.split(' ').collect();
        let number = |word: &str| word.parse().map_err(|_| ());
        match words[..] {
            ["world", name] => Ok(DigestProbe::World(name.to_owned())),
            ["egos", name] => Ok(DigestProbe::Egos(name.to_owned())),
            ["learner", world] => Ok(DigestProbe::Learner {
                world: world.to_owned(),
                learner: None,
            }),
            ["learner", world, learner] => Ok(DigestProbe::Learner {
                world: world.to_owned(),
                learner: Some(learner.to_owned()),
            }),
            ["family", name] => Ok(DigestProbe::Family(name.to_owned())),
            ["letter", path, step] => Ok(DigestProbe::Letter {
                path: number(path)?,
                step: number(step)?,
            }),
            ["search"] => Ok(DigestProbe::Search),
            ["drivers"] => Ok(DigestProbe::Drivers),
            ["surrogate"] => Ok(DigestProbe::Surrogate),
            ["intervals"] => Ok(DigestProbe::Intervals),
            _ => Err(()),
        }
    }
}

fn shipped(name: &str) -> Result<Scenario, String> {
    match Scenario::shipped(name) {
        Some(world) => world.map_err(|error| error.to_string()),
        None => Err(format!("no world `{name}`")),
    }
}

/// Action of a decision in an episode: constants first, then held and changing ones.
fn scripted(episode: u64, decision: usize, actions: usize) -> usize {
    let (episode, decision) = (episode as usize, decision);
    // With many actions, constants alone would fill all episodes.
    if episode < actions.min(4) {
        // Constant actions bring about the most contacts.
        return episode;
    }
    // Neighbouring episodes hold their actions for different times.
    let held = 1 + episode % 7;
    (episode + 3 * (decision / held)) % actions
}

/// Bytes to be hashed.
#[derive(Default)]
struct Bits(Vec<u8>);

impl Bits {
    fn text(&mut self, text: &str) {
        self.0.extend(text.as_bytes());
        // Without a separator, the end of a text could pass as the beginning of the next.
        self.0.push(0);
    }

    fn number(&mut self, number: f64) {
        // The order of the bytes is fixed, so no digest depends on that of a processor.
        self.0.extend(number.to_bits().to_le_bytes());
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for number in numbers {
            self.number(number);
        }
    }

    /// Adds a value as JSON, which has every bit of its numbers.
    fn json(&mut self, value: &impl Serialize) {
        // Values without a JSON form have none of the numbers of this project.
        self.text(&serde_json::to_string(value).unwrap_or_default());
    }

    /// Plays scripted episodes as a training would.
    fn episodes(&mut self, scenario: &Scenario, count: u64) {
        let mut gym = Gym::new(scenario.bench(), Purpose::Train, SEED);
        // The contact after a success is a result as well, so the digest covers it.
        gym.play_aftermath();
        let spaces = gym.spaces().clone();
        let mut obs = vec![0.0; spaces.observation];
        for episode in 0..count {
            gym.reset(episode, &mut obs);
            self.numbers(obs.iter().copied().map(f64::from));
            for decision in 0.. {
                let step = gym.step(scripted(episode, decision, spaces.actions), &mut obs);
                self.numbers(obs.iter().copied().map(f64::from));
                self.number(f64::from(step.reward));
                if step.end.is_some() {
                    break;
                }
            }
            if let Some(played) = gym.ended_episode() {
                self.episode(&played);
            }
        }
    }

    fn episode(&mut self, episode: &Episode) {
        for signal in 0..episode.trace.schema().signals().len() {
            self.numbers(episode.trace.column(signal).iter().copied());
        }
        self.number(episode.robustness);
        self.json(&episode.verdict);
        self.json(&episode.contact);
        self.numbers(episode.broken_rules.iter().map(|rule| *rule as f64));
    }

    /// Trains briefly, with the goals of the world and some demonstrations.
    fn training(&mut self, scenario: &Scenario) -> Result<(), String> {
        // The world's own training takes too long for a probe.
        let shorter = scenario.training_for(DECISIONS);
        let brief = shorter.map_err(|error| error.to_string())?;
        let mut gym = TrainingGym::new(&brief, Purpose::Train, SEED);
        let goals = GoalTracker::of(&brief, None).map_err(|error| error.to_string())?;
        if let Some(goals) = goals {
            gym.reward_by(goals);
        }
        let spaces = brief.spaces();
        let decisions = brief.bench().clock().decisions();
        let shown: Vec<Demonstration> = (0..SHOWN)
            .map(|index| {
                let actions = (0..decisions).map(|at| scripted(index, at, spaces.actions));
                Demonstration {
                    index,
                    actions: actions.collect(),
                }
            })
            .collect();
        let mut learner = brief.learner().build(spaces, SEED);
        learner.demonstrate(&mut gym, &shown);
        learner.train(&mut gym, &mut |_| Control::Continue);
        let bundle = learner.policy_bundle().to_bytes();
        self.0.extend(bundle.map_err(|error| error.to_string())?);
        Ok(())
    }

    fn search(&mut self, scenario: &Scenario) -> Result<(), String> {
        let watch = Watch::unwatched();
        let starts = test_starts(scenario, SEED, STARTS, &watch).ok_or("stopped")?;
        let ego = EgoUnderTest::nominal(scenario);
        // One switch shows a changed search as well as two, at a fraction of the cost.
        let search: &dyn Adversary = &Search::switches(1);
        for adversary in BASELINES.into_iter().chain([search]) {
            let cell = adversary.play(&ego, &starts, &watch).ok_or("stopped")?;
            self.text(&cell.row.solved.to_string());
            self.numbers([cell.row.sims_per_start, cell.row.foul_rate]);
            self.json(&cell.row.success_closing_mps);
            let mut bench = scenario.bench();
            for start in cell.solved() {
                let again = cell.replay(&mut bench, start);
                self.episode(&again);
            }
        }
        Ok(())
    }

    /// Puts the reference drivers into the ego's place in scripted crashes.
    fn drivers(&mut self, scenario: &Scenario) {
        let mut gym = Gym::new(scenario.bench(), Purpose::Train, SEED);
        gym.play_aftermath();
        let actions = gym.spaces().actions;
        let mut obs = vec![0.0; gym.spaces().observation];
        for episode in 0..EPISODES {
            gym.reset(episode, &mut obs);
            let mut decision = 0;
            while gym
                .step(scripted(episode, decision, actions), &mut obs)
                .end
                .is_none()
            {
                decision += 1;
            }
            if let Some(played) = gym.ended_episode() {
                self.json(&scenario.preventability(&played));
            }
        }
    }

    /// Learns an ego from few runs, with short fits.
    fn surrogate(&mut self, scenario: &Scenario) -> Result<(), String> {
        let driving = scenario.drive().ok_or("nothing drives")?;
        let policy = Neutral(scenario.spaces().neutral);
        let request = LearnEgoRequest::new(scenario, driving, &policy, LEAST_RUNS);
        let kinds = KINDS.iter().map(|(kind, _)| *kind);
        let others: Vec<&str> = kinds.filter(|kind| !COMPARED.contains(kind)).collect();
        let request = request.unknown(&others).updates(UPDATES);
        let learned = learn_ego(&request, &Watch::unwatched()).ok_or("stopped")?;
        self.json(&learned.from);
        Ok(())
    }

    fn intervals(&mut self) -> Result<(), String> {
        let outcomes = |marks: &str| marks.parse::<Outcomes>().map_err(|it| it.to_string());
        // Fixed marks, so that nothing but the formulas can change the digest.
        let trainings = [
            outcomes(&"1101110111".repeat(9))?,
            outcomes(&"1111110110".repeat(9))?,
            outcomes(&"0101110111".repeat(9))?,
        ];
        let marks: Vec<&Outcomes> = trainings.iter().collect();
        self.numbers(seeds_interval(&marks));
        let (difference, interval) = paired_difference(&marks[..2], &marks[2..]);
        self.number(difference);
        self.numbers(interval);
        self.numbers(wilson(7, 40));
        self.numbers(predicted(7, 40, 30));
        Ok(())
    }
}

/// Policy that never acts otherwise.
struct Neutral(usize);

impl Policy for Neutral {
    fn act(&self, _: &[f32]) -> usize {
        self.0
    }

    fn value(&self, _: &[f32]) -> f32 {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACC: &str = include_str!("../../../../worlds/acc.ron");

    fn digests_of(text: &str) -> [String; 2] {
        let world = Scenario::parse("acc.ron", text).expect("a world");
        let world = world.on(PlantKind::Kinematic);
        let (mut episodes, mut training) = (Bits::default(), Bits::default());
        episodes.episodes(&world, EPISODES);
        training.training(&world).expect("it trains");
        [sha256(&episodes.0), sha256(&training.0)]
    }

    /// Gains, formulas and learners are results. Comments and questions are not.
    #[test]
    fn digests_follow_the_results_and_not_the_text() {
        let [world, learner] = digests_of(ACC);
        let changed = |from: &str, to: &str| {
            assert!(ACC.contains(from), "{from}");
            let [changed, weights] = digests_of(&ACC.replacen(from, to, 1));
            [changed != world, weights != learner]
        };
        let comment = changed("Scenario(", "// A comment.\nScenario(");
        assert_eq!(comment, [false, false]);
        assert_eq!(
            changed("kp_per_s2: 0.3,", "kp_per_s2: 0.301,"),
            [true, true]
        );
        let dqn = "Dqn(decisions: 300_000)";
        let slower = changed(dqn, "Dqn(decisions: 300_000, learning_rate: 0.0009)");
        assert_eq!(slower, [false, true]);
    }

    #[test]
    fn names_of_probes_are_read_again() {
        let learner = |learner: Option<&str>| DigestProbe::Learner {
            world: "acc".to_owned(),
            learner: learner.map(str::to_owned),
        };
        for probe in [
            DigestProbe::World("acc".to_owned()),
            DigestProbe::Egos("acc".to_owned()),
            learner(None),
            learner(Some("q_table")),
            DigestProbe::Family("acc".to_owned()),
            DigestProbe::Letter { path: 3, step: 8 },
            DigestProbe::Search,
            DigestProbe::Drivers,
            DigestProbe::Surrogate,
            DigestProbe::Intervals,
        ] {
            assert_eq!(probe.to_string().parse(), Ok(probe));
        }
        assert_eq!("world".parse::<DigestProbe>(), Err(()));
    }
}
