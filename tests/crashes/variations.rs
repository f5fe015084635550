//! What is varied, and that it is.

use brakecheck::run_dir::{NoAnswer, Persistence, Variation};
use brakecheck::testbench::{Aftermath, Episode, Replay, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Sensors;
use brakecheck::world::{Change, Scenario};
use brakecheck_crashes::crashes::perturbation_robustness::persistence;

use super::found::{acc, acc_found};
use super::near;

const NAMES: [&str; 11] = [
    "the rigid plant",
    "half the sample time",
    "friction × 0.9",
    "friction × 1.1",
    "sensors one sample later",
    "ego.speed -0.1 m/s",
    "ego.speed +0.1 m/s",
    "ado.headway -0.1 m",
    "ado.headway +0.1 m",
    "ado.speed -0.1 m/s",
    "ado.speed +0.1 m/s",
];

/// `None`: an ado breaks a rule. After the recorded actions the ado coasts.
fn fails(world: &Scenario, of: &Episode, by: (usize, f64)) -> Option<bool> {
    let mut start = of.start.clone();
    start.0[by.0] += by.1;
    let mut ado = Replay::then(&of.actions, 1);
    let played = play(
        &mut world.bench(),
        &start,
        of.noise,
        &mut ado,
        Aftermath::Skip,
    );
    (!played.verdict.is_foul()).then(|| played.verdict.is_success())
}

/// A reminder of what each variation is, written once more.
#[test]
fn every_variation_is_what_its_name_says() {
    let world = acc();
    let changed = |change: Change| world.with(&change).expect("it fits");
    let friction = |friction: f64| {
        changed(Change {
            friction: Some(friction),
            ..Change::default()
        })
    };
    let later = changed(Change {
        sensors: Some(Sensors {
            delay_s: 0.05,
            ..Sensors::default()
        }),
        ..Change::default()
    });
    let text = include_str!("../../worlds/acc.ron").replace("sample_s: 0.05", "sample_s: 0.025");
    let halved = Scenario::parse("acc.ron", &text)
        .expect("a world")
        .on(PlantKind::Kinematic);
    let worlds = [
        world.on(PlantKind::Rigid),
        halved,
        friction(0.9 * 0.9),
        friction(1.1 * 0.9),
        later,
    ];
    for episode in &acc_found()[..6] {
        let told = persistence(world, episode).expect("driven");
        let names: Vec<&str> = told.variations.iter().map(|it| it.name.as_str()).collect();
        assert_eq!(names, NAMES);
        let by_world = worlds.iter().map(|world| fails(world, episode, (0, 0.0)));
        let by_start = [0, 1, 2]
            .into_iter()
            .flat_map(|axis| [-0.1, 0.1].map(|by| fails(world, episode, (axis, by))));
        let expected: Vec<Option<bool>> = by_world.chain(by_start).collect();
        let is: Vec<Option<bool>> = told.variations.iter().map(|it| it.fails).collect();
        assert_eq!(is, expected);
        let reasons = told.variations.iter().map(|it| it.no_answer.is_none());
        assert!(reasons.eq(is.iter().map(Option::is_some)));
    }
}

#[test]
fn the_share_is_of_those_with_an_answer() {
    let of = |name: &str, fails| Variation {
        name: name.to_owned(),
        fails,
        no_answer: None,
    };
    let foul = Variation {
        no_answer: Some(NoAnswer::RuleBroken {
            rule: "stays".to_owned(),
        }),
        ..of("e", None)
    };
    let it = Persistence {
        variations: vec![
            of("a", Some(true)),
            of("b", Some(false)),
            of("c", None),
            of("d", Some(true)),
            foul.clone(),
        ],
    };
    near(it.share(), 2.0 / 3.0);
    assert_eq!(
        it.to_string(),
        "still fails in 67 % of 3 variations, not with b; no answer with c: the ego or the \
         physics fails in the replay; no answer with e: the ado breaks `stays` in the replay"
    );
    near(Persistence { variations: vec![] }.share(), 0.0);
    let unknown = Persistence {
        variations: vec![foul],
    };
    let words = unknown.to_string();
    assert!(words.starts_with("no answer in 1 variations"), "{words}");
}

#[test]
fn a_grid_has_nothing_to_vary() {
    let world = include_str!("../../worlds/grid.ron");
    let world = Scenario::parse("grid.ron", world).expect("a world");
    let (start, noise) = (world.starts().expect("finite")[0].clone(), 0);
    let mut ado = Replay::holding(&[0]);
    let episode = play(&mut world.bench(), &start, noise, &mut ado, Aftermath::Play);
    assert_eq!(persistence(&world, &episode), None);
}
