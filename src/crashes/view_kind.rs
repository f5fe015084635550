//! Kinds of files that show an episode, by their names.

use std::path::{Path, PathBuf};

/// Kind of file that shows an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewKind {
    /// `.rrd`, for the rerun viewer; see [`crate::view`].
    Recording,
    /// `.svg`, for any browser; see [`picture`](super::picture::picture).
    Picture,
}

/// File name without a known kind.
#[derive(Clone, Debug, thiserror::Error)]
#[error("`{}` is neither a recording nor a picture", file.display())]
pub struct UnknownViewKind {
    /// The file.
    pub file: PathBuf,
}

impl UnknownViewKind {
    /// The fix.
    pub fn help(&self) -> &'static str {
        "name a `.rrd`, for the rerun viewer, or a `.svg`, for any browser"
    }
}

impl ViewKind {
    /// Returns the kind of a file by its extension, in either case.
    ///
    /// # Errors
    /// Files with this name are not written.
    ///
    /// ```
    /// use brakecheck::crashes::ViewKind;
    /// assert_eq!(ViewKind::of("crash.SVG".as_ref())?, ViewKind::Picture);
    /// assert!(ViewKind::of("crash.png".as_ref()).is_err());
    /// # Ok::<(), brakecheck::crashes::UnknownViewKind>(())
    /// ```
    pub fn of(output: &Path) -> Result<ViewKind, UnknownViewKind> {
        let extension = output.extension().unwrap_or_default();
        let is = |kind: &str| extension.eq_ignore_ascii_case(kind);
        match (is("rrd"), is("svg")) {
            (true, _) => Ok(ViewKind::Recording),
            (_, true) => Ok(ViewKind::Picture),
            _ => Err(UnknownViewKind {
                file: output.into(),
            }),
        }
    }
}
