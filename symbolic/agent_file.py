"""The ``[[agent]]`` tables and the ``[initial]`` table of a plant file."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence, Set
from fractions import Fraction
from functools import partial

import sympy

from symbolic import messages
from symbolic.errors import InputError, Where, quoted
from symbolic.expressions import Written
from symbolic.guards import AgentGuards
from symbolic.initial_file import POINT, InitialTable
from symbolic.messages import Reason
from symbolic.names import Scope
from symbolic.plant import COST_VARIABLE, Agent, InitialBox, InternalModelChoice, symbol
from symbolic.tables import Table, Value, array, expression, integer, interval, vector

MAX_AGENTS = 1_000
MAX_ORDER = 16
MAX_ZERO_STATES = 16
MAX_PARAMETERS = 64
MAX_AGENT_CONSTANTS = 200
MAX_INTERNAL_MODEL = 64
MAX_TEXT = 5_000_000

KEYS = (
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
OF_THE_FILE = ("name", "network", "exosystem", "initial", "coordinator", "gains", "requirements", "implementation")
ZERO = Written(sympy.S.Zero)
NOWHERE = InitialBox((), (), None, POINT, POINT)  # where there is no [initial], which is an error
_RANGE = re.compile(r"\s*([0-9]{1,9})\s*(?:-|\.\.)\s*([0-9]{1,9})\s*")


def read_agents(root: Table, count: int | None, scope: Scope) -> tuple[Agent, ...]:
    """The agents ``1 … count`` in order, each described by exactly one table; ``count`` may be unknown."""
    where = root.at("agent")
    before = _faults(where)
    tables = _tables(root, where, count)
    shares = _shares(tables, where, count, before)
    own = {name: messages.OWN_CONSTANT(name=name) for table in tables for name in _keys_of(table, "constants")}
    example = "initial = { box = [-1, 1], reference = 0, observer = 0, eta = 0 }"
    box = root.read("initial", example, Table, Table({}, root.at("initial")))
    initial = InitialTable(box, own.get) if "initial" in root else None
    declared = frozenset(name for table in tables for name in _declared_in(table))
    agents: dict[int, Agent | None] = {}
    for table, numbers in shares:
        whole = True  # agents that share a table share its faults
        for number in numbers:
            read = partial(_agent, table, number, scope.with_id(number), initial, declared)
            agents[number] = _attempted(where, read) if whole else None
            whole = agents[number] is not None
    known = [agent for agent in agents.values() if agent is not None]
    if initial is not None and len(known) == len(agents):
        initial.check(known, scope.with_id(1))
    return tuple(agent for _, agent in sorted(agents.items()) if agent is not None)


def _shares(tables: list[Table], where: Where, count: int | None, before: int) -> list[tuple[Table, list[int]]]:
    """The numbers of the agents of each table, each once; those that are missing are reported, unless a fault that was
    noted after the first ``before`` may be the reason."""
    shares: list[tuple[Table, list[int]]] = []
    described: set[int] = set()
    length = 0
    for table in tables:
        numbers: list[int] = table.read(
            "ids", "ids = [1, 2]", partial(agent_ids, count=count or MAX_AGENTS), list[int]()
        )
        length += len(numbers) * _text_length(table.entries)
        if length > MAX_TEXT:
            raise where.error(messages.TOO_MUCH_TEXT(most=MAX_TEXT))
        fresh: list[int] = []
        for number in numbers:
            if number in described:
                table.at("ids").report(messages.DESCRIBED_TWICE(number=number))
            else:
                described.add(number)
                fresh.append(number)
        shares.append((table, fresh))
    missing = [number for number in range(1, (count or 0) + 1) if number not in described]
    if missing and _faults(where) == before:
        listed = f"{', '.join(map(str, missing[:5]))}{'...' if len(missing) > 5 else ''}"
        one = len(missing) == 1
        where.report(messages.NO_TABLE(agents=f"agent {listed} has" if one else f"agents {listed} have"))
    return shares


def _tables(root: Table, where: Where, count: int | None) -> list[Table]:
    """The [[agent]] tables that are tables."""
    example = "[[agent]], then ids, order, f, b and cost in lines of their own"
    entries = root.read("agent", example, partial(_several, most=count or MAX_AGENTS), list[Value]())
    read = (where.at(k).attempt(partial(_table, entry, where.at(k)), None) for k, entry in enumerate(entries, 1))
    return [table for table in read if table is not None]


def _table(entry: Value, where: Where) -> Table:
    """An [[agent]] table; a key that belongs to the file as a whole is told where it stands."""
    table = Table(entry, where)
    for key in [key for key in table.entries if key in OF_THE_FILE]:
        where.report(messages.TABLE_OF_ITS_OWN(key=key), spot=table.at(key), on_key=True)
        table.entries = {other: value for other, value in table.entries.items() if other != key}
    table.allow(KEYS)
    return table


def _several(value: Value, where: Where, most: int) -> list[Value]:
    if isinstance(value, dict):
        raise where.error(messages.TWO_BRACKETS())
    return array(value, where, most=most, what="tables")


def _attempted(where: Where, read: Callable[[], Agent]) -> Agent | None:
    """The agent, or ``None`` if anything was noted on the way."""
    before = _faults(where)
    agent = where.attempt(read, None)
    return agent if _faults(where) == before else None


def _faults(where: Where) -> int:
    """How many faults are noted so far."""
    return len(where.problems.found) if where.problems else 0


def _keys_of(table: Table, key: str) -> list[str]:
    value = table.entries.get(key)
    return list(value) if isinstance(value, dict) else []


def _declared_in(table: Table) -> list[str]:
    return [name for key in ("zero_dynamics", "constants", "uncertain") for name in _keys_of(table, key)]


def agent_ids(value: Value, where: Where, count: int) -> list[int]:
    """The numbers in ``[1, 2]``, ``"3-5"`` or ``[1, "3-5"]``."""
    entries = [value] if isinstance(value, str) else array(value, where, most=count)
    if not entries:
        raise where.error(messages.NO_IDS())
    numbers: list[int] = []
    for position, entry in enumerate(entries, 1):
        here = where.at(position) if isinstance(value, list) else where
        if not isinstance(entry, str):
            numbers.append(integer(entry, here, least=1, most=count))
            continue
        match = _RANGE.fullmatch(entry)
        if match is None:
            raise here.error(messages.RANGE(found=quoted(entry)))
        first, last = int(match[1]), int(match[2])
        if not 1 <= first <= last <= count:
            raise here.error(messages.RANGE_ENDS(most=count, found=quoted(entry)))
        numbers += range(first, last + 1)
    return numbers


def _text_length(value: Value) -> int:
    """The characters of all strings in a tree, a bound on the work that reading it takes."""
    if isinstance(value, dict):
        return sum(map(_text_length, value.values()))
    if isinstance(value, list):
        return sum(map(_text_length, value))
    return len(value) if isinstance(value, str) else 1


def _agent(table: Table, number: int, scope: Scope, initial: InitialTable | None, declared: Set[str]) -> Agent:
    outer = scope
    order = table.read("order", "order = 2", partial(integer, least=1, most=MAX_ORDER), None)
    zero = table.table("zero_dynamics")
    if len(zero.entries) > MAX_ZERO_STATES:
        raise zero.where.error(messages.TOO_MANY(count=len(zero.entries), what="zero states", most=MAX_ZERO_STATES))
    for name in zero.entries:
        scope = scope.with_state(name, zero.at(name), "a zero state")
    scope = scope.with_constants(table.table("constants"), most=MAX_AGENT_CONSTANTS)
    uncertain = table.table("uncertain")
    if len(uncertain.entries) > MAX_PARAMETERS:
        count = len(uncertain.entries)
        raise uncertain.where.error(messages.TOO_MANY(count=count, what="parameters", most=MAX_PARAMETERS))
    box = tuple(
        uncertain.at(name).attempt(partial(interval, value, uncertain.at(name), scope.constants), POINT)
        for name, value in uncertain.entries.items()
    )
    for name in uncertain.entries:
        scope = scope.with_state(name, uncertain.at(name), "a parameter")
    if any(not isinstance(table.entries.get(key, {}), dict) for key in ("zero_dynamics", "constants", "uncertain")):
        raise InputError  # noted already; without their names the expressions make no sense
    reader = _AgentReader(table, order, scope, declared)
    zero_dynamics, f, b, cost = reader.zero_dynamics(zero), reader.right_hand_side(), reader.input_gain(), reader.cost()
    return Agent(
        id=number,
        order=order or 1,
        zero_states=tuple(symbol(name) for name in scope.zero_states),
        zero_dynamics=tuple(f0.expr for f0 in zero_dynamics),
        f=f.expr,
        b=b.expr,
        cost=cost.expr,
        parameters=tuple(symbol(name) for name in scope.parameters),
        parameter_box=box,
        initial=initial.box_of(order, scope.zero_states, outer) if initial else NOWHERE,
        steady_state=reader.steady_state(),
        lyapunov=reader.lyapunov(),
        internal_model=reader.internal_model(),
        gamma=reader.numbers("gamma", None if order is None else order - 1),
        observer=reader.numbers("observer", order),
        guards=AgentGuards(tuple(f0.guards for f0 in zero_dynamics), f.guards, b.guards, cost.guards),
    )


class _AgentReader:
    """The expressions of one agent; each sees only the names that the normal form allows (theory.md section 1)."""

    def __init__(self, table: Table, order: int | None, scope: Scope, declared: Set[str]) -> None:
        """``order`` is None if it could not be read: then any chain is allowed; ``declared`` in any table."""
        self.table = table
        self.scope = scope
        self.order = order
        self.chain = _chain(order or MAX_ORDER)
        self.declared = declared

    def read(self, key: str, example: str, *names: str, because: str) -> Written:
        return self.table.read(key, example, partial(self.expression, names=names, because=because), ZERO)

    def expression(self, value: Value, where: Where, names: Sequence[str], because: str) -> Written:
        return expression(value, where, self.scope.values(*names), partial(self.refused, names, because))

    def refused(self, names: Sequence[str], because: str, name: str) -> Reason | None:
        """Why a name that means something elsewhere may not appear in an expression of the ``names``."""
        scope, chain = self.scope, _chain(MAX_ORDER)
        if self.order is not None and self.chain[-1] in names and name in chain[self.order :]:
            states = ", ".join(self.chain)
            return messages.HIGHER_STATE(name=name, order=self.order, next=self.order + 1, chain=states)
        if name in (*chain, *scope.exosystem, *scope.zero_states, *scope.parameters, str(COST_VARIABLE)):
            return messages.NOT_HERE(name=quoted(name), because=because)
        special = {"u": messages.INPUT_IN_F, "y": messages.OUTPUT, "t": messages.TIME}.get(name)
        if special is not None:
            return special()
        return messages.OTHER_AGENTS(name=name) if name in self.declared else None

    def zero_dynamics(self, table: Table) -> tuple[Written, ...]:
        scope = self.scope
        names = (*scope.zero_states, "x1", *scope.exosystem, *scope.parameters)
        because = "in the normal form the zero dynamics depend on z, x1, v and the parameters only"
        read = partial(self.expression, names=names, because=because)
        return tuple(table.read(name, "", read, ZERO) for name in table.entries)

    def right_hand_side(self) -> Written:
        scope = self.scope
        return self.read(
            "f",
            'f = "p*x1"',
            *scope.zero_states,
            *self.chain,
            *scope.exosystem,
            *scope.parameters,
            because="f depends on z, x, v and the parameters only",
        )

    def input_gain(self) -> Written:
        return self.read("b", "b = 1", *self.scope.parameters, because="b depends on the parameters only")

    def cost(self) -> Written:
        because = "a cost depends on s and constants only"
        return self.read("cost", 'cost = "(s - id)^2"', str(COST_VARIABLE), because=because)

    def steady_state(self) -> tuple[sympy.Expr, ...] | None:
        if "steady_state" not in self.table:
            return None
        scope = self.scope
        table = self.table.table("steady_state", scope.zero_states)
        because = "a steady state z* depends on s, v and the parameters only"
        names = (str(COST_VARIABLE), *scope.exosystem, *scope.parameters)
        read = partial(self.expression, names=names, because=because)
        return tuple(table.read(name, f'{name} = "s"', read, ZERO).expr for name in scope.zero_states)

    def lyapunov(self) -> sympy.Expr | None:
        key = "zero_dynamics_lyapunov"
        if key not in self.table:
            return None
        if not self.scope.zero_states:
            self.table.at(key).report(messages.NO_ZERO_DYNAMICS(), on_key=True)
            return None
        return self.read(key, "", *self.scope.zero_states, because="this V0 depends on z only").expr

    def internal_model(self) -> InternalModelChoice | None:
        key, example = "internal_model", "internal_model = { M = [[-1]], N = [1] }"
        return self.table.read(key, example, self._pair, None) if key in self.table else None

    def _pair(self, value: Value, where: Where) -> InternalModelChoice:
        table, constants = Table(value, where, ("M", "N")), self.scope.constants
        most = partial(array, most=MAX_INTERNAL_MODEL, what="rows")
        rows = most(table.need("M", "M = [[0, 1], [-2, -3]]"), table.at("M"))
        if not rows:
            raise table.at("M").error(messages.NO_ROWS())
        M = tuple(vector(row, table.at("M").at(i), constants, len(rows)) for i, row in enumerate(rows, 1))
        return InternalModelChoice(M, vector(table.need("N", "N = [0, 1]"), table.at("N"), constants, len(rows)))

    def numbers(self, key: str, length: int | None) -> tuple[Fraction, ...] | None:
        if key not in self.table:
            return None
        read = partial(vector, constants=self.scope.constants, length=length)
        return self.table.read(key, "", read, None)


def _chain(order: int) -> tuple[str, ...]:
    return tuple(f"x{k}" for k in range(1, order + 1))
