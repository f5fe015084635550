//! The points of test protocols, ego by ego.

use serde_json::json;

use super::{Failure, Made, ReproduceArgs, once, world};
use crate::{ProtocolRow, protocol_egos, protocol_row, protocols_markdown};
use brakecheck::world::Scenario;

/// Euro NCAP's.
pub(super) fn ncap(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    made(args, "ncap")
}

/// UN R157's.
pub(super) fn r157(args: &ReproduceArgs) -> Result<Option<Made>, Failure> {
    made(args, "r157")
}

/// Makes the table of a protocol's worlds, or of the requested worlds.
///
/// Returns `None` if stopped.
fn made(args: &ReproduceArgs, protocol: &'static str) -> Result<Option<Made>, Failure> {
    let own = |name: &&str| name.split('/').next() == Some(protocol);
    let mut rows: Vec<ProtocolRow> = Vec::new();
    for name in &args.worlds_or(Scenario::protocol_names().filter(own)) {
        let scenario = world(args, name)?.allow_programs(args.common.allow_programs);
        for ego in protocol_egos(&scenario, &args.ego)? {
            let settings = json!({ "ego": ego.change(), "starts": args.starts });
            // A piece is a file name, which cannot contain a slash.
            let piece = format!("{}, {}", name.replace('/', " "), ego.name());
            let row = once(args, &piece, &scenario, settings, |watch| {
                let row = protocol_row(name, &ego, args.starts, watch);
                // An ego that did not run has passed nothing.
                match watch.faults.complaint() {
                    Some(complaint) => Err(complaint.into()),
                    None => Ok(row),
                }
            })?;
            match row {
                Some(row) => rows.push(row),
                None => return Ok(None),
            }
        }
    }
    Ok(Some(Made {
        name: protocol,
        markdown: protocols_markdown(&rows),
        json: json!({ protocol: rows }),
    }))
}
