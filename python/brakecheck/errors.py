"""What can go wrong; the message is what a terminal would show, cure included."""
from typing import Any


class BrakecheckError(Exception):
    """Anything that brakecheck refuses or fails to do."""

    #: What a verb answered nevertheless (`brakecheck.verb`), None elsewhere.
    outcome: Any = None


class InputError(BrakecheckError, ValueError):
    """What was asked for is wrong: the message says what, where, and the cure."""


class FormulaError(InputError):
    """A formula is wrong: the message draws a caret under the place."""


class FaultError(BrakecheckError, RuntimeError):
    """The ego, the physics or the disk failed: nothing is a verdict on the ego.

    Of an ego written in Python the message holds the end of its traceback.
    """


class NotIdenticalError(BrakecheckError, RuntimeError):
    """A replay is not what was recorded."""
