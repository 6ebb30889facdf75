"""The transformed equations are the original ones, for every order; the paper's misprints are not."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
import sympy
from counted import at_most
from hand_built import CONSTANT, NOTHING, ROTATION, V1, V2, X1, X2, X3, X4, Z1, Z2, P, Q, S, agent
from sympy import Rational, exp, sin

from symbolic.coordinates import ErrorSystem, error_system, identity_residuals
from symbolic.derivation import as_dict, as_latex, as_text, derive
from symbolic.derived import AgentDerivation
from symbolic.identity import normal_form, zero_test
from symbolic.internal_model import InternalModel, internal_model
from symbolic.latex import latex_names
from symbolic.plant import Agent, Digraph, Edge, Exosystem, Plant, symbol
from symbolic.regulator import SteadyState, solve_regulator

THETA = Rational(4, 5)
CHAIN = (X1, X2, X3, X4)
BOX = {P: (-2, -1), Q: (1, 2)}


def built(plant: Agent, exo: Exosystem, s_star: sympy.Expr = S) -> ErrorSystem:
    steady = solve_regulator(plant, exo)
    assert isinstance(steady, SteadyState), steady
    model = internal_model(plant, exo, steady, s_star)
    assert isinstance(model, InternalModel), model
    return error_system(plant, exo, steady, model, s_star)


def chain_sum(order: int) -> sympy.Expr:
    return sum((k * x * Q for k, x in enumerate(CHAIN[:order], 1)), sympy.Integer(0))


def variants(order: int) -> dict[str, tuple[Agent, Exosystem, int, int]]:
    """Agents of one order, with their numbers of zero states and of internal-model states."""
    x = CHAIN[:order]
    zero = [P * Z1 + X1 + V1]
    return {
        "bare": (agent(f=x[-1] ** 2 * x[0], order=order), NOTHING, 0, int(order == 1)),
        "constant input": (agent(f=Q * X1**3 + chain_sum(order), order=order, b=Q, box=BOX), NOTHING, 0, 1),
        "disturbance": (agent(f=chain_sum(order) + V1 + P * V2, order=order, box=BOX), ROTATION, 0, 3),
        "zero dynamics only": (
            agent([P * Z1 + X1**2], x[-1] * Z1 if order > 1 else 0, order=order, box=BOX),
            NOTHING,
            1,
            0,
        ),
        "both": (agent(zero, Z1 * X1 * x[-1] + Z1 + V2, order=order, b=Q, box=BOX), ROTATION, 1, 3),
        "two zero states": (agent([P * Z1 + Z2 + V1, -Z2 + X1], Z1 + x[-1] * Z2, order=order, box=BOX), CONSTANT, 2, 1),
        "transcendental": (agent([-Z1 + sin(X1)], exp(x[-1]) - 1 + Z1 * X1, order=order), NOTHING, 1, 1),
    }


CASES = [(order, name) for order in (1, 2, 3, 4) for name in variants(order)]


@pytest.mark.parametrize(("order", "name"), CASES)
def test_transformed_equations_are_the_original_ones(order: int, name: str) -> None:
    plant, exo, zero_states, model_order = variants(order)[name]
    system = built(plant, exo)
    assert len(system.symbols.zbar) == zero_states and len(system.symbols.etatilde) == model_order
    assert len(system.symbols.xhat) == order - 1 and len(system.symbols.e) == order
    residuals = identity_residuals(system)
    assert len(residuals) == 2 * (zero_states + 2 * order + model_order) + 1
    assert [normal_form(residual) for residual in residuals] == [0] * len(residuals)


@pytest.mark.parametrize("index", range(5))
def test_example_of_the_paper(five_agents: Plant, index: int) -> None:
    system = built(five_agents.agents[index], five_agents.exosystem, sympy.Integer(2))
    assert all(normal_form(residual) == 0 for residual in identity_residuals(system))
    sym = system.symbols
    if index < 2:
        p1, yr = symbol("p1"), sym.reference
        assert normal_form(system.f0_bar[0] - (p1 * sym.zbar[0] + sym.xhat[0])) == 0
        assert normal_form(system.f0_hat[0] - (yr - 2)) == 0 and system.f2_bar == 0
    else:
        p3, yr = symbol("p3"), sym.reference
        assert normal_form(system.f2_bar - p3 * (yr**3 - 8)) == 0


def test_coordinates_are_those_of_the_theory() -> None:
    """Section 3 written out for n = 3, one zero state and one internal-model state."""
    plant = agent([P * Z1 + X1], Z1 + X2 * X3, order=3, b=Q, box=BOX)
    system = built(plant, NOTHING, sympy.Integer(2))
    sym, gains = system.symbols, system.symbols.gains
    (gamma1, gamma2), g, h, yr = gains.gamma, gains.g, gains.h, sym.reference
    vartheta = X3 + g * gamma2 * X2 + g**2 * gamma1 * (X1 - yr)
    u_star = 2 / P / Q
    assert [normal_form(z) for z in dict(system.from_original).values()] == [
        normal_form(z)
        for z in (
            Z1 + 2 / P,
            X1 - yr,
            X2 / g,
            sym.eta[0] - u_star - vartheta / Q,
            vartheta,
            h**2 * (X1 - sym.observer[0]),
            h * (X2 - sym.observer[1]),
            X3 - sym.observer[2],
        )
    ]
    u = sym.ubar + sym.eta[0]  # Ψ = 1: M = −1, N = 1, Φ = 0, T = 1
    c1, c2, c3 = gains.c
    error = X1 - sym.observer[0]
    assert dict(system.original) == {
        Z1: P * Z1 + X1,
        X1: X2,
        X2: X3,
        X3: Z1 + X2 * X3 + Q * u,
        sym.eta[0]: -sym.eta[0] + u,
        sym.observer[0]: sym.observer[1] + h * c3 * error,
        sym.observer[1]: sym.observer[2] + h**2 * c2 * error,
        sym.observer[2]: h**3 * c1 * error,
        yr: sym.reference_rate,
    }


def test_controller_sees_the_estimate() -> None:
    """ϑ̃ = x̃_n + … + g^(n−1) γ_1 (x̃_1 − y^r) = ϑ − E2(h) e, the paper's stabilizer."""
    system = built(agent(order=3), NOTHING)
    sym, gains = system.symbols, system.symbols.gains
    (gamma1, gamma2), g = gains.gamma, gains.g
    x = sym.observer
    assert sympy.expand(system.observed - (x[2] + g * gamma2 * x[1] + g**2 * gamma1 * (x[0] - sym.reference))) == 0
    expected = sympy.Matrix([[g**2 * gamma1 / gains.h**2, g * gamma2 / gains.h, 1]])
    assert expected == system.matrices.E2


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_matrices_have_the_design_polynomials(order: int) -> None:
    """det(λI − Ac) and det(λI − E3) are the polynomials with the coefficients γ and c."""
    system = built(agent(order=order), NOTHING)
    gains, matrices, x = system.symbols.gains, system.matrices, sympy.Symbol("x")
    for matrix, lower in ((matrices.Ac, gains.gamma), (matrices.E3, gains.c)):
        expected = x ** len(lower) + sum(c * x**k for k, c in enumerate(lower))
        assert sympy.expand(matrix.charpoly(x).as_expr() - expected) == 0
    assert matrices.E.shape == matrices.Bc.shape == (order - 1, 1) and matrices.E2.shape == (1, order)


def broken(system: ErrorSystem, state: sympy.Symbol, change: sympy.Expr) -> list[sympy.Expr]:
    """The residuals that are not zero once the equation of one state is changed."""
    changed = replace(
        system, equations=tuple((name, rate + change if name == state else rate) for name, rate in system.equations)
    )
    return [residual for residual in map(normal_form, identity_residuals(changed)) if residual != 0]


def test_f14_printed_observer_error_for_order_one_misses_the_reference_rate() -> None:
    """E_i4 = [0 0 1 0 0]: e_1' = −h c_1 e_1 + ϑ'; in truth + ẏ^r."""
    system = built(agent([P * Z1 + X1 + V1], Z1 * X1 + V2, order=1, box=BOX), ROTATION)
    sym = system.symbols
    printed = -sym.gains.h * sym.gains.c[0] * sym.e[0] + system.rate(sym.vartheta)
    difference = printed - system.rate(sym.e[0])
    assert normal_form(difference + sym.reference_rate) == 0
    assert broken(system, sym.e[0], difference) == [sym.reference_rate]


@pytest.mark.parametrize("order", [2, 3, 4])
def test_printed_observer_error_is_right_for_higher_orders(order: int) -> None:
    """E_i4 = [… −g^(n−1)(γ_1 … γ_(n−1)) … 1 …] applied to Ẋ gives ẋ_n."""
    system = built(agent([P * Z1 + X1 + V1], Z1 * X1 + V2, order=order, box=BOX), ROTATION)
    sym, g = system.symbols, system.symbols.gains.g
    printed = system.rate(sym.vartheta) - g ** (order - 1) * sum(
        gamma * system.rate(x) for gamma, x in zip(sym.gains.gamma, sym.xhat, strict=True)
    )
    assert normal_form(printed - system.xn_dot) == 0


def test_f15_printed_equation_for_order_two_misses_the_reference_rate() -> None:
    """For n = 2 the printed last line, ``ϑ/g^(n−2) − g γ_1 x̂_1``, is the only one and lacks −ẏ^r."""
    system = built(agent(f=X1 * X2), NOTHING)
    sym, gains = system.symbols, system.symbols.gains
    printed = sym.vartheta - gains.g * gains.gamma[0] * sym.xhat[0]
    assert broken(system, sym.xhat[0], printed - system.rate(sym.xhat[0])) == [-sym.reference_rate]


@pytest.mark.parametrize("order", [2, 3, 4])
def test_f15_printed_column_has_one_row_too_many(order: int) -> None:
    system = built(agent(order=order), NOTHING)
    printed = sympy.Matrix([1] + [0] * (order - 1))
    with pytest.raises(sympy.ShapeError):
        _ = system.matrices.Ac * sympy.Matrix(system.symbols.xhat) - printed * system.symbols.reference_rate


def test_f19_printed_steady_state_breaks_the_identities(five_agents: Plant) -> None:
    p1, v1, v2 = sympy.symbols("p1 v1 v2", real=True)
    printed = -11 * p1 * v1 / (p1**2 + THETA**2) - 11 * THETA * v2 / (p1**2 + THETA**2) + p1 * S / THETA
    first, exo = five_agents.agents[0], five_agents.exosystem
    right = solve_regulator(first, exo)
    assert isinstance(right, SteadyState)
    model = internal_model(first, exo, right, sympy.Integer(2))
    assert isinstance(model, InternalModel)
    system = error_system(first, exo, SteadyState((printed,), right.u_star, "user"), model, sympy.Integer(2))
    residual = normal_form(identity_residuals(system)[0])
    assert residual == normal_form(2 + 2 * p1**2 / THETA)


@pytest.mark.parametrize("name", ["zbar", "xhat", "etatilde", "vartheta", "e"])
def test_any_change_of_an_equation_is_noticed(name: str) -> None:
    system = built(agent([P * Z1 + X1 + V1], Z1 * X2 + V2, order=3, b=Q, box=BOX), ROTATION)
    family = getattr(system.symbols, name)
    for state in family if isinstance(family, tuple) else (family,):
        assert broken(system, state, system.symbols.vartheta) == [-system.symbols.vartheta]


def test_wrong_steady_input_breaks_the_identities() -> None:
    plant = agent(f=X1 * Q + V1, order=2, box=BOX)
    steady = solve_regulator(plant, ROTATION)
    assert isinstance(steady, SteadyState)
    model = internal_model(plant, ROTATION, steady, S)
    assert isinstance(model, InternalModel)
    system = error_system(plant, ROTATION, replace(steady, u_star=steady.u_star + V1), model, S)
    assert any(zero_test(residual).verdict == "fails" for residual in identity_residuals(system))


def test_names_of_the_plant_are_not_reused() -> None:
    """A parameter g or c1 and an exosystem state e1 keep their meaning."""
    g, c1, e1 = symbol("g"), symbol("c1"), symbol("e1")
    exo = Exosystem((e1,), sympy.ImmutableMatrix([[0]]), (ROTATION.initial[0],))
    system = built(agent(f=g * X1**2 + c1 * X2 + e1, box={g: (1, 2), c1: (1, 2)}), exo)
    own = {system.symbols.gains.g, *system.symbols.gains.c, *system.symbols.e}
    assert not own & {g, c1, e1}
    assert all(normal_form(residual) == 0 for residual in identity_residuals(system))


def test_point_parameters_are_replaced() -> None:
    system = built(agent([P * Z1 + X1], Z1, box={P: (-1, -1)}), NOTHING)
    assert not any(rate.has(P) for _, rate in system.equations)
    assert all(normal_form(residual) == 0 for residual in identity_residuals(system))


def test_derivation_of_the_example(five_agents: Plant) -> None:
    with at_most(2_500_000):
        derivation = derive(five_agents, sympy.Integer(2))
        text, latex, data = as_text(derivation), as_latex(derivation), as_dict(derivation)
    assert derivation.verdict == "holds" and derivation.types == ((1, 2), (3, 4, 5))
    for line in (
        "agents 1, 2: order 2",
        "u*(s, v, w) = -12*v2",
        "Ψ = Γ T⁻¹ = (34/25, 3)",
        "Ψ = Γ T⁻¹ = (3, 159/25, 5)",
        "z̄1' = f̄0_1 + f̂0_1",
        "x̂1' = -g*γ1*x̂1 + ϑ - yr'",
        "ε = f̄2 - g**2*γ1*yr'",
        "γ = (1, 2), c = (1, 3, 3)",
    ):
        assert line in text
    assert r"\dot{\hat x_{1}} &= g \hat x_{2} - \dot y^r" in latex and latex.count(r"\begin{align*}") == 8
    assert json.loads(json.dumps(data)) == data
    assert data["status"] == "holds" and data["agents"][0]["internal_model"]["psi"] == ["34/25", "3"]
    assert data["agents"][4]["equations"]["rates"]["xhat2'"] == "-g*gamma1*xhat1 - g*gamma2*xhat2 + vartheta/g"


def pair(*agents: Agent, exo: Exosystem = ROTATION) -> Plant:
    numbered = tuple(replace(one, id=k) for k, one in enumerate(agents, 1))
    edges = tuple(Edge(k, k % len(agents) + 1, sympy.Integer(1)) for k in range(1, len(agents) + 1))
    return Plant("hand-built", Digraph(len(agents), edges), exo, numbered, "0" * 64)


def test_derivation_reports_what_could_not_be_derived() -> None:
    derivation = derive(pair(agent(f=V1), agent([X1]), agent(f=1 / (2 + V1)), agent([-Z1 - Z1**3 + X1])), S)
    assert [one.verdict for one in derivation.agents] == ["holds", "fails", "fails", "holds"]
    assert derivation.verdict == "fails" and derive(pair(agent([-Z1 - Z1**3 + X1])), S).verdict == "holds"
    text = as_text(derivation)
    assert "no steady state (fails): the terms without v" in text
    assert "no internal model (fails): u* is not a polynomial in v" in text
    data = as_dict(derivation)
    assert data["agents"][1]["steady_state"]["evidence"]["equation"] == "z1" and data["status"] == "fails"
    assert "No steady state (fails)." in as_latex(derivation) and "No internal model" in as_latex(derivation)


def test_printed_equations_mean_the_computed_ones() -> None:
    """Substituting the named functions and coordinates gives the equations of the error system."""
    third, first = agent([P * Z1 + X1 + V1], Z1 * X2 + V2, order=3, b=Q, box=BOX), agent(f=X1**2 + V1, order=1)
    derivation = derive(pair(third, first), S)
    for derived in derivation.agents:
        assert isinstance(derived, AgentDerivation) and derived.coordinates and derived.equations
        system, named = derived.coordinates, derived.equations
        functions = {equation.left: equation.right for equation in named.functions}
        definitions = {equation.left: equation.right for equation in named.coordinates}
        stars = {star: definitions[star] for star in named.symbols.zstar}
        xbar = dict(zip(named.symbols.xbar, _xbar(system), strict=True))
        for equation in named.rates:
            if equation.rate:
                expr = equation.right.xreplace(functions).xreplace(functions).xreplace({**stars, **xbar})
                assert normal_form(expr - system.rate(equation.left)) == 0
        for state, expr in system.from_original:
            if state in definitions:
                value = definitions[state]
                for _ in range(3):
                    value = value.xreplace(definitions)
                assert normal_form(value - expr) == 0
        assert set(latex_names(named.symbols)) >= {*named.symbols.xhat, named.symbols.vartheta, named.symbols.f_hat}


def _xbar(system: ErrorSystem) -> list[sympy.Expr]:
    back = dict(system.to_original)
    first, *rest = (back[x] for x in system.agent.chain)
    return [first - system.symbols.reference, *rest]
