"""What a check can end with, and the exceptions that lead there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction

STEPS = 300_000_000  # some ten seconds
AGENTS_PER_STEPS = 10  # a network of more agents may take in proportion longer


class Malformed(Exception):
    """The plant file or the certificate is not one."""


class Undecided(Exception):
    """An operation whose result cannot be enclosed, such as a division by an interval around 0."""


class Rejected(Exception):
    """An obligation was not proved."""

    def __init__(self, obligation: str, detail: str) -> None:
        super().__init__(f"{obligation}: {detail}")
        self.obligation = obligation
        self.detail = detail


@dataclass(frozen=True)
class Verdict:
    """``status`` is ``verified``, ``rejected`` (by the first ``obligation`` that failed) or ``malformed``."""

    status: str
    obligation: str = ""
    detail: str = ""
    claim_sha256: str = ""


@contextmanager
def obligation(name: str) -> Iterator[None]:
    """Whatever cannot be decided inside is a rejection under this name."""
    try:
        yield
    except Undecided as reason:
        raise Rejected(name, str(reason)) from None


def require(holds: bool, name: str, **numbers: object) -> None:
    """The obligation ``name``; ``numbers`` say how it failed."""
    if not holds:
        raise Rejected(name, ", ".join(f"{key} = {show(value)}" for key, value in numbers.items()) or "does not hold")


_remaining: ContextVar[int] = ContextVar("_remaining", default=STEPS)


def start_meter(steps: int = STEPS) -> None:
    """How many elementary steps the check that begins now may take: a time limit that is the same on every machine."""
    _remaining.set(steps)


def allow_for(agents: int) -> None:
    """A network of many agents may take more steps than ``STEPS``."""
    _remaining.set(_remaining.get() + STEPS * (max(agents - 1, 0) // AGENTS_PER_STEPS))


def spend(steps: int) -> None:
    left = _remaining.get() - steps
    _remaining.set(left)
    if left < 0:
        raise Undecided("more work than the checker allows")


def steps_spent() -> int:
    """By the check that began last, with the usual budget."""
    return STEPS - _remaining.get()


def show(value: object) -> str:
    """A number for a message: short rationals as they are, others rounded to six digits; sequences entry by entry."""
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(show(entry) for entry in value) + "]"
    if isinstance(value, (int, Fraction)):
        q = Fraction(value)
        return str(q) if q.numerator.bit_length() + q.denominator.bit_length() < 64 else _decimal(q)
    return str(value)


def _decimal(q: Fraction) -> str:
    power = (abs(q.numerator).bit_length() - q.denominator.bit_length()) * 30103 // 100000
    if abs(power) > 10**4:
        return f"about {'-' if q < 0 else ''}1e{power:+d}"
    digits = round(abs(q) * Fraction(10) ** (5 - power))
    while digits >= 10**6:
        digits, power = digits // 10, power + 1
    return f"{'-' if q < 0 else ''}{digits / 10**5:g}e{power:+d}"
