"""Reads a plant file (TOML, ``consensus-plant/1``) exactly. Whatever is not understood is refused."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.checker.expressions import Name, Node, Number, measure
from certify.checker.linear import Matrix
from certify.checker.requested import Coordinator, Gains, Implementation, Requested, Requirements, read_requested
from certify.checker.tables import (
    MAX_BYTES,
    Box,
    any_keys,
    array,
    box,
    declared,
    expression,
    integer,
    is_box,
    rational,
    read_toml,
    table_of,
    vector,
)
from certify.checker.verdict import Malformed

__all__ = ["MAX_BYTES", "SCHEMA", "Agent", "Box", "Plant", "read_plant"]

SCHEMA = "consensus-plant/1"
MAX_AGENTS = 1_000
MAX_ORDER = 16
MAX_NAMES = 64
MAX_CONSTANTS = 1_000
MAX_AGENT_CONSTANTS = 200
MAX_EDGES = 100_000
MAX_IRRATIONAL = 48

_EDGE = re.compile(r"\s*([0-9]{1,9})\s*->\s*([0-9]{1,9})\s*")
_RANGE = re.compile(r"\s*([0-9]{1,9})\s*(?:-|\.\.)\s*([0-9]{1,9})\s*")


@dataclass(frozen=True)
class Agent:
    """``z' = f0``, ``x_k' = x_(k+1)``, ``x_n' = f + b u``, cost in ``s``; boxes of the parameters and initial states.

    ``observer_box is None`` means ``x~_1(0) = y(0)`` and the rest 0. ``gamma``, ``observer``, ``M``, ``N`` are None
    unless the file fixes them.
    """

    id: int
    order: int
    zero_states: tuple[str, ...]
    zero_dynamics: tuple[Node, ...]
    f: Node
    b: Node
    cost: Node
    parameters: Mapping[str, Box]
    z_box: tuple[Box, ...]
    x_box: tuple[Box, ...]
    observer_box: tuple[Box, ...] | None
    eta_box: Box
    reference_box: Box
    gamma: tuple[Fraction, ...] | None
    observer: tuple[Fraction, ...] | None
    internal_model: tuple[Matrix, tuple[Fraction, ...]] | None

    @property
    def chain(self) -> tuple[str, ...]:
        return tuple(f"x{k}" for k in range(1, self.order + 1))


@dataclass(frozen=True)
class Plant:
    """The network; ``laplacian[i][j] = −a_ij``. ``S`` is None where an entry is not known to be rational."""

    sha256: str
    laplacian: Matrix
    exosystem: Mapping[str, Box]
    S: Matrix | None
    agents: tuple[Agent, ...]
    requested: Requested

    @property
    def coordinator(self) -> Coordinator:
        return self.requested.coordinator

    def gains_of(self, number: int) -> Gains:
        """What the file fixes of agent ``number``'s gains."""
        return self.requested.gains[number - 1]

    def requirements_of(self, number: int) -> Requirements:
        return self.requested.requirements[number - 1]

    def implementation_of(self, number: int) -> Implementation | None:
        """``None`` if the controller is not sampled."""
        return self.requested.implementations[number - 1]


def read_plant(data: bytes) -> Plant:
    """The plant in the bytes of a plant file. Raises ``Malformed``."""
    root = read_toml(data)
    table_of(
        root, "schema name network agent initial", "constants exosystem coordinator gains requirements implementation"
    )
    if root["schema"] != SCHEMA:
        raise Malformed(f"the plant file's schema is not {SCHEMA}")
    if (
        not isinstance(root["name"], str)
        or not root["name"].strip()
        or len(root["name"]) > 200
        or (not root["name"].isprintable())
    ):
        raise Malformed("the plant's name is a line of text")
    size, laplacian = _network(root["network"])
    constants = _constants({}, root.get("constants", {}), set(), MAX_CONSTANTS)
    exosystem, S = _exosystem(root["exosystem"], constants) if "exosystem" in root else ({}, [])
    agents = _agents(root["agent"], root["initial"], size, constants, tuple(exosystem))
    return Plant(
        hashlib.sha256(data).hexdigest(), laplacian, exosystem, S, agents, read_requested(root, size, constants)
    )


def _constants(known: Mapping[str, Node], table: Any, taken: set[str], most: int) -> dict[str, Node]:
    """The known constants and those of the table, each of which may use the earlier ones."""
    if len(any_keys(table)) > most:
        raise Malformed(f"more than {most} constants")
    constants = dict(known)
    taken.update(constants)
    for name, value in any_keys(table).items():
        constants[declared(name, taken)] = node = expression(value, constants)
        measure(node)
    if sum(not isinstance(node, Number) for node in constants.values()) > MAX_IRRATIONAL:
        raise Malformed(f"more than {MAX_IRRATIONAL} constants that are not known to be rational")
    return constants


def _network(value: Any) -> tuple[int, Matrix]:
    table = table_of(value, "agents edges")
    size = integer(table["agents"], 1, MAX_AGENTS)
    laplacian = [[Fraction(0)] * size for _ in range(size)]
    for entry in array(table["edges"], most=MAX_EDGES):
        arrow, weight = array(entry, 2) if isinstance(entry, list) else (entry, 1)
        match = _EDGE.fullmatch(arrow) if isinstance(arrow, str) else None
        if match is None:
            raise Malformed('an edge is "j -> i" or ["j -> i", weight]')
        source, target, a = int(match[1]) - 1, int(match[2]) - 1, rational(weight, {})
        known = 0 <= source < size and 0 <= target < size and source != target
        if not known or laplacian[target][source] or a <= 0:
            raise Malformed(f"the edge {match[0]} is not possible")
        laplacian[target][source] = -a
        laplacian[target][target] += a
    return size, laplacian


def _exosystem(value: Any, constants: Mapping[str, Node]) -> tuple[dict[str, Box], Matrix | None]:
    table = table_of(value, "states S initial")
    taken = set(constants)
    states = [declared(name, taken) for name in array(table["states"])]
    if len(states) > MAX_ORDER:
        raise Malformed("too many exosystem states")
    n = len(states)
    rows = [[expression(entry, constants) for entry in array(row, n)] for row in array(table["S"], n)]
    initial = table_of(table["initial"], " ".join(states))
    exact = all(isinstance(entry, Number) for row in rows for entry in row)
    S = [[entry.value for entry in row if isinstance(entry, Number)] for row in rows] if exact else None
    return {name: box(initial[name], constants) for name in states}, S


def _agents(value: Any, initial: Any, size: int, constants: Mapping[str, Node], v: Sequence[str]) -> tuple[Agent, ...]:
    table_of(initial, "", "box z x eta observer reference")
    agents: dict[int, Agent] = {}
    for entry in array(value):
        table = table_of(
            entry,
            "ids order f b cost",
            "zero_dynamics constants uncertain steady_state zero_dynamics_lyapunov internal_model gamma observer",
        )
        for number in _ids(table["ids"], size):
            if number in agents:
                raise Malformed(f"agent {number} is described twice")
            agents[number] = _agent(table, number, initial, constants, v)
    if len(agents) < size:
        raise Malformed("an agent has no [[agent]] table")
    _check_unused(initial, agents.values(), {**constants, "id": Number(Fraction(1))})
    return tuple(agents[number] for number in range(1, size + 1))


def _ids(value: Any, size: int) -> list[int]:
    """The numbers in ``[1, 2]``, ``"3-5"`` or ``[1, "3-5"]``."""
    ids: list[int] = []
    for entry in [value] if isinstance(value, str) else array(value):
        match = _RANGE.fullmatch(entry) if isinstance(entry, str) else None
        first = integer(int(match[1]) if match else entry, 1, size)
        ids += range(first, integer(int(match[2]) if match else entry, first, size) + 1)
    if not 1 <= len(ids) <= size:
        raise Malformed("ids: the numbers of one or more agents are needed")
    return ids


def _agent(
    table: Mapping[str, Any], number: int, initial: Mapping[str, Any], shared: Mapping[str, Node], v: Sequence[str]
) -> Agent:
    order = integer(table["order"], 1, MAX_ORDER)
    chain = [f"x{k}" for k in range(1, order + 1)]
    taken = {*shared, *v}
    zero = any_keys(table.get("zero_dynamics", {}))
    z = [declared(name, taken) for name in zero]
    start = {**shared, "id": Number(Fraction(number))}  # what [initial] sees: no agent's own constants
    constants = _constants(start, table.get("constants", {}), taken, MAX_AGENT_CONSTANTS)
    parameters = {name: box(value, constants) for name, value in any_keys(table.get("uncertain", {})).items()}
    w = [declared(name, taken) for name in parameters]
    if len(z) > MAX_ORDER or len(w) > MAX_NAMES:
        raise Malformed("too many states or parameters")

    def read(value: Any, *names: str) -> Node:
        return expression(value, {**constants, **{name: Name(name) for name in names}})

    if "steady_state" in table:  # the certificate's is the one that is proved
        for value in table_of(table["steady_state"], " ".join(z)).values():
            read(value, "s", *v, *w)
    if "zero_dynamics_lyapunov" in table:
        if not z:
            raise Malformed("zero_dynamics_lyapunov: there are no zero dynamics")
        read(table["zero_dynamics_lyapunov"], *z)
    model = None
    if "internal_model" in table:
        choice = table_of(table["internal_model"], "M N")
        N = vector(choice["N"], constants)
        if not 1 <= len(N) <= MAX_NAMES:
            raise Malformed(f"an internal model has 1 to {MAX_NAMES} states")
        model = ([vector(row, constants, len(N)) for row in array(choice["M"], len(N))], N)
    measured = initial.get("observer") == "measured"
    return Agent(
        id=number,
        order=order,
        zero_states=tuple(z),
        parameters=parameters,
        zero_dynamics=tuple(read(value, *z, "x1", *v, *w) for value in zero.values()),
        f=read(table["f"], *z, *chain, *v, *w),
        b=read(table["b"], *w),
        cost=read(table["cost"], "s"),
        z_box=_components(initial, "z", z, start),
        x_box=_components(initial, "x", chain, start),
        observer_box=None if measured else _components(initial, "observer", chain, start),
        eta_box=_default(initial, "eta", start),
        reference_box=_default(initial, "reference", start),
        gamma=vector(table["gamma"], constants, order - 1) if "gamma" in table else None,
        observer=vector(table["observer"], constants, order) if "observer" in table else None,
        internal_model=model,
    )


def _default(initial: Mapping[str, Any], key: str, constants: Mapping[str, Node]) -> Box:
    value = initial.get(key, initial.get("box"))
    if value is None:
        raise Malformed(f"initial.{key} is missing, and there is no initial.box")
    return box(value, constants)


def _components(
    initial: Mapping[str, Any], key: str, names: Sequence[str], constants: Mapping[str, Node]
) -> tuple[Box, ...]:
    """One box for all components, an array of one per component, or a table by component; ``box`` stands in."""
    value = initial.get(key)
    if isinstance(value, dict):  # its keys are the user's names, among them perhaps "box"
        return tuple(
            box(value[name], constants) if name in value else _default(initial, "box", constants) for name in names
        )
    if isinstance(value, list) and names and not is_box(value):
        if not all(map(is_box, value)):
            raise Malformed(f"initial.{key}: one pair for every component is needed")
        return tuple(box(entry, constants) for entry in array(value, len(names)))
    return tuple(_default(initial, key, constants) for _ in names)


def _check_unused(initial: Mapping[str, Any], agents: Collection[Agent], constants: Mapping[str, Node]) -> None:
    """Refuses a component that no agent has, and what is no box where no agent needs one."""
    z = {name for agent in agents for name in agent.zero_states}
    x = {name for agent in agents for name in agent.chain}
    for key, names in (("box", set()), ("z", z), ("x", x), ("observer", x)):
        if isinstance(initial.get(key), dict) and key != "box":
            table_of(initial[key], "", " ".join(names))
        elif key in initial and not names:
            box(initial[key], constants)
