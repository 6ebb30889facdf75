"""The observer in discrete time: Luenberger, with the poles of the continuous one (docs/export.md, observer)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import factorial

from flint import arb, arb_mat, arb_poly, fmpq, fmpq_mat

from certify.bounds.conversions import rational_ball
from symbolic.controller import Row


@dataclass(frozen=True)
class Luenberger:
    """``x̃_(k+1) = E x̃_k + L (y_k − x̃_(1,k))``: ``E = e^(Jτ)`` of the chain, ``E − L e_1ᵀ`` with poles ``e^(hτλ_i)``.

    ``E`` is exact, ``L`` enclosed; ``transition[j]`` is ``E_(k,k+j) = τ^j/j!``.
    """

    transition: Row
    gain: tuple[arb, ...]


def luenberger(observer: Row, h: Fraction, period: Fraction) -> Luenberger:
    """Of ``observer = (c_1 … c_n)``, ``λⁿ + c_n λ^(n−1) + … + c_1``, at ``h`` (1/s) and the period ``τ`` (s).

    By Ackermann's formula ``L = χ(E) O⁻¹ e_n``: ``χ`` the characteristic polynomial of ``e^(hτC)``, ``C`` the companion
    matrix of the ``c_k``, ``O`` the observability matrix of ``(E, e_1ᵀ)``, which is exact and regular for ``τ > 0``.
    """
    n = len(observer)
    transition = tuple(period**j / factorial(j) for j in range(n))
    E = fmpq_mat(n, n, [_rational(transition[k - i]) if k >= i else 0 for i in range(n) for k in range(n)])
    companion = arb_mat(n, n)
    for k in range(n):
        if k + 1 < n:
            companion[k, k + 1] = rational_ball(h * period)
        companion[n - 1, k] = companion[n - 1, k] - rational_ball(h * period * observer[k])
    chi: arb_poly = companion.exp().charpoly()
    first = fmpq_mat(1, n, [1] + [0] * (n - 1))
    rows, observability = first, []
    for _ in range(n):
        observability += [rows[0, k] for k in range(n)]
        rows = rows * E
    last = fmpq_mat(n, 1, [0] * (n - 1) + [1])
    power = fmpq_mat(n, n, observability).inv() * last
    gain = [arb(0)] * n
    for j in range(n + 1):
        gain = [value + chi[j] * arb(power[k, 0]) for k, value in enumerate(gain)]
        power = E * power
    return Luenberger(transition, tuple(gain))


def _rational(value: Fraction) -> fmpq:
    return fmpq(value.numerator, value.denominator)
