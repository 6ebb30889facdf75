"""The nominal closed loop of one agent in error coordinates ``X = (z̄, x̄, η̄, e)``, exact
(docs/certificate-direct.md section 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.agent_model import AgentModel, Matrix, Row

ZERO, ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True)
class Nominal:
    """Nominal slopes: ``f0`` in ``(z, x1)`` (``nz × (nz+1)``), ``f1`` in ``(z, x)`` (``nz + n``), and the input gain
    ``b``."""

    f0: Matrix
    f1: Row
    b: Fraction


@dataclass(frozen=True)
class LoopGains:
    """``g, K`` and the observer gain ``h`` (``None`` for ``n = 1``)."""

    g: Fraction
    K: Fraction
    h: Fraction | None


@dataclass(frozen=True)
class Loop:
    """``X' = A X + Σ B_j q_j`` while the saturation is inactive; ``outputs`` are ``z̄, x̄, ϑ̃`` and ``υ = Ψη̄ − Kϑ̃``.

    ``columns`` are the ``B_j``: one per zero state, one for ``f1``, one for ``ẏ^r``. ``X = Σ_l starts_l Y_l`` with
    ``Y = (z̄, x̄_1 … x̄_(n−1), ϑ, ζ, e)``, ``ζ = η̄ − N x̄_n/b``: what is known when the tube begins.
    """

    A: Matrix
    columns: tuple[Row, ...]
    starts: tuple[Row, ...]
    outputs: tuple[Row, ...]
    zeros: int
    order: int
    internal: int

    @property
    def size(self) -> int:
        return len(self.A)

    @property
    def plant_outputs(self) -> int:
        """``z̄`` and ``x̄`` come first; ``ϑ̃`` is the next one."""
        return self.zeros + self.order


def nominal_loop(model: AgentModel, gains: LoopGains, nominal: Nominal) -> Loop:
    """Assemble ``A``, ``B`` and ``C`` for ``u = Ψη − K ϑ̃``."""
    n, nz, s = model.order, len(model.agent.zero_states), model.internal_model.order
    observer = n > 1
    size = nz + n + s + (n if observer else 0)
    x0, e0, eta0 = nz, nz + n + s, nz + n

    estimate = [ZERO] * size
    for k in range(1, n + 1):
        gamma = model.gamma[k - 1] if k < n else ONE
        estimate[x0 + k - 1] = gains.g ** (n - k) * gamma
        if observer:
            assert gains.h is not None
            estimate[e0 + k - 1] = -((gains.g / gains.h) ** (n - k)) * gamma
    feedback = [-gains.K * entry for entry in estimate]
    internal = [ZERO] * size
    internal[eta0 : eta0 + s] = model.internal_model.psi

    last = [nominal.b * (u + eta) for u, eta in zip(feedback, internal, strict=True)]
    for k, slope in enumerate(nominal.f1):
        last[k] += slope
    rows: list[list[Fraction]] = []
    for k in range(nz):
        rows.append(_placed(size, {**dict(enumerate(nominal.f0[k][:nz])), x0: nominal.f0[k][nz]}))
    for k in range(1, n):
        rows.append(_placed(size, {x0 + k: ONE}))
    rows.append(last)
    im = model.internal_model
    for k in range(s):
        row = [im.N[k] * u for u in feedback]
        for j in range(s):
            row[eta0 + j] += im.M[k][j] + im.N[k] * im.psi[j]
        rows.append(row)
    if observer:
        assert gains.h is not None
        for k in range(n):
            row = list(last) if k == n - 1 else [ZERO] * size
            row[e0] -= gains.h * model.observer[n - 1 - k]
            if k < n - 1:
                row[e0 + k + 1] += gains.h
            rows.append(row)

    columns = [_placed(size, {k: ONE}) for k in range(nz)]
    columns.append(_placed(size, {x0 + n - 1: ONE, e0 + n - 1: ONE} if observer else {x0: ONE}))
    columns.append(_placed(size, {x0: -ONE}))
    applied = [u + eta for u, eta in zip(feedback, internal, strict=True)]
    outputs = [_placed(size, {k: ONE}) for k in range(nz + n)] + [estimate, applied]
    starts = [_placed(size, {k: ONE}) for k in range(size)]
    along = {x0 + n - 1: ONE, **{eta0 + a: entry / nominal.b for a, entry in enumerate(im.N)}}
    starts[x0 + n - 1] = _placed(size, along)
    for k in range(n - 1):
        starts[x0 + k] = _placed(size, {x0 + k: ONE} | {row: -estimate[x0 + k] * entry for row, entry in along.items()})
    return Loop(_frozen(rows), _frozen(columns), _frozen(starts), _frozen(outputs), nz, n, s)


def _placed(size: int, entries: dict[int, Fraction]) -> list[Fraction]:
    row = [ZERO] * size
    for position, entry in entries.items():
        row[position] += entry
    return row


def _frozen(rows: Sequence[Sequence[Fraction]]) -> Matrix:
    return tuple(tuple(row) for row in rows)
