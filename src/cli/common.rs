//! What several verbs share: worlds and runs with consent, refusals, exit codes, JSON.

use std::path::Path;
use std::str::FromStr;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use serde_json::json;
use strum::{EnumMessage, VariantArray};

use super::defaults::is_plant_default;
use super::display::{message_columns, stdout_columns, theme};
use super::failure::{self, Exit, Failure};
use super::terminal::{self, Common};
use super::world_input::{self, ReadWorld};
use crate::experiment::{NeutralRule, on_plant};
use crate::report::TextTable;
use crate::run_dir::{Row, RunDir, RunError};
use crate::sim::PlantKind;
use crate::world::Scenario;

/// Opens a run, with the consent that was typed.
pub(super) fn open_run(path: &Path, common: &Common) -> Result<RunDir, RunError> {
    let mut run = RunDir::open(path)?;
    run.allow_programs(common.allow_programs);
    if common.fresh {
        run.begin_egos_anew();
    }
    Ok(run)
}

/// Reads a world, with the consent that was typed.
pub(super) fn load_world(path: &Path, common: &Common) -> Result<Scenario, Failure> {
    let ReadWorld { world, files } = world_input::read(path);
    for file in files {
        terminal::detail(&format!("read `{}`", file.display()));
    }
    Ok(with_consent(world?, common))
}

/// Returns a world with the consent that was typed.
pub(super) fn with_consent(world: Scenario, common: &Common) -> Scenario {
    let allowed = world.allow_programs(common.allow_programs);
    if common.fresh {
        allowed.with_fresh_egos()
    } else {
        allowed
    }
}

/// Returns the requested plant, or `None` if it is a default and the world has no plants.
pub(super) fn plant_in(world: &Scenario, plant: Option<PlantKind>) -> Option<PlantKind> {
    // A directory's default must not make every grid world an error.
    plant.filter(|_| world.drive().is_some() || !is_plant_default())
}

/// Returns a world on the plant to test on, if one is requested.
pub(super) fn placed(world: Scenario, plant: Option<PlantKind>) -> Result<Scenario, Failure> {
    match plant_in(&world, plant) {
        Some(plant) => Ok(on_plant(&world, plant)?),
        None => Ok(world),
    }
}

/// Notes odd content of a world, with its place in the file.
pub(super) fn note_warnings(path: &Path, world: &Scenario) {
    let file = path.display().to_string();
    let notes = failure::warnings(&file, &world.text, &world.warnings);
    if !notes.is_empty() {
        // The failure only renders the notes, so its exit code is never used.
        let shown = Failure::of(Exit::Done, notes);
        let text = shown.render(theme(), message_columns());
        terminal::note_rendered(text.trim_end());
    }
    if let Some(broken) = NeutralRule::of(world) {
        terminal::note(&format!("warning: {broken}\n  help: {}", broken.help()));
    }
}

/// Refuses a program after `--` in a verb that takes it from a file only.
pub(super) fn refuse_program(verb: &str, program: &[String]) -> Result<(), Failure> {
    if program.is_empty() {
        return Ok(());
    }
    // RON quotes strings as Rust's `Debug` does.
    let command: Vec<String> = program.iter().map(|word| format!("{word:?}")).collect();
    let change = format!(
        "Change(controller: Process(command: [{}]))",
        command.join(", ")
    );
    let refused = Failure::input(
        format!("`{verb}` takes no program after `--`"),
        "use `--ego FILE.ron --allow-programs`, with this line in FILE.ron:",
    );
    Err(refused.with_command(&change))
}

/// Values of an argument: the words of a list of the library, explained by its
/// documentation.
pub(super) fn one_of<T>() -> impl TypedValueParser<Value = T>
where
    T: VariantArray + FromStr + EnumMessage + Clone + Send + Sync,
    &'static str: for<'a> From<&'a T>,
{
    let values = T::VARIANTS.iter().map(|value| {
        let about = value.get_documentation().unwrap_or_default();
        // Help texts have no full stop, and doc comments have one.
        PossibleValue::new(<&'static str>::from(value)).help(about.trim_end_matches('.'))
    });
    // Invariant: the words are those that are read.
    PossibleValuesParser::new(values).try_map(|word| word.parse().map_err(|_| word))
}

/// A plain table with a header.
pub(super) fn table_of<const N: usize>(
    header: [&str; N],
    lines: impl IntoIterator<Item = [String; N]>,
) -> String {
    TextTable::new(header, lines).to_terminal(stdout_columns())
}

/// Ends a verb that computed nothing, by an interruption or because of the ego.
pub(super) fn interrupted_early(common: &Common) -> Result<Exit, Failure> {
    if terminal::stopped() {
        terminal::note("interrupted before anything was evaluated");
        return Ok(Exit::Interrupted);
    }
    if common.json {
        let faults = common
            .faults()
            .complaint()
            .map(|complaint| complaint.faults);
        // A script that reads JSON gets an object even without a row.
        print_json(&json!({ "rows": [], "faults": faults }))?;
    }
    // Without an interruption, only faults of the ego leave no row.
    Ok(Exit::Fault)
}

/// Message about rows that are left out as a whole.
pub(super) const NO_START: &str =
    "no start was evaluated: the ego fails from all of them without an adversary";

/// Returns whether no row has an evaluated or an invalid start, of which `rows` has the
/// numbers.
///
/// A command without an evaluated start must not look like a pass. Invalid starts are
/// reported as faults ([`Common::refuses`]).
pub(super) fn are_left_out(mut rows: impl Iterator<Item = [usize; 2]>) -> bool {
    rows.all(|[starts, invalid]| starts == 0 && invalid == 0)
}

/// Returns the exit code of a verb that printed rows.
pub(super) fn exit_of(rows: &[Row], fail_on_counterexample: bool) -> Exit {
    // A point from which its own ego fails by itself is a failure, although it is left
    // out.
    let alone = |row: &Row| {
        row.fails_alone
            .is_some_and(|it| it.left_out && it.starts > 0)
    };
    let found = rows.iter().any(|row| row.successes > 0 || alone(row));
    // Missing starts may change the answer, so an interruption takes precedence.
    if terminal::stopped() {
        terminal::note("interrupted: the rows cover the starts that were finished");
        return Exit::Interrupted;
    }
    if found && fail_on_counterexample {
        return Exit::Counterexample;
    }
    if !found && are_left_out(rows.iter().map(|row| [row.starts, row.invalid])) {
        terminal::complain(&format!(
            "{NO_START}; correct the starts of the world (`brakecheck check` has warnings), or \
             test another ego"
        ));
        return Exit::Fault;
    }
    Exit::Done
}

/// Returns the exit code of a verb that may have been interrupted.
pub(super) fn finished(otherwise: Exit) -> Exit {
    if terminal::stopped() {
        Exit::Interrupted
    } else {
        otherwise
    }
}

/// Prints one JSON object on stdout.
pub(super) fn print_json(value: &serde_json::Value) -> Result<(), Failure> {
    terminal::json(&value.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_without_a_valid_start_is_no_result_whatever_is_allowed() {
        for (allow_invalid, share, refused) in [
            (0.0, 0.0, false),
            (0.0, 0.01, true),
            (0.2, 0.2, false),
            (0.2, 0.21, true),
            (1.0, 0.99, false),
            (1.0, 1.0, true),
        ] {
            let common = Common {
                allow_invalid,
                ..Common::default()
            };
            assert_eq!(common.refuses(share), refused, "{share} of {allow_invalid}");
        }
        for (rows, expected) in [
            (vec![[0, 0], [0, 0]], true),
            (vec![[0, 0], [0, 3]], false),
            (vec![[0, 0], [1, 0]], false),
        ] {
            assert_eq!(are_left_out(rows.iter().copied()), expected, "{rows:?}");
        }
    }
}
