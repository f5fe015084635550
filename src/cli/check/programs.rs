//! Programs as egos: those that a world names, and one that was typed.

use serde::Serialize;
use serde_json::json;

use super::super::common::{print_json, table_of};
use super::super::failure::{Exit, Failure};
use super::super::terminal;
use crate::ego::{DOCUMENT, Exercise, Fault, FaultKind, Finding, Hello, Process, exercise};
use crate::visible::command_line;
use crate::world::Scenario;

/// Program that a world names, with its answers.
#[derive(Serialize)]
pub(super) struct ProgramCheck {
    ego: String,
    command: Vec<String>,
    started: bool,
    hello: Option<Hello>,
    fault: Option<Fault>,
    /// First requirement that the program violates.
    wrong: Option<Finding>,
}

/// Starts and tests the programs of a world, if you consented.
pub(super) fn tried(scenario: &Scenario, allowed: bool) -> Vec<ProgramCheck> {
    let programs = scenario.programs().into_iter();
    programs
        .map(|(ego, process)| {
            let mut process = process.clone();
            // A program from a file has no consent of its own.
            process.allow(allowed);
            let done = allowed.then(|| exercise(&process));
            let mut findings = done.iter().flat_map(|done| &done.findings);
            // Later findings often follow from the first, so only that one is reported.
            let wrong = findings.find(|found| !found.passed).cloned();
            ProgramCheck {
                ego: ego.to_owned(),
                command: process.command,
                started: allowed,
                hello: done.as_ref().and_then(|done| done.hello.clone()),
                fault: done.and_then(|done| done.fault),
                wrong,
            }
        })
        .collect()
}

/// Formats the results in lines, empty if the world names no program.
pub(super) fn text(named: &[ProgramCheck]) -> String {
    let mut text = String::new();
    for one in named {
        let (ego, command) = (&one.ego, command_line(&one.command));
        let said = match (&one.hello, &one.fault, &one.wrong) {
            // A fault explains the findings after it.
            (_, Some(fault), _) => format!("{}: {fault}", fault.kind.word()),
            (_, None, Some(wrong)) => format!("WRONG: it {}: {}", wrong.what, wrong.note),
            (Some(hello), None, None) => said(hello),
            (None, None, None) => "not started: `--allow-programs` starts it".to_owned(),
        };
        text.push_str(&format!("\nprogram        {ego}: `{command}`: {said}"));
    }
    text
}

fn said(hello: &Hello) -> String {
    let name = if hello.name.is_empty() {
        "it"
    } else {
        &hello.name
    };
    let can = if hello.capabilities.is_empty() {
        String::new()
    } else {
        format!(", capabilities: {}", hello.capabilities.join(", "))
    };
    format!("{name} speaks ego protocol {}{can}", hello.protocol)
}

/// The first program that did not answer as it should.
pub(super) fn first_fault(named: &[ProgramCheck]) -> Option<Failure> {
    named.iter().find_map(|one| match (&one.fault, &one.wrong) {
        (Some(fault), _) => Some(failure(&one.command, fault)),
        (None, Some(wrong)) => Some(unkept(&one.command, wrong)),
        (None, None) => None,
    })
}

fn failure(command: &[String], fault: &Fault) -> Failure {
    let stderr = if fault.stderr.is_empty() {
        String::new()
    } else {
        format!("its stderr ends:\n{}\n", fault.stderr)
    };
    Failure::fault(
        format!(
            "the program `{}`: {}: {fault}",
            command_line(command),
            fault.kind.word()
        ),
        Some(match fault.kind {
            FaultKind::CannotStart => {
                format!("{stderr}check its name and path, and that it may be executed")
            }
            _ => format!("{stderr}see {DOCUMENT} for the messages that it must answer"),
        }),
    )
}

/// Tries a typed program against the protocol: typing it is consent.
pub(super) fn try_out(as_json: bool, command: &[String]) -> Result<Exit, Failure> {
    let mut process = Process::new(command);
    process.allow(true);
    if !as_json {
        // Without this line a slow program looks like a hung command.
        terminal::note("playing episodes with the program: a minute, if an answer takes it 10 ms");
    }
    let done = exercise(&process);
    // All findings are printed first: those that passed show how far it gets.
    if as_json {
        print_json(&json!({
            "ok": done.passed(),
            "hello": done.hello,
            "findings": done.findings,
            "deterministic": done.deterministic,
            "unrepeatable": done.unrepeatable,
            "steps_per_s": done.steps_per_s,
            "fault": done.fault,
        }))
    } else {
        terminal::data(&findings(&done))
    }?;
    let wrong = done.findings.iter().find(|found| !found.passed);
    match (&done.fault, wrong) {
        (Some(fault), _) => Err(failure(command, fault)),
        (None, Some(wrong)) => Err(unkept(command, wrong)),
        (None, None) => Ok(Exit::Done),
    }
}

fn unkept(command: &[String], wrong: &Finding) -> Failure {
    Failure::fault(
        format!(
            "the program `{}` does not do this: it {} ({})",
            command_line(command),
            wrong.what,
            wrong.note
        ),
        Some(format!("see {DOCUMENT}")),
    )
}

fn findings(done: &Exercise) -> String {
    let reason = done.unrepeatable.as_ref().map(|it| it.message.as_str());
    let lines = done.findings.iter().map(|found| {
        let mark = if !found.passed {
            "WRONG"
        } else if reason == Some(found.note.as_str()) {
            // Worlds with `repeats` test such a program, and others refuse its rows.
            "random"
        } else {
            "ok"
        };
        [mark.to_owned(), found.what.clone(), found.note.clone()]
    });
    let table = table_of(["", "the program", "seen"], lines);
    match &done.hello {
        Some(hello) => format!("{}\n{table}", said(hello)),
        None => "it did not say hello".to_owned(),
    }
}
