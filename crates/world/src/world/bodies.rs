//! Bodies of a driving world: its own and the shipped ones.

use super::check::within;
use crate::ron_file::Ordered;
use crate::ron_file::Problems;
use crate::ron_file::ValuePath;
use crate::scene::drive::StartPlace;
use crate::sim::Body;
use crate::world_file::DriveFile;

/// Reports the mistakes of a world's own bodies.
pub(super) fn check(problems: &mut Problems, own: &Ordered<Body>) {
    for (name, body) in &own.0 {
        if let Err(error) = body.validate() {
            let place = ValuePath::top().to("bodies").to(name).to(error.field);
            problems.add(&place, error.to_string(), "here", help(error.field));
        }
    }
}

/// Advice for a field whose bounds follow from other fields.
fn help(field: &str) -> Option<String> {
    let help = match field {
        "com_height_m" => {
            "higher, it would tip over on its springs: lower it, or raise `track_m` or `suspension_hz`"
        }
        "com_ahead_m" => "both axles must carry weight",
        "suspension_travel_m" => {
            "it must carry the body's weight: raise it, or raise `suspension_hz`"
        }
        "max_steer_rad" => "the turn's centre must lie beside the inner wheel",
        _ => return None,
    };
    Some(help.to_owned())
}

/// Finds a body by its name, or reports it as unknown.
pub(super) fn find(
    problems: &mut Problems,
    path: &ValuePath,
    own: &Ordered<Body>,
    name: &str,
) -> Option<Body> {
    // The world's own bodies take precedence over shipped bodies.
    if let Some(body) = own.0.get(name) {
        return Some(body.clone());
    }
    match Body::shipped(name) {
        Some(Ok(body)) => Some(body),
        Some(Err(error)) => {
            problems.add(path, error.to_string(), "here", None);
            None
        }
        None => {
            let mut known: Vec<&str> = Body::shipped_names().collect();
            known.extend(own.0.keys().map(String::as_str));
            problems.unknown(path, "body", name, &known);
            None
        }
    }
}

/// Finds a body, or reports it as unknown and returns another one of its kind.
///
/// The mistakes of an agent with an unknown body are then found, too.
pub(super) fn find_or_similar(
    problems: &mut Problems,
    path: &ValuePath,
    own: &Ordered<Body>,
    name: &str,
    on_foot: bool,
) -> Option<Body> {
    let similar = if on_foot { "pedestrian" } else { "sedan" };
    find(problems, path, own, name).or_else(|| Body::shipped(similar)?.ok())
}

/// Checks that a cyclist is no ego and starts within its speeds.
pub(super) fn check_cyclist(
    problems: &mut Problems,
    path: &ValuePath,
    body: &Body,
    drive: &DriveFile,
    place: Option<&StartPlace>,
) {
    let Some(cyclist) = body.cyclist() else {
        return;
    };
    if let DriveFile::Ego(_) = drive {
        let what = format!(
            "controllers drive vehicles, and `{}` is a cyclist",
            body.name
        );
        let help = "give the ego a body such as `sedan`".to_owned();
        problems.add(&path.to("body"), what, "here", Some(help));
    }
    let Some(StartPlace::At { speed_mps, .. } | StartPlace::Ahead { speed_mps, .. }) = place else {
        return;
    };
    let most_mps = cyclist.max_speed_mps;
    let place = path.to("start").to("speed_mps");
    // A bicycle has no reverse.
    for value in [speed_mps.lo, speed_mps.hi] {
        within(problems, &place, value, 0.0, most_mps);
    }
}
