//! `brakecheck new`: a small world to change, or a test protocol as worlds.

use std::io;
use std::path::{Path, PathBuf};

use brakecheck_traffic::is_commonroad;
use clap::Args;
use serde_json::json;

use super::common::print_json;
use super::failure::Note;
use super::failure::{Exit, Failure};
use super::headings::{ADOS, EGO, INPUT, OUTPUT};
use super::input;
use super::new_commonroad;
use super::new_from_log::{self, FromLogArgs};
use super::new_world;
use super::terminal::{self, Common};
use crate::commonroad::CommonRoadImport;
use crate::openx::import::{
    DroppedElements, EgoEvent, Files, Import, ImportError, Imported, ImportedWorld,
};
use crate::ron_file::{ScenarioError, file_text};
use crate::run_dir::{counted, write_file};
use crate::world::Scenario;

/// Help of a problem without one of its own.
const LIST: &str = "what is read is in docs/reference/protocols.md";

#[derive(Args, Debug)]
pub(super) struct NewArgs {
    /// Name of the world, written to NAME.ron. With --from it may contain a
    /// directory, and points with other roads or bodies go to NAME_2.ron, as do
    /// situations of --from-log with other bodies.
    name: String,
    /// OpenSCENARIO or CommonRoad file to import as a world (- is stdin).
    #[arg(long, value_name = "FILE.xosc|FILE.xml")]
    from: Option<PathBuf>,
    /// Its variation file [default: none, a single point].
    #[arg(long, value_name = "FILE.xosc", requires = "from", help_heading = INPUT)]
    points: Option<PathBuf>,
    /// Only this point of the variation file, from 0.
    #[arg(long, value_name = "N", requires = "points", help_heading = INPUT)]
    point: Option<usize>,
    /// Leave out points that break a constraint of the file or put the ego on a
    /// lane that leads off the road, and say how many.
    #[arg(long, requires = "from", help_heading = INPUT)]
    skip_broken: bool,
    /// Agent of the file that is the ego [default: Ego], or planning problem of
    /// CommonRoad [default: the only one].
    #[arg(long, value_name = "NAME", requires = "from", help_heading = EGO)]
    ego: Option<String>,
    /// Leave the motion that the file gives the ego to your controller, and list
    /// its events.
    #[arg(long, requires = "from", help_heading = EGO)]
    leave_ego: bool,
    /// With --from, road file of a map that the scenario gives by name. With
    /// --from-log, road file in the frame of the recording, for lanes that are not fitted.
    #[arg(long, value_name = "NAME=FILE.xodr|FILE.xodr|FILE.osm", help_heading = INPUT)]
    road: Vec<String>,
    /// Agent or obstacle of the file that is an ado and may stray from its plan.
    #[arg(long, value_name = "NAME", requires = "from", help_heading = ADOS)]
    ado: Option<String>,
    #[command(flatten)]
    log: FromLogArgs,
    /// Print one JSON object on stdout instead of messages.
    #[arg(long, help_heading = OUTPUT)]
    pub(super) json: bool,
}

impl NewArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &NewArgs) -> Result<Exit, Failure> {
    if let Some(folder) = args.log.idle_output() {
        let name = folder.join(&args.name);
        return Err(Failure::input(
            "--output without --from-log",
            format!("write the directory into the name: {}", name.display()),
        ));
    }
    if let Some(from) = &args.from {
        return import_or_commonroad(args, from);
    }
    if args.log.is_requested() {
        let road = road_of_recordings(&args.road)?;
        return new_from_log::run(&args.log, &args.name, road, args.json);
    }
    if !args.road.is_empty() {
        return Err(Failure::input(
            "--road without a file to import",
            "name the file with --from or --from-log",
        ));
    }
    // Users also type the name of the file instead of that of the world.
    let name = args.name.strip_suffix(".ron").unwrap_or(&args.name);
    let file = format!("{name}.ron");
    let text = new_world::text_named(name)?;
    let path = PathBuf::from(&file);
    // A world that a user has written must never be replaced by a template.
    new_world::refuse_taken(&path)?;
    write_file(&path, text.as_bytes())?;
    if args.json {
        print_json(&json!({ "file": file }))
    } else {
        terminal::data(&format!(
            "wrote {file}; next: brakecheck check {file}, then brakecheck search {file} --starts 20"
        ))
    }?;
    Ok(Exit::Done)
}

/// Imports a file of either format.
fn import_or_commonroad(args: &NewArgs, from: &Path) -> Result<Exit, Failure> {
    // Standard input can be read once only.
    let stdin = input::is_stdin(from).then(|| input::text(from));
    let files = |path: &Path| match &stdin {
        Some(Ok(text)) if path == from => Ok(text.clone()),
        // An `io::Error` cannot be cloned, and the file may be read more than once.
        Some(Err(error)) if path == from => Err(io::Error::new(error.kind(), error.to_string())),
        _ => file_text(path),
    };
    // Editors write both formats with either ending, so the content decides.
    match files(from) {
        Ok(text) if is_commonroad(text.as_bytes()) => commonroad(args, from, &files),
        // A file that cannot be read ends there, too, as an error with its path.
        _ => import(args, from, &files),
    }
}

/// Returns the road file of recordings, of which there is at most one.
fn road_of_recordings(roads: &[String]) -> Result<Option<&Path>, Failure> {
    match roads {
        [] => Ok(None),
        [road] => Ok(Some(Path::new(road))),
        _ => Err(Failure::input(
            "several road files for one frame",
            "name one, and read recordings in other frames by a command of their own",
        )),
    }
}

/// Parses `NAME=FILE`.
fn named_road(text: &String) -> Result<(String, PathBuf), Failure> {
    let pair = text.split_once('=');
    let (name, file) = pair.ok_or_else(|| {
        Failure::input(
            format!("`{text}` names no road file of a map"),
            "write --road NAME=FILE.xodr",
        )
    })?;
    Ok((name.to_owned(), PathBuf::from(file)))
}

/// Writes the world of a CommonRoad scenario.
fn commonroad(args: &NewArgs, from: &Path, files: Files<'_>) -> Result<Exit, Failure> {
    let without = [
        ("--points", args.points.is_some()),
        ("--skip-broken", args.skip_broken),
        ("--leave-ego", args.leave_ego),
        ("--road", !args.road.is_empty()),
    ];
    // Options without effect would be taken for done.
    let given: Vec<&str> = without.iter().filter(|it| it.1).map(|it| it.0).collect();
    if !given.is_empty() {
        return Err(Failure::input(
            format!(
                "`{}` is a CommonRoad scenario, without {}",
                from.display(),
                given.join(", ")
            ),
            "leave them out: the file has its road and one start per planning problem",
        ));
    }
    let named = Path::new(args.name.strip_suffix(".ron").unwrap_or(&args.name));
    let stem = named.file_name().unwrap_or_default().to_string_lossy();
    // The name is checked before the file is read, which may take long.
    new_world::text_named(&stem)?;
    let request = CommonRoadImport {
        scenario: from,
        name: &stem,
        ego: args.ego.as_deref(),
        ado: args.ado.as_deref(),
    };
    new_commonroad::run(&request, named, files, args.json)
}

/// Writes the worlds of a protocol, or none if a file cannot be written.
fn import(args: &NewArgs, from: &Path, read: Files<'_>) -> Result<Exit, Failure> {
    let named = Path::new(args.name.strip_suffix(".ron").unwrap_or(&args.name));
    // World names are single words, and the directory is that of the files.
    let stem = named.file_name().unwrap_or_default().to_string_lossy();
    new_world::text_named(&stem)?;
    let maps: Vec<_> = args.road.iter().map(named_road).collect::<Result<_, _>>()?;
    let import = Import {
        scenario: from,
        points: args.points.as_deref(),
        only: args.point,
        skips_broken: args.skip_broken,
        name: &stem,
        ado: args.ado.as_deref(),
        ego: args.ego.as_deref(),
        leaves_ego: args.leave_ego,
        maps: &maps,
    };
    let imported = import.read(read)?;
    let files = checked_files(from, named, &imported.worlds)?;
    // All checks are done, so the files of a protocol appear together.
    for (path, world) in files.iter().zip(&imported.worlds) {
        write_file(path, world.text.as_bytes())?;
    }
    if args.json {
        print_json(&import_json(&files, &imported))?;
    } else {
        print_import(&files, &imported)?;
    }
    Ok(Exit::Done)
}

/// Returns the file of each world, none of which exists, for worlds that are all sound.
fn checked_files(
    from: &Path,
    named: &Path,
    worlds: &[ImportedWorld],
) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    let mut refused = Vec::new();
    for world in worlds {
        // The directory is the typed one, and every world has a file name of its own.
        let path = named.with_file_name(format!("{}.ron", world.name));
        let file = path.display().to_string();
        new_world::refuse_taken(&path)?;
        // A text that brakecheck would refuse must not reach the disk.
        if let Err(error) = Scenario::parse(&file, &world.text) {
            refused.extend(refused_world(from, world, &error));
        }
        files.push(path);
    }
    if !refused.is_empty() {
        return Err(Failure::of(Exit::Input, refused));
    }
    Ok(files)
}

fn import_json(files: &[PathBuf], imported: &Imported) -> serde_json::Value {
    let dropped = imported.dropped.iter().map(|it| {
        let file = it.file.display().to_string();
        json!({ "kind": it.kind, "file": file, "line": it.line, "count": it.count })
    });
    let ego_events = imported.ego_events.iter().map(
        |it| json!({ "name": it.name, "file": it.file.display().to_string(), "line": it.line }),
    );
    let written = files
        .iter()
        .zip(&imported.worlds)
        .map(|(path, world)| json!({ "file": path.display().to_string(), "points": world.points }));
    json!({
        "worlds": written.collect::<Vec<_>>(),
        "broken": imported.broken,
        "dropped": dropped.collect::<Vec<_>>(),
        "ego_events": ego_events.collect::<Vec<_>>(),
    })
}

/// Prints what an import wrote, left out and left to the ego, and the next command.
fn print_import(files: &[PathBuf], imported: &Imported) -> Result<(), Failure> {
    for it in &imported.dropped {
        terminal::note(&dropped_line(it));
    }
    for EgoEvent { name, file, line } in &imported.ego_events {
        let file = file.display();
        terminal::note(&format!(
            "left to your ego: event `{name}`, {file}, line {line}"
        ));
    }
    let written = files.iter().zip(&imported.worlds);
    let mut lines: Vec<String> = written
        .map(|(path, world)| {
            let points = counted(world.points.len(), "point");
            format!("wrote {}: {points}", path.display())
        })
        .collect();
    if imported.broken > 0 {
        lines.push(format!(
            "left out {} that the file itself does not allow",
            counted(imported.broken, "point")
        ));
    }
    // One command is enough, because the other files are used alike.
    if let Some(path) = files.first() {
        lines.push(format!(
            "next: `brakecheck eval {} -- python3 ego.py` lets your program drive at every \
             point, `--ego FILE.ron` a `Change`",
            path.display()
        ));
    }
    terminal::data(&lines.join("\n"))
}

/// Problems of a scenario whose world is refused, by the elements that lead to them.
fn refused_world(from: &Path, world: &ImportedWorld, error: &ScenarioError) -> Vec<Note> {
    new_world::refused(error, |offset, what| match world.refused(offset, what) {
        Some(error) => error.headline(),
        None => format!("`{}`: {what}", from.display()),
    })
}

/// Elements of a kind that have no effect, and where the first of them is.
fn dropped_line(dropped: &DroppedElements) -> String {
    let DroppedElements {
        kind,
        file,
        line,
        count,
    } = dropped;
    let file = file.display();
    format!("dropped: {kind}, {count} in all, the first in {file}, line {line}")
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Failure {
        let mut notes: Vec<Note> = error
            .all()
            .take(new_world::MOST_NOTES)
            .map(|error| {
                let help = error.help.as_deref().unwrap_or(LIST);
                Note::new(&error.headline(), Some(help))
            })
            .collect();
        let further = error.all().count() - notes.len();
        if further > 0 {
            let what = counted(further, "further problem");
            notes.push(Note::new(&what, Some("mend those above first")));
        }
        // A reader that stopped early knows only a part of the problems.
        if let Some(part) = error.unread_part() {
            let what = format!("not read so far: {part}");
            notes.push(Note::new(
                &what,
                Some("mend the above first: this may have problems, too"),
            ));
        }
        Failure::of(Exit::Input, notes)
    }
}
