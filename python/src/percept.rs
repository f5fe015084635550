//! Percepts and commands of an ego written in Python.

use brakecheck::ego;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyInt, PyString};

use crate::error::wrong;

/// Speed, acceleration and place of the ego itself, as it knows them.
#[pyclass(frozen, get_all, module = "brakecheck")]
pub(crate) struct Own {
    /// Speed along its heading, m/s.
    speed_mps: f64,
    /// Acceleration along its heading over the last sample, m/s².
    accel_mps2: f64,
    /// Distance along the road of the front bumper, m.
    s_m: f64,
    /// Offset to the left of the middle of lane 0, m.
    lateral_m: f64,
    /// Lane, counted from the right, 0 first.
    lane: usize,
    /// Heading relative to the road's, counter-clockwise, rad.
    heading_rad: f64,
    /// Length of the own body, m.
    length_m: f64,
    /// Width of the own body, m.
    width_m: f64,
}

#[pymethods]
impl Own {
    fn __repr__(&self) -> String {
        format!(
            "Own(speed_mps={:?}, accel_mps2={:?}, s_m={:?}, lane={})",
            self.speed_mps, self.accel_mps2, self.s_m, self.lane
        )
    }
}

/// Another road user, as the ego's sensors see it.
///
/// You get its state along the road (`headway_m`, `lateral_m`, `speed_mps`) and in the
/// ego's frame (`x_m`, `y_m`, `vx_mps`, ...): origin in the middle of the ego's front
/// bumper, x along the ego's heading, y to the left.
#[pyclass(frozen, get_all, module = "brakecheck")]
pub(crate) struct Seen {
    /// Name in the world file.
    name: String,
    /// Distance along the road from front bumper to front bumper, positive ahead, m.
    headway_m: f64,
    /// Lateral offset relative to the ego, positive to the left, m.
    lateral_m: f64,
    /// Its speed along the road, m/s.
    speed_mps: f64,
    /// Its speed across the road, positive to the left, m/s.
    lateral_mps: f64,
    /// Lane of its front bumper. 0 is the rightmost lane.
    lane: usize,
    /// Position of the middle of its front, ahead in the ego's frame, m.
    x_m: f64,
    /// The same, to the left, m.
    y_m: f64,
    /// Its heading relative to the ego's, counter-clockwise, rad.
    heading_rad: f64,
    /// Its velocity over ground, along the ego's x, m/s.
    vx_mps: f64,
    /// The same, along the ego's y, m/s.
    vy_mps: f64,
    /// Its acceleration along its own heading, along the ego's x, m/s².
    ax_mps2: f64,
    /// The same, along the ego's y, m/s².
    ay_mps2: f64,
    /// Its length, m.
    length_m: f64,
    /// Its width, m.
    width_m: f64,
}

#[pymethods]
impl Seen {
    fn __repr__(&self) -> String {
        format!(
            "Seen(name={:?}, headway_m={:?}, lateral_m={:?}, speed_mps={:?})",
            self.name, self.headway_m, self.lateral_m, self.speed_mps
        )
    }
}

impl From<&ego::Seen> for Seen {
    fn from(seen: &ego::Seen) -> Seen {
        Seen {
            name: seen.name.clone(),
            headway_m: seen.headway_m,
            lateral_m: seen.lateral_m,
            speed_mps: seen.speed_mps,
            lateral_mps: seen.lateral_mps,
            lane: seen.lane,
            x_m: seen.x_m,
            y_m: seen.y_m,
            heading_rad: seen.heading_rad,
            vx_mps: seen.vx_mps,
            vy_mps: seen.vy_mps,
            ax_mps2: seen.ax_mps2,
            ay_mps2: seen.ay_mps2,
            length_m: seen.length_m,
            width_m: seen.width_m,
        }
    }
}

/// A traffic light, as the ego sees it.
#[pyclass(frozen, get_all, module = "brakecheck")]
pub(crate) struct SeenLight {
    /// Name in the world file.
    name: String,
    /// Distance from the front bumper to its stop line, positive before it, m.
    line_m: f64,
    /// Its phase: "green", "yellow" or "red".
    phase: &'static str,
    /// Time in this phase, s.
    phase_s: f64,
}

#[pymethods]
impl SeenLight {
    fn __repr__(&self) -> String {
        format!(
            "SeenLight(name={:?}, line_m={:?}, phase={:?}, phase_s={:?})",
            self.name, self.line_m, self.phase, self.phase_s
        )
    }
}

impl From<&ego::SeenLight> for SeenLight {
    fn from(light: &ego::SeenLight) -> SeenLight {
        SeenLight {
            name: light.name.clone(),
            line_m: light.line_m,
            // Words, so that Python code needs no import to compare them.
            phase: match light.phase {
                ego::Phase::Green => "green",
                ego::Phase::Yellow => "yellow",
                ego::Phase::Red => "red",
            },
            phase_s: light.phase_s,
        }
    }
}

/// Perception of the ego at a sample.
#[pyclass(frozen, module = "brakecheck")]
pub(crate) struct Percept(ego::Percept);

impl From<&ego::Percept> for Percept {
    fn from(percept: &ego::Percept) -> Percept {
        Percept(percept.clone())
    }
}

#[pymethods]
impl Percept {
    /// Returns the percept of a `step` message of the ego protocol.
    #[staticmethod]
    fn from_json(step: &str) -> PyResult<Percept> {
        serde_json::from_str(step).map(Percept).map_err(|why| {
            wrong(
                format!("no percept: {why}"),
                "give the object under `step` of a message of the ego protocol",
            )
        })
    }

    /// Time since the start of the episode, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.time_s
    }

    /// Time to the next percept, s.
    #[getter]
    fn sample_s(&self) -> f64 {
        self.0.sample_s
    }

    /// The ego itself.
    #[getter]
    fn own(&self) -> Own {
        let own = &self.0.own;
        Own {
            speed_mps: own.speed_mps,
            accel_mps2: own.accel_mps2,
            s_m: own.s_m,
            lateral_m: own.lateral_m,
            lane: own.lane,
            heading_rad: own.heading_rad,
            length_m: own.length_m,
            width_m: own.width_m,
        }
    }

    /// All other road users, in the order of the world file.
    #[getter]
    fn others(&self) -> Vec<Seen> {
        // Converted when read, since most egos read one of many road users at a sample.
        self.0.others.iter().map(Seen::from).collect()
    }

    /// All traffic lights, in the order of the world file.
    #[getter]
    fn lights(&self) -> Vec<SeenLight> {
        self.0.lights.iter().map(SeenLight::from).collect()
    }

    /// Returns the nearest road user ahead whose body overlaps the ego's path, or None.
    fn leader(&self) -> Option<Seen> {
        self.0.leader().map(Seen::from)
    }

    /// Returns the nearest road user behind whose body overlaps the ego's path, or None.
    fn follower(&self) -> Option<Seen> {
        self.0.follower().map(Seen::from)
    }

    /// Returns the nearest light whose stop line is less than `past_m` behind, or None.
    #[pyo3(signature = (past_m=0.0))]
    fn light(&self, past_m: f64) -> Option<SeenLight> {
        self.0.light(past_m).map(SeenLight::from)
    }

    fn __repr__(&self) -> String {
        let seen = self.0.others.len();
        let own = self.0.own.speed_mps;
        format!(
            "Percept(time_s={:?}, own.speed_mps={own:?}, {seen} others)",
            self.0.time_s
        )
    }
}

/// Request of the ego to its vehicle until the next sample.
#[pyclass(frozen, get_all, module = "brakecheck")]
pub(crate) struct Command {
    /// Net acceleration along the heading, m/s².
    pub accel_mps2: f64,
    /// Speed across the road, positive to the left, m/s. 0 keeps the lane.
    pub lateral_mps: f64,
}

#[pymethods]
impl Command {
    #[new]
    #[pyo3(signature = (accel_mps2, lateral_mps=0.0))]
    fn new(
        #[pyo3(from_py_with = number)] accel_mps2: f64,
        #[pyo3(from_py_with = number)] lateral_mps: f64,
    ) -> Command {
        Command {
            accel_mps2,
            lateral_mps,
        }
    }

    fn __repr__(&self) -> String {
        format!(
            "Command(accel_mps2={:?}, lateral_mps={:?})",
            self.accel_mps2, self.lateral_mps
        )
    }
}

/// Returns the command of an answer of `control`.
#[pyfunction]
pub(crate) fn command_of(answer: &Bound<'_, PyAny>) -> PyResult<Command> {
    let command = commanded(answer)?;
    Ok(Command {
        accel_mps2: command.accel_mps2,
        lateral_mps: command.lateral_mps,
    })
}

/// Returns the command of a Python object.
pub(crate) fn commanded(answer: &Bound<'_, PyAny>) -> PyResult<ego::Command> {
    // The usual answer, of an ego that does not steer, is tried first.
    if let Ok(accel_mps2) = number(answer) {
        return Ok(ego::Command::accelerate(accel_mps2));
    }
    if let Ok(command) = answer.cast::<Command>() {
        let command = command.get();
        return Ok(ego::Command {
            accel_mps2: command.accel_mps2,
            lateral_mps: command.lateral_mps,
        });
    }
    let both = answer
        .extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()
        .and_then(|(accel, lateral)| Ok((number(&accel)?, number(&lateral)?)));
    if let Ok((accel_mps2, lateral_mps)) = both {
        return Ok(ego::Command {
            accel_mps2,
            lateral_mps,
        });
    }
    Err(wrong(
        format!("`control` answered {}", answer.repr()?),
        "return an acceleration in m/s², or `brakecheck.Command(accel_mps2, lateral_mps)`",
    ))
}

/// Returns a number of Python, or a scalar of numpy and similar packages.
///
/// `float` accepts more: bools, texts in numpy's scalars, arrays of a single number.
pub(crate) fn number(given: &Bound<'_, PyAny>) -> PyResult<f64> {
    // The usual case at every sample, without the look-ups for packages below.
    if given.is_exact_instance_of::<PyFloat>() || given.is_exact_instance_of::<PyInt>() {
        return given.extract();
    }
    // No package is imported, so scalars of any array library are known by their
    // attributes.
    let dimensions = match given.getattr_opt("ndim")? {
        Some(dimensions) => dimensions.extract::<usize>()?,
        None => 0,
    };
    let kind = match given.getattr_opt("dtype")? {
        Some(of) => of.getattr_opt("kind")?.map(|kind| kind.extract::<char>()),
        None => None,
    };
    let is_number = kind.transpose()?.is_none_or(|kind| "iuf".contains(kind));
    // A comparison that is returned by mistake would accelerate by 0 or 1 m/s².
    let is_truth = given.extract::<bool>().is_ok();
    let is_text = given.is_instance_of::<PyString>();
    match given.extract() {
        Ok(number) if is_number && !is_truth && !is_text && dimensions == 0 => Ok(number),
        _ => Err(wrong(
            format!("{} is no number", given.repr()?),
            "give a float, an int, or a scalar of numpy",
        )),
    }
}
