"""The coordinator as it is certified or simulated: its constants, and its equations (docs/coordinator.md section 1)."""

from __future__ import annotations

from typing import Any

from reports.typst_math import number
from symbolic.controller import CoordinatorGains

MIX = '"mix"'
SYMBOLS = ("alpha_1", "alpha_2", "kappa", "beta", f"t_{MIX}", "nu")  # of COORDINATOR_KEYS, in typst
SUM = "sum_j a_(i j)"


def constants(gains: CoordinatorGains) -> list[str]:
    """``α1 = 3, α2 = 2`` as Typst mathematics, and each other constant that is not the paper's."""
    paper = CoordinatorGains(gains.alpha1, gains.alpha2).named
    return [
        f"{symbol} = {number(value)}"
        for symbol, (name, value) in zip(SYMBOLS, gains.named.items(), strict=True)
        if name.startswith("alpha") or value != paper[name]
    ]


def coordinator_section(gains: CoordinatorGains | None) -> dict[str, Any]:
    """The equations in Typst mathematics; without ``gains`` those that the paper prints."""
    if gains is None:
        return {
            "lines": _equations("", "1", False),
            "held": False,
            "soft": False,
            "constants": [],
            "error": "sigma_i \\/ xi_i^i",
        }
    kappa = "" if gains.gradient_gain == 1 else "kappa"
    beta = "" if gains.mixing_gain == 1 else "beta"
    return {
        "lines": _equations(beta, kappa or "1", gains.softening > 0),
        "held": gains.held,
        "soft": gains.softening > 0,
        "constants": constants(gains),
        "error": f"{kappa} sigma_i \\/ xi_i^i",
    }


def _equations(beta: str, kappa: str, soft: bool) -> list[str]:
    gradient = "c'_i (y_i^r)"
    if soft:
        gradient = f"({gradient} - upright(e)^(-nu (t - t_{MIX})) c'_i (y_i^r (0)))"
    return [
        f"dot(xi)_i = -{beta} {SUM} (xi_i - xi_j), quad quad xi_i (0) = e_i, quad quad zeta (0) = 0,",
        f"dot(y)_i^r = -({kappa}) / xi_i^i {gradient} - alpha_1 {SUM} (y_i^r - y_j^r) - alpha_2 zeta_i, quad quad "
        f"dot(zeta)_i = alpha_1 {SUM} (y_i^r - y_j^r).",
    ]
