//! Roads of OpenDRIVE files beside those of the crate `xodr`, which reads them on its own.

use std::path::{Path, PathBuf};

use brakecheck_road::opendrive::roads::RoadMap;
use brakecheck_road::opendrive::tree::XmlNode;
use xodr::RoadPosition;

/// A millimetre from the arcs that replace curves, and the digits of its single precision.
const TOLERANCE_M: f64 = 2e-3;

fn files(directory: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).expect("a directory") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|it| it == "xodr") {
            found.push(path);
        }
    }
}

/// Compares places on all roads of a file, and returns their number.
fn compare(file: &Path) -> usize {
    let read = |path: &Path| std::fs::read_to_string(path);
    let text = read(file).expect("readable");
    let root = XmlNode::read(file, "OpenDRIVE", &read).expect("XML");
    let ours = RoadMap::of(&root).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let theirs =
        xodr::load_str(&text).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let mut places = 0;
    for (id, road) in ours.all() {
        let their = theirs.road_by_od_id(id).expect("the same road");
        for step in 0..=64 {
            let s = road.length_m.min(their.length()) * f64::from(step) / 64.0;
            for t in [-3.5, 0.0, 2.0] {
                let road_position = RoadPosition {
                    road: their.id(),
                    s,
                    t,
                };
                let point = theirs.road_point(road_position).expect("a place");
                let pose = road.at(s, t);
                let height_m = road.height_m(s, t);
                let apart = [
                    f64::from(point.x) - pose.x_m,
                    f64::from(point.y) - pose.y_m,
                    f64::from(point.z) - height_m,
                ];
                let reach_m = pose.x_m.abs().max(pose.y_m.abs());
                let allowed_m = TOLERANCE_M + reach_m * f64::from(f32::EPSILON);
                assert!(
                    apart.iter().all(|it| it.abs() < allowed_m),
                    "{}: road {id}, s {s}, t {t}: {apart:?}",
                    file.display()
                );
                places += 1;
            }
        }
    }
    places
}

#[test]
fn roads_lie_where_another_reader_has_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    // A published package has no files.
    if !root.join("worlds").is_dir() {
        return;
    }
    let mut found = Vec::new();
    for directory in [
        "worlds",
        "tests/worlds/imports",
        "tests/data/openx",
        "examples/cosim",
    ] {
        files(&root.join(directory), &mut found);
    }
    let places: usize = found.iter().map(|file| compare(file)).sum();
    assert!(
        found.len() >= 12 && places > 10_000,
        "{} files, {places} places",
        found.len()
    );
}
