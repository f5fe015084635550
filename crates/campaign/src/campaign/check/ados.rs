//! Lookup of the ados of a campaign in a world.

use std::collections::BTreeSet;

use super::Checker;
use crate::campaign::error::CampaignError;
use crate::campaign::file::AdoEntry;
use crate::campaign::plan::{PlannedAdo, PlannedRun, PlannedTraining};
use crate::ron_file::{ValuePath, guessed};
use crate::run_dir::{AdversaryId, RunDir, SearchSettings, file_name};
use crate::search::{BUDGET, MOST_SWITCHES, Method, MethodOption, MethodSettings, SWITCHES};
use crate::world::Scenario;

/// Largest number of decisions in a script.
const MAX_DECISIONS: f64 = 1e6;
/// Largest number of trainings per world.
const MAX_TRAININGS: u64 = 10_000;

impl Checker {
    /// Returns the ados of a world: its own, then those of the campaign.
    pub(super) fn ados(
        &mut self,
        world: usize,
        own: &[AdoEntry],
        common: &[AdoEntry],
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        let mut ados = Vec::new();
        let places = [
            ValuePath::top().to("worlds").at(world).to("ados"),
            ValuePath::top().to("ados"),
        ];
        for (place, entries) in places.iter().zip([own, common]) {
            for (nth, entry) in entries.iter().enumerate() {
                ados.extend(self.planned(&place.at(nth), world, entry)?);
            }
        }
        // Duplicates are checked over both lists, because both play in this world.
        self.refuse_equal_names(&ados)?;
        Ok(ados)
    }

    fn planned(
        &mut self,
        at: &ValuePath,
        world: usize,
        entry: &AdoEntry,
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        let (played, _) = &self.worlds[world];
        let one = match entry {
            AdoEntry::Neutral => AdversaryId::Neutral,
            AdoEntry::Held => AdversaryId::Hold,
            AdoEntry::Random => AdversaryId::Random,
            AdoEntry::Constant(label) => AdversaryId::Constant {
                action: self.action(at, played, label)?,
                name: Some(format!("constant {label}")),
            },
            AdoEntry::Script { name, steps, then } => AdversaryId::Script {
                name: Some(name.clone()),
                actions: self.script(at, played, steps, then)?,
            },
            AdoEntry::Search {
                method,
                switches,
                budget,
            } => self.search(at, method.as_deref(), *switches, *budget)?,
            AdoEntry::Trained(dir) => return self.trained(at, world, dir),
            AdoEntry::Training {
                seeds,
                first_seed,
                decisions,
            } => return self.trainings(at, world, *seeds, *first_seed, *decisions),
        };
        Ok(vec![one.into()])
    }

    /// Returns the actions of a script, one per decision, the last action held.
    fn script(
        &self,
        at: &ValuePath,
        world: &Scenario,
        steps: &[(String, f64)],
        then: &str,
    ) -> Result<Vec<usize>, CampaignError> {
        let decision_s = world.world().clock().decision_s;
        let mut actions = Vec::new();
        for (nth, (label, until_s)) in steps.iter().enumerate() {
            let at = at.to("steps").at(nth);
            let action = self.action(&at, world, label)?;
            // Times are rounded to whole decisions, because actions change only there.
            let decisions = (until_s / decision_s).round();
            // The limit guards against a huge allocation.
            if decisions > MAX_DECISIONS {
                let what =
                    format!("this step ends at {until_s} s, after {MAX_DECISIONS} decisions");
                let help = format!("a decision takes {decision_s} s, so end the step earlier");
                return Err(self.source.wrong(&at, what, Some(help)));
            }
            if decisions <= actions.len() as f64 {
                let what = format!("this step ends at {until_s} s, before it begins");
                let help = format!(
                    "each step ends later than the one before; a decision takes {decision_s} s"
                );
                return Err(self.source.wrong(&at, what, Some(help)));
            }
            actions.resize(decisions as usize, action);
        }
        // The final action is held to the horizon, so a single entry is enough.
        actions.push(self.action(&at.to("then"), world, then)?);
        Ok(actions)
    }

    fn search(
        &self,
        at: &ValuePath,
        method: Option<&str>,
        switches: Option<usize>,
        budget: Option<u64>,
    ) -> Result<AdversaryId, CampaignError> {
        // The same default as on the command line.
        let name = method.unwrap_or("switches");
        // The error of the method itself would advise options that a campaign does not
        // have.
        if name == "mutate" {
            let what = "a campaign has no training whose counterexamples are mutated";
            let help = "use another method, or `brakecheck search RUN --method mutate`";
            return Err(self.source.wrong(at, what, Some(help.to_owned())));
        }
        if name == "guided" {
            let what = "a search of a campaign has no trained ado that guides it";
            let help = "use another method, or `brakecheck search --guided RUN`";
            return Err(self.source.wrong(at, what, Some(help.to_owned())));
        }
        // The pilot would not end before it has tried a start.
        if let Some(switches) = switches.filter(|it| *it > MOST_SWITCHES) {
            let what = format!("{switches} switches: there are at most {MOST_SWITCHES}");
            return Err(self.source.wrong(&at.to("switches"), what, None));
        }
        let wrong = self.source.at(at);
        let settings = MethodSettings {
            switches,
            ..MethodSettings::default()
        };
        let known = Method::named(name, &settings).map_err(&wrong)?;
        // Only options that the file gives are checked, and defaults are always allowed.
        let given: Vec<MethodOption> = [
            switches.map(|_| MethodOption::Switches),
            budget.map(|_| MethodOption::Budget),
        ]
        .into_iter()
        .flatten()
        .collect();
        known.info().refuse_others(&given).map_err(wrong)?;
        Ok(AdversaryId::Search {
            settings: Some(SearchSettings {
                method: name.to_owned(),
                switches: switches.unwrap_or(SWITCHES),
                budget: budget.unwrap_or(BUDGET),
            }),
        })
    }

    /// Plans the trainings that are pieces of the campaign.
    fn trainings(
        &mut self,
        at: &ValuePath,
        world: usize,
        seeds: u64,
        first_seed: u64,
        decisions: Option<u64>,
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        if seeds == 0 || seeds > MAX_TRAININGS {
            let what = format!("{seeds} trainings: there are 1 to {MAX_TRAININGS}");
            return Err(self.source.wrong(&at.to("seeds"), what, None));
        }
        if let Some(decisions) = decisions {
            // An invalid number of decisions is reported now and not in a piece hours later.
            self.worlds[world].0.training_for(decisions)?;
        }
        let mut ados = Vec::new();
        for nth in 0..seeds {
            ados.push(PlannedAdo {
                training: Some(self.trainings.len()),
                ..AdversaryId::Trained.into()
            });
            self.trainings.push(PlannedTraining {
                world,
                // Seeds near the limit repeat instead of overflowing, and duplicates are refused.
                seed: first_seed.saturating_add(nth),
                decisions,
            });
        }
        Ok(ados)
    }

    /// Refuses ados that rows could not distinguish.
    fn refuse_equal_names(&self, ados: &[PlannedAdo]) -> Result<(), CampaignError> {
        // Rows name an ado by its word and its training seed.
        let key = |ado: &PlannedAdo| {
            let run = ado.run.and_then(|run| Some(self.ados.get(run)?.seed));
            let seed = run.or_else(|| Some(self.trainings.get(ado.training?)?.seed));
            (ado.id.to_string(), seed)
        };
        // A set, because a world may have ten thousand trainings.
        let mut known = BTreeSet::new();
        for ado in ados {
            if !known.insert(key(ado)) {
                let (word, seed) = key(ado);
                let seed = seed.map_or(String::new(), |seed| format!(" of seed {seed}"));
                let what = format!("two ados of a world are called `{word}`{seed}");
                let help = "rows tell them apart by `ado` and `train_seed`: make two campaigns";
                let at = ValuePath::top().to("ados");
                return Err(self.source.wrong(&at, what, Some(help.to_owned())));
            }
        }
        Ok(())
    }

    /// Returns the number of an action with this label, as `check` lists it.
    fn action(
        &self,
        at: &ValuePath,
        world: &Scenario,
        label: &str,
    ) -> Result<usize, CampaignError> {
        let actions = 0..world.world().spaces().actions;
        // Files have labels and no numbers, which would change with every new action.
        let labels: Vec<String> = actions.map(|it| world.action_label(it)).collect();
        let found = labels.iter().position(|known| known == label);
        found.ok_or_else(|| {
            let what = format!("`{}` has no action `{label}`", world.name());
            let known = labels.iter().map(String::as_str).collect::<Vec<_>>();
            self.source
                .wrong(at, what, Some(guessed(label, "actions", known)))
        })
    }

    /// Returns the ado of a run, which must fit the world.
    fn trained(
        &mut self,
        at: &ValuePath,
        world: usize,
        dir: &str,
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        let played = &self.worlds[world].0;
        let path = self.dir.join(dir);
        let run = RunDir::open(&path)?;
        // An unfinished training and a damaged policy are refused here.
        run.policy()?;
        let own = run.scenario()?;
        // Equal axes and spaces mean equal observations and actions.
        if own.axes() != played.axes() || own.spaces() != played.spaces() {
            let what = format!(
                "the ado in `{dir}` was trained in `{}`: it does not fit `{}`",
                own.name(),
                played.name()
            );
            let help = "make a campaign per world where ados are trained ones".to_owned();
            return Err(self.source.wrong(at, what, Some(help)));
        }
        let policy = run.manifest().policy_sha256.clone().unwrap_or_default();
        let seed = run.manifest().seed;
        // The same run may serve several worlds, but is copied into the plan only once.
        let known = self.runs.iter().position(|other| *other == path);
        let run = known.unwrap_or_else(|| {
            self.ados.push(PlannedRun {
                dir: format!("ados/{}-{}", self.ados.len(), file_name(own.name())),
                policy_sha256: policy,
                seed,
            });
            self.runs.push(path);
            self.ados.len() - 1
        });
        Ok(vec![PlannedAdo {
            run: Some(run),
            ..AdversaryId::Trained.into()
        }])
    }
}
