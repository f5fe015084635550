//! Trying a start again: what its earlier runs have shown of the ego.
//!
//! An ego that is asked the same does the same. So as long as the ado acts as in
//! an earlier run, it is known how the ego moves; only what follows is up to the
//! surrogate, and the later a plan leaves an earlier run, the less of it there is.

use std::borrow::Cow;

use super::strategy::Strategy;
use super::surrogate_sim::SoFar;

/// Every so many-th decision of an earlier run is a place to leave it.
const EVERY: usize = 2;

/// Earlier runs from a start, none of which succeeded.
#[derive(Clone, Debug, Default)]
pub(super) struct Earlier {
    runs: Vec<SoFar>,
    /// The policies that the ado followed from beginning to end.
    followed: Vec<Strategy>,
}

impl Earlier {
    /// One more run that did not succeed, and what the ado kept to throughout.
    pub fn add(&mut self, run: SoFar, kept: Option<Strategy>) {
        self.followed.extend(kept);
        self.runs.push(run);
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.runs.len()
    }

    /// Whether it is known what comes of a strategy from the start on: no success.
    pub fn has_followed(&self, strategy: &Strategy) -> bool {
        match strategy {
            Strategy::Plan(actions) => self.has_played(actions),
            policy => self.followed.contains(policy),
        }
    }

    /// Whether these actions, the last one held, were played to the end.
    fn has_played(&self, actions: &[usize]) -> bool {
        let mut runs = self.runs.iter();
        runs.any(|run| common(run, actions) == run.actions.len())
    }

    /// What is known of these actions, the last one held: `so_far`, or more of an
    /// earlier run that began with them.
    pub fn known<'a>(
        &self,
        so_far: &'a SoFar,
        actions: &[usize],
        samples: usize,
    ) -> Cow<'a, SoFar> {
        let runs = self.runs.iter().map(|run| (common(run, actions), run));
        match runs.max_by_key(|(same, _)| *same) {
            Some((same, run)) if so_far.actions.len() < same => {
                Cow::Owned(run.up_to(same, samples))
            }
            _ => Cow::Borrowed(so_far),
        }
    }

    /// Where earlier runs can be left, `samples` being those of a decision.
    pub fn beginnings(&self, samples: usize) -> Vec<SoFar> {
        let of_run = |run: &SoFar| {
            let lengths = (EVERY..run.actions.len()).step_by(EVERY);
            let beginnings = lengths.map(|length| run.up_to(length, samples));
            beginnings.collect::<Vec<_>>()
        };
        self.runs.iter().flat_map(of_run).collect()
    }
}

/// How many of a run's actions these ones repeat.
fn common(run: &SoFar, actions: &[usize]) -> usize {
    let asked = actions.iter().chain(std::iter::repeat_n(
        actions.last().unwrap_or(&0),
        run.actions.len(),
    ));
    let pairs = run.actions.iter().zip(asked);
    pairs.take_while(|(run, asked)| run == asked).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surrogate::motion::Moment;

    /// Two samples per decision; the sample's number is its place.
    fn run(actions: &[usize]) -> SoFar {
        let moment = |sample: usize| Moment {
            s_m: sample as f64,
            ..Moment::default()
        };
        SoFar {
            actions: actions.to_vec(),
            motion: (0..=2 * actions.len()).map(moment).collect(),
        }
    }

    fn earlier(runs: &[&[usize]]) -> Earlier {
        Earlier {
            runs: runs.iter().map(|actions| run(actions)).collect(),
            followed: vec![Strategy::AsTrained],
        }
    }

    #[test]
    fn an_earlier_run_tells_how_the_ego_moves_until_the_actions_differ() {
        let earlier = earlier(&[&[0, 1, 1, 2], &[0, 1, 2, 2, 2]]);
        let nothing = run(&[]);
        let known = |actions: &[usize]| {
            let known = earlier.known(&nothing, actions, 2);
            (known.actions.len(), known.motion.len())
        };
        assert_eq!(known(&[1]), (0, 1));
        assert_eq!(known(&[0]), (1, 3));
        assert_eq!(known(&[0, 1]), (3, 7), "the last action is held");
        assert_eq!(known(&[0, 1, 2, 0]), (3, 7));
        assert_eq!(known(&[0, 1, 2]), (5, 11), "to its end");
        // What is seen of this run is more than what is known of others.
        let seen = run(&[0, 1, 1, 0]);
        assert_eq!(*earlier.known(&seen, &[0, 1, 1, 0, 2], 2), seen);
    }

    #[test]
    fn what_was_played_to_its_end_is_not_played_again() {
        let earlier = earlier(&[&[0, 1, 1, 2]]);
        assert!(earlier.has_played(&[0, 1, 1, 2]));
        assert!(!earlier.has_played(&[0, 1, 1]));
        assert!(!earlier.has_played(&[0, 1]));
        assert!(earlier.has_followed(&Strategy::Plan(vec![0, 1, 1, 2])));
        assert!(earlier.has_followed(&Strategy::AsTrained));
        assert!(!earlier.has_followed(&Strategy::TrainedOn));
        assert!(super::Earlier::default().beginnings(2).is_empty());
        let from: Vec<_> = earlier.beginnings(2);
        assert_eq!(from.len(), 1);
        assert_eq!((from[0].actions.len(), from[0].motion.len()), (2, 5));
    }
}
