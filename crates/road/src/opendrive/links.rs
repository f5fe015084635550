//! Links between roads, and connections through junctions.

use std::collections::BTreeMap;

use super::error::ImportError;
use super::scope::ParameterScope;
use super::tree::XmlNode;

/// Road or junction at an end of a road.
#[derive(Clone, Debug)]
pub(crate) struct RoadLink {
    pub id: String,
    pub is_junction: bool,
    /// True if the end of that road is here, and not its start.
    pub at_end: bool,
}

impl RoadLink {
    /// Reads the links of a road: before it and after it.
    pub fn both(road: &XmlNode) -> Result<[Option<RoadLink>; 2], ImportError> {
        let of = |name: &str| {
            let node = road.child("link").and_then(|it| it.child(name));
            let link = node.map(|it| {
                Ok(RoadLink {
                    id: it.need("elementId")?.to_owned(),
                    is_junction: it.raw("elementType") == Some("junction"),
                    at_end: it.raw("contactPoint") == Some("end"),
                })
            });
            link.transpose()
        };
        Ok([of("predecessor")?, of("successor")?])
    }
}

/// JunctionConnection of a junction: from a road, over a road, from lane to lane.
#[derive(Clone, Debug)]
pub(crate) struct JunctionConnection {
    pub from: String,
    pub over: RoadLink,
    pub lanes: Vec<(i32, i32)>,
}

/// Signals by the controller that switches them.
pub(super) fn controllers(root: &XmlNode) -> Result<BTreeMap<String, Vec<String>>, ImportError> {
    let controllers = root.all("controller").map(|controller| {
        let signals = controller
            .all("control")
            .map(|it| it.need("signalId"))
            .map(|id| id.map(str::to_owned));
        Ok((
            controller.need("id")?.to_owned(),
            signals.collect::<Result<_, _>>()?,
        ))
    });
    controllers.collect()
}

/// Connections of all junctions by their id.
#[derive(Clone, Debug, Default)]
pub(crate) struct Junctions(pub BTreeMap<String, Vec<JunctionConnection>>);

impl Junctions {
    pub fn of(root: &XmlNode) -> Result<Junctions, ImportError> {
        let plain = ParameterScope::default();
        let connection = |it: &XmlNode| {
            let lanes = it
                .all("laneLink")
                .map(|link| Ok((plain.lane(link, "from")?, plain.lane(link, "to")?)));
            // A direct junction names the linked road itself.
            let over = it.raw("connectingRoad").or(it.raw("linkedRoad"));
            Ok(JunctionConnection {
                from: it.need("incomingRoad")?.to_owned(),
                over: RoadLink {
                    // Without a road the link leads nowhere: an error only on a way through it.
                    id: over.unwrap_or_default().to_owned(),
                    is_junction: false,
                    at_end: it.raw("contactPoint") == Some("end"),
                },
                lanes: lanes.collect::<Result<_, ImportError>>()?,
            })
        };
        let junctions = root.all("junction").map(|junction| {
            let connections = junction
                .all("connection")
                .map(connection)
                .collect::<Result<_, ImportError>>()?;
            Ok((junction.need("id")?.to_owned(), connections))
        });
        Ok(Junctions(junctions.collect::<Result<_, ImportError>>()?))
    }
}
