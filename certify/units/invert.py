"""Results of an agent that was searched in other units, in those of its plant file again (docs/units.md section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from certify.agent_model import AgentModel
from certify.certificate import Json, number, steady_state
from certify.results import AgentResult, Alternative
from certify.units.scales import ONE, Row, Scales
from symbolic.controller import AgentController


def controller_back(controller: AgentController, scales: Scales) -> AgentController:
    return replace(
        controller,
        M=tuple(tuple(entry * scales.rate for entry in row) for row in controller.M),
        N=tuple(entry * scales.rate for entry in controller.N),
        g=controller.g * scales.rate,
        K=controller.K * scales.K,
        delta=controller.delta * scales.input,
        h=None if controller.h is None else controller.h * scales.rate,
    )


def result_back(result: AgentResult, scales: Scales) -> AgentResult:
    """Thresholds, bounds and alternatives of the direct route; reasons are already written in the user's units."""
    units = {
        "g": scales.rate,
        "K": scales.K,
        "delta": scales.input,
        "rate": scales.rate,
        "T": scales.time,
        "h": scales.rate,
        "level": scales.last,
    }
    bounds = zip(result.bounds.items(), scales.outputs, strict=False)
    return replace(
        result,
        thresholds={key: value * units[key] for key, value in result.thresholds.items()},
        bounds={key: value * scale for (key, value), scale in bounds},
        alternatives=tuple(
            Alternative(one.label, one.reason, controller_back(one.controller, scales)) for one in result.alternatives
        ),
    )


def witness_back(witness: Json, user: AgentModel, scales: Scales) -> Json:
    """The witness of docs/certificate-direct.md, every number of it; ``user`` is the same agent in its own units."""
    internal, time, input = user.internal_model.order, scales.time, scales.input
    states, outputs, columns = scales.states(internal), scales.outputs, scales.columns(internal)
    phase1, nominal = (*scales.phase1, *(input,) * internal), witness["nominal"]
    moved = (*scales.zeros, *scales.chain)
    return {
        **witness,
        "steady_state": steady_state(user.steady_state, user.roots),
        "ell": [number(entry) for entry in user.internal_model.ell],
        "nominal": {
            "f0": [
                _row(row, [z / time / x for x in moved]) for row, z in zip(nominal["f0"], scales.zeros, strict=True)
            ],
            "f1": _row(nominal["f1"], [scales.force / x for x in moved]),
            "b": _number(nominal["b"], scales.b),
        },
        "modes": [_row(row, [scale] * len(row)) for row, scale in zip(witness["modes"], states, strict=True)],
        "rates": _row(witness["rates"], [scales.rate] * len(witness["rates"])),
        "kernels": [
            [_row(c, [of / by] * len(c)) for c, by in zip(row, columns, strict=True)]
            for row, of in zip(witness["kernels"], outputs, strict=True)
        ],
        "phase1": {
            "grid": _times(witness["phase1"]["grid"], time),
            "boxes": [_row(box, phase1) for box in witness["phase1"]["boxes"]],
            "vartheta": _times(witness["phase1"]["vartheta"], scales.last),
        },
        "grid": _times(witness["grid"], time),
        "boxes": [_row(box, outputs) for box in witness["boxes"]],
        "ranges": [
            [_times(side, z) for side, z in zip(known, scales.zeros, strict=True)] for known in witness["ranges"]
        ],
        "tail": {
            "box": _row(witness["tail"]["box"], outputs),
            "rate": _number(witness["tail"]["rate"], scales.rate),
        },
    }


def _times(entries: Sequence[str], scale: Fraction) -> list[str]:
    return _row(entries, [scale] * len(entries))


def _row(entries: Sequence[str], scales: Row | Sequence[Fraction]) -> list[str]:
    """As many as there are entries: a row of ``f0`` ends with ``x_1``."""
    return [_number(entry, scale) for entry, scale in zip(entries, scales, strict=False)]


def _number(entry: str, scale: Fraction) -> str:
    return entry if scale == ONE else number(Fraction(entry) * scale)
