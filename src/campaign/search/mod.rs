//! Open-loop search per start: what an adversary can do at all, and the
//! baselines a reusable ado must beat.

mod cem;
mod mutate;
mod random;
mod switches;
mod trials;

use std::sync::atomic::{AtomicU64, Ordering};

use cpu_time::ThreadTime;
use rayon::prelude::*;

pub use cem::Cem;

use super::TestStarts;
use super::Watch;
use super::eval::{HOLD_DECISIONS, blank_row, count_solved, note_row};
use crate::ego::Fault;
use crate::run::{Anytime, ClosingSpeed, Row, StartOutcome, Stored, Unconfirmed, wilson};
use crate::scenario::Scenario;
use crate::scene::{Dynamics, Start};
use crate::sim::PlantKind;
use crate::testbench::{Testbench, count_faults};
use trials::Trials;

/// Most switches of action in the sequences of [`Method::Switches`], unless told
/// otherwise; what it then solves is what rows call reachable.
pub const SWITCHES: usize = 2;

/// How sequences of actions are chosen.
#[derive(Clone, Copy, Debug)]
pub enum Method<'a> {
    /// A uniformly random action at each decision.
    Uniform,
    /// A uniformly random action, held for five decisions.
    Hold,
    /// The cross-entropy method with the rulebook's reward as fitness.
    Cem(Cem),
    /// Mutations of the nearest counterexamples of a training.
    Mutate(&'a Stored),
    /// All sequences with at most so many switches of action, fewest first.
    Switches(usize),
}

/// What to search.
#[derive(Clone, Copy)]
pub struct SearchRequest<'a> {
    /// The world, with the ego to be tested.
    pub scenario: &'a Scenario,
    /// What rows call that ego.
    pub ego: &'a str,
    /// How sequences are chosen.
    pub method: Method<'a>,
    /// Simulations per start; `Method::Switches` does without.
    pub budget: u64,
    /// The test starts.
    pub starts: &'a TestStarts,
}

/// A solution and what was spent on one start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// The actions that make the ego fail, if any were found.
    pub actions: Option<Vec<usize>>,
    /// Closing speed, if the agents touched after it.
    pub closing_speed_mps: Option<f64>,
    /// Whether a rule was broken between the success and that contact.
    pub foul_before_contact: bool,
    /// Episodes run, a part of one counted as one; the last is the success.
    pub simulations: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Sequences that succeeded when pre-screened and not on the plant asked for.
    pub unconfirmed: u64,
    /// The first fault of ego or physics: without a solution nobody knows
    /// whether the start has one.
    pub fault: Option<Fault>,
    /// Processor time spent.
    pub cpu_s: f64,
}

impl Found {
    /// Whether it says nothing: not solved, and the ego failed to run.
    pub fn is_invalid(&self) -> bool {
        self.actions.is_none() && self.fault.is_some()
    }

    /// Simulations spent with a budget of `budget`, and whether they suffice.
    pub fn within(&self, budget: u64) -> (u64, bool) {
        let solved = self.actions.is_some() && self.simulations <= budget;
        (self.simulations.min(budget), solved)
    }
}

/// A row and the solutions behind it.
#[derive(Clone, Debug)]
pub struct Searched {
    /// The row.
    pub row: Row,
    /// Per start; `None` for trivial ones and for those not reached.
    pub found: Vec<Option<Found>>,
}

/// Searches every start until its first success.
pub fn search(request: &SearchRequest<'_>, watch: &Watch<'_>) -> Searched {
    let starts = request.starts;
    let done = AtomicU64::new(0);
    let total = starts.starts.len() as u64;
    let found: Vec<Option<Found>> = (0..starts.starts.len())
        .into_par_iter()
        .map_init(
            || Searcher::new(request),
            |searcher, index| {
                (watch.progress)(done.fetch_add(1, Ordering::Relaxed), total);
                if starts.trivial[index] || watch.stopped() {
                    return None;
                }
                let clock = ThreadTime::now();
                let (start, noise) = &starts.starts[index];
                let mut found = searcher.solve((start, *noise), index, watch)?;
                found.cpu_s = clock.elapsed().as_secs_f64();
                Some(found)
            },
        )
        .collect();
    let row = request.row(&found);
    note_row(watch, &row);
    Searched { row, found }
}

/// What the searches of all starts had reached with a smaller budget.
pub fn anytime(found: &[Option<Found>], budget: u64) -> Anytime {
    let searched = found.iter().flatten().filter(|found| !found.is_invalid());
    let (mut starts, mut successes, mut simulations) = (0, 0, 0);
    for (spent, solved) in searched.map(|found| found.within(budget)) {
        starts += 1;
        successes += usize::from(solved);
        simulations += spent;
    }
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
    /// Whether the kinematic plant sorts out sequences first.
    fn prescreens(&self) -> bool {
        self.scenario.plant() == Dynamics::Rigid && matches!(self.method, Method::Switches(_))
    }

    fn method_text(&self, unconfirmed: Option<Unconfirmed>) -> String {
        let budget = self.budget;
        match self.method {
            Method::Uniform => format!("uniform, {budget} simulations"),
            Method::Hold => format!("hold, {budget} simulations"),
            Method::Cem(cem) => format!("cem, held {}, {budget} simulations", cem.hold),
            Method::Mutate(_) => format!("mutate, {budget} simulations"),
            Method::Switches(most) => {
                let mut text = format!("switches ≤ {most}");
                if let Some(Unconfirmed { sequences, starts }) = unconfirmed {
                    text.push_str(&format!(
                        ", pre-screened on the kinematic plant, {sequences} unconfirmed"
                    ));
                    if 0 < starts {
                        text.push_str(&format!(" (nothing else on {starts} starts)"));
                    }
                }
                text
            }
        }
    }

    /// Budgets that rows report: 10, 30, 100, 300 … and the whole one.
    fn checkpoints(&self) -> Vec<u64> {
        if matches!(self.method, Method::Switches(_)) {
            return Vec::new();
        }
        let decades = (1..).map_while(|power| 10u64.checked_pow(power));
        let steps = decades.flat_map(|decade| [decade, decade.saturating_mul(3)]);
        let mut budgets: Vec<u64> = steps.take_while(|&budget| budget < self.budget).collect();
        budgets.push(self.budget);
        budgets
    }

    fn row(&self, found: &[Option<Found>]) -> Row {
        let mut row = blank_row(self.scenario, self.ego, self.starts);
        row.ado = "search".to_owned();
        let searched = found.iter().flatten();
        row.unconfirmed = self.prescreens().then(|| Unconfirmed {
            sequences: searched.clone().map(|found| found.unconfirmed).sum(),
            starts: searched
                .clone()
                .filter(|found| 0 < found.unconfirmed && found.actions.is_none())
                .count(),
        });
        row.method = self.method_text(row.unconfirmed);
        let marks = found.iter().zip(&self.starts.trivial);
        row.solved = marks
            .map(|(found, trivial)| match (found, trivial) {
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
        let valid = searched.clone().filter(|found| !found.is_invalid());
        let simulations: u64 = valid.map(|found| found.simulations).sum();
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        row.physics_steps = searched.clone().map(|found| found.physics_steps).sum();
        row.cpu_s = searched.clone().map(|found| found.cpu_s).sum();
        count_contacts(&mut row, searched);
        let budgets = self.checkpoints().into_iter();
        row.anytime = budgets.map(|budget| anytime(found, budget)).collect();
        row
    }
}

/// Fills in what a row says of contacts; its starts are counted already.
pub(crate) fn count_contacts<'a>(row: &mut Row, found: impl Iterator<Item = &'a Found> + Clone) {
    let starts = row.starts.max(1) as f64;
    let share = |part: usize| part as f64 / starts;
    let late_fouls = found.clone().filter(|found| found.foul_before_contact);
    let contacts: Vec<f64> = found.clone().filter_map(|f| f.closing_speed_mps).collect();
    row.foul_before_contact_rate = Some(share(late_fouls.count()));
    row.contact_rate = share(contacts.len());
    row.closing_speed_mps = ClosingSpeed::of(contacts);
}

/// One worker: the bench asked for and, for pre-screening, a cheap one.
struct Searcher<'a> {
    request: &'a SearchRequest<'a>,
    cheap: Option<Scenario>,
    bench: Testbench,
}

impl<'a> Searcher<'a> {
    fn new(request: &'a SearchRequest<'a>) -> Searcher<'a> {
        let cheap = request
            .prescreens()
            .then(|| request.scenario.on(PlantKind::Kinematic));
        Searcher {
            request,
            cheap,
            bench: request.scenario.bench(),
        }
    }

    /// `None` when stopped from outside before a result.
    fn solve(&mut self, from: (&Start, u64), index: usize, watch: &Watch<'_>) -> Option<Found> {
        let (start, noise) = from;
        let mut trials = Trials::new(self.request, &mut self.bench, from, index, watch);
        match self.request.method {
            Method::Uniform => random::solve(&mut trials, noise, 1),
            Method::Hold => random::solve(&mut trials, noise, HOLD_DECISIONS),
            Method::Cem(cem) => cem::solve(&mut trials, noise, cem),
            Method::Mutate(stored) => mutate::solve(&mut trials, (start, noise), stored),
            Method::Switches(most) => {
                let cheap = self.cheap.as_ref();
                return switches::solve(self.request, cheap, (from, index), most, watch);
            }
        }
        trials.finish()
    }
}
