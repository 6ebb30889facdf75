"""The ``[initial]`` table of a plant file: the initial box, one interval per component of each agent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import partial

from symbolic import messages
from symbolic.errors import Where, did_you_mean, nearest, quoted
from symbolic.expressions import Refusal
from symbolic.interval import Interval
from symbolic.messages import Reason
from symbolic.names import Scope
from symbolic.plant import Agent, InitialBox
from symbolic.tables import Table, Value, array, interval, is_interval

MEASURED = "measured"
KEYS = ("box", "z", "x", "eta", "observer", "reference")

POINT = Interval(Fraction(0), Fraction(0))


class InitialTable:
    """``box`` is the default for ``z, x, eta, observer, reference`` (docs/plant-file.md, section 3).

    ``z``, ``x`` and ``observer`` hold one number or interval for all components, an array of one interval ``[lo, hi]``
    per component, or a table by component; a component that the table leaves out takes ``box``.
    """

    def __init__(self, table: Table, refused: Refusal) -> None:
        """``refused`` gives the reason why a name that is known elsewhere is not known here."""
        table.allow(KEYS)
        self.table = table
        self.refused = refused

    def box_of(self, order: int | None, zero_states: Sequence[str], scope: Scope) -> InitialBox:
        """The box of an agent of this order (of no chain, if that is not known) with these zero states.

        Raises ``InputError``.
        """
        chain = [f"x{k}" for k in range(1, (order or 0) + 1)]
        measured = self._is_measured()
        return InitialBox(
            z=self._components("z", zero_states, scope),
            x=self._components("x", chain, scope),
            observer=None if measured else self._components("observer", chain, scope),
            eta=self._one("eta", scope),
            reference=self._one("reference", scope),
        )

    def check(self, agents: Iterable[Agent], scope: Scope) -> None:
        """Refuses a component that no agent has, and faults in entries that no agent used."""
        if "box" in self.table:
            self._interval(self.table.entries["box"], self.table.at("box"), scope)
        agents = list(agents)
        chain = sorted({str(state) for agent in agents for state in agent.chain}, key=lambda name: int(name[1:]))
        zero = sorted({str(state) for agent in agents for state in agent.zero_states})
        for key, names in (("z", zero), ("x", chain), ("observer", chain)):
            if isinstance(self.table.entries.get(key), dict):
                self.table.table(key).allow(names, partial(_no_state, names))
            elif key in self.table and not names:
                self._interval(self.table.entries[key], self.table.at(key), scope)

    def _is_measured(self) -> bool:
        value = self.table.entries.get("observer")
        if isinstance(value, str) and value != MEASURED and nearest(value, [MEASURED]):
            raise self.table.at("observer").error(messages.MEASURED(word=quoted(value)))
        return value == MEASURED

    def _one(self, key: str, scope: Scope) -> Interval:
        used = key if key in self.table else "box"
        if used not in self.table:
            raise self.table.at(key).error(messages.NO_BOX())
        return self._interval(self.table.entries[used], self.table.at(used), scope)

    def _components(self, key: str, names: Sequence[str], scope: Scope) -> tuple[Interval, ...]:
        if not names:
            return ()
        value, where = self.table.entries.get(key), self.table.at(key)
        if isinstance(value, dict):
            return tuple(
                self._interval(value[name], where.at(name), scope)
                if name in value
                else self._default(where.at(name), scope)
                for name in names
            )
        if isinstance(value, list) and not is_interval(value):
            entries = array(value, where)
            if len(entries) != len(names):
                raise where.error(messages.COMPONENTS(names=", ".join(names), found=len(entries)))
            for k, entry in enumerate(entries, 1):
                if not is_interval(entry):
                    raise where.at(k).error(messages.PAIR())
            return tuple(self._interval(entry, where.at(k), scope) for k, entry in enumerate(entries, 1))
        return (self._one(key, scope),) * len(names)

    def _default(self, where: Where, scope: Scope) -> Interval:
        if "box" not in self.table:
            raise where.error(messages.NO_BOX())
        return self._interval(self.table.entries["box"], self.table.at("box"), scope)

    def _interval(self, value: Value, where: Where, scope: Scope) -> Interval:
        return where.attempt(partial(interval, value, where, scope.constants, self.refused), POINT)


def _no_state(names: Sequence[str], name: str) -> Reason:
    known = f"the states are {', '.join(names)}" if names else "leave this out"
    return messages.NO_STATE(name=quoted(name), hint=did_you_mean(name, names, known))
