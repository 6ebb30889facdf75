"""The design polynomials and the internal model's pair (M, N): the user's, verified exactly, or the defaults."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from sympy import QQ
from sympy.polys.matrices import DomainMatrix

from symbolic.errors import InputError
from symbolic.hurwitz import hurwitz_test
from symbolic.plant import Agent, InternalModelChoice

Row = tuple[Fraction, ...]
CRITICAL = Fraction(1)


@dataclass(frozen=True)
class DesignPolynomials:
    """``gamma = (γ_1 … γ_(n−1))`` of ``λ^(n−1) + γ_(n−1) λ^(n−2) + … + γ_1`` and ``observer = (c_1 … c_n)`` of
    ``λⁿ + c_n λ^(n−1) + … + c_1``, both Hurwitz. For n = 1 both are empty: there is no x̂ and no observer."""

    gamma: Row
    observer: Row


def design_polynomials(agent: Agent) -> DesignPolynomials:
    """The user's Hurwitz polynomials of an agent, or ``(λ+1)^(n−1)`` and ``(λ+1)ⁿ``.

    Raises ``InputError`` naming the key when a given polynomial has the wrong length or is not Hurwitz.
    """
    n = agent.order
    if n == 1 and agent.observer is not None:
        raise InputError(f"agent {agent.id}: observer: an agent of order 1 measures its state and has none")
    gamma = damped_polynomial(n - 1, CRITICAL) if agent.gamma is None else _checked(agent, "gamma", agent.gamma, n - 1)
    if agent.observer is None:
        observer = damped_polynomial(n, CRITICAL) if n > 1 else ()
    else:
        observer = _checked(agent, "observer", agent.observer, n)
    return DesignPolynomials(gamma, observer)


def internal_model_pair(agent: Agent, order: int) -> InternalModelChoice:
    """The user's pair (M, N), ``order × order`` and ``order``, or the companion matrix with the poles −1 … −order.

    Raises ``InputError`` naming the key when the sizes differ from ``order`` (theory.md section 2, A5: the least s_i),
    M is not Hurwitz or (M, N) is not controllable.
    """
    choice = agent.internal_model
    if choice is None:
        return companion_pair(order)
    key = f"agent {agent.id}: internal_model"
    if order == 0:
        raise InputError(f"{key}: the steady-state input is identically zero, so there is no internal model")
    if len(choice.M) != order or any(len(row) != order for row in choice.M):
        raise InputError(f"{key}.M: the steady-state input needs a {order}×{order} matrix")
    if len(choice.N) != order:
        raise InputError(f"{key}.N: the steady-state input needs {order} entries")
    test = hurwitz_test(characteristic_polynomial(choice.M))
    if test.verdict != "holds":
        raise InputError(f"{key}.M: not Hurwitz, {test.reason}")
    if not is_controllable(choice.M, choice.N):
        raise InputError(f"{key}.N: the pair (M, N) is not controllable")
    return choice


def companion_pair(order: int, pole: Fraction = Fraction(1)) -> InternalModelChoice:
    """``M`` in companion form with the poles ``−pole, −2 pole, … −order pole``, and ``N = (0, …, 0, 1)``."""
    lower = [Fraction(1)]  # of Π (λ + k pole), constant coefficient first
    for k in range(1, order + 1):
        shifted = zip([*lower, Fraction(0)], [Fraction(0), *lower], strict=True)
        lower = [k * pole * below + above for below, above in shifted]
    rows = [tuple(Fraction(int(column == row + 1)) for column in range(order)) for row in range(order - 1)]
    last = [tuple(-c for c in lower[:-1])] if order else []
    return InternalModelChoice((*rows, *last), tuple(Fraction(int(k == order - 1)) for k in range(order)))


def damped_polynomial(degree: int, damping: Fraction) -> Row:
    """``(λ² + 2 damping λ + 1)^⌊degree/2⌋ (λ + 1)^(degree mod 2)``, which is binomial for damping 1.

    From the constant coefficient up, without the leading 1.
    """
    coefficients = [Fraction(1), Fraction(1)] if degree % 2 else [Fraction(1)]
    factor = (Fraction(1), 2 * damping, Fraction(1))
    for _ in range(degree // 2):
        product = [Fraction(0)] * (len(coefficients) + 2)
        for k, c in enumerate(coefficients):
            for j, f in enumerate(factor):
                product[k + j] += c * f
        coefficients = product
    return tuple(coefficients[:-1])


def characteristic_polynomial(matrix: tuple[Row, ...]) -> Row:
    """Coefficients of ``det(λI − M)``, leading one first, exactly."""
    return tuple(Fraction(int(c.numerator), int(c.denominator)) for c in _exact(matrix).charpoly())


def is_controllable(M: tuple[Row, ...], N: Row) -> bool:
    """Kalman's rank condition on ``[N, MN, …, M^(s−1)N]`` in rational arithmetic."""
    matrix, column = _exact(M), _exact(tuple((entry,) for entry in N))
    columns = [column]
    for _ in range(len(M) - 1):
        columns.append(matrix * columns[-1])
    return bool(columns[0].hstack(*columns[1:]).rank() == len(M))


def _checked(agent: Agent, key: str, lower: Row, degree: int) -> Row:
    """``lower`` is written from the constant coefficient up, without the leading 1."""
    if len(lower) != degree:
        raise InputError(
            f"agent {agent.id}: {key}: {degree} coefficients are needed for order {agent.order}, not {len(lower)}"
        )
    test = hurwitz_test((Fraction(1), *reversed(lower)))
    if test.verdict != "holds":
        raise InputError(f"agent {agent.id}: {key}: not Hurwitz, {test.reason}")
    return lower


def _exact(rows: tuple[Row, ...]) -> DomainMatrix:
    shape = (len(rows), len(rows[0]) if rows else 0)
    return DomainMatrix([[QQ(e.numerator, e.denominator) for e in row] for row in rows], shape, QQ)
