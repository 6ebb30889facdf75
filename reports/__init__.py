"""Simulation, search, region and PDF for a certificate, and the command line. Loaded name by name."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reports.answers import Falsification, Region, Report, Simulation
    from reports.door import falsify, region, report, simulate

_HOMES = {
    "Falsification": "reports.answers",
    "Region": "reports.answers",
    "Report": "reports.answers",
    "Simulation": "reports.answers",
    "falsify": "reports.door",
    "region": "reports.door",
    "report": "reports.door",
    "simulate": "reports.door",
}

__all__ = [
    "Falsification",
    "Region",
    "Report",
    "Simulation",
    "falsify",
    "region",
    "report",
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
