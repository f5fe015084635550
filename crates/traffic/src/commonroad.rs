//! Reading of the dynamic obstacles of CommonRoad scenarios.

use std::io::Read;

use crate::error::ReadError;
use crate::grid;
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{FARTHEST_M, RawReference, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};
use crate::xml_lines::{PlacedElement, PlacedText, RecordedElements, read_elements};
use crate::xosc_entity::class_of_words;

/// Greatest number of a time step.
const MOST_STEPS: f64 = 1e9;

/// Reads the recorded motion in a CommonRoad scenario (2018b or 2020a). Errors call it by `name`.
///
/// Positions are those of the middle in metres, orientations radians, speeds m/s, and times
/// numbers of steps of `timeStepSize`. Only exact values are read. Lanelets, static obstacles
/// and planning problems are skipped.
///
/// # Errors
/// The text is not XML, has no dynamic obstacle, a state has no exact value, or a value is
/// not a finite number.
pub fn read_commonroad(text: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    let mut file = CommonRoad {
        name: name.to_owned(),
        ..CommonRoad::default()
    };
    read_elements(text, name, &mut file)?;
    if file.tracks.is_empty() {
        return Err(ReadError::Content {
            file: name.to_owned(),
            place: FilePlace::Whole,
            problem: FileProblem::NoObstacles,
        });
    }
    let raw = RawTracks {
        tracks: file.tracks,
        counts: file.counts,
        origin_m: file.origin_m.unwrap_or_default(),
        reading: "steps of timeStepSize in s; middle in m; orientation in rad; velocity in m/s"
            .to_owned(),
        rate_hz: None,
    };
    grid::recording(raw, name)
}

#[derive(Default)]
struct CommonRoad {
    name: String,
    step_s: f64,
    obstacle: Option<RecordedObstacle>,
    tracks: Vec<RawTrack>,
    origin_m: Option<[f64; 2]>,
    counts: ReadCounts,
}

/// Obstacle that is not closed yet.
#[derive(Default)]
struct RecordedObstacle {
    id: String,
    is_dynamic: bool,
    class: Option<Class>,
    size_m: [f64; 2],
    state: ExactState,
    rows: Vec<RawRow>,
}

/// Exact values of a state that is not closed yet.
#[derive(Default)]
struct ExactState {
    step: Option<f64>,
    position_m: [Option<f64>; 2],
    orientation_rad: Option<f64>,
    velocity_mps: Option<f64>,
}

impl RecordedElements for CommonRoad {
    fn start(&mut self, element: &PlacedElement<'_>) -> Result<(), ReadError> {
        match element.name() {
            "commonRoad" => {
                self.step_s = element.number("timeStepSize")?;
                // All instants would be equal, or run backwards.
                if self.step_s <= 0.0 {
                    return Err(element.error(FileProblem::Period { dt_s: self.step_s }));
                }
            }
            // Version 2018b states by a `role` which obstacles move.
            "dynamicObstacle" | "obstacle" => {
                self.obstacle = Some(RecordedObstacle {
                    id: element.text("id")?,
                    is_dynamic: element.name() == "dynamicObstacle",
                    ..RecordedObstacle::default()
                });
            }
            "initialState" | "state" => {
                if let Some(obstacle) = &mut self.obstacle {
                    // Values of the state before it must not fill gaps of this one.
                    obstacle.state = ExactState::default();
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn inside(&mut self, it: &PlacedText<'_>) -> Result<(), ReadError> {
        let Some(obstacle) = &mut self.obstacle else {
            return Ok(());
        };
        // From the inside out: equal names occur at several depths.
        let mut names = it.path.iter().rev().map(String::as_str);
        let (name, parent) = (names.next().unwrap_or_default(), names.next());
        let state = &mut obstacle.state;
        match (parent.unwrap_or_default(), name) {
            ("obstacle", "role") => obstacle.is_dynamic = it.text == "dynamic",
            ("obstacle" | "dynamicObstacle", "type") => obstacle.class = class_of_words(it.text),
            ("rectangle", "length") => obstacle.size_m[0] = it.number(name)?,
            ("rectangle", "width") => obstacle.size_m[1] = it.number(name)?,
            // A circle has one extent in every direction, so its box is a
            // square.
            ("circle", "radius") => obstacle.size_m = [2.0 * it.number(name)?; 2],
            ("time", "exact") => state.step = Some(it.number("time")?),
            ("orientation", "exact") => state.orientation_rad = Some(it.number("orientation")?),
            ("velocity", "exact") => state.velocity_mps = Some(it.number("velocity")?),
            // Polygons of a shape may have points, too.
            ("point", "x" | "y") if names.next() == Some("position") => {
                state.position_m[usize::from(name == "y")] = Some(it.number(name)?);
            }
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str, place: FilePlace) -> Result<(), ReadError> {
        match name {
            "initialState" | "state" => self.push(place),
            "dynamicObstacle" | "obstacle" => {
                self.close();
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

impl CommonRoad {
    /// Takes the state that ends here.
    fn push(&mut self, place: FilePlace) -> Result<(), ReadError> {
        let Some(obstacle) = &mut self.obstacle else {
            return Ok(());
        };
        let state = core::mem::take(&mut obstacle.state);
        let error = |problem| ReadError::Content {
            file: self.name.clone(),
            place,
            problem,
        };
        let missing = |field| {
            error(FileProblem::MissingField {
                owner: format!("a state of obstacle {}", obstacle.id),
                field,
            })
        };
        // An interval instead of an exact value is a prediction and no
        // recording.
        let step = state.step.ok_or_else(|| missing("time/exact"))?;
        let [Some(x_m), Some(y_m)] = state.position_m else {
            return Err(missing("position/point"));
        };
        // Beyond this, the product with the step size loses the step.
        if step.abs() > MOST_STEPS {
            return Err(error(FileProblem::Span {
                span_s: step * self.step_s,
                dt_s: self.step_s,
            }));
        }
        for (name, value) in [("x", x_m), ("y", y_m)] {
            if value.abs() > FARTHEST_M {
                return Err(error(FileProblem::Far {
                    owner: obstacle.id.clone(),
                    name: name.to_owned(),
                    value,
                }));
            }
        }
        // Coordinates of a city, such as UTM, would lose digits in later products.
        let origin_m = *self.origin_m.get_or_insert([x_m, y_m]);
        obstacle.rows.push(RawRow {
            time_s: step * self.step_s,
            x_m: x_m - origin_m[0],
            y_m: y_m - origin_m[1],
            heading_rad: state.orientation_rad,
            velocity: state
                .velocity_mps
                .map_or(RawVector::Unknown, RawVector::Along),
            acceleration: RawVector::Unknown,
            marked: false,
            size_m: obstacle.size_m,
            class: None,
        });
        Ok(())
    }

    /// Takes the obstacle that ends here, if it moves.
    fn close(&mut self) {
        let Some(mut obstacle) = self.obstacle.take() else {
            return;
        };
        // Parked cars have an initial state, too.
        if !obstacle.is_dynamic || obstacle.rows.is_empty() {
            return;
        }
        self.counts.rows += obstacle.rows.len();
        if obstacle.class.is_none() {
            self.counts.unknown_class += obstacle.rows.len();
        }
        for row in &mut obstacle.rows {
            row.class = Some(obstacle.class.unwrap_or_default());
        }
        self.tracks.push(RawTrack {
            id: obstacle.id.into_bytes(),
            reference: RawReference::Centre,
            rows: obstacle.rows,
            ..RawTrack::default()
        });
    }
}
