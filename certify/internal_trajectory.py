"""The internal model with the trajectory ``τ = (u*, L_S u*, …)`` it reproduces."""

from __future__ import annotations

from fractions import Fraction

import sympy

from certify.agent_model import InternalModelData
from symbolic.internal_model import InternalModel
from symbolic.plant import Exosystem


def internal_model_data(model: InternalModel, u_star: sympy.Expr, exosystem: Exosystem) -> InternalModelData | None:
    """``None`` when an entry is irrational: the recipe's exact steps need rationals."""
    entries = [*model.ell, *model.psi, *(entry for row in model.T for entry in row)]
    if not all(isinstance(entry, Fraction) for entry in entries):
        return None
    velocity = exosystem.S * sympy.Matrix(exosystem.states) if exosystem.states else ()
    tau, derivative = [], u_star
    for _ in range(model.order):
        tau.append(derivative)
        derivative = sympy.expand(
            sum((sympy.diff(derivative, v) * w for v, w in zip(exosystem.states, velocity, strict=True)), sympy.S.Zero)
        )
    return InternalModelData(model.ell, model.M, model.N, model.T, model.psi, tuple(tau))
