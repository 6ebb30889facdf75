"""Tasks in forked processes: in order, with what they say and raise, and none left when the caller has enough."""

from __future__ import annotations

import os
import signal
import sys
import time
from typing import NoReturn

import pytest

from certify.lifetime import WorkerLostError
from certify.workers import Say, in_processes
from symbolic.errors import InputError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only there are processes forked")


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_results_come_in_order_with_what_was_said(workers: int) -> None:
    said: list[str] = []
    inherited = {k: object() for k in range(7)}  # neither it nor the function could be pickled

    def task(k: int, say: Say) -> tuple[int, bool, int]:
        time.sleep(0.02 * (7 - k) / 7)
        say(f"task {k}")
        return k * k, k in inherited, os.getpid()

    found = list(in_processes(task, range(7), workers, said.append))
    assert [square for square, _, _ in found] == [k * k for k in range(7)]
    assert all(known for _, known, _ in found)
    assert sorted(said) == [f"task {k}" for k in range(7)]
    assert (os.getpid() in {pid for _, _, pid in found}) == (workers == 1)
    assert list(in_processes(task, [], workers)) == []


def test_an_exception_is_raised_here_with_where_it_came_from() -> None:
    def task(k: int, _: Say) -> int:
        if k == 2:
            raise InputError("agent 3: no")
        return k

    results = in_processes(task, range(6), 2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(InputError, match="agent 3: no") as caught:
        next(results)
    assert "in task" in "".join(caught.value.__notes__)


def test_an_exception_that_cannot_travel_is_told() -> None:
    class LocalError(Exception):
        """Unknown where it would have to be rebuilt."""

    def task(_: int, __: Say) -> NoReturn:
        raise LocalError("inside")

    with pytest.raises(RuntimeError, match="LocalError: inside"):
        list(in_processes(task, range(2), 2))


def test_a_lost_worker_is_an_error() -> None:
    def task(_: int, __: Say) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(WorkerLostError, match="SIGKILL, perhaps for want of memory"):
        list(in_processes(task, range(2), 2))


def test_closing_ends_the_workers_whatever_they_are_at() -> None:
    def task(k: int, _: Say) -> int:
        if k:
            time.sleep(600)
        return os.getpid()

    results = in_processes(task, range(3), 2)
    pids = [next(results)]
    results.close()  # type: ignore[attr-defined]  # it is a generator
    assert not any(alive(pid) for pid in pids)


def test_a_worker_has_no_workers_of_its_own() -> None:
    def inner(k: int, _: Say) -> int:
        return os.getpid()

    def outer(_: int, __: Say) -> bool:
        return set(in_processes(inner, range(3), 2)) == {os.getpid()}

    assert list(in_processes(outer, range(2), 2)) == [True, True]
