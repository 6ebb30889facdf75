"""theory.md section 7: F4 (what is no equilibrium), F5 (what is conserved), F13 (which pairs are stable)."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from certify.coordinator.design import gradients_at
from certify.coordinator.mixing import mixing
from certify.coordinator.nominal import cost_gradient
from certify.coordinator.printed import design_printed
from certify.coordinator.stability import Unstable
from symbolic.hurwitz import hurwitz_test
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import COST_VARIABLE, CoordinatorChoice, Interval, Plant

HALF, TWO = Fraction(1, 2), Interval(Fraction(2), Fraction(2))


def exact(plant: Plant) -> tuple[sympy.Matrix, sympy.Matrix]:
    """``L`` and the column ``r``."""
    r = sympy.Matrix([sympy.Rational(x.numerator, x.denominator) for x in left_null_vector(plant.digraph)])
    return sympy.Matrix(laplacian(plant.digraph)).applyfunc(sympy.nsimplify), r


def slopes(plant: Plant, s: sympy.Expr) -> sympy.Matrix:
    return sympy.Matrix([sympy.diff(agent.cost, COST_VARIABLE).subs(COST_VARIABLE, s) for agent in plant.agents])


# F4


def test_f4_the_printed_equilibrium_moves_at_once(five_agents: Plant) -> None:
    """At ``(s*·1, ζ̄)``: ``ẏ^r = (1/r_i − 1/ξ_i^i) c_i'(s*)``, not 0 at ``ξ(0) = I``, 0 at ``ξ = r``."""
    L, r = exact(five_agents)
    alpha1, alpha2 = sympy.symbols("alpha1 alpha2", positive=True)
    c = slopes(five_agents, sympy.Integer(2))
    y = 2 * sympy.ones(5, 1)
    zeta = -c.multiply_elementwise(r.applyfunc(lambda x: 1 / x)) / alpha2

    def rate(xi: sympy.Matrix) -> sympy.Matrix:
        return -c.multiply_elementwise(xi.applyfunc(lambda x: 1 / x)) - alpha1 * L * y - alpha2 * zeta

    assert (rate(r)).applyfunc(sympy.simplify) == sympy.zeros(5, 1) == L * y
    start = rate(sympy.ones(5, 1)).applyfunc(sympy.simplify)
    assert start == sympy.Matrix([(1 / r[i] - 1) * c[i] for i in range(5)])
    assert [value != 0 for value in start] == [True, True, False, True, True]


def test_f4_from_the_printed_equilibrium_the_references_leave(five_agents: Plant) -> None:
    """For ``α = (1, 1)`` to ``|ỹ| = 2.39``, farther than from ``y^r(0) = 0``; and they come back."""
    L, r = (np.array(x, float) for x in exact(five_agents))
    r = r.ravel()
    gradient = np.array(slopes(five_agents, sympy.Integer(2)), float).ravel()

    values, left = np.linalg.eig(L)
    right = np.linalg.inv(left)

    def derivative(t: float, q: np.ndarray) -> np.ndarray:
        y, zeta = q[:5], q[5:]
        xi = np.einsum("ik,k,ki->i", left, np.exp(-values * t), right).real  # the diagonal of e^(−Lt)
        return np.r_[-(y - np.arange(5)) / 2 / xi - L @ y - zeta, L @ y]

    run = solve_ivp(derivative, (0, 40), np.r_[np.full(5, 2.0), -gradient / r], rtol=1e-8, max_step=0.1)
    assert np.abs(run.y[:5] - 2).max() == pytest.approx(2.39, abs=0.01)
    assert np.abs(run.y[:5, -1] - 2).max() < 1e-4


def test_f4_every_entry_of_xi_dips_below_its_limit(five_agents: Plant) -> None:
    """Proved: at some time the whole enclosure of ``ξ_i^i`` lies below ``r_i``, for all five agents."""
    L, r = laplacian(five_agents.digraph), left_null_vector(five_agents.digraph)
    grid = mixing(L, r, Fraction(1, 64), 640)
    for i in range(5):
        assert any(row[i][1] < float(r[i]) - 1e-4 for row in grid.ranges)
    assert float(grid.smallest[0]) == pytest.approx(0.1667, abs=2e-3)


# F5


def test_f5_the_sum_is_conserved_and_decides_where_the_outputs_settle(five_agents: Plant) -> None:
    """``rᵀζ' = 0``; at rest ``Σ c_i'(s) = −α2 rᵀζ(0)``: from ``ζ(0) = ½·1`` it settles at ``2 − α2/5``."""
    L, r = exact(five_agents)
    alpha2, s = sympy.symbols("alpha2 s", real=True)
    assert (r.T * L).is_zero_matrix
    assert L.rank() == 4 and L * sympy.ones(5, 1) == sympy.zeros(5, 1)  # Ly = 0 exactly for y = s·1
    zeta = sympy.Matrix(sympy.symbols("zeta1:6", real=True))
    rest = -slopes(five_agents, s).multiply_elementwise(r.applyfunc(lambda x: 1 / x)) - alpha2 * zeta
    total = sympy.expand((r.T * rest)[0, 0])
    assert sympy.expand(total + sum(slopes(five_agents, s)) + alpha2 * (r.T * zeta)[0, 0]) == 0
    (settled,) = sympy.solve(total.subs({z: sympy.Rational(1, 2) for z in zeta}), s)
    assert sympy.expand(settled - (2 - alpha2 / 5)) == 0
    assert sympy.solve(total.subs(dict.fromkeys(zeta, 0)), s) == [2]


# F13


def limit_matrix(plant: Plant, alpha1: Fraction, alpha2: Fraction) -> sympy.Matrix:
    """The coordinator at ``ξ = r`` in ``(ỹ, ω)``, ``ζ̃ = Bω``: 9 × 9, exact."""
    L, r = exact(plant)
    B = sympy.eye(4).col_join(sympy.Matrix(1, 4, lambda i, j: -r[j] / r[4]))
    D = sympy.diag(*(sympy.Rational(1, 2) / x for x in r))
    top = (-alpha1 * L - D).row_join(-alpha2 * B)
    return top.col_join((alpha1 * L[:4, :]).row_join(sympy.zeros(4, 4)))


def characteristic(plant: Plant, alpha1: Fraction, alpha2: Fraction) -> list[Fraction]:
    coefficients = limit_matrix(plant, sympy.nsimplify(alpha1), sympy.nsimplify(alpha2)).charpoly().all_coeffs()
    return [Fraction(int(x.p), int(x.q)) for x in coefficients]


@pytest.mark.parametrize(
    ("alpha2", "verdict"), [(1, "holds"), (5, "holds"), (73, "holds"), (74, "fails"), (80, "fails"), (10**6, "fails")]
)
def test_f13_large_alpha2_destabilises(five_agents: Plant, alpha2: int, verdict: str) -> None:
    """``α1 = 1`` on the example's graph, exactly: every ``α2`` tried up to 73 is stable, from 74 on none is."""
    assert hurwitz_test(characteristic(five_agents, Fraction(1), Fraction(alpha2))).verdict == verdict


def test_f13_another_alpha1_makes_it_stable_again(five_agents: Plant) -> None:
    """It is the pair that matters: there is an ``α1*(α2)``."""
    assert hurwitz_test(characteristic(five_agents, Fraction(8), Fraction(80))).verdict == "holds"


def test_f13_no_certificate_for_an_unstable_pair(five_agents: Plant) -> None:
    gradients = gradients_at([cost_gradient(agent.cost) for agent in five_agents.agents], TWO)
    curvatures = [Interval(HALF, HALF)] * 5
    plant = replace(five_agents, coordinator=CoordinatorChoice(Fraction(1), Fraction(80)))
    result = design_printed(plant, TWO, gradients, curvatures)
    assert isinstance(result, Unstable)
    assert result.reason == "no Lyapunov matrix was found for α1 = 1, α2 = 80"


@pytest.mark.parametrize(("agents", "dip"), [(6, 0.60), (20, 0.0097), (50, 3.4e-7), (100, 6e-15)])
def test_f23_the_mixing_layer_dips_far_below_its_limit_on_a_ring(agents: int, dip: float) -> None:
    """``ξ_i^i(t) = Σ_m e^(−t) t^(mN)/(mN)!`` on the directed ring with weights 1, where ``r_i = 1/N``: all terms are
    positive, so that nothing cancels."""
    times = np.linspace(0.0, float(agents), 4001)[1:]
    powers = np.arange(0, 8 * agents, agents)
    logs = powers[:, None] * np.log(times) - times - np.array([math.lgamma(m + 1) for m in powers])[:, None]
    least = float(np.min(np.sum(np.exp(logs), axis=0))) * agents
    assert least == pytest.approx(dip, rel=0.05)
