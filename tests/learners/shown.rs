//! Learning from demonstrations: what is shown is kept, followed and learned.

use brakecheck::rl::{Control, Demonstration, End, Env, Learner, Spaces, Step};

use crate::{config, go_on};

/// Decisions of an episode behind [`Lock`].
const LENGTH: usize = 10;
const ACTIONS: usize = 4;

/// A lock with a combination of its own for every start, read off the
/// observation: the right action each time pays 1 at the end, anything else
/// nothing. By chance it opens once in a million episodes; until then there is
/// nothing to learn from.
struct Lock {
    spaces: Spaces,
    index: u64,
    at: usize,
    wrong: bool,
    /// The only start from which it opens, if there is only one.
    only: Option<u64>,
    /// The first decisions of every episode, by its index.
    played: Vec<(u64, Vec<usize>)>,
}

impl Lock {
    fn new() -> Lock {
        let spaces = Spaces {
            observation: ACTIONS + 2,
            actions: ACTIONS,
            neutral: 0,
            parts: Vec::new(),
        };
        Lock {
            spaces,
            index: 0,
            at: 0,
            wrong: false,
            only: None,
            played: Vec::new(),
        }
    }

    fn right(index: u64, at: usize) -> usize {
        let mixed = (index + 3).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 20;
        (mixed as usize + at * (1 + index as usize % 3)) % ACTIONS
    }

    fn combination(index: u64) -> Demonstration {
        let actions = (0..LENGTH).map(|at| Lock::right(index, at)).collect();
        Demonstration { index, actions }
    }

    fn observe(&self, obs: &mut [f32]) {
        obs.fill(0.0);
        obs[Lock::right(self.index, self.at)] = 1.0;
        obs[ACTIONS] = self.at as f32 / LENGTH as f32;
        obs[ACTIONS + 1] = f32::from(u8::from(self.wrong));
    }
}

impl Env for Lock {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        (self.index, self.at) = (index, 0);
        self.wrong = self.only.is_some_and(|only| only != index);
        self.played.push((index, Vec::new()));
        self.observe(obs);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.wrong |= action != Lock::right(self.index, self.at);
        self.at += 1;
        if let Some((_, actions)) = self.played.last_mut() {
            actions.push(action);
        }
        self.observe(obs);
        let (reward, end) = match (self.at, self.wrong) {
            (LENGTH, false) => (1.0, Some(End::Terminated)),
            (LENGTH, true) => (0.0, Some(End::Terminated)),
            _ => (0.0, None),
        };
        Step { reward, end }
    }
}

fn shown(starts: u64) -> Vec<Demonstration> {
    (0..starts)
        .map(|i| Lock::combination((1 << 40) + i))
        .collect()
}

/// How many of some starts that were never met a learner opens.
fn opened(learner: &dyn Learner) -> usize {
    let policy = learner.policy();
    let mut lock = Lock::new();
    let mut obs = vec![0.0; lock.spaces.observation];
    let opens = |index: &u64| {
        lock.reset(*index, &mut obs);
        loop {
            let step = lock.step(policy.act(&obs), &mut obs);
            if step.end.is_some() {
                return step.reward > 0.0;
            }
        }
    };
    (1_000_000..1_000_050).filter(opens).count()
}

const DQFD: &str = "Dqfd(decisions: 10000, hidden: [32, 32])";

#[test]
fn what_chance_never_meets_is_learned_from_what_is_shown() {
    let mut lock = Lock::new();
    let spaces = lock.spaces.clone();
    let mut alone = config(DQFD).build(&spaces, 1);
    go_on(&mut *alone, &mut lock);
    assert!(opened(&*alone) < 5, "{} alone", opened(&*alone));
    let mut led = config(DQFD).build(&spaces, 1);
    assert_eq!(led.demonstrate(&mut lock, &shown(40)), 40);
    assert_eq!(led.decisions(), 0, "shown ones are not its own decisions");
    go_on(&mut *led, &mut lock);
    assert!(opened(&*led) > 45, "{} of 50", opened(&*led));
}

#[test]
fn a_demonstration_that_fails_is_dropped_and_other_learners_look_at_none() {
    let mut lock = Lock::new();
    let spaces = lock.spaces.clone();
    let mut wrong = shown(5);
    wrong[1].actions[7] = (wrong[1].actions[7] + 1) % ACTIONS;
    wrong[3].actions.truncate(4);
    let mut learner = config(DQFD).build(&spaces, 1);
    assert_eq!(learner.demonstrate(&mut lock, &wrong), 3);
    for other in [
        "Dqn(decisions: 100)",
        "QTable(decisions: 100)",
        "Ppo(decisions: 100)",
    ] {
        let mut learner = config(other).build(&spaces, 1);
        assert_eq!(learner.demonstrate(&mut lock, &shown(5)), 0, "{other}");
    }
}

#[test]
fn a_fifth_of_the_episodes_follows_a_success_half_of_them_from_its_own_start() {
    let mut lock = Lock::new();
    let spaces = lock.spaces.clone();
    let ron = "Dqfd(decisions: 20000, hidden: [8], imitation: (guided: 0.4))";
    let mut learner = config(ron).build(&spaces, 2);
    let own = 1 << 40;
    lock.only = Some(own);
    learner.demonstrate(&mut lock, &shown(1));
    lock.played.clear();
    while learner.decisions() < 15_000 {
        learner.episode(&mut lock);
    }
    let of_own = lock.played.iter().filter(|(index, _)| *index == own);
    let share = of_own.clone().count() as f64 / lock.played.len() as f64;
    assert!((0.17..0.23).contains(&share), "{share}");
    // Its own start is played along the demonstration, as far as it leads.
    let right = Lock::combination(own).actions;
    let longest = of_own.map(|(_, played)| {
        let same = played.iter().zip(&right).take_while(|(a, b)| a == b);
        same.count()
    });
    assert!(longest.max() >= Some(LENGTH - 1));
}

#[test]
fn demonstrations_are_part_of_a_checkpoint() {
    let mut lock = Lock::new();
    let spaces = lock.spaces.clone();
    let config = config(DQFD);
    let mut whole = config.build(&spaces, 3);
    whole.demonstrate(&mut lock, &shown(20));
    let mut cut = config.build(&spaces, 3);
    cut.demonstrate(&mut lock, &shown(20));
    go_on(&mut *whole, &mut lock);
    cut.train(&mut lock, &mut |progress| {
        if progress.decisions > 2500 {
            Control::Stop
        } else {
            Control::Continue
        }
    });
    let mut resumed = config.restore(&spaces, &cut.checkpoint()).unwrap();
    go_on(&mut *resumed, &mut lock);
    assert_eq!(
        whole.checkpoint().to_bytes().unwrap(),
        resumed.checkpoint().to_bytes().unwrap()
    );
}

#[test]
fn an_extension_is_part_of_a_checkpoint() {
    let mut lock = Lock::new();
    let spaces = lock.spaces.clone();
    let config = config(DQFD);
    let begun = || {
        let mut lock = Lock::new();
        let mut learner = config.build(&spaces, 4);
        learner.demonstrate(&mut lock, &shown(20));
        go_on(&mut *learner, &mut lock);
        assert!(learner.finished());
        learner.extend(3000);
        assert!(!learner.finished());
        learner
    };
    let mut whole = begun();
    let mut resumed = config.restore(&spaces, &begun().checkpoint()).unwrap();
    go_on(&mut *whole, &mut lock);
    go_on(&mut *resumed, &mut lock);
    assert!(whole.decisions() >= 13_000);
    assert_eq!(
        whole.checkpoint().to_bytes().unwrap(),
        resumed.checkpoint().to_bytes().unwrap()
    );
    assert!(opened(&*whole) > 45, "{} of 50", opened(&*whole));
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let options = ron::Options::default()
        .with_default_extension(ron::extensions::Extensions::UNWRAP_VARIANT_NEWTYPES);
    for (ron, says) in [
        ("Dqfd(imitation: (share: 1.5))", "`share` is 1.5"),
        ("Dqfd(imitation: (margin: -1.0))", "`margin` is -1"),
        ("Dqfd(longest: 0.5)", "`longest` is 0.5"),
        ("Dqfd(hidden: [])", "`hidden` is 0"),
    ] {
        let error = options
            .from_str::<brakecheck::rl::LearnerConfig>(ron)
            .unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}
