"""Python values as TOML: numbers stay exact, expressions become texts, symbols become names, quantities lose units."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any

import sympy

from symbolic.constants import as_fraction
from symbolic.errors import InputError
from symbolic.expression_text import expression_text, number_text
from symbolic.tables import Decimal as TomlDecimal

Units = Mapping[str, str]


def toml_value(value: Any, where: str = "value", units: Units | None = None, unit: str | None = None) -> str:
    """The value in one line of TOML.

    Floats are read as the decimals that Python prints for them, so 0.1 is 1/10. Strings are the plant file's own
    expressions. A quantity of pint is taken in ``unit`` (that of the name it belongs to in ``units``), else in SI base
    units. Raises ``InputError`` that names ``where``.
    """
    if isinstance(value, Mapping):
        return _table(value, where, units or {}, unit)
    if isinstance(value, TomlDecimal):
        return value.text
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if hasattr(value, "to_base_units"):
        return toml_value(_magnitude(value, where, unit), where)
    if isinstance(value, sympy.MatrixBase) or hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Iterable) and not isinstance(value, sympy.Basic):
        return f"[{', '.join(toml_value(entry, where, units, unit) for entry in value)}]"
    number = exact_number(value, where)
    if number is not None:
        return number_text(number)
    if isinstance(value, sympy.Expr):
        return json.dumps(expression_text(value))
    raise InputError(f"{where}: a number, an expression or a text is needed, found {type(value).__name__}")


def exact_number(value: Any, where: str) -> Fraction | None:
    """The exact value of a number; ``None`` for what is no number. Raises ``InputError`` where it is not finite."""
    if isinstance(value, bool):
        raise InputError(f"{where}: a number is needed, found {value}")
    if isinstance(value, int | Fraction):
        return Fraction(value)
    if isinstance(value, float | Decimal):
        if not math.isfinite(value):
            raise InputError(f"{where}: a finite number is needed, found {value}")
        return Fraction(repr(value) if isinstance(value, float) else value)
    if isinstance(value, sympy.Rational):
        return as_fraction(value)
    return None


def _table(value: Mapping[Any, Any], where: str, units: Units, unit: str | None) -> str:
    entries = [
        f"{key} = {toml_value(entry, f'{where}.{key}', units, units.get(str(key), unit))}"
        for key, entry in value.items()
        if entry is not None
    ]
    return "{ " + ", ".join(entries) + " }" if entries else "{}"


def _magnitude(quantity: Any, where: str, unit: str | None) -> Any:
    """Pint's own error says which dimensions do not fit."""
    try:
        converted = quantity.to_base_units() if unit is None else quantity.to(unit)
    except (TypeError, AttributeError, ValueError) as error:  # what pint's errors are, which is an extra
        raise InputError(f"{where}: {error}") from error
    return converted.magnitude
