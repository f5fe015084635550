//! What `examples/mutants` changes in a source, and how its switches look.

mod find;
mod switch;

use std::path::Path;

/// Functions and changes, in the order of the source.
fn changes(source: &str) -> Vec<String> {
    let mutants = find::mutants(source).expect("Rust");
    let function = |place: &str| place.split_once(' ').expect("a place").1.to_string();
    let named = mutants
        .iter()
        .map(|m| format!("{}: {}", function(&m.place), m.change));
    named.collect()
}

fn switched(source: &str) -> switch::Switched {
    let mutants = find::mutants(source).expect("Rust");
    let numbered: Vec<_> = (1..).zip(&mutants).collect();
    switch::switched(source, &numbered)
}

#[test]
fn each_kind_of_code_has_its_changes() {
    let cases: [(&str, &[&str]); 22] = [
        ("_ = a + b * c", &["a + b * c → a - b * c", "b * c → b / c"]),
        ("_ = a % b", &["a % b → a * b"]),
        ("_ = a < b", &["a < b → a <= b", "a < b → a > b"]),
        (
            "_ = a as u8 >= b",
            &[
                "a as u8 >= b → (a as u8) > b",
                "a as u8 >= b → (a as u8) <= b",
            ],
        ),
        ("_ = a == b", &["a == b → a != b"]),
        ("_ = a && b", &["a && b → a || b"]),
        ("_ = !a", &["!a → a"]),
        ("_ = -a", &["-a → a"]),
        ("_ = [true; 3]", &["true → false"]),
        ("_ = (0, 1u8, 7)", &["0 → 1", "1u8 → 0u8", "7 → 8"]),
        (
            "_ = (0.0, 1.0f32, 2.5)",
            &["0.0 → 1.0", "1.0f32 → 0.0f32", "2.5 → -2.5"],
        ),
        ("_ = a.min(b)", &["a.min(b) → a.max(b)"]),
        ("_ = f64::max(a, b)", &["f64::max(a, b) → f64::min(a, b)"]),
        ("_ = Some(a)", &["Some(a) → None"]),
        ("_ = a..b", &["a..b → ..="]),
        ("_ = a..=b", &["a..=b → .."]),
        ("a += b;", &["a += b; → nothing", "a += b → a -= b"]),
        ("a.push(b);", &["a.push(b); → nothing"]),
        ("if a {}", &["a → true", "a → false"]),
        ("while a {}", &["a → false"]),
        (
            "_ = match a { b if c => d, e => f }",
            &["c → true", "c → false"],
        ),
        ("if let Some(0) = a && b {}", &[]),
    ];
    for (code, expected) in cases {
        let mut of_code = changes(&format!("impl It {{ fn f() -> It {{ {code} }} }}"));
        of_code.sort();
        let mut expected: Vec<String> = expected.iter().map(|c| format!("It::f: {c}")).collect();
        expected.sort();
        assert_eq!(of_code, expected, "{code}");
    }
}

#[test]
fn a_body_is_replaced_by_plain_values_of_its_type() {
    let cases: [(&str, &[&str]); 8] = [
        ("", &["return;"]),
        (" -> bool", &["return true;", "return false;"]),
        (" -> usize", &["return 0;", "return 1;"]),
        (" -> f64", &["return 0.0;", "return 1.0;"]),
        (" -> Option<It>", &["return None;"]),
        (" -> Vec<It>", &["return Vec::new();"]),
        (" -> Result<(), It>", &["return Ok(());"]),
        (" -> It", &[]),
    ];
    for (output, expected) in cases {
        let expected: Vec<String> = expected
            .iter()
            .map(|c| format!("f: the body → {c}"))
            .collect();
        assert_eq!(
            changes(&format!("fn f(){output} {{ g() }}")),
            expected,
            "{output}"
        );
    }
    assert!(changes("fn f() {}").is_empty());
    assert!(
        !changes("fn f() -> bool { true }").contains(&"f: the body → return true;".to_string())
    );
}

#[test]
fn what_is_no_behaviour_of_the_library_is_left_alone() {
    for source in [
        "#[cfg(test)] mod tests { fn f() -> bool { 1 < 2 } }",
        "#[test] fn f() { a += 1; }",
        "impl fmt::Display for It { fn fmt(&self) -> bool { 1 < 2 } }",
        "const A: [u8; 2] = [0; 1 + 1];",
        "static A: bool = !true;",
        "const fn f() -> bool { 1 < 2 }",
        "enum A { B = 1 }",
        "struct A { b: [u8; 2] }",
        "fn f() -> It { let (0 | 1, _): [u8; 2] = a::<3>(assert!(1 < 2)); }",
    ] {
        assert_eq!(changes(source), [""; 0], "{source}");
    }
}

#[test]
fn every_change_stands_behind_a_switch_beside_what_it_replaces() {
    let source = "fn f() {\n    a.b(c - 1);\n}";
    let expected = "fn f() {if crate::mutant::on(1) { return; }\n    \
        if crate::mutant::on(3) {  } else { a.b(\
        (if crate::mutant::on(2) { c + 1 } else { c - \
        (if crate::mutant::on(4) { 0 } else { 1 }) })); }\n}";
    let mutants = find::mutants(source).expect("Rust");
    let by_change = |change: &str| mutants.iter().find(|m| m.change == change).expect(change);
    assert_eq!(by_change("1 → 0").place, "2:13 f");
    let numbered = [
        (1, by_change("the body → return;")),
        (2, by_change("c - 1 → c + 1")),
        (3, by_change("a.b(c - 1); → nothing")),
        (4, by_change("1 → 0")),
    ];
    assert_eq!(switch::switched(source, &numbered).text, expected);
}

#[test]
fn an_error_is_blamed_on_the_change_it_is_in_or_else_on_the_switch_around() {
    let source = "fn f() -> It { g(a - b * c) }";
    let new = switched(source);
    // a - b * c is 1, b * c is 2.
    for (error, ids) in [
        ("a + b * c", vec![1]),
        ("b / c", vec![2]),
        ("else { b * c", vec![2]),
        ("else { a - ", vec![1]),
        (
            "g((if crate::mutant::on(1) { a + b * c } else { a - (if crate::mutant::on(2) { b / c } else { b * c }) }))",
            vec![2, 1],
        ),
        ("fn f", vec![]),
    ] {
        let at = new.text.find(error).expect(error);
        assert_eq!(new.blamed(&(at..at + error.len())), ids, "{error}");
    }
}

#[test]
fn the_library_with_all_its_switches_is_still_rust() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    for file in [
        "scene/src/rulebook.rs",
        "rl/src/rl/nn.rs",
        "rl/src/rl/ppo/mod.rs",
        "sim/src/sim/rigid/touch.rs",
        "scene/src/testbench/mod.rs",
    ] {
        let source = std::fs::read_to_string(root.join(file)).expect(file);
        let new = switched(&source);
        syn::parse_file(&new.text).unwrap_or_else(|error| panic!("{file}: {error}"));
    }
}
