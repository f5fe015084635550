//! `brakecheck log`: recorded traffic, its situations and models of it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use brakecheck_traffic::{
    Analysis, ColumnMap, CsvColumns, MappedCarriageway, ModelError, ReadError, RecordingMeta,
    SourceFile, TimeColumn, TrafficModel, TrafficRecording, fit_traffic, read_lanelets, read_mcap,
    read_osi, read_xml, read_xosc, svg_instant, svg_overview,
};
use clap::Args;
use serde_json::{Value, json};

use super::common::{print_json, table_of};
use super::failure::{Exit, Failure};
use super::headings::{INPUT, OUTPUT};
use super::input::{self, Opened};
use super::log_reading;
use super::output_path::{new_file, new_svg};
use super::terminal::{self, Common};
use crate::openx::import::{DrivenLanes, driven_lanes};
use crate::ron_file::file_text;
use crate::run_dir::{counted, write_output};

/// Least distance of the points of a mapped lane.
// Close points would turn small errors of a map into large ones of headings.
const LEAST_PIECE_M: f64 = 0.5;

#[derive(Args, Debug)]
pub(super) struct LogArgs {
    /// Recordings: FILE.csv, FILE.xosc, FILE.osi, FILE.mcap, FILE.xml, or - for stdin.
    ///
    /// CSV has a row per road user and instant. OpenSCENARIO has polylines that its
    /// entities follow. OSI traces hold osi3.GroundTruth or osi3.SensorView, and XML is
    /// floating car data of SUMO or a CommonRoad scenario. Any other ending is read as CSV.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Column map: dlr, highd, ind, ngsim, sumo, interaction, generic or a RON file
    /// [default: by header].
    ///
    /// A RON file states the columns with their units and the reference point:
    /// ColumnMap(time: Seconds("t"), id: "car", x: "x", y: "y",
    /// velocity: Magnitude("v"), speed_unit: KilometresPerHour, delimiter: Some(';')).
    /// Times are Seconds, Milliseconds, Microseconds, Nanoseconds, Iso or Frames,
    /// references are Centre, Corner or Front, length_unit is Metres or Feet, angles
    /// are Radians, Degrees, CompassDegrees or CompassRadians. The shipped maps are
    /// examples, in crates/traffic/maps of the source.
    #[arg(long, value_name = "NAME|FILE.ron")]
    map: Option<String>,
    /// Time column, with its unit: time_ms [default: that of the map].
    #[arg(long, value_name = "COLUMN", help_heading = INPUT)]
    time: Option<String>,
    /// Take the lanes from a road file in the frame of the recording, unfitted:
    /// OpenDRIVE, or Lanelet2 with local_x and local_y.
    #[arg(long, value_name = "FILE.xodr|FILE.osm", help_heading = INPUT)]
    road: Option<PathBuf>,
    /// Fit a naturalness model, print its calibration and write it.
    #[arg(long, value_name = "FILE.ron", value_parser = new_file())]
    fit: Option<PathBuf>,
    /// Draw the recording from above, with its lanes, paths and crossings.
    #[arg(long, value_name = "FILE.svg", value_parser = new_svg())]
    picture: Option<PathBuf>,
    /// Draw this instant instead, in seconds from the first row.
    #[arg(
        long,
        value_name = "SECONDS",
        requires = "picture",
        requires = "around", help_heading = OUTPUT)]
    at: Option<f64>,
    /// Road user in the middle of the instant.
    #[arg(long, value_name = "ID", requires = "at", help_heading = OUTPUT)]
    around: Option<String>,
    /// Print one JSON object on stdout instead of tables.
    #[arg(long, help_heading = OUTPUT)]
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
    if args.fit.is_some() && args.files.iter().any(|file| input::is_stdin(file)) {
        return Err(Failure::input(
            "`--fit` reads a recording twice, and standard input can be read once",
            "write the recording to a file, and name it",
        ));
    }
    let named = GivenColumns {
        map: args.map.as_deref(),
        time: args.time.as_deref(),
    };
    let recordings = read_all(&args.files, named, args.road.as_deref())?;
    // Tables come first, so that they are shown even if a file cannot be written.
    if !args.json {
        for (analysis, map) in &recordings {
            show(analysis, map)?;
        }
    }
    if let Some(path) = &args.picture {
        draw(args, path, &recordings)?;
    }
    // `fit` takes the analyses, so the reports are made before.
    let reports: Vec<Value> = recordings
        .iter()
        .map(|(analysis, map)| report(analysis, map))
        .collect();
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

/// Draws the only recording, or an instant of it.
fn draw(args: &LogArgs, path: &Path, recordings: &[(Analysis, String)]) -> Result<(), Failure> {
    // A picture has one frame of coordinates, and each recording has its own.
    let [(analysis, _)] = recordings else {
        return Err(Failure::input(
            format!("--picture draws one recording, not {}", recordings.len()),
            "name one file",
        ));
    };
    let svg = match (args.at, &args.around) {
        (Some(at_s), Some(id)) => instant(analysis, id, at_s)?,
        // The parser requires both or neither.
        _ => svg_overview(analysis),
    };
    write_output(path, svg.as_bytes())?;
    if !args.json {
        terminal::note(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn instant(analysis: &Analysis, id: &str, at_s: f64) -> Result<String, Failure> {
    let recording = &analysis.recording;
    // A typed time is rarely that of a sample, so the nearest one is drawn.
    let sample = (at_s / recording.dt_s).round();
    // An identity may have several tracks, because long holes split them.
    let drawn = recording.tracks.iter().enumerate().find_map(|(i, track)| {
        let title = format!("{}: {id} at {at_s} s", recording.name);
        // No sample is before the first row, and a cast would take the first for it.
        let is_it = track.id == id && sample >= 0.0;
        is_it.then(|| svg_instant(analysis, i, sample as usize, &title))?
    });
    drawn.ok_or_else(|| {
        let tracks = recording.tracks.iter().filter(|it| it.id == id);
        let spans: Vec<String> = tracks
            .map(|it| {
                let from_s = it.first_sample as f64 * recording.dt_s;
                // The end is the first sample behind the track.
                let to_s = (it.end_sample() - 1) as f64 * recording.dt_s;
                format!("{from_s:.2} to {to_s:.2} s")
            })
            .collect();
        let help = if spans.is_empty() {
            format!("name a road user of `{}`", recording.name)
        } else {
            format!("it is recorded from {}", spans.join(" and from "))
        };
        Failure::input(format!("no road user `{id}` at {at_s} s"), help)
    })
}

/// Columns that are named on the command line.
#[derive(Clone, Copy)]
pub(super) struct GivenColumns<'a> {
    /// Name or file of a column map.
    pub(super) map: Option<&'a str>,
    /// Time column.
    pub(super) time: Option<&'a str>,
}

/// Reads recordings and finds their lanes and situations, each with its column map.
pub(super) fn read_all(
    files: &[PathBuf],
    columns: GivenColumns<'_>,
    road: Option<&Path>,
) -> Result<Vec<(Analysis, String)>, Failure> {
    let mut map = columns.map.map(column_map).transpose()?;
    // `--time` is for exports that differ from the map in this column only.
    if let (Some((map, _)), Some(time)) = (&mut map, columns.time) {
        map.time = TimeColumn::named(time);
    }
    let is_osm = |file: &&Path| file.extension().is_some_and(|it| it == "osm");
    let road = match road {
        // Lanelet2 has no ending of its own: its files are those of OpenStreetMap.
        Some(file) if is_osm(&file) => Some(lanelets_of(file)?),
        Some(file) => Some(lanes_of(file)?),
        None => None,
    };
    let analysed = |file: &PathBuf| {
        let (recording, map) = read(file, map.as_ref(), columns.time)?;
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
    let mut carriageways = Vec::new();
    let mut too_short = 0;
    for lanes in driven_lanes(file, &file_text)? {
        let DrivenLanes {
            right_lane_m,
            offsets_m,
            ..
        } = lanes;
        match brakecheck_traffic::Path::through(right_lane_m, LEAST_PIECE_M) {
            Some(path) => carriageways.push(MappedCarriageway { path, offsets_m }),
            // All lanes of a carriageway follow one line, and are left out with it.
            None => too_short += offsets_m.len(),
        }
    }
    if too_short > 0 {
        terminal::note(&format!(
            "left out: {} of `{}` shorter than {LEAST_PIECE_M} m",
            counted(too_short, "driving lane"),
            file.display()
        ));
    }
    Ok(MappedRoad { file, carriageways })
}

fn lanelets_of(file: &Path) -> Result<MappedRoad<'_>, Failure> {
    let name = file.display().to_string();
    Ok(MappedRoad {
        file,
        carriageways: read_lanelets(open(file)?, &name)?,
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
    // A shipped name takes precedence over a file of that name.
    if let Some(map) = ColumnMap::shipped(name) {
        return Ok((map, name.to_owned()));
    }
    let text = text_of(
        name,
        "name dlr, highd, ind, ngsim, sumo, interaction, generic or a RON file",
    )?;
    let map = ron::from_str(&text).map_err(|error| {
        Failure::input(
            format!("`{name}`: invalid column map at {error}"),
            "see `brakecheck log --help` for its fields",
        )
    })?;
    Ok((map, name.to_owned()))
}

pub(super) fn text_of(name: &str, help: &str) -> Result<String, Failure> {
    input::text(Path::new(name))
        .map_err(|error| Failure::input(format!("cannot read `{name}`: {error}"), help))
}

fn read(
    file: &Path,
    map: Option<&(ColumnMap, String)>,
    time: Option<&str>,
) -> Result<(TrafficRecording, String), Failure> {
    let (name, rows) = (file.display().to_string(), open(file)?);
    // A file without an ending is read as CSV, like those with any other.
    let ending = file.extension().and_then(OsStr::to_str).unwrap_or_default();
    // Some recorders write endings in capitals.
    let format = match rows.format() {
        Some(format) => format.to_owned(),
        None => ending.to_ascii_lowercase(),
    };
    if !matches!(&*format, "xosc" | "osi" | "mcap" | "xml") {
        return read_rows(file, rows, map, time);
    }
    // A column map without effect would hide a mistake.
    if map.is_some() || time.is_some() {
        return Err(Failure::input(
            format!("`{name}` is not CSV, so it has no columns"),
            "leave out --map and --time, or read the CSV files by a command of their own",
        ));
    }
    let recording = match &*format {
        "xosc" => read_xosc(rows, &name)?,
        "osi" => read_osi(rows, &name)?,
        "mcap" => read_mcap(rows, &name)?,
        _ => {
            // XML is of SUMO or of CommonRoad, which only its reader knows.
            let (recording, known) = read_xml(rows, &name)?;
            return Ok((recording, known.to_owned()));
        }
    };
    Ok((recording, format))
}

fn read_rows(
    file: &Path,
    rows: Opened,
    map: Option<&(ColumnMap, String)>,
    time: Option<&str>,
) -> Result<(TrafficRecording, String), Failure> {
    let meta = meta_beside(file)?;
    let columns = CsvColumns {
        map: map.map(|(map, _)| map),
        time,
        meta: Some(&meta),
    };
    let (recording, guessed) = columns.read(rows, &file.display().to_string())?;
    // Without a map the header decides, and the output names the decision.
    let known = map.map_or(guessed, |(_, known)| known);
    Ok((recording, known.to_owned()))
}

/// Reads the files beside `NN_tracks.csv`, as far as they are there.
fn meta_beside(file: &Path) -> Result<RecordingMeta, Failure> {
    let name = file.file_name().and_then(OsStr::to_str).unwrap_or_default();
    let mut meta = RecordingMeta::default();
    // highD, inD and their relatives put sizes and rates into files beside the tracks.
    let Some(start) = name.strip_suffix("tracks.csv") else {
        return Ok(meta);
    };
    // Both files share the number in front of the ending, as in `03_tracks.csv`.
    let beside = |ending: &str| Some(file.with_file_name(format!("{start}{ending}.csv")));
    let is_there = |path: &PathBuf| path.is_file();
    if let Some(path) = beside("recordingMeta").filter(is_there) {
        meta = meta.with_recording(open(&path)?, &path.display().to_string())?;
    }
    if let Some(path) = beside("tracksMeta").filter(is_there) {
        meta = meta.with_tracks(open(&path)?, &path.display().to_string())?;
    }
    Ok(meta)
}

fn open(file: &Path) -> Result<Opened, Failure> {
    input::open(file).map_err(|error| {
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
        "{}, format {map}: {}, {}, {:.1} s at {:.3} s, {:.1} km",
        recording.name,
        counted(recording.counts.rows, "row"),
        counted(recording.road_users(), "road user"),
        recording.duration_s(),
        recording.dt_s,
        recording.distance_km(),
    ))?;
    log_reading::note(analysis, map);
    let carriageways = analysis.frame.carriageways.iter().enumerate();
    let lanes = carriageways.flat_map(|(i, carriageway)| {
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
    // Motorways have no crossings, so their reports have no table of them.
    if analysis.crossings.is_empty() {
        return Ok(());
    }
    show_crossings(analysis)
}

fn show_crossings(analysis: &Analysis) -> Result<(), Failure> {
    let digits = |value: f64| format!("{value:.2}");
    let rows = analysis.crossing_summaries().into_iter().map(|it| {
        [
            it.classes.join(", "),
            format!("{}", it.paths),
            format!("{}", it.pet_below_5_s),
            digits(it.least_pet_s),
            it.least_m.map_or("–".to_owned(), digits),
        ]
    });
    let header = ["crossing", "paths", "PET < 5 s", "least PET s", "least m"];
    terminal::data(&table_of(header, rows))
}

fn report(analysis: &Analysis, map: &str) -> Value {
    let mut report = json!(analysis.summary());
    report["file"] = json!(analysis.recording.name);
    report["map"] = json!(map);
    report
}

fn fit(args: &LogArgs, path: &Path, analyses: &[Analysis]) -> Result<TrafficModel, Failure> {
    // A model names its sources by their hashes, for which the files are read again.
    let mut sources = Vec::new();
    for file in &args.files {
        let name = file.display().to_string();
        // The file was read before, so an error is no mistake of the command line.
        let source = SourceFile::of(&name, open(file)?)
            .map_err(|error| Failure::fault(format!("cannot read `{name}`: {error}"), None))?;
        sources.push(source);
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let model = fit_traffic(&name, sources, analyses)?;
    write_output(path, model.to_ron().as_bytes())?;
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
