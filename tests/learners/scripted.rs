//! Episodes that are the same whatever is done in them.

use brakecheck::rl::{End, Env, Spaces, Step, TensorFile};

/// An episode written down: one more observation than rewards.
#[derive(Clone, Debug)]
pub struct Episode {
    pub observations: Vec<Vec<f32>>,
    pub rewards: Vec<f32>,
    pub end: End,
}

impl Episode {
    /// One that is always in the same place and pays nothing.
    pub fn still(decisions: usize) -> Episode {
        Episode {
            observations: vec![vec![0.0]; decisions + 1],
            rewards: vec![0.0; decisions],
            end: End::Terminated,
        }
    }

    /// One decision with this reward.
    pub fn paying(reward: f32) -> Episode {
        Episode {
            rewards: vec![reward],
            ..Episode::still(1)
        }
    }
}

/// Plays what `script` says for the index, and notes what was asked of it.
pub struct Scripted<'a> {
    spaces: Spaces,
    script: Box<dyn FnMut(u64) -> Episode + 'a>,
    episode: Episode,
    at: usize,
    /// The indices of the episodes, in order.
    pub starts: Vec<u64>,
    /// All actions, in order.
    pub actions: Vec<usize>,
}

impl<'a> Scripted<'a> {
    pub fn new(spaces: &Spaces, script: impl FnMut(u64) -> Episode + 'a) -> Scripted<'a> {
        Scripted {
            spaces: spaces.clone(),
            script: Box::new(script),
            episode: Episode::still(1),
            at: 0,
            starts: Vec::new(),
            actions: Vec::new(),
        }
    }
}

impl Env for Scripted<'_> {
    fn spaces(&self) -> &Spaces {
        &self.spaces
    }

    fn reset(&mut self, index: u64, obs: &mut [f32]) {
        self.starts.push(index);
        self.episode = (self.script)(index);
        self.at = 0;
        obs.copy_from_slice(&self.episode.observations[0]);
    }

    fn step(&mut self, action: usize, obs: &mut [f32]) -> Step {
        self.actions.push(action);
        let reward = self.episode.rewards[self.at];
        self.at += 1;
        obs.copy_from_slice(&self.episode.observations[self.at]);
        let over = self.at == self.episode.rewards.len();
        Step {
            reward,
            end: over.then_some(self.episode.end),
        }
    }
}

/// Gives a network with one hidden unit these outputs, whatever it is shown.
pub fn level(checkpoint: &mut TensorFile, prefix: &str, outputs: &[f32]) {
    let n = outputs.len();
    checkpoint.put(format!("{prefix}/0/bias"), &[1], vec![0.0f32]);
    checkpoint.put(format!("{prefix}/0/weight"), &[1, 1], vec![0.0f32]);
    checkpoint.put(format!("{prefix}/1/bias"), &[n], outputs.to_vec());
    checkpoint.put(format!("{prefix}/1/weight"), &[1, n], vec![0.0f32; n]);
}
