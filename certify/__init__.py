"""Certificates for distributed optimal output consensus: everything a user needs, and nothing else.

>>> import certify
>>> plant = certify.example("first_order")  # a file of your own: certify.read_plant("plant.toml")
>>> certify.check(plant).status
'holds'
>>> found = certify.gains(plant)  # doctest: +SKIP
>>> certify.verify(plant, found).status  # doctest: +SKIP
'verified'

A plant comes from a file (:func:`read_plant`), from SymPy expressions and a ``networkx.DiGraph`` (:class:`Network`,
:func:`agent`), or from models of other shapes (:func:`affine_model`, :func:`from_state_space`).
Every answer has a ``status``, an ``exit_code`` (that of the command line), a short text and a table for notebooks.
Input that cannot be used raises :class:`InputError`.

A name is loaded when it is first used: to import the door loads neither solvers nor drawings.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from certify.assumptions.findings import CheckReport
    from certify.certificate import read_certificate
    from certify.door import check, derive, gains, verify
    from certify.results import GainsResult
    from certify.verification import Verification
    from symbolic.derived import Derivation
    from symbolic.errors import InputError
    from symbolic.gallery import example, gallery
    from symbolic.models.affine import affine_model
    from symbolic.models.state_space import from_state_space
    from symbolic.network_description import Network, agent
    from symbolic.plant import Plant
    from symbolic.plant_file import load_plant as read_plant
    from symbolic.plant_writer import write_plant

# What lives above this package is reached by name alone. To add a step, add a line.
_HOMES = {
    "CheckReport": "certify.assumptions.findings:CheckReport",
    "Derivation": "symbolic.derived:Derivation",
    "GainsResult": "certify.results:GainsResult",
    "InputError": "symbolic.errors:InputError",
    "Network": "symbolic.network_description:Network",
    "Plant": "symbolic.plant:Plant",
    "Verification": "certify.verification:Verification",
    "affine_model": "symbolic.models.affine:affine_model",
    "agent": "symbolic.network_description:agent",
    "check": "certify.door:check",
    "derive": "certify.door:derive",
    "example": "symbolic.gallery:example",
    "export": "reports.door:export",
    "falsify": "reports.door:falsify",
    "gallery": "symbolic.gallery:gallery",
    "from_state_space": "symbolic.models.state_space:from_state_space",
    "gains": "certify.door:gains",
    "read_certificate": "certify.certificate:read_certificate",
    "read_plant": "symbolic.plant_file:load_plant",
    "region": "reports.door:region",
    "report": "reports.door:report",
    "simulate": "reports.door:simulate",
    "verify": "certify.door:verify",
    "write_plant": "symbolic.plant_writer:write_plant",
}

__all__ = [
    "CheckReport",
    "Derivation",
    "GainsResult",
    "InputError",
    "Network",
    "Plant",
    "Verification",
    "affine_model",
    "agent",
    "check",
    "derive",
    "example",
    "export",
    "falsify",
    "from_state_space",
    "gains",
    "gallery",
    "read_certificate",
    "read_plant",
    "region",
    "report",
    "simulate",
    "verify",
    "write_plant",
]


class _Door(ModuleType):
    """Functions of the door keep their names although rooms of the package bear them too (``certify.gains``): to
    import such a room would otherwise put the room in the function's place."""

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOMES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'certify' has no attribute {name!r}")
    module, _, attribute = home.partition(":")
    for package in ("symbolic", *(("sims", "reports") if module.startswith("reports.") else ())):
        _require_own(package)
    globals()[name] = found = getattr(import_module(module), attribute)
    return found


def _require_own(package: str) -> None:
    """The rooms beside this package have plain names, which modules of the user's may bear too; theirs are left alone.

    Raises ``ImportError`` that names the module in the way.
    """
    known = sys.modules.get(package)
    spec = find_spec(package) if known is None else known.__spec__
    origin = None if spec is None else spec.origin
    if origin is None or Path(origin).resolve().parent != Path(__file__).resolve().parent.with_name(package):
        raise ImportError(
            f"certify needs its own package {package!r}, and {origin or 'another one'} bears that name: "
            "rename it, or run from another folder"
        )


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Door
