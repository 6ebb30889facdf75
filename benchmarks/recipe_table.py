"""The recipe's numbers for the paper's five agents, and what moves them: prints the tables of ``docs/recipe.md``.

Run from the top of the checkout: ``python benchmarks/recipe_table.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from certify.agent_model import AgentModel, LyapunovMatrices, References
from certify.assumptions.check import check_assumptions
from certify.bounds.rationals import log10_estimate
from certify.coordinator.design import gradients_at
from certify.coordinator.envelope import norm_gains
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.printed import PrintedDesign, design_printed
from certify.curvature import Curvature, cost_curvature
from certify.preparation import Prepared, prepare
from certify.recipe.constants import constants, initial_energy
from certify.recipe.levels import Level, find_level
from certify.recipe.matrices import lyapunov_matrices
from certify.recipe.thresholds import OutputFeedback, StateFeedback, output_feedback, state_feedback
from symbolic.plant import CoordinatorChoice, Interval, Plant
from symbolic.plant_file import load_plant, parse_plant
from symbolic.steady_state import SteadyState

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
HALF = "p1 = {low}, p2 = {high}, p3 = {high}"
WIDE = HALF.format(low='["-id - 1/2", "-id + 1/2"]', high='["id - 1/2", "id + 1/2"]')
NARROW = HALF.format(low='["-id*11/10", "-id*9/10"]', high='["id*9/10", "id*11/10"]')


@dataclass(frozen=True)
class Row:
    """One agent's numbers; ``h`` is ``None`` where no level closes the loop."""

    id: int
    level: Level
    feedback: StateFeedback
    output: OutputFeedback


@dataclass(frozen=True)
class Case:
    """A prepared network and, per agent, the model and the matrices."""

    prepared: Prepared
    agents: tuple[tuple[AgentModel, LyapunovMatrices], ...]


def case(plant: Plant) -> Case:
    printed = CoordinatorChoice(Fraction(3), Fraction(2), mixing_time=Fraction(0))
    plant = replace(plant, coordinator=printed)  # the paper's, that starts at once
    prepared = prepare(plant, check_assumptions(plant), lambda message: None)
    assert isinstance(prepared, Prepared)
    agents = []
    for model, derived in zip(prepared.models, prepared.derivation.agents, strict=True):
        assert isinstance(model, AgentModel) and isinstance(derived.steady_state, SteadyState)
        matrices = lyapunov_matrices(model, derived.steady_state)
        assert isinstance(matrices, LyapunovMatrices)
        agents.append((model, matrices))
    return Case(prepared, tuple(agents))


def row(model: AgentModel, matrices: LyapunovMatrices, level: Level | None = None, least: bool = False) -> Row | None:
    """The recipe for one agent; ``level`` replaces the fixed point, ``least`` every ``a`` by the smallest."""
    chosen = find_level(model, matrices) if level is None else level
    if not isinstance(chosen, Level):
        return None
    feedback = state_feedback(model, matrices, chosen, None)
    assert isinstance(feedback, StateFeedback)
    used = feedback
    if least:
        a = feedback.smallest
        present = {name: a for name in ("a_z", "a_x", "a_eta") if getattr(feedback, name) is not None}
        used = replace(feedback, a_vartheta=a, **present)
    output = output_feedback(model, matrices, chosen, used, None, None)
    assert isinstance(output, OutputFeedback)
    return Row(model.agent.id, chosen, feedback, output)


def at_level(model: AgentModel, matrices: LyapunovMatrices, total: Fraction) -> Level:
    """The constants on a level that was not found for this agent but given."""
    g = find_level(model, matrices)
    assert isinstance(g, Level)
    found = constants(model, matrices, 2 * total, g.found.g)
    return Level(total, total, initial_energy(model, matrices, found), total, found)


def norm_references(prepared: Prepared) -> tuple[References, ...]:
    """The coordinator's Lyapunov inequality around the equilibrium from ``t = 0``, in floats; no nominal trajectory.

    ``d/dt‖x‖_P ≤ −λ0‖x‖_P + ‖p(t)‖_P`` from ``ỹ(0) = y^r(0) − s*``, ``ζ̃(0) = −ζ̄`` with ``p`` enclosed step by step.
    """
    plant, optimum = prepared.plant, prepared.optimum.enclosure
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], optimum)
    curvatures = [cost_curvature(agent.cost) for agent in plant.agents]
    bends = [Interval(found.lower, found.upper) for found in curvatures if isinstance(found, Curvature)]
    design = design_printed(plant, optimum, gradients, bends)
    assert isinstance(design, PrintedDesign)
    model, comparison, step = design.model, design.comparison, float(design.mixing.step)
    n, r = model.size, [float(value) for value in model.left_null_vector]
    slopes = [float(gradient.magnitude) for gradient in gradients]
    P = np.abs(np.array([[float(value) for value in line] for line in comparison.P]))

    def norm(top: Sequence[float], bottom: Sequence[float]) -> float:
        magnitudes = np.array([*top, *bottom])
        return float(np.sqrt(magnitudes @ P @ magnitudes))

    target = float(optimum.lo)
    error = [
        max(abs(float(end) - target) for end in (a.initial.reference.lo, a.initial.reference.hi))
        for a in prepared.plant.agents
    ]
    bound = norm(error, [slopes[i] / (float(model.alpha2) * r[i]) for i in range(n - 1)])
    decay = np.exp(-float(comparison.rate) * step)
    bounds, forcings = [], []
    for ranges in design.mixing.ranges:
        p = [slopes[i] * max(abs(1 / r[i] - 1 / float(end)) for end in ranges[i]) for i in range(n)]
        level = norm(p, [0.0] * (n - 1)) / float(comparison.rate)
        bounds.append(max(bound, level))
        forcings.append(p)
        bound = decay * bound + (1 - decay) * level
    found, (reach, rate_gains) = [], norm_gains(model, comparison)
    for i in range(n):
        ys = float(reach[i]) * np.array(bounds)
        rates = float(rate_gains[i]) * np.array(bounds) + np.array([p[i] for p in forcings])
        found.append(References(*map(Fraction, (ys.max(), step * (ys @ ys), step * (rates @ rates)))))
    return tuple(found)


def log(value: Fraction | None) -> str:
    return "–" if value is None else f"{log10_estimate(value):.1f}"


def spread(rows: Sequence[Row | None], value: Callable[[Row], Fraction | None]) -> str:
    """Smallest and largest ``log10`` over the agents."""
    logs = [log10_estimate(number) for line in rows if line is not None and (number := value(line)) is not None]
    return f"{min(logs):.1f} … {max(logs):.1f}" if len(logs) == len(rows) else "no level"


def main_table(rows: Sequence[Row | None]) -> list[str]:
    lines = [
        "| agent | g | ς7ς8 | K | δ | T | h1 | h2 | h3 | h | level c |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for line in rows:
        assert line is not None
        out, found = line.output, line.level.found
        values = (found.weight_eta, line.feedback.K, out.delta, out.T, out.h1, out.h2, out.h3, out.h, line.level.level)
        lines.append(f"| {line.id} | {float(found.g):.2f} | " + " | ".join(map(log, values)) + " |")
    return lines


def causes() -> list[str]:
    text = (EXAMPLES / "five_agents.toml").read_text(encoding="utf-8")
    assert text.count(WIDE) == 2
    base = case(load_plant(EXAMPLES / "five_agents.toml"))
    box = case(load_plant(EXAMPLES / "five_agents_box.toml"))
    narrow = case(parse_plant(text.replace(WIDE, NARROW).encode(), "±10 %"))
    norms = norm_references(base.prepared)
    far = [(replace(model, references=reference), P) for (model, P), reference in zip(base.agents, norms, strict=True)]
    own = [row(model, P) for model, P in base.agents]
    network = sum((line.level.level for line in own if line is not None), Fraction(0))
    cases: list[tuple[str, Sequence[Row | None]]] = [
        ("as built", own),
        ("parameters ±10 % instead of ±½", [row(model, P) for model, P in narrow.agents]),
        ("`y^r(0), x̃(0), η(0)` in the unit box", [row(model, P) for model, P in box.agents]),
        ("coordinator by its norm from `t = 0`", [row(model, P) for model, P in far]),
        ("one level for the network, `Σ c_i`", [row(m, P, at_level(m, P, network)) for m, P in base.agents]),
        ("one `a = min{a_z, a_x, a_η, a_ϑ}` for every block", [row(model, P, least=True) for model, P in base.agents]),
        ("unit box and one `a`", [row(model, P, least=True) for model, P in box.agents]),
    ]
    lines = ["| change | ς7ς8 | K | δ | T | T/ω_ϑ | h |", "|---|---|---|---|---|---|---|"]
    for name, rows in cases:
        columns: tuple[Callable[[Row], Fraction | None], ...] = (
            lambda line: line.level.found.weight_eta,
            lambda line: line.feedback.K,
            lambda line: line.output.delta,
            lambda line: line.output.T,
            lambda line: None if line.output.T is None else line.output.T / line.level.found.weight_vartheta,
            lambda line: line.output.h,
        )
        lines.append(f"| {name} | " + " | ".join(spread(rows, column) for column in columns) + " |")
    return lines


def tables() -> str:
    base = case(load_plant(EXAMPLES / "five_agents.toml"))
    first = main_table([row(model, P) for model, P in base.agents])
    return "\n".join([*first, "", *causes(), ""])


if __name__ == "__main__":
    print(tables(), end="")
