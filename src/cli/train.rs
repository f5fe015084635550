//! `brakecheck train`: a world in, a run directory with a trained ado out.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{
    Common, Exit, Failure, NamedEgo, PlantArg, all_played, consent, egos, finished,
    interrupted_early, load_world, on_plant, open_run, print_json, start_count, table, talk,
};
use crate::campaign::{
    Ado, EvalRequest, TrainError, best_constant, eval, keep, test_starts, train,
};
use crate::rl::Policy;
use crate::run::{ChangedEgo, Row, RunDir};
use crate::scenario::{Against, Change, Scenario};

/// Counterexamples of the closing evaluation that a run directory keeps.
const KEPT_EPISODES: usize = 5;

#[derive(Args, Debug)]
pub(super) struct TrainArgs {
    /// The world file.
    world: PathBuf,
    /// The run directory to make [default: runs/WORLD-SEED].
    #[arg(short, long, value_name = "RUN")]
    output: Option<PathBuf>,
    /// Decisions to train for, instead of the world's number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    decisions: Option<u64>,
    /// Which of the world's `learners` to train with, instead of its `learner`.
    #[arg(long, value_name = "NAME")]
    learner: Option<String>,
    /// What to train against: the world's ego, or its family under `train_against`.
    #[arg(long, value_enum, default_value = "nominal", value_name = "WHOM")]
    against: AgainstArg,
    /// Train against a changed ego: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// The physics to train in, instead of the world's.
    #[arg(long)]
    plant: Option<PlantArg>,
    /// Go on with an interrupted training in RUN.
    #[arg(long)]
    resume: bool,
    /// Begin with the policy of another run and fine-tune it.
    #[arg(long, value_name = "RUN", conflicts_with = "resume")]
    from: Option<PathBuf>,
    /// Test starts of the closing evaluation.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = start_count())]
    starts: usize,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum AgainstArg {
    /// The world's own ego.
    Nominal,
    /// All egos of the family; the ado is not told which one it meets.
    Wide,
    /// All egos of the family; the ado is told the parameters of each.
    Conditional,
}

impl From<AgainstArg> for Against {
    fn from(arg: AgainstArg) -> Against {
        match arg {
            AgainstArg::Nominal => Against::Nominal,
            AgainstArg::Wide => Against::Wide,
            AgainstArg::Conditional => Against::Conditional,
        }
    }
}

pub(super) fn run(args: &TrainArgs) -> Result<Exit, Failure> {
    let mut scenario = load_world(&args.world, &args.common)?;
    if let Some(plant) = args.plant {
        scenario = on_plant(&scenario, plant)?;
    }
    if let Some(name) = &args.learner {
        let known: Vec<&str> = scenario.learners.keys().map(String::as_str).collect();
        let none = || {
            Failure::input(
                format!("`{}` has no learner `{name}`", scenario.name),
                format!("known: {}; or leave out `--learner`", known.join(", ")),
            )
        };
        scenario = scenario.learning_by(name).ok_or_else(none)?;
    }
    if args.against != AgainstArg::Nominal {
        scenario = against(args, &scenario)?;
    }
    if let Some(decisions) = args.decisions {
        scenario.learner = scenario.learner.with_decisions(decisions);
    }
    let seed = args.common.seed;
    let default = || PathBuf::from(format!("runs/{}-{seed}", scenario.name));
    let path = args.output.clone().unwrap_or_else(default);
    // Before anything is made: what is refused leaves nothing behind.
    let named = match &args.ego {
        Some(name) => egos(&scenario, name)?,
        None => Vec::new(),
    };
    consent(all_played(&scenario, &named))?;
    let mut run = match args.resume {
        true => resume(args, &path, &mut scenario)?,
        false => begin(args, &path, &scenario)?,
    };
    let bar = talk::bar("training (decisions)");
    let watch = bar.watch();
    let tested = tested(&scenario, &run)?;
    consent([(tested.name.as_str(), &tested.scenario)])?;
    let trained = train(&tested.scenario, &mut run, &watch)?;
    drop(bar);
    if trained.interrupted {
        talk::say(&format!(
            "stopped after {} of {} decisions; go on with `brakecheck train {} -o {} --resume`",
            trained.done.decisions,
            trained.done.decisions_asked,
            args.world.display(),
            path.display()
        ));
        return Ok(Exit::Interrupted);
    }
    let rate = trained.done.decisions as f64 / trained.done.cpu_s.max(1e-9);
    talk::say(&format!(
        "trained for {} decisions in {} episodes: {:.1} s of processor time, {rate:.0} decisions/s",
        trained.done.decisions, trained.done.episodes, trained.done.cpu_s
    ));
    if 0 < trained.aborted {
        talk::say(&format!(
            "{} episodes were dropped for faults of the ego or the physics",
            trained.aborted
        ));
    }
    let Some(rows) = closing_evaluation(args, &tested, &run)? else {
        return interrupted_early(&args.common);
    };
    run.save_report(&rows)?;
    if args.common.json {
        print_json(&json!({
            "run": path.display().to_string(),
            "world": scenario.name,
            "plant": scenario.plant(),
            "seed": run.manifest().seed,
            "decisions": trained.done.decisions,
            "episodes": trained.done.episodes,
            "cpu_s": trained.done.cpu_s,
            "decisions_per_cpu_s": rate,
            "rows": rows,
        }))?;
    } else {
        talk::data(&table::rows(&rows))?;
        talk::say(&format!("kept in {}", path.display()));
    }
    Ok(finished(Exit::Done))
}

/// The world, to train against its family.
fn against(args: &TrainArgs, scenario: &Scenario) -> Result<Scenario, Failure> {
    let refused = |what: &str, help: &str| Err(Failure::input(what, help));
    if args.ego.is_some() {
        return refused(
            "`--against` trains on a family of egos, `--ego` on one of them",
            "leave out one of the two",
        );
    }
    if args.learner.is_some() {
        return refused(
            "`--learner` is for training against the nominal ego",
            "leave it out: a family names its own learners, `wide` and `conditional`",
        );
    }
    if args.plant.is_some() {
        return refused(
            "`--plant` is for training against one ego",
            "leave it out: a family names its plants under `train_against`",
        );
    }
    scenario
        .training_against(args.against.into())
        .ok_or_else(|| {
            Failure::input(
                format!("`{}` names no family of egos", scenario.name),
                "add `train_against: Family(ego: { … })` to the world: docs/reuse.md",
            )
        })
}

/// The ego that a run trains against: the world's, or the changed one it names.
fn tested(scenario: &Scenario, run: &RunDir) -> Result<NamedEgo, Failure> {
    let Some(ego) = &run.manifest().ego else {
        return Ok(NamedEgo::nominal(scenario));
    };
    let changed = scenario.with(&ego.change);
    Ok(NamedEgo {
        name: ego.name.clone(),
        change: ego.change.clone(),
        scenario: changed
            .map_err(|error| Failure::input(error.to_string(), "the run's world has changed"))?,
    })
}

/// Makes a run; a policy to begin with is checked first and kept in it.
fn begin(args: &TrainArgs, path: &std::path::Path, scenario: &Scenario) -> Result<RunDir, Failure> {
    let seed = args.common.seed;
    let ego = match &args.ego {
        Some(name) => one_ego(scenario, name)?,
        None => None,
    };
    let Some(from) = &args.from else {
        let mut run = RunDir::create(path, scenario, seed)?;
        run.allow_programs(args.common.allow_programs);
        if let Some(ego) = ego {
            run.save_ego(ego)?;
        }
        return Ok(run);
    };
    let source = open_run(from, &args.common)?;
    let bundle = source.policy_bundle()?;
    let was = source.manifest().against;
    if (was == Against::Conditional) != (scenario.against == Against::Conditional) {
        return Err(Failure::input(
            format!(
                "the ado in `{}` is {was}, this training {}",
                from.display(),
                scenario.against
            ),
            "a conditional ado is told the ego's parameters, others are not: \
             fine-tune a conditional ado with `--against conditional`, any other without",
        ));
    }
    let fits = scenario
        .learner
        .build_from(&scenario.spaces(), seed, &bundle);
    fits.map_err(TrainError::from)?;
    let mut run = RunDir::create(path, scenario, seed)?;
    run.allow_programs(args.common.allow_programs);
    run.save_from(&bundle)?;
    if let Some(ego) = ego {
        run.save_ego(ego)?;
    }
    Ok(run)
}

/// The changed ego of `--ego`; `None`: it is the nominal one.
fn one_ego(scenario: &Scenario, name: &str) -> Result<Option<ChangedEgo>, Failure> {
    if name == "all" {
        return Err(Failure::input(
            "`--ego all` names many egos, and an ado is trained against one",
            "name one of them; `--against wide` trains against a family",
        ));
    }
    let ego = egos(scenario, name)?.into_iter().next();
    let changed = ego.filter(|ego| ego.change != Change::default());
    Ok(changed.map(|ego| ChangedEgo {
        name: ego.name,
        change: ego.change,
    }))
}

/// Opens a run to go on with; it must be of the same world and length.
fn resume(
    args: &TrainArgs,
    path: &std::path::Path,
    scenario: &mut Scenario,
) -> Result<RunDir, Failure> {
    let mut run = RunDir::resume(path)?;
    run.allow_programs(args.common.allow_programs);
    let kept = run.scenario()?;
    if kept.text != scenario.text {
        return Err(Failure::input(
            format!(
                "`{}` differs from the world that `{}` was begun with",
                args.world.display(),
                path.display()
            ),
            "resume with the world file in the run directory, or train anew with `-o`",
        ));
    }
    let manifest = run.manifest();
    if args.against != AgainstArg::Nominal && manifest.against != args.against.into() {
        return Err(Failure::input(
            format!("this run was begun against {}", manifest.against),
            "leave out `--against`",
        ));
    }
    let begun_with = manifest.ego.as_ref().map(|ego| &ego.name);
    if args.ego.is_some() && args.ego.as_ref() != begun_with {
        return Err(Failure::input(
            "this run was begun with another ego",
            "leave out `--ego`",
        ));
    }
    if args.learner.is_some() && args.learner != run.manifest().learner {
        return Err(Failure::input(
            "this run was begun with another learner",
            "leave out `--learner`",
        ));
    }
    scenario.learner = kept.learner.clone();
    scenario.learning = kept.learning.clone();
    scenario.against = kept.against;
    if args.plant.is_none() {
        *scenario = kept;
    } else if scenario.plant() != run.manifest().plant {
        return Err(Failure::input(
            format!("this run was begun on the {:?} plant", run.manifest().plant),
            "leave out `--plant`",
        ));
    }
    let begun = run.manifest().decisions;
    if args.decisions.is_some_and(|decisions| decisions != begun) {
        return Err(Failure::input(
            format!("this run was begun for {begun} decisions"),
            "schedules depend on that number: leave out `--decisions`, or fine-tune the \
             finished policy in a new run with `--from`",
        ));
    }
    if args.common.seed != 0 && args.common.seed != run.manifest().seed {
        return Err(Failure::input(
            format!("this run was begun with seed {}", run.manifest().seed),
            "leave out `--seed`",
        ));
    }
    scenario.learner = scenario.learner.clone().with_decisions(begun);
    Ok(run)
}

/// The trained ado beside the baselines, on the first test starts.
fn closing_evaluation(
    args: &TrainArgs,
    ego: &NamedEgo,
    run: &RunDir,
) -> Result<Option<Vec<Row>>, Failure> {
    let scenario = &ego.scenario;
    let policy = closing_policy(scenario, run)?;
    let bar = talk::bar("evaluating");
    let watch = bar.watch();
    let Some(starts) = test_starts(&run.world()?, 0, args.starts, &watch) else {
        return Ok(None);
    };
    let request = |ado| EvalRequest {
        scenario,
        ego: &ego.name,
        ado,
        starts: &starts,
    };
    let trained = request(Ado::Trained(&*policy, run.manifest().seed));
    let mut evaluated = eval(&trained, &watch);
    if scenario.against == Against::Conditional {
        evaluated.row.told = Some("nominal".to_owned());
    }
    let episodes = run.path().join("episodes");
    keep(&trained, &ego.change, &evaluated, &episodes, KEPT_EPISODES)?;
    let rows = vec![
        evaluated.row,
        eval(&request(Ado::Held), &watch).row,
        eval(&request(Ado::Random), &watch).row,
        best_constant(scenario, &ego.name, &starts, &watch).row,
    ];
    drop(bar);
    Ok(Some(rows))
}

/// The trained ado; a conditional one is told the nominal parameters.
fn closing_policy(scenario: &Scenario, run: &RunDir) -> Result<Box<dyn Policy>, Failure> {
    Ok(match (scenario.family(), scenario.drive()) {
        (Some(family), Some(spec)) => run.policy_told(&family.nominal(spec.plant))?,
        _ => run.policy()?,
    })
}
