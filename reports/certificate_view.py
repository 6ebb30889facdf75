"""What a certificate says, for display. Nothing in it is trusted: what cannot be read is not shown."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.certificate import claim_digest
from reports.numbers import floor_log10
from symbolic.controller import Controller

SIMULABLE_UP_TO = 9
MATRICES = ("V0", "P1", "P2", "P3")

_NUMBER = re.compile(r"-?[0-9]{1,4000}(/[0-9]{1,4000})?")

Matrix = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class AgentClaim:
    """Gains of the claim and matrices of the witness of one agent."""

    id: int
    g: Fraction
    K: Fraction
    delta: Fraction
    h: Fraction | None
    level: Fraction | None
    matrices: Mapping[str, Matrix]


@dataclass(frozen=True)
class CertifiedGains:
    """The claim's gains, in the order of the agents, and the coordinator's matrix ``P``."""

    alpha1: Fraction
    alpha2: Fraction
    agents: tuple[AgentClaim, ...]
    P: Matrix
    coordinator: Mapping[str, Fraction]
    sha256: str

    @property
    def largest_exponent(self) -> int:
        """``⌊log₁₀⌋`` of the largest gain."""
        return max(
            floor_log10(gain) for agent in self.agents for gain in (agent.g, agent.K, agent.delta, agent.h) if gain
        )

    @property
    def too_large(self) -> bool:
        """Whether some gain is beyond what a simulation in floats can follow."""
        return self.largest_exponent > SIMULABLE_UP_TO

    def same_as(self, controller: Controller) -> bool:
        """Whether a controller has exactly these gains."""
        mine = [(agent.g, agent.K, agent.delta, agent.h) for agent in self.agents]
        theirs = [(law.g, law.K, law.delta, law.h) for law in controller.agents]
        return (self.alpha1, self.alpha2, mine) == (controller.alpha1, controller.alpha2, theirs)


def certified_gains(certificate: Mapping[str, Any] | None) -> CertifiedGains | None:
    """Claim and witnesses as exact numbers; ``None`` without a certificate or if it is not of the documented shape."""
    if certificate is None:
        return None
    try:
        return _read(certificate)
    except (ArithmeticError, KeyError, TypeError, ValueError):
        return None


def exact(text: str) -> Fraction:
    """A number of a certificate, ``p/q`` or ``p``. Raises ``ValueError`` for other notations, such as ``1e999999``."""
    if not _NUMBER.fullmatch(text):
        raise ValueError("a number is a string p or p/q")
    return Fraction(text)


def _read(certificate: Mapping[str, Any]) -> CertifiedGains:
    claim, witness = certificate["claim"], certificate["witness"]
    levels = {entry["id"]: entry for entry in witness["agents"]}
    coordinator = witness["coordinator"]
    return CertifiedGains(
        alpha1=exact(claim["alpha1"]),
        alpha2=exact(claim["alpha2"]),
        agents=tuple(_agent(entry, levels[entry["id"]]) for entry in claim["agents"]),
        P=_matrix(coordinator["P"]),
        coordinator={key: exact(coordinator[key]) for key in ("rate", "mixing_rate", "step", "steps")},
        sha256=claim_digest(dict(certificate)),
    )


def _agent(claim: Mapping[str, Any], witness: Mapping[str, Any]) -> AgentClaim:
    h = claim["h"]
    return AgentClaim(
        id=int(exact(claim["id"])),
        g=exact(claim["g"]),
        K=exact(claim["K"]),
        delta=exact(claim["delta"]),
        h=None if h is None else exact(h),
        level=exact(witness["level"]),
        matrices={name: _matrix(witness[name]) for name in MATRICES},
    )


def _matrix(rows: Sequence[Sequence[str]]) -> Matrix:
    return tuple(tuple(exact(entry) for entry in row) for row in rows)
