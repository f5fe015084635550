//! Confirmation of candidates on sealed starts and draws, and the report.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;

use super::ado_set::HardeningAdo;
use super::candidate::EgoMeasurement;
use super::error::HardenError;
use super::hardening::{Chosen, Hardening};
use super::losses::NaturalDriving;
use super::report::{
    Confirmation, HardenReport, HardenVerdict, HardenedEgo, KeptCrashes, LossResult, NewAdo,
    StartCount,
};
use crate::adversary::Ado;
use crate::crashes::{CrashSelection, Form, KeepSettings, keep_cells};
use crate::experiment::{EgoUnderTest, TestStarts, Watch, unrepeatable};
use crate::search::{Adversary, ExperimentCell};
use crate::seed::FIRST_SEALED;

/// Most crashes that are kept.
const KEPT: usize = 5;
/// Natural runs of the confirmation, as a multiple of those of the search.
const SEALED_RUNS: usize = 3;

impl Hardening<'_> {
    /// Confirms the candidates on sealed starts and draws, and keeps the crashes that remain.
    pub(super) fn confirmed(&self, watch: &Watch<'_>) -> Result<HardenReport, HardenError> {
        let settings = self.request.settings;
        watch.phase("confirming on sealed starts");
        // The bar counts candidates, and each of their plays would restart it.
        let quiet = watch.quiet();
        // With the seed of the search, the natural runs of the search would come again.
        let seed = settings.seed.wrapping_add(FIRST_SEALED);
        let nominal = EgoUnderTest::nominal(self.request.world);
        let count = settings.sealed_starts;
        let drawn = TestStarts::stored(None, &nominal, count, seed, &quiet);
        let Some(starts) = drawn.and_then(|it| self.judged(it, &quiet)) else {
            return Ok(self.report(None, watch));
        };
        let (world, traffic) = (self.request.world, self.request.traffic);
        let (losses, runs) = (&self.request.losses, SEALED_RUNS * settings.runs);
        let driving = NaturalDriving::new(world, traffic, losses, runs, seed, &quiet)?;
        let all = driving.and_then(|driving| self.sealed(&starts, &driving, runs, watch));
        let Some(all) = all else {
            return Ok(self.report(None, watch));
        };
        let report = self.report(Some(all), watch);
        // Crashes of a rejected request would be no help, so only a candidate's are kept.
        let Some(best) = report.recommended() else {
            return Ok(report);
        };
        let crashes = self.keep(best, &starts, watch)?;
        Ok(HardenReport { crashes, ..report })
    }

    /// Plays the ego as it is and all candidates on sealed starts. `None`: stopped.
    fn sealed(
        &self,
        starts: &TestStarts,
        driving: &NaturalDriving<'_>,
        runs: usize,
        watch: &Watch<'_>,
    ) -> Option<SealedResults> {
        let (ados, quiet) = (&self.request.ados, watch.quiet());
        let played = |ego: &EgoUnderTest| {
            let outcomes = ados.outcomes(ego, starts, &quiet)?;
            let runs = driving.measure(ego.scenario(), 0..runs, &quiet)?;
            Some(EgoMeasurement { outcomes, runs })
        };
        let own = played(&self.ego)?;
        let own_count = StartCount::of(&own.outcomes);
        let steps = self.chosen.len() as u64;
        let mut all = Vec::new();
        for (nth, chosen) in self.chosen.iter().enumerate() {
            (watch.progress)(nth as u64, steps);
            // The confirmation must include the ado that knows this candidate best.
            let (trained, new_ado) = chosen.ado.as_ref()?;
            let ego = self.changed(chosen)?;
            let measured = played(&ego)?;
            let kept = ados.kept_outcomes(&ego, &quiet)?;
            let answered = StartCount::of(&kept);
            let losses = self.request.losses.iter().enumerate();
            let confirmation = Confirmation {
                sealed: StartCount::of(&measured.outcomes),
                kept: (!kept.is_empty()).then_some([answered.failing, answered.starts]),
                reduction: 0.0,
                reduction_at_least: 0.0,
                new_ado: NewAdo {
                    failing: Some(ados.failing_by(*trained, &ego, starts, &quiet)?),
                    ..new_ado.clone()
                },
                losses: losses
                    .map(|(at, loss)| LossResult::of(at, loss, &measured, &own))
                    .collect(),
            };
            all.push(confirmation.reduced_from(own_count));
            // An ego that keeps state has not withstood anything.
            unrepeatable(ego.scenario(), ego.name(), |_| None, &quiet);
        }
        (watch.progress)(steps, steps);
        Some(SealedResults {
            own: own_count,
            all,
        })
    }

    fn changed(&self, chosen: &Chosen) -> Option<EgoUnderTest> {
        let name = chosen.file.file_stem()?.to_string_lossy().into_owned();
        // These values are in the written change already, so they fit the world.
        let ego = self.request.parameters.ego(&name, &chosen.candidate.values);
        ego.ok()
    }

    /// Keeps some of the crashes that remain with a candidate.
    fn keep(
        &self,
        best: usize,
        starts: &TestStarts,
        watch: &Watch<'_>,
    ) -> Result<Option<KeptCrashes>, HardenError> {
        // Crashes of one candidate only, since files of equal starts would replace each
        // other.
        let Some(ego) = self.chosen.get(best).and_then(|it| self.changed(it)) else {
            return Ok(None);
        };
        let quiet = watch.quiet();
        let play = |ado: &HardeningAdo| {
            let player = Ado::Trained(&*ado.policy, ado.seed);
            player.play(&ego, starts, &quiet)
        };
        let fails = |cell: &ExperimentCell| cell.row.successes > 0;
        // The latest ados know the change best.
        let mut cells = self.request.ados.trained.iter().rev().filter_map(play);
        // The plays are lazy, so older ados play only as long as no
        // newer one makes it fail.
        let Some(failing) = cells.find(fails) else {
            return Ok(None);
        };
        let dir = self.request.dir.join("crashes");
        let settings = KeepSettings::new(CrashSelection::Worst(KEPT), Form::Shrunk);
        let kept = keep_cells(&[failing], &dir, settings, watch)?;
        Ok(Some(KeptCrashes {
            dir,
            files: kept.iter().map(|it| it.files.len()).sum(),
            found: kept.iter().map(|it| it.found).sum(),
        }))
    }

    /// Returns the report, as far as there are results.
    pub(super) fn report(&self, sealed: Option<SealedResults>, watch: &Watch<'_>) -> HardenReport {
        let request = &self.request;
        let own = sealed.as_ref().map(|it| it.own);
        let all = sealed.map(|it| it.all).unwrap_or_default();
        let mut confirmations = all.into_iter();
        let candidates = self.chosen.iter().map(|chosen| {
            let confirmation = confirmations.next();
            let judged = confirmation.as_ref().zip(own);
            let (verdict, reasons) = match judged {
                Some((it, own)) => it.verdict(own, request.settings.reduction),
                None if !chosen.is_feasible => {
                    let why = "it misses a condition on the starts of the search";
                    (HardenVerdict::Refuted, vec![why.to_owned()])
                }
                None => (HardenVerdict::Unknown, vec!["not confirmed".to_owned()]),
            };
            HardenedEgo {
                file: chosen.file.clone(),
                values: self.differing(&chosen.candidate.values),
                size: chosen.size,
                searched: StartCount::of(&chosen.candidate.measured.outcomes),
                confirmation,
                verdict,
                reasons,
            }
        });
        HardenReport {
            candidates: candidates.collect(),
            world: request.world.name().to_owned(),
            plant: request.world.plant().to_string(),
            ego: self.ego.name().to_owned(),
            traffic: request.traffic.source.clone(),
            parameters: request.parameters.list.clone(),
            reduction: request.settings.reduction,
            searched: self.searched,
            sealed: own,
            ados: self.runs.clone(),
            front: self.front.clone(),
            played: self.played.load(Ordering::Relaxed),
            crashes: None,
            interrupted: watch.stopped(),
        }
    }

    pub(super) fn differing(&self, values: &[f64]) -> BTreeMap<String, f64> {
        let pairs = self.request.parameters.list.iter().zip(values);
        pairs
            .filter(|(one, value)| one.own != **value)
            .map(|(one, value)| (one.name.clone(), *value))
            .collect()
    }
}

/// Sealed results of the ego as it is and of all candidates.
pub(super) struct SealedResults {
    own: StartCount,
    all: Vec<Confirmation>,
}
