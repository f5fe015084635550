//! Help, completions and manual pages.

use std::process::Command as Process;

use super::program::{code, run_with, scratch, stderr};
use super::{brakecheck, root};

/// Most lines of the help of a verb.
const MOST_LINES: usize = 40;

fn stdout(args: &[&str]) -> String {
    stdout_at("100", args)
}

fn stdout_at(columns: &str, args: &[&str]) -> String {
    let output = run_with(root(), &[("NO_COLOR", "1"), ("COLUMNS", columns)], args);
    assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Returns the verbs in the help of the program, with those of campaigns.
pub fn verbs() -> Vec<Vec<String>> {
    let help = stdout(&["--help"]);
    let (list, _) = help.split_once("\nOptions:").expect("options");
    let lines = list.lines().filter_map(|line| line.strip_prefix("  "));
    let names = lines.filter_map(|line| line.split(' ').next());
    let of_campaigns = ["plan", "run", "merge"].map(|step| vec!["campaign".into(), step.into()]);
    names
        .map(|name| vec![name.to_owned()])
        .chain(of_campaigns)
        .collect()
}

#[test]
fn the_help_of_each_verb_fits_a_screen_at_any_width() {
    let verbs = verbs();
    assert!(verbs.len() > 20, "{verbs:?}");
    let all = verbs.into_iter().chain([Vec::new()]);
    for verb in all {
        for columns in ["100", "80"] {
            for option in ["-h", "--help"] {
                let words = verb.iter().map(String::as_str).chain([option]);
                let help = stdout_at(columns, &words.collect::<Vec<_>>());
                let lines = help.lines().count();
                assert!(
                    lines <= MOST_LINES,
                    "{verb:?} {columns}: {lines} lines\n{help}"
                );
                // A usage is never broken.
                let wrapped = help.lines().filter(|line| !line.starts_with("Usage:"));
                let widest = wrapped.map(|line| line.chars().count()).max();
                let most = columns.parse().expect("a number");
                assert!(
                    widest <= Some(most),
                    "{verb:?} {columns}: {widest:?}\n{help}"
                );
            }
        }
    }
}

#[test]
fn the_other_options_are_in_the_help_of_all() {
    let (short, all) = (stdout(&["search", "-h"]), stdout(&["search", "--help-all"]));
    for option in [
        "--natural",
        "--allow-invalid",
        "--color",
        "--json",
        "--quiet",
    ] {
        assert!(!short.contains(option), "{option}: {short}");
        assert!(all.contains(option), "{option}: {all}");
    }
    for heading in ["Ados and traffic:", "Test:", "Output:", "Running:"] {
        assert!(all.contains(heading), "{heading}: {all}");
    }
    assert!(all.contains("most=N:"), "the long help of `--keep`: {all}");
    assert_eq!(stdout(&["help", "search"]), stdout(&["search", "--help"]));
    assert_eq!(stdout(&["help"]), stdout(&["--help"]));
    assert!(stdout(&["--help-all"]).contains("Exit codes:"));
}

#[test]
fn a_help_is_printed_beside_a_broken_file_with_defaults() {
    let dir = scratch();
    std::fs::write(dir.path().join("brakecheck.toml"), "jobs = ").expect("written");
    let output = run_with(dir.path(), &[], &["search", "--help"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = run_with(dir.path(), &[], &["check", "acc"]);
    assert_eq!(code(&output), 2);
    assert!(
        stderr(&output).contains("brakecheck.toml:1:"),
        "{}",
        stderr(&output)
    );
}

/// Completes the last of some words in bash.
#[cfg(unix)]
fn completed(script: &str, words: &[&str]) -> Vec<String> {
    let line = words.join(" ");
    let quoted: Vec<String> = words.iter().map(|word| format!("'{word}'")).collect();
    let program = format!(
        "{script}\nCOMP_WORDS=({}); COMP_CWORD={}; COMP_LINE='{line}'; COMP_POINT={}\n\
         _brakecheck brakecheck '{}' '{}'\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"",
        quoted.join(" "),
        words.len() - 1,
        line.len(),
        words.last().expect("a word"),
        words[words.len() - 2],
    );
    let output = Process::new("bash").args(["-c", &program]).output();
    let output = output.expect("bash runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().map(str::to_owned).collect()
}

#[cfg(unix)]
#[test]
fn bash_completes_verbs_options_and_values() {
    let script = stdout(&["completions", "bash"]);
    for (words, completion) in [
        (&["brakecheck", "sea"][..], "search"),
        (
            &["brakecheck", "search", "--fail"],
            "--fail-on-counterexample",
        ),
        (&["brakecheck", "search", "--natu"], "--natural"),
        (&["brakecheck", "search", "--plant", "ki"], "kinematic"),
        (&["brakecheck", "campaign", "me"], "merge"),
        (&["brakecheck", "--color", "al"], "always"),
    ] {
        let found = completed(&script, words);
        assert_eq!(found, [completion], "{words:?}");
    }
}

#[test]
fn each_shell_has_completions() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = stdout(&["completions", shell]);
        assert!(
            script.contains("fail-on-counterexample"),
            "{shell}: {script}"
        );
    }
    let output = brakecheck(&["completions", "fihs"]);
    assert_eq!(code(&output), 2);
    assert!(stderr(&output).contains("'fish'"), "{}", stderr(&output));
}

#[test]
fn each_verb_has_a_manual_page_that_groff_renders() {
    let dir = scratch();
    let pages = dir.path().join("man1");
    stdout(&["man", "-o", &pages.display().to_string()]);
    let names = verbs().into_iter().map(|verb| verb.join("-"));
    let all = names.map(|name| format!("brakecheck-{name}.1"));
    for name in all.chain(["brakecheck.1".to_owned()]) {
        let file = pages.join(&name);
        let page = std::fs::read_to_string(&file).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(page.contains(".SH NAME"), "{name}: {page}");
        let groff = Process::new("groff")
            .args(["-Kutf8", "-man", "-Tutf8", "-P-cbou"])
            .arg(&file)
            .output();
        // A machine may lack it.
        let Ok(rendered) = groff else { continue };
        let said = String::from_utf8_lossy(&rendered.stderr);
        assert!(rendered.status.success(), "{name}: {said}");
        let text = String::from_utf8_lossy(&rendered.stdout);
        assert!(text.contains("NAME"), "{name}: {text}");
    }
    assert!(
        stdout(&["man"]).starts_with(".ie"),
        "the page of the program"
    );
}
