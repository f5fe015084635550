//! Trained ados in a world file: their run is found and written into the text.
//!
//! `Trained(run: "runs/acc")` refers to a run, which a [`super::RunSource`]
//! finds. The scenario's text then has `Trained(run: Kept(…))` instead, with
//! the run's world and policy. Run directories and kept counterexamples of such
//! a world are therefore self-contained.

mod nested;
pub(super) mod rules;
pub(super) mod run;

use std::fmt;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use self::rules::HomeRulebook;
use self::run::{LoadedRun, opened};
use super::ado_actions::{self, ActsAs};
use super::check;
use super::runs::{InnerWorld, RunRefused, WorldOrigin, refused};
use super::starts::EntryPositions;
use crate::rl::{Policy, TensorFile, load_policy_for, policy_of_part};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::ron_file::{did_you_mean, known_names};
use crate::scene::drive::{Drive, DriveSpec, LightDrive, TrainedAdo, TrainedError};
use crate::world_file::{RulesFile, RunFile, TrainedFile};

/// Trained ado of a world file.
pub(super) struct OpenedAdo {
    pub(super) trained: TrainedAdo,
    /// Text that replaces its directory.
    pub(super) written_out: Option<(ValuePath, String)>,
    /// Its rules, if they are judged.
    pub(super) home: Option<HomeRulebook>,
}

/// Returns a trained ado.
///
/// `None` after a mistake, which is reported.
pub(super) fn open(
    problems: &mut Problems,
    path: &ValuePath,
    origin: WorldOrigin<'_>,
    trained: &TrainedFile,
    acts_as: ActsAs,
) -> Option<OpenedAdo> {
    let place = path.to("run");
    let made = opened(&trained.run, origin).and_then(|run| {
        // Nesting is checked first, since assembling a run recurses into its
        // world.
        nested::check(&run, origin)?;
        let made = made_from(&run, trained, origin)?;
        Ok((run, made))
    });
    let (run, (drive, home)) = match made {
        Ok(made) => made,
        Err(refused) => {
            problems.add(&place, refused.what, "this run", Some(refused.help));
            return None;
        }
    };
    if let Some(temperature) = trained.temperature {
        check::within(problems, &path.to("temperature"), temperature, 1e-6, 1e6);
    }
    if !ado_actions::fits(&drive.actions, acts_as) {
        let what = format!("{} cannot do what this ado does", acts_as.words());
        let help = "a vehicle takes a vehicle's place, a walker a walker's, a light a light's";
        problems.add(&place, what, "not its actions", Some(help.to_owned()));
        return None;
    }
    // A kept run is in the text already.
    let written_out = match &trained.run {
        RunFile::Directory(_) => Some((place, written(&run))),
        RunFile::Kept(_) => None,
    };
    let judged = trained.rules == RulesFile::Judged;
    Some(OpenedAdo {
        trained: drive,
        written_out,
        home: judged.then_some(home),
    })
}

fn made_from(
    run: &LoadedRun,
    file: &TrainedFile,
    origin: WorldOrigin<'_>,
) -> Result<(TrainedAdo, HomeRulebook), RunRefused> {
    let from = &run.from;
    let inner = world_of(run, origin)?;
    let world = &inner.world;
    let home = world.spec();
    let damaged = |error| {
        refused(
            format!("the policy of `{from}` is damaged: {error}"),
            "restore the run from a backup, or train again",
        )
    };
    let bundle = TensorFile::from_bytes(&run.policy).map_err(damaged)?;
    let part = part_of(from, home, file.part.as_deref())?;
    let mut training_world = home.training_world();
    let policy = match home.action_sets().count() {
        // The policy is checked against the spaces of its own world, where it was
        // trained.
        1 => load_policy_for(world.spaces(), &bundle).map_err(damaged)?,
        ados => {
            let own = policy_of_part(world.spaces(), &bundle, &part).map_err(damaged)?;
            let Some((spaces, policy)) = own else {
                return Err(refused(
                    format!("the run `{from}` has {ados} ados with one common policy"),
                    "train them with `train --per-ado independent`, which gives each its own",
                ));
            };
            // The policy reads its own part of the observation only.
            let observed = spaces.observed.iter().map(|&at| home.observe[at].clone());
            training_world.observe = observed.collect();
            policy
        }
    };
    let actions = home.action_sets().find(|(name, ..)| *name == part);
    // Invariant: `part_of` names one of them.
    let Some((_, actions, neutral)) = actions else {
        return Err(refused(format!("the run `{from}` has no `{part}`"), ""));
    };
    let rules = HomeRulebook::of(&inner, &part);
    let trained = TrainedAdo {
        lag_s: lag_s(home, &part),
        actions: actions.clone(),
        part,
        policy: Arc::<dyn Policy>::from(policy),
        home: Arc::new(training_world),
        names: file.names.0.clone(),
        neutral,
        temperature: file.temperature,
        judged: file.rules == RulesFile::Judged,
        idle: false,
    };
    Ok((trained, rules))
}

/// Returns the ado of a run that is placed.
fn part_of(from: &str, home: &DriveSpec, part: Option<&str>) -> Result<String, RunRefused> {
    let names: Vec<&str> = home.action_sets().map(|(name, ..)| name).collect();
    match (part, &names[..]) {
        (None, [only]) => Ok((*only).to_owned()),
        (Some(part), _) if names.contains(&part) => Ok(part.to_owned()),
        (None, _) => Err(refused(
            format!("the run `{from}` has {} ados", names.len()),
            &format!("choose one: {}", known_parts(&names)),
        )),
        (Some(part), _) => Err(refused(
            format!("the run `{from}` has no ado `{part}`"),
            &format!("choose one: {}", known_parts(&names)),
        )),
    }
}

fn known_parts(names: &[&str]) -> String {
    let parts: Vec<String> = names.iter().map(|it| format!("`part: \"{it}\"`")).collect();
    parts.join(" or ")
}

/// Returns the lag of an ado, 0 for a light.
fn lag_s(home: &DriveSpec, part: &str) -> f64 {
    let agent = home.agents.iter().find(|agent| agent.name == part);
    match agent.map(|agent| &agent.drive) {
        Some(Drive::Ado { lag_s, .. }) => *lag_s,
        _ => 0.0,
    }
}

/// Returns the run's world.
///
/// Trial runs are omitted, because they took place before its training.
fn world_of(run: &LoadedRun, origin: WorldOrigin<'_>) -> Result<InnerWorld, RunRefused> {
    let name = run.world_name();
    // Runs of the inner world are searched beside the inner file.
    let inner = WorldOrigin {
        file: &name,
        ..origin
    };
    let help = "this version cannot use it: train again";
    let unusable = |what: &dyn fmt::Display| refused(format!("the world of a run: {what}"), help);
    // One problem is enough, since the author cannot change the world of a run.
    let first = |problems: Vec<super::Problem>| match problems.first() {
        Some(problem) => unusable(&format!("{name}: {}", problem.what)),
        None => unusable(&name),
    };
    let world = (origin.assemble)(inner, &run.world).map_err(first)?;
    world.ok_or_else(|| {
        refused(
            format!("the run `{}` is of a grid", run.from),
            "only ados of driving worlds can be placed in one",
        )
    })
}

/// Returns a text as a raw string of RON.
pub(super) fn raw_text(text: &str) -> String {
    // A raw string needs more hashes than follow any quote inside it.
    let hashes = text.split('"').skip(1);
    let leading = hashes.map(|after| after.len() - after.trim_start_matches('#').len());
    let longest = leading.max().map_or(0, |most| most + 1);
    let hashes = "#".repeat(longest.max(1));
    format!("r{hashes}\"{text}\"{hashes}")
}

/// Run as a single RON value.
fn written(run: &LoadedRun) -> String {
    format!(
        "Kept(from: {}, world: {}, policy: \"{}\")",
        raw_text(&run.from),
        raw_text(&run.world),
        STANDARD.encode(&run.policy)
    )
}

/// Replaces values in a text.
pub(super) fn with_values(text: &str, values: &[(ValuePath, String)]) -> String {
    let mut places: Vec<(std::ops::Range<usize>, &String)> = values
        .iter()
        .map(|(path, value)| (path.find(text), value))
        .collect();
    // From the end to the start, so that earlier spans stay valid.
    places.sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    let mut text = text.to_owned();
    for (span, value) in places {
        text.replace_range(span, value);
    }
    text
}

/// Checks that all trained ados can act in a world.
pub(super) fn check(
    problems: &mut Problems,
    list: &ValuePath,
    spec: &DriveSpec,
    entries: EntryPositions<'_>,
) {
    let agents = spec
        .agents
        .iter()
        .zip(entries.agents)
        .filter_map(|(agent, entry)| match &agent.drive {
            Drive::Trained(trained) => Some((&agent.name, trained, *entry)),
            _ => None,
        });
    let lights = spec
        .lights
        .iter()
        .zip(entries.lights)
        .filter_map(|(light, entry)| match &light.drive {
            LightDrive::Trained(trained) => Some((&light.name, trained, *entry)),
            _ => None,
        });
    for (name, trained, entry) in agents.chain(lights) {
        if let Err(error) = trained.fits(spec, name) {
            let drive = list.at(entry).to("drive");
            let (place, label, help) = explained(&drive, &error);
            problems.add(&place, error.to_string(), label, help);
        }
    }
}

/// Place, label and fix of an ado that does not fit.
fn explained(drive: &ValuePath, error: &TrainedError) -> (ValuePath, &'static str, Option<String>) {
    let names = drive.to("names");
    let guessed = |written: &str, known: &[String]| {
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        let list = known_names("known", known.iter().copied());
        match did_you_mean(written, known) {
            Some(guess) => format!("{guess} — {list}"),
            None => list,
        }
    };
    match error {
        TrainedError::Period { decision_s, .. } => {
            let help = format!("give `clock` a sample that divides {decision_s} s");
            (drive.to("run"), "other decision times", Some(help))
        }
        TrainedError::UnknownAgent { name, .. } => {
            let help = format!("say who plays that part: `names: {{\"{name}\": \"…\"}}`");
            (drive.clone(), "lacks a part", Some(help))
        }
        TrainedError::Stranger { name, known } => {
            (names.to(name), "this part", Some(guessed(name, known)))
        }
        TrainedError::Unknown { part, name, known } => {
            (names.to(part), "unknown", Some(guessed(name, known)))
        }
        TrainedError::Kind { part, .. } => (names.to(part), "not of its kind", None),
        TrainedError::Itself { part, .. } => {
            let help = "leave this entry out".to_owned();
            (names.to(part), "its own part", Some(help))
        }
        TrainedError::Schema(_) | TrainedError::Derived(_) => {
            (drive.to("run"), "its signals", None)
        }
    }
}
