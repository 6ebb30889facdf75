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
from certify.claimed import claimed_network
from certify.network_certificate import network_certificate
from certify.pipeline import tool_versions
from certify.preparation import Prepared, Report, Stopped
from certify.routes import ROUTES
from certify.statement.exact_numbers import exact
from certify.tube.certificate import tube_controller, tube_witness
from certify.tube.initial_boxes import Factors, Grown, InitialBoxes, scaled
from certify.tube.loop import LoopGains
from certify.tube.trial import AgentTrials
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
    every agent that has one); ``None`` where nothing larger than the plant file's own box was certified."""

    uniform: CertifiedBox | None
    axes: tuple[CertifiedBox | None, ...]


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
    growing = [one for one in boxes if isinstance(one, InitialBoxes)]
    uniform, axes = [], []
    for agent, one in zip(plant.agents, growing, strict=True):
        report(f"agent {agent.id}: all sides")
        uniform.append(_factors(one, one.uniform(), None))
    for axis in range(max(len(one.wide) for one in growing)):
        row = []
        for agent, one in zip(plant.agents, growing, strict=True):
            report(f"agent {agent.id}: side {axis + 1}")
            grown = one.along(axis) if axis < len(one.wide) else None
            row.append(_factors(one, grown, axis))
        axes.append(row)
    together = Network(plant, prepared, growing, certificate["theorem"], report)
    return CertifiedRegion(together.certified(uniform), tuple(together.certified(row) for row in axes))


def _factors(boxes: InitialBoxes, grown: Grown | None, axis: int | None) -> Factors:
    factor = Fraction(1) if grown is None else grown.factor
    return tuple(factor if wide and axis in (None, k) else Fraction(1) for k, wide in enumerate(boxes.wide))


class Network:
    """Certificates of the whole network from larger boxes."""

    def __init__(
        self, plant: Plant, prepared: Prepared, boxes: Sequence[InitialBoxes], theorem: str, report: Report
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
        trials = [boxes.passes(row) for boxes, row in zip(self.boxes, factors, strict=True)]
        if any(trial is None for trial in trials):
            return None
        larger = with_source(replace(self.plant, agents=tuple(map(_moved, self.plant.agents, factors))))
        parts = [(tube_controller(trial), tube_witness(trial)) for trial in trials if trial is not None]
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


def _boxes(prepared: Prepared, index: int, entry: Mapping[str, Any]) -> InitialBoxes | str:
    model = prepared.models[index]
    if isinstance(model, str):
        return f"agent {index + 1}: {model}"
    h = None if entry["h"] is None else exact(entry["h"])
    gains, asked = LoopGains(exact(entry["g"]), exact(entry["K"]), h), prepared.plant.requirements_of(index + 1)
    trials = AgentTrials(model, prepared.coordinator.envelope, index)
    found = InitialBoxes(trials, gains, exact(entry["delta"]), asked)
    if found.passes((Fraction(1),) * len(found.wide)) is None:
        return f"agent {index + 1}: the search does not find the tube of the certificate again"
    return found
