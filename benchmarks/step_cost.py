"""What a step of an exported controller costs: instructions (valgrind) and stack (GCC), beside a PID of the same style.

    python -m benchmarks.step_cost PLANT CERT [--arithmetic single]

The step has no loop and no branch but its limits, so the count is that of every call; the round of the coordinator has
loops over the agents that are heard.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from certify.certificate import parse_certificate
from certify.checker import check
from certify.export.c_text import FLAGS, c_files
from certify.export.package import Options, package
from certify.statement.controller import certified_controller
from symbolic.plant_file import parse_plant

CALLS = 1000
PID = """typedef struct { double integral; double before; double filtered; } pid_state;
double pid_step(pid_state *s, double y, double reference)
{
    const double error = reference - y;
    const double slope = (error - s->before) * 100.0;
    const double filtered = s->filtered + 0.1 * (slope - s->filtered);
    const double demanded = 4.0 * error + s->integral + 0.5 * filtered;
    const double written = demanded > 60.0 ? 60.0 : (demanded < -60.0 ? -60.0 : demanded);
    s->integral = s->integral + 0.02 * error + 0.01 * (written - demanded);
    s->before = error;
    s->filtered = filtered;
    return written;
}
"""


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.step_cost")
    parser.add_argument("plant", type=Path)
    parser.add_argument("certificate", type=Path)
    parser.add_argument("--arithmetic", choices=["double", "single"])
    chosen = parser.parse_args(arguments)
    source, proof = chosen.plant.read_bytes(), chosen.certificate.read_bytes()
    verdict = check(source, proof)
    if verdict.status != "verified":
        print(f"{chosen.certificate}: {verdict.obligation} {verdict.detail}", file=sys.stderr)
        return 1
    plant, certificate = parse_plant(source, str(chosen.plant)), parse_certificate(proof, str(chosen.certificate))
    controller = certified_controller(certificate, plant, "")
    options = Options(arithmetic=chosen.arithmetic)
    made = package(plant, certificate["claim"], verdict.claim_sha256, certificate["theorem"], controller, options)
    ids = [program.id for program in made.programs]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in c_files(made.programs, made.digest, made.notice).items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "pid.c").write_text(PID)
        (folder / "calls.c").write_text(_calls(ids))
        sources = ["calls.c", "pid.c", *(f"agent{i}.c" for i in ids)]
        flags = [flag for flag in FLAGS.split() if flag != "-Werror"]
        subprocess.run(["gcc", *flags, "-fstack-usage", "-o", "calls", *sources, "-lm"], cwd=folder, check=True)
        stack = _stack(folder)
        rows = [("PID", "pid_step"), *((f"agent {i}", f"agent{i}_step") for i in ids)]
        rows += [(f"agent {i}, round", f"agent{i}_coordinate") for i in ids]
        kind = made.programs[0].format.name
        print(f"{plant.name}, {kind}, gcc -O2\n| | instructions | over PID | stack, bytes |\n|---|---|---|---|")
        base = 0.0
        for label, function in rows:
            count = _instructions(folder, function)
            base = base or count
            print(f"| {label} | {count:.0f} | {count / base:.1f} | {stack[function]} |")
    return 0


def _calls(ids: Sequence[int]) -> str:
    states = "\n".join(f"static agent{i}_state s{i};" for i in ids)
    start = "\n".join(f"  if (agent{i}_start(&s{i}, 0) != 0) return 1;" for i in ids)
    send = "\n".join(f"    agent{i}_message(&s{i}, &m[{k}]);" for k, i in enumerate(ids))
    take = "\n".join(f"    for (j = 0; j < {len(ids)}; ++j) (void)agent{i}_receive(&s{i}, &m[j]);" for i in ids)
    go = "\n".join(f"    (void)agent{i}_coordinate(&s{i});\n    (void)agent{i}_step(&s{i}, 0);" for i in ids)
    return f"""#include "consensus.h"
typedef struct {{ double integral; double before; double filtered; }} pid_state;
double pid_step(pid_state *s, double y, double reference);
{states}
int main(void) {{
  static consensus_message m[{len(ids)}];
  pid_state pid = {{0, 0, 0}};
  int k, j;
{start}
  for (k = 0; k < {CALLS}; ++k) {{
{send}
{take}
{go}
    (void)pid_step(&pid, 0.5, 0.0);
  }}
  return 0;
}}
"""


def _instructions(folder: Path, function: str) -> float:
    """Per call, with everything that it calls."""
    command = [
        "valgrind",
        "--tool=callgrind",
        "--callgrind-out-file=/dev/null",
        f"--toggle-collect={function}",
        "./calls",
    ]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stderr
    found = re.search(r"Collected\s*:\s*(\d+)", said)
    assert found is not None, said
    return int(found[1]) / CALLS


def _stack(folder: Path) -> dict[str, int]:
    found = {}
    for file in folder.glob("*.su"):
        for line in file.read_text().splitlines():
            where, size, _ = line.split("\t")
            found[where.rsplit(":", 1)[1]] = int(size)
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
