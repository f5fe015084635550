//! Motion of agents that follow a plan or deviate from it.

use std::sync::Arc;

use super::motion::DriveScene;
use super::plan_execution::{PlanRun, SampleSpan};
use super::story_execution::{deviation_of, motion_of};
use crate::ego::Phase;
use crate::sim::BodyCommand;
use crate::story::run::ElementChange;
use crate::story::values::SignalState;
use crate::story::view::SceneChange;

impl DriveScene {
    /// Returns whether any plan waits for a formula.
    fn is_watched(&self) -> bool {
        self.plans.iter().flatten().any(PlanRun::is_watching)
    }

    /// Returns the changes of the storyboard's elements so far, in the order of time.
    pub fn story_changes(&self) -> &[ElementChange] {
        self.story.as_ref().map_or(&[], |story| story.changes())
    }

    /// Returns the row of signals, which takes the memory of `self.row`.
    fn published(&mut self) -> Vec<f64> {
        // Taken out and put back, because publishing borrows the whole scene.
        let mut row = std::mem::take(&mut self.row);
        row.resize(self.layout.schema.len(), 0.0);
        self.publish_into(&mut row);
        row
    }

    /// Lets the actions of the storyboard begin that were due since the last sample.
    fn run_story(&mut self) {
        // Only formulas read a row, and publishing one costs time.
        if !self.layout.story_formulas.is_empty() {
            let row = self.published();
            if let Some(story) = &mut self.story {
                story.rate(&row, self.state.time_s());
            }
            self.row = row;
        }
        let Some(story) = &mut self.story else {
            return;
        };
        let changes = story.run(&self.layout, &self.state, &mut self.plans, &self.chosen);
        for change in changes {
            match change {
                SceneChange::Friction(friction) => self.state.set_friction(friction),
                SceneChange::TrafficSignal(light, state) => self.state.show(light, phase_of(state)),
                // Laws of plans.
                SceneChange::Add(..) | SceneChange::Delete(_) => {}
            }
        }
    }

    /// Advances every agent with a plan by one sample.
    pub(super) fn carry_all(&mut self) {
        if self.plans.is_empty() {
            return;
        }
        self.run_story();
        // A handle, because the loop below borrows the plans mutably.
        let layout = Arc::clone(&self.layout);
        // The end is computed from the sample number, so rounding errors do not
        // add up.
        let clock = layout.spec.clock;
        let (from_s, to_s) = (
            self.state.time_s(),
            (self.state.sample + 1) as f64 * clock.sample_s,
        );
        // Signals are published for plans only if a plan waits for a formula.
        if self.is_watched() {
            let row = self.published();
            for run in self.plans.iter_mut().flatten() {
                run.look(&row, from_s);
            }
            self.row = row;
        }
        for (i, run) in self.plans.iter_mut().enumerate() {
            let Some(run) = run else {
                continue;
            };
            let deviation = deviation_of(&layout.spec.agents[i].drive, self.chosen[i]);
            let span = SampleSpan {
                course: layout.network.course_of(i),
                road: layout.spec.road_of(i),
                network: &layout.network,
                spec: &layout.spec,
                // Nobody knows the sample to come, so all keep their acceleration.
                motion_of: &|agent: usize, at_s: f64| {
                    motion_of(&self.state.states[agent]).ahead(at_s - from_s)
                },
                from_s,
                to_s,
            };
            let arrival = run.advance(span, deviation);
            let to = arrival.pose;
            // A jump sweeps no ground, so it touches nothing on its way.
            let command = if run.take_jump() {
                BodyCommand::Jump { to }
            } else {
                BodyCommand::Carry { to }
            };
            self.commanded[i] = Some(command);
            self.arrivals[i] = arrival;
            self.state.plant.command(self.state.bodies[i], command);
        }
    }

    /// Sets the motion of planned agents at the end of a whole sample.
    ///
    /// Values come from the plan, because a plant only knows the mean over the
    /// sample.
    pub(super) fn arrive_all(&mut self) {
        let time_s = self.state.time_s();
        for (i, run) in self.plans.iter().enumerate() {
            let Some(run) = run else {
                continue;
            };
            let arrival = self.arrivals[i];
            let state = &mut self.state.states[i];
            state.speed_mps = arrival.speed_mps;
            state.lateral_mps = arrival.lateral_mps;
            state.yaw_rate_rad_per_s = arrival.yaw_rate_rad_per_s;
            state.accel_mps2 = arrival.accel_mps2;
            let course = self.layout.network.course_of(i);
            self.state.planned[i] = run.planned(course, time_s);
        }
    }

    /// Sets the planned motion of all agents at the instant of a contact.
    ///
    /// The planned position is interpolated to that instant. Its speed is the
    /// mean over the sample, like the speed of the body in the plant. An agent
    /// that adds nothing to its plan thus matches it in the last row as in
    /// every other.
    pub(super) fn stop_all(&mut self, after_s: f64) {
        let sample_s = self.layout.spec.clock.sample_s;
        let time_s = self.state.time_s();
        let share = after_s / sample_s;
        for (i, run) in self.plans.iter().enumerate() {
            let Some(run) = run else {
                continue;
            };
            // The plan has run to the end of the sample, and the contact cuts
            // it short.
            let arrived = run.planned(self.layout.network.course_of(i), time_s);
            let planned = &mut self.state.planned[i];
            let (ahead_m, left_m) = (
                arrived.s_m - planned.s_m,
                arrived.lateral_m - planned.lateral_m,
            );
            planned.s_m += share * ahead_m;
            planned.lateral_m += share * left_m;
            planned.speed_mps = libm::hypot(ahead_m, left_m) / sample_s;
        }
    }

    /// Sets the planned state of every agent at the start.
    pub(super) fn plans_begin(&mut self) {
        self.state.planned.clear();
        // Without plans the list stays empty, as `SceneState::planned` states.
        if self.plans.is_empty() {
            return;
        }
        let planned = self.plans.iter().enumerate().map(|(i, run)| {
            let course = self.layout.network.course_of(i);
            let run = run.as_ref();
            run.map(|run| run.planned(course, 0.0)).unwrap_or_default()
        });
        self.state.planned.extend(planned);
    }
}

fn phase_of(state: SignalState) -> Phase {
    match state {
        SignalState::Green => Phase::Green,
        SignalState::Yellow => Phase::Yellow,
        SignalState::Red => Phase::Red,
    }
}
