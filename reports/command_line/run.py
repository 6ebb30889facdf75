"""``certify run``: everything, from the plant file to the PDF."""

from __future__ import annotations

from reports.command_line.arguments import FolderOption, JsonOption, PlantArgument


def command(plant: PlantArgument, output: FolderOption, as_json: JsonOption = False) -> None:
    """Check, derive, find gains, verify, simulate and write the report."""
    raise NotImplementedError
