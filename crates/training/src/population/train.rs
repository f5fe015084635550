//! Training of a population whose members fail the ego in different cells.
//!
//! The first member is an ordinary training, with the same bytes as without a
//! population. After each member, its failures enter an archive, and a search fills the
//! archive further. Every later member is shown the archive, and earns more for failures
//! of cells that are rare in it.

use std::path::Path;

use super::archive::FailureArchive;
use super::archive_search::{ArchiveSearch, CoveragePoint};
use super::directory::PopulationDir;
use super::error::PopulationError;
use super::manifest::{ArchiveSummary, PopulationOrigin};
use crate::experiment::Watch;
use crate::rl::Demonstration;
use crate::run_dir::{KnownFailures, RunDifference, RunDir, RunError};
use crate::training::{OptionClash, SessionError, TrainRequest, TrainSession, TrainingOutcome};
use crate::world::Scenario;

/// Failures of a training that enter the archive, evenly spread over the training.
const ABSORBED: usize = 2000;
/// Failures of the last member that the next one is shown, beside the archive.
const SHOWN: usize = 200;
/// Largest number of simulations of one search of the archive.
const MOST_SIMULATIONS: u64 = 300_000;

/// Request to train a population.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct DistinctRequest<'a> {
    /// Options of every member.
    pub training: TrainRequest<'a>,
    /// Number of members.
    pub members: usize,
}

impl<'a> DistinctRequest<'a> {
    /// Requests a number of members, all with the same options.
    pub fn new(training: TrainRequest<'a>, members: usize) -> DistinctRequest<'a> {
        DistinctRequest { training, members }
    }
}

/// Outcome of the training of a population.
#[derive(Clone, Debug, PartialEq)]
pub struct DistinctOutcome {
    /// Outcome of each member that was trained, finished or not.
    pub members: Vec<TrainingOutcome>,
    /// Occupied cells and failures after the last search, if there was one.
    pub archive: Option<ArchiveSummary>,
    /// Processor time of the searches of this process, in s.
    pub search_cpu_s: f64,
    /// True if it was stopped, which keeps all finished members.
    pub interrupted: bool,
}

/// Trains a population in a new directory, or continues one with `resume`.
///
/// # Errors
/// The world has no cells, the request does not fit it or the directory, or the disk
/// refuses.
pub fn train_distinct(
    world: &Scenario,
    path: &Path,
    request: &DistinctRequest<'_>,
    resume: bool,
    watch: &Watch<'_>,
) -> Result<DistinctOutcome, PopulationError> {
    DistinctSession::begin(world, path, request, resume)?.train(watch)
}

/// Population that was begun or opened again, before its training.
pub struct DistinctSession {
    training: DistinctTraining,
    first: TrainSession,
}

impl DistinctSession {
    /// Begins a population in a new directory, or opens one with `resume`.
    ///
    /// # Errors
    /// The world has no cells, the request does not fit it or the directory, or the disk
    /// refuses.
    pub fn begin(
        world: &Scenario,
        path: &Path,
        request: &DistinctRequest<'_>,
        resume: bool,
    ) -> Result<DistinctSession, PopulationError> {
        if world.drive().is_none() {
            return Err(PopulationError::Grid {
                world: world.name().to_owned(),
            });
        }
        // An archive holds failures of one ego, so the ego must not vary.
        if !request.training.against.is_nominal() {
            return Err(PopulationError::Family);
        }
        // A law has no preference for cells that no other member has reached.
        if request.training.traffic.is_some() {
            return Err(SessionError::Options(OptionClash::TrafficAndMany).into());
        }
        let (dir, first) = if resume {
            resumed(world, path, request)?
        } else {
            begun(world, path, request)?
        };
        let training = DistinctTraining {
            archive: archive_of(&dir)?,
            dir,
            outcome: DistinctOutcome {
                members: Vec::new(),
                archive: None,
                search_cpu_s: 0.0,
                // Every early return is that of a stopped training.
                interrupted: true,
            },
        };
        Ok(DistinctSession { training, first })
    }

    /// Trains the members that are not finished yet.
    ///
    /// # Errors
    /// A training fails, or the disk refuses.
    pub fn train(self, watch: &Watch<'_>) -> Result<DistinctOutcome, PopulationError> {
        let DistinctSession {
            mut training,
            mut first,
        } = self;
        for number in 0..training.dir.manifest().requested {
            let done = if number == 0 {
                training.member(0, &mut first, watch)?
            } else {
                let mut session = training.session(number, &first)?;
                training.member(number, &mut session, watch)?
            };
            // After each member, so that an interruption reports the archive it has.
            training
                .outcome
                .archive
                .clone_from(&training.dir.manifest().archive);
            if !done {
                return Ok(training.outcome);
            }
        }
        if !training.dir.manifest().finished {
            training.dir.finish()?;
        }
        training.outcome.interrupted = false;
        Ok(training.outcome)
    }
}

/// Begins a population and its first member.
fn begun(
    world: &Scenario,
    path: &Path,
    request: &DistinctRequest<'_>,
) -> Result<(PopulationDir, TrainSession), PopulationError> {
    let scenario = request.training.world(world)?;
    let origin = PopulationOrigin::Distinct {
        simulations: simulations(&scenario),
    };
    let seed = request.training.seed.unwrap_or(0);
    let dir = PopulationDir::create(path, &scenario, seed, origin, request.members)?;
    let session = TrainSession::begin(world, &dir.member_path(0), &request.training)?;
    Ok((dir, session))
}

/// Opens a population that was begun with the same options.
fn resumed(
    world: &Scenario,
    path: &Path,
    request: &DistinctRequest<'_>,
) -> Result<(PopulationDir, TrainSession), PopulationError> {
    let dir = PopulationDir::resume(path)?;
    let manifest = dir.manifest();
    let differs = |what: &str, begun: String, now: String| {
        Err(PopulationError::Run(RunError::Differs {
            path: path.into(),
            differences: vec![RunDifference {
                what: what.to_owned(),
                begun,
                now,
            }],
        }))
    };
    if !matches!(manifest.origin, PopulationOrigin::Distinct { .. }) {
        return differs("process", "league".to_owned(), "distinct".to_owned());
    }
    if manifest.requested != request.members {
        let (begun, now) = (manifest.requested, request.members);
        return differs("members", begun.to_string(), now.to_string());
    }
    // Without the recorded seed, a first member that is yet to begin would take seed 0.
    let training = TrainRequest {
        seed: request.training.seed.or(Some(manifest.seed)),
        ..request.training
    };
    let first = dir.member_path(0);
    // A process may be killed after the directory and before its first member.
    let session = if is_begun(&first)? {
        TrainSession::resume(world, &first, &training)?
    } else {
        TrainSession::begin(world, &first, &training)?
    };
    Ok((dir, session))
}

/// Returns whether the training of a member was begun.
///
/// # Errors
/// Its directory is damaged.
fn is_begun(member: &Path) -> Result<bool, RunError> {
    match RunDir::open(member) {
        Err(RunError::NotARun { .. }) => Ok(false),
        // A second beginning would only say that the directory exists.
        opened => opened.map(|_| true),
    }
}

/// Returns the simulations of one search of the archive.
///
/// A whole episode takes about as long as the learner needs for half of its decisions, so
/// that searches and trainings cost alike.
fn simulations(scenario: &Scenario) -> u64 {
    (scenario.learner.decisions() / 2).clamp(1, MOST_SIMULATIONS)
}

/// Returns the archive of a population, an empty one if it has none.
///
/// # Errors
/// Its file is missing or damaged.
pub fn archive_of(dir: &PopulationDir) -> Result<FailureArchive, RunError> {
    let Some(bytes) = dir.archive_bytes()? else {
        return Ok(FailureArchive::default());
    };
    let text = String::from_utf8_lossy(&bytes);
    let recorded = dir.manifest().archive.as_ref();
    FailureArchive::from_text(&text).map_err(|error| RunError::Damaged {
        // A search that was stopped leaves the file of an earlier number of members.
        path: recorded.map_or_else(|| dir.path().into(), |it| dir.path().join(&it.file)),
        why: error.to_string(),
    })
}

fn archive_name(members: usize) -> String {
    format!("archive-{members}.jsonl")
}

/// Population that is being trained.
struct DistinctTraining {
    dir: PopulationDir,
    archive: FailureArchive,
    outcome: DistinctOutcome,
}

impl DistinctTraining {
    /// Trains a member and fills the archive after it. Returns false if stopped.
    fn member(
        &mut self,
        number: usize,
        session: &mut TrainSession,
        watch: &Watch<'_>,
    ) -> Result<bool, PopulationError> {
        let members = self.dir.manifest().requested;
        watch.note(&format!("member {number:03}, {} of {members}", number + 1));
        let trained = session.train(watch)?;
        self.outcome.members.push(trained);
        if trained.interrupted {
            return Ok(false);
        }
        // After a resumption, earlier members are recorded already.
        if number == self.dir.manifest().members.len() {
            self.dir.add_member()?;
        }
        let searched = self.dir.manifest().archive.as_ref();
        // A later member, or the archive's name, shows that this search is done.
        if number + 1 < self.dir.manifest().members.len()
            || searched.is_some_and(|it| it.file == archive_name(number + 1))
        {
            return Ok(true);
        }
        self.search(number + 1, session, &watch.unnumbered())
    }

    /// Begins or resumes a later member.
    fn session(
        &self,
        number: usize,
        first: &TrainSession,
    ) -> Result<TrainSession, PopulationError> {
        let path = self.dir.member_path(number);
        // A begun member has stored the failures that it is shown.
        if is_begun(&path)? {
            let request = TrainRequest {
                seed: Some(self.dir.manifest().seed),
                ..TrainRequest::default()
            };
            return Ok(TrainSession::resume(first.world(), &path, &request)?);
        }
        // The archive has one failure per cell, the last member many of the cells it found.
        let archived = self.archive.iter().map(|known| Demonstration {
            index: known.index,
            actions: known.actions.clone(),
        });
        let last = RunDir::open(&self.dir.member_path(number - 1))?;
        let known = KnownFailures {
            cells: self.archive.counts(),
            demonstrations: archived.chain(spread(&failures(&last)?, SHOWN)).collect(),
        };
        Ok(first.begin_beyond(&path, &known)?)
    }

    /// Fills the archive after so many members. Returns false if stopped.
    fn search(
        &mut self,
        members: usize,
        session: &TrainSession,
        watch: &Watch<'_>,
    ) -> Result<bool, PopulationError> {
        watch.phase("filling the archive (simulations)");
        let scenario = session.ego().scenario();
        let PopulationOrigin::Distinct { simulations } = self.dir.manifest().origin else {
            // Invariant: another process is refused when its directory is opened.
            return Ok(false);
        };
        let before = self
            .dir
            .manifest()
            .archive
            .as_ref()
            .map_or(0, |archive| archive.simulations);
        let mut decisions = 0;
        // The curve is over the decisions of all members so far.
        for run in self.dir.members(members)? {
            decisions += run.manifest().decisions_done;
        }
        let seed = self.dir.manifest().seed;
        let Some(mut search) = ArchiveSearch::new(scenario, seed, watch) else {
            return Ok(false);
        };
        // A stopped search must leave the last archive unchanged.
        let mut archive = self.archive.clone();
        let mut lines = String::new();
        let mut note = |spent: u64, archive: &FailureArchive| {
            let point = CoveragePoint {
                members,
                decisions,
                simulations: before + spent,
                cells: archive.len(),
                failures: archive.failures(),
            };
            // Invariant: five numbers are always written.
            lines.push_str(&serde_json::to_string(&point).unwrap_or_default());
            lines.push('\n');
        };
        let found = spread(&failures(session.run())?, ABSORBED);
        let absorbed = search.absorb(&mut archive, &found, watch);
        // A point before the search shows what the training alone covered.
        note(search.cost.simulations, &archive);
        let round = members as u64;
        if !absorbed || !search.fill(&mut archive, round, simulations, &mut note, watch) {
            return Ok(false);
        }
        note(search.cost.simulations, &archive);
        self.archive = archive;
        self.outcome.search_cpu_s += search.cost.cpu_s;
        self.save(members, before + search.cost.simulations, &lines)?;
        Ok(true)
    }

    fn save(&mut self, members: usize, simulations: u64, lines: &str) -> Result<(), RunError> {
        let name = archive_name(members);
        let text = self.archive.to_text().map_err(|error| RunError::Damaged {
            path: self.dir.path().join(&name),
            why: error.to_string(),
        })?;
        // Lines precede the manifest that counts them, so a kill loses no counted line.
        self.dir.append_coverage(lines)?;
        let (cells, failures) = (self.archive.len(), self.archive.failures());
        self.dir
            .save_archive(&name, text.as_bytes(), |file, sha256| ArchiveSummary {
                cells,
                failures,
                simulations,
                file,
                sha256,
            })
    }
}

/// Returns the failures that a training has stored.
fn failures(run: &RunDir) -> Result<Vec<Demonstration>, RunError> {
    let stored = match run.counterexamples_so_far() {
        Err(RunError::NothingStored { .. }) => return Ok(Vec::new()),
        stored => stored?,
    };
    let all = stored.all().iter().map(|success| Demonstration {
        index: success.index,
        actions: success.actions.clone(),
    });
    Ok(all.collect())
}

/// Returns at most `most` items, evenly spread and including the last.
fn spread(all: &[Demonstration], most: usize) -> Vec<Demonstration> {
    let count = all.len().min(most);
    // The last failure is always among them, which is that of the best ado.
    let positions = (1..=count).map(|n| n * all.len() / count - 1);
    positions.map(|at| all[at].clone()).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::fs;
    use std::path::PathBuf;
    use std::sync::atomic::{AtomicBool, Ordering};

    use super::*;
    use crate::experiment::TrainingIntervals;
    use crate::rl::LearnerConfig;
    use crate::sim::PlantKind;

    fn world() -> Scenario {
        let world = Scenario::shipped("acc").expect("shipped").expect("sound");
        // The default learner uses demonstrations, and that of the world does not.
        let world = world.on(PlantKind::Kinematic);
        world.learning_with(LearnerConfig::default())
    }

    fn request() -> TrainRequest<'static> {
        TrainRequest {
            decisions: Some(1500),
            seed: Some(3),
            ..TrainRequest::default()
        }
    }

    fn train(path: &Path, resume: bool, watch: &Watch<'_>) -> DistinctOutcome {
        let request = DistinctRequest::new(request(), 2);
        train_distinct(&world(), path, &request, resume, watch).expect("trained")
    }

    /// A watch under which a short training has several lines and checkpoints.
    fn frequent(watch: Watch<'_>) -> Watch<'_> {
        Watch {
            intervals: TrainingIntervals {
                report_episodes: 7,
                checkpoint_decisions: 400,
            },
            ..watch
        }
    }

    /// Every file below a directory, without processor times.
    fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
        let (mut all, mut left) = (BTreeMap::new(), vec![dir.to_owned()]);
        while let Some(next) = left.pop() {
            for entry in fs::read_dir(next).expect("a directory").flatten() {
                let path = entry.path();
                if path.is_dir() {
                    left.push(path);
                } else if !path.ends_with("timing.json") {
                    let name = path.strip_prefix(dir).expect("below").to_owned();
                    all.insert(name, fs::read(path).expect("a file"));
                }
            }
        }
        all
    }

    #[test]
    fn a_population_has_the_same_bytes_on_any_threads_and_after_an_interruption() {
        let dir = tempfile::tempdir().expect("scratch");
        let (whole, broken) = (dir.path().join("whole"), dir.path().join("broken"));
        let trained = train(&whole, false, &frequent(Watch::unwatched()));
        assert!(!trained.interrupted && trained.members.len() == 2);
        let threads = rayon::ThreadPoolBuilder::new()
            .num_threads(3)
            .build()
            .expect("a pool");
        threads.install(|| {
            let stop = AtomicBool::new(false);
            let remarks = |remark: crate::experiment::Remark<'_>| {
                // In the middle of the second member, whose archive is there.
                let note = matches!(remark, crate::experiment::Remark::Line(line) if line.starts_with("member 001"));
                stop.fetch_or(note, Ordering::SeqCst);
            };
            let watch = Watch {
                remarks: &remarks,
                ..frequent(Watch::new(&|_, _| {}, &stop))
            };
            let stopped = train(&broken, false, &watch);
            assert!(stopped.interrupted && stopped.archive.is_some());
            assert_eq!(PopulationDir::open(&broken).expect("sound").manifest().members.len(), 1);
            assert!(!train(&broken, true, &frequent(Watch::unwatched())).interrupted);
        });
        let (whole, broken) = (files(&whole), files(&broken));
        let names: Vec<&PathBuf> = whole
            .keys()
            .filter(|it| whole.get(*it) != broken.get(*it))
            .collect();
        assert!(names.is_empty() && whole.len() == broken.len(), "{names:?}");
    }

    #[test]
    fn the_first_member_is_an_ordinary_training_and_the_second_sees_the_archive() {
        let dir = tempfile::tempdir().expect("scratch");
        let (path, alone) = (dir.path().join("population"), dir.path().join("alone"));
        let watch = frequent(Watch::unwatched());
        train(&path, false, &watch);
        let mut session = TrainSession::begin(&world(), &alone, &request()).expect("begun");
        session.train(&watch).expect("trained");
        let population = PopulationDir::open(&path).expect("sound");
        assert!(population.manifest().finished);
        assert_eq!(files(&population.member_path(0)), files(&alone));
        let members = population.members(9).expect("sound");
        let known = members[1]
            .known_failures()
            .expect("sound")
            .expect("an archive");
        assert!(known.cells.len() > 1 && known.demonstrations.len() > known.cells.len());
        // A copy has the archive, and one that was changed or deleted is damage.
        let copy = dir.path().join("copy");
        members[1].copy_to(&copy).expect("copied");
        assert!(RunDir::open(&copy).is_ok());
        fs::write(copy.join("known.json"), "{}").expect("written");
        assert!(RunDir::open(&copy).is_err());
        fs::remove_file(copy.join("known.json")).expect("removed");
        assert!(RunDir::open(&copy).is_err());
        let policies: Vec<Vec<u8>> = members
            .iter()
            .map(|member| member.policy_bundle().expect("finished"))
            .map(|it| it.to_bytes().expect("bytes"))
            .collect();
        assert_ne!(policies[0], policies[1]);
        let archive = archive_of(&population).expect("sound");
        assert!(
            archive.len() > known.cells.len(),
            "the last search adds cells"
        );
        let text = fs::read_to_string(path.join("coverage.jsonl")).expect("a file");
        let points: Vec<CoveragePoint> = text
            .lines()
            .map(|line| serde_json::from_str(line).expect("a point"))
            .collect();
        assert!(points.is_sorted_by_key(|point| (point.members, point.simulations, point.cells)));
        assert_eq!(points.last().map(|point| point.cells), Some(archive.len()));
    }

    #[test]
    fn grids_and_families_are_refused_and_a_population_continues_as_it_began() {
        let dir = tempfile::tempdir().expect("scratch");
        let path = dir.path().join("population");
        let grid = Scenario::shipped("grid").expect("shipped").expect("sound");
        let request = DistinctRequest::new(request(), 2);
        let watch = frequent(Watch::unwatched());
        let refused = train_distinct(&grid, &path, &request, false, &watch);
        assert!(matches!(refused, Err(PopulationError::Grid { .. })));
        assert!(!path.exists());
        let stopped = AtomicBool::new(true);
        let stop = Watch::new(&|_, _| {}, &stopped);
        let begun = train_distinct(&world(), &path, &request, false, &stop);
        assert!(begun.expect("begun").interrupted);
        let other = DistinctRequest::new(request.training, 3);
        let refused = train_distinct(&world(), &path, &other, true, &watch);
        let error = refused.expect_err("other members").to_string();
        assert!(error.contains("members: 2, now 3"), "{error}");
        let manifest = path.join("members/000/manifest.json");
        fs::write(manifest, "{}").expect("written");
        let refused = train_distinct(&world(), &path, &request, true, &watch);
        assert!(matches!(
            refused,
            Err(PopulationError::Run(RunError::Damaged { .. }))
        ));
    }

    #[test]
    fn failures_are_spread_evenly_with_the_last() {
        let all: Vec<Demonstration> = (0..10)
            .map(|index| Demonstration {
                index,
                actions: Vec::new(),
            })
            .collect();
        let indices = |most| -> Vec<u64> { spread(&all, most).iter().map(|it| it.index).collect() };
        assert_eq!(indices(3), [2, 5, 9]);
        assert_eq!(indices(20).len(), 10);
        assert!(spread(&[], 3).is_empty());
    }
}
