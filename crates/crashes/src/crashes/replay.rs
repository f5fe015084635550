//! Replay of a saved counterexample: bit for bit, or against a changed ego.

use std::path::PathBuf;

use serde::Serialize;
use strum::IntoStaticStr;

use super::replay_difference::{Difference, first_difference};
use super::save_crashes::{description, description_of_run};
use crate::ego::Fault;
use crate::report::outcome_in_words;
use crate::rulebook::Verdict;
use crate::run_dir::{About, Counterexample, KeptError, RunDir, RunError, StartRepeated};
use crate::scene::drive::EgoDrive;
use crate::testbench::{Aftermath, Episode, Replay, Success, play};
use crate::world::{Repeats, Scenario};

/// Counterexample with the file that holds it.
#[derive(Clone, Debug)]
pub struct SavedCounterexample {
    /// Path of the file.
    pub path: PathBuf,
    /// World, start, actions and verdict, as read.
    pub counterexample: Counterexample,
}

impl SavedCounterexample {
    /// Determines the labels again and writes the file with them and its hash.
    ///
    /// `episode` must be the recorded episode. The ego of `scenario` is run.
    /// The actions stay unchanged, as do the earlier labels of minimization and cluster.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn refine(&self, scenario: &Scenario, episode: &Episode) -> Result<About, KeptError> {
        // Minimization and cluster belong to the search that found the crash, and no
        // replay finds them again.
        let before = self.counterexample.about.clone().unwrap_or_default();
        let found = description(scenario, episode);
        let mut refined = About {
            shrunk: before.shrunk,
            cluster: before.cluster,
            ..found
        };
        // A recorded ego cannot answer new questions, so its earlier answers stay.
        if scenario.ego().is_some_and(EgoDrive::is_recorded) {
            refined.persistence = before.persistence;
            refined.ego_runs = before.ego_runs;
            if let (Some(why), Some(was)) = (&mut refined.why, before.why) {
                why.decisive = was.decisive;
                why.not_asked = was.not_asked;
            }
        }
        let current = Counterexample {
            about: Some(refined.clone()),
            contact: episode.contact.clone(),
            ..self.counterexample.as_now(scenario, episode)
        };
        current.save(&self.path, &episode.trace)?;
        Ok(refined)
    }
}

/// Result of a replay.
#[derive(Clone)]
pub struct Replayed {
    /// Path of the kept counterexample.
    pub path: PathBuf,
    /// The world, as it was replayed.
    pub scenario: Scenario,
    /// Episode of this run, or the representative of several runs.
    pub episode: Episode,
    /// True if verdict, robustness, contact, rules and every sample are as recorded.
    pub identical: bool,
    /// The first sample of this run that is not the recorded one.
    pub first_difference: Option<Difference>,
    /// True if the recorded commands of a foreign ego give the recorded bits.
    ///
    /// `None` if the file has no commands.
    pub repeats_by_commands: Option<bool>,
    /// True if a foreign ego gave the recorded commands.
    ///
    /// `None` if the file has no commands, or if the ego did not run.
    pub ego_as_recorded: Option<bool>,
    /// The runs, where the world asks for several.
    pub repeated: Option<StartRepeated>,
    /// Reason why no run of a foreign ego is a result, if there is one.
    pub unrepeatable: Option<Fault>,
    /// Labels of the file, if this is the recorded run.
    pub about: Option<About>,
}

impl Replayed {
    /// Returns whether this build gives the recorded bits.
    ///
    /// If the file has the ego's commands, they decide, whatever ego drives in this run.
    pub fn is_reproduced(&self) -> bool {
        self.repeats_by_commands.unwrap_or(self.identical)
    }

    /// Returns the labels of this run: those of the file, or its own.
    ///
    /// For another run these are severity, cause and preventability. Its persistence is
    /// unknown, because no variation of it is played.
    pub fn known(&self) -> About {
        let recorded = self.about.clone();
        recorded.unwrap_or_else(|| description_of_run(&self.scenario, &self.episode))
    }

    /// Returns the outcome of this run in a few words.
    pub fn in_words(&self) -> String {
        outcome_in_words(&self.scenario, &self.episode)
    }

    /// Returns the start of the difference from the recorded run, with its signal.
    ///
    /// `None` if this is the recorded run.
    pub fn departure(&self) -> Option<String> {
        match &self.first_difference {
            Some(difference) => Some(difference.since()),
            None if self.identical => None,
            None => Some("different from the recorded run in what its verdict says".to_owned()),
        }
    }

    /// Returns whether the ego still fails.
    pub fn still_fails(&self) -> bool {
        self.outcome() == ReplayOutcome::StillFails
    }

    /// Returns the outcome of the replay for the ego.
    pub fn outcome(&self) -> ReplayOutcome {
        // An ego that keeps state has a fault and a verdict.
        if self.fault().is_some() {
            return ReplayOutcome::Invalid;
        }
        match self.episode.verdict {
            Verdict::Counterexample { .. } => ReplayOutcome::StillFails,
            Verdict::Held { .. } | Verdict::Uncounted { .. } => ReplayOutcome::Fixed,
            Verdict::Foul { .. } => ReplayOutcome::NoAnswer,
            Verdict::Invalid => ReplayOutcome::Invalid,
        }
    }

    /// Returns the broken rule that leaves the replay without an answer, if any.
    pub fn no_answer(&self) -> Option<BrokenRuleOfReplay> {
        let Verdict::Foul { rule, .. } = self.episode.verdict else {
            return None;
        };
        let rule = self.scenario.rulebook().rules.get(rule)?;
        // The last judged sample decides. Rounding removes errors of binary fractions.
        let samples = self.episode.judged.saturating_sub(1) as f64;
        Some(BrokenRuleOfReplay {
            ado: rule.ado.clone(),
            rule: rule.name.clone(),
            time_s: (samples * self.episode.trace.dt_s() * 1e9).round() / 1e9,
        })
    }

    /// Returns the fault that makes the run invalid, if any.
    pub fn fault(&self) -> Option<&Fault> {
        if let Some(unrepeatable) = &self.unrepeatable {
            return Some(unrepeatable);
        }
        // A fault after the verdict leaves the result valid, so it does not count here.
        let invalid = self.episode.verdict == Verdict::Invalid;
        self.episode.fault.as_ref().filter(|_| invalid)
    }
}

/// Outcome of a replay for the ego.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum ReplayOutcome {
    /// The ego violates its specification with every rule kept, in a way that counts.
    StillFails,
    /// The ego does not fail, and every rule is kept.
    ///
    /// A violation that does not count in this world is no failure.
    Fixed,
    /// An ado breaks its rule first, so the question is open.
    NoAnswer,
    /// The ego or the physics did not run.
    Invalid,
}

impl ReplayOutcome {
    /// Returns the words of tables.
    pub fn words(self) -> &'static str {
        match self {
            ReplayOutcome::StillFails => "still fails",
            ReplayOutcome::Fixed => "fixed",
            ReplayOutcome::NoAnswer => "no answer",
            ReplayOutcome::Invalid => "did not run",
        }
    }
}

/// Rule of an ado that is broken before a replay gives an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BrokenRuleOfReplay {
    /// Name of the ado.
    pub ado: String,
    /// Name of its rule.
    pub rule: String,
    /// Time at which the rule is broken.
    pub time_s: f64,
}

impl std::fmt::Display for BrokenRuleOfReplay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} broke `{}` at {:.2} s",
            self.ado, self.rule, self.time_s
        )
    }
}

/// Number of replays by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ReplayCounts {
    /// All replays.
    pub replayed: usize,
    /// The ego still fails.
    pub still_fail: usize,
    /// The ego does not fail.
    pub fixed: usize,
    /// Replays of `fixed` in which it violates its specification, but not so that it counts.
    pub uncounted: usize,
    /// An ado breaks its rule first.
    pub no_answer: usize,
    /// The ego or the physics did not run.
    pub invalid: usize,
}

impl ReplayCounts {
    /// Counts replays.
    pub fn of(replayed: &[Replayed]) -> ReplayCounts {
        let mut counts = ReplayCounts {
            replayed: replayed.len(),
            ..ReplayCounts::default()
        };
        for one in replayed {
            let count = match one.outcome() {
                ReplayOutcome::StillFails => &mut counts.still_fail,
                ReplayOutcome::Fixed => &mut counts.fixed,
                ReplayOutcome::NoAnswer => &mut counts.no_answer,
                ReplayOutcome::Invalid => &mut counts.invalid,
            };
            *count += 1;
            let verdict = one.episode.verdict;
            counts.uncounted += usize::from(matches!(verdict, Verdict::Uncounted { .. }));
        }
        counts
    }
}

impl std::fmt::Display for ReplayCounts {
    /// Writes the counts in one line, and leaves out groups that are empty.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (still_fail, replayed, fixed) = (self.still_fail, self.replayed, self.fixed);
        write!(f, "{still_fail} of {replayed} still fail, {fixed} fixed")?;
        if self.uncounted > 0 {
            write!(
                f,
                " ({} violate it, but not so that it counts)",
                self.uncounted
            )?;
        }
        if self.no_answer > 0 {
            write!(f, ", {} without an answer", self.no_answer)?;
        }
        if self.invalid > 0 {
            write!(f, ", {} did not run", self.invalid)?;
        }
        Ok(())
    }
}

/// Plays the newest counterexamples of a training again, oldest first.
///
/// The `skipped` newest are left out, and at most `most` are played. The training may
/// still be running.
///
/// # Errors
/// The training stored none yet, or a file is damaged.
pub fn newest_of_training(
    run: &RunDir,
    skipped: usize,
    most: usize,
) -> Result<Vec<Replayed>, RunError> {
    let (scenario, stored) = (run.scenario()?, run.counterexamples_so_far()?);
    let noise = run.noise_of(&stored)?;
    let mut bench = scenario.bench();
    let all: Vec<(&Success, u64)> = stored.all().iter().zip(noise).collect();
    // Saturating, because a training may have stored fewer than are skipped.
    let until = all.len().saturating_sub(skipped);
    let newest = &all[until.saturating_sub(most)..until];
    let replayed = newest.iter().map(|(success, noise)| {
        let mut actor = Replay::holding(&success.actions);
        let episode = play(
            &mut bench,
            &success.start,
            *noise,
            &mut actor,
            Aftermath::Play,
        );
        Replayed {
            // No such file exists: the path names the episode in captions.
            path: run.path().join(format!("training-{}", success.index)),
            scenario: scenario.clone(),
            // Trainings store actions and no samples, so the verdict is all there is to
            // compare.
            identical: episode.verdict.is_success(),
            episode,
            first_difference: None,
            repeats_by_commands: None,
            ego_as_recorded: None,
            repeated: None,
            unrepeatable: None,
            about: None,
        }
    });
    Ok(replayed.collect())
}

/// Replays a kept counterexample in `scenario`.
///
/// # Errors
/// The start does not fit the world.
pub fn replay(kept: &SavedCounterexample, scenario: Scenario) -> Result<Replayed, KeptError> {
    let Repeats { runs, gate } = scenario.repeats;
    let mut episodes = (0..runs.max(1))
        .map(|_| once(kept, &scenario))
        .collect::<Result<Vec<_>, _>>()?;
    let (repeated, standing) = StartRepeated::of(&episodes, gate);
    let episode = episodes.swap_remove(standing);
    let recorded = &kept.counterexample;
    let commands = recorded.commands();
    // The world's side is judged by the recorded commands, whatever ego drives above.
    let again = match &commands {
        Some(commands) => {
            let world = recorded.scenario(&kept.path)?.with_commands(commands);
            let episode = once(kept, &world)?;
            Some((world, episode))
        }
        None => None,
    };
    let repeats_by_commands = match &again {
        Some((world, again)) => {
            let difference = first_difference(recorded, &kept.path, world, again)?;
            Some(difference.is_none() && recorded.is_of(again))
        }
        None => None,
    };
    let first_difference = first_difference(recorded, &kept.path, &scenario, &episode)?;
    let identical = first_difference.is_none() && recorded.is_of(&episode);
    Ok(Replayed {
        path: kept.path.clone(),
        identical,
        first_difference,
        repeats_by_commands,
        ego_as_recorded: commands.map(|commands| *commands == *episode.commands),
        repeated: (runs > 1).then_some(repeated),
        unrepeatable: None,
        // Labels in the file are valid for the recorded run only.
        about: recorded.about.clone().filter(|_| identical),
        scenario,
        episode,
    })
}

/// One run of a kept counterexample.
fn once(kept: &SavedCounterexample, scenario: &Scenario) -> Result<Episode, KeptError> {
    let recorded = &kept.counterexample;
    let start = recorded.start(scenario, &kept.path)?;
    let mut bench = scenario.bench();
    // Against a changed ego the episode may outlast the recording: coast then.
    let mut actor = Replay::then(&recorded.actions, bench.spaces().neutral);
    let noise = recorded.noise;
    Ok(play(&mut bench, &start, noise, &mut actor, Aftermath::Play))
}
