//! World of a drive: who sits where, and with whom you share the road.

use std::path::Path;
use std::sync::Arc;

use indexmap::IndexMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::error::DriveError;
use super::hand::Hand;
use crate::experiment::{EgoUnderTest, consent_to, test_start};
use crate::rl::Policy;
use crate::scene::Start;
use crate::scene::drive::EgoDrive;
use crate::search::{AdoPlayer, JointActions};
use crate::world::{Change, Scenario};

/// Name of the ego that obeys your keys, in kept files too.
pub(super) const YOU: &str = "you";

/// Your seat in the world.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveSeat {
    /// At the wheel of the ego.
    #[default]
    Ego,
    /// An ado, whose actions you choose. The value is its place among the ados.
    Ado(usize),
}

/// Values of an episode: who drives, against whom, and from which start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// `you`, `nominal`, a changed ego of the world, or your program.
    pub ego: String,
    /// Player of the ados.
    pub ado: AdoPlayer,
    /// A value per axis, in the world's order.
    pub start: Vec<f64>,
    /// Seed of all noise, as a text in messages: numbers of a page have 53 bits.
    #[serde(serialize_with = "to_text", deserialize_with = "from_text")]
    pub noise: u64,
    /// Other values of the ego's parameters.
    #[serde(default)]
    pub ego_values: IndexMap<String, f64>,
}

/// Drivers of the test starts that follow.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Players {
    /// Ego, as in [`Setup`].
    pub ego: String,
    /// Player of the ados.
    pub ado: AdoPlayer,
    /// Other values of the ego's parameters.
    #[serde(default)]
    pub ego_values: IndexMap<String, f64>,
}

fn to_text<S: Serializer>(seed: &u64, message: S) -> Result<S::Ok, S::Error> {
    message.collect_str(seed)
}

fn from_text<'de, D: Deserializer<'de>>(message: D) -> Result<u64, D::Error> {
    String::deserialize(message)?
        .parse()
        .map_err(serde::de::Error::custom)
}

/// World with your seat and the players that it offers.
#[derive(Clone)]
pub struct Sandbox {
    world: Scenario,
    seat: DriveSeat,
    trained: Option<Arc<dyn Policy>>,
    program: Vec<String>,
}

/// Axis of the starts, or parameter of the ego, as a slider.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slider {
    /// Name.
    pub name: String,
    /// Unit and meaning.
    pub about: String,
    /// Least value.
    pub lo: f64,
    /// Greatest value.
    pub hi: f64,
    /// Value at first.
    pub value: f64,
}

impl Sandbox {
    /// Creates the sandbox of a driving world.
    ///
    /// `seat` is `ego`, or the name of an ado.
    ///
    /// # Errors
    /// The world is a grid, or has no ado of that name.
    pub fn new(world: Scenario, seat: &str) -> Result<Sandbox, DriveError> {
        let Some(drive) = world.drive() else {
            let name = world.name().to_owned();
            return Err(DriveError::Grid { world: name });
        };
        let sets = drive.spec().action_sets();
        let ados: Vec<String> = sets.map(|(name, ..)| name.to_owned()).collect();
        // `ego` first: an ado of that name would otherwise take the seat.
        let seat = match (seat, ados.iter().position(|it| it == seat)) {
            ("ego", _) => DriveSeat::Ego,
            (_, Some(ado)) => DriveSeat::Ado(ado),
            (name, None) => {
                return Err(DriveError::NoSeat {
                    seat: name.to_owned(),
                    known: ados,
                });
            }
        };
        Ok(Sandbox {
            world,
            seat,
            trained: None,
            program: Vec::new(),
        })
    }

    /// Adds the trained ado of a run.
    pub fn with_trained(self, policy: Arc<dyn Policy>) -> Sandbox {
        Sandbox {
            trained: Some(policy),
            ..self
        }
    }

    /// Adds a program as an ego, to whose start you consent by naming it.
    pub fn with_program(self, program: &[String]) -> Sandbox {
        Sandbox {
            program: program.to_vec(),
            ..self
        }
    }

    /// Returns the world.
    pub fn world(&self) -> &Scenario {
        &self.world
    }

    /// Returns your seat.
    pub fn seat(&self) -> &DriveSeat {
        &self.seat
    }

    /// Returns the same seat and players in a world that was edited.
    ///
    /// # Errors
    /// The world has no such ado any more. A trained ado stays where its shapes still fit.
    pub fn in_world(&self, world: Scenario) -> Result<Sandbox, DriveError> {
        let name = match self.seat {
            DriveSeat::Ego => "ego".to_owned(),
            DriveSeat::Ado(ado) => self.ados().nth(ado).unwrap_or_default(),
        };
        // A policy of other shapes would read observations that it was not
        // trained on.
        let fits = world.spaces() == self.world.spaces();
        let trained = self.trained.clone().filter(|_| fits);
        Ok(Sandbox {
            trained,
            program: self.program.clone(),
            ..Sandbox::new(world, &name)?
        })
    }

    /// Returns the names of the ados that choose actions, in the order of a joint action.
    pub fn ados(&self) -> impl Iterator<Item = String> + '_ {
        let drive = self.world.drive();
        let sets = drive.into_iter().flat_map(|it| it.spec().action_sets());
        sets.map(|(name, ..)| name.to_owned())
    }

    /// Returns the actions of every ado in words, in the order of a joint action.
    pub fn action_labels(&self) -> Vec<Vec<String>> {
        let drive = self.world.drive();
        let sets = drive.into_iter().flat_map(|it| it.spec().action_sets());
        sets.map(|(_, actions, _)| (0..actions.len()).map(|it| actions.label(it)).collect())
            .collect()
    }

    /// Returns the names of the egos, the first of them for a first episode.
    pub fn egos(&self) -> Vec<String> {
        let mut egos = Vec::new();
        if self.seat == DriveSeat::Ego {
            // First, because a first episode takes the first name.
            egos.push(YOU.to_owned());
        }
        egos.push("nominal".to_owned());
        egos.extend(self.world.reuse().keys().cloned());
        if !self.program.is_empty() {
            egos.push(self.program.join(" "));
        }
        egos
    }

    /// Returns the players of the ados, the first of them for a first episode.
    pub fn players(&self) -> Vec<AdoPlayer> {
        let mut players = Vec::new();
        if self.trained.is_some() {
            players.push(AdoPlayer::Trained);
        }
        players.extend(if self.is_searched_first() {
            [AdoPlayer::Search, AdoPlayer::Neutral, AdoPlayer::Random]
        } else {
            [AdoPlayer::Neutral, AdoPlayer::Search, AdoPlayer::Random]
        });
        players
    }

    /// Returns whether a search plays the ados unless you choose another player.
    fn is_searched_first(&self) -> bool {
        // Your own ado obeys you alone. A search takes more runs than a program plays soon.
        let is_foreign = self.world.ego().is_some_and(EgoDrive::is_foreign);
        self.seat == DriveSeat::Ego && self.ados().next().is_some() && !is_foreign
    }

    /// Returns the first setup: the test start of an index.
    ///
    /// # Errors
    /// The world lists fewer starts.
    pub fn first_setup(&self, seed: u64, index: usize) -> Result<Setup, DriveError> {
        let (start, noise) =
            test_start(&self.world, seed, index).ok_or(DriveError::NoStart { index })?;
        Ok(Setup {
            ego: self.egos().swap_remove(0),
            ado: self.players().swap_remove(0),
            start: start.0,
            noise,
            ego_values: IndexMap::new(),
        })
    }

    /// Returns a slider per axis of the starts.
    pub fn start_sliders(&self, setup: &Setup) -> Vec<Slider> {
        let axes = self.world.axes().into_iter().zip(&setup.start);
        let sliders = axes.map(|(axis, value)| Slider {
            name: axis.name,
            about: axis.unit.to_owned(),
            lo: axis.lo,
            hi: axis.hi,
            value: *value,
        });
        sliders.collect()
    }

    /// Returns a slider per changeable parameter of an ego. None for you and for programs.
    pub fn ego_sliders(&self, ego: &str) -> Vec<Slider> {
        if ego == YOU {
            return Vec::new();
        }
        // An ego that cannot be built has no sliders. Its error comes when an
        // episode begins.
        let Ok(ego) = self.ego(ego, &IndexMap::new(), &Hand::default()) else {
            return Vec::new();
        };
        let Some(actuated) = ego.scenario().controller() else {
            return Vec::new();
        };
        let parameters = actuated.controller.parameters().into_iter();
        let sliders = parameters.map(|parameter| {
            let value = parameter.value;
            // Nothing states a greatest value: twice the present one, and at least 1.
            let hi = (2.0 * value.abs()).max(1.0);
            Slider {
                name: parameter.name.to_owned(),
                about: parameter.about.trim().to_owned(),
                // The least value may be −∞, and a slider needs two ends.
                lo: parameter.at_least.max(-hi),
                hi,
                value,
            }
        });
        sliders.collect()
    }

    /// Returns an ego by name, with other values of its parameters.
    ///
    /// # Errors
    /// The name is unknown, a value does not fit, or a program is not allowed.
    pub(super) fn ego(
        &self,
        name: &str,
        values: &IndexMap<String, f64>,
        hand: &Hand,
    ) -> Result<EgoUnderTest, DriveError> {
        if name == YOU && self.seat == DriveSeat::Ego {
            return Ok(EgoUnderTest::own(&self.world, YOU, hand.factory())?);
        }
        let is_program = !self.program.is_empty() && name == self.program.join(" ");
        // A file of a `Change` on the disk is not for a page to name.
        if !is_program && Path::new(name).extension().is_some() {
            return Err(DriveError::NoEgo {
                name: name.to_owned(),
            });
        }
        let found = if is_program {
            EgoUnderTest::program(&self.world, &self.program)?
        } else {
            let mut egos = EgoUnderTest::find(&self.world, name)?;
            if egos.len() != 1 {
                return Err(DriveError::NoEgo {
                    name: name.to_owned(),
                });
            }
            egos.swap_remove(0)
        };
        // Before any use of it: a page must not start a program without
        // consent.
        consent_to(std::slice::from_ref(&found))?;
        if values.is_empty() {
            return Ok(found);
        }
        let mut change: Change = found.change().clone();
        for (parameter, value) in values {
            change.ego.0.insert(parameter.clone(), *value);
        }
        let all = values
            .iter()
            .map(|(name, value)| format!("{name} = {value}"));
        let title = format!("{name}, {}", all.collect::<Vec<_>>().join(", "));
        let help = "choose values that the ego may have";
        Ok(EgoUnderTest::changed(&self.world, &title, &change, help)?)
    }

    /// Returns the policy of the run, if there is one.
    pub(super) fn trained(&self) -> Option<&Arc<dyn Policy>> {
        self.trained.as_ref()
    }

    /// Returns the first successful sequence of a search from a start, if it finds any.
    ///
    /// # Errors
    /// The world's own ego is a program that is not allowed.
    pub(super) fn searched(
        &self,
        ego: &EgoUnderTest,
        setup: &Setup,
    ) -> Result<Option<JointActions>, DriveError> {
        let ego = if ego.is_own() {
            // Your keys cannot be searched against.
            EgoUnderTest::nominal(&self.world)
        } else {
            ego.clone()
        };
        consent_to(std::slice::from_ref(&ego))?;
        let start = Start(setup.start.clone());
        Ok(JointActions::searched(&ego, &start, setup.noise))
    }
}
