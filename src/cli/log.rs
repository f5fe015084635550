//! `brakecheck log`: recorded traffic, its situations and models of it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::path::{Path, PathBuf};

use brakecheck_traffic::{
    Analysis, Class, ColumnMap, MappedCarriageway, ModelError, ReadError, SourceFile, TrafficModel,
    TrafficRecording, read_csv, read_csv_guessed, read_mcap, read_osi, read_xosc,
};
use clap::Args;
use serde_json::{Value, json};

use super::{Common, Exit, Failure, print_json, table_of, terminal};
use crate::openx::import::driven_lanes;
use crate::ron_file::file_text;
use crate::run_dir::write_file;

#[derive(Args, Debug)]
pub(super) struct LogArgs {
    /// Recordings: FILE.csv, FILE.xosc, FILE.osi or FILE.mcap.
    ///
    /// CSV has a row per road user and instant. OpenSCENARIO has polylines that its
    /// entities follow. OSI traces hold osi3.GroundTruth or osi3.SensorView. Any other
    /// ending is read as CSV.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Column map: dlr, highd, ind, ngsim, generic or a RON file [default: by header].
    ///
    /// A RON file states the columns with their units and the reference point:
    /// ColumnMap(time: Seconds("t"), id: "car", x: "x", y: "y",
    /// velocity: Magnitude("v"), size: Fixed(length_m: 4.5, width_m: 1.8)).
    /// Times are Seconds, Milliseconds, Iso or Frames, references are Centre, Corner
    /// or Front, and length_unit is Metres or Feet. The shipped maps are examples, in
    /// crates/traffic/maps of the source.
    #[arg(long, value_name = "NAME|FILE.ron")]
    map: Option<String>,
    /// Take the lanes from an OpenDRIVE file in the frame of the recording, unfitted.
    #[arg(long, value_name = "FILE.xodr")]
    road: Option<PathBuf>,
    /// Fit a naturalness model, print its calibration and write it.
    #[arg(long, value_name = "FILE.ron")]
    fit: Option<PathBuf>,
    /// Print one JSON object on stdout instead of tables.
    #[arg(long)]
    json: bool,
}

impl LogArgs {
    pub(super) fn common(&self) -> Common {
        Common {
            json: self.json,
            ..Common::default()
        }
    }
}

pub(super) fn run(args: &LogArgs) -> Result<Exit, Failure> {
    let recordings = read_all(&args.files, args.map.as_deref(), args.road.as_deref())?;
    if !args.json {
        for (analysis, map) in &recordings {
            show(analysis, map)?;
        }
    }
    let reports = recordings
        .iter()
        .map(|(analysis, map)| report(analysis, map));
    let reports: Vec<Value> = reports.collect();
    let model = match &args.fit {
        Some(path) => {
            let analyses: Vec<Analysis> = recordings.into_iter().map(|it| it.0).collect();
            Some(fit(args, path, &analyses)?)
        }
        None => None,
    };
    if args.json {
        print_json(&json!({ "recordings": reports, "model": model.map(|it| json!(it)) }))?;
    }
    Ok(Exit::Done)
}

/// Reads recordings and finds their lanes and situations, each with its column map.
pub(super) fn read_all(
    files: &[PathBuf],
    map: Option<&str>,
    road: Option<&Path>,
) -> Result<Vec<(Analysis, String)>, Failure> {
    let map = map.map(column_map).transpose()?;
    let road = road.map(lanes_of).transpose()?;
    let analysed = |file: &PathBuf| {
        let (recording, map) = read(file, map.as_ref())?;
        let analysis = match &road {
            Some(road) => on_road(recording, road)?,
            None => Analysis::of(recording),
        };
        Ok((analysis, map))
    };
    files.iter().map(analysed).collect()
}

/// Lanes of a file, with its name.
struct MappedRoad<'a> {
    file: &'a Path,
    carriageways: Vec<MappedCarriageway>,
}

fn lanes_of(file: &Path) -> Result<MappedRoad<'_>, Failure> {
    let lanes = driven_lanes(file, &file_text)?.into_iter();
    let carriageways = lanes.filter_map(|lanes| {
        Some(MappedCarriageway {
            path: brakecheck_traffic::Path::through(lanes.right_lane_m, 0.5)?,
            offsets_m: lanes.offsets_m,
        })
    });
    Ok(MappedRoad {
        file,
        carriageways: carriageways.collect(),
    })
}

fn on_road(recording: TrafficRecording, road: &MappedRoad<'_>) -> Result<Analysis, Failure> {
    let analysis = Analysis::on_map(recording, &road.carriageways);
    if analysis.frame.carriageways.is_empty() {
        return Err(Failure::input(
            format!(
                "no vehicle of `{}` follows a driving lane of `{}`",
                analysis.recording.name,
                road.file.display()
            ),
            "both files must have the same origin and axes; without `--road` the lanes are fitted",
        ));
    }
    Ok(analysis)
}

fn column_map(name: &str) -> Result<(ColumnMap, String), Failure> {
    if let Some(map) = ColumnMap::shipped(name) {
        return Ok((map, name.to_owned()));
    }
    let text = text_of(name, "name dlr, highd, ind, ngsim, generic or a RON file")?;
    let map = ron::from_str(&text).map_err(|error| {
        Failure::input(
            format!("`{name}`: invalid column map at {error}"),
            "see `brakecheck log --help` for its fields",
        )
    })?;
    Ok((map, name.to_owned()))
}

pub(super) fn text_of(name: &str, help: &str) -> Result<String, Failure> {
    file_text(Path::new(name))
        .map_err(|error| Failure::input(format!("cannot read `{name}`: {error}"), help))
}

fn read(
    file: &Path,
    map: Option<&(ColumnMap, String)>,
) -> Result<(TrafficRecording, String), Failure> {
    let (name, rows) = (file.display().to_string(), open(file)?);
    let format = file.extension().and_then(OsStr::to_str).unwrap_or_default();
    let format = format.to_ascii_lowercase();
    let recording = match &*format {
        "xosc" => read_xosc(rows, &name),
        "osi" => read_osi(rows, &name),
        "mcap" => read_mcap(rows, &name),
        _ => return read_rows(rows, &name, map),
    };
    if map.is_some() {
        return Err(Failure::input(
            format!("`{name}` is not CSV, so it has no column map"),
            "leave out --map, or read the CSV files by a command of their own",
        ));
    }
    Ok((recording?, format))
}

fn read_rows(
    rows: File,
    name: &str,
    map: Option<&(ColumnMap, String)>,
) -> Result<(TrafficRecording, String), Failure> {
    Ok(match map {
        Some((map, known)) => (read_csv(rows, name, map)?, known.clone()),
        None => {
            let (recording, known) = read_csv_guessed(rows, name)?;
            (recording, known.to_owned())
        }
    })
}

fn open(file: &Path) -> Result<File, Failure> {
    File::open(file).map_err(|error| {
        Failure::input(
            format!("cannot read `{}`: {error}", file.display()),
            "name a readable file",
        )
    })
}

/// Prints the contents of a recording.
fn show(analysis: &Analysis, map: &str) -> Result<(), Failure> {
    let recording = &analysis.recording;
    terminal::data(&format!(
        "{}, format {map}: {} rows, {} road users, {:.1} s at {:.3} s, {:.1} km",
        recording.name,
        recording.counts.rows,
        recording.road_users(),
        recording.duration_s(),
        recording.dt_s,
        recording.distance_km(),
    ))?;
    if let Some(text) = corrections(recording) {
        terminal::note(&text);
    }
    let lanes = analysis.frame.carriageways.iter().enumerate();
    let lanes = lanes.flat_map(|(i, carriageway)| {
        carriageway.lanes.iter().enumerate().map(move |(k, lane)| {
            [
                format!("{i}"),
                format!("{k}"),
                format!("{:.2}", lane.offset_m),
                format!("{:.1}", 100.0 * lane.share),
                format!("{:.2}", lane.wander_m),
                format!("{}", carriageway.tracks.len()),
            ]
        })
    });
    let header = [
        "carriageway",
        "lane",
        "offset m",
        "rows %",
        "wander m",
        "vehicles",
    ];
    terminal::data(&table_of(header, lanes))?;
    let found = &analysis.situations;
    terminal::data(&format!(
        "{} followings of 10 s or more, {} windows of 10 s, {} lane changes, {} cut-ins within \
         100 m ({} left out: boxes overlap)",
        found.long_followings(recording).count(),
        found.windows(recording).len(),
        found.lane_changes.len(),
        found.cut_ins.len(),
        found.overlapping_cut_ins,
    ))?;
    if analysis.crossings.is_empty() {
        return Ok(());
    }
    show_crossings(analysis)
}

/// Crossing paths of two classes.
struct CrossingRow {
    classes: [&'static str; 2],
    paths: usize,
    /// Those with a post-encroachment time below 5 s.
    close: usize,
    least_pet_s: f64,
    /// Least clearance at one instant.
    least_m: Option<f64>,
}

/// Counts the crossing paths of a recording by the classes of the two road users.
fn crossing_rows(analysis: &Analysis) -> Vec<CrossingRow> {
    let class = |track: usize| analysis.recording.tracks[track].class;
    let mut rows: BTreeMap<[Class; 2], CrossingRow> = BTreeMap::new();
    for crossing in &analysis.crossings {
        let (first, second) = (class(crossing.first), class(crossing.second));
        let classes = [first.min(second), first.max(second)];
        let row = rows.entry(classes).or_insert(CrossingRow {
            classes: classes.map(Class::name),
            paths: 0,
            close: 0,
            least_pet_s: f64::INFINITY,
            least_m: None,
        });
        row.paths += 1;
        row.close += usize::from(crossing.pet_s() < 5.0);
        row.least_pet_s = row.least_pet_s.min(crossing.pet_s());
        let clearances = row.least_m.into_iter().chain(crossing.least_m);
        row.least_m = clearances.min_by(f64::total_cmp);
    }
    rows.into_values().collect()
}

fn show_crossings(analysis: &Analysis) -> Result<(), Failure> {
    let digits = |value: f64| format!("{value:.2}");
    let rows = crossing_rows(analysis).into_iter().map(|it| {
        [
            it.classes.join(", "),
            format!("{}", it.paths),
            format!("{}", it.close),
            digits(it.least_pet_s),
            it.least_m.map_or("–".to_owned(), digits),
        ]
    });
    let header = ["crossing", "paths", "PET < 5 s", "least PET s", "least m"];
    terminal::data(&table_of(header, rows))
}

/// Returns a line on the corrections of a reading, `None` without any.
fn corrections(recording: &TrafficRecording) -> Option<String> {
    let counts = &recording.counts;
    let parts = [
        (counts.marked, "rows interpolated by the recorder"),
        (counts.off_grid, "rows off the time grid, interpolated"),
        (counts.holes_filled, "samples filled in short holes"),
        (counts.holes_split, "tracks split at long holes"),
        (counts.too_short, "tracks of one sample left out"),
        (counts.unknown_class, "rows of an unknown class"),
        (
            counts.assumed_sizes,
            "road users with the size of their class",
        ),
        (
            counts.without_motion,
            "entities without a trajectory left out",
        ),
        (counts.other_messages, "messages of other channels left out"),
    ];
    let parts: Vec<String> = parts
        .iter()
        .filter(|(count, _)| 0 < *count)
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    (!parts.is_empty()).then(|| parts.join(", "))
}

fn report(analysis: &Analysis, map: &str) -> Value {
    let recording = &analysis.recording;
    let lanes = analysis.frame.carriageways.iter().map(|it| {
        let lanes = it.lanes.iter().map(|lane| {
            json!({ "offset_m": lane.offset_m, "share": lane.share, "wander_m": lane.wander_m })
        });
        json!({ "vehicles": it.tracks.len(), "outside": it.outside, "lanes": lanes.collect::<Vec<_>>() })
    });
    let found = &analysis.situations;
    let crossings = crossing_rows(analysis).into_iter().map(|it| {
        json!({
            "classes": it.classes, "paths": it.paths, "pet_below_5_s": it.close,
            "least_pet_s": it.least_pet_s, "least_m": it.least_m,
        })
    });
    json!({
        "file": recording.name,
        "map": map,
        "counts": recording.counts,
        "road_users": recording.road_users(),
        "duration_s": recording.duration_s(),
        "dt_s": recording.dt_s,
        "distance_km": recording.distance_km(),
        "carriageways": lanes.collect::<Vec<_>>(),
        "followings": found.long_followings(recording).count(),
        "windows": found.windows(recording).len(),
        "lane_changes": found.lane_changes.len(),
        "cut_ins": found.cut_ins.len(),
        "crossings": crossings.collect::<Vec<_>>(),
    })
}

fn fit(args: &LogArgs, path: &Path, analyses: &[Analysis]) -> Result<TrafficModel, Failure> {
    let mut sources = Vec::new();
    for file in &args.files {
        let name = file.display().to_string();
        let source = SourceFile::of(&name, open(file)?)
            .map_err(|error| Failure::fault(format!("cannot read `{name}`: {error}"), None))?;
        sources.push(source);
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let model = TrafficModel::fit(&name, sources, analyses)?;
    write_file(path, model.to_ron().as_bytes())?;
    if !args.json {
        terminal::data(&format!("{model}\nwrote {}", path.display()))?;
    }
    Ok(model)
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Failure {
        Failure::input(error.to_string(), error.help())
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Failure {
        Failure::input(error.to_string(), error.help())
    }
}
