"""The one door to the solver: cvxpy with Clarabel, every status graded, no other solver tried.

A grade is a hint and never a proof: Clarabel calls points ``optimal`` that violate the inequality, and calls badly
scaled problems feasible that have no solution (theory.md section 4). What a solution is used for is proved elsewhere.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


if TYPE_CHECKING:
    import cvxpy

SOLVED, INACCURATE, INFEASIBLE, FAILED = "solved", "inaccurate", "infeasible", "failed"


@dataclass(frozen=True)
class Outcome:
    """What the solver claims: ``grade`` is ``solved``, ``inaccurate``, ``infeasible`` or ``failed``.

    Only with ``solved`` and ``inaccurate`` do the variables of the problem hold finite values; ``objective`` is an
    estimate.
    """

    grade: str
    status: str
    reason: str
    objective: float | None = None

    @property
    def has_values(self) -> bool:
        return self.grade in (SOLVED, INACCURATE)


def solve(problem: cvxpy.Problem, **settings: float | bool) -> Outcome:
    """Solve with Clarabel; ``settings`` are its own. Raises only for problems that are not convex (``DCPError``)."""
    import cvxpy

    if not _data_are_finite(problem):
        return Outcome(FAILED, "not tried", "the data of the problem are not finite numbers")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            problem.solve(solver=cvxpy.CLARABEL, **settings)
    except cvxpy.error.SolverError as error:
        return Outcome(FAILED, cvxpy.SOLVER_ERROR, f"the solver gave up: {str(error).splitlines()[0]}")
    status = str(problem.status)
    grade = _grades().get(status)
    if grade is None:
        return Outcome(FAILED, status, f"the solver's status {status} is not known")
    if grade in (INFEASIBLE, FAILED):
        return Outcome(grade, status, f"the solver reports {status.replace('_', ' ')}")
    if not _values_are_finite(problem):
        return Outcome(FAILED, status, f"the solver reports {status.replace('_', ' ')} without finite values")
    return Outcome(grade, status, f"the solver reports {status.replace('_', ' ')}", float(problem.value))


@cache
def _grades() -> dict[str, str]:
    import cvxpy

    return {
        cvxpy.OPTIMAL: SOLVED,
        cvxpy.OPTIMAL_INACCURATE: INACCURATE,
        cvxpy.INFEASIBLE: INFEASIBLE,
        cvxpy.INFEASIBLE_INACCURATE: INFEASIBLE,
        cvxpy.UNBOUNDED: FAILED,
        cvxpy.UNBOUNDED_INACCURATE: FAILED,
        cvxpy.settings.INFEASIBLE_OR_UNBOUNDED: FAILED,
        cvxpy.USER_LIMIT: FAILED,
        cvxpy.SOLVER_ERROR: FAILED,
    }


def _data_are_finite(problem: cvxpy.Problem) -> bool:
    import numpy as np

    values = [item.value for item in (*problem.constants(), *problem.parameters())]
    return all(value is not None and np.all(np.isfinite(_dense(value))) for value in values)


def _dense(value: object) -> np.ndarray:
    import numpy as np

    return np.asarray(value.toarray() if hasattr(value, "toarray") else value, dtype=np.float64)


def _values_are_finite(problem: cvxpy.Problem) -> bool:
    import numpy as np

    values = [variable.value for variable in problem.variables()]
    finite = all(value is not None and np.all(np.isfinite(_dense(value))) for value in values)
    return finite and problem.value is not None and math.isfinite(problem.value)
