//! Names are free: what an ado observes follows from the expression itself.

use brakecheck::seed::{Purpose, StartKey};
use brakecheck::testbench::{Aftermath, Constant, play};
use brakecheck::world::Scenario;

const ACC: &str = include_str!("../../worlds/acc.ron");

/// Names that hold what the language's operators are called.
const NAMES: [&str; 3] = ["express", "powder", "exp2.pow"];

fn parse(text: &str) -> Scenario {
    Scenario::parse("acc.ron", text).unwrap_or_else(|error| panic!("{error}"))
}

/// What is observed: name, middle and half of the range.
fn observed(world: &Scenario) -> Vec<(String, f64, f64)> {
    let observed = world.world().observed().iter();
    observed.map(|o| (o.name.clone(), o.mid, o.half)).collect()
}

/// All signals with their units, by name.
fn units(world: &Scenario) -> Vec<(String, String)> {
    let signals = world.signals().into_iter();
    let mut units: Vec<_> = signals
        .map(|(signal, _)| (signal.name.to_string(), signal.unit.to_string()))
        .collect();
    units.sort();
    units
}

#[test]
fn a_renamed_ado_observes_the_same() {
    let shipped = parse(ACC);
    for name in &NAMES[..2] {
        let rename = |text: &str| {
            text.replace("\"ado\"", &format!("\"{name}\""))
                .replace("ado.", &format!("{name}."))
        };
        let renamed = parse(&rename(ACC));
        let expect: Vec<_> = observed(&shipped)
            .into_iter()
            .map(|(of, mid, half)| (rename(&of), mid, half))
            .collect();
        assert_eq!(observed(&renamed), expect, "{name}");
        let mut expect: Vec<_> = units(&shipped)
            .into_iter()
            .map(|(of, unit)| (rename(&of), unit))
            .collect();
        expect.sort();
        assert_eq!(units(&renamed), expect, "{name}");
    }
}

#[test]
fn a_renamed_signal_has_the_same_unit() {
    for name in NAMES {
        let signals =
            format!("\"{name}\": \"ado.x - ego.x\", \"more\": \"{name} + 1\", \"headway\": ");
        let text = ACC
            .replace("\"headway\": ", &signals)
            .replace("observe: [", &format!("observe: [\"{name}\", \"more\", "));
        let world = parse(&text);
        let as_headway = |of: &str| (of.to_owned(), 50.0, 50.0);
        let expect = [name, "more", "headway"].map(as_headway);
        assert_eq!(observed(&world)[..3], expect);
        for of in [name, "more"] {
            assert!(
                units(&world).contains(&(of.to_owned(), "m".to_owned())),
                "{of}"
            );
        }
    }
}

#[test]
fn the_unit_follows_from_the_expression() {
    let cases = [
        ("ado.x", "m"),
        ("-(ado.x - (ego.x + 3))", "m"),
        ("abs(min(ado.x - ego.x, 5, max(ego.y, ado.y)))", "m"),
        ("ado.speed - v_min", "m/s"),
        ("ado.x - ego.speed", ""),
        ("2 * ado.x", ""),
        ("ado.x / 2", ""),
        ("pow(ado.x, 2)", ""),
        ("exp(ado.x)", ""),
        ("sqrt(abs(ado.x))", ""),
        ("1 + abs(ado.x * ego.x)", ""),
        ("3", ""),
    ];
    for (expr, unit) in cases {
        let text = ACC.replace(
            "\"headway\": ",
            &format!("\"q\": \"{expr}\", \"headway\": "),
        );
        let units = units(&parse(&text));
        assert!(units.contains(&("q".to_owned(), unit.to_owned())), "{expr}");
    }
}

#[test]
fn a_signal_is_published_if_a_rule_names_it() {
    let rule = "(ado.speed <= v_lim)";
    assert!(ACC.contains(rule));
    let world = parse(ACC);
    let key = StartKey {
        purpose: Purpose::Train,
        seed: 1,
        index: 0,
    };
    let published = |world: &Scenario, name: &str| {
        let mut bench = world.bench();
        let start = bench.draw(key);
        let trace = play(&mut bench, &start, 0, &mut Constant(1), Aftermath::Skip).trace;
        trace.signal(name).is_some()
    };
    let mut named = 0;
    for (signal, _) in world.signals() {
        let Some(own) = signal.name.strip_prefix("ado.") else {
            continue;
        };
        let text = match own {
            "ego.contact" => ACC.replacen(rule, &format!("(not {})", signal.name), 1),
            _ => ACC.replacen(rule, &format!("({} <= 1e9)", signal.name), 1),
        };
        let other = format!("ego.{own}");
        if published(&world, &signal.name) || ACC.contains(&other) {
            continue;
        }
        let world = parse(&text);
        assert!(published(&world, &signal.name), "{}", signal.name);
        assert!(!published(&world, &other), "{other} is not named");
        named += 1;
    }
    assert!(named > 3, "{named}");
}
