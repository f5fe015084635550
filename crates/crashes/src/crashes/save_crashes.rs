//! Counterexamples of an evaluation or a search, kept as files.
//!
//! Hundreds of counterexamples are useless to a developer. [`CrashWriter::keep`] keeps a few:
//! the worst that are distinct and persistent. Each is minimized and labelled
//! ([`About`]).

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::minimize::shrink_within;
use super::perturbation_robustness::{persistence_within, variations};
use super::reruns::{KEEP_RUNS, Reruns};
use super::root_cause::{reconcile, span_runs, why, why_within};
use crate::experiment::{CrashFeatures, badness, clusters, descending, worse_first};
use crate::experiment::{EpisodeLoop, Watch};
use crate::rulebook::Verdict;
use crate::run_dir::{
    About, AdversaryId, Counterexample, KeptError, NoAnswer, Severity, Why, counted, file_name,
    make_dir,
};
use crate::search::ExperimentCell;
use crate::testbench::{Episode, Testbench, film_beyond};
use crate::world::{Change, Scenario};

/// Least share of variations in which a kept counterexample must fail.
pub const PERSISTENT: f64 = 0.5;
/// Candidates examined per counterexample to keep.
const LOOKS: usize = 5;

/// Selection of the counterexamples to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrashSelection {
    /// At most this many: the worst that are distinct and persistent.
    Worst(usize),
    /// All counterexamples.
    All,
}

/// Form of the kept counterexamples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Minimized: with fewer changes of action and as severe.
    Shrunk,
    /// With the actions that were found.
    AsFound,
}

/// Selection, form and cost of the kept counterexamples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeepSettings {
    /// Selection.
    pub choice: CrashSelection,
    /// Form.
    pub form: Form,
    /// Most runs per counterexample of an ego without copies, such as a program.
    pub runs: u64,
}

impl KeepSettings {
    /// Creates settings with 300 runs.
    pub fn new(choice: CrashSelection, form: Form) -> KeepSettings {
        KeepSettings {
            choice,
            form,
            runs: KEEP_RUNS,
        }
    }

    /// Keeps the actions that were found.
    pub fn as_found(self) -> KeepSettings {
        KeepSettings {
            form: Form::AsFound,
            ..self
        }
    }

    /// Limits the runs per counterexample of an ego without copies.
    pub fn runs(self, runs: u64) -> KeepSettings {
        KeepSettings { runs, ..self }
    }
}

/// Context of counterexamples to keep: world, ego, ado, seed and settings.
#[derive(Clone)]
pub struct CrashWriter<'a> {
    /// World with the ego that fails.
    pub scenario: &'a Scenario,
    /// Name of that ego in rows.
    pub ego: &'a str,
    /// Difference of that ego from the world's own.
    pub change: &'a Change,
    /// Adversary, which files name by its caption.
    pub ado: AdversaryId,
    /// Seed of the test starts.
    pub seed: u64,
    /// Selection, form and cost.
    pub settings: KeepSettings,
}

/// Files that were kept, and counts of the counterexamples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptFiles {
    /// Files with their labels, worst first.
    pub files: Vec<(PathBuf, About)>,
    /// Number of counterexamples that were found.
    pub found: usize,
    /// Number of distinct groups among them.
    pub distinct: usize,
    /// Number of examined counterexamples that do not persist.
    pub passed_over: usize,
    /// Files of the same ego that were in the directory before.
    pub older: usize,
    /// Runs of the ego for all of this, 0 for a stock ego.
    pub runs: u64,
}

impl KeptFiles {
    /// Reports the number of an ego's kept counterexamples.
    pub fn note(&self, ego: &str, dir: &Path, watch: &Watch<'_>) {
        let passed_over = match self.passed_over {
            0 => String::new(),
            some => format!("; {some} were passed over, since they do not persist"),
        };
        let older = match self.older {
            0 => String::new(),
            some => format!("; {some} more of it are there from earlier commands"),
        };
        let runs = match self.runs {
            0 => String::new(),
            some => format!(
                "; minimized and labelled with {} of it",
                counted(some, "run")
            ),
        };
        watch.note(&format!(
            "kept {} of {} of `{ego}` in {}: {} of them are distinct{passed_over}{older}{runs}",
            self.files.len(),
            counted(self.found, "counterexample"),
            dir.display(),
            self.distinct,
        ));
    }
}

/// Counterexample before its examination.
struct CrashCandidate {
    /// Position among the test starts.
    index: usize,
    shape: CrashFeatures,
    /// Contact, injury risk, closing speed, depth of the violation.
    badness: [f64; 4],
}

/// Counterexample after its examination.
struct Labelled {
    index: usize,
    episode: Episode,
    about: About,
}

/// Function that plays the counterexample of a start again.
pub(crate) type Again<'a> = &'a (dyn Fn(&mut Testbench, usize) -> Episode + Sync);

/// Returns the labels of an episode, without its group and its minimization.
pub fn description(scenario: &Scenario, episode: &Episode) -> About {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    description_within(&reruns, episode)
}

/// Labels an episode within the runs of `reruns`.
pub(super) fn description_within(reruns: &Reruns<'_>, episode: &Episode) -> About {
    // Persistence first, because runs may not suffice for all, and it decides on keeping.
    let persistence = persistence_within(reruns, episode);
    let why = fails(episode).then(|| why_within(reruns, episode, None));
    About {
        persistence,
        ego_runs: reruns.summary(),
        ..with_cause(why, seen_in(reruns.scenario(), episode))
    }
}

/// Returns the labels of a single run, without variations of it.
///
/// A cause exists only if the ego failed.
pub(super) fn description_of_run(scenario: &Scenario, episode: &Episode) -> About {
    let why = fails(episode).then(|| why(scenario, episode, None));
    with_cause(why, seen_in(scenario, episode))
}

/// Adds a cause that does not contradict the reference drivers.
fn with_cause(mut why: Option<Why>, seen: About) -> About {
    if let (Some(why), Some(panel)) = (&mut why, &seen.preventability) {
        reconcile(why, panel);
    }
    About { why, ..seen }
}

fn fails(episode: &Episode) -> bool {
    matches!(
        episode.verdict,
        Verdict::Counterexample { .. } | Verdict::Uncounted { .. }
    )
}

/// Returns the labels of a run that no variation is compared with.
///
/// They are the severity, the naturalness and the preventability.
pub fn labels_of_contact(scenario: &Scenario, episode: &Episode) -> About {
    seen_in(scenario, episode)
}

/// Returns the severity and the preventability of a contact.
fn seen_in(scenario: &Scenario, episode: &Episode) -> About {
    About {
        severity: Severity::of(episode),
        after_contact: episode.contact.as_ref().and_then(|_| {
            let mut bench = scenario.repeating(episode).bench();
            let after = film_beyond(&mut bench, episode).after;
            after.map(|after| after.motion)
        }),
        naturalness: scenario.naturalness_of(episode),
        preventability: episode
            .contact
            .is_some()
            .then(|| scenario.preventability(episode)),
        ..About::default()
    }
}

impl CrashWriter<'_> {
    /// Plays counterexamples again and keeps the selected ones as files.
    ///
    /// A file is `WORLD-EGO-PLANT-SEED-INDEX.ron`, with its samples beside it.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        &self,
        starts: &[usize],
        again: Again<'_>,
        dir: &Path,
        watch: &Watch<'_>,
    ) -> Result<KeptFiles, KeptError> {
        // The directory is made first, so a refusal of the disk costs no minutes of
        // minimization.
        make_dir(dir)?;
        let candidates = self.candidates(starts, again, watch);
        let shapes: Vec<CrashFeatures> = candidates.iter().map(|it| it.shape.clone()).collect();
        let clusters = clusters(&shapes);
        let mut kept = KeptFiles {
            found: candidates.len(),
            distinct: clusters.len(),
            ..KeptFiles::default()
        };
        let mut chosen = self.chosen(&candidates, &clusters, again, watch, &mut kept);
        // Minimization may have made a counterexample less severe, so the order can
        // change.
        chosen.sort_by(|a, b| worse_first(&a.episode, &b.episode).then(a.index.cmp(&b.index)));
        for labelled in chosen {
            let Labelled {
                index,
                episode,
                about,
            } = labelled;
            let (scenario, ego, change) = (self.scenario, self.ego, self.change);
            let recorded = Counterexample {
                about: Some(about.clone()),
                ..Counterexample::record(scenario, ego, change, self.ado.caption(), &episode)
            };
            let stem = file_stem(scenario, ego, self.seed, index);
            let file = recorded.save_as(dir, &stem, &episode.trace)?;
            kept.files.push((file, about));
        }
        // Counted after writing, because files of the same start are replaced and not
        // older.
        kept.older = self.older(dir, &kept);
        Ok(kept)
    }

    /// Returns the number of files of this ego that were in the directory before.
    fn older(&self, dir: &Path, kept: &KeptFiles) -> usize {
        let of_ego = stem_of_ego(self.scenario, self.ego);
        // Egos such as `a b` and `a-b` have one stem, so the content decides.
        let is_of_ego = |path: &Path| {
            let kept = Counterexample::load(path);
            kept.is_ok_and(|kept| kept.ego == self.ego && kept.world == self.scenario.name())
        };
        let is_older = |path: &PathBuf| {
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            let is_kept = path.extension().is_some_and(|extension| extension == "ron");
            is_kept
                // Seed and start vary between commands, so they are no part of the
                // comparison.
                && stem.is_some_and(|stem| stem.starts_with(&of_ego))
                && !kept.files.iter().any(|(file, _)| file == path)
                && is_of_ego(path)
        };
        // The directory was just written to. If it cannot be listed, nothing is reported.
        let files = std::fs::read_dir(dir).into_iter().flatten().flatten();
        files.map(|file| file.path()).filter(is_older).count()
    }

    /// Returns the counterexample of every start, worst first.
    fn candidates(
        &self,
        starts: &[usize],
        again: Again<'_>,
        watch: &Watch<'_>,
    ) -> Vec<CrashCandidate> {
        let candidate = |bench: &mut Testbench, index: usize| {
            let episode = again(bench, index);
            // An ego that is not deterministic may not fail again.
            episode.verdict.is_success().then(|| CrashCandidate {
                index,
                shape: CrashFeatures::of(self.scenario, &episode),
                badness: badness(&episode),
            })
        };
        watch.phase(&format!("playing counterexamples of {} again", self.ego));
        let played = EpisodeLoop::counted(watch, starts.len()).run(
            starts,
            || self.scenario.bench(),
            |bench, index, _| candidate(bench, *index),
        );
        let mut all: Vec<CrashCandidate> = played.into_iter().flatten().collect();
        all.sort_by(|a, b| descending(&a.badness, &b.badness).then(a.index.cmp(&b.index)));
        all
    }

    /// Returns the counterexamples to keep, examined in batches.
    fn chosen(
        &self,
        candidates: &[CrashCandidate],
        clusters: &[Vec<usize>],
        again: Again<'_>,
        watch: &Watch<'_>,
        kept: &mut KeptFiles,
    ) -> Vec<Labelled> {
        let (mut queue, most) = match self.settings.choice {
            CrashSelection::Worst(most) => (leaders(clusters), most),
            CrashSelection::All => (all_by_rank(clusters), candidates.len()),
        };
        // Each look costs as much as the labels of a kept file.
        queue.truncate(LOOKS.saturating_mul(most));
        let mut queue = queue.into_iter();
        let (mut chosen, mut looked) = (Vec::new(), 0);
        watch.phase(match self.settings.form {
            Form::Shrunk => "minimizing and labelling counterexamples",
            Form::AsFound => "labelling counterexamples",
        });
        while chosen.len() < most && !watch.stopped() {
            // A batch is as large as the number still missing, so few are examined in
            // vain.
            let batch: Vec<_> = queue.by_ref().take(most - chosen.len()).collect();
            if batch.is_empty() {
                break;
            }
            looked += batch.len();
            let done = AtomicU64::new(chosen.len() as u64);
            let labelled: Vec<Labelled> = batch
                .par_iter()
                .map(|(at, size)| {
                    // Candidates keep features and no episodes, since hundreds of traces
                    // would fill the memory.
                    let labelled = self.labelled(candidates[*at].index, *size, again, watch);
                    let done = 1 + done.fetch_add(1, Ordering::Relaxed);
                    (watch.progress)(done, most.min(candidates.len()) as u64);
                    labelled
                })
                .collect();
            let runs = labelled.iter().filter_map(|it| it.about.ego_runs.as_ref());
            kept.runs += runs.map(|runs| runs.runs).sum::<u64>();
            let all = self.settings.choice == CrashSelection::All;
            chosen.extend(labelled.into_iter().filter(|it| all || persists(&it.about)));
        }
        kept.passed_over = looked - chosen.len();
        chosen
    }

    fn labelled(&self, index: usize, size: usize, again: Again<'_>, watch: &Watch<'_>) -> Labelled {
        let mut bench = self.scenario.bench();
        let found = again(&mut bench, index);
        // The bench holds a running program, if the ego is one. A single program is
        // enough.
        drop(bench);
        let reruns = Reruns::of(self.scenario, &found, self.settings.runs, watch);
        let (episode, mut known) = match self.settings.form {
            Form::AsFound => (found.clone(), description_within(&reruns, &found)),
            Form::Shrunk => self.shrunk(&reruns, &found),
        };
        known.cluster = Some(size);
        Labelled {
            index,
            episode,
            about: known,
        }
    }

    /// Returns the minimized counterexample, or the found one if only that persists.
    fn shrunk(&self, reruns: &Reruns<'_>, found: &Episode) -> (Episode, About) {
        let varied = variations(self.scenario, found);
        let labels = varied + span_runs(self.scenario, &found.actions);
        // Half of the runs at most are reserved for the labels.
        let (episode, shrunk) = shrink_within(reruns, found, reruns.at_most_half(labels));
        let small = description_within(reruns, &episode);
        // A crash that became fragile by minimization is kept as it was found.
        let smaller = shrunk.after != shrunk.before;
        if smaller && !persists(&small) {
            let large = description_within(reruns, found);
            if persists(&large) {
                return (found.clone(), large);
            }
        }
        // Without runs of the ego it is unknown whether a smaller one exists.
        let shrunk = (!reruns.is_refused()).then_some(shrunk);
        (episode, About { shrunk, ..small })
    }
}

fn persists(about: &About) -> bool {
    let persistence = about.persistence.as_ref();
    persistence.is_none_or(|persistence| {
        let variations = persistence.variations.iter();
        // A broken rule gives no answer about the ego, but confirms no failure either.
        let ran = variations.filter(|one| {
            one.fails.is_some() || matches!(one.no_answer, Some(NoAnswer::RuleBroken { .. }))
        });
        // At least 1, so that a crash of which no variation ran does not pass with 0 of
        // 0.
        PERSISTENT * ran.count().max(1) as f64 <= persistence.failing() as f64
    })
}

/// Returns the first of every cluster, with the size of the cluster.
fn leaders(clusters: &[Vec<usize>]) -> Vec<(usize, usize)> {
    // Members are in the order of the candidates, so the first is the worst.
    let leaders = clusters.iter().map(|cluster| (cluster[0], cluster.len()));
    leaders.collect()
}

/// Returns all counterexamples in order, with the sizes of their clusters.
fn all_by_rank(clusters: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let mut all: Vec<_> = clusters
        .iter()
        .flat_map(|cluster| {
            let members = cluster.iter();
            members.map(|at| (*at, cluster.len()))
        })
        .collect();
    // Positions are ranks, so this order is worst first.
    all.sort_unstable();
    all
}

impl KeepSettings {
    /// Plays the successes of a cell again and keeps the selected ones as files.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn keep(
        self,
        cell: &ExperimentCell,
        dir: &Path,
        watch: &Watch<'_>,
    ) -> Result<KeptFiles, KeptError> {
        let writer = CrashWriter {
            scenario: cell.ego.scenario(),
            ego: cell.ego.name(),
            change: cell.ego.change(),
            ado: cell.adversary.clone(),
            seed: cell.starts.seed,
            settings: self,
        };
        let again = |bench: &mut Testbench, index: usize| cell.replay(bench, index);
        writer.keep(&cell.solved(), &again, dir, watch)
    }
}

/// Writes the first `most` successes of a cell as found, without labels.
///
/// A training uses this for its own counterexamples. The file of a start is
/// `WORLD-EGO-PLANT-SEED-INDEX.ron`, with its samples as `.csv`.
///
/// # Errors
/// The disk refuses.
pub fn keep_first(
    cell: &ExperimentCell,
    dir: &Path,
    most: usize,
) -> Result<Vec<PathBuf>, KeptError> {
    make_dir(dir)?;
    let (scenario, ego, change) = (cell.ego.scenario(), cell.ego.name(), cell.ego.change());
    let mut bench = scenario.bench();
    let mut files = Vec::new();
    for index in cell.solved().into_iter().take(most) {
        let episode = cell.replay(&mut bench, index);
        let ado = cell.adversary.caption();
        let kept = Counterexample::record(scenario, ego, change, ado, &episode);
        let stem = file_stem(scenario, ego, cell.starts.seed, index);
        files.push(kept.save_as(dir, &stem, &episode.trace)?);
    }
    Ok(files)
}

/// Keeps the selected successes of every cell as files and reports them.
///
/// # Errors
/// The disk refuses.
pub fn keep_cells(
    cells: &[ExperimentCell],
    dir: &Path,
    settings: KeepSettings,
    watch: &Watch<'_>,
) -> Result<Vec<KeptFiles>, KeptError> {
    let keep = |cell: &ExperimentCell| {
        let kept = settings.keep(cell, dir, watch)?;
        kept.note(cell.ego.name(), dir, watch);
        Ok(kept)
    };
    cells.iter().map(keep).collect()
}

/// Returns `WORLD-EGO-PLANT-SEED-INDEX` without characters that disturb a path.
pub fn file_stem(scenario: &Scenario, ego: &str, seed: u64, index: usize) -> String {
    format!("{}{seed}-{index:04}", stem_of_ego(scenario, ego))
}

/// Returns the common prefix of all files of an ego in a world.
fn stem_of_ego(scenario: &Scenario, ego: &str) -> String {
    let (world, ego) = (file_name(scenario.name()), file_name(ego));
    format!("{world}-{ego}-{}-", scenario.plant())
}

#[cfg(test)]
mod tests;
