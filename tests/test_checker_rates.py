"""Every term of the rules of direct/3 that bound a speed: states of a box, moved by the plant and the controller.

And what the comparison system reaches within a step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import direct_producer as producer
import numpy as np
import pytest
from flint import arb

from certify.checker.balls import BITS, precision
from certify.checker.certificate import AgentClaim
from certify.checker.intervals import between, enclose
from certify.checker.plant import Agent, read_plant
from certify.checker.rules import loop
from certify.checker.rules.first_phase import FirstPhase, Sizes
from certify.checker.rules.increments import Increments
from certify.checker.rules.observer import tabulate
from certify.checker.rules.surroundings import Surroundings
from certify.checker.rules.tube import _Tube
from certify.checker.rules.zero_ranges import ZeroRanges
from certify.checker.verdict import start_meter

Array = Any
Q = Fraction
P, B_RADIUS = 0.5, 0.25  # p ∈ ±1/2, b = 1 ± 1/4
OPTIMUM, Y, Z = 0.25, 0.5, 0.75  # s* ∈ ±1/4, |y^r − s*| ≤ Y, |ẏ^r| ≤ Z
COUNT = 20_000


@dataclass(frozen=True)
class Model:
    """One agent with ``z* = c (s + v1)`` and its right-hand sides for arrays ``z, x, v1, p``; linear ones are sharp."""

    order: int
    f0: tuple[str, ...]
    f: str
    flow: Callable[..., tuple[list[Array], Array]]
    steady: tuple[float, ...]
    s: int
    sharp: bool


MODELS = {
    "first": Model(
        1,
        ("-2*z1 + 2*x1 + 2*v1",),
        "p*x1 + z1 - v1",
        lambda z, x, v, p: ([-2 * z[0] + 2 * x[0] + 2 * v], p * x[0] + z[0] - v),
        (1.0,),
        2,
        True,
    ),
    "second": Model(
        2,
        ("-z1 + x1 + v1", "-z2 + z1"),
        "p*x2 + x2 + 3*z1 - z2 + x1 + v1",
        lambda z, x, v, p: ([-z[0] + x[0] + v, -z[1] + z[0]], (p + 1) * x[1] + 3 * z[0] - z[1] + x[0] + v),
        (1.0, 1.0),
        2,
        True,
    ),
    "third": Model(3, (), "p*x3 - x2 + 2*x1", lambda z, x, v, p: ([], p * x[2] - x[1] + 2 * x[0]), (), 0, True),
    "curved": Model(
        2,
        ("-z1 + x1 + v1",),
        "p*x2*x1 + sin(z1) + x1^3/4 + v1",
        lambda z, x, v, p: ([-z[0] + x[0] + v], p * x[1] * x[0] + np.sin(z[0]) + x[0] ** 3 / 4 + v),
        (1.0,),
        1,
        False,
    ),
}


class Case:
    """The rules for a model under some controller, and random states of a box with what moves them."""

    def __init__(self, name: str) -> None:
        self.model = model = MODELS[name]
        n, nz, s = model.order, len(model.f0), model.s
        zero = ", ".join(f'z{k} = "{f0}"' for k, f0 in enumerate(model.f0, 1))
        text = f'order = {n}\nf = "{model.f}"\nb = "1 + q"\nuncertain = {{ p = [-{P}, {P}], q = [-0.25, 0.25] }}\n'
        text += f"zero_dynamics = {{ {zero} }}\n" if nz else ""
        tiny = replace(producer.with_exosystem(), agent=text)
        self.agent: Agent = read_plant(tiny.toml).agents[0]
        self.claim = AgentClaim(
            1,
            Q(2),
            Q(7),
            Q(50),
            Q(10) if n > 1 else None,
            (Q(3), Q(1, 2))[: n - 1],
            (Q(3), Q(2), Q(5))[:n] if n > 1 else (),
            [[Q(-1), Q(2)], [Q(-3), Q(-4)]][:s] if s != 1 else [[Q(-2)]],
            (Q(2), Q(-1))[:s],
            (Q(1), Q(3))[:s],
        )
        nominal = SimpleNamespace(f0=[[Q(-1, 2)] * (nz + 1)] * nz, f1=(Q(1, 3),) * (nz + n), b=Q(9, 8))
        empty = SimpleNamespace(grid=(Q(0),), boxes=(), vartheta=())
        self.outputs = nz + n + 2
        identity = [[[Q(int(i == j))] for j in range(nz + 2)] for i in range(self.outputs)]
        size = loop.size_of(self.agent, s)
        kernels = [[*row, *[[Q(0)]] * size] for row in identity]
        self.witness: Any = SimpleNamespace(
            phase1=empty, nominal=nominal, rates=(Q(1),), kernels=kernels, boxes=(), ell=(Q(0),) * s
        )
        v, steady = between(-1, 1), [between(Q(-5, 4), Q(5, 4))] * nz
        reach = Q(OPTIMUM) + Q(Y)
        y = between(-reach, reach)
        self.around = Surroundings({"v1": v, "v2": v}, tuple(steady), y, enclose(Q(Y)), enclose(Q(Z)))
        w, b = {"p": between(Q(-1, 2), Q(1, 2)), "q": between(Q(-1, 4), Q(1, 4))}, between(Q(3, 4), Q(5, 4))
        optimum = between(Q(-1, 4), Q(1, 4))
        self.increments = Increments(self.agent, optimum, w, ZeroRanges("agent 1", self.agent, []))
        self.b, self.known = b, SimpleNamespace(b=b)
        self.box = np.array([0.5, 0.25, 1.0, 0.75, 1.5][: nz + n])
        self.zeta = np.array([0.5, 0.25])[:s]
        self.states(np.random.default_rng(0))

    def states(self, random: Any) -> None:
        """Corners for the most part: of ``s*, v, p, b, y^r, ẏ^r, z̄, x̄, ζ``; the input is anything."""
        n, nz = self.model.order, len(self.model.f0)

        def pick(*sizes: float) -> Array:
            part = np.where(random.random((len(sizes), COUNT)) < 0.97, 1.0, random.random((len(sizes), COUNT)))
            return np.array(sizes)[:, None] * part * random.choice([-1.0, 1.0], (len(sizes), COUNT))

        self.s_star, self.v, p, q, gap, self.speed = pick(OPTIMUM, 1.0, P, B_RADIUS, Y, Z)
        self.true_b, y = 1 + q, self.s_star + gap
        self.z_bar, self.x_bar, zeta = pick(*self.box[:nz]), pick(*self.box[nz:]), pick(*self.zeta)
        N, M, psi = (np.array(entry, dtype=float) for entry in (self.claim.N, self.claim.M, self.claim.psi))
        eta = zeta + N[:, None] * self.x_bar[-1] / self.true_b
        steady = np.array([c * (self.s_star + self.v) for c in self.model.steady]).reshape(nz, COUNT)
        x = self.x_bar.copy()
        x[0] += y
        still = np.zeros((n, COUNT))
        still[0] = self.s_star
        after, before = (self.model.flow(*at, self.v, p) for at in ((self.z_bar + steady, x), (steady, still)))
        self.dz = np.array(after[0]).reshape(nz, COUNT) - np.array(before[0]).reshape(nz, COUNT)
        self.df = after[1] - before[1]
        self.u = random.normal(size=COUNT) * 5
        push = self.df + self.true_b * (self.u + psi @ eta)
        self.dx = np.vstack([self.x_bar[1:], push])
        self.dx[0] -= self.speed
        self.d_eta = M @ eta + np.outer(N, psi) @ eta + N[:, None] * self.u if len(N) else eta
        self.d_zeta = self.d_eta - N[:, None] * self.dx[-1] / self.true_b


@pytest.fixture(autouse=True)
def _fresh_meter() -> None:
    start_meter()


def holds(found: Array, bound: Any, sharp: bool) -> None:
    """No state is faster than the bound, and where it is sharp some state nearly is as fast."""
    assert np.abs(found).max() <= float(bound.hi) * (1 + 1e-12)
    assert not sharp or np.abs(found).max() >= 0.95 * float(bound.hi)


@pytest.mark.parametrize("name", MODELS)
def test_no_state_of_a_box_is_faster_than_the_rates_of_phase_1(name: str) -> None:
    case = Case(name)
    nz, claim = len(case.model.f0), case.claim
    rule = FirstPhase("agent 1", case.agent, claim, case.witness, case.known, None, case.increments, tabulate)  # type: ignore[arg-type]
    z, x, zeta = ([enclose(Q(size)) for size in sizes] for sizes in (case.box[:nz], case.box[nz:], case.zeta))
    slopes = case.increments.in_tail(case.around, z, x)
    rates = rule.rates(Sizes(z, x, enclose(1), zeta), slopes, case.around)
    sharp = case.model.sharp
    for found, bound in zip(case.dz, rates.z, strict=True):
        holds(found, bound, sharp)
    theta = np.array([float(entry) for entry in loop.theta(claim)])
    holds(case.dx[-1] - case.true_b * case.u, rates.last, sharp)
    holds(theta @ case.dx - case.true_b * case.u, rates.theta, sharp)
    for found, bound in zip(case.d_zeta, rates.zeta, strict=True):
        holds(found, bound, sharp)


@pytest.mark.parametrize("name", MODELS)
def test_what_the_nominal_loop_leaves_out_is_below_the_forcing_of_the_tube(name: str) -> None:
    """``X' − A X = Σ_j B_j q_j`` while the saturation is inactive, ``|q_j|`` below what the rule says."""
    case = Case(name)
    n, nz, s, claim = case.model.order, len(case.model.f0), case.model.s, case.claim
    built = loop.build(case.agent, claim, case.witness)
    random = np.random.default_rng(1)
    eta, e = random.normal(size=(s, COUNT)), random.normal(size=(n if n > 1 else 0, COUNT))
    X = np.vstack([case.z_bar, case.x_bar, eta, e])
    A, B, C = (
        np.array(table, dtype=float).reshape(-1, columns)
        for table, columns in ((built.A, len(X)), (built.inputs, nz + 2), (built.outputs, len(X)))
    )
    estimate, psi, N = (C @ X)[-2], np.array(claim.psi, dtype=float), np.array(claim.N, dtype=float)
    u = -float(claim.K) * estimate
    push = case.df + case.true_b * (u + psi @ eta)
    d_eta = (np.array(claim.M, dtype=float).reshape(s, s) + np.outer(N, psi)) @ eta + N[:, None] * u
    dX = np.vstack([case.dz, case.x_bar[1:], push[None], d_eta])
    dX[nz] -= case.speed
    if n > 1:
        E3 = np.array(loop.observer_matrix(claim.observer), dtype=float)
        de = float(claim.h or 1) * E3 @ e
        de[-1] += push
        dX = np.vstack([dX, de])
    rest = dX - A @ X - np.outer(B[:, -1], case.speed)
    q = np.linalg.lstsq(B[:, :-1], rest, rcond=None)[0]
    assert np.allclose(B[:, :-1] @ q, rest, rtol=1e-9, atol=1e-8)
    used = float(np.abs((C @ X)[-1]).max())
    box = [*(Q(size) for size in case.box), Q(0), Q(used) * (1 + Q(1, 10**12))]
    with precision(BITS):
        tube = _Tube("agent 1", built, claim, case.witness, case.b, case.increments, [enclose(0)] * len(X))
        sizes = tube.sizes(box)
        forcing = tube.forcing(box, case.around, case.increments.in_tail(case.around, *sizes))
    *bounds, speed = (float(forcing[j][0].upper()) for j in range(nz + 2))
    assert Z <= speed <= Z * (1 + 1e-9)
    for found, bound, share in zip(q, bounds, [0.95] * nz + [0.6], strict=True):
        assert np.abs(found).max() <= bound * (1 + 1e-9)
        assert not case.model.sharp or np.abs(found).max() >= share * bound


@pytest.mark.parametrize("seed", range(40))
def test_what_an_output_reaches_during_a_step_is_above_all_of_it(seed: int) -> None:
    """``Σ_a L_a + (p_a − L_a) e^(−μ_a τ)`` for parts of either sign, also where it rises and falls between the ends."""
    random = np.random.default_rng(seed)
    case, count = Case("third"), int(random.integers(1, 6))
    rates = np.cumsum(np.round(random.exponential(2.0 ** random.integers(-4, 6), count), 6) + 2.0**-12)
    case.witness.rates = tuple(Q(float(rate)) for rate in rates)
    length = Q(float(np.round(random.exponential(1 / rates[0]), 6) + 2.0**-12))
    case.witness.grid, case.witness.boxes = (Q(0), length), ((Q(0),) * case.outputs,)
    case.witness.kernels = [[[Q(0)] * count] * 11] * case.outputs
    p, phi = random.normal(size=(2, case.outputs, count)) * 10.0 ** random.integers(-2, 3, (2, case.outputs, count))
    built = loop.build(case.agent, case.claim, case.witness)
    nothing: Any = SimpleNamespace(during=lambda *ends: case.around, on_step=lambda *ends: None)
    reached: list[float] = []
    with precision(BITS):
        tube = _Tube("agent 1", built, case.claim, case.witness, case.b, nothing, [enclose(0)] * 6)
        tube.p = [[arb(float(entry)) for entry in row] for row in p]
        tube.forcing = lambda *box: [[arb(float(entry)) for entry in row] for row in phi]  # type: ignore[method-assign]
        tube.inside = lambda name, found, box: reached.extend(  # type: ignore[method-assign]
            float(size.upper()) for size in found
        )
        tube.step(0, nothing)
        after = np.array([[float(entry) for entry in row] for row in tube.p])
    times = np.append(0.0, np.geomspace(2.0**-16, 1.0, 4000)) * float(length)
    limits = phi / rates
    values = limits[:, None] + (p - limits)[:, None] * np.exp(-times[:, None] * rates)
    highest, size = values.sum(axis=2).max(axis=1), np.abs(values).sum(axis=2).max(axis=1)
    assert (highest <= np.array(reached) + 1e-12 * size).all()
    assert (np.array(reached) <= highest + 0.35 * size).all()
    assert np.allclose(after, values[:, -1], rtol=1e-9, atol=1e-9 * size.max())
