//! Severity of the contacts of a row.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use crate::severity::{CrashKind, Impact, RiskCurve};

/// Closing speeds over all contacts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClosingSpeed {
    /// Median.
    pub median: f64,
    /// 90th percentile.
    pub p90: f64,
}

impl ClosingSpeed {
    /// Returns the percentiles of a list of speeds. `None` for an empty list.
    pub fn of(mut speeds_mps: Vec<f64>) -> Option<ClosingSpeed> {
        if speeds_mps.is_empty() {
            return None;
        }
        speeds_mps.sort_by(f64::total_cmp);
        // Nearest rank, so each percentile is a speed that occurred.
        let at = |share: f64| {
            let rank = (share * (speeds_mps.len() - 1) as f64).round() as usize;
            speeds_mps[rank]
        };
        Some(ClosingSpeed {
            median: at(0.5),
            p90: at(0.9),
        })
    }
}

/// Effect of a row's contacts on the ego.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactSeverity {
    /// Share of the contacts of each kind. The shares add up to 1.
    pub kinds: BTreeMap<CrashKind, f64>,
    /// Share of the contacts in which another agent hit the ego's rear.
    pub struck_from_behind: f64,
    /// Median of the ego's Δv.
    pub ego_delta_v_mps: f64,
    /// Greatest injury risk of each applicable curve.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub max_injury_risk: BTreeMap<RiskCurve, f64>,
}

impl ContactSeverity {
    /// Returns the effect of a list of contacts. `None` for an empty list.
    pub fn of(impacts: &[Impact]) -> Option<ContactSeverity> {
        let all = impacts.len().max(1) as f64;
        let delta_v = ClosingSpeed::of(
            impacts
                .iter()
                .map(|impact| impact.ego_delta_v_mps)
                .collect(),
        )?;
        let mut kinds: BTreeMap<CrashKind, f64> = BTreeMap::new();
        let mut max_injury_risk = BTreeMap::new();
        for impact in impacts {
            *kinds.entry(impact.kind).or_default() += 1.0;
            if let Some(risk) = impact.injury_risk() {
                // Curves are of different injuries, so the risks of two of them do not
                // compare.
                let most = max_injury_risk.entry(risk.curve).or_insert(0.0);
                *most = risk.probability.max(*most);
            }
        }
        kinds.values_mut().for_each(|count| *count /= all);
        let behind = impacts
            .iter()
            .filter(|impact| impact.is_struck_from_behind());
        Some(ContactSeverity {
            kinds,
            struck_from_behind: behind.count() as f64 / all,
            ego_delta_v_mps: delta_v.median,
            max_injury_risk,
        })
    }
}

impl Display for ContactSeverity {
    /// Writes kinds, Δv and the greatest risk in one line.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for (n, (kind, share)) in self.kinds.iter().enumerate() {
            let comma = if n == 0 { "" } else { ", " };
            write!(f, "{comma}{:.0} % {}", 100.0 * share, kind.word())?;
        }
        if self.struck_from_behind > 0.0 {
            let share = 100.0 * self.struck_from_behind;
            write!(f, " ({share:.0} % with the ego struck from behind)")?;
        }
        write!(
            f,
            "; Δv of the ego {:.1} m/s (median)",
            self.ego_delta_v_mps
        )?;
        for (curve, risk) in &self.max_injury_risk {
            let percent = 100.0 * risk;
            write!(f, "; at most {percent:.1} % risk of {}", curve.about())?;
        }
        // Silence would look like no risk.
        if self.max_injury_risk.is_empty() {
            write!(f, "; injury risk not computed")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::severity::Side;

    fn impact(kind: CrashKind, ego_side: Side, ego_delta_v_mps: f64) -> Impact {
        Impact {
            kind,
            ego_side,
            other_side: Side::Front,
            overlap: None,
            ego_speed_mps: 12.5,
            other_speed_mps: 5.0,
            turned_rad: 0.0,
            ego_delta_v_mps,
            other_delta_v_mps: 1.0,
            curve: match kind {
                CrashKind::Pedestrian => Some(RiskCurve::PedestrianFatality),
                CrashKind::Crossing => None,
                _ => Some(RiskCurve::OccupantMais3),
            },
        }
    }

    #[test]
    fn a_row_has_the_shares_of_its_contacts_and_the_greatest_risk_of_each_curve() {
        let all = [
            impact(CrashKind::RearEnd, Side::Front, 4.0),
            impact(CrashKind::Crossing, Side::Rear, 10.0),
            impact(CrashKind::RearEnd, Side::Rear, 6.0),
            impact(CrashKind::RearEnd, Side::Front, 2.0),
            impact(CrashKind::Pedestrian, Side::Front, 1.0),
        ];
        let found = ContactSeverity::of(&all).expect("contacts");
        let kinds = [
            (CrashKind::RearEnd, 0.6),
            (CrashKind::Crossing, 0.2),
            (CrashKind::Pedestrian, 0.2),
        ];
        assert_eq!(found.kinds, BTreeMap::from(kinds));
        // A crossing car that hits a rear did not follow the ego.
        assert_eq!(found.struck_from_behind, 0.2);
        assert_eq!(found.ego_delta_v_mps, 4.0);
        let risk = |at: usize| all[at].injury_risk().expect("a curve").probability;
        assert!(risk(0) > risk(2) && risk(0) > risk(3));
        let risks = [
            (RiskCurve::OccupantMais3, risk(0)),
            (RiskCurve::PedestrianFatality, risk(4)),
        ];
        assert_eq!(found.max_injury_risk, BTreeMap::from(risks));
        let [occupant, pedestrian] = risks.map(|(_, risk)| 100.0 * risk);
        assert_eq!(
            found.to_string(),
            format!(
                "60 % rear-end, 20 % crossing, 20 % pedestrian (20 % with the ego struck from \
                 behind); Δv of the ego 4.0 m/s (median); at most {occupant:.1} % risk of MAIS 3+ \
                 of the ego's occupants; at most {pedestrian:.1} % risk of death of the pedestrian"
            )
        );
        let none = ContactSeverity::of(&all[1..2]).expect("a contact");
        assert_eq!(
            none.to_string(),
            "100 % crossing; Δv of the ego 10.0 m/s (median); injury risk not computed"
        );
        assert_eq!(ContactSeverity::of(&[]), None);
    }
}
