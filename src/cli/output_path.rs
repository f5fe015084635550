//! Files and directories that a command writes, refused before its work.
//!
//! Otherwise a wrong path would cost all that was computed.

use std::path::{Path, PathBuf};

use clap::builder::{PathBufValueParser, TypedValueParser};

/// Parser of a file that will be written.
pub(super) fn new_file() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|file| check_file(&file).map(|()| file))
}

/// Parser of a picture that will be written, which is always SVG.
pub(super) fn new_svg() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|file| check_svg(&file).map(|()| file))
}

/// Parser of a directory that will be created or has files added.
pub(super) fn new_dir() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|dir| check_dir(&dir).map(|()| dir))
}

fn check_file(file: &Path) -> Result<(), String> {
    if file.is_dir() {
        return Err("it is a directory: name a file in it".to_owned());
    }
    let dir = file.parent().unwrap_or(file);
    // A bare name is in the current directory.
    if dir.as_os_str().is_empty() || dir.is_dir() {
        return Ok(());
    }
    Err(format!(
        "there is no directory `{}`: make it first, or name a file in another",
        dir.display()
    ))
}

fn check_svg(file: &Path) -> Result<(), String> {
    // A viewer would take the text for a damaged picture. A name without an ending is
    // right for a pipe.
    match file.extension() {
        Some(ending) if !ending.eq_ignore_ascii_case("svg") => {
            Err("the picture is SVG: name a file that ends in .svg".to_owned())
        }
        _ => check_file(file),
    }
}

/// Refuses a directory that cannot be created because a file is in its place.
pub(super) fn check_dir(dir: &Path) -> Result<(), String> {
    // Parents are created, too, so the nearest existing one decides.
    let existing = dir.ancestors().find(|it| it.symlink_metadata().is_ok());
    match existing.filter(|it| !it.is_dir()) {
        Some(file) => Err(format!(
            "`{}` is no directory: name another",
            file.display()
        )),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_cannot_be_written_are_refused_with_the_place() {
        let scratch = tempfile::tempdir().expect("a directory");
        let at = |name: &str| scratch.path().join(name);
        std::fs::write(at("file"), "").expect("written");
        let refused = |checked: Result<(), String>| checked.expect_err("refused");
        assert!(refused(check_file(scratch.path())).contains("is a directory"));
        assert!(refused(check_file(&at("none/a.xml"))).contains("none`: make it first"));
        assert!(refused(check_file(&at("file/a.xml"))).contains("no directory"));
        assert!(refused(check_dir(&at("file"))).contains("file` is no directory"));
        assert!(refused(check_dir(&at("file/deep/er"))).contains("file` is no directory"));
        for sound in ["a.xml", "file"] {
            assert_eq!(check_file(&at(sound)), Ok(()));
        }
        assert_eq!(check_file(Path::new("bare.xml")), Ok(()));
        assert!(refused(check_svg(&at("a.png"))).contains("ends in .svg"));
        assert!(refused(check_svg(&at("none/a.svg"))).contains("make it first"));
        for sound in ["a.svg", "a.SVG", "pipe"] {
            assert_eq!(check_svg(&at(sound)), Ok(()));
        }
        assert_eq!(check_dir(&at("deep/er")), Ok(()));
        assert_eq!(check_dir(scratch.path()), Ok(()));
        assert_eq!(check_dir(Path::new("bare")), Ok(()));
    }
}
