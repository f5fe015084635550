//! Worlds that are shipped inside the program.

use std::path::Path;

use super::runs::{NamedRun, Nowhere, RunRefused, RunSource};
use super::{LoadError, Scenario, ScenarioError};
use brakecheck_worlds::{FILES, PROTOCOLS, WORLDS};

/// Source of the files of shipped worlds, without runs.
struct ShippedFiles;

impl RunSource for ShippedFiles {
    fn find(&self, name: &str, file: &str) -> Result<NamedRun, RunRefused> {
        Nowhere.find(name, file)
    }

    fn text(&self, name: &str, file: &str) -> Result<String, RunRefused> {
        let found = FILES.iter().find(|(known, _)| *known == name);
        found.map_or_else(
            || Nowhere.text(name, file),
            |(_, text)| Ok((*text).to_owned()),
        )
    }
}

impl Scenario {
    /// Returns the names of the shipped worlds, in order.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        WORLDS.iter().map(|(name, _)| *name)
    }

    /// Returns the names of the shipped test protocols, such as `ncap/cpna`, in order.
    pub fn protocol_names() -> impl Iterator<Item = &'static str> + Clone {
        PROTOCOLS.iter().map(|(name, _)| *name)
    }

    /// Returns a shipped world, as in its file in `worlds/`.
    ///
    /// `None` for an unknown name.
    ///
    /// ```
    /// # use brakecheck_world as brakecheck;
    /// use brakecheck::world::Scenario;
    ///
    /// let world = Scenario::shipped("grid").expect("it is shipped")?;
    /// assert_eq!(world.name(), "grid");
    /// assert!(Scenario::shipped("gird").is_none());
    /// # Ok::<(), brakecheck::world::ScenarioError>(())
    /// ```
    pub fn shipped(name: &str) -> Option<Result<Scenario, ScenarioError>> {
        // The list is searched before parsing: a world is only checked when it
        // is used.
        let text = Scenario::shipped_text(name)?;
        let file = format!("worlds/{name}.ron");
        Some(Scenario::parse_with(&file, text, &ShippedFiles))
    }

    /// Returns the text of a shipped world, that of its file in `worlds/`.
    ///
    /// `None` for an unknown name.
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        let mut all = WORLDS.iter().chain(&PROTOCOLS);
        let (_, text) = all.find(|(known, _)| *known == name)?;
        Some(text)
    }

    /// Returns the names and texts of the files that a shipped world includes.
    pub fn shipped_files(name: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
        let text = Scenario::shipped_text(name).unwrap_or_default();
        // A name in quotes is enough, since a file too many does no harm.
        let is_named = move |file: &&(&str, &str)| text.contains(&format!("\"{}\"", file.0));
        FILES.iter().filter(is_named).copied()
    }

    /// Returns the world of a file, or a shipped world if no such file exists.
    ///
    /// # Errors
    /// Returns an error if there is neither, or the file is not a valid world.
    ///
    /// ```
    /// # use brakecheck_world as brakecheck;
    /// use brakecheck::world::Scenario;
    ///
    /// assert_eq!(Scenario::find("merge".as_ref())?.name(), "merge");
    /// # Ok::<(), brakecheck::world::LoadError>(())
    /// ```
    pub fn find(file_or_name: &Path) -> Result<Scenario, LoadError> {
        // A file of that name takes precedence over a shipped world.
        let name = file_or_name.to_str().filter(|_| !file_or_name.exists());
        match name.and_then(Scenario::shipped) {
            Some(world) => world.map_err(|error| LoadError::Scenario(Box::new(error))),
            None => Scenario::load(file_or_name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Start;
    use crate::seed::{Purpose, StartKey};
    use crate::testbench::{Aftermath, Constant, play};
    use crate::trace::Trace;
    use crate::world_file;

    /// Returns the start, the bits of the robustness and the trace of an episode.
    fn played(world: &Scenario) -> (Start, u64, Trace) {
        let key = StartKey {
            purpose: Purpose::Train,
            seed: 0,
            index: 0,
        };
        let mut bench = world.bench();
        let start = bench.draw(key);
        let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Skip);
        (start, episode.robustness.to_bits(), episode.trace)
    }

    #[test]
    fn a_world_of_a_value_drives_as_that_of_its_text() {
        for (name, text) in WORLDS {
            let value = world_file::parse(name, text).expect("a value");
            let written = world_file::text(&value).expect("a text");
            // `Scenario::of` alone finds no road files beside a world.
            let of_value = Scenario::parse_with(name, &written, &ShippedFiles)
                .unwrap_or_else(|error| panic!("{error}"));
            let own = Scenario::shipped(name)
                .expect("it is shipped")
                .expect("a world");
            assert!(played(&of_value) == played(&own), "{name}");
        }
    }
}
