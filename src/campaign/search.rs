//! Open-loop search per start: what an adversary can do at all, and the
//! baselines a reusable ado must beat.

use std::sync::atomic::{AtomicU64, Ordering};

use cpu_time::ThreadTime;
use rayon::prelude::*;

use super::Watch;
use super::eval::{HOLD_DECISIONS, TestStarts, blank_row, count_solved};
use crate::run::{ClosingSpeed, Row};
use crate::scenario::Scenario;
use crate::scene::{Dynamics, Start};
use crate::seed;
use crate::sim::PlantKind;
use crate::testbench::{Actor, Aftermath, Held, Replay, Testbench, play};

/// Pre-screened sequences that are tried on the plant asked for, per start.
const MAX_CONFIRMATIONS: u64 = 300;

/// How sequences of actions are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// A uniformly random action at each decision.
    Uniform,
    /// A uniformly random action, held for five decisions.
    Hold,
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
    pub method: Method,
    /// Simulations per start, for the random methods.
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
    /// Episodes run, a part of one counted as one.
    pub simulations: u64,
    /// Physics steps spent, on both plants.
    pub physics_steps: u64,
    /// Processor time spent.
    pub cpu_s: f64,
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
                let mut found = searcher.solve(start, *noise, watch)?;
                found.cpu_s = clock.elapsed().as_secs_f64();
                Some(found)
            },
        )
        .collect();
    Searched {
        row: request.row(&found),
        found,
    }
}

impl SearchRequest<'_> {
    /// Whether the kinematic plant sorts out sequences first.
    fn prescreens(&self) -> bool {
        self.scenario.plant() == Dynamics::Rigid && matches!(self.method, Method::Switches(_))
    }

    fn row(&self, found: &[Option<Found>]) -> Row {
        let mut row = blank_row(self.scenario, self.ego, self.starts);
        row.ado = "search".to_owned();
        let screen = match self.prescreens() {
            true => ", pre-screened on the kinematic plant",
            false => "",
        };
        row.method = match self.method {
            Method::Uniform => format!("uniform, {} simulations", self.budget),
            Method::Hold => format!("hold, {} simulations", self.budget),
            Method::Switches(most) => format!("switches ≤ {most}{screen}"),
        };
        let marks = found.iter().zip(&self.starts.trivial);
        row.solved = marks
            .map(|(found, trivial)| match (found, trivial) {
                (_, true) => 't',
                (Some(found), _) if found.actions.is_some() => '1',
                (Some(_), _) => '0',
                (None, _) => '-',
            })
            .collect();
        count_solved(&mut row);
        let searched = found.iter().flatten();
        let simulations: u64 = searched.clone().map(|found| found.simulations).sum();
        row.sims_per_start = simulations as f64 / row.starts.max(1) as f64;
        row.physics_steps = searched.clone().map(|found| found.physics_steps).sum();
        row.cpu_s = searched.clone().map(|found| found.cpu_s).sum();
        let contacts: Vec<f64> = searched.filter_map(|f| f.closing_speed_mps).collect();
        row.contact_rate = contacts.len() as f64 / row.starts.max(1) as f64;
        row.closing_speed_mps = ClosingSpeed::of(contacts);
        row
    }
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
    fn solve(&mut self, start: &Start, noise: u64, watch: &Watch<'_>) -> Option<Found> {
        match self.request.method {
            Method::Uniform => self.random(start, noise, 1, watch),
            Method::Hold => self.random(start, noise, HOLD_DECISIONS, watch),
            Method::Switches(most) => self.switches(start, noise, most, watch),
        }
    }

    fn random(
        &mut self,
        start: &Start,
        noise: u64,
        hold: usize,
        watch: &Watch<'_>,
    ) -> Option<Found> {
        let mut found = Found::default();
        let mut actor = Reseeded {
            held: Held::new(self.bench.spaces().actions, hold),
            seed: 0,
        };
        while found.simulations < self.request.budget {
            if watch.stopped() {
                return None;
            }
            // The noise is the start's own; only the ado's dice differ.
            let mut dice = seed::generator("search", &[noise, hold as u64, found.simulations]);
            actor.seed = rand::Rng::next_u64(&mut dice);
            let episode = play(&mut self.bench, start, noise, &mut actor, Aftermath::Play);
            found.simulations += 1;
            found.physics_steps += episode.physics_steps;
            if episode.verdict.is_success() {
                found.actions = Some(episode.actions);
                found.closing_speed_mps = episode.contact.map(|touch| touch.closing_speed_mps);
                break;
            }
        }
        Some(found)
    }

    fn switches(
        &mut self,
        start: &Start,
        noise: u64,
        most: usize,
        watch: &Watch<'_>,
    ) -> Option<Found> {
        let scenario = self.cheap.as_ref().unwrap_or(self.request.scenario);
        let confirms = self.cheap.is_some();
        let bench = &mut self.bench;
        let mut confirmed = Found::default();
        let mut accept = |actions: &[usize]| {
            let mut replay = Replay::holding(actions);
            let episode = play(bench, start, noise, &mut replay, Aftermath::Play);
            confirmed.physics_steps += episode.physics_steps;
            confirmed.simulations += u64::from(confirms);
            let success = episode.verdict.is_success();
            if success {
                confirmed.closing_speed_mps = episode.contact.map(|touch| touch.closing_speed_mps);
                confirmed.actions = Some(actions.to_vec());
            }
            match success || MAX_CONFIRMATIONS <= confirmed.simulations {
                true => Next::Stop,
                false => Next::Continue,
            }
        };
        let mut tree = Tree {
            scenario,
            start,
            noise,
            actions: scenario.world().spaces().actions,
            prefix: Vec::new(),
            accept: &mut accept,
            watch,
            simulations: 0,
            physics_steps: 0,
        };
        let mut root = scenario.bench();
        let mut next = Next::Continue;
        for switches in 0..=most {
            for action in 0..tree.actions {
                if next == Next::Continue {
                    root.begin(start, noise, Aftermath::Skip);
                    next = tree.explore(&mut root, action, switches);
                }
            }
        }
        let (simulations, physics_steps) = (tree.simulations, tree.physics_steps);
        if confirmed.actions.is_none() && watch.stopped() {
            return None;
        }
        confirmed.simulations += simulations;
        confirmed.physics_steps += physics_steps;
        Some(confirmed)
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Next {
    Continue,
    Stop,
}

/// All sequences with a given number of switches, prefixes shared by forking.
struct Tree<'a> {
    scenario: &'a Scenario,
    start: &'a Start,
    noise: u64,
    actions: usize,
    prefix: Vec<usize>,
    accept: &'a mut dyn FnMut(&[usize]) -> Next,
    watch: &'a Watch<'a>,
    simulations: u64,
    physics_steps: u64,
}

impl Tree<'_> {
    /// Goes on with `action` and exactly `switches` later changes of it.
    fn explore(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        let depth = self.prefix.len();
        let next = self.walk(bench, action, switches);
        self.prefix.truncate(depth);
        next
    }

    fn walk(&mut self, bench: &mut Testbench, action: usize, switches: usize) -> Next {
        if switches == 0 {
            self.simulations += 1;
        }
        while !bench.is_done() {
            if self.watch.stopped() {
                return Next::Stop;
            }
            let before = bench.physics_steps();
            bench.decide(action);
            self.physics_steps += bench.physics_steps() - before;
            self.prefix.push(action);
            if switches == 0 || bench.is_done() {
                continue;
            }
            for other in (0..self.actions).filter(|&other| other != action) {
                let mut branch = self.branch(bench);
                if self.explore(&mut branch, other, switches - 1) == Next::Stop {
                    return Next::Stop;
                }
            }
        }
        let success = bench.verdict().is_some_and(|verdict| verdict.is_success());
        match switches == 0 && success {
            true => (self.accept)(&self.prefix),
            false => Next::Continue,
        }
    }

    /// A copy of the bench; where the ego cannot be copied, a re-run.
    fn branch(&mut self, bench: &Testbench) -> Testbench {
        if let Some(fork) = bench.fork() {
            return fork;
        }
        let mut again = self.scenario.bench();
        again.begin(self.start, self.noise, Aftermath::Skip);
        for &action in &self.prefix {
            again.decide(action);
        }
        self.physics_steps += again.physics_steps();
        again
    }
}

/// Held-random actions from a seed of their own, whatever the episode's noise.
struct Reseeded {
    held: Held,
    seed: u64,
}

impl Actor for Reseeded {
    fn begin(&mut self, _noise: u64, start: &Start) {
        self.held.begin(self.seed, start);
    }

    fn act(&mut self, obs: &[f32]) -> usize {
        self.held.act(obs)
    }
}
