//! Where a run keeps what was learned of the egos its ado met.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::content_hash::{fingerprint, sha256};
use crate::experiment::EgoUnderTest;
use crate::run_dir::RunDir;
use crate::world::file_bytes;

/// The directory in a run.
pub(crate) const DIR: &str = "learned";

/// The file, without its extension, of what was `asked` of an ego; `None` for a
/// controller that is in no file, and may be another one the next time.
///
/// Its name is a hash of everything that an answer depends on: the version, the world,
/// the ego, its plant and, if it is a program, the files its command names.
pub(crate) fn place_of(run: &RunDir, ego: &EgoUnderTest, asked: &Value) -> Option<PathBuf> {
    if ego.is_own() {
        return None;
    }
    let program = ego.scenario().program();
    let files = program.iter().flat_map(|program| &program.command);
    let files = files.filter_map(|path| file_bytes(Path::new(path)).ok());
    let files: Vec<String> = files.map(|bytes| sha256(&bytes)).collect();
    let name = fingerprint(&json!({
        "brakecheck": env!("CARGO_PKG_VERSION"),
        "world_sha256": run.manifest().world_sha256,
        "change": ego.change(),
        "plant": ego.scenario().plant(),
        "files_sha256": files,
        "asked": asked,
    }));
    let name = name[..16].to_owned();
    Some(run.path().join(DIR).join(name))
}
