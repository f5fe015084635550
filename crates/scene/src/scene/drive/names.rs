//! Names of the agents in a driving world.

/// The names of road users, lights, weather and road, each in file order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AgentNames {
    /// The road users.
    pub agents: Vec<String>,
    /// The traffic lights.
    pub lights: Vec<String>,
    /// The weather, if an ado changes it.
    pub weather: Option<String>,
    /// The road, if an ado lays it.
    pub road: Option<String>,
    /// Names of the drawn parameters, which belong to no agent.
    pub parameters: Vec<String>,
}

/// A road user or a light, by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SignalOwner {
    Agent(usize),
    Light(usize),
}

impl AgentNames {
    /// Returns all names, road users first.
    pub fn all(&self) -> impl Iterator<Item = &String> {
        self.agents.iter().chain(&self.lights)
    }

    /// Returns the agent or light with a name.
    pub(super) fn who(&self, name: &str) -> Option<SignalOwner> {
        let agent = self.agents.iter().position(|agent| agent == name);
        let light = || self.lights.iter().position(|light| light == name);
        agent
            .map(SignalOwner::Agent)
            .or_else(|| light().map(SignalOwner::Light))
    }
}
