//! First difference between a replay and its recording.

use std::path::Path;

use crate::run_dir::{Counterexample, KeptError, digests_of, motion_after_contact};
use crate::testbench::Episode;
use crate::trace::Schema;
use crate::world::Scenario;

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

/// Returns the first difference between an episode of a world and its recording.
///
/// It compares all samples, then the motion after the contact. `path` is that of the file.
///
/// # Errors
/// Returns an error if the samples beside the file are damaged.
pub(super) fn first_difference(
    recorded: &Counterexample,
    path: &Path,
    scenario: &Scenario,
    episode: &Episode,
) -> Result<Option<Difference>, KeptError> {
    // Damage is detected in any case, while the numbers are read only where needed.
    recorded.samples_text(path)?;
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
    // The file itself has the digests, while the samples beside it may be missing.
    let now = digests_of(&episode.trace, &positions);
    if now == recorded.digests {
        return Ok(difference_after_contact(recorded, scenario, episode));
    }
    // A digest has 8 characters per sample, so the first unequal chunk is the sample.
    let digests = recorded.digests.as_bytes().chunks(8);
    let pairs = now.as_bytes().chunks(8).zip(digests);
    let same = pairs.take_while(|(a, b)| a == b).count();
    let signal = recorded.samples(path)?.and_then(|stored| {
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

/// Returns the first difference of the motion after the contact, if the file has it.
fn difference_after_contact(
    recorded: &Counterexample,
    scenario: &Scenario,
    episode: &Episode,
) -> Option<Difference> {
    let then = &recorded.motion_after_contact;
    // Older files and worlds that end at the contact have no such motion.
    if then.is_empty() {
        return None;
    }
    let now = motion_after_contact(scenario, episode).unwrap_or_default();
    if now == *then {
        return None;
    }
    let rows = then.lines().zip(now.lines());
    let same = rows.take_while(|(then, now)| then == now).count();
    let numbers = |text: &str| -> Vec<f64> {
        let row = text.lines().nth(same).unwrap_or_default().split(',');
        // A cell without a number must not equal a number, and its bits then differ.
        row.map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
    };
    let columns = then.lines().next().unwrap_or_default().split(',');
    let pairs = numbers(then).into_iter().zip(numbers(&now));
    let mut cells = columns.zip(pairs);
    let differing = cells.find(|(_, (was, is))| was.to_bits() != is.to_bits());
    let after_s = numbers(then).first().copied().unwrap_or(0.0);
    let contact_s = episode
        .contact
        .as_ref()
        .map_or(0.0, |contact| contact.time_s);
    Some(Difference {
        // The table begins with a head, so its rows count from 1.
        sample: episode.trace.len() + same.saturating_sub(1),
        time_s: contact_s + after_s,
        signal: differing.map(|(name, (was, is))| (format!("{name} after the contact"), was, is)),
        unpublished: None,
    })
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
    use crate::crashes::replay::replay;
    use crate::crashes::{Regressions, SavedCounterexample};

    fn kept() -> SavedCounterexample {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/regressions/acc-nominal-0001.ron"
        );
        let all = Regressions::load(file).expect("a kept counterexample");
        all.kept()[0].clone()
    }

    fn world(kept: &SavedCounterexample) -> Scenario {
        kept.counterexample.scenario(&kept.path).expect("a world")
    }

    fn replayed(kept: &SavedCounterexample) -> Episode {
        let replayed = replay(kept, world(kept)).expect("replayed");
        replayed.episode
    }

    /// Counterexample as an earlier version would have recorded `names`.
    fn recorded_as(
        kept: &SavedCounterexample,
        episode: &Episode,
        names: &[(&str, &str)],
    ) -> SavedCounterexample {
        let schema = episode.trace.schema();
        let columns: Vec<usize> = names
            .iter()
            .map(|(_, now)| schema.position(now))
            .map(|column| column.expect("published"))
            .collect();
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
        let difference = first_difference(&old.counterexample, &old.path, &world(&kept), &episode);
        assert_eq!(difference.expect("compared"), None);
    }

    #[test]
    fn a_difference_after_the_contact_has_its_agent_and_both_values() {
        let mut kept = kept();
        let episode = replayed(&kept);
        let now = motion_after_contact(&world(&kept), &episode).expect("a contact");
        assert_eq!(now.lines().count(), 41, "a head and 2 s of samples");
        kept.counterexample.motion_after_contact = now.clone();
        let compared = |kept: &SavedCounterexample| {
            let recorded = &kept.counterexample;
            first_difference(recorded, &kept.path, &world(kept), &episode).expect("compared")
        };
        assert_eq!(compared(&kept), None);
        let mut rows: Vec<String> = now.lines().map(str::to_owned).collect();
        let (time, rest) = rows[2].split_once(',').expect("columns");
        let (_, rest) = rest.split_once(',').expect("columns");
        rows[2] = format!("{time},7.5,{rest}");
        kept.counterexample.motion_after_contact = rows.join("\n");
        let difference = compared(&kept).expect("a difference");
        let (name, was, is) = difference.signal.expect("a column");
        assert_eq!((name.as_str(), was), ("ego.x after the contact", 7.5));
        assert!(is > 200.0, "{is}");
        let contact_s = episode.contact.expect("a contact").time_s;
        assert!((difference.time_s - contact_s - 0.1).abs() < 1e-9);
    }

    #[test]
    fn a_signal_that_is_gone_is_told() {
        let kept = kept();
        let episode = replayed(&kept);
        let gone = recorded_as(&kept, &episode, &[("ego.mood", "ego.speed")]);
        let compared = first_difference(&gone.counterexample, &gone.path, &world(&kept), &episode);
        let difference = compared.expect("compared");
        let told = difference.expect("a difference").to_string();
        assert_eq!(told, "`ego.mood` was recorded and is no signal any more");
    }
}
