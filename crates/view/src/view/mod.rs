//! Recordings of episodes for the [rerun] viewer, with their layout.
//!
//! A recording contains the cars in 3D, every signal, the contact, and the
//! verdict in words. It also contains the running robustness of the ego's
//! specification and of every rule. Its timelines are `sim_time` and `step`. If
//! the motion continues after the contact, `until_contact` ends there, and in an
//! episode without one `until_verdict` ends at the verdict:
//!
//! | panel | of | entity | what it is |
//! | --- | --- | --- | --- |
//! | map | grids | `/map/cells` | the cells, and fine ones |
//! | map | grids | `/map/walls` | the walls around them |
//! | map | grids | `/map/<player>` | the ego as a square, the ado as a disc |
//! | map | grids | `/map/trail/<player>` | its way so far and its last move |
//! | map | grids | `/map/outcome` | a frame around the cell where it was decided |
//! | scene | roads | `/world/road` | surface, lane markings, a post every 10 m |
//! | scene | roads | `/world/<agent>` | body, moved by its transform |
//! | scene | roads | `/world/<agent>/velocity` | an arrow as long as the way in 0.5 s |
//! | scene | roads | `/world/<agent>/hidden` | a frame around a body that the ego does not see |
//! | scene | roads | `/world/<light>` | a post with its dark lamps |
//! | scene | roads | `/world/<light>/lit` | the lamp that is lit and the stop line in its colour |
//! | scene | roads | `/trails` | everybody's path on the ground |
//! | scene | roads | `/follow` | a frame that goes with the ego, upright: the cameras' |
//! | scene | roads | `/contact` | where and how fast two agents met, from that instant on |
//! | scene | roads | `/verdict/mark` | where the ego was when the verdict became certain |
//! | actions | all | `/actions/<ado>` | what the ado chose, decision by decision |
//! | actions | all | `/lights/<light>` | the phases of a light, as coloured lanes |
//! | actions | all | `/sight/<agent>` | when the ego sees it, as coloured lanes |
//! | events | all | `/verdict/events` | the log: actions, phases, violations, contact, collisions after it |
//! | running robustness | all | `/robustness/ego_spec` | running robustness of ψ_ego |
//! | running robustness | all | `/robustness/rule/<name>` | and of each rule |
//! | running robustness | all | `/robustness/zero` | the line that it crosses when a formula is lost |
//! | running robustness | all | `/marks/verdict` | the instant of the verdict, as an upright line |
//! | running robustness | all | `/marks/contact` | and that of the contact |
//! | signals | all | `/signals/<group>` | curves, grouped by unit, e.g. `/signals/speed` |
//! | verdict | all | `/verdict` | the verdict in words, and why |
//!
//! The panel `from above` shows the scene a second time. A grid world has a map
//! in the plane instead of both.
//!
//! A recording opens at the contact, or without one at the verdict: at the end of
//! `until_contact` or `until_verdict`, or of the motion. Playing from there starts
//! again, and `sim_time` has the complete motion.
//!
//! Running robustness is the informative bound of the interval of possible
//! values. For `always` it is the running minimum. It crosses zero at the sample
//! from which the formula cannot be satisfied.
//!
//! Architecture Invariant: viewing never changes a result. An episode is
//! borrowed, replayed on a bench of its own, and recorded.
//!
//! ```no_run
//! # mod brakecheck {
//! #     pub use brakecheck_stats::seed;
//! #     pub use brakecheck_scene::testbench;
//! #     pub use brakecheck_view::view;
//! #     pub use brakecheck_world::world;
//! # }
//! use brakecheck::world::Scenario;
//! use brakecheck::seed::{Purpose, StartKey};
//! use brakecheck::testbench::{Aftermath, Constant, play};
//!
//! let world = Scenario::load("worlds/acc.ron".as_ref())?;
//! let mut bench = world.bench();
//! let start = bench.draw(StartKey { purpose: Purpose::Test, seed: 0, index: 0 });
//! let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
//! let recorded = brakecheck::view::record(&world, &episode, "braking all the way", "a.rrd".as_ref())?;
//! println!("{} samples, {} bytes", recorded.samples, recorded.bytes);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [rerun]: https://rerun.io

mod camera;
#[cfg(feature = "connect")]
mod connection;
mod entity;
mod error;
mod figure;
mod layout;
mod learning;
mod lights;
mod lines;
mod live;
mod log_writer;
mod mesh;
mod palette;
pub(crate) mod panel;
pub mod panels;
mod road;
mod sight;
mod space;
mod stream;
mod viewed_episode;

use std::path::{Path, PathBuf};

use re_log_encoding::{EncodeError, Encoder};
use re_log_types::{BlueprintActivationCommand, EntityPath, LogMsg, StoreKind};
use re_sdk_types::archetypes::RecordingInfo;

use crate::run_dir::{RunError, write_output};
use crate::testbench::Episode;
use crate::world::Scenario;
pub use error::ViewError;
pub use live::{LiveEnd, LiveView, ShownShare};
use log_writer::LogWriter;
pub use stream::EpisodeStream;
use viewed_episode::ViewedEpisode;

/// Recording file that was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingFile {
    /// Path of the recording.
    pub path: PathBuf,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// Number of samples in it.
    pub samples: usize,
}

/// Writes `episode` as a recording to `out`, and replaces an existing file.
///
/// A link stays, and a pipe or a device is written to.
///
/// `caption` is a sentence below the verdict: the ado, and the reason to keep
/// this episode. A file appears completely or not at all.
///
/// # Errors
///
/// Returns an error if the output cannot be written.
pub fn record(
    scenario: &Scenario,
    episode: &Episode,
    caption: &str,
    out: &Path,
) -> Result<RecordingFile, ViewError> {
    let refused = |error| ViewError::Write {
        path: out.into(),
        source: match error {
            RunError::Io { source, .. } => source,
            other => std::io::Error::other(other),
        },
    };
    // Encoded before any file is made, so that an error leaves none.
    let bytes = Recording::new(scenario, episode, caption).encode()?;
    write_output(out, &bytes).map_err(refused)?;
    Ok(RecordingFile {
        path: out.into(),
        bytes: bytes.len() as u64,
        samples: episode.trace.len(),
    })
}

/// Episode prepared for viewing: replayed, with its formulas evaluated.
pub struct Recording<'a>(ViewedEpisode<'a>);

impl<'a> Recording<'a> {
    /// Replays `episode` to obtain the places of all agents.
    pub fn new(scenario: &'a Scenario, episode: &'a Episode, caption: &'a str) -> Recording<'a> {
        Recording(ViewedEpisode::new(scenario, episode, caption))
    }

    /// Returns all data, column by column, as messages for the viewer.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub fn messages(&self) -> Result<Messages, ViewError> {
        let story = &self.0;
        let mut journal = LogWriter::new(StoreKind::Recording).opening_at(story.opening());
        let about = RecordingInfo::update_fields().with_name(story.scenario.name.as_str());
        journal.always(EntityPath::properties(), &[&about])?;
        panels::log(story, &mut journal)?;
        let mut blueprint = LogWriter::new(StoreKind::Blueprint);
        panels::lay_out(story, &mut blueprint)?;
        // A blueprint has no effect until a command activates it.
        let activate = BlueprintActivationCommand::make_active(blueprint.store().clone());
        let mut layout = blueprint.into_messages();
        layout.push(LogMsg::BlueprintActivationCommand(activate));
        Ok(Messages {
            recording: journal.into_messages(),
            layout,
        })
    }

    /// Returns the bytes of a recording file.
    ///
    /// Its ids are random, so two files of one episode differ in bytes but not
    /// in content.
    ///
    /// # Errors
    ///
    /// Returns an error if the viewer's library rejects the data.
    pub fn encode(&self) -> Result<Vec<u8>, ViewError> {
        let Messages { recording, layout } = self.messages()?;
        let encoded = || -> Result<Vec<u8>, EncodeError> {
            // One stream, whose footer has the index of both stores. Readers that begin
            // at the footer refuse a file without one.
            let mut encoder = Encoder::local()?;
            encoder.extend(recording.iter().chain(&layout).map(Ok))?;
            encoder.finish()?;
            encoder.into_inner()
        };
        encoded().map_err(|error| ViewError::Encode {
            what: error.to_string(),
        })
    }
}

/// Content of a recording, as messages for the viewer.
pub struct Messages {
    /// Messages of the episode.
    pub recording: Vec<LogMsg>,
    /// Messages of the views and their arrangement.
    pub layout: Vec<LogMsg>,
}
