"""Plants written as plant files: the inverse of ``symbolic.plant_file``.

What is written is read again before it is handed out, so that a text that says anything else is never seen.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from fractions import Fraction
from typing import Any

import sympy

from symbolic.constants import as_fraction
from symbolic.errors import InputError
from symbolic.expression_text import expression_text, float_value, number_text
from symbolic.guards import Guard, guards
from symbolic.plant import Agent, Digraph, Exosystem, Interval, Plant, Settling, symbol
from symbolic.plant_file import SCHEMA, parse_plant

Row = Mapping[str, str]


def write_plant(plant: Plant) -> str:
    """A plant file that reads back as this plant, digest aside: the values alone, without comments or constants.

    Raises ``InputError`` for a plant that no file describes, such as one whose boxes of agents differ too wildly.
    """
    text = _text(plant)
    back = parse_plant(text.encode(), plant.name)
    different = _difference(plant, back)
    if different:
        raise InputError(f"{plant.name}: {different}: a plant file cannot say this")
    return text


def with_source(plant: Plant) -> Plant:
    """The plant with the bytes that a certificate can be bound to: those that it was read from while they still say
    the same, else those of ``write_plant``. Raises ``InputError``."""
    if plant.source and not _difference(plant, parse_plant(plant.source, plant.name)):
        return plant
    return parse_plant(write_plant(plant).encode(), plant.name)


def _difference(plant: Plant, back: Plant) -> str:
    """The first field in which the two differ, other than the digest; empty if there is none."""
    agents = tuple(map(_evaluated, plant.agents))
    plant = replace(plant, agents=agents, gains=_stated(plant.gains), requirements=_stated(plant.requirements))
    for part in fields(Plant):
        if part.compare and part.name != "sha256":
            mine, theirs = getattr(plant, part.name), getattr(back, part.name)
            if part.name == "agents" and len(mine) == len(theirs):
                theirs = tuple(map(_with_guards_of, theirs, mine))
            if mine != theirs:
                return f"{part.name}{_place(mine, theirs)}"
    return ""


def _with_guards_of(back: Agent, agent: Agent) -> Agent:
    """The agent that was read back with the guards of the other one, provided it has them all.

    It may have more: those that SymPy's form of an expression brings along, which are implied.
    """
    pairs = zip(_guarded(agent), _guarded(back), strict=True)
    kept = all(not _missing(written, expr, extra) for (expr, written), (_, extra) in pairs)
    return replace(back, guards=agent.guards) if kept else back


def _guarded(agent: Agent) -> list[tuple[sympy.Expr, tuple[Guard, ...]]]:
    """The expressions of an agent that have guards, with those of their texts."""
    rates = [(rate, agent.guards.of_zero_dynamics(k)) for k, rate in enumerate(agent.zero_dynamics)]
    return [*rates, (agent.f, agent.guards.f), (agent.b, agent.guards.b), (agent.cost, agent.guards.cost)]


def _missing(written: Iterable[Guard], expr: sympy.Expr, known: Iterable[Guard] = ()) -> list[Guard]:
    """The guards of a text that neither the expression itself has nor are ``known``."""
    has = {(guard.expression, guard.need) for guard in (*guards(expr), *known)}
    return [guard for guard in written if (guard.expression, guard.need) not in has]


def _evaluated(agent: Agent) -> Agent:
    """The agent with its expressions as SymPy evaluates them, in symbols that are real."""
    values = {part.name: getattr(agent, part.name) for part in fields(Agent)}
    return replace(agent, **{key: _rebuilt(value) for key, value in values.items() if _is_symbolic(value)})


def _is_symbolic(value: Any) -> bool:
    return isinstance(value, sympy.Basic) or (isinstance(value, tuple) and any(map(_is_symbolic, value)))


def _rebuilt(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_rebuilt, value))
    if isinstance(value, sympy.Symbol):
        return symbol(value.name)
    if isinstance(value, sympy.Float):
        return float_value(value)
    return value.func(*map(_rebuilt, value.args)) if value.args else value


def _place(mine: Any, theirs: Any) -> str:
    if not isinstance(mine, tuple) or len(mine) != len(theirs):
        return ""
    index = next(k for k, (left, right) in enumerate(zip(mine, theirs, strict=True), 1) if left != right)
    names = [part.name for part in fields(mine[index - 1])] if hasattr(mine[index - 1], "__dataclass_fields__") else []
    keys = [name for name in names if getattr(mine[index - 1], name) != getattr(theirs[index - 1], name, None)]
    return f"[{index}]" + (f".{keys[0]}" if keys else "")


def _stated(entries: tuple[Any, ...]) -> tuple[Any, ...]:
    """A file that asks for nothing of a kind has no entries of it."""
    return entries if any(_given(entry) for entry in entries) else ()


def _text(plant: Plant) -> str:
    blocks = [
        [f'schema = "{SCHEMA}"', f"name   = {_string(plant.name)}"],
        _network(plant.digraph),
        _exosystem(plant.exosystem),
        _initial(plant.agents),
        *(_agent(ids, agent) for ids, agent in _same(plant.agents)),
        _table("coordinator", {key: number_text(value) for key, value in _given(plant.coordinator).items()}),
        *_by_agent("gains", plant.gains),
        *_by_agent("requirements", plant.requirements),
        *_by_agent("implementation", plant.implementations),
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block) + "\n"


def _network(digraph: Digraph) -> list[str]:
    edges = []
    for edge in digraph.edges:
        arrow = f'"{edge.source} -> {edge.target}"'
        edges.append(arrow if edge.weight == 1 else f"[{arrow}, {number_text(edge.weight)}]")
    return ["[network]", f"agents = {digraph.agents}", f"edges  = {_array(edges)}"]


def _exosystem(exosystem: Exosystem) -> list[str]:
    if not exosystem.states:
        return []
    names = [state.name for state in exosystem.states]
    rows = [_array(map(_constant, row)) for row in exosystem.S.tolist()]
    initial = dict(zip(names, map(_interval, exosystem.initial), strict=True))
    states = _array(f'"{name}"' for name in names)
    return ["[exosystem]", f"states  = {states}", f"S       = {_array(rows)}", f"initial = {_inline(initial)}"]


def _initial(agents: Sequence[Agent]) -> list[str]:
    """The boxes of all agents in one table, which agents that differ share as polynomials in ``id``."""
    zero = sorted({state.name for agent in agents for state in agent.zero_states})
    longest = max(agents, key=lambda agent: agent.order)
    chain = [state.name for state in longest.chain]
    boxes = {agent.id: agent.initial for agent in agents}
    z = {
        name: {
            agent.id: agent.initial.z[[state.name for state in agent.zero_states].index(name)]
            for agent in agents
            if name in [state.name for state in agent.zero_states]
        }
        for name in zero
    }
    x = {name: {i: box.x[k] for i, box in boxes.items() if k < len(box.x)} for k, name in enumerate(chain)}
    observers = {i: box.observer for i, box in boxes.items() if box.observer is not None}
    guessed = {name: {i: start[k] for i, start in observers.items() if k < len(start)} for k, name in enumerate(chain)}
    rows = {"z": _components(z)} if zero else {}
    rows["x"] = _components(x)
    rows["reference"] = _shared({i: box.reference for i, box in boxes.items()})
    rows["observer"] = _components(guessed) if observers else '"measured"'
    rows["eta"] = _shared({i: box.eta for i, box in boxes.items()})
    return _table("initial", rows)


def _components(names: Mapping[str, Mapping[int, Interval]]) -> str:
    entries = {name: _shared(values) for name, values in names.items() if values}
    same = set(entries.values())
    return next(iter(same)) if len(same) == 1 else _inline(entries)


def _shared(values: Mapping[int, Interval]) -> str:
    """The interval of all these agents, each end a polynomial in ``id`` where they differ."""
    low = _in_id({i: value.lo for i, value in values.items()})
    high = _in_id({i: value.hi for i, value in values.items()})
    return low if low == high else f"[{low}, {high}]"


def _in_id(values: Mapping[int, Fraction]) -> str:
    if len(set(values.values())) == 1:
        return number_text(next(iter(values.values())))
    variable = sympy.Symbol("id")
    points = [(number, sympy.Rational(value.numerator, value.denominator)) for number, value in values.items()]
    return _string(expression_text(sympy.interpolate(points, variable)))


def _same(agents: Iterable[Agent]) -> list[tuple[list[int], Agent]]:
    """Agents that differ in their number and their initial box alone share a table."""
    groups: dict[Agent, tuple[list[int], Agent]] = {}
    for agent in agents:
        box = replace(agent.initial, z=(), x=(), observer=None, eta=_ORIGIN, reference=_ORIGIN)
        groups.setdefault(replace(agent, id=0, initial=box), ([], agent))[0].append(agent.id)
    return list(groups.values())


_ORIGIN = Interval(Fraction(0), Fraction(0))


def _agent(ids: Sequence[int], agent: Agent) -> list[str]:
    zero = [state.name for state in agent.zero_states]
    lines = {"ids": _array(map(str, ids))}
    *rates, f, b, cost = (_expression(expr, written) for expr, written in _guarded(agent))
    if zero:
        lines["zero_dynamics"] = _inline(dict(zip(zero, rates, strict=True)))
    lines |= {"order": str(agent.order), "f": f, "b": b, "cost": cost}
    if agent.parameters:
        names = [parameter.name for parameter in agent.parameters]
        lines["uncertain"] = _inline(dict(zip(names, map(_interval, agent.parameter_box), strict=True)))
    if agent.steady_state is not None:
        lines["steady_state"] = _inline(dict(zip(zero, map(_expression, agent.steady_state), strict=True)))
    if agent.lyapunov is not None:
        lines["zero_dynamics_lyapunov"] = _expression(agent.lyapunov)
    if agent.internal_model is not None:
        M = _array(_array(map(number_text, row)) for row in agent.internal_model.M)
        lines["internal_model"] = _inline({"M": M, "N": _array(map(number_text, agent.internal_model.N))})
    if agent.gamma is not None:
        lines["gamma"] = _array(map(number_text, agent.gamma))
    if agent.observer is not None:
        lines["observer"] = _array(map(number_text, agent.observer))
    return ["[[agent]]", *_assignments(lines)]


def _by_agent(title: str, entries: Sequence[Any]) -> list[list[str]]:
    """What all agents share in one table, what each has for itself in a table under its number."""
    rows = [{key: _asked(value) for key, value in _given(entry).items()} for entry in entries]
    if not any(rows):
        return []
    common = {key: text for key, text in rows[0].items() if all(row.get(key) == text for row in rows)}
    own = [{key: text for key, text in row.items() if key not in common} for row in rows]
    blocks = [_table(title, common)] + [_table(f"{title}.{i}", row) for i, row in enumerate(own, 1)]
    return [block for block in blocks if block]


def _given(entry: Any) -> dict[str, Any]:
    """The fields of a dataclass that are not ``None``."""
    values = {part.name: getattr(entry, part.name) for part in fields(entry)}
    return {key: value for key, value in values.items() if value is not None}


def _asked(value: Any) -> str:
    if isinstance(value, Settling):
        return _inline({"time": number_text(value.time), "band": number_text(value.band)})
    if isinstance(value, Interval):
        return _interval(value)
    return _string(value) if isinstance(value, str) else number_text(value)


def _interval(value: Interval) -> str:
    return number_text(value.lo) if value.is_point else _array(map(number_text, (value.lo, value.hi)))


def _constant(value: sympy.Expr) -> str:
    return number_text(as_fraction(value)) if value.is_Rational else _expression(value)


def _expression(expr: sympy.Expr, written: Iterable[Guard] = ()) -> str:
    """The expression as TOML, with a vanishing term for every guard that SymPy has cancelled: ``s**3/s`` is
    ``s**2 + 0/(s)``, which is not defined at 0 either."""
    lost = "".join(
        f" + 0/({expression_text(guard.expression)})"
        if guard.need == "nonzero"
        else f" + 0*log({expression_text(guard.expression)})"
        for guard in _missing(written, expr)
    )
    if expr.is_Rational and not lost:
        return number_text(as_fraction(expr))
    return _string(expression_text(expr) + lost)


def _table(title: str, rows: Row) -> list[str]:
    return [f"[{title}]", *_assignments(rows)] if rows else []


def _assignments(rows: Row) -> list[str]:
    width = max(map(len, rows))
    return [f"{key:<{width}} = {value}" for key, value in rows.items()]


def _inline(rows: Row) -> str:
    return "{ " + ", ".join(f"{key} = {value}" for key, value in rows.items()) + " }"


def _array(entries: Iterable[str]) -> str:
    return f"[{', '.join(entries)}]"


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
