"""Sections 3 and 4 of docs/certificate.md: one agent under state feedback, then under output feedback.

Every number is an interval; upper bounds are points above what they bound. Names are those of the document.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from itertools import product

from certify.checker import linear
from certify.checker.certificate import AgentClaim, AgentWitness
from certify.checker.derivatives import gradient
from certify.checker.expressions import Node, names_in
from certify.checker.intervals import Interval, between, enclose, norm, quadratic_bound, symmetric, total
from certify.checker.linear import Matrix
from certify.checker.plant import Agent
from certify.checker.rules.assumptions import AgentFacts, Facts
from certify.checker.rules.loop import observer_matrix
from certify.checker.rules.reference import AgentEnvelope
from certify.checker.subdivision import CUTS, supremum
from certify.checker.verdict import Malformed, Rejected, Undecided, obligation, require, show

ZERO = Interval(0, 0)
MAX_FREE_ENTRIES = 12
STEADY_STATE_CUTS = 6


def prove_design(agent: Agent, claim: AgentClaim, witness: AgentWitness) -> None:
    """What can be decided from the design alone: sizes, signs and the Lyapunov inequalities of the linear blocks."""
    name, n, s = f"agent {agent.id}", agent.order, len(witness.ell)
    shapes = {"V0": len(agent.zero_states), "P1": n - 1, "P2": s, "P3": n if n > 1 else 0}
    sizes = {"gamma": n - 1, "observer": shapes["P3"], "N": s, "psi": s, "M": s}
    fits = [len(getattr(witness, P)) == size for P, size in shapes.items()]
    fits += [len(getattr(claim, key)) == size for key, size in sizes.items()]
    fits += [len(witness.steady_state) == shapes["V0"], (claim.h is None) == (n == 1)]
    fits += [len(row) == s for row in claim.M]
    if not all(fits):
        raise Malformed(f"{name}: a matrix or a list has the wrong size")
    for P in shapes:
        require(linear.is_positive_definite(getattr(witness, P)), f"{name}: {P} ≻ 0")
    for key in ("a0", "level", "slack", "weight_eta", "weight_theta"):
        require(getattr(witness, key) > 0, f"{name}: {key} > 0", value=getattr(witness, key))
    require(claim.g >= 1 and claim.K > 0 and claim.delta > 0, f"{name}: g ≥ 1, K > 0, δ > 0", g=claim.g, K=claim.K)
    require(claim.h is None or claim.h >= claim.g, f"{name}: h ≥ g", h=claim.h, g=claim.g)
    _lyapunov(f"{name}: MᵀP2 + P2 M ⪯ −I", claim.M, witness.P2)
    if n > 1:
        _lyapunov(f"{name}: A_cᵀP1 + P1 A_c ⪯ −I", [*linear.identity(n - 1)[1:], [-c for c in claim.gamma]], witness.P1)
        _lyapunov(f"{name}: E3ᵀP3 + P3 E3 ⪯ −I", observer_matrix(claim.observer), witness.P3)


def _lyapunov(name: str, A: Matrix, P: Matrix) -> None:
    PA = linear.product(P, A)
    left = linear.combine(-1, linear.combine(1, PA, 1, linear.transpose(PA)), -1, linear.identity(len(A)))
    require(linear.is_nonnegative(left), name, P=P)


def prove_levels(
    agent: Agent, claim: AgentClaim, witness: AgentWitness, envelope: AgentEnvelope, known: AgentFacts, facts: Facts
) -> None:
    """All that depends on the level, at first with the enclosures that cost least. Raises ``Rejected``."""
    try:
        _Recipe(agent, claim, witness, envelope, known, facts, cuts=0).prove()
    except Rejected:
        _Recipe(agent, claim, witness, envelope, known, facts, cuts=CUTS).prove()


class _Recipe:
    """One agent, and the boxes that the level ``C`` confines it to; a bound may cut its box ``cuts`` times."""

    def __init__(
        self,
        agent: Agent,
        claim: AgentClaim,
        witness: AgentWitness,
        envelope: AgentEnvelope,
        known: AgentFacts,
        facts: Facts,
        cuts: int,
    ) -> None:
        self.agent, self.claim, self.witness, self.envelope = agent, claim, witness, envelope
        self.known, self.facts, self.cuts = known, facts, cuts
        self.name, self.n, self.g = f"agent {agent.id}", agent.order, claim.g
        self.nz, self.s = len(agent.zero_states), len(witness.ell)

    def prove(self) -> None:
        with obligation(f"{self.name}: A3: z* is smooth"):
            cuts = max(self.cuts, STEADY_STATE_CUTS)
            self.z_star = self.known.steady_state(self.facts.v, cuts)
            self.z_star_at_start = self.known.steady_state(self.facts.v_at_start, cuts)
        with obligation(self.name):
            self.boxes()
            self.zero_dynamics()
            self.state_feedback()
            if self.n > 1:
                self.output_feedback()
            else:
                needed = self.claim.K * self.theta_max
                self.require(needed <= self.claim.delta, "δ ≥ K ϑ_max", needed=needed, delta=self.claim.delta)

    def boxes(self) -> None:
        """The full box, the slice ``ϑ = 0`` and the reference points ``z = z*, x = (y, 0, …, 0)``."""
        w, claim = self.witness, self.claim
        C = self.C = w.level + w.slack
        self.theta_max = enclose(2 * C * w.weight_theta).sqrt().upper
        self.z_bar = _block(w.V0, C)
        self.x_hat = _block(w.P1, C)
        self.eta = _block(w.P2, C * w.weight_eta)
        self.y = self.facts.optimum + symmetric(self.envelope.peak)
        chain = [self.g**k * x for k, x in enumerate(self.x_hat)]
        pull = -(self.g ** (self.n - 1)) * total(c * x for c, x in zip(claim.gamma, self.x_hat, strict=True))
        z = [a + b for a, b in zip(self.z_bar, self.z_star, strict=True)]
        self.full = self.at(z, [*chain, symmetric(self.theta_max) + pull])
        self.slice = self.at(z, [*chain, pull])
        self.reference = self.at(self.z_star, [ZERO] * self.n)

    def at(self, z: Sequence[Interval], x_bar: Sequence[Interval]) -> dict[str, Interval]:
        """Names to intervals, with ``x = x̄ + (y, 0, …, 0)``."""
        x = [x_bar[0] + self.y, *x_bar[1:]]
        names = (*self.agent.zero_states, *self.agent.chain)
        return {**self.facts.v, **self.known.w, **dict(zip(names, (*z, *x), strict=True))}

    def require(self, holds: bool, name: str, **numbers: object) -> None:
        require(holds, f"{self.name}: {name}", **numbers)

    def zero_dynamics(self) -> None:
        """``V0 J + JᵀV0 ⪯ −a0 I`` for every ``J`` in the enclosure of ``∂f0/∂z`` at ``x1 = y``: at its vertices."""
        if not self.nz:
            return
        names = set().union(*map(names_in, self.agent.zero_dynamics))
        with obligation(f"{self.name}: A6: V0 J + JᵀV0 ⪯ −a0 I"):
            supremum(self.decay, {**self.full, "x1": self.y}, names, self.cuts)

    def decay(self, box: Mapping[str, Interval]) -> Interval:
        """Nothing, if the inequality holds at all vertices of the enclosure of ``J`` on the box."""
        rows = [list(gradient(f0, box, self.agent.zero_states).values()) for f0 in self.agent.zero_dynamics]
        free = [(i, j) for i, row in enumerate(rows) for j, entry in enumerate(row) if entry.a < entry.b]
        if len(free) > MAX_FREE_ENTRIES:
            raise Undecided("too many uncertain entries of ∂f0/∂z")
        for ends in product((False, True), repeat=len(free)):
            J = [[entry.lo for entry in row] for row in rows]
            for (i, j), high in zip(free, ends, strict=True):
                J[i][j] = rows[i][j].hi if high else J[i][j]
            VJ = linear.product(self.witness.V0, J)
            left = linear.combine(
                -1, linear.combine(1, VJ, 1, linear.transpose(VJ)), -self.witness.a0, linear.identity(self.nz)
            )
            if not linear.is_nonnegative(left):
                raise Undecided(f"J = {show(J)}, a0 = {show(self.witness.a0)}")
        return ZERO

    def largest_norm(
        self,
        nodes: Sequence[Node],
        box: Mapping[str, Interval],
        wanted: Sequence[str],
        combine: Callable[[Mapping[str, Interval]], list[Interval]],
    ) -> Interval:
        """The largest Euclidean norm on the box of what ``combine`` makes of the gradients in the wanted names."""

        def size(piece: Mapping[str, Interval]) -> Interval:
            return norm(entry for node in nodes for entry in combine(gradient(node, piece, wanted)))

        return enclose(supremum(size, box, set().union(*map(names_in, nodes)), self.cuts)).upper

    def state_feedback(self) -> None:
        """The bounds ``ς``, the coefficients ``a_•`` and the level."""
        n, g, K, w, claim = self.n, self.g, self.claim.K, self.witness, self.claim
        b_min, b_max = self.known.b.lower, self.known.b.upper
        f0_full = self.slope(self.agent.zero_dynamics, self.full, ["x1"])
        f0_reference = self.slope(self.agent.zero_dynamics, self.reference, ["x1"])
        couple = 4 * enclose(linear.row_sum_bound(w.V0)) ** 2 / w.a0  # ς1²/a0
        F_z = self.slope([self.agent.f], self.slice, self.agent.zero_states)
        F_x = self.chain_slope(self.slice, inner=True)
        F_theta = self.slope([self.agent.f], self.full, [f"x{n}"]) + (g * abs(claim.gamma[-1]) if n > 1 else 0)
        f_y = self.f_y = self.slope([self.agent.f], self.reference, ["x1"])
        P2N = norm(map(enclose, linear.apply(w.P2, claim.N)))
        P2MN = norm(map(enclose, linear.apply(w.P2, linear.apply(claim.M, claim.N))))
        psi_N = self.psi_N = abs(linear.dot(claim.psi, claim.N))
        psi = self.psi = norm(map(enclose, claim.psi))

        def loss(on_eta: Interval, on_theta: Interval) -> Interval:
            """``A/ω_η + C/ω_ϑ``."""
            return on_eta / w.weight_eta + on_theta / w.weight_theta

        through_eta = 12 * P2N**2 / b_min**2
        self.a_z = Fraction(w.a0, 2) - loss(through_eta * F_z**2, 2 * F_z**2)
        self.a_x = g - 2 - couple * f0_full**2 - loss(through_eta * F_x**2, 2 * F_x**2)
        self.a_eta = enclose(1 / (2 * w.weight_eta)) - 2 * b_max**2 * psi**2 / w.weight_theta
        p1 = enclose(linear.row_sum_bound(w.P1) ** 2)
        self.a_theta = (
            (b_min * K - 1) / w.weight_theta
            - (p1 if n > 1 else couple * f0_full**2)
            - loss(12 * (P2MN + P2N * F_theta) ** 2 / b_min**2, 2 * (F_theta + psi_N) ** 2)
        )
        for name in self.blocks():
            self.require(getattr(self, name) > 0, f"{name} > 0", value=getattr(self, name))

        kappa = 4 * P2N**2 / (b_min**2 * w.weight_eta) + 1 / (2 * w.weight_theta)
        gamma_1 = claim.gamma[0] if n > 1 else Fraction(1)
        s10 = couple * f0_reference**2 + 2 * kappa * f_y**2
        s11 = p1 + 2 * kappa * g ** (2 * n - 2) * gamma_1**2
        start = self.start()
        level = start + s10 * self.envelope.energy + s11 * self.envelope.speed_energy
        self.require(level <= w.level, "w0 + ς10 I_y + ς11 I_d ≤ c", w0=start, sum=level.upper, level=w.level)

    def blocks(self) -> list[str]:
        """The coefficients ``a_•`` of the blocks that there are."""
        present = {"a_z": self.nz, "a_x": self.n > 1, "a_eta": self.s, "a_theta": True}
        return [name for name, there in present.items() if there]

    def slope(self, nodes: Sequence[Node], box: Mapping[str, Interval], wanted: Sequence[str]) -> Interval:
        """``⌈‖∂nodes/∂wanted‖⌉`` on the box."""
        return self.largest_norm(nodes, box, wanted, lambda partials: list(partials.values()))

    def chain_slope(self, box: Mapping[str, Interval], inner: bool) -> Interval:
        """``⌈‖(g^(k−1) ∂_k f1 − g^(n−1) γ_k ∂_n f1)_(k<n)‖⌉``; ``inner`` adds that of ``Σ g^(n−k) γ_k x̄_(k+1)``."""
        n, g, gamma = self.n, self.g, self.claim.gamma
        share = [
            (g**n * gamma[k - 1] if k else 0) - g**n * gamma[-1] * gamma[k] if inner else Fraction(0)
            for k in range(n - 1)
        ]

        def entries(partials: Mapping[str, Interval]) -> list[Interval]:
            return [
                g**k * partials[f"x{k + 1}"] - g ** (n - 1) * gamma[k] * partials[f"x{n}"] + share[k]
                for k in range(n - 1)
            ]

        return self.largest_norm([self.agent.f], box, self.agent.chain, entries)

    def start(self) -> Interval:
        """``w0``: a bound of ``V0 + V1 + V2/ω_η + ϑ²/(2ω_ϑ)`` on the initial set."""
        n, g, w, claim, known = self.n, self.g, self.witness, self.claim, self.known
        x_bar = [between(*box) for box in self.agent.x_box]
        x_bar[0] = x_bar[0] - between(*self.agent.reference_box)
        weights = [g ** (n - k) * c for k, c in enumerate((*claim.gamma, Fraction(1)), 1)]
        theta = total(weight * x for weight, x in zip(weights, x_bar, strict=True))
        z_bar = [between(*box) - z for box, z in zip(self.agent.z_box, self.z_star_at_start, strict=True)]
        x_hat = [x / g**k for k, x in enumerate(x_bar[:-1])]
        tau = known.tau(self.facts.v_at_start, self.cuts)
        T_tau = [total(t * entry for t, entry in zip(row, tau, strict=True)) for row in known.T]
        eta = [between(*self.agent.eta_box) - x - N * theta / known.b for x, N in zip(T_tau, claim.N, strict=True)]
        return (
            quadratic_bound(w.V0, z_bar)
            + quadratic_bound(w.P1, x_hat)
            + quadratic_bound(w.P2, eta) / w.weight_eta
            + theta**2 / (2 * w.weight_theta)
        ).upper

    def output_feedback(self) -> None:
        """Section 4: the saturation level, the first phase (h1, h2) and the second (h3)."""
        n, g, w, claim, h = self.n, self.g, self.witness, self.claim, self.claim.h or Fraction(1)
        K, delta, slack, b_max, psi = claim.K, claim.delta, w.slack, self.known.b.upper, self.psi
        E2 = [(g / h) ** (n - k) * c for k, c in enumerate((*claim.gamma, Fraction(1)), 1)]
        inverse = linear.inverse(w.P3)
        reach = enclose(slack / 2 * linear.dot(E2, linear.apply(inverse, E2))).sqrt()
        self.require(
            K * (self.theta_max + reach) <= delta,
            "δ ≥ K (ϑ_max + √(½ ϵ E2 P3⁻¹ E2ᵀ))",
            theta_max=self.theta_max,
            reach=reach,
            delta=delta,
        )

        F_z = self.slope([self.agent.f], self.full, self.agent.zero_states)
        F_x = self.chain_slope(self.full, inner=False)
        F_n = self.slope([self.agent.f], self.full, [f"x{n}"])
        p3 = norm(enclose(row[-1]) for row in w.P3)
        lambda_M = linear.row_sum_bound(w.P3)
        X2 = (
            F_z * norm(self.z_bar)
            + F_x * norm(self.x_hat)
            + F_n * self.theta_max
            + self.f_y * self.envelope.peak
            + b_max * (delta + psi * norm(self.eta))
            + self.psi_N * self.theta_max
        )
        self.require(4 * lambda_M * p3**2 * X2**2 / h**2 <= slack / 4, "h1: 4 λ_M p3² X2²/h² ≤ ϵ/4", X2=X2.upper, h=h)

        delta_1 = b_max / w.weight_theta * self.theta_max * (delta + K * self.theta_max)
        T = slack / (4 * delta_1)
        start = quadratic_bound(w.P3, self.error_at_start(h))
        left = (-(h * T / (2 * lambda_M)).lower).exp() * start
        self.require(left <= slack / 4, "h2: e^(−hT/(2λ_M)) We(0) ≤ ϵ/4", left=left.upper, T=T.lower, We=start)

        beta = 12 * p3**2 / h
        margins = {
            "a_z": self.a_z - beta * F_z**2,
            "a_x": self.a_x - beta * F_x**2,
            "a_eta": self.a_eta - beta * b_max**2 * psi**2,
            "a_theta": self.a_theta / 2 - beta * (F_n + b_max * K + self.psi_N) ** 2,
        }
        for name in self.blocks():
            self.require(margins[name] > 0, f"h3: {name} exceeds what ẋ_n costs", left=margins[name])
        size = norm(map(enclose, E2))
        cost = beta * b_max**2 * K**2 * size**2 + (b_max * K * size / w.weight_theta) ** 2 / (2 * self.a_theta)
        self.require(cost < h / 2, "h3: h/2 > β b²K²‖E2‖² + (bK‖E2‖/ω_ϑ)²/(2a_ϑ)", right=cost.upper, h=h)
        drift = beta * self.f_y**2 * self.envelope.energy
        self.require(drift <= slack / 8, "h3: β ς_f² I_y ≤ ϵ/8", left=drift.upper, slack=slack)

    def error_at_start(self, h: Fraction) -> list[Interval]:
        """``e_k(0) = h^(n−k) (x_k(0) − x~_k(0))``."""
        x = [between(*box) for box in self.agent.x_box]
        guess = self.agent.observer_box
        error = [ZERO, *x[1:]] if guess is None else [a - between(*b) for a, b in zip(x, guess, strict=True)]
        return [h ** (self.n - k) * entry for k, entry in enumerate(error, 1)]


def _block(P: Matrix, level: Fraction) -> list[Interval]:
    """``|x_k| ≤ √(level (P⁻¹)_kk)`` on ``{xᵀPx ≤ level}``."""
    return [symmetric(enclose(level * row[k]).sqrt()) for k, row in enumerate(linear.inverse(P))]
