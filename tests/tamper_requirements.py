"""Tampering with requirements: claims, plant files and witnesses are changed, and nothing false may be accepted.

    python tests/tamper_requirements.py --count 1000

A changed claim that still repeats the plant file may be proved again; then simulated loops have to obey it, and it has
to be no stronger than what the exact bounds of the witness say by themselves.
"""

from __future__ import annotations

import argparse
import copy
import hashlib
import random
import sys
from collections import Counter
from fractions import Fraction
from typing import Any

import direct_producer as producer
import numpy as np
from direct_producer import Json
from tamper.values import changes
from test_checker_requirements import NOTHING, SPAN, certified, inputs, simulations, table
from tiny_loops import MODELS

from certify.checker import check

BASE: dict[str, Json] = {}  # by model: requirements that hold with some room
KEYS = ("settling", "input", "bandwidth")


def base(name: str) -> Json:
    """Requirements of one of the tiny plants that are proved."""
    if name not in BASE:
        for power in range(12):
            asked = {
                "settling": {"time": str(Fraction(3, 2) ** power), "band": "1/4"},
                "input": str(Fraction(5) * Fraction(3, 2) ** power),
                "bandwidth": "600",
            }
            if judge(name, asked, asked).status == "verified":
                BASE[name] = asked
                break
    return BASE[name]


def judge(name: str, asked: Any, claimed: Any, scale: tuple[Any, ...] | None = None) -> Any:
    """``asked`` in the plant file, ``claimed`` in the certificate; ``scale`` makes a number of the witness smaller."""
    tiny, certificate = certified(name)
    certificate = copy.deepcopy(certificate)
    toml = f"{tiny.toml.decode()}\n{table({**NOTHING, **asked})}\n".encode()
    certificate["claim"]["plant_sha256"] = hashlib.sha256(toml).hexdigest()
    certificate["claim"]["agents"][0]["requirements"] = claimed
    if scale is not None:
        factor, where = scale
        here = certificate["witness"]["agents"][0]
        for key in where[:-1]:
            here = here[key]
        here[where[-1]] = str(Fraction(here[where[-1]]) * factor)
    return check(toml, producer.encode(certificate))


def obeyed(name: str, asked: Json) -> bool:
    """By every simulated loop."""
    for loop in simulations(name):
        if asked["input"] is not None and inputs(loop).max() > float(Fraction(asked["input"])):
            return False
        if asked["settling"] is not None:
            time, band = (float(Fraction(asked["settling"][key])) for key in ("time", "band"))
            for t in np.linspace(min(time, SPAN), SPAN, 100) if time < SPAN else ():
                if abs(np.split(loop.solution(t), loop.cuts)[1][0]) > band:
                    return False
    h, c = loop.tiny.claim["h"], loop.tiny.claim["observer"]
    fastest = max(map(abs, np.roots([1.0, *reversed(c)]))) * h if h else 0.0
    return asked["bandwidth"] is None or fastest <= float(Fraction(asked["bandwidth"])) * (1 + 1e-9)


def mutant(rng: random.Random) -> tuple[str, str, Any, Any, Any]:
    name = rng.choice(list(MODELS))
    asked, kind = copy.deepcopy(base(name)), rng.choice(("claim", "value", "shape", "both", "witness"))
    if kind == "claim":  # a value of the claim alone, by another number
        claimed = copy.deepcopy(asked)
        key = rng.choice(KEYS)
        factor = Fraction(rng.randint(1, 4000), 1000)
        if key == "settling":
            part = rng.choice(("time", "band"))
            claimed[key][part] = str(Fraction(claimed[key][part]) * factor)
        else:
            claimed[key] = str(Fraction(claimed[key]) * factor)
        return name, kind, asked, claimed, None
    if kind == "value":  # a value of the claim alone, by anything
        claimed = copy.deepcopy(asked)
        key = rng.choice(KEYS)
        holder, place = (claimed[key], rng.choice(("time", "band"))) if key == "settling" else (claimed, key)
        holder[place] = rng.choice([new for _, new in changes(holder[place])])
        return name, kind, asked, claimed, None
    if kind == "shape":
        claimed = copy.deepcopy(asked)
        edit = rng.randrange(6)
        if edit == 0:
            claimed.pop(rng.choice(KEYS))
        elif edit == 1:
            claimed[rng.choice(KEYS)] = None
        elif edit == 2:
            claimed["region"] = "largest"
        elif edit == 3:
            claimed = rng.choice([None, [], "", "1", {"requirements": claimed}])
        elif edit == 4:
            claimed["settling"] = rng.choice([[], {"time": "1"}, {"band": "1"}, {**claimed["settling"], "x": "1"}, "1"])
        else:
            claimed["input"], claimed["bandwidth"] = claimed["bandwidth"], claimed["input"]
        return name, kind, asked, claimed, None
    for key in KEYS:  # both: what is asked and claimed at once, also far beyond what holds
        factor = Fraction(str(round(2 ** rng.uniform(-6, 2), 4))) + Fraction(1, 1000)
        if key == "settling":
            part = rng.choice(("time", "band"))
            asked[key][part] = str(Fraction(asked[key][part]) * factor)
        elif rng.random() < 0.5:
            asked[key] = str(Fraction(asked[key]) * factor)
    scale = None
    if kind == "witness":
        witness = certified(name)[1]["witness"]["agents"][0]
        part = rng.choice(("boxes", "phase1", "tail"))
        factor = Fraction(rng.randint(1, 99), 100)
        if part == "tail":
            scale = factor, ("tail", "box", rng.randrange(len(witness["tail"]["box"])))
        else:
            boxes = (
                witness["boxes"] if part == "boxes" or not witness["phase1"]["boxes"] else witness["phase1"]["boxes"]
            )
            where = ("boxes",) if boxes is witness["boxes"] else ("phase1", "boxes")
            row = rng.randrange(len(boxes))
            scale = factor, (*where, row, rng.randrange(len(boxes[row])))
    return name, kind, asked, copy.deepcopy(asked), scale


def run(count: int, seed: int) -> tuple[Counter[str], list[Any]]:
    """What became of the mutants, and those that were accepted wrongly."""
    rng, tally, wrong = random.Random(seed), Counter[str](), []
    for _ in range(count):
        name, kind, asked, claimed, scale = mutant(rng)
        verdict = judge(name, asked, claimed, scale)
        if verdict.status != "verified":
            tally[verdict.status] += 1
        elif claimed == asked and obeyed(name, asked):
            tally["another claim that is obeyed" if asked != base(name) else "equivalent"] += 1
        else:
            wrong.append((name, kind, asked, claimed, scale))
        if verdict.status == "rejected" and verdict.obligation == "unexpected":
            wrong.append(("fault", name, kind, verdict.detail))
    return tally, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description="tampering with requirements")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    tally, wrong = run(given.count, given.seed)
    print(dict(tally), f"accepted wrongly: {len(wrong)}")
    for one in wrong:
        print(one, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
