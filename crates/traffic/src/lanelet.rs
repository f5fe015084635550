//! Lanes of Lanelet2 maps.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Read;

use crate::error::ReadError;
use crate::lane_frame::MappedCarriageway;
use crate::path::Path;
use crate::problem::{FilePlace, FileProblem};
use crate::xml_lines::{PlacedElement, RecordedElements, read_elements};

/// Distance of the points of a centre line in metres.
const STEP_M: f64 = 0.5;
/// Points of a centre line.
const MOST_POINTS: usize = 2000;

/// Reads the carriageways of a Lanelet2 map. Errors call it by `name`.
///
/// Nodes have `local_x` and `local_y` in metres. Lanelets for vehicles are joined with their successors, and those beside
/// each other are lanes of one carriageway.
///
/// # Errors
/// The text is not XML, or has no lanelet with local coordinates.
pub fn read_lanelets(text: impl Read, name: &str) -> Result<Vec<MappedCarriageway>, ReadError> {
    let mut map = Osm::default();
    read_elements(text, name, &mut map)?;
    let lanelets = map.lanelets();
    if lanelets.is_empty() {
        return Err(ReadError::Content {
            file: name.to_owned(),
            place: FilePlace::Whole,
            problem: FileProblem::NoLanelets,
        });
    }
    Ok(carriageways(&lanelets))
}

/// Element of OpenStreetMap in the making.
#[derive(Default)]
struct OpenElement {
    id: String,
    tags: BTreeMap<String, String>,
    nodes: Vec<String>,
    left: Vec<String>,
    right: Vec<String>,
}

#[derive(Default)]
struct Osm {
    open: OpenElement,
    nodes: HashMap<String, [f64; 2]>,
    ways: HashMap<String, Vec<String>>,
    relations: Vec<OpenElement>,
}

/// Lane between two bounds.
struct Lanelet {
    left: String,
    right: String,
    /// First and last node of either bound, in the direction of travel.
    from: [String; 2],
    to: [String; 2],
    centre_m: Vec<[f64; 2]>,
}

impl RecordedElements for Osm {
    fn start(&mut self, element: &PlacedElement<'_>) -> Result<(), ReadError> {
        match element.name() {
            "node" | "way" | "relation" => {
                self.open = OpenElement {
                    id: element.text("id")?,
                    ..OpenElement::default()
                };
            }
            "tag" => {
                let (key, value) = (element.text("k")?, element.text("v")?);
                // Parsed here only for an error with the line, which the end
                // of the node has lost.
                if matches!(&*key, "local_x" | "local_y") {
                    element.number("v")?;
                }
                self.open.tags.insert(key, value);
            }
            "nd" => self.open.nodes.push(element.text("ref")?),
            "member" => match &*element.text("role")? {
                "left" => self.open.left.push(element.text("ref")?),
                "right" => self.open.right.push(element.text("ref")?),
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &str, _: FilePlace) -> Result<(), ReadError> {
        if !matches!(name, "node" | "way" | "relation") {
            return Ok(());
        }
        let open = std::mem::take(&mut self.open);
        match name {
            "node" => {
                let local = |key: &str| open.tags.get(key)?.trim().parse::<f64>().ok();
                if let Some((x, y)) = local("local_x").zip(local("local_y")) {
                    self.nodes.insert(open.id, [x, y]);
                }
            }
            "way" => {
                self.ways.insert(open.id, open.nodes);
            }
            _ => self.relations.push(open),
        }
        Ok(())
    }
}

impl Osm {
    /// Returns the lanelets on which vehicles drive.
    fn lanelets(&self) -> Vec<Lanelet> {
        let is_driven = |it: &&OpenElement| {
            let tag = |key: &str| it.tags.get(key).map(String::as_str);
            let subtype = tag("subtype").unwrap_or("road");
            tag("type") == Some("lanelet")
                // Everything else is kept, since maps name their roads in many
                // ways.
                && !matches!(subtype, "crosswalk" | "walkway" | "bicycle_lane" | "stairs")
        };
        let found = self.relations.iter().filter(is_driven);
        found.filter_map(|it| self.lanelet(it)).collect()
    }

    fn lanelet(&self, relation: &OpenElement) -> Option<Lanelet> {
        // A bound of several ways has no single identity by which neighbours
        // are found.
        let ([left], [right]) = (&relation.left[..], &relation.right[..]) else {
            return None;
        };
        let point = |node: &String| self.nodes.get(node).copied();
        let line = |way: &String| {
            let nodes = self.ways.get(way)?;
            // A way with a node that is missing from the map has a wrong
            // shape, so it is left out.
            let points: Option<Vec<[f64; 2]>> = nodes.iter().map(point).collect();
            Some((nodes.clone(), points?)).filter(|(_, points)| points.len() >= 2)
        };
        let ((mut left_nodes, mut left_m), (mut right_nodes, mut right_m)) =
            (line(left)?, line(right)?);
        let far = |a: &[f64; 2], b: &[f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]);
        // Bounds may run either way: first alike, then with the left one on the left.
        let (first, last) = (left_m[0], left_m[left_m.len() - 1]);
        let (start, end) = (right_m[0], right_m[right_m.len() - 1]);
        if far(&first, &start) + far(&last, &end) > far(&first, &end) + far(&last, &start) {
            right_m.reverse();
            right_nodes.reverse();
        }
        let middle = left_m[left_m.len() / 2];
        let (a, b) = (right_m[0], right_m[right_m.len() - 1]);
        // The cross product is negative if the left bound lies to the right.
        let side = (b[0] - a[0]) * (middle[1] - a[1]) - (b[1] - a[1]) * (middle[0] - a[0]);
        if side < 0.0 {
            for line in [&mut left_m, &mut right_m] {
                line.reverse();
            }
            for nodes in [&mut left_nodes, &mut right_nodes] {
                nodes.reverse();
            }
        }
        let ends = |nodes: &[String]| (nodes[0].clone(), nodes[nodes.len() - 1].clone());
        let ((left_from, left_to), (right_from, right_to)) =
            (ends(&left_nodes), ends(&right_nodes));
        Some(Lanelet {
            left: left.clone(),
            right: right.clone(),
            from: [left_from, right_from],
            to: [left_to, right_to],
            centre_m: centre_line(&left_m, &right_m),
        })
    }
}

/// Returns the points halfway between two lines of two points or more, at most 2,001.
///
/// They are at equal shares of the lengths of both lines, about 0.5 m apart.
pub fn centre_line(left_m: &[[f64; 2]], right_m: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let (left_s, right_s) = (stations(left_m), stations(right_m));
    let longest_m = left_s[left_s.len() - 1].max(right_s[right_s.len() - 1]);
    // A hostile map of one lanelet of a million kilometres gets no more points
    // than this.
    let count = ((longest_m / STEP_M).ceil().max(1.0) as usize).min(MOST_POINTS);
    let at = |line: &[[f64; 2]], s_m: &[f64], share: f64| {
        let want_m = share * s_m[s_m.len() - 1];
        // A search, since a line of a map may have any number of points.
        let after = s_m.partition_point(|it| *it < want_m).min(line.len() - 1);
        // Also the case of a line without a length, which would divide by
        // zero.
        if after == 0 {
            return line[0];
        }
        let part = (want_m - s_m[after - 1]) / (s_m[after] - s_m[after - 1]);
        [0, 1]
            .map(|axis| line[after - 1][axis] + part * (line[after][axis] - line[after - 1][axis]))
    };
    (0..=count)
        .map(|i| {
            let share = i as f64 / count as f64;
            let (a, b) = (at(left_m, &left_s, share), at(right_m, &right_s, share));
            [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
        })
        .collect()
}

/// Returns the distances of the points along a line.
fn stations(line: &[[f64; 2]]) -> Vec<f64> {
    let mut s_m = vec![0.0];
    for pair in line.windows(2) {
        let step_m = libm::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        s_m.push(s_m[s_m.len() - 1] + step_m);
    }
    s_m
}

/// Returns the carriageways: right lanes with their successors, and the lanes beside them.
fn carriageways(lanelets: &[Lanelet]) -> Vec<MappedCarriageway> {
    let is_rightmost = |it: &Lanelet| lanelets.iter().all(|other| other.left != it.right);
    let mut used: BTreeSet<usize> = BTreeSet::new();
    let mut found = Vec::new();
    let mut rights: Vec<usize> = (0..lanelets.len())
        .filter(|i| is_rightmost(&lanelets[*i]))
        .collect();
    // Chains begin where nothing leads to.
    let has_before = |i: usize| lanelets.iter().any(|it| it.to == lanelets[i].from);
    rights.sort_by_cached_key(|i| has_before(*i));
    for first in rights {
        if used.contains(&first) {
            continue;
        }
        let mut chain = vec![first];
        used.insert(first);
        // Each step uses up a lanelet, so a loop of lanelets ends.
        while let Some(last) = chain.last().copied() {
            let follows = |i: &usize| !used.contains(i) && lanelets[*i].from == lanelets[last].to;
            let mut next = (0..lanelets.len()).filter(follows);
            let Some(next) = next.find(|i| is_rightmost(&lanelets[*i])) else {
                break;
            };
            used.insert(next);
            chain.push(next);
        }
        let line = chain
            .iter()
            .flat_map(|i| lanelets[*i].centre_m.iter().copied());
        if let Some(path) = Path::through(line, STEP_M) {
            let offsets_m = offsets(lanelets, first, &path);
            found.push(MappedCarriageway { path, offsets_m });
        }
    }
    // Vehicles join the first carriageway that fits, so the longest has
    // priority.
    found.sort_by(|a, b| b.path.length_m().total_cmp(&a.path.length_m()));
    found
}

/// Returns the offsets of a lane and of those to the left of it.
fn offsets(lanelets: &[Lanelet], right: usize, path: &Path) -> Vec<f64> {
    let mut offsets_m = vec![0.0];
    let mut lane = right;
    while let Some(left) = lanelets
        .iter()
        .position(|it| it.right == lanelets[lane].left)
    {
        let middle = lanelets[left].centre_m[lanelets[left].centre_m.len() / 2];
        let offset_m = path.place_anywhere(middle).lateral_m;
        // A map whose lanes lead back to each other ends here.
        if offset_m <= offsets_m[offsets_m.len() - 1] || offsets_m.len() > 200 {
            break;
        }
        offsets_m.push(offset_m);
        lane = left;
    }
    offsets_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two lanes of 200 m beside each other, each of two lanelets.
    fn map() -> String {
        let mut text = String::from("<osm>\n");
        for (line, y) in [(0, 0.0), (1, 3.5), (2, 7.0)] {
            for (i, x) in [0.0, 100.0, 200.0].iter().enumerate() {
                text += &format!(
                    "<node id='{line}{i}' lat='0' lon='0'><tag k='local_x' v='{}'/>\
                     <tag k='local_y' v='{}'/></node>\n",
                    1000.0 + x,
                    500.0 + y
                );
            }
            for i in 0..2 {
                text += &format!(
                    "<way id='w{line}{i}'><nd ref='{line}{i}'/><nd ref='{line}{}'/></way>\n",
                    i + 1
                );
            }
        }
        for (lane, i) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            text += &format!(
                "<relation id='r{lane}{i}'><member type='way' ref='w{}{i}' role='left'/>\
                 <member type='way' ref='w{lane}{i}' role='right'/>\
                 <tag k='type' v='lanelet'/><tag k='subtype' v='highway'/></relation>\n",
                lane + 1
            );
        }
        text + "</osm>\n"
    }

    #[test]
    fn lanelets_are_lanes_beside_and_behind_each_other() {
        let found = read_lanelets(map().as_bytes(), "map.osm").unwrap_or_else(|it| panic!("{it}"));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].offsets_m, [0.0, 3.5]);
        assert!((found[0].path.length_m() - 200.0).abs() < 1.0);
        let place = found[0].path.place_anywhere([1050.0, 501.75]);
        assert!(place.lateral_m.abs() < 1e-9);
        let error = read_lanelets("<osm></osm>".as_bytes(), "map.osm");
        assert!(error.is_err());
    }
}
