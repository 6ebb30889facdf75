"""The valid certificates that are tampered with: those of small plants, and those of the examples."""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from certify.certificate import canonical
from certify.checker import check
from certify.pipeline import design_gains
from symbolic.plant_file import load_plant

Json = dict[str, Any]

SMALL = Path(__file__).parent / "plants"
EXAMPLES = Path(__file__).parents[2] / "examples"
DIRECT = ("small_first_order", "small_third_order")


@dataclass(frozen=True)
class Base:
    """A plant file and a certificate of it that the checker accepts. Of a ``large`` one only a sample of all changes
    is tried."""

    name: str
    plant: bytes
    certificate: Json
    large: bool


def encode(certificate: Any) -> bytes:
    return canonical(certificate) + b"\n"


def small_plants() -> list[Path]:
    return sorted(SMALL.glob("*.toml"))


def make_base(path: Path, route: str = "recipe") -> Base | None:
    """``None`` if the plant has no certificate. Raises ``AssertionError`` if the checker refuses the one it has."""
    result = design_gains(load_plant(path), route)
    if result.certificate is None:
        return None
    plant, certificate = path.read_bytes(), json.loads(canonical(result.certificate))
    verdict = check(plant, encode(certificate))
    assert verdict.status == "verified", f"{path.name}: {verdict}"
    return Base(f"{path.stem} ({route})", plant, certificate, route != "recipe" or path.parent == EXAMPLES)


def make_bases() -> list[Base]:
    """The small plants, the examples, and the route ``direct`` for some small plants with one agent, as far as they
    are certified."""
    recipes = [make_base(path) for path in (*small_plants(), *sorted(EXAMPLES.glob("*.toml")))]
    direct = [make_base(path, "direct") for path in small_plants() if path.stem in DIRECT]
    return [base for base in (*recipes, *direct) if base is not None]


def plant_from_bytes(data: bytes) -> Any:
    """The producer's own reading of a plant file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plant.toml"
        path.write_bytes(data)
        return load_plant(path)


def workers_default() -> int:
    return max(1, min(2, os.cpu_count() or 1))
