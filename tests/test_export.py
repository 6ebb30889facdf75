"""The exported controller: its discrete parts against the continuous ones, C against Python, loops that settle."""

from __future__ import annotations

import importlib.util
import math
import random
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import sympy
from flint import arb_mat, ctx
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from certify.export.c_text import c_files
from certify.export.formats import DOUBLE, SINGLE, Format, constant
from certify.export.gradient import gradient
from certify.export.modes import modes
from certify.export.observer import luenberger
from certify.export.package import Options, Package, json_text, package
from certify.export.python_text import python_files
from certify.export.sampled_stability import sampled_loops
from reports.command_line.demonstration import demonstration_controller
from sims.sampled_loop import Run, Start, centre, run_network
from symbolic.controller import AgentController
from symbolic.derivation import derive
from symbolic.errors import InputError
from symbolic.plant import COST_VARIABLE, Plant
from symbolic.plant_file import load_plant, parse_plant

TRIO = """
schema = "consensus-plant/1"
name = "trio"
network = { agents = 3, edges = ["1 -> 2", "2 -> 3", "3 -> 1", ["1 -> 3", "1/2"]] }
initial = { box = [-1, 1], reference = [0, 1], observer = 0, eta = 0 }
gains = { g = 2, K = 20, delta = 200, h = 60 }
coordinator = { alpha1 = 5, alpha2 = 5, gradient_gain = 1, mixing_gain = 1, mixing_time = 0 }
[exosystem]
states = ["v1", "v2", "v3"]
S = [[0, 2, 0], [-2, 0, 0], [0, 0, 0]]
initial = { v1 = 0, v2 = 1, v3 = 1 }
[[agent]]
ids = [1]
order = 1
f = "-x1 + v1"
b = 1
cost = "(s - 1)^2"
[[agent]]
ids = [2, 3]
order = 2
f = "p*x2 - sin(x1) + v1 + v3"
b = 1
cost = "s^2 + log(1 + exp(s))"
uncertain = { p = [-2, -1] }
"""
EXAMPLES = Path(__file__).parent.parent / "examples"
UNSTABLE = {"five_agents_published", "third_order_actuator"}  # the published gains, and moderate ones there
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]
FLAGS = ["-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]


def plant_of(*changes: tuple[str, str]) -> Plant:
    text = TRIO
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_plant(text.encode(), "trio.toml")


PERIODS = Options(period=Fraction(1, 200), coordinator_period=Fraction(1, 50))


def made(plant: Plant, options: Options = PERIODS, **claim: str) -> Package:
    """The package of the plant file's own gains; nothing here is certified."""
    controller = demonstration_controller(plant, derive(plant, COST_VARIABLE))
    gains = replace(controller.coordinator, **{key: Fraction(value) for key, value in claim.items()})
    entries = {"agents": [{"id": str(law.id)} for law in controller.agents]}
    return package(plant, entries, "0" * 64, "none/0", replace(controller, coordinator=gains), options)


def agents(package: Package, folder: Path) -> dict[int, Callable[[float], Any]]:
    """The exported Python classes by agent."""
    found = {}
    for name, text in python_files(package.programs, package.digest, package.notice).items():
        (folder / name).write_text(text, encoding="utf-8")
        spec = importlib.util.spec_from_file_location(name[:-3], folder / name)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        found[int(name[5:-3])] = module.Agent
    return found


def run(plant: Plant, package: Package, folder: Path, seconds: float, **options: Any) -> Run:
    program = package.programs[0]
    rounds = program.period * program.substeps
    periods = {p.id: p.period for p in package.programs}
    starts = options.pop("starts", centre(plant))
    return run_network(plant, agents(package, folder), periods, rounds, starts, int(seconds / float(rounds)), **options)


# --- rounding ---------------------------------------------------------------------------------------------------------


@given(st.fractions(min_value=-(10**20), max_value=10**20), st.sampled_from([DOUBLE, SINGLE]))
def test_constants_are_the_nearest_floats_and_say_how_near(value: Fraction, format: Format) -> None:
    try:
        found = constant("X", "x", value, format)
    except InputError:
        assert abs(value) < Fraction(2) ** format.least * 2
        return
    expected = float(value) if format is DOUBLE else _nearest_single(value)
    assert found.number == expected == float.fromhex(found.hexadecimal)
    assert found.error == abs(found.value - value)


def _nearest_single(value: Fraction) -> float:
    """Of the floats around the one that two roundings give, the nearest, ties to even."""
    near = np.float32(float(value))
    around = [np.nextafter(near, np.float32(-np.inf)), near, np.nextafter(near, np.float32(np.inf))]
    return float(min(around, key=lambda x: (abs(Fraction(float(x)) - value), int(x.view(np.uint32)) & 1)))


def test_a_constant_without_a_normal_number_is_refused() -> None:
    for size in (Fraction(10) ** 40, Fraction(1, 10**40)):
        constant("X", "x", size, DOUBLE)
        with pytest.raises(InputError, match=r"the gain \(X\) is about 1e[+-]\d+: no normal single"):
            constant("X", "the gain", size, SINGLE)


# --- discrete parts ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("c", [(1, 2), (2, 2), (1, 3, 3), (5, 8, 5), (1, 4, 6, 4)])
@pytest.mark.parametrize("h", [Fraction(3), Fraction(400)])
def test_the_observer_has_the_poles_of_the_continuous_one(c: tuple[int, ...], h: Fraction) -> None:
    """In balls: the characteristic polynomials of ``E − L e_1ᵀ`` and ``e^(hτC)`` agree."""
    n, period = len(c), Fraction(1, 700)
    with ctx.workprec(300):
        found = luenberger(tuple(map(Fraction, c)), h, period)
        E = arb_mat(n, n, [float(0)] * (n * n))
        companion = arb_mat(n, n)
        for i in range(n):
            for k in range(i, n):
                E[i, k] = arb_mat(1, 1, [0])[0, 0] + _ball(found.transition[k - i])
            E[i, 0] = E[i, 0] - found.gain[i]
            if i + 1 < n:
                companion[i, i + 1] = _ball(h * period)
            companion[n - 1, i] = companion[n - 1, i] - _ball(h * period * c[i])
        ours, theirs = E.charpoly(), companion.exp().charpoly()
        for k in range(n + 1):
            assert (ours[k] - theirs[k]).contains(0) and float((ours[k] - theirs[k]).rad()) < 1e-40


def _ball(value: Fraction) -> Any:
    from certify.bounds.conversions import rational_ball

    return rational_ball(value)


LAWS = [  # M, N, psi with M + N psi of spectrum 0; ±j/2; 0, ±j; ±j, ±2j
    ([[-1]], [1], [1]),
    ([[0, 1], [-1, -2]], [0, 1], ["3/4", 2]),
    ([[0, 1, 0], [0, 0, 1], [-1, -3, -3]], [0, 0, 1], [1, 2, 3]),
    ([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [-1, -4, -6, -4]], [0, 0, 0, 1], [-3, 4, 1, 4]),
]


@pytest.mark.parametrize(("M", "N", "psi"), LAWS)
def test_the_modes_are_the_internal_model_in_other_coordinates(M: list, N: list, psi: list) -> None:
    period, n = Fraction(1, 50), len(N)
    rows = tuple(tuple(map(Fraction, row)) for row in M)
    law = AgentController(1, (), (), rows, tuple(map(Fraction, N)), tuple(map(Fraction, psi)), *[Fraction(1)] * 3, None)
    with ctx.workprec(256):
        found = modes(law, period, Fraction(1, 3))
    A = np.array(M, float) + np.outer(np.array(N, float), [float(Fraction(p)) for p in psi])
    Psi = np.array([float(Fraction(p)) for p in psi])
    block = expm(np.block([[A, np.array(N, float)[:, None]], [np.zeros((1, n + 1))]]) * float(period))
    eta, states = np.full(n, 1 / 3), [[float(x.mid()) for x in mode.start] for mode in found]
    for k in range(300):
        assert sum(state[0] for state in states) == pytest.approx(Psi @ eta, abs=1e-9)
        q = math.sin(0.1 * k)
        eta = block[:n, :n] @ eta + block[:n, n] * q
        for mode, state in zip(found, states, strict=True):
            gain = [float(x.mid()) for x in mode.gain]
            if mode.frequency is None:
                state[0] += gain[0] * q
            else:
                c, s = float(mode.cosine.mid()), float(mode.sine.mid())
                a, b = state
                state[:] = [c * a + s * b + gain[0] * q, c * b - s * a + gain[1] * q]


def test_a_model_that_does_not_only_oscillate_is_refused() -> None:
    law = AgentController(1, (), (), ((Fraction(-1),),), (Fraction(1),), (Fraction(1, 2),), *[Fraction(1)] * 3, None)
    with pytest.raises(InputError, match=r"agent 1: .* not simple or not imaginary"):
        modes(law, Fraction(1), Fraction(0))


COSTS = ["(s - 1)^2/4", "s^2 + log(1 + exp(s))", "sqrt(1 + (s - 3)^2) + s^2", "log(cosh(s)) + s^2/2", "s^4/3 + s^2",
         "s^2 + atan(s/3)", "s^2 + exp(-s^2)/4", "(1 + s^2)^(3/2)", "s^2*sqrt(2) + 1/(2 + s^2)"]  # fmt: skip


@pytest.mark.parametrize("cost", COSTS)
def test_slopes_of_costs(cost: str) -> None:
    expression = sympy.sympify(cost.replace("^", "**"), locals={"s": COST_VARIABLE})
    constants, statements = gradient(expression)
    for s in (-2.5, -0.3, 0.0, 1.0, 4.0):
        names: dict[str, Any] = {c.name: c.number for c in constants} | {"s": s} | vars(math)
        for let in statements:
            names[let.name] = _value(let.expression, names)
        truth = float(sympy.diff(expression, COST_VARIABLE).subs(COST_VARIABLE, sympy.Rational(s)))
        assert names["slope"] == pytest.approx(truth, rel=1e-13, abs=1e-13)


def _value(expression: str, names: dict[str, Any]) -> float:
    return float(sympy.lambdify(list(names), expression, "math")(*names.values()))


# --- the loop ---------------------------------------------------------------------------------------------------------


def optimum(plant: Plant) -> float:
    from sims.coordinator import estimated_optimum

    return estimated_optimum(plant)


def final_error(plant: Plant, found: Run) -> float:
    assert not found.escaped
    tail = [float(np.abs(y[-max(1, len(y) // 20) :] - optimum(plant)).max()) for y in found.outputs]
    return max(tail)


@pytest.mark.parametrize("options", [PERIODS, replace(PERIODS, arithmetic="single")])
def test_outputs_settle_at_the_optimum(tmp_path: Path, options: Options) -> None:
    """A sinusoid and a constant disturb the loop, and the internal model in discrete time takes both away."""
    plant = plant_of()
    assert final_error(plant, run(plant, made(plant, options), tmp_path, 16)) < (1e-5 if options.arithmetic else 1e-6)


def test_lost_messages_leave_no_bias(tmp_path: Path) -> None:
    plant, draw = plant_of(), random.Random(7)
    found = run(plant, made(plant), tmp_path, 16, lost=lambda receiver, sender, stamp: draw.random() < 0.3)
    assert final_error(plant, found) < 1e-6


def test_late_writes_are_borne(tmp_path: Path) -> None:
    plant = plant_of()
    assert final_error(plant, run(plant, made(plant), tmp_path, 16, late={1: 4, 2: 4, 3: 4})) < 1e-6


def test_references_move_after_the_mixing_time(tmp_path: Path) -> None:
    plant = plant_of()
    package = made(plant, mixing_time="1", softening="2", gradient_gain="2", mixing_gain="3")
    built = {id: kind(0.0) for id, kind in agents(package, tmp_path).items()}
    hold = package.programs[0].coordinator.hold
    assert hold >= math.ceil(1 / (package.programs[0].period * package.programs[0].substeps)) > 3
    assert hold >= package.programs[0].coordinator.mixing
    rates = []
    for _ in range(hold + 60):
        messages = {id: agent.message() for id, agent in built.items()}
        for edge in plant.digraph.edges:
            built[edge.target].receive(messages[edge.source])
        begun = [agent.coordinate() for agent in built.values()]
        if not all(begun):
            assert not rates  # it takes some rounds until all know that all run
            continue
        rates.append(max(abs(agent.y_next - agent.y_now) for agent in built.values()))
    assert rates[: hold - 2] == [0.0] * (hold - 2) and rates[hold + 1] > 0
    assert final_error(plant, run(plant, package, tmp_path, 24)) < 1e-6


def test_an_agent_that_starts_late_is_waited_for(tmp_path: Path) -> None:
    plant = plant_of()
    kinds = agents(made(plant), tmp_path)
    built = {1: kinds[1](0.0), 2: kinds[2](0.0)}
    for number in range(200):
        if number == 100:
            assert all(agent.stamp == 0 for agent in built.values())
            built[3] = kinds[3](0.0)
        messages = {id: agent.message() for id, agent in built.items()}
        for edge in plant.digraph.edges:
            if edge.source in built and edge.target in built:
                built[edge.target].receive(messages[edge.source])
        for agent in built.values():
            agent.coordinate()
    stamps = [agent.stamp for agent in built.values()]
    assert min(stamps) > 90 and max(stamps) - min(stamps) <= 2


def test_a_missed_sample_is_one_that_was_as_predicted(tmp_path: Path) -> None:
    """A step in which the measurement is the estimate moves the observer as a missed one does; the model hears what was
    written."""
    kind = agents(made(plant_of()), tmp_path)[2]
    one, other = kind(0.0), kind(0.0)
    for agent in (one, other):
        for y in (0.3, 0.2, 0.25):
            agent.step(y)
    u = one.step(one.x1)
    other.missed()
    assert (one.x1, one.x2) == (other.x1, other.x2)
    held = [other.m1, other.m2, other.m3]
    assert held != [one.m1, one.m2, one.m3] and other.written != u
    one.wrote(other.written)  # the plant kept the old input
    assert [one.m1, one.m2, one.m3] == pytest.approx(held, abs=1e-12)


@pytest.mark.parametrize("number", [1, 2])
def test_the_linearised_sampled_loop_is_that_of_the_exported_step(tmp_path: Path, number: int) -> None:
    """Near rest a run decays at the spectral radius that is estimated, with and without delay."""
    text = TRIO.replace(" + v1 + v3", "").replace(" + v1", "").replace("(s - 1)^2", "s^2")
    text = text.replace("s^2 + log(1 + exp(s))", "s^2").replace("p = [-2, -1]", "p = [-2, -2]")
    text = text.replace("reference = [0, 1]", "reference = 0")
    plant = parse_plant(text.encode(), "trio.toml")
    period = Fraction(1, 60)
    package = made(plant, Options(period=period, coordinator_period=period))
    loop = sampled_loops(plant, demonstration_controller(plant, derive(plant, COST_VARIABLE)))[number - 1]
    starts = [Start(tuple(1e-6 for _ in s.states), s.parameters) for s in centre(plant)]
    decays = []
    for late in (0, 4):
        found = run(plant, package, tmp_path, 8, starts=starts, late={1: late, 2: late, 3: late})
        y = np.abs(found.outputs[number - 1])
        first, last = y[60:120].max(), y[300:360].max()
        decays.append((last / first) ** (1 / 240))
    assert max(decays) == pytest.approx(loop.radius(period), abs=5e-3)


def test_a_period_that_destabilises_is_refused_with_one_that_looks_stable() -> None:
    with pytest.raises(
        InputError, match=r"with 1/2 the linearised sampled loop of agent 1 is unstable .* looks stable"
    ):
        made(plant_of(), Options(period=Fraction(1, 2), coordinator_period=Fraction(1, 2)))


def test_a_certified_bound_of_the_input_limits_it_without_wind_up(tmp_path: Path) -> None:
    """The model hears what was written: from far away it is limited for a while, then it settles as before."""
    plant = plant_of()
    controller = demonstration_controller(plant, derive(plant, COST_VARIABLE))
    asked = {"settling": None, "input": "12", "bandwidth": None}
    claim = {"agents": [{"id": str(a.id), "requirements": asked} for a in plant.agents]}
    limited = package(plant, claim, "0" * 64, "none/0", controller, PERIODS)
    starts = [Start(tuple(1.0 for _ in s.states), s.parameters) for s in centre(plant)]
    found = run(plant, limited, tmp_path, 16, starts=starts)
    assert max(float(np.abs(u).max()) for u in found.inputs) == 12.0
    assert final_error(plant, found) < 1e-5
    assert "certified bound of the input: 12" in c_files(limited.programs, "", ())["agent2.c"]


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
@pytest.mark.parametrize("arithmetic", ["double", "single"])
def test_every_example_builds_and_replays(tmp_path: Path, path: Path, arithmetic: Literal["double", "single"]) -> None:
    """Orders 1 to 4, with and without zero dynamics and exosystem; with the plant file's gains or moderate ones."""
    plant = load_plant(path)
    if path.stem in UNSTABLE:
        with pytest.raises(InputError, match=r"is unstable .* no shorter one is stable either"):
            made(plant, Options(arithmetic=arithmetic, period=Fraction(1, 20_000)))
        return
    exported = made(plant, Options(arithmetic=arithmetic, period=Fraction(1, 20_000)))
    write(exported, tmp_path, run(plant, exported, tmp_path, 0.05).lines)
    for compiler in COMPILERS:
        compiled = built(compiler, tmp_path, exported)
        assert (compiled.returncode, compiled.stderr) == (0, "")
        said = subprocess.run(["./replay", "samples.txt"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert said.stdout.endswith(" samples, 0 differ\n")


# --- C ----------------------------------------------------------------------------------------------------------------


def write(package: Package, folder: Path, lines: Sequence[str]) -> None:
    for name, text in c_files(package.programs, package.digest, package.notice).items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "samples.txt").write_text("\n".join(lines) + "\n")


def built(compiler: str, folder: Path, package: Package, *more: str) -> subprocess.CompletedProcess[str]:
    sources = ["replay.c", *(f"agent{p.id}.c" for p in package.programs)]
    command = [compiler, *FLAGS, *more, "-o", "replay", *sources, "-lm"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
@pytest.mark.parametrize("arithmetic", ["double", "single"])
def test_c_writes_what_python_writes_bit_by_bit(tmp_path: Path, arithmetic: str) -> None:
    resolution = 'implementation = { period = "1/500", input_resolution = "1/64" }\ngains'
    for number, changes in enumerate([(), (("gains", resolution),), (("observer = 0", 'observer = "measured"'),)]):
        plant, draw = plant_of(*changes), random.Random(number)
        package = made(plant, replace(PERIODS, arithmetic=arithmetic))  # type: ignore[arg-type]
        corner = [Start(tuple(1.0 for _ in s.states), s.parameters) for s in centre(plant)]
        noisy = run(plant, package, tmp_path, 2, starts=corner, noise=lambda agent, k, draw=draw: draw.gauss(0, 1e-2))
        write(package, tmp_path, noisy.lines)
        for compiler in COMPILERS:
            compiled = built(compiler, tmp_path, package)
            assert (compiled.returncode, compiled.stderr) == (0, "")
            said = subprocess.run(
                ["./replay", "samples.txt"], cwd=tmp_path, capture_output=True, text=True, check=False
            )
            assert said.stdout.endswith(" samples, 0 differ\n") and said.returncode == 0


@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
def test_the_replay_notices_one_bit(tmp_path: Path) -> None:
    plant = plant_of()
    package = made(plant)
    lines = list(run(plant, package, tmp_path, 1).lines)
    agent, y, u = lines[-1].split()
    lines[-1] = f"{agent} {y} {math.nextafter(float.fromhex(u), 9).hex()}"
    write(package, tmp_path, lines)
    assert built(COMPILERS[0], tmp_path, package).returncode == 0
    said = subprocess.run(["./replay", "samples.txt"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert said.stdout.endswith(" samples, 1 differ\n") and said.returncode == 1


@pytest.mark.skipif(not COMPILERS, reason="no C compiler")
def test_other_arithmetic_is_refused(tmp_path: Path) -> None:
    plant = plant_of()
    package = made(plant)
    write(package, tmp_path, run(plant, package, tmp_path, 1).lines)
    for compiler in COMPILERS:
        refused = built(compiler, tmp_path, package, "-ffast-math")
        assert refused.returncode != 0 and "compile without -ffast-math" in refused.stderr
    if "gcc" in COMPILERS and "fma" in Path("/proc/cpuinfo").read_text():
        assert built("gcc", tmp_path, package, "-mfma", "-ffp-contract=fast").returncode == 0
        said = subprocess.run(["./replay", "samples.txt"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert said.returncode == 2 and "its arithmetic is not as proved" in said.stderr


@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="cppcheck is not installed")
def test_cppcheck_finds_nothing(tmp_path: Path) -> None:
    plant = plant_of()
    package = made(plant, mixing_time="1", softening="2")
    write(package, tmp_path, ())
    command = ["cppcheck", "-q", "--std=c99", "--enable=warning,style,performance,portability", "--error-exitcode=1"]
    sources = sorted(path.name for path in tmp_path.glob("*.c"))
    checked = subprocess.run([*command, "--suppress=missingIncludeSystem", *sources], cwd=tmp_path, check=False,
                             capture_output=True, text=True)  # fmt: skip
    assert (checked.returncode, checked.stderr) == (0, "")


# --- what is said -----------------------------------------------------------------------------------------------------


def test_the_json_has_every_constant_of_the_code(tmp_path: Path) -> None:
    package = made(plant_of())
    text, code = json_text(package), c_files(package.programs, package.digest, package.notice)
    for program in package.programs:
        for c in (*program.constants, *program.coordinator.constants):
            assert f'"hexadecimal": "{c.hexadecimal}"' in text and c.hexadecimal in code[f"agent{program.id}.c"]
            assert abs(c.error) <= abs(c.value) * Fraction(1, 2**52)
    assert package.digest in code["consensus.h"] and "Nothing is proved about sampling" in code["consensus.h"]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (Options(period=Fraction(1, 300), coordinator_period=Fraction(1, 100)), ""),
        (
            Options(period=Fraction(1, 300), coordinator_period=Fraction(1, 200)),
            "no whole multiple of agent 1's period",
        ),
        (Options(period=Fraction(1, 100), coordinator_period=Fraction(1)), "xi stays positive for less than 2/3"),
    ],
)
def test_periods_that_do_not_fit_are_refused(options: Options, reason: str) -> None:
    if reason:
        with pytest.raises(InputError, match=reason):
            made(plant_of(), options)
    else:
        assert {program.substeps for program in made(plant_of(), options).programs} == {3}


def test_chosen_periods_have_a_margin() -> None:
    plant = plant_of()
    package, controller = made(plant, Options()), demonstration_controller(plant, derive(plant, COST_VARIABLE))
    (period,) = {program.period for program in package.programs}
    assert all(loop.radius(5 * period) < 1 for loop in sampled_loops(plant, controller))
    assert (package.programs[0].substeps * period) * 5 < Fraction(2, 3)  # where xi could reach zero
    assert "chosen by a rule of thumb" in package.notice[1] and "by the user" in made(plant).notice[1]
