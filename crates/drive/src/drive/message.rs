//! Messages between page and program.

use serde::{Deserialize, Serialize};

use super::frame::DriveFrame;
use super::input::DriveInput;
use super::sandbox::{DriveSeat, Players, Sandbox, Setup, Slider};
use super::session::DrivenEpisode;
use crate::scene::{BodyFigure, SceneGeometry};
use crate::search::AdoPlayer;

/// What a page asks. The page at the wheel may ask all, and the others nothing.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DriveRequest {
    /// The keys that are held from now on.
    Keys(DriveInput),
    /// Go on, or pause.
    Run(bool),
    /// Play one sample, and pause.
    Step,
    /// Speed against real time, 0.05 to 8.
    Speed(f64),
    /// Back to a sample, and pause.
    Back(usize),
    /// Begin an episode with these values.
    Begin(Setup),
    /// Drivers of the next test start, instead of the present ones.
    Players(Players),
    /// Begin the test start after the present one.
    Next,
    /// Begin the test start of a number.
    Start(usize),
    /// Keep the counterexample as a file.
    Keep,
}

/// What the program sends.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PageMessage {
    /// A new episode: everything that does not change in it.
    Stage(Box<Stage>),
    /// Agents, lane borders and lights, where an ado lays the road while you drive.
    Geometry(Box<SceneGeometry>),
    /// A sample.
    Frame(Box<DriveFrame>),
    /// The samples so far, for a page that comes later or after a way back.
    Frames(Vec<DriveFrame>),
    /// State of the clock, and whether this page is at the wheel.
    State {
        /// True while the episode goes on by itself.
        running: bool,
        /// True if the episode is over.
        done: bool,
        /// Speed against real time.
        speed: f64,
        /// Page at the wheel.
        wheel: Option<u64>,
        /// Number of the test start. `None`: it has values of your own.
        number: Option<usize>,
    },
    /// Cause of the failure that was played, as one sentence.
    Cause(String),
    /// File of the kept counterexample, as the terminal has it.
    Kept(String),
    /// A message for the person at the page.
    Note(String),
    /// Problems of the edited world file, in place of the scene.
    Problems(String),
}

/// Everything that does not change in an episode.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stage {
    /// Name of the world.
    pub world: String,
    /// Question of the world.
    pub question: String,
    /// Setup of the episode.
    pub setup: Setup,
    /// Whether the search found a sequence. `None`: no search plays the ados.
    pub search_found: Option<bool>,
    /// Your seat.
    pub seat: DriveSeat,
    /// Time between two samples.
    pub sample_s: f64,
    /// Length of an episode.
    pub horizon_s: f64,
    /// Agents, lane borders and lights.
    pub geometry: SceneGeometry,
    /// Of every agent: `person`, `two_wheeler`, `car`, `van` or `truck`.
    pub figures: Vec<&'static str>,
    /// ψ_ego.
    pub spec: String,
    /// Rules, most important first.
    pub rules: Vec<StageRule>,
    /// Names and units of the signals.
    pub signals: Vec<[String; 2]>,
    /// Egos to choose from.
    pub egos: Vec<String>,
    /// Players of the ados to choose from.
    pub players: Vec<AdoPlayer>,
    /// Names of the ados, in the order of a joint action.
    pub ados: Vec<String>,
    /// Actions of every ado.
    pub actions: Vec<Vec<String>>,
    /// Sliders over the start.
    pub start_sliders: Vec<Slider>,
    /// Sliders over the parameters of every ego, in the order of `egos`.
    pub ego_sliders: Vec<Vec<Slider>>,
}

/// A rule of an ado.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageRule {
    /// Name in the world file.
    pub name: String,
    /// Ado that must keep it.
    pub ado: String,
}

impl Stage {
    /// Returns the stage of an episode.
    pub fn of(sandbox: &Sandbox, episode: &DrivenEpisode) -> Stage {
        let world = episode.ego().scenario();
        let geometry = episode.stage();
        let figures = geometry.agents.iter().map(|agent| match agent.figure() {
            BodyFigure::Person => "person",
            BodyFigure::TwoWheeler => "two_wheeler",
            BodyFigure::Car => "car",
            BodyFigure::Van => "van",
            BodyFigure::Truck => "truck",
        });
        // Once, so that sliders and egos are in one order.
        let egos = sandbox.egos();
        let clock = world.world().clock();
        let rules = world.rulebook().rules.iter().map(|rule| StageRule {
            name: rule.name.clone(),
            ado: rule.ado.clone(),
        });
        let schema = world.world().schema();
        let signals = schema.signals().iter();
        Stage {
            world: world.name().to_owned(),
            question: world.question().to_owned(),
            setup: episode.setup().clone(),
            search_found: episode.search_found(),
            seat: sandbox.seat().clone(),
            sample_s: clock.sample_s,
            horizon_s: clock.horizon_s,
            figures: figures.collect(),
            geometry,
            spec: world.ego_spec().to_string(),
            rules: rules.collect(),
            signals: signals
                .map(|it| [it.name.to_string(), it.unit.to_string()])
                .collect(),
            players: sandbox.players(),
            ados: sandbox.ados().collect(),
            actions: sandbox.action_labels(),
            start_sliders: sandbox.start_sliders(episode.setup()),
            ego_sliders: egos.iter().map(|ego| sandbox.ego_sliders(ego)).collect(),
            egos,
        }
    }
}
