//! Populations of ados: several runs in one directory, which differ on purpose.
//!
//! ```text
//! RUN/population.json   what made the population, its members, its hash; sealed
//! RUN/members/000       first member, an ordinary run directory
//! RUN/members/001       second member, and so on
//! RUN/archive-N.jsonl   worst failure of each cell after N members
//! RUN/coverage.jsonl    curve of the occupied cells
//! RUN/league.jsonl      rounds of a league, in place of an archive
//! RUN/lock              held while training
//! ```
//!
//! The manifest lists a member once its training is finished, with the SHA-256 of its
//! `manifest.json`. An interrupted population therefore keeps its finished members, and
//! the member that was being trained continues from its own checkpoint.

mod archive;
mod archive_search;
mod directory;
mod error;
mod evaluate;
mod league;
mod manifest;
mod train;

pub use archive::{ArchivedFailure, FailureArchive};
pub use archive_search::CoveragePoint;
pub use directory::PopulationDir;
pub use error::PopulationError;
pub use evaluate::{
    MemberResult, NextRuns, PopulationResults, PopulationTest, SearchCells, UnionResult,
};
pub use league::{
    LeagueError, LeagueRequest, LeagueResponse, LeagueRound, LeagueSession, train_league,
};
pub use manifest::{ArchiveSummary, PopulationManifest, PopulationMember, PopulationOrigin};
pub use train::{DistinctOutcome, DistinctRequest, DistinctSession, archive_of, train_distinct};
