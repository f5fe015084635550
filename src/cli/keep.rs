//! Option of `eval`, `gate`, `sweep` and `search` for kept counterexamples.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;

use super::answer::AnswerArgs;
use super::display::message_columns;
use super::failure::Failure;
use super::number_args::whole_number;
use super::output_path::check_dir;
use super::progress;
use super::terminal::{self, Common};
use crate::crashes::{CrashSelection, Form, KEEP_RUNS, KeepSettings, KeptFiles, case_name};
use crate::experiment::Watch;
use crate::report::{TextTable, known_if};
use crate::run_dir::About;

/// Default number of kept counterexamples per ego.
const USUAL: usize = 10;
/// Kept files in the printed table.
const SHOWN: usize = 10;

/// Text of `--help`.
const SETTINGS: &str = "\
Write the worst distinct and persistent counterexamples into a directory

Settings, as in `--keep crashes,most=4,as-found`:
- most=N:   At most N per ego [default: 10; of points all]
- all:      Every counterexample, similar ones included
- as-found: Without minimization
- runs=N:   At most N runs of a program to minimize and label each [default: 300]
The name of the directory must not contain a comma";

/// Kept counterexamples: their number, form and directory.
#[derive(Args, Clone, Debug)]
pub(super) struct KeepArgs {
    /// Write the worst distinct and persistent counterexamples into a directory.
    #[arg(long, value_name = "DIR[,SETTING]...", value_parser = request, long_help = SETTINGS)]
    keep: Option<KeepRequest>,
}

/// Last step of a command, which keeps counterexamples.
#[derive(Clone, Copy)]
pub(super) struct KeepStep {
    /// Number of egos, each of which was a step before.
    pub(super) egos: usize,
    pub(super) answer: AnswerArgs,
}

/// Notes a line per kept file, or with `--details` all of its labels.
pub(super) fn note_kept(kept: &[KeptFiles], answer: AnswerArgs) {
    let files: Vec<&(PathBuf, About)> = kept.iter().flat_map(|it| &it.files).collect();
    if answer.details {
        for (file, about) in files {
            let about = about.to_string().replace('\n', "\n  ");
            terminal::note(&format!("{}:\n  {about}", file.display()));
        }
    } else if !files.is_empty() {
        let lines = files
            .iter()
            .take(SHOWN)
            .map(|(file, about)| line(file, about));
        let columns = [
            "kept crash",
            "kind",
            "closing",
            "Δv",
            "avoided by",
            "variations",
        ];
        let table = TextTable::new(columns, lines).numbers_from(2);
        terminal::note(&table.to_terminal(message_columns()));
        match files.len().saturating_sub(SHOWN) {
            0 => {}
            more => terminal::note(&format!("{more} more kept crashes: `--details` lists them")),
        }
        let reasons = files.iter().filter_map(|(_, about)| {
            let runs = about.ego_runs.as_ref()?;
            runs.ended.as_ref().map(ToString::to_string)
        });
        // A set, because files of one ego often share their reason.
        for reason in BTreeSet::from_iter(reasons) {
            terminal::note(&format!("not all labels are known: {reason}"));
        }
    }
}

/// Returns a kept file with its severity, the drivers that avoid it, and its persistence.
fn line(file: &Path, about: &About) -> [String; 6] {
    let severity = about.severity.as_ref();
    let dash = || "–".to_owned();
    let of = |part: usize, whole: usize| known_if(whole > 0, || format!("{part} of {whole}"));
    let drivers = about
        .preventability
        .as_ref()
        .map(|it| it.drivers().map(|names| names.len()));
    let persistence = about.persistence.as_ref();
    [
        case_name(file),
        severity
            .map_or("no contact", |it| it.impact.kind.word())
            .to_owned(),
        severity.map_or_else(dash, |it| format!("{:.1} m/s", it.closing_speed_mps)),
        severity.map_or_else(dash, |it| format!("{:.1} m/s", it.impact.ego_delta_v_mps)),
        drivers.map_or_else(dash, |[avoid, others]| of(avoid, avoid + others)),
        persistence.map_or_else(dash, |it| of(it.failing(), it.answered())),
    ]
}

/// Directory and its settings.
#[derive(Clone, Debug, PartialEq)]
struct KeepRequest {
    dir: PathBuf,
    /// `None` without a setting, because points have another default.
    selection: Option<CrashSelection>,
    form: Form,
    runs: u64,
}

/// Parses a directory and its settings.
fn request(text: &str) -> Result<KeepRequest, String> {
    let mut parts = text.split(',');
    let dir = parts.next().unwrap_or_default();
    if dir.is_empty() {
        return Err("missing directory".to_owned());
    }
    check_dir(Path::new(dir))?;
    let mut request = KeepRequest {
        dir: dir.into(),
        selection: None,
        form: Form::Shrunk,
        runs: KEEP_RUNS,
    };
    let mut given = Vec::new();
    for setting in parts {
        let (name, value) = match setting.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (setting, None),
        };
        // The last of two settings would win silently.
        if given.contains(&name) {
            return Err(format!("`{name}` is there twice"));
        }
        given.push(name);
        let number = |least: u64| {
            let number = value.and_then(whole_number).filter(|it| least <= *it);
            number.ok_or_else(|| format!("`{name}=N` requires a whole number from {least} on"))
        };
        let selection = match (name, value) {
            ("most", _) => CrashSelection::Worst(number(1)? as usize),
            ("all", None) => CrashSelection::All,
            // Form and runs go with either selection, so they are no part of the check
            // below.
            ("as-found", None) => {
                request.form = Form::AsFound;
                continue;
            }
            ("runs", _) => {
                // Without a run a program's crashes are kept as found and without labels.
                request.runs = number(0)?;
                continue;
            }
            _ => {
                return Err(format!(
                    "unknown setting `{setting}`, known are most=N, all, as-found and runs=N"
                ));
            }
        };
        // The same setting twice was refused above, so this is the other one of the two.
        if request.selection.replace(selection).is_some() {
            return Err(format!("`{setting}` contradicts an earlier setting"));
        }
    }
    Ok(request)
}

impl KeepArgs {
    /// The directory, if anything is to be kept.
    pub(super) fn dir(&self) -> Option<&Path> {
        self.keep.as_ref().map(|keep| keep.dir.as_path())
    }

    /// Returns the settings, with the selection `usual` by default.
    fn settings_of(&self, usual: CrashSelection) -> KeepSettings {
        let Some(keep) = &self.keep else {
            return KeepSettings::new(usual, Form::Shrunk);
        };
        KeepSettings {
            runs: keep.runs,
            ..KeepSettings::new(keep.selection.unwrap_or(usual), keep.form)
        }
    }

    /// Returns the steps of a command that plays so many egos.
    ///
    /// Keeping plays many runs, so it counts as a step.
    pub(super) fn steps(&self, egos: usize) -> usize {
        egos + usize::from(self.keep.is_some())
    }

    /// Keeps counterexamples, by default the worst, as the step after those of the egos.
    pub(super) fn last_step<E>(
        &self,
        common: &Common,
        step: KeepStep,
        keep: impl FnOnce(&Path, KeepSettings, &Watch<'_>) -> Result<Vec<KeptFiles>, E>,
    ) -> Result<(), Failure>
    where
        Failure: From<E>,
    {
        let egos = step.egos;
        let Some(dir) = self.dir() else {
            return Ok(());
        };
        let bar = progress::bar(common, "");
        let watch = bar.watch().first_of(self.steps(egos)).later(egos);
        let settings = self.settings_of(CrashSelection::Worst(USUAL));
        // A second Ctrl-C ends the process, so this step needs no stop of its own.
        let go_on = AtomicBool::new(false);
        let kept = if terminal::stopped() {
            let watch = Watch {
                stop: &go_on,
                ..watch
            };
            watch.note("interrupted: counterexamples are kept as found, without minimization");
            // A user who pressed Ctrl-C waits for the end, and minimization would play
            // many more runs.
            keep(dir, settings.as_found().runs(0), &watch)?
        } else {
            keep(dir, settings, &watch)?
        };
        drop(bar);
        note_kept(&kept, step.answer);
        Ok(())
    }

    /// Returns the settings for points, by default all.
    pub(super) fn settings_of_points(&self) -> KeepSettings {
        self.settings_of(CrashSelection::All)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_has_settings_behind_commas() {
        let read = |text: &str| request(text).expect(text);
        let bare = read("kept");
        assert_eq!((bare.selection, bare.form), (None, Form::Shrunk));
        assert_eq!(bare.runs, KEEP_RUNS);
        let few = read("a/b=c,most=1_000,as-found,runs=16");
        assert_eq!(few.dir, Path::new("a/b=c"));
        assert_eq!(few.selection, Some(CrashSelection::Worst(1000)));
        assert_eq!((few.form, few.runs), (Form::AsFound, 16));
        assert_eq!(read("kept,all").selection, Some(CrashSelection::All));
    }

    #[test]
    fn a_wrong_setting_is_named_beside_the_known_ones() {
        for (text, says) in [
            ("", "missing directory"),
            (",all", "missing directory"),
            (
                "kept,mots=3",
                "unknown setting `mots=3`, known are most=N, all",
            ),
            ("kept,", "unknown setting ``"),
            ("kept,all=3", "unknown setting `all=3`"),
            ("kept,most", "`most=N` requires a whole number from 1 on"),
            ("kept,most=0", "whole number from 1 on"),
            ("kept,runs=x", "`runs=N` requires a whole number from 0 on"),
            ("kept,most=3,all", "`all` contradicts"),
        ] {
            let error = request(text).expect_err(text);
            assert!(error.contains(says), "{text}: {error}");
        }
    }
}
