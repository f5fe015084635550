//! Option `--rerun`: a stream for the rerun viewer while a command runs.

use std::path::Path;

use clap::Args;

use super::failure::Failure;
use super::headings::OUTPUT;
use super::terminal;
use crate::experiment::Audience;
#[cfg(feature = "rerun")]
use crate::run_dir::counted;
#[cfg(feature = "rerun")]
use crate::view::{EpisodeStream, LiveEnd, LiveView, ShownShare, ViewError};

/// Name of standard output as a place.
const STDOUT: &str = "-";
/// Name of a viewer that runs already.
const CONNECT: &str = "connect";

/// Stream for the rerun viewer.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct RerunArgs {
    /// Stream episodes to the rerun viewer while the command runs: a file, or `-` for
    /// `... | rerun -`.
    #[arg(long, value_name = "FILE.rrd|-", help_heading = OUTPUT)]
    rerun: Option<String>,
    /// Stream every episode that `--rerun` can show, even if the command then takes
    /// longer.
    #[arg(long, requires = "rerun", help_heading = OUTPUT)]
    rerun_all: bool,
}

/// Content of a stream, which decides on its views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Streamed {
    /// Episodes alone.
    Episodes,
    /// Episodes of a training, with its learning curves.
    Training,
}

/// Stream of a command, if one was requested.
#[derive(Default)]
pub(super) struct Live {
    #[cfg(feature = "rerun")]
    view: Option<LiveView>,
}

impl RerunArgs {
    /// Returns whether a stream was requested.
    pub(super) fn is_given(&self) -> bool {
        self.rerun.is_some()
    }

    /// Returns whether a stream of all episodes was requested.
    pub(super) fn is_complete(&self) -> bool {
        self.rerun_all
    }

    /// Prints data on stdout, or on stderr if the stream has stdout.
    pub(super) fn data(&self, text: &str) -> Result<(), Failure> {
        if self.rerun.as_deref() == Some(STDOUT) {
            // Text between the bytes of a recording would damage it for the viewer.
            terminal::note(text);
            return Ok(());
        }
        terminal::data(text)
    }

    /// Refuses a stream without a place, before any work or file.
    pub(super) fn admit(&self, json: bool) -> Result<(), Failure> {
        let Some(place) = self.rerun.as_deref() else {
            return Ok(());
        };
        // The option exists in every build, so that a user reads the reason instead of a
        // usage error.
        if !cfg!(feature = "rerun") {
            return Err(without_viewer());
        }
        match place {
            STDOUT if json => Err(Failure::input(
                "`--json` and `--rerun -` both write to standard output",
                "stream to a file: `--rerun live.rrd`",
            )),
            STDOUT if terminal::stdout_for_bytes().is_none() => Err(Failure::input(
                "`--rerun -` writes bytes for the viewer, and standard output is a terminal",
                "pipe it to the viewer: `brakecheck ... --rerun - | rerun -`",
            )),
            STDOUT => Ok(()),
            CONNECT if cfg!(feature = "connect") => Ok(()),
            CONNECT => Err(Failure::input(
                "this brakecheck was built without the connection to a running viewer",
                "pipe the stream to the viewer: `brakecheck ... --rerun - | rerun -`; or install \
                 with `--features connect`",
            )),
            file => check_file(Path::new(file)),
        }
    }

    /// Opens the stream, if one is requested, after [`RerunArgs::admit`].
    ///
    /// `name` is that of the recording.
    #[cfg(feature = "rerun")]
    pub(super) fn open(&self, name: &str, content: Streamed) -> Result<Live, Failure> {
        let Some(stream) = self.stream(name, content)? else {
            return Ok(Live::default());
        };
        let share = if self.rerun_all {
            ShownShare::All
        } else {
            ShownShare::InTime
        };
        let view = LiveView::start(stream, share)
            .map_err(|error| Failure::fault(format!("no thread for the stream: {error}"), None))?;
        Ok(Live { view: Some(view) })
    }

    /// Opens the stream without a thread of its own.
    #[cfg(feature = "rerun")]
    pub(super) fn stream(
        &self,
        name: &str,
        content: Streamed,
    ) -> Result<Option<EpisodeStream>, Failure> {
        let learning = content == Streamed::Training;
        let opened = match self.rerun.as_deref() {
            None => return Ok(None),
            #[cfg(feature = "connect")]
            Some(CONNECT) => EpisodeStream::connect(name, learning),
            Some(STDOUT) => match terminal::stdout_for_bytes() {
                Some(stdout) => EpisodeStream::new(Box::new(stdout), name, learning),
                // `admit` has refused a terminal already.
                None => return Ok(None),
            },
            // A viewer reads the file while it grows, so it cannot appear whole at the
            // end.
            Some(file) => match std::fs::File::create(file) {
                Ok(created) => EpisodeStream::new(Box::new(created), name, learning),
                Err(source) => Err(ViewError::Write {
                    path: file.into(),
                    source,
                }),
            },
        };
        Ok(Some(opened.map_err(failure)?))
    }

    /// Returns no stream, because `admit` refuses each.
    #[cfg(not(feature = "rerun"))]
    pub(super) fn open(&self, _: &str, _: Streamed) -> Result<Live, Failure> {
        Ok(Live::default())
    }
}

impl Live {
    /// Returns the viewer of the work.
    pub(super) fn audience(&self) -> Option<&dyn Audience> {
        #[cfg(feature = "rerun")]
        return self.view.as_ref().map(|view| view as &dyn Audience);
        #[cfg(not(feature = "rerun"))]
        None
    }
}

/// The end of a command ends its stream, with a note on its content.
#[cfg(feature = "rerun")]
impl Drop for Live {
    fn drop(&mut self) {
        if let Some(end) = self.view.as_ref().and_then(LiveView::finish) {
            terminal::note(&in_words(&end));
            // A closed viewer is the user's choice, any other end a failure.
            let is_torn = end.error.is_some_and(|it| !matches!(it, ViewError::Closed));
            if is_torn {
                terminal::note_torn();
            }
        }
    }
}

/// Refuses a file that is no recording, or that has no directory.
fn check_file(file: &Path) -> Result<(), Failure> {
    let name = file.display();
    if file.extension().is_none_or(|extension| extension != "rrd") {
        return Err(Failure::input(
            format!("`{name}` is no name of a recording"),
            "end it with `.rrd`, e.g. `--rerun live.rrd`",
        ));
    }
    // A bare name has an empty parent, and its directory exists.
    let parent = file
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    if parent.is_some_and(|parent| !parent.is_dir()) {
        return Err(Failure::input(
            format!("`{name}` is in no directory that exists"),
            "make its directory first, or name a file in another",
        ));
    }
    Ok(())
}

#[cfg(feature = "rerun")]
fn in_words(end: &LiveEnd) -> String {
    let all = end.shown + end.left_out;
    let episodes = format!("streamed {} of {}", end.shown, counted(all, "episode"));
    match &end.error {
        None => episodes,
        // A closed viewer is the user's choice, so there is nothing to mend.
        Some(ViewError::Closed) => format!("{episodes}; then the viewer was closed"),
        Some(error) => format!("{episodes}; {error}\n  help: {}", error.help()),
    }
}

#[cfg(feature = "rerun")]
pub(super) fn failure(error: ViewError) -> Failure {
    let help = error.help();
    match error {
        ViewError::Write { .. } | ViewError::NoViewer { .. } => {
            Failure::input(error.to_string(), help)
        }
        _ => Failure::fault(error.to_string(), Some(help.to_owned())),
    }
}

/// Returns the failure of a build without the viewer, with the alternative.
pub(super) fn without_viewer() -> Failure {
    Failure::input(
        "this brakecheck was built without the viewer's recordings",
        "install it with its default features (`--features rerun`); `-o crash.svg` writes a \
         picture that any browser plays, and `brakecheck replay` and `brakecheck report RUN` say \
         in words and pictures what happened",
    )
}
