"""A counterexample as a file that can be replayed: exact start, parameters and gains, and what was seen."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, get_args

import numpy as np

from sims.agent_loop import AgentLoop, agent_loop, upper_layer
from sims.bounds import SignalBound, margin
from sims.fate import BROKEN, Fate, amplitudes, judge, windows
from sims.search_space import AgentPoint, Box, Point, SharedPoint, agent_box
from symbolic.controller import Controller
from symbolic.errors import InputError
from symbolic.plant import Plant

SCHEMA = "consensus-witness/1"
_EXACT = re.compile(r"-?[0-9]{1,4000}(/[0-9]{1,4000})?")
_KEYS = set("schema plant_sha256 gains agent fate horizon tolerance shared start bounds seen".split())
_PARTS = ("parameters", "z", "x", "observer", "eta")


@dataclass(frozen=True)
class Witness:
    """Agent ``agent`` of the plant with this digest, from ``point`` with the upper layer from ``shared``, does not do
    what is claimed within ``horizon`` seconds: ``fate`` is one of ``sims.fate.BROKEN`` or ``bound``.

    ``gains`` are ``α1, α2, g, K, δ, h`` as exact text, so that a witness is not replayed with another controller.
    ``seen`` says in floats what the run showed: the instant of escape, or the largest error in the last windows.
    """

    plant_sha256: str
    gains: tuple[tuple[str, str], ...]
    agent: int
    fate: str
    horizon: Fraction
    tolerance: Fraction
    shared: SharedPoint
    point: AgentPoint
    seen: tuple[tuple[str, str], ...]
    bounds: tuple[SignalBound, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Only strings, lists and dictionaries; exact numbers as ``p`` or ``p/q``."""
        return {
            "schema": SCHEMA,
            "plant_sha256": self.plant_sha256,
            "gains": dict(self.gains),
            "agent": str(self.agent),
            "fate": self.fate,
            "horizon": str(self.horizon),
            "tolerance": str(self.tolerance),
            "shared": {"v": _texts(self.shared.v), "reference": _texts(self.shared.reference)},
            "start": {name: _texts(getattr(self.point, name)) for name in _PARTS},
            "bounds": [
                {"signal": bound.signal, "times": _texts(bound.times), "values": _texts(bound.values)}
                for bound in self.bounds
            ],
            "seen": dict(self.seen),
        }

    def text(self) -> str:
        """The file's content."""
        return json.dumps(self.to_json(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"


@dataclass(frozen=True)
class Replay:
    """How the replayed run ended: ``broken`` says whether it is a counterexample; ``reason`` tells it in words.

    ``amplitudes`` are the largest ``|y − s*|`` in the windows at the end; ``margin`` that of the bounds (1 without).
    """

    fate: str
    broken: bool
    reason: str
    end: float
    amplitudes: tuple[float, ...]
    margin: float


def read_witness(text: str, source: str = "witness") -> Witness:
    """Raises ``InputError`` for anything but a witness of this schema."""
    try:
        data = json.loads(text)
        if not isinstance(data, dict) or data.get("schema") != SCHEMA:
            raise InputError(f"{source}: schema: only {SCHEMA} is known")
        if set(data) != _KEYS:
            raise InputError(f"{source}: keys: {', '.join(sorted(set(data) ^ _KEYS))} missing or unknown")
        agent = int(_number(data["agent"]))
        start, shared = data["start"], data["shared"]
        return Witness(
            plant_sha256=str(data["plant_sha256"]),
            gains=_pairs(data["gains"]),
            agent=agent,
            fate=str(data["fate"]),
            horizon=_number(data["horizon"]),
            tolerance=_number(data["tolerance"]),
            shared=SharedPoint(_point(shared["v"]), _point(shared["reference"])),
            point=AgentPoint(*(_point(start[name]) for name in _PARTS)),
            seen=_pairs(data["seen"]),
            bounds=tuple(
                SignalBound(agent, str(b["signal"]), _point(b["times"]), _point(b["values"])) for b in data["bounds"]
            ),
        )
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{source}: not of the documented shape ({type(error).__name__}: {error})") from error


def replay(
    plant: Plant, controller: Controller, witness: Witness, *, rtol: float = 1e-9, atol: float = 1e-11
) -> Replay:
    """Run the witness anew by LSODA, an integrator that had no part in finding it.

    Raises ``InputError`` when the witness is about another plant or other gains, or starts outside the claim's set.
    """
    if witness.plant_sha256 != plant.sha256:
        raise InputError("the witness is about another plant file")
    if not 1 <= witness.agent <= len(plant.agents):
        raise InputError(f"the witness is about agent {witness.agent}, which the plant does not have")
    if dict(witness.gains) != dict(gains_of(controller, witness.agent)):
        raise InputError("the witness is about other gains")
    loop = agent_loop(plant, controller, witness.agent)
    _require_inside(loop, witness)
    return run_reference(loop, witness.shared, witness.point, witness, rtol, atol)


def run_reference(
    loop: AgentLoop, shared: SharedPoint, point: AgentPoint, witness: Witness, rtol: float = 1e-9, atol: float = 1e-11
) -> Replay:
    """:func:`replay` without its checks."""
    horizon = float(witness.horizon)
    frame = windows(loop.plant, horizon)
    early = np.linspace(0.0, horizon, 4001) if witness.bounds else np.zeros(0)
    times = np.union1d(early, frame.times)
    layer = upper_layer(loop.plant, loop.controller, shared, horizon, rtol / 10, atol / 10)
    solution = loop.reference_run(layer, point, times, rtol, atol)
    closeness = float(margin(witness.bounds, loop.agent, solution.states[: loop.plant_states], times, loop.optimum))
    error = solution.states[loop.output_row][np.searchsorted(times, frame.times)] - loop.optimum
    sizes = tuple(float(size) for size in amplitudes(error, frame))
    fate: str = solution.status
    if fate == "completed":
        fate = judge(error, frame, float(witness.tolerance), strict=True)
    if closeness < 0 and fate not in BROKEN:
        fate = "bound"
    return Replay(
        fate=fate,
        broken=fate in (*BROKEN, "bound"),
        reason=_sentence(loop, fate, solution.end, sizes, closeness, solution.reason),
        end=solution.end,
        amplitudes=sizes,
        margin=closeness,
    )


def gains_of(controller: Controller, number: int) -> tuple[tuple[str, str], ...]:
    """The coordinator's constants and the gains of agent ``number`` as exact text."""
    law = controller.agents[number - 1]
    gains = {"g": law.g, "K": law.K, "delta": law.delta, "h": "none" if law.h is None else law.h}
    named = {**controller.coordinator.named, **gains}
    return _pairs(named)


def _sentence(loop: AgentLoop, fate: str, end: float, sizes: Sequence[float], closeness: float, reason: str) -> str:
    who = f"agent {loop.agent.id}"
    last = sizes[-1]
    texts: Mapping[str, str] = {
        "escaped": f"{who} escapes at t = {end:.6g} s: {reason}",
        "oscillates": f"{who} ends in an oscillation of |y - s*| up to {last:.3g} that does not decay",
        "offset": f"{who} stays {last:.3g} away from s*",
        "grows": f"{who}: |y - s*| grows and reaches {last:.3g}",
        "bound": f"{who} leaves a bound: |signal| is {1 - closeness:.6g} times the bound",
        "converged": f"{who} converges: |y - s*| is at most {last:.3g} at the end",
        "slow": f"{who} still converges at the end: |y - s*| is {last:.3g} and falls",
        "failed": f"{who} cannot be integrated: {reason}",
    }
    return texts[fate]


def _require_inside(loop: AgentLoop, witness: Witness) -> None:
    plant, point = loop.plant, witness.point
    if witness.fate not in (*get_args(Fate), "bound"):
        raise InputError(f"the witness has the unknown fate {witness.fate!r}")
    box = agent_box(loop.agent, loop.law)
    given = loop.agent.order > 1 and loop.agent.initial.observer is not None
    values = (*point.parameters, *point.z, *point.x, *(point.observer if given else ()), *point.eta)
    shared = Box((*plant.exosystem.initial, *(agent.initial.reference for agent in plant.agents)))
    if not box.contains(values) or not shared.contains((*witness.shared.v, *witness.shared.reference)):
        raise InputError("the witness starts outside the set the claim is about")
    measured = loop.agent.order > 1 and not given
    if measured and point.observer != (point.x[0], *(Fraction(0),) * (loop.agent.order - 1)):
        raise InputError("the witness starts its observer elsewhere than at the measured output")


def _pairs(named: Mapping[str, object]) -> tuple[tuple[str, str], ...]:
    return tuple(sorted((str(name), str(value)) for name, value in named.items()))


def _texts(values: Sequence[Fraction]) -> list[str]:
    return [str(value) for value in values]


def _point(values: object) -> Point:
    if not isinstance(values, list):
        raise TypeError("a list of numbers is needed")
    return tuple(_number(value) for value in values)


def _number(text: object) -> Fraction:
    if not isinstance(text, str) or not _EXACT.fullmatch(text):
        raise TypeError("a number is a string p or p/q")
    return Fraction(text)
