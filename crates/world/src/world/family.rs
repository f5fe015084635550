//! Family of egos and plants that an ado can be trained against.
//!
//! `train_against` of a world file names ranges over the parameters of its ego,
//! over the ego's sensors and the road, and the plants to train on. A
//! [`EgoSample`] is one point of the family. An ado trained against the complete
//! family is *wide*.
//!
//! Members are drawn per episode from the episode's own key. They depend on no
//! thread and no earlier episode.

use std::fmt;

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::quantity::{Quantity, Varied, parameter};
use super::structure::Structure;
use crate::ego::{Actuated, ControllerSpec, Process};
use crate::rl::LearnerConfig;
use crate::ron_file::Patch;
use crate::scene::drive::EgoVariant;
use crate::seed::StartKey;
use crate::sim::PlantKind;
use crate::stats::pick;
use crate::world_file::Change;

/// Share of the members that are nominal in every quantity.
const PURE: f64 = 0.15;

/// Training opponent of an ado.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    Serialize,
    Deserialize,
    VariantArray,
    EnumString,
    IntoStaticStr,
    EnumMessage,
)]
#[serde(rename_all = "lowercase")]
#[strum(serialize_all = "kebab-case")]
pub enum TrainingEgos {
    /// The world's own ego.
    #[default]
    Nominal,
    /// All egos of the family, another member in every episode.
    #[serde(rename = "wide")]
    #[strum(serialize = "wide")]
    Randomized,
}

impl TrainingEgos {
    /// Returns the word in files and on the command line.
    pub fn word(self) -> &'static str {
        self.into()
    }

    /// Returns true for the world's own ego, which is the default.
    pub fn is_nominal(&self) -> bool {
        *self == TrainingEgos::Nominal
    }
}

/// Ego on a plant, with a value for every quantity of the family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EgoSample {
    /// Values in the order of [`Family::quantities`].
    pub values: Vec<f64>,
    /// Plant of the member.
    pub plant: PlantKind,
    /// Controller of another structure in place of the world's own.
    ///
    /// It lacks the parameters of the world's own controller among `values`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controller: Option<Actuated<ControllerSpec>>,
}

/// Checked family of egos, sensors, roads and plants to train against.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Family {
    /// Varied quantities in the order of the file.
    pub quantities: Vec<Quantity>,
    /// Plants with their weights.
    pub plants: Vec<(PlantKind, u32)>,
    /// Controllers of other structures, each drawn as often as the world's own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub structures: Vec<Structure>,
    /// Probability with which a quantity of a member is nominal.
    pub nominal_share: f64,
    /// Learner of a wide ado.
    pub wide: LearnerConfig,
    /// Members with their probabilities, drawn instead of any other. Empty for all.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) mixture: Vec<(f64, EgoSample)>,
    /// World's own ego.
    pub(super) base: EgoVariant,
}

impl Family {
    /// Returns the world's own ego on a plant.
    pub fn nominal(&self, plant: PlantKind) -> EgoSample {
        EgoSample {
            values: self.quantities.iter().map(|q| q.nominal).collect(),
            plant,
            controller: None,
        }
    }

    /// Returns the member of an episode with a key, in a world.
    ///
    /// 15 % of the members are nominal in every quantity. In the others each
    /// quantity is nominal with the family's probability, and otherwise uniform
    /// in its range. The plant is drawn by the weights of all plants. Each of
    /// `n` other structures is drawn in one episode of `n + 1`. A family with a
    /// mixture gives its members only, by their probabilities.
    pub fn draw(&self, world: &str, key: StartKey) -> EgoSample {
        if !self.mixture.is_empty() {
            let shares: Vec<f64> = self.mixture.iter().map(|(share, _)| *share).collect();
            // A stream of its own, so that a mixture changes no other draw.
            let at = pick(&shares, &mut key.generator(world, "mixture"));
            return self.mixture[at].1.clone();
        }
        let mut member = self.draw_own(world, key);
        if !self.structures.is_empty() {
            // A separate stream, so that an additional structure changes no
            // other draw.
            let mut rng = key.generator(world, "structure");
            // One number more than there are stands for the world's own.
            let which = rng.random_range(0..=self.structures.len());
            let drawn = self.structures.get(which);
            member.controller = drawn.map(|structure| structure.draw(&mut rng));
        }
        member
    }

    /// Returns a member of the world's own structure.
    fn draw_own(&self, world: &str, key: StartKey) -> EgoSample {
        let mut rng = key.generator(world, "family");
        let plant = self.draw_plant(&mut rng);
        if rng.random::<f64>() < PURE {
            return self.nominal(plant);
        }
        let values = self.quantities.iter().map(|quantity| {
            // Both are always drawn, so that each quantity takes the same
            // number of draws whether it is nominal or not.
            let (dice, value) = (rng.random::<f64>(), quantity.draw(&mut rng));
            if dice < self.nominal_share {
                quantity.nominal
            } else {
                value
            }
        });
        EgoSample {
            values: values.collect(),
            plant,
            controller: None,
        }
    }

    fn draw_plant(&self, rng: &mut impl Rng) -> PlantKind {
        let total: u32 = self.plants.iter().map(|(_, weight)| weight).sum();
        // `random_range` panics on an empty range.
        let mut left = rng.random_range(0..total.max(1));
        for &(plant, weight) in &self.plants {
            if left < weight {
                return plant;
            }
            left -= weight;
        }
        // Invariant: weights are above 0, so the loop has returned.
        self.base.plant
    }

    /// Returns the number of varied quantities of the world's own structure, or of
    /// another one by its position.
    pub fn dimensions(&self, structure: Option<usize>) -> usize {
        self.varied(structure).len()
    }

    /// Returns the member at a point of the ranges, in −1 to 1 per varied quantity.
    ///
    /// Missing coordinates are nominal, or those of the structure in the file.
    pub fn at(&self, structure: Option<usize>, point: &[f64], plant: PlantKind) -> EgoSample {
        let mut member = self.nominal(plant);
        let values = self
            .varied(structure)
            .iter()
            .zip(point)
            .map(|(q, x)| q.fit(q.lo + 0.5 * (x + 1.0) * (q.hi - q.lo)));
        match structure.and_then(|at| self.structures.get(at)) {
            Some(other) => member.controller = Some(other.at(values)),
            None => {
                for (own, value) in member.values.iter_mut().zip(values) {
                    *own = value;
                }
            }
        }
        member
    }

    fn varied(&self, structure: Option<usize>) -> &[Quantity] {
        let other = structure.and_then(|at| self.structures.get(at));
        other.map_or(&self.quantities, |other| &other.quantities)
    }

    /// Returns the ego of a member.
    pub fn variant(&self, member: &EgoSample) -> EgoVariant {
        let mut variant = EgoVariant {
            plant: member.plant,
            ..self.base.clone()
        };
        for (quantity, &value) in self.quantities.iter().zip(&member.values) {
            quantity.varied.set(&mut variant, value);
        }
        // Another structure replaces the controller, whose varied parameters
        // then have no effect.
        if let Some(other) = &member.controller {
            variant.controller = other.clone();
        }
        variant
    }

    /// Returns the member as a change of the world, on the world's own plant.
    pub fn change(&self, member: &EgoSample) -> Change {
        let variant = self.variant(member);
        let own = self.quantities.iter().zip(&member.values);
        let ego = own.filter_map(|(quantity, value)| match &quantity.varied {
            Varied::Ego(name) => Some((name.clone(), *value)),
            _ => None,
        });
        Change {
            // Another structure lacks the parameters of the world's own
            // controller.
            ego: match member.controller {
                None => Patch(ego.collect()),
                Some(_) => Patch::default(),
            },
            controller: member.controller.clone(),
            // Equal values stay out, so that a text has the differences alone.
            friction: (variant.friction != self.base.friction).then_some(variant.friction),
            sensors: (variant.sensors != self.base.sensors).then_some(variant.sensors),
            ..Change::default()
        }
    }

    /// Returns true if a changed ego is a member.
    ///
    /// Everything that the change alters must be a quantity of the family,
    /// within its range. Another body is never in the family. Another kind of
    /// controller is, if it is one of the family's structures.
    pub fn covers(&self, change: &Change) -> bool {
        let base = &self.base;
        let mut altered: Vec<(Varied, f64, f64)> = Vec::new();
        let mut controller = base.controller.clone();
        if let Some(other) = &change.controller {
            controller = other.clone();
        }
        for (name, value) in &change.ego.0 {
            if controller.set(name, *value).is_err() {
                return false;
            }
        }
        // Parameters of another kind of controller have no nominal values.
        if controller.controller.kind() == base.controller.controller.kind() {
            // Two programs are one kind, and only their commands distinguish them.
            let command = |ego: &Actuated<ControllerSpec>| {
                let program = ego.controller.program()?;
                Some(program.command.clone())
            };
            if command(&controller) != command(&base.controller) {
                return false;
            }
            for own in controller.parameters() {
                let nominal = parameter(&base.controller, own.name);
                let varied = Varied::Ego(own.name.to_owned());
                // A parameter without a nominal value counts as altered, since
                // NaN differs from all values.
                altered.push((varied, nominal.unwrap_or(f64::NAN), own.value));
            }
        } else if !self.structures.iter().any(|s| s.covers(&controller)) {
            return false;
        }
        let sensors = change.sensors.unwrap_or(base.sensors);
        let flaws = [
            (Varied::Delay, base.sensors.delay_s, sensors.delay_s),
            (
                Varied::PositionNoise,
                base.sensors.position_sd_m,
                sensors.position_sd_m,
            ),
            (
                Varied::SpeedNoise,
                base.sensors.speed_sd_mps,
                sensors.speed_sd_mps,
            ),
        ];
        altered.extend(flaws);
        let friction = change.friction.unwrap_or(base.friction);
        altered.push((Varied::Friction, base.friction, friction));
        // Unaltered values need no range in the family.
        altered.retain(|(_, nominal, value)| nominal != value);
        let quantity = |varied: &Varied| self.quantities.iter().find(|q| q.varied == *varied);
        let within = |(varied, _, value): &(Varied, f64, f64)| {
            quantity(varied).is_some_and(|q| q.contains(*value))
        };
        let plant = change.plant.unwrap_or(base.plant);
        // A body is no quantity of a family, and a map of cells has no
        // controller.
        change.ego_body.is_none()
            && change.grid.is_none()
            && (plant == base.plant || self.plants.iter().any(|(kind, _)| *kind == plant))
            && altered.iter().all(within)
    }

    /// Returns the programs among its structures, by the structure's name.
    pub fn programs(&self) -> impl Iterator<Item = (&str, &Process)> {
        self.structures.iter().filter_map(|structure| {
            let program = structure.controller.controller.program()?;
            Some((structure.name.as_str(), program))
        })
    }
}

impl fmt::Display for TrainingEgos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}
