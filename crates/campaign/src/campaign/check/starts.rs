//! Starts of a campaign. A grid must lie within the ranges of every world.

use super::Checker;
use crate::campaign::error::CampaignError;
use crate::campaign::file::{RequestedStarts, StartsEntry};
use crate::ron_file::{ValuePath, guessed};
use crate::world::Scenario;

/// Largest number of starts of a unit.
const MAX_STARTS: usize = 1_000_000_000;
/// Most values along an axis of a grid: the plan lists them.
const MAX_VALUES: usize = 100_000;

impl Checker {
    pub(super) fn starts(
        &self,
        at: &ValuePath,
        entry: &StartsEntry,
    ) -> Result<RequestedStarts, CampaignError> {
        let (axes, seed) = match *entry {
            StartsEntry::Drawn { count, seed } if (1..=MAX_STARTS).contains(&count) => {
                return Ok(RequestedStarts::Drawn { count, seed });
            }
            StartsEntry::Drawn { count, .. } => {
                let what = format!("{count} starts: there are 1 to {MAX_STARTS}");
                return Err(self.source.wrong(&at.to("count"), what, None));
            }
            StartsEntry::Grid { ref axes, seed } => (axes, seed),
        };
        let mut values = Vec::new();
        for (name, &(lo, hi, steps)) in &axes.0 {
            let place = at.to("axes").to(name);
            // The grid is shared by all worlds, so each of them must contain it.
            for (world, _) in &self.worlds {
                self.axis(&place, world, name, lo, hi)?;
            }
            // A single value needs no range, but several values must differ.
            let sane = (1..=MAX_VALUES).contains(&steps) && (lo < hi || (lo == hi && steps == 1));
            if !sane {
                let what = format!("{steps} values from {lo} to {hi} are no axis");
                let help = if steps > MAX_VALUES {
                    format!("at most {MAX_VALUES} values are possible along an axis")
                } else {
                    "write `(least, greatest, how many)`".to_owned()
                };
                return Err(self.source.wrong(&place, what, Some(help)));
            }
            // A single value would divide by zero.
            let last = (steps - 1).max(1) as f64;
            // Rounding removes errors of binary fractions, because rows hold the values.
            let value = |nth: usize| {
                let value = lo + (hi - lo) * nth as f64 / last;
                (value * 1e9).round() / 1e9
            };
            values.push((name.clone(), (0..steps).map(value).collect::<Vec<f64>>()));
        }
        // The product is checked, because a few long axes can overflow it.
        let all = values
            .iter()
            .try_fold(1usize, |all, (_, along)| all.checked_mul(along.len()));
        match all.filter(|all| (1..=MAX_STARTS).contains(all)) {
            // Without an axis the product is 1, which would be a grid of a single middle
            // point.
            Some(_) if !values.is_empty() => Ok(RequestedStarts::Grid { axes: values, seed }),
            _ => {
                let what = format!("the grid has no axis, or more than {MAX_STARTS} points");
                Err(self.source.wrong(&at.to("axes"), what, None))
            }
        }
    }

    /// Checks that a world may start everywhere along an axis.
    fn axis(
        &self,
        place: &ValuePath,
        world: &Scenario,
        name: &str,
        lo: f64,
        hi: f64,
    ) -> Result<(), CampaignError> {
        let axes = world.axes();
        let Some(axis) = axes.iter().find(|axis| axis.name == name) else {
            let what = format!("`{}` has no start `{name}`", world.name());
            let known: Vec<&str> = axes.iter().map(|axis| axis.name.as_str()).collect();
            let help = format!(
                "{} (those that are ranges in the world)",
                guessed(name, "known", known)
            );
            return Err(self.source.wrong(place, what, Some(help)));
        };
        if axis.lo <= lo && hi <= axis.hi {
            Ok(())
        } else {
            let what = format!(
                "`{name}` ranges over {} to {} {} in `{}`",
                axis.lo,
                axis.hi,
                axis.unit,
                world.name()
            );
            let help = "stay within it, or widen it in the world".to_owned();
            Err(self.source.wrong(place, what, Some(help)))
        }
    }
}
