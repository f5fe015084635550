//! `brakecheck serve`: ados for another simulator.

use std::io;
use std::path::PathBuf;

use clap::Args;

use super::common::{load_world, one_of, open_run};
use super::failure::{Exit, Failure};
use super::output_path::new_dir;
use super::run_under_test::is_world;
use super::terminal::{self, Common};
use crate::run_dir::counted;
use crate::search::AdoPlayer;
use crate::serving::{NotServed, ServeError, ServedAdo};

/// Page that describes the protocol.
const DOCUMENT: &str = "docs/reference/ado-protocol.md";

#[derive(Args, Debug)]
pub(super) struct ServeArgs {
    /// A world file, the name of a shipped world, or a run directory with a trained ado.
    #[arg(value_name = "WORLD|RUN")]
    what: PathBuf,
    /// Player of the ados. Default: trained for a run, and neutral for a world.
    #[arg(long, value_parser = one_of::<AdoPlayer>())]
    ado: Option<AdoPlayer>,
    /// Write the counterexamples of judged episodes into a directory.
    #[arg(long, value_name = "DIR", value_parser = new_dir())]
    keep: Option<PathBuf>,
    /// Start the program that the world's file names as its ego, which a search plays.
    #[arg(long)]
    allow_programs: bool,
}

impl ServeArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            allow_programs: self.allow_programs,
            ..Common::default()
        }
    }
}

fn ado(args: &ServeArgs) -> Result<ServedAdo, Failure> {
    let common = args.common();
    // A file that is not there was meant as a world, if its name is that of one.
    let is_named_so = args.what.extension().is_some_and(|it| it == "ron");
    if is_world(&args.what) || is_named_so {
        let player = args.ado.unwrap_or(AdoPlayer::Neutral);
        return Ok(ServedAdo::untrained(
            load_world(&args.what, &common)?,
            player,
        )?);
    }
    let run = open_run(&args.what, &common)?;
    Ok(match args.ado {
        None | Some(AdoPlayer::Trained) => ServedAdo::of(&run)?,
        Some(player) => ServedAdo::untrained(run.scenario()?, player)?,
    })
}

#[allow(clippy::disallowed_methods, reason = "messages of the protocol")]
pub(super) fn run(args: &ServeArgs) -> Result<Exit, Failure> {
    let mut ado = ado(args)?;
    if let Some(dir) = &args.keep {
        ado = ado.keep_in(dir.clone());
    }
    // On stderr, because the simulator reads stdout line by line.
    terminal::note(&format!(
        "the {} ado of world `{}` answers on standard output, line by line ({DOCUMENT})",
        ado.player(),
        ado.world().name()
    ));
    let served = ado.serve(&mut io::stdin().lock(), &mut io::stdout().lock())?;
    terminal::note(&format!(
        "{}, {} answered with an error",
        counted(served.decisions, "decision"),
        counted(served.errors, "message")
    ));
    // A simulator that asks for decisions alone has no judged episodes.
    if served.episodes > 0 {
        terminal::note(&format!(
            "{}, the ego failed in {} of them, {} kept",
            counted(served.episodes, "judged episode"),
            served.successes,
            served.kept
        ));
    }
    // A message with a mistake was answered, so the simulator decides what follows.
    Ok(Exit::Done)
}

impl From<NotServed> for Failure {
    fn from(error: NotServed) -> Failure {
        let what = error.to_string();
        match error {
            NotServed::Grid { .. } => {
                Failure::input(what, "train an ado in it, or name a driving world")
            }
            NotServed::NotTrained { world } => Failure::input(
                what,
                format!(
                    "train one and serve its run (`brakecheck train {world} -o RUN`), or take \
                     another `--ado`"
                ),
            ),
            NotServed::Ego(error) => error.into(),
        }
    }
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
