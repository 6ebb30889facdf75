"""Reads a certificate (canonical JSON, ``consensus-certificate/1``): the claim and the witnesses, and nothing else."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from fractions import Fraction
from math import gcd
from typing import Any, NoReturn

from certify.checker.linear import Matrix
from certify.checker.verdict import Malformed

SCHEMA = "consensus-certificate/1"
THEOREM = "recipe/1"
MAX_BYTES = 16 << 20
MAX_DIGITS = 4_000
MAX_SIZE = 512
MAX_STEPS = 1_000_000

Row = tuple[Fraction, ...]
_NUMBER = re.compile(r"(0|-?[1-9][0-9]*)(?:/([1-9][0-9]*))?")
_DIGEST = re.compile(r"[0-9a-f]{64}")


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
class AgentWitness:
    """Steady state, immersion, Lyapunov matrices, level and weights of one agent."""

    id: int
    steady_state: tuple[str, ...]
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
class Certificate:
    """A claim, its digest, and its witnesses."""

    claim_sha256: str
    plant_sha256: str
    alpha1: Fraction
    alpha2: Fraction
    claims: tuple[AgentClaim, ...]
    optimum: tuple[Fraction, Fraction]
    Q: Matrix | None
    P: Matrix
    multiplier: Row
    rate: Fraction
    mixing_rate: Fraction
    step: Fraction
    steps: int
    witnesses: tuple[AgentWitness, ...]


def read_certificate(data: bytes) -> Certificate:
    """The certificate in the bytes of its file. Raises ``Malformed``."""
    if len(data) > MAX_BYTES:
        raise Malformed("the certificate is too large")
    try:
        root = json.loads(data.decode("ascii"), parse_int=_no_number, parse_float=_no_number, parse_constant=_no_number)
        canonical = _canonical(root) + "\n"
    except (ValueError, RecursionError) as error:
        raise Malformed(f"the certificate is not JSON: {error}") from None
    if canonical.encode("ascii") != data:
        raise Malformed("the certificate is not canonical JSON")
    _keys(root, "schema theorem producer claim witness")
    if (root["schema"], root["theorem"]) != (SCHEMA, THEOREM):
        raise Malformed(f"this checker reads {SCHEMA} with the theorem {THEOREM}")
    if not isinstance(root["producer"], dict) or len(root["producer"]) > 32:
        raise Malformed("the producer is a table of at most 32 entries")
    for text in root["producer"].values():
        _text(text, 200)
    claim = _keys(root["claim"], "plant_sha256 alpha1 alpha2 agents")
    if not _DIGEST.fullmatch(_text(claim["plant_sha256"], 64)):
        raise Malformed("plant_sha256 is a hex digest")
    witness = _keys(root["witness"], "optimum exosystem coordinator agents")
    optimum = _row(witness["optimum"])
    if len(optimum) != 2:
        raise Malformed("the optimum is an interval")
    coordinator = _keys(witness["coordinator"], "P multiplier rate mixing_rate step steps")
    return Certificate(
        claim_sha256=hashlib.sha256(_canonical(claim).encode("ascii")).hexdigest(),
        plant_sha256=claim["plant_sha256"], alpha1=_number(claim["alpha1"]), alpha2=_number(claim["alpha2"]),
        claims=tuple(_agent_claim(entry) for entry in _list(claim["agents"])), optimum=(optimum[0], optimum[1]),
        Q=None if witness["exosystem"] is None else _matrix(_keys(witness["exosystem"], "Q")["Q"]),
        P=_matrix(coordinator["P"]), multiplier=_row(coordinator["multiplier"]), rate=_number(coordinator["rate"]),
        mixing_rate=_number(coordinator["mixing_rate"]), step=_number(coordinator["step"]),
        steps=_integer(coordinator["steps"], MAX_STEPS),
        witnesses=tuple(_agent_witness(entry) for entry in _list(witness["agents"])))


def _agent_claim(value: Any) -> AgentClaim:
    table = _keys(value, "id g K delta h gamma observer M N psi")
    return AgentClaim(
        id=_integer(table["id"], MAX_STEPS), g=_number(table["g"]), K=_number(table["K"]),
        delta=_number(table["delta"]), h=None if table["h"] is None else _number(table["h"]),
        gamma=_row(table["gamma"]), observer=_row(table["observer"]),
        M=_matrix(table["M"]), N=_row(table["N"]), psi=_row(table["psi"]))


def _agent_witness(value: Any) -> AgentWitness:
    table = _keys(value, "id steady_state ell V0 P1 P2 P3 a0 level slack weight_eta weight_theta")
    return AgentWitness(
        id=_integer(table["id"], MAX_STEPS), ell=_row(table["ell"]),
        steady_state=tuple(_text(entry, 10_000) for entry in _list(table["steady_state"])),
        V0=_matrix(table["V0"]), P1=_matrix(table["P1"]), P2=_matrix(table["P2"]), P3=_matrix(table["P3"]),
        a0=_number(table["a0"]), level=_number(table["level"]), slack=_number(table["slack"]),
        weight_eta=_number(table["weight_eta"]), weight_theta=_number(table["weight_theta"]))


def _canonical(value: Any) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def _no_number(text: str) -> NoReturn:
    raise Malformed("a number is a string")


def _keys(value: Any, keys: str) -> dict[str, Any]:
    if not isinstance(value, dict) or sorted(value) != sorted(keys.split()):
        raise Malformed(f"a table with exactly the keys {keys} is needed")
    return value


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list) or len(value) > MAX_SIZE:
        raise Malformed(f"a list of at most {MAX_SIZE} entries is needed")
    return value


def _text(value: Any, length: int) -> str:
    if not isinstance(value, str) or len(value) > length:
        raise Malformed(f"a string of at most {length} characters is needed")
    return value


def _number(value: Any) -> Fraction:
    match = _NUMBER.fullmatch(_text(value, 2 * MAX_DIGITS))
    if match is None or max(len(match[1]), len(match[2] or "")) > MAX_DIGITS:
        raise Malformed("a number is written p or p/q")
    p, q = int(match[1]), int(match[2] or 1)
    if gcd(p, q) != 1 or (match[2] and q == 1):
        raise Malformed("a number is not in lowest terms")
    return Fraction(p, q)


def _integer(value: Any, most: int) -> int:
    number = _number(value)
    if number.denominator != 1 or not 1 <= number <= most:
        raise Malformed(f"an integer from 1 to {most} is needed")
    return int(number)


def _row(value: Any) -> Row:
    return tuple(_number(entry) for entry in _list(value))


def _matrix(value: Any) -> Matrix:
    rows = [_row(entry) for entry in _list(value)]
    if any(len(row) != len(rows[0]) for row in rows):
        raise Malformed("the rows of a matrix differ in length")
    return rows
