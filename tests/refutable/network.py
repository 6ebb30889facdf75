"""Random plant files, healthy unless a part is replaced on purpose."""

from __future__ import annotations

import json
import random
from dataclasses import dataclass, field
from fractions import Fraction


def number(rng: random.Random, lo: int = 1, hi: int = 9) -> Fraction:
    return Fraction(rng.randint(lo, hi), rng.randint(1, 6))


@dataclass
class AgentTable:
    """One [[agent]] table; every value as the expression it is written as."""

    order: int = 1
    f: str = "0"
    b: str = "1"
    cost: str = "s^2/2"
    zero_dynamics: dict[str, str] = field(default_factory=dict)
    uncertain: dict[str, tuple[str, str]] = field(default_factory=dict)
    more: list[str] = field(default_factory=list)

    def text(self, number: int) -> str:
        lines = [
            "[[agent]]",
            f"ids = [{number}]",
            f"order = {self.order}",
            f"f = {json.dumps(self.f)}",
            f"b = {json.dumps(self.b)}",
            f"cost = {json.dumps(self.cost)}",
        ]
        if self.zero_dynamics:
            lines.append(f"zero_dynamics = {_table(self.zero_dynamics)}")
        if self.uncertain:
            boxes = ", ".join(f"{name} = {json.dumps(list(box))}" for name, box in self.uncertain.items())
            lines.append(f"uncertain = {{ {boxes} }}")
        return "\n".join(lines + self.more) + "\n"


@dataclass
class Network:
    """A plant file in parts. ``edges`` are triples source, target, weight."""

    agents: list[AgentTable]
    edges: list[tuple[int, int, Fraction]]
    S: list[list[Fraction]] = field(default_factory=list)
    v0: list[str] = field(default_factory=list)
    box: tuple[str, str] = ("-1", "1")
    z_box: tuple[str, str] | None = None
    reference: str = "0"
    more: list[str] = field(default_factory=list)

    def text(self) -> str:
        edges = json.dumps([[f"{source} -> {target}", str(weight)] for source, target, weight in self.edges])
        parts = [
            'schema = "consensus-plant/1"',
            'name = "refutable"',
            "[network]",
            f"agents = {len(self.agents)}",
            f"edges = {edges}",
        ]
        if self.S:
            names = [f"v{k}" for k in range(1, len(self.S) + 1)]
            rows = json.dumps([[str(entry) for entry in row] for row in self.S])
            initial = ", ".join(f"{name} = {value}" for name, value in zip(names, self.v0, strict=True))
            parts += ["[exosystem]", f"states = {json.dumps(names)}", f"S = {rows}", f"initial = {{ {initial} }}"]
        parts += [
            "[initial]",
            f"box = {json.dumps(list(self.box))}",
            f"reference = {self.reference}",
            "observer = 0",
            "eta = 0",
        ]
        if self.z_box:
            parts.append(f"z = {json.dumps(list(self.z_box))}")
        parts += [agent.text(k) for k, agent in enumerate(self.agents, 1)]
        return "\n".join(parts + self.more) + "\n"


def healthy(rng: random.Random, least: int = 1, most: int = 4) -> Network:
    """A strongly connected network of first- and second-order agents with quadratic costs and stable zero dynamics."""
    size = rng.randint(least, most)
    agents = []
    for _ in range(size):
        order = rng.choice([1, 1, 2])
        agent = AgentTable(
            order=order,
            f=f"p*x{order}",
            cost=f"(s - ({number(rng, -9)}))^2/{rng.randint(1, 4)}",
            uncertain={"p": ("-1", "1")},
        )
        if rng.random() < 0.4:
            agent.zero_dynamics = {"z1": f"-{number(rng)}*z1 + x1"}
            agent.f += " + z1"
        agents.append(agent)
    return Network(agents, ring(rng, size))


def ring(rng: random.Random, size: int) -> list[tuple[int, int, Fraction]]:
    """A directed cycle through all agents in a random order, and chords."""
    order = rng.sample(range(1, size + 1), size)
    pairs = {(order[k - 1], order[k]) for k in range(size)} if size > 1 else set()
    pairs |= {(i, j) for i in order for j in order if i != j and rng.random() < 0.2}
    return [(i, j, number(rng)) for i, j in sorted(pairs)]


def oscillator(network: Network, rng: random.Random) -> None:
    """An exosystem ``v1, v2`` with rational frequency that acts on every agent."""
    omega = number(rng)
    network.S = [[Fraction(0), omega], [-omega, Fraction(0)]]
    network.v0 = ["0", "1"]
    for agent in network.agents:
        agent.f += " + v1"


def similar(rng: random.Random, J: list[list[Fraction]]) -> list[list[Fraction]]:
    """``T J T⁻¹`` with a random product ``T`` of shears, so that the structure of ``J`` is not visible."""
    n = len(J)
    A = [list(row) for row in J]
    for _ in range(2 * n):
        i, j = rng.sample(range(n), 2)
        c = Fraction(rng.randint(-3, 3), rng.randint(1, 2))
        A[i] = [x + c * y for x, y in zip(A[i], A[j], strict=True)]  # (I + c e_i e_jᵀ) A
        for row in A:
            row[j] -= c * row[i]  # … (I − c e_i e_jᵀ)
    return A


def _table(values: dict[str, str]) -> str:
    return "{ " + ", ".join(f"{name} = {json.dumps(value)}" for name, value in values.items()) + " }"
