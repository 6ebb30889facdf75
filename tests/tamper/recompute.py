"""Is a claim proved by the producer's own code too? Asked of every accepted mutant whose claim is another one.

The witnesses are taken as they stand in the mutant; every bound is computed again with the functions of ``certify``
(SymPy, balls,
their own suprema), which share nothing with the checker. The obligations are those of docs/certificate.md.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
import sympy
from flint import ctx

from certify.agent_model import (
    AgentModel,
    InternalModelData,
    LyapunovMatrices,
    References,
    quadratic_form_bound,
    row_sum_norm,
)
from certify.assumptions.a6_zero_dynamics import prove_zero_dynamics
from certify.assumptions.check import check_assumptions
from certify.assumptions.given_lyapunov import Accepted
from certify.bounds.balls import PRECISION, to_arb, upper
from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.bounds.rationals import sqrt_up
from certify.checker import check
from certify.checker.certificate import coordinator_witness
from certify.coordinator.design import gradients_at
from certify.coordinator.envelope import Comparison, Envelope, envelope
from certify.coordinator.mixing import mixing
from certify.coordinator.nominal import CoordinatorModel, cost_gradient
from certify.coordinator.proved import proved_envelope
from certify.coordinator.stability import damping_ranges, inequality
from certify.curvature import Curvature, cost_curvature
from certify.inequalities.exact_psd import (
    PositiveDefinite,
    PositiveSemidefinite,
    prove_positive_definite,
    prove_positive_semidefinite,
)
from certify.inequalities.matrices import inverse
from certify.network_certificate import COORDINATOR_KEYS, network_certificate
from certify.optimum import Optimum, optimum
from certify.preparation import Stopped, prepare
from certify.recipe.constants import Constants, constants, initial_energy, sublevel, zero_layer
from certify.recipe.levels import Level
from certify.recipe.matrices import chain_matrix, observer_matrix
from certify.recipe.thresholds import StateFeedback, _Observer, state_feedback
from certify.routes import DIRECT
from certify.statement.bounds import proved_bounds
from certify.statement.claim import certified_gains
from certify.statement.recomputed import coordinator_envelope
from certify.tube.route import tube_agent
from symbolic.controller import CoordinatorGains
from symbolic.derivation import derive
from symbolic.network import laplacian, left_null_vector
from symbolic.plant import (
    COST_VARIABLE,
    Agent,
    CoordinatorChoice,
    Exosystem,
    InternalModelChoice,
    Interval,
    Plant,
    RequestedGains,
    Requirements,
)
from symbolic.steady_state import SteadyState

from .bases import encode, plant_from_bytes

Json = dict[str, Any]
Rows = tuple[tuple[Fraction, ...], ...]


class NotConfirmed(Exception):
    """The producer's code does not prove this claim with these witnesses; the reason says where it stops."""


def need(holds: bool, reason: str) -> None:
    if not holds:
        raise NotConfirmed(reason)


def why_not_proved(plant_file: bytes, certificate: Json) -> str | None:
    """``None`` if every obligation was proved again, else the first that was not."""
    route = certificate["theorem"].partition("/")[0]
    if route not in ROUTES:
        return f"no second proof is known for the theorem {certificate['theorem']}"
    try:
        ROUTES[route](plant_file, certificate)
    except (NotConfirmed, ValueError, ArithmeticError) as reason:
        return f"{type(reason).__name__}: {reason}"
    return None


@dataclass(frozen=True)
class Known:
    """What the plant file alone decides: computed once per file."""

    plant: Plant
    optimum: Optimum
    s_star: sympy.Expr
    disturbance: ExosystemBounds
    steady: tuple[SteadyState, ...]
    curvatures: tuple[Interval, ...]
    V0: tuple[tuple[Rows, Fraction], ...]


@lru_cache(maxsize=16)
def known_of(plant_file: bytes) -> Known:
    """Raises ``NotConfirmed`` if an assumption is not proved."""
    plant = plant_from_bytes(plant_file)
    report = check_assumptions(plant)
    need(report.status == "holds", f"the assumptions: {report.status}")
    found = optimum(plant)
    s_star = COST_VARIABLE if found.exact is None else sympy.Rational(found.exact.numerator, found.exact.denominator)
    disturbance = exosystem_bounds(plant.exosystem)
    if not isinstance(disturbance, ExosystemBounds):
        raise NotConfirmed("the exosystem is not bounded")
    steady, curvatures, V0 = [], [], []
    for agent, derived in zip(plant.agents, derive(plant, s_star).agents, strict=True):
        curvature, state = cost_curvature(agent.cost), derived.steady_state
        if not isinstance(curvature, Curvature) or not isinstance(state, SteadyState):
            raise NotConfirmed(f"agent {agent.id}: A1 or A3")
        steady.append(state)
        curvatures.append(Interval(curvature.lower, curvature.upper))
        V0.append(_zero_dynamics(plant, agent, state, found))
    return Known(plant, found, s_star, disturbance, tuple(steady), tuple(curvatures), tuple(V0))


def _zero_dynamics(plant: Plant, agent: Agent, steady: SteadyState, found: Optimum) -> tuple[Rows, Fraction]:
    """A quadratic ``V0`` and its greatest proved ``a0``; nothing without zero dynamics."""
    if not agent.zero_states:
        return (), Fraction(0)
    proof = prove_zero_dynamics(agent, plant.exosystem, steady, found.exact)
    if not isinstance(proof, Accepted) or proof.P is None:
        raise NotConfirmed(f"agent {agent.id}: A6")
    return proof.P, proof.a0


def _decay(known: Known, index: int, V0: Rows) -> Fraction:
    """The greatest proved ``a0`` of the witness's ``V0``, given to the producer as if the user had offered it."""
    if known.V0[index][0] == V0:
        return known.V0[index][1]
    agent, size = known.plant.agents[index], range(len(V0))
    need(len(V0) == len(agent.zero_states), f"agent {agent.id}: size of V0")
    z = agent.zero_states
    form = sum((sympy.Rational(str(V0[i][j])) * z[i] * z[j] for i in size for j in size), sympy.S.Zero)
    offered = replace(agent, lyapunov=form)
    P, a0 = _zero_dynamics(known.plant, offered, known.steady[index], known.optimum)
    need(tuple(map(tuple, P)) == V0, f"agent {agent.id}: another V0")
    return a0


def prove_recipe(plant_file: bytes, certificate: Json) -> None:
    """``recipe/2``. Raises ``NotConfirmed``."""
    claim, witness, known = certificate["claim"], certificate["witness"], known_of(plant_file)
    plant = known.plant
    need(claim["plant_sha256"] == plant.sha256, "another plant")
    need([entry["id"] for entry in claim["agents"]] == [str(agent.id) for agent in plant.agents], "other agents")
    _respects(plant, claim)
    constants = tuple(claim[key] for key in COORDINATOR_KEYS)
    references = _coordinator(plant_file, constants, json.dumps(witness["coordinator"]))
    for index, agent in enumerate(plant.agents):
        steady, entry, mine = known.steady[index], claim["agents"][index], witness["agents"][index]
        u_star = steady.u_star.subs(COST_VARIABLE, known.s_star)
        data = _internal_model(u_star, plant.exosystem, entry, _row(mine["ell"]))
        bounds = references.agents[index]
        gamma, observer = _row(entry["gamma"]), _row(entry["observer"])
        need(
            (len(gamma), len(observer)) == (agent.order - 1, agent.order if agent.order > 1 else 0), "sizes of γ and c"
        )
        model = AgentModel(
            agent,
            plant.exosystem,
            steady.z_star,
            data,
            gamma,
            observer,
            known.optimum.enclosure,
            known.disturbance.box,
            known.disturbance.extent,
            References(bounds.peak, bounds.energy, bounds.rate_energy),
        )
        _agent(model, _decay(known, index, _rows(mine["V0"])), entry, mine)


def _respects(plant: Plant, claim: Json) -> None:
    """What the plant file fixes is what the claim says."""
    fixed = {key: getattr(plant.coordinator, key) for key in COORDINATOR_KEYS}
    for key, value in fixed.items():
        need(value is None or value == Fraction(claim[key]), f"{key} is fixed")
    for agent, entry in zip(plant.agents, claim["agents"], strict=True):
        for key in ("g", "K", "delta", "h"):
            value = getattr(plant.gains_of(agent.id), key)
            need(value is None or entry[key] is None or value == Fraction(entry[key]), f"{key} is fixed")
        need(agent.gamma in (None, _row(entry["gamma"])), "gamma is fixed")
        need(agent.observer in (None, _row(entry["observer"])) or agent.order == 1, "observer is fixed")
        if agent.internal_model is not None and entry["N"]:
            need(
                (_rows(entry["M"]), _row(entry["N"])) == (agent.internal_model.M, agent.internal_model.N),
                "M, N are fixed",
            )


def _claimed(agent: Agent, entry: Json) -> Agent:
    """The agent with the design of the claim; its internal model, which need not be the least one, is judged apart."""
    agent = replace(agent, internal_model=None)
    return agent if agent.order == 1 else replace(agent, gamma=_row(entry["gamma"]), observer=_row(entry["observer"]))


def _internal_model(
    u_star: sympy.Expr, exosystem: Exosystem, entry: Json, ell: tuple[Fraction, ...]
) -> InternalModelData:
    """``L_S^s u* = Σ ℓ_k L_S^(k−1) u*``, ``T Φ − M T = N Γ``, ``Ψ T = Γ``: with SymPy, for the claim's ``M, N, Ψ``
    and this ``ℓ``."""
    M, N, psi = _rows(entry["M"]), _row(entry["N"]), _row(entry["psi"])
    size = len(ell)
    need([len(M), len(N), len(psi), *map(len, M)] == [size] * (size + 3), "sizes of the internal model")
    velocity = exosystem.S * sympy.Matrix(exosystem.states) if exosystem.states else ()
    tau = [u_star]
    for _ in ell:
        tau.append(
            sympy.expand(
                sum((sympy.diff(tau[-1], v) * w for v, w in zip(exosystem.states, velocity, strict=True)), sympy.S.Zero)
            )
        )
    residual = tau[size] - sum(
        (sympy.Rational(k.numerator, k.denominator) * term for k, term in zip(ell, tau, strict=False)), sympy.S.Zero
    )
    need(sympy.cancel(sympy.together(residual)) == 0, "the relation of u*")
    if not size:
        return InternalModelData()
    F = sympy.Matrix(M) + sympy.Matrix(N) * sympy.Matrix([psi])
    observability = sympy.Matrix.vstack(*(sympy.Matrix([psi]) * F**k for k in range(size)))
    need(observability.det() != 0, "T is singular")
    T = observability.inv()
    Phi = sympy.Matrix(size, size, lambda i, j: ell[j] if i == size - 1 else int(j == i + 1))
    need(T * Phi - sympy.Matrix(M) * T == sympy.Matrix(N) * sympy.eye(size)[0, :], "T Φ − M T = N Γ")
    rows = tuple(tuple(Fraction(int(T[i, j].p), int(T[i, j].q)) for j in range(size)) for i in range(size))
    return InternalModelData(ell, M, N, rows, psi, tuple(tau[:size]))


@lru_cache(maxsize=16)
def _coordinator(plant_file: bytes, constants: tuple[str, ...], witness_text: str) -> Envelope:
    known, witness = known_of(plant_file), json.loads(witness_text)
    plant, found = known.plant, known.optimum
    L, r = laplacian(plant.digraph), left_null_vector(plant.digraph)
    gains = CoordinatorGains(*map(Fraction, constants))
    need(min(gains.alpha1, gains.alpha2, gains.gradient_gain, gains.mixing_gain) > 0, "α1, α2, κ, β > 0")
    if "curve" in witness:
        need(gains.mixing_time > 0, "a curve begins at t_mix")
        proved = proved_envelope(plant, gains, coordinator_witness(witness), r, found.enclosure)
        if isinstance(proved, str):
            raise NotConfirmed(proved)
        return proved
    need((gains.mixing_time, gains.softening) == (0, 0), "references that start at once")
    need((gains.gradient_gain, gains.mixing_gain) == (1, 1), "the second proof knows the paper's coordinator only")
    costs = tuple(cost_gradient(agent.cost) for agent in plant.agents)
    model = CoordinatorModel(L, r, gains.alpha1, gains.alpha2, costs)
    step, steps = Fraction(witness["step"]), int(witness["steps"])
    need(step > 0 and steps > 0, "the grid")
    grid = mixing(L, r, step, steps)
    need(all(low > 0 for low in grid.smallest), "ξ > 0")
    P, multiplier = _rows(witness["P"]), _row(witness["multiplier"])
    rate, mixing_rate = Fraction(witness["rate"]), Fraction(witness["mixing_rate"])
    need(rate > 0 and mixing_rate > 0 and min(multiplier) >= 0, "rates and multipliers")
    flow = [
        [r[i] * L[i][j] + r[j] * L[j][i] - 2 * mixing_rate * r[i] * ((i == j) - r[j]) for j in range(len(r))]
        for i in range(len(r))
    ]
    _semidefinite(flow, "mixing rate")
    damping = damping_ranges(grid, known.curvatures)
    _definite(P, "P of the coordinator")
    _semidefinite(inequality(model, damping, P, multiplier, rate), "the coordinator's inequality")
    comparison = Comparison(P, multiplier, rate, mixing_rate, damping)
    boxes = [agent.initial.reference for agent in plant.agents]
    return envelope(model, grid, comparison, found.enclosure, gradients_at(costs, found.enclosure), boxes)


def _agent(model: AgentModel, a0: Fraction, claim: Json, witness: Json) -> None:
    name, n = f"agent {model.agent.id}", model.order
    g, K, delta = (Fraction(claim[key]) for key in ("g", "K", "delta"))
    level, slack = Fraction(witness["level"]), Fraction(witness["slack"])
    need(g >= 1 and K > 0 and delta > 0 and level > 0 and slack > 0, f"{name}: signs")
    matrices = LyapunovMatrices(
        _rows(witness["V0"]), Fraction(witness["a0"]), *(_rows(witness[key]) for key in ("P1", "P2", "P3"))
    )
    _matrices(model, a0, matrices, name)
    found = _constants(
        model, matrices, level + slack, g, Fraction(witness["weight_eta"]), Fraction(witness["weight_theta"])
    )
    initial = initial_energy(model, matrices, found)
    drive = found.varsigma[10] * model.references.energy + found.varsigma[11] * model.references.rate_energy
    need(initial + drive <= level, f"{name}: level")
    whole = Level(level, slack, initial, drive, found)
    feedback = state_feedback(model, matrices, whole, K)
    if isinstance(feedback, str):
        raise NotConfirmed(f"{name}: {feedback}")
    if n == 1:
        need(claim["h"] is None and delta >= K * found.sublevel.vartheta, f"{name}: δ")
    else:
        _output_feedback(model, matrices, whole, feedback, delta, Fraction(claim["h"]), name)


def _decays(agent: Agent, given: LyapunovMatrices) -> bool:
    """``V0 J + JᵀV0 ⪯ −a0 I`` exactly, for zero dynamics that are linear and certain: searches find ``a0`` rounded."""
    J = sympy.Matrix(agent.zero_dynamics).jacobian(agent.zero_states)
    if J.free_symbols:
        return False
    V0 = sympy.Matrix([[sympy.Rational(str(entry)) for entry in row] for row in given.V0])
    left = -V0 * J - J.T * V0 - sympy.Rational(str(given.a0)) * sympy.eye(J.rows)
    return bool(left.is_positive_semidefinite)


def _matrices(model: AgentModel, a0: Fraction, given: LyapunovMatrices, name: str) -> None:
    if model.agent.zero_states:
        need(given.a0 <= a0 or _decays(model.agent, given), f"{name}: more than the a0 of this V0")
    need(given.a0 > 0, f"{name}: a0 > 0")
    observer = observer_matrix(model.observer) if model.order > 1 else ()
    for label, A, P in (
        ("P1", chain_matrix(model.gamma), given.P1),
        ("P2", model.internal_model.M, given.P2),
        ("P3", observer, given.P3),
    ):
        need(len(A) == len(P), f"{name}: size of {label}")
        if A:
            size = range(len(A))
            _definite(P, f"{name}: {label}")
            gap = [[-sum(A[k][i] * P[k][j] + P[i][k] * A[k][j] for k in size) - (i == j) for j in size] for i in size]
            _semidefinite(gap, f"{name}: Lyapunov inequality of {label}")


def _constants(
    model: AgentModel, matrices: LyapunovMatrices, C: Fraction, g: Fraction, eta: Fraction, theta: Fraction
) -> Constants:
    """``certify.recipe.constants`` with the weights of the witness in place of its own choice."""
    need(eta > 0 and theta > 0, "weights")
    found, n = constants(model, matrices, C, g), model.order
    vartheta = sqrt_up(2 * C * theta)
    full = sublevel(matrices, C, eta, vartheta)
    f_vartheta = model.last_slope(model.box(full, g)) + (g * model.gamma[-1] if n > 1 else 0)
    one, two, three = zero_layer(model, matrices, C, vartheta if n == 1 else Fraction(0))
    coupling = 4 * (found.norms.P2N / found.b.lo) ** 2 / eta + 1 / (2 * theta)
    gamma = model.gamma[0] if n > 1 else Fraction(1)
    drive = (one * three) ** 2 / matrices.a0 if matrices.V0 else Fraction(0)
    varsigma = dict(found.varsigma) | {
        1: one,
        2: two,
        3: three,
        10: drive + 2 * coupling * found.f_reference**2,
        11: row_sum_norm(matrices.P1) ** 2 + 2 * coupling * (g ** (n - 1) * gamma) ** 2,
    }
    return replace(
        found, sublevel=full, f_vartheta=f_vartheta, varsigma=varsigma, weight_eta=eta, weight_vartheta=theta
    )


def _output_feedback(
    model: AgentModel,
    matrices: LyapunovMatrices,
    level: Level,
    feedback: StateFeedback,
    delta: Fraction,
    h: Fraction,
    name: str,
) -> None:
    """Section 4 of docs/certificate.md at this ``δ`` and ``h``, not at the least ones that the producer would
    choose."""
    found, K, n, slack = level.found, feedback.K, model.order, level.slack
    need(h >= found.g, f"{name}: h >= g")
    E2 = [(found.g / h) ** (n - k) * gamma for k, gamma in enumerate((*model.gamma, Fraction(1)), start=1)]
    dual = tuple(tuple(abs(entry) for entry in row) for row in inverse(matrices.P3))
    need(
        delta >= K * (found.sublevel.vartheta + sqrt_up(slack / 2 * quadratic_form_bound(dual, [abs(e) for e in E2]))),
        f"{name}: δ",
    )
    observer = _Observer(model, matrices, level, feedback, delta)
    need(16 * observer.largest * (observer.p3 * observer.speed) ** 2 <= slack * h**2, f"{name}: h1")
    with ctx.workprec(PRECISION):
        decay = (-to_arb(h * observer.T / (2 * observer.largest))).exp()
        need(upper(decay * to_arb(observer.initial_error(h))) <= slack / 4, f"{name}: h2")
    need(min(observer.dissipation(h).values()) > 0, f"{name}: h3")
    need(96 * observer.p3**2 * found.f_reference**2 * model.references.energy <= slack * h, f"{name}: h3, drift")


def _definite(matrix: Any, name: str) -> None:
    rows = tuple(tuple(row) for row in matrix)
    need(
        all(len(row) == len(rows) for row in rows) and rows == tuple(zip(*rows, strict=True)),
        f"{name} is not symmetric",
    )
    need(isinstance(prove_positive_definite(rows), PositiveDefinite), f"{name} is not positive definite")


def _semidefinite(matrix: Any, name: str) -> None:
    rows = tuple(tuple(Fraction(entry) for entry in row) for row in matrix)
    proof = prove_positive_semidefinite(rows)
    need(isinstance(proof, PositiveSemidefinite | PositiveDefinite), f"{name} is not proved")


def _row(value: list[str]) -> tuple[Fraction, ...]:
    return tuple(map(Fraction, value))


def _rows(value: list[list[str]]) -> Rows:
    return tuple(map(_row, value))


def prove_direct(plant_file: bytes, certificate: Json) -> None:
    """``direct``: the producer is asked for witnesses of exactly these gains, agent by agent, and the checker accepts
    the claim with them too. Requirements that this other tube is too wide for have to follow from the bounds that the
    producer's code reads off the witness as it stands. Raises ``NotConfirmed``."""
    claim, plant = certificate["claim"], plant_from_bytes(plant_file)
    need(claim["plant_sha256"] == plant.sha256, "another plant")
    need([entry["id"] for entry in claim["agents"]] == [str(agent.id) for agent in plant.agents], "other agents")
    _respects(plant, claim)
    agents = tuple(_designed(agent, entry) for agent, entry in zip(plant.agents, claim["agents"], strict=True))
    choice = CoordinatorChoice(**{key: Fraction(claim[key]) for key in COORDINATOR_KEYS})
    designed = replace(plant, agents=agents, gains=(), coordinator=choice, requirements=())
    prepared = prepare(designed, check_assumptions(plant), lambda message: None, DIRECT.proved_on_the_way)
    if isinstance(prepared, Stopped):
        raise NotConfirmed(f"the producer: {prepared.reason}")
    parts = []
    for index, entry in enumerate(claim["agents"]):
        gains = RequestedGains(*(None if entry[key] is None else Fraction(entry[key]) for key in GAINS))
        asked = replace(designed, gains=(gains,) * len(agents))
        result, controller, witness = tube_agent(replace(prepared, plant=asked), index)
        if controller is None or witness is None:
            raise NotConfirmed(f"the producer: {result.reason}")
        parts.append((controller, witness))
    invariant = prepared.disturbance.Q or ()
    again = network_certificate(
        certificate["theorem"], plant, prepared.optimum.enclosure, invariant, prepared.coordinator, parts, {}, True
    )
    need(again["claim"] == claim, "the producer proves another claim")
    verdict = check(plant_file, encode(again))
    if verdict.status == "rejected" and any(f"{word}:" in verdict.obligation for word in REQUIREMENTS):
        _promised(plant, certificate)
        return
    need(verdict.status == "verified", f"not with the producer's witnesses: {verdict.obligation}")


def _promised(plant: Plant, certificate: Json) -> None:
    """The claimed requirements against the bounds of ``certify.statement`` and the observer's poles in floats."""
    certified = certified_gains(certificate)
    if certified is None:
        raise NotConfirmed("the certificate cannot be read")
    certified = replace(
        certified, agents=tuple(replace(agent, requirements=Requirements()) for agent in certified.agents)
    )
    envelope = coordinator_envelope(plant, certified)
    found = (
        envelope
        if isinstance(envelope, str)
        else proved_bounds(plant, derive(plant, COST_VARIABLE), certified, envelope)
    )
    if isinstance(found, str):
        raise NotConfirmed(found)
    for agent, bounds in zip(certified.agents, found.agents, strict=True):
        asked, name = plant.requirements_of(agent.id), f"agent {agent.id}"
        if asked.settling is not None:
            need(bounds.error.settled(asked.settling.band) <= asked.settling.time, f"{name}: settling")
        need(asked.input is None or bounds.input.peak <= asked.input, f"{name}: input")
        if asked.bandwidth is not None and agent.h is not None:
            poles = np.roots([1.0, *map(float, reversed(agent.observer))])
            need(float(agent.h) * max(abs(poles)) <= float(asked.bandwidth) * (1 + 1e-9), f"{name}: bandwidth")


def _designed(agent: Agent, entry: Json) -> Agent:
    """The agent with the design polynomials and the internal model of the claim."""
    agent = _claimed(agent, entry)
    return replace(agent, internal_model=_model(entry)) if entry["N"] else agent


def _model(entry: Json) -> InternalModelChoice:
    return InternalModelChoice(_rows(entry["M"]), _row(entry["N"]))


GAINS = ("g", "K", "delta", "h")
REQUIREMENTS = ("settling", "input", "bandwidth")
ROUTES = {"recipe": prove_recipe, "direct": prove_direct}
