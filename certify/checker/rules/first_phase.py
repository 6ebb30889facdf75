"""Section 4 of docs/certificate-direct.md: up to ``T1`` the saturation may be active, and only ``|ū| ≤ δ`` is used."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from certify.checker import linear
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.intervals import Interval, between, enclose, maximum, quadratic_bound, total
from certify.checker.linear import Matrix
from certify.checker.plant import Agent
from certify.checker.rules.assumptions import AgentFacts
from certify.checker.rules.increments import Increments, bound_f1, bounds_f0, no_nominal
from certify.checker.rules.loop import observer_matrix
from certify.checker.rules.surroundings import Outside, Surroundings
from certify.checker.subdivision import CUTS
from certify.checker.verdict import Rejected, Undecided, require

ZERO = Interval(0, 0)
TRIES = 30
SLACK = Fraction(33, 32)


def prove_observer(name: str, claim: AgentClaim, witness: DirectAgentWitness) -> None:
    """``P3 ≻ 0``, ``κ > 0``, ``E3ᵀP3 + P3E3 + 2κP3 ⪯ 0``."""
    P, rate = witness.observer_norm, witness.observer_rate or Fraction(0)
    require(linear.is_positive_definite(P), f"{name}: P3 ≻ 0", P3=P)
    require(rate > 0, f"{name}: κ > 0", rate=rate)
    PE = linear.product(P, observer_matrix(claim))
    left = linear.combine(-1, linear.combine(1, PE, 1, linear.transpose(PE)), -2 * rate, P)
    require(linear.is_nonnegative(left), f"{name}: E3ᵀP3 + P3E3 + 2κP3 ⪯ 0", rate=rate)


def magnitudes_at_start(agent: Agent, known: AgentFacts, v: Mapping[str, Interval]) -> list[Interval]:
    """Of ``z̄, x̄, η̄``: ``x̄_1 = x_1 − y^r``, ``z̄ = z − z*``, ``η̄ = η − Tτ``, with ``v`` at the start."""
    z = [between(*box) - steady for box, steady in zip(agent.z_box, known.steady_state(v, CUTS), strict=True)]
    x = [between(*box) for box in agent.x_box]
    x[0] = x[0] - between(*agent.reference_box)
    tau = known.tau(v, CUTS)
    eta = [between(*agent.eta_box) - total(t * entry for t, entry in zip(row, tau, strict=True)) for row in known.T]
    return [entry.magnitude for entry in (*z, *x, *eta)]


class FirstPhase:
    """The magnitudes of ``z̄, x̄, η̄, e`` at ``T1``, for an agent of order 2 or more."""

    def __init__(self, name: str, agent: Agent, claim: AgentClaim, witness: DirectAgentWitness, b: Interval,
                 outside: Outside, increments: Increments) -> None:
        self.name, self.agent, self.claim, self.witness = name, agent, claim, witness
        self.outside, self.increments = outside, increments
        self.b_max = b.upper
        self.nz, self.n = len(agent.zero_states), agent.order
        self.pull = linear.combine(1, claim.M, 1, [[n * p for p in claim.psi] for n in claim.N]) if claim.M else []

    def magnitudes_at_end(self, start: list[Interval]) -> list[Interval]:
        """From those of ``z̄, x̄, η̄`` at the start. Raises ``Rejected``."""
        assert self.witness.phase1 is not None  # its presence is decided with the design
        duration, steps = self.witness.phase1.duration, self.witness.phase1.steps
        x, acceleration = start, ZERO
        for k in range(steps):
            try:
                around = self.outside.during(duration * k / steps, duration * (k + 1) / steps)
                x, found = self.step(x, around, duration / steps)
            except Undecided as reason:
                raise Rejected(f"{self.name}: phase 1: step {k + 1}", str(reason)) from None
            acceleration = maximum(acceleration, found)
        return [*x, *self.observer_error(duration, acceleration)]

    def step(self, x: list[Interval], around: Surroundings, length: Fraction) -> tuple[list[Interval], Interval]:
        """The magnitudes after the step, and a bound of ``|ẋ_n|`` in it; a box is valid if ``B ≥ X + Δ·rate(B)``."""
        box = x
        for _ in range(TRIES):
            rates, acceleration = self.rates(box, around)
            end = [(size + length * rate).upper for size, rate in zip(x, rates, strict=True)]
            if all(reached <= size for reached, size in zip(end, box, strict=True)):
                return end, acceleration
            box = [(size + SLACK * length * rate).upper for size, rate in zip(x, rates, strict=True)]
        raise Undecided("no box was found that holds for the whole step")

    def rates(self, box: list[Interval], around: Surroundings) -> tuple[list[Interval], Interval]:
        """Bounds of ``|z̄'|, |x̄'|, |η̄'|`` on the box, and of ``|ẋ_n|``."""
        nz, n, claim = self.nz, self.n, self.claim
        z, x, eta = box[:nz], box[nz : nz + n], box[nz + n :]
        slopes, nominal = self.increments.slopes(around, z, x), no_nominal(self.agent)
        push = total(abs(p) * size for p, size in zip(claim.psi, eta, strict=True)) + claim.delta
        acceleration = (bound_f1(slopes, nominal, z, x, around.distance) + self.b_max * push).upper
        rates = bounds_f0(slopes, nominal, z, x, around.distance)
        rates += [x[1] + around.speed, *x[2:]] if n > 2 else [x[1] + around.speed]
        rates.append(acceleration)
        rates += [total(abs(entry) * size for entry, size in zip(row, eta, strict=True)) + abs(N) * claim.delta
                  for row, N in zip(self.pull, claim.N, strict=True)]
        return rates, acceleration

    def observer_error(self, duration: Fraction, acceleration: Interval) -> list[Interval]:
        """``|e_i| ≤ √(P3⁻¹)_ii (e^(−κhT1) ‖e(0)‖ + √(P3)_nn X2/(κh))``; at ``T1 = 0`` the initial magnitudes."""
        sizes, P = self.error_at_start(), self.witness.observer_norm
        if duration == 0:
            return sizes
        rate = (self.witness.observer_rate or Fraction(0)) * (self.claim.h or Fraction(0))
        norm = enclose(quadratic_bound([[abs(entry) for entry in row] for row in P], sizes)).sqrt()
        reached = enclose(-rate * duration).exp() * norm + enclose(P[-1][-1]).sqrt() * acceleration / rate
        inverse: Matrix = linear.inverse(P)
        return [(enclose(row[i]).sqrt() * reached).upper for i, row in enumerate(inverse)]

    def error_at_start(self) -> list[Interval]:
        """Magnitudes of ``e_k(0) = h^(n−k) (x_k(0) − x~_k(0))``."""
        x, guess = [between(*box) for box in self.agent.x_box], self.agent.observer_box
        error = [ZERO, *x[1:]] if guess is None else [a - between(*b) for a, b in zip(x, guess, strict=True)]
        h = self.claim.h or Fraction(0)
        return [(h ** (self.n - k) * entry.magnitude).upper for k, entry in enumerate(error, 1)]
