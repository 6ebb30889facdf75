"""How much of the simulated region is certified: with the default gains, and with gains that are sought for it.

    python -m benchmarks.region --cache region.json [PLANT …]     keeps what it has after each plant
    python -m benchmarks.region --table --cache region.json

``box`` is the plant file's own, ``default`` the largest box with the default gains, ``largest`` that with the gains of
``region = "largest"`` and an input limit of 20 times the proved steady input. Of agent 1: the factor of its sides and
the share of the simulated region's area in the plane of ``certify region``, an estimate (169 starts, 4 vertices).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from benchmarks.requirements import bounds
from certify.pipeline import design_gains
from certify.region import NoRegion, certified_region
from certify.statement.controller import certified_controller
from sims.attraction import coverage, region_slices
from symbolic.plant import Plant, Requirements
from symbolic.plant_file import load_plant
from symbolic.plant_writer import with_source

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
PLANTS = ("pendulums", "van_der_pol", "thermal_springs", "five_agents")
LIMIT = 20  # times the steady input
POINTS = 13

Json = dict[str, Any]


def share(plant: Plant, certificate: Mapping[str, Any]) -> float | None:
    """Of the simulated region in the slice of agent 1."""
    controller = certified_controller(certificate, plant, "the certificate")
    slices = region_slices(plant, controller, [1], points=POINTS)
    return coverage(slices[0]).fraction if slices else None


def grown(plant: Plant, certificate: Mapping[str, Any]) -> Json:
    """The largest box with the gains of a certificate."""
    found = certified_region(plant, certificate)
    if isinstance(found, NoRegion):
        return {"reason": found.reason}
    if found.uniform is None:
        return {"factor": 1.0, "share": share(plant, certificate)}
    factor = float(max(found.uniform.factors[0]))
    return {"factor": factor, "share": share(found.uniform.plant, found.uniform.certificate)}


def row(name: str) -> Json:
    begin, plant = time.monotonic(), load_plant(EXAMPLES / f"{name}.toml")
    default = design_gains(plant, route="direct")
    if default.certificate is None:
        return {"reason": default.reason}
    found: Json = {"box": share(plant, default.certificate), "default": grown(plant, default.certificate)}
    limits = [LIMIT * agent.input.steady for agent in bounds(plant, default).agents]
    asked = tuple(Requirements(input=Fraction(f"{float(limit):.3g}"), region="largest") for limit in limits)
    wanted = with_source(replace(plant, requirements=asked))
    best = design_gains(wanted, route="direct")
    found["limit"] = float(asked[0].input or 0)
    found["largest"] = {"reason": best.reason} if best.certificate is None else grown(wanted, best.certificate)
    return {**found, "seconds": round(time.monotonic() - begin)}


def table(rows: dict[str, Json]) -> str:
    lines = [
        "| plant | own box | default gains | input limit | gains for the region | seconds |",
        "|---|---|---|---|---|---|",
    ]
    for name, found in rows.items():
        if "box" not in found:
            lines.append(f"| {name} | – | {found['reason'][:80]} | – | – | – |")
            continue
        parts = [_shown(found["default"]), f"{found['limit']:.3g}", _shown(found["largest"])]
        lines.append(f"| {name} | {_percent(found['box'])} | {' | '.join(parts)} | {found['seconds']} |")
    return "\n".join(lines)


def _shown(found: Json) -> str:
    if "reason" in found:
        return str(found["reason"]).split(";")[0][:120]
    return f"× {found['factor']:.3g}: {_percent(found['share'])}"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.2g} %"


def main() -> int:
    parser = argparse.ArgumentParser(description="certified share of the simulated region")
    parser.add_argument("plants", nargs="*", default=PLANTS)
    parser.add_argument("--cache", type=Path, help="file that keeps the rows")
    parser.add_argument("--table", action="store_true", help="only the table of the cache")
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
