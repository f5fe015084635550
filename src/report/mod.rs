//! Reports to read and to hand on: one HTML page, JUnit XML, figures as SVG.
//!
//! Pure functions of results: whoever calls them has played the episodes. The
//! page needs no network; its one script only moves pictures that are there
//! without it. Whatever a world file says is escaped.
//!
//! Architecture Invariant: plays no episode, trains nothing, touches no file.

mod animation;
mod campaign;
mod examples;
mod fault;
mod figures;
mod junit;
mod page;
mod plot;
mod points;
mod results;
mod reuse;
mod start_map;
mod verdict;
mod words;

use crate::rulebook::Verdict;
use crate::run_dir::{About, Manifest, Progress, Row};
use crate::scene::{Frame, Start};
use crate::testbench::{Episode, FaultCount};
use crate::world::Scenario;

pub use animation::{Beside, looping_picture};
pub use campaign::CampaignPage;
pub use figures::{Behaviour, Distances, SweptShare, figure_2, figure_3, figure_5, sweep_curve};
pub use points::{PointCase, PointsPage};
pub use start_map::{CellState, MapCell, StartMap};
pub(crate) use verdict::outcome_in_words;

/// Everything a report shows.
pub struct Report<'a> {
    /// The world, with the nominal ego, on the plant of the run.
    pub scenario: &'a Scenario,
    /// The run directory, as the reader should write it.
    pub run: String,
    /// What the run was.
    pub manifest: &'a Manifest,
    /// This run's training and that of others on the same world.
    pub trainings: Vec<Training>,
    /// The nominal ego on test starts; `None` while there is no policy.
    pub nominal: Option<Nominal>,
    /// All egos and ados that were evaluated.
    pub tested: Vec<Tested>,
    /// Where `tested` comes from, and over how many starts.
    pub about_tested: String,
    /// Simulations that ways to find failures cost.
    pub costs: Vec<TestingCost>,
    /// What the reader must know first, such as that training is unfinished.
    pub notes: Vec<String>,
    /// Faults of ego or physics, more than were allowed; empty if all is well.
    pub faults: Vec<FaultCount>,
    /// What makes the report again, command by command.
    pub commands: Vec<String>,
}

/// How one training went.
pub struct Training {
    /// Its run directory, as the reader should write it.
    pub run: String,
    /// What the run was.
    pub manifest: Manifest,
    /// One point per report of the learner.
    pub progress: Vec<Progress>,
    /// The closing evaluation; empty while training.
    pub closing: Vec<Row>,
}

/// The nominal ego and the trained ado on every test start.
pub struct Nominal {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Every start and what came of it; `None`: trivial, or not reached.
    pub starts: Vec<(Start, Option<Verdict>)>,
    /// Counterexamples that tell most, the worst first.
    pub telling: Vec<Example>,
}

/// A counterexample to look at.
pub struct Example {
    /// What it was chosen for, with the number.
    pub chosen_for: String,
    /// Its position among the test starts.
    pub start: usize,
    /// The episode, to contact or the horizon.
    pub episode: Episode,
    /// Where everybody is at each of its samples; empty: it is not shown moving.
    pub frames: Vec<Frame>,
    /// How severe it is, why it fails and whether it persists.
    pub about: About,
    /// Its road, its replay and the scenario for an ego of one's own, as links
    /// from the page; empty: they were not written.
    pub scenarios: Vec<String>,
}

/// One row, and why the ego fails where it does.
pub struct Tested {
    /// Rates and costs over all starts.
    pub row: Row,
    /// The first counterexample, explained.
    pub why: Option<String>,
}

/// What testing n new starts costs: `fixed` + n · `per_start` simulations.
pub struct TestingCost {
    /// The way to find failures.
    pub name: String,
    /// Simulations before the first start.
    pub fixed: f64,
    /// Simulations per start.
    pub per_start: f64,
    /// Share of the starts that it solves so.
    pub solves: f64,
    /// Whether that is as many as the trained ado solves; if not, equal success
    /// would cost it more, and the break-even is a bound.
    pub matched: bool,
    /// Share that it solves with so many simulations per start; may be empty.
    pub anytime: Vec<(f64, f64)>,
}

impl Report<'_> {
    /// The report as one HTML page.
    pub fn html(&self) -> String {
        page::html(self)
    }

    /// The report as JUnit XML: one test case per counterexample.
    pub fn junit(&self) -> String {
        junit::xml(self)
    }
}
