"""The witnesses of one agent's tube, as short rationals on the safe side (docs/certificate-direct.md)."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from certify.agent_model import AgentModel
from certify.bounds.rationals import round_down, round_up
from certify.certificate import Json, expression, number, numbers, rows
from certify.tube.peaking import STEPS
from certify.tube.trial import Trial
from symbolic.controller import AgentController

BOX_BITS = 16
KERNEL_BITS = 24


def tube_witness(model: AgentModel, trial: Trial) -> Json:
    observed, norm = model.order > 1, trial.peaked.norm
    return {
        "id": number(model.agent.id),
        "steady_state": [expression(component) for component in model.steady_state],
        "ell": numbers(model.internal_model.ell),
        "nominal": {"f0": rows(trial.nominal.f0), "f1": numbers(trial.nominal.f1), "b": number(trial.nominal.b)},
        "modes": rows(trial.modes.H),
        "blocks": [number(size) for size in trial.modes.blocks],
        "rates": [number(Fraction(float(rate))) for rate in trial.kernels.rates],
        "kernels": [[_above(pair, KERNEL_BITS) for pair in row] for row in trial.kernels.coefficients],
        "observer_norm": rows(norm.exact) if observed and norm is not None else [],
        "observer_rate": number(norm.exact_rate) if observed and norm is not None else None,
        "phase1": _phase1(trial) if observed else None,
        "grid": [number(Fraction(time)) for time in trial.tube.grid],
        "boxes": [_above(box, BOX_BITS) for box in trial.tube.boxes],
        "tail": {
            "box": _above(trial.tube.tail, BOX_BITS),
            "rate": number(round_down(Fraction(trial.tube.tail_rate), BOX_BITS)),
        },
    }


def tube_controller(model: AgentModel, trial: Trial) -> AgentController:
    im = model.internal_model
    return AgentController(
        id=model.agent.id,
        gamma=model.gamma,
        observer=model.observer if model.order > 1 else (),
        M=im.M,
        N=im.N,
        psi=im.psi,
        g=trial.gains.g,
        K=trial.gains.K,
        delta=trial.delta,
        h=trial.gains.h,
    )


def _phase1(trial: Trial) -> Json:
    duration = Fraction(trial.peaked.duration)
    return {"duration": number(duration), "steps": number(STEPS if duration else 0)}


def _above(values: Iterable[float], bits: int) -> list[str]:
    return [number(round_up(Fraction(float(value)), bits)) for value in values]
