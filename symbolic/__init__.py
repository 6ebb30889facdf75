"""Plants as exact values: read, written, described in Python, and what is derived from them. Loaded name by name."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from symbolic.controller import AgentController, Controller
    from symbolic.derivation import derive
    from symbolic.derived import Derivation
    from symbolic.errors import InputError
    from symbolic.network_description import Network, agent
    from symbolic.plant import Agent, Digraph, Edge, Exosystem, InitialBox, Interval, Plant
    from symbolic.plant_file import load_plant, parse_plant
    from symbolic.plant_writer import with_source, write_plant

_HOMES = {
    "Agent": "symbolic.plant",
    "AgentController": "symbolic.controller",
    "Controller": "symbolic.controller",
    "Derivation": "symbolic.derived",
    "Digraph": "symbolic.plant",
    "Edge": "symbolic.plant",
    "Exosystem": "symbolic.plant",
    "InitialBox": "symbolic.plant",
    "InputError": "symbolic.errors",
    "Interval": "symbolic.plant",
    "Network": "symbolic.network_description",
    "Plant": "symbolic.plant",
    "agent": "symbolic.network_description",
    "derive": "symbolic.derivation",
    "load_plant": "symbolic.plant_file",
    "parse_plant": "symbolic.plant_file",
    "with_source": "symbolic.plant_writer",
    "write_plant": "symbolic.plant_writer",
}

__all__ = [
    "Agent",
    "AgentController",
    "Controller",
    "Derivation",
    "Digraph",
    "Edge",
    "Exosystem",
    "InitialBox",
    "InputError",
    "Interval",
    "Network",
    "Plant",
    "agent",
    "derive",
    "load_plant",
    "parse_plant",
    "with_source",
    "write_plant",
]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found = getattr(import_module(home), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
