"""What a plant file asks of the coordinator as a whole (docs/coordinator.md)."""

from __future__ import annotations

from symbolic.controller import CoordinatorGains
from symbolic.plant import CoordinatorChoice

__all__ = ["CoordinatorGains", "starts_at_once"]


def starts_at_once(choice: CoordinatorChoice) -> bool:
    """Whether the plant file asks for references that move from ``t = 0`` on, as the paper prints them."""
    return choice.mixing_time == 0
