//! `brakecheck identify`: a family's parameters of an ego seen from outside.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::counts::count;
use super::{
    Common, Exit, Failure, finished, interrupted_early, one_of, open_run, print_json, table_of,
    talk,
};
use crate::campaign::{
    Adapted, EgoUnderTest, Identification, Identified, IdentifyFound, IdentifyStep,
    LEAST_SIMULATIONS, MOST_SIMULATIONS, RECORDED_RUNS, on_plant,
};
use crate::scenario::Family;
use crate::sim::PlantKind;

#[derive(Args, Debug)]
pub(super) struct IdentifyArgs {
    /// The run directory of a conditional ado.
    run: PathBuf,
    /// Whom to identify: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// Runs of the ego to record.
    #[arg(long, value_name = "N", default_value_t = RECORDED_RUNS as u64, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    runs: u64,
    /// A quantity that stays nominal, as if the family did not vary it; repeatable.
    #[arg(long, value_name = "NAME")]
    leave_out: Vec<String>,
    /// Then look for what the ado is best told, by how it fares, with at most so
    /// many simulations of the ego (200 to 10000; 600 are usual).
    #[arg(long, value_name = "N", value_parser = count(LEAST_SIMULATIONS..=MOST_SIMULATIONS))]
    adapt: Option<u64>,
    /// The physics to record in, instead of the run's.
    #[arg(long, value_parser = one_of::<PlantKind>())]
    plant: Option<PlantKind>,
    /// The file to write, for `eval --params`.
    #[arg(short, long, value_name = "P.ron")]
    output: Option<PathBuf>,
    /// Seed of the recorded runs.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &IdentifyArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let mut world = run.world()?;
    if let Some(plant) = args.plant {
        world = on_plant(&world, plant)?;
    }
    let identification = Identification {
        run: &run,
        world: &world,
        egos: &EgoUnderTest::find(&world, &args.ego)?,
        runs: args.runs as usize,
        leave_out: &args.leave_out,
        adapt: args.adapt,
        seed: args.seed,
        output: args.output.as_deref(),
    };
    let bar = talk::bar("identifying");
    let mut shown = Ok(());
    let mut show_one = |step: IdentifyStep<'_>| {
        if !args.common.json && shown.is_ok() {
            shown = bar.aside(|| talk::data(&text(&args.leave_out, step)));
        }
    };
    let file = identification.run(&bar.watch(), &mut show_one)?;
    drop(bar);
    shown?;
    if file.egos.is_empty() {
        return interrupted_early(&args.common);
    }
    say_where(args);
    if args.common.json {
        print_json(&json!(file))?;
    }
    Ok(finished(Exit::Done))
}

fn say_where(args: &IdentifyArgs) {
    if let Some(path) = &args.output {
        talk::say(&format!(
            "kept in {}; play it with `brakecheck eval {} --ego … --params {}`",
            path.display(),
            args.run.display(),
            path.display()
        ));
    }
}

/// What is known now, in words.
fn text(leave_out: &[String], step: IdentifyStep<'_>) -> String {
    let name = step.ego.name();
    match step.found {
        IdentifyFound::Identified(found) => identified(leave_out, step.family, name, found),
        IdentifyFound::Adapted(found, otherwise) => adapted(step.family, name, found, otherwise),
    }
}

fn adapted(family: &Family, ego: &str, adapted: &Adapted, otherwise: &str) -> String {
    let rate = |share: f64| format!("{:.1} %", 100.0 * share);
    let found = match adapted.is_better {
        true => format!(
            "is best told {}\n({} of the {} starts of the last race solved, {} told the \
             {otherwise} parameters;",
            family.in_words(&adapted.member),
            rate(adapted.success_rate),
            adapted.starts,
            rate(adapted.first_success_rate)
        ),
        false => format!(
            "is told the {otherwise} parameters: none is clearly better\n({} of the {} starts of \
             the last race solved;",
            rate(adapted.success_rate),
            adapted.starts
        ),
    };
    let invalid = match adapted.invalid {
        0 => String::new(),
        failed => format!(", in {failed} of which it failed to run"),
    };
    format!(
        "{ego}: the ado {found} {} members tried in {} runs of the ego{invalid})\n",
        adapted.tried, adapted.simulations
    )
}

fn identified(leave_out: &[String], family: &Family, ego: &str, found: &Identified) -> String {
    let verdict = match found.explains() {
        true => format!(
            "explained: the member stays within {:.2} m of it, {:.2} m allowed",
            found.residual_m,
            found.bound_m()
        ),
        false => format!(
            "not explained: the nearest member strays by {:.2} m, {:.2} m allowed, so this ego \
             is none of the family",
            found.residual_m,
            found.bound_m()
        ),
    };
    let refits: Vec<String> = found.refits_m.iter().map(|r| format!("{r:.3}")).collect();
    let lines = family.quantities.iter().enumerate().map(|(i, quantity)| {
        let name = quantity.varied.name();
        let note = match found.hidden[i] {
            true if leave_out.iter().any(|left| left == name) => "left out: nominal",
            true => "does not show in these runs: nominal",
            false => "",
        };
        [
            name.to_owned(),
            format!("{:.3}", found.member.values[i]),
            format!("{:.3}", found.spread[i]),
            format!("{:.3}", quantity.nominal),
            format!("{} … {}", quantity.lo, quantity.hi),
            note.to_owned(),
        ]
    });
    let table = table_of(
        [
            "quantity", "fitted", "spread", "nominal", "family", "remark",
        ],
        lines,
    );
    format!(
        "{ego}: {verdict}\n\
         (root mean square over {} recorded runs, a speed error of 1 m/s counted like 1 m; the \
         nominal ego strays by {:.2} m, noise alone makes {:.2} m;\nindependent fits {} m; {} runs of \
         members simulated)\n{table}\n\
         fitted: the value of the nearest member; spread: how far the independent fits are apart\n\
         nominal: the value the ado was trained on; family: the range it was looked for in\n",
        found.recorded,
        found.nominal_residual_m,
        found.noise_m,
        refits.join(", "),
        found.simulations
    )
}
