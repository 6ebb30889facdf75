"""The theorem direct/3 itself: simulated closed loops stay within every number of a certificate that is verified.

The loops (``tiny_loops.py``) owe nothing to the checker's rules.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from direct_producer import Json, Tiny
from tiny_loops import MODELS, Array, Simulation, hold_against, sizes

from certify.checker import check
from certify.checker.certificate import read_certificate
from certify.checker.intervals import Interval
from certify.checker.plant import read_plant
from certify.checker.rules import assumptions, coordinator
from certify.checker.rules.first_phase import FirstPhase
from certify.checker.rules.increments import Increments
from certify.checker.rules.observer import tabulate
from certify.checker.rules.surroundings import Exosystem, Outside
from certify.checker.rules.zero_ranges import ZeroRanges
from certify.checker.theorems import kinds
from certify.checker.verdict import start_meter


@cache
def certified(name: str) -> tuple[Tiny, Json]:
    tiny = MODELS[name][0]()
    certificate = producer.produce(tiny)
    assert check(tiny.toml, producer.encode(certificate)).status == "verified"
    return tiny, certificate


@cache
def simulations(name: str) -> list[Simulation]:
    return [Simulation(name, seed) for seed in range(12)]


def first_phase(name: str) -> FirstPhase:
    """The rule, as the checker sets it up."""
    start_meter()
    tiny, certificate = certified(name)
    plant, read = read_plant(tiny.toml), read_certificate(producer.encode(certificate), kinds())
    facts = assumptions.prove(plant, read)
    agent, claim, witness = plant.agents[0], read.claim.agents[0], read.witness.agents[0]
    assert not isinstance(witness, assumptions.AgentWitness)
    reference = coordinator.prove(plant, read, facts)[0].reference
    Q = read.witness.exosystem.Q if read.witness.exosystem else []
    around, known = Exosystem(plant.S or [], Q, facts.v_at_start, facts.v), facts.agents[0]
    outside = Outside(around, reference, known.steady_nodes, agent.parameters, known.roots)
    increments = Increments(agent, reference.optimum, facts.agents[0].w, ZeroRanges("agent 1", agent, witness.ranges))
    return FirstPhase("agent 1", agent, claim, witness, facts.agents[0], outside, increments, tabulate)


def above(parts: Any) -> Array:
    return np.array([float(part.hi) for part in parts])


@pytest.mark.parametrize("name", MODELS)
def test_simulated_loops_stay_in_the_boxes_of_both_phases(name: str) -> None:
    assert hold_against(*certified(name), simulations(name)) > 0.5, "a bound that is never approached tests little"


@pytest.mark.parametrize("name", [name for name in MODELS if name != "measured"])
def test_what_the_first_phase_hands_on_bounds_simulated_loops(name: str) -> None:
    """After every step: the magnitudes, ``|ẋ_n|`` so far, the observer's error, and ``Y`` at the end."""
    rule = first_phase(name)
    X, fastest, saturated = rule.at_start(), Interval(0, 0), False
    tiny, grid = certified(name)[0], [float(t) for t in rule.phase.grid]
    for k in range(len(rule.phase.boxes)):
        X, fastest = rule.step(k, X, fastest)
        error = above(rule.observer.error(rule.phase.grid[k], fastest)) if rule.observer else np.zeros(0)
        bounds = np.concatenate([above(X.z), above(X.x), above([X.theta]), above(X.zeta)])
        for loop in simulations(name):
            now = loop.at(grid[k + 1])
            assert (sizes(now["z_bar"], now["x"], now["theta"], now["zeta"]) <= bounds + 1e-8).all()
            for t in np.linspace(grid[k], grid[k + 1], 4):
                now = loop.at(t)
                assert tiny.n == 1 or abs(now["speed"]) <= float(fastest.hi)
                assert (np.abs(now["e"]) <= error * (1 + 1e-6) + 1e-8).all()
                saturated |= abs(tiny.claim["K"] * now["estimate"]) > tiny.claim["delta"]
    Y = above(rule.at_end())
    change = (1 / (1 - tiny.b_radius) - 1) * above(X.x)[-1]
    at = tiny.nz + tiny.n
    assert np.allclose(Y[at : at + len(X.zeta)], above(X.zeta) + change * np.abs(simulations(name)[0].N), rtol=1e-9)
    for loop in simulations(name):
        now = loop.at(float(tiny.T1))
        zeta = now["eta"] - loop.N * now["x"][-1]
        assert (sizes(now["z_bar"], now["x"][:-1], now["theta"], zeta, now["e"]) <= Y + 1e-8).all()
    assert saturated == (name != "exosystem")
