"""The theorems that the checker knows: for each what its witness holds and the rule that decides its obligations.

To add one: a dataclass of its witness (certificate.py), a module with its rule (rules/) and a line here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from certify.checker.certificate import Certificate, DirectWitness, Witness
from certify.checker.plant import Plant


@dataclass(frozen=True)
class Theorem:
    """``prove`` returns if every obligation holds for the plant, and raises ``Rejected`` otherwise."""

    witness: type[Any]
    prove: Callable[[Plant, Certificate], None]


def _recipe(plant: Plant, certificate: Certificate) -> None:
    from certify.checker.rules import recipe

    recipe.prove(plant, certificate)


def _direct(plant: Plant, certificate: Certificate) -> None:
    from certify.checker.rules import direct  # lazily: recipe/1 is checked without python-flint

    direct.prove(plant, certificate)


THEOREMS: dict[str, Theorem] = {
    "recipe/1": Theorem(Witness, _recipe),  # docs/certificate.md
    "direct/2": Theorem(DirectWitness, _direct),  # docs/certificate-direct.md
}


def witness_kinds() -> dict[str, type[Any]]:
    """The dataclass of the witness by theorem, for the reader of certificates."""
    return {name: theorem.witness for name, theorem in THEOREMS.items()}
