"""Imports run one way, and the checker stands alone (docs: layout)."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
CHAIN = ("symbolic", "certify", "sims", "reports")
CHECKER = "certify.checker"
CHECKER_MAY_IMPORT = {"flint"}


def imported_modules(source: str, package: str) -> Iterator[str]:
    """Absolute names of all modules that the source of a module in ``package`` imports, wherever in it they stand."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            yield stem
            yield from (f"{stem}.{alias.name}" for alias in node.names)


def violations(source: str, package: str) -> list[str]:
    """Imports of the module's source that its place in the chain does not allow."""
    modules = list(imported_modules(source, package))
    if package == CHECKER or package.startswith(CHECKER + "."):
        own = (CHECKER, *sys.stdlib_module_names, *CHECKER_MAY_IMPORT)
        return [name for name in modules if not any(name == stem or name.startswith(stem + ".") for stem in own)]
    above = CHAIN[CHAIN.index(package.split(".")[0]) + 1 :]
    return [name for name in modules if name.split(".")[0] in above]


def sources() -> list[Path]:
    return sorted(path for name in CHAIN for path in (ROOT / name).rglob("*.py"))


@pytest.mark.parametrize("path", sources(), ids=lambda path: str(path.relative_to(ROOT)))
def test_module_imports_only_what_is_below_it(path: Path) -> None:
    package = ".".join(path.relative_to(ROOT).parent.parts)
    assert violations(path.read_text(encoding="utf-8"), package) == []


@pytest.mark.parametrize(
    ("source", "package", "found"),
    [
        ("import certify", "symbolic", ["certify"]),
        ("def f():\n    from sims import scenario", "certify.recipe", ["sims", "sims.scenario"]),
        ("from reports import numbers", "sims", ["reports", "reports.numbers"]),
        ("from symbolic.plant import Plant", "certify.checker", ["symbolic.plant", "symbolic.plant.Plant"]),
        ("import numpy", "certify.checker.rules", ["numpy"]),
        ("from ..bounds import balls", "certify.checker", ["certify.bounds", "certify.bounds.balls"]),
        ("from .. import files", "certify.checker", ["certify", "certify.files"]),
    ],
)
def test_forbidden_import_is_found(source: str, package: str, found: list[str]) -> None:
    assert [name for name in violations(source, package) if name in found] == found


@pytest.mark.parametrize(
    ("source", "package"),
    [
        ("import sympy\nfrom symbolic.plant import Plant", "certify"),
        ("from certify.certificate import read_certificate", "reports.command_line"),
        ("import json\nfrom flint import arb\nfrom certify.checker.reader import read", "certify.checker"),
        ("from . import arithmetic\nfrom .reader import read", "certify.checker"),
    ],
)
def test_allowed_import_passes(source: str, package: str) -> None:
    assert violations(source, package) == []
