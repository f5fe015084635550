//! Identifying egos one after the other, and adapting a conditional ado to each.

use std::path::Path;

use indexmap::IndexMap;

use super::adapt::Adapted;
use super::conditioning::adapted;
use super::ego_under_test::{EgoUnderTest, consent};
use super::error::CampaignError;
use super::identify::{Identified, IdentifyRequest, identify};
use super::watch::Watch;
use crate::run::{AdaptedEgo, IdentifiedEgo, IdentifiedEgos, RunDir};
use crate::scenario::{Against, Family, Scenario};

/// What to identify.
#[derive(Clone, Copy)]
pub struct Identification<'a> {
    /// The run of a conditional ado.
    pub run: &'a RunDir,
    /// Its world, on the plant to record on.
    pub world: &'a Scenario,
    /// The egos, which are only run.
    pub egos: &'a [EgoUnderTest],
    /// Runs of each to record.
    pub runs: usize,
    /// Quantities that stay nominal, as if the family did not vary them.
    pub leave_out: &'a [String],
    /// Simulations of each ego with which to look for what the ado is best told.
    pub adapt: Option<u64>,
    /// Seed of the recorded runs.
    pub seed: u64,
    /// The file to write, whenever something is known.
    pub output: Option<&'a Path>,
}

/// What is known now of an ego.
pub struct IdentifyStep<'a> {
    /// The family.
    pub family: &'a Family,
    /// The ego.
    pub ego: &'a EgoUnderTest,
    /// What was found.
    pub found: IdentifyFound<'a>,
}

/// What one step of an identification found.
pub enum IdentifyFound<'a> {
    /// The nearest member.
    Identified(&'a Identified),
    /// What the ado is best told, and what it would be told otherwise.
    Adapted(&'a Adapted, &'static str),
}

impl Identification<'_> {
    /// Identifies one ego after the other and says of each what is known.
    ///
    /// Stopped from outside it gives what was finished; the file, if one is
    /// asked for, is written after every step.
    ///
    /// # Errors
    /// The ado is not conditional, an ego gives no runs, or the disk refuses.
    pub fn run(
        &self,
        watch: &Watch<'_>,
        show: &mut dyn FnMut(IdentifyStep<'_>),
    ) -> Result<IdentifiedEgos, CampaignError> {
        let family = self.family()?;
        if let Some(path) = self.output {
            can_be_written(path)?;
        }
        consent(self.world, self.egos)?;
        let manifest = self.run.manifest();
        let mut file = IdentifiedEgos::new(&manifest.world, &manifest.world_sha256, self.seed);
        for ego in self.egos {
            watch.phase(&format!("identifying: {}", ego.name()));
            let request = IdentifyRequest {
                world: self.world,
                ego: ego.scenario(),
                runs: self.runs,
                seed: self.seed,
                fixed: self.leave_out,
            };
            let Some(found) = identify(&request, watch)? else {
                break;
            };
            show(IdentifyStep {
                family,
                ego,
                found: IdentifyFound::Identified(&found),
            });
            let kept = self.kept(family, ego, &found);
            file.egos.insert(ego.name().to_owned(), kept);
            self.save(&file)?;
            let Some(simulations) = self.adapt else {
                continue;
            };
            watch.phase(&format!("adapting: {}", ego.name()));
            let (first, told) = found.told(family);
            let budget = (simulations, self.seed);
            let Some(adapted) = adapted(self.run, family, ego, &first, budget, watch)? else {
                watch.note(&format!(
                    "`{}` is kept as identified, not adapted",
                    ego.name()
                ));
                break;
            };
            show(IdentifyStep {
                family,
                ego,
                found: IdentifyFound::Adapted(&adapted, told),
            });
            if let Some(kept) = file.egos.get_mut(ego.name()) {
                kept.adapted = Some(self.kept_adapted(family, &adapted, told));
            }
            self.save(&file)?;
        }
        Ok(file)
    }

    /// The family of a conditional ado's world.
    fn family(&self) -> Result<&Family, CampaignError> {
        let manifest = self.run.manifest();
        if manifest.against != Against::Conditional {
            return Err(CampaignError::request(
                format!(
                    "the ado in `{}` is {}: it has no use for an ego's parameters",
                    self.run.path().display(),
                    manifest.against
                ),
                "train one that has: `brakecheck train WORLD --against conditional`",
            ));
        }
        if self.adapt.is_some() {
            // Adapting plays the ado: an unfinished run is found out now.
            self.run.policy_bundle()?;
        }
        let family = self.world.family();
        family.ok_or_else(|| CampaignError::Fault("a conditional ado without a family".to_owned()))
    }

    /// What is known so far, so that nothing is lost later.
    fn save(&self, file: &IdentifiedEgos) -> Result<(), CampaignError> {
        match self.output {
            Some(path) => Ok(file.save(path)?),
            None => Ok(()),
        }
    }

    fn kept(&self, family: &Family, ego: &EgoUnderTest, found: &Identified) -> IdentifiedEgo {
        let hidden = named(family, &found.hidden).into_iter();
        IdentifiedEgo {
            parameters: named(family, &found.member.values),
            spread: named(family, &found.spread),
            hidden: hidden
                .filter(|(name, hidden)| *hidden && !self.leave_out.contains(name))
                .map(|(name, _)| name)
                .collect(),
            explains: found.explains(),
            residual_m: found.residual_m,
            nominal_residual_m: found.nominal_residual_m,
            noise_m: found.noise_m,
            refits_m: found.refits_m.clone(),
            recorded: found.recorded,
            simulations: found.simulations,
            change: Some(ego.change().clone()),
            adapted: None,
        }
    }

    fn kept_adapted(&self, family: &Family, adapted: &Adapted, otherwise: &str) -> AdaptedEgo {
        let sha256 = self.run.manifest().policy_sha256.clone();
        let others = adapted.others.iter();
        AdaptedEgo {
            policy_sha256: sha256.unwrap_or_default(),
            parameters: named(family, &adapted.member.values),
            others: others.map(|other| named(family, &other.values)).collect(),
            is_better: adapted.is_better,
            otherwise: otherwise.to_owned(),
            success_rate: adapted.success_rate,
            otherwise_success_rate: adapted.first_success_rate,
            starts: adapted.starts,
            tried: adapted.tried,
            simulations: adapted.simulations,
            invalid: adapted.invalid,
        }
    }
}

/// A place that is none is found out before anything is run.
fn can_be_written(path: &Path) -> Result<(), CampaignError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    match folder.as_os_str().is_empty() || folder.is_dir() {
        true => Ok(()),
        false => Err(CampaignError::request(
            format!("`{}` is no directory", folder.display()),
            "make it, or name another file with `-o`",
        )),
    }
}

/// By name, in the order of the family.
fn named<T: Copy>(family: &Family, values: &[T]) -> IndexMap<String, T> {
    let names = family.quantities.iter().map(|q| q.varied.name().to_owned());
    names.zip(values.iter().copied()).collect()
}
