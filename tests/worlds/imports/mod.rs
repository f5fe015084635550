//! Imports of small scenarios: each variant moves as its file says, or is refused
//! where it says so.
//!
//! The places are those of the laws of OpenSCENARIO; esmini has them to one of its
//! steps of 0.01 s.

mod blockers;
mod bounds;
mod cases;
mod edits;
mod entities;
mod hostile;
mod limits;
mod moves;
mod places;
mod precedence;
mod refusals;
mod roads;
mod stories;

use std::path::{Path, PathBuf};

use brakecheck::openx::import::{Import, ImportError, Imported};
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::Scenario;

use cases::*;
use edits::*;

/// From the rear axle, which a file places, to the front.
const LEVER_M: f64 = 3.6;
/// Kind of what is dropped when a run ends with a road.
const END: &str = "what happens behind the end of a road";

fn import(files: &[(&str, String)]) -> Result<Imported, ImportError> {
    import_as(&plain(), files)
}

fn import_as(import: &Import<'_>, files: &[(&str, String)]) -> Result<Imported, ImportError> {
    import.read(&|path| text_of(files, path))
}

/// An import of `base.xosc` without options.
fn plain() -> Import<'static> {
    Import {
        scenario: Path::new("base.xosc"),
        points: None,
        only: None,
        skips_broken: false,
        name: "small",
        ado: None,
        ego: None,
        leaves_ego: false,
        maps: &[],
    }
}

/// An import at the points of `points.xosc`.
fn at_points() -> Import<'static> {
    Import {
        points: Some(Path::new("points.xosc")),
        ..plain()
    }
}

fn text_of(files: &[(&str, String)], path: &Path) -> std::io::Result<String> {
    let found = files.iter().find(|(name, _)| Path::new(name) == path);
    let text = found.map(|(_, text)| text.clone());
    text.ok_or_else(|| std::io::Error::from(std::io::ErrorKind::NotFound))
}

/// The import of the files with changes, which must be read.
fn imported(edits: &[Edit]) -> Imported {
    import(&files(edits)).unwrap_or_else(|error| panic!("{edits:?}: {error}"))
}

fn refused(edits: &[Edit]) -> ImportError {
    import(&files(edits)).expect_err("it is refused")
}

fn world(imported: &Imported) -> Scenario {
    let text = &imported.worlds[0].text;
    Scenario::parse("small.ron", text).unwrap_or_else(|error| panic!("{error:?}\n{text}"))
}

fn run(world: &Scenario) -> Episode {
    let start = Start(Vec::new());
    let mut bench = world.bench();
    play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play)
}

/// The kinds of what an import drops.
fn dropped(imported: &Imported) -> Vec<&'static str> {
    imported.dropped.iter().map(|it| it.kind).collect()
}

/// The rear axle of an entity at a time.
fn at(episode: &Episode, name: &str, time_s: f64) -> (f64, f64) {
    at_by(episode, name, time_s, LEVER_M)
}

/// The point of an entity at a distance behind its front.
fn at_by(episode: &Episode, name: &str, time_s: f64, lever_m: f64) -> (f64, f64) {
    let row = (time_s / 0.05).round() as usize;
    let of = |what: &str| {
        let signal = episode.trace.signal(&format!("{name}.{what}"));
        *signal.expect("there").get(row).expect("a row so late")
    };
    let (x_m, y_m, heading_rad) = (of("x"), of("y"), of("heading"));
    (
        x_m - lever_m * heading_rad.cos(),
        y_m - lever_m * heading_rad.sin(),
    )
}

/// A time in s, and where an entity is then, in m.
type Place = (f64, f64, f64);

/// What differs from a place at a time by more than a step of esmini.
fn off(episode: &Episode, name: &str, place: Place) -> Option<String> {
    let (time_s, x_m, y_m) = place;
    let rows = episode.trace.signal(&format!("{name}.x"));
    let end_s = 0.05 * rows.map_or(0, <[f64]>::len).saturating_sub(1) as f64;
    if time_s > end_s + 0.01 {
        return Some(format!(
            "the episode ends at {end_s:.2} s, before {time_s} s"
        ));
    }
    let (x, y) = at(episode, name, time_s);
    let off_m = (x - x_m).hypot(y - y_m);
    (off_m > 0.02).then(|| format!("({x:.3}, {y:.3}), not ({x_m}, {y_m}), at {time_s} s"))
}

#[test]
fn files_of_other_kinds_are_named_in_words_of_their_own() {
    let with = |name: &str, text: &str| {
        let mut all = files(&[]);
        let (_, content) = all.iter_mut().find(|(it, _)| *it == name).expect("a file");
        *content = text.to_owned();
        import(&all).expect_err("no XML").to_string()
    };
    for text in ["", "a car brakes & stops\n", "Scenario(\n    name: <b,\n)"] {
        let said = with("base.xosc", text);
        assert_eq!(said, "`base.xosc`: it is not an OpenSCENARIO XML file");
        let said = with("straight.xodr", text);
        assert!(said.starts_with("`straight.xodr`"), "{said}");
        let first = said.lines().next().unwrap_or_default();
        assert!(first.ends_with("it is not an OpenDRIVE XML file"), "{said}");
    }
    // In a file of the right kind, the place of the mistake is more useful.
    let said = with("base.xosc", &BASE.replacen("</Story>", "</Stori>", 1));
    assert!(said.contains("line ") && said.contains("Stori"), "{said}");
}

#[test]
fn a_file_in_another_encoding_and_one_without_roads_have_fixes_of_their_own() {
    let latin = plain().read(&|_| {
        let why = "byte 7 is not UTF-8";
        Err(std::io::Error::new(std::io::ErrorKind::InvalidData, why))
    });
    let error = latin.expect_err("no text");
    assert_eq!(error.help.as_deref(), Some("save it as UTF-8"));
    let mut files = files(&[]);
    for (name, text) in &mut files {
        if *name == "straight.xodr" {
            *text = "<OpenDRIVE/>".to_owned();
        }
    }
    let error = import(&files).expect_err("no roads");
    let help = "name a road file with a `road`: this one has none";
    assert!(
        error.all().any(|it| it.help.as_deref() == Some(help)),
        "{error}"
    );
}

#[test]
fn names_of_an_ado_and_of_maps_that_the_file_does_not_have_are_refused() {
    let files = files(&[]);
    let refused = |import: &Import<'_>| {
        let error = import_as(import, &files).expect_err("an unknown name");
        (error.what, error.help.unwrap_or_default())
    };
    for (ado, says) in [
        ("Nobody", "no agent is called `Nobody`"),
        ("Ego", "`Ego` is the ego, so it cannot be an ado"),
    ] {
        let ado = Some(ado);
        let (what, help) = refused(&Import { ado, ..plain() });
        assert_eq!((&*what, &*help), (says, "name the ado with --ado: Lead"));
    }
    let ado = Some("Lead");
    let imported = import_as(&Import { ado, ..plain() }, &files).expect("a world");
    assert!(imported.worlds[0].text.contains("Ado("));
    let import = Import {
        maps: &[("a".to_owned(), PathBuf::from("nowhere.xodr"))],
        ..plain()
    };
    let (what, _) = refused(&import);
    assert_eq!(what, "the file has no map called `a`");
}

#[test]
fn a_map_by_name_is_a_file_on_request() {
    let files = files(&[edit(r#"filepath="straight.xodr""#, r#"filepath="Town""#)]);
    let error = import(&files).expect_err("no such file");
    assert_eq!(
        error.help.as_deref(),
        Some("name it with --road Town=FILE.xodr")
    );
    let import = Import {
        maps: &[("Town".to_owned(), PathBuf::from("straight.xodr"))],
        ..plain()
    };
    let imported = import_as(&import, &files).expect("a world");
    let episode = run(&world(&imported));
    assert_eq!(off(&episode, "lead", (12.0, 228.0, 0.0)), None);
}
