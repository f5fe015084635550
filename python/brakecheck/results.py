"""Rows, runs, trained ados and replayed counterexamples."""

from __future__ import annotations

import base64
import html
import os
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brakecheck._brakecheck import RawReplayed, RawRun
from brakecheck.errors import InputError
from brakecheck.exporting import export_policy
from brakecheck.worlds import World

__all__ = ["Ado", "Replayed", "Replays", "Row", "Rows", "Run"]


def _html_table(head: Iterable[str], body: Iterable[Iterable[str]]) -> str:
    """Returns a table for notebooks, with escaped texts."""

    def line(tag: str, cells: Iterable[str]) -> str:
        return "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells)

    rows = "".join(f"<tr>{line('td', cells)}</tr>" for cells in body)
    return f"<table><tr>{line('th', head)}</tr>{rows}</table>"


class Row(dict[str, Any]):
    """Result of an ego and an ado, with the keys of `brakecheck eval --json`."""

    #: Columns of a table.
    COLUMNS = ("ego", "ado", "method", "starts", "success", "95 %", "recall", "foul")

    def _cells(self) -> list[str]:
        interval, partial = self["ci95"], self.get("partial")
        recall = self.get("recall")
        success = f"{100 * self['success_rate']:.1f} %"
        if partial is not None:
            # Of an interrupted row only the least success is known.
            success = f"at least {self['successes']}/{partial['of']}"
        return [
            self["ego"],
            self["ado"],
            self["method"],
            str(self["starts"]),
            success,
            "-" if interval is None else "-".join(f"{100 * it:.1f}" for it in interval),
            "-" if recall is None else f"{100 * recall:.1f} %",
            f"{100 * self['foul_rate']:.1f} %",
        ]

    def _repr_html_(self) -> str:
        if "success_rate" in self:
            return _html_table(self.COLUMNS, [self._cells()])
        # Verbs without starts, such as `risk`, have rows of other keys.
        return _html_table(["key", "value"], [[key, str(self[key])] for key in self])


class Rows(list[Row]):
    """Result of an evaluation or a search: a row per ego and ado.

    The keys are those of `brakecheck eval --json`: `success_rate` with `ci95`,
    `starts`, `recall`, `foul_rate`, `contact_rate`, `solved` per start, and so on.
    """

    def __init__(self, rows: Iterable[dict[str, Any]] = (), run: Run | None = None) -> None:
        super().__init__(Row(row) if isinstance(row, dict) else row for row in rows)
        #: The run of the ado, if it has one.
        self.run = run

    def row(self, ado: str = "trained", ego: str | None = None) -> Row:
        """Returns the first row of an ado, and of an ego if you name it."""
        for row in self:
            if row["ado"] == ado and ego in (None, row["ego"]):
                return row
        known = ", ".join(sorted({row["ado"] for row in self}))
        raise InputError(f"there is no row of the ado `{ado}`; there are: {known}")

    def to_pandas(self) -> Any:
        """Returns a pandas data frame, a line per row."""
        import pandas

        return pandas.DataFrame(list(self))

    def to_polars(self) -> Any:
        """Returns a polars data frame, a line per row, without nested values."""
        import polars

        flat = [
            {key: value for key, value in row.items() if not isinstance(value, dict | list)}
            for row in self
        ]
        return polars.DataFrame(flat)

    def __repr__(self) -> str:
        table = [list(Row.COLUMNS), *(row._cells() for row in self)]
        widths = [max(map(len, column)) for column in zip(*table)]
        lines = ("  ".join(map(str.ljust, line, widths)).rstrip() for line in table)
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return _html_table(Row.COLUMNS, [row._cells() for row in self])


class Run:
    """A run directory, as `train` makes it.

    Args:
        path: of the directory.

    Raises:
        InputError: there is no run.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = os.fspath(path)
        self._raw = RawRun(self.path)

    @property
    def manifest(self) -> dict[str, Any]:
        """The manifest: world, seed, learner, decisions, hashes."""
        return self._raw.manifest()

    @property
    def rows(self) -> Rows:
        """The rows of its closing evaluation."""
        return Rows(self._raw.rows(), self)

    @property
    def progress(self) -> list[dict[str, Any]]:
        """Reports of the learner, line by line."""
        return self._raw.progress()

    def world(self) -> World:
        """Returns the world of the training, on its plant."""
        plant = str(self.manifest["plant"]).lower()
        file = os.path.join(self.path, "world.ron")
        return World(file, plant=None if plant == "cells" else plant)

    def __fspath__(self) -> str:
        return self.path

    def __repr__(self) -> str:
        manifest = self.manifest
        return f"<Run {self.path!r}: world {manifest['world']!r}, seed {manifest['seed']}>"


class Ado:
    """A trained ado for any simulator.

    Call it with an observation of an environment. In your own simulator, call `decide`
    with signals by name and in their units. `label` returns an action in words.

    Args:
        run: the run, or its path.
    """

    def __init__(self, run: Run | str | os.PathLike[str]) -> None:
        self.run = run if isinstance(run, Run) else Run(run)
        self._raw = self.run._raw.policy()
        self.world = self.run.world()
        #: Its observation: name, unit, and the range that is scaled to −1 .. 1.
        self.observation = self.world.observation
        #: Its actions in words.
        self.actions = self.world.actions

    def __call__(self, obs: ArrayLike) -> int:
        return self._raw.act(np.ascontiguousarray(obs, np.float32))

    def sample(self, obs: ArrayLike, temperature: float, unit: float) -> int:
        """Draws an action with `unit` in [0, 1): the better it is, the likelier.

        Args:
            obs: the observation.
            temperature: divides the values before the softmax. A small value is greedy.
            unit: the random number. Ados with separate policies share it.
        """
        return self._raw.sample(np.ascontiguousarray(obs, np.float32), temperature, unit)

    def value(self, obs: ArrayLike) -> float:
        """Returns the return that it expects from here."""
        return self._raw.value(np.ascontiguousarray(obs, np.float32))

    def observe(self, signals: Mapping[str, float]) -> NDArray[np.float32]:
        """Returns the observation of signals that you give by name, in their units."""
        missing = [one["name"] for one in self.observation if one["name"] not in signals]
        if missing:
            raise InputError(f"the ado also observes: {', '.join(missing)}")
        scaled = []
        for one in self.observation:
            half = (one["high"] - one["low"]) / 2
            middle = (one["high"] + one["low"]) / 2
            scaled.append((float(signals[one["name"]]) - middle) / half)
        return np.array(scaled, np.float32)

    def decide(self, signals: Mapping[str, float]) -> int:
        """Returns its action at these signals."""
        return self(self.observe(signals))

    def label(self, action: int) -> str:
        """Returns an action in words."""
        return self.actions[action]

    def command(self, signals: Mapping[str, float]) -> dict[str, dict[str, Any]]:
        """Returns the command of each ado at these signals, in numbers.

        A vehicle has `accel_mps2` and `lateral_mps`, a pedestrian `along_mps` and
        `left_mps`, a light `advance`. For an ado with a plan they are added to the
        plan, as in the answers of `brakecheck serve`.
        """
        commands: list[dict[str, dict[str, Any]]] = self.world.about["commands"]
        return commands[self.decide(signals)]

    def export(self, directory: str | os.PathLike[str]) -> list[str]:
        """Writes files with which another program can play it, and returns them.

        `policy.safetensors` holds the weights, and `observation.json` the order and
        ranges of the observation and the actions in words. For a network you also get
        `policy.onnx`: `observation` [batch, observed] to `values` [batch, actions]
        and the greedy `action` [batch].
        """
        manifest = self.run.manifest
        described = {
            "world": manifest["world"],
            "scaled": "(value - (low + high) / 2) / ((high - low) / 2)",
            "observation": self.observation,
            "actions": self.actions,
            "decision_s": self.world.about["decision_s"],
            "policy_sha256": manifest["policy_sha256"],
        }
        policy = os.path.join(self.run.path, "policy.safetensors")
        return export_policy(policy, described, os.fspath(directory))

    def __repr__(self) -> str:
        names = ", ".join(one["name"] for one in self.observation)
        return f"<Ado of {self.run.path!r}: sees {names}; {len(self.actions)} actions>"


class Replayed:
    """A kept counterexample, played again. A notebook shows its picture, which plays."""

    def __init__(self, raw: RawReplayed) -> None:
        self._raw = raw
        #: The replay: verdict, robustness, contact, start, actions.
        self.about: dict[str, Any] = raw.about()

    @property
    def path(self) -> str:
        """Path of its file."""
        return str(self.about["path"])

    @property
    def still_fails(self) -> bool:
        """True if the ego still fails."""
        return bool(self.about["still_fails"])

    @property
    def no_answer(self) -> str | None:
        """Rule that an ado broke before the ego failed, else None."""
        why = self.about["no_answer"]
        return None if why is None else str(why)

    @property
    def identical(self) -> bool:
        """True if every sample is as recorded, to the bit."""
        return bool(self.about["identical"])

    def trace(self) -> dict[str, NDArray[np.float64]]:
        """Returns its samples: `time` in seconds, and every signal."""
        return self._raw.trace()

    def view(
        self, output: str | os.PathLike[str] | None = None, *, beside: str | None = None
    ) -> str:
        """Writes a recording (`.rrd`) or a picture (`.svg`, `.gif`, `.png`).

        Returns the file.

        Args:
            output: the file to write, by default a recording named after it.
            beside: the reference driver to draw beside the ego.
        """
        if output is None:
            stem = os.path.splitext(os.path.basename(self.path))[0]
            output = f"{stem}.rrd"
        self._raw.view(os.fspath(output), beside)
        return os.fspath(output)

    def _repr_html_(self) -> str:
        words = f"{self.path}: {self.about['words']}"
        if self.about["fault"] is not None:
            return f"<p>{html.escape(words)}</p>"
        said = html.escape(f"{words}, {self._state()}")
        # As an image, so that the styles of picture and notebook do not mix.
        svg = base64.b64encode(self._raw.picture("svg")).decode("ascii")
        picture = f'<img width="900" alt="{said}" src="data:image/svg+xml;base64,{svg}"/>'
        return f"<figure>{picture}<figcaption>{said}</figcaption></figure>"

    def _repr_png_(self) -> tuple[bytes, dict[str, int]] | None:
        """Returns a still of its end, for documents without HTML."""
        if self.about["fault"] is not None:
            return None
        return self._raw.picture("png"), {"width": 900}

    def _state(self) -> str:
        words = {"still_fails": "still fails", "no_answer": "no answer"}
        state = words.get(str(self.about["outcome"]), "does not fail")
        return state if self.identical else f"{state}, not as recorded"

    def __repr__(self) -> str:
        return f"<Replayed {self.path!r}: {self.about['verdict']}, {self._state()}>"


class Replays(list[Replayed]):
    """Kept counterexamples, played again."""

    def _repr_html_(self) -> str:
        body = [[str(nth), one.path, one.about["words"], one._state()] for nth, one in enumerate(self)]
        return _html_table(["", "file", "outcome", "replay"], body)

    def to_pandas(self) -> Any:
        """Returns a pandas data frame, a line per counterexample. Dots join nested keys."""
        import pandas

        return pandas.json_normalize([one.about for one in self])
