"""A5: ``u*(s*, v, w) = −f1(z*, s*, 0, v, w)/b(w)`` is a polynomial in ``v`` (paper, Assumption 5)."""

from __future__ import annotations

from certify.assumptions.findings import Finding, Json, unless_holds
from symbolic.internal_model import InternalModel, NoInternalModel
from symbolic.plant import Agent
from symbolic.steady_state import SteadyState


def check_steady_input(agent: Agent, steady_state: SteadyState, found: InternalModel | NoInternalModel) -> Finding:
    """Report what ``symbolic.internal_model`` proved. Evidence: ``u*``, the least order ``s_i`` and ``ℓ``."""
    u_star = str(steady_state.u_star)
    if isinstance(found, NoInternalModel):
        verdict = unless_holds(found.verdict)
        return Finding("A5", agent.id, verdict, found.reason, {"u_star": u_star, **found.evidence})
    if found.order == 0:
        return Finding(
            "A5", agent.id, "holds", "u* vanishes; no internal model is needed", {"u_star": u_star, "order": 0}
        )
    return _generated(agent, u_star, found)


def _generated(agent: Agent, u_star: str, model: InternalModel) -> Finding:
    evidence: dict[str, Json] = {
        "u_star": u_star,
        "order": model.order,
        "ell": [str(entry) for entry in model.ell],
        "characteristic_polynomial": str(model.characteristic),
    }
    if model.spectrum == "fails":
        reason = "the generator of u* has eigenvalues that S cannot produce"
        return Finding("A5", agent.id, "unknown", reason, evidence)
    reason = f"u* is a polynomial in v; it satisfies a linear differential equation of order {model.order}"
    return Finding("A5", agent.id, "holds", reason, evidence)
