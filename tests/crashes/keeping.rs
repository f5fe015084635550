//! What is handed over as files, and what the files say.

use std::path::Path;

use brakecheck::crashes::{CrashSelection, Form, KeepSettings, KeptFiles, Regressions};
use brakecheck::experiment::Watch;
use brakecheck::testbench::{Episode, Testbench};
use brakecheck::world::Change;
use brakecheck_crashes::crashes::save_crashes::{CrashWriter, PERSISTENT, description};

use super::found::{cut_in, cut_in_found};

fn kept(dir: &Path, episodes: &[Episode], choice: CrashSelection, form: Form) -> KeptFiles {
    let keeper = CrashWriter {
        scenario: cut_in(),
        ego: "nominal",
        change: &Change::default(),
        ado: "search".into(),
        seed: 3,
        settings: KeepSettings::new(choice, form),
    };
    let again = |_: &mut Testbench, index: usize| episodes[index].clone();
    let all: Vec<usize> = (0..episodes.len()).collect();
    keeper
        .keep(&all, &again, dir, &Watch::unwatched())
        .expect("written")
}

#[test]
fn the_worst_that_differ_and_persist_are_handed_over() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut episodes = cut_in_found()[..6].to_vec();
    let count = episodes.len();
    // Each once more: as many clusters, twice as large.
    episodes.extend_from_within(..);
    let kept = kept(
        dir.path(),
        &episodes,
        CrashSelection::Worst(3),
        Form::Shrunk,
    );
    assert_eq!(kept.found, 2 * count);
    assert!(kept.distinct <= count && kept.files.len() <= 3);
    assert!(!kept.files.is_empty());
    for (file, about) in &kept.files {
        assert!(file.is_file());
        let cluster = about.cluster.expect("compared");
        assert!(cluster >= 2 && cluster.is_multiple_of(2), "{cluster}");
        let persistence = about.persistence.as_ref().expect("driven");
        assert!(persistence.share() >= PERSISTENT);
        assert!(about.shrunk.is_some() && about.why.is_some());
    }
    // The files say the same and replay bit for bit.
    let read = Regressions::load(dir.path()).expect("files");
    read.reproduce().unwrap_or_else(|error| panic!("{error}"));
    for one in read.kept() {
        let said = one.counterexample.about.as_ref().expect("labelled");
        let told = kept.files.iter().find(|(file, _)| *file == one.path);
        assert_eq!(said, &told.expect("told of").1);
    }
    // Worst first: contacts before others, and by risk among them.
    let risk = |nth: usize| {
        let severity = kept.files[nth].1.severity;
        severity.map(|it| it.injury_risk.map_or(0.0, |risk| risk.probability))
    };
    let found_risk = |nth: usize| risk(nth).is_some();
    assert!((1..kept.files.len()).all(|nth| found_risk(nth - 1) || !found_risk(nth)));
}

#[test]
fn all_are_kept_as_they_were_found_if_asked_for() {
    let dir = tempfile::tempdir().expect("a directory");
    let episodes = &cut_in_found()[..3];
    let kept = kept(dir.path(), episodes, CrashSelection::All, Form::AsFound);
    assert_eq!(kept.files.len(), episodes.len());
    let read = Regressions::load(dir.path()).expect("files");
    for one in read.kept() {
        let file = &one.counterexample;
        assert!(episodes.iter().any(|it| it.actions == file.actions));
        assert_eq!(file.about.as_ref().expect("labelled").shrunk, None);
    }
    read.reproduce().unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn files_of_an_earlier_version_are_labelled_and_stay_the_same_episode() {
    let dir = tempfile::tempdir().expect("a directory");
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/regressions");
    for name in ["cut_in-nominal-0000.ron", "cut_in-nominal-0000.csv"] {
        let from = Path::new(source).join(name);
        std::fs::copy(from, dir.path().join(name)).expect("copied");
    }
    let before = Regressions::load(dir.path()).expect("a file");
    assert_eq!(before.kept()[0].counterexample.about, None);
    let replayed = before.replay_recorded().expect("replayed");
    let (scenario, episode) = (&replayed[0].scenario, &replayed[0].episode);
    let said = before.kept()[0].refine(scenario, episode).expect("written");
    assert_eq!(said, description(scenario, episode));
    let after = Regressions::load(dir.path()).expect("a file");
    after.reproduce().unwrap_or_else(|error| panic!("{error}"));
    let (old, new) = (
        &before.kept()[0].counterexample,
        &after.kept()[0].counterexample,
    );
    assert_eq!(new.about.as_ref(), Some(&said));
    assert_eq!((&old.actions, &old.digests), (&new.actions, &new.digests));
    let severity = said.severity.expect("a contact");
    let impact = new.contact.as_ref().and_then(|touch| touch.impact);
    assert_eq!(impact, Some(severity.impact));
}
