//! Semantic checks of a world: what the types cannot say.

use super::error::{Problem, did_you_mean, known_names};
use super::file::Change;
use super::locate::Path;
use super::{ChangeError, Scenario};
use crate::ego::ControllerSpec;
use crate::rl::LearnerConfig;
use crate::rulebook::{Judge, Reward, Verdict};
use crate::scene::drive::{Actions, Agent, Drive, DriveSpec, EgoDrive, Place, Range, Road};
use crate::scene::{Clock, Start};
use crate::seed::{Purpose, StartKey};
use crate::sim::{Body, PlantKind};
use crate::stl::{Expr, StlError};
use crate::testbench::{Aftermath, Constant, play};

/// Longest episode, in samples.
const MAX_SAMPLES: f64 = 1e5;
/// Most lanes of a road.
const MAX_LANES: usize = 100;
/// Samples spent at most on trying coasting runs at load.
const TRIED_SAMPLES: usize = 200_000;
/// Highest speed anybody may start with.
const MAX_SPEED_MPS: f64 = 100.0;
/// Farthest anybody may start from the origin.
const MAX_DISTANCE_M: f64 = 5_000.0;
/// Starts on which a world is tried at load, besides the corners of X_init.
const TRIED_STARTS: u64 = 32;
/// Corners of X_init that are tried at most.
const MAX_CORNERS: u32 = 256;

/// The mistakes found so far, with the text they are in.
pub(super) struct Problems<'a> {
    text: &'a str,
    list: Vec<Problem>,
}

impl<'a> Problems<'a> {
    pub(super) fn new(text: &'a str) -> Problems<'a> {
        Problems {
            text,
            list: Vec::new(),
        }
    }

    /// Notes a mistake at the value under `path`.
    pub(super) fn add(
        &mut self,
        path: &Path,
        what: impl Into<String>,
        label: &str,
        help: Option<String>,
    ) {
        self.list.push(Problem {
            what: what.into(),
            span: path.find(self.text),
            label: label.to_owned(),
            help,
        });
    }

    /// Notes a mistake inside the STL string under `path`.
    pub(super) fn stl(&mut self, path: &Path, error: &StlError) {
        // The mistake may lie in a named formula that this one uses.
        let named = error
            .formula()
            .map(|name| Path::top().to("formulas").to(name));
        let path = named.as_ref().unwrap_or(path);
        let value = path.find(self.text);
        let quoted = &self.text[value.clone()];
        let inner = error.span();
        let open = quoted.find('"').map_or(0, |quote| quote + 1);
        // Escapes shift the places; then the whole string is underlined.
        let shifted = quoted.starts_with('"') && quoted.contains('\\');
        let span = match shifted || quoted.len() < open + inner.end {
            true => value,
            false => value.start + open + inner.start..value.start + open + inner.end,
        };
        self.list.push(Problem {
            what: error.to_string(),
            span,
            label: error.label().to_owned(),
            help: error.help().map(str::to_owned),
        });
    }

    /// Stops here if anything was found.
    pub(super) fn done(&mut self) -> Result<(), Vec<Problem>> {
        match self.list.is_empty() {
            true => Ok(()),
            false => Err(std::mem::take(&mut self.list)),
        }
    }

    /// Whether nothing was found so far.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    pub(super) fn into_list(self) -> Vec<Problem> {
        self.list
    }
}

/// Notes a number outside of `lo ..= hi`.
fn within(problems: &mut Problems, path: &Path, value: f64, lo: f64, hi: f64) {
    if !(lo..=hi).contains(&value) {
        let what = format!("{value} is outside of {lo} ..= {hi}");
        problems.add(path, what, "out of range", None);
    }
}

pub(super) fn clock(problems: &mut Problems, path: &Path, clock: &Clock) {
    let positive = [
        ("horizon_s", clock.horizon_s),
        ("decision_s", clock.decision_s),
        ("sample_s", clock.sample_s),
    ];
    for (field, value) in positive {
        if value <= 0.0 {
            let what = format!("`{field}` is {value}, but time moves forward");
            problems.add(&path.to(field), what, "must be above 0", None);
            return;
        }
    }
    within(
        problems,
        &path.to("substeps"),
        f64::from(clock.substeps),
        1.0,
        1000.0,
    );
    if MAX_SAMPLES < clock.horizon_s / clock.sample_s {
        let what = format!(
            "an episode of {} samples, more than {MAX_SAMPLES}",
            clock.horizon_s / clock.sample_s
        );
        let help = Some("shorten the horizon or lengthen the sample".to_owned());
        problems.add(&path.to("horizon_s"), what, "too long", help);
    }
    let multiples = [
        ("decision_s", clock.decision_s, "sample_s", clock.sample_s),
        ("horizon_s", clock.horizon_s, "sample_s", clock.sample_s),
    ];
    for (field, value, unit_field, unit) in multiples {
        let ratio = value / unit;
        if ratio.round() < 1.0 || 1e-6 < (ratio - ratio.round()).abs() {
            let what = format!("`{field}` = {value} s is no multiple of `{unit_field}` = {unit} s");
            let below = tidy(ratio.floor().max(1.0) * unit);
            let above = tidy((ratio.floor() + 1.0).max(2.0) * unit);
            let help = Some(format!("the neighbours are {below} and {above}"));
            problems.add(&path.to(field), what, "no multiple", help);
        }
    }
    if 0.02 + 1e-9 < clock.sample_s / f64::from(clock.substeps.max(1)) {
        let what = format!(
            "a physics step of {} s is longer than 0.02 s",
            clock.sample_s / f64::from(clock.substeps.max(1))
        );
        let help = (clock.sample_s / 0.02).ceil();
        let help = Some(format!("give at least {help} substeps"));
        problems.add(&path.to("substeps"), what, "too coarse", help);
    }
}

/// A number without the dust of binary fractions.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

pub(super) fn road(problems: &mut Problems, path: &Path, road: &Road) {
    if !(1..=MAX_LANES).contains(&road.lanes()) {
        problems.add(
            &path.to("lanes"),
            format!("a road has 1 to {MAX_LANES} lanes, not {}", road.lanes()),
            "here",
            None,
        );
    }
    within(
        problems,
        &path.to("lane_width_m"),
        road.lane_width_m(),
        1.0,
        20.0,
    );
    within(problems, &path.to("friction"), road.friction(), 0.01, 2.0);
}

pub(super) fn reward(problems: &mut Problems, path: &Path, reward: &Reward) {
    within(problems, &path.to("rho_max"), reward.rho_max(), 1e-6, 1e9);
    if let Reward::Tanh { scale, jump, .. } = reward {
        within(problems, &path.to("scale"), *scale, 1e-6, 1e9);
        within(problems, &path.to("jump"), *jump, 0.0, 0.99);
    }
}

pub(super) fn learner(problems: &mut Problems, path: &Path, learner: &LearnerConfig) {
    if let Err(error) = learner.validate() {
        let place = path.to(error.field);
        problems.add(&place, error.to_string(), "here", Some(error.help));
    }
}

pub(super) fn range(problems: &mut Problems, path: &Path, range: Range) {
    if range.hi < range.lo {
        let what = format!("the range ({}, {}) is reversed", range.lo, range.hi);
        let help = Some(format!("write ({}, {})", range.hi, range.lo));
        problems.add(path, what, "low before high", help);
    }
}

pub(super) fn agent_name(problems: &mut Problems, path: &Path, name: &str) {
    if !is_identifier(name) {
        let what = format!("`{name}` cannot name an agent");
        let help = Some("letters, digits and _, beginning with a letter".to_owned());
        problems.add(path, what, "here", help);
    }
}

pub(super) fn signal_name(problems: &mut Problems, path: &Path, name: &str, taken: bool) {
    if taken {
        let what = format!("the signal `{name}` is published already");
        problems.add(path, what, "choose another name", None);
    } else if !name.split('.').all(is_identifier) {
        let what = format!("`{name}` cannot name a signal");
        let help = Some("dotted names of letters, digits and _".to_owned());
        problems.add(path, what, "here", help);
    }
}

/// A constant's or formula's name: an identifier that means nothing else.
pub(super) fn free_name(problems: &mut Problems, path: &Path, name: &str, taken: bool) {
    if taken {
        let what = format!("`{name}` is the name of something else already");
        problems.add(path, what, "choose another name", None);
    } else if !is_identifier(name) || name.parse::<Expr>().is_err() {
        let what = format!("`{name}` cannot be a name in formulas");
        let help = "letters, digits and _, and no word of the language".to_owned();
        problems.add(path, what, "here", Some(help));
    }
}

/// The world's own name, which files are named after.
pub(super) fn world_name(problems: &mut Problems, path: &Path, name: &str) {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || 64 < name.len() || !name.chars().all(plain) {
        let what = format!("`{name}` cannot name a world");
        let help = "at most 64 letters, digits, _ and -: files are named after it".to_owned();
        problems.add(path, what, "here", Some(help));
    }
}

fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

pub(super) fn controller(problems: &mut Problems, path: &Path, controller: &ControllerSpec) {
    for parameter in controller.parameters() {
        if !(parameter.at_least..).contains(&parameter.value) {
            let what = format!(
                "`{}` is {}, below {}",
                parameter.name, parameter.value, parameter.at_least
            );
            problems.add(&path.to(parameter.name), what, "too small", None);
        }
    }
}

pub(super) fn actions(problems: &mut Problems, path: &Path, actions: &Actions, neutral: usize) {
    let Actions::Accelerations(list) = actions;
    if list.is_empty() {
        let what = "an ado without actions";
        problems.add(&path.to("actions"), what, "give at least one", None);
    }
    for (i, accel_mps2) in list.iter().enumerate() {
        within(
            problems,
            &path.to("actions").at(0).at(i),
            *accel_mps2,
            -30.0,
            30.0,
        );
    }
    if list.len() <= neutral {
        let what = format!("neutral action {neutral} of {} actions", list.len());
        let help = Some("actions count from 0".to_owned());
        problems.add(&path.to("neutral"), what, "no such action", help);
    }
}

/// Starts that are too fast, too far, or inside each other.
pub(super) fn starts(problems: &mut Problems, path: &Path, spec: &DriveSpec) {
    for (i, agent) in spec.agents.iter().enumerate() {
        let start = path.at(i).to("start");
        let speed = agent.place.speed_mps();
        if speed.lo < 0.0 || MAX_SPEED_MPS < speed.hi {
            let what = format!("start speeds are 0 to {MAX_SPEED_MPS} m/s");
            problems.add(&start.to("speed_mps"), what, "out of range", None);
        }
        let along = front(spec, i);
        if along.lo < -MAX_DISTANCE_M || MAX_DISTANCE_M < along.hi {
            let what = format!("starts lie within {MAX_DISTANCE_M} m of the origin");
            problems.add(&start, what, "too far", None);
        }
        for j in 0..i {
            let other = &spec.agents[j];
            let apart_m =
                (spec.road.lane_middle_m(agent.lane) - spec.road.lane_middle_m(other.lane)).abs();
            if (agent.body.width_m + other.body.width_m) / 2.0 <= apart_m {
                continue;
            }
            let ahead = headway(spec, j, i);
            if ahead.lo <= agent.body.length_m && -other.body.length_m <= ahead.hi {
                let what = format!(
                    "`{}` and `{}` may start inside each other",
                    other.name, agent.name
                );
                let help = Some(format!(
                    "the headway ranges over {} to {} m; ahead it must exceed {} m, the length of `{}`",
                    ahead.lo, ahead.hi, agent.body.length_m, agent.name
                ));
                problems.add(&start, what, "overlapping starts", help);
            }
        }
    }
}

/// After a change, nobody may start inside anybody else either.
pub(super) fn still_apart(spec: &DriveSpec) -> Result<(), ChangeError> {
    let mut problems = Problems::new("");
    starts(&mut problems, &Path::top(), spec);
    match problems.into_list().into_iter().next() {
        Some(problem) => Err(ChangeError {
            what: problem.what,
            help: problem.help,
            place: vec!["ego_body".to_owned()],
        }),
        None => Ok(()),
    }
}

/// The agents an agent's position hangs on, itself first.
fn chain(spec: &DriveSpec, agent: usize) -> Vec<usize> {
    let mut chain = vec![agent];
    let mut at = agent;
    while let Place::Ahead { of, .. } = spec.agents[at].place {
        chain.push(of);
        at = of;
    }
    chain
}

fn own_offset(agent: &Agent) -> Range {
    match agent.place {
        Place::At { x_m, .. } => x_m,
        Place::Ahead { headway_m, .. } => headway_m,
    }
}

/// Where an agent's front bumper may start.
fn front(spec: &DriveSpec, agent: usize) -> Range {
    sum(spec, chain(spec, agent).into_iter())
}

/// By how much `b` may start ahead of `a`; what they share cancels.
fn headway(spec: &DriveSpec, a: usize, b: usize) -> Range {
    let (of_a, of_b) = (chain(spec, a), chain(spec, b));
    let plus = sum(spec, of_b.iter().copied().filter(|i| !of_a.contains(i)));
    let minus = sum(spec, of_a.iter().copied().filter(|i| !of_b.contains(i)));
    Range {
        lo: plus.lo - minus.hi,
        hi: plus.hi - minus.lo,
    }
}

fn sum(spec: &DriveSpec, agents: impl Iterator<Item = usize>) -> Range {
    agents
        .map(|i| own_offset(&spec.agents[i]))
        .fold(Range { lo: 0.0, hi: 0.0 }, |sum, range| Range {
            lo: sum.lo + range.lo,
            hi: sum.hi + range.hi,
        })
}

/// Applies a change to a spec.
pub(super) fn apply(spec: &mut DriveSpec, change: &Change) -> Result<(), ChangeError> {
    let fail = |what: String, help: Option<String>, place: &[&str]| ChangeError {
        what,
        help,
        place: place.iter().map(|name| (*name).to_owned()).collect(),
    };
    if change.grid.is_some() {
        let what = "a driving world has no map of cells".to_owned();
        let help = "a change of it has: ego, controller, ego_body, friction, plant".to_owned();
        return Err(fail(what, Some(help), &["grid"]));
    }
    if let Some(friction) = change.friction {
        if !(0.01..=2.0).contains(&friction) {
            let what = format!("friction {friction} is outside of 0.01 ..= 2");
            return Err(fail(what, None, &["friction"]));
        }
        spec.road.set_friction(friction);
    }
    if let Some(plant) = change.plant {
        spec.plant = plant;
    }
    for agent in &mut spec.agents {
        let Drive::Ego(drive) = &mut agent.drive else {
            continue;
        };
        if let Some(name) = &change.ego_body {
            let Some(Ok(body)) = Body::shipped(name) else {
                let what = format!("no body `{name}`");
                let help = Some(known_names("known", Body::shipped_names()));
                return Err(fail(what, help, &["ego_body"]));
            };
            agent.body = body;
        }
        if let Some(controller) = &change.controller {
            *drive = EgoDrive::Stock(controller.clone());
        }
        let EgoDrive::Stock(controller) = drive else {
            continue;
        };
        for (name, value) in &change.ego.0 {
            controller.set(name, *value).map_err(|error| {
                let known = known_names("parameters", error.known.iter().copied());
                let help = match did_you_mean(name, error.known.iter().copied()) {
                    Some(guess) => format!("{guess} — {known}"),
                    None => known,
                };
                fail(error.to_string(), Some(help), &["ego", name])
            })?;
        }
        if let Some(low) = controller
            .parameters()
            .iter()
            .find(|p| !(p.at_least..).contains(&p.value))
        {
            let what = format!("`{}` is {}, below {}", low.name, low.value, low.at_least);
            return Err(fail(what, None, &["ego", low.name]));
        }
    }
    Ok(())
}

/// Every change under `reuse` must fit.
pub(super) fn reuse(problems: &mut Problems, path: &Path, scenario: &Scenario) {
    world_name(problems, &Path::top().to("name"), &scenario.name);
    for (name, change) in &scenario.reuse {
        if name.is_empty() || ["nominal", "all"].contains(&name.as_str()) || name.ends_with(".ron")
        {
            let what = format!("`{name}` cannot name a changed ego");
            let help = "`nominal`, `all` and files mean something else to `--ego`".to_owned();
            problems.add(&path.to(name), what, "choose another name", Some(help));
        }
        if let Err(error) = scenario.with(change) {
            let place = error.path(&path.to(name));
            problems.add(&place, error.what, "here", error.help);
        }
    }
}

/// Starts to try a world on: those it lists, or corners of X_init and draws.
fn tried_starts(scenario: &Scenario) -> Vec<Start> {
    let bench = scenario.bench();
    if let Some(starts) = scenario.starts() {
        let every = starts.len().div_ceil(MAX_CORNERS as usize).max(1);
        return starts.into_iter().step_by(every).collect();
    }
    let axes = bench.axes();
    let corners = 1u32 << axes.len().min(MAX_CORNERS.ilog2() as usize);
    let corner = |bits: u32| {
        let pick = |(i, axis): (usize, &crate::scene::Axis)| match bits >> i & 1 {
            0 => axis.lo,
            _ => axis.hi,
        };
        Start(axes.iter().enumerate().map(pick).collect())
    };
    let drawn = (0..TRIED_STARTS).map(|index| {
        bench.draw(StartKey {
            purpose: Purpose::Calibration,
            seed: 0,
            index,
        })
    });
    match scenario.drive() {
        Some(_) => (0..corners).map(corner).chain(drawn).collect(),
        // On a grid two corners may be one cell: only draws are starts.
        None => drawn.collect(),
    }
}

/// At t = 0 no rule may be broken already, nor ψ_ego be lost.
pub(super) fn begins_well(problems: &mut Problems, path: &Path, scenario: &Scenario) {
    let tried = scenario.on(PlantKind::Kinematic);
    let mut bench = tried.bench();
    let rulebook = tried.rulebook();
    let mut row = vec![0.0; bench.schema().len()];
    for start in tried_starts(&tried) {
        bench.begin(&start, 0, Aftermath::Skip);
        if bench.trace().is_empty() {
            let what = "a signal is not finite at the start".to_owned();
            problems.add(
                &path.to("signals"),
                what,
                "here",
                Some(in_words(&tried, &start)),
            );
            return;
        }
        bench.trace().read_row(0, &mut row);
        let mut judge = Judge::new(rulebook, bench.clock().samples());
        match judge.push(rulebook, bench.trace(), &row, None) {
            Some(Verdict::Foul { rule, .. }) => {
                let rule = &rulebook.rules[rule];
                let what = format!("the rule `{}` is broken already at the start", rule.name);
                let help = format!("{}; rules need ρ > 0", in_words(&tried, &start));
                let place = rule_place(scenario, &rule.name);
                problems.add(&place, what, "ρ ≤ 0 at t = 0", Some(help));
                return;
            }
            Some(Verdict::Counterexample { .. }) => {
                let what = "the ego's specification is violated already at the start";
                let help = Some(in_words(&tried, &start));
                problems.add(&path.to("ego_spec"), what, "ρ < 0 at t = 0", help);
                return;
            }
            _ => {}
        }
    }
}

fn in_words(scenario: &Scenario, start: &Start) -> String {
    let axes = scenario.axes();
    let values = axes.iter().zip(&start.0);
    let list: Vec<String> = values
        .map(|(axis, value)| format!("{} = {value:.3} {}", axis.name, axis.unit))
        .collect();
    match list.is_empty() {
        true => "for the only start there is".to_owned(),
        false => format!("for example at {}", list.join(", ")),
    }
}

fn rule_place(scenario: &Scenario, rule: &str) -> Path {
    let mut rules = scenario.rules.iter();
    let found = rules.find(|spec| spec.name == rule);
    found.map_or_else(Path::top, |spec| spec.place.clone())
}

/// What is allowed but odd: coasting runs that sit at ρ = 0 exactly.
pub(super) fn warnings(text: &str, scenario: &Scenario) -> Vec<Problem> {
    let tried = scenario.on(PlantKind::Kinematic);
    let mut bench = tried.bench();
    let neutral = bench.spaces().neutral;
    let mut scratch = crate::stl::Scratch::default();
    let affordable = TRIED_SAMPLES / bench.clock().samples();
    // A program as the ego is not run for a warning's sake.
    let affordable = bench.fork().map_or(0, |_| affordable.max(1));
    for start in tried_starts(&tried).into_iter().take(affordable) {
        let mut actor = Constant(neutral);
        let episode = play(&mut bench, &start, 0, &mut actor, Aftermath::Skip);
        let rules = &tried.rulebook().rules;
        let mut judged = episode.trace.clone();
        judged.truncate(episode.judged);
        let tie = rules
            .iter()
            .find(|rule| rule.monitor.robustness(&judged, &mut scratch) == 0.0);
        let top = Path::top();
        let (what, place) = match tie {
            Some(rule) => (
                format!(
                    "a coasting run keeps the rule `{}` with ρ = 0 exactly",
                    rule.name
                ),
                rule_place(scenario, &rule.name),
            ),
            // On a grid whole numbers meet: next to the ego is ρ = 0, a capture 1.
            None if episode.robustness == 0.0 && scenario.drive().is_some() => (
                "a coasting run satisfies the ego's specification with ρ = 0 exactly".to_owned(),
                top.to("ego_spec"),
            ),
            None => continue,
        };
        return vec![Problem {
            what,
            span: place.find(text),
            label: "neither kept nor broken".to_owned(),
            help: Some(format!(
                "{}; write it with slack, such as `>= -0.1`",
                in_words(&tried, &start)
            )),
        }];
    }
    Vec::new()
}
