//! Saved crash as a self-playing picture, and the kinds of files that show an episode.

use std::path::{Path, PathBuf};

#[cfg(feature = "raster")]
use rayon::prelude::*;

use super::replay::Replayed;
use super::save_crashes::description;
use crate::ego::reference::ReferenceDriver;
use crate::preventability::FilmedDriver;
#[cfg(feature = "raster")]
use crate::raster::{GifFrame, PixelImage, RasterError, looping_gif};
#[cfg(feature = "raster")]
use crate::report::HOLD_S;
use crate::report::{Beside, Example, LoopingPicture, looping_picture};
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
    /// A picture, for everything else; see [`picture_as`].
    Picture(PictureFormat),
}

/// Format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// `.svg`, which plays in any browser.
    Svg,
    /// `.png`, which shows the decisive moment, for slides and documents.
    #[cfg(feature = "raster")]
    Png,
    /// `.gif`, which plays everywhere.
    #[cfg(feature = "raster")]
    Gif,
}

/// File name without a kind that this program writes.
#[derive(Clone, Debug, thiserror::Error)]
#[error("`{}` is {}", file.display(), match needs {
    Some(needs) => format!("a picture that needs the feature `{needs}`"),
    None => "neither a recording nor a picture".to_owned(),
})]
pub struct UnknownViewKind {
    /// The file.
    pub file: PathBuf,
    /// Cargo feature with which brakecheck writes it.
    pub needs: Option<&'static str>,
}

impl UnknownViewKind {
    /// Returns the fix.
    pub fn help(&self) -> &'static str {
        match self.needs {
            Some(_) => "build brakecheck with this feature, or name a `.svg`",
            None => {
                "name a `.rrd`, for the rerun viewer, a `.svg`, for any browser, a `.png`, for a still, or a `.gif`, for a loop"
            }
        }
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
    /// use brakecheck::crashes::{PictureFormat, ViewKind};
    /// let kind = ViewKind::of("crash.SVG".as_ref())?;
    /// assert_eq!(kind, ViewKind::Picture(PictureFormat::Svg));
    /// assert!(ViewKind::of("crash.jpg".as_ref()).is_err());
    /// # Ok::<(), brakecheck::crashes::UnknownViewKind>(())
    /// ```
    pub fn of(output: &Path) -> Result<ViewKind, UnknownViewKind> {
        let extension = output.extension().unwrap_or_default();
        let unknown = |needs| {
            let file = output.to_owned();
            Err(UnknownViewKind { file, needs })
        };
        match extension.to_string_lossy().to_lowercase().as_str() {
            "rrd" => Ok(ViewKind::Recording),
            "svg" => Ok(ViewKind::Picture(PictureFormat::Svg)),
            #[cfg(feature = "raster")]
            "png" => Ok(ViewKind::Picture(PictureFormat::Png)),
            #[cfg(feature = "raster")]
            "gif" => Ok(ViewKind::Picture(PictureFormat::Gif)),
            #[cfg(not(feature = "raster"))]
            // Without the feature these names are known, so the error names the feature
            // and no typo.
            "png" | "gif" => unknown(Some("raster")),
            _ => unknown(None),
        }
    }

    /// Returns the format of a picture, and `None` for a recording.
    pub fn format(self) -> Option<PictureFormat> {
        match self {
            ViewKind::Recording => None,
            ViewKind::Picture(format) => Some(format),
        }
    }
}

/// A picture cannot be drawn.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The reference driver does not apply.
    #[error(transparent)]
    Inapplicable(#[from] Inapplicable),
    /// The picture cannot become pixels.
    #[cfg(feature = "raster")]
    #[error(transparent)]
    Raster(#[from] RasterError),
}

impl PictureError {
    /// Returns the fix.
    pub fn help(&self) -> &'static str {
        match self {
            PictureError::Inapplicable(error) => error.help(),
            #[cfg(feature = "raster")]
            PictureError::Raster(_) => "name a `.svg`, which any browser draws",
        }
    }
}

/// Pixels of a PNG file per unit of the SVG, for slides and sharp screens.
#[cfg(feature = "raster")]
const STILL_SCALE: f32 = 2.0;
/// Time between two frames of a GIF file in seconds.
#[cfg(feature = "raster")]
// GIF files count in hundredths of a second, and browsers slow down frames under 0.02 s.
const FRAME_S: f64 = 0.08;

/// Draws a replayed counterexample as the bytes of a file.
///
/// As [`picture`]. A PNG file shows the contact, or else the violation, 1800 pixels wide. A GIF file plays, 900
/// pixels wide, and has at most [`MOST_GIF_BYTES`](crate::raster::MOST_GIF_BYTES).
///
/// # Errors
/// Reference drivers do not apply to the end of the episode.
pub fn picture_as(
    format: PictureFormat,
    replayed: &Replayed,
    ego: &str,
    beside: Option<ReferenceDriver>,
) -> Result<Vec<u8>, PictureError> {
    let picture = looping(replayed, ego, beside)?;
    match format {
        PictureFormat::Svg => Ok(picture.svg().into_bytes()),
        #[cfg(feature = "raster")]
        PictureFormat::Png => Ok(PixelImage::of(&picture.still(), STILL_SCALE)?.png()?),
        #[cfg(feature = "raster")]
        PictureFormat::Gif => Ok(looping_gif(frames(&picture))?),
    }
}

/// Returns the frames of a picture. The last one is shown through the pause.
#[cfg(feature = "raster")]
fn frames(picture: &LoopingPicture) -> Vec<Result<GifFrame, RasterError>> {
    // Rounded up, so that the last frame shows the contact and not the moment before it.
    let last = (picture.motion_s() / FRAME_S).ceil() as usize;
    let frame = |nth: usize| {
        let svg = picture.at(nth as f64 * FRAME_S);
        Ok(GifFrame {
            image: PixelImage::of(&svg, 1.0)?,
            duration_s: if nth == last { HOLD_S } else { FRAME_S },
        })
    };
    (0..=last).into_par_iter().map(frame).collect()
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
    Ok(looping(replayed, ego, beside)?.svg())
}

fn looping(
    replayed: &Replayed,
    ego: &str,
    beside: Option<ReferenceDriver>,
) -> Result<LoopingPicture, Inapplicable> {
    let Replayed {
        scenario, episode, ..
    } = replayed;
    let example = example(replayed, String::new());
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

/// Returns a replay with the motion of all agents and its labels, to be drawn.
pub(super) fn example(replayed: &Replayed, chosen_for: String) -> Example {
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
    Example {
        chosen_for,
        start: None,
        frames,
        after,
        about: recorded.unwrap_or_else(known),
        episode: episode.clone(),
        scenarios: Vec::new(),
    }
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

#[cfg(all(test, feature = "raster"))]
mod tests {
    use super::*;
    use crate::crashes::Regressions;
    use crate::raster::MOST_GIF_BYTES;

    /// The crash on top of the README, with another driver beside it.
    fn crash() -> Replayed {
        let file = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../tests/regressions/acc_iso-nominal-0005.ron"
        );
        let found = Regressions::find(file.as_ref(), None).expect("a kept crash");
        let mut replayed = found.replay_recorded().expect("it runs");
        replayed.remove(0)
    }

    /// Mean difference of two images, 0 to 255.
    fn difference(one: &[u8], other: &[u8]) -> f64 {
        assert_eq!(one.len(), other.len());
        let apart = one
            .iter()
            .zip(other)
            .map(|(a, b)| f64::from(a.abs_diff(*b)));
        apart.sum::<f64>() / one.len() as f64
    }

    #[test]
    fn a_film_ends_as_the_still_and_begins_otherwise() {
        let picture = looping(&crash(), "mine", Some(ReferenceDriver::Cc)).expect("a picture");
        let drawn = |svg: &str| PixelImage::of(svg, 1.0).expect("an image").rgb();
        // The still has its places in attributes, the film in values of keyframes.
        let still = drawn(&picture.svg());
        let end = drawn(&picture.at(picture.motion_s()));
        assert!(
            difference(&still, &end) < 0.2,
            "{}",
            difference(&still, &end)
        );
        let half = drawn(&picture.at(0.5 * picture.motion_s()));
        let begin = drawn(&picture.at(0.0));
        assert!(difference(&still, &begin) > 3.0);
        assert!(difference(&half, &begin) > 1.0 && difference(&half, &end) > 1.0);
    }

    #[test]
    fn a_loop_has_a_bound_and_the_same_bytes_each_time() {
        let gif = || picture_as(PictureFormat::Gif, &crash(), "mine", None).expect("a file");
        let file = gif();
        assert!(file.len() <= MOST_GIF_BYTES, "{} bytes", file.len());
        assert_eq!(file, gif());
    }
}
