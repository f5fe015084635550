//! Trivial starts: played once per world, ego, plant and seed, and stored.

use std::path::Path;

use serde_json::json;

use super::ego_under_test::EgoUnderTest;
use super::episode_loop::EpisodeLoop;
use super::progress::Watch;
use crate::content_hash::{fingerprint, sha256};
use crate::run_dir::CachedResult;
use crate::scene::Start;
use crate::stats::{Outcomes, StartOutcome};
use crate::testbench::{Aftermath, Constant, NoisyStart};
use crate::world::Scenario;

/// Directory of the stored outcomes in a run or a campaign.
const DIR: &str = "trivial";

/// Starts of which some are known to be trivial, or not.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrivialStarts {
    /// True if the ego fails without an adversary, with all rules kept.
    ///
    /// `None`: not played, or the ego did not run. Starts beyond the list are not played.
    pub known: Vec<Option<bool>>,
    /// Number of episodes that were played.
    pub played: usize,
    /// Processor time of the episodes that were played, s.
    pub cpu_s: f64,
}

impl TrivialStarts {
    /// Plays every start that is not known with coasting ados. `None`: stopped.
    pub fn play(
        self,
        scenario: &Scenario,
        starts: &[(Start, u64)],
        watch: &Watch<'_>,
    ) -> Option<TrivialStarts> {
        watch.phase("playing starts without an adversary");
        // Placed ados whose rules are judged are adversaries, so they must idle as well.
        let idle = &scenario.with_idle_ados(|_| true);
        let neutral = idle.world().spaces().neutral;
        let all = EpisodeLoop::counted(watch, starts.len());
        let known = |index: usize| self.known.get(index).copied().flatten();
        let outcomes = all.run(
            starts,
            || None,
            |bench, start, turn| {
                if let Some(known) = known(turn.index) {
                    // The allowed share of faults refers to all episodes, known or not.
                    watch.faults.note(turn.index as u64, None);
                    return Some((Some(known), None));
                }
                // The first unknown start makes the bench, so a stored result costs
                // none.
                let bench = bench.get_or_insert_with(|| idle.bench());
                let (from, mut coasting) = (NoisyStart::from(start), Constant(neutral));
                let episode = watch.play(bench, from, turn.index, &mut coasting, Aftermath::Skip);
                let ran = episode.fault.is_none();
                let fails = ran.then(|| episode.verdict.is_success());
                Some((fails, Some(turn.cpu_s())))
            },
        );
        // A stop leaves gaps, and the list would be stored as if it were whole.
        if watch.stopped() {
            return None;
        }
        let (known, spent_s): (Vec<_>, Vec<_>) = outcomes.into_iter().flatten().unzip();
        Some(TrivialStarts {
            known,
            played: self.played + spent_s.iter().flatten().count(),
            cpu_s: self.cpu_s + spent_s.iter().flatten().sum::<f64>(),
        })
    }

    /// Reads the outcomes of an ego from a directory, or plays and stores them.
    ///
    /// The world of `ego` must be that of its file, with its change, on any plant. A file
    /// that cannot be read or written is noted and changes no result. `None`: stopped.
    pub fn stored(
        dir: Option<&Path>,
        ego: &EgoUnderTest,
        seed: u64,
        starts: &[(Start, u64)],
        watch: &Watch<'_>,
    ) -> Option<TrivialStarts> {
        let file = dir.and_then(|dir| file_of(dir, ego, seed, starts));
        let stored = match file.as_ref().map(CachedResult::read::<Outcomes>) {
            // Marks are by position, so those of another number of starts are worthless.
            Some(Ok(outcomes)) => outcomes.filter(|it| it.len() == starts.len()),
            Some(Err(error)) => {
                watch.note(&format!("{error}; its starts are played again"));
                None
            }
            None => None,
        };
        if let Some(outcomes) = stored {
            return TrivialStarts::of(&outcomes).play(ego.scenario(), starts, watch);
        }
        let played = TrivialStarts::default().play(ego.scenario(), starts, watch)?;
        if let Some(Err(error)) = file.map(|file| file.write(&played.outcomes())) {
            watch.note(&format!("{error}; trivial starts are not stored"));
        }
        Some(played)
    }

    fn of(outcomes: &Outcomes) -> TrivialStarts {
        let known = outcomes.iter().map(|outcome| match outcome {
            StartOutcome::Trivial => Some(true),
            StartOutcome::Unsolved => Some(false),
            // A start with a fault has no answer, so it is played again.
            _ => None,
        });
        TrivialStarts {
            known: known.collect(),
            ..TrivialStarts::default()
        }
    }

    fn outcomes(&self) -> Outcomes {
        let outcomes = self.known.iter().map(|known| match known {
            Some(true) => StartOutcome::Trivial,
            Some(false) => StartOutcome::Unsolved,
            None => StartOutcome::Invalid,
        });
        outcomes.collect()
    }
}

/// Returns the file of an ego's outcomes on some starts.
///
/// `None`: the controller is in no file or a program, and the next one may differ.
fn file_of(
    dir: &Path,
    ego: &EgoUnderTest,
    seed: u64,
    starts: &[(Start, u64)],
) -> Option<CachedResult> {
    let scenario = ego.scenario();
    if ego.is_own() || scenario.program().is_some() {
        return None;
    }
    let request = json!({
        "change": ego.change(),
        "plant": scenario.plant(),
        "seed": seed,
        // A digest, because the list may be long and is only compared.
        "starts": fingerprint(&json!(starts)),
    });
    let name = fingerprint(&json!([sha256(scenario.text().as_bytes()), request]));
    // A part of the digest keeps the path short, and the file states the whole request.
    Some(CachedResult::new(
        &dir.join(DIR),
        &name[..16],
        scenario,
        request,
    ))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;
    use std::sync::Mutex;

    use super::*;
    use crate::experiment::{Remark, on_plant, untried_starts};
    use crate::sim::PlantKind;

    const WORLD: &str = include_str!("../../../../worlds/acc.ron");
    const COUNT: usize = 4;

    fn world(text: &str) -> Scenario {
        Scenario::parse("acc.ron", text).expect("a world")
    }

    fn nominal() -> EgoUnderTest {
        EgoUnderTest::nominal(&world(WORLD))
    }

    /// Outcomes, with the number of episodes that were played and the notes.
    fn stored(dir: &Path, ego: &EgoUnderTest, seed: u64) -> (Vec<Option<bool>>, usize, String) {
        let notes = Mutex::new(String::new());
        let remarks = |remark: Remark<'_>| {
            if let Remark::Line(line) = remark {
                notes.lock().expect("unpoisoned").push_str(line);
            }
        };
        let watch = Watch {
            remarks: &remarks,
            ..Watch::unwatched()
        };
        // All questions are about the same starts, so that only their keys differ.
        let starts = untried_starts(&world(WORLD), 7, COUNT).starts;
        let found =
            TrivialStarts::stored(Some(dir), ego, seed, &starts, &watch).expect("not stopped");
        let notes = notes.lock().expect("unpoisoned").clone();
        (found.known, found.played, notes)
    }

    fn only_file(dir: &Path) -> PathBuf {
        let files: Vec<PathBuf> = fs::read_dir(dir.join(DIR))
            .expect("a directory")
            .flatten()
            .map(|file| file.path())
            .collect();
        assert_eq!(files.len(), 1, "{files:?}");
        files[0].clone()
    }

    #[test]
    fn starts_are_played_once_per_world_ego_plant_and_seed() {
        let dir = tempfile::tempdir().expect("scratch");
        let kinematic = on_plant(&world(WORLD), PlantKind::Kinematic).expect("driven");
        let changed = WORLD.replace("kp_per_s2: 0.3,", "kp_per_s2: 0.31,");
        let wet = EgoUnderTest::find(&world(WORLD), "wet road").expect("an ego");
        for (name, ego, seed) in [
            ("nominal", nominal(), 7),
            ("plant", EgoUnderTest::nominal(&kinematic), 7),
            ("world", EgoUnderTest::nominal(&world(&changed)), 7),
            ("ego", wet[0].clone(), 7),
            ("seed", nominal(), 8),
        ] {
            let (found, played, _) = stored(dir.path(), &ego, seed);
            assert_eq!(played, COUNT, "{name}");
            assert!(found.iter().all(Option::is_some), "{name}");
            let again = stored(dir.path(), &ego, seed);
            assert_eq!(again, (found, 0, String::new()), "{name}");
        }
    }

    #[test]
    fn a_flipped_bit_is_noticed_and_the_starts_are_played_again() {
        let dir = tempfile::tempdir().expect("scratch");
        let (want, ..) = stored(dir.path(), &nominal(), 7);
        let file = only_file(dir.path());
        let whole = fs::read(&file).expect("a file");
        for at in (0..whole.len()).step_by(23).chain([whole.len() - 1]) {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            fs::write(&file, &bytes).expect("flipped");
            let (found, played, notes) = stored(dir.path(), &nominal(), 7);
            assert_eq!((&found, played), (&want, COUNT), "byte {at}");
            // A file about another question is replaced without a note.
            let text = String::from_utf8_lossy(&bytes);
            let is_other = text.find("\"made\"").is_some_and(|made| at < made);
            assert!(
                is_other || notes.contains("played again"),
                "byte {at}: {notes}"
            );
            assert_eq!(fs::read(&file).expect("a file"), whole, "byte {at}");
        }
    }

    #[test]
    fn starts_are_played_where_nothing_can_be_stored() {
        let dir = tempfile::tempdir().expect("scratch");
        fs::write(dir.path().join(DIR), "no directory").expect("written");
        for _ in 0..2 {
            let (found, played, notes) = stored(dir.path(), &nominal(), 7);
            assert_eq!((found.len(), played), (COUNT, COUNT));
            assert!(notes.contains("are not stored"), "{notes}");
        }
    }

    #[test]
    fn only_unknown_starts_are_played() {
        let world = world(WORLD);
        let starts = untried_starts(&world, 7, COUNT).starts;
        let mut known = vec![Some(true); COUNT];
        known[2] = None;
        let some = TrivialStarts {
            known,
            ..TrivialStarts::default()
        };
        let watch = Watch::unwatched();
        let played = some.play(&world, &starts, &watch).expect("not stopped");
        let all = TrivialStarts::default().play(&world, &starts, &watch);
        let want = [
            Some(true),
            Some(true),
            all.expect("not stopped").known[2],
            Some(true),
        ];
        assert_eq!((&played.known[..], played.played), (&want[..], 1));
    }
}
