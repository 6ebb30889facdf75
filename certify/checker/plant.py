"""Reads a plant file (TOML, ``consensus-plant/1``) exactly. Whatever is not understood is refused."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.checker.expressions import FUNCTIONS, NAME, Name, Node, Number, decimal, measure, parse
from certify.checker.linear import Matrix
from certify.checker.verdict import Malformed

SCHEMA = "consensus-plant/1"
MAX_BYTES = 1_000_000
MAX_AGENTS = 1_000
MAX_ORDER = 16
MAX_NAMES = 64
MAX_IRRATIONAL = 48
MAX_ENTRIES = 10_000

Box = tuple[Fraction, Fraction]
_EDGE = re.compile(r"\s*([0-9]{1,9})\s*->\s*([0-9]{1,9})\s*")
_RANGE = re.compile(r"\s*([0-9]{1,9})\s*(?:-|\.\.)\s*([0-9]{1,9})\s*")
_KEY_PART = rb"""(?:[A-Za-z0-9_-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+"""
_DEEP_KEY = re.compile(rb"(?<![A-Za-z0-9_-])(?:" + _KEY_PART + rb"){32}")  # on which tomllib takes quadratic time


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
    fixed: Mapping[str, Fraction]


@dataclass(frozen=True)
class _Decimal:
    """A TOML float as it is written."""

    text: str


def read_plant(data: bytes) -> Plant:
    """The plant in the bytes of a plant file. Raises ``Malformed``."""
    if len(data) > MAX_BYTES or _DEEP_KEY.search(data):
        raise Malformed("the plant file is too large")
    try:
        root = tomllib.loads(data.decode("utf-8"), parse_float=_Decimal)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"the plant file is not TOML: {error}") from None
    _keys(root, "schema name network agent initial", "constants exosystem coordinator gains")
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
    constants = _constants({}, root.get("constants", {}), set())
    exosystem, S = _exosystem(root["exosystem"], constants) if "exosystem" in root else ({}, [])
    fixed = {}
    for table, keys in (("coordinator", "alpha1 alpha2"), ("gains", "g K delta h")):
        for key, value in _keys(root.get(table, {}), "", keys).items():
            fixed[key] = _rational(value, constants)
            if fixed[key] <= 0:
                raise Malformed(f"{table}.{key} is positive")
    agents = _agents(root["agent"], root["initial"], size, constants, tuple(exosystem))
    return Plant(hashlib.sha256(data).hexdigest(), laplacian, exosystem, S, agents, fixed)


def _keys(value: Any, needed: str, optional: str = "") -> dict[str, Any]:
    """The table, if it has all the needed keys and no others than these and the optional ones."""
    if not isinstance(value, dict):
        raise Malformed("a table is needed")
    for key in value:
        if key not in needed.split() and key not in optional.split():
            raise Malformed(f"unknown key {key[:40]!r}")
    for key in needed.split():
        if key not in value:
            raise Malformed(f"the key {key} is missing")
    return value


def _list(value: Any, length: int | None = None) -> list[Any]:
    if not isinstance(value, list) or len(value) > MAX_ENTRIES or length not in (None, len(value)):
        raise Malformed("an array" + (f" of {length} entries" if length is not None else "") + " is needed")
    return value


def _integer(value: Any, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise Malformed(f"an integer from {least} to {most} is needed")
    return value


def _expression(value: Any, names: Mapping[str, Node]) -> Node:
    """A TOML number, read as the decimal it is, or a string holding an expression."""
    if type(value) is int and value.bit_length() <= 4000:
        return Number(Fraction(value))
    if isinstance(value, _Decimal):
        size = decimal(value.text.lstrip("+-").replace("_", ""))
        return Number(-size if value.text.startswith("-") else size)
    if not isinstance(value, str):
        raise Malformed("a number or an expression is needed")
    return parse(value, names)


def _rational(value: Any, constants: Mapping[str, Node]) -> Fraction:
    node = _expression(value, constants)
    if not isinstance(node, Number):
        raise Malformed("a rational number is needed")
    return node.value


def _vector(value: Any, constants: Mapping[str, Node], length: int | None = None) -> tuple[Fraction, ...]:
    return tuple(_rational(entry, constants) for entry in _list(value, length))


def _is_box(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and not any(isinstance(end, (list, dict)) for end in value)


def _box(value: Any, constants: Mapping[str, Node]) -> Box:
    """A pair ``[lo, hi]``, or one number for a point."""
    lo, hi = _vector(value, constants, 2) if isinstance(value, list) else [_rational(value, constants)] * 2
    if lo > hi:
        raise Malformed("an interval is empty")
    return lo, hi


def _declared(name: Any, taken: set[str]) -> str:
    """A new name, which from now on is taken."""
    if not isinstance(name, str) or not NAME.fullmatch(name) or len(name) > 40:
        raise Malformed(f"not a name: {str(name)[:40]!r}")
    if name in taken or name in FUNCTIONS or name in ("s", "id") or re.fullmatch("x[0-9]+", name):
        raise Malformed(f"the name {name} is taken")
    taken.add(name)
    return name


def _any_keys(value: Any) -> dict[str, Any]:
    if not isinstance(value, dict) or len(value) > MAX_ENTRIES:
        raise Malformed("a table is needed")
    return value


def _constants(known: Mapping[str, Node], table: Any, taken: set[str]) -> dict[str, Node]:
    """The known constants and those of the table, each of which may use the earlier ones."""
    constants = dict(known)
    taken.update(constants)
    for name, value in _any_keys(table).items():
        constants[_declared(name, taken)] = node = _expression(value, constants)
        measure(node)
    if sum(not isinstance(node, Number) for node in constants.values()) > MAX_IRRATIONAL:
        raise Malformed(f"more than {MAX_IRRATIONAL} constants that are not known to be rational")
    return constants


def _network(value: Any) -> tuple[int, Matrix]:
    table = _keys(value, "agents edges")
    size = _integer(table["agents"], 1, MAX_AGENTS)
    laplacian = [[Fraction(0)] * size for _ in range(size)]
    for entry in _list(table["edges"]):
        arrow, weight = _list(entry, 2) if isinstance(entry, list) else (entry, 1)
        match = _EDGE.fullmatch(arrow) if isinstance(arrow, str) else None
        if match is None:
            raise Malformed('an edge is "j -> i" or ["j -> i", weight]')
        source, target, a = int(match[1]) - 1, int(match[2]) - 1, _rational(weight, {})
        known = 0 <= source < size and 0 <= target < size and source != target
        if not known or laplacian[target][source] or a <= 0:
            raise Malformed(f"the edge {match[0]} is not possible")
        laplacian[target][source] = -a
        laplacian[target][target] += a
    return size, laplacian


def _exosystem(value: Any, constants: Mapping[str, Node]) -> tuple[dict[str, Box], Matrix | None]:
    table = _keys(value, "states S initial")
    taken = set(constants)
    states = [_declared(name, taken) for name in _list(table["states"])]
    if len(states) > MAX_ORDER:
        raise Malformed("too many exosystem states")
    n = len(states)
    rows = [[_expression(entry, constants) for entry in _list(row, n)] for row in _list(table["S"], n)]
    initial = _keys(table["initial"], " ".join(states))
    exact = all(isinstance(entry, Number) for row in rows for entry in row)
    S = [[entry.value for entry in row if isinstance(entry, Number)] for row in rows] if exact else None
    return {name: _box(initial[name], constants) for name in states}, S


def _agents(value: Any, initial: Any, size: int, constants: Mapping[str, Node], v: Sequence[str]) -> tuple[Agent, ...]:
    _keys(initial, "", "box z x eta observer reference")
    agents: dict[int, Agent] = {}
    for entry in _list(value):
        table = _keys(
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
    for entry in [value] if isinstance(value, str) else _list(value):
        match = _RANGE.fullmatch(entry) if isinstance(entry, str) else None
        first = _integer(int(match[1]) if match else entry, 1, size)
        ids += range(first, _integer(int(match[2]) if match else entry, first, size) + 1)
    if not 1 <= len(ids) <= size:
        raise Malformed("ids: the numbers of one or more agents are needed")
    return ids


def _agent(
    table: Mapping[str, Any], number: int, initial: Mapping[str, Any], shared: Mapping[str, Node], v: Sequence[str]
) -> Agent:
    order = _integer(table["order"], 1, MAX_ORDER)
    chain = [f"x{k}" for k in range(1, order + 1)]
    taken = {*shared, *v}
    zero = _any_keys(table.get("zero_dynamics", {}))
    z = [_declared(name, taken) for name in zero]
    constants = _constants({**shared, "id": Number(Fraction(number))}, table.get("constants", {}), taken)
    parameters = {name: _box(value, constants) for name, value in _any_keys(table.get("uncertain", {})).items()}
    w = [_declared(name, taken) for name in parameters]
    if max(len(z), len(w)) > MAX_NAMES:
        raise Malformed("too many states or parameters")

    def read(value: Any, *names: str) -> Node:
        return _expression(value, {**constants, **{name: Name(name) for name in names}})

    if "steady_state" in table:  # the certificate's is the one that is proved
        for value in _keys(table["steady_state"], " ".join(z)).values():
            read(value, "s", *v, *w)
    if "zero_dynamics_lyapunov" in table:
        read(table["zero_dynamics_lyapunov"], *z)
    model = None
    if "internal_model" in table:
        choice = _keys(table["internal_model"], "M N")
        N = _vector(choice["N"], constants)
        model = ([_vector(row, constants, len(N)) for row in _list(choice["M"], len(N))], N)
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
        z_box=_components(initial, "z", z, constants),
        x_box=_components(initial, "x", chain, constants),
        observer_box=None if measured else _components(initial, "observer", chain, constants),
        eta_box=_default(initial, "eta", constants),
        reference_box=_default(initial, "reference", constants),
        gamma=_vector(table["gamma"], constants, order - 1) if "gamma" in table else None,
        observer=_vector(table["observer"], constants, order) if "observer" in table else None,
        internal_model=model,
    )


def _default(initial: Mapping[str, Any], key: str, constants: Mapping[str, Node]) -> Box:
    value = initial.get(key, initial.get("box"))
    if value is None:
        raise Malformed(f"initial.{key} is missing, and there is no initial.box")
    return _box(value, constants)


def _components(
    initial: Mapping[str, Any], key: str, names: Sequence[str], constants: Mapping[str, Node]
) -> tuple[Box, ...]:
    """One box for all components, an array of one per component, or a table by component; ``box`` stands in."""
    value = initial.get(key)
    if isinstance(value, dict):
        return tuple(_default({"box": initial.get("box"), **value}, name, constants) for name in names)
    if isinstance(value, list) and names and not _is_box(value):
        if not all(map(_is_box, value)):
            raise Malformed(f"initial.{key}: one pair for every component is needed")
        return tuple(_box(entry, constants) for entry in _list(value, len(names)))
    return tuple(_default(initial, key, constants) for _ in names)


def _check_unused(initial: Mapping[str, Any], agents: Collection[Agent], constants: Mapping[str, Node]) -> None:
    """Refuses a component that no agent has, and what is no box where no agent needs one."""
    z = {name for agent in agents for name in agent.zero_states}
    x = {name for agent in agents for name in agent.chain}
    for key, names in (("box", set()), ("z", z), ("x", x), ("observer", x)):
        if isinstance(initial.get(key), dict) and key != "box":
            _keys(initial[key], "", " ".join(names))
        elif key in initial and not names:
            _box(initial[key], constants)
