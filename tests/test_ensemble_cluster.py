"""Ensembles and searches on a Dask cluster of real worker processes: the same results, even when a worker dies."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from closed_loops import controller_for

from sims.cross_check import cross_check
from sims.ensemble import ensemble
from sims.executors import run_tasks
from sims.falsifier import falsify
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant


@pytest.fixture(scope="module")
def good(five_agents: Plant) -> Controller:
    return controller_for(five_agents, g=5, K=100, h=500, delta=1000)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=2, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as started:
        yield started


def square(number: int) -> tuple[int, int]:
    return number * number, os.getpid()


def refuse(number: int) -> int:
    raise InputError(f"task {number} is refused")


def die_once(folder: Path, number: int) -> int:
    """Kills its own worker process in the middle of task 3, the first time it is run."""
    with (folder / f"{number}-{os.getpid()}-{time.monotonic_ns()}").open("x"):
        pass
    if number == 3 and len(list(folder.glob("3-*"))) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def die(number: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_a_busy_worker(address: str) -> int:
    """Waits until a worker has tasks, kills its process and returns how many tasks it had."""
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        pids = client.run(os.getpid)
        while True:
            for worker, tasks in client.processing().items():
                if tasks and worker in pids:
                    os.kill(pids[worker], signal.SIGKILL)
                    return len(tasks)
            time.sleep(0.01)


def busy(number: int) -> tuple[float, int]:
    time.sleep(0.3)
    return float(number) / 7.0, os.getpid()


# --- here and in processes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_the_order_of_the_tasks(workers: int) -> None:
    found = list(run_tasks(square, range(7), workers=workers))
    assert [value for value, _ in found] == [k * k for k in range(7)]
    assert (os.getpid() in {pid for _, pid in found}) == (workers == 1)


def test_the_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'distributed>="):
        list(run_tasks(square, range(2), scheduler="tcp://127.0.0.1:8786"))


# --- on the cluster ---------------------------------------------------------------------------------------------------


def test_an_address_without_a_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr("sims.executors._CONNECT_SECONDS", 1)
    with pytest.raises(InputError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:1'"):
        list(run_tasks(square, range(2), scheduler="tcp://127.0.0.1:1"))
    with pytest.raises(InputError, match="no Dask scheduler answers at 'nothing://here'"):
        list(run_tasks(square, range(2), scheduler="nothing://here"))
    with pytest.raises(InputError, match="the address of the scheduler is empty"):
        list(run_tasks(square, range(2), scheduler=""))


def test_a_scheduler_without_workers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
    monkeypatch.setattr("sims.executors._WORKERS_SECONDS", 1)
    with (
        distributed.LocalCluster(n_workers=0, processes=True, dashboard_address=None, host="127.0.0.1") as empty,
        pytest.raises(InputError, match="has no workers"),
    ):
        list(run_tasks(square, range(2), scheduler=empty.scheduler_address))


def test_an_error_on_a_worker_is_raised_here(cluster: Any) -> None:
    with pytest.raises(InputError, match="task 0 is refused"):
        list(run_tasks(refuse, range(2), scheduler=cluster.scheduler_address))


def test_the_ensemble_is_the_same_on_a_cluster(five_agents: Plant, good: Controller, cluster: Any) -> None:
    alone = ensemble(five_agents, good, count=4, seed=3, horizon=3)
    assert ensemble(five_agents, good, count=4, seed=3, horizon=3, scheduler=cluster.scheduler_address) == alone


def test_the_search_is_the_same_on_a_cluster(five_agents: Plant, good: Controller, cluster: Any) -> None:
    said: list[str] = []
    search = partial(falsify, five_agents, good, budget=6, agents=[1, 3], seed=1, horizon=25)
    assert search(scheduler=cluster.scheduler_address, progress=said.append) == search()
    assert [line.split(":")[0] for line in said] == ["agent 1", "agent 3"]


def test_the_cross_check_is_the_same_on_a_cluster(five_agents: Plant, good: Controller, cluster: Any) -> None:
    check = partial(cross_check, five_agents, good, count=3, seed=2, horizon=25)
    alone, divided = check(), check(scheduler=cluster.scheduler_address)
    assert divided == alone and alone.count == 15


def test_a_task_that_lost_its_worker_is_run_again(cluster: Any, tmp_path: Path) -> None:
    assert list(run_tasks(partial(die_once, tmp_path), range(8), scheduler=cluster.scheduler_address)) == [*range(8)]
    assert len(list(tmp_path.glob("3-*"))) == 2


def test_a_worker_killed_mid_run_loses_nothing(cluster: Any) -> None:
    """The worker that gave the first result dies with results in its memory and tasks under way."""
    results = run_tasks(busy, range(16), scheduler=cluster.scheduler_address)
    first, victim = next(results)
    assert victim != os.getpid()
    os.kill(victim, signal.SIGKILL)
    rest = list(results)
    assert [first, *(value for value, _ in rest)] == [k / 7.0 for k in range(16)]
    assert {pid for _, pid in rest} - {victim}  # the other worker or the one that replaced the dead


def test_an_ensemble_survives_the_death_of_a_worker(five_agents: Plant, good: Controller, cluster: Any) -> None:
    alone = ensemble(five_agents, good, count=8, seed=5, horizon=3)
    with ThreadPoolExecutor(1) as aside:
        killed = aside.submit(kill_a_busy_worker, cluster.scheduler_address)
        found = ensemble(five_agents, good, count=8, seed=5, horizon=3, scheduler=cluster.scheduler_address)
        assert killed.result(timeout=60) > 0
    assert found == alone


@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_given_up(cluster: Any) -> None:
    with pytest.raises(InputError, match="every worker that ran it died"):
        list(run_tasks(die, range(1), scheduler=cluster.scheduler_address))
