//! Campaigns that cannot be planned, run or merged.

use std::path::PathBuf;

use crate::evaluation::SweepError;
use crate::experiment::EgoError;
use crate::rl::ConfigError;
use crate::ron_file::LoadError;
use crate::run_dir::{RunError, counted};
use crate::search::SearchError;
use crate::testbench::Complaint;
use crate::training::SessionError;

/// A campaign could not be planned, run or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The campaign file cannot be read.
    #[error("{0}")]
    NoFile(LoadError),
    /// A directory without a plan.
    #[error("`{}` holds no planned campaign", dir.display())]
    NoPlan {
        /// The directory.
        dir: PathBuf,
    },
    /// A further directory of a merge without pieces.
    #[error("`{}` holds no pieces of a campaign", dir.display())]
    NoPieces {
        /// The directory.
        dir: PathBuf,
    },
    /// A directory with another plan.
    #[error("`{}` holds another plan", dir.display())]
    OtherPlan {
        /// The directory.
        dir: PathBuf,
    },
    /// A plan of another version of the program.
    #[error("`{}` was planned by brakecheck {planned}, and this is {version}", dir.display(), version = env!("CARGO_PKG_VERSION"))]
    OtherVersion {
        /// The directory.
        dir: PathBuf,
        /// The version that planned it.
        planned: String,
    },
    /// A number that no piece has.
    #[error("the campaign has no piece {number}")]
    NoPiece {
        /// Number asked for.
        number: usize,
        /// Pieces of the campaign.
        pieces: usize,
    },
    /// A piece whose training is not finished.
    #[error("this piece needs the training of piece {training}: {error}")]
    Untrained {
        /// Number of the piece that trains.
        training: usize,
        /// State of its run directory.
        error: RunError,
    },
    /// The merge was stopped.
    #[error("interrupted: nothing was merged")]
    Interrupted,
    /// Files among the pieces that are none of this campaign.
    #[error("no piece of this campaign: {files}")]
    Strangers {
        /// The first of them, listed.
        files: String,
    },
    /// Pieces that are missing, damaged, foreign or there twice.
    #[error("{wrong} of {} cannot be merged:\n{listed}", counted(*.pieces, "piece"))]
    Unmergeable {
        /// Number of such pieces.
        wrong: usize,
        /// Pieces of the campaign.
        pieces: usize,
        /// The first of them, each with its reason.
        listed: String,
        /// True if some are there and wrong.
        some_are_wrong: bool,
    },
    /// More episodes of a piece are invalid than allowed: it was not kept.
    #[error("{complaint}")]
    Faults {
        /// The number of the piece; `None`: the pilot, in which an ego never ran.
        piece: Option<usize>,
        /// Work that failed.
        complaint: Complaint,
    },
    /// The ego cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// A search that does not fit.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// A sweep that is none.
    #[error(transparent)]
    Sweep(#[from] SweepError),
    /// A world or a campaign file with mistakes, each at its place.
    #[error(transparent)]
    World(#[from] LoadError),
    /// A run directory or the directory of the plan cannot be read or written.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A training of the campaign could not begin or go on.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// Settings of a learner out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A fault of this program.
    #[error("{0}")]
    Fault(String),
}

impl CampaignError {
    /// The fix; `None`: the error has another form than a sentence and its fix.
    pub fn help(&self) -> Option<String> {
        let help = match self {
            CampaignError::NoFile(_) => {
                "name a campaign file, such as examples/campaigns/r157_cut_in.ron"
            }
            CampaignError::NoPlan { .. } => {
                "plan one: `brakecheck campaign plan CAMPAIGN.ron -o DIR`"
            }
            CampaignError::NoPieces { .. } => {
                "name a copy of the plan's directory, in which pieces were run"
            }
            CampaignError::OtherPlan { .. } => {
                "go on with that one (`brakecheck campaign run DIR`), or name another directory \
                 with `-o`"
            }
            CampaignError::OtherVersion { .. } => {
                "run it with that version, or plan it again in another directory"
            }
            CampaignError::NoPiece { pieces, .. } => {
                return Some(format!("its {} count from 0", counted(*pieces, "piece")));
            }
            CampaignError::Untrained { training, .. } => {
                return Some(format!(
                    "run `brakecheck campaign run DIR --piece {training}` first"
                ));
            }
            CampaignError::Interrupted => "run the same command again",
            CampaignError::Strangers { .. } => {
                "take these files away: they are no pieces of this plan"
            }
            CampaignError::Unmergeable { some_are_wrong, .. } if *some_are_wrong => {
                "remove those that are damaged or foreign and run them again: \
                 `brakecheck campaign run DIR` makes what is not there or not right"
            }
            CampaignError::Unmergeable { .. } => "run them: `brakecheck campaign run DIR`",
            CampaignError::Ego(error) => return error.help(),
            CampaignError::Search(error) => return Some(error.help()),
            CampaignError::Sweep(error) => return Some(error.help().to_owned()),
            CampaignError::Session(error) => return error.help(),
            CampaignError::Faults { .. }
            | CampaignError::World(_)
            | CampaignError::Run(_)
            | CampaignError::Config(_)
            | CampaignError::Fault(_) => return None,
        };
        Some(help.to_owned())
    }
}
