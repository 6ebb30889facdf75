"""The ``[[agent]]`` tables and the ``[initial]`` table of a plant file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

import sympy

from symbolic.errors import Where, quoted
from symbolic.expressions import Written
from symbolic.guards import AgentGuards
from symbolic.initial_file import InitialTable
from symbolic.names import Scope
from symbolic.plant import COST_VARIABLE, Agent, InternalModelChoice, symbol
from symbolic.tables import Table, Value, array, expression, integer, interval, vector

MAX_AGENTS = 1_000
MAX_ORDER = 16
MAX_ZERO_STATES = 16
MAX_PARAMETERS = 64
MAX_AGENT_CONSTANTS = 200
MAX_INTERNAL_MODEL = 64
MAX_TEXT = 5_000_000

_KEYS = (
    "ids",
    "zero_dynamics",
    "order",
    "f",
    "b",
    "cost",
    "constants",
    "uncertain",
    "steady_state",
    "zero_dynamics_lyapunov",
    "internal_model",
    "gamma",
    "observer",
)
_RANGE = re.compile(r"\s*([0-9]{1,9})\s*(?:-|\.\.)\s*([0-9]{1,9})\s*")


def read_agents(root: Table, count: int, scope: Scope) -> tuple[Agent, ...]:
    """The agents ``1 … count`` in order, each described by exactly one table."""
    where = root.at("agent")
    box = root.need("initial", "initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }")
    initial = InitialTable(Table(box, root.at("initial")))
    agents: dict[int, Agent] = {}
    length = 0
    if isinstance(root.need("agent", "[[agent]], then ids, order, f, b and cost in lines of their own"), dict):
        raise where.error("agents are given as [[agent]] tables, with two brackets")
    tables = array(root.need("agent"), where, most=count, what="tables")
    for position, entry in enumerate(tables, 1):
        table = Table(entry, where.at(position), _KEYS)
        numbers = list(_ids(table.need("ids", "ids = [1, 2]"), table.at("ids"), count))
        length += len(numbers) * _text_length(table.entries)
        if length > MAX_TEXT:
            raise where.error(f"the expressions of all agents together have more than {MAX_TEXT} characters")
        for number in numbers:
            if number in agents:
                raise table.at("ids").error(f"agent {number} is described twice")
            agents[number] = _agent(table, number, scope.with_id(number), initial)
    missing = [number for number in range(1, count + 1) if number not in agents]
    if missing:
        raise where.error(
            f"agent {missing[0]} has no [[agent]] table"
            if len(missing) == 1
            else f"agents {', '.join(map(str, missing[:5]))}{'...' if len(missing) > 5 else ''} have no [[agent]] table"
        )
    initial.check(agents.values(), scope.with_id(1))
    return tuple(agents[number] for number in sorted(agents))


def _ids(value: Value, where: Where, count: int) -> Iterator[int]:
    """The numbers in ``[1, 2]``, ``"3-5"`` or ``[1, "3-5"]``."""
    entries = [value] if isinstance(value, str) else array(value, where, most=count)
    if not entries:
        raise where.error("at least one agent is needed")
    for position, entry in enumerate(entries, 1):
        here = where.at(position) if isinstance(value, list) else where
        if not isinstance(entry, str):
            yield integer(entry, here, least=1, most=count)
            continue
        match = _RANGE.fullmatch(entry)
        if match is None:
            raise here.error(f'a range is written "3-5", found {quoted(entry)}')
        first, last = int(match[1]), int(match[2])
        if not 1 <= first <= last <= count:
            raise here.error(f"a range of agents from 1 to {count} is needed, found {quoted(entry)}")
        yield from range(first, last + 1)


def _text_length(value: Value) -> int:
    """The characters of all strings in a tree, a bound on the work that reading it takes."""
    if isinstance(value, dict):
        return sum(map(_text_length, value.values()))
    if isinstance(value, list):
        return sum(map(_text_length, value))
    return len(value) if isinstance(value, str) else 1


def _agent(table: Table, number: int, scope: Scope, initial: InitialTable) -> Agent:
    outer = scope
    order = integer(table.need("order", "order = 2"), table.at("order"), least=1, most=MAX_ORDER)
    zero = table.table("zero_dynamics")
    if len(zero.entries) > MAX_ZERO_STATES:
        raise zero.where.error(f"{len(zero.entries)} zero states, more than {MAX_ZERO_STATES}")
    for name in zero.entries:
        scope = scope.with_state(name, zero.at(name), "a zero state")
    scope = scope.with_constants(table.table("constants"), most=MAX_AGENT_CONSTANTS)
    uncertain = table.table("uncertain")
    if len(uncertain.entries) > MAX_PARAMETERS:
        raise uncertain.where.error(f"{len(uncertain.entries)} parameters, more than {MAX_PARAMETERS}")
    box = tuple(interval(value, uncertain.at(name), scope.constants) for name, value in uncertain.entries.items())
    for name in uncertain.entries:
        scope = scope.with_state(name, uncertain.at(name), "a parameter")
    reader = _AgentReader(table, order, scope)
    zero_dynamics, f, b, cost = reader.zero_dynamics(zero), reader.right_hand_side(), reader.input_gain(), reader.cost()
    return Agent(
        id=number,
        order=order,
        zero_states=tuple(symbol(name) for name in scope.zero_states),
        zero_dynamics=tuple(f0.expr for f0 in zero_dynamics),
        f=f.expr,
        b=b.expr,
        cost=cost.expr,
        parameters=tuple(symbol(name) for name in scope.parameters),
        parameter_box=box,
        initial=initial.box_of(order, scope.zero_states, outer),
        steady_state=reader.steady_state(),
        lyapunov=reader.lyapunov(),
        internal_model=reader.internal_model(),
        gamma=reader.numbers("gamma", order - 1),
        observer=reader.numbers("observer", order),
        guards=AgentGuards(tuple(f0.guards for f0 in zero_dynamics), f.guards, b.guards, cost.guards),
    )


class _AgentReader:
    """The expressions of one agent; each sees only the names that the normal form allows (theory.md section 1)."""

    def __init__(self, table: Table, order: int, scope: Scope) -> None:
        self.table = table
        self.scope = scope
        self.chain = tuple(f"x{k}" for k in range(1, order + 1))

    def read(self, key: str, *names: str, because: str) -> Written:
        return self.read_value(self.table.need(key), self.table.at(key), *names, because=because)

    def read_value(self, value: Value, where: Where, *names: str, because: str) -> Written:
        scope = self.scope
        elsewhere = {*self.chain, *scope.exosystem, *scope.zero_states, *scope.parameters, str(COST_VARIABLE)}
        refused = {name: f"{quoted(name)} may not appear here: {because}" for name in elsewhere - set(names)}
        return expression(value, where, scope.values(*names), refused)

    def zero_dynamics(self, table: Table) -> tuple[Written, ...]:
        scope = self.scope
        return tuple(
            self.read_value(
                value,
                table.at(name),
                *scope.zero_states,
                "x1",
                *scope.exosystem,
                *scope.parameters,
                because="in the normal form the zero dynamics depend on z, x1, v and the parameters only",
            )
            for name, value in table.entries.items()
        )

    def right_hand_side(self) -> Written:
        scope = self.scope
        return self.read(
            "f",
            *scope.zero_states,
            *self.chain,
            *scope.exosystem,
            *scope.parameters,
            because="f depends on z, x, v and the parameters only",
        )

    def input_gain(self) -> Written:
        return self.read("b", *self.scope.parameters, because="b depends on the parameters only")

    def cost(self) -> Written:
        return self.read("cost", str(COST_VARIABLE), because="a cost depends on s and constants only")

    def steady_state(self) -> tuple[sympy.Expr, ...] | None:
        if "steady_state" not in self.table:
            return None
        scope = self.scope
        table = self.table.table("steady_state", scope.zero_states)
        return tuple(
            self.read_value(
                table.need(name),
                table.at(name),
                str(COST_VARIABLE),
                *scope.exosystem,
                *scope.parameters,
                because="a steady state z* depends on s, v and the parameters only",
            ).expr
            for name in scope.zero_states
        )

    def lyapunov(self) -> sympy.Expr | None:
        key = "zero_dynamics_lyapunov"
        if key not in self.table:
            return None
        if not self.scope.zero_states:
            raise self.table.at(key).error("there are no zero dynamics")
        return self.read(key, *self.scope.zero_states, because="this V0 depends on z only").expr

    def internal_model(self) -> InternalModelChoice | None:
        if "internal_model" not in self.table:
            return None
        table = self.table.table("internal_model", ("M", "N"))
        rows = array(table.need("M"), table.at("M"), most=MAX_INTERNAL_MODEL, what="rows")
        if not rows:
            raise table.at("M").error("at least one row is needed")
        constants = self.scope.constants
        M = tuple(vector(row, table.at("M").at(i), constants, len(rows)) for i, row in enumerate(rows, 1))
        return InternalModelChoice(M, vector(table.need("N"), table.at("N"), constants, len(rows)))

    def numbers(self, key: str, length: int) -> tuple[Fraction, ...] | None:
        if key not in self.table:
            return None
        return vector(self.table.entries[key], self.table.at(key), self.scope.constants, length)
