"""The coordinator: proved bounds lie above every simulated trajectory and near the best one, or are refused."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import sympy
from flint import arb, arb_mat, ctx
from scipy.integrate import solve_ivp

from certify.bounds.balls import to_arb
from certify.coordinator.design import CoordinatorDesign, gradients_at
from certify.coordinator.envelope import norm_gains
from certify.coordinator.mixing import Mixing, mixing
from certify.coordinator.nominal import CoordinatorModel, cost_gradient, nominal_trajectory
from certify.coordinator.printed import PrintedDesign, design_printed
from certify.coordinator.stability import Unstable, damping_ranges, inequality, mixing_rate, stabilise
from certify.curvature import Curvature, cost_curvature
from certify.inequalities.exact_psd import PositiveDefinite, prove_positive_definite
from certify.inequalities.matrices import lyapunov_form
from certify.optimum import Optimum, optimum
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import COST_VARIABLE, Interval, Plant
from symbolic.plant_file import parse_plant

QUADRATIC, SOFT = "(s - id)^2/2", "s^2/2 + log(1 + exp(s - id))"
FIVE = [(3, 1), (1, 2), (2, 3), (3, 4), (4, 5), (2, 5), (5, 1)]


def network(agents: int, edges: str, cost: str = QUADRATIC, box: str = "0", tail: str = "") -> Plant:
    text = f"""
schema = "consensus-plant/1"
name = "network"
network = {{ agents = {agents}, edges = [{edges}] }}
initial = {{ box = 1, reference = {box} }}
[[agent]]
ids = {list(range(1, agents + 1))}
order = 1
f = 0
b = 1
cost = "{cost}"
{tail}"""
    return parse_plant(text.encode(), "network.toml")


PAIR = "[coordinator]\nalpha1 = 3\nalpha2 = 2"


def ring(agents: int, cost: str = QUADRATIC, box: str = "0", weight: str = "1", tail: str = PAIR) -> Plant:
    pairs = [f'["{i} -> {i % agents + 1}", "{weight if i == 1 else 1}"]' for i in range(1, agents + 1) if agents > 1]
    return network(agents, ", ".join(pairs), cost, box, tail)


def example(box: str, tail: str = "") -> Plant:
    """The paper's digraph and costs, order 1: only the coordinator matters here."""
    return network(5, ", ".join(f'"{j} -> {i}"' for j, i in FIVE), "(s - id + 1)^2/4", box, tail)


def design(plant: Plant) -> PrintedDesign | Unstable:
    found, curvatures = optimum(plant), []
    for agent in plant.agents:
        curvature = cost_curvature(agent.cost)
        assert isinstance(curvature, Curvature)
        curvatures.append(Interval(curvature.lower, curvature.upper))
    gradients = gradients_at([cost_gradient(agent.cost) for agent in plant.agents], found.enclosure)
    return design_printed(plant, found.enclosure, gradients, curvatures)


PLANTS = {
    "one": lambda: ring(1, box="[-2, 3]", tail=""),
    "two": lambda: ring(2, SOFT, "[-1, 2]"),
    "three-weighted": lambda: ring(3, QUADRATIC, "[-1, 1]", "1/3"),
    "four-soft": lambda: ring(4, SOFT, "[-0.5, 0.5]"),
    "six": lambda: ring(6, "(s - id)^2/3"),
    "example": lambda: example("0"),
    "example-box": lambda: example("[-1, 1]", PAIR),
}


@cache
def proved(name: str) -> tuple[Plant, PrintedDesign]:
    plant = PLANTS[name]()
    result = design(plant)
    assert isinstance(result, PrintedDesign), result
    return plant, result


class Simulation:
    """``ỹ`` and ``ẏ^r`` of the coordinator at given instants, in floats, by an integrator that knows no proof."""

    def __init__(self, plant: Plant, alpha: tuple[Fraction, Fraction]) -> None:
        self.L = np.array(laplacian(plant.digraph), float)
        self.alpha1, self.alpha2 = map(float, alpha)
        self.slopes = [sympy.lambdify(COST_VARIABLE, sympy.diff(a.cost, COST_VARIABLE), "numpy") for a in plant.agents]
        found: Optimum = optimum(plant)
        self.optimum = float((found.enclosure.lo + found.enclosure.hi) / 2)
        self.values, self.left = np.linalg.eig(self.L)
        self.right = np.linalg.inv(self.left)
        self.n = len(self.L)

    def derivative(self, t: float, q: np.ndarray) -> np.ndarray:
        y, zeta = q[: self.n], q[self.n :]
        xi = np.einsum("ik,k,ki->i", self.left, np.exp(-self.values * t), self.right).real
        gradient = np.array([float(slope(value)) for slope, value in zip(self.slopes, y, strict=True)])
        flow = self.alpha1 * self.L @ y
        return np.r_[-gradient / xi - flow - self.alpha2 * zeta, flow]

    def run(self, start: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q0 = np.r_[start, np.zeros(self.n)]
        result = solve_ivp(self.derivative, (0, times[-1]), q0, "DOP853", times, rtol=1e-12, atol=1e-14)
        assert result.success
        rates = np.array([self.derivative(t, q)[: self.n] for t, q in zip(times, result.y.T, strict=True)]).T
        return result.y[: self.n] - self.optimum, rates


def starts(plant: Plant, count: int) -> np.ndarray:
    low, high = (np.array([float(getattr(a.initial.reference, end)) for a in plant.agents]) for end in ("lo", "hi"))
    random = np.random.default_rng(7).uniform(size=(count, len(low)))
    random[: count // 2] = random[: count // 2].round()  # half of them at vertices
    return low + random * (high - low)


# bounds above every trajectory


@pytest.mark.parametrize("name", PLANTS)
def test_envelopes_lie_above_every_trajectory(name: str) -> None:
    """56 starts over all plants: enclosures of ``y^r``, ``|y^r − s*|``, ``|ẏ^r|``, their tails and both energies."""
    plant, found = proved(name)
    simulation = Simulation(plant, (found.model.alpha1, found.model.alpha2))
    envelope, per_step = found.envelope, 4
    steps = min(found.mixing.steps, 384)
    step, end = float(found.mixing.step), float(envelope.horizon)
    inside = np.arange(1, per_step * steps) * step / per_step
    late = np.linspace(end, end + 6, 7)[1:]
    times = np.r_[0, inside[inside < end], late]
    point = all(agent.initial.reference.is_point for agent in plant.agents)
    on_grid = times < end
    index = (times[on_grid] / step * (1 - 1e-12)).astype(int)
    decay = np.exp(-float(envelope.tail_decay) * (times[~on_grid] - end))
    for start in starts(plant, 1 if point else 11):
        deviations, rates = simulation.run(start, times)
        for agent, deviation, rate in zip(envelope.agents, deviations, rates, strict=True):
            y = deviation[on_grid] + simulation.optimum
            assert (y >= np.array([float(box.lo) for box in agent.reference])[index] - 1e-7).all()
            assert (y <= np.array([float(box.hi) for box in agent.reference])[index] + 1e-7).all()
            assert (np.abs(deviation[on_grid]) <= np.array(agent.deviation, float)[index] + 1e-7).all()
            assert (np.abs(rate[on_grid]) <= np.array(agent.rate, float)[index] + 1e-7).all()
            assert (np.abs(deviation[~on_grid]) <= float(agent.tail_deviation) * decay + 1e-7).all()
            assert (np.abs(rate[~on_grid]) <= float(agent.tail_rate) * decay + 1e-7).all()
            assert np.abs(deviation).max() <= float(agent.peak) + 1e-9
            assert np.abs(rate).max() <= float(agent.rate_peak) + 1e-9
            early = times <= inside[-1]
            assert np.trapezoid(deviation[early] ** 2, times[early]) <= float(agent.energy) * (1 + 1e-4) + 1e-9
            assert np.trapezoid(rate[early] ** 2, times[early]) <= float(agent.rate_energy) * (1 + 1e-4) + 1e-9


@pytest.mark.parametrize("name", ["example", "six"])
def test_envelopes_of_a_point_are_near_the_trajectory(name: str) -> None:
    """Peaks within 5 % of the only trajectory, energies within 15 %; norm bounds from t = 0 are 15 to 40 times it."""
    plant, found = proved(name)
    simulation = Simulation(plant, (found.model.alpha1, found.model.alpha2))
    times = np.linspace(0, float(found.envelope.horizon), 4001)
    deviations, rates = simulation.run(starts(plant, 1)[0], times)
    for i, agent in enumerate(found.envelope.agents):
        assert float(agent.peak) <= 1.05 * np.abs(deviations[i]).max()
        assert float(agent.rate_peak) <= 1.05 * np.abs(rates[i]).max()
        assert float(agent.energy) <= 1.15 * np.trapezoid(deviations[i] ** 2, times)
        assert float(agent.rate_energy) <= 1.15 * np.trapezoid(rates[i] ** 2, times)


def test_a_box_costs_a_norm(record_property: pytest.RecordProperty) -> None:
    """From the unit box the envelope is the nominal trajectory plus a norm: 1.5 to 1.7 times the worst vertex."""
    plant, found = proved("example-box")
    simulation = Simulation(plant, (found.model.alpha1, found.model.alpha2))
    times = np.linspace(0, 8, 161)
    runs = [simulation.run(start, times) for start in starts(plant, 12)]
    for i, agent in enumerate(found.envelope.agents):
        best = max(np.abs(deviation[i]).max() for deviation, _ in runs)
        ratio = float(agent.peak) / best
        record_property(f"peak ratio of agent {i + 1}", float(ratio))
        assert 1 <= ratio < 2


# mixing


@pytest.mark.parametrize("name", ["two", "three-weighted", "example"])
def test_mixing_encloses_the_matrix_exponential(name: str) -> None:
    """Against ``e^(−Lt)`` evaluated afresh in balls, on dense samples inside and beyond the grid."""
    plant, _ = proved(name)
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    grid = mixing(L, r, Fraction(1, 16), 96)
    size = len(L)
    with ctx.workprec(160):
        for sample in range(0, 7 * 96 + 200, 5):
            t = Fraction(sample, 7 * 16)
            exact = arb_mat([[to_arb(-entry * t) for entry in row] for row in L]).exp()
            k = int(t / grid.step)
            for i in range(size):
                low, high = grid.ranges[k][i] if k < grid.steps else (grid.smallest[i], grid.largest[i])
                assert not exact[i, i] < low and not exact[i, i] > high
                assert not exact[i, i] < grid.smallest[i] and not exact[i, i] > grid.largest[i]
                if k >= grid.steps:
                    distance = abs(exact[i, i] - to_arb(r[i]))
                    assert distance < grid.residual[i] * (-to_arb(mixing_rate(L, r)) * to_arb(t - 6)).exp()
    widths = [float(high - low) for row in grid.ranges for low, high in row]
    assert max(widths) < 0.25


@pytest.mark.parametrize("size", [6, 15])
def test_the_residual_of_a_column_that_has_mixed_to_the_last_bit_is_a_number(size: int) -> None:
    """The leaves of a star mix at equal rates, so that a deviation becomes a ball around 0."""
    hub, leaf = Fraction(1, size - 1), Fraction(1)
    L = [[Fraction(1), *[-hub] * (size - 1)]]
    L += [[-leaf, *(leaf * int(j == i) for j in range(1, size))] for i in range(1, size)]
    r = [Fraction(1, 2), *[Fraction(1, 2) * hub] * (size - 1)]
    grid = mixing(tuple(map(tuple, L)), r, Fraction(1, 8), 384)
    assert all(entry.is_finite() and 0 < entry < 1e-20 for entry in grid.residual)


def test_mixing_can_be_too_coarse_to_be_of_use(five_agents: Plant) -> None:
    """On one long step nothing keeps ``ξ`` from 0; the design says so instead of dividing by it."""
    L, r = laplacian(five_agents.digraph), left_null_vector(five_agents.digraph)
    assert min(float(value) for value in mixing(L, r, Fraction(2), 4).smallest) == 0


@pytest.mark.parametrize("name", [name for name in PLANTS if name != "one"])
def test_the_mixing_rate_is_proved_and_near_the_eigenvalue(name: str) -> None:
    plant, _ = proved(name)
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    rate, size = mixing_rate(L, r), len(r)

    def gap(value: Fraction) -> np.ndarray:
        flow = [[r[i] * L[i][j] + r[j] * L[j][i] for j in range(size)] for i in range(size)]
        spread = [[(r[i] if i == j else 0) - r[i] * r[j] for j in range(size)] for i in range(size)]
        return np.array(flow, float) - 2 * float(value) * np.array(spread, float)

    assert rate > 0
    assert np.linalg.eigvalsh(gap(rate))[0] > -1e-12
    assert np.linalg.eigvalsh(gap(rate * Fraction(102, 100)))[0] < -1e-6  # 2 % more is false


def test_no_mixing_rate_without_strong_connection() -> None:
    L = ((Fraction(0), Fraction(0)), (Fraction(-1), Fraction(1)))
    with pytest.raises(ArithmeticError, match="is the digraph strongly connected"):
        mixing_rate(L, (Fraction(1, 2), Fraction(1, 2)))


# the matrix inequality


def closed_loop(model: CoordinatorModel, damping: list[Fraction]) -> tuple[tuple[Fraction, ...], ...]:
    """``A(D)``, written anew."""
    n, r = model.size, model.left_null_vector
    B = [[Fraction(int(i == j)) for j in range(n - 1)] for i in range(n - 1)] + [[-r[j] / r[-1] for j in range(n - 1)]]
    top = [
        tuple(-model.alpha1 * model.laplacian[i][j] - (damping[i] if i == j else 0) for j in range(n))
        + tuple(-model.alpha2 * x for x in B[i])
        for i in range(n)
    ]
    bottom = [tuple(model.alpha1 * x for x in model.laplacian[i]) + (Fraction(0),) * (n - 1) for i in range(n - 1)]
    return (*top, *bottom)


@pytest.mark.parametrize("name", PLANTS)
def test_the_lyapunov_matrix_serves_every_vertex_of_the_damping(name: str) -> None:
    """``A(D)ᵀP + PA(D) + 2λ0P ≺ 0`` exactly, at random vertices and inner points."""
    _, found = proved(name)
    comparison, model = found.comparison, found.model
    assert isinstance(prove_positive_definite(comparison.P), PositiveDefinite)
    generator = np.random.default_rng(3)
    for _ in range(12):
        shares = [Fraction(int(x), 4) for x in generator.choice([0, 4, 4, 0, 1], size=model.size)]
        damping = [d.lo + share * (d.hi - d.lo) for d, share in zip(comparison.damping, shares, strict=True)]
        A = closed_loop(model, damping)
        shifted = tuple(
            tuple(x + (comparison.rate if i == j else 0) for j, x in enumerate(row)) for i, row in enumerate(A)
        )
        negative = tuple(tuple(-x for x in row) for row in lyapunov_form(shifted, comparison.P))
        assert isinstance(prove_positive_definite(negative), PositiveDefinite)


def test_a_larger_rate_is_not_proved_with_the_same_matrix() -> None:
    _, found = proved("example")
    c = found.comparison
    assert isinstance(
        prove_positive_definite(inequality(found.model, c.damping, c.P, c.multiplier, c.rate)), PositiveDefinite
    )
    worse = inequality(found.model, c.damping, c.P, c.multiplier, 4 * c.rate)
    assert not isinstance(prove_positive_definite(worse), PositiveDefinite)


def test_damping_holds_every_slope_over_every_xi() -> None:
    plant, found = proved("four-soft")
    grid = found.mixing
    curvatures = [Interval(Fraction(1), Fraction(5, 4))] * 4
    for damping, slope, low, high in zip(
        damping_ranges(grid, curvatures), curvatures, grid.smallest, grid.largest, strict=True
    ):
        assert damping.lo <= slope.lo / Fraction(float(high)).limit_denominator(10**6) + Fraction(1, 10**5)
        assert not to_arb(damping.hi) < to_arb(slope.hi) / low
        assert not to_arb(damping.lo) > to_arb(slope.lo) / high
    assert plant.name == "network"


# α1, α2


def test_an_unstable_pair_is_refused() -> None:
    result = design(example("0", "[coordinator]\nalpha1 = 1\nalpha2 = 80"))
    assert isinstance(result, Unstable)
    assert result.reason == "no Lyapunov matrix was found for α1 = 1, α2 = 80"


@pytest.mark.parametrize(("alpha1", "alpha2"), [("5", "5"), ("7/3", "3/2")])
def test_a_given_pair_is_kept(alpha1: str, alpha2: str) -> None:
    result = design(ring(3, tail=f'[coordinator]\nalpha1 = "{alpha1}"\nalpha2 = "{alpha2}"'))
    assert isinstance(result, PrintedDesign)
    assert (result.model.alpha1, result.model.alpha2) == (Fraction(alpha1), Fraction(alpha2))


def test_half_a_given_pair_is_kept_and_the_other_half_found() -> None:
    result = design(ring(2, tail="[coordinator]\nalpha2 = 4"))
    assert isinstance(result, PrintedDesign)
    assert result.model.alpha2 == 4


def test_stabilise_tells_how_often_it_tried() -> None:
    _, found = proved("two")
    impossible = replace(found.model, alpha2=Fraction(-1))
    result = stabilise(impossible, found.comparison.damping, found.comparison.mixing_rate)
    assert isinstance(result, Unstable) and result.tried >= 1


def test_the_weight_outweighs_what_it_must() -> None:
    """``μ λ0 V ≥ ς10 ỹ² + ς11 (ẏ^r)²`` up to the forcing: ``|ỹ_i| ≤ κ‖x‖_P``, ``|ẏ_i| ≤ ν‖x‖_P``."""
    _, found = proved("example")
    P = np.array([[float(x) for x in row] for row in found.comparison.P])
    damping = [d.hi for d in found.comparison.damping]
    A = np.array([[float(x) for x in row] for row in closed_loop(found.model, damping)])
    ten, eleven = Fraction(3), Fraction(5)
    reach, rates = norm_gains(found.model, found.comparison)
    design = CoordinatorDesign(found.gains, (), found.comparison.rate, reach, rates, {}, found.envelope)
    for x in np.random.default_rng(5).normal(size=(200, 9)):
        V = x @ P @ x
        for i in range(5):
            assert abs(x[i]) <= float(reach[i]) * math.sqrt(V)
            assert abs(A[i] @ x) <= float(rates[i]) * math.sqrt(V)
            mu = float(design.weight(i, ten, eleven))
            assert mu * float(found.comparison.rate) * V >= 3 * x[i] ** 2 + 5 * (A[i] @ x) ** 2


# the nominal trajectory


@pytest.mark.parametrize("name", ["three-weighted", "four-soft", "example"])
def test_the_true_defect_is_below_its_bound(name: str) -> None:
    """``ρ = −c'(ŷ)/ξ − α1Lŷ − α2Bω̂ − ŷ'`` at 300 bits against the bound of every step; the jumps too."""
    plant, found = proved(name)
    model = found.model
    grid: Mixing = mixing(model.laplacian, model.left_null_vector, found.mixing.step, 40)
    start = [agent.initial.reference.lo for agent in plant.agents]
    segments, _, _ = nominal_trajectory(model, grid, start)
    n, B = model.size, model.integral_basis()
    costs = [sympy.diff(agent.cost, COST_VARIABLE) for agent in plant.agents]
    largest = 0.0
    with ctx.workprec(300):
        L = arb_mat([[to_arb(x) for x in row] for row in model.laplacian])
        for k, segment in enumerate(segments):
            for share in (Fraction(0), Fraction(1, 3), Fraction(1)):
                tau = to_arb(share * grid.step)
                X = (L * -to_arb((k + share) * grid.step)).exp()
                y = [poly(tau) for poly in segment.reference]
                omega = [poly(tau) for poly in segment.integral]
                flow = [to_arb(model.alpha1) * sum((L[i, j] * y[j] for j in range(n)), arb(0)) for i in range(n)]
                for i in range(n):
                    value = sympy.N(
                        costs[i].subs(COST_VARIABLE, sympy.Float(str(y[i].mid().str(60, radius=False)), 60)), 50
                    )
                    gradient = arb(str(value))
                    feedback = to_arb(model.alpha2) * sum(
                        (to_arb(b) * w for b, w in zip(B[i], omega, strict=True)), arb(0)
                    )
                    rho = -gradient / X[i, i] - flow[i] - feedback - segment.reference[i].derivative()(tau)
                    assert float(abs(rho)) <= float(segment.defect[i]) + 1e-35
                    largest = max(largest, float(abs(rho)) / float(segment.defect[i]))
                for i in range(n - 1):
                    assert (
                        float(abs(flow[i] - segment.integral[i].derivative()(tau)))
                        <= float(segment.defect[n + i]) + 1e-35
                    )
            if k + 1 < len(segments):
                for i in range(n):
                    jump = segment.reference[i](to_arb(grid.step)) - segments[k + 1].reference[i](arb(0))
                    assert float(abs(jump)) <= float(segment.jump[i]) + 1e-35
    assert largest > 0.02  # and the bound is not idle
