//! Watching an episode: a recording for the [rerun] viewer, layout included.
//!
//! A recording holds the cars in 3D, every signal, the running robustness of
//! the ego's specification and of every rule, the contact, and the verdict in
//! words, on the timelines `sim_time` and `step`, and up to the verdict on
//! `until_verdict` where the episode goes on after it:
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
//! | scene | roads | `/world/<light>` | a post with its dark lamps |
//! | scene | roads | `/world/<light>/lit` | the lamp that is lit and the stop line in its colour |
//! | scene | roads | `/trails` | everybody's path on the ground |
//! | scene | roads | `/follow` | a frame that goes with the ego, upright: the cameras' |
//! | scene | roads | `/contact` | where and how fast two agents met, from that instant on |
//! | scene | roads | `/verdict/mark` | where the ego was when the verdict became certain |
//! | actions | all | `/actions/<ado>` | what the ado chose, decision by decision |
//! | actions | all | `/lights/<light>` | the phases of a light, as coloured lanes |
//! | events | all | `/verdict/events` | the log: actions, phases, violations, contact |
//! | running robustness | all | `/robustness/ego_spec` | running robustness of ψ_ego |
//! | running robustness | all | `/robustness/rule/<name>` | and of each rule |
//! | running robustness | all | `/robustness/zero` | the line that it crosses when a formula is lost |
//! | running robustness | all | `/marks/verdict` | the instant of the verdict, as an upright line in all plots |
//! | running robustness | all | `/marks/contact` | and that of the contact |
//! | signals | all | `/signals/<group>` | curves, grouped by unit, e.g. `/signals/speed` |
//! | verdict | all | `/verdict` | the verdict in words, and why |
//!
//! The panel `from above` shows the scene once more, and a grid world is a map in
//! the plane instead.
//!
//! It opens at the verdict: at its last sample, where most episodes have their
//! crash, or else at the end of `until_verdict`; playing from there starts over,
//! and `sim_time` has the whole episode.
//!
//! Running robustness is the end of the interval of values still possible that
//! says something: for `always` the running minimum. It crosses zero at the
//! sample from which the formula is lost.
//!
//! Architecture Invariant: viewing never changes a result. An episode is
//! borrowed, played again on a bench of its own, and written down.
//!
//! ```no_run
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
mod entity;
mod error;
mod figure;
mod journal;
mod layout;
mod lights;
mod lines;
mod palette;
mod panel;
mod panels;
mod road;
mod space;
mod story;

use std::path::{Path, PathBuf};

use rerun::external::re_log_encoding::{EncodeError, Encoder};
use rerun::external::re_log_types::BlueprintActivationCommand;
use rerun::log::LogMsg;
use rerun::{EntityPath, RecordingInfo, StoreKind};

use crate::testbench::Episode;
use crate::world::Scenario;
pub use error::ViewError;
use journal::Journal;
pub use panel::Entity;
pub use panels::entities;
use story::Story;

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingFile {
    /// Where the recording lies.
    pub path: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// Samples in it.
    pub samples: usize,
}

/// Writes `episode` as a recording to `out`, replacing what is there.
///
/// `caption` is a sentence shown under the verdict: who played, and why this
/// episode was kept. The file appears whole or not at all.
///
/// # Errors
/// The output cannot be written.
pub fn record(
    scenario: &Scenario,
    episode: &Episode,
    caption: &str,
    out: &Path,
) -> Result<RecordingFile, ViewError> {
    let refused = |source| ViewError::Write {
        path: out.into(),
        source,
    };
    let bytes = Recording::new(scenario, episode, caption).encode()?;
    write_whole(out, &bytes).map_err(refused)?;
    Ok(RecordingFile {
        path: out.into(),
        bytes: bytes.len() as u64,
        samples: episode.trace.len(),
    })
}

fn write_whole(out: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let directory = match out.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if out.is_dir() {
        return Err(std::io::ErrorKind::IsADirectory.into());
    }
    let mut file = tempfile::Builder::new().tempfile_in(directory)?;
    std::io::Write::write_all(&mut file, bytes)?;
    readable(file.as_file())?;
    file.persist(out).map_err(|error| error.error)?;
    Ok(())
}

/// Temporary files are private to their owner; recordings are ordinary files.
#[cfg(unix)]
fn readable(file: &std::fs::File) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable(_file: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

/// An episode made ready for viewing: played again, its formulas followed.
pub struct Recording<'a>(Story<'a>);

impl<'a> Recording<'a> {
    /// Plays `episode` again to learn where everybody was.
    pub fn new(scenario: &'a Scenario, episode: &'a Episode, caption: &'a str) -> Recording<'a> {
        Recording(Story::new(scenario, episode, caption))
    }

    /// Everything, column by column, as messages for the viewer.
    ///
    /// # Errors
    /// The viewer's library refuses the data.
    pub fn messages(&self) -> Result<Messages, ViewError> {
        let story = &self.0;
        let mut journal = Journal::new(StoreKind::Recording).ending_at(story.opens_s());
        let about = RecordingInfo::update_fields().with_name(story.scenario.name.as_str());
        journal.always(EntityPath::properties(), &[&about])?;
        panels::log(story, &mut journal)?;
        let mut blueprint = Journal::new(StoreKind::Blueprint);
        panels::lay_out(story, &mut blueprint)?;
        let activate = BlueprintActivationCommand::make_active(blueprint.store().clone());
        let mut layout = blueprint.into_messages();
        layout.push(LogMsg::BlueprintActivationCommand(activate));
        Ok(Messages {
            recording: journal.into_messages(),
            layout,
        })
    }

    /// The bytes of a recording file.
    ///
    /// Ids in it are random: two files of one episode differ in bytes, not in
    /// content.
    ///
    /// # Errors
    /// The viewer's library refuses the data.
    pub fn encode(&self) -> Result<Vec<u8>, ViewError> {
        let Messages { recording, layout } = self.messages()?;
        let encoded = || -> Result<Vec<u8>, EncodeError> {
            // A file is a sequence of streams. That of the layout goes without
            // the index of its chunks, which would be larger than itself.
            let mut bytes = encoded(&recording, Index::Write)?;
            bytes.extend(encoded(&layout, Index::Omit)?);
            Ok(bytes)
        };
        encoded().map_err(|error| ViewError::Encode {
            what: error.to_string(),
        })
    }
}

/// What a recording consists of, as messages for the viewer.
pub struct Messages {
    /// The episode.
    pub recording: Vec<LogMsg>,
    /// Which views there are, and where.
    pub layout: Vec<LogMsg>,
}

/// Whether a stream ends with an index of its chunks.
#[derive(PartialEq, Eq)]
enum Index {
    Write,
    Omit,
}

fn encoded(messages: &[LogMsg], index: Index) -> Result<Vec<u8>, EncodeError> {
    let mut encoder = Encoder::local()?;
    if index == Index::Omit {
        encoder.do_not_emit_footer();
    }
    encoder.extend(messages.iter().map(Ok))?;
    encoder.finish()?;
    encoder.into_inner()
}
