"""``certify falsify``: search for a trajectory that breaks the claim."""

from __future__ import annotations

from reports.command_line.arguments import CertificateArgument, JsonOption, PlantArgument
from reports.command_line.outcome import Outcome, finish

NOT_THERE = "the search for counterexamples is not part of this version; nothing was searched"


def command(plant: PlantArgument, certificate: CertificateArgument, as_json: JsonOption = False) -> None:
    """Search for a trajectory that breaks the claim (not there yet: always leaves with 3)."""
    from certify.certificate import read_certificate
    from symbolic.plant_file import load_plant

    load_plant(plant)
    read_certificate(certificate)
    finish(Outcome("inconclusive", {"reason": NOT_THERE}, f"inconclusive: {NOT_THERE}"), as_json)
