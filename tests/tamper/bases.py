"""The valid certificates that are tampered with: those of small plants, and those of the examples."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from certify.certificate import canonical
from certify.checker import check
from certify.checker.verdict import steps_spent
from certify.pipeline import design_gains
from symbolic.plant_file import load_plant

Json = dict[str, Any]

SMALL = Path(__file__).parent / "plants"
EXAMPLES = Path(__file__).parents[2] / "examples"
DIRECT = (
    SMALL / "small_first_order.toml",
    EXAMPLES / "first_order.toml",
    EXAMPLES / "van_der_pol.toml",
    EXAMPLES / "third_order_actuator.toml",
    EXAMPLES / "fourth_order.toml",
    EXAMPLES / "five_agents.toml",
)


@dataclass(frozen=True)
class Base:
    """A plant file and a certificate of it that the checker accepts in ``cost`` of its elementary steps."""

    name: str
    plant: bytes
    certificate: Json
    cost: int


def encode(certificate: Any) -> bytes:
    return canonical(certificate) + b"\n"


def held_plants() -> list[Path]:
    """Networks whose references wait for the mixing layer, with and without requirements: for the route ``direct``."""
    return sorted((SMALL / "held").glob("*.toml"))


def small_plants() -> list[Path]:
    return sorted(SMALL.glob("*.toml"))


@lru_cache
def make_base(path: Path, route: str = "recipe") -> Base | None:
    """``None`` if the plant has no certificate. Raises ``AssertionError`` if the checker refuses the one it has."""
    result = design_gains(load_plant(path), route)
    if result.certificate is None:
        return None
    plant, certificate = path.read_bytes(), json.loads(canonical(result.certificate))
    verdict = check(plant, encode(certificate))
    assert verdict.status == "verified", f"{path.name}: {verdict}"
    return Base(f"{path.stem} ({route})", plant, certificate, steps_spent())


def make_bases(plants: Sequence[Path] = ()) -> list[Base]:
    """Those of the named plants by the route ``direct``; without any, the small plants and the examples by the route
    ``recipe``, some of them by the route ``direct``, as far as they are certified."""
    if plants:
        return [base for path in plants if (base := make_base(path, "direct")) is not None]
    recipes = [make_base(path) for path in (*small_plants(), *sorted(EXAMPLES.glob("*.toml")))]
    return [base for base in (*recipes, *(make_base(path, "direct") for path in DIRECT)) if base is not None]


def plant_from_bytes(data: bytes) -> Any:
    """The producer's own reading of a plant file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plant.toml"
        path.write_bytes(data)
        return load_plant(path)


def workers_default() -> int:
    return max(1, min(2, os.cpu_count() or 1))
