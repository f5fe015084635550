//! Command that repeats the training of a run, and what it lacks to do so.

use super::report_args::shown;
use crate::natural::{NaturalTraining, motorway};
use crate::rl::LearnerConfig;
use crate::run_dir::{RequestedTraining, RunDir, counted, trained_naturally};
use crate::training::{PerAdoMode, TrainRequest};
use crate::visible::shell_word;
use crate::world::Scenario;

/// Most differences that a page lists.
const MOST_DIFFERENCES: usize = 5;

/// Returns the command that repeats a training, from the world file in the run.
///
/// Remarks follow if the command alone does not repeat it. They begin with `#`, so that a
/// shell skips them.
pub(super) fn training_command(run: &RunDir) -> Vec<String> {
    let manifest = run.manifest();
    let file = run.path().join("world.ron");
    // A world file that cannot be read is one of the differences listed below.
    let world = Scenario::load(&file).ok();
    let request = request(run);
    let limit = limit(run, world.as_ref());
    let requested = decisions(run, world.as_ref(), &request);
    let mut command = format!(
        "brakecheck train {} -o {} --seed {}",
        shell_word(&shown(&file)),
        // `train` refuses a directory that has a run, so this is another one.
        shell_word(&format!("runs/{}-again", manifest.world)),
        manifest.seed
    );
    let mut add = |option: &str, value: &str| {
        command.push_str(&format!(" {option} {}", shell_word(value)));
    };
    if let Some(decisions) = requested.decisions {
        add("--decisions", &decisions.to_string());
    }
    // Stated even if it is the world's, because a `brakecheck.toml` may name another.
    if let Some(plant) = request.plant {
        add("--plant", <&str>::from(plant));
    }
    if !manifest.against.is_nominal() {
        add("--against", manifest.against.word());
    }
    // The user's own controller has a name that no file explains.
    if let Some(ego) = manifest.ego.as_ref().filter(|ego| !ego.is_own()) {
        add("--ego", &ego.name);
    }
    if let Some(learner) = request.learner {
        add("--learner", learner);
    }
    if let Some(mode) = request.per_ado {
        add("--per-ado", <&str>::from(mode));
    }
    if let Some(structure) = &manifest.left_out {
        add("--leave-out", structure);
    }
    for goal in &manifest.goals {
        add("--goal", &goal.to_string());
    }
    if let Some(limit) = limit {
        // A model from a file is listed below, because its path is not known.
        if is_shipped(limit) {
            add("--traffic", "motorway");
        }
        add("--natural", &limit.per_1000_km.to_string());
    }
    let mut lines = vec![command];
    let mut lacks = lacks(run, world.as_ref());
    lacks.extend(requested.differences);
    if !lacks.is_empty() {
        lines.push("# This command alone does not repeat the training. It lacks:".to_owned());
        lines.extend(lacks.iter().map(|lack| format!("#   {lack}")));
    }
    lines
}

/// Returns the options of a training that its manifest states.
fn request(run: &RunDir) -> TrainRequest<'_> {
    let manifest = run.manifest();
    let settings = serde_json::from_value::<LearnerConfig>(manifest.settings.clone());
    // A family brings its own learner and plants, and refuses options for them.
    let is_nominal = manifest.against.is_nominal();
    TrainRequest {
        seed: Some(manifest.seed),
        learner: manifest.learner.as_deref().filter(|_| is_nominal),
        per_ado: settings
            .ok()
            .filter(|_| is_nominal)
            .and_then(|settings| PerAdoMode::of(&settings)),
        goals: (!manifest.goals.is_empty()).then_some(&*manifest.goals),
        against: manifest.against,
        leave_out: manifest.left_out.as_deref(),
        plant: manifest.plant.plant().filter(|_| is_nominal),
        ..TrainRequest::default()
    }
}

/// Returns the limit on the ado's driving that the world does not state itself.
fn limit<'a>(run: &'a RunDir, world: Option<&Scenario>) -> Option<&'a NaturalTraining> {
    let natural = run.manifest().natural.as_ref()?;
    let own = world.and_then(|world| NaturalTraining::of(world.traffic()));
    (own.as_ref() != Some(natural)).then_some(natural)
}

/// Returns whether a limit has the shipped traffic model.
fn is_shipped(limit: &NaturalTraining) -> bool {
    limit.traffic == motorway().to_ron()
}

/// Decisions to request, and how the training still differs from the run.
struct RequestedDecisions {
    decisions: Option<u64>,
    differences: Vec<String>,
}

/// Returns the decisions with which the request repeats the settings of the run.
fn decisions(
    run: &RunDir,
    world: Option<&Scenario>,
    request: &TrainRequest<'_>,
) -> RequestedDecisions {
    let decisions = Some(run.manifest().decisions);
    let Some(world) = world else {
        return RequestedDecisions {
            decisions,
            differences: vec!["a world file that can be read".to_owned()],
        };
    };
    let limited = TrainRequest {
        decisions,
        ..*request
    };
    let differences = differing(run, world, limited);
    // A requested number also ends a training that would go on beyond it.
    if !differences.is_empty() && differing(run, world, *request).is_empty() {
        return RequestedDecisions {
            decisions: None,
            differences: Vec::new(),
        };
    }
    RequestedDecisions {
        decisions,
        differences,
    }
}

/// Returns how a requested training differs from that of the run.
fn differing(run: &RunDir, world: &Scenario, request: TrainRequest<'_>) -> Vec<String> {
    let manifest = run.manifest();
    let limited = match &manifest.natural {
        // The manifest was read with the run, and its model is checked there.
        Some(natural) => trained_naturally(world, natural).unwrap_or_else(|_| world.clone()),
        None => world.clone(),
    };
    let scenario = match request.world(&limited) {
        Ok(scenario) => scenario,
        Err(error) => return vec![format!("options that fit the world: {error}")],
    };
    let requested = RequestedTraining {
        scenario: &scenario,
        seed: manifest.seed,
        ego: manifest.ego.as_ref(),
    };
    let found = match run.differences(requested) {
        Ok(found) => found,
        Err(error) => return vec![error.to_string()],
    };
    let mut listed: Vec<String> = found
        .iter()
        .take(MOST_DIFFERENCES)
        .map(|difference| format!("the setting of the run: {difference}"))
        .collect();
    if found.len() > MOST_DIFFERENCES {
        listed.push(counted(found.len() - MOST_DIFFERENCES, "more setting"));
    }
    listed
}

/// Returns what a training needs beside the options that its manifest states.
fn lacks(run: &RunDir, world: Option<&Scenario>) -> Vec<String> {
    let manifest = run.manifest();
    let file = |name: &str| shell_word(&shown(&run.path().join(name)));
    let mut lacks = Vec::new();
    if let Some(sha256) = &manifest.from_sha256 {
        lacks.push(format!(
            "--from RUN, which it was fine-tuned from: its policy is {} (SHA-256 {sha256})",
            file("from.safetensors")
        ));
    }
    if let Some(sha256) = &manifest.bank_sha256 {
        lacks.push(format!(
            "--bank RUN|DIR, which it learned from: the episodes are in {} (SHA-256 {sha256})",
            file("bank.json")
        ));
    }
    if let Some(sha256) = &manifest.known_sha256 {
        lacks.push(format!(
            "--distinct N, of which it is a later member: the known failures are in {} (SHA-256 \
             {sha256})",
            file("known.json")
        ));
    }
    if limit(run, world).is_some_and(|limit| !is_shipped(limit)) {
        lacks.push(format!(
            "--traffic FILE.ron, whose text is `natural.traffic` of {}",
            file("manifest.json")
        ));
    }
    if let Some(ego) = &manifest.ego {
        // A change under `reuse` is in the world of the run, so its name is enough.
        let is_listed = world.is_some_and(|it| it.reuse.get(&ego.name) == Some(&ego.change));
        if ego.is_own() {
            lacks.push(format!(
                "the ego {}, which is code and in no file of the run",
                shell_word(&ego.name)
            ));
        } else if !is_listed {
            lacks.push(format!(
                "a file for --ego, whose content is `ego.change` of {}",
                file("manifest.json")
            ));
        }
    }
    lacks
}
