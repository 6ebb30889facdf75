"""Requirements on the gallery: what the default brings over the least gains, and three sets that are met or refused.

    python -m benchmarks.requirements --cache requirements.json [PLANT …]     keeps what it has after each plant
    python -m benchmarks.requirements --table --cache requirements.json

The first table has, of the slowest agent, the proved settling time (to 1 % of the least gains' error at the start)
and of all agents the largest proved peak of the input, both by the certificates of two plant files: one leaves the
gains open, the other fixes the least gains. The second asks for half the default's settling time, for 70 % of its peak
of the input, and for both with a quarter of time to spare.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import sympy

from certify.optimum import optimum
from certify.pipeline import GainsResult, design_gains
from certify.statement.bounds import ProvedBounds, proved_bounds
from certify.statement.claim import certified_gains
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, InternalModelChoice, Plant, RequestedGains, Requirements, Settling
from symbolic.plant_file import load_plant
from symbolic.plant_writer import with_source

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
PLANTS = ("pendulums", "van_der_pol", "mass_spring", "thermal_springs", "first_order", "rooms", "third_order_actuator")
BAND = Fraction(1, 100)

Json = dict[str, Any]


def bounds(plant: Plant, result: GainsResult) -> ProvedBounds:
    """What the certificate proves in the user's coordinates."""
    certified = certified_gains(result.certificate)
    if certified is None or result.envelope is None:
        raise ValueError(result.reason)
    best = optimum(plant).exact
    s_star = COST_VARIABLE if best is None else sympy.Rational(best.numerator, best.denominator)
    found = proved_bounds(plant, derive(plant, s_star), certified, result.envelope)
    if isinstance(found, str):
        raise ValueError(found)
    return found


def with_least_gains(plant: Plant, result: GainsResult) -> Plant:
    """The plant file that fixes the least gains of the search."""
    gains, agents = [], []
    for agent, described in zip(result.agents, plant.agents, strict=True):
        named = [other.controller for other in agent.alternatives if other.label == "least gains"]
        if not named:
            return plant
        law = named[0]
        gains.append(RequestedGains(law.g if law.h is not None else None, law.K, law.delta, law.h))
        observed = {"gamma": law.gamma, "observer": law.observer} if law.h is not None else {}
        model = InternalModelChoice(law.M, law.N) if law.N else described.internal_model
        agents.append(replace(described, internal_model=model, **observed))
    return with_source(replace(plant, agents=tuple(agents), gains=tuple(gains)))


def measured(plant: Plant, result: GainsResult, band: Fraction | None = None) -> tuple[Fraction, Fraction, Fraction]:
    """Slowest settling, largest peak, and the band."""
    found = bounds(plant, result)
    band = band or BAND * max(agent.error.values[0] for agent in found.agents)
    slowest = max(agent.error.settled(band) for agent in found.agents)
    return slowest, max(agent.input.peak for agent in found.agents), band


def row(name: str) -> Json:
    plant = load_plant(EXAMPLES / f"{name}.toml")
    begin = time.monotonic()
    default = design_gains(plant, route="direct")
    found: Json = {"seconds": round(time.monotonic() - begin, 1), "status": default.status, "asked": []}
    if default.certificate is None:
        return {**found, "reason": default.reason}
    other = with_least_gains(plant, default)
    least = default if other is plant else design_gains(other, route="direct")
    if least.certificate is None:
        return {**found, "reason": f"least gains: {least.reason}"}
    settled, peak, band = measured(other, least)
    sooner, higher, _ = measured(plant, default, band)
    found["least"], found["default"] = [float(settled), float(peak)], [float(sooner), float(higher)]
    for title, asked in (
        ("half the settling time", Requirements(Settling(_short(sooner / 2), _short(band)))),
        ("70 % of the input", Requirements(input=_short(higher * Fraction(7, 10)))),
        ("5/4 of both", Requirements(Settling(_short(sooner * 5 / 4), _short(band)), _short(higher * 5 / 4))),
    ):
        begin = time.monotonic()
        wanted = with_source(replace(plant, requirements=(asked,) * len(plant.agents)))
        result = design_gains(wanted, route="direct")
        seconds = round(time.monotonic() - begin, 1)
        found["asked"].append({"title": title, "status": result.status, "seconds": seconds, "reason": result.reason})
    return found


def _short(value: Fraction) -> Fraction:
    return Fraction(f"{float(value):.3g}")


def table(rows: dict[str, Json]) -> str:
    lines = ["| plant | least gains: settled, peak | default: settled, peak | sooner | input | seconds |"]
    lines.append("|---|---|---|---|---|---|")
    for name, found in rows.items():
        if "least" not in found:
            lines.append(f"| {name} | {found.get('reason', '')[:80]} | – | – | – | {found['seconds']} |")
            continue
        (a, b), (c, d) = found["least"], found["default"]
        lines.append(
            f"| {name} | {a:.3g}, {b:.3g} | {c:.3g}, {d:.3g} | {a / c:.2g} × | {d / b:.2g} × | {found['seconds']} |"
        )
    lines += ["", "| plant | asked | outcome | seconds |", "|---|---|---|---|"]
    for name, found in rows.items():
        for one in found.get("asked", []):
            reason = "" if one["status"] == "certified" else f": {one['reason'].split(';')[0]}"
            lines.append(f"| {name} | {one['title']} | {one['status']}{reason} | {one['seconds']} |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description="requirements on the gallery")
    parser.add_argument("plants", nargs="*", default=PLANTS)
    parser.add_argument("--cache", type=Path, help="file that keeps the rows")
    parser.add_argument("--table", action="store_true", help="only the tables of the cache")
    given = parser.parse_args()
    rows: dict[str, Json] = json.loads(given.cache.read_text()) if given.cache and given.cache.exists() else {}
    for name in () if given.table else given.plants:
        rows[name] = row(name)
        print(name, json.dumps(rows[name]), file=sys.stderr)
        if given.cache:
            given.cache.write_text(json.dumps(rows, indent=1))
    print(table(rows))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
