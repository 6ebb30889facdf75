"""The direct route's claim: from every start every output stays in the boxes of the tube, and settles at s*.

The long version, 10 000 random and adversarial starts of the five agents, takes some minutes:

    python -m pytest -m slow tests/test_tube.py
"""

from __future__ import annotations

import numpy as np
import pytest

from certify.tube.trial import Trial
from tests.tubes import (
    GAINS,
    QUICK,
    TOLERANCE,
    Array,
    Flight,
    Starts,
    gains_of,
    largest_vartheta,
    leaves_ranges,
    passed,
    reaching_usage,
    trials,
    usage,
)

AFTER = 3.0


def sample_times(trial: Trial) -> Array:
    """Ends and inner points of the steps of both phases, and some of the tail."""
    grid = np.array([*trial.reached.grid, *trial.tube.grid[1:]])
    steps = np.linspace(0, len(grid) - 2, min(len(grid) - 1, 400)).astype(int)
    inner = np.concatenate([grid[steps] + share * np.diff(grid)[steps] for share in (0.0, 0.3, 0.7)])
    return np.unique(np.concatenate([inner, grid[-1] + np.linspace(0, AFTER, 20)]))


def never_outside(flight: Flight, key: tuple[str, int]) -> Array:
    """The shares of all boxes that are used, per start: nothing ever leaves one, and the outputs settle."""
    trial, held = passed(*key), trials(*key)
    used = usage(trial, flight)
    assert used.max() <= 1, f"{key}: {used.max(axis=0)}"
    before = reaching_usage(trial, flight, largest_vartheta(*key))
    assert before.max() <= 1, f"{key}, phase 1: {before.max(axis=0)}"
    assert leaves_ranges(trial, flight, held.initial.ranges) <= TOLERANCE
    vartheta = flight.outputs[:, len(trial.nominal.f1), flight.times >= trial.reached.duration]
    assert float(trial.gains.K) * np.abs(vartheta).max() <= float(trial.delta) * (1 + TOLERANCE)
    late = np.abs(flight.error[:, -1])
    assert late.max() < 0.2 and late.max() < np.abs(flight.error).max()
    return np.hstack([used, before])


@pytest.mark.parametrize(("name", "number"), [*QUICK, ("five_agents", 1), ("five_agents", 4)])
def test_no_output_ever_leaves_its_box(name: str, number: int) -> None:
    trial = passed(name, number)
    starts = Starts(name, number, trial.tube.grid[-1] + AFTER)
    flight = starts.fly(starts.corners_and_inner(20, 12), sample_times(trial))
    used = never_outside(flight, (name, number))
    # and the boxes are about these trajectories, not about anything: the initial x1 is reached to a quarter
    zeros = len(trial.nominal.f0)
    assert used[:, zeros].max() > 0.25


def test_a_tube_for_smaller_starts_does_not_hold_these() -> None:
    """The comparison can fail: boxes half as large are left."""
    trial = passed("rooms", 2)
    starts = Starts("rooms", 2, trial.tube.grid[-1] + AFTER)
    flight = starts.fly(starts.corners_and_inner(20, 0), sample_times(trial))
    assert (2 * usage(trial, flight)).max() > 1


@pytest.mark.parametrize(("name", "number"), QUICK)
def test_boxes_shrink_to_a_tail_that_keeps_the_saturation_inactive(name: str, number: int) -> None:
    trial = passed(name, number)
    plant = len(trial.nominal.f1)
    for box in (*trial.tube.boxes, trial.tube.tail):
        assert np.all(np.isfinite(box)) and np.all(box > 0)
        assert float(trial.gains.K) * box[plant] <= float(trial.delta)
    assert trial.tube.tail[plant] < 0.5 * trial.tube.peak[plant]
    assert trial.tube.tail_rate > 0
    assert trial.tube.grid[0] == trial.reached.duration
    assert trial.tube.grid[-1] >= trials(name, number).surroundings.horizon
    assert np.all(np.diff(trial.tube.grid) > 0)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3, 4, 5])
def test_ten_thousand_starts_of_the_five_agents(number: int) -> None:
    """2000 per agent: corners, points inside, and points bred from those that come closest to a box."""
    assert ("five_agents", number) in GAINS and gains_of("five_agents", number).h
    trial = passed("five_agents", number)
    starts = Starts("five_agents", number, trial.tube.grid[-1] + AFTER, seed=number)
    cubes, count, closest = starts.corners_and_inner(128, 272), 0, 0.0
    while count < 2000:
        flight = starts.fly(cubes, sample_times(trial))
        count += flight.count
        used = never_outside(flight, ("five_agents", number)).max(axis=1)
        closest = max(closest, float(used.max()))
        parents = flight.cubes[np.argsort(used)[-40:]]
        children = np.repeat(parents, 10, axis=0)
        cubes = np.clip(children + starts.generator.normal(0, 0.15, children.shape), 0, 1)
    assert 0.25 < closest <= 1
