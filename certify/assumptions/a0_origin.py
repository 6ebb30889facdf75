"""A0: ``f0(0,0,0,w) = 0``, ``f1(0,0,0,w) = 0`` and ``b(w) ≥ b_min > 0`` on the parameter box (theory.md section 2).

All three must be smooth on the initial box × ``W``, and so must every part of their text, one that cancels included.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from itertools import islice, product

import sympy

from certify.assumptions.findings import Finding, Json
from certify.bounds.balls import NonFiniteError
from certify.bounds.intervals import simplest_between
from certify.bounds.smoothness import first_break, unproved_guard
from certify.bounds.suprema import lower_bound
from symbolic.constants import as_rational
from symbolic.guards import guards
from symbolic.identity import value_at, zero_test
from symbolic.plant import Agent, Exosystem, Interval
from symbolic.point_parameters import without_point_parameters

SLACK = Fraction(1, 10**6)
MAX_POINTS = 1000
Point = dict[sympy.Symbol, sympy.Rational]

CONSTANT_LOAD = "a constant load is an exosystem state with a zero row in S, and its size the state's initial value"


def check_origin(agent: Agent, exosystem: Exosystem) -> Finding:
    """Decide A0 for one agent. Evidence: ``b_min``, or the parameter point where a condition breaks."""
    free = without_point_parameters(agent)
    return _not_at_rest(free, exosystem) or _not_smooth(agent, exosystem) or _input_gain(agent.id, free)


def origin_warning(agent: Agent) -> str | None:
    """The paper asks that ``W`` contain the origin (F18): worth a warning, never a failure."""
    if all(interval.lo <= 0 <= interval.hi for interval in agent.parameter_box):
        return None
    return "the parameter box does not contain the origin, as the paper asks; nothing in the proof needs it"


def smoothness_warning(agent: Agent) -> str | None:
    """The paper asks for smooth right-hand sides on the whole space; a certificate needs them on its own sets only."""
    box: dict[sympy.Symbol, Interval | None] = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    texts = (*map(agent.guards.of_zero_dynamics, range(len(agent.zero_dynamics))), agent.guards.f)
    for side, written in zip((*agent.zero_dynamics, agent.f), texts, strict=True):
        names = side.free_symbols.union(*(guard.expression.free_symbols for guard in written))
        everywhere = dict.fromkeys(names) | {name: box[name] for name in names & set(box)}
        guard = unproved_guard(side, everywhere, written)
        if guard is not None:
            return f"the right-hand side may not be smooth everywhere: {guard.demand}"
    return None


def _not_at_rest(agent: Agent, exosystem: Exosystem) -> Finding | None:
    """A right-hand side that does not vanish at the origin, or is not seen to; None when all vanish."""
    origin = dict.fromkeys((*agent.zero_states, *agent.chain, *exosystem.states), sympy.Integer(0))
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    sides = {f"f0 ({name})": expr for name, expr in zip(agent.zero_states, agent.zero_dynamics, strict=True)} | {
        "f1": agent.f
    }
    unknown: Finding | None = None
    for name, side in sides.items():
        value = side.xreplace(origin)
        if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
            return Finding("A0", agent.id, "fails", f"{name} is not defined at the origin", {"value": str(value)})
        test = zero_test(value, box)
        if test.verdict == "fails":
            at = dict(test.at)
            where = f" at {', '.join(f'{key} = {number}' for key, number in at.items())}" if at else ""
            return Finding(
                "A0",
                agent.id,
                "fails",
                f"{name} is {value} at the origin, not 0{where}; {CONSTANT_LOAD}",
                {"value": str(value), "at": at},
            )
        if test.verdict == "unknown":
            unknown = Finding(
                "A0", agent.id, "unknown", f"{name} at the origin is not shown to be 0", {"value": str(value)}
            )
    return unknown


def _not_smooth(agent: Agent, exosystem: Exosystem) -> Finding | None:
    """A part that is not smooth at a start, or at the origin; None when all of ``f0, f1, b`` are."""
    W = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    states = (*agent.zero_states, *agent.chain, *exosystem.states)
    starts = (*agent.initial.z, *agent.initial.x, *exosystem.initial)
    at_start, at_rest = (
        dict(zip(states, starts, strict=True)),
        dict.fromkeys(states, Interval(Fraction(0), Fraction(0))),
    )
    written = agent.guards
    sides = [
        *((f"f0 ({z})", f0, written.of_zero_dynamics(k))
          for k, (z, f0) in enumerate(zip(agent.zero_states, agent.zero_dynamics, strict=True))),
        ("f1", agent.f, written.f),
        ("b", agent.b, written.b),
    ]  # fmt: skip
    unknown: Finding | None = None
    for place, box in (("the initial box", at_start), ("the origin", at_rest)):
        for name, side, parts in sides:
            found = first_break(dict.fromkeys((*parts, *guards(side))), box | W)
            if found is None:
                continue
            reason = f"{name} is not smooth on {place} and W: {found.reason}"
            if found.verdict == "fails":
                return Finding("A0", agent.id, "fails", reason, {"at": [dict(point) for point in found.at]})
            unknown = unknown or Finding("A0", agent.id, "unknown", f"{name}: {found.reason} ({place} and W)")
    return unknown


def _input_gain(number: int, agent: Agent) -> Finding:
    """``b_min > 0`` by branch and bound, or a point where ``b`` is not positive."""
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    evidence: dict[str, Json] = {"b": str(agent.b)}
    origin = origin_warning(agent)
    warnings = [text for text in (origin, smoothness_warning(agent)) if text is not None]
    if warnings:
        evidence["warnings"] = warnings
    for point in _points(agent):
        value = agent.b.xreplace(point)
        ball = value_at(value, {})
        if value.is_zero or ball < 0:
            evidence["at"] = {str(name): str(coordinate) for name, coordinate in point.items()}
            return Finding("A0", number, "fails", f"b = {value} is not positive{_at(point)}", evidence)
    try:
        bound = lower_bound(agent.b, box, rtol=SLACK)
    except (NonFiniteError, ValueError) as obstacle:
        return Finding(
            "A0", number, "unknown", f"b has no proved lower bound on the parameter box: {obstacle}", evidence
        )
    if bound.value > 0:
        exact = bound.value == bound.attained
        least = bound.value if exact else simplest_between(bound.value * (1 - SLACK), bound.value)
        evidence["b_min"] = str(least)
        return Finding(
            "A0",
            number,
            "holds",
            "the origin is at rest without input and b is positive on W"
            + ("; W does not contain the origin" if origin else ""),
            evidence,
        )
    evidence["infimum_between"] = [str(bound.value), str(bound.attained)]
    if bound.attained <= 0:
        evidence["at"] = {str(name): str(coordinate) for name, coordinate in bound.point}
        return Finding("A0", number, "fails", "b is not positive everywhere on the parameter box", evidence)
    return Finding("A0", number, "unknown", "b is not proved to stay above 0 on the parameter box", evidence)


def _points(agent: Agent) -> Iterator[Point]:
    """Ends, middle and zero of every parameter that ``b`` depends on, in all combinations, the ends first."""
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    used = {name: interval for name, interval in box.items() if name in agent.b.free_symbols}
    axes = []
    for interval in used.values():
        inside = [(interval.lo + interval.hi) / 2, *([Fraction(0)] if interval.lo < 0 < interval.hi else [])]
        axes.append([as_rational(value) for value in dict.fromkeys((interval.lo, interval.hi, *inside))])
    for values in islice(product(*axes), MAX_POINTS):
        yield dict(zip(used, values, strict=True))


def _at(point: Point) -> str:
    return f" at {', '.join(f'{name} = {value}' for name, value in point.items())}" if point else ""
