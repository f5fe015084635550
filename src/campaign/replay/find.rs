//! Lookup of the kept counterexamples to replay, and of the ego to replay against.

use std::path::Path;

use super::Regressions;
use crate::campaign::ego_under_test::EgoUnderTest;
use crate::campaign::error::CampaignError;
use crate::scenario::Scenario;

impl Regressions {
    /// Returns the kept counterexamples under a file, a directory or a run.
    ///
    /// `episode` selects one of them by its number, from 0, or by its file.
    ///
    /// # Errors
    /// Returns an error if no counterexample matches or a file is damaged.
    pub fn find(what: &Path, episode: Option<&str>) -> Result<Regressions, CampaignError> {
        let inside = what.join("episodes");
        // A run keeps its counterexamples in a directory of their own.
        let dir = match what.join("manifest.json").is_file() {
            true => inside.as_path(),
            false => what,
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
                None => Err(CampaignError::request(
                    format!("there is no episode {number} in `{}`", dir.display()),
                    format!("it holds {count}, counted from 0"),
                )),
            };
        }
        let file = dir.join(episode);
        let file = match file.exists() {
            // The file may be named without its extension.
            true => file,
            false => dir.join(format!("{episode}.ron")),
        };
        match file.is_file() {
            true => Ok(Regressions::load(&file)?),
            false => Err(wrong_kind(&file, "kept counterexample")),
        }
    }

    /// Replaces the ego by a name under `reuse`, a RON file, or a program.
    ///
    /// Naming a program is the consent to start it.
    ///
    /// # Errors
    /// Returns an error if both are given or if the file holds no change that fits.
    pub fn against(
        self,
        ego: Option<&str>,
        program: &[String],
    ) -> Result<Regressions, CampaignError> {
        let Some(ego) = ego else {
            return Ok(match program.is_empty() {
                true => self,
                false => {
                    let change = EgoUnderTest::change_to(program);
                    self.with_change(change).allow_programs(true)
                }
            });
        };
        if !program.is_empty() {
            return Err(CampaignError::request(
                "`--ego` names one ego, and the program after `--` is another",
                "leave out one of the two",
            ));
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
fn no_world(what: &Path) -> CampaignError {
    let world = what.display();
    let keep = match Scenario::find(what).is_ok_and(|world| world.has_points()) {
        true => format!("brakecheck eval {world} --keep kept -- COMMAND"),
        false => format!("brakecheck search {world} --keep kept"),
    };
    CampaignError::request(
        format!("`{world}` is a world, and no kept counterexample"),
        format!("keep what fails in it first: `{keep}`; then name the directory `kept`"),
    )
}

/// Reports a path of the wrong kind.
fn wrong_kind(path: &Path, want: &str) -> CampaignError {
    let what = match path.exists() {
        true => format!("`{}` is no {want}", path.display()),
        false => format!("there is no `{}`", path.display()),
    };
    CampaignError::request(what, format!("name a {want}"))
}
