"""The closed loop in floats, which proves nothing: runs, the search for counterexamples. Loaded name by name."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory, simulate
    from sims.deadline import settled_run
    from sims.falsifier import FalsifierResult, falsify
    from sims.scenario import Scenario, nominal, random_scenario

_HOMES = {
    "FalsifierResult": "sims.falsifier",
    "Scenario": "sims.scenario",
    "Trajectory": "sims.closed_loop",
    "falsify": "sims.falsifier",
    "nominal": "sims.scenario",
    "random_scenario": "sims.scenario",
    "settled_run": "sims.deadline",
    "simulate": "sims.closed_loop",
}

__all__ = [
    "FalsifierResult",
    "Scenario",
    "Trajectory",
    "falsify",
    "nominal",
    "random_scenario",
    "settled_run",
    "simulate",
]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(home), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
