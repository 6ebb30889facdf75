#!/usr/bin/env bash
# SymPy 1.14.0: the text that str() makes of an evaluated expression does not read back as that expression. A rational
# coefficient is printed into the denominator, and reading the product there multiplies it out: x/3/(y + 1) is printed
# as x/(3*(y + 1)) and comes back as x/(3*y + 3), a different tree of the same value; the product of -1, x + 1 and
# sin(9) comes back as (-x - 1)*sin(9). Equality, hashes and caches of expressions that went through their text differ.
# Printing each divisor for itself, x/3/(y + 1), reads back equal.
# Output seen: x/(3*(y + 1)) -> x/(3*y + 3) equal: False; -(x + 1)*sin(9) -> (-x - 1)*sin(9) equal: False
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet sympy==1.14.0
"$place/venv/bin/python" - <<'PYTHON'
import sympy

x, y = sympy.symbols("x y")
seen = []
for expr in (x / 3 / (y + 1), sympy.Mul(-1, x + 1, sympy.sin(9))):
    back = sympy.sympify(str(expr))
    seen.append(f"{expr} -> {back} equal: {back == expr}")
print("; ".join(seen))
assert sympy.sympify("x/3/(y + 1)") == x / 3 / (y + 1)
assert seen == [
    "x/(3*(y + 1)) -> x/(3*y + 3) equal: False",
    "-(x + 1)*sin(9) -> (-x - 1)*sin(9) equal: False",
], seen
PYTHON
