//! Saved crash as a self-playing picture, and the kinds of files that show an episode.

use std::path::{Path, PathBuf};

use super::replay::Replayed;
use super::save_crashes::description;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::FilmedDriver;
use crate::report::{Beside, Example, looping_picture};
use crate::testbench::{Film, film_beyond};

/// A reference driver cannot take the ego's place in an episode.
#[derive(Clone, Debug, thiserror::Error)]
#[error("{} cannot take the ego's place in `{}`: {why}", driver.name(), path.display())]
pub struct Inapplicable {
    /// The driver.
    pub driver: ReferenceDriver,
    /// Path of the kept counterexample.
    pub path: PathBuf,
    /// The reason, in words.
    pub why: &'static str,
}

impl Inapplicable {
    /// Returns the fix.
    pub fn help(&self) -> &'static str {
        "leave `--beside` out; `docs/background/preventability.md` says to which contacts the drivers apply"
    }
}

/// Kind of file that shows an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewKind {
    /// `.rrd`, for the rerun viewer.
    Recording,
    /// `.svg`, for any browser; see [`picture`].
    Picture,
}

/// File name without a known kind.
#[derive(Clone, Debug, thiserror::Error)]
#[error("`{}` is neither a recording nor a picture", file.display())]
pub struct UnknownViewKind {
    /// The file.
    pub file: PathBuf,
}

impl UnknownViewKind {
    /// Returns the fix.
    pub fn help(&self) -> &'static str {
        "name a `.rrd`, for the rerun viewer, or a `.svg`, for any browser"
    }
}

impl ViewKind {
    /// Returns the kind of a file by its extension, in either case.
    ///
    /// # Errors
    /// Files with this name are not written.
    ///
    /// ```
    /// # use brakecheck_crashes as brakecheck;
    /// use brakecheck::crashes::ViewKind;
    /// assert_eq!(ViewKind::of("crash.SVG".as_ref())?, ViewKind::Picture);
    /// assert!(ViewKind::of("crash.png".as_ref()).is_err());
    /// # Ok::<(), brakecheck::crashes::UnknownViewKind>(())
    /// ```
    pub fn of(output: &Path) -> Result<ViewKind, UnknownViewKind> {
        let extension = output.extension().unwrap_or_default();
        let is = |kind: &str| extension.eq_ignore_ascii_case(kind);
        match (is("rrd"), is("svg")) {
            (true, _) => Ok(ViewKind::Recording),
            (_, true) => Ok(ViewKind::Picture),
            _ => Err(UnknownViewKind {
                file: output.into(),
            }),
        }
    }
}

/// Draws a replayed counterexample as a looping SVG, with `ego` as a caption.
///
/// With `beside`, the other half shows this reference driver in the ego's place.
///
/// # Errors
/// Reference drivers do not apply to the end of the episode.
///
/// ```no_run
/// # mod brakecheck {
/// #     pub use brakecheck_crashes::crashes;
/// #     pub use brakecheck_ego::ego;
/// # }
/// use brakecheck::crashes::{Regressions, picture};
/// use brakecheck::ego::ReferenceDriver;
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
    // The labels in the file are valid for the recorded run only.
    let recorded = replayed.about.clone();
    let known = || {
        if replayed.still_fails() {
            description(scenario, episode)
        } else {
            replayed.known()
        }
    };
    let Film { frames, after } = film_beyond(&mut scenario.repeating(episode).bench(), episode);
    let example = Example {
        chosen_for: String::new(),
        start: 0,
        frames,
        after,
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
    let kind = scenario.controller();
    let ego = match kind.as_ref().map(|it| it.controller.kind()) {
        Some(kind) => format!("{ego} ({kind})"),
        None => ego.to_owned(),
    };
    let departure = replayed.departure();
    // A viewer must not take another run for the recorded crash.
    let notes = departure.map(|it| format!("Another run: {it}."));
    Ok(looping_picture(
        scenario,
        &example,
        &ego,
        notes.as_deref(),
        beside.as_ref(),
    ))
}

/// Adds the recorded lights, because a motion does not contain them.
/// After the record they keep their last phase.
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
