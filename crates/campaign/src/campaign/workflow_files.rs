//! Files for external engines: Snakemake and a plain Slurm array.

use super::piece::name_of;
use super::plan::{Plan, Work};

/// Writes a Snakefile for Snakemake 8 or later that runs, retries and merges the pieces.
pub(super) fn snakefile(plan: &Plan) -> String {
    let (trainings, pieces) = (plan.trainings.len(), plan.len());
    let mut needs = String::new();
    for (first, last, training) in needs_of(plan) {
        needs.push_str(&format!("    ({first}, {last}, {training}),\n"));
    }
    let example = name_of(1234);
    format!(
        r#"# Written by `brakecheck campaign plan`. In this directory:
#
#   snakemake --cores 2 --rerun-incomplete --keep-going
#
# A piece is one file and is made again only if it is not there; the merge runs
# each time and believes no file. Executors take the same rules to Slurm and
# Kubernetes: `snakemake --executor slurm --jobs 100 ...`. With `--config container=IMAGE
# --software-deployment-method apptainer` they run in an image that has brakecheck.

PROGRAM = config.get("brakecheck", "brakecheck")
# Such as --allow-programs.
OPTIONS = config.get("options", "")
if "container" in config:
    container: config["container"]

PIECES = {pieces}
# Pieces from, to, and the training that they wait for: pieces 0 to {trainings}.
NEEDS = [
{needs}]


def path(piece):  # {example}
    return f"pieces/{{piece // 1000:03}}/{{piece:06}}.jsonl"


def waits_for(wildcards):
    piece = int(wildcards.piece)
    return [path(training) for first, last, training in NEEDS if first <= piece < last]


rule merge:
    input:
        [path(piece) for piece in range(PIECES)],
    shell:
        "{{PROGRAM}} campaign merge . {{OPTIONS}}"


rule piece:
    input:
        waits_for,
    output:
        "pieces/{{thousand}}/{{piece}}.jsonl",
    wildcard_constraints:
        piece=r"\d+",
    retries: 2
    threads: 1
    shell:
        "{{PROGRAM}} campaign run . --piece {{wildcards.piece}} --jobs {{threads}} {{OPTIONS}}"
"#
    )
}

/// Returns the dependencies of pieces on trainings: from, to, training.
fn needs_of(plan: &Plan) -> Vec<(usize, usize, usize)> {
    let mut needs: Vec<(usize, usize, usize)> = Vec::new();
    for piece in plan.pieces() {
        let Work::Starts { unit, .. } = piece.work else {
            continue;
        };
        let Some(training) = plan.units[unit].ado.training else {
            continue;
        };
        match needs.last_mut() {
            // Consecutive pieces with the same training are joined, so the list stays short.
            Some((_, last, known)) if (*last, *known) == (piece.number, training) => *last += 1,
            _ => needs.push((piece.number, piece.number + 1, training)),
        }
    }
    needs
}

/// Writes a Slurm array script with a task per piece.
pub(super) fn slurm(plan: &Plan) -> String {
    let (trainings, pieces) = (plan.trainings.len(), plan.len());
    // Ranges of Slurm include their end.
    let (last, first) = (pieces.saturating_sub(1), trainings);
    let submit = match trainings {
        0 => format!("#   pieces=$(sbatch --parsable --array=0-{last} slurm.sh)\n"),
        // Pieces with trained ados must wait for all trainings.
        some => format!(
            "#   trainings=$(sbatch --parsable --array=0-{} slurm.sh)\n\
             #   pieces=$(sbatch --parsable --dependency=afterok:$trainings --array={first}-{last} slurm.sh)\n",
            some - 1
        ),
    };
    format!(
        r#"#!/bin/sh
# Written by `brakecheck campaign plan`. In this directory:
#
{submit}#   sbatch --dependency=afterany:$pieces --wrap 'brakecheck campaign merge .'
#
# Where arrays are shorter than the campaign (`scontrol show config | grep
# MaxArraySize`), submit several with FIRST=1000, FIRST=2000, ... exported: it is
# added to the number of the task. What was preempted is made again by the same
# lines; what is there is left alone.
#SBATCH --job-name=brakecheck
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --output=/dev/null
cd "${{SLURM_SUBMIT_DIR:-.}}" || exit 3
exec brakecheck campaign run . --piece "$(( ${{FIRST:-0}} + SLURM_ARRAY_TASK_ID ))" --jobs 1
"#
    )
}
