//! Driven episodes: equal inputs give equal bits, back and on, kept and replayed.

use brakecheck_crashes::crashes::{Regressions, ReplayOutcome};
use brakecheck_drive::drive::{AdoPlayer, DriveError, DriveInput, DrivenEpisode, Sandbox, Setup};
use brakecheck_world::world::{DriveScenario, Scenario};

fn sandbox(world: &str, seat: &str) -> Sandbox {
    let world = Scenario::shipped(world).expect("shipped").expect("sound");
    Sandbox::new(world, seat).expect("a driving world")
}

/// A test start with ados that do nothing, so that your keys alone decide.
fn first(sandbox: &Sandbox, index: usize) -> Setup {
    Setup {
        ado: AdoPlayer::Neutral,
        ..sandbox.first_setup(0, index).expect("a start")
    }
}

/// Gas for two seconds, then nothing.
fn input(sample: usize) -> DriveInput {
    DriveInput {
        accel_mps2: if sample < 20 { 3.0 } else { 0.0 },
        lateral_mps: 0.0,
        action: Some(sample / 10 % 2),
    }
}

fn drive(episode: &mut DrivenEpisode) {
    while !episode.is_done() {
        episode.advance(input(episode.inputs().len()));
    }
}

fn driven(sandbox: &Sandbox, setup: &Setup) -> DrivenEpisode {
    let mut episode = DrivenEpisode::begin(sandbox, setup).expect("it begins");
    drive(&mut episode);
    episode
}

/// An episode in which you drive into the ado, from the first such test start.
fn crash(sandbox: &Sandbox) -> DrivenEpisode {
    let starts = (0..50).map(|index| first(sandbox, index));
    let mut driven = starts.map(|setup| driven(sandbox, &setup));
    let crash = driven.find(|it| it.episode().verdict.is_success());
    crash.expect("who only accelerates fails")
}

#[test]
fn the_keys_move_the_ego_and_equal_inputs_give_equal_bits() {
    let sandbox = sandbox("acc", "ego");
    let setup = first(&sandbox, 0);
    let with_gas = driven(&sandbox, &setup);
    assert_eq!(with_gas.frames(), driven(&sandbox, &setup).frames());
    let mut without = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    (0..10).for_each(|_| {
        without.advance(DriveInput::default());
    });
    let ego = with_gas
        .stage()
        .agents
        .iter()
        .position(|it| it.name == "ego");
    let speed = |episode: &DrivenEpisode| {
        episode.frames()[10].shown.speeds_mps[ego.expect("an ego")].expect("a speed")
    };
    assert!(
        speed(&with_gas) > speed(&without) + 0.5,
        "gas makes it faster"
    );
}

#[test]
fn the_way_back_is_the_same_episode_up_to_there() {
    let mut sandbox = sandbox("acc", "ego");
    let mut setup = first(&sandbox, 0);
    // A random player must go on from the moment as if nothing had been played after it.
    setup.ado = AdoPlayer::Random;
    for seat in ["ego", "ado"] {
        sandbox = Sandbox::new(sandbox.world().clone(), seat).expect("a seat");
        setup.ego = sandbox.egos()[0].clone();
        let straight = driven(&sandbox, &setup);
        let last = straight.frames().len() - 1;
        for sample in [0, 1, 7, last / 2, last] {
            let mut back = driven(&sandbox, &setup);
            back.back_to(sample).expect("it was played");
            assert_eq!(
                back.frames(),
                &straight.frames()[..=sample],
                "back to {sample}"
            );
            drive(&mut back);
            assert_eq!(back.frames(), straight.frames(), "on from {sample}");
        }
        let mut other = driven(&sandbox, &setup);
        assert!(matches!(
            other.back_to(last + 1),
            Err(DriveError::NotPlayed { .. })
        ));
        // What was played stays as it was.
        assert_eq!(other.frames(), straight.frames());
    }
}

#[test]
fn a_kept_drive_replays_bit_for_bit() {
    let sandbox = sandbox("acc", "ego");
    let crash = crash(&sandbox);
    let dir = tempfile::tempdir().expect("a directory");
    let file = crash.keep(dir.path()).expect("a counterexample");
    let replayed = Regressions::load(&file).expect("kept").replay_recorded();
    let replayed = replayed.expect("it plays");
    assert_eq!(replayed.len(), 1);
    assert!(replayed[0].is_reproduced() && replayed[0].identical);
    assert_eq!(replayed[0].outcome(), ReplayOutcome::StillFails);
    assert_eq!(replayed[0].episode.trace, crash.episode().trace);
    // The page's last margin is that of the library on the same samples.
    let frame = crash.frames().last().expect("a frame");
    assert_eq!(
        frame.outcome.as_ref().map(|it| it.verdict),
        Some("counterexample")
    );
    // A second drive from the same start has a file of its own.
    let mut other = DrivenEpisode::begin(&sandbox, crash.setup()).expect("it begins");
    while !other.is_done() {
        other.advance(DriveInput {
            accel_mps2: 2.5,
            ..DriveInput::default()
        });
    }
    if other.episode().verdict.is_success() {
        assert_ne!(other.keep(dir.path()).expect("a counterexample"), file);
    }
}

#[test]
fn margins_are_those_of_the_library() {
    let sandbox = sandbox("acc", "ego");
    let setup = first(&sandbox, 0);
    let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    (0..25).for_each(|at| {
        episode.advance(input(at));
    });
    let rulebook = sandbox.world().rulebook();
    let mut scratch = Default::default();
    let trace = episode.episode().trace;
    let frame = episode.frames().last().expect("a frame");
    assert_eq!(
        frame.spec,
        Some(rulebook.spec.robustness(&trace, &mut scratch))
    );
    for (shown, rule) in frame.rules.iter().zip(&rulebook.rules) {
        let margin = rule.monitor.robustness(&trace, &mut scratch);
        assert_eq!(
            *shown,
            margin.is_finite().then_some(margin),
            "{}",
            rule.name
        );
    }
}

#[test]
fn an_ado_in_your_seat_does_as_you_say() {
    let sandbox = sandbox("acc", "ado");
    let setup = first(&sandbox, 0);
    assert_eq!(setup.ego, "nominal");
    let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    let labels = sandbox.action_labels()[0].clone();
    for (action, label) in labels.iter().enumerate() {
        let mut one = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
        one.advance(DriveInput {
            action: Some(action),
            ..DriveInput::default()
        });
        assert_eq!(one.frames()[1].action.as_deref(), Some(&**label));
    }
    // An action that the ado does not have, and none, are its neutral one.
    episode.advance(DriveInput {
        action: Some(9_999),
        ..DriveInput::default()
    });
    let neutral = sandbox.world().spaces().neutral;
    assert_eq!(episode.episode().actions, [neutral]);
}

#[test]
fn a_search_finds_a_sequence_for_the_ado() {
    let sandbox = sandbox("acc", "ego");
    let mut setup = sandbox.first_setup(0, 0).expect("a start");
    setup.ego = "nominal".to_owned();
    setup.ado = AdoPlayer::Search;
    let mut found = 0;
    for index in 0..5 {
        setup.start = first(&sandbox, index).start;
        let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
        let is_found = episode.search_found().expect("it was searched");
        while episode.advance(DriveInput::default()).is_some() {}
        assert!(
            !is_found || episode.episode().verdict.is_success(),
            "start {index}"
        );
        found += usize::from(is_found);
    }
    assert!(found > 0, "the search succeeds from some of five starts");
}

#[test]
fn a_start_without_a_sequence_can_be_driven_with_neutral_ados() {
    // Its yellow is long enough for every start.
    let sandbox = sandbox("yellow_light_fixed", "ego");
    let setup = sandbox.first_setup(0, 0).expect("a start");
    assert_eq!(setup.ado, AdoPlayer::Search);
    let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    assert_eq!(episode.search_found(), Some(false));
    drive(&mut episode);
    let neutral = sandbox.world().spaces().neutral;
    let actions = episode.episode().actions;
    assert!(!actions.is_empty() && actions.iter().all(|action| *action == neutral));
    // Nothing was searched where another player was chosen.
    let setup = first(&sandbox, 0);
    let episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    assert_eq!(episode.search_found(), None);
}

#[test]
fn a_world_shows_a_failure_out_of_the_box_with_its_cause() {
    let sandbox = sandbox("merge_fair", "ego");
    let setup = sandbox.first_setup(0, 0).expect("a start");
    assert_eq!((setup.ego.as_str(), setup.ado), ("you", AdoPlayer::Search));
    let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
    assert_eq!(episode.search_found(), Some(true));
    assert!(episode.why().is_none(), "nothing has failed yet");
    while episode.advance(DriveInput::default()).is_some() {}
    assert!(episode.episode().verdict.is_success());
    let why = episode.why().expect("a failure").to_string();
    assert!(why.contains("is violated at"), "{why}");
    assert!(why.contains("full braking"), "{why}");
    // Your own ado obeys you alone.
    let own = Sandbox::new(sandbox.world().clone(), "ado").expect("a seat");
    let setup = own.first_setup(0, 0).expect("a start");
    assert_eq!(setup.ado, AdoPlayer::Neutral);
}

#[test]
fn what_cannot_be_driven_is_refused_by_name() {
    let grid = Scenario::shipped_names()
        .filter_map(|name| Scenario::shipped(name)?.ok())
        .find(|world| world.drive().is_none());
    let grid = Sandbox::new(grid.expect("a shipped grid"), "ego");
    assert!(matches!(grid.err(), Some(DriveError::Grid { .. })));
    let world = Scenario::shipped("acc").expect("shipped").expect("sound");
    let seat = Sandbox::new(world, "nobody").err().expect("no such ado");
    assert_eq!(seat.to_string(), "`nobody` is no seat of this world");
    assert_eq!(
        seat.help().as_deref(),
        Some("take `--as ego`, or one of: ado")
    );
    let sandbox = sandbox("acc", "ego");
    let begin = |change: &dyn Fn(&mut Setup)| {
        let mut setup = first(&sandbox, 0);
        change(&mut setup);
        DrivenEpisode::begin(&sandbox, &setup)
            .err()
            .expect("refused")
            .to_string()
    };
    assert!(begin(&|it| it.ado = AdoPlayer::Trained).contains("no trained ado"));
    assert!(begin(&|it| it.start.clear()).contains("0 values for"));
    assert!(begin(&|it| it.start[0] = 1e9).contains("is outside of"));
    assert!(begin(&|it| it.start[0] = f64::NAN).contains("is outside of"));
    // No file of the disk can be named from a page.
    assert!(begin(&|it| it.ego = "/etc/passwd.ron".to_owned()).contains("is no ego"));
    assert!(begin(&|it| it.ego = "all".to_owned()).contains("is no ego"));
    let parameter = |it: &mut Setup| {
        it.ego = "nominal".to_owned();
        it.ego_values.insert("no_such".to_owned(), 1.0);
    };
    assert!(begin(&parameter).contains("no_such"));
}

#[test]
fn straight_roads_are_drawn_as_far_as_you_drive() {
    let mut straight = 0;
    for name in Scenario::shipped_names() {
        let world = Scenario::shipped(name).expect("shipped").expect("sound");
        // An ado lays its road piece by piece.
        let is_laid = |it: DriveScenario<'_>| it.spec().road_ado.is_some();
        if world.drive().is_none_or(is_laid) {
            continue;
        }
        let sandbox = Sandbox::new(world, "ego").expect("a driving world");
        for index in 0..3 {
            let setup = first(&sandbox, index);
            let mut episode = DrivenEpisode::begin(&sandbox, &setup).expect("it begins");
            let stage = episode.stage();
            let border = &stage.lane_borders_m[0];
            if border.iter().any(|point| point[1] != border[0][1]) {
                continue;
            }
            straight += 1;
            let reach = border[0][0]..border[border.len() - 1][0];
            let ego = stage.agents.iter().position(|it| it.name == "ego");
            while episode
                .advance(DriveInput {
                    accel_mps2: 9.0,
                    ..DriveInput::default()
                })
                .is_some()
            {}
            for frame in episode.frames() {
                let [x_m, ..] = frame.shown.frame.placements[ego.expect("an ego")].centre_m;
                assert!(
                    reach.contains(&x_m),
                    "{name}, start {index}: {x_m} m of {reach:?}"
                );
            }
        }
    }
    assert!(straight > 30, "{straight}");
}

#[test]
fn the_page_gets_which_bodies_the_ego_sees() {
    let text = include_str!("../../../worlds/acc.ron");
    let near = text.replacen(
        "plant: Rigid,",
        "plant: Rigid, sensors: (range_m: 15.0),",
        1,
    );
    let near = Scenario::parse("near.ron", &near).expect("sound");
    let near = Sandbox::new(near, "ego").expect("a driving world");
    let mut counts = [0, 0];
    for index in 0..20 {
        let setup = first(&near, index);
        let episode = DrivenEpisode::begin(&near, &setup).expect("it begins");
        let frame = serde_json::to_value(&episode.frames()[0]).expect("JSON");
        let agents = &episode.stage().agents;
        let [ego, ado] = ["ego", "ado"].map(|name| {
            let mut names = agents.iter().map(|it| it.name.as_str());
            names.position(|it| it == name).expect("in the cast")
        });
        let x_m = |who: usize| frame["placements"][who][0].as_f64().expect("a number");
        let gap_m = x_m(ado) - x_m(ego) - agents[ado].size_m[0];
        assert_eq!(frame["seen"][ado], gap_m <= 15.0, "{gap_m} m");
        assert_eq!(frame["seen"][ego], true);
        counts[usize::from(gap_m <= 15.0)] += 1;
    }
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
    // Nothing can hide a body from perfect sensors.
    let perfect = sandbox("acc", "ego");
    let setup = first(&perfect, 0);
    let episode = DrivenEpisode::begin(&perfect, &setup).expect("it begins");
    let frame = serde_json::to_value(&episode.frames()[0]).expect("JSON");
    assert!(frame.get("seen").is_none());
}
