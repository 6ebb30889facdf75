"""The certificate file: canonical JSON that carries the claim and the witnesses, never the inequalities
(docs/certificate.md)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import sympy

from certify.files import write_atomically
from symbolic.errors import InputError
from symbolic.interval import Interval

SCHEMA = "consensus-certificate/1"
LARGEST_FILE = 16 << 20

Json = dict[str, Any]


def number(value: Fraction | int) -> str:
    """``"p/q"`` in lowest terms, ``"p"`` for integers."""
    return str(Fraction(value))


def numbers(values: Iterable[Fraction]) -> list[str]:
    return [number(value) for value in values]


def rows(matrix: Iterable[Iterable[Fraction]]) -> list[list[str]]:
    return [numbers(row) for row in matrix]


def expression(value: sympy.Expr) -> str:
    """An expression in the language of the plant file."""
    return sympy.sstr(value)


def steady_state(components: Sequence[sympy.Expr], roots: Sequence[Interval | None]) -> list[Any]:
    """``z*`` as a witness: an expression each, or the interval of a root."""
    sides = roots or (None,) * len(components)
    return [
        expression(component) if side is None else {"root": numbers((side.lo, side.hi))}
        for component, side in zip(components, sides, strict=True)
    ]


def canonical(value: Any) -> bytes:
    """Sorted keys, no white space, ASCII with everything else escaped: equal values give equal bytes."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii")


def claim_digest(certificate: Json) -> str:
    """The sha256 of the canonical JSON of the claim."""
    return hashlib.sha256(canonical(certificate["claim"])).hexdigest()


def write_certificate(certificate: Json, path: Path) -> None:
    write_atomically(path, certificate_bytes(certificate))


def certificate_bytes(certificate: Json) -> bytes:
    """The file of a certificate."""
    return canonical(certificate) + b"\n"


def read_certificate(path: Path) -> Json:
    """Read a certificate for display. Nothing in it is trusted; the checker reads the file for itself.

    Raises ``InputError`` if the file is unreadable, too large, or no certificate of this version.
    """
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    return parse_certificate(data, str(path))


def parse_certificate(data: bytes, source: str) -> Json:
    """The certificate in the bytes of its file, for display; ``source`` is how messages name it.

    Raises ``InputError`` as :func:`read_certificate` does.
    """
    if len(data) > LARGEST_FILE:
        raise InputError(f"{source}: larger than {LARGEST_FILE} bytes")
    try:
        certificate = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{source}: is not a JSON file: {error}") from error
    if not isinstance(certificate, dict) or certificate.get("schema") != SCHEMA:
        raise InputError(f"{source}: schema: {SCHEMA!r} is needed")
    if not isinstance(certificate.get("claim"), dict) or not isinstance(certificate.get("witness"), dict):
        raise InputError(f"{source}: claim: the claim and the witnesses are needed")
    return certificate
