//! Run that a world file refers to, or contains.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::world::runs::{NamedRun, RunRefused, WorldOrigin, refused};
use crate::world_file::{KeptRun, RunFile};

/// Run that was read.
pub(super) struct LoadedRun {
    pub(super) from: String,
    /// Identity. `None` for a run in the text.
    pub(super) identity: Option<String>,
    pub(super) world: String,
    pub(super) policy: Vec<u8>,
}

impl LoadedRun {
    /// Returns the name of its world's file.
    pub(super) fn world_name(&self) -> String {
        format!("{}/world.ron", self.from)
    }
}

/// Returns the run that a world file refers to or contains.
pub(super) fn opened(run: &RunFile, origin: WorldOrigin<'_>) -> Result<LoadedRun, RunRefused> {
    match run {
        RunFile::Directory(name) => {
            let NamedRun {
                identity,
                world,
                policy,
            } = origin.runs.find(name, origin.file)?;
            Ok(LoadedRun {
                from: name.clone(),
                identity: Some(identity),
                world,
                policy,
            })
        }
        RunFile::Kept(kept) => from_text(kept),
    }
}

fn from_text(kept: &KeptRun) -> Result<LoadedRun, RunRefused> {
    let policy = STANDARD.decode(&kept.policy).map_err(|error| {
        refused(
            format!("the policy kept from `{}` is damaged: {error}", kept.from),
            "write `run: \"RUN\"` with a run directory instead",
        )
    })?;
    Ok(LoadedRun {
        from: kept.from.clone(),
        identity: None,
        world: kept.world.clone(),
        policy,
    })
}
