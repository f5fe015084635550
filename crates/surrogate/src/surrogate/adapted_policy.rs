//! Ado adapted to an ego: learned once, stored with the run, and planned start by start.

use std::fmt::{self, Display, Formatter};
use std::path::PathBuf;
use std::sync::Arc;

use serde::Serialize;

use super::learn::{Acts, LearnEgoRequest, LearnedEgo, LearnedFrom, learn_ego};
use super::model::{OUTPUTS, Surrogate};
use super::plan::Planner;
use super::planning_budget::PlanningBudget;
use super::strategy::{Earlier, Policies, Strategy};
use super::surrogate_error::SurrogateError;
use super::surrogate_fit::MEMBERS;
use crate::adversary::{EpisodeResult, EvalRequest, Evaluated, RepeatedEpisode, in_words};
use crate::content_hash::{fingerprint, sha256};
use crate::experiment::{EgoUnderTest, Watch, WorkItem};
use crate::rl::nn::Mlp;
use crate::rl::{BundleError, Policy, TensorFile, load_policy, load_policy_for};
use crate::ron_file::file_bytes;
use crate::run_dir::{AdversaryId, RunDir, RunError, make_dir, write_file};
use crate::scene::Start;
use crate::testbench::{Aftermath, NoisyStart, Replay, Testbench, play};
use crate::world::{DriveScenario, Scenario};

/// Row of planned runs, with the strategies that the ado followed.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct AdaptedRow {
    /// The row.
    pub evaluated: Evaluated,
    /// Starts on which the ado followed its trained policy throughout.
    pub(crate) as_trained: usize,
    /// Starts on which it followed the policy trained inside the surrogate throughout.
    /// `None`: no such policy was trained.
    pub(crate) trained_on: Option<usize>,
}

/// Record of a learned ego and of the ado's behaviour against it.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct AdaptedTo {
    /// Name of the ego, as in the rows.
    pub ego: String,
    /// Facts recorded while the ego was learned.
    #[doc(hidden)]
    #[serde(flatten)]
    pub learned: LearnedFrom,
    /// Way in which the ado acts.
    pub(crate) acts: Acts,
    /// The same in words, with the reason.
    pub how: String,
    /// Expected share of solved starts.
    pub expected: f64,
    /// 95 % interval of `expected`.
    pub expected_ci95: [f64; 2],
    /// Test starts on which the ado followed its trained policy throughout.
    pub(crate) starts_as_trained: usize,
    /// Test starts on which it followed the policy trained inside the surrogate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) starts_trained_on: Option<usize>,
}

impl AdaptedTo {
    /// Builds the record from the learned facts and the row of test starts.
    pub fn of(ego: &str, world: &Scenario, learned: &LearnedFrom, row: &AdaptedRow) -> AdaptedTo {
        let (expected, expected_ci95) = learned.expected(row.evaluated.row.starts);
        AdaptedTo {
            ego: ego.to_owned(),
            learned: learned.clone(),
            acts: learned.acts(),
            how: how(world, learned),
            expected,
            expected_ci95,
            starts_as_trained: row.as_trained,
            starts_trained_on: row.trained_on,
        }
    }
}

impl Display for AdaptedTo {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let LearnedFrom { runs, error, .. } = self.learned;
        write!(f, "`{}`: learned from {runs} runs of it", self.ego)?;
        if let Some(nearest) = self.learned.nearest.first() {
            write!(f, "; most like {nearest}")?;
        }
        if let Some(brake) = &self.learned.brake {
            write!(
                f,
                "; it {brake} (own speed v, the other's w, closing with c)"
            )?;
        }
        if let Some(error) = error {
            let SurrogateError {
                rms_m,
                keeps_acceleration_m,
            } = error;
            write!(
                f,
                "; two seconds ahead its surrogate is {rms_m:.2} m off, an ego that keeps its acceleration {keeps_acceleration_m:.2} m"
            )?;
            if !error.predicts_well() {
                f.write_str(": it hardly foresees the ego, so plans miss")?;
            }
        }
        let [low, high] = self.expected_ci95.map(|bound| 100.0 * bound);
        write!(
            f,
            "; the ado acts {}, expected to solve {:.0} % of the starts [{low:.0}, {high:.0}]; on {} it acted as trained throughout",
            self.how,
            100.0 * self.expected,
            self.starts_as_trained
        )?;
        match self.starts_trained_on {
            Some(starts) => write!(f, ", on {starts} as it learned to inside the surrogate"),
            None => Ok(()),
        }
    }
}

/// Describes how the ado acts and why.
fn how(world: &Scenario, learned: &LearnedFrom) -> String {
    let LearnedFrom {
        planned,
        planned_successes,
        ..
    } = learned;
    match (learned.acts(), &learned.fixed) {
        (Acts::Planned, None) => "start by start as it does best in the surrogate".to_owned(),
        (Acts::Planned, Some(tried)) => format!(
            "start by start as it does best in the surrogate, which solved {planned_successes} of {planned} recorded starts ({}: {} of {})",
            in_words(world, &tried.actions),
            tried.successes,
            tried.runs
        ),
        (Acts::AsTrained, _) => {
            "as it was trained, which does clearly better than planning".to_owned()
        }
        (Acts::OpenLoop, tried) => {
            let (actions, runs, successes) = tried.as_ref().map_or((&[][..], 0, 0), |tried| {
                (&tried.actions[..], tried.runs, tried.successes)
            });
            format!(
                "alike everywhere, {}, which solved {successes} of {runs} recorded starts (plans: {planned_successes} of {planned})",
                in_words(world, actions)
            )
        }
    }
}

/// Planner of one thread, with the bench of the real ego.
struct PlanningWorker<'a> {
    planner: Option<Planner<'a>>,
    bench: Testbench,
}

/// One start, played.
struct PlannedStart {
    played: EpisodeResult,
    /// Strategy that the ado followed from beginning to end.
    followed: Option<Strategy>,
}

impl LearnedEgo {
    /// Plans every start of `request` and plays it until its first success.
    ///
    /// A start gets at most `tries` runs. The ado of `request` must be `policy`.
    pub fn eval(
        &self,
        request: &EvalRequest<'_>,
        policy: &dyn Policy,
        tries: u64,
        watch: &Watch<'_>,
    ) -> AdaptedRow {
        let stored = self.fine_tuned.as_deref();
        // A stored policy that no longer loads is left out and the plans remain.
        let fine_tuned = stored.and_then(|stored| load_policy(stored).ok());
        let policies = Policies {
            as_trained: policy,
            fine_tuned: fine_tuned.as_deref(),
        };
        // A learned ego drives, so no start of a grid is played.
        let driving = request.scenario.drive();
        // Every thread has its own planner and bench, so starts share no state.
        let worker = || PlanningWorker {
            planner: driving.map(|driving| {
                let plant = self.from.judged_on;
                let budget = PlanningBudget::FULL;
                Planner::new(driving, &self.surrogate, plant, policies, budget, watch)
            }),
            bench: request.scenario.bench(),
        };
        let one = |worker: &mut PlanningWorker<'_>, from: &(Start, u64), turn: &WorkItem| {
            self.solve(request, worker, from, turn, tries, watch)
        };
        let all = request.starts.each(watch, worker, one);
        let followed_on = |strategy: Strategy| {
            let played = all.iter().flatten();
            played
                .filter(|one| one.followed.as_ref() == Some(&strategy))
                .count()
        };
        let as_trained = followed_on(Strategy::AsTrained);
        // Without such a policy the count is absent, not zero.
        let trained_on = policies
            .fine_tuned
            .map(|_| followed_on(Strategy::FineTuned));
        let played = all.into_iter().map(|one| Some(one?.played));
        // The row was filled for a plain evaluation, so ado and method are renamed here.
        let mut evaluated = Evaluated::of(request, played.collect(), watch);
        let row = &mut evaluated.row;
        // Rows of the policy itself keep its name, so both can be compared in a table.
        row.ado = AdversaryId::Adapted;
        row.method = match self.from.acts() {
            Acts::Planned => format!("planned in a surrogate of {} runs", self.from.runs),
            Acts::AsTrained => format!("{}, as trained", row.method),
            Acts::OpenLoop => in_words(request.scenario, self.open_loop_actions()),
        };
        if tries > 1 {
            row.method = format!("{}, at most {tries} tries", row.method);
        }
        AdaptedRow {
            evaluated,
            as_trained,
            trained_on,
        }
    }

    /// Returns the actions that are the same from every start.
    fn open_loop_actions(&self) -> &[usize] {
        let tried = self.from.fixed.as_ref();
        tried.map_or(&[], |tried| &tried.actions)
    }

    fn solve(
        &self,
        request: &EvalRequest<'_>,
        worker: &mut PlanningWorker<'_>,
        (start, noise): &(Start, u64),
        turn: &WorkItem,
        tries: u64,
        watch: &Watch<'_>,
    ) -> Option<PlannedStart> {
        let planner = worker.planner.as_mut()?;
        let bench = &mut worker.bench;
        let mut first: Option<PlannedStart> = None;
        let (mut simulations, mut physics_steps) = (0, 0);
        // The trained policy and fixed actions would repeat the same run.
        let acts = self.from.acts();
        let tries = if acts == Acts::Planned {
            tries.max(1)
        } else {
            1
        };
        let mut earlier = Earlier::default();
        for _ in 0..tries {
            // A stopped start keeps its finished runs.
            if watch.stopped() {
                break;
            }
            let from = NoisyStart {
                start,
                noise: *noise,
            };
            let (episode, followed) = match acts {
                Acts::Planned => {
                    let run = planner.run(bench, from, Aftermath::Play, &earlier);
                    let followed = run.followed_throughout().cloned();
                    let actions = run.so_far.actions.clone();
                    // The next try starts from the ego's motion recorded in this run.
                    earlier.add(run.so_far, followed.clone());
                    (bench.episode(start, *noise, actions), followed)
                }
                Acts::AsTrained => (request.play(bench, turn.index), Some(Strategy::AsTrained)),
                Acts::OpenLoop => {
                    let mut replay = Replay::holding(self.open_loop_actions());
                    let played = play(bench, start, *noise, &mut replay, Aftermath::Play);
                    (played, None)
                }
            };
            watch.faults.note(turn.index as u64, episode.fault.as_ref());
            simulations += 1;
            physics_steps += episode.physics_steps;
            let attempt = RepeatedEpisode::of(episode, simulations, physics_steps);
            let one = PlannedStart {
                played: attempt.played(request.scenario, turn.cpu_s()),
                followed,
            };
            // A success ends the tries, and its outcome counts every run up to here.
            if one.played.outcome.verdict.is_success() {
                return Some(one);
            }
            first.get_or_insert(one);
        }
        // An unsolved start keeps the outcome of its first run, with the cost of all runs.
        let mut unsolved = first?;
        unsolved.played.outcome.simulations = simulations;
        unsolved.played.outcome.physics_steps = physics_steps;
        Some(unsolved)
    }
}

/// Directory of learned egos in a run.
const DIR: &str = "learned";

/// Tensor with a whole bundle: the policy trained in the surrogate.
const FINE_TUNED: &str = "trained_on";
/// Tensor with the SHA-256 of the bundle without it, as digits.
const SEAL: &str = "seal";

/// Returns the stored learned ego of a request, or learns and stores it.
///
/// Only egos that are described by files are stored. Returns `None` as `learn_ego`
/// does.
///
/// # Errors
/// Returns an error if a file cannot be written.
pub fn learned(
    run: &RunDir,
    ego: &EgoUnderTest,
    request: &LearnEgoRequest<'_>,
    watch: &Watch<'_>,
) -> Result<Option<LearnedEgo>, RunError> {
    let Some(path) = path_of(run, ego, request) else {
        return Ok(learn_ego(request, watch));
    };
    if let Ok(bytes) = file_bytes(&path) {
        let (name, path) = (ego.name(), path.display());
        match read(&bytes, request.ego) {
            Ok(stored) => {
                watch.note(&format!("`{name}`: learned before ({path})"));
                return Ok(Some(stored));
            }
            // A damaged file is no reason to stop, because the ego can be learned again.
            Err(error) => watch.note(&format!("{path}: {error}; learned anew")),
        }
    }
    let found = learn_ego(request, watch);
    if let Some(found) = &found {
        make_dir(&run.path().join(DIR))?;
        let bytes = written(found).map_err(|error| RunError::Damaged {
            path: path.clone(),
            why: error.to_string(),
        })?;
        write_file(&path, &bytes)?;
    }
    Ok(found)
}

/// Returns the file of a request.
///
/// Its name is a hash of everything that the result depends on: the version, the world, the
/// ado, the ego, its plant and, for a program, its content.
/// `None`: the controller is in no file, and the next controller may differ.
fn path_of(run: &RunDir, ego: &EgoUnderTest, request: &LearnEgoRequest<'_>) -> Option<PathBuf> {
    if ego.is_own() {
        return None;
    }
    // An ego without a program has an empty list, and so keeps the name of its file.
    let content = ego.program_content().into_iter();
    let files: Vec<String> = content.map(|content| content.sha256).collect();
    let name = fingerprint(&serde_json::json!({
        "brakecheck": env!("CARGO_PKG_VERSION"),
        "world_sha256": run.manifest().world_sha256,
        "change": ego.change(),
        "plant": ego.scenario().plant(),
        "files_sha256": files,
        "asked": {
            "learned_for_policy_sha256": run.manifest().policy_sha256,
            "runs": request.runs,
            "seed": request.seed,
            "unknown": request.unknown,
            "learns_on": request.bundle.is_some(),
        },
    }));
    // Sixteen digits keep the name short, and two requests of a run
    // hardly ever share them.
    let path = run.path().join(DIR).join(&name[..16]);
    Some(path.with_extension("safetensors"))
}

fn written(learned: &LearnedEgo) -> Result<Vec<u8>, BundleError> {
    let from = serde_json::to_string(&learned.from).map_err(|error| BundleError::Format {
        why: error.to_string(),
    })?;
    let surrogate = &*learned.surrogate;
    let width = surrogate.mean.len();
    let mut bundle = TensorFile::new(from);
    bundle.put("mean", &[width], surrogate.mean.clone());
    bundle.put("inverse_sd", &[width], surrogate.inverse_sd.clone());
    bundle.put("unit", &[2], surrogate.unit.to_vec());
    bundle.put("range_mps2", &[2], surrogate.range_mps2.to_vec());
    for (i, member) in surrogate.members.iter().enumerate() {
        member.save(&format!("member/{i}"), &mut bundle);
    }
    if let Some(policy) = &learned.fine_tuned {
        let bytes = policy.to_bytes()?;
        bundle.put(FINE_TUNED, &[bytes.len()], bytes);
    }
    let seal = sha256(&bundle.to_bytes()?).into_bytes();
    bundle.put(SEAL, &[seal.len()], seal);
    bundle.to_bytes()
}

/// Returns the bundle if its seal matches, so any flipped bit is detected.
fn unsealed(bytes: &[u8]) -> Result<TensorFile, BundleError> {
    let sealed = TensorFile::from_bytes(bytes)?;
    let expected = sealed.rows::<u8>(SEAL, &[])?.to_vec();
    let bundle = sealed.without(SEAL);
    let found = sha256(&bundle.to_bytes()?);
    if found.as_bytes() == expected {
        Ok(bundle)
    } else {
        Err(BundleError::Mismatch {
            what: "its SHA-256",
            expected: String::from_utf8_lossy(&expected).into_owned(),
            found,
        })
    }
}

fn read(bytes: &[u8], world: DriveScenario<'_>) -> Result<LearnedEgo, BundleError> {
    let bundle = unsealed(bytes)?;
    let from: LearnedFrom =
        serde_json::from_str(bundle.meta()).map_err(|error| BundleError::Format {
            why: error.to_string(),
        })?;
    let members: Vec<Mlp> = (0..MEMBERS)
        .map(|i| Mlp::load(&format!("member/{i}"), &bundle))
        .collect::<Result<_, _>>()?;
    let width = super::surrogate_sim::width_of(world);
    for member in &members {
        // A file of another version may have other inputs, so the shape is checked on reading.
        if member.ends() != [width, OUTPUTS] {
            return Err(BundleError::Mismatch {
                what: "the surrogate",
                expected: format!("{width} inputs and {OUTPUTS} outputs"),
                found: format!("{:?}", member.ends()),
            });
        }
    }
    let unit = bundle.get::<f64>("unit", &[2])?;
    let range = bundle.get::<f64>("range_mps2", &[2])?;
    let surrogate = Surrogate {
        mean: bundle.get("mean", &[width])?.to_vec(),
        inverse_sd: bundle.get("inverse_sd", &[width])?.to_vec(),
        unit: [unit[0], unit[1]],
        range_mps2: [range[0], range[1]],
        nearest: from.nearest.clone().into(),
        members,
        brake: from.brake,
    };
    let fine_tuned = match bundle.shape(FINE_TUNED) {
        Some(_) => Some(TensorFile::from_bytes(bundle.rows::<u8>(FINE_TUNED, &[])?)?),
        None => None,
    };
    if let Some(policy) = &fine_tuned {
        // Loading once here reports a damaged policy before any start is planned.
        load_policy_for(world.spaces(), policy)?;
    }
    Ok(LearnedEgo {
        surrogate: Arc::new(surrogate),
        fine_tuned: fine_tuned.map(Arc::new),
        from,
    })
}
