"""Section 4 of docs/certificate-direct.md: up to ``T1`` the saturation may be active."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from certify.checker import linear
from certify.checker.certificate import AgentClaim, DirectAgentWitness
from certify.checker.intervals import Interval, between, enclose, total
from certify.checker.linear import Row
from certify.checker.plant import Agent
from certify.checker.rules import loop
from certify.checker.rules.assumptions import AgentFacts
from certify.checker.rules.increments import Increments, Slopes, increment
from certify.checker.rules.observer import Observer, Table
from certify.checker.rules.surroundings import Outside, Surroundings
from certify.checker.slopes import ZERO
from certify.checker.subdivision import CUTS
from certify.checker.verdict import Rejected, Undecided, require, spend


@dataclass(frozen=True)
class Sizes:
    """Points above the magnitudes of ``z̄, x̄, ϑ`` and ``ζ = η̄ − N x̄_n/b``."""

    z: Sequence[Interval]
    x: Sequence[Interval]
    theta: Interval
    zeta: Sequence[Interval]


@dataclass(frozen=True)
class Rates:
    """Points above ``|z̄'|``, ``|x̄_n' − bū|``, ``|ϑ' − bū|`` and ``|ζ'|``."""

    z: Sequence[Interval]
    last: Interval
    theta: Interval
    zeta: Sequence[Interval]


class FirstPhase:
    """Of one agent, from its initial box to ``T1``."""

    def __init__(
        self,
        name: str,
        agent: Agent,
        claim: AgentClaim,
        witness: DirectAgentWitness,
        known: AgentFacts,
        outside: Outside,
        increments: Increments,
        tabulate: Callable[[Row], Table],
    ) -> None:
        self.name, self.agent, self.claim, self.known = name, agent, claim, known
        self.phase, self.nominal_b = witness.phase1, witness.nominal.b
        self.outside, self.increments = outside, increments
        self.nz, self.n, self.b = len(agent.zero_states), agent.order, known.b
        self.theta, self.E2 = loop.theta(claim), [enclose(abs(entry)) for entry in loop.observer_gain(claim)]
        self.inputs: list[Interval] = []  # points above |ū|, step by step
        self.unshifted = [ZERO] * (self.nz + self.n)
        self.by_last = self.shift(linear.dot(claim.psi, claim.N))
        shift = [*[Fraction(0)] * (self.nz + 1), *self.theta[:-1]]
        self.by_theta = [a + b for a, b in zip(self.by_last, shift, strict=True)]
        self.MN = linear.apply(claim.M, claim.N)
        self.observer = (
            Observer(claim.h, tabulate(claim.observer), self.error_at_start()) if claim.h and self.phase.boxes else None
        )

    def shift(self, of_last: Fraction) -> list[Interval]:
        return [*self.unshifted[1:], enclose(of_last)]

    def at_end(self) -> list[Interval]:
        """Points above the magnitudes of ``Y`` at ``T1``, with the ``ζ`` of the nominal ``b``. Raises ``Rejected``."""
        X, fastest = self.at_start(), ZERO
        for k in range(len(self.phase.boxes)):
            try:
                X, fastest = self.step(k, X, fastest)
            except Undecided as reason:
                raise Rejected(f"{self.name}: phase 1: step {k + 1}", str(reason)) from None
        change = (self.b.reciprocal() - 1 / self.nominal_b).magnitude
        zeta = [(size + abs(N) * change * X.x[-1]).upper for size, N in zip(X.zeta, self.claim.N, strict=True)]
        error = self.observer.error(self.phase.grid[-1], fastest) if self.observer else self.error_at_start()
        return [*X.z, *X.x[:-1], X.theta, *zeta, *error]

    def at_start(self) -> Sizes:
        agent, known, v = self.agent, self.known, self.outside.exosystem.at_start
        z = [between(*box) - steady for box, steady in zip(agent.z_box, known.steady_state(v, CUTS), strict=True)]
        x = [between(*box) for box in agent.x_box]
        x[0] = x[0] - between(*agent.reference_box)
        tau, last = known.tau(v, CUTS), x[-1].magnitude
        eta = [between(*agent.eta_box) - total(t * u for t, u in zip(row, tau, strict=True)) for row in known.T]
        zeta = [
            (entry.magnitude + abs(N) * last / self.b.lower).upper for entry, N in zip(eta, self.claim.N, strict=True)
        ]
        sizes = [entry.magnitude for entry in x]
        return Sizes([entry.magnitude for entry in z], sizes, self.weighed(self.theta, sizes), zeta)

    def error_at_start(self) -> list[Interval]:
        """Magnitudes of ``e_k(0) = h^(n−k) (x_k(0) − x~_k(0))``, none without an observer."""
        if self.claim.h is None:
            return []
        x, guess = [between(*box) for box in self.agent.x_box], self.agent.observer_box
        error = [ZERO, *x[1:]] if guess is None else [a - between(*b) for a, b in zip(x, guess, strict=True)]
        return [(self.claim.h ** (self.n - k) * entry.magnitude).upper for k, entry in enumerate(error, 1)]

    def step(self, k: int, X: Sizes, fastest: Interval) -> tuple[Sizes, Interval]:
        """The magnitudes after step ``k``, and a bound of ``|ẋ_n|`` up to then, from those before it."""
        start, end = self.phase.grid[k : k + 2]
        length, name = end - start, f"{self.name}: phase 1: step {k + 1}"
        B, theta = self.box(k), enclose(self.phase.vartheta[k]).upper
        around = self.outside.until(_power_of_two_from(end))
        slopes = self.increments.on_step(k, length, around, B.z, B.x)
        rates = self.rates(B, slopes, around)
        fastest, error, push = self.input(start, B, fastest, rates)
        self.inputs.append(push)
        pull = self.pull(min(X.theta, theta) - error)
        grown = length * (rates.theta - pull)
        require(
            bool(theta - X.theta >= grown),
            f"{name}: ϑ^+ − ϑ ≥ Δ (P − b sat(K (ϑ − ε)))",
            change=theta - X.theta,
            needed=grown,
        )

        z, zeta = _after(X.z, length, rates.z), _after(X.zeta, length, rates.zeta)
        x = self.chain_after(X, B, length, around.speed)
        last = (X.x[-1] + length * (rates.last + self.b.upper * push)).upper
        during = min(last, (B.theta + self.weighed(self.theta[:-1], B.x[:-1])).upper)
        for what, box, needed in (
            ("B_z ≥ z^+", B.z, z),
            ("B_x ≥ x^+", B.x, [*x, during]),
            ("B_ϑ ≥ ϑ, ϑ^+", [B.theta], [max(X.theta, theta)]),
            ("B_ζ ≥ ζ^+", B.zeta, zeta),
        ):
            for i, (size, least) in enumerate(zip(box, needed, strict=True), 1):
                require(bool(least <= size), f"{name}: {what}", i=i, box=size, needed=least)
        return Sizes(z, [*x, min(last, (theta + self.weighed(self.theta[:-1], x)).upper)], theta, zeta), fastest

    def box(self, k: int) -> Sizes:
        sizes = [enclose(size).upper for size in self.phase.boxes[k]]
        nz, at = self.nz, self.nz + self.n
        return Sizes(sizes[:nz], sizes[nz:at], sizes[at], sizes[at + 1 :])

    def rates(self, B: Sizes, slopes: Slopes, around: Surroundings) -> Rates:
        """``|f0-increment|``, ``F``, ``P``, and ``|M| B_ζ + G``."""
        claim, f1 = self.claim, slopes.f1
        spend(20 * (1 + len(B.zeta)) * (len(f1) + len(B.zeta)))
        speed = around.speed if self.n == 1 else ZERO

        def bound(row: Sequence[Interval], shift: Sequence[Interval]) -> Interval:
            return increment(row, shift, B.z, B.x, around.distance)

        model = self.b.upper * self.weighed([abs(entry) for entry in claim.psi], B.zeta)
        zeta = []
        for row, N, MN in zip(claim.M, claim.N, self.MN, strict=True):
            part = bound([N * slope for slope in f1], self.shift(-MN)) + abs(N) * speed
            zeta.append((self.weighed([abs(entry) for entry in row], B.zeta) + part / self.b.lower).upper)
        return Rates(
            [bound(row, self.unshifted[: len(row)]) for row in slopes.f0],
            (bound(f1, self.by_last) + model + speed).upper,
            (bound(f1, self.by_theta) + model + self.theta[0] * around.speed).upper,
            zeta,
        )

    def input(self, start: Fraction, B: Sizes, fastest: Interval, rates: Rates) -> tuple[Interval, Interval, Interval]:
        """``X2^+``, ``ε`` and ``u``: ``|ẋ_n| ≤ X2^+`` up to the end, ``|E2 e| ≤ ε`` and ``|ū| ≤ u`` on the step."""
        limit = push = enclose(self.claim.delta).upper
        reached, error = fastest, ZERO
        for _ in range(2):
            reached = max(fastest, (rates.last + self.b.upper * push).upper)
            error = self.weighed(self.E2, self.observer.error(start, reached)) if self.observer else ZERO
            push = min(limit, (self.claim.K * (B.theta + error)).upper)
        return reached, error, push

    def pull(self, theta: Interval) -> Interval:
        """``b sat_δ(Kϑ)`` from below."""
        limit = enclose(self.claim.delta)
        push = max((-limit).lower, min(limit.lower, (self.claim.K * theta).lower))
        return push * (self.b.lower if push > 0 else self.b.upper)

    def chain_after(self, X: Sizes, B: Sizes, length: Fraction, speed: Interval) -> list[Interval]:
        """Of ``x̄_1 … x̄_(n−1)``; the last of them is drawn to ``ϑ``: ``x̄_(n−1)' = ϑ − Σ_(k<n) θ_k x̄_k``."""
        if self.n == 1:
            return []
        *rest, drawn = self.theta[:-1]
        rates = list(B.x[1:])
        push = B.theta + self.weighed(rest, B.x[:-2]) - drawn * X.x[-2]
        rates[-1] = min(rates[-1], max(ZERO, push.upper))
        rates[0] = rates[0] + speed
        return _after(X.x[:-1], length, rates)

    def weighed(self, factors: Sequence[Fraction | Interval], sizes: Sequence[Interval]) -> Interval:
        """A point above ``Σ_k factor_k size_k``, factors that are not negative."""
        return total(factor * size for factor, size in zip(factors, sizes, strict=True)).upper


def _after(sizes: Sequence[Interval], length: Fraction, rates: Sequence[Interval]) -> list[Interval]:
    return [(size + length * rate).upper for size, rate in zip(sizes, rates, strict=True)]


def _power_of_two_from(t: Fraction) -> Fraction:
    """The least power of two that is at least ``t > 0``."""
    power = Fraction(2) ** (t.numerator.bit_length() - t.denominator.bit_length() - 1)
    while power < t:
        power *= 2
    return power
