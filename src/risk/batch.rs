//! Batches of runs, played in parallel and stored piece by piece.

use std::path::{Path, PathBuf};

use super::mixture::Mixture;
use super::record::{KnownFailure, RiskRun, RunEnd};
use super::run::{EpisodeSource, Order, RiskWorld};
use super::run_file;
use crate::experiment::{EpisodeLoop, Watch};
use crate::run_dir::{RunError, make_dir, write_file};

/// Runs of a piece, which is stored as a whole.
const PIECE: usize = 500;
/// Natural runs whose rules are judged.
pub(super) const JUDGED: usize = 2000;
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
}

/// Player of batches for one ego.
pub(super) struct Player<'a> {
    pub(super) world: RiskWorld,
    pub(super) seed: u64,
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
            Content::Known(known) => known.len(),
        }
    }
}

impl Player<'_> {
    /// Plays a batch, or reads its finished pieces. `None`: stopped.
    ///
    /// # Errors
    /// The disk refuses, or a stored piece is damaged.
    pub(super) fn play(
        &self,
        stage: u64,
        content: Content<'_>,
        mixture: &Mixture,
    ) -> Result<Option<Vec<RiskRun>>, RunError> {
        let total = content.len();
        let components = mixture.allocation(total);
        let work = EpisodeLoop::counted(self.watch, total);
        let mut all = Vec::with_capacity(total);
        for first in (0..total).step_by(PIECE) {
            let items: Vec<usize> = (first..total.min(first + PIECE)).collect();
            let file = self.file(stage, first);
            if let Some(piece) = file.as_deref().map(run_file::read).transpose()?.flatten() {
                all.extend(piece);
                continue;
            }
            let piece = work.each(
                &items,
                || self.world.scenario.bench(),
                |bench, index, _| {
                    let order = self.order(stage, *index, &content, components[*index]);
                    let mut run = self.world.play(bench, mixture, &order);
                    if matches!(content, Content::Natural(_)) && run.failure().is_none() {
                        // Millions of them are counted, and nothing is learned from them.
                        (run.actions, run.inputs, run.laws) = Default::default();
                    }
                    self.watch
                        .faults
                        .note(*index as u64, bench_fault(bench, &run));
                    Some(run)
                },
            );
            let piece: Option<Vec<RiskRun>> = piece.into_iter().collect();
            let Some(piece) = piece else {
                return Ok(None);
            };
            // Only whole pieces are stored, so a killed process repeats one piece at
            // most.
            if let Some(file) = file {
                write_file(&file, &run_file::bytes(&piece, &file)?)?;
            }
            all.extend(piece);
        }
        Ok(Some(all))
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
        };
        // An assessment replays the failure, so a large round assesses an even part.
        let assessed = content.len().div_ceil(ASSESSED);
        Order {
            seed: self.seed,
            stage,
            index: index as u64,
            source,
            judge_held: matches!(content, Content::Natural(_)) && index < JUDGED,
            prevent: match content {
                Content::Natural(_) => true,
                Content::Round(_) => index.is_multiple_of(assessed),
                Content::Exploring(_) | Content::Known(_) => false,
            },
        }
    }

    fn file(&self, stage: u64, first: usize) -> Option<PathBuf> {
        let dir = self.dir.as_ref()?;
        Some(dir.join(format!("{}-{stage:03}-{first:07}.runs", self.name)))
    }
}

fn bench_fault<'a>(
    bench: &'a crate::testbench::Testbench,
    run: &RiskRun,
) -> Option<&'a crate::ego::Fault> {
    bench.fault().filter(|_| run.end == RunEnd::Invalid)
}

/// Opens the directory of a request, whose fingerprint its files must have.
///
/// # Errors
/// The disk refuses, or the directory is that of another request.
pub(super) fn open(dir: &Path, fingerprint: &str) -> Result<(), RunError> {
    make_dir(dir)?;
    let file = dir.join("request.json");
    if !file.exists() {
        return write_file(&file, fingerprint.as_bytes());
    }
    let found = crate::run_dir::read_text(&file)?;
    if found == fingerprint {
        return Ok(());
    }
    Err(RunError::Damaged {
        path: file,
        why: "it is of another world, ego, traffic, seed or version; choose another directory"
            .to_owned(),
    })
}
