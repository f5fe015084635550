//! `brakecheck eval`: a frozen ado on test starts and egos, beside baselines.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::keeping::{Found, Pending};
use super::rivals::Rivals;
use super::told::{Params, Playing, playing};
use super::{
    Common, Exit, Failure, NamedEgo, PlantArg, all_played, consent, egos_or_program,
    interrupted_early, on_plant, open_run, print_json, say_if_moody, start_count, table, talk,
    theorems,
};
use crate::campaign::{
    Ado, EvalRequest, Evaluated, Method, Relation, SearchRequest, TestStarts, Tries, Watch,
    best_constant, eval, explain_first, retrained, reused_on, search, summarise, test_starts,
};
use crate::run::{ChangedEgo, Row, RunDir};
use crate::scenario::{Against, Change, Scenario};
use crate::scene::grid::GridWorld;
use crate::scene::grid::exact::{Indistinct, PositionPolicy, chase};
use crate::stl::Explanation;

#[derive(Args, Debug)]
pub(super) struct EvalArgs {
    /// The run directory that `train` made.
    run: PathBuf,
    /// Test starts to draw.
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = start_count())]
    starts: usize,
    /// Who plays the ado; repeat for several.
    #[arg(long, value_enum, default_value = "trained", value_name = "ADO")]
    ado: Vec<AdoArg>,
    /// Which ego is tested: nominal, a name under `reuse`, a RON file, or all.
    #[arg(long, default_value = "nominal", value_name = "NAME|FILE.ron|all")]
    ego: String,
    /// The physics to test in, instead of the run's.
    #[arg(long)]
    plant: Option<PlantArg>,
    /// Also search with at most so many switches, and fill in recall.
    #[arg(long, value_name = "M")]
    search: Option<usize>,
    /// What a conditional ado is told of each ego: its nominal or its true
    /// parameters, those identified from recorded runs, those adapted by how the
    /// ado then fares, or those of a file that `identify` wrote.
    #[arg(long, value_name = "nominal|true|identified|adapted|P.ron")]
    params: Option<String>,
    /// Runs of the trained ado per start: the greedy one, then explored ones.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(super) tries: u64,
    /// Write counterexamples of the trained ado into a directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Counterexamples to write per ego.
    #[arg(long, value_name = "N", default_value_t = 10, requires = "keep")]
    pub(super) keep_most: usize,
    /// Also check the paper's theorems: 1 and 2 on a grid, 3 and Lemma 1 on the road.
    #[arg(long)]
    theorems: bool,
    /// Exit with 1 if any ado makes an ego fail.
    #[arg(long)]
    fail_on_counterexample: bool,
    /// A program that is the ego, after `--`: typing it consents to start it.
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    #[command(flatten)]
    pub(super) common: Common,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum AdoArg {
    /// The trained policy.
    Trained,
    /// A random action at each decision.
    Random,
    /// A random action, held for five decisions.
    Hold,
    /// The best of the constant actions.
    Constant,
    /// A rule with three zones, tuned on the nominal ego.
    Heuristic,
    /// The nearest training counterexample, replayed; then the ten nearest.
    Replays,
    /// One trained anew for each changed ego, kept under RUN/retrained.
    Retrained,
    /// The exact solution of a grid world.
    Optimal,
    /// A step towards the ego along the larger axis (grid worlds).
    Chaser,
    /// All of them that apply; `retrained` takes a training per changed ego.
    All,
}

pub(super) fn run(args: &EvalArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common)?;
    let params = Params::of(&run, args.params.as_deref())?;
    if params.is_none() {
        // A conditional ado refuses here to be played untold.
        run.policy()?;
    }
    let mut nominal = run.scenario()?;
    if let Some(plant) = args.plant {
        nominal = on_plant(&nominal, plant)?;
    }
    let egos = egos_or_program(&nominal, &args.ego, &args.program)?;
    let world = run.world()?;
    consent(all_played(&world, &egos))?;
    if let Some(params) = &params {
        params.check(&run, &egos)?;
    }
    let keeps_something = [AdoArg::Trained, AdoArg::All, AdoArg::Optimal]
        .iter()
        .any(|ado| args.ado.contains(ado));
    if args.keep.is_some() && !keeps_something {
        return Err(Failure::input(
            "`--keep` writes counterexamples of the trained ado, which is not asked for",
            "add `--ado trained`",
        ));
    }
    let bar = talk::bar("evaluating");
    let watch = bar.watch();
    let Some(starts) = test_starts(&world, args.common.seed, args.starts, &watch) else {
        return interrupted_early(&args.common);
    };
    let mut rivals = Rivals::default();
    let drives = nominal.grid().is_none();
    let all = drives && args.ado.contains(&AdoArg::All);
    if all || args.ado.contains(&AdoArg::Heuristic) {
        rivals.tune(&run, &nominal, &watch)?;
    }
    // Only a training against one ego stores counterexamples.
    if (all && run.manifest().against.is_nominal()) || args.ado.contains(&AdoArg::Replays) {
        rivals.read(&run)?;
    }
    let mut reused = Vec::new();
    let mut reasons = Vec::new();
    let mut to_keep = Vec::new();
    // What was computed before is printed all the same.
    let mut failed = None;
    for ego in &egos {
        bar.now(format!("evaluating: {}", ego.name));
        // On a map of another size the starts are others: drawn, or listed, anew.
        let own = match ego.scenario.axes() == nominal.axes() {
            true => None,
            false => {
                let drawn = test_starts(&ego.scenario, args.common.seed, args.starts, &watch);
                if drawn.is_none() {
                    break;
                }
                drawn
            }
        };
        let playing = match playing(&run, params.as_ref(), ego, args.common.seed, &watch) {
            Ok(playing) => playing,
            Err(failure) => {
                failed = Some(failure);
                break;
            }
        };
        let job = Job {
            args,
            playing: &playing,
            train_seed: run.manifest().seed,
            starts: own.as_ref().unwrap_or(&starts),
            watch: &watch,
            rivals: &rivals,
            run: &run,
            on_a_grid: nominal.grid().is_some(),
        };
        let Met {
            rows,
            reason,
            found,
            failure,
        } = job.one_ego(ego);
        failed = failure;
        if talk::stopped() && rows.iter().all(|row| row.starts + row.invalid == 0) {
            break;
        }
        bar.aside(|| say_if_moody(ego, job.starts, &watch));
        reasons.extend(reason);
        let relation = relation(&run, &nominal, ego);
        reused.push(reused_on(
            &ego.scenario,
            (&ego.name, relation),
            job.starts,
            rows,
            &watch,
        ));
        if let (Some(found), true) = (found, args.keep.is_some()) {
            to_keep.push(Pending {
                ego,
                found,
                playing,
                starts: own,
            });
        }
        if watch.stopped() || failed.is_some() {
            break;
        }
    }
    let mut checked = None;
    if args.theorems && !watch.stopped() && failed.is_none() {
        bar.now("theorems".to_owned());
        let changed = match args.ego.as_str() {
            "nominal" => super::egos(&nominal, "all")?,
            _ => egos.clone(),
        };
        // One ado for all egos: a conditional one is told of the nominal ego.
        let own = NamedEgo::nominal(&nominal);
        let playing = playing(&run, params.as_ref(), &own, args.common.seed, &watch);
        let found = playing.and_then(|playing| {
            theorems::check(&nominal, changed, &*playing.policy, &starts, &watch)
        });
        match found {
            Ok(found) => checked = found,
            Err(failure) => failed = Some(failure),
        }
    }
    drop(bar);
    let rows: Vec<Row> = reused.iter().flat_map(|ego| ego.rows.clone()).collect();
    let summary = summarise(&reused, "trained");
    if args.common.json {
        let explain = reasons.iter();
        let explain: Vec<_> = explain
            .map(|why| json!({ "ego": why.ego, "start": why.start, "explain": why.explanation }))
            .collect();
        let mut object = json!({
            "rows": rows, "egos": reused, "summary": summary, "explain": explain,
        });
        if let Some(checked) = &checked {
            object["theorems"] = checked.json.clone();
        }
        print_json(&object)?;
    } else {
        talk::data(&table::reuse(&reused, &summary))?;
        for why in &reasons {
            talk::data(&format!(
                "\nwhy `{}` fails from start {}, the first of them: {}",
                why.ego, why.start, why.explanation
            ))?;
        }
        if let Some(checked) = &checked {
            talk::data(&format!("\n{}", checked.text))?;
        }
    }
    if let Some(dir) = &args.keep {
        for pending in &to_keep {
            pending.keep(dir, args, &starts, run.manifest().seed)?;
        }
    }
    if let Some(failure) = failed {
        return Err(failure);
    }
    if talk::stopped() {
        talk::say("interrupted: the rows cover the starts that were finished");
        return Ok(Exit::Interrupted);
    }
    if checked.is_some_and(|checked| checked.is_refuted) {
        return Err(Failure::fault(
            "a theorem failed on a pair of runs, which it cannot",
            Some("this is a bug of brakecheck: please report it with the run".to_owned()),
        ));
    }
    let found = rows.iter().any(|row| 0 < row.successes);
    Ok(match found && args.fail_on_counterexample {
        true => Exit::Counterexample,
        false => Exit::Done,
    })
}

/// What an ego was to the ado in training.
fn relation(run: &RunDir, nominal: &Scenario, ego: &NamedEgo) -> Relation {
    let none = Change::default();
    let trained = run.manifest().ego.as_ref().map_or(&none, |ego| &ego.change);
    if ego.change == *trained {
        return Relation::Trained;
    }
    match (nominal.against, nominal.family()) {
        (Against::Nominal, _) | (_, None) => Relation::ZeroShot,
        (_, Some(family)) if family.covers(&ego.change) => Relation::Inside,
        _ => Relation::Outside,
    }
}

/// Why the first counterexample of an ego is one.
struct Reason {
    ego: String,
    start: usize,
    explanation: Explanation,
}

/// What came of one ego, as far as it was met.
#[derive(Default)]
struct Met {
    rows: Vec<Row>,
    reason: Option<Reason>,
    found: Option<Found>,
    failure: Option<Failure>,
}

#[derive(Clone, Copy)]
struct Job<'a> {
    args: &'a EvalArgs,
    playing: &'a Playing,
    train_seed: u64,
    starts: &'a TestStarts,
    watch: &'a Watch<'a>,
    rivals: &'a Rivals,
    run: &'a RunDir,
    on_a_grid: bool,
}

impl Job<'_> {
    /// The rows of one ego, why the trained ado made it fail, what may be kept;
    /// all as far as it came.
    fn one_ego(&self, ego: &NamedEgo) -> Met {
        let mut met = Met::default();
        met.failure = self.meet(ego, &mut met).err();
        met
    }

    fn meet(&self, ego: &NamedEgo, met: &mut Met) -> Result<(), Failure> {
        for ado in self.ados() {
            let rivals = match ado {
                AdoArg::Heuristic => self.rivals.heuristic(),
                AdoArg::Replays => self.rivals.replays(),
                _ => Vec::new(),
            };
            for rival in rivals {
                met.rows
                    .push(eval(&self.request(ego, rival), self.watch).row);
            }
            if let Some(row) = self.one_ado(ego, ado, met)? {
                met.rows.push(row);
            }
        }
        if let Some(switches) = self.args.search {
            let request = SearchRequest {
                scenario: &ego.scenario,
                ego: &ego.name,
                method: Method::Switches(switches),
                budget: 0,
                starts: self.starts,
            };
            let searched = search(&request, self.watch);
            for row in &mut met.rows {
                row.compare_with_search(&searched.row.solved);
            }
            met.rows.push(searched.row);
        }
        Ok(())
    }

    fn ados(&self) -> Vec<AdoArg> {
        match self.args.ado.contains(&AdoArg::All) {
            true => {
                let mut all = vec![
                    AdoArg::Trained,
                    AdoArg::Hold,
                    AdoArg::Random,
                    AdoArg::Constant,
                ];
                all.extend(match self.on_a_grid {
                    true => [AdoArg::Optimal, AdoArg::Chaser].as_slice(),
                    false => &[AdoArg::Heuristic, AdoArg::Replays, AdoArg::Retrained],
                });
                all
            }
            false => self.args.ado.clone(),
        }
    }

    fn request<'b>(&'b self, ego: &'b NamedEgo, ado: Ado<'b>) -> EvalRequest<'b> {
        EvalRequest {
            scenario: &ego.scenario,
            ego: &ego.name,
            ado,
            starts: self.starts,
        }
    }

    /// One trained for this very ego; the nominal one has the trained ado.
    fn retrained(&self, ego: &NamedEgo) -> Result<Option<Row>, Failure> {
        if ego.change == Change::default() {
            return Ok(None);
        }
        let own = ChangedEgo {
            name: ego.name.clone(),
            change: ego.change.clone(),
        };
        let own = retrained(self.run, &own, &ego.scenario, self.watch)?;
        let Some(own) = own else {
            return Ok(None);
        };
        let policy = own.policy()?;
        let request = self.request(ego, Ado::Trained(&*policy, self.train_seed));
        let mut evaluated = eval(&request, self.watch);
        evaluated.row.ado = "retrained".to_owned();
        evaluated.row.method = own.scenario()?.learner.name().to_lowercase();
        Ok(Some(evaluated.row))
    }

    /// The trained ado, with several tries per start where they are asked for.
    fn trained(&self, ego: &NamedEgo, met: &mut Met) -> Row {
        let request = self.request(ego, Ado::Trained(&*self.playing.policy, self.train_seed));
        let (found, mut row) = if 1 < self.args.tries {
            let tries = Tries {
                request,
                policy: &*self.playing.policy,
                others: &self.playing.others,
                tries: self.args.tries,
            };
            let tried = tries.run(self.watch);
            let row = tried.evaluated.row.clone();
            (Found::ByTries(tried), row)
        } else {
            let evaluated = eval(&request, self.watch);
            let explained = explain_first(&request, &evaluated);
            met.reason = explained.map(|(start, explanation)| Reason {
                ego: ego.name.clone(),
                start,
                explanation,
            });
            let row = evaluated.row.clone();
            (Found::Trained(evaluated), row)
        };
        met.found = Some(found);
        row.told = self.playing.told.map(str::to_owned);
        row
    }

    /// `None`: a rival, which has rows of its own.
    fn one_ado(&self, ego: &NamedEgo, ado: AdoArg, met: &mut Met) -> Result<Option<Row>, Failure> {
        let ado = match ado {
            AdoArg::Constant => {
                let (scenario, name) = (&ego.scenario, &ego.name);
                let best = best_constant(scenario, name, self.starts, self.watch);
                return Ok(Some(best.row));
            }
            AdoArg::Optimal | AdoArg::Chaser => {
                let evaluated = self.by_rule(ego, ado)?;
                let row = evaluated.row.clone();
                // Files are named after world and ego: the trained ado's go first.
                if ado == AdoArg::Optimal && !self.ados().contains(&AdoArg::Trained) {
                    met.found = Some(Found::Optimal(evaluated));
                }
                return Ok(Some(row));
            }
            AdoArg::Heuristic | AdoArg::Replays => return Ok(None),
            AdoArg::Retrained => return self.retrained(ego),
            AdoArg::Random => Ado::Random,
            AdoArg::Hold => Ado::Held,
            AdoArg::Trained | AdoArg::All => return Ok(Some(self.trained(ego, met))),
        };
        Ok(Some(eval(&self.request(ego, ado), self.watch).row))
    }

    /// The best ado of a grid world, or the chaser: they see both positions.
    fn by_rule(&self, ego: &NamedEgo, ado: AdoArg) -> Result<Evaluated, Failure> {
        let whole = ego.scenario.fully_observed();
        let Some((whole, grid)) = whole.as_ref().and_then(|s| Some((s, s.grid()?))) else {
            return Err(Failure::input(
                format!("`{}` is no grid world", ego.scenario.name),
                "only grid worlds are solved exactly: leave out `--ado optimal` and `chaser`",
            ));
        };
        let (policy, word, method) = match ado {
            AdoArg::Chaser => {
                let moves = &grid.spec().moves;
                let policy = PositionPolicy::new(grid, |both| (chase(both, moves), 0.0));
                (policy, "chaser", "along the larger axis")
            }
            _ => (optimal(whole, grid), OPTIMAL.0, OPTIMAL.1),
        };
        let policy = policy.map_err(|error| Failure::fault(error.to_string(), None))?;
        let request = EvalRequest {
            scenario: whole,
            ego: &ego.name,
            ado: Ado::Rule(&policy, word, method),
            starts: self.starts,
        };
        Ok(eval(&request, self.watch))
    }
}

/// How rows call the best ado of a grid world, and how it was found.
pub(super) const OPTIMAL: (&str, &str) = ("optimal", "backward induction");

/// The best ado of a grid world.
pub(super) fn optimal(whole: &Scenario, grid: &GridWorld) -> Result<PositionPolicy, Indistinct> {
    let reward = whole.rulebook().reward;
    PositionPolicy::optimal(grid, |rho| reward.lawful(rho))
}
