//! Where a run keeps what was learned of the egos its ado met.

use std::path::{Path, PathBuf};

use super::ego_under_test::EgoUnderTest;
use crate::run::RunDir;
use crate::scenario::file_bytes;
use crate::seal::sha256;

/// The directory in a run.
pub(super) const DIR: &str = "learned";

/// The file, without its extension, of what was `asked` of an ego; `None` for a
/// controller that is in no file, and may be another one the next time.
///
/// Its name is a hash of everything that an answer depends on: the version, the world,
/// the ego, its plant and, if it is a program, the files its command names.
pub(super) fn place_of(run: &RunDir, ego: &EgoUnderTest, asked: &str) -> Option<PathBuf> {
    if ego.is_own() {
        return None;
    }
    let mut key = format!(
        "{} {} {:?} {:?} {asked}",
        env!("CARGO_PKG_VERSION"),
        run.manifest().world_sha256,
        ego.change(),
        ego.scenario().plant(),
    );
    if let Some(program) = ego.scenario().program() {
        let files = program.command.iter().map(Path::new);
        for bytes in files.filter_map(|path| file_bytes(path).ok()) {
            key.push_str(&sha256(&bytes));
        }
    }
    let name = sha256(key.as_bytes())[..16].to_owned();
    Some(run.path().join(DIR).join(name))
}
