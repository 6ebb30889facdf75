"""The steps from a plant to a verified certificate, as functions: what ``import certify`` offers of this package.

Defaults are those of the command line. A plant is given as a value, as a ``Network`` or as the path of its file; a
certificate as the result of :func:`gains`, as read, as its bytes or as a path.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from certify.assumptions.findings import CheckReport
from certify.certificate import LARGEST_FILE, certificate_bytes
from certify.results import GainsResult
from certify.routes import DEFAULT, ROUTES
from certify.verification import Verification, verification
from symbolic.derived import Derivation
from symbolic.errors import InputError
from symbolic.network_description import Network
from symbolic.plant import Plant
from symbolic.plant_file import load_plant
from symbolic.plant_writer import with_source

__all__ = ["CertificateLike", "PlantLike", "check", "derive", "gains", "given_certificate", "given_plant", "verify"]

PlantLike = Plant | Network | str | Path
CertificateLike = GainsResult | Mapping[str, Any] | bytes | str | Path


def check(plant: PlantLike) -> CheckReport:
    """The assumptions A0 … A6 (docs/theory.md, 2), each ``holds``, ``fails`` or ``unknown`` with its evidence.

    >>> import certify
    >>> certify.check(certify.example("first_order")).status
    'holds'
    """
    from certify.assumptions.check import check_assumptions

    return check_assumptions(given_plant(plant))


def derive(plant: PlantLike) -> Derivation:
    """Steady states ``z*``, ``u*``, internal models and error coordinates (docs/theory.md, 2 and 3).

    For the exact optimum, or for the symbol ``s`` where that is not rational or not known. Raises ``InputError`` for a
    design in the plant that does not fit.
    """
    from certify.derivation import derivation_at_optimum

    return derivation_at_optimum(given_plant(plant))


def gains(
    plant: PlantLike, *, route: str = DEFAULT, progress: Callable[[str], None] = lambda message: None
) -> GainsResult:
    """Gains with a certificate that the independent checker has accepted, or the reason why there are none.

    What the plant fixes (``gains``, ``coordinator``, designs) is kept and decided as it is. ``progress`` is told now
    and then what the search is at. Raises ``InputError`` for a route that does not exist.
    """
    from certify.pipeline import design_gains

    if route not in ROUTES:
        raise InputError(f"route: {route!r} is not one of {', '.join(ROUTES)}")
    return design_gains(given_plant(plant), route=route, progress=progress)


def verify(plant: PlantLike, certificate: CertificateLike) -> Verification:
    """What the independent checker says of a certificate, from the bytes of the plant file and of the certificate.

    Raises ``InputError`` where one of them cannot be read.
    """
    return verification(given_plant(plant).source, given_certificate(certificate))


def given_plant(plant: PlantLike) -> Plant:
    """The plant with the bytes a certificate can be bound to, however it was given. Raises ``InputError``."""
    if isinstance(plant, str | Path):
        return load_plant(plant)
    given: object = plant.plant if isinstance(plant, Network) else plant
    if not isinstance(given, Plant):
        raise InputError(f"a plant, a Network or the path of a plant file is needed, found {type(given).__name__}")
    return with_source(given)


def given_certificate(certificate: CertificateLike | object) -> bytes:
    """The bytes of a certificate. Raises ``InputError`` where there is none."""
    if isinstance(certificate, bytes):
        return certificate
    if isinstance(certificate, GainsResult):
        if certificate.certificate is None:
            raise InputError(f"there is no certificate: {certificate.status}: {certificate.reason}")
        return certificate_bytes(certificate.certificate)
    if isinstance(certificate, Mapping):
        return certificate_bytes(dict(certificate))
    if not isinstance(certificate, str | Path):
        found = type(certificate).__name__
        raise InputError(f"what gains() returns, or the path of a certificate, is needed, found {found}")
    try:
        with Path(certificate).open("rb") as file:
            return file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise InputError(f"{certificate}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
