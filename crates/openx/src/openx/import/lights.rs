//! Traffic lights of the ego's way, with the phases of their controllers.

use std::collections::BTreeMap;

use super::draft::tidy;
use super::dropped::{DropLog, is_light};
use crate::ego::Phase;
use crate::opendrive::error::{At, ImportError};
use crate::opendrive::roads::RoadMap;
use crate::opendrive::scope::ParameterScope;
use crate::opendrive::tree::XmlNode;
use crate::scene::drive::Schedule;
use crate::world_file::{AgentFile, LightFile};

/// Step in seconds in which the end of schedules grows, so that points share a world.
const STEP_S: f64 = 60.0;

/// Greatest number of such steps.
const MOST_STEPS: f64 = 200.0;
/// Least duration of a cycle, and greatest of a phase.
const LEAST_CYCLE_S: f64 = 0.5;
const MOST_PHASE_S: f64 = 1e6;
/// Greatest number of states of a controller, each of one signal in one phase.
const MOST_STATES: usize = 50_000;
/// Greatest number of changes of a light.
const MOST_CHANGES: f64 = 100_000.0;

/// Cycle of a light: phases with their durations, from a time on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LightCycle {
    begins_s: f64,
    phases: Vec<(f64, Phase)>,
}

/// Light on the ego's way.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ImportedLight {
    /// Controller that states its phases.
    pub at: At,
    pub signal: String,
    line_m: f64,
    cycle: LightCycle,
}

/// Returns the lights of a way with their cycles.
///
/// `passed` are the signals of the way. A controller without any of them, and
/// a signal without readable phases, has no effect and is noted.
///
/// # Errors
///
/// Returns an error for malformed controllers.
pub(super) fn lights(
    root: &XmlNode,
    scope: &ParameterScope,
    roads: &RoadMap,
    passed: &[(String, f64)],
    dropped: &DropLog,
) -> Result<Vec<ImportedLight>, ImportError> {
    let controllers: Vec<&XmlNode> = root
        .child("RoadNetwork")
        .into_iter()
        .filter_map(|it| it.child("TrafficSignals"))
        .flat_map(|it| it.all("TrafficSignalController"))
        .collect();
    let mut found: Vec<ImportedLight> = Vec::new();
    for &controller in &controllers {
        let before = found.len();
        for (signal, cycle) in cycles(controller, scope, roads, &controllers)? {
            let on_way = passed.iter().find(|(id, _)| *id == signal);
            // A signal with two controllers shows the phases of the first.
            let is_known = found.iter().any(|it| it.signal == signal);
            if let Some((_, line_m)) = on_way.filter(|_| !is_known) {
                found.push(ImportedLight {
                    at: controller.at(),
                    line_m: *line_m,
                    signal,
                    cycle,
                });
            }
        }
        if before == found.len() {
            dropped.note("traffic signals", controller);
        }
    }
    // Signs never change, and are counted elsewhere.
    let signals = roads.all().flat_map(|(_, road)| road.node.all("signals"));
    let lights = signals
        .flat_map(|list| list.all("signal"))
        .filter(|it| is_light(it));
    for signal in lights {
        let id = signal.need("id")?;
        if !found.iter().any(|it| it.signal == id) {
            dropped.note("traffic signals", signal);
        }
    }
    Ok(found)
}

/// Cycles of the signals of a controller.
fn cycles(
    controller: &XmlNode,
    scope: &ParameterScope,
    roads: &RoadMap,
    all: &[&XmlNode],
) -> Result<BTreeMap<String, LightCycle>, ImportError> {
    let begins_s = begins_s(controller, scope, all)?;
    let name = scope.text(controller, "name")?;
    let mut cycles: BTreeMap<String, Option<LightCycle>> = BTreeMap::new();
    let (mut before_s, mut states) = (0.0, 0);
    for phase in controller.all("Phase") {
        let duration_s = scope.number_in(phase, "duration", 0.0..=MOST_PHASE_S)?;
        for state in &phase.children {
            let shown = shown(&scope.text(state, "state")?);
            let signals = match state.raw("trafficSignalId") {
                Some(_) => vec![scope.text(state, "trafficSignalId")?],
                None => roads.controlled(&name).to_vec(),
            };
            states += signals.len();
            if states > MOST_STATES {
                let what = format!("its phases have more than {MOST_STATES} states of signals");
                return Err(phase.refused(what, "leave out the signals that the ego never passes"));
            }
            for signal in signals {
                let first = || {
                    Some(LightCycle {
                        begins_s,
                        phases: Vec::new(),
                    })
                };
                let cycle = cycles.entry(signal).or_insert_with(first);
                match (cycle.as_mut(), shown) {
                    (Some(cycle), Some(shown)) => cycle.phases.push((before_s, shown)),
                    // States without a colour of a light.
                    _ => *cycle = None,
                }
            }
        }
        before_s += duration_s;
    }
    let cycles_run = MOST_STEPS * STEP_S / before_s;
    let longest = cycles.values().flatten().map(|it| it.phases.len()).max();
    // A cycle without a duration shows nothing, and is left out below.
    if before_s > 0.0 && cycles_run * longest.unwrap_or(0) as f64 > MOST_CHANGES {
        let what = format!("its phases of {before_s} s together change too often");
        let help = format!(
            "keep to {MOST_CHANGES} changes in {} s",
            MOST_STEPS * STEP_S
        );
        return Err(controller.refused(what, &help));
    }
    if before_s > 0.0 && before_s < LEAST_CYCLE_S {
        let what = format!("its phases last {before_s} s together");
        let help = format!("let a cycle last {LEAST_CYCLE_S} s or longer");
        return Err(controller.refused(what, &help));
    }
    let cycles = cycles.into_iter().filter_map(|(signal, cycle)| {
        let mut cycle = cycle?;
        // The end of the last phase is that of the cycle, and a light that the
        // first phase leaves out still has its last state.
        let last = cycle.phases.last()?.1;
        if cycle.phases.first()?.0 > 0.0 {
            cycle.phases.insert(0, (0.0, last));
        }
        cycle.phases.push((before_s, last));
        (before_s > 0.0).then_some((signal, cycle))
    });
    Ok(cycles.collect())
}

/// Time at which the first phase of a controller begins, after those it refers to.
fn begins_s(
    controller: &XmlNode,
    scope: &ParameterScope,
    all: &[&XmlNode],
) -> Result<f64, ImportError> {
    let mut sum_s = 0.0;
    let mut at = controller;
    // A chain longer than the list would be a circle.
    for _ in all {
        sum_s += scope.number_or_zero(at, "delay")?;
        let Some(before) = at.raw("reference") else {
            break;
        };
        let known = all.iter().find(|it| it.raw("name") == Some(before));
        at = known.ok_or_else(|| {
            let help = "name a `TrafficSignalController` of the file";
            at.refused(format!("there is no controller `{before}`"), help)
        })?;
    }
    Ok(sum_s)
}

/// Colour of a state: the word, or the bulbs from top to bottom.
pub(super) fn shown(state: &str) -> Option<Phase> {
    let bulbs: Vec<String> = state
        .split(';')
        .map(|it| it.trim().to_lowercase())
        .collect();
    let bulbs: Vec<&str> = bulbs.iter().map(String::as_str).collect();
    match bulbs[..] {
        ["red"] | ["on", "off"] | ["on", "off" | "on", "off"] => Some(Phase::Red),
        ["yellow" | "amber"] | ["off", "on", "off"] => Some(Phase::Yellow),
        ["green"] | ["off", "on"] | ["off", "off", "on"] => Some(Phase::Green),
        _ => None,
    }
}

impl LightCycle {
    /// Phases with the times at which they begin, from 0 to an end.
    fn schedule(&self, until_s: f64) -> Vec<(f64, Phase)> {
        let cycle_s = self.phases.last().map_or(0.0, |(end_s, _)| *end_s);
        // A cycle that begins later has run before, too.
        let back = (self.begins_s / cycle_s).ceil();
        let mut from_s = self.begins_s - back * cycle_s;
        let mut all: Vec<(f64, Phase)> = Vec::new();
        while from_s < until_s {
            for pair in self.phases.windows(2) {
                let [(begins_s, phase), (ends_s, _)] = [pair[0], pair[1]];
                // A phase without a duration, such as the first of two states at one
                // time, is never seen.
                if from_s + ends_s <= 0.0 || ends_s <= begins_s {
                    continue;
                }
                let goes_on = all.last().is_some_and(|(_, last)| *last == phase);
                if !goes_on {
                    all.push(((from_s + begins_s).max(0.0), phase));
                }
            }
            from_s += cycle_s;
        }
        all
    }
}

impl ImportedLight {
    /// Returns the light of a world.
    pub(super) fn agent(&self, until_s: f64) -> AgentFile {
        // A world refuses longer runs.
        let until_s = (until_s / STEP_S).ceil().min(MOST_STEPS) * STEP_S;
        let phases = self.cycle.schedule(until_s).into_iter();
        let phases = phases.map(|(at_s, phase)| (tidy(at_s), phase));
        AgentFile::Light {
            name: light_name(&self.signal),
            road: None,
            signal: None,
            line_m: Some(tidy(self.line_m)),
            phase: Phase::default(),
            drive: LightFile::Schedule(Schedule(phases.collect())),
        }
    }
}

/// Returns the name of the light of a signal.
pub(super) fn light_name(signal: &str) -> String {
    let letters = signal.chars();
    let name: String = letters
        .map(|it| if it.is_ascii_alphanumeric() { it } else { '_' })
        .collect();
    format!("light_{name}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use Phase::{Green, Red, Yellow};

    #[test]
    fn schedules_repeat_their_cycle_before_and_after_its_begin() {
        let phases = vec![(0.0, Green), (20.0, Yellow), (23.0, Red), (40.0, Red)];
        let cycle = |begins_s| LightCycle {
            begins_s,
            phases: phases.clone(),
        };
        let first = [(0.0, Green), (20.0, Yellow), (23.0, Red), (40.0, Green)];
        assert_eq!(cycle(0.0).schedule(50.0)[..4], first);
        // 5 s late: the red of the cycle before lasts until then.
        let late = [(0.0, Red), (5.0, Green), (25.0, Yellow), (28.0, Red)];
        assert_eq!(cycle(5.0).schedule(40.0), late);
        assert_eq!(cycle(45.0).schedule(40.0), late);
    }

    #[test]
    fn states_are_words_or_bulbs() {
        assert_eq!(shown("on;off;off"), Some(Red));
        assert_eq!(shown("on; on; off"), Some(Red));
        assert_eq!(shown("off;on;off"), Some(Yellow));
        assert_eq!(shown("Green"), Some(Green));
        assert_eq!(shown("off;on"), Some(Green));
        assert_eq!(shown("off;off;off"), None);
        assert_eq!(shown("mode_3"), None);
    }
}
