"""Exceptions. You get the message of a terminal, with the fix."""
from typing import Any


class BrakecheckError(Exception):
    """Base class of all refusals and failures."""

    #: Result of a verb that failed nevertheless (`brakecheck.verb`), else None.
    outcome: Any = None


class InputError(BrakecheckError, ValueError):
    """A wrong request. The message has the mistake, its place and the fix."""


class FormulaError(InputError):
    """A wrong formula. The message draws a caret under the place."""


class FaultError(BrakecheckError, RuntimeError):
    """A failure of the ego, the physics or the disk, without a verdict on the ego.

    For your ego in Python, the message contains the end of its traceback.
    """


class NotIdenticalError(BrakecheckError, RuntimeError):
    """A replay that differs from its record."""
