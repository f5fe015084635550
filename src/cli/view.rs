//! `brakecheck view`: an episode as a recording or a self-playing picture.

use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::PossibleValuesParser;
use serde_json::json;
use strum::VariantArray;

use super::common::{open_run, print_json, refuse_program};
use super::failure::{Exit, Failure};
use super::headings::{OUTPUT, RUNNING};
use super::input;
use super::kept_input;
#[cfg(feature = "rerun")]
use super::live::Streamed;
use super::live::{self, RerunArgs};
use super::output_path::new_file;
use super::terminal::{self, Common};
use crate::crashes::{PictureFormat, Regressions, Replayed, ViewKind};
use crate::crashes::{newest_of_training, picture_as};
use crate::ego::reference::ReferenceDriver;
#[cfg(feature = "rerun")]
use crate::experiment::ShownEpisode;
use crate::experiment::{EgoUnderTest, consent_to};
use crate::run_dir::{RunDir, counted, write_output};
#[cfg(feature = "rerun")]
use crate::view::ViewError;

#[derive(Args, Debug)]
pub(super) struct ViewArgs {
    /// A kept counterexample (- is stdin), a directory of them, or a run directory.
    #[arg(value_name = "FILE|DIR|RUN")]
    what: PathBuf,
    /// Number (from 0) or file name of a counterexample [default: 0, or all with
    /// `--rerun`].
    episode: Option<String>,
    /// Replay against this ego first: a name under `reuse`, or a RON file.
    #[arg(long, value_name = "NAME|FILE.ron")]
    ego: Option<String>,
    /// The recording to write, or a picture from above: .svg plays in any browser,
    /// .gif everywhere, .png is a still [default: the episode's name with .rrd].
    #[arg(
        short,
        long,
        value_name = "OUT.rrd|svg|gif|png",
        value_parser = new_file(),
        conflicts_with = "rerun"
    )]
    output: Option<PathBuf>,
    #[command(flatten)]
    live: RerunArgs,
    /// Show beside it this reference driver in the ego's place
    /// (docs/background/preventability.md).
    #[arg(long, value_name = "DRIVER", value_parser = drivers())]
    beside: Option<String>,
    /// Print one JSON object on stdout instead of messages.
    #[arg(long, help_heading = OUTPUT)]
    json: bool,
    /// Start the programs that the kept file or `--ego` names as egos.
    #[arg(long, help_heading = RUNNING)]
    allow_programs: bool,
    /// Taken only to be refused with the fix.
    #[arg(last = true, hide = true)]
    program: Vec<String>,
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
    refuse_program("view", &args.program)?;
    let kind = args.output.as_deref().map(ViewKind::of).transpose()?;
    let format = kind.and_then(ViewKind::format);
    if args.beside.is_some() && format.is_none() {
        return Err(Failure::input(
            "`--beside` is for pictures",
            "name one to write: `-o crash.svg`",
        ));
    }
    // Refused before any replay, which could start a program.
    if format.is_none() && !cfg!(feature = "rerun") {
        return Err(live::without_viewer());
    }
    args.live.admit(args.json)?;
    let (replayed, ego) = replayed(args)?;
    let Some(first) = replayed.first() else {
        return Err(Failure::input(
            format!("`{}` holds no kept counterexample", args.what.display()),
            "name one, or a directory of them",
        ));
    };
    // A run that failed to start has no motion, and an empty picture would hide the
    // reason.
    if let Some(fault) = first.fault() {
        let message = format!("there is nothing to see: {fault}");
        return Err(Failure::fault(message, None));
    }
    match args.output.as_deref().zip(format) {
        // Output and stream exclude each other, so the order of the arms decides nothing.
        _ if args.live.is_given() => stream(args, &replayed),
        Some((output, format)) => draw(args, first, &ego, output, format),
        None => recording(args, first),
    }?;
    Ok(Exit::Done)
}

/// Newest counterexamples of a running training that a stream shows without `--rerun-all`.
const NEWEST: usize = 20;

/// Plays the requested counterexamples again, and returns them with the name of the ego.
fn replayed(args: &ViewArgs) -> Result<(Vec<Replayed>, String), Failure> {
    // A recording or a picture has one episode, and a stream has room for all.
    let all = args.live.is_given() && args.episode.is_none();
    // An unfinished training has no kept files yet, but stores its counterexamples.
    if args.ego.is_none() && args.what.join("manifest.json").is_file() {
        let run = open_run(&args.what, &args.common())?;
        if !run.manifest().is_finished() {
            return of_training(args, &run, all);
        }
    }
    let single = args.what.is_file() || input::is_stdin(&args.what);
    // A file has a single counterexample, so the default number 0 must not select.
    let usual = (!single && !all).then_some("0");
    let episode = args.episode.as_deref().or(usual);
    let regressions = kept_input::find(&args.what, episode)?.allow_programs(args.allow_programs);
    let ego = ego(args, &regressions);
    let replayed = match args.ego.as_deref() {
        Some(ego) => regressions.against(Some(ego), &[])?.replay()?,
        None => regressions.replay_recorded()?,
    };
    Ok((replayed, ego))
}

/// Plays counterexamples of a training that has not finished. Number 0 is the newest.
fn of_training(
    args: &ViewArgs,
    run: &RunDir,
    all: bool,
) -> Result<(Vec<Replayed>, String), Failure> {
    // A replay may start the program of the ego.
    consent_to(&[EgoUnderTest::nominal(&run.scenario()?)])?;
    let name = args.what.display();
    let tested = run.manifest().ego.as_ref();
    let ego = tested.map_or("nominal", |ego| ego.name.as_str());
    let number = args.episode.as_deref().unwrap_or("0");
    let Some(number) = number.parse::<usize>().ok() else {
        return Err(Failure::input(
            format!("`{number}` is no number of a counterexample"),
            "a training that has not finished numbers them from 0, the newest",
        ));
    };
    let (skipped, most) = match (all, args.live.is_complete()) {
        (true, true) => (0, usize::MAX),
        (true, false) => (0, NEWEST),
        // Number 0 is the newest, so the number is that of newer ones to skip.
        (false, _) => (number, 1),
    };
    let newest = newest_of_training(run, skipped, most)?;
    if newest.is_empty() {
        return Err(Failure::input(
            format!("the training in `{name}` has no counterexample {number} so far"),
            "number 0 is its newest; try again after its next checkpoint",
        ));
    }
    Ok((newest, ego.to_owned()))
}

/// Writes all counterexamples as one recording.
#[cfg(feature = "rerun")]
fn stream(args: &ViewArgs, replayed: &[Replayed]) -> Result<(), Failure> {
    let name = args.what.display().to_string();
    let Some(mut stream) = args.live.stream(&name, Streamed::Episodes)? else {
        return Ok(());
    };
    let streamed = replayed.iter().try_for_each(|replayed| {
        stream.episode(&ShownEpisode {
            scenario: &replayed.scenario,
            episode: &replayed.episode,
            caption: &caption(replayed),
            decisions: None,
        })
    });
    match streamed.and_then(|()| stream.finish()) {
        // A closed viewer is the user's choice.
        Err(ViewError::Closed) => terminal::note("the viewer was closed"),
        ended => ended.map_err(live::failure)?,
    }
    if args.json {
        return print_json(&json!({ "episodes": replayed.len() }));
    }
    let episodes = counted(replayed.len(), "episode");
    terminal::note(&format!("streamed {episodes}"));
    Ok(())
}

#[cfg(not(feature = "rerun"))]
fn stream(_: &ViewArgs, _: &[Replayed]) -> Result<(), Failure> {
    Err(live::without_viewer())
}

/// Returns the name of the ego: the requested ego, or that of the file.
fn ego(args: &ViewArgs, regressions: &Regressions) -> String {
    let recorded = regressions
        .kept()
        .first()
        .map(|kept| kept.counterexample.ego.clone());
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
    replayed: &Replayed,
    ego: &str,
    output: &Path,
    format: PictureFormat,
) -> Result<(), Failure> {
    let mut drivers = ReferenceDriver::VARIANTS.iter().copied();
    // The parser allows these names only, so each given one is found.
    let beside = drivers.find(|it| Some(it.name()) == args.beside.as_deref());
    let bytes = picture_as(format, replayed, ego, beside)?;
    write_output(output, &bytes)?;
    let file = output.display().to_string();
    if args.json {
        return print_json(&json!({ "file": file, "bytes": bytes.len() }));
    }
    let use_of_it = match format {
        PictureFormat::Svg => "any browser plays it",
        #[cfg(feature = "raster")]
        PictureFormat::Png => "a still of its decisive moment",
        #[cfg(feature = "raster")]
        PictureFormat::Gif => "it plays in a loop",
    };
    let size_kb = bytes.len().div_ceil(1000);
    terminal::data(&format!("{file}: {size_kb} kB; {use_of_it}"))
}

/// Writes the recording and prints its path.
fn recording(args: &ViewArgs, replayed: &Replayed) -> Result<(), Failure> {
    let beside = replayed.path.with_extension("rrd");
    // The current directory is the default, so that kept directories stay as they are.
    let here = beside.file_name().map(PathBuf::from).unwrap_or(beside);
    let output = args.output.clone().unwrap_or(here);
    let (file, bytes, samples) = record(replayed, &output)?;
    if args.json {
        print_json(&json!({ "file": file, "bytes": bytes, "samples": samples }))
    } else {
        terminal::data(&format!(
            "{file}: {}, {} kB; open it with `rerun {file}`",
            counted(samples, "sample"),
            bytes.div_ceil(1000)
        ))
    }
}

/// Returns the file of an episode, and its difference from the recorded run.
#[cfg(feature = "rerun")]
fn caption(replayed: &Replayed) -> String {
    let file = replayed.path.display().to_string();
    match replayed.departure() {
        Some(departure) => format!("{file}: {departure}"),
        None => file,
    }
}

/// Writes the recording, and returns its name, bytes and samples.
#[cfg(feature = "rerun")]
fn record(replayed: &Replayed, output: &Path) -> Result<(String, u64, usize), Failure> {
    let caption = caption(replayed);
    let recorded = crate::view::record(&replayed.scenario, &replayed.episode, &caption, output)
        .map_err(live::failure)?;
    let file = recorded.path.display().to_string();
    Ok((file, recorded.bytes, recorded.samples))
}

#[cfg(not(feature = "rerun"))]
fn record(_: &Replayed, _: &Path) -> Result<(String, u64, usize), Failure> {
    Err(live::without_viewer())
}
