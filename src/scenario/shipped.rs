//! The worlds that come with brakecheck, inside the program.

use std::path::Path;

use super::{LoadError, Scenario, ScenarioError};

/// A world's name and text.
macro_rules! world {
    ($name:literal) => {
        ($name, include_str!(concat!("../../worlds/", $name, ".ron")))
    };
}

const WORLDS: [(&str, &str); 25] = [
    world!("acc"),
    world!("acc_iso"),
    world!("acc_paper"),
    world!("acc_plain"),
    world!("acc_structures"),
    world!("bend"),
    world!("crossroads"),
    world!("cut_in"),
    world!("cut_in_clear"),
    world!("grid"),
    world!("grid_hard"),
    world!("light_ado"),
    world!("merge"),
    world!("merge_fair"),
    world!("merge_paper"),
    world!("merge_plain"),
    world!("merge_r157"),
    world!("oncoming"),
    world!("pedestrian"),
    world!("pedestrian_hit"),
    world!("sandwich"),
    world!("turn_across"),
    world!("yellow_light"),
    world!("yellow_light_fixed"),
    world!("yellow_light_plain"),
];

impl Scenario {
    /// Names of the shipped worlds, in order.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> + Clone {
        WORLDS.iter().map(|(name, _)| *name)
    }

    /// A shipped world, as its file in `worlds/` holds it; `None`: there is none
    /// of that name.
    ///
    /// ```
    /// use brakecheck::scenario::Scenario;
    ///
    /// let world = Scenario::shipped("grid").expect("it is shipped")?;
    /// assert_eq!(world.name(), "grid");
    /// assert!(Scenario::shipped("gird").is_none());
    /// # Ok::<(), brakecheck::scenario::ScenarioError>(())
    /// ```
    pub fn shipped(name: &str) -> Option<Result<Scenario, ScenarioError>> {
        let (name, text) = WORLDS.iter().find(|(known, _)| *known == name)?;
        Some(Scenario::parse(&format!("worlds/{name}.ron"), text))
    }
    /// The world of a file, or, where no such file is, the shipped one of that
    /// name.
    ///
    /// # Errors
    /// There is neither, or the file is not a world.
    ///
    /// ```
    /// use brakecheck::scenario::Scenario;
    ///
    /// assert_eq!(Scenario::find("merge".as_ref())?.name(), "merge");
    /// # Ok::<(), brakecheck::scenario::LoadError>(())
    /// ```
    pub fn find(file_or_name: &Path) -> Result<Scenario, LoadError> {
        let name = file_or_name.to_str().filter(|_| !file_or_name.exists());
        match name.and_then(Scenario::shipped) {
            Some(world) => world.map_err(|error| LoadError::Scenario(Box::new(error))),
            None => Scenario::load(file_or_name),
        }
    }
}
