//! The vehicle ahead at one sample.

/// Greatest gap at which a vehicle ahead counts as the lead.
pub const LEAD_GAP_M: f64 = 120.0;

/// Greatest time to collision that is reported.
pub const TTC_MAX_S: f64 = 100.0;

/// Vehicle ahead in the same lane at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lead {
    /// Position of its track in the recording.
    pub track: usize,
    /// Clearance along the line in metres. It is negative where boxes overlap.
    pub gap_m: f64,
    /// Speed of the follower minus that of the lead.
    pub closing_mps: f64,
}

impl Lead {
    /// Returns the time to collision in seconds, at most 100.
    pub fn ttc_s(&self) -> f64 {
        if self.closing_mps <= 0.0 {
            return TTC_MAX_S;
        }
        // Overlapping boxes have a negative gap, and a slow approach a huge
        // time.
        (self.gap_m / self.closing_mps).clamp(0.0, TTC_MAX_S)
    }

    /// Returns the constant deceleration that avoids the contact, in m/s².
    ///
    /// It is 0 if the gap does not shrink, and infinite without a gap.
    pub fn needed_mps2(&self) -> f64 {
        brakecheck_driver_model::needed_mps2(self.gap_m, self.closing_mps)
    }
}
