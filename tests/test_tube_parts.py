"""The parts of the direct route's search, each against what it is an estimate of."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import sympy
from flint import arb
from scipy.linalg import expm

from certify.bounds.balls import compile_expression
from certify.tube import float_intervals as intervals
from certify.tube.designs import DAMPINGS, POLES
from certify.tube.direct_ranges import move
from certify.tube.loop import LoopGains
from certify.tube.observer_error import ObserverDecay, ObserverError, observer_decay
from certify.tube.ranges import FloatProgram, Range
from certify.tube.search import NoChoice, search_gains
from certify.tube.trial import AgentTrials, Trial, TrialFailure
from certify.units.scales import unscaled
from symbolic.design import companion_pair, damped_polynomial
from symbolic.plant import Agent, Interval, RequestedGains
from tests.tubes import Array, trials

NEAR = 1e-12
DOMAINS: dict[str, Range] = {
    "sin": (-20, 20),
    "cos": (-20, 20),
    "tan": (-4, 4),
    "exp": (-20, 20),
    "log": (-1, 20),
    "sqrt": (-1, 20),
    "tanh": (-5, 5),
    "atan": (-20, 20),
    "sinh": (-5, 5),
    "cosh": (-5, 5),
    "Abs": (-5, 5),
}


def pairs(generator: np.random.Generator, low: float, high: float, count: int) -> list[Range]:
    """Ranges of all widths."""
    widths = (high - low) * np.exp(generator.uniform(-8, 0, count))
    starts = generator.uniform(low, high - widths)
    return [(float(a), float(a + w)) for a, w in zip(starts, widths, strict=True)]


def secant(program: FloatProgram, box: list[Range], centre: Range) -> Range:
    """The slopes from ``centre`` to the first side of the box."""
    return program.slope(len(box) + 1, range(len(box)), 0, len(box))([*box, centre])


def within(value: Array | float, side: Range) -> bool:
    slack = NEAR * (1 + np.abs(value))
    return bool(np.all(side[0] - slack <= value) and np.all(value <= side[1] + slack))


@pytest.mark.parametrize("name", DOMAINS)
def test_float_intervals_are_the_ranges_of_functions_and_of_their_derivatives(name: str) -> None:
    x = sympy.Symbol("x", real=True)
    expression = getattr(sympy, name)(x)
    function = sympy.lambdify(x, expression, "numpy")
    slope = sympy.lambdify(x, sympy.sign(x) if name == "Abs" else sympy.diff(expression, x), "numpy")
    found = 0
    for low, high in pairs(np.random.default_rng(1), *DOMAINS[name], 300):
        value = intervals.function_ends(name, (low, high))
        if value is None:
            assert name in ("tan", "log", "sqrt")
            continue
        found += 1
        points = np.linspace(low, high, 257)
        samples = function(points)
        assert within(samples, value)
        assert value[1] - value[0] <= 1.01 * float(np.ptp(samples)) + NEAR * (1 + np.abs(samples).max())
        derivative = intervals.function_slope(name, (low, high), value)
        assert derivative is not None and within(slope(points), derivative)
    assert found > 60


def test_float_intervals_agree_with_balls() -> None:
    generator = np.random.default_rng(2)
    for x, y in zip(pairs(generator, -4, 4, 300), pairs(generator, -4, 4, 300), strict=True):
        bx, by = ball(x), ball(y)
        for mine, theirs in (
            (intervals.add(x, y), bx + by),
            (intervals.multiply(x, y), bx * by),
            (intervals.negate(x), -bx),
            (intervals.power(x, 2), bx**2),
            (intervals.power(x, 3), bx**3),
        ):
            assert mine is not None
            # balls are as wide or wider; what they are the hull of is the range itself
            assert float(theirs.lower()) - 1e-9 <= mine[0] and mine[1] <= float(theirs.upper()) + 1e-9
        inside = np.array([x[0], x[1], *generator.uniform(*x, 20)])[:, None], np.array([*y, *generator.uniform(*y, 20)])
        product = intervals.multiply(x, y)
        assert product is not None and within(inside[0] * inside[1], product)
        for exponent in (-3, -2, -1, 0, 1, 2, 3, 4):
            side = intervals.power(x, exponent)
            assert (side is None) == (exponent < 0 and x[0] <= 0 <= x[1])
            if side is not None:
                assert within(inside[0] ** float(exponent), side)


def ball(side: Range) -> arb:
    return arb(side[0]).union(arb(side[1]))


@pytest.mark.parametrize(
    "text", ["x*y", "x**3 - x*y**2", "sin(x*y) + x", "exp(-x**2)*y", "1/(x**2 + y + 5)", "x**-2 + y*x", "Abs(x - y)"]
)
def test_secants_contain_the_quotients_of_differences(text: str) -> None:
    x, y = sympy.symbols("x y", real=True)
    expression = sympy.sympify(text, locals={"x": x, "y": y})
    program, f = FloatProgram(compile_expression(expression, (x, y))), sympy.lambdify((x, y), expression, "numpy")
    generator = np.random.default_rng(3)
    low = 0.5 if "-2" in text else -2.0
    moved, centre, other = (pairs(generator, a, 2.0, 100) for a in (low, low, -2.0))
    for box, rest, side in zip(moved, centre, other, strict=True):
        slope = secant(program, [box, side], rest)
        assert all(math.isfinite(end) for end in slope)
        to, at, beside = (generator.uniform(*pair, 200) for pair in (box, rest, side))
        apart = np.where(np.abs(to - at) > 1e-3, to - at, np.inf)
        quotient = (f(to, beside) - f(at, beside)) / apart
        quotient = quotient[np.isfinite(apart)]
        assert np.all(slope[0] - 1e-9 <= quotient) and np.all(quotient <= slope[1] + 1e-9)
        assert within(f(to, beside), program.enclose([box, side]))


def test_secants_of_powers_are_divided_differences() -> None:
    """``(x³ − c³)/(x − c) = x² + xc + c²`` at points; the derivative between would be anywhere in ``[0, 12]``."""
    x = sympy.Symbol("x", real=True)
    program = FloatProgram(compile_expression(x**3, (x,)))
    assert secant(program, [(2.0, 2.0)], (-1.0, -1.0)) == (3.0, 3.0)
    assert secant(program, [(2.0, 2.0)], (2.0, 2.0)) == (12.0, 12.0)
    assert secant(FloatProgram(compile_expression(1 / x, (x,))), [(-1.0, 1.0)], (2.0, 2.0)) == (-math.inf, math.inf)


@pytest.mark.parametrize(("name", "number"), [("five_agents", 1), ("rooms", 2), ("thermal_springs", 1)])
def test_known_ranges_hold_trajectories_of_the_zero_dynamics(name: str, number: int) -> None:
    """Under any ``x_1``, exosystem and parameters in their ranges; switched, so that the faces are reached."""
    held = trials(name, number)
    increments, model = held.increments, held.model
    moment, length, steps = held.surroundings.during(0.0, 0.25), 0.0625, 200
    box = np.full(increments.zeros + increments.order, 8.0)
    box[increments.zeros :] = 0.5
    moved = move(increments, held.initial.ranges, box, moment, length)
    assert moved is not None
    ends, during = np.array(moved[0]), np.array(moved[1])
    symbols = (*model.agent.zero_states, model.agent.chain[0], *model.exosystem.states, *model.agent.parameters)
    f0 = sympy.lambdify(symbols, model.agent.zero_dynamics, "numpy")
    generator, count = np.random.default_rng(4), 400

    def anywhere(sides: list[Range]) -> Array:
        low, high = np.array(sides).reshape(len(sides), 2).T[:, :, None]
        share = generator.random((len(sides), count))
        share[:, count // 2 :] = np.round(share[:, count // 2 :])
        return np.asarray(low + share * (high - low))

    z, w = anywhere(list(held.initial.ranges)), anywhere(increments.parameters)
    output = (moment.reference[0] - 0.5, moment.reference[1] + 0.5)
    held_inputs = anywhere([output, *moment.v])
    for _ in range(steps):
        u = np.where(np.arange(count) % 3 == 0, anywhere([output, *moment.v]), held_inputs)  # some switch, some do not

        def rate(z: Array, u: Array = u) -> Array:
            return np.array([np.broadcast_to(part, count) for part in f0(*z, *u, *w)])

        h = length / steps
        k1 = rate(z)
        k2 = rate(z + h / 2 * k1)
        k3 = rate(z + h / 2 * k2)
        z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(z + h * k3))
        assert np.all(z >= during[:, :1] - NEAR) and np.all(z <= during[:, 1:] + NEAR)
    assert np.all(z >= ends[:, :1] - NEAR) and np.all(z <= ends[:, 1:] + NEAR)
    start = np.array(held.initial.ranges)
    room = np.maximum(ends[:, 1] - start[:, 1], start[:, 0] - ends[:, 0])
    used = np.maximum(z.max(axis=1) - start[:, 1], start[:, 0] - z.min(axis=1))
    assert np.all((used > 0.3 * room) | (room < 1e-3)), used / room


E3S = {
    "second order": ((Fraction(-2), Fraction(1)), (Fraction(-1), Fraction(0))),
    "third order": (
        (Fraction(-3), Fraction(1), Fraction(0)),
        (Fraction(-3), Fraction(0), Fraction(1)),
        (Fraction(-1), Fraction(0), Fraction(0)),
    ),
    "oscillating": ((Fraction(-1, 2), Fraction(1)), (Fraction(-4), Fraction(0))),
}


@pytest.mark.parametrize("kind", E3S)
def test_observer_decay_bounds_the_exponential_and_its_integral(kind: str) -> None:
    E3, decay = np.array(E3S[kind], dtype=float), known_decay(kind)
    assert np.all(np.diff(decay.later, axis=0) <= 0)
    fine, rest = decay.width / 8, np.eye(len(E3))
    step, total, slack = expm(E3 * fine), np.zeros(len(E3)), []
    for k in range(8 * len(decay.later)):
        flow = np.abs(rest)
        assert np.all(flow <= decay.later[k // 8] + 1e-15)
        slack.append(np.max(flow / decay.later[k // 8]))
        following = step @ rest
        total += fine * (flow[:, -1] + np.abs(following)[:, -1]) / 2
        rest = following
    assert np.all(total <= decay.gains * (1 + 1e-3)) and np.all(decay.gains <= 1.25 * total)
    assert max(slack) > 0.8


def known_decay(kind: str) -> ObserverDecay:
    decay = observer_decay(E3S[kind])
    assert decay is not None
    return decay


def test_an_observer_that_does_not_forget_has_no_decay() -> None:
    assert observer_decay(((Fraction(0), Fraction(1)), (Fraction(-1), Fraction(0)))) is None
    assert observer_decay(((Fraction(1), Fraction(1)), (Fraction(-1), Fraction(1)))) is None


@pytest.mark.parametrize("kind", E3S)
def test_observer_errors_stay_below_their_bounds_under_any_acceleration(kind: str) -> None:
    """``e' = h E3 e + e_n ẋ_n`` with ``|ẋ_n| ≤ 5`` switching at random."""
    E3, h, speed, count = np.array(E3S[kind], dtype=float), 40.0, 5.0, 200
    n, generator = len(E3), np.random.default_rng(6)
    initial = 3.0 * np.arange(n, 0, -1)
    error = ObserverError(known_decay(kind), np.ones(n), initial, h)
    e = initial[:, None] * generator.choice([-1.0, 1.0], (n, count))
    width, drive = 1e-3, np.zeros(count)
    augmented = expm(width * np.block([[h * E3, np.eye(n)[:, -1:]], [np.zeros((1, n + 1))]]))
    used = 0.0
    for k in range(600):
        switch = generator.random(count) < 0.05
        drive = np.where(switch | (k == 0), speed * generator.choice([-1.0, 1.0], count), drive)
        bound = error.at(k * width, speed)
        assert np.all(np.abs(e).max(axis=1) <= bound * (1 + 1e-9))
        used = max(used, float(np.max(np.abs(e).max(axis=1) / bound)))
        e = (augmented @ np.vstack([e, drive]))[:n]
    assert used > 0.5


@dataclass
class Rule:
    """Stands in for the trials of an agent: gains pass where ``K ≥ least_K(g)`` and ``h ≥ ratio·K``."""

    least_K: int
    ratio: int
    order: int = 2
    agent: Agent = field(default_factory=lambda: trials("van_der_pol", 2).model.agent)
    rate: float = 1.0

    def __post_init__(self) -> None:
        self.passed: list[Trial] = []
        self.model = self
        self.internal_model = SimpleNamespace(order=1)
        self.units = unscaled(self.order, 0)
        self.input_gain = Interval(Fraction(1), Fraction(2))

    def named(self, gains: LoopGains) -> str:
        return str(gains)

    def attempt(
        self, gains: LoopGains, delta: Fraction | None = None, like: Trial | None = None
    ) -> Trial | TrialFailure:
        if gains.K * gains.g < self.least_K * 3 or (gains.h is not None and gains.h < self.ratio * gains.K):
            return TrialFailure(gains, "too small")
        tube, nothing = SimpleNamespace(peak=np.ones(2), tail_rate=self.rate), cast(Any, None)
        level = delta or 100 + 1000 / gains.K + gains.K / 10
        trial = Trial(cast(Any, self), gains, level, nothing, nothing, nothing, nothing, cast(Any, tube))
        self.passed.append(trial)
        return trial

    def tightened(self, trial: Trial) -> Trial:
        return trial


@pytest.mark.parametrize("rule", [Rule(7, 20), Rule(40, 5), Rule(250, 390), Rule(3, 7, order=1)])
def test_the_choices_are_the_best_of_everything_that_passed(rule: Rule) -> None:
    rule = replace(rule)
    found = search_gains(cast(AgentTrials, rule), RequestedGains())
    assert not isinstance(found, NoChoice)
    chosen = [choice.trial for choice in found]
    assert len({id(trial) for trial in chosen}) == len(chosen) and len({choice.label for choice in found}) == len(found)
    assert all(any(trial is other for other in rule.passed) for trial in chosen)
    costs = {
        "balanced": lambda gains, delta: (gains.K * (gains.h or 1)) ** 3 * delta,
        "least K": lambda gains, delta: gains.K,
        "least h": lambda gains, delta: gains.h or 0,
        "least delta": lambda gains, delta: delta,
    }
    assert found[0].label == "balanced"
    for label, cost in costs.items():
        least = min(cost(trial.gains, trial.delta) for trial in rule.passed)
        assert min(cost(trial.gains, trial.delta) for trial in chosen) == least
        for choice in found:
            assert choice.label != label or cost(choice.trial.gains, choice.trial.delta) == least, label


@pytest.mark.parametrize("slower", [False, True])
def test_a_design_is_changed_where_smaller_gains_pass_with_it_at_no_lower_rate(slower: bool) -> None:
    tried: list[Agent] = []

    def redesigned(agent: Agent) -> AgentTrials:
        tried.append(agent)
        better = agent.observer == damped_polynomial(2, Fraction(3, 4))
        rule = Rule(40, 10, agent=agent) if not better else Rule(8, 10, agent=agent, rate=0.9 if slower else 1.0)
        return cast(AgentTrials, rule)

    found = search_gains(cast(AgentTrials, Rule(40, 10)), RequestedGains(), redesigned=redesigned)
    assert not isinstance(found, NoChoice)
    assert len(tried) == len(set(tried)) == len(DAMPINGS) + len(POLES)
    default = found[0].trial
    assert default.model.agent.internal_model is None and default.model.agent.gamma is None
    assert (default.model.agent.observer is None) == slower
    assert (default.gains.K < 15) != slower


def test_designs_are_left_alone_where_gains_or_the_design_are_given() -> None:
    tried: list[Agent] = []

    def redesigned(agent: Agent) -> None:
        tried.append(agent)

    for gains in (RequestedGains(K=Fraction(60)), RequestedGains(h=Fraction(6000))):
        assert not isinstance(search_gains(cast(AgentTrials, Rule(10, 10)), gains, redesigned=redesigned), NoChoice)
    rule = Rule(10, 10)
    fixed = replace(rule.agent, observer=(Fraction(1), Fraction(2)), internal_model=companion_pair(1))
    found = search_gains(cast(AgentTrials, replace(rule, agent=fixed)), RequestedGains(), redesigned=redesigned)
    assert not isinstance(found, NoChoice) and tried == []


def test_a_search_that_finds_nothing_says_why() -> None:
    found = search_gains(cast(AgentTrials, Rule(10**9, 1)), RequestedGains())
    assert isinstance(found, NoChoice) and found.reason.startswith("too small (with ")
    assert found.tried >= 24 and f"of {found.tried} trials, b in [1, 2], K from 5 to " in found.reason


@pytest.mark.parametrize("spread", [1.0, 3.0])
def test_a_search_is_given_up_where_far_larger_gains_do_not_move_the_escape(spread: float) -> None:
    class Escaping(Rule):
        def attempt(
            self, gains: LoopGains, delta: Fraction | None = None, like: Trial | None = None
        ) -> Trial | TrialFailure:
            return TrialFailure(gains, "outrun", 0.1 * spread if gains.K > 1000 else 0.1)

    found = search_gains(cast(AgentTrials, Escaping(1, 1)), RequestedGains())
    assert isinstance(found, NoChoice) and found.reason.startswith("outrun")
    assert found.tried <= 4 if spread == 1.0 else found.tried >= 24
