//! Leagues, on egos of structures that no member trained against.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, headed, once, settings, world};
use crate::{
    LeagueRow, LeagueStudy, LeagueTraining, league_markdown, other_structures, rounds_markdown,
};
use brakecheck::experiment::EgoUnderTest;
use brakecheck::population::{LeagueRound, PopulationDir};
use brakecheck::world::{PlantKind, Scenario};

/// World of the leagues.
const WORLDS: [&str; 1] = ["acc"];
/// Rounds, and decisions of each training.
const ROUNDS: usize = 15;
const DECISIONS: u64 = 300_000;
/// Leagues and starts at most, because each start is searched with two switches.
const MOST_LEAGUES: u64 = 10;
const MOST_STARTS: usize = 200;

/// Structures that a league leaves out together and is tested on, related ones together.
const FOLDS: [[&str; 5]; 2] = [
    ["filter", "iso", "gipps", "krauss", "rss"],
    ["aeb", "idm", "fvdm", "fsm", "cc"],
];

/// League of a study: its name, the world to train in, and the egos to test on.
struct Fold {
    name: String,
    scenario: Scenario,
    egos: Vec<EgoUnderTest>,
}

pub(super) fn run(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    let seeds = args.seeds_within(MOST_LEAGUES);
    let (mut markdown, mut studies) = (String::new(), serde_json::Map::new());
    for name in &args.worlds_or(WORLDS) {
        let scenario = world(args, name)?
            .on(PlantKind::Kinematic)
            .training_for(DECISIONS)?;
        let (mut rows, mut rounds) = (Vec::new(), String::new());
        for seed in seeds.trainings() {
            for fold in folds(&scenario, args.variants)? {
                let Some(played) = rows_of(args, &scenario, &fold, seed, &mut rows)? else {
                    return Ok(None);
                };
                rounds.push_str(&rounds_markdown(&format!("{}-{seed}", fold.name), &played));
            }
        }
        markdown.push_str(&league_markdown(name, &rows));
        markdown.push_str(&format!("\n{rounds}"));
        studies.insert(name.clone(), json!(rows));
    }
    Ok(Some(Made {
        name: "league",
        markdown: headed(seeds, &markdown),
        json: json!({ "league": studies }),
    }))
}

/// Returns the leagues of a seed: one, or one per fold of the family's structures.
fn folds(scenario: &Scenario, variants: bool) -> Result<Vec<Fold>, Failure> {
    let name = format!("{}-league", scenario.name());
    if variants {
        let all = EgoUnderTest::find(scenario, "all")?.into_iter();
        let egos = all.filter(|ego| ego.change().controller.is_none());
        return Ok(vec![Fold {
            name,
            scenario: scenario.clone(),
            egos: egos.collect(),
        }]);
    }
    let egos = other_structures(scenario)?;
    if scenario
        .family()
        .is_none_or(|family| family.structures.is_empty())
    {
        let scenario = scenario.clone();
        return Ok(vec![Fold {
            name,
            scenario,
            egos,
        }]);
    }
    let fold = |(number, left_out): (usize, &[&str; 5])| {
        let mut left = left_out.iter();
        let without = left.try_fold(scenario.clone(), |world, name| world.leaving_out(name));
        let egos = egos.iter().filter(|ego| left_out.contains(&ego.name()));
        Some(Fold {
            name: format!("{name}-{number}"),
            scenario: without?,
            egos: egos.cloned().collect(),
        })
    };
    Ok(FOLDS.iter().enumerate().filter_map(fold).collect())
}

/// Adds a row for each ego of a fold and returns the rounds. `None` if stopped.
fn rows_of(
    args: &ReproduceArgs,
    scenario: &Scenario,
    fold: &Fold,
    seed: u64,
    rows: &mut Vec<LeagueRow>,
) -> Result<Option<Vec<LeagueRound>>, Failure> {
    let seeds = args.seeds_within(MOST_LEAGUES);
    let starts = args.starts.min(MOST_STARTS);
    let runs = args.output.join("runs");
    let path = runs.join(format!("{}-{seed}", fold.name));
    let mut study = None;
    for ego in &fold.egos {
        let own = json!({
            "starts": starts, "ego": ego.name(), "league": seed, "rounds": ROUNDS,
            "decisions": DECISIONS,
        });
        let piece = format!("{}-{seed}, {}", fold.name, ego.name());
        let made = once(args, &piece, scenario, settings(seeds, own), |watch| {
            if study.is_none() {
                let training = LeagueTraining {
                    nominal: scenario,
                    scenario: &fold.scenario,
                    seed,
                    rounds: ROUNDS,
                    path: &path,
                    runs: &runs,
                };
                study = LeagueStudy::trained(&training, watch)?;
            }
            let Some(study) = &study else {
                return Ok(None);
            };
            Ok(study.evaluate(scenario, ego, starts, seeds.starts, watch)?)
        })?;
        let Some(row) = made else {
            return Ok(None);
        };
        rows.push(row);
    }
    Ok(Some(LeagueRound::all(&PopulationDir::open(&path)?)?))
}
