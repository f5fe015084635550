//! Authoring from the documentation alone: its example, and worlds written by it.

use std::sync::atomic::AtomicBool;

use brakecheck::experiment::{Watch, test_starts};
use brakecheck::run_dir::RunDir;
use brakecheck::search::{SearchRequest, Switches, search};
use brakecheck::testbench::{Actor, Aftermath, HeldRandom, PolicyActor, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use brakecheck_training::training::train_loop::train;

const DOC: &str = include_str!("../../docs/guide/worlds.md");
const AUTHORED: [(&str, &str); 3] = [
    ("zebra", include_str!("authored/zebra.ron")),
    ("platoon", include_str!("authored/platoon.ron")),
    ("cyclist", include_str!("authored/cyclist.ron")),
];

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

/// The world that the documentation writes from an empty file.
fn example() -> &'static str {
    let from = DOC.find("```ron\n").expect("an example") + "```ron\n".len();
    let to = DOC[from..].find("```").expect("its end");
    &DOC[from..from + to]
}

fn world(name: &str, text: &str) -> Scenario {
    let world = Scenario::parse(name, text).unwrap_or_else(|error| panic!("{error}"));
    assert!(
        world.warnings().is_empty(),
        "{name}: {:?}",
        world.warnings()
    );
    world
}

#[test]
fn the_example_of_the_documentation_becomes_a_trained_ado() {
    // As a reader would type them.
    let asked = [
        "brakecheck check pull_out.ron",
        "brakecheck train pull_out.ron -o runs/pull_out",
        "brakecheck eval runs/pull_out",
    ];
    assert!(asked.iter().all(|line| DOC.contains(line)));
    let text = example().replacen(
        "    ego_spec",
        "    learner: Dqn(decisions: 8_000),\n    ego_spec",
        1,
    );
    let world = world("pull_out.ron", &text).on(PlantKind::Kinematic);
    let dir = tempfile::tempdir().expect("a directory");
    let mut run = RunDir::create(&dir.path().join("run"), &world, 11).expect("a new directory");
    train(&world, &mut run, &quiet()).expect("trained");
    let policy = run.policy().expect("a policy");

    let starts = test_starts(&world, 77, 60, &quiet()).expect("not stopped");
    let mut bench = world.bench();
    let mut successes = |actor: &mut dyn Actor| {
        let mut solved = 0;
        for (start, noise) in &starts.starts {
            let played = play(&mut bench, start, *noise, actor, Aftermath::Skip);
            solved += usize::from(played.verdict.is_success());
        }
        solved
    };
    let trained = successes(&mut PolicyActor(&*policy));
    let held = successes(&mut HeldRandom::new(world.bench().spaces().actions, 5));
    assert!(held + 20 <= trained, "trained {trained}, held {held} of 60");
}

#[test]
fn worlds_of_other_kinds_ask_something_that_search_can_answer() {
    for (name, text) in AUTHORED {
        let world = world(name, text);
        for name in world.reuse().keys() {
            world.with(&world.reuse()[name]).expect("it fits");
        }
        let starts = test_starts(&world, 77, 10, &quiet()).expect("not stopped");
        let request = SearchRequest {
            scenario: &world,
            ego: "nominal",
            method: Switches(1).into(),
            budget: 20,
            starts: &starts,
        };
        let row = search(&request, &quiet()).row;
        assert!(row.trivial < 3 && row.successes >= 2, "{name}: {row:?}");
    }
}
