"""Section 1 of docs/certificate.md: the assumptions A0 to A5 and the internal models."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial

from certify.checker import functions, linear
from certify.checker.certificate import AgentClaim, AgentWitness, Certificate, DirectAgentWitness, Root
from certify.checker.expressions import Name, Node, evaluate, occurrences, parse
from certify.checker.intervals import Interval, between, enclose, hull, quadratic_bound, symmetric, total
from certify.checker.linear import Matrix
from certify.checker.plant import Agent, Plant
from certify.checker.polynomials import ZERO, Algebra, Rational, constant, variable
from certify.checker.rules.costs import Cost, prove_cost, prove_optimum
from certify.checker.rules.steady_root import bracket, prove_root
from certify.checker.subdivision import CUTS, supremum, value_range
from certify.checker.verdict import Malformed, Undecided, obligation, require, spend

ZERO_INPUT = Interval(0, 0)


@dataclass(frozen=True)
class AgentFacts:
    """Enclosures of ``w`` and ``b(w)``, the matrix ``T``, and ways to enclose ``z*``, ``τ`` and ``|u*|``.

    ``steady_state(v, cuts)`` and ``tau(v, cuts)`` take a box of ``v`` and how many cuts an enclosure may cost.
    ``steady_input(W)`` is a point above ``|u*|`` for all time, ``v vᵀ ⪯ W``.
    """

    w: Mapping[str, Interval]
    b: Interval
    T: Matrix
    steady_state: Callable[[Mapping[str, Interval], int], list[Interval]]
    tau: Callable[[Mapping[str, Interval], int], list[Interval]]
    steady_input: Callable[[Sequence[Sequence[Interval]]], Interval]
    steady_nodes: Sequence[Node]
    roots: Mapping[str, Interval]


@dataclass(frozen=True)
class Facts:
    """What is proved about the network, and per agent."""

    r: tuple[Fraction, ...]
    costs: tuple[Cost, ...]
    optimum: Interval
    optimal_slopes: tuple[Interval, ...]
    v: Mapping[str, Interval]
    v_at_start: Mapping[str, Interval]
    agents: tuple[AgentFacts, ...]


def prove(plant: Plant, certificate: Certificate) -> Facts:
    """A0 to A5. Raises ``Rejected``."""
    r = prove_network(plant, certificate.witness.left_null_vector)
    costs = tuple(prove_cost(agent) for agent in plant.agents)
    if len(certificate.witness.optimum) != 2:
        raise Malformed("the optimum is an interval")
    lo, hi = certificate.witness.optimum
    slopes = prove_optimum(costs, lo, hi)
    v = _exosystem(plant, certificate)
    witnesses: Sequence[AgentWitness | DirectAgentWitness] = certificate.witness.agents
    agents = tuple(
        AgentProof(plant, agent, witness.steady_state, witness.ell, (lo, hi), v).prove(claim)
        for agent, claim, witness in zip(plant.agents, certificate.claim.agents, witnesses, strict=True)
    )
    v_at_start = {name: between(*box) for name, box in plant.exosystem.items()}
    return Facts(r, costs, between(lo, hi), slopes, v, v_at_start, agents)


def prove_network(plant: Plant, r: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """A2: all agents reach and are reached by the first, so that ``rᵀL = 0``, ``Σ r = 1`` has one solution: ``r``."""
    L = plant.laplacian
    if len(r) != len(L):
        raise Malformed("the left null vector has the wrong length")
    require(_all_reached(L) and _all_reached(linear.transpose(L)), "A2: strongly connected")
    sums = [Fraction(0)] * len(r)
    for weight, row in zip(r, L, strict=True):
        for j, entry in enumerate(row):
            if entry:
                spend(1 + (weight.denominator.bit_length() // 64) ** 2)
                sums[j] += weight * entry
    require(min(r) > 0 and not any(sums) and sum(r) == 1, "A2: rᵀL = 0, Σ r = 1, r > 0", r=r)
    return tuple(r)


def _all_reached(L: Matrix) -> bool:
    reached, pending = {0}, [0]
    while pending:
        i = pending.pop()
        new = {j for j, entry in enumerate(L[i]) if entry < 0} - reached
        reached |= new
        pending += new
    return len(reached) == len(L)


def _exosystem(plant: Plant, certificate: Certificate) -> dict[str, Interval]:
    """A4 with the certificate's ``Q``."""
    given = certificate.witness.exosystem
    Q = given.Q if given else None
    if not plant.exosystem:
        if Q is not None:
            raise Malformed("exosystem: there is none")
        return {}
    if Q is None or len(Q) != len(plant.exosystem):
        raise Malformed(f"exosystem: a {len(plant.exosystem)}×{len(plant.exosystem)} matrix is needed")
    return prove_exosystem(plant, Q)


def prove_exosystem(plant: Plant, Q: Matrix) -> dict[str, Interval]:
    """A4: ``Q ≻ 0`` with ``SᵀQ + QS = 0``. Returns ``|v_k(t)| ≤ √((Q⁻¹)_kk max vᵀQv)``."""
    require(plant.S is not None, "A4: S is rational")
    require(linear.is_positive_definite(Q), "A4: Q ≻ 0", Q=Q)
    QS = linear.product(Q, plant.S or [])
    residual = linear.combine(1, QS, 1, linear.transpose(QS))
    require(not any(map(any, residual)), "A4: SᵀQ + QS = 0", residual=residual)
    energy = quadratic_bound(Q, [between(*box) for box in plant.exosystem.values()])
    inverse = linear.inverse(Q)
    return {name: symmetric((energy * inverse[k][k]).sqrt()) for k, name in enumerate(plant.exosystem)}


class AgentProof:
    """A0, A3, A5 of one agent, as identities between rational functions of ``s, v, w``."""

    def __init__(
        self,
        plant: Plant,
        agent: Agent,
        steady_state: Sequence[str | Root],
        ell: Sequence[Fraction],
        optimum: tuple[Fraction, Fraction],
        v: Mapping[str, Interval],
    ) -> None:
        self.agent, self.ell, self.v = agent, ell, v
        self.point = optimum[0] if optimum[0] == optimum[1] else None
        self.optimum = between(*optimum)
        self.name = f"agent {agent.id}"
        self.w = {name: between(*box) for name, box in agent.parameters.items()}
        self.algebra = Algebra()
        known = ("s", *v, *self.w)
        zeros = zip(agent.zero_states, steady_state, strict=False)  # by a name that no plant file can declare
        self.roots = {f"{z}*": (z, root) for z, root in zeros if isinstance(root, Root)}
        self.constants = {**self.w, **{name: bracket(root) for name, (_, root) in self.roots.items()}}
        self.symbols = {name: variable(name) for name in (*known, *self.roots)}
        states = [self.symbols[name] for name in v]
        self.exosystem = {
            name: sum((x * constant(entry) for x, entry in zip(states, row, strict=True)), ZERO)
            for name, row in zip(v, plant.S or [], strict=True)
        }
        names = {name: Name(name) for name in known}
        self.nodes = [
            Name(f"{z}*") if isinstance(entry, Root) else parse(entry, names)
            for z, entry in zip(agent.zero_states, steady_state, strict=False)
        ]

    def prove(self, claim: AgentClaim) -> AgentFacts:
        b = self.origin_and_input_gain()
        self.regulator()
        self.immersion()
        with obligation(f"{self.name}: A5"):
            return AgentFacts(
                self.w,
                b,
                self.transformation(claim),
                self.steady_state,
                self.tau,
                self.steady_input,
                self.nodes,
                {name: self.constants[name] for name in self.roots},
            )

    def identity(self, value: Rational, name: str) -> None:
        require(self.algebra.vanishes(value), f"{self.name}: {name}", terms_left=len(value.top.terms))

    def range(self, node: Node, v: Mapping[str, Interval], cuts: int) -> Interval:
        """Exact enough as it is along a name that occurs but once: the others are cut."""
        box, count = {"s": self.optimum, **v, **self.constants}, Counter(occurrences(node))
        repeated = [name for name in count if count[name] > 1]
        return value_range(lambda piece: evaluate(node, piece, enclose, functions.call), box, repeated, cuts)

    def steady_state(self, v: Mapping[str, Interval], cuts: int) -> list[Interval]:
        """``[z*]``; that it can be enclosed proves that its denominators do not vanish."""
        return [self.range(node, v, cuts) for node in self.nodes]

    def tau(self, v: Mapping[str, Interval], cuts: int) -> list[Interval]:
        """``τ = (u*, L_S u*, …)``."""
        box = {"s": self.optimum, **v, **self.constants}
        tau = [value_range(partial(self.algebra.enclosure, u), box, self.algebra.leaves(u), cuts) for u in self.inputs]
        if not tau:
            return tau
        try:  # as it is written u* is narrower than in the algebra where that has exp for tanh
            written = value_range(self.input_as_written, box, box.keys(), cuts)
        except Undecided:
            return tau
        return [hull(max(tau[0].lower, written.lower), min(tau[0].upper, written.upper)), *tau[1:]]

    def input_as_written(self, box: Mapping[str, Interval]) -> Interval:
        """``−f1(z*, s, 0, v, w)/b(w)`` by the expressions of the plant file."""
        zero = Interval(0, 0)
        values = {**box, **dict.fromkeys(self.agent.chain, zero), "x1": box["s"]}
        for name, node in zip(self.agent.zero_states, self.nodes, strict=True):
            values[name] = evaluate(node, box, enclose, functions.call)
        f, b = (evaluate(node, values, enclose, functions.call) for node in (self.agent.f, self.agent.b))
        return -(f / b)

    def steady_input(self, W: Sequence[Sequence[Interval]]) -> Interval:
        """``|u*| ≤ |u*(s*, 0, w)| + √(Σ_jk |W_jk| ĝ_j ĝ_k)`` with ``ĝ ≥ |∂u*/∂v|``, or by its range if that is less."""
        if not self.inputs:
            return ZERO_INPUT
        u, box = self.inputs[0], {"s": self.optimum, **self.v, **self.constants}
        slopes, leaves = [self.algebra.derivative(u, name) for name in self.v], self.algebra.leaves(u)
        at_rest = dict.fromkeys(self.v, ZERO_INPUT)

        def size(piece: Mapping[str, Interval]) -> Interval:
            g = [self.algebra.enclosure(slope, piece).magnitude for slope in slopes]
            square = total(w * a * b for row, a in zip(W, g, strict=True) for w, b in zip(row, g, strict=True))
            return self.algebra.enclosure(u, {**piece, **at_rest}).magnitude + square.upper.sqrt()

        around = supremum(size, box, leaves - self.v.keys())
        straight = value_range(partial(self.algebra.enclosure, u), box, leaves, CUTS).magnitude
        return min(enclose(around).upper, straight)

    def origin_and_input_gain(self) -> Interval:
        """A0: ``f0(0, 0, 0, w) = 0``, ``f1(0, 0, 0, w) = 0``, ``b > 0``. Returns ``[b]``."""
        zeros = dict.fromkeys((*self.agent.zero_states, *self.agent.chain, *self.v), ZERO)
        with obligation(f"{self.name}: A0"):
            for node in (*self.agent.zero_dynamics, self.agent.f):
                self.identity(self.algebra.read(node, {**self.symbols, **zeros}), "A0: f(0, 0, 0, w) = 0")
            b = self.range(self.agent.b, {}, CUTS)
        require(b > 0, f"{self.name}: A0: b > 0", b=b)
        return b

    def steady_states(self, s: Rational) -> dict[str, Rational]:
        """``s, v, w`` and ``z = z*(s, v, w)``, ``x = (s, 0, …, 0)``."""
        values = {**self.symbols, "s": s}
        z = [self.algebra.read(node, values) for node in self.nodes]
        chain = dict.fromkeys(self.agent.chain, ZERO)
        return {**values, **chain, "x1": s, **dict(zip(self.agent.zero_states, z, strict=True))}

    def regulator(self) -> None:
        """A3: ``∂z*/∂v·S v = f0(z*, s, v, w)`` and ``z*(0, 0, w) = 0``."""
        with obligation(f"{self.name}: A3"):
            for node in self.nodes:
                if isinstance(node, Name) and node.name in self.roots:
                    continue
                at_zero = self.algebra.read(node, {**self.symbols, **dict.fromkeys(("s", *self.v), ZERO)})
                self.identity(at_zero, "A3: z*(0, 0, w) = 0")
            values = self.steady_states(self.symbols["s"])
            for name, f0 in zip(self.agent.zero_states, self.agent.zero_dynamics, strict=True):
                if f"{name}*" in self.roots:
                    prove_root(self.name, name, f0, self.roots[f"{name}*"][1], self.optimum, self.w)
                    continue
                speed = self.algebra.lie_derivative(values[name], self.exosystem)
                self.identity(speed - self.algebra.read(f0, values), "A3: ∂z*/∂v·S v = f0(z*, s, v, w)")

    def immersion(self) -> None:
        """A5: ``L_S^s u* = Σ ℓ_k L_S^(k−1) u*``."""
        with obligation(f"{self.name}: A5"):
            values = self.steady_states(self.symbols["s"] if self.point is None else constant(self.point))
            u = -self.algebra.read(self.agent.f, values) / self.algebra.read(self.agent.b, values)
            residual, self.inputs = ZERO, []
            for coefficient in self.ell:
                self.inputs.append(u.reduced())
                residual = residual - u * constant(coefficient)
                u = self.algebra.lie_derivative(u, self.exosystem)
            self.identity(residual + u, "A5: L_S^s u* = Σ ℓ_k L_S^(k−1) u*")

    def transformation(self, claim: AgentClaim) -> Matrix:
        """``T`` with ``TΦ − MT = NΓ`` and ``ΨT = Γ``: the inverse of the observability matrix of ``(Ψ, M + NΨ)``."""
        M, N, psi, ell = claim.M, claim.N, claim.psi, self.ell
        s = len(ell)
        if not s:
            return []
        F = linear.combine(1, M, 1, [[n * p for p in psi] for n in N])
        rows = [list(psi)]
        while len(rows) < s:
            rows.append([linear.dot(rows[-1], column) for column in linear.transpose(F)])
        T = linear.inverse(rows)
        phi = [*linear.identity(s)[1:], list(ell)]
        gamma = linear.identity(s)[0]
        residual = linear.combine(1, linear.product(T, phi), -1, linear.product(M, T))
        require(
            residual == [[n * entry for entry in gamma] for n in N],
            f"{self.name}: A5: TΦ − MT = NΓ, Ψ = ΓT⁻¹",
            residual=residual,
        )
        return T
