//! Semantic checks of a world, which the types cannot express.

use indexmap::IndexMap;

use super::{ChangeError, Scenario};
use crate::ego::{Actuated, ControllerSpec, Parameter, Process};
use crate::rl::{LearnerConfig, LearnerSettings, Spaces};
use crate::road::Road;
use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::rulebook::Reward;
use crate::scene::Clock;
use crate::scene::drive::{DriveSpec, Range, Script, Sensors};
use crate::stl::Expr;
use crate::testbench::{MAX_REPEATS, Repeats};
use crate::world_file::{OriginFile, ScenarioFile};

/// Greatest number of samples of an episode.
const MAX_SAMPLES: f64 = 1e5;
/// Greatest number of lanes of a road.
const MAX_LANES: usize = 100;
/// Longest time after the first contact.
const MOST_AFTER_CONTACT_S: f64 = 20.0;
/// Greatest distance of a place in a road file from the origin of the file, in metres.
const MAX_PLACE_M: f64 = 1e7;

/// Reports a number outside of `lo ..= hi`.
pub(super) fn within(problems: &mut Problems, path: &ValuePath, value: f64, lo: f64, hi: f64) {
    // The range excludes NaN, which a comparison with its ends would let pass.
    if !(lo..=hi).contains(&value) {
        let what = format!("{value} is outside of {lo} ..= {hi}");
        problems.add(path, what, "out of range", None);
    }
}

/// Reports a range that is reversed or leaves the bounds, as one mistake at most.
///
/// Returns whether there was none.
pub(super) fn range_within(
    problems: &mut Problems,
    path: &ValuePath,
    numbers: Range,
    bounds: Range,
) -> bool {
    if numbers.hi < numbers.lo {
        range(problems, path, numbers);
        return false;
    }
    let ends = [numbers.lo, numbers.hi];
    let outside = ends
        .into_iter()
        .find(|end| !(bounds.lo..=bounds.hi).contains(end));
    if let Some(end) = outside {
        within(problems, path, end, bounds.lo, bounds.hi);
    }
    outside.is_none()
}

pub(super) fn clock(problems: &mut Problems, path: &ValuePath, clock: &Clock) {
    let positive = [
        ("horizon_s", clock.horizon_s),
        ("decision_s", clock.decision_s),
        ("sample_s", clock.sample_s),
    ];
    // The ratios below divide by these values, so the check ends at the first
    // mistake.
    for (field, value) in positive {
        if value <= 0.0 {
            let what = format!("`{field}` is {value}, but time moves forward");
            problems.add(&path.to(field), what, "must be above 0", None);
            return;
        }
    }
    within(
        problems,
        &path.to("substeps"),
        f64::from(clock.substeps),
        1.0,
        1000.0,
    );
    if clock.horizon_s / clock.sample_s > MAX_SAMPLES {
        let what = format!(
            "an episode of {} samples, more than {MAX_SAMPLES}",
            clock.horizon_s / clock.sample_s
        );
        let help = Some("shorten the horizon or lengthen the sample".to_owned());
        problems.add(&path.to("horizon_s"), what, "too long", help);
    }
    let multiples = [
        ("decision_s", clock.decision_s, "sample_s", clock.sample_s),
        ("horizon_s", clock.horizon_s, "sample_s", clock.sample_s),
    ];
    for (field, value, unit_field, unit) in multiples {
        let ratio = value / unit;
        // A ratio of decimal fractions is only whole up to rounding.
        if ratio.round() < 1.0 || (ratio - ratio.round()).abs() > 1e-6 {
            let what = format!("`{field}` = {value} s is no multiple of `{unit_field}` = {unit} s");
            let below = tidy(ratio.floor().max(1.0) * unit);
            let above = tidy((ratio.floor() + 1.0).max(2.0) * unit);
            let help = Some(format!("the neighbours are {below} and {above}"));
            problems.add(&path.to(field), what, "no multiple", help);
        }
    }
    // A step of exactly 0.02 s passes, whatever its rounding.
    if 0.02 + 1e-9 < clock.sample_s / f64::from(clock.substeps.max(1)) {
        let what = format!(
            "a physics step of {} s is longer than 0.02 s",
            clock.sample_s / f64::from(clock.substeps.max(1))
        );
        let least = (clock.sample_s / 0.02).ceil();
        let help = Some(format!("give at least {least} substeps"));
        problems.add(&path.to("substeps"), what, "too coarse", help);
    }
}

/// Checks the pose of a world's origin in a road file.
pub(super) fn origin(problems: &mut Problems, path: &ValuePath, origin: Option<&OriginFile>) {
    let Some(origin) = origin else { return };
    for (field, value) in [
        ("x_m", origin.x_m),
        ("y_m", origin.y_m),
        ("z_m", origin.z_m),
    ] {
        within(problems, &path.to(field), value, -MAX_PLACE_M, MAX_PLACE_M);
    }
    // Degrees would be a pose of the map, too.
    let (field, turn_rad) = ("heading_rad", core::f64::consts::TAU);
    within(
        problems,
        &path.to(field),
        origin.heading_rad,
        -turn_rad,
        turn_rad,
    );
}

/// Rounds to nine decimals, which removes the digits of binary fractions.
fn tidy(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}

/// Checks number and width of the lanes. Lanes are at least `least_m` wide.
pub(super) fn lanes(problems: &mut Problems, path: &ValuePath, road: &Road, least_m: f64) {
    if !(1..=MAX_LANES).contains(&road.lanes()) {
        problems.add(
            &path.to("lanes"),
            format!("a road has 1 to {MAX_LANES} lanes, not {}", road.lanes()),
            "here",
            None,
        );
    }
    within(
        problems,
        &path.to("lane_width_m"),
        road.lane_width_m(),
        least_m,
        20.0,
    );
}

pub(super) fn road(problems: &mut Problems, path: &ValuePath, road: &Road) {
    lanes(problems, path, road, 1.0);
    within(problems, &path.to("friction"), road.friction(), 0.01, 2.0);
    if let Some(limit_mps) = road.speed_limit_mps() {
        within(problems, &path.to("speed_limit_mps"), limit_mps, 0.1, 150.0);
    }
    // The geometry checks itself, and names the piece that is wrong.
    if let Err(error) = road.course() {
        let list = match road {
            Road::Polyline { .. } => path.to("points_m"),
            _ => path.to("pieces"),
        };
        let place = error.index.map_or(list.clone(), |index| list.at(index));
        problems.add(&place, error.what, "here", Some(error.help));
    }
}

pub(super) fn reward(problems: &mut Problems, path: &ValuePath, reward: &Reward) {
    within(problems, &path.to("rho_max"), reward.rho_max(), 1e-6, 1e9);
    if let Reward::Tanh {
        scale,
        jump,
        foul_span,
        ..
    } = reward
    {
        within(problems, &path.to("scale"), *scale, 1e-6, 1e9);
        within(problems, &path.to("jump"), *jump, 0.0, 0.99);
        within(problems, &path.to("foul_span"), *foul_span, 1e-3, 1e3);
    }
}

pub(super) fn learner(
    problems: &mut Problems,
    path: &ValuePath,
    settings: &LearnerSettings,
) -> LearnerConfig {
    LearnerConfig::new(settings.clone()).unwrap_or_else(|error| {
        let place = path.to(error.field);
        problems.add(&place, error.what(), "here", Some(error.help));
        // A default keeps the check going, so that further mistakes are
        // reported.
        LearnerConfig::default()
    })
}

pub(super) fn learners(
    problems: &mut Problems,
    path: &ValuePath,
    learners: &Ordered<LearnerSettings>,
) -> IndexMap<String, LearnerConfig> {
    let learners = learners.0.iter();
    let checked = learners.map(|(name, settings)| {
        let config = learner(problems, &path.to(name), settings);
        (name.clone(), config)
    });
    checked.collect()
}

/// Reports learners of traffic whose law has other actions or observations than the world.
pub(super) fn laws_fit<'a>(
    problems: &mut Problems,
    learners: impl Iterator<Item = &'a LearnerConfig>,
    spaces: &Spaces,
) {
    let laws = learners.filter_map(LearnerConfig::as_traffic);
    for error in laws.filter_map(|settings| settings.fits(spaces).err()) {
        let help = "train with `--traffic FILE.ron`, which writes the law of this world";
        let place = ValuePath::top().to("learner");
        problems.add(&place, error.to_string(), "its law", Some(help.to_owned()));
    }
}

pub(super) fn range(problems: &mut Problems, path: &ValuePath, range: Range) {
    if range.hi < range.lo {
        let what = format!("the range ({}, {}) is reversed", range.lo, range.hi);
        let help = Some(format!("write ({}, {})", range.hi, range.lo));
        problems.add(path, what, "low before high", help);
    }
}

pub(super) fn agent_name(problems: &mut Problems, path: &ValuePath, name: &str) {
    if !is_identifier(name) {
        let what = format!("`{name}` cannot name an agent");
        let help = Some("letters, digits and _, beginning with a letter".to_owned());
        problems.add(path, what, "here", help);
    }
}

pub(super) fn signal_name(problems: &mut Problems, path: &ValuePath, name: &str, taken: bool) {
    if taken {
        let what = format!("the signal `{name}` is published already");
        problems.add(path, what, "choose another name", None);
    } else if !name.split('.').all(is_identifier) {
        let what = format!("`{name}` cannot name a signal");
        let help = Some("dotted names of letters, digits and _".to_owned());
        problems.add(path, what, "here", help);
    }
}

/// Checks the name of a constant or a formula, which must have no other meaning.
pub(super) fn free_name(problems: &mut Problems, path: &ValuePath, name: &str, taken: bool) {
    if taken {
        let what = format!("`{name}` is the name of something else already");
        problems.add(path, what, "choose another name", None);
    } else if !is_identifier(name) || name.parse::<Expr>().is_err() {
        // Words of the language are identifiers, but no expressions.
        let what = format!("`{name}` cannot be a name in formulas");
        let help = "letters, digits and _, and no word of the language".to_owned();
        problems.add(path, what, "here", Some(help));
    }
}

/// Checks the world's name, after which files are named.
pub(super) fn world_name(problems: &mut Problems, path: &ValuePath, name: &str) {
    // Files are named after the world, so its name contains no path and no
    // space.
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || name.len() > 64 || !name.chars().all(plain) {
        let what = format!("`{name}` cannot name a world");
        let help = "at most 64 letters, digits, _ and -: files are named after it".to_owned();
        problems.add(path, what, "here", Some(help));
    }
}

pub(super) fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Checks the number of runs of each start, and of failures that count.
pub(super) fn repeats(problems: &mut Problems, path: &ValuePath, repeats: Repeats) {
    let Repeats { runs, gate } = repeats;
    if !(1..=MAX_REPEATS).contains(&runs) {
        let what = format!("every start is played {runs} times");
        let help = format!("1 to {MAX_REPEATS} runs are possible; 5 are usual");
        problems.add(path, what, "here", Some(help));
    } else if !(1..=runs).contains(&gate) {
        let what = format!("{gate} failures in {runs} runs");
        let help = format!("`gate` is 1 to {runs}: so many failing runs are a failure");
        problems.add(path, what, "here", Some(help));
    }
}

pub(super) fn controller(
    problems: &mut Problems,
    path: &ValuePath,
    ego: &Actuated<ControllerSpec>,
) {
    if let Some((field, what, help)) = ego.controller.program().and_then(Process::flaw) {
        problems.add(&path.to(field), what, "here", Some(help.to_owned()));
        return;
    }
    parameters(problems, path, &ego.parameters());
}

fn parameters(problems: &mut Problems, path: &ValuePath, parameters: &[Parameter]) {
    for parameter in parameters {
        // This form also rejects NaN, unlike a comparison with the bound.
        if !(parameter.at_least..).contains(&parameter.value) {
            let what = format!(
                "`{}` is {}, below {}",
                parameter.name, parameter.value, parameter.at_least
            );
            problems.add(&path.to(parameter.name), what, "too small", None);
        }
    }
}

/// Verifies that no two agents start inside each other after a change.
pub(super) fn still_apart(spec: &DriveSpec) -> Result<(), ChangeError> {
    // The spans are not used, so no text is needed.
    let mut problems = Problems::new("");
    let entries: Vec<usize> = (0..spec.agents.len()).collect();
    super::starts::check(&mut problems, &ValuePath::top(), spec, &entries);
    match problems.into_list().into_iter().next() {
        Some(problem) => Err(ChangeError {
            what: problem.what,
            help: problem.help,
            place: vec!["ego_body".to_owned()],
        }),
        None => Ok(()),
    }
}

/// Checks a script: times that rise from 0 on, and valid parameters.
pub(super) fn script(problems: &mut Problems, path: &ValuePath, script: &Script) {
    let times: Vec<f64> = match script {
        Script::ConstantSpeed | Script::Stand => Vec::new(),
        Script::Profile(points) => points.iter().map(|point| point.0).collect(),
        Script::Walk(points) => points.iter().map(|point| point.0).collect(),
        Script::Idm(idm) => {
            let idm = idm.clone().map(ControllerSpec::from);
            parameters(problems, &path.at(0), &idm.parameters());
            Vec::new()
        }
    };
    // Two entries at one time would leave their order open.
    if !times.is_sorted_by(|a, b| a < b) || times.iter().any(|at_s| *at_s < 0.0) {
        let what = "the times of a script rise from 0 on".to_owned();
        problems.add(path, what, "out of order", None);
    }
}

/// Greatest range of sensors, in metres.
const MAX_RANGE_M: f64 = 10_000.0;

/// Checks the time after the first contact.
pub(super) fn after_contact(problems: &mut Problems, path: &ValuePath, file: &ScenarioFile) {
    let Some(after_s) = file.after_contact_s else {
        return;
    };
    if !(0.0..=MOST_AFTER_CONTACT_S).contains(&after_s) {
        let what = format!("{after_s} s is outside of 0 ..= {MOST_AFTER_CONTACT_S}");
        let help = "0 ends the motion at the first contact";
        problems.add(path, what, "here", Some(help.to_owned()));
    }
}

/// Checks the ego's sensors: their range, and a delay of whole samples.
pub(super) fn sensors(problems: &mut Problems, path: &ValuePath, sensors: &Sensors, clock: &Clock) {
    if let Some((field, what, help)) = sensor_flaw(sensors, clock) {
        problems.add(&path.to(field), what, "here", Some(help));
    }
}

/// Mistake of sensors: the field, the problem and the fix.
pub(super) fn sensor_flaw(
    sensors: &Sensors,
    clock: &Clock,
) -> Option<(&'static str, String, String)> {
    let Sensors {
        delay_s,
        position_sd_m,
        speed_sd_mps,
        range_m,
        line_of_sight: _,
    } = *sensors;
    if let Some(range_m) = range_m
        && !(1.0..=MAX_RANGE_M).contains(&range_m)
    {
        let what = format!("{range_m} is outside of 1 ..= {MAX_RANGE_M}");
        let help = "leave it out for a sensor without a limit".to_owned();
        return Some(("range_m", what, help));
    }
    let fields = [
        ("delay_s", delay_s, 5.0),
        ("position_sd_m", position_sd_m, 10.0),
        ("speed_sd_mps", speed_sd_mps, 10.0),
    ];
    for (field, value, most) in fields {
        if !(0.0..=most).contains(&value) {
            let what = format!("{value} is outside of 0 ..= {most}");
            return Some((field, what, "0 is a perfect sensor".to_owned()));
        }
    }
    // A delay reads a recorded sample, so it must be a whole number of samples.
    let samples = delay_s / clock.sample_s;
    if (samples - samples.round()).abs() > 1e-6 {
        let what = format!(
            "`delay_s` = {delay_s} s is no multiple of `sample_s` = {} s",
            clock.sample_s
        );
        let (below, above) = (samples.floor(), samples.ceil());
        let help = format!(
            "the neighbours are {} and {}",
            tidy(below * clock.sample_s),
            tidy(above * clock.sample_s)
        );
        return Some(("delay_s", what, help));
    }
    None
}

/// Verifies that every change under `reuse` fits.
pub(super) fn reuse(problems: &mut Problems, path: &ValuePath, scenario: &Scenario) {
    world_name(problems, &ValuePath::top().to("name"), &scenario.name);
    for (name, change) in &scenario.reuse {
        if name.is_empty() || ["nominal", "all"].contains(&name.as_str()) || name.ends_with(".ron")
        {
            let what = format!("`{name}` cannot name a changed ego");
            let help = "`nominal`, `all` and files mean something else to `--ego`".to_owned();
            problems.add(&path.to(name), what, "choose another name", Some(help));
        }
        // Each change is applied once, which runs all checks that `--ego`
        // would.
        if let Err(error) = scenario.with(change) {
            let place = error.path(&path.to(name));
            problems.add(&place, error.what, "here", error.help);
        }
    }
}
