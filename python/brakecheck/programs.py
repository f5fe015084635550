"""An ego in Python as a separate program, for every verb and every machine."""

from __future__ import annotations

import contextlib
import inspect
import json
import sys
import traceback
from collections.abc import Mapping
from typing import Any, TextIO

from brakecheck._brakecheck import Percept, command_of
from brakecheck.errors import InputError

__all__ = ["serve_ego"]

#: The version of the ego protocol (docs/reference/ego-protocol.md).
_PROTOCOL = 1
#: Characters of a traceback in an answer, from its end.
_TRACEBACK = 4000


def serve_ego(
    ego: Any,
    name: str | None = None,
    parameters: Mapping[str, tuple[float, float, float]] | None = None,
) -> None:
    """Plays an ego as a program that reads the ego protocol on stdin.

    The answers go to stdout. With this last line, your file is a program for all verbs::

        if __name__ == "__main__":
            brakecheck.serve_ego(Mine)

    Test it with `brakecheck gate RUN --baseline-ego old -- python3 mine.py`. Prints of
    the ego go to stderr, because stdout belongs to the protocol.

    Args:
        ego: a function of a percept, or a class or an object with `control(percept)`
            and optionally `brief(briefing)` and `reset(seed)`.
        name: its name in brakecheck, by default that of the function or class.
        parameters: least value, greatest value and default of each parameter that
            `brakecheck harden` may change. You get the values in
            `briefing["parameters"]`.
    """
    own = ego() if inspect.isclass(ego) else ego
    if not callable(getattr(own, "control", own)):
        raise InputError(
            f"{ego!r} is no ego: give a function of a percept, or a class or an object with "
            "`control(percept)`"
        )
    named = name or getattr(ego, "__name__", type(ego).__name__)
    declared = [
        {"name": one, "lo": lo, "hi": hi, "default": default}
        for one, (lo, hi, default) in (parameters or {}).items()
    ]
    hello = {"protocol": _PROTOCOL, "name": named, "parameters": declared}
    answers = sys.stdout
    with contextlib.redirect_stdout(sys.stderr):
        for line in sys.stdin:
            message = json.loads(line)
            if "close" in message:
                break
            if "hello" in message:
                _tell(answers, {"hello": hello})
            elif "reset" in message or "step" in message:
                _tell(answers, {"id": message["id"], **_answer(own, message)})


def _answer(ego: Any, message: dict[str, Any]) -> dict[str, Any]:
    """Returns the answer to a message. An exception is an error of the ego, not the end."""
    try:
        if "step" in message:
            percept = Percept.from_json(json.dumps(message["step"]))
            command = command_of(getattr(ego, "control", ego)(percept))
            return {"accel_mps2": command.accel_mps2, "lateral_mps": command.lateral_mps}
        briefing = dict(message["reset"])
        seed = briefing.pop("seed")
        for method, argument in (("brief", briefing), ("reset", seed)):
            if callable(getattr(ego, method, None)):
                getattr(ego, method)(argument)
        return {"ready": True}
    except Exception as error:
        # The reason comes first, because brakecheck shows the beginning.
        reason = f"{type(error).__name__}: {error}"
        return {"error": f"{reason}\n{traceback.format_exc()[-_TRACEBACK:]}"}


def _tell(answers: TextIO, answer: dict[str, Any]) -> None:
    answers.write(json.dumps(answer) + "\n")
    answers.flush()
