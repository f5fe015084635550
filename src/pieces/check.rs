//! From a campaign file to a plan: names found, mistakes named with their place.

use std::path::{Path as FilePath, PathBuf};

use super::boundary;
use super::file::{AdoEntry, CampaignFile, EgoEntry, StartsAsked, StartsEntry, WorldEntry};
use super::plan::{FORMAT, Plan, PlannedAdo, PlannedRun, PlannedTraining, PlannedWorld, Unit};
use crate::campaign::{
    BUDGET, CampaignError, EgoUnderTest, Method, MethodOption, MethodSettings, SWITCHES, Sweep,
    on_plant,
};
use crate::run::{ChangedEgo, RunDir, file_name};
use crate::scenario::{LoadError, Path, Problem, Scenario, ScenarioError, guessed, read_file};
use crate::seal::sha256;
use crate::seed::{Purpose, StartKey};
use crate::sim::PlantKind;

/// Most units of a campaign.
const MAX_UNITS: usize = 100_000;
/// Most starts of a unit, and most values along an axis.
const MAX_STARTS: usize = 1_000_000_000;
/// Most decisions of a script.
const MAX_DECISIONS: f64 = 1e6;
/// Most members of a family, and most trainings of a world.
const MAX_MEMBERS: u64 = 10_000;

/// A checked campaign: its plan, not cut yet, and what goes beside it.
pub(super) struct Checked {
    /// Every unit is one piece.
    pub plan: Plan,
    /// The campaign file, verbatim.
    pub text: String,
    /// The worlds, as their files have them.
    pub worlds: Vec<Scenario>,
    /// The run directories of trained ados.
    pub runs: Vec<PathBuf>,
}

/// Reads and checks a campaign file; what it names is found beside it.
pub(super) fn check(path: &FilePath) -> Result<Checked, CampaignError> {
    let (name, text, file) = read_file::<CampaignFile>(path)?;
    let dir = path.parent().unwrap_or(FilePath::new("")).to_owned();
    Checker {
        source: Source { name, text },
        dir,
        worlds: Vec::new(),
        planned: Vec::new(),
        runs: Vec::new(),
        ados: Vec::new(),
        trainings: Vec::new(),
    }
    .check(file)
}

/// The text that is checked, for errors that show the place.
struct Source {
    name: String,
    text: String,
}

impl Source {
    fn wrong(&self, at: &Path, what: impl Into<String>, help: Option<String>) -> CampaignError {
        LoadError::Scenario(Box::new(ScenarioError {
            file: self.name.clone(),
            text: self.text.clone(),
            problems: vec![Problem {
                what: what.into(),
                span: at.find(&self.text),
                label: "here".to_owned(),
                help,
            }],
        }))
        .into()
    }

    /// What is wrong with something the file asks for, at its place.
    fn at(&self, at: &Path) -> impl Fn(CampaignError) -> CampaignError + '_ {
        let at = at.clone();
        move |error| match error {
            CampaignError::Request { what, help } => self.wrong(&at, what, Some(help)),
            other => other,
        }
    }
}

struct Checker {
    source: Source,
    /// Where files are found.
    dir: PathBuf,
    /// On the plants that are asked for, and as their files have them.
    worlds: Vec<(Scenario, Scenario)>,
    planned: Vec<PlannedWorld>,
    runs: Vec<PathBuf>,
    ados: Vec<PlannedRun>,
    trainings: Vec<PlannedTraining>,
}

impl Checker {
    fn check(mut self, file: CampaignFile) -> Result<Checked, CampaignError> {
        let top = Path::top();
        for (nth, entry) in file.worlds.iter().enumerate() {
            self.world(&top.to("worlds").at(nth), entry)?;
        }
        let empty = [
            ("worlds", file.worlds.is_empty()),
            ("egos", file.egos.is_empty()),
            (
                "ados",
                file.ados.is_empty() && file.worlds.iter().any(|it| it.ados.is_empty()),
            ),
        ];
        if let Some((field, _)) = empty.into_iter().find(|(_, is_empty)| *is_empty) {
            let what = format!("`{field}` is empty: nothing would be played");
            return Err(self.source.wrong(&top.to(field), what, None));
        }
        let starts = self.starts(&top.to("starts"), file.starts)?;
        let mut units: Vec<Unit> = Vec::new();
        for world in 0..self.worlds.len() {
            let mut egos: Vec<ChangedEgo> = Vec::new();
            for (nth, entry) in file.egos.iter().enumerate() {
                let at = top.to("egos").at(nth);
                for ego in self.egos(&at, world, entry)? {
                    self.starts_alike(&at, world, &ego)?;
                    let ego = ChangedEgo {
                        name: ego.name().to_owned(),
                        change: ego.change().clone(),
                    };
                    match egos.iter().find(|known| known.name == ego.name) {
                        // `all` beside a name of it is that ego once.
                        Some(known) if *known == ego => {}
                        Some(_) => {
                            let what = format!("two egos are called `{}`", ego.name);
                            let help = "rows tell them apart by their names".to_owned();
                            return Err(self.source.wrong(&at, what, Some(help)));
                        }
                        None => egos.push(ego),
                    }
                }
            }
            let mut ados = Vec::new();
            let own = top.to("worlds").at(world).to("ados");
            for (nth, entry) in file.worlds[world].ados.iter().enumerate() {
                ados.extend(self.ados(&own.at(nth), world, entry)?);
            }
            for (nth, entry) in file.ados.iter().enumerate() {
                ados.extend(self.ados(&top.to("ados").at(nth), world, entry)?);
            }
            self.told_apart(&ados)?;
            let count = starts.count(&self.worlds[world].1);
            for ego in &egos {
                units.extend(ados.iter().map(|ado| Unit {
                    world,
                    ego: ego.clone(),
                    ado: ado.clone(),
                    starts: count,
                    each: count.max(1),
                }));
            }
        }
        if MAX_UNITS < units.len() {
            let what = format!("{} units are more than {MAX_UNITS}", units.len());
            let help = Some("make several campaigns of it".to_owned());
            return Err(self.source.wrong(&top, what, help));
        }
        let gate = match file.gate {
            None => None,
            Some(gate) if units.iter().any(|unit| unit.ego.name == gate.baseline) => {
                Some((gate.baseline, gate.on))
            }
            Some(gate) => {
                let mut known: Vec<&str> = units.iter().map(|it| it.ego.name.as_str()).collect();
                known.sort_unstable();
                known.dedup();
                let help = guessed(&gate.baseline, "egos", known);
                let what = format!("no ego of the campaign is called `{}`", gate.baseline);
                let at = top.to("gate").to("baseline");
                return Err(self.source.wrong(&at, what, Some(help)));
            }
        };
        let boundary = file.boundary.map(|boundary| (boundary.name, boundary.stl));
        if let Some((_, formula)) = &boundary {
            for (world, _) in &self.worlds {
                boundary::monitor(world, formula).map_err(|error| {
                    let at = top.to("boundary").to("stl");
                    let what = format!("in `{}`: {error}", world.name());
                    self.source
                        .wrong(&at, what, error.help().map(ToString::to_string))
                })?;
            }
        }
        let plan = Plan {
            format: FORMAT,
            sha256: String::new(),
            brakecheck: env!("CARGO_PKG_VERSION").to_owned(),
            name: file.name,
            worlds: self.planned,
            ados: self.ados,
            trainings: self.trainings,
            starts,
            preventability: file.preventability,
            gate,
            boundary,
            units,
        };
        Ok(Checked {
            plan,
            text: self.source.text,
            worlds: self
                .worlds
                .into_iter()
                .map(|(_, as_filed)| as_filed)
                .collect(),
            runs: self.runs,
        })
    }

    fn world(&mut self, at: &Path, entry: &WorldEntry) -> Result<(), CampaignError> {
        let path = self.dir.join(&entry.file);
        let shipped = || Scenario::shipped(&entry.file).and_then(Result::ok);
        let as_filed = match path.is_file() {
            true => Scenario::load(&path)?,
            false => shipped().ok_or_else(|| {
                let what = format!("there is no world `{}`", path.display());
                let known = guessed(&entry.file, "shipped worlds", known_worlds());
                let help = format!("name a file beside the campaign's; {known}");
                self.source.wrong(&at.to("file"), what, Some(help))
            })?,
        };
        let played = match entry.plant {
            Some(plant) => on_plant(&as_filed, plant).map_err(self.source.at(&at.to("plant")))?,
            None => as_filed.clone(),
        };
        let (name, plant) = (as_filed.name(), played.plant());
        let same =
            |(other, _): &(Scenario, Scenario)| other.name() == name && other.plant() == plant;
        if self.worlds.iter().any(same) {
            let what = format!("two worlds are called `{name}`, on the same plant");
            let help = "rows tell them apart by their `name` and `plant`".to_owned();
            return Err(self.source.wrong(at, what, Some(help)));
        }
        let nth = self.planned.len();
        self.planned.push(PlannedWorld {
            name: name.to_owned(),
            file: format!("worlds/{nth}-{}.ron", file_name(name)),
            sha256: sha256(as_filed.text().as_bytes()),
            plant: entry.plant,
        });
        self.worlds.push((played, as_filed));
        Ok(())
    }

    fn egos(
        &self,
        at: &Path,
        world: usize,
        entry: &EgoEntry,
    ) -> Result<Vec<EgoUnderTest>, CampaignError> {
        let played = &self.worlds[world].0;
        let wrong = self.source.at(at);
        match entry {
            EgoEntry::Ego(asked) if asked.ends_with(".ron") => {
                let path = self.dir.join(asked);
                let (change, _) = played.changed_by(&path)?;
                EgoUnderTest::changed(played, asked, &change, "mend the file")
                    .map(|ego| vec![ego])
                    .map_err(wrong)
            }
            EgoEntry::Ego(asked) => EgoUnderTest::find(played, asked).map_err(wrong),
            EgoEntry::Sweep(text) => {
                let sweep = Sweep::parse(text).map_err(&wrong)?;
                sweep.egos(played).map_err(wrong)
            }
            EgoEntry::Changed { name, change } => {
                let help = "mend this change";
                let ego = EgoUnderTest::changed(played, name, change, help).map_err(wrong)?;
                Ok(vec![ego])
            }
            EgoEntry::Family { members, seed } => {
                let Some(family) = played.family().filter(|_| *members <= MAX_MEMBERS) else {
                    let what = format!(
                        "`{}` names no family, or {members} are more than {MAX_MEMBERS}",
                        played.name()
                    );
                    let help = "add `train_against: Family(…)` to the world: docs/reuse.md";
                    return Err(self.source.wrong(at, what, Some(help.to_owned())));
                };
                let member = |index: u64| {
                    let key = StartKey {
                        purpose: Purpose::Test,
                        seed: *seed,
                        index,
                    };
                    let change = family.change(&family.draw(played.name(), key));
                    let name = format!("member {seed}-{index}");
                    EgoUnderTest::changed(played, &name, &change, "narrow the family's ranges")
                };
                let egos: Result<Vec<_>, _> = (0..*members).map(member).collect();
                egos.map_err(wrong)
            }
        }
    }

    fn ados(
        &mut self,
        at: &Path,
        world: usize,
        entry: &AdoEntry,
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        let (played, _) = &self.worlds[world];
        let one = match entry {
            AdoEntry::Neutral => PlannedAdo::Neutral,
            AdoEntry::Held => PlannedAdo::Held,
            AdoEntry::Random => PlannedAdo::Random,
            AdoEntry::Constant(label) => PlannedAdo::Constant {
                action: self.action(at, played, label)?,
                label: label.clone(),
            },
            AdoEntry::Script { name, steps, then } => {
                let decision_s = played.world().clock().decision_s;
                let mut actions = Vec::new();
                for (nth, (label, until_s)) in steps.iter().enumerate() {
                    let at = at.to("steps").at(nth);
                    let action = self.action(&at, played, label)?;
                    let decisions = (until_s / decision_s).round();
                    if decisions <= actions.len() as f64 || MAX_DECISIONS < decisions {
                        let what = format!("this step ends at {until_s} s, before it begins");
                        let help = format!(
                            "each step ends later than the one before; a decision takes {decision_s} s"
                        );
                        return Err(self.source.wrong(&at, what, Some(help)));
                    }
                    actions.resize(decisions as usize, action);
                }
                actions.push(self.action(&at.to("then"), played, then)?);
                let name = name.clone();
                PlannedAdo::Script { name, actions }
            }
            AdoEntry::Search {
                method,
                switches,
                budget,
            } => {
                let name = method.clone().unwrap_or_else(|| "switches".to_owned());
                let settings = MethodSettings {
                    switches: *switches,
                    stored: None,
                };
                let wrong = self.source.at(at);
                if name == "mutate" {
                    let what = "a campaign has no training whose counterexamples are mutated";
                    let help = "use another method, or `brakecheck search RUN --method mutate`";
                    return Err(self.source.wrong(at, what, Some(help.to_owned())));
                }
                let known = Method::named(&name, &settings).map_err(&wrong)?;
                let given = [
                    switches.map(|_| MethodOption::Switches),
                    budget.map(|_| MethodOption::Budget),
                ];
                let given: Vec<MethodOption> = given.into_iter().flatten().collect();
                known.info().refuse_others(&given).map_err(wrong)?;
                PlannedAdo::Search {
                    method: name,
                    switches: switches.unwrap_or(SWITCHES),
                    budget: budget.unwrap_or(BUDGET),
                }
            }
            AdoEntry::Trained(dir) => return self.trained(at, world, dir),
            AdoEntry::Training {
                seeds,
                first_seed,
                decisions,
            } => {
                if *seeds == 0 || MAX_MEMBERS < *seeds {
                    let what = format!("{seeds} trainings: there are 1 to {MAX_MEMBERS}");
                    return Err(self.source.wrong(&at.to("seeds"), what, None));
                }
                if let Some(decisions) = decisions {
                    played.training_for(*decisions)?;
                }
                let mut ados = Vec::new();
                for nth in 0..*seeds {
                    let planned = PlannedTraining {
                        world,
                        seed: first_seed.saturating_add(nth),
                        decisions: *decisions,
                    };
                    let training = self.trainings.len();
                    ados.push(PlannedAdo::Training { training });
                    self.trainings.push(planned);
                }
                return Ok(ados);
            }
        };
        Ok(vec![one])
    }

    /// An ego on a map of another size has other starts, which pair with nobody's.
    fn starts_alike(
        &self,
        at: &Path,
        world: usize,
        ego: &EgoUnderTest,
    ) -> Result<(), CampaignError> {
        let (played, _) = &self.worlds[world];
        match ego.scenario().axes() == played.axes() {
            true => Ok(()),
            false => {
                let (name, world) = (ego.name(), played.name());
                let what = format!("`{name}` starts elsewhere than `{world}`");
                let help = "write a world file of that map, and name it under `worlds`";
                Err(self.source.wrong(at, what, Some(help.to_owned())))
            }
        }
    }

    /// Ados that rows could not tell apart are refused.
    fn told_apart(&self, ados: &[PlannedAdo]) -> Result<(), CampaignError> {
        let key = |ado: &PlannedAdo| match ado {
            PlannedAdo::Training { training } => {
                let seed = self.trainings.get(*training).map(|it| it.seed);
                (ado.word(), seed)
            }
            PlannedAdo::Trained { run } => (ado.word(), self.ados.get(*run).map(|it| it.seed)),
            other => (other.word(), None),
        };
        for (nth, ado) in ados.iter().enumerate() {
            if ados[..nth].iter().any(|other| key(other) == key(ado)) {
                let (word, seed) = key(ado);
                let seed = seed.map_or(String::new(), |seed| format!(" of seed {seed}"));
                let what = format!("two ados of a world are called `{word}`{seed}");
                let help = "rows tell them apart by `ado` and `train_seed`: make two campaigns";
                let at = Path::top().to("ados");
                return Err(self.source.wrong(&at, what, Some(help.to_owned())));
            }
        }
        Ok(())
    }

    /// The number of an action, as `check` lists them.
    fn action(&self, at: &Path, world: &Scenario, label: &str) -> Result<usize, CampaignError> {
        let actions = 0..world.world().spaces().actions;
        let labels: Vec<String> = actions.map(|it| world.action_label(it)).collect();
        let found = labels.iter().position(|known| known == label);
        found.ok_or_else(|| {
            let what = format!("`{}` has no action `{label}`", world.name());
            let known = labels.iter().map(String::as_str).collect::<Vec<_>>();
            self.source
                .wrong(at, what, Some(guessed(label, "actions", known)))
        })
    }

    /// The ado of a run: in the run's own world only.
    fn trained(
        &mut self,
        at: &Path,
        world: usize,
        dir: &str,
    ) -> Result<Vec<PlannedAdo>, CampaignError> {
        let played = &self.worlds[world].0;
        let path = self.dir.join(dir);
        let run = RunDir::open(&path)?;
        // A conditional ado has to be told who it meets, and refuses here.
        run.policy()?;
        let own = run.scenario()?;
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
        Ok(vec![PlannedAdo::Trained { run }])
    }

    fn starts(&self, at: &Path, entry: StartsEntry) -> Result<StartsAsked, CampaignError> {
        let (axes, seed) = match entry {
            StartsEntry::Drawn { count, seed } if (1..=MAX_STARTS).contains(&count) => {
                return Ok(StartsAsked::Drawn { count, seed });
            }
            StartsEntry::Drawn { count, .. } => {
                let what = format!("{count} starts: there are 1 to {MAX_STARTS}");
                return Err(self.source.wrong(&at.to("count"), what, None));
            }
            StartsEntry::Grid { axes, seed } => (axes, seed),
        };
        let mut values = Vec::new();
        for (name, (lo, hi, steps)) in axes.0 {
            let place = at.to("axes").to(&name);
            for (world, _) in &self.worlds {
                self.axis(&place, world, (&name, lo, hi))?;
            }
            let sane = (1..=MAX_STARTS).contains(&steps) && (lo < hi || (lo == hi && steps == 1));
            if !sane {
                let what = format!("{steps} values from {lo} to {hi} are no axis");
                let help = "write `(least, greatest, how many)`".to_owned();
                return Err(self.source.wrong(&place, what, Some(help)));
            }
            let last = (steps - 1).max(1) as f64;
            // Without the dust of binary fractions, since rows hold them.
            let value = |nth: usize| {
                let value = lo + (hi - lo) * nth as f64 / last;
                (value * 1e9).round() / 1e9
            };
            values.push((name, (0..steps).map(value).collect::<Vec<f64>>()));
        }
        let all = values
            .iter()
            .try_fold(1usize, |all, (_, along)| all.checked_mul(along.len()));
        match all.filter(|all| (1..=MAX_STARTS).contains(all)) {
            Some(_) if !values.is_empty() => Ok(StartsAsked::Grid { axes: values, seed }),
            _ => {
                let what = format!("the grid has no axis, or more than {MAX_STARTS} points");
                Err(self.source.wrong(&at.to("axes"), what, None))
            }
        }
    }

    /// Whether a world may start everywhere along an axis.
    fn axis(
        &self,
        place: &Path,
        world: &Scenario,
        (name, lo, hi): (&str, f64, f64),
    ) -> Result<(), CampaignError> {
        let axes = world.axes();
        let Some(axis) = axes.iter().find(|axis| axis.name == name) else {
            let what = format!("`{}` has no start `{name}`", world.name());
            let known: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            let help = format!(
                "{} (those that are ranges in the world)",
                guessed(name, "known", known)
            );
            return Err(self.source.wrong(place, what, Some(help)));
        };
        match axis.lo <= lo && hi <= axis.hi {
            true => Ok(()),
            false => {
                let what = format!(
                    "`{name}` ranges over {} to {} {} in `{}`",
                    axis.lo,
                    axis.hi,
                    axis.unit,
                    world.name()
                );
                let help = "stay within it, or widen it in the world".to_owned();
                Err(self.source.wrong(place, what, Some(help)))
            }
        }
    }
}

fn known_worlds() -> Vec<&'static str> {
    Scenario::shipped_names().collect()
}

impl Plan {
    /// On which plant a unit's ego is tested, if not on the world's own.
    pub(super) fn plant(&self, unit: &Unit) -> Option<PlantKind> {
        self.worlds.get(unit.world)?.plant
    }
}
