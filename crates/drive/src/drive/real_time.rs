//! The clock: plays an episode in real time and does what the pages ask.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use super::error::DriveError;
use super::hub::Hub;
use super::input::DriveInput;
use super::message::{DriveRequest, PageMessage, Stage};
use super::sandbox::{Players, Sandbox, Setup};
use super::session::DrivenEpisode;
use super::watched::WatchedWorld;
use crate::world::Scenario;

/// Time between two looks at the watched file, and at the pages while nothing runs.
const LOOK: Duration = Duration::from_millis(250);
/// Speeds against real time.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.05..=8.0;

/// Greatest number of a test start, as on the command line.
const MOST_STARTS: usize = 999_999;

/// Settings of a drive.
pub struct DriveSettings {
    /// Directory for kept counterexamples.
    pub keep: PathBuf,
    /// Seed of the test starts.
    pub seed: u64,
    /// Position of the first start.
    pub index: usize,
    /// World file to load again when it is saved.
    pub watch: Option<WatchedWorld>,
}

/// Event for the clock.
pub(super) enum PageEvent {
    /// A page has come.
    Joined(u64),
    /// A page has gone.
    Left,
    /// A page asks.
    Asked(u64, DriveRequest),
    /// The program ends.
    End,
}

/// The clock, with the episode that it plays.
pub(super) struct RealTime<'a> {
    sandbox: Sandbox,
    settings: DriveSettings,
    episode: DrivenEpisode,
    hub: Hub,
    /// Position of the test start, from which the next follows.
    index: usize,
    /// Position of the episode's test start. `None`: values of your own.
    number: Option<usize>,
    /// Drivers that are chosen for the next test start.
    players: Option<Players>,
    /// Cause of the failure that was played to its end.
    cause: Option<String>,
    input: DriveInput,
    running: bool,
    speed: f64,
    /// Instant of the next sample while it runs.
    due: Instant,
    problems: Option<String>,
    /// Called with messages for the person at the terminal.
    note: &'a (dyn Fn(&str) + Sync),
}

impl<'a> RealTime<'a> {
    pub(super) fn new(
        sandbox: Sandbox,
        settings: DriveSettings,
        hub: Hub,
        note: &'a (dyn Fn(&str) + Sync),
    ) -> Result<RealTime<'a>, DriveError> {
        let setup = sandbox.first_setup(settings.seed, settings.index)?;
        Ok(RealTime {
            episode: DrivenEpisode::begin(&sandbox, &setup)?,
            index: settings.index,
            number: Some(settings.index),
            sandbox,
            settings,
            hub,
            players: None,
            cause: None,
            input: DriveInput::default(),
            running: false,
            speed: 1.0,
            due: Instant::now(),
            problems: None,
            note,
        })
    }

    /// Plays until the program ends.
    pub(super) fn run(mut self, events: &Receiver<PageEvent>) {
        let mut looked = Instant::now();
        loop {
            let now = Instant::now();
            // By the time and not after each wait, since messages may come
            // without a pause.
            if now.duration_since(looked) >= LOOK {
                looked = now;
                self.look();
            }
            let wait = if self.running {
                // At most `LOOK`, because a slow speed must not delay the
                // reload of a saved world.
                self.due.saturating_duration_since(now).min(LOOK)
            } else {
                LOOK
            };
            match events.recv_timeout(wait) {
                Ok(PageEvent::End) | Err(RecvTimeoutError::Disconnected) => return,
                Ok(PageEvent::Joined(page)) => self.welcome(page),
                Ok(PageEvent::Left) => self.page_left(),
                Ok(PageEvent::Asked(page, request)) => self.answer(page, request),
                Err(RecvTimeoutError::Timeout) => {}
            }
            // After every event, so that a page that asks often does not stop
            // the clock.
            if self.running && self.due <= Instant::now() {
                self.sample();
            }
        }
    }

    fn sample(&mut self) {
        let Some(frame) = self.episode.advance(self.input) else {
            self.running = false;
            return self.send_state(None);
        };
        let frame = PageMessage::Frame(Box::new(frame.clone()));
        self.hub.send(None, &frame);
        if self.episode.has_new_road() {
            let geometry = Box::new(self.episode.stage());
            self.hub.send(None, &PageMessage::Geometry(geometry));
        }
        let step = Duration::from_secs_f64(self.episode.sample_s() / self.speed);
        // After a delay the clock goes on from now, and does not race to make up for it.
        self.due = (self.due + step).max(Instant::now() - step);
        if self.episode.is_done() {
            self.running = false;
            self.send_state(None);
            // It takes replays, so the page shows the end before.
            self.cause = self.episode.why().map(|why| why.to_string());
            self.send_cause(None);
        }
    }

    fn send_cause(&self, to: Option<u64>) {
        if let Some(cause) = &self.cause {
            self.hub.send(to, &PageMessage::Cause(cause.clone()));
        }
    }

    fn send_state(&self, to: Option<u64>) {
        let state = PageMessage::State {
            running: self.running,
            done: self.episode.is_done(),
            speed: self.speed,
            wheel: self.hub.wheel(),
            number: self.number,
        };
        self.hub.send(to, &state);
    }

    fn send_episode(&self, to: Option<u64>) {
        let stage = Stage::of(&self.sandbox, &self.episode);
        self.hub.send(to, &PageMessage::Stage(Box::new(stage)));
        self.send_frames(to);
        self.send_cause(to);
        if let Some(problems) = &self.problems {
            self.hub.send(to, &PageMessage::Problems(problems.clone()));
        }
    }

    fn send_frames(&self, to: Option<u64>) {
        let frames = self.episode.frames().to_vec();
        self.hub.send(to, &PageMessage::Frames(frames));
    }

    fn welcome(&mut self, page: u64) {
        self.send_episode(Some(page));
        self.send_state(None);
    }

    fn page_left(&mut self) {
        if self.hub.wheel().is_none() {
            // Nobody is at the wheel, so nothing goes on.
            self.running = false;
        }
        // Keys that the page held are never released by it.
        self.input = DriveInput::default();
        self.send_state(None);
    }

    fn answer(&mut self, page: u64, request: DriveRequest) {
        // It may have lost the wheel since it asked.
        if self.hub.wheel() != Some(page) {
            return;
        }
        match request {
            // Bounded here, since a page is foreign input like any other.
            DriveRequest::Keys(input) => self.input = input.bounded(),
            DriveRequest::Run(running) => self.go(running),
            DriveRequest::Step => {
                self.running = false;
                self.sample();
                self.send_state(None);
            }
            DriveRequest::Speed(speed) if speed.is_finite() => {
                self.speed = speed.clamp(*SPEEDS.start(), *SPEEDS.end());
                self.send_state(None);
            }
            // NaN passes a clamp, and a duration of it would panic.
            DriveRequest::Speed(_) => {}
            DriveRequest::Back(sample) => self.back(sample),
            DriveRequest::Begin(setup) => {
                self.begin(&setup);
            }
            DriveRequest::Players(players) => self.players = Some(players),
            // Saturating, because the index of a page is any number.
            DriveRequest::Next => self.start(self.index.saturating_add(1)),
            DriveRequest::Start(index) => self.start(index),
            DriveRequest::Keep => self.keep(),
        }
    }

    fn go(&mut self, running: bool) {
        // A world with mistakes shows them in place of the scene.
        self.running = running && !self.episode.is_done() && self.problems.is_none();
        // The pause is not caught up.
        self.due = Instant::now();
        self.send_state(None);
    }

    fn back(&mut self, sample: usize) {
        self.running = false;
        match self.episode.back_to(sample) {
            Ok(()) => {
                // The end that it explains is gone.
                self.cause = None;
                self.send_frames(None);
            }
            Err(error) => self.refuse(&error),
        }
        self.send_state(None);
    }

    /// Begins an episode. `false`: it is refused, and the present one stays.
    fn begin(&mut self, setup: &Setup) -> bool {
        self.running = false;
        let begun = DrivenEpisode::begin(&self.sandbox, setup);
        let is_begun = begun.is_ok();
        match begun {
            Ok(episode) => {
                self.episode = episode;
                self.cause = None;
                self.number = self.number_of(setup);
                self.send_episode(None);
            }
            Err(error) => self.refuse(&error),
        }
        self.send_state(None);
        is_begun
    }

    /// Returns the position of a setup's test start, if it is the present one.
    fn number_of(&self, setup: &Setup) -> Option<usize> {
        let drawn = self.sandbox.first_setup(self.settings.seed, self.index);
        let is_drawn = |drawn: &Setup| drawn.start == setup.start && drawn.noise == setup.noise;
        drawn.ok().filter(is_drawn).map(|_| self.index)
    }

    /// Begins a test start, with the chosen players or those of the present episode.
    fn start(&mut self, index: usize) {
        let present = self.episode.setup().clone();
        let players = self.players.take().unwrap_or(Players {
            ego: present.ego,
            ado: present.ado,
            ego_values: present.ego_values,
        });
        let first = match index {
            0..=MOST_STARTS => self.sandbox.first_setup(self.settings.seed, index),
            _ => Err(DriveError::NoStart { index }),
        };
        match first {
            Ok(first) => {
                // Before the beginning, since the number of the setup is that
                // of the present index.
                let before = std::mem::replace(&mut self.index, index);
                let is_begun = self.begin(&Setup {
                    ego: players.ego,
                    ado: players.ado,
                    start: first.start,
                    noise: first.noise,
                    ego_values: players.ego_values,
                });
                if !is_begun {
                    self.index = before;
                }
            }
            Err(error) => {
                self.refuse(&error);
                // The page shows the number of the start that stays.
                self.send_state(None);
            }
        }
    }

    fn keep(&mut self) {
        match self.episode.keep(&self.settings.keep) {
            Ok(file) => {
                (self.note)(&format!("kept {}", file.display()));
                let name = file.display().to_string();
                self.hub.send(None, &PageMessage::Kept(name));
            }
            Err(error) => self.refuse(&error),
        }
    }

    fn refuse(&self, error: &DriveError) {
        let text = match error.help() {
            Some(help) => format!("{error}: {help}"),
            None => error.to_string(),
        };
        self.hub.send(None, &PageMessage::Note(text));
    }

    /// Loads the watched world again if it was saved.
    fn look(&mut self) {
        let Some(changed) = self.settings.watch.as_mut().and_then(WatchedWorld::changed) else {
            return;
        };
        match changed.and_then(|world| self.reload(world)) {
            Ok(()) => {
                self.problems = None;
                (self.note)("the world was loaded again");
                self.send_episode(None);
            }
            Err(problems) => {
                // Every save repeats a mistake that is not mended yet.
                if self.problems.as_ref() != Some(&problems) {
                    (self.note)(&problems);
                }
                self.problems = Some(problems.clone());
                self.hub.send(None, &PageMessage::Problems(problems));
            }
        }
        self.running = false;
        self.send_state(None);
    }

    fn reload(&mut self, world: Scenario) -> Result<(), String> {
        let sandbox = self.sandbox.in_world(world).map_err(|it| it.to_string())?;
        let setup = kept_setup(&self.sandbox, self.episode.setup(), &sandbox)
            .map_err(|it| it.to_string())?;
        self.episode = DrivenEpisode::begin(&sandbox, &setup).map_err(|it| it.to_string())?;
        self.cause = None;
        // Last, so that a world that cannot begin leaves the old one running.
        self.sandbox = sandbox;
        self.number = self.number_of(&setup);
        Ok(())
    }
}

/// Returns the setup in an edited world: each axis keeps its value where it still may have it.
///
/// # Errors
/// The edited world has no start.
fn kept_setup(before: &Sandbox, setup: &Setup, after: &Sandbox) -> Result<Setup, DriveError> {
    let old = before.world().axes();
    // Its values are those of axes that the world did not have before.
    let first = after.first_setup(0, 0)?;
    let value = |name: &str| {
        let at = old.iter().position(|axis| axis.name == name)?;
        setup.start.get(at).copied()
    };
    let axes = after.world().axes().into_iter().zip(first.start);
    let start = axes.map(|(axis, drawn)| match value(&axis.name) {
        // The edit may have narrowed the axis.
        Some(value) => value.clamp(axis.lo, axis.hi),
        None => drawn,
    });
    let is_known = |ego: &String| after.egos().contains(ego);
    let ego = Some(setup.ego.clone())
        .filter(is_known)
        .unwrap_or(first.ego);
    let players = after.players();
    let ado = if players.contains(&setup.ado) {
        setup.ado
    } else {
        first.ado
    };
    Ok(Setup {
        ego,
        ado,
        start: start.collect(),
        noise: setup.noise,
        ego_values: Default::default(),
    })
}
