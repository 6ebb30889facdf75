"""Networks of any size: what a coordinator costs to produce and to check, and how close it is to the truth.

    python -m benchmarks.networks                 the coordinator alone: rings, chords, stars, random digraphs
    python -m benchmarks.networks --gains 10 100  certificates of whole networks of order 1, and their check

One row per network: seconds of producing (search, proof by the checker's rule) and of that proof alone, the proved rate
over the spectrum's, and the proved peak of ``|y^r − s*|`` over the simulated one, from starts at 0.
"""

from __future__ import annotations

import argparse
import os
import resource
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it, before NumPy is loaded

from collections.abc import Callable, Iterator

import numpy as np

from certify.assumptions.check import check_assumptions
from certify.certificate import certificate_bytes
from certify.checker import check
from certify.checker.certificate import coordinator_witness
from certify.coordinator.design import CoordinatorDesign, design_coordinator, gradients_at
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.proved import proved_envelope
from certify.coordinator.stability import Unstable
from certify.coordinator.structured import System
from certify.curvature import Curvature, cost_curvature
from certify.foreseen import seen_optimum
from certify.optimum import optimum
from certify.pipeline import design_gains
from sims.coordinator import integrate_upper_layer
from symbolic.network import laplacian
from symbolic.plant import Interval, Plant
from symbolic.plant_file import parse_plant

QUADRATIC, SOFT = "(s - id/{N})^2*(1 + id/{N})/2", "(s - id/{N})^2/2 + 2*log(cosh(s - id/{N}))"
Edges = list[tuple[int, int, str]]


def ring(agents: int) -> Edges:
    return [(i, i % agents + 1, "1") for i in range(1, agents + 1)]


def star(agents: int) -> Edges:
    return [edge for i in range(2, agents + 1) for edge in ((1, i, "1"), (i, 1, "1"))]


def chords(agents: int) -> Edges:
    return ring(agents) + [(i, (i + agents // 2 - 1) % agents + 1, "1") for i in range(1, agents + 1, 3)]


def random_digraph(agents: int) -> Edges:
    """A ring and two more edges into every agent, with weights from 0.3 to 3: in-degree 3, unbalanced."""
    draw = np.random.default_rng(agents)
    found = {(i, i % agents + 1): f"{draw.uniform(0.3, 3):.2f}" for i in range(1, agents + 1)}
    for target in range(1, agents + 1):
        for source in draw.choice([k for k in range(1, agents + 1) if k != target], 2, replace=False):
            found.setdefault((int(source), target), f"{draw.uniform(0.3, 3):.2f}")
    return [(j, i, weight) for (j, i), weight in found.items()]


GRAPHS: dict[str, Callable[[int], Edges]] = {"ring": ring, "chords": chords, "star": star, "random": random_digraph}


def network(edges: Edges, cost: str) -> Plant:
    agents = max(max(j, i) for j, i, _ in edges)
    listed = ", ".join(f'["{j} -> {i}", "{weight}"]' for j, i, weight in edges)
    text = f"""schema = "consensus-plant/1"
name = "network"
network = {{ agents = {agents}, edges = [{listed}] }}
initial = {{ box = [-1, 1], reference = 0, observer = 0, eta = 0 }}
[[agent]]
ids = {list(range(1, agents + 1))}
order = 1
f = "-p*x1"
b = 1
cost = "{cost.replace("{N}", str(agents))}"
uncertain = {{ p = ["1/2", "3/2"] }}
"""
    return parse_plant(text.encode(), "network.toml")


def designed(plant: Plant) -> CoordinatorDesign | Unstable:
    found, curvatures = seen_optimum(plant, optimum(plant)), []
    for agent in plant.agents:
        curvature = cost_curvature(agent.cost)
        assert isinstance(curvature, Curvature)
        curvatures.append(Interval(curvature.lower, curvature.upper))
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], found.enclosure)
    return design_coordinator(plant, found.enclosure, gradients, curvatures)


def spectral_rate(plant: Plant, found: CoordinatorDesign, slopes: list[float]) -> float:
    """Of the limit system with the given slopes of the costs."""
    r = np.array([float(weight) for weight in found.r])
    damping = float(found.gains.gradient_gain) * np.array(slopes) / r
    L = np.array(laplacian(plant.digraph), dtype=float)
    return System(L, r, damping, damping, float(found.gains.alpha1), float(found.gains.alpha2)).slowest()


def peak_ratio(plant: Plant, found: CoordinatorDesign) -> float:
    """The largest of ``proved/simulated`` over the agents."""
    target = float(seen_optimum(plant, optimum(plant)).enclosure.lo)
    count, end = len(plant.agents), float(found.envelope.horizon)
    layer = integrate_upper_layer(plant, found.gains, ((), (0.0,) * count, (0.0,) * count), end, 1e-8, 1e-10, 1e12)
    y = layer.signals.sample(np.linspace(0, end, 2001))[:count]
    peaks = np.maximum(np.max(np.abs(y - target), axis=1), abs(target))
    return max(float(agent.peak) / peak for agent, peak in zip(found.envelope.agents, peaks, strict=True))


def coordinators(sizes: list[int]) -> Iterator[str]:
    yield "| graph | costs | N | steps | produce, s | check, s | proved rate / spectrum's | proved peak / simulated |"
    yield "|---|---|---|---|---|---|---|---|"
    for name, graph in GRAPHS.items():
        for label, cost in (("quadratic", QUADRATIC), ("soft", SOFT)):
            for size in sizes:
                plant = network(graph(size), cost)
                begun = time.process_time()
                found = designed(plant)
                produced = time.process_time() - begun
                if isinstance(found, Unstable):
                    yield f"| {name} | {label} | {size} | – | {produced:.2f} | – | {found.reason} | – |"
                    continue
                begun = time.process_time()
                witness = coordinator_witness(found.witness)
                proved_envelope(plant, found.gains, witness, found.r, seen_optimum(plant, optimum(plant)).enclosure)
                checked = time.process_time() - begun
                slopes = [1 + (i + 1) / size if cost is QUADRATIC else 1.0 for i in range(size)]
                rate = float(found.rate) / spectral_rate(plant, found, slopes)
                yield (
                    f"| {name} | {label} | {size} | {len(found.envelope.times) - 1} | {produced:.2f} | {checked:.2f} | "
                    f"{rate:.2f} | {peak_ratio(plant, found):.3f} |"
                )


def networks(sizes: list[int]) -> Iterator[str]:
    yield "| graph | N | gains, s wall | verify, s | MB of the certificate | status |"
    yield "|---|---|---|---|---|---|"
    for name in ("ring", "random"):
        for size in sizes:
            plant = network(GRAPHS[name](size), QUADRATIC)
            begun = time.perf_counter()
            result = design_gains(plant, "direct", check=check_assumptions(plant))
            took = time.perf_counter() - begun
            if result.certificate is None:
                yield f"| {name} | {size} | {took:.1f} | – | – | {result.status}: {result.reason[:80]} |"
                continue
            data = certificate_bytes(result.certificate)
            begun = time.perf_counter()
            verdict = check(plant.source, data)
            checked = time.perf_counter() - begun
            yield f"| {name} | {size} | {took:.1f} | {checked:.1f} | {len(data) / 1e6:.1f} | {verdict.status} |"
    yield f"largest memory of this process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=[6, 10, 20, 50, 100])
    parser.add_argument("--gains", type=int, nargs="+")
    chosen = parser.parse_args()
    for line in networks(chosen.gains) if chosen.gains else coordinators(chosen.sizes):
        print(line, flush=True)


if __name__ == "__main__":
    main()
