//! Reading of the weather of a world: its bounds, its start and its actions.

use super::check::{range_within, within};
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::{Actions, Range, Weather};
use crate::world_file::{NumberOrRange, ScenarioFile, SensorsFile, WeatherBoundsFile, WeatherFile};

/// Bounds of a road's coefficient of friction.
const FRICTIONS: Range = Range { lo: 0.01, hi: 2.0 };
/// Bounds of visibilities, in metres.
const VISIBILITIES_M: Range = Range {
    lo: 0.0,
    hi: 10_000.0,
};
/// Bounds of the factor on the noise of the sensors.
const NOISE_SCALES: Range = Range {
    lo: 0.0,
    hi: 1_000.0,
};
/// Bounds of every rate, in either direction.
const MAX_RATE_PER_S: f64 = 1_000.0;

/// A quantity of the weather: its field, its bounds and their limits.
struct BoundedQuantity {
    field: &'static str,
    rate: &'static str,
    bounds: Option<Range>,
    limits: Range,
}

fn quantities(bounds: &WeatherBoundsFile) -> [BoundedQuantity; 3] {
    let of = |field, rate, bounds: Option<NumberOrRange>, limits| BoundedQuantity {
        field,
        rate,
        bounds: bounds.map(|bounds| bounds.0),
        limits,
    };
    [
        of("friction", "friction_per_s", bounds.friction, FRICTIONS),
        of(
            "visibility_m",
            "visibility_mps",
            bounds.visibility_m,
            VISIBILITIES_M,
        ),
        of(
            "noise_scale",
            "noise_per_s",
            bounds.noise_scale,
            NOISE_SCALES,
        ),
    ]
}

/// Reads the weather and reports its mistakes. `path` is its place among the agents.
pub(super) fn read(
    problems: &mut Problems,
    path: &ValuePath,
    file: &ScenarioFile,
    weather: &WeatherFile,
) -> Weather {
    let place = path.to("bounds");
    let quantities = quantities(&weather.bounds);
    // The start is compared with sound bounds only.
    let sound = quantities.each_ref().map(|quantity| {
        let place = place.to(quantity.field);
        quantity
            .bounds
            .filter(|bounds| range_within(problems, &place, *bounds, quantity.limits))
    });
    if quantities.iter().all(|quantity| quantity.bounds.is_none()) {
        let help = "write bounds: (friction: (0.3, 0.9))".to_owned();
        let what = "this weather changes nothing";
        problems.add(&place, what, "no bounds", Some(help));
    }
    let [friction, visibility, noise] = quantities.each_ref().map(|quantity| quantity.bounds);
    // Visibility is missing here, because it has a start of its own.
    begins_within(problems, &place, file, sound[0], sound[2]);
    rates(
        problems,
        &path.to("drive").to("actions"),
        &quantities,
        weather,
    );
    Weather {
        name: weather.name.clone(),
        friction,
        visibility_m: visibility,
        // Bounds that are wrong already leave nothing to compare a start with.
        first_visibility_m: if visibility.is_some() && sound[1].is_none() {
            f64::INFINITY
        } else {
            first_visibility_m(problems, path, weather, visibility)
        },
        noise_scale: noise,
        actions: weather.drive.ado().actions.clone(),
        neutral: weather.drive.ado().neutral,
    }
}

/// Checks the friction and the noise with which the weather begins.
fn begins_within(
    problems: &mut Problems,
    place: &ValuePath,
    file: &ScenarioFile,
    friction: Option<Range>,
    noise: Option<Range>,
) {
    let NumberOrRange(road) = file.road.friction();
    if let Some(bounds) = friction
        && (road.lo < bounds.lo || bounds.hi < road.hi)
    {
        let begins = if road.is_fixed() {
            road.lo.to_string()
        } else {
            format!("{} to {}", road.lo, road.hi)
        };
        let what = format!("the weather begins with the road's friction, {begins}");
        let help = Some("widen the bounds, or change the `friction` of the road".to_owned());
        problems.add(&place.to("friction"), what, "outside of the bounds", help);
    }
    let Some(bounds) = noise else {
        return;
    };
    let place = place.to("noise_scale");
    if !(bounds.lo..=bounds.hi).contains(&1.0) {
        let help = Some("1 is the noise of the `sensors`: widen the bounds".to_owned());
        let what = "the weather begins with a factor of 1 on the noise";
        problems.add(&place, what, "outside of the bounds", help);
    }
    let SensorsFile {
        position_sd_m,
        speed_sd_mps,
        ..
    } = &file.sensors;
    if position_sd_m.0.hi == 0.0 && speed_sd_mps.0.hi == 0.0 {
        let help = Some("write sensors: (position_sd_m: 0.2), or leave this out".to_owned());
        let what = "the ego's sensors have no noise";
        problems.add(&place, what, "multiplies nothing", help);
    }
}

/// Returns the visibility in the middle of the start's range.
fn first_visibility_m(
    problems: &mut Problems,
    path: &ValuePath,
    weather: &WeatherFile,
    bounds: Option<Range>,
) -> f64 {
    let place = path.to("start");
    match (weather.start.visibility_m, bounds) {
        (Some(NumberOrRange(start)), Some(bounds)) => {
            let place = place.to("visibility_m");
            range_within(problems, &place, start, bounds);
            if start.is_fixed() {
                start.lo
            } else {
                0.5 * (start.lo + start.hi)
            }
        }
        (None, Some(bounds)) => {
            let help = format!("write start: (visibility_m: {:?})", bounds.hi);
            let what = "the visibility has bounds, but no value at the start";
            problems.add(&place, what, "missing", Some(help));
            // The clearest view lets no further mistake follow from this one.
            bounds.hi
        }
        (Some(_), None) => {
            let help = Some("write bounds: (visibility_m: (20.0, 300.0))".to_owned());
            let what = "a visibility without bounds";
            problems.add(&place.to("visibility_m"), what, "not bounded", help);
            f64::INFINITY
        }
        (None, None) => f64::INFINITY,
    }
}

/// Checks the rates of the actions: in range, and of quantities with bounds.
fn rates(
    problems: &mut Problems,
    list: &ValuePath,
    quantities: &[BoundedQuantity; 3],
    weather: &WeatherFile,
) {
    // Other kinds of actions are reported with the other checks of an ado.
    let Actions::Rates(actions) = &weather.drive.ado().actions else {
        return;
    };
    for (i, rates) in actions.iter().enumerate() {
        let values = [
            rates.friction_per_s,
            rates.visibility_mps,
            rates.noise_per_s,
        ];
        for (quantity, value) in quantities.iter().zip(values) {
            let place = list.at(0).at(i).to(quantity.rate);
            within(problems, &place, value, -MAX_RATE_PER_S, MAX_RATE_PER_S);
            // A rate of 0 is how an action leaves a quantity alone.
            if quantity.bounds.is_none() && value != 0.0 {
                let what = format!("`{}` has no bounds in this weather", quantity.field);
                let help = Some(format!("add `{}` to `bounds`", quantity.field));
                problems.add(&place, what, "changes nothing", help);
            }
        }
    }
}

/// Reports a second weather.
pub(super) fn second(problems: &mut Problems, path: &ValuePath) {
    let help = Some("let one weather have the actions of both".to_owned());
    problems.add(path, "a world has one weather", "second one", help);
}
