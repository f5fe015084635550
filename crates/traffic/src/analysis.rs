//! A recording with its lanes, leads and situations.

use crate::crossings::PathCrossing;
use crate::following::Leads;
use crate::lane_frame::{LaneFrame, MappedCarriageway};
use crate::recording::TrafficRecording;
use crate::situations::Situations;

/// Recording with everything that is derived from it once.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Analysis {
    /// The recording.
    pub recording: TrafficRecording,
    /// Its carriageways and lanes.
    pub frame: LaneFrame,
    /// The vehicle ahead of every vehicle.
    pub leads: Leads,
    /// Followings, lane changes and cut-ins.
    pub situations: Situations,
    /// Road users whose paths cross, those with the least time between them first.
    pub crossings: Vec<PathCrossing>,
}

impl Analysis {
    /// Fits lanes and finds leads and situations.
    pub fn of(recording: TrafficRecording) -> Analysis {
        let frame = LaneFrame::fit(&recording);
        Analysis::with_lanes(recording, frame)
    }

    /// Finds leads and situations on mapped lanes.
    pub fn on_map(recording: TrafficRecording, map: &[MappedCarriageway]) -> Analysis {
        let frame = LaneFrame::on_map(&recording, map);
        Analysis::with_lanes(recording, frame)
    }

    fn with_lanes(recording: TrafficRecording, frame: LaneFrame) -> Analysis {
        let leads = Leads::find(&recording, &frame);
        let situations = Situations::find(&recording, &frame, &leads);
        let crossings = PathCrossing::find(&recording);
        Analysis {
            recording,
            frame,
            leads,
            situations,
            crossings,
        }
    }
}
