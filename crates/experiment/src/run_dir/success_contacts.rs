//! Contacts among the successes of a row, and the part of the ego in them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::severity::{Impact, Side};

/// Contacts among the successes of a row.
///
/// A violation of a specification need not be a crash, and a crash need not be the ego's
/// fault. These counts show which successes a row has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SuccessContacts {
    /// Successes that end in a contact.
    pub contacts: usize,
    /// Contacts by the side of the ego that is touched.
    ///
    /// Contacts without the ego are in none.
    pub sides: BTreeMap<Side, usize>,
    /// Contacts with the ego at rest, at 0.5 m/s or less.
    pub ego_at_rest: usize,
    /// Contacts at the rear of the moving ego.
    pub hit_from_behind: usize,
    /// Contacts to which the reference drivers apply, of a sample of the successes.
    pub judged: usize,
    /// Judged contacts that some reference driver avoids.
    pub avoided: usize,
    /// Successes of that sample without a contact, or to which no driver applies.
    pub not_judged: usize,
}

impl SuccessContacts {
    /// Counts the contacts of some successes, each with its impact on the ego, if any.
    pub fn counted(contacts: impl Iterator<Item = Option<Impact>>) -> SuccessContacts {
        let mut counted = SuccessContacts::default();
        for impact in contacts {
            counted.contacts += 1;
            let Some(impact) = impact else { continue };
            *counted.sides.entry(impact.ego_side).or_default() += 1;
            // Each contact counts once, and an ego that stands is not blamed for its
            // rear.
            if impact.is_ego_at_rest() {
                counted.ego_at_rest += 1;
            } else if !impact.concerns_ego() {
                counted.hit_from_behind += 1;
            }
        }
        counted
    }

    /// Returns the contacts in which the ego is at rest or is hit from behind.
    pub fn without_fault(&self) -> usize {
        self.ego_at_rest + self.hit_from_behind
    }

    /// Returns the contacts at the front, at either flank and at the rear of the ego.
    pub fn front_side_rear(&self) -> [usize; 3] {
        let of = |side: Side| self.sides.get(&side).copied().unwrap_or(0);
        [
            of(Side::Front),
            of(Side::Left) + of(Side::Right),
            of(Side::Rear),
        ]
    }

    /// Returns the warning that most contacts are no fault of the ego, if so.
    ///
    /// `successes` are those of the row.
    pub fn warning(&self, successes: usize) -> Option<String> {
        // Up to a half, the row is still about faults of the ego.
        if 2 * self.without_fault() <= self.contacts {
            return None;
        }
        let mut text = format!(
            "of {successes} successes, {} are contacts with the ego at rest or hit from behind",
            self.without_fault()
        );
        // A file may hold counts that contradict each other.
        let without = successes.saturating_sub(self.contacts);
        if without > 0 {
            text.push_str(&format!(" and {without} have no contact"));
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::severity::CrashKind;

    fn impact(ego_side: Side, ego_speed_mps: f64) -> Option<Impact> {
        Some(Impact {
            kind: CrashKind::Crossing,
            ego_side,
            other_side: Side::Front,
            overlap: None,
            ego_speed_mps,
            other_speed_mps: 5.0,
            turned_rad: 0.0,
            ego_delta_v_mps: 1.0,
            other_delta_v_mps: 1.0,
            curve: None,
        })
    }

    #[test]
    fn contacts_are_counted_by_side_and_by_the_part_of_the_ego() {
        let contacts = [
            impact(Side::Front, 10.0),
            impact(Side::Left, 10.0),
            impact(Side::Right, 0.5),
            impact(Side::Rear, 10.0),
            impact(Side::Rear, 0.0),
            None,
        ];
        let counted = SuccessContacts::counted(contacts.into_iter());
        assert_eq!(counted.contacts, 6);
        assert_eq!(counted.front_side_rear(), [1, 2, 2]);
        // A standing ego that is hit from behind counts once.
        assert_eq!((counted.ego_at_rest, counted.hit_from_behind), (2, 1));
        assert_eq!(counted.warning(9), None, "half of six is not most");
    }

    #[test]
    fn most_contacts_without_a_fault_of_the_ego_are_warned_of() {
        let standing = SuccessContacts::counted([impact(Side::Front, 0.1); 3].into_iter());
        assert_eq!(
            standing.warning(5).as_deref(),
            Some(
                "of 5 successes, 3 are contacts with the ego at rest or hit from behind and 2 \
                 have no contact"
            )
        );
        let moving = SuccessContacts::counted([impact(Side::Front, 0.6); 3].into_iter());
        assert_eq!(moving.warning(5), None);
        assert_eq!(SuccessContacts::default().warning(5), None);
    }
}
