"""Plant files (TOML, ``consensus-plant/1``) read into an exact, frozen ``Plant``."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

import sympy

from symbolic.agent_file import MAX_AGENTS, read_agents
from symbolic.errors import InputError, Where, quoted, shown
from symbolic.names import Scope
from symbolic.plant import Digraph, Edge, Exosystem, Interval, Plant, symbol
from symbolic.requested_file import read_requested
from symbolic.tables import (
    MAX_FILE_BYTES,
    Table,
    array,
    constant,
    integer,
    interval,
    number,
    read_toml,
    string,
)

SCHEMA = "consensus-plant/1"
MAX_EDGES = 100_000
MAX_EXOSYSTEM = 16
MAX_CONSTANTS = 1_000

_KEYS = (
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
    """The plant in a file of at most ``MAX_FILE_BYTES``. Raises ``InputError``."""
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    return parse_plant(data, str(path))


def parse_plant(data: bytes, source: str) -> Plant:
    """The plant in the bytes of a plant file; ``source`` is how messages name it. Raises ``InputError``."""
    root = read_toml(data, Where(source))
    root.allow(_KEYS)
    if root.need("schema", f'schema = "{SCHEMA}"') != SCHEMA:
        raise root.at("schema").error(f"this version reads {quoted(SCHEMA)} only")
    name = string(root.need("name", 'name = "two-motors"'), root.at("name"))
    network = root.need("network", 'network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }')
    digraph = _network(Table(network, root.at("network"), ("agents", "edges")))
    scope = Scope().with_constants(root.table("constants"), most=MAX_CONSTANTS)
    exosystem, scope = _exosystem(root.table("exosystem", ("states", "S", "initial")), scope, "exosystem" in root)
    agents = read_agents(root, digraph.agents, scope)
    requested = read_requested(root, digraph.agents, scope.constants)
    return Plant(
        name=name,
        digraph=digraph,
        exosystem=exosystem,
        agents=agents,
        sha256=hashlib.sha256(data).hexdigest(),
        source=data,
        coordinator=requested.coordinator,
        gains=requested.gains,
        requirements=requested.requirements,
        implementations=requested.implementations,
    )


def _network(table: Table) -> Digraph:
    agents = integer(table.need("agents"), table.at("agents"), least=1, most=MAX_AGENTS)
    edges: dict[tuple[int, int], Edge] = {}
    for position, entry in enumerate(array(table.need("edges"), table.at("edges"), most=MAX_EDGES), 1):
        where = table.at("edges").at(position)
        pair = entry if isinstance(entry, list) else [entry, 1]
        if len(pair) != 2 or not isinstance(pair[0], str):
            raise where.error('an edge is "j -> i" or ["j -> i", weight]')
        match = _EDGE.fullmatch(pair[0])
        if match is None:
            raise where.error(f'an edge is written "j -> i", found {quoted(pair[0])}')
        source, target = int(match[1]), int(match[2])
        for end in (source, target):
            if not 1 <= end <= agents:
                raise where.error(f"there is no agent {end}; agents are 1 to {agents}")
        if source == target:
            raise where.error(f"agent {source} cannot hear itself")
        if (source, target) in edges:
            raise where.error(f"the edge {source} -> {target} is given twice")
        weight = number(pair[1], where, {})
        if weight <= 0:
            raise where.error(f"a weight is positive, found {shown(weight)}")
        edges[source, target] = Edge(source, target, weight)
    return Digraph(agents, tuple(edges.values()))


def _exosystem(table: Table, scope: Scope, given: bool) -> tuple[Exosystem, Scope]:
    if not given:
        return Exosystem((), sympy.ImmutableMatrix(0, 0, []), ()), scope
    states = array(table.need("states"), table.at("states"), most=MAX_EXOSYSTEM, what="states")
    for position, state in enumerate(states, 1):
        scope = scope.with_state(state, table.at("states").at(position), "an exosystem state")
    names = [str(state) for state in states]
    rows = _square(table.need("S"), table.at("S"), scope.constants, len(names))
    start = Table(table.need("initial"), table.at("initial"), names)
    initial = tuple(_start(start, name, scope.constants) for name in names)
    return Exosystem(tuple(symbol(name) for name in names), rows, initial), scope


def _square(value: object, where: Where, constants: Mapping[str, sympy.Expr], size: int) -> sympy.ImmutableMatrix:
    rows = []
    for i, row in enumerate(array(value, where, most=MAX_EXOSYSTEM, what="rows"), 1):
        entries = array(row, where.at(i), most=MAX_EXOSYSTEM, what="columns")
        rows.append([constant(entry, where.at(i).at(j), constants) for j, entry in enumerate(entries, 1)])
    if len(rows) != size or any(len(row) != size for row in rows):
        raise where.error(f"a {size} by {size} matrix is needed, one row and column per state")
    return sympy.ImmutableMatrix(size, size, [entry for row in rows for entry in row])


def _start(table: Table, name: str, constants: Mapping[str, sympy.Expr]) -> Interval:
    return interval(table.need(name), table.at(name), constants)
