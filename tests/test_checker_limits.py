"""How far the checker of direct/3 can be pushed: witnesses drawn in to the limit, and claims widened until they fail.

Whatever is still verified must hold simulated loops; a claim about a loop that is unstable must never be.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from direct_producer import Json, Tiny
from limits import Unsettled, at_the_limit
from tiny_loops import MODELS, Simulation, hold_against

from certify.checker import check
from certify.checker.verdict import Rejected, Undecided

CLOSE = {"saturated": 0.99, "tight": 0.99, "second": 0.9, "measured": 0.7, "third": 0.9, "exosystem": 0.7}
"""How much of some box the loops use, at least."""
NOTHING = Fraction(1, 10**6)


QUICK = ["tight", "second", "exosystem"]


@cache
def made(name: str) -> tuple[Tiny, Json]:
    tiny = MODELS[name][0]()
    return tiny, producer.produce(tiny)


@cache
def drawn_in(name: str, refine: int = 1) -> Json:
    tiny, certificate = made(name)
    return at_the_limit(tiny.toml, certificate, refine=refine)


def verdict(tiny: Tiny, certificate: Json) -> str:
    return check(tiny.toml, producer.encode(certificate)).status


@pytest.mark.parametrize("name", QUICK)
def test_witnesses_at_the_limit_bound_simulated_loops(name: str) -> None:
    tiny, certificate = made(name)[0], drawn_in(name)
    assert verdict(tiny, certificate) == "verified"
    used = hold_against(tiny, certificate, [Simulation(name, seed) for seed in range(12)])
    assert used > CLOSE[name]


@pytest.mark.slow
@pytest.mark.parametrize("refine", [1, 4])
@pytest.mark.parametrize("name", MODELS)
def test_witnesses_at_the_limit_bound_many_simulated_loops(name: str, refine: int) -> None:
    tiny, certificate = made(name)[0], drawn_in(name, refine)
    assert verdict(tiny, certificate) == "verified"
    assert hold_against(tiny, certificate, (Simulation(name, seed) for seed in range(100))) > CLOSE[name]


def places(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where the numbers of a table are, except for those that are next to nothing."""
    if isinstance(value, str):
        if abs(Fraction(value)) > NOTHING:
            yield path
    else:
        for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
            yield from places(entry, (*path, key))


@pytest.mark.parametrize("name", ["tight", "exosystem"])
def test_nothing_below_the_limit_is_verified(name: str) -> None:
    """A number of every kind, 1/1000 nearer to what it bounds; a kernel is lowered as a whole."""
    tiny, certificate = made(name)[0], drawn_in(name)
    witness, random = certificate["witness"]["agents"][0], np.random.default_rng(0)
    kinds = {key: list(places(witness[key])) for key in ("boxes", "ranges", "kernels")}
    kinds |= {"box": list(places(witness["tail"]["box"])), "vartheta": list(places(witness["phase1"]["vartheta"]))}
    for kind, found in kinds.items():
        parent = {"box": "tail", "vartheta": "phase1"}.get(kind)
        for at in random.permutation(len(found))[:4]:
            changed = copy.deepcopy(certificate)
            table = changed["witness"]["agents"][0]
            table, (*path, last) = (table[parent] if parent else table)[kind], found[at]
            for key in path:
                table = table[key]
            table[last] = nearer(kind, last, table[last])
            if kind == "kernels":
                table[:] = [str(Fraction(entry) * Fraction(999, 1000)) for entry in table]
            assert verdict(tiny, changed) == "rejected", (kind, found[at])


def nearer(kind: str, last: int, value: str) -> str:
    number = Fraction(value)
    if kind == "ranges":  # the upper end is lowered, the lower one raised
        return str(number + (Fraction(1, 1000) if last == 0 else Fraction(-1, 1000)))
    return str(number * Fraction(999, 1000))


WIDENED = [
    ("saturated", "p", "x1"),
    ("saturated", "q", "b"),
    ("exosystem", "q", "b"),
    pytest.param("measured", "p", "x2", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("name", "parameter", "slope"), WIDENED)
def test_no_claim_about_an_unstable_loop_has_a_witness(name: str, parameter: str, slope: str) -> None:
    """The parameter's interval is widened to where the linear loop is no longer stable, or to a part of that."""
    tiny, certificate = made(name)
    A, columns, outputs = producer.loop(tiny)
    row = outputs[-1] if slope == "b" else outputs[tiny.nz + int(slope[1:]) - 1]
    limit = marginal(A, np.outer(columns[:, tiny.nz], row))
    assert widened(tiny, certificate, parameter, 0.2 * limit) == "verified"
    for factor in (1.01, 1.5):
        assert widened(tiny, certificate, parameter, factor * limit) != "verified"


def marginal(A: Any, change: Any) -> float:
    """The least ``r`` for which ``A + r·change`` or ``A − r·change`` is not Hurwitz."""
    radii = np.geomspace(1e-3, 1e3, 4000)
    return float(next(r for r in radii for sign in (-1, 1) if np.linalg.eigvals(A + sign * r * change).real.max() >= 0))


def widened(tiny: Tiny, certificate: Json, parameter: str, radius: float) -> str:
    """The verdict on the best witness for the same gains and the parameter in ``±radius``, or why there is none."""
    toml, certificate = tiny.toml.decode(), copy.deepcopy(certificate)
    start = toml.index(f" {parameter} = [") + 1
    toml = toml[:start] + f"{parameter} = [-{radius:.9f}, {radius:.9f}]" + toml[toml.index("]", start) + 1 :]
    certificate["claim"]["plant_sha256"] = hashlib.sha256(toml.encode()).hexdigest()
    certificate["claim"]["agents"][0]["delta"] = "1000000000000"
    agent = certificate["witness"]["agents"][0]
    agent.update(phase1={"grid": ["0"], "boxes": [], "vartheta": []}, grid=["0", *agent["grid"][1:]], ranges=[])
    try:
        found = at_the_limit(toml.encode(), certificate)
    except (Unsettled, Rejected, Undecided) as reason:
        return str(reason)
    return check(toml.encode(), producer.encode(found)).status
