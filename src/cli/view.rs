//! `brakecheck view`: an episode as a recording or a self-playing picture.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::json;
use strum::VariantArray;

use super::{Common, Exit, Failure, print_json, terminal};
use crate::crashes::{Regressions, Replayed, ViewKind, picture};
use crate::ego::reference::ReferenceDriver;
use crate::run_dir::write_file;

#[derive(Args, Debug)]
pub(super) struct ViewArgs {
    /// A kept counterexample, a directory of them, or a run directory.
    #[arg(value_name = "FILE|DIR|RUN")]
    what: PathBuf,
    /// Which of them: a number (from 0) or a file name.
    #[arg(default_value = "0")]
    episode: String,
    /// Replay against this ego first: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// The recording to write, or a picture from above that plays in any
    /// browser [default: the episode's name with .rrd].
    #[arg(short, long, value_name = "OUT.rrd|OUT.svg")]
    output: Option<PathBuf>,
    /// Beside it in the picture, what this reference driver does in the ego's
    /// place (docs/background/preventability.md).
    #[arg(long, value_name = "DRIVER", value_parser = drivers())]
    beside: Option<String>,
    /// Print one JSON object on stdout instead of messages.
    #[arg(long)]
    json: bool,
    /// Start the program that a kept file names as the ego.
    #[arg(long)]
    allow_programs: bool,
}

impl ViewArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            allow_programs: self.allow_programs,
            ..Common::default()
        }
    }
}

fn drivers() -> PossibleValuesParser {
    PossibleValuesParser::new(ReferenceDriver::VARIANTS.iter().map(|it| it.name()))
}

pub(super) fn run(args: &ViewArgs) -> Result<Exit, Failure> {
    let kind = args.output.as_deref().map(ViewKind::of).transpose()?;
    let is_picture = kind == Some(ViewKind::Picture);
    if args.beside.is_some() && !is_picture {
        return Err(Failure::input(
            "`--beside` is for pictures",
            "name one to write: `-o crash.svg`",
        ));
    }
    // Refused before any replay, which could start a program.
    if !is_picture && !cfg!(feature = "rerun") {
        return Err(without_viewer());
    }
    let single = args.what.is_file();
    // A file has a single counterexample, so the default number 0 must not select.
    let episode = (!single).then_some(args.episode.as_str());
    let regressions = Regressions::find(&args.what, episode)?.allow_programs(args.allow_programs);
    let ego = ego(args, &regressions);
    let replayed = match args.ego.as_deref() {
        Some(ego) => regressions.against(Some(ego), &[])?.replay()?,
        None => regressions.replay_recorded()?,
    };
    let Some(replayed) = replayed.first() else {
        return Err(Failure::input(
            format!("`{}` holds no kept counterexample", args.what.display()),
            "name one, or a directory of them",
        ));
    };
    if let Some(fault) = replayed.fault() {
        let message = format!("there is nothing to see: {fault}");
        return Err(Failure::fault(message, None));
    }
    match &args.output {
        Some(output) if is_picture => draw(args, (replayed, ego), output),
        _ => recording(args, replayed),
    }?;
    Ok(Exit::Done)
}

/// Returns the name of the ego: the requested ego, or that of the file.
fn ego(args: &ViewArgs, regressions: &Regressions) -> String {
    let recorded = regressions.kept().first();
    let recorded = recorded.map(|kept| kept.counterexample.ego.clone());
    let ego = args.ego.clone().or(recorded).unwrap_or_default();
    match ego.strip_suffix(".ron") {
        // A caption has room for a name, not for a path.
        Some(file) => file
            .rsplit(std::path::is_separator)
            .next()
            .unwrap_or(file)
            .to_owned(),
        None => ego,
    }
}

/// Writes the picture.
fn draw(
    args: &ViewArgs,
    (replayed, ego): (&Replayed, String),
    output: &Path,
) -> Result<(), Failure> {
    let mut drivers = ReferenceDriver::VARIANTS.iter().copied();
    let beside = drivers.find(|it| Some(it.name()) == args.beside.as_deref());
    let svg = picture(replayed, &ego, beside)?;
    write_file(output, svg.as_bytes())?;
    let file = output.display().to_string();
    if args.json {
        print_json(&json!({ "file": file, "bytes": svg.len() }))
    } else {
        terminal::data(&format!(
            "{file}: {} kB; any browser plays it",
            svg.len().div_ceil(1000)
        ))
    }
}

/// Writes the recording and prints its path.
fn recording(args: &ViewArgs, replayed: &Replayed) -> Result<(), Failure> {
    let name = replayed.path.with_extension("rrd");
    let name = name.file_name().map(PathBuf::from).unwrap_or(name);
    let output = args.output.clone().unwrap_or(name);
    let (file, bytes, samples) = record(replayed, &output)?;
    if args.json {
        print_json(&json!({ "file": file, "bytes": bytes, "samples": samples }))
    } else {
        terminal::data(&format!(
            "{file}: {samples} samples, {} kB; open it with `rerun {file}`",
            bytes.div_ceil(1000)
        ))
    }
}

/// Writes the recording, and returns its name, bytes and samples.
#[cfg(feature = "rerun")]
fn record(replayed: &Replayed, output: &Path) -> Result<(String, u64, usize), Failure> {
    let file = replayed.path.display().to_string();
    let caption = match replayed.departure() {
        Some(departure) => format!("{file}: {departure}"),
        None => file,
    };
    let recorded = crate::view::record(&replayed.scenario, &replayed.episode, &caption, output)
        .map_err(|error| Failure::fault(error.to_string(), Some(error.help().to_owned())))?;
    let file = recorded.path.display().to_string();
    Ok((file, recorded.bytes, recorded.samples))
}

#[cfg(not(feature = "rerun"))]
fn record(_: &Replayed, _: &Path) -> Result<(String, u64, usize), Failure> {
    Err(without_viewer())
}

/// Returns the failure of a build without the viewer, with the alternative.
fn without_viewer() -> Failure {
    Failure::input(
        "this brakecheck was built without the viewer's recordings",
        "install it with its default features (`--features rerun`); `-o crash.svg` writes a \
         picture that any browser plays, and `brakecheck replay` and `brakecheck report RUN` say \
         in words and pictures what happened",
    )
}
