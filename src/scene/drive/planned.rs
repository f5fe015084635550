//! A plan in motion: where somebody who keeps to it is, sample by sample.
//!
//! What moves by the laws is the rear axle, or the middle of who is on foot;
//! the body lies along its velocity. Laws that begin or end within a sample do
//! so at their instant, not at the sample's: between those, speeds change
//! evenly and sideways is a closed form, so that nothing adds up over time.

use core::f64::consts::PI;
use std::sync::Arc;

use super::course::{Course, wrapped};
use super::plan::{Approach, MotionLaw, MotionPlan, ScriptStep, Unmet};
use super::road::Road;
use crate::sim::Pose;
use crate::stl::{Monitor, OnlineMonitor};

/// Two instants that are as near as this are one.
const SAME_S: f64 = 1e-9;
/// Slower than this a body keeps its heading.
const TURNING_MPS: f64 = 0.05;
/// No car strays sideways faster than this share of its speed.
const MAX_SLIP: f64 = 0.4;

/// Where a plan has somebody: the front bumper on its road, and the speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PlannedAt {
    pub s_m: f64,
    pub lateral_m: f64,
    pub speed_mps: f64,
}

/// What of somebody does not change while the plan goes on.
#[derive(Clone, Debug)]
pub(super) struct Carried {
    /// From the point that moves by the laws to the front.
    pub lever_m: f64,
    /// Where it faces, from the road's direction.
    pub facing_rad: f64,
    pub on_foot: bool,
    /// The formulas of its steps, each as "has once been true".
    pub whens: Arc<[Option<Monitor>]>,
}

/// By how much somebody has strayed from its plan, as it faces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Stray {
    ahead_m: f64,
    ahead_mps: f64,
    left_m: f64,
    left_mps: f64,
}

/// How a body arrives at the end of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Arrival {
    pub pose: Pose,
    /// Along the heading.
    pub speed_mps: f64,
    /// To the left of it, at the front.
    pub lateral_mps: f64,
    pub yaw_rate_rad_per_s: f64,
    pub accel_mps2: f64,
}

/// A speed that changes evenly.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    begins_s: f64,
    from_mps: f64,
    to_mps: f64,
    /// At least 0; without bound: at once.
    rate_mps2: f64,
}

/// A motion across the road along a cosine.
#[derive(Clone, Copy, Debug)]
struct Swing {
    begins_s: f64,
    lasts_s: f64,
    by_m: f64,
    /// Whether what is driven sideways is missing ahead.
    is_slanted: bool,
}

#[derive(Clone, Debug)]
enum Phase {
    /// Until the formula of the step comes true.
    Waits {
        since_s: f64,
        /// When it was looked at before, and how far it was from true.
        before: Option<(f64, f64)>,
        watch: Box<OnlineMonitor>,
    },
    /// Until it is time.
    Due(f64),
    Acts {
        ends_s: f64,
    },
    /// There is no step any more.
    Over,
}

/// Somebody on the way.
#[derive(Clone, Debug)]
pub(super) struct PlanRun {
    carried: Carried,
    steps: Vec<ScriptStep<f64, ()>>,
    step: usize,
    phase: Phase,
    ramp: Ramp,
    swing: Option<Swing>,
    /// The point that moves by the laws, on its road.
    s_m: f64,
    lateral_m: f64,
    /// Where it starts beside the road, by which its lane is told, and by how
    /// much it has changed lanes since.
    start_m: f64,
    changed_m: f64,
    /// From the road's direction, and the same without what it has strayed.
    heading_rad: f64,
    planned_rad: f64,
    stray: Stray,
    last: Arrival,
}

impl Ramp {
    fn steady(speed_mps: f64) -> Ramp {
        Ramp {
            begins_s: 0.0,
            from_mps: speed_mps,
            to_mps: speed_mps,
            rate_mps2: f64::INFINITY,
        }
    }

    fn lasts_s(&self) -> f64 {
        match self.from_mps == self.to_mps {
            true => 0.0,
            false => (self.to_mps - self.from_mps).abs() / self.rate_mps2,
        }
    }

    fn ends_s(&self) -> f64 {
        self.begins_s + self.lasts_s()
    }

    fn speed_mps(&self, time_s: f64) -> f64 {
        if self.ends_s() - SAME_S <= time_s {
            return self.to_mps;
        }
        let for_s = (time_s - self.begins_s).max(0.0);
        self.from_mps + (self.to_mps - self.from_mps) * for_s / self.lasts_s()
    }

    /// The way between two instants, none of them within it its end.
    fn way_m(&self, from_s: f64, to_s: f64) -> f64 {
        0.5 * (self.speed_mps(from_s) + self.speed_mps(to_s)) * (to_s - from_s)
    }
}

impl Swing {
    fn way_m(&self, time_s: f64) -> f64 {
        if self.lasts_s <= 0.0 {
            return self.by_m;
        }
        let share = ((time_s - self.begins_s) / self.lasts_s).clamp(0.0, 1.0);
        0.5 * self.by_m * (1.0 - libm::cos(PI * share))
    }

    fn speed_mps(&self, time_s: f64) -> f64 {
        let share = (time_s - self.begins_s) / self.lasts_s;
        match 0.0 < self.lasts_s && (0.0..1.0).contains(&share) {
            true => 0.5 * self.by_m * PI / self.lasts_s * libm::sin(PI * share),
            false => 0.0,
        }
    }
}

/// What a sample asks of a plan: the road, its course, from when to when.
#[derive(Clone, Copy)]
pub(super) struct SampleSpan<'a> {
    pub course: &'a Course,
    pub road: &'a Road,
    pub from_s: f64,
    pub to_s: f64,
}

impl PlanRun {
    /// Begins with the front at a place of the road, as if it were straight
    /// there: on bends the body lies along the tangent at its rear axle.
    ///
    /// # Errors
    /// A meeting that cannot be.
    pub fn begin(
        carried: Carried,
        plan: MotionPlan<f64, ()>,
        (front_m, lateral_m, speed_mps): (f64, f64, f64),
        ego: (f64, f64),
    ) -> Result<PlanRun, Unmet> {
        let (cos, sin) = carried.direction();
        let (speed_mps, steps) = match plan {
            MotionPlan::Script(steps) => (speed_mps, steps),
            MotionPlan::Meet(meet) => {
                let way_m = match cos.abs() < sin.abs() {
                    true => sin.signum() * (meet.here_at_m - lateral_m),
                    false => cos.signum() * (meet.here_at_m - front_m),
                };
                let approach = meet.approach(ego, way_m)?;
                (approach.from_mps, vec![approach_step(approach)])
            }
        };
        let mut run = PlanRun {
            steps,
            step: 0,
            phase: Phase::Over,
            ramp: Ramp::steady(speed_mps),
            swing: None,
            s_m: front_m - carried.lever_m * cos,
            lateral_m: lateral_m - carried.lever_m * sin,
            start_m: lateral_m,
            changed_m: 0.0,
            heading_rad: carried.facing_rad,
            planned_rad: carried.facing_rad,
            stray: Stray::default(),
            last: Arrival {
                speed_mps,
                ..Arrival::default()
            },
            carried,
        };
        run.phase = run.turn_of(0, 0.0);
        Ok(run)
    }

    /// The speed now, as planned.
    pub fn speed_mps(&self) -> f64 {
        self.ramp.speed_mps(self.ramp.begins_s)
    }

    /// Whether it waits for a formula, which reads rows.
    pub fn is_watching(&self) -> bool {
        matches!(self.phase, Phase::Waits { .. })
    }

    /// Looks at a sample: does what the next step waits for hold?
    ///
    /// The instant at which it came true is taken from ρ before and now, as if
    /// that went evenly from one sample to the next.
    pub fn look(&mut self, row: &[f64], time_s: f64) {
        let Phase::Waits {
            since_s,
            before,
            watch,
        } = &mut self.phase
        else {
            return;
        };
        // A row that is not finite ends the episode elsewhere.
        let Ok(seen) = watch.push(row) else {
            return;
        };
        let now = seen.lo;
        if now < 0.0 {
            *before = Some((time_s, now));
            return;
        }
        let came_s = match *before {
            Some((at_s, rho)) if rho.is_finite() && now.is_finite() => {
                at_s + (time_s - at_s) * (-rho / (now - rho))
            }
            Some(_) => time_s,
            // It held when it was first looked at.
            None => *since_s,
        };
        self.phase = Phase::Due(came_s + self.steps[self.step].after_s);
    }

    /// Moves on by a sample; `asked` is what an ado adds: an acceleration along
    /// and a speed to the left of where it faces.
    pub fn advance(
        &mut self,
        stretch: SampleSpan<'_>,
        asked: (f64, f64),
        speed_of: impl Fn(&str) -> f64,
    ) -> Arrival {
        let SampleSpan { from_s, to_s, .. } = stretch;
        let mut time_s = from_s;
        loop {
            self.settle(time_s, stretch.road, &speed_of);
            if to_s - SAME_S <= time_s {
                break;
            }
            let next_s = self.next_change_s(time_s).min(to_s);
            self.move_on(stretch.course, time_s, next_s);
            time_s = next_s;
        }
        let sample_s = to_s - from_s;
        let speed_mps = self.ramp.speed_mps(to_s);
        self.stray_on(asked, speed_mps, sample_s);
        let sideways_mps = self.swing.map_or(0.0, |swing| swing.speed_mps(to_s));
        self.arrive(stretch.course, (speed_mps, sideways_mps), sample_s)
    }

    /// Where the plan has it, whatever it has strayed.
    pub fn planned(&self, course: &Course, time_s: f64) -> PlannedAt {
        let at = course.locate(&self.front(course, Stray::default(), self.planned_rad));
        PlannedAt {
            s_m: at.s_m,
            lateral_m: at.lateral_m,
            speed_mps: self.ramp.speed_mps(time_s),
        }
    }

    /// The front bumper now.
    pub fn pose(&self, course: &Course) -> Pose {
        self.front(course, self.stray, self.heading_rad)
    }

    fn front(&self, course: &Course, stray: Stray, heading_rad: f64) -> Pose {
        let (cos, sin) = self.carried.direction();
        let s_m = self.s_m + cos * stray.ahead_m - sin * stray.left_m;
        let lateral_m = self.lateral_m + sin * stray.ahead_m + cos * stray.left_m;
        let at = course.pose(s_m, lateral_m);
        let heading_rad = wrapped(at.heading_rad + heading_rad);
        let (sin, cos) = libm::sincos(heading_rad);
        Pose {
            x_m: at.x_m + self.carried.lever_m * cos,
            y_m: at.y_m + self.carried.lever_m * sin,
            heading_rad,
        }
    }

    /// What a step that has its turn from an instant on waits for.
    fn turn_of(&self, step: usize, since_s: f64) -> Phase {
        let Some(next) = self.steps.get(step) else {
            return Phase::Over;
        };
        match self.carried.whens.get(step).and_then(Option::as_ref) {
            Some(monitor) => Phase::Waits {
                since_s,
                before: None,
                watch: Box::new(monitor.online()),
            },
            None => Phase::Due(since_s + next.after_s),
        }
    }

    /// Begins and ends the steps whose time has come.
    fn settle(&mut self, time_s: f64, road: &Road, speed_of: &impl Fn(&str) -> f64) {
        loop {
            match self.phase {
                Phase::Due(at_s) if at_s <= time_s + SAME_S => {
                    let ends_s = self.act(at_s, time_s, road, speed_of);
                    self.phase = Phase::Acts { ends_s };
                }
                Phase::Acts { ends_s } if ends_s <= time_s + SAME_S => {
                    if let Some(MotionLaw::Walk { .. }) = self.steps[self.step].does.first() {
                        self.ramp = Ramp::steady(0.0);
                    }
                    self.swing = None;
                    self.step += 1;
                    self.phase = self.turn_of(self.step, ends_s);
                }
                _ => return,
            }
        }
    }

    fn next_change_s(&self, time_s: f64) -> f64 {
        let step_s = match self.phase {
            Phase::Due(at_s) => at_s,
            Phase::Acts { ends_s } => ends_s,
            Phase::Waits { .. } | Phase::Over => f64::INFINITY,
        };
        let swing = self.swing.map(|it| it.begins_s + it.lasts_s);
        let changes = [Some(step_s), Some(self.ramp.ends_s()), swing];
        let later = changes.into_iter().flatten();
        let later = later.filter(|at_s| time_s + SAME_S < *at_s);
        later.fold(f64::INFINITY, f64::min)
    }

    /// Begins the laws of a step that was due at an instant, maybe before this
    /// one, and says when all have ended.
    fn act(&mut self, at_s: f64, now_s: f64, road: &Road, speed_of: &impl Fn(&str) -> f64) -> f64 {
        let from_mps = self.ramp.speed_mps(now_s);
        let mut ends_s = at_s;
        let laws = self.steps[self.step].does.clone();
        for law in &laws {
            let mut to_speed = |to_mps: f64, rate_mps2: f64| {
                self.ramp = Ramp {
                    begins_s: at_s,
                    from_mps,
                    to_mps: to_mps.max(0.0),
                    rate_mps2: rate_mps2.abs(),
                };
                self.ramp.ends_s()
            };
            let law_ends_s = match law {
                MotionLaw::Speed {
                    to_mps,
                    relative_to,
                    rate_mps2,
                } => {
                    let base_mps = relative_to.as_deref().map_or(0.0, speed_of);
                    to_speed(base_mps + to_mps, rate_mps2.unwrap_or(f64::INFINITY))
                }
                MotionLaw::Brake { rate_mps2 } => to_speed(0.0, *rate_mps2),
                MotionLaw::Walk { speed_mps, way_m } => {
                    to_speed(*speed_mps, f64::INFINITY);
                    at_s + way_m / speed_mps
                }
                MotionLaw::LaneChange { by_m, rate_mps } => {
                    let lasts_s = PI * by_m.abs() / (2.0 * rate_mps);
                    self.changed_m += by_m;
                    self.sway(at_s, lasts_s, *by_m, true)
                }
                MotionLaw::LaneOffset {
                    to_m,
                    most_lateral_mps2,
                } => {
                    let lane = road.lane_at(self.start_m);
                    let middle_m = road.lane_middle_m(lane) + self.changed_m;
                    let by_m = middle_m + to_m - self.lateral_m;
                    let lasts_s = PI * (by_m.abs() / (2.0 * most_lateral_mps2)).sqrt();
                    self.sway(at_s, lasts_s, by_m, false)
                }
            };
            ends_s = ends_s.max(law_ends_s);
        }
        // What began before now has gone on since, along and across.
        let missed_m = self.ramp.way_m(at_s, now_s) - from_mps * (now_s - at_s);
        if at_s < now_s {
            let (cos, sin) = self.carried.direction();
            self.s_m += cos * missed_m;
            self.lateral_m += sin * missed_m;
        }
        if let Some(swing) = self.swing.filter(|swing| swing.begins_s < now_s) {
            self.lateral_m += swing.way_m(now_s);
        }
        ends_s
    }

    fn sway(&mut self, begins_s: f64, lasts_s: f64, by_m: f64, is_slanted: bool) -> f64 {
        self.swing = Some(Swing {
            begins_s,
            lasts_s,
            by_m,
            is_slanted,
        });
        begins_s + lasts_s
    }

    /// Between two instants at which no law begins or ends.
    fn move_on(&mut self, course: &Course, from_s: f64, to_s: f64) {
        let way_m = self.ramp.way_m(from_s, to_s);
        let (aside_m, is_slanted) = match self.swing {
            Some(swing) => (swing.way_m(to_s) - swing.way_m(from_s), swing.is_slanted),
            None => (0.0, false),
        };
        let ahead_m = match is_slanted {
            true => (way_m * way_m - aside_m * aside_m).max(0.0).sqrt(),
            false => way_m,
        };
        let (cos, sin) = self.carried.direction();
        // Beside a bend the same way is another piece of the course.
        let middle_m = self.lateral_m + 0.5 * (aside_m + sin * ahead_m);
        let shorter = 1.0 - course.curvature_per_m(self.s_m) * middle_m;
        self.s_m += cos * ahead_m / shorter;
        self.lateral_m += sin * ahead_m + aside_m;
    }

    /// Adds what an ado asks for to what it has strayed already.
    fn stray_on(&mut self, (accel_mps2, left_mps): (f64, f64), planned_mps: f64, sample_s: f64) {
        let before_mps = self.stray.ahead_mps;
        // Nobody reverses.
        let ahead_mps = (before_mps + accel_mps2 * sample_s).max(-planned_mps);
        let most_mps = match self.carried.on_foot {
            true => f64::INFINITY,
            false => MAX_SLIP * (planned_mps + ahead_mps),
        };
        let left_mps = left_mps.clamp(-most_mps, most_mps);
        self.stray.ahead_mps = ahead_mps;
        self.stray.ahead_m += 0.5 * (before_mps.max(-planned_mps) + ahead_mps) * sample_s;
        self.stray.left_mps = left_mps;
        self.stray.left_m += left_mps * sample_s;
    }

    fn arrive(
        &mut self,
        course: &Course,
        (speed_mps, sideways_mps): (f64, f64),
        sample_s: f64,
    ) -> Arrival {
        let (cos, sin) = self.carried.direction();
        let is_slanted = self.swing.is_some_and(|swing| swing.is_slanted);
        let ahead = |along_mps: f64| match is_slanted {
            true => (along_mps * along_mps - sideways_mps * sideways_mps)
                .max(0.0)
                .sqrt(),
            false => along_mps,
        };
        let along_mps = speed_mps + self.stray.ahead_mps;
        let ahead_mps = ahead(along_mps);
        let left_mps = self.stray.left_mps;
        let velocity = (
            cos * ahead_mps - sin * left_mps,
            sin * ahead_mps + cos * left_mps + sideways_mps,
        );
        let moves = TURNING_MPS <= ahead_mps.max(sideways_mps.abs());
        if !self.carried.on_foot && moves {
            self.heading_rad = libm::atan2(velocity.1, velocity.0);
        }
        let planned_mps = ahead(speed_mps);
        if !self.carried.on_foot && TURNING_MPS <= planned_mps.max(sideways_mps.abs()) {
            let aside_mps = sin * planned_mps + sideways_mps;
            self.planned_rad = libm::atan2(aside_mps, cos * planned_mps);
        }
        let before = self.last;
        let pose = self.pose(course);
        let turn_rad = wrapped(pose.heading_rad - before.pose.heading_rad);
        let yaw_rate_rad_per_s = turn_rad / sample_s;
        let (facing_sin, facing_cos) = libm::sincos(self.heading_rad);
        let arrival = Arrival {
            pose,
            speed_mps: match self.carried.on_foot {
                true => velocity.0 * facing_cos + velocity.1 * facing_sin,
                false => along_mps,
            },
            lateral_mps: match self.carried.on_foot {
                true => velocity.1 * facing_cos - velocity.0 * facing_sin,
                false => yaw_rate_rad_per_s * self.carried.lever_m,
            },
            yaw_rate_rad_per_s,
            accel_mps2: 0.0,
        };
        self.last = Arrival {
            accel_mps2: (arrival.speed_mps - before.speed_mps) / sample_s,
            ..arrival
        };
        self.last
    }

    /// Notes where it begins, so that the first sample has one before it.
    pub fn begun(&mut self, pose: Pose) {
        self.last.pose = pose;
    }
}

impl Carried {
    /// Cosine and sine of where it faces; cars face along the road.
    fn direction(&self) -> (f64, f64) {
        match self.on_foot {
            true => {
                let (sin, cos) = libm::sincos(self.facing_rad);
                (cos, sin)
            }
            false => (libm::cos(self.facing_rad).signum(), 0.0),
        }
    }
}

/// The one step of a meeting.
fn approach_step(approach: Approach) -> ScriptStep<f64, ()> {
    let Approach {
        begins_s,
        accel_mps2,
        to_mps,
        ..
    } = approach;
    ScriptStep {
        when: None,
        after_s: begins_s,
        does: vec![MotionLaw::Speed {
            to_mps,
            relative_to: None,
            rate_mps2: accel_mps2.is_finite().then_some(accel_mps2),
        }],
    }
}
