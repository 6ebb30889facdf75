"""Certified gains against falsified ones: recipe, direct route, and the largest gains a search can break.

    python -m benchmarks.tightness                      all cases, about an hour on an idle core
    python -m benchmarks.tightness rooms five-agents/1  some cases
    python -m benchmarks.tightness --table              only the table of what the cache holds

Results are kept in ``tightness.json`` (or ``--cache``), agent by agent, so that a run can be interrupted and the table
shows what is there. ``docs/tightness.md`` says how the numbers are defined and what they mean.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import sympy

from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.gains.linear_stability import necessary_condition
from certify.network_certificate import COORDINATOR_KEYS
from certify.optimum import optimum
from certify.pipeline import GainsResult, design_gains
from sims.falsifier import falsify
from symbolic.controller import AgentController, Controller, CoordinatorGains
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, Plant
from symbolic.plant_file import parse_plant
from symbolic.steady_state import SteadyState

EXAMPLES = Path(__file__).parent.parent / "examples"
NAMES = "pendulums van_der_pol mass_spring thermal_springs first_order rooms third_order_actuator fourth_order".split()
BOXES = ("1", "0.25", "0.5", "2")
LEAST = 2.0**-13
BUDGET, HORIZON = 64, 20.0

Json = dict[str, Any]


def cases() -> dict[str, str]:
    """Plant files by the name of the case; the five agents at several boxes."""
    found = {name: (EXAMPLES / f"{name}.toml").read_text() for name in NAMES}
    five = (EXAMPLES / "five_agents.toml").read_text()
    for box in BOXES:
        found[f"five-agents/{box}"] = five.replace("= [-1, 1]", f"= [-{box}, {box}]")
    return found


def least_gains(result: GainsResult, controller: Controller) -> Controller:
    """Those that the search starts the default from: the least that are certified are what tightness is about."""
    laws = []
    for agent, law in zip(result.agents, controller.agents, strict=True):
        named = [other.controller for other in agent.alternatives if other.label == "least gains"]
        laws.append(named[0] if named else law)
    return dataclasses.replace(controller, agents=tuple(laws))


def route(plant: Plant, name: str) -> tuple[Json, Controller | None]:
    """Gains of one route by agent, or the reason why there are none."""
    begin = time.monotonic()
    result = design_gains(plant, route=name)
    row: Json = {"status": result.status, "seconds": round(time.monotonic() - begin, 1)}
    if result.certificate is None:
        return {**row, "reason": result.reason}, None
    controller = least_gains(result, _controller(result.certificate["claim"]))
    row["agents"] = {
        str(law.id): [_magnitude(law.g), _magnitude(law.K), _magnitude(law.h)] for law in controller.agents
    }
    return row, controller


def critical(plant: Plant, controller: Controller, number: int, keep_K: bool) -> Json:
    """The largest factor on the gains below the certified ones at which something breaks (0 if nothing does).

    ``K, h, δ`` are scaled together, or (``keep_K``) ``h`` alone. Upwards from the linear limit: by doubling while the
    search still finds a counterexample, then half a step more; by fours while there is none at all. Gains that break
    above a step that survives are overlooked. An offset that stays is not counted: with an internal model there is no
    such equilibrium, it is a loop too slow for the horizon.
    """

    def scaled(factor: float) -> Controller:
        exact = Fraction(factor).limit_denominator(10**6)
        law = controller.agents[number - 1]
        h = None if law.h is None else law.h * exact
        changed = {"h": h} if keep_K else {"h": h, "K": law.K * exact, "delta": law.delta * exact}
        agents = list(controller.agents)
        agents[number - 1] = dataclasses.replace(law, **changed)
        return dataclasses.replace(controller, agents=tuple(agents))

    def breaks(factor: float) -> bool:
        found = falsify(plant, scaled(factor), budget=BUDGET, horizon=HORIZON, agents=[number])
        return found.witness is not None and found.witness.fate != "offset"

    limit = linear_limit(plant, scaled, number)
    broken, tried = limit, max(limit, LEAST)
    while tried < 0.5:
        tried *= 2 if broken else 4
        if breaks(tried):
            broken = tried
        elif broken:
            break
    if broken > limit and breaks(broken * 2**0.5):
        broken *= 2**0.5
    return {"linear": limit, "broken": broken, "survived": tried}


def linear_limit(plant: Plant, scaled: Callable[[float], Controller], number: int) -> float:
    """The largest factor, to 3 %, at which the exact linear condition refutes the loop at some corner of ``W``; 0 if it
    does not refute ``LEAST`` either.
    """
    found = optimum(plant)
    at = COST_VARIABLE if found.exact is None else sympy.Rational(found.exact.numerator, found.exact.denominator)
    derived = derive(plant, at).agents[number - 1]
    disturbance = exosystem_bounds(plant.exosystem)
    assert isinstance(derived.steady_state, SteadyState) and isinstance(disturbance, ExosystemBounds)

    def refuted(factor: float) -> bool:
        law = scaled(factor).agents[number - 1]
        args = (derived.agent, law, derived.steady_state, found, disturbance.sharp, plant.exosystem.states)
        return necessary_condition(*args).status == "refuted"

    low, high = LEAST, 1.0
    if not refuted(low):
        return 0.0
    while high / low > 1.03:
        middle = (low * high) ** 0.5
        low, high = (middle, high) if refuted(middle) else (low, middle)
    return low


def measure(name: str, text: str, known: Json, falsified: bool = True) -> Iterator[Json]:
    """The row of one case, yielded anew whenever more of it is known."""
    plant = parse_plant(text.encode(), name)
    row = known if known.get("sha256") == plant.sha256 else {"sha256": plant.sha256, "falsified": {}}
    direct, controller = route(plant, "direct")
    if row.get("direct", {}).get("agents") != direct.get("agents"):
        row["falsified"] = {}
    row["direct"] = direct
    yield row
    if "recipe" not in row:
        row["recipe"] = route(plant, "recipe")[0]
        yield row
    for law in controller.agents if controller is not None and falsified else ():
        if str(law.id) in row["falsified"] or (law.id > 1 and not name.startswith("five-agents")):
            continue
        found = {"K": critical(plant, controller, law.id, keep_K=False)}
        if law.h is not None:
            found["h"] = critical(plant, controller, law.id, keep_K=True)
        row["falsified"][str(law.id)] = found
        yield row


def table(rows: Json) -> str:
    """Markdown: one line per agent."""
    lines = [
        "| plant (box) | agent | recipe K, h | direct g, K, h | falsified K | falsified h | K ratio | h ratio |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in cases():
        row = rows.get(name)
        if row is None:
            continue
        direct, recipe = row["direct"], row.get("recipe", {})
        if "agents" not in direct:
            lines.append(f"| {name} | | | {direct['status']}: {direct['reason']} | | | | |")
            continue
        for number, (g, K, h) in direct["agents"].items():
            found = row["falsified"].get(number, {})
            by_K, by_h = _ratio(K, found.get("K")), _ratio(h, found.get("h"))
            lines.append(
                f"| {name} | {number} | {_recipe(recipe, number)} | {_show(g)}, {_show(K)}, {_show(h)} "
                f"| {by_K[0]} | {by_h[0]} | {by_K[1]} | {by_h[1]} |"
            )
    return "\n".join(lines)


def _ratio(gain: float | None, found: Json | None) -> tuple[str, str]:
    if gain is None:
        return "no observer", "–"
    if found is None:
        return "not measured", "–"
    if found["broken"] == 0:
        return f"none from {_show(gain * LEAST)} on", "–"
    mark = "" if found["broken"] > found["linear"] else " (linear)"
    return f"{_show(gain * found['broken'])}{mark}", f"{1 / found['broken']:.3g}"


def _recipe(recipe: Json, number: str) -> str:
    if "agents" not in recipe:
        return recipe.get("status", "not measured")
    _, K, h = recipe["agents"][number]
    return f"{_show(K)}, {_show(h)}"


def _controller(claim: Json) -> Controller:
    """The controller of a claim that was just made."""
    laws = tuple(
        AgentController(
            id=int(entry["id"]),
            M=tuple(_row(row) for row in entry["M"]),
            h=None if entry["h"] is None else Fraction(entry["h"]),
            **{key: _row(entry[key]) for key in ("gamma", "observer", "N", "psi")},
            **{key: Fraction(entry[key]) for key in ("g", "K", "delta")},
        )
        for entry in claim["agents"]
    )
    return Controller(CoordinatorGains(**{key: Fraction(claim[key]) for key in COORDINATOR_KEYS}), laws)


def _row(entries: list[str]) -> tuple[Fraction, ...]:
    return tuple(map(Fraction, entries))


def _magnitude(value: Fraction | None) -> float | None:
    """Recipe gains can be beyond floats: those become infinite."""
    if value is None:
        return None
    try:
        return float(value)
    except OverflowError:
        return float("inf")


def _show(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}"


def main() -> None:
    parser = argparse.ArgumentParser(description="certified against falsified gains")
    parser.add_argument("cases", nargs="*", help=f"of {', '.join(cases())}; all if left out")
    parser.add_argument("--cache", type=Path, default=Path("tightness.json"))
    parser.add_argument("--table", action="store_true", help="only print the table of the cache")
    parser.add_argument("--certify-only", action="store_true", help="leave the falsified gains out")
    options = parser.parse_args()
    rows: Json = json.loads(options.cache.read_text()) if options.cache.exists() else {}
    for name in [] if options.table else options.cases or cases():
        for row in measure(name, cases()[name], rows.get(name, {}), not options.certify_only):
            rows[name] = row
            options.cache.write_text(json.dumps(rows, indent=1) + "\n")
            print(f"{name}: {len(row['falsified'])} agents falsified", file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main()
