//! Reports: one HTML page, JUnit XML, and figures as SVG.
//!
//! All functions are pure functions of results, and the caller has played the
//! episodes. The page needs no network. Its single script animates pictures
//! and looks up results that are visible without it. Text of world files is escaped.
//!
//! Architecture Invariant: this module plays no episode, trains no policy and
//! touches no file.

mod animation;
mod campaign;
mod canvas;
mod examples;
mod fault;
pub mod figures;
mod file_style;
mod junit;
mod junit_suite;
mod lookup;
mod page;
mod plot;
mod points;
mod recorded_rules;
mod result_page;
mod results;
mod reuse;
mod start_map;
pub mod table;
mod verdict;
mod words;

use crate::rulebook::Verdict;
use crate::run_dir::{About, Manifest, Progress, Row, Swept};
use crate::scene::{Frame, Start};
use crate::stats::StartOutcome;
use crate::testbench::{Episode, FaultCount, FilmAfterContact};
use crate::world::Scenario;

pub use animation::{Beside, HOLD_S, LoopingPicture, looping_picture, running_picture};
pub use campaign::CampaignPage;
pub use figures::sweep_curve;
pub use junit::RowCases;
pub use junit_suite::{TestCase, TestMessage, TestOutcome, TestSuite, junit};
pub use points::{PointCase, PointsPage, VariedCase};
pub use recorded_rules::recorded_rules_junit;
pub use result_page::{PageEpisode, ResultPage, ResultTable};
pub use start_map::{CellState, MapCell, StartMap};
pub use table::{TextTable, known_if};
pub use verdict::outcome_in_words;

/// Content of a report.
pub struct Report<'a> {
    /// World with the ego of the page, on the plant of the run.
    pub scenario: &'a Scenario,
    /// Name of that ego. `None`: the world's own ego.
    pub ego: Option<String>,
    /// Manifest of the run.
    pub manifest: &'a Manifest,
    /// Trainings of this run and of other runs on the same world.
    pub trainings: Vec<Training>,
    /// Ego of the page on test starts. `None` until a policy exists.
    pub nominal: Option<Nominal>,
    /// Evaluated egos and ados.
    pub tested: Vec<Tested>,
    /// Origin of `tested`, and its number of starts.
    pub about_tested: String,
    /// Failing starts over parameters of the ego. Empty without a sweep.
    pub sweeps: Vec<Swept>,
    /// Simulations that methods of failure search cost.
    pub costs: Vec<TestingCost>,
    /// Coverage of the specification, the rules and the starts. `None` without a policy.
    pub coverage: Option<CoverageSection>,
    /// Notes to show first, such as unfinished training.
    pub notes: Vec<String>,
    /// Faults of ego or physics above the allowed number. Empty if all is well.
    pub faults: Vec<FaultCount>,
    /// Commands that reproduce the report.
    pub commands: Vec<String>,
}

/// Coverage as a page shows it.
pub struct CoverageSection {
    /// Verdict, a sentence per line.
    pub verdict: Vec<String>,
    /// Gaps first.
    pub table: TextTable,
}

/// Course of one training.
pub struct Training {
    /// Run directory as the reader should write it.
    pub run: String,
    /// Manifest of the run.
    pub manifest: Manifest,
    /// Progress, one point per report of the learner.
    pub progress: Vec<Progress>,
    /// Closing evaluation. Empty during training.
    pub closing: Vec<Row>,
}

/// Ego of the page and trained ado on every test start.
pub struct Nominal {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Starts with their verdicts. `None` is trivial or not reached.
    pub starts: Vec<(Start, Option<Verdict>)>,
    /// Most informative counterexamples, the worst first.
    pub highlights: Vec<Example>,
}

/// Counterexample to show.
pub struct Example {
    /// Criterion of its selection, with the number.
    pub chosen_for: String,
    /// Position among the test starts. `None`: a kept file.
    pub start: Option<usize>,
    /// Episode up to the contact or the horizon.
    pub episode: Episode,
    /// Places of all agents at each sample. Empty if it is not animated.
    pub frames: Vec<Frame>,
    /// Motion after the contact, in worlds that play it.
    pub after: Option<FilmAfterContact>,
    /// Severity, cause and persistence.
    pub about: About,
    /// Links to its road, its replay and its scenario for an external ego.
    ///
    /// Empty if these files were not written.
    pub scenarios: Vec<String>,
}

/// Row, with the explanation of the ego's failure.
pub struct Tested {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Explanation of the first counterexample.
    pub why: Option<String>,
    /// Outcome per start. `None` if only the marks of the row are known.
    pub outcomes: Option<Vec<StartOutcome>>,
}

impl Tested {
    /// Returns true for a trained ado or a search, and false for a baseline.
    pub fn is_adversary(&self) -> bool {
        self.row.train_seed.is_some() || self.row.ado.is_search()
    }
}

/// Cost of testing n new starts: `fixed` + n · `per_start` simulations.
pub struct TestingCost {
    /// Name of the method.
    pub name: String,
    /// Simulations before the first start.
    pub fixed: f64,
    /// Simulations per start.
    pub per_start: f64,
    /// Share of the starts that the method solves at this cost.
    pub solves: f64,
    /// True if the method solves as many starts as the trained ado.
    ///
    /// Otherwise equal success would cost more, and the break-even is a bound.
    pub matched: bool,
    /// Share solved with the given simulations per start. May be empty.
    pub anytime: Vec<(f64, f64)>,
}

impl Report<'_> {
    /// Returns the report as one HTML page.
    pub fn html(&self) -> String {
        page::html(self)
    }

    /// Returns the report as JUnit XML: one test case per start.
    pub fn junit(&self) -> String {
        junit::xml(self)
    }
}
