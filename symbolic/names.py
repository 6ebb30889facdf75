"""Declared names of a plant file: what each stands for, and what may not be declared twice."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial

import sympy

from symbolic import messages
from symbolic.errors import Where, quoted
from symbolic.grammar import CONSTANTS, FUNCTIONS, NAME
from symbolic.plant import COST_VARIABLE, symbol
from symbolic.tables import Table, Value, constant, kind

MAX_NAME = 40
MAX_IRRATIONAL = 48
# stands in for a constant that could not be read, so that what uses it is not refused as well; no plant is made of it
STAND_IN = sympy.Rational(*Fraction("1.000003000019").as_integer_ratio())

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
            table.where.report(messages.TOO_MANY(count=len(table.entries), what="constants", most=most))
            return self
        constants = dict(self.constants)
        later = {name: messages.COMES_LATER(name=name) for name in table.entries}
        for name, value in table.entries.items():
            where = table.at(name)
            later.pop(name)
            if self._is_new(name, where, constants):
                constants[name] = where.attempt(partial(constant, value, where, constants, later.get), STAND_IN)
        irrational = sum(not isinstance(value, sympy.Rational) for value in constants.values())
        if table.entries and irrational > MAX_IRRATIONAL:
            table.where.report(messages.IRRATIONAL(most=MAX_IRRATIONAL))
        return replace(self, constants=constants)

    def with_id(self, number: int) -> Scope:
        return replace(self, constants={**self.constants, "id": sympy.Integer(number)})

    def with_state(self, name: Value, where: Where, role: str) -> Scope:
        """The scope with a state or parameter: role is ``an exosystem state``, ``a zero state`` or ``a parameter``.

        A name that cannot be declared is reported, and the scope is as it was.
        """
        if not isinstance(name, str):
            where.report(messages.NAME(found=kind(name)))
            return self
        if not self._is_new(name, where, self.constants):
            return self
        if role == "an exosystem state":
            return replace(self, exosystem=(*self.exosystem, name))
        if role == "a zero state":
            return replace(self, zero_states=(*self.zero_states, name))
        return replace(self, parameters=(*self.parameters, name))

    def values(self, *symbols: str) -> dict[str, sympy.Expr]:
        """What an expression sees: the constants and the symbols of the given names."""
        return {**self.constants, **{name: symbol(name) for name in symbols}}

    def _is_new(self, name: str, where: Where, constants: Mapping[str, sympy.Expr]) -> bool:
        if not NAME.fullmatch(name) or len(name) > MAX_NAME:
            where.report(messages.NOT_A_NAME(name=quoted(name), most=MAX_NAME - 1), on_key=True)
            return False
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
        role = next((f"it is {role}" for role, names in roles.items() if name in names), None)
        if role is None and _CHAIN.fullmatch(name):
            role = "x1, x2, ... are the states of the chain"
        if role is not None:
            where.report(messages.NAME_TAKEN(name=quoted(name), role=role), on_key=True)
        return role is None
