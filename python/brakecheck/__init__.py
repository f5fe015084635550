"""Adversarial testing of driving controllers.

Can a car that keeps every rule still make yours crash?

>>> import brakecheck
>>> brakecheck.World("acc").name
'acc'

Train an ado, evaluate it on your own ego, and watch a crash::

    run = brakecheck.train("acc", "runs/acc")
    print(brakecheck.eval(run, ego=MyController, search=1))
    brakecheck.view(run)

`Env`, `VectorEnv` and `ParallelEnv` are environments for Gymnasium and PettingZoo.
`stl.Formula` measures your arrays.
The package also contains the command line (`brakecheck --help`).
"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

from brakecheck import errors, stl
from brakecheck._brakecheck import Command, Own, Percept, Seen, SeenLight
from brakecheck.commands import eval, export, replay, report, search, train, view
from brakecheck.errors import (
    BrakecheckError,
    FaultError,
    FormulaError,
    InputError,
    NotIdenticalError,
)
from brakecheck.programs import serve_ego
from brakecheck.recordings import Recording, fit_traffic
from brakecheck.registration import register_all
from brakecheck.results import Ado, Replayed, Rows, Run
from brakecheck.verbs import (
    Outcome,
    coverage,
    gate,
    harden,
    merge,
    plan,
    risk,
    run_piece,
    sweep,
    verb,
)
from brakecheck.worlds import World

if TYPE_CHECKING:
    from brakecheck.envs import Env
    from brakecheck.parallel import ParallelEnv
    from brakecheck.vector import VectorEnv

try:
    __version__ = version("brakecheck")
except PackageNotFoundError:  # pragma: no cover
    __version__ = "unknown"

__all__ = [
    "Ado",
    "BrakecheckError",
    "Command",
    "Env",
    "FaultError",
    "FormulaError",
    "InputError",
    "NotIdenticalError",
    "Outcome",
    "Own",
    "ParallelEnv",
    "Percept",
    "Recording",
    "Replayed",
    "Rows",
    "Run",
    "Seen",
    "SeenLight",
    "VectorEnv",
    "World",
    "coverage",
    "errors",
    "eval",
    "export",
    "fit_traffic",
    "gate",
    "harden",
    "merge",
    "plan",
    "replay",
    "report",
    "risk",
    "run_piece",
    "search",
    "serve_ego",
    "stl",
    "sweep",
    "train",
    "verb",
    "view",
]

register_all()

#: Modules that require Gymnasium or PettingZoo, imported on first use.
_LATER = {"Env": "envs", "VectorEnv": "vector", "ParallelEnv": "parallel"}


def __getattr__(name: str) -> Any:
    if name in _LATER:
        from importlib import import_module

        return getattr(import_module(f"brakecheck.{_LATER[name]}"), name)
    raise AttributeError(f"module 'brakecheck' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
