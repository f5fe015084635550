//! Phases of an ado: stretches below, at and above its neutral action.

use std::cmp::Ordering;

/// Decisions from which the length of a phase is no longer told apart.
const LONGEST: u8 = 16;

/// Phases of an ado up to a decision.
///
/// An action is below or above the neutral one by its place in the ado's set, in which
/// accelerations ascend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Manoeuvre {
    /// The two phases before the last one, and the last one. `None`: there was none.
    phases: [Option<Ordering>; 3],
    /// Decisions of the last phase, and of the one before it.
    lasted: [u8; 2],
    /// Last three phases that are not neutral, without those between them.
    moves: [Option<Ordering>; 3],
}

impl Default for Manoeuvre {
    fn default() -> Manoeuvre {
        Manoeuvre {
            // Before a run every ado counts as neutral, as in the memory of the law.
            phases: [None, None, Some(Ordering::Equal)],
            lasted: [0; 2],
            moves: [None; 3],
        }
    }
}

impl Manoeuvre {
    /// Number of inputs that [`Manoeuvre::features`] writes.
    pub(super) const FEATURES: usize = 11;

    /// Notes an action by its place beside the neutral one.
    pub(super) fn note(&mut self, place: Ordering) {
        if self.phases[2] == Some(place) {
            // Saturating, since all longer phases count as one length.
            self.lasted[0] = self.lasted[0].saturating_add(1);
        } else {
            self.phases = [self.phases[1], self.phases[2], Some(place)];
            self.lasted = [1, self.lasted[0]];
        }
        // A move that goes on after a neutral stretch is still the same move.
        if place.is_ne() && self.moves[2] != Some(place) {
            self.moves = [self.moves[1], self.moves[2], Some(place)];
        }
    }

    /// Writes the phases and their lengths, as inputs of V.
    pub(super) fn features(&self, into: &mut Vec<f32>) {
        // The last phase is the last action, which is an input already.
        for phase in &self.phases[..2] {
            let places = [Ordering::Less, Ordering::Equal, Ordering::Greater];
            into.extend(places.map(|it| if *phase == Some(it) { 1.0 } else { 0.0 }));
        }
        let lasted = self
            .lasted
            .map(|it| f32::from(it.min(LONGEST)) / f32::from(LONGEST));
        into.extend(lasted);
        into.extend(
            self.moves
                .map(|it| it.map_or(0.0, |place| f32::from(place as i8))),
        );
    }

    /// Returns the last three phases that are not neutral, such as `-+-`.
    pub(super) fn in_symbols(&self) -> String {
        let symbol = |place: &Ordering| if place.is_lt() { '-' } else { '+' };
        self.moves.iter().flatten().map(symbol).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(actions: &[usize]) -> Manoeuvre {
        let mut all = Manoeuvre::default();
        actions.iter().for_each(|it| all.note(it.cmp(&1)));
        all
    }

    #[test]
    fn phases_are_told_apart_by_their_order_and_not_by_the_actions_between() {
        for (actions, symbols) in [
            (&[1, 1][..], ""),
            (&[1, 0, 0, 1, 0], "-"),
            (&[0, 1, 2, 1, 0], "-+-"),
            (&[0, 2, 0, 2], "+-+"),
        ] {
            assert_eq!(after(actions).in_symbols(), symbols, "{actions:?}");
        }
    }

    #[test]
    fn inputs_have_the_phases_before_the_last_one_and_the_lengths() {
        let features = |actions: &[usize]| {
            let mut found = Vec::new();
            after(actions).features(&mut found);
            assert_eq!(found.len(), Manoeuvre::FEATURES);
            found
        };
        let found = features(&[0, 0, 0, 2]);
        // Neutral, then three decisions below, then one above.
        assert_eq!(found[..6], [0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(found[6..], [1.0 / 16.0, 3.0 / 16.0, 0.0, -1.0, 1.0]);
        // The same last action after another manoeuvre is another state.
        assert_ne!(found, features(&[1, 1, 1, 2]));
        assert_eq!(features(&[0; 40])[6], 1.0);
    }
}
