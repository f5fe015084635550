//! Every promise is broken once on purpose, by everybody who makes it.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};

use brakecheck::conformance::{
    Nonconformities, Promise, check_controller, check_env, check_policy, check_scene,
};
use brakecheck::ego::{Command, Controller, Fault, FaultKind, Percept};
use brakecheck::rl::{End, Env, Policy, Spaces, Step};
use brakecheck::scene::{Axis, Clock, Frame, Scene, SceneGeometry, Start, StepOutcome};
use brakecheck::seed::StartKey;
use brakecheck::trace::{Schema, Signal};

/// What is wrong with somebody; each breaks one promise.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Planted {
    Nothing,
    RemembersAcrossReset,
    ForkForgets,
    ForkShares,
    NotFinite,
    Faults,
    OutOfBounds,
    NotWritten,
    NoSuchAction,
    RollsDice,
    KnowsItsThread,
    NeverEnds,
    StartOutside,
}

use Planted::*;

/// A number that grows, with what is wrong about it.
#[derive(Clone)]
struct Counter {
    planted: Planted,
    home: ThreadId,
    shared: Arc<Mutex<f64>>,
    count: f64,
    forgotten: f64,
}

static DICE: AtomicU64 = AtomicU64::new(0);

impl Counter {
    fn new(planted: Planted, home: ThreadId) -> Counter {
        Counter {
            planted,
            home,
            shared: Arc::default(),
            count: 0.0,
            forgotten: 0.0,
        }
    }

    fn reset(&mut self) {
        if self.planted != RemembersAcrossReset {
            self.count = 0.0;
        }
        self.forgotten = 0.0;
        *self.shared.lock().expect("whole") = 0.0;
    }

    fn next(&mut self) -> f64 {
        self.count += 0.01;
        self.forgotten += 0.01;
        let mut shared = self.shared.lock().expect("whole");
        *shared += 0.01;
        match self.planted {
            NotFinite if self.count > 0.05 => f64::NAN,
            ForkForgets => self.forgotten,
            ForkShares => *shared,
            RollsDice => DICE.fetch_add(1, Ordering::Relaxed) as f64 * 1e-6,
            KnowsItsThread if thread::current().id() != self.home => 0.5,
            OutOfBounds => 1000.0,
            NeverEnds => 0.0,
            _ => self.count,
        }
    }

    fn fork(&self) -> Counter {
        let shared = match self.planted {
            ForkShares => Arc::clone(&self.shared),
            _ => Arc::new(Mutex::new(*self.shared.lock().expect("whole"))),
        };
        let forgotten = match self.planted {
            ForkForgets => 0.0,
            _ => self.forgotten,
        };
        Counter {
            shared,
            forgotten,
            ..self.clone()
        }
    }
}

/// The first promise that is found broken, and the message.
fn broken(result: Result<(), Nonconformities>) -> Option<(Promise, String)> {
    let all = result.err()?;
    Some((all.0[0].promise, all.to_string()))
}

/// Each fault is named by the promise it breaks; nothing wrong passes.
fn caught(cases: &[(Planted, Promise)], check: impl Fn(Planted) -> Result<(), Nonconformities>) {
    assert_eq!(broken(check(Nothing)), None);
    for (planted, promise) in cases {
        let (found, message) = broken(check(*planted)).unwrap_or_else(|| panic!("{planted:?}"));
        assert_eq!(found, *promise, "{planted:?}: {message}");
        assert!(
            message.ends_with(promise.cure()) || message.contains('\n'),
            "{message}"
        );
    }
}

struct Ego(Counter);

impl Controller for Ego {
    fn reset(&mut self, _seed: u64) {
        self.0.reset();
    }

    fn control(&mut self, _percept: &Percept) -> Result<Command, Fault> {
        match self.0.planted {
            Faults => Err(Fault::new(FaultKind::Error, "out of order")),
            _ => Ok(Command::accelerate(self.0.next())),
        }
    }

    fn fork(&self) -> Option<Box<dyn Controller>> {
        Some(Box::new(Ego(self.0.fork())))
    }
}

#[test]
fn a_controller_that_breaks_a_promise_is_caught() {
    let home = thread::current().id();
    let cases = [
        (RemembersAcrossReset, Promise::PureReset),
        (ForkForgets, Promise::Fork),
        (ForkShares, Promise::Fork),
        (NotFinite, Promise::Finite),
        (Faults, Promise::Finite),
        (OutOfBounds, Promise::Spaces),
        (RollsDice, Promise::Deterministic),
        (KnowsItsThread, Promise::Parallel),
    ];
    caught(&cases, |planted| {
        check_controller(&|| Box::new(Ego(Counter::new(planted, home))))
    });
    let veteran = check_controller(&|| Box::new(Ego(Counter::new(RemembersAcrossReset, home))));
    let message = veteran.expect_err("broken").to_string();
    let (begins, ends) = message.split_once(" is 1.2").expect("one line");
    assert_eq!(
        begins,
        "`reset` forgets what was before: episode 1, step 0: `accel_mps2`"
    );
    assert!(
        ends.contains("and was 0.01 before; set every field"),
        "{ends}"
    );
}

struct World {
    counter: Counter,
    spaces: Spaces,
    left: usize,
}

impl World {
    fn new(planted: Planted, home: ThreadId) -> World {
        let neutral = match planted {
            NoSuchAction => 2,
            _ => 1,
        };
        World {
            counter: Counter::new(planted, home),
            spaces: Spaces {
                observation: 2,
                actions: 2,
                neutral,
                parts: Vec::new(),
            },
            left: 0,
        }
    }

    fn show(&mut self, obs: &mut [f32]) {
        obs[0] = self.counter.next() as f32;
        if self.counter.planted != NotWritten {
            obs[1] = 0.0;
        }
    }
}

impl Env for World {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, _index: u64, obs: &mut [f32]) {
        self.counter.reset();
        self.left = 20;
        self.show(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.show(obs);
        self.left -= usize::from(self.counter.planted != NeverEnds);
        Step {
            reward: action as f32,
            end: (self.left == 0).then_some(End::Truncated),
        }
    }
}

#[test]
fn an_environment_that_breaks_a_promise_is_caught() {
    let home = thread::current().id();
    let cases = [
        (RemembersAcrossReset, Promise::PureReset),
        (NotFinite, Promise::Finite),
        (NotWritten, Promise::Finite),
        (OutOfBounds, Promise::Spaces),
        (NoSuchAction, Promise::Spaces),
        (RollsDice, Promise::Deterministic),
        (KnowsItsThread, Promise::Parallel),
        (NeverEnds, Promise::Ends),
    ];
    caught(&cases, |planted| {
        check_env(&|| Box::new(World::new(planted, home)))
    });
}

struct Rule(Planted, ThreadId, AtomicU64);

impl Policy for Rule {
    fn act(&self, obs: &[f32]) -> usize {
        match self.0 {
            NoSuchAction => 2,
            KnowsItsThread if thread::current().id() != self.1 => 0,
            KnowsItsThread => 1,
            _ => usize::from(obs[0] > 0.0),
        }
    }

    fn value(&self, obs: &[f32]) -> f32 {
        match self.0 {
            NotFinite => f32::NAN,
            RemembersAcrossReset => self.2.fetch_add(1, Ordering::Relaxed) as f32,
            _ => obs[0],
        }
    }
}

#[test]
fn a_policy_that_breaks_a_promise_is_caught() {
    let home = thread::current().id();
    let spaces = Spaces {
        observation: 2,
        actions: 2,
        neutral: 0,
        parts: Vec::new(),
    };
    let cases = [
        (NoSuchAction, Promise::Spaces),
        (NotFinite, Promise::Finite),
        (RemembersAcrossReset, Promise::Deterministic),
        (KnowsItsThread, Promise::Parallel),
    ];
    caught(&cases, |planted| {
        check_policy(&Rule(planted, home, AtomicU64::new(0)), &spaces)
    });
}

/// A scene of one signal and one axis.
struct Line {
    counter: Counter,
    schema: Arc<Schema>,
    spaces: Spaces,
    clock: Clock,
    axes: Vec<Axis>,
    shown: f64,
}

impl Line {
    fn new(planted: Planted, home: ThreadId) -> Line {
        let signal = Signal::real("ado.x", "m", "How far it has come.");
        Line {
            counter: Counter::new(planted, home),
            schema: Arc::new(Schema::new(0.1, [signal]).expect("a schema")),
            spaces: World::new(planted, home).spaces,
            clock: Clock {
                horizon_s: 3.0,
                decision_s: 0.5,
                sample_s: 0.1,
                substeps: 1,
            },
            axes: vec![Axis {
                name: "ado.x".to_owned(),
                unit: "m",
                lo: 0.0,
                hi: 1.0,
            }],
            shown: 0.0,
        }
    }
}

impl Scene for Line {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn clock(&self) -> &Clock {
        &self.clock
    }

    fn axes(&self) -> &[Axis] {
        &self.axes
    }

    fn draw(&self, key: StartKey) -> Start {
        let outside = if self.counter.planted == StartOutside {
            1.5
        } else {
            0.0
        };
        Start(vec![outside + key.index as f64 / 10.0])
    }

    fn reset(&mut self, _start: &Start, _noise: u64) {
        self.counter.reset();
        self.shown = self.counter.next();
    }

    fn decide(&mut self, _action: usize) {}

    fn advance(&mut self) -> StepOutcome {
        self.shown = self.counter.next();
        match self.counter.planted {
            Faults => StepOutcome::Fault(Fault::new(FaultKind::Physics, "it exploded")),
            _ => StepOutcome::Going,
        }
    }

    fn publish(&self, row: &mut [f64]) {
        row[0] = self.shown;
    }

    fn observe(&self, row: &[f64], obs: &mut [f32]) {
        obs[0] = row[0] as f32;
        if self.counter.planted != NotWritten {
            obs[1] = 0.0;
        }
    }

    fn stage(&self) -> SceneGeometry {
        SceneGeometry {
            agents: Vec::new(),
            lane_borders_m: Vec::new(),
            side_roads_m: Vec::new(),
            lights: Vec::new(),
        }
    }

    fn frame(&self) -> Frame {
        Frame {
            placements: Vec::new(),
            phases: Vec::new(),
            seen: None,
        }
    }

    fn fork(&self) -> Option<Box<dyn Scene>> {
        Some(Box::new(Line {
            counter: self.counter.fork(),
            schema: Arc::clone(&self.schema),
            spaces: self.spaces.clone(),
            axes: self.axes.clone(),
            ..*self
        }))
    }
}

#[test]
fn a_scene_that_breaks_a_promise_is_caught() {
    let home = thread::current().id();
    let cases = [
        (RemembersAcrossReset, Promise::PureReset),
        (ForkForgets, Promise::Fork),
        (ForkShares, Promise::Fork),
        (NotFinite, Promise::Finite),
        (Faults, Promise::Finite),
        (NotWritten, Promise::Finite),
        (OutOfBounds, Promise::Spaces),
        (NoSuchAction, Promise::Spaces),
        (StartOutside, Promise::Spaces),
        (RollsDice, Promise::Deterministic),
        (KnowsItsThread, Promise::Parallel),
    ];
    caught(&cases, |planted| {
        check_scene(&|| Box::new(Line::new(planted, home)))
    });
}
