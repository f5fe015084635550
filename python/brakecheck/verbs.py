"""Verbs of the command line: gate, sweep, harden, risk, campaigns.

Each function runs the program of this package in a separate process and reads its
`--json`. You give it the options of `brakecheck VERB --help`, with `_` for `-`.
"""

from __future__ import annotations

import html
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from brakecheck.errors import FaultError, InputError, NotIdenticalError
from brakecheck.results import Rows, Run
from brakecheck.worlds import World

__all__ = [
    "Outcome",
    "coverage",
    "gate",
    "harden",
    "merge",
    "plan",
    "risk",
    "run_piece",
    "sweep",
    "verb",
]

Path = str | os.PathLike[str]
#: A name under the world's `reuse`, a RON file, or the words of a program.
Ego = str | os.PathLike[str] | Sequence[str]

#: Exit codes with a result: done, and a closed gate or a counterexample.
_ANSWERS = (0, 1)
#: Seconds that an interrupted program has to write its results.
_PATIENCE_S = 10.0


class Outcome(Rows):
    """Result of a verb.

    As a list it has the verb's rows, with the keys of `--json`. `about` is the whole
    result, `passed` is True for the exit code 0, and `notes` has the remarks.
    """

    def __init__(self, about: Mapping[str, Any], rows: str, passed: bool, notes: str) -> None:
        found: Any = about
        for key in rows.split("."):
            found = found.get(key) if isinstance(found, Mapping) else None
        super().__init__(found if isinstance(found, list) else [])
        #: All keys of `--json`.
        self.about = dict(about)
        #: False if the gate is closed, or if a counterexample counts as a failure.
        self.passed = passed
        #: Remarks of the program, line by line.
        self.notes = notes

    def __repr__(self) -> str:
        keys = ", ".join(self.about)
        return f"<Outcome: {len(self)} rows, passed={self.passed}, about: {keys}>"

    def _repr_html_(self) -> str:
        try:
            return str(self.to_pandas().to_html())
        except ImportError:
            return f"<pre>{html.escape(repr(self))}</pre>"

    def to_pandas(self) -> Any:
        """Returns a pandas data frame, a line per row. Dots join nested keys."""
        import pandas

        return pandas.json_normalize(list(self))


def verb(name: str, *arguments: Any, rows: str = "rows", **options: Any) -> Outcome:
    """Runs a verb of the command line and returns its result.

    Args:
        name: a verb, such as "risk" or "campaign plan".
        arguments: its arguments without a name: files, worlds, runs, names.
        rows: the key of `--json` with the rows, with a dot between levels.
        options: its options, with `_` for `-`. True gives a switch, False and None
            leave an option out, and a list repeats it. You may give `ego` as the words
            of a program.

    Raises:
        InputError: the program refused the request (exit code 2).
        FaultError: the ego, the disk or the program failed, or the result was refused
            (exit code 3). Its `outcome` has the result, if there is any.
        NotIdenticalError: a replay differs (exit code 4), with an `outcome` too.
        KeyboardInterrupt: Ctrl-C. The program has kept its work.
    """
    program = options.pop("ego", None)
    if program is not None and (isinstance(program, str) or hasattr(program, "__fspath__")):
        options["ego"], program = program, None
    words = [*name.split(), *map(_word, arguments), *_options(options), "--json"]
    if program is not None:
        words += ["--", *_program(program)]
    code, answer, notes = _run(words)
    said = notes.strip() or f"`brakecheck {' '.join(words)}` ended with {code}"
    if not answer.strip():
        raise {2: InputError}.get(code, FaultError)(said)
    outcome = Outcome(json.loads(answer), rows, code == 0, notes)
    if code in _ANSWERS:
        return outcome
    # What was played is no result, but the reasons are in it.
    error = {4: NotIdenticalError}.get(code, FaultError)(said)
    error.outcome = outcome
    raise error


def gate(run: Run | Path, baseline: str, *, ego: Ego | None = None, **options: Any) -> Outcome:
    """Compares an ego with an earlier one, start by start, under the ado of a run.

    Args:
        run: the run whose ado plays.
        baseline: the earlier ego: a name under the world's `reuse`, or a RON file.
        ego: the new ego, by default the world's own.
        options: of `brakecheck gate`, such as `on="preventable"`, `starts=100`.

    Returns:
        The gates, one per new ego. `passed` is False if any is closed.
    """
    return verb("gate", run, rows="gates", ego=ego, baseline_ego=baseline, **options)


def sweep(run: Run | Path, over: str, **options: Any) -> Outcome:
    """Measures a trained ado on an ego over a range of a parameter.

    Args:
        run: the run whose ado plays.
        over: parameter and range, such as `"ego.time_gap_s=0.8..2.0:5"`.
        options: of `brakecheck sweep`.

    Returns:
        The rows per value. `about["swept"]` has the summary.
    """
    return verb("sweep", run, over=over, **options)


def harden(where: World | Run | Path, *, ego: Ego | None = None, **options: Any) -> Outcome:
    """Searches for the smallest change of an ego with which it withstands.

    Args:
        where: a world, or the run of an ado or a population that the ego must withstand.
        ego: the ego to change, by default the world's own.
        options: of `brakecheck harden`, such as `over="ego.time_gap_s=0.3..1.5"`,
            `keep_below=["braking=105%"]`, `output="hardened"`.

    Returns:
        The changes, the smallest first. `passed` is False if none is confirmed.
    """
    return verb("harden", where, rows="candidates", ego=ego, **options)


def risk(world: World | Path, *, ego: Ego | None = None, **options: Any) -> Outcome:
    """Estimates the probability of a failure in declared traffic.

    Args:
        world: a world, a `.ron` file, or the name of a shipped world.
        ego: the ego to test, by default the world's own.
        options: of `brakecheck risk`, such as `traffic="motorway"`, `budget=20_000`.

    Returns:
        The egos. `about` has the traffic, the ratio and the cost.
    """
    return verb("risk", world, rows="egos", ego=ego, **options)


def coverage(path: Run | Path, **options: Any) -> Outcome:
    """Lists the rules, formula parts and starts that episodes never covered.

    Args:
        path: a run, a population, a planned campaign, or a directory of kept crashes.
        options: of `brakecheck coverage`, such as `starts=100`.

    Returns:
        The worlds, each with its `gaps`, `rules`, `parts`, `kinds` and `cells`.
    """
    return verb("coverage", path, rows="coverage", **options)


def plan(campaign: Path, output: Path, **options: Any) -> Outcome:
    """Cuts a campaign file into pieces, kept under `output`."""
    return verb("campaign plan", campaign, output=output, **options)


def run_piece(planned: Path, piece: str | int | None = None, **options: Any) -> Outcome:
    """Makes a piece of a planned campaign, or all missing pieces.

    You may call it from many processes and machines at once, for instance as a task
    of Dask or Ray, if they share the directory.
    """
    return verb("campaign run", planned, piece=piece, **options)


def merge(planned: Path, **options: Any) -> Outcome:
    """Checks all pieces, writes them as one file, and returns the rows of the summary."""
    return verb("campaign merge", planned, rows="summary.rows", **options)




def _options(options: Mapping[str, Any]) -> list[str]:
    words: list[str] = []
    for name, value in options.items():
        flag = f"--{name.rstrip('_').replace('_', '-')}"
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
            continue
        several = value if isinstance(value, list | tuple) else [value]
        # One word each, so that a value with a leading `-` is no option.
        words += [f"{flag}={_word(one)}" for one in several]
    return words


def _word(value: Any) -> str:
    if isinstance(value, World):
        if value.ego is not None or any(value._given[key] for key in ("plant", "natural", "traffic")):
            raise InputError(
                "a verb of the program reads the world's file, so it knows nothing of this "
                "world's `plant`, `ego`, `natural` and `traffic`: give them as options"
            )
        return value.file
    if hasattr(value, "__fspath__"):
        return os.fsdecode(value)
    return str(value)


def _program(ego: Any) -> list[str]:
    if isinstance(ego, list | tuple) and ego and all(isinstance(word, str) for word in ego):
        return list(ego)
    raise InputError(
        f"{ego!r} is no ego for a program: give a name, a RON file, or the words of a program, "
        "such as [sys.executable, 'mine.py'], where mine.py ends with `brakecheck.serve_ego(Mine)`"
    )


def _run(words: Sequence[str]) -> tuple[int, str, str]:
    """Returns exit code, standard output and standard error of the program."""
    command = [sys.executable, "-m", "brakecheck", *words]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, encoding="utf-8",
    ) as process:
        try:
            answer, notes = process.communicate()
        except KeyboardInterrupt:
            # A notebook interrupts this process alone, and the program keeps what is
            # done only if it is told.
            process.send_signal(signal.SIGINT)
            try:
                process.communicate(timeout=_PATIENCE_S)
            except subprocess.TimeoutExpired:
                process.kill()
            raise
    if process.returncode == 130:
        raise KeyboardInterrupt
    return process.returncode, answer, notes
