"""Changes of a JSON value at any path, by what is found there: a number, a text, a list or a table.

Nothing here knows a theorem: a path is a tuple of keys and indices, and a number is a string ``p`` or ``p/q``.
"""

from __future__ import annotations

import copy
import json
import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .bases import Base, encode
from .values import changes, is_number, text

Path = tuple[Any, ...]


@dataclass(frozen=True)
class Mutant:
    """A changed certificate or plant file, and what was done: ``operator`` at ``path``. ``value`` is JSON, or bytes
    as they are."""

    base: int
    operator: str
    path: str
    value: Any
    plant: bytes | None = None

    @property
    def certificate(self) -> bytes:
        return self.value if isinstance(self.value, bytes) else encode(self.value)


def paths(value: Any, here: Path = ()) -> Iterator[Path]:
    """Every path in the value, tables and lists included."""
    yield here
    if isinstance(value, dict):
        for key in value:
            yield from paths(value[key], (*here, key))
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            yield from paths(entry, (*here, index))


def at(value: Any, path: Path) -> Any:
    for key in path:
        value = value[key]
    return value


def replaced(value: Any, path: Path, new: Any) -> Any:
    """A copy with ``new`` at ``path``, which shares everything else with the value."""
    if not path:
        return new
    result = copy.copy(value)
    result[path[0]] = replaced(value[path[0]], path[1:], new)
    return result


def written_otherwise(certificate: Any) -> list[tuple[str, bytes]]:
    """The same values in other bytes, none of them canonical."""
    right = encode(certificate)
    body = right[:-1]
    claim = json.dumps(certificate["claim"], sort_keys=True, separators=(",", ":")).encode()
    return [
        ("no newline at the end", body),
        ("two newlines", right + b"\n"),
        ("carriage return", body + b"\r\n"),
        ("nul", right + b"\0"),
        ("byte order mark", b"\xef\xbb\xbf" + right),
        ("spaces", json.dumps(certificate, sort_keys=True).encode() + b"\n"),
        ("indented", json.dumps(certificate, sort_keys=True, indent=1).encode() + b"\n"),
        ("keys not sorted", json.dumps(dict(reversed(certificate.items())), separators=(",", ":")).encode() + b"\n"),
        ("utf-16", right.decode().encode("utf-16")),
        ("twice", right + right),
        ("in a list", b"[" + body + b"]\n"),
        ("empty", b""),
        ("half", right[: len(right) // 2]),
        ("without the last byte", right[:-2] + b"\n"),
        ("garbage after", body + b"x\n"),
        ("second claim", body[:-1] + b',"claim":' + claim + b"}\n"),
        ("second claim first", b'{"claim":' + claim + b"," + body[1:] + b"\n"),
        ("escaped letter", right.replace(b'"claim"', b'"\\u0063laim"', 1)),
        ("null", b"null\n"),
        ("number", b"1\n"),
        ("invalid utf-8", right.replace(b"recipe", b"recip\xff", 1)),
        ("comment", b"//\n" + right),
        ("single quotes", right.replace(b'"', b"'")),
        ("lone surrogate", right.replace(b'"producer":{', b'"producer":{"a":"\\ud800",', 1)),
        ("NaN", right.replace(b'"1"', b"NaN", 1)),
        ("padded", body + b" " * (17 << 20) + b"\n"),
    ]


def mutant(base: int, operator: str, new: Any, path: Path, certificate: Any) -> Mutant:
    """The certificate with ``new`` at the path."""
    return Mutant(base, operator, show(path), replaced(certificate, path, new))


def systematic(bases: Sequence[Base], index: int, splices: bool = True) -> Iterator[Mutant]:
    """Every change at every path of one certificate, and every value replaced by another certificate's at that path."""
    base = bases[index]
    for path in paths(base.certificate):
        for operator, new in changes(at(base.certificate, path)):
            yield mutant(index, operator, new, path, base.certificate)
        for other in bases if splices else ():
            if (
                other is not base
                and (found := _at_or_none(other.certificate, path)) is not None
                and found != at(base.certificate, path)
            ):
                yield mutant(index, f"taken from {other.name}", found, path, base.certificate)
    for path, source in _same_kind(base.certificate):
        yield mutant(index, f"taken from {show(source)}", at(base.certificate, source), path, base.certificate)
    yield from other_writings(bases, index)
    yield from other_certificates(bases, index)


def other_writings(bases: Sequence[Base], index: int) -> Iterator[Mutant]:
    for operator, data in written_otherwise(bases[index].certificate):
        yield Mutant(index, operator, "bytes", data)


def other_certificates(bases: Sequence[Base], index: int) -> Iterator[Mutant]:
    base = bases[index]
    for other in bases:
        if other is not base:
            rebound = replaced(other.certificate, ("claim", "plant_sha256"), base.certificate["claim"]["plant_sha256"])
            yield Mutant(index, f"the certificate of {other.name}", "file", other.certificate)
            yield Mutant(index, f"the certificate of {other.name}, digest replaced", "file", rebound)


def _same_kind(certificate: Any) -> Iterator[tuple[Path, Path]]:
    """Pairs of paths that differ only in the agent, or only in the last key within one table of an agent."""
    for part in ("claim", "witness"):
        agents = certificate[part]["agents"]
        for i, agent in enumerate(agents):
            for key in agent:
                for j in range(len(agents)):
                    if i != j and agents[j][key] != agent[key]:
                        yield (part, "agents", i, key), (part, "agents", j, key)
                for other in agent:
                    if other != key and type(agent[other]) is type(agent[key]) and agent[other] != agent[key]:
                        yield (part, "agents", i, key), (part, "agents", i, other)


def _at_or_none(value: Any, path: Path) -> Any:
    try:
        return at(value, path)
    except (KeyError, IndexError, TypeError):
        return None


def random_mutant(bases: Sequence[Base], index: int, rng: random.Random) -> Mutant:
    """One to four numbers changed at once, by small or large factors, steps or exchanges; in the claim, the witness
    or both."""
    certificate = bases[index].certificate
    part = rng.choice(["claim", "witness", "witness", "both"])
    leaves = [
        path
        for path in paths(certificate)
        if is_number(at(certificate, path)) and (part == "both" or path[:1] == (part,))
    ]
    if rng.random() < 0.15:
        leaves = [path for path in leaves if path[-1] != "id"]
        first, second = rng.choice(leaves), rng.choice(leaves)
        a, b = at(certificate, first), at(certificate, second)
        certificate = replaced(replaced(certificate, first, b), second, a)
        return Mutant(index, "two numbers exchanged", f"{show(first)} and {show(second)}", certificate)
    chosen = rng.sample(leaves, min(len(leaves), rng.choice([1, 1, 1, 2, 3, 4])))
    common, names = factor(rng), []
    for path in chosen:
        q = Fraction(at(certificate, path))
        by = common if rng.random() < 0.5 else factor(rng)
        new = q * by if q else by - 1
        if rng.random() < 0.1:
            new = Fraction(q.numerator + rng.randint(-3, 3), max(1, q.denominator + rng.randint(-1, 1)))
        if path[-1] in ("steps", "id"):
            new = Fraction(round(q + rng.choice([-1, 1]) * rng.choice([1, 1, 2, 10])))
        certificate = replaced(certificate, path, text(new))
        names.append(show(path))
    return Mutant(index, "random numbers", " ".join(names), certificate)


def factor(rng: random.Random) -> Fraction:
    sign = -1 if rng.random() < 0.05 else 1
    if rng.random() < 0.6:
        return sign * (1 + rng.choice([-1, 1]) * Fraction(rng.randint(1, 9), 10 ** rng.randint(1, 18)))
    return sign * Fraction(rng.randint(1, 99), rng.randint(1, 99)) * Fraction(10) ** rng.randint(-8, 8)


def plant_edits(data: bytes) -> Iterator[tuple[str, bytes]]:
    """The plant file changed: each number in it, each edge, each box; a certificate of the old file says nothing
    about these."""
    source = data.decode()
    yield "comment added", data + b"# \n"
    for match in re.finditer(r"(?<![\w./])\d+(?:/\d+)?(?![\w./])", source):
        before, after = source[: match.start()], source[match.end() :]
        q = Fraction(match[0])
        for name, new in (
            ("+ 1", q + 1),
            ("doubled", 2 * q),
            ("halved", q / 2),
            ("+ 1e-6", q + Fraction(1, 10**6)),
            ("+ 1/1000", q + Fraction(1, 1000)),
            ("- 1/1000", q - Fraction(1, 1000)),
            ("negated", -q),
        ):
            inside = before.rpartition("\n")[2].count('"') % 2 == 1
            written = (
                f"({new})"
                if inside and new.denominator > 1
                else str(new)
                if inside or new.denominator == 1
                else f'"{new}"'
            )
            yield f"number {name} at byte {match.start()}", (before + written + after).encode()
    for old, new in (
        ("->", "<-"),
        (" + ", " - "),
        (" - ", " + "),
        ("x1", "x2"),
        ("v1", "v2"),
        ("sin", "cos"),
        ("reference = 0", "reference = [-1, 1]"),
        ('observer = "measured"', "observer = 0"),
        ("observer = 0", 'observer = "measured"'),
    ):
        start = source.find(old)
        while start >= 0:
            yield f"{old} to {new} at byte {start}", (source[:start] + new + source[start + len(old) :]).encode()
            start = source.find(old, start + 1)


def show(path: Path) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path).lstrip(".") or "the whole"
