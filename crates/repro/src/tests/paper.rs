//! Rows of the paper: an evaluation along the way does not disturb the learner.

use std::sync::atomic::AtomicBool;

use crate::milestones::milestones;
use crate::{PaperRow, measure_paper_row, paper_rows_markdown};
use brakecheck::adversary::Ado;
use brakecheck::experiment::{Watch, test_starts};
use brakecheck::rl::Control;
use brakecheck::seed::{Purpose, Seeds};
use brakecheck::testbench::Gym;
use brakecheck::world::PlantKind;
use brakecheck_experiment::adversary::rollout::{EvalRequest, eval};

static GO: AtomicBool = AtomicBool::new(false);

fn quiet() -> Watch<'static> {
    Watch::new(&|_, _| {}, &GO)
}

#[test]
fn milestones_are_of_one_training_that_nobody_disturbed() {
    let mut world = super::acc().on(PlantKind::Kinematic);
    world = world.training_for(6_000).expect("in range");
    let starts = test_starts(&world, 3, 40, &quiet()).expect("not stopped");
    let on_the_way =
        milestones(&world, 5, &[20, 60, 1_000_000], &starts, &quiet()).expect("not stopped");
    let episodes: Vec<u64> = on_the_way.iter().map(|one| one.episodes).collect();
    assert_eq!(episodes[..2], [20, 60]);
    assert_eq!(on_the_way.len(), 3, "{episodes:?}");
    assert!(
        on_the_way
            .windows(2)
            .all(|pair| pair[0].cpu_s <= pair[1].cpu_s)
    );
    assert!(on_the_way[2].decisions >= 6_000);

    let mut learner = world.learner().build(world.world().spaces(), 5);
    let mut gym = Gym::new(world.bench(), Purpose::Train, 5);
    learner.train(&mut gym, &mut |_| Control::Continue);
    let policy = learner.policy();
    let request = EvalRequest {
        scenario: &world,
        ego: "nominal",
        ado: Ado::Trained(&*policy, 5),
        starts: &starts,
    };
    let undisturbed = eval(&request, &quiet()).row;
    assert_eq!(undisturbed.solved, on_the_way[2].row.solved);
}

#[test]
fn a_row_of_the_paper_is_the_mean_of_its_seeds() {
    let mut world = super::acc().on(PlantKind::Kinematic);
    world = world.training_for(4_000).expect("in range");
    let row = PaperRow {
        paper: "a row",
        scenario: &world,
        episodes: &[30],
    };
    let two = Seeds {
        first: 1,
        count: 2,
        starts: 0,
    };
    let measured = measure_paper_row(&row, two, 40, &quiet()).expect("not stopped");
    assert_eq!(measured.reached.len(), 2);
    let starts = test_starts(&world, 0, 40, &quiet()).expect("not stopped");
    for (at, reached) in measured.reached.iter().enumerate() {
        let rates = [1, 2].map(|seed| {
            let all = milestones(&world, seed, &[30], &starts, &quiet()).expect("not stopped");
            all[at].row.success_rate
        });
        assert!((reached.success_rate - (rates[0] + rates[1]) / 2.0).abs() < 1e-12);
        let [lo, hi] = reached.ci95;
        assert!(lo <= reached.success_rate && reached.success_rate <= hi);
    }
    let table = paper_rows_markdown(&[measured]);
    assert!(table.contains("| a row | acc | Dqn | 2 |"), "{table}");
}

#[test]
fn a_row_whose_last_evaluation_was_stopped_is_none() {
    use std::sync::atomic::Ordering;

    let mut world = super::acc().on(PlantKind::Kinematic);
    world = world.training_for(500).expect("in range");
    let starts = test_starts(&world, 3, 40, &quiet()).expect("not stopped");
    let stop = AtomicBool::new(false);
    let total = starts.starts.len() as u64;
    // Only the evaluation reports progress with the number of starts as its total.
    let progress = |done, of| {
        if of == total && done > 0 {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let watch = Watch::new(&progress, &stop);
    assert!(milestones(&world, 5, &[], &starts, &watch).is_none());
    assert!(stop.load(Ordering::Relaxed));
}
