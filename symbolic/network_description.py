"""A plant from SymPy expressions and a directed graph: the keys of a plant file as Python values.

What is given is written as a plant file and read by the reader of plant files, so that Python and files mean the same
and are refused for the same reasons.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import sympy

from symbolic.errors import InputError
from symbolic.plant import Plant
from symbolic.plant_file import SCHEMA, parse_plant
from symbolic.toml_value import exact_number, toml_value

Description = Mapping[str, Any]
DESIGNERS = ("reference", "observer", "eta")  # initial values that are the designer's choice: 0 where left open
TABLES = ("constants", "exosystem", "initial", "coordinator", "gains", "requirements", "implementation")


def agent(
    f: Any,
    cost: Any,
    *,
    b: Any = 1,
    order: int | None = None,
    states: Sequence[sympy.Symbol] | None = None,
    zero_dynamics: Mapping[Any, Any] | None = None,
    uncertain: Mapping[Any, Any] | None = None,
    **answers: Any,
) -> Description:
    """One agent ``z' = f0(z, x1, v, w)``, ``x_k' = x_(k+1)``, ``x_n' = f + b u``, ``y = x1`` (docs/theory.md, 1).

    ``f`` is an expression in ``x1 … xn`` or in your own ``states`` (output first), the zero states, the exosystem's
    states and the parameters; ``b`` in the parameters; ``cost`` in ``s``. In all of them the symbol ``id`` is the
    agent's number. ``zero_dynamics`` maps each zero state to its derivative, ``uncertain`` each parameter to a pair
    ``(lo, hi)``. ``order`` is the number of ``states``, else of the highest ``x_k`` in ``f``. ``answers`` are the
    file's optional keys: ``constants``, ``steady_state``, ``zero_dynamics_lyapunov``, ``internal_model``, ``gamma``,
    ``observer``.

    >>> x1, x2, s = sympy.symbols("x1 x2 s")
    >>> agent(-sympy.sin(x1) - x2, (s - 1) ** 2)["order"]
    2
    """
    renamed = {} if states is None else {state: sympy.Symbol(f"x{k}") for k, state in enumerate(states, 1)}
    named = {sympy.Symbol(str(state)): chain for state, chain in renamed.items()}
    described = {
        "zero_dynamics": zero_dynamics,
        "order": order or len(renamed) or _highest(f),
        "f": f,
        "b": b,
        "cost": cost,
        "uncertain": uncertain,
        **answers,
    }
    entries = {key: value for key, value in described.items() if value is not None}
    return MappingProxyType({key: _renamed(value, {**renamed, **named}) for key, value in entries.items()})


@dataclass(frozen=True)
class Network:
    """Agents on a directed graph, as a plant file would describe them.

    ``graph`` is a ``networkx.DiGraph``: an edge ``u → v`` says that v hears u, with its attribute ``weight`` (1 if left
    out); of an undirected graph both ends hear each other. Its nodes are the agents, numbered from 1 in their order,
    or by themselves where they are the numbers from 1 on. ``agents`` is one description (:func:`agent`) for all, or
    maps every node to its own. The other fields hold the keys of the plant file's tables of these names, with symbols
    or strings as names, numbers of any exact or float type, and pairs as intervals. ``units`` maps names to units, in
    which quantities of pint are taken; without one they are taken in SI base units.

    ``reference``, ``observer`` and ``eta`` of ``initial`` are 0 unless they or a ``box`` are given.

    >>> import networkx
    >>> x1, p, s, id = sympy.symbols("x1 p s id")
    >>> pair = networkx.DiGraph([(1, 2), (2, 1)])
    >>> described = agent(p * x1, (s - id) ** 2, uncertain={p: (-1, 1)})
    >>> Network("pair", pair, described, initial={"x": (-1, 1)}).plant.agents[1].cost
    (s - 2)**2
    """

    name: str
    graph: Any
    agents: Description | Mapping[Hashable, Description]
    exosystem: Description = field(default_factory=dict)
    initial: Description = field(default_factory=dict)
    constants: Description = field(default_factory=dict)
    coordinator: Description = field(default_factory=dict)
    gains: Description = field(default_factory=dict)
    requirements: Description = field(default_factory=dict)
    implementation: Description = field(default_factory=dict)
    units: Mapping[Any, str] = field(default_factory=dict)

    @property
    def numbers(self) -> Mapping[Hashable, int]:
        """The agent's number of every node."""
        nodes = list(self.graph.nodes)
        if set(nodes) == set(range(1, len(nodes) + 1)):
            return {node: node for node in sorted(nodes)}
        return {node: number for number, node in enumerate(nodes, 1)}

    @cached_property
    def text(self) -> str:
        """The plant file. Raises ``InputError``."""
        numbers = self.numbers
        if not numbers:
            raise InputError(f"{self.name}: graph: at least one node is needed, an agent each")
        lines = [f"schema = {toml_value(SCHEMA)}", f"name = {toml_value(self.name)}", ""]
        lines += ["[network]", f"agents = {len(numbers)}", f"edges = [{', '.join(self._edges())}]"]
        units = {str(name): str(unit) for name, unit in self.units.items()}
        for title in TABLES:
            table = self._initial() if title == "initial" else getattr(self, title)
            lines += _lines(f"[{title}]", table, title, units)
        for ids, described in self._described():
            lines += _lines("[[agent]]", {"ids": ids, **described}, f"agent {ids[0]}", units)
        return "\n".join(lines) + "\n"

    @cached_property
    def plant(self) -> Plant:
        """The plant that this file describes. Raises ``InputError``."""
        return parse_plant(self.text.encode(), self.name)

    def _edges(self) -> list[str]:
        numbers, graph = self.numbers, self.graph
        if graph.is_multigraph():
            raise InputError(f"{self.name}: graph: one edge from agent to agent is needed, not several")
        entries = []
        for source, target, data in graph.to_directed().edges(data=True):
            arrow = f"{numbers[source]} -> {numbers[target]}"
            weight = data.get("weight", 1)
            plain = exact_number(weight, f"graph, edge {source} -> {target}") == 1
            entries.append(toml_value(arrow if plain else [arrow, weight], f"graph, edge {source} -> {target}"))
        return entries

    def _initial(self) -> Description:
        open_ones = () if "box" in self.initial else (key for key in DESIGNERS if key not in self.initial)
        return {**self.initial, **dict.fromkeys(open_ones, 0)}

    def _described(self) -> list[tuple[list[int], Description]]:
        numbers = self.numbers
        given: Mapping[Any, Any] = self.agents
        if "f" in given:
            return [(list(numbers.values()), given)]
        strangers = [node for node in given if node not in numbers]
        missing = [node for node in numbers if node not in given]
        if strangers or missing:
            where = f"{strangers[0]!r} is no node of the graph" if strangers else f"node {missing[0]!r} has none"
            raise InputError(f"{self.name}: agents: a description for every node is needed, {where}")
        return [([number], given[node]) for node, number in numbers.items()]


def _lines(title: str, table: Description, where: str, units: Mapping[str, str]) -> list[str]:
    if not table:
        return []
    return [
        "",
        title,
        *(
            f"{key} = {toml_value(value, f'{where}: {key}', units)}"
            for key, value in table.items()
            if value is not None
        ),
    ]


def _highest(f: Any) -> int:
    """The highest index of the states ``x1, x2, …`` in ``f``, at least 1."""
    names = {str(name) for name in getattr(sympy.sympify(f) if isinstance(f, int) else f, "free_symbols", ())}
    indices = [int(name[1:]) for name in names if name[:1] == "x" and name[1:].isascii() and name[1:].isdigit()]
    return max([1, *indices])


def _renamed(value: Any, names: Mapping[Any, sympy.Symbol]) -> Any:
    if isinstance(value, sympy.Expr) and names:
        return value.xreplace(dict(names))
    if isinstance(value, Mapping):
        return {key: _renamed(entry, names) for key, entry in value.items()}
    return value
