//! Starts of a unit: drawn, or a grid over X_init.

use std::ops::Range;

use super::file::RequestedStarts;
use crate::experiment::{drawn_starts, test_noise};
use crate::scene::Start;
use crate::world::Scenario;

impl RequestedStarts {
    /// Returns the number of starts in a world.
    pub(super) fn count(&self, world: &Scenario) -> usize {
        match self {
            RequestedStarts::Drawn { count, .. } => match world.starts() {
                // A world with a list of starts cannot have more than that list.
                Some(all) => all.len().min(*count),
                None => *count,
            },
            RequestedStarts::Grid { axes, .. } => {
                axes.iter().map(|(_, values)| values.len()).product()
            }
        }
    }

    /// Returns a range of the starts, each with the seed of its noise.
    pub(super) fn of(&self, world: &Scenario, which: Range<usize>) -> Vec<(Start, u64)> {
        match self {
            RequestedStarts::Drawn { count, seed } => {
                // A list that fits is played completely and in order, as `eval` does.
                match world.starts().filter(|all| all.len() <= *count) {
                    None => drawn_starts(world, *seed, which),
                    Some(all) => {
                        let bench = world.bench();
                        let noise = |index| test_noise(&bench, *seed, index);
                        let listed = which.filter_map(|i| Some((all.get(i)?.clone(), noise(i))));
                        listed.collect()
                    }
                }
            }
            RequestedStarts::Grid { axes, seed } => {
                let bench = world.bench();
                // A grid has the noise of the test stream, so that its sensors err as in
                // other verbs.
                let point = |index| (point(world, axes, index), test_noise(&bench, *seed, index));
                which.map(point).collect()
            }
        }
    }
}

/// Returns a point of a grid, where the last axis varies fastest.
fn point(world: &Scenario, axes: &[(String, Vec<f64>)], index: usize) -> Start {
    let axis = |axis: crate::scene::Axis| {
        let mut left = index;
        // Axes that the grid does not name stay at their middle.
        let mut value = (axis.lo + axis.hi) / 2.0;
        // The index is a mixed-radix number with the last axis as its lowest digit.
        for (name, values) in axes.iter().rev() {
            let nth = left % values.len().max(1);
            left /= values.len().max(1);
            if *name == axis.name {
                value = values.get(nth).copied().unwrap_or(value);
            }
        }
        value
    };
    Start(world.axes().into_iter().map(axis).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::{Watch, test_starts};

    fn world() -> Scenario {
        Scenario::shipped("acc").expect("shipped").expect("a world")
    }

    #[test]
    fn drawn_starts_are_those_of_eval_wherever_they_are_cut() {
        let world = world();
        let requested = RequestedStarts::Drawn { count: 9, seed: 7 };
        let all = test_starts(&world, 7, 9, &Watch::unwatched()).expect("not stopped");
        let mut cut = requested.of(&world, 0..4);
        cut.extend(requested.of(&world, 4..9));
        assert_eq!(cut, all.starts);
    }

    #[test]
    fn a_grid_has_every_combination_once_and_the_rest_in_the_middle() {
        let world = world();
        let names: Vec<String> = world.axes().into_iter().map(|axis| axis.name).collect();
        let axes = vec![
            (names[1].clone(), vec![1.0, 2.0, 3.0]),
            (names[0].clone(), vec![10.0, 20.0]),
        ];
        let requested = RequestedStarts::Grid { axes, seed: 0 };
        assert_eq!(requested.count(&world), 6);
        let starts = requested.of(&world, 0..6);
        let of = |nth: usize| -> Vec<f64> { starts.iter().map(|(it, _)| it.0[nth]).collect() };
        assert_eq!(of(1), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
        assert_eq!(of(0), [10.0, 20.0, 10.0, 20.0, 10.0, 20.0]);
        let third = &world.axes()[2];
        assert!(of(2).iter().all(|it| *it == (third.lo + third.hi) / 2.0));
    }
}
