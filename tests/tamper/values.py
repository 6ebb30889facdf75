"""Other values in place of one: of a number, a text, a list or a table. Nothing here knows a theorem."""

from __future__ import annotations

import copy
import re
from fractions import Fraction
from typing import Any

NUMBER = re.compile(r"-?[0-9]+(/[0-9]+)?")
DIGEST = re.compile(r"[0-9a-f]{64}")


def is_number(value: Any) -> bool:
    return isinstance(value, str) and NUMBER.fullmatch(value) is not None


def text(value: Fraction) -> str:
    return str(value)


def number_values(value: str) -> list[tuple[str, str]]:
    """Other numbers in place of one, written as they must be."""
    q = Fraction(value)
    p, d = q.numerator, q.denominator
    new: dict[str, Fraction] = {
        "sign": -q,
        "numerator + 1": Fraction(p + 1, d),
        "numerator - 1": Fraction(p - 1, d),
        "denominator + 1": Fraction(p, d + 1),
        "times 2": 2 * q,
        "half": q / 2,
        "plus 1": q + 1,
        "minus 1": q - 1,
        "square": q * q,
        "zero": Fraction(0),
        "one": Fraction(1),
        "minus one": Fraction(-1),
        "floor": Fraction(p // d),
        "third": q / 3,
        "times 3/2": q * 3 / 2,
    }
    if d > 1:
        new["denominator - 1"] = Fraction(p, d - 1)
    if q:
        new["reciprocal"] = 1 / q
    for k in (1, 3, 6, 9, 12, 30, 100):
        new[f"times 1e{k}"], new[f"times 1e-{k}"] = q * 10**k, q / 10**k
    for k in (1, 2, 3, 6, 9, 12, 18, 60):
        new[f"relative +1e-{k}"] = q * (1 + Fraction(1, 10**k))
        new[f"relative -1e-{k}"] = q * (1 - Fraction(1, 10**k))
    return [(name, text(entry)) for name, entry in new.items() if entry != q]


def number_changes(value: str) -> list[tuple[str, Any]]:
    """Other numbers, and the same number written as it must not be."""
    q = Fraction(value)
    p, d = q.numerator, q.denominator
    changes: list[tuple[str, Any]] = list(number_values(value))
    changes += [
        ("huge", "9" * 3999),
        ("tiny", "1/1" + "0" * 3998),
        ("longer than allowed", "9" * 4001),
        ("very long", "9" * 60_000),
    ]
    changes += [
        ("not in lowest terms", f"{2 * p}/{2 * d}"),
        ("denominator 1", f"{p}/1"),
        ("leading zero", "0" + value),
        ("leading zero in the denominator", f"{p}/0{d}"),
        ("plus sign", "+" + value),
        ("minus zero", "-0"),
        ("minus below", f"{p}/-{d}"),
        ("zero denominator", f"{p}/0"),
        ("two bars", value + "/1/1"),
        ("bar", value + "/"),
        ("space before", " " + value),
        ("space after", value + " "),
        ("newline after", value + "\n"),
        ("empty", ""),
        ("decimal", f"{p}.5"),
        ("exponent", f"{p}e3"),
        ("underscore", "1_0"),
        ("hexadecimal", "0x10"),
        ("nan", "nan"),
        ("infinity", "inf"),
        ("arabic digits", "".join(chr(0x660 + int(c)) if c.isdigit() else c for c in value)),
        ("full-width digits", "".join(chr(0xFF10 + int(c)) if c.isdigit() else c for c in value)),
        ("one half sign", "½"),
        ("superscript", value + "²"),
        ("nul", value + "\0"),
        ("integer, not text", p),
        ("float, not text", float(p % 1000) + 0.5),
        ("true", True),
        ("null", None),
        ("in a list", [value]),
        ("in a table", {"value": value}),
        ("rounded float", float(p % 1000)),
    ]
    return changes


def text_changes(value: str) -> list[tuple[str, Any]]:
    if DIGEST.fullmatch(value):
        flipped = ("0" if value[0] != "0" else "1") + value[1:]
        return [
            ("digest: one digit", flipped),
            ("digest: upper case", value.upper()),
            ("digest: short", value[:-1]),
            ("digest: long", value + "0"),
            ("digest: zeros", "0" * 64),
            ("digest: newline", value + "\n"),
            ("digest: rotated", value[1:] + value[0]),
            ("null", None),
            ("empty", ""),
        ]
    changes: list[tuple[str, Any]] = [
        ("empty", ""),
        ("null", None),
        ("integer", 1),
        ("in a list", [value]),
        ("zero", "0"),
        ("space after", value + " "),
        ("newline after", value + "\n"),
        ("upper case", value.upper()),
        ("twice", value + value),
        ("nul", value + "\0"),
        ("other version", value[:-1] + "2" if value else "2"),
        ("direct theorem", "direct/3"),
        ("recipe theorem", "recipe/2"),
        ("version 0", "recipe/0"),
        ("homoglyph", value.replace("e", "е")),
        ("long", value + "x" * 20_000),
    ]
    expressions = {
        "plus 1": f"{value} + 1",
        "negated": f"-({value})",
        "doubled": f"2*({value})",
        "in brackets": f"({value})",
        "plus 0": f"{value} + 0",
        "plus s": f"{value} + s",
        "times s": f"({value})*s",
        "plus 0 s": f"{value} + 0*s",
        "plus s - s": f"({value}) + s - s",
        "import": "__import__('os').getcwd()",
        "call": f"f({value})",
        "attribute": "s.real",
        "lambda": "lambda: 0",
        "comment": f"{value} # s",
        "other name": f"{value} + q",
        "state name": f"{value} + z1",
        "deep": "(" * 40 + value + ")" * 40,
        "very deep": "(" * 4000 + value + ")" * 4000,
        "power": f"({value})**64",
        "division by zero": f"({value})/0",
        "division by a zero": f"({value})/(s - s)",
        "huge power": "9**9**9**9",
        "tower": "exp(exp(exp(exp(s))))",
        "sine": f"({value}) + sin(s)^2 + cos(s)^2 - 1",
        "relative": f"({value})*1000001/1000000",
        "slightly more": f"{value} + 1/1000000000000*s",
        "many terms": "+".join(["s"] * 1500),
        "nan": "nan",
        "infinity": "1e9999",
        "complex": "sqrt(-1)",
        "log of zero": f"({value}) + log(s - s)",
    }
    return changes + list(expressions.items())


def list_changes(value: list[Any]) -> list[tuple[str, Any]]:
    n = len(value)
    changes: list[tuple[str, Any]] = [
        ("emptied", []),
        ("null", None),
        ("as a table", {}),
        ("as a text", "0"),
        ("nested", [value]),
        ("reversed", value[::-1]),
        ("doubled", value + value),
        ("0 appended", [*value, "0"]),
        ("1 appended", [*value, "1"]),
        ("[] appended", [*value, []]),
        ("null appended", [*value, None]),
        ("0 in front", ["0", *value]),
        ("600 entries", ["0"] * 600),
        ("flat", ["1"] * n),
    ]
    for k in range(min(n, 12)):
        changes.append((f"entry {k} dropped", value[:k] + value[k + 1 :]))
        changes.append((f"entry {k} twice", value[: k + 1] + value[k:]))
        if k:
            changes.append(
                (f"entries {k - 1}, {k} swapped", [*value[: k - 1], value[k], value[k - 1], *value[k + 1 :]])
            )
            changes.append((f"entry {k} := entry 0", [*value[:k], value[0], *value[k + 1 :]]))
    for name, factor in (
        ("times 2", Fraction(2)),
        ("half", Fraction(1, 2)),
        ("negated", Fraction(-1)),
        ("zeroed", Fraction(0)),
        ("times 1 + 1e-6", 1 + Fraction(1, 10**6)),
        ("times 1 - 1e-6", 1 - Fraction(1, 10**6)),
        ("times 1000", Fraction(1000)),
        ("times 1 + 1e-15", 1 + Fraction(1, 10**15)),
    ):
        changes.append((f"all {name}", scaled(value, factor)))
    if n and all(isinstance(row, list) and len(row) == n for row in value):
        changes.append(("transposed", [list(column) for column in zip(*value, strict=True)]))
        changes.append(("rows and columns reversed", [row[::-1] for row in value[::-1]]))
        changes.append(("identity", [[str(int(i == j)) for j in range(n)] for i in range(n)]))
        changes.append(("last row and column dropped", [row[:-1] for row in value[:-1]]))
        changes.append(("bordered", [[*row, "0"] for row in value] + [["0"] * n + ["1"]]))
        changes += [(f"[{i}][{j}] alone negated", _entry(value, i, j)) for i in range(n) for j in range(n) if i != j][
            :12
        ]
    if n == 2 and all(map(is_number, value)):
        lo, hi = map(Fraction, value)
        for name, pair in (
            ("widened", (lo - 1, hi + 1)),
            ("widened 1e-9", (lo - Fraction(1, 10**9), hi + Fraction(1, 10**9))),
            ("moved", (lo + 1, hi + 1)),
            ("moved 1e-12", (lo + Fraction(1, 10**12), hi + Fraction(1, 10**12))),
            ("narrowed to the lower end", (lo, lo)),
            ("narrowed to the upper end", (hi, hi)),
            ("ends swapped", (hi, lo)),
            ("inverted", (hi + 1, lo - 1)),
            ("huge", (-Fraction(10**300), Fraction(10**300))),
        ):
            changes.append((f"interval {name}", [text(end) for end in pair]))
    return changes


def scaled(value: Any, factor: Fraction) -> Any:
    if isinstance(value, list):
        return [scaled(entry, factor) for entry in value]
    return text(Fraction(value) * factor) if is_number(value) else value


def _entry(rows: list[list[Any]], i: int, j: int) -> list[list[Any]]:
    result = copy.deepcopy(rows)
    result[i][j] = scaled(result[i][j], Fraction(-1)) if rows[i][j] != "0" else "1"
    return result


def table_changes(value: dict[str, Any]) -> list[tuple[str, Any]]:
    changes: list[tuple[str, Any]] = [
        ("null", None),
        ("as a list", list(value.values())),
        ("as pairs", [[key, entry] for key, entry in value.items()]),
        ("emptied", {}),
        ("extra key", {**value, "extra": "0"}),
        ("extra key __class__", {**value, "__class__": "x"}),
        ("empty key", {**value, "": "0"}),
        ("verified: true", {**value, "verified": "true"}),
    ]
    keys = list(value)
    for key in keys:
        rest = {other: entry for other, entry in value.items() if other != key}
        changes.append((f"key {key} dropped", rest))
        changes.append((f"key {key} in upper case", {**rest, key.upper() + "_": value[key]}))
        changes.append((f"key {key} with a space", {**rest, key + " ": value[key]}))
        changes.append((f"key {key} null", {**value, key: None}))
    for k, first in enumerate(keys):
        for second in keys[k + 1 :]:
            if type(value[first]) is type(value[second]) and value[first] != value[second]:
                changes.append(
                    (f"keys {first}, {second} swapped", {**value, first: value[second], second: value[first]})
                )
    return changes


def changes(value: Any) -> list[tuple[str, Any]]:
    if is_number(value):
        return number_changes(value)
    if isinstance(value, str):
        return text_changes(value)
    if isinstance(value, list):
        return list_changes(value)
    if isinstance(value, dict):
        return table_changes(value)
    return [
        ("a number", "1"),
        ("zero", "0"),
        ("a list", []),
        ("a table", {}),
        ("a table with Q", {"Q": []}),
        ("true", True),
    ]
