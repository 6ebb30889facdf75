"""The JSON Schema of plant files, made from the readers' own keys and limits, for editors that complete and check.

``python -m symbolic.schema > symbolic/plant.schema.json``. A TOML editor such as Taplo uses it if a file begins with
``#:schema PATH``. It knows keys, types and what they mean; what only the reader knows (names, expressions, lengths that
depend on ``order``) it lets pass, so that no file that is read is marked as wrong.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from symbolic import agent_file, initial_file, plant_file, requested_file
from symbolic.grammar import MAX_LENGTH, NAME
from symbolic.names import MAX_NAME
from symbolic.requested import CoordinatorChoice, Implementation, RequestedGains, Requirements, Settling

Json = dict[str, Any]
Keys = dict[str, tuple[Json, str]]

FILE = Path(__file__).with_name("plant.schema.json")
NAME_PATTERN = f"^(?=.{{1,{MAX_NAME}}}$){NAME.pattern}$"
AGENT_PATTERN = "^[1-9][0-9]*$"

EXPRESSION: Json = {"type": ["string", "number"], "minLength": 1, "maxLength": MAX_LENGTH}
INTERVAL: Json = {"anyOf": [EXPRESSION, {"type": "array", "items": EXPRESSION, "minItems": 2, "maxItems": 2}]}
BOXES: Json = {"type": "array", "items": {"type": "array", "items": EXPRESSION, "minItems": 2, "maxItems": 2}}
COMPONENTS: Json = {"anyOf": [INTERVAL, BOXES, {"type": "object", "additionalProperties": INTERVAL}]}
NUMBERS: Json = {"type": "array", "items": EXPRESSION}
MATRIX: Json = {"type": "array", "items": NUMBERS}

# what a key means and of which type it is; the readers' own lists of keys say which keys there are
_EDGE: Json = {
    "anyOf": [
        {"type": "string", "pattern": "->"},
        {"type": "array", "minItems": 2, "maxItems": 2, "items": [{"type": "string", "pattern": "->"}, EXPRESSION]},
    ]
}
_IDS: Json = {"anyOf": [{"type": "string"}, {"type": "array", "minItems": 1, "items": {"type": ["integer", "string"]}}]}
_COMPONENTS_OF = "one interval for all, one pair per component, or a table by component; box where it is silent"

INITIAL: Keys = {
    "box": (INTERVAL, "the default for all the others"),
    "z": (COMPONENTS, f"zero states: {_COMPONENTS_OF}"),
    "x": (COMPONENTS, f"chain x1 ... xn: {_COMPONENTS_OF}"),
    "eta": (INTERVAL, "every state of the internal models"),
    "observer": (COMPONENTS, f'estimates, or "measured" (the first is y(0), the others 0): {_COMPONENTS_OF}'),
    "reference": (INTERVAL, "the coordinator's reference y^r(0)"),
}
AGENT: Keys = {
    "ids": (_IDS, 'the agents that share this table: [1, 2], "3-5" or [1, "3-5"]'),
    "zero_dynamics": ({"$ref": "#/definitions/named"}, "z' = f0(z, x1, v, w), one entry per state, in this order"),
    "order": ({"type": "integer", "minimum": 1, "maximum": agent_file.MAX_ORDER}, "n: states x1 ... xn; y = x1"),
    "f": (EXPRESSION, "x_n' = f(z, x, v, w) + b u"),
    "b": (EXPRESSION, "the input gain, in the parameters only; not zero on the box W"),
    "cost": (EXPRESSION, "c(s), strictly convex; id is the agent's number"),
    "constants": ({"$ref": "#/definitions/named"}, "constants of this table alone; id may be used"),
    "uncertain": ({"$ref": "#/definitions/intervals"}, "the box W: an interval for each parameter"),
    "steady_state": ({"$ref": "#/definitions/named"}, "a suggestion for z*(s, v, w); verified, never trusted"),
    "zero_dynamics_lyapunov": (EXPRESSION, "a suggestion for V0(z); verified, never trusted"),
    "internal_model": ({"$ref": "#/definitions/internal_model"}, "M (Hurwitz) and N of the internal model"),
    "gamma": (NUMBERS, "gamma_1 ... gamma_(n-1)"),
    "observer": (NUMBERS, "c_1 ... c_n of the observer, constant coefficient first"),
}
POSITIVE: Json = {"type": ["string", "number"], "exclusiveMinimum": 0}
NOT_NEGATIVE: Json = {"type": ["string", "number"], "minimum": 0}
COORDINATOR: Keys = {
    "alpha1": (POSITIVE, "weight of the consensus term"),
    "alpha2": (POSITIVE, "weight of the integral term"),
    "gradient_gain": (POSITIVE, "kappa, the gain of the gradients; 1 is the paper's"),
    "mixing_gain": (POSITIVE, "beta, the gain with which the graph is balanced; 1 is the paper's"),
    "mixing_time": (NOT_NEGATIVE, "seconds for which the references are held at the start; 0 is the paper's"),
    "softening": (NOT_NEGATIVE, "rate of the soft start, per second; 0 for none"),
    "period": (POSITIVE, "seconds between two messages; only with [implementation]"),
}
GAINS: Keys = {
    "g": (POSITIVE, "scale of the chain"),
    "K": (POSITIVE, "gain of the feedback"),
    "delta": (POSITIVE, "level of the saturation"),
    "h": (POSITIVE, "gain of the observer"),
}
REQUIREMENTS: Keys = {
    "settling": ({"$ref": "#/definitions/settling"}, "|y - s*| <= band for all t >= time"),
    "input": (POSITIVE, "|u(t)| <= input for all t >= 0"),
    "bandwidth": (POSITIVE, "rad/s: the fastest observer pole allowed"),
    "region": (
        {"enum": list(requested_file.WORDS["region"])},
        "of the gains that meet the rest, those with the largest certified box",
    ),
}
IMPLEMENTATION: Keys = {
    "period": (POSITIVE, "seconds between two steps of the controller"),
    "delay": (INTERVAL, "seconds from sample to output, a value or an interval"),
    "noise": (NOT_NEGATIVE, "|measured - true|"),
    "input_resolution": (NOT_NEGATIVE, "step of the converter at the output"),
    "arithmetic": ({"enum": list(requested_file.WORDS["arithmetic"])}, "of the controller's code"),
}


def plant_schema() -> Json:
    """The schema as JSON. Raises ``KeyError`` for a key of a reader that has no description here."""
    network: Keys = {
        "agents": ({"type": "integer", "minimum": 1, "maximum": plant_file.MAX_AGENTS}, "how many agents there are"),
        "edges": ({"type": "array", "items": _EDGE}, '"j -> i" or ["j -> i", weight]: agent i hears agent j'),
    }
    exosystem: Keys = {
        "states": ({"type": "array", "items": {"type": "string", "pattern": NAME_PATTERN}}, "names of v"),
        "S": (MATRIX, "v' = S v; rational entries for a certificate"),
        "initial": ({"$ref": "#/definitions/intervals"}, "the set V0: a value or an interval for each state"),
    }
    settling: Keys = {"time": (NOT_NEGATIVE, "seconds"), "band": (POSITIVE, "in the unit of the output")}
    model: Keys = {"M": (MATRIX, "Hurwitz"), "N": (NUMBERS, "(M, N) controllable")}
    agent = _table(AGENT, agent_file.KEYS, needed=("ids", "order", "f", "b", "cost"))
    tables: Keys = {
        "schema": ({"const": plant_file.SCHEMA}, "the version of this format"),
        "name": ({"type": "string", "minLength": 1, "maxLength": 200}, "one line"),
        "network": (_table(network, network, needed=network), "the communication digraph"),
        "constants": ({"$ref": "#/definitions/named"}, "names usable everywhere; each may use the earlier ones"),
        "exosystem": (_table(exosystem, exosystem, needed=exosystem), "v' = S v; leave out for no disturbance"),
        "initial": (_table(INITIAL, initial_file.KEYS), "the initial box, component by component"),
        "agent": ({"type": "array", "minItems": 1, "items": agent}, "one table for each kind of agent"),
        "coordinator": (_table(COORDINATOR, requested_file.keys_of(CoordinatorChoice)), "chosen where left out"),
        "gains": (_by_agent(GAINS, RequestedGains), "certify these instead of searching; [gains.3] for agent 3"),
        "requirements": (_by_agent(REQUIREMENTS, Requirements), "what the gains must achieve, proved"),
        "implementation": (_by_agent(IMPLEMENTATION, Implementation), "the sampled controller is what is certified"),
    }
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",  # what TOML editors read
        "title": plant_file.SCHEMA,
        "description": "A network of uncertain nonlinear agents to be certified; docs/plant-file.md",
        **_table(tables, plant_file.KEYS, needed=("schema", "name", "network", "initial", "agent")),
        "definitions": {
            "named": _named(EXPRESSION),
            "intervals": _named(INTERVAL),
            "settling": _table(settling, requested_file.keys_of(Settling), needed=settling),
            "internal_model": _table(model, model, needed=model),
        },
    }


def _named(value: Json) -> Json:
    """A table whose keys are names of the user's."""
    return {"type": "object", "propertyNames": {"pattern": NAME_PATTERN}, "additionalProperties": value}


def _table(keys: Keys, known: Iterable[str], needed: Iterable[str] = ()) -> Json:
    properties = {key: {**keys[key][0], "description": keys[key][1]} for key in known}
    required = {"required": list(needed)} if needed else {}
    return {"type": "object", "properties": properties, **required, "additionalProperties": False}


def _by_agent(keys: Keys, kind: type) -> Json:
    own = _table(keys, requested_file.keys_of(kind))
    return {**own, "patternProperties": {AGENT_PATTERN: own}}


if __name__ == "__main__":
    print(json.dumps(plant_schema(), indent=1, ensure_ascii=False))
