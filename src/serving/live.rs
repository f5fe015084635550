//! Judged episode that another simulator moves.
//!
//! The simulator sends the states of the ego, and of other agents if it moves them, at
//! the end of every sample. brakecheck moves all other agents, publishes the signals of
//! the world and judges them as at home.

use std::sync::Arc;

use indexmap::IndexMap;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::step::stepped;
use super::{actions_of, player::ServedPlayer};
use crate::experiment::test_start;
use crate::rulebook::Verdict;
use crate::run_dir::AdversaryId;
use crate::scene::drive::{Drive, DriveSpec};
use crate::scene::{BodyState, Pose, Start};
use crate::search::JointActions;
use crate::testbench::{Aftermath, Episode, Testbench};
use crate::world::Scenario;

/// Start of an episode, as the simulator requests it. Without one nothing is judged.
#[derive(Debug, Default, Deserialize)]
pub(super) struct ResetRequest {
    /// Seed of the test starts.
    #[serde(default)]
    seed: u64,
    /// Position among the test starts of that seed.
    #[serde(default)]
    index: Option<usize>,
    /// Value of every axis, instead of a test start.
    #[serde(default)]
    start: Option<IndexMap<String, f64>>,
    /// Time between two samples. The world's own if omitted.
    #[serde(default)]
    step_s: Option<f64>,
}

/// State of one agent at the end of a sample.
#[derive(Debug, Deserialize)]
struct GivenState {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    speed_mps: f64,
    #[serde(default)]
    lateral_mps: f64,
    #[serde(default)]
    yaw_rate_rad_per_s: f64,
    #[serde(default)]
    accel_mps2: Option<f64>,
}

/// Speed of a vehicle that is taken for a mistake.
const MOST_MPS: f64 = 150.0;
/// Acceleration that is taken for a mistake: 100 g, more than the body of a car in a crash.
const MOST_MPS2: f64 = 1000.0;
/// Yaw rate that is taken for a mistake: almost five turns per second.
const MOST_RAD_PER_S: f64 = 30.0;
/// Distance between the motion of a sample and the one that its speeds and headings say:
/// a constant part, and a share of the way.
const OFF_M: f64 = 0.2;
const OFF_SHARE: f64 = 0.25;

/// Returns why a body cannot have moved so from sample to sample.
fn possible(before: &BodyState, after: &BodyState, sample_s: f64) -> Result<(), String> {
    let way_m = |state: &BodyState| {
        let (sin, cos) = libm::sincos(state.pose.heading_rad);
        let (ahead_m, left_m) = (sample_s * state.speed_mps, sample_s * state.lateral_mps);
        [ahead_m * cos - left_m * sin, ahead_m * sin + left_m * cos]
    };
    let ways_m = [way_m(before), way_m(after)];
    // The mean of both ends, which a constant acceleration and turn would give.
    let said_m: [f64; 2] = core::array::from_fn(|i| 0.5 * (ways_m[0][i] + ways_m[1][i]));
    let moved_m = [
        after.pose.x_m - before.pose.x_m,
        after.pose.y_m - before.pose.y_m,
    ];
    let off_m = libm::hypot(moved_m[0] - said_m[0], moved_m[1] - said_m[1]);
    let [first_m, second_m] = ways_m.map(|way_m| libm::hypot(way_m[0], way_m[1]));
    let longest_m = first_m.max(second_m);
    // A speed in another unit also gives a wrong way, so the speed is checked first.
    if MOST_MPS * sample_s < longest_m {
        let mps = longest_m / sample_s;
        return Err(format!(
            "has a speed of {mps:.0} m/s: give m/s, up to {MOST_MPS}"
        ));
    }
    if OFF_M + OFF_SHARE * longest_m < off_m {
        let [moved_m, said_m] = [moved_m, said_m].map(|way_m| libm::hypot(way_m[0], way_m[1]));
        return Err(format!(
            "moved by {moved_m:.2} m in {sample_s} s, {off_m:.2} m from where its speeds and \
             headings take it ({said_m:.2} m): give m, m/s and rad, and every sample"
        ));
    }
    Ok(())
}

/// Judged episode in progress.
pub(super) struct LiveEpisode {
    bench: Testbench,
    start: Start,
    noise: u64,
    /// Seed and position of its test start. `None` for a start of the simulator.
    pub(super) test_start: Option<(u64, usize)>,
    ados: JointActions,
    /// Whether a search found a sequence from this start. `None` without a search.
    found: Option<bool>,
    actions: Vec<usize>,
    /// Value of the last decision, if a policy takes it.
    value: Option<f32>,
    /// Names of all agents, and the position of the ego among them.
    agents: Vec<String>,
    ego: usize,
}

impl ResetRequest {
    /// Parses the value of `reset`.
    pub(super) fn parse(request: &Value) -> Result<ResetRequest, String> {
        match request {
            Value::Object(_) => {
                ResetRequest::deserialize(request).map_err(|error| format!("`reset`: {error}"))
            }
            // Protocol 1 takes any value for an episode without a start.
            _ => Ok(ResetRequest::default()),
        }
    }

    /// Returns the start with the seed of its noise, `None` if it requests none.
    fn start(&self, world: &Scenario) -> Result<Option<(Start, u64)>, String> {
        match (&self.start, self.index) {
            (None, None) => Ok(None),
            (Some(_), Some(_)) => Err("`reset` has an `index` and a `start`".to_owned()),
            (None, Some(index)) => match test_start(world, self.seed, index) {
                Some(start) => Ok(Some(start)),
                None => {
                    let count = world.starts().map_or(0, |all| all.len());
                    Err(format!(
                        "`reset`: no start {index}, the world lists {count}"
                    ))
                }
            },
            // A start of the simulator has no position in a stream, so its noise has a
            // fixed seed.
            (Some(start), None) => start_of(world, start).map(|start| Some((start, 0))),
        }
    }
}

/// Returns the start with a value for every axis.
fn start_of(world: &Scenario, values: &IndexMap<String, f64>) -> Result<Start, String> {
    let axes = world.axes();
    // A misspelled axis would otherwise be reported as a missing one.
    if let Some(name) = values
        .keys()
        .find(|name| !axes.iter().any(|axis| axis.name == **name))
    {
        return Err(format!("`start`: unknown axis `{name}`"));
    }
    let value = |name: &str, lo: f64, hi: f64| match values.get(name) {
        None => Err(format!("`start`: missing axis `{name}`")),
        Some(value) if (lo..=hi).contains(value) => Ok(*value),
        Some(value) => Err(format!(
            "`start`: `{name}` = {value} is outside of {lo} ..= {hi}"
        )),
    };
    let values = axes.iter().map(|axis| value(&axis.name, axis.lo, axis.hi));
    values.collect::<Result<Vec<f64>, String>>().map(Start)
}

impl LiveEpisode {
    /// Begins an episode. `None` if the request has no start.
    ///
    /// # Errors
    /// The start or the step does not fit the world, or the world has no vehicles.
    pub(super) fn begin(
        world: &Scenario,
        request: &ResetRequest,
        player: &ServedPlayer,
    ) -> Result<Option<LiveEpisode>, String> {
        // The ego comes from outside, so that of the world must not start a program.
        let world = &world.with_commands(&Arc::from([]));
        let Some((start, noise)) = request.start(world)? else {
            return Ok(None);
        };
        let Some(drive) = world.drive() else {
            let name = world.name();
            return Err(format!(
                "`{name}` is a grid world, whose agents have no states"
            ));
        };
        let spec: &DriveSpec = drive.spec();
        let is_ego = |agent: &crate::scene::drive::Agent| matches!(agent.drive, Drive::Ego);
        let mut bench = match request.step_s {
            None => world.bench(),
            Some(step_s) => stepped(world, step_s)?.bench(),
        };
        let (ados, found) = player.joint_actions(&start, noise, bench.spaces());
        // To the contact, which a kept file needs for its severity.
        bench.begin(&start, noise, Aftermath::Play);
        let mut live = LiveEpisode {
            bench,
            start,
            noise,
            test_start: request.index.map(|index| (request.seed, index)),
            ados,
            found,
            actions: Vec::new(),
            value: None,
            agents: spec.agents.iter().map(|it| it.name.clone()).collect(),
            // Invariant: a driving world has exactly one ego.
            ego: spec.agents.iter().position(is_ego).unwrap_or(0),
        };
        // The first action belongs to the start, so the answer to `reset` has it already.
        live.decide();
        Ok(Some(live))
    }

    /// Returns the keys of the answer to `reset` alone.
    pub(super) fn beginning(&self, world: &Scenario) -> Map<String, Value> {
        let mut answer = Map::new();
        let mut add = |key: &str, value: Value| answer.insert(key.to_owned(), value);
        add("ready", json!(true));
        add("start", self.start_by_name(world));
        add("step_s", json!(self.bench.clock().sample_s));
        if let Some(found) = self.found {
            add("found", json!(found));
        }
        answer
    }

    /// Returns the start, by name of the axis.
    fn start_by_name(&self, world: &Scenario) -> Value {
        let axes = world.axes().into_iter().map(|axis| axis.name);
        let values = self.start.0.iter().map(|value| json!(value));
        Value::Object(axes.zip(values).collect())
    }

    /// Lets the ados decide, if they do so at this sample.
    fn decide(&mut self) {
        // A decision after the end would be an action too many in a kept file.
        if self.bench.is_done() || !self.bench.is_decision_due() {
            return;
        }
        let mut obs = vec![0.0; self.bench.spaces().observation];
        self.bench.observe(&mut obs);
        let allowed = self.bench.allowed();
        let decision = self.actions.len();
        let action = self.ados.act(&obs, allowed.as_deref(), decision);
        // JSON has no word for other numbers.
        self.value = self.ados.value(&obs).filter(|value| value.is_finite());
        self.actions.push(action);
        // The simulator moves the samples, so the bench only notes the decision.
        self.bench.decide_only(action);
    }

    /// Takes the states at the end of the next sample.
    ///
    /// # Errors
    /// The episode is over, an agent is unknown, the ego is missing, a rate is impossible,
    /// or a position contradicts the speeds and headings.
    pub(super) fn sample(&mut self, request: &Value) -> Result<(), String> {
        if self.bench.is_done() {
            return Err("the episode is over: reset".to_owned());
        }
        let given = IndexMap::<String, GivenState>::deserialize(request)
            .map_err(|error| format!("`sample`: {error}"))?;
        let mut states = vec![None; self.agents.len()];
        let before = self.bench.bodies();
        let sample_s = self.bench.clock().sample_s;
        for (name, given) in given {
            let Some(agent) = self.agents.iter().position(|it| *it == name) else {
                return Err(format!("`sample`: unknown agent `{name}`"));
            };
            given
                .possible()
                .map_err(|why| format!("`sample`: `{name}` {why}"))?;
            let last = &before[agent].state;
            // A simulator need not report an acceleration, but signals may read it.
            let state = given.state((given.speed_mps - last.speed_mps) / sample_s);
            states[agent] = Some(state);
        }
        // All others can be moved here, but this ego exists in the other simulator only.
        if states[self.ego].is_none() {
            let name = &self.agents[self.ego];
            return Err(format!("`sample`: missing state of the ego `{name}`"));
        }
        for (agent, state) in states.iter().enumerate() {
            // An agent that the simulator leaves out is moved here.
            let Some(state) = state else { continue };
            let name = &self.agents[agent];
            possible(&before[agent].state, state, sample_s)
                .map_err(|why| format!("`sample`: `{name}` {why}"))?;
        }
        // Invariant: the episode is not over and its agents have bodies, so a sample is played.
        self.bench.sample_given(&states);
        self.decide();
        Ok(())
    }

    /// Returns the agents, the decision and the judgement at this sample.
    pub(super) fn answer(&self, world: &Scenario) -> Map<String, Value> {
        let bodies = self
            .agents
            .iter()
            .zip(self.bench.bodies().into_iter().zip(self.bench.attitudes()))
            .map(|(name, (body, attitude))| {
                let BodyState { pose, .. } = body.state;
                let state = json!({
                    "x_m": pose.x_m, "y_m": pose.y_m, "z_m": attitude.z_m,
                    "heading_rad": pose.heading_rad,
                    // Without the sign of a zero.
                    "pitch_rad": attitude.pitch_rad + 0.0, "roll_rad": attitude.roll_rad + 0.0,
                    "speed_mps": body.state.speed_mps, "accel_mps2": body.state.accel_mps2,
                });
                (name.clone(), state)
            });
        // The trace begins with the start, at time 0.
        let samples = self.bench.trace().len().saturating_sub(1);
        let mut answer = Map::new();
        let mut add = |key: &str, value: Value| answer.insert(key.to_owned(), value);
        add(
            "time_s",
            json!(samples as f64 * self.bench.clock().sample_s),
        );
        add("bodies", Value::Object(bodies.collect()));
        if let Some(action) = self.actions.last().copied() {
            add("action", json!(action));
            add("label", json!(world.action_label(action)));
            add("ados", actions_of(world.world(), action));
            add("value", json!(self.value));
        }
        answer.extend(self.judgement(world));
        answer
    }

    /// Returns the margins, and the verdict once it is final.
    fn judgement(&self, world: &Scenario) -> Map<String, Value> {
        let margins = self.bench.margins();
        let rules = world
            .rules()
            .iter()
            .zip(&margins.rules)
            .map(|(rule, margin)| (rule.name.clone(), json!(margin)));
        let mut answer = Map::new();
        let mut add = |key: &str, value: Value| answer.insert(key.to_owned(), value);
        add("robustness", json!(margins.spec));
        add("rules", Value::Object(rules.collect()));
        add("done", json!(self.bench.is_done()));
        let verdict = self.bench.verdict();
        add("verdict", json!(verdict.map(|verdict| verdict.word())));
        if let Some(verdict) = verdict {
            add("is_success", json!(verdict.is_success()));
            let broken = match verdict {
                Verdict::Foul { rule, .. } => Some(&world.rules()[rule].name),
                _ => None,
            };
            add("broken_rule", json!(broken));
            add("contact", json!(self.bench.contact()));
            add(
                "rules_until_contact",
                json!(self.bench.rules_until_contact()),
            );
            add(
                "fault",
                json!(self.bench.fault().map(|fault| &fault.message)),
            );
        }
        answer
    }

    /// Returns the name of the ados' player in kept files.
    pub(super) fn adversary(&self) -> AdversaryId {
        self.ados.adversary()
    }

    /// Returns whether the episode is over and the ego failed with all rules kept.
    pub(super) fn is_counterexample(&self) -> bool {
        let failed = self.bench.verdict().is_some_and(|it| it.is_success());
        // An ego fails before its aftermath ends, and a kept file has all of it.
        failed && self.bench.is_done()
    }

    /// Returns the record of the episode so far.
    pub(super) fn episode(&self) -> Episode {
        self.bench
            .episode(&self.start, self.noise, self.actions.clone())
    }
}

impl GivenState {
    /// Returns why no body has these rates, which the motion of a sample does not show.
    ///
    /// An acceleration that follows from two speeds is as possible as they are. A contact
    /// within a short step makes it large.
    fn possible(&self) -> Result<(), String> {
        let rates = [
            ("accel_mps2", self.accel_mps2, MOST_MPS2, "m/s²"),
            (
                "yaw_rate_rad_per_s",
                Some(self.yaw_rate_rad_per_s),
                MOST_RAD_PER_S,
                "rad/s",
            ),
        ];
        for (field, value, most, unit) in rates {
            if let Some(value) = value.filter(|value| value.abs() > most) {
                return Err(format!(
                    "has `{field}` = {value}: give {unit}, from -{most} to {most}"
                ));
            }
        }
        Ok(())
    }

    /// Returns the state, whose acceleration is `gained_mps2` if it is not given.
    fn state(&self, gained_mps2: f64) -> BodyState {
        BodyState {
            pose: Pose {
                x_m: self.x_m,
                y_m: self.y_m,
                heading_rad: self.heading_rad,
            },
            speed_mps: self.speed_mps,
            lateral_mps: self.lateral_mps,
            yaw_rate_rad_per_s: self.yaw_rate_rad_per_s,
            accel_mps2: self.accel_mps2.unwrap_or(gained_mps2),
        }
    }
}
