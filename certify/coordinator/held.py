"""A coordinator that waits for its mixing layer: gains, structured norm, nominal curve (docs/coordinator.md).

Everything is proposed in floats and rounded; the rule of the checker then says what has been proved, and its envelope
is the one that the agents are searched with: what is promised here is what is checked there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import accumulate
from math import log2, sqrt

import numpy as np
import sympy

from certify.bounds.float_values import float_function
from certify.bounds.rationals import round_up, sqrt_up
from certify.certificate import Json, number, numbers
from certify.checker.certificate import HeldWitness
from certify.coordinator.collocation import Array, Collocation, Motion, Piece, stacked, walk
from certify.coordinator.envelope import Envelope
from certify.coordinator.gains import CoordinatorGains
from certify.coordinator.proved import proved_envelope
from certify.coordinator.stability import Unstable
from certify.coordinator.structured import StructuredNorm, System, structured_norm
from symbolic.plant import COST_VARIABLE, Interval, Plant

# α1 = k1 C/|λ2(L)|, α2 = k2 C: the rate, the energy and what can be proved improve with k1, the messages get faster
PAIRS = ((3, 1), (10, 1), (30, 1), (100, 3), (300, 3), (1000, 3))
LARGE = ((100, 3), (300, 3), (1000, 3), (30, 1), (10, 1))  # in this order where a trial takes seconds
LEAST_K1 = 3
MANY_AGENTS = 12
ABOUT = 1.1  # the slowest messages whose references cost about as little as any
NOT_FELT = 1e-2  # of C times the squares of the outputs at the start: references that move less are at rest
SLOW = 0.25  # of C: a slower spectrum is another coordinator than the one that was asked for
MIXED_BITS = 40  # ξ_i^i is within 2^−40 of r_i when the references start
HOLD = 0.5  # of 1/C: how long the references wait
GAIN_BITS = 3
DEVIATION_SHARE, RATE_SHARE = 3e-3, 2e-2  # of the peaks: what the proof may add to |y − s*| and |dy/dt|
SETTLED = 2.0**-11  # of the scale: where the curve ends and the tail begins
RATE_SETTLED = 2.0**-6  # of the scale times C: the tail's speed is paid at the rate of the messages
SHORTENINGS = 5  # halvings of how far the references move in a stretch: each is worth a factor of a hundred
LOOSE = 1.1  # of the peak of |dy/dt|: what the proof may add before shorter stretches are tried
UNIT_BITS = 58  # of the curve's coefficients below its scale; floats have 53
QUADRATURE = 16  # exact for the squares of polynomials of degree 12
LONGEST = 200  # time constants: a curve that has not settled by then does not


@dataclass(frozen=True)
class HeldDesign:
    """What was proved, and what it was proved with."""

    gains: CoordinatorGains
    r: tuple[Fraction, ...]
    rate: Fraction
    reach: tuple[Fraction, ...]
    rate_gains: tuple[Fraction, ...]
    witness: Json
    envelope: Envelope


@dataclass(frozen=True)
class Trial:
    """One pair ``α1, α2`` in floats."""

    gains: CoordinatorGains
    system: System
    norm: StructuredNorm
    pieces: tuple[Piece, ...]
    energy: float


@dataclass(frozen=True)
class Problem:
    """The network in floats; ``radii`` are the half-widths of the boxes of ``y^r(0)`` around ``start``."""

    plant: Plant
    laplacian: Array
    r: Array
    exact_r: tuple[Fraction, ...]
    curvatures: tuple[Interval, ...]
    gradients: tuple[Interval, ...]
    optimum: Interval
    start: Array
    radii: Array
    slopes: tuple[Callable[[Array], Array], ...]
    bends: tuple[Callable[[Array], Array], ...]

    @property
    def consensus_rate(self) -> float:
        """``|λ2(L)|``: the least real part of the other eigenvalues."""
        values = np.linalg.eigvals(self.laplacian)
        return float(np.min(np.delete(values.real, np.argmin(np.abs(values)))) if len(values) > 1 else 1.0)

    @property
    def mixing_rate(self) -> float:
        """The largest ``λ̂`` with ``Rm L + LᵀRm ⪰ 2λ̂ Rm`` where ``rᵀx = 0``."""
        root = np.sqrt(self.r)
        scaled = root[:, None] * self.laplacian / root[None, :]
        basis = np.linalg.svd(root[None, :])[2][1:].T
        flow = basis.T @ (scaled + scaled.T) @ basis
        return float(np.linalg.eigvalsh(flow)[0]) / 2 if flow.size else 1.0


def design_held(
    plant: Plant,
    r: tuple[Fraction, ...],
    laplacian: Sequence[Sequence[Fraction]],
    optimum: Interval,
    gradients: Sequence[Interval],
    curvatures: Sequence[Interval],
    pace: float,
    report: Callable[[str], None],
) -> HeldDesign | Unstable:
    """The slowest messages among those whose references move about least; ``pace`` is the rate wanted of them."""
    problem = _problem(plant, r, laplacian, optimum, gradients, curvatures)
    tried: list[str] = []
    trials: list[Trial] = []
    for k1, k2 in PAIRS if len(r) <= MANY_AGENTS else LARGE:
        gains = choose_gains(problem, pace, k1, k2)
        if isinstance(gains, Unstable):
            return gains
        if any(trial.gains == gains for trial in trials):
            continue
        report(f"coordinator: α1 = {gains.alpha1}, α2 = {gains.alpha2}")
        trial = attempt(problem, gains)
        if isinstance(trial, Trial):
            trials.append(trial)
            if len(r) > MANY_AGENTS:
                break
        else:
            tried.append(f"({gains.alpha1}, {gains.alpha2}): {trial}")
    reasons = list(dict.fromkeys(tried))
    for trial in _in_order(problem, trials):
        proved = prove(problem, trial)
        if isinstance(proved, HeldDesign):
            return proved
        reasons.append(f"({trial.gains.alpha1}, {trial.gains.alpha2}): {proved}")
    return Unstable("no pair α1, α2 was proved; tried " + "; ".join(reasons), len(reasons))


def propose_gains(
    plant: Plant, r: tuple[Fraction, ...], laplacian: Sequence[Sequence[Fraction]], pace: float
) -> CoordinatorGains | Unstable:
    """Constants for a simulation without a certificate: the usual pair, with the curvatures at the origin."""
    here = Interval(Fraction(0), Fraction(0))
    problem = _problem(plant, r, laplacian, here, [here] * len(r), [])
    bends = [float(bend(np.zeros(1))[0]) for bend in problem.bends]
    usable = [bend if np.isfinite(bend) and bend > 0 else 1.0 for bend in bends]
    curvatures = tuple(Interval(Fraction(bend), Fraction(bend)) for bend in usable)
    return choose_gains(replace(problem, curvatures=curvatures), pace, *LARGE[0])


def choose_gains(problem: Problem, pace: float, k1: float, k2: float) -> CoordinatorGains | Unstable:
    """What the plant file leaves open, at ``α1 = k1 C/|λ2|``, ``α2 = k2 C``; short numbers, whatever the units."""
    choice = problem.plant.coordinator
    bend = sum(float(side.lo + side.hi) / 2 for side in problem.curvatures)
    if choice.alpha1:  # given α are for references that they can lead
        pace = min(pace, float(choice.alpha1) * problem.consensus_rate / LEAST_K1)
    if choice.alpha2:
        pace = min(pace, float(choice.alpha2))
    kappa = choice.gradient_gain or _power_of_two(pace / bend)
    C = float(kappa) * bend
    point = not np.any(problem.radii)
    softening = choice.softening if choice.softening is not None else (_short(C) if point else Fraction(0))
    needed = float(np.log(2.0**MIXED_BITS / np.min(problem.r))) / (problem.mixing_rate * (1 - 2.0**-8))
    hold = float(choice.mixing_time) if choice.mixing_time else HOLD / C
    beta = choice.mixing_gain or _short_up(needed / hold)
    mixing_time = choice.mixing_time or _short_up(needed / float(beta))
    if float(beta * mixing_time) * 2 < needed:
        least = needed / float(beta)
        return Unstable(f"mixing_time = {mixing_time} is too short for the mixing layer: it needs {least:.4g}", 0)
    return CoordinatorGains(
        choice.alpha1 or _short(k1 * C / problem.consensus_rate),
        choice.alpha2 or _short(k2 * C),
        kappa,
        beta,
        mixing_time,
        softening,
    )


def attempt(problem: Problem, gains: CoordinatorGains) -> Trial | str:
    """Spectrum, norm and curve of one choice, or what is in the way."""
    kappa, r = float(gains.gradient_gain), problem.r
    low, high = (
        np.array([float(end) for end in ends]) for ends in zip(*((c.lo, c.hi) for c in problem.curvatures), strict=True)
    )
    room = 2.0**-30  # of the damping, for ξ that is not quite r
    system = System(
        problem.laplacian,
        r,
        kappa * low / r * (1 - room),
        kappa * high / r * (1 + room),
        float(gains.alpha1),
        float(gains.alpha2),
    )
    slowest = system.slowest() if len(r) > 1 else system.pace
    if not slowest > SLOW * system.pace:
        return f"the spectrum decays at {slowest:.3g} only, where {system.pace:.3g} is asked for"
    norm = structured_norm(system, bool(np.any(problem.radii)))
    if norm is None:
        return "no structured norm decays for all slopes of the costs"
    pieces = _curve(problem, gains, system, norm)
    if pieces is None:
        return "the nominal curve could not be followed until it settles"
    reach = _rate_gains(system, norm)
    start = float(np.sqrt(r @ problem.radii**2))
    energy = sum(_rate_energy(piece) for piece in pieces) + float(np.sum(reach**2)) * start**2 / (2 * float(norm.rate))
    return Trial(gains, system, norm, tuple(pieces), energy)


def prove(problem: Problem, trial: Trial) -> HeldDesign | str:
    """The rule of the checker on the rounded witness, and the envelope that it proves. Where the curve is bent by costs
    that are not quadratic, the checker's Taylor polynomials want shorter stretches than the collocation."""
    best: HeldDesign | None = None
    for _ in range(SHORTENINGS):
        witness, norm = _witness(problem, trial), trial.norm
        proved = proved_envelope(problem.plant, trial.gains, witness, problem.exact_r, problem.optimum)
        if isinstance(proved, str):
            return proved if best is None else best
        blocks = zip(problem.exact_r, norm.B, strict=True)
        reach = tuple(sqrt_up(norm.c / (r * (norm.c - b**2))) for r, b in blocks)
        rates = tuple(round_up(Fraction(float(rate))) for rate in _rate_gains(trial.system, norm))
        found = HeldDesign(trial.gains, problem.exact_r, witness.rate, reach, rates, _json(witness), proved)
        best = found if best is None or _looseness(problem, trial, found) < _looseness(problem, trial, best) else best
        if all(side.lo == side.hi for side in problem.curvatures) or _looseness(problem, trial, best) <= LOOSE:
            return best
        spread = max(piece.spread for piece in trial.pieces) / 2
        pieces = _curve(problem, trial.gains, trial.system, norm, spread)
        if pieces is None:
            break
        trial = replace(trial, pieces=tuple(pieces))
    return best or "the nominal curve could not be followed in short stretches"


def _looseness(problem: Problem, trial: Trial, found: HeldDesign) -> float:
    """The largest ratio of what is proved of ``|dy/dt|`` to that of the curve, over all stretches, less what the norm
    takes of a box of starts."""
    box = float(np.sqrt(problem.r @ problem.radii**2))
    gains, worst = _rate_gains(trial.system, trial.norm), 0.0
    for i, agent in enumerate(found.envelope.agents):
        curve = max(float(np.max(np.abs(_slopes(piece, i)))) for piece in trial.pieces)
        proved = float(agent.rate_peak) - gains[i] * box
        worst = max(worst, proved / curve if curve > 0 else 1.0)
    return worst


def _slopes(piece: Piece, agent: int) -> Array:
    derivative = np.polynomial.chebyshev.chebder(piece.coefficients[agent]) * 2 / piece.length
    return np.asarray(np.polynomial.chebyshev.chebval(np.linspace(-1, 1, QUADRATURE), derivative))


def _problem(
    plant: Plant,
    r: tuple[Fraction, ...],
    laplacian: Sequence[Sequence[Fraction]],
    optimum: Interval,
    gradients: Sequence[Interval],
    curvatures: Sequence[Interval],
) -> Problem:
    boxes = [agent.initial.reference for agent in plant.agents]
    first = [sympy.diff(agent.cost, COST_VARIABLE) for agent in plant.agents]
    return Problem(
        plant,
        np.array([[float(entry) for entry in row] for row in laplacian]),
        np.array([float(weight) for weight in r]),
        r,
        tuple(curvatures),
        tuple(gradients),
        optimum,
        np.array([float((box.lo + box.hi) / 2) for box in boxes]),
        np.array([float((box.hi - box.lo) / 2) for box in boxes]),
        tuple(float_function(slope, COST_VARIABLE) for slope in first),
        tuple(float_function(sympy.diff(slope, COST_VARIABLE), COST_VARIABLE) for slope in first),
    )


def _curve(
    problem: Problem, gains: CoordinatorGains, system: System, norm: StructuredNorm, most_spread: float = np.inf
) -> list[Piece] | None:
    """The nominal curve until it has settled at the optimum."""
    kappa, r = float(gains.gradient_gain), problem.r
    motion = Motion(
        system,
        _times(stacked(problem.slopes), kappa / r),
        _times(stacked(problem.bends), kappa / r),
        float(gains.softening),
    )
    target = float((problem.optimum.lo + problem.optimum.hi) / 2)
    slope = np.array([float((side.lo + side.hi) / 2) for side in problem.gradients])
    rest: Array = -kappa * slope / (float(gains.alpha2) * r)  # ζ̄
    scale = _scale(problem, system, target, rest)
    rate, pace = float(norm.rate), system.pace
    reach = np.sqrt(norm.reach / r)
    fastest_rate = float(np.max(_rate_gains(system, norm)))
    allowed = min(
        DEVIATION_SHARE * scale / float(np.max(reach)),
        RATE_SHARE * pace * scale / fastest_rate,
    )
    B, c = np.array([float(b) for b in norm.B]), float(norm.c)
    first = motion.gradient(problem.start)
    softened = 8 * float(np.sqrt(r @ first**2)) / rate if gains.softening else 0.0
    base = 2.0 ** -round(log2(pace))

    def done(at: Collocation) -> bool:
        y, zeta = at.y - target, at.zeta() - rest
        gap = sqrt(max(float(r @ (y**2 + 2 * B * y * zeta + c * zeta**2)), 0.0))
        gap += softened * float(np.exp(-float(gains.softening) * at.time))
        settled = gap * float(np.max(reach)) <= SETTLED * scale and gap * fastest_rate <= RATE_SETTLED * pace * scale
        return (settled and at.time > 0) or at.time > LONGEST / pace  # a curve has at least one stretch

    return walk(motion, problem.start, scale, base, rate * allowed, done, most_spread)


def _scale(problem: Problem, system: System, target: float, rest: Array) -> float:
    """What the outputs move by: the way to the optimum, the boxes, what integral action makes of the gradients."""
    way = float(np.max(np.abs(problem.start - target) + problem.radii))
    fastest = system.alpha1 * float(np.max(np.diag(system.laplacian))) + system.pace
    push = float(np.max(np.abs(rest))) * system.alpha2 / fastest
    return max(way, push) or abs(target) or 1.0


def _rate_gains(system: System, norm: StructuredNorm) -> Array:
    """``ν_i``: ``|a e| ≤ ν_i ‖e‖_P`` for row ``i`` of ``A``, with the larger end of the damping."""
    B, c = np.array([float(b) for b in norm.B]), float(norm.c)
    weight = 1 / (system.r * (c - B**2))
    rows = -system.alpha1 * system.laplacian - np.diag(system.high)
    own = np.diag(rows)
    form = (rows**2) @ (c * weight) + weight * (2 * B * own * system.alpha2 + system.alpha2**2)
    return np.sqrt(np.maximum(form, 0.0))


def _rate_energy(piece: Piece) -> float:
    """``∫ |dy/dt|²`` over the piece."""
    derivative = np.polynomial.chebyshev.chebder(piece.coefficients.T)
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    slopes = np.polynomial.chebyshev.chebval(nodes, derivative) * 2 / piece.length
    return float(np.sum((slopes**2) @ weights) * piece.length / 2)


def _in_order(problem: Problem, trials: Sequence[Trial]) -> list[Trial]:
    """First the slowest messages that are about as good as the best, then by energy."""
    if not trials:
        return []
    least = min(trial.energy for trial in trials)
    starts = [agent.initial.x[0].magnitude for agent in problem.plant.agents]
    felt = NOT_FELT * trials[0].system.pace * float(sum(start**2 for start in starts))
    good = [trial for trial in trials if trial.energy <= ABOUT * least + felt]
    first = min(good, key=lambda trial: trial.gains.alpha1)
    return [first, *sorted((trial for trial in trials if trial is not first), key=lambda trial: trial.energy)]


def _witness(problem: Problem, trial: Trial) -> HeldWitness:
    largest = max(float(np.max(np.abs(piece.coefficients))) for piece in trial.pieces)
    exponent = int(np.floor(np.log2(largest or 1.0))) - UNIT_BITS
    unit = Fraction(2) ** exponent
    lengths = [Fraction(piece.length) for piece in trial.pieces]
    times = tuple(accumulate([trial.gains.mixing_time, *lengths]))
    curve = tuple(tuple(map(_integers(exponent), piece.coefficients)) for piece in trial.pieces)
    norm = trial.norm
    mixing = Fraction(problem.mixing_rate * (1 - 2.0**-8))
    return HeldWitness(norm.B, norm.c, norm.rate, _short_down(mixing), norm.shift, unit, times, curve)


def _integers(exponent: int) -> Callable[[Array], tuple[int, ...]]:
    def rounded(row: Array) -> tuple[int, ...]:
        found = [int(value) for value in np.rint(np.ldexp(row, -exponent)).tolist()]
        while len(found) > 1 and not found[-1]:
            found.pop()
        return tuple(found)

    return rounded


def _json(witness: HeldWitness) -> Json:
    return {
        "B": numbers(witness.B),
        "c": number(witness.c),
        "rate": number(witness.rate),
        "mixing_rate": number(witness.mixing_rate),
        "shift": number(witness.shift),
        "unit": number(witness.unit),
        "times": numbers(witness.times),
        "curve": [[[str(entry) for entry in row] for row in step] for step in witness.curve],
    }


def _times(function: Callable[[Array], Array], factor: Array) -> Callable[[Array], Array]:
    return lambda y: function(y) * factor


def _power_of_two(value: float) -> Fraction:
    return Fraction(2) ** round(float(np.log2(value)))


def _short(value: float) -> Fraction:
    mantissa, exponent = np.frexp(value)
    return Fraction(round(float(mantissa) * 2**GAIN_BITS)) * Fraction(2) ** (int(exponent) - GAIN_BITS)


def _short_up(value: float) -> Fraction:
    mantissa, exponent = np.frexp(value)
    return Fraction(int(np.ceil(float(mantissa) * 2**GAIN_BITS))) * Fraction(2) ** (int(exponent) - GAIN_BITS)


def _short_down(value: Fraction) -> Fraction:
    mantissa, exponent = np.frexp(float(value))
    return Fraction(int(np.floor(float(mantissa) * 2**16))) * Fraction(2) ** (int(exponent) - 16)
