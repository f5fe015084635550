"""Processor time of alternatives that take turns."""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version


def cost(work: Callable[[], float]) -> float:
    """Returns the seconds of processor time per unit, where `work` returns its units."""
    begun = time.process_time()
    units = work()
    return (time.process_time() - begun) / units


def least(works: dict[str, Callable[[], float]], tries: int = 3) -> dict[str, float]:
    """Returns the least cost of each work, in seconds of processor time per unit.

    They take turns, so that a slow moment of the machine affects all of them.
    """
    costs: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(tries):
        for name, work in works.items():
            costs[name].append(cost(work))
    return {name: min(found) for name, found in costs.items()}


def version_of(package: str) -> str | None:
    """Returns the version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return None
