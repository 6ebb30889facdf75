"""Plant files (TOML, ``consensus-plant/1``, docs/plant-file.md) read into an exact, frozen ``Plant``.

Reading goes on after a fault, so that all that is wrong with a file is said at once: what cannot be read is replaced by
something harmless, and no plant is made.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from fractions import Fraction
from functools import partial
from pathlib import Path

import sympy

from symbolic import messages
from symbolic.agent_file import MAX_AGENTS, read_agents
from symbolic.errors import Enough, InputError, Problem, Problems, Where, quoted, shown
from symbolic.names import STAND_IN, Scope
from symbolic.plant import Digraph, Edge, Exosystem, Interval, Plant, symbol
from symbolic.requested_file import read_requested
from symbolic.tables import (
    MAX_FILE_BYTES,
    Table,
    Value,
    array,
    constant,
    integer,
    interval,
    kind,
    number,
    read_toml,
    string,
)
from symbolic.toml_places import Places

SCHEMA = "consensus-plant/1"
MAX_EDGES = 100_000
MAX_EXOSYSTEM = 16
MAX_CONSTANTS = 1_000
ORIGIN = Interval(Fraction(0), Fraction(0))

KEYS = (
    "schema",
    "name",
    "network",
    "constants",
    "exosystem",
    "initial",
    "agent",
    "coordinator",
    "gains",
    "requirements",
    "implementation",
)
_EDGE = re.compile(r"\s*([0-9]{1,9})\s*->\s*([0-9]{1,9})\s*")


def load_plant(path: str | Path) -> Plant:
    """The plant in a file of at most ``MAX_FILE_BYTES``. Raises ``InputError`` with a line for each fault."""
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(Problem(str(path), "", messages.UNREADABLE(why=why))) from None
    return parse_plant(data, str(path))


def parse_plant(data: bytes, source: str) -> Plant:
    """The plant in the bytes of a plant file; ``source`` is how messages name it. Raises ``InputError`` with a line for
    each fault."""
    problems = Problems()
    root = read_toml(data, Where(source, problems=problems))
    try:
        plant = root.where.attempt(partial(_plant, root, data), None)
    except Enough:
        plant = None
    problems.finish(lambda: Places(data.decode("utf-8")))
    assert plant is not None  # or there was a problem
    return plant


def _plant(root: Table, data: bytes) -> Plant | None:
    """``None`` if there was any fault."""
    root.allow(KEYS)
    root.read("schema", f'schema = "{SCHEMA}"', _schema, None)
    name = root.read("name", 'name = "two-motors"', string, "")
    network = root.read("network", 'network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }', _network, None)
    scope = Scope().with_constants(root.table("constants"), most=MAX_CONSTANTS)
    exosystem, scope = _exosystem(root.table("exosystem", ("states", "S", "initial")), scope, "exosystem" in root)
    count = network.agents if network else None
    agents = read_agents(root, count, scope)
    requested = read_requested(root, count or MAX_AGENTS, scope.constants)
    if network is None or (root.where.problems and root.where.problems.found):
        return None
    return Plant(
        name=name,
        digraph=network,
        exosystem=exosystem,
        agents=agents,
        sha256=hashlib.sha256(data).hexdigest(),
        source=data,
        coordinator=requested.coordinator,
        gains=requested.gains,
        requirements=requested.requirements,
        implementations=requested.implementations,
    )


def _schema(value: Value, where: Where) -> None:
    if value != SCHEMA:
        raise where.error(messages.SCHEMA(schema=quoted(SCHEMA)))


def _network(value: Value, where: Where) -> Digraph | None:
    """``None`` if the number of agents could not be read."""
    table = Table(value, where, ("agents", "edges"))
    agents = table.read("agents", "agents = 2", partial(integer, least=1, most=MAX_AGENTS), None)
    entries = table.read("edges", 'edges = ["1 -> 2", "2 -> 1"]', partial(array, most=MAX_EDGES), list[Value]())
    edges: dict[tuple[int, int], Edge] = {}
    for position, entry in enumerate(entries, 1):
        here = table.at("edges").at(position)
        edge = here.attempt(partial(_edge, entry, here, agents or MAX_AGENTS), None)
        if edge is None:
            continue
        if (edge.source, edge.target) in edges:
            here.report(messages.EDGE_TWICE(source=edge.source, target=edge.target))
        edges[edge.source, edge.target] = edge
    return None if agents is None else Digraph(agents, tuple(edges.values()))


def _edge(entry: Value, where: Where, agents: int) -> Edge:
    pair = entry if isinstance(entry, list) else [entry, 1]
    if len(pair) != 2 or not isinstance(pair[0], str):
        raise where.error(messages.EDGE())
    match = _EDGE.fullmatch(pair[0])
    if match is None:
        raise where.error(messages.ARROW(found=quoted(pair[0])))
    source, target = int(match[1]), int(match[2])
    for end in (source, target):
        if not 1 <= end <= agents:
            raise where.error(messages.NO_AGENT(number=end, most=agents))
    if source == target:
        raise where.error(messages.HEARS_ITSELF(number=source))
    weight = number(pair[1], where, {})
    if weight <= 0:
        raise where.error(messages.WEIGHT(found=shown(weight)))
    return Edge(source, target, weight)


def _exosystem(table: Table, scope: Scope, given: bool) -> tuple[Exosystem, Scope]:
    if not given:
        return Exosystem((), sympy.ImmutableMatrix(0, 0, []), ()), scope
    states = table.read("states", 'states = ["v1", "v2"]', _states, list[Value]())
    for position, state in enumerate(states, 1):
        scope = scope.with_state(state, table.at("states").at(position), "an exosystem state")
    names = scope.exosystem
    square = partial(_square, constants=scope.constants, size=len(states))
    rows = table.read("S", "S = [[0, 1], [-1, 0]]", square, sympy.ImmutableMatrix.zeros(len(states), len(states)))
    start = table.read("initial", "initial = { v1 = 0, v2 = [-1, 1] }", partial(Table, keys=names), None)
    read = partial(interval, constants=scope.constants)
    initial = tuple(start.read(name, f"{name} = 0", read, ORIGIN) for name in names) if start else ()
    return Exosystem(tuple(symbol(name) for name in names), rows, initial), scope


def _states(value: Value, where: Where) -> list[Value]:
    if isinstance(value, str):  # one state without brackets is read as if they were there
        where.report(messages.ARRAY(found=kind(value)))
        return [value]
    return array(value, where, most=MAX_EXOSYSTEM, what="states")


def _square(value: Value, where: Where, constants: Mapping[str, sympy.Expr], size: int) -> sympy.ImmutableMatrix:
    rows = []
    for i, row in enumerate(array(value, where, most=MAX_EXOSYSTEM, what="rows"), 1):
        here = where.at(i)
        entries = here.attempt(partial(array, row, here, most=MAX_EXOSYSTEM, what="columns"), list[Value]([0] * size))
        rows.append([_entry(entry, here.at(j), constants) for j, entry in enumerate(entries, 1)])
    if len(rows) != size or any(len(row) != size for row in rows):
        raise where.error(messages.SQUARE(size=size))
    return sympy.ImmutableMatrix(size, size, [entry for row in rows for entry in row])


def _entry(value: Value, where: Where, constants: Mapping[str, sympy.Expr]) -> sympy.Expr:
    return where.attempt(partial(constant, value, where, constants), STAND_IN)
