//! Keeping the counterexamples of an evaluation or a search as files.
//!
//! Hundreds of counterexamples are as good as none to somebody who has to act on
//! them. [`CrashWriter::keep`] hands over a few: the worst that differ from each other
//! and persist, each made as small as it gets and labelled with what is known of
//! it ([`About`]).

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::minimize::shrink_within;
use super::perturbation_robustness::{persistence_within, variations};
use super::reruns::{KEEP_RUNS, Reruns};
use super::root_cause::{spans_asked, why, why_within};
use crate::adversary::{EvalRequest, Evaluated};
use crate::experiment::{CrashFeatures, badness, clusters, descending, worse_first};
use crate::experiment::{EpisodeLoop, Watch};
use crate::rulebook::Verdict;
use crate::run_dir::{About, Counterexample, KeptError, Severity, file_name, make_dir};
use crate::testbench::{Episode, Testbench};
use crate::world::{Change, Scenario};

/// Share of its variations in which a counterexample must fail to be handed over.
pub const PERSISTENT: f64 = 0.5;
/// So many times what is asked for is looked at, at most.
const LOOKS: usize = 5;

/// Which counterexamples are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrashSelection {
    /// At most so many: the worst that differ and persist.
    Worst(usize),
    /// Every one.
    All,
}

/// In which form they are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Made as small as they get ([`super::minimize::shrink`]).
    Shrunk,
    /// With the actions that were found.
    AsFound,
}

/// Which counterexamples are kept, in which form, at which cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeepSettings {
    /// Which ones.
    pub choice: CrashSelection,
    /// In which form.
    pub form: Form,
    /// Runs of an ego that cannot be copied, such as a program, that each may take.
    pub runs: u64,
}

impl KeepSettings {
    /// With [`KEEP_RUNS`] at most.
    pub fn new(choice: CrashSelection, form: Form) -> KeepSettings {
        KeepSettings {
            choice,
            form,
            runs: KEEP_RUNS,
        }
    }
}

/// Who made an ego fail, where; and how it is kept.
#[derive(Clone, Copy)]
pub struct CrashWriter<'a> {
    /// The world, with the ego that fails.
    pub scenario: &'a Scenario,
    /// What rows call that ego.
    pub ego: &'a str,
    /// How it differs from the world's own.
    pub change: &'a Change,
    /// The word for who plays the ados.
    pub ado: &'a str,
    /// Seed of the test starts.
    pub seed: u64,
    /// Which ones are kept, and how.
    pub settings: KeepSettings,
}

/// What was kept of the counterexamples that were found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptFiles {
    /// The files and what each says of itself, worst first.
    pub files: Vec<(PathBuf, About)>,
    /// Counterexamples that were found.
    pub found: usize,
    /// How many of them differ from each other.
    pub distinct: usize,
    /// Those looked at and passed over, since they do not persist.
    pub passed_over: usize,
    /// Files of the same ego in the directory that an earlier command left there.
    pub older: usize,
    /// Runs of the ego that all this took, if it is not a stock one.
    pub runs: u64,
}

impl KeptFiles {
    /// Says what was kept of an ego's counterexamples, and what each is.
    pub fn note(&self, ego: &str, dir: &Path, watch: &Watch<'_>) {
        for (file, about) in &self.files {
            let about = about.to_string().replace('\n', "\n  ");
            watch.note(&format!("{}:\n  {about}", file.display()));
        }
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
            some => format!("; minimized and labelled with {some} runs of it"),
        };
        watch.note(&format!(
            "kept {} of {} counterexamples of `{ego}` in {}: {} of them differ{passed_over}{older}{runs}",
            self.files.len(),
            self.found,
            dir.display(),
            self.distinct,
        ));
    }
}

/// A counterexample before it is looked at closely.
struct CrashCandidate {
    /// Position among the test starts.
    index: usize,
    shape: CrashFeatures,
    /// Contact, injury risk, closing speed, depth of the violation.
    badness: [f64; 4],
}

/// One that was looked at.
struct Labelled {
    index: usize,
    episode: Episode,
    about: About,
}

/// Plays the counterexample of a start again, as it was.
pub type Again<'a> = &'a (dyn Fn(&mut Testbench, usize) -> Episode + Sync);

/// What is known of an episode without comparing it to others or shrinking it.
pub fn about(scenario: &Scenario, episode: &Episode) -> About {
    let watch = Watch::unwatched();
    let reruns = Reruns::of(scenario, episode, KEEP_RUNS, &watch);
    about_within(&reruns, episode)
}

/// The same with an ego that is asked about more than that.
pub(super) fn about_within(reruns: &Reruns<'_>, episode: &Episode) -> About {
    // Persistence first: what does not persist is passed over.
    let persistence = persistence_within(reruns, episode);
    About {
        why: fails(episode).then(|| why_within(reruns, episode, None)),
        persistence,
        ego_runs: reruns.told(),
        ..seen_in(reruns.scenario(), episode)
    }
}

/// What is known of an episode from itself: no variation of it is played.
///
/// A cause is there only where the ego failed.
pub(super) fn about_of_run(scenario: &Scenario, episode: &Episode) -> About {
    About {
        why: fails(episode).then(|| why(scenario, episode, None)),
        ..seen_in(scenario, episode)
    }
}

fn fails(episode: &Episode) -> bool {
    matches!(
        episode.verdict,
        Verdict::Counterexample { .. } | Verdict::Uncounted { .. }
    )
}

/// What its contact did to the ego, and which drivers avoid it.
fn seen_in(scenario: &Scenario, episode: &Episode) -> About {
    About {
        severity: Severity::of(episode),
        preventability: episode
            .contact
            .is_some()
            .then(|| scenario.preventability(episode)),
        ..About::default()
    }
}

impl<'a> CrashWriter<'a> {
    /// Who keeps the counterexamples of an evaluation.
    pub fn of(
        request: &EvalRequest<'a>,
        change: &'a Change,
        settings: KeepSettings,
    ) -> CrashWriter<'a> {
        CrashWriter {
            scenario: request.scenario,
            ego: request.ego,
            change,
            ado: request.ado.word(),
            seed: request.starts.seed,
            settings,
        }
    }

    /// Plays the counterexamples of some starts again and keeps those that are
    /// asked for as `WORLD-EGO-PLANT-SEED-INDEX.ron`, samples beside them.
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
        make_dir(dir)?;
        let candidates = self.candidates(starts, again, watch);
        let shapes: Vec<CrashFeatures> = candidates.iter().map(|it| it.shape.clone()).collect();
        let clusters = clusters(&shapes);
        let mut kept = KeptFiles {
            found: candidates.len(),
            distinct: clusters.len(),
            ..KeptFiles::default()
        };
        let mut chosen = self.chosen((&candidates, &clusters), again, watch, &mut kept);
        // What was shrunk may have become a little less bad.
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
                ..Counterexample::record(scenario, ego, change, self.ado, &episode)
            };
            let stem = file_stem(scenario, ego, self.seed, index);
            let file = recorded.save_as(dir, &stem, &episode.trace)?;
            kept.files.push((file, about));
        }
        kept.older = self.older(dir, &kept);
        Ok(kept)
    }

    /// How many files of this ego were in the directory before.
    fn older(&self, dir: &Path, kept: &KeptFiles) -> usize {
        let of_ego = stem_of_ego(self.scenario, self.ego);
        let is_older = |path: &PathBuf| {
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            let is_kept = path.extension().is_some_and(|extension| extension == "ron");
            is_kept
                && stem.is_some_and(|stem| stem.starts_with(&of_ego))
                && !kept.files.iter().any(|(file, _)| file == path)
        };
        // A directory that cannot be listed was just written to: nothing is said.
        let files = std::fs::read_dir(dir).into_iter().flatten().flatten();
        files.map(|file| file.path()).filter(is_older).count()
    }

    /// Every start's counterexample, worst first.
    fn candidates(
        &self,
        starts: &[usize],
        again: Again<'_>,
        watch: &Watch<'_>,
    ) -> Vec<CrashCandidate> {
        let candidate = |bench: &mut Testbench, index: usize| {
            let episode = again(bench, index);
            // An ego that does not answer twice alike may not fail again.
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

    /// Those that are to be kept, looked at a few at a time.
    fn chosen(
        &self,
        (candidates, clusters): (&[CrashCandidate], &[Vec<usize>]),
        again: Again<'_>,
        watch: &Watch<'_>,
        kept: &mut KeptFiles,
    ) -> Vec<Labelled> {
        let (mut queue, most) = match self.settings.choice {
            CrashSelection::Worst(most) => (leaders(clusters), most),
            CrashSelection::All => (everybody(clusters), candidates.len()),
        };
        queue.truncate(LOOKS.saturating_mul(most));
        let mut queue = queue.into_iter();
        let (mut chosen, mut looked) = (Vec::new(), 0);
        watch.phase(match self.settings.form {
            Form::Shrunk => "minimizing and labelling counterexamples",
            Form::AsFound => "labelling counterexamples",
        });
        while chosen.len() < most && !watch.stopped() {
            let batch: Vec<_> = queue.by_ref().take(most - chosen.len()).collect();
            if batch.is_empty() {
                break;
            }
            looked += batch.len();
            let done = AtomicU64::new(chosen.len() as u64);
            let labelled: Vec<Labelled> = batch
                .par_iter()
                .map(|(at, size)| {
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
        // It holds a program, if the ego is one: one is enough.
        drop(bench);
        let reruns = Reruns::of(self.scenario, &found, self.settings.runs, watch);
        let (episode, mut known) = match self.settings.form {
            Form::AsFound => (found.clone(), about_within(&reruns, &found)),
            Form::Shrunk => self.shrunk(&reruns, &found),
        };
        known.cluster = Some(size);
        Labelled {
            index,
            episode,
            about: known,
        }
    }

    /// The shrunk one, or the found one if only that persists.
    fn shrunk(&self, reruns: &Reruns<'_>, found: &Episode) -> (Episode, About) {
        let varied = variations(self.scenario, found);
        let labels = varied + spans_asked(self.scenario, &found.actions);
        let (episode, shrunk) = shrink_within(reruns, found, reruns.at_most_half(labels));
        let small = about_within(reruns, &episode);
        let smaller = shrunk.after != shrunk.before;
        if smaller && !persists(&small) {
            let large = about_within(reruns, found);
            if persists(&large) {
                return (found.clone(), large);
            }
        }
        // Of an ego that is not asked nobody knows whether it could be smaller.
        let shrunk = (!reruns.is_refused()).then_some(shrunk);
        (episode, About { shrunk, ..small })
    }
}

fn persists(about: &About) -> bool {
    let persistence = about.persistence.as_ref();
    persistence.is_none_or(|persistence| PERSISTENT <= persistence.share())
}

/// The first of every cluster, with its size.
fn leaders(clusters: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let leaders = clusters.iter().map(|cluster| (cluster[0], cluster.len()));
    leaders.collect()
}

/// Everybody in order, with the size of their cluster.
fn everybody(clusters: &[Vec<usize>]) -> Vec<(usize, usize)> {
    let all = clusters.iter().flat_map(|cluster| {
        let members = cluster.iter();
        members.map(|at| (*at, cluster.len()))
    });
    let mut all: Vec<_> = all.collect();
    all.sort_unstable();
    all
}

/// Writes the first `most` counterexamples of an evaluation into a directory, as
/// they were found and without labels: a training's own.
///
/// Each is played again (episodes are pure functions of their start) and
/// written as `WORLD-EGO-PLANT-SEED-INDEX.ron` with its samples as `.csv` beside
/// it.
///
/// # Errors
/// The disk refuses.
pub fn keep(
    request: &EvalRequest<'_>,
    change: &Change,
    evaluated: &Evaluated,
    dir: &Path,
    most: usize,
) -> Result<Vec<PathBuf>, KeptError> {
    make_dir(dir)?;
    let mut bench = request.scenario.bench();
    let mut again = |bench: &mut Testbench, index| request.play(bench, index);
    let mut files = Vec::new();
    for index in evaluated.solved().take(most) {
        let episode = evaluated.again(request, &mut bench, index, &mut again);
        let ado = request.ado.word();
        let kept = Counterexample::record(request.scenario, request.ego, change, ado, &episode);
        let stem = file_stem(request.scenario, request.ego, request.starts.seed, index);
        files.push(kept.save_as(dir, &stem, &episode.trace)?);
    }
    Ok(files)
}

/// `WORLD-EGO-PLANT-SEED-INDEX`, with whatever could disturb a path replaced.
pub fn file_stem(scenario: &Scenario, ego: &str, seed: u64, index: usize) -> String {
    format!("{}{seed}-{index:04}", stem_of_ego(scenario, ego))
}

/// How the names of all files of an ego in a world begin.
fn stem_of_ego(scenario: &Scenario, ego: &str) -> String {
    let plant = format!("{:?}", scenario.plant()).to_lowercase();
    let (world, ego) = (file_name(scenario.name()), file_name(ego));
    format!("{world}-{ego}-{plant}-")
}
