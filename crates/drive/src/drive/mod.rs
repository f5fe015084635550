//! A page in the browser to drive in a world: `brakecheck drive`.
//!
//! [`DrivenEpisode`] is an episode without a clock, [`serve`] plays it in real time for the
//! pages of a browser on this machine. The protocol between page and program is that of
//! [`DriveRequest`] and [`PageMessage`], one JSON object each.

mod error;
mod frame;
mod hand;
mod http;
mod hub;
mod input;
mod keep;
mod message;
mod real_time;
mod sandbox;
mod server;
mod session;
mod watched;

pub use crate::search::AdoPlayer;
pub use error::DriveError;
pub use frame::{DriveFrame, DriveOutcome};
pub use input::DriveInput;
pub use message::{DriveRequest, PageMessage, Stage, StageRule};
pub use real_time::DriveSettings;
pub use sandbox::{DriveSeat, Players, Sandbox, Setup, Slider};
pub use server::{DriveEnded, serve};
pub use session::DrivenEpisode;
pub use watched::{Reload, Reloaded, WatchedWorld};
