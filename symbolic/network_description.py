"""A plant from SymPy expressions and a directed graph: the keys of a plant file as Python values.

What is given is written as a plant file and read by the reader of plant files, so that Python and files mean the same
and are refused for the same reasons.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import sympy

from symbolic.errors import InputError
from symbolic.expression_text import without_time
from symbolic.interval import Interval
from symbolic.plant import Agent, Exosystem, Plant
from symbolic.plant_file import SCHEMA, parse_plant
from symbolic.plant_writer import with_source
from symbolic.toml_value import exact_number, toml_value

Description = Mapping[str, Any]
Described = tuple[list[int], Description]  # agents' numbers and the keys of their table
DESIGNERS = ("reference", "observer", "eta")  # initial values that are the designer's choice: 0 where left open
OWN_STATES = "states"  # of an agent's description: the user's names of x1 … xn
OWN_EXOSYSTEM = "exosystem"  # of an agent's description: the one its model was brought into normal form with
OWN_BOX = "initial"  # of an agent's description: where its own states start, by name (models bring it along)
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
    keys = {key: _renamed(value, {**renamed, **named}) for key, value in entries.items()}
    return MappingProxyType({**keys, **({OWN_STATES: tuple(map(str, states))} if states is not None else {})})


@dataclass(frozen=True, repr=False)
class Network:
    """Agents on a directed graph, as a plant file would describe them.

    ``graph`` is a ``networkx.DiGraph``: an edge ``u → v`` says that v hears u, with its attribute ``weight`` (1 if left
    out); of an undirected graph both ends hear each other. Its nodes are the agents, numbered from 1 in their order,
    or by themselves where they are the numbers from 1 on. ``agents`` is one description (:func:`agent`) for all, one
    for each in that order, or maps every node to its own. The other fields hold the keys of the plant file's tables of
    these names, with symbols or strings as names, numbers of any exact or float type, and pairs as intervals. ``units``
    maps names to units, in which quantities of pint are taken; without one they are taken in SI base units.

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
    agents: Description | Sequence[Description] | Mapping[Hashable, Description]
    exosystem: Description = field(default_factory=dict)
    initial: Description = field(default_factory=dict)
    constants: Description = field(default_factory=dict)
    coordinator: Description = field(default_factory=dict)
    gains: Description = field(default_factory=dict)
    requirements: Description = field(default_factory=dict)
    implementation: Description = field(default_factory=dict)
    units: Mapping[Any, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not all(hasattr(self.graph, part) for part in ("nodes", "to_directed", "is_multigraph")):
            found = type(self.graph).__name__
            raise InputError(f"{self.name}: graph: a graph of networkx is needed, found {found}")

    def __repr__(self) -> str:
        return f"<Network {self.name!r}: {len(self.graph.nodes)} agents, {len(self.graph.edges)} edges>"

    @property
    def numbers(self) -> Mapping[Hashable, int]:
        """The agent's number of every node."""
        nodes = list(self.graph.nodes)
        if set(nodes) == set(range(1, len(nodes) + 1)):
            return {node: node for node in sorted(nodes)}
        return {node: number for number, node in enumerate(nodes, 1)}

    @property
    def text(self) -> str:
        """The plant file. Raises ``InputError``."""
        return self.plant.source.decode()

    @cached_property
    def _described_text(self) -> str:
        """The plant file, but for boxes that belong to single agents."""
        numbers = self.numbers
        if not numbers:
            raise InputError(f"{self.name}: graph: at least one node is needed, an agent each")
        network = {"agents": len(numbers), "edges": self._edges()}
        tables = {title: self._initial() if title == "initial" else getattr(self, title) for title in TABLES}
        own = self._own_states()
        units = {own.get(str(name), str(name)): unit for name, unit in self.units.items()}
        return document(self.name, {"network": network, **tables}, self._described(), units)

    @cached_property
    def plant(self) -> Plant:
        """The plant that this file describes. Raises ``InputError``."""
        plant = reading(self._described_text, self.name)
        return starting_in_own_boxes(plant, self._described())

    def _edges(self) -> list[Any]:
        numbers, graph = self.numbers, self.graph
        if graph.is_multigraph():
            raise InputError(f"{self.name}: graph: one edge from agent to agent is needed, not several")
        entries = []
        for source, target, data in graph.to_directed().edges(data=True):
            arrow = f"{numbers[source]} -> {numbers[target]}"
            weight = data.get("weight", 1)
            plain = exact_number(weight, f"graph, edge {source} -> {target}") == 1
            entries.append(arrow if plain else [arrow, weight])
        return entries

    def _initial(self) -> Description:
        open_ones = () if "box" in self.initial else (key for key in DESIGNERS if key not in self.initial)
        given = {**self.initial, **dict.fromkeys(open_ones, 0)}
        if all(OWN_BOX in described for _, described in self._described()):
            given = {"x": 0, "z": 0, **given}  # every agent brings its own
        own = self._own_states()
        return {
            key: {own.get(str(name), name): side for name, side in value.items()}
            if key in ("x", "observer") and isinstance(value, Mapping)
            else value
            for key, value in given.items()
        }

    def _own_states(self) -> dict[str, str]:
        """The chain's name of every state that descriptions call otherwise. Raises ``InputError`` where they differ."""
        own: dict[str, str] = {}
        for _, described in self._described():
            for k, name in enumerate(described.get(OWN_STATES, ()), 1):
                if own.setdefault(name, f"x{k}") != f"x{k}":
                    reason = f"the state {name!r} is {own[name]} of one and x{k} of another"
                    raise InputError(f"{self.name}: agents: {reason}")
        return own

    def _described(self) -> list[Described]:
        numbers = self.numbers
        if isinstance(self.agents, Sequence):
            if len(self.agents) != len(numbers):
                reason = f"{len(self.agents)} descriptions for {len(numbers)} nodes"
                raise InputError(f"{self.name}: agents: a description for every node is needed, found {reason}")
            return [([number], keys) for number, keys in zip(numbers.values(), self.agents, strict=True)]
        given: Mapping[Any, Any] = self.agents
        if "f" in given:
            each = [[number] for number in numbers.values()] if OWN_BOX in given else [list(numbers.values())]
            return [(ids, given) for ids in each]
        strangers = [node for node in given if node not in numbers]
        missing = [node for node in numbers if node not in given]
        if strangers or missing:
            where = f"{strangers[0]!r} is no node of the graph" if strangers else f"node {missing[0]!r} has none"
            raise InputError(f"{self.name}: agents: a description for every node is needed, {where}")
        return [([number], given[node]) for node, number in numbers.items()]


def document(
    name: str, tables: Mapping[str, Description], described: Iterable[Described], units: Mapping[Any, str] | None = None
) -> str:
    """The plant file with these tables and agents; boxes of single agents are left to :func:`starting_in_own_boxes`."""
    named = {str(key): str(unit) for key, unit in (units or {}).items()}
    lines = [f"schema = {toml_value(SCHEMA)}", f"name = {toml_value(name)}"]
    for title, table in tables.items():
        lines += _lines(f"[{title}]", table, title, named)
    for ids, keys in described:
        own = {key: value for key, value in keys.items() if key not in (OWN_BOX, OWN_STATES, OWN_EXOSYSTEM)}
        lines += _lines("[[agent]]", {"ids": ids, **own}, f"agent {ids[0]}", named)
    return "\n".join(lines) + "\n"


def reading(text: str, source: str) -> Plant:
    """The plant of a text that the user has not written: messages name the key, but no line of it."""
    try:
        return parse_plant(text.encode(), source)
    except InputError as error:
        raise InputError(*(replace(problem, position=None) for problem in error.problems)) from None


def starting_in_own_boxes(plant: Plant, described: Iterable[Described]) -> Plant:
    """The plant with the boxes that descriptions of single agents bring along. Raises ``InputError``."""
    described = list(described)
    for ids, keys in described:
        if OWN_EXOSYSTEM in keys and not _is_part_of(keys[OWN_EXOSYSTEM], plant.exosystem):
            raise InputError(f"{plant.name}: agent {ids[0]}: its model was given another exosystem than the network's")
    boxes = {ids[0]: keys[OWN_BOX] for ids, keys in described if OWN_BOX in keys}
    if not boxes:
        return plant
    agents = tuple(_starting_in(agent, boxes.get(agent.id, {})) for agent in plant.agents)
    return with_source(replace(plant, agents=agents, source=b""))


def _is_part_of(own: Exosystem, whole: Exosystem) -> bool:
    """Whether the states of ``own`` move by themselves in ``whole`` as they do in ``own``, from no larger box."""
    if not set(own.states) <= set(whole.states):
        return False
    places = [whole.states.index(state) for state in own.states]
    starts = zip(own.initial, (whole.initial[place] for place in places), strict=True)
    rows = whole.S.extract(places, list(range(whole.S.cols)))
    wanted = sympy.zeros(len(places), whole.S.cols)
    for column, place in enumerate(places):
        wanted[:, place] = own.S[:, column]
    return bool(rows == wanted) and all(mine.lo <= side.lo and side.hi <= mine.hi for mine, side in starts)


def _starting_in(agent: Agent, box: Mapping[str, Interval]) -> Agent:
    """The agent with the sides of its initial box that the mapping has."""
    z, x = (
        tuple(box.get(name.name, side) for name, side in zip(names, sides, strict=True))
        for names, sides in ((agent.zero_states, agent.initial.z), (agent.chain, agent.initial.x))
    )
    return replace(agent, initial=replace(agent.initial, z=z, x=x))


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
    if isinstance(value, sympy.Expr):
        return without_time(value).xreplace(dict(names))
    if isinstance(value, Mapping):
        return {key: _renamed(entry, names) for key, entry in value.items()}
    return value
