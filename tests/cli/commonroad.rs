//! CommonRoad scenarios in `new --from`.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::Scenario;

use super::{brakecheck, code, json, refused, stderr, write};

const STEP_S: f64 = 0.1;
const STEPS: u32 = 60;

/// Front-independent place of the recorded car: it turns left on a circle of 80 m at 8 m/s.
fn recorded(step: u32) -> [f64; 3] {
    let turned_rad = 8.0 * STEP_S * f64::from(step) / 80.0;
    let (sin, cos) = (turned_rad.sin(), turned_rad.cos());
    [60.0 + 80.0 * sin, -60.0 + 80.0 * (1.0 - cos), turned_rad]
}

fn state(name: &str, step: u32, [x, y, heading]: [f64; 3], speed: f64) -> String {
    format!(
        "<{name}><position><point><x>{x}</x><y>{y}</y></point></position>\
         <orientation><exact>{heading}</exact></orientation><time><exact>{step}</exact></time>\
         <velocity><exact>{speed}</exact></velocity></{name}>\n"
    )
}

/// An ego on a straight lane, and a car that turns beside it.
fn scenario() -> String {
    let bound = |name: &str, y: f64| {
        format!(
            "<{name}><point><x>0</x><y>{y}</y></point><point><x>300</x><y>{y}</y></point></{name}>\n"
        )
    };
    let states: String = (1..=STEPS)
        .map(|step| state("state", step, recorded(step), 8.0))
        .collect();
    format!(
        "<commonRoad commonRoadVersion=\"2020a\" benchmarkID=\"ZAM_Turn-1_1_T-1\" timeStepSize=\"{STEP_S}\">\n\
         <lanelet id=\"1\">{}{}<laneletType>urban</laneletType></lanelet>\n\
         <dynamicObstacle id=\"31\"><type>car</type><shape><rectangle><length>4.2</length>\
         <width>1.9</width></rectangle></shape>{}<trajectory>\n{states}</trajectory></dynamicObstacle>\n\
         <planningProblem id=\"7\">{}<goalState><time><intervalStart>0</intervalStart>\
         <intervalEnd>{STEPS}</intervalEnd></time><position><rectangle><length>60</length>\
         <width>3</width><center><x>70</x><y>0</y></center></rectangle></position></goalState>\
         </planningProblem>\n</commonRoad>\n",
        bound("leftBound", 1.75),
        bound("rightBound", -1.75),
        state("initialState", 0, recorded(0), 8.0),
        state("initialState", 0, [30.0, 0.0, 0.0], 10.0),
    )
}

fn folder() -> (tempfile::TempDir, String, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("scenario.xml");
    write(&file, scenario().as_bytes());
    let (file, world) = (file.display().to_string(), folder.path().join("turn.ron"));
    (folder, file, world.display().to_string())
}

#[test]
fn an_obstacle_drives_in_the_world_where_the_scenario_has_it() {
    let (_folder, file, world) = folder();
    let output = brakecheck(&["new", &world, "--from", &file, "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output);
    assert_eq!(report["worlds"][0]["file"], world.as_str());
    assert_eq!(
        report["dropped"].as_array().map(Vec::len),
        Some(0),
        "{report}"
    );
    let text = std::fs::read_to_string(&world).expect("the world");
    let scenario = Scenario::parse("turn.ron", &text).unwrap_or_else(|it| panic!("{it}\n{text}"));
    let mut bench = scenario.bench();
    let key = StartKey {
        purpose: Purpose::Test,
        seed: 0,
        index: 0,
    };
    let start = bench.draw(key);
    let episode = play(&mut bench, &start, 0, &mut Constant(0), Aftermath::Play);
    let signal = |name: &str| episode.trace.signal(name).expect(name).to_vec();
    let (x, y, heading) = (
        signal("car_31.x"),
        signal("car_31.y"),
        signal("car_31.heading"),
    );
    // The ego starts with its middle at (30, 0), and its front half a BMW 320i ahead.
    let origin = [30.0 + 0.5 * 4.508 - signal("ego.x")[0], -signal("ego.y")[0]];
    let samples = (episode.trace.len() - 1) / 2;
    assert!(samples > 55, "{samples} steps, {:?}", episode.verdict);
    for step in 0..=samples {
        let [middle_x, middle_y, turned_rad] = recorded(step as u32);
        let at = 2 * step;
        let front = [
            middle_x + 2.1 * turned_rad.cos() - origin[0],
            middle_y + 2.1 * turned_rad.sin() - origin[1],
        ];
        let off_m = (x[at] - front[0]).hypot(y[at] - front[1]);
        assert!(off_m < 0.15, "{off_m} m at step {step}");
        assert!((heading[at] - turned_rad).abs() < 0.05, "{heading:?}");
    }
    assert_eq!(scenario.ego_spec().to_string(), "no_contact and goal");
}

#[test]
fn an_ado_of_a_scenario_can_be_searched_and_other_options_are_refused() {
    let (_folder, file, world) = folder();
    let output = brakecheck(&["new", &world, "--from", &file, "--ego", "7", "--ado", "31"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = brakecheck(&["search", &world, "--starts", "1", "--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    refused(&["new", &world, "--from", &file], "is there already");
    let with = |option: &[&str], says: &str| {
        let args = [&["new", "other", "--from", &file][..], option].concat();
        refused(&args, says);
    };
    with(
        &["--leave-ego", "--skip-broken"],
        "without --skip-broken, --leave-ego",
    );
    with(&["--ego", "8"], "no planning problem `8`");
    with(&["--ado", "8"], "no obstacle `8`");
    // All faults are named with their lines.
    let text = scenario().replace("<x>300</x>", "<x>far</x>");
    write(file.as_ref(), text.as_bytes());
    with(&[], "line 2, x: `far` is not a finite number");
}
