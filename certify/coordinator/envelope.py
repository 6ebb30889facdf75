"""How far the references are from the optimum, proved for all time (docs/certificate.md section 2, deviation, tail,
outputs)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from flint import arb, arb_mat, arb_poly, ctx

from certify.bounds.balls import PRECISION, lower, to_arb, upper
from certify.bounds.rationals import round_up
from certify.coordinator.mixing import Mixing, Rows
from certify.coordinator.nominal import CoordinatorModel, Segment, nominal_trajectory
from symbolic.plant import Interval

REPORT_BITS = 48


@dataclass(frozen=True)
class Comparison:
    """The Lyapunov matrix of the coordinator and what it was proved for.

    ``d/dt ‖e‖_P ≤ −rate ‖e‖_P + ‖ρ‖_P`` for ``e' = A(D(t)) e + ρ`` with ``D_i`` in ``damping[i]``;
    ``Rm L + LᵀRm ⪰ 2 mixing_rate (Rm − r rᵀ)``; ``multiplier`` is the diagonal multiplier of the proof.
    """

    P: Rows
    multiplier: tuple[Fraction, ...]
    rate: Fraction
    mixing_rate: Fraction
    damping: tuple[Interval, ...]


@dataclass(frozen=True)
class AgentEnvelope:
    """Bounds for one agent: ``|y^r − s*| ≤ peak`` for ever, ``∫ (y^r − s*)² ≤ energy``, ``∫ (ẏ^r)² ≤ rate_energy``.

    ``reference[k]`` encloses ``y^r``, ``deviation[k] ≥ |y^r − s*|`` and ``rate[k] ≥ |ẏ^r|`` on ``[t_k, t_(k+1)]``;
    after the grid they decay from
    ``tail_deviation`` and ``tail_rate`` at the rate ``tail_decay`` of the whole envelope.
    """

    reference: tuple[Interval, ...]
    deviation: tuple[Fraction, ...]
    rate: tuple[Fraction, ...]
    tail_deviation: Fraction
    tail_rate: Fraction
    peak: Fraction
    rate_peak: Fraction
    energy: Fraction
    rate_energy: Fraction


@dataclass(frozen=True)
class Envelope:
    """The coordinator's envelope: one ``AgentEnvelope`` per agent on the grid ``times``, from 0 on, then an exponential
    tail."""

    times: tuple[Fraction, ...]
    tail_decay: Fraction
    agents: tuple[AgentEnvelope, ...]

    @property
    def horizon(self) -> Fraction:
        return self.times[-1]


def envelope(
    model: CoordinatorModel,
    mixing: Mixing,
    comparison: Comparison,
    optimum: Interval,
    optimal_gradients: Sequence[Interval],
    references: Sequence[Interval],
) -> Envelope:
    """Enclose the coordinator for every ``y^r(0)`` in ``references`` with ``ζ(0) = 0``, ``ξ_i(0) = e_i``.

    ``optimum`` encloses ``s*`` and ``optimal_gradients[i]`` encloses ``c_i'(s*)``.
    """
    start = [(box.lo + box.hi) / 2 for box in references]
    segments, y_end, omega_end = nominal_trajectory(model, mixing, start)
    with ctx.workprec(PRECISION):
        norm = _Norm(comparison.P, model.size)
        radius = [to_arb((box.hi - box.lo) / 2) for box in references]
        zero = [arb(0)] * (model.size - 1)
        deviations, end = _deviations(segments, norm, comparison.rate, mixing.step, norm([*radius, *zero]))
        forcing = _tail_forcing(model, mixing, optimal_gradients)
        target = to_arb(optimum)
        gap = [y - target for y in y_end] + [
            omega_end[i] + to_arb(optimal_gradients[i]) / (to_arb(model.alpha2) * to_arb(model.left_null_vector[i]))
            for i in range(model.size - 1)
        ]
        decay = min(comparison.rate, comparison.mixing_rate) / 2
        tail = end + norm([abs(x).upper() for x in gap]) + norm([*forcing, *zero]) / to_arb(comparison.rate - decay)
        agents = tuple(
            _agent(i, model, mixing, comparison, norm, segments, deviations, target, forcing[i], tail.upper(), decay)
            for i in range(model.size)
        )
    return Envelope(tuple(mixing.step * k for k in range(mixing.steps + 1)), decay, agents)


class _Norm:
    """``‖e‖_P`` of a vector of magnitudes, and the dual quantities of ``P⁻¹``."""

    def __init__(self, P: Rows, size: int) -> None:
        matrix = arb_mat([[to_arb(entry) for entry in row] for row in P])
        self.size = size
        self.magnitudes = [[abs(entry).upper() for entry in row] for row in matrix.tolist()]
        self.inverse = matrix.inv()

    def __call__(self, magnitudes: Sequence[arb]) -> arb:
        total = arb(0)
        for row, left in zip(self.magnitudes, magnitudes, strict=True):
            total += left * sum((p * right for p, right in zip(row, magnitudes, strict=True)), arb(0))
        return total.upper().sqrt().upper()

    def dual(self, row: Sequence[arb]) -> arb:
        """``√(a P⁻¹ aᵀ)``: ``|a e| ≤ dual(a) ‖e‖_P``."""
        a = arb_mat([list(row)])
        return (a * self.inverse * a.transpose())[0, 0].upper().sqrt().upper()


def norm_gains(model: CoordinatorModel, comparison: Comparison) -> tuple[tuple[Fraction, ...], tuple[Fraction, ...]]:
    """``κ_i`` and ``ν_i`` of every agent: ``|ỹ_i| ≤ κ_i ‖e‖_P``, ``|ẏ_i| ≤ ν_i ‖e‖_P``."""
    with ctx.workprec(PRECISION):
        norm, agents = _Norm(comparison.P, model.size), range(model.size)
        kappas = [norm.inverse[i, i].upper().sqrt().upper() for i in agents]
        nus = [max(norm.dual(_closed_loop_row(i, model, end)) for end in _ends(comparison.damping[i])) for i in agents]
    return tuple(map(_short, kappas)), tuple(map(_short, nus))


def _deviations(
    segments: Sequence[Segment], norm: _Norm, rate: Fraction, step: Fraction, initial: arb
) -> tuple[list[arb], arb]:
    """``W_k`` on every step, and the bound at the end of the grid."""
    decay = to_arb(rate)
    factor = (-decay * to_arb(step)).exp()
    bound, deviations = initial, []
    for segment in segments:
        level = norm(segment.defect) / decay
        deviations.append(max(bound.upper(), level.upper()))
        bound = (factor * bound + (1 - factor) * level).upper() + norm(segment.jump)
    return deviations, bound.upper()


def _tail_forcing(model: CoordinatorModel, mixing: Mixing, gradients: Sequence[Interval]) -> list[arb]:
    """``p̄_i``: ``|1/r_i − 1/ξ_i^i| |c_i'(s*)| ≤ p̄_i e^(−λ̂(t − T0))``."""
    return [
        (
            to_arb(gradients[i].magnitude)
            * mixing.residual[i]
            / (to_arb(model.left_null_vector[i]) * mixing.smallest[i])
        ).upper()
        for i in range(model.size)
    ]


def _agent(
    index: int,
    model: CoordinatorModel,
    mixing: Mixing,
    comparison: Comparison,
    norm: _Norm,
    segments: Sequence[Segment],
    deviations: Sequence[arb],
    target: arb,
    forcing: arb,
    tail: arb,
    decay: Fraction,
) -> AgentEnvelope:
    step = to_arb(mixing.step)
    kappa = norm.inverse[index, index].upper().sqrt().upper()
    nu = max(norm.dual(_closed_loop_row(index, model, end)) for end in _ends(comparison.damping[index]))
    ys, rates, references = [], [], []
    squares = rate_squares = arb(0)
    for segment, deviation in zip(segments, deviations, strict=True):
        poly = segment.reference[index]
        spread, drift = kappa * deviation, segment.defect[index] + nu * deviation
        rate = poly.derivative()
        (low, high), (least, most) = _extremes(poly, step), _extremes(rate, step)
        references.append(Interval(lower(low - spread), upper(high + spread)))
        ys.append((max((high - target).upper(), (target - low).upper()) + spread).upper())
        rates.append((max(-least, most) + drift).upper())
        squares += (_root_mean_square(poly - target, step) + spread) ** 2
        rate_squares += (_root_mean_square(rate, step) + drift) ** 2
    tail_y, tail_rate = (kappa * tail).upper(), (nu * tail + forcing).upper()
    lifetime = 1 / (2 * to_arb(decay))
    energy = step * squares + tail_y**2 * lifetime
    rate_energy = step * rate_squares + tail_rate**2 * lifetime
    return AgentEnvelope(
        reference=tuple(references),
        deviation=tuple(_short(y) for y in ys),
        rate=tuple(_short(z) for z in rates),
        tail_deviation=_short(tail_y),
        tail_rate=_short(tail_rate),
        peak=_short(max([*ys, tail_y])),
        rate_peak=_short(max([*rates, tail_rate])),
        energy=_short(energy),
        rate_energy=_short(rate_energy),
    )


def _extremes(poly: arb_poly, step: arb) -> tuple[arb, arb]:
    """Bounds of the polynomial on ``[0, step]``."""
    start, *rest = _scaled(poly, step)
    zero = arb(0)
    falls = sum((min(c.lower(), zero) for c in rest), zero)
    rises = sum((max(c.upper(), zero) for c in rest), zero)
    return (start + falls).lower(), (start + rises).upper()


def _root_mean_square(poly: arb_poly, step: arb) -> arb:
    """No less than the root of the mean square on ``[0, step]``: the terms up to the square exactly, others by size."""
    a, b, c, *rest = [*_scaled(poly, step), arb(0), arb(0), arb(0)]
    square = a * a + a * b + (b * b + 2 * a * c) / 3 + b * c / 2 + c * c / 5
    return (square.upper().sqrt() + sum((abs(entry) for entry in rest), arb(0))).upper()


def _scaled(poly: arb_poly, step: arb) -> list[arb]:
    """The coefficients in ``σ = τ/step``; one at least, also of the zero polynomial, which has none."""
    factor, result = arb(1), []
    for coefficient in poly.coeffs() or [arb(0)]:
        result.append(coefficient * factor)
        factor *= step
    return result


def _closed_loop_row(index: int, model: CoordinatorModel, damping: arb) -> list[arb]:
    """Row ``index`` of ``A(D) = [−α1 L − D, −α2 B]``."""
    consensus = [-to_arb(model.alpha1 * entry) for entry in model.laplacian[index]]
    consensus[index] -= damping
    return consensus + [-to_arb(model.alpha2 * entry) for entry in model.integral_basis()[index]]


def _ends(interval: Interval) -> tuple[arb, arb]:
    return to_arb(interval.lo), to_arb(interval.hi)


def _short(value: arb) -> Fraction:
    return round_up(upper(value), REPORT_BITS)
