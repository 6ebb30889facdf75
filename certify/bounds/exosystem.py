"""Boxes that the exosystem never leaves: ``v' = Sv`` from every ``v(0)`` in ``V0``, all ``t >= 0`` (theory.md section
1).

With ``Q ≻ 0`` and ``SᵀQ + QS = 0`` the form ``vᵀQv`` is constant, so ``v_k² <= (Q⁻¹)_kk · max_V0 vᵀQv``; the convex
form has its maximum at a vertex of ``V0``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import product

import sympy
from sympy.utilities import iterables

from certify.bounds.balls import NonFiniteError, compile_expression
from certify.bounds.rationals import sqrt_up
from certify.inequalities.invariant import choose_form, invariant_forms
from certify.inequalities.lyapunov import Inconclusive
from certify.inequalities.matrices import Matrix, Row, inverse, matrix, quadratic_form
from symbolic.plant import Exosystem, Interval

_MOST_STATES = 12
_BITS = 40


@dataclass(frozen=True)
class ExosystemBounds:
    """``|v_k(t)| <= v̂_k`` for all ``t >= 0``: ``box`` follows from the one form ``Q`` by the formula above.

    ``sharp`` is inside ``box`` and holds too: it uses a form of its own for every state, and constant states keep their
    interval. Without a rational form (an irrational oscillator) ``Q`` is ``None`` and both boxes are the sharp one.
    ``|g·v(t)|² <= gᵀ extent g`` for every row ``g``: ``extent = Q⁻¹ · max_V0 vᵀQv``.
    """

    box: tuple[Interval, ...]
    Q: Matrix | None
    sharp: tuple[Interval, ...]
    extent: Matrix = ()


@lru_cache(maxsize=8)  # every agent asks for it
def exosystem_bounds(exosystem: Exosystem) -> ExosystemBounds | Inconclusive:
    """Intervals with short rational ends that hold ``v(t)`` for all ``t >= 0``, or why there are none.

    Irrational entries of ``S`` are handled when those that drive each other are rational multiples of one number, or
    make a 2×2 oscillator ``[[0, a], [−b, 0]]``.
    """
    n = len(exosystem.states)
    if n > _MOST_STATES:
        return Inconclusive(f"the exosystem has {n} states; its box is searched for up to {_MOST_STATES}")
    sharp = [Interval(Fraction(0), Fraction(0))] * n
    basis: list[Matrix] | None = []
    for group in _independent_groups(exosystem.S):
        S = exosystem.S.extract(group, group)
        initial = [exosystem.initial[k] for k in group]
        ratios = _common_ratios(S)
        forms = None if ratios is None else invariant_forms(ratios)
        found = _oscillator(S, initial) if forms is None else _sharp_bounds(S, forms, initial)
        if isinstance(found, str):
            names = ", ".join(str(exosystem.states[k]) for k in group)
            return Inconclusive(f"no bound of the exosystem states {names} for all time: {found}")
        for k, interval in zip(group, found, strict=True):
            sharp[k] = interval
        basis = None if basis is None or forms is None else basis + [_embed(form, group, n) for form in forms]
    if n == 0 or basis is None:
        return ExosystemBounds(tuple(sharp), None if n else (), tuple(sharp))
    corners = _corners(exosystem.initial)
    Q = choose_form(basis, corners)
    if Q is None:
        return Inconclusive("no single quadratic form that the whole exosystem keeps was found")
    extent = _extent(Q, corners)
    box = [_symmetric(extent[k][k]) for k in range(n)]
    meets = tuple(_intersection(a, b) for a, b in zip(box, sharp, strict=True))
    return ExosystemBounds(tuple(box), Q, meets, extent)


def _independent_groups(S: sympy.MatrixBase) -> list[list[int]]:
    coupled = [(i, j) for i in range(S.rows) for j in range(S.cols) if i != j and S[i, j] != 0]
    return sorted(map(sorted, iterables.connected_components((list(range(S.rows)), coupled))))


def _corners(initial: Sequence[Interval]) -> list[Row]:
    return list(product(*(sorted({side.lo, side.hi}) for side in initial)))


def _embed(form: Matrix, group: Sequence[int], n: int) -> Matrix:
    place = {k: j for j, k in enumerate(group)}
    return tuple(
        tuple(form[place[p]][place[q]] if p in place and q in place else Fraction(0) for q in range(n))
        for p in range(n)
    )


def _sharp_bounds(S: sympy.MatrixBase, forms: Sequence[Matrix], initial: Sequence[Interval]) -> list[Interval] | str:
    if all(entry == 0 for entry in S) or all(side.magnitude == 0 for side in initial):
        return list(initial)
    corners, coordinates = _corners(initial), range(len(initial))
    chosen = {Q for k in coordinates if (Q := choose_form(forms, corners, k)) is not None}
    if not chosen:
        return "no positive definite form that the exosystem keeps was found; are its eigenvalues imaginary and simple?"
    return [_symmetric(min(column)) for column in zip(*(_squares(Q, corners) for Q in chosen), strict=True)]


def _squares(Q: Matrix, corners: Sequence[Row]) -> list[Fraction]:
    extent = _extent(Q, corners)
    return [extent[k][k] for k in range(len(Q))]


def _extent(Q: Matrix, corners: Sequence[Row]) -> Matrix:
    level = max(quadratic_form(Q, corner) for corner in corners)
    return tuple(tuple(level * entry for entry in row) for row in inverse(Q))


def _intersection(first: Interval, second: Interval) -> Interval:
    return Interval(max(first.lo, second.lo), min(first.hi, second.hi))


def _symmetric(square: Fraction) -> Interval:
    size = sqrt_up(square, _BITS)
    return Interval(-size, size)


def _common_ratios(S: sympy.MatrixBase) -> Matrix | None:
    """``S`` over its first nonzero entry, if all ratios are rational; a factor of ``S`` changes only the time scale."""
    unit = next((entry for entry in S if entry != 0), sympy.S.One)
    ratios = S.applyfunc(lambda entry: sympy.S.Zero if entry == 0 else sympy.radsimp(entry / unit))
    return matrix(ratios.tolist()) if all(isinstance(entry, sympy.Rational) for entry in ratios) else None


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
