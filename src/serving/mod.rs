//! Ados for another simulator: ado protocol 1.
//!
//! It mirrors the ego protocol. There brakecheck requests commands of the ego from a
//! program. Here a simulator requests actions of the ado from brakecheck.
//! `docs/reference/ado-protocol.md` defines it. Both sides ignore unknown keys.
//!
//! `live` judges an episode that the simulator moves, and `home` replays it here.

mod description;
mod home;
mod live;
mod player;
mod step;

use std::io::{self, BufRead, Read, Write};
use std::path::PathBuf;

use indexmap::IndexMap;
use rand::RngExt;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::experiment::EgoError;
use crate::run_dir::{RunDir, RunError};
use crate::scene::World;
use crate::scene::drive::{Actions, PhaseAction};
use crate::search::AdoPlayer;
use crate::testbench::draws;
use crate::world::Scenario;
use description::with_derived;
use live::{LiveEpisode, ResetRequest};
use player::ServedPlayer;

/// Version of the protocol.
const PROTOCOL: u32 = 1;
/// Largest length of a message without the end of its line, bytes.
const LONGEST: u64 = 65_536;

/// Ado that acts in the world of another simulator.
pub struct ServedAdo {
    world: Scenario,
    player: ServedPlayer,
    /// Decisions since the episode began.
    ///
    /// They determine `time` and `time_left` if the simulator omits them.
    decisions: u64,
    /// Joint action before the last one, and the last one.
    ///
    /// They determine `A.action` and `A.action_before` if the simulator omits them.
    last: [usize; 2],
    /// Episodes that have begun, by which drawn actions differ.
    begun: u64,
    /// Episode that the simulator moves and brakecheck judges.
    live: Option<LiveEpisode>,
    /// Directory for the counterexamples among them.
    keep: Option<PathBuf>,
}

/// Counts of a finished conversation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Answered decisions.
    pub decisions: u64,
    /// Messages answered with an error.
    pub errors: u64,
    /// Judged episodes that ended.
    pub episodes: u64,
    /// Episodes in which the ego failed with all rules kept.
    pub successes: u64,
    /// Counterexamples that were kept.
    pub kept: u64,
}

/// Reason why the ados of a world cannot be served.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotServed {
    /// Grids have no vehicles that a simulator could move.
    #[error("`{world}` is a grid world, and only a trained ado of it can be served")]
    Grid {
        /// Name of the world.
        world: String,
    },
    /// No run with a trained ado was given.
    #[error("`{world}` is a world, and a trained ado requires its run")]
    NotTrained {
        /// Name of the world.
        world: String,
    },
    /// The search would start a program without consent.
    #[error(transparent)]
    Ego(#[from] EgoError),
}

/// Error that ends a conversation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// A line is not a message of the protocol.
    #[error("line {line} is no message: {why}")]
    NoMessage {
        /// Number of the line, from 1.
        line: u64,
        /// Reason.
        why: String,
    },
    /// A pipe failed.
    #[error("the other side is gone: {0}")]
    Pipe(#[from] io::Error),
}

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
struct ServeRequest {
    #[serde(default)]
    id: Value,
    #[serde(default)]
    hello: Option<ClientHello>,
    #[serde(default)]
    reset: Option<Value>,
    #[serde(default)]
    decide: Option<IndexMap<String, Value>>,
    #[serde(default)]
    sample: Option<Value>,
    #[serde(default)]
    close: Option<Value>,
}

#[derive(Deserialize)]
struct ClientHello {
    protocol: u32,
}

impl ServedAdo {
    /// Returns the ado of a run.
    ///
    /// # Errors
    /// Returns an error if the run has no policy, or its files are damaged.
    pub fn of(run: &RunDir) -> Result<ServedAdo, RunError> {
        let player = ServedPlayer::Trained(run.policy()?.into());
        Ok(ServedAdo::new(run.scenario()?, player))
    }

    /// Returns the ados of a world without a training.
    ///
    /// They act in judged episodes only.
    ///
    /// # Errors
    /// The world is a grid, the trained ado is requested, or a search would start a program
    /// without consent.
    pub fn untrained(world: Scenario, player: AdoPlayer) -> Result<ServedAdo, NotServed> {
        let name = world.name().to_owned();
        if world.drive().is_none() {
            return Err(NotServed::Grid { world: name });
        }
        let Some(served) = ServedPlayer::untrained(&world, player)? else {
            return Err(NotServed::NotTrained { world: name });
        };
        Ok(ServedAdo::new(world, served))
    }

    fn new(world: Scenario, player: ServedPlayer) -> ServedAdo {
        ServedAdo {
            player,
            decisions: 0,
            begun: 0,
            last: [world.spaces().neutral; 2],
            world,
            live: None,
            keep: None,
        }
    }

    /// Keeps the counterexamples among the judged episodes in a directory.
    ///
    /// It is created with the first of them.
    pub fn keep_in(self, dir: PathBuf) -> ServedAdo {
        ServedAdo {
            keep: Some(dir),
            ..self
        }
    }

    /// Returns the word for the player of the ados, such as `trained`.
    pub fn player(&self) -> &'static str {
        self.player.word()
    }

    /// Returns the world.
    pub fn world(&self) -> &Scenario {
        &self.world
    }

    /// Answers line after line until `close`, or until the other side ends.
    ///
    /// A message with a mistake is answered with an `error`, and the conversation goes on.
    ///
    /// # Errors
    /// Returns an error if a line is no message, or a pipe fails.
    pub fn serve(
        &mut self,
        requests: &mut impl BufRead,
        answers: &mut impl Write,
    ) -> Result<Served, ServeError> {
        let mut served = Served::default();
        let mut bytes = Vec::new();
        for line in 1.. {
            bytes.clear();
            let mut refuse = |why: String| {
                // The other side may be gone already, so a failed write is ignored.
                let _ = write_line(answers, &json!({ "error": why }));
                ServeError::NoMessage { line, why }
            };
            // One byte more is the end of the line, or shows that the limit is exceeded.
            let mut most = requests.by_ref().take(LONGEST + 1);
            if most.read_until(b'\n', &mut bytes)? == 0 {
                break;
            }
            let Some(request) = message(&bytes).map_err(&mut refuse)? else {
                continue;
            };
            if request.close.is_some() {
                break;
            }
            let answer = match self.answer(&request) {
                Ok(answer) => {
                    served.count(&answer);
                    answer
                }
                Err(why) => {
                    served.errors += 1;
                    Map::from_iter([("error".to_owned(), json!(why))])
                }
            };
            let mut numbered = Map::new();
            if !request.id.is_null() {
                numbered.insert("id".to_owned(), request.id);
            }
            numbered.extend(answer);
            write_line(answers, &Value::Object(numbered))?;
        }
        Ok(served)
    }

    fn answer(&mut self, request: &ServeRequest) -> Result<Map<String, Value>, String> {
        let answer = match request {
            ServeRequest {
                hello: Some(hello), ..
            } => {
                if hello.protocol == PROTOCOL {
                    json!({ "hello": description::hello(&self.world, self.player()) })
                } else {
                    let spoken = hello.protocol;
                    return Err(format!(
                        "protocol {spoken} is not spoken here: say hello with protocol {PROTOCOL}"
                    ));
                }
            }
            ServeRequest {
                reset: Some(reset), ..
            } => self.reset(reset)?,
            ServeRequest {
                sample: Some(sample),
                ..
            } => self.sample(sample)?,
            ServeRequest {
                decide: Some(signals),
                ..
            } => self.decide(signals)?,
            _ => return Err("known: hello, reset, decide, sample, close".to_owned()),
        };
        match answer {
            Value::Object(fields) => Ok(fields),
            // Invariant: every answer above is an object.
            _ => Ok(Map::new()),
        }
    }

    /// Begins an episode, which brakecheck judges if the request has a start.
    fn reset(&mut self, request: &Value) -> Result<Value, String> {
        // Cleared first, so that a refused request leaves no episode to go on with.
        self.decisions = 0;
        self.last = [self.world.spaces().neutral; 2];
        self.begun += 1;
        self.live = None;
        let request = ResetRequest::parse(request)?;
        let Some(live) = LiveEpisode::begin(&self.world, &request, &self.player)? else {
            // Without a start nothing is judged, and the simulator asks by `decide`.
            return Ok(json!({ "ready": true }));
        };
        let mut answer = live.beginning(&self.world);
        answer.extend(live.answer(&self.world));
        self.live = Some(live);
        Ok(Value::Object(answer))
    }

    /// Takes the next sample of a judged episode.
    fn sample(&mut self, request: &Value) -> Result<Value, String> {
        let Some(live) = &mut self.live else {
            return Err("a sample requires an episode: reset with `index` or `start`".to_owned());
        };
        live.sample(request)?;
        let mut answer = live.answer(&self.world);
        // A sample after the end is an error, so every episode is kept once at most.
        if let Some(dir) = self.keep.as_ref().filter(|_| live.is_counterexample()) {
            match home::keep(&self.world, live, dir) {
                Ok(kept) => {
                    answer.insert("kept".to_owned(), json!(kept.file.display().to_string()));
                    answer.insert("home_off_m".to_owned(), json!(kept.off_m));
                }
                Err(why) => {
                    answer.insert("not_kept".to_owned(), json!(why.to_string()));
                }
            }
        }
        Ok(Value::Object(answer))
    }

    /// Returns signals with the last actions of the ados, as they were answered.
    fn with_actions(&self, signals: &IndexMap<String, Value>) -> IndexMap<String, Value> {
        let mut all = signals.clone();
        let World::Drive(drive) = self.world.world() else {
            return all;
        };
        let mut unit = 1;
        // The first ado's action is the lowest digit of a joint action.
        for (name, actions, _) in drive.spec().action_sets() {
            for (signal, joint) in ["action_before", "action"].iter().zip(self.last) {
                let own = joint / unit % actions.len();
                all.entry(format!("{name}.{signal}")).or_insert(json!(own));
            }
            unit *= actions.len();
        }
        all
    }

    fn decide(&mut self, signals: &IndexMap<String, Value>) -> Result<Value, String> {
        let policy = self.player.policy()?;
        let world = self.world.world();
        let signals = with_derived(&self.world, &self.with_actions(signals))?;
        let clock = world.clock();
        let passed_s = self.decisions as f64 * clock.decision_s;
        let mut obs = Vec::with_capacity(world.observed().len());
        let mut missing = Vec::new();
        for observed in world.observed() {
            let name = observed.name.as_str();
            // Clocks of both sides agree, as long as the simulator asks at every decision.
            let value = match (signals.get(name), name) {
                (Some(value), _) => *value,
                (None, "time") => passed_s,
                // A simulator may go on beyond the horizon, where no time is left.
                (None, "time_left") => (clock.horizon_s - passed_s).max(0.0),
                (None, _) => {
                    missing.push(format!("`{name}`"));
                    continue;
                }
            };
            obs.push(observed.scaled(value));
        }
        // All missing signals are named at once, so that one look at the error suffices.
        if !missing.is_empty() {
            return Err(format!("the ado also observes {}", missing.join(", ")));
        }
        let action = match policy.drawn_at() {
            None => policy.act(&obs),
            Some(temperature) => {
                // A number per decision of an episode, so that a conversation can be repeated.
                let mut rng = draws(self.begun, self.decisions);
                policy.sample(&obs, temperature, &mut || rng.random::<f64>())
            }
        };
        self.decisions += 1;
        self.last = [self.last[1], action];
        let value = policy.value(&obs);
        Ok(json!({
            "action": action,
            "label": world.action_label(action),
            "ados": actions_of(world, action),
            "value": value.is_finite().then_some(value),
        }))
    }
}

impl Served {
    /// Counts a decision, or an episode that ended with this answer.
    ///
    /// A rule may be broken at the start, so `reset` may end an episode, too.
    fn count(&mut self, answer: &Map<String, Value>) {
        let holds = |key: &str| answer.get(key).is_some_and(|it| it == &json!(true));
        // Answers of a judged episode have an action, too, and `done` beside it.
        let is_judged = answer.contains_key("done");
        self.decisions += u64::from(answer.contains_key("action") && !is_judged);
        if holds("done") {
            self.episodes += 1;
            self.successes += u64::from(holds("is_success"));
            self.kept += u64::from(answer.contains_key("kept"));
        }
    }
}

/// Returns the value of a signal, given as a number or a truth value.
fn number(name: &str, value: &Value) -> Result<f64, String> {
    let value = match value {
        // Formulas read truth values as 0 and 1.
        Value::Bool(holds) => Some(f64::from(u8::from(*holds))),
        value => value.as_f64(),
    };
    value.ok_or_else(|| format!("`{name}` is no number"))
}

/// Returns the command of a joint action to each ado, in numbers.
///
/// A vehicle has `accel_mps2` and `lateral_mps`, a pedestrian `along_mps` and `left_mps`,
/// and a light `advance`. The weather has `friction_per_s`, `visibility_mps` and
/// `noise_per_s`, and a road `curvature_per_m`. An agent with a plan has `added_accel_mps2` and
/// `added_left_mps`, which are added to the plan. Actions on grids have labels only.
pub fn actions_of(world: &World, mut action: usize) -> Value {
    let World::Drive(drive) = world else {
        return json!({});
    };
    let mut ados = Map::new();
    for (name, actions, _) in drive.spec().action_sets() {
        // The first ado is the lowest digit, as in `with_actions`.
        let own = action % actions.len();
        action /= actions.len();
        ados.insert(name.to_owned(), in_numbers(actions, own));
    }
    Value::Object(ados)
}

fn in_numbers(actions: &Actions, action: usize) -> Value {
    match actions {
        // Every vehicle has the same keys, so one that keeps its lane has a lateral speed
        // of 0.
        Actions::Accelerations(list) => json!({ "accel_mps2": list[action], "lateral_mps": 0.0 }),
        Actions::Grid(grid) => {
            let (accel_mps2, lateral_mps) = grid.command(action);
            json!({ "accel_mps2": accel_mps2, "lateral_mps": lateral_mps })
        }
        Actions::Walks(list) => json!({ "along_mps": list[action].0, "left_mps": list[action].1 }),
        Actions::Rates(list) => json!(list[action]),
        Actions::Curvatures(list) => json!({ "curvature_per_m": list[action] }),
        Actions::Turns(list) => json!({ "acts": list[action] }),
        Actions::Phases(list) => json!({ "advance": list[action] == PhaseAction::Advance }),
        Actions::Deviate(added) => {
            let (accel_mps2, left_mps) = added.at(action);
            json!({ "added_accel_mps2": accel_mps2, "added_left_mps": left_mps })
        }
    }
}

/// Parses a line. `None`: it is blank.
fn message(line: &[u8]) -> Result<Option<ServeRequest>, String> {
    let content = line.strip_suffix(b"\n").unwrap_or(line);
    // Tested first, because a line that is cut at the limit may end within a character.
    if content.len() as u64 > LONGEST {
        return Err(format!("it is longer than {LONGEST} bytes"));
    }
    let text = std::str::from_utf8(content).map_err(|_| "it is not UTF-8".to_owned())?;
    if text.trim().is_empty() {
        return Ok(None);
    }
    // An object, since serde would take the fields in a list as well.
    serde_json::from_str::<Map<String, Value>>(text)
        .and_then(|fields| serde_json::from_value(Value::Object(fields)))
        .map(Some)
        .map_err(|error| {
            let is_number = ["NaN", "Infinity"].iter().any(|it| text.contains(it));
            let hint = if is_number {
                ": JSON has no NaN and no Infinity"
            } else {
                ""
            };
            format!("{error}{hint}")
        })
}

fn write_line(answers: &mut impl Write, answer: &Value) -> io::Result<()> {
    writeln!(answers, "{answer}")?;
    // The simulator waits for this line, and a pipe is buffered.
    answers.flush()
}
