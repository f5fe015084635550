//! Lookup of the kept counterexamples to replay, and of the ego to replay against.

use std::path::{Path, PathBuf};

use super::regressions::Regressions;
use crate::experiment::{EgoError, EgoUnderTest};
use crate::ron_file::LoadError;
use crate::run_dir::KeptError;
use crate::world::Scenario;

/// No kept counterexample fits the request.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FindError {
    /// The directory has fewer counterexamples.
    #[error("there is no episode {number} in `{}`", dir.display())]
    NoEpisode {
        /// Requested number.
        number: usize,
        /// Directory.
        dir: PathBuf,
        /// Number of episodes in it.
        count: usize,
    },
    /// The path is a world.
    #[error("`{}` is a world, and no kept counterexample", world.display())]
    World {
        /// File or name of the world.
        world: PathBuf,
        /// True if the world lists points to play.
        has_points: bool,
    },
    /// The path does not exist.
    #[error("there is no `{}`", path.display())]
    Missing {
        /// Path.
        path: PathBuf,
        /// Expected kind of path, in words.
        want: &'static str,
    },
    /// A directory is given in place of a file, or the reverse.
    #[error("`{}` is no {want}", path.display())]
    WrongKind {
        /// Path.
        path: PathBuf,
        /// Expected kind of path, in words.
        want: &'static str,
    },
    /// The other ego cannot be tested.
    #[error(transparent)]
    Ego(#[from] EgoError),
    /// A change that cannot be loaded.
    #[error(transparent)]
    Change(#[from] LoadError),
    /// A file is not usable.
    #[error(transparent)]
    Kept(#[from] KeptError),
}

impl FindError {
    /// Returns the fix, or `None` if the error has another form.
    pub fn help(&self) -> Option<String> {
        Some(match self {
            FindError::NoEpisode { count, .. } => format!("it holds {count}, counted from 0"),
            FindError::World { world, has_points } => {
                let world = world.display();
                let keep = if *has_points {
                    format!("brakecheck eval {world} --keep kept -- COMMAND")
                } else {
                    format!("brakecheck search {world} --keep kept")
                };
                format!("keep what fails in it first: `{keep}`; then name the directory `kept`")
            }
            FindError::Missing { want, .. } | FindError::WrongKind { want, .. } => {
                format!("name a {want}")
            }
            FindError::Ego(error) => return error.help(),
            FindError::Change(_) | FindError::Kept(_) => return None,
        })
    }
}

impl Regressions {
    /// Returns the kept counterexamples under a file, a directory or a run.
    ///
    /// `episode` selects one of them by its number, from 0, or by its file.
    ///
    /// # Errors
    /// Returns an error if no counterexample matches or a file is damaged.
    pub fn find(what: &Path, episode: Option<&str>) -> Result<Regressions, FindError> {
        let inside = what.join("episodes");
        // A run keeps its counterexamples in a directory of their own.
        let dir = if what.join("manifest.json").is_file() {
            inside.as_path()
        } else {
            what
        };
        // A world is a frequent mistake, so it gets a help text of its own.
        if is_world(what) {
            return Err(no_world(what));
        }
        if !dir.exists() {
            return Err(wrong_kind(dir, "kept counterexample or directory of them"));
        }
        let Some(episode) = episode else {
            return Ok(Regressions::load(dir)?);
        };
        if let Ok(number) = episode.parse::<usize>() {
            let all = Regressions::load(dir)?;
            let count = all.kept().len();
            return match all.kept().get(number) {
                // Only the selected file is loaded again, so no other counterexample is replayed.
                Some(kept) => Ok(Regressions::load(&kept.path)?),
                None => Err(FindError::NoEpisode {
                    number,
                    dir: dir.into(),
                    count,
                }),
            };
        }
        let named = dir.join(episode);
        let file = if named.exists() {
            named
        } else {
            // The file may be named without its extension.
            dir.join(format!("{episode}.ron"))
        };
        if file.is_file() {
            Ok(Regressions::load(&file)?)
        } else {
            Err(wrong_kind(&file, "kept counterexample"))
        }
    }

    /// Replaces the ego by a name under `reuse`, a RON file, or a program.
    ///
    /// Naming a program is the consent to start it.
    ///
    /// # Errors
    /// Returns an error if both are given or if the file holds no change that fits.
    pub fn against(self, ego: Option<&str>, program: &[String]) -> Result<Regressions, FindError> {
        let Some(ego) = ego else {
            return Ok(if program.is_empty() {
                self
            } else {
                let change = EgoUnderTest::change_to(program);
                self.with_change(change).allow_programs(true)
            });
        };
        if !program.is_empty() {
            return Err(EgoError::NamedTwice.into());
        }
        let path = Path::new(ego);
        if path.extension().is_none_or(|extension| extension != "ron") {
            return Ok(self.with_named_ego(ego));
        }
        // Without counterexamples the change has no world to be checked against.
        let Some(first) = self.kept().first() else {
            return Ok(self);
        };
        let world: Scenario = first.counterexample.nominal(&first.path)?;
        let (change, _) = world.changed_by(path)?;
        Ok(self.with_change(change))
    }
}

/// Returns whether the path names a shipped world or a file with a world.
fn is_world(what: &Path) -> bool {
    !what.is_dir() && Scenario::find(what).is_ok()
}

/// Reports a world in the place of a kept counterexample.
fn no_world(what: &Path) -> FindError {
    FindError::World {
        world: what.into(),
        has_points: Scenario::find(what).is_ok_and(|world| world.has_points()),
    }
}

/// Reports a path of the wrong kind.
fn wrong_kind(path: &Path, want: &'static str) -> FindError {
    let is_there = path.exists();
    let path = path.into();
    if is_there {
        FindError::WrongKind { path, want }
    } else {
        FindError::Missing { path, want }
    }
}
