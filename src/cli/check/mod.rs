//! `brakecheck check`: validation of a world, and its signals for formulas.

mod programs;
mod signals;
mod watch;

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use self::programs::ProgramCheck;
use super::answer::{AnswerArgs, PrintedAnswer};
use super::common::{note_warnings, print_json};
use super::display::stdout_columns;
use super::failure::{Exit, Failure};
use super::terminal::{self, Common};
use super::world_input;
use crate::experiment::NeutralRule;
use crate::risk::{RiskTraffic, RiskTrafficError};
use crate::ron_file::LoadError;
use crate::run_dir::counted;
use crate::world::Scenario;
use crate::world_file;

#[derive(Args, Debug)]
pub(super) struct CheckArgs {
    /// The world: a file, or the name of a shipped one.
    #[arg(required_unless_present_any = ["program", "schema"])]
    world: Option<PathBuf>,
    /// A program, after `--`, to be tried against the ego protocol.
    #[arg(last = true, value_name = "COMMAND")]
    program: Vec<String>,
    /// Print one JSON object on stdout instead of tables.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    answer: AnswerArgs,
    /// Start the programs that the world names as egos, and try them.
    #[arg(long)]
    allow_programs: bool,
    /// Check again when the world, or a file that it includes, is saved.
    #[arg(long, requires = "world", conflicts_with_all = ["program", "schema"])]
    watch: bool,
    /// Print the JSON schema of world files, for editors and other programs.
    #[arg(long, conflicts_with_all = ["world", "program", "allow_programs"])]
    schema: bool,
}

impl CheckArgs {
    /// Returns whether the command ends by Ctrl-C only.
    pub(super) fn is_watching(&self) -> bool {
        self.watch
    }

    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            allow_programs: self.allow_programs,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &CheckArgs) -> Result<Exit, Failure> {
    if args.schema {
        print_json(&world_file::schema())?;
        return Ok(Exit::Done);
    }
    if args.json && args.world.is_some() && !args.program.is_empty() {
        return Err(Failure::input(
            "`--json` prints one object, and a world and a program are two",
            "check them in two commands",
        ));
    }
    let exit = match &args.world {
        Some(world) if args.watch => watch::run(args, world)?,
        Some(world) => {
            let (scenario, named) = checked(args, world_input::read(world).world)?;
            show(args, world, &scenario, &named)?
        }
        // Without a world, the parser has required a program, which is tried below.
        None => Exit::Done,
    };
    if args.program.is_empty() {
        Ok(exit)
    } else {
        programs::try_out(args.json, &args.program)
    }
}

/// Returns a world without mistakes, and its programs, tried if that is allowed.
fn checked(
    args: &CheckArgs,
    read: Result<Scenario, LoadError>,
) -> Result<(Scenario, Vec<ProgramCheck>), Failure> {
    let scenario = (match read {
        Ok(scenario) => scenario,
        Err(error) => {
            if args.json {
                // Programs read stdout, and people the drawing that the failure puts on
                // stderr.
                print_json(&problems(&error))?;
            }
            let is_whole = is_whole(&error);
            let failure = Failure::from(error);
            return Err(if is_whole {
                failure
            } else {
                failure.with_note("reading stops at the last mistake, so others may follow")
            });
        }
    })
    .allow_programs(args.allow_programs);
    // Worlds know no probabilities, so their traffic is bound to them here.
    if let Err(error) = RiskTraffic::of_world(&scenario) {
        if let (true, RiskTrafficError::File(error)) = (args.json, &error) {
            print_json(&problems(error))?;
        }
        return Err(error.into());
    }
    // Programs start last, because a world with a mistake is not worth their trial.
    let named = programs::tried(&scenario, args.allow_programs);
    Ok((scenario, named))
}

/// Prints the content of a world, its warnings and the faults of its programs.
fn show(
    args: &CheckArgs,
    world: &Path,
    scenario: &Scenario,
    named: &[ProgramCheck],
) -> Result<Exit, Failure> {
    if args.json {
        let mut listing = listing(scenario);
        // A script reads this key alone, so a faulty program counts as much as a mistake
        // in the file.
        listing["ok"] = json!(programs::first_fault(named).is_none());
        listing["programs"] = json!(named);
        listing["warnings"] = warnings(scenario);
        print_json(&listing)?;
    } else if args.watch {
        // The tables of each save would push the earlier verdicts off the screen.
        terminal::data(&answer(scenario).verdict.join("\n"))?;
    } else {
        let mut answer = answer(scenario);
        answer.table.push_str(&programs::text(named));
        terminal::data(&answer.text(args.answer))?;
    }
    // On stderr, so that the listing on stdout can be piped.
    note_warnings(world, scenario);
    // A faulty program is reported last, so that the listing is complete.
    match programs::first_fault(named) {
        Some(failure) => Err(failure),
        None => Ok(Exit::Done),
    }
}

/// A list behind its name, in lines that fit the terminal.
fn listed(name: &str, items: &[String]) -> String {
    // 14 columns align the lists below each other.
    let mut lines = vec![format!("{name:<14}")];
    for (i, item) in items.iter().enumerate() {
        let comma = if i + 1 < items.len() { "," } else { "" };
        let width = |text: &str| text.chars().count();
        // Two more columns are for the blank before an item and the comma behind it.
        let full = |line: &String| width(line) + width(item) + 2 > stdout_columns();
        // The first item stays behind the name, even if it is too long for the line.
        if i > 0 && lines.last().is_some_and(full) {
            lines.push(" ".repeat(14));
        }
        if let Some(line) = lines.last_mut() {
            line.push_str(&format!(" {item}{comma}"));
        }
    }
    format!("{}\n", lines.join("\n"))
}

fn warnings(scenario: &Scenario) -> serde_json::Value {
    let warnings = scenario
        .warnings
        .iter()
        .map(|odd| json!({ "what": odd.what, "help": odd.help }));
    let neutral =
        NeutralRule::of(scenario).map(|it| json!({ "what": it.to_string(), "help": it.help() }));
    warnings.chain(neutral).collect()
}

/// Returns whether a world was read to its end, in spite of its mistakes.
fn is_whole(error: &LoadError) -> bool {
    match error {
        // An unreadable file has one problem, and no later one can follow.
        LoadError::Io { .. } => true,
        LoadError::Scenario(error) => Scenario::is_readable(&error.text),
    }
}

fn problems(error: &LoadError) -> serde_json::Value {
    let problems = match error {
        LoadError::Io { .. } => vec![json!({ "what": error.to_string() })],
        LoadError::Scenario(error) => {
            let problems = error.problems.iter();
            problems
                .map(|problem| {
                    let (line, column) = error.line_column(problem.span.start);
                    json!({ "line": line, "column": column, "what": problem.what, "help": problem.help })
                })
                .collect()
        }
    };
    json!({ "ok": false, "complete": is_whole(error), "problems": problems })
}

fn listing(scenario: &Scenario) -> serde_json::Value {
    let signals: Vec<_> = scenario.signals().into_iter()
        .map(|(signal, held)| {
            json!({ "name": signal.name, "unit": signal.unit, "about": signal.about, "published": held.word() })
        })
        .collect();
    let rules: Vec<_> = scenario.rules.iter()
        .map(|rule| {
            json!({ "name": rule.name, "ado": rule.ado, "priority": rule.priority, "stl": rule.formula.to_string(), "requirement": rule.requirement })
        })
        .collect();
    let actions: Vec<_> = (0..scenario.world().spaces().actions)
        .map(|action| scenario.action_label(action))
        .collect();
    let observed: Vec<_> = scenario.world().observed().iter()
        .map(|o| json!({ "name": o.name, "lo": rounded(o.mid - o.half), "hi": rounded(o.mid + o.half) }))
        .collect();
    let mut egos = vec!["nominal"];
    egos.extend(scenario.reuse.keys().map(String::as_str));
    let axes = scenario.axes();
    let starts: Vec<_> = axes
        .iter()
        .map(|axis| json!({ "name": axis.name, "unit": axis.unit, "lo": axis.lo, "hi": axis.hi }))
        .collect();
    json!({
        "ok": true,
        "world": scenario.name,
        "signals": signals,
        "constants": scenario.names.constants,
        "ego_spec": scenario.ego_spec.to_string(),
        "requirement": scenario.requirement,
        "rules": rules,
        "actions": actions,
        "neutral": scenario.world().spaces().neutral,
        "observed": observed,
        "egos": egos,
        "starts": starts,
    })
}

/// Returns a number without the last digits, in which a sum differs from the file.
fn rounded(value: f64) -> f64 {
    // Twelve digits are more than a file states, and a sum errs in the sixteenth.
    format!("{value:.11e}").parse().unwrap_or(value)
}

fn answer(scenario: &Scenario) -> PrintedAnswer {
    let counts = [
        counted(scenario.rules.len(), "rule"),
        counted(scenario.world().spaces().actions, "action"),
        // The world's own ego is one more than those under `reuse`.
        counted(1 + scenario.reuse.len(), "ego"),
        counted(scenario.signals().len(), "signal"),
    ];
    let neutral = usize::from(NeutralRule::of(scenario).is_some());
    let warnings = match scenario.warnings.len() + neutral {
        0 => String::new(),
        some => format!(", with {}", counted(some, "warning")),
    };
    let mut out = String::new();
    let clock = scenario.world().clock();
    let plant = [
        format!("{} plant", scenario.plant()),
        format!("judged {}", scenario.rulebook().judge),
        format!("{} s in samples of {} s", clock.horizon_s, clock.sample_s),
        format!("a decision every {} s", clock.decision_s),
        format!("{} per sample", counted(clock.substeps, "physics step")),
    ];
    out.push_str(&listed("plays on", &plant));
    out.push_str(&format!("the ego must   {}\n", scenario.ego_spec));
    for rule in &scenario.rules {
        out.push_str(&format!(
            "{} must   {}   ({})\n",
            rule.ado, rule.formula, rule.name
        ));
    }
    let actions = 0..scenario.world().spaces().actions;
    let neutral = scenario.world().spaces().neutral;
    let actions: Vec<String> = actions
        .map(|action| {
            let label = scenario.action_label(action);
            // The neutral action defines trivial starts, so it must be visible.
            if action == neutral {
                format!("{label} (neutral)")
            } else {
                label
            }
        })
        .collect();
    out.push_str(&listed("actions", &actions));
    let constants: Vec<String> = scenario
        .names
        .constants
        .iter()
        .map(|(name, v)| format!("{name} = {v}"))
        .collect();
    out.push_str(&listed("constants", &constants));
    let mut egos = vec!["nominal".to_owned()];
    egos.extend(scenario.reuse.keys().cloned());
    out.push_str(&listed("egos", &egos));
    let axes = scenario.axes();
    let starts = axes
        .iter()
        .map(|axis| format!("{} in {} … {} {}", axis.name, axis.lo, axis.hi, axis.unit));
    out.push_str(&listed("start", &starts.collect::<Vec<_>>()));
    let observed: Vec<String> = scenario
        .world()
        .observed()
        .iter()
        .map(|o| {
            let (lo, hi) = (rounded(o.mid - o.half), rounded(o.mid + o.half));
            format!("{} ({lo} … {hi})", o.name)
        })
        .collect();
    out.push_str(&listed("observed", &observed));
    let signals: Vec<String> = signals::names(scenario);
    out.push_str(&listed("signals", &signals));
    PrintedAnswer {
        verdict: vec![
            format!(
                "`{}` is valid{warnings}: {}",
                scenario.name,
                counts.join(", ")
            ),
            scenario.question.clone(),
        ],
        table: out,
        details: signals::table(scenario),
        legend: signals::EXPLAINED.to_owned(),
        ..PrintedAnswer::default()
    }
}
