//! Crashes that reference drivers avoid, by the adversary that found them.
//!
//! Training may use one reference driver (`counts: Preventable(by: [RSS])`).
//! This study evaluates CC_LATCHED, which training never used.
//! In open loop it drives among the recorded motions. In closed loop it is the ego that
//! the same adversary plays against.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::case_studies::{CaseStudies, trained_run};
use brakecheck::adversary::Ado;
use brakecheck::ego::Actuated;
use brakecheck::ego::ReferenceDriver;
use brakecheck::experiment::{EgoUnderTest, TestStarts, Watch, test_starts};
use brakecheck::run_dir::{ClosingSpeed, RunDir};
use brakecheck::scene::CrashKind;
use brakecheck::search::{Adversary, BestConstant, ExperimentCell, Search};
use brakecheck::stats::wilson;
use brakecheck::testbench::{Episode, Testbench};
use brakecheck::training::TrainError;
use brakecheck::world::{Change, ChangeError, Scenario};
use brakecheck_crashes::crashes::perturbation_robustness::persistence;
use brakecheck_ego::ego::reference::CcLatchedDriver;
use brakecheck_report::report::table::known_if;

/// Competent driver of UN R157 that observes the next lane and keeps braking.
const COMPETENT: ReferenceDriver = ReferenceDriver::CcLatched;
/// Largest number of crashes per ado that are varied.
const VARIED: usize = 40;
/// Closing speed from which a contact counts as hard, m/s.
const HARD_MPS: f64 = 3.0;

/// Results of an adversary in a world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CrashRow {
    /// Name of the ado.
    pub ado: String,
    /// Seed of its training, if it was trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Warning about that training, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warning: Option<String>,
    /// Starts that are not trivial.
    pub starts: usize,
    /// Starts with a counted crash and all rules kept.
    pub found: usize,
    /// Such crashes that CC_LATCHED avoids in the recorded motion.
    ///
    /// `None`: the drivers cannot judge such crashes.
    pub avoided: Option<usize>,
    /// Such crashes that CC_LATCHED or FSM avoids in the recorded motion.
    pub preventable: Option<usize>,
    /// Such starts without a hard crash of the same ado if CC_LATCHED is the ego.
    pub avoided_closed_loop: Option<usize>,
    /// Side-swipes among them.
    pub side_swipes: usize,
    /// Closing speeds of the crashes.
    pub closing_mps: Option<ClosingSpeed>,
    /// Median share of small variations in which the crashes still count.
    pub persistence: Option<f64>,
    /// Share of starts on which a rule was broken.
    pub foul_rate: f64,
}

/// Crashes of a world.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CrashStudy {
    /// Name of the world.
    pub world: String,
    /// Violations that count in the world.
    pub counts: String,
    /// Trained ados by seed, then the other ados.
    pub rows: Vec<CrashRow>,
}

/// Worlds and starts of the study.
struct Study<'a> {
    ego: &'a EgoUnderTest,
    /// Same world with CC_LATCHED as the ego.
    competent: Scenario,
    starts: &'a TestStarts,
    watch: &'a Watch<'a>,
}

/// Facts about a crash.
struct Looked {
    episode: Episode,
    avoided: Option<bool>,
    preventable: Option<bool>,
    closed_loop: bool,
}

impl Study<'_> {
    fn look(
        &self,
        benches: &mut (Testbench, Testbench),
        reacting: Option<Ado<'_>>,
        cell: &ExperimentCell,
        index: usize,
    ) -> Looked {
        let episode = cell.replay(&mut benches.0, index);
        let judged = self.ego.scenario().preventability(&episode);
        let preventable = judged.human_model_avoids();
        // The ado reacts to CC_LATCHED here, so it may still cause a crash.
        let closed_loop = match reacting {
            Some(ado) => {
                let request = self.ego.against(ado, self.starts);
                request.play(&mut benches.1, index)
            }
            // Sequences of actions are the same against every ego.
            None => cell.replay(&mut benches.1, index),
        };
        Looked {
            // The human models decide if the crash can be judged at all.
            avoided: preventable.map(|_| judged.is_avoided_by(COMPETENT)),
            preventable,
            closed_loop: !is_hard(&closed_loop),
            episode,
        }
    }

    /// Plays an adversary, and then its crashes again, because held starts have none.
    fn row(
        &self,
        adversary: &dyn Adversary,
        reacting: Option<Ado<'_>>,
        name: Option<&str>,
    ) -> Option<CrashRow> {
        let cell = adversary.play(self.ego, self.starts, self.watch)?;
        let all =
            brakecheck_experiment::experiment::episode_loop::EpisodeLoop::uncounted(self.watch);
        let looked: Vec<Looked> = all
            .each(
                &cell.solved(),
                || (self.ego.scenario().bench(), self.competent.bench()),
                |benches, index, _| Some(self.look(benches, reacting, &cell, *index)),
            )
            .into_iter()
            .flatten()
            .collect();
        // Without a judged crash the columns are absent, not zero.
        let judged = looked.iter().any(|one| one.avoided.is_some());
        let count =
            |which: &dyn Fn(&Looked) -> bool| looked.iter().filter(|one| which(one)).count();
        let touches = looked.iter().filter_map(|one| one.episode.contact.as_ref());
        let closing = touches.clone().map(|touch| touch.closing_speed_mps);
        let swiped = touches
            .filter_map(|touch| touch.impact)
            .filter(|impact| impact.kind == CrashKind::SideSwipe);
        Some(CrashRow {
            ado: name.unwrap_or(&cell.row.method).to_owned(),
            seed: cell.row.train_seed,
            warning: None,
            // From the marks, because the starts of a row leave out those with a fault.
            starts: self
                .starts
                .trivial
                .iter()
                .filter(|trivial| !**trivial)
                .count(),
            found: looked.len(),
            avoided: judged.then(|| count(&|one| one.avoided == Some(true))),
            preventable: judged.then(|| count(&|one| one.preventable == Some(true))),
            avoided_closed_loop: judged.then(|| count(&|one| one.closed_loop)),
            side_swipes: swiped.count(),
            closing_mps: ClosingSpeed::of(closing.collect()),
            persistence: self.persistence(&looked),
            foul_rate: cell.row.foul_rate,
        })
    }

    fn persistence(&self, looked: &[Looked]) -> Option<f64> {
        // Variations are slow, so only the first crashes are varied.
        let some = &looked[..looked.len().min(VARIED)];
        let mut shares: Vec<f64> = some
            .par_iter()
            .filter_map(|one| {
                let varied = persistence(self.ego.scenario(), &one.episode)?;
                Some(varied.share())
            })
            .collect();
        // The median does not depend on the order of the parallel loop.
        shares.sort_by(f64::total_cmp);
        // The upper one of two in the middle, so that it is the share of a crash.
        shares.get(shares.len() / 2).copied()
    }
}

/// Returns whether the ego ends in a hard crash while the ado keeps every rule.
fn is_hard(episode: &Episode) -> bool {
    let keeps_rules = !matches!(episode.verdict, brakecheck::rulebook::Verdict::Foul { .. });
    let contact = episode.contact.as_ref();
    keeps_rules && contact.is_some_and(|touch| touch.closing_speed_mps >= HARD_MPS)
}

/// Error of a crash study.
#[derive(Debug, thiserror::Error)]
pub enum CrashStudyError {
    /// A training failed.
    #[error(transparent)]
    Train(#[from] TrainError),
    /// CC_LATCHED cannot drive the world's ego.
    #[error(transparent)]
    Change(#[from] ChangeError),
}

/// Trains on a world and evaluates the crashes of all ados. `None`: stopped.
///
/// # Errors
/// Returns an error if a training fails or a file cannot be written.
pub fn crash_study(
    scenario: &Scenario,
    request: &CaseStudies<'_>,
    watch: &Watch<'_>,
) -> Result<Option<CrashStudy>, CrashStudyError> {
    let seeds: Vec<u64> = request.seeds.trainings().collect();
    let runs: Vec<_> = seeds
        .par_iter()
        .map(|&seed| Ok(trained_run(scenario, seed, request.runs, watch)?.0))
        .collect::<Result<_, TrainError>>()?;
    let starts = test_starts(scenario, request.seeds.starts, request.starts, watch);
    // A stopped training has no policy to play.
    let (Some(starts), false) = (starts, watch.stopped()) else {
        return Ok(None);
    };
    // The driver's own ramp models the build-up of the brakes, so the lag is 0.
    let competent = Actuated {
        controller: CcLatchedDriver::default().into(),
        lag_s: 0.0,
    };
    let change = Change {
        controller: Some(competent),
        ..Change::default()
    };
    let study = Study {
        ego: &EgoUnderTest::nominal(scenario),
        competent: scenario.with(&change)?,
        starts: &starts,
        watch,
    };
    let mut rows = Vec::new();
    for path in &runs {
        let run = RunDir::open(path).map_err(TrainError::from)?;
        let policy = run.policy().map_err(TrainError::from)?;
        let trained = Ado::Trained(&*policy, run.manifest().seed);
        rows.extend(
            study
                .row(&trained, Some(trained), Some("trained"))
                .map(|row| CrashRow {
                    warning: run.warning().map(|warning| warning.what),
                    ..row
                }),
        );
    }
    // The page reads these three by position.
    rows.extend(study.row(&Ado::Hold, Some(Ado::Hold), None));
    rows.extend(study.row(&BestConstant, None, None));
    let searched = study.row(&Search::switches(1), None, Some("search, switches ≤ 1"));
    // A search breaks rules only in episodes that it discards, so its rate is 0.
    rows.extend(searched.map(|row| CrashRow {
        foul_rate: 0.0,
        ..row
    }));
    Ok((!watch.stopped()).then(|| CrashStudy {
        world: scenario.name().to_owned(),
        counts: format!("{:?}", scenario.rulebook().counts),
        rows,
    }))
}

/// Explanation of the columns, below the table.
const EXPLAINED: &str = "
- found: starts with a crash that counts, every rule kept, with the interval of their share
- avoided by CC_LATCHED: the competent driver of UN R157 that reads the next lane and does not let go
- open loop: in the ego's place, the others moving as recorded
- closed loop: met by the same ado, which brings about no contact at 3 m/s or more then
- persistence: share of small variations in which a crash stays one
- fouls: share of starts on which a rule was broken first
";

/// Formats the studies as a Markdown table.
pub fn crashes_markdown(studies: &[CrashStudy]) -> String {
    let lines = studies.iter().flat_map(|study| {
        let rows = study.rows.iter();
        rows.map(|row| line(&study.world, row))
    });
    let columns = [
        "world",
        "ado",
        "found [95 %]",
        "avoided by CC_LATCHED, of all starts: open loop, closed loop",
        "of those found: open loop",
        "side-swipes",
        "closing m/s, median / 90 %",
        "persistence, median",
        "fouls",
    ];
    let mut text = brakecheck_report::report::table::TextTable::new(columns, lines).to_markdown();
    text.push_str(EXPLAINED);
    for study in studies {
        for row in &study.rows {
            if let (Some(warning), Some(seed)) = (&row.warning, row.seed) {
                text.push_str(&format!(
                    "- warning: {}, {} {seed}: {warning}\n",
                    study.world, row.ado
                ));
            }
        }
    }
    text
}

fn line(world: &str, row: &CrashRow) -> [String; 9] {
    let percent = |part: usize, whole: usize| {
        known_if(whole > 0, || {
            format!("{:.1} %", 100.0 * part as f64 / whole as f64)
        })
    };
    let of = |part: Option<usize>, whole: usize| {
        part.map_or("–".to_owned(), |part| percent(part, whole))
    };
    let [lo, hi] = wilson(row.found, row.starts).map(|share| 100.0 * share);
    let ado = match row.seed {
        Some(seed) => format!("{} {seed}", row.ado),
        None => row.ado.clone(),
    };
    let closing = row.closing_mps.map_or("–".to_owned(), |closing| {
        format!("{:.1} / {:.1}", closing.median, closing.p90)
    });
    let (found, starts) = (row.found, row.starts);
    [
        world.to_owned(),
        ado,
        format!(
            "{found} of {starts} ({}) [{lo:.1}, {hi:.1}]",
            percent(found, starts)
        ),
        format!(
            "{}, {}",
            of(row.avoided, starts),
            of(row.avoided_closed_loop, starts)
        ),
        of(row.avoided, found),
        percent(row.side_swipes, found),
        closing,
        row.persistence
            .map_or("–".to_owned(), |share| format!("{share:.2}")),
        format!("{:.1} %", 100.0 * row.foul_rate),
    ]
}
