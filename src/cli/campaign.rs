//! `brakecheck campaign`: many worlds, egos, ados and starts, in pieces.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde_json::json;

use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::{NO_START, are_left_out, finished, print_json, table_of};
use super::failure::{Exit, Failure};
use super::number_args::{count, positive};
use super::terminal::{self, Common};
use super::{examples, progress};
use crate::campaign::{
    COLUMNS, Merged, PIECE_S, Partition, PieceDone, Plan, PlanCost, PlanDir, SummaryRow, UnitGate,
};
use crate::run_dir::counted;

/// Rows that are printed, at most, and rows and gates of the details.
const SHOWN: usize = 8;
const SHOWN_IN_DETAILS: usize = 40;
/// Closed gates that are named below the table.
const CLOSED_SHOWN: usize = 3;

/// Legend of the columns of rates.
const EXPLAINED: &str = "
fails %  share of the starts from which the ego fails, every rule kept; 95 %: its interval
recall   of the starts that search solves, the share solved here too; –: no search against this ego
fouls    starts on which the ado broke a rule first; contact: starts that end in one
prev.    failures that CC_LATCHED or FSM would have avoided; –: they were not judged
closing  median closing speed of the failures that end in contact, m/s";

#[derive(Args, Debug)]
pub(super) struct CampaignArgs {
    #[command(subcommand)]
    step: CampaignVerb,
}

#[derive(Subcommand, Debug)]
enum CampaignVerb {
    /// Cut a campaign file into pieces, with files for engines that run them.
    #[command(after_help = examples::CAMPAIGN_PLAN)]
    Plan(PlanArgs),
    /// Make all missing pieces, a partition of them, or a single piece.
    #[command(after_help = examples::CAMPAIGN_RUN)]
    Run(RunArgs),
    /// Check all pieces and write them as one file, with a summary and a page.
    #[command(after_help = examples::CAMPAIGN_MERGE)]
    Merge(MergeArgs),
}

#[derive(Args, Debug)]
struct PlanArgs {
    /// The campaign file: docs/guide/campaigns.md.
    #[arg(value_name = "CAMPAIGN.ron")]
    file: PathBuf,
    /// The directory to plan into.
    #[arg(short, long, value_name = "DIR", required_unless_present = "dry_run")]
    output: Option<PathBuf>,
    /// Cut pieces of about S seconds by an estimate from the worlds, without a pilot
    /// [default: a pilot, and 10 seconds].
    #[arg(long, value_name = "S", value_parser = positive)]
    piece_s: Option<f64>,
    /// Only print the number of pieces, hours and bytes.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    common: Common,
}

#[derive(Args, Debug)]
struct RunArgs {
    /// The directory of the plan.
    dir: PathBuf,
    /// Make only this piece, counted from 0, as engines do.
    #[arg(long, value_name = "I", value_parser = count(0..=999_999_999))]
    piece: Option<u64>,
    /// Make only the I-th of N parts, counted from 1, with the trainings it needs.
    #[arg(long, value_name = "I/N", conflicts_with = "piece")]
    partition: Option<Partition>,
    #[command(flatten)]
    common: Common,
}

#[derive(Args, Debug)]
struct MergeArgs {
    /// The directory of the plan.
    dir: PathBuf,
    /// A copy of the plan directory with pieces of another machine (repeatable).
    #[arg(long, value_name = "DIR")]
    with: Vec<PathBuf>,
    #[command(flatten)]
    answer: AnswerArgs,
    #[command(flatten)]
    common: Common,
}

impl CampaignArgs {
    pub(super) fn common(&self) -> &Common {
        match &self.step {
            CampaignVerb::Plan(args) => &args.common,
            CampaignVerb::Run(args) => &args.common,
            CampaignVerb::Merge(args) => &args.common,
        }
    }
}

pub(super) fn run(args: &CampaignArgs) -> Result<Exit, Failure> {
    // Pieces belong to the text of their plan, which a flag is not in.
    if args.common().fresh {
        return Err(Failure::input(
            "a campaign does not take `--fresh`",
            "write `fresh: true` into the ego's `Process(…)` in the world or the campaign",
        ));
    }
    match &args.step {
        CampaignVerb::Plan(args) => plan(args),
        CampaignVerb::Run(args) => match args.piece {
            // The parser allows nine digits, so the number fits into 32 bits.
            Some(number) => one(args, number as usize),
            None => all(args),
        },
        CampaignVerb::Merge(args) => merge(args),
    }
}

fn plan(args: &PlanArgs) -> Result<Exit, Failure> {
    let bar = progress::bar(&args.common, "pilot");
    let allowed = args.common.allow_programs;
    let cut = Plan::make(&args.file, args.piece_s, allowed, &bar.watch())?;
    drop(bar);
    let Some(cut) = cut else {
        // A partial pilot has no costs to cut by.
        terminal::note("interrupted: nothing was planned");
        return Ok(Exit::Interrupted);
    };
    // A dry run plays the pilot for its costs, and writes nothing.
    let dir = args.output.as_ref().filter(|_| !args.dry_run);
    if let Some(dir) = dir {
        cut.write(dir)?;
    }
    let cost = &cut.cost;
    if args.common.json {
        print_json(&json!({
            "campaign": cut.plan().name,
            "dir": dir,
            "pieces": cost.pieces,
            "trainings": cost.trainings,
            "units": cut.plan().units.len(),
            "starts": cost.starts,
            "cpu_s": cost.cpu_s,
            "bytes": cost.bytes,
            "measured": cost.measured,
        }))?;
        return Ok(Exit::Done);
    }
    terminal::data(&in_words(cost))?;
    if let Some(dir) = dir {
        let dir = dir.display();
        terminal::data(&format!(
            "planned in {dir}; next: brakecheck campaign run {dir}\n\
             or by an engine, in that directory: snakemake --cores 2, or slurm.sh"
        ))?;
    }
    Ok(Exit::Done)
}

fn in_words(cost: &PlanCost) -> String {
    let PlanCost {
        pieces,
        trainings,
        starts,
        cpu_s,
        ..
    } = cost;
    let by = if cost.measured {
        "measured by a pilot"
    } else {
        "guessed from the worlds"
    };
    // Below an hour, tenths of an hour would be too coarse.
    let hours = if *cpu_s < 3600.0 {
        format!("{cpu_s:.0} s")
    } else {
        format!("{:.1} h", cpu_s / 3600.0)
    };
    let megabytes = cost.bytes / 1e6;
    format!(
        "{}, {trainings} of them trainings; {}; about {hours} of processor time ({by}), \
         {megabytes:.1} MB on the disk",
        counted(*pieces, "piece"),
        counted(*starts, "start")
    )
}

fn one(args: &RunArgs, number: usize) -> Result<Exit, Failure> {
    let dir = opened(&args.dir, &args.common)?;
    let bar = progress::bar(&args.common, "campaign");
    let done = dir.run_piece(number, &bar.watch())?;
    drop(bar);
    let word = match done {
        PieceDone::Before => "was there already",
        PieceDone::Now => "is done",
        PieceDone::Stopped => "was interrupted: nothing of it is kept",
    };
    if args.common.json {
        // A piece from an earlier run is done, too, so engines that retry see a success.
        print_json(&json!({ "piece": number, "done": done != PieceDone::Stopped }))?
    } else {
        terminal::note(&format!("piece {number} {word}"))
    }
    // After Ctrl-C the code is 130, so an engine does not take the piece for made.
    Ok(finished(Exit::Done))
}

fn all(args: &RunArgs) -> Result<Exit, Failure> {
    let dir = opened(&args.dir, &args.common)?;
    let bar = progress::bar(&args.common, "campaign");
    let partition = args.partition.unwrap_or(Partition::WHOLE);
    let ran = dir.run_partition(partition, &bar.watch())?;
    drop(bar);
    let (done, all) = (ran.done, ran.all);
    if args.common.json {
        let failed: Vec<_> = ran
            .failed
            .iter()
            .map(|(piece, error)| json!({ "piece": piece, "why": error.to_string() }))
            .collect();
        print_json(&json!({ "pieces": all, "done": done, "failed": failed }))?;
    } else {
        let of = match args.partition {
            Some(partition) => format!(" of partition {partition}"),
            None => String::new(),
        };
        let are = if all == 1 { "is" } else { "are" };
        let pieces = counted(all, "piece");
        terminal::data(&format!("{done} of {pieces}{of} {are} there"))?;
    }
    // Pieces often fail for the same reason, so one error is printed in full.
    let more = ran.failed.len().saturating_sub(1);
    if let Some((piece, error)) = ran.failed.into_iter().next() {
        terminal::note(&format!(
            "piece {piece} cannot be made{}; the same command makes what is not there",
            match more {
                0 => String::new(),
                more => format!(", nor can {}", counted(more, "other")),
            }
        ));
        return Err(error.into());
    }
    if terminal::stopped() {
        terminal::note("interrupted: the pieces that are there are kept; the same command goes on");
    }
    Ok(finished(Exit::Done))
}

fn opened(dir: &std::path::Path, common: &Common) -> Result<PlanDir, Failure> {
    Ok(PlanDir::open(
        dir,
        common.allow_programs,
        common.allow_invalid,
    )?)
}

fn merge(args: &MergeArgs) -> Result<Exit, Failure> {
    let dir = opened(&args.dir, &args.common)?;
    let bar = progress::bar(&args.common, "merging");
    let merged = dir.merge(&args.with, &bar.watch());
    drop(bar);
    if terminal::stopped() {
        terminal::note("interrupted: nothing was merged");
        return Ok(Exit::Interrupted);
    }
    // An interruption is also an error of the merge, and comes first because it has its
    // own exit code.
    let merged = merged?;
    // The page is written before anything is printed, because the text names it.
    let page = dir.write_page(&merged)?;
    if args.common.json {
        print_json(&json!({
            "rows": merged.rows,
            "file": merged.path,
            "sha256": merged.sha256,
            "page": page,
            "summary": merged.summary,
        }))?;
    } else {
        terminal::data(&answer(&merged, &page).text(args.answer))?;
    }
    ended(args, &merged)
}

fn ended(args: &MergeArgs, merged: &Merged) -> Result<Exit, Failure> {
    let invalid = merged.summary.invalid_share();
    // Pieces may have run in other processes, so the log of this process has no faults.
    if args.common.refuses(invalid) {
        return Err(Failure::fault(
            format!(
                "in a row {:.1} % of the starts are invalid: the ego or the physics failed to run",
                100.0 * invalid
            ),
            Some("mend the ego, or allow a share with `--allow-invalid SHARE`".to_owned()),
        ));
    }
    let rows = merged.summary.rows.iter();
    if are_left_out(rows.map(|row| [row.starts, row.invalid])) {
        return Err(Failure::fault(
            NO_START,
            Some("correct the starts of the campaign, or test another ego".to_owned()),
        ));
    }
    // A gate that compares nothing is open, which CI must not take for a pass.
    if merged.summary.is_unanswered() {
        return Err(Failure::fault(
            "no gate compares a start: none has a result on both egos with every rule kept",
            Some("plan more starts, or ados that keep their rules".to_owned()),
        ));
    }
    Ok(if merged.summary.has_closed_gate() {
        Exit::Counterexample
    } else {
        Exit::Done
    })
}

/// Returns the numbers of closed gates and of failing egos, with the worst rates.
fn answer(merged: &Merged, page: &Path) -> PrintedAnswer {
    let (rows, all) = (&merged.summary.rows, &merged.summary.gates);
    // A row without a valid start has no rate.
    let rated = rows.iter().filter(|row| row.starts > 0);
    // Strictly greater, so that of equal rates the first in plan order is named.
    let worst = rated.reduce(|a, b| {
        if b.success_rate > a.success_rate {
            b
        } else {
            a
        }
    });
    let worst = worst.map(|row| {
        format!(
            "highest rate: `{}` fails from {} of {} of {} against {}",
            row.ego,
            row.successes,
            counted(row.starts, "start"),
            row.world,
            row.ado
        )
    });
    // The details repeat the rows of the table, so that each world stays one table.
    let mut details = rates(rows, SHOWN_IN_DETAILS);
    if !all.is_empty() {
        details.push_str(&gates(all));
    }
    let verdict = (!all.is_empty()).then(|| open_gates(all));
    PrintedAnswer {
        verdict: verdict.into_iter().chain(worst).collect(),
        table: format!(
            "{}{} in {}\npage: {}",
            rates(rows, SHOWN),
            counted(merged.rows, "row"),
            merged.path.display(),
            page.display()
        ),
        details: format!("{details}\nSHA-256 {}", merged.sha256),
        legend: EXPLAINED.to_owned(),
        // They decide the exit code.
        warnings: closed_gates(all),
    }
}

/// Names the first closed gates in one line, without their reasons.
fn closed_gates(gates: &[UnitGate]) -> String {
    let closed = gates.iter().filter(|gate| gate.decided.is_closed());
    let named = closed.map(|it| {
        let seed = it
            .train_seed
            .map_or(String::new(), |seed| format!(" {seed}"));
        let ego = &it.decided.gate.ego;
        format!("`{ego}` against {}{seed} in {}", it.ado, it.world)
    });
    let named: Vec<String> = named.collect();
    if named.is_empty() {
        return String::new();
    }
    let more = match named.len().saturating_sub(CLOSED_SHOWN) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let first: Vec<String> = named.into_iter().take(CLOSED_SHOWN).collect();
    format!("closed gates: {}{more}", first.join(", "))
}

/// Formats the first rows, world by world. The page has all of them.
fn rates(rows: &[SummaryRow], most: usize) -> String {
    let mut text = String::new();
    let of_one_world =
        |a: &SummaryRow, b: &SummaryRow| (&a.world, &a.plant) == (&b.world, &b.plant);
    for world in rows[..rows.len().min(most)].chunk_by(of_one_world) {
        let (name, plant) = (&world[0].world, &world[0].plant);
        let table = table_of(COLUMNS, world.iter().map(SummaryRow::cells));
        text.push_str(&format!("{name}, {plant}\n{table}\n{}", remarks(world)));
    }
    match rows.len().saturating_sub(most) {
        0 => text,
        1 => format!("{text}1 more row is in the page and in summary.json\n"),
        more => format!("{text}{more} more rows are in the page and in summary.json\n"),
    }
}

/// Formats remarks that do not fit into the table, on starts without a result.
fn remarks(rows: &[SummaryRow]) -> String {
    let mut text = String::new();
    // Trivial starts are those of the world, so rows repeat one number rather than add
    // up.
    let trivial = rows.iter().map(|row| row.trivial).max().unwrap_or(0);
    if trivial > 0 {
        text.push_str(&format!(
            "left out: {} from which the nominal ego fails without an adversary\n",
            counted(trivial, "start")
        ));
    }
    for row in rows.iter().filter(|row| row.invalid > 0) {
        let (ego, ado, invalid) = (&row.ego, &row.ado, row.invalid);
        text.push_str(&format!(
            "invalid: {ego}, {ado}: {} on which the ego or the physics failed to run\n",
            counted(invalid, "start")
        ));
    }
    text
}

/// Gates that are closed, and open ones that need a look.
fn gates(gates: &[UnitGate]) -> String {
    let (closed, open): (Vec<&UnitGate>, Vec<&UnitGate>) =
        gates.iter().partition(|gate| gate.decided.is_closed());
    let mut lines: Vec<String> = closed
        .iter()
        .take(SHOWN_IN_DETAILS)
        .map(|gate| gate.to_string())
        .collect();
    if closed.len() > SHOWN_IN_DETAILS {
        let more = closed.len() - SHOWN_IN_DETAILS;
        lines.push(format!("and {more} more that are closed"));
    }
    // Open gates are shown too where something needs a look.
    let noted = open.iter().filter(|gate| gate.is_noteworthy());
    lines.extend(noted.take(SHOWN_IN_DETAILS).map(|gate| gate.to_string()));
    lines.join("\n")
}

/// Returns the number of gates that are open.
fn open_gates(gates: &[UnitGate]) -> String {
    let open = gates.iter().filter(|gate| !gate.decided.is_closed());
    // An open gate that compares nothing must not count among those that passed.
    let (unanswered, answered): (Vec<&UnitGate>, Vec<&UnitGate>) =
        open.partition(|gate| gate.is_unanswered());
    let without = match unanswered.len() {
        0 => String::new(),
        some => format!(", {some} without an answer"),
    };
    format!(
        "{} of {} gates are open{without}",
        answered.len(),
        gates.len()
    )
}

/// Kept beside the option's help, which names it.
const _: () = assert!(PIECE_S == 10.0);
