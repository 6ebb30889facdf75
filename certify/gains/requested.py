"""The gains a plant file asks for, as a controller whose linearised loop can be judged."""

from __future__ import annotations

from fractions import Fraction

from symbolic.controller import AgentController
from symbolic.derived import AgentDerivation
from symbolic.internal_model import InternalModel
from symbolic.plant import RequestedGains

UNSATURATED = Fraction(1)
ANY = Fraction(1)


def requested_controller(derived: AgentDerivation, gains: RequestedGains) -> AgentController | None:
    """``None`` unless ``K`` and, for ``n ≥ 2``, ``g`` and ``h`` are fixed: otherwise no single loop is meant.

    ``δ`` does not enter the linearised loop, and for ``n = 1`` neither does ``g``: any number stands for them where
    they are left open. The design polynomials and the internal model are those of ``derived``: see ``left_open``.
    """
    model, order = derived.internal_model, derived.agent.order
    needed = (gains.K,) if order == 1 else (gains.g, gains.K, gains.h)
    if None in needed or gains.K is None or not isinstance(model, InternalModel):
        return None
    return AgentController(
        id=derived.id,
        gamma=derived.design.gamma,
        observer=derived.design.observer,
        M=model.M,
        N=model.N,
        psi=tuple(Fraction(entry) for entry in model.psi),
        g=gains.g or ANY,
        K=gains.K,
        delta=gains.delta or UNSATURATED,
        h=gains.h if order > 1 else None,
    )


def left_open(derived: AgentDerivation) -> tuple[str, ...]:
    """The keys of the plant file that the linearised loop depends on and that are the tool's choice.

    A loop that is unstable refutes the gains of a file only if there are none: another choice may be stable. Scaling
    the observer's polynomial alone is as good as another ``h``.
    """
    agent, model = derived.agent, derived.internal_model
    choices = {
        "gamma": agent.order > 1 and agent.gamma is None,
        "observer": agent.order > 1 and agent.observer is None,
        "internal_model": isinstance(model, InternalModel) and bool(model.psi) and agent.internal_model is None,
    }
    return tuple(key for key, is_open in choices.items() if is_open)
