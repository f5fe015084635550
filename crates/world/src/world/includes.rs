//! Files that a world file includes: rule files, traffic models and road files.
//!
//! A [`super::RunSource`] finds them. The scenario's text then has their content instead
//! of their names, so run directories and kept counterexamples are self-contained. The
//! content stays on the line of its name, so that lines of errors are those of the file.

use std::sync::Arc;

use brakecheck_driver_model::{TrafficModel, TrafficRuleFile};

use super::open_drive;
use super::runs::{IncludingFile, RunRefused, refused};
use super::trained::{raw_text, with_values};
use crate::natural::{DeclaredTraffic, motorway};
use crate::ron_file::Problem;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::world_file::{
    AdoFile, AgentFile, DriveFile, LightFile, NaturalFile, RuleFile, SHIPPED, ScenarioFile,
    TrafficFile,
};

/// Returns the text with the content of all included files, `None` without any.
///
/// # Errors
/// A file is missing or invalid, with its place in the world file.
pub(super) fn expanded(
    origin: IncludingFile<'_>,
    text: &str,
    file: &ScenarioFile,
) -> Result<Option<String>, Vec<Problem>> {
    let mut problems = Problems::new(text);
    let mut values = Vec::new();
    for (i, agent) in file.agents.iter().enumerate() {
        let drive = ValuePath::top().to("agents").at(i).to("drive");
        let rules = ado_of(agent).map_or(&[][..], |ado| &ado.rulebook);
        for (j, rule) in rules.iter().enumerate() {
            let Some(name) = rule.include() else { continue };
            let place = drive.to("rulebook").at(j);
            // A formula in quotes is a more likely mistake than a file without an ending.
            if !name.ends_with(".ron") {
                let what = "`Rule(…)` or a rule file is expected".to_owned();
                let help = "write `Rule(name: \"…\", stl: \"…\")`, or a name such as \"rules.ron\"";
                problems.add(&place, what, "this is neither", Some(help.to_owned()));
                continue;
            }
            match rules_of(origin, name, file) {
                Ok(rules) => values.push((place, rules)),
                Err(wrong) => problems.add(&place, wrong.what, "this file", Some(wrong.help)),
            }
        }
    }
    // The shipped model is in the program, so no text has to keep it.
    if let Some(NaturalFile {
        traffic: TrafficFile::Named(name),
        ..
    }) = &file.natural
        && name != SHIPPED
    {
        let place = ValuePath::top().to("natural").to("traffic");
        match model_of(origin, name) {
            Ok(kept) => values.push((place, kept)),
            Err(wrong) => problems.add(&place, wrong.what, "this file", Some(wrong.help)),
        }
    }
    for (place, road) in open_drive::values(&mut problems, origin, file) {
        // What follows stays on its line.
        let lines = text[place.find(text)].matches('\n').count();
        values.push((place, road + &"\n".repeat(lines)));
    }
    problems.done()?;
    Ok((!values.is_empty()).then(|| with_values(text, &values)))
}

fn ado_of(agent: &AgentFile) -> Option<&AdoFile> {
    match agent {
        AgentFile::Vehicle { drive, .. } | AgentFile::Pedestrian { drive, .. } => match drive {
            DriveFile::Ado(ado) => Some(ado),
            _ => None,
        },
        AgentFile::Light { drive, .. } => match drive {
            LightFile::Ado(ado) => Some(ado),
            _ => None,
        },
        AgentFile::Weather(weather) => Some(weather.drive.ado()),
        AgentFile::Road(road) => Some(road.drive.ado()),
        AgentFile::Turns { drive, .. } => Some(drive.ado()),
        AgentFile::Obstacle { .. } => None,
    }
}

/// Returns the rules of a file as elements of a rulebook, on one line.
fn rules_of(
    origin: IncludingFile<'_>,
    name: &str,
    file: &ScenarioFile,
) -> Result<String, RunRefused> {
    let text = origin.text(name)?;
    let rules = TrafficRuleFile::parse(&text)
        .map_err(|error| refused(format!("`{name}`: {error}"), &error.help()))?;
    for (constant, value) in &rules.constants {
        // Rules with another constant would differ from those of the file without notice.
        let own = file.constants.0.get(constant.as_str());
        // Compared exactly, because both are numbers as written.
        if own != Some(value) {
            return Err(refused(
                format!("`{name}` has the constant `{constant}` = {value}, which this world lacks"),
                &format!("write `constants: {{ \"{constant}\": {value:?} }}` in the world"),
            ));
        }
    }
    let rule = |rule: &brakecheck_driver_model::TrafficRule| {
        let stl = rule.always().map_err(|error| {
            let help = error.help().unwrap_or("`brakecheck stl` checks formulas");
            refused(format!("`{name}`, rule `{}`: {error}", rule.name), help)
        })?;
        Ok(format!("Rule(name: {:?}, stl: {stl:?})", rule.name))
    };
    let list: Vec<String> = rules.rules.iter().map(rule).collect::<Result<_, _>>()?;
    // An empty element would be no valid list.
    if list.is_empty() {
        return Err(refused(format!("`{name}` has no rules"), "add a rule"));
    }
    Ok(list.join(", "))
}

/// Returns a traffic model as the value that replaces its name.
fn model_of(origin: IncludingFile<'_>, name: &str) -> Result<String, RunRefused> {
    let text = origin.text(name)?;
    let (from, text) = (raw_text(name), raw_text(&model(name, &text)?.to_line()));
    Ok(format!("Kept(from: {from}, model: {text})"))
}

fn model(name: &str, text: &str) -> Result<TrafficModel, RunRefused> {
    TrafficModel::parse(text).map_err(|error| refused(format!("`{name}`: {error}"), error.help()))
}

/// Reads the field `natural`: the traffic of the ados, and the limit on them.
pub(super) fn traffic(problems: &mut Problems, file: &ScenarioFile) -> DeclaredTraffic {
    let Some(natural) = &file.natural else {
        return DeclaredTraffic::default();
    };
    let top = ValuePath::top().to("natural");
    if let Some(rate) = natural.per_1000_km
        && !(rate > 0.0 && rate.is_finite())
    {
        let what = format!("a rate of {rate} per 1,000 km");
        let help = "write a number above 0, such as 3.0".to_owned();
        problems.add(&top.to("per_1000_km"), what, "not above 0", Some(help));
    }
    let drives = |agent: &AgentFile| {
        matches!(
            agent,
            AgentFile::Vehicle {
                drive: DriveFile::Ado(_),
                ..
            }
        )
    };
    if !file.agents.iter().any(drives) {
        let help = "leave `natural` out: traffic models are of vehicles".to_owned();
        let what = "no ado drives a vehicle here";
        problems.add(&top, what, "limits nothing", Some(help));
    }
    let model = match &natural.traffic {
        // A file is in the text already, so only the shipped one has a name.
        TrafficFile::Named(_) => motorway(),
        TrafficFile::Kept(kept) => match model(&kept.from, &kept.model) {
            Ok(model) => Arc::new(model),
            Err(wrong) => {
                let place = top.to("traffic").to("model");
                problems.add(&place, wrong.what, "damaged", Some(wrong.help));
                // The shipped model lets the reading go on to later mistakes.
                motorway()
            }
        },
    };
    DeclaredTraffic {
        model,
        per_1000_km: natural.per_1000_km,
        is_declared: true,
    }
}

/// Refuses files among rules where nothing is included.
pub(super) fn refuse(problems: &mut Problems, path: &ValuePath, rules: &[RuleFile]) {
    for (j, rule) in rules.iter().enumerate() {
        if let Some(name) = rule.include() {
            let what = format!("the rule file `{name}` cannot be included here");
            let help = "write `Rule(name: \"…\", stl: \"…\")`".to_owned();
            problems.add(&path.at(j), what, "a file", Some(help));
        }
    }
}
