"""The exported C in the loop with the simulated plant: starts inside certificates, noise and delay at their bounds.

    python -m benchmarks.in_the_loop PLANT CERT [--runs 1000] [--noise 1e-3] [--seconds 20] [--period T]

Plant, harness and controller are compiled together. Every run draws start, parameters and exosystem (at vertices of
their boxes or inside), noise of one of three kinds (uniform, at the bounds, of one sign for a while) and a delay of
nothing or of one period for each agent. Said are escapes and, for each agent, the largest ``|y − s*|`` of all runs and
of the last tenth of them, beside the peak that the certificate proves in continuous time, and the largest input. A run
proves nothing.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import sympy

from certify.certificate import parse_certificate
from certify.checker import check
from certify.export.c_text import FLAGS, c_files
from certify.export.gradient import ExpressionWriter
from certify.export.package import Options, Package, package
from certify.optimum import optimum
from certify.statement.bounds import proved_bounds
from certify.statement.claim import certified_gains
from certify.statement.controller import certified_controller
from certify.statement.recomputed import coordinator_envelope
from symbolic.derivation import derive
from symbolic.plant import COST_VARIABLE, Agent, Plant
from symbolic.plant_file import parse_plant

PARTS = 4  # Runge-Kutta steps per period


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.in_the_loop")
    parser.add_argument("plant", type=Path)
    parser.add_argument("certificate", type=Path)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--noise", type=float, default=1e-3)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--period", type=Fraction)
    parser.add_argument("--arithmetic", choices=["double", "single"])
    chosen = parser.parse_args(arguments)
    source, proof = chosen.plant.read_bytes(), chosen.certificate.read_bytes()
    verdict = check(source, proof)
    if verdict.status != "verified":
        print(f"{chosen.certificate}: {verdict.obligation} {verdict.detail}", file=sys.stderr)
        return 1
    plant, certificate = parse_plant(source, str(chosen.plant)), parse_certificate(proof, str(chosen.certificate))
    controller = certified_controller(certificate, plant, "")
    options = Options(period=chosen.period, arithmetic=chosen.arithmetic)
    made = package(plant, certificate["claim"], verdict.claim_sha256, certificate["theorem"], controller, options)
    rows = _run(plant, made, chosen.runs, chosen.noise, chosen.seconds)
    peaks = _proved(plant, certificate)
    program = made.programs[0]
    print(f"{plant.name}: period {program.period}, messages every {program.period * program.substeps}, ", end="")
    print(f"{program.format.name}, noise {chosen.noise:g}, {chosen.runs} runs of {chosen.seconds:g}")
    print("| agent | escapes | max abs(y - s*) | proved peak | margin | in the last tenth | over noise | max abs(u) |")
    print("|---|---|---|---|---|---|---|---|")
    for agent, (escapes, peak, last, u), proved in zip(plant.agents, rows, peaks, strict=True):
        margin = "–" if proved is None else f"{proved / peak:.3g}"
        ratio = f"{last / chosen.noise:.3g}" if chosen.noise else "–"
        shown = "–" if proved is None else f"{proved:.4g}"
        print(f"| {agent.id} | {escapes:.0f} | {peak:.4g} | {shown} | {margin} | {last:.3g} | {ratio} | {u:.4g} |")
    return 0


def _proved(plant: Plant, certificate: dict) -> list[float | None]:
    certified = certified_gains(certificate)
    envelope = None if certified is None else coordinator_envelope(plant, certified)
    if certified is None or not certified.has_tubes or isinstance(envelope, str) or envelope is None:
        return [None] * len(plant.agents)
    bounds = proved_bounds(plant, derive(plant, COST_VARIABLE), certified, envelope)
    if isinstance(bounds, str):
        return [None] * len(plant.agents)
    return [float(agent.error.peak) for agent in bounds.agents]


def _run(plant: Plant, made: Package, runs: int, noise: float, seconds: float) -> list[list[float]]:
    texts = c_files(made.programs, made.digest, made.notice)
    texts["loop.c"] = harness(plant, made, noise, seconds)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        sources = ["loop.c", *(f"agent{p.id}.c" for p in made.programs)]
        flags = [flag for flag in FLAGS.split() if flag != "-Werror"]
        subprocess.run(["cc", *flags, "-o", "loop", *sources, "-lm"], cwd=folder, check=True)
        said = subprocess.run(["./loop", str(runs)], cwd=folder, capture_output=True, text=True, check=True).stdout
    return [[float(word) for word in line.split()] for line in said.splitlines()]


def harness(plant: Plant, made: Package, noise: float, seconds: float) -> str:
    """``loop.c``: prints escapes, peak of ``|y − s*|``, that of the last tenth, and peak of ``|u|`` for every agent."""
    program = made.programs[0]
    periods = {float(p.period) for p in made.programs}
    assert len(periods) == 1, "one period for all agents"
    rounds = int(seconds / float(program.period * program.substeps))
    side = optimum(plant).enclosure
    number = len(plant.agents)
    order = range(number)
    ids = [agent.id for agent in plant.agents]
    place = {agent.id: k for k, agent in enumerate(plant.agents)}
    edges = [(place[e.source], place[e.target]) for e in plant.digraph.edges]
    lines = [HEAD, *(_field(agent, plant, k) for k, agent in enumerate(plant.agents))]
    lines += [f"static agent{i}_state s{i};" for i in ids]
    lines += [
        f"#define AGENTS {number}",
        f"#define ROUNDS {rounds}",
        f"#define SUBSTEPS {program.substeps}",
        f"#define STEP {float(program.period) / PARTS!r}",
        f"#define PARTS {PARTS}",
        f"#define NOISE {noise!r}",
        f"#define TARGET {float((side.lo + side.hi) / 2)!r}",
        f"#define MOST {max(len(a.zero_states) + a.order for a in plant.agents) + len(plant.exosystem.states)}",
        "static field fields[AGENTS] = {" + ", ".join(f"field{k}" for k in order) + "};",
        "static int sizes[AGENTS] = {" + ", ".join(str(_size(a, plant)) for a in plant.agents) + "};",
        "static int outputs[AGENTS] = {" + ", ".join(str(len(a.zero_states)) for a in plant.agents) + "};",
        "static void starts(double q[AGENTS][MOST], double w[AGENTS][64]) {",
        *_starts(plant),
        "}",
        "static void begin(const double *y) {",
        *(f"  if (agent{i}_start(&s{i}, (agent{i}_real)y[{k}]) != 0) abort();" for k, i in enumerate(ids)),
        "}",
        "static void exchange(void) {",
        f"  consensus_message m[{number}];",
        *(f"  agent{i}_message(&s{i}, &m[{k}]);" for k, i in enumerate(ids)),
        *(f"  (void)agent{ids[target]}_receive(&s{ids[target]}, &m[{source}]);" for source, target in edges),
        *(f"  (void)agent{i}_coordinate(&s{i});" for i in ids),
        "}",
        "static double control(int k, double y) {",
        "  switch (k) {",
        *(f"    case {k}: return (double)agent{i}_step(&s{i}, (agent{i}_real)y);" for k, i in enumerate(ids)),
        "    default: abort();",
        "  }",
        "}",
        TAIL,
    ]
    kinds = "\n".join(
        f"typedef {'double' if p.format.bits == 53 else 'float'} agent{p.id}_real;" for p in made.programs
    )
    return "\n".join(lines).replace("@KINDS@", kinds)


def _size(agent: Agent, plant: Plant) -> int:
    return len(agent.zero_states) + agent.order + len(plant.exosystem.states)


def _field(agent: Agent, plant: Plant, k: int) -> str:
    u = sympy.Dummy("u", real=True)
    states = (*agent.zero_states, *agent.chain, *plant.exosystem.states)
    names = {state: f"q[{i}]" for i, state in enumerate(states)}
    names |= {parameter: f"w[{i}]" for i, parameter in enumerate(agent.parameters)} | {u: "u"}
    writer = ExpressionWriter(names, f"of plant {agent.id}")
    velocity = plant.exosystem.S * sympy.Matrix(plant.exosystem.states) if plant.exosystem.states else ()
    rows = (*agent.zero_dynamics, *agent.chain[1:], agent.f + agent.b * u, *velocity)
    results = [writer.write(sympy.sympify(row)) for row in rows]
    body = [f"  const double {c.name} = {c.hexadecimal};" for c in writer.constants]
    body += [f"  const double {let.name} = {let.expression};" for let in writer.statements]
    body += [f"  d[{i}] = {result};" for i, result in enumerate(results)]
    return "\n".join([f"static void field{k}(const double *q, const double *w, double u, double *d) {{", "  (void)w;",
                      *body, "}"])  # fmt: skip


def _starts(plant: Plant) -> list[str]:
    lines = []
    for k, agent in enumerate(plant.agents):
        boxes = (*agent.initial.z, *agent.initial.x)
        for i, side in enumerate(boxes):
            lines.append(f"  q[{k}][{i}] = draw({float(side.lo)!r}, {float(side.hi)!r});")
        for i, side in enumerate(agent.parameter_box):
            lines.append(f"  w[{k}][{i}] = draw({float(side.lo)!r}, {float(side.hi)!r});")
    for j, side in enumerate(plant.exosystem.initial):
        first, *others = [f"q[{k}][{len(a.zero_states) + a.order + j}]" for k, a in enumerate(plant.agents)]
        lines.append(f"  {first} = draw({float(side.lo)!r}, {float(side.hi)!r});")
        lines += [f"  {other} = {first};" for other in others]
    return lines


HEAD = """#include "consensus.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
@KINDS@
typedef void (*field)(const double *, const double *, double, double *);
static uint64_t seed = 88172645463325252u;
static int corner;
static double uniform(void) {
  seed ^= seed << 13; seed ^= seed >> 7; seed ^= seed << 17;
  return (double)(seed >> 11) * 0x1p-53;
}
static double draw(double lo, double hi) {
  return corner ? (uniform() < 0.5 ? lo : hi) : lo + (hi - lo) * uniform();
}
"""

TAIL = """
static void rk4(field f, int n, double *q, const double *w, double u) {
  double a[MOST], b[MOST], c[MOST], d[MOST], x[MOST];
  int i;
  f(q, w, u, a);
  for (i = 0; i < n; ++i) x[i] = q[i] + STEP / 2 * a[i];
  f(x, w, u, b);
  for (i = 0; i < n; ++i) x[i] = q[i] + STEP / 2 * b[i];
  f(x, w, u, c);
  for (i = 0; i < n; ++i) x[i] = q[i] + STEP * c[i];
  f(x, w, u, d);
  for (i = 0; i < n; ++i) q[i] += STEP / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]);
}
int main(int count, char **arguments) {
  const int runs = count > 1 ? atoi(arguments[1]) : 1;
  double peak[AGENTS] = {0}, last[AGENTS] = {0}, most[AGENTS] = {0};
  int escapes[AGENTS] = {0}, run, round, k, i, part;
  for (run = 0; run < runs; ++run) {
    static double q[AGENTS][MOST], w[AGENTS][64];
    double held[AGENTS] = {0}, y[AGENTS], drift[AGENTS] = {0};
    int late[AGENTS], kind = run % 3, gone = 0;
    corner = run % 2;
    starts(q, w);
    for (k = 0; k < AGENTS; ++k) {
      late[k] = uniform() < 0.5;
      y[k] = q[k][outputs[k]];
    }
    begin(y);
    for (round = 0; round < ROUNDS && !gone; ++round) {
      exchange();
      for (k = 0; k < AGENTS && !gone; ++k) {
        for (i = 0; i < SUBSTEPS; ++i) {
          const double error = fabs(q[k][outputs[k]] - TARGET);
          double noise = NOISE * (2 * uniform() - 1), u;
          if (kind > 0 && (kind == 1 || uniform() < 0.01 || drift[k] == 0)) drift[k] = noise < 0 ? -NOISE : NOISE;
          if (kind > 0) noise = drift[k];
          u = control(k, q[k][outputs[k]] + noise);
          for (part = 0; part < PARTS; ++part) rk4(fields[k], sizes[k], q[k], w[k], late[k] ? held[k] : u);
          held[k] = u;
          if (error > peak[k]) peak[k] = error;
          if (round >= ROUNDS - ROUNDS / 10 && error > last[k]) last[k] = error;
          if (fabs(u) > most[k]) most[k] = fabs(u);
          if (!(error < 1e6)) { escapes[k] += 1; gone = 1; break; }
        }
      }
    }
  }
  for (k = 0; k < AGENTS; ++k) printf("%d %.17g %.17g %.17g\\n", escapes[k], peak[k], last[k], most[k]);
  return 0;
}
"""

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
