//! Motion of entities after the start, as far as their roads depend on it.

/// Motion of an entity that a storyboard may give it.
#[derive(Clone, Debug, Default)]
pub(super) struct LaterMotion {
    /// True if any action may move it.
    pub acts: bool,
    /// Numbers of actions that change its lane, and its place within or beside lanes.
    pub lane_changes: usize,
    pub offsets: usize,
    /// True if it keeps a distance across, which depends on where it faces.
    pub keeps_aside: bool,
    pub speeds: Vec<SpeedBound>,
    /// Path with times that it follows.
    pub path: Option<TimedPath>,
}

/// Greatest speed from a time on.
#[derive(Clone, Copy, Debug)]
pub(super) struct SpeedBound {
    pub from_s: f64,
    pub most_mps: f64,
}

/// End of a path with times: when, after which way, and the speed there.
#[derive(Clone, Copy, Debug)]
pub(super) struct TimedPath {
    pub ends_s: f64,
    pub way_m: f64,
    pub last_mps: f64,
}

/// Earliest time in seconds at which a way is driven that begins with a speed.
pub(super) fn driven_s(bounds: &[SpeedBound], first_mps: f64, way_m: f64) -> f64 {
    let mut sorted = bounds.to_vec();
    // Bounds come in the order of the file and not of time.
    sorted.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    // Speeds only grow here: a slower one need not come, or not for long.
    let (mut time_s, mut left_m, mut speed_mps) = (0.0, way_m, first_mps);
    for SpeedBound { from_s, most_mps } in sorted {
        let until_then_m = speed_mps * (from_s - time_s);
        if left_m <= until_then_m {
            break;
        }
        left_m -= until_then_m;
        time_s = from_s;
        speed_mps = most_mps.max(speed_mps);
    }
    // At rest this is infinite, or NaN right at the end. The caller
    // accepts finite times only.
    time_s + left_m / speed_mps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entity_leaves_its_road_no_earlier_than_its_actions_allow() {
        // Checked against sums by hand: 100 m at 10 m/s, then 20 m/s from 4 s on.
        let bound = |from_s, most_mps| SpeedBound { from_s, most_mps };
        let leaves_s = |speeds: &[SpeedBound], way_m: f64| driven_s(speeds, 10.0, way_m);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        assert_eq!(leaves_s(&[], 100.0), 10.0);
        assert_eq!(leaves_s(&[bound(4.0, 20.0)], 100.0), 7.0);
        assert_eq!(leaves_s(&[bound(12.0, 20.0)], 100.0), 10.0);
        // A slower speed need not come.
        let speeds = [bound(4.0, 2.0), bound(2.0, 15.0)];
        near(leaves_s(&speeds, 100.0), 2.0 + 80.0 / 15.0);
        assert_eq!(leaves_s(&[bound(f64::INFINITY, 99.0)], 100.0), 10.0);
    }
}
