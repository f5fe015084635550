"""Daemon threads in which egos and ados written in Python run.

The extension waits for them until a deadline or Ctrl-C, and then abandons a thread
that does not answer. `SystemExit` ends its Python code. A call that blocks in C stays
behind, and does not keep your process from exiting.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import sys
import threading
import traceback

from brakecheck._brakecheck import Mailbox, exit_threads

__all__ = ["abandon", "start"]

atexit.register(exit_threads)


def start(mailbox: Mailbox) -> threading.Thread:
    """Starts a thread that makes the calls of a mailbox until its end."""
    thread = threading.Thread(target=_serve, args=(mailbox,), name="brakecheck", daemon=True)
    thread.start()
    return thread


def abandon(thread: threading.Thread) -> str:
    """Raises `SystemExit` in a thread, and returns the stack of its current call."""
    frame = sys._current_frames().get(thread.ident or 0)
    # Below the call are the frames of the thread itself and of `_serve`.
    stack = [one for one in traceback.extract_stack(frame) if one.filename not in _OURS]
    if thread.is_alive() and thread.ident is not None:
        raised, ident = ctypes.py_object(SystemExit), ctypes.c_ulong(thread.ident)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, raised)
    return "".join(traceback.format_list(stack))


_OURS = {__file__, threading.__file__}


def _serve(mailbox: Mailbox) -> None:
    # A thread can also be abandoned between two calls, such as the second of two
    # threads at Ctrl-C. That is no error of a thread, so no hook may report it.
    with contextlib.suppress(SystemExit):
        _answer(mailbox)


def _answer(mailbox: Mailbox) -> None:
    returned: object = None
    raised: BaseException | None = None
    while call := mailbox.exchange(returned, raised):
        function, arguments = call
        try:
            returned, raised = function(*arguments), None
        except BaseException as error:
            # The first frame is the one of this function.
            inner = error.__traceback__ and error.__traceback__.tb_next
            returned, raised = None, error.with_traceback(inner)
