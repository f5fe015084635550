//! A kept crash as one picture that plays by itself.

use std::path::PathBuf;

use super::replay::Replayed;
use super::save_crashes::about;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::FilmedDriver;
use crate::report::{Beside, Example, looping_picture};
use crate::testbench::film;

/// A reference driver cannot take the ego's place in an episode.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{} cannot take the ego's place in `{}`: {why}", driver.name(), path.display())]
pub struct Inapplicable {
    /// The driver.
    pub driver: ReferenceDriver,
    /// Where the kept counterexample lies.
    pub path: PathBuf,
    /// The reason, in words.
    pub why: &'static str,
}

impl Inapplicable {
    /// The fix.
    pub fn help(&self) -> &'static str {
        "leave `--beside` out; `docs/preventability.md` says to which contacts the drivers apply"
    }
}

/// What came of replaying a kept counterexample, as an SVG that loops; `ego`
/// says who is under test. With `beside` the other half shows what that
/// reference driver would have done in the ego's place.
///
/// # Errors
/// Reference drivers do not apply to how the episode ended.
///
/// ```no_run
/// use brakecheck::crashes::{Regressions, picture};
/// use brakecheck::ego::reference::ReferenceDriver;
/// let kept = Regressions::load("tests/regressions")?;
/// for crash in kept.replay_recorded()?.iter().take(1) {
///     let svg = picture(crash, "mine", Some(ReferenceDriver::Fsm))?;
///     std::fs::write("crash.svg", svg)?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn picture(
    replayed: &Replayed,
    ego: &str,
    beside: Option<ReferenceDriver>,
) -> Result<String, Inapplicable> {
    let Replayed {
        scenario, episode, ..
    } = replayed;
    // What the file says holds for the run that it recorded.
    let recorded = replayed.about.clone();
    let known = || {
        if replayed.still_fails() {
            about(scenario, episode)
        } else {
            replayed.known()
        }
    };
    let example = Example {
        chosen_for: String::new(),
        start: 0,
        frames: film(&mut scenario.repeating(episode).bench(), episode),
        about: recorded.unwrap_or_else(known),
        episode: episode.clone(),
        scenarios: Vec::new(),
    };
    let beside = match beside {
        None => None,
        Some(driver) => Some(Beside {
            who: driver.words().to_owned(),
            filmed: scenario
                .filmed_driver(episode, driver)
                .map(|filmed| with_lights(filmed, &example))
                .ok_or_else(|| inapplicable(replayed, driver))?,
        }),
    };
    let kind = scenario.drive().and_then(|spec| spec.ego.stock());
    let ego = match kind.as_ref().map(|it| it.controller.kind()) {
        Some(kind) => format!("{ego} ({kind})"),
        None => ego.to_owned(),
    };
    let departure = replayed.departure();
    let notes = departure.map(|it| format!("Another run: {it}."));
    Ok(looping_picture(
        scenario,
        &example,
        (&ego, notes.as_deref()),
        beside.as_ref(),
    ))
}

/// Lights as recorded, and as they were last: a motion does not hold them.
fn with_lights(mut filmed: FilmedDriver, example: &Example) -> FilmedDriver {
    let last = example.frames.len().saturating_sub(1);
    for (i, frame) in filmed.frames.iter_mut().enumerate() {
        if let Some(recorded) = example.frames.get(i.min(last)) {
            frame.phases.clone_from(&recorded.phases);
        }
    }
    filmed
}

fn inapplicable(replayed: &Replayed, driver: ReferenceDriver) -> Inapplicable {
    let known = replayed.scenario.preventability(&replayed.episode);
    let why = known
        .not_applicable
        .map_or("it sees no danger", |why| why.words());
    Inapplicable {
        driver,
        path: replayed.path.clone(),
        why,
    }
}
