"""The gains a plant file asks for, as a controller whose linearised loop can be judged."""

from __future__ import annotations

from fractions import Fraction

from symbolic.controller import AgentController
from symbolic.derived import AgentDerivation
from symbolic.internal_model import InternalModel
from symbolic.plant import RequestedGains

UNSATURATED = Fraction(1)
LEAST_G = Fraction(1)


def requested_controller(derived: AgentDerivation, gains: RequestedGains) -> AgentController | None:
    """``None`` unless ``K`` and, for ``n ≥ 2``, ``h`` are fixed: otherwise no single loop is meant.

    A ``g`` that is left free is taken at 1, the least the theorem allows; ``δ`` does not enter the linearised loop.
    """
    model, order = derived.internal_model, derived.agent.order
    if gains.K is None or (order > 1 and gains.h is None) or not isinstance(model, InternalModel):
        return None
    return AgentController(
        id=derived.id,
        gamma=derived.design.gamma,
        observer=derived.design.observer,
        M=model.M,
        N=model.N,
        psi=tuple(Fraction(entry) for entry in model.psi),
        g=gains.g or LEAST_G,
        K=gains.K,
        delta=gains.delta or UNSATURATED,
        h=gains.h if order > 1 else None,
    )
