"""The programs of the agents as co-simulation units, FMI 3.0 and 2.0 (docs/export.md, FMI)."""

from __future__ import annotations

import io
import os
import platform
import shutil
import subprocess
import zipfile
from collections.abc import Sequence
from importlib.resources import files

from certify.export.agent_program import AgentProgram
from certify.export.c_text import FLAGS, REAL, agent_source, guard, header
from certify.files import temporary_folder

EPOCH = (1980, 1, 1, 0, 0, 0)  # equal programs give equal archives
_OUTPUTS = ("time", "y", "u", "reference", "stamp", "sent_y", "omega")


def fmi_files(programs: Sequence[AgentProgram], digest: str, notice: Sequence[str]) -> dict[str, bytes]:
    """``agent<i>.fmu`` (FMI 3.0) and ``agent<i>_fmi2.fmu`` for each agent, with sources; with a binary for this machine
    where it is Linux and ``cc`` is at hand."""
    found = {}
    for program in programs:
        for version, suffix in ((3, ""), (2, "_fmi2")):
            found[f"agent{program.id}{suffix}.fmu"] = _archive(program, programs, digest, notice, version)
    return found


def variables(program: AgentProgram) -> list[tuple[str, str]]:
    """Names and causalities by value reference."""
    agents = program.coordinator.agents
    lists = [f"{name}_{j}" for name in ("mixing", "running") for j in range(1, agents + 1)]
    outputs = [(name, "output") for name in (*_OUTPUTS[2:], *lists)]
    received = ("stamp", "y", "omega", *lists)
    inputs = [(f"from_{j}_{name}", "input") for j in program.coordinator.neighbours for name in received]
    return [("time", "independent"), ("y", "input"), *outputs, *inputs]


def _archive(
    program: AgentProgram, programs: Sequence[AgentProgram], digest: str, notice: Sequence[str], version: int
) -> bytes:
    name = f"agent{program.id}"
    sources = {
        f"{name}.c": agent_source(program, digest),
        "consensus.h": header(programs, digest, notice),
        "consensus_guard.h": guard(),
        f"{name}_unit.h": _unit(program, digest),
        "unit.h": _template("unit.h", name),
        f"fmi{version}.c": _template(f"fmi{version}.c", name),
    }
    compiled = [f"{name}.c", f"fmi{version}.c"]
    contents: dict[str, bytes] = {"modelDescription.xml": _description(program, digest, version, compiled).encode()}
    contents |= {f"sources/{file}": text.encode() for file, text in sources.items()}
    if version == 3:
        contents["sources/buildDescription.xml"] = _build(name, compiled).encode()
    binary = _binary(sources, compiled)
    if binary is not None:
        machine = platform.machine()
        folder = f"{machine}-linux" if version == 3 else "linux64" if machine == "x86_64" else f"{machine}-linux"
        contents[f"binaries/{folder}/{name}.so"] = binary
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(contents):
            archive.writestr(zipfile.ZipInfo(file, EPOCH), contents[file], zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def _template(file: str, name: str) -> str:
    return files("certify.export").joinpath(f"templates/{file}").read_text("utf-8").replace("@NAME@", name)


def _token(program: AgentProgram, digest: str) -> str:
    return f"{{{digest}-{program.id}}}"


def _unit(program: AgentProgram, digest: str) -> str:
    agents, heard = program.coordinator.agents, program.coordinator.neighbours
    outputs = len(_OUTPUTS) + 2 * agents
    message = 3 + 2 * agents
    defined = {
        "UNIT_TOKEN": f'"{_token(program, digest)}"',
        "UNIT_REAL": REAL[program.format.name],
        "UNIT_PERIOD": f"AGENT{program.id}_PERIOD",
        "UNIT_SUBSTEPS": f"AGENT{program.id}_SUBSTEPS",
        "UNIT_REFERENCE": program.reference.hexadecimal,
        "UNIT_HEARD": f"{len(heard)}u",
        "UNIT_SENDERS": "{" + ", ".join(f"{j}u" for j in heard) + "}",
        "UNIT_OUTPUTS": f"{outputs}u",
        "UNIT_MESSAGE": f"{message}u",
        "UNIT_VALUES": f"{outputs + message * len(heard)}u",
    }
    lines = [f"#define {key} {value}" for key, value in defined.items()]
    guard = f"AGENT{program.id}_UNIT_H"
    return "\n".join([f"#ifndef {guard}", f"#define {guard}", '#include "consensus.h"', *lines, "#endif", ""])


def _description(program: AgentProgram, digest: str, version: int, compiled: Sequence[str]) -> str:
    name, listed = f"agent{program.id}", variables(program)
    token, period = _token(program, digest), repr(float(program.period))
    starts = {n: "-1.0" for n, _ in listed if n.startswith("from_") and n.endswith("_stamp")}
    written, outputs = [], []
    for reference, (variable, causality) in enumerate(listed):
        if causality == "independent" and version == 2:
            continue
        if causality == "output":
            outputs.append(reference)
        kind = "independent" if causality == "independent" else causality
        vary = "continuous" if causality == "independent" else "discrete"
        start = f' start="{starts.get(variable, "0.0")}"' if causality == "input" else ""
        initial = ' initial="calculated"' if causality == "output" else ""
        common = f'name="{variable}" valueReference="{reference}" causality="{kind}" variability="{vary}"'
        if version == 3:
            written.append(f"    <Float64 {common}{initial}{start}/>")
        else:
            written.append(f"    <ScalarVariable {common}{initial}><Real{start}/></ScalarVariable>")
    said = f"Agent {program.id} of a certified controller. Claim (sha256): {digest}."
    if version == 3:
        structure = [f'    <Output valueReference="{r}"/>' for r in outputs]
        structure += [f'    <InitialUnknown valueReference="{r}"/>' for r in outputs]
        root = f'fmiVersion="3.0" modelName="{name}" instantiationToken="{token}"'
        interface = [f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"'
                     f' fixedInternalStepSize="{period}"/>']  # fmt: skip
    else:
        place = {r: k for k, r in enumerate((r for r, (_, c) in enumerate(listed) if c != "independent"), 1)}
        unknowns = [f'      <Unknown index="{place[r]}"/>' for r in outputs]
        structure = ["    <Outputs>", *unknowns, "    </Outputs>"]
        structure += ["    <InitialUnknowns>", *unknowns, "    </InitialUnknowns>"]
        root = f'fmiVersion="2.0" modelName="{name}" guid="{token}"'
        interface = [f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true">',
                     "    <SourceFiles>", *(f'      <File name="{file}"/>' for file in compiled), "    </SourceFiles>",
                     "  </CoSimulation>"]  # fmt: skip
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription {root} description="{said}" generationTool="consensus-certify">',
            *interface,
            f'  <DefaultExperiment startTime="0.0" stopTime="{1000 * float(program.period)!r}" stepSize="{period}"/>',
            "  <ModelVariables>",
            *written,
            "  </ModelVariables>",
            "  <ModelStructure>",
            *structure,
            "  </ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _build(name: str, compiled: Sequence[str]) -> str:
    sources = "\n".join(f'      <SourceFile name="{file}"/>' for file in compiled)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{name}" description="-std=c99 -ffp-contract=off">
    <SourceFileSet language="C99" compilerOptions="-std=c99 -ffp-contract=off">
{sources}
    </SourceFileSet>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def _binary(sources: dict[str, str], compiled: Sequence[str]) -> bytes | None:
    """The shared library for this machine, or ``None`` where there is no compiler for it."""
    compiler = shutil.which("cc")
    if platform.system() != "Linux" or compiler is None:
        return None
    with temporary_folder() as folder:
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        command = [compiler, *FLAGS.split(), "-fPIC", "-shared", "-o", "unit.so", *compiled, "-lm"]
        places = os.environ | {"TMPDIR": str(folder)}  # for what the compiler would leave if it were killed
        done = subprocess.run(command, cwd=folder, env=places, capture_output=True, check=False)
        return (folder / "unit.so").read_bytes() if done.returncode == 0 else None
