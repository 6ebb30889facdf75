"""Agents and exosystems written in Python, for tests that need no plant file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy

from symbolic.plant import Agent, Exosystem, InitialBox, Interval, symbol

POINT = Interval(Fraction(0), Fraction(0))
UNIT = Interval(Fraction(-1), Fraction(1))
S = symbol("s")
V1, V2, V3 = symbol("v1"), symbol("v2"), symbol("v3")
X1, X2, X3, X4 = (symbol(f"x{k}") for k in range(1, 5))
Z1, Z2 = symbol("z1"), symbol("z2")
P, Q = symbol("p"), symbol("q")


def exosystem(*rows: Sequence[object]) -> Exosystem:
    """``v' = S v`` with the given rows; no rows: no exosystem."""
    matrix = sympy.ImmutableMatrix(len(rows), len(rows), [sympy.sympify(entry) for row in rows for entry in row])
    return Exosystem((V1, V2, V3, symbol("v4"))[: len(rows)], matrix, (UNIT,) * len(rows))


NOTHING = exosystem()
CONSTANT = exosystem([0])
ROTATION = exosystem([0, sympy.Rational(4, 5)], [-sympy.Rational(4, 5), 0])


def agent(
    f0: Sequence[object] = (),
    f: object = 0,
    *,
    order: int = 2,
    b: object = 1,
    box: Mapping[sympy.Symbol, tuple[object, object]] | None = None,
    **answers: Any,
) -> Agent:
    """Zero states z1, z2, … with right-hand sides ``f0``; ``answers`` are the user's optional ones."""
    names = tuple(symbol(f"z{k}") for k in range(1, len(f0) + 1))
    intervals = {name: Interval(Fraction(str(lo)), Fraction(str(hi))) for name, (lo, hi) in (box or {}).items()}
    return Agent(
        id=1,
        order=order,
        zero_states=names,
        zero_dynamics=tuple(sympy.sympify(expr) for expr in f0),
        f=sympy.sympify(f),
        b=sympy.sympify(b),
        cost=S**2,
        parameters=tuple(intervals),
        parameter_box=tuple(intervals.values()),
        initial=InitialBox((UNIT,) * len(names), (UNIT,) * order, None, POINT, POINT),
        **answers,
    )
