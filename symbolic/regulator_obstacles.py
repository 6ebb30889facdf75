"""Proofs that the regulator equation has no smooth solution: resonance, poles on the parameter box."""

from __future__ import annotations

from collections.abc import Mapping

import sympy

from symbolic.exact_field import field_of
from symbolic.identity import Box, excerpt, printed, sample_points
from symbolic.plant import COST_VARIABLE
from symbolic.ranges import nonvanishing
from symbolic.steady_state import NoSteadyState
from symbolic.steady_state_series import Inconsistent, RegulatorProblem, Solved

Point = Mapping[sympy.Symbol, sympy.Rational]


def resonance(problem: RegulatorProblem, stuck: Inconsistent, box: Box) -> NoSteadyState:
    """``fails`` with a rational point of the box at which the unsolvable linear system consists of numbers."""
    proof = _refuted_at(problem, list(sample_points(problem.coefficient_symbols, box)))
    if proof is not None:
        return proof
    equation = str(problem.z[stuck.component])
    return NoSteadyState(
        "unknown",
        f"{_terms(stuck)} of the equation of {equation} could not be matched",
        {"monomial": str(stuck.monomial), "equation": equation},
    )


def pole(problem: RegulatorProblem, solved: Solved, box: Box) -> NoSteadyState | None:
    """``None`` if no coefficient of z* has a pole for w in the box and any s.

    A coefficient that the equation determines, and whose denominator changes its sign on the box, is unbounded near
    some zero of that denominator, because numerator and denominator are coprime: then no continuous z* exists. At
    a rational zero the system is solved again with numbers.
    """
    expanded_in_s = COST_VARIABLE in problem.variables
    line: Box = box if expanded_in_s else {**box, COST_VARIABLE: None}
    for coefficient in solved.coefficients:
        denominator = sympy.fraction(sympy.together(coefficient))[1]
        answer = nonvanishing(denominator, line)
        if answer.verdict == "holds":
            continue
        certain = answer.verdict == "fails"
        what = "has a pole" if certain else "may have a pole"
        reason = f"the coefficient {excerpt(coefficient)} of z* {what}: {answer.reason}"
        points = {f"point {k}": _shown(at) for k, at in enumerate(answer.at, 1)}
        evidence = {"denominator": excerpt(denominator), **points}
        if certain and len(answer.at) == 2 and solved.unique and not field_of([coefficient]).kernels:
            return NoSteadyState("fails", reason, evidence)
        if certain and len(answer.at) == 1:
            zero = answer.at[0]
            zeros = [
                {name: sympy.Rational(zero.get(str(name), value)) for name, value in other.items()}
                for other in sample_points(problem.coefficient_symbols, box)
            ]
            proof = _refuted_at(problem, zeros)
            if proof is not None:
                return proof
        return NoSteadyState("unknown", reason, evidence)
    return None


def _refuted_at(problem: RegulatorProblem, points: list[dict[sympy.Symbol, sympy.Rational]]) -> NoSteadyState | None:
    for point in points:
        stuck = problem.at(point).solve()
        if isinstance(stuck, Inconsistent) and stuck.proved:
            equation, where = str(problem.z[stuck.component]), printed(point)
            at = f" at {_shown(where)}" if where else ""
            driven = set(stuck.monomial.free_symbols) - {COST_VARIABLE}
            if not driven and COST_VARIABLE in problem.variables:
                missing = _without_equilibrium(problem.at(point))
                if missing is not None:
                    reason = f"{equation} has no equilibrium at s = {missing}{at.replace(' at ', ', ')}"
                    return NoSteadyState("fails", reason, {"equation": equation, "s": str(missing), **where})
                return _not_smooth_at_zero(stuck, equation, at, where)
            why = "resonate with the exosystem" if driven else "have no equilibrium there"
            return NoSteadyState(
                "fails",
                f"{_terms(stuck)} of the equation of {equation} cannot be matched{at}: the zero dynamics {why}",
                {"monomial": str(stuck.monomial), "equation": equation, "degree": str(stuck.degree), **where},
            )
    return None


def _without_equilibrium(problem: RegulatorProblem) -> int | None:
    """A value of ``s`` at which a scalar polynomial ``f0(z, s, 0)`` with numbers has no real zero."""
    if len(problem.z) > 1:
        return None
    for s in (1, -1):
        f0 = problem.f0[0].xreplace(dict.fromkeys(problem.v, sympy.S.Zero) | {COST_VARIABLE: sympy.Integer(s)})
        if not f0.free_symbols:
            return s if f0.is_nonzero else None
        if not f0.is_polynomial(*problem.z):
            return None
        polynomial = sympy.Poly(f0, *problem.z)
        if (polynomial.domain.is_ZZ or polynomial.domain.is_QQ) and polynomial.count_roots() == 0:
            return s
    return None


def _not_smooth_at_zero(stuck: Inconsistent, equation: str, at: str, where: Mapping[str, str]) -> NoSteadyState:
    """No power series in ``s`` solves it, which ``s^(1/3)`` may well do."""
    return NoSteadyState(
        "unknown",
        f"{_terms(stuck)} of the equation of {equation} cannot be matched{at}: an equilibrium there may be, but none "
        "that is smooth at 0",
        {"monomial": str(stuck.monomial), "equation": equation, "degree": str(stuck.degree), **where},
    )


def _terms(stuck: Inconsistent) -> str:
    return f"the terms in {stuck.monomial}" if stuck.degree else "the terms without v"


def _shown(point: Mapping[str, str]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in point.items())
