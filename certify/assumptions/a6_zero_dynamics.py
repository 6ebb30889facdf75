"""A6: a ``V0`` with ``∂V0/∂z̄ · f̄0(z̄, 0, y^r, v, w) ≤ −a0‖z̄‖²`` (paper, Assumption 6; theory.md section 7, F1, F11)."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import sympy

from certify.assumptions.findings import Finding, Json, point_text, unless_holds
from certify.assumptions.given_lyapunov import Accepted, Refused, judge
from certify.assumptions.quadratic_lyapunov import QuadraticProof, common_lyapunov, not_hurwitz, solved_lyapunov
from certify.assumptions.zero_jacobian import (
    Polytope,
    corners,
    entry_range,
    is_affine,
    jacobian,
    jacobian_polytope,
    not_smooth,
)
from certify.assumptions.zero_samples import ZeroDynamics, nonnegative_at, settings, zero_dynamics
from certify.bounds.intervals import simplest_between
from certify.inequalities.matrices import Matrix, add, identity, matrix, scale
from symbolic.constants import as_rational
from symbolic.hurwitz import HurwitzTest
from symbolic.plant import Agent, Exosystem
from symbolic.point_parameters import without_point_parameters
from symbolic.steady_state import SteadyState

_SLACK = Fraction(1, 1000)
_CLEARLY_UNSTABLE = Fraction(1, 10**9)
_F1 = (
    "no gain reduces the drive f̂0(y^r) for n_z ≥ 2 with a V0 that is not quadratic (theory.md, F1): A6⁺ is not implied"
)


def check_zero_dynamics(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState | None, s_star: Fraction | None
) -> Finding:
    """Decide A6 for one agent. Evidence: ``V0``, ``P`` with ``V0 = z̄ᵀPz̄`` or null, ``a0``, and which A6⁺ holds.

    ``steady_state`` and ``s_star`` (the exact optimum) are only needed where ``f0`` is not affine in ``z``.
    """
    found = prove_zero_dynamics(agent, exosystem, steady_state, s_star)
    if found is None:
        return Finding("A6", agent.id, "holds", "there are no zero dynamics", {"a6_plus": "i"})
    if isinstance(found, Refused):
        return Finding("A6", agent.id, unless_holds(found.verdict), found.reason, found.evidence)
    evidence: dict[str, Json] = {
        "V0": str(found.V0),
        "P": None if found.P is None else [[str(entry) for entry in row] for row in found.P],
        "a0": str(found.a0),
        "a6_plus": None if found.P is None else "i",
        "method": found.method,
    }
    if found.P is None and len(agent.zero_states) > 1:
        evidence["note"] = _F1
    return Finding(
        "A6", agent.id, "holds", "V0 is positive definite, proper, and decays along the zero dynamics", evidence
    )


def prove_zero_dynamics(
    agent: Agent, exosystem: Exosystem, steady_state: SteadyState | None, s_star: Fraction | None
) -> Accepted | Refused | None:
    """The proof behind A6: the given ``V0`` judged, else a quadratic one found; None without zero dynamics."""
    if not agent.zero_states:
        return None
    agent = without_point_parameters(agent)
    dynamics = zero_dynamics(agent, exosystem, steady_state, s_star)
    found = judge(agent.lyapunov, dynamics) if agent.lyapunov is not None else _found(dynamics)
    return found if isinstance(found, Accepted) else _unstable(dynamics) or found


def _found(dynamics: ZeroDynamics) -> Accepted | Refused:
    """A quadratic ``V0``: by the vertices of ``∂f0/∂z``, by its slope, or from the linearisation at the origin."""
    polytope = jacobian_polytope(dynamics.agent, dynamics.exosystem)
    if isinstance(polytope, Polytope):
        return _over_vertices(dynamics, polytope)
    found = _scalar_slope(dynamics) or _guessed(dynamics)
    return found or Refused("unknown", f"{polytope.reason}; give zero_dynamics_lyapunov")


def _over_vertices(dynamics: ZeroDynamics, polytope: Polytope) -> Accepted | Refused:
    matrices = [vertex.A for vertex in polytope.vertices]
    proof = common_lyapunov(matrices)
    if proof is None:
        for vertex in polytope.vertices:
            test = not_hurwitz(vertex.A)
            if test is not None and vertex.at is not None:
                return _unstable_at(dict(vertex.at), vertex.A, test)
            if test is not None:
                return Refused(
                    "unknown", "∂f0/∂z is only known to lie in a box of matrices, not all of which are Hurwitz"
                )
        proof = solved_lyapunov(matrices)
    if proof is None:
        reason = "every corner of W is stable but no common quadratic V0 was proved; give zero_dynamics_lyapunov"
        return Refused(
            "unknown", reason, {"tried": ["½I", "Lyapunov equation at the mean matrix", "linear matrix inequality"]}
        )
    if polytope.exact:
        return _accepted(dynamics.agent, proof, "exact inequality at the corners of W")
    rounded = QuadraticProof(proof.P, _short_below(proof.a0))
    return _accepted(dynamics.agent, rounded, "exact inequality at the vertices of an enclosure of ∂f0/∂z")


def _accepted(agent: Agent, proof: QuadraticProof, method: str) -> Accepted:
    z = sympy.Matrix(agent.zero_states)
    P = sympy.Matrix([[as_rational(entry) for entry in row] for row in proof.P])
    return Accepted(sympy.expand((z.T * P * z)[0]), proof.a0, proof.P, method)


def _short_below(value: Fraction) -> Fraction:
    """A short rational a little below a positive bound that is not exact anyway."""
    return simplest_between(value * (1 - _SLACK), value)


def _scalar_slope(dynamics: ZeroDynamics) -> Accepted | None:
    """One zero state: ``f̄0 = σ z̄``, ``σ`` a value of ``∂f0/∂z``, so ``V0 = z̄²/2`` decays at ``a0 = −sup ∂f0/∂z``."""
    agent = dynamics.agent
    if len(agent.zero_states) != 1 or not_smooth(agent, dynamics.exosystem) is not None:
        return None
    _, high = entry_range(jacobian(agent)[0], agent, dynamics.exosystem)
    if high is None or high >= 0:
        return None
    return _accepted(
        agent, QuadraticProof(((Fraction(1, 2),),), _short_below(-high)), "upper bound of ∂f0/∂z everywhere"
    )


def _guessed(dynamics: ZeroDynamics) -> Accepted | None:
    """The quadratic function of the linearisation at the origin, tried on the nonlinear polynomial dynamics."""
    agent = dynamics.agent
    J = jacobian(agent)
    rest = dict.fromkeys((*agent.zero_states, agent.chain[0], *dynamics.exosystem.states), sympy.Integer(0))
    linear = J.xreplace(rest)
    points = corners(agent, linear)
    if points is None or not all(side.is_polynomial(*agent.zero_states) for side in agent.zero_dynamics):
        return None
    matrices = [_exact(linear.xreplace(dict(point))) for point in points]
    if any(A is None for A in matrices):
        return None
    proof = common_lyapunov([A for A in matrices if A is not None])
    if proof is None:
        return None
    found = judge(_accepted(agent, proof, "").V0, dynamics)
    return found if isinstance(found, Accepted) else None


def _unstable(dynamics: ZeroDynamics) -> Refused | None:
    """A point of ``W`` (and ``y^r``, ``v``) where no ``V0`` can exist.

    Zero dynamics that are linear must be Hurwitz there; others must not have an eigenvalue with positive real part at
    ``z̄ = 0``, and with one zero state must point towards the origin everywhere.
    """
    agent = dynamics.agent
    at_rest = dict(zip(agent.zero_states, dynamics.base, strict=True))
    J = jacobian(agent).xreplace(at_rest)
    affine = is_affine(agent)
    for setting in settings(dynamics, list(J)):
        A = _exact(J.xreplace(setting))
        if A is None:
            continue
        test = not_hurwitz(A if affine else add(A, scale(-_CLEARLY_UNSTABLE, identity(len(A)))))
        if test is not None:
            return _unstable_at({name: value for name, value in setting.items() if name in J.free_symbols}, A, test)
    if len(agent.zero_states) == 1 and not affine:
        outward = nonnegative_at(dynamics, agent.zero_states[0] * dynamics.rates[0])
        if outward is not None:
            return Refused(
                "fails", "the zero dynamics do not point towards the steady state", {"at": point_text(outward)}
            )
    return None


def _unstable_at(point: Mapping[sympy.Symbol, sympy.Rational], A: Matrix, test: HurwitzTest) -> Refused:
    where = f" at {', '.join(f'{name} = {value}' for name, value in point.items())}" if point else ""
    rows = [[str(entry) for entry in row] for row in A]
    reason = f"the zero dynamics are not stable{where}: {test.reason}"
    return Refused("fails", reason, {"at": point_text(point), "A": rows})


def _exact(A: sympy.MatrixBase) -> Matrix | None:
    return matrix(A.tolist()) if all(isinstance(entry, sympy.Rational) for entry in A) else None
