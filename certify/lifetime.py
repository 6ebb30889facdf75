"""A process that is watched: it ends with its parent, and says what an interruption would have to take away.

The command line runs its work in a child process (``reports.supervisor``), since no handler in Python runs while native
code is busy. The child tells its parent through a pipe, in lines of at most ``PIPE_BUF`` bytes, which arrive whole:
``+PATH`` names a file or folder that is to vanish if the work does not finish, ``-PATH`` takes that back, ``[`` and
``]`` enclose what should not be cut in two. A process that nobody watches tells nothing.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36  # <linux/prctl.h>
_LOOKING = 0.5  # seconds between two looks at the parent where the kernel does not tell

_watcher: list[int] = []


class WorkerLostError(RuntimeError):
    """A worker process ended before its task did."""


def end_with(parent: int) -> None:
    """Kill this process as soon as process ``parent``, which has just forked it, is no more, whatever it is doing then.

    Linux does that itself. Elsewhere a thread looks, which has to wait for native code that does not yield.
    """
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        threading.Thread(target=_look_for, args=(parent,), daemon=True).start()
    if os.getppid() != parent:  # it ended before the kernel knew
        os._exit(1)


def adopt_orphans() -> None:
    """Become the parent of what descendants leave behind, such as a compiler at work; only Linux can."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)


def children() -> list[int]:
    """The living and dead processes whose parent this one is, where /proc tells."""
    found = []
    for name in os.listdir("/proc") if os.path.isdir("/proc/self") else ():
        try:
            with open(f"/proc/{int(name)}/stat", "rb") as file:
                parent = int(file.read().rsplit(b")", 1)[1].split()[1])
        except (OSError, ValueError):  # no process, or one that has ended
            continue
        if parent == os.getpid():
            found.append(int(name))
    return found


def _look_for(parent: int) -> None:
    while os.getppid() == parent:
        threading.Event().wait(_LOOKING)
    os._exit(1)


def watched_through(descriptor: int) -> None:
    """From now on this process tells its watcher at the other end of the pipe."""
    _watcher[:] = [descriptor]


def unfinished(path: Path) -> None:
    """``path`` has to vanish if this process is interrupted before it calls :func:`finished`."""
    _tell(b"+" + os.fsencode(path.absolute()))


def finished(path: Path) -> None:
    """``path`` is as it should be, or gone."""
    _tell(b"-" + os.fsencode(path.absolute()))


@contextmanager
def undivided() -> Iterator[None]:
    """What is short and should be done wholly or not at all: an interruption waits for its end, for a second."""
    _tell(b"[")
    try:
        yield
    finally:
        _tell(b"]")


def nearly_done() -> None:
    """What is left (saying the result, going) should be done wholly, too."""
    _tell(b"[")


def _tell(line: bytes) -> None:
    if _watcher and len(line) < 4096:  # PIPE_BUF of Linux, and its longest path
        os.write(_watcher[0], line + b"\0")
