"""Choose ``α1, α2`` (or take the user's) and enclose the coordinator they give (theory.md section 6.1, F13)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.bounds.balls import NonFiniteError
from certify.bounds.rationals import round_up
from certify.coordinator.envelope import Comparison, Envelope, envelope
from certify.coordinator.mixing import Mixing, mixing
from certify.coordinator.nominal import CoordinatorModel, CostGradient, cost_gradient
from certify.coordinator.resolution import FINE, Resolution
from certify.coordinator.stability import RATES, Unstable, damping_ranges, mixing_rate, stabilise
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import Interval, Plant

CANDIDATES = tuple((Fraction(a), Fraction(b)) for a, b in ((1, 1), (2, 1), (3, 2), (5, 5)))
ABOUT = Fraction(11, 10)
LARGEST_GRID = 4096
COARSE_GRID = 256


@dataclass(frozen=True)
class CoordinatorDesign:
    """The gains, what was proved about them, and the grid ``step × steps`` the proof was made on."""

    model: CoordinatorModel
    comparison: Comparison
    mixing: Mixing
    envelope: Envelope

    def weight(self, index: int, varsigma10: Fraction, varsigma11: Fraction) -> Fraction:
        """The paper's ``μ`` without its circle: ``μV``, ``V = ‖x‖_P²``, outweighs ``ς10 ỹ² + ς11 (ẏ^r)²`` of agent
        ``index``.

        ``μ λ0 V ≥ ς10 κ² V + 2 ς11 ν² V`` while ``V' ≤ −λ0 V + ‖p‖²/λ0``.
        """
        agent = self.envelope.agents[index]
        demand = varsigma10 * agent.deviation_gain**2 + 2 * varsigma11 * agent.rate_gain**2
        return round_up(demand / self.comparison.rate)


def design_coordinator(
    plant: Plant,
    optimum: Interval,
    optimal_gradients: Sequence[Interval],
    curvatures: Sequence[Interval],
    report: Callable[[str], None] = lambda message: None,
    resolution: Resolution = FINE,
) -> CoordinatorDesign | Unstable:
    """The pair given in the plant file, or the first candidate whose references move about least, by ``Σ ∫ (ẏ^r)²``;
    proved stable.

    ``curvatures[i]`` encloses ``c_i''`` on the whole line and ``optimal_gradients[i]`` encloses ``c_i'(s*)``.
    """
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    costs = tuple(cost_gradient(agent.cost) for agent in plant.agents)
    references = [agent.initial.reference for agent in plant.agents]
    horizon = resolution.lifetimes / mixing_rate(L, r)

    def attempt(alpha: tuple[Fraction, Fraction], limit: int) -> CoordinatorDesign | Unstable:
        model = CoordinatorModel(L, r, alpha[0], alpha[1], costs)
        step, steps = _grid(model, curvatures, horizon, limit, resolution.step)
        grid = mixing(L, r, step, steps)
        if not all(low > 0 for low in grid.smallest):
            return Unstable(f"ξ is not bounded away from zero on a grid of {steps} steps", 0)
        comparison = stabilise(model, damping_ranges(grid, curvatures), RATES)
        if isinstance(comparison, Unstable):
            return comparison
        try:
            found = envelope(model, grid, comparison, optimum, optimal_gradients, references)
        except NonFiniteError:
            return Unstable(f"c'' could not be enclosed along a trajectory on steps of {step} s", 0)
        return CoordinatorDesign(model, comparison, grid, found)

    pairs = _pairs(plant)
    if len(pairs) == 1:
        return attempt(pairs[0], LARGEST_GRID)
    rough: list[CoordinatorDesign] = []
    for pair in pairs:
        report(f"coordinator: α1 = {pair[0]}, α2 = {pair[1]}")
        result = attempt(pair, COARSE_GRID)
        if isinstance(result, CoordinatorDesign):
            rough.append(result)
    if not rough:
        return Unstable(
            "no pair α1, α2 was proved stable; tried " + ", ".join(f"({a}, {b})" for a, b in pairs), len(pairs)
        )
    energies = [sum((agent.rate_energy for agent in design.envelope.agents), Fraction(0)) for design in rough]
    best = next(design for design, energy in zip(rough, energies, strict=True) if energy <= ABOUT * min(energies))
    if best.mixing.step == _grid(best.model, curvatures, horizon, LARGEST_GRID, resolution.step)[0]:
        return best
    return attempt((best.model.alpha1, best.model.alpha2), LARGEST_GRID)


def _pairs(plant: Plant) -> tuple[tuple[Fraction, Fraction], ...]:
    chosen = [(plant.coordinator.alpha1 or a, plant.coordinator.alpha2 or b) for a, b in CANDIDATES]
    return tuple(dict.fromkeys(chosen))


def _grid(
    model: CoordinatorModel, curvatures: Sequence[Interval], horizon: Fraction, limit: int, largest: Fraction
) -> tuple[Fraction, int]:
    """A dyadic step that resolves the fastest rate of the coordinator, and with ``‖L step‖ ≤ 1``, unless ``limit``
    steps do not suffice for the horizon."""
    degree = max(row[i] for i, row in enumerate(model.laplacian))
    damping = max(curvature.hi / r for curvature, r in zip(curvatures, model.left_null_vector, strict=True))
    fastest = 2 * max(model.alpha1, Fraction(1)) * degree + damping
    step = Fraction(1)
    while step * max(fastest / largest, 2 * degree) > 1:
        step /= 2
    while horizon / step > limit:
        step *= 2
    return step, int(horizon / step) + 1


def gradients_at(costs: Sequence[CostGradient], optimum: Interval) -> tuple[Interval, ...]:
    """Enclosures of ``c_i'(s*)``."""
    return tuple(cost.gradient.enclose([optimum]) for cost in costs)
