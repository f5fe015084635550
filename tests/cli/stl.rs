//! `brakecheck stl` on the shared vectors, and on what users get wrong.

use std::io::Write;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use super::{code, json, refusal, stderr};

fn stl(args: &[&str], csv: &str) -> Output {
    let mut child = Command::new(assert_cmd::cargo::cargo_bin("brakecheck"))
        .arg("stl")
        .args(args)
        .args(["--trace", "-"])
        .env("NO_COLOR", "1")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let mut input = child.stdin.take().expect("piped");
    // A program that refuses its arguments may not read its input.
    let _ = input.write_all(csv.as_bytes());
    drop(input);
    child.wait_with_output().expect("it ends")
}

fn number(value: &Value) -> f64 {
    match value.as_str() {
        Some(word) => word.parse().expect("inf or -inf"),
        None => value.as_f64().expect("a number"),
    }
}

fn vectors(text: &str, rho: &str, more: &[&str]) {
    for line in text.lines() {
        let case: Value = serde_json::from_str(line).expect("a vector");
        let trace = case["trace"].as_object().expect("signals");
        let names: Vec<&str> = trace.keys().map(String::as_str).collect();
        let mut csv = names.join(",");
        for i in 0..case["n"].as_u64().expect("n") as usize {
            let row = names.iter().map(|name| trace[*name][i].to_string());
            csv.push_str(&format!("\n{}", row.collect::<Vec<_>>().join(",")));
        }
        let formula = case["formula"].as_str().expect("a formula");
        let dt = case["dt"].to_string();
        let mut args = vec![formula, "--dt", &dt, "--json", "--all"];
        args.extend(more);
        let output = stl(&args, &csv);
        assert_eq!(code(&output), 0, "{formula}: {}", stderr(&output));
        let got = json(&output);
        let got = got["robustness_all"].as_array().expect("all of them");
        let expect = case[rho].as_array().expect("all of them");
        assert_eq!(got.len(), expect.len(), "{formula}");
        for (got, expect) in got.iter().zip(expect) {
            let (got, expect) = (number(got), number(expect));
            let near = (got - expect).abs() <= 1e-9 * expect.abs().max(1.0);
            assert!(got == expect || near, "{formula}: {got} for {expect}");
        }
    }
}

#[test]
fn the_agreed_vectors_pass_through_the_program() {
    vectors(include_str!("../stl/agreed.jsonl"), "rho", &[]);
}

#[test]
fn both_readings_of_until_pass_through_the_program() {
    let text = include_str!("../stl/until_halfopen.jsonl");
    vectors(text, "rho", &[]);
    vectors(text, "rho_closed", &["--until", "closed"]);
}

#[test]
fn a_trace_is_measured_and_explained() {
    let csv = "time,headway\n0,9\n0.5,4.2\n1,5\n";
    let args = [
        "always[0, T] (headway >= d_safe)",
        "--const",
        "d_safe=4.7",
        "--const",
        "T=1",
    ];
    let output = stl(&[&args[..], &["--json", "--explain"]].concat(), csv);
    let got = json(&output);
    assert_eq!(got["robustness"], -0.5);
    assert_eq!(got["satisfied"], false);
    assert_eq!(got["explain"]["path"][1]["sample"], 1);
    let with_unit = csv.replace("time,", "time [s],");
    let output = stl(&[&args[..], &["--json"]].concat(), &with_unit);
    assert_eq!(json(&output)["robustness"], -0.5);
    let output = stl(&[&args[..], &["--fail-on-counterexample"]].concat(), csv);
    assert_eq!(code(&output), 1);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "-0.5\n");
    // Infinite robustness is a word in JSON.
    let output = stl(&["eventually[5, 6] (headway > 0)", "--json"], csv);
    assert_eq!(json(&output)["robustness"], "-inf");
}

/// At ρ = 0 the library decides, here as everywhere.
#[test]
fn a_tie_is_settled_by_the_comparison() {
    let csv = "time,headway\n0,9\n0.5,10\n";
    let cases = [
        ("headway >= 9", true),
        ("headway > 9", false),
        ("always (headway > 9)", false),
        ("not (headway > 9)", true),
        ("headway == 9", true),
        ("headway != 9", false),
    ];
    for (formula, satisfied) in cases {
        let output = stl(&[formula, "--json", "--fail-on-counterexample"], csv);
        let got = json(&output);
        assert_eq!(got["robustness"], 0.0, "{formula}");
        assert_eq!(got["satisfied"], satisfied, "{formula}");
        assert_eq!(code(&output), i32::from(!satisfied), "{formula}");
        let output = stl(&[formula, "--fail-on-counterexample"], csv);
        assert_eq!(String::from_utf8_lossy(&output.stdout), "0\n", "{formula}");
        assert_eq!(code(&output), i32::from(!satisfied), "{formula}");
        let word = if satisfied { "satisfied" } else { "violated" };
        assert!(
            stderr(&output).contains(&format!("{word}, ρ = 0")),
            "{formula}"
        );
    }
}

#[test]
fn what_users_get_wrong_exits_with_2_and_is_named() {
    let good = "t,x,y\n0,1,2\n1,3,4\n";
    let cases: [(&[&str], &str, &str); 16] = [
        (&["always (z > 0)"], good, "z"),
        (&["always (x > "], good, "formula:1:"),
        (&["always[0, 0.5] (x > 0)"], good, "neighbours"),
        (&["x > 0"], "t,x\n0,1\n1,NaN\n", "line 3, column `x`"),
        (&["x > 0"], "t,x,y\n0,1\n", "2 values for 3 columns"),
        // Without a time column, the period is a guess.
        (&["x > 0"], "x,y\n1,2\n", "--time NAME"),
        (&["x > 0"], "t,x\n0,1\n1,2\n5,3\n", "uneven"),
        (&["x > 0"], "", "empty"),
        (&["x > 0", "--dt", "0"], good, "sampling period"),
        (&["x > c", "--const", "c"], good, "NAME=NUMBER"),
        (&["x > c", "--const", "c=nan"], good, "named constant"),
        (
            &["x > c", "--const", "c=1", "--const", " c =2"],
            good,
            "the constant `c` is there twice",
        ),
        (&["x > 0", "--const", "x=1"], good, "`x` is a signal"),
        (&["x > 0", "--const", "=1"], good, "the constant ``"),
        (
            &["x > 0", "--const", "a b=1"],
            good,
            "nothing uses the constant `a b`",
        ),
        (&["x in [5, 1]"], good, "no number lies in [5, 1]"),
    ];
    for (args, csv, says) in cases {
        let said = refusal(&stl(args, csv), says);
        assert!(!said.contains("panicked"), "{said}");
    }
}
