"""The witnesses of one agent's tube, as short rationals on the safe side (docs/certificate-direct.md)."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from certify.bounds.rationals import round_down, round_up
from certify.certificate import Json, number, numbers, rows, steady_state
from certify.tube.trial import Trial
from symbolic.controller import AgentController

BOX_BITS = 22
KERNEL_BITS = 24
VARTHETA_BITS = 32


def tube_witness(trial: Trial) -> Json:
    model, reached, tube = trial.model, trial.reached, trial.tube
    return {
        "id": number(model.agent.id),
        "steady_state": steady_state(model.steady_state, model.roots),
        "ell": numbers(model.internal_model.ell),
        "nominal": {"f0": rows(trial.nominal.f0), "f1": numbers(trial.nominal.f1), "b": number(trial.nominal.b)},
        "modes": rows(trial.modes.H),
        "blocks": [number(size) for size in trial.modes.blocks],
        "rates": [number(Fraction(float(rate))) for rate in trial.kernels.rates],
        "kernels": [[_above(pair, KERNEL_BITS) for pair in row] for row in trial.kernels.coefficients],
        "phase1": {
            "grid": [number(Fraction(time)) for time in reached.grid],
            "boxes": [_above(box.flat, BOX_BITS) for box in reached.boxes],
            "vartheta": _above(reached.vartheta, VARTHETA_BITS),
        },
        "grid": [number(Fraction(time)) for time in tube.grid],
        "boxes": [_above(box, BOX_BITS) for box in tube.boxes],
        "ranges": [[numbers(map(Fraction, side)) for side in known] for known in reached.ranges + tube.ranges],
        "tail": {
            "box": _above(tube.tail, BOX_BITS),
            "rate": number(round_down(Fraction(tube.tail_rate), BOX_BITS)),
        },
    }


def tube_controller(trial: Trial) -> AgentController:
    model, im = trial.model, trial.model.internal_model
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


def _above(values: Iterable[float], bits: int) -> list[str]:
    return [number(round_up(Fraction(float(value)), bits)) for value in values]
