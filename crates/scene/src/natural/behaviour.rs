//! Driving of the ados in a recorded episode, as a model of traffic rates it.

use super::vehicle_meter::samples_in;
use crate::road::OnRoad;
use crate::scene::drive::{Drive, DriveWorld};
use crate::sim::Pose;
use crate::trace::Trace;
use brakecheck_driver_model::{CUT_IN_GAP_M, CutInState, DECISION_S, DrivingBehaviour, StartState};

/// Returns the driving of each ado in a vehicle, with its name, over some samples.
pub fn behaviours(
    world: &DriveWorld,
    trace: &Trace,
    samples: usize,
) -> Vec<(String, DrivingBehaviour)> {
    let spec = world.spec();
    let agents = spec.agents.iter().enumerate();
    let ados =
        agents.filter(|(_, it)| matches!(it.drive, Drive::Ado { .. }) && !it.body.is_on_foot());
    let driving = ados.filter_map(|(agent, it)| {
        let track = AdoTrack::new(world, trace, agent)?;
        Some((it.name.clone(), track.behaviour(samples)?))
    });
    driving.collect()
}

/// Recorded motion of an ado beside the ego.
struct AdoTrack<'a> {
    world: &'a DriveWorld,
    agent: usize,
    ego: usize,
    own: [&'a [f64]; 4],
    egos: [&'a [f64]; 4],
    sample_s: f64,
}

impl<'a> AdoTrack<'a> {
    fn new(world: &'a DriveWorld, trace: &'a Trace, agent: usize) -> Option<AdoTrack<'a>> {
        let spec = world.spec();
        let ego = spec.egos().next()?;
        let columns = |agent: usize| -> Option<[&'a [f64]; 4]> {
            let name = &spec.agents[agent].name;
            let [x, y, heading, speed] =
                ["x", "y", "heading", "speed"].map(|it| trace.signal(&format!("{name}.{it}")));
            Some([x?, y?, heading?, speed?])
        };
        Some(AdoTrack {
            own: columns(agent)?,
            egos: columns(ego)?,
            sample_s: trace.dt_s(),
            world,
            agent,
            ego,
        })
    }

    fn behaviour(&self, samples: usize) -> Option<DrivingBehaviour> {
        let speeds = self.own[3].get(..samples)?;
        // The model knows accelerations as means over `DECISION_S`, whatever
        // the sample.
        let stretch = samples_in(DECISION_S, self.sample_s);
        let at: Vec<f64> = speeds.iter().step_by(stretch).copied().collect();
        // The model has starts and cut-ins of traffic in the ego's direction only.
        let is_with_ego = self.world.spec().agents[self.agent].is_with_road();
        Some(DrivingBehaviour {
            speed_mps: *speeds.first()?,
            decision_s: DECISION_S,
            accelerations_mps2: at
                .windows(2)
                .map(|pair| (pair[1] - pair[0]) / DECISION_S)
                .collect(),
            cut_ins: if is_with_ego {
                self.cut_ins(samples)
            } else {
                Vec::new()
            },
            start: is_with_ego.then(|| self.start()).flatten(),
        })
    }

    /// Returns the road coordinates of ado and ego.
    fn at(&self, sample: usize) -> [OnRoad; 2] {
        [self.own, self.egos].map(|[x, y, heading, _]| {
            self.world.course().locate(&Pose {
                x_m: x[sample],
                y_m: y[sample],
                heading_rad: heading[sample],
            })
        })
    }

    /// Returns the clearance from the ego to the ado ahead, negative alongside.
    ///
    /// `None` if the ado is behind the ego.
    fn gap_m(&self, [own, ego]: &[OnRoad; 2]) -> Option<f64> {
        let agents = &self.world.spec().agents;
        let is_behind = own.s_m < ego.s_m - agents[self.ego].body.length_m;
        (!is_behind).then(|| own.s_m - agents[self.agent].body.length_m - ego.s_m)
    }

    /// Returns whether an ado is in the lane in which an ego is.
    fn is_in_lane_of(&self, own: &OnRoad, ego: &OnRoad) -> bool {
        let road = &self.world.spec().road;
        let lane_m = road.lane_middle_m(road.lane_at(ego.lateral_m));
        (own.lateral_m - lane_m).abs() < 0.5 * road.lane_width_m()
    }

    fn cut_ins(&self, samples: usize) -> Vec<CutInState> {
        let mut found = Vec::new();
        let mut before = self.at(0);
        for sample in 1..samples {
            let now = self.at(sample);
            let [own, ego] = &now;
            // Both against the ego's lane now: an ego that changes into the lane of the
            // ado is not cut in on.
            if self.is_in_lane_of(own, ego) && !self.is_in_lane_of(&before[0], ego) {
                let gap_m = self.gap_m(&now).filter(|gap_m| *gap_m <= CUT_IN_GAP_M);
                found.extend(gap_m.map(|gap_m| CutInState {
                    // Alongside the gap is negative and counts as none.
                    gap_m: gap_m.max(0.0),
                    closing_mps: self.egos[3][sample] - self.own[3][sample],
                    lateral_mps: (now[0].lateral_m - before[0].lateral_m) / self.sample_s,
                }));
            }
            before = now;
        }
        found
    }

    /// Returns the state of the ego if it begins behind the ado in its lane.
    fn start(&self) -> Option<StartState> {
        let first = self.at(0);
        // Side by side, neither has begun behind the other.
        let gap_m = self.gap_m(&first).filter(|gap_m| *gap_m >= 0.0)?;
        self.is_in_lane_of(&first[0], &first[1])
            .then(|| StartState {
                speed_mps: self.egos[3][0],
                gap_m,
                closing_mps: self.egos[3][0] - self.own[3][0],
            })
    }
}
