//! `brakecheck report` of kept crashes, of a gate and of a risk.

use std::path::Path;

use serde_json::Value;

use super::failure::{Exit, Failure};
use super::replay::note_absent_egos;
use super::report_args::ReportArgs;
use super::report_texts::{MOST_EXAMPLES, ReportTexts};
use crate::crashes::{Regressions, ReplayQuestion, replay_page};
use crate::evaluation::{DecidedGate, gate_page};
use crate::report::{ResultPage, TestSuite, junit};
use crate::risk::RiskReport;
use crate::ron_file::file_text;
use crate::visible::command_line;

/// Returns whether a path is a directory of kept crashes, and no run.
pub(super) fn is_kept(path: &Path) -> bool {
    // A run may contain RON files, too, and it has a page of its own.
    let is_run = ["manifest.json", "population.json"].map(|file| path.join(file).is_file());
    let mut files = std::fs::read_dir(path).into_iter().flatten().flatten();
    let is_crash = |file: &Path| file.extension().is_some_and(|it| it == "ron");
    is_run == [false; 2] && files.any(|file| is_crash(&file.path()))
}

/// Replays kept crashes and writes their page.
pub(super) fn of_crashes(args: &ReportArgs) -> Result<Exit, Failure> {
    refuse_options(args, "a directory of kept crashes")?;
    let mut kept = Regressions::find(&args.run, None)?
        .allow_programs(args.common.allow_programs)
        .begin_egos_anew(args.common.fresh)
        .allow_invalid(args.common.allow_invalid);
    let is_recorded = args.ego.is_none() && args.program.is_empty();
    let replayed = if is_recorded {
        kept.replay_recorded()?
    } else {
        kept = kept.against(args.ego.as_deref(), &args.program)?;
        kept.replay()?
    };
    let ego = match &args.ego {
        _ if !args.program.is_empty() => command_line(&args.program),
        Some(ego) => ego.clone(),
        None => "the recorded ego".to_owned(),
    };
    let page = replay_page(&replayed, &ego, MOST_EXAMPLES);
    // The page asks whether the ego still fails, as `replay` does by default.
    let suite = kept.suite(&replayed, ReplayQuestion::StillFails);
    let usual = args.run.join("report.html");
    write(args, &usual, page, vec![suite])?;
    // Checked last, so that the page shows what is wrong, too.
    if kept.is_recorded_ego() {
        let instead = "its recorded commands were repeated\n  help: name your ego with `--ego` or \
                       after `--`";
        note_absent_egos(&kept, instead);
    }
    kept.check_faults(&replayed)?;
    // A record that is not reproduced explains the broken rules.
    if kept.is_recorded_ego() {
        Regressions::check_records(&replayed)?;
    }
    Regressions::check_answers(&replayed)?;
    Ok(Exit::Done)
}

/// Writes the page of a gate or of a risk, from its JSON.
pub(super) fn of_file(args: &ReportArgs) -> Result<Exit, Failure> {
    refuse_options(args, "a result")?;
    if args.ego.is_some() || !args.program.is_empty() {
        return Err(Failure::input(
            "a result has its ego, so its page takes no `--ego` and no program",
            "leave it out, or name the ego in `gate` or `risk`",
        ));
    }
    let file = &args.run;
    let wrong = |why: String| {
        Failure::input(
            format!(
                "`{}` is no result of `gate` or `risk`: {why}",
                file.display()
            ),
            "write one with `brakecheck gate … --json > gate.json`, or with `risk … --json`",
        )
    };
    let text = file_text(file).map_err(|error| wrong(error.to_string()))?;
    let object: Value = serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
    let usual = file.with_extension("html");
    // Of all verbs, only `gate` prints this key.
    if object.get("gates").is_some() {
        let gates: Vec<DecidedGate> = serde_json::from_value(object["gates"].clone())
            .map_err(|error| wrong(error.to_string()))?;
        // An edited file could claim a decision that its numbers refute.
        if let Some(why) = gates.iter().find_map(DecidedGate::contradiction) {
            return Err(wrong(why));
        }
        // A suite without a test case would look like a pass in CI.
        if gates.is_empty() {
            return Err(wrong("it has no gate".to_owned()));
        }
        // Gates do not name their world, but the rows beside them do.
        let world = object["rows"][0]["world"].as_str().unwrap_or("world");
        let suites = gates.iter().map(|gate| gate.suite(world)).collect();
        write(args, &usual, gate_page(&gates, world), suites)?;
    } else {
        let risk: RiskReport =
            serde_json::from_value(object).map_err(|it| wrong(it.to_string()))?;
        if let Some(why) = risk.contradiction() {
            return Err(wrong(why));
        }
        write(args, &usual, risk.page(), vec![risk.suite()])?;
    }
    Ok(Exit::Done)
}

/// Refuses options that are for runs.
pub(super) fn refuse_options(args: &ReportArgs, what: &str) -> Result<(), Failure> {
    let runs_only = args.scenarios || args.reuse_starts.is_some();
    if runs_only || !args.with.is_empty() || !args.rows.is_empty() {
        return Err(Failure::input(
            format!(
                "`{}` is {what}: --with, --rows, --reuse-starts and --scenarios are for runs",
                args.run.display()
            ),
            "leave them out",
        ));
    }
    Ok(())
}

fn write(
    args: &ReportArgs,
    usual: &Path,
    page: ResultPage<'_>,
    suites: Vec<TestSuite>,
) -> Result<(), Failure> {
    let html = args.output.as_deref().unwrap_or(usual);
    let page = ResultPage {
        commands: vec![args.this_page(false)],
        ..page
    };
    let pages = ReportTexts {
        verdict: vec![page.verdict.clone()],
        html: page.html(),
        junit: junit(&suites),
    };
    pages.write(args, html)
}
