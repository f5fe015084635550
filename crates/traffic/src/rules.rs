//! Rules in Signal Temporal Logic over all vehicles of a recording.

use std::collections::BTreeSet;
use std::sync::Arc;

use brakecheck_stl::trace::{Schema, SchemaError, Signal};
use brakecheck_stl::{Constants, Formula, Monitor, Names, Samples, Settings, StlError};
use serde::{Deserialize, Serialize};

use crate::following::{LEAD_GAP_M, Leads, TTC_MAX_S};
use crate::lane_frame::LaneFrame;
use crate::recording::{Class, TrafficRecording};

/// Time within which violations of a rule are one episode.
const SAME_EPISODE_S: f64 = 1.0;

/// Named rules for recorded vehicles, written as RON.
///
/// The list of rules has the form of a rulebook in a world file. `vehicle` is the name
/// of each recorded vehicle in turn, and `lead` that of the vehicle ahead in its lane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename = "RuleFile", deny_unknown_fields)]
pub struct TrafficRuleFile {
    /// Name of the vehicle in the formulas, by default `ego`.
    #[serde(default = "ego")]
    pub vehicle: String,
    /// Name of the vehicle ahead in the formulas, by default `lead`.
    #[serde(default = "lead")]
    pub lead: String,
    /// Constants of the formulas.
    #[serde(default)]
    pub constants: Constants,
    /// Rules, in the order of the report.
    pub rules: Vec<TrafficRule>,
}

/// Rule of a rule file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename = "Rule", deny_unknown_fields)]
pub struct TrafficRule {
    /// Name in the report.
    pub name: String,
    /// Formula that holds at every sample. An outer `always` may be written.
    pub stl: String,
}

fn ego() -> String {
    "ego".to_owned()
}

fn lead() -> String {
    "lead".to_owned()
}

impl TrafficRule {
    /// Returns the formula under an `always` over the whole trace.
    ///
    /// # Errors
    /// The formula is invalid.
    pub fn always(&self) -> Result<String, StlError> {
        let formula: Formula = self.stl.parse()?;
        Ok(format!("always ({})", without_always(formula)))
    }
}

/// Error in a rule file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RulesError {
    /// The text is not RON of a rule file.
    #[error("invalid rule file at {0}")]
    Ron(#[from] ron::error::SpannedError),
    /// A formula is invalid, or names an unknown signal.
    #[error("rule `{rule}`: {source}")]
    Formula {
        /// Name of the rule.
        rule: String,
        /// Error in its formula.
        source: Box<StlError>,
    },
    /// Two signals have the same name.
    #[error("`vehicle` and `lead` have the same name: {0}")]
    Names(#[from] SchemaError),
}

impl RulesError {
    /// Returns the fix in the imperative.
    pub fn help(&self) -> String {
        match self {
            RulesError::Ron(_) => {
                "write RuleFile(rules: [Rule(name: \"…\", stl: \"…\")])".to_owned()
            }
            RulesError::Formula { source, .. } => match source.help() {
                Some(help) => help.to_owned(),
                None => "`brakecheck stl --help` lists the signals".to_owned(),
            },
            RulesError::Names(_) => "give them different names".to_owned(),
        }
    }
}

impl TrafficRuleFile {
    /// Creates a file of rules with the vehicles `ego` and `lead`, without constants.
    pub fn of(rules: Vec<TrafficRule>) -> TrafficRuleFile {
        TrafficRuleFile {
            vehicle: ego(),
            lead: lead(),
            constants: Constants::default(),
            rules,
        }
    }

    /// Returns the RON text of the shipped rules for motorways.
    pub fn motorway_text() -> &'static str {
        include_str!("../rules/motorway.ron")
    }

    /// Parses a rule file.
    ///
    /// # Errors
    /// The text is not RON of a rule file.
    pub fn parse(text: &str) -> Result<TrafficRuleFile, RulesError> {
        Ok(ron::from_str(text)?)
    }

    /// Returns the signals of a vehicle, in the order of their columns.
    pub fn signals(&self) -> Vec<Signal> {
        let (own, lead) = (&self.vehicle, &self.lead);
        let real = |name: String, unit: &'static str, about: &str| Signal::real(name, unit, about);
        vec![
            real(format!("{own}.speed"), "m/s", "velocity along the heading"),
            real(
                format!("{own}.accel"),
                "m/s²",
                "acceleration along the heading",
            ),
            real(
                format!("{own}.s"),
                "m",
                "front bumper along the carriageway",
            ),
            real(
                format!("{own}.lateral"),
                "m",
                "offset to the left of the right lane",
            ),
            real(
                format!("{own}.lane"),
                "",
                "lane from the right, −1 outside of all",
            ),
            Signal::boolean(
                format!("{lead}.present"),
                "whether a vehicle is ahead within 120 m",
            ),
            real(
                format!("{lead}.speed"),
                "m/s",
                "its speed, the own speed without a lead",
            ),
            real(
                format!("{own}.{lead}.gap"),
                "m",
                "clearance to it, 120 without a lead",
            ),
            real(
                format!("{own}.{lead}.ttc"),
                "s",
                "clearance over closing speed, at most 100 s",
            ),
            real(
                format!("{own}.{lead}.closing"),
                "m/s",
                "closing speed, 0 without a lead",
            ),
        ]
    }

    /// Binds the rules to the signals of a recording.
    ///
    /// # Errors
    /// A formula is invalid, or names an unknown signal.
    pub fn bind(&self, recording: &TrafficRecording) -> Result<BoundRules, RulesError> {
        let schema = Arc::new(Schema::new(recording.dt_s, self.signals())?);
        let names = Names {
            constants: self.constants.clone(),
            ..Names::default()
        };
        let bound = |rule: &TrafficRule| {
            let wrong = |error: StlError| RulesError::Formula {
                rule: rule.name.clone(),
                source: Box::new(error),
            };
            let formula: Formula = rule.stl.parse().map_err(wrong)?;
            let formula = without_always(formula);
            let monitor = formula.bind_with(&schema, &names, &Settings::default());
            Ok((rule.name.clone(), monitor.map_err(wrong)?))
        };
        let monitors = self.rules.iter().map(bound);
        Ok(BoundRules {
            monitors: monitors.collect::<Result<_, RulesError>>()?,
            schema,
        })
    }
}

/// Removes an `always` over the whole trace, so that samples are judged one by one.
fn without_always(formula: Formula) -> Formula {
    let text = formula.to_string();
    let body = || {
        let rest = text.strip_prefix("always")?;
        let rest = ["[0, T]", "[0, inf]"]
            .iter()
            .find_map(|bounds| rest.strip_prefix(bounds))
            .unwrap_or(rest);
        let inner = rest.strip_prefix(" (")?.strip_suffix(')')?;
        // Whole only if the first parenthesis closes at the end.
        let mut depth = 0_i32;
        let closes_early = inner.chars().any(|it| {
            depth += match it {
                '(' => 1,
                ')' => -1,
                _ => 0,
            };
            depth < 0
        });
        if closes_early {
            return None;
        }
        inner.parse().ok()
    };
    body().unwrap_or(formula)
}

/// Rules that are bound to the signals of a recording.
pub struct BoundRules {
    schema: Arc<Schema>,
    monitors: Vec<(String, Monitor)>,
}

/// Result of a rule on a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RuleResult {
    /// Name of the rule.
    pub rule: String,
    /// Rows of vehicles on a carriageway.
    pub rows: usize,
    /// Recorded rows with a negative robustness, without interpolated and overlapping ones.
    pub rows_broken: usize,
    /// Vehicles with an episode.
    pub vehicles: usize,
    /// Episodes, which are at least 1 s apart within a vehicle.
    pub episodes: usize,
    /// Episodes left out because all of their rows are interpolated or overlap.
    pub doubtful: usize,
    /// Kilometres driven by all vehicles.
    pub distance_km: f64,
    /// Row with the least robustness, `None` without an episode.
    pub worst: Option<WorstRow>,
}

impl RuleResult {
    /// Returns the share of rows with a negative robustness.
    pub fn share(&self) -> f64 {
        self.rows_broken as f64 / self.rows.max(1) as f64
    }

    /// Returns the episodes per 1,000 km.
    pub fn per_1000_km(&self) -> f64 {
        1000.0 * self.episodes as f64 / self.distance_km.max(1e-9)
    }
}

/// Row of a vehicle with its robustness.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct WorstRow {
    /// Identity of the vehicle.
    pub id: String,
    /// Identity of its lead.
    pub lead: Option<String>,
    /// Track of the vehicle in the recording.
    pub track: usize,
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Robustness of the rule.
    pub robustness: f64,
}

/// Columns of one vehicle, in the order of [`TrafficRuleFile::signals`].
#[derive(Default)]
struct VehicleColumns {
    lateral_m: Vec<f64>,
    lane: Vec<f64>,
    present: Vec<f64>,
    lead_mps: Vec<f64>,
    gap_m: Vec<f64>,
    ttc_s: Vec<f64>,
    closing_mps: Vec<f64>,
}

impl BoundRules {
    /// Evaluates all rules on every motor vehicle on a carriageway.
    pub fn evaluate(
        &self,
        recording: &TrafficRecording,
        frame: &LaneFrame,
        leads: &Leads,
    ) -> Vec<RuleResult> {
        let mut tallies: Vec<RuleTally> = self.monitors.iter().map(RuleTally::new).collect();
        let mut columns = VehicleColumns::default();
        let mut robustness = Vec::new();
        for (track, placed) in frame.tracks.iter().enumerate() {
            let Some(placed) = placed else { continue };
            let own = &recording.tracks[track];
            // A trailer has no driver.
            if own.class == Class::Trailer {
                continue;
            }
            columns.fill(own, placed, &leads.of[track]);
            let all = vec![
                &own.speed_mps[..],
                &own.accel_mps2,
                &placed.s_m,
                &columns.lateral_m,
                &columns.lane,
                &columns.present,
                &columns.lead_mps,
                &columns.gap_m,
                &columns.ttc_s,
                &columns.closing_mps,
            ];
            // Invariant: the columns are those of the schema, and recordings are finite.
            let Ok(samples) = Samples::new(Arc::clone(&self.schema), all) else {
                continue;
            };
            let distance_km = own.distance_m() / 1000.0;
            for ((_, monitor), tally) in self.monitors.iter().zip(&mut tallies) {
                monitor.robustness_of_all(&samples, &mut robustness);
                tally.add(recording, leads, track, &robustness, distance_km);
            }
        }
        tallies.into_iter().map(RuleTally::finish).collect()
    }
}

impl VehicleColumns {
    fn fill(
        &mut self,
        own: &crate::RoadUserTrack,
        placed: &crate::PlacedTrack,
        leads: &[Option<crate::Lead>],
    ) {
        self.lateral_m.clone_from(&placed.lateral_m);
        self.lane.clear();
        let lane = |it: &Option<u8>| it.map_or(-1.0, f64::from);
        self.lane.extend(placed.lane.iter().map(lane));
        for column in [
            &mut self.present,
            &mut self.lead_mps,
            &mut self.gap_m,
            &mut self.ttc_s,
            &mut self.closing_mps,
        ] {
            column.clear();
        }
        for (lead, speed_mps) in leads.iter().zip(&own.speed_mps) {
            self.present.push(f64::from(u8::from(lead.is_some())));
            let closing_mps = lead.map_or(0.0, |it| it.closing_mps);
            self.lead_mps.push(speed_mps - closing_mps);
            self.gap_m.push(lead.map_or(LEAD_GAP_M, |it| it.gap_m));
            self.ttc_s.push(lead.map_or(TTC_MAX_S, |it| it.ttc_s()));
            self.closing_mps.push(closing_mps);
        }
    }
}

/// Running result of a rule.
struct RuleTally {
    result: RuleResult,
    vehicles: BTreeSet<String>,
}

impl RuleTally {
    fn new((name, _): &(String, Monitor)) -> RuleTally {
        RuleTally {
            result: RuleResult {
                rule: name.clone(),
                rows: 0,
                rows_broken: 0,
                vehicles: 0,
                episodes: 0,
                doubtful: 0,
                distance_km: 0.0,
                worst: None,
            },
            vehicles: BTreeSet::new(),
        }
    }

    fn add(
        &mut self,
        recording: &TrafficRecording,
        leads: &Leads,
        track: usize,
        robustness: &[f64],
        distance_km: f64,
    ) {
        self.result.rows += robustness.len();
        self.result.distance_km += distance_km;
        let apart = (SAME_EPISODE_S / recording.dt_s).round() as usize;
        let mut broken = (0..robustness.len())
            .filter(|i| robustness[*i] < 0.0)
            .peekable();
        while let Some(first) = broken.next() {
            let (mut rows, mut worst) = (0, None);
            let mut row = Some(first);
            while let Some(at) = row {
                if !is_doubtful(recording, leads, track, at) {
                    rows += 1;
                    worst = worst
                        .filter(|worst: &usize| robustness[*worst] <= robustness[at])
                        .or(Some(at));
                }
                row = broken.next_if(|it| it - at <= apart);
            }
            let Some(worst) = worst else {
                self.result.doubtful += 1;
                continue;
            };
            self.result.rows_broken += rows;
            self.result.episodes += 1;
            self.note(recording, leads, (track, worst), robustness[worst]);
        }
    }

    /// Keeps the worst row, and counts its vehicle.
    fn note(
        &mut self,
        recording: &TrafficRecording,
        leads: &Leads,
        (track, at): (usize, usize),
        robustness: f64,
    ) {
        let own = &recording.tracks[track];
        self.vehicles.insert(own.id.clone());
        let worst = self.result.worst.as_ref();
        if worst.is_some_and(|it| it.robustness <= robustness) {
            return;
        }
        let lead = leads.of[track][at].map(|it| recording.tracks[it.track].id.clone());
        self.result.worst = Some(WorstRow {
            id: own.id.clone(),
            lead,
            track,
            time_s: (own.first_sample + at) as f64 * recording.dt_s,
            robustness,
        });
    }

    fn finish(mut self) -> RuleResult {
        self.result.vehicles = self.vehicles.len();
        self.result
    }
}

/// Returns true for rows that the recorder made up, or in which two boxes overlap.
fn is_doubtful(recording: &TrafficRecording, leads: &Leads, track: usize, at: usize) -> bool {
    let own = &recording.tracks[track];
    let of_lead = leads.of[track][at].is_some_and(|lead| {
        let ahead = &recording.tracks[lead.track];
        lead.gap_m < 0.0 || ahead.filled[own.first_sample + at - ahead.first_sample]
    });
    own.filled[at] || of_lead
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_always_over_the_whole_trace_is_removed() {
        for (text, left) in [
            ("always (x > 1)", "x > 1"),
            ("always[0, T] (x > 1 and y > 2)", "(x > 1) and (y > 2)"),
            ("always[0, 2] (x > 1)", "always[0, 2] (x > 1)"),
            (
                "(always (x > 1)) and (y > 2)",
                "(always (x > 1)) and (y > 2)",
            ),
            ("x > 1", "x > 1"),
        ] {
            let formula: Formula = text.parse().expect(text);
            let expected: Formula = left.parse().expect(left);
            assert_eq!(without_always(formula).to_string(), expected.to_string());
        }
    }
}
