"""Signal Temporal Logic over arrays, without copying them.

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
    """What the robustness can still come to, `low` to `high`."""

    low: float
    high: float

    @property
    def is_final(self) -> bool:
        """Whether nothing that follows can change it."""
        return self.low == self.high


#: Makes an interval of two ends without a call of Python.
_interval = tuple.__new__


@dataclass(frozen=True)
class Explanation:
    """Which part of a formula decides its robustness, when, with which value."""

    #: The robustness that is explained.
    robustness: float
    #: Why the explanation ends where it does.
    reason: str
    #: From the formula to the deciding leaf: formula, sample, time_s, value.
    path: list[dict[str, Any]]
    #: The signals of that leaf at that sample.
    signals: dict[str, float]
    #: The same as a terminal shows it.
    text: str

    def __str__(self) -> str:
        return self.text


class Formula:
    """A formula of Signal Temporal Logic.

    Args:
        text: such as `"always[0, 5] (gap > 2)"`; times in seconds.
        constants: numbers that the text names.
        formulas: other formulas that the text names.
        until: `"half-open"` or `"closed"`: whether `a until b` asks for `a`
            where `b` holds.
        end: what lies behind the last sample: nothing (`"truncate"`), that
            sample for ever (`"hold"`), or nobody knows (`"strict"`).
        rho_max: clamps every robustness to ±`rho_max`.

    Raises:
        FormulaError: the text is no formula; a caret shows where.
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
        """The robustness at the first sample: above 0 it holds, below it does not.

        Args:
            signals: a mapping from names to arrays, a data frame, or an array
                with named fields. Contiguous arrays of float64 are read where
                they lie; others are converted. Arrays of bool are Boolean.
            dt: seconds between two samples.

        Raises:
            FormulaError: the formula names what is not among the signals.
            InputError: a signal that it reads holds a NaN, or is of another
                length.
        """
        return self._raw.robustness(_columns(signals), dt)

    def robustness_all(self, signals: Any, *, dt: float = 1.0) -> NDArray[np.float64]:
        """The robustness at every sample, `[samples]`; see `robustness`."""
        return self._raw.robustness_all(_columns(signals), dt)

    def satisfied(self, signals: Any, *, dt: float = 1.0) -> bool:
        """Whether it holds at the first sample; at robustness 0 the comparison decides."""
        return self._raw.satisfied(_columns(signals), dt)

    def explain(self, signals: Any, *, dt: float = 1.0) -> Explanation:
        """Leaf, time and value that decide the robustness."""
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
        """A monitor that is fed sample by sample.

        Args:
            signals: names in the order of the rows; as a mapping, `bool` marks
                those that are Boolean.
            dt: seconds between two samples.
            samples: how many will come, where that is known: bounds close
                earlier then.
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
    """A formula that is fed sample by sample; made by `Formula.monitor`."""

    def __init__(self, raw: RawMonitor, signals: list[str]) -> None:
        self._raw = raw
        #: Names, in the order of the rows.
        self.signals = signals

    def push(self, row: Mapping[str, float] | Sequence[float]) -> Interval:
        """Takes the next sample: what is still possible.

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
        """Ends the run here; its robustness, the same bits as `Formula.robustness`."""
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
