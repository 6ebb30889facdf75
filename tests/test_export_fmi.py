"""The exported co-simulation units: validated and run by FMPy where it is installed, in a network with the plant."""

from __future__ import annotations

import platform
import shutil
import subprocess
import zipfile
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_export import FLAGS, agents, final_error, made, plant_of

from certify.export.fmi import fmi_files, variables
from certify.export.package import Options, Package
from sims.sampled_loop import Controlled, centre, run_network

NEEDS_COMPILER = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


@pytest.fixture(scope="module")
def package() -> Package:
    return made(plant_of(), Options(period=Fraction(1, 500), coordinator_period=Fraction(1, 100)))


@pytest.fixture(scope="module")
def units(package: Package, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("units")
    for name, data in fmi_files(package.programs, package.digest, package.notice).items():
        (folder / name).write_bytes(data)
    return folder


def test_archives_have_description_sources_and_the_claim(package: Package, units: Path) -> None:
    for program in package.programs:
        for suffix, api in (("", "fmi3"), ("_fmi2", "fmi2")):
            with zipfile.ZipFile(units / f"agent{program.id}{suffix}.fmu") as archive:
                names = set(archive.namelist())
                assert {"modelDescription.xml", f"sources/agent{program.id}.c", f"sources/{api}.c"} <= names
                if shutil.which("cc") and platform.system() == "Linux":  # it compiles without a warning
                    assert any(name.startswith("binaries/") and name.endswith(".so") for name in names)
                described = archive.read("modelDescription.xml").decode()
                assert package.digest in described and described.count("@NAME@") == 0
                assert all(f'name="{name}"' in described for name, kind in variables(program) if kind != "independent")
    again = fmi_files(package.programs, package.digest, package.notice)
    assert all((units / name).read_bytes() == data for name, data in again.items())


@pytest.mark.skipif(shutil.which("clang") is None, reason="clang is not installed")
def test_sources_compile_elsewhere_too(package: Package, units: Path, tmp_path: Path) -> None:
    for suffix, api in (("", "fmi3"), ("_fmi2", "fmi2")):
        with zipfile.ZipFile(units / f"agent1{suffix}.fmu") as archive:
            archive.extractall(tmp_path / api)
        command = ["clang", *FLAGS, "-c", "agent1.c", f"{api}.c"]
        done = subprocess.run(command, cwd=tmp_path / api / "sources", capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


class Unit:
    """One unit as the loop sees a controller: what it writes comes one communication step later."""

    def __init__(self, fmpy: Any, path: Path, program: Any, y: float) -> None:
        described = fmpy.read_model_description(str(path))
        self.version = int(described.fmiVersion[0])
        self.folder = fmpy.extract(str(path))
        kind = (fmpy.fmi3.FMU3Slave if self.version == 3 else fmpy.fmi2.FMU2Slave) if described else None
        token = described.instantiationToken if self.version == 3 else described.guid
        self.unit = kind(guid=token, unzipDirectory=self.folder, modelIdentifier=f"agent{program.id}")
        self.unit.instantiate()
        self.names = [name for name, _ in variables(program)]
        self.neighbours, self.agents = program.coordinator.neighbours, program.coordinator.agents
        self.id, self.period, self.samples = program.id, float(program.period), 0
        self.set({"y": y})
        if self.version == 3:
            self.unit.enterInitializationMode(startTime=0.0)
        else:
            self.unit.setupExperiment(startTime=0.0)
            self.unit.enterInitializationMode()
        self.set({"y": y})
        self.unit.exitInitializationMode()
        self.sent = self.get()

    def set(self, values: dict[str, float]) -> None:
        references = [self.names.index(name) for name in values]
        (self.unit.setFloat64 if self.version == 3 else self.unit.setReal)(references, list(values.values()))

    def get(self) -> dict[str, float]:
        references = [k for k, name in enumerate(self.names) if k > 1 and not name.startswith("from_")]
        got = (self.unit.getFloat64 if self.version == 3 else self.unit.getReal)(references)
        return {self.names[k]: value for k, value in zip(references, got, strict=True)}

    def message(self) -> tuple[int, dict[str, float]]:
        return self.id, {name.removeprefix("sent_"): value for name, value in self.sent.items()}

    def receive(self, message: tuple[int, dict[str, float]]) -> bool:
        sender, fields = message
        self.set({f"from_{sender}_{k}": v for k, v in fields.items() if f"from_{sender}_{k}" in self.names})
        return True

    def coordinate(self) -> bool:
        return True

    def step(self, y: float) -> float:
        """In two parts, as an importer does where an input jumps."""
        self.set({"y": y})
        at = self.samples * self.period
        for part in (0.3, 0.7):
            self.unit.doStep(currentCommunicationPoint=at, communicationStepSize=part * self.period)
            at += part * self.period
        self.samples += 1
        self.sent = self.get()
        return self.sent["u"]

    def close(self) -> None:
        self.unit.terminate()
        self.unit.freeInstance()
        shutil.rmtree(self.folder)


@NEEDS_COMPILER
@pytest.mark.parametrize("suffix", ["", "_fmi2"])
def test_fmpy_runs_them_in_a_network_with_the_plant(package: Package, units: Path, tmp_path: Path, suffix: str) -> None:
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
    from fmpy import fmi2, fmi3, validation  # noqa: F401 - attributes of the package

    plant, opened = plant_of(), []

    def opener(program: Any) -> Any:
        def make(y: float) -> Controlled:
            opened.append(Unit(fmpy, units / f"agent{program.id}{suffix}.fmu", program, y))
            return opened[-1]

        return make

    for program in package.programs:
        assert validation.validate_fmu(str(units / f"agent{program.id}{suffix}.fmu")) == []
    periods = {program.id: program.period for program in package.programs}
    arguments = (periods, Fraction(1, 100), centre(plant), 800)
    ours = run_network(plant, {p.id: opener(p) for p in package.programs}, *arguments, substeps=2)
    python = run_network(plant, agents(package, tmp_path), *arguments, substeps=2)
    for one, other in zip(ours.inputs, python.inputs, strict=True):
        assert np.array_equal(one, other)
    assert final_error(plant, ours) < 1e-3
    fault = opened[0]
    with pytest.raises(Exception, match="3"):
        fault.unit.doStep(currentCommunicationPoint=fault.samples * fault.period, communicationStepSize=1.0)
    for unit in opened:
        unit.close()
