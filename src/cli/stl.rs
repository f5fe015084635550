//! `brakecheck stl`: a formula, a trace in CSV, and its robustness.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;

use super::common::print_json;
use super::failure::{Exit, Failure};
use super::headings::{INPUT, OUTPUT, TEST};
use super::input;
use super::output_path::{new_dir, new_file};
use super::terminal::{self, Common};
use crate::ron_file::{Problem, ScenarioError};
use crate::run_dir::{ReadTrace, TraceOptions, number_or_word, read_trace, write_output};
use crate::stl::{
    Constants, Explanation, Formula, Monitor, Names, Scratch, Settings, StlError, TraceEnd, Until,
};
use crate::trace::{Signal, Trace};

#[derive(Args, Debug)]
pub(super) struct StlArgs {
    /// The formula, such as "always[0, 10] (headway >= d_safe)", or rules for --log.
    ///
    /// Rules are motorway or a RON file: RuleFile(rules: [Rule(name: "…", stl: "…")]).
    /// They have the signals ego.speed, ego.accel, ego.s, ego.lateral, ego.lane,
    /// lead.present (Boolean), lead.speed, ego.lead.gap, ego.lead.ttc and
    /// ego.lead.closing. `vehicle` and `lead` rename ego and lead, so that the rulebook
    /// of a world fits.
    // A formula may begin with a minus.
    #[arg(allow_hyphen_values = true, value_name = "FORMULA|RULES.ron")]
    pub(super) formula: String,
    /// The trace: a header of signal names, one line per sample (- is stdin).
    #[arg(long, value_name = "FILE.csv", required_unless_present = "log")]
    pub(super) trace: Option<String>,
    /// Recorded traffic: evaluate the rules on every vehicle (repeatable).
    #[arg(long, value_name = "FILE.csv", conflicts_with_all = ["trace", "dt", "until", "end", "all", "explain"])]
    pub(super) log: Vec<PathBuf>,
    /// Column map of the recordings, as in `brakecheck log` [default: by header].
    #[arg(long, value_name = "NAME|FILE.ron", requires = "log", help_heading = INPUT)]
    pub(super) map: Option<String>,
    /// Take the lanes from an OpenDRIVE file in the frame of the recording, unfitted.
    #[arg(long, value_name = "FILE.xodr", requires = "log", help_heading = INPUT)]
    pub(super) road: Option<PathBuf>,
    /// Write JUnit XML with a case per rule and recording.
    #[arg(long, value_name = "FILE.xml", requires = "log", value_parser = new_file(), help_heading = OUTPUT)]
    pub(super) junit: Option<PathBuf>,
    /// Write a picture of the worst instant of each rule.
    #[arg(long, value_name = "DIR", requires = "log", value_parser = new_dir(), help_heading = OUTPUT)]
    pub(super) picture: Option<PathBuf>,
    /// Sampling period in seconds [default: from the time column].
    #[arg(long, value_name = "S", help_heading = INPUT)]
    dt: Option<f64>,
    /// Time column of the trace or of the recordings [default: by its name].
    ///
    /// Known names are time, t, timestamp, sim_time and the like, with or without their
    /// unit: time [ms], t_ns.
    #[arg(long, value_name = "COLUMN", help_heading = INPUT)]
    pub(super) time: Option<String>,
    /// Samples on which the left side of `until` must hold.
    #[arg(long, value_enum, default_value = "half-open", help_heading = TEST)]
    until: UntilArg,
    /// Continuation of the trace after its end.
    #[arg(long, value_enum, default_value = "truncate", help_heading = TEST)]
    end: EndArg,
    /// A named constant (repeatable).
    #[arg(long = "const", value_name = "NAME=VALUE")]
    pub(super) constants: Vec<String>,
    /// Print the robustness at every sample, not only at the first.
    #[arg(long)]
    all: bool,
    /// Print the leaf, the time and the value that decide the robustness.
    #[arg(long)]
    explain: bool,
    /// Exit with 1 if the trace or a vehicle violates the formula or a rule.
    #[arg(long)]
    pub(super) fail_on_counterexample: bool,
    /// Print one JSON object on stdout, or write it to a file: --json=FILE.
    // Without the equals sign, the next word would be taken for the file.
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, default_missing_value = "-", value_parser = new_file(), help_heading = OUTPUT)]
    json: Option<PathBuf>,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum UntilArg {
    /// From t to t', without the sample at t' where the right side holds.
    HalfOpen,
    /// From t to t', with the sample at t' where the right side holds.
    Closed,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum EndArg {
    /// No continuation: windows end with the trace.
    Truncate,
    /// The last sample, forever.
    Hold,
    /// The worst possible samples.
    Strict,
}

/// Measures the formula on the trace in a file.
pub(super) fn run(args: &StlArgs, trace: &str) -> Result<Exit, Failure> {
    let read = read(args, trace)?;
    // A wrong time column gives a plausible result, so the reading is always stated.
    terminal::note(&format!("read: {read}"));
    let trace = read.trace;
    let monitor = bound(args, &trace)?;
    // The value is valid, but rarely the intended one.
    if let Some(short) = beyond(&monitor, &trace) {
        terminal::note(&short);
    }
    let mut scratch = Scratch::default();
    let measured = FormulaResult {
        robustness: monitor.robustness(&trace, &mut scratch),
        // At ρ = 0 the formula itself decides, while a rule is kept only if ρ > 0.
        satisfied: monitor.satisfied(&trace, &mut scratch),
        all: args.all.then(|| monitor.robustness_all(&trace)),
        explanation: args.explain.then(|| monitor.explain(&trace)),
    };
    // Shown before a file is written, so that a full disk does not cost the result.
    if !args.prints_json() {
        measured.show(trace.dt_s())?;
    }
    args.emit_json(&measured.json())?;
    Ok(if args.fail_on_counterexample && !measured.satisfied {
        Exit::Counterexample
    } else {
        Exit::Done
    })
}

/// Binds the formula to the signals of a trace and to all typed constants.
fn bound(args: &StlArgs, trace: &Trace) -> Result<Monitor, Failure> {
    let in_formula = |error: StlError| placed("formula", &args.formula, &error);
    let formula: Formula = args.formula.parse().map_err(in_formula)?;
    // Named formulas are those of a world, and a trace has none.
    let names = Names {
        constants: constants(&args.constants)?,
        ..Names::default()
    };
    let settings = args.settings();
    let monitor = formula
        .bind_with(trace.schema(), &names, &settings)
        .map_err(in_formula)?;
    // Asked after binding, because only sound formulas show which constants they use.
    refuse_unused(&names.constants, trace.schema().signals(), |name| {
        let mut fewer = names.clone();
        fewer.constants.shift_remove(name);
        formula.bind_with(trace.schema(), &fewer, &settings).is_ok()
    })?;
    Ok(monitor)
}

impl StlArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.prints_json(),
            ..Common::default()
        }
    }

    /// Returns true if stdout has the JSON object instead of tables.
    pub(super) fn prints_json(&self) -> bool {
        self.json.as_deref() == Some(Path::new("-"))
    }

    /// Prints or writes the JSON object, if it is requested.
    pub(super) fn emit_json(&self, value: &serde_json::Value) -> Result<(), Failure> {
        match &self.json {
            None => Ok(()),
            Some(_) if self.prints_json() => print_json(value),
            // A file leaves stdout to the tables, so CI gets both from one run.
            Some(file) => Ok(write_output(file, format!("{value}\n").as_bytes())?),
        }
    }

    fn settings(&self) -> Settings {
        Settings {
            until: match self.until {
                UntilArg::HalfOpen => Until::HalfOpen,
                UntilArg::Closed => Until::Closed,
            },
            end: match self.end {
                EndArg::Truncate => TraceEnd::Truncate,
                EndArg::Hold => TraceEnd::Hold,
                EndArg::Strict => TraceEnd::Strict,
            },
            ..Settings::default()
        }
    }
}

/// Returns a remark if a formula looks beyond the end of the trace.
fn beyond(monitor: &Monitor, trace: &Trace) -> Option<String> {
    let last = trace.len().saturating_sub(1);
    let reach = monitor.horizon_samples().filter(|reach| last < *reach)?;
    let seconds = |samples: usize| samples as f64 * trace.dt_s();
    let lies = match monitor.settings().end {
        TraceEnd::Truncate => "nothing (`--end hold` and `--end strict` take something)",
        TraceEnd::Hold => "its last sample, for ever",
        TraceEnd::Strict => "the worst that could still come",
    };
    Some(format!(
        "warning: the formula looks {:.6} s ahead, and the trace ends after {:.6} s; behind its end lies {lies}",
        seconds(reach),
        seconds(last)
    ))
}

/// Result of a formula on a trace.
struct FormulaResult {
    robustness: f64,
    satisfied: bool,
    all: Option<Vec<f64>>,
    explanation: Option<Explanation>,
}

impl FormulaResult {
    fn json(&self) -> serde_json::Value {
        let mut object = json!({
            "robustness": number_or_word(self.robustness),
            "satisfied": self.satisfied,
        });
        if let Some(all) = &self.all {
            object["robustness_all"] = all.iter().map(|&value| number_or_word(value)).collect();
        }
        if let Some(explanation) = &self.explanation {
            object["explain"] = json!(explanation);
        }
        object
    }

    fn show(&self, dt_s: f64) -> Result<(), Failure> {
        match &self.all {
            None => terminal::data(&format!("{}", self.robustness))?,
            Some(all) => terminal::data(&lines(all, dt_s))?,
        }
        let word = if self.satisfied {
            "satisfied"
        } else {
            "violated"
        };
        // The verdict goes to stderr, so that stdout has data only.
        terminal::note(&format!("{word}, ρ = {}", self.robustness));
        match &self.explanation {
            Some(explanation) => terminal::data(&explanation.to_string()),
            None => Ok(()),
        }
    }
}

fn lines(all: &[f64], dt_s: f64) -> String {
    let lines = all.iter().enumerate().map(|(i, value)| {
        // Rounding to nanoseconds removes binary noise.
        let time_s = (i as f64 * dt_s * 1e9).round() / 1e9;
        format!("{time_s},{value}")
    });
    std::iter::once("time,robustness".to_owned())
        .chain(lines)
        .collect::<Vec<_>>()
        .join("\n")
}

fn read(args: &StlArgs, file: &str) -> Result<ReadTrace, Failure> {
    let failed = |error: std::io::Error| {
        let help = match error.kind() {
            ErrorKind::InvalidData => "save it as UTF-8, not as UTF-16 or Latin-1",
            _ => "name a CSV file, or - for standard input",
        };
        Failure::input(format!("cannot read `{file}`: {error}"), help)
    };
    let text = input::text(Path::new(file)).map_err(failed)?;
    if args.dt.is_some_and(|dt_s| !dt_s.is_finite() || dt_s <= 0.0) {
        return Err(Failure::input(
            "the sampling period must be positive and finite",
            "give seconds, such as `--dt 0.05`",
        ));
    }
    let options = TraceOptions {
        dt_s: args.dt,
        time: args.time.as_deref(),
    };
    read_trace(&text, &options)
        .map_err(|error| Failure::input(format!("`{file}`: {error}"), error.help()))
}

pub(super) fn constants(given: &[String]) -> Result<Constants, Failure> {
    let mut constants = Constants::new();
    for text in given {
        let pair = text.split_once('=').and_then(|(name, value)| {
            let value: f64 = value.trim().parse().ok()?;
            // Constants must be finite, as all values of a trace are.
            value.is_finite().then(|| (name.trim().to_owned(), value))
        });
        let Some((name, value)) = pair else {
            return Err(Failure::input(
                format!("`{text}` is no named constant"),
                "write NAME=NUMBER, such as `--const d_safe=4.7`",
            ));
        };
        // The last of two values would replace the other silently.
        if constants.contains_key(&name) {
            return Err(Failure::input(
                format!("the constant `{name}` is there twice"),
                "leave one of them out",
            ));
        }
        constants.insert(name, value);
    }
    Ok(constants)
}

/// Refuses typed constants that no formula uses, such as misspelled ones.
///
/// `binds_without` returns true if the formulas can be bound without a constant.
pub(super) fn refuse_unused(
    constants: &Constants,
    signals: &[Signal],
    binds_without: impl Fn(&str) -> bool,
) -> Result<(), Failure> {
    let Some(name) = constants.keys().find(|name| binds_without(name)) else {
        return Ok(());
    };
    Err(if signals.iter().any(|it| it.name == *name) {
        Failure::input(
            format!("`{name}` is a signal, which no constant replaces"),
            "give the constant another name, and use it in the formula",
        )
    } else {
        Failure::input(
            format!("nothing uses the constant `{name}`"),
            "correct its name, or leave it out",
        )
    })
}

pub(super) fn placed(file: &str, formula: &str, error: &StlError) -> Failure {
    // The formula is drawn like a file, with its mistake marked.
    Failure::from(ScenarioError {
        file: file.to_owned(),
        text: formula.to_owned(),
        problems: vec![Problem {
            what: error.to_string(),
            span: error.span(),
            label: error.label().to_owned(),
            help: error.help().map(str::to_owned),
        }],
    })
}
