//! Who is in a driving world, by name.

/// The names of road users and lights, each in file order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AgentNames {
    /// The road users.
    pub agents: Vec<String>,
    /// The traffic lights.
    pub lights: Vec<String>,
    /// The numbers that a start draws besides where everybody is.
    pub parameters: Vec<String>,
}

/// Somebody in a world: a road user or a light, by position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    Agent(usize),
    Light(usize),
}

impl AgentNames {
    /// All names, road users first.
    pub fn all(&self) -> impl Iterator<Item = &String> {
        self.agents.iter().chain(&self.lights)
    }

    /// Who has a name.
    pub(super) fn who(&self, name: &str) -> Option<Who> {
        let agent = self.agents.iter().position(|agent| agent == name);
        let light = || self.lights.iter().position(|light| light == name);
        agent.map(Who::Agent).or_else(|| light().map(Who::Light))
    }
}
