"""Counterexamples that the falsifier has to find, as witness files, each replayed by LSODA.

    python benchmarks/witnesses.py [DIR]        examples/witnesses if left out

Writes one file per case, replays it and prints the table of docs/simulation.md. Exit 1 if one is not found.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np

from certify.gains.requested import requested_controller
from sims.agent_loop import agent_loop, upper_layer
from sims.falsifier import HORIZON, TOLERANCE, Candidate, Search, falsify
from sims.search_space import shared_points
from sims.witness import Witness, read_witness, replay
from symbolic.controller import Controller, CoordinatorGains
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, Plant, RequestedGains
from symbolic.plant_file import load_plant

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "examples" / "witnesses"
ALPHA = Fraction(5)


@dataclass(frozen=True)
class Case:
    """Gains ``(g, K, δ, h)`` on an example plant that a search of ``budget`` trajectories per agent has to refute; with
    a budget of 1 the only start is the centre of all boxes of agent 1.
    """

    name: str
    plant: str
    gains: tuple[int, int, int, int]
    budget: int

    def loaded(self) -> tuple[Plant, Controller]:
        """The plant and the controller with these gains for every agent."""
        plant = load_plant(ROOT / "examples" / f"{self.plant}.toml")
        gains = RequestedGains(*map(Fraction, self.gains))
        laws = [requested_controller(derived, gains) for derived in derive(plant, COST_VARIABLE).agents]
        found = tuple(law for law in laws if law is not None)
        alphas = plant.coordinator.alpha1 or ALPHA, plant.coordinator.alpha2 or ALPHA
        return plant, Controller(CoordinatorGains(*alphas), found)  # the paper's, that starts at once


CASES = (
    Case("f1", "f1_counterexample", (5, 100, 1000, 500), 4),
    Case("published", "five_agents_published", (1, 40_000, 200, 100), 16),
    Case("published-centre", "five_agents_published", (1, 40_000, 200, 100), 1),
    Case("3-30-100", "five_agents", (3, 30, 1000, 100), 128),
    Case("2-10-50", "five_agents", (2, 10, 1000, 50), 128),
)


def found(case: Case) -> Witness | None:
    """The witness that a search finds for the case."""
    plant, controller = case.loaded()
    if case.budget > 1:
        return falsify(plant, controller, budget=case.budget).witness
    shared = shared_points(plant, np.random.default_rng(0), 1, 0)
    layers = [upper_layer(plant, controller, shared[0], HORIZON)]
    search = Search(agent_loop(plant, controller, 1), shared, layers, HORIZON, TOLERANCE, (), print)
    search.evaluate([Candidate((0.5,) * len(search.box.free), 0)])
    return search.witness


def main(folder: Path) -> int:
    folder.mkdir(parents=True, exist_ok=True)
    missing = 0
    print("| file | `(g, K, δ, h)` | found, and replayed |\n|---|---|---|")
    for case in CASES:
        witness = found(case)
        if witness is None:
            print(f"| {case.name} | {case.gains} | nothing |")
            missing += 1
            continue
        file = folder / f"{case.name}.json"
        file.write_text(witness.text())
        again = replay(*case.loaded(), read_witness(file.read_text(), file.name))
        missing += not again.broken
        print(f"| `{file.name}` | {case.gains} | {again.reason} |", flush=True)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER))
