"""Choose the coordinator's constants (or take the user's) and enclose the coordinator they give (theory.md section 6.1,
F13, docs/coordinator.md)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.bounds.rationals import round_up
from certify.certificate import Json
from certify.coordinator.envelope import Envelope, norm_gains
from certify.coordinator.gains import CoordinatorGains, starts_at_once
from certify.coordinator.held import design_held, propose_gains
from certify.coordinator.nominal import CostGradient
from certify.coordinator.pace import natural_pace
from certify.coordinator.printed import CANDIDATES, design_printed
from certify.coordinator.resolution import FINE, Resolution
from certify.coordinator.stability import Unstable
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import Interval, Plant


@dataclass(frozen=True)
class CoordinatorDesign:
    """The constants, what was proved about them, and the witness of the proof.

    ``r`` is the left null vector and ``rate`` that of the comparison norm; ``|ỹ_i| ≤ reach_i ‖e‖`` and
    ``|ẏ_i| ≤ rate_gains_i ‖e‖`` (estimates, of which only ``weight`` makes use).
    """

    gains: CoordinatorGains
    r: tuple[Fraction, ...]
    rate: Fraction
    reach: tuple[Fraction, ...]
    rate_gains: tuple[Fraction, ...]
    witness: Json
    envelope: Envelope

    def weight(self, index: int, varsigma10: Fraction, varsigma11: Fraction) -> Fraction:
        """The paper's ``μ`` without its circle: ``μV``, ``V = ‖x‖_P²``, outweighs ``ς10 ỹ² + ς11 (ẏ^r)²`` of agent
        ``index``.

        ``μ λ0 V ≥ ς10 κ² V + 2 ς11 ν² V`` while ``V' ≤ −λ0 V + ‖p‖²/λ0``.
        """
        demand = varsigma10 * self.reach[index] ** 2 + 2 * varsigma11 * self.rate_gains[index] ** 2
        return round_up(demand / self.rate)


def design_coordinator(
    plant: Plant,
    optimum: Interval,
    optimal_gradients: Sequence[Interval],
    curvatures: Sequence[Interval],
    report: Callable[[str], None] = lambda message: None,
    resolution: Resolution = FINE,
) -> CoordinatorDesign | Unstable:
    """A coordinator that waits for its mixing layer, or that of the paper where the plant file asks for it.

    ``curvatures[i]`` encloses ``c_i''`` on the whole line and ``optimal_gradients[i]`` encloses ``c_i'(s*)``.
    """
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    if starts_at_once(plant.coordinator):
        printed = design_printed(plant, optimum, optimal_gradients, curvatures, report, resolution)
        if isinstance(printed, Unstable):
            return printed
        reach, rates = norm_gains(printed.model, printed.comparison)
        rate = printed.comparison.rate
        return CoordinatorDesign(printed.gains, r, rate, reach, rates, printed.witness(), printed.envelope)
    found = design_held(plant, r, L, optimum, optimal_gradients, curvatures, natural_pace(plant), report)
    if isinstance(found, Unstable):
        return found
    return CoordinatorDesign(
        found.gains, found.r, found.rate, found.reach, found.rate_gains, found.witness, found.envelope
    )


def proposed_gains(plant: Plant) -> CoordinatorGains:
    """Constants for a simulation without a certificate: those of the plant file, usual ones where it is silent."""
    choice = plant.coordinator
    if not starts_at_once(choice):
        L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
        found = propose_gains(plant, r, L, natural_pace(plant))
        if isinstance(found, CoordinatorGains):
            return found
    alphas = (choice.alpha1 or CANDIDATES[-1][0], choice.alpha2 or CANDIDATES[-1][1])
    return CoordinatorGains(*alphas, choice.gradient_gain or Fraction(1), choice.mixing_gain or Fraction(1))


def gradients_at(costs: Sequence[CostGradient], optimum: Interval) -> tuple[Interval, ...]:
    """Enclosures of ``c_i'(s*)``."""
    return tuple(cost.gradient.enclose([optimum]) for cost in costs)
