//! Egos of the user's: asked about their crashes as stock egos are, if they are
//! deterministic.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use brakecheck::ego::{Command, Controller, Fault, Percept};
use brakecheck::experiment::ControllerFactory;
use brakecheck::experiment::Watch;
use brakecheck::run_dir::NotAsked;
use brakecheck::world::{Repeats, Scenario};
use brakecheck_crashes::crashes::minimize::shrink;
use brakecheck_crashes::crashes::perturbation_robustness::persistence;
use brakecheck_crashes::crashes::root_cause::decisive;
use brakecheck_crashes::crashes::save_crashes::description;

use super::found::{acc, acc_found, replayed};

/// A stock controller in the user's own type, whose commands may be shaken.
struct Own {
    inner: Box<dyn Controller>,
    copies: bool,
    shaken_mps2: f64,
}

impl Controller for Own {
    fn reset(&mut self, seed: u64) {
        self.inner.reset(seed);
    }

    fn control(&mut self, percept: &Percept) -> Result<Command, Fault> {
        let command = self.inner.control(percept)?;
        Ok(Command {
            accel_mps2: command.accel_mps2 + self.shaken_mps2,
            ..command
        })
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        let inner = self.inner.fork().filter(|_| self.copies)?;
        Some(Box::new(Own { inner, ..*self }))
    }
}

/// The same world with the same controller, as the user's own.
fn own(copies: bool, shakes: bool) -> Scenario {
    static MADE: AtomicU64 = AtomicU64::new(0);
    let stock = acc().controller().expect("a stock ego").controller;
    let factory: ControllerFactory = Arc::new(move || {
        let nth = if shakes {
            MADE.fetch_add(1, Ordering::Relaxed)
        } else {
            0
        };
        Box::new(Own {
            inner: stock.build(),
            copies,
            shaken_mps2: 1e-6 * nth as f64,
        })
    });
    acc().with_ego("own", factory)
}

#[test]
fn a_deterministic_ego_gets_the_labels_that_the_same_stock_ego_gets() {
    for copies in [true, false] {
        let world = own(copies, false);
        let mut smaller = 0;
        for stock in &acc_found()[..3] {
            let episode = replayed(&world, stock, &stock.actions);
            assert!(!episode.commands.is_empty() && episode.trace == stock.trace);
            assert_eq!(persistence(&world, &episode), persistence(acc(), stock));
            assert_eq!(decisive(&world, &episode), decisive(acc(), stock));
            let (small, shrunk) = shrink(&world, &episode, &Watch::unwatched());
            assert!(small.verdict.is_success());
            assert!(!shrunk.before.is_less_than(&shrunk.after));
            smaller += usize::from(shrunk.after.is_less_than(&shrunk.before));
            let (of_stock, _) = shrink(acc(), stock, &Watch::unwatched());
            if copies {
                assert_eq!(small.actions, of_stock.actions);
            }
            let runs = description(&world, &small).ego_runs.expect("counted");
            assert_eq!((runs.copied, runs.ended), (copies, None));
        }
        assert!(smaller > 0, "nothing was made smaller");
    }
}

#[test]
fn one_that_is_not_is_not_asked_without_repeats_and_says_why() {
    let world = own(false, true);
    let stock = &acc_found()[0];
    let episode = replayed(&world, stock, &stock.actions);
    let known = description(&world, &episode);
    let why = known.why.as_ref().expect("explained");
    assert!(matches!(
        why.not_asked,
        Some(NotAsked::NotDeterministic { .. })
    ));
    assert!(known.persistence.is_none() && why.decisive.is_none());
    let words = known.to_string();
    assert!(
        words.contains("not deterministic") && words.contains("`repeats: 5`"),
        "{words}"
    );
    assert!(!words.contains("no single action"), "{words}");
    assert_eq!(shrink(&world, &episode, &Watch::unwatched()).0, episode);
    // With repeats every question is asked so often.
    let repeated = world.repeated(Repeats { runs: 3, gate: 2 });
    let known = description(&repeated, &episode);
    let runs = known.ego_runs.expect("counted");
    assert_eq!(runs.ended, None);
    let varied = known.persistence.expect("asked").variations.len() as u64;
    assert!(2 + 3 * varied <= runs.runs, "{runs}");
    assert_eq!(known.why.expect("explained").not_asked, None);
}
