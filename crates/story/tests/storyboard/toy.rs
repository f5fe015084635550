//! Agents on a straight road whose motion is known exactly at every instant.

use brakecheck_files::ron_file::{Problems, ValuePath, parse_ron as parse};
use brakecheck_road::pose::Pose;
use brakecheck_road::road::OnRoad;
use brakecheck_story::check::{CheckedStoryboard, StoryNames, check};
use brakecheck_story::robustness::{RobustnessAt, SampledRobustness};
use brakecheck_story::run::{ElementChange, StoryRun};
use brakecheck_story::values::{Dimension, DynamicsShape, SignalState, Storyboard};
use brakecheck_story::view::{
    ActorAction, ActorSpeed, AgentMotion, AgentSize, MotionDomain, PosedAgent, RoadLimits,
    SceneChange, StoryStage, StoryView,
};

/// Motion from an instant on: even acceleration up to another instant.
#[derive(Clone, Copy, Debug)]
pub struct Leg {
    pub from_s: f64,
    pub x_m: f64,
    pub y_m: f64,
    pub speed_mps: f64,
    pub accel_mps2: f64,
    pub until_s: f64,
}

impl Leg {
    fn at(&self, at_s: f64) -> (f64, f64, f64) {
        let for_s = at_s.min(self.until_s) - self.from_s;
        let after_s = (at_s - self.until_s).max(0.0);
        let speed_mps = self.speed_mps + self.accel_mps2 * for_s;
        let way_m = (self.speed_mps + 0.5 * self.accel_mps2 * for_s) * for_s + speed_mps * after_s;
        let accel_mps2 = if at_s < self.until_s {
            self.accel_mps2
        } else {
            0.0
        };
        (self.x_m + way_m, speed_mps, accel_mps2)
    }
}

/// Agents `a`, `b`, … of 4 m × 2 m, whose light turns red at 1.5 s.
///
/// Every formula holds from 1.23 s to 2.23 s.
#[derive(Clone, Debug)]
pub struct Toy {
    pub legs: Vec<Leg>,
    swings_s: Vec<f64>,
    /// Beginning and end of the sample.
    pub samples_s: [f64; 2],
    /// Instants from which formulas are watched.
    pub watched_s: Vec<f64>,
}

impl Toy {
    /// Agents at x with a speed, all in the same lane.
    pub fn new(agents: &[(f64, f64)]) -> Toy {
        let legs = agents.iter().map(|(x_m, speed_mps)| Leg {
            from_s: 0.0,
            x_m: *x_m,
            y_m: 0.0,
            speed_mps: *speed_mps,
            accel_mps2: 0.0,
            until_s: f64::INFINITY,
        });
        Toy {
            legs: legs.collect(),
            swings_s: vec![0.0; agents.len()],
            samples_s: [0.0; 2],
            watched_s: Vec::new(),
        }
    }

    pub fn with_accel(mut self, agent: usize, accel_mps2: f64) -> Toy {
        self.legs[agent].accel_mps2 = accel_mps2;
        self
    }
}

impl StoryView for Toy {
    fn motion(&self, agent: usize, at_s: f64) -> AgentMotion {
        let (x_m, speed_mps, accel_mps2) = self.legs[agent].at(at_s);
        let y_m = self.legs[agent].y_m;
        AgentMotion {
            pose: Pose {
                x_m,
                y_m,
                heading_rad: 0.0,
            },
            speed_mps,
            lateral_mps: 0.0,
            accel_mps2,
        }
    }

    fn on_road(&self, _: usize, pose: &Pose) -> OnRoad {
        OnRoad {
            s_m: pose.x_m,
            lateral_m: pose.y_m,
            heading_rad: pose.heading_rad,
            curvature_per_m: 0.0,
        }
    }

    fn pose_on_road(&self, _: usize, _: Option<usize>, s_m: f64, lateral_m: f64) -> Pose {
        Pose {
            x_m: s_m,
            y_m: lateral_m,
            heading_rad: 0.0,
        }
    }

    fn lane_middle_m(&self, _: usize, lateral_m: f64, lanes: i32) -> f64 {
        4.0 * ((lateral_m / 4.0).round() + f64::from(lanes))
    }

    fn road_limits(&self, _: usize) -> RoadLimits {
        RoadLimits {
            right_m: -2.0,
            left_m: 2.0,
            from_s_m: -1000.0,
            to_s_m: 1000.0,
        }
    }

    fn size(&self, _: usize) -> AgentSize {
        AgentSize {
            length_m: 4.0,
            width_m: 2.0,
            front_m: 3.0,
        }
    }

    fn gap_m(&self, [a, b]: [PosedAgent; 2]) -> f64 {
        ((a.pose.x_m - b.pose.x_m).abs() - 4.0).max(0.0)
    }

    fn signal(&self, _: usize, at_s: f64) -> SignalState {
        if at_s < 1.5 {
            SignalState::Green
        } else {
            SignalState::Red
        }
    }

    fn parameter(&self, _: usize) -> f64 {
        7.0
    }

    fn robustness(&self, _: usize) -> SampledRobustness {
        let [before, now] = self.samples_s.map(|at_s| RobustnessAt {
            at_s,
            rho: 0.5 - (at_s - 1.73).abs(),
        });
        SampledRobustness {
            before: (before.at_s < now.at_s).then_some(before),
            now,
        }
    }
}

impl StoryStage for Toy {
    fn begin(&mut self, agent: usize, action: &ActorAction, at_s: f64) {
        let ActorAction::Speed { target, dynamics } = action else {
            // A swing of 2 s, without a motion.
            self.swings_s[agent] = at_s + 2.0;
            return;
        };
        let to_mps = match *target {
            ActorSpeed::Absolute(to_mps) => to_mps,
            ActorSpeed::Delta(target) => self.motion(target.of, at_s).speed_mps + target.by,
            ActorSpeed::Factor(target) => self.motion(target.of, at_s).speed_mps * target.by,
        };
        let (x_m, from_mps, _) = self.legs[agent].at(at_s);
        let change_mps = to_mps - from_mps;
        let lasts_s = match (dynamics.shape, dynamics.dimension) {
            (DynamicsShape::Step, _) => 0.0,
            (_, Dimension::Rate(rate)) => change_mps.abs() / rate,
            (_, Dimension::Time(time_s)) => time_s,
            (_, Dimension::Distance(way_m)) => 2.0 * way_m / (from_mps + to_mps),
        };
        let y_m = self.legs[agent].y_m;
        self.legs[agent] = Leg {
            from_s: at_s,
            x_m,
            y_m,
            speed_mps: if lasts_s == 0.0 { to_mps } else { from_mps },
            accel_mps2: if lasts_s == 0.0 {
                0.0
            } else {
                change_mps / lasts_s
            },
            until_s: at_s + lasts_s,
        };
    }

    fn change(&mut self, _: SceneChange, _: f64) {}

    fn watch(&mut self, _: usize, at_s: f64) {
        self.watched_s.push(at_s);
    }

    fn ends_s(&self, agent: usize, domain: MotionDomain) -> f64 {
        match domain {
            MotionDomain::Longitudinal => self.legs[agent].until_s,
            MotionDomain::Lateral => self.swings_s[agent],
        }
    }

    fn stop(&mut self, agent: usize, domain: MotionDomain, at_s: f64) {
        if domain == MotionDomain::Lateral {
            self.swings_s[agent] = at_s;
            return;
        }
        let (x_m, speed_mps, _) = self.legs[agent].at(at_s);
        let leg = &mut self.legs[agent];
        *leg = Leg {
            from_s: at_s,
            x_m,
            speed_mps,
            accel_mps2: 0.0,
            until_s: at_s,
            ..*leg
        };
    }
}

const AGENTS: [&str; 4] = ["a", "b", "c", "d"];

/// Checks a storyboard of agents a, b and c, of which `c` cannot act.
pub fn checked(text: &str) -> Result<CheckedStoryboard, Vec<String>> {
    checked_after(0, text)
}

/// Checks a storyboard after so many mistakes of other parts of a world.
pub fn checked_after(mistakes: usize, text: &str) -> Result<CheckedStoryboard, Vec<String>> {
    let board: Storyboard = parse(text).map_err(|it| vec![it.what])?;
    let mut problems = Problems::new(text);
    for _ in 0..mistakes {
        problems.add(&ValuePath::top(), "another mistake", "here", None);
    }
    let owned = |names: &[&str]| names.iter().map(|it| it.to_string()).collect();
    let names = StoryNames {
        agents: owned(&AGENTS),
        actors: owned(&AGENTS[..2]),
        on_foot: owned(&["b"]),
        lanes: vec![2, 1, 1, 1],
        lights: owned(&["light"]),
        roads: owned(&["side"]),
        parameters: owned(&["gap"]),
    };
    let found = check(&mut problems, &ValuePath::top(), &board, &names, &[7.0]);
    let problems = problems.into_list().into_iter();
    found.ok_or_else(|| problems.map(|it| it.what).collect())
}

/// Storyboard with one act of one maneuver of agent `a`.
pub fn events(events: &str) -> String {
    format!(
        r#"(variables: [(name: "n", value: 0)], stories: [(name: "story", acts: [(name: "act",
        maneuver_groups: [(name: "group", actors: ["a"], maneuvers: [(name: "maneuver",
        events: [{events}])])])])])"#
    )
}

/// Event that adds 1 to `n`, unless `more` has other actions.
pub fn event(name: &str, more: &str) -> String {
    let actions = if more.contains("actions:") {
        ""
    } else {
        r#"actions: [(name: "add", does: VariableAdd(name: "n", value: 1))],"#
    };
    format!(r#"(name: "{name}", {actions} {more})"#)
}

/// A run of a storyboard, with all changes.
pub struct Played {
    pub board: CheckedStoryboard,
    pub run: StoryRun,
    pub toy: Toy,
    pub changes: Vec<ElementChange>,
}

impl Played {
    /// Plays a storyboard of agents for a time.
    pub fn play(text: &str, toy: Toy, for_s: f64, sample_s: f64) -> Played {
        let board = checked(text).unwrap_or_else(|it| panic!("{it:?} in {text}"));
        let run = StoryRun::new(&board);
        let mut played = Played {
            board,
            run,
            toy,
            changes: Vec::new(),
        };
        let samples = (for_s / sample_s).round() as usize;
        played
            .run
            .step(&played.board, &mut played.toy, 0.0, &mut played.changes);
        played.on(0, samples, sample_s);
        played
    }

    /// Plays the samples after `from` up to `to`.
    pub fn on(&mut self, from: usize, to: usize, sample_s: f64) {
        for sample in from + 1..=to {
            let at_s = sample as f64 * sample_s;
            self.toy.samples_s = [at_s - sample_s, at_s];
            self.run
                .step(&self.board, &mut self.toy, at_s, &mut self.changes);
        }
    }

    /// Returns the transitions of an element as words and instants.
    pub fn of(&self, name: &str) -> Vec<(String, f64)> {
        let of = self.changes.iter().filter(|it| {
            let (_, path) = self.board.element(it.element);
            path == name || path.ends_with(&format!("::{name}"))
        });
        of.map(|it| {
            (
                format!("{:?}", it.transition).replace("Transition", ""),
                it.at_s,
            )
        })
        .collect()
    }

    /// Asserts the transitions of an element, to 1 µs.
    #[track_caller]
    pub fn expect(&self, name: &str, expected: &[(&str, f64)]) {
        let found = self.of(name);
        let same = found.len() == expected.len()
            && found
                .iter()
                .zip(expected)
                .all(|((word, at_s), (expected, expected_s))| {
                    word == expected && (at_s - expected_s).abs() < 1e-6
                });
        assert!(same, "{name}: {found:?}, expected {expected:?}");
    }
}

/// Trigger of one condition.
pub fn when(condition: &str) -> String {
    format!("start_trigger: [[({condition})]]")
}

/// Trigger at a time.
pub fn at(time_s: f64) -> String {
    when(&format!(
        "is: SimulationTime(rule: GreaterThan, value_s: {time_s:?})"
    ))
}

/// Speed action of agent `a`.
pub fn speed(to_mps: f64, time_s: f64) -> String {
    format!(
        "actions: [(name: \"drive\", does: Speed(target: Absolute(value_mps: {to_mps:?}), \
         dynamics: (shape: Linear, dimension: Time({time_s:?}))))],"
    )
}
