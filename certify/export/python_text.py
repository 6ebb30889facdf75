"""The programs of the agents as Python without dependencies, equal to the C bit by bit (docs/export.md, Python)."""

from __future__ import annotations

import ast
from collections.abc import Sequence

from certify.export.agent_program import AgentProgram
from certify.export.formats import DOUBLE, Constant, Format
from certify.export.statements import Clamp, Let, Quantise, Statement


def python_files(programs: Sequence[AgentProgram], digest: str, notice: Sequence[str]) -> dict[str, str]:
    """``agent<id>.py`` for each agent."""
    return {f"agent{program.id}.py": agent_module(program, digest, notice) for program in programs}


def agent_module(program: AgentProgram, digest: str, notice: Sequence[str]) -> str:
    network = program.coordinator
    single = program.format is not DOUBLE
    constants = [*program.constants, *(state.start for state in program.states), *network.constants]
    constants += [*network.slope_constants, program.reference]
    said = "\n".join(notice)
    return "\n".join(
        [
            f'"""Agent {program.id} of a certified controller: the same steps as agent{program.id}.c, bit by bit.',
            "",
            f"Claim (sha256): {digest}",
            "",
            said,
            '"""',
            "",
            "import ctypes" if single else "",
            "from math import atan, copysign, cos, cosh, exp, log, sin, sinh, sqrt, tan, tanh  # noqa: F401",
            "",
            f'CLAIM = "{digest}"',
            f"AGENT, AGENTS, HISTORY = {program.id}, {network.agents}, {network.history}",
            f"PERIOD, SUBSTEPS = {float(program.period)!r}, {program.substeps}  # {program.period}",
            f"HOLD, MIXED = {network.hold}, {network.mixing}",
            f"NEIGHBOURS = {network.neighbours!r}",
            f"WEIGHT = ({''.join(f'float.fromhex({c.hexadecimal!r}), ' for c in network.weights)})",
            *map(_constant, constants),
            "",
            "",
            *(["def _f(value):", "    return ctypes.c_float(value).value", "", ""] if single else []),
            "def slope_of_cost(s):",
            *(f"    {let.name} = {let.expression}" for let in network.slope[:-1]),
            f"    return {network.slope[-1].expression}",
            "",
            "",
            *_class(program),
            "",
        ]
    )


def _constant(c: Constant) -> str:
    return f'{c.name} = float.fromhex("{c.hexadecimal}")  # {c.meaning}: {c.number:.9g}'


def _class(program: AgentProgram) -> list[str]:
    network, format = program.coordinator, program.format
    names = [state.name for state in program.states]
    rounded = "_f({})" if format is not DOUBLE else "{}"
    starts = [f"        self.{state.name} = {state.start.name}" for state in program.states]
    if program.measured:
        starts = ["        self.x1 = " + rounded.format("y") if "self.x1 " in line else line for line in starts]
    loads = [f"        {name} = self.{name}" for name in names]
    stores = [f"        self.{name} = next_{name}" for name in names]
    due = "self.substep + 1" if program.ahead else "self.substep"
    gradient = "slope_of_cost(y)"
    if network.soft:
        gradient += f" - self.soft * slope_of_cost({program.reference.name})"
    step = [f"        {_statement(statement, format)}" for statement in program.step]
    missed = [f"        {_statement(statement, format)}" for statement in program.missed]
    corrections = [
        f"        self.{key} = {_rounded(f'self.{key} + {gain} * missed', format)}"
        for key, gain in program.corrections.items()
    ]
    count = ["        if self.substep < SUBSTEPS:", "            self.substep += 1"]
    return [
        "class Agent:",
        f'    """The controller of agent {program.id}; see consensus.h for what is called when."""',
        "",
        "    def __init__(self, y):",
        *starts,
        "        self.written = 0.0",
        f"        self.y_now = self.y_next = {program.reference.name}",
        "        self.substep, self.stamp, self.newest = SUBSTEPS, 0, 0",
        "        self.ramp = self.omega = self.xi = 0.0",
        *(["        self.soft = 1.0"] if network.soft else []),
        "        self.mixing = [0.0] * AGENTS",
        "        self.running = {AGENT}",
        "        self.heard = {}",
        "        self.past = [(0.0, [0.0] * AGENTS)] * HISTORY",
        "",
        "    def message(self):",
        "        return AGENT, self.stamp, self.y_next, self.omega, tuple(self.mixing), frozenset(self.running)",
        "",
        "    def receive(self, message):",
        "        sender, stamp, y, omega, mixing, running = message",
        "        if sender not in NEIGHBOURS:",
        "            return False",
        "        self.running |= running",
        "        known = self.heard.get(sender)",
        "        if self.newest < stamp < self.stamp + HISTORY:",
        "            self.newest = stamp",
        "        if self.stamp == 0 and known is None:",
        "            self.heard[sender] = (0, y, 0.0, [0.0] * AGENTS)  # the sums of round 0 are zero everywhere",
        "            return True",
        "        if stamp > self.stamp or self.stamp - stamp >= HISTORY:",
        "            return False",
        "        if known is not None and stamp <= known[0]:",
        "            return False",
        "        past_omega, past_mixing = self.past[stamp % HISTORY]",
        "        differences = [own - other for own, other in zip(past_mixing, mixing)]",
        "        self.heard[sender] = (stamp, y, past_omega - omega, differences)",
        "        return True",
        "",
        "    def coordinate(self):",
        "        self.y_now, self.ramp, self.substep = self.y_next, 0.0, 0",
        "        if len(self.running) < AGENTS or len(self.heard) < len(NEIGHBOURS):",
        "            return False",
        "        self._round()",
        "        while self.stamp <= self.newest:",
        "            self._round()",
        f"        self.ramp = (self.y_next - self.y_now) / {program.substeps}.0",
        "        return True",
        "",
        "    def _round(self):",
        "        y, rate, own = self.y_next, 0.0, 0.0",
        "        heard = [self.heard[j] for j in NEIGHBOURS]",
        "        if self.stamp < MIXED:",
        "            for weight, (_, _, _, mixing) in zip(WEIGHT, heard):",
        "                own = own + weight * mixing[AGENT - 1]",
        "            self.xi = 1.0 - BETA * own",
        "            for k in range(AGENTS):",
        "                mixed = 0.0",
        "                for weight, (_, _, _, mixing) in zip(WEIGHT, heard):",
        "                    mixed = mixed + weight * mixing[k]",
        "                self.mixing[k] = self.mixing[k] + ROUND * ((1.0 if k == AGENT - 1 else 0.0) - BETA * mixed)",
        "        if self.stamp >= HOLD:",
        f"            gradient = {gradient}",
        "            spread = integral = 0.0",
        "            for weight, (_, other, omega, _) in zip(WEIGHT, heard):",
        "                spread = spread + weight * (y - other)",
        "                integral = integral + weight * omega",
        "            rate = -(KAPPA * gradient / self.xi) - ALPHA1 * spread - ALPHA2 * (ALPHA1 * integral)",
        "            self.omega = self.omega + ROUND * y",
        *(["            self.soft = self.soft * SOFTER"] if network.soft else []),
        "        self.y_next = y + ROUND * rate",
        "        self.stamp += 1",
        "        self.past[self.stamp % HISTORY] = (self.omega, list(self.mixing))",
        "",
        "    def reference_at(self, substep):",
        "        return self.y_now + float(substep) * self.ramp if substep < SUBSTEPS else self.y_next",
        "",
        "    def step(self, y):",
        *([f"        y = {rounded.format('y')}"] if format is not DOUBLE else []),
        f"        reference = {rounded.format(f'self.reference_at({due})')}",
        *loads,
        *step,
        *stores,
        "        self.written = written",
        *count,
        "        return written",
        "",
        "    def missed(self):",
        *(["        written = self.written"] if program.corrections else []),
        *loads,
        *missed,
        *(stores if missed else []),
        *count,
        "",
        "    def wrote(self, written):",
        *([f"        written = {rounded.format('written')}"] if format is not DOUBLE else []),
        *([f"        missed = {_rounded('written - self.written', format)}", *corrections] if corrections else []),
        "        self.written = written",
    ]


def _statement(statement: Statement, format: Format) -> str:
    note = f"  # {statement.meaning}" if statement.meaning else ""
    if isinstance(statement, Let):
        return f"{statement.name} = {_rounded(statement.expression, format)}{note}"
    source = statement.source
    if isinstance(statement, Quantise):
        quotient = _rounded(f"{source} / {statement.step}", format)
        whole = f"copysign(float(round({quotient})), {quotient})"  # as rint: ties to even, and −0 stays −0
        product = f"{whole} * {statement.step}"
        return f"{statement.name} = {product if format is DOUBLE else f'_f({product})'}{note}"
    assert isinstance(statement, Clamp)
    bound = statement.bound
    return (
        f"{statement.name} = {bound} if {source} > {bound} else (-{bound} if {source} < -{bound} else {source}){note}"
    )


def _rounded(expression: str, format: Format) -> str:
    """Every operation in double and then rounded to single, which is the operation in single (53 ≥ 2·24 + 2 bits)."""
    if format is DOUBLE:
        return expression
    return ast.unparse(_Rounding().visit(ast.parse(expression, mode="eval")))


class _Rounding(ast.NodeTransformer):
    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        return ast.Call(ast.Name("_f", ast.Load()), [node], [])
