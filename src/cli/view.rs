//! `brakecheck view`: an episode as a recording for the rerun viewer.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::{Common, Exit, Failure, print_json, talk};
use crate::campaign::{Regressions, Replayed};

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
    /// The recording to write [default: the episode's name with .rrd].
    #[arg(short, long, value_name = "OUT.rrd")]
    output: Option<PathBuf>,
    /// Print one JSON object on stdout instead of talking.
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

pub(super) fn run(args: &ViewArgs) -> Result<Exit, Failure> {
    if !cfg!(feature = "rerun") {
        return Err(without_viewer());
    }
    let single = args.what.is_file();
    let episode = (!single).then_some(args.episode.as_str());
    let regressions = Regressions::find(&args.what, episode)?.allow_programs(args.allow_programs);
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
    let name = replayed.path.with_extension("rrd");
    let name = name.file_name().map(PathBuf::from).unwrap_or(name);
    let output = args.output.clone().unwrap_or(name);
    if let Some(fault) = replayed.fault() {
        let message = format!("there is nothing to see: {fault}");
        return Err(Failure::fault(message, None));
    }
    let (file, bytes, samples) = record(replayed, &output)?;
    match args.json {
        true => print_json(&json!({ "file": file, "bytes": bytes, "samples": samples })),
        false => talk::data(&format!(
            "{file}: {samples} samples, {} kB; open it with `rerun {file}`",
            bytes.div_ceil(1000)
        )),
    }?;
    Ok(Exit::Done)
}

/// Writes the recording; its name, bytes and samples.
#[cfg(feature = "rerun")]
fn record(replayed: &Replayed, output: &std::path::Path) -> Result<(String, u64, usize), Failure> {
    let caption = replayed.path.display().to_string();
    let recorded = crate::view::record(&replayed.scenario, &replayed.episode, &caption, output)
        .map_err(|error| Failure::fault(error.to_string(), Some(error.help().to_owned())))?;
    let file = recorded.path.display().to_string();
    Ok((file, recorded.bytes, recorded.samples))
}

#[cfg(not(feature = "rerun"))]
fn record(_: &Replayed, _: &std::path::Path) -> Result<(String, u64, usize), Failure> {
    Err(without_viewer())
}

/// Why there is no recording, and what there is instead.
fn without_viewer() -> Failure {
    Failure::input(
        "this brakecheck was built without the viewer's recordings",
        "install it with its default features (`--features rerun`); `brakecheck replay` and \
         `brakecheck report RUN` say in words and pictures what happened",
    )
}
