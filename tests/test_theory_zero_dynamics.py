"""theory.md section 7: F1 (A6 is not enough), F2 (the circle of ``μ``), F18 (the origin and ``W``)."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from certify.assumptions.a0_origin import check_origin
from certify.assumptions.check import check_assumptions
from certify.pipeline import design_gains
from sims import Trajectory, nominal, simulate
from symbolic.controller import AgentController, Controller, CoordinatorGains
from symbolic.plant import Interval, Plant
from symbolic.plant_file import parse_plant

# F1: ż1 = −z1 + z1³z2, ż2 = −z2 − 4z1⁴z2³ + x1

F1 = """
schema = "consensus-plant/1"
name = "a6-is-not-enough"
network = { agents = 2, edges = ["1 -> 2", "2 -> 1"] }
initial = { box = [-RADIUS, RADIUS], reference = [-RADIUS, RADIUS] }
[[agent]]
ids = [1, 2]
order = 2
zero_dynamics = { z1 = "-z1 + z1^3*z2", z2 = "-z2 - 4*z1^4*z2^3 + x1" }
f = 0
b = 1
cost = "(s - 3 + 2*id)^2/2"
"""
V0_OF_F1 = "z1^2*exp(2/sqrt(11)*(atan((4*z1^2*z2 - 1)/sqrt(11)) + atan(1/sqrt(11)))) + z2^2"


def f1_plant(radius: int, lyapunov: str | None = None) -> Plant:
    text = F1.replace("RADIUS", str(radius))
    if lyapunov is not None:
        text += f'zero_dynamics_lyapunov = "{lyapunov}"\n'
    return parse_plant(text.encode(), "f1.toml")


def f1_lyapunov() -> tuple[sympy.Expr, sympy.Expr, sympy.Expr]:
    """``V0 = z1² e^(2Ψ(z1²z2)) + z2²`` as (V0, its derivative for x1 = 0, z1² e^(2Ψ)); Ψ' = 1/(3 − 2β + 4β²)."""
    z1, z2, beta = sympy.symbols("z1 z2 beta", real=True)
    psi = (sympy.atan((4 * beta - 1) / sympy.sqrt(11)) + sympy.atan(1 / sympy.sqrt(11))) / sympy.sqrt(11)
    assert sympy.simplify(sympy.diff(psi, beta) - 1 / (3 - 2 * beta + 4 * beta**2)) == 0 == psi.subs(beta, 0)
    weighted = z1**2 * sympy.exp(2 * psi.subs(beta, z1**2 * z2))
    V0 = weighted + z2**2
    derivative = sympy.diff(V0, z1) * (-z1 + z1**3 * z2) + sympy.diff(V0, z2) * (-z2 - 4 * z1**4 * z2**3)
    return V0, derivative, weighted


def test_f1_the_zero_dynamics_satisfy_a6() -> None:
    """``V̇0 = −2V0 − 8z1⁴z2⁴ ≤ −2V0`` identically, and ``V0 ≥ e^(−2)|z|²`` is positive definite and proper."""
    V0, derivative, weighted = f1_lyapunov()
    z1, z2 = sympy.symbols("z1 z2", real=True)
    assert sympy.simplify((derivative + 2 * V0 + 8 * z1**4 * z2**4) / weighted) == 0
    # Ψ > −(π/2 + atan(1/√11)…)/√11 > −1, so e^(2Ψ) > e^(−2) and V̇0 ≤ −2e^(−2)|z|²
    least = (-sympy.pi / 2 + sympy.atan(1 / sympy.sqrt(11))) / sympy.sqrt(11)
    assert -1 < least < 0


COORDINATOR = (3, 2)  # α1, α2: with (1, 1) even the start at 3 escapes, later


def escapes(start: float, g: float | None, K: float = 0) -> float | None:
    """The time of escape from ``y^r(0) = x1(0) = z1(0) = start`` with ``u = −K(gx̄1 + x2)``; None if there is none.

    ``g is None``: perfect tracking, ``x1 ≡ y^r``, the limit of infinite gain.
    """
    alpha1, alpha2 = COORDINATOR

    def derivative(t: float, q: np.ndarray) -> np.ndarray:
        z1, z2, ya, yb, zeta, x1, x2 = q  # ξ_i^i = (1 + e^(−2t))/2, ζ2 = −ζ1
        xi = (1 + np.exp(-2 * t)) / 2
        seen = ya if g is None else x1
        return np.array(
            [
                -z1 + z1**3 * z2,
                -z2 - 4 * z1**4 * z2**3 + seen,
                -(ya - 1) / xi - alpha1 * (ya - yb) - alpha2 * zeta,
                -(yb + 1) / xi - alpha1 * (yb - ya) + alpha2 * zeta,
                alpha1 * (ya - yb),
                0 if g is None else x2,
                0 if g is None else -K * (g * (x1 - ya) + x2),
            ]
        )

    def far(t: float, q: np.ndarray) -> float:
        return float(abs(q[0]) - 1e4)

    far.terminal = True  # type: ignore[attr-defined]  # how scipy is told to stop
    q0 = [start, 0, start, 0, 0, start, 0]
    run = solve_ivp(derivative, (0, 8), q0, method="LSODA", rtol=1e-9, atol=1e-11, events=far)
    assert run.success
    return float(run.t[-1]) if run.t_events[0].size else None


@pytest.mark.parametrize(("g", "K"), [(5, 100), (30, 1e4), (1000, 1e7), (None, 0)])
def test_f1_no_gain_prevents_the_escape(g: float | None, K: float) -> None:
    """From 10 the state escapes at ``t ≈ 0.31`` whatever the gains; from 3 it does not."""
    end = escapes(10, g, K)
    assert end is not None and end == pytest.approx(0.31, abs=0.05)
    assert escapes(3, g, K) is None


def test_f1_the_whole_controller_escapes_too() -> None:
    plant = f1_plant(1)
    polynomials = ((Fraction(1),), (Fraction(1), Fraction(2)), (), (), ())
    laws = tuple(AgentController(i, *polynomials, *map(Fraction, (5, 100, 10**9, 500))) for i in (1, 2))
    law = Controller(CoordinatorGains(*map(Fraction, COORDINATOR)), laws)

    def run(start: float) -> Trajectory:
        begin = nominal(plant, law).with_agent(1, z=[start, 0], x=[start, 0], observer=[start, 0])
        return simulate(plant, law, horizon=30, scenario=replace(begin, reference=(start, 0.0)))

    far, near = run(10), run(3)
    assert far.status == "escaped" and far.end < 0.4
    assert near.status == "completed" and near.final_error() < 1e-3


@pytest.mark.parametrize("lyapunov", [None, pytest.param(V0_OF_F1, marks=pytest.mark.slow)])
def test_f1_the_box_that_escapes_is_not_certified(lyapunov: str | None) -> None:
    result = design_gains(f1_plant(10, lyapunov), route="recipe")
    assert result.status == "inconclusive" and result.certificate is None
    assert result.reason.startswith("A6, agent 1: ")


# F2: f0 = −z/(1 + z²) + x/(1 + x²), V0 = z²/2 + z⁴/4


def test_f2_the_required_weight_outgrows_the_level() -> None:
    """On ``{V0 ≤ c}`` ``ς1 = √(1 + 4c)`` exactly, and ``ς3 ≥ 1``, ``a0 = 1``: ``ς10 ≥ 1 + 4c`` grows like ``c``.

    With ``c = (4 + μ)c̄``, ``μς0 > ς10 ≥ 1 + 4c ≥ 4μc̄`` needs ``c̄ < ς0/4``. But ``Ṽ' ≤ −ς0 ỹ²`` with
    ``ỹ' = −ỹ`` from ``R̄`` means ``c̄ ≥ Ṽ(R̄) ≥ ς0 R̄²/2``, so no ``μ`` exists for ``R̄ ≥ 1``,
    whatever ``Ṽ`` and its ``ς0`` are.
    """
    z, y, c = sympy.symbols("z y c", positive=True)
    V0 = z**2 / 2 + z**4 / 4
    slope = sympy.diff(V0, z) / z  # |∂V0/∂z| ≤ ς1 |z|
    edge = sympy.sqrt(sympy.sqrt(1 + 4 * c) - 1)
    assert sympy.simplify(V0.subs(z, edge) - c) == 0
    assert sympy.simplify(slope.subs(z, edge) - sympy.sqrt(1 + 4 * c)) == 0
    assert sympy.diff(sympy.expand(slope), z) == 2 * z  # increasing: the supremum is at the edge
    assert sympy.simplify(sympy.diff(V0, z) * (-z / (1 + z**2)) + z**2) == 0  # V̇0 = −z²: a0 = 1
    drive = y / (1 + y**2)
    assert sympy.limit(drive / y, y, 0) == 1
    decay = sympy.integrate(sympy.exp(-2 * y), (y, 0, sympy.oo))  # ∫ỹ² for ỹ' = −ỹ from 1
    assert decay == sympy.Rational(1, 2) > sympy.Rational(1, 4)


@pytest.mark.parametrize(("radius", "closes"), [("1/4", True), ("1/2", True), ("1", False), ("2", False)])
def test_f2_the_fixed_point_exists_for_small_boxes_only(radius: str, closes: bool) -> None:
    """``w0 + ς10(c) ∫ỹ² ≤ c`` with ``ς10 = 1 + 4c`` and ``∫ỹ² = R̄²/2``, ``w0 ≥ V0(R̄)``: iterate as the recipe does."""
    R = Fraction(radius)
    energy, initial = R**2 / 2, R**2 / 2 + R**4 / 4
    level = Fraction(1, 100)
    for _ in range(200):
        needed = initial + (1 + 4 * level) * energy
        if needed <= level:
            break
        if needed > 10**30:
            break
        level = Fraction(33, 32) * needed
    assert (needed <= level) is closes
    if not closes:  # and no level whatever does: the left side grows at least as fast as the right one
        assert 4 * energy >= 1


def test_f2_the_plant_is_not_certified() -> None:
    plant = parse_plant(
        b"""
schema = "consensus-plant/1"
name = "circle"
network = { agents = 1, edges = [] }
initial = { box = [-1, 1] }
[[agent]]
ids = [1]
order = 2
zero_dynamics = { z1 = "-z1/(1 + z1^2) + x1/(1 + x1^2)" }
f = 0
b = 1
cost = "s^2/2"
steady_state = { z1 = "s" }
zero_dynamics_lyapunov = "z1^2/2 + z1^4/4"
""",
        "f2.toml",
    )
    result = design_gains(plant, route="recipe")
    assert result.status == "inconclusive" and result.reason.startswith("A6, agent 1: ")


# F18: the paper asks 0 ∈ W


def test_f18_the_example_does_not_contain_the_origin_and_is_only_warned(five_agents: Plant) -> None:
    for agent in five_agents.agents:
        assert not any(side.lo <= 0 <= side.hi for side in agent.parameter_box)
        finding = check_origin(agent, five_agents.exosystem)
        assert finding.verdict == "holds"
        assert any("does not contain the origin" in text for text in finding.evidence["warnings"])
    assert check_assumptions(five_agents).status == "holds"


def test_f18_the_origin_would_break_the_example(five_agents: Plant) -> None:
    """With ``p_11 = 0`` in the box, as the paper asks, ``ż = p_11 z + …`` is not stable and A6 does not hold."""
    first = five_agents.agents[0]
    wide = (Interval(first.parameter_box[0].lo, Fraction(0)), *first.parameter_box[1:])
    agents = (replace(first, parameter_box=wide), *five_agents.agents[1:])
    findings = check_assumptions(replace(five_agents, agents=agents)).findings
    assert next(f for f in findings if f.id == "A6" and f.agent == 1).verdict != "holds"
