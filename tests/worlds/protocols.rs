//! Protocols imported from OpenSCENARIO, beside what esmini makes of the same
//! files (`tests/data/openx/vectors`).

use std::path::{Path, PathBuf};

use brakecheck::experiment::EgoUnderTest;
use brakecheck::openx::import::{Import, ImportError, ImportedWorld, points_of};
use brakecheck::rulebook::Verdict;
use brakecheck::scene::Start;
use brakecheck::testbench::{Aftermath, Constant, Episode, play};
use brakecheck::world::PlantKind;
use brakecheck::world::Scenario;
use serde_json::Value;

/// The vector in which somebody waits for the ego to come near.
const WAITS: &str = "4_2_3_crossing_pedestrian";

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/openx")
}

fn files(path: &Path) -> std::io::Result<String> {
    std::fs::read_to_string(path)
}

/// The scenario file of a variation file.
fn base_of(variation: &Path) -> PathBuf {
    let text = files(variation).expect("a variation file");
    let (_, rest) = text
        .split_once("<ScenarioFile filepath=\"")
        .expect("its scenario");
    let (base, _) = rest.split_once('"').expect("quoted");
    variation.parent().expect("a directory").join(base)
}

/// The text of a file without the constraints that it puts on its parameters.
fn unconstrained(path: &Path) -> std::io::Result<String> {
    let mut text = files(path)?;
    while let Some((before, rest)) = text.split_once("<ConstraintGroup>") {
        let (_, after) = rest.split_once("</ConstraintGroup>").expect("its end");
        text = format!("{before}{after}");
    }
    Ok(text)
}

fn imported(
    variation: &Path,
    point: usize,
    files: &dyn Fn(&Path) -> std::io::Result<String>,
) -> Result<Vec<ImportedWorld>, ImportError> {
    let import = Import {
        scenario: &base_of(variation),
        points: Some(variation),
        only: Some(point),
        skips_broken: false,
        name: "protocol",
        ado: None,
        ego: None,
        leaves_ego: false,
        maps: &[],
    };
    import.read(files).map(|imported| imported.worlds)
}

fn world(text: &str) -> Scenario {
    Scenario::parse("protocol.ron", text).unwrap_or_else(|error| {
        let problem = &error.problems[0];
        panic!("{}; {:?}\n{text}", problem.what, problem.help)
    })
}

fn run(world: &Scenario) -> Episode {
    let start = match world.starts() {
        Some(starts) => starts[0].clone(),
        None => Start(Vec::new()),
    };
    play(
        &mut world.bench(),
        &start,
        0,
        &mut Constant(0),
        Aftermath::Play,
    )
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// `TargetBlocking` as worlds call it.
fn named(name: &str) -> String {
    let mut named = String::new();
    let mut before = '_';
    for c in name.chars() {
        if c.is_uppercase() && before != '_' && !before.is_uppercase() {
            named.push('_');
        }
        named.extend(c.to_lowercase());
        before = c;
    }
    named
}

/// What differs from esmini's vector by more than the bars allow.
fn differences(id: &str, vector: &Value, episode: &Episode) -> Vec<String> {
    let mut wrong = Vec::new();
    // A run ends with the first contact of anybody; esmini lets bodies pass.
    let all = vector["all_contacts"].as_array().expect("contacts");
    match (all.is_empty(), &episode.contact) {
        (true, None) => {}
        (false, Some(touch)) => {
            let first = &all[0];
            let late_s = touch.time_s - number(&first[0]);
            if late_s.abs() > 0.02 {
                wrong.push(format!("{id}: the contact is {late_s:.3} s late"));
            }
            let mut theirs = [1, 2].map(|i| named(first[i].as_str().expect("a name")));
            let mut ours = [touch.between.0.clone(), touch.between.1.clone()];
            theirs.sort();
            ours.sort();
            if ours != theirs {
                wrong.push(format!("{id}: {ours:?} touch, not {theirs:?}"));
            }
            wrong.extend(impact(id, vector, episode));
        }
        (_, touch) => wrong.push(format!("{id}: contact {touch:?}, not {all:?}")),
    }
    wrong.extend(moved(id, vector, episode));
    wrong
}

/// Where on the ego's front it is hit, by the middle of the other's box.
fn impact(id: &str, vector: &Value, episode: &Episode) -> Option<String> {
    let contact = &vector["contact"];
    let touch = episode.contact.as_ref()?;
    let other = named(contact["other"].as_str()?);
    if touch.between.0 != other && touch.between.1 != other {
        return None;
    }
    let size = |name: &str| -> Vec<f64> {
        let boxes = vector["boxes"].as_object().expect("boxes");
        let (_, sizes) = boxes
            .iter()
            .find(|(it, _)| named(it) == name)
            .expect("a box");
        sizes
            .as_array()
            .expect("sizes")
            .iter()
            .map(number)
            .collect()
    };
    let last = |name: &str, what: &str| {
        *episode
            .trace
            .signal(&format!("{name}.{what}"))
            .expect("there")
            .last()
            .expect("a row")
    };
    let back_m = 0.5 * size(&other)[3];
    let h = last(&other, "heading");
    let (x, y) = (
        last(&other, "x") - back_m * h.cos(),
        last(&other, "y") - back_m * h.sin(),
    );
    let (ex, ey, eh) = (last("ego", "x"), last("ego", "y"), last("ego", "heading"));
    let left_m = (y - ey) * eh.cos() - (x - ex) * eh.sin();
    let width_m = size("ego")[4];
    let share = 100.0 * (left_m + 0.5 * width_m) / width_m;
    let theirs = number(&contact["pct"]);
    // esmini says where the other is at the end of its step of 0.01 s in which the
    // two touch: who crosses at 50 km/h is 8 % of the width farther by then.
    let across_mps = number(&contact["vo"]) * number(&contact["h"]).sin();
    let later = share + 100.0 * 0.01 * across_mps / width_m;
    let hit = share.min(later) - 1.5..=share.max(later) + 1.5;
    (!hit.contains(&theirs)).then(|| format!("{id}: hit at {share:.1} %, not {theirs} %"))
}

/// Where targets are elsewhere than in esmini, up to the contact.
fn moved(id: &str, vector: &Value, episode: &Episode) -> Vec<String> {
    let columns: Vec<&str> = vector["columns"]
        .as_array()
        .expect("columns")
        .iter()
        .map(|it| it.as_str().expect("a name"))
        .collect();
    let rows: Vec<Vec<f64>> = vector["rows"]
        .as_array()
        .expect("rows")
        .iter()
        .map(|row| row.as_array().expect("a row").iter().map(number).collect())
        .collect();
    let column = |name: &str| columns.iter().position(|it| *it == name).expect("a column");
    let end_s = episode
        .contact
        .as_ref()
        .map_or(f64::INFINITY, |touch| touch.time_s);
    let lever = |name: &str| {
        let bounds: Vec<f64> = vector["boxes"][name]
            .as_array()
            .expect("a box")
            .iter()
            .map(number)
            .collect();
        bounds[0] + 0.5 * bounds[3]
    };
    let signal = |name: &str, what: &str| {
        episode
            .trace
            .signal(&format!("{}.{what}", named(name)))
            .expect("always there")
            .to_vec()
    };
    // The point that esmini moves, in the frame of the world.
    let at = |name: &str, sample: usize| {
        let (x, y, h) = (
            signal(name, "x")[sample],
            signal(name, "y")[sample],
            signal(name, "heading")[sample],
        );
        let lever_m = lever(name);
        (x - lever_m * h.cos(), y - lever_m * h.sin())
    };
    let moving: Vec<&str> = vector["moving"]
        .as_array()
        .expect("names")
        .iter()
        .map(|it| it.as_str().expect("a name"))
        .collect();
    let bends = vector["point"]["Road"]
        .as_str()
        .is_some_and(|road| road.contains("radius"));
    let (dx, dy) = if bends {
        // The outermost lane of these roads.
        (0.0, 11.5)
    } else {
        let (x, y) = at("Ego", 0);
        (x - rows[0][column("Ego.x")], y - rows[0][column("Ego.y")])
    };
    let mut wrong = Vec::new();
    for name in &moving {
        let speed = column(&format!("{name}.v"));
        let last_mps = rows[rows.len() - 1][speed];
        let meets = !id.starts_with("R157") && rows[0][speed] == 0.0;
        let steady_s = rows
            .iter()
            .rev()
            .take_while(|row| (row[speed] - last_mps).abs() < 1e-6)
            .last()
            .map_or(0.0, |row| row[0]);
        let from_s = if meets { steady_s } else { 0.0 };
        let mut worst = (0.0, 0.0);
        for row in &rows {
            let sample = (row[0] / 0.05).round();
            if (row[0] - 0.05 * sample).abs() > 1e-6
                || row[0] < from_s
                || end_s <= row[0]
                || episode.trace.len() <= sample as usize
            {
                continue;
            }
            let (x, y) = at(name, sample as usize);
            let off_m = (x - dx - row[column(&format!("{name}.x"))])
                .hypot(y - dy - row[column(&format!("{name}.y"))]);
            // Who waits for the ego begins at its instant, but is seen to have begun
            // at the next sample only: the way until then is missing in one row.
            let stood = |other: &&Vec<f64>| other[0] < row[0] && row[0] - 0.15 < other[0];
            let begins = rows
                .iter()
                .find(stood)
                .is_some_and(|before| before[speed] == 0.0);
            let unseen_m = if begins && id.contains(WAITS) {
                0.05 * row[speed]
            } else {
                0.0
            };
            let over_m = off_m - 0.02 - 0.01 * row[speed] - unseen_m;
            if worst.1 < over_m {
                worst = (row[0], over_m);
            }
        }
        if worst.1 > 0.0 {
            wrong.push(format!(
                "{id}: {name} is {:.3} m beyond the tolerance at {} s",
                worst.1, worst.0
            ));
        }
    }
    wrong
}

#[test]
fn points_of_protocols_are_what_esmini_makes_of_them() {
    let vectors = data().join("vectors");
    let index = files(&vectors.join("index.jsonl")).expect("an index");
    let mut wrong = Vec::new();
    let mut compared = 0;
    for line in index.lines() {
        let line: Value = serde_json::from_str(line).expect("JSON");
        let id = line["id"].as_str().expect("an id");
        let text = files(&vectors.join(format!("{id}.json"))).expect("a vector");
        let vector: Value = serde_json::from_str(&text).expect("JSON");
        let variation = data().join(line["variation"].as_str().expect("a file"));
        let point = line["index"].as_u64().expect("a number") as usize;
        let worlds = match imported(&variation, point, &files) {
            Ok(worlds) => worlds,
            Err(error) => {
                // esmini looks at no constraint: one of its points is none of the file.
                assert!(error.is_of_point && id.contains("4_3_2"), "{id}: {error}");
                imported(&variation, point, &unconstrained).expect("a world")
            }
        };
        assert_eq!(worlds.len(), 1, "{id}");
        let world = world(&worlds[0].text).on(PlantKind::Kinematic);
        wrong.extend(differences(id, &vector, &run(&world)));
        compared += 1;
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(compared, 32);
}

/// Places of rear axles that esmini computed with its controllers off.
///
/// The road of the second point turns by 6 radians.
#[test]
fn a_bend_goes_on_until_its_point_of_r157_ends() {
    let variation = data().join(
        "osc-alks/logical_scenarios/\
         alks_scenario_4_3_1_follow_lead_vehicle_comfortable_variation.xosc",
    );
    let cases = [
        (
            1881,
            "ego",
            vec![
                (10.0, 170.87747, 6.589264),
                (30.0, 484.17338, 115.895856),
                (40.0, 623.086219, 207.644294),
            ],
        ),
        (
            1407,
            "ego",
            vec![
                (10.0, 157.506023, -66.272341),
                (30.0, 210.572756, -369.2607),
                (50.0, -76.569139, -479.567347),
            ],
        ),
        // Its gap to the ego is one along its own axis, not along the road.
        (
            1407,
            "lead_vehicle",
            vec![
                (10.0, 180.755789, -86.471998),
                (30.0, 143.797573, -446.815448),
                (50.0, -89.836949, -476.590788),
            ],
        ),
    ];
    let lever_m = 3.9;
    for (point, name, places) in cases {
        let worlds = imported(&variation, point, &files).expect("a world");
        let episode = run(&world(&worlds[0].text));
        for (time_s, x_m, y_m) in places {
            let of = |what: &str| {
                let signal = episode.trace.signal(&format!("{name}.{what}"));
                signal.expect("there")[(time_s / 0.05_f64).round() as usize]
            };
            let h = of("heading");
            let (x, y) = (of("x") - lever_m * h.cos(), of("y") - lever_m * h.sin());
            // The world's road begins 11.5 m beside the file's.
            let off_m = (x - x_m).hypot(y - 11.5 - y_m);
            let is_ego = name == "ego";
            let bound_m = if is_ego {
                0.02
            } else {
                0.02 + 0.01 * of("speed")
            };
            assert!(
                off_m < bound_m,
                "{point}: {name} is {off_m} m off at {time_s} s"
            );
        }
    }
}

/// `counts.txt`: what esmini's `--return_nr_permutations` says of each file.
#[test]
fn every_variation_file_has_as_many_points_as_esmini_finds() {
    fn below(directory: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(directory).expect("a directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                below(&path, found)
            } else {
                found.push(path)
            }
        }
    }
    let mut all = Vec::new();
    below(&data(), &mut all);
    all.retain(|path| {
        let text = files(path).expect("a text");
        text.contains("<ParameterValueDistribution>")
    });
    let counts = files(&data().join("counts.txt")).expect("the counts");
    let (mut wrong, mut ncap_2026) = (Vec::new(), 0);
    for line in counts.lines() {
        let (theirs, name) = line.split_once(' ').expect("a number and a file");
        let theirs: usize = theirs.parse().expect("a number");
        let path = data().join(name);
        let ours = points_of(&path, &files).expect("points").len();
        if ours != theirs {
            wrong.push(format!("{name}: {ours} points, not {theirs}"));
        }
        if name.contains("Range/") {
            ncap_2026 += ours;
        }
        all.retain(|it| *it != path);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(all.is_empty(), "esmini has counted none of {all:?}");
    assert_eq!((counts.lines().count(), ncap_2026), (124, 863));
}

#[test]
fn points_that_a_file_does_not_allow_are_named_or_left_out_and_counted() {
    let alks = data().join("osc-alks/logical_scenarios");
    let kinds = [
        (
            "4_3_2_follow_lead_vehicle_emergency_brake",
            1400,
            175,
            "breaks its constraints",
        ),
        ("4_2_3_crossing_pedestrian", 120, 60, "leads off the road"),
    ];
    for (kind, points, broken, why) in kinds {
        let variation = alks.join(format!("alks_scenario_{kind}_variation.xosc"));
        let scenario = base_of(&variation);
        let mut import = Import {
            scenario: &scenario,
            points: Some(&variation),
            only: None,
            skips_broken: true,
            name: "alks",
            ado: None,
            ego: None,
            leaves_ego: false,
            maps: &[],
        };
        let imported = import.read(&files).expect("worlds");
        assert_eq!(imported.broken, broken, "{kind}");
        let kept: usize = imported.worlds.iter().map(|world| world.points.len()).sum();
        assert_eq!(kept + broken, points, "{kind}");
        // Each is a world that brakecheck takes.
        for imported in &imported.worlds {
            let world = world(&imported.text);
            let starts = world.starts().map_or(1, |starts| starts.len());
            assert_eq!(starts, imported.points.len(), "{}", imported.name);
        }
        import.skips_broken = false;
        let error = import.read(&files).expect_err(why);
        assert!(error.what.contains(why), "{error}");
        assert!(error.point.is_some() && error.element.is_some(), "{error}");
    }
}

#[test]
fn what_is_not_understood_is_refused_where_it_stands() {
    let ncap = data().join("osc-ncap/OpenSCENARIO/NCAP/CA-FC_2026");
    let cases = [
        (
            "CCRs.xosc",
            "dynamicsShape=\"linear\"",
            "dynamicsShape=\"quintic\"",
            "a change of this shape",
        ),
        (
            "CCRs.xosc",
            "<StoryboardElementStateCondition",
            "<UserDefinedValueCondition",
            "condition of this kind",
        ),
        (
            "CCRs.xosc",
            "leadingReferencedEntity\" coordinateSystem=\"entity\"",
            "leadingReferencedEntity\" coordinateSystem=\"world\"",
            "the coordinate system `world`",
        ),
        (
            "CCRs.xosc",
            "${$Ego_initTimeHeadway*$_Ego_speed}",
            "${$Ego_initTimeHeadway*$_Ego}",
            "no parameter `_Ego`",
        ),
        (
            "CCRs.xosc",
            "RelativeLanePosition",
            "GeoPosition",
            "position of this kind",
        ),
        (
            "CCRs.xosc",
            "NCAP_GlobalVehicleTarget",
            "NCAP_Other",
            "no entry `NCAP_Other`",
        ),
        (
            "CBNA.xosc",
            "Ego_Intersection",
            "Ego_Roundabout",
            "no entry `Ego_Roundabout`",
        ),
        ("CCRs.xosc", "</Storyboard>", "</Story>", "no XML"),
    ];
    for (name, from, to, expected) in cases {
        let path = ncap.join(name);
        let changed = |asked: &Path| {
            let text = files(asked)?;
            Ok(if asked == path {
                // Where nothing brakes a condition is not looked at.
                text.replace(
                    "name=\"isTargetbraking\" parameterType=\"boolean\" value=\"false\"",
                    "name=\"isTargetbraking\" parameterType=\"boolean\" value=\"true\"",
                )
                .replace(from, to)
            } else {
                text
            })
        };
        let import = Import {
            scenario: &path,
            points: None,
            only: None,
            skips_broken: false,
            name: "refused",
            ado: None,
            ego: None,
            leaves_ego: false,
            maps: &[],
        };
        let error = import.read(&changed).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
        assert!(error.element.is_some(), "{error}");
    }
}

/// What ways and roads may not be, in the files that a scenario names.
#[test]
fn ways_and_roads_that_worlds_do_not_have_are_refused() {
    let turn = data().join("osc-ncap/OpenSCENARIO/NCAP/CA-FC_2026/CCFtap.xosc");
    let bends = data()
        .join("osc-alks/logical_scenarios/concrete_scenarios")
        .join("alks_scenario_4_1_1_free_driving_template.xosc");
    let cases = [
        (
            &turn,
            "TrajectoryCatalog.xosc",
            "curvatureStart=\"$kappa1\"",
            "curvatureStart=\"$kappa1\" hOffset=\"0.1\"",
            "corners or times",
        ),
        (
            &turn,
            "TrajectoryCatalog.xosc",
            "ClothoidSpline>",
            "Nurbs>",
            "a way along a `Nurbs`",
        ),
        (
            &bends,
            "alks_road_different_curvatures.xodr",
            "<spiral",
            "<bezier",
            "a road with a `bezier` is not read",
        ),
    ];
    for (scenario, file, from, to, expected) in cases {
        let changed = |asked: &Path| {
            let text = files(asked)?;
            Ok(if asked.ends_with(file) {
                text.replace(from, to)
            } else {
                text
            })
        };
        let import = Import {
            scenario,
            points: None,
            only: None,
            skips_broken: false,
            name: "refused",
            ado: None,
            ego: None,
            leaves_ego: false,
            maps: &[],
        };
        assert!(import.read(&files).is_ok(), "{}", scenario.display());
        let error = import.read(&changed).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
        assert!(
            error.file.ends_with(file) && error.element.is_some(),
            "{error}"
        );
    }
}

/// The shipped world of a protocol's points with an ego that coasts, as the
/// protocol has it: at how many points it is in contact, and with whom.
fn coasting(name: &str) -> (usize, Vec<String>) {
    let world = Scenario::shipped(name).expect("shipped").expect("a world");
    let egos = EgoUnderTest::find(&world, "coasts").expect("the ego");
    let world = egos[0].scenario();
    let starts = world.starts().unwrap_or_else(|| vec![Start(Vec::new())]);
    let neutral = world.world().spaces().neutral;
    let mut bench = world.bench();
    let met = starts.iter().filter_map(|start| {
        let episode = play(
            &mut bench,
            start,
            0,
            &mut Constant(neutral),
            Aftermath::Play,
        );
        // Somebody who adds nothing to the plan breaks none of the rules about it,
        // not even in the row of the contact.
        assert!(
            !matches!(episode.verdict, Verdict::Foul { .. }),
            "{name}: {:?}",
            episode.verdict
        );
        let (one, other) = episode.contact?.between;
        Some(if one == "ego" { other } else { one })
    });
    (starts.len(), met.collect())
}

/// esmini lets every one of these points end in the intended contact.
#[test]
fn an_ego_that_coasts_is_hit_at_every_point_of_ncap() {
    let mut points = 0;
    for name in Scenario::protocol_names().filter(|name| name.starts_with("ncap/")) {
        let (all, met) = coasting(name);
        points += all;
        assert_eq!(met.len(), all, "{name}");
        assert!(
            met.iter().all(|who| ["target", "vru"].contains(&&**who)),
            "{name}: {met:?}"
        );
    }
    assert_eq!(points, 863);
}

/// The nine that touch in esmini with its controllers switched off.
#[test]
fn an_ego_that_coasts_is_hit_where_esmini_s_is_in_r157() {
    let touched: Vec<&str> = Scenario::protocol_names()
        .filter(|name| name.starts_with("r157/") && !coasting(name).1.is_empty())
        .collect();
    let expected = [
        "r157/cut_in_far",
        "r157/cut_in_near",
        "r157/cut_out",
        "r157/cut_out_two",
        "r157/lead_brakes",
        "r157/lead_slows",
        "r157/pedestrian_crossing",
        "r157/pedestrian_standing",
        "r157/two_standing",
    ];
    assert_eq!(touched, expected);
}
