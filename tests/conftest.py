"""What all tests share: the example plants, and one Hypothesis profile so that a run can be repeated."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it, before NumPy is loaded

from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from certify.checker.verdict import start_meter
from symbolic.plant import Plant
from symbolic.plant_file import load_plant

EXAMPLES = Path(__file__).parent.parent / "examples"

settings.register_profile("repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("explore", deadline=None, max_examples=2_000, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


@pytest.fixture(autouse=True)
def fresh_meter() -> None:
    """The checker counts its work per process; no test pays for those before it."""
    start_meter()


@pytest.fixture(scope="session")
def examples() -> Path:
    return EXAMPLES


@pytest.fixture(scope="session")
def five_agents() -> Plant:
    """The paper's five agents, the controller's states starting at 0."""
    return load_plant(EXAMPLES / "five_agents.toml")


@pytest.fixture(scope="session")
def five_agents_box() -> Plant:
    """The same with every initial state in the unit box."""
    return load_plant(EXAMPLES / "five_agents_box.toml")


@pytest.fixture(scope="session")
def five_agents_published() -> Plant:
    """The same with the published gains."""
    return load_plant(EXAMPLES / "five_agents_published.toml")
