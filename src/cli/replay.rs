//! `brakecheck replay`: kept counterexamples.

use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;

use super::{Common, Exit, Failure, finite_or_word, print_json, progress, table_of, terminal};
use crate::crashes::{Regressions, Replayed};
use crate::rulebook::RulesUntilContact;
use crate::run_dir::{About, StartRepeated};
use crate::stats::wilson;
use crate::testbench::Episode;

#[derive(Args, Debug)]
pub(super) struct ReplayArgs {
    /// A kept counterexample, a directory of them, or a run directory.
    #[arg(value_name = "FILE|DIR|RUN")]
    what: PathBuf,
    /// Which of them: a number (from 0) or a file name; all if left out.
    episode: Option<String>,
    /// Replay against this ego: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// What counts as well: reproducing what was recorded.
    #[arg(long, value_enum)]
    expect: Option<Expect>,
    /// Find out what is to be said of each (severity, cause, persistence) and write
    /// those that are reproduced bit for bit again with it, and their hashes.
    #[arg(long, requires = "expect", conflicts_with_all = ["ego", "program"])]
    refine: bool,
    /// Exit with 1 if a kept counterexample still fails (the default).
    #[arg(long)]
    fail_on_counterexample: bool,
    /// A program that is the ego, after `--`: typing it consents to start it.
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum Expect {
    /// Verdict, robustness, contact, rules until it and every sample as recorded.
    Recorded,
}

pub(super) fn run(args: &ReplayArgs) -> Result<Exit, Failure> {
    let mut regressions = Regressions::find(&args.what, args.episode.as_deref())?
        .allow_programs(args.common.allow_programs)
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
    // Labels of another run are computed by replays, so they run in parallel.
    let known: Vec<About> = replayed.par_iter().map(Replayed::known).collect();
    let rows: Vec<_> = replayed
        .iter()
        .zip(&known)
        .map(|(it, about)| row(it, about))
        .collect();
    let in_all = ReplaySummary::of(&replayed);
    if args.common.json {
        print_json(&json!({ "rows": rows, "in_all": in_all }))
    } else {
        terminal::data(&format!(
            "{}{}\n{in_all}",
            table(&replayed),
            remarks(&replayed, &known)
        ))
    }?;
    regressions.check_faults(&replayed)?;
    Ok(exit(args, regressions.is_recorded_ego(), &replayed))
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

/// Summary of all replays.
#[derive(Serialize)]
struct ReplaySummary {
    replayed: usize,
    still_fail: usize,
    fixed: usize,
    /// Replays without a result, because the ego or the physics did not run.
    invalid: usize,
}

impl ReplaySummary {
    fn of(replayed: &[Replayed]) -> ReplaySummary {
        let still_fail = replayed.iter().filter(|one| one.still_fails()).count();
        let invalid = replayed.iter().filter(|one| one.fault().is_some()).count();
        ReplaySummary {
            replayed: replayed.len(),
            still_fail,
            fixed: replayed.len() - still_fail - invalid,
            invalid,
        }
    }
}

impl Display for ReplaySummary {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let ReplaySummary {
            replayed,
            still_fail,
            fixed,
            invalid,
        } = self;
        write!(f, "{still_fail} of {replayed} still fail, {fixed} fixed")?;
        match invalid {
            0 => Ok(()),
            some => write!(f, ", {some} did not run"),
        }
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
        "robustness": finite_or_word(replayed.episode.robustness),
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

/// Formats differences, faults and egos that are not deterministic.
fn remarks(replayed: &[Replayed], known: &[About]) -> String {
    let mut text = String::new();
    for (one, about) in replayed.iter().zip(known) {
        let file = one.path.display();
        if let Some(departure) = one.departure() {
            text.push_str(&format!("\n{file}: {departure}"));
        }
        if let Some(fault) = one.fault() {
            text.push_str(&format!("\n{file}: {}: {fault}", fault.kind.word()));
        }
        if let Some(repeated) = &one.repeated {
            let (failing, ran) = repeated.failing();
            let [lo, hi] = wilson(failing, ran).map(|share| 100.0 * share);
            text.push_str(&format!(
                "\n{file}: the ego fails in {failing} of {ran} runs [{lo:.0}–{hi:.0} %]{}",
                if repeated.differs() {
                    "; it does not answer alike in all of them"
                } else {
                    ""
                }
            ));
        }
        // An invalid run has no outcome to describe.
        if one.fault().is_none() {
            let about = if *about == About::default() {
                String::new()
            } else {
                format!("\n{about}").replace('\n', "\n  ")
            };
            text.push_str(&format!("\n{file}: {}{about}", one.in_words()));
        }
        if one.ego_as_recorded == Some(false) && one.fault().is_none() {
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

/// The name of a file in the directory of all, its path if there is none.
fn file_in(directory: Option<&Path>, file: &Path) -> String {
    let name = file.file_name().filter(|_| directory.is_some());
    let path = name.map_or(file, Path::new);
    path.display().to_string()
}

fn table(replayed: &[Replayed]) -> String {
    let mut directories = replayed.iter().map(|replayed| replayed.path.parent());
    let first = directories.next().flatten();
    // A common directory is printed once, above the table.
    let directory = first.filter(|_| directories.all(|other| other == first));
    let lines = replayed.iter().map(|replayed| {
        let contact = replayed.episode.contact.as_ref();
        let contact = contact.map_or("–".to_owned(), |touch| {
            format!("{:.3} s, {:.2} m/s", touch.time_s, touch.closing_speed_mps)
        });
        let bits = if replayed.identical {
            "identical".to_owned()
        } else {
            match &replayed.first_difference {
                Some(difference) => format!("differ from {:.2} s", difference.time_s),
                None => "differ, see below".to_owned(),
            }
        };
        let rules = replayed.episode.rules_until_contact.as_ref();
        [
            file_in(directory, &replayed.path),
            replayed.episode.verdict.word().to_owned(),
            format!("{:.6}", replayed.episode.robustness),
            contact,
            rules.map_or("–".to_owned(), ToString::to_string),
            bits,
        ]
    });
    let header = [
        "file",
        "verdict",
        "ρ(ψ)",
        "contact",
        "rules until it",
        "bits",
    ];
    let place = match directory {
        Some(directory) if !directory.as_os_str().is_empty() => {
            format!("in {}\n", directory.display())
        }
        _ => String::new(),
    };
    format!(
        "{place}{}\nverdict        counterexample: the ego failed, every rule kept; foul: one was broken; held: neither\
         \nρ(ψ)           robustness of the ego's specification; below 0 it is violated\
         \ncontact        when it is, and at which closing speed; –: there was none\
         \nrules until it whether the ados kept theirs until the contact; –: there was none, or it is not known\
         \nbits           whether every sample of this run is the recorded one, or from when on not",
        table_of(header, lines)
    )
}
