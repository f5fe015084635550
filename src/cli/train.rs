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
use crate::run::{Asked, Beginning, ChangedEgo, Row, RunDir};
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
        scenario.learner = scenario.learner.with_decisions(decisions)?;
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
    let show = |rows: &[Row]| {
        if args.common.json {
            return print_json(&json!({
                "run": path.display().to_string(),
                "world": scenario.name,
                "plant": scenario.plant(),
                "seed": run.manifest().seed,
                "decisions": trained.done.decisions,
                "episodes": trained.done.episodes,
                "cpu_s": trained.done.cpu_s,
                "decisions_per_cpu_s": rate,
                "rows": rows,
            }));
        }
        talk::data(&table::rows(rows))
    };
    if !closing_evaluation(args, &tested, &run, show)? {
        return interrupted_early(&args.common);
    }
    if !args.common.json {
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
        let mut run = RunDir::begin(path, scenario, seed, Beginning { from: None, ego })?;
        run.allow_programs(args.common.allow_programs);
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
    let with = Beginning {
        from: Some(&bundle),
        ego,
    };
    let mut run = RunDir::begin(path, scenario, seed, with)?;
    run.allow_programs(args.common.allow_programs);
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

/// Opens a run to go on with, as what it was begun as.
///
/// What was not asked for is as it was; what was asked for must be as it was.
fn resume(
    args: &TrainArgs,
    path: &std::path::Path,
    scenario: &mut Scenario,
) -> Result<RunDir, Failure> {
    let mut run = RunDir::resume(path)?;
    run.allow_programs(args.common.allow_programs);
    let begun = run.manifest();
    if args.plant.is_none()
        && let Some(plant) = begun.plant.plant()
    {
        *scenario = scenario.on(plant);
    }
    if args.against == AgainstArg::Nominal
        && let Some(family) = scenario.training_against(begun.against)
    {
        *scenario = family;
    }
    let learner = begun.learner.as_ref().filter(|_| args.learner.is_none());
    if let Some(learner) = learner.and_then(|name| scenario.learning_by(name)) {
        *scenario = learner;
    }
    let decisions = args.decisions.unwrap_or(begun.decisions);
    scenario.learner = scenario.learner.clone().with_decisions(decisions)?;
    let ego = match &args.ego {
        Some(name) => one_ego(scenario, name)?,
        None => begun.ego.clone(),
    };
    let seed = match args.common.seed {
        0 => begun.seed,
        seed => seed,
    };
    run.must_be_of(Asked {
        scenario,
        seed,
        ego: ego.as_ref(),
    })?;
    Ok(run)
}

/// The trained ado beside the baselines, on the first test starts: shown, then
/// written into the run directory. `false`: stopped before there was anything.
fn closing_evaluation(
    args: &TrainArgs,
    ego: &NamedEgo,
    run: &RunDir,
    show: impl FnOnce(&[Row]) -> Result<(), Failure>,
) -> Result<bool, Failure> {
    let scenario = &ego.scenario;
    let policy = closing_policy(scenario, run)?;
    let bar = talk::bar("evaluating");
    let watch = bar.watch();
    let Some(starts) = test_starts(&run.world()?, 0, args.starts, &watch) else {
        return Ok(false);
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
    let rows = [
        evaluated.row.clone(),
        eval(&request(Ado::Held), &watch).row,
        eval(&request(Ado::Random), &watch).row,
        best_constant(scenario, &ego.name, &starts, &watch).row,
    ];
    drop(bar);
    show(&rows)?;
    run.save_report(&rows)?;
    let episodes = run.path().join("episodes");
    keep(&trained, &ego.change, &evaluated, &episodes, KEPT_EPISODES)?;
    Ok(true)
}

/// The trained ado; a conditional one is told the nominal parameters.
fn closing_policy(scenario: &Scenario, run: &RunDir) -> Result<Box<dyn Policy>, Failure> {
    Ok(match (scenario.family(), scenario.drive()) {
        (Some(family), Some(spec)) => run.policy_told(&family.nominal(spec.plant))?,
        _ => run.policy()?,
    })
}
