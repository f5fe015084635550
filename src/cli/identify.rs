//! `brakecheck identify`: a family's parameters of an ego seen from outside.

use std::path::{Path, PathBuf};

use clap::Args;
use indexmap::IndexMap;
use serde_json::json;

use super::told::{RECORDED_RUNS, adapted};
use super::{
    Common, Exit, Failure, NamedEgo, PlantArg, consent, egos, finished, interrupted_early,
    on_plant, open_run, print_json, table_of, talk,
};
use crate::campaign::{
    Adapted, Identified, IdentifyRequest, LEAST_SIMULATIONS, MOST_SIMULATIONS, identify,
};
use crate::run::{AdaptedEgo, IdentifiedEgo, IdentifiedEgos};
use crate::scenario::{Against, Family};

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
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(LEAST_SIMULATIONS..=MOST_SIMULATIONS))]
    adapt: Option<u64>,
    /// The physics to record in, instead of the run's.
    #[arg(long)]
    plant: Option<PlantArg>,
    /// The file to write, for `eval --params`.
    #[arg(short, long, value_name = "P.ron")]
    output: Option<PathBuf>,
    #[command(flatten)]
    pub(super) common: Common,
}

pub(super) fn run(args: &IdentifyArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let manifest = run.manifest();
    if manifest.against != Against::Conditional {
        return Err(Failure::input(
            format!(
                "the ado in `{}` is {}: it has no use for an ego's parameters",
                args.run.display(),
                manifest.against
            ),
            "train one that has: `brakecheck train WORLD --against conditional`",
        ));
    }
    let mut world = run.world()?;
    if let Some(plant) = args.plant {
        world = on_plant(&world, plant)?;
    }
    let Some(family) = world.family() else {
        return Err(Failure::fault("a conditional ado without a family", None));
    };
    if let Some(path) = &args.output {
        can_be_written(path)?;
    }
    if args.adapt.is_some() {
        // Adapting plays the ado: an unfinished run is found out now.
        run.policy_bundle()?;
    }
    let asked = egos(&world, &args.ego)?;
    let egos = asked.iter().map(|ego| (ego.name.as_str(), &ego.scenario));
    consent(egos)?;
    let seed = args.common.seed;
    let mut file = IdentifiedEgos::new(&manifest.world, &manifest.world_sha256, seed);
    let bar = talk::bar("identifying");
    for ego in &asked {
        bar.now(format!("identifying: {}", ego.name));
        let watch = bar.watch();
        let request = IdentifyRequest {
            world: &world,
            ego: &ego.scenario,
            runs: args.runs as usize,
            seed,
            fixed: &args.leave_out,
        };
        let Some(found) = identify(&request, &watch)? else {
            break;
        };
        bar.aside(|| show(args, family, ego, &found))?;
        let kept = kept(args, family, ego, &found);
        file.egos.insert(ego.name.clone(), kept);
        save(args, &file)?;
        let Some(simulations) = args.adapt else {
            continue;
        };
        bar.now(format!("adapting: {}", ego.name));
        let (first, told) = found.told(family);
        let budget = (simulations, seed);
        let Some(adapted) = adapted(&run, family, ego, &first, budget, &watch)? else {
            talk::say(&format!(
                "`{}` is kept as identified, not adapted",
                ego.name
            ));
            break;
        };
        bar.aside(|| show_adapted(args, family, ego, (&adapted, told)))?;
        if let Some(kept) = file.egos.get_mut(&ego.name) {
            kept.adapted = Some(AdaptedEgo {
                policy_sha256: manifest.policy_sha256.clone().unwrap_or_default(),
                parameters: named(family, &adapted.member.values),
                others: adapted
                    .others
                    .iter()
                    .map(|member| named(family, &member.values))
                    .collect(),
                is_better: adapted.is_better,
                otherwise: told.to_owned(),
                success_rate: adapted.success_rate,
                otherwise_success_rate: adapted.first_success_rate,
                starts: adapted.starts,
                tried: adapted.tried,
                simulations: adapted.simulations,
                invalid: adapted.invalid,
            });
        }
        save(args, &file)?;
    }
    drop(bar);
    if file.egos.is_empty() {
        return interrupted_early(&args.common);
    }
    if let Some(path) = &args.output {
        talk::say(&format!(
            "kept in {}; play it with `brakecheck eval {} --ego … --params {}`",
            path.display(),
            args.run.display(),
            path.display()
        ));
    }
    if args.common.json {
        print_json(&json!(file))?;
    }
    Ok(finished(Exit::Done))
}

/// A place that is none is found out before anything is run.
fn can_be_written(path: &Path) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new(""));
    match folder.as_os_str().is_empty() || folder.is_dir() {
        true => Ok(()),
        false => Err(Failure::input(
            format!("`{}` is no directory", folder.display()),
            "make it, or name another file with `-o`",
        )),
    }
}

/// What is known so far, so that nothing is lost later.
fn save(args: &IdentifyArgs, file: &IdentifiedEgos) -> Result<(), Failure> {
    match &args.output {
        Some(path) => Ok(file.save(path)?),
        None => Ok(()),
    }
}

/// By name, in the order of the family.
fn named<T: Copy>(family: &Family, values: &[T]) -> IndexMap<String, T> {
    let names = family.quantities.iter().map(|q| q.varied.name().to_owned());
    names.zip(values.iter().copied()).collect()
}

fn kept(args: &IdentifyArgs, family: &Family, ego: &NamedEgo, found: &Identified) -> IdentifiedEgo {
    let hidden = named(family, &found.hidden).into_iter();
    IdentifiedEgo {
        parameters: named(family, &found.member.values),
        spread: named(family, &found.spread),
        hidden: hidden
            .filter(|(name, hidden)| *hidden && !args.leave_out.contains(name))
            .map(|(name, _)| name)
            .collect(),
        explains: found.explains(),
        residual_m: found.residual_m,
        nominal_residual_m: found.nominal_residual_m,
        noise_m: found.noise_m,
        refits_m: found.refits_m.clone(),
        recorded: found.recorded,
        simulations: found.simulations,
        change: Some(ego.change.clone()),
        adapted: None,
    }
}

fn show_adapted(
    args: &IdentifyArgs,
    family: &Family,
    ego: &NamedEgo,
    (adapted, otherwise): (&Adapted, &str),
) -> Result<(), Failure> {
    if args.common.json {
        return Ok(());
    }
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
    talk::data(&format!(
        "{}: the ado {found} {} members tried in {} runs of the ego{invalid})\n",
        ego.name, adapted.tried, adapted.simulations
    ))
}

fn show(
    args: &IdentifyArgs,
    family: &Family,
    ego: &NamedEgo,
    found: &Identified,
) -> Result<(), Failure> {
    if args.common.json {
        return Ok(());
    }
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
            true if args.leave_out.iter().any(|left| left == name) => "left out: nominal",
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
        ["quantity", "fitted", "spread", "nominal", "family", ""],
        lines,
    );
    talk::data(&format!(
        "{}: {verdict}\n\
         (root mean square over {} recorded runs, a speed error of 1 m/s counted like 1 m; the \
         nominal ego strays by {:.2} m, noise alone makes {:.2} m;\nindependent fits {} m; {} runs of \
         members simulated)\n{table}\n",
        ego.name,
        found.recorded,
        found.nominal_residual_m,
        found.noise_m,
        refits.join(", "),
        found.simulations
    ))
}
