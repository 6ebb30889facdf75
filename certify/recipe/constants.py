"""The constants ``ς1 … ς11`` on a level set, proved (docs/certificate.md section 3; the paper's Appendix 1 with F6,
F14, F15)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import sympy

from certify.agent_model import (
    AgentModel,
    LyapunovMatrices,
    Matrix,
    Row,
    Sublevel,
    euclidean_norm,
    quadratic_form_bound,
    row_sum_norm,
)
from certify.bounds.rationals import round_up, sqrt_up
from certify.bounds.suprema import magnitude_bound
from certify.inequalities.matrices import apply, inverse
from symbolic.plant import Interval

ONE = Fraction(1)


@dataclass(frozen=True)
class InternalModelNorms:
    """``‖P2 N‖, ‖P2 M N‖, ‖Ψ‖, |ΨN|``; all zero without an internal model."""

    P2N: Fraction = Fraction(0)
    P2MN: Fraction = Fraction(0)
    psi: Fraction = Fraction(0)
    psi_N: Fraction = Fraction(0)


@dataclass(frozen=True)
class Constants:
    """Everything bounded on ``{W ≤ C}``, named as in the paper; ``weight_eta = ς7ς8``, ``weight_vartheta = 4ς6ς7ς8``.

    ``f_z, f_x, f_vartheta, f_reference`` are the bounds ``F_z, F_x, F_ϑ, ς_f`` of the increments of ``f̂`` and ``f̄2``.
    """

    level: Fraction
    g: Fraction
    sublevel: Sublevel
    b: Interval
    norms: InternalModelNorms
    f_z: Fraction
    f_x: Fraction
    f_vartheta: Fraction
    f_reference: Fraction
    varsigma: dict[int, Fraction]
    rho: dict[int, Fraction]
    weight_eta: Fraction
    weight_vartheta: Fraction


def internal_model_norms(model: AgentModel, P2: Matrix) -> InternalModelNorms:
    im = model.internal_model
    if im.order == 0:
        return InternalModelNorms()
    return InternalModelNorms(
        P2N=euclidean_norm(apply(P2, im.N)),
        P2MN=euclidean_norm(apply(P2, apply(im.M, im.N))),
        psi=euclidean_norm(im.psi),
        psi_N=abs(sum((p * n for p, n in zip(im.psi, im.N, strict=True)), Fraction(0))),
    )


def gain_g_threshold(
    model: AgentModel, matrices: LyapunovMatrices, varsigma1: Fraction, varsigma2: Fraction
) -> Fraction:
    """``g > 2 + ς1²ς2²/a0 + a0/4`` (1 for ``n = 1``, where ``g`` does not occur)."""
    if model.order == 1:
        return ONE
    return 2 + (varsigma1 * varsigma2) ** 2 / matrices.a0 + matrices.a0 / 4


def zero_layer(
    model: AgentModel, matrices: LyapunovMatrices, level: Fraction, vartheta: Fraction
) -> tuple[Fraction, ...]:
    """``ς1, ς2, ς3`` on ``{V0 ≤ C} × {V1 ≤ C}`` (and ``|ϑ| ≤ vartheta`` for ``n = 1``); they do not depend on ``g``."""
    if not matrices.V0:
        return Fraction(0), Fraction(0), Fraction(0)
    box = model.box(sublevel(matrices, level, Fraction(0), vartheta), ONE)
    return 2 * row_sum_norm(matrices.V0), model.zero_input_slope(box), model.zero_input_slope(model.reference_box())


def sublevel(matrices: LyapunovMatrices, level: Fraction, weight_eta: Fraction, vartheta: Fraction) -> Sublevel:
    """The coordinate ranges on ``{V0 ≤ C}``, ``{V1 ≤ C}``, ``{V2 ≤ C ω_η}``: ``√(C (P⁻¹)_kk)``."""
    return Sublevel(
        z=_ellipsoid_box(matrices.V0, level),
        x_hat=_ellipsoid_box(matrices.P1, level),
        eta=_ellipsoid_box(matrices.P2, level * weight_eta),
        vartheta=vartheta,
    )


def _ellipsoid_box(matrix: Matrix, level: Fraction) -> Row:
    if not matrix:
        return ()
    dual = inverse(matrix)
    return tuple(sqrt_up(level * dual[k][k]) for k in range(len(dual)))


def constants(model: AgentModel, matrices: LyapunovMatrices, level: Fraction, g: Fraction) -> Constants:
    """Bound everything on ``{W ≤ level}`` for this ``g``, in the order that breaks the paper's circle.

    First what does not depend on ``ϑ`` (so ``ς7, ς8`` and the weights), then the range of ``ϑ``, then ``ς9``.
    """
    b, norms = model.input_gain, internal_model_norms(model, matrices.P2)
    slice_box = model.box(sublevel(matrices, level, Fraction(0), Fraction(0)), g)
    f_z = model.zero_slope(slice_box)
    f_x = model.chain_slope(slice_box, g, with_design=True)

    rho = {1: max(ONE, f_z**2), 2: max(ONE, f_x**2), 4: max(ONE, f_z**2), 5: max(ONE, f_x**2)}
    varsigma = {
        4: max(ONE, round_up(12 * (norms.P2N / b.lo) ** 2)),
        5: Fraction(2),
        6: max(ONE, round_up(2 * (b.hi * norms.psi) ** 2)),
    }
    scaling = 1 + sum((g ** (model.order - k) * gamma for k, gamma in enumerate(model.gamma, start=1)), Fraction(0))
    varsigma[8] = max(varsigma[4], varsigma[5], round_up(scaling**2))
    worst = max(rho[1] + rho[4] / (4 * varsigma[6]), rho[2] + rho[5] / (4 * varsigma[6]))
    varsigma[7] = max(ONE, round_up(4 * worst / matrices.a0))
    weight_eta = round_up(varsigma[7] * varsigma[8], bits=24)
    weight_vartheta = round_up(4 * varsigma[6] * weight_eta, bits=24)

    vartheta = sqrt_up(2 * level * weight_vartheta)
    full = sublevel(matrices, level, weight_eta, vartheta)
    f_vartheta = model.last_slope(model.box(full, g)) + (g * model.gamma[-1] if model.order > 1 else 0)
    varsigma[1], varsigma[2], varsigma[3] = zero_layer(
        model, matrices, level, vartheta if model.order == 1 else Fraction(0)
    )
    ratio = norms.P2MN / norms.P2N if norms.P2N else Fraction(0)
    rho[3] = max(ONE, round_up((ratio + f_vartheta) ** 2))
    rho[6] = max(ONE, round_up((f_vartheta + norms.psi_N) ** 2))
    p1 = row_sum_norm(matrices.P1)
    varsigma[9] = max(ONE, round_up(p1**2 + rho[3] / varsigma[7] + rho[6] / (4 * varsigma[6] * varsigma[7])))
    if model.order == 1 and matrices.V0:
        varsigma[9] += round_up((varsigma[1] * varsigma[2]) ** 2 / matrices.a0)

    f_reference = model.output_slope()
    coupling = 4 * (norms.P2N / b.lo) ** 2 / weight_eta + 1 / (2 * weight_vartheta)
    gamma1 = model.gamma[0] if model.order > 1 else ONE
    zero_drive = (varsigma[1] * varsigma[3]) ** 2 / matrices.a0 if matrices.V0 else Fraction(0)
    varsigma[10] = round_up(zero_drive + 2 * coupling * f_reference**2)
    varsigma[11] = round_up(p1**2 + 2 * coupling * (g ** (model.order - 1) * gamma1) ** 2)
    return Constants(
        level, g, full, b, norms, f_z, f_x, f_vartheta, f_reference, dict(sorted(varsigma.items())),
        dict(sorted(rho.items())),
        weight_eta, weight_vartheta,
    )  # fmt: skip


def gain_K_threshold(found: Constants) -> Fraction:
    """``K > (1 + 4ς6ς7ς8ς9)/b_min``."""
    return (1 + found.weight_vartheta * found.varsigma[9]) / found.b.lo


def initial_energy(model: AgentModel, matrices: LyapunovMatrices, found: Constants) -> Fraction:
    """``w0 = max_box [V0 + V1 + V2/(ς7ς8) + V3/(4ς6ς7ς8)]`` over the box in the original states."""
    g, n, agent = found.g, model.order, model.agent
    z = [
        _magnitude_of_difference(state, steady, model)
        for state, steady in zip(agent.initial.z, model.steady_state, strict=True)
    ]
    x = [side.magnitude for side in agent.initial.x]
    reference = agent.initial.reference
    x[0] = max(abs(agent.initial.x[0].hi - reference.lo), abs(agent.initial.x[0].lo - reference.hi))
    x_hat = [x[k] / g**k for k in range(n - 1)]
    weights = [g ** (n - k) * gamma for k, gamma in enumerate(model.gamma, start=1)] + [ONE]
    vartheta = sum((a * m for a, m in zip(weights, x, strict=True)), Fraction(0))
    energy = quadratic_form_bound(matrices.V0, z) + quadratic_form_bound(matrices.P1, x_hat)
    energy += vartheta**2 / (2 * found.weight_vartheta)
    if model.internal_model.order:
        eta = _initial_internal_error(model, vartheta, found.b)
        energy += quadratic_form_bound(matrices.P2, eta) / found.weight_eta
    return round_up(energy)


def _magnitude_of_difference(state: Interval, steady: sympy.Expr, model: AgentModel) -> Fraction:
    box = model.initial_exogenous_box
    high = magnitude_bound(_rational(state.hi) - steady, box).value
    return max(high, magnitude_bound(_rational(state.lo) - steady, box).value)


def _initial_internal_error(model: AgentModel, vartheta: Fraction, b: Interval) -> Sequence[Fraction]:
    """Magnitudes of ``η̃(0) = η(0) − T τ(0) − b⁻¹ N ϑ(0)``."""
    im, eta = model.internal_model, model.agent.initial.eta.magnitude
    steady = [
        magnitude_bound(sum((_rational(t) * tau for t, tau in zip(row, im.tau, strict=True)), sympy.S.Zero),
        model.initial_exogenous_box).value
        for row in im.T
    ]  # fmt: skip
    return [eta + target + abs(n) * vartheta / b.lo for target, n in zip(steady, im.N, strict=True)]


def _rational(value: Fraction) -> sympy.Rational:
    return sympy.Rational(value.numerator, value.denominator)
