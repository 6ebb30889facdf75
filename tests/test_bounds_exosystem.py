"""The exosystem's box holds its trajectories for all time; what may grow has no box."""

from __future__ import annotations

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
import scipy.linalg
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from certify.bounds.exosystem import ExosystemBounds, exosystem_bounds
from certify.inequalities.exact_psd import PositiveDefinite, prove_positive_definite
from certify.inequalities.invariant import invariant_forms, invariant_quadratic
from certify.inequalities.lyapunov import Inconclusive
from certify.inequalities.matrices import inverse, lyapunov_form, matrix, multiply, quadratic_form, scale
from symbolic.plant import Exosystem, Interval, symbol


def exosystem(S: list[list[object]], *initial: object) -> Exosystem:
    sides = [side if isinstance(side, tuple) else (side, side) for side in initial]
    states = tuple(symbol(f"v{k + 1}") for k in range(len(sides)))
    box = tuple(Interval(Fraction(str(lo)), Fraction(str(hi))) for lo, hi in sides)
    return Exosystem(states, sympy.ImmutableMatrix(len(sides), len(sides), [x for row in S for x in row]), box)


def reached(system: Exosystem) -> np.ndarray:
    """The largest ``|v_k(t)|`` seen from the corners of ``V0``."""
    S = np.array(system.S.evalf(), dtype=float)
    corners = [np.array(c, dtype=float) for c in product(*((float(i.lo), float(i.hi)) for i in system.initial))]
    step, largest = scipy.linalg.expm(S * 0.0137), np.zeros(len(S))
    current = np.array(corners).T
    for _ in range(8000):
        largest = np.maximum(largest, np.max(np.abs(current), axis=1))
        current = step @ current
    return largest


def sizes(box: tuple[Interval, ...]) -> np.ndarray:
    return np.array([float(interval.magnitude) for interval in box])


def assert_bounds(system: Exosystem, slack: float) -> None:
    bounds = exosystem_bounds(system)
    assert isinstance(bounds, ExosystemBounds)
    largest = reached(system)
    assert np.all(sizes(bounds.sharp) >= largest - 1e-9)
    assert np.all(sizes(bounds.sharp) <= slack * largest + 1e-6)
    assert np.all(sizes(bounds.box) >= sizes(bounds.sharp))
    assert np.all(sizes(bounds.box) <= 3 * slack * np.max(largest) + 1e-6)
    if bounds.Q is not None:
        Q, widths = sympy.Matrix(bounds.Q), inverse(bounds.Q)
        assert sympy.simplify(system.S.T * Q + Q * system.S) == sympy.zeros(*Q.shape)
        assert isinstance(prove_positive_definite(bounds.Q), PositiveDefinite)
        corners = product(*((side.lo, side.hi) for side in system.initial))
        level = max(quadratic_form(bounds.Q, corner) for corner in corners)
        assert all(side.hi**2 >= widths[k][k] * level for k, side in enumerate(bounds.box))


def test_the_example_stays_in_the_unit_box_exactly() -> None:
    theta = sympy.Rational(4, 5)
    bounds = exosystem_bounds(exosystem([[0, theta], [-theta, 0]], 0, 1))
    assert isinstance(bounds, ExosystemBounds)
    assert bounds.box == bounds.sharp == (Interval(Fraction(-1), Fraction(1)),) * 2


def test_no_exosystem_has_no_bounds() -> None:
    assert exosystem_bounds(Exosystem((), sympy.ImmutableMatrix(0, 0, []), ())) == ExosystemBounds((), (), ())


def test_constant_and_resting_states_keep_their_interval() -> None:
    system = exosystem([[0, 0, 0], [0, 0, 2], [0, -1, 0]], ("-1/3", 5), 0, 0)
    zero = Interval(Fraction(0), Fraction(0))
    bounds = exosystem_bounds(system)
    assert isinstance(bounds, ExosystemBounds)
    assert bounds.sharp == (Interval(Fraction(-1, 3), Fraction(5)), zero, zero)
    assert Fraction(5) <= bounds.box[0].hi <= Fraction(51, 10)
    assert all(side.hi < Fraction(1, 2) for side in bounds.box[1:])


@pytest.mark.parametrize(
    ("S", "initial", "slack"),
    [
        ([[0, 3], [-1, 0]], ((-1, 1), (0, 2)), 1.001),
        ([[1, 2], [-1, -1]], (1, (-1, "1/2")), 1.001),
        ([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 2], [0, 0, -2, 0]], (1, 0, (0, 1), 3), 1.001),
        ([[0, 1, 0, 0], [-2, 0, 1, 0], [0, 0, 0, 1], [1, 0, -2, 0]], (1, 0, 0, 0), 1.5),
        ([[0, 1, 1], [-1, 0, 0], [-1, 0, 0]], (1, (0, 1), -1), 1.5),
        ([[0, sympy.sqrt(2)], [-sympy.sqrt(2), 0]], (1, (-1, 1)), 1.001),
        ([[0, sympy.sqrt(2)], [-sympy.sqrt(3), 0]], (1, (-1, 1)), 1.001),
        ([[0, -sympy.exp(1)], [sympy.sqrt(3), 0]], (1, (-1, 1)), 1.001),
        ([[0, sympy.sqrt(2), 0, 0], [-sympy.sqrt(2), 0, 0, 0], [0, 0, 0, 1], [0, 0, -4, 0]], (1, 0, 2, 0), 1.001),
        ([[0, sympy.sqrt(2), 0], [-sympy.sqrt(3), 0, 0], [0, 0, 0]], (1, (-1, 1), 7), 1.001),
        ([[0, sympy.pi, 0], [-sympy.pi, 0, sympy.pi / 2], [0, -sympy.pi / 2, 0]], (1, 0, 1), 1.5),
    ],
)
def test_trajectories_stay_in_the_box_and_come_near_it(
    S: list[list[object]], initial: tuple[object, ...], slack: float
) -> None:
    assert_bounds(exosystem(S, *initial), slack)


@settings(max_examples=12, deadline=None)
@given(st.integers(2, 4), st.integers(0, 10**6))
def test_disguised_rotations_are_bounded(n: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    skew = random.integers(-3, 4, (n, n))
    change = matrix(
        [[int(x) for x in row] for row in np.tril(random.integers(-1, 2, (n, n)), -1) + np.eye(n, dtype=int)]
    )
    S = multiply(change, matrix([[int(x) for x in row] for row in skew - skew.T]), inverse(change))
    initial = [(int(a), int(a + b)) for a, b in zip(random.integers(-2, 2, n), random.integers(0, 2, n), strict=True)]
    rows = [[sympy.Rational(x.numerator, x.denominator) for x in row] for row in S]
    assert_bounds(exosystem(rows, *initial), 50)
    if any(any(row) for row in S):
        Q = invariant_quadratic(S)
        assert Q is not None
        assert isinstance(prove_positive_definite(Q), PositiveDefinite)
        assert lyapunov_form(S, Q) == scale(0, S)


@pytest.mark.parametrize(
    "S",
    [
        [[0, 1], [0, 0]],
        [[0, 1], [-1, sympy.Rational(1, 10**18)]],
        [[0, 1], [-1, -1]],
        [[0, 1], [1, 0]],
        [[0, sympy.sqrt(2)], [sympy.sqrt(3), 0]],
        [[0, sympy.sqrt(2)], [0, 0]],
        [[0, 1, 1, 0], [-1, 0, 0, 1], [0, 0, 0, 1], [0, 0, -1, 0]],
    ],
)
def test_growth_decay_and_jordan_blocks_have_no_invariant_form(S: list[list[object]]) -> None:
    refused = exosystem_bounds(exosystem(S, *[1] * len(S)))
    assert isinstance(refused, Inconclusive)
    assert "v1, v2" in refused.reason


def test_an_exosystem_with_many_states_is_inconclusive() -> None:
    refused = exosystem_bounds(exosystem([[0] * 13] * 13, *[1] * 13))
    assert isinstance(refused, Inconclusive) and "13 states" in refused.reason


def test_other_irrational_matrices_are_inconclusive_with_the_reason() -> None:
    root = sympy.sqrt(2)
    refused = exosystem_bounds(exosystem([[0, 1, 0], [-1, 0, root], [0, -root, 0]], 1, 1, 1))
    assert isinstance(refused, Inconclusive)
    assert "irrational" in refused.reason


def test_the_space_of_invariant_forms_is_exact() -> None:
    S = matrix([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 2], [0, 0, -2, 0]])
    forms = invariant_forms(S)
    assert len(forms) == 2
    assert all(lyapunov_form(S, form) == scale(0, S) for form in forms)
    assert invariant_forms(matrix([[-1]])) == []
    assert invariant_quadratic(matrix([[-1]])) is None
    with pytest.raises(ValueError, match="square"):
        invariant_quadratic(matrix([[0, 1]]))
