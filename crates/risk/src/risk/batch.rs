//! Batches of runs, played in parallel and stored piece by piece.

use std::path::{Path, PathBuf};

use super::mixture::Mixture;
use super::natural_counts::{JUDGED, NaturalCounts};
use super::natural_runs::LANES;
use super::record::{KnownFailure, RiskRun};
use super::run::{EpisodeSource, Order, RiskWorld};
use super::run_file::{self, PieceId};
use crate::experiment::{EpisodeLoop, Watch};
use crate::run_dir::{PROGRAMS, RunError, is_unfinished, make_dir, write_file};
use crate::testbench::Testbench;

/// File with the digest of the request whose runs a directory has.
const REQUEST: &str = "request.sha256";
/// Runs of a piece, which is stored as a whole.
const PIECE: usize = 500;
/// Runs of a round in which failures are assessed for preventability.
const ASSESSED: usize = 4000;

/// Content of a batch.
#[derive(Clone, Copy)]
pub(super) enum Content<'a> {
    /// Natural runs, of which the first are judged by the rules.
    Natural(usize),
    /// Random actions, each held for one of some numbers of decisions.
    Exploring(usize),
    /// Draws from the mixture, in proportion to its shares.
    Round(usize),
    /// Counterexamples from elsewhere.
    Known(&'a [KnownFailure]),
    /// Scripts of a search.
    Scripts(&'a [KnownFailure]),
}

/// Returns the distance of the draws of a round whose failures are assessed.
pub(super) fn assessed_step(draws: usize) -> usize {
    // An assessment replays the failure, so a large round assesses an even part.
    draws.div_ceil(ASSESSED).max(1)
}

/// Player of batches for one ego.
pub(super) struct Player<'a> {
    pub(super) world: RiskWorld,
    /// True if natural runs can be played side by side.
    pub(super) has_lanes: bool,
    pub(super) seed: u64,
    /// Digest of the request.
    pub(super) request: String,
    /// Name of the ego's files.
    pub(super) name: String,
    /// Directory of finished pieces, if they are stored.
    pub(super) dir: Option<PathBuf>,
    pub(super) watch: &'a Watch<'a>,
}

impl Content<'_> {
    fn len(&self) -> usize {
        match self {
            Content::Natural(n) | Content::Exploring(n) | Content::Round(n) => *n,
            Content::Known(known) | Content::Scripts(known) => known.len(),
        }
    }

    /// Returns the kind of the runs, as stored pieces have it.
    fn word(&self) -> &'static str {
        match self {
            Content::Natural(_) => "natural",
            Content::Exploring(_) => "exploring",
            Content::Round(_) => "round",
            Content::Known(_) => "known",
            Content::Scripts(_) => "scripts",
        }
    }
}

impl Player<'_> {
    /// Plays a batch. `None`: stopped.
    ///
    /// # Errors
    /// The disk refuses, or a stored piece is damaged or of other runs.
    pub(super) fn play(
        &self,
        stage: u64,
        content: Content<'_>,
        mixture: &Mixture,
    ) -> Result<Option<Vec<RiskRun>>, RunError> {
        let mut all = Vec::with_capacity(content.len());
        let played = self.play_pieces(stage, content, mixture, |piece| all.extend(piece))?;
        Ok(played.map(|()| all))
    }

    /// Counts natural runs. `None`: stopped.
    ///
    /// # Errors
    /// As [`Player::play`].
    pub(super) fn count(
        &self,
        stage: u64,
        runs: usize,
        mixture: &Mixture,
    ) -> Result<Option<NaturalCounts>, RunError> {
        let mut counts = NaturalCounts::default();
        let content = Content::Natural(runs);
        let played = self.play_pieces(stage, content, mixture, |piece| counts.add(piece))?;
        Ok(played.map(|()| counts))
    }

    /// Plays a batch, or reads its finished pieces, and uses each. `None`: stopped.
    fn play_pieces(
        &self,
        stage: u64,
        content: Content<'_>,
        mixture: &Mixture,
        mut used: impl FnMut(Vec<RiskRun>),
    ) -> Result<Option<()>, RunError> {
        let total = content.len();
        // Allocated for the whole batch, so that a piece does not depend on
        // those played before.
        let components = mixture.allocation(total);
        for first in (0..total).step_by(PIECE) {
            let items: Vec<usize> = (first..total.min(first + PIECE)).collect();
            let id = self.piece(stage, &content, first, items.len());
            let file = self.file(&id);
            let stored = file.as_deref().map(|file| run_file::read(&id, file));
            if let Some(piece) = stored.transpose()?.flatten() {
                // A resumed verb ends as one that was not killed.
                for (index, run) in (first as u64..).zip(&piece) {
                    self.watch.faults.note_stored(index, run.fault());
                }
                used(piece);
                continue;
            }
            let work = EpisodeLoop::counted_from(self.watch, first, total);
            let order = |index: usize| self.order(stage, index, &content, components[index]);
            let is_counted = matches!(content, Content::Natural(_));
            // The first natural runs are judged by the rules, of which lanes know nothing.
            let piece = if is_counted && self.has_lanes && first >= JUDGED {
                let piece = self.lanes_piece(mixture, &items, order);
                (self.watch.progress)((first + items.len()) as u64, total as u64);
                piece
            } else {
                let bench = || self.world.scenario.bench();
                let runs = work.each(&items, bench, |bench, index, _| {
                    Some(self.one(bench, mixture, &order(*index), is_counted))
                });
                runs.into_iter().collect()
            };
            let Some(piece) = piece else {
                return Ok(None);
            };
            // Only whole pieces are stored, so a killed process repeats one piece at
            // most.
            if let Some(file) = file {
                write_file(&file, &run_file::bytes(&id, &piece, &file)?)?;
            }
            used(piece);
        }
        Ok(Some(()))
    }

    /// Plays a run on a bench. `is_counted`: only its failure is of use.
    fn one(
        &self,
        bench: &mut Testbench,
        mixture: &Mixture,
        order: &Order<'_>,
        is_counted: bool,
    ) -> RiskRun {
        let mut run = self.world.play(bench, mixture, order);
        if is_counted && run.failure().is_none() {
            // Millions of them are counted, and nothing is learned from them.
            (run.actions, run.inputs, run.laws) = Default::default();
        }
        self.watch.faults.note(order.index, run.fault());
        run
    }

    /// Plays a piece of natural runs side by side. `None`: stopped.
    fn lanes_piece<'b>(
        &self,
        mixture: &Mixture,
        items: &[usize],
        order: impl Fn(usize) -> Order<'b> + Sync,
    ) -> Option<Vec<RiskRun>> {
        // Groups instead of runs, because lanes advance together.
        let groups: Vec<&[usize]> = items.chunks(LANES).collect();
        let work = EpisodeLoop::uncounted(self.watch);
        let worker = || (self.world.lanes(), self.world.scenario.bench());
        let pieces = work.each(&groups, worker, |(lanes, bench), group, _| {
            let orders: Vec<Order<'_>> = group.iter().map(|index| order(*index)).collect();
            let ends = self
                .world
                .play_lanes(lanes.as_mut()?, mixture, &orders)
                .into_iter()
                .zip(orders);
            let runs = ends.map(|(run, order)| match run {
                Some(run) => run,
                None => self.one(bench, mixture, &order, true),
            });
            Some(runs.collect::<Vec<RiskRun>>())
        });
        let all: Option<Vec<Vec<RiskRun>>> = pieces.into_iter().collect();
        Some(all?.concat())
    }

    fn order<'b>(
        &self,
        stage: u64,
        index: usize,
        content: &Content<'b>,
        component: usize,
    ) -> Order<'b> {
        let all = self.world.scenario.world().clock().decisions();
        let source = match content {
            Content::Natural(_) => EpisodeSource::Component(0),
            Content::Round(_) => EpisodeSource::Component(component),
            // Long holds reach states that are far from natural traffic.
            Content::Exploring(_) => EpisodeSource::Held([1, 2, 4, 8, all.max(1)][index % 5]),
            Content::Known(known) => EpisodeSource::Recorded(&known[index]),
            Content::Scripts(scripts) => EpisodeSource::Scripted(&scripts[index]),
        };
        Order {
            seed: self.seed,
            stage,
            index: index as u64,
            source,
            judge_held: matches!(content, Content::Natural(_)) && index < JUDGED,
            prevent: match content {
                // Natural failures are counted one by one, so each needs an answer.
                Content::Natural(_) => true,
                Content::Round(_) => index.is_multiple_of(assessed_step(content.len())),
                Content::Exploring(_) | Content::Known(_) | Content::Scripts(_) => false,
            },
        }
    }

    fn piece(&self, stage: u64, content: &Content<'_>, first: usize, runs: usize) -> PieceId {
        PieceId {
            request: self.request.clone(),
            ego: self.name.clone(),
            seed: self.seed,
            stage,
            content: content.word().to_owned(),
            total: content.len(),
            first,
            runs,
        }
    }

    fn file(&self, piece: &PieceId) -> Option<PathBuf> {
        let dir = self.dir.as_ref()?;
        // The components of runs depend on their number. A round that the budget cut
        // short is played anew under a greater one.
        let PieceId {
            ego,
            stage,
            total,
            first,
            ..
        } = piece;
        let name = format!("{ego}-{stage:03}-of-{total}-{first:07}.runs");
        Some(dir.join(name))
    }
}

/// Returns whether a directory is that of an earlier request.
pub(super) fn is_used(dir: &Path) -> bool {
    dir.join(REQUEST).exists()
}

/// Opens the directory of a request, whose fingerprint its files must have.
///
/// # Errors
/// The disk refuses, or the directory is that of another request, or of an unknown one.
pub(super) fn open(dir: &Path, fingerprint: &str) -> Result<(), RunError> {
    make_dir(dir)?;
    let file = dir.join(REQUEST);
    if !file.exists() {
        let entries = std::fs::read_dir(dir).map_err(|source| RunError::Io {
            verb: "reading",
            path: dir.into(),
            source,
        })?;
        // Runs without their request could be those of any ego. A kill during the first
        // write leaves an unfinished file, though, and the programs are bound before.
        let is_begun = |name: &str| is_unfinished(name) || name == PROGRAMS;
        let mut names = entries.flatten().map(|entry| entry.file_name());
        if names.any(|name| !is_begun(&name.to_string_lossy())) {
            return Err(RunError::NoRiskRequest { path: dir.into() });
        }
        return write_file(&file, fingerprint.as_bytes());
    }
    let found = crate::run_dir::read_text(&file)?;
    if found == fingerprint {
        return Ok(());
    }
    Err(RunError::OtherRisk { path: dir.into() })
}

#[cfg(test)]
mod tests {
    use super::super::RiskTraffic;
    use super::super::record::RunEnd;
    use super::super::tests::{TRAFFIC, directory, traffic, world};
    use super::*;
    use crate::ego::Fault;
    use crate::scene::Start;

    /// Plays ten natural runs, whose file is returned.
    fn counted(
        dir: &Path,
        seed: u64,
    ) -> (Result<NaturalCounts, RunError>, Watch<'static>, PathBuf) {
        let world = world();
        let traffic = traffic(&world, dir);
        let watch = Watch::unwatched();
        let player = Player {
            world: RiskWorld::new(&world, traffic.starts.clone(), traffic.actions.clone()),
            has_lanes: false,
            seed,
            request: "digest".to_owned(),
            name: "ego".to_owned(),
            dir: Some(dir.to_owned()),
            watch: &watch,
        };
        let counts = player
            .count(0, 10, &Mixture::natural(1))
            .map(|it| it.expect("not stopped"));
        let piece = player.piece(0, &Content::Natural(10), 0, 10);
        let file = player.file(&piece).expect("a directory");
        drop(player);
        (counts, watch, file)
    }

    fn piece() -> PieceId {
        PieceId {
            request: "digest".to_owned(),
            ego: "ego".to_owned(),
            seed: 0,
            stage: 0,
            content: "natural".to_owned(),
            total: 10,
            first: 0,
            runs: 10,
        }
    }

    #[test]
    fn faults_of_stored_runs_are_reported_again() {
        let dir = directory("risk-faults");
        let (played, watch, file) = counted(&dir, 0);
        let played = played.expect("a disk");
        assert_eq!((played.len(), played.faults.invalid), (10, 0));
        assert_eq!(watch.faults.complaint(), None);
        let mut runs = run_file::read(&piece(), &file)
            .expect("sound")
            .expect("stored");
        let fault = Fault::error("the ego did not answer");
        runs[3].end = RunEnd::Invalid { fault };
        let bytes = run_file::bytes(&piece(), &runs, &file).expect("fits");
        std::fs::write(&file, bytes).expect("written");
        let (counts, watch, _) = counted(&dir, 0);
        let counts = counts.expect("a disk");
        let complaint = watch.faults.complaint().expect("a fault");
        assert_eq!((counts.len(), counts.faults.invalid), (10, 1));
        assert_eq!(complaint.episodes, 10);
        assert_eq!(complaint.faults[0].first_start, 3);
        std::fs::remove_dir_all(&dir).expect("removed");
    }

    #[test]
    fn stored_runs_of_another_seed_are_refused() {
        let dir = directory("risk-other-seed");
        assert!(counted(&dir, 0).0.is_ok());
        let (refused, ..) = counted(&dir, 1);
        let refused = refused.expect_err("another seed").to_string();
        assert!(refused.contains("seed: 0, expected 1"), "{refused}");
        std::fs::remove_dir_all(&dir).expect("removed");
    }

    #[test]
    fn a_directory_belongs_to_one_request() {
        let dir = directory("risk-open");
        assert!(open(&dir, "one").is_ok() && open(&dir, "one").is_ok());
        assert!(matches!(open(&dir, "two"), Err(RunError::OtherRisk { .. })));
        std::fs::remove_file(dir.join(REQUEST)).expect("removed");
        // What a kill leaves of the first write is nobody's run.
        std::fs::write(dir.join(".brakecheck-x"), "on").expect("written");
        assert!(open(&dir, "two").is_ok());
        std::fs::remove_file(dir.join(REQUEST)).expect("removed");
        std::fs::write(dir.join("ego-000-of-10-0000000.runs"), "").expect("written");
        let refused = open(&dir, "two");
        assert!(matches!(refused, Err(RunError::NoRiskRequest { .. })));
        std::fs::remove_dir_all(&dir).expect("removed");
    }

    /// Player of the small world that stores nothing.
    fn player<'a>(watch: &'a Watch<'a>, has_lanes: bool) -> Player<'a> {
        let world = world();
        let traffic = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        Player {
            world: RiskWorld::new(&world, traffic.starts, traffic.actions),
            has_lanes,
            seed: 9,
            request: "digest".to_owned(),
            name: "ego".to_owned(),
            dir: None,
            watch,
        }
    }

    #[test]
    fn runs_of_each_content_have_their_actions_and_their_judges() {
        let watch = Watch::unwatched();
        let player = player(&watch, false);
        let known = [0, 1].map(|noise| KnownFailure {
            start: Start(vec![30.0]),
            noise,
            actions: vec![0],
        });
        let of = |content: Content<'_>, index: usize| {
            let order = player.order(7, index, &content, 2);
            assert_eq!((order.seed, order.stage, order.index), (9, 7, index as u64));
            let source = match order.source {
                EpisodeSource::Component(component) => format!("component {component}"),
                EpisodeSource::Held(hold) => format!("held {hold}"),
                EpisodeSource::Recorded(known) => format!("known {}", known.noise),
                EpisodeSource::Scripted(script) => format!("script {}", script.noise),
            };
            (source, order.judge_held, order.prevent)
        };
        let case = |source: &str, judge_held, prevent| (source.to_owned(), judge_held, prevent);
        // The first natural runs are judged by the rules, and all by the drivers.
        let natural = Content::Natural(5000);
        assert_eq!(of(natural, JUDGED - 1), case("component 0", true, true));
        assert_eq!(of(natural, JUDGED), case("component 0", false, true));
        let round = Content::Round(ASSESSED);
        assert_eq!(of(round, 1), case("component 2", false, true));
        // A larger round assesses every second failure.
        let round = Content::Round(ASSESSED + 1);
        assert_eq!(of(round, 1), case("component 2", false, false));
        assert_eq!(of(round, 2), case("component 2", false, true));
        // The longest hold is the whole run of five decisions.
        for (index, hold) in [1, 2, 4, 8, 5, 1].into_iter().enumerate() {
            let held = case(&format!("held {hold}"), false, false);
            assert_eq!(of(Content::Exploring(10), index), held);
        }
        for index in [0, 1] {
            let said = case(&format!("known {index}"), false, false);
            assert_eq!(of(Content::Known(&known), index), said);
            let said = case(&format!("script {index}"), false, false);
            assert_eq!(of(Content::Scripts(&known), index), said);
        }
    }

    #[test]
    fn natural_runs_are_counted_alike_in_lanes_and_on_benches() {
        let watch = Watch::unwatched();
        let counted = |has_lanes: bool| {
            let player = player(&watch, has_lanes);
            assert!(player.world.lanes().is_some());
            let counts = player.count(0, JUDGED + 1000, &Mixture::natural(1));
            counts.expect("no disk").expect("not stopped")
        };
        let (lanes, benches) = (counted(true), counted(false));
        assert_eq!(format!("{lanes:?}"), format!("{benches:?}"));
        // Rules are judged in the first runs, whatever plays the others.
        assert_eq!((lanes.len(), lanes.judged()), (JUDGED + 1000, JUDGED));
        // Another stage and another seed have other draws.
        let draws = |seed: u64, stage: u64| {
            let player = Player {
                seed,
                ..player(&watch, true)
            };
            let runs = player
                .play(stage, Content::Natural(3), &Mixture::natural(1))
                .expect("no disk")
                .expect("not stopped")
                .into_iter();
            runs.map(|run| run.noise).collect::<Vec<u64>>()
        };
        assert_eq!(draws(9, 0), draws(9, 0));
        assert_ne!(draws(9, 0), draws(10, 0));
        assert_ne!(draws(9, 0), draws(9, 1));
    }

    #[test]
    fn a_directory_in_which_only_the_programs_are_bound_is_new() {
        let dir = tempfile::tempdir().expect("a directory");
        assert!(!is_used(dir.path()));
        std::fs::write(dir.path().join(PROGRAMS), "{}").expect("written");
        assert!(open(dir.path(), "one").is_ok() && is_used(dir.path()));
    }
}
