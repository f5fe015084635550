//! World files as values: their shapes for serde, their schema and their text.
//!
//! Architecture Invariant: a shape knows no mistakes beyond its types. Names, ranges
//! and formulas are checked in `world`, which knows their places in the text.
//!
//! ```
//! use brakecheck_world_file::world_file::{self, WorldFile};
//!
//! let schema = world_file::schema();
//! let world = &schema["$defs"]["Scenario"]["properties"];
//! assert!(world["question"]["description"].is_string());
//! ```

mod agent_file;
mod change_file;
mod declared_traffic_file;
mod default_field;
mod environment_file;
mod family_file;
mod file;
mod grid_file;
mod natural_file;
mod number_or_range;
mod origin_file;
mod rule_file;
mod signal_file;
#[cfg(test)]
mod tests;
mod text;
mod trained_file;
mod training_goal;
mod world;

pub use agent_file::{
    AdoFile, AgentFile, DriveFile, Facing, LightFile, PlanFile, RoadAgentFile, SceneAdoFile,
    StartFile, WeatherBoundsFile, WeatherFile, WeatherStartFile,
};
pub use change_file::{Change, GridChange};
pub use declared_traffic_file::{
    AdoLawFile, DeclaredTrafficFile, EncounterRate, FittedFile, MarkovFile, OnsetFile, StartLawFile,
};
pub use environment_file::{
    GustFile, LanesFile, OwnPiece, OwnRoad, RangePoint, SensorsFile, WindFile, nominal_grades,
};
pub use family_file::{FamilyFile, PlantName};
pub use file::{PointsFile, RoadFile, ScenarioFile};
pub use grid_file::{GridAdoFile, GridEgoFile, GridFile, MapFile};
pub use natural_file::{KeptTraffic, NaturalFile, SHIPPED, TrafficFile};
pub use number_or_range::NumberOrRange;
pub use origin_file::OriginFile;
pub use rule_file::{RuleFile, WrittenRule};
pub use signal_file::{DescribedSignal, SignalFile};
pub use text::{CommentedWorld, TextComment, text};
pub use trained_file::{KeptRun, RulesFile, RunFile, TrainedFile};
pub use training_goal::TrainingGoal;
pub use world::{WorldFile, parse, schema};
