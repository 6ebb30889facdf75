"""Exact points at which the zero dynamics are tried before anything is proved about them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, product

import sympy

from certify.bounds.balls import compile_expression, to_arb
from symbolic.constants import as_rational
from symbolic.error_symbols import unused
from symbolic.plant import COST_VARIABLE, Agent, Exosystem, Interval, symbol
from symbolic.steady_state import SteadyState

MAX_SETTINGS = 64
MAX_STATES = 300
_LINE = (1, -1, Fraction(1, 10), Fraction(-1, 10), 10, -10, 100, -100, Fraction(1, 2), Fraction(-1, 2), 3, -3)
_PLANE = (0, 1, -1, Fraction(1, 10), Fraction(-1, 10), 10, -10)
_REFERENCES = (Fraction(0), Fraction(1), Fraction(-1), Fraction(10), Fraction(-10))

Point = dict[sympy.Symbol, sympy.Rational]


@dataclass(frozen=True)
class ZeroDynamics:
    """``z̄' = f0(z̄ + ζ, y^r, v, w) − f0(ζ, y^r, v, w)`` with ``ζ = z*(s*, v, w)`` (theory.md section 3).

    ``rates`` is written in the zero states (for ``z̄``), ``x1`` (for ``y^r``), ``v``, the parameters and ``base`` (for
    ``ζ``). ``base_values`` is ``z*(s*, v, w)`` where ``s*`` is exact and ``z*`` known, else None.
    """

    agent: Agent
    exosystem: Exosystem
    base: tuple[sympy.Symbol, ...]
    rates: tuple[sympy.Expr, ...]
    base_values: tuple[sympy.Expr, ...] | None


def zero_dynamics(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState | None, s_star: Fraction | None
) -> ZeroDynamics:
    """The zero dynamics in ``z̄`` around the steady state; an affine ``f0`` needs none."""
    taken = {str(name) for name in (*agent.zero_states, *agent.chain, *agent.parameters, *exosystem.states)}
    base = tuple(symbol(unused(f"{name}_star", taken)) for name in agent.zero_states)
    at_base = dict(zip(agent.zero_states, base, strict=True))
    shifted = {name: name + offset for name, offset in at_base.items()}
    rates = tuple(sympy.expand(side.xreplace(shifted) - side.xreplace(at_base)) for side in agent.zero_dynamics)
    values = None
    if steady_state is not None and s_star is not None:
        values = tuple(z.xreplace({COST_VARIABLE: as_rational(s_star)}) for z in steady_state.z_star)
    return ZeroDynamics(agent, exosystem, base, rates, values)


def settings(dynamics: ZeroDynamics, expressions: Sequence[sympy.Expr]) -> Iterator[Point]:
    """Values of ``y^r``, ``v``, the parameters and ``ζ`` that occur: corners of ``W`` and of ``V0`` first.

    Nothing is yielded where ``ζ`` occurs and is not known exactly.
    """
    agent, exosystem = dynamics.agent, dynamics.exosystem
    used = set[sympy.Basic]().union(*(expression.free_symbols for expression in expressions))
    needs_base = bool(used & set(dynamics.base))
    if needs_base and dynamics.base_values is None:
        return
    if needs_base and dynamics.base_values is not None:
        used |= set().union(*(value.free_symbols for value in dynamics.base_values))
    axes: dict[sympy.Symbol, Sequence[Fraction]] = {}
    for name, interval in zip(agent.parameters, agent.parameter_box, strict=True):
        axes[name] = _axis(interval, name in used)
    for name, interval in zip(exosystem.states, exosystem.initial, strict=True):
        axes[name] = _axis(interval, name in used)
    axes[agent.chain[0]] = _REFERENCES if agent.chain[0] in used else _REFERENCES[:1]
    for values in islice(product(*axes.values()), MAX_SETTINGS):
        point = {name: as_rational(value) for name, value in zip(axes, values, strict=True)}
        if needs_base and dynamics.base_values is not None:
            found = [value.xreplace(point) for value in dynamics.base_values]
            if not all(isinstance(value, sympy.Rational) for value in found):
                continue
            point |= dict(zip(dynamics.base, found, strict=True))
        yield point


def nonnegative_at(dynamics: ZeroDynamics, expression: sympy.Expr) -> Point | None:
    """A point with ``z̄ ≠ 0`` where the expression is proved to be ``≥ 0``; None when no sample is one."""
    names = tuple(sorted(expression.free_symbols, key=str))
    try:
        program = compile_expression(expression, names)
    except ValueError:
        return None
    for setting in settings(dynamics, [expression]):
        for state in _states(dynamics.agent.zero_states):
            point = setting | state
            values = [Fraction(int(point[name].p), int(point[name].q)) for name in names]
            exact = program.exact(values)
            if exact >= 0 if exact is not None else program([to_arb(value) for value in values]) >= 0:
                return {name: value for name, value in point.items() if name in names or name in state}
    return None


def _states(zero_states: tuple[sympy.Symbol, ...]) -> Iterator[Point]:
    choices = _LINE if len(zero_states) == 1 else _PLANE
    for values in islice(product(choices, repeat=len(zero_states)), MAX_STATES):
        if any(values):
            yield {name: sympy.Rational(value) for name, value in zip(zero_states, values, strict=True)}


def _axis(interval: Interval, used: bool) -> list[Fraction]:
    ends = list(dict.fromkeys((interval.lo, interval.hi)))
    return [*ends, (interval.lo + interval.hi) / 2] if used and len(ends) == 2 else ends[:1]
