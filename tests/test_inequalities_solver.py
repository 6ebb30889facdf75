"""Every status the solver can report is faked once; none of them becomes more than a hint."""

from __future__ import annotations

from types import SimpleNamespace

import clarabel
import cvxpy
import numpy as np
import pytest

from certify.inequalities.semidefinite import FAILED, INACCURATE, INFEASIBLE, SOLVED, solve


def problem() -> cvxpy.Problem:
    P = cvxpy.Variable((2, 2), symmetric=True)
    return cvxpy.Problem(cvxpy.Minimize(cvxpy.trace(P)), [np.eye(2) << P])


GRADES = {
    "Solved": SOLVED,
    "AlmostSolved": INACCURATE,
    "PrimalInfeasible": INFEASIBLE,
    "AlmostPrimalInfeasible": INFEASIBLE,
    "DualInfeasible": FAILED,
    "AlmostDualInfeasible": FAILED,
    "MaxIterations": FAILED,
    "MaxTime": FAILED,
    "NumericalError": FAILED,
    "InsufficientProgress": FAILED,
    "CallbackTerminated": FAILED,
    "Unsolved": FAILED,
}


def fake(monkeypatch: pytest.MonkeyPatch, **changes: object) -> list[str]:
    """Let Clarabel solve, then change its answer; returns a list that grows with every call."""
    real, calls = clarabel.DefaultSolver, []

    class Fake:
        def __init__(self, *arguments: object) -> None:
            self.solver = real(*arguments)

        def solve(self) -> SimpleNamespace:
            calls.append("clarabel")
            truth = self.solver.solve()
            fields = {
                name: getattr(truth, name) for name in ("status", "x", "z", "obj_val", "solve_time", "iterations")
            }
            return SimpleNamespace(**{**fields, **changes})

    monkeypatch.setattr(clarabel, "DefaultSolver", Fake)
    return calls


def test_the_table_of_statuses_is_complete() -> None:
    known = {name for name in dir(clarabel.SolverStatus) if not name.startswith("_")}
    assert known == set(GRADES)


@pytest.mark.parametrize(("status", "grade"), GRADES.items())
def test_every_status_of_clarabel_is_graded(monkeypatch: pytest.MonkeyPatch, status: str, grade: str) -> None:
    calls = fake(monkeypatch, status=status)
    outcome = solve(problem())
    assert outcome.grade == grade
    assert outcome.has_values == (grade in (SOLVED, INACCURATE))
    assert calls == ["clarabel"], "no other attempt behind the caller's back"


@pytest.mark.parametrize(
    ("status", "grade"),
    [
        (cvxpy.OPTIMAL, SOLVED),
        (cvxpy.OPTIMAL_INACCURATE, INACCURATE),
        (cvxpy.INFEASIBLE, INFEASIBLE),
        (cvxpy.INFEASIBLE_INACCURATE, INFEASIBLE),
        (cvxpy.UNBOUNDED, FAILED),
        (cvxpy.UNBOUNDED_INACCURATE, FAILED),
        (cvxpy.settings.INFEASIBLE_OR_UNBOUNDED, FAILED),
        (cvxpy.USER_LIMIT, FAILED),
        (cvxpy.SOLVER_ERROR, FAILED),
        ("a status of the future", FAILED),
        (None, FAILED),
    ],
)
def test_every_status_of_cvxpy_is_graded(monkeypatch: pytest.MonkeyPatch, status: str | None, grade: str) -> None:
    solved = problem()
    solved.solve(solver=cvxpy.CLARABEL)

    def pretend(self: cvxpy.Problem, **_: object) -> None:
        self._status = status

    monkeypatch.setattr(cvxpy.Problem, "solve", pretend)
    outcome = solve(solved)
    assert (outcome.grade, outcome.status) == (grade, str(status))
    if status is not None and grade != SOLVED:
        assert status.replace("_", " ") in outcome.reason


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_a_failure(monkeypatch: pytest.MonkeyPatch, value: float) -> None:
    fake(monkeypatch, x=np.full(3, value))
    outcome = solve(problem())
    assert outcome.grade == FAILED
    assert "without finite values" in outcome.reason


def test_missing_values_are_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def pretend(self: cvxpy.Problem, **_: object) -> None:
        self._status = cvxpy.OPTIMAL

    monkeypatch.setattr(cvxpy.Problem, "solve", pretend)
    outcome = solve(problem())
    assert outcome.grade == FAILED
    assert "without finite values" in outcome.reason


def test_an_exception_of_the_solver_is_a_failure_with_its_first_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def explode(self: cvxpy.Problem, **_: object) -> None:
        raise cvxpy.error.SolverError("numbers on fire\nand a stack of details")

    monkeypatch.setattr(cvxpy.Problem, "solve", explode)
    outcome = solve(problem())
    assert outcome.grade == FAILED
    assert outcome.reason == "the solver gave up: numbers on fire"


def test_data_that_are_not_finite_are_not_sent_to_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = fake(monkeypatch)
    P = cvxpy.Variable((2, 2), symmetric=True)
    outcome = solve(cvxpy.Problem(cvxpy.Minimize(cvxpy.trace(P)), [np.full((2, 2), np.nan) << P]))
    assert outcome.grade == FAILED and "not finite" in outcome.reason
    assert calls == []


def test_a_limit_on_the_iterations_is_a_failure_for_real() -> None:
    outcome = solve(problem(), max_iter=1)
    assert outcome.grade == FAILED
    assert "user limit" in outcome.reason


def test_a_problem_without_solution_is_infeasible_for_real() -> None:
    P = cvxpy.Variable((2, 2), symmetric=True)
    outcome = solve(cvxpy.Problem(cvxpy.Minimize(0), [P << -np.eye(2), P >> np.eye(2)]))
    assert outcome.grade == INFEASIBLE


def test_a_problem_that_is_not_convex_is_the_callers_mistake() -> None:
    x = cvxpy.Variable()
    with pytest.raises(cvxpy.error.DCPError):
        solve(cvxpy.Problem(cvxpy.Maximize(x**2)))
