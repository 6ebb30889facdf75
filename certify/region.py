"""The largest initial boxes that are certified with the gains of a certificate (``certify region``).

Every box that is reported has a certificate of its own: that of a plant file which differs in ``[initial]`` alone, and
which the independent checker has verified.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from certify.certificate import Json, canonical
from certify.checker import check as independent_check
from certify.claimed import claimed_gains, claimed_network
from certify.network_certificate import network_certificate
from certify.pipeline import tool_versions
from certify.preparation import Prepared, Report, Stopped
from certify.routes import ROUTES
from certify.tube.initial_boxes import Factors, Grown, InitialBoxes, scaled
from certify.units.agents import NaturalAgent, natural_agent
from symbolic.plant import Agent, Plant
from symbolic.plant_writer import with_source

SHRINK = Fraction(63, 64)  # of a factor that the search found and the checker did not accept
ATTEMPTS = 4


@dataclass(frozen=True)
class CertifiedBox:
    """A plant that starts in larger boxes, with the certificate that the checker has verified for it; ``factors`` has
    a row of one factor per plant state (``z``, then ``x``) for each agent."""

    plant: Plant
    certificate: Json
    factors: tuple[Factors, ...]


@dataclass(frozen=True)
class CertifiedRegion:
    """``uniform`` scales all sides of an agent by one factor, ``axes[k]`` only those of the ``k``-th plant state (of
    every agent that has one); ``None`` where nothing larger than the plant file's own box was certified. ``stopped``
    says by agent what the search ran into beyond the uniform one."""

    uniform: CertifiedBox | None
    axes: tuple[CertifiedBox | None, ...]
    stopped: tuple[str, ...]


@dataclass(frozen=True)
class Growing:
    """One agent with its boxes in natural units."""

    agent: NaturalAgent
    boxes: InitialBoxes


@dataclass(frozen=True)
class NoRegion:
    """Why there is none."""

    reason: str


def certified_region(
    plant: Plant, certificate: Mapping[str, Any], report: Report = lambda message: None
) -> CertifiedRegion | NoRegion:
    """For a certificate of the direct route that the checker has verified for ``plant``."""
    route = ROUTES["direct"]
    if certificate.get("theorem") != route.theorem:
        return NoRegion(f"only certificates of {route.theorem} have a region; the gains may be certified by it again")
    claim = certificate["claim"]
    prepared = claimed_network(plant, claim, report)
    if isinstance(prepared, Stopped):
        return NoRegion(prepared.reason)
    boxes = [_boxes(prepared, index, entry) for index, entry in enumerate(claim["agents"])]
    if any(isinstance(one, str) for one in boxes):
        return NoRegion("; ".join(one for one in boxes if isinstance(one, str)))
    agents = [one for one in boxes if isinstance(one, Growing)]
    growing = [one.boxes for one in agents]
    uniform, axes, stopped = [], [], []
    for agent, one in zip(plant.agents, growing, strict=True):
        report(f"agent {agent.id}: all sides")
        largest = one.uniform()
        uniform.append(_factors(one, largest, None))
        stopped.append("" if largest is None else largest.stopped)
    for axis in range(max(len(one.wide) for one in growing)):
        row = []
        for agent, one in zip(plant.agents, growing, strict=True):
            report(f"agent {agent.id}: side {axis + 1}")
            grown = one.along(axis) if axis < len(one.wide) else None
            row.append(_factors(one, grown, axis))
        axes.append(row)
    together = Network(plant, prepared, agents, certificate["theorem"], report)
    boxes_by_axis = tuple(together.certified(row) for row in axes)
    return CertifiedRegion(together.certified(uniform), boxes_by_axis, tuple(stopped))


def _factors(boxes: InitialBoxes, grown: Grown | None, axis: int | None) -> Factors:
    factor = Fraction(1) if grown is None else grown.factor
    return tuple(factor if wide and axis in (None, k) else Fraction(1) for k, wide in enumerate(boxes.wide))


class Network:
    """Certificates of the whole network from larger boxes."""

    def __init__(
        self, plant: Plant, prepared: Prepared, boxes: Sequence[Growing], theorem: str, report: Report
    ) -> None:
        self.plant, self.prepared, self.boxes, self.theorem, self.report = plant, prepared, boxes, theorem, report

    def certified(self, factors: Sequence[Factors]) -> CertifiedBox | None:
        """With these factors or a little less, as far as the checker goes along."""
        for _ in range(ATTEMPTS):
            if all(factor == 1 for row in factors for factor in row):
                return None
            found = self._certificate(factors)
            if found is not None:
                return found
            factors = [tuple(max(factor * SHRINK, Fraction(1)) for factor in row) for row in factors]
        return None

    def _certificate(self, factors: Sequence[Factors]) -> CertifiedBox | None:
        parts = []
        for one, row in zip(self.boxes, factors, strict=True):
            trial = one.boxes.passes(row)
            if trial is None:
                return None
            parts.append(one.agent.parts(trial))
        larger = with_source(replace(self.plant, agents=tuple(map(_moved, self.plant.agents, factors))))
        found, disturbance = self.prepared.optimum, self.prepared.disturbance
        certificate = network_certificate(
            self.theorem,
            larger,
            found.enclosure,
            disturbance.Q or (),
            self.prepared.coordinator,
            parts,
            tool_versions(),
            requirements=True,
        )
        self.report("checking the certificate")
        verdict = independent_check(larger.source, canonical(certificate) + b"\n")
        if verdict.status != "verified":
            return None
        return CertifiedBox(larger, certificate, tuple(factors))


def _moved(agent: Agent, factors: Factors) -> Agent:
    return replace(agent, initial=scaled(agent.initial, factors))


def _boxes(prepared: Prepared, index: int, entry: Mapping[str, Any]) -> Growing | str:
    """Factors have no unit, so the boxes may grow in the agent's natural units."""
    agent = natural_agent(prepared, index)
    if isinstance(agent, str):
        return f"agent {index + 1}: {agent}"
    gains, delta = agent.gains(claimed_gains(entry))
    found = InitialBoxes(agent.trials, gains, delta, agent.asked)
    if found.passes((Fraction(1),) * len(found.wide)) is None:
        return f"agent {index + 1}: the search does not find the tube of the certificate again"
    return Growing(agent, found)
