//! Traffic of a risk: declared in a file, or fitted to recordings.

use std::path::Path;
use std::sync::Arc;

use super::action_law::ActionLaw;
use super::law_binding::LawBinder;
use super::start_law::StartLaw;
use crate::content_hash::sha256;
use crate::experiment::{TrafficError, traffic_model};
use crate::ron_file::{
    LoadError, Ordered, Problem, Problems, ScenarioError, ValuePath, file_text, first_word,
    parse_ron,
};
use crate::scene::drive::DriveWorld;
use crate::world::{AdoLawFile, DeclaredTrafficFile, EncounterRate, FittedFile, Scenario};
use brakecheck_driver_model::TrafficModel;

/// Laws of the starts and of the ados' actions in a world.
///
/// Read one with [`RiskTraffic::read`], or take that of a world with
/// [`RiskTraffic::of_world`].
#[derive(Clone, Debug)]
pub struct RiskTraffic {
    /// Origin of the laws.
    pub source: String,
    /// Number of encounters like a run, if declared.
    pub exposure: Option<EncounterRate>,
    /// Axes of X_init that are uniform, because no law is declared for them.
    pub uniform_axes: Vec<String>,
    pub(super) starts: StartLaw,
    pub(super) actions: ActionLaw,
    /// Laws as a world file has them.
    pub(super) file: DeclaredTrafficFile,
    /// SHA-256 of the text of the laws.
    pub(super) sha256: String,
}

/// Failure to read the traffic of a risk.
#[derive(Debug, thiserror::Error)]
pub enum RiskTrafficError {
    /// The file cannot be read, or does not fit the world.
    #[error(transparent)]
    File(#[from] LoadError),
    /// The model of recorded traffic cannot be read.
    #[error(transparent)]
    Model(#[from] TrafficError),
    /// The world is not driven.
    #[error("`{world}` is a grid, in which no traffic drives")]
    Grid {
        /// Name of the world.
        world: String,
    },
}

impl RiskTraffic {
    /// Reads traffic for a world.
    ///
    /// `name` is `motorway`, a model of `log --fit`, or a file with `Traffic(…)`. A model
    /// alone gives the laws of actions, and uniform starts.
    ///
    /// # Errors
    /// The file cannot be read, does not fit the world, or leaves an ado without a law.
    pub fn read(world: &Scenario, name: &str) -> Result<RiskTraffic, RiskTrafficError> {
        let text = match name {
            // The shipped model has no file to read.
            "motorway" => String::new(),
            file => file_text(Path::new(file)).map_err(|source| LoadError::Io {
                file: file.to_owned(),
                source,
            })?,
        };
        // The shipped model has an empty text here.
        let is_model = first_word(&text).is_none_or(|it| &text[it] == "TrafficModel");
        if is_model {
            let laws = Laws::fitted(name, traffic_model(Some(name))?);
            return laws.bound(world, name, &text);
        }
        RiskTraffic::parse(world, name, &text)
    }

    /// Reads the text of a file with `Traffic(…)`, whose name is for messages only.
    ///
    /// # Errors
    /// The text does not fit the world, or leaves an ado without a law.
    pub fn parse(
        world: &Scenario,
        name: &str,
        text: &str,
    ) -> Result<RiskTraffic, RiskTrafficError> {
        let file: DeclaredTrafficFile =
            parse_ron(text).map_err(|problem| placed(name, text, vec![problem]))?;
        Laws::declared(file, ValuePath::top())?.bound(world, name, text)
    }

    /// Returns the traffic that a world declares as its `traffic`. `None` without one.
    ///
    /// # Errors
    /// The laws do not fit the world, or leave an ado without a law.
    pub fn of_world(world: &Scenario) -> Result<Option<RiskTraffic>, RiskTrafficError> {
        let Some(file) = world.declared_laws() else {
            return Ok(None);
        };
        let laws = Laws::declared(file.clone(), ValuePath::top().to("traffic"))?;
        // The laws stand in the world file, so mistakes are marked there.
        laws.bound(world, world.name(), world.text()).map(Some)
    }
}

/// Laws before they are bound to a world.
struct Laws {
    file: Option<DeclaredTrafficFile>,
    /// Place of the file in the text.
    top: ValuePath,
    model: Option<Arc<TrafficModel>>,
    /// Name of the model, if it has no file of laws.
    name: Option<String>,
}

impl Laws {
    fn fitted(name: &str, model: Arc<TrafficModel>) -> Laws {
        Laws {
            file: None,
            top: ValuePath::top(),
            model: Some(model),
            name: Some(name.to_owned()),
        }
    }

    fn declared(file: DeclaredTrafficFile, top: ValuePath) -> Result<Laws, TrafficError> {
        let named = file.model.as_deref();
        let model = named.map(|name| traffic_model(Some(name))).transpose()?;
        Ok(Laws {
            file: Some(file),
            top,
            model,
            name: None,
        })
    }

    /// Binds the laws to a world, with mistakes placed in a text.
    fn bound(
        self,
        world: &Scenario,
        name: &str,
        text: &str,
    ) -> Result<RiskTraffic, RiskTrafficError> {
        let Some(driving) = world.drive() else {
            return Err(RiskTrafficError::Grid {
                world: world.name().to_owned(),
            });
        };
        let bound = bind(world, driving.world(), self, text);
        Ok(bound.map_err(|problems| placed(name, text, problems))?)
    }

    /// Returns the laws in the form of a file.
    ///
    /// A model alone is fitted to every ado.
    fn as_file(&self, driving: &DriveWorld) -> DeclaredTrafficFile {
        let fitted = || {
            let sets = driving.spec().action_sets();
            let law = || AdoLawFile::Fitted(FittedFile { lateral: None });
            DeclaredTrafficFile {
                source: self.source(),
                // A model of accelerations knows nothing of how often a run is met.
                exposure: None,
                model: self.name.clone(),
                starts: Ordered::default(),
                ados: Ordered(sets.map(|(name, ..)| (name.to_owned(), law())).collect()),
            }
        };
        self.file.clone().unwrap_or_else(fitted)
    }

    fn source(&self) -> String {
        let model = self.model.as_ref().map(|model| model.name.clone());
        match (&self.file, model) {
            (Some(file), None) => file.source.clone(),
            (Some(file), Some(model)) => format!("{}; model `{model}`", file.source),
            (None, model) => format!("model `{}`", model.unwrap_or_default()),
        }
    }
}

fn placed(file: &str, text: &str, problems: Vec<Problem>) -> LoadError {
    LoadError::Scenario(Box::new(ScenarioError {
        file: file.to_owned(),
        text: text.to_owned(),
        problems,
    }))
}

fn bind(
    world: &Scenario,
    driving: &DriveWorld,
    laws: Laws,
    text: &str,
) -> Result<RiskTraffic, Vec<Problem>> {
    let mut problems = Problems::new(text);
    // A model alone declares no law of starts, so all axes are uniform.
    let none = Ordered::default();
    let declared = laws.file.as_ref().map_or(&none, |file| &file.starts);
    let starts = StartLaw::bind(world, &laws.top, declared, &mut problems);
    let uniform = world
        .axes()
        .into_iter()
        .map(|axis| axis.name)
        .filter(|axis| !declared.0.contains_key(axis));
    let bench = world.bench();
    let actions = LawBinder {
        spec: driving.spec(),
        schema: bench.schema(),
        top: laws.top.clone(),
        model: laws.model.clone(),
        problems: &mut problems,
    }
    .bind(laws.file.as_ref().map(|file| &file.ados));
    problems.done()?;
    // Invariant: laws without a problem are bound.
    let actions = actions.ok_or_else(|| problems.into_list())?;
    // The text of a model counts too, since its file may change under its name.
    let model = laws
        .model
        .as_ref()
        .map(|model| model.to_ron())
        .unwrap_or_default();
    Ok(RiskTraffic {
        file: laws.as_file(driving),
        source: laws.source(),
        exposure: laws.file.as_ref().and_then(|file| file.exposure),
        uniform_axes: uniform.collect(),
        starts,
        actions,
        sha256: sha256(format!("{text}{model}").as_bytes()),
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TRAFFIC, world};
    use super::*;

    #[test]
    fn traffic_names_its_origin_and_the_axes_without_a_law() {
        let world = world();
        let declared = RiskTraffic::parse(&world, "t.ron", TRAFFIC).expect("sound");
        assert_eq!(declared.source, "test");
        assert_eq!(declared.uniform_axes, [""; 0]);
        assert!(declared.exposure.is_none());
        let fitted = RiskTraffic::read(&world, "motorway").expect("shipped");
        let name = TrafficModel::motorway().name;
        assert_eq!(fitted.source, format!("model `{name}`"));
        assert_eq!(fitted.uniform_axes, ["ado.headway"]);
        let both = "Traffic(source: \"mine\", model: \"motorway\", \
                    exposure: PerHour(20.0), starts: {}, ados: { \"ado\": Fitted() })";
        let both = RiskTraffic::parse(&world, "t.ron", both).expect("sound");
        assert_eq!(both.source, format!("mine; model `{name}`"));
        assert_eq!(both.exposure, Some(EncounterRate::PerHour(20.0)));
    }

    #[test]
    fn a_model_that_changes_under_its_name_is_other_traffic() {
        let dir = tempfile::tempdir().expect("a directory");
        let file = dir.path().join("roads.ron").display().to_string();
        let (world, model) = (world(), TrafficModel::motorway());
        let declared = format!(
            "Traffic(source: \"mine\", model: {file:?}, starts: {{}}, \
             ados: {{ \"ado\": Fitted() }})"
        );
        let mut digests = Vec::new();
        for freedom in [model.driver.freedom, 2.0 * model.driver.freedom] {
            let mut model = model.clone();
            model.driver.freedom = freedom;
            std::fs::write(&file, model.to_ron()).expect("written");
            // By the name of the model, and by a file that names it.
            let read = RiskTraffic::read(&world, &file).expect("a model");
            assert!(read.source.starts_with("model `"), "{}", read.source);
            let named = RiskTraffic::parse(&world, "t.ron", &declared).expect("sound");
            digests.extend([read.sha256, named.sha256]);
        }
        digests.sort();
        digests.dedup();
        assert_eq!(digests.len(), 4);
    }
}
