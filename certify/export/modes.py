"""The internal model in discrete time, exactly, in the coordinates of its oscillations (docs/export.md, internal
model)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import acb, arb, arb_mat, fmpq, fmpq_mat, fmpz_poly

from symbolic.controller import AgentController
from symbolic.errors import InputError


@dataclass(frozen=True)
class Mode:
    """One oscillation of ``u*``: ``frequency`` in rad/s, or ``None`` for its constant part, which is one state.

    ``m_a⁺ = cos·m_a + sin·m_b + g_a q``, ``m_b⁺ = cos·m_b − sin·m_a + g_b q`` with ``q = u − Ψη``, the difference of
    the written input and the model's; a constant part has ``m⁺ = m + g q``. ``Ψη`` is the sum of the ``m_a``.
    """

    frequency: arb | None
    cosine: arb
    sine: arb
    gain: tuple[arb, ...]
    start: tuple[arb, ...]


def modes(law: AgentController, period: Fraction, start: Fraction) -> tuple[Mode, ...]:
    """``η⁺ = e^(Aτ) η + ∫_0^τ e^(As) ds N (u − Ψη)``, ``A = M + NΨ``, in modal coordinates; ``start`` is each
    ``η_k(0)``.

    ``w = Oη``, ``O = [Ψ; ΨA; …]``, has ``w' = Φw``, ``Ψη = w_1``, ``Φ`` the companion matrix of the characteristic
    polynomial of ``A``. Its roots ``±jω`` have the real modal vectors ``(1, 0, −ω², 0 …)``, ``(0, ω, 0, −ω³ …)``.
    Raises ``InputError`` if a root is not imaginary or not simple.
    """
    n = len(law.N)
    if not n:
        return ()
    A = fmpq_mat(n, n, [_q(law.M[i][k] + law.N[i] * law.psi[k]) for i in range(n) for k in range(n)])
    rows, stacked = fmpq_mat(1, n, list(map(_q, law.psi))), []
    for _ in range(n):
        stacked += [rows[0, k] for k in range(n)]
        rows = rows * A
    observability = fmpq_mat(n, n, stacked)
    frequencies = _frequencies(A, law.id)
    columns: list[list[arb]] = []
    for frequency in frequencies:
        columns += _vectors(frequency, n)
    basis = arb_mat(n, n, [columns[k][i] for i in range(n) for k in range(n)])
    into = observability * fmpq_mat(n, 1, list(map(_q, law.N)))
    at_start = observability * fmpq_mat(n, 1, [_q(start)] * n)
    inputs, starts = _solved(basis, into), _solved(basis, at_start)
    found, place = [], 0
    for frequency in frequencies:
        size = 1 if frequency is None else 2
        part = slice(place, place + size)
        found.append(_mode(frequency, period, inputs[part], starts[part]))
        place += size
    return tuple(found)


def _mode(frequency: arb | None, period: Fraction, b: Sequence[arb], start: Sequence[arb]) -> Mode:
    """The rotation by ``ωτ`` and the input integrated over one period."""
    tau = arb(_q(period))
    if frequency is None:
        return Mode(None, arb(1), arb(0), (tau * b[0],), tuple(start))
    cosine, sine = (frequency * tau).cos(), (frequency * tau).sin()
    along, across = sine / frequency, (1 - cosine) / frequency
    gain = (along * b[0] + across * b[1], along * b[1] - across * b[0])
    return Mode(frequency, cosine, sine, gain, tuple(start))


def _vectors(frequency: arb | None, n: int) -> list[list[arb]]:
    """The real modal vectors, one or two, of length ``n``; of ``0`` it is the first unit vector."""
    if frequency is None:
        return [[arb(int(k == 0)) for k in range(n)]]
    signs = (1, 1, -1, -1)  # of j^k, real for even k
    powers = [signs[k % 4] * frequency**k for k in range(n)]
    return [[value if k % 2 == odd else arb(0) for k, value in enumerate(powers)] for odd in (0, 1)]


def _frequencies(A: fmpq_mat, agent: int) -> list[arb | None]:
    """``None`` for the root 0, then the ``ω > 0`` of the pairs ``±jω``, in growing order."""
    polynomial = A.charpoly()
    coefficients = [int(c) for c in (polynomial * polynomial.denom()).coeffs()]
    roots = fmpz_poly(coefficients).complex_roots()
    wrong = f"agent {agent}: the internal model has a root that is not simple or not imaginary"
    if any(coefficients[k] for k in range(A.nrows() - 1, -1, -2)):  # roots come in pairs ±λ only if it is even or odd
        raise InputError(wrong)
    found: list[arb | None] = []
    for root, multiplicity in roots:
        value = acb(root)
        if multiplicity != 1 or not value.real.contains(0):
            raise InputError(wrong)
        if value.imag > 0:
            found.append(value.imag)
        elif value.imag.contains(0):
            found.insert(0, None)
    if sum(1 if f is None else 2 for f in found) != A.nrows() or found.count(None) > 1:
        raise InputError(wrong)
    constants = [f for f in found if f is None]
    return [*constants, *sorted((f for f in found if f is not None), key=lambda f: float(f))]


def _solved(basis: arb_mat, right: fmpq_mat) -> list[arb]:
    """``basis⁻¹ right``, enclosed."""
    column = basis.solve(arb_mat(right))
    return [column[k, 0] for k in range(column.nrows())]


def _q(value: Fraction) -> fmpq:
    return fmpq(value.numerator, value.denominator)
