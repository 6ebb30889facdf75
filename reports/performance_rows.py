"""Asked, proved, simulated: one table of the performance, for the PDF, the interactive page and the files."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Literal

import numpy as np

from certify.statement.bandwidth import observer_bandwidth
from certify.statement.bounds import AgentBounds, ProvedBounds
from certify.statement.claim import AgentClaim, CertifiedGains
from certify.statement.numbers import floor_log10
from symbolic.plant import Plant, Requirements

if TYPE_CHECKING:
    from sims.closed_loop import Trajectory

EACH_UP_TO = 12  # agents with a row of their own per requirement; of more, those with the same one share a row
SHARE = 100  # a band that nobody asked for is about a hundredth of the largest first bound

Quantity = Literal["error", "settling", "input", "pole"]


@dataclass(frozen=True)
class PerformanceRow:
    """One quantity of one agent, or the worst over several.

    ``error`` is ``max |y − s*|``, ``settling`` the time after which ``|y − s*| ≤ band``, ``input`` is ``max |u|``,
    ``pole`` the fastest observer pole (radians per unit of time). ``asked`` and ``proved`` are exact and ``None`` where
    there is nothing; ``seen`` is a float that nothing proves: over the runs, NaN without any, for ``pole`` computed.
    """

    agents: tuple[int, ...]
    quantity: Quantity
    band: Fraction | None
    asked: Fraction | None
    proved: Fraction | None
    seen: float


def performance_rows(
    found: ProvedBounds, certified: CertifiedGains, plant: Plant, runs: Sequence[Trajectory]
) -> list[PerformanceRow]:
    """What is asked, agent by agent where they are few, and then the worst over the agents that nothing is asked of."""
    band = usual_band(found)
    each = [
        row
        for agent, claim in zip(found.agents, certified.agents, strict=True)
        for row in _rows(agent, claim, plant.requirements_of(agent.id), runs, band)
    ]
    few = len(found.agents) <= EACH_UP_TO
    groups: dict[tuple[object, ...], list[PerformanceRow]] = {}
    for row in each:
        own = row.agents if few and row.asked is not None else ()
        groups.setdefault((row.asked is None, own, row.quantity, row.band, row.asked), []).append(row)
    return [_worst(groups[key]) for key in sorted(groups, key=lambda key: key[0] is True)]


def usual_band(found: ProvedBounds) -> Fraction:
    """The largest power of ten that is at most a hundredth of the largest bound of ``|y − s*|``: no unit matters."""
    peak = max(agent.error.peak for agent in found.agents) / SHARE
    return Fraction(10) ** floor_log10(peak) if peak > 0 else Fraction(1)


def _rows(
    agent: AgentBounds, claim: AgentClaim, asked: Requirements, runs: Sequence[Trajectory], band: Fraction
) -> Iterator[PerformanceRow]:
    """All quantities of one agent. What is asked is an obligation of the checker, so it is proved at the least."""
    who, error = (agent.id,), agent.error
    seen = _largest(runs, lambda run: float(np.nanmax(run.error[agent.id - 1])))
    yield PerformanceRow(who, "error", None, None, error.peak, seen)
    time = None if asked.settling is None else asked.settling.time
    band = band if asked.settling is None else asked.settling.band
    seen = _largest(runs, lambda run: settled(run, agent.id, band))
    yield PerformanceRow(who, "settling", band, time, _least(error.settled(band), time), seen)
    seen = _largest(runs, lambda run: float(np.nanmax(np.abs(run.agents[agent.id - 1].u))))
    yield PerformanceRow(who, "input", None, asked.input, _least(agent.input.peak, asked.input), seen)
    if claim.h is not None and claim.observer:
        pole = observer_bandwidth(claim.observer, claim.h).fastest
        yield PerformanceRow(who, "pole", None, asked.bandwidth, asked.bandwidth, pole)


def _worst(rows: Sequence[PerformanceRow]) -> PerformanceRow:
    proved = [row.proved for row in rows if row.proved is not None]
    return PerformanceRow(
        tuple(agent for row in rows for agent in row.agents),
        quantity=rows[0].quantity,
        band=rows[0].band,
        asked=rows[0].asked,
        proved=max(proved) if proved else None,
        seen=max(row.seen for row in rows),
    )


def settled(run: Trajectory, agent: int, band: Fraction) -> float:
    """The last sample at which the run is outside the band."""
    late = np.flatnonzero(run.error[agent - 1] > float(band))
    return float(run.t[late[-1]]) if late.size else 0.0


def _least(proved: Fraction, asked: Fraction | None) -> Fraction:
    return proved if asked is None else min(proved, asked)


def _largest(runs: Sequence[Trajectory], seen: Callable[[Trajectory], float]) -> float:
    return max((seen(run) for run in runs), default=math.nan)
