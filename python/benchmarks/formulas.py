"""Robustness of formulas: brakecheck, rtamt and mstlo on the same samples.

All three use ρ(x > c) = ρ(x >= c) = x − c, minimum and maximum, and one sample
per second. Every value is compared before anything is measured.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brakecheck.stl import Formula
from timing import least

WINDOWS = (10, 100, 1000)
#: Samples of a run online, after the first window. rtamt is slow at long windows.
SAMPLES = {"ours": 50_000, "mstlo": 50_000, "rtamt": 2_000}
OFFLINE = 100_000
#: All three subtract once and then take minima and maxima, which round nothing.
TOLERANCE = 0.0
RNG = np.random.default_rng(0)
Push = Callable[[int, float], float]


class Disagreement(Exception):
    """Two programs return different values for the same samples."""


def ours_online(inner: str, window: int) -> Push:
    """Takes a sample and returns the least robustness of `inner` decided so far."""
    monitor = Formula(f"always {inner}[0, {window}] (x > 0.5)").monitor(["x"])
    push = monitor.push
    # Undecided windows can still reach any value, so they leave the upper end alone.
    return lambda _, value: push([value]).high


def mstlo_online(inner: str, window: int) -> Push | None:
    """The same with mstlo's value of every sample, and a minimum kept beside it."""
    try:
        import mstlo_python
    except ImportError:
        return None
    letter = {"always": "G", "eventually": "F"}[inner]
    formula = mstlo_python.parse_formula(f"{letter}[0, {window}](x > 0.5)")
    update = mstlo_python.Monitor(formula, semantics="DelayedQuantitative").update
    lowest = np.inf

    def push(time: int, value: float) -> float:
        nonlocal lowest
        for _, robustness in update("x", value, float(time)).verdicts():
            if robustness < lowest:
                lowest = robustness
        return lowest

    return push


def rtamt_spec(text: str) -> Any | None:
    """A specification of rtamt in discrete time."""
    try:
        import rtamt
    except ImportError:
        return None
    spec = rtamt.StlDiscreteTimeSpecification()
    spec.declare_var("x", "float")
    spec.spec = text
    spec.parse()
    return spec


def rtamt_online(inner: str, window: int) -> Push | None:
    """The same with rtamt, whose pastified formula is as late as its window is long."""
    spec = rtamt_spec(f"{inner}[0, {window}](x >= 0.5)")
    if spec is None:
        return None
    spec.pastify()
    update = spec.update
    lowest = np.inf

    def push(time: int, value: float) -> float:
        nonlocal lowest
        robustness = update(time, [("x", value)])
        # Before, the window is not full.
        if window <= time and robustness < lowest:
            lowest = robustness
        return lowest

    return push


ONLINE = {"ours": ours_online, "mstlo": mstlo_online, "rtamt": rtamt_online}


def online_values(push: Push, values: list[float]) -> list[float]:
    return [push(time, value) for time, value in enumerate(values)]


def compare(name: str, ours: Any, theirs: Any) -> None:
    """Raises unless two series of values are equal within the tolerance."""
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    # Infinities are equal, but their difference is no number.
    with np.errstate(invalid="ignore"):
        apart = np.where(ours == theirs, 0.0, np.abs(ours - theirs))
    if ours.shape != theirs.shape or not (apart <= TOLERANCE).all():
        raise Disagreement(f"{name}: {ours[:5]}… and {theirs[:5]}…")


def online(inner: str, window: int) -> dict[str, float]:
    """Seconds per sample of every program that is installed."""
    values = RNG.random(2 * window + 500).tolist()
    expected = online_values(ours_online(inner, window), values)
    if not np.isfinite(expected[-1]):
        raise Disagreement(f"no window of {window} samples was decided")
    works = {}
    for name, made in ONLINE.items():
        if (push := made(inner, window)) is None:
            continue
        found = online_values(push, values)
        # Only brakecheck bounds a formula before its first window is full.
        compare(f"{name}: {inner}, {window}", expected[window:], found[window:])
        works[name] = stream(push, len(values), RNG.random(SAMPLES[name]).tolist())
    return least(works)


def stream(push: Push, time: int, values: list[float]) -> Callable[[], float]:
    """A run that continues behind the samples before."""

    def run() -> float:
        nonlocal time
        for value in values:
            push(time, value)
            time += 1
        return len(values)

    return run


def arrays(inner: str, window: int) -> dict[str, float]:
    """Seconds per sample if a program gives all samples in one call."""
    values = RNG.random(OFFLINE)
    monitor = Formula(f"always {inner}[0, {window}] (x > 0.5)").monitor(["x"])
    expected = online_values(ours_online(inner, window), values.tolist())
    compare("arrays", expected, monitor.push_many({"x": values})[:, 1])

    def ours() -> float:
        monitor.reset()
        monitor.push_many({"x": values})
        return OFFLINE

    works: dict[str, Callable[[], float]] = {"ours": ours}
    letter = {"always": "G", "eventually": "F"}[inner]
    if (batch := mstlo_batch(f"{letter}[0, {window}](x > 0.5)", values)) is not None:
        least_value = min(value for _, value in batch())
        compare(f"mstlo, arrays: {inner}, {window}", expected[-1:], [least_value])
        works["mstlo"] = lambda: len(batch()) + window
    return least(works)


def offline(text: str, window: int, letters: str | None) -> dict[str, float]:
    """Seconds per sample for the robustness at every sample of a whole trace."""
    values = RNG.random(OFFLINE)
    formula, signals = Formula(text), {"x": values}
    expected = formula.robustness_all(signals, dt=1.0)

    def ours() -> float:
        formula.robustness_all(signals, dt=1.0)
        return OFFLINE

    works: dict[str, Callable[[], float]] = {"ours": ours}
    spec = rtamt_spec(text.replace(">", ">="))
    if spec is not None:
        data = {"time": list(range(OFFLINE)), "x": values.tolist()}
        found = [value for _, value in spec.evaluate(data)]
        compare(f"rtamt: {text}", expected, found)
        works["rtamt"] = lambda: len(spec.evaluate(data))
    if letters is not None and (batch := mstlo_batch(letters, values)) is not None:
        # It returns nothing for windows that reach past the end.
        compare(f"mstlo: {text}", expected[: OFFLINE - window], [value for _, value in batch()])
        works["mstlo"] = lambda: len(batch()) + window
    return least(works)


def mstlo_batch(text: str, values: np.ndarray) -> Callable[[], list[tuple[float, float]]] | None:
    """A monitor of mstlo that is given a whole trace."""
    try:
        import mstlo_python
    except ImportError:
        return None
    monitor = mstlo_python.Monitor(
        mstlo_python.parse_formula(text), semantics="DelayedQuantitative"
    )
    steps = {"x": [(value, float(time)) for time, value in enumerate(values.tolist())]}

    def run() -> list[tuple[float, float]]:
        monitor.reset()
        return monitor.update_batch(steps).verdicts()

    return run


def costs() -> list[dict[str, Any]]:
    """Nanoseconds per sample by mode, formula and window."""
    found = []

    def add(mode: str, formula: str, window: int, seconds: dict[str, float]) -> None:
        nanoseconds = {name: 1e9 * each for name, each in seconds.items()}
        found.append({"mode": mode, "formula": formula, "window": window, "ns": nanoseconds})

    for inner in ("always", "eventually"):
        for window in WINDOWS:
            add("online", f"always {inner}[0, W] (x > 0.5)", window, online(inner, window))
            add("arrays", f"always {inner}[0, W] (x > 0.5)", window, arrays(inner, window))
    for window in WINDOWS:
        bounded = f"always[0, {window}] (x > 0.5)"
        seconds = offline(bounded, window, f"G[0, {window}](x > 0.5)")
        add("offline", "always[0, W] (x > 0.5)", window, seconds)
    for window in WINDOWS:
        # mstlo has no operator without an upper bound.
        nested = f"always (eventually[0, {window}] (x > 0.5))"
        seconds = offline(nested, window, None)
        add("offline", "always eventually[0, W] (x > 0.5)", window, seconds)
    return found
