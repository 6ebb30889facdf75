"""Models of other shapes in normal form: the new equations are the old ones, everywhere; the box holds all starts."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import networkx as nx
import numpy as np
import pytest
import sympy
from sympy import cos, exp, sin

import certify
from reports.command_line import main
from symbolic.errors import InputError
from symbolic.identity import zero_test
from symbolic.interval import Interval
from symbolic.models.affine import INPUT, AffineModel, affine_model
from symbolic.models.boxes import hull
from symbolic.models.model_file import read_model
from symbolic.models.normal_form import NormalForm, normal_form
from symbolic.models.state_space import from_state_space
from symbolic.plant import symbol

PAGE = (Path(__file__).resolve().parent.parent / "docs" / "models.md").read_text(encoding="utf-8")
theta, omega, i, R, k, d, u, s = sympy.symbols("theta omega i R k d u s")
q1, q2, w1, w2, C, T, alpha, q, v1, v2 = sympy.symbols("q1 q2 w1 w2 C T alpha q v1 v2")
REACTION = C * exp(-1 / (1 + T**2))
SWING = {theta: omega, omega: -9.81 * theta - d * omega - u}

MODELS: dict[str, tuple[AffineModel, int]] = {
    "motor": (
        affine_model(
            {theta: omega, omega: 2 * i - omega / 10, i: (u - R * i - omega / 10) / 0.5},
            theta,
            uncertain={R: (1, 1.2)},
            initial={theta: (-1, 1), omega: 0, i: (-0.1, 0.1)},
        ),
        3,
    ),
    "flexible joint": (
        affine_model(
            {q1: w1, w1: -9.81 * sin(q1) - k * (q1 - q2), q2: w2, w2: k * (q1 - q2) + u},
            q1,
            uncertain={k: (9, 11)},
            initial={q1: (-0.1, 0.1), w1: (-1, 1), q2: (-0.1, 0.2), w2: 0},
        ),
        4,
    ),
    "Van der Pol": (affine_model({q1: w1, w1: (1 - q1**2) * w1 - q1 + u}, q1, initial={q1: (-1, 1), w1: (0, 1)}), 2),
    "tank": (
        affine_model({C: 1 - C - REACTION, T: -T + 3 * REACTION + 2 * u}, T, initial={C: (0.4, 0.6), T: (-0.1, 0.1)}),
        1,
    ),
    "pitch": (
        affine_model(
            {
                alpha: -0.313 * alpha + 56.7 * q + 0.232 * u,
                q: -0.0139 * alpha - 0.426 * q + 0.0203 * u,
                theta: 56.7 * q,
            },
            theta,
            initial={alpha: (-0.1, 0.1), q: (-0.01, 0.01), theta: (-0.2, 0.2)},
        ),
        2,
    ),
    "crane": (
        affine_model(
            {q1: w1, w1: u, **SWING},
            q1,
            uncertain={d: (0.3, 0.5)},
            initial={q1: (-1, 1), w1: (-1, 1), theta: (-0.1, 0.1), omega: 0},
        ),
        2,
    ),
    "disturbed": (
        affine_model(
            {q1: w1 + v1, w1: -sin(q1) + u},
            q1,
            initial={q1: 0, w1: (-1, 1)},
            exosystem={"states": (v1, v2), "S": [[0, 1], [-1, 0]], "initial": {v1: 0, v2: (0, 1)}},
        ),
        2,
    ),
    "state below a cubic": (affine_model({q1: -q1 + w1**3, w1: u}, w1, initial={q1: (-1, 1), w1: (-1, 1)}), 1),
    "cubic shift": (affine_model({q1: -q1 + w1**2 * w2, w1: w2, w2: u}, w1, initial={q1: 0, w1: 1, w2: 1}), 2),
}


@pytest.mark.parametrize("name", MODELS)
def test_coordinates_turn_the_model_into_the_normal_form(name: str) -> None:
    """By the chain rule alone: the derivative of every new coordinate along the model is what the form says."""
    model, order = MODELS[name]
    form = normal_form(model)
    assert form.order == order and len(form.coordinates) == len(model.states)
    chain = [symbol(f"x{j}") for j in range(1, order + 1)]
    said = dict(zip(chain, [*chain[1:], form.f + form.b * INPUT], strict=True)) | dict(form.zero_dynamics)
    outside = list(model.S * sympy.Matrix(list(model.disturbances))) if model.disturbances else []
    for new, expr in form.coordinates.items():
        along = [(state, rate) for state, rate in zip(model.states, model.rates, strict=True)]
        along += list(zip(model.disturbances, outside, strict=True))
        derivative = sympy.Add(*(sympy.diff(expr, name) * rate for name, rate in along))
        assert zero_test(derivative - said[new].xreplace(dict(form.coordinates))).verdict == "holds", new
        assert zero_test(expr.xreplace(dict(form.inverse)) - new).verdict == "holds", new
    allowed = {*form.zero_dynamics, chain[0], *model.disturbances, *model.parameters}
    assert all(rate.free_symbols <= allowed for rate in form.zero_dynamics.values())


@pytest.mark.parametrize("name", MODELS)
def test_box_holds_every_start_and_is_not_much_larger(name: str) -> None:
    model, _ = MODELS[name]
    form = normal_form(model)
    rng = random.Random(1)
    sides = dict(zip(model.states, model.initial, strict=True)) | dict(form.parameters)
    sides |= dict(zip(model.disturbances, model.disturbance_box, strict=True))
    seen: dict[sympy.Symbol, list[sympy.Rational]] = {new: [] for new in form.box}
    for _ in range(40):
        point = {
            name: sympy.Rational(*rng.choice([side.lo, side.hi, (side.lo + side.hi) / 2]).as_integer_ratio())
            for name, side in sides.items()
        }
        for new, expr in form.coordinates.items():
            seen[new].append(expr.xreplace(point))
    for new, side in form.box.items():
        values = [float(value) for value in seen[new]]
        assert float(side.lo) <= min(values) + 1e-12 and max(values) - 1e-12 <= float(side.hi)
        assert float(side.hi - side.lo) <= 1.6 * (max(values) - min(values)) + 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_linear_models_always_have_a_normal_form(seed: int) -> None:
    """Random systems of order 2 to 5 and any relative degree: their transfer functions are those of their forms."""
    rng = random.Random(seed)
    n = rng.randint(2, 5)
    A = [[rng.randint(-3, 3) for _ in range(n)] for _ in range(n)]
    B = [[rng.choice([0, 0, 1, -2])] for _ in range(n)]
    B[rng.randrange(n)] = [1]
    C = [[rng.choice([0, 0, 1, 3]) for _ in range(n)]]
    C[0][rng.randrange(n)] = 1
    lam = sympy.Symbol("lam")
    transfer = (sympy.Matrix(C) * (lam * sympy.eye(n) - sympy.Matrix(A)).inv() * sympy.Matrix(B))[0, 0]
    try:
        form = normal_form(from_state_space(A, B, C))
    except InputError as error:
        assert "does not act on the output" in str(error) and sympy.simplify(transfer) == 0
        return
    assert sympy.cancel(transfer - _transfer(form, lam)) == 0


def _transfer(form: NormalForm, lam: sympy.Symbol) -> sympy.Expr:
    chain = [symbol(f"x{j}") for j in range(1, form.order + 1)]
    names = [*chain, *form.zero_dynamics]
    rates = sympy.Matrix([*chain[1:], form.f, *form.zero_dynamics.values()])
    A = rates.jacobian(names)
    B = sympy.Matrix([form.b if j == form.order - 1 else 0 for j in range(len(names))])
    return sympy.cancel((lam * sympy.eye(len(names)) - A).inv()[0, :].dot(B))


def test_transfer_functions_of_python_control() -> None:
    nested = SimpleNamespace(num=[[np.array([1.0, 2.0])]], den=[[np.array([1.0, 3.0, 3.0, 0.1])]], dt=0)
    lam = sympy.Symbol("lam")
    wanted = (lam + 2) / (lam**3 + 3 * lam**2 + 3 * lam + sympy.Rational(1, 10))
    form = normal_form(from_state_space(nested))
    assert form.order == 2
    assert sympy.cancel(_transfer(form, lam) - wanted) == 0
    control = pytest.importorskip("control")
    for system in (control.tf([1, 2], [1, 3, 3, 0.1]), control.ss([[0, 1], [-2, -3]], [[0], [1]], [[1, 0]], [[0]])):
        assert normal_form(from_state_space(system)).order == 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: affine_model({q1: -q1, w1: u}, q1).agent(s), "the input does not act on the output"),
        (lambda: affine_model({q1: u**2}, q1).agent(s), "not affine in u"),
        (lambda: affine_model({q1: w1, w1: cos(q1) * u}, q1).agent(s), "the input acts through cos"),
        (lambda: affine_model({q1: R * u}, q1, uncertain={R: (-1, 1)}).agent(s), "may vanish for parameters"),
        (lambda: affine_model({q1: w1**3, w1: u}, q1).agent(s), "the input acts through 3"),
        (lambda: affine_model({q1: -q1 + w2 * q1, w1: w2, w2: u}, w1).agent(s), "z1' = .* depends on x2"),
        (lambda: affine_model({q1: sympy.Symbol("a")}, q1), "rate of q1: unknown name 'a'"),
        (lambda: affine_model({q1: u}, q1, initial={w1: 0}), "initial: a box for each of q1"),
        (lambda: from_state_space([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 1), "D is not 0"),
        (lambda: from_state_space([[0, 1], [0, 0]], [[0, 1], [1, 0]], [[1, 0]]), "B 2×2"),
        (lambda: from_state_space([[0]], [[1]]), "C is missing"),
        (lambda: from_state_space(SimpleNamespace(num=[1], den=[1, 1], dt=0.1)), "discrete time"),
        (lambda: from_state_space(SimpleNamespace(num=[1, 0], den=[1, 1])), "D is not 0"),
        (lambda: from_state_space(SimpleNamespace(num=[1, 0, 0], den=[1, 1])), "not proper"),
        (lambda: from_state_space(SimpleNamespace(num=[[[1], [2]]], den=[[[1, 1], [1, 1]]])), "one input and one"),
        (lambda: from_state_space([[float("nan")]], [[1]], [[1]]), "A: a finite number"),
    ],
)
def test_refusals_give_the_reason(make: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()  # type: ignore[operator]


x, y = symbol("x"), symbol("y")


@pytest.mark.parametrize(
    ("expr", "box", "low", "high"),
    [
        (x - x * y, {x: (0, 1), y: (0, 1)}, 0, 1),
        (x**2 - 1, {x: (-2, 1)}, -1, 3),
        (sin(x), {x: (0, 1)}, 0, 0.8414709848079),
        (exp(x) / 2, {x: (0, 1)}, 0.5, 1.3591409142296),
        (1 / (x + 2), {x: (-1, 1)}, 1 / 3, 1),
        (sympy.sqrt(x), {x: (1, 4)}, 1, 2),
        (sympy.pi * x, {x: (-1, 1)}, -3.1415926535898, 3.1415926535898),
    ],
)
def test_enclosures(expr: sympy.Expr, box: Mapping[sympy.Symbol, tuple[int, int]], low: float, high: float) -> None:
    found = hull(expr, {name: Interval(Fraction(a), Fraction(b)) for name, (a, b) in box.items()})
    assert float(found.lo) <= low + 1e-15 and high - 1e-15 <= float(found.hi)
    assert found.hi - found.lo <= Fraction(high - low) * 2


@pytest.mark.parametrize("expr", [1 / x, sympy.log(x), sympy.sqrt(x - 1)])
def test_enclosures_of_what_is_not_defined_are_refused(expr: sympy.Expr) -> None:
    with pytest.raises(InputError, match="not shown to"):
        hull(expr, {x: Interval(Fraction(-1), Fraction(1))})


def test_network_of_models() -> None:
    crane, _ = MODELS["crane"]
    network = certify.Network(
        "mixed",
        nx.DiGraph([("crane", "lag"), ("lag", "crane")]),
        {
            "crane": crane.agent((s - 1) ** 2),
            "lag": from_state_space([[0, 1], [-2, -3]], [0, 1], [1, 0], initial=[(-1, 1), 0]).agent(s**2),
        },
    )
    first, second = network.plant.agents
    assert first.initial.x == (Interval(Fraction(-1), Fraction(1)),) * 2
    assert second.initial.x == (Interval(Fraction(-1), Fraction(1)), Interval(Fraction(0), Fraction(0)))
    assert certify.check(network).status == "holds"
    assert certify.read_plant is not None and network.text == network.plant.source.decode()


def test_a_model_and_its_network_have_one_exosystem() -> None:
    """Other frequencies, or a larger box of disturbances, are not those that the model was transformed with."""
    described = MODELS["disturbed"][0].agent(s**2)

    def plant(S: object, box: object) -> object:
        exosystem = {"states": ("v2", "v1"), "S": S, "initial": {"v1": 0, "v2": box}}
        return certify.Network("n", nx.path_graph(2), described, exosystem=exosystem).plant

    assert plant([[0, -1], [1, 0]], (0, 1))
    for S, box in (([[0, -2], [2, 0]], (0, 1)), ([[0, -1], [1, 0]], (0, 2))):
        with pytest.raises(InputError, match="another exosystem than the network's"):
            plant(S, box)


(MODEL,) = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)


def test_code_of_the_page_runs() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    exec(compile(code, "models.md", "exec"), {})  # noqa: S102 - the page's own example


def test_model_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, plant = tmp_path / "model.toml", tmp_path / "plant.toml"
    model.write_text(MODEL)
    assert main(["normal-form", str(model), "-o", str(plant)]) == 0
    assert "agent 1: x1 = theta" in capsys.readouterr().out
    assert main(["check", str(plant)]) == 0
    read = certify.read_plant(plant)
    assert (read.name, read.agents[1].order, str(read.agents[1].cost)) == ("two-motors", 3, "(s - 2)**2")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("consensus-model/1", "consensus-plant/1", "schema: 'consensus-model/1' is needed"),
        ('theta = "omega"', 'theta = "omga"', r"agent\[1\]\.dynamics\.theta: column 1: unknown name 'omga'"),
        ('theta = "omega"', 'theta = "omega^2"', r"m.toml: agent\[1\]: agent 1: the input acts through"),
        ('output    = "theta"\n', "", r"agent\[1\]\.output: missing"),
        ("omega = 0, i = 0", "omega = 0", r"agent\[1\]\.initial\.i: missing"),
        ('cost      = "(s - id)^2"', 'cost = "(s - q)^2"', r"m.toml: agent\[1\]\.cost: column 6: unknown name 'q'"),
        ("uncertain = { R", "uncertain = { u", r"agent\[1\]\.uncertain\.u: 'u' is taken"),
        ("ids       = [1, 2]", "ids = [1]", "agent: agent 2 has no"),
        ('"1 -> 2", ', '"1 -> 3", ', r"network\.edges\[1\]"),
        ("dynamics  = {", "dinamics = {", "did you mean 'dynamics'"),
        ("eta = 0", "x = 0", r"initial: unknown key 'x'"),
    ],
)
def test_wrong_model_files(old: str, new: str, message: str) -> None:
    assert old in MODEL
    with pytest.raises(InputError, match=message):
        read_model(MODEL.replace(old, new, 1).encode(), "m.toml")


def test_poles_that_cancel_stay(tmp_path: Path) -> None:
    """The model is not defined where theta is 0, and neither is the plant."""
    text = MODEL.replace('"2*i - omega/10"', '"2*i - omega/10 + theta^2/theta - theta"')
    plant = read_model(text.encode(), "m.toml").plant
    assert any(guard.expression == symbol("x1") for guard in plant.agents[0].guards.f)
