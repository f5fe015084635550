//! `brakecheck serve`: a trained ado for another simulator.

use std::io;
use std::path::PathBuf;

use clap::Args;

use super::common::open_run;
use super::failure::{Exit, Failure};
use super::terminal::{self, Common};
use crate::serving::{ServeError, ServedAdo};

/// Page that describes the protocol.
const DOCUMENT: &str = "docs/reference/ado-protocol.md";

#[derive(Args, Debug)]
pub(super) struct ServeArgs {
    /// The run directory of a trained ado.
    run: PathBuf,
    /// Write the counterexamples of judged episodes into a directory.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

impl ServeArgs {
    pub(super) fn common(&self) -> Common {
        Common::default()
    }
}

#[allow(clippy::disallowed_methods, reason = "messages of the protocol")]
pub(super) fn run(args: &ServeArgs) -> Result<Exit, Failure> {
    let run = open_run(&args.run, &args.common())?;
    let mut ado = ServedAdo::of(&run)?;
    if let Some(dir) = &args.keep {
        ado = ado.keep_in(dir.clone());
    }
    terminal::note(&format!(
        "the ado of world `{}` answers on standard output, line by line ({DOCUMENT})",
        ado.world().name()
    ));
    let served = ado.serve(&mut io::stdin().lock(), &mut io::stdout().lock())?;
    terminal::note(&format!(
        "{} decisions, {} messages answered with an error",
        served.decisions, served.errors
    ));
    if served.episodes > 0 {
        terminal::note(&format!(
            "{} judged episodes, the ego failed in {} of them, {} kept",
            served.episodes, served.successes, served.kept
        ));
    }
    Ok(Exit::Done)
}

impl From<ServeError> for Failure {
    fn from(error: ServeError) -> Failure {
        let what = error.to_string();
        match error {
            ServeError::NoMessage { .. } => Failure::input(
                what,
                format!(
                    "a message is one line of JSON, an object with a key for what it asks ({DOCUMENT})"
                ),
            ),
            ServeError::Pipe(_) => Failure::fault(
                what,
                Some("the simulator says `close`, or ends its side of the pipe, first".to_owned()),
            ),
        }
    }
}
