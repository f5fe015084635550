//! Spellings of earlier versions, which are refused with the new one.

use clap::Args;

use super::Failure;

/// Whatever an earlier version took.
#[derive(Args, Debug)]
pub(super) struct GoneArgs {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    words: Vec<String>,
}

/// `identify RUN --ego E -o P.ron`, once followed by `eval RUN --ego E --params P.ron`.
pub(super) fn identify(args: &GoneArgs) -> Failure {
    let given = |name: &str| {
        let at = args.words.iter().position(|word| word == name);
        at.and_then(|at| args.words.get(at + 1).cloned())
    };
    let run = args.words.first().filter(|word| !word.starts_with('-'));
    let run = run.map_or("RUN", String::as_str);
    let ego = given("--ego").unwrap_or_else(|| "E".to_owned());
    // The former adaptation took hundreds of runs, and adapting now takes fewer.
    let runs = if args.words.iter().any(|word| word.starts_with("--adapt")) {
        "100".to_owned()
    } else {
        given("--runs").unwrap_or_else(|| "10".to_owned())
    };
    Failure::input(
        "`identify` is a part of `eval`: an ado that may run the ego identifies it first, and \
         remembers it in its run",
        format!(
            "`brakecheck eval {run} --ego '{ego}' --runs {runs}`: with 10 runs it is identified, \
             with 100 the ado also learns how it drives"
        ),
    )
}

/// `eval --params SOURCE`.
pub(super) fn params(source: &str) -> Failure {
    let cure = match source {
        "nominal" => "leave it out: without `--runs` the ado is told the nominal parameters",
        "identified" => "`--runs 10`: the ego is identified from ten runs of it",
        "true" => {
            "`--runs 10`: the ego is identified from ten runs of it; `report` tells the truth of \
             the world file"
        }
        _ => {
            "`--runs 10`: the ego is identified from ten runs of it, once; `--runs 100` also \
             learns how it drives"
        }
    };
    Failure::input(
        format!("`--params {source}`: what a conditional ado is told follows from `--runs`"),
        cure,
    )
}
