//! First difference between a replay and its recording.

use super::saved_counterexample::SavedCounterexample;
use crate::run_dir::{KeptError, digests_of};
use crate::scene::drive::current_name;
use crate::testbench::Episode;
use crate::trace::{Schema, Trace};

/// First difference between a replay and its recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Number of the first sample that differs, where 0 is the start.
    pub sample: usize,
    /// Time of that sample, s.
    pub time_s: f64,
    /// Signal with both values, if the samples are stored beside the file.
    pub signal: Option<(String, f64, f64)>,
    /// Recorded signal that is not published any more.
    pub unpublished: Option<String>,
}

impl Difference {
    /// Describes the time and the cause of the difference.
    pub fn since(&self) -> String {
        let time_s = self.time_s;
        format!("different from the recorded run from t = {time_s:.2} s: {self}")
    }
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(name) = &self.unpublished {
            return write!(f, "`{name}` was recorded and is no signal any more");
        }
        write!(f, "sample {}", self.sample)?;
        match &self.signal {
            Some((name, recorded, replayed)) => {
                write!(f, ", `{name}`: recorded {recorded}, replayed {replayed}")
            }
            None => Ok(()),
        }
    }
}

/// Returns the first difference between an episode and its recording.
///
/// # Errors
/// Returns an error if the samples beside the file are damaged.
pub(super) fn first_difference(
    kept: &SavedCounterexample,
    episode: &Episode,
) -> Result<Option<Difference>, KeptError> {
    let recorded = &kept.counterexample;
    // Damage is detected in any case, while the numbers are read only where needed.
    recorded.samples_text(&kept.path)?;
    let names = if recorded.signals.is_empty() {
        names_of_old(recorded.samples(&kept.path)?, episode.trace.schema())
    } else {
        recorded.signals.clone()
    };
    let columns = match placed(names, episode.trace.schema()) {
        Ok(columns) => columns,
        Err(unpublished) => {
            return Ok(Some(Difference {
                // A missing signal cannot be compared at any sample, so the start is reported.
                sample: 0,
                time_s: 0.0,
                signal: None,
                unpublished: Some(unpublished),
            }));
        }
    };
    let positions: Vec<usize> = columns.iter().map(|(_, position)| *position).collect();
    let now = digests_of(&episode.trace, &positions);
    if now == recorded.digests {
        return Ok(None);
    }
    // A digest has 8 characters per sample, so the first unequal chunk is the sample.
    let digests = recorded.digests.as_bytes().chunks(8);
    let pairs = now.as_bytes().chunks(8).zip(digests);
    let same = pairs.take_while(|(a, b)| a == b).count();
    let signal = recorded.samples(&kept.path)?.and_then(|stored| {
        columns.into_iter().find_map(|(name, position)| {
            let was = *stored.signal(&name)?.get(same)?;
            let is = *episode.trace.column(position).get(same)?;
            // Bits are compared, because a replay must be exact and NaN never equals itself.
            (was.to_bits() != is.to_bits()).then_some((name, was, is))
        })
    });
    Ok(Some(Difference {
        sample: same,
        // Time is i · dt. Rounding removes errors of binary fractions.
        time_s: (same as f64 * episode.trace.dt_s() * 1e9).round() / 1e9,
        signal,
        unpublished: None,
    }))
}

/// Returns the signals of an old file that does not list them.
///
/// They are the signals of its samples, or all present signals without samples.
fn names_of_old(stored: Option<Trace>, now: &Schema) -> Vec<String> {
    let owned = |schema: &Schema| -> Vec<String> {
        let signals = schema.signals().iter();
        signals.map(|signal| signal.name.clone()).collect()
    };
    match stored {
        // The first column is the time of the sample.
        Some(stored) => owned(stored.schema()).split_off(1),
        None => owned(now),
    }
}

/// Returns the recorded signals with their present columns.
///
/// Signals that later versions added are not compared. Former names are resolved.
fn placed(names: Vec<String>, now: &Schema) -> Result<Vec<(String, usize)>, String> {
    let position = |name: &str| {
        let current = || now.position(&current_name(name)?);
        // A present name takes precedence over a former name.
        now.position(name).or_else(current)
    };
    let placed = names.into_iter().map(|name| match position(&name) {
        Some(position) => Ok((name, position)),
        None => Err(name),
    });
    placed.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crashes::replay::Regressions;
    use crate::run_dir::Counterexample;

    fn kept() -> SavedCounterexample {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/regressions/acc-nominal-0001.ron"
        );
        let all = Regressions::load(file).expect("a kept counterexample");
        all.kept()[0].clone()
    }

    fn replayed(kept: &SavedCounterexample) -> Episode {
        let scenario = kept.counterexample.scenario(&kept.path).expect("a world");
        let replayed = super::super::replay(kept, scenario).expect("replayed");
        replayed.episode
    }

    /// Counterexample as an earlier version would have recorded `names`.
    fn recorded_as(
        kept: &SavedCounterexample,
        episode: &Episode,
        names: &[(&str, &str)],
    ) -> SavedCounterexample {
        let schema = episode.trace.schema();
        let columns = names.iter().map(|(_, now)| schema.position(now));
        let columns: Vec<usize> = columns.map(|column| column.expect("published")).collect();
        let counterexample = Counterexample {
            signals: names.iter().map(|(then, _)| (*then).to_owned()).collect(),
            digests: digests_of(&episode.trace, &columns),
            ..kept.counterexample.clone()
        };
        SavedCounterexample {
            counterexample,
            ..kept.clone()
        }
    }

    #[test]
    fn what_later_versions_publish_besides_is_not_compared() {
        let kept = kept();
        let episode = replayed(&kept);
        let fewer = [("ego.speed", "ego.speed"), ("headway", "headway")];
        let old = recorded_as(&kept, &episode, &fewer);
        assert_eq!(first_difference(&old, &episode).expect("compared"), None);
    }

    #[test]
    fn a_signal_with_a_former_name_is_found_and_one_that_is_gone_is_told() {
        let kept = kept();
        let episode = replayed(&kept);
        let old = recorded_as(&kept, &episode, &[("ego.velocity", "ego.speed")]);
        assert_eq!(first_difference(&old, &episode).expect("compared"), None);
        let gone = recorded_as(&kept, &episode, &[("ego.mood", "ego.speed")]);
        let difference = first_difference(&gone, &episode).expect("compared");
        let told = difference.expect("a difference").to_string();
        assert_eq!(told, "`ego.mood` was recorded and is no signal any more");
    }

    #[test]
    fn a_formula_may_say_a_former_name() {
        let world = include_str!("../../../worlds/acc.ron");
        let said = world.replace(
            "always[0, T] (ado.speed <= v_lim)",
            "always[0, T] (ado.velocity <= v_lim)",
        );
        assert_ne!(world, said);
        let world = crate::world::Scenario::parse("acc.ron", &said);
        let world = world.unwrap_or_else(|error| panic!("{error}"));
        let schema = world.world().schema().clone();
        assert!(schema.position("ado.velocity").is_some());
    }
}
