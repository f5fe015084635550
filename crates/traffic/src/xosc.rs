//! Reading of OpenSCENARIO trajectories.

use std::collections::BTreeSet;
use std::io::Read;

use indexmap::IndexMap;

use crate::error::ReadError;
use crate::grid;
use crate::problem::{FilePlace, FileProblem};
use crate::raw::{FARTHEST_M, RawRow, RawTrack, RawTracks, RawVector};
use crate::recording::{Class, ReadCounts, TrafficRecording};
use crate::xml_lines::{PlacedElement, RecordedElements, read_elements};
use crate::xosc_entity::{XoscEntity, class_of_catalog, class_of_vehicle};

/// Greatest number of entities that follow one trajectory, each with rows of its own.
const MOST_ACTORS: usize = 100;

/// Reads the polylines that the entities of a scenario follow. Errors call it by `name`.
///
/// The file needs no road and may have any size. Every vertex has a time and a
/// `WorldPosition` of the entity's reference point in metres. Without `h` the heading is
/// the direction of motion. Class and box are those of the entity's definition. A
/// reference to a catalog has no box: its class is that of a word in the entry's name,
/// such as `car_white`, its size that of the class, and its positions are of the box
/// centre. Instants and holes are treated as in [`read_csv`](crate::read_csv).
///
/// # Errors
/// The text is not XML, or a trajectory lacks times or coordinates.
pub fn read_xosc(text: impl Read, name: &str) -> Result<TrafficRecording, ReadError> {
    let mut file = XoscFile::new(name);
    read_elements(text, name, &mut file)?;
    file.finish()
}

/// Polyline of some entities.
#[derive(Default)]
struct TimedLine {
    entities: Vec<String>,
    /// Factor and offset of the times.
    timing: Option<(f64, f64)>,
    is_relative: bool,
    rows: Vec<RawRow>,
}

/// State of the reading.
struct XoscFile<'a> {
    name: &'a str,
    /// Names of the open elements.
    open: Vec<String>,
    entities: IndexMap<String, XoscEntity>,
    /// Entity that is being defined.
    entity: Option<(String, XoscEntity)>,
    /// Entities that the actions are about.
    actors: Vec<String>,
    /// Instant at which the current event starts.
    start_s: Option<f64>,
    /// Speeds of the entities at the start.
    speeds_mps: IndexMap<String, f64>,
    /// Polylines of the current event.
    lines: Vec<TimedLine>,
    vertex_s: Option<f64>,
    tracks: IndexMap<String, RawTrack>,
    origin_m: Option<[f64; 2]>,
    counts: ReadCounts,
}

impl RecordedElements for XoscFile<'_> {
    fn start(&mut self, tag: &PlacedElement<'_>) -> Result<(), ReadError> {
        match tag.name() {
            "ScenarioObject" => {
                self.entity = Some((tag.text("name")?, XoscEntity::default()));
            }
            // An `Init` action has one entity of its own, without `Actors`.
            "Private" => self.actors = vec![tag.text("entityRef")?],
            // The actors of the group before must not follow its trajectories.
            "ManeuverGroup" => self.actors.clear(),
            "EntityRef" if self.open.last().is_some_and(|it| it == "Actors") => {
                let entity = tag.text("entityRef")?;
                if self.actors.len() == MOST_ACTORS {
                    return Err(tag.error(FileProblem::ManyEntities(MOST_ACTORS)));
                }
                // An entity that is named twice does not follow a line twice.
                if !self.actors.contains(&entity) {
                    self.actors.push(entity);
                }
            }
            // An event does not inherit the start of the one before it.
            "Event" => self.start_s = None,
            "SimulationTimeCondition" if self.is_inside("Event") && self.start_s.is_none() => {
                self.start_s = Some(tag.number("value")?);
            }
            "AbsoluteTargetSpeed" if self.is_inside("Private") => {
                let speed_mps = tag.number("value")?;
                for id in &self.actors {
                    self.speeds_mps.insert(id.clone(), speed_mps);
                }
            }
            // A trajectory of a route catalog has no actor.
            "Trajectory" if !self.actors.is_empty() => self.lines.push(TimedLine {
                entities: self.actors.clone(),
                ..TimedLine::default()
            }),
            _ if self.entity.is_some() => self.define(tag)?,
            _ if !self.lines.is_empty() => self.trace(tag)?,
            _ => {}
        }
        self.open.push(tag.name().to_owned());
        Ok(())
    }

    fn end(&mut self, element: &str, place: FilePlace) -> Result<(), ReadError> {
        self.open.pop();
        match element {
            "ScenarioObject" => self.entities.extend(self.entity.take()),
            // A `WorldPosition` takes the time away, so a time that is left
            // had none.
            "Vertex" if self.vertex_s.take().is_some() => {
                return Err(self.error(place, FileProblem::NoWorldPosition));
            }
            "Event" | "Private" => {
                // Actions of `Init` begin with the run, so relative times have
                // a start.
                if element == "Private" {
                    self.start_s = Some(0.0);
                }
                for line in std::mem::take(&mut self.lines) {
                    self.add(line, place)?;
                }
            }
            _ => {}
        }
        Ok(())
    }
}

impl<'a> XoscFile<'a> {
    fn new(name: &'a str) -> XoscFile<'a> {
        XoscFile {
            name,
            open: Vec::new(),
            entities: IndexMap::new(),
            entity: None,
            actors: Vec::new(),
            start_s: None,
            speeds_mps: IndexMap::new(),
            lines: Vec::new(),
            vertex_s: None,
            tracks: IndexMap::new(),
            origin_m: None,
            counts: ReadCounts::default(),
        }
    }

    fn error(&self, place: FilePlace, problem: FileProblem) -> ReadError {
        ReadError::Content {
            file: self.name.to_owned(),
            place,
            problem,
        }
    }

    fn is_inside(&self, element: &str) -> bool {
        self.open.iter().any(|it| it == element)
    }

    /// Reads an element of an entity's definition.
    fn define(&mut self, tag: &PlacedElement<'_>) -> Result<(), ReadError> {
        let Some((_, mut entity)) = self.entity else {
            return Ok(());
        };
        match tag.name() {
            "Vehicle" => {
                let category = tag.optional("vehicleCategory");
                entity.class = category.and_then(class_of_vehicle);
            }
            "Pedestrian" => {
                let category = tag.optional("pedestrianCategory");
                let is_animal = category.is_some_and(|it| it == "animal");
                let class = if is_animal {
                    Class::Other
                } else {
                    Class::Pedestrian
                };
                entity.class = Some(class);
            }
            // No `vehicleCategory` follows, so the class is known here
            // already.
            "MiscObject" => entity.class = Some(Class::Other),
            "CatalogReference" => {
                let catalog = tag.text("catalogName")?;
                entity.class = class_of_catalog(&catalog, &tag.text("entryName")?);
            }
            "Center" => entity.centre_m = [tag.number("x")?, tag.number("y")?],
            "Dimensions" => {
                entity.size_m = Some([size(tag, "length")?, size(tag, "width")?]);
            }
            _ => {}
        }
        if let Some((_, known)) = &mut self.entity {
            *known = entity;
        }
        Ok(())
    }

    /// Reads an element of a trajectory.
    fn trace(&mut self, tag: &PlacedElement<'_>) -> Result<(), ReadError> {
        match tag.name() {
            "Vertex" => self.vertex_s = Some(tag.number("time")?),
            "WorldPosition" => {
                // Positions outside of a vertex, such as targets of other
                // actions, are no rows.
                let Some(time_s) = self.vertex_s.take() else {
                    return Ok(());
                };
                let row = self.row(tag, time_s)?;
                if let Some(line) = self.lines.last_mut() {
                    line.rows.push(row);
                }
            }
            "Timing" => {
                let (scale, offset_s) = (tag.number("scale")?, tag.number("offset")?);
                let domain = tag.text("domainAbsoluteRelative")?;
                if let Some(line) = self.lines.last_mut() {
                    line.timing = Some((scale, offset_s));
                    line.is_relative = domain == "relative";
                }
            }
            shape @ ("Clothoid" | "ClothoidSpline" | "Nurbs") => {
                return Err(tag.error(FileProblem::Shape(shape.to_owned())));
            }
            _ => {}
        }
        Ok(())
    }

    fn row(&mut self, tag: &PlacedElement<'_>, time_s: f64) -> Result<RawRow, ReadError> {
        let (x_m, y_m) = (coordinate(tag, "x")?, coordinate(tag, "y")?);
        let heading_rad = tag.optional_number("h")?;
        let origin_m = *self.origin_m.get_or_insert([x_m, y_m]);
        Ok(RawRow {
            time_s,
            x_m: x_m - origin_m[0],
            y_m: y_m - origin_m[1],
            heading_rad,
            velocity: RawVector::Unknown,
            acceleration: RawVector::Unknown,
            marked: false,
            size_m: [0.0; 2],
            class: None,
        })
    }

    /// Adds a polyline to the tracks of its entities.
    fn add(&mut self, line: TimedLine, place: FilePlace) -> Result<(), ReadError> {
        let start_s = match (line.is_relative, self.start_s) {
            (false, _) => 0.0,
            (true, Some(start_s)) => start_s,
            (true, None) => return Err(self.error(place, FileProblem::RelativeTime)),
        };
        let (scale, offset_s) = line.timing.unwrap_or((1.0, 0.0));
        // Times would stand still or run backwards, and 0 would divide by
        // zero.
        if scale <= 0.0 {
            return Err(self.error(
                place,
                FileProblem::NotPositive {
                    owner: "Timing".to_owned(),
                    name: "scale".to_owned(),
                    value: scale,
                },
            ));
        }
        for id in &line.entities {
            // An entity without a definition still has a motion, so its class
            // is counted as unknown.
            let entity = self.entities.get(id).copied().unwrap_or_default();
            self.counts.rows += line.rows.len();
            if entity.class.is_none() {
                self.counts.unknown_class += line.rows.len();
            }
            let track = self.tracks.entry(id.clone());
            let track = track.or_insert_with(|| entity.track(id));
            // Times of the trajectory pass `scale` times as fast as those of the run.
            let speed_mps = self.speeds_mps.get(id).copied();
            let timed = |row: &RawRow| RawRow {
                time_s: start_s + (row.time_s - offset_s) / scale,
                ..*row
            };
            match line.timing {
                Some(_) => track.rows.extend(line.rows.iter().map(timed)),
                None => {
                    // At a speed of 0 no vertex is ever reached.
                    let Some(speed_mps) = speed_mps.filter(|it| *it > 0.0) else {
                        let problem = FileProblem::NoTiming(id.clone());
                        return Err(self.error(place, problem));
                    };
                    track.rows.extend(driven(&line.rows, start_s, speed_mps));
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<TrafficRecording, ReadError> {
        if self.tracks.is_empty() {
            return Err(ReadError::Content {
                file: self.name.to_owned(),
                place: FilePlace::Whole,
                problem: FileProblem::NoTrajectory,
            });
        }
        let moving: BTreeSet<&String> = self.tracks.keys().collect();
        let is_still = |id: &&String| !moving.contains(*id);
        self.counts.without_motion = self.entities.keys().filter(is_still).count();
        let raw = RawTracks {
            tracks: self.tracks.into_values().collect(),
            counts: self.counts,
            origin_m: self.origin_m.unwrap_or_default(),
            reading: "times of the vertices; reference points in m".to_owned(),
            rate_hz: None,
        };
        grid::recording(raw, self.name)
    }
}

fn coordinate(tag: &PlacedElement<'_>, name: &str) -> Result<f64, ReadError> {
    let value = tag.number(name)?;
    if value.abs() <= FARTHEST_M {
        return Ok(value);
    }
    Err(tag.error(FileProblem::Far {
        owner: tag.name().to_owned(),
        name: name.to_owned(),
        value,
    }))
}

fn size(tag: &PlacedElement<'_>, name: &str) -> Result<f64, ReadError> {
    let value = tag.number(name)?;
    if value > 0.0 {
        return Ok(value);
    }
    Err(tag.error(FileProblem::NotPositive {
        owner: tag.name().to_owned(),
        name: name.to_owned(),
        value,
    }))
}

/// Returns the rows of a line that an entity drives along with a speed of its own.
fn driven(rows: &[RawRow], start_s: f64, speed_mps: f64) -> Vec<RawRow> {
    let mut along_m = 0.0;
    let mut last: Option<&RawRow> = None;
    let mut all: Vec<RawRow> = Vec::with_capacity(rows.len());
    for row in rows {
        let step_m = last.map_or(0.0, |it| libm::hypot(row.x_m - it.x_m, row.y_m - it.y_m));
        // A point that is there twice has one instant.
        if last.is_some() && step_m == 0.0 {
            continue;
        }
        along_m += step_m;
        last = Some(row);
        all.push(RawRow {
            time_s: start_s + along_m / speed_mps,
            ..*row
        });
    }
    all
}
