//! A test bench, played decision by decision from Python.

use std::fmt::Display;
use std::sync::{Arc, Mutex, MutexGuard};

use brakecheck::raster::{PixelImage, RasterError};
use brakecheck::report::running_picture;
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::seed::{Purpose, StartKey};
use brakecheck::stl::Scratch;
use brakecheck::testbench::{Aftermath, Testbench};
use brakecheck::trace::Trace;
use brakecheck::world::Scenario;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::objects;
use crate::error::{raised, wrong};
use crate::interrupt::check_interrupted;
use crate::watch::interruptible;
use crate::world::RawWorld;

/// Purpose of a stream of starts.
pub(crate) fn purpose_of(word: &str) -> PyResult<Purpose> {
    match word {
        "train" => Ok(Purpose::Train),
        "calibration" => Ok(Purpose::Calibration),
        "test" => Ok(Purpose::Test),
        other => Err(wrong(
            format!("`purpose={other:?}` is not known"),
            "known: train, calibration, test",
        )),
    }
}

/// A test bench and the episode on it.
pub(crate) struct Playing {
    pub(crate) bench: Testbench,
    noise: u64,
    start: Start,
    actions: Vec<usize>,
    scratch: Scratch,
    film: Option<SampleFilm>,
}

/// Pictures of every sample that are not rendered yet.
struct SampleFilm {
    world: Scenario,
    /// Texts as SVG, with a hundredth of the size of pixels.
    pictures: Vec<String>,
}

impl Playing {
    pub(crate) fn new(world: &Scenario) -> Playing {
        Playing {
            bench: world.bench(),
            noise: 0,
            start: Start(Vec::new()),
            actions: Vec::new(),
            scratch: Scratch::new(),
            film: None,
        }
    }

    /// Returns the same, with a picture of every sample.
    fn filmed(self, world: Scenario) -> Playing {
        let film = SampleFilm {
            world,
            pictures: Vec::new(),
        };
        Playing {
            film: Some(film),
            ..self
        }
    }

    /// Begins the episode of a key.
    pub(crate) fn begin(&mut self, key: StartKey, aftermath: Aftermath) {
        let (start, noise) = (self.bench.draw(key), self.bench.noise_of(key));
        self.begin_at(start, noise, aftermath);
    }

    fn begin_at(&mut self, start: Start, noise: u64, aftermath: Aftermath) {
        (self.start, self.noise) = (start, noise);
        self.actions.clear();
        self.bench.begin(&self.start, noise, aftermath);
        if let Some(film) = &mut self.film {
            film.pictures.clear();
        }
        self.film_sample();
    }

    /// Draws the current sample, if every sample is wanted.
    fn film_sample(&mut self) {
        let Some(film) = &self.film else {
            return;
        };
        let picture = self.picture(&film.world);
        if let (Some(film), Some(picture)) = (&mut self.film, picture) {
            film.pictures.push(picture);
        }
    }

    /// Takes a decision, and returns the reward and two flags: the end of the
    /// episode, and its end by a fault.
    pub(crate) fn decide(&mut self, action: usize) -> (f64, bool, bool) {
        let before = self.bench.verdict();
        self.actions.push(action);
        if self.film.is_some() {
            // One call would play all samples up to the next decision, and their pictures
            // would be lost.
            self.bench.decide_only(action);
            while !self.bench.is_decision_due() && self.bench.play_sample() {
                self.film_sample();
            }
        } else {
            self.bench.decide(action);
        }
        let done = self.bench.is_done();
        // The reward is paid once, with the verdict.
        let fell = self.bench.verdict().filter(|_| before.is_none());
        let reward = fell.and_then(|verdict| self.bench.rulebook().reward_of(&verdict));
        // A fault of ego or physics is no outcome of the task, so Gymnasium counts it as
        // truncated.
        let invalid = self.bench.verdict() == Some(Verdict::Invalid);
        (reward.unwrap_or(0.0), done && !invalid, done && invalid)
    }

    /// Returns verdict, success, robustness and number of decisions of the ended episode.
    pub(crate) fn ended(&mut self) -> (&'static str, bool, f64, usize) {
        let bench = &self.bench;
        let rho = bench
            .rulebook()
            .spec
            .robustness(bench.trace(), &mut self.scratch);
        let verdict = bench.verdict();
        let word = verdict.map_or("", |verdict| verdict.word());
        let success = verdict.is_some_and(|verdict| verdict.is_success());
        (word, success, rho, bench.decisions())
    }

    /// Draws the current sample from above, as pixels, or `None` before the first episode.
    pub(crate) fn pixels(&self, world: &Scenario) -> Option<Result<PixelImage, RasterError>> {
        let svg = self.picture(world)?;
        Some(PixelImage::of(&svg, 1.0))
    }

    /// Draws the current sample from above, as SVG, or `None` before the first episode.
    fn picture(&self, world: &Scenario) -> Option<String> {
        if self.bench.trace().is_empty() {
            return None;
        }
        let actions = self.actions.clone();
        let episode = self.bench.episode(&self.start, self.noise, actions);
        Some(running_picture(world, &self.bench, &episode))
    }

    /// Returns the info of the episode so far.
    pub(crate) fn info<'py>(&mut self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let info = PyDict::new(py);
        let bench = &self.bench;
        info.set_item("decisions", bench.decisions())?;
        // The first sample is that of the start, at 0 s.
        let samples = bench.trace().len().saturating_sub(1);
        info.set_item("time_s", samples as f64 * bench.clock().sample_s)?;
        let Some(verdict) = bench.verdict() else {
            return Ok(info);
        };
        let rulebook = bench.rulebook();
        info.set_item("verdict", verdict.word())?;
        info.set_item("is_success", verdict.is_success())?;
        let (trace, scratch) = (bench.trace(), &mut self.scratch);
        info.set_item("robustness", rulebook.spec.robustness(trace, scratch))?;
        let rules = PyDict::new(py);
        for rule in &rulebook.rules {
            rules.set_item(&rule.name, rule.monitor.robustness(trace, scratch))?;
        }
        info.set_item("rules", rules)?;
        let broken = match verdict {
            Verdict::Foul { rule, .. } => Some(rulebook.rules[rule].name.as_str()),
            _ => None,
        };
        info.set_item("broken_rule", broken)?;
        info.set_item("contact", objects(py, &bench.contact())?)?;
        info.set_item("fault", objects(py, &bench.fault())?)?;
        Ok(info)
    }
}

fn nothing_to_render() -> PyErr {
    wrong(
        "there is no episode to render",
        "call `reset` before `render`",
    )
}

/// Red, green and blue of an image, `[height, width, 3]`.
pub(crate) fn rgb<'py>(
    py: Python<'py>,
    drawn: Option<Result<PixelImage, RasterError>>,
) -> PyResult<Bound<'py, PyArray3<u8>>> {
    let drawn = drawn.ok_or_else(nothing_to_render)?;
    let image = drawn.map_err(|error| raised("FaultError", error.to_string()))?;
    let shape = [image.height_px(), image.width_px(), 3];
    PyArray1::from_vec(py, image.rgb()).reshape(shape)
}

/// The samples of every signal, as arrays.
pub(crate) fn columns<'py>(py: Python<'py>, trace: &Trace) -> PyResult<Bound<'py, PyDict>> {
    let columns = PyDict::new(py);
    let times = (0..trace.len()).map(|i| i as f64 * trace.dt_s());
    columns.set_item("time", PyArray1::from_iter(py, times))?;
    for (at, signal) in trace.schema().signals().iter().enumerate() {
        columns.set_item(&signal.name, PyArray1::from_slice(py, trace.column(at)))?;
    }
    Ok(columns)
}

/// Test bench of `brakecheck.Env`.
#[pyclass(frozen, module = "brakecheck._brakecheck")]
pub(crate) struct RawBench {
    playing: Arc<Mutex<Playing>>,
    world: Scenario,
    /// The ego is a program, which only its deadline interrupts.
    awaits_program: bool,
    observation: usize,
    actions: usize,
}

#[pymethods]
impl RawBench {
    #[new]
    fn new(py: Python<'_>, world: &RawWorld, every_sample: bool) -> PyResult<RawBench> {
        let spaces = world.0.world().spaces();
        // Making an ego in Python needs the interpreter, which this thread would hold
        // otherwise.
        let mut playing = py.detach(|| Playing::new(&world.0));
        check_interrupted()?;
        if every_sample {
            playing = playing.filmed(world.0.clone());
        }
        Ok(RawBench {
            observation: spaces.observation,
            actions: spaces.actions,
            awaits_program: world.0.program().is_some(),
            world: world.0.clone(),
            playing: Arc::new(Mutex::new(playing)),
        })
    }

    /// Begins the `index`-th episode of a stream and returns its first observation.
    fn reset<'py>(
        &self,
        py: Python<'py>,
        key: (String, u64, u64),
        aftermath: bool,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let (purpose, seed, index) = key;
        let purpose = purpose_of(&purpose)?;
        let key = StartKey {
            purpose,
            seed,
            index,
        };
        self.play(py, move |playing| playing.begin(key, after(aftermath)))?;
        self.observed(py)
    }

    /// Begins an episode from your own start: a value per axis.
    fn reset_at<'py>(
        &self,
        py: Python<'py>,
        start: Vec<f64>,
        noise: u64,
        aftermath: bool,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let playing = self.lock()?;
        let axes = playing.bench.axes();
        if axes.len() != start.len() {
            let names: Vec<_> = axes.iter().map(|axis| axis.name.as_str()).collect();
            return Err(wrong(
                format!("{} values are no start of {} axes", start.len(), axes.len()),
                format!("give one for each of: {}", names.join(", ")),
            ));
        }
        for (axis, value) in axes.iter().zip(&start) {
            if !(axis.lo..=axis.hi).contains(value) {
                return Err(wrong(
                    format!("the start's `{}` is {value} {}", axis.name, axis.unit),
                    format!("it lies from {} to {} in this world", axis.lo, axis.hi),
                ));
            }
        }
        // The lock is not reentrant, and the play below takes it.
        drop(playing);
        self.play(py, move |playing| {
            playing.begin_at(Start(start), noise, after(aftermath));
        })?;
        self.observed(py)
    }

    /// Takes a joint action, and returns observation, reward, terminated and truncated.
    fn step<'py>(
        &self,
        py: Python<'py>,
        action: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyArray1<f32>>, f64, bool, bool)> {
        // `extract` takes what has `__index__`, which a float has not.
        let action = match action.extract::<usize>() {
            Ok(number) if number < self.actions => number,
            _ => return Err(no_action(action.repr()?, self.actions)),
        };
        let playing = self.lock()?;
        let is_over = playing.bench.trace().is_empty() || playing.bench.is_done();
        drop(playing);
        if is_over {
            return Err(wrong(
                "there is no episode to go on with",
                "call `reset` before the first step and after the last one",
            ));
        }
        let (reward, terminated, truncated) = self.play(py, move |it| it.decide(action))?;
        Ok((self.observed(py)?, reward, terminated, truncated))
    }

    /// Returns the info of the episode so far.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.lock()?.info(py)
    }

    /// Draws the current sample from above, `[height, width, 3]`.
    fn render<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let world = self.world.clone();
        let drawn = self.play(py, move |playing| playing.pixels(&world))?;
        rgb(py, drawn)
    }

    /// Draws all samples since the last call or the start, `[height, width, 3]` each.
    fn render_samples<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray3<u8>>>> {
        let mut playing = self.lock()?;
        if playing.bench.trace().is_empty() {
            return Err(nothing_to_render());
        }
        let film = playing.film.as_mut();
        // Taken out before rendering, so that a long rendering blocks no step.
        let pictures = film.map(|it| std::mem::take(&mut it.pictures));
        drop(playing);
        let images = pictures.into_iter().flatten().map(|svg| {
            // A video has hundreds of pictures, and Ctrl-C should not wait for the last.
            check_interrupted()?;
            rgb(py, Some(py.detach(|| PixelImage::of(&svg, 1.0))))
        });
        images.collect()
    }

    /// Returns the samples so far, by signal.
    fn trace<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        columns(py, self.lock()?.bench.trace())
    }

    /// Returns start, noise and joint actions, which are enough to play it again.
    fn played(&self) -> PyResult<(Vec<f64>, u64, Vec<usize>)> {
        let playing = self.lock()?;
        Ok((
            playing.start.0.clone(),
            playing.noise,
            playing.actions.clone(),
        ))
    }
}

fn after(aftermath: bool) -> Aftermath {
    if aftermath {
        Aftermath::Play
    } else {
        Aftermath::Skip
    }
}

/// Error of an action that does not exist in a world with this number of actions.
pub(crate) fn no_action(action: impl Display, actions: usize) -> PyErr {
    wrong(
        format!("{action} is no action of {actions}"),
        format!("actions are the integers 0 to {}", actions - 1),
    )
}

/// Another thread has the lock. This thread never waits for it, because that thread
/// may wait for the interpreter or for an abandoned program.
pub(crate) fn in_use(what: &str) -> PyErr {
    wrong(
        format!("another thread plays in {what}, or an interrupted one still does"),
        "make one environment per thread, and another one after Ctrl-C",
    )
}

impl RawBench {
    fn lock(&self) -> PyResult<MutexGuard<'_, Playing>> {
        let playing = self.playing.try_lock();
        playing.map_err(|_| in_use("this environment"))
    }

    /// Plays without the lock of the interpreter, until Ctrl-C at most.
    fn play<T: Send + 'static>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Playing) -> T + Send + 'static,
    ) -> PyResult<T> {
        // A program may never answer, and only a thread that is left behind lets Ctrl-C
        // through.
        if self.awaits_program {
            let playing = self.playing.clone();
            let play = move |_: &_| playing.try_lock().ok().map(|mut it| work(&mut it));
            let played = interruptible(py, play, |_| Ok(()))?;
            return played.ok_or_else(|| in_use("this environment"));
        }
        let mut locked = self.lock()?;
        let playing = &mut *locked;
        let played = py.detach(|| work(playing));
        check_interrupted()?;
        Ok(played)
    }

    fn observed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        // Each observation is an array of its own, because replay buffers keep references
        // to earlier ones.
        let obs = PyArray1::<f32>::zeros(py, self.observation, false);
        {
            let mut written = obs.readwrite();
            self.lock()?.bench.observe(written.as_slice_mut()?);
        }
        Ok(obs)
    }
}
