//! `brakecheck stl RULES --log RECORDING`: rules on every vehicle of recordings.

use std::path::Path;

use brakecheck_traffic::{
    Analysis, BoundRules, EvaluatedRows, RuleResult, RulesError, TrafficRule, TrafficRuleFile,
    WorstRow, svg_instant,
};
use serde_json::{Value, json};

use super::common::table_of;
use super::failure::{Exit, Failure};
use super::stl::{StlArgs, constants, placed, refuse_unused};
use super::terminal;
use super::{log, log_reading};
use crate::report::{known_if, recorded_rules_junit};
use crate::run_dir::{make_dir, write_file, write_output};

/// Recording with the results of the rules on it.
struct CheckedRecording {
    analysis: Analysis,
    map: String,
    results: Vec<RuleResult>,
    evaluated: EvaluatedRows,
    /// File names of the pictures, one per rule, `None` without a violation.
    pictures: Vec<Option<String>>,
}

/// Evaluates the rules on all recordings, and writes the files that are named.
pub(super) fn run(args: &StlArgs) -> Result<Exit, Failure> {
    let mut checked = evaluated(args)?;
    if let Some(folder) = &args.picture {
        for (i, it) in checked.iter_mut().enumerate() {
            it.draw(folder, i)?;
        }
    }
    if let Some(file) = &args.junit {
        let results = checked
            .iter()
            .map(|it| (&*it.analysis.recording.name, &it.results[..]));
        write_output(file, recorded_rules_junit(results).as_bytes())?;
    }
    if !args.prints_json() {
        for it in &checked {
            it.show()?;
        }
    }
    let reports: Vec<Value> = checked.iter().map(CheckedRecording::json).collect();
    args.emit_json(&json!({ "recordings": reports }))?;
    // Results are printed before, because other rules may have an answer.
    if let Some(failure) = unanswered(&checked) {
        return Err(failure);
    }
    let is_broken = |it: &CheckedRecording| it.results.iter().any(|rule| rule.episodes > 0);
    Ok(
        if args.fail_on_counterexample && checked.iter().any(is_broken) {
            Exit::Counterexample
        } else {
            Exit::Done
        },
    )
}

/// Returns the failure of rules that no row of any recording answers.
fn unanswered(checked: &[CheckedRecording]) -> Option<Failure> {
    let rules = &checked.first()?.results;
    // One recording with an answer suffices, since a rule need not apply to all of them.
    let is_open = |rule: usize| !checked.iter().any(|it| it.results[rule].is_evaluated());
    let open = (0..rules.len()).filter(|rule| is_open(*rule));
    let names: Vec<String> = open.map(|rule| format!("`{}`", rules[rule].rule)).collect();
    if names.is_empty() {
        return None;
    }
    Some(Failure::fault(
        format!(
            "no row answers {}, because no recorded row has a vehicle ahead",
            names.join(", ")
        ),
        Some(
            "look at the lanes with `brakecheck log FILE`, or leave out rules about the vehicle \
             ahead"
                .to_owned(),
        ),
    ))
}

/// Evaluates the rules on each recording that is named, and says what was read and evaluated.
fn evaluated(args: &StlArgs) -> Result<Vec<CheckedRecording>, Failure> {
    let (source, rules) = rule_file(args)?;
    let mut checked = Vec::new();
    let columns = log::GivenColumns {
        map: args.map.as_deref(),
        time: args.time.as_deref(),
    };
    for (analysis, map) in log::read_all(&args.log, columns, args.road.as_deref())? {
        log_reading::note(&analysis, &map);
        let bound = BoundRules::bind(&rules, &analysis.recording)
            .map_err(|error| in_rule_file(&source, &rules, error))?;
        refuse_unused(&constants(&args.constants)?, &rules.signals(), |name| {
            let mut fewer = rules.clone();
            fewer.constants.shift_remove(name);
            BoundRules::bind(&fewer, &analysis.recording).is_ok()
        })?;
        let results = bound
            .evaluate(&analysis.recording, &analysis.frame, &analysis.leads)
            .map_err(|error| in_rule_file(&source, &rules, error))?;
        let evaluated = EvaluatedRows::of(&analysis.recording, &analysis.frame, &analysis.leads);
        terminal::note(&format!("evaluated: {evaluated}"));
        checked.push(CheckedRecording {
            pictures: vec![None; results.len()],
            analysis,
            map,
            results,
            evaluated,
        });
    }
    Ok(checked)
}

/// Returns the rules and the name of their file, or a formula as the only rule.
fn rule_file(args: &StlArgs) -> Result<(String, TrafficRuleFile), Failure> {
    let name = &args.formula;
    // A formula has no ending of a file name, so the ending decides.
    let is_file = name == "motorway" || name.ends_with(".ron");
    let mut rules = if name == "motorway" {
        parsed(name, TrafficRuleFile::motorway_text())?
    } else if is_file {
        let help = "name motorway, a RON file or a formula";
        parsed(name, &log::text_of(name, help)?)?
    } else {
        let rule = TrafficRule {
            name: name.clone(),
            stl: name.clone(),
        };
        TrafficRuleFile::of(vec![rule])
    };
    for (constant, value) in constants(&args.constants)? {
        // A typed constant replaces that of the file.
        rules.constants.insert(constant, value);
    }
    let source = if is_file { name.as_str() } else { "formula" };
    Ok((source.to_owned(), rules))
}

fn parsed(name: &str, text: &str) -> Result<TrafficRuleFile, Failure> {
    TrafficRuleFile::parse(text)
        .map_err(|error| Failure::input(format!("`{name}`: {error}"), error.help()))
}

/// Returns the failure with its place, which is within the formula of a rule.
fn in_rule_file(source: &str, rules: &TrafficRuleFile, error: RulesError) -> Failure {
    if let RulesError::Formula {
        rule,
        source: mistake,
    } = &error
        && let Some(found) = rules.rules.iter().find(|it| it.name == *rule)
    {
        // A typed formula is its own name, so the name would only repeat it.
        let place = if found.name == found.stl {
            source.to_owned()
        } else {
            format!("{source}, rule `{rule}`")
        };
        return placed(&place, &found.stl, mistake);
    }
    Failure::input(format!("`{source}`: {error}"), error.help())
}

impl CheckedRecording {
    /// Writes a picture of the worst instant of each rule.
    fn draw(&mut self, folder: &Path, recording: usize) -> Result<(), Failure> {
        for (i, (result, picture)) in self.results.iter().zip(&mut self.pictures).enumerate() {
            let Some(text) = worst_instant(&self.analysis, result) else {
                continue;
            };
            // Recordings share a directory, so all but the first have a number.
            let name = match recording {
                0 => format!("rule_{}.svg", i + 1),
                _ => format!("recording_{}_rule_{}.svg", recording + 1, i + 1),
            };
            // Only for a picture, so that recordings without a violation leave no empty
            // directory.
            make_dir(folder)?;
            let file = folder.join(name);
            write_file(&file, text.as_bytes())?;
            *picture = Some(file.display().to_string());
        }
        Ok(())
    }

    fn show(&self) -> Result<(), Failure> {
        let recording = &self.analysis.recording;
        terminal::data(&format!(
            "{}, format {}: {:.1} s, {:.1} km",
            recording.name,
            self.map,
            recording.duration_s(),
            recording.distance_km(),
        ))?;
        let rules = self.results.iter().map(|it| {
            // A rule that no row answers has no rate.
            let known = |text: String| known_if(it.is_evaluated(), || text);
            [
                it.rule.clone(),
                known(format!("{:.4}", 100.0 * it.share())),
                known(format!("{}", it.vehicles)),
                known(format!("{}", it.episodes)),
                known(format!("{:.1}", it.per_1000_km())),
                format!("{}", it.doubtful),
                it.worst.as_ref().map_or("–".to_owned(), worst_in_words),
            ]
        });
        let header = [
            "rule",
            "time %",
            "vehicles",
            "episodes",
            "per 1,000 km",
            "left out",
            "worst",
        ];
        terminal::data(&table_of(header, rules))
    }

    fn json(&self) -> Value {
        let recording = &self.analysis.recording;
        let rules = self
            .results
            .iter()
            .zip(&self.pictures)
            .map(|(it, picture)| {
                let mut rule = json!(it.summary());
                rule["picture"] = json!(picture);
                rule
            });
        json!({
            "file": recording.name,
            "map": self.map,
            "duration_s": recording.duration_s(),
            "distance_km": recording.distance_km(),
            "evaluated": self.evaluated,
            "rules": rules.collect::<Vec<_>>(),
        })
    }
}

/// Returns a picture of a rule's worst instant, `None` for a rule without a violation.
fn worst_instant(analysis: &Analysis, rule: &RuleResult) -> Option<String> {
    let worst = rule.worst.as_ref()?;
    // Rounded, because the quotient is a whole number up to float errors.
    let sample = (worst.time_s / analysis.recording.dt_s).round() as usize;
    let lead = worst.lead.as_ref();
    let behind = lead.map_or(String::new(), |lead| format!(" behind {lead}"));
    let title = format!(
        "{}: ρ = {:.2} at {:.2} s, {}{behind}",
        rule.rule, worst.robustness, worst.time_s, worst.id
    );
    svg_instant(analysis, worst.track, sample, &title)
}

fn worst_in_words(worst: &WorstRow) -> String {
    format!(
        "ρ {:.2} at {:.2} s, {}",
        worst.robustness, worst.time_s, worst.id
    )
}
