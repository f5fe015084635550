//! Reports: one HTML page, JUnit XML, and figures as SVG.
//!
//! All functions are pure functions of results, and the caller has played the
//! episodes. The page needs no network. Its single script animates pictures
//! that are visible without it. Text of world files is escaped.
//!
//! Architecture Invariant: this module plays no episode, trains no policy and
//! touches no file.

mod animation;
mod campaign;
mod canvas;
mod examples;
mod fault;
pub(crate) mod figures;
mod file_style;
mod junit;
mod page;
mod plot;
mod points;
mod recorded_rules;
mod results;
mod reuse;
mod start_map;
pub(crate) mod table;
mod verdict;
mod words;

use crate::rulebook::Verdict;
use crate::run_dir::{About, Manifest, Progress, Row};
use crate::scene::{Frame, Start};
use crate::testbench::{Episode, FaultCount, FilmAfterContact};
use crate::world::Scenario;

pub(crate) use animation::{Beside, looping_picture};
pub(crate) use campaign::CampaignPage;
pub(crate) use figures::sweep_curve;
pub(crate) use points::{PointCase, PointsPage};
pub(crate) use recorded_rules::recorded_rules_junit;
pub(crate) use start_map::{CellState, MapCell, StartMap};
pub(crate) use table::TextTable;
pub(crate) use verdict::outcome_in_words;

/// Content of a report.
pub struct Report<'a> {
    /// World with the nominal ego, on the plant of the run.
    pub(crate) scenario: &'a Scenario,
    /// Manifest of the run.
    pub(crate) manifest: &'a Manifest,
    /// Trainings of this run and of other runs on the same world.
    pub(crate) trainings: Vec<Training>,
    /// Nominal ego on test starts. `None` until a policy exists.
    pub(crate) nominal: Option<Nominal>,
    /// Evaluated egos and ados.
    pub(crate) tested: Vec<Tested>,
    /// Origin of `tested`, and its number of starts.
    pub(crate) about_tested: String,
    /// Simulations that methods of failure search cost.
    pub(crate) costs: Vec<TestingCost>,
    /// Notes to show first, such as unfinished training.
    pub(crate) notes: Vec<String>,
    /// Faults of ego or physics above the allowed number. Empty if all is well.
    pub(crate) faults: Vec<FaultCount>,
    /// Commands that reproduce the report.
    pub(crate) commands: Vec<String>,
}

/// Course of one training.
pub(crate) struct Training {
    /// Run directory as the reader should write it.
    pub(crate) run: String,
    /// Manifest of the run.
    pub(crate) manifest: Manifest,
    /// Progress, one point per report of the learner.
    pub(crate) progress: Vec<Progress>,
    /// Closing evaluation. Empty during training.
    pub(crate) closing: Vec<Row>,
}

/// Nominal ego and trained ado on every test start.
pub(crate) struct Nominal {
    /// Rates and costs over all starts.
    pub(crate) row: Row,
    /// Starts with their verdicts. `None` is trivial or not reached.
    pub(crate) starts: Vec<(Start, Option<Verdict>)>,
    /// Most informative counterexamples, the worst first.
    pub(crate) highlights: Vec<Example>,
}

/// Counterexample to show.
pub(crate) struct Example {
    /// Criterion of its selection, with the number.
    pub(crate) chosen_for: String,
    /// Position among the test starts.
    pub(crate) start: usize,
    /// Episode up to the contact or the horizon.
    pub(crate) episode: Episode,
    /// Places of all agents at each sample. Empty if it is not animated.
    pub(crate) frames: Vec<Frame>,
    /// Motion after the contact, in worlds that play it.
    pub(crate) after: Option<FilmAfterContact>,
    /// Severity, cause and persistence.
    pub(crate) about: About,
    /// Links to its road, its replay and its scenario for an external ego.
    ///
    /// Empty if these files were not written.
    pub(crate) scenarios: Vec<String>,
}

/// Row, with the explanation of the ego's failure.
pub(crate) struct Tested {
    /// Rates and costs over all starts.
    pub(crate) row: Row,
    /// Explanation of the first counterexample.
    pub(crate) why: Option<String>,
}

/// Cost of testing n new starts: `fixed` + n · `per_start` simulations.
pub(crate) struct TestingCost {
    /// Name of the method.
    pub(crate) name: String,
    /// Simulations before the first start.
    pub(crate) fixed: f64,
    /// Simulations per start.
    pub(crate) per_start: f64,
    /// Share of the starts that the method solves at this cost.
    pub(crate) solves: f64,
    /// True if the method solves as many starts as the trained ado.
    ///
    /// Otherwise equal success would cost more, and the break-even is a bound.
    pub(crate) matched: bool,
    /// Share solved with the given simulations per start. May be empty.
    pub(crate) anytime: Vec<(f64, f64)>,
}

impl Report<'_> {
    /// Returns the report as one HTML page.
    pub fn html(&self) -> String {
        page::html(self)
    }

    /// Returns the report as JUnit XML: one test case per counterexample.
    pub fn junit(&self) -> String {
        junit::xml(self)
    }
}
