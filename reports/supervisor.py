"""What the installed command runs: the work is done in a child process, and this one waits and answers signals.

An interruption has to end the command within two seconds, also while native code (a solver, the typesetter, a compiled
loop) keeps the interpreter busy; no handler in Python runs then. So the child is killed from outside, after what it is
just writing is whole, and takes its workers with it (``certify.lifetime``). Nothing heavy is imported before the fork.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import shutil
import signal
import sys
import time
from dataclasses import dataclass, field
from typing import NoReturn

from certify.lifetime import adopt_orphans, children, end_with, watched_through

UNDECIDED = 3
PATIENCE = 1.0  # seconds that a file being written gets, and then the processes to end: half of what the user waits
_INTERRUPTIONS = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


def main() -> int:
    """Run ``certify`` with the arguments of this process; its exit code, 128 + n after signal n."""
    if not hasattr(os, "fork"):
        return _command()
    heard = {number for number in _INTERRUPTIONS if signal.getsignal(number) != signal.SIG_IGN}
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # ignored, it would take the child's exit code with it
    signal.pthread_sigmask(signal.SIG_BLOCK, heard | {signal.SIGCHLD})
    adopt_orphans()
    told, tell = os.pipe()
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(told)
        _watched(parent, tell, heard)
    os.close(tell)
    return _wait(child, told, heard)


def _command() -> int:
    for library in ("OPENBLAS", "MKL"):  # matrices here are small: threads wait for each other longer than they work
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from reports.command_line import main as command

    return command()


def _watched(parent: int, tell: int, heard: set[signal.Signals]) -> NoReturn:
    """The child: signals are the parent's business, also those that a terminal sends to both."""
    end_with(parent)
    for number in heard:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _INTERRUPTIONS | {signal.SIGCHLD})
    watched_through(tell)
    code = _command()
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # the reader has gone; the exit code still tells
            stream.flush()
    os._exit(code)  # taking a hundred thousand objects apart one by one would take longer than many a command


def _wait(child: int, told: int, heard: set[signal.Signals]) -> int:
    while True:
        number = signal.sigwait(heard | {signal.SIGCHLD})
        if number != signal.SIGCHLD:
            code = _interrupt(child, told)
            if code is not None:
                return code
            print(f"certify: interrupted by {signal.Signals(number).name}; nothing was left half done", file=sys.stderr)
            return 128 + number
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
    if os.WIFSIGNALED(status):
        notes = _Notes(told)
        _end_the_rest(notes)
        _take_away(notes)
        return _killed(os.WTERMSIG(status))
    return os.WEXITSTATUS(status)


@dataclass
class _Notes:
    """What the child has told so far (``certify.lifetime``)."""

    pipe: int
    unfinished: dict[str, None] = field(default_factory=dict)
    busy: bool = False
    _rest: bytes = b""

    def read(self, seconds: float) -> bool:
        """Take in what is there, or comes within that time; ``False`` when no process is left that could tell."""
        if not select.select([self.pipe], [], [], seconds)[0]:
            return True
        found = os.read(self.pipe, 1 << 16)
        *lines, self._rest = (self._rest + found).split(b"\0")
        for line in lines:
            if line in (b"[", b"]"):
                self.busy = line == b"["
            elif line.startswith(b"+"):
                self.unfinished[os.fsdecode(line[1:])] = None
            else:
                self.unfinished.pop(os.fsdecode(line[1:]), None)
        return bool(found)

    def read_all(self) -> None:
        while select.select([self.pipe], [], [], 0)[0] and self.read(0):
            pass


def _interrupt(child: int, told: int) -> int | None:
    """End the child and all its workers, between two of its undivided parts if that is soon.

    The exit code of a child that was so nearly done that it has ended by itself.
    """
    notes = _Notes(told)
    deadline = time.monotonic() + PATIENCE
    while True:
        os.kill(child, signal.SIGSTOP)  # so that it tells nothing new while it is judged
        _, status = os.waitpid(child, os.WUNTRACED)
        if os.WIFEXITED(status):
            return os.WEXITSTATUS(status)
        notes.read_all()
        if os.WIFSIGNALED(status):
            break
        if not notes.busy or time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            break
        os.kill(child, signal.SIGCONT)
        notes.read(max(0.0, deadline - time.monotonic()))
    _end_the_rest(notes)
    _take_away(notes)
    return None


def _end_the_rest(notes: _Notes) -> None:
    """Workers end with their parent; what else has been started (a compiler) is an orphan now, and this one's child."""
    deadline = time.monotonic() + PATIENCE / 2
    while time.monotonic() < deadline:
        orphans = children()
        for orphan in orphans:
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(orphan, signal.SIGKILL)
                os.waitpid(orphan, 0)
        if not orphans and not notes.read(0.01):  # the last that could have told has closed the pipe
            return


def _take_away(notes: _Notes) -> None:
    notes.read_all()
    for name in reversed(notes.unfinished):
        if os.path.isdir(name):
            shutil.rmtree(name, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                os.unlink(name)
    if sys.stderr.isatty():  # what a spinner would have put back
        sys.stderr.write("\r\x1b[K\x1b[?25h")


def _killed(number: int) -> int:
    """The child was killed by someone else, or by a fault in native code."""
    memory = ", perhaps for want of memory" if number == signal.SIGKILL else ""
    reason = f"the computation was ended by {signal.Signals(number).name}{memory}"
    if "--json" in sys.argv:
        import json

        print(json.dumps({"status": "inconclusive", "reason": reason}))
    print(f"certify: {reason}", file=sys.stderr)
    return UNDECIDED
