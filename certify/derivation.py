"""The derivation of a plant at its optimum."""

from __future__ import annotations

from certify.optimum import NoOptimumError, optimum
from symbolic.constants import as_rational
from symbolic.derivation import derive
from symbolic.derived import Derivation
from symbolic.plant import COST_VARIABLE, Plant


def derivation_at_optimum(plant: Plant) -> Derivation:
    """For the exact optimum, or for the symbol ``s`` where it is not rational or not known. Raises ``InputError``."""
    try:
        exact = optimum(plant).exact
    except NoOptimumError:
        exact = None
    return derive(plant, COST_VARIABLE if exact is None else as_rational(exact))
