//! `brakecheck replay`: kept counterexamples.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rayon::prelude::*;
use serde_json::json;

use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::print_json;
use super::display::stdout_columns;
use super::failure::{Exit, Failure};
use super::headings::OUTPUT;
use super::input;
use super::kept_input;
use super::output_path::new_file;
use super::progress;
use super::terminal::{self, Common};
use super::test_args::PROGRAM;
use crate::crashes::{
    Regressions, ReplayCounts, ReplayOutcome, ReplayQuestion, Replayed, SavedCounterexample,
    case_name,
};
use crate::report::{TextTable, junit};
use crate::rulebook::RulesUntilContact;
use crate::run_dir::{About, StartRepeated, counted, number_or_word, write_output};
use crate::stats::wilson;
use crate::testbench::Episode;

#[derive(Args, Debug)]
pub(super) struct ReplayArgs {
    /// A kept counterexample (- is stdin), a directory of them, or a run directory.
    #[arg(value_name = "FILE|DIR|RUN")]
    what: PathBuf,
    /// Number (from 0) or file name of a single counterexample [default: all].
    episode: Option<String>,
    /// Replay against this ego: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// Check this, instead of whether the ego still fails.
    #[arg(long, value_enum)]
    expect: Option<Expect>,
    /// Determine severity, cause and persistence again, in files that replay bit for
    /// bit.
    #[arg(long, requires = "expect", conflicts_with_all = ["ego", "program"], help_heading = OUTPUT)]
    refine: bool,
    /// Write the outcomes as JUnit XML to this file, too.
    #[arg(long, value_name = "FILE.xml", value_parser = new_file())]
    junit: Option<PathBuf>,
    /// Exit with 1 if a kept counterexample still fails (the default).
    // Never read: it lets a script give one option to all verbs.
    #[arg(long, help_heading = OUTPUT)]
    fail_on_counterexample: bool,
    /// Program to run as the ego, after `--`, which consents to start it.
    #[arg(last = true, value_name = "COMMAND", long_help = PROGRAM)]
    program: Vec<String>,
    #[command(flatten)]
    answer: AnswerArgs,
    #[command(flatten)]
    pub(super) common: Common,
}

/// Replays in the printed table. The details have all of them.
const SHOWN: usize = 12;

/// Legend of the columns.
const EXPLAINED: &str = "
outcome        still fails: the ego fails, every rule kept; no answer: an ado broke its rule first
ρ(ψ)           robustness of the ego's specification; below 0 it is violated
contact        its time and closing speed
rules          of the ados, until the contact
bits           identical: every sample is as recorded; otherwise the time of the first difference";

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Expect {
    /// Verdict, robustness, contact, rules and every sample are as recorded.
    Recorded,
}

pub(super) fn run(args: &ReplayArgs) -> Result<Exit, Failure> {
    let mut regressions = kept_input::find(&args.what, args.episode.as_deref())?
        .allow_programs(args.common.allow_programs)
        .begin_egos_anew(args.common.fresh)
        .allow_invalid(args.common.allow_invalid);
    let recorded = args.expect == Some(Expect::Recorded);
    let mut replayed = match (&args.ego, args.program.is_empty()) {
        // Recorded commands replace a program here, so no consent is needed.
        (None, true) if recorded => regressions.replay_recorded()?,
        (ego, _) => {
            regressions = regressions.against(ego.as_deref(), &args.program)?;
            regressions.replay()?
        }
    };
    if args.refine {
        refine(&args.common, &regressions, &mut replayed)?;
    }
    write_junit(args, &regressions, &replayed)?;
    show(args, recorded, &replayed)?;
    note_missing_samples(&args.what, &regressions);
    if regressions.is_recorded_ego() && !recorded {
        let instead = "the world's own ego was replayed\n  help: repeat the record with `--expect \
                       recorded`, or name your ego with `--ego` or after `--`";
        note_absent_egos(&regressions, instead);
    }
    // This follows the table, which shows the replays that did not run.
    regressions.check_faults(&replayed)?;
    let exit = exit(args, regressions.is_recorded_ego(), &replayed);
    // A record that is not reproduced explains the broken rules.
    if exit != Exit::NotIdentical && !recorded {
        Regressions::check_answers(&replayed)?;
    }
    Ok(exit)
}

/// Writes the outcomes as JUnit XML, if it is requested.
fn write_junit(
    args: &ReplayArgs,
    regressions: &Regressions,
    replayed: &[Replayed],
) -> Result<(), Failure> {
    let Some(file) = &args.junit else {
        return Ok(());
    };
    let question = match args.expect {
        Some(Expect::Recorded) => ReplayQuestion::AsRecorded,
        None => ReplayQuestion::StillFails,
    };
    let suite = regressions.suite(replayed, question);
    Ok(write_output(file, junit(&[suite]).as_bytes())?)
}

/// Notes kept files without their samples, which may have been lost by a move.
fn note_missing_samples(what: &Path, regressions: &Regressions) {
    // Standard input is a single file by design.
    if input::is_stdin(what) {
        return;
    }
    let is_missing = |kept: &&SavedCounterexample| {
        // Counterexamples of a training have no samples.
        let has_samples = kept.counterexample.samples_sha256.is_some();
        has_samples && !kept.path.with_extension("csv").exists()
    };
    let missing: Vec<&SavedCounterexample> = regressions.kept().iter().filter(is_missing).collect();
    if let Some(first) = missing.first() {
        terminal::note(&format!(
            "missing samples of {} of {} files, such as `{}`: only digests are compared\n  help: \
             keep both files of a crash together",
            missing.len(),
            regressions.kept().len(),
            first.path.with_extension("csv").display()
        ));
    }
}

/// Prints the replays.
fn show(args: &ReplayArgs, recorded: bool, replayed: &[Replayed]) -> Result<(), Failure> {
    // Labels of another run are computed by replays, so they run in parallel.
    let known = || -> Vec<About> { replayed.par_iter().map(Replayed::known).collect() };
    let in_all = ReplayCounts::of(replayed);
    if args.common.json {
        let rows: Vec<_> = replayed
            .iter()
            .zip(&known())
            .map(|(it, about)| row(it, about))
            .collect();
        return print_json(&json!({ "rows": rows, "in_all": in_all }));
    }
    // The run of another ego is expected to differ from the record.
    let compares = recorded || (args.ego.is_none() && args.program.is_empty());
    // The labels of a single replay fit below it. Those of many take replays of their own,
    // so they are computed on request only.
    let (below, details) = match replayed {
        [_] => (labels(replayed, &known(), compares), String::new()),
        _ if args.answer.details => (String::new(), labels(replayed, &known(), compares)),
        _ => (String::new(), "labels".to_owned()),
    };
    let answer = PrintedAnswer {
        verdict: vec![if recorded {
            as_recorded(&in_all, replayed)
        } else {
            in_all.to_string()
        }],
        table: format!(
            "{}{}{below}",
            ReplayTable {
                all: args.answer.details,
                compares
            }
            .table(replayed),
            faults(replayed, compares)
        ),
        details,
        legend: EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    };
    terminal::data(&answer.text(args.answer))
}

/// Notes egos of records that are not here, so that `instead` is not taken for them.
pub(super) fn note_absent_egos(regressions: &Regressions, instead: &str) {
    let absent = regressions.absent_egos();
    let Some((path, ego)) = absent.first() else {
        return;
    };
    let files = match absent.len() {
        1 => format!("`{}` has the ego `{ego}`", path.display()),
        n => format!(
            "{n} files such as `{}` have the ego `{ego}`",
            path.display()
        ),
    };
    terminal::note(&format!("{files}, which is in no file: {instead}"));
}

/// Returns the exit code of the replays.
fn exit(args: &ReplayArgs, is_recorded_ego: bool, replayed: &[Replayed]) -> Exit {
    let differs = replayed.iter().any(|replayed| !replayed.is_reproduced());
    // A replay that is not reproduced outweighs a failure of the ego.
    if is_recorded_ego && differs {
        return Exit::NotIdentical;
    }
    let is_other = replayed.iter().any(|replayed| !replayed.identical);
    match (args.expect, replayed.iter().any(Replayed::still_fails)) {
        (Some(Expect::Recorded), _) if is_other => Exit::NotIdentical,
        (None, true) => Exit::Counterexample,
        _ => Exit::Done,
    }
}

/// Counts the replays that are as recorded, in words.
fn as_recorded(in_all: &ReplayCounts, replayed: &[Replayed]) -> String {
    let same = replayed.iter().filter(|one| one.identical).count();
    // A replay that did not run is counted as invalid, not as different.
    let differs = |one: &&Replayed| !one.identical && one.fault().is_none();
    let differ = replayed.iter().filter(differs).count();
    let first = format!("{same} of {} as recorded, {differ} differ", in_all.replayed);
    match in_all.invalid {
        0 => first,
        some => format!("{first}, {some} did not run"),
    }
}

/// Labels the replays that are bit-identical.
fn refine(
    common: &Common,
    regressions: &Regressions,
    replayed: &mut [Replayed],
) -> Result<(), Failure> {
    let bar = progress::bar(common, "refining");
    let watch = bar.watch();
    let total = replayed.len() as u64;
    for (done, (kept, replayed)) in regressions.kept().iter().zip(replayed).enumerate() {
        (watch.progress)(done as u64, total);
        // Labels of another run would describe a crash that the file does not contain.
        if replayed.identical {
            let world = regressions.world_of(kept)?;
            replayed.about = Some(kept.refine(&world, &replayed.episode)?);
        }
    }
    Ok(())
}

fn row(replayed: &Replayed, about: &About) -> serde_json::Value {
    let difference = replayed.first_difference.as_ref();
    json!({
        "file": replayed.path.display().to_string(),
        "verdict": replayed.episode.verdict.word(),
        "robustness": robustness(replayed).map(number_or_word),
        "outcome": replayed.outcome(),
        "no_answer": replayed.no_answer(),
        "fault": replayed.fault(),
        "ego_as_recorded": replayed.ego_as_recorded,
        "runs": replayed.repeated.as_ref().map(runs),
        "rules_until_contact": rules_until_contact(&replayed.episode),
        "contact_s": replayed.episode.contact.as_ref().map(|touch| touch.time_s),
        "about": about,
        "identical": replayed.identical,
        "repeats_by_commands": replayed.repeats_by_commands,
        "first_difference": difference.map(ToString::to_string),
        "different_from_s": difference.map(|difference| difference.time_s),
    })
}

/// Returns the robustness, which a run that was cut off by a fault does not have.
fn robustness(replayed: &Replayed) -> Option<f64> {
    let episode = &replayed.episode;
    replayed.fault().is_none().then_some(episode.robustness)
}

/// Formats the runs of an ego that is not deterministic.
fn runs(repeated: &StartRepeated) -> serde_json::Value {
    let (failing, ran) = repeated.failing();
    json!({
        "failing": failing,
        "ran": ran,
        "failing_ci95": wilson(failing, ran),
        "differ": repeated.differs(),
    })
}

/// Formats faults, egos that are not deterministic, and records that are not repeated.
fn faults(replayed: &[Replayed], compares: bool) -> String {
    let mut text = String::new();
    for one in replayed {
        let file = one.path.display();
        if let Some(fault) = one.fault() {
            text.push_str(&format!("\n{file}: {}: {fault}", fault.kind.word()));
        }
        if let Some(repeated) = &one.repeated {
            let (failing, ran) = repeated.failing();
            let [lo, hi] = wilson(failing, ran).map(|share| 100.0 * share);
            text.push_str(&format!(
                "\n{file}: the ego fails in {failing} of {} [{lo:.0}–{hi:.0} %]{}",
                counted(ran, "run"),
                if repeated.differs() {
                    "; its commands differ between them"
                } else {
                    ""
                }
            ));
        }
        // A fault already explains the missing answer.
        if let Some(why) = one.no_answer().filter(|_| one.fault().is_none()) {
            text.push_str(&format!("\n{file}: no answer, because {why}"));
        }
        if let Some(departure) = one.departure().filter(|_| compares) {
            text.push_str(&format!("\n{file}: {departure}"));
        }
    }
    text
}

/// Formats the runs with their labels, and their differences from the recorded runs.
fn labels(replayed: &[Replayed], known: &[About], compares: bool) -> String {
    let mut text = String::new();
    // An invalid run has no outcome to describe.
    let ran = replayed
        .iter()
        .zip(known)
        .filter(|(one, _)| one.fault().is_none());
    for (one, about) in ran {
        let file = one.path.display();
        let about = if *about == About::default() {
            String::new()
        } else {
            format!("\n{about}").replace('\n', "\n  ")
        };
        text.push_str(&format!("\n{file}: {}{about}", one.in_words()));
        // In a comparison, `faults` has stated it below the table.
        if let Some(departure) = one.departure().filter(|_| !compares) {
            text.push_str(&format!("\n{file}: {departure}"));
        }
        if one.ego_as_recorded == Some(false) {
            text.push_str(&format!(
                "\n{file}: the ego commands otherwise than recorded"
            ));
        }
    }
    text
}

/// Returns `null` without a contact, otherwise whether the rules were kept.
fn rules_until_contact(episode: &Episode) -> serde_json::Value {
    match &episode.rules_until_contact {
        None => serde_json::Value::Null,
        Some(RulesUntilContact::Kept) => json!({ "kept": true }),
        Some(RulesUntilContact::Broken { rule, ado, time_s }) => {
            json!({ "kept": false, "rule": rule, "ado": ado, "time_s": time_s })
        }
    }
}

/// Rows and columns of the table.
struct ReplayTable {
    /// All replays, and not only the first.
    all: bool,
    /// Compare with the records.
    compares: bool,
}

impl ReplayTable {
    /// Draws the replays, of which the first are those that still fail or have no answer.
    fn table(&self, replayed: &[Replayed]) -> String {
        let mut directories = replayed.iter().map(|replayed| replayed.path.parent());
        let first = directories.next().flatten();
        // A common directory is printed once, above the table.
        let directory = first.filter(|_| directories.all(|other| other == first));
        let mut shown: Vec<&Replayed> = replayed.iter().collect();
        let most = if self.all { shown.len() } else { SHOWN };
        if most < shown.len() {
            // Stable, so that equal outcomes keep the order of the files.
            // `false` sorts first, so fixed and identical replays are the last.
            shown.sort_by_key(|one| (one.outcome() == ReplayOutcome::Fixed, one.identical));
        }
        let lines = shown.iter().take(most).map(|replayed| self.line(replayed));
        let header = ["file", "outcome", "ρ(ψ)", "contact", "rules", "bits"];
        let place = match directory {
            Some(directory) if !directory.as_os_str().is_empty() => {
                format!("in {}\n", directory.display())
            }
            _ => String::new(),
        };
        let table = TextTable::new(header, lines).to_terminal(stdout_columns());
        let more = match shown.len().saturating_sub(most) {
            0 => String::new(),
            more => format!("\n{}", counted(more, "more file")),
        };
        format!("{place}{table}{more}")
    }

    fn line(&self, replayed: &Replayed) -> [String; 6] {
        let touch = replayed.episode.contact.as_ref();
        let contact = touch.map_or("–".to_owned(), |touch| {
            format!("{:.2} s, {:.1} m/s", touch.time_s, touch.closing_speed_mps)
        });
        let bits = match &replayed.first_difference {
            _ if !self.compares => "–".to_owned(),
            _ if replayed.identical => "identical".to_owned(),
            Some(difference) => format!("differ from {:.2} s", difference.time_s),
            None => "differ, see below".to_owned(),
        };
        let rules = replayed.episode.rules_until_contact.as_ref();
        [
            case_name(&replayed.path),
            replayed.outcome().words().to_owned(),
            robustness(replayed).map_or("–".to_owned(), |rho| format!("{rho:.6}")),
            contact,
            rules.map_or("–".to_owned(), ToString::to_string),
            bits,
        ]
    }
}
