"""One function over many tasks in forked processes, which inherit what has been computed and end with their parent."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

from certify.lifetime import WorkerLostError, end_with

Task = TypeVar("Task")
Result = TypeVar("Result")
Say = Callable[[str], None]


def processors() -> int:
    """How many this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_processes(
    function: Callable[[Task, Say], Result],
    tasks: Sequence[Task],
    workers: int,
    listen: Say = lambda message: None,
) -> Iterator[Result]:
    """``function(task, say)`` for every task, in the order of the tasks; what it says goes to ``listen``.

    Function and tasks are inherited, only results are pickled. With one worker, within a worker, and where processes
    cannot be forked safely (all but Linux), everything runs here. Closing the iterator ends the workers, whatever they
    are at. An exception in a task is raised here when it is that task's turn; raises ``WorkerLostError`` if a worker is
    killed.
    """
    within = multiprocessing.current_process().daemon
    if min(workers, len(tasks)) <= 1 or within or sys.platform != "linux":
        for task in tasks:
            yield function(task, listen)
        return
    crew: list[_Worker] = []
    found: dict[int, Any] = {}
    begun = 0
    try:
        for _ in range(min(workers, len(tasks))):
            crew.append(_hire(function, tasks, crew))
            crew[-1].link.send(begun)
            begun += 1
        for position in range(len(tasks)):
            while position not in found:
                for worker in _speaking(crew):
                    kind, content = worker.receive()
                    if kind == "said":
                        listen(content)
                        continue
                    done, found[done] = content
                    if kind == "failed":
                        begun = len(tasks)  # what comes after it is not wanted any more
                    elif begun < len(tasks):
                        worker.link.send(begun)
                        begun += 1
            result = found.pop(position)
            if isinstance(result, _Failure):
                result.error.add_note(result.where)
                raise result.error
            yield result
    finally:
        for worker in crew:
            worker.process.kill()
        for worker in crew:
            worker.process.join()
            worker.link.close()


@dataclass(frozen=True)
class _Failure:
    """An exception, and the trace that would not travel with it."""

    error: Exception
    where: str


@dataclass(frozen=True)
class _Worker:
    process: BaseProcess
    link: Connection

    def receive(self) -> tuple[str, Any]:
        """The next message; raises ``WorkerLostError`` if there will be none."""
        try:
            message: tuple[str, Any] = self.link.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            raise WorkerLostError(f"a worker process was lost ({_ending(self.process.exitcode)})") from None
        return message


def _speaking(crew: Sequence[_Worker]) -> list[_Worker]:
    ready = wait([worker.link for worker in crew])
    return [worker for worker in crew if worker.link in ready]


def _hire(function: Callable[[Any, Say], Any], tasks: Sequence[Any], crew: Sequence[_Worker]) -> _Worker:
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    inherited = [here, *(worker.link for worker in crew)]
    process = context.Process(target=_work, args=(function, tasks, there, inherited, os.getpid()), daemon=True)
    process.start()
    there.close()  # else the end of the worker would not show
    return _Worker(process, here)


def _work(
    function: Callable[[Any, Say], Any],
    tasks: Sequence[Any],
    link: Connection,
    inherited: list[Connection],
    parent: int,
) -> None:
    """A worker's life. Interruptions are the parent's business."""
    end_with(parent)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    for other in inherited:
        other.close()
    with contextlib.suppress(EOFError, OSError):  # the parent has gone a moment before the kernel ends this process
        while True:
            position = link.recv()
            try:
                result = function(tasks[position], lambda message: link.send(("said", message)))
            except Exception as error:  # noqa: BLE001 - it is raised again where the tasks come from
                link.send(("failed", (position, _Failure(_portable(error), traceback.format_exc()))))
            else:
                link.send(("done", (position, result)))
    os._exit(1)


def _portable(error: Exception) -> Exception:
    """The exception, or one that says the same where it cannot be pickled."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever its class does when it is rebuilt
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


def _ending(code: int | None) -> str:
    if code is not None and code < 0:
        memory = ", perhaps for want of memory" if -code == signal.SIGKILL else ""
        return signal.Signals(-code).name + memory
    return f"exit code {code}"
