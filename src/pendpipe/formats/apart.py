"""Call a function in a process of its own, which is ended where a library does not return.

A call into a compiled library can't be left by its caller, neither by a signal nor from a thread.
The process waits for the next call, as its start takes half a second.
"""

from __future__ import annotations

import atexit
import faulthandler
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

WITHIN_S: Final = 10.0
"""The limit of every reader for a file of up to 64 MB."""
_SERVE: Final = (
    "import pickle, sys; sys.path[:] = pickle.loads(bytes.fromhex(sys.argv[1])); "
    "from pendpipe.formats import apart; apart.serve()"
)
_LOCK: Final = threading.Lock()
_SERVERS: Final[dict[int, subprocess.Popen[bytes]]] = {}
"""By the process that began it: a copy made by ``fork`` may not speak on its parent's pipes."""


def called_apart(function: Callable[..., Any], *given: Any) -> Any:
    """Return what a function returns in a process of its own.

    Parameters
    ----------
    function
        A function of a module, by which it is found there.
    given
        What it is called with. It can be pickled, as can what the function returns or raises.

    Raises
    ------
    ValueError
        When the process has not answered within 10 s, or has ended.
    Exception
        What the function raises.
    """
    with _LOCK:
        server = _SERVERS.get(os.getpid()) or _SERVERS.setdefault(os.getpid(), _begun())
        assert server.stdin
        assert server.stdout
        try:
            pickle.dump((WITHIN_S, function, given), server.stdin)
            server.stdin.flush()
            raised, value = pickle.load(server.stdout)
        except BaseException as error:  # a half-read answer would be taken for the next one's
            _end()
            if isinstance(error, EOFError | OSError | pickle.UnpicklingError):
                problem = f"its reader took more than {WITHIN_S:g} s, or broke off"
                raise ValueError(problem) from None
            raise
    if raised:
        raise value
    return value


def _begun() -> subprocess.Popen[bytes]:
    """Start the process. A working folder is not on its path."""
    path = pickle.dumps([str(Path(each).absolute()) for each in sys.path if each]).hex()
    pipe, none = subprocess.PIPE, subprocess.DEVNULL
    words = [sys.executable, "-I", "-c", _SERVE, path]
    return subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=none)


@atexit.register
def _end() -> None:
    if server := _SERVERS.pop(os.getpid(), None):
        server.kill()
        server.communicate()


def serve() -> None:
    """Answer calls of the standard input until it ends, or a call takes too long."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # its caller ends it
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what a library prints is no answer
    while True:
        try:
            within_s, function, given = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        answer: tuple[bool, Any]
        faulthandler.dump_traceback_later(within_s, exit=True)  # also where the caller has gone
        try:
            answer = False, function(*given)
        except Exception as error:
            answer = True, error
        faulthandler.cancel_dump_traceback_later()
        pickle.dump(answer, answers)
        answers.flush()
