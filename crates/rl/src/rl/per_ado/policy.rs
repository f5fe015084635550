//! Policy of all ados, made of a policy per ado.

use crate::rl::bundle::{BundleError, TensorFile};
use crate::rl::{PartSpaces, Policy, Spaces};

/// Kind of a kept policy.
pub(super) const POLICY: &str = "brakecheck per-ado policy 1";

/// Policy of one ado in a joint observation.
struct PartPolicy {
    spaces: PartSpaces,
    policy: Box<dyn Policy>,
}

/// Joint policy: each ado acts on its own observation.
pub(super) struct PerAdoPolicy {
    observation: usize,
    parts: Vec<PartPolicy>,
}

impl PartPolicy {
    fn seen(&self, joint: &[f32]) -> Vec<f32> {
        self.spaces.observed.iter().map(|&at| joint[at]).collect()
    }
}

impl Policy for PartPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        self.policy.act(&self.seen(obs))
    }

    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        self.policy.act_among(&self.seen(obs), allowed)
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        self.policy.sample(&self.seen(obs), temperature, units)
    }

    fn value(&self, obs: &[f32]) -> f32 {
        self.policy.value(&self.seen(obs))
    }

    fn action_values(&self, obs: &[f32]) -> Option<Vec<f32>> {
        self.policy.action_values(&self.seen(obs))
    }
}

impl PerAdoPolicy {
    /// Creates the joint policy of ados, in the order of their digits.
    pub(super) fn new(
        observation: usize,
        parts: impl Iterator<Item = (PartSpaces, Box<dyn Policy>)>,
    ) -> PerAdoPolicy {
        let parts = parts.map(|(spaces, policy)| PartPolicy { spaces, policy });
        PerAdoPolicy {
            observation,
            parts: parts.collect(),
        }
    }

    /// Loads a kept policy.
    ///
    /// # Errors
    /// The bundle is damaged, or a part is no policy of its own shapes.
    pub(super) fn load(bundle: &TensorFile) -> Result<PerAdoPolicy, BundleError> {
        let (observation, parts) = read(bundle)?;
        let parts = parts.into_iter().map(|(spaces, bundle)| {
            let policy = load_part(&spaces, &bundle)?;
            Ok(PartPolicy { spaces, policy })
        });
        Ok(PerAdoPolicy {
            observation,
            parts: parts.collect::<Result<_, BundleError>>()?,
        })
    }

    /// Returns the lengths of the joint observation and of the joint action set.
    pub(super) fn shape(&self) -> [usize; 2] {
        let actions = self.parts.iter().map(|part| part.spaces.actions);
        [self.observation, actions.product()]
    }

    fn joint(&self, mut of: impl FnMut(&PartPolicy) -> usize) -> usize {
        let (mut joint, mut unit) = (0, 1);
        for part in &self.parts {
            joint += unit * of(part);
            unit *= part.spaces.actions;
        }
        joint
    }
}

impl Policy for PerAdoPolicy {
    fn act(&self, obs: &[f32]) -> usize {
        self.joint(|part| part.act(obs))
    }

    /// The ados choose in turn, each among the actions that those before it leave.
    fn act_among(&self, obs: &[f32], allowed: &[bool]) -> usize {
        let (mut joint, mut unit) = (0, 1);
        for part in &self.parts {
            let actions = part.spaces.actions;
            let own: Vec<bool> = (0..actions)
                .map(|action| {
                    // Digits so far leave a grid of joint actions, over which later
                    // ados decide.
                    let chosen = joint + unit * action;
                    let mut rest = allowed
                        .iter()
                        .enumerate()
                        .skip(chosen)
                        .step_by(unit * actions);
                    rest.any(|(_, &allowed)| allowed)
                })
                .collect();
            joint += unit * part.act_among(obs, &own);
            unit *= actions;
        }
        joint
    }

    fn sample(&self, obs: &[f32], temperature: f64, units: &mut dyn FnMut() -> f64) -> usize {
        self.joint(|part| part.sample(obs, temperature, units))
    }

    /// The mean of the ados' values.
    fn value(&self, obs: &[f32]) -> f32 {
        let sum: f32 = self.parts.iter().map(|part| part.value(obs)).sum();
        sum / self.parts.len().max(1) as f32
    }

    /// The mean over the ados of the values of their shares of a joint action.
    fn action_values(&self, obs: &[f32]) -> Option<Vec<f32>> {
        let ados = self.parts.len().max(1) as f32;
        let mut joint = vec![0.0];
        for part in &self.parts {
            let own = part.action_values(obs)?;
            // The first ado is the lowest digit of a joint action.
            let sums = own
                .iter()
                .flat_map(|value| joint.iter().map(move |sum: &f32| sum + value / ados));
            joint = sums.collect();
        }
        Some(joint)
    }
}

/// Policy of one ado, with its place in the joint observation.
type OwnPolicy = (PartSpaces, Box<dyn Policy>);

/// Returns the policy of the ado `name` in a joint policy for a world with these spaces.
///
/// Its observation is its own part of the joint one. `None`: the bundle is no policy per
/// ado, or has no such ado.
///
/// # Errors
/// The bundle is damaged, or of other ados than the world's.
pub fn policy_of_part(
    spaces: &Spaces,
    bundle: &TensorFile,
    name: &str,
) -> Result<Option<OwnPolicy>, BundleError> {
    // Any other policy decides for all ados together and has no parts.
    if bundle.meta() != POLICY {
        return Ok(None);
    }
    let policy = PerAdoPolicy::load(bundle)?;
    let expected = [spaces.observation, spaces.actions];
    let what = "the policy's observation and actions";
    crate::rl::learner::expect_sizes(what, &policy.shape(), &expected)?;
    let mut parts = policy.parts.into_iter();
    let own = parts.find(|part| part.spaces.name == name);
    Ok(own.map(|part| (part.spaces, part.policy)))
}

fn load_part(spaces: &PartSpaces, bundle: &TensorFile) -> Result<Box<dyn Policy>, BundleError> {
    // Nested policies would recurse as deep as a file demands.
    if bundle.meta() == POLICY {
        return Err(damaged("a policy per ado inside another"));
    }
    let (policy, shape) = crate::rl::list::load_shaped(bundle)?;
    let expected = [spaces.observed.len(), spaces.actions];
    crate::rl::learner::expect_sizes("an ado's observation and actions", &shape, &expected)?;
    Ok(policy)
}

/// Writes the bundles of ados, with the spaces of each.
pub(super) fn save(
    bundle: &mut TensorFile,
    observation: usize,
    actions: usize,
    parts: Vec<(PartSpaces, TensorFile)>,
) {
    bundle.put("joint", &[2], vec![observation as u64, actions as u64]);
    let spaces: Vec<&PartSpaces> = parts.iter().map(|(spaces, _)| spaces).collect();
    // Invariant: names and numbers can always be written, and so can a made bundle.
    let text = serde_json::to_vec(&spaces).unwrap_or_default();
    bundle.put("parts", &[text.len()], text);
    for (i, (_, part)) in parts.iter().enumerate() {
        let bytes = part.to_bytes().unwrap_or_default();
        bundle.put(format!("part/{i}"), &[bytes.len()], bytes);
    }
}

/// Reads the length of the joint observation, and the ados with their bundles.
fn read(bundle: &TensorFile) -> Result<(usize, Vec<(PartSpaces, TensorFile)>), BundleError> {
    let joint = bundle.get::<u64>("joint", &[2])?;
    let (observation, actions) = (joint[0] as usize, joint[1] as usize);
    let text = bundle.rows::<u8>("parts", &[])?;
    let spaces: Vec<PartSpaces> =
        serde_json::from_slice(text).map_err(|error| damaged(&error.to_string()))?;
    // Checked, because the file may name sets whose product overflows.
    let mut product = Some(1usize);
    for part in &spaces {
        product = product.and_then(|product| product.checked_mul(part.actions));
        // The comparison with the neutral action also refuses an ado without any.
        let outside = part.observed.iter().any(|&at| observation <= at);
        if outside || part.actions <= part.neutral {
            return Err(damaged("an ado with other spaces than the joint policy"));
        }
    }
    if product != Some(actions) || spaces.is_empty() {
        return Err(damaged(
            "joint actions that are no product of those of the ados",
        ));
    }
    let parts = spaces.into_iter().enumerate().map(|(i, spaces)| {
        let bytes = bundle.rows::<u8>(&format!("part/{i}"), &[])?;
        Ok((spaces, TensorFile::from_bytes(bytes)?))
    });
    Ok((observation, parts.collect::<Result<_, BundleError>>()?))
}

/// Returns the bundles of these ados.
///
/// # Errors
/// The bundle is damaged, or of other ados.
pub(super) fn bundles(
    bundle: &TensorFile,
    expected: &[PartSpaces],
) -> Result<Vec<TensorFile>, BundleError> {
    let (_, parts) = read(bundle)?;
    let found: Vec<&PartSpaces> = parts.iter().map(|(spaces, _)| spaces).collect();
    if found != expected.iter().collect::<Vec<_>>() {
        let names = |parts: &mut dyn Iterator<Item = &PartSpaces>| {
            let words: Vec<String> = parts
                .map(|part| format!("{} of {} actions", part.name, part.actions))
                .collect();
            words.join(", ")
        };
        return Err(BundleError::Mismatch {
            what: "the ados of the bundle",
            expected: names(&mut expected.iter()),
            found: names(&mut found.into_iter()),
        });
    }
    Ok(parts.into_iter().map(|(_, bundle)| bundle).collect())
}

fn damaged(why: &str) -> BundleError {
    BundleError::Format {
        why: why.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values that do not depend on the observation.
    struct Valued(Vec<f32>);

    impl Policy for Valued {
        fn act(&self, _obs: &[f32]) -> usize {
            crate::rl::nn::argmax(&self.0)
        }

        fn value(&self, _obs: &[f32]) -> f32 {
            0.0
        }

        fn action_values(&self, _obs: &[f32]) -> Option<Vec<f32>> {
            (!self.0.is_empty()).then(|| self.0.clone())
        }
    }

    fn joint(values: &[&[f32]]) -> PerAdoPolicy {
        let parts = values.iter().map(|values| {
            let spaces = PartSpaces {
                name: "ado".to_owned(),
                actions: values.len(),
                neutral: 0,
                observed: Vec::new(),
            };
            let policy: Box<dyn Policy> = Box::new(Valued(values.to_vec()));
            (spaces, policy)
        });
        PerAdoPolicy::new(0, parts)
    }

    #[test]
    fn values_of_joint_actions_are_the_means_of_those_of_their_digits() {
        let policy = joint(&[&[0.0, 1.0], &[0.5, 0.25, 0.75]]);
        let values = policy.action_values(&[]).expect("both have values");
        assert_eq!(values, [0.25, 0.75, 0.125, 0.625, 0.375, 0.875]);
        assert_eq!(crate::rl::nn::argmax(&values), policy.act(&[]));
        // Without the values of one ado there are none of joint actions.
        assert_eq!(joint(&[&[0.0, 1.0], &[]]).action_values(&[]), None);
    }
}
