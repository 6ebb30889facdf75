"""The programs of the agents as C99 (docs/export.md, C)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from textwrap import dedent

from certify.export.agent_program import AgentProgram
from certify.export.formats import DOUBLE, Constant, Format
from certify.export.statements import Clamp, Let, Quantise, Statement

REAL = {"double": "double", "single": "float"}
_ROUND = {"double": "rint", "single": "rintf"}
FLAGS = "-std=c99 -O2 -ffp-contract=off -Wall -Wextra -Wpedantic -Wconversion -Werror"


def c_files(programs: Sequence[AgentProgram], digest: str, notice: Sequence[str]) -> dict[str, str]:
    """The folder's files by name."""
    texts = {
        "consensus.h": header(programs, digest, notice),
        "consensus_guard.h": guard(),
        "replay.c": _replay(programs),
        "Makefile": _makefile(programs),
    }
    return {**texts, **{f"agent{program.id}.c": agent_source(program, digest) for program in programs}}


def guard() -> str:
    """``consensus_guard.h``."""
    return files("certify.export").joinpath("templates/guard.h").read_text("utf-8")


def agent_source(program: AgentProgram, digest: str) -> str:
    """``agent<id>.c``."""
    name, real, network = f"agent{program.id}", REAL[program.format.name], program.coordinator
    doubles = [*network.constants, *network.slope_constants, program.reference]
    parts = [
        f"/**\n * @file {name}.c\n * @brief Agent {program.id} of the certified controller.\n *\n"
        f" * Claim {digest}.\n */",
        '#include "consensus.h"\n#include "consensus_guard.h"\n\n#include <math.h>',
        "\n".join(_constants(program.constants, program.format)),
        "\n".join(_constants(_starts(program), program.format)),
        "\n".join(_constants(doubles, DOUBLE)),
        _tables(program),
        _slope(program),
        _start(program, name, real),
        _exchange(program, name),
        _coordinate(program, name),
        _steps(program, name, real),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _starts(program: AgentProgram) -> list[Constant]:
    return [state.start for state in program.states if state.name != program.measured_state]


def _constants(constants: Iterable[Constant], format: Format) -> list[str]:
    real, suffix = REAL[format.name], "" if format is DOUBLE else "f"
    return [
        f"static const {real} {c.name} = {c.hexadecimal}{suffix}; /* {c.meaning}: {c.number:.9g} */" for c in constants
    ]


def _tables(program: AgentProgram) -> str:
    network = program.coordinator
    weights = ", ".join(c.hexadecimal for c in network.weights)
    ids = ", ".join(f"{j}u" for j in network.neighbours)
    lines = [
        f"#define NEIGHBOURS {len(network.neighbours)}u",
        f"static const uint32_t NEIGHBOUR[NEIGHBOURS] = {{{ids}}};",
        f"static const double WEIGHT[NEIGHBOURS] = {{{weights}}}; /* a_ij of the agents heard */",
    ]
    return "\n".join(lines)


def _slope(program: AgentProgram) -> str:
    lines = [f"    const double {let.name} = {let.expression};" for let in program.coordinator.slope[:-1]]
    body = "\n".join([*lines, f"    return {program.coordinator.slope[-1].expression};"])
    unused = "" if "s" in re.findall(r"\b\w+\b", body) else "    (void)s;\n"
    said = "/** @brief c'(s), the slope of the agent's cost. */\nstatic double slope_of_cost(double s)"
    return f"{said}\n{{\n{unused}{body}\n}}"


def _start(program: AgentProgram, name: str, real: str) -> str:
    starts = [f"    agent->{state.name} = {state.start.name};" for state in program.states]
    if program.measured:
        starts = ["    agent->x1 = y;" if "->x1 " in line else line for line in starts]
    else:
        starts = ["    (void)y;", *starts]
    soft = "    agent->soft = 1.0;\n" if program.coordinator.soft else ""
    joined = "\n".join(starts)
    return dedent("""\
        int {name}_start({name}_state *agent, {real} y)
        {{
            const {name}_state blank = {{0}};
            const int fault = consensus_arithmetic_fault();

            *agent = blank;
        {joined}
            agent->y_now = {reference};
            agent->y_next = {reference};
            agent->substep = {substeps}u;
            agent->running[{own}u] = 1u;
        {soft}    return fault;
        }}""").format(
        name=name,
        real=real,
        joined=joined,
        soft=soft,
        own=program.id - 1,
        reference=program.reference.name,
        substeps=program.substeps,
    )


def _exchange(program: AgentProgram, name: str) -> str:
    return dedent("""\
        void {name}_message(const {name}_state *agent, consensus_message *message)
        {{
            uint32_t l;

            message->sender = {id}u;
            message->stamp = agent->stamp;
            message->y = agent->y_next;
            message->omega = agent->omega;
            for (l = 0u; l < CONSENSUS_AGENTS; ++l) {{
                message->mixing[l] = agent->mixing[l];
                message->running[l] = agent->running[l];
            }}
        }}

        int {name}_receive({name}_state *agent, const consensus_message *message)
        {{
            uint32_t j;
            uint32_t l;

            for (j = 0u; j < NEIGHBOURS && NEIGHBOUR[j] != message->sender; ++j) {{
            }}
            if (j == NEIGHBOURS) {{
                return 0;
            }}
            for (l = 0u; l < CONSENSUS_AGENTS; ++l) {{
                if (message->running[l]) {{
                    agent->running[l] = 1u;
                }}
            }}
            if (message->stamp > agent->newest && message->stamp < agent->stamp + CONSENSUS_HISTORY) {{
                agent->newest = message->stamp;
            }}
            if (agent->stamp == 0u && !agent->heard[j].known) {{ /* the sums of round 0 are zero everywhere */
                agent->heard[j].known = 1u;
                agent->heard[j].y = message->y;
                return 1;
            }}
            if (message->stamp > agent->stamp || agent->stamp - message->stamp >= CONSENSUS_HISTORY
                || (agent->heard[j].known && message->stamp <= agent->heard[j].stamp)) {{
                return 0;
            }}
            {{
                const uint32_t place = (uint32_t)(message->stamp % CONSENSUS_HISTORY);

                agent->heard[j].known = 1u;
                agent->heard[j].stamp = message->stamp;
                agent->heard[j].y = message->y;
                agent->heard[j].omega = agent->past[place].omega - message->omega;
                for (l = 0u; l < CONSENSUS_AGENTS; ++l) {{
                    agent->heard[j].mixing[l] = agent->past[place].mixing[l] - message->mixing[l];
                }}
            }}
            return 1;
        }}""").format(name=name, id=program.id)


def _coordinate(program: AgentProgram, name: str) -> str:
    network = program.coordinator
    hold, mixing = f"UINT64_C({network.hold})", f"UINT64_C({network.mixing})"
    gradient = "slope_of_cost(y)"
    if network.soft:
        gradient = f"slope_of_cost(y) - agent->soft * slope_of_cost({program.reference.name})"
    softer = "        agent->soft = agent->soft * SOFTER;\n" if network.soft else ""
    start = "agent->stamp >= HOLD" if network.hold else "1"
    define = f"#define HOLD {hold} /* rounds until y^r moves */\n" if network.hold else ""
    condition = f"    if ({start}) {{\n" if network.hold else "    {\n"
    return define + dedent("""\
        #define MIXED {mixing} /* rounds after which xi is its limit up to rounding */

        static void one_round({name}_state *agent)
        {{
            const double y = agent->y_next;
            double rate = 0.0;
            double own = 0.0;
            uint32_t j;
            uint32_t l;

            if (agent->stamp < MIXED) {{
                for (j = 0u; j < NEIGHBOURS; ++j) {{
                    own = own + WEIGHT[j] * agent->heard[j].mixing[{own}u];
                }}
                agent->xi = 1.0 - BETA * own;
                for (l = 0u; l < CONSENSUS_AGENTS; ++l) {{
                    double mixed = 0.0;

                    for (j = 0u; j < NEIGHBOURS; ++j) {{
                        mixed = mixed + WEIGHT[j] * agent->heard[j].mixing[l];
                    }}
                    agent->mixing[l] = agent->mixing[l] + ROUND * ((l == {own}u ? 1.0 : 0.0) - BETA * mixed);
                }}
            }}
        {condition}
                const double gradient = {gradient};
                double spread = 0.0;
                double integral = 0.0;

                for (j = 0u; j < NEIGHBOURS; ++j) {{
                    spread = spread + WEIGHT[j] * (y - agent->heard[j].y);
                    integral = integral + WEIGHT[j] * agent->heard[j].omega;
                }}
                rate = -(KAPPA * gradient / agent->xi) - ALPHA1 * spread - ALPHA2 * (ALPHA1 * integral);
                agent->omega = agent->omega + ROUND * y;
        {softer}    }}
            agent->y_next = y + ROUND * rate;
            agent->stamp += 1u;
            {{
                const uint32_t place = (uint32_t)(agent->stamp % CONSENSUS_HISTORY);

                agent->past[place].omega = agent->omega;
                for (l = 0u; l < CONSENSUS_AGENTS; ++l) {{
                    agent->past[place].mixing[l] = agent->mixing[l];
                }}
            }}
        }}

        int {name}_coordinate({name}_state *agent)
        {{
            uint32_t j;

            agent->y_now = agent->y_next;
            agent->ramp = 0.0;
            agent->substep = 0u;
            for (j = 0u; j < CONSENSUS_AGENTS; ++j) {{
                if (!agent->running[j] || (j < NEIGHBOURS && !agent->heard[j].known)) {{
                    return 0;
                }}
            }}
            do {{
                one_round(agent);
            }} while (agent->stamp <= agent->newest);
            agent->ramp = (agent->y_next - agent->y_now) / {substeps}.0;
            return 1;
        }}""").format(
        name=name, mixing=mixing, condition=condition.rstrip("\n"), own=program.id - 1, gradient=gradient,
        softer=softer, substeps=program.substeps,
    )  # fmt: skip


def _steps(program: AgentProgram, name: str, real: str) -> str:
    loads = [f"    const {real} {state.name} = agent->{state.name};" for state in program.states]
    body = [line for statement in program.step for line in _statement(statement, program.format)]
    stores = [f"    agent->{state.name} = next_{state.name};" for state in program.states]
    due = "agent->substep + 1u" if program.ahead else "agent->substep"
    missed = [line for statement in program.missed for line in _statement(statement, program.format)]
    needs = re.findall(r"\b\w+\b", " ".join(missed))
    missed_loads = [line for line, state in zip(loads, program.states, strict=True) if state.name in needs]
    held = [f"    const {real} written = agent->written;"] if "written" in needs else []
    corrections = [f"    agent->{key} = agent->{key} + {gain} * missed;" for key, gain in program.corrections.items()]
    correction = [f"    const {real} missed = written - agent->written;", "", *corrections] if corrections else []
    count = [
        f"    if (agent->substep < {program.substeps}u) {{",
        "        agent->substep += 1u;",
        "    }",
    ]
    return "\n".join(
        [
            "/* y^r at a fraction of the round: a ramp from y_now to y_next */",
            f"static double reference_at(const {name}_state *agent, uint32_t substep)",
            "{",
            f"    return substep < {program.substeps}u ? agent->y_now + (double)substep * agent->ramp : agent->y_next;",
            "}",
            "",
            f"{real} {name}_step({name}_state *agent, {real} y)",
            "{",
            f"    const {real} reference = ({real})reference_at(agent, {due});",
            *loads,
            *body,
            "",
            *stores,
            "    agent->written = written;",
            *count,
            "    return written;",
            "}",
            "",
            f"void {name}_missed({name}_state *agent)",
            "{",
            *held,
            *missed_loads,
            *missed,
            "",
            *(stores if missed else []),
            *count,
            "}",
            "",
            f"void {name}_wrote({name}_state *agent, {real} written)",
            "{",
            *correction,
            "    agent->written = written;",
            "}",
        ]
    )


def _statement(statement: Statement, format: Format) -> list[str]:
    real = REAL[format.name]
    note = f" /* {statement.meaning} */" if statement.meaning else ""
    if isinstance(statement, Let):
        return [f"    const {real} {statement.name} = {statement.expression};{note}"]
    source = statement.source
    if isinstance(statement, Quantise):
        step = statement.step
        return [f"    const {real} {statement.name} = {_ROUND[format.name]}({source} / {step}) * {step};{note}"]
    assert isinstance(statement, Clamp)
    bound = statement.bound
    limited = f"{source} > {bound} ? {bound} : ({source} < -{bound} ? -{bound} : {source})"
    return [f"    const {real} {statement.name} = {limited};{note}"]


def header(programs: Sequence[AgentProgram], digest: str, notice: Sequence[str]) -> str:
    """``consensus.h``."""
    said = "\n".join(f" * {line}".rstrip() for line in notice)
    declared = "\n\n".join(_declared(program) for program in programs)
    return f"""/**
 * @file consensus.h
 * @brief Distributed optimal output consensus: one controller per agent.
 *
 * Claim (sha256): {digest}
 *
{said}
 *
 * Every agent runs on its own:
 *   1. <agent>_start(&state, y) with the first sample; it must return 0.
 *   2. Every coordinator period, first <agent>_message to all agents that hear this one, then <agent>_receive for
 *      each message that came in, then <agent>_coordinate. Late and lost messages leave no bias. y^r is held
 *      until all agents run. One that starts anew among others that have gone on for CONSENSUS_HISTORY rounds is not
 *      let in: start all of them anew.
 *   3. Every sampling period <agent>_step with the sample y; write what it returns at once and hold it.
 *      Where the plant got something else than that, say so by <agent>_wrote. For every sample that was missed call
 *      <agent>_missed instead of <agent>_step.
 */
#ifndef CONSENSUS_H
#define CONSENSUS_H

#include <stdint.h>

#define CONSENSUS_CLAIM "{digest}"
#define CONSENSUS_AGENTS {programs[0].coordinator.agents}u
#define CONSENSUS_HISTORY {programs[0].coordinator.history}u /**< Rounds remembered: a message may be one less late. */

/** @brief What an agent tells those that hear it, once per round. */
typedef struct {{
    uint32_t sender;                  /**< Number of the agent. */
    uint64_t stamp;                   /**< Number of the round. */
    double y;                         /**< y^r at the start of the round. */
    double omega;                     /**< Sum of period times y^r of all rounds before. */
    double mixing[CONSENSUS_AGENTS];  /**< The same of xi. */
    uint8_t running[CONSENSUS_AGENTS]; /**< Agents that are known to run, directly or by hearsay. */
}} consensus_message;

/** @brief What is known of an agent that is heard: differences to it at the newest stamp that came. */
typedef struct {{
    uint32_t known;
    uint64_t stamp;
    double y;
    double omega;
    double mixing[CONSENSUS_AGENTS];
}} consensus_heard;

/** @brief Own sums of a round that is past. */
typedef struct {{
    double omega;
    double mixing[CONSENSUS_AGENTS];
}} consensus_past;

{declared}

#endif
"""


def _declared(program: AgentProgram) -> str:
    name, real = f"agent{program.id}", REAL[program.format.name]
    states = "\n".join(f"    {real} {state.name}; /**< {state.meaning} */" for state in program.states)
    soft = (
        "    double soft; /**< share of the first slope that is still taken off */\n"
        if program.coordinator.soft
        else ""
    )
    rounds = program.substeps * program.period
    period = f"{float(program.period)!r} /**< {program.period}: time between two samples. */"
    samples = f"{program.substeps}u /**< Samples per round of the coordinator, which takes {rounds}. */"
    return f"""#define AGENT{program.id}_PERIOD {period}
#define AGENT{program.id}_SUBSTEPS {samples}

/** @brief State of agent {program.id}. */
typedef struct {{
{states}
    {real} written; /**< input that the plant gets */
    uint32_t substep; /**< samples of this round that are done */
    uint64_t stamp; /**< number of the round */
    uint64_t newest; /**< largest number of a round that was heard of */
    double y_now; /**< y^r at the start of the round */
    double y_next; /**< y^r at its end */
    double ramp; /**< y^r moves by this per sample */
    double omega; /**< sum of period times y^r */
    double xi; /**< xi_i^i */
{soft}    double mixing[CONSENSUS_AGENTS]; /**< sum of period times xi */
    uint8_t running[CONSENSUS_AGENTS]; /**< agents that are known to run */
    consensus_heard heard[{len(program.coordinator.neighbours)}];
    consensus_past past[CONSENSUS_HISTORY];
}} {name}_state;

/** @brief Set everything to the start. @param y the first sample. @return 0; otherwise do not run this build. */
int {name}_start({name}_state *agent, {real} y);
/** @brief The message of this round. */
void {name}_message(const {name}_state *agent, consensus_message *message);
/** @brief Take a message. @return 1 if it was used; 0 if it is from a stranger, too old, known or of a later round. */
int {name}_receive({name}_state *agent, const consensus_message *message);
/** @brief One round of the coordinator, and those by which others are ahead. @return 0 while it is not known that all
 *  agents run: y^r is held; else 1. */
int {name}_coordinate({name}_state *agent);
/** @brief One sample. @param y the measured output. @return the input to be written and held. */
{real} {name}_step({name}_state *agent, {real} y);
/** @brief In place of a step whose sample is missing; the input stays. */
void {name}_missed({name}_state *agent);
/** @brief After a step: the plant got this input instead of the one that was returned. */
void {name}_wrote({name}_state *agent, {real} written);"""


def _replay(programs: Sequence[AgentProgram]) -> str:
    states = "\n".join(f"static agent{p.id}_state state{p.id};" for p in programs)
    send = "\n".join(f"    agent{p.id}_message(&state{p.id}, &message[{k}]);" for k, p in enumerate(programs))
    place = {p.id: k for k, p in enumerate(programs)}
    receive = "\n".join(
        f"    (void)agent{p.id}_receive(&state{p.id}, &message[{place[j]}]);"
        for p in programs
        for j in p.coordinator.neighbours
    )
    go = "\n".join(f"    (void)agent{p.id}_coordinate(&state{p.id});" for p in programs)
    cases = "\n".join(
        f"""        case {p.id}u:
            if (!started[{place[p.id]}]) {{
                started[{place[p.id]}] = 1;
                if (agent{p.id}_start(&state{p.id}, ({REAL[p.format.name]})y) != 0) {{
                    return -1;
                }}
                return 1;
            }}
            *u = (double)agent{p.id}_step(&state{p.id}, ({REAL[p.format.name]})y);
            return 1;"""
        for p in programs
    )
    return f"""/**
 * @file replay.c
 * @brief Feeds recorded samples to all agents and compares what they write, bit by bit.
 *
 * Lines "agent y u" in the order in which the samples were taken, numbers in hexadecimal; "0 0 0" is a round of the
 * coordinator. The first line of an agent is its start, the u of which is not looked at.
 */
#include "consensus.h"

#include <stdio.h>
#include <string.h>

{states}
static int started[{len(programs)}];

static void exchange(void)
{{
    consensus_message message[{len(programs)}];

{send}
{receive}
{go}
}}

static int sample(unsigned agent, double y, double *u)
{{
    switch (agent) {{
{cases}
        default:
            return -1;
    }}
}}

int main(int count, char **arguments)
{{
    FILE *file = count == 2 ? fopen(arguments[1], "r") : NULL;
    unsigned agent = 0u;
    unsigned long samples = 0ul;
    unsigned long differing = 0ul;
    double y = 0.0;
    double expected = 0.0;

    if (file == NULL) {{
        (void)fprintf(stderr, "usage: replay FILE\\n");
        return 2;
    }}
    while (fscanf(file, "%u %la %la", &agent, &y, &expected) == 3) {{
        double u = expected;

        if (agent == 0u) {{
            exchange();
            continue;
        }}
        if (sample(agent, y, &u) < 0) {{
            (void)fprintf(stderr, "agent %u: unknown, or its arithmetic is not as proved\\n", agent);
            (void)fclose(file);
            return 2;
        }}
        samples += 1ul;
        if (memcmp(&u, &expected, sizeof u) != 0) {{
            differing += 1ul;
        }}
    }}
    (void)fclose(file);
    (void)printf("%lu samples, %lu differ\\n", samples, differing);
    return differing == 0ul && samples > 0ul ? 0 : 1;
}}
"""


def _makefile(programs: Sequence[AgentProgram]) -> str:
    sources = " ".join(f"agent{program.id}.c" for program in programs)
    return (
        f"CFLAGS = {FLAGS}\n\nreplay: replay.c {sources} consensus.h consensus_guard.h\n"
        f"\t$(CC) $(CFLAGS) -o replay replay.c {sources} -lm\n\n"
        "check: replay\n\t./replay samples.txt\n\n.PHONY: check\n"
    )
