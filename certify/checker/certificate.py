"""Reads a certificate (canonical JSON, ``consensus-certificate/1``): the claim and the witnesses, and nothing else.

Each table of the format is a dataclass here: its keys are the fields, and the type of a field says how it is read.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from math import gcd
from typing import Any, NoReturn, Protocol, TypeVar

from certify.checker.linear import Matrix
from certify.checker.requested import Settling
from certify.checker.verdict import Malformed

SCHEMA = "consensus-certificate/1"
MAX_BYTES = 64 << 20
MAX_DIGITS = 4_000
MAX_ENTRIES = 2_048
MAX_TEXT = 10_000
MAX_INTEGER = 1_000_000
MAX_GRID = 5_000
MAX_STATES = 64
MAX_RATES = 16
MAX_FIRST_STEPS = 500
MAX_AGENTS = 1_000
MAX_DEGREE = 32
MAX_COEFFICIENT = 1 << 256

Row = tuple[Fraction, ...]
Modes = Matrix
Blocks = tuple[int, ...]
Rates = Row
Kernels = tuple[tuple[Rates, ...], ...]
Grid = Row
Boxes = Matrix
FirstGrid = Row
FirstBoxes = Matrix
Ranges = tuple[Matrix, ...]
Curve = tuple[tuple[tuple[int, ...], ...], ...]
T = TypeVar("T")
_NUMBER = re.compile(r"(0|-?[1-9][0-9]*)(?:/([1-9][0-9]*))?")


@dataclass(frozen=True)
class Root:
    """``[lo, hi]`` around the only zero of ``f0``: a component of ``z*`` without closed form."""

    root: Row


SteadyState = tuple[str | Root, ...]


@dataclass(frozen=True)
class AgentClaim:
    """The controller of one agent; order 1 has no ``h`` and no ``observer``; blocks may be empty."""

    id: int
    g: Fraction
    K: Fraction
    delta: Fraction
    h: Fraction | None
    gamma: Row
    observer: Row
    M: Matrix
    N: Row
    psi: Row


@dataclass(frozen=True)
class ClaimedRequirements:
    """What is claimed of one agent beyond convergence; None where the plant file asks for nothing."""

    settling: Settling | None
    input: Fraction | None
    bandwidth: Fraction | None


@dataclass(frozen=True)
class DirectAgentClaim(AgentClaim):
    """The controller of one agent, and the requirements that it meets."""

    requirements: ClaimedRequirements


@dataclass(frozen=True)
class Claim:
    """The plant file that the claim is about, and the whole controller."""

    plant_sha256: str
    alpha1: Fraction
    alpha2: Fraction
    gradient_gain: Fraction
    mixing_gain: Fraction
    mixing_time: Fraction
    softening: Fraction
    agents: tuple[AgentClaim, ...]


@dataclass(frozen=True)
class DirectClaim(Claim):
    """The same with requirements, for the theorem direct/3."""

    agents: tuple[DirectAgentClaim, ...]


@dataclass(frozen=True)
class PrintedWitness:
    """Of a coordinator that starts at once: the comparison norm, its rates, and the time grid."""

    P: Matrix
    multiplier: Row
    rate: Fraction
    mixing_rate: Fraction
    step: Fraction
    steps: int


@dataclass(frozen=True)
class HeldWitness:
    """Of a coordinator that waits for the mixing layer: the structured norm, rates, and the nominal curve.

    ``P = [[Rm, B Rm], [B Rm, c Rm]]`` with ``B = diag(B)``; ``times`` begin at ``t_mix``; ``curve[k][i]`` are
    the Chebyshev coefficients of the reference of agent ``i`` from ``times[k]`` to ``times[k + 1]``, in ``unit``s.
    """

    B: Row
    c: Fraction
    rate: Fraction
    mixing_rate: Fraction
    shift: Fraction
    unit: Fraction
    times: Grid
    curve: Curve


CoordinatorWitness = PrintedWitness | HeldWitness


@dataclass(frozen=True)
class AgentWitness:
    """Steady state, immersion, Lyapunov matrices, level and weights of one agent."""

    id: int
    steady_state: SteadyState
    ell: Row
    V0: Matrix
    P1: Matrix
    P2: Matrix
    P3: Matrix
    a0: Fraction
    level: Fraction
    slack: Fraction
    weight_eta: Fraction
    weight_theta: Fraction


@dataclass(frozen=True)
class Exosystem:
    """A quadratic form that the exosystem keeps."""

    Q: Matrix


@dataclass(frozen=True)
class Witness:
    """What the checker needs to be told."""

    optimum: Row
    left_null_vector: Row
    exosystem: Exosystem | None
    coordinator: CoordinatorWitness
    agents: tuple[AgentWitness, ...]


@dataclass(frozen=True)
class NominalSlopes:
    """Of ``f0`` in ``(z, x1)``, of ``f1`` in ``(z, x)``, and the input gain."""

    f0: Matrix
    f1: Row
    b: Fraction


@dataclass(frozen=True)
class FirstPhase:
    """Magnitudes of ``z̄, x̄, ϑ, ζ`` during every step of the grid, and of ``ϑ`` at its end."""

    grid: FirstGrid
    boxes: FirstBoxes
    vartheta: FirstGrid


@dataclass(frozen=True)
class TubeTail:
    """The magnitudes of the outputs at the end of the grid, and the rate at which they decay from then on."""

    box: Row
    rate: Fraction


@dataclass(frozen=True)
class DirectAgentWitness:
    """Steady state, immersion, nominal loop, its modes and kernels, the first phase, the tube and its tail.

    ``kernels[i][j]`` are the coefficients of output ``i`` and column ``j``, one per rate; ``boxes[k]`` are the
    magnitudes of the outputs from ``grid[k]`` to ``grid[k + 1]``; ``ranges[i]`` holds ``[lo, hi]`` for every zero state
    at the end of step ``i`` of both phases.
    """

    id: int
    steady_state: SteadyState
    ell: Row
    nominal: NominalSlopes
    modes: Modes
    blocks: Blocks
    rates: Rates
    kernels: Kernels
    phase1: FirstPhase
    grid: Grid
    boxes: Boxes
    ranges: Ranges
    tail: TubeTail


@dataclass(frozen=True)
class DirectWitness:
    """What the checker needs to be told for the theorem direct/3."""

    optimum: Row
    left_null_vector: Row
    exosystem: Exosystem | None
    coordinator: CoordinatorWitness
    agents: tuple[DirectAgentWitness, ...]


class NetworkWitness(Protocol):
    """What the witnesses of all theorems have in common; of an agent's, only its ``id``."""

    @property
    def optimum(self) -> Row: ...
    @property
    def left_null_vector(self) -> Row: ...
    @property
    def exosystem(self) -> Exosystem | None: ...
    @property
    def coordinator(self) -> CoordinatorWitness: ...
    @property
    def agents(self) -> tuple[Any, ...]: ...


@dataclass(frozen=True)
class Certificate:
    """A claim, its digest, and the witnesses of the theorem that is to prove it."""

    claim_sha256: str
    theorem: str
    claim: Claim
    witness: NetworkWitness


def read_certificate(data: bytes, kinds: Mapping[str, tuple[type[Claim], type[Any]]]) -> Certificate:
    """The certificate in the bytes of its file; ``kinds`` has the dataclasses of the claim and of the witness of each
    theorem that is known. Raises ``Malformed``."""
    if len(data) > MAX_BYTES:
        raise Malformed("the certificate is too large")
    try:
        root = json.loads(data.decode("ascii"), parse_int=_no_number, parse_float=_no_number, parse_constant=_no_number)
        canonical = _canonical(root) + "\n"
    except (ValueError, RecursionError) as error:
        raise Malformed(f"the certificate is not JSON in ASCII: {error}") from None
    if canonical.encode("ascii") != data:
        raise Malformed("the certificate is not canonical JSON")
    _keys(root, {"schema", "theorem", "producer", "claim", "witness"})
    if root["schema"] != SCHEMA or root["theorem"] not in list(kinds):
        raise Malformed(f"this checker reads {SCHEMA} with one of the theorems {', '.join(kinds)}")
    if not isinstance(root["producer"], dict) or len(root["producer"]) > 32:
        raise Malformed("the producer is a table of at most 32 entries")
    for text in root["producer"].values():
        _text(text)
    digest = hashlib.sha256(_canonical(root["claim"]).encode("ascii")).hexdigest()
    claim, witness = kinds[root["theorem"]]
    return Certificate(digest, root["theorem"], _table(claim, root["claim"]), _table(witness, root["witness"]))


def _table(kind: type[T], value: Any) -> T:
    """A dataclass from the table that has its fields as keys."""
    types = {field.name: str(field.type) for field in fields(kind)}  # type: ignore[arg-type]  # all of them are dataclasses
    _keys(value, set(types))
    return kind(**{name: _READERS[how](value[name]) for name, how in types.items()})


def _keys(value: Any, keys: set[str]) -> None:
    if not isinstance(value, dict) or value.keys() != keys:
        raise Malformed(f"a table with exactly the keys {', '.join(sorted(keys))} is needed")


def _list(value: Any, most: int = MAX_ENTRIES) -> list[Any]:
    if not isinstance(value, list) or len(value) > most:
        raise Malformed(f"a list of at most {most} entries is needed")
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise Malformed(f"a string of at most {MAX_TEXT} characters is needed")
    return value


def _number(value: Any) -> Fraction:
    match = _NUMBER.fullmatch(_text(value))
    if match is None or max(len(match[1]), len(match[2] or "")) > MAX_DIGITS:
        raise Malformed("a number is written p or p/q")
    p, q = int(match[1]), int(match[2] or 1)
    if gcd(p, q) != 1 or match[2] == "1":
        raise Malformed("a number is not in lowest terms")
    return Fraction(p, q)


def _integer(value: Any, least: int = 1, most: int = MAX_INTEGER) -> int:
    number = _number(value)
    if number.denominator != 1 or not least <= number <= most:
        raise Malformed(f"an integer from {least} to {most} is needed")
    return int(number)


def _row(value: Any, most: int = MAX_ENTRIES) -> Row:
    return tuple(map(_number, _list(value, most)))


def _rates(value: Any) -> Row:
    return _row(value, MAX_RATES)


def _matrix(value: Any, most: int = MAX_ENTRIES) -> Matrix:
    rows = list(map(_row, _list(value, most)))
    if any(len(row) != len(rows[0]) for row in rows):
        raise Malformed("the rows of a matrix differ in length")
    return rows


def coordinator_witness(value: Any) -> CoordinatorWitness:
    """The one that waits has a curve. Raises ``Malformed``."""
    held = isinstance(value, dict) and "curve" in value
    return _table(HeldWitness, value) if held else _table(PrintedWitness, value)


def _coefficients(value: Any) -> tuple[int, ...]:
    found = tuple(_integer(entry, -MAX_COEFFICIENT, MAX_COEFFICIENT) for entry in _list(value, MAX_DEGREE + 1))
    if not found:
        raise Malformed("a polynomial has a coefficient")
    return found


def _component(value: Any) -> str | Root:
    root: Root | None = _table(Root, value) if isinstance(value, dict) else None
    return _text(value) if root is None else root


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _no_number(text: str) -> NoReturn:
    raise Malformed("a number is a string")


_READERS: dict[str, Callable[[Any], Any]] = {
    "int": _integer,
    "str": _text,
    "Fraction": _number,
    "Fraction | None": lambda value: None if value is None else _number(value),
    "Row": _row,
    "SteadyState": lambda value: tuple(map(_component, _list(value))),
    "Matrix": _matrix,
    "Exosystem | None": lambda value: None if value is None else _table(Exosystem, value),
    "Settling | None": lambda value: None if value is None else _table(Settling, value),
    "ClaimedRequirements": lambda value: _table(ClaimedRequirements, value),
    "tuple[DirectAgentClaim, ...]": lambda value: tuple(_table(DirectAgentClaim, entry) for entry in _list(value)),
    "CoordinatorWitness": lambda value: coordinator_witness(value),
    "Curve": lambda value: tuple(tuple(map(_coefficients, _list(row))) for row in _list(value, MAX_GRID)),
    "tuple[AgentClaim, ...]": lambda value: tuple(_table(AgentClaim, entry) for entry in _list(value)),
    "tuple[DirectAgentWitness, ...]": lambda value: tuple(_table(DirectAgentWitness, entry) for entry in _list(value)),
    "NominalSlopes": lambda value: _table(NominalSlopes, value),
    "Modes": lambda value: _matrix(value, MAX_STATES),
    "Blocks": lambda value: tuple(_integer(entry, 1, 2) for entry in _list(value, MAX_STATES)),
    "Rates": _rates,
    "Kernels": lambda value: tuple(tuple(map(_rates, _list(columns))) for columns in _list(value)),
    "FirstPhase": lambda value: _table(FirstPhase, value),
    "FirstGrid": lambda value: _row(value, MAX_FIRST_STEPS + 1),
    "FirstBoxes": lambda value: _matrix(value, MAX_FIRST_STEPS),
    "Ranges": lambda value: tuple(map(_matrix, _list(value, MAX_GRID + MAX_FIRST_STEPS))),
    "Grid": lambda value: _row(value, MAX_GRID + 1),
    "Boxes": lambda value: _matrix(value, MAX_GRID),
    "TubeTail": lambda value: _table(TubeTail, value),
    "tuple[AgentWitness, ...]": lambda value: tuple(_table(AgentWitness, entry) for entry in _list(value)),
}
