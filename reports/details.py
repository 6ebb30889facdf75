"""What ``summary.json`` says beyond the shape of the specification: bounds, bandwidth, other gains, by agent.

Exact numbers are strings and proved; floats are estimates and stand under ``estimates``.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

from certify.statement.bandwidth import observer_bandwidth
from certify.statement.bounds import AgentBounds
from certify.statement.claim import AgentClaim
from reports.attraction import attraction_details
from reports.study import Study, conclusion

if TYPE_CHECKING:
    from certify.pipeline import GainsResult
    from certify.results import AgentResult

LEVELS = (Fraction(1), Fraction(1, 10), Fraction(1, 100), Fraction(1, 1000))

Json = dict[str, Any]


def details(study: Study) -> Json:
    """Per agent: the certified region and the observer's bandwidth, where there is a verified certificate, and the
    other gains that passed."""
    found: Json = {"agents": search_details(study.gains)}
    certified = study.certified
    if study.bounds is not None and certified is not None and conclusion(study).verified:
        found["region"] = [_region(agent) for agent in study.bounds.agents]
        found["estimates"] = [_estimates(agent) for agent in certified.agents]
    if study.slices and conclusion(study).verified:
        found["region_of_attraction"] = attraction_details(study.slices)
    return found


def search_details(gains: GainsResult | None) -> list[Json]:
    """Per agent: why its gains are the default, and the others that passed."""
    return [] if gains is None else [_choices(agent) for agent in gains.agents]


def _choices(agent: AgentResult) -> Json:
    return {
        "id": agent.id,
        "reason": agent.reason,
        "alternatives": [
            {
                "label": other.label,
                "reason": other.reason,
                **{name: _text(getattr(other.controller, name)) for name in ("g", "K", "delta", "h")},
                **{name: list(map(str, getattr(other.controller, name))) for name in ("gamma", "observer", "N")},
                "M": [list(map(str, row)) for row in other.controller.M],
            }
            for other in agent.alternatives
        ],
    }


def _region(agent: AgentBounds) -> Json:
    bound = agent.input
    return {
        "id": agent.id,
        "states": {
            str(state.state): {
                "range": [_text(state.whole.lo), _text(state.whole.hi)],
                "target": state.target,
                "distance": _text(state.distance),
                "distance_later": _text(state.later),
            }
            for state in agent.states
        },
        "error_peak": _text(agent.error.peak),
        "settled": {str(level): _text(agent.error.settled(level)) for level in LEVELS},
        "decay": _text(agent.error.decay),
        "input_peak": _text(bound.peak),
        "input_after_T1": _text(bound.after),
        "T1": _text(agent.reaching),
    }


def _estimates(agent: AgentClaim) -> Json:
    if agent.h is None or not agent.observer:
        return {"id": agent.id, "observer": None}
    found = observer_bandwidth(agent.observer, agent.h)
    return {
        "id": agent.id,
        "observer": {
            "fastest_rad_per_s": found.fastest,
            "bandwidth_hz": found.hertz,
            "sampling_hz": list(found.sampling),
        },
    }


def _text(value: Fraction | None) -> str | None:
    return None if value is None else str(value)
