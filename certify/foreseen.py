"""What the independent checker will make of a plant whatever the witnesses are, asked before any search."""

from __future__ import annotations

from functools import lru_cache
from itertools import product

from certify.checker.plant import Plant as CheckersPlant
from certify.checker.plant import read_plant
from certify.checker.rules.costs import Cost, prove_cost, prove_optimum
from certify.checker.verdict import Malformed, Rejected, Undecided, start_meter
from certify.optimum import WIDTH, Optimum
from symbolic.plant import Exosystem, Interval, Plant


def foreseen_refusal(plant: Plant) -> str:
    """The reason, and what may be written instead; empty if none is foreseen."""
    return irrational_exosystem(plant.exosystem) or _cost_beyond_the_checker(plant)


def irrational_exosystem(exosystem: Exosystem) -> str:
    S = exosystem.S
    for i, j in product(range(S.rows), range(S.cols)):
        if not S[i, j].is_Rational:
            return (
                f"exosystem.S[{i + 1}][{j + 1}] = {S[i, j]} is not rational, and certificates need rational entries; "
                "an oscillator of frequency w may be written [[0, 1], [-w^2, 0]] if w^2 is rational"
            )
    return ""


def seen_optimum(plant: Plant, found: Optimum) -> Optimum:
    """The optimum as the checker can see it: around a point where it encloses ``Σ c_i' = 0`` only, an interval."""
    if found.exact is None:
        return found
    try:
        prove_optimum(_costs(plant.source), found.exact, found.exact)
    except (Rejected, Malformed, Undecided):
        width = WIDTH / 4
        return Optimum(None, Interval(found.exact - width, found.exact + width))
    return found


@lru_cache(maxsize=4)
def plant_as_read(source: bytes) -> CheckersPlant:
    """The plant as the checker reads it. Raises ``Malformed``."""
    return read_plant(source)


@lru_cache(maxsize=1024)
def proved_cost(source: bytes, number: int) -> Cost:
    """The cost of agent ``number`` as the checker encloses it. Raises ``Rejected`` or ``Malformed``."""
    start_meter()
    return prove_cost(plant_as_read(source).agents[number - 1])


def _costs(source: bytes) -> tuple[Cost, ...]:
    return tuple(proved_cost(source, agent.id) for agent in plant_as_read(source).agents)


def _cost_beyond_the_checker(plant: Plant) -> str:
    try:
        _costs(plant.source)
    except Rejected as failure:
        found = f"{failure.obligation}: {failure.detail}"
        return f"the independent checker cannot decide {found}; another way to write the cost may do"
    except (Malformed, Undecided) as reason:
        return f"the independent checker does not read the plant: {reason}"
    return ""
