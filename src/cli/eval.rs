//! `brakecheck eval`: a frozen ado on test starts and egos, beside baselines.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::keep::KeepArgs;
use super::{
    Common, Exit, Failure, exit_of, interrupted_early, one_of, open_run, print_json, start_count,
    table, talk, theorems,
};
use crate::campaign::{
    AdoKind, ContextSource, EgoUnderTest, Evaluation, EvaluationTable, TheoremsChecked, Watch,
    on_plant, summarise,
};
use crate::sim::PlantKind;

#[derive(Args, Debug)]
pub(super) struct EvalArgs {
    /// The run directory that `train` made.
    run: PathBuf,
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = start_count())]
    starts: usize,
    /// Who plays the ado; repeat for several.
    #[arg(long, value_parser = one_of::<AdoKind>(), default_value = "trained", value_name = "ADO")]
    ado: Vec<AdoKind>,
    /// Which ego is tested: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// The physics to test in, instead of the run's.
    #[arg(long, value_parser = one_of::<PlantKind>())]
    plant: Option<PlantKind>,
    /// Also search with at most so many switches, and fill in recall.
    #[arg(long, value_name = "M")]
    search: Option<usize>,
    /// What a conditional ado is told of each ego: its nominal or its true
    /// parameters, those identified from recorded runs, those adapted by how the
    /// ado then fares, or those of a file that `identify` wrote.
    #[arg(long, value_name = "nominal|true|identified|adapted|P.ron")]
    params: Option<String>,
    /// Runs of the trained ado per start: the greedy one, then explored ones.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(super) tries: u64,
    #[command(flatten)]
    keep: KeepArgs,
    /// Also check the paper's theorems: 1 and 2 on a grid, 3 and Lemma 1 on the road.
    #[arg(long)]
    theorems: bool,
    /// Exit with 1 if any ado makes an ego fail.
    #[arg(long)]
    fail_on_counterexample: bool,
    /// A program that is the ego, after `--`: typing it consents to start it.
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let bar = talk::bar("evaluating");
    let watch = bar.watch();
    let context = ContextSource::find(&run, args.params.as_deref(), &watch)?;
    let mut nominal = run.scenario()?;
    if let Some(plant) = args.plant {
        nominal = on_plant(&nominal, plant)?;
    }
    let egos = EgoUnderTest::find_or_program(&nominal, &args.ego, &args.program)?;
    keeps_something(args)?;
    let evaluation = Evaluation {
        run: &run,
        nominal: &nominal,
        egos: &egos,
        ados: &args.ado,
        context: context.as_ref(),
        starts: (args.starts, args.common.seed),
        search: args.search,
        tries: args.tries,
        keeps: args.keep.dir().is_some(),
    };
    let Some(mut evaluated) = evaluation.run(&watch)? else {
        return interrupted_early(&args.common);
    };
    let theorems = checked(args, &mut evaluated, &watch);
    drop(bar);
    show(args, &evaluated, theorems.as_ref())?;
    if let Some(dir) = args.keep.dir() {
        let bar = talk::bar("keeping");
        evaluated.keep(dir, args.keep.choice(), args.keep.form(), &bar.watch())?;
    }
    ended(args, evaluated, theorems)
}

/// The theorems, if they are asked for and everything was played; why they
/// cannot be checked is no reason not to show the rows.
fn checked(
    args: &EvalArgs,
    evaluated: &mut EvaluationTable<'_>,
    watch: &Watch<'_>,
) -> Option<TheoremsChecked> {
    if !args.theorems || watch.stopped() || evaluated.failure.is_some() {
        return None;
    }
    watch.phase("theorems");
    let checked = evaluated.theorems(watch);
    checked.unwrap_or_else(|error| {
        evaluated.failure = Some(error);
        None
    })
}

/// Refuses to keep counterexamples of ados whose counterexamples are not kept.
fn keeps_something(args: &EvalArgs) -> Result<(), Failure> {
    let kept = [AdoKind::Trained, AdoKind::All, AdoKind::Optimal];
    match args.keep.dir().is_some() && !kept.iter().any(|ado| args.ado.contains(ado)) {
        true => Err(Failure::input(
            "`--keep` writes counterexamples of the trained ado, which is not asked for",
            "add `--ado trained`",
        )),
        false => Ok(()),
    }
}

fn show(
    args: &EvalArgs,
    evaluated: &EvaluationTable<'_>,
    theorems: Option<&TheoremsChecked>,
) -> Result<(), Failure> {
    let summary = summarise(&evaluated.egos, "trained");
    if args.common.json {
        let mut object = json!({
            "rows": evaluated.rows(),
            "egos": evaluated.egos,
            "summary": summary,
            "explain": evaluated.reasons,
        });
        if let Some(theorems) = theorems {
            object["theorems"] = json!(theorems);
        }
        return print_json(&object);
    }
    talk::data(&table::reuse(&evaluated.egos, &summary))?;
    for why in &evaluated.reasons {
        talk::data(&format!(
            "\nwhy `{}` fails from start {}, the first of them: {}",
            why.ego, why.start, why.explanation
        ))?;
    }
    match theorems {
        Some(theorems) => talk::data(&format!("\n{}", theorems::text(theorems))),
        None => Ok(()),
    }
}

/// How it ended, with everything shown and kept.
fn ended(
    args: &EvalArgs,
    evaluated: EvaluationTable<'_>,
    theorems: Option<TheoremsChecked>,
) -> Result<Exit, Failure> {
    let rows = evaluated.rows();
    if let Some(failure) = evaluated.failure {
        return Err(failure.into());
    }
    if theorems.is_some_and(|theorems| theorems.is_refuted()) {
        return Err(Failure::fault(
            "a theorem failed on a pair of runs, which it cannot",
            Some("this is a bug of brakecheck: please report it with the run".to_owned()),
        ));
    }
    Ok(exit_of(&rows, args.fail_on_counterexample))
}
