//! `brakecheck new NAME --from-log RECORDING`: recorded situations as worlds.

use std::path::{Path, PathBuf};

use brakecheck_traffic::{
    Analysis, RecordedPlace, RecordedWorld, RecordedWorlds, SituationKind, SituationPlan,
    SituationRoad,
};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::common::print_json;
use super::failure::{Exit, Failure};
use super::headings::{ADOS, INPUT};
use super::new_world;
use super::terminal;
use super::{log, log_reading};
use crate::recorded_world;
use crate::run_dir::{counted, make_dir, write_file};
use crate::world::Scenario;

/// Options of worlds from recordings.
#[derive(Args, Debug)]
pub(super) struct FromLogArgs {
    /// Recording whose situations become starts of worlds (repeatable).
    #[arg(
        long,
        value_name = "FILE.csv",
        requires = "kind",
        conflicts_with = "from"
    )]
    from_log: Vec<PathBuf>,
    /// Time column of the recordings, with its unit [default: that of the map].
    #[arg(long, value_name = "COLUMN", requires = "from_log", help_heading = INPUT)]
    time: Option<String>,
    /// Column map of the recordings, as in `brakecheck log`.
    #[arg(long, value_name = "NAME|FILE.ron", requires = "from_log", help_heading = INPUT)]
    map: Option<String>,
    /// Situations to write. Your ego replaces one of the recorded road users.
    #[arg(long, value_enum, requires = "from_log")]
    kind: Option<KindArg>,
    /// Number of situations, the hardest first [default: 24].
    #[arg(long, value_name = "N", requires = "from_log", value_parser = clap::value_parser!(u16).range(1..=10_000))]
    count: Option<u16>,
    /// Nearest other road users as scripted traffic [default: 0]. A situation then has a
    /// world of its own.
    #[arg(long, value_name = "N", requires = "from_log", value_parser = clap::value_parser!(u8).range(0..=90), help_heading = ADOS)]
    others: Option<u8>,
    /// Directory of the worlds [default: the working directory].
    // Without recordings it is refused in `new::run`, since clap would ask for a recording.
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum KindArg {
    /// The ego replaces the follower, and the lead may stray from its recording.
    Following,
    /// The ego replaces the follower of a lane change in front of it.
    CutIn,
    /// The ego replaces a vehicle whose path another road user crosses.
    Crossing,
}

impl KindArg {
    fn situations(self) -> SituationKind {
        match self {
            KindArg::Following => SituationKind::Following,
            KindArg::CutIn => SituationKind::CutIn,
            KindArg::Crossing => SituationKind::Crossing,
        }
    }
}

impl FromLogArgs {
    pub(super) fn is_requested(&self) -> bool {
        !self.from_log.is_empty()
    }

    /// Returns the directory that is named without recordings.
    pub(super) fn idle_output(&self) -> Option<&Path> {
        self.output.as_deref().filter(|_| !self.is_requested())
    }
}

/// Writes the worlds of the recordings, or none if a file is there already.
///
/// `road` is the road file of their lanes, which are fitted without it.
pub(super) fn run(
    args: &FromLogArgs,
    name: &str,
    road: Option<&Path>,
    prints_json: bool,
) -> Result<Exit, Failure> {
    // clap requires the kind beside a recording, so this default is never taken.
    let kind = args.kind.unwrap_or(KindArg::Following).situations();
    let name = name.strip_suffix(".ron").unwrap_or(name);
    // A wrong name is refused before recordings are read, which may take long.
    new_world::text_named(name)?;
    let columns = log::GivenColumns {
        map: args.map.as_deref(),
        time: args.time.as_deref(),
    };
    let recordings = log::read_all(&args.from_log, columns, road)?;
    for (analysis, map) in &recordings {
        log_reading::note(analysis, map);
    }
    let analyses: Vec<Analysis> = recordings.into_iter().map(|it| it.0).collect();
    let most = usize::from(args.count.unwrap_or(24));
    let others = usize::from(args.others.unwrap_or(0));
    let recorded = RecordedWorlds::with_others(name, kind, &analyses, most, others);
    if recorded.worlds.is_empty() {
        return Err(nothing(args, kind, &recorded));
    }
    let files = written(args, &recorded)?;
    if prints_json {
        return print_worlds(&recorded, &files);
    }
    show(&recorded, &files)?;
    Ok(Exit::Done)
}

/// Writes the worlds into the directory of the arguments, or here.
fn written(args: &FromLogArgs, recorded: &RecordedWorlds) -> Result<Vec<NewFile>, Failure> {
    // An empty folder leaves a joined path as it is.
    let folder = args.output.as_deref().unwrap_or(Path::new(""));
    let files = files_of(recorded, folder)?;
    // The directory is made after all checks, so a refusal leaves nothing behind.
    if args.output.is_some() {
        make_dir(folder)?;
    }
    for file in &files {
        write_file(&file.path, file.text.as_bytes())?;
    }
    Ok(files)
}

/// File of a world.
struct NewFile {
    path: PathBuf,
    text: String,
}

impl NewFile {
    fn name(&self) -> String {
        self.path.display().to_string()
    }
}

/// Returns the file of each world, all of them free and each world sound.
fn files_of(recorded: &RecordedWorlds, folder: &Path) -> Result<Vec<NewFile>, Failure> {
    let mut files = Vec::new();
    // All refused worlds are collected, so that one run shows every reason.
    let mut refused = Vec::new();
    for world in &recorded.worlds {
        let path = folder.join(format!("{}.ron", world.name));
        let file = path.display().to_string();
        new_world::refuse_taken(&path)?;
        let written = recorded_world::world_of(world).text();
        // Values of worlds can always be written, so an error is one of the program.
        let text = written.map_err(|error| Failure::fault(format!("`{file}`: {error}"), None))?;
        // A text that brakecheck would refuse must not reach the disk.
        if let Err(error) = Scenario::parse(&file, &text) {
            let situation = place_of(world);
            let place = |_, what: &str| format!("{situation}: {what}");
            refused.extend(new_world::refused(&error, place));
        }
        files.push(NewFile { path, text });
    }
    if refused.is_empty() {
        Ok(files)
    } else {
        Err(Failure::of(Exit::Input, refused))
    }
}

/// Place of the first situation of a world in its recording.
fn place_of(world: &RecordedWorld) -> String {
    match world.situations.first() {
        Some(first) => format!(
            "`{}`, {:.2} s after its first sample, `{}` as the ego and `{}` beside it",
            first.source, first.time_s, first.replaced, first.planned
        ),
        None => format!("`{}`", world.name),
    }
}

fn nothing(args: &FromLogArgs, kind: SituationKind, recorded: &RecordedWorlds) -> Failure {
    let what = match kind {
        SituationKind::Following => "following of 10 s",
        SituationKind::CutIn => "cut-in that is recorded from 2 s before it to 8 s after it",
        SituationKind::Crossing => "crossing that is recorded from 2 s before it to 1 s after it",
    };
    let files: Vec<String> = args
        .from_log
        .iter()
        .map(|it| it.display().to_string())
        .collect();
    Failure::input(
        format!(
            "no {what} in `{}`: {} found, {} left out",
            files.join("`, `"),
            recorded.found,
            recorded.left_out
        ),
        format!("`brakecheck log {}` lists its situations", files.join(" ")),
    )
}

fn show(recorded: &RecordedWorlds, files: &[NewFile]) -> Result<(), Failure> {
    let worlds = recorded.worlds.iter().zip(files);
    let mut lines: Vec<String> = worlds
        .map(|(world, file)| format!("wrote {}: {}", file.name(), in_words(world)))
        .collect();
    // All of these numbers are 0 or more, so 0 is the neutral start.
    let most =
        |number: fn(&SituationPlan) -> f64| recorded.situations().map(number).fold(0.0, f64::max);
    lines.push(format!(
        "{} of {} situations, {} harder ones left out; plans are within {:.3} m of the recording, \
         at most {:.1} m/s²",
        recorded.situations().count(),
        recorded.found,
        recorded.left_out,
        most(|it| it.speed.worst_m),
        most(|it| it.speed.hardest_mps2()),
    ));
    if let Some(file) = files.first() {
        lines.push(format!(
            "next: brakecheck search {}, with `--ego FILE.ron` for your ego",
            file.name()
        ));
    }
    terminal::data(&lines.join("\n"))
}

/// Number of situations, and the body, place and side that they share.
fn in_words(world: &RecordedWorld) -> String {
    let count = counted(world.situations.len(), "situation");
    let Some(first) = world.situations.first() else {
        return count;
    };
    // A situation with others has a world of its own, so the first is the only one.
    let others = match first.others.len() {
        0 => String::new(),
        others => format!(", {}", counted(others, "other")),
    };
    // A crossing has no common lane, so it has neither a side nor a place.
    if let SituationRoad::Crossing(roads) = &first.road {
        let (pet_s, angle_deg) = (roads.pet_s, roads.angle_rad.to_degrees());
        let body = first.body.name;
        return format!("{body} crosses at {angle_deg:.0}°, PET {pet_s:.2} s{others}");
    }
    let side = match first.across.map(|_| first.is_from_left()) {
        None => "",
        Some(true) => " from the left",
        Some(false) => " from the right",
    };
    let place = match first.place() {
        RecordedPlace::Ahead => "ahead",
        RecordedPlace::Beside => "beside the ego",
        RecordedPlace::Behind => "behind the ego",
    };
    let bend = match world.road_m {
        // A straight road is exact, so there is no distance to state.
        0.0 => String::new(),
        road_m => format!(", road within {road_m:.2} m of the lane"),
    };
    format!(
        "{count}, {}{side}, {place} at the start{bend}{others}",
        first.body.name
    )
}

fn pet_s(situation: &SituationPlan) -> Option<f64> {
    match &situation.road {
        SituationRoad::Crossing(roads) => Some(roads.pet_s),
        _ => None,
    }
}

fn print_worlds(recorded: &RecordedWorlds, files: &[NewFile]) -> Result<Exit, Failure> {
    let each = recorded.worlds.iter().zip(files).map(|(world, file)| {
        let situations = world.situations.iter().map(|it| {
            json!({
                "recording": it.source, "time_s": it.time_s,
                "replaced": it.replaced, "planned": it.planned,
                "worst_m": it.speed.worst_m, "hardest_mps2": it.speed.hardest_mps2(),
                "worst_lateral_m": it.across.map(|it| it.worst_m),
                "pet_s": pet_s(it),
                "others": it.others.iter().map(|it| &it.id).collect::<Vec<_>>(),
            })
        });
        json!({ "file": file.name(), "situations": situations.collect::<Vec<_>>() })
    });
    let worlds: Vec<_> = each.collect();
    print_json(&json!({
        "worlds": worlds, "found": recorded.found, "left_out": recorded.left_out,
    }))?;
    Ok(Exit::Done)
}
