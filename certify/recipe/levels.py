"""The level ``c`` as a fixed point, in place of the paper's circular choice of ``μ`` (theory.md section 5, steps 2–5;
F2)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from certify.agent_model import AgentModel, LyapunovMatrices
from certify.bounds.balls import NonFiniteError
from certify.bounds.rationals import round_up
from certify.recipe.constants import (
    Constants,
    constants,
    gain_g_threshold,
    initial_energy,
    zero_layer,
)

MARGIN = Fraction(17, 16)
MOST_ROUNDS = 60
LARGEST_LEVEL_BITS = 512
LEVEL_BITS = 12
G_GRID = Fraction(1, 8)


@dataclass(frozen=True)
class Level:
    """``w0 + ς10 ∫ỹ² + ς11 ∫(ẏ^r)² ≤ c`` with all constants bounded on ``{W ≤ c + ϵ}``, ``slack = ϵ``."""

    level: Fraction
    slack: Fraction
    initial: Fraction
    coordinator: Fraction
    found: Constants


@dataclass(frozen=True)
class NoLevel:
    """No fixed point: the reason names the constant that runs away."""

    reason: str
    rounds: int


def find_level(
    model: AgentModel,
    matrices: LyapunovMatrices,
    *,
    g: Fraction | None = None,
    slack_ratio: Fraction = Fraction(1),
) -> Level | NoLevel:
    """Raise ``c`` until ``w0 + Δ(c) ≤ c``; ``slack_ratio = ϵ/c``. A given ``g`` is kept, otherwise the least one on a
    grid is taken."""
    level = Fraction(1)
    history: list[Constants] = []
    for rounds in range(1, MOST_ROUNDS + 1):
        attempt = _attempt(model, matrices, level, slack_ratio, g)
        if isinstance(attempt, str):
            return NoLevel(attempt, rounds)
        found, initial, coordinator = attempt
        history.append(found)
        needed = initial + coordinator
        if needed <= level:
            return Level(level, slack_ratio * level, initial, coordinator, found)
        if needed.numerator.bit_length() - needed.denominator.bit_length() > LARGEST_LEVEL_BITS:
            break
        level = round_up(max(MARGIN * needed, level * MARGIN), LEVEL_BITS)
    return NoLevel(_runaway(history), len(history))


def _attempt(
    model: AgentModel, matrices: LyapunovMatrices, level: Fraction, slack_ratio: Fraction, g: Fraction | None
) -> tuple[Constants, Fraction, Fraction] | str:
    total = level * (1 + slack_ratio)
    try:
        varsigma1, varsigma2, _ = zero_layer(model, matrices, total, Fraction(0))
        threshold = gain_g_threshold(model, matrices, varsigma1, varsigma2)
        chosen = g if g is not None else _least_on_grid(threshold, model.order)
        if model.order > 1 and chosen <= threshold:
            needed = f"2 + ς1²ς2²/a0 + a0/4 = {float(threshold):.4g}"
            return f"g = {chosen} does not exceed {needed} on the level {float(level):.4g}"
        found = constants(model, matrices, total, chosen)
        initial = initial_energy(model, matrices, found)
    except NonFiniteError as error:
        return f"a bound on the level set {float(level):.4g} is not finite: {error}"
    coordinator = round_up(
        found.varsigma[10] * model.references.energy + found.varsigma[11] * model.references.rate_energy
    )
    return found, initial, coordinator


def _least_on_grid(threshold: Fraction, order: int) -> Fraction:
    return Fraction(1) if order == 1 else G_GRID * (threshold // G_GRID + 2)


def _runaway(history: list[Constants]) -> str:
    """The constant that grew most from the first round to the last."""
    first, last = history[0], history[-1]
    growth = {f"ς{k}": last.varsigma[k] / first.varsigma[k] for k in last.varsigma if first.varsigma[k] > 0}
    growth["g"] = last.g / first.g
    name = max(growth, key=lambda key: growth[key])
    return f"no level closes the loop within {len(history)} rounds: {name} runs away with the level"
