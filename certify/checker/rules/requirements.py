"""Section 7 of docs/certificate-direct.md: settling, peak of the input and bandwidth of the observer, as claimed.

Everything comes from what is proved before: the boxes of both phases and the tail, the reference over time, and the
bounds of ``|ū|`` in phase 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import arb, arb_mat, fmpq, fmpz_poly

from certify.checker import linear
from certify.checker.balls import BITS, above, ball, balls, exact, interval, precision
from certify.checker.certificate import DirectAgentClaim, DirectAgentWitness
from certify.checker.intervals import Interval, enclose, total
from certify.checker.linear import Row
from certify.checker.plant import Agent
from certify.checker.requested import Settling
from certify.checker.rules.assumptions import AgentFacts
from certify.checker.rules.surroundings import Outside
from certify.checker.verdict import Undecided, require, spend

LARGEST_FACTORED = 1 << 14  # bits of the polynomial times its degree: milliseconds


def prove(
    name: str,
    agent: Agent,
    claim: DirectAgentClaim,
    witness: DirectAgentWitness,
    known: AgentFacts,
    outside: Outside,
    pushes: Sequence[Interval],
) -> None:
    """``pushes`` are points above ``|ū|`` on the steps of phase 1. Raises ``Rejected``."""
    asked = claim.requirements
    if asked.settling is not None:
        settles(name, asked.settling, agent, witness, outside)
    if asked.input is not None:
        InputPeak(name, asked.input, agent, claim, witness, known, outside).prove(pushes)
    if asked.bandwidth is not None and claim.h is not None:
        slow_enough(name, claim.observer, claim.h, asked.bandwidth)


def settles(name: str, asked: Settling, agent: Agent, witness: DirectAgentWitness, outside: Outside) -> None:
    """``|x̄_1| + |y^r − s*| ≤ band`` from ``time`` on."""
    output, reference = len(agent.zero_states), outside.reference
    for k, (start, end, box) in enumerate(_steps(witness), 1):
        if end > asked.time:
            error = enclose(box[output]) + reference.during(max(start, asked.time), end).distance
            require(
                bool(error <= asked.band),
                f"{name}: settling: |x̄_1| + |y^r − s*| ≤ band",
                step=k,
                until=end,
                left=error,
                band=asked.band,
            )
    begin = witness.grid[-1]
    late, tail = max(asked.time, begin), witness.tail
    error = tail.box[output] * enclose(-tail.rate * (late - begin)).exp()
    error = error + reference.tail_distance * enclose(-reference.tail_rate * (late - reference.end)).exp()
    require(
        bool(error <= asked.band),
        f"{name}: settling: |x̄_1| + |y^r − s*| ≤ band in the tail",
        from_t=late,
        left=error,
        band=asked.band,
    )


class InputPeak:
    """``|u| ≤ limit``, ``u = ū + Ψη = υ + u*``, by the better of two bounds on every step."""

    def __init__(
        self,
        name: str,
        limit: Fraction,
        agent: Agent,
        claim: DirectAgentClaim,
        witness: DirectAgentWitness,
        known: AgentFacts,
        outside: Outside,
    ) -> None:
        self.name, self.limit, self.claim, self.witness, self.known = name, limit, claim, witness, known
        self.states = len(agent.zero_states) + agent.order
        self.psi = [abs(entry) for entry in claim.psi]
        self.steady = known.steady_input(outside.exosystem.W)
        self.model = InternalModel(claim, max(abs(end) for end in agent.eta_box))

    def prove(self, pushes: Sequence[Interval]) -> None:
        """``pushes`` are points above ``|ū|`` on the steps of phase 1. Raises ``Rejected``."""
        first = len(self.witness.phase1.boxes)
        for k, (start, end, box) in enumerate(_steps(self.witness)):
            push = pushes[k] if k < first else enclose(self.claim.K * box[self.states]).upper
            straight = push + self.model.after(end - start, push) if self.model.followed(self.limit) else None
            around = (push + self.internal(box) if k < first else enclose(box[-1])) + self.steady
            peak = around if straight is None else min(around.upper, straight.upper)
            self.require(peak, step=k + 1, until=end)
        self.require(self.witness.tail.box[-1] + self.steady, from_t=self.witness.grid[-1])

    def internal(self, box: Sequence[Fraction]) -> Interval:
        """``|Ψη̄| ≤ |Ψ| ζ + |ΨN| x̄_n/b`` in a box of phase 1."""
        zeta = total(enclose(p * size) for p, size in zip(self.psi, box[self.states + 1 :], strict=True))
        return zeta + abs(linear.dot(self.claim.psi, self.claim.N)) * box[self.states - 1] / self.known.b.lower

    def require(self, peak: Interval, **where: object) -> None:
        require(bool(peak <= self.limit), f"{self.name}: input: |u| ≤ limit", **where, left=peak, limit=self.limit)


class InternalModel:
    """Points above ``|η|`` from its start on: ``η' = (M + NΨ)η + Nū``, below ``η̂' = |M + NΨ|η̂ + |N||ū|``."""

    def __init__(self, claim: DirectAgentClaim, at_start: Fraction) -> None:
        self.rates = [
            [abs(entry + n * p) for entry, p in zip(row, claim.psi, strict=True)]
            for row, n in zip(claim.M, claim.N, strict=True)
        ]
        with precision(BITS):
            self.N = arb_mat([[ball(abs(entry))] for entry in claim.N]) if claim.N else None
            self.psi = arb_mat([[ball(abs(entry)) for entry in claim.psi]]) if claim.N else None
            self.eta = arb_mat([[ball(at_start)] for _ in claim.N]) if claim.N else None
        self.reached = enclose(Fraction(0))

    def followed(self, limit: Fraction) -> bool:
        """Until its part alone is above the limit; then only the other bound can do."""
        return bool(self.reached <= limit)

    def after(self, duration: Fraction, push: Interval) -> Interval:
        """A point above ``|Ψη|`` on a step with ``|ū| ≤ push``, at whose end the next one begins: ``η̂`` grows, and is
        ``e^(GΔ)(η̂ + Δ|N| push)`` at most."""
        if self.N is None or self.psi is None or self.eta is None:
            return self.reached
        spend(4_000 * (1 + len(self.rates) ** 3))
        with precision(BITS):
            flow = balls(exact([[duration * entry for entry in row] for row in self.rates])).exp()
            ahead = flow * (self.eta + self.N * (ball(duration) * above(push)))
            self.eta = arb_mat([[entry.abs_upper()] for entry in ahead.entries()])
            self.reached = interval((self.psi * self.eta)[0, 0]).upper
        return self.reached


def slow_enough(name: str, observer: Row, h: Fraction, bandwidth: Fraction) -> None:
    """No root of ``c(λ) = λⁿ + c_n λ^(n−1) + … + c_1`` is beyond ``bandwidth/h``."""
    limit = bandwidth / h
    for factor in _factors(observer):
        require(_within(factor, limit), f"{name}: bandwidth: h |λ| ≤ bandwidth, c(λ) = 0", h=h, bandwidth=bandwidth)


def _factors(observer: Row) -> list[fmpz_poly]:
    """Irreducible over the rationals. Raises ``Undecided`` where that would take long."""
    scale = linear.common_denominator([list(observer)])
    whole = [*(int(c * scale) for c in observer), scale]
    if len(whole) * max(map(int.bit_length, whole)) > LARGEST_FACTORED:
        raise Undecided("the observer's polynomial is too long to find its roots")
    return [factor for factor, _ in fmpz_poly(whole).factor()[1]]


def _within(factor: fmpz_poly, limit: Fraction) -> bool:
    """Whether all roots are at most ``limit``: exactly up to degree 2, by enclosures of simple roots from 3 on."""
    coefficients = [Fraction(int(c)) for c in factor.coeffs()]
    if len(coefficients) == 2:
        return abs(coefficients[0]) <= limit * abs(coefficients[1])
    if len(coefficients) == 3:
        c, b, a = (entry / coefficients[2] for entry in coefficients)
        if b * b < 4 * c:  # two that are conjugate, with the product c
            return c <= limit**2
        return limit**2 * a - abs(b) * limit + c >= 0 and 2 * limit >= abs(b)  # both between −limit and limit
    with precision(BITS):
        far = arb(fmpq(limit.numerator, limit.denominator))
        return all(bool(abs(root) <= far) for root, _ in factor.complex_roots())


def _steps(witness: DirectAgentWitness) -> Iterator[tuple[Fraction, Fraction, Row]]:
    """Start, end and box of every step of both phases; ``x̄_1`` has the same place in all of them."""
    phase = witness.phase1
    for grid, boxes in ((phase.grid, phase.boxes), (witness.grid, witness.boxes)):
        for k, box in enumerate(boxes):
            yield grid[k], grid[k + 1], tuple(box)
