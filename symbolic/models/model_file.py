"""Model files (TOML, ``consensus-model/1``): plant files whose agents are models that are not in normal form yet.

    [[agent]]
    ids      = [1, 2]
    dynamics = { theta = "omega", omega = "k*i - d*omega", i = "(u - R*i - k*omega)/L" }    # u is the input
    output   = "theta"
    initial  = { theta = [-1, 1], omega = 0, i = 0 }
    cost     = "(s - id)^2"

``constants``, ``uncertain``, ``gamma``, ``observer`` and ``internal_model`` are those of a plant file, and so are all
other tables; ``[initial]`` holds what is no agent's state. Expressions are parsed by the same allow-list.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from symbolic.agent_file import MAX_AGENT_CONSTANTS, MAX_PARAMETERS, agent_ids
from symbolic.errors import InputError, Where, quoted
from symbolic.grammar import CONSTANTS, FUNCTIONS, NAME
from symbolic.models.affine import INPUT, AffineModel
from symbolic.models.normal_form import NormalForm, normal_form
from symbolic.names import Scope
from symbolic.network_description import Described, document, reading, starting_in_own_boxes
from symbolic.plant import COST_VARIABLE, Interval, Plant, symbol
from symbolic.plant_file import KEYS as PLANT_KEYS
from symbolic.plant_file import MAX_CONSTANTS
from symbolic.tables import Table, Value, expression, interval, read_toml

SCHEMA = "consensus-model/1"
KEPT = ("constants", "gamma", "observer", "internal_model")
KEYS = ("ids", "dynamics", "output", "initial", "cost", "uncertain", *KEPT)
MAX_STATES = 12  # beyond, the algebra of a general model takes minutes
RESERVED = (*FUNCTIONS, *CONSTANTS, str(COST_VARIABLE), "id", str(INPUT))


@dataclass(frozen=True)
class ModelNetwork:
    """The plant in normal form, and for each agent's number how its coordinates arise from the model's states."""

    plant: Plant
    forms: Mapping[int, NormalForm]


def read_model(data: bytes, source: str) -> ModelNetwork:
    """The plant of a model file; ``source`` is how messages name it. Raises ``InputError`` with file and key.

    Where an agent has no normal form, or none was found, the reason is part of the message.
    """
    root = read_toml(data, Where(source))
    root.allow(PLANT_KEYS)
    if root.need("schema", f'schema = "{SCHEMA}"') != SCHEMA:
        raise InputError(f"{source}: schema: {quoted(SCHEMA)} is needed; plant files need no normal form")
    tables = [
        Table(entry, root.at("agent").at(k), KEYS)
        for k, entry in enumerate(_list(root.need("agent", "[[agent]]"), root.at("agent")), 1)
    ]
    frame = _frame(root, tables, source)
    scope = Scope().with_constants(root.table("constants"), most=MAX_CONSTANTS)
    forms: dict[int, NormalForm] = {}
    described: list[Described] = []
    for table in tables:
        for number in agent_ids(table.need("ids", "ids = [1, 2]"), table.at("ids"), len(frame.agents)):
            forms[number] = _form(table, scope.with_id(number), frame)
            kept = {key: table.entries[key] for key in KEPT if key in table}
            cost = table.need("cost", 'cost = "(s - id)^2"')
            described.append(([number], forms[number].description(cost, **kept)))
    others = {key: value for key, value in root.entries.items() if key not in ("schema", "name", "agent", "initial")}
    start = {"x": 0, "z": 0, **root.table("initial").entries}
    text = document(frame.name, {**_tables(others), "initial": start}, described)
    plant = starting_in_own_boxes(reading(text, source), described)
    return ModelNetwork(plant, forms)


def _frame(root: Table, tables: list[Table], source: str) -> Plant:
    """Everything but the models, read by the reader of plant files with integrators in their place."""
    others = {key: value for key, value in root.entries.items() if key not in ("schema", "name", "agent", "initial")}
    initial = root.need("initial", "initial = { reference = 0, observer = 0, eta = 0 }")
    given = Table(initial, root.at("initial"), ("box", "reference", "observer", "eta")).entries
    stand_in: list[Described] = []
    for table in tables:
        entries = {key: table.entries[key] for key in ("constants", "cost") if key in table}
        ids = table.need("ids", "ids = [1, 2]")
        stand_in.append(([0], {"ids": ids, "order": 1, "f": 0, "b": 1, **entries}))
    name = root.need("name", 'name = "two-motors"')
    if not isinstance(name, str):
        raise InputError(f"{source}: name: a string is needed")
    return reading(document(name, {**_tables(others), "initial": {"x": 0, **given}}, stand_in), source)


def _tables(entries: Mapping[str, Value]) -> dict[str, Mapping[str, Value]]:
    return {key: value for key, value in entries.items() if isinstance(value, dict)}


def _list(value: Value, where: Where) -> list[Value]:
    if not isinstance(value, list):
        raise InputError(f"{where.file}: {where.key}: agents are given as [[agent]] tables, with two brackets")
    return value


def _form(table: Table, scope: Scope, frame: Plant) -> NormalForm:
    try:
        return normal_form(_model(table, scope, frame))
    except InputError as error:
        if error.problems:
            raise
        number = scope.constants["id"]
        raise InputError(f"{table.where.file}: {table.where.key}: agent {number}: {error}") from None


def _model(table: Table, scope: Scope, frame: Plant) -> AffineModel:
    """The model of the agent whose number is the ``id`` of the scope."""
    scope = scope.with_constants(table.table("constants"), most=MAX_AGENT_CONSTANTS)
    disturbances = [state.name for state in frame.exosystem.states]
    dynamics = Table(table.need("dynamics", 'dynamics = { q = "v", v = "u" }'), table.at("dynamics"))
    uncertain = table.table("uncertain")
    states, parameters = list(dynamics.entries), list(uncertain.entries)
    if not 1 <= len(states) <= MAX_STATES or len(parameters) > MAX_PARAMETERS:
        where = dynamics.where if len(parameters) <= MAX_PARAMETERS else uncertain.where
        raise InputError(f"{where.file}: {where.key}: 1 to {MAX_STATES} states and at most {MAX_PARAMETERS} parameters")
    taken = {**dict.fromkeys((*RESERVED, *disturbances), ""), **dict.fromkeys(scope.constants, "")}
    for name, where in _declared(dynamics, uncertain):
        if not NAME.fullmatch(name) or name in taken:
            why = "is taken" if name in taken else "is not a name"
            raise InputError(f"{where.file}: {where.at(name).key}: {quoted(name)} {why}")
        taken[name] = ""
    seen = {**scope.constants, **{name: symbol(name) for name in (*states, *parameters, *disturbances)}}
    driven = {**seen, str(INPUT): INPUT}
    rates = [expression(value, dynamics.at(name), driven) for name, value in dynamics.entries.items()]
    output = expression(table.need("output", f'output = "{states[0]}"'), table.at("output"), seen)
    start = table.table("initial", states)
    initial = (
        tuple(interval(start.need(name, f"{name} = 0"), start.at(name), scope.constants) for name in states)
        if "initial" in table
        else ()
    )
    sides: list[Interval] = [interval(v, uncertain.at(name), scope.constants) for name, v in uncertain.entries.items()]
    return AffineModel(
        states=tuple(map(symbol, states)),
        rates=tuple(rate.expr for rate in rates),
        output=output.expr,
        parameters=tuple(map(symbol, parameters)),
        parameter_box=tuple(sides),
        disturbances=frame.exosystem.states,
        S=frame.exosystem.S,
        disturbance_box=frame.exosystem.initial,
        initial=initial,
        guards=tuple(guard for rate in rates for guard in rate.guards),
    )


def _declared(*tables: Table) -> Iterator[tuple[str, Where]]:
    for table in tables:
        for name in table.entries:
            yield name, table.where
