"""The small linear programs of the majorants against a solver for all kinds of programs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from certify.tube import covering
from certify.tube.covering import FEASIBLE, LARGEST_GAP, least_cover
from tests.tubes import Array


def exponentials(seed: int, cells: int = 240, count: int = 14) -> tuple[Array, Array]:
    """What bounding a sum of random damped oscillations by exponentials of either sign leads to."""
    generator = np.random.default_rng(seed)
    times = np.append(0.0, np.geomspace(1e-3, 40.0, cells))
    rates = np.geomspace(0.5, 60.0, count)
    decay, turns = generator.uniform(0.7, 50.0, 6), generator.uniform(0, 30.0, 6)
    bound = np.abs(generator.normal(size=6) @ (np.exp(-np.outer(decay, times)) * np.cos(np.outer(turns, times))))
    need = np.maximum(np.maximum(bound[1:], bound[:-1]), 1e-6 * np.exp(-rates[0] * times[1:]))[:, None]
    first, last = np.exp(-np.outer(times[:-1], rates)), np.exp(-np.outer(times[1:], rates))
    price = 1 / rates
    return np.hstack([last, -first]) / need, np.concatenate([price, 1e-6 * price[0] - price])


@pytest.mark.parametrize("seed", range(12))
def test_covers_are_feasible_and_as_cheap_as_a_general_solver_finds(seed: int) -> None:
    A, prices = exponentials(seed)
    x = least_cover(A, prices)
    assert x is not None and np.all(x >= -FEASIBLE) and np.all(A @ x >= 1 - FEASIBLE)
    other = linprog(prices, A_ub=-A, b_ub=-np.ones(len(A)), method="highs")
    assert other.x is not None
    assert prices @ x <= (prices @ other.x) * (1 + 2 * LARGEST_GAP)


@pytest.mark.parametrize("seed", range(12))
def test_random_covers_are_least(seed: int) -> None:
    """Dense programs without any structure, of which every row may matter."""
    generator = np.random.default_rng(seed)
    A, prices = generator.uniform(0.01, 1.0, (60, 8)), generator.uniform(0.5, 2.0, 8)
    x = least_cover(A, prices)
    other = linprog(prices, A_ub=-A, b_ub=-np.ones(60), method="highs")
    assert x is not None and np.all(A @ x >= 1 - FEASIBLE)
    assert prices @ x == pytest.approx(other.fun, rel=1e-6)


def test_a_program_without_a_least_cover_has_none() -> None:
    assert least_cover(np.array([[1.0, 1.0], [2.0, 0.5]]), np.array([1.0, -1.0])) is None


def test_what_takes_too_long_or_is_not_optimal_is_not_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    A, prices = exponentials(0)
    with monkeypatch.context() as patched:
        patched.setattr(covering, "MOST_PIVOTS", 5)
        assert least_cover(A, prices) is None
    with monkeypatch.context() as patched:
        patched.setattr(covering, "ROUNDS", 1)
        assert least_cover(A, prices) is None
    with monkeypatch.context() as patched:
        patched.setattr(covering, "OPTIMAL", 0.1)  # stops far too early, and the dual solution tells
        assert least_cover(A, prices) is None
    assert least_cover(A, prices) is not None
