"""Do the two plant readers read the same plant? They share no code, so what they agree on is what the file says."""

from __future__ import annotations

from dataclasses import asdict, fields, is_dataclass
from fractions import Fraction
from typing import Any

import sympy

from certify.checker.expressions import evaluate
from certify.checker.plant import Plant as CheckerPlant
from symbolic.network import laplacian
from symbolic.plant import Interval, Plant

Outcome = tuple[str, Any]
HARMLESS = {
    "division by zero": "a denominator that vanishes identically: the checker encloses nothing that is divided by it",
    "sqrt of a number with more than": "a real number that is too large for the tool's algebra",
    "log inside exp": "a function that the tool's algebra does not keep apart from a power",
    "is too large: its": "an expression that the tool would not expand",
    "is nested too deeply": "a constant that takes the tool's algebra too long",
}
POINT = [Fraction(k, 7 + k) for k in range(1, 200)]


def difference(mine: Outcome, theirs: Outcome) -> str | None:
    """``None`` when both accept the same plant or both refuse."""
    if mine[0] != theirs[0]:
        reader = "the checker's reader" if mine[0] == "accepted" else "the tool's reader"
        return f"only {reader} accepts{_why(mine)}{_why(theirs)}"
    reason = _compare(mine[1], theirs[1]) if mine[0] == "accepted" else None
    return None if reason is None else f"read differently: {reason}"


def harmless(reason: str) -> bool:
    """Whether only the checker accepts, and only because the tool will not compute with what the file says."""
    return reason.startswith("only the checker's reader accepts") and any(part in reason for part in HARMLESS)


def _why(outcome: Outcome) -> str:
    return f" ({outcome[1]})" if outcome[0] == "refused" else ""


def _compare(mine: CheckerPlant, theirs: Plant) -> str | None:
    if mine.sha256 != theirs.sha256:
        return "digest"
    if [list(row) for row in mine.laplacian] != [list(row) for row in laplacian(theirs.digraph)]:
        return "network"
    names = [symbol.name for symbol in theirs.exosystem.states]
    if list(mine.exosystem) != names or [tuple(box) for box in mine.exosystem.values()] != _boxes(
        theirs.exosystem.initial
    ):
        return "exosystem"
    if asdict(mine.coordinator) != asdict(theirs.coordinator):
        return "coordinator"
    for number in range(1, len(theirs.agents) + 1):
        for what in ("gains_of", "requirements_of", "implementation_of"):
            if _plain(getattr(mine, what)(number)) != _plain(getattr(theirs, what)(number)):
                return f"agent {number}: {what}"
    for left, right in zip(mine.agents, theirs.agents, strict=True):
        reason = _agents(left, right, names)
        if reason:
            return f"agent {right.id}: {reason}"
    return None


def _agents(left: Any, right: Any, exosystem: list[str]) -> str | None:
    initial = right.initial
    if (left.id, left.order, list(left.zero_states)) != (
        right.id,
        right.order,
        [symbol.name for symbol in right.zero_states],
    ):
        return "states"
    if list(left.parameters) != [symbol.name for symbol in right.parameters]:
        return "parameters"
    if [tuple(box) for box in left.parameters.values()] != _boxes(right.parameter_box):
        return "parameter box"
    observer = None if initial.observer is None else _boxes(initial.observer)
    mine = None if left.observer_box is None else [tuple(box) for box in left.observer_box]
    if (
        [tuple(box) for box in left.z_box],
        [tuple(box) for box in left.x_box],
        mine,
        tuple(left.eta_box),
        tuple(left.reference_box),
    ) != (_boxes(initial.z), _boxes(initial.x), observer, *_boxes([initial.eta, initial.reference])):
        return "initial box"
    if (left.gamma, left.observer) != (right.gamma, right.observer):
        return "design polynomials"
    names = [*left.zero_states, *left.chain, *exosystem, *left.parameters, "s"]
    point = dict(zip(names, POINT, strict=False))
    for key, mine, theirs in [
        ("f", left.f, right.f),
        ("b", left.b, right.b),
        ("cost", left.cost, right.cost),
        *(("zero dynamics", *pair) for pair in zip(left.zero_dynamics, right.zero_dynamics, strict=True)),
    ]:
        if not _same(mine, theirs, point):
            return key
    return None


def _plain(value: Any) -> Any:
    """A dataclass of either reader as a dictionary of plain values."""
    if value is None:
        return None
    return {
        field.name: (entry.lo, entry.hi)
        if isinstance(entry := getattr(value, field.name), Interval)
        else _plain(entry)
        if is_dataclass(entry)
        else entry
        for field in fields(value)
    }


def _boxes(intervals: Any) -> list[tuple[Fraction, Fraction]]:
    return [(interval.lo, interval.hi) for interval in intervals if isinstance(interval, Interval)]


class _Transcendental(Exception):
    pass


def _same(mine: Any, theirs: sympy.Expr, point: dict[str, Fraction]) -> bool:
    """Equal at a point with rational coordinates; not compared when a function is involved or a denominator
    vanishes."""

    def refuse(function: str, argument: Fraction) -> Fraction:
        raise _Transcendental

    try:
        value = evaluate(mine, point, lambda q: q, refuse)
    except (_Transcendental, ZeroDivisionError):
        return True
    values = {name: sympy.Rational(q.numerator, q.denominator) for name, q in point.items()}
    other = theirs.xreplace({symbol: values[symbol.name] for symbol in theirs.free_symbols})
    return not other.is_Rational or Fraction(int(other.p), int(other.q)) == value
