"""Declared names of a plant file: what each stands for, and what may not be declared twice."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import sympy

from symbolic.errors import Where, quoted
from symbolic.grammar import CONSTANTS, FUNCTIONS, NAME
from symbolic.plant import COST_VARIABLE, symbol
from symbolic.tables import Table, Value, constant, kind

MAX_NAME = 40
MAX_IRRATIONAL = 48

_CHAIN = re.compile(r"x[0-9]+")


@dataclass(frozen=True)
class Scope:
    """Constants (exact values, ``id`` among them) and symbols that are visible; a name is declared once."""

    constants: Mapping[str, sympy.Expr] = field(default_factory=dict)
    exosystem: tuple[str, ...] = ()
    zero_states: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()

    def with_constants(self, table: Table, *, most: int) -> Scope:
        """The scope with the table's constants; each may use the earlier ones."""
        if len(table.entries) > most:
            raise table.where.error(f"{len(table.entries)} constants, more than {most}")
        constants = dict(self.constants)
        for name, value in table.entries.items():
            self._check_new(name, table.at(name), constants)
            constants[name] = constant(value, table.at(name), constants)
        if sum(not isinstance(value, sympy.Rational) for value in constants.values()) > MAX_IRRATIONAL:
            raise table.where.error(f"more than {MAX_IRRATIONAL} constants that are not rational")
        return replace(self, constants=constants)

    def with_id(self, number: int) -> Scope:
        return replace(self, constants={**self.constants, "id": sympy.Integer(number)})

    def with_state(self, name: Value, where: Where, role: str) -> Scope:
        """The scope with a state or parameter: role is ``an exosystem state``, ``a zero state`` or ``a parameter``."""
        if not isinstance(name, str):
            raise where.error(f"a name is needed, found {kind(name)}")
        self._check_new(name, where, self.constants)
        if role == "an exosystem state":
            return replace(self, exosystem=(*self.exosystem, name))
        if role == "a zero state":
            return replace(self, zero_states=(*self.zero_states, name))
        return replace(self, parameters=(*self.parameters, name))

    def values(self, *symbols: str) -> dict[str, sympy.Expr]:
        """What an expression sees: the constants and the symbols of the given names."""
        return {**self.constants, **{name: symbol(name) for name in symbols}}

    def _check_new(self, name: str, where: Where, constants: Mapping[str, sympy.Expr]) -> None:
        if not NAME.fullmatch(name) or len(name) > MAX_NAME:
            raise where.error(
                f"{quoted(name)} is not a name: an ASCII letter, then at most {MAX_NAME - 1} letters, "
                "digits or underscores"
            )
        roles = {
            "a function": FUNCTIONS,
            "the number 3.14159...": CONSTANTS,
            "the cost variable": (str(COST_VARIABLE),),
            "the agent's number": ("id",),
            "an exosystem state": self.exosystem,
            "a zero state": self.zero_states,
            "a parameter": self.parameters,
            "a constant": constants,
        }
        for role, names in roles.items():
            if name in names:
                raise where.error(f"the name {quoted(name)} is taken: it is {role}")
        if _CHAIN.fullmatch(name):
            raise where.error(f"the name {quoted(name)} is taken: x1, x2, ... are the states of the chain")
