//! Worlds to train the traffic in: their ados observe all that a law of actions needs.

use super::Scenario;
use crate::rl::{LearnerSettings, TrafficSettings};
use crate::ron_file::{Problem, ScenarioError};
use crate::scene::drive::DriveSpec;
use crate::world_file::{
    self, AdoFile, AgentFile, DeclaredTrafficFile, DescribedSignal, DriveFile, SignalFile,
    WorldFile,
};

/// Signal that a law of actions reads.
#[derive(Clone, Debug, PartialEq)]
pub struct LawSignal {
    /// Name in the world.
    pub name: String,
    /// Expression of its value.
    pub expr: String,
    /// Meaning in a sentence.
    pub about: String,
}

impl Scenario {
    /// Returns the world in which the learner of a law is trained.
    ///
    /// Its ados observe `time_left` and the signals of the law as well, unscaled, and
    /// `learner` gets the positions of these signals. Its text is that of a world file, so
    /// that run directories, kept counterexamples and placed ados need nothing else.
    ///
    /// # Errors
    /// The world is a grid, or a signal does not fit it.
    pub fn learning_in_traffic(
        &self,
        laws: &DeclaredTrafficFile,
        signals: &[LawSignal],
        learner: impl FnOnce(&[usize]) -> TrafficSettings,
    ) -> Result<Scenario, ScenarioError> {
        let name = format!("{}.ron", self.name);
        let WorldFile::Scenario(mut file) = world_file::parse(&name, &self.text)? else {
            return Err(without_place(name, "a grid has no traffic"));
        };
        let mut observed: Vec<String> = self
            .world
            .observed()
            .iter()
            .map(|observed| observed.name.clone())
            .collect();
        // Without the remaining time, the same state would be worth several values.
        if !observed.iter().any(|name| name == "time_left") {
            observed.push("time_left".to_owned());
        }
        let first = observed.len();
        for signal in signals {
            observed.push(signal.name.clone());
            let described = DescribedSignal {
                expr: signal.expr.clone(),
                unit: None,
                about: Some(signal.about.clone()),
                // Observed as it is: the law reads numbers and no shares of a range.
                range: Some((-1.0, 1.0)),
            };
            let signal_file = SignalFile::Described(described);
            file.signals.0.insert(signal.name.clone(), signal_file);
        }
        for ado in file.agents.iter_mut().filter_map(ado_of) {
            // All of them list all, so that no default moves a signal to another position.
            ado.observe = Some(observed.clone());
            // The learner of the law trains all of them.
            ado.learner = None;
        }
        let positions: Vec<usize> = (first..observed.len()).collect();
        file.learner = LearnerSettings::Traffic(learner(&positions));
        // The law has no preference among failures.
        file.goals = None;
        file.traffic = Some(laws.clone());
        let text = world_file::text(&WorldFile::Scenario(file))
            .map_err(|error| without_place(name.clone(), &error.to_string()))?;
        Ok(self.with_own_parts(Scenario::parse(&name, &text)?))
    }

    /// Returns a world of another text with the parts of this one that no text has.
    fn with_own_parts(&self, written: Scenario) -> Scenario {
        let own = self.drive().map(|driving| driving.spec().clone());
        let keep = |spec: &mut DriveSpec| {
            if let Some(own) = &own {
                spec.plant = own.plant;
                spec.ego = own.ego.clone();
            }
        };
        Scenario {
            programs_allowed: self.programs_allowed,
            fresh_egos: self.fresh_egos,
            traffic: self.traffic.clone(),
            repeats: self.repeats,
            ..written.redriven(keep)
        }
    }
}

fn ado_of(agent: &mut AgentFile) -> Option<&mut AdoFile> {
    match agent {
        AgentFile::Vehicle {
            drive: DriveFile::Ado(ado),
            ..
        }
        | AgentFile::Pedestrian {
            drive: DriveFile::Ado(ado),
            ..
        } => Some(ado),
        _ => None,
    }
}

fn without_place(file: String, what: &str) -> ScenarioError {
    ScenarioError {
        file,
        text: String::new(),
        problems: vec![Problem {
            what: what.to_owned(),
            span: 0..0,
            label: "not written".to_owned(),
            help: None,
        }],
    }
}
