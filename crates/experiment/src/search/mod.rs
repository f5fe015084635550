//! Open-loop search per start, and the experiment over ados and searches.
//!
//! A search shows which starts an adversary can solve at all, and provides the baselines
//! that a reusable ado must beat.

mod adversary_player;
mod cell;
mod cem;
mod confirm;
#[cfg(test)]
mod example_search;
mod experiment;
mod found;
mod guided;
mod hold;
mod joint_actions;
mod list;
mod method;
mod mutate;
mod random;
mod request;
mod run_tree;
mod switches;
mod tree;
mod trials;
mod uniform;

pub use adversary_player::{Adversary, BASELINES, BestConstant, BestSwitch, PlayerParts, Search};
pub use cell::{ExperimentCell, StartResult};
pub use experiment::Experiment;
pub use found::SearchResult;
pub use joint_actions::{AdoPlayer, JointActions};
pub use list::{Cem, Guided, Hold, Method, Mutate, Switches, Uniform};
pub use method::{
    BUDGET, GUIDED_BUDGET, GuidingPolicy, MOST_SWITCHES, MethodInfo, MethodOption, MethodSettings,
    SWITCHES, SWITCHES_OF_PROGRAMS, SearchError, usual_switches,
};
pub use mutate::mutate;
pub use request::SearchRequest;

use crate::adversary::{
    RecordedFailure, RecordedSuccess, blank_row, count_solved, groups, naturalness, note_row,
    success_caption,
};
use crate::experiment::Watch;
use crate::run_dir::{
    AdversaryId, Anytime, ClosingSpeed, ContactSeverity, Row, SuccessContacts, Unconfirmed,
};
use crate::severity::Impact;
use crate::stats::{StartOutcome, wilson};
use crate::testbench::{NoisyStart, Testbench, count_faults};
use crate::world::Scenario;
use method::StartSearch;
pub use tree::{Tree, WalkControl};

/// Row of a search and the solutions behind it.
#[derive(Clone, Debug)]
pub struct Searched {
    /// Rates and costs over all starts.
    pub row: Row,
    /// Result per start. `None`: trivial or not reached.
    pub found: Vec<Option<SearchResult>>,
}

impl Searched {
    /// Returns the row of `request` as if the search had stopped at a smaller budget.
    ///
    /// Physics steps and time are in proportion to the simulations. The share of broken
    /// rules is NaN if a start had more simulations.
    pub fn row_within(&self, request: &SearchRequest<'_>, budget: u64) -> Row {
        let results = self.found.iter().map(Option::as_ref);
        let found: Vec<Option<SearchResult>> = results
            .map(|found| found.map(|found| found.cut(budget)))
            .collect();
        let mut row = SearchRequest { budget, ..*request }.row(&found);
        if found != self.found {
            // No record shows which of the simulations broke a rule.
            row.foul_rate = f64::NAN;
        }
        row
    }
}

/// Searches every start until its first success.
pub fn search(request: &SearchRequest<'_>, watch: &Watch<'_>) -> Searched {
    watch.phase(&format!("searching {}", request.ego));
    let searcher = || Searcher::new(request);
    let found = request
        .starts
        .each(watch, searcher, |searcher, start, turn| {
            let from = NoisyStart::from(start);
            // A search that was stopped has no result, so its start is one that was not
            // reached.
            let mut found = searcher.solve(from, turn.index, watch)?;
            found.cpu_s = turn.cpu_s();
            // A program would have to play the episode again.
            let can_replay = request.scenario.program().is_none();
            if let Some(actions) = found.actions.as_ref().filter(|_| can_replay) {
                let id = request.method.adversary();
                let caption = || success_caption(request.ego, &id, turn.index);
                let found = RecordedSuccess::of_actions(actions.clone());
                let again = || found.play(request.scenario, &mut searcher.bench, from);
                watch.show_success(request.scenario, &caption, again);
            }
            Some(found)
        });
    let row = request.row(&found);
    note_row(watch, &row);
    Searched { row, found }
}

/// Returns the result of the searches with a smaller budget.
///
/// A start with a fault and without a solution within the budget is in no number.
pub fn anytime(found: &[Option<SearchResult>], budget: u64) -> Anytime {
    let searched = found.iter().flatten().map(|found| found.within(budget));
    let (mut starts, mut successes, mut simulations) = (0, 0, 0);
    for (spent, outcome) in searched.filter(|(_, outcome)| *outcome != StartOutcome::Invalid) {
        starts += 1;
        successes += usize::from(outcome == StartOutcome::Solved);
        simulations += spent;
    }
    // Without starts the rates are 0 instead of NaN.
    let per_start = |sum: f64| sum / starts.max(1) as f64;
    Anytime {
        budget,
        successes,
        success_rate: per_start(successes as f64),
        ci95: wilson(successes, starts),
        sims_per_start: per_start(simulations as f64),
    }
}

impl SearchRequest<'_> {
    /// Returns the world that pre-screens sequences, if any.
    fn screening(&self) -> Option<Scenario> {
        let prescreens = self.method.info().prescreens;
        prescreens.then(|| self.scenario.screening()).flatten()
    }

    /// Returns whether another plant pre-screens sequences.
    fn prescreens(&self) -> bool {
        self.screening().is_some()
    }

    /// Returns the budgets in rows: 10, 30, 100, 300 … and the whole budget.
    fn checkpoints(&self) -> Vec<u64> {
        if !self.method.info().takes(MethodOption::Budget) {
            return Vec::new();
        }
        // `checked_pow` ends the decades before they overflow.
        let decades = (1..).map_while(|power| 10u64.checked_pow(power));
        let steps = decades.flat_map(|decade| [decade, decade.saturating_mul(3)]);
        // The first run of a trained policy is its greedy one, which is worth a number.
        let first = (self.method.adversary() == AdversaryId::Guided).then_some(1);
        let budgets = first.into_iter().chain(steps);
        let mut budgets: Vec<u64> = budgets.take_while(|&budget| budget < self.budget).collect();
        // Steps end below the budget, so that it is listed once.
        budgets.push(self.budget);
        budgets
    }

    fn row(&self, found: &[Option<SearchResult>]) -> Row {
        let id = self.method.adversary();
        let mut row = blank_row(self.scenario, self.ego, id, self.starts);
        let searched = found.iter().flatten();
        row.unconfirmed = self.prescreens().then(|| Unconfirmed {
            sequences: searched.clone().map(|found| found.unconfirmed).sum(),
            starts: searched
                .clone()
                // A start with a confirmed sequence is solved, whatever else did not
                // carry over.
                .filter(|found| found.unconfirmed > 0 && found.actions.is_none())
                .count(),
        });
        row.method = self.method.text(self.budget, row.unconfirmed);
        let marks = found.iter().zip(&self.starts.trivial);
        row.solved = marks
            .map(|(found, trivial)| match (found, trivial) {
                // A trivial start counts as such, whatever the search found there.
                (_, true) => StartOutcome::Trivial,
                (Some(found), _) if found.is_invalid() => StartOutcome::Invalid,
                (Some(found), _) if found.actions.is_some() => StartOutcome::Solved,
                (Some(_), _) => StartOutcome::Unsolved,
                (None, _) => StartOutcome::NotReached,
            })
            .collect();
        count_solved(&mut row);
        let invalid = found.iter().enumerate().filter_map(|(start, found)| {
            let found = found.as_ref().filter(|found| found.is_invalid())?;
            Some((start as u64, found.fault.as_ref()?))
        });
        row.faults = count_faults(invalid);
        // Invalid starts count in no rate, but their cost below is real.
        let valid = searched.clone().filter(|found| !found.is_invalid());
        let simulations: u64 = valid.clone().map(|found| found.simulations).sum();
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        let violations: u64 = valid.map(|found| found.violations).sum();
        row.foul_rate = violations as f64 / simulations.max(1) as f64;
        let most = searched.clone().map(|found| found.simulations).max();
        row.max_sims_per_start = most;
        row.physics_steps = searched.clone().map(|found| found.physics_steps).sum();
        // `sum` of nothing is -0.0, which would be printed with its sign.
        row.cpu_s = searched.clone().fold(0.0, |sum, found| sum + found.cpu_s);
        count_contacts(&mut row, searched.clone());
        let failures: Vec<_> = searched.map(|found| found.failure.as_ref()).collect();
        row.naturalness = naturalness(self.scenario, &failures);
        // Rates at smaller budgets need all starts as well.
        if row.partial.is_none() {
            let budgets = self.checkpoints().into_iter();
            row.anytime = budgets.map(|budget| anytime(found, budget)).collect();
        }
        row
    }
}

/// Fills in the contact statistics of a row with counted starts.
pub(crate) fn count_contacts<'a>(
    row: &mut Row,
    found: impl Iterator<Item = &'a SearchResult> + Clone,
) {
    let starts = row.starts.max(1) as f64;
    let share = |part: usize| part as f64 / starts;
    let late_violations = found.clone().filter(|found| found.violation_before_contact);
    let contacts: Vec<f64> = found.clone().filter_map(|f| f.closing_speed_mps).collect();
    row.foul_before_contact_rate = Some(share(late_violations.count()));
    row.contact_rate = share(contacts.len());
    row.closing_speed_mps = ClosingSpeed::of(contacts);
    // A search keeps only contacts after a success, so both numbers are of the same ones.
    row.success_closing_mps = row.closing_speed_mps;
    let touching = found.clone().filter(|it| it.closing_speed_mps.is_some());
    row.success_contacts =
        (row.successes > 0).then(|| SuccessContacts::counted(touching.map(|found| found.impact)));
    let solved = found.clone().filter(|found| found.actions.is_some());
    let failures: Vec<Option<&RecordedFailure>> =
        solved.map(|found| found.failure.as_ref()).collect();
    row.distinct = groups(&failures);
    let impacts: Vec<Impact> = found.filter_map(|f| f.impact).collect();
    // Contacts without part of the ego have no impact and are left out.
    row.severity = ContactSeverity::of(&impacts);
}

/// Searcher of one worker: the requested bench and a cheap bench for pre-screening.
struct Searcher<'a> {
    request: &'a SearchRequest<'a>,
    cheap: Option<Scenario>,
    bench: Testbench,
}

impl<'a> Searcher<'a> {
    fn new(request: &'a SearchRequest<'a>) -> Searcher<'a> {
        Searcher {
            request,
            cheap: request.screening(),
            bench: request.scenario.bench(),
        }
    }

    /// Searches one start. `None`: stopped from outside before a result.
    fn solve(
        &mut self,
        from: NoisyStart<'_>,
        index: usize,
        watch: &Watch<'_>,
    ) -> Option<SearchResult> {
        let NoisyStart { start, noise } = from;
        let request = self.request;
        request.method.solve(StartSearch {
            scenario: request.scenario,
            cheap: self.cheap.as_ref(),
            bench: &mut self.bench,
            start,
            noise,
            index,
            budget: request.budget,
            watch,
        })
    }
}
