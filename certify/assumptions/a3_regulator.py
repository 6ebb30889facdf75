"""A3: ``∂z*/∂v · S v = f0(z*, s, v, w)`` has a solution with ``z*(0, 0, w) = 0`` (theory.md section 2)."""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from certify.assumptions.findings import Finding, Json, interval_text, unless_holds
from symbolic.plant import Agent, Interval
from symbolic.steady_state import NoSteadyState, SteadyState


def check_regulator(
    agent: Agent, found: SteadyState | NoSteadyState, roots: Mapping[sympy.Symbol, Interval] | str
) -> Finding:
    """Report what ``symbolic.regulator.solve_regulator`` proved. Evidence: ``z*`` and where it comes from.

    ``roots`` encloses the components without closed form, or is the reason why they are not enclosed.
    """
    if isinstance(found, NoSteadyState):
        return Finding("A3", agent.id, unless_holds(found.verdict), found.reason, dict(found.evidence))
    if not agent.zero_states:
        return Finding("A3", agent.id, "holds", "there are no zero dynamics")
    if isinstance(roots, str):
        return Finding("A3", agent.id, "unknown", roots)
    if roots:
        sides: dict[str, Json] = {str(z): interval_text(side) for z, side in roots.items()}
        names = ", ".join(sides)
        reason = f"{names} rests at the only zero of its f0, which is enclosed"
        return Finding("A3", agent.id, "holds", reason, {"root": sides, "source": found.source})
    z_star = {str(name): str(value) for name, value in zip(agent.zero_states, found.z_star, strict=True)}
    origin = "the given z* solves it" if found.source == "user" else "z* was found"
    return Finding(
        "A3",
        agent.id,
        "holds",
        f"{origin}; the residual vanishes identically",
        {"z_star": z_star, "source": found.source},
    )
