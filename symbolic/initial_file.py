"""The ``[initial]`` table of a plant file: the initial box, one interval per component of each agent."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from symbolic.errors import nearest, quoted
from symbolic.names import Scope
from symbolic.plant import Agent, InitialBox, Interval
from symbolic.tables import Table, array, interval, is_interval

MEASURED = "measured"

_KEYS = ("box", "z", "x", "eta", "observer", "reference")


class InitialTable:
    """``box`` is the default for ``z, x, eta, observer, reference``.

    ``z``, ``x`` and ``observer`` hold one number or interval for all components, an array of one interval ``[lo, hi]``
    per component, or a table by component; a component that the table leaves out takes ``box``.
    """

    def __init__(self, table: Table) -> None:
        table.allow(_KEYS)
        self.table = table

    def box_of(self, order: int, zero_states: Sequence[str], scope: Scope) -> InitialBox:
        """The box of an agent of this order with these zero states. Raises ``InputError``."""
        chain = [f"x{k}" for k in range(1, order + 1)]
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
            interval(self.table.entries["box"], self.table.at("box"), scope.constants)
        agents = list(agents)
        chain = sorted({str(state) for agent in agents for state in agent.chain}, key=lambda name: int(name[1:]))
        zero = sorted({str(state) for agent in agents for state in agent.zero_states})
        for key, names in (("z", zero), ("x", chain), ("observer", chain)):
            if isinstance(self.table.entries.get(key), dict):
                self.table.table(key, names)
            elif key in self.table and not names:
                interval(self.table.entries[key], self.table.at(key), scope.constants)

    def _is_measured(self) -> bool:
        value = self.table.entries.get("observer")
        if isinstance(value, str) and value != MEASURED and nearest(value, [MEASURED]):
            raise self.table.at("observer").error(f"unknown word {quoted(value)}; did you mean {quoted(MEASURED)}?")
        return value == MEASURED

    def _one(self, key: str, scope: Scope) -> Interval:
        used = key if key in self.table else "box"
        if used not in self.table:
            raise self.table.at(key).error("missing, and there is no initial.box to stand for it")
        return interval(self.table.entries[used], self.table.at(used), scope.constants)

    def _components(self, key: str, names: Sequence[str], scope: Scope) -> tuple[Interval, ...]:
        if not names:
            return ()
        value, where = self.table.entries.get(key), self.table.at(key)
        if isinstance(value, dict):
            return tuple(
                interval(value[name], where.at(name), scope.constants)
                if name in value
                else self._default(key, name, scope)
                for name in names
            )
        if isinstance(value, list) and not is_interval(value):
            entries = array(value, where)
            if len(entries) != len(names):
                raise where.error(f"one interval for each of {', '.join(names)} is needed, found {len(entries)}")
            for k, entry in enumerate(entries, 1):
                if not is_interval(entry):
                    raise where.at(k).error("an interval is a pair [lo, hi]; write [1, 1] for a point")
            return tuple(interval(entry, where.at(k), scope.constants) for k, entry in enumerate(entries, 1))
        return (self._one(key, scope),) * len(names)

    def _default(self, key: str, name: str, scope: Scope) -> Interval:
        if "box" not in self.table:
            raise self.table.at(key).at(name).error("missing, and there is no initial.box to stand for it")
        return interval(self.table.entries["box"], self.table.at("box"), scope.constants)
