//! Options of `search`, `eval`, `gate`, `sweep` and `train` about real traffic.

use std::path::Path;

use clap::Args;

use super::failure::Failure;
use super::headings::ADOS;
use super::terminal;
use crate::experiment::{EgoUnderTest, in_named_traffic};
use crate::risk::RiskTraffic;
use crate::ron_file::{file_text, first_word};
use crate::world::Scenario;

/// Traffic model, and limits on how rare the driving of ados may become.
#[derive(Args, Clone, Debug)]
pub(super) struct TrafficArgs {
    /// Real drivers to compare ados with: `motorway`, or a file of `log --fit`.
    #[arg(long, value_name = "NAME|FILE.ron", help_heading = ADOS)]
    traffic: Option<String>,
    /// Leave ados only braking, accelerations and cut-ins with at least this rate per 1,000 km.
    #[arg(long, value_name = "RATE,...", value_delimiter = ',', value_parser = rate, help_heading = ADOS)]
    natural: Vec<f64>,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate > 0.0 && rate.is_finite() => Ok(rate),
        _ => Err("a rate is a number above 0, such as 3 or 0.5".to_owned()),
    }
}

/// Word for the laws that the world declares itself.
const OF_WORLD: &str = "world";

impl TrafficArgs {
    /// Returns the laws that ados are trained by, if `--traffic` names declared traffic.
    ///
    /// # Errors
    /// The laws cannot be read, do not fit the world, or stand beside a limit.
    pub(super) fn laws(&self, world: &Scenario) -> Result<Option<RiskTraffic>, Failure> {
        let Some(name) = &self.traffic else {
            return Ok(None);
        };
        let laws = if name == OF_WORLD {
            RiskTraffic::of_world(world)?.ok_or_else(|| {
                Failure::input(
                    format!("`{}` declares no traffic", world.name()),
                    "name a file, or add `traffic: Traffic(…)` to the world",
                )
            })?
        } else {
            // A name without a file may be a shipped model, so a failed reading is no
            // error here.
            let text = file_text(Path::new(name)).unwrap_or_default();
            // Any other file is a model of real drivers.
            if first_word(&text).is_none_or(|word| &text[word] != "Traffic") {
                return Ok(None);
            }
            RiskTraffic::read(world, name)?
        };
        if !self.natural.is_empty() {
            return Err(Failure::input(
                "declared traffic has laws of its own, and `--natural` limits another model",
                "leave out one of the two",
            ));
        }
        Ok(Some(laws))
    }

    /// Returns the world in the declared traffic, without the limits.
    ///
    /// # Errors
    /// The model cannot be read, or no ado of the world drives a vehicle.
    pub(super) fn declared(&self, world: Scenario) -> Result<Scenario, Failure> {
        // Without an option, the world keeps the traffic of its file.
        if self.traffic.is_none() && self.natural.is_empty() {
            return Ok(world);
        }
        let world = in_named_traffic(&world, self.traffic.as_deref())?;
        let model = &world.traffic().model;
        let supported = model.supported_per_1000_km();
        let rates: Vec<String> = self
            .natural
            .iter()
            .filter(|rate| **rate < supported)
            .map(ToString::to_string)
            .collect();
        if !rates.is_empty() {
            terminal::note(&format!(
                "warning: `--natural {}` is extrapolated: the data of `{}` supports rates from \
                 {supported:.1} per 1,000 km on",
                rates.join(","),
                model.name
            ));
        }
        Ok(world)
    }

    /// Returns the world in the declared traffic, with the limit if there is exactly one.
    ///
    /// # Errors
    /// As [`TrafficArgs::declared`].
    pub(super) fn limited(&self, world: Scenario) -> Result<Scenario, Failure> {
        let world = self.declared(world)?;
        Ok(match *self.natural.as_slice() {
            // With several rates each ego gets its own, which is done by `levels`.
            [rate] => world.naturally(rate),
            _ => world,
        })
    }

    /// Refuses several limits in a verb that plays one.
    ///
    /// # Errors
    /// There are several.
    pub(super) fn one_rate(&self, verb: &str) -> Result<(), Failure> {
        if self.natural.len() < 2 {
            return Ok(());
        }
        Err(Failure::input(
            format!("`{verb}` takes one rate after `--natural`"),
            "give one rate, and run it again for each other one",
        ))
    }

    /// Returns each ego with each limit, or the egos as they are without a limit.
    pub(super) fn levels(&self, egos: Vec<EgoUnderTest>) -> Vec<EgoUnderTest> {
        if self.natural.is_empty() {
            return egos;
        }
        let levels = |ego: &EgoUnderTest| {
            let ego = ego.clone();
            let rates = self.natural.iter();
            rates.map(move |rate| ego.in_world(ego.scenario().naturally(*rate)))
        };
        egos.iter().flat_map(levels).collect()
    }

    /// Refuses to keep the counterexamples of several limits in one directory.
    pub(super) fn keep_one(&self, dir: Option<&Path>) -> Result<(), Failure> {
        match dir {
            Some(_) if self.natural.len() > 1 => Err(Failure::input(
                "`--keep` requires one rate after `--natural`, since files of several have equal names",
                "give one rate, and another directory for each other one",
            )),
            _ => Ok(()),
        }
    }
}
