//! What is exported and what is refused, and egos that nobody here wrote.

use std::sync::Arc;

use brakecheck::crashes::{ExportRefusal, Regressions, export};
use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::run_dir::Counterexample;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Replay, play};
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::export::openx;
use brakecheck_scene::testbench::film::{Film, film_beyond};

use super::openx::{all, regressions, way};
use super::xml::Node;

#[test]
fn equal_crashes_give_equal_bytes() {
    let exported = &all()[0];
    let alone = Regressions::load(&exported.kept.path).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let again = export(&alone, directory.path()).unwrap();
    let texts = &exported.texts;
    let texts = [&texts.road, &texts.replay, &texts.external];
    assert_eq!(again.files.len(), texts.len());
    for (file, text) in again.files.iter().zip(texts) {
        let written = std::fs::read_to_string(file).unwrap();
        assert!(written == *text, "{}", file.display());
    }
}

#[test]
fn grids_and_what_replays_otherwise_are_refused() {
    let grid = regressions().join("grid-hard-nominal-cells-0-0000.ron");
    let directory = tempfile::tempdir().unwrap();
    let refused = export(&Regressions::load(grid).unwrap(), directory.path()).unwrap();
    assert!(refused.files.is_empty());
    let told = refused.refused[0].to_string();
    assert!(
        told.contains("grid-hard-nominal-cells-0-0000.ron"),
        "{told}"
    );
    assert!(told.contains("the grid world `grid_hard`"), "{told}");
    let why = &refused.refused[0].why;
    assert!(matches!(why, ExportRefusal::Grid { .. }));
    // Kept by a program that saw another sample.
    let kept = &all()[0].kept;
    let changed = Counterexample {
        digests: kept.counterexample.digests.replacen('0', "1", 1),
        ..kept.counterexample.clone()
    };
    let file = directory.path().join("changed.ron");
    changed.save(&file, &all()[0].trace).unwrap();
    let refused = export(&Regressions::load(&file).unwrap(), directory.path()).unwrap();
    assert!(refused.files.is_empty());
    assert!(matches!(
        refused.refused[0].why,
        ExportRefusal::Differs { .. }
    ));
    let told = refused.refused[0].to_string();
    assert!(
        told.contains("differs from what was recorded, at sample"),
        "{told}"
    );
}

/// Keeps its speed, and nobody here wrote it.
struct Coasting;

impl Controller for Coasting {
    fn reset(&mut self, _seed: u64) {}

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        Ok(Command::default())
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        None
    }
}

#[test]
fn an_ego_that_nobody_here_wrote_coasts_beyond_its_last_command() {
    let world = Scenario::parse("acc.ron", include_str!("../../worlds/acc.ron")).unwrap();
    let coasting = || Box::new(Coasting) as Box<dyn Controller>;
    let world = world.with_ego("coasting", Arc::new(coasting));
    let start = Start(vec![15.0, 20.0, 10.0]);
    let mut ado = Constant(1);
    let episode = play(&mut world.bench(), &start, 0, &mut ado, Aftermath::Play);
    let contact_s = episode.contact.as_ref().expect("a crash").time_s;
    let kept = Counterexample::record(&world, "coasting", &Change::default(), "constant", &episode);
    assert!(kept.ego_commands.len() < world.world().clock().samples() - 1);
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("own.ron");
    kept.save(&file, &episode.trace).unwrap();
    let replayed = Regressions::load(&file).unwrap().replay_recorded().unwrap();
    let texts = openx(
        &replayed[0].scenario,
        &replayed[0].episode,
        "own",
        "coasting",
    )
    .unwrap();
    let replay = way(&Node::read(&texts.replay), "ego");
    assert!((replay.last().unwrap()[0] - contact_s - 2.0).abs() < 1e-9);
    let external = way(&Node::read(&texts.external), "ado");
    assert!((external.last().unwrap()[0] - 15.0).abs() < 1e-9);
}

#[test]
fn a_replay_goes_on_after_the_contact_for_the_time_of_its_world() {
    let text = include_str!("../../worlds/acc.ron");
    let playing = |after_s: f64| {
        text.replace(
            "plant: Rigid,",
            &format!("plant: Rigid, after_contact_s: {after_s:?},"),
        )
    };
    let actions: Vec<usize> = [vec![0; 8], vec![2; 3], vec![0; 10]].concat();
    let start = Start(vec![12.21, 9.57, 17.9]);
    let exported = [playing(0.0), playing(1.5)].map(|text| {
        let world = Scenario::parse("acc.ron", &text).unwrap();
        let mut ado = Replay::holding(&actions);
        let episode = play(&mut world.bench(), &start, 0, &mut ado, Aftermath::Play);
        let texts = openx(&world, &episode, "pile_up", "nominal").unwrap();
        let film = film_beyond(&mut world.bench(), &episode);
        (texts, episode, film)
    });
    let [(before, ..), (texts, episode, Film { after, .. })] = exported;
    let contact_s = episode.contact.as_ref().expect("a crash").time_s;
    let after = after.expect("played on");
    let (short, replay) = (Node::read(&before.replay), Node::read(&texts.replay));
    for (number, agent) in ["ego", "ado"].into_iter().enumerate() {
        let (recorded, whole) = (way(&short, agent), way(&replay, agent));
        assert_eq!(whole[..recorded.len()], recorded[..], "{agent}");
        assert_eq!(whole.len(), recorded.len() + 31, "{agent}");
        // The pose of the contact is held for a step of players.
        let (contact, held) = (recorded[recorded.len() - 1], whole[recorded.len()]);
        assert_eq!(held[1..], contact[1..], "{agent}");
        assert!((held[0] - contact[0] - 0.01).abs() < 1e-6, "{agent}");
        assert!((whole.last().unwrap()[0] - contact_s - 1.5).abs() < 1e-6);
        let ahead_m = replay
            .named("ScenarioObject", "name", agent)
            .one("Center")
            .number("x");
        for ([_, x_m, y_m, heading_rad], frame) in
            whole[recorded.len() + 1..].iter().zip(&after.frames)
        {
            // The middle of the box is the middle of the body.
            let [middle_x_m, middle_y_m, _] = frame.placements[number].centre_m;
            let off_x_m = x_m + ahead_m * heading_rad.cos() - middle_x_m;
            let off_y_m = y_m + ahead_m * heading_rad.sin() - middle_y_m;
            assert!(off_x_m.hypot(off_y_m) < 1e-9, "{agent}");
        }
        // No jump at the contact, and no standstill after it.
        let [.., [_, end_m, ..]] = whole[..] else {
            panic!("no vertices");
        };
        let contact_m = contact[1];
        assert!((whole[recorded.len() + 1][1] - contact_m).abs() < 2.0);
        assert!((end_m - contact_m).abs() > 1.0, "{agent}");
    }
    let stop = replay.one("StopTrigger").one("SimulationTimeCondition");
    assert!((stop.number("value") - contact_s - 1.5).abs() < 1e-6);
    let told = replay.named("Property", "name", "brakecheck.after_contact");
    assert!(told.text("value").starts_with("ego and ado collide at "));
    // The scenario for an ego of your own has no collisions.
    assert_eq!(before.external, texts.external);
}
