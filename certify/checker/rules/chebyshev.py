"""Polynomials ``Σ a_j T_j(σ)`` on ``[−1, 1]`` with integer coefficients: derivative and integral, sizes, means."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb, isqrt, lcm

Polynomial = Sequence[int]


def size(a: Polynomial) -> int:
    """``Σ|a_j| ≥ sup|a|``, since ``|T_j| ≤ 1``."""
    return sum(map(abs, a))


def spread(a: Polynomial) -> int:
    """No less than the distance from ``a_0``."""
    return sum(map(abs, a[1:]))


def at_start(a: Polynomial) -> int:
    """At ``σ = −1``."""
    return sum(a[::2]) - sum(a[1::2])


def derivative(a: Polynomial) -> list[int]:
    """``da/dσ``: ``d_(j−1) = d_(j+1) + 2j a_j``, ``d_0`` half of that."""
    d = [0] * (len(a) + 1)
    for j in range(len(a) - 1, 0, -1):
        d[j - 1] = d[j + 1] + 2 * j * a[j]
    d[0] //= 2  # exact: a sum of even numbers
    return d[: max(len(a) - 1, 1)]


def integral_scale(length: int) -> int:
    """``M``: ``M ∫_(−1)^σ a dσ`` has integer coefficients for all ``a`` of this length."""
    return 2 * lcm(*range(1, length + 1))


def integral(a: Polynomial, scale: int) -> list[int]:
    """``M ∫_(−1)^σ a dσ``: ``b_j = (a_(j−1) − a_(j+1))/(2j)`` with ``a_0`` doubled, zero at ``σ = −1``."""
    padded = [2 * a[0], *a[1:], 0, 0]
    b = [0, *((padded[j - 1] - padded[j + 1]) * (scale // (2 * j)) for j in range(1, len(a) + 1))]
    b[0] = -at_start(b)
    return b


def product(a: Polynomial, b: Polynomial) -> list[int]:
    """Twice the product: ``2 T_i T_j = T_(i+j) + T_|i−j|``."""
    result = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        if x:
            for j, y in enumerate(b):
                term = x * y
                result[i + j] += term
                result[abs(i - j)] += term
    return result


def root_mean_square(a: Polynomial) -> int:
    """No less than the root of the mean square on ``[−1, 1]``: the terms up to ``T_3`` exactly, the others by size.

    The mean of ``T_i T_j`` is ``½(1/(1 − (i+j)²) + 1/(1 − (i−j)²))`` where ``i + j`` is even, else 0.
    """
    p, q, r, s = (*a[:4], 0, 0, 0, 0)[:4]
    square = 105 * p * p + 35 * q * q + 49 * r * r + 51 * s * s - 70 * p * r - 42 * q * s
    return isqrt(square // 105 + 1) + 1 + size(a[4:])


def monomials(degree: int) -> list[list[Fraction]]:
    """The Chebyshev coefficients of all ``σ^j``: ``2^(1−j) Σ_k C(j, k) T_(j−2k)``, half of it at ``T_0``."""
    rows = []
    for j in range(degree + 1):
        row = [Fraction(0)] * (j + 1)
        for k in range(j // 2 + 1):
            row[j - 2 * k] = Fraction(comb(j, k), 1 << max(j - 1, 0)) / (2 if j and j == 2 * k else 1)
        rows.append(row)
    return rows
