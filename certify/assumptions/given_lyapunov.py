"""A Lyapunov function for the zero dynamics that was given: proved by exact means, or refused with a point (A6)."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import sympy

from certify.assumptions.decay_by_squares import Cases, cases, forms, largest_decay
from certify.assumptions.findings import Json, point_text
from certify.assumptions.quadratic_lyapunov import Refutation, decay
from certify.assumptions.zero_jacobian import Unbounded, jacobian_polytope, not_smooth
from certify.assumptions.zero_samples import ZeroDynamics, nonnegative_at, settings
from certify.inequalities.exact_psd import PositiveDefinite, prove_positive_definite
from certify.inequalities.matrices import Matrix, matrix
from symbolic.errors import InputError
from symbolic.identity import zero_test


@dataclass(frozen=True)
class Accepted:
    """``V0 ≥ κ‖z̄‖²`` and ``V̇0 ≤ −a0‖z̄‖²`` for all ``z̄``, proved; ``P`` is set when ``V0 = z̄ᵀ P z̄``."""

    V0: sympy.Expr
    a0: Fraction
    P: Matrix | None
    method: str


@dataclass(frozen=True)
class Refused:
    """``fails`` with a point where the inequality breaks, or ``unknown`` with what was tried."""

    verdict: str
    reason: str
    evidence: dict[str, Json] = field(default_factory=dict, hash=False)


def judge(V0: sympy.Expr, dynamics: ZeroDynamics) -> Accepted | Refused:
    """Prove or refuse ``V0``, an expression in the zero states (which stand for ``z̄``).

    Needed: ``V0(0) = 0``, positive definite and radially unbounded (``V0 ≥ κ‖z̄‖²``; theory.md section 7, F11), and
    ``∂V0/∂z̄ · f̄0 ≤ −a0‖z̄‖²`` for all ``z̄``, ``y^r``, ``v`` and ``w ∈ W``. Raises InputError for foreign names.
    """
    states = dynamics.agent.zero_states
    foreign = sorted(map(str, V0.free_symbols - set(states)))
    if foreign:
        raise InputError(
            f"agent {dynamics.agent.id}: zero_dynamics_lyapunov: {', '.join(foreign)} may not appear in V0"
        )
    derivative = sympy.expand(sum(V0.diff(name) * rate for name, rate in zip(states, dynamics.rates, strict=True)))
    refused = _refuted(V0, derivative, dynamics)
    if refused is not None:
        return refused
    obstacle = not_smooth(dynamics.agent, dynamics.exosystem)
    if obstacle is not None:
        return Refused("unknown", obstacle.reason)
    if not V0.is_polynomial(*states) or not _rational(V0, states):
        return Refused("unknown", "only polynomials with rational coefficients can be proved to be Lyapunov functions")
    P = _quadratic(V0, states)
    if P is not None:
        found = _judge_quadratic(V0, P, dynamics)
        if isinstance(found, Accepted) or found.verdict == "fails":
            return found
    return _by_sums_of_squares(V0, derivative, dynamics, P)


def _refuted(V0: sympy.Expr, derivative: sympy.Expr, dynamics: ZeroDynamics) -> Refused | None:
    """Necessary conditions tried at exact points: signs away from the origin, the quadratic terms at the origin."""
    origin = dict.fromkeys(dynamics.agent.zero_states, sympy.Integer(0))
    if zero_test(V0.xreplace(origin)).verdict == "fails":
        return Refused("fails", f"V0(0) = {V0.xreplace(origin)} is not 0")
    low = nonnegative_at(dynamics, -V0)
    if low is not None:
        return Refused(
            "fails", f"V0 is not positive definite: V0 = {V0.xreplace(low)}{_at(low)}", {"at": point_text(low)}
        )
    rising = nonnegative_at(dynamics, derivative)
    if rising is not None:
        value = derivative.xreplace(rising)
        return Refused(
            "fails", f"V0 does not decrease: its derivative is {value}{_at(rising)}", {"at": point_text(rising)}
        )
    hessian = sympy.hessian(derivative, dynamics.agent.zero_states).xreplace(origin)
    for setting in settings(dynamics, list(hessian)):
        values = hessian.xreplace(setting)
        if not all(isinstance(entry, sympy.Rational) for entry in values):
            continue
        verdict = prove_positive_definite(matrix((-values).tolist()))
        if not isinstance(verdict, PositiveDefinite):
            direction = [str(entry) for entry in verdict.witness]
            return Refused(
                "fails",
                "V0 does not decrease like −a0‖z̄‖² near 0: its derivative has no negative definite quadratic part",
                {
                    "direction": direction,
                    "at": point_text({k: v for k, v in setting.items() if k in hessian.free_symbols}),
                },
            )
    return None


def _at(point: dict[sympy.Symbol, sympy.Rational]) -> str:
    return f" at {', '.join(f'{name} = {value}' for name, value in point.items())}"


def _rational(expression: sympy.Expr, gens: tuple[sympy.Symbol, ...]) -> bool:
    domain = sympy.Poly(expression, *gens).domain
    return bool(domain.is_ZZ or domain.is_QQ)


def _quadratic(V0: sympy.Expr, states: tuple[sympy.Symbol, ...]) -> Matrix | None:
    """``P`` with ``V0 = z̄ᵀ P z̄``; None when ``V0`` is no quadratic form."""
    if any(sum(m) != 2 for m in sympy.Poly(V0, *states).monoms()):
        return None
    return matrix((sympy.hessian(V0, states) / 2).tolist())


def _judge_quadratic(V0: sympy.Expr, P: Matrix, dynamics: ZeroDynamics) -> Accepted | Refused:
    verdict = prove_positive_definite(P)
    if not isinstance(verdict, PositiveDefinite):
        witness = [str(entry) for entry in verdict.witness]
        return Refused("fails", f"V0 is not positive definite: V0 = {verdict.value} at z̄ = {witness}", {"at": witness})
    polytope = jacobian_polytope(dynamics.agent, dynamics.exosystem)
    if isinstance(polytope, Unbounded):
        return Refused("unknown", polytope.reason)
    found = decay(P, [vertex.A for vertex in polytope.vertices])
    if isinstance(found, Refutation):
        vertex = polytope.vertices[found.index]
        if vertex.at is None:
            return Refused("unknown", "the inequality fails at a bound of ∂f0/∂z that may not be taken")
        direction = [str(entry) for entry in found.witness]
        reason = f"V0 does not decrease along z̄ = [{', '.join(direction)}]{_at(dict(vertex.at)) if vertex.at else ''}"
        return Refused("fails", reason, {"direction": direction, "at": point_text(dict(vertex.at))})
    return Accepted(V0, found, P, "exact inequality at the vertices of ∂f0/∂z")


def _by_sums_of_squares(
    V0: sympy.Expr, derivative: sympy.Expr, dynamics: ZeroDynamics, P: Matrix | None
) -> Accepted | Refused:
    states = dynamics.agent.zero_states
    kappa = largest_decay(Cases((sympy.Poly(V0, *states),)), states)
    if kappa is None:
        return Refused("unknown", "V0 ≥ κ‖z̄‖² with κ > 0 was not proved by a sum of squares")
    tried = []
    for label, candidate in forms(derivative, dynamics):
        found = cases(candidate, dynamics)
        if isinstance(found, str):
            tried.append(f"{label}: {found}")
            continue
        a0 = largest_decay(found, states)
        if a0 is not None:
            return Accepted(V0, a0, P, f"sum of squares, {label}; V0 ≥ {kappa}‖z̄‖²")
        tried.append(f"{label}: no sum of squares was proved")
    return Refused("unknown", f"the decay of V0 was not proved ({'; '.join(tried)})", {"tried": tried})
