//! First difference between a replay and its recording.

use super::saved_counterexample::SavedCounterexample;
use crate::run_dir::{KeptError, digests_of};
use crate::testbench::Episode;
use crate::trace::Schema;

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
    let columns = match placed(recorded.signals.clone(), episode.trace.schema()) {
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

/// Returns the recorded signals with their present columns.
///
/// Signals that later versions added are not compared.
fn placed(names: Vec<String>, now: &Schema) -> Result<Vec<(String, usize)>, String> {
    let placed = names.into_iter().map(|name| match now.position(&name) {
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
    fn a_signal_that_is_gone_is_told() {
        let kept = kept();
        let episode = replayed(&kept);
        let gone = recorded_as(&kept, &episode, &[("ego.mood", "ego.speed")]);
        let difference = first_difference(&gone, &episode).expect("compared");
        let told = difference.expect("a difference").to_string();
        assert_eq!(told, "`ego.mood` was recorded and is no signal any more");
    }
}
