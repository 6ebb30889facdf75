"""The closed formula for the chain of two integrators (theory.md section 7, F20)."""

from __future__ import annotations

from fractions import Fraction

from symbolic.controller import AgentController


def chain_margin(controller: AgentController, b: Fraction) -> Fraction:
    """``c1² c2 h³ − b K (c1 h + c2 g γ1)²``: the loop ``ẍ = b u`` is Hurwitz iff it is positive (all gains positive).

    Without internal model. Raises ``ValueError`` unless the controller is one for ``n = 2``.
    """
    if controller.h is None or len(controller.observer) != 2:
        raise ValueError("the formula is for a chain of two integrators with an observer")
    c1, c2 = controller.observer
    h, g, gamma1 = controller.h, controller.g, controller.gamma[0]
    return c1**2 * c2 * h**3 - b * controller.K * (c1 * h + c2 * g * gamma1) ** 2
