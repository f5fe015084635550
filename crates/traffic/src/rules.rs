//! Rules in Signal Temporal Logic over all vehicles of a recording.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use brakecheck_driver_model::{RuleResult, RulesError, TrafficRule, TrafficRuleFile, WorstRow};
use brakecheck_stl::trace::Schema;
use brakecheck_stl::{Monitor, Names, Samples, Settings, StlError};
use serde::Serialize;

use crate::following::Leads;
use crate::lane_frame::LaneFrame;
use crate::lead::{LEAD_GAP_M, TTC_MAX_S};
use crate::path_leads::OwnPath;
use crate::recording::TrafficRecording;

/// Time within which violations of a rule are one episode.
const SAME_EPISODE_S: f64 = 1.0;

/// Rules that are bound to the signals of a recording.
pub struct BoundRules {
    schema: Arc<Schema>,
    monitors: Vec<(String, Monitor)>,
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
    /// Binds rules to the signals of a recording.
    ///
    /// # Errors
    /// A formula is invalid, or names an unknown signal.
    pub fn bind(
        rules: &TrafficRuleFile,
        recording: &TrafficRecording,
    ) -> Result<BoundRules, RulesError> {
        // A file without rules would report that nothing was broken.
        if rules.rules.is_empty() {
            return Err(RulesError::Empty);
        }
        let schema = Arc::new(Schema::new(recording.dt_s, rules.signals())?);
        let names = Names {
            constants: rules.constants.clone(),
            ..Names::default()
        };
        let bound = |rule: &TrafficRule| {
            let wrong = |error: StlError| RulesError::Formula {
                rule: rule.name.clone(),
                source: Box::new(error),
            };
            let formula = rule.per_sample().map_err(wrong)?;
            let monitor = formula.bind_with(&schema, &names, &Settings::default());
            Ok((rule.name.clone(), monitor.map_err(wrong)?))
        };
        let monitors = rules.rules.iter().map(bound);
        Ok(BoundRules {
            monitors: monitors.collect::<Result<_, RulesError>>()?,
            schema,
        })
    }

    /// Evaluates all rules on every motor vehicle.
    ///
    /// Outside of the carriageways the vehicle ahead is that on the own path. `ego.s` is
    /// then along it, `ego.lane` is −1 and `ego.lateral` is 0.
    ///
    /// # Errors
    /// The recording has no motor vehicle.
    pub fn evaluate(
        &self,
        recording: &TrafficRecording,
        frame: &LaneFrame,
        leads: &Leads,
    ) -> Result<Vec<RuleResult>, RulesError> {
        let mut tallies: Vec<RuleTally> = self.monitors.iter().map(RuleTally::new).collect();
        let mut columns = VehicleColumns::default();
        // Reused for every vehicle and rule.
        let mut robustness = Vec::new();
        let mut evaluated = 0;
        for (track, own) in recording.tracks.iter().enumerate() {
            if !own.class.is_motor_vehicle() {
                continue;
            }
            let placed = frame.tracks[track].clone();
            let Some(placed) = placed.or_else(|| along_own_path(own)) else {
                continue;
            };
            columns.fill(own, &placed, leads.of_track(track));
            // In the order of the schema, by which formulas find their
            // signals.
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
            evaluated += 1;
            let distance_km = own.distance_m() / 1000.0;
            for ((_, monitor), tally) in self.monitors.iter().zip(&mut tallies) {
                monitor.robustness_of_all(&samples, &mut robustness);
                tally.add(recording, leads, track, &robustness, distance_km);
            }
        }
        // Rules that nothing was measured against hold for everything.
        if evaluated == 0 {
            return Err(RulesError::NoVehicle {
                recording: recording.name.clone(),
            });
        }
        Ok(tallies.into_iter().map(RuleTally::finish).collect())
    }
}

/// Returns the place of a vehicle along its own path.
fn along_own_path(track: &crate::RoadUserTrack) -> Option<crate::PlacedTrack> {
    let path = OwnPath::of(track)?;
    Some(crate::PlacedTrack {
        carriageway: 0,
        s_m: path.front_m(track),
        lateral_m: vec![0.0; track.len()],
        // Becomes −1 in the signal, since formulas have no missing values.
        lane: vec![None; track.len()],
    })
}

/// Amount of a recording that rules are evaluated on.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct EvaluatedRows {
    /// Tracks of motor vehicles.
    pub vehicles: usize,
    /// Those of them without lanes, evaluated along their paths.
    pub by_path: usize,
    /// Rows of all of them.
    pub rows: usize,
    /// Rows with a vehicle ahead.
    pub rows_with_lead: usize,
    /// Tracks of other classes, which are not evaluated.
    pub left_out: BTreeMap<&'static str, usize>,
}

impl EvaluatedRows {
    /// Counts the vehicles and rows of a recording.
    pub fn of(recording: &TrafficRecording, frame: &LaneFrame, leads: &Leads) -> EvaluatedRows {
        let mut found = EvaluatedRows::default();
        for (i, track) in recording.tracks.iter().enumerate() {
            if !track.class.is_motor_vehicle() {
                *found.left_out.entry(track.class.name()).or_default() += 1;
                continue;
            }
            found.vehicles += 1;
            found.by_path += usize::from(frame.tracks[i].is_none());
            found.rows += track.len();
            found.rows_with_lead += leads.of_track(i).iter().flatten().count();
        }
        found
    }
}

impl fmt::Display for EvaluatedRows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} tracks of motor vehicles in {} rows, {} rows with a vehicle ahead",
            self.vehicles, self.rows, self.rows_with_lead
        )?;
        if self.by_path > 0 {
            write!(
                f,
                "; {} of them without lanes, along their paths",
                self.by_path
            )?;
        }
        for (class, count) in &self.left_out {
            write!(f, "; left out: {count} of class {class}")?;
        }
        Ok(())
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
            // The own speed without a vehicle ahead, so that no rule sees a
            // closing speed.
            self.lead_mps.push(speed_mps - closing_mps);
            // The placeholder is the farthest gap that counts, so that a rule
            // about gaps holds.
            self.gap_m.push(lead.map_or(LEAD_GAP_M, |it| it.gap_m));
            self.ttc_s.push(lead.map_or(TTC_MAX_S, |it| it.ttc_s()));
            self.closing_mps.push(closing_mps);
        }
    }
}

/// Signals of the vehicle ahead that a rule reads.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LeadSignals {
    None,
    /// Only whether it is present.
    Presence,
    /// Its speed, gap or the like, which have placeholders without it.
    Numbers,
}

impl LeadSignals {
    fn of(monitor: &Monitor) -> LeadSignals {
        // Signals are ascending, so the last says most.
        match monitor.signals().last() {
            Some(last) if *last > TrafficRuleFile::LEAD_PRESENT => LeadSignals::Numbers,
            Some(&TrafficRuleFile::LEAD_PRESENT) => LeadSignals::Presence,
            _ => LeadSignals::None,
        }
    }

    /// Returns whether a row without a vehicle ahead answers the rule.
    fn answers_alone(self, robustness: f64) -> bool {
        match self {
            LeadSignals::None => true,
            // An infinite robustness says only that no vehicle is ahead.
            LeadSignals::Presence => robustness.is_finite(),
            LeadSignals::Numbers => false,
        }
    }
}

/// Running result of a rule.
struct RuleTally {
    result: RuleResult,
    lead: LeadSignals,
    vehicles: BTreeSet<String>,
}

impl RuleTally {
    fn new((name, monitor): &(String, Monitor)) -> RuleTally {
        RuleTally {
            lead: LeadSignals::of(monitor),
            result: RuleResult {
                rule: name.clone(),
                rows: 0,
                rows_evaluated: 0,
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
        let ahead = leads.of_track(track).iter();
        let answered = ahead
            .zip(robustness)
            .enumerate()
            .filter(|(i, (lead, rho))| {
                let answers = lead.is_some() || self.lead.answers_alone(**rho);
                answers && !is_doubtful(recording, leads, track, *i)
            });
        self.result.rows_evaluated += answered.count();
        self.result.distance_km += distance_km;
        let apart = (SAME_EPISODE_S / recording.dt_s).round() as usize;
        // A robustness of 0 is no violation.
        let mut broken = (0..robustness.len())
            .filter(|i| robustness[*i] < 0.0)
            .peekable();
        while let Some(first) = broken.next() {
            let (mut rows, mut worst) = (0, None);
            let mut row = Some(first);
            while let Some(at) = row {
                // Doubtful rows join an episode but do not count in it.
                if !is_doubtful(recording, leads, track, at) {
                    rows += 1;
                    worst = worst
                        .filter(|worst: &usize| robustness[*worst] <= robustness[at])
                        .or(Some(at));
                }
                row = broken.next_if(|it| it - at <= apart);
            }
            // All of its rows are doubtful, so the episode may be an artefact.
            let Some(worst) = worst else {
                self.result.doubtful += 1;
                continue;
            };
            self.result.rows_broken += rows;
            self.result.episodes += 1;
            let own = &recording.tracks[track];
            let lead = leads.of_track(track)[worst];
            self.note(WorstRow {
                id: own.id.clone(),
                lead: lead.map(|it| recording.tracks[it.track].id.clone()),
                track,
                time_s: (own.first_sample + worst) as f64 * recording.dt_s,
                robustness: robustness[worst],
            });
        }
    }

    /// Keeps the worst row, and counts its vehicle.
    fn note(&mut self, row: WorstRow) {
        self.vehicles.insert(row.id.clone());
        let worst = self.result.worst.as_ref();
        // Strictly worse, so that the first of equal rows is reported.
        if worst.is_none_or(|it| row.robustness < it.robustness) {
            self.result.worst = Some(row);
        }
    }

    fn finish(mut self) -> RuleResult {
        self.result.vehicles = self.vehicles.len();
        self.result
    }
}

/// Returns true for rows that the recorder made up, or in which two boxes overlap.
fn is_doubtful(recording: &TrafficRecording, leads: &Leads, track: usize, at: usize) -> bool {
    let own = &recording.tracks[track];
    let of_lead = leads.of_track(track)[at].is_some_and(|lead| {
        let ahead = &recording.tracks[lead.track];
        lead.gap_m < 0.0 || ahead.filled[own.first_sample + at - ahead.first_sample]
    });
    own.filled[at] || of_lead
}
