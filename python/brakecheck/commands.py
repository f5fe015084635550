"""Training, evaluation, search and replay, as functions.

All of them run in Rust on every core, without the interpreter's lock. You stop them
with Ctrl-C. Every ego may be Python: a function of a percept, or a class or an object
with `reset(seed)` and `control(percept)`. With `fork()` searches share prefixes.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from brakecheck import _brakecheck as raw
from brakecheck.errors import InputError
from brakecheck.results import Ado, Replayed, Replays, Rows, Run
from brakecheck.worlds import World

__all__ = ["eval", "export", "replay", "report", "search", "train", "view"]

Path = str | os.PathLike[str]
Worldly = World | str | os.PathLike[str]
Progress = Callable[[str, int, int, list[str]], None]


def train(
    world: Worldly,
    output: Path | None = None,
    *,
    ego: Any = None,
    seed: int | None = None,
    decisions: int | None = None,
    learner: str | None = None,
    per_ado: str | None = None,
    goals: Sequence[str] | None = None,
    against: str = "nominal",
    leave_out: str | None = None,
    plant: str | None = None,
    from_run: Path | None = None,
    bank: Sequence[Path] = (),
    traffic: Path | None = None,
    temperature: float | None = None,
    prior: float | None = None,
    resume: bool = False,
    starts: int = 300,
    jobs: int | None = None,
    progress: Progress | bool | None = None,
    allow_programs: bool = False,
    allow_invalid: float = 0.0,
) -> Run:
    """Trains an ado and keeps it in a run directory, evaluated beside baselines.

    Args:
        world: a world, a `.ron` file, or the name of a shipped world.
        output: the run directory to make, by default `runs/WORLD-SEED`.
        ego: the ego to train against: a name under the world's `reuse`, a RON file
            with a `Change`, or Python.
        seed: of the training and of its test starts, by default 0, or as begun.
        decisions: length of the training, instead of the world's number.
        learner: one of the world's `learners`.
        per_ado: `"independent"` or `"alternating"`: a policy for each ado.
        goals: `"severe"` and `"distinct"` failures to look for, instead of the world's.
        against: `"nominal"`, or `"wide"`: the world's family.
        leave_out: a structure of the family that a wide ado never plays against.
        plant: the physics to train in.
        from_run: a run whose policy is fine-tuned.
        bank: runs and kept failures, of any ego, to learn from.
        traffic: declared traffic that the ado is trained as, given that the ego
            fails: a file with `Traffic(…)`, or `"world"` for the world's own.
        temperature: of an ado of traffic: 1, the default, as the traffic drives
            given that the ego fails, and towards 0 the actions of greatest V.
        prior: power of the law of traffic, from 1, the default, as people drive, to 0:
            all actions that the law allows are equally likely.
        resume: continue an interrupted training in `output`.
        starts: test starts of the closing evaluation.
        jobs: threads, by default one per core, and 1 if Python plays.
        progress: your function of (phase, done, total, remarks). True writes a line
            on stderr, False nothing, None a line on terminals and in notebooks.
        allow_programs: start the programs that files name as egos.
        allow_invalid: share of invalid episodes to tolerate in each row.

    Raises:
        InputError: the request does not fit.
        FaultError: the ego does not run. The message ends with its traceback.
        KeyboardInterrupt: Ctrl-C. The training is kept, and you continue it with `resume`.
    """
    of = World.of(world, allow_programs=allow_programs)
    ego = of.ego if ego is None else ego
    asked = {
        "output": os.fspath(output or os.path.join("runs", f"{of.name}-{seed or 0}")),
        "ego": ego,
        "seed": seed,
        "decisions": decisions,
        "learner": learner,
        "per_ado": per_ado,
        "goals": None if goals is None else list(goals),
        "against": against,
        "leave_out": leave_out,
        "plant": plant,
        "from_run": None if from_run is None else os.fspath(from_run),
        "bank": [os.fspath(path) for path in bank],
        "traffic": None if traffic is None else os.fspath(traffic),
        "temperature": temperature,
        "prior": prior,
        "resume": resume,
        "starts": starts,
    }
    running = _running(jobs, progress, allow_invalid, ego)
    return Run(raw.train_ado(of._nominal, asked, running)["run"])


def eval(
    what: Run | Worldly,
    *,
    ado: Any = None,
    ego: Any = None,
    starts: int = 300,
    seed: int = 0,
    plant: str | None = None,
    search: int | None = None,
    tries: int = 1,
    temperature: float | None = None,
    draws: int = 5,
    runs: int = 0,
    keep: Path | None = None,
    keep_most: int | None = 10,
    as_found: bool = False,
    name: str | None = None,
    jobs: int | None = None,
    progress: Progress | bool | None = None,
    allow_programs: bool = False,
    allow_invalid: float = 0.0,
) -> Rows:
    """Measures an ado on test starts and egos, beside baselines.

    Args:
        what: a run (its trained ado plays), or a world.
        ado: for a run: one or several words of trained, hold, random, constant,
            ..., all. For a world: your callable from observations (float32) to joint
            actions, a policy of Stable-Baselines3, or None for the baselines.
        ego: the ego to test: a name under the world's `reuse`, "all", a RON file
            with a `Change`, the words of a program as a list, or Python.
        starts: test starts to draw.
        seed: of the test starts.
        plant: the physics to test in.
        search: also search with this many switches of action, which gives `recall`.
        tries: also search each start with at most this many runs, which the trained
            ado proposes.
        temperature: also draw the trained ado's actions, the better the likelier.
        draws: draws per start.
        runs: runs from which the ado may learn the ego: at least 10, 100 for
            most egos.
        keep: a directory for counterexamples.
        keep_most: most counterexamples of each ego. None keeps all.
        as_found: keep them as found, without minimizing them.
        name: name of an ado in Python, in the rows.
        jobs, progress, allow_programs, allow_invalid: as for `train`.
    """
    keeping = None
    if keep is not None:
        keeping = {"directory": os.fspath(keep), "most": keep_most, "as_found": as_found}
    is_run = isinstance(what, Run) or (not isinstance(what, World) and os.path.isdir(what))
    if is_run:
        if callable(ado) or hasattr(ado, "predict"):
            raise InputError("a run has an ado of its own: evaluate another one in a world")
        words = ["trained"] if ado is None else [ado] if isinstance(ado, str) else list(ado)
        asked = {
            "run": os.fspath(what),  # type: ignore[arg-type]
            "ego": ego,
            "ados": words,
            "starts": starts,
            "seed": seed,
            "plant": plant,
            "search": search,
            "tries": tries,
            "temperature": temperature,
            "draws": draws,
            "runs": runs,
            "keep": keeping,
            "allow_programs": allow_programs,
        }
        rows = raw.eval_run(asked, _running(jobs, progress, allow_invalid, ego))
        return Rows(rows, what if isinstance(what, Run) else Run(os.fspath(what)))  # type: ignore[arg-type]
    if tries != 1 or runs != 0 or temperature is not None:
        raise InputError(
            "`tries`, `runs` and `temperature` are about the ado of a run: evaluate one"
        )
    # Without this the directory would stay empty, as if nothing failed.
    if ado is None and keep is not None:
        raise InputError("`keep` needs an ado in a world: give one, or use `search`")
    of = World.of(what, plant=plant, allow_programs=allow_programs)
    ego = of.ego if ego is None else ego
    met = {
        "ado": _acting(ado),
        "name": name or _named(ado),
        "ego": ego,
        "starts": starts,
        "seed": seed,
        "switches": search,
        "keep": keeping,
    }
    played = ado if ado is not None else ego
    return Rows(raw.eval_world(of._nominal, met, _running(jobs, progress, allow_invalid, played)))


def search(
    world: Worldly,
    *,
    ego: Any = None,
    method: str | None = None,
    switches: int | None = None,
    budget: int | None = None,
    guided: Run | Path | None = None,
    starts: int = 300,
    seed: int = 0,
    plant: str | None = None,
    keep: Path | None = None,
    keep_most: int | None = 10,
    as_found: bool = False,
    jobs: int | None = None,
    progress: Progress | bool | None = None,
    allow_programs: bool = False,
    allow_invalid: float = 0.0,
) -> Rows:
    """Searches action sequences from each start.

    You need no training, and get the starts from which the ego can fail.

    Args:
        world: a world, a `.ron` file, or the name of a shipped world.
        method: choice of sequences: switches, uniform, hold, cem, or guided.
            The default is guided if you give a run in `guided`, and switches otherwise.
        switches: most changes of the action, for the method switches: 2 by default,
            and 1 for programs and egos in Python.
        budget: simulations per start for all other methods, 20 if guided, else 100.
        guided: the run whose trained policy proposes sequences, for the method guided.
        ego, starts, seed, plant, keep, keep_most, as_found: as for `eval`.
        jobs, progress, allow_programs, allow_invalid: as for `train`.
    """
    of = World.of(world, plant=plant, allow_programs=allow_programs)
    ego = of.ego if ego is None else ego
    keeping = None
    if keep is not None:
        keeping = {"directory": os.fspath(keep), "most": keep_most, "as_found": as_found}
    usual = "switches" if guided is None else "guided"
    asked = {
        "ego": ego,
        "method": usual if method is None else method,
        "switches": switches,
        "budget": budget,
        "guided": None if guided is None else os.fspath(guided),
        "starts": starts,
        "seed": seed,
        "keep": keeping,
    }
    return Rows(raw.search_world(of._nominal, asked, _running(jobs, progress, allow_invalid, ego)))


def replay(
    path: Run | Path,
    *,
    ego: Any = None,
    episode: str | int | None = None,
    allow_programs: bool = False,
    allow_invalid: float = 0.0,
) -> Replays:
    """Plays kept counterexamples again: as recorded, or against another ego.

    Your regression test has four lines:

        def test_my_controller_survives_what_broke_it():
            replayed = brakecheck.replay("regressions", ego=MyController)
            assert not [one.path for one in replayed if one.still_fails]
            assert [one for one in replayed if one.no_answer is None]

    Args:
        path: a kept file, a directory of them, or a run.
        ego: the ego to put in the place of the recorded ego.
        episode: a single counterexample: its number, from 0, or the name of its file.
        allow_programs, allow_invalid: as for `train`.
    """
    asked = {
        "path": os.fspath(path),
        "episode": None if episode is None else str(episode),
        "ego": ego,
        "allow_programs": allow_programs,
    }
    running = _running(None, False, allow_invalid, ego)
    return Replays(Replayed(one) for one in raw.replay_kept(asked, running))


def view(
    what: Replayed | Run | Path,
    output: Path | None = None,
    *,
    episode: str | int = 0,
    ego: Any = None,
    beside: str | None = None,
) -> str:
    """Writes a kept counterexample as a recording or as a picture, and returns the file.

    Args:
        what: a replayed counterexample, a kept file, a directory of them, or a run.
        output: a `.rrd` for the rerun viewer, a `.svg` for any browser, a `.gif`
            for a loop, or a `.png` for a still. The default is a recording named
            after the counterexample.
        episode: its number or name, if there are several.
        ego: the ego to put in the place of the recorded ego.
        beside: in a picture, the reference driver to draw beside the ego, such
            as "FSM".
    """
    if isinstance(what, Replayed):
        return what.view(output, beside=beside)
    single = os.path.isfile(what)
    found = replay(what, ego=ego, episode=None if single else episode)
    if not found:
        raise InputError(f"`{os.fspath(what)}` holds no kept counterexample")
    return found[0].view(output, beside=beside)


def report(
    run: Run | Path,
    output: Path | None = None,
    *,
    starts: int = 300,
    seed: int = 0,
    jobs: int | None = None,
    progress: Progress | bool | None = None,
) -> str:
    """Writes an HTML page about a run and JUnit XML beside it, and returns the page's file."""
    out = None if output is None else os.fspath(output)
    running = _running(jobs, progress, 0.0, None)
    page, _ = raw.report_run(os.fspath(run), out, (starts, seed), running)
    return os.fspath(page)


def export(path: Run | Path, directory: Path) -> list[str]:
    """Writes kept counterexamples as OpenSCENARIO and OpenDRIVE, and returns the files."""
    return [os.fspath(file) for file in raw.export_kept(os.fspath(path), os.fspath(directory))]


def _acting(ado: Any) -> Callable[..., Any] | None:
    """Returns a function from observations to actions, for any kind of policy."""
    if ado is None:
        return None
    if isinstance(ado, Ado) or not hasattr(ado, "predict"):
        if not callable(ado):
            raise InputError(f"{ado!r} is no ado: give a callable from observations to actions")
        return ado  # type: ignore[no-any-return]
    return lambda obs: ado.predict(obs, deterministic=True)[0]


def _named(ado: Any) -> str:
    return getattr(ado, "__name__", None) or type(ado).__name__


def _running(
    jobs: int | None, progress: Progress | bool | None, allow_invalid: float, played: Any
) -> dict[str, Any]:
    if jobs is None:
        # Threads would only wait for the interpreter's lock.
        jobs = 0 if played is None or isinstance(played, str | list) else 1
    if jobs < 0:
        raise InputError("`jobs` is a number of threads: 1 or more, or None for one per core")
    # NaN would compare with no share of faults, and so tolerate all of them.
    if not 0.0 <= allow_invalid <= 1.0:
        raise InputError("`allow_invalid` is a share: a number from 0 to 1, such as 0.05")
    if progress is None:
        progress = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    shown: Progress | None = _Line() if progress is True else progress or None
    return {"jobs": jobs, "progress": shown, "allow_invalid": allow_invalid}


class _Line:
    """Progress on a single line of stderr, which overwrites itself."""

    def __init__(self) -> None:
        self._last = ""

    def __call__(self, phase: str, done: int, total: int, remarks: list[str]) -> None:
        for remark in remarks:
            self._write(remark, "\n")
        share = f" {done:,} of {total:,}" if total else ""
        text = f"{phase}{share}".strip()
        if text != self._last:
            self._write(text, "\n" if total and done >= total else "")
            self._last = text

    def _write(self, text: str, end: str) -> None:
        sys.stderr.write(f"\r{text:<{len(self._last)}}{end}")
        sys.stderr.flush()
