"""The trade-off of one network: certified designs from which no one does better in settling time, input peak and
observer bandwidth at once.

The agents do not see each other, so each has a front of its own; the k-th certificate has the k-th design of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from certify.bounds.rationals import round_up
from certify.certificate import Json, canonical
from certify.checker import check as independent_check
from certify.claimed import claimed_gains, claimed_network
from certify.network_certificate import network_certificate
from certify.pipeline import tool_versions
from certify.preparation import Prepared, Report, Stopped
from certify.routes import ROUTES
from certify.tube.balance import BAND
from certify.tube.loop import LoopGains
from certify.tube.performance import Performance, Performances
from certify.tube.requirements import Wanted, largest_h
from certify.tube.trial import Trial
from certify.units.agents import NaturalAgent, natural_agent
from symbolic.controller import AgentController
from symbolic.plant import Plant

FACTORS = (1.0, 0.7, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 16.0, 22.0, 32.0)  # of K, from the gains that are certified
SPREAD = (1.0, 2.0)  # of h/K: a faster observer spares some of the saturation level
DESIGNS = 12  # of each agent
DIGITS = 2
BITS = 24

Parts = tuple[AgentController, Json]  # controller and witness in the user's units


@dataclass(frozen=True)
class Design:
    """One point of an agent's front: what its certificate proves (upper bounds, the settling time to ``band``)."""

    controller: AgentController
    settled: Fraction
    peak: Fraction
    pole: Fraction
    band: Fraction


@dataclass(frozen=True)
class Network:
    """A certificate that the checker has verified for the plant file, and the designs in it."""

    certificate: Json
    designs: tuple[Design, ...]


@dataclass(frozen=True)
class TradeOff:
    """``networks`` from the slowest and gentlest to the soonest settled."""

    networks: tuple[Network, ...]

    def of(self, index: int) -> tuple[Design, ...]:
        """The front of one agent, without repetitions."""
        return tuple(dict.fromkeys(network.designs[index] for network in self.networks))


@dataclass(frozen=True)
class NoTradeOff:
    """Why there is none."""

    reason: str


def trade_off(
    plant: Plant, certificate: Mapping[str, Any], report: Report = lambda message: None
) -> TradeOff | NoTradeOff:
    """Around a certificate of the direct route that the checker has verified for ``plant``."""
    if certificate.get("theorem") != ROUTES["direct"].theorem:
        return NoTradeOff("only certificates of the direct route have one")
    claim = certificate["claim"]
    if any(plant.gains_of(agent.id).K is not None for agent in plant.agents):
        return NoTradeOff("the plant file fixes the gains")
    prepared = claimed_network(plant, claim, report)
    if isinstance(prepared, Stopped):
        return NoTradeOff(prepared.reason)
    fronts = []
    for index, entry in enumerate(claim["agents"]):
        found = _front(prepared, index, entry, report)
        if isinstance(found, str):
            return NoTradeOff(f"agent {index + 1}: {found}")
        fronts.append(found)
    networks = []
    for place in range(max(map(len, fronts))):
        chosen = [front[min(place, len(front) - 1)] for front in fronts]
        report(f"checking design {place + 1}")
        network = _certified(plant, prepared, str(certificate["theorem"]), chosen)
        if network is not None:
            networks.append(network)
    return TradeOff(tuple(networks)) if networks else NoTradeOff("the checker accepts no other design")


def _front(
    prepared: Prepared, index: int, entry: Mapping[str, Any], report: Report
) -> list[tuple[Parts, Design]] | str:
    """From the slowest to the soonest settled; requirements of the plant file hold on all of it."""
    agent = natural_agent(prepared, index)
    if isinstance(agent, str):
        return agent
    trials = agent.trials
    performances, wanted = Performances(trials.model, trials.surroundings), Wanted(agent.asked)
    start = trials.attempt(*agent.gains(claimed_gains(entry)))
    if not isinstance(start, Trial):
        return "the search does not find the tube of the certificate again"
    passed, latest = [start], start
    for gains in _gains(start.gains, largest_h(performances, agent.asked)):
        report(f"agent {index + 1}: {trials.named(gains)}")
        found = trials.attempt(gains, agent.requested.delta, latest)
        if isinstance(found, Trial):
            passed.append(found)
            latest = found
    pairs = [(trial, performances.of(trial)) for trial in passed]
    pairs = [pair for pair in pairs if not wanted.missed(pair[1])] or pairs[:1]
    band = BAND * pairs[0][1].first_error
    best = undominated(pairs, band)
    refined = [(one, performances.of(one)) for one in map(trials.tightened, (trial for trial, _ in best))]
    best = undominated([*best, *(pair for pair in refined if not wanted.missed(pair[1]))], band)
    return [(agent.parts(trial), _design(agent, trial, found, band)) for trial, found in thinned(best, DESIGNS)]


def _gains(start: LoopGains, cap: Fraction | None) -> Iterator[LoopGains]:
    for spread in SPREAD if start.h is not None else SPREAD[:1]:
        for factor in FACTORS if spread > 1 else FACTORS[1:]:
            K = _short(start.K * Fraction(factor))
            h = None if start.h is None else _short(start.h / start.K * K * Fraction(spread))
            if h is None or cap is None or h <= cap:
                yield LoopGains(start.g, K, h)


def _short(value: Fraction) -> Fraction:
    return Fraction(f"{float(value):.{DIGITS}g}")


def _measures(found: Performance, band: float) -> tuple[float, float, float]:
    return found.settled(band), found.peak, found.pole


def undominated(pairs: Sequence[tuple[Trial, Performance]], band: float) -> list[tuple[Trial, Performance]]:
    """Those that no other beats in settling time, peak and pole; from the slowest to the soonest settled."""
    measures = [_measures(found, band) for _, found in pairs]
    kept: dict[tuple[float, float, float], tuple[Trial, Performance]] = {}
    for pair, mine in zip(pairs, measures, strict=True):
        beaten = (all(a <= b for a, b in zip(other, mine, strict=True)) and other != mine for other in measures)
        if not any(beaten):
            kept.setdefault(mine, pair)
    return [kept[measure] for measure in sorted(kept, reverse=True)]


def thinned(pairs: Sequence[tuple[Trial, Performance]], most: int) -> list[tuple[Trial, Performance]]:
    """Evenly, both ends among them."""
    if len(pairs) <= most:
        return list(pairs)
    places = sorted({round(k * (len(pairs) - 1) / (most - 1)) for k in range(most)})
    return [pairs[place] for place in places]


def _design(agent: NaturalAgent, trial: Trial, found: Performance, band: float) -> Design:
    """In the units of the plant file."""
    settled, peak, pole = (round_up(Fraction(value), BITS) for value in _measures(found, band))
    scales, (controller, _) = agent.scales, agent.parts(trial)
    own = round_up(Fraction(band), BITS) * scales.output
    return Design(controller, settled * scales.time, peak * scales.input, pole * scales.rate, own)


def _certified(
    plant: Plant, prepared: Prepared, theorem: str, chosen: Sequence[tuple[Parts, Design]]
) -> Network | None:
    parts = [parts for parts, _ in chosen]
    certificate = network_certificate(
        theorem,
        plant,
        prepared.optimum.enclosure,
        prepared.disturbance.Q or (),
        prepared.coordinator,
        parts,
        tool_versions(),
        requirements=True,
    )
    if independent_check(plant.source, canonical(certificate) + b"\n").status != "verified":
        return None
    return Network(certificate, tuple(design for _, design in chosen))
