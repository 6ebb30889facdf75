"""The coordinator that starts at once, as the paper prints it: pair ``α1, α2``, norm, envelope (docs/certificate.md
section 2). ``κ`` and ``β`` scale the costs and the mixing layer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import log2

import sympy

from certify.bounds.balls import NonFiniteError
from certify.certificate import Json, number, numbers, rows
from certify.coordinator.envelope import Comparison, Envelope, envelope
from certify.coordinator.mixing import Mixing, mixing
from certify.coordinator.nominal import CoordinatorModel, cost_gradient
from certify.coordinator.resolution import FINE, Resolution
from certify.coordinator.stability import RATES, Unstable, damping_ranges, mixing_rate, stabilise
from symbolic.controller import CoordinatorGains
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import Interval, Plant

CANDIDATES = tuple((Fraction(a), Fraction(b)) for a, b in ((1, 1), (2, 1), (3, 2), (5, 5)))
ABOUT = Fraction(11, 10)  # of the least energy of the references: the slowest pair of these
LARGEST_GRID = 4096
COARSE_GRID = 256  # to compare pairs


@dataclass(frozen=True)
class PrintedDesign:
    """The gains, what was proved about them, and the grid that the proof was made on."""

    gains: CoordinatorGains
    model: CoordinatorModel
    comparison: Comparison
    mixing: Mixing
    envelope: Envelope

    def witness(self) -> Json:
        """``PrintedWitness`` of the certificate."""
        return {
            "P": rows(self.comparison.P),
            "multiplier": numbers(self.comparison.multiplier),
            "rate": number(self.comparison.rate),
            "mixing_rate": number(self.comparison.mixing_rate),
            "step": number(self.mixing.step),
            "steps": number(self.mixing.steps),
        }


def design_printed(
    plant: Plant,
    optimum: Interval,
    optimal_gradients: Sequence[Interval],
    curvatures: Sequence[Interval],
    report: Callable[[str], None] = lambda message: None,
    resolution: Resolution = FINE,
) -> PrintedDesign | Unstable:
    """The pair given in the plant file, or the first candidate whose references move about least, by ``Σ ∫ (ẏ^r)²``;
    proved stable. ``κ`` scales the costs, ``β`` the Laplacian of the mixing layer."""
    L, r, choice = laplacian(plant.digraph), left_null_vector(plant.digraph), plant.coordinator
    kappa, beta = choice.gradient_gain or Fraction(1), choice.mixing_gain or Fraction(1)
    if choice.softening:
        return Unstable("a soft start needs a mixing_time: without one leave softening out", 0)
    costs = tuple(cost_gradient(_scaled(kappa, agent.cost)) for agent in plant.agents)
    curvatures = [Interval(kappa * side.lo, kappa * side.hi) for side in curvatures]
    optimal_gradients = [Interval(kappa * side.lo, kappa * side.hi) for side in optimal_gradients]
    references = [agent.initial.reference for agent in plant.agents]
    mixing_laplacian = tuple(tuple(beta * entry for entry in row) for row in L)
    rate = mixing_rate(mixing_laplacian, r)
    horizon = resolution.lifetimes / rate

    def attempt(alpha: tuple[Fraction, Fraction], limit: int) -> PrintedDesign | Unstable:
        model = CoordinatorModel(L, r, alpha[0], alpha[1], costs)
        step, steps = _grid(model, beta, curvatures, horizon, limit, resolution.step)
        grid = mixing(mixing_laplacian, r, step, steps)
        if not all(low > 0 for low in grid.smallest):
            return Unstable(f"ξ is not bounded away from zero on a grid of {steps} steps", 0)
        comparison = stabilise(model, damping_ranges(grid, curvatures), rate, RATES)
        if isinstance(comparison, Unstable):
            return comparison
        try:
            found = envelope(model, grid, comparison, optimum, optimal_gradients, references)
        except NonFiniteError:
            return Unstable(f"c'' could not be enclosed along a trajectory on steps of {step} s", 0)
        return PrintedDesign(CoordinatorGains(*alpha, kappa, beta), model, comparison, grid, found)

    pairs, found = _pairs(plant), list[PrintedDesign]()
    for pair in pairs:
        report(f"coordinator: α1 = {pair[0]}, α2 = {pair[1]}")
        result = attempt(pair, COARSE_GRID if len(pairs) > 1 else LARGEST_GRID)
        if isinstance(result, PrintedDesign):
            found.append(result)
        elif len(pairs) == 1:
            return result
    if not found:
        tried = ", ".join(f"({a}, {b})" for a, b in pairs)
        advice = "leave mixing_time open, so that the references wait for the mixing layer"
        return Unstable(
            f"no pair α1, α2 was proved for references that start at once; tried {tried}; {advice}", len(pairs)
        )
    energies = [sum((agent.rate_energy for agent in design.envelope.agents), Fraction(0)) for design in found]
    best = next(design for design, energy in zip(found, energies, strict=True) if energy <= ABOUT * min(energies))
    finest = _grid(best.model, beta, curvatures, horizon, LARGEST_GRID, resolution.step)[0]
    if best.mixing.step != finest:
        again = attempt((best.model.alpha1, best.model.alpha2), LARGEST_GRID)
        if isinstance(again, Unstable):
            return again
        best = again
    return best


def _scaled(kappa: Fraction, cost: sympy.Expr) -> sympy.Expr:
    return cost if kappa == 1 else sympy.Rational(kappa.numerator, kappa.denominator) * cost


def _pairs(plant: Plant) -> tuple[tuple[Fraction, Fraction], ...]:
    chosen = [(plant.coordinator.alpha1 or a, plant.coordinator.alpha2 or b) for a, b in CANDIDATES]
    return tuple(dict.fromkeys(chosen))


def _grid(
    model: CoordinatorModel,
    beta: Fraction,
    curvatures: Sequence[Interval],
    horizon: Fraction,
    limit: int,
    largest: Fraction,
) -> tuple[Fraction, int]:
    """A dyadic step that resolves the fastest rate of the coordinator, and with ``‖L step‖ ≤ 1``, unless ``limit``
    steps do not suffice for the horizon."""
    degree = max(row[i] for i, row in enumerate(model.laplacian))
    damping = max(curvature.hi / r for curvature, r in zip(curvatures, model.left_null_vector, strict=True))
    fastest = 2 * max(model.alpha1, beta) * degree + damping
    step = Fraction(2) ** round(log2(largest / fastest) + 1)
    while step * max(fastest / largest, 2 * beta * degree) > 1:
        step /= 2
    while horizon / step > limit:
        step *= 2
    return step, int(horizon / step) + 1
