"""At which sampling rate gains that work in continuous time stop to work: agent 1 of the five, from a corner.

    python examples/sampling_rate.py

Prints the largest |y − s*| over the last 2 of 15 seconds for each rate, and what noise and delay do at 2000 Hz.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

from certify.gains.requested import requested_controller
from sims.sampled_controller import run_sampled
from sims.search_space import AgentPoint, SharedPoint
from symbolic.controller import Controller, CoordinatorGains
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, RequestedGains
from symbolic.plant_file import load_plant

GAINS = {
    "(g, K, h) = (2, 60, 200)": RequestedGains(Fraction(2), Fraction(60), Fraction(1000), Fraction(200)),
    "(g, K, h) = (5, 100, 500)": RequestedGains(Fraction(5), Fraction(100), Fraction(1000), Fraction(500)),
}
RATES = (2000, 1000, 500, 300, 200, 150, 100, 70, 50)


def main() -> None:
    plant = load_plant(Path(__file__).parent / "five_agents.toml")
    derivation = derive(plant, COST_VARIABLE)
    half = Fraction(1, 2)
    one, zero = Fraction(1), Fraction(0)
    start = AgentPoint((-half, 3 * half, 3 * half), (one,), (one, one), (zero, zero), (zero, zero))
    shared = SharedPoint((Fraction(0), Fraction(1)), (Fraction(0),) * 5)
    for name, gains in GAINS.items():
        laws = tuple(law for agent in derivation.agents if (law := requested_controller(agent, gains)) is not None)
        controller = Controller(CoordinatorGains(Fraction(5), Fraction(5)), laws)
        print(name)
        for rate in RATES:
            run = run_sampled(plant, controller, 1, start, shared, rate=rate, horizon=15)
            print(f"  {rate:5d} Hz   |y - s*| = {run.final_error(2):.2g}")
        for label, noise, delay in (("noise 1e-3", 1e-3, 0), ("delay of 2 samples", 0.0, 2)):
            run = run_sampled(plant, controller, 1, start, shared, rate=2000, horizon=15, noise=noise, delay=delay)
            print(f"  2000 Hz   |y - s*| = {run.final_error(2):.2g}   with {label}")


if __name__ == "__main__":
    main()
