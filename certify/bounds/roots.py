"""Steady states without closed form: the only zero of a falling ``f0(z, s, w)``, in a proved interval.

docs/certificate.md, section 1, A3: signs at both ends for all ``s`` and ``w``, and ``∂f0/∂z < 0`` from 0 to there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction

import sympy

from certify.bounds.balls import NonFiniteError
from certify.bounds.suprema import lower_bound, upper_bound
from symbolic.constants import as_rational
from symbolic.plant import COST_VARIABLE, Agent, Interval
from symbolic.steady_state import SteadyState, right_hand_side, root_symbol

DOUBLINGS = 60  # of an end, from 1: no unit of a state is further from the numbers in use
HALVINGS = 200
SHARPNESS = Fraction(1, 1 << 24)  # of a bracket, to its end: the tube rounds its boxes to 22 bits


def root_brackets(agent: Agent, steady: SteadyState, optimum: Interval) -> dict[sympy.Symbol, Interval] | str:
    """For each zero state in ``steady.roots`` an interval that holds ``z*(s, w)`` for all ``s`` in ``optimum`` and all
    parameters; or why there is none."""
    found: dict[sympy.Symbol, Interval] = {}
    box = dict(zip(agent.parameters, agent.parameter_box, strict=True))
    for z, f0 in zip(agent.zero_states, right_hand_side(agent), strict=True):
        if z in steady.roots:
            try:
                bracket = _bracket(z, f0, {**box, COST_VARIABLE: optimum})
            except (NonFiniteError, ValueError) as obstacle:
                return f"the zero of f0 ({z}) could not be enclosed: {obstacle}"
            if isinstance(bracket, str):
                return bracket
            found[z] = bracket
    return found


def with_roots(agent: Agent, brackets: Mapping[sympy.Symbol, Interval]) -> Agent:
    """The agent with every root as one more uncertain parameter, on which its dynamics do not depend."""
    new = {root_symbol(z): side for z, side in brackets.items() if root_symbol(z) not in agent.parameters}
    return replace(agent, parameters=(*agent.parameters, *new), parameter_box=(*agent.parameter_box, *new.values()))


def _bracket(z: sympy.Symbol, f0: sympy.Expr, box: dict[sympy.Symbol, Interval]) -> Interval | str:
    def not_below(value: Fraction) -> bool:
        """``f0 ≥ 0`` there for all s and w, so that the zero is not below."""
        return lower_bound(f0.xreplace({z: as_rational(value)}), box).value >= 0

    def not_above(value: Fraction) -> bool:
        return upper_bound(f0.xreplace({z: as_rational(value)}), box).value <= 0

    ends = []
    for side, holds in ((-1, not_below), (1, not_above)):
        outer = next((end for k in range(DOUBLINGS) if holds(end := Fraction(side * 2**k))), None)
        if outer is None:
            return f"f0 ({z}) has no zero that was found for all s and parameters"
        ends.append((outer, holds))
    (low, below), (high, above) = ends
    bracket = Interval(_drawn_in(low, high, below), _drawn_in(high, low, above))
    zero, s = Fraction(0), box[COST_VARIABLE]
    way = {z: Interval(min(bracket.lo, zero), max(bracket.hi, zero))}
    way[COST_VARIABLE] = Interval(min(s.lo, zero), max(s.hi, zero))
    if upper_bound(sympy.diff(f0, z), {**box, **way}).value >= 0:
        return f"∂f0/∂z of {z} is not shown to be negative from 0 to the steady state, so it may not be unique"
    return bracket


def _drawn_in(end: Fraction, other: Fraction, holds: Callable[[Fraction], bool]) -> Fraction:
    """The end moved towards the other one as far as the sign holds, to about ``SHARPNESS``."""
    beyond = other
    if holds(Fraction(0)) and (end < 0) == (other > 0):
        end = Fraction(0)
    for _ in range(HALVINGS):
        if abs(beyond - end) <= SHARPNESS * abs(end):
            break
        middle = (end + beyond) / 2
        end, beyond = (middle, beyond) if holds(middle) else (end, middle)
    return end
