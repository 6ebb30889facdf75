"""What a certificate says, for display. Nothing in it is trusted: what cannot be read is not shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from certify.certificate import claim_digest
from certify.checker.certificate import CoordinatorWitness, coordinator_witness
from certify.routes import route_of_theorem
from certify.statement.exact_numbers import Matrix, Row, exact, exact_matrix, exact_row
from certify.statement.numbers import floor_log10
from certify.statement.tube import Tube, tube
from symbolic.controller import COORDINATOR_KEYS, Controller, CoordinatorGains
from symbolic.plant import Interval, Requirements, Settling

SIMULABLE_UP_TO = 9
NOTHING_ASKED = Requirements()
MATRICES = ("V0", "P1", "P2", "P3")


@dataclass(frozen=True)
class AgentClaim:
    """Gains of the claim and matrices of the witness of one agent; ``observer``, ``psi``, ``N``, ``tube`` and the
    ``requirements`` are there where the route proves a tube.

    ``level`` is that of the Lyapunov function, or the largest bound of ``ϑ̃`` from ``T1`` on; ``rate`` the tube's at
    last.
    """

    id: int
    g: Fraction
    K: Fraction
    delta: Fraction
    h: Fraction | None
    level: Fraction | None
    matrices: Mapping[str, Matrix]
    rate: Fraction | None = None
    observer: tuple[Fraction, ...] = ()
    psi: Row = ()
    N: Row = ()
    tube: Tube | None = None
    requirements: Requirements = NOTHING_ASKED


@dataclass(frozen=True)
class CertifiedGains:
    """The claim's gains, in the order of the agents, and what its coordinator's norm was proved with.

    ``norm`` holds the rates, the ``end`` of the grid and its ``steps``; ``P`` is empty where the norm is structured.
    ``route`` is the name of the route whose theorem the certificate names.
    """

    route: str
    coordinator: CoordinatorGains
    agents: tuple[AgentClaim, ...]
    norm: Mapping[str, Fraction]
    P: Matrix
    sha256: str
    optimum: Interval
    left_null_vector: Row
    coordinator_witness: CoordinatorWitness

    @property
    def largest_exponent(self) -> int:
        """``⌊log₁₀⌋`` of the largest gain."""
        return max(
            floor_log10(gain) for agent in self.agents for gain in (agent.g, agent.K, agent.delta, agent.h) if gain
        )

    @property
    def has_tubes(self) -> bool:
        """Whether bounds in time are known for every agent."""
        return all(agent.tube is not None for agent in self.agents)

    @property
    def too_large(self) -> bool:
        """Whether some gain is beyond what a simulation in floats can follow."""
        return self.largest_exponent > SIMULABLE_UP_TO

    def same_as(self, controller: Controller) -> bool:
        """Whether a controller has exactly these gains."""
        mine = [(agent.g, agent.K, agent.delta, agent.h) for agent in self.agents]
        theirs = [(law.g, law.K, law.delta, law.h) for law in controller.agents]
        return (self.coordinator, mine) == (controller.coordinator, theirs)


def certified_gains(certificate: Mapping[str, Any] | None) -> CertifiedGains | None:
    """Claim and witnesses as exact numbers; ``None`` without a certificate or if it is not of the documented shape."""
    if certificate is None:
        return None
    try:
        return _read(certificate)
    except (ArithmeticError, IndexError, KeyError, TypeError, ValueError):
        return None


def _read(certificate: Mapping[str, Any]) -> CertifiedGains:
    claim, witness = certificate["claim"], certificate["witness"]
    witnesses = {entry["id"]: entry for entry in witness["agents"]}
    route = route_of_theorem(certificate.get("theorem"))
    if route is None:
        raise ValueError("no route has this theorem")
    view = _VIEWS[route.name]
    coordinator = witness["coordinator"]
    return CertifiedGains(
        route=route.name,
        coordinator=CoordinatorGains(**{key: exact(claim[key]) for key in COORDINATOR_KEYS}),
        agents=tuple(view(_gains(entry), entry, witnesses[entry["id"]]) for entry in claim["agents"]),
        norm=_norm(coordinator),
        P=exact_matrix(coordinator["P"]) if "P" in coordinator else (),
        sha256=claim_digest(dict(certificate)),
        optimum=Interval(*exact_row(witness["optimum"])),
        left_null_vector=exact_row(witness["left_null_vector"]),
        coordinator_witness=coordinator_witness(coordinator),
    )


def _norm(coordinator: Mapping[str, Any]) -> dict[str, Fraction]:
    rates = {key: exact(coordinator[key]) for key in ("rate", "mixing_rate")}
    if "times" in coordinator:
        return {**rates, "end": exact(coordinator["times"][-1]), "steps": Fraction(len(coordinator["curve"]))}
    return {
        **rates,
        "end": exact(coordinator["step"]) * exact(coordinator["steps"]),
        "steps": exact(coordinator["steps"]),
    }


def _gains(claim: Mapping[str, Any]) -> AgentClaim:
    h = claim["h"]
    return AgentClaim(
        id=int(exact(claim["id"])),
        g=exact(claim["g"]),
        K=exact(claim["K"]),
        delta=exact(claim["delta"]),
        h=None if h is None else exact(h),
        level=None,
        matrices={},
    )


def _with_matrices(found: AgentClaim, claim: Mapping[str, Any], witness: Mapping[str, Any]) -> AgentClaim:
    matrices = {name: exact_matrix(witness[name]) for name in MATRICES}
    return replace(found, level=exact(witness["level"]), matrices=matrices)


def _with_tube(found: AgentClaim, claim: Mapping[str, Any], witness: Mapping[str, Any]) -> AgentClaim:
    boxes, psi, N = tube(witness), exact_row(claim["psi"]), exact_row(claim["N"])
    if (
        not len(psi) == len(N) == len(witness["ell"])
        or boxes.plant_states != len(witness["steady_state"]) + len(claim["gamma"]) + 1
    ):
        raise ValueError("claim and witness do not fit")
    return replace(
        found,
        level=boxes.peak(boxes.plant_states),
        rate=boxes.tail_rate,
        observer=exact_row(claim["observer"]),
        psi=psi,
        N=N,
        tube=boxes,
        requirements=_requirements(claim["requirements"]),
    )


def _requirements(claimed: Mapping[str, Any]) -> Requirements:
    settling, limit, bandwidth = (claimed[key] for key in ("settling", "input", "bandwidth"))
    return Requirements(
        None if settling is None else Settling(exact(settling["time"]), exact(settling["band"])),
        None if limit is None else exact(limit),
        None if bandwidth is None else exact(bandwidth),
    )


_VIEWS = {"recipe": _with_matrices, "direct": _with_tube}  # how the witness of a route is read for display
