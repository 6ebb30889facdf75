"""The coordinator that waits: its proved envelope lies above every trajectory and close to it, on graphs of many kinds;
what proves it rejects what is not so (docs/coordinator.md)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from certify.bounds.float_values import float_function
from certify.checker.certificate import HeldWitness, coordinator_witness
from certify.checker.cholesky import is_positive_definite
from certify.checker.rules import chebyshev
from certify.coordinator.design import CoordinatorDesign, design_coordinator, gradients_at
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.proved import proved_envelope
from certify.curvature import Curvature, cost_curvature
from certify.foreseen import seen_optimum
from certify.optimum import optimum
from sims.coordinator import integrate_upper_layer
from symbolic.network import laplacian
from symbolic.plant import COST_VARIABLE, Interval, Plant
from symbolic.plant_file import parse_plant

QUADRATIC, SOFT = "(s - id/4)^2*(1 + id/7)", "(s - id/4)^2/2 + 2*log(cosh(s - id/4))"
Edges = list[tuple[int, int, str]]


def ring(agents: int) -> Edges:
    return [(i, i % agents + 1, "1") for i in range(1, agents + 1)]


def star(agents: int) -> Edges:
    return [edge for i in range(2, agents + 1) for edge in ((1, i, "1"), (i, 1, "2"))]


def chords(agents: int) -> Edges:
    return ring(agents) + [(i, (i + agents // 2 - 1) % agents + 1, "1/2") for i in range(1, agents + 1, 2)]


def random_digraph(agents: int) -> Edges:
    """A ring, so that it is strongly connected, and two more edges into every agent, with weights from 0.3 to 3."""
    draw = np.random.default_rng(agents)
    found = {(i, i % agents + 1): f"{draw.uniform(0.3, 3):.2f}" for i in range(1, agents + 1)}
    for target in range(1, agents + 1):
        for source in draw.choice([k for k in range(1, agents + 1) if k != target], 2, replace=False):
            found.setdefault((int(source), target), f"{draw.uniform(0.3, 3):.2f}")
    return [(j, i, weight) for (j, i), weight in found.items()]


def network(edges: Edges, cost: str = QUADRATIC, box: str = "0", tail: str = "") -> Plant:
    agents = max(max(j, i) for j, i, _ in edges)
    listed = ", ".join(f'["{j} -> {i}", "{weight}"]' for j, i, weight in edges)
    text = f"""schema = "consensus-plant/1"
name = "network"
network = {{ agents = {agents}, edges = [{listed}] }}
initial = {{ box = [-1, 1], reference = {box}, observer = 0, eta = 0 }}
[[agent]]
ids = {list(range(1, agents + 1))}
order = 1
f = "-x1"
b = 1
cost = "{cost}"
{tail}
"""
    return parse_plant(text.encode(), "network.toml")


def design(plant: Plant) -> CoordinatorDesign:
    found, curvatures = seen_optimum(plant, optimum(plant)), []
    for agent in plant.agents:
        curvature = cost_curvature(agent.cost)
        assert isinstance(curvature, Curvature)
        curvatures.append(Interval(curvature.lower, curvature.upper))
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], found.enclosure)
    result = design_coordinator(plant, found.enclosure, gradients, curvatures)
    assert isinstance(result, CoordinatorDesign), result
    return result


PLANTS: dict[str, Callable[[], Plant]] = {
    "ring of 6": lambda: network(ring(6)),
    "ring of 20, soft costs": lambda: network(ring(20), SOFT),
    "star of 9": lambda: network(star(9)),
    "chords of 10 from a box": lambda: network(chords(10), QUADRATIC, "[-1, 1]"),
    "random 12, soft costs": lambda: network(random_digraph(12), SOFT),
    "random 12 from a box, soft start": lambda: network(
        random_digraph(12), QUADRATIC, "[-0.1, 0.1]", "[coordinator]\nsoftening = 2\n"
    ),
    "two": lambda: network(ring(2)),
}


@cache
def proved(name: str) -> tuple[Plant, CoordinatorDesign]:
    plant = PLANTS[name]()
    return plant, design(plant)


def trajectories(plant: Plant, found: CoordinatorDesign, start: np.ndarray, times: np.ndarray) -> tuple[Any, Any]:
    """``y`` and ``dy/dt`` by the simulator, the latter from the equation."""
    n, gains = len(start), found.gains
    at_rest = ((), tuple(start), (0.0,) * n)
    layer = integrate_upper_layer(plant, gains, at_rest, float(times[-1]), 1e-10, 1e-12, math.inf)
    assert layer.status == "completed", layer.reason
    signals = layer.signals.sample(times)
    y, zeta = signals[:n], signals[n : 2 * n]
    slopes = [float_function(sympy.diff(agent.cost, COST_VARIABLE), COST_VARIABLE) for agent in plant.agents]
    later = times - float(gains.mixing_time)
    phi = np.exp(-float(gains.softening) * later) if gains.softening else np.zeros(len(times))
    pull = np.array(
        [slope(row) - phi * slope(row[:1] * 0 + begin) for slope, row, begin in zip(slopes, y, start, strict=True)]
    )
    r = np.array([float(weight) for weight in found.r])
    L = np.array(laplacian(plant.digraph), dtype=float)
    rate = -float(gains.gradient_gain) / r[:, None] * pull - float(gains.alpha1) * L @ y - float(gains.alpha2) * zeta
    return y, np.where(later > 0, rate, 0.0)


@pytest.mark.parametrize("name", PLANTS)
def test_the_envelope_lies_above_every_trajectory_and_close_to_it(name: str) -> None:
    plant, found = proved(name)
    envelope, agents = found.envelope, range(len(plant.agents))
    grid = np.array([float(t) for t in envelope.times])
    times = np.unique(np.concatenate([np.linspace(a, b, 7)[1:-1] for a, b in pairwise(grid)]))
    step = np.searchsorted(grid, times, side="right") - 1
    target = float(optimum(plant).enclosure.lo)
    ends = [(float(agent.initial.reference.lo), float(agent.initial.reference.hi)) for agent in plant.agents]
    draw, peaks = np.random.default_rng(3), np.zeros(len(plant.agents))
    for corner in (draw.integers(0, 2, len(ends)) for _ in range(3)):
        start = np.array([end[side] for end, side in zip(ends, corner, strict=True)])
        y, rate = trajectories(plant, found, start, times)
        for i in agents:
            agent, scale = envelope.agents[i], 1e-7 * float(envelope.agents[i].peak)
            low, high = ([float(getattr(box, end)) for box in agent.reference] for end in ("lo", "hi"))
            assert np.all(y[i] >= np.array(low)[step] - scale) and np.all(y[i] <= np.array(high)[step] + scale)
            assert np.all(np.abs(y[i] - target) <= np.array(agent.deviation, float)[step] + scale)
            bound = np.array(agent.rate, float)[step]
            assert np.all(np.abs(rate[i]) <= bound * (1 + 1e-5) + 1e-5 * float(agent.rate_peak))
            peaks[i] = max(peaks[i], float(np.max(np.abs(y[i] - target))), abs(start[i] - target))
    if all(low == high for low, high in ends):
        close = 1.5 if "soft costs" in name else 1.05  # slopes of the costs that are known only as an interval
        assert all(float(envelope.agents[i].peak) <= close * peaks[i] for i in agents)


@pytest.mark.parametrize("name", PLANTS)
def test_the_mixing_layer_has_settled_when_the_references_start(name: str) -> None:
    plant, found = proved(name)
    L = np.array(laplacian(plant.digraph), dtype=float)
    mixed = np.diagonal(expm(-float(found.gains.mixing_gain * found.gains.mixing_time) * L))
    r = np.array([float(weight) for weight in found.r])
    assert np.all(np.abs(mixed / r - 1) <= 2.0**-40 + 1e-11)


def test_what_the_file_fixes_is_kept() -> None:
    tail = "[coordinator]\nalpha1 = 40\ngradient_gain = 1/2\nmixing_gain = 30\nmixing_time = 2\nsoftening = 0\n"
    found = design(network(ring(4), tail=tail.replace("1/2", '"1/2"')))
    gains = found.gains
    assert (gains.alpha1, gains.gradient_gain, gains.mixing_gain) == (40, Fraction(1, 2), 30)
    assert (gains.mixing_time, gains.softening) == (2, 0)


@pytest.mark.parametrize("factor", [Fraction(1, 1024), Fraction(1024)])
def test_costs_in_other_units_change_the_gradient_gain_alone(factor: Fraction) -> None:
    here, there = design(network(ring(5))), design(network(ring(5), f"({QUADRATIC})*({factor})"))
    assert there.gains == replace(here.gains, gradient_gain=here.gains.gradient_gain / factor)
    assert there.envelope == here.envelope


def changed(witness: HeldWitness, name: str, value: Any) -> HeldWitness:
    return replace(witness, **{name: value})


FALSE: list[tuple[str, Callable[[HeldWitness], HeldWitness], str]] = [
    ("rate beyond the truth", lambda w: changed(w, "rate", 2 * w.rate), "Lyapunov inequality"),
    ("another norm", lambda w: changed(w, "B", tuple(-b for b in w.B)), "Lyapunov inequality"),
    ("norm of nothing", lambda w: changed(w, "c", max(w.B) ** 2), "P ≻ 0"),
    ("mixing beyond the truth", lambda w: changed(w, "mixing_rate", 2 * w.mixing_rate), "mixing: Rm L"),
    ("mixing too slow to have settled", lambda w: changed(w, "mixing_rate", w.mixing_rate / 1000), "mixing: ξ"),
    ("time goes back", lambda w: changed(w, "times", (*w.times[:-1], w.times[-3])), "times increase"),
    ("the curve begins elsewhere", lambda w: changed(w, "times", (w.times[0] / 2, *w.times[1:])), "begins at t_mix"),
]


@pytest.mark.parametrize(("edit", "reason"), [entry[1:] for entry in FALSE], ids=[entry[0] for entry in FALSE])
def test_what_is_not_so_is_rejected(edit: Callable[[HeldWitness], HeldWitness], reason: str) -> None:
    plant, found = proved("ring of 6")
    witness = coordinator_witness(found.witness)
    assert isinstance(witness, HeldWitness)
    result = proved_envelope(plant, found.gains, edit(witness), found.r, optimum(plant).enclosure)
    assert isinstance(result, str) and reason in result


def test_a_worse_curve_gives_a_wider_envelope() -> None:
    """The curve may be anything: one that is not the trajectory is paid for, never trusted."""
    plant, found = proved("ring of 6")
    witness = coordinator_witness(found.witness)
    assert isinstance(witness, HeldWitness)
    bent = tuple(tuple((a[0] + abs(a[0]) // 50 + 1, *a[1:]) for a in step) for step in witness.curve)
    result = proved_envelope(plant, found.gains, changed(witness, "curve", bent), found.r, optimum(plant).enclosure)
    assert not isinstance(result, str)
    for worse, good in zip(result.agents, found.envelope.agents, strict=True):
        assert worse.peak > good.peak and worse.energy > good.energy


# arithmetic


def test_cholesky_accepts_exactly_the_definite_ones() -> None:
    """Of ``[[2, −1, 0 …], …]`` with the corner lowered to where the determinant vanishes, at ``n/(n + 1)``."""
    for n in (1, 2, 7, 40):
        edge = Fraction(n - 1, n)
        for excess, verdict in ((Fraction(1, 10**15), True), (Fraction(0), False), (Fraction(-1, 10**15), False)):
            A = [[Fraction(2 * (i == j) - (abs(i - j) == 1)) for j in range(n)] for i in range(n)]
            A[-1][-1] = edge + excess
            scale = [Fraction(3) ** (5 * i) for i in range(n)]
            scaled = [[A[i][j] * scale[i] * scale[j] for j in range(n)] for i in range(n)]
            assert is_positive_definite(scaled) is verdict, (n, excess)


def test_cholesky_wants_symmetry() -> None:
    assert not is_positive_definite([[Fraction(2), Fraction(1)], [Fraction(0), Fraction(2)]])
    assert not is_positive_definite([[Fraction(2), Fraction(1)]])


@pytest.mark.parametrize("length", [1, 2, 3, 5, 13])
def test_chebyshev_coefficients_are_exact(length: int) -> None:
    draw = np.random.default_rng(length)
    a, b = ([int(value) for value in draw.integers(-1000, 1000, length)] for _ in range(2))
    series = np.polynomial.chebyshev
    scale = chebyshev.integral_scale(length)
    assert np.allclose(series.chebder(a) if length > 1 else [0], chebyshev.derivative(a))
    assert np.allclose(series.chebint(a, lbnd=-1), np.array(chebyshev.integral(a, scale)) / scale)
    product = np.array(chebyshev.product(a, b)) / 2
    assert np.allclose(
        series.chebval(np.linspace(-1, 1, 9), product),
        series.chebval(np.linspace(-1, 1, 9), a) * series.chebval(np.linspace(-1, 1, 9), b),
    )
    values = series.chebval(np.cos(np.linspace(0, np.pi, 1001)), a)
    assert np.max(np.abs(values)) <= chebyshev.size(a) and values[-1] == pytest.approx(chebyshev.at_start(a))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    mean = math.sqrt(float(weights @ series.chebval(nodes, a) ** 2) / 2)
    assert mean <= chebyshev.root_mean_square(a)
    if length <= 4:
        assert chebyshev.root_mean_square(a) <= mean + 3
    for row in chebyshev.monomials(length):
        assert np.allclose(series.chebval(0.3, [float(c) for c in row]), 0.3 ** (len(row) - 1))
