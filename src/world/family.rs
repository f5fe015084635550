//! The family of egos and plants that an ado can be trained against.
//!
//! A world file may name, under `train_against`, ranges over the parameters of
//! its ego, over the ego's sensors and the road, and the plants to train on.
//! A [`Member`] is one point of it. An ado trained against the whole family is
//! *wide* (it is not told which member it meets) or *conditional* (the
//! member's quantities are appended to its observation).
//!
//! Members are drawn per episode from the episode's own key, so they depend on
//! no thread and no earlier episode.

use std::fmt;

use indexmap::IndexMap;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use super::file::Change;
use super::ordered::Patch;
use super::quantity::{Quantity, Varied, parameter};
use super::structure::Structure;
use crate::ego::{Actuated, ControllerSpec, Process};
use crate::rl::LearnerConfig;
use crate::scene::drive::{DriveSpec, EgoVariant};
use crate::seed::StartKey;
use crate::sim::PlantKind;

/// Share of the members that are nominal in every quantity.
const PURE: f64 = 0.15;

/// What an ado is trained against.
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
pub enum Against {
    /// The world's own ego.
    #[default]
    Nominal,
    /// All egos of the family; the ado is not told which one it meets.
    Wide,
    /// All egos of the family; the ado is told the parameters of each.
    Conditional,
}

impl Against {
    /// The word in files and on the command line.
    pub fn word(self) -> &'static str {
        self.into()
    }

    /// Whether it is the world's own ego, as when nothing is said.
    pub fn is_nominal(&self) -> bool {
        *self == Against::Nominal
    }
}

/// One ego on one plant: a value for every quantity of the family.
#[derive(Clone, Debug, PartialEq)]
pub struct Member {
    /// In the order of [`Family::quantities`].
    pub values: Vec<f64>,
    /// Which physics.
    pub plant: PlantKind,
    /// A controller of another structure in place of the world's own, whose
    /// parameters among `values` it does not have.
    pub controller: Option<Actuated<ControllerSpec>>,
}

/// Egos, sensors, roads and plants to train against, checked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Family {
    /// What varies, in the order of the file.
    pub quantities: Vec<Quantity>,
    /// The plants, each with its weight.
    pub plants: Vec<(PlantKind, u32)>,
    /// Controllers of other structures, each met as often as the world's own. A
    /// conditional ado meets none of them: it could not be told which.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub structures: Vec<Structure>,
    /// Probability with which a quantity of a member is nominal.
    pub nominal_share: f64,
    /// How a wide ado learns.
    pub wide: LearnerConfig,
    /// How a conditional ado learns.
    pub conditional: LearnerConfig,
    /// The world's own ego.
    pub(super) base: EgoVariant,
}

/// An ego has no value for a quantity of the family.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("this ego has no `{name}`, so the family cannot say which member it is")]
pub struct NoMember {
    /// The quantity.
    pub name: String,
}

/// Quantities by name do not name a member of the family.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MisfitMember {
    /// A quantity is not given.
    #[error("`{name}` is missing; the family varies {known}")]
    Missing {
        /// The quantity.
        name: String,
        /// All there are.
        known: String,
    },
    /// A quantity is given that the family does not vary.
    #[error("`{name}` is none of the family's quantities: {known}")]
    Unknown {
        /// The quantity.
        name: String,
        /// All there are.
        known: String,
    },
    /// A value lies outside of its range.
    #[error("`{name}` is {value}, outside of {lo} ..= {hi}")]
    Outside {
        /// The quantity.
        name: String,
        /// Its value.
        value: f64,
        /// Least value.
        lo: f64,
        /// Greatest value.
        hi: f64,
    },
}

impl Family {
    /// The world's own ego on a plant.
    pub fn nominal(&self, plant: PlantKind) -> Member {
        Member {
            values: self.quantities.iter().map(|q| q.nominal).collect(),
            plant,
            controller: None,
        }
    }

    /// The member met in the episode of a key of a world.
    ///
    /// 15 % are nominal in every quantity; in the others each quantity is
    /// nominal with the family's probability and else uniform in its range. The plant
    /// is drawn by the weights of all. Of `n` other structures each is met in
    /// one episode of `n + 1`.
    pub fn draw(&self, world: &str, key: StartKey) -> Member {
        let mut member = self.draw_own(world, key);
        if !self.structures.is_empty() {
            // Numbers of their own, so that a structure more changes no other.
            let mut rng = key.generator(world, "structure");
            let which = rng.random_range(0..=self.structures.len());
            let met = self.structures.get(which);
            member.controller = met.map(|structure| structure.draw(&mut rng));
        }
        member
    }

    /// A member of the world's own structure.
    fn draw_own(&self, world: &str, key: StartKey) -> Member {
        let mut rng = key.generator(world, "family");
        let plant = self.draw_plant(&mut rng);
        if rng.random::<f64>() < PURE {
            return self.nominal(plant);
        }
        let values = self.quantities.iter().map(|quantity| {
            // Both are drawn always, so that a quantity more or less does not
            // change how many numbers another one takes.
            let (dice, value) = (rng.random::<f64>(), quantity.draw(&mut rng));
            match dice < self.nominal_share {
                true => quantity.nominal,
                false => value,
            }
        });
        Member {
            values: values.collect(),
            plant,
            controller: None,
        }
    }

    fn draw_plant(&self, rng: &mut impl Rng) -> PlantKind {
        let total: u32 = self.plants.iter().map(|(_, weight)| weight).sum();
        let mut left = rng.random_range(0..total.max(1));
        for &(plant, weight) in &self.plants {
            if left < weight {
                return plant;
            }
            left -= weight;
        }
        self.base.plant
    }

    /// How many numbers a conditional ado is told.
    pub fn told_width(&self) -> usize {
        self.quantities.len()
    }

    /// What a conditional ado is told: every quantity scaled to −1 ..= 1.
    ///
    /// The plant is not told: an ado that knows it learns each of them from
    /// its own episodes only.
    pub fn told(&self, member: &Member) -> Vec<f32> {
        self.unit(member).iter().map(|&u| u as f32).collect()
    }

    /// A member as a point: every quantity scaled to −1 ..= 1 over its range.
    pub fn unit(&self, member: &Member) -> Vec<f64> {
        let pairs = self.quantities.iter().zip(&member.values);
        pairs.map(|(q, value)| q.scaled(*value)).collect()
    }

    /// The member at a point, or the one nearest to it.
    pub fn at(&self, point: &[f64], plant: PlantKind) -> Member {
        let pairs = self.quantities.iter().zip(point);
        Member {
            values: pairs.map(|(q, unit)| q.at(*unit)).collect(),
            plant,
            controller: None,
        }
    }

    /// Names of what a conditional ado is told, in order.
    pub fn told_names(&self) -> Vec<String> {
        let quantities = self.quantities.iter();
        quantities.map(|q| q.varied.name().to_owned()).collect()
    }

    /// The ego that a member is.
    pub fn variant(&self, member: &Member) -> EgoVariant {
        let mut variant = EgoVariant {
            plant: member.plant,
            ..self.base.clone()
        };
        for (quantity, &value) in self.quantities.iter().zip(&member.values) {
            quantity.varied.set(&mut variant, value);
        }
        if let Some(other) = &member.controller {
            variant.controller = other.clone();
        }
        variant
    }

    /// The member as a change of the world, on the world's own plant.
    pub(crate) fn change(&self, member: &Member) -> Change {
        let variant = self.variant(member);
        let own = self.quantities.iter().zip(&member.values);
        let ego = own.filter_map(|(quantity, value)| match &quantity.varied {
            Varied::Ego(name) => Some((name.clone(), *value)),
            _ => None,
        });
        Change {
            ego: match member.controller {
                None => Patch(ego.collect()),
                Some(_) => Patch::default(),
            },
            controller: member.controller.clone(),
            friction: (variant.friction != self.base.friction).then_some(variant.friction),
            sensors: (variant.sensors != self.base.sensors).then_some(variant.sensors),
            ..Change::default()
        }
    }

    /// The member that a driving scene is, values beyond a range drawn to it.
    ///
    /// # Errors
    /// Its controller lacks a parameter that the family varies.
    pub fn member_of(&self, spec: &DriveSpec) -> Result<Member, NoMember> {
        let values = self.quantities.iter().map(|quantity| {
            let value = quantity.varied.read(spec).ok_or_else(|| NoMember {
                name: quantity.varied.name().to_owned(),
            })?;
            Ok(quantity.fit(value))
        });
        Ok(Member {
            values: values.collect::<Result<_, _>>()?,
            plant: spec.plant,
            controller: None,
        })
    }

    /// The member of values by name; the plant is told apart.
    ///
    /// # Errors
    /// A quantity is missing, unknown, or out of its range.
    pub fn member_named(
        &self,
        values: &IndexMap<String, f64>,
        plant: PlantKind,
    ) -> Result<Member, MisfitMember> {
        let names: Vec<&str> = self.quantities.iter().map(|q| q.varied.name()).collect();
        let known = || names.join(", ");
        if let Some(name) = values.keys().find(|name| !names.contains(&name.as_str())) {
            return Err(MisfitMember::Unknown {
                name: name.clone(),
                known: known(),
            });
        }
        let found = self.quantities.iter().map(|quantity| {
            let name = quantity.varied.name();
            let value = *values.get(name).ok_or_else(|| MisfitMember::Missing {
                name: name.to_owned(),
                known: known(),
            })?;
            match quantity.contains(value) {
                true => Ok(value),
                false => Err(MisfitMember::Outside {
                    name: name.to_owned(),
                    value,
                    lo: quantity.lo,
                    hi: quantity.hi,
                }),
            }
        });
        Ok(Member {
            values: found.collect::<Result<_, _>>()?,
            plant,
            controller: None,
        })
    }

    /// Whether a changed ego is a member: everything that the change alters is
    /// a quantity of the family and stays within its range.
    ///
    /// Another body never is, another kind of controller if it is one of the
    /// family's structures.
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
        if controller.controller.kind() == base.controller.controller.kind() {
            for own in controller.parameters() {
                let nominal = parameter(&base.controller, own.name);
                let varied = Varied::Ego(own.name.to_owned());
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
        altered.retain(|(_, nominal, value)| nominal != value);
        let quantity = |varied: &Varied| self.quantities.iter().find(|q| q.varied == *varied);
        let within = |(varied, _, value): &(Varied, f64, f64)| {
            quantity(varied).is_some_and(|q| q.contains(*value))
        };
        let plant = change.plant.unwrap_or(base.plant);
        change.ego_body.is_none()
            && change.grid.is_none()
            && (plant == base.plant || self.plants.iter().any(|(kind, _)| *kind == plant))
            && altered.iter().all(within)
    }

    /// The programs among its structures, by the structure's name.
    pub fn programs(&self) -> impl Iterator<Item = (&str, &Process)> {
        self.structures.iter().filter_map(|structure| {
            let program = structure.controller.controller.program()?;
            Some((structure.name.as_str(), program))
        })
    }

    /// A member in words.
    pub fn in_words(&self, member: &Member) -> String {
        let pairs = self.quantities.iter().zip(&member.values);
        let list: Vec<String> = pairs
            .map(|(q, value)| format!("{} {value:.3}", q.varied.name()))
            .collect();
        list.join(", ")
    }
}

impl fmt::Display for Against {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}
