"""From a level to gains: ``K, δ, T, h1, h2, h3, h`` with directed rounding (docs/certificate.md section 4; F7–F10
corrected)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import ctx

from certify.agent_model import AgentModel, LyapunovMatrices, Row, euclidean_norm, quadratic_form_bound, row_sum_norm
from certify.bounds.balls import PRECISION, to_arb, upper
from certify.bounds.rationals import round_down, round_up, sqrt_up
from certify.inequalities.matrices import inverse
from certify.recipe.constants import Constants, gain_K_threshold
from certify.recipe.levels import Level

GAIN_BITS = 8
GENEROSITY = Fraction(2)
OBSERVER_GENEROSITY = Fraction(9, 8)


@dataclass(frozen=True)
class StateFeedback:
    """``Ẇ ≤ −a_z|z̄|² − a_x|x̂|² − a_η|η̃|² − a_ϑϑ² + ς10ỹ² + ς11(ẏ^r)²`` on the level set (blocks that are absent
    are ``None``)."""

    K: Fraction
    a_z: Fraction | None
    a_x: Fraction | None
    a_eta: Fraction | None
    a_vartheta: Fraction

    @property
    def smallest(self) -> Fraction:
        """The paper's ``a``."""
        return min(a for a in (self.a_z, self.a_x, self.a_eta, self.a_vartheta) if a is not None)


@dataclass(frozen=True)
class OutputFeedback:
    """Saturation level, the length ``T`` of the peaking phase, and the three thresholds of the observer gain."""

    delta: Fraction
    T: Fraction | None
    h1: Fraction | None
    h2: Fraction | None
    h3: Fraction | None
    h: Fraction | None
    rate: Fraction


def state_feedback(
    model: AgentModel, matrices: LyapunovMatrices, level: Level, K: Fraction | None
) -> StateFeedback | str:
    """The dissipation of every block for this ``K`` (twice the threshold if it is free), or the block that fails."""
    found = level.found
    threshold = gain_K_threshold(found)
    gain = K if K is not None else round_up(GENEROSITY * threshold, GAIN_BITS)
    norms, a0 = found.norms, matrices.a0
    eta, theta = found.weight_eta, found.weight_vartheta
    scale = 12 / found.b.lo**2
    ideal = scale * norms.P2N**2
    a_z = a0 / 2 - ideal * found.f_z**2 / eta - 2 * found.f_z**2 / theta if matrices.V0 else None
    a_x = None
    coupling = (found.varsigma[1] * found.varsigma[2]) ** 2 / a0 if matrices.V0 else Fraction(0)
    if model.order > 1:
        a_x = found.g - 2 - coupling - ideal * found.f_x**2 / eta - 2 * found.f_x**2 / theta
    a_eta = 1 / (2 * eta) - found.varsigma[6] / theta if model.internal_model.order else None
    own = row_sum_norm(matrices.P1) ** 2 if model.order > 1 else coupling
    own += (
        scale * (norms.P2MN + norms.P2N * found.f_vartheta) ** 2 / eta
        + 2 * (found.f_vartheta + norms.psi_N) ** 2 / theta
    )
    a_vartheta = (found.b.lo * gain - 1) / theta - own
    result = StateFeedback(gain, _down(a_z), _down(a_x), _down(a_eta), round_down(a_vartheta))
    for name, value in (("a_z", result.a_z), ("a_x", result.a_x), ("a_η", result.a_eta), ("a_ϑ", result.a_vartheta)):
        if value is not None and value <= 0:
            return f"{name} is not positive (K = {float(gain):.4g}, the threshold is {float(threshold):.4g})"
    return result


def output_feedback(
    model: AgentModel,
    matrices: LyapunovMatrices,
    level: Level,
    feedback: StateFeedback,
    delta: Fraction | None,
    h: Fraction | None,
) -> OutputFeedback | str:
    """``δ`` and ``h`` (the least that the proof gives, if free), or the obligation that fails."""
    found, K = level.found, feedback.K
    if model.order == 1:
        needed = K * found.sublevel.vartheta
        chosen = delta if delta is not None else round_up(needed, GAIN_BITS)
        if chosen < needed:
            return _too_small("δ", chosen, needed)
        return OutputFeedback(chosen, None, None, None, None, None, _rate(matrices, found, feedback, None))
    dual = inverse(matrices.P3)
    e2 = (*model.gamma, Fraction(1))
    needed = K * (found.sublevel.vartheta + sqrt_up(level.slack / 2 * quadratic_form_bound(_absolute(dual), e2)))
    delta = delta if delta is not None else round_up(needed, GAIN_BITS)
    if delta < needed:
        return _too_small("δ", delta, needed)
    observer = _Observer(model, matrices, level, feedback, delta)
    h1, h2, h3 = observer.h1(), observer.h2(), observer.h3()
    least = max(h1, h2, h3, found.g)
    chosen = h if h is not None else round_up(OBSERVER_GENEROSITY * least, GAIN_BITS)
    if chosen < least:
        return _too_small("h", chosen, least)
    return OutputFeedback(
        delta, observer.T, h1, h2, h3, chosen, _rate(matrices, found, feedback, observer.dissipation(chosen))
    )


class _Observer:
    """The quantities of docs/certificate.md section 4 for one agent with ``n ≥ 2``."""

    def __init__(
        self, model: AgentModel, matrices: LyapunovMatrices, level: Level, feedback: StateFeedback, delta: Fraction
    ) -> None:
        found, K, b = level.found, feedback.K, level.found.b
        self.model, self.matrices, self.level, self.feedback = model, matrices, level, feedback
        box = model.box(found.sublevel, found.g)
        self.f_z = model.zero_slope(box)
        self.f_x = model.chain_slope(box, found.g, with_design=False)
        self.f_n = model.last_slope(box)
        self.largest = row_sum_norm(matrices.P3)
        self.p3 = euclidean_norm([row[-1] for row in matrices.P3])
        self.e2 = euclidean_norm([*model.gamma, Fraction(1)])
        vartheta = found.sublevel.vartheta
        delta1 = b.hi / found.weight_vartheta * vartheta * (delta + K * vartheta)
        self.T = round_down(level.slack / (4 * delta1))
        speed = self.f_z * euclidean_norm(found.sublevel.z) + self.f_x * euclidean_norm(found.sublevel.x_hat)
        speed += self.f_n * vartheta + found.f_reference * model.references.peak
        speed += b.hi * (delta + found.norms.psi * euclidean_norm(found.sublevel.eta)) + found.norms.psi_N * vartheta
        self.speed = round_up(speed)
        self.mix = round_up((b.hi * K * self.e2 / found.weight_vartheta) ** 2 / (2 * feedback.a_vartheta))

    def h1(self) -> Fraction:
        """``4λ_M p3² X2²/h² ≤ ϵ/4``."""
        return sqrt_up(16 * self.largest * (self.p3 * self.speed) ** 2 / self.level.slack)

    def initial_error(self, h: Fraction) -> Fraction:
        """``We(0)`` is at most this; a polynomial in ``h``."""
        n = self.model.order
        errors = [h ** (n - k) * size for k, size in enumerate(_initial_estimation_error(self.model), start=1)]
        return quadratic_form_bound(self.matrices.P3, errors)

    def h2(self) -> Fraction:
        """The least ``h`` found with ``e^(−hT/(2λ_M)) We(0) ≤ ϵ/4`` from there on, by the iteration
        ``h ← (2λ_M/T) ln(4We(0)/ϵ)``."""
        scale = 2 * self.largest / self.T
        h = max(self.level.found.g, 4 * self.model.order * scale)
        for _ in range(64):
            following = max(h, round_up(scale * self._logarithm(4 * self.initial_error(h) / self.level.slack), bits=24))
            if following == h:
                break
            h = following
        return h

    @staticmethod
    def _logarithm(value: Fraction) -> Fraction:
        if value <= 1:
            return Fraction(0)
        with ctx.workprec(PRECISION):
            return upper(to_arb(value).log())

    def _demands(self) -> list[tuple[Fraction, Fraction]]:
        """Pairs ``(a, F²)`` of ``a > β F²``."""
        b, found, feedback = self.level.found.b, self.level.found, self.feedback
        pairs = [
            (feedback.a_z, self.f_z),
            (feedback.a_x, self.f_x),
            (feedback.a_eta, b.hi * found.norms.psi),
            (feedback.a_vartheta / 2, self.f_n + b.hi * feedback.K + found.norms.psi_N),
        ]
        return [(a, f**2) for a, f in pairs if a is not None]

    def h3(self) -> Fraction:
        """All conditions of the phase without saturation hold from here on."""
        strength = 12 * self.p3**2
        candidates = [Fraction(1)]
        candidates += [2 * strength * square / a for a, square in self._demands()]
        candidates.append(4 * self.mix)
        own = (self.level.found.b.hi * self.feedback.K * self.e2) ** 2
        candidates.append(sqrt_up(8 * strength * own))
        candidates.append(
            8 * strength * self.level.found.f_reference**2 * self.model.references.energy / self.level.slack
        )
        return round_up(max(candidates))

    def dissipation(self, h: Fraction) -> dict[str, Fraction]:
        """What is left of every block's dissipation at this ``h``; the error's is per ``‖e‖²``."""
        beta = 12 * self.p3**2 / h
        names = [
            n
            for n, a in (("z", self.feedback.a_z), ("x", self.feedback.a_x), ("eta", self.feedback.a_eta))
            if a is not None
        ]
        left = {
            name: a - beta * square for name, (a, square) in zip([*names, "vartheta"], self._demands(), strict=True)
        }
        own = (self.level.found.b.hi * self.feedback.K * self.e2) ** 2
        left["e"] = h / 2 - beta * own - self.mix
        return left


def _initial_estimation_error(model: AgentModel) -> Row:
    """Magnitudes of ``x_k(0) − x̃_k(0)``."""
    x, observer = model.agent.initial.x, model.agent.initial.observer
    if observer is None:
        return (Fraction(0), *(side.magnitude for side in x[1:]))
    return tuple(max(abs(a.hi - o.lo), abs(a.lo - o.hi)) for a, o in zip(x, observer, strict=True))


def _rate(
    matrices: LyapunovMatrices, found: Constants, feedback: StateFeedback, left: dict[str, Fraction] | None
) -> Fraction:
    """A proved rate of ``‖(X, e)‖ ~ e^(−rate t)`` once the references stand still: half the least dissipation over
    weight."""
    left = left or {
        name: a
        for name, a in (
            ("z", feedback.a_z),
            ("x", feedback.a_x),
            ("eta", feedback.a_eta),
            ("vartheta", feedback.a_vartheta),
        )
        if a is not None
    }
    weights = {
        "z": row_sum_norm(matrices.V0),
        "x": row_sum_norm(matrices.P1),
        "eta": row_sum_norm(matrices.P2) / found.weight_eta,
        "vartheta": 1 / (2 * found.weight_vartheta),
        "e": row_sum_norm(matrices.P3),
    }
    return round_down(min(left[name] / weights[name] for name in left) / 2, bits=24)


def _absolute(matrix: tuple[Row, ...]) -> tuple[Row, ...]:
    return tuple(tuple(abs(entry) for entry in row) for row in matrix)


def _down(value: Fraction | None) -> Fraction | None:
    return None if value is None else round_down(value)


def _too_small(name: str, value: Fraction, needed: Fraction) -> str:
    return f"{name} = {_short(value)} is below the threshold {_short(needed)} of this proof"


def _short(value: Fraction) -> str:
    with ctx.workprec(PRECISION):
        return to_arb(value).str(6, radius=False)
