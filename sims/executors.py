"""One function over many tasks: here, in processes, or on a Dask cluster; where it runs does not change the results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from functools import partial
from threading import Lock
from typing import TypeVar

from certify.workers import Say, in_processes, processors
from symbolic.errors import InputError

__all__ = ["processors", "run_tasks"]

Task = TypeVar("Task")
Result = TypeVar("Result")

_CONNECT_SECONDS = 10
_WORKERS_SECONDS = 30
_ONE_AT_A_TIME = Lock()


def run_tasks(
    function: Callable[..., Result],
    tasks: Sequence[Task],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    listen: Say | None = None,
) -> Iterator[Result]:
    """``function(task)`` for every task, in the order of the tasks; closing the iterator drops those not begun.

    With ``listen`` it is ``function(task, say)`` on this machine, and ``listen`` gets what was said.

    Runs here for one worker, in that many processes for more (:mod:`certify.workers`), and with ``scheduler`` on the
    workers of the Dask scheduler at that address (the extra ``cluster``; ``workers`` is not used then), where
    ``function``, the tasks and the results are pickled. A task must bring its own seed: Dask runs it again when its
    worker dies. Dask unpickles what a cluster sends, so use only one you trust, with the same libraries on it.

    Raises ``InputError`` if the extra is missing, nothing answers at the address, no worker joins in time, one task has
    lost too many workers, or the scheduler is lost.
    """
    if scheduler is not None:
        return _on_cluster(function, tasks, scheduler)
    if listen is None:
        return in_processes(lambda task, _: function(task), tasks, workers)
    return in_processes(function, tasks, workers, listen)


def _on_cluster(function: Callable[[Task], Result], tasks: Sequence[Task], address: str) -> Iterator[Result]:
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise InputError("a scheduler needs Dask: pip install 'distributed>=2025.1'") from error
    if not address:  # Dask would start a cluster of its own
        raise InputError("the address of the scheduler is empty")
    try:
        client = Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address!r}") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_WORKERS_SECONDS)
        except TimeoutError as error:
            raise InputError(f"the Dask scheduler at {address!r} has no workers") from error
        futures = client.map(partial(_alone, function), tasks, pure=False)
        try:
            for future in futures:
                yield future.result()
        except KilledWorker as error:
            raise InputError(f"the cluster at {address!r} gave up a task: every worker that ran it died") from error
        except CancelledError as error:
            raise InputError(f"the connection to the Dask scheduler at {address!r} was lost") from error
        finally:
            client.cancel(futures)


def _alone(function: Callable[[Task], Result], task: Task) -> Result:
    """One call at a time in a process: a Dask worker may have several threads, and LSODA is not re-entrant."""
    with _ONE_AT_A_TIME:
        return function(task)
