"""The files of an export: code, numbers and samples to replay (docs/export.md)."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

from certify.export.package import Options, Package, json_text, package
from certify.export.python_text import python_files
from certify.files import temporary_folder
from certify.statement.controller import certified_controller
from reports.answers import Export
from reports.command_line.inputs import Given
from reports.command_line.steps import Steps
from reports.command_line.verify import announced
from symbolic.plant import Plant

RECORDED = 10_000  # samples of all agents in samples.txt, about
MOST_RECORDED = 50_000  # where it takes that many until the references move


def exported(plant: Plant, proof: Given, to: str, options: Options, steps: Steps) -> Export:
    """The code ``to`` (``c``, ``python``, ``fmi``) of a certificate that the checker accepts. Raises ``InputError``."""
    certificate = proof.as_certificate()
    answer = announced(Given(plant.name, plant.source), proof, steps)
    if answer["status"] != "verified":
        reason = f"not exported: the checker does not accept the certificate: {answer['reason']}"
        return Export("rejected", reason)
    with steps.step("export") as said:
        controller = certified_controller(certificate, plant, proof.name)
        theorem = str(certificate["theorem"])
        made = package(plant, certificate["claim"], answer["claim_sha256"], theorem, controller, options)
        files = _files(plant, made, to)
        said(f"{len(files)} files")
    return Export("verified", made.notice[1], files, made)


def _files(plant: Plant, made: Package, to: str) -> dict[str, bytes]:
    """The contents by name."""
    from certify.export.c_text import c_files

    texts = {"controller.json": json_text(made)}
    python = python_files(made.programs, made.digest, made.notice)
    if to == "fmi":
        from certify.export.fmi import fmi_files

        units = fmi_files(made.programs, made.digest, made.notice)
        return {**{name: text.encode() for name, text in texts.items()}, **units}
    if to == "python":
        texts |= python
    else:
        texts |= c_files(made.programs, made.digest, made.notice)
        texts["samples.txt"] = _samples(plant, made, python)
    return {name: text.encode() for name, text in texts.items()}


def _samples(plant: Plant, made: Package, python: dict[str, str]) -> str:
    """A run from the middle of the boxes, with what the exported Python writes, for the replay."""
    from sims.sampled_loop import centre, run_network

    per_round = sum(program.substeps for program in made.programs)
    moving = min(made.programs[0].coordinator.hold + 20, MOST_RECORDED // per_round)
    rounds = max(1, RECORDED // per_round, moving)
    with temporary_folder() as folder:
        make = {p.id: _agent(folder, f"agent{p.id}", python) for p in made.programs}
        periods = {p.id: p.period for p in made.programs}
        period = made.programs[0].period * made.programs[0].substeps
        run = run_network(plant, make, periods, period, centre(plant), rounds)
    return "\n".join(run.lines) + "\n"


def _agent(folder: Path, name: str, python: dict[str, str]) -> Callable[[float], Any]:
    (folder / f"{name}.py").write_text(python[f"{name}.py"], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
    assert spec is not None and spec.loader is not None  # a file that was just written
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    kind: Callable[[float], Any] = module.Agent
    return kind
