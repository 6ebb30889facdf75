"""What the independent checker will refuse of a plant whatever the witnesses are, asked before any search."""

from __future__ import annotations

from itertools import product

from certify.checker.plant import read_plant
from certify.checker.rules.costs import prove_cost
from certify.checker.verdict import Malformed, Rejected, Undecided, start_meter
from symbolic.plant import Exosystem, Plant


def foreseen_refusal(plant: Plant) -> str:
    """The reason, and what may be written instead; empty if none is foreseen."""
    return _irrational_exosystem(plant.exosystem) or _cost_beyond_the_checker(plant)


def _irrational_exosystem(exosystem: Exosystem) -> str:
    S = exosystem.S
    for i, j in product(range(S.rows), range(S.cols)):
        if not S[i, j].is_Rational:
            return (
                f"exosystem.S[{i + 1}][{j + 1}] = {S[i, j]} is not rational, and certificates need rational entries; "
                "an oscillator of frequency w may be written [[0, 1], [-w^2, 0]] if w^2 is rational"
            )
    return ""


def _cost_beyond_the_checker(plant: Plant) -> str:
    start_meter()
    try:
        for agent in read_plant(plant.source).agents:
            prove_cost(agent)
    except Rejected as failure:
        found = f"{failure.obligation}: {failure.detail}"
        return f"the independent checker cannot decide {found}; another way to write the cost may do"
    except (Malformed, Undecided) as reason:
        return f"the independent checker does not read the plant: {reason}"
    return ""
