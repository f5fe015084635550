//! Rule files and traffic models that a world file includes.

use brakecheck::world::{LoadError, Scenario};
use brakecheck_traffic::{TrafficModel, TrafficRuleFile};

const ACC: &str = include_str!("../../worlds/acc.ron");
const GRID: &str = include_str!("../../worlds/grid.ron");
const OWN: &str =
    "Rule(name: \"keeps the speed limit\",   stl: \"always[0, T] (ado.speed <= v_lim)\"),";
const RULES: &str = "RuleFile(vehicle: \"ado\", rules: [
    Rule(name: \"below 29 m/s\", stl: \"ado.speed <= 29\"),
    Rule(name: \"above 0.2 m/s\", stl: \"always (ado.speed >= 0.2)\"),
])";

/// World `acc` with a rule file in place of its second rule.
fn with_rules() -> String {
    assert!(ACC.contains(OWN));
    ACC.replace(OWN, "\"rules.ron\",")
}

/// World `acc` with a field at its top.
fn with_field(field: &str) -> String {
    ACC.replace(
        "    judge: UntilViolation,\n",
        &format!("    judge: UntilViolation,\n    {field},\n"),
    )
}

/// Loads a world from a folder with further files.
fn loaded(world: &str, files: &[(&str, &str)]) -> Result<Scenario, Vec<(usize, String, String)>> {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path
    };
    for (name, text) in files {
        write(name, text);
    }
    Scenario::load(&write("world.ron", world)).map_err(|error| match error {
        LoadError::Scenario(error) => error
            .problems
            .iter()
            .map(|it| {
                let line = error.text[..it.span.start].matches('\n').count() + 1;
                let place = error.text[it.span.clone()].to_owned();
                (line, place, it.what.clone())
            })
            .collect(),
        other => panic!("{other}"),
    })
}

fn line_of(text: &str, what: &str) -> usize {
    text[..text.find(what).expect(what)].matches('\n').count() + 1
}

#[test]
fn the_rules_of_a_file_are_in_the_world_and_in_its_text() {
    let world = loaded(&with_rules(), &[("rules.ron", RULES)]).expect("a world");
    let rules = |world: &Scenario| -> Vec<(String, String)> {
        let rules = world.rules().iter();
        rules
            .map(|it| (it.name.clone(), it.formula.to_string()))
            .collect()
    };
    let names: Vec<String> = rules(&world).into_iter().map(|it| it.0).collect();
    assert_eq!(
        names,
        ["never stops or reverses", "below 29 m/s", "above 0.2 m/s"]
    );
    // A rule of a rule file holds at every row.
    for (name, formula) in &rules(&world)[1..] {
        assert_eq!(formula.matches("always").count(), 1, "{name}: {formula}");
    }
    // The text needs no second file, and keeps the lines of the file.
    assert!(!world.text().contains("rules.ron"));
    assert_eq!(world.text().lines().count(), ACC.lines().count());
    let again = Scenario::parse("again.ron", world.text()).expect("a whole text");
    assert_eq!(rules(&again), rules(&world));
    // The same file is one for recordings.
    assert!(TrafficRuleFile::parse(RULES).is_ok());
}

#[test]
fn mistakes_in_included_rules_have_their_place() {
    let world = with_rules();
    let line = line_of(&world, "\"rules.ron\"");
    let refused = |files: &[(&str, &str)]| {
        let problems = loaded(&world, files).expect_err("a mistake");
        problems.into_iter().next().expect("a problem")
    };
    let (at, place, what) = refused(&[]);
    assert_eq!((at, &*place), (line, "\"rules.ron\""), "{what}");
    assert!(what.contains("cannot read `rules.ron`"), "{what}");
    for (rules, says) in [
        ("RuleFile(rulez: [])", "rulez"),
        ("RuleFile(rules: [])", "has no rules"),
        (
            "RuleFile(rules: [Rule(name: \"a\", stl: \"ado.speed <=\")])",
            "rule `a`",
        ),
        (
            "RuleFile(constants: {\"fast\": 20.0}, rules: [Rule(name: \"a\", stl: \"ado.speed <= fast\")])",
            "the constant `fast` = 20",
        ),
    ] {
        let (at, place, what) = refused(&[("rules.ron", rules)]);
        assert_eq!((at, &*place), (line, "\"rules.ron\""), "{what}");
        assert!(what.contains("rules.ron") && what.contains(says), "{what}");
    }
    // A signal that only recordings have is marked in the rule itself.
    let rules = "RuleFile(rules: [Rule(name: \"a\", stl: \"lead.present\")])";
    let (at, place, what) = refused(&[("rules.ron", rules)]);
    assert_eq!((at, &*place), (line, "(lead.present)"), "{what}");
    // A constant of the world is one of the file.
    let rules = "RuleFile(constants: {\"v_lim\": 30.0}, rules: [Rule(name: \"a\", stl: \"ado.speed <= v_lim\")])";
    assert!(loaded(&world, &[("rules.ron", rules)]).is_ok());
}

#[test]
fn a_text_without_a_file_and_a_grid_include_nothing() {
    let error = Scenario::parse("world.ron", &with_rules()).expect_err("no files");
    assert!(
        error.problems[0].what.contains("is not looked for"),
        "{error}"
    );
    let first = GRID.find("Rule(").expect("a rule");
    let grid = format!("{}\"rules.ron\", {}", &GRID[..first], &GRID[first..]);
    let error = Scenario::parse("grid.ron", &grid).expect_err("no files");
    assert!(
        error.problems[0].what.contains("cannot be included"),
        "{error}"
    );
}

#[test]
fn a_world_can_limit_its_ados_to_the_driving_of_a_file() {
    let mut model = TrafficModel::motorway();
    model.name = "quiet".to_owned();
    let file = [("quiet.ron", &*model.to_ron())];
    let field = "natural: (per_1000_km: 3.0, traffic: \"quiet.ron\")";
    let world = loaded(&with_field(field), &file).expect("a world");
    assert!(world.text().contains("quiet.ron") && world.text().contains("Kept("));
    assert_eq!(world.text().lines().count(), ACC.lines().count() + 1);
    let limit = |world: &Scenario| {
        let limit = world.traffic().limit().expect("a limit");
        (limit.model.name.clone(), limit.per_1000_km)
    };
    assert_eq!(limit(&world), ("quiet".to_owned(), 3.0));
    let again = Scenario::parse("again.ron", world.text()).expect("a whole text");
    assert_eq!(limit(&again), limit(&world));
    // The shipped model has a name, and no limit only declares the traffic.
    let world = loaded(&with_field("natural: (per_1000_km: 0.5)"), &[]).expect("a world");
    assert_eq!(limit(&world).1, 0.5);
    let world = loaded(&with_field("natural: (traffic: \"motorway\")"), &[]).expect("a world");
    assert!(world.traffic().limit().is_none());
}

#[test]
fn a_limit_that_cannot_be_is_refused_with_its_place() {
    let refused = |field: &str, files: &[(&str, &str)]| {
        let world = with_field(field);
        let line = line_of(&world, "natural:");
        let (at, place, what) = loaded(&world, files)
            .expect_err("a mistake")
            .into_iter()
            .next()
            .expect("a problem");
        assert_eq!(at, line, "{what}");
        (place, what)
    };
    let (place, what) = refused("natural: (per_1000_km: 0.0)", &[]);
    assert_eq!(place, "0.0", "{what}");
    let field = "natural: (traffic: \"quiet.ron\")";
    let (place, what) = refused(field, &[]);
    assert_eq!(place, "\"quiet.ron\"", "{what}");
    let (place, what) = refused(field, &[("quiet.ron", "TrafficModel()")]);
    assert_eq!(place, "\"quiet.ron\"", "{what}");
    assert!(what.contains("quiet.ron"), "{what}");
    // A world whose ado walks has nothing to limit.
    let walking = include_str!("../../worlds/pedestrian.ron").replacen(
        "    plant: Rigid,\n",
        "    plant: Rigid,\n    natural: (per_1000_km: 3.0),\n",
        1,
    );
    let error = Scenario::parse("pedestrian.ron", &walking).expect_err("no vehicle");
    assert!(
        error.problems[0].what.contains("no ado drives a vehicle"),
        "{error}"
    );
}
