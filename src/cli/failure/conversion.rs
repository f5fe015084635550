//! Errors of the library as failures, each with its exit code and its help.

use std::fmt;
use std::path::Path;

use super::{Exit, Failure, MOST_NOTES, Note, not_allowed, placed, plain_theme};
use crate::adversary::AdversaryError;
use crate::campaign::CampaignError;
use crate::cli::display::message_columns;
use crate::crashes::{
    ExportRefusal, FindError, NotExported, PictureError, RegressionError, UnknownViewKind,
};
#[cfg(feature = "drive")]
use crate::drive::DriveError;
use crate::evaluation::harden::HardenError;
use crate::evaluation::{EvaluationError, SweepError};
use crate::experiment::{EgoError, TrafficError, unknown_ego_help};
use crate::openx::OpenXError;
use crate::population::{LeagueError, PopulationError};
use crate::risk::{RiskTrafficError, TrafficTrainingError};
use crate::rl::ConfigError;
use crate::ron_file::{LoadError, ScenarioError, guessed};
use crate::run_dir::{KeptError, RunError};
use crate::search::SearchError;
use crate::testbench::Complaint;
use crate::theorems::TheoremsError;
use crate::training::{BankError, SessionError, TrainError};
use crate::world::Scenario;

impl From<&ScenarioError> for Failure {
    fn from(error: &ScenarioError) -> Failure {
        // One mistake can cause many others, so the first are enough.
        let problems = error
            .problems
            .iter()
            .take(MOST_NOTES)
            .map(|problem| placed(&error.file, &error.text, problem));
        let mut notes: Vec<Note> = problems.collect();
        if let more @ 1.. = error.problems.len() - notes.len() {
            let what = format!("{more} more mistakes are not shown");
            notes.push(Note::new(&what, Some("correct these first")));
        }
        Failure::of(Exit::Input, notes)
    }
}

impl From<&LoadError> for Failure {
    fn from(error: &LoadError) -> Failure {
        match error {
            LoadError::Scenario(error) => Failure::from(&**error),
            LoadError::Io { file, .. } => {
                // A run has its world in it, so the fix can name that file.
                let world = Path::new(file).join("world.ron");
                if world.is_file() {
                    return Failure::input(
                        format!("`{file}` is a run, and no world"),
                        format!("name its world: `{}`", world.display()),
                    );
                }
                // A mistyped name of a shipped world is a frequent mistake.
                let stem = Path::new(file).file_stem().and_then(|stem| stem.to_str());
                let known = guessed(
                    stem.unwrap_or_default(),
                    "shipped",
                    Scenario::shipped_names(),
                );
                Failure::input(
                    error.to_string(),
                    format!("name a world file, or a shipped world by its name; {known}"),
                )
            }
        }
    }
}

impl From<TrafficError> for Failure {
    fn from(error: TrafficError) -> Failure {
        Failure::input(error.to_string(), error.help())
    }
}

impl From<RiskTrafficError> for Failure {
    fn from(error: RiskTrafficError) -> Failure {
        Failure::from(&error)
    }
}

impl From<&TrafficTrainingError> for Failure {
    fn from(error: &TrafficTrainingError) -> Failure {
        match (error, error.help()) {
            (TrafficTrainingError::World(error), _) => Failure::from(error),
            (_, help) => Failure::plain(Exit::Input, error.to_string(), help.map(str::to_owned)),
        }
    }
}

impl From<&RiskTrafficError> for Failure {
    fn from(error: &RiskTrafficError) -> Failure {
        match error {
            RiskTrafficError::File(LoadError::Io { .. }) => Failure::input(
                error.to_string(),
                // The general help of an unreadable file would advise to name a world
                // here.
                "name a traffic file (examples/traffic has some), or `motorway`",
            ),
            RiskTrafficError::File(error) => Failure::from(error),
            RiskTrafficError::Model(error) => Failure::input(error.to_string(), error.help()),
            RiskTrafficError::Grid { .. } => Failure::input(
                error.to_string(),
                "name a driving world; `brakecheck eval` measures grids on all starts",
            ),
        }
    }
}

impl From<HardenError> for Failure {
    fn from(error: HardenError) -> Failure {
        match error {
            HardenError::Traffic(error) => error.into(),
            HardenError::Ego(error) => error.into(),
            HardenError::Session(error) => error.into(),
            HardenError::Run(error) => error.into(),
            HardenError::Kept(error) => error.into(),
            // A program or a disk that fails is no mistake of the command line.
            HardenError::Program(_) | HardenError::Unwritable { .. } => {
                Failure::fault(error.to_string(), error.help())
            }
            other => {
                let help = other.help().unwrap_or_default();
                Failure::input(other.to_string(), help)
            }
        }
    }
}

impl From<&ConfigError> for Failure {
    fn from(error: &ConfigError) -> Failure {
        Failure::input(error.what(), &error.help)
    }
}

impl From<&RunError> for Failure {
    fn from(error: &RunError) -> Failure {
        let help = error.help();
        match error {
            RunError::World(world) => Failure::from(&**world),
            // Listed one by one, so that a new error must choose its exit code here.
            RunError::NotARun { .. }
            | RunError::Population { .. }
            | RunError::Exists { .. }
            | RunError::Differs { .. }
            | RunError::Conditional { .. }
            | RunError::Unfinished { .. }
            | RunError::OtherProgram(_)
            | RunError::OtherRisk { .. }
            | RunError::OtherPiece { .. }
            | RunError::NoRiskRequest { .. }
            | RunError::OtherWorld { .. }
            | RunError::NothingStored { .. } => {
                Failure::plain(Exit::Input, error.to_string(), help)
            }
            // These are states of the disk, which another command line would not mend.
            RunError::Io { .. } | RunError::Locked { .. } | RunError::Damaged { .. } => {
                Failure::plain(Exit::Fault, error.to_string(), help)
            }
        }
    }
}

#[cfg(feature = "drive")]
impl From<DriveError> for Failure {
    fn from(error: DriveError) -> Failure {
        let help = error.help();
        match error {
            DriveError::Ego(error) => Failure::from(&error),
            DriveError::Kept(error) => Failure::from(&error),
            // A socket and the system's random numbers are no mistake of the user.
            DriveError::Server { .. } | DriveError::Random(_) => {
                Failure::fault(error.to_string(), help)
            }
            _ => Failure::input(error.to_string(), help.unwrap_or_default()),
        }
    }
}

impl From<&EgoError> for Failure {
    fn from(error: &EgoError) -> Failure {
        match error {
            EgoError::NotAllowed { who, command } => not_allowed(who, command),
            // A wrapped error of a file keeps its place in the text.
            EgoError::World(error) => error.into(),
            _ => Failure::plain(Exit::Input, error.to_string(), error.help()),
        }
    }
}

impl From<&AdversaryError> for Failure {
    fn from(error: &AdversaryError) -> Failure {
        match error {
            AdversaryError::Run(error) => error.into(),
            AdversaryError::Indistinct(_) => Failure::fault(error.to_string(), None),
            _ => Failure::plain(
                Exit::Input,
                error.to_string(),
                error.help().map(str::to_owned),
            ),
        }
    }
}

impl From<&CampaignError> for Failure {
    fn from(error: &CampaignError) -> Failure {
        match error {
            CampaignError::Faults { complaint, .. } => complaint.into(),
            CampaignError::Ego(error) => error.into(),
            CampaignError::Search(error) => error.into(),
            CampaignError::Sweep(error) => error.into(),
            CampaignError::World(error) => error.into(),
            CampaignError::Run(error) => error.into(),
            CampaignError::Session(error) => error.into(),
            CampaignError::Config(error) => error.into(),
            CampaignError::Fault(what) => Failure::fault(what, None),
            _ => Failure::plain(Exit::Input, error.to_string(), error.help()),
        }
    }
}

impl From<&TheoremsError> for Failure {
    fn from(error: &TheoremsError) -> Failure {
        let help = match error {
            TheoremsError::Stochastic { .. } => {
                "leave out `--theorems`; for such an ego count successes over fresh noise seeds"
            }
            TheoremsError::NotEveryViolation { .. } => {
                "leave out `--theorems`; `eval --ego all` says what carries over to which ego"
            }
            TheoremsError::NoCounterexample { .. } => "train longer, or evaluate more starts",
            TheoremsError::NothingChanged { .. } => {
                "name changed egos under `reuse`, or give one with `--ego FILE.ron`"
            }
            TheoremsError::NotSolved { .. } => {
                "write rules as `always`, `eventually` or `until` of comparisons, list the starts, or leave out `--theorems`"
            }
        };
        Failure::input(error.to_string(), help)
    }
}

impl From<&KeptError> for Failure {
    fn from(error: &KeptError) -> Failure {
        match error {
            KeptError::Run(error) => Failure::from(error),
            KeptError::World { source, .. } => Failure::from(&**source),
            KeptError::Version { .. } => {
                Failure::input(error.to_string(), "replay it with the version that kept it")
            }
            KeptError::Format { .. } | KeptError::Change { .. } => Failure::input(
                error.to_string(),
                "kept counterexamples are written by `brakecheck eval RUN --keep DIR`",
            ),
        }
    }
}

impl From<&RegressionError> for Failure {
    fn from(error: &RegressionError) -> Failure {
        match error {
            RegressionError::Kept(error) => Failure::from(error),
            RegressionError::NoSuchEgo { name, known, .. } => {
                let egos = std::iter::once("nominal").chain(known.iter().map(String::as_str));
                Failure::input(error.to_string(), unknown_ego_help(name, egos))
            }
            RegressionError::Change(change) => {
                Failure::plain(Exit::Input, change.to_string(), change.help.clone())
            }
            RegressionError::NotAllowed { path, command } => {
                let who = format!("the ego in `{}`", path.display());
                not_allowed(&who, command)
            }
            // A changed record has an exit code of its own, since neither ego nor input
            // is wrong.
            RegressionError::Differ { .. } => Failure::plain(
                Exit::NotIdentical,
                error.to_string(),
                Some(
                    "ask the version that kept them (`brakecheck replay FILE --expect recorded` \
                     names the first sample that differs), or keep them anew with this one"
                        .to_owned(),
                ),
            ),
            RegressionError::StillFails { .. } => Failure::plain(
                Exit::Counterexample,
                error.to_string(),
                Some(
                    "look at one with `brakecheck view FILE -o crash.svg`, correct the ego, and \
                     run the test again"
                        .to_owned(),
                ),
            ),
            // An open question is no pass, and no counterexample either.
            RegressionError::NoAnswer { .. } => Failure::fault(
                error.to_string(),
                Some(
                    "the recorded actions do not apply to this ego: evaluate it with an ado that \
                     reacts (`brakecheck eval` or `search`), or keep crashes of it anew"
                        .to_owned(),
                ),
            ),
            RegressionError::Invalid { .. } => Failure::fault(
                error.to_string(),
                Some(
                    "correct the ego, or allow a share of such replays with \
                     `Regressions::allow_invalid` (`--allow-invalid SHARE`)"
                        .to_owned(),
                ),
            ),
        }
    }
}

impl From<Vec<NotExported>> for Failure {
    fn from(refused: Vec<NotExported>) -> Failure {
        let cures: Vec<_> = refused.iter().map(|one| cure(&one.why)).collect();
        // Of several the least counts: 2 before 3 before 4.
        let exits = cures.iter().map(|(exit, _)| *exit);
        let exit = exits.min_by_key(|exit| *exit as u8);
        let notes = refused
            .iter()
            .zip(cures)
            .map(|(one, (_, help))| Note::new(&one.to_string(), Some(help)));
        // No caller refuses an empty list, so the default is never taken.
        Failure::of(exit.unwrap_or(Exit::Input), notes.collect())
    }
}

/// Returns the exit code and the help of a refused export.
fn cure(why: &ExportRefusal) -> (Exit, &'static str) {
    match why {
        ExportRefusal::Grid { .. } => (
            Exit::Input,
            "name counterexamples of driving worlds; `brakecheck view` shows those of grids",
        ),
        ExportRefusal::OpenX(OpenXError::NoMotion) => (
            Exit::Input,
            "such a start fails by itself: begin with more room between the two",
        ),
        ExportRefusal::OpenX(OpenXError::ChangingWeather { .. }) => (
            Exit::Input,
            "name counterexamples of worlds without `Weather`; `brakecheck view` shows this one",
        ),
        ExportRefusal::OpenX(OpenXError::BanksOrWind { .. }) => (
            Exit::Input,
            "name counterexamples of worlds without `banks` and `wind`; `brakecheck view` shows this one",
        ),
        // Text in memory can always be written, so the program itself is wrong.
        ExportRefusal::OpenX(OpenXError::Xml(_)) => (Exit::Fault, "please report it"),
        ExportRefusal::Differs { .. } => (
            Exit::NotIdentical,
            "export it with the version that kept it, or search and keep it anew with this one",
        ),
        ExportRefusal::Fault(_) => (
            Exit::Fault,
            "the others are simulated beyond the contact, where this ego does not run: mend it",
        ),
    }
}

impl From<&TrainError> for Failure {
    fn from(error: &TrainError) -> Failure {
        match error {
            TrainError::Run(error) => Failure::from(error),
            TrainError::Bundle(_) => Failure::input(
                error.to_string(),
                "the run was made with another world or learner: train anew",
            ),
            TrainError::Faults {
                decisions,
                complaint,
            } => {
                let mut failure = Failure::from(complaint);
                // The kept decisions matter most, so they precede the reason.
                if let Some(note) = failure.notes.first_mut() {
                    note.what = format!(
                        "training ended after {decisions} decisions, which are kept: {}",
                        note.what
                    );
                }
                failure
            }
        }
    }
}

impl From<&Complaint> for Failure {
    fn from(complaint: &Complaint) -> Failure {
        let mut help = String::new();
        // Otherwise a reader would take the few episodes for all.
        if complaint.given_up {
            help.push_str("it was given up before the end; ");
        }
        if let Some(fault) = complaint
            .faults
            .iter()
            .find(|fault| !fault.stderr.is_empty())
        {
            help.push_str(&format!("its stderr ends:\n{}\n", fault.stderr));
        }
        help.push_str(
            "mend the ego (`brakecheck check -- COMMAND` tries a program against the protocol)",
        );
        // No share of faults makes the rows of such an ego results.
        if complaint.unrepeatable.is_empty() {
            help.push_str(", or allow a share of such episodes with `--allow-invalid SHARE`");
        }
        Failure::fault(complaint.to_string(), Some(help))
    }
}

/// Converts an error that is a wrong input, or wraps errors that convert themselves.
///
/// A wrapped error keeps its exit code and its place.
macro_rules! from_input {
    ($($error:ident: $($wrapped:ident),*;)*) => {
        $(impl From<&$error> for Failure {
            fn from(error: &$error) -> Failure {
                match error {
                    $($error::$wrapped(error) => error.into(),)*
                    _ => Failure::plain(Exit::Input, error.to_string(), error.help()),
                }
            }
        })*
    };
}

from_input! {
    FindError: Ego, Change, Kept;
    BankError: Run, Kept;
    SessionError: Ego, Run, Train, Config, Kept, Bank, Declared, Traffic;
    PopulationError: Session, Run, Ego;
    EvaluationError: Ego, Adversary, Search, Theorems, Train, Kept, Run;
    LeagueError: Session, Train, Run, Ego;
}

/// Converts an error that is a wrong input and always has a help.
macro_rules! from_helped {
    ($($error:ty),* $(,)?) => {
        $(impl From<&$error> for Failure {
            fn from(error: &$error) -> Failure {
                Failure::input(error.to_string(), error.help())
            }
        })*
    };
}

from_helped!(SearchError, SweepError, UnknownViewKind, PictureError);

/// Implements the conversion of an owned error.
macro_rules! from_owned {
    ($($error:ty),* $(,)?) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Failure {
                Failure::from(&error)
            }
        })*
    };
}

// `?` passes errors by value, while the conversions above only read them.
from_owned!(
    AdversaryError,
    CampaignError,
    Complaint,
    ConfigError,
    EgoError,
    EvaluationError,
    FindError,
    KeptError,
    LeagueError,
    LoadError,
    PictureError,
    PopulationError,
    RegressionError,
    RunError,
    ScenarioError,
    SearchError,
    SessionError,
    SweepError,
    TheoremsError,
    TrainError,
    UnknownViewKind,
);

/// Error of a test, which prints as on the command line: with its place and its help.
///
/// `?` converts every error of the library into it.
///
/// ```
/// fn test() -> Result<(), brakecheck::ErrorReport> {
///     brakecheck::world::Scenario::find("acc".as_ref())?;
///     Ok(())
/// }
/// # test().unwrap();
/// ```
pub struct ErrorReport(Failure);

impl<E: Into<Failure>> From<E> for ErrorReport {
    fn from(error: E) -> ErrorReport {
        ErrorReport(error.into())
    }
}

// Rust prints the error of a test by `Debug`, so the report is written there.
impl fmt::Debug for ErrorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.0.render(plain_theme(), message_columns());
        write!(f, "\n{}", text.trim_end())
    }
}
