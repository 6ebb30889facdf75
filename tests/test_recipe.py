"""Route "recipe": constants above every sample, thresholds recomputed, decay along the vector field, given gains."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import sympy
from mpmath import mp, mpf

from certify.agent_model import AgentModel, LyapunovMatrices, References, row_sum_norm
from certify.assumptions.check import check_assumptions
from certify.bounds.rationals import sqrt_up
from certify.inequalities.matrices import inverse
from certify.pipeline import design_gains
from certify.preparation import Prepared, prepare
from certify.recipe.design import AgentInconclusive, AgentRecipe, design_agent
from certify.recipe.levels import NoLevel, find_level
from certify.recipe.matrices import lyapunov_matrices
from symbolic.plant import Plant, RequestedGains
from symbolic.plant_file import load_plant, parse_plant
from symbolic.steady_state import SteadyState

ROOT = Path(__file__).resolve().parent.parent
NONE = RequestedGains()


@dataclass(frozen=True)
class Case:
    model: AgentModel
    matrices: LyapunovMatrices
    recipe: AgentRecipe


def cases(plant: Plant) -> list[Case]:
    prepared = prepare(plant, check_assumptions(plant), lambda message: None)
    assert isinstance(prepared, Prepared), prepared
    found = []
    for model, derived in zip(prepared.models, prepared.derivation.agents, strict=True):
        assert isinstance(model, AgentModel) and isinstance(derived.steady_state, SteadyState)
        matrices = lyapunov_matrices(model, derived.steady_state)
        assert isinstance(matrices, LyapunovMatrices), matrices
        recipe = design_agent(model, matrices, NONE)
        assert isinstance(recipe, AgentRecipe), recipe
        found.append(Case(model, matrices, recipe))
    return found


MIXED = """
schema = "consensus-plant/1"
name = "mixed"
network = { agents = 3, edges = ["1 -> 2", "2 -> 3", "3 -> 1"] }
coordinator = { alpha1 = 3, alpha2 = 2 }
[exosystem]
states = ["v1", "v2"]
S = [[0, 1], [-1, 0]]
initial = { v1 = 0, v2 = [-1, 1] }
[initial]
box = [-0.5, 0.5]
observer = "measured"
reference = 0
[[agent]]
ids = [1]
order = 1
zero_dynamics = { z1 = "-2*z1 + x1", z2 = "z1 - 3*z2" }
f = "p*x1*z2 + sin(x1) + v1"
b = "q"
cost = "s^2"
uncertain = { p = [-1, 1], q = [1, 2] }
[[agent]]
ids = [2]
order = 3
f = "x2*x3 + p*x1^2 + v2"
b = 1
cost = "(s - 1)^2 + log(1 + exp(s))"
uncertain = { p = [0.9, 1.1] }
[[agent]]
ids = [3]
order = 4
f = "x4 + x1*x2"
b = "1 + p^2"
cost = "s^2/2"
uncertain = { p = [-1, 1] }
"""


@cache
def example() -> tuple[Case, ...]:
    return tuple(cases(load_plant(ROOT / "examples" / "five_agents.toml")))


@cache
def mixed() -> tuple[Case, ...]:
    return tuple(cases(parse_plant(MIXED.encode(), "mixed.toml")))


ALL = [("example", k) for k in range(5)] + [("mixed", k) for k in range(3)]


def get(which: tuple[str, int]) -> Case:
    return (example() if which[0] == "example" else mixed())[which[1]]


class Point:
    """Random error coordinates in the sublevel box, exogenous data in theirs, and the true increments (60 digits)."""

    def __init__(self, case: Case, generator: np.random.Generator, vertex: bool, slice_only: bool = False) -> None:
        mp.dps = 60
        model, found = case.model, case.recipe.level.found
        self.case, self.g, self.n = case, mpf_of(found.g), model.order

        def draw(low: Fraction, high: Fraction) -> mpf:
            share = generator.integers(0, 2) if vertex else generator.uniform()
            return mpf_of(low) + mpf(float(share)) * (mpf_of(high) - mpf_of(low))

        level = found.sublevel
        self.z, self.x, self.eta = ([draw(-m, m) for m in block] for block in (level.z, level.x_hat, level.eta))
        self.theta = mpf(0) if slice_only else draw(-level.vartheta, level.vartheta)
        peak = model.references.peak
        self.exogenous = {str(name): draw(side.lo, side.hi) for name, side in model.exogenous_box.items()}
        self.s = self.exogenous["s"]
        self.y = self.s + draw(-peak, peak)
        self.steady = [self.value(expression) for expression in model.steady_state]

    def value(self, expression: sympy.Expr, **states: mpf) -> mpf:
        return compiled(expression)({**self.exogenous, **states})

    def chain(self, x: list[mpf], theta: mpf, y: mpf) -> list[mpf]:
        n, g, gamma = self.n, self.g, [mpf_of(c) for c in self.case.model.gamma]
        states = [g**k * x[k] for k in range(n - 1)]
        states.append(theta - sum((g ** (n - 1) * c * v for c, v in zip(gamma, x, strict=True)), mpf(0)))
        return [states[0] + y, *states[1:]]

    def f(self, which: str, z: list[mpf], x: list[mpf]) -> list[mpf]:
        agent = self.case.model.agent
        values = {str(name): v + s for name, v, s in zip(agent.zero_states, z, self.steady, strict=True)}
        values |= {str(name): v for name, v in zip(agent.chain, x, strict=True)}
        expressions = agent.zero_dynamics if which == "f0" else (agent.f,)
        return [self.value(expression, **values) for expression in expressions]

    def at_rest(self, y: mpf) -> list[mpf]:
        return [y, *[mpf(0)] * (self.n - 1)]

    def f_hat(self, z: list[mpf], x: list[mpf], theta: mpf) -> mpf:
        """``f̂ = f1(z̄ + z*, x̄ + (y, 0 …)) − f1(z*, (y, 0 …)) + Σ g^(n−k) γ_k x̄_(k+1)``."""
        states, none = self.chain(x, theta, self.y), [mpf(0)] * len(z)
        increment = self.f("f1", z, states)[0] - self.f("f1", none, self.at_rest(self.y))[0]
        gamma = [mpf_of(c) for c in self.case.model.gamma]
        linear = (self.g ** (self.n - k) * c * states[k] for k, c in enumerate(gamma, start=1))
        return increment + sum(linear, mpf(0))


def mpf_of(value: Fraction) -> mpf:
    return mpf(value.numerator) / value.denominator


def norm(vector: list[mpf]) -> mpf:
    return mp.sqrt(sum((v * v for v in vector), mpf(0)))


@cache
def _lambda(expression: sympy.Expr) -> tuple[object, tuple[str, ...]]:
    names = tuple(sorted(expression.free_symbols, key=str))
    return sympy.lambdify(names, expression, "mpmath"), tuple(map(str, names))


def compiled(expression: sympy.Expr):  # type: ignore[no-untyped-def]  # a closure over mpmath numbers
    function, names = _lambda(sympy.sympify(expression))
    return lambda values: mpf(function(*(values[name] for name in names)))  # type: ignore[operator]


# constants


@pytest.mark.parametrize("which", ALL)
@pytest.mark.parametrize("vertex", [True, False])
def test_constants_lie_above_every_sample(which: tuple[str, int], vertex: bool) -> None:
    """The increments of the real ``f0, f1`` between points of the sublevel box, each against its constant."""
    case, generator = get(which), np.random.default_rng(11)
    c = {name: mpf_of(value) for name, value in case.recipe.constants.items()}
    for number in range(24):
        point = Point(case, generator, vertex, slice_only=number % 2 == 0)
        z, x, theta = point.z, point.x, point.theta
        none, flat = [mpf(0)] * len(z), [mpf(0)] * len(x)
        allowed = c["F_z"] * norm(z) + c["F_x"] * norm(x) + c["F_vartheta"] * abs(theta)
        assert abs(point.f_hat(z, x, theta)) <= allowed * (1 + mpf(10) ** -30)
        assert abs(point.f_hat(z, flat, mpf(0))) <= c["F_z"] * norm(z) * (1 + mpf(10) ** -30)
        assert abs(point.f_hat(none, x, mpf(0))) <= c["F_x"] * norm(x) * (1 + mpf(10) ** -30)
        drift = point.f("f1", none, point.at_rest(point.y))[0] - point.f("f1", none, point.at_rest(point.s))[0]
        assert abs(drift) <= c["F_reference"] * abs(point.y - point.s) * (1 + mpf(10) ** -30)
        if z:
            first = (x[0] if x else theta) + point.y
            moved = point.f("f0", z, [first, *[mpf(0)] * (point.n - 1)])
            still = point.f("f0", z, point.at_rest(point.y))
            assert norm([a - b for a, b in zip(moved, still, strict=True)]) <= c["varsigma2"] * abs(first - point.y) * (
                1 + mpf(10) ** -30
            )
            still, rest = point.f("f0", none, point.at_rest(point.y)), point.f("f0", none, point.at_rest(point.s))
            drive = norm([a - b for a, b in zip(still, rest, strict=True)])
            assert drive <= c["varsigma3"] * abs(point.y - point.s) * (1 + mpf(10) ** -30)


@pytest.mark.parametrize("index", [0, 1])
def test_the_slope_in_z_is_attained_at_a_vertex(index: int) -> None:
    """``f1`` of agents 1 and 2 is linear in ``z``, so some vertex comes within 2 % of ``F_z``; ``ς2 = ς3 = 1``."""
    case, generator = get(("example", index)), np.random.default_rng(2)
    c = case.recipe.constants
    assert c["varsigma2"] == c["varsigma3"] == 1
    best = mpf(0)
    for _ in range(400):
        point = Point(case, generator, vertex=True, slice_only=True)
        best = max(
            best, abs(point.f_hat(point.z, point.x, mpf(0)) - point.f_hat([mpf(0)], point.x, mpf(0))) / abs(point.z[0])
        )
    assert mpf_of(c["F_z"]) <= best * mpf("1.02")


# thresholds, recomputed from the certificate's numbers


@pytest.mark.parametrize("which", ALL)
def test_every_obligation_of_the_thresholds(which: tuple[str, int]) -> None:
    """docs/certificate.md sections 3 and 4, written anew in exact arithmetic (norms and roots rounded up)."""
    case = get(which)
    model, P, recipe = case.model, case.matrices, case.recipe
    level, found, ctl = recipe.level, recipe.level.found, recipe.controller
    n, im, one = model.order, model.internal_model, Fraction(1)
    b, we, wt = model.input_gain, found.weight_eta, found.weight_vartheta
    C, eps = level.level + level.slack, level.slack

    def length(vector: list[Fraction]) -> Fraction:
        return sqrt_up(sum((v * v for v in vector), Fraction(0)))

    def times(matrix: tuple[tuple[Fraction, ...], ...], vector: list[Fraction]) -> list[Fraction]:
        return [sum((a * v for a, v in zip(line, vector, strict=True)), Fraction(0)) for line in matrix]

    PN = length(times(P.P2, list(im.N)))
    PMN = length(times(P.P2, times(im.M, list(im.N))))
    psi, psi_N = length(list(im.psi)), abs(sum((a * c for a, c in zip(im.psi, im.N, strict=True)), Fraction(0)))
    s1, s2, s3 = (found.varsigma[k] for k in (1, 2, 3))
    drive = (s1 * s2) ** 2 / P.a0 if P.V0 else Fraction(0)
    A = {name: 12 * PN**2 * value**2 / b.lo**2 for name, value in (("z", found.f_z), ("x", found.f_x))}
    A["t"] = 12 * (PMN + PN * found.f_vartheta) ** 2 / b.lo**2
    a_z = P.a0 / 2 - A["z"] / we - 2 * found.f_z**2 / wt
    a_x = ctl.g - 2 - drive - A["x"] / we - 2 * found.f_x**2 / wt
    a_eta = 1 / (2 * we) - 2 * b.hi**2 * psi**2 / wt
    p1 = row_sum_norm(P.P1)
    a_theta = (
        (b.lo * ctl.K - 1) / wt - (p1**2 if n > 1 else drive) - A["t"] / we - 2 * (found.f_vartheta + psi_N) ** 2 / wt
    )
    blocks = {"t": a_theta}
    blocks |= {"z": a_z} if P.V0 else {}
    blocks |= {"x": a_x} if n > 1 else {}
    blocks |= {"eta": a_eta} if im.order else {}
    assert all(value > 0 for value in blocks.values())
    gamma1 = model.gamma[0] if n > 1 else one
    kappa = 4 * PN**2 / (b.lo**2 * we) + 1 / (2 * wt)
    s10 = ((s1 * s3) ** 2 / P.a0 if P.V0 else 0) + 2 * kappa * found.f_reference**2
    s11 = p1**2 + 2 * kappa * (ctl.g ** (n - 1) * gamma1) ** 2
    assert s10 <= found.varsigma[10] and s11 <= found.varsigma[11]
    refs = model.references
    assert level.initial + s10 * refs.energy + s11 * refs.rate_energy <= level.level
    theta = sqrt_up(2 * C * wt)
    if n == 1:
        assert ctl.delta >= ctl.K * theta and ctl.h is None
        return
    assert ctl.h is not None and ctl.h >= ctl.g
    g, K, delta, h = ctl.g, ctl.K, ctl.delta, ctl.h
    e2 = [(g / h) ** (n - k) * c for k, c in enumerate(model.gamma, start=1)] + [one]
    dual = inverse(P.P3)
    form = sum(
        (a * x * y for line, x in zip(dual, e2, strict=True) for a, y in zip(line, e2, strict=True)), Fraction(0)
    )
    assert delta >= K * (theta + sqrt_up(eps * form / 2))
    delta1 = b.hi / wt * theta * (delta + K * theta)
    T = eps / (4 * delta1)
    assert recipe.output.T is not None and recipe.output.T <= T
    box = model.box(found.sublevel, g)
    f_z, f_x, f_n = model.zero_slope(box), model.chain_slope(box, g, with_design=False), model.last_slope(box)
    level_box = found.sublevel
    X2 = (
        f_z * length(list(level_box.z))
        + f_x * length(list(level_box.x_hat))
        + f_n * theta
        + found.f_reference * refs.peak
    )
    X2 += b.hi * (delta + psi * length(list(level_box.eta))) + psi_N * theta
    lam, p3 = row_sum_norm(P.P3), length([line[-1] for line in P.P3])
    assert 4 * lam * p3**2 * X2**2 / h**2 <= eps / 4
    start = model.agent.initial
    x0 = [side.magnitude for side in start.x]
    observer = start.observer
    gaps = (
        [Fraction(0), *x0[1:]]
        if observer is None
        else [max(abs(a.hi - o.lo), abs(a.lo - o.hi)) for a, o in zip(start.x, observer, strict=True)]
    )
    e0 = [h ** (n - k) * gap for k, gap in enumerate(gaps, start=1)]
    We0 = sum(
        (abs(p) * x * y for line, x in zip(P.P3, e0, strict=True) for p, y in zip(line, e0, strict=True)), Fraction(0)
    )
    mp.dps = 80
    assert mp.exp(-mpf_of(h * T / (2 * lam))) * mpf_of(We0) <= mpf_of(eps) / 4
    beta, E2 = 12 * p3**2 / h, length(e2)
    assert "z" not in blocks or a_z > beta * f_z**2
    assert a_x > beta * f_x**2
    assert "eta" not in blocks or a_eta > beta * b.hi**2 * psi**2
    assert a_theta / 2 > beta * (f_n + b.hi * K + psi_N) ** 2
    assert h / 2 > beta * (b.hi * K * E2) ** 2 + (b.hi * K * E2 / wt) ** 2 / (2 * a_theta)
    assert beta * found.f_reference**2 * refs.energy <= eps / 8


# the inequality the whole proof rests on, along the vector field


@pytest.mark.parametrize("which", ALL)
@pytest.mark.parametrize("vertex", [True, False])
def test_the_decay_holds_along_the_vector_field(which: tuple[str, int], vertex: bool) -> None:
    """``Ẇ ≤ −a_z|z̄|² − a_x|x̂|² − a_η|η̃|² − a_ϑϑ² + ς10ỹ² + ς11(ẏ^r)² + (b/ω_ϑ)ϑ(ū + Kϑ)`` for any ``ū``, ``ẏ^r``."""
    case, generator = get(which), np.random.default_rng(23)
    model, P, recipe = case.model, case.matrices, case.recipe
    found, feedback, im, n = recipe.level.found, recipe.feedback, model.internal_model, model.order
    g, K = mpf_of(recipe.controller.g), mpf_of(recipe.controller.K)
    we, wt = mpf_of(found.weight_eta), mpf_of(found.weight_vartheta)
    for number in range(60):
        point = Point(case, generator, vertex)
        sparse = number % 2 == 0  # few blocks at a time, so that no large one hides the others
        sizes = [mpf(10) ** -generator.integers(0, 3 if sparse else 12) for _ in range(4)]
        if sparse:
            sizes = [size * int(generator.integers(0, 2)) for size in sizes]
            sizes[2] = sizes[3] = mpf(0)
        z, x, eta = ([v * s for v in block] for block, s in zip((point.z, point.x, point.eta), sizes, strict=False))
        theta = point.theta * sizes[3]
        b = point.value(model.agent.b)
        rate = mpf(float(generator.normal())) * mpf(10) ** int(generator.integers(-3, 4))
        u = -K * theta * mpf(float(generator.uniform(-1, 2)))
        none = [mpf(0)] * len(z)
        states = point.chain(x, theta, point.y)
        zdot = [
            p - q for p, q in zip(point.f("f0", z, states), point.f("f0", none, point.at_rest(point.s)), strict=True)
        ]
        f_hat = point.f_hat(z, x, theta)
        f2 = point.f("f1", none, point.at_rest(point.y))[0] - point.f("f1", none, point.at_rest(point.s))[0]
        gamma = [mpf_of(c) for c in model.gamma]
        epsilon = f2 - g ** (n - 1) * (gamma[0] if n > 1 else 1) * rate
        N, psi = [mpf_of(v) for v in im.N], [mpf_of(v) for v in im.psi]
        psi_N = sum((p * q for p, q in zip(psi, N, strict=True)), mpf(0))
        M = [[mpf_of(v) for v in line] for line in im.M]
        sweep = [e + q * theta / b for e, q in zip(eta, N, strict=True)]
        etadot = [
            sum((m * s for m, s in zip(line, sweep, strict=True)), mpf(0)) - q / b * (f_hat + epsilon)
            for line, q in zip(M, N, strict=True)
        ]
        thetadot = (
            f_hat + b * sum((p * e for p, e in zip(psi, eta, strict=True)), mpf(0)) + psi_N * theta + b * u + epsilon
        )
        xdot = [g * v for v in x[1:]] + (
            [-g * sum((c * v for c, v in zip(gamma, x, strict=True)), mpf(0))] if n > 1 else []
        )
        if n > 1:
            xdot[-1] += theta / g ** (n - 2)
            xdot[0] -= rate

        def form(matrix: tuple[tuple[Fraction, ...], ...], left: list[mpf], right: list[mpf]) -> mpf:
            return sum(
                (
                    mpf_of(a) * p * q
                    for line, p in zip(matrix, left, strict=True)
                    for a, q in zip(line, right, strict=True)
                ),
                mpf(0),
            )

        Wdot = (
            2 * form(P.V0, z, zdot) + 2 * form(P.P1, x, xdot) + 2 * form(P.P2, eta, etadot) / we + theta * thetadot / wt
        )
        pairs = ((feedback.a_z, z), (feedback.a_x, x), (feedback.a_eta, eta), (feedback.a_vartheta, [theta]))
        bound = -sum((mpf_of(a) * norm(v) ** 2 for a, v in pairs if a is not None), mpf(0))
        bound += mpf_of(found.varsigma[10]) * (point.y - point.s) ** 2 + mpf_of(found.varsigma[11]) * rate**2
        bound += b / wt * theta * (u + K * theta)
        assert Wdot <= bound + abs(bound) * mpf(10) ** -25, number


# the user's gains


def certified_with(case: Case, **gains: Fraction) -> AgentRecipe | AgentInconclusive:
    return design_agent(case.model, case.matrices, RequestedGains(**gains))


@pytest.mark.parametrize("which", [("example", 0), ("example", 2), ("mixed", 0)])
def test_larger_gains_stay_certified(which: tuple[str, int]) -> None:
    case = get(which)
    ctl = case.recipe.controller
    for factor in (2, 10**6):
        result = certified_with(case, K=factor * ctl.K)
        assert isinstance(result, AgentRecipe) and factor == result.controller.K / ctl.K
        result = certified_with(case, K=ctl.K, delta=factor * ctl.delta)
        assert isinstance(result, AgentRecipe) and result.controller.delta == factor * ctl.delta
        if ctl.h is not None:
            result = certified_with(case, K=ctl.K, delta=ctl.delta, h=factor * ctl.h)
            assert isinstance(result, AgentRecipe) and result.controller.h == factor * ctl.h
            result = certified_with(case, g=factor * ctl.g)
            assert isinstance(result, AgentRecipe) and result.controller.g == factor * ctl.g
    again = certified_with(case, g=ctl.g, K=ctl.K, delta=ctl.delta, **({"h": ctl.h} if ctl.h is not None else {}))
    assert isinstance(again, AgentRecipe) and again.controller == ctl


@pytest.mark.parametrize(
    ("name", "factor", "reason"),
    [
        ("K", Fraction(1, 100), "a_ϑ is not positive (K = "),
        ("delta", Fraction(1, 100), "δ = "),
        ("h", Fraction(1, 100), "h = "),
        ("g", Fraction(1, 2), "does not exceed 2 + ς1²ς2²/a0 + a0/4"),
    ],
)
def test_gains_below_a_threshold_are_not_certified(name: str, factor: Fraction, reason: str) -> None:
    case = get(("example", 0))
    ctl = case.recipe.controller
    fixed = {} if name == "g" else {"g": ctl.g}
    if name in ("delta", "h"):
        fixed["K"] = ctl.K
    if name == "h":
        fixed["delta"] = ctl.delta
    result = certified_with(case, **fixed, **{name: factor * getattr(ctl, name)})
    assert isinstance(result, AgentInconclusive) and result.id == 1
    assert reason in result.reason
    assert "threshold" in result.reason or "does not exceed" in result.reason


# invariance


def small(first: str, second: str, scale: str = "1") -> str:
    """Two agents; ``first`` and ``second`` are the ids of the one with zero dynamics and the one without."""
    return f"""
schema = "consensus-plant/1"
name = "small"
network = {{ agents = 2, edges = ["1 -> 2", "2 -> 1"] }}
coordinator = {{ alpha1 = 3, alpha2 = 2 }}
initial = {{ z1 = 1, x = 1, reference = 0, observer = 0, eta = 0 }}
[[agent]]
ids = [{first}]
order = 2
zero_dynamics = {{ z1 = "-z1 + ({scale})*x1" }}
f = "z1*x1/({scale}) + x2"
b = 1
cost = "(s - 1)^2"
[[agent]]
ids = [{second}]
order = 1
f = "x1^2"
b = 2
cost = "(s + 1)^2"
""".replace("z1 = 1, x = 1", f'z = ["-({scale})", "{scale}"], x = [-1, 1]')


def gains(text: str) -> dict[int, tuple[str, ...]]:
    result = design_gains(parse_plant(text.encode(), "small.toml"), route="recipe")
    assert result.status == "certified", result.reason
    return {
        agent["id"]: tuple(str(agent[key]) for key in ("g", "K", "delta", "h"))
        for agent in result.summary["gains"]["agents"]
    }


def test_permuting_the_agents_permutes_the_gains() -> None:
    """The graph is symmetric, so nothing but the numbering differs."""
    one, two = gains(small("1", "2")), gains(small("2", "1"))
    for mine, theirs in ((one[1], two[2]), (one[2], two[1])):
        assert mine[0] == theirs[0]
        for left, right in zip(mine[1:], theirs[1:], strict=True):
            if left == "None":
                assert right == "None"
                continue
            assert abs(Fraction(left) / Fraction(right) - 1) < Fraction(1, 10)  # P is a solver's proposal


@pytest.mark.parametrize("scale", ["10^6", "1/10^6"])
def test_rescaling_a_state_keeps_the_plant_certified(scale: str) -> None:
    assert set(gains(small("1", "2", scale))) == {1, 2}


# no fixed point


def test_a_bound_that_is_not_finite_is_named() -> None:
    """``f`` has a pole outside the start but on every level set: inconclusive, with the level."""
    text = small("1", "2").replace('"x1^2"', '"x1/(4 - x1)"')
    result = design_gains(parse_plant(text.encode(), "small.toml"), route="recipe")
    assert result.status == "inconclusive"
    assert "agent 2: a bound on the level set" in result.reason and "is not finite" in result.reason


def test_a_level_that_runs_away_names_the_constant() -> None:
    case = get(("example", 0))
    huge = Fraction(1 << 600)
    far = replace(case.model, references=References(case.model.references.peak, huge, huge))
    result = find_level(far, case.matrices)
    assert isinstance(result, NoLevel) and result.rounds >= 1
    assert "no level closes the loop within" in result.reason and "runs away with the level" in result.reason


def test_a_lyapunov_function_that_is_not_quadratic_is_not_enough() -> None:
    """A6 holds with ``z²/2 + z⁴/4``, but A6 alone does not bound the drive of the references (F1)."""
    text = small("1", "2").replace('x1" }', 'x1" }\nzero_dynamics_lyapunov = "z1^2/2 + z1^4/4"')
    result = design_gains(parse_plant(text.encode(), "small.toml"), route="recipe")
    assert result.status == "inconclusive"
    assert "agent 1: V0 = z1**4/4 + z1**2/2 is not quadratic: A6 alone" in result.reason


# the page


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("recipe_table", ROOT / "benchmarks" / "recipe_table.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["recipe_table"] = module
    spec.loader.exec_module(module)
    return module


def test_the_committed_table_is_the_scripts() -> None:
    page, module = (ROOT / "docs" / "recipe.md").read_text(encoding="utf-8"), script()
    base = module.case(load_plant(ROOT / "examples" / "five_agents.toml"))
    table = "\n".join(module.main_table([module.row(model, P) for model, P in base.agents]))
    assert table in page


@pytest.mark.slow
def test_both_committed_tables_are_the_scripts() -> None:
    page = (ROOT / "docs" / "recipe.md").read_text(encoding="utf-8")
    for table in script().tables().strip().split("\n\n"):
        assert table in page
