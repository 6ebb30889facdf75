"""Reads a certificate (canonical JSON, ``consensus-certificate/1``): the claim and the witnesses, and nothing else.

Each table of the format is a dataclass here: its keys are the fields, and the type of a field says how it is read.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from fractions import Fraction
from math import gcd
from typing import Any, NoReturn, TypeVar

from certify.checker.linear import Matrix
from certify.checker.verdict import Malformed

SCHEMA = "consensus-certificate/1"
THEOREM = "recipe/1"
MAX_BYTES = 16 << 20
MAX_DIGITS = 4_000
MAX_ENTRIES = 512
MAX_TEXT = 10_000
MAX_INTEGER = 1_000_000

Row = tuple[Fraction, ...]
Texts = tuple[str, ...]
T = TypeVar("T")
_NUMBER = re.compile(r"(0|-?[1-9][0-9]*)(?:/([1-9][0-9]*))?")


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
class Claim:
    """The plant file that the claim is about, and the whole controller."""

    plant_sha256: str
    alpha1: Fraction
    alpha2: Fraction
    agents: tuple[AgentClaim, ...]


@dataclass(frozen=True)
class CoordinatorWitness:
    """The comparison norm, its rates, and the time grid."""

    P: Matrix
    multiplier: Row
    rate: Fraction
    mixing_rate: Fraction
    step: Fraction
    steps: int


@dataclass(frozen=True)
class AgentWitness:
    """Steady state, immersion, Lyapunov matrices, level and weights of one agent."""

    id: int
    steady_state: Texts
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
    exosystem: Exosystem | None
    coordinator: CoordinatorWitness
    agents: tuple[AgentWitness, ...]


@dataclass(frozen=True)
class Certificate:
    """A claim, its digest, and its witnesses."""

    claim_sha256: str
    claim: Claim
    witness: Witness


def read_certificate(data: bytes) -> Certificate:
    """The certificate in the bytes of its file. Raises ``Malformed``."""
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
    if (root["schema"], root["theorem"]) != (SCHEMA, THEOREM):
        raise Malformed(f"this checker reads {SCHEMA} with the theorem {THEOREM}")
    if not isinstance(root["producer"], dict) or len(root["producer"]) > 32:
        raise Malformed("the producer is a table of at most 32 entries")
    for text in root["producer"].values():
        _text(text)
    digest = hashlib.sha256(_canonical(root["claim"]).encode("ascii")).hexdigest()
    return Certificate(digest, _table(Claim, root["claim"]), _table(Witness, root["witness"]))


def _table(kind: type[T], value: Any) -> T:
    """A dataclass from the table that has its fields as keys."""
    types = {field.name: str(field.type) for field in fields(kind)}  # type: ignore[arg-type]  # all of them are dataclasses
    _keys(value, set(types))
    return kind(**{name: _READERS[how](value[name]) for name, how in types.items()})


def _keys(value: Any, keys: set[str]) -> None:
    if not isinstance(value, dict) or value.keys() != keys:
        raise Malformed(f"a table with exactly the keys {', '.join(sorted(keys))} is needed")


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list) or len(value) > MAX_ENTRIES:
        raise Malformed(f"a list of at most {MAX_ENTRIES} entries is needed")
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


def _integer(value: Any) -> int:
    number = _number(value)
    if number.denominator != 1 or not 1 <= number <= MAX_INTEGER:
        raise Malformed(f"an integer from 1 to {MAX_INTEGER} is needed")
    return int(number)


def _row(value: Any) -> Row:
    return tuple(map(_number, _list(value)))


def _matrix(value: Any) -> Matrix:
    rows = list(map(_row, _list(value)))
    if any(len(row) != len(rows[0]) for row in rows):
        raise Malformed("the rows of a matrix differ in length")
    return rows


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
    "Texts": lambda value: tuple(map(_text, _list(value))),
    "Matrix": _matrix,
    "Exosystem | None": lambda value: None if value is None else _table(Exosystem, value),
    "CoordinatorWitness": lambda value: _table(CoordinatorWitness, value),
    "tuple[AgentClaim, ...]": lambda value: tuple(_table(AgentClaim, entry) for entry in _list(value)),
    "tuple[AgentWitness, ...]": lambda value: tuple(_table(AgentWitness, entry) for entry in _list(value)),
}
