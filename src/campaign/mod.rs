//! Campaigns as functions: train, evaluate, search, replay.
//!
//! Everything here runs in parallel per episode and gives the same rows for any
//! number of threads: starts, noise and actors are pure functions of their keys.

mod adapt;
mod against;
mod behaviours;
mod break_even;
mod case_studies;
mod entropy;
mod eval;
mod extreme;
mod heuristic;
mod identify;
mod keep;
mod milestones;
mod near;
mod paper_rows;
mod repeatable;
mod replay;
mod replays;
mod retrained;
mod reuse;
mod reuse_study;
mod search;
mod starts;
mod table1;
mod telling;
mod theorems;
mod train;
mod tries;

pub use adapt::{
    AdaptRequest, Adapted, ENOUGH_SIMULATIONS, LEAST_SIMULATIONS, MOST_SIMULATIONS, adapt,
};
pub use behaviours::{
    FigureError, Shown, start_with, three_merges, two_at_the_light, two_behaviours,
};
pub use break_even::{BreakEven, Cost, PerStart, break_even};
pub use case_studies::{CaseStudies, CaseStudy, case_studies_markdown, case_study, trained_run};
pub use eval::{Ado, EvalRequest, Evaluated, Outcome, best_constant, eval, explain_first};
pub use extreme::extreme;
pub use heuristic::{Heuristic, tune_heuristic};
pub use identify::{Identified, IdentifyError, IdentifyRequest, identify, is_telling};
pub use keep::{keep, keep_played};
pub use milestones::{Milestone, milestones};
pub use near::{Alumnus, NearFailing, NearRow, near_starts, near_starts_markdown};
pub use paper_rows::{Measured, PaperRow, Reached, measure_paper_row, paper_rows_markdown};
pub use repeatable::answers_differ;
pub use replay::{Difference, Kept, RegressionError, Regressions, Replayed, replay};
pub use retrained::retrained;
pub use reuse::{LEAST_REACHABLE, Relation, ReusedOn, Summary, reused_on, summarise};
pub use reuse_study::{
    ADAPTED, CONDITIONAL, CONDITIONAL_TRIES, Economy, Known, Met, ReuseAsked, ReuseError,
    ReuseStudied, ReuseStudy, reuse_markdown,
};
pub use search::{Cem, Found, Method, SearchRequest, Searched, anytime, search};
pub use starts::{TestStarts, test_starts};
pub use table1::{
    DeltaNear, GridStudy, MapResult, NearStarts, OpenLoop, RandomAdos, Table1, Table1Error,
    Trained as TrainedShare, table1, table1_markdown,
};
pub use telling::{Telling, telling};
pub use theorems::{
    CarriedOver, CarryOver, Distance, Forecast, NearbyStarts, Refused, Sharper, Spread,
    TheoremsError, TheoremsRequest, Witness, carry_over, nearby_starts, optimal_values,
};
pub use train::{TrainError, Trained, train};
pub use tries::{Tried, Tries, other_members};

use std::sync::atomic::{AtomicBool, Ordering};

use crate::scene::Start;
use crate::testbench::{Actor, Aftermath, Episode, FaultLog, Testbench, play};

/// How a campaign reports and is asked to stop; it never changes a result.
pub struct Watch<'a> {
    /// Called when `done` of `total` units of work are finished, from any thread.
    pub progress: &'a (dyn Fn(u64, u64) + Sync),
    /// Set from outside to stop early; what was computed is kept.
    pub stop: &'a AtomicBool,
    /// Is told of every episode, and gives up on an ego that does not run.
    pub faults: FaultLog,
}

impl<'a> Watch<'a> {
    /// Reports to `progress` and stops when `stop` is set or the ego is given up.
    pub fn new(progress: &'a (dyn Fn(u64, u64) + Sync), stop: &'a AtomicBool) -> Watch<'a> {
        Watch {
            progress,
            stop,
            faults: FaultLog::default(),
        }
    }

    /// The same without progress: for work that is part of some other.
    pub fn quiet(&self) -> Watch<'a> {
        Watch {
            progress: &|_, _| {},
            stop: self.stop,
            faults: self.faults.clone(),
        }
    }

    /// Whether there is no point in going on: somebody asked to stop, or the
    /// ego does not run.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.faults.has_given_up()
    }

    /// Plays an episode and tells the log of faults about it.
    fn play(
        &self,
        bench: &mut Testbench,
        (start, noise): (&Start, u64),
        index: usize,
        actor: &mut dyn Actor,
        aftermath: Aftermath,
    ) -> Episode {
        let episode = play(bench, start, noise, actor, aftermath);
        self.faults.note(index as u64, episode.fault.as_ref());
        episode
    }
}
