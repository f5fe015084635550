//! Files that are there whole or not at all, locks and hashes.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use sha2::{Digest, Sha256};

use super::RunError;
use crate::scenario::Scenario;

/// Writes a file whole or not at all.
///
/// # Errors
/// The disk refuses; an older file of that name is then untouched.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let dir = match path.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    };
    let failed = io_error("writing", path);
    let mut file = tempfile::Builder::new()
        .prefix(".brakecheck-")
        .tempfile_in(dir)
        .map_err(&failed)?;
    file.write_all(bytes).map_err(&failed)?;
    file.as_file().sync_all().map_err(&failed)?;
    readable(file.as_file()).map_err(&failed)?;
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

/// Temporary files begin private; what is kept gets ordinary permissions.
#[cfg(unix)]
fn readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable(_file: &File) -> io::Result<()> {
    Ok(())
}

/// Whether a directory holds anything but the beginnings of a run.
pub(super) fn is_taken(path: &Path) -> bool {
    let Ok(entries) = fs::read_dir(path) else {
        return false;
    };
    let begun =
        |name: &str| ["lock", "world.ron"].contains(&name) || name.starts_with(".brakecheck-");
    let mut names = entries.flatten().map(|entry| entry.file_name());
    names.any(|name| !begun(&name.to_string_lossy()))
}

/// Holds a run directory for one process.
pub(super) fn lock(path: &Path) -> Result<File, RunError> {
    let file_path = path.join("lock");
    let file = File::create(&file_path).map_err(io_error("creating", &file_path))?;
    match fs4::FileExt::try_lock(&file) {
        Ok(()) => Ok(file),
        Err(_) => Err(RunError::Locked { path: path.into() }),
    }
}

/// An error of the disk, by what was tried and where.
pub(super) fn io_error(verb: &'static str, path: &Path) -> impl Fn(io::Error) -> RunError + use<> {
    let path = path.to_owned();
    move |source| RunError::Io {
        verb,
        path: path.clone(),
        source,
    }
}

/// Of bytes, in hexadecimal digits.
pub(super) fn sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What a world file leaves to defaults, too, of its learner and its family:
/// another version of the program may have others.
pub(super) fn settings_of(scenario: &Scenario) -> String {
    let settings = format!("{:?} {:?}", scenario.learner, scenario.family());
    sha256(settings.as_bytes())
}

/// A name as a file is called: whatever could disturb a path is replaced.
pub fn file_name(name: &str) -> String {
    let plain = |c: char| match c.is_ascii_alphanumeric() {
        true => c,
        false => '-',
    };
    name.chars().map(plain).collect()
}
