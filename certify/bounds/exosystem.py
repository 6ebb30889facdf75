"""A box that the exosystem never leaves: ``v' = Sv`` from every ``v(0)`` in ``V0``, for all ``t >= 0`` (theory.md
section 1).

With ``Q ≻ 0`` and ``SᵀQ + QS = 0`` the form ``vᵀQv`` is constant, so ``v_k² <= (Q⁻¹)_kk · max_V0 vᵀQv``; the convex
form has its maximum at a vertex of ``V0``. States that do not drive each other are bounded separately.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import networkx
import sympy

from certify.bounds.balls import NonFiniteError, compile_expression
from certify.bounds.rationals import sqrt_up
from certify.inequalities.invariant import invariant_quadratic
from certify.inequalities.lyapunov import Inconclusive
from certify.inequalities.matrices import inverse, matrix, quadratic_form
from symbolic.plant import Exosystem, Interval

_MOST_STATES = 12
_BITS = 40


def exosystem_bounds(exosystem: Exosystem) -> tuple[Interval, ...] | Inconclusive:
    """One interval per state that holds ``v_k(t)`` for all ``t >= 0``, with short rational ends; or why there is none.

    Constant states keep their interval; the other intervals are symmetric. Irrational entries of ``S`` are handled
    when they are rational multiples of one number, or in a 2×2 oscillator ``[[0, a], [−b, 0]]``.
    """
    bounds: list[Interval | None] = [None] * len(exosystem.states)
    for group in _independent_groups(exosystem.S):
        S = exosystem.S.extract(group, group)
        initial = [exosystem.initial[k] for k in group]
        found = _group_bounds(S, initial)
        if isinstance(found, str):
            names = ", ".join(str(exosystem.states[k]) for k in group)
            return Inconclusive(f"no bound of the exosystem states {names} for all time: {found}")
        for k, interval in zip(group, found, strict=True):
            bounds[k] = interval
    return tuple(interval for interval in bounds if interval is not None)


def _independent_groups(S: sympy.MatrixBase) -> list[list[int]]:
    graph = networkx.Graph()
    graph.add_nodes_from(range(S.rows))
    graph.add_edges_from((i, j) for i in range(S.rows) for j in range(S.cols) if S[i, j] != 0)
    return [sorted(group) for group in networkx.connected_components(graph)]


def _group_bounds(S: sympy.MatrixBase, initial: Sequence[Interval]) -> list[Interval] | str:
    if all(entry == 0 for entry in S):
        return list(initial)
    if all(side.magnitude == 0 for side in initial):
        return list(initial)
    if len(initial) > _MOST_STATES:
        return f"{len(initial)} coupled states have too many vertices"
    corners = list(product(*(sorted({side.lo, side.hi}) for side in initial)))
    ratios = _common_ratios(S)
    if ratios is None:
        return _oscillator(S, initial)
    rational, coordinates = matrix(ratios.tolist()), range(len(initial))
    forms = {Q for k in coordinates if (Q := invariant_quadratic(rational, corners, k)) is not None}
    if not forms:
        return "no positive definite form that the exosystem keeps was found; are its eigenvalues imaginary and simple?"
    squares: list[list[Fraction]] = []
    for Q in forms:
        level = max(quadratic_form(Q, corner) for corner in corners)
        widths = inverse(Q)
        squares.append([widths[k][k] * level for k in coordinates])
    return [_symmetric(min(column)) for column in zip(*squares, strict=True)]


def _symmetric(square: Fraction) -> Interval:
    size = sqrt_up(square, _BITS)
    return Interval(-size, size)


def _common_ratios(S: sympy.MatrixBase) -> sympy.MatrixBase | None:
    """``S`` over its first nonzero entry, if all ratios are rational; a factor of ``S`` changes only the time scale."""
    unit = next(entry for entry in S if entry != 0)
    ratios = S.applyfunc(lambda entry: sympy.S.Zero if entry == 0 else sympy.radsimp(entry / unit))
    return ratios if all(isinstance(entry, sympy.Rational) for entry in ratios) else None


def _oscillator(S: sympy.MatrixBase, initial: Sequence[Interval]) -> list[Interval] | str:
    """``v1' = a v2``, ``v2' = −b v1`` with ``a b > 0`` keeps ``b v1² + a v2²``."""
    if S.shape != (2, 2) or S[0, 0] != 0 or S[1, 1] != 0 or S[1, 0] == 0:
        return "S is irrational and neither a multiple of a rational matrix nor an oscillator [[0, a], [-b, 0]]"
    try:
        ratio = compile_expression(-S[0, 1] / S[1, 0], ()).enclose(())
    except (ValueError, NonFiniteError) as error:
        return f"the entries of S cannot be enclosed: {error}"
    if ratio.lo <= 0:
        return "S is an irrational 2×2 matrix whose eigenvalues are not proved to be imaginary"
    first, second = (side.magnitude**2 for side in initial)
    return [_symmetric(first + ratio.hi * second), _symmetric(second + first / ratio.lo)]
