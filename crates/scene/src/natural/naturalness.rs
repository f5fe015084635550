//! How rare the driving of ados was, in words and numbers.

use std::fmt::{self, Display, Formatter};

use serde::{Deserialize, Serialize};

use super::behaviour::behaviours;
use crate::scene::drive::DriveWorld;
use crate::trace::Trace;
use brakecheck_driver_model::{DrivingBehaviour, Outside, Rarity, TrafficModel};

/// Rarity of an ado's driving in one episode, among real drivers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Naturalness {
    /// Model of real drivers.
    pub model: String,
    /// Ado with the rarest driving.
    pub ado: String,
    /// Its rarest event. `None` if it neither brakes nor cuts in, or outside the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rarest: Option<String>,
    /// Rate of that event per 1,000 km.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub per_1000_km: Option<f64>,
    /// Decades by which its accelerations are less likely than those of a median driver.
    ///
    /// `None` outside the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surprise_decades: Option<f64>,
    /// Quantities of which the model has no data. The rarity then has no answer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outside: Vec<String>,
}

/// Naturalness of the successes of a row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NaturalnessOfRow {
    /// Limit on the ados, in events per 1,000 km. `None` without a limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit_per_1000_km: Option<f64>,
    /// Number of successes with a rarity.
    pub successes: usize,
    /// Successes with driving of which the model has no data.
    pub outside_data: usize,
    /// Success of median rarity among those inside the data. `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub median: Option<Naturalness>,
}

/// Driving of the ado that drives most rarely in an episode.
#[derive(Clone, Debug, PartialEq)]
pub struct SuccessRarity {
    ado: String,
    behaviour: DrivingBehaviour,
    rarity: Rarity,
}

impl SuccessRarity {
    /// Returns the rarest driving over the first samples of an episode.
    ///
    /// `None` if no ado drives a vehicle.
    pub fn of(
        model: &TrafficModel,
        world: &DriveWorld,
        trace: &Trace,
        samples: usize,
    ) -> Option<SuccessRarity> {
        // One rare ado makes an episode rare, however the others drive.
        let all = behaviours(world, trace, samples).into_iter();
        let rated = all.map(|(ado, behaviour)| SuccessRarity {
            rarity: model.rarity(&behaviour),
            ado,
            behaviour,
        });
        // The first of equally rare ados, so that the answer does not depend on the sort.
        rated.min_by(|a, b| a.rate().total_cmp(&b.rate()))
    }

    /// Returns the rate of the rarest event, infinite without an event.
    fn rate(&self) -> f64 {
        let rarest = self.rarity.rarest();
        // An ado that neither brakes hard nor cuts in is never the rarest.
        rarest.map_or(f64::INFINITY, |event| event.per_1000_km.rate)
    }

    fn is_outside(&self) -> bool {
        !self.rarity.outside.is_empty()
    }

    /// Returns the naturalness, whose surprise takes 20,000 natural drives.
    ///
    /// Outside the data it has no rate and no surprise.
    pub fn naturalness(&self, model: &TrafficModel) -> Naturalness {
        // A rate outside the data would be an extrapolation.
        let rarest = self.rarity.rarest().filter(|_| !self.is_outside());
        let surprise = if self.is_outside() {
            None
        } else {
            model.surprise(&self.behaviour)
        };
        let outside = self.rarity.outside.iter();
        Naturalness {
            model: model.name.clone(),
            ado: self.ado.clone(),
            rarest: rarest.map(ToString::to_string),
            per_1000_km: rarest.map(|event| event.per_1000_km.rate),
            surprise_decades: surprise.map(|it| it.decades),
            outside: outside.map(|it| outside_words(it, model)).collect(),
        }
    }
}

impl NaturalnessOfRow {
    /// Returns the naturalness of some successes.
    pub fn of(
        model: &TrafficModel,
        limit_per_1000_km: Option<f64>,
        successes: &[&SuccessRarity],
    ) -> NaturalnessOfRow {
        // Outside the data there is no rate to sort by.
        let mut inside: Vec<&&SuccessRarity> =
            successes.iter().filter(|it| !it.is_outside()).collect();
        inside.sort_by(|a, b| a.rate().total_cmp(&b.rate()));
        // Of an even number, the rarer one of the two in the middle.
        let median = inside.get(inside.len().saturating_sub(1) / 2);
        NaturalnessOfRow {
            limit_per_1000_km,
            successes: successes.len(),
            outside_data: successes.len() - inside.len(),
            median: median.map(|it| it.naturalness(model)),
        }
    }
}

impl Display for Naturalness {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        if !self.outside.is_empty() {
            let outside = self.outside.join(", ");
            return write!(
                f,
                "rarity among the drivers of `{}`: no answer: outside the data: {outside}",
                self.model
            );
        }
        match &self.rarest {
            Some(rarest) => write!(f, "among the drivers of `{}`, {rarest}", self.model)?,
            None => write!(
                f,
                "`{}` neither brakes hard nor cuts in (drivers of `{}`)",
                self.ado, self.model
            )?,
        }
        if let Some(decades) = self.surprise_decades {
            let less = if decades < 0.0 { "more" } else { "less" };
            write!(
                f,
                "; {:.1} decades {less} likely than the median drive",
                decades.abs()
            )?;
        }
        Ok(())
    }
}

impl Display for NaturalnessOfRow {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let outside = self.outside_data;
        // Saturating, since both numbers may come from an edited file.
        let inside = self.successes.saturating_sub(outside);
        match &self.median {
            Some(median) => write!(
                f,
                "in half of {inside} successes at least as rare as: {median}"
            )?,
            None if self.successes == 0 => return f.write_str("no success"),
            None => f.write_str("no answer")?,
        }
        if outside > 0 {
            write!(f, "; {outside} successes are outside the data")?;
        }
        Ok(())
    }
}

fn outside_words(outside: &Outside, model: &TrafficModel) -> String {
    let domain = &model.domain;
    match outside {
        Outside::Speed(mps) => {
            let [least, most] = domain.speed_mps;
            format!("a speed of {mps:.1} m/s, and it covers {least:.1} to {most:.1} m/s")
        }
        Outside::Acceleration(mps2) => {
            let [least, most] = domain.accel_mps2;
            format!(
                "an acceleration of {mps2:+.1} m/s², and it covers {least:+.1} to {most:+.1} m/s²"
            )
        }
        Outside::LateralSpeed(mps) => {
            let most = domain.cut_in_lateral_mps;
            format!("a cut-in with {mps:.1} m/s to the side, and it covers {most:.1} m/s")
        }
        // The type belongs to another crate and may gain quantities.
        _ => "another quantity".to_owned(),
    }
}

#[cfg(test)]
mod tests;
