"""Signal Temporal Logic over your arrays, without a copy of them.

>>> import numpy as np
>>> from brakecheck.stl import Formula
>>> formula = Formula("always[0, 2] (gap > 1.5)")
>>> formula.robustness({"gap": np.array([3.0, 2.0, 4.0])})
0.5
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brakecheck._brakecheck import RawFormula, RawMonitor
from brakecheck.errors import FormulaError, InputError

__all__ = ["Explanation", "Formula", "FormulaError", "Interval", "Monitor"]


class Interval(NamedTuple):
    """Possible values of the robustness, `low` to `high`."""

    low: float
    high: float

    @property
    def is_final(self) -> bool:
        """True if no further sample can change it."""
        return self.low == self.high


#: Makes an interval of two ends without a call of Python.
_interval = tuple.__new__


@dataclass(frozen=True)
class Explanation:
    """Part of a formula that decides its robustness, with time and value."""

    #: The explained robustness.
    robustness: float
    #: Reason for the end of the explanation.
    reason: str
    #: From the formula to the deciding leaf: formula, sample, time_s, value.
    path: list[dict[str, Any]]
    #: The signals of that leaf at that sample.
    signals: dict[str, float]
    #: The same as text for a terminal.
    text: str

    def __str__(self) -> str:
        return self.text


class Formula:
    """A formula of Signal Temporal Logic.

    Args:
        text: your formula, such as `"always[0, 5] (gap > 2)"`, with times in seconds.
        constants: numbers that the text names.
        formulas: other formulas that the text names.
        until: `"closed"` requires `a` of `a until b` also at the sample of `b`, and
            `"half-open"` does not.
        end: assumption about the time after the last sample: nothing (`"truncate"`),
            that sample for ever (`"hold"`), or any value (`"strict"`).
        rho_max: clamps every robustness to ±`rho_max`.

    Raises:
        FormulaError: the text is no formula. A caret shows the place.
    """

    def __init__(
        self,
        text: str,
        *,
        constants: Mapping[str, float] | None = None,
        formulas: Mapping[str, str] | None = None,
        until: str = "half-open",
        end: str = "truncate",
        rho_max: float | None = None,
    ) -> None:
        self.text = text
        numbers, others = dict(constants or {}), dict(formulas or {})
        self._given = (numbers, others, until, end, rho_max)
        named = (list(numbers.items()), list(others.items()))
        self._raw = RawFormula(text, *named, until, end, rho_max)

    def robustness(self, signals: Any, *, dt: float = 1.0) -> float:
        """Returns the robustness at the first sample.

        Above 0 the formula holds, and below 0 it does not.

        Args:
            signals: a mapping from names to arrays, a data frame, or an array
                with named fields. Contiguous arrays of float64 are read in place,
                and all other arrays are converted. Arrays of bool are Boolean.
            dt: seconds between two samples.

        Raises:
            FormulaError: the formula names an unknown signal.
            InputError: a signal of the formula holds a NaN, or has another length.
        """
        return self._raw.robustness(_columns(signals), dt)

    def robustness_all(self, signals: Any, *, dt: float = 1.0) -> NDArray[np.float64]:
        """Returns the robustness at every sample, `[samples]`, as for `robustness`."""
        return self._raw.robustness_all(_columns(signals), dt)

    def satisfied(self, signals: Any, *, dt: float = 1.0) -> bool:
        """True if it holds at the first sample. At robustness 0 the comparison decides."""
        return self._raw.satisfied(_columns(signals), dt)

    def explain(self, signals: Any, *, dt: float = 1.0) -> Explanation:
        """Returns the leaf, the time and the value that decide the robustness."""
        found, robustness, text = self._raw.explain(_columns(signals), dt)
        pairs = found["signals"]
        pairs = pairs.items() if isinstance(pairs, dict) else pairs
        return Explanation(
            robustness=robustness,
            reason=str(found["reason"]),
            path=found["path"],
            signals=dict(pairs),
            text=text,
        )

    def monitor(
        self,
        signals: Iterable[str] | Mapping[str, type],
        *,
        dt: float = 1.0,
        samples: int | None = None,
    ) -> Monitor:
        """Returns a monitor that takes your samples in turn.

        Args:
            signals: names in the order of the rows. In a mapping, `bool` marks a
                Boolean signal.
            dt: seconds between two samples.
            samples: number of samples, if you know it. Bounds then close earlier.
        """
        kinds = signals if isinstance(signals, Mapping) else dict.fromkeys(signals, float)
        named = [(name, kind is bool) for name, kind in kinds.items()]
        return Monitor(self._raw.monitor(named, dt, samples), [name for name, _ in named])

    def __repr__(self) -> str:
        return f"Formula({str(self)!r})"

    def __str__(self) -> str:
        return str(self._raw)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Formula):
            return NotImplemented
        return (str(self), self._given) == (str(other), other._given)

    def __hash__(self) -> int:
        return hash(str(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return _formula, (self.text, *self._given)


def _formula(text: str, constants: Any, formulas: Any, until: str, end: str, rho: Any) -> Formula:
    return Formula(
        text, constants=constants, formulas=formulas, until=until, end=end, rho_max=rho
    )


class Monitor:
    """A monitor of a formula, which takes your samples in turn (`Formula.monitor`)."""

    def __init__(self, raw: RawMonitor, signals: list[str]) -> None:
        self._raw = raw
        #: Names, in the order of the rows.
        self.signals = signals

    def push(self, row: Mapping[str, float] | Sequence[float]) -> Interval:
        """Takes the next sample and returns the interval of possible values.

        Args:
            row: a value per signal, by name or in the order of `signals`.
        """
        # Lists of numbers are the usual row, and checks of abstract types are slow.
        if type(row) is not list:
            row = self._row(row)
        return _interval(Interval, self._raw.push(row))

    def push_many(self, rows: Mapping[str, ArrayLike] | ArrayLike) -> NDArray[np.float64]:
        """Takes several samples, and returns the interval after each of them.

        Args:
            rows: an array per signal, by name, or one array `[samples, signals]` in the
                order of `signals`. A row with a NaN or an infinity is an error that names
                the row, and none of the rows is taken.

        Returns:
            An array `[samples, 2]` of the lower and upper ends.
        """
        if isinstance(rows, Mapping):
            self._must_have_all(rows)
            columns = [_column(name, rows[name])[2] for name in self.signals]
            if len({len(column) for column in columns}) > 1:
                lengths = ", ".join(f"`{n}` {len(c)}" for n, c in zip(self.signals, columns))
                raise InputError(f"the signals have different lengths: {lengths}")
            rows = np.stack(columns, axis=1)
        table = np.ascontiguousarray(rows, dtype=np.float64)
        if table.ndim != 2 or table.shape[1] != len(self.signals):
            raise InputError(
                f"the rows have shape {table.shape}: give [samples, {len(self.signals)}]"
            )
        return self._raw.push_many(table)

    def _row(self, row: Mapping[str, float] | Sequence[float]) -> list[float]:
        if isinstance(row, Mapping):
            self._must_have_all(row)
            row = [row[name] for name in self.signals]
        return [float(value) for value in row]

    def _must_have_all(self, row: Mapping[str, Any]) -> None:
        missing = [name for name in self.signals if name not in row]
        if missing:
            raise InputError(f"the row lacks: {', '.join(missing)}")

    def finish(self) -> float:
        """Ends the run and returns its robustness, with the bits of `Formula.robustness`."""
        return self._raw.finish()

    def reset(self) -> None:
        """Forgets all samples."""
        self._raw.reset()

    def __len__(self) -> int:
        return len(self._raw)

    def __repr__(self) -> str:
        return f"Monitor({len(self)} samples of {', '.join(self.signals)})"


def _columns(signals: Any) -> list[tuple[str, bool, NDArray[np.float64]]]:
    if isinstance(signals, Mapping):
        named = list(signals.items())
    elif isinstance(signals, np.ndarray) and signals.dtype.names:
        named = [(name, signals[name]) for name in signals.dtype.names]
    elif hasattr(signals, "columns"):
        named = [(str(name), signals[name]) for name in signals.columns]
    else:
        raise InputError(
            f"{type(signals).__name__} holds no named signals: give a dictionary of arrays, "
            "a data frame, or an array with named fields"
        )
    return [_column(str(name), values) for name, values in named]


def _column(name: str, values: ArrayLike) -> tuple[str, bool, NDArray[np.float64]]:
    array = np.asarray(values)
    if array.ndim != 1:
        raise InputError(f"`{name}` has shape {array.shape}: a signal is one number per sample")
    if array.dtype.kind not in "bfiu":
        if array.dtype.kind == "O" or array.dtype.kind in "US":
            raise InputError(f"`{name}` holds {array.dtype}, which are no numbers")
        raise InputError(f"`{name}` holds {array.dtype}: give real numbers")
    return name, array.dtype.kind == "b", np.ascontiguousarray(array, dtype=np.float64)
