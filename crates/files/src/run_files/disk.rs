//! Files that appear completely or not at all, growing files, and locks.
//!
//! All changes of the disk pass through this module, one step at a time, so
//! that tests can make any step fail (`disk_faults`). After a function returns, its
//! effect is on the disk: files and their directories are flushed.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sha2::Digest;

use super::RunError;
use super::disk_faults::step;
use crate::content_hash::in_digits;
use crate::ron_file::file_bytes;

/// Prefix of incomplete files. Leftovers are removed.
const UNFINISHED: &str = ".brakecheck-";

/// Makes a directory and its parents.
///
/// # Errors
///
/// Returns an error if the disk refuses.
pub fn make_dir(path: &Path) -> Result<(), RunError> {
    let failed = io_error("creating", path);
    let missing: Vec<&Path> = path
        .ancestors()
        .take_while(|dir| !dir.exists())
        .filter(|dir| !dir.as_os_str().is_empty())
        .collect();
    // From the outermost inwards. Each name is flushed before anything is in
    // it.
    for dir in missing.into_iter().rev() {
        step(dir).map_err(&failed)?;
        match fs::create_dir(dir) {
            // Another process may create it at the same time.
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => {
                return Err(failed(error));
            }
            _ => flush_dir(parent(dir)).map_err(&failed)?,
        }
    }
    // An existing file with the name of the directory is reported here.
    fs::read_dir(path).map_err(&failed)?;
    Ok(())
}

/// Writes a file completely or not at all.
///
/// # Errors
///
/// Returns an error if the disk refuses. An older file of that name stays
/// untouched.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let failed = io_error("writing", path);
    let dir = parent(path);
    sweep(dir);
    // Written beside the target: a rename is only atomic within a file system.
    let (mut file, beside) = unfinished(dir).map_err(&failed)?;
    let written = fill(&mut file, bytes, &beside).and_then(|()| {
        step(path)?;
        fs::rename(&beside, path)
    });
    if let Err(error) = written {
        // If even this fails, the next sweep removes the file.
        let _ = remove(&beside);
        return Err(failed(error));
    }
    // The rename is only durable once the directory is flushed.
    flush_dir(dir).map_err(&failed)
}

/// Writes a file that the user named, also to a device, a pipe or the target of a link.
///
/// [`write_file`] follows no link, since a directory of results may come from elsewhere.
///
/// # Errors
///
/// Returns an error if the disk refuses.
pub fn write_output(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let failed = io_error("writing", path);
    step(path).map_err(&failed)?;
    let is_link = path.is_symlink();
    let place = match fs::metadata(path) {
        // A rename would replace the device by an ordinary file. `/dev/stdout` is a link
        // that may lead to an ordinary file, into which the shell writes as well.
        Ok(file) if !file.is_file() || (is_link && path.starts_with("/dev")) => {
            let mut file = OpenOptions::new()
                .append(true)
                .open(path)
                .map_err(&failed)?;
            return file.write_all(bytes).map_err(failed);
        }
        Ok(_) if is_link => fs::canonicalize(path).map_err(&failed)?,
        // A link without a target yet makes its target.
        Err(_) if is_link => return fs::write(path, bytes).map_err(failed),
        _ => path.to_owned(),
    };
    write_file(&place, bytes)
}

/// File that is written step by step and appears completely or not at all.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    beside: PathBuf,
    file: Option<io::BufWriter<File>>,
    hash: sha2::Sha256,
}

impl WholeFile {
    /// Begins a file. An existing file stays until the new file is finished.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn begin(path: &Path) -> Result<WholeFile, RunError> {
        let dir = parent(path);
        sweep(dir);
        let (file, beside) = unfinished(dir).map_err(io_error("writing", path))?;
        Ok(WholeFile {
            path: path.into(),
            beside,
            file: Some(io::BufWriter::with_capacity(1 << 20, file)),
            hash: sha2::Sha256::default(),
        })
    }

    /// Appends bytes.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), RunError> {
        let failed = io_error("writing", &self.path);
        step(&self.path).map_err(&failed)?;
        // Hashed on the way, since the file may be too large to read again.
        self.hash.update(bytes);
        match &mut self.file {
            Some(file) => file.write_all(bytes).map_err(failed),
            None => Ok(()),
        }
    }

    /// Puts the file in its place and returns its SHA-256.
    ///
    /// # Errors
    ///
    /// Returns an error if the disk refuses. An older file of that name stays
    /// untouched.
    pub fn finish(mut self) -> Result<String, RunError> {
        let failed = io_error("writing", &self.path);
        // Taken, so that the buffer is flushed here, where an error can be
        // returned.
        if let Some(file) = self.file.take() {
            let file = file
                .into_inner()
                .map_err(|error| failed(error.into_error()))?;
            readable(&file).map_err(&failed)?;
            step(&self.path).map_err(&failed)?;
            file.sync_all().map_err(&failed)?;
        }
        step(&self.path).map_err(&failed)?;
        fs::rename(&self.beside, &self.path).map_err(&failed)?;
        flush_dir(parent(&self.path)).map_err(&failed)?;
        Ok(in_digits(&self.hash.finalize_reset()))
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        // After `finish` no file has that name.
        let _ = remove(&self.beside);
    }
}

/// New incomplete file, locked while it is written.
fn unfinished(dir: &Path) -> io::Result<(File, PathBuf)> {
    if !dir.as_os_str().is_empty() && !dir.is_dir() {
        let why = format!("there is no directory `{}`", dir.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, why));
    }
    loop {
        step(dir)?;
        let (file, path) = tempfile::Builder::new()
            .prefix(UNFINISHED)
            .disable_cleanup(true)
            .tempfile_in(dir)?
            .into_parts();
        let path = path.to_path_buf();
        match file.try_lock() {
            // Between creation and locking, a sweep may take the file for a
            // leftover.
            Ok(()) if path.exists() => return Ok((file, path)),
            Ok(()) | Err(TryLockError::WouldBlock) => {}
            // Without locks on this disk, the next file would fail, too.
            Err(TryLockError::Error(error)) => return Err(error),
        }
    }
}

fn fill(file: &mut File, bytes: &[u8], path: &Path) -> io::Result<()> {
    put(file, bytes, path)?;
    readable(file)?;
    // Flushed before the rename: otherwise a power cut may leave an empty file
    // in the place of the old file.
    step(path)?;
    file.sync_all()
}

/// Writes in two steps, like a disk that fills up in between.
fn put(file: &mut File, bytes: &[u8], path: &Path) -> io::Result<()> {
    let (one, two) = bytes.split_at(bytes.len() / 2);
    for half in [one, two] {
        step(path)?;
        file.write_all(half)?;
    }
    Ok(())
}

/// Gives a file ordinary permissions, because temporary files are private.
#[cfg(unix)]
fn readable(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable(_file: &File) -> io::Result<()> {
    Ok(())
}

/// Appends bytes to a file.
///
/// # Errors
///
/// Returns an error if the disk refuses. A part of the bytes may be in the
/// file.
pub(super) fn append(path: &Path, bytes: &[u8]) -> Result<(), RunError> {
    let failed = io_error("writing", path);
    let is_new = !path.exists();
    step(path).map_err(&failed)?;
    let mut file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .map_err(&failed)?;
    put(&mut file, bytes, path).map_err(&failed)?;
    step(path).map_err(&failed)?;
    file.sync_all().map_err(&failed)?;
    // A new file needs its name flushed as well.
    if is_new {
        flush_dir(parent(path)).map_err(&failed)
    } else {
        Ok(())
    }
}

/// Truncates a file to its first bytes.
///
/// # Errors
///
/// Returns an error if the disk refuses.
pub(super) fn cut(path: &Path, bytes: u64) -> Result<(), RunError> {
    let failed = io_error("writing", path);
    step(path).map_err(&failed)?;
    let file = OpenOptions::new().write(true).open(path).map_err(&failed)?;
    file.set_len(bytes).map_err(&failed)?;
    step(path).map_err(&failed)?;
    file.sync_all().map_err(&failed)
}

/// Removes a file. A missing file is no error.
pub fn remove(path: &Path) -> io::Result<()> {
    step(path)?;
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Removes a directory without content. Another directory, or a missing one, is no error.
///
/// # Errors
///
/// Returns an error if the disk refuses.
pub fn remove_empty_dir(path: &Path) -> io::Result<()> {
    step(path)?;
    match fs::remove_dir(path) {
        Err(error)
            if !matches!(
                error.kind(),
                io::ErrorKind::NotFound | io::ErrorKind::DirectoryNotEmpty
            ) =>
        {
            Err(error)
        }
        _ => Ok(()),
    }
}

/// Removes leftovers of killed writers from a directory, as far as possible.
///
/// A file that is still being written is locked.
pub fn sweep(dir: &Path) {
    for entry in fs::read_dir(dir).into_iter().flatten().flatten() {
        if is_unfinished(&entry.file_name().to_string_lossy()) {
            let path = entry.path();
            let Ok(file) = OpenOptions::new().write(true).open(&path) else {
                continue;
            };
            // The lock is held until the file is gone. Otherwise its writer could lock it
            // in between and lose it.
            if file.try_lock().is_ok() {
                // The next sweep tries again.
                let _ = remove(&path);
            }
        }
    }
}

/// Flushes the names in a directory.
///
/// Without it, a power cut may lose a file whose bytes are on the disk.
#[cfg(unix)]
fn flush_dir(dir: &Path) -> io::Result<()> {
    step(dir)?;
    match File::open(dir)?.sync_all() {
        // Some file systems cannot flush a directory, and need not.
        Err(error)
            if !matches!(
                error.kind(),
                io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported
            ) =>
        {
            Err(error)
        }
        _ => Ok(()),
    }
}

#[cfg(not(unix))]
fn flush_dir(_dir: &Path) -> io::Result<()> {
    Ok(())
}

/// Directory of a path.
fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    }
}

/// Returns true for the name of an incomplete file.
pub fn is_unfinished(name: &str) -> bool {
    name.starts_with(UNFINISHED)
}

/// Returns true if a directory contains more than the beginning of a run.
pub fn is_taken(path: &Path) -> bool {
    let Ok(entries) = fs::read_dir(path) else {
        return false;
    };
    let begun = |name: &str| {
        [
            "lock",
            "world.ron",
            "from.safetensors",
            "bank.json",
            "known.json",
        ]
        .contains(&name)
            || is_unfinished(name)
    };
    let mut names = entries.flatten().map(|entry| entry.file_name());
    names.any(|name| !begun(&name.to_string_lossy()))
}

/// Locks a run directory for one process.
pub fn lock(path: &Path) -> Result<File, RunError> {
    let file_path = path.join("lock");
    let failed = io_error("creating", &file_path);
    step(&file_path).map_err(&failed)?;
    if file_path.exists() && !file_path.is_file() {
        // To open a pipe for writing waits for its reader without end.
        return Err(failed(io::Error::other("it is no ordinary file")));
    }
    // The file stays after the run: a lock that was removed could be held
    // twice.
    let file = File::create(&file_path).map_err(&failed)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(RunError::Locked { path: path.into() }),
        Err(TryLockError::Error(error)) => Err(failed(error)),
    }
}

/// Returns the text of a file.
///
/// # Errors
///
/// Returns an error if the disk refuses, or the bytes are not UTF-8.
pub fn read_text(path: &Path) -> Result<String, RunError> {
    let bytes = file_bytes(path).map_err(io_error("reading", path))?;
    String::from_utf8(bytes).map_err(|error| RunError::Damaged {
        path: path.into(),
        why: error.to_string(),
    })
}

/// Returns a disk error with the attempted operation and the path.
pub fn io_error(verb: &'static str, path: &Path) -> impl Fn(io::Error) -> RunError + use<> {
    let path = path.to_owned();
    move |source| RunError::Io {
        verb,
        path: path.clone(),
        source,
    }
}

/// Returns a name as a file name, with `-` for all special characters.
pub fn file_name(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    name.chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn an_output_goes_into_a_pipe_and_through_a_link_and_replaces_neither() {
        let dir = tempfile::tempdir().expect("a directory");
        let at = |name: &str| dir.path().join(name);
        fs::write(at("file"), "old").expect("written");
        for (link, target) in [("link", "file"), ("early", "late")] {
            std::os::unix::fs::symlink(at(target), at(link)).expect("a link");
            write_output(&at(link), b"new").expect("written");
            assert!(at(link).is_symlink(), "{link}");
            assert_eq!(fs::read(at(target)).expect("read"), b"new");
        }
        let made = std::process::Command::new("mkfifo")
            .arg(at("pipe"))
            .status();
        assert!(made.expect("mkfifo").success());
        std::thread::scope(|scope| {
            let reader = scope.spawn(|| fs::read(at("pipe")));
            write_output(&at("pipe"), b"new").expect("written");
            assert_eq!(reader.join().expect("joined").expect("read"), b"new");
        });
        // A file of a run is written in place of a link, which may lead anywhere.
        write_file(&at("link"), b"own").expect("written");
        assert!(!at("link").is_symlink());
        assert_eq!(fs::read(at("file")).expect("read"), b"new");
    }

    /// Every writer sweeps the directory, in which others are writing.
    #[test]
    fn no_writer_loses_its_file_to_the_sweep_of_another() {
        let dir = tempfile::tempdir().expect("a directory");
        std::thread::scope(|scope| {
            for writer in 0..8 {
                let dir = dir.path();
                scope.spawn(move || {
                    for number in 0..60 {
                        let path = dir.join(format!("{writer}-{number}"));
                        write_file(&path, b"text").expect("written");
                    }
                });
            }
        });
        assert_eq!(fs::read_dir(dir.path()).expect("listed").count(), 8 * 60);
    }
}
